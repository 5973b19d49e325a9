"""What decides between engines: how fast a system decays and oscillates, and whether it is a damped chain."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from shaftwork.integrate.problem import Array, Problem
from shaftwork.integrate.smooth_intervals import pieces
from shaftwork.numerics.tolerances import SAME

# Up to here all eigenvalues are computed; beyond, norms of the balanced Jacobian bound them.
LARGEST_EIGENVALUES = 200
# Explicit methods are stable up to about this product of step and decay rate.
STABLE = 5.0


@dataclass(frozen=True)
class Rates:
    """The fastest motions of a system.

    Args:
        decay: largest rate of a motion that decays rather than oscillates, 1/s.
        oscillation: largest angular frequency of a motion that oscillates, rad/s.
    """

    decay: float
    oscillation: float


def rates(matrices: Iterable[Any]) -> Rates:
    """Fastest decay and oscillation of Jacobians."""
    all_rates = [Rates(0.0, 0.0), *map(_rates_of, matrices)]
    return Rates(max(rate.decay for rate in all_rates), max(rate.oscillation for rate in all_rates))


def bound_of_decay(matrices: Iterable[Any]) -> float:
    """At least the decay of `rates`, in 1/s, without eigenvalues: of many brief phases it tells enough."""
    return max((_bounds_of(matrix).decay for matrix in matrices), default=0.0)


def jacobians(problem: Problem) -> Iterator[Any]:
    """Those at the start of a problem and at a few states that it may soon reach; small ones as full arrays."""
    return (matrix for matrix in _jacobians(problem) if np.isfinite(abs(matrix).sum()))


def _jacobians(problem: Problem) -> Iterator[Any]:
    if problem.jacobian is None:
        return
    for piece in pieces(problem)[:4]:  # not all of them: every piece of a pulsed input looks alike
        time = piece.inside(piece.start)
        (matrix,) = jacobians_at(problem, np.array([time]), problem.x0[None])
        yield matrix
        # One linearly implicit Euler step is stable however stiff the system is, and leads to where it goes.
        moved = _implicit_step(problem, time, matrix, 0.1 * (piece.end - piece.start))
        if moved is not None:
            yield from jacobians_at(problem, np.array([time]), moved[None])


def jacobians_at(problem: Problem, times: Array, states: Array) -> list[Any]:
    """Those at times (k,) and states (k, n): small ones as full arrays."""
    if problem.jacobians is not None:
        matrices = problem.jacobians(times, states)
    else:
        assert problem.jacobian is not None  # noqa: S101 (asked only then)
        matrices = [problem.jacobian(t, x) for t, x in zip(times.tolist(), states, strict=True)]
    return [full_where_small(matrix) for matrix in matrices]


def full_where_small(matrix: Any) -> Any:
    """A small matrix as a full array, which is by far the faster; a large one as it is."""
    small = sparse.issparse(matrix) and matrix.shape[0] <= LARGEST_EIGENVALUES
    return matrix.toarray() if small else matrix


def first_jacobian(problem: Problem) -> Any:
    """The sparse Jacobian (n, n) at the start of a problem, or None where it has none."""
    if problem.straight is not None:
        return problem.straight.A
    if problem.jacobian is None:
        return None
    return problem.jacobian(pieces(problem)[0].inside(problem.t0), problem.x0)


def is_chain(problem: Problem) -> bool:
    """Whether each state is joined to few others, as in chains and trees, so that factors of matrices stay sparse."""
    matrix = first_jacobian(problem)
    # damped springs in a chain give four entries a state at most; matrices of more than eight may fill up
    return matrix is not None and bool(matrix.nnz <= 8 * matrix.shape[0])


def is_undamped(problem: Problem) -> bool:
    """Whether all motions of a passive system keep their energy, by its Jacobian at the start.

    The real parts of its eigenvalues are then zero. None of them is positive where nothing drives, so it is enough that
    their sum, the trace, is zero.
    """
    diagonal = first_jacobian(problem).diagonal()
    return bool(abs(diagonal.sum()) <= SAME * np.abs(diagonal).sum())


def _implicit_step(problem: Problem, time: float, matrix: Any, step: float) -> Array | None:
    change, size = step * problem.rhs(time, problem.x0), problem.x0.size
    try:
        if isinstance(matrix, np.ndarray):
            moved = problem.x0 + np.linalg.solve(np.eye(size) - step * matrix, change)
        else:
            moved = problem.x0 + splu(sparse.csc_matrix(sparse.eye_array(size) - step * matrix)).solve(change)
    except (RuntimeError, np.linalg.LinAlgError):  # exactly singular: a growing motion has just this rate
        return None
    return moved if np.isfinite(moved).all() else None


def _rates_of(matrix: Any) -> Rates:
    if matrix.shape[0] <= LARGEST_EIGENVALUES:
        values = np.linalg.eigvals(matrix)
        damped = np.abs(values.real) > np.abs(values.imag)
        decay = np.max(-values.real, initial=0.0, where=damped)
        return Rates(float(decay), float(np.max(np.abs(values.imag), initial=0.0, where=~damped)))
    return _bounds_of(matrix)


def _bounds_of(matrix: Any) -> Rates:
    """Bounds of the rates, by the symmetric and the other part of the balanced matrix."""
    scaled = scale_by(matrix, balance(matrix))
    return Rates(norm((scaled + scaled.T) / 2), norm((scaled - scaled.T) / 2))


def balance(matrix: Any, sweeps: int = 8) -> Array:
    """Diagonal d (n,) for which d^-1 A d has rows and columns of about equal size; speeds and torques differ by 10^6.

    Source: Osborne, On pre-conditioning of matrices, 1960. Powers of two, so the scaling itself does not round.
    """
    size = abs(matrix if isinstance(matrix, np.ndarray) else sparse.csr_array(matrix))
    scale, both = np.ones(matrix.shape[0]), np.flatnonzero((size.sum(axis=1) > 0) & (size.sum(axis=0) > 0))
    rows, columns = size[both], size[:, both].T
    for _ in range(sweeps):
        # Half of the full correction: all entries move at once, and the full one would overshoot.
        scale[both] = (scale[both] ** 2 * (rows @ scale) / (columns @ (1 / scale))) ** 0.25
    return np.asarray(2.0 ** np.round(np.log2(scale)))


def scale_by(matrix: Any, scale: Array) -> Any:
    """d^-1 A d for a sparse or full A and the diagonal d (n,)."""
    if isinstance(matrix, np.ndarray):
        return matrix * scale / scale[:, None]
    return sparse.diags_array(1 / scale) @ matrix @ sparse.diags_array(scale)


def norm(matrix: Any) -> float:
    """Largest column sum of a sparse or full matrix: a bound of its eigenvalues."""
    return float(abs(matrix).sum(axis=0).max(initial=0.0))
