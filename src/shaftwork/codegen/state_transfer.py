"""All that is stored, in whichever states a set of equations carries it: what goes over when the equations change.

Where two inertias become joined or let go, the states are other ones. What goes over is the speed of every inertia, the
torque of every spring, every angle. New equations take it up with the least change that they admit, x such that

    (C + Q_CK K F_CK') x_C = C v_C + Q_CK K (v_K - F_EK' e),
    (1/L + F_SL' Q_SL / S) x_L = i_L / L - F_SL' (i_S + Q_SW w) / S,

which is an inelastic impact: it keeps every momentum that nothing outside takes away.

Beside it stands how speeds across parts change by impulses, and which impulses keep contacts from closing further.
Impulses lambda at pairs of nodes change the speeds v of inertias at once, and no torque counts beside them:

    M (v' - v) = S' lambda,    u = R v + R_E e,    u' = u + W lambda,    W = R M^-1 S',

with M the inertias in the states and of all that turns with them, R and R_E the speeds across the pairs from those of
the states and from prescribed ones, and S the shares of impulses that arrive at the states: R itself but where a
coupling loses power. Contacts press and never pull: lambda >= 0, w = W lambda + q >= 0, lambda w = 0, a linear
complementarity problem. Source: Brogliato, Nonsmooth Mechanics, 2016, section 5.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.array_form.matrices import LinearPart
from shaftwork.codegen.array_form.recovery import BranchHistory
from shaftwork.core.calls import BoundedCache
from shaftwork.core.errors import CompileError
from shaftwork.formulation.form import StateForm, store_name
from shaftwork.network.graph import GROUND
from shaftwork.network.kinds import Kind
from shaftwork.numerics.tolerances import SAME, TYPED


class StateTransfer:
    """What one set of equations stores, and how its states follow from that.

    Args:
        form: the state form.
    """

    def __init__(self, form: StateForm) -> None:
        self._form = form
        kinds = (Kind.ACROSS_STORE, Kind.THROUGH_STORE)
        stores = (branch for branch in form.graph.branches if branch.template.kind in kinds)
        self.branches = {store_name(form.graph, store): store.index for store in stores}
        """The branch of every store."""
        angles = tuple(state.name for state in form.states if state.kind == "integral")
        self.names = (*self.branches, *angles)
        """Every store and angle, named as a state whether it is one or not."""
        templates = ((name, form.graph.branches[k].template) for name, k in self.branches.items())
        self.through = tuple(name for name, template in templates if template.kind is Kind.THROUGH_STORE)
        """Those of the names that are torques of springs or currents of inductors."""
        self._states = [state.name for state in form.states]
        self._to_stores, self._to_states = (
            BoundedCache[LinearPart, Array](1),
            BoundedCache[LinearPart, tuple[Array, Array]](1),
        )

    @cached_property
    def _columns(self) -> list[int]:
        return [self._states.index(name) if name in self._states else -1 for name in self.names]

    @cached_property
    def by_loops(self) -> bool:
        """Whether all stores follow from the states by loops and cutsets alone, whatever the laws are."""
        form, loops = self._form, self._form.tree.loops
        sources = {*form.across_inputs, *form.tree_conductances}  # only asked for membership
        driven = {tree for law in form.laws for tree in form.tree.cutsets[law]}
        across = all(sources.isdisjoint(loops[k]) for k in form.dependent_across)
        return across and driven.isdisjoint(form.dependent_through)

    def of(self, bind: Callable[[], BoundArrays], t: Array, x: Array) -> Array:
        """(k, stores) all that is stored, in the order of `names`, at times (k,) and states (k, n).

        The equations are bound only where some store is no state.
        """
        if -1 not in self._columns:
            return x[:, self._columns]
        if not self.by_loops:
            return self._recovered(bind(), t, x)
        part = bind().part
        return x[:, : len(self._states)] @ self._to_stores(part, lambda: self._store_map(part))  # waves may follow

    def at_once(self, bind: Callable[[], BoundArrays], t: float, x: Array) -> dict[str, float]:
        """All that is stored at one time in s with the states (n,), by name; without full matrices."""
        values = x[self._columns] if -1 not in self._columns else self._recovered(bind(), np.array([t]), x[None, :])[0]
        return dict(zip(self.names, values.tolist(), strict=True))

    def _store_map(self, part: LinearPart) -> Array:
        """(n, stores) what states are multiplied by, where stores follow from loops and cutsets alone."""
        form, matrix, (loops, cutsets) = self._form, np.zeros((len(self._states), len(self.names))), _full(part)
        for column, (name, state) in enumerate(zip(self.names, self._columns, strict=True)):
            if state >= 0:
                matrix[state, column] = 1.0
            elif (branch := self.branches[name]) in form.tree.loops:
                matrix[form.speeds, column] = loops[list(form.across_states), branch]
            else:
                matrix[form.torques, column] = -cutsets[branch, list(form.through_states)]
        return matrix

    def _recovered(self, bound: BoundArrays, t: Array, x: Array) -> Array:
        history, columns = BranchHistory(bound, t, x), []
        for name, column in zip(self.names, self._columns, strict=True):
            if column >= 0:
                columns.append(x[:, column])
                continue
            branch = self.branches[name]
            is_across = self._form.graph.branches[branch].template.kind is Kind.ACROSS_STORE
            columns.append((history.across if is_across else history.through)[branch])
        return np.array(columns).T

    def states(self, bound: BoundArrays, t: float, stored: Mapping[str, float]) -> Array:
        """(n,) the states that the equations start with.

        Args:
            bound: the equations with their parameters.
            t: time in s at which inputs are read.
            stored: all that was stored, by name.
        """
        if not (self._form.dependent_across or self._form.dependent_through):
            return np.array([stored[name] for name in self._states])
        by_stores, by_inputs = self._to_states(
            bound.part, lambda: self._state_maps(bound.part.coefficients, *_full(bound.part))
        )
        x = by_stores @ np.array([stored[name] for name in self.names])
        if by_inputs.any():
            x += by_inputs @ bound.program.inputs.sources(t, x, bound.p)
        return np.asarray(x)

    @cached_property
    def by_inertias(self) -> bool:
        """Whether the states that the equations start with follow from what is stored, by inertias alone."""
        return not (self._form.dependent_through or self._form.across_inputs)

    def taken_up(self, bound: BoundArrays, p: Array, stored: Array) -> Array:
        """(n, k) the states that equations start with which are `by_inertias`.

        Args:
            bound: the equations with their parameters, of which the ratios are taken.
            p: (parameters, k).
            stored: (stores, k) all that was stored.
        """
        by_stores, _ = self._state_maps(bound.program.assembly.coefficients.of(p).T, *_full(bound.part))
        x = np.zeros((by_stores.shape[1], stored.shape[1]))
        for store, values in enumerate(stored):  # one after the other: the sum of a network is that of it alone
            x += by_stores[:, :, store].T * values
        return x

    def _state_maps(self, k: Array, loops: Array, cutsets: Array) -> tuple[Array, Array]:
        """(n, stores) and (n, m) what stores and inputs are multiplied by in the states that equations start with.

        Args:
            k: (branches,) coefficients, or those of many networks, (..., branches): then all comes for each.
            loops, cutsets: F and Q.
        """
        form, laws, many = self._form, len(self._form.laws), k.shape[:-1]
        size, angles, stores = len(form.states), len(form.integrals), len(self.branches)
        by_branches = np.zeros((*many, size, k.shape[-1]))
        by_inputs = np.zeros((*many, size, laws + len(form.across_inputs)))
        across, through = list(form.across_states), list(form.through_states)
        speeds, torques = form.speeds, form.torques
        by_branches[..., speeds, across] = np.eye(len(across))
        by_branches[..., torques, through] = np.eye(len(through))
        if other := list(form.dependent_across):
            F, Q = (matrix[np.ix_(across, other)] for matrix in (loops, cutsets))
            own, others = k[..., None, across], k[..., None, other]
            taken_up = np.linalg.inv(own * np.eye(len(across)) + Q * others @ F.T)
            by_branches[..., speeds, across], by_branches[..., speeds, other] = taken_up * own, taken_up @ Q * others
            inputs = loops[np.ix_(list(form.across_inputs), other)]
            by_inputs[..., speeds, laws:] = -by_branches[..., speeds, other] @ inputs.T
        if other := list(form.dependent_through):
            F, Q = (matrix[np.ix_(other, through)] for matrix in (loops, cutsets))
            own, others = k[..., None, through], k[..., None, other]
            taken_up = np.linalg.inv(np.eye(len(through)) / own + F.T / others @ Q)
            by_branches[..., torques, through] = taken_up / own
            by_branches[..., torques, other] = -taken_up @ F.T / others
            inputs = cutsets[np.ix_(other, list(form.laws))]
            by_inputs[..., torques, :laws] = by_branches[..., torques, other] @ inputs
        by_stores = np.zeros((*many, size, len(self.names)))
        by_stores[..., :stores] = by_branches[..., list(self.branches.values())]
        by_stores[..., size - angles :, stores:] = np.eye(angles)
        return by_stores, by_inputs

    def energy(self, bound: BoundArrays, stored: Mapping[str, float]) -> float:
        """What is stored, in J: k v^2 / 2 in inertias and masses, tau^2 / 2 c in springs."""
        energy = 0.0
        for name, branch in self.branches.items():
            coefficient = float(bound.part.coefficients[branch])
            energy += 0.5 * stored[name] ** 2 * (1 / coefficient if name in self.through else coefficient)
        return energy

    def momentum(self, bound: BoundArrays, stored: Mapping[str, float]) -> float:
        """The largest momentum of an inertia or mass: by what part of it an impulse is uncertain."""
        inertias = (pair for pair in self.branches.items() if pair[0] not in self.through)
        return max((abs(float(bound.part.coefficients[k]) * stored[name]) for name, k in inertias), default=0.0)

    def mobility(self, bound: BoundArrays, pairs: Sequence[tuple[int, int]]) -> Mobility:
        """The answer to impulses at pairs of nodes.

        Raises:
            CompileError: an inertia changes with its angle or time, whose value at the instant it would need.
        """
        if self._form.inertial:
            part = self._form.graph.part_of(self._form.inertial[0]).name
            raise CompileError(f"An impulse meets '{part}', whose inertia changes: no impact can be told there.")
        program = bound.program
        nodes, shares = (matrix(bound.p).toarray() for matrix in (program.assembly.potentials, program.shares))
        return Mobility(self._form, bound, nodes, shares, pairs)

    def impulses(self, bound: BoundArrays, gained: Mapping[str, float]) -> Array:
        """(branches,) what passes through every branch at once where stores gain so much; of a coupling its lambda.

        Law: i_K = K (v_K' - v_K), and -Q_K i_K in the tree; beside it no torque counts.
        """
        links = np.zeros(len(self._form.graph.branches))
        for name, branch in self.branches.items():
            if branch in self._form.dependent_across:
                links[branch] = bound.part.coefficients[branch] * gained[name]
        return np.asarray(links - bound.part.cutsets @ links)

    def turns(self, bound: BoundArrays, gained: Mapping[str, float]) -> Array:
        """(branches,) how far every branch turns at once where stores gain so much.

        Law: psi_S = (i_S' - i_S) / S, and F' psi_S among the links; beside it no speed counts.
        """
        tree = np.zeros(len(self._form.graph.branches))
        for name, branch in self.branches.items():
            if branch in self._form.dependent_through:
                tree[branch] = gained[name] / bound.part.coefficients[branch]
        return np.asarray(tree + bound.part.loops.T @ tree)

    def given(
        self, bound: BoundArrays, u: Array, gained: Mapping[str, float], further: Array | float = 0.0
    ) -> dict[str, float]:
        """What ideal sources give at once, in J by part, where stores gain so much in these equations.

        Law: E = -w psi_W - e i_E: a torque times the angle by which its source turns, and a speed times the impulse
        that passes through its source.

        Args:
            bound: the equations with their parameters.
            u: (inputs,) torques w and speeds e of the sources.
            gained: by every store, by name.
            further: (branches,) impulses that pass beside those that stores take.
        """
        form, energies = self._form, dict[str, float]()
        laws, speeds = np.split(u, [len(form.laws)])
        pairs: list[tuple[int, float]] = []
        if form.dependent_through:
            pairs += zip(form.laws, laws * self.turns(bound, gained)[list(form.laws)], strict=True)
        if form.across_inputs:
            impulses = self.impulses(bound, gained) + further
            pairs += zip(form.across_inputs, speeds * impulses[list(form.across_inputs)], strict=True)
        for branch, taken in pairs:
            part = form.graph.part_of(branch).name
            energies[part] = energies.get(part, 0.0) - float(taken)
        return {part: energy for part, energy in energies.items() if energy}


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
    # V has ones on its diagonal: with a little more there, the least of many solutions is found.
    pressed = _pressed(V + 1e-10 * np.eye(len(q)), b)
    if pressed is None:
        return None
    shares = np.zeros(len(q))
    shares[pressed] = np.linalg.lstsq(V[np.ix_(pressed, pressed)], -b[pressed], rcond=SAME)[0]
    keeps = V @ shares + b > -TYPED * np.abs(b).max(initial=0.0)
    return np.maximum(shares, 0.0) * scale if keeps.all() else None


def _pressed(V: Array, b: Array) -> NDArray[np.bool_] | None:
    """(m,) where lambda > 0, for a positive definite matrix; None where rounding hides it."""
    least = SAME * np.abs(b).max(initial=0.0)
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
            active &= ~(pulls & (impulses <= SAME * np.abs(impulses).max(initial=0.0)))
            impulses[~active] = 0.0
        impulses = wanted
    return None


def _full(part: LinearPart) -> tuple[Array, Array]:
    """Loops and cutsets as full arrays."""
    loops: Array = part.loops.toarray()
    return loops, loops if part.cutsets is part.loops else part.cutsets.toarray()
