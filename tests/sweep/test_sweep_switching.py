"""Variants that switch run side by side, and what comes out is that of single runs."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.components.branches import Branch
from shaftwork.studies import Sweep, sweep

pytest.importorskip("numba")
MEASURES = ("max shaft.tau", "min shaft.tau", "end J1.omega", "end J2.omega", "rms shaft.tau", "max motor.tau")


@sw.component
class Switched(sw.Component):
    """A torque that is switched off."""

    tau: float = sw.parameter("N*m", "torque")
    t_off: float = sw.parameter("s", "time at which it ends")

    role = "source"
    ports = (sw.Port("a"),)

    def branches(self, p: Any) -> Iterator[Branch]:
        yield sw.ThroughLaw(-p.tau * sympy.Heaviside(p.t_off - sw.t))


def train(
    motor: sympy.Expr, *, contact: bool = False, gear: bool = False, shaft: sw.Component | None = None
) -> sw.Network:
    """A motor, an inertia, a shaft with or without a gap behind a gear or none, and another inertia."""
    net = sw.Network("train")
    net.add(sw.TorqueSource("motor", tau=motor - 0.5 * sw.omega), "rotor")
    net.add(sw.Inertia("J1", J=27.35), "rotor")
    if gear:
        net.add(sw.LossyGear("gear", ratio=2.0, efficiency=0.9), "rotor", "slow")
    elastic = sw.Backlash("shaft", gap=0.003, c=24206.0, d=14.0) if contact else sw.Spring("shaft", c=24206.0, d=14.0)
    shaft = elastic if shaft is None else shaft
    net.add(shaft, "slow" if gear else "rotor", "wheel")
    net.add(sw.Inertia("J2", J=62.5), "wheel")
    return net


def with_parts(net: sw.Network, *parts: sw.Component) -> sw.Network:
    for part in parts:
        net.add(part, "wheel")
    return net


SWINGING = 60.0 * sympy.cos(2 * sw.t)
RIGID = sw.Backlash("shaft", gap=0.003, restitution=0.4)
BRAKE, FRICTION = sw.Brake("brake", tau=150.0, t_on=1.0), sw.DryFriction("friction", tau_c=8.0)
NETWORKS: Mapping[str, Callable[[], sw.Network]] = {
    "a friction that reverses": lambda: with_parts(train(SWINGING), FRICTION),
    "a gap that is crossed both ways": lambda: train(SWINGING, contact=True),
    "gap, brake and friction": lambda: with_parts(train(sympy.Float(60), contact=True), BRAKE, FRICTION),
    "a gap, a friction and a brake, both ways": lambda: with_parts(train(SWINGING, contact=True), BRAKE, FRICTION),
    "a gear with losses": lambda: train(sympy.Float(60), gear=True),
    "a gear whose losses reverse": lambda: train(SWINGING, gear=True),
    "a law that switches with the speed": lambda: train(60 + 6 * sympy.sign(sw.omega - 1)),
    "a law that jumps at a time": lambda: train(60 + 5 * sympy.sign(sw.t - sympy.Rational(7, 10))),
    "a pulse": lambda: train(60 * sympy.exp(-((20 * sw.t - 10) ** 2))),
    "a law that fades": lambda: train(60 - 20 * sympy.tanh(5 * (sw.omega - 1))),
    "a rigid gap": lambda: train(SWINGING, shaft=RIGID),
    "a rigid gap and a friction": lambda: with_parts(train(SWINGING, shaft=RIGID), FRICTION),
    "a rigid gap and a brake": lambda: with_parts(train(sympy.Float(60), shaft=RIGID), BRAKE),
    "a rigid gap behind a gear": lambda: train(SWINGING, gear=True, shaft=RIGID),
    "a rigid gap and a stop": lambda: with_parts(
        train(SWINGING, shaft=RIGID), sw.HardStop("stop", upper=0.3, lower=-0.1, restitution=0.5)
    ),
    "the crane": lambda: sw.scenes.crane(gap=0.003),
}


def compared(net: sw.Network, t_end: float, tolerance: float) -> Sweep:
    """A sweep of 16 variants, after two of them have been compared with single runs."""
    random = np.random.default_rng(3)
    samples = {name: value * random.uniform(0.8, 1.2, 16) for name, value in (("J1.J", 27.35), ("J2.J", 62.5))}
    fast = sweep(net, samples=samples, t_end=t_end, measures=MEASURES, processes=1)
    two = {name: values[[0, 9]] for name, values in samples.items()}
    slow = sweep(net, samples=two, t_end=t_end, measures=MEASURES, rtol=1e-10, processes=1)
    for name in MEASURES:
        size = max(np.abs(slow.measures[name]).max(), 1e-3)  # below a millionth of what there is it is nothing
        np.testing.assert_allclose(
            fast.measures[name][[0, 9]], slow.measures[name], atol=tolerance * size, err_msg=name
        )
    return fast


@pytest.mark.slow
@pytest.mark.parametrize("name", NETWORKS)
def test_what_switches_runs_side_by_side_as_by_itself(name: str) -> None:
    # 1e-7: errors of the steps, at a tenth of rtol = 1e-8 each, through dozens of events
    fast = compared(NETWORKS[name](), 8.0 if name == "the crane" else 2.0, 1e-7)
    assert fast.why == ""


def test_a_gap_a_brake_and_a_friction_are_followed_side_by_side() -> None:
    assert compared(NETWORKS["gap, brake and friction"](), 1.2, 1e-7).why == ""


@pytest.mark.parametrize("name", ["gap, brake and friction", "a rigid gap and a stop"])
def test_the_bits_of_variants_that_switch_do_not_depend_on_those_beside_them(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Impacts included, be they followed for many variants at once or one after the other."""
    random, sweeps = np.random.default_rng(8), []
    samples = {"J1.J": random.uniform(20.0, 35.0, 40), "shaft.gap": random.uniform(0.001, 0.01, 40)}
    for size in (40, 7, 1):
        monkeypatch.setattr("shaftwork.sweep.sweep_task.CHUNK", size)
        sweeps.append(sweep(NETWORKS[name](), samples=samples, t_end=1.2, measures=MEASURES, processes=1))
    for made in sweeps:
        assert made.why == sweeps[0].why
        for measure in MEASURES:
            assert made.measures[measure].tobytes() == sweeps[0].measures[measure].tobytes()


