"""Networks as decks for ngspice: what the text says, and what ngspice makes of it."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from hypothesis import HealthCheck, given, settings

import shaftwork as sw
from tests.properties.examples import network_of
from tests.spice.ngspice import NEEDS_NGSPICE, run_deck
from tests.strategies import Network, networks


def label(name: str) -> str:
    return "".join(sign if sign.isalnum() else "_" for sign in name).lower()


def errors(net: sw.Network, t_end: float, steps: int, **options: object) -> np.ndarray:
    """How far the speeds of all nodes are from the voltages of ngspice, in parts of the largest of each."""
    raw = run_deck(net.to_spice(t_end=t_end, step=t_end / steps, **options))
    times = np.linspace(0.0, t_end, 52)[1:-1]
    motion = net.simulate(t_end, t_eval=times, rtol=1e-10, **options)
    graph, shares = net.graph(), []
    for node, domain in zip(graph.nodes, graph.domains, strict=True):
        ours, theirs = motion[f"{node}.{domain.across.name}"], np.interp(times, raw["time"], raw[f"v({label(node)})"])
        shares.append(np.abs(ours - theirs).max() / max(np.abs(ours).max(), 1e-9))
    return np.array(shares)


def loaded(*parts: tuple[sw.Component, str]) -> sw.Network:
    """Two inertias with a damped spring between them, and parts at one or the other."""
    net = sw.Network("two masses")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Spring("shaft", c=500.0, d=2.0), "a", "b")
    net.add(sw.Inertia("J2", J=3.0), "b")
    for part, *nodes in parts:
        net.add(part, *nodes)
    return net


MOTOR = (sw.TorqueSource("motor", tau=sw.Table([0, 0.3, 1], [0, 20, 20])), "a")


def line() -> sw.Network:
    net = sw.Network("line")
    net.add(sw.TorqueSource("motor", tau=sw.Ramp(12.7, 1e-2)), "a")
    net.add(sw.Inertia("Je", J=0.025), "a")
    steel = {"length": 100.0, "diameter": 0.02, "density": 7900.0, "shear_modulus": 77.5e9}
    net.add(sw.Shaft("line", model=sw.Wave(), **steel), "a", "b")
    net.add(sw.Inertia("Jm", J=0.11), "b")
    return net


def rectifier() -> sw.Network:
    net = sw.Network("rectifier")
    net.add(sw.VoltageSource("supply", u=10 * sympy.sin(20 * sw.t)), "s", "ground")
    net.add(sw.Diode("diode"), "s", "p")
    net.add(sw.Resistor("R", R=10.0), "p", "ground")
    net.add(sw.Resistor("Rc", R=1.0), "p", "c")
    net.add(sw.Capacitor("C", C=0.01), "c", "ground")
    net.add(sw.Switch("switch", t_on=0.5), "c", "x")
    net.add(sw.Resistor("Rx", R=5.0), "x", "y")
    net.add(sw.Inductor("L", L=0.2), "y", "ground")
    return net


def switch() -> sw.Network:
    net = sw.Network("switch")
    net.add(sw.VoltageSource("supply", u=3 * sympy.sin(20 * sw.t)), "a", "ground")
    net.add(sw.Resistor("Ri", R=1.0), "a", "b")
    net.add(sw.VoltageControlledSwitch("S", u_t=1.0, u_h=0.5, R_on=2.0, R_off=1e5), "b", "c", "a", "ground")
    net.add(sw.Resistor("R", R=10.0), "c", "ground")
    net.add(sw.Capacitor("C", C=0.02), "c", "ground")
    return net


def brushless() -> sw.Network:
    return loaded((sw.AveragedBLDC("motor", U=48.0, R=0.2, L=1e-3, k=0.1, pole_pairs=2), "a"))


# By name a network and the largest error. ngspice solves to 1e-6 of each quantity; its trapezoidal rule at 8000 steps
# leaves less than 1e-5. What sticks creeps: 1e-4 rad/s of some rad/s is a few 1e-5, each time that it sticks.
LAWS, STICKS = 1e-5, 5e-4
SWITCHING = {
    "fan": (loaded(MOTOR, (sw.TorqueSource("fan", tau=-0.1 * sw.omega * sympy.Abs(sw.omega)), "b")), LAWS),
    "pendulum": (loaded((sw.TorqueSource("weight", tau=30 - 60 * sympy.sin(sw.phi)), "a")), LAWS),
    "motor": (loaded((sw.KlossMotor("motor", tau_k=30.0, n_sync=250.0, s_k=0.3), "a")), LAWS),
    "jumps": (loaded((sw.TorqueSource("jumps", tau=sw.Step(20, 0.3) * sympy.sin(9 * sw.t)), "a")), LAWS),
    "pulses": (loaded((sw.TorqueSource("pulses", tau=20 * sw.PWM(0.3, 37.0)), "a")), 3e-5),
    "noise": (
        loaded((sw.TorqueSource("noise", tau=5 + 3 * sw.HeldNoise(sw.t / 0.05, 1) + sw.SmoothNoise(sw.t, 2)), "a")),
        1e-4,  # smooth noise is a table, which is off by 1e-3 of its standard deviation
    ),
    "load that sticks": (loaded(MOTOR, (sw.CoulombLoad("load", tau=7.0), "b")), STICKS),
    "Stribeck": (loaded(MOTOR, (sw.DryFriction("load", tau_c=4.0, tau_s=7.0, d=0.1), "b", "ground")), STICKS),
    "brake": (loaded(MOTOR, (sw.Brake("brake", tau=40.0, t_on=0.5, t_off=0.9), "b", "ground")), STICKS),
    "freewheel": (
        loaded(
            MOTOR,
            (sw.Freewheel("free"), "c", "b"),
            (sw.Inertia("Jc", J=1.0), "c"),
            (sw.TorqueSource("kick", tau=5 * sympy.sin(9 * sw.t)), "c"),
        ),
        1e-4,
    ),
    "gap": (
        loaded(MOTOR, (sw.Backlash("gap", gap=0.02, c=400.0, d=1.0), "b", "c"), (sw.Inertia("Jc", J=1.0), "c")),
        LAWS,
    ),
    "gear that rubs": (
        loaded(
            (sw.LossyGear("gear", ratio=-2.5, efficiency=0.8, efficiency_back=0.6), "b", "c"),
            (sw.Inertia("Jc", J=1.0), "c"),
            (sw.TorqueSource("kick", tau=15 * sympy.sin(9 * sw.t)), "a"),
        ),
        LAWS,
    ),
    "stop": (loaded(MOTOR, (sw.HardStop("stop", upper=0.5, c=4000.0, d=5.0), "b", "ground")), 1e-3),
    "inertia that changes": (loaded(MOTOR, (sw.Inertia("crank", J=2 + sympy.cos(sw.phi)), "b")), 1e-4),
    "waves": (line(), 2e-3),  # ngspice interpolates the history of a line along straight lines
    "rectifier": (rectifier(), 1e-4),
    "switch": (switch(), 1e-3),  # it closes and opens at the end of a step, of 1e-4 s where voltages change at 60 V/s
    "brushless motor": (brushless(), 1e-4),  # its current rises within 40 steps
}


@NEEDS_NGSPICE
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name in ("noise", "motor", "stop"))) for name in SWITCHING]
)
def test_laws_and_parts_that_switch_move_in_ngspice_as_here(name: str) -> None:
    net, tolerance = SWITCHING[name]
    assert errors(net, 1.0, 8000).max() < tolerance


@pytest.mark.slow
@NEEDS_NGSPICE
@settings(max_examples=50, suppress_health_check=[HealthCheck.too_slow])
@given(networks(max_inertias=12))
def test_random_linear_networks_move_in_ngspice_as_here(pieces: Network) -> None:
    """The trapezoidal rule is of second order: of what is left at one step, a sixteenth at a quarter of it."""
    net = network_of(pieces)
    coarse, fine = (errors(net, 0.1, steps) for steps in (2000, 8000))  # coils of 1 ms take 20 steps and 80
    # what ngspice solves to is 1e-6 of a quantity, of small ones 1e-9 V
    assert np.all(fine < np.maximum(0.25 * coarse, 1e-4))


@pytest.mark.slow
@NEEDS_NGSPICE
@pytest.mark.parametrize(
    ("name", "t_end", "tolerance"),
    [("crane_start", 2.0, STICKS), ("crane", 2.0, STICKS), ("shaft_chain", 0.01, 1e-3), ("ship_engine", 0.1, 1e-3)],
)
def test_scenes_move_in_ngspice_as_here(name: str, t_end: float, tolerance: float) -> None:
    # long shafts swing in hundreds of periods, of which a step of the trapezoidal rule turns each by a little
    assert errors(getattr(sw.scenes, name)(), t_end, 8000).max() < tolerance


@NEEDS_NGSPICE
def test_a_motion_in_ngspice_begins_with_the_start_values() -> None:
    net = loaded((sw.Gear("gear", ratio=3.0), "b", "c"), (sw.Inertia("Jc", J=1.0), "c"))
    initial = {"J1.omega": 2.0, "J2.omega": -1.0, "shaft.phi_rel": 0.01}
    assert errors(net, 1.0, 8000, initial=initial).max() < LAWS


def test_the_text_names_parts_nodes_values_and_units() -> None:
    net = sw.Network("crane travel")
    net.add(sw.TorqueSource("motor", tau=sw.Table([0.0, 0.5, 6.0], [0.0, 250.0, 30.0])), "rotor")
    net.add(sw.Inertia("J1", J=27.35), "rotor")
    net.add(sw.Gear("stage 1", ratio=3.0), "rotor", "out")
    net.add(sw.Spring("shaft", c=20000.0, d=14.0), "out", "wheel")
    net.add(sw.Inertia("J2", J=62.5), "wheel")
    net.add(sw.CoulombLoad("load", tau=22.4), "wheel")
    lines = net.to_spice(t_end=6.0).splitlines()
    assert lines[0] == "* crane travel"
    for line in (
        ".param smooth=0.0001 ; speed over which a friction changes its sign, rad/s or m/s",
        "Imotor rotor 0 PWL(0.0 0.0 0.5 -250.0 6.0 -30.0 12.0 -30.0)",
        "* Inertia 'J1' at rotor: J = 27.35 kg*m^2",
        "Cj1 rotor 0 27.35",
        "* Gear 'stage 1' at rotor, out: ratio = 3.0",
        "Vstage_1 rotor stage_1_1 0",
        "Estage_1 stage_1_1 0 out 0 3.0",
        "Fstage_1 out 0 Vstage_1 -3.0",
        "Lshaft out wheel 5e-05",
        "Rshaft_d out wheel 0.07142857142857142",
        "Bload wheel 0 I = 22.4*tanh(v(wheel)/{smooth})",
        ".tran 0.00075 6.0 0 0.00075 uic",
    ):
        assert line in lines
    assert max(map(len, lines)) <= 110


def test_names_that_spice_takes_for_one_get_numbers() -> None:
    net = sw.Network("names")
    for name, node in (("J 1", "GND"), ("j_1", "gnd"), ("ü", "0"), ("ä", "time")):
        net.add(sw.Inertia(name, J=1.0), node)
        net.add(sw.Damper(f"d {name}", d=1.0), node, "ground")
    nodes = [line.split()[1] for line in net.to_spice().splitlines() if line.startswith("C")]
    elements = [line.split()[0] for line in net.to_spice().splitlines() if line[:1] in ("C", "R")]
    assert len({*nodes}) == len(nodes) == 4
    assert len({name.lower() for name in elements}) == len(elements) == 8
    assert not {*nodes} & {"0", "gnd", "time"}


@pytest.mark.parametrize(
    ("law", "text"),
    [
        (3.0, "-3.0"),
        (2 + 3 * sympy.sin(10 * sw.t), "SIN(-2.0 -3.0 1.5915494309189535 0 0 0.0)"),
        (sw.Step(5.0, 0.25), "PWL(0.0 0.0 0.249999875 0.0 0.25 -5.0 1.0 -5.0)"),
        (sw.Ramp(5.0, 0.5), "PWL(0.0 0.0 0.5 -5.0 1.0 -5.0)"),
        (sympy.exp(-sw.t), "-exp(-time)"),
        (4 * sw.PWM(0.25, 10.0), "PULSE(-4.0 0.0 0.0124999375 1.25e-07 1.25e-07 0.07500000000000001 0.1)"),
        (sw.omega**3, "-(v(a)*v(a)*v(a))"),  # the powers of ngspice are those of the size of their base
        (sympy.sqrt(sympy.Abs(sw.omega)), "-sqrt(abs(v(a)))"),
        (sw.Table([0, 1], [2, 3])(sw.omega), "-pwl(max(0.0, min(1.0, v(a))), 0.0, 2.0, 1.0, 3.0)"),
    ],
)
def test_laws_are_written_as_ngspice_reads_them(law: object, text: str) -> None:
    deck = loaded((sw.TorqueSource("law", tau=law), "a")).to_spice(t_end=1.0)
    (row,) = (line for line in deck.splitlines() if line.startswith(("Ilaw", "Blaw")))
    assert row.split(" ", 3)[3].removeprefix("I = ") == text


def test_a_coupling_that_says_what_others_say_is_left_out() -> None:
    net = loaded(
        (sw.Gear("one", ratio=2.0), "b", "c"), (sw.Gear("other", ratio=2.0), "b", "c"), (sw.Inertia("Jc", J=1.0), "c")
    )
    lines = net.to_spice().splitlines()
    assert lines[lines.index("* Gear 'other' at b, c: ratio = 2.0") + 1].startswith("* (left out")


def test_all_parts_without_a_form_in_spice_are_named_together() -> None:
    net = loaded((sw.Backlash("rigid", gap=0.1), "b", "c"), (sw.Inertia("Jc", J=1.0), "c"), MOTOR)
    net.add(sw.LossyGear("rubs", ratio=2.0, efficiency=0.4, efficiency_back=0.0), "c", "d")
    net.add(sw.Inertia("Jd", J=1.0), "d")
    with pytest.raises(sw.NetworkError) as caught:
        net.to_spice()
    assert [problem.parts for problem in caught.value.problems] == [("rigid",), ("rubs",)]
    assert {problem.kind for problem in caught.value.problems} == {"no SPICE form"}


def test_the_refusal_of_a_brushless_motor_says_what_to_take_instead() -> None:
    net = loaded((sw.BLDCMotor("motor", U=48.0, R=0.2, L=1e-3, k=0.1), "a"))
    with pytest.raises(sw.NetworkError, match=r"freewheeling high.* which no law of SPICE.* an AveragedBLDC"):
        net.to_spice()


def test_a_switch_is_written_and_read_again() -> None:
    again = sw.spice.read(switch().to_spice(t_end=1.0)).network
    (part,) = (part for part in again.parts if isinstance(part, sw.VoltageControlledSwitch))
    assert (part.u_t, part.u_h, part.R_on, part.R_off) == (1.0, 0.5, 2.0, 1e5)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"t_end": 0.0}, "t_end"),
        ({"t_end": float("nan")}, "t_end"),
        ({"step": -1.0}, "step"),
        ({"t_end": 1.0, "step": 2.0}, "longer than t_end"),
    ],
)
def test_wrong_times_are_refused(arguments: dict[str, float], words: str) -> None:
    with pytest.raises(sw.ParameterError, match=words):
        loaded(MOTOR).to_spice(**arguments)


def test_the_same_network_gives_the_same_text() -> None:
    assert loaded(MOTOR).to_spice() == loaded(MOTOR).to_spice()
