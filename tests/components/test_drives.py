"""Induction motors at a frequency that changes: torque at a held frequency, starts by a ramp, printed curves."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
import sympy
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import shaftwork as sw
from shaftwork.components import Component

PER_MINUTE = 2 * math.pi / 60
MOTOR: dict[str, float] = {"tau_k": 8.0, "s_k": 0.3, "n_sync": 3000.0}
PULL_OUT_LAG = 0.3 * 3000.0  # 1/min
ENGINES = ("scipy", "numba", "heyoka", "sundials")


def torque(motor: Component, speeds: Any, time: float = 0.0) -> NDArray[np.float64]:
    """Torque at speeds in 1/min: the rate of an inertia of 1 kg m^2."""
    model = with_inertia(motor, 1.0)
    return np.array([model.rhs(time, np.array([n * PER_MINUTE]))[0] for n in np.atleast_1d(speeds)])


def with_inertia(motor: Component, inertia: float) -> sw.Model:
    net = sw.Network("drive")
    net.add(motor, "shaft")
    net.add(sw.Inertia("J", J=inertia), "shaft")
    return net.compile()


@pytest.mark.parametrize("f", [5.0, 25.0, 50.0, 80.0, -25.0])
def test_a_held_frequency_moves_kloss_curve_along_the_speed(f: float) -> None:
    """The pull-out torque is kept up to the rated frequency and falls as 1/f^2 above it; its lag is kept throughout."""
    drive = sw.FrequencyDrive("m", **MOTOR, f=f)
    field, most = 3000.0 * f / 50.0, 8.0 * min(1.0, 50.0 / abs(f)) ** 2
    lags = np.array([-2.0, -1.0, 0.0, 0.5, 1.0, 3.0])
    wanted = most * 2 * lags / (lags**2 + 1)
    np.testing.assert_allclose(torque(drive, field - lags * PULL_OUT_LAG), wanted, rtol=1e-12, atol=1e-12)


def test_at_the_rated_frequency_it_is_the_motor_on_the_mains() -> None:
    speeds = np.linspace(-3000.0, 6000.0, 37)
    mains = torque(sw.KlossMotor("m", **MOTOR, ratio=2.0, efficiency=0.9), speeds)
    drive = torque(sw.FrequencyDrive("m", **MOTOR, f=50.0, ratio=2.0, efficiency=0.9), speeds)
    np.testing.assert_allclose(drive, mains, rtol=1e-12, atol=1e-12)  # at the synchronous speed rounding is all of it


@pytest.mark.parametrize("f", [10.0, 80.0])
def test_as_printed_the_pull_out_slip_is_kept_and_the_pull_out_torque_falls_with_its_speed(f: float) -> None:
    """(f_n / f)^2 = (n_k / n)^2 of (3b) holds at the pull-out points if their slip is the same at each frequency."""
    drive = sw.FrequencyDrive("m", **MOTOR, f=f, slip_exponent=1.0)
    n_k = 3000.0 * (1 - 0.3)
    n = n_k * f / 50.0
    wanted = 8.0 if f < 50.0 else 8.0 * (n_k / n) ** 2
    assert torque(drive, n) == pytest.approx(wanted, rel=1e-12)
    assert (torque(drive, [0.99 * n, 1.01 * n]) < wanted).all()


@pytest.mark.slow
@pytest.mark.parametrize("f", [2.5, 15.0, 50.0])
def test_below_s_k_f_n_standstill_has_a_share_of_the_pull_out_torque_that_a_boost_makes_up_for(f: float) -> None:
    """Pull-out lies where the motor lags by s_k n_sync behind its field, below 15 Hz at a negative speed."""
    x = f / (MOTOR["s_k"] * 50.0)
    share = 2 * x / (1 + x**2)
    (plain,) = torque(sw.FrequencyDrive("m", **MOTOR, f=f), [0.0])
    assert plain == pytest.approx(share * MOTOR["tau_k"], rel=1e-12)
    boost = (share**-0.5 - 1) / (1 - f / 100.0)
    (boosted,) = torque(sw.FrequencyDrive("m", **MOTOR, f=f, boost=boost, f_boost=100.0), [0.0])
    assert boosted == pytest.approx(MOTOR["tau_k"], rel=1e-12)
    told = " ".join((sw.FrequencyDrive.__doc__ or "").split())
    assert "at standstill the motor has 2 x / (1 + x^2) of tau_k flux^2, with x = f / (s_k f_n)" in told


def held_by_a_load(**options: Any) -> sw.Network:
    """The drive, a gear of 5 behind a shaft, and a hoist that rests up to 2.18 N m at the motor."""
    net = sw.Network("start")
    net.add(sw.FrequencyDrive("motor", **(MOTOR | options)), "rotor")
    net.add(sw.Inertia("J1", J=0.01), "rotor")
    net.add(sw.Spring("shaft", c=100.0, d=0.5), "rotor", "middle")
    net.add(sw.Gear("gear", ratio=5.0), "middle", "wheel")
    net.add(sw.Inertia("J2", J=0.1), "wheel")
    net.add(sw.Hoist("hoist", m=10.0, radius=0.1, efficiency=0.9), "wheel")
    return net


def test_a_check_notes_a_start_below_the_pull_out_torque_with_the_load_and_what_helps() -> None:
    """2 x / (1 + x^2) of 8 N m with x = 2.5 / 15. The hoist rests up to 10 g 0.1 / 0.9, a fifth of it at the motor."""
    net = held_by_a_load()
    (note,) = net.check()
    assert (note.severity, note.parts, note.nodes) == ("note", ("motor",), ("rotor",))
    assert str(note) == (
        "weak start: FrequencyDrive 'motor' at node 'rotor' has 2.595 N*m at standstill at 2.5 Hz, of a pull-out "
        "torque of 8 N*m, against 2.18 N*m of Hoist 'hoist'. Give f_0 = 15 Hz, or boost = 1.01, for a start with all "
        "of it."
    )
    (held,) = held_by_a_load(f=sw.Table([0.0, 1.0], [2.0, 2.0])).check()
    assert "2.18 N*m of Hoist 'hoist', which it does not move. Give a frequency that begins at 15 Hz, or" in str(held)


@pytest.mark.parametrize(
    "options",
    [{"f_0": 15.0}, {"boost": 1.01}, {"f": 15.0}, {"slip_exponent": 1.0}, {"s_k": 1.2}, {"f": 10.0 + sw.omega}],
    ids=str,
)
def test_a_check_has_nothing_to_note_of_a_start_with_what_helps_or_of_another_motor(options: dict[str, Any]) -> None:
    assert held_by_a_load(**options).check() == ()


@pytest.mark.slow
@pytest.mark.parametrize(("frequency", "moves"), [(2.0, False), (2.5, True)])
def test_a_load_that_the_note_says_is_not_moved_rests(frequency: float, moves: bool) -> None:  # noqa: FBT001
    net = held_by_a_load(f=frequency)
    (note,) = net.check()
    assert ("does not move" not in str(note)) is moves
    sol = net.simulate(0.5, t_eval=51, initial={"shaft.tau": 2.0})
    assert bool(sol["J2.omega"][-1] > 0) is moves


@pytest.mark.slow
def test_a_boost_raises_the_flux_at_low_frequency_alone() -> None:
    """Torque goes with the square of the flux: 1.2^2 at standstill, 1.1^2 in the middle, 1 from f_boost on."""
    for f, flux in ((0.0, 1.2), (5.0, 1.1), (10.0, 1.0), (30.0, 1.0)):
        drive = sw.FrequencyDrive("m", **MOTOR, f=f, boost=0.2, f_boost=10.0)
        assert torque(drive, 60.0 * f - PULL_OUT_LAG) == pytest.approx(8.0 * flux**2, rel=1e-12)


def test_a_start_by_a_ramp_follows_the_field_with_the_lag_that_its_torque_needs() -> None:
    """With J d(omega)/dt constant the lag D solves 2 tau_k D D_k / (D^2 + D_k^2) = J alpha: D/D_k = (1 - w) / u,
    w = sqrt(1 - u^2), u = J alpha / tau_k. What is left of the start decays with a time constant below 0.2 s.
    """
    drive = sw.FrequencyDrive("m", **MOTOR, t_ramp=5.0)
    inertia, slope = 0.05, 3000.0 * PER_MINUTE * 47.5 / 50.0 / 5.0
    u = inertia * slope / 8.0
    lag = PULL_OUT_LAG * PER_MINUTE * (1 - math.sqrt(1 - u**2)) / u
    sol = with_inertia(drive, inertia).simulate(4.5, rtol=1e-10, t_eval=np.array([4.0, 4.5]))
    field = 3000.0 * PER_MINUTE * (2.5 + 47.5 * sol.t / 5.0) / 50.0
    np.testing.assert_allclose(field - sol["J.omega"], lag, rtol=1e-6)  # 100 rtol of the speed, which is 90 lags


@pytest.mark.slow
@pytest.mark.parametrize(
    "options",
    [
        {"t_ramp": 2.0},
        {"t_ramp": 2.0, "f_end": 90.0, "t_on": 0.5, "t_off": 3.0},
        {"f": sw.Table([0.0, 1.0, 2.0, 3.5], [2.5, 70.0, 70.0, 0.0]), "boost": 0.3},
    ],
    ids=["ramp", "overspeed", "table"],
)
def test_a_drive_runs_as_its_equations_by_hand_with_every_engine(options: dict[str, Any]) -> None:
    """By hand: numpy's interpolation for the frequency, run from kink to kink. 1e-7 of the largest value."""
    points = options.get("f")
    start, end = options.get("t_on", 0.0), options.get("t_off", math.inf)
    xs, ys = (points.xs, points.ys) if points else ((start, start + 2.0), (2.5, options.get("f_end", 50.0)))
    synchronous = 3000.0 * PER_MINUTE

    def rate(t: float, x: NDArray[np.float64]) -> list[float]:
        f = float(np.interp(t, xs, ys))
        flux = (1 + options.get("boost", 0.0) * max(0.0, 1 - f / 10.0)) * min(1.0, 50.0 / max(f, 1e-9))
        lag, most = synchronous * f / 50.0 - x[0], synchronous * 0.3
        driven = 2 * 8.0 * flux**2 * lag * most / (lag**2 + most**2) if start <= t < end else 0.0
        return [(driven - 0.002 * x[0]) / 0.02]

    # kinks of the frequency, of the flux where the frequency passes 50 and 10 Hz, and the switching times
    crossings = [np.interp(level, ys[:2], xs[:2]) for level in (10.0, 50.0)]
    falling = [np.interp(-level, [-y for y in ys[-2:]], xs[-2:]) for level in (10.0, 50.0)] if points else []
    kinks = sorted({time for time in (*xs, *crossings, *falling, start, end) if 0.0 < time < 4.0})
    x, wanted = np.array([0.0]), []
    for left, right in zip([0.0, *kinks], [*kinks, 4.0], strict=True):
        inside = math.nextafter(left, right), math.nextafter(right, left)
        x = solve_ivp(rate, inside, x, "DOP853", rtol=1e-11, atol=1e-10).y[:, -1]
        wanted.append(x[0])
    net = sw.Network("drive")
    net.add(sw.FrequencyDrive("m", **MOTOR, **options), "shaft")
    net.add(sw.Inertia("J", J=0.02), "shaft")
    net.add(sw.ViscousLoad("fan", d=0.002), "shaft")
    model = net.compile()
    for engine in ENGINES:
        sol = model.simulate(4.0, rtol=1e-10, t_eval=np.array([*kinks, 4.0]), engine=engine)
        np.testing.assert_allclose(sol["J.omega"], wanted, atol=1e-7 * max(wanted))


