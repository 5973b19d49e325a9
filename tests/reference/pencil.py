"""The quasi-Weierstrass form of a descriptor system E z' = A z + B u, by singular values alone.

The pencil s E - A is reduced by Wong sequences (Berger, Ilchmann, Trenn: The quasi-Weierstrass form for regular matrix
pencils, Linear Algebra and its Applications 436, 2012), two nested sequences of subspaces:

    z = V x + W y,   x' = J x + G u,   N y' = y + H u   with N nilpotent.

J holds the finite spectrum, and y = -(H u + N H u' + ...) holds constraints of any index. A redundant part, say a
second gear of the same ratio, makes the pencil singular by constants alone: then one unknown (the torque in the
redundant gear) is pinned to zero and one row dropped for each redundancy, both picked by pivoted QR, and every
unknown that depends on the choice is marked as undetermined. All ranks are decided on the equilibrated pencil at
``RANK_TOLERANCE``; singular values too near to it are refused instead of guessed about.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import qr, svd
from scipy.optimize import linear_sum_assignment

Array = np.ndarray[Any, np.dtype[np.float64]]
Indices = np.ndarray[Any, np.dtype[np.intp]]
RANK_TOLERANCE = 1e-9
RANK_GAP = 1e2


class IllPosedError(ValueError):
    """The equations contradict one another, leave something open, or their rank is not clear in floating point."""


@dataclass(frozen=True)
class Descriptor:
    """E z' = A z + B u; the rows of z are named by ``unknowns``, those of u by ``sources``."""

    E: Array
    A: Array
    B: Array
    unknowns: tuple[str, ...]
    sources: tuple[str, ...]


@dataclass(frozen=True)
class Reduced:
    """The quasi-Weierstrass form of a descriptor system, of differentiation index ``index``.

    ``determined`` marks the unknowns that have one value only, ``rows`` the equations that are not redundant.
    """

    V: Array
    W: Array
    J: Array
    G: Array
    N: Array
    H: Array
    determined: np.ndarray[Any, np.dtype[np.bool_]]
    rows: Indices
    index: int


def _range_and_null(matrix: Array, scale: float) -> tuple[Array, Array]:
    """Orthonormal bases of the range and of the null space; singular values near the tolerance are refused."""
    if 0 in matrix.shape:
        return np.zeros((matrix.shape[0], 0)), np.eye(matrix.shape[1])
    try:
        u, s, vh = svd(matrix)
    except np.linalg.LinAlgError:  # divide and conquer fails once in thousands; the QR iteration does not
        u, s, vh = svd(matrix, lapack_driver="gesvd")
    rank = int(np.sum(s > RANK_TOLERANCE * scale))
    close = (s < RANK_GAP * RANK_TOLERANCE * scale) & (s > RANK_TOLERANCE * scale / RANK_GAP)
    if close.any():
        raise IllPosedError(f"the rank is not clear: singular values {s[close]} lie near {RANK_TOLERANCE * scale:.1e}")
    return u[:, :rank], vh[rank:].T


def _equilibrated(d: Descriptor) -> tuple[Descriptor, Array]:
    """The same system with rows and columns scaled by powers of two (exact), and the column factors."""
    weight = np.abs(d.E) + np.abs(d.A)
    weight[~weight.any(axis=1)] = 1.0  # an empty row or column is found by the ranks, not here
    weight[:, ~(np.abs(d.E) + np.abs(d.A)).any(axis=0)] = 1.0
    rows, columns = np.ones(weight.shape[0]), np.ones(weight.shape[1])
    for _ in range(8):
        scaled = weight * rows[:, None] * columns
        rows *= np.exp2(-np.round(np.log2(scaled.max(axis=1)) / 2.0))
        scaled = weight * rows[:, None] * columns
        columns *= np.exp2(-np.round(np.log2(scaled.max(axis=0)) / 2.0))
    return Descriptor(
        d.E * rows[:, None] * columns, d.A * rows[:, None] * columns, d.B * rows[:, None], d.unknowns, d.sources
    ), columns


