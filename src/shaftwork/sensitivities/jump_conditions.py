"""What a change of mode, or a switch of a law, does to the derivatives of a motion by parameters: its jump conditions.

At the time t* of a change, whose derivative t' follows from what has caused it, the states x and their derivatives S by
parameters go over into those of the new equations, x+ = h(x-), with the rates f on both sides, as

    S+ = h_x (S- + f- t') + h_p + h_t t' - f+ t'.

A guard g(t, x, p) = 0 as the cause has t' = -(g_x S + g_p) / (g_x f + g_t); a law that switches with the time alone has
no g_x. h is the identity within the same equations, else what `StateTransfer` does, also in an impact.
Source: Aizerman and Gantmacher, On the stability of periodic motions, 1958.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from sympy import Expr

from shaftwork.codegen.array_form.elements import Array
from shaftwork.core.errors import SimulationError
from shaftwork.numerics.tolerances import SAME, TYPED
from shaftwork.pipeline.model import Model
from shaftwork.sensitivities.differentiation import Differentiated
from shaftwork.sensitivities.legs import LATE, Leg
from shaftwork.sensitivities.sensitivity_transfer import End, SensitivityTransfer

if TYPE_CHECKING:
    from shaftwork.hybrid.hybrid_state import Transition

ADVICE = "Take the difference of two variants, studies.sweep(...)."


@dataclass(frozen=True, eq=False)
class _Cause:
    """Why something changes at an instant: a law that switches by an argument, or a mode that ends by a guard.

    Args:
        argument: in states, parameters and time; it is zero at the instant.
        transition: from one mode to another, or None.
        late: how long ago, in s, what may be thrown back was at its limit: the run finds it beyond, as far as rounding
            hides it, and as a rule goes back there for the impact.
    """

    argument: Expr
    transition: Transition | None = None
    late: float = 0.0


@dataclass(frozen=True, eq=False)
class _Side:
    """One side of an instant.

    Args:
        leg: that ends or starts there.
        t: time at which it is read, s.
        x: (n,) states.
        rates: (N,) of them and of what is integrated.
    """

    leg: Leg
    t: float
    x: Array
    rates: Array


class _TiedTimes(NamedTuple):
    """Causes whose times move together.

    Args:
        shift: (m,) derivatives of their time.
        pace: how fast the slowest of them comes, as a part of what the largest rates would make of it.
        causes: at least one.
    """

    shift: Array
    pace: float
    causes: list[_Cause]


class _Crossing(NamedTuple):
    """One leg goes over into the next.

    Args:
        old: the side before.
        new: the side after.
        groups: of the causes.
        total: (N, m) total derivatives before.
        shift: (m,) derivatives of the time, where there is one group.
        pace: of that group.
        late: how long before the end of the leg it is, s.
    """

    old: _Side
    new: _Side
    groups: Sequence[_TiedTimes]
    total: Array
    shift: Array
    pace: float
    late: float

    @property
    def end(self) -> End:
        """That of the states alone."""
        return End(self.old.x, self.new.x, self.total[: len(self.old.x)], self.shift)


class Jump(NamedTuple):
    """What an instant does to derivatives.

    Args:
        slopes: (N, m) after it.
        shift: (m,) derivatives of its time; None where these are several.
        adds: whether it changes rates alone, so that its order with another one may not matter.
        doubt: relative error of what it has changed.
    """

    slopes: Array
    shift: Array | None
    adds: bool
    doubt: float


class JumpConditions:
    """Takes derivatives over from one leg of a motion to the next.

    Args:
        equations: those of a model, ready for sensitivities.
        transfer: takes states over into other equations; None where no part changes its mode.
        sizes: (n,) of the states of a model.
        swiftest: (N,) the largest rates of a model in the motion.
        span: length of the run, s.
    """

    def __init__(
        self,
        equations: Callable[[Model], Differentiated],
        transfer: SensitivityTransfer | None,
        sizes: Callable[[Model], Array],
        swiftest: Callable[[Model], Array],
        span: float,
    ) -> None:
        self._equations, self._transfer, self._sizes, self._swiftest = equations, transfer, sizes, swiftest
        self._span = span

    def over(self, before: Leg, after: Leg, slopes: Array, transitions: Sequence[Transition]) -> Jump:
        """From one leg to the next.

        Args:
            before: the leg that ends.
            after: the next one.
            slopes: (N, m) derivatives at its end, of the states and of what is integrated.
            transitions: at that time.

        Raises:
            SimulationError: there is no derivative, or none that is known.
        """
        old, new = self._side(before, before.high), self._side(after, after.low)
        adds = before.model is after.model and not any(transition.impact for transition in transitions)
        causes = list(self._causes(old, new, transitions))
        late = max((cause.late for cause in causes), default=0.0)
        ends = [self._crossing(old, new, slopes, causes, back) for back in dict.fromkeys((late, 0.0))]
        single = [end for end in ends if len(end.groups) <= 1]
        if not single:
            return Jump(self._one_by_one(old, new, slopes, ends[-1].groups, adds=adds), None, adds, 0.0)
        end, total = single[-1], single[-1].total
        if self._transfer is not None and not adds:
            k, carried = self._transfer.over(before, after, [one.end for one in single], transitions)
            end, total = single[k], np.concatenate([carried, single[k].total[len(old.x) :]])
        new_slopes = self._later(end.new, total - np.outer(end.new.rates, end.shift), end.late)
        share = self._share(before.model, slopes, new_slopes) if adds else 1.0
        return Jump(new_slopes, end.shift, adds, SAME / end.pace * share)

    def _crossing(self, old: _Side, new: _Side, slopes: Array, causes: Sequence[_Cause], late: float) -> _Crossing:
        """The instant as it is when both sides are gone back by so much, in s."""
        slopes = self._later(old, slopes, -late)
        old, new = self._moved(old, -late), self._moved(new, -late)
        groups = self._grouped(old, slopes, causes)
        shift, pace, _ = groups[0] if groups else _TiedTimes(np.zeros(slopes.shape[1]), 1.0, [])
        return _Crossing(old, new, groups, slopes + np.outer(old.rates, shift), shift, pace, late)

    def _share(self, model: Model, before: Array, after: Array) -> float:
        """The part of derivatives (N, m) that is new."""
        sizes = self._sizes(model)[:, None]
        moved, every = (np.abs(part[: len(sizes)] / sizes).max(axis=0, initial=0.0) for part in (after - before, after))
        shares = np.divide(moved, every, out=np.zeros_like(moved), where=every > 0)
        return float(np.minimum(shares, 1.0).max(initial=0.0))

    def _side(self, leg: Leg, t: float) -> _Side:
        times, states = leg.read(np.array([t]))
        rates = self._equations(leg.model).rates(times, states, leg.p)
        return _Side(leg, float(times[0]), states[0], rates[0])

    def _moved(self, side: _Side, step: float) -> _Side:
        """A side a little later or earlier, in s, along a straight line, as the run goes to the limit and back."""
        if not step:
            return side
        x = side.x + step * side.rates[: len(side.x)]
        rates = self._equations(side.leg.model).rates(np.array([side.t]), x[None, :], side.leg.p)
        return replace(side, x=x, rates=rates[0])

    def _later(self, side: _Side, slopes: Array, step: float) -> Array:
        """Derivatives (N, m) at a side a little later or earlier, in s."""
        if not step:
            return slopes
        equations = self._equations(side.leg.model)
        by_states, by_parameters = equations.coefficients(np.array([side.t]), side.x[None, :], side.leg.p)
        return np.asarray(slopes + step * (by_states[0] @ slopes[: len(side.x)] + by_parameters[0]))

    def _causes(self, old: _Side, new: _Side, transitions: Sequence[Transition]) -> Iterator[_Cause]:
        """All that happens at an instant by itself, and not in consequence of something else there."""
        leg = old.leg
        yield from map(_Cause, leg.model.switching.passed(leg.p, leg.high, new.leg.low))
        for argument in new.leg.turned:
            if not self._course(old, argument)[1] * self._course(new, argument)[1] > 0:
                raise _touched(new.leg, f"a law that changes with the sign of {argument}")
            yield _Cause(argument)
        instant = leg.model.switching.passed(leg.p, leg.high, new.leg.low, modes=True)
        met = sorted(self._met(old, transitions), key=lambda pair: pair[0])
        near = [TYPED if instant or k else LATE for k in range(len(met))]
        caused = [cause for (away, cause), most in zip(met, near, strict=True) if away <= most * self._span]
        if transitions and not (caused or instant):
            raise SimulationError(
                f"At t = {new.leg.start:.9g} s it cannot be told what has changed the mode of "
                f"'{transitions[0].machine.name}', and so not how the time of it depends on the parameters. {ADVICE}"
            )
        yield from caused

    def _met(self, old: _Side, transitions: Sequence[Transition]) -> Iterator[tuple[float, _Cause]]:
        """Guards of what changes that are about to be met, and how soon in s."""
        leg = old.leg
        first: dict[int, Transition] = {}
        if leg.equations is None:
            return
        for transition in transitions:
            first.setdefault(id(transition.machine), transition)
        for watched in leg.equations.watched(leg.modes):
            ended = first.get(id(leg.equations.machines[watched.machine]))
            if ended is not None:
                guard = leg.equations.expressions[watched.guard]
                value, rate = self._course(old, guard)
                if watched.side * rate > 0:
                    back = 0.0 if watched.leave.rebound is None else max(value / rate, 0.0)
                    yield abs(value / rate), _Cause(guard, ended, back)

    def _course(self, side: _Side, argument: Expr) -> tuple[float, float]:
        """Value and rate of an argument."""
        shown = self._equations(side.leg.model).shown(argument)
        value = float(shown.value(np.array([side.t]), side.x[None, :], side.leg.p)[0, 0])
        by_states, _, by_time = shown.slopes(side.t, side.x, side.leg.p)
        return value, float(by_states @ side.rates[: len(side.x)] + by_time)

    def _shift(self, old: _Side, slopes: Array, cause: _Cause) -> tuple[Array, float]:
        """(m,) derivatives of the time of a cause, and the pace at which it comes."""
        shown = self._equations(old.leg.model).shown(cause.argument)
        by_states, by_parameters, by_time = shown.slopes(old.t, old.x, old.leg.p)
        size = len(by_states)
        moved = by_states @ slopes[:size] + by_parameters
        if not moved.any():
            return np.zeros(len(moved)), 1.0
        rate = float(by_states @ old.rates[:size] + by_time)
        most = float(np.abs(by_states) @ self._swiftest(old.leg.model)[:size] + abs(by_time))
        if not abs(rate) > TYPED * most:
            raise _touched(old.leg, _worded(cause))
        return -moved / rate, abs(rate) / most

    def _grouped(self, old: _Side, slopes: Array, causes: Sequence[_Cause]) -> list[_TiedTimes]:
        """Causes by their times."""
        groups: list[_TiedTimes] = []
        for cause in causes:
            shift, pace = self._shift(old, slopes, cause)
            alike = (k for k, one in enumerate(groups) if (np.abs(one.shift - shift) <= TYPED * np.abs(shift)).all())
            k = next(alike, None)
            if k is None:
                groups.append(_TiedTimes(shift, pace, [cause]))
            else:
                groups[k] = _TiedTimes(shift, min(pace, groups[k].pace), [*groups[k].causes, cause])
        return groups

    def _one_by_one(self, old: _Side, new: _Side, slopes: Array, groups: Sequence[_TiedTimes], *, adds: bool) -> Array:
        """The derivatives (N, m) after several causes at one instant, whose order must not matter.

        Law: S+ = S- + sum of (f - f_k) t_k' with f_k the rates after the cause k alone; it holds in any order where
        what causes do to the rates adds up.
        """
        total, rates = slopes.copy(), old.rates.copy()
        for group in groups:
            gained = self._after(old, new, group.causes) - old.rates
            total -= np.outer(gained, group.shift)
            rates += gained
        if not adds or (np.abs(rates - new.rates) > TYPED * self._swiftest(old.leg.model)).any():
            raise by_chance(new.leg, " and ".join(_worded(group.causes[0]) for group in groups))
        return total

    def _after(self, old: _Side, new: _Side, causes: Sequence[_Cause]) -> Array:
        """The rates after some causes alone."""
        leg, p = old.leg, old.leg.p.copy()
        laws = [cause.argument for cause in causes if cause.transition is None]
        for transition in (cause.transition for cause in causes if cause.transition is not None):
            names = tuple(leg.model.parameters)
            if transition.machine.number in names:
                p[names.index(transition.machine.number)] = transition.machine.modes[transition.after].value
        return self._equations(leg.model).rates_past(laws, new.t, old.t, old.x, p)


def by_chance(leg: Leg, what: str) -> SimulationError:
    """The error where several things come together at the start of a leg."""
    return SimulationError(
        f"At t = {leg.start:.9g} s {what} come together, and which of them is first makes a difference: there is no "
        "derivative. Part them in time, or name other parameters than those that move them."
    )


def _worded(cause: _Cause) -> str:
    if cause.transition is None:
        return f"the switch of a law by {cause.argument}"
    machine, before, after = cause.transition.machine, cause.transition.before, cause.transition.after
    return f"the transition of '{machine.name}' from {machine.modes[before].words} to {machine.modes[after].words}"


def _touched(leg: Leg, what: str) -> SimulationError:
    return SimulationError(
        f"At t = {leg.end:.9g} s {what} is only touched: other parameters take the motion past it or through it, and "
        f"there is no derivative. {ADVICE}"
    )
