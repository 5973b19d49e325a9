"""Random trains of up to twelve parts that switch, self-locking gears among them, beside Moreau's time stepping.

Time stepping locates no event and follows no mode: what sticks, presses, jams or is hit in a step is one problem there.
Its error is of the first order, so the motions are compared as its steps are halved.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import chain, pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.properties.examples import Array, share_of_examples
from tests.properties.test_hybrid_reference import RESTS, SWITCHING, Draw, end
from tests.reference.hybrid_train import Joint, Train
from tests.reference.time_stepping import NoSolutionError, Stepper

STEPS = (500, 1000, 2000)
FINER = (8000, 64000)
"""Steps for a train that is still away: its error falls unevenly, as what sticks does so in one step or the next."""
NEAR = 2e-3
"""Of the largest speed: so far away may the last of the steps be, beside what halving them changes."""
GEARED = ("soft", "friction", "brake", "freewheel")
"""What stands beside gears, from rest: an impact follows its impulse through them, and a step knows its end alone."""


class GearedDraw(Draw):
    """A random train of two to twelve parts that switch; from rest where there are gears.

    Args:
        seed, kinds: as of a `Draw`.
        gears: the share of gears in its row, each between two inertias.
        most: parts that switch.
    """

    def __init__(self, seed: int, kinds: tuple[str, ...] = GEARED, gears: float = 0.4, most: int = 12) -> None:
        super().__init__(seed, kinds)
        self.gears, self.most = gears, most

    def train(self) -> Train:
        """Two to six inertias; what switches stands in the row, across it, or on the frame."""
        rng = self.rng
        n, left, joints = int(rng.integers(2, 7)), int(rng.integers(2, self.most + 1)), list[Joint]()
        for a in range(n - 1):
            if left and rng.random() < self.gears and not (joints and joints[-1].kind == "gear"):
                joints.append(self.gear(a))
                left -= 1
                continue
            kind = "spring" if not left or rng.random() < 0.3 else str(rng.choice(self.kinds))
            left -= kind != "spring"
            joints.append(self.joint(kind, a, a + 1))
        for _ in range(left):
            a, other = rng.choice(n, 2, replace=False).tolist()
            kind = str(rng.choice(self.kinds))
            joints.append(self.joint(kind, a, -1 if kind != "soft" and rng.random() < 0.6 else other))
        speeds = np.where(rng.random(n) < 0.4, 0.0, rng.normal(0.0, 5.0, n))
        return self.driven(tuple(joints), (0.0,) * n if self.gears else tuple(speeds.tolist()))

    def driven(self, joints: tuple[Joint, ...], speeds: tuple[float, ...]) -> Train:
        """A train with random inertias and one or two sources."""
        rng, n = self.rng, len(speeds)
        sources = tuple(self.source(int(rng.integers(n))) for _ in range(int(rng.integers(1, 3))))
        inertias = (10.0 ** rng.uniform(-1.0, 0.5, n)).tolist()
        return Train(tuple(inertias), speeds, joints, sources, float(rng.uniform(0.4, 1.0)))

    def gear(self, a: int) -> Joint:
        """One that its load can drive, or that locks itself."""
        rng = self.rng
        ratio = float(rng.choice([-1.0, 1.0])) * 10.0 ** rng.uniform(-0.5, 0.5)
        back = float(rng.choice([rng.uniform(-0.9, 0.0), rng.uniform(0.1, 0.95)]))
        return Joint("gear", a, a + 1, ratio=ratio, efficiency=float(rng.uniform(0.4, 1.0)), back=back)


class AtOnceDraw(GearedDraw):
    """A random train in which events come at one instant: two halves alike, or a row whose contacts touch and are hit.

    Half of what is hit is held by a friction that sticks until then.
    """

    def __init__(self, seed: int) -> None:
        super().__init__(seed, SWITCHING, 0.0)

    def train(self) -> Train:
        """A symmetric train or a row, each in half of the cases."""
        return self.symmetric() if self.rng.random() < 0.5 else self.row()

    def symmetric(self) -> Train:
        """Two halves that share their first inertia, and what drives that."""
        rng, m = self.rng, int(self.rng.integers(2, 4))
        kinds = [str(rng.choice(self.kinds)) for _ in range(int(rng.integers(1, 7)))]
        half = [self.joint(kind, a, a + 1) for a, kind in zip(range(m - 1), kinds, strict=False)]
        half += [self.joint("spring", a, a + 1) for a in range(len(half), m - 1)]
        half += [self.joint(kind, int(rng.integers(1, m)), -1 if kind != "soft" else 0) for kind in kinds[m - 1 :]]
        speeds = (float(rng.normal(0.0, 5.0)), *(0.0,) * (m - 1))
        whole = self.driven(tuple(half), speeds)

        def other(a: int) -> int:
            return a + m - 1 if a > 0 else a

        mirrored = (replace(joint, a=other(joint.a), b=other(joint.b)) for joint in half)
        sources = tuple(replace(source, a=0) for source in whole.sources)
        inertias = (*whole.inertias, *whole.inertias[1:])
        return Train(inertias, (*speeds, *speeds[1:]), (*half, *mirrored), sources, whole.t_end)

    def row(self) -> Train:
        """Three to seven inertias; the first hits a row in which some contacts touch and others have the same gap."""
        rng, n, half = self.rng, int(self.rng.integers(3, 8)), float(self.rng.uniform(0.01, 0.1))
        e = float(rng.choice([0.0, rng.uniform(0.1, 0.7)]))
        joints = [Joint("rigid", 0, 1, limits=(-half, half), restitution=e, rest=RESTS)]
        for a in range(1, n - 1):
            e = float(rng.choice([0.0, rng.uniform(0.1, 0.7)]))
            limits = (-half, 0.0 if rng.random() < 0.7 else half)
            joints.append(Joint("rigid", a, a + 1, limits=limits, restitution=e, rest=RESTS))
        held = ("friction", "brake", "freewheel", "rigid")
        joints += [self.joint(str(rng.choice(held)), a, -1) for a in range(1, n) if rng.random() < 0.5]
        return self.driven(tuple(joints), (float(rng.uniform(1.0, 8.0)), *(0.0,) * (n - 1)))


def steps_towards(train: Train) -> list[Array]:
    """The ends of the time stepping with ever shorter steps; no example where a step has no solution."""
    try:
        return [Stepper(train, count).end() for count in STEPS]
    except NoSolutionError:
        assume(False)  # noqa: FBT003 (two jams at once)
        raise


@pytest.mark.slow
@given(st.integers(0, 10**6), st.booleans())
@share_of_examples(0.1)
def test_a_random_hybrid_motion_ends_where_time_stepping_converges(seed: int, geared: bool) -> None:  # noqa: FBT001
    train = GearedDraw(seed, GEARED).train() if geared else Draw(seed).train()
    stepped = steps_towards(train)
    size = max(1.0, np.abs(stepped[-1]).max())
    changes = [np.abs(early - late).max() / size for early, late in pairwise(stepped)]
    assume(changes[1] < 0.02)  # impacts that multiply each step's error take shorter steps than a test has time for
    reached, bound = end(train), 2.0 * max(changes) + NEAR
    finer = (Stepper(train, count).end() for count in FINER)
    if not any(np.abs(reached - last).max() / size < bound for last in chain((stepped[-1],), finer)):
        compared = Stepper(train, STEPS[1], compares=True)
        compared.end()
        assert not compared.unique  # a gear that locks itself may rest or slide: both are solutions
