"""A network at one instant of a stepped motion: what it shows, and how it goes on while nothing happens."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.code import scalar
from shaftwork.codegen.compiled_model import CompiledModel
from shaftwork.codegen.model_observer import ModelObserver
from shaftwork.codegen.state_transfer import StateTransfer
from shaftwork.components.laws import t as TIME
from shaftwork.core.errors import SignalError, SimulationError
from shaftwork.formulation.explicit_rows import Rows
from shaftwork.formulation.form import Names
from shaftwork.formulation.observables import Observables
from shaftwork.integrate.engines import available
from shaftwork.integrate.problem import Problem
from shaftwork.network.kinds import Kind
from shaftwork.pipeline.arguments import Demand, Given
from shaftwork.pipeline.motion_start import Ending
from shaftwork.results.observer import Reader

if TYPE_CHECKING:
    from shaftwork.pipeline.model import Model

SMOOTH = ("heyoka", "numba")
"""Engines with which a step in which nothing happens is a series or two, or a few steps in machine code."""
BESIDE = 1e-9
"""Seconds after an instant at which a quantity is read that has no value in it, as 0/0."""


TORQUES = (Kind.LAW, Kind.THROUGH_SOURCE)
"""Kinds of branches in which new numbers change rates alone."""


class Observations:
    """What the parts show in one set of equations, as functions of time, states and parameters.

    Args:
        model: the equations.
        rows: their rows, or None where there are none.
        shown: what parts and nodes show, as expressions.
    """

    def __init__(self, model: CompiledModel, rows: Rows | None, shown: Observables | None) -> None:
        self.model, self.rows, self._shown = model, rows, shown
        self.names = Names(model.form)
        self._places = {name: place for place, name in enumerate(model.states)}
        self._functions: dict[str, Callable[..., list[float]] | None] = {}

    @cached_property
    def in_laws(self) -> dict[str, int]:
        """The parameters that stand in torques alone, and their places: no speed changes at once where they do.

        Neither are they in the instants at which laws jump, nor in what tells in which mode a part starts.
        """
        form, places = self.model.form, {name: place for place, name in enumerate(self.model.parameters)}
        if form.dependent_across or form.dependent_through:
            return {}
        bound = {[*places][place] for place in self.model.switching.places}
        for part in form.graph.parts:
            templates = [form.graph.branches[k].template for k in part.branches]
            symbols = [s for one in templates if one.kind not in TORQUES for s in one.symbols]
            for element in part.modes:
                for mode in element.options:
                    leaves = (leave.when for leave in mode.leaves if leave.rebound is not None)
                    symbols += [s for one in (mode.starts, *leaves) for s in one.free_symbols]
            bound |= {f"{part.name}.{name}" for name in (*map(str, symbols), *part.consulted)}
        return {name: place for name, place in places.items() if name not in bound}

    def at(self, name: str, t: float, x: list[float], p: list[float]) -> float:
        """A quantity at a time in s; not a number where there is no function of it."""
        if name in self._places:
            return x[self._places[name]]
        if name not in self._functions:
            self._functions[name] = self._function(name)
        function = self._functions[name]
        try:
            return math.nan if function is None else float(function(t, x, p)[0]) + 0.0
        except (ArithmeticError, ValueError):
            return math.nan

    def _function(self, name: str) -> Callable[..., list[float]] | None:
        rows, shown = self.rows, self._shown
        expression = None if rows is None or shown is None or name not in self.names.units else shown.quantity(name)
        if rows is None or expression is None or expression.free_symbols - {TIME, *rows.states, *rows.parameters}:
            return None
        return scalar({"t": TIME, "x": rows.states, "p": rows.parameters}, [expression])


class MomentState(NamedTuple):
    """Where a moment is, as numbers and names that can be stored.

    Args:
        span: for which the equations were prepared, s.
        modes: of each element that changes its mode, in their order.
        snapshot: of the smooth steps.
        vector: values of all parameters.
    """

    span: tuple[float, float]
    modes: tuple[str, ...]
    snapshot: Any
    vector: Array


@dataclass(eq=False)
class Moment:
    """The network at one instant.

    Args:
        model: the equations that hold.
        readings: of them.
        demand: for which they were prepared.
        t: time, s.
        after: the time in s at which inputs are read, later than whatever jumps at that time.
        x: (n,) states.
        vector: values of the parameters, and what else the rows are made of.
        bind: makes the equations with a parameter vector.
        stored: from the equations, a time in s and the states to all that is stored.
        parameters: of the network, by name.
        modes: by element that changes its mode.
        words: the same in the words of phases.
        steps: by which it goes on while nothing happens, or None where there are none.
    """

    model: CompiledModel
    readings: Observations
    demand: Demand
    t: float
    after: float
    x: Array
    vector: Array
    bind: Callable[[Array], BoundArrays]
    stored: Callable[[Callable[[], BoundArrays], float, Array], Mapping[str, float]]
    parameters: Mapping[str, float]
    modes: Mapping[str, str] = field(default_factory=dict)
    words: Mapping[str, str] = field(default_factory=dict)
    steps: Any = None

    def __post_init__(self) -> None:
        self._lists: tuple[list[float], list[float]] | None = None

    def advance(self, end: float) -> bool:
        """Go on to a time in s; False where something happens on the way, and nothing has changed."""
        if self.steps is None or not self.steps.step(end):
            return False
        self.t = self.after = end
        self.x = self.steps.at.x[: self.x.size]
        self._lists = None
        return True

    def set(self, name: str, value: float) -> bool:
        """Give an input another value; False where that changes more than rates, and nothing has changed."""
        place = self.readings.in_laws.get(name)
        if self.steps is None or place is None:
            return False
        vector = self.vector.copy()
        vector[place] = value
        if not self.steps.with_parameters(vector):
            return False
        self.vector, self.parameters, self._lists = vector, {**self.parameters, name: value}, None
        return True

    def ending(self) -> Ending:
        """All that goes on from here."""
        stored = self.stored(self._bound, self.after, self.x)
        return Ending(stored, self.t, self.after, self.modes, self.parameters, None)

    @property
    def place(self) -> MomentState:
        """Where it is."""
        return MomentState(self.demand.span, tuple(self.modes.values()), self.steps.at, self.vector)

    def _bound(self) -> BoundArrays:
        return self.bind(self.vector[: len(self.model.parameters)])

    def __getitem__(self, name: str) -> Any:
        """A quantity, see `Simulation`."""
        if self._lists is None:
            self._lists = self.x.tolist(), self.vector.tolist()
        value = self.readings.at(name, self.after, *self._lists)
        return value if math.isfinite(value) else self._observed(name)

    def _observed(self, name: str) -> Any:
        """A quantity from the branches, where no function of its own tells it."""
        observer = ModelObserver(self.model.form, self._bound, quantities=self.readings.names)
        if name not in observer.units and name not in observer.profiles:
            stored = self.stored(self._bound, self.after, self.x)
            if isinstance(name, str) and name in stored:
                return stored[name]
        motion = _NoMotion()
        Reader(self.model.form.graph.name, tuple(self.model.states), observer, motion).unit(name)

        def read(t: float, x: Array) -> Any:
            at = np.array([t]), x[None, :]
            read_of = observer.profile if name in observer.profiles else observer.signal
            return read_of(name, *at, motion)[0]

        with np.errstate(all="ignore"):
            value = read(self.after, self.x)
            if not np.isfinite(value).all():
                rates = self._bound().rhs(self.after, self.x)
                value = read(self.after + BESIDE, self.x + BESIDE * rates)
        if not np.isfinite(value).all():
            raise SimulationError(
                f"'{name}' of '{self.model.form.graph.name}' has no finite value at t = {self.t:.9g} s: its law "
                "divides by zero there. Read what it is made of, or give the law a finite value."
            )
        return value if np.ndim(value) else float(value)


class _NoMotion:
    """Stands for the motion behind an instant, which is not there."""

    steps = np.zeros(0)

    def __call__(self, times: Array) -> Array:
        raise SignalError(f"One instant tells no states at {times} s.")


def plain_moment(
    model: Model,
    values: Mapping[str, float],
    origin: Given,
    demand: Demand,
    cached: dict[Any, Observations],
    place: MomentState | None = None,
) -> Moment:
    """The network at the start of a span, where no part changes its mode.

    Args:
        model: the equations.
        values: parameters that differ from the model's.
        origin: start values, or where the motion before ended.
        demand: what is asked of the motion from here on.
        cached: readings by what they are of.
        place: in place of the origin, to come back to it.
    """
    prepared, form = model.prepare(model.vector(values) if place is None else place.vector), model.form
    x = model.state_at_start(prepared, origin, demand.span)[0] if place is None else place.snapshot.x
    if model not in cached:
        rows = model.rows
        cached[model] = Observations(model, rows, None if rows is None else Observables(form, rows))
    t = demand.span[0] if place is None else place.snapshot.t
    return Moment(
        model=model,
        readings=cached[model],
        demand=demand,
        t=t,
        after=prepared.just_after(demand.span) if place is None else t,
        x=x,
        vector=prepared.p,
        bind=model.bind,
        stored=StateTransfer(form).at_once,
        parameters={**model.parameters, **values},
        steps=smooth_steps(model, prepared.problem(x, demand), demand, place),
    )


def smooth_steps(model: CompiledModel, problem: Problem, demand: Demand, place: MomentState | None) -> Any:
    """What goes on from a problem while nothing happens; None where nothing does.

    Args:
        model: the equations.
        problem: the motion from here on.
        demand: what is asked of it.
        place: to which the motion comes back, or None.
    """
    form = model.form
    engine, at = smooth_engine(demand.engine), None if place is None else place.snapshot
    if not engine or form.waves or form.loop_laws or form.doubtful or form.samples or not problem.x0.size:
        return None
    if engine == "heyoka":
        from shaftwork.integrate.taylor.smooth_steps import SmoothSteps

        return SmoothSteps(problem, at) if SmoothSteps.suit(problem) else None
    from shaftwork.integrate.explicit.dormand_prince import MachineSteps

    machine = None if demand.engine == "auto" and problem.linear is not None else problem.machine
    return None if machine is None else MachineSteps(problem, machine, at)


def smooth_engine(engine: str) -> str:
    """The engine of steps in which nothing happens, by the one that is asked for; empty where there is none."""
    return next((name for name in SMOOTH if engine in ("auto", name) and available(name)), "")
