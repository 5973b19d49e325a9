"""Laws that read other ports and branches of their part: back EMF and torque of machines written as controlled sources.

Each is set beside equations written by hand, or beside a part that does the same by an ideal coupling.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

import shaftwork as sw
from shaftwork.codegen.compiled_model import CompiledModel
from shaftwork.components.branches import ACROSS, Branch, across_of, integral_of, through_of
from shaftwork.core.domains import ELECTRICAL, ROTATION

R, L, K, U, J, D, FREQUENCY = 0.5, 0.009, 0.7, 120.0, 0.03, 0.02, 15.0
THIRD = 2 * np.pi / 3


@sw.component
class ControlledMachine(sw.Component):
    """Law: u = k omega + R i + L di/dt, tau = k i, without an ideal coupling."""

    k: float = sw.parameter("N*m/A", "torque constant", nonzero=True)
    R: float = sw.parameter("ohm", "resistance", at_least=0, default=0.0)
    L: float = sw.parameter("H", "inductance", at_least=0, default=0.0)

    role = "coupling"
    ports = (sw.Port("p", ELECTRICAL), sw.Port("n", ELECTRICAL), sw.Port("rotor", ROTATION))
    inner = (sw.Port("resistor", ELECTRICAL), sw.Port("emf", ELECTRICAL))

    def branches(self, p: Any) -> Iterator[Branch]:
        yield sw.ThroughLaw(ACROSS / p.R, ("p", "resistor"))
        yield sw.ThroughStore(1 / p.L, ("resistor", "emf"), "i_L")
        yield sw.AcrossLaw(p.k * across_of("rotor"), ("emf", "n"), "u_emf")
        yield sw.ThroughLaw(-p.k * through_of("i_L"), ("rotor", None), "tau_i")

    def signals(self) -> dict[str, sw.Signal]:
        return sw.DCMachine.signals(self)  # type: ignore[arg-type]


@sw.component
class ThreePhases(sw.Component):
    """Law: u_k = R i_k + L di_k/dt + k sin(phi - 2 pi k / 3) omega + u_n with the sum of the currents zero."""

    role = "source"
    ports = (sw.Port("rotor", ROTATION),)
    inner = tuple(sw.Port(name, ELECTRICAL) for name in ("ua", "la", "ea", "ub", "lb", "eb", "uc", "lc", "ec", "n"))

    def branches(self, _: Any) -> Iterator[Branch]:
        angle = integral_of("tau_i")
        shapes = [sympy.sin(angle - sympy.Float(THIRD) * k) for k in range(3)]
        for k, phase in enumerate("abc"):
            feed = U * sympy.sin(2 * sympy.pi * FREQUENCY * sw.t - sympy.Float(THIRD) * k)
            yield sw.AcrossLaw(feed, (f"u{phase}", None), f"u_{phase}")
            yield sw.ThroughLaw(ACROSS / R, (f"u{phase}", f"l{phase}"), f"i_R{phase}")
            yield sw.ThroughStore(sympy.Float(1 / L), (f"l{phase}", f"e{phase}"), f"i_{phase}")
            yield sw.AcrossLaw(K * shapes[k] * across_of("rotor"), (f"e{phase}", "n"), f"u_e{phase}")
        torque = sum(K * shape * through_of(f"i_{phase}") for shape, phase in zip(shapes, "abc", strict=True))
        yield sw.ThroughLaw(-torque, ("rotor", None), "tau_i")

    def signals(self) -> dict[str, sw.Signal]:
        currents = {f"i_{p}": sw.Signal("store", (f"l{p}", f"e{p}"), ELECTRICAL, 1, f"i_{p}") for p in "abc"}
        return currents | {"tau": sw.Signal("through", ("rotor", None), ROTATION, -1)}


def _direct(kind: type[sw.Component], **changed: float) -> sw.Network:
    net = sw.Network("direct current")
    net.add(sw.VoltageSource("feed", u=U), "p", "ground")
    net.add(kind("machine", **({"k": K, "R": R, "L": L} | changed)), "p", "ground", "rotor")
    net.add(sw.Inertia("J", J=J), "rotor")
    net.add(sw.Damper("friction", d=D), "rotor", "ground")
    return net


def _three_phases() -> sw.Network:
    net = sw.Network("three phases")
    net.add(ThreePhases("motor"), "rotor")
    net.add(sw.Inertia("J", J=J), "rotor")
    net.add(sw.Damper("friction", d=D), "rotor", "ground")
    return net


def _by_hand(t: float, x: np.ndarray) -> list[float]:
    """Two of the currents, speed and angle; the star point has the mean of what is left of the voltages."""
    currents, (omega, angle) = np.array([x[0], x[1], -x[0] - x[1]]), x[2:]
    shapes = np.sin(angle - THIRD * np.arange(3))
    left = U * np.sin(2 * np.pi * FREQUENCY * t - THIRD * np.arange(3)) - K * shapes * omega
    rates = (left - left.mean() - R * currents) / L
    return [rates[0], rates[1], (K * shapes @ currents - D * omega) / J, omega]


@pytest.mark.parametrize("changed", [{}, {"R": 0.0}], ids=["R and L", "L alone"])
def test_a_machine_of_controlled_sources_moves_as_one_of_an_ideal_coupling(changed: dict[str, float]) -> None:
    mine, ideal = (_direct(kind, **changed).compile() for kind in (ControlledMachine, sw.DCMachine))
    assert mine.linear
    assert ideal.linear  # so propagation is exact, and the two differ by rounding
    runs = [model.simulate(0.5, engine="exact") for model in (mine, ideal)]
    for name in ("J.omega", "machine.i", "machine.tau", "machine.u", "friction.tau"):
        np.testing.assert_allclose(runs[0][name], runs[1][name], rtol=1e-9, atol=1e-9 * np.abs(runs[1][name]).max())
    assert runs[0].energy_residual < 1e-10
    at = ideal.steady_state()["J.omega"]
    assert mine.steady_state()["J.omega"] == pytest.approx(at, rel=1e-10)


def test_without_inductance_the_current_is_no_state_and_cannot_be_read() -> None:
    with pytest.raises(sw.NetworkError, match=r"reads through_of\('i_L'\), but the part has no spring, inductor"):
        _direct(ControlledMachine, L=0.0).compile()


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["scipy", "heyoka", "sundials"])
def test_phases_in_star_follow_the_equations_written_by_hand(engine: str) -> None:
    """One of the three currents is dependent, and laws read it like the others."""
    model = _three_phases().compile()
    sol = model.simulate(0.3, rtol=1e-10, engine=engine, t_eval=301)
    assert [name for name in model.states if name.startswith("motor.i_")] == ["motor.i_b", "motor.i_c"]
    truth = solve_ivp(_by_hand, (0, 0.3), np.zeros(4), "DOP853", sol.t, rtol=1e-12, atol=1e-12).y
    wanted = {"motor.i_a": truth[0], "motor.i_b": truth[1], "motor.i_c": -truth[0] - truth[1], "J.omega": truth[2]}
    for name, values in wanted.items():  # the engines are asked for 1e-10 a step, over some 1e3 steps
        assert np.abs(sol[name] - values).max() < 1e-7 * np.abs(values).max(), name
    total = sol["motor.i_a"] + sol["motor.i_b"] + sol["motor.i_c"]
    assert np.abs(total).max() <= 4 * np.finfo(float).eps * np.abs(sol["motor.i_a"]).max()
    assert sol.energy_residual < 1e-8


def test_scalar_and_array_code_agree_and_the_jacobian_is_that_of_differences() -> None:
    model: CompiledModel = _three_phases().compile()
    assert model.scalar is not None
    dice = np.random.default_rng(3)
    for _ in range(5):
        t, x = float(dice.uniform(0, 0.1)), dice.normal(size=len(model.states)) * [100.0, 10.0, 10.0, 3.0]
        scalar, array = model.rhs(t, x), model.bind().rhs(t, x)
        np.testing.assert_allclose(scalar, array, rtol=1e-12, atol=1e-9)
        step = 1e-6
        slopes = [
            (model.rhs(t, x + step * unit) - model.rhs(t, x - step * unit)) / (2 * step) for unit in np.eye(len(x))
        ]
        # central differences of rates up to 1e5 leave 1e5 * 1e-16 / 1e-6 and the third derivative times 1e-12
        np.testing.assert_allclose(model.jacobian(t, x).toarray(), np.array(slopes).T, rtol=1e-6, atol=2e-4)
    times, many = dice.uniform(size=4), dice.normal(size=(len(model.states), 4))
    singly = np.column_stack([model.bind().rhs(float(t), many[:, k]) for k, t in enumerate(times)])
    np.testing.assert_allclose(model.bind().rhs(times, many), singly, rtol=1e-12, atol=1e-10)


def test_small_motions_of_controlled_sources_have_the_rates_of_the_ideal_machine() -> None:
    rates = [
        np.sort_complex(np.linalg.eigvals(_direct(kind).compile().linearize().A))
        for kind in (ControlledMachine, sw.DCMachine)
    ]
    np.testing.assert_allclose(rates[0], rates[1], rtol=1e-12)


def test_controlled_sources_are_printed_with_the_letters_of_what_they_read() -> None:
    eqs = _three_phases().equations()
    laws = " ".join(str(law.equation) for law in eqs.laws)
    assert "motor.i_a" in laws
    assert "motor.phi" in laws
    assert "J.omega" in laws
    assert " of " not in laws
    latex = eqs.latex(form="state")
    assert latex == _three_phases().equations().latex(form="state")
    assert r"\sin" in latex
    assert "across" not in latex
    assert "through" not in latex


@sw.component
class ChainedVoltages(sw.Component):
    """Law: two voltages, each the double of the other's node: known at no instant."""

    role = "source"
    ports = (sw.Port("p", ELECTRICAL), sw.Port("q", ELECTRICAL))

    def branches(self, _: Any) -> Iterator[Branch]:
        yield sw.AcrossLaw(2 * across_of("q"), ("p", None), "u_p")
        yield sw.AcrossLaw(2 * across_of("p"), ("q", None), "u_q")


