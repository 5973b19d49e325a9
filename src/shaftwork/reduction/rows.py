"""The state equations row by row as sympy expressions: for small networks, for reading and for scalar code.

The same equations as in `form`, solved symbolically in blocks of coupled unknowns. A network with a larger block is
left to the sparse matrices of the array program; both are tested to agree.
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Mapping, Sequence
from dataclasses import dataclass

from sympy import Add, Dummy, Expr, Integer, Symbol

from shaftwork.components.branches import ACROSS, INTEGRAL, RATE
from shaftwork.components.clips import replaced
from shaftwork.components.laws import t as TIME
from shaftwork.components.slopes import slope
from shaftwork.network.controlled import Reading, readings_of
from shaftwork.network.graph import GROUND
from shaftwork.network.kinds import Kind
from shaftwork.reduction.blocks import BlockTooLargeError, Tie, solve_blocks, solve_tied
from shaftwork.reduction.form import StateForm
from shaftwork.reduction.gains import exact_of
from shaftwork.reduction.tree import Row


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


def explicit_rows(form: StateForm) -> Rows:
    """Solve the state form for the rates.

    Raises:
        BlockTooLargeError: more than `LARGEST_BLOCK` unknowns are coupled, or they are coupled by nonlinear laws.
    """
    if form.loop_laws:
        raise BlockTooLargeError
    return _Solution(form).rows()


class _Solution:
    def __init__(self, form: StateForm) -> None:
        self.form, self.graph = form, form.graph
        self.states = tuple(Symbol(state.name, real=True) for state in form.states)
        carried = zip(form.states, self.states, strict=True)
        own = {(state.kind, state.branch): symbol for state, symbol in carried}
        self.loops = _exact(form, form.tree.loops)
        self.balances = self.loops if form.tree.cutsets is form.tree.loops else _exact(form, form.tree.cutsets)
        self.cutsets: dict[int, list[tuple[int, Expr]]] = {}
        for link, row in self.balances.items():
            for tree, gain in row:
                self.cutsets.setdefault(tree, []).append((link, gain))
        self.across: dict[int, Expr] = {k: own["across", k] for k in form.across_states}
        self.across.update({k: self.law(k) for k in form.across_sources})
        self.across.update({k: Dummy(real=True) for k in form.controlled})
        self.through: dict[int, Expr] = {k: own["through", k] for k in form.through_states}
        self.integral = {k: own["integral", k] for k in form.integrals}
        self.beyond: dict[int, Expr] = {}

    def law(self, branch: int) -> Expr:
        """Coefficient or law of a branch in the symbols of the network."""
        made = self.graph.branches[branch]
        return self.graph.in_network_symbols(made.template.law, made)

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
        self.through.update({k: self.law(k) for k in sources})
        self._solve_conductances(sources)
        self._put_in_controls()
        for link in form.link_conductances:
            self.across[link] = self.around(link)
            self.through[link] = self.law(link) * self.across[link]
        for link in form.tree.links[Kind.LAW]:
            self.across[link] = self.around(link)
            known = {ACROSS: self.across[link], INTEGRAL: self.integral.get(link, INTEGRAL), **self.read(link)}
            law = self.law(link)
            if link in form.inertial:
                self.beyond[link], law = slope(law, RATE).xreplace(known), law.xreplace({RATE: Integer(0)})
            self.through[link] = replaced(law, known)
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
        return {symbol: self.value(made) for symbol, made in reads if made.kind != "rate"}

    def value(self, reading: Reading) -> Expr:
        """A quantity that a law reads, in states and sources of time."""
        match reading:
            case Reading("across", node):
                row = {} if node == GROUND else self.form.tree.potentials[node] or {}
                known = [tree for tree in row if tree in self.across]
                gains = exact_of(row[tree] for tree in known)
                return Add(*(gain * self.across[tree] for tree, gain in zip(known, gains, strict=True)))
            case Reading("through", store) if store not in self.through:  # others of its cutset decide
                links = (*self.form.through_states, *self.form.tree.links[Kind.THROUGH_SOURCE])
                return -self.out_of(store, links)
            case Reading("through", store):
                return self.through[store]
        return self.integral[reading.of]

    def _put_in_controls(self) -> None:
        """Controlled sources by what they read; until then a symbol stands for each."""
        found = {self.across[k]: replaced(self.law(k), self.read(k)) for k in self.form.controlled}
        self.across = {k: replaced(across, found) for k, across in self.across.items()} if found else self.across

    def _solve_conductances(self, sources: Sequence[int]) -> None:
        form = self.form
        unknowns = form.tree_conductances
        right = {tree: -self.out_of(tree, (*form.through_states, *sources)) for tree in unknowns}
        matrix: dict[tuple[int, int], Expr] = {(tree, tree): self.law(tree) for tree in unknowns}
        for link in form.link_conductances:
            g, drive = self.law(link), self.around(link)
            self._add_products(matrix, link, g, frozenset(unknowns))
            for tree, gain in self.balances[link]:
                if tree in right:
                    right[tree] -= gain * g * drive
        self.across.update(zip(unknowns, solve_blocks(matrix, unknowns, right), strict=True))

    def _speed_rates(self) -> tuple[Expr, ...]:
        form = self.form
        unknowns = form.across_states
        links = (*form.link_conductances, *form.through_states, *form.laws)
        right = {tree: -self.out_of(tree, links) for tree in unknowns}
        ties = [self._tie(link, self.law(link), right.keys()) for link in form.dependent_across]
        ties += [self._tie(link, capacity, right.keys()) for link, capacity in self.beyond.items()]
        return solve_tied({tree: self.law(tree) for tree in unknowns}, ties, right)

    def _tie(self, link: int, capacity: Expr, unknowns: Container[int]) -> Tie:
        """A dependent store, or what one has beyond a constant, as what it does to the stores that carry it."""
        columns, row = (
            {tree: gain for tree, gain in members[link] if tree in unknowns} for members in (self.balances, self.loops)
        )
        return Tie(capacity, columns, row, self._rate(link, {}))

    def _rate(self, link: int, rates: Mapping[int, Expr]) -> Expr:
        """The rate of what is across a link, from known rates of stores and those of prescribed speeds."""
        known = {**{tree: slope(self.law(tree), TIME) for tree in self.form.across_sources}, **rates}
        return Add(*(gain * known[tree] for tree, gain in self.loops[link] if tree in known))

    def _torque_rates(self) -> tuple[Expr, ...]:
        form = self.form
        unknowns = form.through_states
        right = {link: self.across[link] for link in unknowns}
        matrix: dict[tuple[int, int], Expr] = {(link, link): 1 / self.law(link) for link in unknowns}
        for tree in form.dependent_through:
            compliance = 1 / self.law(tree)
            members = self.cutsets.get(tree, [])
            states = [(link, gain) for link, gain in members if link in right]
            source = Add(*(gain * slope(self.through[link], TIME) for link, gain in members if link not in right))
            for first, gain in ((link, gain) for link in unknowns for other, gain in self.loops[link] if other == tree):
                right[first] -= gain * compliance * source
                for second, other in states:
                    matrix[first, second] = matrix.get((first, second), Integer(0)) + gain * compliance * other
        return solve_blocks(matrix, unknowns, right)

    def _add_products(
        self, matrix: dict[tuple[int, int], Expr], link: int, coefficient: Expr, unknowns: frozenset[int]
    ) -> None:
        """Add coefficient * q f' for the columns q and f of a link in the cutsets and loops."""
        members = [(tree, gain) for tree, gain in self.loops[link] if tree in unknowns]
        for first, gain in ((tree, gain) for tree, gain in self.balances[link] if tree in unknowns):
            for second, other in members:
                matrix[first, second] = matrix.get((first, second), Integer(0)) + gain * coefficient * other


def _exact(form: StateForm, rows: Mapping[int, Row]) -> dict[int, tuple[tuple[int, Expr], ...]]:
    """Loops or cutsets of the links as expressions, without couplings: their across value is zero."""
    couplings = frozenset(form.tree.tree[Kind.COUPLING])
    entries = [
        (link, tree, gain)
        for link, row in rows.items()
        for tree, gain in row.items()
        if tree not in couplings and link not in form.tree.redundant
    ]
    made: dict[int, list[tuple[int, Expr]]] = {link: [] for link in rows}
    for (link, tree, _), exact in zip(entries, exact_of(gain for _, _, gain in entries), strict=True):
        made[link].append((tree, exact))
    return {link: tuple(row) for link, row in made.items()}
