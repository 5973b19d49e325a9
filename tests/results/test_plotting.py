"""Curves over time: what shares an axis, how high they are, and what is marked on them."""

from __future__ import annotations

import io
from typing import Any

import numpy as np
import pytest

import shaftwork as sw

pytest.importorskip("matplotlib")


def labels(axis: Any) -> list[str]:
    return [line.get_label() for line in axis.lines if not line.get_label().startswith("_")]


def curves(figure: Any) -> dict[str, Any]:
    return {line.get_label(): line for axis in figure.axes for line in axis.lines if line.get_label()[0] != "_"}


@pytest.mark.slow
def test_a_curve_is_as_high_as_the_motion_however_fast_it_swings() -> None:
    """An oscillation of 500 Hz over 4 s has 2000 turns, and a curve of 2000 samples is lower.

    A step of 1 N m on J and c swings between 0 and 2 N m; damping 1e-4 of critical changes that by less than 0.1 %.
    """
    J, f = 1e-3, 500.0
    c = J * (2 * np.pi * f) ** 2
    net = sw.Network("fast")
    net.add(sw.TorqueSource("pull", tau=1.0), "a")
    net.add(sw.Inertia("J", J=J), "a")
    net.add(sw.Spring("c", c=c, d=2e-4 * np.sqrt(c * J)), "a", "ground")
    sol = net.simulate(4.0)
    line = curves(sol.plot("c.tau"))["c.tau"]
    t, tau = line.get_data()
    assert tau.max() == pytest.approx(2.0, rel=1e-3)
    assert tau.max() == pytest.approx(float(sol.max("c.tau")), rel=1e-9)
    assert tau.min() == pytest.approx(float(sol.min("c.tau")), abs=1e-9)
    assert (np.diff(t) >= 0).all()
    assert len(t) < 10_000  # a picture of all turns would be slow to draw and no different


def test_curves_of_one_unit_and_unlike_size_have_axes_of_their_own() -> None:
    net = sw.Network("gears")
    net.add(sw.TorqueSource("motor", tau=1.0), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Gear("g", ratio=100.0), "a", "b")
    net.add(sw.Inertia("J2", J=1e4), "b")
    net.add(sw.Damper("load", d=1e4), "b", "ground")
    figure = net.simulate(5.0).plot("J1.omega", "motor.tau", "J2.omega", "load.tau", "J1.tau")
    assert [labels(axis) for axis in figure.axes] == [["J1.omega"], ["motor.tau", "J1.tau"], ["J2.omega"], ["load.tau"]]
    assert [axis.get_ylabel() for axis in figure.axes] == ["rad/s", "N*m", "rad/s", "N*m"]  # as in tables


def test_a_speed_can_be_read_in_turns() -> None:
    net = sw.Network("one mass")
    net.add(sw.TorqueSource("motor", tau=2.0), "rotor")
    net.add(sw.Inertia("J1", J=2.0), "rotor")
    figure = net.simulate(10.0).plot("J1.omega", "J1.tau")
    speed, torque = figure.axes
    (turns,) = speed.child_axes
    figure.savefig(io.BytesIO())  # places the axes
    assert turns.get_ylabel() == "1/min"
    assert np.array(turns.get_ylim()) == pytest.approx(np.array(speed.get_ylim()) * 30 / np.pi)
    assert torque.child_axes == []


def test_phases_and_changes_of_mode_are_marked() -> None:
    sol = sw.scenes.crane_start().simulate(2.0)
    assert len(sol.phases) == 2
    figure = sol.plot("shaft.tau", "J2.omega")
    torque, speed, phases = figure.axes
    for axis in (torque, speed):
        marks = [line.get_xdata()[0] for line in axis.lines if line.get_label().startswith("_")]
        assert marks == [time for time, *_ in sol.events]
    assert [text.get_text() for text in phases.get_yticklabels()] == ["load"]
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["stuck", "slipping forward"]
    (bars,) = phases.collections
    ends = [(path.vertices[:, 0].min(), path.vertices[:, 0].max()) for path in bars.get_paths()]
    assert ends == [(row.start, pytest.approx(row.end)) for row in sol.phases]


@pytest.mark.slow
def test_more_changes_than_can_be_told_apart_are_marked_by_their_phases_alone() -> None:
    sol = sw.scenes.bldc_shaft().simulate(0.3)
    assert len(sol.events) > 60
    figure = sol.plot("motor.tau")
    assert labels(figure.axes[0]) == ["motor.tau"]
    assert len(figure.axes[0].lines) == 1
    assert [text.get_text() for text in figure.axes[-1].get_yticklabels()] == list(sol.phases[0].modes)


def test_a_quantity_along_a_shaft_is_drawn_at_all_its_places() -> None:
    sol = sw.scenes.shaft_step().simulate(0.1)
    axis = sol.plot("line.tau", "line.tau_a").axes[0]
    places = len(sol.places["line.tau"])
    assert labels(axis) == [f"line.tau at {places} places", "line.tau_a"]
    assert len(axis.lines) == places + 1


def test_a_name_with_dollars_is_no_formula() -> None:
    net = sw.Network(r"money $\b$")
    net.add(sw.TorqueSource("motor", tau=1.0), "a")
    net.add(sw.Inertia(r"a$\b$", J=1.0), "a")
    solution = net.simulate(1.0)
    solution.plot().savefig(io.BytesIO())
    solution.animate(seconds=0.2).figure.savefig(io.BytesIO())
    solution.spectrum(r"a$\b$.omega").plot().savefig(io.BytesIO())
