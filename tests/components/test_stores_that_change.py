"""Inertias and springs that depend on their angle and on time, against Lagrange's equations made by sympy."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from sympy import Piecewise, cos, sin

import shaftwork as sw
from shaftwork.components.branches import INTEGRAL, AcrossStore, Branch
from shaftwork.components.shaft_models import ShaftModel
from shaftwork.reduce import refer
from shaftwork.studies import sweep

PHI = sympy.symbols("phi_:4", real=True)
OMEGA = sympy.symbols("omega_:4", real=True)


def accelerations(T: sympy.Expr, V: sympy.Expr, torques: Sequence[sympy.Expr]) -> sympy.Matrix:
    """The accelerations by Lagrange's equations of energies in PHI, OMEGA and time."""
    n = len(torques)
    mass = sympy.Matrix(n, n, lambda i, k: sympy.diff(T, OMEGA[i], OMEGA[k]))
    right = []
    for i, torque in enumerate(torques):
        momentum = sympy.diff(T, OMEGA[i])
        moved = sum(sympy.diff(momentum, PHI[k]) * OMEGA[k] for k in range(n)) + sympy.diff(momentum, sw.t)
        right.append(torque + sympy.diff(T - V, PHI[i]) - moved)
    return mass.LUsolve(sympy.Matrix(right))


def two_masses() -> sw.Network:
    net = sw.Network("arm")
    net.add(sw.Inertia("motor", J=0.5), "a")
    net.add(sw.Spring("shaft", c=40.0), "a", "b")
    net.add(sw.Inertia("arm", J=2 + cos(sw.phi)), "b")
    return net


def hand_derived(_: float, x: np.ndarray) -> list[float]:
    """Lagrange: T = 0.25 w1^2 + (2 + cos f) w2^2 / 2, V = 20 (f1 - f)^2; states w1, w2, twist, f."""
    w1, w2, twist, f = x
    return [-80 * twist, (40 * twist + 0.5 * np.sin(f) * w2**2) / (2 + np.cos(f)), w1 - w2, w2]


@pytest.mark.parametrize(
    ("engine", "rtol", "within"), [("scipy", 1e-12, 1e-10), ("heyoka", 1e-12, 1e-10), ("sundials", 1e-9, 1e-5)]
)
def test_an_arm_moves_as_lagrange_says_and_keeps_its_energy(engine: str, rtol: float, within: float) -> None:
    start = {"motor.omega": 3.0, "arm.omega": 1.0, "arm.phi": 0.4}
    made = two_masses().simulate(10.0, engine=engine, rtol=rtol, initial=start)
    found = solve_ivp(hand_derived, (0, 10), [3, 1, 0, 0.4], "DOP853", t_eval=made.t, rtol=3e-14, atol=1e-14).y
    for name, course in zip(("motor.omega", "arm.omega", "arm.phi"), found[[0, 1, 3]], strict=True):
        assert np.abs(made[name] - course).max() < within * np.abs(course).max()
    assert made.energy.residual < within


class Train(NamedTuple):
    """A network, its energies and the torques besides, and what its states are, in PHI and OMEGA."""

    net: sw.Network
    T: sympy.Expr
    V: sympy.Expr
    torques: list[sympy.Expr]
    states: dict[str, sympy.Expr]


