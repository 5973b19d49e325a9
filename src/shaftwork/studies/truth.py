"""What a shaft really does, which its models are compared with, and what a model must do by its own definition.

The truth is computed far more exactly than a run, and the tests compare it with other solutions of the continuous
shaft. What a model must do uses no network, no equations of one and no engine.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import expm
from sympy import Expr, lambdify

from shaftwork.components.laws import NUMERICAL
from shaftwork.components.laws import t as TIME
from shaftwork.components.shaft_models import OneSpring, Rigid, ShaftModel, Spectral, Wave
from shaftwork.components.shafts import Shaft
from shaftwork.core.errors import AccuracyWarning, ShaftworkError
from shaftwork.core.notices import muted
from shaftwork.pipeline.network import Network
from shaftwork.results.observer import Array
from shaftwork.results.solution import Solution
from shaftwork.studies.stability_cases import TORQUE, Case

if TYPE_CHECKING:
    from shaftwork.frequency.natural_modes import NaturalModes

QUANTITIES = ("tau_a", "tau_b", "tau_mid", "omega_a", "omega_b")
"""What is compared: torque at both ends and in the middle, speed of both ends."""
ENDS = tuple(name for name in QUANTITIES if name != "tau_mid")
COARSE = Spectral(8)
"""The model of a network whose shafts are then taken without one."""
FINE, FINER, TIGHT = 48, 64, 1e-11
"""Degrees of two spectral models whose difference says how well the finer one stands for the truth; tolerance of what
stands for it."""
NONLINEAR, LOOSER = (8, 12, 16, 24, 32), 1e-8
"""The same for a nonlinear network that no wave solves, up to where two are alike: its modes are stepped through one by
one, and of a shaft that is damped the high ones do not matter."""
ALIKE = 10 * LOOSER
"""So much of the largest torque two models may differ that stand for the truth of a nonlinear network."""

MODES = 3
"""Elastic natural frequencies that are compared. The truth names one more, to tell those beyond from them."""
MOST_PREDICTED = 200
"""Up to so many elements the motion of a model is computed by its own definition."""


@dataclass(frozen=True)
class ShaftMotion:
    """The motion of one shaft at the times asked for.

    Args:
        values: (k,) of each compared quantity, by name.
        error: estimate of its own error, relative to the largest torque.
        source: where it comes from, a few words.
    """

    values: Mapping[str, Array]
    error: float
    source: str


def with_model(net: Network, shaft: str, model: ShaftModel) -> Network:
    """The same network with another model of its shafts.

    Other shafts than the named one that are rigid or one spring stay so: that is a wish, no approximation.
    """
    varied = Network(net.name)
    for placed in net.netlist().placed:
        part = placed.part
        if isinstance(part, Shaft) and (part.name == shaft or not isinstance(part.resolved, Rigid | OneSpring)):
            part = dataclasses.replace(part, model=model)
        varied.add(part, *placed.nodes)
    return varied


def exact_motion(
    net: Network, shaft: str, t_end: float, t: Array, tell: Callable[[str], None] = lambda _: None
) -> ShaftMotion:
    """The exact motion of a shaft.

    A network without losses along its shafts is solved by travelling waves; any other by a spectral model of high
    degree.

    Args:
        net: the network.
        shaft: name of the shaft.
        t_end: end of the motion, s.
        t: (k,) times at which it is wanted, s.
        tell: is told what is done meanwhile, in a line.

    Raises:
        ShaftworkError: the network cannot be solved.
    """
    if not any(part.damping or part.friction for part in net.parts if isinstance(part, Shaft)):
        tell("the exact motion, by travelling waves")
        with suppress(ShaftworkError):  # such as a clearance at an end of a shaft where no inertia is
            return ShaftMotion(_read(with_model(net, shaft, Wave(3)), shaft, t_end, t), TIGHT, "travelling waves")
    linear = with_model(net, shaft, COARSE).compile().linear
    degrees, rtol = ((FINE, FINER), TIGHT) if linear else (NONLINEAR, LOOSER)
    finer, gap, degree = dict[str, Array](), np.inf, 0
    for degree in degrees:
        tell(f"the motion with Spectral({degree}), which stands for the exact one")
        fine, finer = finer, _read(with_model(net, shaft, Spectral(degree)), shaft, t_end, t, rtol)
        gap = max((_apart(fine[name], finer[name]) for name in ("tau_a", "tau_b") if fine), default=np.inf)
        if gap <= ALIKE and not linear:
            break
    return ShaftMotion(finer, gap, f"Spectral({degree})")


def _apart(one: Array, other: Array) -> float:
    """By how much two courses differ, as a part of the largest value."""
    return float(np.abs(one - other).max() / np.abs(other).max())


def quantities(solution: Solution, net: Network, shaft: str) -> dict[str, Array]:
    """The compared quantities of a solution.

    The torque in the middle is what the model says: the value of its polynomial, or between the two nearest places.
    """
    places, torques = solution.places[f"{shaft}.tau"], solution[f"{shaft}.tau"]
    model = next(part.resolved for part in net.parts if isinstance(part, Shaft) and part.name == shaft)
    middle = places[-1] / 2
    if isinstance(model, Spectral):
        read = np.arange(1, len(places) - 1)  # the ends belong to what is there, not to the polynomial
    else:
        read = np.argsort(np.abs(places - middle), kind="stable")[:2]
    apart = places[read][:, None] - places[read] + np.eye(len(read))
    lagrange = np.prod((middle - places[read] - np.diag(middle - places[read] - 1)) / apart, axis=1)
    values = {name: solution[f"{shaft}.{name}"] for name in ENDS}
    return values | {"tau_mid": torques[:, read] @ lagrange}


def frequencies(modes: NaturalModes) -> Array:
    """The natural frequencies |rate| / 2 pi in Hz of the modes that swing."""
    return modes.frequencies[modes.frequencies > 0]


def exact_frequencies(net: Network, shaft: str) -> Array:
    """The lowest natural frequencies |rate| / 2 pi in Hz of a network at rest with exact shafts, damping included.

    They are those of modes that swing; empty where they are unknown.
    """
    try:
        exact = frequencies(with_model(net, shaft, COARSE).modes(exact=True))
    except ShaftworkError:
        return np.empty(0)
    return exact[: MODES + 1] if len(exact) > MODES else np.empty(0)


def _read(net: Network, shaft: str, t_end: float, t: Array, rtol: float = TIGHT) -> dict[str, Array]:
    return quantities(net.simulate(t_end, t_eval=t, rtol=rtol), net, shaft)


def exact(case: Case) -> ShaftMotion:
    """The motion of the continuous shaft.

    After a pulse a free shaft repeats its motion, so late times are early ones.
    """
    late = case.t_end - 6 * case.delay if case.periods else 0.0
    with muted(AccuracyWarning):  # its own error is known, and a run is judged with it
        motion = exact_motion(case.network(COARSE), "line", case.t_end - late, case.times - late)
    return dataclasses.replace(motion, values={name: motion.values[name] for name in ENDS})


@dataclass(frozen=True)
class _Chain:
    """A model of the shaft in its drive, as masses, springs and dashpots.

    Args:
        masses: (n,) inertia of each speed, kg m^2.
        shares: (n,) of that, what belongs to the shaft.
        twists: (k, n) rate of twist of each spring.
        springs: (k,) stiffness.
        slips: (j, n) speed of each dashpot.
        dashpots: (j,) damping.
        brakes: (n,) against the ground.
        far: (n,) omega_b as a sum of the speeds, of which omega_a is the first; nothing where that end is held.
    """

    masses: Array
    shares: Array
    twists: Array
    springs: Array
    slips: Array
    dashpots: Array
    brakes: Array
    far: Array


def predicted(case: Case, model: ShaftModel) -> ShaftMotion | None:
    """The motion that a model has by its definition, or None where it has none of its own or is too large.

    The matrices are written down here from the nodes, stations and weights of the model, in coordinates whose square is
    the energy, and exponentiated.
    """
    if (at_rest := _without_states(case, model)) is not None:
        return ShaftMotion(dict(zip(ENDS, at_rest, strict=True)), 0.0, repr(model))
    chain = None if isinstance(model, Wave) else _chain(case, model)
    if chain is None or not (chain.masses > 0).all():
        return None
    matrix, drive = _in_energy_coordinates(chain)
    n, size = len(chain.masses), len(matrix)
    states = _propagated(case, matrix, drive)
    torque = TORQUE * states[:, 2 * size]
    speeds, rates = (states[:, first : first + n] / np.sqrt(chain.masses) for first in (0, size))
    tau_a = torque - case.drive * case.inertia * rates[:, 0]
    values = {
        "tau_a": tau_a,
        "tau_b": tau_a - rates @ chain.shares,
        "omega_a": speeds[:, 0],
        "omega_b": speeds @ chain.far,
    }
    return ShaftMotion(values, 0.0, repr(model))


def function_of_time(law: Expr) -> Callable[[Array], Array]:
    """A law of time alone as a function of an array of times in s."""
    value = lambdify(TIME, law, modules=[NUMERICAL, "numpy"])
    return lambda t: np.broadcast_to(value(t), np.shape(t))


def _without_states(case: Case, model: ShaftModel) -> tuple[Array, ...] | None:
    """The quantities where the torque of the motor goes through to a wall, or to a brake that alone takes it."""
    torque = function_of_time(case.torque)(case.times)
    if isinstance(model, Rigid) and case.clamped:
        return torque, torque, np.zeros_like(torque), np.zeros_like(torque)
    if isinstance(model, OneSpring) and case.drive == case.load == 0 < case.damper and case.form in ("step", "pulse"):
        speed = torque / (case.damper * case.impedance)
        return torque, torque, speed, speed
    return None


def _chain(case: Case, model: ShaftModel) -> _Chain | None:
    parts = _parts(model)
    if parts is None:
        return None
    shares, lengths, weights, gaps, slips = parts
    springs, dashpots = case.stiffness / lengths, case.dashpot / gaps
    last = len(shares) - 1
    far = np.eye(1, last + 1, last)[0]
    if case.spring and isinstance(model, OneSpring):  # two springs in a row, without an inertia between them
        springs, far = springs * case.spring / (1 + case.spring), np.array([1.0, case.spring]) / (1 + case.spring)
    elif case.spring:
        weights = np.block([[weights, np.zeros((len(lengths), 1))], [np.eye(1, last + 1, last), -np.ones((1, 1))]])
        springs = np.append(springs, case.spring * case.stiffness)
        shares, far, slips, last = (
            np.append(shares, 0.0),
            np.append(far, 0.0),
            np.pad(slips, ((0, 0), (0, 1))),
            last + 1,
        )
    shares = shares * case.inertia
    masses, brakes = shares.copy(), np.zeros(len(shares))
    masses[0] += case.drive * case.inertia
    masses[last] += case.load * case.inertia
    brakes[last] = case.damper * case.impedance
    count = last if case.clamped else last + 1
    free = (masses[:count], shares[:count], weights[:, :count], springs, slips[:, :count], dashpots, brakes[:count])
    return _Chain(*free, np.zeros(count) if case.clamped else far)


def _parts(model: ShaftModel) -> tuple[Array, Array, Array, Array, Array] | None:
    """Shares of inertia and of length, weights of springs; lengths and weights of dashpots. None where too many."""
    if isinstance(model, Rigid):
        return np.ones(1), np.ones(0), np.zeros((0, 1)), np.ones(0), np.zeros((0, 1))
    if isinstance(model, OneSpring):
        across = np.array([[1.0, -1.0]])
        return np.zeros(2), np.ones(1), across, np.ones(1), across
    mesh = model.mesh()
    count = len(mesh.nodes)
    if count > MOST_PREDICTED:
        return None
    weights = np.zeros((len(mesh.lengths), count))
    for k, row in enumerate(mesh.weights):
        for j, weight in row:
            weights[k, j] += weight
    shares, lengths, gaps = (np.array(part) / mesh.intervals for part in (mesh.inertias, mesh.lengths, mesh.dampers))
    if not gaps.size:
        return shares, lengths, weights, lengths, weights
    return shares, lengths, weights, gaps, np.eye(count - 1, count) - np.eye(count - 1, count, 1)


def _in_energy_coordinates(chain: _Chain) -> tuple[Array, Array]:
    """Matrix and drive of y' = matrix y + drive torque, y = (sqrt(mass) speed, torque / sqrt(stiffness))."""
    root = np.sqrt(chain.masses)
    joints = np.sqrt(chain.springs)[:, None] * chain.twists / root
    losses = (chain.slips.T * chain.dashpots) @ chain.slips / np.outer(root, root) + np.diag(
        chain.brakes / chain.masses
    )
    matrix = np.block([[-losses, -joints.T], [joints, np.zeros((len(joints), len(joints)))]])
    drive = np.zeros(len(matrix))
    drive[0] = 1 / root[0]
    return matrix, drive


