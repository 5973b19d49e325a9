"""Start states: from given speeds and twists, and steady operation."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import MatrixRankWarning, lsqr, splu

from shaftwork.codegen.arrays import BoundArrays
from shaftwork.codegen.elements import Array
from shaftwork.codegen.observer import ModelObserver
from shaftwork.codegen.recovery import History
from shaftwork.core.errors import ParameterError, SignalError, SimulationError
from shaftwork.core.parameters import in_si
from shaftwork.core.times import just_after

SMALLEST_STEP = 1e-6
"""First step of the way to a steady state, s."""
DEFECT = 0.3
"""A step on that way is taken when its equation is left with less than this fraction of the rates."""
STANDSTILL = 1e-6
"""A steady state has been reached when the last step changed the states by no more than this fraction."""
CONSISTENT = 1e-9
"""Two given values contradict each other when they differ by more than this fraction."""


def initial_state(bound: BoundArrays, given: Mapping[str, float], t0: float) -> Array:
    """The states at the start: at rest and untwisted except for what is given.

    Rest is that before the sources come on: where a prescribed speed is there from the start, its impulse has been
    given to the inertias joined to it rigidly. A value may be given for any speed or twist, also of a part whose store
    is dependent; what it leaves open is filled with the smallest possible motion. Along a long shaft the given speed
    runs straight from the one end to the other.

    Args:
        bound: the array program.
        given: "part.quantity" or "node.quantity" to value in SI.
        t0: start time, s; where something jumps there, a time after it.

    Raises:
        SignalError: there is no such quantity.
        ParameterError: values are not finite or contradict each other (two speeds of one rigid group).
    """
    names = [state.name for state in bound.program.form.states]
    place = {name: k for k, name in enumerate(names)}
    x = rest = bound.impulse(np.zeros(len(names)), None, just_after(t0))
    if not isinstance(given, Mapping):
        raise ParameterError(f"initial = {given!r} must map quantities to values, such as {{'J1.omega': 3.0}}.")
    units = ModelObserver(bound.program.form, lambda: bound).units
    numbers = {
        str(name): in_si(f"the start value of '{name}'", value, units.get(name, "1")) for name, value in given.items()
    }
    if not numbers:
        return x
    x = rest.copy()
    for name, value in numbers.items():
        if name in place:
            x[place[name]] = value
    indirect = {name: value for name, value in numbers.items() if name not in place}
    if indirect:
        free = [k for k, name in enumerate(names) if name not in given]
        _fill(bound, names, indirect, free, t0, x)
    inside = _inside_shafts(bound, names, given, t0, x - rest)
    if inside:
        x[list(inside)] += list(inside.values())
        if indirect:
            _fill(bound, names, indirect, [k for k in free if k not in inside], t0, x)
    return x


def _inside_shafts(
    bound: BoundArrays, names: list[str], given: Mapping[str, float], t0: float, change: Array
) -> dict[int, float]:
    """For each state that is a speed inside a shaft, and not given, the speed between those given to the ends."""
    form = bound.program.form
    owner = {form.graph.branches[branch].plus: k for k, branch in enumerate(form.across_states)}
    potentials = History(bound, np.array([just_after(t0)]), change[None, :]).potentials[:, 0]
    found: dict[int, float] = {}
    for part in form.graph.parts:
        for profile in part.component.profiles().values():
            if profile.kind == "across" and not profile.lines and len(profile.of) > 2:
                nodes = [part.nodes[name] for ((_, name),) in profile.of]
                first, last = potentials[nodes[0]], potentials[nodes[-1]]
                for node, share in zip(nodes[1:-1], profile.places[1:-1], strict=True):
                    if node in owner and names[owner[node]] not in given:
                        found[owner[node]] = float(first + share * (last - first))
    return found


def _fill(
    bound: BoundArrays, names: list[str], given: Mapping[str, float], free: list[int], t0: float, x: Array
) -> None:
    """Change the free states of x so that the given quantities, which depend on the states linearly, come true."""
    observer = ModelObserver(bound.program.form, lambda: bound)
    derived = ("power", "energy")
    if unknown := [name for name in given if name not in observer.units or name.endswith(derived)]:
        owner = unknown[0].rpartition(".")[0]
        own = [name for name in observer.units if name.rpartition(".")[0] == owner] or names
        raise SignalError(
            f"There is no speed, twist or torque '{unknown[0]}' to start from. Near it: {', '.join(own)}."
        )
    trial = np.vstack([x, x + np.eye(len(x))[free]])
    times = np.full(len(trial), just_after(t0))
    values = np.array([observer.signal(name, times, trial) for name in given])
    wanted = np.array(list(given.values()))
    rows, gap = values[:, 1:] - values[:, :1], wanted - values[:, 0]
    x[free] += np.linalg.lstsq(rows, gap, rcond=None)[0] if free else 0.0
    reached = np.array([observer.signal(name, times[:1], x[None, :])[0] for name in given])
    scale = np.abs(wanted).max() + np.abs(values).max()
    for name, asked, got in zip(given, wanted, reached, strict=True):
        if abs(got - asked) > CONSISTENT * scale:
            raise ParameterError(
                f"The start value {name} = {asked:g} contradicts the others: what is rigidly joined to it makes it "
                f"{got:g}. Give one value for each rigid group. The states are: {', '.join(names)}."
            )


def steady_state(bound: BoundArrays, start: Array, t: float, *, tolerance: float = 1e-12, limit: int = 2000) -> Array:
    """States at which nothing changes, reached from a start the way the drive itself would reach it.

    Law: implicit Euler steps (I/h - J) dx = rhs, each with one iteration of Newton's method. A step is taken where its
    defect is small, and the next is then longer: first the motion of the drive is followed, so that of several steady
    states the one it runs to is found, and in the end the steps are those of Newton's method.

    Raises:
        SimulationError: the rates do not vanish; the message names the state that keeps changing.
    """
    x = np.array(start, dtype=float)
    names = [state.name for state in bound.program.form.states]
    weights = _energy_weights(bound)
    rate, step = bound.rhs(t, x), np.zeros_like(x)
    h = SMALLEST_STEP
    identity = sparse.eye_array(len(x), format="csc")
    for _ in range(limit):
        size = np.abs(bound.part.A) @ np.abs(x) + np.abs(bound.part.B) @ np.abs(bound.values(t, x)[1])
        settled = np.linalg.norm(step) <= STANDSTILL * np.linalg.norm(x)  # a drive that runs away is not steady
        if settled and (np.abs(rate) <= tolerance * (size + np.finfo(float).tiny)).all():
            return x
        trial = _solve(sparse.csc_array(identity / h - bound.jacobian(t, x)), rate)
        new = bound.rhs(t, x + trial)
        defect = np.linalg.norm(weights * (trial / h - new)) / max(
            np.linalg.norm(weights * rate), np.linalg.norm(weights * size) * tolerance, np.finfo(float).tiny
        )
        if not defect < DEFECT:
            h = h / 4
            continue
        x, rate, step, h = x + trial, new, trial, min(h * (2.0 if defect > DEFECT / 10 else 8.0), 1e12)
    worst = int(np.argmax(np.abs(weights * rate)))
    raise SimulationError(
        f"No steady state was found: '{names[worst]}' still changes by {rate[worst]:.3g} per second at {x[worst]:.6g}. "
        f"Does something hold the speed (a load, a damper, a motor's curve)? Give a start near the operating point."
    )


def _energy_weights(bound: BoundArrays) -> Array:
    """Factors of the states with which the sum of squares is twice the stored energy."""
    form, coefficients = bound.program.form, bound.part.coefficients
    return np.concatenate(
        [
            np.sqrt(coefficients[list(form.across_states)]),
            1 / np.sqrt(coefficients[list(form.through_states)]),
            np.ones(len(form.integrals)),
        ]
    )


def _solve(matrix: sparse.csc_array, right: Array) -> Array:
    try:
        step: Array = splu(matrix).solve(right)
    except (RuntimeError, MatrixRankWarning):
        step = lsqr(matrix, right)[0]
    return step
