"""The nonlinear eigenvalue problem of a network with exact shafts: its matrix, its roots, and how many they are."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from shaftwork.core.errors import SimulationError
from shaftwork.frequency.exact_shafts.exact_lines import ExactSlopes
from shaftwork.frequency.frequency_response import solved_densely
from shaftwork.frequency.model_slopes import Complex
from shaftwork.results.observer import Array, blocks

ITERATIONS, CONVERGED, SETTLED = 30, 1e-15, 1e-9
"""Steps to a root; found where a step is below the first fraction of it, or below the second and shrinks no more."""
POINTS = (256, 512, 1024, 2048, 4096, 8192, 16384)
"""Points on a half circle for the count of the roots in it; two numbers of points must agree."""
WHOLE = 0.01
"""A count is whole when it is nearer to a whole number than this."""


class ExactProblem:
    """M(s) u = 0 in variables of equal units, with rows such that M'(s) is of size one.

    Args:
        slopes: the network with its shafts.
        acting: the states of the network between them that have modes; None for all.
    """

    def __init__(self, slopes: ExactSlopes, acting: NDArray[np.intp] | None = None) -> None:
        network, lines, weights = slopes.open, slopes.lines, slopes.weights
        states, inputs = len(network.states), len(network.inputs)
        x = np.arange(states) if acting is None else acting
        rows = np.repeat(np.sqrt(lines.impedance / lines.delay), 2)[:, None]
        w = weights[x][:, None]
        self._lines, self._scale = lines, 1 / weights[states:]
        self._A = w * network.A[x][:, x].toarray() / w.T
        self._C = rows * network.C[:, x].toarray() / w.T
        self._arriving, self._through = w * network.B[x, inputs:], rows * network.D[:, inputs:]
        self._rows = rows
        self._level = np.vstack([w * network.B[x, :inputs], rows * network.D[:, :inputs]])
        self._rate = np.vstack([w * network.B1[x, :inputs], np.zeros((len(rows), inputs))])
        self._states, self.unknowns = len(x), len(x) + len(rows)
        self.size = float(max([*abs(self._A).sum(axis=0), *(1 / lines.delay)]))

    def matrix(self, s: Complex) -> Complex:
        """M (k, n, n) at s (k,)."""
        matrix = self._joined(*self._lines.ends(s))
        matrix[:, : self._states, : self._states] -= self._A
        matrix[:, self._states :, : self._states] = -self._C
        diagonal = np.arange(self._states)
        matrix[:, diagonal, diagonal] += s[:, None]
        return matrix

    def slope(self, s: Complex) -> Complex:
        """d M / d s (k, n, n)."""
        matrix = self._joined(*self._lines.end_slopes(s))
        diagonal = np.arange(self._states)
        matrix[:, diagonal, diagonal] += 1.0
        return matrix

    def driven(self, s: Complex, number: int) -> Complex:
        """The right-hand side (k, n) under an input of amplitude one."""
        return np.asarray(self._level[:, number] + np.multiply.outer(s, self._rate[:, number]))

    def solved(self, s: Complex, right: Complex) -> Complex:
        """Solutions (k, n, 2) of right-hand sides (k, n, 2), NaN where the matrix is singular."""
        return np.concatenate([solved_densely(self.matrix(s[here]), right[here]) for here in self._blocks(s)])

    def count(self, radius: float) -> int:
        """How many roots have |s| below a radius, each as often as it is one.

        Law: the integral of trace(M^-1 M') ds / (2 pi i) around them, by the midpoint rule, which converges the
        faster the farther the nearest root is from the circle. Conjugate points add up to the real part.

        Raises:
            SimulationError: it does not become a whole number.
        """
        before = np.inf
        for points in POINTS:
            s = radius * np.exp(1j * np.pi * (np.arange(points) + 0.5) / points)
            roots = float(self._turning(s).mean())
            if abs(roots - before) < WHOLE and abs(roots - round(roots)) < WHOLE:
                return round(roots)
            before = roots
        raise SimulationError(
            f"The modes up to {radius / (2 * np.pi):g} Hz cannot be counted: one is too near. Ask for another f_max."
        )

    def _blocks(self, s: Complex) -> Iterator[slice]:
        return blocks(len(s), 4 * self.unknowns**2)  # the matrix, its slope, and what they make

    def _joined(self, speeds: Complex, torques: Complex) -> Complex:
        """What V and W (k, q, 2, 2) do to the rows of the network and of the ends, (k, n, n), the rest zero."""
        count, shafts = speeds.shape[:2]
        ends = np.zeros((2, count, 2 * shafts, 2 * shafts), dtype=complex)
        for k in range(shafts):
            here = slice(2 * k, 2 * k + 2)
            ends[0, :, here, here] = speeds[:, k]
            ends[1, :, here, here] = torques[:, k] - self._lines.impedance[k] * speeds[:, k]
        speed, arriving = ends * self._scale
        matrix = np.zeros((count, self.unknowns, self.unknowns), dtype=complex)
        matrix[:, : self._states, self._states :] = -self._arriving @ arriving
        matrix[:, self._states :, self._states :] = self._rows * speed - self._through @ arriving
        return matrix

    def _turning(self, s: Complex) -> Array:
        """Real part (k,) of s trace(M^-1 M')."""
        pieces = (s[here] for here in self._blocks(s))
        traces = [np.trace(np.linalg.solve(self.matrix(z), self.slope(z)), axis1=1, axis2=2) for z in pieces]
        return np.asarray((s * np.concatenate(traces)).real)

    def roots(self, starts: Complex) -> tuple[Complex, Complex]:
        """Roots (g,) next to starts (g,) that lie close together, and their vectors (n, g) in the variables given.

        Law: two-sided inverse iteration of g vectors at once, with a Rayleigh quotient in the space that they span:
        M(s) and M'(s) between them make a small linear problem for the distances of all g roots from s. What is on the
        imaginary axis stays there (nothing is lost or supplied), and on the real axis.

        Raises:
            SimulationError: they were not found.
        """
        axis = next((unit for unit in (1.0, 1j) if not (starts / unit).imag.any()), None)
        centre, before = complex(starts.mean()), np.inf
        random = np.random.default_rng(0)
        right, left = (random.normal(size=(self.unknowns, len(starts))) + 0j for _ in range(2))
        for _ in range(ITERATIONS):
            s = np.array([centre])
            matrix, slope = self.matrix(s)[0], self.slope(s)[0]
            right = _basis(matrix, slope @ right)
            left = _basis(matrix.conj().T, slope.conj().T @ left)
            reduced = np.linalg.solve(left.conj().T @ slope @ right, left.conj().T @ matrix @ right)
            distances, shapes = np.linalg.eig(-reduced)
            if axis is not None:
                distances = (distances / axis).real * axis
            step = complex(distances.mean())
            centre += step
            if abs(step) <= CONVERGED * abs(centre) or before <= abs(step) <= SETTLED * abs(centre):
                return centre + distances - step, right @ shapes
            before = abs(step)
        raise SimulationError(f"No mode was found next to the rate {starts[0]:.6g} 1/s.")


def _basis(matrix: Complex, vectors: Complex) -> Complex:
    """An orthonormal basis of matrix^-1 vectors; a singular value of zero is taken for a rounding error."""
    try:
        solved = np.linalg.solve(matrix, vectors)
    except np.linalg.LinAlgError:
        left, sizes, right = np.linalg.svd(matrix)
        floored = np.maximum(sizes, np.finfo(float).eps * sizes[0])[:, None]
        solved = right.conj().T @ (left.conj().T @ vectors / floored)
    return np.asarray(np.linalg.qr(solved)[0])
