"""Laws of the independent sources of netlists: DC, SIN, PULSE, PWL, EXP."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import sympy
from sympy import Expr, Piecewise

from shaftwork.components.laws import t
from shaftwork.components.tables import Table
from shaftwork.spice.netlist_lines import NetlistLine
from shaftwork.spice.spice_numbers import NetlistValues

WAVEFORMS = ("sin", "pulse", "pwl", "exp")
SMALL = ("ac", "distof1", "distof2")
"""What a source is in analyses of small motions, which is left out."""
SHORTEST = 1e-9
"""Rise of a pulse in s where neither it nor the analysis says one."""
MOST_PERIODS = 1000
"""Periods of a pulse that are written out as a table: a motion then stops at each corner and at nothing else."""


def source_law(line: NetlistLine, values: NetlistValues, span: tuple[float, float]) -> Any:
    """The law of a source, from the words behind its nodes.

    Args:
        line: of the source.
        values: reads its numbers.
        span: step and end of the analysis, s; zero where there is none.

    Raises:
        LineError: it has another form, or values that make no sense.
    """
    words = [word for word in line.words[3:] if word not in "()="]
    law: Any = 0.0
    waves = (k for k, word in enumerate(words) if word.lower() in WAVEFORMS)
    small = next((k for k in range(next(waves, len(words)), len(words)) if words[k].lower() in SMALL), len(words))
    words = words[:small]
    while words:
        word = words.pop(0)
        match word.lower():
            case "dc" if words:
                law = values.number(line, words.pop(0))
            case kind if kind in SMALL:
                for _ in range(2):  # amplitude and phase
                    words = words[1:] if words and words[0].lower() not in ("dc", *SMALL, *WAVEFORMS) else words
            case kind if kind in WAVEFORMS:
                return _waveform(line, kind, [values.number(line, one) for one in words], span)
            case _:
                law = values.law(line, word)
                if words and words[0].lower() not in ("dc", *SMALL, *WAVEFORMS):
                    raise line.error(f"'{' '.join(words)}' is not understood. Known are: DC, AC, SIN, PULSE, PWL, EXP")
    return law


def _waveform(line: NetlistLine, kind: str, numbers: list[float], span: tuple[float, float]) -> Expr:
    most = {"sin": 6, "pulse": 7, "exp": 6}.get(kind, len(numbers))
    if len(numbers) > most or len(numbers) < 2:
        raise line.error(f"{kind.upper()} has {len(numbers)} values, and takes 2 to {most}")
    if kind == "pwl":
        return _pwl(line, numbers)
    step, end = span
    return {"sin": _sine, "pulse": _pulse, "exp": _exponential}[kind](line, numbers, step or SHORTEST, end)


def _or(numbers: Sequence[float], place: int, default: float) -> float:
    return numbers[place] if len(numbers) > place else default


def _positive(numbers: Sequence[float], place: int, default: float) -> float:
    value = _or(numbers, place, default)
    return value if value > 0 else default


def _sine(line: NetlistLine, numbers: list[float], _: float, end: float) -> Expr:
    offset, amplitude, delay, damping, degrees = (*numbers[:2], *(_or(numbers, place, 0.0) for place in (3, 4, 5)))
    frequency = _or(numbers, 2, 0.0) or (1 / end if end else 0.0)
    if not frequency:
        raise line.error("SIN has no frequency, and there is no .tran whose end would give one")
    phase = sympy.Float(degrees) * sympy.pi / 180 if degrees else 0
    wave = amplitude * sympy.sin(2 * sympy.pi * frequency * (t - delay if delay else t) + phase)
    since = sympy.Max(0, t - delay) if delay > 0 else t - delay
    wave *= sympy.exp(-damping * since) if damping else 1
    return offset + (Piecewise((amplitude * sympy.sin(phase), t < delay), (wave, True)) if delay > 0 else wave)


def _pulse(line: NetlistLine, numbers: list[float], step: float, end: float) -> Expr:
    low, high, delay = *numbers[:2], _or(numbers, 2, 0.0)
    rise, fall = (_positive(numbers, place, step) for place in (3, 4))
    width = _positive(numbers, 5, end)
    period = _positive(numbers, 6, 0.0)
    corners: tuple[tuple[float, float], ...] = ((0.0, low), (rise, high))
    if width:  # neither it nor an end of the analysis is told: it stays
        corners += ((rise + width, high), (rise + width + fall, low))
    if not period or period > end > 0:
        return Table(*zip(*((delay + time, value) for time, value in corners), strict=True))(t)
    if not width:
        raise line.error("PULSE has a period and no width, and there is no .tran whose end would give one")
    if period < rise + width + fall:
        raise line.error(f"PULSE has a period of {period:g} s, shorter than its pulse of {rise + width + fall:g} s")
    count = max(1, int((end - delay) / period) + 1) if end else MOST_PERIODS + 1
    if count > MOST_PERIODS:
        shape = Table(*zip(*corners, strict=True))
        return Piecewise((low, t < delay), (shape(t - delay - period * sympy.floor((t - delay) / period)), True))
    points = [(delay + k * period + time, value) for k in range(count) for time, value in corners]
    return _table(points)


def _pwl(line: NetlistLine, numbers: list[float]) -> Expr:
    times, levels = numbers[::2], numbers[1::2]
    if len(times) != len(levels) or any(later < time for time, later in pairwise(times)):
        raise line.error("PWL takes pairs of a time and a value, and times that do not fall")
    return sympy.Float(levels[0]) if len({*times}) < 2 else _table([*zip(times, levels, strict=True)])


def _table(points: list[tuple[float, float]]) -> Expr:
    """Straight lines through points; where two have one time, the first comes just before."""
    edge = 1e-9 * (points[-1][0] - points[0][0])
    moved = [
        (time - edge if after is not None and after[0] - time < edge else time, value)
        for (time, value), after in zip(points, (*points[1:], None), strict=True)
    ]
    return Table(*zip(*moved, strict=True))(t)


def _exponential(_: NetlistLine, numbers: list[float], step: float, __: float) -> Expr:
    low, high, begin = *numbers[:2], _or(numbers, 2, 0.0)
    rise, back = _positive(numbers, 3, step), _or(numbers, 4, begin + step)
    fall = _positive(numbers, 5, step)
    # of Max nothing is taken out of the exponential, where it would be too large for a float
    return (
        low
        + (high - low) * Piecewise((0, t < begin), (1 - sympy.exp(-sympy.Max(0, t - begin) / rise), True))
        + (low - high) * Piecewise((0, t < back), (1 - sympy.exp(-sympy.Max(0, t - back) / fall), True))
    )
