"""A spectral shaft in print: its rows as sums over the weights of its nodes, one general row for all inside."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from sympy import Expr, Integer, Mul, Symbol

from shaftwork.core.domains import ROTATION, Quantity
from shaftwork.equations.letters import WORDS
from shaftwork.equations.quantities import Quantities, rate_of
from shaftwork.equations.spelling import INDEX_CLOSES, INDEX_OPENS, in_text
from shaftwork.latex.compact_rows import SpectralShaft
from shaftwork.latex.nomenclature import Cells, unit
from shaftwork.latex.printing import Line, Writer
from shaftwork.network.graph import GraphPart

LAST_INDEX = re.compile(f"{INDEX_OPENS}[0-9]+{INDEX_CLOSES}(?!.*{INDEX_OPENS})")
MEANING = r"""Here $\ell_{j}$ are the Lagrange polynomials of the $n + 1$ nodes of Gauss and Lobatto in $[0, 1]$ and
$h_{j}$ the weights of their quadrature, $y_{k}$ and $\lambda_{k}$ the $n$ nodes and weights of Gauss; $n$ is the degree
of the spectral model."""


@dataclass(frozen=True, eq=False)
class Sums:
    """The general rows of a shaft.

    Args:
        shaft: its nodes, torques and weights.
        writer: prints the quantities of the network.
    """

    shaft: SpectralShaft
    writer: Writer

    @property
    def part(self) -> GraphPart:
        """The shaft in the network."""
        return self.shaft.part

    @property
    def _quantities(self) -> Quantities:
        return self.shaft.quantities

    @property
    def _last(self) -> int:
        return self.shaft.degree - 1

    def definition(self) -> Line:
        """The weights of the derivative."""
        mark = self.shaft.mark
        return Line(f"w{mark}_{{k,j}}", (rf"- \lambda{mark}_{{k}} \, \ell{mark}_{{j}}'(y{mark}_{{k}})",))

    def balance(self) -> Line:
        """J' L h_j d(omega_j)/dt = - sum_k w_kj tau_k, less what bearings take."""
        rate, inertia = self._indexed(rate_of(self._inner), "j"), self._shown("line_inertia", "length")
        bearing = (rf"- {self._shown('friction', 'length')} \, {self._h} \, {self._speed('j')}",)
        pieces = (f"- {self._driving}", *(bearing if self._has("friction") else ()))
        return Line(rf"{inertia} \, {self._h} \, {rate}", pieces, self._inside)

    def loops(self) -> Iterator[Line]:
        """The rates of twist, and what the speeds of the ends are called in them."""
        yield Line(self._rate_of_twist, (self._twist,), self._along)
        yield from self._ends()

    def laws(self) -> Iterator[Line]:
        """The torques by the rates of twist."""
        yield from self._along_it(self._rate_of_twist)

    def states(self) -> Iterator[Line]:
        """The rates of the speeds and torques inside."""
        driven = self._shown(below=("line_inertia", "length"), weight=self.shaft.share("j"))
        bearing = (rf"- {self._shown('friction', below=('line_inertia',))} \, {self._speed('j')}",)
        pieces = (rf"- {driven} \, {self._driving}", *(bearing if self._has("friction") else ()))
        yield Line(self._indexed(rate_of(self._inner), "j"), pieces, self._inside)
        yield from self._along_it(self._twist)
        yield from self._ends()

    def _along_it(self, twist: str) -> Iterator[Line]:
        """The torques by the rates of twist."""
        stiffness, damping = (
            self._shown(name, below=("length",), weight=self.shaft.weight) for name in ("line_stiffness", "damping")
        )
        yield Line(self._rate_of_store, (rf"{stiffness} \, {twist}",), self._along)
        if self._damped:
            yield Line(self._torque, (self._store, rf"+ {damping} \, {twist}"), self._along)

    def motion(self, positions: Mapping[int, Expr] | None = None) -> Iterator[Line]:
        """The rows of the second-order form inside, and what the angles of the ends are called in them.

        Args:
            positions: the angles of nodes in coordinates, where they are no coordinates themselves.
        """
        angle = self._angle
        speed = rate_of(angle)
        pieces = [rf"{self._shown('line_inertia', 'length')} \, {self._h} \, {self._indexed(rate_of(speed), 'j')}"]
        if self._has("friction"):
            pieces.append(rf"+ {self._shown('friction', 'length')} \, {self._h} \, {self._indexed(speed, 'j')}")
        pieces += (f"+ {torque}" for torque in self.elastic("j"))
        yield Line("", (*pieces, "= 0"), self._inside, relation="")
        for number, end in self.shaft.ends:
            node = self.part.nodes[end]
            position = positions[node] if positions else self._quantities.angle(node)
            yield Line("", (self._indexed(angle, str(number)), f"= {self.writer.latex(position)}"), relation="")

    def elastic(self, index: str) -> Iterator[str]:
        """The torques of damping and stiffness against the motion of the node of an index."""
        for name, symbol in self._twisting:
            outer = rf"\sum_{{k = 0}}^{{{self._last}}} \frac{{{self._w('k', index)}}}{{{self._weight}}}"
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
        over = rf"\sum_{{k = 0}}^{{{self._last}}} \frac{{1}}{{{self._weight}}}"
        factor = rf"\frac{{1}}{{2}} \, {self._shown(name, below=('length',))}"
        return rf"{factor} {over} \Bigl( {self._twisted(symbol)} \Bigr)^{{2}}"

    def _squares(self, symbol: Symbol) -> str:
        mark, last = self.shaft.mark, self.shaft.degree
        return rf"\sum_{{i = 0}}^{{{last}}} h{mark}_{{i}} \, {self._indexed(symbol, 'i')}^{{2}}"

    def _twisted(self, symbol: Symbol) -> str:
        return rf"\sum_{{i = 0}}^{{{self.shaft.degree}}} {self._w('k', 'i')} \, {self._indexed(symbol, 'i')}"

    @property
    def _twisting(self) -> tuple[tuple[str, Symbol], ...]:
        """What the twist is multiplied by, and whether its rate or the twist itself."""
        speed = (("damping", rate_of(self._angle)),) if self._damped else ()
        return (*speed, ("line_stiffness", self._angle))

    def _ends(self) -> Iterator[Line]:
        for number, end in self.shaft.ends:
            yield Line(self._speed(str(number)), (self.writer.latex(self._quantities.node(self.part.nodes[end])),))

    def of_ends(self, used: Collection[str]) -> Iterator[tuple[str, Quantity]]:
        """What speeds and angles of the ends are called in sums, where these are printed."""
        for symbol, quantity in ((self._inner, ROTATION.across), (self._angle, ROTATION.integral)):
            if symbol.name in used:
                yield ", ".join(f"${self._indexed(symbol, str(number))}$" for number, _ in self.shaft.ends), quantity

    @property
    def _angle(self) -> Symbol:
        return self._quantities.angle(self.part.nodes["1"])

    @property
    def _inner(self) -> Symbol:
        return self._quantities.node(self.part.nodes["1"])

    @property
    def _rate_of_twist(self) -> str:
        return self._indexed(self._quantities.node(self.part.nodes["twist0"]), "k")

    @property
    def _twist(self) -> str:
        return rf"\sum_{{j = 0}}^{{{self.shaft.degree}}} {self._w('k', 'j')} \, {self._speed('j')}"

    @property
    def _driving(self) -> str:
        return rf"\sum_{{k = 0}}^{{{self._last}}} {self._w('k', 'j')} \, {self._torque}"

    @property
    def _torque(self) -> str:
        return self._indexed(self.shaft.torques[0], "k")

    @property
    def _store(self) -> str:
        return self._indexed(self.shaft.stores[0], "k")

    @property
    def _rate_of_store(self) -> str:
        return self._indexed(rate_of(self.shaft.stores[0]), "k")

    def _speed(self, index: str) -> str:
        return self._indexed(self._inner, index)

    @property
    def _h(self) -> str:
        return f"h{self.shaft.mark}_{{j}}"

    @property
    def _weight(self) -> str:
        return rf"\lambda{self.shaft.mark}_{{k}}"

    def _w(self, *indices: str) -> str:
        return f"w{self.shaft.mark}_{{{','.join(indices)}}}"

    def _indexed(self, symbol: Symbol, index: str) -> str:
        """A symbol, or its rate, with another index."""
        return LAST_INDEX.sub(index, self.writer.latex(symbol))

    @property
    def _inside(self) -> str:
        return _range("j", 1, self.shaft.degree - 1)

    @property
    def _along(self) -> str:
        return _range("k", 0, self._last)

    @property
    def _damped(self) -> bool:
        return self._has("damping")

    def _has(self, parameter: str) -> bool:
        return f"{self.part.name}.{parameter}" in self._quantities.graph.parameters

    def _shown(self, *above: str, below: tuple[str, ...] = (), weight: Expr = Integer(1)) -> str:  # noqa: B008
        """A quotient of products of parameters, by symbol or value, over a weight."""
        symbols = [[self._quantities.graph.symbol_of(self.part, name) for name in names] for names in (above, below)]
        return self.writer.latex(Mul(*symbols[0]) / (Mul(*symbols[1]) * weight))


