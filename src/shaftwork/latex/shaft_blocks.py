"""Long shafts in print: before they are divided, and as sums over weights where their torques depend on all speeds."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from sympy import Derivative, Eq, Expr, Integer, Mul, Symbol
from sympy.core.function import AppliedUndef

from shaftwork.components.base import Derived
from shaftwork.components.shaft_models import Spectral
from shaftwork.components.shafts import Shaft
from shaftwork.core.domains import ROTATION
from shaftwork.equations.assembly import sides, terms_of
from shaftwork.equations.letters import parameter_letters, with_derived
from shaftwork.equations.notations import Letter, in_letters, inverses_of
from shaftwork.equations.quantities import Quantities, rate_of
from shaftwork.equations.spelling import INDEX_CLOSES, INDEX_OPENS, without_marks
from shaftwork.latex.printing import Line, Writer, with_rates
from shaftwork.network.graph import GraphPart
from shaftwork.network.kinds import Kind

if TYPE_CHECKING:
    from shaftwork.equations.fields import Field

LAST_INDEX = re.compile(f"{INDEX_OPENS}[0-9]+{INDEX_CLOSES}(?!.*{INDEX_OPENS})")
MEANING = r"""Here $\ell_{j}$ are the Lagrange polynomials of the $n + 1$ nodes of Gauss and Lobatto in $[0, 1]$ and
$h_{j}$ the weights of their quadrature, $y_{k}$ and $\lambda_{k}$ the $n$ nodes and weights of Gauss; $n$ is the degree
of the spectral model."""
WEIGHTS = Line("w_{k,j}", (r"- \lambda_{k} \, \ell_{j}'(y_{k})",))
"""The definition of the weights."""


@dataclass(frozen=True, eq=False)
class Sums:
    """The general rows of a shaft.

    Args:
        part: the shaft.
        degree: of its spectral model.
        quantities: the symbols of the network.
        writer: prints them.
    """

    part: GraphPart
    degree: int
    quantities: Quantities
    writer: Writer

    @cached_property
    def inside(self) -> frozenset[int]:
        """The nodes between its ends."""
        return frozenset(self.part.nodes[str(j)] for j in range(1, self.degree))

    @cached_property
    def twists(self) -> frozenset[int]:
        """The nodes whose speeds are its rates of twist."""
        return frozenset(self.part.nodes[f"twist{k}"] for k in range(self.degree))

    def balance(self) -> Line:
        """J' L h_j d(omega_j)/dt = - sum_k w_kj tau_k, less what bearings take."""
        coupling = next(k for k in self.part.branches if self.quantities.graph.branches[k].terms)
        torques = _sum("k", self.degree - 1, self._indexed(self.quantities.multiplier(coupling), "k"))
        rate, inertia = self._indexed(rate_of(self._inner), "j"), self._shown("line_inertia", "length")
        bearing = (rf"- {self._shown('friction', 'length')} \, h_{{j}} \, {self._speed('j')}",)
        pieces = (f"- {torques}", *(bearing if self._has("friction") else ()))
        return Line(rf"{inertia} \, h_{{j}} \, {rate}", pieces, _range("j", 1, self.degree - 1))

    def loops(self) -> Iterator[Line]:
        """The rates of twist, and what the speeds of the ends are called in them."""
        twist = self._indexed(self.quantities.node(self.part.nodes["twist0"]), "k")
        yield Line(twist, (self._twist,), _range("k", 0, self.degree - 1))
        yield from self._ends()

    def states(self) -> Iterator[Line]:
        """The rates of the speeds and torques inside."""
        branches, numbers = self.quantities.graph.branches, _range("k", 0, self.degree - 1)
        stored = next(k for k in self.part.branches if branches[k].template.kind is Kind.THROUGH_STORE)
        store, total = self.quantities.store(stored), self.quantities.through(self.quantities.flow_of[stored])
        driven = rf"- {self._shown(below=('line_inertia', 'length'))} \, "
        bearing = (rf"- {self._shown('friction', below=('line_inertia',))} \, h_{{j}} \, {self._speed('j')}",)
        pieces = (
            driven + _sum("k", self.degree - 1, self._indexed(total, "k")),
            *(bearing if self._has("friction") else ()),
        )
        yield Line(rf"h_{{j}} \, {self._indexed(rate_of(self._inner), 'j')}", pieces, _range("j", 1, self.degree - 1))
        stiffness = self._shown("line_stiffness", below=("length",))
        rate = self._indexed(rate_of(store), "k")
        yield Line(rf"\lambda_{{k}} \, {rate}", (rf"{stiffness} \, {self._twist}",), numbers)
        if total != store:
            damping = rf"+ \frac{{1}}{{\lambda_{{k}}}} \, {self._shown('damping', below=('length',))} \, {self._twist}"
            yield Line(self._indexed(total, "k"), (self._indexed(store, "k"), damping), numbers)
        yield from self._ends()

    def motion(self) -> Iterator[Line]:
        """The rows of the second-order form inside, and what the angles of the ends are called in them."""
        angle = self._angle
        speed = rate_of(angle)
        pieces = [rf"{self._shown('line_inertia', 'length')} \, h_{{j}} \, {self._indexed(rate_of(speed), 'j')}"]
        if self._has("friction"):
            pieces.append(rf"+ {self._shown('friction', 'length')} \, h_{{j}} \, {self._indexed(speed, 'j')}")
        pieces += (f"+ {torque}" for torque in self.elastic("j"))
        yield Line("", (*pieces, "= 0"), _range("j", 1, self.degree - 1), relation="")
        for number, end in self.ends:
            symbol = self.writer.latex(self.quantities.angle(self.part.nodes[end]))
            yield Line("", (self._indexed(angle, str(number)), f"= {symbol}"), relation="")

    def elastic(self, index: str) -> Iterator[str]:
        """The torques of damping and stiffness against the motion of the node of an index."""
        for name, symbol in self._twisting:
            outer = rf"\sum_{{k = 0}}^{{{self.degree - 1}}} \frac{{w_{{k,{index}}}}}{{\lambda_{{k}}}}"
            yield rf"{self._shown(name, below=('length',))} {outer} {self._twisted(symbol)}"

    def kinetic(self) -> Iterator[str]:
        """The kinetic energy."""
        yield rf"\frac{{1}}{{2}} \, {self._shown('line_inertia', 'length')} \, {self._squares(rate_of(self._angle))}"

    def losses(self) -> Iterator[str]:
        """Half of the power that damping and bearings take."""
        yield from (self._stored(name, symbol) for name, symbol in self._twisting if name == "damping")
        if self._has("friction"):
            yield rf"\frac{{1}}{{2}} \, {self._shown('friction', 'length')} \, {self._squares(rate_of(self._angle))}"

    def potential(self) -> Iterator[str]:
        """The energy of the twist."""
        yield self._stored("line_stiffness", self._angle)

    def _stored(self, name: str, symbol: Symbol) -> str:
        over = rf"\sum_{{k = 0}}^{{{self.degree - 1}}} \frac{{1}}{{\lambda_{{k}}}}"
        factor = rf"\frac{{1}}{{2}} \, {self._shown(name, below=('length',))}"
        return rf"{factor} {over} \Bigl( {self._twisted(symbol)} \Bigr)^{{2}}"

    def _squares(self, symbol: Symbol) -> str:
        return rf"\sum_{{i = 0}}^{{{self.degree}}} h_{{i}} \, {self._indexed(symbol, 'i')}^{{2}}"

    def _twisted(self, symbol: Symbol) -> str:
        return rf"\sum_{{i = 0}}^{{{self.degree}}} w_{{k,i}} \, {self._indexed(symbol, 'i')}"

    @property
    def _twisting(self) -> tuple[tuple[str, Symbol], ...]:
        """What the twist is multiplied by, and whether its rate or the twist itself."""
        speed = (("damping", rate_of(self._angle)),) if self._has("damping") else ()
        return (*speed, ("line_stiffness", self._angle))

    @property
    def _angle(self) -> Symbol:
        return self.quantities.angle(self.part.nodes["1"])

    @property
    def ends(self) -> tuple[tuple[int, str], ...]:
        """Number and name of the nodes at its ends."""
        return ((0, "a"), (self.degree, "b"))

    def _ends(self) -> Iterator[Line]:
        for number, end in self.ends:
            yield Line(self._speed(str(number)), (self.writer.latex(self.quantities.node(self.part.nodes[end])),))

    @property
    def _inner(self) -> Symbol:
        return self.quantities.node(self.part.nodes["1"])

    @property
    def _twist(self) -> str:
        return _sum("j", self.degree, self._speed("j"))

    def _speed(self, index: str) -> str:
        return self._indexed(self._inner, index)

    def _indexed(self, symbol: Symbol, index: str) -> str:
        """A symbol, or its rate, with another index."""
        return LAST_INDEX.sub(index, self.writer.latex(symbol))

    def _has(self, parameter: str) -> bool:
        return f"{self.part.name}.{parameter}" in self.quantities.graph.parameters

    def _shown(self, *above: str, below: tuple[str, ...] = ()) -> str:
        """A quotient of products of parameters, by symbol or value."""
        symbols = [[self.quantities.graph.symbol_of(self.part, name) for name in names] for names in (above, below)]
        return self.writer.latex(Mul(*symbols[0]) / Mul(*symbols[1]))


