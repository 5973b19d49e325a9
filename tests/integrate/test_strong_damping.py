"""Torques of strong dampers: small differences of large parts, which no tolerance of the speeds may spoil."""

from __future__ import annotations

import warnings
from functools import lru_cache

import mpmath
import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import shaftwork as sw
from shaftwork.core.errors import AccuracyWarning
from shaftwork.integrate.engines import ENGINES, GENERAL, available
from shaftwork.integrate.stiffness import STABLE
from tests.properties.examples import share_of_examples

STIFFNESS, TORQUE, PERIODS = 1000.0, 10.0, 3.0
INSTALLED = tuple(name for name in GENERAL if available(name))
EXPLICIT = tuple(name for name in GENERAL if ENGINES[name].explicit)
# Of the largest torque, at rtol 1e-8: what adds up over thousands of steps on the edge of stability. CVODE, of order
# five, is itself at 4e-6 after some periods without damping.
BOUND = dict.fromkeys(INSTALLED, 1e-6) | {"sundials": 1e-5}


def two_inertias(ratio: float, heavy: float, *, beside: bool = False, load: float = 0.0) -> tuple[sw.Network, float]:
    """Inertias of 0.1 and 0.1 `heavy` kg m2 on a spring with a damping ratio, and the time of `PERIODS`."""
    first, second = 0.1, 0.1 * heavy
    frequency = np.sqrt(STIFFNESS * (1 / first + 1 / second))
    damping = 2 * ratio * STIFFNESS / frequency
    net = sw.Network("strong damping")
    net.add(sw.TorqueSource("motor", tau=TORQUE), "a")
    net.add(sw.Inertia("J1", J=first), "a")
    net.add(sw.Inertia("J2", J=second), "b")
    net.add(sw.Spring("spring", c=STIFFNESS, d=0.0 if beside else damping), "a", "b")
    if beside:
        net.add(sw.Damper("damper", d=damping), "a", "b")
    if load:
        net.add(sw.TorqueSource("fan", tau=-load * sw.omega**2), "b")
    return net, PERIODS * 2 * np.pi / frequency


def coupling_torque(ratio: float, heavy: float, times: np.ndarray) -> np.ndarray:
    """Of spring and damper after a step of torque: the two exponentials of the relative motion, to 50 digits."""
    with mpmath.workdps(50):
        first, second = mpmath.mpf(0.1), mpmath.mpf(0.1 * heavy)
        lightness = 1 / first + 1 / second
        damping = mpmath.mpf(float(2 * ratio * STIFFNESS / np.sqrt(STIFFNESS * (1 / 0.1 + 1 / (0.1 * heavy)))))
        root = mpmath.sqrt(mpmath.mpc((damping * lightness) ** 2 - 4 * lightness * STIFFNESS))
        slow, fast = ((-damping * lightness + sign * root) / 2 for sign in (1, -1))
        rest = TORQUE / first / (lightness * STIFFNESS)

        def torque(t: float) -> float:
            late, early = (mpmath.exp(value * mpmath.mpf(t)) for value in (slow, fast))
            twist = rest * (1 + (fast * late - slow * early) / (slow - fast))
            speed = rest * slow * fast * (late - early) / (slow - fast)
            return float((STIFFNESS * twist + damping * speed).real)

        return np.array([torque(float(t)) for t in times])


@pytest.mark.slow
@share_of_examples(0.05)  # an explicit engine takes a second
@given(
    exponent=st.floats(-3, 4),
    heavy=st.sampled_from([0.01, 0.5, 1.0, 30.0]),
    engine=st.sampled_from(INSTALLED),
    place=st.sampled_from(["inside", "beside"]),
)
def test_the_torque_of_a_coupling_is_right_however_strong_its_damping_is(
    exponent: float, heavy: float, engine: str, place: str
) -> None:
    # beyond it an explicit engine takes a minute; the ends of the range are in the test below
    ratio = 10.0 ** min(exponent, 2.5 if engine in EXPLICIT else 4.0)
    net, t_end = two_inertias(ratio, heavy, beside=place == "beside")
    run = net.simulate(t_end, engine=engine, t_eval=101)  # type: ignore[arg-type]
    found = run["spring.tau"] + (run["damper.tau"] if place == "beside" else 0.0)
    expected = coupling_torque(ratio, heavy, run.t)
    # At t = 0 the speeds are equal and the torque is zero, to the digit.
    assert np.abs(found - expected).max() < BOUND[engine] * np.abs(expected).max()


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:the engine .* is off by:shaftwork.AccuracyWarning")
@pytest.mark.parametrize("engine", INSTALLED)
@pytest.mark.parametrize("ratio", [1e-3, 1e4])
def test_the_ends_of_the_range_are_right_with_every_engine(engine: str, ratio: float) -> None:
    net, whole = two_inertias(ratio, 1.0)
    t_end = whole if ratio < 1 or engine not in EXPLICIT else 0.05 * whole
    run = net.simulate(t_end, engine=engine, t_eval=101)  # type: ignore[arg-type]
    expected = coupling_torque(ratio, 1.0, run.t)
    assert np.abs(run["spring.tau"] - expected).max() < BOUND[engine] * np.abs(expected).max()


