"""The folder of `--out`: it holds the files of one run, those of the user stay."""

from __future__ import annotations

import json
import os
from pathlib import Path

import pytest

import shaftwork as sw
from shaftwork.cli import DONE, FAILED, WRONG_INPUT, main


def model(folder: Path, name: str, *, rubs: bool) -> str:
    net = sw.Network(name)
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.TorqueSource("pull", tau=sw.Step(10.0, 0.1)), "a")
    if rubs:
        net.add(sw.CoulombLoad("load", tau=2.0), "a")
    net.save(folder / f"{name}.toml")
    return str(folder / f"{name}.toml")


def names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


@pytest.mark.slow
def test_a_folder_holds_the_files_of_the_last_run_and_what_the_user_put_there(tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert main(["run", model(tmp_path, "rubbing", rubs=True), "--t-end", "1", "--out", str(out)]) == DONE
    assert names(out) == {"signals.csv", "signals.png", "phases.csv", "events.csv", "shaftwork.json"}
    (out / "notes.txt").write_text("mine", encoding="utf-8")
    (out / "inside").mkdir()
    before = (out / "signals.csv").read_text(encoding="utf-8")
    assert main(["run", model(tmp_path, "free", rubs=False), "--t-end", "1", "--out", str(out)]) == DONE
    assert names(out) == {"signals.csv", "signals.png", "shaftwork.json", "notes.txt", "inside"}
    assert (out / "signals.csv").read_text(encoding="utf-8") != before
    manifest = json.loads((out / "shaftwork.json").read_text(encoding="utf-8"))
    assert manifest["files"] == ["signals.csv", "signals.png"]
    assert manifest["command"][:2] == ["shaftwork", "run"]


@pytest.mark.parametrize("name", ["signals.csv", "events.csv"])
def test_a_file_of_the_user_is_never_written_over(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sw.Network, "compile", None)  # a run would call it
    path = model(tmp_path, "rubbing", rubs=True)
    out = tmp_path / "out"
    out.mkdir()
    (out / name).write_text("mine", encoding="utf-8")
    assert main(["run", path, "--out", str(out)]) == WRONG_INPUT
    assert f"--out {out} has a file {name} that its shaftwork.json does not list" in capsys.readouterr().err
    assert (out / name).read_text(encoding="utf-8") == "mine"


@pytest.mark.parametrize("text", ["", "[]", '{"files": ["../notes.txt"]}', '{"files": 3}', "\0"])
def test_a_list_of_files_that_no_run_wrote_is_not_followed(
    text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = model(tmp_path, "free", rubs=False)
    out = tmp_path / "out"
    out.mkdir()
    (tmp_path / "notes.txt").write_text("mine", encoding="utf-8")
    (out / "shaftwork.json").write_text(text, encoding="utf-8")
    assert main(["run", path, "--t-end", "1", "--out", str(out)]) == WRONG_INPUT
    assert "a shaftwork.json that no run has written" in capsys.readouterr().err
    assert (tmp_path / "notes.txt").exists()


@pytest.mark.slow
def test_a_run_that_fails_leaves_the_older_one_as_it_was(tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert main(["run", model(tmp_path, "rubbing", rubs=True), "--t-end", "1", "--out", str(out)]) == DONE
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    net = sw.Network("pole")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.TorqueSource("T", tau=1 / (sw.t - 1) ** 2), "a")
    net.save(tmp_path / "pole.toml")
    assert main(["run", str(tmp_path / "pole.toml"), "--out", str(out)]) == FAILED
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


@pytest.mark.slow
def test_a_run_that_cannot_write_leaves_the_older_one_as_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from matplotlib.figure import Figure

    def full(*_args: object, **_options: object) -> None:
        raise OSError(28, "No space left on device")

    out = tmp_path / "out"
    assert main(["run", model(tmp_path, "rubbing", rubs=True), "--t-end", "1", "--out", str(out)]) == DONE
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    monkeypatch.setattr(Figure, "savefig", full)
    assert main(["run", model(tmp_path, "free", rubs=False), "--t-end", "1", "--out", str(out)]) == WRONG_INPUT
    assert "No space left" in capsys.readouterr().err
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


def test_without_matplotlib_everything_but_the_picture_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "matplotlib.figure", None)
    out = tmp_path / "out"
    assert main(["run", model(tmp_path, "free", rubs=False), "--t-end", "1", "--out", str(out)]) == DONE
    assert names(out) == {"signals.csv", "shaftwork.json"}
    assert "warning: signals.png is left out. Solution.plot() needs matplotlib" in capsys.readouterr().err


def test_an_empty_name_is_no_folder(capsys: pytest.CaptureFixture[str]) -> None:
    for command in ("run", "compare"):
        with pytest.raises(SystemExit) as end:
            main([command, "shaft-step", "--out", ""])
        assert end.value.code == WRONG_INPUT
        assert "'' names no folder" in capsys.readouterr().err


@pytest.mark.skipif(os.name != "posix", reason="permissions of files")
def test_a_folder_without_permission_is_refused_before_the_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "access", lambda *_: False)  # root may write anywhere
    assert main(["run", model(tmp_path, "free", rubs=False), "--out", str(tmp_path)]) == WRONG_INPUT
    assert "is a folder that you may not write to" in capsys.readouterr().err
