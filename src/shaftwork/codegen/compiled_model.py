"""The compiled model: right-hand side and Jacobian with the parameters as arguments, in scalar or in array code."""

from __future__ import annotations

import math
import reprlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib.util import find_spec
from types import MappingProxyType
from typing import Any

import numpy as np
from sympy import Expr, Symbol, count_ops, cse

from shaftwork.codegen.array_form.arrays import ArrayProgram, BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.code import branchwise, scalar
from shaftwork.codegen.looped_source import LoopedSource, MachineCode
from shaftwork.codegen.time_switches import Switching
from shaftwork.components.discontinuities import pieces_degree
from shaftwork.components.laws import t as TIME
from shaftwork.core.calls import BoundedCache
from shaftwork.core.errors import CompileError, MissingExtraError, ParameterError
from shaftwork.core.parameters import in_si, is_quantity, without_unit
from shaftwork.formulation.explicit_rows import FEW_SETS, SCALAR, SWITCHING, BlockTooLargeError, Rows, explicit_rows
from shaftwork.formulation.form import StateForm
from shaftwork.network.graph import CircuitGraph
from shaftwork.network.kinds import Kind


@dataclass(frozen=True)
class Cost:
    """What one evaluation of the right-hand side costs.

    Args:
        form: "scalar" (unrolled, common subexpressions taken out) or "array" (sparse matrix and nonlinear rows).
        operations: number of operations by name.
        entries: non-zeros of the Jacobian's linear part.
    """

    form: str
    operations: Mapping[str, int]
    entries: int

    @property
    def total(self) -> int:
        """All operations together."""
        return sum(self.operations.values())


class ScalarProgram:
    """`rhs(t, x, p)` of explicit rows.

    Args:
        rows: the explicit state equations.
    """

    def __init__(self, rows: Rows) -> None:
        self._rows, self._rates = rows, rows.rates

    @cached_property
    def function(self) -> Callable[..., list[float]]:
        """(t, states, parameters) to the list of rates, in Python floats."""
        return scalar(self._arguments, self._rates)

    @cached_property
    def _slow(self) -> Callable[..., list[float]]:
        return branchwise(self._arguments, self._rates)

    @property
    def _arguments(self) -> dict[str, Symbol | Sequence[Symbol]]:
        return {"t": TIME, "x": self._rows.states, "p": self._rows.parameters}

    @property
    def source(self) -> str:
        """The generated code."""
        return str(self.function.__doc__)

    def bind(self, p: Array) -> Callable[[float, Array], Array]:
        """The right-hand side for one parameter vector; NaN where a law cannot be evaluated."""
        function, values = self.function, p.tolist()

        def rhs(t: float, x: Array) -> Array:
            try:
                return np.array(function(t, x.tolist(), values))
            except (ArithmeticError, ValueError):
                return np.array(self._slow(t, x, p))

        return rhs

    @cached_property
    def operations(self) -> dict[str, int]:
        """Operations of one evaluation after common subexpressions are taken out, by name; signs cost nothing."""
        shared, reduced = cse(self._rates)
        total = sum((count_ops(term, visual=True) for term in (*(e for _, e in shared), *reduced)), start=0)
        counts = total.as_coefficients_dict() if total else {}
        return {str(name).lower(): int(count) for name, count in sorted(counts.items(), key=str) if str(name) != "NEG"}