# An explicit method would take ten million steps at the last ratio.
RATIOS = {name: (0.1, 100.0) if name in EXPLICIT else (0.1, 100.0, 1e6) for name in INSTALLED if name != "exact"}


@pytest.mark.slow
@pytest.mark.parametrize(("engine", "ratio"), [(name, ratio) for name, ratios in RATIOS.items() for ratio in ratios])
def test_a_nonlinear_load_behind_a_strong_damper_is_as_right(engine: str, ratio: float) -> None:
    """Against Radau in the mean speed, the twist and the torque of the damper as a state: there nothing cancels."""
    net, t_end = two_inertias(ratio, 1.0, load=0.05)
    run = net.simulate(t_end, engine=engine, t_eval=101)  # type: ignore[arg-type]
    damping = float(2 * ratio * STIFFNESS / np.sqrt(STIFFNESS * 20))

    def rates(_: float, x: np.ndarray) -> list[float]:
        mean, given, twist = x
        load = 0.05 * (mean - given / damping / 2) ** 2
        torque = STIFFNESS * twist + given
        return [(TORQUE - load) / 0.2, damping * ((TORQUE - torque) - (torque - load)) / 0.1, given / damping]

    options = {"rtol": 1e-11, "atol": [1e-12, 1e-10, 1e-15], "t_eval": run.t}
    found = solve_ivp(rates, (0.0, t_end), [0.0, 0.0, 0.0], method="Radau", **options).y
    expected = STIFFNESS * found[2] + found[1]
    assert np.abs(run["spring.tau"] - expected).max() < BOUND[engine] * np.abs(expected).max()


@lru_cache
def chain_end_torque(ratio: float, count: int, t_end: float, points: int) -> np.ndarray:
    """tau_b of a lumped shaft after a step, by the exponential of its matrix in 50 digits; see the test below."""
    inertias = [0.5 * 0.12 / count, *[0.12 / count] * (count - 1), 0.5 * 0.12 / count]
    ends = inertias[-1]
    inertias[0], inertias[-1] = inertias[0] + 0.01, inertias[-1] + 0.02
    n, stiffness = count + 1, 1200.0 * count
    with mpmath.workdps(50):
        whole = mpmath.zeros(n + count + 1)
        for k in range(count):
            for j, sign in ((k, 1), (k + 1, -1)):
                whole[n + k, j] += mpmath.mpf(stiffness) * sign
                whole[j, n + k] -= sign / mpmath.mpf(inertias[j])
                for i, other in ((k, 1), (k + 1, -1)):
                    whole[j, i] -= mpmath.mpf(ratio * stiffness) * sign * other / mpmath.mpf(inertias[j])
        whole[0, n + count] = TORQUE / mpmath.mpf(inertias[0])
        step = mpmath.expm(whole * (mpmath.mpf(t_end) / (points - 1)))
        state = mpmath.zeros(n + count + 1, 1)
        state[n + count] = 1
        found = [0.0]
        for _ in range(points - 1):
            state = step * state
            rate = (whole * state)[n - 1]
            found.append(float(rate * (inertias[-1] - ends)))
    return np.array(found)


@pytest.mark.slow
@pytest.mark.parametrize("engine", [name for name in ("auto", *INSTALLED) if name not in EXPLICIT])
@pytest.mark.parametrize("ratio", [1e-2, 1.0])
def test_a_long_shaft_with_strong_damping_is_right_at_its_end(engine: str, ratio: float) -> None:
    """A shaft of 0.12 kg m2 and 1200 N m/rad, D' = ratio C', between inertias of 0.01 and 0.02 kg m2."""
    area = np.pi * 0.02**4 / 32
    moduli = {"density": 0.12 / area, "shear_modulus": 1200.0 / area, "damping": ratio * 1200.0}
    net = sw.Network("line")
    net.add(sw.TorqueSource("motor", tau=TORQUE), "a")
    net.add(sw.Inertia("J1", J=0.01), "a")
    net.add(sw.Shaft("line", length=1.0, diameter=0.02, model="Lumped(10)", **moduli), "a", "b")
    net.add(sw.Inertia("J2", J=0.02), "b")
    run = net.simulate(0.2, engine=engine, t_eval=21)  # type: ignore[arg-type]
    expected = chain_end_torque(ratio, 10, 0.2, 21)
    # three orders above rtol for the stiff starts of CVODE
    assert run["line.tau_b"] == pytest.approx(expected, abs=1e-5 * np.abs(expected).max())


