"""The instants at which laws jump or bend because of the time alone, as C code that finds the next of them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from sympy import (
    Abs,
    Expr,
    Float,
    Heaviside,
    Integer,
    Max,
    Min,
    Mul,
    Piecewise,
    Pow,
    Symbol,
    asin,
    cos,
    floor,
    pi,
    sign,
    simplify,
    sin,
)

from shaftwork.ccode.c_printing import Statements, array, function
from shaftwork.components.discontinuities import line, narrow_places, switches, unsolved_places
from shaftwork.components.law_slopes import MOST_DEGREE
from shaftwork.components.laws import replaced
from shaftwork.components.laws import t as TIME
from shaftwork.components.noise import SmoothNoise
from shaftwork.core.errors import CompileError
from shaftwork.network.graph import CircuitGraph
from shaftwork.network.kinds import Kind

Straight = tuple[Expr, Expr]
"""Slope and offset of a line in time."""


class Instants:
    """What of the laws and modes of a network switches at times that parameters tell.

    Args:
        graph: the network.
        still: symbols of parameters and inputs, which time does not change.

    Raises:
        CompileError: a law switches, or may have a pulse, at times for which no formula is known.
    """

    def __init__(self, graph: CircuitGraph, still: Sequence[Symbol]) -> None:
        self._graph, self._still = graph, {TIME, *still}  # only asked for membership
        self.levels: dict[tuple[Straight, tuple[float, ...]], None] = {}
        """Lines in time, and the levels at which something switches."""
        self.whole: dict[Straight, None] = {}
        """Lines in time that switch at every whole number."""
        self.noisy: dict[Expr, None] = {}
        """What changes its sign at times that smooth noise tells, within one of its pieces."""
        for part, argument, levels in self._arguments():
            if argument.has(TIME) and argument.free_symbols <= self._still:
                self._sort(part, argument, levels)
        for one in graph.parts:
            if (sampler := one.component.sampler()) is not None:
                name = f"{one.name}.sample_time"
                period = Symbol(name, real=True) if name in graph.parameters else Float(sampler.period)
                self.whole[1 / period, Integer(0)] = None

    def _arguments(self) -> Iterator[tuple[str, Expr, tuple[float, ...]]]:
        for branch in self._graph.branches:
            if branch.template.kind in (Kind.LAW, Kind.THROUGH_SOURCE, Kind.ACROSS_SOURCE):
                law = self._graph.in_network_symbols(branch.template.law, branch)
                yield from self._of_law(self._graph.part_of(branch.index).name, law)
        for part in self._graph.parts:
            names = {Symbol(name, real=True): self._graph.symbol_of(part, name) for name in part.parameters}
            for mode in (mode for machine in part.modes for mode in machine.options):
                for leave in mode.leaves:
                    when = replaced(leave.when, names)
                    yield from self._of_law(part.name, when)
                    for time in when.args if isinstance(when, Min) else (when,):
                        if time.has(TIME) and line(time) is not None:
                            yield part.name, time, (0.0,)

    def _of_law(self, part: str, law: Expr) -> Iterator[tuple[str, Expr, tuple[float, ...]]]:
        if law.has(TIME):
            yield from ((part, argument, tuple(levels)) for argument, levels in switches(law))
            yield from ((part, argument, (0.0,)) for argument, _ in narrow_places(law))
            for place in self._pulses(law):
                raise _unsolved(part, f"it may have a pulse or an edge in {place}")

    def _pulses(self, law: Expr) -> Iterator[Expr]:
        """Functions that may have pulses at times that `narrow_places` does not tell; a root of one has them there."""
        for place in unsolved_places(law, self._still):
            if isinstance(place, Pow) and place.exp.is_number and 0 < place.exp <= MOST_DEGREE:
                yield from self._pulses(place.base)
            elif (
                not isinstance(place, Pow)
                or place.exp.has(TIME)  # of pieces of lines a power peaks where one ends or is zero
                or any(line(one) is None for one in _factors(place.base))
            ):
                yield place

    def _sort(self, part: str, argument: Expr, levels: tuple[float, ...]) -> None:
        if (straight := line(argument)) is not None:
            self.levels[straight, levels] = None
            return
        for level in levels:
            for factor in _factors(argument - level):
                if (straight := line(factor)) is not None:
                    self.levels[straight, (0.0,)] = None
                elif (passes := _passes(factor)) is not None:
                    self.whole.update(dict.fromkeys(passes))
                elif factor.has(SmoothNoise):
                    self.noisy[factor] = None
                else:
                    raise _unsolved(part, f"it switches as {factor} passes zero")

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
        for number, argument in enumerate(self.noisy):  # a piece of noise ends at the instants before
            value = [*statements.assigned(["const double value"], [argument]), "return value;"]
            tables.append(function(f"double noisy_{number}(const NAME *m, double t)", value))
            lines.append(f"next = next_zero(m, noisy_{number}, t, next);")
        lines.append("return next;")
        return "\n".join([*tables, function("double next_time(const NAME *m, double t)", lines)])

    @staticmethod
    def _block(statements: Statements, slope: Expr, offset: Expr, call: str) -> Iterator[str]:
        yield "{"
        targets = ["const double slope", "const double offset"]
        yield from (f"    {line}" for line in statements.assigned(targets, [slope, offset]))
        yield f"    next = fmin(next, {call});"
        yield "}"


def _factors(expression: Expr) -> Iterator[Expr]:
    """What changes its sign in time where an expression does.

    |x| - a does so where x passes a or -a, Min(x, y) - a nowhere but where x or y passes it, and a step where it steps.
    """
    for factor in Mul.make_args(expression):
        level, moving = factor.as_independent(TIME, as_Add=True)
        size, moving = moving.as_independent(TIME, as_Add=False)
        if isinstance(moving, Heaviside | sign):
            yield from _factors(moving.args[0])
        elif isinstance(moving, Abs):
            yield from (size * moving.args[0] + level, size * moving.args[0] - level)
        elif isinstance(moving, Max | Min | Piecewise):
            for one in moving.args if not isinstance(moving, Piecewise) else (value for value, _ in moving.args):
                yield from _factors(size * one + level)
        elif factor.has(TIME):
            yield factor


def _passes(expression: Expr) -> tuple[Straight, ...] | None:
    """Lines in time that are whole numbers where a sine or sawtooth of time passes a level; None of anything else."""
    level, moving = expression.as_independent(TIME, as_Add=True)
    size, wave = moving.as_independent(TIME, as_Add=False)
    if isinstance(wave, sin | cos) and (phase := line(wave.args[0])) is not None:
        slope, offset = phase
        offset += pi / 2 if isinstance(wave, cos) else 0
        if level == 0:
            return ((slope / pi, offset / pi),)
        ratio = -level / size
        if ratio.is_number and abs(ratio) > 1:
            return ()
        angle = asin(ratio)
        return tuple((slope / (2 * pi), (offset - place) / (2 * pi)) for place in (angle, pi - angle))
    steps = [*moving.atoms(floor)]
    if len(steps) != 1 or (phase := line(steps[0].args[0])) is None:
        return None
    (slope, _), height = phase, moving.coeff(steps[0])
    # of slope t - floor(slope t + offset) every period is the same
    if simplify(moving + height * (slope * TIME - steps[0])) != 0:
        return None
    return ((slope, -level / height),)


def _unsolved(part: str, why: str) -> CompileError:
    return CompileError(
        f"The law of '{part}' depends on the time alone in a way that C code cannot follow: {why}, at times for which "
        "there is no formula. It knows those of lines in time and of single sines. Make the parameter an input, which "
        "the program sets, or simulate it here."
    )