@st.composite
def trains(draw: st.DrawFn) -> Train:
    """A chain of inertias, some of them on gears, with springs between them and fans at its nodes."""
    numbers = st.floats(0.2, 3.0)
    count = draw(st.integers(1, 3))
    made = Train(sw.Network("train"), sympy.Integer(0), sympy.Integer(0), [sympy.Integer(0)] * count, {})
    net, T, V, torques, states = made
    for k in range(count):
        for part in range(draw(st.integers(1, 2))):
            a, b, d = (draw(numbers) for _ in range(3))
            both = a + b * (1.1 + cos(draw(st.integers(1, 3)) * sw.phi)) + d * sw.t
            law = draw(st.sampled_from([both, sympy.Float(a), a + b * sin(sw.phi) ** 2]))
            ratio, name, node = draw(st.sampled_from([1.0, -2.0, 0.5])), f"J{k}{part}", f"n{k}"
            if ratio != 1.0:
                node = f"n{k} {part}"
                net.add(sw.Gear(f"g{k}{part}", ratio=ratio), f"n{k}", node)
            net.add(sw.Inertia(name, J=law), node)
            T += law.subs(sw.phi, PHI[k] / ratio) * (OMEGA[k] / ratio) ** 2 / 2
            states |= {f"{name}.omega": OMEGA[k] / ratio, f"{name}.phi": PHI[k] / ratio}
        friction, speed = draw(numbers), OMEGA[k] / (100 * 2 * sympy.pi / 60)
        net.add(sw.FanLoad(f"fan{k}", tau_n=friction, n_n=100.0), f"n{k}")
        torques[k] -= friction * speed * sympy.Abs(speed)
        if k:
            c, bend, d = (draw(numbers) for _ in range(3))
            twist, rel = PHI[k - 1] - PHI[k], OMEGA[k - 1] - OMEGA[k]
            net.add(sw.Spring(f"c{k}", c=c + bend * sw.phi**2 + sin(sw.t) / 9, d=d), f"n{k - 1}", f"n{k}")
            V += (c + sin(sw.t) / 9) * twist**2 / 2 + bend * twist**4 / 4
            torques[k - 1] -= d * rel
            torques[k] += d * rel
            states[f"c{k}.phi"] = twist
    return Train(net, T, V, torques, states)


@given(trains(), st.integers(0, 10_000))
def test_rates_are_those_of_lagrange_in_scalar_and_in_array_code(train: Train, seed: int) -> None:
    rng, model, n = np.random.default_rng(seed), train.net.compile(), len(train.torques)
    t, values = rng.uniform(0, 3), rng.normal(size=2 * n)
    point = dict(zip((*PHI[:n], *OMEGA[:n], sw.t), (*values, t), strict=True))
    moved = accelerations(train.T, train.V, train.torques).subs(point).evalf()
    rates_of = dict(zip((*PHI[:n], *OMEGA[:n]), (*values[n:], *moved), strict=True))
    quantities = [train.states[name] for name in model.states]
    x = np.array([quantity.subs(point) for quantity in quantities], dtype=float)
    wanted = [sum(quantity.diff(one) * rate for one, rate in rates_of.items()) for quantity in quantities]
    size = max(map(abs, wanted))
    for rates in (model.rhs(t, x), model.bind().rhs(t, x)):
        # what is left of sums whose terms are a few hundred times as large
        np.testing.assert_allclose(rates, np.array(wanted, dtype=float), rtol=1e-11, atol=float(1e-12 * size))
    steps = 1e-6 * np.eye(len(x))
    slopes = np.array([(model.rhs(t, x + h) - model.rhs(t, x - h)) / 2e-6 for h in steps]).T
    # central differences of such a step are good to 1e-9 of the largest slope
    np.testing.assert_allclose(model.jacobian(t, x).toarray(), slopes, rtol=0, atol=1e-8 * np.abs(slopes).max())


@given(trains())
def test_printed_state_equations_are_what_is_integrated(train: Train) -> None:
    equations, model = train.net.equations(), train.net.compile()
    x = np.random.default_rng(1).normal(size=len(model.states))
    known = {sympy.Symbol(name, real=True): value for name, value in zip(model.states, x, strict=True)}
    known |= {sympy.Symbol(name, real=True): value for name, value in model.parameters.items()} | {sw.t: 0.7}
    laws = {row.left: row.right for row in (*equations.laws, *equations.eliminated, *equations.loops)}
    for row, rate in zip(equations.states, model.rhs(0.7, x), strict=True):
        right = row.right
        for _ in range(4):  # torques and speeds that are no states by what they are
            right = right.xreplace(laws)
        assert float(right.xreplace(known)) == pytest.approx(rate, rel=1e-11, abs=1e-11)


def test_a_free_mass_keeps_its_momentum_where_the_time_changes_its_inertia() -> None:
    net = sw.Network("skater")
    net.add(sw.Inertia("skater", J=sw.Ramp(-2.0, 1.0, start=0.5, before=3.0)), "a")
    net.add(sw.Damper("none", d=0.0), "a")
    made = net.simulate(2.0, initial={"skater.omega": 2.0}, rtol=1e-11)
    assert made["skater.omega"][-1] == pytest.approx(6.0, rel=1e-9)
    # the arms have put in what there is more: J omega^2 / 2 from 6 J to 18 J
    assert made.energy.lost_in["skater"] == pytest.approx(-12.0, rel=1e-9)
    assert made.energy.residual < 1e-9


