"""The inputs u = (w, e) of the linear part: nonlinear laws, sources of torque, prescribed speeds, and their slopes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse
from sympy import Expr, I, Integer, Symbol, nan

from shaftwork.codegen.array_form.elements import Array, Index, TemplateGroup, groups_of
from shaftwork.codegen.code import is_rough, vectorised
from shaftwork.components.branches import ACROSS, INTEGRAL
from shaftwork.components.discontinuities import bells, switches
from shaftwork.components.law_slopes import jumps, slope
from shaftwork.components.laws import t as TIME
from shaftwork.formulation.form import StateForm
from shaftwork.network.graph import Reading, readings_of
from shaftwork.network.kinds import Kind
from shaftwork.network.templates import BranchTemplate

Function = Callable[..., Any]


@dataclass(frozen=True, eq=False)
class _TemplateInputs:
    """The inputs of one template: where they stand in u, their across variables in y, their integrals in x.

    What they read of other branches, (reads, k), stands in y too. The slopes are by time, across, integral and reads.
    """

    branches: TemplateGroup
    inputs: Index
    outputs: Index
    integrals: Index
    reads: Index
    value: Function
    slopes: tuple[Function | None, ...]

    @cached_property
    def arrives(self) -> bool:
        """Whether it is what arrives by waves, which is as it is given."""
        return self.branches.template.is_history

    @cached_property
    def moving(self) -> tuple[tuple[Expr, tuple[float, ...]], ...]:
        """What makes the law jump, bend or rise steeply because of the motion, each once, and at which levels."""
        template = self.branches.template
        moves = (ACROSS, INTEGRAL, *template.reads)
        if not (template.kind is Kind.LAW or template.reads) or not template.law.has(*moves):
            return ()
        pairs = ((argument, tuple(levels)) for argument, levels in switches(template.law) if argument.has(*moves))
        return tuple(dict.fromkeys((*pairs, *bells(template.law, moves))))

    @cached_property
    def switches(self) -> tuple[tuple[Function, Array], ...]:
        """`moving` as functions, and the levels."""
        symbols = _arguments(self.branches.template)
        return tuple((vectorised(symbols, argument), np.array(levels)) for argument, levels in self.moving)


class Inputs:
    """Values and slopes of all inputs, vectorised over equal templates.

    Args:
        form: the state form.
        order: branch numbers of the inputs in the order of u.
    """

    def __init__(self, form: StateForm, order: Sequence[int]) -> None:
        self.size = len(order)
        self.outputs = len(form.outputs) + len(form.readings)
        self.states = len(form.states)
        place = {int(branch): k for k, branch in enumerate(order)}
        rows: tuple[int | Reading, ...] = (*form.outputs, *form.readings)
        output = {row: k for k, row in enumerate(rows)}
        integral = {**form.integral_places, **{branch: self.states + k for k, branch in enumerate(form.waves)}}
        self._graph = form.graph
        self._groups = tuple(self._group(alike, place, output, integral) for alike in groups_of(form.graph, order))
        self.of_time = np.ones(self.size, dtype=bool)
        self.controlled = np.zeros(self.size, dtype=bool)
        for group in self._groups:
            if group.branches.template.kind is Kind.LAW:
                self.of_time[group.inputs] = False
            elif group.branches.template.reads:
                self.of_time[group.inputs], self.controlled[group.inputs] = False, True
        self.controls = np.flatnonzero(self.controlled)
        self.rates = np.array([output[reading] for reading in form.readings if reading.kind == "rate"], dtype=np.intp)
        self._last: tuple[Array, dict[int, tuple[tuple[Any, ...], ...]]] = np.empty(0), {}

    def _group(self, alike: TemplateGroup, place: Any, output: Any, integral: Any) -> _TemplateInputs:
        template = alike.template
        law = INTEGRAL if template.is_history else template.law  # both are read from x
        symbols, reads = _arguments(template), template.reads
        members = [int(branch) for branch in alike.branches]
        rows = [[output[readings_of(self._graph, branch)[symbol]] for branch in members] for symbol in reads]

        def function(expression: Expr) -> Function | None:
            real = nan if expression.has(I) else expression  # the slope of (-2)^omega has log(-2)
            return None if real == 0 else vectorised(symbols, real)

        moves = template.kind is Kind.LAW
        return _TemplateInputs(
            alike,
            np.array([place[branch] for branch in members], dtype=np.intp),
            np.array([output[branch] for branch in members] if moves else [], dtype=np.intp),
            np.array([integral[branch] for branch in members] if law.has(INTEGRAL) else [], dtype=np.intp),
            np.array(rows, dtype=np.intp).reshape(len(reads), len(members)),
            function(law) or vectorised(symbols, Integer(0)),
            tuple(function(slope(law, symbol)) for symbol in (TIME, ACROSS, INTEGRAL, *reads)),
        )

    def _parameters(self, p: Array, x: Array) -> tuple[tuple[Any, ...], ...]:
        """What the laws of each group read of parameters, as columns beside states (n, k).

        Of the last vector that nobody can change it is kept: to make columns takes as long as a law.
        """
        last = self._last
        if last[0] is not p:
            last = p, {}
        if x.ndim not in last[1]:
            last[1][x.ndim] = tuple(
                tuple(row[:, None] if x.ndim > 1 else row for row in p[group.branches.places]) for group in self._groups
            )
            if not p.flags.writeable:
                self._last = last
        return last[1][x.ndim]

    def values(self, t: Any, y: Array, x: Array, p: Array) -> Array:
        """u (m,) at time t from outputs y and states x; with t (k,), y (outputs, k) and x (n, k) it is (m, k)."""
        return self._evaluate(lambda group: group.value, t, y, x, p)

    def sources(self, t: Any, x: Array, p: Array) -> Array:
        """Of u what depends on the time alone; zero for others, whose laws may have no value here."""
        return where(self.of_time, self.values(t, np.zeros((self.outputs, *x.shape[1:])), x, p))

    def time_slopes(self, t: Any, y: Array, x: Array, p: Array) -> Array:
        """The partial derivative of u by time."""
        return self._evaluate(lambda group: group.slopes[0], t, y, x, p)

    def source_rates(self, t: Any, y: Array, x: Array, p: Array) -> Array:
        """Of u' that of what depends on the time alone; zero for others."""
        return where(self.of_time, self.time_slopes(t, y, x, p))

    def slopes(self, t: Any, y: Array, x: Array, p: Array) -> tuple[Any, Any]:
        """The partial derivatives of u by y (m, outputs) and by the integrals among the states (m, n), sparse."""
        entries: dict[bool, list[tuple[Array, Index, Index]]] = {False: [], True: []}
        with np.errstate(all="ignore"):
            for inputs, by_states, places, function, read in self._partial_slopes(t, y, x, p):
                entries[by_states].append((function(*read) + np.zeros(inputs.size), inputs, places))
        return _matrix(entries[False], (self.size, self.outputs)), _matrix(entries[True], (self.size, self.states))

    def along(self, t: Any, y: Array, x: Array, p: Array, by_y: Array, by_x: Array | None = None) -> Array:
        """The slopes of u by q variables, (m, q); with t (k,), y (outputs, k) and x (n, k) it is (m, q, k).

        Args:
            t: time, s.
            y: outputs.
            x: states.
            p: parameter vector.
            by_y: (outputs, q) the slopes of the outputs by the variables.
            by_x: (n, q) those of the states; None where they are zero.
        """
        result = np.zeros((self.size, by_y.shape[1], *x.shape[1:]))
        with np.errstate(all="ignore"):
            for inputs, by_states, places, function, read in self._partial_slopes(t, y, x, p):
                if (by := by_x if by_states else by_y) is not None:
                    slopes = function(*read) + np.zeros((inputs.size, *x.shape[1:]))
                    result[inputs] += np.einsum("i...,iq->iq...", slopes, by[places])
        return result

    def _partial_slopes(
        self, t: Any, y: Array, x: Array, p: Array
    ) -> Iterator[tuple[Index, bool, Index, Function, tuple[Any, ...]]]:
        """Inputs, whether the slope is by states and no outputs, by which, the function of the slope, what it takes."""
        t = np.float64(t)
        for group, parameters in zip(self._groups, self._parameters(p, x), strict=True):
            if group.outputs.size or group.reads.size:
                read = (t, *_read(group, y, x, parameters))
                _, across, integral, *others = group.slopes
                moving = ((across, False, group.outputs), (integral, True, group.integrals))
                reads = ((function, False, places) for function, places in zip(others, group.reads, strict=True))
                for function, by_states, places in (*moving, *reads):
                    if function is not None and places.size:
                        yield group.inputs, by_states, places, function, read

    @cached_property
    def constant(self) -> bool:
        """Whether parameters alone tell every input."""
        templates = (group.branches.template for group in self._groups)
        return not any(one.kind is Kind.LAW or one.reads or one.is_history or one.law.has(TIME) for one in templates)

    @property
    def linear(self) -> bool:
        """Whether every input is linear in all that it reads, with constant slopes."""
        templates = (group.branches.template for group in self._groups)
        return all(is_linear(one.law, (ACROSS, INTEGRAL, *one.reads)) for one in templates)

    @cached_property
    def switching(self) -> bool:
        """Whether a law jumps or bends because of the motion."""
        return any(group.moving for group in self._groups)

    def switches(self, t: Array, y: Array, x: Array, p: Array) -> Array:
        """What jumps or bends a law where its sign changes, (m, k), at times (k,), outputs (outputs, k), states (n, k).

        One row for each switch, level and branch; a level of a table is a kink like any other.
        """
        rows: list[Array] = []
        with np.errstate(all="ignore"):
            for group, parameters in zip(self._groups, self._parameters(p, x), strict=True):
                if not group.moving:
                    continue
                read, free = _read(group, y, x, parameters), np.zeros((group.inputs.size, t.size))
                for function, levels in group.switches:
                    value = function(t, *read) + free
                    rows.append((value - levels[:, None, None]).reshape(-1, t.size))
        return np.concatenate(rows)

    def first_rough(self, t: float, y: Array, x: Array, p: Array) -> int | None:
        """The first input whose law or slope computes on its way what is no number, though it may not need it.

        Args:
            t: time, s.
            y: (outputs,) outputs.
            x: (n,) states.
            p: parameter vector.
        """
        for group, parameters in zip(self._groups, self._parameters(p, x), strict=True):
            read = _read(group, y, x, parameters)
            for k, place in enumerate(group.inputs.tolist()):
                point = [np.float64(t), *(np.float64(value if np.ndim(value) == 0 else value[k]) for value in read)]
                if any(is_rough(function, point) for function in (group.value, *group.slopes) if function is not None):
                    return int(place)
        return None

    def _evaluate(
        self, pick: Callable[[_TemplateInputs], Function | None], t: Any, y: Array, x: Array, p: Array
    ) -> Array:
        result = np.zeros((self.size, *np.shape(x)[1:]))
        t = np.float64(t)  # of Python's floats the cube root of -1 is complex, and 1 / 0 an exception
        with np.errstate(all="ignore"):  # a law that has no value is NaN here; the engines say when and where
            for group, parameters in zip(self._groups, self._parameters(p, x), strict=True):
                function = pick(group)
                if group.arrives:
                    if function is group.value and group.integrals[-1] < len(x):
                        result[group.inputs] = x[group.integrals]
                elif function is not None:
                    result[group.inputs] = function(t, *_read(group, y, x, parameters))
        return result


