"""Measures of a motion as functions of design variables, with their gradients."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.core.errors import NetworkError, ParameterError, SimulationError, in_one_line
from shaftwork.numerics.differences import differences
from shaftwork.optimization.optimum import in_words
from shaftwork.pipeline.arguments import closer
from shaftwork.pipeline.network import Network
from shaftwork.pipeline.settled import steady_start
from shaftwork.results.measures import Measure
from shaftwork.results.solution import Solution
from shaftwork.sensitivities.parametric_motion import ParametricMotion
from shaftwork.sensitivities.sensitivities import integrand, measured

Goal = str | Callable[[Mapping[str, float]], float]
"""A measure, "max shaft.tau", or a function of all parameters, such as a mass or a price."""


class MeasuredMotion:
    """Goals as functions of design variables.

    Args:
        net: the network.
        ranges: (low, high) by variable; nothing is asked outside them.
        goals: by name.
        t_end: end of the motion, s.
        initial: start values of states.
        rtol: relative tolerance of the gradients.
        steady: whether the motion starts in the steady state at t = 0, of which `initial` changes some values. It moves
            with the variables, so gradients are differences then.
    """

    def __init__(
        self,
        net: Network,
        ranges: Mapping[str, tuple[float, float]],
        goals: Mapping[str, Goal],
        t_end: float,
        initial: Mapping[str, float] | None,
        rtol: float,
        *,
        steady: bool,
    ) -> None:
        self._names, self._goals = tuple(ranges), goals
        self._low, self._high = np.array(list(ranges.values())).T
        self._read = {name: Measure.read(goal) for name, goal in goals.items() if isinstance(goal, str)}
        self._integrands = [item for one in self._read.values() if (item := integrand(one)) is not None]
        self._model, self._t_end, self._initial, self._rtol = net.compile(), t_end, initial, rtol
        quantities = tuple(dict.fromkeys(one.quantity for one in self._read.values()))
        self._motion = (
            None
            if steady
            else ParametricMotion(self._model, quantities, self._integrands, self._names, (0.0, t_end), initial, rtol)
        )
        self._fixed = self._model.parameters
        self._known = dict[bytes, dict[str, tuple[float, Array]]]()
        """What was computed so far, by variables: a descent comes back to its best design."""
        self._failures = dict[bytes, str]()
        """Why there is no motion or no number of a function, by variables."""
        self.motions = 0
        """How many were computed."""

    def values(self, variables: Array) -> dict[str, float]:
        """Values of the variables by name."""
        return dict(zip(self._names, variables.tolist(), strict=True))

    def at(self, variables: Array) -> dict[str, tuple[float, Array]]:
        """Each goal with its gradient (m,); NaN where there is no motion."""
        if (key := variables.tobytes()) not in self._known:
            self._known[key] = self._computed(variables)
        return self._known[key]

    def undefined(self, variables: Array) -> str:
        """Which goal has no finite value and why; empty where all have one."""
        goals = {name: value for name, (value, _) in self.at(variables).items() if not np.isfinite(value)}
        if goals and (failure := self._failures.get(variables.tobytes())):
            return failure
        return next((f"{name} is {value:g}" for name, value in goals.items()), "")

    def _computed(self, variables: Array) -> dict[str, tuple[float, Array]]:
        values, results = self.values(variables), dict[str, tuple[float, Array]]()
        if self._read:
            self.motions += 1
            try:
                results = self._measures(values)
            except (SimulationError, NetworkError) as error:
                self._failures[variables.tobytes()] = f"there is no motion ({in_one_line(error).rstrip('.')})"
                results = {name: (np.nan, np.zeros(variables.size)) for name in self._read}
        for name, goal in self._goals.items():
            if not isinstance(goal, str):
                try:
                    results[name] = self._of_parameters(name, goal, variables)
                except SimulationError as error:
                    self._failures[variables.tobytes()] = in_one_line(error).rstrip(".")
                    results[name] = np.nan, np.zeros(variables.size)
        return results

    def _measures(self, values: Mapping[str, float]) -> dict[str, tuple[float, Array]]:
        if self._motion is None:
            return self._by_differences(self._from_steady(values), values)
        motion = self._motion.motion(values)
        try:
            slopes = self._motion.slopes(motion, values)
            integrals = dict(zip(self._integrands, slopes.integrals(), strict=True))
            return {name: measured(one, motion.solution, slopes, integrals) for name, one in self._read.items()}
        except SimulationError:  # no derivative just there: two extremes of one height, or a stop that is only touched
            return self._by_differences(motion.solution, values)

    def _from_steady(self, values: Mapping[str, float]) -> Solution:
        initial = steady_start(self._model, self._initial or {}, values)
        rtol = closer(self._rtol)
        return self._model.simulate(self._t_end, initial=initial, parameters=values, rtol=rtol, t_eval="steps")

    def _by_differences(self, solution: Solution, values: Mapping[str, float]) -> dict[str, tuple[float, Array]]:
        """All measures of the motion for some values, with slopes by motions beside it."""

        def all_of(solution: Solution) -> Array:
            return np.array([measure.of(solution) for measure in self._read.values()])

        def beside(at: Array) -> Array:
            near = self.values(at)
            return all_of(self._from_steady(near) if self._motion is None else self._motion.motion(near).solution)

        at = np.array(list(values.values()))
        steps = self._steps(at, 1e-4)  # measures are known to some 1e-9
        slopes = differences(beside, at, steps, self._low, self._high)
        return dict(zip(self._read, zip(all_of(solution).tolist(), slopes, strict=True), strict=True))

    def _of_parameters(
        self, name: str, goal: Callable[[Mapping[str, float]], float], variables: Array
    ) -> tuple[float, Array]:
        """What a function gives, with its gradient.

        Raises:
            ParameterError: it gives no number.
            SimulationError: it fails, or is finite here, but on neither side.
        """

        def value(at: Array) -> float:
            try:
                result: Any = goal({**self._fixed, **self.values(at)})
            except Exception as error:  # of the user's own function: a reason, not the end of all starts
                raise SimulationError(
                    f"the function '{name}' raises {type(error).__name__}: {in_one_line(error)}"
                ) from error
            try:
                return float(1.0 * result)  # a product, as float alone reads texts
            except TypeError:
                raise ParameterError(
                    f"The function '{name}' gives {result!r} at {in_words(self.values(at))}. It must give a number."
                ) from None

        def finite(at: Array) -> Array:
            if not np.isfinite(result := value(at)):
                raise SimulationError(f"The function '{name}' is {result:g} at {in_words(self.values(at))}.")
            return np.array([result])

        if not np.isfinite(here := value(variables)):
            return here, np.zeros(variables.size)
        return here, differences(finite, variables, self._steps(variables, 1e-6), self._low, self._high)[0]

    def _steps(self, at: Array, share: float) -> Array:
        """(m,) steps of differences: a share of the variable, where it is near zero or far from it of its range.

        Ranges may have decades, so a variable in the lowest hundredth of its range steps less than one at the top.
        """
        width = self._high - self._low
        return share * np.clip(np.abs(at), 0.01 * width, width)
