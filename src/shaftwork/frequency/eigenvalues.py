"""Eigenvalues and eigenvectors of a network's matrix: all of a small one, the lowest of a large one, zeros exact.

The states are scaled so that the sum of their squares is twice the stored energy. A lossless network has then a skew
matrix, whose frequencies and shapes come from a Hermitian one: nothing is damped by rounding.
Networks that nothing connects (two trains, a supply beside a train) are taken one by one.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from scipy import sparse
from scipy.linalg import qr
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import ArpackError, LinearOperator, eigs, splu

from shaftwork.core.errors import ParameterError, SimulationError
from shaftwork.core.notices import hint
from shaftwork.numerics.tolerances import EPS
from shaftwork.results.observer import Array, Complex

LARGEST_DENSE = 1500
"""States up to which all eigenvalues are computed."""
ZERO = 1e-10
"""A rate below this fraction of the shift is zero: shift and invert gives no more digits."""


def eigenmodes(matrix: Any, count: int | None) -> tuple[Complex, Complex]:
    """Rates (k,), each pair by its member with positive imaginary part, and shapes (n, k), in no particular order.

    Args:
        matrix: (n, n) scipy.sparse array, in states of equal units.
        count: the modes wanted, those of smallest |rate|; None for all.

    Raises:
        ParameterError: the network is too large for all modes.
        SimulationError: the lowest modes were not found.
    """
    pieces, label = connected_components(matrix, directed=False)
    order = np.argsort(label, kind="stable")
    ends = np.searchsorted(label[order], np.arange(pieces + 1))
    rates, columns = [np.empty(0, dtype=complex)], [np.empty((matrix.shape[0], 0), dtype=complex)]
    for first, last in pairwise(ends):
        members = order[first:last]
        of_piece, shapes = _connected(sparse.csr_array(matrix[members][:, members]), count)
        whole = np.zeros((matrix.shape[0], len(of_piece)), dtype=complex)
        whole[members] = shapes
        rates.append(of_piece)
        columns.append(whole)
    all_rates, all_shapes = np.concatenate(rates), np.hstack(columns)
    lowest = np.argsort(np.abs(all_rates), kind="stable")[:count]
    return all_rates[lowest], all_shapes[:, lowest]


def _connected(matrix: Any, count: int | None) -> tuple[Complex, Complex]:
    """The modes of a network in one piece."""
    size = matrix.shape[0]
    lossless = _is_skew(matrix)
    # Up to 300 states, all of them cost less than looking for a few.
    if size <= 300 or (size <= LARGEST_DENSE and (count is None or 2 * count + 4 > size // 4)):
        return _all(matrix.toarray(), lossless=lossless)
    if count is None:
        raise ParameterError(
            f"All modes of {size} connected states are more than anyone reads. Ask for the lowest: "
            f"{hint('modes(count=20)', '--count 20')}."
        )
    return _lowest(sparse.csc_array(matrix), count, lossless=lossless)


def _is_skew(matrix: Any) -> bool:
    """Whether an entry and its mirror image cancel to eight roundings, everywhere: nothing is lost or supplied."""
    sums, sizes = abs(matrix + matrix.T), abs(matrix) + abs(matrix.T)
    return not (sums - 8 * EPS * sizes > 0).nnz


def _all(matrix: Array, *, lossless: bool) -> tuple[Complex, Complex]:
    """All modes of a dense matrix. What does not change at all is taken out first, by its null space."""
    if not matrix.size:
        return np.empty(0, dtype=complex), np.empty((0, 0), dtype=complex)
    moving, still = _null_space(matrix)
    if still.shape[1]:  # angles that turn with a rigid body make a second layer of zeros, found by the same means
        rates, inner = _all(moving.T @ matrix @ moving, lossless=lossless)
        divisor = np.where(rates == 0, 1.0, rates)
        shapes = moving @ inner + still @ (still.T @ matrix @ moving @ inner) * (rates != 0) / divisor
        zeros = np.zeros(still.shape[1], dtype=complex)
        return np.concatenate([zeros, rates]), np.hstack([_separated(still), shapes])
    if lossless:
        frequencies, vectors = np.linalg.eigh(0.5j * (matrix - matrix.T))
        values = -1j * frequencies
    else:
        values, vectors = np.linalg.eig(matrix)
    upper = values.imag >= 0
    return values[upper].astype(complex), vectors[:, upper].astype(complex)


def _null_space(matrix: Array) -> tuple[Array, Array]:
    """Orthonormal bases of the space of the rows and of its complement, which the matrix maps to zero."""
    size = np.linalg.norm(matrix, axis=1, keepdims=True)
    rows = matrix / np.where(size > 0, size, 1.0)
    basis, triangle, _ = qr(rows.T, pivoting=True)
    diagonal = np.abs(np.diag(triangle))
    rank = int((diagonal > len(matrix) * np.finfo(float).eps * diagonal[0]).sum())
    return basis[:, :rank], basis[:, rank:]


def _separated(vectors: Array) -> Array:
    """Another basis of the same space in which one state moves in one vector alone, for each vector."""
    if vectors.shape[1] == 1:
        return vectors
    _, _, order = qr(vectors.T, mode="economic", pivoting=True)
    basis = vectors @ np.linalg.inv(vectors[np.sort(order[: vectors.shape[1]])])
    basis[np.abs(basis) < len(vectors) * 8 * EPS * np.abs(basis).max()] = 0.0
    return np.asarray(basis)


def _lowest(matrix: Any, count: int, *, lossless: bool) -> tuple[Complex, Complex]:
    """The modes of smallest |rate|, by Arnoldi's method on (A - shift)^-1.

    All eigenvalues nearer to the shift than the farthest one found are known, so those within that radius less the
    shift around zero are complete: the search goes on until they are enough.
    """
    size = matrix.shape[0]
    shift = float(np.sqrt(abs(matrix).sum(axis=0).max() * abs(matrix).sum(axis=1).max())) / size
    wanted = 2 * count + 4
    for _ in range(12):
        values, vectors = _nearest(matrix, shift, min(wanted, size - 2))
        moving = np.abs(values[np.abs(values) > ZERO * shift])
        if moving.size and shift > 0.5 * moving.min():
            shift = 0.2 * float(moving.min())
            continue
        complete = np.abs(values) < np.abs(values - shift).max() - shift
        modes = complete & (values.imag >= 0)
        if modes.sum() >= count:
            values, vectors = values[modes], vectors[:, modes]
            return np.where(np.abs(values) <= ZERO * shift, 0.0, 1j * values.imag if lossless else values), vectors
        wanted = min(2 * wanted, size - 2)
    raise SimulationError(f"The lowest {count} modes of {size} states were not found. Ask for fewer.")


def _nearest(matrix: Any, shift: float, wanted: int) -> tuple[Complex, Complex]:
    factors = splu(sparse.csc_array(matrix - shift * sparse.eye_array(matrix.shape[0], format="csc")))
    inverse = LinearOperator(matrix.shape, matvec=factors.solve, dtype=float)
    start = np.random.default_rng(0).normal(size=matrix.shape[0])  # always the same, so that results are
    try:
        values, vectors = eigs(matrix, k=wanted, sigma=shift, OPinv=inverse, v0=start)
    except ArpackError as error:
        raise SimulationError(
            f"The modes next to {shift:.3g} 1/s were not found: {error}. Ask for another number of modes."
        ) from None
    return np.where(np.abs(values.imag) < ZERO * np.abs(values), values.real, values), vectors
