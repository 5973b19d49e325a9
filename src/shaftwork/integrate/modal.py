"""Motion of a linear system in its modes: exact at any time, without any accumulation from step to step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shaftwork.integrate.problem import Array

Complex = NDArray[np.complex128]

# The modes may multiply rounding errors by this much; a defective matrix is far beyond.
LARGEST_CONDITION = 1e4
SERIES_TERMS = 20


@dataclass(frozen=True)
class Modes:
    """Eigenvalues and eigenvectors of a real matrix that is well conditioned for them.

    Of each conjugate pair one is kept, with its vector doubled: the motion is the real part of what it gives.

    Args:
        values: (k,) eigenvalues, 1/s.
        vectors: (n, k), a column for each mode.
        inverse: (k, n) rows of the inverse of all vectors.
    """

    values: Complex
    vectors: Complex
    inverse: Complex

    def response(self, start: Array, level: Array, slope: Array, elapsed: Array) -> Array:
        """States (k, n) at times `elapsed` (k,) after a start state, for the input level + slope * elapsed.

        Law: for each mode, e^z w + t phi1(z) a + t^2 phi2(z) b with z = lambda t.
        """
        z = np.multiply.outer(elapsed, self.values)
        t = elapsed[:, None]
        motion = np.exp(z) * (self.inverse @ start)
        if level.any() or slope.any():
            once, twice = _integrals(z)
            motion += t * once * (self.inverse @ level) + t**2 * twice * (self.inverse @ slope)
        return np.ascontiguousarray((motion @ self.vectors.T).real)


def find_modes(matrix: Any) -> Modes | None:
    """The modes of a dense (n, n) matrix, or None where they are too badly conditioned to be of use."""
    values, vectors = np.linalg.eig(matrix)
    if np.linalg.cond(vectors) > LARGEST_CONDITION:
        return None
    inverse = np.linalg.inv(vectors).astype(complex)
    kept = values.imag >= 0
    weights = np.where(values.imag > 0, 2.0, 1.0)[kept]
    return Modes(values[kept].astype(complex), vectors[:, kept] * weights, inverse[kept])


def _integrals(z: Complex) -> tuple[Complex, Complex]:
    """phi1 = (e^z - 1) / z and phi2 = (e^z - 1 - z) / z^2, by their series where the differences would cancel."""
    small = np.abs(z) < 1.0
    safe = np.where(small, 1.0, z)
    once = np.expm1(safe) / safe
    twice = (once - 1.0) / safe
    near = z[small]
    series = np.ones_like(near)
    for term in range(SERIES_TERMS, 2, -1):
        series = 1.0 + series * near / term
    twice[small] = series / 2.0
    once[small] = 1.0 + near * twice[small]
    return once.astype(complex), twice.astype(complex)
