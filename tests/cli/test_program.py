"""The command line: what it prints, what it writes, how it ends."""

from __future__ import annotations

import csv
import io
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.cli import DONE, FAILED, WRONG_INPUT, main
from shaftwork.integrate.engines import available


def test_scenes_are_listed_with_their_source(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenes"]) == DONE
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(sw.scenes.SCENES)
    for line, scene in zip(lines, sw.scenes.SCENES.values(), strict=True):
        assert line.endswith(f"({scene.source})")


@pytest.mark.slow
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


@pytest.mark.slow
def test_run_tells_phases_and_writes_them_with_the_events(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["run", "six-phases", "--out", str(tmp_path)]) == DONE
    printed = capsys.readouterr().out
    sol = sw.scenes.six_phases().simulate(sw.scenes.SCENES["six-phases"].t_end)
    assert f"{len(sol.phases)} phases, {len(sol.events)} events" in printed
    assert f"   0.0000    0.0187  {sol.phases[0].name}\n" in printed
    assert f"   10.0000  {sol.phases[-1].name}\n" in printed
    assert " more\n" in printed
    assert "-0 " not in printed
    phases, events = (
        list(csv.reader((tmp_path / f"{name}.csv").read_text(encoding="utf-8").splitlines()))
        for name in ("phases", "events")
    )
    assert phases[:2] == [
        ["start [s]", "end [s]", *sol.phases[0].modes],
        ["0.0", phases[1][1], "released", "open", "stuck"],
    ]
    assert len(phases) == 1 + len(sol.phases)
    assert [row[1:] for row in events[1:]] == [list(event[1:]) for event in sol.events]


@pytest.mark.slow
def test_latex_prints_the_phases_of_a_scene_or_the_one_asked_for(capsys: pytest.CaptureFixture[str]) -> None:
    scene = sw.scenes.SCENES["six-phases"]
    assert main(["latex", "six-phases", "--form", "state"]) == DONE
    printed = capsys.readouterr().out
    assert printed.count(r"\section*") == len(scene.phases)
    assert main(["latex", "six-phases", "--form", "state", "--phase", scene.phases[1]]) == DONE
    assert f"{scene.phases[1]}}}\n{capsys.readouterr().out}" in printed
    assert main(["latex", "six-phases", "--phase", "shaft broken"]) == WRONG_INPUT
    assert "There is no phase 'shaft broken'" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("form", ["kirchhoff", "state", "second-order", "lagrange"])
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
    engine = next(filter(available, ("heyoka", "numba", "scipy")))
    for word in ("5 parts", "2 nodes", "J1.omega", "natural frequencies", "time constants", f"for 6.5 s: {engine}, "):
        assert word in printed
    # at rest the load holds J2, so that J1 swings alone; in motion both swing against each other
    assert "natural frequencies at rest (load stuck) (1): 4.7348 Hz" in printed
    assert "natural frequencies in motion (load slipping forward) (1): 5.677 Hz" in printed
    assert main(["check", "shaft-chain"]) == DONE
    printed = capsys.readouterr().out
    assert "natural frequencies at rest (" in printed
    assert "in motion" not in printed
    assert "left out, being zero" in printed
    assert "eliminated stores (2)" in printed


def test_check_prints_the_natural_frequencies_of_modes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Damping 0.6: the natural frequency is 10 / 2 pi Hz, and the damped one is 8 / 2 pi = 1.27 Hz."""
    net = sw.Network("oscillator")
    net.add(sw.Inertia("J1", J=1.0), "rotor")
    net.add(sw.Spring("shaft", c=100.0, d=12.0), "rotor", "ground")
    net.save(tmp_path / "oscillator.toml")
    for command, words in (("modes", "1.59155"), ("check", "natural frequencies at rest (1): 1.5915 Hz")):
        assert main([command, str(tmp_path / "oscillator.toml")]) == DONE
        assert words in capsys.readouterr().out


def test_what_is_there_once_is_told_in_the_singular(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A wheel that is stuck until the torque has grown, and one without anything else."""
    net = sw.Network("wheel")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.save(tmp_path / "bare.toml")
    assert main(["check", str(tmp_path / "bare.toml")]) == DONE
    assert "wheel: 1 part, 1 node, 1 branch\n" in capsys.readouterr().out
    assert main(["modes", str(tmp_path / "bare.toml")]) == DONE
    assert ": 1 mode\n" in capsys.readouterr().out
    net.add(sw.CoulombLoad("load", tau=1.0), "a")
    net.add(sw.TorqueSource("pull", tau=sw.t), "a")
    net.save(tmp_path / "wheel.toml")
    assert main(["run", str(tmp_path / "wheel.toml"), "--t-end", "2"]) == DONE
    printed = capsys.readouterr().out
    assert " steps, 1 change; energy residual" in printed
    assert "2 phases, 1 event\n" in printed
    assert main(["run", str(tmp_path / "wheel.toml"), "--t-end", "0.5"]) == DONE
    assert "1 phase, 0 events\n" in capsys.readouterr().out


def test_check_names_the_engine_of_a_network_without_states(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    net = sw.Network("driven")
    net.add(sw.SpeedSource("drive", omega=5.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.save(tmp_path / "driven.toml")
    assert main(["check", str(tmp_path / "driven.toml")]) == DONE
    assert "engine for 10 s: exact, Nothing moves freely" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["run", "cran"], WRONG_INPUT, "crane-start"),
        (["run", "missing.toml"], WRONG_INPUT, "missing.toml"),
        (["run", "crane-start", "--t-end", "-1"], WRONG_INPUT, "after t_start"),
        (["check", "crane-start.txt"], WRONG_INPUT, ".toml"),
        (["run", "crane-start", "--engine", "exact"], WRONG_INPUT, "Take one of: heyoka"),
        (["run", "crane-start", "--rtol", "2"], WRONG_INPUT, "rtol = 2.0 must lie between"),
        (["run", "crane-start", "--signals", "nope"], WRONG_INPUT, "No quantity 'nope'"),
        (["run", "crane-start", "--set", "shaft.k=1"], WRONG_INPUT, "There is no parameter 'shaft.k'"),
    ],
)
def test_wrong_input_ends_with_2_and_one_message(
    arguments: list[str], code: int, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(arguments) == code
    said = capsys.readouterr()
    assert words in said.err
    assert "Traceback" not in said.err
    assert said.out == ""


def test_a_bad_folder_is_found_before_the_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sw.Network, "compile", None)  # a run would call it
    (tmp_path / "file").write_text("", encoding="utf-8")
    for folder in (tmp_path / "file", tmp_path / "file" / "inside"):
        assert main(["run", "crane-start", "--out", str(folder)]) == WRONG_INPUT
        said = capsys.readouterr()
        assert said.out == ""
        assert f"--out {folder} is no folder to write to" in said.err
        assert "Give another folder." in said.err


@pytest.mark.slow
def test_a_linear_model_whose_inputs_are_too_rough_is_no_model_for_the_exact_engine(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for law, code in ((sympy.sqrt(sw.t), WRONG_INPUT), (sympy.sin(sw.t), DONE), (sw.Ramp(1.0, 0.5), DONE)):
        net = sw.Network("linear")
        net.add(sw.Inertia("J", J=1.0), "a")
        net.add(sw.TorqueSource("T", tau=law), "a")
        net.save(tmp_path / "linear.toml")
        assert main(["run", str(tmp_path / "linear.toml"), "--t-end", "1", "--engine", "exact"]) == code
        assert ("polynomials resolve the input" in capsys.readouterr().err) == (code == WRONG_INPUT)


@pytest.mark.parametrize("law", [1 / sw.omega, sympy.log(sw.omega), (1e10 + sw.omega) ** 40], ids=str)
def test_check_says_where_the_slopes_at_rest_are_not_finite(
    law: sympy.Expr, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    net = sw.Network("steep")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.TorqueSource("T", tau=law), "a")
    net.save(tmp_path / "steep.toml")
    assert main(["check", str(tmp_path / "steep.toml")]) == DONE
    assert "time constants at rest: none, since J.omega has no finite slope there" in capsys.readouterr().out


def test_what_a_terminal_cannot_show_is_written_as_an_escape(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    net = sw.Network("Förderband")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.save(tmp_path / "belt.toml")
    raw = io.BytesIO()
    monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(raw, encoding="ascii", write_through=True))
    assert main(["check", str(tmp_path / "belt.toml")]) == DONE
    assert rb"F\xf6rderband" in raw.getvalue()


def test_check_reads_slopes_at_rest_at_the_start(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A brake that gets stronger: after 10 ms it has twice the damping."""
    net = sw.Network("braked")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.TorqueSource("brake", tau=-(1 + 100 * sw.t) * sw.omega), "a")
    net.save(tmp_path / "braked.toml")
    assert main(["check", str(tmp_path / "braked.toml")]) == DONE
    assert "time constants at rest: 1 s to 1 s" in capsys.readouterr().out


def test_an_unforeseen_error_ends_with_1_and_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(*_args: object, **_options: object) -> None:
        raise np.linalg.LinAlgError("Singular\nmatrix")

    monkeypatch.setattr(sw.Network, "compile", fail)
    assert main(["run", "crane-start"]) == FAILED
    (line,) = capsys.readouterr().err.splitlines()
    assert "'run crane-start' failed with LinAlgError: Singular matrix." in line


@pytest.mark.slow
def test_a_reader_that_closes_the_pipe_ends_the_command_quietly() -> None:
    """The reader is gone before the first word, so that every write fails."""
    command = [sys.executable, "-m", "shaftwork", "latex", "shaft-chain"]
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "wb") as pipe:
        done = subprocess.run(command, stdout=pipe, stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr) == (DONE, "")


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


@pytest.mark.slow
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
    done = subprocess.run([sys.executable, "-m", "shaftwork", "--help"], capture_output=True, text=True, check=True)
    assert len(done.stdout.splitlines()) <= 24
    for name in ("scenes", "run", "latex", "check"):
        assert name in done.stdout


def test_the_version_is_that_of_the_package(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as end:
        main(["--version"])
    assert end.value.code == DONE
    assert capsys.readouterr().out == f"shaftwork {sw.__version__}\n"


def test_help_loads_nothing_heavy() -> None:
    heavy = ("sympy", "scipy", "numpy", "matplotlib", "heyoka", "networkx", "pint", "pandas", "tqdm")
    code = (
        "import sys; from shaftwork.cli import main\n"
        "try: main(['--help'])\n"
        f"except SystemExit: print([name for name in {heavy!r} if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.endswith("[]\n")


def test_scenes_are_listed_for_machines_too(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["scenes", "--json"]) == DONE
    (first, *_) = json.loads(capsys.readouterr().out)["scenes"]
    assert first["name"] == "crane-start"
    assert first["t_end"] == 6.5


def test_check_says_the_same_to_machines(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["check", "crane-start", "--json"]) == DONE
    found = json.loads(capsys.readouterr().out)
    assert found["parts"] == 5
    assert "J1.omega" in found["states"]
    assert found["problems"] == []
    assert found["engine"] in ("heyoka", "numba", "scipy")