def clutched(*, torque: float = 10.0, restitution: float = 0.0) -> sw.Network:
    """A friction beside a clutch that runs against a stop: in the end the friction and the clutch stop at once."""
    net = sw.Network("against a stop")
    net.add(sw.TorqueSource("motor", tau=sw.Step(3.0) - sw.Step(6.0, start=2.0)), "a")
    net.add(sw.Inertia("J1", J=0.3), "a")
    net.add(sw.CoulombLoad("load", tau=1.5), "a")
    net.add(sw.Clutch("clutch", tau=torque, t_on=0.4), "a", "b")
    net.add(sw.Inertia("J2", J=0.6), "b")
    net.add(sw.HardStop("stop", upper=0.25, restitution=restitution), "b")
    return net


@pytest.mark.parametrize("net", [clutched(), clutched(torque=3.0), clutched(restitution=0.23)])
def test_of_what_stops_at_once_the_same_holds_as_in_a_single_run(net: sw.Network) -> None:
    """What a friction and a clutch each carry at rest is one of many; side by side it was another one than alone."""
    measures = ["end load.tau", "end clutch.tau", "mean load.tau", "mean clutch.tau"]
    inertias = np.linspace(0.3, 0.4, 16)
    for t_end in (1.9, 3.0):  # at rest, and after the motor has turned back
        fast = sweep(net, {"J1.J": inertias}, t_end=t_end, measures=measures, processes=1)
        slow = sweep(net, {"J1.J": inertias[[0, 9]]}, t_end=t_end, measures=measures, engine="numba", rtol=1e-10)
        for name in measures:
            # torques of 1.5 to 3 N m, to the tolerance of 1e-8 through some events
            np.testing.assert_allclose(fast.measures[name][[0, 9]], slow.measures[name], atol=1e-7, err_msg=name)


