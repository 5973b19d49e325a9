"""How inertias in a row swing: rates and shapes to all digits, however stiff some couplings are beside others."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigvalsh_tridiagonal, lapack

Array = NDArray[np.float64]

ROUNDING = float(np.finfo(float).eps)


@dataclass(frozen=True, eq=False)
class TridiagonalChain:
    """Inertias in a row, springs between neighbours, and springs to the frame.

    Args:
        inertias: (n,) above zero, kg m^2.
        stiffnesses: (n - 1,) N m/rad; zero where the row falls into pieces, each of which is held by the frame.
        supports: (n,) N m/rad.
    """

    inertias: Array
    stiffnesses: Array
    supports: Array

    def rates(self, count: int | None = None) -> Array:
        """(m,) the rates above zero, rad/s, ascending: all of them, or so many of the lowest.

        Law: J^-1/2 K J^-1/2 = L L^T with two diagonals in L. Eliminated with what each place sees behind it, where
        nothing is subtracted, every element of L is right to rounding; then so is every singular value, found by
        bisection as eigenvalue of a matrix with zeros on its diagonal and the elements of L in turn beside it. The
        eigenvalues of K would have an error of eps (f_max / f)^2.

        Source: Demmel and Kahan, Accurate singular values of bidiagonal matrices, SIAM Journal on Scientific and
        Statistical Computing 11(5), 1990.
        """
        size, supported = len(self.inertias), self.supports.any()
        if not size:
            return np.empty(0)
        pivots = driving_point_stiffness(self.stiffnesses, self.supports) + np.append(self.stiffnesses, 0.0)
        beside = np.empty(2 * size - 1)
        beside[::2] = np.sqrt(pivots / self.inertias)
        beside[1::2] = self.stiffnesses / np.sqrt(pivots[:-1] * self.inertias[1:])
        if not supported:
            beside = beside[:-1]  # the whole turns, at a rate of zero
        last = len(beside) if count is None else min(size + count - 1, len(beside))
        if last < size:
            return np.empty(0)
        rates = eigvalsh_tridiagonal(
            np.zeros(len(beside) + 1),
            beside,
            select="i",
            select_range=(size, last),
            lapack_driver="stebz",
            tol=2 * np.finfo(float).tiny,
        )
        return np.asarray(rates, dtype=float)

    def swing(self, rate: float) -> tuple[Array, Array]:
        """(n,) shape at one of the rates, with a modal inertia of 1 kg m^2, and (n - 1,) torques in the springs.

        Law: with what each place feels of the left and of the right while all swing at this rate, the ratio of
        neighbours follows from the outside inwards; both sides meet where least is left over. No speeds are subtracted.

        Source: Parlett and Dhillon, Fernando's solution to Wilkinson's problem: an application of double
        factorization, Linear Algebra and its Applications 267, 1997.
        """
        stiffness, last = self.supports - rate**2 * self.inertias, len(self.inertias) - 1
        left = driving_point_stiffness(self.stiffnesses, stiffness)
        right = driving_point_stiffness(self.stiffnesses[::-1], stiffness[::-1])[::-1]
        meet = int(np.argmin(np.abs(left + right - stiffness) / self.inertias))
        shape, torques = np.ones(last + 1), np.empty(last)
        for k in range(meet - 1, -1, -1):
            shape[k] = shape[k + 1] * transmissibility(self.stiffnesses[k], left[k])
            torques[k] = -left[k] * shape[k]
        for k in range(meet, last):
            shape[k + 1] = shape[k] * transmissibility(self.stiffnesses[k], right[k + 1])
            torques[k] = right[k + 1] * shape[k + 1]
        size = float(np.sqrt(np.sum(self.inertias * shape**2)))
        return shape / size, torques / size


def driving_point_stiffness(stiffnesses: Array, supports: Array) -> Array:
    """(n,) stiffness against the frame at each place, of itself and of all before it through the springs between."""
    stiffness = np.array(supports)
    for k, c in enumerate(stiffnesses):
        stiffness[k + 1] += stiffness[k] * transmissibility(c, stiffness[k])
    return stiffness


def transmissibility(c: float, stiffness: float) -> float:
    """The share of a motion that arrives behind a spring, where it meets a stiffness."""
    return c / ((c + stiffness) or ROUNDING * c) if c else 0.0


def constraint_mode(first: float, stiffnesses: Array, supports: Array) -> Array:
    """(n,) how places in a row follow a motion before the first of them, through a spring, while nothing swings."""
    behind = driving_point_stiffness(stiffnesses[::-1], supports[::-1])[::-1]
    springs = (first, *stiffnesses)
    shares = [transmissibility(c, each) for c, each in zip(springs, behind, strict=True)]
    return np.asarray(np.cumprod(shares), dtype=float)


def singular_values(matrix: Array) -> Array:
    """(n,) singular values of a matrix of n columns, ascending, to nearly all digits where rows or columns are scaled.

    Rows without an entry do not count; what has fewer rows than columns then has so many values that are exactly zero.
    Law: one-sided rotations of Jacobi. Source: Drmač and Veselić, New fast and accurate Jacobi SVD algorithm, SIAM
    Journal on Matrix Analysis and Applications 29(4), 2008 (LAPACK, DGEJSV).
    """
    entries = matrix[matrix.any(axis=1)]
    rows, columns = entries.shape
    if not entries.size:
        return np.zeros(columns)
    tall = entries if rows >= columns else entries.T
    values, _, _, scales, _, info = lapack.dgejsv(tall, joba=2, jobu=3, jobv=3, jobr=0, jobt=0, jobp=0)
    assert info == 0  # noqa: S101 (rotations of so few columns converge)
    padded = np.append(values * (scales[0] / scales[1]), np.zeros(max(columns - rows, 0)))
    return np.asarray(np.sort(padded), dtype=float)
