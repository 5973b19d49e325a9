"""The instants at which laws jump or bend because of the time alone, as C code that finds the next of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from sympy import Expr, Min, Symbol, pi, sin

from shaftwork.ccode.printing import Statements, array, function
from shaftwork.components.discontinuities import line, narrow_places, switches
from shaftwork.components.laws import replaced
from shaftwork.components.laws import t as TIME
from shaftwork.network.graph import CircuitGraph
from shaftwork.network.kinds import Kind

Straight = tuple[Expr, Expr]
"""Slope and offset of a line in time."""


class Instants:
    """What of the laws and modes of a network switches at times that parameters tell.

    Args:
        graph: the network.
        still: symbols of parameters and inputs, which time does not change.
    """

    def __init__(self, graph: CircuitGraph, still: Sequence[Symbol]) -> None:
        self._graph, self._still = graph, {TIME, *still}  # only asked for membership
        self.levels: dict[tuple[Straight, tuple[float, ...]], None] = {}
        """Lines in time, and the levels at which something switches."""
        self.whole: dict[Straight, None] = {}
        """Lines in time that switch at every whole number."""
        self.others: dict[Expr, None] = {}
        """What switches as it passes zero, and is no line in time."""
        for argument, levels in self._arguments():
            self._sort(argument, levels)

    def _arguments(self) -> Iterator[tuple[Expr, tuple[float, ...]]]:
        for branch in self._graph.branches:
            if branch.template.kind in (Kind.LAW, Kind.THROUGH_SOURCE, Kind.ACROSS_SOURCE):
                law = self._graph.in_network_symbols(branch.template.law, branch)
                yield from self._of_law(law)
        for part in self._graph.parts:
            names = {Symbol(name, real=True): self._graph.symbol_of(part, name) for name in part.parameters}
            for mode in (mode for machine in part.modes for mode in machine.options):
                for leave in mode.leaves:
                    when = replaced(leave.when, names)
                    yield from self._of_law(when)
                    for time in when.args if isinstance(when, Min) else (when,):
                        if time.has(TIME) and line(time) is not None:
                            yield time, (0.0,)

    def _of_law(self, law: Expr) -> Iterator[tuple[Expr, tuple[float, ...]]]:
        if law.has(TIME):
            yield from ((argument, tuple(levels)) for argument, levels in switches(law))
            yield from ((argument, (0.0,)) for argument, _ in narrow_places(law))

    def _sort(self, argument: Expr, levels: tuple[float, ...]) -> None:
        if not argument.has(TIME) or not argument.free_symbols <= self._still:
            return
        _, factor = argument.as_coeff_Mul()
        whole = line(factor.args[0] / pi) if isinstance(factor, sin) else None
        if whole is not None and levels == (0.0,):
            self.whole[whole] = None
        elif (straight := line(argument)) is not None:
            self.levels[straight, levels] = None
        elif levels == (0.0,):
            self.others[argument] = None

    def text(self, statements: Statements) -> str:
        """The C function `next_time`."""
        tables, lines = list[str](), ["double next = INFINITY;"]
        for number, ((slope, offset), levels) in enumerate(self.levels):
            tables.append(array("const double", f"LEVELS_{number}", [repr(float(level)) for level in levels]))
            lines += self._block(
                statements, slope, offset, f"next_level(slope, offset, {len(levels)}, LEVELS_{number}, t)"
            )
        for slope, offset in self.whole:
            lines += self._block(statements, slope, offset, "next_whole(slope, offset, t)")
        helpers = (_NEXT_LEVEL if self.levels else "") + (_NEXT_WHOLE if self.whole else "")
        lines.append("return next;")
        return helpers + "\n".join([*tables, function("double next_time(const NAME *m, double t)", lines)])

    @staticmethod
    def _block(statements: Statements, slope: Expr, offset: Expr, call: str) -> Iterator[str]:
        yield "{"
        targets = ["const double slope", "const double offset"]
        yield from (f"    {line}" for line in statements.assigned(targets, [slope, offset]))
        yield f"    next = fmin(next, {call});"
        yield "}"


_NEXT_LEVEL = """/* The first time after t at which a line passes one of its levels, which increase. */
static double next_level(double slope, double offset, int n, const double *levels, double t)
{
    int low = 0, high = n;
    if (slope == 0.0) return INFINITY;
    while (low < high) {
        const int middle = low + (high - low) / 2;
        const double time = (levels[middle] - offset) / slope;
        if (slope > 0.0 ? time <= t : time > t) low = middle + 1;
        else high = middle;
    }
    if (slope > 0.0) return low < n ? (levels[low] - offset) / slope : INFINITY;
    return low > 0 ? (levels[low - 1] - offset) / slope : INFINITY;
}

"""
_NEXT_WHOLE = """/* The first time after t at which a line passes a whole number. */
static double next_whole(double slope, double offset, double t)
{
    const double value = slope * t + offset;
    if (slope == 0.0) return INFINITY;
    for (int n = 0; n < 3; n++) {
        const double time = ((slope > 0.0 ? floor(value) + n : ceil(value) - n) - offset) / slope;
        if (time > t) return time;
    }
    return INFINITY;
}

"""
