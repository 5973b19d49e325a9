"""Circuits of drive trains: which elements there are, and that they move as the drive train does."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shaftwork as sw
from shaftwork.scenes import SCENES
from tests.beds import bed_of, registered

TIMES = np.linspace(0.0, 0.3, 7)


def two_masses() -> sw.Network:
    net = sw.Network("two masses")
    net.add(sw.TorqueSource("motor", tau=10.0 * sw.t), "rotor")
    net.add(sw.Inertia("J1", J=2.0), "rotor")
    net.add(sw.Spring("shaft", c=100.0, d=1.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=3.0), "wheel")
    net.add(sw.Gear("gear", ratio=2.5), "wheel", "output")
    net.add(sw.Damper("load", d=0.4), "output")
    return net


def same_motion(net: sw.Network, times: np.ndarray = TIMES, *, of: sw.Network | None = None, start: Any = None) -> None:
    """Every quantity of a network, but power and energy, read from its circuit, to 1e-9 of the largest of its kind.

    Both take steps of the same engine, so that they differ by rounding alone.

    Args:
        net: the network.
        times: at which the two are compared, s.
        of: an analogue of it, by default its circuit.
        start: the values at the start.
    """
    analogue = of or net.circuit()
    assert analogue.analogy is not None
    wanted = net.simulate(times[-1], t_eval=times, rtol=1e-10, initial=start)
    found = analogue.simulate(times[-1], t_eval=times, rtol=1e-10, initial=start and analogue.analogy.initial(start))
    names = [name for name in wanted if not name.endswith((".power", ".energy"))]
    largest: dict[str, float] = {}
    for name in names:
        kind = name.rpartition(".")[2].partition("_")[0]
        largest[kind] = max(largest.get(kind, 1e-3), np.abs(wanted[name]).max())
    for name in names:
        error = np.abs(analogue.analogy.read(found, name) - wanted[name]).max()
        assert error <= 1e-9 * largest[name.rpartition(".")[2].partition("_")[0]], name


def test_the_elements_are_those_of_the_analogy() -> None:
    circuit = two_masses().circuit()
    values = {part.name: (type(part).__name__, *part.values.values()) for part in circuit.parts}
    assert values == {
        "motor": ("CurrentSource", 10.0 * sw.t),
        "J1": ("Capacitor", 2.0),
        "shaft": ("Inductor", 0.01),
        "shaft d": ("Resistor", 1.0),
        "J2": ("Capacitor", 3.0),
        "gear": ("Transformer", 2.5),
        "load": ("Resistor", 2.5),
    }
    assert circuit.check() == ()


def test_names_of_quantities_are_told_by_the_analogy() -> None:
    analogy = two_masses().circuit().analogy
    assert analogy is not None
    assert analogy.quantities["J1.omega"] == {"J1.u": 1.0}
    assert analogy.quantities["shaft.tau"] == {"shaft.i": 1.0, "shaft d.i": 1.0}
    assert analogy.quantities["rotor.omega"] == {"rotor.u": 1.0}
    assert analogy.initial({"J1.omega": 3.0, "shaft.phi_rel": 0.1}) == pytest.approx({"J1.u": 3.0, "shaft.i": 10.0})


def test_what_a_sum_is_cannot_be_given_at_the_start() -> None:
    analogy = two_masses().circuit().analogy
    assert analogy is not None
    with pytest.raises(sw.ParameterError, match=r"'shaft\.tau' is shaft\.i \+ shaft d\.i in 'circuit of two masses'"):
        analogy.initial({"shaft.tau": 1.0})
    with pytest.raises(sw.SignalError, match=r"'two masses' has no quantity 'J1\.omga' .* Near it: J1\.omega"):
        analogy.initial({"J1.omga": 1.0})


def test_start_values_lead_to_the_same_motion() -> None:
    net, initial = two_masses(), {"J1.omega": 3.0, "shaft.phi_rel": 0.1}
    circuit = net.circuit()
    assert circuit.analogy is not None
    wanted = net.simulate(1.0, initial=initial, t_eval=TIMES)
    found = circuit.simulate(1.0, initial=circuit.analogy.initial(initial), t_eval=TIMES)
    np.testing.assert_allclose(found["J2.u"], wanted["J2.omega"], rtol=1e-12)


WITHOUT_CIRCUIT = ("StateSpaceController", "TransferFunctionController")
"""Parts that measure others by name, and these have other names there."""
LONG = ("Shaft", "BucketWheelLoad", "BLDCMotor", "RandomLoad", "Rope", "FrequencyDrive", "PumpLoad")
"""Parts whose equations take more than a second, twice."""


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] * (name in LONG))
        for name in registered()
        if name not in WITHOUT_CIRCUIT
    ],
)
def test_the_circuit_of_every_part_moves_as_it_does(name: str) -> None:
    same_motion(bed_of(name))


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in SCENES if name not in ("bldc-shaft", "ship-line")])
def test_the_circuit_of_a_scene_moves_as_it_does(name: str) -> None:
    same_motion(SCENES[name]())


def test_waves_travel_in_circuits_too() -> None:
    net = sw.Network("line")
    net.add(sw.TorqueSource("motor", tau=10.0), "a")
    net.add(sw.Inertia("J1", J=0.02), "a")
    net.add(sw.Shaft("line", length=3.0, diameter=0.05, model=sw.Wave()), "a", "b")
    net.add(sw.Inertia("J2", J=0.05), "b")
    same_motion(net, np.linspace(0.0, 0.01, 5))


@pytest.mark.slow
def test_phases_and_events_of_a_circuit_are_those_of_the_train() -> None:
    net = sw.scenes.six_phases()
    wanted, found = net.simulate(1.0), net.circuit().simulate(1.0)
    assert [row.name for row in found.phases] == [row.name for row in wanted.phases]
    np.testing.assert_allclose([t for t, *_ in found.events], [t for t, *_ in wanted.events], rtol=1e-9)


def test_a_circuit_leads_back_to_its_drive_train() -> None:
    net = sw.Network("hoist")
    net.add(sw.TorqueSource("motor", tau=60.0 - 2 * sw.omega), "a")
    net.add(sw.Inertia("J1", J=0.5), "a")
    net.add(sw.Backlash("gap", gap=0.25, c=1e4), "a", "shaft")
    net.add(sw.Inertia("J2", J=0.5), "shaft")
    net.add(sw.Gear("gear", ratio=4.0), "shaft", "drum")
    net.add(sw.PlanetaryGear("planetary", ratio=2.0), "drum", "x", "ring")
    net.add(sw.Inertia("J3", J=1.0), "x")
    net.add(sw.Inertia("J4", J=1.0), "ring")
    net.add(sw.Drum("drum", radius=0.25), "x", "rope")
    net.add(sw.TranslationalSpring("line", c=1024.0, d=4.0), "rope", "load")
    net.add(sw.Mass("mass", m=10.0), "load")
    net.add(sw.CoulombLoad("friction", tau=3.0), "a")
    back = net.circuit().mechanical()
    parts = {part.name: part for part in back.parts}
    assert all(parts[part.name] == part for part in net.parts if part.name != "motor")
    assert parts["motor"] == sw.TorqueSource("motor", tau=60.0)
    assert parts["motor 1"] == sw.Damper("motor 1", d=2.0)


@pytest.mark.parametrize(("R", "L"), [(0.5, 0.01), (0.5, 0.0), (0.0, 0.01), (0.0, 0.0)])
def test_a_machine_has_its_armature_again(R: float, L: float) -> None:
    net = sw.Network("machine")
    net.add(sw.VoltageSource("supply", u=24.0), "s", "ground")
    net.add(sw.Resistor("cable", R=0.1), "s", "p")
    net.add(sw.DCMachine("machine", k=0.3, R=R, L=L), "p", "ground", "rotor")
    net.add(sw.Inertia("J", J=0.02), "rotor")
    assert {part.name: part for part in net.circuit().mechanical().parts} == {part.name: part for part in net.parts}


def test_a_circuit_of_ones_own_has_a_drive_train() -> None:
    net = sw.Network("filter")
    net.add(sw.CurrentSource("supply", i=2.0), "a", "ground")
    net.add(sw.Capacitor("C", C=0.5), "a", "ground")
    net.add(sw.Inductor("L", L=0.25), "a", "b")
    net.add(sw.Resistor("R", R=4.0), "b", "ground")
    train = net.mechanical()
    assert [(type(part).__name__, part.name) for part in train.parts] == [
        ("TorqueSource", "supply"), ("Inertia", "C"), ("Spring", "L"), ("Damper", "R"),
    ]  # fmt: skip
    motion, same = net.simulate(1.0, t_eval=TIMES), train.simulate(1.0, t_eval=TIMES)
    np.testing.assert_allclose(same["C.omega"], motion["C.u"], rtol=1e-9)


def test_a_capacitor_between_two_nodes_has_no_drive_train() -> None:
    net = sw.Network("filter")
    net.add(sw.CurrentSource("supply", i=2.0), "a", "ground")
    net.add(sw.Resistor("R", R=4.0), "a", "ground")
    net.add(sw.Capacitor("C", C=0.5), "a", "b")
    net.add(sw.Resistor("R2", R=4.0), "b", "ground")
    with pytest.raises(sw.NetworkError, match=r"Capacitor 'C' stands between nodes 'a', 'b'.*Join one of its ends"):
        net.mechanical()


def test_a_circuit_is_the_same_after_it_was_saved(tmp_path: Path) -> None:
    circuit = sw.scenes.six_phases().circuit()
    circuit.save(tmp_path / "circuit.toml")
    assert sw.Network.load(tmp_path / "circuit.toml") == circuit


def test_an_image_can_be_pickled() -> None:
    gap = next(part for part in sw.scenes.six_phases().circuit().parts if "Backlash" in type(part).__name__)
    assert pickle.loads(pickle.dumps(gap)) == gap  # noqa: S301 (our own)


def test_a_network_with_errors_has_no_circuit() -> None:
    net = sw.Network("torque on nothing")
    net.add(sw.TorqueSource("motor", tau=1.0), "rotor")
    for verb in (net.circuit, net.dual, net.mechanical):
        with pytest.raises(sw.NetworkError, match="cannot be assembled"):
            verb()
