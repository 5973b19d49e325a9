"""The FMU of each scene moves as the scene does, with every event; and so do those of random networks."""

from __future__ import annotations

import shutil
import zipfile
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given

import shaftwork as sw
from shaftwork.fmu.export_unit import _code
from shaftwork.scenes import SCENES

fmpy = pytest.importorskip("fmpy")

from fmpy.validation import validate_fmu  # noqa: E402 (only where FMPy is installed)

from tests.fmu.units import KINDS, VERSIONS, instances  # noqa: E402
from tests.properties.examples import network_of, share_of_examples  # noqa: E402
from tests.strategies import Network, networks  # noqa: E402

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(shutil.which("gcc") is None, reason="FMUs are compiled by gcc"),
]

SPANS = {
    "excavator-train": 1.0,
    "shaft-chain": 0.02,
    "shaft-step": 0.02,
    "ship-line": 0.1,
    "crane-train": 1.0,
    "bldc-shaft": 0.05,
}
"""Of model exchange, s, where FMPy's solver takes thousands of steps of low order for each swing of the shafts."""


@lru_cache(maxsize=2)
def model_of(scene: str) -> sw.Model:
    return SCENES[scene]().compile()


@pytest.mark.parametrize("scene", SCENES)
def test_a_scene_moves_as_its_unit(scene: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """To 1e-6 of the largest value of each state; FMPy's solver is asked for more, as it loses some in each step."""
    model = model_of(scene)
    states = list(model.states)
    code = _code(model, (), None)
    monkeypatch.setattr("shaftwork.fmu.export_unit._code", lambda *_arguments: code)  # the same for both versions
    for version in VERSIONS:
        path = tmp_path / f"unit{version[0]}.fmu"
        model.to_fmu(path, version=version)
        assert validate_fmu(str(path)) == []
        with zipfile.ZipFile(path) as archive:
            sizes = [item.file_size for item in archive.infolist() if item.filename.startswith("binaries")]
        assert sizes[0] < 200_000
    for kind in KINDS:
        end = SPANS.get(scene, SCENES[scene].t_end) if kind == "ModelExchange" else SCENES[scene].t_end
        times = np.linspace(0.0, end, 401)
        motion = model.simulate(end, rtol=1e-11, t_eval=times)
        for version in VERSIONS:
            seen = fmpy.simulate_fmu(
                str(tmp_path / f"unit{version[0]}.fmu"),
                fmi_type=kind,
                stop_time=end,
                output_interval=times[1],
                relative_tolerance=1e-12,
                output=states,
                record_events=False,
            )
            np.testing.assert_allclose(seen["time"], times, atol=1e-9)
            for name in states:
                size = 1e-6 * max(np.abs(motion[name]).max(), 1e-3)
                says = f"{kind} {version} {name}"
                np.testing.assert_allclose(seen[name], motion[name], atol=size, rtol=0.0, err_msg=says)


@pytest.mark.parametrize("version", VERSIONS)
def test_a_state_saved_while_a_brake_holds_is_restored_with_its_modes(version: str, tmp_path: Path) -> None:
    path = tmp_path / "crane.fmu"
    model_of("crane").to_fmu(path, version=version, outputs=["J2.omega", "shaft.tau"])
    names = ("time", "J1.omega", "J2.omega", "shaft.tau")
    with instances(path, "CoSimulation", 2) as (one, other):
        one.begin(tolerance=1e-9)
        other.begin(tolerance=1e-9)
        seen = []
        for k in range(100):
            if k == 30:
                state = one.keep()
                data = one.serialised(state)
            one.step(0.1 * k, 0.1)
            seen.append(one.get(*names))
        one.restore(state)
        copy = other.deserialised(data)
        other.restore(copy)
        for k in range(30, 100):
            one.step(0.1 * k, 0.1)
            other.step(0.1 * k, 0.1)
            assert one.get(*names) == other.get(*names) == seen[k]
        one.drop(state)
        other.drop(copy)


@pytest.mark.parametrize("kind", KINDS)
def test_an_input_makes_friction_slip_and_stick(kind: str, tmp_path: Path) -> None:
    def driven(tau: object) -> sw.Network:
        net = sw.Network("driven")
        net.add(sw.TorqueSource("motor", tau=tau), "rotor")
        net.add(sw.Inertia("J1", J=1.5), "rotor")
        net.add(sw.DryFriction("f", tau_c=5.0, tau_s=6.0, omega_s=0.1), "rotor")
        return net

    path = tmp_path / "unit.fmu"
    driven(0.0).compile().to_fmu(path, inputs=["motor.tau"])
    times, torques = [0.0, 0.5, 0.5, 1.2, 1.2, 2.0], [5.5, 5.5, 9.0, 9.0, 2.0, 2.0]
    signals = np.array(list(zip(times, torques, strict=True)), dtype=[("time", float), ("motor.tau", float)])
    seen = fmpy.simulate_fmu(
        str(path),
        fmi_type=kind,
        stop_time=2.0,
        output_interval=0.1,
        relative_tolerance=1e-10,
        input=signals,
        output=["J1.omega"],
        record_events=False,
    )
    law = 5.5 + sw.Step(3.5, 0.5) + sw.Step(-7.0, 1.2)
    motion = driven(law).simulate(2.0, rtol=1e-11, t_eval=seen["time"])
    assert motion["J1.omega"].max() > 1.0
    np.testing.assert_allclose(seen["J1.omega"], motion["J1.omega"], atol=1e-6)


def test_tables_and_noise_travel(tmp_path: Path) -> None:
    net = sw.Network("random load")
    curve = sw.Table([0.0, 10.0, 20.0], [8.0, 6.0, 0.0])
    net.add(sw.TorqueSource("motor", tau=curve(sw.omega)), "rotor")
    net.add(sw.Inertia("J1", J=0.5), "rotor")
    net.add(sw.Spring("shaft", c=300.0, d=1.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=1.0), "wheel")
    net.add(sw.TorqueSource("held", tau=-2.0 - sw.HeldNoise(sw.t / 0.05, 3)), "wheel")
    net.add(sw.TorqueSource("smooth", tau=0.5 * sw.SmoothNoise(sw.t / 0.1, 4)), "wheel")
    model, path = net.compile(), tmp_path / "unit.fmu"
    model.to_fmu(path, outputs=["J1.omega", "shaft.tau"])
    for kind in KINDS:
        seen = fmpy.simulate_fmu(
            str(path), fmi_type=kind, stop_time=2.0, output_interval=0.02, relative_tolerance=1e-11, record_events=False
        )
        motion = model.simulate(2.0, rtol=1e-11, t_eval=seen["time"])
        for name in ("J1.omega", "shaft.tau"):
            np.testing.assert_allclose(seen[name], motion[name], atol=1e-6 * np.abs(motion[name]).max())


@share_of_examples(0.25)
@given(networks(max_inertias=6))
def test_units_of_random_networks_are_valid_and_move_alike(
    tmp_path_factory: pytest.TempPathFactory, pieces: Network
) -> None:
    model, path = network_of(pieces).compile(), tmp_path_factory.mktemp("random") / "unit.fmu"
    states = list(model.states)
    model.to_fmu(path, version="2.0" if len(states) % 2 else "3.0", outputs=states)
    assert validate_fmu(str(path)) == []
    seen = fmpy.simulate_fmu(
        str(path), fmi_type="CoSimulation", stop_time=0.1, output_interval=0.01, relative_tolerance=1e-10
    )
    motion = model.simulate(0.1, rtol=1e-11, t_eval=seen["time"])
    for name in states:
        np.testing.assert_allclose(seen[name], motion[name], atol=1e-6 * max(1e-3, np.abs(motion[name]).max()))
