"""How right-hand sides in machine code are called, and the functions of numbers in them: for numba."""

from __future__ import annotations

import ctypes
import math
from typing import Any

import numpy as np
from numba import cfunc, njit, types
from numba.extending import get_cython_function_address

VECTOR, MATRIX = types.Array(types.float64, 1, "C"), types.Array(types.float64, 2, "C")
RATES = types.void(types.float64, VECTOR, VECTOR, VECTOR)
"""Signature of a system: t in s, x (n,), p (parameters,) and dx (n,), which it writes."""

_quantile = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double, ctypes.c_int)(
    get_cython_function_address("scipy.special.cython_special", "ndtri")
)


def machine_rates(function: Any) -> Any:
    """A Python function of `RATES` as machine code that other machine code can call."""
    return cfunc(RATES, error_model="numpy")(function)


@njit(error_model="numpy")
def interpolate(x, xs, ys):  # type: ignore[no-untyped-def]
    """Value of a table, as `components.tables.interpolate` has it."""
    if not x > xs[0]:
        return x if math.isnan(x) else ys[0]
    if x >= xs[-1]:
        return ys[-1]
    k = np.searchsorted(xs, x, side="right")
    return (ys[k] - ys[k - 1]) / (xs[k] - xs[k - 1]) * (x - xs[k - 1]) + ys[k - 1]


@njit(error_model="numpy")
def interpolation_slope(x, xs, ys):  # type: ignore[no-untyped-def]
    """Slope of a table, as `components.tables.interpolation_slope` has it."""
    k = np.searchsorted(xs, x, side="right")
    return (ys[k] - ys[k - 1]) / (xs[k] - xs[k - 1]) if 0 < k < xs.size else 0.0


@njit
def _split_mix(start, number):  # type: ignore[no-untyped-def]
    word = start + number * np.uint64(0x9E3779B97F4A7C15)
    word = (word ^ (word >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return word ^ (word >> np.uint64(31))


@njit(error_model="numpy")
def held_noise(x, seed):  # type: ignore[no-untyped-def]
    """Value of `HeldNoise`, as `components.noise.held` has it; NaN beyond the whole numbers of 64 bits."""
    if not abs(x) < 2.0**63:
        return math.nan
    start = _split_mix(np.float64(seed + 0.0).view(np.uint64), np.uint64(1))
    word = _split_mix(start, np.uint64(np.int64(math.floor(x))))
    return _quantile((np.float64(word >> np.uint64(11)) + 0.5) / 2.0**53, 0)
