"""The equations of a network, and what is made of them: fields, transfer functions, matrices, LaTeX."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Protocol

from shaftwork.core.errors import ParameterError
from shaftwork.core.screen import counted, named, on_one_screen
from shaftwork.equations.notations import Notation, notation_of
from shaftwork.equations.rows import NetworkEquations

if TYPE_CHECKING:
    from shaftwork.equations.fields import Field
    from shaftwork.equations.state_space import StateSpace
    from shaftwork.equations.transfer import TransferFunction
    from shaftwork.latex.document import Form

SHOWN = 5
"""Rows of a kind that are shown on a screen."""


class NamedPhase(Protocol):
    """A phase of a motion that has a name, "gap open, load stuck": a row of `Solution.phases`."""

    @property
    def name(self) -> str:
        """The mode of every part in words."""


@dataclass(frozen=True, eq=False)
class Equations(NetworkEquations):
    """Kirchhoff's equations of a network and what becomes of them.

    Args:
        in_phase: from a phase to the equations there, where parts change their mode.
    """

    in_phase: Callable[[str | NamedPhase], Equations] | None = None

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

    def written_as(self, notation: str | Notation | None) -> Equations:
        """The same equations in the letters of another source.

        Args:
            notation: "popenda", "marinkovic", "modelica", or a `Notation` of your own; None for these letters.

        Raises:
            ParameterError: there is no such notation.
        """
        return self if notation is None else replace(self, source=notation_of(notation))

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

    def document(
        self, form: Form | None = None, *, values: bool = False, notation: str | Notation | None = None
    ) -> str:
        """A complete LaTeX document: the forms, the states with their units, and the nomenclature with the values.

        Args:
            form: as in `latex`; by default all.
            values: print the parameters' values instead of their symbols.
            notation: letters of another source, as in `written_as`.
        """
        from shaftwork.latex.document import document

        return document(self.written_as(notation), form, values=values)

    def _repr_latex_(self) -> str:
        from shaftwork.latex.document import blocks_of, rendered

        return rendered(self, blocks_of(self, None, values=False))
