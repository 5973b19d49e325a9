"""Laws that jump or bend with the time: every engine stops there, and gives the whole impulse, once.

The references are piecewise: each law comes with its own plain function and its own list of switching times.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import shaftwork as sw
from shaftwork.codegen.timeline import timeline
from shaftwork.integrate.engines import available
from tests.properties.examples import share_of_examples

pytestmark = pytest.mark.filterwarnings("ignore:jumping source:shaftwork.core.errors.NetworkWarning")

Array = NDArray[np.float64]
ENGINES = ("auto", "scipy", "scipy-radau", "sundials", "heyoka", "numba")
CARRIER, RING = 3 / 17, -4 / 17
"""Speeds of the gear's inertias over that of its sun: sun + 2 ring = 3 carrier, 1 ring / 2 = -2 carrier / 3."""


def body(*laws: object) -> sw.Network:
    """A free inertia of 1 kg m2 under torques."""
    net = sw.Network("body")
    for number, law in enumerate(laws):
        net.add(sw.TorqueSource(f"m{number}", tau=law), "n")
    net.add(sw.Inertia("J", J=1.0), "n")
    return net


def gear(omega: object) -> sw.Network:
    """A planetary gear with a prescribed speed of its sun: carrier (2 kg m2) and ring (1 kg m2) follow by impulses."""
    net = sw.Network("gear")
    net.add(sw.SpeedSource("drive", omega=omega), "sun")
    net.add(sw.PlanetaryGear("gear", ratio=2.0), "sun", "carrier", "ring")
    net.add(sw.Inertia("C", J=2.0), "carrier")
    net.add(sw.Inertia("R", J=1.0), "ring")
    return net


def chain(tau: object) -> sw.Network:
    """A torque on the massless node between two springs, which share what jumps."""
    net = sw.Network("chain")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Spring("s1", c=100.0), "a", "x")
    net.add(sw.TorqueSource("m", tau=tau), "x")
    net.add(sw.Spring("s2", c=300.0), "x", "e")
    net.add(sw.Inertia("J2", J=3.0), "e")
    return net


@dataclass(frozen=True)
class Term:
    """A law of time, the same as a plain function, and the times where it is not smooth."""

    law: sympy.Expr
    value: Callable[[Array], Array]
    times: tuple[float, ...]


def crossings(w: float, c: float, level: float) -> tuple[float, ...]:
    """Times in [0, 1] at which sin(w t + c) is a level."""
    turns = 2 * np.pi * np.arange(-5, 9)
    angles = np.concatenate([np.arcsin(level) + turns, np.pi - np.arcsin(level) + turns])
    times = (angles - c) / w
    return tuple(times[(times >= 0) & (times <= 1)].tolist())


def linear(kind: str, at: float, h: float) -> Term:
    """A law that switches at one time (a ramp at two)."""
    t = sw.t
    later: Callable[[Array], Array] = lambda x: (x > at).astype(float)  # noqa: E731
    return {
        "step": lambda: Term(sw.Step(h, start=at), lambda x: h * later(x), (at,)),
        "scaled": lambda: Term(h * sympy.Heaviside(3 * t - 3 * at), lambda x: h * later(x), (at,)),
        "sign": lambda: Term(h * sympy.sign(at - t), lambda x: h * (1 - 2 * later(x)), (at,)),
        "square": lambda: Term(h * sympy.Heaviside(t**2 - at**2), lambda x: h * later(x), (at,)),
        "max": lambda: Term(h * sympy.Max(t, at), lambda x: h * np.maximum(x, at), (at,)),
        "min": lambda: Term(h * sympy.Min(2 * t, 2 * at, 3), lambda x: h * np.minimum(2 * x, 2 * at), (at,)),
        "ramp": lambda: Term(
            sw.Ramp(h, 0.2, start=at), lambda x: h * np.clip((x - at) / 0.2, 0.0, 1.0), (at, at + 0.2)
        ),
    }[kind]()


def sinusoidal(kind: str, w: float, c: float, h: float) -> Term:
    """A law that switches with sin(w t + c)."""
    wave = sympy.sin(w * sw.t + c)
    return {
        "sign": lambda: Term(h * sympy.sign(wave), lambda x: h * np.sign(np.sin(w * x + c)), crossings(w, c, 0.0)),
        "heaviside": lambda: Term(
            h * sympy.Heaviside(wave - 0.3), lambda x: h * (np.sin(w * x + c) > 0.3), crossings(w, c, 0.3)
        ),
        "max": lambda: Term(
            h * sympy.Max(wave, 0.25), lambda x: h * np.maximum(np.sin(w * x + c), 0.25), crossings(w, c, 0.25)
        ),
        "min": lambda: Term(
            h * sympy.Min(wave, -0.5), lambda x: h * np.minimum(np.sin(w * x + c), -0.5), crossings(w, c, -0.5)
        ),
    }[kind]()


