"""Laws that are hard on an engine, from the network to its signals."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from scipy.integrate import quad

import shaftwork as sw

ENGINES = ("auto", "scipy", "scipy-radau", "sundials", "heyoka")


def body(tau: object) -> sw.Network:
    """A free inertia of 1 kg m2 under a torque."""
    net = sw.Network("body")
    net.add(sw.TorqueSource("m", tau=tau), "n")
    net.add(sw.Inertia("J", J=1.0), "n")
    return net


def chain(size: int, drive: sw.Component) -> sw.Network:
    """Light inertias behind stiff, heavily damped springs: rates of 1e7 1/s and a speed that all soon share."""
    net = sw.Network("chain")
    net.add(drive, "n0")
    for k in range(size):
        net.add(sw.Inertia(f"J{k}", J=1e-6), f"n{k}")
    for k in range(size - 1):
        net.add(sw.Spring(f"s{k}", c=1e4, d=10.0), f"n{k}", f"n{k + 1}")
    return net


@pytest.mark.parametrize("size", [20, 101])
def test_a_stiff_chain_is_solved_by_sundials_below_and_above_a_hundred_states(size: int) -> None:
    motor = sw.KlossMotor("m", tau_k=10.0, s_k=0.2, n_sync=1000)
    sol = chain(size, motor).simulate(1.0)
    assert sol.engine == "sundials"
    # without load the motor runs up to its synchronous speed of 1000 rpm
    assert sol[f"J{size - 1}.omega"][-1] == pytest.approx(1000 * 2 * np.pi / 60, rel=1e-6)


@pytest.mark.slow
def test_a_stop_that_a_large_chain_meets_on_its_way_is_part_of_the_jacobian() -> None:
    """At the start the stop has no slope, so its entries join the sparse pattern only when it is hit."""
    net = chain(101, sw.TorqueSource("m", tau=5.0))
    touch = sympy.Max(sw.phi - 0.5, 0)
    net.add(sw.TorqueSource("stop", tau=-1e6 * touch - 3.0 * sw.omega * sympy.Heaviside(sw.phi - 0.5)), "n100")
    sol = net.simulate(0.5, engine="sundials", t_eval=11)
    assert sol["stop.tau"][-1] == pytest.approx(-5.0, rel=1e-4)  # at rest against the stop
    assert sol.statistics["steps"] < 10_000  # without these entries Newton's method needs a hundred times as many


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(
    ("tau", "speed"),
    [
        (sympy.Heaviside(sw.t - 0.5), 0.5),
        (sympy.sign(sw.t - 0.25), 0.5),
        (-sympy.sign(sw.omega + 1) * (sw.omega + 1) ** 2, -0.5),
        (2 - sympy.Heaviside(sw.omega - 0.5), 1.25),
        (1 - sympy.Abs(sw.omega) * sw.omega, np.tanh(1.0)),
    ],
    ids=str,
)
def test_laws_with_steps_and_signs_are_solved_and_read_by_every_engine(engine: str, tau: object, speed: float) -> None:
    """From rest; every engine ends its steps where a law switches, in time or with the speed."""
    sol = body(tau).simulate(1.0, engine=engine)
    assert sol["J.omega"][-1] == pytest.approx(speed, abs=1e-6)
    assert np.isfinite(sol["m.tau"]).all()


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("power", [2, 3, 4, 5])
def test_a_drag_of_any_power_acts_from_rest(engine: str, power: int) -> None:
    """t = int dw / (1 - w^n): a series of order 13 does not show w^5 at rest, and must not step over it."""
    sol = body(1 - sw.omega**power).simulate(3.0, engine=engine)
    elapsed = quad(lambda w: 1 / (1 - w**power), 0.0, sol["J.omega"][200])[0]
    # the motion is followed to 1e-8; the slope dt / dw = 1 / (1 - w^n) is at most 2 here
    assert elapsed == pytest.approx(0.6, abs=1e-6)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_cubic_torque_against_a_cubic_spring_starts_from_rest(engine: str) -> None:
    """phi^3 begins with t^15, which no series of order 13 about the start shows."""
    sol = body(3 * sw.t**3 - sw.phi**3).simulate(3.0, engine=engine)
    reference = body(3 * sw.t**3 - sw.phi**3).simulate(3.0, engine="scipy", rtol=1e-12)
    assert sol["J.omega"][-1] == pytest.approx(reference["J.omega"][-1], rel=1e-6)


ROUGH = [1 - sympy.sqrt(sw.omega), 1 - sympy.Abs(sw.omega) ** 0.7, sympy.sqrt(sw.t)]


@pytest.mark.slow
@pytest.mark.parametrize("tau", ROUGH, ids=str)
def test_auto_goes_on_with_scipy_where_a_law_has_no_taylor_series(tau: object) -> None:
    sol, reference = body(tau).simulate(1.0), body(tau).simulate(1.0, engine="scipy")
    assert sol.engine == "scipy"
    assert "no Taylor series" in sol.why
    assert np.array_equal(sol["J.omega"], reference["J.omega"])


@pytest.mark.heyoka
@pytest.mark.parametrize("tau", ROUGH, ids=str)
def test_heyoka_when_asked_for_names_a_time_that_it_has_reached(tau: object, capfd: pytest.CaptureFixture[str]) -> None:
    said = r"failed at t = 0 s(: tau = .* of TorqueSource 'm' has a value there|.*not finite.*J\.omega' = 0 )"
    with pytest.raises(sw.SimulationError, match=said) as caught:
        body(tau).simulate(1.0, engine="heyoka")
    assert "nan" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("engine", ["scipy-radau", "sundials"])
def test_an_infinite_slope_at_rest_does_not_hold_an_implicit_engine_at_rest(engine: str) -> None:
    """J w' = 1 - sqrt(w): t = -2 sqrt(w) - 2 ln(1 - sqrt(w))."""
    root = np.sqrt(body(1 - sympy.sqrt(sw.omega)).simulate(1.0, engine=engine)["J.omega"][-1])
    assert -2 * root - 2 * np.log(1 - root) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["scipy", "sundials"])
