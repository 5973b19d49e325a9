"""Load cycles and life: counting against the standard, peaks against closed forms, damage against its laws."""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

import shaftwork as sw
from shaftwork.results.course import turning_points
from shaftwork.results.fatigue import Rainflow, damage, rainflow

LINE = sw.SNLine(amplitude=100.0, cycles=1e6, slope=5.0)


def counted(values: Sequence[float], t: Sequence[float] | None = None, smallest: float = 0.0) -> Rainflow:
    """Cycles of a history of straight lines between values, one second apart."""
    times = np.arange(len(values), dtype=float) if t is None else np.asarray(t)
    given_values = np.asarray(values, dtype=float)
    return rainflow(
        lambda at: np.interp(at, times, given_values), times, title="history", name="x", unit="N*m", smallest=smallest
    )


def driven(tau: Any, t_end: float, **options: Any) -> sw.Solution:
    """A torque on an inertia."""
    net = sw.Network("driven")
    net.add(sw.TorqueSource("motor", tau=tau), "rotor")
    net.add(sw.Inertia("J", J=2.0), "rotor")
    return net.simulate(t_end=t_end, **options)


ASTM = (-2.0, 1.0, -3.0, 5.0, -1.0, 3.0, -4.0, 4.0, -2.0)
ASTM_CYCLES = [
    (3.0, -0.5, 0.5, 0, 1),
    (4.0, -1.0, 0.5, 1, 2),
    (8.0, 1.0, 0.5, 2, 3),
    (9.0, 0.5, 0.5, 3, 6),
    (4.0, 1.0, 1.0, 4, 5),
    (8.0, 0.0, 0.5, 6, 7),
    (6.0, 1.0, 0.5, 7, 8),
]
"""ASTM E1049, figure 6, A to I: range, mean, count, and which two of its points."""


def test_the_example_of_the_standard_is_counted_as_it_says() -> None:
    found = counted(ASTM)
    assert list(zip(found.range, found.mean, found.count, found.start, found.end, strict=True)) == ASTM_CYCLES
    assert found.amplitude.tolist() == [0.5 * row[0] for row in ASTM_CYCLES]


def test_the_example_of_the_standard_is_counted_alike_in_a_motion_of_two_output_times() -> None:
    sol = driven(sw.Table([0.1 * k for k in range(9)], list(ASTM)), 0.8, t_eval=2)
    found = sol.rainflow("motor.tau")
    table = np.array([found.range, found.mean, found.count, 10.0 * found.start, 10.0 * found.end]).T
    np.testing.assert_allclose(table, ASTM_CYCLES, atol=1e-12)


@pytest.mark.parametrize(
    ("values", "cycles"),
    [
        ((0.0, 3.0), [(3.0, 0.5)]),  # a single ramp
        ((0.0, 3.0, 0.0), [(3.0, 0.5), (3.0, 0.5)]),
        ((0.0, 4.0, 1.0, 2.0, 0.0), [(4.0, 0.5), (4.0, 0.5), (1.0, 1.0)]),
        ((1.0, 1.0, 1.0), []),
        ((0.0, 2.0, 2.0, 5.0), [(5.0, 0.5)]),  # a rest on the way is no turning point
    ],
)
def test_a_history_is_counted_as_by_hand(values: tuple[float, ...], cycles: list[tuple[float, float]]) -> None:
    found = counted(values)
    assert sorted(zip(found.range, found.count, strict=True)) == sorted(cycles)


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["heyoka", "scipy", "sundials"])
def test_the_cycles_of_a_sine_are_those_of_the_closed_form(engine: str) -> None:
    """10 s of 100 + 50 sin at 5 Hz: up from the mean, 99 half cycles from peak to valley, back to the mean."""
    sol = driven(100 + 50 * sympy.sin(2 * sympy.pi * 5 * sw.t), 10.0, engine=engine, t_eval=3)
    found = sol.rainflow("motor.tau")
    full = found.range > 75.0
    # a peak is found to the square of an eighth of a panel to the fourth: only rounding is left
    np.testing.assert_allclose(found.range[full], 100.0, rtol=1e-13)
    np.testing.assert_allclose(found.mean[full], 100.0, rtol=1e-13)
    np.testing.assert_allclose(found.range[~full], 50.0, rtol=1e-12)
    assert found.count[full].sum() == 49.5
    assert found.count[~full].sum() == 1.0
    quarters = 20.0 * found.turning.t[1:-1]
    np.testing.assert_allclose(quarters, np.round(quarters), atol=1e-5)
    worn = sol.damage("motor.tau", sn=sw.SNLine(amplitude=50.0, cycles=1e6, slope=4.0))
    assert worn.damage == pytest.approx((49.5 + 1.0 / 16.0) / 1e6, rel=1e-12)
    assert worn.repetitions == pytest.approx(1.0 / worn.damage)
    assert worn.hours == pytest.approx(10.0 / 3600.0 / worn.damage)
    assert found.equivalent(4.0, cycles=49.5 + 1.0 / 16.0) == pytest.approx(50.0, rel=1e-12)
    assert found.equivalent(1.0, cycles=50.0) == pytest.approx((49.5 * 50.0 + 25.0) / 50.0, rel=1e-12)


