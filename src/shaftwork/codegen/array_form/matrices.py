"""The linear part of a network as sparse matrices of the parameter vector.

    x' = A x + B u + B1 u',    y = C x + D u + D1 u',    u = (w, e)

with w the through variables of the nonlinear laws and sources, e the prescribed across variables, y the across
variables that the laws and the integrals read, and after them what laws read of others, rates of speeds at last. The
equations are those of `formulation.form`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.csgraph import connected_components

from shaftwork.codegen.array_form.elements import (
    FULL,
    Array,
    Coefficients,
    Factor,
    GainMatrix,
    inverse_of_fractions,
    link_matrix,
    node_matrix,
)
from shaftwork.core.calls import BoundedCache
from shaftwork.core.errors import CompileError
from shaftwork.formulation.form import StateForm
from shaftwork.formulation.value_diagnosis import is_singular
from shaftwork.network.kinds import Kind


@dataclass(frozen=True, eq=False)
class LinearPart:
    """The matrices above (scipy.sparse.csr_array), the maps needed to recover eliminated quantities, and F itself.

    Args:
        A: (n, n); B, B1: (n, m); C: (k, n); D, D1: (k, m), with n states, m inputs, k outputs y.
        conductance_x: (tree conductances, n) their across variables from the states.
        conductance_u: (tree conductances, m) the same from the inputs.
        tree_law_x: (tree laws, n) what the cutsets of the laws in the tree leave for their through variables.
        tree_law_u: (tree laws, m) the same from the inputs.
        loops: F (branches, branches).
        cutsets: Q (branches, branches); F itself where no coupling loses power.
        coefficients: (branches,) capacities, stiffnesses and conductances.
    """

    A: Any
    B: Any
    B1: Any
    C: Any
    D: Any
    D1: Any
    conductance_x: Any
    conductance_u: Any
    tree_law_x: Any
    tree_law_u: Any
    loops: Any
    cutsets: Any
    coefficients: Array

    @cached_property
    def factors(self) -> tuple[Factor, ...]:
        """A, B, B1, C and D for many products with one state each."""
        return tuple(map(Factor, (self.A, self.B, self.B1, self.C, self.D)))


class MatrixAssembly:
    """Makes the `LinearPart` of a state form for any parameter vector.

    Args:
        form: the state form.
        outputs: branches whose across variables make up y.
    """

    def __init__(self, form: StateForm, outputs: Sequence[int]) -> None:
        self.form = form
        self.outputs = np.array(outputs, dtype=np.intp)
        self.coefficients = Coefficients(form.graph)
        self.loops = link_matrix(form, form.tree.loops)
        self.cutsets = link_matrix(form, form.tree.cutsets) if form.loses_power else self.loops
        self.inputs = np.array([*form.laws, *form.across_inputs], dtype=np.intp)
        gains = (self.loops, self.cutsets, *([self.potentials] if form.readings else []))
        self._places = sorted(self.coefficients.places.union(*(matrix.places for matrix in gains)))
        self._last = BoundedCache[bytes, LinearPart](1)

    @cached_property
    def potentials(self) -> GainMatrix:
        """(nodes, branches): the across variable of every node from those of the tree branches."""
        return node_matrix(self.form, self.form.tree.potentials)

    def degenerates(self, p: Array) -> bool:
        """Whether ratios meet at p that differ in the network, so that other equations hold there."""
        return self.loops.degenerates(p) or (self.cutsets is not self.loops and self.cutsets.degenerates(p))

    def __call__(self, p: Array) -> LinearPart:
        """Assemble for the parameter vector p; the last one is kept, as many a parameter stands in laws alone.

        Raises:
            CompileError: a block of the algebraic equations is singular for these values; names its branches.
        """
        return self._last(p[self._places].tobytes(), lambda: self._sparse(p))

    def _sparse(self, p: Array) -> LinearPart:
        part = self._assembled(lambda entries: entries(p))
        fields = {field.name: getattr(part, field.name) for field in dataclasses.fields(part)}
        return LinearPart(
            **{name: matrix if name == "coefficients" else sparse.csr_array(matrix) for name, matrix in fields.items()}
        )

    def rational(self, p: Array) -> LinearPart:
        """The same as full arrays of fractions: nothing is rounded, so nothing cancels."""
        return self._assembled(lambda entries: entries.rational(p))

    def _assembled(self, evaluated: Callable[[Any], Any]) -> LinearPart:
        """The matrices from evaluated coefficients, loops and cutsets."""
        F, k = evaluated(self.loops), evaluated(self.coefficients)
        Q = F if self.cutsets is self.loops else evaluated(self.cutsets)
        blocks = _MatrixBlocks(self.form, F, Q, len(self.inputs))
        # across variables of the tree conductances from states and inputs
        link_g = blocks.diagonal(k[blocks.R])
        conductance = blocks.diagonal(k[blocks.G]) + blocks.Q("G", "R") @ link_g @ blocks.F("G", "R").T
        solve_conductances = self._inverse(blocks, conductance, blocks.G, "conductance")
        drive_x = blocks.Q("G", "R") @ link_g @ blocks.across_x("R") + blocks.Q("G", "L") @ blocks.pick("L")
        drive_u = blocks.Q("G", "R") @ link_g @ blocks.across_u("R") + blocks.Q("G", "W") @ blocks.input("W")
        g_x, g_u = -solve_conductances @ drive_x, -solve_conductances @ drive_u
        r_x = link_g @ (blocks.across_x("R") + blocks.F("G", "R").T @ g_x)
        r_u = link_g @ (blocks.across_u("R") + blocks.F("G", "R").T @ g_u)
        # torque balance of the tree capacities
        K = blocks.diagonal(k[blocks.K])
        mass = blocks.diagonal(k[blocks.C]) + blocks.Q("C", "K") @ K @ blocks.F("C", "K").T
        to_speed = self._inverse(blocks, mass, blocks.C, "inertia")
        c_x = -to_speed @ (blocks.Q("C", "R") @ r_x + blocks.Q("C", "L") @ blocks.pick("L"))
        c_u = -to_speed @ (blocks.Q("C", "R") @ r_u + blocks.Q("C", "W") @ blocks.input("W"))
        c_du = -to_speed @ blocks.Q("C", "K") @ K @ blocks.F("E", "K").T @ blocks.input("E")
        # speed balance of the loops with compliances
        S = blocks.diagonal(1 / k[blocks.S])
        compliance = blocks.diagonal(1 / k[blocks.L]) + blocks.F("S", "L").T @ S @ blocks.Q("S", "L")
        to_torque = self._inverse(blocks, compliance, blocks.L, "compliance")
        l_x = to_torque @ (blocks.across_x("L") + blocks.F("G", "L").T @ g_x)
        l_u = to_torque @ (blocks.across_u("L") + blocks.F("G", "L").T @ g_u)
        l_du = -to_torque @ blocks.F("S", "L").T @ S @ blocks.Q("S", "W") @ blocks.input("W")
        # through variables that the cutsets of tree laws ask of them
        t_x = -(blocks.Q("T", "R") @ r_x + blocks.Q("T", "L") @ blocks.pick("L"))
        t_u = -(blocks.Q("T", "R") @ r_u + blocks.Q("T", "W") @ blocks.input("W"))
        C, D = blocks.output_rows(self.outputs, g_x, g_u)
        z_x, z_u = blocks.integral_rows(self.outputs, C, D)
        if self.form.readings:
            C, D = blocks.with_readings(C, D, evaluated(self.potentials), (g_x, g_u), (r_x, r_u))
        rate_x, rate_u, rate_du = blocks.rate_rows(c_x, c_u, c_du)
        D1 = blocks.stack([blocks.nothing(*D.shape), rate_du])
        return LinearPart(
            A=blocks.stack([c_x, l_x, z_x]),
            B=blocks.stack([c_u, l_u, z_u]),
            B1=blocks.stack([c_du, l_du, blocks.nothing(*z_u.shape)]),
            C=blocks.stack([C, rate_x]),
            D=blocks.stack([D, rate_u]),
            D1=D1,
            conductance_x=g_x,
            conductance_u=g_u,
            tree_law_x=t_x,
            tree_law_u=t_u,
            loops=F,
            cutsets=Q,
            coefficients=k,
        )

    def _inverse(self, blocks: _MatrixBlocks, matrix: Any, branches: NDArray[np.intp], what: str) -> Any:
        """The inverse, block by block of connected unknowns; diagonal where nothing is coupled."""
        if blocks.rational:
            return inverse_of_fractions(matrix)
        diagonal = matrix.diagonal()
        if (matrix != 0).sum() == (diagonal != 0).sum():
            if (bad := np.flatnonzero(diagonal == 0)).size:
                raise self._singular(branches[bad[:1]], what)
            return blocks.diagonal(1 / diagonal)
        matrix = sparse.csr_array(matrix)
        count, label = connected_components(matrix, directed=False)
        order = np.argsort(label, kind="stable")
        starts = np.searchsorted(label[order], np.arange(count + 1))
        rows, columns, data = [], [], []
        for first, last in pairwise(starts):
            members = order[first:last]
            block = matrix[members][:, members].toarray()
            scale = 1 / np.sqrt(np.abs(np.diag(block)) + np.finfo(float).tiny)
            scaled = block * scale[:, None] * scale[None, :]
            if is_singular(block):
                raise self._singular(branches[members], what)
            inverse = np.linalg.inv(scaled) * scale[:, None] * scale[None, :]
            rows.append(np.repeat(members, len(members)))
            columns.append(np.tile(members, len(members)))
            data.append(inverse.ravel())
        entries = (np.concatenate(data), (np.concatenate(rows), np.concatenate(columns)))
        return blocks.own(sparse.csr_array(entries, shape=matrix.shape))

    def _singular(self, branches: NDArray[np.intp], what: str) -> CompileError:
        names = ", ".join(f"'{name}'" for name in dict.fromkeys(self.form.graph.part_of(int(b)).name for b in branches))
        return CompileError(
            f"The {what} matrix of the parts {names} is singular for these values, so their speeds are not determined. "
            f"Give one of their nodes an inertia, or change the values that cancel."
        )


class _MatrixBlocks:
    """The blocks of F and Q by group, and the rows that pick states and inputs."""

    def __init__(self, form: StateForm, loops: Any, cutsets: Any, inputs: int) -> None:
        groups = {
            "C": form.across_states,
            "L": form.through_states,
            "E": form.across_inputs,
            "T": form.tree.tree[Kind.LAW],
            "G": form.tree_conductances,
            "R": form.link_conductances,
            "K": form.dependent_across,
            "S": form.dependent_through,
            "W": form.laws,
        }
        self._groups = {name: np.array(members, dtype=np.intp) for name, members in groups.items()}
        self.rational = isinstance(loops, np.ndarray)
        self._small = self.rational or np.prod(loops.shape) <= FULL
        self._number: type = object if self.rational else float
        self._loops = self.own(loops)
        self._cutsets = self._loops if cutsets is loops else self.own(cutsets)
        self._cache: dict[tuple[bool, str, str], Any] = {}
        self._integral_places, self._readings = form.integral_places, form.readings
        self._states, self._inputs = len(form.states), inputs

    def __getattr__(self, name: str) -> NDArray[np.intp]:
        return self._groups[name]

    def own(self, matrix: Any) -> Any:
        """A sparse matrix as an array, where the network is small."""
        return matrix.toarray() if self._small and sparse.issparse(matrix) else matrix

    def diagonal(self, values: Array) -> Any:
        """A diagonal matrix."""
        return np.diag(values) if self._small else sparse.diags_array(values, format="csr")

    def nothing(self, *shape: int) -> Any:
        """A matrix of zeros."""
        return np.zeros(shape, dtype=self._number) if self._small else sparse.csr_array(shape)

    def stack(self, matrices: Sequence[Any]) -> Any:
        """Matrices one below the other."""
        return np.vstack(matrices) if self._small else sparse.vstack(matrices, format="csr")

    def F(self, tree: str, link: str) -> Any:
        """The block of the loop matrix between two groups."""
        return self._block(self._loops, tree, link)

    def Q(self, tree: str, link: str) -> Any:
        """The block of the cutset matrix between two groups."""
        return self._block(self._cutsets, tree, link)

    def _block(self, matrix: Any, tree: str, link: str) -> Any:
        key = (matrix is self._loops, tree, link)
        if key not in self._cache:
            self._cache[key] = matrix[self._groups[tree]][:, self._groups[link]]
        return self._cache[key]

    def pick(self, group: str) -> Any:
        """(group, n) rows that pick the states of C or L."""
        size = len(self._groups[group])
        offset = 0 if group == "C" else len(self.C)
        return self._selection(np.arange(size) + offset, self._states)

    def input(self, group: str) -> Any:
        """(group, m) rows that pick the inputs w or e."""
        size = len(self._groups[group])
        offset = 0 if group == "W" else len(self.W)
        return self._selection(np.arange(size) + offset, self._inputs)

    def across_x(self, link: str) -> Any:
        """(link, n) across variables of the links, from the states alone."""
        return self.F("C", link).T @ self.pick("C")

    def across_u(self, link: str) -> Any:
        """(link, m) across variables of the links, from the prescribed speeds alone."""
        return self.F("E", link).T @ self.input("E")

    def output_rows(self, outputs: NDArray[np.intp], g_x: Any, g_u: Any) -> tuple[Any, Any]:
        """C and D: the across variables of the output branches, each a link or a tree branch."""
        links = self._loops[:, outputs].T
        columns = self._selection(outputs, self._loops.shape[0])
        return self._of_tree(links + columns, g_x, g_u)  # a tree branch has no loop: its own column stands for it

    def _of_tree(self, rows: Any, g_x: Any, g_u: Any) -> tuple[Any, Any]:
        """Sums of across variables of tree branches, from states and inputs."""
        x = rows[:, self.C] @ self.pick("C") + rows[:, self.G] @ g_x
        u = rows[:, self.E] @ self.input("E") + rows[:, self.G] @ g_u
        return x, u

    def with_readings(
        self, C: Any, D: Any, potentials: Any, across: tuple[Any, Any], through: tuple[Any, Any]
    ) -> tuple[Any, Any]:
        """C and D with the rows of what controlled sources read below them.

        Args:
            C, D: the rows before them.
            potentials: of the nodes.
            across: of the tree conductances, from states and inputs.
            through: of the link conductances, likewise.
        """
        nodes, stores, integrals = (
            np.array([reading.of for reading in self._readings if reading.kind == kind], dtype=np.intp)
            for kind in ("across", "through", "integral")
        )
        across_x, across_u = self._of_tree(self.own(potentials[nodes]), *across)
        carried = self._selection(stores, self._loops.shape[0]) - self._cutsets[stores]  # -Q in a tree
        through_x = carried[:, self.L] @ self.pick("L") + carried[:, self.R] @ through[0]
        through_u = carried[:, self.W] @ self.input("W") + carried[:, self.R] @ through[1]
        places = np.array([self._integral_places[int(branch)] for branch in integrals], dtype=np.intp)
        angles = self._selection(places, self._states)
        none = self.nothing(len(integrals), self._inputs)
        return self.stack([C, across_x, through_x, angles]), self.stack([D, across_u, through_u, none])

    def rate_rows(self, c_x: Any, c_u: Any, c_du: Any) -> tuple[Any, Any, Any]:
        """The rates of what is across links that laws read, from those of the states and of the prescribed speeds."""
        links = [reading.of for reading in self._readings if reading.kind == "rate"]
        rows = self._loops[:, np.array(links, dtype=np.intp)].T
        stores = rows[:, self.C]
        return stores @ c_x, stores @ c_u, stores @ c_du + rows[:, self.E] @ self.input("E")

    def integral_rows(self, outputs: NDArray[np.intp], C: Any, D: Any) -> tuple[Any, Any]:
        """The rows z' = y of the integrals."""
        place = {int(branch): k for k, branch in enumerate(outputs)}
        rows = np.array([place[branch] for branch in self._integral_places], dtype=np.intp)
        return C[rows], D[rows]

    def _selection(self, columns: NDArray[np.intp], width: int) -> Any:
        if self._small:
            return np.eye(width, dtype=self._number)[columns]
        size = len(columns)
        return sparse.csr_array((np.ones(size), (np.arange(size), columns)), shape=(size, width))
