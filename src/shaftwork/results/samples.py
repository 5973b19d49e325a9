"""Whether output times show a motion: what of it swings between them, and how many would show it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shaftwork.core.errors import AccuracyWarning
from shaftwork.core.notices import warn
from shaftwork.results.course import course
from shaftwork.results.observer import Array

if TYPE_CHECKING:
    from shaftwork.results.solution import Solution

HIDDEN, STRAYED = 0.05, 0.2
"""Of the largest value: what samples may miss of an extreme, and the root mean square by which lines between samples
may miss the quantity. Seven samples in a swing miss a twentieth of it."""
LEAST = 50
"""Fewer output times are a list of moments, of which nobody expects extremes."""
LOOKS, MOST_LOOKS, MOST_VALUES = 4, 30_000, 1_000_000
"""Times between two neighbours of the outputs and steps, and in all, at which the states are looked at; values of all
states there, beyond which there are fewer times."""
CHOSEN, ANYWHERE = 400, 200
"""Times at which the quantities are read: where states stray most from lines, and anywhere."""
SHARES = np.arange(1, 9) * (np.sqrt(5) - 1) / 2 % 1
"""Where between its neighbours a time lies: in step with nothing that swings, and few, for engines that take as many
matrix exponentials as there are distances from a step end."""
NARROWEST, OFFSETS = 1e-6, 100
"""Of the time between two samples, how wide a turn is at least; at so many distances from it that is looked for."""
MOST_OUTPUTS = 10_000_000
"""Output times that can be asked for."""


class Unseen(NamedTuple):
    """Where samples are far from a quantity.

    Args:
        name: of the quantity.
        unit: of the quantity.
        t: where it turns, between two output times, s.
        value: what it is there.
        line: what a line between its samples is there.
        samples: the smallest and the largest sample.
        outputs: number of even output times that would show the turn, or None where no number would.
    """

    name: str
    unit: str
    t: float
    value: float
    line: float
    samples: tuple[float, float]
    outputs: int | None


def warn_of_coarse_samples(solution: Solution, names: Sequence[str] = ()) -> None:
    """Warn where the samples of quantities, by default of the states, do not show how these swing.

    Law: the states are looked at between output times and step ends. Where they stray most from lines between samples,
    and at times anywhere, the quantities are read and compared with their samples.
    """
    if "dense" not in vars(solution) or len(solution.t) < LEAST:  # one that is stored would have to be made again
        return
    unseen = _unseen(solution, names or tuple(name for name in solution.states if name in solution))
    if unseen is None:
        return
    name, (low, high) = unseen.name, unseen.samples
    enough = f"About t_eval={unseen.outputs} show it." if unseen.outputs else "No even output times show it."
    warn(
        f"The {len(solution.t)} output times of '{solution.name}' are too far apart for what swings in it: '{name}' is "
        f"{unseen.value:.5g} {unseen.unit} at t = {unseen.t:.6g} s, where a line between its samples is at "
        f"{unseen.line:.5g}, and its samples lie between {low:.5g} and {high:.5g}. {enough} sol.max('{name}') and "
        f"sol.min('{name}') are right whatever the output times.",
        AccuracyWarning,
    )


def _unseen(solution: Solution, names: Sequence[str]) -> Unseen | None:
    """What samples show worst of some quantities, or None where they show all of them."""
    times, first = np.unique(solution.t, return_index=True)
    between, anywhere = _between(solution, times, solution.x[first])
    worst, where = 1.0, None
    for name in names:
        samples, values = (motion[name].reshape(len(motion.t), -1) for motion in (solution, between))
        size = np.maximum(np.abs(np.concatenate([samples, values])).max(axis=0), np.finfo(float).tiny)
        over = np.maximum(values - samples.max(axis=0), samples.min(axis=0) - values)
        apart = np.abs(values - _lines(times, samples[first], between.t))
        astray = np.sqrt(np.mean(apart[anywhere] ** 2, axis=0))
        for share, far in ((over.max(axis=0) / HIDDEN, over), (astray / STRAYED, apart)):
            place = int(np.argmax(share / size))
            if share[place] > worst * size[place]:
                worst = float(share[place] / size[place])
                where = name, place, float(between.t[far[:, place].argmax()])
    return None if where is None else _described(solution, *where, times)


def _between(solution: Solution, times: Array, states: Array) -> tuple[Solution, NDArray[np.bool_]]:
    """The motion where its states stray most from lines between samples, and anywhere; which times are the latter."""
    count = states.shape[1]
    looks = _looks(times, solution.steps, min(MOST_LOOKS, MOST_VALUES // max(1, count)))
    strayed = np.abs(solution.dense(looks) - _lines(times, states, looks))
    each = min(len(looks), 1 + CHOSEN // max(1, count)) - 1
    chosen = np.argpartition(-strayed, each, axis=0)[: each + 1].ravel()
    evenly = np.searchsorted(looks, np.linspace(looks[0], looks[-1], ANYWHERE))
    between = solution.at(looks[np.union1d(chosen, evenly)])
    return between, np.isin(between.t, looks[evenly])


def _looks(times: Array, steps: Array, most: int) -> Array:
    """Times between neighbours of output times and step ends."""
    edges = np.unique(np.append(times, steps[(steps > times[0]) & (steps < times[-1])]))
    if len(edges) > most:
        edges = edges[np.linspace(0, len(edges) - 1, most).astype(int)]
    each = int(np.clip(most // len(edges), 1, LOOKS))
    shares = (np.arange(each) + np.resize(SHARES, len(edges) - 1)[:, None]) / each
    return np.asarray((edges[:-1, None] + np.diff(edges)[:, None] * shares).ravel())


def _lines(times: Array, samples: Array, at: Array) -> Array:
    """Lines between samples (k, m) at times (k,), at other times (j,)."""
    before = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    share = ((at - times[before]) / (times[before + 1] - times[before]))[:, None]
    return np.asarray((1 - share) * samples[before] + share * samples[before + 1])


def _described(solution: Solution, name: str, place: int, t: float, times: Array) -> Unseen:
    """What is not seen of a quantity near a time: its turn there, and how close samples must be to show that."""
    samples = solution[name].reshape(len(solution.t), -1)[:, place]
    along = name in solution.observer.profiles
    read = solution.reader.quantity(name, place if along else None)
    after = int(np.searchsorted(times, t))
    start, end = times[after - 1 : after + 1].tolist()
    inner = solution.steps[(solution.steps > start) & (solution.steps < end)]
    left, right = read(np.array([start, end])).tolist()
    turns = course(read, np.array([start, *inner, end])).extremes()
    lines = [left + (right - left) * (when - start) / (end - start) for when, _ in turns]
    which = int(np.argmax([abs(value - line) for (_, value), line in zip(turns, lines, strict=True)]))
    (when, value), line = turns[which], lines[which]
    low, high = float(samples.min()), float(samples.max())
    room = HIDDEN * max(abs(value), -low, high)
    offsets = np.geomspace(NARROWEST, 1.0, OFFSETS) * (end - start)
    width = 0.0
    for side in (-1, 1):
        near = np.clip(when + side * offsets, solution.steps[0], solution.steps[-1])[::side]
        stays = np.abs(read(near)[::side] - value) <= room
        width += float(offsets[int(np.argmin(np.append(stays, False))) - 1]) if stays[0] else 0.0
    count = (times[-1] - times[0]) / width if width else np.inf
    unit = solution.observer.profiles[name][0] if along else solution.observer.units[name]
    return Unseen(name, unit, when, value, line, (low, high), _rounded_up(count) if count < MOST_OUTPUTS else None)


def _rounded_up(count: float) -> int:
    """A number of intervals to one digit, as a number of output times."""
    digit = 10.0 ** int(np.log10(count))
    return int(np.ceil(count / digit) * digit) + 1
