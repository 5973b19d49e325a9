"""Networks in Modelica: what rumoca, a compiler of others, makes of the texts, and what is refused."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
import sympy
from hypothesis import given

import shaftwork as sw
from tests.beds import bed_of, registered
from tests.coupled import COUPLED
from tests.modelica.rumoca_runs import deviation, stores
from tests.properties.examples import network_of, share_of_examples
from tests.strategies import Network as Pieces
from tests.strategies import networks

AGREES = 2e-5
"""Relative: rumoca's implicit engine keeps 1e-9 a step, and what it has made of 1e-9 at the end of these motions."""
REFUSED = {
    "LossyGear": "LossyGear, which is not inline",
    "Backlash": "Give its flanks a stiffness c",
    "TranslationalBacklash": "Give its flanks a stiffness c",
    "BLDCMotor": "changes its mode in a way that is not written",
    "VoltageControlledSwitch": "has no Modelica form",
    "StateSpaceController": "which no model of a part can",
    "TransferFunctionController": "which no model of a part can",
}
WITHOUT_MASS = ("DryFriction", "Brake", "Clutch")
"""Their beds have no inertia at their nodes, where their acceleration would be anything."""


def crane(**options: object) -> sw.Network:
    """Motor, two masses, a gap and a brake."""
    net = sw.Network("crane travel")
    net.add(sw.KlossMotor("motor", tau_k=9.6, s_k=0.25, n_sync=3000, ratio=35.5, efficiency=0.95), "rotor")
    net.add(sw.Inertia("J1", J=27.35), "rotor")
    net.add(sw.Spring("shaft", c=24206.0, d=14.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=62.5), "wheel")
    net.add(sw.CoulombLoad("load", tau=22.4, **options), "wheel")
    return net


def swing() -> sw.Network:
    """One inertia that a torque of time swings."""
    net = sw.Network("swing")
    net.add(sw.TorqueSource("motor", tau=5 * sympy.sin(3 * sw.t)), "a")
    net.add(sw.Inertia("J1", J=2.0), "a")
    return net


def test_a_part_is_an_instance_of_the_standard_library_where_that_has_one() -> None:
    text = crane().to_modelica(t_end=6.5)
    assert "Modelica.Mechanics.Rotational.Components.SpringDamper shaft(c = 24206, d = 14) " in text
    assert "J1(J = 27.35, w(start = 0, fixed = true), phi(start = 0, fixed = true))" in text
    assert 'connect(shaft.flange_b, J2.flange_a) "wheel";' in text
    assert "annotation(experiment(StartTime = 0, StopTime = 6.5, Tolerance = 1e-8));" in text
    assert "package Modelica" not in text


def test_a_part_that_the_library_has_not_is_a_model_with_units_and_meanings() -> None:
    text = crane().to_modelica()
    assert "KlossMotor motor(tau_k = 9.6, s_k = 0.25, n_sync = 3000, ratio = 35.5, efficiency = 0.95)" in text
    assert 'parameter Real tau_k(unit = "N.m") "pull-out torque at the motor shaft";' in text


def test_parts_with_the_same_equations_share_a_model() -> None:
    net = crane()
    net.add(sw.CoulombLoad("bearing", tau=1.0), "rotor")
    assert len(re.findall(r"^  model CoulombLoad", net.to_modelica(), re.MULTILINE)) == 1


def test_a_long_shaft_is_written_with_loops() -> None:
    net = crane()
    net.add(sw.Shaft("line", length=10.0, diameter=0.1, model=sw.Lumped(400)), "wheel", "far")
    text = net.to_modelica()
    assert "for k in 1:400 loop" in text
    assert len(text.splitlines()) < 130


def test_the_flat_form_has_parameters_states_rates_and_quantities() -> None:
    text = crane(omega_s=0.1).to_modelica(form="flat", initial={"J1.omega": 3.0})
    assert 'parameter Real shaft_c(unit = "N.m/rad") = 24206 "shaft.c, torsional stiffness' in text
    assert 'Real J1_omega(start = 3, fixed = true, unit = "rad/s") "J1.omega";' in text
    assert "der(shaft_tau_c) = shaft_c*(J1_omega - J2_omega);" in text
    assert 'output Real shaft_tau(unit = "N.m") "shaft.tau";' in text


