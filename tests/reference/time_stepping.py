"""Motions of trains with parts that switch, by Moreau's time stepping: no event is located, and no mode is followed.

Nothing here is the library's. Each step asks for speeds at its end and for impulses over it that go with all laws at
once: what sticks, presses, jams or is hit in a step is the solution of one problem. The error is of the first order in
the step, and is estimated by halving it. Laws, with w the speed across a joint at the end of a step and P its impulse:

- friction: |P| <= tau h, and P = tau h sign(w) where it slips;
- freewheel: w <= 0, P >= 0, P w = 0;
- rigid contact within its gap: nothing; beyond it w <= -e w_before, P >= 0, complementary;
- soft contact: P = h max(0, c x + d w);
- gear: omega_a = ratio omega_b; impulses by the direction of the power, or both sides held.

Source: Acary and Brogliato, Numerical Methods for Nonsmooth Dynamical Systems, 2008, chapter 10.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence

import numpy as np

from tests.reference.hybrid_train import Array, Joint, Source, Train

GEAR = ("driving forward", "driving backward", "driven forward", "driven backward", "stuck")
"""The modes of a gear, in the order in which they are tried: a jam is the last way."""
TINY = 1e-11
"""A part of the largest speed or impulse that is rounding."""


class NoSolutionError(Exception):
    """No combination of what sticks, presses and jams is consistent."""


class Stepper:
    """Steps of one size through the motion of a train.

    Args:
        train: what moves.
        steps: how many.
    """

    def __init__(self, train: Train, steps: int) -> None:
        self.train, self.steps, self.h = train, steps, train.t_end / steps
        self.n, joints = len(train.inertias), train.joints
        self.gears = [joint for joint in joints if joint.kind == "gear"]
        self.springs = [joint for joint in joints if joint.kind == "spring"]
        self.switching = [joint for joint in joints if joint.kind not in ("gear", "spring")]
        self.J, self.v = np.array(train.inertias), np.array(train.speeds)
        self.S, self.R = self._rows(self.springs), self._rows(self.switching)
        self.c, self.d = (np.array([getattr(joint, name) for joint in self.springs]) for name in "cd")
        self.twists, self.gaps = np.zeros(len(self.springs)), np.zeros(len(self.switching))
        middle = self.h / 2
        damping = self.S.T * (self.d * middle + self.c * middle**2) @ self.S
        self.mass = np.diag(self.J) + damping
        self._answers: dict[tuple[str, ...], tuple[Array, Array]] = {}
        ways = {0.0: "stuck", 1.0: "driving forward", -1.0: "driving backward"}
        self.modes = tuple(ways[float(np.sign(self.v[joint.a]))] for joint in self.gears)
        self.active = [0] * len(self.switching)
        self.jams = 0

    def _rows(self, joints: Sequence[Joint]) -> Array:
        rows = np.zeros((len(joints), self.n))
        for row, joint in zip(rows, joints, strict=True):
            row[joint.a] += 1.0
            if joint.b >= 0:
                row[joint.b] -= 1.0
        return rows

    def end(self) -> Array:
        """(n,) the speeds at the end."""
        for k in range(self.steps):
            self._step(k * self.h + self.h / 2)
        return self.v

    def _step(self, t: float) -> None:
        h, before = self.h, self.v
        stretched = self.c * (self.twists + h / 2 * (self.S @ before)) + self.d * (self.S @ before)
        half = self.S.T @ (self.c * h / 2 * (self.S @ before) / 2 * 0 + stretched)
        # implicit midpoint: x + h (v + v') / 4 and (v + v') / 2 in springs
        pull = self.S.T @ (self.c * (self.twists + h / 4 * (self.S @ before)) + self.d / 2 * (self.S @ before))
        del half
        gained = self.J * before - h * pull
        for source in self.train.sources:
            gained[source.a] += h * torque(source, t)
        laws = [self._law(k, t, before) for k in range(len(self.switching))]
        moving = [mode for mode in itertools.product(GEAR, repeat=len(self.gears)) if mode != self.modes]
        for modes in (self.modes, *sorted(moving, key=lambda names: names.count("stuck"))):
            found = self._solved(modes, gained, laws)
            if found is not None:
                self.modes, (v, self.active) = modes, found
                break
        else:
            raise NoSolutionError(t)
        self.twists += h * (self.S @ (before + v)) / 2
        self.gaps += h * (self.R @ (before + v)) / 2
        self.v = v

    def _law(self, k: int, t: float, before: Array) -> tuple[float, float, float, float]:
        """Bounds of the impulse, speed up to which it has none, and compliance: w = speed + compliance P in between."""
        joint, h = self.switching[k], self.h
        w = float(self.R[k] @ before)
        x = self.gaps[k] + h / 2 * w
        lower, upper = joint.limits
        match joint.kind:
            case "friction":
                most = joint.tau * h if joint.times[0] <= t < joint.times[1] else 0.0
                return -most, most, 0.0, 0.0
            case "freewheel":
                return 0.0, math.inf, 0.0, 0.0
        side = 1.0 if x > upper else -1.0 if x < lower else 0.0
        bounds = {1.0: (0.0, math.inf), -1.0: (-math.inf, 0.0), 0.0: (0.0, 0.0)}[side]
        if joint.kind == "soft":
            beyond = self.gaps[k] - (upper if side > 0 else lower)
            slope = joint.c * h / 2 + joint.d
            return (*bounds, -joint.c * beyond / slope, 1 / (h * slope)) if side else (0.0, 0.0, 0.0, 0.0)
        back = joint.restitution * w if side * w > 0 and joint.restitution * abs(w) > joint.rest else 0.0
        return *bounds, -back, 0.0

    def _answer(self, modes: tuple[str, ...]) -> tuple[Array, Array]:
        """From momenta (n,) to speeds, then multipliers of the gears, and the same from impulses."""
        if modes not in self._answers:
            H, G = [], []
            for joint, mode in zip(self.gears, modes, strict=True):
                a, b = np.eye(self.n)[[joint.a, joint.b]]
                if mode == "stuck":
                    H += [a, b]
                    G += [a, b]
                    continue
                drives = mode.startswith("driving")
                H.append(a - joint.ratio * joint.efficiency * b if drives else joint.back * a - joint.ratio * b)
                G.append(a - joint.ratio * b)
            size = len(H)
            whole = np.zeros((self.n + size, self.n + size))
            whole[: self.n, : self.n] = self.mass
            if size:
                whole[: self.n, self.n :], whole[self.n :, : self.n] = np.array(H).T, np.array(G)
            inverse = np.linalg.inv(whole)[:, : self.n]
            self._answers[modes] = inverse, inverse @ self.R.T
        return self._answers[modes]

    def _solved(
        self, modes: tuple[str, ...], gained: Array, laws: Sequence[tuple[float, float, float, float]]
    ) -> tuple[Array, list[int]] | None:
        """Speeds at the end of the step in some modes of gears, with what is at which bound; None where none agree."""
        inverse, by_impulses = self._answer(modes)
        free = inverse @ gained
        W, w0 = self.R @ by_impulses[: self.n], self.R @ free[: self.n]
        for active in self._guesses(W, w0, laws):
            P = self._impulses(W, w0, laws, active)
            whole = free - by_impulses @ P
            if self._agree(modes, whole, gained, P):
                return whole[: self.n], active
        return None

    def _guesses(self, W: Array, w0: Array, laws: Sequence[tuple[float, float, float, float]]) -> Iterator[list[int]]:
        """What may be at its lower bound (-1), at its upper one (1), or between them (0)."""
        lower, upper, speed, compliance = np.array(laws).reshape(-1, 4).T
        scale = max(1.0, np.abs(w0).max(initial=0.0))
        active = [
            s if math.isfinite((*b, 0.0)[1 if s > 0 else 0]) else 0 for s, b in zip(self.active, laws, strict=True)
        ]
        seen = set[tuple[int, ...]]()
        size = np.abs(W).max(initial=1e-30)
        for attempt in range(50 * (len(laws) + 1)):
            P = self._impulses(W, w0, laws, active)
            w = w0 - W @ P - speed - compliance * P
            tiny = TINY * max(scale / size, np.abs(P).max(initial=0.0))
            wrong: list[tuple[float, int, int]] = []
            for k, state in enumerate(active):
                if lower[k] == upper[k]:
                    continue
                if state == 0:
                    if P[k] > upper[k] + tiny:
                        wrong.append(((P[k] - upper[k]) * size, k, 1))
                    elif P[k] < lower[k] - tiny:
                        wrong.append(((lower[k] - P[k]) * size, k, -1))
                elif state * w[k] < -TINY * scale:
                    wrong.append((-state * w[k], k, 0))
            if not wrong:
                yield active
                return
            if tuple(active) in seen:
                break
            seen.add(tuple(active))
            _, k, state = max(wrong) if attempt < 10 * len(laws) else min(wrong, key=lambda one: one[1])
            active[k] = state
        options = [
            (0, -1, 1) if math.isfinite(b[0]) and math.isfinite(b[1]) else (0, 1 if b[0] == -math.inf else -1)
            for b in laws
        ]
        for guess in itertools.product(*options):
            active = list(guess)
            P = self._impulses(W, w0, laws, active)
            w = w0 - W @ P - speed - compliance * P
            tiny = TINY * max(scale / size, np.abs(P).max(initial=0.0))
            inside = all(
                lower[k] == upper[k]
                or (state and state * w[k] >= -TINY * scale)
                or (not state and lower[k] - tiny <= P[k] <= upper[k] + tiny and abs(w[k]) < 1e-9 * scale)
                for k, state in enumerate(active)
            )
            if inside:
                yield active
                return

    @staticmethod
    def _impulses(
        W: Array, w0: Array, laws: Sequence[tuple[float, float, float, float]], active: Sequence[int]
    ) -> Array:
        lower, upper, speed, compliance = np.array(laws).reshape(-1, 4).T
        state = np.array(active)
        P = np.where(state > 0, upper, np.where(state < 0, lower, 0.0))
        P[lower == upper] = lower[lower == upper]
        P[~np.isfinite(P)] = 0.0
        free = (state == 0) & (lower != upper)
        if free.any():
            matrix = W[np.ix_(free, free)] + np.diag(compliance[free])
            wanted = w0[free] - speed[free] - W[free] @ P
            try:
                P[free] = np.linalg.solve(matrix, wanted)
                if not np.isfinite(P).all() or np.abs(matrix @ P[free] - wanted).max() > 1e-9 * max(
                    1.0, np.abs(wanted).max()
                ):
                    raise np.linalg.LinAlgError
            except np.linalg.LinAlgError:
                P[free] = np.linalg.lstsq(matrix, wanted, rcond=1e-11)[0]
        return P

    def _agree(self, modes: tuple[str, ...], whole: Array, gained: Array, P: Array) -> bool:
        """Whether speeds and torques of the gears are those of their modes."""
        v, multipliers = whole[: self.n], iter(whole[self.n :].tolist())
        scale, size = max(1.0, np.abs(v).max()), np.abs(gained).max() + np.abs(P).max(initial=0.0)
        for joint, mode in zip(self.gears, modes, strict=True):
            if mode == "stuck":
                at_a, at_b = next(multipliers), next(multipliers)
                ahead, back = joint.efficiency * at_a + at_b / joint.ratio, at_a + joint.back * at_b / joint.ratio
                if min(ahead, back) > TINY * size or max(ahead, back) < -TINY * size:
                    return False
                continue
            way, torque_ = 1.0 if mode.endswith("forward") else -1.0, next(multipliers)
            side = way if mode.startswith("driving") else -way
            if way * v[joint.a] < -TINY * scale or side * torque_ < -TINY * size:
                return False
        return True


def torque(source: Source, t: float) -> float:
    """Of a source at a time in s."""
    if not source.times[0] <= t < source.times[1]:
        return 0.0
    return source.constant + source.slope * t + source.size * math.sin(source.rate * t)
