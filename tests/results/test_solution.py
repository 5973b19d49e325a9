"""What can be asked of a motion: quantities, energy, tables, curves."""

from __future__ import annotations

import builtins
import copy
import pickle
from typing import Any

import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.scenes import SCENES


@pytest.fixture(scope="module")
def sol() -> sw.Solution:
    return sw.scenes.crane_start().simulate(t_end=2.0, t_eval=201)


def test_every_quantity_has_a_value_at_every_time_and_a_unit(sol: sw.Solution) -> None:
    assert set(sol) == set(sol.names)
    for name in sol.names:
        assert sol[name].shape == sol.t.shape
        assert np.isfinite(sol[name]).all()
        assert sol.observer.units[name]
    assert "shaft.tau" in sol
    assert "shaft.length" not in sol


def test_a_quantity_that_does_not_exist_is_answered_with_those_that_do(sol: sw.Solution) -> None:
    with pytest.raises(sw.SignalError, match=r"'shaft' has: .*shaft\.tau"):
        sol["shaft.torque"]
    with pytest.raises(sw.SignalError, match="shaft"):
        sol["shaf.tau"]
    with pytest.raises(sw.SignalError, match=r"angles=\['J2'\]"):
        sol["J2.phi"]


@pytest.mark.parametrize("name", [3, None, ["shaft.tau"], ("J1", "omega")], ids=repr)
def test_what_is_no_name_is_answered_with_names(sol: sw.Solution, name: Any) -> None:
    for ask in (sol.__getitem__, sol.plot, sol.to_pandas, sol.to_xarray):
        with pytest.raises(sw.SignalError, match=r"is no name of a quantity\. 'crane start.*' has .*J1\.omega"):
            ask(name)
    assert name not in sol


@pytest.mark.parametrize("times", ["a", ["a"], [], [[0.5], [1.0]], {}], ids=repr)
def test_what_are_no_times_is_answered_with_the_span(sol: sw.Solution, times: Any) -> None:
    with pytest.raises(sw.SignalError, match=r"is no list of times\. Give times in s from 0 to 2"):
        sol.at(times)


def test_twist_is_torque_over_stiffness_and_node_speeds_are_part_speeds(sol: sw.Solution) -> None:
    assert sol["shaft.phi_rel"] == pytest.approx(sol["shaft.tau_c"] / 24206.0)
    assert sol["wheel.omega"] == pytest.approx(sol["J2.omega"])
    assert sol["shaft.tau"] == pytest.approx(sol["shaft.tau_c"] + 14.0 * sol["shaft.omega_rel"])


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_a_state_is_the_quantity_of_its_name_as_it_follows_from_the_equations(name: str) -> None:
    found = SCENES[name].build().compile().simulate(t_end=0.2, t_eval=21)
    for state in found.states:
        assert np.array_equal(found[state], found.x[:, found.states.index(state)])
        if state in found:
            again = found.observer.signal(state, found.t, found.x, found.dense)
            # recovered through trees and loops: rounding
            np.testing.assert_allclose(again, found[state], rtol=1e-12, atol=1e-12 * np.abs(found[state]).max())


def test_energy_is_supplied_stored_and_lost(sol: sw.Solution) -> None:
    balance = sol.energy
    assert sol.energy_residual < 1e-10
    stored = sol["J1.energy"] + sol["J2.energy"] + sol["shaft.energy"]
    assert balance.stored[-1] == pytest.approx(stored[-1], rel=1e-9)
    assert balance.supplied[-1] > balance.lost[-1] > 0
    assert balance.work >= balance.supplied[-1] * (1 - 1e-12)  # the same sum, rounded in another order


def test_power_at_the_ports_sums_to_zero(sol: sw.Solution) -> None:
    powers = np.array([sol[f"{name}.power"] for name in ("motor", "J1", "shaft", "J2", "load")])
    assert np.abs(powers.sum(axis=0)).max() < 1e-12 * np.abs(powers).max()