@pytest.mark.parametrize("ratio", [1e6, 1e8])
def test_a_run_says_where_the_rounding_of_speeds_spoils_torques(ratio: float) -> None:
    """Free inertias that gather speed as long as the spring takes to twist, d / c: eps d omega is a torque then."""
    net, _ = two_inertias(ratio, 1.0)
    t_end = 3 * 2 * ratio / np.sqrt(STIFFNESS * 20)
    with pytest.warns(AccuracyWarning, match="strong damping: .*rounding.*rigid"):
        run = net.simulate(t_end, t_eval=101)
    error = np.abs(run["spring.tau"] - coupling_torque(ratio, 1.0, run.t)).max() / TORQUE
    assert error > 1e-4  # what is said is so


@pytest.mark.parametrize("engine", ["exact", "scipy-radau", "banded"])
@pytest.mark.parametrize("ratio", [1.0, 1e4])
def test_nothing_is_said_where_torques_are_right(engine: str, ratio: float) -> None:
    net, t_end = two_inertias(ratio, 1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        net.simulate(t_end, engine=engine)  # type: ignore[arg-type]


@pytest.mark.parametrize("engine", [name for name in ("scipy", "numba") if name in INSTALLED])
def test_steps_are_as_long_as_is_stable(engine: str) -> None:
    net = sw.Network("brake")
    net.add(sw.TorqueSource("motor", tau=TORQUE), "a")
    net.add(sw.Inertia("J1", J=0.1), "a")
    net.add(sw.Damper("brake", d=10.0), "a")
    run = net.simulate(10.0, engine=engine)  # type: ignore[arg-type]
    decay = 10.0 / 0.1
    assert 1.0 <= run.statistics["steps"] / (10.0 * decay / STABLE) < 1.2


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [0.5, 30.0, 1000.0])
@pytest.mark.parametrize("engine", EXPLICIT)
def test_beside_a_part_with_modes_it_is_as_right(engine: str, ratio: float) -> None:
    """A gap that never closes makes phases of the motion, and changes nothing else."""
    net, t_end = two_inertias(ratio, 1.0)
    net.add(sw.Backlash("gap", gap=1e6, c=1.0, d=1.0), "b", "c")
    net.add(sw.Inertia("J3", J=1.0), "c")
    times = np.linspace(0.0, t_end, 50)[1:]
    found, wanted = net.simulate(t_end, engine=engine).at(times)["spring.tau"], coupling_torque(ratio, 1.0, times)
    np.testing.assert_allclose(found, wanted, rtol=0, atol=BOUND[engine] * np.abs(wanted).max())


@pytest.mark.slow
def test_a_phase_is_made_twice_only_where_stability_bounds_its_steps() -> None:
    """Flanks that strike each other again and again: every oscillation has many steps of its own."""
    net = sw.Network("rattle")
    net.add(sw.TorqueSource("motor", tau=TORQUE * sympy.sin(30 * sw.t)), "a")
    net.add(sw.Inertia("J1", J=0.1), "a")
    net.add(sw.Backlash("gap", gap=0.02, c=STIFFNESS, d=0.5), "a", "b")
    net.add(sw.Inertia("J2", J=0.1), "b")
    run = net.simulate(1.0, engine="scipy")
    assert len(run.events) > 10
    assert run.statistics["steps"] == len(run.steps) - 1


@pytest.mark.parametrize("engine", ["auto", "exact", "scipy", "heyoka", "sundials", "scipy-radau", "banded"])
@pytest.mark.parametrize("held", [False, True])
@pytest.mark.parametrize("d", [0.0, 100.0])
def test_a_train_that_idles_is_not_said_to_be_wrong_by_parts_of_nothing(engine: str, held: bool, d: float) -> None:  # noqa: FBT001
    """All turns at one speed, and no torque passes: no part of the largest torque is an error."""
    net = sw.Network("idle")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Spring("shaft", c=1e4, d=d), "a", "b")
    net.add(sw.Inertia("J2", J=2.0), "b")
    if held:
        net.add(sw.SpeedSource("line", omega=10.0), "z")
        net.add(sw.Spring("coupling", c=1e4, d=d), "z", "a")
    sol = net.simulate(1.0, initial={"J1.omega": 10.0, "J2.omega": 10.0}, engine=engine)  # a warning would be an error
    assert np.abs(sol["shaft.tau"]).max() < 1e-12
