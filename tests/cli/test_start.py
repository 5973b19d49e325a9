"""Start values and a start in the steady state on the command line: a load that hangs does not fall into its rope."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import shaftwork as sw
from shaftwork.cli import DONE, WRONG_INPUT, main

WEIGHT = 20e3 * 9.81


@pytest.fixture
def hoist(tmp_path: Path) -> str:
    """A load on a rope under a drum that its brake holds."""
    net = sw.Network("hoist")
    net.add(sw.Inertia("rotor", J=400.0), "shaft")
    net.add(sw.Brake("brake", tau=2e5, t_on=0.0), "shaft")
    net.add(sw.Drum("drum", radius=0.4), "shaft", "top")
    net.add(sw.TranslationalSpring("rope", c=5e6, d=2e4), "top", "hook")
    net.add(sw.Mass("load", m=20e3), "hook")
    net.add(sw.ForceSource("weight", f=-WEIGHT), "hook")
    net.save(tmp_path / "hoist.toml")
    return str(tmp_path / "hoist.toml")


def result(capsys: pytest.CaptureFixture[str], *arguments: str) -> Any:
    assert main([*arguments, "--json"]) == DONE
    return json.loads(capsys.readouterr().out)


@pytest.mark.slow
def test_a_load_hangs_still_from_the_steady_state_or_from_its_torque(
    hoist: str, capsys: pytest.CaptureFixture[str]
) -> None:
    """From rest it falls into the slack rope: c x = 2 m g without damping, a little less with it."""
    arguments = ("run", hoist, "--t-end", "0.5", "--signals", "rope.f")
    forces = {}
    for start in ((), ("--steady",), ("--initial", f"rope.f={WEIGHT}"), ("--initial", "load.v=1e-3", "--steady")):
        found = result(capsys, *arguments, *start)
        forces[start] = tuple(found["signals"]["rope.f"][side]["value"] for side in ("minimum", "maximum"))
    fallen, *hanging, pushed = forces.values()
    assert 1.8 * WEIGHT < fallen[1] < 2 * WEIGHT
    assert hanging == [(pytest.approx(WEIGHT, rel=1e-9),) * 2] * 2
    assert found["start"] == {"rotor.omega": 0.0, "rope.f_c": pytest.approx(WEIGHT), "load.v": 1e-3}
    assert pushed[0] == pytest.approx(WEIGHT - 1e-3 * (5e6 * 20e3) ** 0.5, rel=2e-2)  # omega v_0 m


def test_a_start_value_has_its_unit_and_is_told(hoist: str, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("pint")
    assert main(["run", hoist, "--t-end", "0.1", "--steady", "--initial", "rope.f_c=0.2 MN"]) == DONE
    assert "  start: the steady state at t = 0 s, rope.f_c=0.2 MN\n" in capsys.readouterr().out
    assert result(capsys, "run", hoist, "--t-end", "0.1", "--initial", "rope.f_c=200 kN")["start"]["rope.f_c"] == 2e5


def test_an_angle_to_start_from_is_recorded(hoist: str, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ("run", hoist, "--t-end", "0.1", "--steady", "--initial", "rotor.phi=0.5")
    assert result(capsys, *arguments)["start"]["rotor.phi"] == 0.5


@pytest.mark.parametrize(
    ("values", "words"),
    [
        (("J1.omega=1",), "'J1.omega'"),
        (("load.v",), "write name=value, such as --initial J1.omega=100"),
        (("load.v=fast",), "'fast' must be a number in SI, or one with its unit"),
        (("load.v=1", "load.v=2"), "--initial gives 'load.v' twice. Give it once."),
        (("rope.v_rel=1",), "share the motion: they cannot all be at rest"),
    ],
)
@pytest.mark.parametrize(
    "command", [("run",), ("sweep", "--vary", "rope.c=4e6,5e6", "--measure", "max rope.f", "--processes", "1")]
)
def test_a_wrong_start_value_is_answered_with_what_would_be_right(
    command: tuple[str, ...], values: tuple[str, ...], words: str, hoist: str, capsys: pytest.CaptureFixture[str]
) -> None:
    name, *others = command
    given = [word for value in values for word in ("--initial", value)]
    code = main([name, hoist, *others, "--t-end", "0.1", *given])
    said = capsys.readouterr()
    assert words in said.err + said.out
    assert code == WRONG_INPUT or (name == "sweep" and "2 failed" in said.out)


def test_each_variant_of_a_sweep_starts_in_its_own_steady_state(hoist: str, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ("sweep", hoist, "--t-end", "0.5", "--vary", "weight.f=-1e5,-2e5", "--processes", "1")
    measures = ("--measure", "min rope.f", "--measure", "max rope.f")
    columns = result(capsys, *arguments, *measures, "--steady")["columns"]
    for measure in ("min rope.f", "max rope.f"):
        assert columns[measure] == pytest.approx([1e5, 2e5], rel=1e-9)
    pushed = result(capsys, *arguments, *measures, "--steady", "--initial", "load.v=1e-3")["columns"]
    assert pushed["min rope.f"] == pytest.approx([1e5 - 316.2, 2e5 - 316.2], rel=1e-3)
