"""Modelica texts run by rumoca, a compiler of others, and compared with the library."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np
import rumoca
from numpy.typing import NDArray

import shaftwork as sw

TOLERANCE = 1e-9
"""Of rumoca, relative and absolute."""


def run(text: str, t: NDArray[np.float64]) -> rumoca.Result:
    """The motion of the one model of a text, over equally spaced times."""
    kind, name = re.search(r"^(package|model) (\w+)", text, re.MULTILINE).groups()  # type: ignore[union-attr]
    model = rumoca.Session().loads(text, model=f"{name}.Network" if kind == "package" else name)
    options = rumoca.SimConfig(rtol=TOLERANCE, atol=TOLERANCE, max_wall_seconds=60)
    return model.simulate(float(t[-1]), dt=float(t[1]), config=options)


def values(result: rumoca.Result, name: str, t: NDArray[np.float64]) -> NDArray[np.float64]:
    """A variable at times; there are further times at events."""
    places = np.searchsorted(result.time, t - 1e-9 * t[-1])
    return np.asarray(result[name])[np.minimum(places, len(result.time) - 1)]


def deviation(
    net: sw.Network, pairs: Mapping[str, str], t_end: float, *, text: str, initial: Mapping[str, float] | None = None
) -> float:
    """The largest difference between quantities and variables, relative to the largest value of their kind."""
    motion = net.simulate(t_end, t_eval=101, initial=initial)
    result = run(text, motion.t)
    errors: dict[str, float] = {}
    sizes: dict[str, float] = {}
    for ours, theirs in pairs.items():
        kind = ours.rpartition(".")[2]
        errors[kind] = max(
            errors.get(kind, 0.0), float(np.max(np.abs(motion[ours] - values(result, theirs, motion.t))))
        )
        sizes[kind] = max(sizes.get(kind, 1e-12), float(np.max(np.abs(motion[ours]))))
    return max(errors[kind] / sizes[kind] for kind in errors)


def stores(net: sw.Network, *, flat: bool) -> dict[str, str]:
    """The speeds of inertias and masses and the voltages of capacitors, and their names in Modelica."""
    letters = {"Inertia": ("omega", "w"), "Mass": ("v", "v"), "Capacitor": ("u", "v")}
    pairs = {}
    for placed in net.netlist().placed:
        kind, name = type(placed.part).__name__, placed.part.name
        if kind in letters:
            ours, theirs = letters[kind]
            plain = re.sub(r"\W", "_", name)
            pairs[f"{name}.{ours}"] = f"{plain}_{ours}" if flat else f"{plain}.{theirs}"
    return pairs