def test_names_are_identifiers_each_once() -> None:
    net = sw.Network("3 masses: der Zug")
    net.add(sw.Inertia("J 1", J=1.0), "a")
    net.add(sw.Inertia("J_1", J=2.0), "b")
    net.add(sw.Spring("while", c=30.0), "a", "b")
    net.add(sw.TorqueSource("é", tau=1.0), "a")
    text = net.to_modelica(library="inline")
    assert text.startswith('package x_3_masses__der_Zug "3 masses: der Zug"')
    pairs = {"J 1.omega": "J_1.w", "J_1.omega": "J_1_2.w"}
    assert deviation(net, pairs, 1.0, text=text) < AGREES


def test_the_same_network_gives_the_same_text() -> None:
    assert crane().to_modelica() == crane().to_modelica()


def test_the_text_is_written_to_a_file(tmp_path: Path) -> None:
    text = crane().to_modelica(tmp_path / "crane.mo")
    assert (tmp_path / "crane.mo").read_text(encoding="utf-8") == text


@share_of_examples(1.0)
@given(networks(max_inertias=8, dependent=False))  # of others rumoca finds 1 step in 300 runs wrong and stops
def test_random_networks_move_alike_by_parts(pieces: Pieces) -> None:
    net = network_of(pieces)
    assert deviation(net, stores(net, flat=False), 0.5, text=net.to_modelica(library="inline")) < AGREES


@share_of_examples(1.0)
@given(networks(max_inertias=8))
def test_random_networks_move_alike_by_their_equations(pieces: Pieces) -> None:
    net = network_of(pieces)
    assert deviation(net, stores(net, flat=True), 0.5, text=net.to_modelica(form="flat")) < AGREES


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::shaftwork.NetworkWarning")
@pytest.mark.parametrize("name", [name for name in registered() if name not in WITHOUT_MASS])
def test_every_part_moves_alike_or_is_refused_by_name(name: str) -> None:
    net = bed_of(name)
    if name in REFUSED:
        with pytest.raises(sw.CompileError, match=REFUSED[name]) as refusal:
            net.to_modelica(library="inline")
        assert "'subject'" in str(refusal.value)
        return
    text = net.to_modelica(library="inline")
    assert deviation(net, stores(net, flat=False), 1.0, text=text) < AGREES


def test_a_gear_that_says_what_others_say_is_left_out() -> None:
    net = crane()
    net.remove("load")
    for name, ratio, node in (("one", 2.0, "slow"), ("other", 2.0, "slow")):
        net.add(sw.Gear(name, ratio=ratio), "wheel", node)
    net.add(sw.Inertia("J3", J=5.0), "slow")
    text = net.to_modelica(library="inline")
    assert "// other, a Gear, is left out: other couplings say the same" in text
    assert deviation(net, stores(net, flat=False), 0.5, text=text) < AGREES


def gap() -> sw.Network:
    net = swing()
    net.add(sw.Backlash("gap", gap=0.1, c=1e3, d=3.0), "a", "b")
    net.add(sw.Inertia("J2", J=1.0), "b")
    return net


def brake() -> sw.Network:
    net = sw.Network("brake")
    net.add(sw.TorqueSource("motor", tau=sw.Step(5.0, 0.2)), "a")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Brake("brake", tau=20.0, t_on=1.0, t_off=2.0), "a")
    net.add(sw.DryFriction("bearing", tau_c=1.0, tau_s=1.5, d=0.1), "a")
    return net


def light_brake() -> sw.Network:
    """The brake holds a light rotor, which is thrown back at once where the wrong side of the friction is tried."""
    net = swing()
    net.add(sw.Spring("shaft", c=130.0, d=2.8), "a", "b")
    net.add(sw.Inertia("J2", J=0.07), "b")
    net.add(sw.Brake("brake", tau=11.0, t_on=0.24, t_off=0.85), "b")
    return net