def test_a_prescribed_speed_takes_the_torque_that_a_crank_asks() -> None:
    net = sw.Network("press")
    net.add(sw.SpeedSource("drive", omega=3 + sin(2 * sw.t)), "a")
    net.add(sw.Inertia("crank", J=2 + cos(sw.phi)), "a")
    made = net.simulate(5.0, rtol=1e-11)
    t = made.t
    angle, speed, rate = 3 * t + (1 - np.cos(2 * t)) / 2, 3 + np.sin(2 * t), 2 * np.cos(2 * t)
    wanted = (2 + np.cos(angle)) * rate - np.sin(angle) * speed**2 / 2
    np.testing.assert_allclose(made["drive.tau"], wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())
    np.testing.assert_allclose(made["crank.tau"], wanted, rtol=0, atol=1e-9 * np.abs(wanted).max())


@pytest.mark.parametrize(
    ("law", "potential"),
    [
        (5 + sw.phi**2, lambda s: 2.5 * s**2 + s**4 / 4),
        (5 + cos(sw.phi), lambda s: 2.5 * s**2 + s * np.sin(s) + np.cos(s) - 1),
        (sw.Table([-1, 0, 1], [4, 5, 4])(sw.phi), lambda s: 2.5 * s**2 - np.abs(s) ** 3 / 3),
    ],
)
def test_a_spring_over_its_twist_gives_back_what_it_took(law: sympy.Expr, potential: Callable[[float], float]) -> None:
    net = sw.Network("swing")
    net.add(sw.Inertia("J", J=2.0), "a")
    net.add(sw.Spring("c", c=law), "a", "ground")
    made = net.simulate(6.0, initial={"J.omega": 1.0}, rtol=1e-11)
    energies = made["J.omega"] ** 2 + np.vectorize(potential)(made["c.phi"])
    np.testing.assert_allclose(energies, 1.0, rtol=1e-9)
    assert made.energy.residual < 1e-9


def test_a_stiffness_over_time_does_the_work_that_the_balance_says() -> None:
    net = sw.Network("mathieu")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Spring("c", c=5 + 2 * cos(3 * sw.t)), "a", "ground")
    made = net.simulate(6.0, initial={"J.omega": 1.0}, rtol=1e-11)
    found = solve_ivp(
        lambda t, x: [x[1], -(5 + 2 * np.cos(3 * t)) * x[0]],
        (0, 6),
        [0, 1],
        "DOP853",
        t_eval=made.t,
        rtol=1e-13,
        atol=1e-13,
    ).y
    np.testing.assert_allclose(made["c.phi"], found[0], rtol=0, atol=1e-9 * np.abs(found[0]).max())
    energy = made["J.omega"][-1] ** 2 / 2 + (5 + 2 * np.cos(18)) * made["c.phi"][-1] ** 2 / 2
    assert made.energy.lost_in["c"] == pytest.approx(0.5 - energy, rel=1e-8)
    assert made.energy.residual < 1e-9


def test_a_clutch_couples_a_crank_whose_inertia_changes() -> None:
    """By hand: before it holds motor and crank move by the clutch's torque, then together with J + 1."""
    net = sw.Network("press")
    net.add(sw.Inertia("motor", J=1.0), "m")
    net.add(sw.Clutch("clutch", tau=6.0), "m", "c")
    net.add(sw.Inertia("crank", J=2 + cos(sw.phi)), "c")
    made = net.simulate(4.0, initial={"motor.omega": 8.0}, rtol=1e-11)

    def slipping(_t: float, x: np.ndarray) -> list[float]:
        _, w2, f = x
        return [-6.0, (6 + 0.5 * np.sin(f) * w2**2) / (2 + np.cos(f)), w2]

    def meet(_: float, x: np.ndarray) -> float:
        return float(x[0] - x[1])

    meet.terminal = True  # type: ignore[attr-defined]
    first = solve_ivp(slipping, (0, 4), [8, 0, 0], "DOP853", events=meet, rtol=1e-13, atol=1e-13)
    together = solve_ivp(
        lambda _, x: [0.5 * np.sin(x[1]) * x[0] ** 2 / (3 + np.cos(x[1])), x[0]],
        (first.t[-1], 4),
        first.y[1:, -1],
        "DOP853",
        rtol=1e-13,
        atol=1e-13,
    )
    assert [phase.name for phase in made.phases] == ["clutch slipping forward", "clutch engaged"]
    assert made.phases[1].start == pytest.approx(first.t[-1], rel=1e-9)
    assert made["crank.omega"][-1] == pytest.approx(together.y[0, -1], rel=1e-8)
    assert made.energy.residual < 1e-9


