"""The model of a network whose shafts are travelling waves, and what every network with waves has in common."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import Any

import numpy as np

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.core.errors import AccuracyWarning
from shaftwork.core.notices import warn
from shaftwork.integrate.problem import Problem, Trajectory
from shaftwork.pipeline.arguments import Given, Point, Time
from shaftwork.pipeline.model import Model
from shaftwork.pipeline.motion_start import Ending
from shaftwork.pipeline.prepared import OperatingPoint, Prepared
from shaftwork.pipeline.settled import SteadyState
from shaftwork.waves.wave_motion import engine_of_waves, solve_waves, start_of_waves, twin


class WaveModel(Model):
    """A network with travelling waves, ready to be simulated again and again."""

    @cached_property
    def twin(self) -> Model:
        """The network with springs in place of its waves: it stands and turns steadily as they do."""
        return self._rebuild(twin(self.netlist))

    def state_at_start(
        self, prepared: Prepared, initial: Mapping[str, float] | None, span: tuple[float, float]
    ) -> tuple[Array, Any]:
        """The states (n,) at the start of a run, and the waves where they are not at rest; see `Model.state_at_start`.

        Warns:
            AccuracyWarning: the motion goes on without the waves that were on their way.
        """
        if initial is None and not self.form.has_impulses:
            return np.zeros(len(self.states)), None
        after = prepared.just_after(span)
        if isinstance(initial, Ending):
            if initial.waves is not None:
                return prepared.taken_up(initial, after), initial.waves
            warn_of_lost_waves(span[0], in_leaps=True)
            initial = {name: initial[name] for name in self.states}
        elif initial and span[0] != 0:
            warn_of_lost_waves(span[0])
        values = dict(zip(self.parameters, prepared.p.tolist(), strict=True))
        return start_of_waves(prepared.bound, self.twin.bind(self.twin.vector(values)), initial or {}, after)

    def start_equations(self, values: Mapping[str, float]) -> BoundArrays:
        """The equations of the twin, of which start values tell the states."""
        return self.twin.start_equations(values)

    def point(self, values: Mapping[str, float], at: Point, t: Time) -> OperatingPoint:
        """There is none.

        Raises:
            SimulationError: always; a line has a delay that no matrix holds.
        """
        from shaftwork.frequency.linearization import refuse_waves

        refuse_waves(self.form)
        return super().point(values, at, t)

    def _steady(self, values: Mapping[str, float], t: float, initial: Given) -> SteadyState:
        return self.twin.steady_state(t, initial=initial, parameters=values)

    def _engine(self, prepared: Prepared, problem: Problem, engine: str) -> tuple[str, str]:  # noqa: ARG002
        return engine_of_waves(engine)

    def _solve(self, prepared: Prepared, problem: Problem, engine: str, waves: Any) -> tuple[Trajectory, str, str]:
        name, why = self._engine(prepared, problem, engine)
        steady = self.degree == 0
        return solve_waves(prepared.bound, problem, waves, linear=self.linear, steady=steady), name, why


def warn_of_lost_waves(t_start: float, *, in_leaps: bool = False) -> None:
    """Warn of a motion that goes on at a time in s without what was on its way.

    Args:
        t_start: the time, s.
        in_leaps: whether the motion before is known and has leapt through its waves; else only start values are.
    """
    why, remedy = "start values tell of their ends alone", "Give the motion itself, initial=sol"
    if in_leaps:
        why, remedy = "a long run leaps from one output time to the next", "Simulate it with t_eval='steps'"
    warn(
        f"The motion goes on at t_start = {t_start:g} s without the waves that were on their way through shafts: "
        f"{why}, and the torque of a shaft begins as in steady operation. {remedy}; or simulate all of it in one run, "
        "or take another model of the shaft, such as Lumped(20).",
        AccuracyWarning,
    )
