"""What sampled controllers do at an instant: they read, step and hold."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.code import vectorised
from shaftwork.codegen.model_observer import ModelObserver
from shaftwork.codegen.timeline import Timeline
from shaftwork.components.laws import as_expression
from shaftwork.components.laws import t as TIME
from shaftwork.components.sampling import Sampler
from shaftwork.formulation.form import StateForm
from shaftwork.network.graph import GraphPart
from shaftwork.numerics.tolerances import CLEARANCE


@dataclass(frozen=True, eq=False)
class _SampledPart:
    """A sampled controller in a network.

    Args:
        sampler: its step.
        reference: from times (k,) in s to what is asked of the first measured quantity (k,).
        states: where its states are among those of the network.
        outputs: where the outputs are that it holds.
    """

    sampler: Sampler
    reference: Callable[..., Any]
    states: list[int]
    outputs: list[int]

    def is_due(self, t: float, clearance: float) -> bool:
        """Whether a time in s is one of its instants, as far as rounding tells."""
        period = self.sampler.period
        return abs(t - round(t / period) * period) <= clearance


class SampledSteps:
    """The steps of all sampled controllers of a network in a run.

    Args:
        form: the state form.
        values: of the parameters of the run.
        bind: makes the array program with them.
        instants: at which inputs jump.
        span: start and end of the run, s.
    """

    def __init__(
        self,
        form: StateForm,
        values: Mapping[str, float],
        bind: Callable[[], BoundArrays],
        instants: Timeline,
        span: tuple[float, float],
    ) -> None:
        self._places = {state.name: k for k, state in enumerate(form.states)}
        samplers = ((part, part.component.sampler()) for part in form.graph.parts)
        self._parts = tuple(
            _placed(part, sampler, self._places, values) for part, sampler in samplers if sampler is not None
        )
        self._instants, self._observer = instants, ModelObserver(form, bind, instants)
        self._clearance = CLEARANCE * math.ulp(max(map(abs, span)))

    def __call__(self, t: float, x: Array) -> Array:
        """The states (n,) after what is sampled at a time in s, from those before it.

        What is measured is read before whatever else jumps at that instant, references after it. All controllers of
        one instant read the same.
        """
        before, after = self._instants.sides(t)
        after = max(after, t + self._clearance)  # of the law that is asked nobody else knows the jumps
        result = np.array(x, dtype=float)
        for part in (each for each in self._parts if each.is_due(t, self._clearance)):
            sampler, state = part.sampler, x[part.states]
            deviation = sampler.setpoints - np.array([self._measured(name, before, x) for name in sampler.measured])
            deviation[0] += part.reference(np.array([after]))[0]
            result[part.outputs] = sampler.C @ state + sampler.D @ deviation
            result[part.states] = sampler.A @ state + sampler.B @ deviation
        return result

    def _measured(self, name: str, t: float, x: Array) -> float:
        if name in self._places:
            return float(x[self._places[name]])
        return float(self._observer.signal(name, np.array([t]), x[None])[0])


def _placed(part: GraphPart, sampler: Sampler, places: dict[str, int], values: Mapping[str, float]) -> _SampledPart:
    # a number may have been set from outside since the part was made
    law = vectorised((TIME,), as_expression(values.get(f"{part.name}.reference", sampler.reference)))
    states, outputs = (
        [places[f"{part.name}.{letter}_{k}"] for k in range(1, count + 1)]
        for letter, count in (("x", len(sampler.A)), ("x_u", len(sampler.C)))
    )
    return _SampledPart(sampler, lambda t: np.zeros_like(t) + law(t), states, outputs)