def _without_redundancy(d: Descriptor) -> tuple[Array, Indices, Indices]:
    """The free directions, and the rows and columns to keep: one less of each for each constant redundancy."""
    norm = float(np.linalg.norm(np.hstack([d.E, d.A]), 2))
    _, free = _range_and_null(np.vstack([d.E, d.A]), norm)
    _, idle = _range_and_null(np.hstack([d.E, d.A]).T, norm)
    if np.abs(idle.T @ d.B).max(initial=0.0) > RANK_TOLERANCE * max(1.0, np.abs(d.B).max(initial=0.0)):
        raise IllPosedError("two sources prescribe the same quantity, or a source has nothing to act on")

    def kept(directions: Array) -> Indices:
        _, _, order = qr(directions.T, mode="economic", pivoting=True)
        return np.sort(order[directions.shape[1] :])

    return free, kept(idle), kept(free)


def _wong(first: Array, second: Array, start: Array) -> tuple[Array, int]:
    """Limit of S_{k+1} = {z : first z in second S_k} from S_0 = start, and the steps to reach it."""
    space, scale_first, scale_second = start, float(np.linalg.norm(first, 2)), float(np.linalg.norm(second, 2))
    for step in range(first.shape[0] + 1):
        image, _ = _range_and_null(second @ space, scale_second)
        _, following = _range_and_null(first - image @ (image.T @ first), scale_first)
        if following.shape[1] == space.shape[1]:
            return following, step
        space = following
    raise IllPosedError("the Wong sequence did not settle")


def reduce(d: Descriptor) -> Reduced:
    """The quasi-Weierstrass form of the system; raises ``IllPosedError`` where the pencil is singular."""
    if d.E.shape[0] != d.E.shape[1]:
        raise IllPosedError(f"{d.E.shape[0]} equations for {d.E.shape[1]} unknowns")
    scaled, column_factors = _equilibrated(d)
    free, rows, columns = _without_redundancy(scaled)
    if len(rows) != len(columns):
        raise IllPosedError(f"{len(rows)} independent equations for {len(columns)} unknowns")
    E, A, B = scaled.E[np.ix_(rows, columns)], scaled.A[np.ix_(rows, columns)], scaled.B[rows]
    size = len(rows)
    V, _ = _wong(A, E, np.eye(size))
    W, index = _wong(E, A, np.zeros((size, 0)))
    frame = np.hstack([E @ V, A @ W])
    if V.shape[1] + W.shape[1] != size or np.linalg.matrix_rank(frame, tol=RANK_TOLERANCE) < size:
        raise IllPosedError("the pencil is singular: some motion is left open or prescribed twice")
    inverse = np.asarray(np.linalg.inv(frame), dtype=np.float64)
    flow, nilpotent, inputs = inverse @ A @ V, inverse @ E @ W, inverse @ B
    n = V.shape[1]
    lift: Array = np.zeros((len(d.unknowns), size))
    lift[columns, np.arange(size)] = column_factors[columns]
    determined = np.linalg.norm(free, axis=1) < RANK_TOLERANCE if free.size else np.ones(len(d.unknowns), dtype=bool)
    return Reduced(lift @ V, lift @ W, flow[:n], inputs[:n], nilpotent[n:], inputs[n:], determined, rows, index)


def spectral_distance(a: np.ndarray[Any, Any], b: np.ndarray[Any, Any]) -> float:
    """Largest distance of the best pairing of two spectra, relative to the largest modulus; inf if sizes differ."""
    if len(a) != len(b):
        return float("inf")
    if len(a) == 0:
        return 0.0
    cost = np.abs(np.asarray(a)[:, None] - np.asarray(b)[None, :])
    return float(cost[linear_sum_assignment(cost)].max() / max(np.abs(a).max(), np.abs(b).max(), 1e-300))
