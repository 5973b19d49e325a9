"""The equations of a network, and what is made of them: matrices, fields, transfer functions, LaTeX."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

from sympy import Basic, Expr, Function, ImmutableMatrix, Integer, Symbol

from shaftwork.components.laws import t as TIME
from shaftwork.core.errors import ParameterError
from shaftwork.core.screen import counted, named, on_one_screen
from shaftwork.equations.assembly import Assembly
from shaftwork.equations.letters import letters_of, with_derived
from shaftwork.equations.notations import OWN, Letter, Notation, inverses_of, notation_of
from shaftwork.equations.second_order import SecondOrder, second_order
from shaftwork.formulation.form import StateForm, branch_name

if TYPE_CHECKING:
    from shaftwork.equations.fields import Field
    from shaftwork.equations.kirchhoff import Eliminated, LoopEquation, NodeEquation, Row, StateEquation
    from shaftwork.equations.small_motions.state_space import StateSpace
    from shaftwork.equations.small_motions.transfer import TransferFunction
    from shaftwork.latex.document import Form


class NamedPhase(Protocol):
    """A phase of a motion that has a name, "gap open, load stuck": a row of `Solution.phases`."""

    @property
    def name(self) -> str:
        """The mode of every part in words."""


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


@dataclass(frozen=True, eq=False)
class Equations:
    """Kirchhoff's equations of a network, how their symbols are printed, and what becomes of them.

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
        notation: whose letters are printed.
        in_phase: from a phase to the equations there, where parts change their mode.
        from_assembly: the same rows by another assembly.
    """

    form: StateForm
    assembly: Assembly
    nodes: tuple[NodeEquation, ...]
    loops: tuple[LoopEquation, ...]
    laws: tuple[Row, ...]
    couplings: tuple[Row, ...]
    states: tuple[StateEquation, ...]
    eliminated: tuple[Eliminated, ...]
    notes: tuple[str, ...]
    phase: str = field(default="", kw_only=True)
    notation: Notation = field(default=OWN, kw_only=True)
    in_phase: Callable[[str | NamedPhase], Equations] | None = None
    from_assembly: Callable[[Assembly], Equations] = field(kw_only=True)

    @cached_property
    def _letters(self) -> tuple[Mapping[str, str], tuple[Letter, ...]]:
        return letters_of(self.form, self.assembly.quantities, self.notation)

    @cached_property
    def inverses(self) -> Mapping[Symbol, Symbol]:
        """For each parameter that is printed by its reciprocal the symbol of that."""
        return inverses_of(self.letters)

    @cached_property
    def rows(self) -> tuple[Row, ...]:
        """Every row, in the order in which they are printed, but for identities and what others have said before."""
        rows: list[Row] = []
        said = set[Expr]()  # only asked for membership
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
        return self._matrix({row.node: row.coefficients for row in self.nodes})

    @cached_property
    def loop_matrix(self) -> NamedMatrix:
        """B of Kirchhoff's B v = 0: a row for the fundamental loop of each link, a column for each branch.

        It is 1 at the link, and has the factors of the tree branches; ideal couplings have nothing across them.
        """
        names = self._branch_names
        loops = {row.link: {tree: -factor for tree, factor in row.coefficients.items()} for row in self.loops}
        return self._matrix({names[link]: {link: Integer(1), **trees} for link, trees in loops.items()})

    @cached_property
    def cutset_matrix(self) -> NamedMatrix:
        """Q of Q i = 0: a row for the fundamental cutset of each branch of the tree, a column for each branch."""
        trees = (pair for pair in enumerate(self._branch_names) if pair[0] not in self.form.tree.loops)
        cutsets = self.assembly.cutsets
        return self._matrix({name: {tree: Integer(1), **dict(cutsets.get(tree, ()))} for tree, name in trees})

    @cached_property
    def _branch_names(self) -> tuple[str, ...]:
        """By what passes through the branches; where several of a part have one name, they are numbered."""
        names = [branch_name(self.form.graph, branch) for branch in self.form.graph.branches]
        several, seen = Counter(names), Counter[str]()
        for k, name in enumerate(names):
            seen[name] += 1
            names[k] = f"{name} {seen[name]}" if several[name] > 1 else name
        return tuple(names)

    def _matrix(self, rows: Mapping[str, Mapping[int, Expr]]) -> NamedMatrix:
        columns = self._branch_names
        entries = [row.get(branch, Integer(0)) for row in rows.values() for branch in range(len(columns))]
        return NamedMatrix(tuple(rows), columns, ImmutableMatrix(len(rows), len(columns), entries))

    @cached_property
    def second_order(self) -> SecondOrder:
        """M phi'' + D phi' + K phi = T of a mechanical network.

        Raises:
            CompileError: the network has electrical nodes.
        """
        return second_order(self.form.graph)

    @cached_property
    def fields(self) -> tuple[Field, ...]:
        """Every long shaft before it is divided: partial differential equations and boundary conditions."""
        from shaftwork.equations.fields import fields_of

        return fields_of(self)

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
        from shaftwork.equations.small_motions.transfer import transfer_function

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
        from shaftwork.equations.small_motions.state_space import state_space

        return state_space(self, inputs, outputs)

    def written_as(self, notation: str | Notation | None) -> Equations:
        """The same equations in the letters of another source.

        Args:
            notation: "popenda", "marinkovic", "modelica", or a `Notation` of your own; None for these letters.

        Raises:
            ParameterError: there is no such notation.
        """
        return self if notation is None else replace(self, notation=notation_of(notation))

    def latex(
        self,
        form: Form | None = None,
        *,
        values: bool = False,
        phase: str | NamedPhase | None = None,
        notation: str | Notation | None = None,
    ) -> str:
        """The equations as the body of a LaTeX document (needs amsmath), or for a notebook cell.

        Args:
            form: "kirchhoff" (balances, loops, laws), "state" (rates), "second-order", or "field" (long shafts before
                they are divided); by default the first two.
            values: print the parameters' values instead of their symbols.
            phase: the equations of this phase of a motion, "gap open, load stuck", or a row of `Solution.phases`,
                whose name is used; by default those of the phase of these equations, which is printed above them.
            notation: letters of another source, as in `written_as`.

        Raises:
            CompileError: second-order form of a network with electrical nodes; no shaft to print before division.
            ParameterError: there is no such phase or notation.
        """
        from shaftwork.latex.document import blocks_of, typeset

        if phase is not None:
            if self.in_phase is None:
                raise ParameterError(f"phase = {phase!r}: no part of '{self.form.graph.name}' changes its mode.")
            return self.in_phase(phase).latex(form, values=values, notation=notation)
        equations = self.written_as(notation)
        return typeset(equations, blocks_of(equations, form, values=values))

    def __str__(self) -> str:
        graph = self.form.graph
        phase = f", {self.phase}" if self.phase else ""
        most = 5  # rows of a kind that are shown
        groups = (
            ("balance", self.nodes, len(self.nodes) <= most),
            ("loop", self.loops, len(self.loops) <= most),
            ("coupling", self.couplings, len(self.couplings) <= most),
            ("law", self.laws, len(self.laws) <= most),
        )
        sizes = ", ".join(counted(len(rows), word) for word, rows, _ in groups)
        title = f"Equations of '{graph.name}'{phase}: {sizes}"
        lines = named(counted(len(self.states), "state"), [row.name for row in self.states])
        lines += named("no states", [row.what for row in self.eliminated], most=2)
        for word, rows, few in groups:
            shown = rows if few else rows[: most - 1]
            lines += [f"  {word} {', '.join(row.nodes or row.parts)}: {row.left} = {row.right}" for row in shown]
            lines += [] if few else [f"  ... and {len(rows) - len(shown)} more"]
        return on_one_screen(title, lines, len(lines))

    __repr__ = __str__

    def document(
        self,
        form: Form | None = None,
        *,
        values: bool = False,
        notation: str | Notation | None = None,
        title: str | None = None,
    ) -> str:
        """A complete LaTeX document: the forms, the states with their units, and the nomenclature with the values.

        Args:
            form: as in `latex`; by default all that the network has.
            values: print the parameters' values instead of their symbols.
            notation: letters of another source, as in `written_as`.
            title: of the document; by default the name of the network.

        Raises:
            CompileError: there is no such form of this network, as for `latex`.
            ParameterError: there is no such notation.
        """
        from shaftwork.latex.document import document

        return document(self.written_as(notation), form, values=values, title=title)

    def _repr_latex_(self) -> str:
        from shaftwork.latex.document import blocks_of, rendered

        return rendered(self, blocks_of(self, None, values=False))