@sw.component
class VoltageFollower(sw.Component):
    """Law: the voltage of q is that of p; the current that it takes from p is none."""

    role = "source"
    ports = (sw.Port("p", ELECTRICAL), sw.Port("q", ELECTRICAL))

    def branches(self, _: Any) -> Iterator[Branch]:
        yield sw.AcrossLaw(across_of("p"), ("q", None))


@sw.component
class VoltagePump(sw.Component):
    """Law: a current into q as large as the voltage of p."""

    role = "source"
    ports = (sw.Port("p", ELECTRICAL), sw.Port("q", ELECTRICAL))

    def branches(self, _: Any) -> Iterator[Branch]:
        yield sw.ThroughLaw(-across_of("p"), ("q", None))


def _circuit(source: sw.Component, *others: tuple[sw.Component, tuple[str, ...]]) -> sw.Network:
    net = sw.Network("refused")
    net.add(source, "p", "q")
    for part, nodes in others:
        net.add(part, *nodes)
    return net


def test_what_is_not_known_in_time_is_one_named_problem() -> None:
    at_both = ((sw.Resistor("r", R=1.0), ("p", "ground")), (sw.Resistor("s", R=1.0), ("q", "ground")))
    with pytest.raises(sw.NetworkError, match="controlled source") as caught:
        _circuit(ChainedVoltages("loop"), *at_both).compile()
    assert {problem.kind for problem in caught.value.problems} == {"controlled source"}
    assert "what it reads depends on ChainedVoltages 'loop'" in str(caught.value)