def test_a_brake_that_comes_on_after_a_lag_is_followed_in_every_variant() -> None:
    net = sw.Network("lag")
    net.add(sw.TorqueSource("motor", tau=10.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Brake("brake", tau=30.0, t_on=1.2, t_lag=0.1), "a")
    J = np.linspace(1.0, 2.0, 16)
    made = sweep(net, {"J.J": J}, t_end=1.4, measures=["max J.omega", "end J.omega"], processes=1)
    for name, late in (("max J.omega", 0.1 * np.log(1.5)), ("end J.omega", 0.2)):  # the torque comes to 10 N m, the end
        momentum = 12.0 - 20.0 * late + 3.0 * (1 - np.exp(-late / 0.1))
        np.testing.assert_allclose(made.measures[name], momentum / J, rtol=1e-8)


def test_rigid_flanks_throw_back_what_newtons_law_says() -> None:
    """One wheel hits another that rests: momentum is kept, and the speed across comes back with the restitution."""
    random, tau, gap = np.random.default_rng(5), 10.0, 0.1
    J1, J2 = random.uniform(1.0, 3.0, (2, 40))
    e = random.uniform(0.3, 0.9, 40)
    net = sw.Network("wheels")
    net.add(sw.TorqueSource("motor", tau=tau), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Backlash("gap", gap=gap, restitution=0.5), "a", "b")
    net.add(sw.Inertia("J2", J=1.0), "b")
    hit = np.sqrt(gap * J1 / tau)
    again = 2 * e * hit  # what comes back, e tau hit / J1, is taken away by tau / J1 there and back
    speed, end = tau * hit / J1, 0.3
    samples = {"J1.J": J1, "J2.J": J2, "gap.restitution": e}
    made = sweep(net, samples=samples, t_end=end, measures=["end J1.omega", "end J2.omega"], processes=1)
    assert made.why == ""
    once = (hit < end) & (end < hit + again)
    assert once.sum() > 10
    first = speed * (J1 - e * J2) / (J1 + J2) + tau * (end - hit) / J1
    np.testing.assert_allclose(made.measures["end J1.omega"][once], first[once], rtol=1e-9)
    second = speed * (1 + e) * J1 / (J1 + J2)
    np.testing.assert_allclose(made.measures["end J2.omega"][once], second[once], rtol=1e-9)


def test_the_instant_at_which_a_motor_is_switched_off_may_vary() -> None:
    """An inertia without losses has the speed that the torque has given it up to then."""
    off = np.linspace(0.2, 0.8, 16)
    net = sw.Network("off")
    net.add(Switched("motor", tau=10.0, t_off=0.5), "a")
    net.add(sw.Inertia("J", J=4.0), "a")
    made = sweep(net, samples={"motor.t_off": off}, t_end=1.0, measures=["end J.omega"], processes=1)
    assert made.why == ""
    np.testing.assert_allclose(made.measures["end J.omega"], 10.0 * off / 4.0, rtol=1e-9)


@pytest.mark.slow
def test_what_chatters_is_left_alone_and_leaves_the_others_alone() -> None:
    """A law that drives the speed back to its jump from both sides: those that never come there stay side by side."""
    net = sw.Network("driven back")
    net.add(sw.TorqueSource("motor", tau=1 - 3 * sympy.sign(sw.omega - 1)), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    inertias = np.append(np.full(4, 1.0), np.linspace(20.0, 30.0, 12))
    made = sweep(net, samples={"J.J": inertias}, t_end=1.0, measures=["max J.omega"], processes=1)
    assert made.why.startswith("4 of 16")
    assert all("the motion sticks" in reason or "drive the motion back" in reason for reason in made.reasons[:4])
    np.testing.assert_allclose(made.measures["max J.omega"][4:], 4.0 / inertias[4:], rtol=1e-9)
