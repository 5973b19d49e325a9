"""Parameter vector to numbers: coefficients of all branches and the loop matrix, vectorised over equal templates."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import isfinite
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from sympy import Expr

from shaftwork.codegen.code import scalar, vectorised
from shaftwork.core.calls import BoundedCache
from shaftwork.core.errors import ParameterError
from shaftwork.formulation.form import StateForm
from shaftwork.formulation.gains import Gain, Number, any_sum_vanishes, coefficients_in, fold, value_of
from shaftwork.formulation.tree import Row
from shaftwork.network.graph import CircuitGraph
from shaftwork.network.kinds import Kind
from shaftwork.network.templates import BranchTemplate

Array = NDArray[np.float64]
Index = NDArray[np.intp]

LINEAR = (Kind.ACROSS_STORE, Kind.THROUGH_STORE, Kind.CONDUCTANCE)
FULL = 16_000
"""Entries up to which a matrix is an array: products of small sparse matrices cost a hundred times as much, and that of
one with a state takes 2 us before it begins."""


def blocks(count: int, width: int, at_once: int = 2_000_000) -> Iterator[slice]:
    """Places 0 to `count` in blocks of `at_once` numbers, 16 MB, where each place holds `width`; at least one."""
    size = max(1, at_once // max(1, width))
    return (slice(first, min(first + size, count)) for first in range(0, max(count, 1), size))


@dataclass(frozen=True, eq=False)
class TemplateGroup:
    """All branches of one template: their numbers (k,) and where their parameters stand in p, (symbols, k)."""

    template: BranchTemplate
    branches: Index
    places: Index


def groups_of(graph: CircuitGraph, branches: Sequence[int]) -> tuple[TemplateGroup, ...]:
    """The given branches by equal law, in order of first appearance."""
    members_of: dict[tuple[Any, ...], list[int]] = {}
    for index in branches:
        template = graph.branches[index].template
        members_of.setdefault((template.kind, template.law, template.symbols), []).append(index)
    groups = []
    for members in members_of.values():
        template = graph.branches[members[0]].template
        places = [[graph.part_of(index).parameters[s.name] for index in members] for s in template.symbols]
        shape = (len(template.symbols), len(members))
        groups.append(
            TemplateGroup(template, np.array(members, dtype=np.intp), np.array(places, dtype=np.intp).reshape(shape))
        )
    return tuple(groups)


def rationals(values: Any) -> Array:
    """An array of floats or fractions as an array of fractions, which are these very numbers."""
    fractions = np.empty(np.shape(values), dtype=object)
    fractions.ravel()[:] = [Fraction(value) if value else 0 for value in np.ravel(values).tolist()]
    return fractions


def inverse_of_fractions(matrix: Array) -> Array:
    """The inverse of a regular matrix of fractions, by Gauss and Jordan."""
    size = len(matrix)
    rows = np.hstack([matrix, np.eye(size, dtype=object)])
    for k in range(size):
        pivot = k + int(np.flatnonzero(rows[k:, k])[0])
        rows[[k, pivot]] = rows[[pivot, k]]
        rows[k] = rows[k] / Fraction(rows[k, k])
        for other in np.flatnonzero(rows[:, k]):
            if other != k:
                rows[other] = rows[other] - rows[other, k] * rows[k]
    return rows[:, size:]


class Coefficients:
    """Capacity, stiffness or conductance of every linear branch as a function of the parameter vector."""

    def __init__(self, graph: CircuitGraph) -> None:
        linear = [branch.index for branch in graph.branches if branch.template.kind in LINEAR]
        self._graph, self._size = graph, len(graph.branches)
        self._groups = tuple(
            (group, vectorised(group.template.symbols, group.template.law)) for group in groups_of(graph, linear)
        )
        self.places = {place for group, _ in self._groups for place in group.places.ravel().tolist()}
        """Of the parameters that they contain."""

    def of(self, p: Array) -> Array:
        """Coefficients for (parameters,) or, (branches, k), for (parameters, k); 0 for branches that have none."""
        values = np.zeros((self._size, *p.shape[1:]))
        with np.errstate(all="ignore"):
            for group, function in self._groups:
                values[group.branches] = function(*p[group.places])
        return values

    def __call__(self, p: Array) -> Array:
        """(branches,) coefficients for (parameters,).

        Raises:
            ParameterError: one is too large or too small to compute with; names its part.
        """
        values = self.of(p)
        # Beyond it products of a few coefficients leave the range of floating-point numbers: the diameter of a shaft of
        # 1e60 m counts to the fourth power.
        farthest = 1e100
        sizes = np.abs(values)
        if (beyond := np.flatnonzero(~((values == 0) | ((sizes >= 1 / farthest) & (sizes <= farthest))))).size:
            part = self._graph.part_of(int(beyond[0]))
            raise ParameterError(
                f"{type(part.component).__name__} '{part.name}': its values make an inertia, a stiffness or a damping "
                f"of {values[beyond[0]]:.3g} in SI, the equations take sizes from {1 / farthest:g} to {farthest:g}. "
                "Look for a value in a wrong unit."
            )
        return values

    def rational(self, p: Array) -> Array:
        """The same as fractions, without any rounding where the law is rational."""
        values = rationals(np.zeros(self._size))
        exact = rationals(p)
        for group, function in self._groups:
            try:
                coefficients = function(*exact[group.places])
            except (AttributeError, TypeError):  # a root or a logarithm of a parameter
                coefficients = function(*p[group.places])
            values[group.branches] = rationals(np.broadcast_to(coefficients, group.branches.shape))
        return values


class GainMatrix:
    """A sparse matrix whose entries are whole numbers or gear ratios, as a function of the parameter vector.

    Args:
        graph: the network whose parameters the entries contain.
        entries: (row, column, entry) of every entry.
        shape: shape of the matrix.
    """

    def __init__(self, graph: CircuitGraph, entries: Sequence[tuple[int, int, Number]], shape: tuple[int, int]) -> None:
        self._rows = np.array([row for row, _, _ in entries], dtype=np.intp)
        self._columns = np.array([column for _, column, _ in entries], dtype=np.intp)
        self._data = np.array([value_of(gain) for _, _, gain in entries], dtype=float)
        self._shape = shape
        variable = [(k, gain) for k, (_, _, gain) in enumerate(entries) if isinstance(gain, Gain)]
        self._variable = np.array([k for k, _ in variable], dtype=np.intp)
        self._gains = tuple(gain for _, gain in variable)
        self._coefficients = coefficients_in(self._gains)
        names = {name: k for k, name in enumerate(graph.parameters)}
        symbols = {symbol for coefficient in self._coefficients for symbol in coefficient.free_symbols}
        ordered = sorted(symbols, key=lambda symbol: names[symbol.name])
        self._places = np.array([names[symbol.name] for symbol in ordered], dtype=np.intp)
        self._function = scalar({"p": ordered}, self._coefficients) if variable else None
        self.places = {*self._places.tolist()}
        """Of the parameters that it contains."""
        self._vanishes = BoundedCache[bytes, bool](1)

    def _values(self, p: Array) -> dict[Expr, float]:
        assert self._function is not None  # noqa: S101 (there are coefficients)
        return dict(zip(self._coefficients, self._function(p[self._places].tolist()), strict=True))

    def rational(self, p: Array) -> Array:
        """The matrix as a full array of fractions, with the products and sums of ratios not rounded."""
        data = rationals(self._data)
        if self._gains:
            assert self._function is not None  # noqa: S101 (there are coefficients)
            exact = rationals(self._function(rationals(p[self._places]).tolist()))
            values = dict(zip(self._coefficients, exact.tolist(), strict=True))
            data[self._variable] = rationals(fold(self._gains, values.__getitem__))
        matrix = rationals(np.zeros(self._shape))
        np.add.at(matrix, (self._rows, self._columns), data)
        return matrix

    def degenerates(self, p: Array) -> bool:
        """Whether ratios meet at p that differ in the network, so that other equations hold there."""
        if not self._gains:
            return False
        return self._vanishes(p[self._places].tobytes(), lambda: any_sum_vanishes(self._gains, self._values(p)))

    def __call__(self, p: Array) -> Any:
        """The matrix as scipy.sparse.csr_array."""
        data = self._data.copy()
        if self._gains:
            data[self._variable] = fold(self._gains, self._values(p).__getitem__)
        return sparse.csr_array((data, (self._rows, self._columns)), shape=self._shape)


class Factor:
    """A matrix (n, m) that multiplies states or inputs again and again: as a full array where that is quicker.

    BLAS fuses multiplication and addition, so that the difference of two equal terms is the rounding of one of them,
    and no zero. Hence only who bears that takes full arrays, and what is read at many times stays sparse.

    Args:
        matrix: as an array or one of scipy.sparse.
    """

    def __init__(self, matrix: Any) -> None:
        self.sparse = sparse.csr_array(matrix)
        self.full: Array | None = self.sparse.toarray() if np.prod(self.sparse.shape) <= FULL else None
        """The full array, where it is small enough."""
        self.is_zero = not self.sparse.nnz
        """Whether it has no entry."""

    def __matmul__(self, other: Array) -> Array:
        """Its product with (m,) or (m, k)."""
        # zeros times an infinite torque would make all speeds NaN, and not those alone on which it acts
        if self.full is None or other.ndim > 1 or not isfinite(other.dot(other)):
            return np.asarray(self.sparse @ other)
        return np.asarray(self.full.dot(other))

    def __reduce__(self) -> tuple[Any, ...]:
        return Factor, (self.sparse,)


def link_matrix(form: StateForm, rows: Mapping[int, Row]) -> GainMatrix:
    """(branches, branches) from the rows of links: of loops F, of cutsets Q.

    The entry (tree branch, link) is the factor of the tree branch in the loop of the link, or that of the link in the
    cutset of the tree branch.
    """
    size = len(form.graph.branches)
    entries = [(tree, link, gain) for link, row in rows.items() for tree, gain in row.items()]
    return GainMatrix(form.graph, entries, (size, size))


def node_matrix(form: StateForm, rows: Sequence[Row | None]) -> GainMatrix:
    """(nodes, branches) from the rows of nodes, which hold factors of tree branches.

    Of potentials: the across variable of every node from those of the tree branches. Of shares: what passes through the
    tree branches where a unit is put in at a node.
    """
    shape = (len(form.graph.nodes), len(form.graph.branches))
    entries = [(node, tree, gain) for node, row in enumerate(rows) if row is not None for tree, gain in row.items()]
    return GainMatrix(form.graph, entries, shape)