def test_a_prescribed_voltage_at_a_capacitor_may_not_be_read_from_elsewhere() -> None:
    feed = (sw.Capacitor("c", C=1.0), ("p", "ground")), (sw.Resistor("r", R=1.0), ("p", "ground"))
    with pytest.raises(sw.NetworkError, match=r"controlled source: .* of Capacitor 'd' by what it reads"):
        _circuit(VoltageFollower("f"), *feed, (sw.Capacitor("d", C=1.0), ("q", "ground"))).compile()
    model = _circuit(VoltageFollower("f"), *feed, (sw.Resistor("d", R=2.0), ("q", "ground"))).compile()
    assert model.simulate(1.0, initial={"c.u": 1.0})["d.u"][-1] == pytest.approx(np.exp(-1), rel=1e-8)


def test_a_current_that_meets_an_inductor_alone_is_answered_by_nothing() -> None:
    parts = (sw.Capacitor("c", C=1.0), ("p", "ground")), (sw.Inductor("l", L=1.0), ("q", "ground"))
    with pytest.raises(sw.NetworkError, match=r"massless node: .* nothing answers the current of VoltagePump 'pump'"):
        _circuit(VoltagePump("pump"), *parts).compile()


def test_a_node_between_inductors_has_no_voltage_to_read() -> None:
    parts = ((sw.Inductor(name, L=1.0), ("m" if name != "a" else "p", "p" if name != "a" else "c")) for name in "ab")
    rest = (sw.Capacitor("c", C=1.0), ("c", "ground")), (sw.Resistor("r", R=1.0), ("m", "ground"))
    load = (sw.Resistor("s", R=1.0), ("q", "ground"))
    with pytest.raises(sw.NetworkError, match="where only inductors meet"):
        _circuit(VoltageFollower("f"), *parts, *rest, load).compile()


@sw.component
class DragOfAnother(sw.Component):
    """Law: a torque on a that grows with the square of the speed of b."""

    role = "loss"

    def branches(self, _: Any) -> Iterator[Branch]:
        yield sw.ThroughLaw(2 * across_of("b") ** 2, ("a", None))


def test_a_torque_that_reads_its_own_speed_through_a_damper_is_an_algebraic_loop() -> None:
    """At the massless node: 20 (w1 - w2) = 2 w2^2 + w2 with w1 the speed of the disc, solved by hand."""
    pytest.importorskip("sksundae")
    net = sw.Network("loop")
    net.add(sw.Inertia("J", J=J), "disc")
    net.add(sw.Damper("slip", d=20.0), "disc", "out")
    net.add(sw.Damper("air", d=1.0), "out", "ground")
    net.add(DragOfAnother("drag"), "out", "out 2")
    net.add(sw.Gear("joint", ratio=1.0), "out", "out 2")
    with pytest.raises(sw.NetworkError, match="algebraic loop"):
        net.compile()
    sol = net.simulate(0.01, initial={"J.omega": 5.0}, algebraic_loops="solve", rtol=1e-9)

    def speed(w: np.ndarray) -> np.ndarray:
        return np.asarray((-21 + np.sqrt(21**2 + 160 * w)) / 4)

    truth = solve_ivp(
        lambda _, w: -20 * (w - speed(w)) / J, (0, 0.01), [5.0], "DOP853", sol.t, rtol=1e-12, atol=1e-12
    ).y[0]
    assert np.abs(sol["J.omega"] - truth).max() < 1e-7 * 5
