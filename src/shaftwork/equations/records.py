"""The equations of a network as records: each row knows its parts, branches and nodes, and becomes sympy when read."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal, Protocol

from sympy import Add, Eq, Expr, Float, Symbol

from shaftwork.core.errors import ParameterError
from shaftwork.core.screen import counted, named, on_one_screen
from shaftwork.equations.assembly import Assembly, Group, Sides
from shaftwork.equations.notation import Letter, notation
from shaftwork.equations.topology import NamedMatrix, Topology
from shaftwork.reduction.form import StateForm

if TYPE_CHECKING:
    from shaftwork.equations.second_order import SecondOrder
    from shaftwork.equations.state_space import StateSpace
    from shaftwork.equations.transfer import TransferFunction

Form = Literal["kirchhoff", "state", "second-order"]
SHOWN = 5
"""Rows of a kind that are shown on a screen."""


class NamedPhase(Protocol):
    """A phase of a motion that has a name, "gap open, load stuck": a row of `Solution.phases`."""

    @property
    def name(self) -> str:
        """The mode of every part in words."""


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
    def groups(self) -> tuple[Group, ...]:
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
        taken: makes `coefficients`.
    """

    node: str
    taken: Callable[[], Mapping[int, Expr]]

    @cached_property
    def coefficients(self) -> Mapping[int, Expr]:
        """For each branch the factor with which it takes its through variable from the node: 1, -1 or a ratio."""
        return self.taken()