def _propagated(case: Case, matrix: Array, drive: Array) -> Array:
    """States (k, 2 n + 3) at the times of a case: y, y', and three that make the torque: its value, sine, and one.

    y' obeys the same equation as y. Taken from y it would have the errors of y times the fastest decay.
    """
    size, rise = len(drive), case.rise * case.delay
    rates, torque = slice(size, 2 * size), 2 * size
    whole = np.zeros((torque + 3, torque + 3))
    whole[:size, rates], whole[rates, rates] = np.eye(size), matrix
    if case.form == "sine":
        whole[torque, torque + 1] = whole[torque + 1, torque + 2] = 2 * np.pi / rise
        whole[torque + 1, torque] = -2 * np.pi / rise
    if case.form == "ramp":
        whole[torque, torque + 2] = 1 / rise
    whole[rates, torque:] = np.outer(TORQUE * drive, whole[torque, torque:])
    state = np.zeros(torque + 3)
    state[torque], state[torque + 2] = float(case.form in ("step", "pulse")), 1.0
    state[rates] = TORQUE * drive * state[torque]
    jumps = (rise,) if case.form in ("pulse", "ramp") and rise < case.t_end else ()
    propagators: dict[str, Array] = {}
    states = {}
    for start, end in pairwise(sorted({0.0, *case.times, *jumps})):
        key = f"{end - start:.9e}"  # equal intervals differ by the rounding of their ends
        if key not in propagators:
            propagators[key] = expm(whole * (end - start))
        state = propagators[key] @ state
        if end in jumps:
            before, state[torque] = state[torque], float(case.form == "ramp")
            state[rates] += TORQUE * drive * (state[torque] - before)
            whole[: torque + 1, torque + 2] = 0.0
            propagators.clear()
        states[end] = state
    return np.array([states[time] for time in case.times])
