"""Algebraic loops: nonlinear laws at massless nodes, whose torque and speed determine each other.

The unknowns a are the inputs u at the places of these laws: the through variable w of a law that is a link, the across
variable of a law that is in the tree. With g the values of all laws,

    link:  a - g(y) = 0,    tree:  P x + Q u - g(y) = 0,    y = C x + D u + D1 u'.

So do laws of inertias that change, which read the rate of the speed that they help to determine.

They are solved by Newton's method with the exact slopes, starting from the last solution, so that a motion stays on its
branch where there are several. Along a motion each instant starts from the one before: all start from guesses at once,
and those whose guess was another one start once more, until all have started from where the one before them ended.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from shaftwork.codegen.array_form.elements import Array, Index, blocks
from shaftwork.codegen.array_form.inputs import Inputs
from shaftwork.codegen.array_form.matrices import LinearPart
from shaftwork.core.errors import SimulationError
from shaftwork.numerics.tolerances import TYPED

ROUNDING = 64 * float(np.finfo(float).eps)
NEARLY = 1e4 * ROUNDING
"""Residuals and steps up to which they are rounding where no step makes the residual smaller, as parts of the terms."""


class LoopSolver:
    """Solves the loops of a network for one parameter vector.

    Args:
        inputs: the laws.
        part: the linear part.
        places: where the loop laws stand in u.
        in_tree: which of them are in the tree, in the order of the rows of P and Q.
        p: parameter vector.
        beside_waves: the parts of the laws, where lines are at their nodes; there another solution is refused.
        linear: whether all of them are laws of inertias, linear in the rates that they read: solved at once for many
            instants, in a third of the time of Newton's method.
    """

    def __init__(
        self,
        inputs: Inputs,
        part: LinearPart,
        places: Index,
        in_tree: NDArray[np.bool_],
        p: Array,
        beside_waves: tuple[str, ...] = (),
        *,
        linear: bool = False,
    ) -> None:
        self._inputs, self._part, self._p, self._beside_waves = inputs, part, p, beside_waves
        self.places, self._tree = places, in_tree
        self._controls = inputs.controls
        self._D = part.D.toarray()
        self._D1 = part.D1 if part.D1.nnz else None
        free = ~inputs.of_time
        free[places] = False
        self._free, self._rates = np.flatnonzero(free), inputs.rates
        self._linear = linear
        self._P, self._Q = part.tree_law_x.toarray(), part.tree_law_u.toarray()
        self._last = np.zeros(len(places))
        self._sign = 0.0
        if beside_waves:  # of laws that do not change with what they determine
            plain = self._total(np.eye(len(places)), np.zeros((inputs.size, len(places))))[0]
            self._sign = float(np.sign(np.linalg.det(plain)))

    def solve(self, t: Any, x: Array) -> Array:
        """The unknowns a (loops,) at a time and state; (loops, k) at times (k,) and states (n, k) of a motion.

        They are NaN where Newton's method finds none.
        """
        if self._linear:
            return self.values(t, x)[1][self.places]
        if x.ndim == 1:
            return self._followed(np.array([t]), x[:, None])[:, 0]
        parts = blocks(len(t), self._inputs.size * len(self.places))  # of slopes, inputs by loops
        return np.concatenate([self._followed(t[part], x[:, part]) for part in parts], axis=1)

    def values(self, t: Any, x: Array) -> tuple[Array, Array]:
        """Outputs y and inputs u at states x, (n,) or (n, k) with t (k,)."""
        if not self._linear:
            return self.inputs_at(t, x, self.solve(t, x))[:2]
        by_unknowns = self._D[:, self.places]
        y, _, u = self.inputs_at(t, x, np.zeros((len(self.places), *x.shape[1:])))
        slope = self._inputs.along(t, y, x, self._p, by_unknowns)[self.places]
        matrix = np.eye(len(slope)).reshape(*slope.shape[:2], *(1,) * (x.ndim - 1)) - slope
        a = _solved(matrix, u[self.places])
        u[self.places] = a
        return y + by_unknowns @ a, u

    @property
    def last(self) -> Array:
        """The unknowns (loops,) of the last solution, at which the next one begins."""
        return self._last

    def start_from(self, a: Array) -> None:
        """Begin the next solution at these unknowns."""
        self._last = a

    def _followed(self, t: Array, x: Array) -> Array:
        """The unknowns (loops, k), those of each instant by Newton's method from those of the one before."""
        last = self._last
        starts = np.tile(last[:, None], len(t))
        a = self._newton(t, x, starts)
        if len(t) == 1:
            self._last = a[:, 0] if np.isfinite(a).all() else last
            return a
        while True:
            solutions = np.column_stack([last, a])
            solved = np.where(np.isfinite(solutions).all(axis=0), np.arange(solutions.shape[1]), 0)
            ends = solutions[:, np.maximum.accumulate(solved)]  # where there is none, the last one that there was
            least = TYPED * np.abs(ends).max(axis=1, keepdims=True)
            other = np.flatnonzero((np.abs(ends[:, :-1] - starts) > least).any(axis=0))
            if not other.size:
                self._last = ends[:, -1]
                return a
            starts[:, other] = ends[:, other]
            a[:, other] = self._newton(t[other], x[:, other], starts[:, other])

    def _newton(self, t: Array, x: Array, starts: Array) -> Array:
        """The unknowns (loops, k) from starts, each on its own; NaN where none are found."""
        a = starts.copy()
        residual, size = self.residual(t, x, a)
        going, near = np.ones(len(t), dtype=bool), np.zeros(a.shape, dtype=bool)
        for _ in range(50):  # Newton's steps
            going &= ~(np.abs(residual) <= ROUNDING * size).all(axis=0)
            if not going.any():
                break
            here = np.flatnonzero(going)
            step, solves = self._step(t[here], x[:, here], a[:, here], residual[:, here])
            near[:, here] = solves & (np.abs(step) <= NEARLY * np.abs(a[:, here]))
            norm = np.linalg.norm(residual, axis=0)
            for _ in range(50):  # halves of the step
                trial = a[:, here] + step
                left, terms = self.residual(t[here], x[:, here], trial)
                better = np.linalg.norm(left, axis=0) < norm[here]
                taken = here[better]
                a[:, taken], residual[:, taken], size[:, taken] = trial[:, better], left[:, better], terms[:, better]
                here, step = here[~better], step[:, ~better] / 2
                if not here.size:
                    break
            going[here] = False  # no step makes it smaller: either this is rounding, or there is no solution near
        return np.where((near | (np.abs(residual) <= NEARLY * size)).all(axis=0), a, np.nan)

    def _step(self, t: Array, x: Array, a: Array, residual: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Newton's step (loops, k), NaN where a slope is not finite; and whether (k,) it takes the residual away.

        Raises:
            SimulationError: beside waves, several solutions are near.
        """
        slope = np.moveaxis(self._by_loops(t, x, a)[0], -1, 0)
        finite = np.isfinite(slope).all(axis=(1, 2))
        if self._sign and (self._sign * np.linalg.det(slope[finite]) <= 0).any():
            names = " and ".join(map(repr, self._beside_waves))
            raise SimulationError(
                f"{names}: the torque falls faster with the speed than the impedances of the waves at its node, which "
                "are all that resists there, so several speeds go with it. Give the node an inertia, however small."
            )
        step = np.full_like(residual, np.nan)
        inverse = np.linalg.pinv(slope[finite], rcond=len(a) * np.finfo(float).eps)
        step[:, finite] = -np.einsum("kij,jk->ik", inverse, residual[:, finite])
        left = residual + np.einsum("kij,jk->ik", slope, step)
        return step, np.linalg.norm(left, axis=0) < 0.5 * np.linalg.norm(residual, axis=0)

    def inputs_at(self, t: Any, x: Array, a: Array) -> tuple[Array, Array, Array]:
        """Outputs y, inputs u and law values g for given unknowns, at one instant or at k."""
        inputs, part = self._inputs, self._part
        sources = inputs.sources(t, x, self._p)
        sources[self.places] = a
        y = part.C @ x[: inputs.states] + self._D @ sources
        if self._D1 is not None:
            y = y + self._D1 @ inputs.source_rates(t, y, x, self._p)
        if self._controls.size:  # they read nothing that depends on others of their kind
            y = y + self._D[:, self._controls] @ inputs.values(t, y, x, self._p)[self._controls]
        if self._rates.size:  # of speeds, to which the laws contribute that are no loops
            y[self._rates] += self._D[np.ix_(self._rates, self._free)] @ inputs.values(t, y, x, self._p)[self._free]
        g = inputs.values(t, y, x, self._p)
        u = g.copy()
        u[self.places] = a
        return y, u, g

    def residual(self, t: Any, x: Array, a: Array) -> tuple[Array, Array]:
        """What is left of the equations, and the size of their terms; both are as a, (loops,) or (loops, k)."""
        _, u, g = self.inputs_at(t, x, a)
        left, size = a - g[self.places], np.abs(a) + np.abs(g[self.places])
        if self._tree.any():
            states = x[: self._inputs.states]
            left[self._tree] = self._P @ states + self._Q @ u - g[self.places[self._tree]]
            terms = np.abs(self._P) @ np.abs(states) + np.abs(self._Q) @ np.abs(u)
            size[self._tree] = terms + np.abs(g[self.places[self._tree]])
        return left, size + np.finfo(float).tiny

    def _by_loops(self, t: Any, x: Array, a: Array) -> tuple[Array, Array]:
        """The residual (loops, loops) and the inputs (m, loops) by the unknowns; at k instants with a last axis k."""
        unknowns = np.eye(len(self.places))
        return self._total(unknowns, self._slopes(t, x, a, self._D[:, self.places]))

    def _slopes(self, t: Any, x: Array, a: Array, through_y: Array, through_x: Array | None = None) -> Array:
        """Of all laws by q variables that move the outputs and the states; (m, q), or at k instants (m, q, k)."""
        y, _, _ = self.inputs_at(t, x, a)
        slopes = self._inputs.along(t, y, x, self._p, through_y, through_x)
        for rows, laws in ((np.arange(len(y)), self._controls), (self._rates, self._free)):
            if laws.size and rows.size:
                through = np.zeros((len(y), laws.size))
                through[rows] = self._D[np.ix_(rows, laws)]
                by_laws = self._inputs.along(t, y, x, self._p, through)
                slopes = slopes + np.einsum("mc...,cq...->mq...", by_laws, slopes[laws])
        return np.asarray(slopes)

    def _total(self, unknowns: Array, by: Array, states: Array | None = None) -> tuple[Array, Array]:
        """The residual and the inputs by q variables.

        Args:
            unknowns: (loops, q) the unknowns by them.
            by: (m, q) or (m, q, k) the laws by them.
            states: (n, q) the states by them; None where they do not move them.
        """
        unknowns = unknowns.reshape(*unknowns.shape, *(1,) * (by.ndim - 2))
        u, left = by.copy(), unknowns - by[self.places]
        u[self.places] = unknowns
        if self._tree.any():
            left[self._tree] = np.tensordot(self._Q, u, 1) - by[self.places[self._tree]]
            left[self._tree] += 0.0 if states is None else self._P @ states
        return left, u

    def jacobian(self, t: float, x: Array) -> Any:
        """d rhs / d x as scipy.sparse.csc_array (n, n)."""
        a, size, part = self.solve(t, x), self._inputs.states, self._part
        r_loop, u_loop = self._by_loops(t, x, a)
        by_state = self._slopes(t, x, a, part.C.toarray(), np.eye(size))
        r_state, u_state = self._total(np.zeros((len(a), size)), by_state, np.eye(size))
        if not (np.isfinite(r_loop).all() and np.isfinite(r_state).all()):  # lstsq would find no values
            return sparse.csc_array(np.full((size, size), np.nan))
        total = u_state - u_loop @ np.linalg.lstsq(r_loop, r_state, rcond=None)[0]
        return sparse.csc_array(part.A + part.B @ sparse.csr_array(total))


def _solved(matrix: Array, right: Array) -> Array:
    """(q,) or (q, k) solutions of one or k linear systems (q, q) or (q, q, k); NaN where there is none."""
    if len(right) == 1:
        return np.asarray(right / matrix[0])
    many = np.moveaxis(matrix, 2, 0) if matrix.ndim == 3 else matrix[None]
    finite = np.isfinite(many).all(axis=(1, 2))
    solution = np.full((len(many), len(right)), np.nan)
    solution[finite] = np.einsum("kij,jk->ki", np.linalg.pinv(many[finite]), right.reshape(len(right), -1)[:, finite])
    return solution.T.reshape(right.shape)