def sums_of(quantities: Quantities, writer: Writer) -> tuple[Sums, ...]:
    """The general rows of every shaft that has them."""
    shafts = [(part, part.component.resolved) for part in quantities.graph.parts if isinstance(part.component, Shaft)]
    # up to degree 6 the weights are printed as numbers
    return tuple(
        Sums(part, model.n, quantities, writer) for part, model in shafts if isinstance(model, Spectral) and model.n > 6
    )


def _sum(index: str, last: int, term: str) -> str:
    return rf"\sum_{{{index} = 0}}^{{{last}}} w_{{k,j}} \, {term}"


def _range(index: str, first: int, last: int) -> str:
    return rf"\text{{for }} {index} = {first}, \dots, {last}"


def lines_of_field(field: Field, *, values: bool) -> tuple[tuple[Line, ...], tuple[Line, ...], tuple[Line, ...]]:
    """The rows, the boundary conditions and the definitions in LaTeX; with values there are no definitions."""
    found = (row.atoms(Derivative, AppliedUndef) for row in (*field.rows, *field.boundary))
    atoms = {atom: Symbol(str(atom), real=True) for of_row in found for atom in sorted(of_row, key=str)}
    writer, inverses = _field_writer(field, atoms, values=values), inverses_of(_field_letters(field))
    defined = () if values else in_letters(field.definitions, inverses)

    def line(row: Eq) -> Line:
        left, right = (side.xreplace(atoms).expand() for side in row.args)
        return writer.line(sides(left, terms_of(right)))

    return (
        tuple(dict.fromkeys(map(line, field.rows))),  # (14) and (15) have the same numbers
        tuple(map(line, field.boundary)),
        tuple(writer.line(sides(symbol, (law,))) for symbol, law in defined),
    )


