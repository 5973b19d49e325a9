"""Derivatives of states that go over into other equations: parts that become joined, let go, or hit each other."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from sympy import Expr

from shaftwork.codegen.array_form.elements import Array
from shaftwork.core.errors import NetworkError, SimulationError
from shaftwork.numerics.tolerances import TYPED
from shaftwork.pipeline.model import Model
from shaftwork.sensitivities.differentiation import Differentiated
from shaftwork.sensitivities.legs import LATE, Leg

if TYPE_CHECKING:
    from shaftwork.hybrid.equation_sets import EquationSets
    from shaftwork.hybrid.hybrid_state import Transition
    from shaftwork.hybrid.modes.mode_equations import ModeEquations
    from shaftwork.hybrid.modes.mode_machines import ModeNames


class _ModeStep(NamedTuple):
    """Into other modes; where something is thrown back, for an instant alone, and then into others.

    Args:
        modes: that take up what is stored.
        rebound: element and its share of the speed that comes back, or None.
        parted: the modes in which it flies on.
    """

    modes: ModeNames
    rebound: tuple[int, Expr] | None = None
    parted: ModeNames = ()


class End(NamedTuple):
    """Where one leg goes over into the next.

    Args:
        before: (n,) states.
        after: (n',) states that follow.
        slopes: (n, m) total derivatives of those before.
        shift: (m,) derivatives of the time.
    """

    before: Array
    after: Array
    slopes: Array
    shift: Array


class _StoredWithDerivatives(NamedTuple):
    """All that is stored by name, and its total derivatives (m,)."""

    values: Mapping[str, float]
    slopes: Mapping[str, Array]


class SensitivityTransfer:
    """Takes states and their derivatives over from one set of equations to another.

    Args:
        equation_sets: the sets of equations.
        values: parameters that differ from the network's.
        equations: those of a model, ready for sensitivities.
        sizes: (n,) of the states of a model.
    """

    def __init__(
        self,
        equation_sets: EquationSets,
        values: Mapping[str, float],
        equations: Callable[[Model], Differentiated],
        sizes: Callable[[Model], Array],
    ) -> None:
        self._equation_sets, self._values, self._equations, self._sizes = equation_sets, values, equations, sizes

    def over(
        self, before: Leg, after: Leg, ends: Sequence[End], transitions: Sequence[Transition]
    ) -> tuple[int, Array]:
        """Which of the ends it was, and the total derivatives (n', m) of the new states.

        The modes that a run goes through within an instant are tried as they may follow each other; what leads to the
        states of the run is the path that it took.

        Args:
            before: the leg that ends.
            after: the next one.
            ends: where one leg goes over into the other, as far as that is known; the likeliest first.
            transitions: at that time.

        Raises:
            SimulationError: none of them leads there.
        """
        sizes, candidates = self._sizes(after.model), list[tuple[float, int, Array]]()
        for (k, end), steps in product(enumerate(ends), self._paths(before, after, transitions)):
            try:
                states, slopes = self._along(steps, before, after.low, end)
            except NetworkError:
                continue
            candidates.append((float((np.abs(states - end.after) / sizes).max(initial=0.0)), k, slopes))
        nearest = min((away for away, *_ in candidates), default=np.inf)
        if nearest <= LATE:
            return next((k, slopes) for away, k, slopes in candidates if away <= nearest + TYPED)
        names = ", ".join(dict.fromkeys(f"'{transition.machine.name}'" for transition in transitions)) or "parts"
        raise SimulationError(
            f"At t = {after.start:.9g} s {names} change together, and how the derivatives pass that is not known here. "
            "Take the difference of two variants, studies.sweep(...)."
        )

    def _paths(self, before: Leg, after: Leg, transitions: Sequence[Transition]) -> Iterable[tuple[_ModeStep, ...]]:
        """Paths to the modes that follow, the plainest first."""
        paths = (self._path(before.modes, after.modes, transitions, besides=besides) for besides in (False, True))
        return dict.fromkeys(paths)

    def _path(
        self, modes: ModeNames, last: ModeNames, transitions: Sequence[Transition], *, besides: bool
    ) -> tuple[_ModeStep, ...]:
        """One path, on which each impact takes up what is stored, and in the end all transitions together.

        Args:
            modes: before.
            last: after.
            transitions: in their order.
            besides: in an impact other machines are already in the modes that follow.
        """
        from shaftwork.hybrid.modes.mode_machines import with_modes

        numbers = {id(machine): k for k, machine in enumerate(self._equation_sets.machines)}
        steps: list[_ModeStep] = []
        for place, transition in enumerate(transitions):
            number = numbers[id(transition.machine)]
            if not transition.impact:
                modes = with_modes(modes, {number: transition.after})
                continue
            others = {numbers[id(later.machine)]: later.after for later in transitions[place + 1 :] if not later.impact}
            modes = with_modes(modes, {**(others if besides else {}), number: transition.after})
            if not transition.rebound:
                steps.append(_ModeStep(modes))
                continue
            leaves = transition.machine.modes[transition.before].leaves
            share = next(
                leave.rebound for leave in leaves if leave.rebound is not None and leave.to == transition.after
            )
            parted = with_modes(modes, {number: transition.before})
            steps.append(_ModeStep(modes, (number, share), parted))
            modes = parted
        if not steps or (steps[-1].parted or steps[-1].modes) != last:
            steps.append(_ModeStep(last))
        return tuple(steps)

    def _along(self, steps: Sequence[_ModeStep], before: Leg, t: float, end: End) -> tuple[Array, Array]:
        """States (n',) and their total derivatives (n', m) at the end of a path."""
        model, p, (x, _, slopes, shift) = before.model, before.p, end
        for step in steps:
            equations, old = self._equation_sets.of(step.modes), p
            p = equations.vector(self._values, self._equation_sets.numbers(step.modes))
            if equations.model is model and step.rebound is None:
                continue
            stored = self._stored(model, t, x, old, slopes, shift)
            x, slopes = self._taken_over(equations, t, p, stored, shift)
            if step.rebound is not None:
                stored = self._thrown(
                    equations, p, stored, self._stored(equations.model, t, x, p, slopes, shift), step.rebound
                )
                equations = self._equation_sets.of(step.parted)
                p = equations.vector(self._values, self._equation_sets.numbers(step.parted))
                x, slopes = self._taken_over(equations, t, p, stored, shift)
            model = equations.model
        return x, slopes

    def _stored(
        self, model: Model, t: float, x: Array, p: Array, slopes: Array, shift: Array
    ) -> _StoredWithDerivatives:
        takeover = self._equations(model).takeover
        values, derivatives = takeover.given(t, x, p, slopes, shift)
        return _StoredWithDerivatives(
            dict(zip(takeover.names, values.tolist(), strict=True)), dict(zip(takeover.names, derivatives, strict=True))
        )

    def _taken_over(
        self, equations: ModeEquations, t: float, p: Array, stored: _StoredWithDerivatives, shift: Array
    ) -> tuple[Array, Array]:
        takeover = self._equations(equations.model).takeover
        x = equations.stores.states(equations.bound(p), t, stored.values)
        values = np.array([stored.values[name] for name in takeover.names])
        slopes = np.array([stored.slopes[name] for name in takeover.names]).reshape(len(values), shift.size)
        return x, takeover.taken(t, x, p, values, slopes, shift)

    def _thrown(
        self,
        equations: ModeEquations,
        p: Array,
        before: _StoredWithDerivatives,
        joined: _StoredWithDerivatives,
        rebound: tuple[int, Expr],
    ) -> _StoredWithDerivatives:
        """After an impact that throws back: v_joined + e (v_joined - v_before)."""
        expression = equations.of_machine(*rebound)
        shown, nowhere = self._equations(equations.model).shown(expression), np.zeros(len(equations.model.states))
        share = float(shown.value(np.zeros(1), nowhere[None, :], p)[0, 0])
        by_parameters = shown.slopes(0.0, nowhere, p)[1]
        gain = {name: value - before.values[name] for name, value in joined.values.items()}
        values = {name: value + share * gain[name] for name, value in joined.values.items()}
        slopes = {
            name: slope + share * (slope - before.slopes[name]) + by_parameters * gain[name]
            for name, slope in joined.slopes.items()
        }
        return _StoredWithDerivatives(values, slopes)
