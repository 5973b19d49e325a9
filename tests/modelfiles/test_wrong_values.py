"""A wrong value in a model file is told with file, line, part, parameter and SI unit, whatever is wrong with it."""

from __future__ import annotations

from pathlib import Path

import pytest

import shaftwork as sw

HEAD = 'format = 1\nname = "m"\n\n[[part]]\ntype = "Inertia"\nname = "J0"\nnodes = ["a"]\nJ = 1.0\n\n[[part]]\n'


def written(folder: Path, part: str) -> Path:
    path = folder / "model.toml"
    path.write_text(f"{HEAD}{part}\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("part", "line", "words"),
    [
        ('type = "Damper"\nname = "J1"\nnodes = ["a"]\nd = "1 N*m*s"', 14, ("d = '1 N*m*s'", "number in N*m*s/rad")),
        ('type = "Damper"\nd = "two"\nname = "J1"\nnodes = ["a"]', 12, ("d = 'two'", "damping")),
        ('type = "Inertia"\nname = "J1"\nnodes = ["a"]\nJ = "1 kg*m^2"', 14, ("contains '^'", "a law for J in kg*m^2")),
        ('type = "Gear"\nname = "J1"\nnodes = ["a", "b"]\nratio = "3:1"', 14, ("ratio = '3:1'", "pure number")),
        ('type = "Inertia"\nname = "J1"\nnodes = ["a"]\n# a note\nJ = 1.0\nmass = 3', 16, ("mass", "J [kg*m^2]")),
        ('type = "Inertia"\nname = "J1"\nnodes = ["a"]', 10, ("J [kg*m^2]", "missing")),
        ('type = "TorqueSource"\nname = "J1"\nnodes = ["a"]\ntau = "10 N*m"', 14, ("tau", "in N*m")),
        (
            'type = "Shaft"\nname = "J1"\nnodes = ["a", "b"]\nlength = 1.0\ndiameter = 0.1\nmodel = "Lumps(3)"',
            16,
            ("model",),
        ),
        ('type = "Inertiaa"\nname = "J1"\nnodes = ["a"]\nJ = 1.0', 11, ("no component 'Inertiaa'",)),
        ('type = "Inertia"\nname = "J1"\nnodes = ["a"]\nJ = [1.0]', 14, ("J is [1.0]",)),
    ],
)
def test_what_cannot_be_read_is_told_with_its_line(
    part: str, line: int, words: tuple[str, ...], tmp_path: Path
) -> None:
    path = written(tmp_path, part)
    with pytest.raises(sw.ModelFileError) as caught:
        sw.Network.load(path)
    said = str(caught.value)
    assert said.startswith(f"{path}: line {line}, ")
    assert all(word in said for word in ("'J1'", *words)), said


@pytest.mark.parametrize(
    ("part", "line", "words"),
    [
        ('type = "Inertia"\nname = "J1"\nnodes = ["a"]\nJ = -1.0', 14, ("J = -1.0 must be at least 0", "in kg*m^2")),
        ('type = "Damper"\nname = "J1"\nnodes = ["a"]\nd = { x = [0.0, 1.0], y = [1.0, 2.0] }', 14, ("in N*m*s/rad",)),
        ('type = "TorqueSource"\nname = "J1"\nnodes = ["a"]\ntau = "v"', 14, ("tau reads v",)),
        ('type = "Spring"\nname = "J1"\nnodes = ["a"]\nc = 1.0', 10, ("node count",)),
    ],
)
def test_what_cannot_be_used_is_told_with_its_line_among_all_problems(
    part: str, line: int, words: tuple[str, ...], tmp_path: Path
) -> None:
    path = written(tmp_path, part)
    with pytest.raises(sw.NetworkError) as caught:
        sw.Network.load(path).compile()
    said = str(caught.value)
    assert f"({path}, line {line})" in said
    assert all(word in said for word in ("'J1'", *words)), said


def test_a_network_that_was_read_is_equal_to_the_one_that_was_saved(tmp_path: Path) -> None:
    net = sw.scenes.crane()
    net.save(tmp_path / "crane.toml")
    assert sw.Network.load(tmp_path / "crane.toml").netlist() == net.netlist()
