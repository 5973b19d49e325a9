"""What a linear network makes of one panel, as constant matrices."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from shaftwork.integrate.lossless.collocation import GAUSS, STAGES
from shaftwork.integrate.lossless.lines import DelayProblem
from shaftwork.integrate.pieces import pieces
from shaftwork.integrate.problem import Array

# Numbers of so large a size show the matrices of an affine function without the rounding of its constant.
PROBE = 2.0**40
# They are seen so early in the first piece, at a share of it: later a law may have lost its value.
EARLY = 1 / 1024


@dataclass(frozen=True)
class Matrices:
    """A linear network between its delays: x' = A x + B h + u(t), v = C x + D h + e(t).

    Args:
        A: (n, n).
        B: (n, q).
        C: (q, n).
        D: (q, q).
    """

    A: Array
    B: Array
    C: Array
    D: Array

    @classmethod
    def of(cls, problem: DelayProblem) -> Matrices:
        """The matrices of a linear problem."""
        n, q = problem.x0.size, 2 * problem.delays.size
        piece = pieces(problem)[0]
        t = np.full(2 * (n + q), piece.low + EARLY * (piece.high - piece.low))
        both = PROBE * np.hstack([np.eye(n + q), -np.eye(n + q)])
        slopes, speeds = (np.asarray(f(t, both[:n], both[n:])) for f in (problem.rhs, problem.speeds))
        slopes, speeds = ((f[:, : n + q] - f[:, n + q :]) / (2 * PROBE) for f in (slopes, speeds))
        return cls(slopes[:, :n], slopes[:, n:], speeds[:, :n], speeds[:, n:])


@dataclass(frozen=True)
class PanelMap:
    """One panel: from start state and arriving waves, and from inputs at the nodes, to what they change.

    Args:
        step: (n + q s, n + q s) to the increment of the state over the panel and to 2 Z v at the nodes.
        drive: (n + q s, (n + q) s) the same from u and e at the nodes.
        inner: (n s, n + q s) to the increments of the state at the nodes.
        inner_drive: (n s, (n + q) s).
    """

    step: Array
    drive: Array
    inner: Array
    inner_drive: Array


def panel_map(matrices: Matrices, twice: Array, length: float) -> PanelMap:
    """The map of panels of a length in s, for ends of 2 Z = `twice` (q,) in N m s."""
    n, q = len(matrices.A), len(twice)
    a, stages = length * GAUSS.matrix, np.eye(STAGES)
    inverse = np.linalg.inv(np.eye(n * STAGES) - np.kron(matrices.A, a))
    from_state = np.kron(matrices.A, a.sum(axis=1)[:, None])
    states = inverse @ np.hstack([from_state, np.kron(matrices.B, a)])
    drives = inverse @ np.hstack([np.kron(np.eye(n), a), np.zeros((n * STAGES, q * STAGES))])
    close = np.kron(np.eye(n), GAUSS.close[None, :])
    to_speed = np.kron(matrices.C, stages)
    doubled = np.repeat(twice, STAGES)[:, None]
    direct = np.hstack([np.kron(matrices.C, np.ones((STAGES, 1))), np.kron(matrices.D, stages)])
    direct_drive = np.hstack([np.zeros((q * STAGES, n * STAGES)), np.eye(q * STAGES)])
    return PanelMap(
        step=np.vstack([close @ states, doubled * (to_speed @ states + direct)]),
        drive=np.vstack([close @ drives, doubled * (to_speed @ drives + direct_drive)]),
        inner=states,
        inner_drive=drives,
    )
