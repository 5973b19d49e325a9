"""The equations of a network in each combination of forms that its parts take, with the guards that hold there."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import cache, cached_property, partial
from itertools import count
from operator import methodcaller
from typing import Any

import numpy as np
from scipy import sparse
from sympy import Expr, Symbol

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.array_form.linear_readings import ReadingMatrices
from shaftwork.codegen.array_form.matrices import LinearPart
from shaftwork.codegen.array_form.recovery import BranchHistory
from shaftwork.codegen.code import Moves, around, bindable, is_rough, vectorised, vectorised_list
from shaftwork.codegen.compiled_model import ScalarProgram, machine_program
from shaftwork.codegen.state_transfer import StateTransfer
from shaftwork.codegen.undefined_laws import first_missing, in_words, rough, without_value
from shaftwork.components.discontinuities import pieces_degree
from shaftwork.components.laws import as_expression
from shaftwork.components.laws import t as TIME
from shaftwork.core.calls import BoundedCache
from shaftwork.core.errors import CompileError, SimulationError, no_value
from shaftwork.formulation.explicit_rows import Rows
from shaftwork.formulation.form import Names
from shaftwork.formulation.observables import NamedReadings, Observables
from shaftwork.hybrid.modes.mode_machines import ModeGuards, ModeMachine, ModeNames
from shaftwork.hybrid.modes.starts import MachineReadings
from shaftwork.integrate.engines import available
from shaftwork.integrate.problem import Guards, MachineRates, Problem
from shaftwork.pipeline.model import Model
from shaftwork.pipeline.prepared import Prepared

KEPT = 64
"""Parameter vectors whose matrices are kept."""
CLOCK = 1e-20
"""What a clock counts: heyoka's tolerance is relative to the largest state, which this must never be."""

RightSide = Callable[[float, Array], Array]
GuardValues = Callable[[Array, Array], Array]
Motion = Callable[[float, list[float]], tuple[list[float], list[float]]]
GuardsAt = Callable[[float, list[float]], list[float]]
Near = Callable[[float, list[float], float, Moves, float], tuple[list[float], list[float], list[float]]]


