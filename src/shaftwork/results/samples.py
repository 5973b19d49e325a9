"""Whether output times show a motion: what of it swings between them, and how many would show it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from shaftwork.core.errors import AccuracyWarning
from shaftwork.core.notices import warn
from shaftwork.results.course import course
from shaftwork.results.observer import Array
from shaftwork.results.reader import Reader

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


def warn_of_coarse_samples(reader: Reader, t: Array, x: Array, names: Sequence[str] = ()) -> None:
    """Warn where the samples of quantities do not show how these swing.

    Law: the states are looked at between output times and step ends. Where they stray most from lines between samples,
    and at times anywhere, the quantities are read and compared with their samples.

    Args:
        reader: of the motion.
        t: (k,) output times, s.
        x: (k, n) states at these times.
        names: of the quantities; by default those of the states.
    """
    if len(t) < LEAST:
        return
    names = names or tuple(name for name in reader.states if name in reader.observer.units)
    if (worst := _worst_shown(reader, t, x, names)) is not None:
        warn(_message(reader, t, x, *worst), AccuracyWarning)


def _worst_shown(reader: Reader, t: Array, x: Array, names: Sequence[str]) -> tuple[str, int, float] | None:
    """What samples show worst of some quantities: name, place and time in s; None where they show all of them."""
    times, first = np.unique(t, return_index=True)
    between, anywhere = _between(reader, times, x[first])
    states = reader.dense(between)
    worst, where = 1.0, None
    for name in names:
        samples, values = (
            reader.values(name, *motion).reshape(len(motion[0]), -1) for motion in ((t, x), (between, states))
        )
        size = np.maximum(np.abs(np.concatenate([samples, values])).max(axis=0), np.finfo(float).tiny)
        over = np.maximum(values - samples.max(axis=0), samples.min(axis=0) - values)
        apart = np.abs(values - _lines(times, samples[first], between))
        astray = np.sqrt(np.mean(apart[anywhere] ** 2, axis=0))
        for share, far in ((over.max(axis=0) / HIDDEN, over), (astray / STRAYED, apart)):
            place = int(np.argmax(share / size))
            if share[place] > worst * size[place]:
                worst = float(share[place] / size[place])
                where = name, place, float(between[far[:, place].argmax()])
    return where


def _between(reader: Reader, times: Array, states: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Times at which the states stray most from lines between samples, and any; which of them are the latter."""
    count = states.shape[1]
    looks = _looks(times, reader.steps, min(MOST_LOOKS, MOST_VALUES // max(1, count)))
    strayed = np.abs(reader.dense(looks) - _lines(times, states, looks))
    each = min(len(looks), 1 + CHOSEN // max(1, count)) - 1
    chosen = np.argpartition(-strayed, each, axis=0)[: each + 1].ravel()
    evenly = np.searchsorted(looks, np.linspace(looks[0], looks[-1], ANYWHERE))
    between = looks[np.union1d(chosen, evenly)]
    return between, np.isin(between, looks[evenly])


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


def _message(reader: Reader, t: Array, x: Array, name: str, place: int, near: float) -> str:
    """What is not seen of a quantity near a time: its turn there, and how close samples must be to show that."""
    samples = reader.values(name, t, x).reshape(len(t), -1)[:, place]
    low, high = float(samples.min()), float(samples.max())
    read = reader.quantity(name, place if reader.places(name) else None)
    times = np.unique(t)
    after = int(np.searchsorted(times, near))
    start, end = times[after - 1 : after + 1].tolist()
    inner = reader.steps[(reader.steps > start) & (reader.steps < end)]
    left, right = read(np.array([start, end])).tolist()
    turns = course(read, np.array([start, *inner, end])).extremes()
    lines = [left + (right - left) * (when - start) / (end - start) for when, _ in turns]
    which = int(np.argmax([abs(value - line) for (_, value), line in zip(turns, lines, strict=True)]))
    (when, value), line = turns[which], lines[which]
    room, width = HIDDEN * max(abs(value), -low, high), 0.0
    offsets = np.geomspace(NARROWEST, 1.0, OFFSETS) * (end - start)
    for side in (-1, 1):
        aside = np.clip(when + side * offsets, reader.steps[0], reader.steps[-1])[::side]
        stays = np.abs(read(aside)[::side] - value) <= room
        width += float(offsets[int(np.argmin(np.append(stays, False))) - 1]) if stays[0] else 0.0
    count = (times[-1] - times[0]) / width if width else np.inf
    enough = f"About t_eval={_rounded_up(count)} show it." if count < MOST_OUTPUTS else "No even output times show it."
    return (
        f"The {len(t)} output times of '{reader.title}' are too far apart for what swings in it: '{name}' is "
        f"{value:.5g} {reader.unit(name)} at t = {when:.6g} s, where a line between its samples is at {line:.5g}, and "
        f"its samples lie between {low:.5g} and {high:.5g}. {enough} sol.max('{name}') and sol.min('{name}') are right "
        "whatever the output times."
    )


def _rounded_up(count: float) -> int:
    """A number of intervals to one digit, as a number of output times."""
    digit = 10.0 ** int(np.log10(count))
    return int(np.ceil(count / digit) * digit) + 1
