"""Angles that are recorded: the integral of the speed of any part, in any mode, and nothing else changes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import shaftwork as sw
from shaftwork.cli import DONE, main
from tests.beds import bed_of, registered
from tests.hybrid.test_phase_models import clutches

SPEEDS = {"phi": "omega", "s": "v", "psi": "u"}
STANDING = {"Ground"}
"""Parts that have no speed."""


def integral(sol: sw.Solution, name: str) -> tuple[float, float]:
    """Of a quantity over the motion, and of its size: Gauss's rule between step ends, where it is smooth."""
    steps = np.unique(sol.steps)
    parts = 1 + 4000 // len(steps)
    edges = np.append((steps[:-1, None] + np.diff(steps)[:, None] * np.arange(parts) / parts).ravel(), steps[-1])
    nodes, weights = np.polynomial.legendre.leggauss(8)
    times = edges[:-1, None] + np.diff(edges)[:, None] * (nodes + 1) / 2
    values = sol.at(times.ravel())[name].reshape(times.shape) * weights * np.diff(edges)[:, None] / 2
    return float(values.sum()), float(np.abs(values).sum())


def speed_of(angle: str, names: tuple[str, ...]) -> str:
    """The quantity whose integral an angle is."""
    part, _, quantity = angle.rpartition(".")
    kind, _, side = quantity.partition("_")
    candidates = [f"{part}.{SPEEDS[kind]}_{side}"] if side else [f"{part}.{SPEEDS[kind]}", f"{part}.{SPEEDS[kind]}_rel"]
    return next(name for name in candidates if name in names)


def check_angles(net: sw.Network, parts: list[str], end: float) -> None:
    """Each angle is the integral of its speed, and all else is as it was."""
    plain, recorded = (net.simulate(end, rtol=1e-10, t_eval=51, angles=asked) for asked in ((), parts))
    assert [event[1:] for event in recorded.events] == [event[1:] for event in plain.events]
    for name in plain.names:
        size = max(float(np.abs(plain[name]).max()), 1e-6)
        np.testing.assert_allclose(recorded[name], plain[name], rtol=0, atol=1e-8 * size, err_msg=name)
    angles = [state for state in recorded.states if state in recorded and state.rpartition(".")[0] in parts]
    angles = [name for name in angles if name.rpartition(".")[2].partition("_")[0] in SPEEDS]
    assert {name.rpartition(".")[0] for name in angles} == set(parts)
    for name in angles:
        turned, size = integral(recorded, speed_of(name, recorded.names))
        assert recorded[name][-1] - recorded[name][0] == pytest.approx(turned, rel=0, abs=1e-8 * size + 1e-15), name


@pytest.mark.slow
@pytest.mark.parametrize("kind", [name for name in registered() if name not in STANDING])
def test_the_angle_of_any_part_is_the_integral_of_its_speed_and_changes_nothing(kind: str) -> None:
    check_angles(bed_of(kind), ["subject"], 0.4)


@pytest.mark.slow
def test_angles_of_all_parts_go_on_from_mode_to_mode() -> None:
    """A clutch that engages and is torn open by a brake, a gear that rubs and a freewheel."""
    net = clutches()
    net.add(sw.Brake("brake", tau=50.0, t_on=1.0), "a")
    check_angles(net, [part.name for part in net.parts], 2.0)


@pytest.mark.slow
def test_angles_beside_a_gap_go_on_through_all_its_contacts() -> None:
    net = sw.scenes.crane(gap=0.004)
    check_angles(net, [part.name for part in net.parts], 10.0)


def test_angles_are_recorded_beside_travelling_waves() -> None:
    net = sw.Network("wave")
    net.add(sw.TorqueSource("push", tau=10.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Shaft("line", length=10.0, diameter=0.1, model=sw.Wave()), "a", "b")
    net.add(sw.Inertia("K", J=2.0), "b")
    check_angles(net, ["push", "J", "line", "K"], 0.02)


def test_a_gear_has_an_angle_on_each_side_in_its_ratio() -> None:
    net = sw.Network("geared")
    net.add(sw.TorqueSource("push", tau=10.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Gear("gear", ratio=-4.0), "a", "b")
    net.add(sw.Drum("drum", radius=0.5), "b", "rope")
    net.add(sw.Mass("m", m=1.0), "rope")
    sol = net.simulate(2.0, angles=["gear", "drum"])
    np.testing.assert_allclose(sol["gear.phi_a"], -4.0 * sol["gear.phi_b"], rtol=1e-12)
    np.testing.assert_allclose(sol["drum.s_b"], 0.5 * sol["drum.phi_a"], rtol=1e-12)
    inertia = 1.0 + 0.25 / 16
    np.testing.assert_allclose(sol["gear.phi_a"], 10.0 / inertia * sol.t**2 / 2, rtol=1e-9)


def test_what_has_no_speed_has_no_angle_and_says_which_parts_have_one() -> None:
    net = bed_of("Ground")
    for name in ("subject", "nothing"):
        with pytest.raises(sw.SignalError, match=rf"no angle of '{name}'\. Parts with an angle are: 'push0', 'store0'"):
            net.compile(angles=name)


@pytest.mark.slow
def test_the_command_shows_the_angle_of_a_clutch(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "clutches.toml"
    clutches().save(file)
    assert main(["run", str(file), "--t-end", "1", "--signals", "clutch.phi,gear.phi_b"]) == DONE
    shown = capsys.readouterr().out
    assert "clutch.phi" in shown
    assert "gear.phi_b" in shown
