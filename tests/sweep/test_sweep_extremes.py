"""Extremes of variants side by side, of which only samples are seen, are those of each variant by itself."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.studies import sweep

pytest.importorskip("numba")

ALONE = 8
"""Variants that are too few to run side by side."""


def both(net: sw.Network, samples: dict[str, np.ndarray], **options: object) -> list[tuple[np.ndarray, np.ndarray]]:
    """Measures side by side, and of the first variants one by one."""
    first = {name: values[:ALONE] for name, values in samples.items()}
    fast, slow = (sweep(net, samples=chosen, **options) for chosen in (samples, first))  # type: ignore[arg-type]
    assert fast.why == ""
    assert "fewer than" in slow.why
    return [(fast.measures[name][:ALONE], slow.measures[name]) for name in fast.measures]


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-8, 1e-14])
def test_extremes_of_widely_different_shafts_are_right_to_1e_9(rtol: float) -> None:
    """Steps of a damped shaft are half a period long, and the torque of a motor near its pull-out has two tops in one.

    1e-9 of its range is what an extreme may be missed by.
    """
    random, count = np.random.default_rng(3), 2048
    table = {
        "shaft.c": 24206.0 * random.uniform(0.3, 3.0, count),
        "shaft.d": 14.0 * random.uniform(0.3, 3.0, count),
        "motor.tau_k": 8.0 * random.uniform(0.8, 1.4, count),
    }
    chosen = [0, 374, 232, 987, 1396, 214, 905, 1934, *[374] * ALONE]  # those that were missed
    samples = {name: values[chosen] for name, values in table.items()}
    measures = ["max shaft.tau", "max motor.tau"]
    for fast, slow in both(sw.scenes.crane_start(), samples, t_end=6.5, measures=measures, rtol=rtol):
        np.testing.assert_allclose(fast, slow, rtol=1e-9)


@pytest.mark.slow
def test_extremes_of_what_depends_on_the_time_itself_are_right() -> None:
    """The torque of the motor is a function of the time alone, and its largest value is known."""
    net = sw.Network("driven")
    net.add(sw.TorqueSource("motor", tau=5 * sympy.sin(7 * sw.t) - 3 * sw.t), "a")
    net.add(sw.Inertia("J", J=2.0), "a")
    net.add(sw.Spring("shaft", c=800.0, d=2.0), "a", "ground")
    samples = {"J.J": np.linspace(1.0, 3.0, 16)}
    measures = ["max motor.tau", "max shaft.tau", "min J.omega"]
    (motor, alone), *others = both(net, samples, t_end=2.0, measures=measures)
    for fast, slow in ((motor, alone), *others):
        np.testing.assert_allclose(fast, slow, rtol=1e-9)
    top = np.arccos(3 / 35) / 7
    np.testing.assert_allclose(motor, 5 * np.sin(7 * top) - 3 * top, rtol=1e-9)
