"""The matrices of Kirchhoff's laws, with the names of their rows and columns."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property

from sympy import Add, Expr, ImmutableMatrix, Integer

from shaftwork.equations.assembly import Assembly
from shaftwork.network.kinds import Kind
from shaftwork.reduction.form import branch_name


@dataclass(frozen=True, eq=False)
class NamedMatrix:
    """A matrix whose entries are read by names, `made["a", "shaft.tau_c"]`.

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
        for name, known in zip(names, (rows, columns), strict=True):
            if name not in known:
                raise KeyError(f"There is no '{name}'. There are: {', '.join(known)}.")
        return self.matrix[rows[names[0]], columns[names[1]]]


@dataclass(frozen=True, eq=False)
class Topology:
    """Makes the matrices.

    Args:
        assembly: of the network.
    """

    assembly: Assembly

    @cached_property
    def _names(self) -> tuple[str, ...]:
        """By what passes through the branches; where several of a part have one name, they are numbered."""
        graph = self.assembly.form.graph
        names = [branch_name(graph, branch) for branch in graph.branches]
        several, seen = Counter(names), Counter[str]()
        for k, name in enumerate(names):
            seen[name] += 1
            names[k] = f"{name} {seen[name]}" if several[name] > 1 else name
        return tuple(names)

    def _made(self, rows: Mapping[str, Mapping[int, Expr]]) -> NamedMatrix:
        entries = [[row.get(branch, Integer(0)) for branch in range(len(self._names))] for row in rows.values()]
        matrix = ImmutableMatrix(len(rows), len(self._names), [entry for row in entries for entry in row])
        return NamedMatrix(tuple(rows), self._names, matrix)

    def incidence(self) -> NamedMatrix:
        """A of A i = 0: the factor with which each branch takes what passes through it from each node."""
        graph = self.assembly.form.graph
        rows = {name: dict(self._taken(number)) for number, name in enumerate(graph.nodes)}
        return self._made(rows)

    def _taken(self, node: int) -> Iterator[tuple[int, Expr]]:
        for branch in range(len(self._names)):
            yield branch, Add(*self.assembly.incidence(branch, node))

    def loops(self) -> NamedMatrix:
        """B of B v = 0: a row for each link, 1 at the link and the tree branches of its loop with their factors.

        Ideal couplings have nothing across them, and no column that is not zero.
        """
        rows = {
            self._names[link]: {link: Integer(1)} | {tree: -factor for tree, factor in self.assembly.factors(link)}
            for link in sorted(self.assembly.form.tree.loops)
            if self.assembly.kind(link) is not Kind.COUPLING
        }
        return self._made(rows)

    def cutsets(self) -> NamedMatrix:
        """Q of Q i = 0: a row for each branch of the tree, 1 at the branch and the links of its cutset."""
        links, made = self.assembly.form.tree.loops, self.assembly.cutsets
        rows = {
            self._names[tree]: {tree: Integer(1)} | dict(made.get(tree, ()))
            for tree in range(len(self._names))
            if tree not in links
        }
        return self._made(rows)
