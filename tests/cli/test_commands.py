"""Modes, interference diagram, sweep and export on the command line say what the library says."""

from __future__ import annotations

import csv
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shaftwork as sw
from shaftwork.cli import DONE, FAILED, INTERRUPTED, WRONG_INPUT, main


@pytest.fixture
def model(tmp_path: Path) -> str:
    """Two inertias on a spring with a damper: rigid body and one mode."""
    net = sw.Network("pair")
    net.add(sw.TorqueSource("pull", tau=1.0), "a")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Spring("shaft", c=1e4, d=2.0), "a", "b")
    net.add(sw.Inertia("J2", J=3.0), "b")
    net.add(sw.Damper("loss", d=0.1), "b", "ground")
    net.save(tmp_path / "pair.toml")
    return str(tmp_path / "pair.toml")


def rows(path: Path) -> list[list[str]]:
    return list(csv.reader(path.read_text(encoding="utf-8").splitlines()))


def test_modes_are_those_of_the_library(model: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, modes = tmp_path / "out", sw.Network.load(model).modes()
    assert main(["modes", model, "--out", str(out)]) == DONE
    assert capsys.readouterr().out.startswith(f"{modes}\n")
    written = rows(out / "modes.csv")
    assert written[0][:3] == ["mode", "frequency [Hz]", "damping"]
    assert [float(row[1]) for row in written[1:]] == modes.frequencies.tolist()
    assert (out / "modes.png").stat().st_size > 5_000
    assert main(["modes", model, "--json", "--count", "1"]) == DONE
    assert len(json.loads(capsys.readouterr().out)["modes"]) == 1


def test_modes_about_a_point(capsys: pytest.CaptureFixture[str]) -> None:
    """In motion the load of the crane slips, and both inertias swing against each other."""
    found = {}
    for point in ((), ("--steady",), ("--at", "J1.omega=8.5", "--at", "J2.omega=8.5")):
        assert main(["modes", "crane-start", "--json", *point]) == DONE
        found[point] = max(mode["frequency"] for mode in json.loads(capsys.readouterr().out)["modes"])
    rest, steady, turning = found.values()
    assert rest == pytest.approx(4.7348, rel=1e-4)  # as `check` prints it
    assert steady == pytest.approx(5.677, rel=1e-3)
    assert turning == pytest.approx(5.677, rel=1e-3)
    assert main(["modes", "crane-start", "--steady", "--at", "J1.omega=1"]) == WRONG_INPUT
    assert main(["modes", "crane-start", "--at", "J1.omega=fast"]) == WRONG_INPUT
    assert "'fast' must be a number in SI" in capsys.readouterr().err
    assert main(["modes", "crane-start", "--at", "J1.omega=1", "--at", "J1.omega=2"]) == WRONG_INPUT
    assert "--at gives 'J1.omega' twice" in capsys.readouterr().err


def test_a_speed_of_a_point_may_have_its_unit(capsys: pytest.CaptureFixture[str]) -> None:
    """30 rpm are pi rad/s; Hz is refused, which may count revolutions or radians."""
    pytest.importorskip("pint")
    found = []
    for speed in ("30 rpm", str(np.pi)):
        point = ("--at", f"J1.omega={speed}", "--at", f"J2.omega={speed}")
        assert main(["modes", "crane-start", "--json", *point]) == DONE
        found.append([mode["frequency"] for mode in json.loads(capsys.readouterr().out)["modes"]])
    assert found[0] == pytest.approx(found[1], rel=1e-12)
    assert main(["modes", "crane-start", "--at", "J1.omega=2 Hz"]) == WRONG_INPUT
    assert "may count revolutions or radians" in capsys.readouterr().err


@pytest.mark.slow
def test_the_diagram_has_its_crossings_in_turns(model: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    arguments = ["campbell", model, "--n-max", "2000", "--orders", "1,2"]
    assert main([*arguments, "--out", str(out), "--json"]) == DONE
    crossings = json.loads(capsys.readouterr().out)["crossings"]
    (f,) = sw.Network.load(model).modes().frequencies[1:]
    assert [(made["order"], made["n"]) for made in crossings] == [
        (order, pytest.approx(60 * f / order, rel=1e-9)) for order in (2.0, 1.0)
    ]
    assert [float(row[0]) for row in rows(out / "campbell.csv")[1:]] == [made["n"] for made in crossings]
    assert (out / "campbell.png").stat().st_size > 5_000
    with pytest.raises(SystemExit):
        main(["campbell", model, "--n-max", "100", "--orders", "one"])
    assert "'one' must be numbers with commas between them" in capsys.readouterr().err


@pytest.mark.slow
def test_a_sweep_is_that_of_the_library(model: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "out"
    arguments = ["sweep", model, "--t-end", "0.2", "--vary", "shaft.c=5e3:2e4:4", "--vary", "J2.J=1, 3"]
    limit = ["--measure", "max shaft.tau", "--measure", "end J2.omega", "--require", "max shaft.tau<=0.9"]
    assert main([*arguments, *limit, "--out", str(out), "--json"]) == DONE
    found = json.loads(capsys.readouterr().out)["columns"]
    made = sw.studies.sweep(
        sw.Network.load(model),
        {"shaft.c": np.linspace(5e3, 2e4, 4), "J2.J": [1.0, 3.0]},
        t_end=0.2,
        measures=["max shaft.tau", "end J2.omega"],
        require={"max shaft.tau": (None, 0.9)},
    )
    assert found == {name: column.tolist() for name, column in made.columns.items()}
    assert len(rows(out / "sweep.csv")) == 9
    assert set(found["passed"]) == {True, False}


@pytest.mark.parametrize(
    ("option", "words"),
    [
        (("--vary", "shaft.c=1:2"), "write first:last:count"),
        (("--vary", "shaft.c=1:2:one"), "write first:last:count"),
        (("--vary", "shaft.c=1:2:\N{SUPERSCRIPT TWO}"), "write first:last:count"),
        (("--vary", "shaft.c=1:2:99999999999"), "a count from 2 to 1000000"),
        (("--vary", "shaft.c=1:2:9999", "--vary", "J1.J=1:2:9999"), "has 99980001 variants, more than 10000000"),
        (("--vary", "shaft.c=-1:2:3"), "shaft.c must be"),
        (("--vary", "shaft.k=1,2"), "There is no parameter 'shaft.k'"),
        (("--vary", "shaft.c"), "such as --vary shaft.c=2e4,3e4"),
        (("--vary", "shaft.c=1,2", "--vary", "shaft.c=3,4"), "--vary gives 'shaft.c' twice"),
        (("--vary", "shaft.c=1,2", "--set", "shaft.c=3"), "so --set shaft.c=... has no effect. Leave it out"),
        (("--vary", "shaft.c=1,2", "--require", "max shaft.tau<300 N"), "write 'max shaft.tau<=300'"),
        (("--vary", "shaft.c=1,2", "--require", "max shaft.tau<=1 kN*m"), "a number in the SI unit of the measure"),
        (("--vary", "shaft.c=1,2", "--require", "3<=max shaft.tau<=4"), "Two limits are two --require"),
        (
            ("--vary", "shaft.c=1,2", "--require", "max shaft.tau<=3", "--require", "max shaft.tau<=4"),
            "--require gives 'max shaft.tau<=' twice",
        ),
        (("--vary", "shaft.c=1,2", "--require", "min shaft.tau<=300"), "there is no measure 'min shaft.tau'"),
    ],
)
def test_a_wrong_sweep_is_answered_with_what_would_be_right(
    option: tuple[str, ...], words: str, model: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["sweep", model, "--measure", "max shaft.tau", *option]) == WRONG_INPUT
    assert words in capsys.readouterr().err


@pytest.mark.parametrize("speeds", [("--n-max", "inf"), ("--n-max", "0"), ("--n-min", "-5", "--n-max", "10")])
def test_speeds_that_make_no_diagram_are_refused_before_anything_is_computed(
    speeds: tuple[str, ...], model: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sw.Network, "compile", None)
    assert main(["campbell", model, *speeds]) == WRONG_INPUT
    assert "give two speeds in 1/min, the lower one 0 or more" in capsys.readouterr().err


@pytest.mark.parametrize(
    "point",
    [
        ("--steady",),
        ("--at", "J1.omega=0"),
        pytest.param(("--at", "J1.omega=n", "--at", "J2.omega=n"), marks=pytest.mark.slow),
    ],
)
def test_a_diagram_without_its_point_names_options_that_work(
    point: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["campbell", "crane-start", "--n-max", "3000"]) == WRONG_INPUT
    assert " ".join(point) in capsys.readouterr().err
    assert main(["campbell", "crane-start", "--n-max", "3000", *point]) == DONE


@pytest.mark.slow
def test_the_options_that_a_refused_diagram_names_give_that_of_the_running_drive(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Word for word: the inertias at both ends of a shaft, and nothing inside it."""
    net = sw.Network("pump")
    net.add(sw.TableMotor("motor", curve=sw.Table([0, 1400, 1500], [200, 250, 0])), "m")
    net.add(sw.Inertia("JM", J=0.5), "m")
    shaft = {"length": 2.0, "diameter": 0.04, "density": 7900.0, "shear_modulus": 77.5e9}
    net.add(sw.Shaft("line", **shaft, model=sw.Lumped(4)), "m", "p")
    net.add(sw.Inertia("JP", J=0.8), "p")
    net.add(sw.PumpLoad("pump", tau_n=100, n_n=1450), "p")
    path = tmp_path / "pump.toml"
    net.save(path)
    arguments = ["campbell", str(path), "--n-max", "1500", "--orders", "3", "--f-max", "60"]
    assert main(arguments) == WRONG_INPUT
    message = capsys.readouterr().err
    assert "--at JM.omega=n --at JP.omega=n;" in message
    assert "lambda" not in message
    assert main([*arguments, "--at", "JM.omega=n", "--at", "JP.omega=n", "--json"]) == DONE
    (crossing,) = json.loads(capsys.readouterr().out)["crossings"]
    point = {"JM.omega": crossing["speed"], "JP.omega": crossing["speed"]}
    assert crossing["frequency"] == pytest.approx(net.modes(point, f_max=60.0).frequencies[-1], rel=1e-9)
    assert main([*arguments, "--at", "JM.omega=n"]) == DONE
    assert "warning: The point of 'pump' gives some speeds and leaves 'JP.omega' at 0" in capsys.readouterr().err


@pytest.mark.slow
def test_a_diagram_may_have_a_point_for_each_speed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A spring that stiffens with the twist, and a gear in between: n at the motor is n / 2 behind it."""
    net = sw.Network("stiffening")
    net.add(sw.KlossMotor("motor", tau_k=300.0, s_k=0.3, n_sync=3000.0), "a")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Spring("shaft", c=1e4), "a", "b")
    net.add(sw.Gear("gear", ratio=2.0), "b", "c")
    net.add(sw.Inertia("J2", J=3.0), "c")
    net.add(sw.FanLoad("fan", tau_n=100.0, n_n=1500.0), "c")
    path = tmp_path / "stiffening.toml"
    net.save(path)
    arguments = ["campbell", str(path), "--n-max", "3000", "--orders", "1,2", "--json"]
    assert main([*arguments, "--at", "J1.omega=n", "--at", "J2.omega = 1*n/2"]) == DONE
    found = json.loads(capsys.readouterr().out)["crossings"]
    wanted = net.campbell(
        np.linspace(0.0, 100 * np.pi, 61), (1, 2), at=lambda n: {"J1.omega": n, "J2.omega": n / 2}
    ).crossings
    assert [made["speed"] for made in found] == [made.speed for made in wanted]
    assert found


@pytest.mark.parametrize("value", ["m", "n/0", "n*2", "2 n/3"])
def test_a_point_of_a_diagram_is_a_multiple_of_its_speed(
    value: str, model: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (
        main(["campbell", model, "--n-max", "3000", "--at", "J2.omega=n", "--at", f"J1.omega={value}"]) == WRONG_INPUT
    )
    assert "J1.omega=" in capsys.readouterr().err
    assert main(["campbell", model, "--n-max", "3000", "--at", "J2.omega=n", "--steady"]) == WRONG_INPUT
    assert "--steady and --at both name a point" in capsys.readouterr().err
    assert main(["modes", model, "--at", "J1.omega=n"]) == WRONG_INPUT
    assert "'n' must be a number in SI, or one with its unit" in capsys.readouterr().err


@pytest.mark.slow
def test_a_sweep_that_is_interrupted_goes_on_from_its_store(
    model: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from shaftwork.sweep.sweep_store import Store

    store, done = tmp_path / "store", []
    append = Store.append

    def interrupted(self: Store, chunk: object) -> None:
        append(self, chunk)  # type: ignore[arg-type]
        done.append(chunk)
        raise KeyboardInterrupt

    arguments = ["sweep", model, "--t-end", "0.01", "--vary", "J2.J=1:2:3000", "--measure", "max shaft.tau"]
    arguments += ["--store", str(store), "--json"]
    monkeypatch.setattr(Store, "append", interrupted)
    assert main(arguments) == INTERRUPTED
    assert f"interrupted: what is done is in {store}; the same command" in capsys.readouterr().err
    size = store.stat().st_size
    monkeypatch.setattr(Store, "append", append)
    assert main(arguments) == DONE
    assert len(json.loads(capsys.readouterr().out)["columns"]["J2.J"]) == 3000
    assert store.stat().st_size >= size


@pytest.mark.filterwarnings("ignore::shaftwork.NetworkWarning")  # two scenes have a curve that is worth one
@pytest.mark.parametrize("name", list(sw.scenes.SCENES))
def test_the_model_file_of_a_scene_is_the_scene(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "scene.toml"
    assert main(["export", name, str(path)]) == DONE
    assert sw.Network.load(path).netlist() == sw.scenes.SCENES[name]().netlist()
    capsys.readouterr()
    assert main(["export", name]) == DONE
    assert capsys.readouterr().out == path.read_text(encoding="utf-8")


def test_the_end_of_a_scene_is_told_where_it_is_exported_and_its_absence_where_it_runs(
    model: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The scene ends after 0.2 s, and a model file runs for 10 s."""
    path = str(tmp_path / "chain.toml")
    assert main(["export", "shaft-chain", path]) == DONE
    line = capsys.readouterr().err.rstrip().partition("For the motion of the scene: shaftwork ")[2].split()
    assert line == ["run", path, "--t-end", "0.2"]
    assert main(["run", model]) == DONE
    assert capsys.readouterr().out.startswith("pair: 10 s of motion (a model file has no end time; --t-end sets it)\n")
    assert main(["export", "shaft-chain"]) == DONE
    assert capsys.readouterr().err.rstrip().endswith("shaftwork run FILE.toml --t-end 0.2")
    assert main(["export", path]) == DONE
    assert capsys.readouterr().err == ""


def test_export_writes_over_nothing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "mine.toml"
    path.write_text("mine", encoding="utf-8")
    assert main(["export", "crane-start", str(path)]) == WRONG_INPUT
    assert "exists already" in capsys.readouterr().err
    assert path.read_text(encoding="utf-8") == "mine"
    edited = tmp_path / "main.c"
    edited.write_text("mine", encoding="utf-8")
    for option, place, file in (
        ("--c", tmp_path, edited),
        *((one, path, path) for one in ("--spice", "--modelica", "--fmu")),
    ):
        assert main(["export", "crane-start", option, str(place)]) == WRONG_INPUT
        assert f"'{file}' exists already. Give another name, or write over it by --replace." in capsys.readouterr().err
        assert file.read_text(encoding="utf-8") == "mine"
    assert main(["export", "crane-start", "--spice", str(path), "--replace"]) == DONE
    assert ".tran" in path.read_text(encoding="utf-8")
    assert main(["export", "crane-start", str(tmp_path / "crane.txt")]) == WRONG_INPUT
    assert "must end in .toml" in capsys.readouterr().err


def test_a_folder_that_does_not_exist_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "nowhere"
    assert main(["export", "crane-start", str(folder / "x.toml")]) == WRONG_INPUT
    said = f"{folder / 'x.toml'} cannot be written: there is no folder '{folder}'. Give the path of a file in a folder"
    assert said in capsys.readouterr().err


def test_signals_are_chosen_and_angles_recorded(model: str, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["run", model, "--t-end", "0.5", "--signals", "shaft.tau,J1.phi", "--signals", "loss.power"]
    assert main(arguments) == DONE
    lines = capsys.readouterr().out.splitlines()
    table = lines[next(k for k, line in enumerate(lines) if "minimum" in line) + 1 :]
    assert [line.split()[0] for line in table] == ["shaft.tau", "J1.phi", "loss.power"]


@pytest.mark.slow
def test_a_run_that_writes_says_what_it_has_written(
    model: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["run", model, "--t-end", "0.01", "--out", str(out)]) == DONE
    said = capsys.readouterr().out.splitlines()[-1]
    assert said.startswith("written: ")
    assert str(out / "signals.csv") in said.removeprefix("written: ").split(", ")


@pytest.mark.parametrize(
    ("name", "words"),
    [("shaft.tua", "'shaft' has: shaft.tau"), ("shaft", "'shaft' has: shaft.tau"), ("axle.phi", "part or node 'axle'")],
)
def test_a_signal_that_does_not_exist_is_refused_before_the_run(
    name: str, words: str, model: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from shaftwork.pipeline.model import Model

    monkeypatch.setattr(Model, "simulate", None)  # a run would call it
    assert main(["run", model, "--signals", name]) == WRONG_INPUT
    assert words in capsys.readouterr().err


@pytest.mark.slow
def test_a_model_without_a_steady_operation_ends_with_1(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    net = sw.Network("free")
    net.add(sw.TorqueSource("pull", tau=1.0), "a")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.save(tmp_path / "free.toml")
    assert main(["modes", str(tmp_path / "free.toml"), "--steady"]) == FAILED
    assert "shaftwork: " in capsys.readouterr().err


def test_a_run_is_told_to_machines_as_to_people(model: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", model, "--t-end", "0.5", "--json", "--signals", "shaft.tau"]) == DONE
    said = json.loads(capsys.readouterr().out)
    sol = sw.Network.load(model).simulate(0.5)
    assert (said["network"], said["t_end"], said["engine"], said["why"]) == ("pair", 0.5, sol.engine, sol.why)
    (row,) = said["signals"].values()
    assert row["unit"] == "N*m"
    for side, extreme in (("minimum", sol.min("shaft.tau")), ("maximum", sol.max("shaft.tau"))):
        assert row[side] == {"value": float(extreme), "t": extreme.t, "place": None}
    assert row["end"] == pytest.approx(sol["shaft.tau"][-1], rel=1e-9, abs=1e-12)
    assert said["phases"] == said["events"] == []


def test_phases_and_events_are_told_to_machines(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "crane-start", "--t-end", "0.5", "--json"]) == DONE
    said = json.loads(capsys.readouterr().out)
    sol = sw.scenes.crane_start().simulate(0.5)
    assert [row["modes"] for row in said["phases"]] == [dict(row.modes) for row in sol.phases]
    assert [tuple(event.values()) for event in said["events"]] == list(sol.events)


@pytest.mark.slow
def test_a_quantity_along_a_shaft_is_a_column_for_each_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    arguments = ["run", "shaft-step", "--t-end", "0.05", "--signals", "line.tau", "--out", str(out), "--json"]
    assert main(arguments) == DONE
    assert json.loads(capsys.readouterr().out)["signals"]["line.tau"]["maximum"]["place"] > 0
    head, *table = rows(out / "signals.csv")
    sol = sw.scenes.shaft_step().simulate(0.05)
    places = sol.places["line.tau"]
    assert head == ["t [s]", *(f"line.tau at {place:g} m [N*m]" for place in places)]
    assert np.array(table, dtype=float)[:, 1:] == pytest.approx(sol["line.tau"], rel=1e-9, abs=1e-9)


def test_a_comparison_that_is_interrupted_has_told_what_was_done(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(_net: sw.Network, shaft: str, *, report: Any, **_options: Any) -> None:
        assert shaft == "line"
        report(sw.studies.Trial("Lumped(m=5)", "scipy", 11, 0.1, 0.01, {"tau_a": 1e-3, "tau_b": 1e-3}))
        raise KeyboardInterrupt

    monkeypatch.setattr(sw.studies, "work_precision", interrupted)
    assert main(["compare", "shaft-step", "--out", str(tmp_path)]) == INTERRUPTED
    lines = capsys.readouterr().err.splitlines()
    assert lines[-2] == "Lumped(m=5) on scipy: 10 ms, end torques to 0.001"
    assert lines[-1] == "shaftwork: interrupted: 1 models are done, as told above; nothing was written"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
@pytest.mark.parametrize("out", [True, False])
def test_a_comparison_is_written_as_a_table_and_a_picture(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], *, out: bool
) -> None:
    trials = tuple(
        sw.studies.Trial(f"Lumped(m={m})", "scipy", m, 0.1, 0.01, {"tau_a": 1 / m, "tau_b": 1 / m}) for m in (5, 10)
    )
    made = sw.studies.WorkPrecision("train", "line", trials, ("characteristics", 1e-12))
    monkeypatch.setattr(sw.studies, "work_precision", lambda *_, **__: made)
    folder = tmp_path / "out"
    assert main(["compare", "shaft-step", *(["--out", str(folder)] if out else [])]) == DONE
    assert made.advice in capsys.readouterr().out
    names = {place.name for place in folder.iterdir()} if out else set()
    assert names == ({"shaftwork.json", "torques.png", "work-precision.csv", "work-precision.png"} if out else set())
    assert not out or "Lumped(m=10)" in (folder / "work-precision.csv").read_text("utf-8")


def _ageing(tmp_path: Path) -> str:
    """A drive whose damping and torque follow tables: 0.1 t N m s until 30 s, 1 N m and half of it from 15 s on."""
    net = sw.Network("ageing")
    net.add(sw.TorqueSource("motor", tau=sw.Table([0.0, 14.0, 15.0, 30.0], [1.0, 1.0, 0.5, 0.5])), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.TorqueSource("bearing", tau=-sw.Table([0.0, 30.0], [0.1, 3.1])(sw.t) * sw.omega), "a")
    net.add(sw.Spring("shaft", c=100.0), "a", "b")
    net.add(sw.Inertia("J2", J=1.0), "b")
    path = tmp_path / "ageing.toml"
    net.save(path)
    return str(path)


@pytest.mark.slow
def test_modes_and_diagrams_read_laws_at_the_time_that_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = _ageing(tmp_path)
    net = sw.Network.load(path)
    for options, t in (((), 31.0), (("--t", "9"), 9.0)):
        assert main(["modes", path, "--json", *options]) == DONE
        found = json.loads(capsys.readouterr().out)
        assert found["network"] == f"ageing at rest, laws at t = {t:g} s"
        assert [mode["rate_real"] for mode in found["modes"]] == pytest.approx(net.modes(t=t).rates.real.tolist())
        point = ("--at", "J1.omega=n", "--at", "J2.omega=n", "--n-max", "1000", "--json")
        assert main(["campbell", path, *point, *options]) == DONE
        crossings = json.loads(capsys.readouterr().out)["crossings"]
        wanted = net.campbell(
            np.linspace(0.0, 100 * np.pi / 3, 61), at=lambda n: {"J1.omega": n, "J2.omega": n}, t=t
        ).crossings
        assert [made["speed"] for made in crossings] == pytest.approx([made.speed for made in wanted], rel=1e-9)
        assert crossings


def test_a_warning_about_the_time_of_a_steady_state_names_options_that_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = _ageing(tmp_path)
    assert main(["modes", path, "--steady"]) == DONE
    warning = next(line for line in capsys.readouterr().err.splitlines() if line.startswith("warning"))
    offered = warning.partition("Name the time that is meant, ")[2].rstrip(".").split(" or ")
    assert offered[0] == "--t 31"
    assert "steady_state(t=" not in warning
    for option in offered:
        assert main(["modes", path, "--steady", *option.split()]) == DONE
        shown = capsys.readouterr()
        assert shown.err == ""
        assert f"laws at t = {option.split()[1]} s" in shown.out


def test_a_message_names_options_on_the_command_line_and_calls_in_python(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    net = sw.Network("falling")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.TorqueSource("weight", tau=-1.0), "a")
    net.add(sw.CoulombLoad("seal", tau=0.1), "a")
    path = tmp_path / "falling.toml"
    net.save(path)
    with pytest.raises(sw.SimulationError) as failed:
        net.compile().steady_state()
    assert "steady_state(initial={'J1.omega': ...})" in str(failed.value)
    assert main(["modes", str(path), "--steady"]) == FAILED
    message = capsys.readouterr().err
    assert "--at J1.omega=..." in message
    assert "initial=" not in message


def test_a_run_with_travelling_waves_has_the_start_of_its_states(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "line.toml"
    sw.scenes.ship_line(sw.Wave()).save(path)
    assert main(["run", str(path), "--t-end", "0.01", "--json"]) == DONE
    data = json.loads(capsys.readouterr().out)
    at_rest = dict.fromkeys(sw.scenes.ship_line(sw.Wave()).compile().states, 0.0)
    assert data["start"] == pytest.approx(at_rest, abs=1e-12)


def test_a_steady_start_may_be_seen_by_its_angle_and_changed_by_any_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    net = sw.Network("drive")
    net.add(sw.TorqueSource("motor", tau=100.0 - 10.0 * sw.omega), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Spring("s", c=1e3, d=1.0), "a", "b")
    net.add(sw.Inertia("J2", J=1.0), "b")
    net.add(sw.ViscousLoad("l", d=2.0), "b")
    path = tmp_path / "drive.toml"
    net.save(path)
    options = ["--t-end", "0.1", "--steady", "--signals", "J1.phi,s.tau", "--json"]
    assert main(["run", str(path), *options]) == DONE
    signals = json.loads(capsys.readouterr().out)["signals"]
    assert signals["J1.phi"]["end"] == pytest.approx(0.1 * 100.0 / 12.0, rel=1e-7)
    assert main(["run", str(path), *options, "--initial", "s.tau=0", "--initial", "motor.omega=3"]) == DONE
    assert json.loads(capsys.readouterr().out)["start"]["J2.omega"] == pytest.approx(100.0 / 12.0, rel=1e-9)


@pytest.mark.slow
def test_a_message_of_a_run_names_the_option_that_a_run_has(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    net = sw.Network("falling")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.TorqueSource("weight", tau=-1.0), "a")
    path = tmp_path / "falling.toml"
    net.save(path)
    assert main(["run", str(path), "--steady", "--t-end", "1"]) == FAILED
    message = capsys.readouterr().err
    assert "--initial J1.omega=..." in message
    assert "--at" not in message


def test_a_comparison_of_which_nothing_comes_says_why_and_ends_with_1(capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["compare", "bldc-shaft", "--models", "Wave", "--t-end", "0.002", "--budget", "1"]
    assert main(arguments) == FAILED
    said = capsys.readouterr().err
    assert "No model of shaft 'line' could be compared. Wave(places=5): Shaft 'line': damping = 0.02" in said


def test_a_network_is_exported_for_other_tools(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    deck, package = tmp_path / "crane.cir", tmp_path / "crane.mo"
    assert main(["export", "crane-start", "--spice", str(deck), "--modelica", str(package)]) == DONE
    assert ".tran" in deck.read_text(encoding="utf-8")
    assert "Modelica.Mechanics.Rotational" in package.read_text(encoding="utf-8")
    assert main(["export", "crane-start", "--c", str(tmp_path), "--output", "J2.omega"]) == DONE
    assert str(tmp_path / "main.c") in capsys.readouterr().out
    assert main(["export", "crane-start", "--spice", str(deck), "--replace", "--input", "motor.tau"]) == WRONG_INPUT
    assert "Leave out --input" in capsys.readouterr().err