def test_the_peak_of_a_decaying_oscillation_is_the_closed_form_between_output_times() -> None:
    """A mass on a damped spring after a torque step: the overshoot is 1 + exp(-pi D / sqrt(1 - D^2))."""
    net = sw.Network("step")
    net.add(sw.TorqueSource("motor", tau=30.0), "rotor")
    net.add(sw.Inertia("J", J=2.0), "rotor")
    net.add(sw.Spring("shaft", c=800.0, d=4.0), "rotor", "ground")
    sol = net.simulate(t_end=20.0, t_eval=5, rtol=1e-12)
    damping = 4.0 / (2.0 * math.sqrt(2.0 * 800.0))
    top = 30.0 * (1.0 + math.exp(-math.pi * damping / math.sqrt(1.0 - damping**2)))
    found = sol.rainflow("shaft.tau_c")
    assert found.turning.values.max() == pytest.approx(top, rel=1e-10)
    swings = np.abs(np.diff(found.turning.values))[1:40]
    np.testing.assert_allclose(
        swings[1:] / swings[:-1], math.exp(-math.pi * damping / math.sqrt(1.0 - damping**2)), rtol=1e-7
    )


def test_both_sides_of_a_jump_are_turning_points() -> None:
    ramp = sympy.Piecewise((10 * sw.t, sw.t < 1), (10 * sw.t - 25, True))
    turning = driven(ramp, 2.0, t_eval=2).rainflow("motor.tau").turning
    np.testing.assert_allclose(turning.values, [0.0, 10.0, -15.0, -5.0], atol=1e-12)


@pytest.mark.slow
def test_twenty_seconds_of_noise_are_counted_as_their_values() -> None:
    from rainflow import extract_cycles  # type: ignore[import-untyped]

    values = np.random.default_rng(4).normal(22.4, 10.0, 401)
    sol = driven(sw.Table(np.arange(401) * 0.05, values), 20.0, t_eval=2)
    found = sol.rainflow("motor.tau", smallest=0.0)
    wanted = sorted(cycle[:3] for cycle in extract_cycles(values.tolist()))
    kept = found.range > 1e-9  # rounding on a straight line may turn too
    np.testing.assert_allclose(
        sorted(zip(*np.array([found.range, found.mean, found.count])[:, kept], strict=True)), wanted, rtol=1e-9
    )
    assert found.count.sum() > 100


def test_noise_of_a_solver_is_no_load() -> None:
    values = 5.0 + 1e-9 * np.random.default_rng(0).normal(size=200)
    values[100] = 6.0
    assert len(counted(values, smallest=1e-6)) == 2
    assert len(counted(values, smallest=0.0)) > 50


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["scipy", "sundials"])
def test_contacts_that_let_go_at_zero_make_the_same_cycles_in_every_engine(engine: str) -> None:
    """A gap lets go at a torque of zero, but for rounding: which cycle closes there must not hang on its sign."""
    net = sw.Network("rattle")
    net.add(sw.TorqueSource("motor", tau=20 * sympy.sin(9 * sw.t) + 3), "a")
    net.add(sw.Inertia("J1", J=0.5), "a")
    net.add(sw.Backlash("gap", gap=0.02, c=900.0, d=0.5), "a", "b")
    net.add(sw.Inertia("J2", J=1.0), "b")
    net.add(sw.TorqueSource("load", tau=-2.0 * sw.omega), "b")
    counted_by = [net.simulate(t_end=5.0, rtol=1e-10, engine=name).rainflow("gap.tau") for name in ("heyoka", engine)]
    one, other = counted_by
    assert len(one) > 20
    assert one.count.tolist() == other.count.tolist()
    np.testing.assert_allclose(one.range, other.range, atol=1e-6)
    np.testing.assert_allclose(one.start, other.start, atol=1e-5)