def test_transfer_functions_have_the_slopes_of_an_inertia_that_changes() -> None:
    net = two_masses()
    net.add(sw.TorqueSource("T", tau=0.0), "a")
    net.add(sw.Spring("stop", c=10.0), "b", "ground")
    transfer = net.equations().transfer_function("T.tau", "arm.omega", values=True)
    s = transfer.s if hasattr(transfer, "s") else sympy.Symbol("s")
    wanted = 40 * s / ((0.5 * s**2 + 40) * (3 * s**2 + 50) - 1600)
    at = sympy.Rational(7, 3)
    assert float(sympy.sympify(transfer.expression).subs(s, at)) == pytest.approx(float(wanted.subs(s, at)), rel=1e-12)


@pytest.mark.parametrize(
    ("law", "said"),
    [
        (sw.Step(2.0, 1.0, before=1.0), "jumps at t = 1 s"),
        (Piecewise((1, sw.phi < 1), (2, True)), "jumps at the angle 1"),
        (Piecewise((2, sw.phi < 2 * sw.t), (3, True)), r"jumps at the angle 2\*t"),
        (1 + sympy.Heaviside(sw.t - 1) * sw.phi**2, "jumps at t = 1 s"),
        (3 + sympy.sign(sw.phi - 1) * sw.t, "jumps at the angle 1"),
        (2 + sympy.atan(sympy.tan(sw.phi)) / 2, "jumps at what atan"),
        (2 + sympy.floor(sw.t), "jumps at what floor"),
        (2 + sw.PWM(0.3, 10.0), "jumps at what Heaviside"),
        (1 + sw.omega, "depends on its speed"),
        (2 + sw.phi * sw.omega, "depends on its speed"),
    ],
)
def test_an_inertia_that_cannot_be_is_named_with_the_reason(law: sympy.Expr, said: str) -> None:
    net = sw.Network("wrong")
    net.add(sw.Inertia("arm", J=law), "a")
    net.add(sw.Spring("c", c=1.0), "a", "ground")
    with pytest.raises(sw.NetworkError, match=rf"Inertia 'arm': J {said}"):
        net.compile()


@pytest.mark.parametrize(
    "law",
    [
        sw.Ramp(1.0, 1e-5, start=0.5, before=1.0),
        1 + sympy.Abs(sw.phi - 1),
        Piecewise((2, sw.phi < 1), (1 + sw.phi, True)),
        Piecewise((2, sw.phi < 2 * sw.t), (2 + (sw.phi - 2 * sw.t) ** 2, True)),
        2 + sympy.Heaviside(sw.phi - 1) * (sw.phi - 1),
        sw.Table([0.0, 1.0, 9.0], [2.0, 3.0, 2.0])(sw.phi),
    ],
)
def test_an_inertia_that_bends_keeps_its_momentum_or_its_energy(law: sympy.Expr) -> None:
    net = sw.Network("bent")
    net.add(sw.Inertia("arm", J=law), "a")
    made = net.simulate(1.0, initial={"arm.omega": 2.0}, rtol=1e-10)
    assert made.energy.residual < 1e-8
    if not law.has(sw.phi):
        assert made["arm.omega"][-1] == pytest.approx(1.0, rel=1e-8)
    elif not law.has(sw.t):
        J = float(law.subs(sw.phi, 0)), float(law.subs(sw.phi, made["arm.phi"][-1]))
        assert J[1] * made["arm.omega"][-1] ** 2 == pytest.approx(J[0] * 4, rel=1e-8)


@sw.component
class Cam(sw.Component):
    """An inertia J phi - b, for a capacity whose constant is below zero."""

    J: float = sw.parameter("kg*m^2/rad", "slope", above=0)
    b: float = sw.parameter("kg*m^2", "offset", at_least=0)

    ports: ClassVar = (sw.Port("a"),)

    def branches(self, p: Any) -> Iterator[Branch]:
        yield AcrossStore(p.J * INTEGRAL - p.b)


