"""A motion replayed from what its solution shows: Newton at every node, and the law of every part in its mode.

Each law is written here once more, in the speeds, twists, torques and mode words that a user reads from the solution.
Nothing is shared with the equations that were solved, nor with the guards that end phases. Nothing follows from an
energy balance either: torques that are wrong in pairs, or a stop that is booked as a loss, close it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import cached_property

import numpy as np
import sympy

import shaftwork as sw
from shaftwork import Solution
from tests.properties.examples import Array
from tests.trains import GROUND, Part

# Dense output between steps is less exact than the steps, and a torque is a speed times stiffness over frequency.
CLOSE = 1e-6
# Momentum and twist over one step, as part of the largest: what the engines leave at rtol = 1e-9.
STEP_CLOSE = 1e-8
# Phases below this share of the run are looked at as instants: no point lies inside them beyond rounding.
INSTANT = 1e-9
# Gauss-Legendre in each step; of the Taylor series of order some 20 they leave less than STEP_CLOSE.
POINTS, WEIGHTS = np.polynomial.legendre.leggauss(8)
GRAVITY = 9.81
GIVES_TO_ITS_NODE = ("TorqueSource", "CoulombLoad", "Hoist", "SpeedSource", "KlossMotor")
PORTS = {"Gear": ("a", "b"), "LossyGear": ("a", "b"), "PlanetaryGear": ("sun", "carrier", "ring")}

Claims = Iterator[tuple[str, Array]]
"""What a law claims, and by how much it fails at each point: above zero it does."""


class Readings(dict[str, Array]):
    """What a solution shows at its times, read once.

    Args:
        sol: the solution.
    """

    def __init__(self, sol: Solution) -> None:
        super().__init__()
        self._sol, self.size = sol, sol.t.size

    def __missing__(self, name: str) -> Array:
        self[name] = np.asarray(self._sol[name])
        return self[name]


class Motion:
    """A motion at points inside its steps, with the integrals over them, and at the instants between them.

    Args:
        sol: its solution.
    """

    def __init__(self, sol: Solution) -> None:
        self.sol = sol
        starts = np.array([phase.start for phase in sol.phases] or [0.0])
        cuts = np.unique([*sol.steps, *starts, *(event[0] for event in sol.events)])
        long = np.diff(cuts) > INSTANT * cuts[-1]
        self.begins, self.ends = cuts[:-1][long], cuts[1:][long]
        self.length = self.ends - self.begins
        self.times = (self.begins + np.outer(POINTS + 1, self.length / 2)).T.ravel()
        self.phase = np.searchsorted(starts, (self.begins + self.ends) / 2, side="right") - 1
        sides = self.times, self.begins, np.nextafter(self.ends, 0.0)
        self.at, self.first, self.last = (Readings(sol.at(times)) for times in sides)

    def integral(self, values: Array) -> Array:
        """Over each step, of values at the points."""
        return np.asarray((values.reshape(-1, POINTS.size) @ WEIGHTS) * self.length / 2)

    def words(self, name: str) -> Array:
        """The mode of a part at the points."""
        said = np.array([phase.modes[name] for phase in self.sol.phases])
        return np.repeat(said[self.phase], POINTS.size)

    def speed(self, node: str, where: Readings | None = None) -> Array:
        """The speed of a node at the points, or at the ends of steps."""
        shown = self.at if where is None else where
        return np.zeros(shown.size) if node == GROUND else shown[f"{node}.omega"]

    def across(self, part: Part, where: Readings | None = None) -> Array:
        """The speed of its first node against its second."""
        a, b = part.ends
        return self.speed(a, where) - self.speed(b, where)

    def tau(self, part: Part) -> Array:
        """The torque that its first node gives to it."""
        shown = self.at[f"{part.name}.tau"]
        return -shown if part.type in GIVES_TO_ITS_NODE else shown

    def _largest(self, quantity: str) -> float:
        """Of a quantity over all parts and points, and at least one."""
        names = (name for name in self.sol.names if name.rpartition(".")[2].partition("_")[0] == quantity)
        return max(1.0, *(float(np.abs(self.at[name]).max()) for name in names))

    @cached_property
    def fast(self) -> float:
        """The largest speed."""
        return self._largest("omega")

    @cached_property
    def strong(self) -> float:
        """The largest torque."""
        return self._largest("tau")

    @cached_property
    def instants(self) -> tuple[Array, Array, Readings, Readings]:
        """Between steps the first and the last time of each instant, and what is shown just before and after it."""
        sol, end = self.sol, self.sol.steps[-1]
        cuts = np.unique([*(phase.start for phase in sol.phases), *(event[0] for event in sol.events), *sol.steps])
        cuts = cuts[(cuts > INSTANT * end) & (cuts < (1 - INSTANT) * end)]
        begins = np.flatnonzero(np.diff(cuts, prepend=-math.inf) > INSTANT * end)
        firsts, lasts = cuts[begins], cuts[np.append(begins[1:] - 1, cuts.size - 1)]
        return firsts, lasts, Readings(sol.at(np.nextafter(firsts, 0.0))), Readings(sol.at(lasts))

    @property
    def slow(self) -> float:
        """A speed that is as good as none."""
        return CLOSE * self.fast

    @property
    def weak(self) -> float:
        """A torque that is as good as none."""
        return CLOSE * self.strong

    def torques(self, part: Part) -> Iterator[tuple[str, Array]]:
        """What each of its nodes gives to a part that is no inertia."""
        if part.type == "Inertia":
            return
        if part.type in PORTS:
            for node, port in zip(part.nodes, PORTS[part.type], strict=True):
                yield node, self.at[f"{part.name}.tau_{port}"]
            return
        a, b = part.ends
        yield a, self.tau(part)
        yield b, -self.tau(part)


def objections(parts: tuple[Part, ...], motion: Motion) -> list[str]:
    """Every claim that the motion of some parts breaks: of what, which, when and by how much."""
    found = [*_worst(motion, "node", newton(motion, parts))]
    for part in parts:
        found += _worst(motion, f"{part.type} {part.name}", LAWS[part.type](motion, part))
    return found


def _worst(motion: Motion, of: str, claims: Claims) -> Iterator[str]:
    for claim, beyond in claims:
        if beyond.size and not beyond.max() <= 0:
            k = int(np.argmax(beyond))
            time = (motion.times if beyond.size == motion.times.size else motion.begins)[k]
            yield f"{of}: {claim}, by {beyond[k]:.3g} at {time!r} s"


def newton(motion: Motion, parts: tuple[Part, ...]) -> Claims:
    """What a node gets over a step changes its momentum; a node without inertia gets nothing at any point."""
    inertias: dict[str, float] = {}
    given: dict[str, Array] = {}
    for part in parts:
        if part.type == "Inertia":
            inertias[part.nodes[0]] = inertias.get(part.nodes[0], 0.0) + part.values["J"]
        for node, tau in motion.torques(part):
            given[node] = given.get(node, 0.0) + tau
    for node, taken in given.items():
        if node == GROUND:
            continue
        if node not in inertias:
            yield f"{node} takes a torque", np.abs(taken) - motion.weak
            continue
        J = inertias[node]
        gained = J * (motion.speed(node, motion.last) - motion.speed(node, motion.first))
        left = np.abs(gained + motion.integral(taken))
        yield f"{node} breaks Newton's law", left - motion.weak * motion.length - STEP_CLOSE * J * motion.fast


def twists(motion: Motion, part: Part, name: str) -> Claims:
    """A twist gains what the speed across it sums to."""
    signal = f"{part.name}.{name}"
    gained = motion.last[signal] - motion.first[signal]
    left = np.abs(gained - motion.integral(motion.across(part)))
    yield "the twist is not that of the nodes", left - motion.slow * motion.length - STEP_CLOSE * motion.fast


def inertia(_: Motion, __: Part) -> Claims:
    """Its law is that of its node."""
    yield from ()


def spring(motion: Motion, part: Part) -> Claims:
    """tau = c phi + d omega."""
    yield from twists(motion, part, "phi_rel")
    torque = part.values["c"] * motion.at[f"{part.name}.phi_rel"] + part.values["d"] * motion.across(part)
    yield "breaks its law", np.abs(motion.tau(part) - torque) - motion.weak


def damper(motion: Motion, part: Part) -> Claims:
    """tau = d omega."""
    yield "breaks its law", np.abs(motion.tau(part) - part.values["d"] * motion.across(part)) - motion.weak


def gear(motion: Motion, part: Part) -> Claims:
    """omega_a = ratio omega_b, tau_b = -ratio tau_a."""
    (a, tau_a), (b, tau_b) = motion.torques(part)
    ratio = part.values["ratio"]
    slow, weak = (size * max(1.0, abs(ratio)) for size in (motion.slow, motion.weak))
    yield "breaks its ratio", np.abs(motion.speed(a) - ratio * motion.speed(b)) - slow
    yield "loses torque", np.abs(tau_b + ratio * tau_a) - weak


def planetary(motion: Motion, part: Part) -> Claims:
    """omega_sun + ratio omega_ring = (1 + ratio) omega_carrier, and torques in proportion."""
    (sun, tau), (carrier, at_carrier), (ring, at_ring) = motion.torques(part)
    ratio = part.values["ratio"]
    across = motion.speed(sun) + ratio * motion.speed(ring) - (1 + ratio) * motion.speed(carrier)
    yield "breaks its ratio", np.abs(across) - (1 + ratio) * motion.slow
    yield "loses torque at the ring", np.abs(at_ring - ratio * tau) - motion.weak * (1 + ratio)
    yield "loses torque at the carrier", np.abs(at_carrier + (1 + ratio) * tau) - motion.weak * (1 + ratio)


def lossy_gear(motion: Motion, part: Part) -> Claims:
    """The share of the side that drives passes on; at rest neither side overcomes the loss."""
    (a, tau_a), (b, at_b) = motion.torques(part)
    ratio, share = part.values["ratio"], part.values["efficiency"]
    back = part.values.get("efficiency_back", share)
    words, tau_b, speed = motion.words(part.name), at_b / ratio, motion.speed(a)
    weak = motion.weak * max(1.0, 1 / abs(ratio))
    driving, driven = np.char.startswith(words, "driving"), np.char.startswith(words, "driven")
    way = np.char.endswith(words, "forward") * 1.0 - np.char.endswith(words, "backward")
    stuck = words == "stuck"
    yield "is no mode", 1.0 * ~(stuck | ((driving | driven) & (way != 0)))
    yield "breaks its ratio", np.abs(speed - ratio * motion.speed(b)) - motion.slow * max(1.0, abs(ratio))
    yield "turns the other way", -way * speed - motion.slow
    yield "drives by another torque", driving * np.abs(tau_b + share * tau_a) - weak
    yield "drives backward", driving * -way * tau_a - weak
    yield "is driven by another torque", driven * np.abs(tau_a + back * tau_b) - weak
    yield "is driven forward", driven * -way * tau_b - weak
    yield "moves", stuck * np.abs(speed)  # to the last bit
    ahead, behind = share * tau_a + tau_b, tau_a + back * tau_b
    overcome = np.where(ahead * behind > 0, np.minimum(np.abs(ahead), np.abs(behind)), 0.0)
    yield "holds more than it can", stuck * overcome - weak


def dry_friction(motion: Motion, part: Part) -> Claims:
    """Coulomb, Stribeck and viscous, with true stick."""
    values, speed = part.values, motion.across(part)
    slips = values.get("tau_c", values.get("tau"))
    holds = values.get("tau_s", slips)
    size = slips + (holds - slips) * np.exp(-((speed / values.get("omega_s", 0.1)) ** 2))
    yield from rubbing(motion, part, (size, size), values.get("d", 0.0) * speed)
    stuck = motion.words(part.name) == "stuck"
    yield "holds more than it can", stuck * (np.abs(motion.tau(part)) - holds) - motion.weak


def hoist(motion: Motion, part: Part) -> Claims:
    """A weight, and a friction that takes 1 / efficiency - 1 of it upwards and 1 - efficiency downwards."""
    values, tau = part.values, motion.tau(part)
    weight, share = values["m"] * GRAVITY * values["radius"] / values["ratio"], values["efficiency"]
    if share == 1.0:
        yield "breaks its law", np.abs(tau - weight) - motion.weak
        return
    up, down = (1 / share - 1) * weight, (1 - share) * weight
    yield from rubbing(motion, part, (up, down), weight)
    stuck = motion.words(part.name) == "stuck"
    yield "holds more than it can", stuck * np.maximum(tau - weight - up, weight - down - tau) - motion.weak


def rubbing(
    motion: Motion, part: Part, sizes: tuple[float | Array, float | Array], besides: float | Array = 0.0
) -> Claims:
    """Torques against the motion forward and backward, beside another one; held it does not move at all."""
    words, speed, tau = motion.words(part.name), motion.across(part), motion.tau(part) - besides
    forward, backward = np.char.endswith(words, "forward"), np.char.endswith(words, "backward")
    held, apart = np.isin(words, ("stuck", "locked", "engaged")), np.isin(words, ("released", "open"))
    yield "is no mode", 1.0 * ~(forward | backward | held | apart)
    yield "slips backward", forward * -speed - motion.slow
    yield "slips forward", backward * speed - motion.slow
    yield "rubs by another torque", forward * np.abs(tau - sizes[0]) - motion.weak
    yield "rubs by another torque", backward * np.abs(tau + sizes[1]) - motion.weak
    yield "moves", held * np.abs(speed)  # to the last bit


def brake(motion: Motion, part: Part) -> Claims:
    """Dry friction of a torque over time, from when it acts."""
    values, words, tau = part.values, motion.words(part.name), motion.tau(part)
    begins, ends = values.get("t_on", 0.0), values.get("t_off", math.inf)
    after = np.maximum(motion.times - begins, 0.0)
    rises = np.minimum(1.0, after / values["t_rise"]) if "t_rise" in values else np.ones(after.size)
    size = values["tau"] * (1.0 - np.exp(-after / values["t_lag"]) if "t_lag" in values else rises)
    yield from rubbing(motion, part, (size, size))
    held, apart = np.isin(words, ("locked", "engaged")), np.isin(words, ("released", "open"))
    yield "holds more than it can", held * (np.abs(tau) - size) - motion.weak
    yield "has a torque", apart * np.abs(tau)
    clear = np.minimum(np.abs(motion.times - begins), np.abs(motion.times - ends)) > INSTANT
    acts = (motion.times > begins) & (motion.times < ends)
    if "on" in values:
        if f"{part.name}.phi" in motion.sol.names:
            yield from twists(motion, part, "phi")
        law, waits = _law(motion, part, values["on"]), np.logical_and.accumulate(apart) & acts
        yield "does not act", waits * law - max(motion.slow, CLOSE)
        acts &= ~waits
    yield "does not act", 1.0 * (clear & acts & apart)
    yield "acts", 1.0 * (clear & ~acts & ~apart)


def freewheel(motion: Motion, part: Part) -> Claims:
    """It holds a back from turning faster than b."""
    locked, speed, tau = motion.words(part.name) == "locked", motion.across(part), motion.tau(part)
    yield "is no mode", 1.0 * ~np.isin(motion.words(part.name), ("locked", "free"))
    yield "overruns", ~locked * speed - motion.slow
    yield "has a torque", ~locked * np.abs(tau)
    yield "moves", locked * np.abs(speed)
    yield "pulls", locked * -tau - motion.weak


def limits(part: Part) -> tuple[float, float]:
    """The twists between which a contact is open."""
    half = part.values.get("gap", math.inf) / 2
    return part.values.get("lower", -half), part.values.get("upper", half)


def contact(motion: Motion, part: Part) -> Claims:
    """Flanks beyond limits of the twist, rigid or with a stiffness; they never pull."""
    yield from twists(motion, part, "phi")
    words, tau = motion.words(part.name), motion.tau(part)
    is_open, ahead, behind = (words == word for word in ("open", "in contact", "in contact backward"))
    yield "is no mode", 1.0 * ~(is_open | ahead | behind)
    yield "has a torque", is_open * np.abs(tau)
    yield "pulls", np.where(ahead, -tau, np.where(behind, tau, 0.0)) - motion.weak
    lower, upper = limits(part)
    twist = motion.at[f"{part.name}.phi"]
    for closed, way, limit in ((ahead, 1.0, upper), (behind, -1.0, lower)):
        if math.isinf(limit):
            yield "is no mode", 1.0 * closed
            continue
        beyond = way * (twist - limit)
        if part.is_rigid:
            yield "is beyond its limit", beyond - CLOSE
            yield "is off its limit", closed * np.abs(beyond) - CLOSE
            yield "moves", closed * np.abs(motion.across(part))
            continue
        springs = part.values["c"] * beyond + part.values.get("d", 0.0) * way * motion.across(part)
        yield "breaks its law", closed * np.abs(way * tau - springs) - motion.weak
        yield "does not touch", closed * -beyond - CLOSE
        # beyond its limit it is open only while its flanks part faster than they spring back
        yield "has missed a contact", is_open * np.where(beyond > CLOSE, springs, 0.0) - motion.weak


def torque_source(motion: Motion, part: Part) -> Claims:
    """A torque over time."""
    yield "gives another torque", np.abs(_law(motion, part, part.values["tau"]) + motion.tau(part)) - motion.weak


def speed_source(motion: Motion, part: Part) -> Claims:
    """A speed over time."""
    yield "has another speed", np.abs(_law(motion, part, part.values["omega"]) - motion.across(part)) - motion.slow


def kloss_motor(motion: Motion, part: Part) -> Claims:
    """Kloss' torque of the slip, through a gear without loss."""
    values = part.values
    slip = 1 - values["ratio"] * motion.across(part) / (2 * math.pi * values["n_sync"] / 60)
    torque = values["ratio"] * 2 * values["tau_k"] / (slip / values["s_k"] + values["s_k"] / slip)
    yield "gives another torque", np.abs(torque + motion.tau(part)) - motion.weak


def _law(motion: Motion, part: Part, law: object) -> Array:
    """A law of time, or of the speed and the angle of a part."""
    read = sympy.lambdify((sw.t, sw.omega, sw.phi), sympy.sympify(law), "numpy")
    twist = motion.at[f"{part.name}.phi"] if f"{part.name}.phi" in motion.sol.names else 0.0
    return np.broadcast_to(np.asarray(read(motion.times, motion.across(part), twist), dtype=float), motion.times.shape)


LAWS: dict[str, Callable[[Motion, Part], Claims]] = {
    "Inertia": inertia,
    "Spring": spring,
    "Damper": damper,
    "Gear": gear,
    "PlanetaryGear": planetary,
    "LossyGear": lossy_gear,
    "DryFriction": dry_friction,
    "CoulombLoad": dry_friction,
    "Hoist": hoist,
    "Brake": brake,
    "Clutch": brake,
    "Freewheel": freewheel,
    "Backlash": contact,
    "HardStop": contact,
    "TorqueSource": torque_source,
    "SpeedSource": speed_source,
    "KlossMotor": kloss_motor,
}