histories = st.lists(st.integers(-50, 50), min_size=2, max_size=40)


@pytest.mark.slow
@given(histories, st.sampled_from([-3.0, -1.0, 0.5, 2.0]))
def test_damage_scales_with_the_power_of_the_load(values: list[int], factor: float) -> None:
    one, other = damage(counted(values), LINE), damage(counted([factor * value for value in values]), LINE)
    assert other.damage == pytest.approx(abs(factor) ** 5 * one.damage, rel=1e-9)
    assert other.cycles.count.sum() == one.cycles.count.sum()


@pytest.mark.slow
@given(histories)
def test_a_history_from_peak_to_peak_does_twice_the_damage_when_it_is_repeated(values: list[int]) -> None:
    top = int(np.argmax(values))
    once = [*values[top:], *values[:top], values[top]]
    twice = [*once, *once[1:]]
    assert damage(counted(twice), LINE).damage == pytest.approx(2.0 * damage(counted(once), LINE).damage, rel=1e-9)


@given(histories)
def test_damage_lies_between_that_of_the_largest_swing_and_of_so_many(values: list[int]) -> None:
    found = counted(values)
    done = damage(found, LINE).damage
    largest = 0.5 / LINE.borne(0.5 * float(np.ptp(values)))
    assert done >= largest * (1 - 1e-12)
    assert done <= largest * 2.0 * max(found.count.sum(), 0.5) * (1 + 1e-12)


@pytest.mark.slow
@given(histories, st.floats(0.1, 10.0))
def test_only_the_order_of_values_counts_not_their_times(values: list[int], pace: float) -> None:
    slow = counted(values, t=[pace * k for k in range(len(values))])
    fast = counted(values)
    np.testing.assert_allclose(slow.range, fast.range, rtol=1e-12)
    np.testing.assert_allclose(slow.start, pace * fast.start, rtol=1e-9)


def test_an_sn_line_has_its_knee_limit_and_mean_where_it_says() -> None:
    line = sw.SNLine(amplitude=100.0, cycles=2e6, slope=5.0, slope_below=9.0, limit=40.0, ultimate=500.0)
    assert line.borne(100.0) == 2e6
    assert line.borne(200.0) == pytest.approx(2e6 / 2**5)
    assert line.borne(50.0) == pytest.approx(2e6 * 2**9)
    assert np.isinf(line.borne([40.0, 0.0])).all()
    assert line.borne(80.0, 100.0) == pytest.approx(2e6)  # 80 / (1 - 100/500)
    assert line.borne(80.0, -100.0) == line.borne(80.0, 100.0)
    assert line.borne([250.0, 1.0], [250.0, 600.0]).tolist() == [0.0, 0.0]
    assert math.isinf(damage(counted([0.0, 1000.0]), line).damage)


@pytest.mark.parametrize(
    "wrong", [{"amplitude": 0.0}, {"cycles": -1.0}, {"slope": "x"}, {"limit": -1.0}, {"limit": 9.0, "ultimate": 5.0}]
)
def test_an_impossible_sn_line_is_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(sw.ParameterError, match=next(iter(wrong))):
        sw.SNLine(**({"amplitude": 100.0, "cycles": 1e6, "slope": 5.0} | wrong))


def test_the_matrix_and_the_spectrum_hold_every_cycle() -> None:
    found = counted(np.random.default_rng(1).normal(size=300).tolist())
    for bins in (8, (5, 12)):
        counts, ranges, means = found.matrix(bins)
        assert counts.sum() == pytest.approx(found.count.sum())
        assert counts.shape == (len(ranges) - 1, len(means) - 1)
    size, number = found.spectrum()
    assert (np.diff(size) <= 0).all()
    assert number[-1] == found.count.sum()
    with pytest.raises(sw.ParameterError, match="bins = 0"):
        found.matrix(0)
    assert counted([1.0, 1.0]).matrix(3)[0].sum() == 0.0
    assert counted([1.0, 1.0]).equivalent(5.0) == 0.0
    left, right, _ = found.plot().axes
    assert (left.get_ylabel(), right.get_xlabel()) == ("range in N m", "cycles")
    head, _, *rows, rest = str(found).splitlines()
    assert head.startswith(f"x in 'history': {found.count.sum():g} cycles in 299 s")
    assert rest == f"and {len(found) - len(rows)} smaller"