def test_other_times_come_from_the_dense_output_and_outside_times_are_refused(sol: sw.Solution) -> None:
    assert sol.at([0.5])["shaft.tau"][0] == pytest.approx(sol["shaft.tau"][50], rel=1e-8)
    with pytest.raises(sw.SignalError, match="from t = 0 s to 2 s"):
        sol.at([2.5])


def test_times_and_states_cannot_be_written_to(sol: sw.Solution) -> None:
    stored = pickle.loads(pickle.dumps(sol))  # noqa: S301 (our own bytes)
    for motion in (sol, sol.at([0.5, 1.0]), copy.copy(sol), copy.deepcopy(sol), stored):
        for values in (motion.t, motion.x, motion.steps):
            with pytest.raises(ValueError, match="read-only"):
                values[-1] = 99.0


def test_what_a_user_changes_later_changes_no_motion() -> None:
    """Neither the output times that were given, nor arrays that were read, as those converted to 1/min in place."""
    net, times = sw.Network("spring"), np.linspace(0.0, 1.0, 11)
    net.add(sw.TorqueSource("T", tau=1.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Spring("s", c=10.0), "a", "b")
    net.add(sw.Inertia("K", J=1.0), "b")
    sol = net.simulate(1.0, t_eval=times)
    times[-1] = 0.5
    assert sol.t[-1] == 1.0
    for name in sol.names:
        first = sol[name]
        before = first.copy()
        first *= 30.0 / np.pi
        assert np.array_equal(sol[name], before), name


def test_a_torque_that_is_none_is_no_negative_zero() -> None:
    net = sw.Network("free")
    net.add(sw.TorqueSource("T", tau=0.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    assert not np.signbit(net.simulate(1.0, t_eval=3, initial={"J.omega": 1.0})["T.tau"]).any()


def test_tables_hold_the_named_quantities_with_units(sol: sw.Solution) -> None:
    frame = sol.to_pandas("shaft.tau", "J2.omega")
    assert list(frame.columns) == ["shaft.tau", "J2.omega"]
    assert frame.index.name == "t"
    data = sol.to_xarray()
    assert set(data.data_vars) == set(sol.names)
    assert data["shaft.tau"].attrs["units"] == "N*m"
    assert data.attrs["engine"] == sol.engine


def test_tables_hold_a_quantity_along_a_shaft_at_each_of_its_places() -> None:
    net = sw.Network("line")
    net.add(sw.TorqueSource("motor", tau=5.0), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    shaft = sw.Shaft("line", length=1.0, diameter=0.02, density=7900.0, shear_modulus=77.5e9, model=sw.Lumped(4))
    net.add(shaft, "a", "b")
    net.add(sw.Inertia("J2", J=1.0), "b")
    line = net.simulate(0.01, t_eval=11)
    frame = line.to_pandas("line.tau", "J1.omega")
    assert list(frame.columns) == [*(f"line.tau at {place:g} m" for place in line.places["line.tau"]), "J1.omega"]
    np.testing.assert_array_equal(frame.to_numpy()[:, :-1], line["line.tau"])
    data = line.to_xarray("line.tau", "J1.omega")
    assert data["line.tau"].dims == ("t", "line.tau.x")
    assert data["line.tau"].attrs["units"] == "N*m"
    np.testing.assert_array_equal(data["line.tau.x"], line.places["line.tau"])
    np.testing.assert_array_equal(data["line.tau"], line["line.tau"])
    assert data["J1.omega"].dims == ("t",)


def test_curves_share_an_axis_by_unit(sol: sw.Solution) -> None:
    figure = sol.plot("shaft.tau", "motor.tau", "J2.omega")
    assert [axis.get_ylabel() for axis in figure.axes] == ["N*m", "rad/s", ""]  # the last one shows the phases
    assert [len(axis.get_legend().get_texts()) for axis in figure.axes[:2]] == [2, 1]
    assert sol.plot().axes
    with pytest.raises(sw.SignalError):
        sol.plot("shaft.torque")


def test_a_missing_library_is_named_with_the_extra_that_brings_it(
    sol: sw.Solution, monkeypatch: pytest.MonkeyPatch
) -> None:
    real = builtins.__import__

    def absent(name: str, *args: Any, **kwargs: Any) -> Any:
        if name.split(".", 1)[0] in ("matplotlib", "pandas", "xarray"):
            raise ImportError(name)
        return real(name, *args, **kwargs)

    monkeypatch.setattr(builtins, "__import__", absent)
    for name in ("pandas", "xarray"):
        monkeypatch.setitem(__import__("sys").modules, name, None)
    with pytest.raises(sw.MissingExtraError, match=r"shaftwork\[plot\]"):
        sol.plot()
    with pytest.raises(sw.MissingExtraError, match=r"shaftwork\[data\]"):
        sol.to_pandas()
    with pytest.raises(sw.MissingExtraError, match=r"shaftwork\[data\]"):
        sol.to_xarray()


def test_a_solution_says_what_it_is(sol: sw.Solution) -> None:
    assert "crane start" in repr(sol)
    assert sol.engine in repr(sol)
    assert sol.events == ((pytest.approx(0.0139, abs=1e-4), "load", "stuck", "slipping forward"),)
    assert [row.name for row in sol.phases] == ["load stuck", "load slipping forward"]


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("J1", "'J1' has: J1.omega, J1.tau, J1.power, J1.energy."),
        ("rotor", "'rotor' has: rotor.omega."),
        ("J1.tua", "'J1' has: J1.omega"),
        ("J11", "There is no part or node 'J11'. Close to it: J1"),
        ("J11.omega", "There is no part or node 'J11'. Close to it: J1"),
    ],
)
def test_a_wrong_name_is_answered_with_what_the_part_has(name: str, words: str) -> None:
    net = sw.Network("two masses")
    net.add(sw.TorqueSource("motor", tau=10.0), "rotor")
    net.add(sw.Inertia("J1", J=2.0), "rotor")
    net.add(sw.Spring("shaft", c=1e4, d=1.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=3.0), "wheel")
    sol, modes = net.simulate(t_end=0.1), net.modes()
    for read in (
        lambda: sol[name],
        lambda: sol.plot(name),
        lambda: sol.to_pandas(name),
        lambda: modes.shapes[name],
        lambda: sw.studies.sweep(net, {"shaft.c": [1e4, 2e4]}, t_end=0.1, measures=[f"max {name}"]),
    ):
        with pytest.raises(sw.SignalError) as caught:
            read()
        assert f"No quantity '{name}' in 'two masses" in str(caught.value)
        assert words.removesuffix(".") in str(caught.value)


def test_a_part_is_read_with_the_values_of_its_motion_and_one_that_is_none_is_named() -> None:
    net = sw.Network("one")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.TorqueSource("motor", tau=1.0), "a")
    sol = net.compile().simulate(0.1, parameters={"J1.J": 3.0})
    assert sol.observer.part("J1").J == 3.0
    with pytest.raises(sw.SignalError, match=r"There is no part 'J9' in 'one'\. There are: J1, motor"):
        sol.observer.part("J9")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("speed", "first"),
    [
        (sympy.sqrt(sw.t**3), 0.0),
        (sympy.sqrt(sw.t**3) + sw.t, 2.0),
        (sw.t ** sympy.Rational(5, 4), 0.0),
        (sympy.sqrt(sw.t**3) - 3 * sw.t, -6.0),
    ],
    ids=str,
)
def test_a_quantity_that_is_0_over_0_at_the_start_is_what_it_goes_to(speed: sympy.Expr, first: float) -> None:
    """The torque of 2 kg m^2 is twice the slope of the speed, and sqrt(t^3) has 3 t^2 / (2 sqrt(t^3))."""
    net = sw.Network("led")
    net.add(sw.SpeedSource("lead", omega=speed), "a")
    net.add(sw.Inertia("J", J=2.0), "a")
    sol = net.simulate(1.0)
    assert sol["lead.tau"][0] == pytest.approx(first, rel=1e-7, abs=1e-12)
    assert sol.min("lead.tau") == pytest.approx(first, rel=1e-7, abs=1e-12)
