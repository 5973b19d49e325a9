"""Sensitivities of a network: which parameter moves a frequency, or a torque, and by how much."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from shaftwork.core.errors import ParameterError
from shaftwork.pipeline.arguments import Given, Point, Time, by_name
from shaftwork.pipeline.network import Network, network_of
from shaftwork.results.measures import Measure
from shaftwork.sensitivities.sensitivities import frequency_sensitivities as of_frequencies
from shaftwork.sensitivities.sensitivities import motion_sensitivities as of_motion
from shaftwork.sensitivities.sensitivity_tables import FrequencySensitivities, MotionSensitivities


def frequency_sensitivities(
    net: Network, at: Point = None, *, parameters: Sequence[str] | None = None, t: Time = None
) -> FrequencySensitivities:
    """Derivatives of the natural frequencies and damping ratios of a network by its parameters, exact.

    Args:
        net: the network.
        at: the point about which it moves, as for `Network.modes`; it is held while a parameter changes.
        parameters: names, "shaft.c"; by default all in which the equations are smooth: not what is exactly zero, whole
            or the seed of a noise.
        t: time at which laws are read, s.

    Raises:
        CompileError: the network is too large for symbolic equations.
        ParameterError: there is no such parameter.
        SimulationError: two modes have the same rate.
    """
    return of_frequencies(network_of(net).compile(), at, parameters=_listed(parameters), t=t)


def motion_sensitivities(
    net: Network,
    measures: Mapping[str, str] | Sequence[str],
    *,
    t_end: float,
    parameters: Sequence[str] | None = None,
    initial: Given = None,
    rtol: float = 1e-9,
) -> MotionSensitivities:
    """Derivatives of measures of a motion by the parameters of the network, exact, by its sensitivity equations.

    They go through all that changes on the way: modes of parts, impacts, laws that switch with the time or the motion.

    Args:
        net: the network.
        measures: as in `sweep`; all but "damage".
        t_end: end of the motion, s.
        parameters: names, "shaft.c"; by default all in which the motion is smooth.
        initial: start values of states.
        rtol: relative tolerance of the derivatives; the motion is computed a hundred times closer.

    Raises:
        CompileError: there are no symbolic equations for a part of the way.
        ParameterError: there is no such parameter or measure, or nothing is smooth in it.
        SignalError: there is no such quantity.
        SimulationError: there is no derivative: something is only touched, what comes together has no order, a
            prescribed speed jumps against an inertia, or two extremes are of one height.
    """
    named = by_name(measures)
    if others := [name for name, text in named.items() if not isinstance(text, str)]:
        raise ParameterError(
            f"measure '{others[0]}' = {named[others[0]]!r} must be a name, such as 'max shaft.tau': of anything else "
            "nothing here knows the derivative. Take differences of two runs."
        )
    read = {name: Measure.read(text) for name, text in named.items()}
    model = network_of(net).compile()
    return of_motion(model, read, t_end, parameters=_listed(parameters), initial=initial, rtol=rtol)


def _listed(names: Sequence[str] | None) -> Sequence[str] | None:
    return (names,) if isinstance(names, str) else names
