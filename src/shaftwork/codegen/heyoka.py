"""From sympy rows to a heyoka program: a Taylor integrator compiled once, run for any parameters and start state."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from shaftwork.core.errors import MissingExtraError

Array = NDArray[np.float64]

# From about this number of states on, unrolled code takes seconds to compile and is hardly faster.
LARGEST_UNROLLED = 100
# e^-24 is 4e-11: what a series misses beyond is below the tolerance, and what follows it sees.
NEAR = 24.0


@dataclass(frozen=True)
class HeyokaProgram:
    """A system x' = f(t, x, p) in heyoka's expressions; its integrators are compiled when first needed and kept.

    A condition such as omega > 0 is not evaluated within a step, where a Taylor series knows only one side: the sign of
    each *switch* (omega here) is a parameter, and an event ends the step where the switch passes through zero.

    Args:
        variables: heyoka's state variables, in the order of the states.
        rows: f, one heyoka expression for each state; parameters are par[0..], the signs of the switches follow them.
        switches: heyoka expressions whose sign the rows depend on.
        conditions: the same as text, for messages.
        timed: which of them depend on the time alone; their signs are known before a run, piece by piece.
        parameter_count: number of parameters of the model, without the signs.
        fading: heyoka expressions u of functions that are constant to the last bit where e^-|u| is nothing beside 1; a
            step ends where u comes near, because a series from afar does not show that they change there.
    """

    variables: tuple[Any, ...]
    rows: tuple[Any, ...]
    switches: tuple[Any, ...]
    conditions: tuple[str, ...]
    timed: NDArray[np.bool_]
    parameter_count: int
    fading: tuple[Any, ...] = ()
    _compiled: dict[float, Any] = field(default_factory=dict, repr=False, compare=False)
    _switch_values: list[Any] = field(default_factory=list, repr=False, compare=False)

    def integrator(self, tolerance: float) -> Any:
        """The `heyoka.taylor_adaptive` for a relative tolerance; one compilation for each tolerance."""
        if tolerance not in self._compiled:
            self._compiled[tolerance] = self._compile(tolerance)
        return self._compiled[tolerance]

    def switch_values(self, t: float, x: Array, parameters: Array) -> Array:
        """Values of the switches (k,) at time t in s, state x (n,) and all parameters, the signs included."""
        if not self._switch_values:
            import heyoka

            self._switch_values.append(heyoka.cfunc(list(self.switches), vars=list(self.variables), compact_mode=True))
        compiled = self._switch_values[0]
        values: Array = compiled(x, pars=parameters[: compiled.nparams], time=t)
        return values

    def switch_signs(self, t: float, x: Array, parameters: Array, held: Array | None = None) -> Array:
        """Signs of the switches (k,) at time t in s, state x (n,) and the model's own parameters (p,).

        Those of `held` (k,) that are not zero are taken as they are.
        """
        held = np.zeros(len(self.switches)) if held is None else held
        signs = held
        # A switch may depend on the sign of an earlier one: the maximum of three compares with the maximum of two.
        for _ in range(len(self.switches)):
            values = self.switch_values(t, x, np.concatenate([parameters, signs]))
            found = np.where(held == 0, np.sign(values), held)
            if np.array_equal(found, signs):
                break
            signs = found
        return signs

    def bind(self, parameters: Array) -> BoundProgram:
        """The program with its parameter vector (p,): what `integrate.problem.Problem.symbolic` takes."""
        return BoundProgram(self, np.array(parameters, dtype=float))

    def _compile(self, tolerance: float) -> Any:
        import heyoka

        heyoka.set_logger_level_error()  # a failed run says so itself
        options: dict[str, Any] = {}
        if self.switches or self.fading:
            options["t_events"] = [
                *(
                    _crossing(heyoka.par[index], switch, index)
                    for index, switch in enumerate(self.switches, self.parameter_count)
                ),
                *(heyoka.t_event(value**2 - NEAR**2, callback=_go_on) for value in self.fading),
            ]
        return heyoka.taylor_adaptive(
            list(zip(self.variables, self.rows, strict=True)),
            [0.0] * len(self.rows),
            tol=tolerance,
            compact_mode=len(self.rows) > LARGEST_UNROLLED,
            **options,
        )


@dataclass(frozen=True)
class BoundProgram:
    """A program and the values (p,) of its parameters."""

    program: HeyokaProgram
    parameters: Array


def build(
    states: tuple[sympy.Symbol, ...],
    time: sympy.Symbol,
    parameters: tuple[sympy.Symbol, ...],
    rows: tuple[sympy.Expr, ...],
) -> HeyokaProgram:
    """Translate right-hand sides to heyoka.

    Args:
        states: state symbols, in order.
        time: the symbol of time, s.
        parameters: parameter symbols, in order.
        rows: the derivative of each state.

    Raises:
        MissingExtraError: heyoka is not installed.
        CompileError: a function has no heyoka counterpart, or a symbol is unknown.
    """
    if importlib.util.find_spec("heyoka") is None:
        raise MissingExtraError("heyoka", "fast", "The compiled Taylor engine")
    from shaftwork.codegen.heyoka_expressions import Translator

    translator = Translator(states, time, parameters)
    translated = tuple(translator.expression(row) for row in rows)
    return HeyokaProgram(
        translator.variables,
        translated,
        tuple(translator.switches),
        tuple(translator.conditions),
        np.array(translator.timed, dtype=bool),
        len(parameters),
        tuple(translator.fading.values()),
    )


def _go_on(_integrator: Any, _direction: int) -> bool:
    """The callback of an event that only ends a step."""
    return True


def _crossing(sign: Any, switch: Any, index: int) -> Any:
    """The event that a switch leaves the side that its sign, par[index], says."""
    import heyoka

    def turn(integrator: Any, _direction: int) -> bool:
        integrator.pars[index] = -integrator.pars[index]
        return True

    # Only a fall through zero triggers, so a switch that starts at zero or touches it does not stop the run; one that
    # rests at zero has sign 0 and no event, which would trigger for ever.
    side = heyoka.select(sign, sign * switch, heyoka.expression(1.0))
    return heyoka.t_event(side, direction=heyoka.event_direction.negative, callback=turn)
