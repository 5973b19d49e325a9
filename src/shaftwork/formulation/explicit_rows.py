"""The state equations row by row as sympy expressions: for small networks, for reading and for scalar code.

The same equations as in `form`, solved symbolically in blocks of coupled unknowns. A larger block is one node of
expressions where exported code solves it in numbers, and left to the sparse matrices of the array program otherwise;
all are tested to agree.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import NamedTuple

import networkx as nx
from sympy import Add, Dummy, Expr, Integer, Matrix, Symbol

from shaftwork.components.branches import ACROSS, INTEGRAL, RATE
from shaftwork.components.law_slopes import slope
from shaftwork.components.laws import replaced
from shaftwork.components.laws import t as TIME
from shaftwork.formulation.form import StateForm
from shaftwork.formulation.gains import exact_of
from shaftwork.formulation.linear_systems import LinearSystem
from shaftwork.formulation.tree import Row
from shaftwork.network.graph import GROUND, Reading, readings_of
from shaftwork.network.kinds import Kind


class Largest(NamedTuple):
    """Up to how many states and branches unrolled code saves more than it costs to make."""

    states: int
    branches: int


SCALAR, SWITCHING = Largest(64, 400), Largest(1200, 6000)
"""Of all networks, and of those whose parts change their mode in few sets of equations: each event is looked at by
itself, which takes arrays 50 times as long as scalar code. 65 states with 114 events: 1.2 s, then 0.03 s a run, and
4.5 s by arrays; 385 states with 261 events: 4 s, then 0.7 s, and 15 s by arrays."""
FEW_SETS = 4
"""So many sets of equations are few."""


@dataclass(frozen=True, eq=False)
class Rows:
    """Explicit state equations.

    Args:
        states: state symbols, in the order of `StateForm.states`.
        parameters: parameter symbols, in the order of the graph's parameters.
        rates: d(state)/dt, each in states, parameters and time.
        across: across variable of every branch whose value needs no derivative, by branch.
        through: through variable of every law, conductance and source of torque, by branch.
    """

    states: tuple[Symbol, ...]
    parameters: tuple[Symbol, ...]
    rates: tuple[Expr, ...]
    across: Mapping[int, Expr]
    through: Mapping[int, Expr]


def explicit_rows(form: StateForm, *, in_numbers: bool = False) -> Rows:
    """Solve the state form for the rates.

    Args:
        form: the state form.
        in_numbers: whether unknowns of large blocks may stand in the rows, as symbols that have a `LinearSystem`.

    Raises:
        BlockTooLargeError: more than `LARGEST_BLOCK` unknowns are coupled, or they are coupled by nonlinear laws.
    """
    if form.loop_laws:
        raise BlockTooLargeError
    return _Solution(form, in_numbers=in_numbers).rows()


class _Solution:
    def __init__(self, form: StateForm, *, in_numbers: bool) -> None:
        self.form, self.graph = form, form.graph
        self.large = self._in_numbers if in_numbers else refused
        self.systems: list[LinearSystem] = []
        self.states = tuple(Symbol(state.name, real=True) for state in form.states)
        carried = zip(form.states, self.states, strict=True)
        symbols = {(state.kind, state.branch): symbol for state, symbol in carried}
        self.loops = _exact(form, form.tree.loops)
        self.balances = _exact(form, form.tree.cutsets) if form.loses_power else self.loops
        self.cutsets: dict[int, list[tuple[int, Expr]]] = {}
        for link, row in self.balances.items():
            for tree, gain in row:
                self.cutsets.setdefault(tree, []).append((link, gain))
        self.across: dict[int, Expr] = {k: symbols["across", k] for k in form.across_states}
        self.across.update({k: self.form.law_of(k) for k in form.across_sources})
        self.across.update({k: Dummy(real=True) for k in form.controlled})
        self.through: dict[int, Expr] = {k: symbols["through", k] for k in form.through_states}
        self.integral = {k: symbols["integral", k] for k in form.integrals}
        self.beyond: dict[int, Expr] = {}

    def around(self, link: int) -> Expr:
        """Across variable of a link: the sum over its loop, as far as the tree is known."""
        return Add(*(gain * self.across[tree] for tree, gain in self.loops[link] if tree in self.across))

    def out_of(self, tree: int, links: Iterable[int]) -> Expr:
        """Through variables of the given links that leave through the cutset of a tree branch."""
        wanted = frozenset(links)
        return Add(*(gain * self.through[link] for link, gain in self.cutsets.get(tree, ()) if link in wanted))

    def rows(self) -> Rows:
        form = self.form
        sources = form.tree.links[Kind.THROUGH_SOURCE]
        self.through.update({k: self.form.law_of(k) for k in sources})
        self._solve_conductances(sources)
        self._put_in_controls()
        for link in form.link_conductances:
            self.across[link] = self.around(link)
            self.through[link] = self.form.law_of(link) * self.across[link]
        for link in form.tree.links[Kind.LAW]:
            self.across[link] = self.around(link)
            arguments = {ACROSS: self.across[link], INTEGRAL: self.integral.get(link, INTEGRAL), **self.read(link)}
            law = self.form.law_of(link)
            if link in form.inertial:
                self.beyond[link], law = slope(law, RATE).xreplace(arguments), law.xreplace({RATE: Integer(0)})
            self.through[link] = replaced(law, arguments)
        for link in (*sources, *form.through_states, *form.dependent_across):
            self.across[link] = self.around(link)
        rates = (*self._speed_rates(), *self._torque_rates(), *(self.across[k] for k in form.integrals))
        for link, capacity in self.beyond.items():
            self.through[link] += capacity * self._rate(link, dict(zip(form.across_states, rates, strict=False)))
        parameters = tuple(Symbol(name, real=True) for name in self.graph.parameters)
        return Rows(self.states, parameters, rates, self.across, self.through)

    def read(self, branch: int) -> dict[Symbol, Expr]:
        """What the law of a branch reads of other ports and branches of its part."""
        reads = readings_of(self.graph, branch).items()
        return {symbol: self.value(reading) for symbol, reading in reads if reading.kind != "rate"}

    def value(self, reading: Reading) -> Expr:
        """A quantity that a law reads, in states and sources of time."""
        match reading:
            case Reading("across", node):
                row = {} if node == GROUND else self.form.tree.potentials[node] or {}
                trees = [tree for tree in row if tree in self.across]
                gains = exact_of(row[tree] for tree in trees)
                return Add(*(gain * self.across[tree] for tree, gain in zip(trees, gains, strict=True)))
            case Reading("through", store) if store not in self.through:  # others of its cutset decide
                sources = self.form.tree.links[Kind.THROUGH_SOURCE]
                links = (*self.form.through_states, *sources, *self.form.link_conductances)
                return -self.out_of(store, links)
            case Reading("through", store):
                return self.through[store]
        return self.integral[reading.of]

    def _put_in_controls(self) -> None:
        """Controlled sources by what they read; until then a symbol stands for each."""
        controls = {self.across[k]: replaced(self.form.law_of(k), self.read(k)) for k in self.form.controlled}
        self.across = {k: replaced(across, controls) for k, across in self.across.items()} if controls else self.across
        for system in self.systems:
            system.right[:] = [replaced(side, controls) for side in system.right]

    def _in_numbers(self, matrix: Entries, block: Sequence[int], right: Mapping[int, Expr]) -> tuple[Expr, ...]:
        """The unknowns of one block as they are, for code that solves for them."""
        place = {unknown: k for k, unknown in enumerate(block)}
        entries = {(place[row], place[column]): entry for (row, column), entry in matrix.items() if row in place}
        self.systems.append(LinearSystem(entries, [right[unknown] for unknown in block]))
        return self.systems[-1].unknowns

    def _solve_conductances(self, sources: Sequence[int]) -> None:
        form = self.form
        unknowns = form.tree_conductances
        right = {tree: -self.out_of(tree, (*form.through_states, *sources)) for tree in unknowns}
        links: list[Link] = []
        for link in form.link_conductances:
            g, drive = self.form.law_of(link), self.around(link)
            row, column = (
                [(tree, gain) for tree, gain in members[link] if tree in right]
                for members in (self.balances, self.loops)
            )
            links.append((row, g, column))
            for tree, gain in row:
                right[tree] -= gain * g * drive
        matrix = congruence({tree: self.form.law_of(tree) for tree in unknowns}, links)
        self.across.update(zip(unknowns, solve_blocks(matrix, unknowns, right, self.large), strict=True))

    def _speed_rates(self) -> tuple[Expr, ...]:
        form = self.form
        unknowns = form.across_states
        links = (*form.link_conductances, *form.through_states, *form.laws)
        right = {tree: -self.out_of(tree, links) for tree in unknowns}
        ties = [self._tie(link, self.form.law_of(link), right.keys()) for link in form.dependent_across]
        ties += [self._tie(link, capacity, right.keys()) for link, capacity in self.beyond.items()]
        return solve_tied({tree: self.form.law_of(tree) for tree in unknowns}, ties, right, self.large)

    def _tie(self, link: int, capacity: Expr, unknowns: Container[int]) -> Tie:
        """A dependent store, or what one has beyond a constant, as what it does to the stores that carry it."""
        columns, row = (
            {tree: gain for tree, gain in members[link] if tree in unknowns} for members in (self.balances, self.loops)
        )
        return Tie(capacity, columns, row, self._rate(link, {}))

    def _rate(self, link: int, rates: Mapping[int, Expr]) -> Expr:
        """The rate of what is across a link, from known rates of stores and those of prescribed speeds."""
        all_rates = {**{tree: slope(self.form.law_of(tree), TIME) for tree in self.form.across_sources}, **rates}
        return Add(*(gain * all_rates[tree] for tree, gain in self.loops[link] if tree in all_rates))

    def _torque_rates(self) -> tuple[Expr, ...]:
        form = self.form
        unknowns = form.through_states
        right = {link: self.across[link] for link in unknowns}
        springs: list[Link] = []
        for tree in form.dependent_through:
            compliance = 1 / self.form.law_of(tree)
            members = self.cutsets.get(tree, [])
            states = [(link, gain) for link, gain in members if link in right]
            source = Add(*(gain * slope(self.through[link], TIME) for link, gain in members if link not in right))
            row = [(link, gain) for link in unknowns for other, gain in self.loops[link] if other == tree]
            springs.append((row, compliance, states))
            for link, gain in row:
                right[link] -= gain * compliance * source
        matrix = congruence({link: 1 / self.form.law_of(link) for link in unknowns}, springs)
        return solve_blocks(matrix, unknowns, right, self.large)


def _exact(form: StateForm, rows: Mapping[int, Row]) -> dict[int, tuple[tuple[int, Expr], ...]]:
    """Loops or cutsets of the links as expressions, without couplings: their across value is zero."""
    couplings = frozenset(form.tree.tree[Kind.COUPLING])
    entries = [
        (link, tree, gain)
        for link, row in rows.items()
        for tree, gain in row.items()
        if tree not in couplings and link not in form.tree.redundant
    ]
    exact_rows: dict[int, list[tuple[int, Expr]]] = {link: [] for link in rows}
    for (link, tree, _), exact in zip(entries, exact_of(gain for _, _, gain in entries), strict=True):
        exact_rows[link].append((tree, exact))
    return {link: tuple(row) for link, row in exact_rows.items()}


LARGEST_BLOCK = 3
"""Coupled unknowns that are solved symbolically; the formulas for more are longer than anyone reads."""
Members = Iterable[tuple[int, Expr]]
Link = tuple[Members, Expr, Members]
"""What is not among the unknowns but acts on them: how it enters their rows, its coefficient, what it reads of them."""


Entries = Mapping[tuple[int, int], Expr]
SolveBlock = Callable[[Entries, Sequence[int], Mapping[int, Expr]], Iterable[Expr]]
"""The unknowns of a block, from the entries of a matrix, the numbers of the unknowns and the right sides."""


class BlockTooLargeError(Exception):
    """The rows have no closed form that anyone would read."""


@dataclass(frozen=True)
class Tie:
    """A dependent store: y = capacity (row x + prescribed) acts back on those that carry it, each by its share of y.

    Args:
        capacity: of the store.
        shares: of y, by unknown.
        row: what its rate has of each unknown rate x.
        prescribed: what its rate has besides, of prescribed rates.
    """

    capacity: Expr
    shares: Mapping[int, Expr]
    row: Mapping[int, Expr]
    prescribed: Expr


def refused(_entries: Entries, _block: Sequence[int], _right: Mapping[int, Expr]) -> Iterable[Expr]:
    """Of a block that is too large, for what needs closed forms."""
    raise BlockTooLargeError


def solve_tied(
    capacities: Mapping[int, Expr], ties: Sequence[Tie], right: Mapping[int, Expr], large: SolveBlock = refused
) -> tuple[Expr, ...]:
    """Solve capacities x + shares y = right for the rates x of stores, where y are the reactions of dependent ones.

    Law: few unknowns are solved for with y put in. Of many that are tied by few, the reactions are solved for,
    (1 + capacity row shares / capacities) y = capacity (row right / capacities + prescribed), and each rate follows
    from them by itself.

    Raises:
        BlockTooLargeError: neither has blocks of `LARGEST_BLOCK` or fewer alone, and `large` refuses others.
    """
    driven = dict(right)
    for tie in ties:
        for tree, share in tie.shares.items():
            driven[tree] -= share * tie.capacity * tie.prescribed
    matrix = congruence(capacities, ((tie.shares.items(), tie.capacity, tie.row.items()) for tie in ties))
    with suppress(BlockTooLargeError):
        return solve_blocks(matrix, tuple(capacities), driven)
    with suppress(BlockTooLargeError):
        return _by_reactions(capacities, ties, right)
    return solve_blocks(matrix, tuple(capacities), driven, large)


def _by_reactions(capacities: Mapping[int, Expr], ties: Sequence[Tie], right: Mapping[int, Expr]) -> tuple[Expr, ...]:
    """The rates by the reactions of what is carried by several; what is carried by one alone is added to that one."""
    whole, driven = dict(capacities), dict(right)
    for tie in ties:
        if len(tie.row) == 1 and tie.row.keys() == tie.shares.keys():
            ((tree, share),) = tie.shares.items()
            whole[tree] += share * tie.capacity * tie.row[tree]
            driven[tree] -= share * tie.capacity * tie.prescribed
    several = [tie for tie in ties if len(tie.row) > 1 or tie.row.keys() != tie.shares.keys()]
    matrix = {(k, k): Integer(1) for k in range(len(several))}
    for k, tie in enumerate(several):
        for m, other in enumerate(several):
            common = [tree for tree in tie.row if tree in other.shares]
            if common:
                felt = Add(*(tie.row[tree] * other.shares[tree] / whole[tree] for tree in common))
                matrix[k, m] = matrix.get((k, m), Integer(0)) + tie.capacity * felt
    apart = {
        k: tie.capacity * Add(tie.prescribed, *(gain * driven[tree] / whole[tree] for tree, gain in tie.row.items()))
        for k, tie in enumerate(several)
    }
    reactions = solve_blocks(matrix, range(len(several)), apart)
    for tie, reaction in zip(several, reactions, strict=True):
        for tree, share in tie.shares.items():
            driven[tree] -= share * reaction
    return tuple(driven[tree] / capacity for tree, capacity in whole.items())


def congruence(coefficients: Mapping[int, Expr], links: Iterable[Link]) -> dict[tuple[int, int], Expr]:
    """The matrix of unknowns: their own coefficients on the diagonal, and those of the links referred to them."""
    matrix = {(unknown, unknown): coefficient for unknown, coefficient in coefficients.items()}
    for row, coefficient, column in links:
        for first, gain in row:
            for second, other in column:
                matrix[first, second] = matrix.get((first, second), Integer(0)) + gain * coefficient * other
    return matrix


def solve_blocks(
    matrix: Entries, unknowns: Sequence[int], right: Mapping[int, Expr], large: SolveBlock = refused
) -> tuple[Expr, ...]:
    """Solve a sparse symbolic system block by block of coupled unknowns; `large` solves those beyond `LARGEST_BLOCK`.

    Raises:
        BlockTooLargeError: there are such blocks, and `large` refuses them.
    """
    links: nx.Graph[int] = nx.Graph()
    links.add_nodes_from(unknowns)
    links.add_edges_from(matrix)
    solution: dict[int, Expr] = {}
    order = {unknown: k for k, unknown in enumerate(unknowns)}
    for component in nx.connected_components(links):
        block = sorted(component, key=order.__getitem__)
        if len(block) == 1:
            (only,) = block
            solution[only] = right[only] / matrix[only, only]
            continue
        solve = _cramer if len(block) <= LARGEST_BLOCK else large
        solution.update(zip(block, solve(matrix, block, right), strict=True))
    return tuple(solution[unknown] for unknown in unknowns)


def _cramer(matrix: Entries, block: Sequence[int], right: Mapping[int, Expr]) -> Iterator[Expr]:
    """Solve one block by cofactors.

    The cofactors are made of single symbols, and the entries put in afterwards: sympy would otherwise try to cancel
    factors of long entries, which takes minutes for a few geared inertias.
    """
    entries = {
        (i, j): matrix[first, second]
        for i, first in enumerate(block)
        for j, second in enumerate(block)
        if (first, second) in matrix
    }
    names = {place: Symbol(f"m{place[0]}{place[1]}") for place in entries}
    square = Matrix(len(block), len(block), lambda i, j: names.get((i, j), Integer(0)))
    put_in = {names[place]: entry for place, entry in entries.items()}
    adjugate = square.adjugate().xreplace(put_in)
    determinant = square.det(method="berkowitz").xreplace(put_in)
    for i in range(len(block)):
        yield Add(*(adjugate[i, j] * right[other] for j, other in enumerate(block))) / determinant
