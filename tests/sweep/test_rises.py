"""Where variants side by side first meet a guard: between samples too, and by samples that never show it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from shaftwork.sweep.lane_steps import first_rises

import shaftwork as sw
from shaftwork.codegen.array_form.elements import Array
from shaftwork.studies import sweep


def wave(phase: Array, level: Array, t: Array) -> Array:
    """cos(t + phase) - level and its first two derivatives."""
    return np.array([np.cos(t + phase) - level, -np.sin(t + phase), -np.cos(t + phase)])


@pytest.mark.slow
@given(st.integers(0, 10**6), st.floats(0.2, 1.2))
def test_the_first_rise_of_a_wave_is_that_of_its_formula(seed: int, length: float) -> None:
    """Levels are up to 1e-8 below the top, where a rise and a fall lie between the same two samples, and above it."""
    random, count = np.random.default_rng(seed), 24
    below = 10.0 ** random.uniform(-8, 0, count)
    level = 1.0 - np.where(random.random(count) < 0.8, below, -below)
    phase = np.where(level > -1 + 1e-6, random.uniform(np.pi / 2 + 1.1, 2 * np.pi - 1.1, count), np.pi)
    phase = np.where(np.cos(phase) < level, phase, np.pi)  # below it at the start
    t = np.linspace(0.0, 12 * length, 13)[:, None] + np.zeros(count)
    rises = first_rises(t, wave(phase, level, t), lambda _at, own, at_times: wave(phase[own], level[own], at_times))
    with np.errstate(invalid="ignore"):
        expected = (2 * np.pi - np.arccos(level) - phase) % (2 * np.pi)
    there = (level < 1.0) & (expected < t[-1])
    # near the top the time is known to the square root of rounding
    np.testing.assert_allclose(rises.t[there], expected[there], atol=1e-9)
    assert np.isinf(rises.t[~there]).all()
    found = np.flatnonzero(there)
    assert (t[rises.at[found], found] <= rises.t[found]).all()
    assert (t[rises.at[found] + 1, found] >= rises.t[found]).all()


@pytest.mark.slow
def test_a_stop_that_is_touched_between_two_steps_is_seen() -> None:
    """An inertia swings on a spring up to a stop, 1e-10 of its way deep or not quite to it; the energy says how far."""
    pytest.importorskip("heyoka")
    stiffness, hard, upper = 800.0, 1e5, 0.0125
    net = sw.Network("touch")
    net.add(sw.TorqueSource("motor", tau=5.0), "a")
    net.add(sw.Inertia("J", J=2.0), "a")
    net.add(sw.Spring("shaft", c=stiffness), "a", "ground")
    net.add(sw.HardStop("stop", upper=upper, c=hard), "a")
    part = np.logspace(-10, -1, 16)
    torque = 5.0 * (1 + np.concatenate([-part, part]))
    made = sweep(net, samples={"motor.tau": torque}, t_end=1.0, measures=["max stop.tau"], processes=1)
    assert "16 of 32" in made.why  # of those that touch it `simulate` decides
    both, pull = stiffness + hard, torque[16:] + hard * upper
    reached = (pull + np.sqrt(pull**2 - both * hard * upper**2)) / both
    np.testing.assert_array_equal(made.measures["max stop.tau"][:16], 0.0)
    np.testing.assert_allclose(made.measures["max stop.tau"][16:], hard * (reached - upper), atol=1e-8)
