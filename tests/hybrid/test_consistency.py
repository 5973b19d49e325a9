"""The rule by which modes are consistent with a motion: the same for a guard alone and for many side by side."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shaftwork.hybrid.consistency import (
    CLEAR,
    NOTHING,
    ROUNDINGS,
    clear_of_limit,
    drift,
    moved_by_rounding,
    rounding_moves,
    side_of_limit,
)

BAND = 1e-9
SIZES = st.sampled_from([0.0, 1e-300, 1e-12, BAND, 1.0, 1e9]) | st.floats(0.0, 1e12)
VALUES = st.builds(lambda size, sign: sign * size, SIZES, st.sampled_from([1.0, -1.0]))


@pytest.mark.parametrize(
    ("excess", "side"), [(-2 * BAND, -1), (-BAND, 0), (0.0, 0), (BAND, 0), (2 * BAND, 1), (math.nan, 0)]
)
def test_a_guard_is_within_its_limit_on_it_or_beyond_it(excess: float, side: int) -> None:
    assert side_of_limit(excess, BAND) == side


@pytest.mark.parametrize(
    ("gain", "beside", "sign"),
    [
        (1.0, 1.0, 1),
        (-1.0, -1.0, -1),
        (1.0, 2.1, 0),  # rounding moves it by more than it gains
        (0.0, 0.0, 0),
        (4 * BAND / ROUNDINGS, 4 * BAND / ROUNDINGS, 0),
        (math.nan, 1.0, 0),
        (1.0, math.nan, 0),
    ],
)
def test_a_guard_drifts_where_it_gains_more_than_rounding(gain: float, beside: float, sign: int) -> None:
    assert drift(gain, beside, BAND) == sign


@given(VALUES, SIZES)
def test_a_guard_is_met_beyond_where_it_is_now_and_never_at_zero(excess: float, band: float) -> None:
    met = clear_of_limit(excess, band)
    assert met >= max(excess, NOTHING)
    assert met >= (CLEAR * band if excess >= -CLEAR * band / 4 else band / CLEAR)


@given(st.lists(st.tuples(VALUES, VALUES, SIZES), min_size=1, max_size=5))
def test_lanes_side_by_side_are_told_as_each_alone(lanes: list[tuple[float, float, float]]) -> None:
    """To the last bit: a sweep and a single run must meet guards at the same place."""
    excess, other, band = np.array(lanes).T
    move = rounding_moves([2.0])[0]
    moved = moved_by_rounding(excess, other, move, 1e-15)
    together = (side_of_limit(excess, band), drift(excess, other, band), clear_of_limit(excess, band), moved)
    for k, (e, o, b) in enumerate(lanes):
        alone = (side_of_limit(e, b), drift(e, o, b), clear_of_limit(e, b), moved_by_rounding(e, o, move, 1e-15))
        assert [values[k] for values in together] == [*alone]
