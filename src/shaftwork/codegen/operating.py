"""Start states: from given speeds and twists, and steady operation."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import MatrixRankWarning, lsqr, splu

from shaftwork.codegen.arrays import BoundArrays
from shaftwork.codegen.elements import Array
from shaftwork.codegen.observer import ModelObserver
from shaftwork.codegen.recovery import History
from shaftwork.components.base import Profile
from shaftwork.core.errors import ParameterError, SignalError, SimulationError
from shaftwork.core.parameters import in_si
from shaftwork.core.times import just_after
from shaftwork.network.graph import GraphPart
from shaftwork.network.templates import Kind

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
    runs straight from the one end to the other, and so does a given torque of its ends: it is the one inside, of which
    the inertia that a mesh has at an end takes its share as soon as the shaft is let go.

    Args:
        bound: the array program.
        given: "part.quantity" or "node.quantity" to value in SI.
        t0: start time, s; where something jumps there, a time after it.

    Raises:
        SignalError: there is no such quantity.
        ParameterError: values are not finite or contradict each other (two speeds of one rigid group).
    """
    form = bound.program.form
    names = [state.name for state in form.states]
    place = {name: k for k, name in enumerate(names)}
    rest = bound.impulse(np.zeros(len(names)), None, just_after(t0))
    if not isinstance(given, Mapping):
        raise ParameterError(f"initial = {given!r} must map quantities to values, such as {{'J1.omega': 3.0}}.")
    units = ModelObserver(form, lambda: bound).units
    numbers = {
        str(name): in_si(f"the start value of '{name}'", value, units.get(name, "1")) for name, value in given.items()
    }
    if not numbers:
        return rest
    x = rest.copy()
    for name, value in numbers.items():
        if name in place:
            x[place[name]] = value
    indirect = {name: value for name, value in numbers.items() if name not in place}
    wound = tuple(_wound_shafts(bound, numbers))
    twists = {state for shaft in wound for state in shaft.states}
    free = [k for k, name in enumerate(names) if name not in numbers and k not in twists]
    filled = {name: value for name, value in indirect.items() if not any(name in shaft.hidden for shaft in wound)}
    inside: dict[int, float] = {}
    for _ in range(2):  # the speeds inside follow those of the ends, and dampers inside take a part of the torque
        for shaft in wound:
            shaft.wind(bound, just_after(t0), x, kept=numbers)
        _fill(bound, filled, [k for k in free if k not in inside], t0, x)
        inside = _inside_shafts(bound, names, numbers, t0, x - rest)
        x[list(inside)] = rest[list(inside)] + list(inside.values())
    _fill(bound, filled, [k for k in free if k not in inside], t0, x)
    _refuse_contradictions(bound, filled, t0, x)
    return x


@dataclass(frozen=True)
class _WoundShaft:
    """A shaft to which the torque along it is given, straight from the one end to the other.

    Args:
        part: the shaft.
        profile: of its torque.
        states: numbers of its stores of torque among the states, in their order along the shaft.
        ends: torque at its first and last end, N m.
        hidden: names of the values given to it that need not be read at its ends: inertia stands there.
    """

    part: GraphPart
    profile: Profile
    states: tuple[int, ...]
    ends: tuple[float, float]
    hidden: tuple[str, ...]

    def wind(self, bound: BoundArrays, t: float, x: Array, *, kept: Mapping[str, float]) -> None:
        """Give each store what is left of the torque by the damper beside it, unless it has a value of its own."""
        states, own = list(self.states), [bound.program.form.states[k].name in kept for k in self.states]
        columns = History(bound, np.array([t]), x[None, :]).profile(self.part, self.profile)[0]
        if len(columns) == 2:
            places, beside = np.array([0.5]), columns[:1] - x[states]
        elif len(columns) == len(states):  # what is read at the very ends counts the inertia there too
            places = np.array(self.profile.places)
            beside = np.pad(columns[1:-1] - x[states][1:-1], 1, mode="edge")
        else:
            places, beside = np.array(self.profile.places[1:-1]), columns[1:-1] - x[states]
        x[states] = np.where(own, x[states], np.interp(places, (0, 1), self.ends) - beside)


def _wound_shafts(bound: BoundArrays, given: Mapping[str, float]) -> Iterator[_WoundShaft]:
    """The shafts with a torque at an end among the given values, whose stores of torque are states still open."""
    form = bound.program.form
    state = {branch: k for k, branch in enumerate(form.through_states, len(form.across_states))}
    for part in form.graph.parts:
        own = [k for k in part.branches if form.graph.branches[k].template.kind is Kind.THROUGH_STORE]
        if not all(k in state for k in own) or all(form.states[state[k]].name in given for k in own):
            continue
        for profile in part.component.profiles().values():
            if profile.kind != "through" or profile.lines:
                continue
            names = [_signal_of(part, *terms[0]) for terms in (profile.of[0], profile.of[-1])]
            found = {name: given[name] for name in names if name in given}
            if found:
                other = next(iter(found.values()))
                first, last = (found.get(name, other) for name in names)
                hidden = tuple(found) if len(profile.places) > 2 else ()
                yield _WoundShaft(part, profile, tuple(state[k] for k in own), (first, last), hidden)