def test_a_frequency_that_falls_brakes_and_gives_power_back() -> None:
    drive = sw.FrequencyDrive("m", **MOTOR, f=sw.Table([0.0, 1.0], [50.0, 10.0]))
    sol = with_inertia(drive, 0.02).simulate(1.0, t_eval=9, initial={"J.omega": 3000.0 * PER_MINUTE})
    assert (sol["m.tau"][1:] < 0).all()
    assert (sol["m.power"][1:] > 0).all()


def test_a_drive_at_its_pull_out_point_holds_the_torque_and_goes_over_into_kloss() -> None:
    """Curve 1 of figure 6."""
    held = sw.PullOutDrive("m", **MOTOR)
    assert torque(held, [-500.0, 0.0, 1000.0, 2100.0]) == pytest.approx([8.0] * 4, rel=1e-12)
    above = np.array([2100.0, 2500.0, 2900.0, 3000.0, 3300.0])
    np.testing.assert_allclose(torque(held, above), torque(sw.KlossMotor("m", **MOTOR), above), atol=1e-12)


@pytest.mark.slow
def test_with_overspeed_it_goes_through_the_pull_out_points_of_the_printed_drive() -> None:
    """Curve 2 of figure 6, to 100 Hz; from there on it is the drive at 100 Hz."""
    held = sw.PullOutDrive("m", **MOTOR, overspeed=2.0)
    for f in (50.0, 60.0, 80.0, 100.0):
        drive = sw.FrequencyDrive("m", **MOTOR, f=f, slip_exponent=1.0)
        point = 3000.0 * (1 - 0.3) * f / 50.0
        assert torque(held, point) == pytest.approx(torque(drive, point), rel=1e-12)
    above = np.array([4200.0, 5000.0, 6000.0, 7000.0])
    np.testing.assert_allclose(torque(held, above), torque(drive, above), atol=1e-12)
    with pytest.raises(sw.ParameterError, match=r"s_k = 1\.2 must be below 1"):
        sw.PullOutDrive("m", tau_k=8.0, s_k=1.2, n_sync=3000.0)


@pytest.mark.slow
def test_a_frequency_may_be_any_law_of_time() -> None:
    drive = sw.FrequencyDrive("m", **MOTOR, f=30.0 + 5.0 * sympy.sin(sw.t))
    assert torque(drive, 60.0 * (30.0 + 5.0 * math.sin(0.4)), time=0.4) == pytest.approx(0.0, abs=1e-12)