def _field_letters(field: Field) -> tuple[Letter, ...]:
    """The letters of a shaft before it is divided."""
    component, name = field.part.component, field.part.name
    waves = Derived("v", Integer(0), "m/s", "speed of waves", "v")
    parameters = parameter_letters(name, (*component.declared.values(), *field.derived, waves))
    quantities = (("tau", ROTATION.through, ""), ("tau_c", ROTATION.through, "c"), ("omega", ROTATION.across, ""))
    variables = (Letter(f"{name}.{label}", q.latex, mark, q.unit, "") for label, q, mark in quantities)
    return tuple(map(field.equations.notation.written, (*parameters, *variables)))


def _field_names(field: Field) -> dict[str, str]:
    """These letters in LaTeX, with the subscript that the shaft's length has."""
    _, _, subscript = field.equations.symbol_names[f"{field.part.name}.length"].partition("_")
    printed = subscript.removeprefix("{").removesuffix("}")
    return {letter.name: letter.printed(printed) for letter in _field_letters(field)}


def _field_writer(field: Field, atoms: Mapping[Expr, Symbol], *, values: bool) -> Writer:
    """Prints parameters, quantities of the network, and functions of x and t by the symbols that stand for them."""
    equations, letters = field.equations, _field_letters(field)
    rates = with_rates(equations.symbol_names, equations.notation.rate_of)
    along = {name: latex for shaft in equations.fields for name, latex in _field_names(shaft).items()}
    functions = {symbol.name: _printed(atom, along) for atom, symbol in atoms.items()}
    names = {**along, **functions, **{name: latex for name, latex in rates.items() if name not in along}}
    parameters = {letter.name for letter in (*equations.letters, *letters) if letter.parameter}
    ordered = {name: names[name] for name in sorted(names, key=lambda name: name not in parameters)}
    numbers = with_derived(equations.values, field.definitions) if values else {}
    return Writer(ordered, parameters, [symbol.name for symbol in atoms.values()], numbers, inverses_of(letters))


def _printed(atom: Expr, letters: Mapping[str, str]) -> str:
    """A function of x and t, or a derivative of one."""
    function = atom.expr if isinstance(atom, Derivative) else atom
    where = ", ".join(without_marks(letters.get(str(place), str(place))) for place in function.args)
    text = f"{letters[str(function.func)]}({where})"
    if not isinstance(atom, Derivative):
        return text
    order = sum(times for _, times in atom.variable_count)
    power = f"^{{{order}}}" if order > 1 else ""
    below = r" \, ".join(rf"\partial {v}" + (f"^{{{n}}}" if n > 1 else "") for v, n in atom.variable_count)
    return rf"\frac{{\partial{power} {text}}}{{{below}}}"
