"""A motion as a function of the parameters of its network, with exact derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.core.errors import ParameterError, SignalError
from shaftwork.formulation.sampling_instants import refuse_sampled
from shaftwork.pipeline.arguments import Given, as_names, closer, relative_tolerance
from shaftwork.pipeline.model import Model
from shaftwork.pipeline.motion_start import refuse_motion
from shaftwork.pipeline.network import Network, network_of
from shaftwork.results.observer import array_in_si
from shaftwork.sensitivities.differentiation import rows_of
from shaftwork.sensitivities.legs import DifferentiatedMotion, motion_of
from shaftwork.sensitivities.motion_slopes import DifferentiatedEquations, MotionSlopes
from shaftwork.sensitivities.smooth_parameters import smooth_parameters, start_states, without_start


class ParametricMotion:
    """A motion for any values of some parameters.

    Args:
        model: the compiled network.
        quantities: names of what is read.
        integrands: name and power of what is integrated over time.
        parameters: names, "shaft.c"; None for all in which the motion is smooth.
        span: start and end of the motion, s.
        initial: start values of states, which do not change with the parameters.
        rtol: relative tolerance of the derivatives; the motion is computed a hundred times closer.
        starts: states whose start values are parameters, too.
        values: of parameters in SI, where they differ from the network's and change no structure.

    Raises:
        CompileError: there are no symbolic equations for a part of the way.
        ParameterError: there is no such parameter, or nothing is smooth in it.
        SignalError: there is no such quantity.
    """

    def __init__(
        self,
        model: Model,
        quantities: Sequence[str],
        integrands: Sequence[tuple[str, int]],
        parameters: Sequence[str] | None,
        span: tuple[float, float],
        initial: Given,
        rtol: float,
        starts: Sequence[str] = (),
        values: Mapping[str, float] | None = None,
    ) -> None:
        self.model, self._span, self._starts = model, span, tuple(dict.fromkeys(starts))
        refuse_sampled(self.model.form, "its derivatives by parameters are not followed from instant to instant")
        refuse_motion(initial, "motion_sensitivities")
        self._rtol = relative_tolerance(rtol)
        states = {state.name for state in self.model.form.states}
        self._initial = {**dict.fromkeys(starts, 0.0), **(initial or {})}
        if unknown := [name for name in self._initial if name not in states]:
            raise ParameterError(
                f"'{unknown[0]}' is no state, so it starts at another state for other parameters. Give start values of "
                f"states: {', '.join(sorted(states))}."
            )
        rows_of(self.model)
        used = [(self.model, self.model.vector(values))]
        smooth_parameters(self.model, parameters, used, span)  # said before the motion is made
        self.nominal = self.motion(values or {})
        """The motion for these values."""
        names = smooth_parameters(self.model, parameters, self.nominal.used.items(), span)
        names = without_start(self.model, names, self._initial, span, are_asked=parameters is not None)
        self.parameters = {
            **{name: (values or {}).get(name, self.model.parameters[name]) for name in names},
            **{name: self._initial[name] for name in self._starts},
        }
        """These values, and behind them start values, in SI."""
        if unknown := [name for name in quantities if name not in self.nominal.solution]:
            _ = self.nominal.solution[unknown[0]]  # raises, with what there is
        self._equations = DifferentiatedEquations(names, self._starts, quantities, integrands)
        self._first = self._at_start()

    def motion(self, values: Mapping[str, float], share: float = 1.0) -> DifferentiatedMotion:
        """The motion for other values of parameters and start values in SI, which change no structure.

        Args:
            values: by name.
            share: of the span, from its start on, that is computed.

        Raises:
            SimulationError: it could not be found, or a prescribed speed jumps.
        """
        initial = {**self._initial, **{name: values[name] for name in self._starts if name in values}}
        values = {name: value for name, value in values.items() if name not in self._starts}
        span = self._span[0], self._span[0] + share * (self._span[1] - self._span[0])
        return motion_of(self.model, span, initial or None, closer(self._rtol), values)

    def slopes(self, motion: DifferentiatedMotion, values: Mapping[str, float]) -> MotionSlopes:
        """The derivatives of the motion for some values, by the parameters and start values.

        Raises:
            SimulationError: there are none.
        """
        parameters = np.array([values.get(name, value) for name, value in self.parameters.items()])
        return MotionSlopes(motion, self._equations, parameters, self._first, self._rtol)

    def _at_start(self) -> Array:
        """(n, m) derivatives of the states at the start; speeds inside a shaft follow from those of its ends."""
        _, here = start_states(self.model, {}, self._initial, self._span)
        slopes = np.zeros((here.size, len(self.parameters)))
        for column, name in enumerate(self.parameters):
            if name in self._starts:  # the states are linear in start values
                moved = {**self._initial, name: self._initial[name] + 1.0}
                slopes[:, column] = start_states(self.model, {}, moved, self._span)[1] - here
        return slopes


@dataclass(frozen=True, eq=False)
class TrajectorySensitivities:
    """Quantities over time and their derivatives by parameters.

    Args:
        name: of the network.
        parameters: values in SI by name.
        t: (k,) times, s.
        values: (k,) by quantity.
        slopes: (k, parameters) derivatives by quantity, at times that do not change with the parameters.
    """

    name: str
    parameters: Mapping[str, float]
    t: Array
    values: Mapping[str, Array]
    slopes: Mapping[str, Array]

    def __getitem__(self, quantity: str) -> dict[str, Array]:
        """(k,) derivatives of a quantity by each parameter."""
        return dict(zip(self.parameters, self.slopes[quantity].T, strict=True))


def trajectory_sensitivities(
    net: Network,
    quantities: str | Sequence[str],
    t: Sequence[float] | Array,
    *,
    parameters: Sequence[str] | None = None,
    starts: str | Sequence[str] = (),
    initial: Given = None,
    rtol: float = 1e-9,
) -> TrajectorySensitivities:
    """Quantities of a motion over time, and their exact derivatives by the parameters of the network.

    Law: S' = (df/dx) S + df/dp for S = dx/dp, through changes of modes and switches of laws as in
    `motion_sensitivities`; of a quantity q(t, x, p), dq/dx S + dq/dp.

    Args:
        net: the network.
        quantities: names of speeds, torques or twists, "shaft.tau".
        t: times in s, ascending; the motion starts at 0.
        parameters: names, "shaft.c"; by default all in which the motion is smooth.
        starts: names of states, "J1.omega", by whose start values is differentiated as well.
        initial: start values of states, which do not change with the parameters.
        rtol: relative tolerance of the derivatives.

    Raises:
        CompileError: there are no symbolic equations for a part of the way.
        ParameterError: there is no such parameter, nothing is smooth in it, or the times do not ascend from zero.
        SignalError: there is no such quantity.
        SimulationError: there is no derivative, see `motion_sensitivities`.
    """
    times = array_in_si("t", t, "s")
    if not (
        times.size and np.isfinite(times).all() and times[0] >= 0.0 and (np.diff(times) >= 0.0).all() and times[-1]
    ):
        raise ParameterError(
            "t must be times in s that ascend from zero or later, and end later, such as np.linspace(0.0, 1.0, 101)."
        )
    names = as_names(quantities)
    if not names:
        raise SignalError("No quantity is named. Give names such as 'shaft.tau'.")
    model, span = network_of(net).compile(), (0.0, float(times[-1]))
    motion = ParametricMotion(model, names, (), parameters, span, initial, rtol, as_names(starts))
    slopes = motion.slopes(motion.nominal, {})
    return TrajectorySensitivities(
        model.name,
        motion.parameters,
        times,
        {name: slopes.values(name, times) for name in names},
        {name: slopes.along(name, times) for name in names},
    )
