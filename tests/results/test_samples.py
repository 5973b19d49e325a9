"""Samples that leave the library: a warning where they do not show how the motion swings, and only there."""

from __future__ import annotations

import pickle
import re
from pathlib import Path

import numpy as np
import pytest

import shaftwork as sw
from shaftwork.cli import DONE, main
from shaftwork.scenes import SCENES

pytest.importorskip("pandas")

TORQUE, J = 50.0, 0.01


def shaft(frequency: float, damping: float) -> sw.Network:
    """A torque on an inertia and a shaft to the frame: the torque swings about its level, and at most to twice it."""
    c = J * (2 * np.pi * frequency) ** 2
    net = sw.Network("shaft")
    net.add(sw.TorqueSource("push", tau=TORQUE), "a")
    net.add(sw.Inertia("J", J=J), "a")
    net.add(sw.Spring("shaft", c=c, d=2 * damping * np.sqrt(c * J)), "a", "ground")
    return net


def first_peak(damping: float) -> float:
    """Of the twist after a step: textbook overshoot."""
    return TORQUE * (1 + np.exp(-np.pi * damping / np.sqrt(1 - damping**2)))


@pytest.mark.parametrize(
    "engine", ["auto", *(pytest.param(name, marks=pytest.mark.slow) for name in ("heyoka", "scipy"))]
)
@pytest.mark.parametrize("frequency", [500.0, 513.7])
def test_a_peak_between_samples_is_told_with_a_number_of_outputs_that_show_it(engine: str, frequency: float) -> None:
    model, damping = shaft(frequency, 0.02).compile(), 0.02
    sol = model.simulate(2.0, engine=engine, t_eval=201, rtol=1e-10)
    assert sol["shaft.tau_c"].max() < 0.8 * first_peak(damping)
    with pytest.warns(sw.AccuracyWarning, match="too far apart") as caught:
        frame = sol.to_pandas("shaft.tau_c")
    assert len(frame) == 201  # the samples stay as they were asked for
    (message,) = (str(warning.message) for warning in caught)
    told = re.search(r"'shaft\.tau_c' is ([\d.]+) N\*m at t = ([\d.e-]+) s.*t_eval=(\d+)", message)
    assert told is not None
    assert float(told[1]) == pytest.approx(first_peak(damping), rel=1e-4)
    assert float(told[2]) == pytest.approx(0.5 / (frequency * np.sqrt(1 - damping**2)), rel=1e-4)
    finer = model.simulate(2.0, engine=engine, t_eval=int(told[3]), rtol=1e-10)
    assert finer.to_pandas("shaft.tau_c")["shaft.tau_c"].max() == pytest.approx(first_peak(damping), rel=0.05)


@pytest.mark.slow
def test_samples_that_reach_all_extremes_and_show_another_frequency_are_told() -> None:
    sol = shaft(513.7, 0.0).simulate(10.0)
    assert sol["shaft.tau"].max() == pytest.approx(sol.max("shaft.tau"), rel=1e-3)
    with pytest.warns(sw.AccuracyWarning, match="'shaft.tau' is"):
        sol.to_pandas("shaft.tau")


def test_all_ways_out_tell() -> None:
    pytest.importorskip("xarray")
    sol = shaft(500.0, 0.02).simulate(10.0)
    with pytest.warns(sw.AccuracyWarning):
        sol.to_pandas()
    with pytest.warns(sw.AccuracyWarning):
        sol.to_xarray("J.omega")


def test_the_command_tells_on_standard_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "shaft.toml"
    shaft(500.0, 0.02).save(file)
    command = ["run", str(file), "--t-end", "10", "--signals", "shaft.tau_c", "--out", str(tmp_path / "out")]
    assert main(command) == DONE
    assert "output times of 'shaft' are too far apart" in capsys.readouterr().err
    assert main([*command[:3], "0.05", *command[4:]]) == DONE
    assert capsys.readouterr().err == ""


@pytest.mark.slow
def test_a_shaft_of_travelling_waves_tells_of_its_stations() -> None:
    """A step runs along a shaft of 1 m in 0.3 ms; output times are thrice as far apart."""
    from shaftwork.results.extremes import warn_of_coarse_samples

    net = sw.Network("waves")
    net.add(sw.TorqueSource("push", tau=TORQUE), "a")
    net.add(sw.Inertia("J", J=1e-4), "a")
    net.add(sw.Shaft("line", length=1.0, diameter=0.02, model=sw.Wave()), "a", "ground")
    sol = net.simulate(0.05, t_eval=60)
    with pytest.warns(sw.AccuracyWarning, match=r"'line\.tau' is -?[\d.]+ N\*m at t = "):
        warn_of_coarse_samples(sol.reader, sol.t, sol.x, ["line.tau"])


def test_a_ripple_on_a_level_and_a_list_of_moments_are_nothing_to_tell() -> None:
    net = shaft(500.0, 0.02)
    sol = net.simulate(10.0)
    sol.at(np.linspace(0.0, 10.0, 20)).to_pandas()
    turning = net.simulate(10.0, initial={"shaft.tau_c": TORQUE, "J.omega": 1e-3 * TORQUE / (J * 2 * np.pi * 500.0)})
    turning.to_pandas("shaft.tau_c")


def test_samples_of_a_stored_motion_do_not_make_it_again() -> None:
    sol = shaft(500.0, 0.02).simulate(10.0)
    stored = pickle.loads(pickle.dumps(sol))  # noqa: S301 (what was made here)
    stored.to_pandas("shaft.tau_c")
    assert "dense" not in vars(stored)


@pytest.mark.slow
@pytest.mark.parametrize("name", list(SCENES))
def test_no_scene_tells_of_the_quantities_worth_looking_at(name: str) -> None:
    scene = SCENES[name]
    scene().simulate(scene.t_end).to_pandas(*scene.signals)


def test_the_first_example_has_nothing_to_tell() -> None:
    net = sw.Network("crane travel")
    net.add(sw.KlossMotor("motor", tau_k=9.6, s_k=0.25, n_sync=3000, ratio=35.5, efficiency=0.95), "rotor")
    net.add(sw.Inertia("J1", J=27.35), "rotor")
    net.add(sw.Spring("shaft", c=24206.0, d=14.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=62.5), "wheel")
    net.add(sw.CoulombLoad("load", tau=22.4), "wheel")
    sol = net.simulate(t_end=6.5)
    sol.to_pandas()
    sol.to_pandas(*sol.names)
