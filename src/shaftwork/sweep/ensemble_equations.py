"""One set of equations of many variants: its compiled code, and whether modes are consistent with the motion in it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from sympy import Expr

from shaftwork.codegen.array_form.elements import Array, Index
from shaftwork.codegen.state_transfer import StateTransfer
from shaftwork.codegen.timeline import Timeline
from shaftwork.core.errors import CompileError
from shaftwork.formulation.observables import Observables
from shaftwork.pipeline.arguments import NOMINAL
from shaftwork.pipeline.model import Model
from shaftwork.results.measures import Measure
from shaftwork.sweep.lane_program import LaneProgram
from shaftwork.sweep.lane_tables import Met

Mask = NDArray[np.bool_]
Texts = NDArray[np.object_]
Motion = tuple[Array, Array]
"""Rates (n, k) of states, and guards (guards, k)."""
ModeNames = tuple[str, ...]
"""The mode of every element; empty where no part changes its mode."""


class EnsembleCode:
    """The program of one set of equations.

    Args:
        model: the equations.
        guards: that end their modes, in states, parameters and time.
        stores: what the equations store.
        measures: what is read.
        program: makes the program; arguments as for `LaneProgram`.

    Raises:
        CompileError: variants cannot run side by side in them.
    """

    def __init__(
        self,
        model: Model,
        guards: Sequence[Expr],
        stores: StateTransfer,
        measures: Sequence[Measure],
        program: Callable[..., LaneProgram],
    ) -> None:
        if model.rows is None or not model.states:
            raise CompileError("These equations have no program of their own.")
        self.model, self._stores = model, stores
        expressed = Observables(model.form, model.rows)
        quantities = [expressed.quantity(measure.quantity) for measure in measures]
        read = [expression for expression in quantities if expression is not None]
        if len(read) < len(quantities):
            raise CompileError("A measure is of a power, an energy or a place along a shaft.")
        stored = [expressed.store(name) for name in stores.names] if guards else []
        kinds = tuple(measure.kind for measure in measures)
        self.program = program(model.rows, tuple(guards), tuple(read), kinds, tuple(stored))

    def motion(self, t: Array, x: Array, p: Array) -> tuple[Array, Array]:
        """Rates (n, k) and guards (guards, k) at times (k,), states (n, k), parameters (parameters, k)."""
        parts = self.program.points(t, x, p)
        return parts["rates"], parts["guards"]

    @cached_property
    def state_rows(self) -> list[int]:
        """For each state, its place among all that is stored."""
        return [self._stores.names.index(name) for name in self.model.states]

    @cached_property
    def kinds(self) -> tuple[list[int], list[int]]:
        """Places of torques and currents among all that is stored, and of the rest."""
        through = [k for k, name in enumerate(self._stores.names) if name in self._stores.through]
        return through, [k for k in range(len(self._stores.names)) if k not in through]


@dataclass(frozen=True, eq=False)
class PhaseEntry:
    """Where variants enter a phase.

    Args:
        met: (k,) the guard that alone contradicts its modes; NOTHING where none does, GIVEN_UP where several do.
        offsets: (guards, k) how far beyond zero each guard has to go.
    """

    met: Index
    offsets: Array

    def some(self, on: Mask | Index) -> PhaseEntry:
        """Of the lanes (k,) that are marked, or those that are named."""
        return PhaseEntry(self.met[on], self.offsets[:, on])

    def but(self, settled: Mask) -> PhaseEntry:
        """The same, where nothing contradicts the modes in lanes (k,) in which they are settled."""
        return PhaseEntry(np.where(settled, Met.NOTHING, self.met), self.offsets)


class EnsembleEquations:
    """The equations of one combination of modes.

    Args:
        code: its programs.
        base: the parameter vector of a variant.
        sizes: (n,) nominal size of each state, as of that variant.
        names: of the parameters that vary.
    """

    def __init__(self, code: EnsembleCode, base: Array, sizes: Sequence[float], names: Sequence[str]) -> None:
        self.code, self._base, self.sizes = code, base, np.array(sizes)
        places = {name: k for k, name in enumerate(code.model.parameters)}
        self._places = [(places[name], column) for column, name in enumerate(names) if name in places]
        self.sides: Array = np.zeros(0)
        """(guards,) on which each guard is met; 0 where it ends none of the modes."""

    @cached_property
    def kinds(self) -> list[tuple[list[int], float]]:
        """Places of what is stored by kind, see `EnsembleCode`, with the size of such states at a speed of 1 rad/s."""
        sizes = dict(zip(self.code.state_rows, (self.sizes / NOMINAL).tolist(), strict=True))
        return [(kind, max((sizes.get(place, 0.0) for place in kind), default=0.0)) for kind in self.code.kinds]

    def pieces(self, t: Array, p: Array, span: tuple[float, float]) -> Array:
        """(3, k) where lanes at times (k,) begin and stop, and the latest time at which something is evaluated, s.

        They stop where a law jumps or bends because of the time alone, and begin just behind such an instant.

        Args:
            t: s.
            p: (parameters, k).
            span: start and end of the motion, s.
        """
        switching, count = self.code.model.switching, len(self.code.model.parameters)
        if set(switching.places).isdisjoint(place for place, _ in self._places):
            line = switching.timeline(p[:count, 0], *span, modes=False)
            stops, begin = np.array([*line.stops, span[1]]), t.copy()
            for time in line.times:
                begin[t == time] = line.sides(time)[1]
            place = np.minimum(np.searchsorted(stops, t, side="right"), stops.size - 1)
            return np.array([begin, stops[place], np.array([line.sides(stop)[0] for stop in stops.tolist()])[place]])
        lines = (switching.timeline(values, *span, modes=False) for values in p[:count].T)
        return np.array([_piece(line, time, span[1]) for line, time in zip(lines, t.tolist(), strict=True)]).T

    def parameters(self, columns: Array) -> Array:
        """(parameters, k) for the values (names, k) of those that vary, with what is derived from them."""
        p = np.repeat(np.asarray(self._base)[:, None], columns.shape[1], axis=1)
        for place, column in self._places:
            p[place] = columns[column]
        return self.code.program.parameters(p)

    def entered(self, t: Array, x: Array, p: Array) -> PhaseEntry:  # noqa: ARG002
        """Whether the modes are consistent with the motion in lanes (k,): without guards they are."""
        return PhaseEntry(np.full(t.size, Met.NOTHING), np.zeros((0, t.size)))

    def alone(self, guard: int, t: Array, x: Array, p: Array, motion: Motion) -> Mask:  # noqa: ARG002
        """(k,) whether no other guard is near its limit where one is met; there is none."""
        return np.ones(t.size, dtype=bool)

    def at_once(self, guard: int, t: Array, x: Array, p: Array, motion: Motion) -> list[tuple[int, Mask]]:  # noqa: ARG002
        """Guards of which one may go first where several are met at once, and the lanes (k,); there is none."""
        return []

    def leaves_behind(self, before: EnsembleEquations, guard: int) -> bool:
        """Whether the guard by which these modes were entered is met no more; `entered` looks at all the others."""
        return before.code is not self.code or not self.sides[guard] == before.sides[guard] != 0.0


def _piece(line: Timeline, time: float, end: float) -> tuple[float, float, float]:
    """Where a lane begins and stops, and the latest time at which something is evaluated, s."""
    stop = next((one for one in line.stops if one > time), end)
    return line.sides(time)[1], stop, line.sides(stop)[0]


@dataclass(frozen=True, eq=False)
class VariantGroup:
    """Variants in the same modes, ready to go on.

    Args:
        modes: of every element; empty where nothing changes its mode.
        lanes: (k,) numbers of the variants.
        t: (k,) s.
        x: (n, k) states.
        steps: (k,) lengths of their last steps, s.
        settled: (k,) whether an event iteration has found the modes consistent with the motion that follows.
    """

    modes: ModeNames
    lanes: Index
    t: Array
    x: Array
    steps: Array
    settled: Mask

    def some(self, on: Mask | Index) -> VariantGroup:
        """Those of the lanes (k,) that are marked, or those that are named."""
        return VariantGroup(self.modes, self.lanes[on], self.t[on], self.x[:, on], self.steps[on], self.settled[on])

    def going_on(self, modes: ModeNames, t: Array, x: Array, *, settled: bool = False) -> VariantGroup:
        """The same variants in modes from times (k,) and states (n, k) on."""
        return replace(self, modes=modes, t=t, x=x, settled=np.full(t.size, settled))


def joined(groups: Sequence[VariantGroup]) -> list[VariantGroup]:
    """Groups in the same modes as one."""
    alike: dict[ModeNames, list[VariantGroup]] = {}
    for group in groups:
        if group.lanes.size:
            alike.setdefault(group.modes, []).append(group)
    return [
        VariantGroup(
            modes,
            np.concatenate([one.lanes for one in several]),
            np.concatenate([one.t for one in several]),
            np.concatenate([one.x for one in several], axis=1),
            np.concatenate([one.steps for one in several]),
            np.concatenate([one.settled for one in several]),
        )
        for modes, several in alike.items()
    ]
