"""The slopes of laws about a point, as parameters where they are made of these, else as letters."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from sympy import Expr, Integer, Symbol

from shaftwork.components.branches import ACROSS, INTEGRAL, RATE
from shaftwork.components.laws import t as TIME
from shaftwork.components.slopes import jumps, slope
from shaftwork.equations.quantities import Quantities
from shaftwork.network.controlled import readings_of
from shaftwork.network.graph import GraphBranch

VARIED = Symbol("varied", real=True)
"""Stands for what a law that jumps reads."""


class Slope(NamedTuple):
    """What the letter of a slope stands for: how what a law lets through changes with what it reads.

    Attributes:
        of: symbol of what passes through, with a sign; zero where that of the law alone has none.
        by: what the law reads.
        value: the slope, in quantities of the network.
        part: whose law it is.
        jumps: the law with `VARIED` in place of what it reads, where it may jump in that; else None.
    """

    of: Expr
    by: Expr
    value: Expr
    part: str
    jumps: Expr | None


class LawSlopes:
    """The slopes of the laws of a network.

    Args:
        quantities: its symbols.
    """

    def __init__(self, quantities: Quantities) -> None:
        self._quantities, self._known = quantities, dict[int, Mapping[Symbol, Expr]]()
        self.letters: dict[Symbol, Slope] = {}
        """What the letters stand for, of all laws that have been asked for."""

    def of(self, branch: GraphBranch) -> Mapping[Symbol, Expr]:
        """The slopes of a law by what it reads, in the symbols of its template."""
        if branch.index not in self._known:
            self._known[branch.index] = dict(self._made(branch))
        return self._known[branch.index]

    def _made(self, branch: GraphBranch) -> Iterator[tuple[Symbol, Expr]]:
        quantities, index = self._quantities, branch.index
        law, reads = quantities.own_law(index), readings_of(quantities.graph, index)
        if RATE in reads:  # printed it lacks what stands with the store
            law = quantities.graph.in_network_symbols(branch.template.law, branch)
        names = {"across": quantities.node, "through": quantities.store, "integral": quantities.integral}
        names["rate"] = quantities.rate
        point = {ACROSS: quantities.across((branch.plus, branch.minus)), INTEGRAL: quantities.integral(index)}
        point |= {symbol: names[of.kind](of.of) for symbol, of in reads.items()}
        for symbol in point:
            made = slope(law, symbol) if law.has(symbol) else Integer(0)
            may_jump = jumps(law, symbol)
            if made == 0 and not may_jump:
                continue
            if not may_jump and made.free_symbols.isdisjoint({*point, TIME}) and made.is_rational_function():
                yield symbol, made
            else:
                jumping = law.xreplace({**point, symbol: VARIED}) if may_jump else None
                yield symbol, self._letter(index, point[symbol], made.xreplace(point), jumping)

    def _letter(self, index: int, by: Expr, value: Expr, jumping: Expr | None) -> Symbol:
        quantities = self._quantities
        owner, flow = quantities.graph.part_of(index).name, quantities.flow_of[index]
        number = sum(known.part == owner for known in self.letters.values())
        letter = Symbol(
            f"slope{f'_{number + 1}' if number else ''}({owner})", real=True
        )  # no parameter has such a name
        of = flow.sign * quantities.through(flow) if len(flow.branches) == 1 else Integer(0)
        self.letters[letter] = Slope(of, by, value, owner, jumping)
        return letter
