"""The command line: what it prints, what it writes, how it ends."""

from __future__ import annotations

import csv
import subprocess
import sys
from pathlib import Path

import pytest

import shaftwork as sw
from shaftwork.cli import DONE, FAILED, WRONG_INPUT, main


def test_scenes_are_listed_with_their_source(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenes"]) == DONE
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(sw.scenes.SCENES)
    assert "Marinkovic 2012" in lines[0]
    assert "Popenda 2019" in lines[1]


def test_run_prints_a_table_and_writes_curves_and_csv(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "crane-start", "--out", str(tmp_path / "crane")]) == DONE
    printed = capsys.readouterr().out
    for word in ("shaft.tau", "N*m", "chosen: ", "energy residual", "engine "):
        assert word in printed
    rows = list(csv.reader((tmp_path / "crane" / "signals.csv").read_text(encoding="utf-8").splitlines()))
    assert rows[0][:2] == ["t [s]", "shaft.tau [N*m]"]
    assert len(rows) == 1002
    assert (tmp_path / "crane" / "signals.png").stat().st_size > 10_000


def test_a_saved_network_runs_like_the_scene(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "crane.toml"
    sw.scenes.crane_start().save(path)
    assert main(["run", str(path), "--t-end", "1", "--engine", "scipy", "--rtol", "1e-6"]) == DONE
    assert "J1.omega" in capsys.readouterr().out


@pytest.mark.parametrize("form", ["kirchhoff", "state", "second-order"])
def test_latex_prints_the_equations(form: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["latex", "crane-start", "--form", form]) == DONE
    assert "J_{1}" in capsys.readouterr().out
    assert main(["latex", "crane-start", "--values"]) == DONE
    assert "27.35" in capsys.readouterr().out
    assert main(["latex", "crane-start", "--document"]) == DONE
    assert r"\begin{document}" in capsys.readouterr().out


def test_check_tells_structure_states_time_constants_and_engine(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "crane-start"]) == DONE
    printed = capsys.readouterr().out
    for word in ("5 parts", "2 nodes", "J1.omega", "natural frequencies", "time constants", "engine for 6.5 s: heyoka"):
        assert word in printed
    assert main(["check", "shaft-chain"]) == DONE
    printed = capsys.readouterr().out
    assert "left out, being zero" in printed
    assert "eliminated stores (2)" in printed


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["run", "crane"], WRONG_INPUT, "crane-start"),
        (["run", "missing.toml"], WRONG_INPUT, "missing.toml"),
        (["run", "crane-start", "--t-end", "-1"], WRONG_INPUT, "after t_start"),
        (["check", "crane-start.txt"], WRONG_INPUT, ".toml"),
    ],
)
def test_wrong_input_ends_with_2_and_one_message(
    arguments: list[str], code: int, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == code
    said = capsys.readouterr().err
    assert words in said
    assert "Traceback" not in said


def test_every_problem_of_a_wrong_network_is_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "wrong.toml"
    path.write_text(
        'format = 1\nname = "wrong"\n\n[[part]]\ntype = "Inertia"\nname = "J1"\nnodes = ["a"]\nJ = -1.0\n\n'
        '[[part]]\ntype = "Spring"\nname = "s"\nnodes = ["a", "b"]\nc = 1.0\n',
        encoding="utf-8",
    )
    assert main(["run", str(path)]) == WRONG_INPUT
    said = capsys.readouterr().err
    assert "J1" in said
    assert "'s'" in said


def test_a_failed_computation_ends_with_1(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    net = sw.Network("pole")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.TorqueSource("T", tau=1 / (sw.t - 1) ** 2), "a")
    net.save(tmp_path / "pole.toml")
    assert main(["run", str(tmp_path / "pole.toml")]) == FAILED
    assert "J.omega" in capsys.readouterr().err


def test_a_warning_goes_to_standard_error(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    net = sw.Network("locked")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Inertia("J2", J=1.0), "c")
    net.add(sw.Spring("s", c=1.0), "c", "a")
    net.add(sw.Gear("g1", ratio=2.0), "a", "b")
    net.add(sw.Gear("g2", ratio=3.0), "a", "b")
    net.save(tmp_path / "locked.toml")
    assert main(["run", str(tmp_path / "locked.toml"), "--t-end", "1"]) == DONE
    assert "warning" in capsys.readouterr().err


def test_the_command_is_installed_and_its_help_fits_on_one_screen() -> None:
    done = subprocess.run([sys.executable, "-m", "shaftwork.cli", "--help"], capture_output=True, text=True, check=True)
    assert len(done.stdout.splitlines()) <= 24
    for name in ("scenes", "run", "latex", "check"):
        assert name in done.stdout
