"""Steady operation: laws of time that never stop changing, and those that were others before they did."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from itertools import pairwise
from operator import itemgetter
from typing import TYPE_CHECKING

import numpy as np

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.operating import steady_state
from shaftwork.codegen.start_values import initial_state, with_others
from shaftwork.codegen.time_switches import Switching
from shaftwork.codegen.undefined_laws import in_words
from shaftwork.components.laws import t as TIME
from shaftwork.components.noise import HeldNoise, SmoothNoise
from shaftwork.core.errors import NetworkWarning, SimulationError
from shaftwork.core.notices import hint, warn
from shaftwork.formulation.sampling_instants import refuse_sampled
from shaftwork.network.kinds import Kind
from shaftwork.network.netlist import first_few
from shaftwork.numerics.tolerances import EQUAL
from shaftwork.pipeline.prepared import Prepared

if TYPE_CHECKING:
    from shaftwork.network.graph import CircuitGraph, GraphBranch
    from shaftwork.pipeline.model import Model

MIDDLE = (1.0, 1.0 + EQUAL, 1.0)
"""Of a level that lasts its middle is named."""


class SteadyState(dict[str, float]):
    """A steady operation: start values by name, with the time in s at which its laws were read.

    Args:
        values: "part.quantity" to value in SI.
        t: the time.
    """

    def __init__(self, values: Mapping[str, float], t: float) -> None:
        super().__init__(values)
        self.t = t


def steady_operation(prepared: Prepared, t: float, initial: Mapping[str, float]) -> SteadyState:
    """The steady operation with laws as they are at a time in s; where that is infinite, after all their breakpoints.

    Args:
        prepared: the equations.
        t: the time.
        initial: start values from which it is searched.

    Raises:
        SimulationError: nothing comes to rest or to a steady speed.
    """
    refuse_sampled(prepared.form, "there is no steady state of its equations")
    bound, switching, after_all = prepared.bound, prepared.model.switching, not math.isfinite(t)
    when = prepared.model.settled(prepared.p) if after_all else t
    start = initial_state(bound, initial, when)
    if after_all:
        refuse_moving(bound, when, switching)
    x = steady_state(bound, start, when)
    if after_all:
        warn_of_earlier_levels(bound, x, when, switching)
    return SteadyState(dict(zip(prepared.model.states, x.tolist(), strict=True)), when)


def refuse_moving(bound: BoundArrays, t: float, switching: Switching) -> None:
    """Refuse laws that change with time at a time after which none switches any more, or that switch without end.

    Raises:
        SimulationError: there is one.
    """
    graph, endless = bound.program.form.graph, switching.endless(bound.p)
    of_endless = (
        branch.index for branch in graph.branches if graph.parts[branch.part].name in endless and _of_time(branch)
    )
    moving = [graph.branches[k] for k in dict.fromkeys((*bound.moving_laws(t), *of_endless))]
    if not moving:
        return
    laws = [*dict.fromkeys(in_words(graph.parts[branch.part], branch.template.law) for branch in moving)]
    shown = first_few(laws, separator="; ")
    noise = ", or take the noise out (std = 0 for its mean)" if any(map(_is_noise, moving)) else ""
    raise SimulationError(
        f"steady_state() of '{graph.name}' finds no time from which on all laws stay as they are: {shown} "
        f"{'changes' if len(laws) == 1 else 'change'} with time. Name the time at which laws are to be read, "
        f"{hint('steady_state(t=...)', '--t S')}, a late one where they level off{noise}."
    )


def _of_time(branch: GraphBranch) -> bool:
    return TIME in branch.template.law.free_symbols


def _is_noise(branch: GraphBranch) -> bool:
    return bool(branch.template.law.has(HeldNoise, SmoothNoise))


def warn_of_earlier_levels(bound: BoundArrays, x: Array, when: float, switching: Switching) -> None:
    """Warn where the laws had another level, or parts another mode by the clock, than at the time that was read.

    A rise from nothing to the last level is no other level; a higher one on the way, or one that lasts, is.

    Args:
        bound: the equations at the steady state.
        x: (n,) the steady state.
        when: time after the last change, at which laws were read, s.
        switching: of the network.
    """
    edges = [0.0, *(time for time in switching.known(bound.p) if 0.0 < time < when), when]
    spans = [
        (np.nextafter(first, last) if first else 0.0, (first + last) / 2, np.nextafter(last, first))
        for first, last in pairwise(edges)
    ]
    times = np.array(spans)
    changes = [(part, time) for part, time in switching.clocks(bound.p) if 0.0 < time < when]
    levels = list(_levels(bound, x, times, dict(sorted(changes, key=itemgetter(1)))))
    for part, time in changes:
        before = max(edge for edge in edges if edge < time)
        levels.append((f"'{part}' changes its mode at t = {time:.6g} s", (before + time) / 2))
    if levels:
        said, other = "; ".join(words for words, _ in levels), levels[0][1]
        warn(
            f"steady_state() of '{bound.program.form.graph.name}' reads its laws after their last change, at "
            f"t = {when:.6g} s, and they were others before: {said}. Name the time that is meant, "
            + hint(
                f"steady_state(t={when:.6g}) or steady_state(t={other:.6g}).", f"--t {when:.6g} or --t {other:.6g}."
            ),
            NetworkWarning,
        )


def _levels(bound: BoundArrays, x: Array, times: Array, since: Mapping[str, float]) -> Iterator[tuple[str, float]]:
    """Of each law with an earlier level what it gave and when; times are (spans, 3): both ends and the middle.

    `since` names the parts that had other laws before a time in s, which those of now do not tell.
    """
    inputs, graph = bound.program.assembly.inputs, bound.program.form.graph
    values = bound.values(times.ravel(), np.tile(x[:, None], times.size))[1].reshape(len(inputs), *times.shape)
    for branch, history in zip(inputs.tolist(), values, strict=True):
        valid = times[:, 0] >= since.get(graph.part_of(branch).name, 0.0)
        final, courses = history[-1, 1], np.where(valid[:, None], history, np.nan)
        size = np.nanmax(np.abs(courses), initial=0.0)
        close = EQUAL * size
        lasting = np.ptp(courses, axis=1, keepdims=True) <= close
        other = (np.abs(courses) > abs(final) + close) | (courses * final < -(close**2))
        other |= lasting & (np.abs(courses) > close) & (np.abs(courses - final) > close)
        if other.any():
            sizes = np.where(other, np.abs(courses), 0.0) * np.where(lasting, MIDDLE, 1.0)
            span, place = np.unravel_index(int(np.nanargmax(sizes)), sizes.shape)
            time, earlier = float(times[span, place]), courses[span, place]
            name, sign, unit = _quantity(graph, graph.branches[branch])
            levels = f"gives {sign * final:z.6g} {unit} and gave {sign * earlier:z.6g} {unit}"
            yield f"'{name}' {levels} at t = {time:.6g} s", time


def _quantity(graph: CircuitGraph, branch: GraphBranch) -> tuple[str, int, str]:
    """The part of a law, the sign with which it shows what the law gives, and the unit."""
    part, domain = graph.part_of(branch.index), graph.domains[max(branch.plus, branch.minus)]
    if branch.template.kind is Kind.ACROSS_SOURCE:
        return part.name, 1, domain.across.unit
    shown = (signal for signal in part.component.signals().values() if signal.kind == "through")
    sign = next((signal.sign for signal in shown if signal.ends == branch.template.ends), 1)
    return part.name, sign, domain.through.unit.replace("*", " ")


def steady_start(
    model: Model, others: Mapping[str, float], parameters: Mapping[str, float] | None = None
) -> dict[str, float]:
    """Start values: the steady state with the laws at t = 0 s, in which some stores have other values.

    Args:
        model: the compiled network.
        others: start values by name; what is stored elsewhere is that of the steady state.
        parameters: values that differ from the network's.

    Raises:
        ParameterError: a start value is none.
        SimulationError: nothing comes to rest or to a steady speed.
    """
    steady = model.steady_state(t=0.0, parameters=parameters)
    return with_others(model.start_equations(parameters or {}), steady, others, 0.0) if others else dict(steady)