def where(mask: Any, values: Array) -> Array:
    """Values (m,) or (m, k) where a mask (m,) holds, else zero."""
    return np.where(mask if values.ndim == 1 else mask[:, None], values, 0.0)


def is_linear(law: Expr, reads: Sequence[Symbol]) -> bool:
    """Whether a law is linear in what it reads, with constant slopes."""
    return not (any(slope(law, read).has(*reads, TIME) for read in reads) or jumps(law, *reads))


def _read(group: _TemplateInputs, y: Array, x: Array, parameters: tuple[Any, ...]) -> tuple[Any, ...]:
    """What the laws of a group read: across variables, integrals, what is of other branches, parameters."""
    across = y[group.outputs] if group.outputs.size else 0.0
    is_there = group.integrals.size and group.integrals[-1] < len(x)  # not the waves, where none are given
    integral = x[group.integrals] if is_there else 0.0
    if not len(group.reads):
        return (across, integral, *parameters)
    return (across, integral, *(y[places] for places in group.reads), *parameters)


def _arguments(template: BranchTemplate) -> tuple[Symbol, ...]:
    """What the functions of a law take, in the order of `_read`."""
    return (TIME, ACROSS, INTEGRAL, *template.reads, *template.symbols)


def _matrix(entries: Sequence[tuple[Array, Index, Index]], shape: tuple[int, int]) -> Any:
    """A scipy.sparse.csr_array of (values, rows, columns)."""
    if not entries:
        return sparse.csr_array(shape)
    values, rows, columns = (np.concatenate(each) for each in zip(*entries, strict=True))
    return sparse.csr_array((values, (rows, columns)), shape=shape)
