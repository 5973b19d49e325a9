"""How natural frequencies and measures of a motion change with the parameters: exact, from the symbolic equations."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eig
from sympy import Expr, Symbol

from shaftwork.codegen.code import vectorised_list
from shaftwork.codegen.derivatives import Derivatives, SlopeMatrix
from shaftwork.codegen.elements import Array
from shaftwork.codegen.expressed import Expressed
from shaftwork.components.laws import t as TIME
from shaftwork.core.errors import CompileError, ParameterError, SimulationError
from shaftwork.integrate.forward import Forward, forward
from shaftwork.pipeline.analysis import Given, Point, Time, operating_point
from shaftwork.pipeline.arguments import relative_tolerance, time_span
from shaftwork.pipeline.model import Model
from shaftwork.pipeline.phased import PhasedModel
from shaftwork.pipeline.settling import Settling
from shaftwork.reduction.rows import Rows
from shaftwork.results.measures import SMALLEST, Measure
from shaftwork.results.sensitivities import FrequencySensitivities, MotionSensitivities
from shaftwork.results.slopes import Complex
from shaftwork.results.turning import turning_points

Read = Callable[[Array, Array, Array], Array]
"""From times (k,), states (k, n) and parameters (p,) to values (k,)."""
APART = 1e-6
"""Rates that differ by less than this part of the largest are one rate, which has no derivative of its own."""


def frequency_sensitivities(
    model: Model, at: Point = None, *, parameters: Sequence[str] | None = None, t: Time = None
) -> FrequencySensitivities:
    """Derivatives of natural frequencies and damping ratios by parameters, the point held.

    Law: d rate = y* dA x / (y* x) with the right and left eigenvectors x, y of A.

    Args:
        model: the compiled network.
        at: the point, as for `Model.linearize`.
        parameters: names; by default all.
        t: time at which laws are read, s; by default as for `Model.linearize`.

    Raises:
        CompileError: the network is too large for symbolic equations.
        ParameterError: there is no such parameter.
        SimulationError: two modes that swing have the same rate.
    """
    names = _names(model, parameters)
    equations, p, x, time = _near(model, at, t)
    rows = _rows(equations)
    derivatives = Derivatives(rows, _symbols(names))
    rates, left, right = eig(derivatives.by_states(time, x, p), left=True, right=True)
    swinging = np.flatnonzero(rates.imag > 0)
    swinging = swinging[np.argsort(np.abs(rates[swinging]), kind="stable")]
    _refuse_equal(rates, swinging)
    changes = derivatives.jacobian_slopes(time, x, p)
    slopes = np.array([_slope(left[:, k], changes, right[:, k]) for k in swinging]).reshape(len(swinging), len(names))
    values = dict(zip(equations.parameters, p.tolist(), strict=True))
    given = {name: values.get(name, model.parameters[name]) for name in names}
    return FrequencySensitivities(model.name, given, rates[swinging], slopes)


def _slope(left: Complex, changes: Array, right: Complex) -> Complex:
    """(parameters,) derivative of one rate."""
    made: Complex = np.einsum("i,pij,j->p", left.conj(), changes, right) / (left.conj() @ right)
    return made


def _refuse_equal(rates: Complex, chosen: NDArray[np.intp]) -> None:
    size = np.abs(rates).max(initial=0.0)
    for number, k in enumerate(chosen.tolist()):
        others = np.delete(rates, k)
        if others.size and np.abs(others - rates[k]).min() < APART * size:
            raise SimulationError(
                f"Mode {number + 1}, {abs(rates[k]) / (2 * np.pi):.6g} Hz, has the rate of another one: a frequency "
                "that two modes share has no derivative. Make what is alike in the network a little different."
            )


def motion_sensitivities(
    model: Model,
    measures: Mapping[str, Measure],
    t_end: float,
    *,
    parameters: Sequence[str] | None = None,
    initial: Given = None,
    rtol: float = 1e-9,
) -> MotionSensitivities:
    """Derivatives of measures of a motion by parameters, from the sensitivity equations beside the motion.

    Law: S' = (df/dx) S + df/dp for S = dx/dp; of an extreme, dq/dx S + dq/dp at its time, since q' = 0 there.

    Args:
        model: the compiled network.
        measures: by name; "max", "min", "peak" and "end".
        t_end: end of the motion, s.
        parameters: names; by default all.
        initial: start values of states, which do not change with the parameters.
        rtol: relative tolerance.

    Raises:
        CompileError: parts change their mode or a law switches, whose time changes with the parameters; or the network
            is too large for symbolic equations.
        ParameterError: there is no such parameter, or a measure or start value is none that has a derivative here.
    """
    names, (_, end) = _names(model, parameters), time_span(0.0, t_end)
    rows, p = _rows(model), model.defaults
    _refuse_switching(model, end)
    if unknown := [name for name in initial or {} if name not in model.states]:
        raise ParameterError(f"'{unknown[0]}' is no state, so it starts at another state for other parameters.")
    x0 = np.array([float((initial or {}).get(name, 0.0)) for name in model.states])
    derivatives = Derivatives(rows, _symbols(names))
    motion = forward(
        lambda t, x: model.rhs(t, x, p),
        lambda t, x: (derivatives.by_states(t, x, p), derivatives.by_parameters(t, x, p)),
        x0,
        (0.0, end),
        len(names),
        relative_tolerance(rtol),
    )
    expressed = Expressed(model.form, rows)
    found = {name: _measured(rows, p, motion, expressed, made, _symbols(names)) for name, made in measures.items()}
    given = {name: model.parameters[name] for name in names}
    values = {name: value for name, (value, _) in found.items()}
    return MotionSensitivities(model.name, given, values, {name: by for name, (_, by) in found.items()})


def _measured(
    rows: Rows, p: Array, motion: Forward, expressed: Expressed, measure: Measure, symbols: Sequence[Symbol]
) -> tuple[float, Array]:
    """A measure and its derivatives (parameters,)."""
    quantity = expressed.quantity(measure.quantity)
    if quantity is None or measure.kind not in ("max", "min", "peak", "end"):
        raise ParameterError(
            f"'{measure}' has no derivative here. Take 'max', 'min', 'peak' or 'end' of a speed, a torque or a twist."
        )
    time = motion.steps[-1] if measure.kind == "end" else _time_of(rows, p, motion, quantity, measure.kind)
    x, S = motion.states(time), motion.slopes(time)
    by_states, by_parameters = (SlopeMatrix(rows, [quantity], every)(time, x, p)[0] for every in (rows.states, symbols))
    value = _value(rows, quantity)(np.array([time]), x[None, :], p)[0]
    size = np.sign(value) if measure.kind == "peak" else 1.0
    return float(size * value), np.asarray(size * (by_states @ S + by_parameters))


def _time_of(rows: Rows, p: Array, motion: Forward, quantity: Expr, kind: str) -> float:
    read = _value(rows, quantity)

    def values(times: Array) -> Array:
        return read(times, np.array([motion.states(float(t)) for t in times]), p)

    turns = turning_points(values, motion.steps, smallest=SMALLEST)
    which = {"max": turns.values, "min": -turns.values, "peak": np.abs(turns.values)}[kind]
    return float(turns.t[int(which.argmax())])


def _value(rows: Rows, quantity: Expr) -> Read:
    function = vectorised_list((TIME, *rows.states, *rows.parameters), (quantity,))
    return lambda times, states, p: np.broadcast_to(function(times, *states.T, *p.tolist())[0], times.shape)


def _names(model: Model, asked: Sequence[str] | None) -> tuple[str, ...]:
    """The parameters by which to differentiate.

    Raises:
        ParameterError: there is no such parameter, or it has decided which equations hold.
    """
    declared = {f"{placed.part.name}.{name}" for placed in model.netlist.placed for name in placed.part.declared}
    known = [name for name in model.parameters if name in declared]
    decisive = {*model.form.graph.zeros, *model.form.tree.frozen}
    if asked is None:
        return tuple(name for name in known if name not in decisive)
    for name in asked:
        if name in decisive:
            raise ParameterError(
                f"'{name}' decides which equations hold, so nothing is smooth in it. Give it a value that is not "
                "exactly zero, and ratios that are not alike."
            )
        if name not in known:
            raise ParameterError(f"There is no parameter '{name}' with a number. There are: {', '.join(known)}.")
    return tuple(asked)


def _symbols(names: Sequence[str]) -> tuple[Symbol, ...]:
    return tuple(Symbol(name, real=True) for name in names)


def _rows(model: Model) -> Rows:
    if model.rows is None or not model.states:
        raise CompileError(
            f"'{model.name}' has no symbolic equations to differentiate: it is too large, too closely coupled, holds "
            "waves, or has no states. Take fewer elements, such as model=Lumped(10), or differences of two runs."
        )
    return model.rows


def _near(model: Model, at: Point, t: Time) -> tuple[Model, Array, Array, float]:
    """The equations that hold at a point, their parameters, the states and the time."""
    if not isinstance(model, PhasedModel):
        p = model.defaults
        time, x = operating_point(model, p, at, t, model.settled(p))
        return model, p, x, time
    phases = model.phases
    first = phases.assembly(phases.first)
    p = first.vector({}, phases.numbers(phases.first))
    time, x = operating_point(first.model, p, at, t, 0.0 if at is None else first.model.settled(p))
    settling = Settling(phases, {}, (0.0, 1.0))
    moment, _ = settling.settle(time, time, settling.started(time, x), None)
    return moment.regime.assembly.model, moment.regime.p, moment.x, time


def _refuse_switching(model: Model, end: float) -> None:
    form = model.form
    switches = isinstance(model, PhasedModel) or form.has_impulses or model.arrays.inputs.switching
    if switches or len(model.switching.timeline(model.defaults, 0.0, end).times):
        raise CompileError(
            f"'{model.name}' changes its equations on the way, at times that depend on the parameters. Take the "
            "difference of two variants, studies.sweep(...)."
        )