class CompiledModel:
    """A network as a function of time, states and parameters.

    Args:
        form: a state form without algebraic loops.
    """

    def __init__(self, form: StateForm) -> None:
        self.form = form
        self._bound = BoundedCache[bytes, BoundArrays](1)
        self._machine: MachineCode | None = None

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), (self.form,)

    @cached_property
    def parameters(self) -> Mapping[str, float]:
        """Every parameter that is left in a law, "part.parameter" to value in SI."""
        return MappingProxyType(dict(self.form.graph.parameters))

    @cached_property
    def defaults(self) -> Array:
        """The parameter vector of the network."""
        return np.array([*{**self.form.graph.parameters, **self.parameters}.values()], dtype=float)

    @cached_property
    def arrays(self) -> ArrayProgram:
        """The equations as sparse matrices and nonlinear rows."""
        return ArrayProgram(self.form)

    @cached_property
    def states(self) -> tuple[str, ...]:
        """Names of the states, in the order of `rhs`."""
        return tuple(state.name for state in self.form.states)

    @cached_property
    def rows(self) -> Rows | None:
        """The state equations as expressions, or None where the network is too large or too closely coupled."""
        return self.rows_of(_sets_of_equations(self.form.graph))

    def rows_of(self, sets: int) -> Rows | None:
        """The same where the motion may lead through so many sets of equations; none where no part changes its mode."""
        states, branches = len(self.form.states), len(self.form.graph.branches)
        largest = SWITCHING if 0 < sets <= FEW_SETS else SCALAR
        if self.form.waves or states > largest.states or branches > largest.branches:
            return None
        try:
            return explicit_rows(self.form)
        except BlockTooLargeError:
            return None

    @cached_property
    def degree(self) -> int | None:
        """The largest degree in time of the laws of time between their breakpoints; None where one is no polynomial."""
        kinds = (Kind.LAW, Kind.THROUGH_SOURCE, Kind.ACROSS_SOURCE)
        laws = [b.template.law for b in self.form.graph.branches if b.template.kind in kinds]
        degrees = [pieces_degree(law) for law in laws]
        return None if None in degrees else max((degree for degree in degrees if degree is not None), default=0)

    @cached_property
    def scalar(self) -> ScalarProgram | None:
        """The scalar program, where there are rows."""
        return None if self.rows is None else ScalarProgram(self.rows)

    def vector(self, changed: Mapping[str, float] | None = None) -> Array:
        """The parameter vector with some values replaced.

        Raises:
            ParameterError: a name is not among the parameters, or a value is outside its bounds.
        """
        p = self.defaults.copy()
        if changed:
            places = {name: k for k, name in enumerate(self.form.graph.parameters)}
            for name, value in changed.items():
                if name not in self.parameters:
                    raise ParameterError(
                        f"The model has no parameter '{name}'. It has: {', '.join(self.parameters) or 'none'}."
                    )
                p[places[name]] = value
        return p

    def bind(self, p: Array | None = None) -> BoundArrays:
        """The array program for a parameter vector; the last one is kept."""
        vector = self.defaults if p is None else np.asarray(p, dtype=float)
        return self._bound(vector.tobytes(), lambda: self.arrays.bind(vector))

    def rhs(self, t: float, x: Array, p: Array | None = None) -> Array:
        """Rates of the states.

        Args:
            t: time in s; (k,) beside many states.
            x: (n,) states, in the order of `states`; or (n, k).
            p: (parameters,) values in the order of `parameters`; by default the network's.

        Raises:
            ParameterError: x or p has another length, or units: states and parameters are numbers in SI.
        """
        if np.ndim(x) == 2:
            return self._of_many(t, x, p)
        when, states, values = self._numbers(t, x, p)
        if (machine := self._machine) is not None:
            return machine(float(when), np.ascontiguousarray(states), np.ascontiguousarray(values))
        return (self.bind(values).rhs if self.scalar is None else self.scalar.bind(values))(when, states)

    def _of_many(self, t: Any, x: Any, p: Any) -> Array:
        """Rates (n, k) of states (n, k)."""
        states = np.asarray(without_unit("x", x, "of each state"), dtype=float)
        if len(states) != len(self.states):
            raise ParameterError(f"x has the shape {states.shape}: give {len(self.states)} rows, one for each state.")
        values = self.defaults if p is None else self._vector("p", p, len(self.parameters), "parameter")
        times = np.asarray(t.to("s").magnitude if is_quantity(t) else t, dtype=float)
        if times.shape not in ((), states.shape[1:]):
            raise ParameterError(f"t has the shape {times.shape}: give one time, or one for each of the states.")
        return self.bind(values).rhs(np.broadcast_to(times, states.shape[1:]), states)

    def jacobian(self, t: float, x: Array, p: Array | None = None) -> Any:
        """d rhs / d x as scipy.sparse.csc_array (n, n); arguments as for `rhs`."""
        when, states, values = self._numbers(t, x, p)
        return self.bind(values).jacobian(when, states)

    def _numbers(self, t: Any, x: Any, p: Any) -> tuple[float, Array, Array]:
        """Time in s, states and parameters of one evaluation."""
        states = self._vector("x", x, len(self.states), "state")
        values = self.defaults if p is None else self._vector("p", p, len(self.parameters), "parameter")
        return in_si("t", t, "s") if is_quantity(t) else t, states, values

    @staticmethod
    def _vector(name: str, value: Any, size: int, what: str) -> Array:
        numbers = np.asarray(without_unit(name, value, f"of each {what}"))
        try:
            vector = numbers.astype(float, casting="same_kind" if numbers.dtype.kind == "c" else "unsafe", copy=False)
        except (TypeError, ValueError):
            shown = reprlib.repr(value)
            raise ParameterError(f"{name} = {shown} must be {size} real numbers, one for each {what}.") from None
        if vector.shape != (size,):
            raise ParameterError(f"{name} has the shape {vector.shape}: give {size} numbers, one for each {what}.")
        return vector

    @property
    def code(self) -> str:
        """The right-hand side as Python source: a function of t, the list x of states and the list p of parameters.

        Raises:
            CompileError: the network is so large that `rhs` multiplies sparse matrices, and there is no such source.
        """
        if self.scalar is None:
            raise CompileError(
                f"'{self.form.graph.name}' is too large for a right-hand side line by line: its rhs multiplies sparse "
                "matrices. Call rhs(t, x, p), or take the matrices from linearize()."
            )
        return self.scalar.source

    @cached_property
    def _loops(self) -> LoopedSource:
        title = self.form.graph.name
        if self.form.waves:
            raise CompileError(
                f"'{title}' has travelling waves, whose equations need the past. Take model=Spectral(16)."
            )
        try:
            return LoopedSource(explicit_rows(self.form), title)
        except BlockTooLargeError:
            raise CompileError(
                f"'{title}' has no right-hand side line by line: too many rates are coupled for symbols. "
                "Take rhs(t, x, p)."
            ) from None

    def source(self, language: str = "numpy") -> str:
        """The right-hand side as text in a language, equal rows as loops.

        Args:
            language: "numpy", a function rhs(t, x, p), of states (n, k) too; "c", void rhs(t, x, p, rates); "numba", as
                for `compiled`; or "sympy", a script with symbols t, x and p and the list rates.

        Raises:
            ParameterError: it is none of these.
            CompileError: a law is a table or noise, a shaft is a wave, or too many rates are coupled.
        """
        return self._loops.source(language)

    def compiled(self) -> MachineCode:
        """The right-hand side as machine code: a function of t in s, (n,) states and (parameters,) values.

        Give float arrays. The first call compiles, which takes seconds. From then on `rhs` is made by it, too, so that
        new parameters there cost no more than old ones.

        Raises:
            MissingExtraError: numba is not installed.
            CompileError: as for `source`.
        """
        if find_spec("numba") is None:
            raise MissingExtraError("numba", "fast", "model.compiled()")
        if self._machine is None:
            self._machine = MachineCode(self.source("numba"), len(self.states), len(self.parameters))
        return self._machine

    def phase(self, name: Any) -> CompiledModel:
        """The equations of one phase of a network whose parts change their mode: `rhs`, `jacobian`, `code`, `states`.

        Args:
            name: "gap open, load stuck", or a row of `Solution.phases`; parts that are not named are in their first
                mode.

        Raises:
            ParameterError: there is no such phase.
            NetworkError: its equations contradict each other.
        """
        raise ParameterError(
            f"phase = {getattr(name, 'name', name)!r}: the equations of '{self.form.graph.name}' are the same at all "
            "times. Take those of the model itself, such as model.rhs."
        )

    @cached_property
    def switching(self) -> Switching:
        """What switches because of the time alone."""
        return Switching(self.form)

    def settled(self, p: Array) -> float:
        """A time in s after which no law switches any more, for a parameter vector."""
        return max((0.0, *self.switching.known(p))) + 1.0

    @cached_property
    def taylor_program(self) -> Any:
        """The heyoka program, where there are rows, heyoka is installed and knows every function in them."""
        if self.rows is None or find_spec("heyoka") is None:
            return None
        from shaftwork.codegen.taylor.heyoka import build

        try:
            return build(self.rows.states, TIME, self.rows.parameters, self.rows.rates)
        except CompileError:
            return None

    @cached_property
    def machine_program(self) -> Any:
        """The right-hand side in machine code for engines, or None where there is none."""
        try:
            rows = None if self.form.waves else self.rows or explicit_rows(self.form)
        except BlockTooLargeError:
            return None
        return machine_program(rows, self.form.graph.name)

    @cached_property
    def linear(self) -> bool:
        """Whether the right-hand side is linear in the states with constant coefficients."""
        return self.arrays.inputs.linear

    def cost(self) -> Cost:
        """Operations of one right-hand side."""
        entries = int(self.bind().part.A.nnz)
        if self.scalar is not None:
            return Cost("scalar", self.scalar.operations, entries)
        part = self.bind().part
        products = int(part.A.nnz + part.B.nnz + part.C.nnz + part.D.nnz + part.B1.nnz)
        return Cost("array", {"mul": products, "add": products, "law": self.arrays.inputs.size}, entries)


def machine_program(rows: Rows | None, title: str, guards: Sequence[Expr] = ()) -> Any:
    """The `machine_program.MachineProgram` of rows; None without rows or numba, or where a law has no such code."""
    if rows is None or not rows.states or find_spec("numba") is None:
        return None
    from shaftwork.codegen.machine_program import MachineProgram

    try:
        return MachineProgram(rows, title, guards)
    except CompileError:
        return None


def _sets_of_equations(graph: CircuitGraph) -> int:
    """How many combinations of forms the parts of a network have that change their mode; 0 where there are none."""
    forms = [len({mode.form for mode in modes.options}) for part in graph.parts for modes in part.modes]
    return math.prod(forms) if forms else 0
