"""Motions of trains with parts that switch, by Moreau's time stepping: no event is located, and no mode is followed.

Nothing here is the library's. Each step asks for speeds at its end and for impulses over it that go with all laws at
once: what sticks, presses, jams or is hit in a step is the solution of one problem. The error is of the first order in
the step, and is estimated by halving it. Laws, with w the speed across a joint at the end of a step and P its impulse:

- friction: |P| <= tau h, and P = tau h sign(w) where it slips;
- freewheel: w <= 0, P >= 0, P w = 0;
- rigid contact within its gap: nothing; beyond it w <= 0, P >= 0, complementary; where one is hit, it then gives back e
  of its impulse, and again w <= 0 for all, by impulses that are no less than before (Poisson);
- soft contact: P = h max(0, c x + d w);
- gear: omega_a = ratio omega_b; impulses by the direction of the power, or both sides held.

Source: Acary and Brogliato, Numerical Methods for Nonsmooth Dynamical Systems, 2008, chapter 10.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence

import numpy as np

from tests.reference.hybrid_train import Array, Joint, Source, Train

GEAR = ("driving forward", "driving backward", "driven forward", "driven backward", "stuck")
"""The modes of a gear, in the order in which they are tried: a jam is the last way."""
MOST_WAYS = 2000
"""So many combinations of what is at its bounds are tried."""
TOUCHES = 1e-12
"""A contact within this twist of its limit, rad, touches: rounding."""
SLOW = 2.0
"""A contact is hit that closes by more than this many times what torques change in a step."""
UNLIKE = 1e-6
"""Speeds that differ by more, as a part of the largest and of 1 rad/s, are two answers."""
TINY = 1e-11
"""A part of the largest speed or impulse that is rounding."""


class NoSolutionError(Exception):
    """No combination of what sticks, presses and jams is consistent."""


class Stepper:
    """Steps of one size through the motion of a train.

    Args:
        train: what moves.
        steps: how many.
        compares: whether each step looks for other consistent answers; `unique` then tells that there was none.
    """

    def __init__(self, train: Train, steps: int, *, compares: bool = False) -> None:
        self.compares, self.unique = compares, True
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
        """One step, of which the middle is at a time in s; springs by the midpoint rule."""
        h, before = self.h, self.v
        pull = self.S.T @ (self.c * (self.twists + h / 4 * (self.S @ before)) + self.d / 2 * (self.S @ before))
        gained = self.J * before - h * pull
        for source in self.train.sources:
            gained[source.a] += h * torque(source, t)
        laws = np.array([self._law(k, t, before) for k in range(len(self.switching))]).reshape(-1, 4)
        ways = list(itertools.product(GEAR, repeat=len(self.gears)))
        if self.compares and self.unique:
            self.unique = self._is_one_way(ways, gained, laws, before)
        others = [modes for modes in ways if modes != self.modes]
        for modes in (self.modes, *sorted(others, key=lambda modes: modes.count("stuck"))):
            solution = self._solved(modes, gained, laws, self.R @ before)
            if solution is not None:
                self.modes, (v, self.active) = modes, solution
                break
        else:
            raise NoSolutionError(t)
        self.twists += h * (self.S @ (before + v)) / 2
        self.gaps += h * (self.R @ (before + v)) / 2
        self.v = v

    def _is_one_way(self, ways: Iterable[tuple[str, ...]], gained: Array, laws: Array, before: Array) -> bool:
        """Whether all modes of the gears that are consistent lead to the same speeds."""
        active, speeds = list(self.active), []
        for modes in ways:
            self.active = list(active)
            if (solution := self._solved(modes, gained, laws, self.R @ before)) is not None:
                speeds.append(solution[0])
        self.active = active
        return all(np.abs(v - speeds[0]).max() < UNLIKE * max(1.0, np.abs(before).max()) for v in speeds)

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
        side = 1.0 if x > upper - TOUCHES else -1.0 if x < lower + TOUCHES else 0.0
        bounds = {1.0: (0.0, math.inf), -1.0: (-math.inf, 0.0), 0.0: (0.0, 0.0)}[side]
        if joint.kind == "soft":
            beyond = self.gaps[k] - (upper if side > 0 else lower)
            slope = joint.c * h / 2 + joint.d
            return (*bounds, -joint.c * beyond / slope, 1 / (h * slope)) if side else (0.0, 0.0, 0.0, 0.0)
        return *bounds, 0.0, 0.0

    def _thrown(self, w: Array, gains: Array, P: Array) -> Array:
        """(m,) the share of impulses P that contacts give back which are hit at speeds w, and gain some in a step."""
        e, rest = (np.array([getattr(joint, name) for joint in self.switching]) for name in ("restitution", "rest"))
        # what closes no faster than torques make it within a step is pressed, not hit
        return np.where((e * np.abs(w) > rest + SLOW * np.abs(gains)) & (w * P > 0), e, 0.0)

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

    def _solved(self, modes: tuple[str, ...], gained: Array, laws: Array, w: Array) -> tuple[Array, list[int]] | None:
        """Speeds at the end of a step in some modes of gears, with what is at which bound; None where none agree.

        Args:
            modes: of the gears.
            gained: (n,) momenta without impulses.
            laws: (m, 4) as of `Bounded`.
            w: (m,) speeds across what switches before the step.
        """
        inverse, by_impulses = self._answer(modes)
        free = inverse @ gained
        W, w0 = self.R @ by_impulses[: self.n], self.R @ free[: self.n]
        found = Bounded(W, w0, laws).solved(self.active)
        if found is not None and (thrown := self._thrown(w, w0 - w, found[0])).any():
            found = Bounded(W, w0, _at_least(laws, (1 + thrown) * found[0])).solved(found[1])
        if found is None:
            return None
        P, active = found
        whole = free - by_impulses @ P
        return (whole[: self.n], active) if self._agree(modes, whole, gained, P) else None

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


def _at_least(laws: Array, P: Array) -> Array:
    """(m, 4) laws in which what presses without a compliance does so by impulses (m,) or more."""
    laws = laws.copy()
    presses = (np.isinf(laws[:, :2]).sum(axis=1) == 1) & (laws[:, 3] == 0)
    for bound in (0, 1):
        raised = presses & np.isfinite(laws[:, bound])
        laws[raised, bound] = P[raised]
    return laws


class Bounded:
    """Impulses P within bounds: w = w0 - W P is the speed that belongs to P in between, no less at the upper bound.

    Args:
        W: (m, m) speeds that unit impulses take.
        w0: (m,) speeds without impulses.
        laws: (m, 4) bounds, speed and compliance.
    """

    def __init__(self, W: Array, w0: Array, laws: Array) -> None:
        self.W, self.w0 = W, w0
        self.lower, self.upper, self.speed, self.compliance = laws.T
        self.scale, self.size = max(1.0, np.abs(w0).max(initial=0.0)), np.abs(W).max(initial=1e-30)
        self.acts = self.lower != self.upper

    def solved(self, before: Sequence[int]) -> tuple[Array, list[int]] | None:
        """The impulses, and what is at its lower bound (-1), at its upper one (1), or between them (0).

        One after another that is wrong is changed, the worst first, then the first (Murty); else all ways are tried.

        Args:
            before: what was so in the last step.
        """
        bounds = {-1: self.lower, 0: np.zeros(len(self.w0)), 1: self.upper}
        # what presses begins without an impulse: beside gears there may be several solutions, and this is the least
        opens = np.where(np.isinf(self.upper), -1, np.where(np.isinf(self.lower), 1, 0)).tolist()
        active = [opens[k] or state for k, state in enumerate(before)]
        size, seen = len(active), set[tuple[int, ...]]()
        for attempt in range(50 * (size + 1)):
            P, wrong = self._judged(active)
            if not wrong:
                return P, active
            if tuple(active) in seen:
                break
            seen.add(tuple(active))
            _, k, state = max(wrong) if attempt < 10 * size else min(wrong, key=lambda one: one[1])
            active[k] = state
        options = [[s for s in (0, -1, 1) if math.isfinite(bounds[s][k])] for k in range(size)]
        for guess in itertools.islice(itertools.product(*options), MOST_WAYS):
            P, wrong = self._judged(list(guess))
            if (
                not wrong
                and np.abs(self._apart(P)[self.acts & (np.array(guess) == 0)]).max(initial=0) < 1e-9 * self.scale
            ):
                return P, list(guess)
        return None

    def _apart(self, P: Array) -> Array:
        """How far speeds are from those that belong to impulses between the bounds."""
        return np.asarray(self.w0 - self.W @ P - self.speed - self.compliance * P)

    def _judged(self, active: Sequence[int]) -> tuple[Array, list[tuple[float, int, int]]]:
        """Impulses, and what contradicts its state: by how much, which, and the state that it should have."""
        P = self._impulses(active)
        apart, wrong = self._apart(P), list[tuple[float, int, int]]()
        tiny = TINY * max(self.scale / self.size, np.abs(P).max(initial=0.0))
        for k, state in enumerate(active):
            if not self.acts[k]:
                continue
            if state == 0:
                beyond = {1: P[k] - self.upper[k], -1: self.lower[k] - P[k]}
                wrong += [(far * self.size, k, side) for side, far in beyond.items() if far > tiny]
            elif state * apart[k] < -TINY * self.scale:
                wrong.append((-state * apart[k], k, 0))
        return P, wrong

    def _impulses(self, active: Sequence[int]) -> Array:
        state = np.array(active)
        P = np.where(state > 0, self.upper, np.where(state < 0, self.lower, 0.0))
        P[~self.acts] = self.lower[~self.acts]
        free = (state == 0) & self.acts
        if free.any():
            matrix = self.W[np.ix_(free, free)] + np.diag(self.compliance[free])
            wanted = self.w0[free] - self.speed[free] - self.W[free] @ P
            singular = np.linalg.cond(matrix) > 1e12
            P[free] = np.linalg.lstsq(matrix, wanted, rcond=1e-11)[0] if singular else np.linalg.solve(matrix, wanted)
        return P


def torque(source: Source, t: float) -> float:
    """Of a source at a time in s."""
    if not source.times[0] <= t < source.times[1]:
        return 0.0
    return source.constant + source.slope * t + source.size * math.sin(source.rate * t)
