"""A linear system in scaled coordinates: its modes, its exponential, and its inputs that are straight lines."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse
from scipy.linalg import expm
from scipy.sparse.linalg import expm_multiply

from shaftwork.core.calls import interruptible
from shaftwork.core.errors import ParameterError
from shaftwork.integrate.linear.modal import Eigensystem, find_modes
from shaftwork.integrate.problem import Array, LinearInputs, Problem
from shaftwork.integrate.smooth_intervals import SmoothInterval
from shaftwork.integrate.stiffness import balance, norm, scale_by

# From so many states on LAPACK may take so long for the modes that Ctrl-C must not wait for it.
LONG_WAIT = 100
# A forcing may differ from a straight line by this part of its size before it is refused.
STRAIGHT = 1e-7


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
        matrix = self.matrix.toarray()
        return interruptible(find_modes, matrix) if len(matrix) >= LONG_WAIT else find_modes(matrix)


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
        ParameterError: u is no straight line.
    """
    length = piece.high - piece.low
    times = [piece.low + part * length for part in (0.25, 0.5, 0.75)]
    early, middle, late = (np.asarray(forcing(time), dtype=float) for time in times)
    slope = (late - early) / (times[2] - times[0])
    bend = np.abs(middle - (early + late) / 2) - np.abs(slope) * np.spacing(piece.high)  # a short piece's times round
    if (bend > STRAIGHT * (np.abs(early) + np.abs(late)).max(initial=0.0)).any():
        name = problem.names[int(np.argmax(bend))]
        raise ParameterError(
            f"The exact engine needs an input that is a straight line between breakpoints; the one of {name!r} bends "
            f"between t = {piece.start:.6g} s and {piece.end:.6g} s. Take the engine 'auto'."
        )
    slope[np.abs(slope) * length <= 8 * np.finfo(float).eps * np.abs(early)] = 0.0
    return early - (times[0] - piece.start) * slope, slope
