"""The matrices of Kirchhoff's laws, with the names of their rows and columns."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from sympy import Add, Expr, ImmutableMatrix, Integer

from shaftwork.equations.assembly import Assembly
from shaftwork.formulation.form import branch_name
from shaftwork.network.graph import CircuitGraph
from shaftwork.network.kinds import Kind


@dataclass(frozen=True, eq=False)
class NamedMatrix:
    """A matrix whose entries are read by names, `matrix["a", "shaft.tau_c"]`.

    Args:
        rows: names.
        columns: names of branches, by what passes through them.
        matrix: the entries: 1, -1, 0, and ratios of gears.
    """

    rows: tuple[str, ...]
    columns: tuple[str, ...]
    matrix: ImmutableMatrix

    @cached_property
    def _places(self) -> tuple[Mapping[str, int], Mapping[str, int]]:
        rows, columns = ({name: k for k, name in enumerate(names)} for names in (self.rows, self.columns))
        return rows, columns

    def __getitem__(self, names: tuple[str, str]) -> Expr:
        """The entry of a row and a column by their names.

        Raises:
            KeyError: there is no such row or column.
        """
        rows, columns = self._places
        for name, places in zip(names, (rows, columns), strict=True):
            if name not in places:
                raise KeyError(f"There is no '{name}'. There are: {', '.join(places)}.")
        return self.matrix[rows[names[0]], columns[names[1]]]


def incidence(assembly: Assembly) -> NamedMatrix:
    """A of A i = 0: the factor with which each branch takes what passes through it from each node."""
    graph = assembly.form.graph
    branches = range(len(graph.branches))
    rows = {
        name: {branch: Add(*assembly.incidence(branch, node)) for branch in branches}
        for node, name in enumerate(graph.nodes)
    }
    return _named(rows, _branch_names(graph))


def loops(assembly: Assembly) -> NamedMatrix:
    """B of B v = 0: a row for each link, 1 at the link and the tree branches of its loop with their factors.

    Ideal couplings have nothing across them, and no column that is not zero.
    """
    names = _branch_names(assembly.form.graph)
    rows = {
        names[link]: {link: Integer(1)} | {tree: -factor for tree, factor in assembly.factors(link)}
        for link in sorted(assembly.form.tree.loops)
        if assembly.kind(link) is not Kind.COUPLING
    }
    return _named(rows, names)


def cutsets(assembly: Assembly) -> NamedMatrix:
    """Q of Q i = 0: a row for each branch of the tree, 1 at the branch and the links of its cutset."""
    names = _branch_names(assembly.form.graph)
    rows = {
        name: {tree: Integer(1)} | dict(assembly.cutsets.get(tree, ()))
        for tree, name in enumerate(names)
        if tree not in assembly.form.tree.loops
    }
    return _named(rows, names)


def _branch_names(graph: CircuitGraph) -> tuple[str, ...]:
    """By what passes through the branches; where several of a part have one name, they are numbered."""
    names = [branch_name(graph, branch) for branch in graph.branches]
    several, seen = Counter(names), Counter[str]()
    for k, name in enumerate(names):
        seen[name] += 1
        names[k] = f"{name} {seen[name]}" if several[name] > 1 else name
    return tuple(names)


def _named(rows: Mapping[str, Mapping[int, Expr]], columns: tuple[str, ...]) -> NamedMatrix:
    entries = [row.get(branch, Integer(0)) for row in rows.values() for branch in range(len(columns))]
    return NamedMatrix(tuple(rows), columns, ImmutableMatrix(len(rows), len(columns), entries))