TIMES = st.builds(
    lambda tenths, form, ulps: (
        {"whole": tenths / 10, "sum": sum([0.1] * tenths), "product": 0.1 * tenths}[form] + ulps * np.spacing(0.5)
    ),
    st.integers(0, 10),
    st.sampled_from(["whole", "sum", "product"]),
    st.sampled_from([0, 0, 0, 1, -1, 3, -3]),
).filter(lambda time: 0 <= time <= 1)
HEIGHTS = st.sampled_from([1.0, -1.0, 2.0, 5.0, -3.0])
TERMS = st.one_of(
    st.builds(linear, st.sampled_from(["step", "scaled", "sign", "square", "max", "min", "ramp"]), TIMES, HEIGHTS),
    st.builds(
        sinusoidal,
        st.sampled_from(["sign", "heaviside", "max", "min"]),
        st.sampled_from([3.0, 7.5, 20.0, 10 * np.pi]),
        st.sampled_from([0.0, 0.5, -1.0]),
        HEIGHTS,
    ),
)
OUTPUTS = np.linspace(0.0, 1.0, 11)
AMBIGUOUS = 1e-13
"""An output so near to a jump that was moved by rounding may be before or after it, s."""


def ends_of(terms: list[Term]) -> Array:
    """The times between which the sum of the terms is smooth, from 0 to 1."""
    times = np.array(sorted({0.0, 1.0, *(time for term in terms for time in term.times if 0 < time < 1)}))
    return np.append(times[:-1][np.diff(times) > AMBIGUOUS], 1.0)


def total(terms: list[Term], x: Array) -> Array:
    """The sum of the terms, away from their jumps."""
    return np.asarray(sum((term.value(x) for term in terms), start=np.zeros_like(x)))


def sides(terms: list[Term], x: Array) -> tuple[Array, Array]:
    """The sum just before and just after times; only the side in the run at its ends."""
    before, after = (total(terms, np.clip(x + side, 2 * AMBIGUOUS, 1 - 2 * AMBIGUOUS)) for side in (-2e-13, 2e-13))
    return before, after


RUN = share_of_examples(0.2)


@pytest.mark.slow
@given(st.lists(TERMS, min_size=1, max_size=4), st.sampled_from(ENGINES))
@RUN
def test_a_free_body_has_the_integral_of_any_law(terms: list[Term], engine: str) -> None:
    sol = body(sum(term.law for term in terms)).simulate(1.0, engine=engine, t_eval=OUTPUTS, rtol=1e-9)
    nodes, weights = np.polynomial.legendre.leggauss(20)
    for k, time in enumerate(OUTPUTS):
        edges = np.append(ends_of(terms)[ends_of(terms) < time], time)
        spans = (((b - a) / 2, a + (b - a) * (nodes + 1) / 2) for a, b in pairwise(edges))
        speed = sum((half * weights @ total(terms, x) for half, x in spans), start=0.0)
        # the engines at rtol 1e-9 sum up to 50 pieces; a missed switch would cost 1e-3 or more
        assert sol["J.omega"][k] == pytest.approx(speed, abs=1e-6)


@pytest.mark.slow
@given(st.lists(TERMS, min_size=1, max_size=4), st.sampled_from(ENGINES))
@RUN
def test_a_geared_speed_gives_every_impulse_once(terms: list[Term], engine: str) -> None:
    sol = gear(sum(term.law for term in terms)).simulate(1.0, engine=engine, t_eval=OUTPUTS, rtol=1e-9)
    before, after = sides(terms, OUTPUTS)
    for name, factor in (("drive.omega", 1.0), ("C.omega", CARRIER), ("R.omega", RING)):
        early, late = (np.abs(sol[name] - factor * side) for side in (before, after))
        # as above; a lost or doubled jump is 0.1 or more
        assert np.minimum(early, late).max() < 1e-6, name
    # all three are read on the same side
    assert sol["C.omega"] == pytest.approx(CARRIER * sol["drive.omega"], abs=1e-6)
    assert sol.energy_residual < 1e-6


