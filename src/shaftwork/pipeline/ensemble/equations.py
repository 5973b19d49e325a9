"""One set of equations of many variants: programs, and whether modes are consistent with the motion in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shaftwork.codegen.elements import Array
from shaftwork.pipeline.ensemble.programs import EnsembleCode
from shaftwork.pipeline.phases.exceeded_guards import FEW
from shaftwork.pipeline.phases.hybrid_state import AHEAD, AHEAD_OF_RUN, CLEAR, EPS, GOLDEN, NOTHING, ROUNDINGS
from shaftwork.pipeline.phases.mode_equations import ModeEquations
from shaftwork.pipeline.phases.mode_machines import ModeNames
from shaftwork.pipeline.prepared import NOMINAL

Mask = NDArray[np.bool_]
Course = tuple[Array, Array, Array, Array]
"""Times (k,), states (n, k), their rates, and guards (guards, k)."""


@dataclass(frozen=True, eq=False)
class PhaseEntry:
    """Where variants enter a phase.

    Args:
        good: (k,) whether its modes are consistent with the motion.
        offsets: (guards, k) how far beyond zero each guard has to go.
    """

    good: Mask
    offsets: Array


class EnsembleEquations:
    """The equations of one combination of modes.

    Args:
        code: its programs.
        assembly: the equations with their guards, or None where nothing changes its mode.
        modes: the combination.
        first: a variant, of which sizes are taken.
        names: of the parameters that vary.
        span: start and end of the motion, s.
    """

    def __init__(
        self,
        code: EnsembleCode,
        assembly: ModeEquations | None,
        modes: ModeNames,
        first: Mapping[str, float],
        names: Sequence[str],
        span: tuple[float, float],
    ) -> None:
        self.code, model = code, code.model
        if assembly is None:
            self._base = model.vector(first)
            self.sides, sizes = np.zeros(0), model.prepare(self._base).atol.tolist()
        else:
            pairs = zip(assembly.elements, modes, strict=True)
            self._base = assembly.vector(first, {made.number: made.modes[name].value for made, name in pairs})
            self.sides, sizes = assembly.sides(modes), assembly.sizes(self._base)
        places = {name: k for k, name in enumerate(model.parameters)}
        self._places = [(places[name], column) for column, name in enumerate(names) if name in places]
        self.watched, self.sizes = np.flatnonzero(self.sides), np.array(sizes)
        self._tick = ROUNDINGS * float(np.spacing(max(map(abs, span))))
        self._ahead = AHEAD_OF_RUN * (span[1] - span[0])

    def parameters(self, columns: Array) -> Array:
        """(parameters, k) for the values (names, k) of those that vary, with what is derived from them."""
        p = np.repeat(np.asarray(self._base)[:, None], columns.shape[1], axis=1)
        for place, column in self._places:
            p[place] = columns[column]
        return self.code.program.parameters(p)

    def entered(self, t: Array, x: Array, p: Array) -> PhaseEntry:
        """Whether every guard is on its own side, or on its limit and about to be, as `EventIteration` would find.

        Args:
            t: (k,) s.
            x: (n, k) states.
            p: (parameters, k).
        """
        if not len(self.sides):
            return PhaseEntry(np.ones(t.size, dtype=bool), np.zeros((0, t.size)))
        rates, now = self.code.motion(t, x, p)
        moved = self._rounded(x, rates)
        near_rates, near = self.code.motion(t + self._tick, moved, p)
        side, bands, step = self.sides[:, None], np.abs(near - now), self._step(rates)
        value = side * now
        falls, known = np.zeros_like(value, dtype=bool), np.zeros_like(value, dtype=bool)
        here, beside = (t, x, rates, now), (t + self._tick, moved, near_rates, near)
        for _ in range(2):  # where nothing moves yet, its acceleration tells
            here, beside = self._later(step, here, p), self._later(step, beside, p)
            gain, other = side * (here[3] - now), side * (beside[3] - near)
            sure = np.abs(gain) > np.maximum(np.abs(gain - other), FEW * bands / ROUNDINGS)
            falls |= ~known & sure & (gain < 0)
            known |= sure
        good = (value < -bands) | ((value <= bands) & falls)
        clear = np.where(2 * value > -CLEAR * bands, np.maximum(value, 0.0) + CLEAR * bands, bands)
        return PhaseEntry(np.all(good[self.watched], axis=0), np.maximum(clear, NOTHING))

    def _rounded(self, x: Array, rates: Array) -> Array:
        """The states so far away as rounding may move them, and the time by a tick; see `moments.Regime.rounded`."""
        way = np.array([(-1.0) ** k for k in range(len(x))])[:, None]
        part = way * np.array([(0.5 + k * GOLDEN % 1) * ROUNDINGS * EPS for k in range(len(x))])[:, None]
        least = part * self.sizes[:, None] / NOMINAL
        return np.asarray(x + part * np.abs(x) + least + way * self._tick * np.abs(rates))

    def _step(self, rates: Array) -> Array:
        """(k,) how far in s the further course is looked at."""
        with np.errstate(divide="ignore"):
            steps = (AHEAD * self.sizes[:, None] / np.abs(rates)).min(axis=0)
        return np.asarray(np.minimum(self._ahead, steps))

    def _later(self, step: Array, course: Course, p: Array) -> Course:
        """A step further along a straight line."""
        t, x, rates, _ = course
        later = x + step * rates
        return t + step, later, *self.code.motion(t + step, later, p)

    def leaves_behind(self, before: EnsembleEquations, guard: int) -> bool:
        """Whether the guard by which these modes were entered is met no more; `entered` looks at all the others."""
        return before.code is not self.code or not self.sides[guard] == before.sides[guard] != 0.0
