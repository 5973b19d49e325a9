"""Where a function of time that is mostly plain leaves its course for a short while, found from samples of it."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from shaftwork.codegen.elements import Array

SAMPLES = 2**14
"""Of a run: what is narrower than a few of its parts of that number may be missed."""
PLAIN = 1e-4
"""A function goes straight on, to this part of its range, where no bump is: waves of up to 50 periods do everywhere."""
APART = 2.0
"""A bump has so many times its width of plain course on one side: no step passes what lasts longer unawares."""
STOPS = np.linspace(-0.5, 1.5, 13)
"""Where steps end at a bump, in its widths: where it shows it is 1e-4 high, and began before."""
GOLDEN = (math.sqrt(5) - 1) / 2


def irregular(t0: float, t_end: float, size: int) -> Array:
    """Times (size + 1,) from t0 to t_end without a frequency that they mistake for another."""
    places = np.arange(size)
    return np.append(t0 + (t_end - t0) * ((places + places * GOLDEN % 1.0) / size), t_end)


def bumps(function: Callable[[Array], Array], t0: float, t_end: float) -> Array:
    """Times in s, increasing, at which steps end so that none passes a bump unawares.

    Args:
        function: from times (k,) in s to values (k,).
        t0: start of the run, s.
        t_end: its end, s.
    """
    t = irregular(t0, t_end, SAMPLES)
    x = function(t)
    if not np.isfinite(x).all() or not np.ptp(x) > 0:
        return np.empty(0)
    straight = x[:-2] + (x[2:] - x[:-2]) * ((t[1:-1] - t[:-2]) / (t[2:] - t[:-2]))
    bent = np.concatenate([[False], np.abs(x[1:-1] - straight) > PLAIN * np.ptp(x), [False]])
    edges = np.flatnonzero(np.diff(bent))
    stretches: list[tuple[float, float]] = []
    for begin, end in zip(t[edges[::2]].tolist(), t[edges[1::2] + 1].tolist(), strict=True):
        # where a flank turns, a bump is straight too
        joined = stretches and begin - stretches[-1][1] < APART * max(end - begin, np.ptp(stretches[-1]))
        stretches.append((stretches.pop()[0] if joined else begin, end))
    begins, ends = np.array(stretches).reshape(-1, 2).T
    plain = np.maximum(begins - np.append(t0, ends[:-1]), np.append(begins[1:], t_end) - ends)
    width = ends - begins
    return np.unique((begins + STOPS[:, None] * width)[:, APART * width < plain])
