"""Motions of trains with parts that switch, by matrix exponentials from event to event.

Nothing here is the library's. Between events the equations are linear with constant coefficients, as sources are
constants, ramps, steps and sines, so a matrix exponential is their solution. At an event every combination of modes of
what is at rest is tried, and one is taken that contradicts nothing. Laws:

- friction, brake, clutch: up to tau at rest, tau against the motion while they slip;
- freewheel: omega_a <= omega_b, and no pull;
- rigid contact: no twist beyond its limits, and no pull; an impact takes the speeds to the nearest ones, by kinetic
  energy, at which nothing closes; then what is hit gives back e of its impulse, and again nothing closes (Poisson);
- soft contact: tau = c x + d v beyond its limit x = 0 while that is no pull, and none else.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import brentq

Array = NDArray[np.float64]
Modes = dict[int, str]
"""The mode of each joint that has some."""
REST = 1e-9
"""At an event, a speed below this part of the largest, or of one, is rounding of zero."""
SLACK = 1e-10
"""So much of their size torques and accelerations may contradict a mode: rounding."""
AT_ONCE = 1e-8
"""Impacts of two contacts within this time, s, are one, of which Newton's law does not tell the outcome."""
TOUCHES = 1e-13
"""A contact within this twist of its limit, rad, touches; up to `REST` rounding may tell whether it does."""
MOST_EVENTS = 500
FIRSTS = {"spring": "", "soft": "open", "rigid": "open", "friction": "off", "freewheel": "free"}
"""The modes before anything is known."""


class UndecidedError(Exception):
    """Several rigid contacts or freewheels are hit at once, or rounding alone decides again and again."""


@dataclass(frozen=True)
class Joint:
    """What joins two inertias, or one and the frame.

    Args:
        kind: a key of `FIRSTS`.
        a, b: numbers of its inertias, -1 for the frame.
        c, d: stiffness and damping.
        limits: of the twist of a contact, lower and upper.
        tau: what a friction holds, and its torque while it slips.
        times: from when to when a friction acts, s.
        restitution, rest: of a rigid contact, and the speed below which nothing is thrown back.
        ratio, efficiency, back: of a gear, see `shaftwork.LossyGear`; matrix exponentials follow none.
    """

    kind: str
    a: int
    b: int = -1
    c: float = 0.0
    d: float = 0.0
    limits: tuple[float, float] = (-math.inf, math.inf)
    tau: float = 0.0
    times: tuple[float, float] = (-math.inf, math.inf)
    restitution: float = 0.0
    rest: float = 0.0
    ratio: float = 1.0
    efficiency: float = 1.0
    back: float = 1.0


@dataclass(frozen=True)
class Source:
    """A torque on an inertia: constant + slope t + size sin(rate t), between two times, s."""

    a: int
    constant: float = 0.0
    slope: float = 0.0
    size: float = 0.0
    rate: float = 1.0
    times: tuple[float, float] = (-math.inf, math.inf)


@dataclass(frozen=True)
class Train:
    """Inertias with their speeds at the start, joints and sources; it moves up to t_end, s."""

    inertias: tuple[float, ...]
    speeds: tuple[float, ...]
    joints: tuple[Joint, ...]
    sources: tuple[Source, ...]
    t_end: float


