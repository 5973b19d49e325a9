"""Random trains of up to twelve parts that switch, self-locking gears among them, beside Moreau's time stepping.

Time stepping locates no event and follows no mode: what sticks, presses, jams or is hit in a step is one problem there.
Its error is of the first order, so the motions are compared as its steps are halved.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from tests.properties.examples import Array, share_of_examples
from tests.properties.test_hybrid_reference import Draw, end
from tests.reference.hybrid_train import Joint, Train
from tests.reference.time_stepping import NoSolutionError, Stepper

STEPS = (500, 1000, 2000)
NEAR = 2e-3
"""Of the largest speed: so far away may the last of the steps be, beside what halving them changes."""
GEARED = ("soft", "friction", "brake", "freewheel")
"""What stands beside gears, from rest: an impact follows its impulse through them, and a step knows its end alone."""


class GearedDraw(Draw):
    """A random train with gears in its row, each between two inertias."""

    def train(self) -> Train:
        """Two to six inertias; what switches stands in the row, across it, or on the frame."""
        rng = self.rng
        n, left, joints = int(rng.integers(2, 7)), int(rng.integers(1, 11)), list[Joint]()
        for a in range(n - 1):
            if rng.random() < 0.4 and not (joints and joints[-1].kind == "gear"):
                joints.append(self.gear(a))
                continue
            kind = "spring" if not left or rng.random() < 0.3 else str(rng.choice(self.kinds))
            left -= kind != "spring"
            joints.append(self.joint(kind, a, a + 1))
        for _ in range(left):
            a, other = rng.choice(n, 2, replace=False).tolist()
            kind = str(rng.choice(self.kinds))
            joints.append(self.joint(kind, a, -1 if kind != "soft" and rng.random() < 0.6 else other))
        sources = tuple(self.source(int(rng.integers(n))) for _ in range(int(rng.integers(1, 3))))
        inertias = (10.0 ** rng.uniform(-1.0, 0.5, n)).tolist()
        return Train(tuple(inertias), (0.0,) * n, tuple(joints), sources, float(rng.uniform(0.4, 1.0)))

    def gear(self, a: int) -> Joint:
        """One that its load can drive, or that locks itself."""
        rng = self.rng
        ratio = float(rng.choice([-1.0, 1.0])) * 10.0 ** rng.uniform(-0.5, 0.5)
        back = float(rng.choice([rng.uniform(-0.9, 0.0), rng.uniform(0.1, 0.95)]))
        return Joint("gear", a, a + 1, ratio=ratio, efficiency=float(rng.uniform(0.4, 1.0)), back=back)


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
    assert np.abs(end(train) - stepped[-1]).max() / size < 2.0 * max(changes) + NEAR
