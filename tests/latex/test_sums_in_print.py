"""The sums along a spectral shaft say what the rows say: printed LaTeX is read back and evaluated."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

import numpy as np
import pytest
from sympy import Expr

import shaftwork as sw
from shaftwork.equations.quantities import rate_of
from shaftwork.equations.records import Equations
from shaftwork.equations.spelling import without_marks

TOKEN = re.compile(
    r"\\sum_\{(?P<index>\w) ?= ?(?P<first>\d+)\}\^\{(?P<last>\d+)\}"
    r"|(?P<frac>\\frac)|(?P<space>\s+|\\[,!]|\\q?quad|\\(?:left|right|bigg?[lr]|\[1ex\]))"
    r"|(?P<number>\d+(?:\.\d+)?)|(?P<power>\^\{\d+\})|(?P<sign>[-+])|(?P<open>[(\[{])|(?P<close>[)\]}])"
    r"|(?P<name>(?:\\d?dot\{\\[a-z]+\}|\\[A-Za-z]+|[A-Za-z])'*(?:\^\{\(\d+\)\})?(?:_\{(?:[^{}]|\{[^{}]*\})*\})?)"
)


class Reader:
    """Evaluates sums and products of printed names, and sums over an index."""

    def __init__(self, text: str, values: Mapping[str, float]) -> None:
        matches = list(TOKEN.finditer(text))
        assert "".join(match[0] for match in matches) == text
        self.tokens = [match for match in matches if not match["space"]]
        self.values, self.indices, self.place = values, dict[str, int](), 0

    def kind(self) -> str | None:
        return self.tokens[self.place].lastgroup if self.place < len(self.tokens) else None

    def take(self) -> re.Match[str]:
        self.place += 1
        return self.tokens[self.place - 1]

    def total(self) -> float:
        result = 0.0
        while self.kind() not in (None, "close"):
            sign = -1.0 if self.kind() == "sign" and self.take()[0] == "-" else 1.0
            result += sign * self.product()
        return result

    def product(self) -> float:
        result = 1.0
        while self.kind() not in (None, "close", "sign"):
            result *= self.factor()
        return result

    def bracket(self) -> float:
        self.take()
        result = self.total()
        self.take()
        return result

    def factor(self) -> float:
        match self.kind():
            case "open":
                base = self.bracket()
            case "frac":
                self.take()
                base = self.bracket() / self.bracket()
            case "last":
                base = self.summed()
            case "number":
                base = float(self.take()[0])
            case _:
                name = self.take()[0]
                for index, number in self.indices.items():
                    name = re.sub(rf"(?<=[{{,]){index}(?=[,}}])", str(number), name)
                base = self.values[name]
        return base ** int(self.take()[0][2:-1]) if self.kind() == "power" else base

    def summed(self) -> float:
        head = self.take()
        start, result = self.place, 0.0
        for number in range(int(head["first"]), int(head["last"]) + 1):
            self.place, self.indices[head["index"]] = start, number
            result += self.product()
        del self.indices[head["index"]]
        return result


def read(text: str, values: Mapping[str, float], **indices: int) -> float:
    reader = Reader(re.sub(r"\\q?quad \\text\{for .*", "", text), values)
    reader.indices |= indices
    return reader.total()


def joined(text: str) -> list[str]:
    """The rows of LaTeX, those that are broken on one line."""
    rows: list[str] = []
    for line in re.split(r" \\\\(?:\[1ex\])?\n|\n", text):
        if line.startswith((r"&\quad", r"&\qquad")):
            rows[-1] += line.replace("&", " ", 1)
        else:
            rows.append(line)
    return rows


def printed_rows(text: str) -> dict[str, str]:
    """Right sides by left sides, each on one line."""
    rows = joined(text)
    sides = (row.partition("&= ") for row in rows if "&= " in row)
    return {left.strip(): right for left, _, right in sides}


def weights(degree: int, mark: str) -> dict[str, float]:
    """w, h and lambda as their definitions have them."""
    nodes = (1 + np.array([-1.0, *np.sort(np.polynomial.Legendre.basis(degree).deriv().roots().real), 1.0])) / 2
    points, doubled = np.polynomial.legendre.leggauss(degree)
    values = {rf"\lambda{mark}_{{{k}}}": weight / 2 for k, weight in enumerate(doubled)}
    for j in range(degree + 1):
        lagrange = np.polynomial.Polynomial.fromroots(np.delete(nodes, j))
        lagrange = lagrange / lagrange(nodes[j])
        values[f"h{mark}_{{{j}}}"] = lagrange.integ()(1.0)
        slopes = -lagrange.deriv()((1 + points) / 2) * doubled / 2
        values |= {f"w{mark}_{{{k},{j}}}": slope for k, slope in enumerate(slopes)}
    return values


def train(*degrees: int) -> sw.Network:
    """Shafts in a row between a motor and, behind a gear, a load."""
    net = sw.Network("train")
    net.add(sw.TorqueSource("T", tau=12.0), "n0")
    net.add(sw.Inertia("J", J=0.02), "n0")
    for k, degree in enumerate(degrees):
        shaft = sw.Shaft(f"{'xy'[k]}", length=2.0, diameter=0.02, damping=0.1, friction=0.2, model=sw.Spectral(degree))
        net.add(shaft, f"n{k}", f"n{k + 1}")
    net.add(sw.Gear("g", ratio=2.5), f"n{len(degrees)}", "z")
    net.add(sw.Inertia("Z", J=0.3), "z")
    net.add(sw.Damper("D", d=0.7), "z")
    return net


def sampled(equations: Equations, degrees: tuple[int, ...]) -> tuple[dict[str, float], dict[Expr, float]]:
    """Random values of all quantities by their LaTeX and by their symbols; ends of shafts have those of their nodes."""
    generator, numbers = np.random.default_rng(3), dict(equations.values)
    names = {name: without_marks(latex) for name, latex in equations.symbol_names.items()}
    quantities = equations.assembly.quantities
    for letter in equations.letters:
        numbers.setdefault(letter.name, generator.uniform(-1, 1))
    for node in range(len(equations.form.graph.nodes)):
        base, _, subscript = names[quantities.angle(node).name].partition("_")
        speed = rate_of(quantities.angle(node))
        for dots, symbol in (("dot", speed), ("ddot", rate_of(speed))):
            numbers[symbol.name] = generator.uniform(-1, 1)
            names[symbol.name] = rf"\{dots}{{{base}}}_{subscript}"
    printed = {names[name]: number for name, number in numbers.items()}
    for part, degree in zip("xy", degrees, strict=False):
        printed |= weights(degree, f"^{{({degree})}}" if len(set(degrees)) > 1 else "")
        shaft = next(graph_part for graph_part in equations.form.graph.parts if graph_part.name == part)
        for number, end in ((0, "a"), (degree, "b")):
            printed[rf"\omega_{{\mathrm{{{part}}},{number}}}"] = numbers[quantities.node(shaft.nodes[end]).name]
    symbols = {symbol: numbers[symbol.name] for symbol in _symbols(equations) if symbol.name in numbers}
    return printed, symbols


def _symbols(equations: Equations) -> Iterator[Expr]:
    for row in equations.states:
        yield from row.right.free_symbols
    form = equations.second_order
    for k in range(len(form.coordinates)):
        yield from (symbol for term in (*form.terms(k), form.forces[k]) for symbol in term.free_symbols)


@pytest.mark.parametrize("degrees", [(2,), (8,), pytest.param((3, 8), marks=pytest.mark.slow)])
def test_the_printed_state_equations_are_the_rows(degrees: tuple[int, ...]) -> None:
    """1e-9 is what the coefficients of Lagrange polynomials, and six printed digits of nothing, lose to rounding."""
    equations = train(*degrees).equations()
    printed, symbols = sampled(equations, degrees)
    rows = printed_rows(equations.latex(form="state"))
    for part, degree in zip("xy", degrees, strict=False):
        (name,) = (left for left in rows if left.startswith(r"\tau_") and left.endswith(rf"\mathrm{{{part}}},k}}"))
        for k in range(degree):
            printed[name.replace(",k}", f",{k}}}")] = read(rows[name], printed, k=k)
    seen = 0
    for row in equations.states:
        expected = float(row.right.xreplace(symbols))
        latex = without_marks(equations.symbol_names[row.name])
        general = {re.sub(r",\d+\}$", f",{index}}}", latex): index for index in "jk"}
        left = {rf"\frac{{d {text}}}{{d t}}": index for text, index in {**general, latex: ""}.items()}
        found = next(text for text in left if text in rows)
        number = int(re.findall(r"(\d+)\}$", latex)[0]) if left[found] else 0
        assert read(rows[found], printed, **({left[found]: number} if left[found] else {})) == pytest.approx(
            expected, rel=1e-9, abs=1e-9
        ), row.name
        seen += bool(left[found])
    assert seen == sum(2 * degree - 1 for degree in degrees)


def test_no_row_at_an_end_takes_more_than_two_lines() -> None:
    text = sw.scenes.SCENES["ship-line"]().equations().latex()
    assert not re.search(r"\d\.\d{4}", text.partition(r"\paragraph{Laws of the parts}")[0])
    state = text.partition(r"\paragraph{State equations}")[2].partition(r"\paragraph")[0]
    lengths = [len(row.split("\\\\\n")) for row in state.split(r"\\[1ex]")]
    assert max(lengths) <= 2 + state.count("&= ")
    assert state.count(r"&\quad") <= 2


def test_the_printed_second_order_form_is_that_of_the_matrices() -> None:
    equations = train(4).equations()
    printed, symbols = sampled(equations, (4,))
    form = equations.second_order
    rows = (row.strip(" &") for row in joined(equations.latex(form="second-order")))
    ends = [row.partition("= ") for row in (re.sub(r"(?<=\w) = (?=\d)", "=", row) for row in rows) if r"\ddot" in row]
    ends = [end for end in ends if "text{for" not in end[2]]
    positions = {
        rf"{accent}_{{\mathrm{{x}},{number}}}": node
        for number, node in ((0, "a"), (4, "b"))
        for accent in (r"\varphi", r"\dot{\varphi}", r"\ddot{\varphi}")
    }
    part = next(part for part in equations.form.graph.parts if part.name == "x")
    for latex, end in positions.items():
        node = part.nodes[end]
        symbol = form.at.positions[node]
        for _ in range(latex.count("dot") and (2 if "ddot" in latex else 1)):
            symbol = form.at.rate(symbol)
        printed[latex] = float(
            symbol.xreplace({s: _number(equations, s, printed, symbols) for s in symbol.free_symbols})
        )
    outer = [k for k, name in enumerate(form.nodes) if not name.startswith("x.")]
    assert len(ends) == len(outer) == 2
    for row, (left, _, right) in zip(outer, ends, strict=True):
        expected = sum(float(term.xreplace(symbols)) for term in form.terms(row)) - float(
            form.forces[row].xreplace(symbols)
        )
        assert read(left, printed) - read(right, printed) == pytest.approx(expected, rel=1e-9)


def _number(equations: Equations, symbol: Expr, printed: Mapping[str, float], symbols: Mapping[Expr, float]) -> float:
    return symbols[symbol] if symbol in symbols else printed[without_marks(equations.symbol_names[symbol.name])]
