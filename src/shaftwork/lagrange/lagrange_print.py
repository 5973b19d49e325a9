"""Lagrange's equations as LaTeX: energies, generalised forces, equations of motion."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from functools import cached_property
from typing import TYPE_CHECKING

from sympy import Integer

from shaftwork.equations.assembly import FactoredTerms, Sides, sides, terms_of
from shaftwork.equations.quantities import rate_of
from shaftwork.latex.blocks import Block, Blocks
from shaftwork.latex.document import in_sections, section
from shaftwork.latex.nomenclature import nomenclature, unit
from shaftwork.latex.printing import Line
from shaftwork.latex.shaft_sums import Sums

if TYPE_CHECKING:
    from shaftwork.equations.second_order import Square
    from shaftwork.lagrange.lagrange import Lagrangian, MotionEquation

KINETIC, POTENTIAL, LOSS = "E_k", "E_p", r"\mathcal{R}"
"""Letters of the energies, after Abdelkader 2016, (19), and of Rayleigh's function."""


def document(lagrangian: Lagrangian, *, values: bool, title: str | None) -> str:
    """A LaTeX document that compiles as it is."""
    coordinates = {symbol.name: "coordinate" for symbol in lagrangian.coordinates}
    energies = {
        KINETIC: ("kinetic energy", "J", lagrangian.inertias),
        POTENTIAL: ("potential energy", "J", lagrangian.springs),
        LOSS: ("Rayleigh's function, half of the power lost", "W", lagrangian.dampers),
    }
    general = [(r"$\mathcal{L}$", "Lagrange's function", "--", unit("J"))]
    general += [(f"${letter}$", of, "--", unit(size)) for letter, (of, size, squares) in energies.items() if squares]
    general += [("$q_{k}$", "coordinate", "--", "--"), ("$Q_{k}$", "generalised force", "--", "--")]
    blocks = Blocks(lagrangian.kirchhoff, values)
    equations = section(_LagrangeBlocks(lagrangian, blocks).printed())
    names = {*blocks.used, *coordinates}
    tables = nomenclature(lagrangian.kirchhoff, names, coordinates, general, tuple(blocks.helpers()))
    sections = {"Lagrange's equations": equations, "Nomenclature": tables}
    return in_sections(lagrangian.kirchhoff, sections, title)


def blocks_of(lagrangian: Lagrangian, *, values: bool) -> tuple[Block, ...]:
    """The blocks that say anything."""
    blocks = _LagrangeBlocks(lagrangian, Blocks(lagrangian.kirchhoff, values)).printed()
    return tuple(block for block in blocks if block.lines)