def rows_of_sums(sums: Sequence[Sums], used: Collection[str]) -> Iterator[Cells]:
    """Rows of a nomenclature: what the ends are called in sums, and the weights.

    Args:
        sums: the shafts that are printed as sums.
        used: names of the quantities that are printed.
    """
    for each in sums:
        for name, size in each.of_ends(used):
            yield name, f"{WORDS[size.name]} at its ends, within sums", in_text(each.part.name), unit(size.unit)
    mark = sums[0].shaft.mark and "^{(n)}" if sums else ""
    weights = {
        f"w{mark}_{{k,j}}": r"weight of node $j$ in the twist at point $k$",
        f"h{mark}_{{j}}": "weight of node $j$ in quadrature after Gauss and Lobatto",
        rf"\lambda{mark}_{{k}}": "weight of point $k$ in quadrature after Gauss",
        f"y{mark}_{{k}}": "point $k$ of Gauss, from 0 to 1",
        rf"\ell{mark}_{{j}}": "Lagrange polynomial of node $j$",
    }
    yield from ((f"${letter}$", meaning, "spectral shafts", "--") for letter, meaning in weights.items() if sums)


def printed_weights(shaft: SpectralShaft) -> dict[str, str]:
    """LaTeX of the letters for weights, by their names."""
    shares = {shaft.share(node).name: f"h{shaft.mark}_{{{node}}}" for node in (0, shaft.degree, "j")}
    return {shaft.weight.name: rf"\lambda{shaft.mark}_{{k}}", **shares}


def printed_sums(shaft: SpectralShaft, names: Mapping[str, str]) -> dict[str, str]:
    """LaTeX of the sums at the ends, by the names of the letters that stand for them.

    Args:
        shaft: whose sums.
        names: LaTeX of the quantities of the network.
    """
    torque = LAST_INDEX.sub("k", names[shaft.torques[0].name])
    return {
        shaft.sum_at(number).name: rf"\sum_{{k = 0}}^{{{shaft.degree - 1}}} w{shaft.mark}_{{k,{number}}} \, {torque}"
        for number, _ in shaft.ends
    }


def _range(index: str, first: int, last: int) -> str:
    numbers = range(first, last + 1)
    shown = map(str, numbers) if len(numbers) <= 3 else (str(first), r"\dots", str(last))
    return rf"\text{{for }} {index} = {', '.join(shown)}"
