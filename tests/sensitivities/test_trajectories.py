"""Quantities over time and their derivatives: against differences of motions, and where they are refused."""

from __future__ import annotations

import numpy as np
import pytest

import shaftwork as sw


@pytest.mark.parametrize(
    ("name", "step"),
    [("shaft.c", 2e-5), ("shaft.gap", 1e-5), ("J1.J", 1e-5), ("load.tau", 1e-5), ("motor.tau_k", 1e-5)],
)
def test_derivatives_through_all_phases_are_the_differences_of_two_motions(name: str, step: float) -> None:
    net = sw.scenes.six_phases()
    model, t = net.compile(), np.linspace(0.0, 10.0, 201)
    exact = sw.studies.trajectory_sensitivities(net, ["shaft.tau", "J2.omega"], t, parameters=[name])
    value = model.parameters[name]
    high, low = (
        model.simulate(10.0, parameters={name: value * (1 + sign * step)}, rtol=1e-12, t_eval=t) for sign in (1, -1)
    )
    for quantity in exact.slopes:
        difference = (high[quantity] - low[quantity]) / (2 * value * step)
        # motions to 1e-12 over steps of 1e-5, and the square of a step over the time of an oscillation
        assert np.abs(exact[quantity][name] - difference).max() < 2e-6 * np.abs(difference).max()


def test_the_derivative_by_a_start_value_is_that_of_a_decay() -> None:
    net = sw.Network("decay")
    net.add(sw.Inertia("J", J=2.0), "wheel")
    net.add(sw.Damper("bearing", d=3.0), "wheel")
    t = np.linspace(0.0, 2.0, 41)
    made = sw.studies.trajectory_sensitivities(
        net, "J.omega", t, parameters=["bearing.d"], starts="J.omega", initial={"J.omega": 5.0}
    )
    # omega = omega_0 exp(-d t / J); relative tolerance 1e-9
    assert made.values["J.omega"] == pytest.approx(5.0 * np.exp(-1.5 * t), rel=1e-9)
    assert made["J.omega"]["J.omega"] == pytest.approx(np.exp(-1.5 * t), rel=1e-8)
    assert made["J.omega"]["bearing.d"] == pytest.approx(-5.0 * t / 2.0 * np.exp(-1.5 * t), rel=1e-8, abs=1e-12)


def test_a_start_value_counts_until_the_drive_sticks() -> None:
    net = sw.Network("stop")
    net.add(sw.Inertia("J", J=2.0), "wheel")
    net.add(sw.CoulombLoad("brake", tau=4.0), "wheel")
    t = np.array([0.5, 1.0, 3.0])  # omega = 5 - 2 t, at rest from 2.5 s on
    made = sw.studies.trajectory_sensitivities(
        net, "J.omega", t, parameters=["brake.tau"], starts="J.omega", initial={"J.omega": 5.0}
    )
    assert made["J.omega"]["J.omega"] == pytest.approx([1.0, 1.0, 0.0], abs=1e-9)
    assert made["J.omega"]["brake.tau"] == pytest.approx([-0.25, -0.5, 0.0], abs=1e-9)


def test_names_given_twice_are_one() -> None:
    net, names = sw.scenes.crane_start(), ["shaft.c", "shaft.c"]
    made = sw.studies.trajectory_sensitivities(
        net, "shaft.tau", [1.0], parameters=names, starts=["J1.omega", "J1.omega"]
    )
    assert tuple(made.parameters) == ("shaft.c", "J1.omega")
    assert tuple(sw.studies.frequency_sensitivities(net, parameters=names).parameters) == ("shaft.c",)


def test_what_is_wrong_with_times_and_names_is_said() -> None:
    net = sw.scenes.crane_start()
    with pytest.raises(sw.ParameterError, match="ascend from zero"):
        sw.studies.trajectory_sensitivities(net, "shaft.tau", [1.0, 0.5])
    with pytest.raises(sw.ParameterError, match="ascend from zero or later, and end later"):
        sw.studies.trajectory_sensitivities(net, "shaft.tau", [0.0])
    with pytest.raises(sw.ParameterError, match="5 is no name"):
        sw.studies.trajectory_sensitivities(net, "shaft.tau", [1.0], parameters=5)  # type: ignore[arg-type]
    with pytest.raises(sw.SignalError, match="No quantity is named"):
        sw.studies.trajectory_sensitivities(net, [], [1.0])
    with pytest.raises(sw.SignalError, match=r"'shaft' has:"):
        sw.studies.trajectory_sensitivities(net, "shaft.tua", [1.0])
    with pytest.raises(sw.ParameterError, match="is no state"):
        sw.studies.trajectory_sensitivities(net, "shaft.tau", [1.0], starts="motor.omega")


def test_a_start_value_moves_the_speeds_inside_a_shaft_as_well() -> None:
    net = sw.Network("shaft")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(
        sw.Shaft("line", length=2.0, diameter=0.25, density=7850.0, shear_modulus=8e10, model=sw.Lumped(4)), "a", "b"
    )
    net.add(sw.Inertia("J2", J=3.0), "b")
    t, start = np.linspace(0.0, 0.004, 5), {"J1.omega": 5.0, "line.omega_b": 1.0}
    made = sw.studies.trajectory_sensitivities(
        net, "J2.omega", t, parameters=["J1.J"], starts="J1.omega", initial=start
    )
    high, low = (
        net.simulate(0.004, initial={**start, "J1.omega": 5.0 + sign}, t_eval=t, rtol=1e-12)["J2.omega"]
        for sign in (1, -1)
    )
    # the motion is linear in its start, and known to 1e-12
    assert made["J2.omega"]["J1.omega"] == pytest.approx((high - low) / 2, abs=1e-7)