class _LagrangeBlocks:
    def __init__(self, lagrangian: Lagrangian, blocks: Blocks) -> None:
        self.lagrangian, self.blocks, self.writer = lagrangian, blocks, blocks.writer
        self.graph = blocks.equations.form.graph
        self.quantities = blocks.quantities

    def printed(self) -> Iterator[Block]:
        """All blocks."""
        yield Block("Lagrange's equations", tuple(self._general()))
        yield Block("Coordinates", tuple(self._coordinates()), "Angles are counted from the untwisted position.")
        yield Block("Energies", tuple(self._energies()))
        yield Block("Generalised forces", tuple(self._forces()))
        yield Block("Equations of motion", tuple(self._motions()))
        imposed = tuple(self.writer.line(row.sides) for row in self.lagrangian.constraints)
        yield Block("Constraints with a reaction that does work", imposed)
        yield Block("where", tuple(self._laws()))
        yield self.blocks.derived()
        yield self.blocks.orders()

    def _general(self) -> Iterator[Line]:
        """Abdelkader 2016, (18) and (19), with what linear dampers lose."""
        lost = r" + \frac{\partial \mathcal{R}}{\partial \dot{q}_{k}}" if self.lagrangian.dampers else ""
        momentum = r"\frac{d}{d t} \frac{\partial \mathcal{L}}{\partial \dot{q}_{k}}"
        yield Line(rf"{momentum} - \frac{{\partial \mathcal{{L}}}}{{\partial q_{{k}}}}{lost}", ("Q_{k}",))
        energies = (KINETIC, *((f"- {POTENTIAL}",) if self.lagrangian.springs else ()))
        yield Line(r"\mathcal{L}", energies)

    def _coordinates(self) -> Iterator[Line]:
        """The coordinates, the positions that follow from them, and those that are prescribed."""
        symbols = [f"{self.writer.latex(symbol)}," for symbol in self.lagrangian.coordinates]
        if symbols:
            last = rf"{symbols.pop()[:-1]} \bigr)^{{\mathsf{{T}}}}"
            yield Line(r"\mathbf{q}", _opened((*symbols, last)))
        for number in range(len(self.graph.nodes)):
            angle = self.quantities.angle(number)
            if angle in self.lagrangian.motion and number not in self.blocks.twists:
                yield self.writer.line(sides(angle, terms_of(self.lagrangian.motion[angle])))
        for angle, speed in self.lagrangian.prescribed.items():
            yield self.writer.line(sides(rate_of(angle), (speed,)))

    @cached_property
    def _sums(self) -> tuple[Sums, ...]:
        """Shafts whose energies and equations are printed as sums."""
        return self.blocks.summed_between(tuple(row.node for row in self.lagrangian.equations))

    def _energies(self) -> Iterator[Line]:
        yield from self._energy(KINETIC, self.lagrangian.inertias, Sums.kinetic)
        yield from self._energy(POTENTIAL, self.lagrangian.springs, Sums.potential)
        yield from self._energy(LOSS, self.lagrangian.dampers, Sums.losses)

    def _energy(self, letter: str, squares: Iterable[Square], of: Callable[[Sums], Iterator[str]]) -> Iterator[Line]:
        """A sum of squares, those of a shaft with weights in one."""
        parts = [summed.part for summed in self._sums]
        terms = [square.energy for square in squares if self.graph.part_of(square.branch) not in parts]
        pieces = [*self.writer.pieces((FactoredTerms(Integer(1), tuple(terms)),))]
        pieces += [f"+ {piece}" for summed in self._sums for piece in of(summed)]
        if pieces:
            yield Line(letter, (pieces[0].removeprefix("+ "), *pieces[1:]))

    def _forces(self) -> Iterator[Line]:
        """The generalised forces that are not zero."""
        rows = self.lagrangian.equations
        acting = [(k, row) for k, row in enumerate(rows, 1) if row.force != 0]
        for k, row in acting:
            yield Line(f"Q_{{{k}}}", self.writer.pieces(sides(Integer(0), terms_of(row.force)).groups))
        if len(acting) < len(rows):
            yield Line("Q_{k}", ("0",), r"\text{for all other } k" if acting else r"\text{for all } k")

    def _motions(self) -> Iterator[Line]:
        """The equations of motion; one row for all inside a shaft that is printed as sums."""
        inside = {self.graph.nodes[node] for summed in self._sums for node in summed.shaft.inside}
        yield from (self._motion(row) for row in self.lagrangian.equations if row.node not in inside)
        for summed in self._sums:
            yield from summed.motion()

    def _motion(self, row: MotionEquation) -> Line:
        """The row of a coordinate, with what a shaft that is printed as sums gives to its end as a sum."""
        ends = [
            (summed, str(number))
            for summed in self._sums
            for number, end in summed.shaft.ends
            if self.graph.nodes[summed.part.nodes[end]] == row.node
        ]
        if not ends:
            return self.writer.line(row.sides)
        twists = {node for summed, _ in ends for node in summed.shaft.twists}
        rates = (row.coordinate, rate_of(row.coordinate))
        shown = [
            square.pull(symbol)
            for squares, symbol in zip((self.lagrangian.springs, self.lagrangian.dampers), rates, strict=True)
            for square in squares
            if self.graph.branches[square.branch].plus in twists
        ]
        groups = tuple(group for group in row.groups if group not in shown)
        pieces = [*self.writer.pieces(groups)]
        pieces += [f"- {torque}" for summed, number in ends for torque in summed.elastic(number)]
        return Line(self.writer.line(Sides(row.left, ())).left, tuple(pieces))

    def _laws(self) -> Iterator[Line]:
        """The torques that stand in the generalised forces, in coordinates and rates."""
        for flow in self.quantities.flows:
            if self.quantities.through(flow) in self.lagrangian.laws:
                yield from self.blocks.law(flow, self.lagrangian.motion)
        for branch in self.graph.branches:
            if branch.template.is_history:
                symbol = self.quantities.history(branch.index)
                yield self.writer.line(sides(symbol, (self.lagrangian.laws[symbol],)))


def _opened(pieces: tuple[str, ...]) -> tuple[str, ...]:
    return (rf"\bigl( {pieces[0]}", *pieces[1:])