@pytest.fixture(scope="module")
def line() -> sw.Solution:
    net = sw.Network("line")
    net.add(sw.TorqueSource("motor", tau=sw.Step(25.0, start=0.01)), "a")
    net.add(sw.Inertia("Je", J=0.025), "a")
    net.add(
        sw.Shaft("line", length=1.0, diameter=0.02, density=7900.0, shear_modulus=77.5e9, model=sw.Lumped(4)), "a", "b"
    )
    net.add(sw.Inertia("J1", J=0.05), "b")
    net.add(sw.Spring("coupling", c=3000.0, d=1.0), "b", "c")
    net.add(sw.Inertia("J2", J=0.1), "c")
    return net.simulate(t_end=0.5)


@pytest.mark.slow
def test_every_shaft_and_spring_is_judged_a_long_one_at_its_worst_place(line: sw.Solution) -> None:
    found = line.damage(sn=LINE)
    assert list(found) == ["coupling.tau", "line.tau"]
    places = [damage(line.rainflow("line.tau", place=k), LINE).damage for k in range(len(line.places["line.tau"]))]
    assert found["line.tau"].damage == max(places)
    assert line.damage("coupling.tau", sn=LINE).damage == found["coupling.tau"].damage
    own = line.damage(sn={"coupling.tau": sw.SNLine(amplitude=200.0, cycles=1e6, slope=5.0), "line.tau_a": LINE})
    assert own["coupling.tau"].damage == pytest.approx(found["coupling.tau"].damage / 32.0)
    assert "repetitions" in str(found["line.tau"])
    assert "endless" in str(line.damage("coupling.tau", sn=sw.SNLine(amplitude=1.0, cycles=1.0, slope=3.0, limit=1e6)))


def test_what_cannot_be_counted_is_answered_with_what_can(line: sw.Solution) -> None:
    with pytest.raises(sw.SignalError, match=r"'line\.tau' is read at \d+ places along the part; say which by place=0"):
        line.rainflow("line.tau")
    with pytest.raises(sw.SignalError, match=r"Leave out place=2"):
        line.rainflow("coupling.tau", place=2)
    with pytest.raises(sw.SignalError, match=r"'coupling' has: .*coupling\.tau"):
        line.rainflow("coupling.torque")
    with pytest.raises(sw.SignalError, match="is no name of a quantity"):
        line.rainflow(["coupling.tau"])  # type: ignore[arg-type]
    with pytest.raises(sw.ParameterError, match="must be an S-N line"):
        line.damage("coupling.tau", sn=5.0)  # type: ignore[call-overload]
    with pytest.raises(sw.ParameterError, match="smallest = 2"):
        line.rainflow("coupling.tau", smallest=2.0)
    with pytest.raises(sw.SignalError, match="no shaft or spring in 'driven'"):
        driven(1.0, 1.0).damage(sn=LINE)


def test_the_extra_that_brings_counting_is_named(line: sw.Solution, monkeypatch: pytest.MonkeyPatch) -> None:
    found = line.rainflow("coupling.tau")
    for library in ("rainflow", "matplotlib.figure", "matplotlib.colors"):
        monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(sw.MissingExtraError, match=r"Solution\.rainflow\(\) needs rainflow.*shaftwork\[life\]"):
        line.rainflow("coupling.tau")
    with pytest.raises(sw.MissingExtraError, match=r"Rainflow\.plot\(\) needs matplotlib.*shaftwork\[plot\]"):
        found.plot()


def test_turning_points_are_found_however_long_the_steps_are() -> None:
    """57 periods in two steps; the slope at a turning point is 0 to the width of its last bracket."""
    turning = turning_points(lambda t: np.sin(2 * np.pi * 5.7 * t) + 0.1 * t, np.array([0.0, 3.0, 10.0]), smallest=1e-6)
    slopes = 2 * np.pi * 5.7 * np.cos(2 * np.pi * 5.7 * turning.t) + 0.1
    assert len(turning.t) == 114 + 2
    assert np.abs(slopes[1:-1]).max() < 1e-3
