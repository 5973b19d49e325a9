"""Gaps along a line are gaps of a shaft in other units."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import shaftwork as sw

CONTACTS = [{"c": 1e4, "d": 3.0}, {"restitution": 0.4}]


@pytest.mark.slow
@pytest.mark.parametrize("contact", CONTACTS, ids=["elastic", "rigid"])
def test_play_along_a_line_moves_as_backlash_does(contact: dict[str, float]) -> None:
    """Pushed to and fro, the load strikes both flanks; numbers alike, the motions are alike."""
    turning = sw.Network("teeth")
    turning.add(sw.Inertia("one", J=2.0), "a")
    turning.add(sw.Inertia("other", J=1.0), "b")
    turning.add(sw.TorqueSource("push", tau=20 * sympy.cos(9 * sw.t)), "a")
    turning.add(sw.Backlash("gap", gap=0.05, **contact), "a", "b")
    sliding = sw.Network("wagons")
    sliding.add(sw.Mass("one", m=2.0), "a")
    sliding.add(sw.Mass("other", m=1.0), "b")
    sliding.add(sw.ForceSource("push", f=20 * sympy.cos(9 * sw.t)), "a")
    sliding.add(sw.TranslationalBacklash("gap", gap=0.05, **contact), "a", "b")
    turned, slid = turning.simulate(2.0), sliding.simulate(2.0)
    twist = turned["gap.phi"]
    assert twist.max() >= 0.0249
    assert twist.min() <= -0.0249
    np.testing.assert_allclose(slid["b.v"], turned["b.omega"], rtol=1e-6, atol=1e-6)  # of 2 m/s; rtol of a run is 1e-8
