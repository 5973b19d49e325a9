"""A linear system in scaled coordinates: its modes, its exponential, and how they move under inputs.

In its modes a motion is exact at any time, without any accumulation from step to step. Inputs are straight lines, or
smooth ones that become polynomials; the motion under these is exact.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import expm
from scipy.sparse.linalg import expm_multiply

from shaftwork.core.calls import interruptible
from shaftwork.core.errors import ParameterError
from shaftwork.integrate.problem import Array, LinearInputs, Problem
from shaftwork.integrate.smooth_intervals import SmoothInterval
from shaftwork.integrate.stiffness import balance, norm, scale_by
from shaftwork.numerics.polynomials import chebyshev_nodes, to_chebyshev, to_powers
from shaftwork.numerics.tolerances import SAME

Complex = NDArray[np.complex128]

# Degree of a panel's polynomials.
DEGREE = 8
_NODES = (1 + chebyshev_nodes(DEGREE)) / 2
# Values at the nodes of [0, 1] to the coefficients of the powers.
_POWERS = to_powers(_NODES)
_CHEBYSHEV = to_chebyshev(chebyshev_nodes(DEGREE))
_FACTORIALS = np.cumprod([1.0, *range(1, DEGREE + 1)])
# Intervals of a grid of an engine's own, or of outputs that are looked at: no accuracy depends on it.
OWN_INTERVALS = 500


@dataclass(frozen=True)
class Eigensystem:
    """Eigenvalues and eigenvectors of a real matrix that is well conditioned for them.

    Of each conjugate pair one is kept, with its vector doubled: the motion is the real part of what it gives.

    Args:
        values: (k,) eigenvalues, 1/s.
        vectors: (n, k), a column for each mode.
        inverse: (k, n) rows of the inverse of all vectors.
        condition: of all vectors, by which they may multiply rounding.
    """

    values: Complex
    vectors: Complex
    inverse: Complex
    condition: float = 1.0

    def response(self, start: Array, level: Array, slope: Array, elapsed: Array) -> Array:
        """States (k, n) at times `elapsed` (k,) after a start state, for the input level + slope * elapsed.

        Law: for each mode, e^z w + t phi1(z) a + t^2 phi2(z) b with z = lambda t.
        """
        z = np.multiply.outer(elapsed, self.values)
        t = elapsed[:, None]
        exponential = np.exp(z)
        motion = exponential * (self.inverse @ start)
        if level.any() or slope.any():
            once, twice = phi(z, exponential, 2)
            motion += t * once * (self.inverse @ level) + t**2 * twice * (self.inverse @ slope)
        return np.ascontiguousarray((motion @ self.vectors.T).real)


def find_modes(matrix: Any) -> Eigensystem | None:
    """The modes of a dense (n, n) matrix, or None where they are too badly conditioned to be of use."""
    lossless = _lossless_halves(matrix)
    if lossless is not None:
        return _lossless_modes(matrix, *lossless)
    values, vectors = np.linalg.eig(matrix)
    condition = float(np.linalg.cond(vectors))
    if condition > 1e4:  # by so much they may multiply rounding errors; that of a defective matrix is far beyond
        return None
    inverse = np.linalg.inv(vectors).astype(complex)
    upper = values.imag >= 0
    weights = np.where(values.imag > 0, 2.0, 1.0)[upper]
    return Eigensystem(values[upper].astype(complex), vectors[:, upper] * weights, inverse[upper], condition)


def _lossless_halves(matrix: Array) -> tuple[Array, NDArray[np.bool_]] | None:
    """The scale (n,) of the states whose squares add up to the energy, and which of them are speeds; or None.

    A lossless network exchanges energy between speeds and torques alone: x_i' = a_ij x_j and x_j' = a_ji x_i give to
    the one what they take from the other. Scales that make all pairs a_ij = -a_ji follow from state to state.
    """
    n = len(matrix)
    scale, speeds, reached = np.ones(n), np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    if (matrix * matrix.T > 0).any() or ((matrix == 0) != (matrix.T == 0)).any():
        return None
    for first in range(n):
        waiting = [] if reached[first] else [first]
        reached[first] = True
        while waiting:
            i = waiting.pop()
            neighbours = np.flatnonzero((matrix[i] != 0) & ~reached)
            scale[neighbours] = scale[i] * np.sqrt(-matrix[neighbours, i] / matrix[i, neighbours])
            speeds[neighbours], reached[neighbours] = not speeds[i], True
            waiting.extend(neighbours.tolist())
    scaled = matrix * scale / scale[:, None]
    if (np.abs(scaled + scaled.T) > SAME * np.abs(scaled)).any() or scaled[np.equal.outer(speeds, speeds)].any():
        return None
    return scale, speeds


def _lossless_modes(matrix: Array, scale: Array, speeds: NDArray[np.bool_]) -> Eigensystem:
    """Of v' = -B^T u, u' = B v, by B = U S V^T: the frequencies are S, real to the last bit, so no energy is lost.

    An eigenvalue of a general decomposition has a real part of some roundings, which in time adds up.
    """
    halves = np.flatnonzero(speeds), np.flatnonzero(~speeds)
    coupling = (matrix * scale / scale[:, None])[np.ix_(halves[1], halves[0])]
    left, sizes, right = np.linalg.svd(coupling)
    moving = sizes > sizes.max(initial=0.0) * len(matrix) * np.finfo(float).eps
    rank, n = int(moving.sum()), len(matrix)
    rows = np.zeros((n - rank, n), dtype=complex)
    rows[: right.shape[0], halves[0]] = right
    rows[:rank, halves[1]] = 1j * left.T[:rank]
    rows[:rank] /= np.sqrt(2)
    rows[right.shape[0] :, halves[1]] = left.T[rank:]
    values = np.zeros(n - rank, dtype=complex)
    values[:rank] = 1j * sizes[:rank]
    weights = np.where(values.imag > 0, 2.0, 1.0)
    vectors = rows.conj().T * weights * scale[:, None]
    return Eigensystem(values, vectors.astype(complex), (rows / scale).astype(complex))


def phi(z: Complex, exponential: Complex, count: int) -> Complex:
    """phi_1 ... phi_count, (count, ...): phi_k = (phi_{k-1} - 1 / (k-1)!) / z, phi_0 = e^z.

    Up to |z| = 2, where these differences would cancel, the last one is summed as a series of 24 terms and the others
    follow from it.

    Args:
        z: where.
        exponential: e^z, which a caller has already.
        count: how many.
    """
    small = np.abs(z) < 2
    inverse = 1.0 / np.where(small, 2, z)  # one division for all: a complex one costs as much as five products
    values = np.empty((count, *z.shape), dtype=complex)
    np.multiply(exponential - 1.0, inverse, out=values[0])
    for k in range(1, count):
        np.subtract(values[k - 1], 1 / math.factorial(k), out=values[k])
        values[k] *= inverse
    near = z[small]
    series = np.ones_like(near)
    for term in range(count + 24, count, -1):
        series *= near / term
        series += 1.0
    series /= math.factorial(count)
    for k in range(count, 0, -1):
        values[k - 1][small] = series
        series = 1 / math.factorial(k - 1) + near * series
    return values


@dataclass(frozen=True)
class Driven:
    """The motion of a linear system in its modes over a span of time.

    Args:
        modes: of the system.
        length: of each panel, s.
        starts: (panels, modes) the modes at the start of each.
        inputs: (panels, modes, degree + 1) coefficients of the powers of the share of a panel.
    """

    modes: Eigensystem
    length: float
    starts: Complex
    inputs: Complex

    def __call__(self, elapsed: Array) -> Array:
        """States (k, n) at times (k,) in s after the start."""
        rows = max(1, 10_000 // self.starts.shape[1])  # the functions phi of so many values stay in a cache
        blocks = [self._at(elapsed[first : first + rows]) for first in range(0, len(elapsed), rows)]
        return np.concatenate([(block @ self.modes.vectors.T).real for block in blocks])

    def _at(self, elapsed: Array) -> Complex:
        panel = np.clip((elapsed / self.length).astype(int), 0, len(self.starts) - 1)
        inside = elapsed - panel * self.length
        return _moved(self.modes.values, self.length, inside, self.starts[panel], self.inputs[panel])


def _moved(rates: Complex, length: float, inside: Array, start: Complex, inputs: Complex) -> Complex:
    """The modes (k, m) some times (k,) after their starts (k, m), under inputs (k, m, degree + 1).

    Law: e^z w + t sum_j (t / length)^j j! phi_{j+1}(z) c_j with z = lambda t.
    """
    z = np.multiply.outer(inside, rates)
    exponential = np.exp(z)
    motion = exponential * start
    powers = _FACTORIALS[:, None] * inside * (inside / length) ** np.arange(DEGREE + 1)[:, None]
    for j, function in enumerate(phi(z, exponential, DEGREE + 1)):
        motion += function * (powers[j][:, None] * inputs[..., j])
    return np.asarray(motion)


def polynomials(
    forcing: Callable[[Array], Array],
    length: float,
    fewest: int,
    most: int,
    *,
    left_out: float = 1e-13,
    rounded: float = 1e-10,
) -> Array | None:
    """Values (n, panels, degree + 1) of inputs at the nodes of panels that resolve them, or None where none do.

    Law: panels are halved until the last Chebyshev coefficients of all inputs are below `left_out` of the largest
    value, or do not fall any more because they are the rounding of the time in the input.

    Args:
        forcing: inputs (n, k) at times (k,) in s after the start, smooth.
        length: of the span, s.
        fewest: panels, at least.
        most: values, at most.
        left_out: part of an input that the polynomials may leave out.
        rounded: the part that rounding may take.
    """
    panels, before, each = fewest, np.inf, (DEGREE + 1) * len(forcing(np.zeros(1)))
    while panels * each <= most:
        times = length / panels * (np.arange(panels)[:, None] + _NODES)
        values = forcing(times.ravel()).reshape(-1, panels, DEGREE + 1)
        largest = np.maximum(np.abs(values).max(axis=(1, 2)), np.finfo(float).tiny)
        if not np.isfinite(largest).all():  # an input without a value somewhere has no polynomial there
            return None
        last = np.abs(values @ _CHEBYSHEV.T)[..., -2:].max(axis=(1, 2))
        rough = float((last / largest).max(initial=0.0))
        if rough <= left_out or before / 4 < rough <= rounded:
            return values
        panels, before = 2 * panels, rough
    return None


def driven(modes: Eigensystem, values: Array, start: Array, length: float) -> Driven:
    """The motion from a start state under inputs.

    Args:
        modes: of the system.
        values: of the inputs, from `polynomials`.
        start: (n,) state.
        length: of the span, s.
    """
    step = length / values.shape[1]
    inputs = np.einsum("mn,npj->pmj", modes.inverse, values @ _POWERS.T, optimize=True)
    starts = np.zeros(inputs.shape[:2], dtype=complex)
    gained = _moved(modes.values, step, np.full(len(starts), step), starts, inputs)
    decay = np.exp(modes.values * step)
    starts[0] = modes.inverse @ start
    for panel in range(1, len(starts)):
        starts[panel] = decay * starts[panel - 1] + gained[panel - 1]
    return Driven(modes, step, starts, inputs)


class LinearSystem:
    """The matrix of a problem in scaled coordinates x / scale, and its modes where they are of use."""

    def __init__(self, linear: LinearInputs) -> None:
        matrix = sparse.csr_array(linear.A)
        self.forcing = linear.forcing
        self.scale = balance(matrix)
        self.matrix = scale_by(matrix, self.scale)
        self.norm = norm(self.matrix)

    @cached_property
    def condition(self) -> float:
        """How much the modes multiply rounding."""
        return 1.0 if self.modes is None else self.modes.condition

    @cached_property
    def modes(self) -> Eigensystem | None:
        """The modes, or None where they are too badly conditioned."""
        return interruptible(find_modes, self.matrix.toarray())


def system_of(linear: LinearInputs) -> LinearSystem:
    """The system of a linear form, made once."""
    return linear.cached("exact", lambda: LinearSystem(linear))


def are_even(times: Array) -> bool:
    """Whether times (k,) have equal steps, up to rounding."""
    evenly = np.linspace(times[0], times[-1], times.size)
    return bool((np.abs(times - evenly) <= 4 * np.spacing(np.abs(times).max())).all())


@dataclass(frozen=True)
class Propagator:
    """exp(M h) for one piece in scaled coordinates z = (x / scale, s, 1)."""

    matrix: Any
    scale: Array
    dense_form: bool

    def advance(self, block: Array, step: float) -> Array:
        """exp(M step) times the columns of a block (n + 2, k)."""
        if self.dense_form:
            return np.asarray(expm(self.matrix * step) @ block)
        return np.asarray(expm_multiply(self.matrix * step, block, traceA=self.matrix.trace() * step))

    def march(self, x: Array, elapsed: float, step: float, count: int) -> Array:
        """States (count, n) after 1..count equal steps from a state x (n,) that is `elapsed` seconds into the piece."""
        start = np.concatenate([x / self.scale, [elapsed, 1.0]])
        if not self.dense_form:
            rows = expm_multiply(self.matrix, start, start=0.0, stop=step * count, num=count + 1, endpoint=True)
            return np.asarray(rows[1:, :-2] * self.scale)
        power = expm(self.matrix * step)
        columns = (power @ start)[:, None]
        # With k columns known, exp(M step k) gives the next k: about log2(count) products.
        while columns.shape[1] < count:
            missing = count - columns.shape[1]
            columns = np.hstack([columns, power @ columns[:, :missing]])
            power = power @ power
        return np.asarray(columns[:-2].T * self.scale)

    def between(self, nodes: Array, states: Array, times: Array) -> Array:
        """States (k, n) at any times (k,) of a piece, each from the node before it."""
        index = np.clip(np.searchsorted(nodes, times, side="right") - 1, 0, nodes.size - 1)
        offsets = times - nodes[index]
        # Offsets that differ by the rounding of the times share one exponential.
        rounded = np.round(offsets / (2 * np.spacing(np.abs(nodes).max())))
        values = states[index]
        for key in np.unique(rounded[rounded > 0]):
            chosen = np.flatnonzero(rounded == key)
            elapsed = nodes[index[chosen]] - nodes[0]
            block = np.vstack([(values[chosen] / self.scale).T, elapsed, np.ones(chosen.size)])
            values[chosen] = self.advance(block, float(offsets[chosen].mean()))[:-2].T * self.scale
        return values


def propagator_of(system: LinearSystem, level: Array, slope: Array, *, dense_form: bool) -> Propagator:
    """exp(M h) under an input that is a straight line.

    Args:
        system: the matrix A.
        level: (n,) of the input at the start of the piece.
        slope: (n,) of the input, 1/s.
        dense_form: whether exponentials are made, instead of products with vectors.
    """
    scale, matrix = system.scale, system.matrix
    # A common factor of all states brings the forcing to the size of the matrix.
    largest = max(np.abs(level / scale).max(initial=0.0), np.abs(slope / scale).max(initial=0.0))
    size = system.norm
    if largest > 0 and size > 0:
        scale = scale * 2.0 ** np.ceil(np.log2(largest / size))
    forcing = np.column_stack([slope / scale, level / scale])
    clock = sparse.csr_array(np.array([[0.0, 1.0], [0.0, 0.0]]))
    augmented = sparse.block_array([[matrix, sparse.csr_array(forcing)], [None, clock]], format="csr")
    return Propagator(augmented.toarray() if dense_form else augmented, scale, dense_form)


def straight_line(problem: Problem, forcing: Callable[[float], Array], piece: SmoothInterval) -> tuple[Array, Array]:
    """Level at the start of a piece and slope of u, from values strictly inside the piece.

    Raises:
        ParameterError: u is no straight line, to 1e-7 of its size.
    """
    length = piece.high - piece.low
    times = [piece.low + part * length for part in (0.25, 0.5, 0.75)]
    early, middle, late = (np.asarray(forcing(time), dtype=float) for time in times)
    slope = (late - early) / (times[2] - times[0])
    bend = np.abs(middle - (early + late) / 2) - np.abs(slope) * np.spacing(piece.high)  # a short piece's times round
    if (bend > 1e-7 * (np.abs(early) + np.abs(late)).max(initial=0.0)).any():
        name = problem.names[int(np.argmax(bend))]
        raise ParameterError(
            f"The exact engine needs an input that is a straight line between breakpoints; the one of {name!r} bends "
            f"between t = {piece.start:.6g} s and {piece.end:.6g} s. Take the engine 'auto'."
        )
    slope[np.abs(slope) * length <= 8 * np.finfo(float).eps * np.abs(early)] = 0.0
    return early - (times[0] - piece.start) * slope, slope
