"""Other values on the command line: numbers, units, laws and records, in every command that is about a model."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest

import shaftwork as sw
from shaftwork.cli import DONE, WRONG_INPUT, main


def model(folder: Path) -> str:
    net = sw.Network("pair")
    net.add(sw.TorqueSource("pull", tau=1.0), "a")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Shaft("line", length=1.0, diameter=0.02, model=sw.OneSpring()), "a", "b")
    net.add(sw.Inertia("J2", J=3.0), "b")
    net.save(folder / "pair.toml")
    return str(folder / "pair.toml")


def frequencies(capsys: pytest.CaptureFixture[str], *arguments: str) -> list[float]:
    assert main(["modes", *arguments, "--json"]) == DONE
    return [mode["frequency"] for mode in json.loads(capsys.readouterr().out)["modes"]]


def test_a_value_is_set_as_often_as_wanted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two inertias on a spring: f = sqrt(c (1/J1 + 1/J2)) / 2 pi."""
    path = model(tmp_path)
    c = 79.3e9 * np.pi * 0.02**4 / 32
    for settings, (J1, J2) in (((), (2.0, 3.0)), (("--set", "J1.J=5", "--set", " J2.J = 1.5"), (5.0, 1.5))):
        found = frequencies(capsys, path, *settings)
        assert found[-1] == pytest.approx(np.sqrt(c * (1 / J1 + 1 / J2)) / (2 * np.pi), rel=1e-9)  # OneSpring is exact


def test_a_value_may_have_its_unit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("pint")
    path = model(tmp_path)
    written = (("J1.J=5000 kg*cm^2", "J1.J=0.5"), ("line.diameter=25mm", "line.diameter=0.025"))
    for with_unit, plain in written:
        assert frequencies(capsys, path, "--set", with_unit) == pytest.approx(
            frequencies(capsys, path, "--set", plain), rel=1e-12
        )


def test_a_model_of_a_shaft_and_a_law_are_set_as_in_a_model_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = model(tmp_path)
    assert len(frequencies(capsys, path, "--set", "line.model=Lumped(4)")) > len(frequencies(capsys, path))
    new = tmp_path / "new.toml"
    assert main(["export", path, str(new), "--set", "pull.tau=2*sin(t)"]) == DONE
    assert '"2*sin(t)"' in new.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("drive.n_sync=1500 1/min", 1500.0),
        ("drive.n_sync=1500/min", 1500.0),
        ("drive.n_sync=25 1/s", 1500.0),
        ("drive.n_sync=1500 min**-1", 1500.0),
        ("drive.n_sync=1500 min^-1", 1500.0),
        ("drive.n_sync=1500 rpm", 1500.0),
        ("drive.f_n=50 1/s", 50.0),
        ("drive.f_n=3000/min", 50.0),
        ("drive.f=50 1/s", 50.0),
        ("drive.efficiency=94 %", 0.94),
        ("drive.efficiency=94%", 0.94),
        ("J.J=3 kg*m**2", 3.0),
        ("J.J=3e4 kg*cm**2", 3.0),
    ],
)
def test_a_value_takes_every_unit_that_a_message_or_a_table_of_the_pages_names(
    written: str, value: float, tmp_path: Path
) -> None:
    pytest.importorskip("pint")
    motors(tmp_path)
    assert main(["export", str(tmp_path / "motors.toml"), str(tmp_path / "new.toml"), "--set", written]) == DONE
    owner, _, parameter = written.partition("=")[0].partition(".")
    (part,) = (part for part in sw.Network.load(tmp_path / "new.toml").parts if part.name == owner)
    assert getattr(part, parameter) == pytest.approx(value, rel=1e-12)


