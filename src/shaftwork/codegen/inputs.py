"""The inputs u = (w, e) of the linear part: nonlinear laws, sources of torque, prescribed speeds, and their slopes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sympy import Expr, I, Integer, nan

from shaftwork.codegen.code import vectorised
from shaftwork.codegen.elements import Array, Index, TemplateGroup, groups_of
from shaftwork.components.branches import ACROSS, INTEGRAL
from shaftwork.components.laws import switches
from shaftwork.components.laws import t as TIME
from shaftwork.components.slopes import jumps, slope
from shaftwork.network.templates import Kind
from shaftwork.reduction.form import StateForm

Function = Callable[..., Any]


@dataclass(frozen=True, eq=False)
class _Group:
    """The inputs of one template: where they stand in u, their across variables in y, their integrals in x."""

    made_of: TemplateGroup
    inputs: Index
    outputs: Index
    integrals: Index
    value: Function
    slopes: tuple[Function | None, Function | None, Function | None]

    @cached_property
    def moving(self) -> tuple[tuple[Expr, tuple[float, ...]], ...]:
        """What makes the law jump or bend because of the motion, each once, and at which levels."""
        law = self.made_of.template.law
        if self.made_of.template.kind is not Kind.LAW or not law.has(ACROSS, INTEGRAL):
            return ()
        found = ((argument, tuple(levels)) for argument, levels in switches(law) if argument.has(ACROSS, INTEGRAL))
        return tuple(dict.fromkeys(found))

    @cached_property
    def switches(self) -> tuple[tuple[Function, Array], ...]:
        """`moving` as functions, and the levels."""
        symbols = (TIME, ACROSS, INTEGRAL, *self.made_of.template.symbols)
        return tuple((vectorised(symbols, argument), np.array(levels)) for argument, levels in self.moving)


class Inputs:
    """Values and slopes of all inputs, vectorised over equal templates.

    Args:
        form: the state form.
        order: branch numbers of the inputs in the order of u.
        outputs: branch numbers of y.
    """

    def __init__(self, form: StateForm, order: Sequence[int], outputs: Sequence[int]) -> None:
        self.size = len(order)
        self.outputs = len(outputs)
        self.states = len(form.states)
        place = {int(branch): k for k, branch in enumerate(order)}
        output = {int(branch): k for k, branch in enumerate(outputs)}
        first = self.states - len(form.integrals)
        integral = {branch: first + k for k, branch in enumerate(form.integrals)}
        integral |= {branch: self.states + k for k, branch in enumerate(form.waves)}
        self._groups = tuple(self._group(made, place, output, integral) for made in groups_of(form.graph, order))
        self.of_time = np.ones(self.size, dtype=bool)
        for group in self._groups:
            if group.made_of.template.kind is Kind.LAW:
                self.of_time[group.inputs] = False

    @staticmethod
    def _group(made: TemplateGroup, place: Any, output: Any, integral: Any) -> _Group:
        is_wave = made.template.is_history
        law = INTEGRAL if is_wave else made.template.law  # both are read from x
        symbols = (TIME, ACROSS, INTEGRAL, *made.template.symbols)
        members = [int(branch) for branch in made.branches]

        def function(expression: Expr) -> Function | None:
            real = nan if expression.has(I) else expression  # the slope of (-2)^omega has log(-2)
            return None if real == 0 else vectorised(symbols, real)

        reads = made.template.kind is Kind.LAW
        return _Group(
            made,
            np.array([place[branch] for branch in members], dtype=np.intp),
            np.array([output[branch] for branch in members] if reads else [], dtype=np.intp),
            np.array([integral[branch] for branch in members] if law.has(INTEGRAL) else [], dtype=np.intp),
            function(law) or vectorised(symbols, Integer(0)),
            (function(slope(law, TIME)), function(slope(law, ACROSS)), function(slope(law, INTEGRAL))),
        )

    def values(self, t: Any, y: Array, x: Array, p: Array) -> Array:
        """u (m,) at time t from outputs y and states x; with t (k,), y (outputs, k) and x (n, k) it is (m, k)."""
        return self._evaluate(lambda group: group.value, t, y, x, p)

    def time_slopes(self, t: Any, y: Array, x: Array, p: Array) -> Array:
        """The partial derivative of u by time."""
        return self._evaluate(lambda group: group.slopes[0], t, y, x, p)

    def across_slopes(self, t: Any, y: Array, x: Array, p: Array) -> Array:
        """The partial derivative of each input by its own across variable."""
        return self._evaluate(lambda group: group.slopes[1], t, y, x, p)

    def integral_slopes(self, t: Any, y: Array, x: Array, p: Array) -> Array:
        """The partial derivative of each input by its own integral."""
        return self._evaluate(lambda group: group.slopes[2], t, y, x, p)

    @property
    def linear(self) -> bool:
        """Whether every input is linear in the across variable and integral that it reads, with constant slope."""
        laws = [made.made_of.template.law for made in self._groups]
        slopes = (slope(law, read) for law in laws for read in (ACROSS, INTEGRAL))
        if any(found.has(ACROSS, INTEGRAL, TIME) for found in slopes):
            return False
        return not any(jumps(law, ACROSS, INTEGRAL) for law in laws)

    def reading(self) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp], NDArray[np.intp]]:
        """Which input reads which output, and which input reads which integral: (inputs, outputs), (inputs, states)."""
        pairs = [(g.inputs, g.outputs) for g in self._groups if g.outputs.size]
        integrals = [(g.inputs, g.integrals) for g in self._groups if g.outputs.size and g.integrals.size]
        return (*_joined(pairs), *_joined(integrals))

    @property
    def switching(self) -> bool:
        """Whether a law jumps or bends because of the motion."""
        return any(group.moving for group in self._groups)

    def switches(self, t: Array, y: Array, x: Array, p: Array) -> Array:
        """What jumps or bends a law where its sign changes, (m, k), at times (k,), outputs (outputs, k), states (n, k).

        One row for each switch, level and branch; a level of a table is a kink like any other.
        """
        rows: list[Array] = []
        with np.errstate(all="ignore"):
            for group in self._groups:
                if not group.moving:
                    continue
                read, free = _read(group, y, x, p), np.zeros((group.inputs.size, t.size))
                for function, levels in group.switches:
                    value = function(t, *read) + free
                    rows.append((value - levels[:, None, None]).reshape(-1, t.size))
        return np.concatenate(rows)

    def _evaluate(self, pick: Callable[[_Group], Function | None], t: Any, y: Array, x: Array, p: Array) -> Array:
        result = np.zeros((self.size, *np.shape(x)[1:]))
        t = np.float64(t)  # of Python's floats the cube root of -1 is complex, and 1 / 0 an exception
        with np.errstate(all="ignore"):  # a law that has no value is NaN here; the engines say when and where
            for group in self._groups:
                function = pick(group)
                if function is not None:
                    result[group.inputs] = function(t, *_read(group, y, x, p))
        return result


def _read(group: _Group, y: Array, x: Array, p: Array) -> tuple[Any, ...]:
    """What the laws of a group read: across variables, integrals, parameters."""
    across = y[group.outputs] if group.outputs.size else 0.0
    known = group.integrals.size and group.integrals[-1] < len(x)  # not the waves, where none are given
    integral = x[group.integrals] if known else 0.0
    parameters = p[group.made_of.places]
    return (across, integral, *(parameters if x.ndim == 1 else parameters[..., None]))


def _joined(pairs: Sequence[tuple[Index, Index]]) -> tuple[Index, Index]:
    none = np.array([], dtype=np.intp)
    if not pairs:
        return none, none
    first, second = zip(*pairs, strict=True)
    return np.concatenate(first), np.concatenate(second)
