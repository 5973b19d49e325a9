"""The second-order form in print: as matrices where they fit on a page, else row by row."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import zip_longest

from sympy import Expr, Integer

from shaftwork.equations.assembly import FactoredTerms, sides, terms_of, tidy
from shaftwork.equations.second_order import SecondOrder, second_order
from shaftwork.latex.blocks import Block, Blocks
from shaftwork.latex.nomenclature import Cells
from shaftwork.latex.printing import LINE_WIDTH, Line, Writer, printed_width


@dataclass(frozen=True, eq=False)
class SecondOrderBlocks:
    """Prints M phi'' + D phi' + K phi = T.

    Args:
        blocks: of the network; their writer prints, and their shafts stand as sums.
    """

    blocks: Blocks

    @cached_property
    def form(self) -> SecondOrder:
        """The equations of motion, without the springs and dampers along the shafts that are printed as sums.

        Raises:
            CompileError: the network has electrical nodes, or a law reads others.
        """
        along = frozenset(link for shaft in self.blocks.shafts for link in shaft.links)
        if not along:
            return self.blocks.equations.second_order
        return second_order(self.blocks.equations.form.graph, self.blocks.quantities, along)

    @property
    def writer(self) -> Writer:
        """Prints the expressions."""
        return self.blocks.writer

    def printed(self) -> Iterator[Block]:
        """The equations of motion, and the laws in them."""
        yield Block("Equations of motion", self._matrices or tuple(self._motions()))
        blocks, motion = self.blocks, self.form.at.motion
        by_symbol = [flow for flow in blocks.quantities.flows if blocks.quantities.through(flow) in self.form.laws]
        laws = [line for flow in by_symbol for line in blocks.law(flow, motion)]
        assembly = blocks.rows.assembly
        for end, other in assembly.opposite.items():
            across = assembly.quantities.across(assembly.ends(other)).xreplace(motion)
            laws.append(self.writer.line(assembly.law_of_history(end, across)))
        yield Block("where", tuple(laws), r"Angles are counted from the untwisted position.")

    def helpers(self) -> Iterator[Cells]:
        """Rows of a nomenclature: the matrices, where they are printed."""
        if self._matrices:
            matrices = {"q": "coordinates", "M": "mass matrix", "D": "damping matrix", "K": "stiffness matrix"}
            for letter, meaning in (*matrices.items(), ("T", "generalised torques and forces")):
                yield rf"$\mathbf{{{letter}}}$", meaning, "the network", "--"

    @cached_property
    def _matrices(self) -> tuple[Line, ...]:
        """The equations as matrices; nothing where these do not fit on a page, or would have weights in them."""
        if len(self.form.coordinates) > 6 or self.blocks.shafts:  # wider matrices leave the page
            return ()
        lines = tuple(self._matrix_lines())
        return lines if max(map(_matrix_width, lines)) <= LINE_WIDTH else ()

    def _matrix_lines(self) -> Iterator[Line]:
        form = self.form
        yield Line(
            r"\mathbf{M} \, \ddot{\mathbf{q}} + \mathbf{D} \, \dot{\mathbf{q}} + \mathbf{K} \, \mathbf{q}",
            (r"\mathbf{T}",),
        )
        size = range(len(form.coordinates))
        transposed = " & ".join(map(self.writer.latex, form.coordinates))
        yield Line(r"\mathbf{q}", (rf"\begin{{bmatrix}} {transposed} \end{{bmatrix}}^{{\mathsf{{T}}}}",))
        for name, entries in (("M", form.mass), ("D", form.damping), ("K", form.stiffness)):
            rows = ([entries.get((i, j), Integer(0)) for j in size] for i in size)
            yield Line(rf"\mathbf{{{name}}}", (self._matrix(rows),))
        yield Line(r"\mathbf{T}", (self._matrix([force] for force in form.forces),))

    def _matrix(self, rows: Iterable[Iterable[Expr]]) -> str:
        inner = r" \\ ".join(" & ".join(self.writer.latex(tidy(entry)) for entry in row) for row in rows)
        return rf"\begin{{bmatrix}} {inner} \end{{bmatrix}}"

    def _motions(self) -> Iterator[Line]:
        """Row by row; shafts with nodes inside have one row for all of these."""
        yield from (self._motion(row) for row, node in enumerate(self.form.at.free) if node not in self.blocks.inside)
        for summed in self.blocks.sums:
            yield from summed.motion(self.form.at.positions)

    def _motion(self, row: int) -> Line:
        form = self.form
        left = list(self.writer.pieces((FactoredTerms(Integer(1), tuple(map(tidy, form.terms(row)))),)))
        for summed in self.blocks.sums:
            for number, end in summed.shaft.ends:
                gain = form.at.positions[summed.part.nodes[end]].coeff(form.coordinates[row])
                if gain != 0:
                    sign, factor = self.writer.factor(gain)
                    left += (f"{sign} {factor}{torque}" for torque in summed.elastic(str(number)))
        left[:1] = [left[0].removeprefix("+ ")]
        force = form.forces[row]
        right = self.writer.pieces(sides(Integer(0), terms_of(force)).groups) or ("0",)
        return Line("", (*left, f"= {right[0]}", *right[1:]), relation="")


def _matrix_width(line: Line) -> float:
    """Width of a matrix: that of its columns, and the room between them."""
    rows = (row.split("&") for row in line.pieces[0].split(r"\\"))
    columns = list(zip_longest(*rows, fillvalue=""))
    return sum(max(map(printed_width, column)) for column in columns) + 1.8 * (len(columns) - 1) + 2.0
