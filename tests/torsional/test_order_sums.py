"""The half range of sums of orders."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shaftwork.torsional.order_sums import cycle_of, half_range, waveform


@given(st.integers(0, 2**32 - 1), st.integers(1, 16))
def test_the_half_range_is_that_of_a_finely_sampled_cycle(seed: int, count: int) -> None:
    draw = np.random.default_rng(seed)
    parts = draw.normal(size=(3, count)) + 1j * draw.normal(size=(3, count))
    orders = (np.arange(count) + 1) / 2
    phi = np.linspace(0.0, 4 * np.pi, 40001)
    fine = np.ptp(waveform(parts, orders.tolist(), phi), axis=1) / 2
    # samples miss a peak by (step order)^2 / 8 of its size at most
    assert half_range(parts, orders.tolist()) == pytest.approx(fine, rel=2e-6)


def test_one_order_has_its_amplitude_and_two_far_apart_their_sum() -> None:
    assert half_range(np.array([[3 + 4j]]), [1.5]) == pytest.approx(5.0)
    assert half_range(np.array([[3 + 4j, 2j]]), [1.0, math.pi]) == pytest.approx(7.0)


def test_orders_that_share_a_cycle_of_their_own_keep_their_phases() -> None:
    alone = half_range(np.ones((1, 2), dtype=complex), [1.0, 2.0])
    assert alone == pytest.approx((2 + 1.125) / 2)  # cos x + cos 2x is between -9/8 and 2
    together = half_range(np.ones((1, 3), dtype=complex), [1.0, math.pi, 2 * math.pi])
    assert together == pytest.approx(1.0 + alone)


def test_an_infinite_order_has_no_bound() -> None:
    assert np.isinf(half_range(np.array([[np.inf, 1.0]], dtype=complex), [1.0, 2.0])).all()


@pytest.mark.parametrize(
    ("orders", "turns"), [((1.0, 2.0), 1), ((0.5, 1.0), 2), ((1.0, 83 / 21), 21), ((math.pi,), None)]
)
def test_a_cycle_ends_where_all_orders_begin_again(orders: tuple[float, ...], turns: int | None) -> None:
    assert cycle_of(orders) == turns