@dataclass(frozen=True, eq=False)
class LoopEquation(Row):
    """Speed around the fundamental loop of a link (Popenda 2019, (4)).

    Args:
        link: the link's branch number.
        summed: makes `coefficients`.
    """

    link: int
    summed: Callable[[], tuple[tuple[int, Expr], ...]]

    @cached_property
    def coefficients(self) -> Mapping[int, Expr]:
        """For each tree branch of the loop the factor with which its across variable enters."""
        return dict(self.summed())


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
        solved: makes `explicit`.
        make_coupled: makes `coupled`.
    """

    name: str
    symbol: Symbol
    unit: str
    solved: Callable[[], bool]
    make_coupled: Callable[[], Sides]

    @cached_property
    def explicit(self) -> bool:
        """False where more rates are coupled than are solved symbolically; the left side then holds them all."""
        return self.solved()

    @cached_property
    def coupled(self) -> Sides:
        """The row before it is solved: where several rates stand in it, it is far shorter so."""
        return self.make_coupled()

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
class Equations:
    """Kirchhoff's equations of a network and what becomes of them.

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
        in_phase: from a phase to the equations there, where parts change their mode.
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
    phase: str = ""
    in_phase: Callable[[str | NamedPhase], Equations] | None = None

    @cached_property
    def _notation(self) -> tuple[Mapping[str, str], tuple[Letter, ...]]:
        return notation(self.form, self.assembly.quantities)

    @property
    def rows(self) -> tuple[Row, ...]:
        """Every row, in the order in which they are printed."""
        return (*self.nodes, *self.loops, *self.couplings, *self.laws, *self.states, *self.eliminated)

    @property
    def letters(self) -> tuple[Letter, ...]:
        """Every symbol with its unit and meaning, in the order of the parts."""
        return self._notation[1]

    @property
    def symbol_names(self) -> Mapping[str, str]:
        """LaTeX of every symbol by the symbol's name."""
        return self._notation[0]

    @cached_property
    def definitions(self) -> Mapping[Symbol, Expr]:
        """Derived quantities, such as an inertia per length, in parameters and in those defined before."""
        graph, found = self.form.graph, {}
        for part in graph.parts:
            for made in part.derived:
                own = {symbol: graph.symbol_of(part, symbol.name) for symbol in made.law.free_symbols}
                found[graph.symbol_of(part, made.name)] = made.law.xreplace(own)
        return found

    @cached_property
    def values(self) -> Mapping[str, float]:
        """Every parameter and derived quantity by the name of its symbol, in SI."""
        known = dict(self.form.graph.parameters)
        for symbol, law in self.definitions.items():
            known[symbol.name] = float(law.xreplace({each: Float(known[each.name]) for each in law.free_symbols}))
        return known

    @cached_property
    def incidence(self) -> NamedMatrix:
        """A of Kirchhoff's A i = 0: a row for each node, a column for each branch."""
        return Topology(self.assembly).incidence()

    @cached_property
    def loop_matrix(self) -> NamedMatrix:
        """B of Kirchhoff's B v = 0: a row for the fundamental loop of each link, a column for each branch."""
        return Topology(self.assembly).loops()

    @cached_property
    def cutset_matrix(self) -> NamedMatrix:
        """Q of Q i = 0: a row for the fundamental cutset of each branch of the tree, a column for each branch."""
        return Topology(self.assembly).cutsets()

    @cached_property
    def second_order(self) -> SecondOrder:
        """M phi'' + D phi' + K phi = T of a mechanical network.

        Raises:
            CompileError: the network has electrical nodes.
        """
        from shaftwork.equations.second_order import second_order

        return second_order(self.form.graph)

    def transfer_function(
        self,
        input: str,  # noqa: A002 (it is what it is)
        output: str,
        *,
        values: bool = False,
        at: Mapping[str, float] | None = None,
        t: float | None = None,
    ) -> TransferFunction:
        """A quantity over an input as a quotient of polynomials in s, about a point.

        Law: the quotient of two determinants of Kirchhoff's equations in the image domain, by Cramer's rule; laws have
        their slopes there, as symbols where these are no sums and products of parameters. Exact.

        Args:
            input: what a source gives, "motor.tau".
            output: any speed, torque or angle, "shaft.tau".
            values: with the parameters' values instead of their symbols, which large networks need.
            at: with values, the point, as {"J1.omega": 8.0}, with all that laws read; by default rest.
            t: with values, the time at which laws are read, s; by default as for `TransferFunction.numeric`.

        Raises:
            SignalError: there is no such input or quantity.
            CompileError: a shaft is a travelling wave, or the polynomials would be too long in symbols.
            ParameterError: `at` names no quantity, or a law has no finite slope there.
        """
        from shaftwork.equations.transfer import transfer_function

        return transfer_function(self, (input, output), values=values, at=at, t=t)

    def state_space(
        self, inputs: str | Sequence[str] | None = None, outputs: str | Sequence[str] | None = None
    ) -> StateSpace:
        """Small motions about a point: A, B, C, D in the parameters' symbols; laws by their slopes, see there.

        Args:
            inputs: what sources give, "motor.tau"; by default all of it.
            outputs: speeds, torques and angles; by default the states.

        Raises:
            SignalError: there is no such input or quantity.
            CompileError: a shaft is a travelling wave, or more rates are coupled than are solved in symbols.
        """
        from shaftwork.equations.state_space import state_space

        return state_space(self, inputs, outputs)

    def latex(self, form: Form | None = None, *, values: bool = False, phase: str | NamedPhase | None = None) -> str:
        """The equations as the body of a LaTeX document (needs amsmath), or for a notebook cell.

        Args:
            form: "kirchhoff" (balances, loops, laws), "state" (rates) or "second-order"; by default the first two.
            values: print the parameters' values instead of their symbols.
            phase: the equations of this phase of a motion, "gap open, load stuck", or a row of `Solution.phases`,
                whose name is used; by default those of the phase of these equations, which is printed above them.

        Raises:
            CompileError: second-order form of a network with electrical nodes.
            ParameterError: there is no such phase.
        """
        from shaftwork.equations.report import body

        if phase is not None:
            if self.in_phase is None:
                raise ParameterError(f"phase = {phase!r}: no part of '{self.form.graph.name}' changes its mode.")
            return self.in_phase(phase).latex(form, values=values)
        return body(self, form, values=values)

    def __str__(self) -> str:
        graph = self.form.graph
        phase = f", {self.phase}" if self.phase else ""
        groups = (
            ("balance", self.nodes, len(self.nodes) <= SHOWN),
            ("loop", self.loops, len(self.loops) <= SHOWN),
            ("coupling", self.couplings, len(self.couplings) <= SHOWN),
            ("law", self.laws, len(self.laws) <= SHOWN),
        )
        sizes = ", ".join(counted(len(rows), word) for word, rows, _ in groups)
        title = f"Equations of '{graph.name}'{phase}: {sizes}"
        lines = named(counted(len(self.states), "state"), [row.name for row in self.states])
        lines += named("no states", [row.what for row in self.eliminated], most=2)
        for word, rows, few in groups:
            shown = rows if few else rows[: SHOWN - 1]
            lines += [f"  {word} {', '.join(row.nodes or row.parts)}: {row.left} = {row.right}" for row in shown]
            lines += [] if few else [f"  ... and {len(rows) - len(shown)} more"]
        return on_one_screen(title, lines, len(lines))

    __repr__ = __str__

    def document(self, form: Form | None = None, *, values: bool = False) -> str:
        """A complete LaTeX document: the forms, the states with their units, and the nomenclature with the values.

        Args:
            form: as in `latex`; by default all.
            values: print the parameters' values instead of their symbols.
        """
        from shaftwork.equations.report import document

        return document(self, form, values=values)

    def _repr_latex_(self) -> str:
        from shaftwork.equations.report import notebook

        return notebook(self)