def motors(folder: Path) -> str:
    net = sw.Network("motors")
    net.add(sw.FrequencyDrive("drive", tau_k=20.0, s_k=0.1, n_sync=1000, f=sw.t), "a")
    net.add(sw.TableMotor("motor", curve=5.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.save(folder / "motors.toml")
    return str(folder / "motors.toml")


@pytest.mark.parametrize("written", ["Table([0, 1500], [100, 0])", "{ x = [0, 1500], y = [100.0, 0.0] }"])
def test_a_curve_is_set_as_in_a_model_file(written: str, tmp_path: Path) -> None:
    """In both forms of a table, on the command line and in the file, it is over the speed, not over time."""
    path, curve = motors(tmp_path), sw.Table([0.0, 1500.0], [100.0, 0.0])
    assert main(["export", path, str(tmp_path / "new.toml"), "--set", f"motor.curve={written}"]) == DONE
    in_file = written if written.startswith("{") else f'"{written}"'
    text = Path(path).read_text(encoding="utf-8").replace("curve = 5.0", f"curve = {in_file}")
    (tmp_path / "written.toml").write_text(text, encoding="utf-8")
    for name in ("new", "written"):
        assert sw.Network.load(tmp_path / f"{name}.toml").parts[1].curve == curve


def test_a_law_of_time_is_a_table_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = model(tmp_path)
    assert main(["export", path, "--set", "pull.tau={ x = [0, 1], y = [0, 5] }"]) == DONE
    assert "tau = { x = [0.0, 1.0], y = [0.0, 5.0] }" in capsys.readouterr().out


def test_a_network_with_other_values_has_its_ports_and_its_places_in_the_file(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    net = sw.Network("coupled", ports=("a", "b"))
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Spring("s", c=1e3), "a", "b")
    path, new = tmp_path / "coupled.toml", tmp_path / "new.toml"
    net.save(path)
    assert main(["export", str(path), str(new), "--set", "s.c=2e3"]) == DONE
    assert sw.Network.load(new).ports == net.ports
    assert "c = 2000" in new.read_text(encoding="utf-8")

    path.write_text(path.read_text(encoding="utf-8").replace('nodes = ["a"]', 'nodes = ["a", "b"]'), encoding="utf-8")
    for setting in ([], ["--set", "s.c=2e3"]):
        capsys.readouterr()
        assert main(["modes", str(path), *setting]) == WRONG_INPUT
        assert "coupled.toml, line 5)" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["check", "run", "latex", "modes", "export"])
def test_every_command_about_a_model_takes_values(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([command, model(tmp_path), "--set", "J1.K=1"]) == WRONG_INPUT
    assert "There is no parameter 'J1.K'. Inertia 'J1' has: J1.J." in capsys.readouterr().err


def test_a_part_without_parameters_is_said_to_have_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    net = sw.Network("one way")
    net.add(sw.Inertia("J1", J=1.0), "rotor")
    net.add(sw.Freewheel("backstop"), "rotor", "ground")
    net.save(tmp_path / "one way.toml")
    assert main(["check", str(tmp_path / "one way.toml"), "--set", "backstop.x=1"]) == WRONG_INPUT
    assert "There is no parameter 'backstop.x'. Freewheel 'backstop' has no parameters." in capsys.readouterr().err


@pytest.mark.parametrize(
    ("setting", "words"),
    [
        ("J1.J", "write name=value, such as --set shaft.c=2e4"),
        ("J1.J=", "write name=value"),
        ("=3", "write name=value"),
        ("J=3", "There is no part ''. The parts are: pull, J1, line, J2."),
        ("J3.J=3", "There is no part 'J3'. The parts are: pull, J1, line, J2."),
        ("line.length=two", "line.length=two: give a number in m (length), or with a unit"),
        ("J1.J=-1", "J of Inertia 'J1' must be at least 0. Give it (moment of inertia, also over its angle"),
        ("J1.J=nan", "must be a finite number"),
        ("J1.J=3 kg", "is given in 'kilogram', but needs kg*m^2"),
        ("J1.J=3 potatoes", "is no number with a unit"),
        ("J1.J=3 kg*m**9**9**9", "units with * / and powers of one digit"),
        ("J1.J=3 kg*9**9**9*m**2", "units with * / and powers of one digit"),
        ("J1.J=3 kg" + "*m" * 99, "units with * / and powers of one digit"),
        ("J1.J=3 m" + "m" * 80 + "!", "units with * / and powers of one digit"),
        ("line.length=1/2", "line.length=1/2: give a number in m (length), or with a unit"),
        ("pull.tau={ x = [0, 1] }", "Write a table as { x = [0.0, 1.0], y = [0.0, 5.0] }"),
        ("pull.tau={ x = [0, 1], y = [0", "Write a table as { x = [0.0, 1.0], y = [0.0, 5.0] }"),
        ("pull.tau={ x = [0, 1], y = [0, 'a'] }", "Tables hold numbers alone"),
        ("pull.tau={ x = [1, 0], y = [0, 1] }", "x must increase strictly"),
        ("line.model=Lumps(3)", "line.model=Lumps(3): model of Shaft 'line' cannot be read"),
        ("pull.tau=sine(t)", "pull.tau=sine(t): "),
    ],
)
def test_a_wrong_value_is_answered_with_what_would_be_right(
    setting: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["check", model(tmp_path), "--set", setting]) == WRONG_INPUT
    assert words in capsys.readouterr().err


def test_a_parameter_is_set_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", model(tmp_path), "--set", "J1.J=3", "--set", "J1.J=4"]) == WRONG_INPUT
    assert "--set gives 'J1.J' twice. Give it once." in capsys.readouterr().err


def test_a_unit_without_the_library_of_units_is_answered_with_the_extra(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "pint", None)  # what an import then says is ImportError
    assert main(["modes", model(tmp_path), "--set", "J1.J=200 kg*cm^2"]) == WRONG_INPUT
    said = capsys.readouterr().err
    assert "J1.J=200 kg*cm^2 with a unit" in said
    assert "shaftwork[units]" in said