class Motion:
    """One motion of a train. Its states are speeds, twists, sine and cosine of each source, the time, and one.

    Args:
        train: what moves.
    """

    def __init__(self, train: Train) -> None:
        self.train, self.n, self.J = train, len(train.inertias), np.array(train.inertias)
        twisted = [k for k, joint in enumerate(train.joints) if joint.kind in ("spring", "soft", "rigid")]
        self.sines = [source for source in train.sources if source.size]
        first = self.n + len(twisted)
        self.place = {k: self.n + i for i, k in enumerate(twisted)}
        self.sine = {source: first + 2 * i for i, source in enumerate(self.sines)}
        self.clock = first + 2 * len(self.sines)
        self.size = self.clock + 2
        self.rows = np.zeros((len(train.joints), self.n))
        for k, joint in enumerate(train.joints):
            self.rows[k, joint.a] += 1.0
            if joint.b >= 0:
                self.rows[k, joint.b] -= 1.0
        times = {t for thing in (*train.joints, *train.sources) for t in thing.times}
        self.instants = sorted(t for t in times if 0 < t < train.t_end)
        self.one = np.eye(self.size)[-1]
        self.events: list[tuple[float, int, str]] = []
        self._touching: Modes = {}
        self._last_hit = -math.inf, -1

    def end(self) -> Array:
        """(n,) the speeds at the end.

        Raises:
            UndecidedError: what follows is a matter of definition, or of rounding.
        """
        t, z = 0.0, np.zeros(self.size)
        z[: self.n], z[-1] = self.train.speeds, 1.0
        z[[place + 1 for place in self.sine.values()]] = 1.0
        modes = {k: FIRSTS[joint.kind] for k, joint in enumerate(self.train.joints) if FIRSTS[joint.kind]}
        freewheels = [k for k, joint in enumerate(self.train.joints) if joint.kind == "freewheel"]
        if sum(self.rows[k] @ z[: self.n] > 0 for k in freewheels) > 1:
            raise UndecidedError
        z, met = self._after_impact(z, modes, None, {}), None
        for _ in range(MOST_EVENTS):
            z, new = self._settled(t, z, modes, met)
            self.events += [(t, k, new[k]) for k in new if new[k] != modes[k]]
            modes = new
            until = min((instant for instant in self.instants if instant > t + 1e-12), default=self.train.t_end)
            t, z, met = self._advanced(t, z, modes, until)
            if met is None and t >= self.train.t_end:
                return z[: self.n]
            if met is not None and self.train.joints[met].kind == "rigid" and modes[met] == "open":
                z, modes, met = self._hit(t, z, modes, met)
        raise UndecidedError

    def _speed(self, k: int) -> Array:
        """The speed across a joint as a linear function of the states."""
        return np.append(self.rows[k], np.zeros(self.size - self.n))

    def _beyond(self, k: int, side: str) -> Array:
        """How far a twist is beyond its upper or lower limit, as a linear function of the states."""
        lower, upper = self.train.joints[k].limits
        twist = np.eye(self.size)[self.place[k]]
        return twist - upper * self.one if side == "up" else lower * self.one - twist

    def _pull(self, k: int, side: str) -> Array:
        """What a soft contact presses with beyond its limit, as a linear function of the states."""
        joint, way = self.train.joints[k], 1.0 if side == "up" else -1.0
        return joint.c * self._beyond(k, side) + joint.d * way * self._speed(k)

    def _torques(self, t: float, modes: Modes) -> Array:
        """(n, size) the torques on the inertias, without those of what is joined."""
        F = np.zeros((self.n, self.size))
        for k, joint in enumerate(self.train.joints):
            mode = modes.get(k, "")
            if joint.kind == "spring":
                F -= np.outer(self.rows[k], joint.c * np.eye(self.size)[self.place[k]] + joint.d * self._speed(k))
            if joint.kind == "soft" and mode in ("up", "down"):
                F -= np.outer(self.rows[k], self._pull(k, mode) * (1.0 if mode == "up" else -1.0))
            if mode in ("forward", "backward"):
                F -= np.outer(self.rows[k], joint.tau * (1.0 if mode == "forward" else -1.0) * self.one)
        for source in self.train.sources:
            if source.times[0] <= t < source.times[1]:
                F[source.a] += source.constant * self.one
                F[source.a, self.clock] += source.slope
                if source.size:
                    F[source.a, self.sine[source]] += source.size
        return F

    def _equations(self, t: float, modes: Modes) -> tuple[Array, dict[int, Array]]:
        """The matrix of the rates of the states; of each joint that holds, what it takes from its first end."""
        F = self._torques(t, modes)
        held = [k for k, mode in modes.items() if mode in ("stuck", "locked")]
        held += [k for k, mode in modes.items() if mode in ("up", "down") and self.train.joints[k].kind == "rigid"]
        C = self.rows[held]
        taken = self._inverse(C) @ (C / self.J @ F)
        A = np.zeros((self.size, self.size))
        A[: self.n] = (F - C.T @ taken) / self.J[:, None]
        for k, place in self.place.items():
            A[place, : self.n] = self.rows[k]
        for source, place in self.sine.items():
            A[place, place + 1], A[place + 1, place] = source.rate, -source.rate
        A[self.clock, -1] = 1.0
        return A, dict(zip(held, taken, strict=True))

    def _inverse(self, C: Array) -> Array:
        """Of the mobility across joints; where they depend on each other the least reactions are taken."""
        return np.linalg.pinv(C / self.J @ C.T, rcond=1e-11, hermitian=True) if len(C) else np.zeros((0, 0))

    def _nearest(self, w: Array, closing: Sequence[tuple[int, float]]) -> tuple[Array, dict[int, float]]:
        """(n,) the nearest speeds with side * speed <= 0 across joints, and the impulses that lead there."""
        tolerance = 1e-12 * max(1.0, np.abs(w).max())
        for chosen in itertools.chain.from_iterable(
            itertools.combinations(closing, m) for m in range(len(closing) + 1)
        ):
            C = self.rows[[k for k, _ in chosen]]
            impulses = self._inverse(C) @ (C @ w)
            new = w - C.T @ impulses / self.J
            pressed = zip(impulses, chosen, strict=True)
            if all(side * impulse >= -tolerance for impulse, (_, side) in pressed) and all(
                side * (self.rows[k] @ new) <= tolerance for k, side in closing
            ):
                return new, {k: float(impulse) for impulse, (k, _) in zip(impulses, chosen, strict=True)}
        raise AssertionError("no impulse is consistent")

    def _after_impact(self, z: Array, modes: Modes, hit: int | None, touching: Mapping[int, float]) -> Array:
        """The states after what closes has met, and what is hit has given back its share of the impulse (Poisson).

        Args:
            z: states.
            modes: with what is hit closed.
            hit: the contact that is hit; None at the start.
            touching: other contacts that take part although they are open, with their sides.
        """
        w, z, ways = z[: self.n].copy(), z.copy(), {"up": 1.0, "down": -1.0}
        closing = [*touching.items()]
        for k, joint in enumerate(self.train.joints):
            if joint.kind == "freewheel":
                closing.append((k, 1.0))
            elif joint.kind == "rigid" and modes[k] in ways:
                closing.append((k, ways[modes[k]]))
        new, impulses = self._nearest(w, closing)
        if hit is not None:
            joint = self.train.joints[hit]
            if joint.restitution * abs(self.rows[hit] @ w) > joint.rest:
                back = joint.restitution * impulses.get(hit, 0.0) * self.rows[hit] / self.J
                new, _ = self._nearest(new - back, closing)
        z[: self.n] = new
        return z

    def _hit(self, t: float, z: Array, modes: Modes, k: int) -> tuple[Array, Modes, int | None]:
        """After the impact of a contact: states, modes, and the contact where it stays closed."""
        touching = {}
        for other, both in ((o, joint.limits) for o, joint in enumerate(self.train.joints) if joint.kind == "rigid"):
            apart = np.abs(z[self.place[other]] - np.array(both))
            if other != k and modes[other] == "open" and apart.min() < REST:
                if apart.min() > TOUCHES:
                    raise UndecidedError
                touching[other] = 1.0 if apart.argmin() else -1.0
        when, other = self._last_hit
        if t - when < AT_ONCE and other != k:
            raise UndecidedError
        if any(self.train.joints[other].restitution for other in touching):
            raise UndecidedError
        self._last_hit = t, k
        joint = self.train.joints[k]
        side = "up" if self._beyond(k, "up") @ z > self._beyond(k, "down") @ z else "down"
        z[self.place[k]] = joint.limits[side == "up"]
        z = self._after_impact(z, {**modes, k: side}, k, touching)
        if abs(self.rows[k] @ z[: self.n]) > REST * max(1.0, np.abs(z[: self.n]).max()):
            self.events.append((t, k, "rebound"))
            return z, modes, None
        return z, {**modes, k: side}, k

    def _settled(self, t: float, z: Array, modes: Modes, met: int | None) -> tuple[Array, Modes]:
        """The states, with no speed across what is at rest, and modes that contradict nothing."""
        scale = max(1.0, np.abs(z[: self.n]).max())
        options: dict[int, tuple[str, ...]] = {}
        for k, mode in modes.items():
            v = float(self.rows[k] @ z[: self.n])
            options[k] = self._options(t, k, mode, 0.0 if abs(v) < REST * scale or k == met else v)
            if self.train.joints[k].kind == "soft":
                options[k] = (self._soft(k, z, mode, met=k == met),)
        resting = [k for k, names in options.items() if len(names) > 1]
        self._touching = {k: modes[k] for k in resting if modes[k] in ("up", "down")}
        C, z = self.rows[resting], z.copy()
        z[: self.n] -= C.T @ (self._inverse(C) @ (C @ z[: self.n])) / self.J
        for chosen in itertools.product(*options.values()):
            made = dict(zip(options, chosen, strict=True))
            if self._agrees(t, z, made, resting):
                return z, made
        raise AssertionError(f"no modes agree at {t}: {options}")

    def _options(self, t: float, k: int, mode: str, speed: float) -> tuple[str, ...]:
        """The modes that a joint may have with a speed across it."""
        joint = self.train.joints[k]
        if joint.kind == "friction":
            if not joint.times[0] <= t < joint.times[1]:
                return ("off",)
            return ("forward",) if speed > 0 else ("backward",) if speed < 0 else ("stuck", "forward", "backward")
        if joint.kind == "freewheel":
            return ("free",) if speed else ("locked", "free")
        return ("open",) if speed or mode == "open" else (mode, "open")

    def _soft(self, k: int, z: Array, before: str, *, met: bool) -> str:
        """The mode of a soft contact: up, down, open, or beyond its limit without a torque."""
        side = (
            "up"
            if "up" in before or (before == "open" and self._beyond(k, "up") @ z > self._beyond(k, "down") @ z)
            else "down"
        )
        beyond, presses = float(self._beyond(k, side) @ z), float(self._pull(k, side) @ z) > 0
        if before == "open":
            return side if met else "open"
        if met:
            presses, beyond = "relaxing" in before and beyond > 1e-12, beyond - 1e-12
        return "open" if beyond <= 0 else side if presses else f"relaxing {side}"

    def _agrees(self, t: float, z: Array, modes: Modes, resting: Iterable[int]) -> bool:
        """Whether torques and accelerations, and where they say nothing their rates, are those of the modes."""
        A, taken = self._equations(t, modes)
        one_way = any(self.train.joints[k].kind in RIGID for k in taken)
        if one_way and np.linalg.matrix_rank(self.rows[list(taken)], tol=REST) < len(taken):
            return False  # a contact that others relieve of its load carries none
        course = [z, A @ z, A @ (A @ z), A @ (A @ (A @ z))]
        F = self._torques(t, modes)
        sizes = [float(np.abs(F @ at).max()) + 1.0 for at in course]
        for k in resting:
            by_torque = k in taken
            for row in self._limits(k, modes[k], taken):
                for order in range(0 if by_torque else 1, 4):
                    size = sizes[order] if by_torque else sizes[order - 1] / self.J.min()
                    value = float(row @ course[order]) / size
                    if value > SLACK:
                        return False
                    if value < -SLACK:
                        break
        return True

    def _limits(self, k: int, mode: str, taken: Mapping[int, Array]) -> list[Array]:
        """Linear functions of the states that must not rise above zero in a mode of what is at rest or slips."""
        speed, limit = self._speed(k), self.train.joints[k].tau * self.one
        if mode == "stuck":
            return [taken[k] - limit, -taken[k] - limit]
        if mode in ("locked", "up"):
            return [-taken[k]]
        if mode == "down":
            return [taken[k]]
        return [-speed if mode == "forward" or self._touching.get(k) == "down" else speed]

    def _guards(self, modes: Modes, taken: Mapping[int, Array]) -> list[tuple[int, Array]]:
        """Joint and linear function of the states that rises through zero where its mode ends."""
        found: list[tuple[int, Array]] = []
        spanned = self.rows[list(taken)]
        for k, mode in modes.items():
            joint = self.train.joints[k]
            if mode in ("forward", "backward", "free", "open") and _follows(self.rows[k], spanned):
                ends = []  # others hold both of its ends
            elif joint.kind == "soft" and mode != "open":
                side = mode.removeprefix("relaxing ")
                ends = [self._pull(k, side), -self._beyond(k, side)] if side != mode else [-self._pull(k, side)]
            elif joint.kind in ("soft", "rigid") and mode == "open":
                limits = zip(("down", "up"), joint.limits, strict=True)
                ends = [self._beyond(k, side) for side, limit in limits if math.isfinite(limit)]
            else:
                ends = [] if mode == "off" else self._limits(k, mode, taken)
            found += [(k, end) for end in ends]
        return found

    def _advanced(self, t: float, z: Array, modes: Modes, until: float) -> tuple[float, Array, int | None]:
        """Time, states and joint where the first guard is met, or at a time."""
        A, taken = self._equations(t, modes)
        guards = self._guards(modes, taken)
        G = np.array([row for _, row in guards]).reshape(-1, self.size)
        longest = min(0.3 / max(np.abs(np.linalg.eigvals(A)).max(), 1e-6), (until - t) / 4)
        slope, now, step = G @ A, t, longest * 2.0**-24
        # a guard that starts at its limit or beyond has to come down before it can be met, within a short first step
        noise = 1e-13 * (np.abs(G) @ np.abs(z))
        armed, made = G @ z < -noise, (0.0, np.eye(self.size))
        while now < until:
            h = min(step, until - now)
            made = made if made[0] == h else (h, expm(A * h))
            late = made[1] @ z
            before, after, found = G @ z, G @ late, list[tuple[float, int]]()
            for i, (k, _) in enumerate(guards):
                if not armed[i]:
                    armed[i] = after[i] < -noise[i]
                    rises = after[i] > 1e-13 and slope[i] @ late > 0
                    if rises and (self.train.joints[k].kind == "soft" or modes[k] == "open"):
                        return now, z, k  # it was on its limit, by rounding
                    assert after[i] < SLACK or now - t < 1e-3 * longest, (k, modes[k], t, now, before[i], after[i])
                    continue
                ends = h
                if after[i] <= 0:
                    if not slope[i] @ z > 0 > slope[i] @ late:
                        continue
                    ends = _zero(A, -slope[i], z, h)
                    if G[i] @ (expm(A * ends) @ z) <= 0:
                        continue
                found.append((_zero(A, G[i], z, ends), i))
            if found:
                share, i = min(found)
                return now + share, expm(A * share) @ z, guards[i][0]
            z, now, step = late, (until if h == until - now else now + h), min(2 * step, longest)
        return until, z, None


RIGID = ("rigid", "freewheel")


def _follows(row: Array, others: Array) -> bool:
    """Whether a speed follows from others."""
    if not len(others):
        return False
    return bool(np.linalg.norm(row - others.T @ np.linalg.lstsq(others.T, row, rcond=None)[0]) < REST)


def _zero(A: Array, row: Array, z: Array, end: float) -> float:
    """Where a linear function of the states rises through zero, between now and an end."""

    def value(s: float) -> float:
        return float(row @ (expm(A * s) @ z))

    return 0.0 if value(0.0) >= 0 else end if value(end) <= 0 else float(brentq(value, 0.0, end, xtol=1e-15))
