"""ngspice runs the circuits that the library makes of scenes, and finds the motion of their drive trains."""

from __future__ import annotations

import os
import shutil

import numpy as np
import pytest

import shaftwork as sw
from tests.reference.ngspice.cases import CASES, Case
from tests.reference.ngspice.circuit_text import circuit_text, label
from tests.reference.ngspice.runner import converged
from tests.reference.ngspice.test_equivalent_circuits import network

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        shutil.which("ngspice") is None and "CI" not in os.environ, reason="needs ngspice (Debian package); CI has it"
    ),
]
SCENES = {
    "crane-start": (sw.scenes.crane_start(), 2.0, ("J1.omega", "J2.omega")),
    "shaft-chain": (sw.scenes.shaft_chain(m=8), 0.05, ("Je.omega", "Jm.omega")),
    "shaft-step": (sw.scenes.shaft_step(model=sw.Lumped(6)).expanded(), 0.05, ("Je.omega", "Jm.omega")),
}


def compare(net: sw.Network, t_end: float, speeds: tuple[str, ...], tolerance: float) -> None:
    """The voltages of ngspice at some nodes are the speeds of the drive train there, in parts of the largest."""
    circuit = net.circuit()
    nodes = {part.name: part.nodes for part in net.graph().parts}
    names = [net.graph().node_name(nodes[speed.partition(".")[0]]["a"]) for speed in speeds]
    signals = tuple((f"v({label(node)})", speed) for node, speed in zip(names, speeds, strict=True))
    times = np.linspace(0.0, t_end, 101)[1:]
    expected, change = converged(Case(net.name, circuit_text(circuit), (), signals, t_end), times)
    motion = net.simulate(t_end, rtol=1e-10, t_eval=times)
    for column, speed in zip(expected.T, speeds, strict=True):
        error = np.abs(motion[speed] - column).max() / np.abs(column).max()
        assert error < max(2.0 * change, tolerance), f"{speed} differs by {error:.1e}, ngspice changes by {change:.1e}"


@pytest.mark.parametrize("name", SCENES)
def test_the_circuit_of_a_scene_moves_in_ngspice_like_its_drive_train(name: str) -> None:
    # Friction is smooth over 1e-4 rad/s there; of some 100 rad/s that is 1e-6, and the start takes that much longer.
    net, t_end, speeds = SCENES[name]
    compare(net, t_end, speeds, 1e-4)


def motor_on_a_shaft() -> sw.Network:
    net = sw.Network("motor on a shaft")
    net.add(sw.KlossMotor("motor", tau_k=348.8, n_sync=1500.0, s_k=0.355), "rotor")
    net.add(sw.Inertia("J1", J=27.35), "rotor")
    net.add(sw.Spring("shaft", c=24206.0, d=14.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=62.5), "wheel")
    net.add(sw.TorqueSource("load", tau=-2.0 - 0.05 * sw.omega**2), "wheel")
    return net


@pytest.mark.parametrize(
    ("net", "t_end"), [(sw.scenes.shaft_chain(m=4), 0.05), (motor_on_a_shaft(), 1.0)], ids=["shaft-chain", "motor"]
)
def test_the_dual_of_a_train_moves_in_ngspice_like_it(net: sw.Network, t_end: float) -> None:
    """Its currents are speeds, and the law of the motor one of current."""
    dual = net.dual()
    assert dual.analogy is not None
    speeds = [f"{part.name}.omega" for part in net.parts if isinstance(part, sw.Inertia)]
    signals = tuple((f"i(L{label(speed.partition('.')[0])})", speed) for speed in speeds)
    assert all(dual.analogy.quantities[speed] == {speed.replace(".omega", ".i"): 1.0} for speed in speeds)
    times = np.linspace(0.0, t_end, 101)[1:]
    expected, change = converged(Case(dual.name, circuit_text(dual), (), signals, t_end), times)
    motion = net.simulate(t_end, rtol=1e-10, t_eval=times)
    for column, speed in zip(expected.T, speeds, strict=True):
        error = np.abs(motion[speed] - column).max() / np.abs(column).max()
        assert error < max(2.0 * change, 1e-4), f"{speed} differs by {error:.1e}, ngspice changes by {change:.1e}"


@pytest.mark.parametrize("case", [case for case in CASES if "planetary" not in case.name], ids=lambda case: case.name)
def test_the_circuit_of_a_train_moves_in_ngspice_like_it(case: Case) -> None:
    net = network(case)
    inertias = tuple(f"{part.name}.omega" for part in net.parts if isinstance(part, sw.Inertia))
    compare(net, case.t_end, inertias, 0.0)
