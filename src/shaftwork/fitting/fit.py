"""Parameters of a network from what was measured of it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.model_observer import ModelObserver
from shaftwork.core.calls import BoundedCache
from shaftwork.core.errors import AccuracyWarning, ParameterError
from shaftwork.core.notices import warn
from shaftwork.core.parameters import Parameter, in_si
from shaftwork.fitting.curves import (
    RecordedMotion,
    RecordedResponse,
    ScaledCurves,
    Scaling,
    Source,
    recorded_motion,
    sizes_of,
)
from shaftwork.fitting.estimation import Estimate
from shaftwork.fitting.fit_result import AT_START, Fit
from shaftwork.fitting.fitted_records import RecordedSeries, read_records
from shaftwork.fitting.several_starts import estimates, starts_from
from shaftwork.fitting.spreads import LOSSES, Data
from shaftwork.network.netlist import Netlist
from shaftwork.numerics.tolerances import TYPED
from shaftwork.pipeline.arguments import (
    as_names,
    checked_parameter,
    checked_parameters,
    range_of,
    relative_tolerance,
    repeated,
    seed_number,
    start_count,
)
from shaftwork.pipeline.model import Model
from shaftwork.pipeline.motion_start import refuse_motion
from shaftwork.pipeline.network import Network, network_of
from shaftwork.results.solution import Solution

Range = tuple[float | None, float | None]
OfEach = Mapping[str, float] | Sequence[Mapping[str, float]] | None
"""Values by name, for all records or one mapping for each."""
_MODELS = BoundedCache[Netlist, Model](1)
"""Of the network that was fitted last."""


def fit(
    net: Network,
    record: Mapping[str, Any] | Sequence[Mapping[str, Any]],
    unknowns: Sequence[str] | Mapping[str, Range | None],
    *,
    start: Mapping[str, float] | None = None,
    sigma: float | Mapping[str, float] | None = None,
    priors: Mapping[str, tuple[float, float]] | None = None,
    loss: str = "linear",
    initial: OfEach = None,
    parameters: OfEach = None,
    at: OfEach = None,
    rtol: float = 1e-6,
    starts: int = 1,
    seed: int = 0,
) -> Fit:
    """Find parameters of a network from a record of its motion, or of its frequency response.

    Law: least squares of what is computed less what is measured, each in standard deviations of its noise, with the
    derivatives of `studies.trajectory_sensitivities`, exact through all events; where there are none (frequency
    responses, sampled controllers, more than some hundred states) central differences. A parameter that stays above
    zero is fitted by its logarithm, and so is its interval, but for what may be zero, a damping or a gap.

    The intervals hold for a model that is right, and for noise that is white: then the `correlation` of neighbouring
    residuals is near zero. Where it is not, something is missing in the model, or samples are closer than the noise
    changes; then true intervals are wider. A fit goes downhill from its start: further `starts` show whether another
    minimum is deeper, and several that end alike are a sign, not a proof, that there is none.

    Args:
        net: the network.
        record: {"t": times in s, "shaft.tau": values, ...}, also a pandas data frame; NaN is no value. Times count from
            the start of the motion. Or {"f": frequencies in Hz, "shaft.tau / motor.tau": complex values}, output over
            input. Values in SI. Or a list of such records, which are fitted together.
        unknowns: names, ["shaft.c", "shaft.d"], also of states whose start values are unknown, "J1.omega"; or by name
            (low, high), None leaves a side open.
        start: values of unknowns to start from; by default those of the network, and of `initial`.
        sigma: standard deviation of the noise in SI, one or by quantity; by default it is estimated from the record.
            Of several records quantities are named "shaft.tau (1)", "shaft.tau (2)", ...
        priors: by name (value, standard deviation), what is known of an unknown without the record; of a parameter
            above zero its logarithm is taken to have a normal distribution, of deviation (standard deviation / value).
        loss: "linear", or for records with outliers "soft_l1", "huber" or "cauchy", see scipy's `least_squares`.
        initial: start values of states; of several records a list, one mapping for each, where they differ.
        parameters: values of other parameters where they differ from the network's, likewise one or a list.
        at: for a frequency response, the point, as for `Model.linearize`, likewise.
        rtol: relative tolerance of the derivatives; motions are computed a hundred times closer.
        starts: how many. Further ones fill the ranges evenly, a parameter above zero by its logarithm; an unknown
            without two finite bounds starts within a factor of two of its first start, or its size beside it. Each is
            followed for twenty motions, and the best quarter is fitted to the end, as the first start is.
        seed: of the further starts.

    Raises:
        ParameterError: there is no such parameter, or an argument is out of its range.
        SignalError: there is no such quantity.
        SimulationError: the motion at the start cannot be computed.

    Warns:
        AccuracyWarning: what is left is no white noise, or more than `sigma`, so that the intervals do not hold.
    """
    starts, seed = start_count(starts), seed_number(seed)
    model = _MODELS(network_of(net).netlist(), net.compile)
    domain, records = read_records(record, ModelObserver(model.form, model.bind).units)
    initials, others, points = (
        _of_each(name, given, len(records))
        for name, given in (("initial", initial), ("parameters", parameters), ("at", at))
    )
    for states in initials:
        refuse_motion(states, "fit")
    names, usual = _names(unknowns), initials[0] or {}
    model, begun = _begun(model, names, start or {})
    spans = unknowns if isinstance(unknowns, Mapping) else dict.fromkeys(names)
    ranges = {name: _range(model, name, spans[name]) for name in names}
    first = {name: begun.get(name, model.parameters.get(name, usual.get(name, 0.0))) for name in names}
    series = {name: one for each in records for name, one in each.items()}
    sources = [
        _source(_with(model, values, first), domain, each, first, relative_tolerance(rtol), states, point)
        for each, states, values, point in zip(records, initials, others, points, strict=True)
    ]
    measured = np.concatenate([one.measured for one in series.values()])
    fitted = _unknowns(model, ranges, first, sizes_of(first, sources, measured))
    curves = ScaledCurves(sources, fitted.scaling)
    data = _data(tuple(series.values()), sigma, *_priors(priors, fitted.scaling), loss)
    bounds, beginning = (fitted.low, fitted.high), _beginning(sources, fitted.scaling)
    first_points = starts_from(fitted.scaling, fitted.start, bounds, starts, seed)
    best, *others = estimates(curves, data, first_points, bounds, beginning, fitted.scaling.stretch)
    _refuse_rest(best, data, tuple(series))
    samples = {name: one.at for name, one in series.items()}
    differences, ends = curves.by_differences, tuple(others)
    result = Fit(net, fitted.units, fitted.scaling, samples, data, best, domain, usual, differences, ends, starts)
    if result.caveat:
        warn(result.caveat, AccuracyWarning)
    return result


def _refuse_rest(best: Estimate, data: Data, names: Sequence[str]) -> None:
    """Refuse records whose noise a robust loss cannot tell, because most of their values are met to rounding.

    Raises:
        ParameterError: there is one.
    """
    if data.loss == "linear" or data.deviations is not None:
        return
    for number, name in enumerate(names):
        largest = np.abs(best.residuals[data.series == number]).max()
        if best.deviations[number] <= TYPED * largest:
            raise ParameterError(
                f"Half of the values of '{name}' or more are met to rounding, as where a drive stands still, so "
                f"loss={data.loss!r} cannot tell its noise. Give sigma={{'{name}': ...}}, leave these values out, or "
                "take loss='linear'."
            )


class _Unknowns(NamedTuple):
    """What is fitted.

    Args:
        scaling: of the unknowns.
        units: by name.
        start: (m,) scaled.
        low: (m,) scaled.
        high: (m,) scaled.
    """

    scaling: Scaling
    units: dict[str, str]
    start: Array
    low: Array
    high: Array


def _of_each(name: str, given: Any, count: int) -> Sequence[Any]:
    """What is given for each record, where it may be given once for all.

    Raises:
        ParameterError: there are more or fewer, or one is something else than values by name.
    """
    each = given if isinstance(given, list | tuple) else [given] * count
    if len(each) != count:
        raise ParameterError(f"{name} has {len(each)} entries for {count} records. Give one for each, or one for all.")
    if others := [one for one in each if not isinstance(one, Mapping | Solution | None)]:
        raise ParameterError(f"{name} must be values by name, such as {{'J1.omega': 8.0}}, not {others[0]!r}.")
    return each


def _with(model: Model, values: Mapping[str, float] | None, unknowns: Mapping[str, float]) -> Model:
    """The model with other values of parameters that are not fitted."""
    if both := [name for name in values or {} if name in unknowns]:
        raise ParameterError(f"'{both[0]}' is unknown and has a value in parameters. Leave it out of one of them.")
    return model.variant(checked_parameters(model.netlist, values)) if values else model


def _beginning(sources: Sequence[Source], scale: Scaling) -> tuple[ScaledCurves, NDArray[np.bool_]] | None:
    """The first part of all records, and which values it holds; None where one has none of its own."""
    motions = [source for source in sources if isinstance(source, RecordedMotion)]
    if len(motions) < len(sources):
        return None
    parts = [motion.beginning() for motion in motions]
    curves = ScaledCurves([part for part, rows in parts if rows.any()], scale)
    return curves, np.concatenate([rows for _, rows in parts])


def _source(
    model: Model,
    domain: str,
    series: Mapping[str, RecordedSeries],
    start: Mapping[str, float],
    rtol: float,
    initial: Mapping[str, float] | None,
    at: Mapping[str, float] | None,
) -> Source:
    samples = {one.quantity: one.at for one in series.values()}
    if domain == "t":
        if at is not None:
            raise ParameterError("at = ... is the point of a frequency response. Of a motion give initial = {...}.")
        return recorded_motion(model, samples, start, initial or {}, rtol)
    if initial:
        raise ParameterError(f"'{next(iter(initial))}' is a start value, which a frequency response has not. Give at.")
    return RecordedResponse(model, {_pair(name): f for name, f in samples.items()}, at)


def _begun(model: Model, names: Iterable[str], start: Mapping[str, float]) -> tuple[Model, dict[str, float]]:
    """The model whose structure is that of the values from which the fit starts, and these values, in SI."""
    if others := [name for name in start if name not in names]:
        raise ParameterError(f"'{others[0]}' has a start and is not unknown. Unknown are: {', '.join(names)}.")
    states = {name: in_si(f"start of '{name}'", start[name], "1") for name in _states(model) if name in start}
    values = checked_parameters(model.netlist, {name: start[name] for name in start if name not in states})
    return (model.variant(values) if model.changes_structure(values) else model), {**values, **states}


def _states(model: Model) -> list[str]:
    return [state.name for state in model.form.states]


def _unknowns(model: Model, ranges: Mapping[str, Range], start: Mapping[str, float], sizes: Array) -> _Unknowns:
    """What is fitted, within its bounds.

    Raises:
        ParameterError: the start is not between them.
    """
    declared = {name: _declared(model.netlist, name) if name in model.parameters else None for name in ranges}
    ends = {name: _ends(declared[name], span) for name, span in ranges.items()}
    for name, (low, high) in ends.items():
        if not low < start[name] < high:
            raise ParameterError(
                f"'{name}' = {start[name]:g} is where the fit starts, and must lie between {low:g} and {high:g}. Give "
                "another one, start={...}, or another range."
            )
    positive = np.array([start[name] > 0 <= low for name, (low, _) in ends.items()])
    to_zero = np.array([parameter is None or parameter.above is None for parameter in declared.values()])
    scaling = Scaling(start, positive, sizes, to_zero)
    units = {name: AT_START if parameter is None else parameter.unit for name, parameter in declared.items()}
    sides = (np.array(values) for values in (list(start.values()), *zip(*ends.values(), strict=True)))
    return _Unknowns(scaling, units, *map(scaling.unknowns, sides))


def _names(unknowns: Any) -> tuple[str, ...]:
    """Those of the unknowns.

    Raises:
        ParameterError: there is none, or one is named twice.
    """
    listed = as_names(unknowns)
    if not listed:
        raise ParameterError("Nothing is unknown. Name what to fit, such as ['shaft.c', 'shaft.d'].")
    if twice := repeated(listed):
        raise ParameterError(f"'{twice}' is named twice. Name each unknown once.")
    return listed


def _range(model: Model, name: str, span: Any) -> Range:
    """Low and high of one, in SI.

    Raises:
        ParameterError: there is no such parameter, or a range is none.
    """
    states = _states(model)
    if name in model.form.graph.zeros:
        raise ParameterError(f"'{name}' is zero, so it is in no equation. Give the value to start from, start={{...}}.")
    if name not in states and name not in model.parameters:
        raise ParameterError(
            f"There is no parameter '{name}' with a number. There are: {', '.join(model.parameters)}. States, whose "
            f"start values may be unknown, are: {', '.join(states)}."
        )
    if span is None:
        return None, None
    return range_of(
        name, span, partial(in_si, name) if name in states else partial(checked_parameter, model.netlist, name)
    )


def _declared(netlist: Netlist, name: str) -> Parameter:
    owner, _, parameter = name.rpartition(".")
    return next(placed.part.declared[parameter] for placed in netlist.placed if placed.part.name == owner)


def _ends(parameter: Parameter | None, span: Range) -> tuple[float, float]:
    """Low and high: those that are given, and those of every part of the kind."""
    declared = (parameter.above, parameter.at_least) if parameter else ()
    lows = [end for end in (span[0], *declared) if end is not None]
    highs = [end for end in (span[1], parameter.at_most if parameter else None) if end is not None]
    return max(lows, default=-np.inf), min(highs, default=np.inf)


def _pair(name: str) -> tuple[str, str]:
    """Output and input of a frequency response."""
    output, slash, source = name.partition("/")
    if not (slash and output.strip() and source.strip()):
        raise ParameterError(f"'{name}' is no response. Write output over input, 'shaft.tau / motor.tau'.")
    return output.strip(), source.strip()


def _deviations(sigma: Any, names: Sequence[str]) -> Array | None:
    """(series,) standard deviations of the noise, or None."""
    if sigma is None:
        return None
    if isinstance(sigma, Mapping):
        if missing := [name for name in names if name not in sigma]:
            raise ParameterError(
                f"sigma has no value for '{missing[0]}'. Give one for each quantity of the record, or none."
            )
        if others := [name for name in sigma if name not in names]:
            raise ParameterError(f"sigma names '{others[0]}', which is not recorded. There are: {', '.join(names)}.")
    values = [sigma[name] if isinstance(sigma, Mapping) else sigma for name in names]
    return np.array([in_si("sigma", value, "1", above=0) for value in values])


def _priors(priors: Mapping[str, tuple[float, float]] | None, scale: Scaling) -> tuple[Array, Array]:
    """(m,) values expected of the scaled unknowns, and their standard deviations; NaN where nothing is."""
    values, deviations = np.full((2, len(scale.names)), np.nan)
    if not isinstance(priors, Mapping | None):
        raise ParameterError(f"priors = {priors!r} must map unknowns to (value, standard deviation).")
    for name, prior in (priors or {}).items():
        if not (isinstance(prior, Sequence) and not isinstance(prior, str) and len(prior) == 2):
            raise ParameterError(f"The prior of '{name}' must be (value, standard deviation), not {prior!r}.")
        value, deviation = (in_si(f"the prior of '{name}'", one, "1") for one in prior)
        if name not in scale.names:
            raise ParameterError(f"'{name}' has a prior and is not unknown. Unknown are: {', '.join(scale.names)}.")
        place = scale.names.index(name)
        if not (math.isfinite(value) and 0 < deviation < math.inf and (value > 0 or not scale.positive[place])):
            raise ParameterError(
                f"The prior of '{name}' must be (value, standard deviation), not ({value}, {deviation})."
            )
        values[place], deviations[place] = value, deviation
    there = ~np.isnan(values)
    scaled = scale.unknowns(np.where(there, values, 1.0))
    return np.where(there, scaled, np.nan), deviations / scale.slopes(scaled)


def _data(series: Sequence[RecordedSeries], sigma: Any, priors: Array, prior_deviations: Array, loss: str) -> Data:
    if loss not in LOSSES:
        raise ParameterError(f"There is no loss {loss!r}. Take one of: {', '.join(LOSSES)}.")
    measured = np.concatenate([one.measured for one in series])
    numbers = np.repeat(np.arange(len(series)), [one.measured.size for one in series])
    deviations = _deviations(sigma, [one.quantity for one in series])
    return Data(measured, numbers, deviations, priors, prior_deviations, loss)