def _signal_of(part: GraphPart, sign: float, port: str) -> str:
    """The name of the torque that a part takes in at a port, or gives there where the sign is negative."""
    signals = part.component.signals().items()
    wanted = ("through", (port, None), sign)
    return next(f"{part.name}.{name}" for name, made in signals if (made.kind, made.ends, made.sign) == wanted)


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


def _fill(bound: BoundArrays, given: Mapping[str, float], free: list[int], t0: float, x: Array) -> None:
    """Change the free states of x so that the given quantities, which depend on the states linearly, come true."""
    if not given or not free:
        return
    trial = np.vstack([x, x + np.eye(len(x))[free]])
    values = _read(bound, given, t0, trial)
    rows, gap = values[:, 1:] - values[:, :1], np.array(list(given.values())) - values[:, 0]
    x[free] += np.linalg.lstsq(rows, gap, rcond=None)[0]


def _refuse_contradictions(bound: BoundArrays, given: Mapping[str, float], t0: float, x: Array) -> None:
    if not given:
        return
    names = [state.name for state in bound.program.form.states]
    trial = np.vstack([x, x + np.eye(len(x))])
    values = _read(bound, given, t0, trial)
    wanted, reached = np.array(list(given.values())), values[:, 0]
    scale = np.abs(wanted).max() + np.abs(values).max()
    for name, asked, got in zip(given, wanted, reached, strict=True):
        if abs(got - asked) > CONSISTENT * scale:
            raise ParameterError(
                f"The start value {name} = {asked:g} contradicts the others: what is rigidly joined to it makes it "
                f"{got:g}. Give one value for each rigid group. The states are: {', '.join(names)}."
            )


def _read(bound: BoundArrays, quantities: Iterable[str], t0: float, x: Array) -> Array:
    """(quantities, k) their values just after the start at states (k, n).

    Raises:
        SignalError: there is no such quantity.
    """
    form = bound.program.form
    observer = ModelObserver(form, lambda: bound)
    derived = ("power", "energy")
    if unknown := [name for name in quantities if name not in observer.units or name.endswith(derived)]:
        owner = unknown[0].rpartition(".")[0]
        own = [name for name in observer.units if name.rpartition(".")[0] == owner]
        near = own or [state.name for state in form.states]
        raise SignalError(
            f"There is no speed, twist or torque '{unknown[0]}' to start from. Near it: {', '.join(near)}."
        )
    times = np.full(len(x), just_after(t0))
    return np.array([observer.signal(name, times, x) for name in quantities])


def steady_state(
    bound: BoundArrays,
    start: Array,
    t: float,
    *,
    tolerance: float = 1e-12,
    limit: int = 2000,
    ends: Callable[[Array], bool] | None = None,
) -> Array:
    """States at which nothing changes, reached from a start the way the drive itself would reach it.

    Where `ends` says of states that other equations hold there, the way ends just beyond.

    Law: implicit Euler steps (I/h - J) dx = rhs, each with one iteration of Newton's method. A step is taken where its
    defect is small, and the next is then longer: first the motion of the drive is followed, so that of several steady
    states the one it runs to is found, and in the end the steps are those of Newton's method. No state is known better
    than to rounding of the whole stored energy: a drive that stands under load has the speeds that its torques leave.

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
        floor = np.linalg.norm(weights * x) / weights * (np.finfo(float).eps / tolerance)
        size = np.abs(bound.part.A) @ (np.abs(x) + floor) + np.abs(bound.part.B) @ np.abs(bound.values(t, x)[1])
        settled = np.linalg.norm(step) <= STANDSTILL * np.linalg.norm(x)  # a drive that runs away is not steady
        if settled and (np.abs(rate) <= tolerance * (size + np.finfo(float).tiny)).all():
            return x
        trial = _solve(sparse.csc_array(identity / h - bound.jacobian(t, x)), rate)
        new = bound.rhs(t, x + trial)
        defect = np.linalg.norm(weights * (trial / h - new)) / max(
            np.linalg.norm(weights * rate), np.linalg.norm(weights * size) * tolerance, np.finfo(float).tiny
        )
        over = ends is not None and ends(x + trial)
        if not defect < DEFECT or (over and h > SMALLEST_STEP):
            h = h / 4
            continue
        if over:
            return np.asarray(x + trial)
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
