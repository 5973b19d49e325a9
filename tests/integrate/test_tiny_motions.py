"""Motions of any size are equally right: what a linear network does is in proportion to sources and start values."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
import sympy

import shaftwork as sw

SIGNALS = ("J1.omega", "J3.omega", "first.tau_c", "second.tau", "J3.phi")
ENGINES = {"scipy": 2e-7, "scipy-radau": 2e-8, "sundials": 2e-5, "heyoka": 5e-9, "banded": 1e-9}
"""By what part of the largest value an engine may be off: five times what it is off at ordinary size, and above."""


def moved(size: float, engine: str) -> np.ndarray:
    """A chain that a torque winds up from 0.1 s on, by its signals as parts of the size of torque and start."""
    net = sw.Network("chain")
    net.add(sw.TorqueSource("motor", tau=sw.Step(5.0 * size, 0.1)), "a")
    net.add(sw.Inertia("J1", J=0.5), "a")
    net.add(sw.Spring("first", c=800.0, d=0.2), "a", "b")
    net.add(sw.Inertia("J2", J=2.0), "b")
    net.add(sw.Spring("second", c=300.0, d=0.2), "b", "c")
    net.add(sw.Inertia("J3", J=0.1), "c")
    sol = net.compile(angles=["J3"]).simulate(2.0, engine=engine, initial={"J2.omega": 3.0 * size}, t_eval=201)
    return np.column_stack([sol[name] for name in SIGNALS]) / size


@cache
def truth() -> np.ndarray:
    """Propagated exactly."""
    return moved(1.0, "exact")


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:the engine 'sundials' is off by [12]e-06:shaftwork.AccuracyWarning")  # as at size 1
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    "size", [1e-12, 1e-6, 1.0, 1e9, *(pytest.param(size, marks=pytest.mark.slow) for size in (1e-9, 1e-3, 1e3))]
)
def test_the_relative_error_does_not_depend_on_the_size_of_a_motion(engine: str, size: float) -> None:
    error = np.abs(moved(size, engine) - truth()) / np.abs(truth()).max(axis=0)
    assert error.max() < ENGINES[engine]


@pytest.mark.slow
def test_a_tiny_motion_of_a_network_with_modes_is_as_right_as_a_large_one() -> None:
    """Inside its gap, to the sixth digit; its angles are some 1e-11 rad."""

    def twist(size: float, engine: str) -> np.ndarray:
        net = sw.Network("loose")
        net.add(sw.Inertia("J1", J=1.0), "a")
        net.add(sw.Spring("shaft", c=900.0), "a", "b")
        net.add(sw.Inertia("J2", J=1.0), "b")
        net.add(sw.Backlash("gap", gap=10.0, c=1e3), "b", "c")
        net.add(sw.Inertia("J3", J=1.0), "c")
        sol = net.simulate(1.0, engine=engine, initial={"J1.omega": size, "J2.omega": -size}, t_eval=101)
        return np.asarray(sol["gap.phi"]) / size

    times = np.linspace(0.0, 1.0, 101)
    rate = np.sqrt(2 * 900.0)
    for engine in ("scipy", "heyoka", "sundials"):
        for size in (1.0, 1e-10):
            assert np.abs(twist(size, engine) + np.sin(rate * times) / rate).max() < 1e-6 / rate, (engine, size)


def heavy(factor: float, engine: str, rtol: float) -> np.ndarray:
    """Speeds of a train with gap and clutch whose equations are all multiplied by a factor, which no speed knows."""
    net = sw.Network("heavy")
    net.add(sw.TorqueSource("motor", tau=factor * (9 * sympy.sin(7 * sw.t) + 2)), "a")
    net.add(sw.Inertia("J1", J=0.1 * factor), "a")
    net.add(sw.Backlash("gap", gap=0.02, c=800 * factor, d=0.4 * factor), "a", "b")
    net.add(sw.Inertia("J2", J=0.3 * factor), "b")
    net.add(sw.Clutch("clutch", tau=3 * factor, t_on=0.3), "b", "c")
    net.add(sw.Inertia("J3", J=0.2 * factor), "c")
    net.add(sw.ViscousLoad("load", d=0.1 * factor), "c")
    net.add(sw.Spring("spring", c=30 * factor, d=0.05 * factor), "c", "d")
    net.add(sw.Inertia("J4", J=0.05 * factor), "d")
    sol = net.simulate(2.0, engine=engine, rtol=rtol, t_eval=201)
    return np.column_stack([sol[f"J{number}.omega"] for number in (1, 2, 3, 4)])


@pytest.mark.heyoka
@pytest.mark.parametrize("factor", [1e6, 1e10])
def test_speeds_beside_huge_torques_are_as_right_as_beside_small_ones(factor: float) -> None:
    """heyoka has one tolerance for all states: 1e-6 was lost beside torques of 1e8 N m, 1e-9 beside those of 1e6."""
    truth = heavy(1.0, "scipy", 1e-12)
    assert np.abs(heavy(factor, "heyoka", 1e-8) - truth).max() < 1e-9 * np.abs(truth).max()
