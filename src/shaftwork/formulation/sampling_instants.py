"""The instants at which sampled controllers act."""

from __future__ import annotations

import math

from shaftwork.core.errors import ParameterError, ShaftworkError, SimulationError
from shaftwork.formulation.form import StateForm
from shaftwork.network.netlist import title
from shaftwork.numerics.zeros import just_before


def sampling_instants(form: StateForm, t0: float, t_end: float) -> tuple[float, ...]:
    """The instants in s of a run at which controllers sample.

    Args:
        form: the state form.
        t0: start of the run, s.
        t_end: its end, s.

    Raises:
        ParameterError: there are too many.
    """
    instants: list[float] = []
    for part in form.graph.parts:
        if (sampler := part.component.sampler()) is not None:
            first, last = math.ceil(t0 / sampler.period), math.floor(t_end / sampler.period)
            if last - first > 500_000:  # each ends a step, at 0.1 ms and more
                raise ParameterError(
                    f"'{part.name}' would sample {last - first + 1} times between t = {t0:g} s and {t_end:g} s. Take a "
                    "shorter run, or a longer sample_time."
                )
            instants += [k * sampler.period for k in range(first, last + 1)]
    # An output time that is an instant but for rounding shall show what is held from there on.
    return tuple(map(just_before, instants))


def refuse_sampled(form: StateForm, what: str, kind: type[ShaftworkError] = SimulationError) -> None:
    """Refuse a network of whose sampled controllers something is asked that differential equations alone have.

    Args:
        form: the state form.
        what: there is not then, "there are no matrices A, B, C, D".
        kind: of the error.

    Raises:
        SimulationError: it has one; or another kind of error.
    """
    for part in form.graph.parts:
        if (sampler := part.component.sampler()) is not None:
            raise kind(
                f"{title(part.component)} acts every {sampler.period:g} s and holds its output "
                f"in between, so {what}. Take a continuous controller in its place (without sample_time), or simulate "
                "the motion."
            )