def test_a_run_that_chatters_ends_with_the_time_and_what_to_do(engine: str) -> None:
    with pytest.raises(sw.SimulationError, match=r"failed at t = 0\.5\d* s.*2000 steps.*smooth transition.*J\.omega"):
        body(-2 * sympy.sign(sw.omega)).simulate(1.0, engine=engine, initial={"J.omega": 1.0})


@pytest.mark.parametrize("engine", [pytest.param("auto", marks=pytest.mark.slow), "heyoka"])
def test_a_motion_that_sticks_is_named_at_the_time_where_it_does(engine: str) -> None:
    with pytest.raises(sw.SimulationError, match=r"failed at t = 0\.5 s.*sticks.*smooth transition.*'J\.omega' = 0 "):
        body(-2 * sympy.sign(sw.omega)).simulate(1.0, engine=engine, initial={"J.omega": 1.0})


def test_sundials_says_once_why_it_failed(capfd: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(sw.SimulationError, match="sundials engine failed at t = "):
        body(1 + sw.omega**2).simulate(3.0, engine="sundials")
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
def test_the_exact_engine_says_that_an_input_is_too_rough() -> None:
    """A root has no slope at zero, so no polynomials resolve it."""
    with pytest.raises(sw.ParameterError, match="polynomials resolve the input"):
        body(sympy.sqrt(sw.t)).simulate(1.0, engine="exact")


def test_a_law_that_jumps_in_the_speed_is_not_linear() -> None:
    assert not body(2 - sympy.Heaviside(sw.omega - 0.5)).compile().linear
    assert body(sympy.Heaviside(sw.t - 0.5) - sw.omega).compile().linear


@pytest.mark.parametrize("engine", ENGINES)
def test_a_law_that_jumps_in_the_speed_between_constant_values_is_no_constant_source(engine: str) -> None:
    """1 N m below 0.5 rad/s, 2 N m above: 0.5 s to the jump, then 0.5 s at the double."""
    law = sympy.Piecewise((1, sw.omega < 0.5), (2, True))
    sol = body(law).simulate(1.0, engine=engine)
    assert sol["J.omega"][-1] == pytest.approx(1.5, abs=1e-6)
    assert sol["m.tau"][[0, -1]] == pytest.approx([1.0, 2.0])


@pytest.mark.filterwarnings("ignore:jumping source:shaftwork.core.errors.NetworkWarning")
@pytest.mark.parametrize("form", ["scaled", "plain"])
@pytest.mark.parametrize("time", [0.5, 1 / 3, 0.7])
def test_a_prescribed_speed_that_jumps_gives_its_whole_impulse(time: float, form: str) -> None:
    """Two inertias share what the source turns: the whole jump is an impulse to them, however the step is written."""
    step = sympy.Heaviside(sw.t - time) if form == "plain" else sympy.Heaviside(sw.t / time - 1)
    net = sw.Network("jump")
    net.add(sw.SpeedSource("drive", omega=6 * step), "sun")
    net.add(sw.PlanetaryGear("gear", ratio=2.0), "sun", "carrier", "ring")
    net.add(sw.Inertia("J1", J=2.0), "ring")
    net.add(sw.Inertia("J2", J=1.0), "carrier")
    sol = net.simulate(1.0, t_eval=[0.1, time, 1.0])
    # sun + 2 ring = 3 carrier, and the impulses obey J1 ring / 2 = -J2 carrier / 3
    assert sol["J1.omega"] == pytest.approx([0.0, 6 * 2 / -22, 6 * 2 / -22])
    assert sol["J2.omega"] == pytest.approx([0.0, 6 * 6 / 22, 6 * 6 / 22])
    assert sol.energy_residual < 1e-9


@pytest.mark.filterwarnings("ignore:jumping source:shaftwork.core.errors.NetworkWarning")
def test_a_capacitor_behind_a_voltage_that_jumps_takes_the_whole_jump() -> None:
    """Two capacitors in series across the source: each takes half of the jump at once, exactly at 0.5 s."""
    net = sw.Network("divider")
    net.add(sw.VoltageSource("u", u=10 * sympy.Heaviside(sw.t - 0.5)), "a", "0")
    net.add(sw.Capacitor("C1", C=1e-3), "a", "b")
    net.add(sw.Capacitor("C2", C=1e-3), "b", "0")
    net.add(sw.Resistor("R", R=1e3), "b", "0")
    net.add(sw.Ground("earth"), "0")
    sol = net.simulate(1.0, t_eval=[0.25, 0.5, 1.0])
    # 5 V at once, then with (C1 + C2) R = 2 s towards zero
    assert sol["C2.u"] == pytest.approx([0.0, 5.0, 5 * np.exp(-0.25)], abs=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("omega_s", [0.1, 0.01, 1e-3, 1e-4])
@pytest.mark.parametrize(("amplitude", "rate"), [(3.0, 2.0), (25.0, 3.0)])
def test_a_rounded_travel_resistance_turns_with_the_speed(omega_s: float, amplitude: float, rate: float) -> None:
    """Away from standstill tanh(omega / omega_s) is 1 to the last bit, and a series there does not show its fall."""
    net = body(amplitude * sympy.sin(rate * sw.t))
    net.add(sw.CoulombLoad("load", tau=2.0, omega_s=omega_s), "n")
    fast, slow = (net.simulate(3.0, engine=engine, rtol=1e-10) for engine in ("heyoka", "scipy"))
    assert fast["J.omega"] == pytest.approx(slow["J.omega"], abs=1e-7)
    assert fast.energy_residual < 1e-10


@pytest.mark.slow
@pytest.mark.parametrize("width", [1e-2, 1e-4])
def test_a_short_pulse_is_not_stepped_over_by_the_series(width: float) -> None:
    """The work of a bell curve: its area is width sqrt(pi)."""
    sol = body(sympy.exp(-(((sw.t - 0.5) / width) ** 2)) / width).simulate(1.0, engine="heyoka")
    assert sol["J.omega"][-1] == pytest.approx(np.sqrt(np.pi), rel=1e-8)  # the tail beyond e^-24


WRAPPED = [
    sympy.atan2(sympy.sin(sw.phi), sympy.cos(sw.phi)),
    sympy.atan(sympy.tan(sw.phi)),
    sympy.asin(sympy.sin(sw.phi)),
]


@pytest.mark.slow
@pytest.mark.parametrize("angle", WRAPPED, ids=str)
def test_an_angle_that_is_brought_back_into_one_turn_begins_anew(angle: sympy.Expr) -> None:
    """Neither taken for the angle itself nor for its smooth continuation."""
    sol, reference = (body(3 + angle).simulate(3.0, engine=engine) for engine in ("auto", "scipy-radau"))
    assert not body(3 + angle).compile().linear
    assert sol["J.omega"][-1] == pytest.approx(reference["J.omega"][-1], rel=1e-3)  # Radau steps over the jumps
    assert sol.energy_residual < 1e-5
    with pytest.raises(sw.SimulationError, match="heyoka compiles small networks"):
        body(3 + angle).simulate(3.0, engine="heyoka")


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["auto", "scipy"])
def test_a_triangular_wave_has_its_corners(engine: str) -> None:
    """As a law of time and of the angle, against the triangle in pieces."""
    folded = sympy.Piecewise((sw.phi, sw.phi < sympy.pi / 2), (sympy.pi - sw.phi, True))
    laws = (2 + sympy.asin(sympy.sin(sw.phi)), 2 + folded)
    wave, pieces = (body(law).simulate(1.5, angles=["J"], engine=engine, rtol=1e-9) for law in laws)
    assert np.pi / 2 < pieces["J.phi"][-1] < 3 * np.pi / 2  # past the first corner, before the second
    assert wave["J.omega"] == pytest.approx(pieces["J.omega"], rel=1e-7)  # of 4 rad/s
    for law, end in ((sympy.asin(sympy.sin(sw.t)), 0.0), (sympy.acos(sympy.cos(sw.t)), 10 * np.pi**2)):
        sol = body(law).simulate(20 * np.pi, engine=engine)  # ten periods
        assert sol["J.omega"][-1] == pytest.approx(end, abs=1e-8)
