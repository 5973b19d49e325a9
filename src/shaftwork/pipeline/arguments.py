"""What a user gives to a run or a study, checked: times, tolerances, outputs, measures, engines."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import get_close_matches
from typing import Any, Literal, TypeVar

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.components.base import Component
from shaftwork.components.shafts import Shaft
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import in_si, numbers_in_si, whole
from shaftwork.formulation.form import StateForm
from shaftwork.integrate.engines import ENGINE_NAMES
from shaftwork.network.graph import CircuitGraph
from shaftwork.network.netlist import Netlist, by_part
from shaftwork.results.extremes import MOST_OUTPUTS
from shaftwork.results.solution import Solution

FINEST_RTOL = float(np.finfo(float).eps)
"""What doubles can keep; a smaller tolerance would promise what no engine holds."""
OUTPUTS, FALLBACK_END = 1001, 10.0
"""Output times, and in s the end of a motion in the command and on live pages, where neither user nor scene says."""
NOMINAL = 1e-3
"""Absolute tolerance as a fraction of the relative one, for a speed of 1 rad/s (m/s, V)."""
STAND_IN = 1.0
"""The value that stands for an input while equations are made: an exact zero would leave it out of them."""
OutputTimes = int | Sequence[float] | Array | Literal["steps"] | None
Given = Mapping[str, float] | None
"""Values by name."""
Point = Given | Solution
"""A point about which a network moves: values by name, or a motion at one time; None for rest."""
Names = str | Sequence[str] | None
Time = float | None
Item = TypeVar("Item")


@dataclasses.dataclass(frozen=True)
class Sizes:
    """How small a motion is.

    Args:
        of: the size of each state by name, where it is below that at ordinary speeds.
        overall: a power of ten up to the largest of all states, where that is below one.
    """

    of: Mapping[str, float] = dataclasses.field(default_factory=dict)
    overall: float = 1.0

    def tolerances(self, ordinary: Array, names: Sequence[str]) -> Array:
        """(n,) absolute tolerances of states by name, as fractions of the relative one, from those at usual speeds."""
        return np.minimum(ordinary, [NOMINAL * self.of.get(name, np.inf) for name in names]) if self.of else ordinary


@dataclasses.dataclass(frozen=True)
class Demand:
    """What is asked of a run.

    Args:
        span: start and end, s.
        rtol: relative tolerance.
        atol: absolute tolerance, or one for each state; None for one that suits them.
        t_eval: output times, or None for the ends of the steps.
        engine: its name, or "auto".
        max_steps: steps before the engine gives up.
        progress: told the time that is reached, or None.
        sizes: of a motion that is tiny.
    """

    span: tuple[float, float]
    rtol: float
    atol: float | Sequence[float] | None
    t_eval: Array | None
    engine: str
    max_steps: int
    progress: Callable[[float], None] | None
    sizes: Sizes = Sizes()

    def tolerances(self, ordinary: Array, names: Sequence[str]) -> Array:
        """(n,) absolute tolerances of states by name, from those at ordinary speeds as fractions of the relative one.

        Raises:
            ParameterError: those that are given cannot be; says what would be right.
        """
        if self.atol is None:
            return self.rtol * self.sizes.tolerances(ordinary, names)
        return absolute_tolerances(self.atol, len(names))


def as_names(names: str | Sequence[str]) -> tuple[str, ...]:
    """Names of which a single one may be given as a text.

    Raises:
        ParameterError: they are no texts.
    """
    listed = (names,) if isinstance(names, str) else tuple(names) if isinstance(names, Iterable) else (names,)
    if wrong := [name for name in listed if not isinstance(name, str)]:
        raise ParameterError(f"{wrong[0]!r} is no name. Give names as texts, such as ['J1', 'shaft'].")
    return listed


def time_span(t_start: Any, t_end: Any) -> tuple[float, float]:
    """Start and end of a run in s.

    Raises:
        ParameterError: it cannot be; says what would be right.
    """
    start, end = in_si("t_start", t_start, "s"), in_si("t_end", t_end, "s")
    if not end > start:
        raise ParameterError(f"t_end = {t_end} must be a finite time after t_start = {t_start}.")
    return start, end


def relative_tolerance(rtol: Any) -> float:
    """The relative tolerance as a number.

    Raises:
        ParameterError: it cannot be; says what would be right.
    """
    value = in_si("rtol", rtol)
    if not FINEST_RTOL <= value < 1:
        raise ParameterError(
            f"rtol = {rtol} must lie between {FINEST_RTOL:.2g}, the rounding of double precision, and 1; "
            "1e-8 is a good choice, and no engine gains much below 1e-13."
        )
    return value


def closer(rtol: float) -> float:
    """A hundredth of a relative tolerance: that of a motion with such derivatives; no engine gains below 1e-13."""
    return max(1e-2 * rtol, 1e-13)


def step_limit(max_steps: Any) -> int:
    """The most steps of a run.

    Raises:
        ParameterError: it is no count.
    """
    count = whole(max_steps)
    if count is None:
        raise ParameterError(f"max_steps = {max_steps!r} must be a whole number of steps, 1 or more.")
    return count


def inner_share(name: str, value: Any) -> float:
    """A level of confidence.

    Raises:
        ParameterError: it does not lie between 0 and 1.
    """
    share = in_si(name, value)
    if not 0.0 < share < 1.0:
        raise ParameterError(f"{name} = {value!r} must lie between 0 and 1.")
    return share


def start_count(starts: Any) -> int:
    """From how many places a search starts.

    Raises:
        ParameterError: it is no count.
    """
    count = whole(starts)
    if count is None:
        raise ParameterError(f"starts = {starts!r} must be a whole number, 1 or more.")
    return count


def seed_number(seed: Any) -> int:
    """A seed of random numbers.

    Raises:
        ParameterError: it is no number that seeds them.
    """
    number = whole(seed, 0)
    if number is None:
        raise ParameterError(f"seed = {seed!r} must be a whole number, 0 or more; the same one gives the same numbers.")
    return number


def absolute_tolerances(atol: Any, size: int) -> Array:
    """(states,) absolute tolerances.

    Raises:
        ParameterError: it cannot be; says what would be right.
    """
    plain = numbers_in_si("atol", atol)
    try:
        values = np.broadcast_to(np.asarray(plain, dtype=float), (size,))
    except (TypeError, ValueError):
        raise ParameterError(f"atol = {atol!r} must be one number, or {size} numbers, one for each state.") from None
    if not (np.isfinite(values).all() and (values > 0).all()):
        raise ParameterError(f"atol = {atol!r} must be above 0; leave it out for a value that suits the states.")
    return values


def refuse_unrecorded(form: StateForm, angles: tuple[str, ...]) -> None:
    """Refuse angles that a compiled model does not record.

    Raises:
        ParameterError: says where to ask for them.
    """
    recorded = {state.name.rpartition(".")[0] for state in form.states if state.kind == "integral"}
    if missing := [name for name in angles if name not in recorded]:
        raise ParameterError(
            f"angles = {list(angles)!r}: this model does not record the angle of {missing[0]!r}. Say so where it "
            f"is compiled: net.compile(angles={list(angles)!r}), or net.simulate(t_end, angles={list(angles)!r})."
        )


def output_times(t_eval: OutputTimes, start: float, end: float) -> Array | None:
    """The output times (k,), or None for those of the engine's steps.

    Raises:
        ParameterError: it cannot be; says what would be right.
    """
    if isinstance(t_eval, str):
        if t_eval != "steps":
            raise ParameterError(f"t_eval = '{t_eval}' must be times, their number, or 'steps'.")
        return None
    if t_eval is None or isinstance(t_eval, (int, np.integer)):
        count = OUTPUTS if t_eval is None else int(t_eval)
        if not 2 <= count <= MOST_OUTPUTS:
            raise ParameterError(f"t_eval = {count} output times: give at least 2 and at most {MOST_OUTPUTS}.")
        return np.linspace(start, end, count)
    plain = numbers_in_si("t_eval", t_eval, "s")
    try:
        times = np.array(plain, dtype=float)  # that of the caller may change
    except (TypeError, ValueError):
        raise ParameterError(f"t_eval = {t_eval!r} must be a list of times, their number, or 'steps'.") from None
    good = times.ndim == 1 and times.size > 0 and bool(np.isfinite(times).all())
    if not good or times[0] < start or times[-1] > end or (np.diff(times) <= 0).any():
        raise ParameterError(f"t_eval must hold strictly increasing times between {start:g} and {end:g} s.")
    return times


def checked_parameters(netlist: Netlist, parameters: Mapping[str, Any]) -> dict[str, float]:
    """New values of parameters "part.name", in SI and within their bounds.

    Raises:
        ParameterError: there is no such parameter, a value is not admissible, or the values of a part do not go
            together.
    """
    values = {str(name): checked_parameter(netlist, str(name), value) for name, value in parameters.items()}
    changed = by_part(values)
    for part in (placed.part for placed in netlist.placed if placed.part.name in changed):
        if type(part).__post_init__ is not Component.__post_init__:  # of values that do not go together
            dataclasses.replace(part, **changed[part.name])
    return values


def range_of(name: str, span: Any, checked: Callable[[Any], float]) -> tuple[float | None, float | None]:
    """Low and high that a user gave for a value, in SI; None leaves a side open.

    Args:
        name: of the value.
        span: what the user gave.
        checked: makes one end a number in SI.

    Raises:
        ParameterError: it is no range, or an end is not admissible.
    """
    if not (isinstance(span, Sequence) and not isinstance(span, str) and len(span) == 2):
        raise ParameterError(f"'{name}': {span!r} is no range. Give (low, high); None leaves a side open.")
    low, high = (None if end is None else checked(end) for end in span)
    if low is not None and high is not None and not low < high:
        raise ParameterError(f"'{name}': ({low:g}, {high:g}) is no range. The first must be less than the second.")
    return low, high


def checked_parameter(netlist: Netlist, name: str, value: Any, where: str = "") -> float:
    """A new value of a parameter "part.name", in SI and within its bounds.

    Args:
        netlist: of the network.
        name: of the parameter.
        value: the number or quantity.
        where: it stands, in words that follow it in a message, " in row 3".

    Raises:
        ParameterError: there is no such parameter, or the value is not admissible.
    """
    owner, _, parameter = name.rpartition(".")
    part = next((placed.part for placed in netlist.placed if placed.part.name == owner), None)
    if part is None or parameter not in part.declared:
        parts = [placed.part for placed in netlist.placed] if part is None else [part]
        names = [f"{other.name}.{key}" for other in parts for key in _numbers(other)]
        close = get_close_matches(name, names, n=3) if part is None else []
        there = f"Close to it: {', '.join(close)}." if close else f"There are: {', '.join(names) or 'none'}."
        raise ParameterError(f"There is no parameter '{name}'. {there}")
    number, objection = part.declared[parameter].magnitude(value)
    if objection is None and not isinstance(number, float):
        objection = "must be a number here: a law is part of the network, so build another network with it"
    if objection is not None:
        raise ParameterError(f"{type(part).__name__} '{owner}': {parameter} = {value!r}{where} {objection}.")
    if not isinstance(part.declared[parameter].magnitude(getattr(part, parameter))[0], float):
        reason = "was not given" if getattr(part, parameter) is None else "is no number"
        raise ParameterError(
            f"{type(part).__name__} '{owner}': {parameter} {reason} when the part was made, so that the equations have "
            f"no place for one. Give a number there, {parameter}=..., and set it anew here. Of '{owner}' there are: "
            f"{', '.join(f'{owner}.{key}' for key in _numbers(part)) or 'none'}."
        )
    return float(number)


def _numbers(part: Component) -> tuple[str, ...]:
    """The parameters of a part that were given as numbers, which may be set anew."""
    return tuple(
        key for key, declared in part.declared.items() if isinstance(declared.magnitude(part.values[key])[0], float)
    )


def changes_structure(form: StateForm, values: Mapping[str, float]) -> bool:
    """Whether other equations hold for new values: one becomes zero or ceases to, decides a ratio, or is of `Auto`."""
    decisive = frozenset((*form.graph.zeros, *form.tree.frozen))
    return any(name in decisive or value == 0 for name, value in values.items()) or branches_anew(form.graph, values)


def branches_anew(graph: CircuitGraph, values: Mapping[str, float]) -> bool:
    """Whether a part may have other branches for new values in SI: `Auto` chooses another mesh for a shaft, say.

    Raises:
        ParameterError: a shaft has become too long for one polynomial.
    """
    changed = by_part(values)
    consulting = (p for p in graph.parts if p.name in changed and not changed[p.name].keys().isdisjoint(p.consulted))
    return any(
        not isinstance(part.component, Shaft)
        or part.component.changed(**changed[part.name]).resolved != part.component.resolved
        for part in consulting
    )


def several(name: str, items: Iterable[Item]) -> tuple[Item, ...]:
    """A sequence that a user gave.

    Raises:
        ParameterError: it is one text, whose letters nobody means, or no sequence.
    """
    if isinstance(items, str) or not isinstance(items, Iterable):
        raise ParameterError(f"{name} = {items!r} must be a sequence. Write {name}=[{items!r}].")
    return tuple(items)


def by_name(measures: Any) -> dict[str, Any]:
    """What a user wants measured, by the names given to it; of a list each measure is its own name.

    Raises:
        ParameterError: it is neither a mapping nor a list, there is nothing in it, or two have the same name.
    """
    if isinstance(measures, str):
        measures = [measures]
    if not isinstance(measures, Iterable):
        raise ParameterError(f"measures = {measures!r} must be a list of names, such as ['max shaft.tau'].")
    if not isinstance(measures, Mapping):
        measures = {text: text for text in map(str, measures)}
    if not measures:
        raise ParameterError("Name a measure, such as measures=['max shaft.tau'].")
    if twice := repeated(map(str, measures)):
        raise ParameterError(f"Two measures are called '{twice}'. Give each a name of its own.")
    return {str(name): measure for name, measure in measures.items()}


def repeated(names: Iterable[str]) -> str:
    """The first name that is there twice; empty where none is."""
    return next((name for name, count in Counter(names).items() if count > 1), "")


def engine_names(engines: Iterable[str]) -> tuple[str, ...]:
    """Engines by name.

    Raises:
        ParameterError: there is no such engine.
    """
    names = several("engines", engines)
    if unknown := [name for name in names if name not in ENGINE_NAMES]:
        raise ParameterError(f"There is no engine {unknown[0]!r}. Take some of: {', '.join(ENGINE_NAMES)}.")
    return names
