"""Torsional vibration on the command line, alone and in a report, says what the library says."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

import shaftwork as sw
from shaftwork.cli import DONE, WRONG_INPUT, main
from shaftwork.torsional import Section

SPEEDS = "300:900:13"
RPM = 30 / np.pi


@pytest.fixture
def train(tmp_path: Path) -> str:
    """A cylinder whose second order meets the mode of two inertias within the speeds."""
    net = sw.Network("train")
    net.add(sw.HarmonicTorque("gas", harmonics=sw.Harmonics((1.0, 2.0), (400.0, 300.0)), mean=500.0), "a")
    net.add(sw.Inertia("engine", J=5.0), "a")
    net.add(sw.Spring("shaft", c=3e4, d=20.0), "a", "b")
    net.add(sw.Inertia("propeller", J=5.0), "b")
    net.add(sw.Damper("water", d=8.0), "b", "ground")
    net.save(tmp_path / "train.toml")
    return str(tmp_path / "train.toml")


def test_the_command_prints_the_calculation_of_the_library(
    train: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    section = "shaft; diameter=0.07; design=intermediate, flange; strength=500e6"
    line = ["torsional", train, "--speeds", SPEEDS, "--cross-section", section, "--rated", "900"]
    line += ["--permissible", "shaft=1.5 kN*m"]
    assert main([*line, "--csv", str(tmp_path / "response.csv"), "--out", str(tmp_path / "out")]) == DONE
    calculation = sw.torsional_calculation(
        sw.Network.load(train),
        np.linspace(300, 900, 13) / RPM,
        sections=[Section("shaft", diameter=0.07, design="intermediate, flange", strength=500e6)],
        rated=900 / RPM,
        permissible={"shaft": 1500.0},
    )
    printed = capsys.readouterr().out
    assert str(calculation) in printed
    assert f"{calculation.modes.modes[0].frequency:.6g}" in printed
    assert f"{calculation.resonances[0].speed * RPM:.6g}" in printed
    head, *rows = csv.reader((tmp_path / "response.csv").read_text(encoding="utf-8").splitlines())
    assert head == ["shaft", "speed [1/min]", "torque [N*m]", "stress [Pa]", "tau_c [Pa]", "tau_t [Pa]"]
    assert [float(row[2]) for row in rows] == calculation["shaft"].amplitude.tolist()
    assert (tmp_path / "out" / "torsional.csv").read_text(encoding="utf-8").count("\n") == len(rows) + 1
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        *("torsional.csv", "resonances.csv", "torsional.png", "shaftwork.json"),
    }


def test_machines_read_the_same(train: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["torsional", train, "--speeds", "300,600,900", "--misfire", "gas=0.5", "--json"]) == DONE
    data = json.loads(capsys.readouterr().out)
    calculation = sw.torsional_calculation(
        sw.Network.load(train), np.array([300, 600, 900]) / RPM, misfire={"gas": 0.5}
    )
    assert data["shafts"][0]["torque"] == calculation["shaft"].amplitude.max()
    assert [one["order"] for one in data["resonances"]] == [one.order for one in calculation.resonances]
    assert data["permitted"] is None


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ([], "needs speeds of the shaft in 1/min, such as --speeds 300:900:61"),
        (["--speeds", "300:900"], "--speeds 300:900: write first:last:count in 1/min"),
        (["--speeds=-5:900:3"], "write first:last:count in 1/min"),
        (["--speeds", "300,nan"], "write first:last:count in 1/min"),
        (["--speeds", SPEEDS, "--cross-section", "shat; diameter=1"], "'shat' is no spring or shaft here"),
        (["--speeds", SPEEDS, "--cross-section", "shaft; radius=1"], "there is no 'radius'. There are: diameter, bore"),
        (["--speeds", SPEEDS, "--cross-section", "shaft; diameter"], "write name=value"),
        (["--speeds", SPEEDS, "--cross-section", "shaft; diameter=wide"], "'wide' must be a number in SI"),
        (["--speeds", SPEEDS, "--misfire", "oil"], "There are: gas"),
        (["--speeds", SPEEDS, "--permissible", "shat=3"], "permissible: 'shat' is no spring or shaft here"),
        (["--speeds", SPEEDS, "--cross-section", "shaft; design=propeller; strength=5e8"], "Give --rated, the maximum"),
        (["--speeds", SPEEDS, "--misfire", "gas=none"], "write a share from 0 to 1"),
        (["--speeds", SPEEDS, "--misfire", "gas", "--misfire", "gas"], "--misfire gives 'gas' twice"),
    ],
)
def test_a_wrong_option_is_answered_with_what_would_be_right(
    options: list[str], said: str, train: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["torsional", train, *options]) == WRONG_INPUT
    assert said in capsys.readouterr().err


def test_a_train_that_nothing_excites_by_orders_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["torsional", "crane", "--speeds", SPEEDS]) == WRONG_INPUT
    assert "'crane' has no HarmonicTorque" in capsys.readouterr().err


def test_a_report_takes_start_origins_and_speeds(train: str, tmp_path: Path) -> None:
    line = ["report", train, "--tex", "--out", str(tmp_path / "signed"), "--t-end", "0.05"]
    line += ["--initial", "engine.omega=30", "--initial", "propeller.omega=290 rpm", "--origins", "engine=drawing 4711"]
    line += ["--torsional", "--speeds", SPEEDS, "--orders", "2", "--sections", "parts,conditions,torsional,campbell"]
    assert main(line) == DONE
    text = (tmp_path / "signed" / "report.tex").read_text(encoding="utf-8")
    for part in ("drawing 4711", "engine.omega & $30$", "propeller.omega & $30.369$", "Campbell diagram", "Verdict"):
        assert part in text


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--torsional"], "needs speeds of the shaft"),
        (["--rated", "900"], "are of --torsional. Give it, too."),
        (["--initial", "engine.omega=30"], "Say with --t-end how long it is"),
        (["--origins", "motor=catalogue"], "origins: there is no part or parameter 'motor'. There are: gas, engine"),
        (["--origins", "engine"], "write name=value"),
        (["--t-end", "0.1", "--initial", "engin.omega=30"], "engine.omega"),
        (["--text", "introduction=none.md"], "'none.md' cannot be read"),
        (["--speeds", "fast"], "write first:last:count in 1/min"),
    ],
)
def test_a_wrong_option_of_a_report_is_answered(
    options: list[str], said: str, train: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["report", train, "--tex", "--out", str(tmp_path / "signed"), *options]) == WRONG_INPUT
    assert said in capsys.readouterr().err
