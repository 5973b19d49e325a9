"""One set of equations of a model, as C code needs it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from shaftwork.codegen.compiled_model import CompiledModel
from shaftwork.core.errors import CompileError
from shaftwork.formulation.explicit_rows import BlockTooLargeError, Rows, explicit_rows
from shaftwork.formulation.form import StateForm
from shaftwork.formulation.observables import Observables
from shaftwork.network.netlist import listed
from shaftwork.pipeline.prepared import nominal_tolerances


@dataclass(frozen=True, eq=False)
class EquationSet:
    """One set of equations.

    Args:
        model: the compiled equations.
    """

    model: CompiledModel

    @property
    def form(self) -> StateForm:
        """The state form."""
        return self.model.form

    @cached_property
    def rows(self) -> Rows:
        """The state equations as expressions.

        Raises:
            CompileError: there is an algebraic loop.
        """
        try:
            return explicit_rows(self.form, in_numbers=True)
        except BlockTooLargeError:
            names = listed([self.form.graph.part_of(k).name for k in self.form.loop_laws])
            raise CompileError(
                f"'{self.form.graph.name}' has an algebraic loop through {names}. Give the node of that part an "
                "inertia or a capacitor."
            ) from None

    @cached_property
    def observables(self) -> Observables:
        """Expressions of all quantities."""
        return Observables(self.form, self.rows)

    @cached_property
    def nominal(self) -> Mapping[str, float]:
        """The absolute tolerance of each state, as part of the relative one."""
        sizes = nominal_tolerances(self.form, self.model.bind().part.coefficients)
        return dict(zip((state.name for state in self.form.states), sizes.tolist(), strict=True))