def bridge() -> sw.Network:
    """Four diodes, of which two switch at once."""
    net = sw.Network("bridge")
    net.add(sw.VoltageSource("supply", u=20 * sympy.sin(30 * sw.t)), "s", "ground")
    net.add(sw.Resistor("Rs", R=0.5), "s", "s1")
    for name, p, n in (("D1", "s1", "p"), ("D2", "ground", "p"), ("D3", "n", "s1"), ("D4", "n", "ground")):
        net.add(sw.Diode(name), p, n)
    net.add(sw.Resistor("R", R=10.0), "p", "n")
    net.add(sw.Capacitor("C", C=5e-3), "p", "n")
    net.add(sw.Resistor("Rg", R=20.0), "n", "ground")
    return net


def clutch() -> sw.Network:
    net = sw.Network("clutch")
    net.add(sw.TorqueSource("motor", tau=3.0), "a")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Clutch("clutch", tau=10.0, t_on=1.0), "a", "b")
    net.add(sw.Inertia("J2", J=1.0), "b")
    net.add(sw.Damper("loss", d=0.5), "b", "ground")
    return net


def freewheel() -> sw.Network:
    net = swing()
    net.add(sw.Freewheel("freewheel"), "a", "b")
    net.add(sw.Inertia("J2", J=1.0), "b")
    net.add(sw.Damper("loss", d=0.5), "b", "ground")
    return net


@pytest.mark.parametrize("build", [gap, brake, light_brake, clutch, freewheel, bridge])
def test_parts_that_change_their_mode_move_alike(build: object) -> None:
    net = build()  # type: ignore[operator]
    text = net.to_modelica(library="inline", t_end=4.0)
    assert deviation(net, stores(net, flat=False), 4.0, text=text) < AGREES


def test_a_gap_moves_alike_by_its_equations_and_shows_its_torque() -> None:
    net = gap()
    text = net.to_modelica(form="flat")
    assert deviation(net, stores(net, flat=True), 2.0, text=text) < AGREES
    # the flanks are stiff: they show 1e3 times the error of the twist
    assert deviation(net, {"gap.tau": "gap_tau"}, 2.0, text=text) < 1e-4


def pendulum() -> sw.Network:
    net = sw.Network("pendulum")
    net.add(sw.Inertia("J", J=2 + sympy.cos(sw.phi)), "a")
    net.add(sw.TorqueSource("weight", tau=-5 * sympy.sin(sw.phi) + sw.Table([0, 0.5, 1], [0, 3, 1])(sw.t)), "a")
    net.add(sw.Spring("shaft", c=10 + 50 * sw.phi**2, d=0.1), "a", "b")
    net.add(sw.Inertia("J2", J=2.0), "b")
    return net


def in_series() -> sw.Network:
    net = sw.Network("in series")
    net.add(sw.SpeedSource("drive", omega=sw.Ramp(5.0, 0.5)), "a")
    net.add(sw.Spring("one", c=100.0, d=1.0), "a", "b")
    net.add(sw.Spring("other", c=50.0, d=2.0), "b", "c")
    net.add(sw.Inertia("J2", J=2.0), "c")
    return net


@pytest.mark.parametrize("form", ["component", "flat"])
@pytest.mark.parametrize("build", [pendulum, in_series])
def test_laws_of_angles_and_tables_and_nodes_without_mass_move_alike(build: object, form: str) -> None:
    net = build()  # type: ignore[operator]
    text = net.to_modelica(form=form, library="inline")
    pairs = {"J2.omega": "J2_omega" if form == "flat" else "J2.w"}
    assert deviation(net, pairs, 1.0, text=text) < AGREES


@pytest.mark.parametrize("build", COUPLED.values(), ids=COUPLED)
def test_many_that_determine_each_other_are_simultaneous_equations(build: Callable[[int], sw.Network]) -> None:
    net = build(2)
    assert deviation(net, stores(net, flat=True), 0.5, text=net.to_modelica(form="flat")) < AGREES


