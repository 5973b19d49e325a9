"""What a tolerance is worth: that of tiny motions, which ordinary ones would hide, and what an engine cannot keep."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.core.errors import AccuracyWarning
from shaftwork.core.notices import warn
from shaftwork.formulation.form import StateForm
from shaftwork.integrate.engines import ENGINES, WAVE, too_fine
from shaftwork.pipeline.arguments import NOMINAL, Demand, Sizes
from shaftwork.pipeline.prepared import Prepared
from shaftwork.results.solution import Solution

HIDDEN = 10.0
"""A state is hidden where its absolute tolerance is more than this many times its relative one at its largest."""
ROUNDING = 1e-14
"""Part of the size of all states together by which a step moves each of them at random."""
ATTEMPTS = 5
"""A motion that was hidden altogether shows its size after two or three runs."""
ENOUGH = 64
"""So many outputs show how large a motion is; fewer are no reason to look at the steps of heyoka, which costs a run."""


def in_its_size(form: StateForm, prepared: Prepared, demand: Demand, run: Callable[[Demand], Solution]) -> Solution:
    """A motion; where tolerances have hidden states, it is made again with those of its own size.

    The absolute tolerance of a state is a part of what it is at ordinary speeds. Where it never comes near that, no
    digit of it need be right. So what has been reached tells the sizes, and the next run has the tolerances of these.

    Args:
        form: of the equations with all that is stored.
        prepared: their tolerances for ordinary speeds.
        demand: what is asked of the run.
        run: makes the motion.
    """
    motion = run(demand)
    for _ in range(ATTEMPTS):
        sizes = None if demand.atol is not None else _hidden(motion, form, demand, prepared.atol)
        if sizes is None:
            break
        demand = replace(demand, sizes=sizes)
        motion = run(demand)
    return motion


def _hidden(motion: Solution, form: StateForm, demand: Demand, tolerances: Array) -> Sizes | None:
    """The sizes of a motion of which the tolerances have hidden something; None where they have not."""
    if not ENGINES.get(motion.engine, WAVE).absolute or not motion.states:
        return None
    largest, rtol = _largest(motion), demand.rtol
    overall = max(largest.values())
    if motion.engine == "heyoka":
        # its one tolerance is absolute while all states are below one
        absolute = min(rtol, ENGINES["heyoka"].loosest) * demand.sizes.overall
        return (
            Sizes(overall=10.0 ** math.floor(math.log10(overall))) if absolute > HIDDEN * rtol * overall > 0 else None
        )
    reached = np.array([largest.get(state.name, 0.0) for state in form.states])
    usual = demand.sizes.tolerances(tolerances, [state.name for state in form.states]) / NOMINAL
    is_angle = np.array([state.kind == "integral" for state in form.states], dtype=bool)
    ordinary = tolerances / NOMINAL
    speed = (reached / ordinary)[~is_angle].max(initial=0.0) or (reached / ordinary).max(initial=0.0)
    step = (demand.span[1] - demand.span[0]) / max(1, motion.statistics.get("steps", 1))
    floor = ROUNDING / rtol * speed * ordinary * np.where(is_angle, min(1.0, step), 1.0)
    if not ((reached > floor) & (NOMINAL * usual > HIDDEN * reached)).any():
        return None
    sizes = np.minimum(np.maximum(reached, floor), usual).tolist()
    return Sizes({state.name: size for state, size in zip(form.states, sizes, strict=True)})


def _largest(motion: Solution) -> dict[str, float]:
    """The largest absolute value of all that is stored."""
    enough = motion.engine == "heyoka" or len(motion.t) >= ENOUGH
    x = motion.x if enough else motion.dense(motion.steps)
    return dict(zip(motion.states, np.abs(x[:, : len(motion.states)]).max(axis=0).tolist(), strict=True))


def with_accuracy(motion: Solution, demand: Demand) -> Solution:
    """A motion that says with which tolerance it was made, where that is not the one that was asked for.

    Warns:
        AccuracyWarning: the motion has a caveat; or the engine that cannot keep the tolerance was asked for by name.
    """
    if motion.caveat:
        warn(motion.caveat, AccuracyWarning)
    told = too_fine(motion.engine, demand.rtol)
    if not told:
        return motion
    if demand.engine != "auto":
        warn(f"{told} Ask for no finer tolerance, or take another engine.", AccuracyWarning)
    return replace(motion, why=f"{motion.why.rstrip('.')}. {told}")