class ModeEquations:
    """One set of equations and its guards.

    Args:
        model: the compiled equations.
        machines: of the network.
        forms: of each machine; None for one of which all are in one.
        rows: of all of them, where some are in one; without these no expressions in states tell what guards read.
    """

    def __init__(
        self,
        model: Model,
        machines: tuple[ModeMachine, ...],
        forms: Sequence[str | None],
        rows: Rows | None = None,
    ) -> None:
        self.model, self.machines = model, machines
        self.whole: ModeEquations = self
        """Where what holds is numbers in the equations: those in which nothing does, of which these are a copy."""
        self.stores, self.quantities = StateTransfer(model.form), Names(model.form)
        self._places = {name: k for k, name in enumerate(model.parameters)}
        self.rows = rows = model.rows if rows is None and None not in forms else rows
        names = tuple(Symbol(name, real=True) for name in model.parameters)
        self._parameters = names if rows is None else rows.parameters
        self.readings = readings = NamedReadings(model.form) if rows is None else Observables(model.form, rows)
        """What parts and nodes show, as expressions."""
        self.parts = {part.name: part for part in model.form.graph.parts}
        mode_guards = ModeGuards(model.form, machines, forms, readings)
        self.resting, self.watched, self.sides = mode_guards.resting, mode_guards.watched, mode_guards.sides
        self.expressions, self._owners = mode_guards.expressions, mode_guards.owners
        """The guards in states, parameters and time; the machine of each."""
        self._shown = MachineReadings(machines, self.parts, readings, self._parameters)
        if rows is None:
            _ = self._shown.function  # so that all quantities are known before any function of them is made
        self._prepared = BoundedCache[bytes, Prepared](KEPT)
        self._matrices = BoundedCache[LinearPart, ReadingMatrices](KEPT)
        self._notes_by_p = BoundedCache[bytes, dict[str, Any]](KEPT)
        self._guards_by_p = BoundedCache[bytes, GuardValues](KEPT)
        self._translated = BoundedCache[tuple[int, Expr], Expr](KEPT)
        self._numbers = [self._places[machine.number] for machine in machines if machine.number in self._places]

    def arriving(self, x: Array) -> dict[str, float]:  # noqa: ARG002
        """What arrives by waves, behind the states, by name; nothing where there are no waves."""
        return {}

    def arriving_rates(self, x: list[float]) -> list[float]:  # noqa: ARG002
        """The rates of what arrives by waves and of its rates."""
        return []

    def states_from(self, t: float, stored: Mapping[str, float], p: Array) -> Array:
        """The states with which the equations take up what was stored, with the inputs of a time in s."""
        return self.stores.states(self.bound(p), t, stored)

    def holds_by_numbers(self, number: int) -> bool:  # noqa: ARG002
        """Whether a machine holds and gives way in these equations, by other numbers in explicit rows."""
        return False

    def states_held(self, x: Array, p: Array) -> Array | None:  # noqa: ARG002
        """The states of other numbers in the same rows, or None where an impact leads there."""
        return x

    @property
    def clocks(self) -> tuple[int, ...]:
        """The guards in `timed` whose integrals stand behind the states."""
        return self.timed

    @cached_property
    def timed(self) -> tuple[int, ...]:
        """Guards that change with time by themselves, and not along straight pieces alone, or where no state moves."""
        every = not self.model.states
        return tuple(k for k, guard in enumerate(self.expressions) if every or pieces_degree(guard) is None)

    def vector(self, base: Mapping[str, float], numbers: Mapping[str, float]) -> Array:
        """The parameter vector with the given values and numbers of modes."""
        p = self.model.defaults.copy()
        for name, value in (*base.items(), *numbers.items()):
            if name in self._places:
                p[self._places[name]] = value
        return p

    def values(self, p: Array) -> Array:
        """The parameters and what else the rows are made of."""
        return p

    def prepared(self, p: Array) -> Prepared:
        """What the numbers of modes do not enter, for the other parameters."""
        plain = p.copy()
        plain[self._numbers] = 0.0
        return self._prepared(plain.tobytes(), lambda: self.model.prepare(plain))

    def bound(self, p: Array) -> BoundArrays:
        """The equations with their parameters; matrices hold no number of a mode."""
        return self.prepared(p).bound.with_laws(p)

    def guards(self, p: Array) -> GuardValues:
        """All guards as a function of times (k,) and states (k, n) to (k, guards)."""
        return self._guards_by_p(p.tobytes(), lambda: self._guards(p))

    def _guards(self, p: Array) -> GuardValues:
        read, parameters = self._read(p), self.values(p).tolist()

        def guards(times: Array, states: Array) -> Array:
            values = np.empty((len(self.expressions), len(times)))
            with np.errstate(all="ignore"):
                for row, value in enumerate(self._many(times, *read(times, states), *parameters)):
                    values[row] = value
            return values.T

        return guards

    @cached_property
    def _many(self) -> Callable[..., Any]:
        return vectorised_list((TIME, *self.readings.symbols, *self._parameters), self.expressions)

    def _read(self, p: Array) -> Callable[[Array, Array], Array]:
        """What guards are made of at times (k,) and states (k, n): the states, or quantities that follow from them."""
        readings = self.readings
        if not isinstance(readings, NamedReadings):
            return lambda _, states: states.T
        bound, reads = self.bound(p), [methodcaller("quantity", quantity) for quantity in readings.quantities]
        return self._reading(bound, self._matrices(bound.part, lambda: ReadingMatrices(bound, reads)))

    def _reading(self, bound: Any, matrices: ReadingMatrices) -> Callable[[Array, Array], Array]:
        return lambda times, states: matrices(BranchHistory(bound, times, states))

    def _read_at(self, t: float, x: Array, p: Array) -> list[float]:
        return [float(np.ravel(value)[0]) for value in self._read(p)(np.array([t]), x[None, :])]

    def first_modes(self, t: float, x: Array, p: Array) -> ModeNames:
        """The mode of each machine in which a motion starts, in the equations in which nothing is joined by a mode."""
        return self._shown.first_modes(t, self._read_at(t, x, p), self.values(p))

    def start_of(self, number: int, besides: str, t: float, x: Array, p: Array) -> str:
        """The mode of a machine in which a motion would start, besides one; empty where it would start in none."""
        return self._shown.start_of(number, besides, t, self._read_at(t, x, p), self.values(p))

    def across(self, numbers: Sequence[int], t: float, x: Array, p: Array) -> list[float]:
        """The speeds across machines."""
        return self._shown.across(numbers, t, self._read_at(t, x, p), self.values(p)) if numbers else []

    def twist(self, number: int) -> int | None:
        """The state that is the twist of a machine, or None where none is."""
        form, owner = self.model.form, self.machines[number].part.name
        angles = ((k, state.branch) for k, state in enumerate(form.states) if state.kind == "integral")
        return next((k for k, branch in angles if form.graph.part_of(branch).name == owner), None)

    def constant(self, number: int, expression: Expr | None, p: Array) -> float:
        """A number that is made of a machine's parameters."""
        value = self.of_machine(number, expression)
        return float(value.xreplace({s: p[self._places[s.name]] for s in value.free_symbols}))

    def of_machine(self, number: int, expression: Expr | None) -> Expr:
        """What is made of a machine's parameters, in those of the network; zero where there is nothing."""
        machine, of_part = self.machines[number], as_expression(expression or 0)
        part = self.parts[machine.part.name]
        return self._translated((number, of_part), lambda: self.readings.guard(part, machine.modes, of_part))

    def problem(self, modes: ModeNames, p: Array) -> Problem:
        """What is the same in all phases of these modes; the rest is empty."""
        bound, clocks, size = partial(self.bound, p), self.clocks, len(self.model.states)
        guards, none = self.guards(p), np.empty(0)
        return Problem(
            rhs=self.right_side(p),
            jacobian=self.slopes(bound) if size else None,
            jacobians=None if clocks or not size else lambda t, y: bound().jacobians(t, y),
            x0=none,
            t0=0.0,
            t_end=0.0,
            names=(*self.model.states, *(f"limit of {self.machines[self._owners[k]].name}" for k in clocks)),
            atol=self.prepared(p).atol,
            guards=Guards(guards if not clocks else lambda t, y: guards(t, y[:, :size]), self.sides(modes), none, none),
            switches=(lambda t, y: bound().switches(t, y[:, :size])) if self.model.arrays.inputs.switching else None,
            symbolic=cache(lambda: None if self.program is None else self.program.bind(self.values(p))),
            compiled=cache(lambda: self._machine(p)),
            explain=lambda t, y: self.without_value(p, modes, t, y[:, :size]),
            rough=lambda t, y: self._rough(p, modes, t, y[:, :size]),
            estimates=self._notes(p),
            rates=None if self.model.form.loop_laws else partial(self._many_rates, p),
        )

    def _many_rates(self, p: Array, times: Array, states: Array) -> Array:
        """The rates of states and clocks at times (k,) and states (k, n)."""
        size, clocks = len(self.model.states), list(self.clocks)
        rates = self.bound(p).rhs(times, states[:, :size].T).T
        return np.hstack([rates, CLOCK * self.guards(p)(times, states[:, :size])[:, clocks]]) if clocks else rates

    def slopes(self, bind: Callable[[], BoundArrays]) -> Callable[[float, Array], Any]:
        """The Jacobian of the states and, behind them, of the clocks, from what makes the equations."""
        if not self.clocks:
            return lambda t, y: bind().jacobian(t, y)
        size, clocks = len(self.model.states), sparse.csc_array((len(self.clocks),) * 2)
        return lambda t, y: sparse.block_diag((bind().jacobian(t, y[:size]), clocks), "csc")

    def alike(self, modes: ModeNames) -> tuple[ModeEquations, ModeNames]:
        """Equations and modes that are the same for the choice of an engine: a law knows a mode by its number alone."""
        return self, tuple(machine.equivalent[name] for machine, name in zip(self.machines, modes, strict=True))

    def judged(self, p: Array, problem: Problem) -> Problem:  # noqa: ARG002
        """The motion by which an engine is chosen."""
        return problem

    def right_side(self, p: Array) -> RightSide:
        """The rates of the states and, behind them, of the clocks; in a run, whatever was before."""
        rates, guards, clocks, size = self._right_side(p), self.guards(p), list(self.clocks), len(self.model.states)
        if not clocks:
            return rates

        def rhs(t: float, y: Array) -> Array:
            wound = CLOCK * guards(np.array([t]), y[None, :size])[0, clocks]
            return np.concatenate([rates(t, y[:size]) if size else np.empty(0), wound])

        return rhs

    def without_value(self, p: Array, modes: ModeNames, times: Array, states: Array) -> SimulationError | None:
        """The error of the first time at which a law or a guard of the modes has no value."""
        error, watched = without_value(self.bound(p), times, states), self.watched(modes)
        missing = first_missing(times, self.guards(p)(times, states)[:, [active.guard for active in watched]])
        if error is not None or missing is None:
            return error
        active = watched[missing[1]]
        return no_value(missing[0], in_words(self.machines[active.machine].part, active.leave.when))

    def _rough(self, p: Array, modes: ModeNames, times: Array, states: Array) -> tuple[float, str] | None:
        """The first time at which a law or a guard has no value in some branch, and which one."""
        law, symbols = rough(self.bound(p), times, states), (TIME, *self.readings.symbols, *self._parameters)
        for active in () if law is not None else self.watched(modes):
            function = vectorised(symbols, self.expressions[active.guard])
            quantities = np.array([*self._read(p)(times, states)]).reshape(-1, times.size)
            for time, values in zip(times, quantities.T, strict=True):
                if is_rough(function, (time, *values, *self.values(p))):
                    return float(time), in_words(self.machines[active.machine].part, active.leave.when)
        return law

    def _notes(self, p: Array) -> dict[str, Any]:
        """What engines find out about the right-hand side, for all phases with these parameters."""
        return self._notes_by_p(p.tobytes(), dict)

    def _right_side(self, p: Array, few_calls: int = 50) -> RightSide:
        """In scalar code where there is some: that of `motion`, as a few calls are not worth code of their own."""
        scalar = self.whole.scalar
        if scalar is None:
            return self.bound(p).rhs
        calls, motion = count(), cache(lambda: self.motion(p)[0])
        scalar_rates = cache(lambda: scalar.bind(self.values(p)))

        def rates(t: float, x: Array) -> Array:
            if next(calls) < few_calls:
                return np.array(motion()(t, x.tolist())[0])
            return scalar_rates()(t, x)

        return rates

    @cached_property
    def scalar(self) -> ScalarProgram | None:
        """The right-hand side in scalar code, where there are rows."""
        return self.model.scalar

    def clock_sizes(
        self,
        span: tuple[float, float],
        x: Array,
        p: Array,
        *,
        samples: int = 64,
        soon: float = 1e-9,
        most: float = 1e-3,
    ) -> Array:
        """(clocks,) the size of each clock over a phase, as far as the time alone tells.

        Args:
            span: start and end of the phase, s.
            x: (n,) its states.
            p: parameters.
            samples: times at which guards are looked at.
            soon: what changes within this part of the phase by more than
            most: this part of its largest value, is nothing but rounding.
        """
        if not self.clocks:
            return np.empty(0)
        length = span[1] - span[0]
        times = np.linspace(span[0], span[1] - soon * length, samples)
        pairs = np.concatenate([times, times + soon * length])
        values = self.guards(p)(pairs, np.tile(x, (pairs.size, 1)))[:, list(self.clocks)]
        largest, changes = np.abs(values).max(axis=0), np.abs(values[:samples] - values[samples:]).max(axis=0)
        # what is another number at once is rounding, and an engine that followed it would not get on
        return CLOCK * np.where(changes < most * largest, largest, 1.0) * length

    def motion(self, p: Array) -> tuple[Motion, GuardsAt, Near]:
        """Rates and guards together, guards alone, and guards `around` an instant, from a time in s and states."""
        if self.rows is not None:
            return self.whole.motions(self.values(p).tolist())
        bound, guards = self.bound(p), self.guards(p)

        def guards_at(t: float, x: list[float]) -> list[float]:
            return guards(np.array([t]), np.array([x]))[0].tolist()  # type: ignore[no-any-return]

        def motion(t: float, x: list[float]) -> tuple[list[float], list[float]]:
            return [*bound.rhs(t, np.array(x)).tolist(), *self.arriving_rates(x)], guards_at(t, x)

        return motion, guards_at, partial(around, motion, guards_at)

    @cached_property
    def motions(self) -> Callable[[list[float]], tuple[Motion, GuardsAt, Near]]:
        """What makes `motion` of the values of all parameters."""
        rows = self.rows
        assert rows is not None  # noqa: S101 (asked only then)
        return bindable({"t": TIME, "x": rows.states}, {"p": rows.parameters}, rows.rates, self.expressions)

    def sizes(self, p: Array) -> list[float]:
        """The nominal size of each state."""
        return self.prepared(p).atol.tolist()  # type: ignore[no-any-return]

    @property
    def program(self) -> Any:
        """The heyoka program with the guards as its events, or None where there can be none."""
        return self.whole.series

    @cached_property
    def series(self) -> Any:
        """The same, made where it is kept."""
        if (rows := self.rows) is None or not (rows.states or self.clocks) or not available("heyoka"):
            return None
        from shaftwork.codegen.taylor.heyoka import build

        states, rates = self._with_clocks(rows)
        changing = [*(rows.parameters[place] for place in self._numbers), *rows.parameters[len(self._places) :]]
        try:
            return build(states, TIME, rows.parameters, rates, tuple(self.expressions), changing)
        except CompileError:
            return None

    def _with_clocks(self, rows: Rows) -> tuple[tuple[Symbol, ...], tuple[Expr, ...]]:
        """The states and, behind them, the clocks, and the rates of all."""
        states = (*rows.states, *(Symbol(f"clock {k}", real=True) for k in self.clocks))
        return states, (*rows.rates, *(CLOCK * self.expressions[k] for k in self.clocks))

    def _machine(self, p: Array) -> MachineRates | None:
        """The right-hand side in machine code with its parameters, or None where there is none."""
        program = self.whole.machine_program
        return None if program is None else MachineRates(*program.bind(np.array(self.values(p))))

    @cached_property
    def machine_program(self) -> Any:
        """The right-hand side in machine code, made where it is kept; None where there is none."""
        if (rows := self.rows) is None:
            return None
        states, rates = self._with_clocks(rows)
        return machine_program(replace(rows, states=states, rates=rates), self.model.name, self.expressions)