@pytest.mark.parametrize(
    "noise", [sw.HeldNoise(sw.t / 0.05, 1), pytest.param(sw.SmoothNoise(sw.t / 0.2, -2.5), marks=pytest.mark.slow)]
)
def test_noise_has_the_same_numbers(noise: sympy.Expr) -> None:
    net = sw.Network("wind")
    net.add(sw.TorqueSource("wind", tau=5 * noise), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    for form in ("component", "flat"):
        text = net.to_modelica(form=form, library="inline")
        assert deviation(net, stores(net, flat=form == "flat"), 2.0, text=text) < AGREES


def test_a_travelling_wave_arrives_late() -> None:
    net = sw.Network("wave")
    net.add(sw.TorqueSource("motor", tau=10 * sympy.sin(20 * sw.t)), "a")
    net.add(sw.Inertia("J1", J=0.2), "a")
    net.add(sw.Shaft("line", length=300.0, diameter=0.1, model=sw.Wave()), "a", "b")
    net.add(sw.Inertia("J2", J=0.2), "b")
    text = net.to_modelica(library="inline")
    assert "delay(" in text
    # rumoca interpolates what is late along straight lines between its steps
    assert deviation(net, stores(net, flat=False), 0.5, text=text) < 1e-2


def test_start_values_are_those_of_a_simulation() -> None:
    net, start = crane(omega_s=0.1), {"J1.omega": 3.0, "shaft.tau": 50.0}
    text = net.to_modelica(form="flat", initial=start)
    assert deviation(net, stores(net, flat=True), 1.0, text=text, initial=start) < AGREES
    with pytest.raises(sw.CompileError, match=r"the start value of shaft\.tau_c has no place"):
        net.to_modelica(initial=start)
    text = net.to_modelica(library="inline", initial={"J1.omega": 3.0})
    assert deviation(net, stores(net, flat=False), 1.0, text=text, initial={"J1.omega": 3.0}) < AGREES


@pytest.mark.slow
@pytest.mark.parametrize("name", ["crane-start", "crane", "six-phases", "crane-train", "shaft-step", "ship-engine"])
def test_scenes_move_alike(name: str) -> None:
    scene = sw.scenes.SCENES[name]
    net = scene()
    text = net.to_modelica(library="inline", t_end=scene.t_end)
    assert deviation(net, stores(net, flat=False), scene.t_end, text=text) < AGREES


def test_what_has_no_such_form_is_refused_by_name() -> None:
    net = crane()
    net.add(sw.Brake("brake", tau=50.0, on=sw.omega - 3), "wheel")
    net.add(sw.Backlash("gap", gap=0.1), "wheel", "hook")
    net.add(sw.Inertia("J3", J=1.0), "hook")
    with pytest.raises(sw.CompileError, match=r"Brake 'brake': a law `on` .* Backlash 'gap' .* stiffness c\."):
        net.to_modelica()
    with pytest.raises(sw.CompileError, match=r"CoulombLoad 'load', Brake 'brake', Backlash 'gap' would change"):
        net.to_modelica(form="flat")


def test_a_speed_that_jumps_has_no_flat_form_where_an_inertia_follows_it() -> None:
    net = sw.Network("driven")
    net.add(sw.SpeedSource("drive", omega=sw.Step(5.0, 0.3)), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    impulse = pytest.warns(sw.NetworkWarning, match="the torque is an impulse")
    with impulse, pytest.raises(sw.CompileError, match=r"SpeedSource 'drive' jumps at t = 0\.3 s"):
        net.to_modelica(form="flat")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"form": "blocks"}, "form = 'blocks' must be 'component' or 'flat'"),
        ({"library": None}, "library = None must be 'standard' or 'inline'"),
        ({"t_end": 0.0}, "t_end"),
        ({"path": "nowhere/crane.mo"}, "There is no folder 'nowhere'"),
    ],
)
def test_wrong_options_are_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(sw.ParameterError, match=message):
        crane().to_modelica(**options)  # type: ignore[arg-type]
