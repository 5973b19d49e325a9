"""Seeded noise: the same numbers whoever asks, and as many of each size as asked.

Statistical bounds are set for a false alarm of one in a million, were the seeds drawn anew; the seeds here are fixed,
so that a test that passes once passes always.
"""

from __future__ import annotations

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from statistics import NormalDist

import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.components import noise
from shaftwork.components.discontinuities import breakpoints, pieces_degree
from shaftwork.components.law_slopes import slope

FALSE_ALARM = 1e-6
SIGMAS = NormalDist().inv_cdf(1 - FALSE_ALARM / 2)
PLACES = np.concatenate([np.linspace(-3.0, 3.0, 601), [-1e9 - 0.5, 2.0**40, 1e15 + 0.5]])


def test_the_generator_is_splitmix64() -> None:
    """Its first numbers of the state 1234567, as its authors' program prints them."""
    words = [noise._split_mix(1234567, k) for k in range(1, 6)]
    known = [6457827717110365317, 3203168211198807973, 9817491932198370423, 4593380528125082431, 16408922859458223821]
    assert words == known


@pytest.mark.parametrize("function", [noise.held, noise.smooth])
def test_numbers_and_arrays_in_any_order_give_the_same_bits(function) -> None:
    values = function(PLACES, 3.0)
    assert values.tolist() == [function(place, 3) for place in PLACES.tolist()]
    assert values.tolist() == function(PLACES[::-1], 3.0)[::-1].tolist()
    seeds = np.array([[1.0], [3.0], [-0.0]])
    np.testing.assert_array_equal(function(PLACES, seeds), [function(PLACES, seed) for seed in (1.0, 3.0, 0.0)])


@pytest.mark.slow
def test_other_processes_give_the_same_bits() -> None:
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as pool:
        found = pool.submit(noise.smooth, PLACES, 3.0).result()
    assert found.tobytes() == noise.smooth(PLACES, 3.0).tobytes()


@pytest.mark.parametrize("function", [noise.held, noise.smooth])
def test_no_place_has_no_noise(function) -> None:
    assert np.isnan(function(np.nan, 1.0))
    assert np.isnan(function(np.array([np.inf, np.nan]), 1.0)).all()


@pytest.mark.slow
def test_numbers_are_normal_and_independent() -> None:
    """Kolmogorov's test; and the correlations along a seed and from one seed to others, of variance 1/n."""
    n = 100_000
    sample = np.sort(noise.held(np.arange(-n // 2, n // 2) + 0.3, 7.0))
    wanted = np.array([NormalDist().cdf(value) for value in sample])
    distance = max(np.abs(wanted - np.arange(n) / n).max(), np.abs(wanted - np.arange(1, n + 1) / n).max())
    assert distance < np.sqrt(np.log(2 / FALSE_ALARM) / 2 / n)
    first = noise.held(np.arange(n), 7.0)
    for other in (np.roll(first, 1), np.roll(first, 2), noise.held(np.arange(n), 8.0), noise.held(np.arange(n), -7.0)):
        assert abs(np.mean(first * other)) < SIGMAS / np.sqrt(n)


@pytest.mark.slow
def test_smooth_noise_is_standard_normal_between_whole_numbers_as_well() -> None:
    """Of the mean of n squares the variance is 2/n; places four apart share no number."""
    n = 20_000
    for along in (0.0, 0.3, 0.5, 0.9):
        values = noise.smooth(4.0 * np.arange(n) + along, 5.0)
        assert abs(values.mean()) < SIGMAS / np.sqrt(n)
        assert abs(np.mean(values**2) - 1) < SIGMAS * np.sqrt(2 / n)


def test_smooth_noise_has_two_continuous_derivatives() -> None:
    """Across whole numbers, and each is the difference quotient of the one before: h = 1e-6 leaves 1e-9 of rounding."""
    h = 1e-6
    for order in (0, 1, 2):
        before, after = noise.smooth(np.arange(40) - h, 2.0, order), noise.smooth(np.arange(40.0), 2.0, order)
        np.testing.assert_allclose(before, after, atol=1e-4)
    x = np.linspace(0.05, 9.95, 100)
    for order in (0, 1):
        quotient = (noise.smooth(x + h, 2.0, order) - noise.smooth(x - h, 2.0, order)) / (2 * h)
        np.testing.assert_allclose(noise.smooth(x, 2.0, order + 1), quotient, atol=1e-8)


def test_smooth_noise_keeps_below_its_band() -> None:
    """99.9 % of the power below 0.6 cycles for each 1, half the density at 0.22 (5 % is 6 sigma of 16384 averages)."""
    n, each = 2**18, 8
    power = np.abs(np.fft.rfft(noise.smooth(np.arange(n) / each, 5.0))) ** 2
    frequency = np.fft.rfftfreq(n, 1 / each)
    assert power[frequency > 0.6].sum() < 1e-3 * power.sum()
    width = frequency < 0.22
    low, at = power[width & (frequency < 0.05)].mean(), power[np.abs(frequency - 0.22) < 0.02].mean()
    assert at / low == pytest.approx(np.sinc(0.22) ** 8, rel=0.1)


def test_laws_know_where_noise_steps_and_that_it_is_level_between() -> None:
    held = 3 + sw.HeldNoise(sw.t / 0.25, 1)
    assert slope(held, sw.t) == 0
    assert pieces_degree(held) == 0
    assert pieces_degree(sympy.Max(0, held)) == 0
    assert pieces_degree(sw.t * held) == 1
    assert pieces_degree(sw.SmoothNoise(sw.t, 1)) is None
    assert breakpoints(held) == ()  # there is no end to them


def test_smooth_noise_written_in_held_noise_is_the_same() -> None:
    law = sw.SmoothNoise(sw.t, 2.0)
    modules = [noise.NUMERICAL, "numpy"]
    for form in (law, law.diff(sw.t)):
        direct, pieces = (sympy.lambdify(sw.t, made, modules=modules) for made in (form, form.pieces))
        np.testing.assert_allclose(pieces(PLACES[:601]), direct(PLACES[:601]), rtol=1e-13, atol=1e-13)


def test_noise_prints_as_a_letter_with_its_seed() -> None:
    assert sympy.latex(sw.HeldNoise(sw.t, 3)) == r"\nu_{3}\left(\left\lfloor{t}\right\rfloor\right)"
    assert sympy.latex(sw.SmoothNoise(sw.t, 3) ** 2) == r"\left(\tilde\nu_{3}\left(t\right)\right)^{2}"
    assert sympy.latex(sw.SmoothNoise(sw.t, 3).diff(sw.t)) == r"\tilde\nu^{(1)}_{3}\left(t\right)"


@pytest.mark.parametrize(
    "made", [sw.HeldNoise(sw.t, sw.omega), sw.SmoothNoise(3.0, sw.t), sw.SmoothNoise(sw.phi, sw.phi)]
)
def test_a_seed_that_changes_during_the_motion_is_refused(made: sympy.Expr) -> None:
    net = sw.Network("noisy")
    net.add(sw.TorqueSource("m", tau=1.0 + made), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    (problem,) = net.check()
    assert "has a noise whose seed" in str(problem)
    assert "changes during the motion" in str(problem)


@pytest.mark.slow
def test_a_noise_that_has_no_value_ends_the_run_with_a_named_error() -> None:
    net = sw.Network("noisy")
    net.add(sw.TorqueSource("m", tau=sw.HeldNoise(sympy.log(sw.omega - 1.0), 1.0)), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    for engine in ("auto", "scipy"):
        with pytest.raises(sw.SimulationError, match="has no real value"):
            net.simulate(0.01, engine=engine)
