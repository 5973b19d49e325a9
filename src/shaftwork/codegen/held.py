"""Parts that hold their ends together by a torque of their own, in the equations of the network in which they slip.

A stuck friction, a locked brake and an engaged clutch pass what keeps the speed across them at zero, their reaction:

    0 = G x,    x' = A x + B u + B_H lambda,    (G B_H) lambda = -G (A x + B u),

with G the speeds across what is held, from the speeds of inertias, and lambda in the place of its law. So one set of
equations serves for whatever holds and whatever slips; an impact by which they come to one speed takes the place of
lambda in the same system. Source: Brogliato, Nonsmooth Mechanics, 2016.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import splu

from shaftwork.codegen.arrays import ArrayProgram, BoundArrays
from shaftwork.codegen.elements import Array
from shaftwork.codegen.matrices import LinearPart
from shaftwork.codegen.stores import Stores
from shaftwork.reduction.form import StateForm

SMALL = 1e-12
"""A part of the largest entry of a row that is the rounding of its elimination."""


class Joints:
    """Law branches whose torque holds the speed across them at zero.

    Args:
        form: of the equations.
        part: their matrices.
        branches: of the laws, all of them links; their speeds follow from those of the states.
    """

    def __init__(self, form: StateForm, part: LinearPart, branches: Sequence[int]) -> None:
        across, size = len(form.across_states), len(form.states)
        self.places = np.array([form.laws.index(branch) for branch in branches], dtype=np.intp)
        loops = sparse.csr_array(part.loops)[list(form.across_states)][:, list(branches)]
        none = sparse.csr_array((len(branches), size - across))
        self._G = sparse.csr_array(sparse.hstack([loops.T, none]))
        self._B = sparse.csc_array(part.B)[:, self.places]
        followers = _followers(self._G)
        self.independent = followers is not None and not self._B[across:].nnz
        """Whether each of them holds inertias that the others do not."""
        if not self.independent:
            return
        found = followers or {}
        self._solver = splu(sparse.csc_array(self._G @ self._B)) if found else None
        alike = sparse.lil_array(sparse.eye_array(size))
        for place, row in found.items():
            alike[place, place] = 0.0
            alike[place, list(row)] = list(row.values())
        self._alike = sparse.csr_array(alike)
        others = sparse.diags_array(np.where(np.isin(np.arange(part.B.shape[1]), self.places), 0.0, 1.0))
        self.moving = replace(part, A=self._held(part.A), B=self._held(part.B @ others), B1=self._held(part.B1))
        """The equations with what holds moving as one, to which its own laws add nothing."""

    def reactions(self, rates: Array) -> Array:
        """(h,) or (h, k): what cancels rates (n,) or (n, k) in the speeds across."""
        return self._cancel(self._G @ rates)

    def _cancel(self, across: Array) -> Array:
        """(h,) or (h, k): what cancels changes of the speeds across."""
        return across if self._solver is None else np.asarray(-self._solver.solve(across))

    def alike(self, x: Array) -> Array:
        """States or rates in which what is held follows the others to the last bit."""
        return np.asarray(self._alike @ x)

    def met(self, x: Array) -> Array:
        """(n,) the states after an inelastic impact that joins what is held: every momentum is kept."""
        return self.alike(x + self._B @ self.reactions(x))

    def _held(self, matrix: Any) -> Any:
        """A matrix of rates with the reactions to them."""
        across = self._G @ matrix
        met = np.unique(sparse.csr_array(across).indices)
        reactions = sparse.csr_array((len(self.places), matrix.shape[1])).tolil()
        if met.size:
            reactions[:, met] = self._cancel(across[:, met].toarray())
        return sparse.csr_array(self._alike @ (matrix + self._B @ sparse.csr_array(reactions)))


def _followers(G: Any) -> Mapping[int, Mapping[int, float]] | None:
    """For each row of G x = 0 a state that follows from others, and its gains; None where rows depend on each other."""
    found: dict[int, dict[int, float]] = {}
    for k in range(G.shape[0]):
        row: dict[int, float] = {}
        first, last = G.indptr[k : k + 2]
        for column, gain in zip(G.indices[first:last].tolist(), G.data[first:last].tolist(), strict=True):
            for place, share in found[column].items() if column in found else ((column, 1.0),):
                row[place] = row.get(place, 0.0) + gain * share
        size = max(map(abs, G.data[first:last]), default=0.0)
        row = {column: gain for column, gain in row.items() if abs(gain) > SMALL * size}
        if not row:
            return None
        pivot = max(row, key=lambda column: abs(row[column]))
        gains = {column: -gain / row[pivot] for column, gain in row.items() if column != pivot}
        for known in found.values():
            share = known.pop(pivot, 0.0)
            for column, gain in gains.items() if share else ():
                known[column] = known.get(column, 0.0) + share * gain
        found[pivot] = gains
    return found


class HeldArrays(BoundArrays):
    """The equations of a network in which law branches hold their ends together.

    Args:
        program: the equations in which all of them slip, without algebraic loops.
        p: parameters.
        part: matrices.
        joints: what holds.
    """

    def __init__(self, program: ArrayProgram, p: Array, part: LinearPart, joints: Joints) -> None:
        super().__init__(program, p, part)
        self.joints, self._moving = joints, BoundArrays(program, p, joints.moving)

    def __reduce__(self) -> tuple[Any, ...]:
        return HeldArrays, (self.program, self.p, self.part, self.joints)

    def values(self, t: Any, x: Array) -> tuple[Array, Array]:
        """Outputs y and inputs u, with reactions in the place of the laws of what holds."""
        y, u = super().values(t, x)
        u[self.joints.places] = 0.0
        u[self.joints.places] = self.joints.reactions(super().rates(t, x, y, u))
        return y, u

    def rates(self, t: Any, x: Array, y: Array, u: Array) -> Array:
        """x', in which what is held moves as one."""
        return self.joints.alike(super().rates(t, x, y, u))

    def rhs(self, t: Any, x: Array) -> Array:
        """x' at time t."""
        return self._moving.rhs(t, x)

    def jacobian(self, t: float, x: Array) -> Any:
        """d rhs / d x as scipy.sparse.csc_array (n, n)."""
        return self._moving.jacobian(t, x)


class HeldStores(Stores):
    """What is stored where inertias are held together, and each is a state all the same."""

    def states(self, bound: BoundArrays, t: float, held: Mapping[str, float]) -> Array:
        """(n,) the states that the equations start with: those of what is held come to one speed."""
        assert isinstance(bound, HeldArrays)  # noqa: S101 (equations of this kind are made with it)
        return bound.joints.met(super().states(bound, t, held))
