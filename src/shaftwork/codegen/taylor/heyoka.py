"""From sympy rows to a heyoka program: a Taylor integrator compiled once, run for any parameters and start state."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple
from weakref import ref

import numpy as np
import sympy
from numpy.typing import NDArray

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.taylor.heyoka_parameters import Fixed, HeldParameters
from shaftwork.components.discontinuities import parts
from shaftwork.components.noise import HeldNoise, SmoothNoise
from shaftwork.core.calls import interruptible
from shaftwork.core.errors import MissingExtraError
from shaftwork.formulation.explicit_rows import SCALAR


class Fading(NamedTuple):
    """How functions are followed that are constant to the last bit where e^-|u| is nothing beside 1.

    Args:
        near: |u| up to which their series show how they change: e^-24 is 4e-11, below the tolerance.
        weight: so much u counts at first, and between the square of this and 1 later.
    """

    near: float = 24.0
    weight: float = 1e-3


FADING = Fading()

# Functions with poles, or an end of what they are defined on.
POLES = (sympy.tan, sympy.cot, sympy.sec, sympy.csc, sympy.coth, sympy.csch, sympy.log, sympy.asin, sympy.acos)

Listener = Callable[[int], bool]


@dataclass(frozen=True, eq=False)
class Compiled:
    """A compiled integrator.

    What its events call must not lead back to it: of such a ring Python sees no end, and would keep it for ever.

    Args:
        integrator: the `heyoka.taylor_adaptive`.
        listeners: the last one is asked at a guard, with its number, whether the run goes on.
    """

    integrator: Any
    listeners: list[Listener]


@dataclass(frozen=True)
class HeyokaProgram:
    """A system x' = f(t, x, p) in heyoka's expressions; its integrators are compiled when first needed and kept.

    A condition such as omega > 0 is not evaluated within a step, where a Taylor series knows only one side: the sign of
    each *switch* (omega here) is a parameter, and an event ends the step where the switch passes through zero.

    Args:
        variables: heyoka's state variables, in the order of the states.
        rows: f, one heyoka expression for each state; parameters are par[0..], and behind them those of `signs`,
            `sides`, `offsets` and `weights`.
        switches: heyoka expressions whose sign the rows depend on.
        conditions: the same as text, for messages.
        timed: which of them depend on the time alone; their signs are known before a run, piece by piece.
        parameter_count: number of parameters of the model, of what is fixed by them and of held functions, without the
            signs.
        fixed: what is made of the model's parameters alone.
        fading: heyoka expressions u of functions that are constant to the last bit where e^-|u| is nothing beside 1; a
            step ends where u comes near, because a series from afar does not show that they change there.
        guards: heyoka expressions at whose change of sign a run ends.
        held: functions that are constant between switches; they are the last of the parameters.
        stepping: which of the switches depend on them.
        singular: whether a law has a root or a pole, beyond which a series may go on otherwise than the law.
    """

    variables: tuple[Any, ...]
    rows: tuple[Any, ...]
    switches: tuple[Any, ...]
    conditions: tuple[str, ...]
    timed: NDArray[np.bool_]
    parameter_count: int
    fixed: Fixed
    fading: tuple[Any, ...] = ()
    guards: tuple[Any, ...] = ()
    held: HeldParameters | None = None
    stepping: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, dtype=bool))
    singular: bool = False
    _idle: dict[float, list[Compiled]] = field(default_factory=dict, repr=False, compare=False)
    _functions: dict[str, Any] = field(default_factory=dict, repr=False, compare=False)

    @cached_property
    def signs(self) -> slice:
        """Places of the signs of the switches among the parameters."""
        return slice(self.parameter_count, self.parameter_count + len(self.switches))

    @cached_property
    def sides(self) -> slice:
        """Places of the sides of the guards: 1 where a rise through zero ends a run, -1 where a fall does, else 0."""
        return slice(self.signs.stop, self.signs.stop + len(self.guards))

    @cached_property
    def offsets(self) -> slice:
        """Places of how far beyond zero the guards have to go on their sides."""
        return slice(self.sides.stop, self.sides.stop + len(self.guards))

    @cached_property
    def weights(self) -> slice:
        """Places of how much each of `fading` counts; they are the last."""
        return slice(self.offsets.stop, self.offsets.stop + len(self.fading))

    @cached_property
    def all_timed(self) -> bool:
        """Whether every switch depends on the time alone."""
        return bool(self.timed.all())

    def guard_met(self, outcome: Any) -> int | None:
        """The guard that an outcome of heyoka means, or None where it means something else."""
        number = -int(outcome) - 1 - len(self.switches) - len(self.fading)
        return number if 0 <= number < len(self.guards) else None

    def weigh(self, integrator: Any) -> None:
        """Set how much each of `fading` counts, so that it stays within bounds for a while from here on.

        heyoka's tolerance is relative to the largest of states and events, and long after a pulse u^2 is 1e18.
        """
        if self.fading:
            values = self._values("fading", self.fading, integrator.time, integrator.state, integrator.pars)
            with np.errstate(over="ignore"):
                integrator.pars[self.weights] = FADING.weight / (values * values + FADING.near**2)

    @contextmanager
    def lent(self, tolerance: float) -> Iterator[Compiled]:
        """An integrator for a relative tolerance, which no other run has meanwhile, of this thread or of others.

        It is compiled once for each tolerance, and of runs at once for each: heyoka then finds its code again.
        """
        idle = self._idle.setdefault(tolerance, [])
        try:
            compiled = idle.pop()
        except IndexError:
            compiled = self._compile(tolerance)
        try:
            yield compiled
        finally:
            compiled.listeners.clear()
            idle.append(compiled)

    def switch_values(self, t: float | Array, x: Array, parameters: Array) -> Array:
        """Values of the switches (k,) at time t in s, state x (n,) and all parameters, the signs included.

        Or (k, times) at many times, with states (n, times) and parameters (p, times).
        """
        return self._values("switches", self.switches, t, x, parameters)

    def guard_values(self, t: float, x: Array, parameters: Array) -> Array:
        """Values of the guards (k,); arguments as for `switch_values`."""
        return self._values("guards", self.guards, t, x, parameters)

    def slopes(self, t: float, x: Array, parameters: Array) -> Array:
        """Derivatives of the states (n,); arguments as for `switch_values`."""
        return self._values("rows", self.rows, t, x, parameters)

    def _values(self, name: str, expressions: tuple[Any, ...], t: float | Array, x: Array, parameters: Array) -> Array:
        if name not in self._functions:
            import heyoka

            # asked for a few times in a step at most, which no optimisation is worth
            options = {"compact_mode": True, "opt_level": 0}
            self._functions[name] = heyoka.cfunc(list(expressions), vars=list(self.variables), **options)
        compiled = self._functions[name]
        return np.asarray(compiled(x, pars=parameters[: compiled.nparams], time=t))

    def switch_signs(self, t: float, x: Array, parameters: Array, unchanged: Array | None = None) -> Array:
        """Signs of the switches (k,) at time t in s, state x (n,) and the parameters (p,) before the signs.

        Those of `unchanged` (k,) that are not zero are taken as they are.
        """
        signs = unchanged = np.zeros(len(self.switches)) if unchanged is None else unchanged
        # A switch may depend on the sign of an earlier one: the maximum of three compares with the maximum of two.
        for left in reversed(range(len(self.switches))):
            values = self.switch_values(t, x, np.concatenate([parameters, signs]))
            before, signs = signs, np.where(unchanged == 0, np.sign(values), unchanged)
            if not left or np.array_equal(before, signs):
                break
        return signs

    def bind(self, parameters: Array) -> BoundProgram:
        """The program with its parameter vector (p,): what `integrate.problem.Problem.symbolic` takes."""
        values = np.concatenate([parameters, self.fixed.values(parameters)])
        return BoundProgram(self, np.append(values, np.zeros(self.parameter_count - len(values))))

    def step(self, number: int, integrator: Any) -> None:
        """Go on to the next whole number, or back to the last, where the motion has come to the end of one.

        What depends on it may be on its other side there, and is not seen to pass through zero.

        Args:
            number: of the switch of the held function.
            integrator: where the motion has come.
        """
        assert self.held is not None  # noqa: S101 (it has such a switch)
        at = integrator.time, integrator.state
        self.held.step(number, *at, integrator.pars)
        signs = integrator.pars[self.signs]
        signs[number] = 1.0
        counting = [*self.held.by_switch]
        unchanged = np.where(self.stepping, 0.0, signs)
        unchanged[counting] = signs[counting]
        signs[:] = self.switch_signs(*at, integrator.pars[: self.parameter_count], unchanged)

    def _compile(self, tolerance: float) -> Compiled:
        import heyoka

        listeners: list[Listener] = []
        heyoka.set_logger_level_error()  # a failed run says so itself
        options: dict[str, Any] = {}
        if self.guards:
            # One of several sets of equations, each for a part of the motion: to optimise such code takes ten times as
            # long as to make it, and saves a tenth of the run.
            options["opt_level"] = 0
        if self.switches or self.fading or self.guards:
            options["t_events"] = [
                *(self._leaves_its_side(number, switch) for number, switch in enumerate(self.switches)),
                *(self._comes_near(number, value) for number, value in enumerate(self.fading)),
                *(self._end(number, guard, listeners) for number, guard in enumerate(self.guards)),
                *(self._outgrows(number, value) for number, value in enumerate(self.fading)),
            ]
        integrator = interruptible(
            heyoka.taylor_adaptive,
            list(zip(self.variables, self.rows, strict=True)),
            [0.0] * len(self.rows),
            tol=tolerance,
            compact_mode=len(self.rows) > SCALAR.states,
            **options,
        )
        return Compiled(integrator, listeners)

    def _comes_near(self, number: int, value: Any) -> Any:
        """The event that what is fading comes near."""
        import heyoka

        return heyoka.t_event(heyoka.par[self.weights.start + number] * (value**2 - FADING.near**2), callback=_go_on)

    def _outgrows(self, number: int, value: Any) -> Any:
        """The event that what is fading counts too much or too little."""
        import heyoka

        size = heyoka.par[self.weights.start + number] * (value**2 + FADING.near**2)
        callback = self._callback(HeyokaProgram.weigh)
        return heyoka.t_event(
            (size - FADING.weight**2) * (1.0 - size), direction=heyoka.event_direction.negative, callback=callback
        )

    def _end(self, number: int, guard: Any, listeners: list[Listener]) -> Any:
        """The event that a guard rises through an offset on its side; the run goes on if whoever listens says so."""
        import heyoka

        side, offset = heyoka.par[self.sides.start + number], heyoka.par[self.offsets.start + number]
        met = heyoka.select(side, side * guard - offset, heyoka.expression(-1.0))

        def ask(_integrator: Any, _direction: int) -> bool:
            return bool(listeners) and listeners[-1](number)

        # An event that has just been met is not met again for 1 ns: heyoka's own cooldown grows with the tolerance, and
        # hides what follows soon.
        return heyoka.t_event(met, direction=heyoka.event_direction.positive, callback=ask, cooldown=1e-9)

    def _leaves_its_side(self, number: int, switch: Any) -> Any:
        """The event that a switch leaves the side that its sign says."""
        import heyoka

        one = heyoka.expression(1.0)
        # Only a fall through zero triggers, so a switch that starts at zero or touches it does not stop the run; one
        # that rests at zero has sign 0 and no event, which would trigger for ever.
        sign = heyoka.par[self.signs.start + number]
        if self.timed[number]:  # a piece ends there, and rounding would tell whether it has turned by then: never;
            # and it must not be large, for heyoka's tolerance is relative to the largest of states and events
            return heyoka.t_event(heyoka.select(sign, one, one), callback=_go_on)
        side = heyoka.select(sign, sign * switch, one)
        return heyoka.t_event(side, direction=heyoka.event_direction.negative, callback=self._passed(number))

    def _passed(self, number: int) -> Callable[[Any, int], bool]:
        """What happens where a switch leaves its side: it has the other, or a whole number gives way to the next."""
        if self.held is not None and number in self.held.by_switch:
            return self._callback(lambda program, integrator: program.step(number, integrator))
        place = self.signs.start + number

        def turn(integrator: Any, _direction: int) -> bool:
            integrator.pars[place] = -integrator.pars[place]
            return True

        return turn

    def _callback(self, change: Callable[[HeyokaProgram, Any], None]) -> Callable[[Any, int], bool]:
        """What an event calls that changes an integrator, and lets it go on; it does not lead back to the program."""
        weakly = ref(self)

        def callback(integrator: Any, _direction: int) -> bool:
            program = weakly()
            assert program is not None  # noqa: S101 (whose run it is)
            change(program, integrator)
            return True

        return callback


@dataclass(frozen=True)
class BoundProgram:
    """A program and the values (p,) of its parameters; those of held functions are zero."""

    program: HeyokaProgram
    parameters: Array


def build(
    states: tuple[sympy.Symbol, ...],
    time: sympy.Symbol,
    parameters: tuple[sympy.Symbol, ...],
    rows: tuple[sympy.Expr, ...],
    guards: tuple[sympy.Expr, ...] = (),
    changing: Collection[sympy.Symbol] = (),
) -> HeyokaProgram:
    """Translate right-hand sides to heyoka.

    Args:
        states: state symbols, in order.
        time: the symbol of time, s.
        parameters: parameter symbols, in order.
        rows: the derivative of each state.
        guards: what may end a run where its sign changes.
        changing: parameters that change in the course of a run.

    Raises:
        MissingExtraError: heyoka is not installed.
        CompileError: a function has no heyoka counterpart, or a symbol is unknown.
    """
    if importlib.util.find_spec("heyoka") is None:
        raise MissingExtraError("heyoka", "fast", "The compiled Taylor engine")
    from shaftwork.codegen.taylor.heyoka_expressions import Translator

    rows, guards = _in_pieces(rows), _in_pieces(guards)
    stepping = sum(isinstance(part, sympy.floor | HeldNoise) for part in parts((*rows, *guards)))
    fixed = Fixed(parameters, (*states, time, *changing), (*rows, *guards))
    first = len(parameters) + len(fixed.places)
    translator = Translator(states, time, parameters, stepping, fixed)
    translated = tuple(translator.expression(row) for row in rows)
    watched = tuple(translator.expression(guard) for guard in guards)
    return HeyokaProgram(
        translator.variables,
        translated,
        switches=tuple(translator.switches),
        conditions=tuple(translator.conditions),
        timed=np.array(translator.timed, dtype=bool),
        parameter_count=first + stepping,
        fixed=fixed,
        fading=tuple(translator.fading.values()),
        guards=watched,
        held=HeldParameters(translator.held, translator.variables, first) if stepping else None,
        stepping=np.array(translator.stepping, dtype=bool),
        singular=any(_singular(node, frozenset(states), time) for row in rows for node in row.atoms(sympy.Pow, *POLES)),
    )


def _singular(node: sympy.Expr, states: frozenset[sympy.Symbol], time: sympy.Symbol) -> bool:
    """Whether a power or a function has a point that a motion may reach, and a series may pass without a trace.

    sqrt((1 - t)^2) is 1 - t to a series that begins before t = 1. A pole of the states takes the motion with it, and
    what is clamped stays away from the ends of what a function is defined on.
    """
    argument = node.args[0]
    if not isinstance(node, sympy.Pow):
        return bool(argument.has(time, *states)) and not isinstance(argument, sympy.Max | sympy.Min)
    whole = bool(node.exp.is_integer)
    of_time = argument.has(time) and states.isdisjoint(argument.free_symbols)
    return not argument.is_positive and bool(
        (not whole and argument.has(time, *states)) or (of_time and not node.exp.is_nonnegative)
    )


def _in_pieces(rows: tuple[sympy.Expr, ...]) -> tuple[sympy.Expr, ...]:
    """Rows with smooth noise written in what is held between whole numbers."""
    noises = {node: node.pieces for node in parts(rows) if isinstance(node, SmoothNoise)}
    return tuple(row.xreplace(noises) for row in rows) if noises else rows


def _go_on(_integrator: Any, _direction: int) -> bool:
    """The callback of an event that only ends a step."""
    return True
