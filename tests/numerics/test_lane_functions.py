"""Functions of eight lanes at once are those of C's library, whatever stands in the other lanes."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache

import mpmath
import numpy as np
import pytest

pytest.importorskip("numba")
from shaftwork.numerics.lane_functions import LANE_FUNCTIONS, LANES
from shaftwork.numerics.machine_code import lane_function

ULPS = 2.0
"""No error of ours is larger, in units in the last place; fdlibm says 1 of its own, a quotient or a sum adds to it."""
RANDOM = np.random.default_rng(7)


def of_all_sizes(low: float, high: float) -> np.ndarray:
    return np.exp(RANDOM.uniform(math.log(low), math.log(high), 400)) * RANDOM.choice([-1, 1], 400)


TURNS = [
    *(RANDOM.uniform(-7, 7, 400), of_all_sizes(1e-9, 1e6)),
    RANDOM.integers(1, 600_000, 400) * (math.pi / 2),  # where all digits but the last are lost
    np.array([710.0, 1e6, -999_999.999, 411557987.0, 1e9]),
]
POWERS = [RANDOM.uniform(-3, 3, 400), RANDOM.uniform(-700, 700, 400), of_all_sizes(1e-12, 1e-2)]
POINTS = {
    **dict.fromkeys((math.sin, math.cos, math.tan), TURNS),
    math.exp: [*POWERS, np.array([-708.5, -745.0, 709.7])],
    **dict.fromkeys((math.sinh, math.cosh), POWERS),
    math.tanh: [*POWERS, of_all_sizes(1e-300, 1e300)],
    math.log: [
        *(abs(of_all_sizes(1e-320, 1e308)), RANDOM.uniform(0.5, 2, 400), 1 + of_all_sizes(1e-15, 0.4)),
        np.array([1.0, 2.0**-1022, 5e-324, 2.0**1023, 1.7e308]),
    ],
}


@cache
def in_lanes(function: Callable[..., float]) -> Callable[[np.ndarray], np.ndarray]:
    code = lane_function(lambda body: body.write(0, body.call(function, body.read("x", 0))), {"moment": 0, "x": 1})

    def values(x: np.ndarray) -> np.ndarray:
        blocks = np.resize(x, (-(-x.size // LANES), LANES))
        memory, results = np.zeros((3, LANES)), np.empty_like(blocks)
        for row, block in enumerate(blocks):
            memory[1] = block
            code.ctypes(memory.ctypes.data, 2)
            results[row] = memory[2]
        return results.ravel()[: x.size]

    return values


def test_points_are_for_all_functions() -> None:
    assert set(POINTS) == set(LANE_FUNCTIONS)


@pytest.mark.parametrize("function", POINTS)
def test_values_are_those_of_many_digits(function: Callable[..., float]) -> None:
    for x in POINTS[function]:
        for number, value in zip(x.tolist(), in_lanes(function)(x).tolist(), strict=True):
            with mpmath.workprec(200):
                exact = getattr(mpmath, function.__name__)(mpmath.mpf(number))
                assert abs(value - exact) <= ULPS * math.ulp(float(exact)), (number, value)


@pytest.mark.parametrize("function", [math.sin, math.cos, math.tan])
def test_largest_angles_are_those_of_the_library(function: Callable[..., float]) -> None:
    x = of_all_sizes(1e6, 1e300)
    np.testing.assert_array_equal(in_lanes(function)(x), [function(angle) for angle in x.tolist()])


@pytest.mark.parametrize("function", POINTS)
def test_what_is_no_number_or_has_no_end_is_as_numpy_has_it(function: Callable[..., float]) -> None:
    x = np.array([0.0, -0.0, math.inf, -math.inf, math.nan, -1.0, 1e308, -1e308, 5e-324])
    with np.errstate(all="ignore"):
        expected = getattr(np, function.__name__)(x)
    values = in_lanes(function)(x)
    np.testing.assert_allclose(values, expected, rtol=5e-16)
    np.testing.assert_array_equal(np.signbit(values[:2]), np.signbit(expected[:2]))


@pytest.mark.parametrize("function", POINTS)
def test_a_lane_has_the_same_bits_beside_any_others(function: Callable[..., float]) -> None:
    alone = in_lanes(function)(np.full(LANES, 0.7))
    for other in (math.nan, math.inf, -1e9, 800.0, 3.0):
        beside = np.full(LANES, other)
        beside[3] = 0.7
        assert in_lanes(function)(beside)[3] == alone[3]