@pytest.mark.slow
@given(st.lists(TERMS, min_size=1, max_size=4), st.sampled_from(ENGINES))
@RUN
def test_springs_in_series_share_every_jump_of_the_torque_between_them(terms: list[Term], engine: str) -> None:
    """The angles of the inertias never jump: in them the motion is an ordinary one, piece after piece."""

    def rhs(x: float, z: Array) -> Array:
        a, b, wa, wb = z
        middle = (100 * a + 300 * b + total(terms, np.array([x]))[0]) / 400
        return np.array([wa, wb, -100 * (a - middle) / 2, -300 * (b - middle) / 3])

    state = np.zeros(4)
    for start, end in pairwise(ends_of(terms)):
        inside = (start + AMBIGUOUS, end - AMBIGUOUS)
        state = solve_ivp(lambda x, z, s=inside: rhs(np.clip(x, *s), z), (start, end), state, rtol=1e-10, atol=1e-12).y[
            :, -1
        ]
    sol = chain(sum(term.law for term in terms)).simulate(1.0, engine=engine, t_eval=[0.0, 1.0], rtol=1e-9)
    # as above; the speeds are of the order of 1 rad/s
    assert [sol["J1.omega"][-1], sol["J2.omega"][-1]] == pytest.approx(state[2:], abs=1e-5)
    last = total(terms, np.array([1 - 2 * AMBIGUOUS]))[0]
    assert sol["s2.tau"][-1] - sol["s1.tau"][-1] == pytest.approx(last, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("engine", [*ENGINES, "exact"])
@pytest.mark.parametrize(
    "law",
    [
        sw.Step(10, start=0.3) + sw.Step(10, start=0.1 + 0.2),
        10 * sympy.Heaviside(sw.t / 3 - 0.1) + 10 * sympy.Heaviside(3 * sw.t - 0.9),
        sum(sw.Step(1, start=0.3 + k * np.spacing(0.3)) for k in range(-10, 10)),
    ],
    ids=["added", "scaled", "a row of roundings"],
)
def test_jumps_that_only_rounding_tells_apart_are_one(engine: str, law: sympy.Expr) -> None:
    sol = gear(law).simulate(1.0, engine=engine)
    assert [sol["C.omega"][-1], sol["R.omega"][-1]] == pytest.approx([20 * CARRIER, 20 * RING])
    assert sol.energy_residual < 1e-9


@pytest.mark.parametrize("engine", [*ENGINES, "exact"])
def test_sources_that_cancel_but_for_rounding_do_nothing(engine: str) -> None:
    net = body(sw.Step(5, start=0.3), sw.Step(-5, start=0.1 * 3))
    assert np.abs(net.simulate(1.0, engine=engine)["J.omega"]).max() < 1e-12


@pytest.mark.parametrize("engine", [*ENGINES, "exact"])
@pytest.mark.parametrize("start", [1e-300, 1e-16, 1 - 1e-16, 1 - 1e-15, 1.0])
def test_a_jump_at_a_rounding_from_an_end_of_the_run_is_there(engine: str, start: float) -> None:
    sol = gear(sw.Step(17, start=start)).simulate(1.0, engine=engine)
    jumped = start < 0.5
    assert sol["C.omega"][[0, -1]] == pytest.approx([3.0 * jumped] * 2)
    assert sol["drive.omega"][[0, -1]] == pytest.approx([17.0 * jumped] * 2)
    speed = body(sw.Step(3, start=start)).simulate(1.0, engine=engine)["J.omega"][-1]
    assert speed == pytest.approx(3.0 * jumped, abs=1e-12)


@pytest.mark.parametrize("engine", [*ENGINES, "exact"])
def test_the_last_sample_is_before_a_jump_at_the_end_as_a_whole(engine: str) -> None:
    sol = gear(sw.Step(10, start=1.0)).simulate(1.0, engine=engine)
    assert [sol[name][-1] for name in ("drive.omega", "C.omega", "R.omega")] == [0.0, 0.0, 0.0]
    assert sol.energy_residual == 0.0


@pytest.mark.parametrize("engine", ENGINES)
def test_an_output_at_the_root_of_a_square_is_after_the_jump(engine: str) -> None:
    sol = gear(17 * sympy.Heaviside(sw.t**2 - 0.25)).simulate(1.0, engine=engine, t_eval=[0.4, 0.5, 0.6])
    assert sol["C.omega"] == pytest.approx([0.0, 3.0, 3.0])
    assert sol["drive.omega"] == pytest.approx([0.0, 17.0, 17.0])


@pytest.mark.parametrize("engine", ENGINES)
def test_a_square_wave_charges_capacitors_in_series_by_its_jumps_alone(engine: str) -> None:
    """A quarter of 5 V each way; the resistor's time constant of 4000 s does nothing in 1 s."""
    net = sw.Network("divider")
    net.add(sw.VoltageSource("u", u=5 * sympy.sign(sympy.sin(20 * sw.t))), "p", "0")
    net.add(sw.Capacitor("C1", C=1e-3), "p", "m")
    net.add(sw.Capacitor("C2", C=3e-3), "m", "0")
    net.add(sw.Resistor("R", R=1e6), "m", "0")
    net.add(sw.Ground("earth"), "0")
    sol = net.simulate(1.0, engine=engine)
    assert sol["C2.u"] == pytest.approx(1.25 * np.sign(np.sin(20 * sol.t + 1e-9)), abs=1.25 * 3e-4)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_pulse_between_squares_is_not_stepped_over(engine: str) -> None:
    pulse = 1e4 * (sympy.Heaviside(sw.t**2 - 0.25) - sympy.Heaviside(sw.t**2 - 0.2501))
    speed = body(pulse).simulate(1.0, engine=engine)["J.omega"][-1]
    assert speed == pytest.approx(1e4 * (np.sqrt(0.2501) - 0.5), rel=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_a_bell_that_lies_between_two_samples_is_found(engine: str) -> None:
    """exp(-x^2) is above 1/2 for |x| < sqrt(ln 2): 3.3e-5 s here, and samples 6e-5 s apart show only its foot."""
    width = 2e-5
    bell = sympy.Heaviside(sympy.exp(-(((sw.t - 0.512) / width) ** 2)) - 0.5)
    speed = body(1e4 * bell).simulate(1.0, engine=engine)["J.omega"][-1]
    assert speed == pytest.approx(1e4 * 2 * width * np.sqrt(np.log(2)), rel=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("inside", [1 / sw.t, 1 / (sw.t - 0.3)], ids=str)
def test_a_law_that_jumps_without_end_is_refused_with_its_part_and_condition(inside: sympy.Expr) -> None:
    with pytest.raises(sw.ParameterError, match=r"'m0'.*sin\(1/.*too often between t = 0 s and 1 s"):
        body(sympy.sign(sympy.sin(inside))).simulate(1.0)


@pytest.mark.parametrize("engine", ["heyoka", "numba"])
def test_a_jump_of_a_table_over_a_sine_is_found_at_every_point_that_is_passed(engine: str) -> None:
    curve = sw.Table([-0.5, 0.0, 0.5], [0.0, 1.0, 0.0])
    sol = body(curve(sympy.sin(9 * sw.t))).simulate(1.0, engine=engine)
    x = np.linspace(0.0, 1.0, 2_000_001)
    mean = np.interp(np.sin(9 * x), [-0.5, 0.0, 0.5], [0.0, 1.0, 0.0])
    # the trapezium rule over the kinks is good to 1e-11
    assert sol["J.omega"][-1] == pytest.approx((mean.sum() - (mean[0] + mean[-1]) / 2) / 2e6, abs=1e-9)


@pytest.mark.parametrize("engine", ["heyoka", "numba"])
def test_locating_is_done_once_for_equal_runs(engine: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from shaftwork.codegen import time_switches

    asked = []
    original = time_switches.sampled
    monkeypatch.setattr(time_switches, "sampled", lambda *rest: asked.append(1) or original(*rest))
    model = chain(sympy.sign(sympy.sin(9 * sw.t) - 0.1)).compile()
    for stiffness in (100.0, 200.0, 300.0):
        model.simulate(1.0, parameters={"s1.c": stiffness}, engine=engine)
    assert len(asked) == 1
    model.simulate(2.0, engine=engine)
    assert len(asked) == 2


NEGATIVE = [
    (-1 - sw.omega ** sympy.Float(1.5), 0.0),
    ((sw.omega + 0.5) ** sympy.Rational(1, 3) - 1, None),
    ((-2) ** sw.omega - 3, 0.0),
    ((sw.t - 0.5) ** sympy.Rational(1, 3), 0.0),
]


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("law", "time"), NEGATIVE, ids=[str(law) for law, _ in NEGATIVE])
def test_a_power_of_a_negative_base_ends_the_run_where_it_is_met(engine: str, law: sympy.Expr, time: float) -> None:
    """J w' = (w + 1/2)^(1/3) - 1 with z^3 = w + 1/2: t = int 3 z^2 / (1 - z) dz from 0 to 0.5^(1/3)."""
    if time is None:
        z = 0.5 ** (1 / 3)
        time = 3 * (-z - z**2 / 2 - np.log(1 - z))
    with pytest.raises(sw.SimulationError, match=r"tau = .* of TorqueSource .* has no real value") as caught:
        body(law).simulate(3.0, engine=engine)
    assert float(str(caught.value).split("At t = ")[1].split(" s")[0]) == pytest.approx(time, abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_a_condition_of_time_alone_never_sticks(engine: str) -> None:
    law = sympy.Max(5 * sympy.sin(7 * sw.t), 2, 3 - 10 * sw.t)
    sol = chain(law).simulate(1.0, engine=engine)
    # the same motion in another engine's arithmetic, and the balance of energy
    reference = chain(law).simulate(1.0, engine="scipy", rtol=1e-11)
    assert sol["J1.omega"][-1] == pytest.approx(reference["J1.omega"][-1], abs=1e-6)
    assert sol.energy_residual < 1e-6


@pytest.mark.parametrize("engine", ["auto", "heyoka", "numba"])
@pytest.mark.parametrize("t_end", [1.0, 1.5, 2.0, 3.0, 5.0])
def test_a_wave_that_the_body_turns_through_never_holds_it(engine: str, t_end: float) -> None:
    """5 and 1 N m in turn, every pi / 8 rad; the series of sin(20 t^2) at rest has no term in t^12 and t^13."""
    speed, time, torque = 0.0, 0.0, 5.0
    while True:
        faster = np.sqrt(speed**2 + torque * np.pi / 4)
        if time + (faster - speed) / torque > t_end:
            break
        time, speed, torque = time + (faster - speed) / torque, faster, 6.0 - torque
    sol = body(3 + 2 * sympy.sign(sympy.sin(8 * sw.phi))).simulate(t_end, engine=engine, rtol=1e-12)
    assert sol.engine == (next(filter(available, ("heyoka", "numba"))) if engine == "auto" else engine)
    assert sol["J.omega"][-1] == pytest.approx(speed + torque * (t_end - time), abs=1e-9)


@pytest.mark.parametrize("engine", ENGINES)
def test_conditions_of_time_and_state_may_be_joined(engine: str) -> None:
    """1 N m up to 0.5 s, then 2 N m as long as it is slower than 1 rad/s, which it is up to 0.75 s, then nothing."""
    slow, late = sw.omega < 1, sw.t > 0.5
    law = sympy.Piecewise((2, slow & late), (0, late | (sw.omega > 2)), (1, True))
    sol = body(law).simulate(1.0, engine=engine)
    assert sol["J.omega"][[500, -1]] == pytest.approx([0.5, 1.0], abs=1e-4)


def test_instants_within_a_rounding_are_one_and_keep_both_sides() -> None:
    found = timeline([(0.3, 0.0), (0.1 + 0.2, 0.0), (0.6, 1e-6), (0.0, 0.0), (2.0, 0.0), (1.0, 0.0)], 0.0, 1.0)
    assert found.times == (0.0, 0.3, 0.6, 1.0)
    before, after = found.sides(0.3)
    assert before < 0.3 < 0.1 + 0.2 < after
    assert found.sides(0.6) == (0.6 - 1e-6, 0.6 + 1e-6)
    assert found.sides(0.0)[0] == found.sides(0.0)[1] > 0  # nothing is before the start
    assert found.sides(1.0)[0] == found.sides(1.0)[1] < 1  # nor after the end
    assert found.sides(0.5) == (0.5, 0.5)


def test_a_time_that_is_listed_twice_is_read_before_and_after() -> None:
    found = timeline([(0.5, 0.0)], 0.0, 1.0)
    low, high = found.sides(0.5)
    assert found.one_sided(np.array([0.25, 0.5, 0.5, 0.75])).tolist() == [0.25, low, high, 0.75]
    assert found.one_sided(np.array([np.nextafter(0.5, 0), 0.5])).tolist() == [low, high]


TOUCHING = {
    "floor of a sine": (sympy.floor(sympy.sin(3 * sw.t)), 4.0, -(4.0 - 2 * math.pi / 3)),
    "floor of more": (sympy.floor(2 * sympy.sin(sympy.pi * sw.t)), 4.0, -2.0),
    "sign": (sympy.sign((sw.t - 1) ** 2 * (sw.t - 2)), 4.0, 0.0),
}
"""Laws whose argument touches the next whole number or zero in the middle between two jumps, and their integrals."""


@pytest.mark.slow
@pytest.mark.parametrize("law", TOUCHING)
@pytest.mark.parametrize("engine", ["auto", "scipy", pytest.param("sundials", marks=pytest.mark.slow)])
def test_a_threshold_that_is_touched_is_not_passed(law: str, engine: str) -> None:
    """heyoka read such a law where it touches, and kept the value: 0.19 for -1.9 rad/s."""
    expression, end, momentum = TOUCHING[law]
    net = sw.Network("touching")
    net.add(sw.TorqueSource("T", tau=expression), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.TorqueSource("none", tau=0 * sw.omega**3), "a")
    # the instants are found to rounding; steps add up to some hundred tolerances
    assert net.simulate(end, engine=engine)["J.omega"][-1] == pytest.approx(momentum, rel=1e-6, abs=1e-6)


def test_a_brake_whose_torque_touches_a_whole_number_takes_what_its_law_says() -> None:
    net = sw.Network("brake")
    net.add(sw.TorqueSource("T", tau=20.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Brake("brake", tau=15 * sympy.floor(2 * sympy.cos(3 * sw.t))), "a")
    assert net.simulate(3.0)["J.omega"][-1] == pytest.approx(60 - 5 * math.pi, rel=1e-7)  # 15 N m while cos > 1/2


@pytest.mark.slow
def test_a_switch_over_the_angle_that_is_touched_is_no_place_where_a_motion_sticks() -> None:
    """A Table over a crank angle touches its last point in each turn."""
    net = sw.Network("crank")
    net.add(sw.TorqueSource("T", tau=sw.Table([-1, 0, 1], [0, 5, 20])(sympy.sin(3 * sw.phi)) + 1 - sw.omega), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    found, other = (net.simulate(4.0, engine=engine)["J.omega"][-1] for engine in ("auto", "scipy"))
    assert found == pytest.approx(other, rel=1e-6)
    assert found == pytest.approx(9.14892, rel=1e-5)  # scipy's DOP853 of the same equation by hand


@pytest.mark.parametrize("engine", ["auto", "scipy", pytest.param("sundials", marks=pytest.mark.slow)])
@pytest.mark.parametrize(
    ("on", "first"),
    [
        (sympy.sin(sympy.pi * sw.t) ** 5000 - 0.5, math.asin(0.5 ** (1 / 5000)) / math.pi),
        (sympy.exp(-(((sw.t - 2.3456) / 0.02) ** 2)) - 0.5, 2.3456 - 0.02 * math.sqrt(math.log(2))),
    ],
    ids=["wave", "bell"],
)
def test_no_pulse_that_switches_a_brake_on_is_missed(on: sympy.Expr, first: float, engine: str) -> None:
    net = sw.Network("brake")
    net.add(sw.TorqueSource("T", tau=2.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Brake("brake", tau=50.0, on=on), "a")
    sol = net.simulate(4.0, engine=engine)
    assert sol.events[0][0] == pytest.approx(first, abs=1e-8)  # of a flank of 1e-4 s a tolerance of 1e-8 is as much
    assert sol["J.omega"][-1] == 0.0


GOVERNED = {
    "pieces": sympy.Piecewise((5, sw.omega < 3), (1, True)),
    "sign": 3 - 2 * sympy.sign(sw.omega - 3),
    "step": 5 - 4 * sympy.Heaviside(sw.omega - 3),
}


@pytest.mark.parametrize("name", GOVERNED)
def test_a_jump_at_any_speed_onto_which_the_laws_drive_back_is_refused_at_once(name: str) -> None:
    """1 rad/s^2 per N m: the speed is 5 (1 - e^-t) up to 3, at ln 2.5 s, from where neither side lets it go."""
    net = sw.Network("governed")
    net.add(sw.TorqueSource("motor", tau=GOVERNED[name]), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.ViscousLoad("load", d=1.0), "a")
    said = "sticks where the condition" if available("heyoka") else "both sides of a jump drive the motion back"
    with pytest.raises(sw.SimulationError, match=rf"{said}.*smooth transition") as failed:
        net.simulate(3.0)
    # a series knows the instant; other engines go on for 2000 steps
    instant = float(str(failed.value).split("t = ")[1].split(" s")[0])
    assert instant == pytest.approx(math.log(2.5), rel=1e-9 if available("heyoka") else 1e-3)
