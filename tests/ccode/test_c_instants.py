"""C code where few networks lead: who carries at rest, sources that jump, massless nodes, instants of the time."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import sympy
from sympy import Abs, Max, Min, Piecewise, cos, floor, pi, sin, sqrt

import shaftwork as sw
from shaftwork.ccode.c_export import c_code
from shaftwork.core.errors import CompileError
from tests.ccode.library import Library

RTOL = 1e-11
MOTION = 1e-8
"""Of the largest value: two methods with a tolerance of 1e-11 differ by some hundred times that after many periods."""


def assert_moves_as_in_the_library(
    net: sw.Network, t_end: float, folder: Path, initial: Mapping[str, float] | None = None
) -> Library:
    """Outputs at twenty times are those of `simulate`."""
    model, start = net.compile(), dict(initial or {})
    library = Library(c_code(model), folder)
    for name, value in start.items():
        library.struct.start[library.code.stores.index(name)] = value
    library.call("start", 0.0)
    sol = model.simulate(t_end, rtol=RTOL, initial=start)
    for t in (t_end * np.arange(1, 21) / 20.03).tolist():
        library.call("integrate", t, RTOL)
        at = sol.at([t])
        for name, value in library.outputs().items():
            assert value == pytest.approx(at[name][0], abs=MOTION * max(np.abs(sol[name]).max(), 1e-3)), (name, t)
    return library


def pulled(tau: object, *parts: sw.Component) -> sw.Network:
    net = sw.Network("pulled")
    net.add(sw.Inertia("J", J=1.0), "wheel")
    net.add(sw.TorqueSource("pull", tau=tau), "wheel")
    for part in parts:
        net.add(part, "wheel")
    return net


@pytest.mark.parametrize(
    ("tau", "other"),
    [
        (12.0 * sin(sw.t), sw.Freewheel("stop")),
        (12.0 * sin(sw.t), sw.Brake("brake", tau=20.0, t_off=2.8)),
        (sw.Table([0.0, 1.2, 1.9], [0.0, 12.0, 5.0])(sw.t), sw.Brake("brake", tau=20.0)),
    ],
    ids=["backstop", "brake", "bend"],
)
def test_of_several_that_hold_a_shaft_the_same_one_carries(tau: object, other: sw.Component, tmp_path: Path) -> None:
    shoe = sw.DryFriction("shoe", tau_c=3.0, tau_s=10.0, omega_s=0.0)
    library = assert_moves_as_in_the_library(pulled(tau, shoe, other), 3.5, tmp_path)
    assert library.struct.events >= 2


@pytest.mark.parametrize("between", [sw.Freewheel("joint"), sw.Clutch("joint", tau=3.0)], ids=["freewheel", "clutch"])
def test_what_a_prescribed_speed_holds_lets_go_where_that_jumps(between: sw.Component, tmp_path: Path) -> None:
    """The inertia behind the source is no state as long as it is joined, and its speed jumps all the same."""
    net = sw.Network("jump")
    net.add(sw.SpeedSource("drive", omega=sw.Step(-5.0, 0.05, before=10.0)), "a")
    net.add(between, "a", "b")
    net.add(sw.Inertia("J", J=1.0), "b")
    net.add(sw.Damper("oil", d=0.1), "b")
    library = assert_moves_as_in_the_library(net, 0.1, tmp_path, {"J.omega": 10.0})
    assert library.outputs()["J.omega"] > 9.5


def test_an_impact_beside_a_massless_node_throws_back(tmp_path: Path) -> None:
    """The end of a damper between two freewheels: no impulse passes it, and none tells whether they press."""
    net = sw.Network("massless")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.TorqueSource("T1", tau=10.0), "a")
    net.add(sw.DryFriction("shoe", tau_c=1.0), "a", "b")
    net.add(sw.Inertia("J2", J=2.0), "b")
    net.add(sw.Freewheel("first"), "b", "c")
    net.add(sw.Damper("oil", d=1.0), "c")
    net.add(sw.Freewheel("second"), "c", "d")
    net.add(sw.Inertia("J3", J=1.0), "d")
    net.add(sw.TorqueSource("T3", tau=8.0), "d")
    net.add(sw.HardStop("stop", upper=0.15, restitution=0.5), "d")
    assert_moves_as_in_the_library(net, 0.3, tmp_path, {"J1.omega": 5.0, "J2.omega": 4.0, "J3.omega": 4.0})


def test_a_freewheel_that_alone_carries_the_torque_of_a_spring_stays_locked_in_an_impact(tmp_path: Path) -> None:
    net = sw.Network("carrying")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.TorqueSource("T", tau=20.0), "a")
    net.add(sw.Spring("shaft", c=200.0), "a", "b")
    net.add(sw.Freewheel("freewheel"), "b", "c")
    net.add(sw.Inertia("J2", J=1.0), "c")
    net.add(sw.HardStop("stop", upper=0.2, restitution=0.5), "c")
    assert_moves_as_in_the_library(net, 1.0, tmp_path)


def test_an_impact_loses_no_digits(tmp_path: Path) -> None:
    """Momentum and the share of the speed that comes back: closed form, to rounding."""
    net = sw.Network("impact")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Backlash("gap", gap=0.2, restitution=0.5), "a", "b")
    net.add(sw.Inertia("J2", J=3.0), "b")
    library = Library(c_code(net.compile()), tmp_path)
    library.struct.start[library.code.stores.index("J1.omega")] = 5.0
    library.call("start", 0.0)
    library.call("integrate", 0.05, RTOL)
    outputs = library.outputs()
    assert [outputs["J1.omega"], outputs["J2.omega"]] == pytest.approx([0.5, 3.0], rel=1e-14)


def sampled(*parts: sw.Component) -> sw.Network:
    """A speed control with an integrator, whose reference jumps at one of its instants, and parts at the load."""
    net = sw.Network("sampled")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Spring("shaft", c=50.0, d=0.2), "a", "b")
    net.add(sw.Inertia("J2", J=2.0), "b")
    gains = {"A": [[1.0]], "B": [[0.02]], "C": [[1.0]], "D": [[3.0]]}
    reference = sw.Step(4.0, 0.1)
    net.add(sw.StateSpaceController("pi", **gains, measured=["J2.omega"], reference=reference, sample_time=0.02), "a")
    for part in parts:
        net.add(part, "b")
    return net


OTHER = sw.TransferFunctionController(
    "other", numerator=[2.0, -1.0], denominator=[1.0, -0.5], measured="shaft.tau_c", sample_time=0.033, setpoints=[0.3]
)
SAMPLED = {
    "alone": (),
    "two rates beside a brake": (OTHER, sw.Brake("brake", tau=5.0, t_on=0.4, t_off=0.6)),
    "stick and slip": (sw.DryFriction("rubs", tau_c=3.0, tau_s=4.0),),
    "a source that jumps": (OTHER, sw.TorqueSource("pull", tau=sw.Step(3.0, 0.1) - sw.Step(5.0, 0.33))),
}


@pytest.mark.parametrize("parts", SAMPLED.values(), ids=SAMPLED)
def test_sampled_controllers_act_at_their_instants(parts: tuple[sw.Component, ...], tmp_path: Path) -> None:
    library = assert_moves_as_in_the_library(sampled(*parts), 1.0, tmp_path)
    assert library.struct.events >= 49


def test_reference_and_period_of_a_sampled_controller_are_set_by_the_program(tmp_path: Path) -> None:
    library = Library(c_code(sampled().compile(), inputs=["pi.reference"]), tmp_path)
    library.struct.u[0] = 4.0
    library.struct.p[[each.name for each in library.code.parameters].index("pi.sample_time")] = 0.05
    library.call("start", 0.0)
    library.call("integrate", 0.99, RTOL)
    net = sampled()
    model = net.compile().with_values({"pi.reference": 4.0, "pi.sample_time": 0.05})
    assert library.outputs()["J2.omega"] == pytest.approx(model.simulate(0.99, rtol=RTOL)["J2.omega"][-1], rel=MOTION)


def two_masses(tau: object) -> sw.Network:
    net = sw.Network("two masses")
    net.add(sw.TorqueSource("motor", tau=tau), "a")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Spring("shaft", c=100.0, d=0.3), "a", "b")
    net.add(sw.Inertia("J2", J=3.0), "b")
    return net


T = sw.t
FOLLOWED = {
    "short pulses of a cosine": Piecewise((1000.0, 3 * cos(6 * pi * T + 1) > 2.9997), (0.0, True)),
    "a level that is never reached": Piecewise((900.0, sin(7 * T) > 2), (1.0, True)),
    "a limited sine": Max(sin(7 * T), 0.3),
    "short pulses of a sawtooth": Piecewise((5000.0, 5 * T + 0.6 - floor(5 * T + 0.6) < 0.003), (0.0, True)),
    "a pulse beside an instant": Piecewise((9e3, Abs(T - 0.5) < 1e-4), (0.0, True)),
    "a pulse at an angle": 1e4 * sympy.exp(-(((sin(T) - 0.377) / 1e-4) ** 2)),
    "a limited ramp": 50 * Max(0, Min(1, (T - 0.3) / 1e-3)),
    "a smooth root": 3 * sqrt(1 + T**2),
    "clipped smooth noise": Max(0, 1 + 20 * sw.SmoothNoise(T / 0.05, 3)),
    "a switch at a level of smooth noise": Piecewise((40.0, sw.SmoothNoise(T / 0.05, 2) > 0.7), (0.0, True)),
    "noise cut off at a level": Max(0.4, sw.SmoothNoise(T / 0.05, 3)) - Min(0.0, 0.1 + sw.SmoothNoise(0.2 - 7 * T, 5)),
}


@pytest.mark.parametrize("name", FOLLOWED)
def test_laws_that_switch_for_less_than_a_step_are_followed(name: str, tmp_path: Path) -> None:
    assert_moves_as_in_the_library(two_masses(FOLLOWED[name]), 1.0, tmp_path)


def test_a_chopper_switches_at_the_edges_of_its_pulses(tmp_path: Path) -> None:
    net = sw.Network("chopper")
    net.add(sw.VoltageSource("battery", u=40.0), "plus", "minus")
    net.add(sw.Switch("chop", on=sw.PWM(0.6, 100.0)), "plus", "x")
    net.add(sw.Diode("idle"), "minus", "x")
    net.add(sw.DCMachine("M", k=0.3, R=0.7, L=0.01), "x", "minus", "rotor")
    net.add(sw.Ground("earth"), "minus")
    net.add(sw.Inertia("J", J=0.02), "rotor")
    assert assert_moves_as_in_the_library(net, 0.1, tmp_path).struct.events >= 20


@pytest.mark.parametrize(
    ("law", "words"),
    [
        (Piecewise((10.0, sin(40 * T) > 0.5 * sin(3 * T)), (0.0, True)), r"it switches as .*sin\(40\*t\) passes zero"),
        (Piecewise((10.0, 5 * T - floor(5 * T) < 0.5 + 0.4 * sin(T)), (0.0, True)), "it switches as"),
        (sympy.sign(sin(10 * T**2)), r"it switches as sin\(10\*t\*\*2\)"),
        (10 * sin(T**2) ** 200, "it may have a pulse or an edge in"),
    ],
    ids=["moving duty of a sine", "moving duty of a sawtooth", "chirp", "pulses"],
)
def test_laws_that_switch_at_times_without_a_formula_are_refused(law: sympy.Expr, words: str, tmp_path: Path) -> None:
    model = two_masses(law).compile()
    with pytest.raises(CompileError, match=f"The law of 'motor' .*{words}.*Make the parameter an input"):
        c_code(model)
    Library(c_code(model, inputs=["motor.tau"]), tmp_path).call("integrate", 0.1, RTOL)
