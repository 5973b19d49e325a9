"""The normal tree: which branches carry the state, and the fundamental loops and cutsets that follow from it.

Branches are offered to the tree in the order of `Kind`. A branch whose across variable is not yet fixed by the branches
taken before enters the tree; otherwise it is a link, and its across variable is a sum of the tree's: its loop. An ideal
coupling takes part as a branch of across value zero whose column of the incidence matrix holds the ratios. Nothing else
is needed for gears: the loops then have ratios as entries, and a coupling's torque comes out as that of any branch.

With v the across and i the through variables, F the matrix of the loops (tree branch by link):

    v_link = F^T v_tree  (speed around every loop),   i_tree = -F i_link  (torque through every cutset).

A coupling that loses power has other ratios of torques than of speeds. Its cutsets are those of the same tree in the
network that has the ratios of torques in place of the others; Q stands for their matrix: i_tree = -Q i_link.

Sources: Popenda 2019, (1)-(4) for the equations; the normal tree is that of linear circuit theory (Bryant 1959).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from sympy import Expr

from shaftwork.formulation.gains import Gain, Number, add, coefficient, coefficients_in, divide, value_of
from shaftwork.network.graph import GROUND, CircuitGraph, GraphBranch
from shaftwork.network.kinds import Kind

Row = dict[int, Number]


@dataclass(frozen=True, eq=False)
class NormalTree:
    """The tree, the loops of its links, and what the couplings alone say about the nodes.

    Args:
        tree: tree branches by kind, each in the order of the branch table.
        links: link branches by kind, likewise.
        loops: for each link the across variables that it is the sum of: tree branch to factor. Couplings stand in it
            with their factor too (their across value is zero): it is what their torque is made of.
        cutsets: for each link the tree branches whose through variables balance its own, with their factors; the loops
            themselves where no coupling loses power.
        potentials: for each node the sum of tree across variables that its own is; None where nothing fixes it.
        shares: for each node the tree branches that balance what is put in there, with their factors; the potentials
            themselves where no coupling loses power.
        locked: nodes that a closed loop of couplings of unequal ratio holds at rest, with the coupling that closed it.
        redundant: couplings that say what others have said already.
        frozen: names of the ratios whose given values make a sum vanish that is not zero for all values: they decide
            the structure.
        unbalanced: links that are missing in the tree, as a coupling that loses power lets no torque through to them.
    """

    tree: Mapping[Kind, tuple[int, ...]]
    links: Mapping[Kind, tuple[int, ...]]
    loops: Mapping[int, Row]
    cutsets: Mapping[int, Row]
    potentials: tuple[Row | None, ...]
    shares: tuple[Row | None, ...]
    locked: tuple[tuple[int, tuple[int, ...]], ...]
    redundant: tuple[int, ...]
    frozen: tuple[str, ...]
    unbalanced: tuple[int, ...] = ()


class _Elimination:
    """Node values through tree branches and nodes still free; free nodes are counted from 0, branches as ~index."""

    def __init__(self, nodes: int) -> None:
        self.solved: list[Row | None] = [None] * nodes
        self.users: list[list[int]] = [[] for _ in range(nodes)]
        self.coincidences: list[Gain] = []

    def reduce(self, column: Row) -> Row:
        """The across variable of a branch in terms of free nodes and tree branches."""
        result: Row = {}
        for node, factor in column.items():
            row = self.solved[node]
            self._accumulate(result, {node: 1} if row is None else row, factor)
        return result

    def _accumulate(self, target: Row, row: Row, factor: Number) -> None:
        for key, entry in row.items():
            product = factor * entry
            total = add(target[key], product, self.coincidences) if key in target else product
            if isinstance(total, int) and total == 0:
                del target[key]
            else:
                target[key] = total

    @property
    def potentials(self) -> tuple[Row | None, ...]:
        """Each node in terms of tree branches; None where it is still free."""
        return tuple(None if row is None or max(row, default=-1) >= 0 else _by_branch(row) for row in self.solved)

    def solve_for_a_node(self, reduced: Row, branch: int | None) -> int:
        """Fix one free node by `sum of reduced = across of the branch` (zero without one) and return it."""
        free = [node for node in reduced if node >= 0]
        pivot = min(free, key=lambda node: (len(self.users[node]), -abs(value_of(reduced[node])), node))
        factor = reduced.pop(pivot)
        row: Row = {key: divide(-entry, factor) for key, entry in reduced.items()}
        if branch is not None:
            row[~branch] = divide(1, factor)
        self._replace(pivot, row)
        return pivot

    def _replace(self, pivot: int, row: Row) -> None:
        self.solved[pivot] = row
        users, self.users[pivot] = self.users[pivot], []
        keys = [key for key in row if key >= 0]
        for node in users:
            target = self.solved[node]
            if target is None or pivot not in target:
                continue
            before = set(target)
            self._accumulate(target, row, target.pop(pivot))
            for key in keys:
                if key in target and key not in before:
                    self.users[key].append(node)
        for key in keys:
            self.users[key].append(pivot)


def column_of(graph: CircuitGraph, branch: GraphBranch) -> Row:
    """The column of the incidence matrix: node to factor (+1 where the branch leaves, -1 where it enters, ratios)."""
    return _summed(graph, branch, branch.terms)


def balance_of(graph: CircuitGraph, branch: GraphBranch) -> Row:
    """Node to factor with which a branch takes its through variable from it: the column, but where power is lost."""
    return _summed(graph, branch, branch.balances)


def _summed(graph: CircuitGraph, branch: GraphBranch, terms: Sequence[tuple[Expr, int, int]]) -> Row:
    column: Row = {}
    for expression, plus, minus in terms or ((None, branch.plus, branch.minus),):
        factor = 1 if expression is None else _gain(graph, branch, expression)
        for node, sign in ((plus, 1), (minus, -1)):
            if node == GROUND:
                continue
            total = add(column.get(node, 0), factor * sign, [])
            if isinstance(total, int) and total == 0:
                column.pop(node, None)
            else:
                column[node] = total
    return column


def _gain(graph: CircuitGraph, branch: GraphBranch, expression: Expr) -> Number:
    if expression.is_Integer:
        return int(expression)
    part = graph.parts[branch.part]
    symbols = (graph.symbol_of(part, symbol.name) for symbol in branch.template.symbols)
    values = {symbol: graph.parameters[symbol.name] for symbol in symbols}
    return coefficient(graph.in_network_symbols(expression, branch), values)


def _names_in(gains: list[Gain]) -> tuple[str, ...]:
    """The parameters that gains are made of."""
    return tuple(sorted({symbol.name for ratio in coefficients_in(gains) for symbol in ratio.free_symbols}))


def _by_branch(row: Row) -> Row:
    """A row in terms of tree branches alone, by branch number in ascending order."""
    return {~key: row[key] for key in sorted(row, reverse=True)}


def _closes_a_loop(work: _Elimination, column: Row, reduced: Row) -> tuple[int, ...]:
    """The nodes that a coupling brings to rest because other couplings already tie them together, else nothing."""
    moving = tuple(node for node in column if (row := work.solved[node]) is None or max(row, default=-1) >= 0)
    return moving if len(moving) > 1 and sum(key >= 0 for key in reduced) == 1 else ()


def normal_tree(graph: CircuitGraph) -> NormalTree:
    """Choose the normal tree and express every link by it."""
    work, lossy = _Elimination(len(graph.nodes)), any(branch.template.through for branch in graph.branches)
    torques = _Elimination(len(graph.nodes)) if lossy else work
    tree: dict[Kind, list[int]] = {kind: [] for kind in Kind}
    links: dict[Kind, list[int]] = {kind: [] for kind in Kind}
    locked: list[tuple[int, tuple[int, ...]]] = []
    columns = {branch.index: column_of(graph, branch) for branch in graph.branches}
    balances = {branch.index: balance_of(graph, branch) for branch in graph.branches} if lossy else columns
    controlled = {branch.part for branch in graph.branches if branch.template.through}
    for branch in sorted(graph.branches, key=partial(_rank, graph, controlled)):  # stable: keeps the order of the table
        kind, index = branch.template.kind, branch.index
        reduced = work.reduce(columns[index])
        opposed = torques.reduce(balances[index]) if lossy else reduced
        if not (_is_free(reduced) and _is_free(opposed)):
            links[kind].append(index)
            continue
        if kind is Kind.COUPLING and (closed := _closes_a_loop(work, columns[index], reduced)):
            locked.append((index, closed))
        tree[kind].append(index)
        work.solve_for_a_node(reduced, index)
        if lossy:
            torques.solve_for_a_node(opposed, index)
    others = [index for kind in Kind for index in links[kind]]
    around = {index: work.reduce(columns[index]) for index in others}
    balanced = {index: torques.reduce(balances[index]) for index in others} if lossy else around
    unbalanced = tuple(_outranked(graph, around, balanced)) if lossy else ()
    loops, potentials = {index: _by_branch(row) for index, row in around.items()}, work.potentials
    return NormalTree(
        {kind: tuple(tree[kind]) for kind in Kind},
        {kind: tuple(links[kind]) for kind in Kind},
        loops,
        {index: _by_branch(row) for index, row in balanced.items()} if lossy and not unbalanced else loops,
        potentials,
        torques.potentials if lossy else potentials,
        tuple(locked),
        tuple(links[Kind.COUPLING]),
        _names_in([*work.coincidences, *(torques.coincidences if lossy else ())]),
        unbalanced,
    )


def _rank(graph: CircuitGraph, controlled: set[int], branch: GraphBranch) -> tuple[Kind, int]:
    """By what branches come into the tree: gears before what holds by a mode, which carries nothing beside them.

    Of that, gears that rub come first: beside a friction which takes all, no torque in their teeth would tell whether
    they hold. The resistance within a controlled source comes last of all: others fix the node that it follows.
    """
    kind, modes = branch.template.kind, graph.parts[branch.part].modes
    if kind is Kind.CONDUCTANCE:
        return kind, int(branch.part in controlled)
    if kind is not Kind.COUPLING or not modes:
        return kind, 0
    return kind, 1 if any(element.passes_on for element in modes) else 2


def _is_free(reduced: Row) -> bool:
    """Whether nodes that nothing fixes yet are in a row."""
    return any(key >= 0 for key in reduced)


def _outranked(graph: CircuitGraph, loops: Mapping[int, Row], cutsets: Mapping[int, Row]) -> Iterator[int]:
    """Links that had to leave their place in the tree to branches of a later kind, or to none.

    Without losses there are none. A redundant coupling carries nothing, whatever its cutset is.
    """
    for index, loop in loops.items():
        kind = graph.branches[index].template.kind
        row = (*loop, *(cutsets[index] if kind is not Kind.COUPLING else ()))
        if any(key >= 0 or graph.branches[~key].template.kind > kind for key in row):
            yield index
