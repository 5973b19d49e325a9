"""Linear systems under smooth inputs, mode by mode: the inputs become polynomials, the motion under these is exact."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from shaftwork.integrate.modal import Complex, Eigensystem, phi
from shaftwork.integrate.problem import Array
from shaftwork.numerics.polynomials import chebyshev_nodes, to_chebyshev, to_powers

# Degree of a panel's polynomials, the part of an input that they may leave out, and that which rounding may take.
DEGREE, LEFT_OUT, ROUNDED = 8, 1e-13, 1e-10
# Panels of a run at least: where an input is nothing but for short blows, fewer nodes may all lie between these.
FEWEST = 512
# Inputs of more values in a run, states by nodes, are left to engines that step.
MOST_VALUES = 10_000_000
_NODES = (1 + chebyshev_nodes(DEGREE)) / 2
# Values at the nodes of [0, 1] to the coefficients of the powers.
_POWERS = to_powers(_NODES)
_CHEBYSHEV = to_chebyshev(chebyshev_nodes(DEGREE))
_FACTORIALS = np.cumprod([1.0, *range(1, DEGREE + 1)])
# Values at a time in one evaluation of the motion: the functions phi of so many stay in a cache.
BLOCK = 10_000


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
        rows = max(1, BLOCK // self.starts.shape[1])
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


def polynomials(forcing: Callable[[Array], Array], length: float, fewest: int, most: int) -> Array | None:
    """Values (n, panels, degree + 1) of inputs at the nodes of panels that resolve them, or None where none do.

    Law: panels are halved until the last Chebyshev coefficients of all inputs are below `LEFT_OUT` of the largest
    value, or do not fall any more because they are the rounding of the time in the input.

    Args:
        forcing: inputs (n, k) at times (k,) in s after the start, smooth.
        length: of the span, s.
        fewest: panels, at least.
        most: values, at most.
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
        if rough <= LEFT_OUT or before / 4 < rough <= ROUNDED:
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