@pytest.mark.parametrize("engine", ["scipy", "heyoka", "sundials"])
def test_a_capacity_in_parameters_is_that_of_the_same_law_in_numbers(engine: str) -> None:

    def net(part: sw.Component) -> sw.Network:
        made = sw.Network("cam")
        made.add(part, "a")
        made.add(sw.Spring("spring", c=3.0), "a", "b")
        made.add(sw.Inertia("wheel", J=1.0), "b")
        return made

    start = {"cam.phi": 5.0, "cam.omega": 0.5}
    own, plain = net(Cam("cam", J=1.0, b=2.0)), net(sw.Inertia("cam", J=sw.phi - 2))
    one, other = (made.simulate(1.0, initial=start, engine=engine, rtol=1e-8)["cam.omega"][-1] for made in (own, plain))
    assert one == pytest.approx(other, rel=1e-6)
    linear = [made.compile().linearize(start).A for made in (own, plain)]
    np.testing.assert_allclose(*linear, rtol=1e-12)


@pytest.mark.parametrize("engine", ["scipy", "heyoka"])
@pytest.mark.parametrize(
    ("law", "said"),
    [
        (sw.t, "At t = 0 s J = t of Inertia 'arm' is 0"),
        (1.2 - 0.4 * sw.phi, "At t = 0 s J = .* is -0.8"),
        (1 / (sw.phi - 5), "At t = 0 s J = .* has no real value"),
        (1 - sw.t, "At t = 1 s J = 1 - t of Inertia 'arm' (is|falls)"),
        (1 - 2 * sin(sw.t), r"At t = 0\.5235\d* s J = .* (is|falls)"),
        (6 - sw.phi, r"At t = 0\.6666\d* s J = 6 - phi of Inertia 'arm' (is|falls)"),
        (sympy.sqrt(1 - sw.t), "At t = 1 s J = .* has no real value"),
        (2 + sympy.tan(sw.t) ** 2, r"At t = 1\.570796\d* s J = .* is .*, and 2 at t = 0 s"),
    ],
)
def test_an_inertia_that_is_not_above_zero_stops_the_motion_there(engine: str, law: sympy.Expr, said: str) -> None:
    net = sw.Network("wrong")
    net.add(sw.Inertia("arm", J=law), "a")
    start = {"arm.omega": 1.0} | ({"arm.phi": 5.0} if law.has(sw.phi) else {})
    with pytest.raises(sw.SimulationError, match=said):
        net.simulate(3.0, initial=start, engine=engine)


@pytest.mark.parametrize("engine", ["scipy", "heyoka", "sundials"])
@pytest.mark.parametrize("ratio", [1.0, 2.0])
def test_an_inertia_below_zero_beside_another_one_is_found_between_steps(engine: str, ratio: float) -> None:
    """J = 0.999 + sin(phi) is below zero within 0.045 of 3 pi / 2; its crossing is told, not the end of a step."""
    net = sw.Network("beside")
    net.add(sw.TorqueSource("motor", tau=3.0), "a")
    net.add(sw.Inertia("heavy", J=5.0), "a")
    net.add(sw.Gear("gear", ratio=ratio), "a", "b")
    net.add(sw.Inertia("arm", J=0.999 + sin(sw.phi)), "b")
    with pytest.raises(sw.SimulationError, match=r"At t = \S+ s J = .* of Inertia 'arm' falls to zero") as raised:
        net.simulate(8.0, engine=engine)
    found = float(str(raised.value).split()[3])

    def rates(_: float, x: np.ndarray) -> list[float]:
        inertia = 5 * ratio**2 + 0.999 + np.sin(x[0])
        return [x[1], (3 * ratio - 0.5 * np.cos(x[0]) * x[1] ** 2) / inertia]

    def zero(_: float, x: np.ndarray) -> float:
        return float(0.999 + np.sin(x[0]))

    hand = solve_ivp(rates, (0, 8), [0, 0], "DOP853", events=zero, rtol=1e-12, atol=1e-12, max_step=0.01)
    assert found == pytest.approx(hand.t_events[0][0], rel=1e-5)


def test_variants_of_which_one_has_an_inertia_below_zero_fail_alone() -> None:
    net = sw.Network("variants")
    net.add(sw.TorqueSource("motor", tau=3.0), "a")
    net.add(sw.Damper("d", d=0.1), "a")
    net.add(sw.Inertia("heavy", J=5.0), "a")
    net.add(sw.Inertia("arm", J=2 - sw.phi), "a")
    made = sweep(net, {"d.d": [0.1, 60.0]}, t_end=3.0, measures=["end arm.omega"], processes=1)
    assert made.failed.tolist() == [True, False]
    assert "falls to zero" in made.reasons[0]


