"""Variants on a device of JAX: which device, their equations as JAX traces them, and how they are laid onto it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from sympy import Expr

from shaftwork.codegen.array_form.elements import Array, Index
from shaftwork.core.calls import BoundedCache
from shaftwork.core.errors import ParameterError, imported
from shaftwork.formulation.explicit_rows import Rows
from shaftwork.numerics.traced_code import rows_of
from shaftwork.sweep.device.inner_search import DEPTH, INTERVAL
from shaftwork.sweep.device.lock_step import LaneTask, LockStep, TracedStep
from shaftwork.sweep.lane_program import LaneProgram, MonitoredQuantities, step_tolerance
from shaftwork.sweep.lane_tables import LaneCourse, LaneEnd, LaneRow

SINGLE_ROUNDINGS = 32
"""The tolerance of a step in single precision, in its rounding units: a step cannot tell less from rounding."""
MOST_LANES, MEMORY = 65536, 2**31
"""Variants at once: so many keep a large device busy, and so many bytes they may take."""


@dataclass(frozen=True)
class Device:
    """Where variants run side by side.

    Args:
        device: of JAX.
        precision: "double" or "single".
    """

    device: Any
    precision: str

    @classmethod
    def of(cls, on: Any, precision: str) -> Device:
        """The device that is meant.

        Raises:
            ParameterError: there is none.
            MissingExtraError: JAX is not installed.
        """
        if isinstance(on, str) and on != "gpu":
            raise ParameterError(f"on = '{on}' must be a client of Dask, distributed.Client('{on}'), or 'gpu'.")
        jax = imported("jax", "gpu", "sweep(on='gpu')")
        if not isinstance(on, str):
            return cls(on, precision)
        try:
            return cls(jax.devices("gpu")[0], precision)
        except RuntimeError:
            seen = ", ".join(map(str, jax.devices()))
            raise ParameterError(
                f"on = 'gpu': JAX sees no graphics processor, but {seen}. Install JAX for yours, such as "
                "pip install 'jax[cuda12]', or leave 'on' out: variants run side by side on the processor as well."
            ) from None

    def program(
        self,
        rows: Rows,
        guards: tuple[Expr, ...],
        quantities: tuple[Expr, ...],
        kinds: tuple[str, ...],
        stored: tuple[Expr, ...],
    ) -> LaneProgram:
        """The program for all networks with these expressions; arguments as for `LaneProgram`."""
        key = self, rows.states, rows.parameters, rows.rates, guards, quantities, kinds, stored
        return _programs(key, lambda: DeviceProgram(self, rows, guards, quantities, kinds, stored))


_programs = BoundedCache[tuple[object, ...], LaneProgram](64)


class DeviceProgram(LaneProgram):
    """As `LaneProgram`, with the motion followed on a device.

    Args:
        device: where.
        rows, guards, quantities, kinds, stored: as there.
    """

    def __init__(
        self,
        device: Device,
        rows: Rows,
        guards: Sequence[Expr],
        quantities: Sequence[Expr],
        kinds: Sequence[str],
        stored: Sequence[Expr],
    ) -> None:
        self._device, self._kind = device.device, np.float32 if device.precision == "single" else np.float64
        super().__init__(rows, guards, quantities, kinds, stored)

    def _compile(self, seen: MonitoredQuantities) -> None:
        import jax

        rates = partial(self._write, values=seen.slopes, definitions={})
        jets = partial(self._write, values=seen.monitored, definitions=seen.motion.definitions)
        writer = seen.steps((lambda memory: rows_of(jax, memory, rates), 0), (None, 0), TracedStep)
        sizes = dict(zip((row.name.lower() for row in LaneRow), np.diff(self._place).tolist(), strict=False))
        self._steps = LockStep(jax, writer, jets, sizes, [sign for _, sign in seen.signs], self.switches)
        numbers = 2 * sum(sizes.values()) + INTERVAL * (len(seen.signs) + self.guards + self.switches + DEPTH)
        most = 256 if self._device.platform == "cpu" else MOST_LANES
        # always as many, whatever the number of variants: the digits of one do not depend on those beside it
        self._lanes_at_once = min(most, 2 ** int(np.log2(MEMORY / (8 * numbers))))

    def follow(self, course: LaneCourse, sizes: Array, rtol: float, span: tuple[float, float]) -> LaneEnd:
        import jax

        least = SINGLE_ROUNDINGS * float(np.finfo(self._kind).eps) if self._kind is np.float32 else 0.0
        common = {"tolerance": max(step_tolerance(rtol), least), "longest": (span[1] - span[0]) / 50, "far": span[1]}
        parts, blocks = list[dict[str, Array]](), range(0, course.t.size, self._lanes_at_once)
        with jax.enable_x64(new_val=True):
            for first in blocks or [0]:
                variants = np.arange(first, min(first + self._lanes_at_once, course.t.size))
                memory = self._begun(course, variants, {**common, "nominal": sizes[:, None]})
                reached = jax.device_get(self._steps.course(jax.device_put(memory, self._device)))
                parts.append({name: rows[..., : variants.size] for name, rows in reached.items()})
        return self._end(course, {name: np.concatenate([one[name] for one in parts], axis=-1) for name in parts[0]})

    def _begun(self, course: LaneCourse, variants: Index, common: dict[str, Any]) -> dict[str, Any]:
        """The memory of lanes in which some variants begin."""
        memory, count = self._steps.begun(self._lanes_at_once, self._kind), variants.size
        own = {"time": course.t, "end": course.ends, "high": course.highs, "step": course.steps, "x": course.x}
        own |= {
            "p": course.p,
            "sides": course.sides,
            "offsets": course.offsets,
            "best": course.best[[measure for measure, _ in self._signs]],
        }
        for name, value in common.items():
            memory[name][:] = value
        for name, value in own.items():
            rows = np.atleast_2d(value)
            memory[name][: len(rows), :count] = rows[:, variants]
        for name, value in (("begun", "time"), ("last_time", "time"), ("last_x", "x")):
            memory[name][:] = memory[value]
        memory["goal"][:], memory["mode"][:count] = memory["time"][0], LaneTask.STARTS
        return memory

    def _end(self, course: LaneCourse, reached: dict[str, Array]) -> LaneEnd:
        """Where variants have come to."""
        best, (states, integrals) = course.best.copy(), np.split(reached["x"].astype(float), [len(course.x)])
        for (measure, _), values in zip(self._signs, reached["best"], strict=True):
            best[measure] = np.maximum(best[measure], values)
        return LaneEnd(reached["time"][0], states, best, reached["size"][0], integrals, reached["met"].astype(int))
