"""The variational equation equals matrix exponentials, whatever the first steps are, stiff or not."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm

from shaftwork.core.errors import SimulationError
from shaftwork.sensitivities.variation import Array, Coefficients, Variation, variation

RTOL = 1e-10


def constant(A: Array, B: Array) -> Coefficients:
    """The same slopes at all times."""
    return lambda times: (np.broadcast_to(A, (len(times), *A.shape)), np.broadcast_to(B, (len(times), *B.shape)))


def solved(A: Array, B: Array, ends: Array, start: Array) -> Variation:
    return variation(constant(A, B), ends, start, np.ones(len(A)), np.full(B.shape[1], 1e-3), RTOL)


def exact(A: Array, B: Array, start: Array, t: float) -> Array:
    """Y' = A Y + B, from the exponential of what holds both and a row of ones."""
    size, count = B.shape
    whole = np.zeros((size + count, size + count))
    whole[:size, : A.shape[1]], whole[:size, size:] = A, B
    moved: Array = expm(whole * t) @ np.vstack([start, np.eye(count)])
    return moved[:size]


@pytest.mark.parametrize("damping", [0.0, 0.3, 50.0, 2e4], ids=str)
@pytest.mark.parametrize("steps", [2, 40])
def test_it_is_the_matrix_exponential_with_integrals_beside(damping: float, steps: int) -> None:
    """An oscillator of 10 rad/s; the strongest damping leaves rates of 2e4 and of 5e-3 1/s."""
    A = np.array([[0.0, 1.0], [-100.0, -damping], [3.0, -1.0]])
    B = np.array([[0.0, 1.0], [2.0, 0.5], [0.1, 0.0]])
    start = np.array([[1.0, 0.0], [0.0, -2.0], [0.0, 0.0]])
    made = solved(A, B, np.linspace(0.5, 2.5, steps), start)
    for t in (0.5, 0.777, 1.9, 2.5):
        expected = exact(A, B, start, t - 0.5)
        np.testing.assert_allclose(made.at(t), expected, atol=1e3 * RTOL * np.abs(expected).max())


def test_slopes_that_change_with_time_are_followed() -> None:
    """Y' = Y cos t + p gives, for p = 0, Y = exp(sin t); its integral beside it is known at 2 pi: 2 pi I0(1)."""

    def coefficients(times: Array) -> tuple[Array, Array]:
        A = np.stack([np.cos(times)[:, None], np.ones((len(times), 1))], axis=1)
        return A, np.zeros((len(times), 2, 1))

    start = np.array([[1.0], [0.0]])
    made = variation(coefficients, np.array([0.0, 2 * np.pi]), start, np.ones(2), np.ones(1), RTOL)
    assert made.at(1.0)[0, 0] == pytest.approx(np.exp(np.sin(1.0)), rel=1e-9)
    assert made.values[-1, 1, 0] == pytest.approx(2 * np.pi * np.i0(1.0), rel=1e-9)


def test_steps_without_end_are_an_error() -> None:
    with pytest.raises(SimulationError, match="could not be integrated beyond t = 0 s"):
        solved(np.full((1, 1), np.nan), np.ones((1, 1)), np.array([0.0, 1.0]), np.zeros((1, 1)))


def test_nothing_to_solve_is_solved() -> None:
    made = solved(np.zeros((0, 0)), np.zeros((0, 3)), np.array([0.0, 1.0]), np.zeros((0, 3)))
    assert made.at(0.3).shape == (0, 3)