def test_an_inertia_that_vanishes_elsewhere_than_the_motion_goes_is_none_the_worse() -> None:
    """J = phi^2 from phi = 5, without a torque: J omega^2 is constant, so that phi^2 = 25 + 10 omega_0 t."""
    net = sw.Network("cone")
    net.add(sw.Inertia("arm", J=sw.phi**2), "a")
    made = net.simulate(4.0, initial={"arm.omega": 1.0, "arm.phi": 5.0}, rtol=1e-11)
    np.testing.assert_allclose(made["arm.phi"], np.sqrt(25 + 10 * made.t), rtol=1e-9)
    kinked = sw.Network("kinked")
    kinked.add(sw.Inertia("arm", J=2 + sw.phi * sympy.sign(sw.phi)), "a")
    bent = sw.Network("bent")
    bent.add(sw.Inertia("arm", J=2 + sympy.Abs(sw.phi)), "a")
    start = {"arm.omega": 1.0, "arm.phi": -1.0}
    one, other = (net.simulate(3.0, initial=start, rtol=1e-10)["arm.omega"][-1] for net in (kinked, bent))
    assert one == pytest.approx(other, rel=1e-9)


def test_what_has_no_equations_beside_it_is_refused_with_the_next_step() -> None:
    def beside(*parts: tuple[sw.Component, str, str]) -> sw.Network:
        net = sw.Network("beside")
        net.add(sw.Inertia("arm", J=2 + cos(sw.phi)), "b")
        net.add(sw.Inertia("motor", J=1.0), "a")
        for part, *nodes in parts:
            net.add(part, *nodes)
        return net

    with pytest.raises(sw.NetworkError, match=r"'gap' strikes rigidly. Give the contact a stiffness c"):
        beside((sw.Backlash("gap", gap=0.1), "a", "b")).compile()
    with pytest.raises(sw.NetworkError, match=r"'line' is a travelling wave. Take model=Spectral\(24\)"):
        beside((sw.Shaft("line", length=1.0, diameter=0.1, model=sw.Wave()), "a", "b")).compile()
    net = sw.Network("jump")
    net.add(sw.SpeedSource("drive", omega=sw.Step(2.0, 1.0)), "a")
    net.add(sw.PlanetaryGear("gear", ratio=3.0), "a", "b", "c")
    net.add(sw.Inertia("arm", J=2 + cos(sw.phi)), "b")
    net.add(sw.Inertia("wheel", J=1.0), "c")
    with pytest.raises(sw.NetworkError, match="'drive' jumps, which is an impulse"):
        net.compile()
    with pytest.raises(sw.CompileError, match="reads other quantities"):
        two_masses().equations().latex("second-order")
    geared = two_masses()
    geared.add(sw.Gear("gear", ratio=2.0), "a", "c")
    geared.add(sw.Inertia("load", J=1.0), "c")
    with pytest.raises(sw.NetworkError, match="Inertia 'arm' cannot be referred"):
        refer(geared, "c")


@pytest.mark.slow
def test_a_long_shaft_beside_it_is_the_same_in_array_code() -> None:
    def train(model: ShaftModel) -> sw.Network:
        net = two_masses()
        net.add(sw.Shaft("line", length=20.0, diameter=0.05, model=model), "b", "c")
        net.add(sw.Inertia("wheel", J=1 + 0.3 * sin(sw.phi)), "c")
        return net

    start = {"motor.omega": 3.0}
    few, many = (train(model).simulate(0.03, initial=start, rtol=1e-9) for model in (sw.Spectral(16), sw.Spectral(35)))
    assert train(sw.Spectral(35)).compile().scalar is None
    # what 16 nodes leave out of a motion that starts without a jump
    assert few["wheel.omega"][-1] == pytest.approx(many["wheel.omega"][-1], rel=1e-6)


def test_it_is_stored_and_read_again(tmp_path: Path) -> None:
    net = two_masses()
    net.save(tmp_path / "arm.toml")
    again = sw.Network.load(tmp_path / "arm.toml")
    start = {"motor.omega": 3.0}
    assert again.simulate(1.0, initial=start)["arm.omega"][-1] == net.simulate(1.0, initial=start)["arm.omega"][-1]
