"""The equations of a network as data: a record for each equation, and all of them with their letters and values.

An equation knows its parts, branches and nodes, and becomes sympy when it is first read.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

from sympy import Add, Basic, Eq, Expr, Float, Function, Symbol

from shaftwork.components.laws import t as TIME
from shaftwork.equations.assembly import Assembly, FactoredTerms, Sides
from shaftwork.equations.letters import letters_of
from shaftwork.equations.notations import OWN, Letter, Notation, inverses_of
from shaftwork.equations.second_order import SecondOrder, second_order
from shaftwork.equations.solved_rows import EliminationSystem
from shaftwork.equations.topology import NamedMatrix, cutsets, incidence, loops
from shaftwork.formulation.form import StateForm


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
class LawEquation(Row):
    """The law of a branch, or of the parallel branches of a part; that of an across store is in its node's balance."""


@dataclass(frozen=True, eq=False)
class CouplingEquation(Row):
    """What an ideal coupling imposes on the speeds of its nodes."""


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


@dataclass(frozen=True, eq=False)
class NetworkEquations:
    """The rows of a network, and how their symbols are printed.

    Args:
        form: the state form that they are written from.
        assembly: makes the terms.
        nodes: balance at every node.
        loops: speed around every fundamental loop.
        laws: constitutive laws.
        couplings: what ideal couplings impose.
        states: rates of the states.
        eliminated: dependent stores, speeds without a store, reactions of couplings and prescribed speeds.
        notes: what was left out or decided by numerical values, in words.
        phase: the mode of every part that changes its mode, "gap open, load stuck", for which the rows hold.
        source: whose letters are printed.
    """

    form: StateForm
    assembly: Assembly
    nodes: tuple[NodeEquation, ...]
    loops: tuple[LoopEquation, ...]
    laws: tuple[LawEquation, ...]
    couplings: tuple[CouplingEquation, ...]
    states: tuple[StateEquation, ...]
    eliminated: tuple[Eliminated, ...]
    notes: tuple[str, ...]
    phase: str = field(default="", kw_only=True)
    source: Notation = field(default=OWN, kw_only=True)

    @cached_property
    def _letters(self) -> tuple[Mapping[str, str], tuple[Letter, ...]]:
        return letters_of(self.form, self.assembly.quantities, self.source)

    @cached_property
    def inverses(self) -> Mapping[Symbol, Symbol]:
        """For each parameter that is printed by its reciprocal the symbol of that."""
        return inverses_of(self.letters)

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """Every row, in the order in which they are printed, but for identities and what others have said before."""
        rows, said = list[Row](), set[Expr]()  # only asked for membership
        for row in (*self.nodes, *self.loops, *self.couplings, *self.laws, *self.states, *self.eliminated):
            expression = row.expression
            if not row.trivial and expression not in said:
                rows.append(row)
                said |= {expression, -expression}
        return tuple(rows)

    def in_time(self, expression: Basic) -> Basic:
        """An expression or equation of these rows as sympy's own: J1.omega as J1.omega(t), der(J1.omega) as Derivative.

        Parameters stay symbols, so the result is what `sympy.dsolve` or `sympy.diff` take.
        """
        parameters = {letter.name for letter in self.letters if letter.parameter}

        def function(name: str) -> Expr:
            inner = name[4:-1] if name.startswith("der(") and name.endswith(")") else ""
            return function(inner).diff(TIME) if inner else Function(name, real=True)(TIME)

        moving = (symbol for symbol in expression.free_symbols if symbol != TIME and symbol.name not in parameters)
        return expression.xreplace({symbol: function(symbol.name) for symbol in moving})

    @property
    def letters(self) -> tuple[Letter, ...]:
        """Every symbol with its unit and meaning, in the order of the parts."""
        return self._letters[1]

    @property
    def symbol_names(self) -> Mapping[str, str]:
        """LaTeX of every symbol by the symbol's name."""
        return self._letters[0]

    @cached_property
    def definitions(self) -> Mapping[Symbol, Expr]:
        """Derived quantities, such as an inertia per length, in parameters and in those defined before."""
        graph, definitions = self.form.graph, {}
        for part in graph.parts:
            for derived in part.derived:
                symbols = {symbol: graph.symbol_of(part, symbol.name) for symbol in derived.law.free_symbols}
                definitions[graph.symbol_of(part, derived.name)] = derived.law.xreplace(symbols)
        return definitions

    @cached_property
    def values(self) -> Mapping[str, float]:
        """Every parameter and derived quantity by the name of its symbol, in SI."""
        values = with_derived(self.form.graph.parameters, self.definitions)
        return values | {inverse.name: 1 / values[symbol.name] for symbol, inverse in self.inverses.items()}

    @cached_property
    def incidence(self) -> NamedMatrix:
        """A of Kirchhoff's A i = 0: a row for each node, a column for each branch."""
        return incidence(self.assembly)

    @cached_property
    def loop_matrix(self) -> NamedMatrix:
        """B of Kirchhoff's B v = 0: a row for the fundamental loop of each link, a column for each branch."""
        return loops(self.assembly)

    @cached_property
    def cutset_matrix(self) -> NamedMatrix:
        """Q of Q i = 0: a row for the fundamental cutset of each branch of the tree, a column for each branch."""
        return cutsets(self.assembly)

    @cached_property
    def second_order(self) -> SecondOrder:
        """M phi'' + D phi' + K phi = T of a mechanical network.

        Raises:
            CompileError: the network has electrical nodes.
        """
        return second_order(self.form.graph)


def with_derived(values: Mapping[str, float], definitions: Mapping[Symbol, Expr]) -> dict[str, float]:
    """Values of parameters, and of what is derived from them."""
    numbers = dict(values)
    for symbol, law in definitions.items():
        numbers[symbol.name] = float(law.xreplace({each: Float(numbers[each.name]) for each in law.free_symbols}))
    return numbers
