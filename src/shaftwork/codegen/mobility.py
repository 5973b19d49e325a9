"""How speeds across parts change by impulses through them, and the impulses that keep contacts from closing further.

Impulses lambda at pairs of nodes change the speeds v of inertias at once, and no torque counts beside them:

    M (v' - v) = S' lambda,    u = R v + R_E e,    u' = u + W lambda,    W = R M^-1 S',

with M the inertias in the states and of all that turns with them, R and R_E the speeds across the pairs from those of
the states and from prescribed ones, and S the shares of impulses that arrive at the states: R itself but where a
coupling loses power. Contacts press and never pull: lambda >= 0, w = W lambda + q >= 0, lambda w = 0, a linear
complementarity problem. Source: Brogliato, Nonsmooth Mechanics, 2016, section 5.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import ROUNDING, Array
from shaftwork.formulation.form import StateForm
from shaftwork.network.graph import GROUND
from shaftwork.network.kinds import Kind

ROUNDED = 1e-9
"""A part of the largest speed by which contacts may close after an impact: impulses that share it are rounded."""
LEAST = 1e-10
"""What is added to the diagonal of a matrix of ones, so that of many solutions the least one is found."""
WITHOUT_INERTIA = (Kind.CONDUCTANCE, Kind.LAW, Kind.THROUGH_STORE)
"""Kinds of tree branches whose across variables follow from torques."""


class Mobility:
    """The answer of a network to impulses at pairs of nodes.

    Args:
        form: the equations.
        bound: the same with their parameters.
        nodes: (nodes, branches) the across variables of nodes from those of tree branches.
        shares: (nodes, branches) what passes through tree branches where a unit is put in at nodes.
        pairs: first and second node of each pair; +lambda raises the speed of the first one.
    """

    def __init__(
        self, form: StateForm, bound: BoundArrays, nodes: Array, shares: Array, pairs: Sequence[tuple[int, int]]
    ) -> None:
        part, k = bound.part, bound.part.coefficients
        across, links = list(form.across_states), list(form.dependent_across)
        massless = [branch for kind in WITHOUT_INERTIA for branch in form.tree.tree[kind]]
        rows, pushes = _rows(nodes, pairs), _rows(shares, pairs)
        self.has_inertia: NDArray[np.bool_] = ~(rows[:, massless] != 0).any(axis=1)
        """(pairs,) whether the speeds of inertias and prescribed ones tell the speed across; else no impulse passes."""
        rows[~self.has_inertia] = pushes[~self.has_inertia] = 0.0
        loops, cutsets = part.loops[across][:, links].toarray(), part.cutsets[across][:, links].toarray()
        mass = np.diag(k[across]) + cutsets * k[links] @ loops.T
        self._pushes, self._answers = pushes, np.linalg.solve(mass, pushes[:, across].T)
        self.W = rows[:, across] @ self._answers
        """(pairs, pairs) changes of the speeds across by unit impulses."""

    def moved(self, x: Array, impulses: Array) -> Array:
        """(n,) the states after impulses (pairs,)."""
        new = x.copy()
        new[: len(self._answers)] += self._answers @ impulses
        return new

    def through(self, impulses: Array) -> Array:
        """(branches,) what of impulses (pairs,) passes through tree branches, beside what dependent inertias take."""
        return np.asarray(impulses @ self._pushes)


def _rows(nodes: Array, pairs: Sequence[tuple[int, int]]) -> Array:
    """(pairs, branches) differences of the rows of nodes; that of the ground is zero."""
    ground = np.zeros(nodes.shape[1])
    ends = [[ground if node == GROUND else nodes[node] for node in pair] for pair in pairs]
    return np.array([plus - minus for plus, minus in ends]).reshape(len(pairs), nodes.shape[1])


def complementary(W: Array, q: Array) -> Array | None:
    """(m,) lambda >= 0 with w = W lambda + q >= 0 and lambda w = 0, or None where there is none.

    W is symmetric and positive semidefinite, so it is the least square of what A lambda leaves of b with W = A' A,
    q = -A' b, solved by an active set. W lambda is unique, and so are speeds. Where lambda is not, as of contacts side
    by side, it is the least one, which they share: their order says nothing. Beside couplings that lose
    power W is not symmetric: the same active set is sought, and None says as well that it was not found.

    Source: Lawson and Hanson, Solving Least Squares Problems, 1974, chapter 23.
    """
    scale = np.diag(W)
    if (q[scale <= 0] < 0).any():
        return None
    scale = np.where(scale > 0, 1 / np.sqrt(np.where(scale > 0, scale, 1.0)), 0.0)
    V, b = W * scale[:, None] * scale, q * scale
    pressed = _pressed(V + LEAST * np.eye(len(q)), b)
    if pressed is None:
        return None
    shares = np.zeros(len(q))
    shares[pressed] = np.linalg.lstsq(V[np.ix_(pressed, pressed)], -b[pressed], rcond=ROUNDING)[0]
    keeps = V @ shares + b > -ROUNDED * np.abs(b).max(initial=0.0)
    return np.maximum(shares, 0.0) * scale if keeps.all() else None


def _pressed(V: Array, b: Array) -> NDArray[np.bool_] | None:
    """(m,) where lambda > 0, for a positive definite matrix; None where rounding hides it."""
    least = ROUNDING * np.abs(b).max(initial=0.0)
    impulses, active = np.zeros(len(b)), np.zeros(len(b), dtype=bool)
    for _ in range(3 * len(b) + 1):
        w = np.where(active, 0.0, V @ impulses + b)
        if not (w < -least).any():
            return active
        active[np.argmin(w)] = True
        while True:
            wanted = np.zeros(len(b))
            wanted[active] = np.linalg.solve(V[np.ix_(active, active)], -b[active])
            pulls = active & (wanted <= 0)
            if not pulls.any():
                break
            shares = impulses[pulls] / (impulses[pulls] - wanted[pulls])
            impulses += shares.min() * (wanted - impulses)
            active &= ~(pulls & (impulses <= ROUNDING * np.abs(impulses).max(initial=0.0)))
            impulses[~active] = 0.0
        impulses = wanted
    return None
