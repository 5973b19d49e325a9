"""Kirchhoff's equations of a network as records: balances at nodes, speeds around loops, laws, states.

An equation knows its parts, branches and nodes, and becomes sympy when it is first read.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import chain
from typing import Literal

from sympy import Add, Eq, Expr, Symbol

from shaftwork.equations.assembly import Assembly, FactoredTerms, Sides, branches_of, sides
from shaftwork.equations.quantities import rate_of
from shaftwork.equations.records import Equations
from shaftwork.equations.solved_rows import EliminationSystem, SolvedForm
from shaftwork.formulation.form import StateForm, branch_name
from shaftwork.formulation.gains import Number
from shaftwork.network.graph import GROUND
from shaftwork.network.kinds import Kind


@dataclass(frozen=True, eq=False)
class Row:
    """One equation and where it comes from.

    Args:
        parts: names of the parts that take part, in the order of the network.
        branches: their branches.
        nodes: names of the nodes concerned.
        make: makes both sides; called when the row is first read.
    """

    parts: tuple[str, ...]
    branches: tuple[int, ...]
    nodes: tuple[str, ...]
    make: Callable[[], Sides]

    @cached_property
    def sides(self) -> Sides:
        """Left side, and the groups of terms on the right, as they are printed."""
        return self.make()

    @property
    def left(self) -> Expr:
        """The left side."""
        return self.sides.left

    @property
    def groups(self) -> tuple[FactoredTerms, ...]:
        """The right side as groups of terms under a common factor."""
        return self.sides.groups

    @cached_property
    def right(self) -> Expr:
        """The right side as one expression."""
        return Add(*(factor * Add(*terms) for factor, terms in self.groups))

    @property
    def equation(self) -> Eq:
        """Left side = right side."""
        return Eq(self.left, self.right, evaluate=False)

    @property
    def expression(self) -> Expr:
        """Right side less left side; zero where the equation holds."""
        return self.right - self.left

    @property
    def trivial(self) -> bool:
        """Whether both sides are the same symbol, so that there is nothing to print."""
        return bool(self.expression == 0)


@dataclass(frozen=True, eq=False)
class NodeEquation(Row):
    """The balance at a node. `expression` is the sum of all that it receives, which is zero (Popenda 2019, (1)-(3)).

    Args:
        node: name of the node.
        number: its number.
        assembly: knows the factors.
    """

    node: str
    number: int
    assembly: Assembly

    @cached_property
    def coefficients(self) -> Mapping[int, Expr]:
        """For each branch the factor with which it takes its through variable from the node: 1, -1 or a ratio."""
        return {branch: Add(*self.assembly.incidence(branch, self.number)) for branch in self.branches}


@dataclass(frozen=True, eq=False)
class LoopEquation(Row):
    """Speed around the fundamental loop of a link (Popenda 2019, (4)).

    Args:
        link: the link's branch number.
        assembly: knows the factors.
    """

    link: int
    assembly: Assembly

    @cached_property
    def coefficients(self) -> Mapping[int, Expr]:
        """For each tree branch of the loop the factor with which its across variable enters."""
        return dict(self.assembly.factors(self.link))


@dataclass(frozen=True, eq=False)
class StateEquation(Row):
    """The rate of a state.

    Args:
        name: name of the state.
        symbol: its symbol.
        unit: its SI unit.
        system: makes the equations that the rates of states of its kind are solved from; None for an integral.
    """

    name: str
    symbol: Symbol
    unit: str
    system: Callable[[], EliminationSystem] | None

    @cached_property
    def explicit(self) -> bool:
        """False where more rates are coupled than are solved symbolically; the left side then holds them all."""
        return self.system is None or self.system().solved(self.branches[0])

    @cached_property
    def coupled(self) -> Sides:
        """The row before it is solved: where several rates stand in it, it is far shorter so."""
        return self.sides if self.system is None else self.system().coupled(self.branches[0])

    @property
    def rate(self) -> Expr:
        """d(state)/dt, where the row is explicit; else what the coupled rates on the left side sum up to."""
        return self.right


@dataclass(frozen=True, eq=False)
class Eliminated(Row):
    """A quantity that is no state although it might have been, or is algebraic, and how it follows.

    Args:
        what: name of the quantity.
        why: the reason in words.
        kind: "speed" (of a geared store or node), "torque" (of a store in series), "algebraic" or "reaction".
    """

    what: str
    why: str
    kind: Literal["speed", "torque", "algebraic", "reaction"]


Origin = tuple[tuple[str, ...], tuple[int, ...], tuple[str, ...]]


def kirchhoff(form: StateForm, assembly: Assembly | None = None) -> Equations:
    """The equations of a network. Rows become sympy expressions when they are read, not before.

    Source: Popenda 2019, (1)-(4).

    Args:
        form: the state form.
        assembly: makes their terms; by default that of the form.
    """
    writer = _KirchhoffWriter(form, assembly or Assembly(form))
    return Equations(
        form,
        writer.assembly,
        tuple(writer.nodes()),
        tuple(writer.loops()),
        tuple(writer.laws()),
        tuple(writer.couplings()),
        tuple(writer.states()),
        tuple(writer.eliminated()),
        tuple(writer.notes()),
        from_assembly=partial(kirchhoff, form),
    )


class _KirchhoffWriter:
    """Makes the records; all sympy work is put off by partial application."""

    def __init__(self, form: StateForm, assembly: Assembly) -> None:
        self.form, self.graph = form, form.graph
        self.assembly = assembly
        self.solution = SolvedForm(self.assembly)

    def origin(self, branches: Iterable[int], nodes: Iterable[int] = ()) -> Origin:
        """Parts, branches and nodes of a row, each once, in the order of the network."""
        numbers = tuple(sorted(set(branches)))
        members = [self.graph.branches[number] for number in numbers]
        touched = {*nodes, *(node for branch in members for node in (branch.plus, branch.minus))}
        touched.update(node for branch in members for _, plus, minus in branch.terms for node in (plus, minus))
        parts = dict.fromkeys(self.graph.parts[branch.part].name for branch in members)
        return tuple(parts), numbers, tuple(self.graph.nodes[node] for node in sorted(touched - {GROUND}))

    def part(self, branch: int) -> str:
        return self.graph.part_of(branch).name

    def nodes(self) -> Iterator[NodeEquation]:
        for number, name in enumerate(self.graph.nodes):
            touching = (branches_of(item) for item in self.assembly.at_node[number])
            parts, branches, _ = self.origin(chain.from_iterable(touching))
            make = partial(self.assembly.balance, number)
            yield NodeEquation(parts, branches, (name,), make, name, number, self.assembly)

    def loops(self) -> Iterator[LoopEquation]:
        for link in sorted(self.form.tree.loops):
            if self.assembly.kind(link) is not Kind.COUPLING:
                origin = self.origin((link, *self.form.tree.loops[link]))
                yield LoopEquation(*origin, partial(self.assembly.loop, link), link, self.assembly)

    def laws(self) -> Iterator[Row]:
        for flow in self.assembly.quantities.flows:
            kinds = {self.assembly.kind(branch) for branch in flow.branches}
            if kinds != {Kind.ACROSS_SOURCE}:
                yield Row(*self.origin(flow.branches), partial(self.assembly.law_of_flow, flow))
            for branch in flow.branches:
                if self.assembly.kind(branch) is Kind.THROUGH_STORE:
                    yield Row(*self.origin((branch,)), partial(self.assembly.law_of_store, branch))
                elif self.assembly.kind(branch) is Kind.ACROSS_SOURCE:
                    yield Row(*self.origin((branch,)), partial(self.assembly.law_of_source, branch))
        for end, other in self.assembly.opposite.items():
            yield Row(*self.origin((end, other)), partial(self.assembly.law_of_history, end))

    def couplings(self) -> Iterator[Row]:
        for branch in self.graph.branches:
            if branch.terms:
                yield Row(*self.origin((branch.index,)), partial(self.assembly.coupling, branch.index))

    def states(self) -> Iterator[StateEquation]:
        systems = {"across": self._system("speeds"), "through": self._system("torques")}
        for state in self.form.states:
            branch, system = state.branch, systems.get(state.kind)
            make = partial(_row, system, branch) if system else partial(self._integral_row, branch)
            symbol = Symbol(state.name, real=True)
            yield StateEquation(*self.origin((branch,)), make, state.name, symbol, state.unit, system)

    def _system(self, name: str) -> Callable[[], EliminationSystem]:
        """Makes one of the systems when it is wanted, so that rows can be stored."""
        return partial(getattr, self.solution, name)

    def _integral_row(self, branch: int) -> Sides:
        link = branch in self.form.tree.loops
        terms = self.assembly.around(branch) if link else (self.assembly.quantities.across(self.assembly.ends(branch)),)
        return sides(rate_of(self.assembly.quantities.integral(branch)), terms)

    def eliminated(self) -> Iterator[Eliminated]:
        yield from self._dependent_speeds()
        for branch in self.form.dependent_through:
            make = partial(self._carried, branch)
            name = branch_name(self.graph, self.graph.branches[branch])
            yield Eliminated(*self._cutset(branch), make, name, self._series(branch), "torque")
        for branch in self.form.tree_conductances:
            ends = self.assembly.ends(branch)
            where = " and ".join(self.graph.node_name(node) for node in ends if node != GROUND)
            why = f"no store at {where} fixes the speed across {self.part(branch)}; it follows from the balance"
            make = partial(_row, self._system("algebraic"), branch)
            yield Eliminated(*self._cutset(branch), make, f"across {self.part(branch)}", why, "algebraic")
        yield from self._reactions()

    def _dependent_speeds(self) -> Iterator[Eliminated]:
        """Speeds of nodes that follow from others through couplings; those inside a part are in its own equations."""
        owners, inner = self.assembly.quantities.owners, self.assembly.quantities.inner
        for number, row in enumerate(self.form.tree.potentials):
            owner = owners.get(number)
            if row is None or number in inner or owner in self._tree_stores or not self._tied(row):
                continue
            make = partial(self._follows, number)
            yield Eliminated(*self._origin_of_speed(number, row), make, *self._why_speed(number, row), "speed")

    @cached_property
    def _tree_stores(self) -> frozenset[int]:
        return frozenset((*self.form.across_states, *self.form.across_sources))

    def _tied(self, row: Mapping[int, Number]) -> bool:
        """Whether couplings take part in a node's speed; else the loops say all about it."""
        return not row or any(self.assembly.kind(tree) is Kind.COUPLING for tree in row)

    def _origin_of_speed(self, node: int, row: Mapping[int, Number]) -> Origin:
        owner = self.assembly.quantities.owners.get(node)
        return self.origin((*row, *(() if owner is None else (owner,))), (node,))

    def _why_speed(self, node: int, row: Mapping[int, Number]) -> tuple[str, str]:
        couplings = _listed(self.part(tree) for tree in row if self.assembly.kind(tree) is Kind.COUPLING)
        free = [self.part(tree) for tree in row if self.assembly.kind(tree) is not Kind.COUPLING]
        owner = self.assembly.quantities.owners.get(node)
        what = f"node {self.graph.nodes[node]}"
        if owner is not None:
            part = self.graph.part_of(owner)
            what = f"{type(part.component).__name__.lower()} {part.name}"
        if not free:
            return what, f"{what} is held at rest by {couplings}"
        return what, f"{what} is rigidly tied to {_listed(free)} by {couplings}"

    def _follows(self, node: int) -> Sides:
        row = self.form.tree.potentials[node] or {}
        speeds = (
            (gain, self.assembly.quantities.across(self.assembly.ends(tree)))
            for tree, gain in self.assembly.referred(row)
        )
        return sides(self.assembly.quantities.node(node), (speed * gain for speed, gain in speeds))

    def _reactions(self) -> Iterator[Eliminated]:
        for branch in self.form.tree.tree[Kind.COUPLING]:
            make = partial(self._carried, branch)
            ideal = "" if self.graph.branches[branch].template.through else "is ideal: it "
            why = f"{self.part(branch)} {ideal}takes whatever the balance asks"
            yield Eliminated(*self._cutset(branch), make, f"reaction of {self.part(branch)}", why, "reaction")
        for branch in self.form.across_sources:
            why = f"{self.part(branch)} supplies whatever its prescribed value takes"
            make = partial(self._carried, branch)
            yield Eliminated(*self._cutset(branch), make, f"reaction of {self.part(branch)}", why, "reaction")

    def _cutset(self, branch: int) -> Origin:
        return self.origin((branch, *(link for link, _ in self.assembly.cutsets.get(branch, ()))))

    def _carried(self, branch: int) -> Sides:
        symbol, sign = self.assembly.quantities.passing(branch)
        return sides(symbol, (sign * term for term in self.assembly.out_of(branch)))

    def _series(self, branch: int) -> str:
        members = [link for link, _ in self.assembly.cutsets.get(branch, ())]
        others = _listed(self.part(link) for link in members)
        part = self.graph.part_of(branch)
        kind = type(part.component).__name__.lower()
        return f"{kind} {part.name} is in series with {others}" if members else f"{kind} {part.name} carries nothing"

    def notes(self) -> Iterator[str]:
        tree = self.form.tree
        if self.graph.zeros:
            yield f"Exactly zero and therefore left out: {', '.join(self.graph.zeros)}."
        for branch in tree.redundant:
            yield f"{self.part(branch)} says what other couplings have said already; its reaction is undetermined."
        for branch, nodes in tree.locked:
            names = ", ".join(self.graph.nodes[node] for node in nodes)
            yield f"{self.part(branch)} closes a loop of couplings of unequal ratio and holds {names} at rest."
        if tree.frozen:
            yield "Ratios cancel for the given values; other ratios change the structure of these equations."


def _row(system: Callable[[], EliminationSystem], branch: int) -> Sides:
    return system().row(branch)


def _listed(names: Iterable[str]) -> str:
    """Names in a sentence: "a, b and c"; "c others" where there are many."""
    listed = list(dict.fromkeys(names))
    if len(listed) > 6:
        listed = [*listed[:4], f"{len(listed) - 4} others"]
    return " and ".join(filter(None, (", ".join(listed[:-1]), listed[-1]))) if listed else "nothing"
