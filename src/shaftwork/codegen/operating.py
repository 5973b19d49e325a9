"""Steady operation: the states at which nothing changes."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import MatrixRankWarning, lsqr, splu

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.start_names import inner_nodes, node_of, speed_at
from shaftwork.core.errors import SimulationError
from shaftwork.core.notices import hint
from shaftwork.formulation.form import StateForm
from shaftwork.network.netlist import listed
from shaftwork.numerics.tolerances import EPS, SAME

TINY = float(np.finfo(float).tiny)
INSTANT = 1e-12
"""A time, s, that is none beside any motion."""


class Way(NamedTuple):
    """The way to a steady state.

    Args:
        first: its first step, s.
        defect: a step is taken when its equation is left with less than this fraction of the rates.
        nearby: so far ahead, s, a law is asked for its slope where it has none.
        standstill: it ends when the last step changed the states by no more than this fraction.
        steps: at most so many are tried.
    """

    first: float = 1e-6
    defect: float = 0.3
    nearby: tuple[float, ...] = (1e-9, 1e-7)
    standstill: float = 1e-6
    steps: int = 2000


WAY = Way()


def steady_state(bound: BoundArrays, start: Array, t: float, *, ends: Callable[[Array], bool] | None = None) -> Array:
    """States at which nothing changes, reached from a start the way the drive itself would reach it.

    Where `ends` says of states that other equations hold there, the way ends just beyond.

    Law: implicit Euler steps (I/h - J) dx = rhs, each with one iteration of Newton's method. A step is taken where its
    defect is small, and the next is then longer: first the motion of the drive is followed, so that of several steady
    states the one it runs to is found, and in the end the steps are those of Newton's method. A jump of a law, such as
    the flank of a damped gap which the drive runs onto, is passed in a step that is next to nothing. No state is known
    better than to rounding of the whole stored energy: a drive that stands under load has the speeds that its torques
    leave.

    Raises:
        SimulationError: the rates do not vanish; the message names the state that keeps changing.
    """
    form = bound.program.form
    # What is recorded alone may turn on: it is left at its start.
    counts = np.array([not (state.kind == "integral" and state.branch in form.recorded) for state in form.states])
    counted = sparse.diags_array(counts.astype(float), format="csc")
    identity = sparse.eye_array(len(counts), format="csc")
    weights = energy_weights(bound)

    def length(vector: Array) -> float:
        return float(np.linalg.norm(weights * vector))

    x = np.array(start, dtype=float)
    rate, step = counts * bound.rhs(t, x), np.zeros_like(x)
    h = WAY.first
    for _ in range(WAY.steps):
        slopes = counted @ _slopes(bound, t, x, rate)
        vanishing = SAME * _rate_sizes(bound, t, x, slopes, length(x) / weights * (EPS / SAME))
        settled = np.linalg.norm(step) <= WAY.standstill * np.linalg.norm(x)  # a drive that runs away is not steady
        if settled and (np.abs(rate) <= vanishing).all():
            return x
        trial = _solve(sparse.csc_array(identity / h - slopes), rate)
        new = counts * bound.rhs(t, x + trial)
        defect = length(trial / h - new) / max(length(rate), length(vanishing), TINY)
        over = ends is not None and ends(x + trial)
        is_right = defect < WAY.defect or (h < INSTANT and np.isfinite(defect))
        if not is_right or (over and h > WAY.first):
            h = h / 4
            if h < TINY:  # a law that is nowhere finite on the way leaves none
                break
            continue
        if over and ends is not None:
            return _just_beyond(x, trial, ends)
        x, rate, step, h = x + trial, new, trial, min(h * (2.0 if defect > WAY.defect / 10 else 8.0), 1e12)
    raise _still_changing(form, x, rate, int(np.argmax(np.abs(weights * rate))))


def _rate_sizes(bound: BoundArrays, t: float, x: Array, slopes: sparse.csc_array, floor: Array) -> Array:
    """(n,) sizes of what the rates are sums of, where each state is known no better than its floor (n,)."""
    A, B = np.abs(bound.part.A), np.abs(bound.part.B)
    sizes = A @ np.abs(x) + B @ np.abs(bound.values(t, x)[1]) + np.maximum(A @ floor, np.abs(slopes) @ floor)
    return np.asarray(sizes + TINY)


def _still_changing(form: StateForm, x: Array, rate: Array, worst: int) -> SimulationError:
    """What is said where no steady state was found, of the state that changes most."""
    message = (
        f"No steady state was found: '{form.states[worst].name}' still changes by {rate[worst]:.3g} per second at "
        f"{x[worst]:.6g}."
    )
    swings = (f"{part.name}.{part.component.swing}" for part in form.graph.parts if part.component.swing)
    if swinging := [name for name in swings if form.graph.parameters.get(name)]:
        means = ", ".join(f"'{name}': 0" for name in swinging[:2]) + (", ..." if len(swinging) > 2 else "")
        verb = "swing" if len(swinging) > 1 else "swings"
        return SimulationError(
            f"{message} {listed([name.rpartition('.')[0] for name in swinging])} {verb} with the angle of the shaft, "
            "so nothing is steady. sw.torsional_calculation(net, speeds) has the vibration about a steady speed; the "
            f"operating point of the mean torques is steady_state(parameters={{{means}}})."
        )
    if worst >= form.torques.stop:
        return SimulationError(
            f"{message} A law reads it, so nothing is steady while it changes. Where a torque pulsates with the angle "
            "of what turns, write its mean over a turn; or run simulate(...) until it repeats itself, and take means."
        )
    return SimulationError(
        f"{message} Does something hold the speed (a load, a damper, a motor's curve)? {another_start(form)}"
    )


def another_start(form: StateForm) -> str:
    """Where a steady state may be found if the way from rest leads to none, in words."""
    nodes = (node_of(form, branch) for branch in form.across_states)
    inside = inner_nodes(form)
    name = next((speed_at(form, node) for node in nodes if node not in inside), "J1.omega")
    return hint(
        "By default the search starts at rest, where the load may overhaul the motor: give a start near the operating "
        f"point, steady_state(initial={{'{name}': ...}}).",
        f"The search starts at rest, where the load may overhaul the motor: name the speeds instead, --at {name}=...",
    )


def _slopes(bound: BoundArrays, t: float, x: Array, rate: Array) -> sparse.csc_array:
    """The Jacobian; where a law has no finite slope, as |omega|^0.5 at rest, that a little farther on the way."""
    for step in (0.0, *WAY.nearby):
        jacobian = sparse.csc_array(bound.jacobian(t, x + step * rate))
        if np.isfinite(jacobian.data).all():
            return jacobian
    jacobian.data[~np.isfinite(jacobian.data)] = 0.0  # an explicit step of Euler, which the defect judges
    return jacobian


def _just_beyond(x: Array, step: Array, ends: Callable[[Array], bool]) -> Array:
    """The shortest part of a step that ends the way, to rounding: what comes to rest there has no speed left.

    The whole step where the way had ended before it, so that it goes on.
    """
    inside, beyond = (1.0 if ends(x) else 0.0), 1.0
    while inside < (share := (inside + beyond) / 2) < beyond:
        inside, beyond = (inside, share) if ends(x + share * step) else (share, beyond)
    return np.asarray(x + beyond * step)


def energy_weights(bound: BoundArrays) -> Array:
    """Factors of the states with which the sum of squares is twice the stored energy."""
    form, coefficients = bound.program.form, bound.part.coefficients
    return np.concatenate(
        [
            np.sqrt(coefficients[list(form.across_states)]),
            1 / np.sqrt(coefficients[list(form.through_states)]),
            np.ones(len(form.integrals)),
        ]
    )


def lasting(bound: BoundArrays, x: Array, disturbed: Array, t: float) -> Array:
    """(n,) what a disturbance (n,) of a steady state (n,) leaves for ever: one long step of implicit Euler."""
    weights = energy_weights(bound)
    scaled = sparse.diags_array(weights) @ bound.jacobian(t, x) @ sparse.diags_array(1 / weights)
    slow = SAME * (float(abs(scaled).max()) if scaled.nnz else 0.0)
    if not slow:
        return disturbed
    identity = sparse.eye_array(len(x), format="csc")
    return np.asarray(_solve(sparse.csc_array(slow * identity - scaled), slow * weights * disturbed) / weights)


def _solve(matrix: sparse.csc_array, right: Array) -> Array:
    try:
        step: Array = splu(matrix).solve(right)
    except (RuntimeError, MatrixRankWarning):
        step = lsqr(matrix, right)[0]
    return step
