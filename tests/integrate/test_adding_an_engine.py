"""Whoever adds an engine writes its file and its entry in `integrate/engines.py`, and touches no third one."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from shaftwork.integrate import choice
from shaftwork.integrate.engines import ENGINES, EngineEntry, available
from shaftwork.integrate.problem import TOLERATED, UNSURPRISING
from tests.integrate import step_doubling
from tests.integrate.conftest import Case

SOURCE = Path(__file__).parents[2] / "src" / "shaftwork"
ENTRY = """    "rk4": EngineEntry(
        module="step_doubling",
        method="Runge and Kutta of order 4 with step doubling",
        suited="what is not stiff",
        explicit=True,
        finest=1e-12,  # below, the rounding of its differences is larger
        following=(1 / 30, 1e-7),
    ),
    "rk4-alone": EngineEntry(module="step_doubling", method="the same, past no guards", suited="the same"),
"""
SCRIPT = """
import contextlib, io, json, warnings

import shaftwork as sw
from docs.generate import engine_table
from shaftwork.cli import main

report = {}
crane = sw.scenes.crane_start().compile()
exact = crane.simulate(6.5, rtol=1e-12, engine="scipy")["shaft.tau"]
for rtol in (1e-4, 1e-6, 1e-8):
    sol = crane.simulate(6.5, rtol=rtol, engine="rk4")
    error = abs(sol["shaft.tau"] - exact).max() / abs(exact).max()
    report[f"crane {rtol:g}"] = [sol.engine, error, sol.energy_residual]

net = sw.Network("two masses")
net.add(sw.TorqueSource("motor", tau=sw.Step(10.0, start=0.3)), "rotor")
net.add(sw.Inertia("J1", J=2.0), "rotor")
net.add(sw.Spring("shaft", c=100.0, d=1.0), "rotor", "wheel")
net.add(sw.Inertia("J2", J=3.0), "wheel")
warnings.simplefilter("ignore")
report["linear"] = abs(net.simulate(2.0, engine="rk4-alone")["shaft.tau"] - net.simulate(2.0)["shaft.tau"]).max()
report["too fine"] = net.simulate(0.1, engine="rk4", rtol=1e-14).why


def refused(run):
    try:
        run()
    except sw.ShaftworkError as error:
        return str(error)


report["modes"] = refused(lambda: crane.simulate(1.0, engine="rk4-alone"))
report["unknown"] = refused(lambda: net.simulate(1.0, engine="rk5"))
report["steps"] = refused(lambda: net.simulate(1.0, engine="rk4", max_steps=5))
with contextlib.redirect_stdout(io.StringIO()) as said, contextlib.suppress(SystemExit):
    main(["run", "--help"])
report["help"] = " ".join(said.getvalue().split())
report["table"] = engine_table()
print(json.dumps(report))
"""


def test_an_entry_is_all_that_a_run_needs(oscillator: Case, monkeypatch: pytest.MonkeyPatch) -> None:
    """A step of the input and a jump of the state are met; the error is that of some hundred steps at rtol 1e-8."""
    monkeypatch.setitem(sys.modules, "shaftwork.integrate.step_doubling", step_doubling)
    monkeypatch.setitem(ENGINES, "rk4", EngineEntry(module="step_doubling", method="", suited=""))
    trajectory, name, _ = choice.solve(oscillator.problem, "rk4")
    assert name == "rk4"
    np.testing.assert_allclose(trajectory.x, oscillator.solution(trajectory.t), rtol=0, atol=1e-6)


def test_auto_asks_an_engine_for_special_systems_whether_it_suits(
    oscillator: Case, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "shaftwork.integrate.step_doubling", step_doubling)
    monkeypatch.setattr(step_doubling, "suits", lambda problem: f"It has {problem.x0.size} states.", raising=False)
    problem = replace(oscillator.problem, linear=None)
    for asked_beyond, engine in ((1, "rk4"), (2, "heyoka" if available("heyoka") else "scipy")):
        entry = EngineEntry(module="step_doubling", method="", suited="", special=True, asked_beyond=asked_beyond)
        monkeypatch.setitem(ENGINES, "rk4", entry)
        assert choice.choose(problem)[0] == engine


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What a copy of the package says and does that has the engine and its entry, and no other change."""
    folder = tmp_path_factory.mktemp("newcomer")
    rooms = folder / "shaftwork" / "integrate"
    rooms.mkdir(parents=True)
    for where in (SOURCE, SOURCE / "integrate"):
        for item in where.iterdir():
            if item.name not in ("integrate", "engines.py", "__pycache__"):
                (folder / "shaftwork" / item.relative_to(SOURCE)).symlink_to(item)
    (rooms / "step_doubling.py").symlink_to(Path(__file__).with_name("step_doubling.py"))
    table = (SOURCE / "integrate" / "engines.py").read_text(encoding="utf-8")
    for before, added in (('"wave"]', '"rk4", "rk4-alone", '), ('    "wave": EngineEntry(', ENTRY)):
        assert table.count(before) == 1
        table = table.replace(before, added + before)
    (rooms / "engines.py").write_text(table, encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join((str(folder), str(SOURCE.parents[1])))}
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT], env=environment, capture_output=True, text=True, check=False, cwd=folder
    )
    assert done.returncode == 0, done.stderr
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


@pytest.mark.slow
@pytest.mark.parametrize("rtol", ["0.0001", "1e-06", "1e-08"])
def test_the_engine_runs_the_crane_to_its_tolerance(report: dict[str, Any], rtol: str) -> None:
    """Its guards are met, and errors of steps add up to less than the hundredfold that the library tolerates."""
    engine, error, residual = report[f"crane {rtol}"]
    assert engine == "rk4"
    assert error < TOLERATED * float(rtol)
    assert residual < max(TOLERATED * float(rtol), UNSURPRISING)


@pytest.mark.slow
def test_a_finer_tolerance_gives_a_smaller_error(report: dict[str, Any]) -> None:
    errors = [report[f"crane {rtol}"][1] for rtol in ("0.0001", "1e-06", "1e-08")]
    assert errors == sorted(errors, reverse=True)


@pytest.mark.slow
def test_it_stops_at_breakpoints_and_agrees_with_the_exact_engine(report: dict[str, Any]) -> None:
    assert report["linear"] < TOLERATED * 1e-8 * 10.0  # of the motor's torque, at the usual tolerance


@pytest.mark.slow
def test_where_parts_change_their_mode_it_is_refused_unless_its_entry_says_that_it_follows_guards(
    report: dict[str, Any],
) -> None:
    assert report["modes"] == (
        "The engine 'rk4-alone' follows no parts that change their mode (load). "
        "Take one of: heyoka, numba, rk4, scipy, scipy-radau, sundials."
    )


@pytest.mark.slow
def test_it_is_in_every_list_of_engines(report: dict[str, Any]) -> None:
    assert "scipy-radau, banded, rk4, rk4-alone." in report["unknown"]
    assert "banded, rk4, rk4-alone, wave" in report["help"]
    assert "| `rk4` | Runge and Kutta of order 4 with step doubling |  | what is not stiff |" in report["table"]


@pytest.mark.slow
def test_its_limits_are_kept_and_told(report: dict[str, Any]) -> None:
    assert "finer than the engine 'rk4' can keep: the run is made with 1e-12" in report["too fine"]
    assert report["steps"].startswith("The rk4 engine failed at t = ")
    assert "5 steps were not enough" in report["steps"]
