"""Algebraic loops: nonlinear laws at massless nodes, whose torque and speed determine each other.

The unknowns a are the inputs u at the places of these laws: the through variable w of a law that is a link, the across
variable of a law that is in the tree. With g the values of all laws,

    link:  a - g(y) = 0,    tree:  P x + Q u - g(y) = 0,    y = C x + D u.

They are solved by Newton's method with the exact slopes, starting from the last solution, so that a motion stays on its
branch where there are several.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from shaftwork.codegen.elements import Array, Index
from shaftwork.codegen.inputs import Inputs
from shaftwork.codegen.matrices import LinearPart

ITERATIONS, HALVINGS = 50, 30
ROUNDING = 1e-14


class LoopSolver:
    """Solves the loops of a network for one parameter vector.

    Args:
        inputs: the laws.
        part: the linear part.
        places: where the loop laws stand in u.
        in_tree: which of them are in the tree, in the order of the rows of P and Q.
        p: parameter vector.
    """

    def __init__(self, inputs: Inputs, part: LinearPart, places: Index, in_tree: NDArray[np.bool_], p: Array) -> None:
        self._inputs, self._part, self._p = inputs, part, p
        self.places, self._tree = places, in_tree
        self._controls = np.flatnonzero(inputs.controlled)
        self._D = part.D.toarray()
        self._P, self._Q = part.tree_law_x.toarray(), part.tree_law_u.toarray()
        self._last = np.zeros(len(places))

    def solve(self, t: float, x: Array) -> Array:
        """The unknowns a (loops,) at a time and state; NaN where Newton's method finds none."""
        a = self._last
        residual, size = self.residual(t, x, a)
        for _ in range(ITERATIONS):
            if (np.abs(residual) <= ROUNDING * size).all():
                break
            slope, _ = self.slopes(t, x, a)
            step = np.linalg.lstsq(slope, -residual, rcond=None)[0]
            for _ in range(HALVINGS):
                trial, trial_size = self.residual(t, x, a + step)
                if np.linalg.norm(trial) < np.linalg.norm(residual):
                    break
                step = step / 2
            else:  # no step makes it smaller: either this is rounding, or there is no solution near
                if (np.abs(residual) <= 1e4 * ROUNDING * size).all():
                    break
                return np.full_like(a, np.nan)
            a, residual, size = a + step, trial, trial_size
        self._last = a
        return a

    def start_from(self, a: Array) -> None:
        """Begin the next solution at these unknowns."""
        self._last = a

    def inputs_at(self, t: float, x: Array, a: Array) -> tuple[Array, Array, Array]:
        """Outputs y, inputs u and law values g for given unknowns."""
        inputs, part = self._inputs, self._part
        known = np.where(inputs.of_time, inputs.values(t, np.zeros(inputs.outputs), x, self._p), 0.0)
        known[self.places] = a
        y = part.C @ x[: inputs.states] + self._D @ known
        if self._controls.size:  # they read nothing that depends on others of their kind
            y = y + self._D[:, self._controls] @ inputs.values(t, y, x, self._p)[self._controls]
        g = inputs.values(t, y, x, self._p)
        u = g.copy()
        u[self.places] = a
        return y, u, g

    def residual(self, t: float, x: Array, a: Array) -> tuple[Array, Array]:
        """What is left of the equations (loops,), and the size of their terms."""
        _, u, g = self.inputs_at(t, x, a)
        left, size = a - g[self.places], np.abs(a) + np.abs(g[self.places])
        if self._tree.any():
            states = x[: self._inputs.states]
            left[self._tree] = self._P @ states + self._Q @ u - g[self.places[self._tree]]
            terms = np.abs(self._P) @ np.abs(states) + np.abs(self._Q) @ np.abs(u)
            size[self._tree] = terms + np.abs(g[self.places[self._tree]])
        return left, size + np.finfo(float).tiny

    def slopes(self, t: float, x: Array, a: Array) -> tuple[Array, Array]:
        """The residual by a (loops, loops), and all inputs u by the states through the loops (m, n)."""
        inputs = self._inputs
        y, _, _ = self.inputs_at(t, x, a)
        by_y, by_x = (made.toarray() for made in inputs.slopes(t, y, x, self._p))
        through = by_y @ self._D[:, self._controls]
        by_state, by_loop = by_y @ self._part.C.toarray() + by_x, by_y @ self._D[:, self.places]
        by_state, by_loop = (made + through @ made[self._controls] for made in (by_state, by_loop))
        u_state, u_loop = by_state.copy(), by_loop.copy()
        u_state[self.places], u_loop[self.places] = 0.0, np.eye(len(self.places))
        r_loop, r_state = np.eye(len(self.places)) - by_loop[self.places], -by_state[self.places]
        if self._tree.any():
            tree = self.places[self._tree]
            r_loop[self._tree] = self._Q @ u_loop - by_loop[tree]
            r_state[self._tree] = self._P + self._Q @ u_state - by_state[tree]
        return r_loop, u_state - u_loop @ np.linalg.lstsq(r_loop, r_state, rcond=None)[0]

    def jacobian(self, t: float, x: Array) -> Any:
        """d rhs / d x as scipy.sparse.csc_array (n, n)."""
        _, by_state = self.slopes(t, x, self.solve(t, x))
        return sparse.csc_array(self._part.A + self._part.B @ sparse.csr_array(by_state))
