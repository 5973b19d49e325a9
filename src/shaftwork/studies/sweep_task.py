"""What a sweep computes: variants of a network, chunk by chunk, each variant by itself or many side by side."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from shaftwork.codegen.observer import ModelObserver
from shaftwork.components.base import Component
from shaftwork.core.errors import (
    AccuracyWarning,
    CompileError,
    NetworkWarning,
    ParameterError,
    ShaftworkError,
    in_one_line,
    no_quantity,
)
from shaftwork.core.notices import muted
from shaftwork.integrate.engines import available
from shaftwork.network.netlist import Netlist
from shaftwork.pipeline.model import steady_start
from shaftwork.pipeline.motion_start import Ending
from shaftwork.pipeline.network import Network
from shaftwork.results.fatigue import SNLine
from shaftwork.results.measures import Measure
from shaftwork.results.observer import Array
from shaftwork.results.solution import Solution

if TYPE_CHECKING:
    from shaftwork.pipeline.ensemble.ensemble import Ensemble

SIDE_BY_SIDE = 16
"""Variants from which on it is worth while to compile a program for many of them."""
CHUNK, LONE_CHUNK = 2048, 8
"""Variants that are computed and stored at once: side by side, and one by one."""

Reader = Measure | Callable[[Solution], float]


@dataclass(frozen=True, eq=False)
class Task:
    """A sweep, as every process gets it.

    Args:
        network: of which there are variants.
        columns: (k,) values by parameter, "shaft.c", in SI.
        measures: by name.
        sn: S-N lines by quantity.
        t_end: end of the motions, s.
        options: of `Model.simulate`.
        steady: whether each variant starts in its own steady state at t = 0.
    """

    network: Network
    columns: Mapping[str, Array]
    measures: Mapping[str, Reader]
    sn: Mapping[str, SNLine]
    t_end: float
    options: Mapping[str, Any]
    steady: bool = False

    def __len__(self) -> int:
        return len(next(iter(self.columns.values())))

    def values(self, variant: int) -> dict[str, float]:
        """The parameters of a variant that differ from the network's."""
        return {name: float(column[variant]) for name, column in self.columns.items()}


@dataclass(frozen=True, eq=False)
class Chunk:
    """What came out for some variants.

    Args:
        variants: (k,) their numbers.
        values: (k, measures); NaN where a variant failed.
        reasons: k texts; empty where it did not.
        left: how many could not be followed side by side and ran one by one.
    """

    variants: NDArray[np.intp]
    values: Array
    reasons: tuple[str, ...]
    left: int = 0


class Worker:
    """Computes variants of a sweep; each process has its own.

    Args:
        task: the sweep.

    Raises:
        NetworkError: the network cannot be assembled.
        ParameterError: the start values are no mapping.
        SignalError: a measure or a start value is of a quantity that does not exist.
    """

    def __init__(self, task: Task) -> None:
        self._task, self._model = task, task.network.compile()
        self._netlist: Netlist = task.network.netlist()
        self._refuse_unknown()
        self.why = ""
        """Why variants run one by one."""
        self._ensemble = self._side_by_side()
        self.chunk = LONE_CHUNK if self._ensemble is None else CHUNK

    def _refuse_unknown(self) -> None:
        observer = ModelObserver(self._model.form, self._model.bind)
        initial = self._task.options["initial"] or {}
        if not isinstance(initial, Mapping):
            raise ParameterError(f"initial = {initial!r} must map quantities to values, such as {{'J1.omega': 3.0}}.")
        read = [reader.quantity for reader in self._task.measures.values() if isinstance(reader, Measure)]
        given = () if isinstance(initial, Ending) else map(str, initial)
        for quantity in (*read, *given):
            if quantity not in {**observer.units, **observer.profiles}:
                raise no_quantity(quantity, self._model.name, observer.units)

    def _side_by_side(self) -> Ensemble | None:
        task, options = self._task, self._task.options
        read = [reader for reader in task.measures.values() if isinstance(reader, Measure)]
        reasons = {
            f"there are fewer than {SIDE_BY_SIDE} variants": len(task) < SIDE_BY_SIDE,
            "a measure is a function of a whole solution": len(read) < len(task.measures),
            f"engine = '{options['engine']}' was asked for": options["engine"] not in ("auto", "heyoka"),
            "start values are given": bool(options["initial"]),
            "each variant starts in its own steady state": task.steady,
            "heyoka is not installed (extra 'fast')": not available("heyoka"),
        }
        self.why = next((reason for reason, holds in reasons.items() if holds), "")
        if self.why:
            return None
        from shaftwork.pipeline.ensemble.ensemble import Ensemble

        span, names = (0.0, task.t_end), tuple(task.columns)
        for first in (task.values(0), {}):  # the network itself, where the first variant fails
            try:
                return Ensemble(self._model, names, first, read, span, options["rtol"])
            except CompileError as error:
                reason = str(error).splitlines()[0].rstrip(".")
                self.why = reason[0].lower() + reason[1:]
                return None
            except ShaftworkError:
                self.why = "the first of them fails, and the network as it is too"
        return None

    def run(self, variants: NDArray[np.intp]) -> Chunk:
        """Measures of some variants."""
        values = np.full((variants.size, len(self._task.measures)), np.nan)
        reasons = [self._objection(variant) if self._choosy else "" for variant in variants.tolist()]
        open_ = np.array([not reason for reason in reasons])
        if self._ensemble is not None and open_.any():
            here = np.flatnonzero(open_)
            columns = np.array([column[variants[here]] for column in self._task.columns.values()])
            found, done = self._ensemble.run(columns)
            values[here[done]] = found[:, done].T
            open_[here[done]] = False
        left = 0 if self._ensemble is None else int(open_.sum())
        for row in np.flatnonzero(open_).tolist():
            values[row], reasons[row] = self._alone(int(variants[row]))
        return Chunk(variants, values, tuple(reasons), left)

    @cached_property
    def _choosy(self) -> list[tuple[Component, list[tuple[str, Array]]]]:
        """Parts that check whether their values go together, with the columns of those that vary.

        Left out are those whose check reads nothing that varies: it says the same of all variants as of the network.
        """
        by_part: dict[str, list[tuple[str, Array]]] = {}
        for name, column in self._task.columns.items():
            owner, _, parameter = name.rpartition(".")
            by_part.setdefault(owner, []).append((parameter, column))
        parts = (placed.part for placed in self._netlist.placed)
        own = [(part, by_part[part.name]) for part in parts if part.name in by_part and hasattr(part, "__post_init__")]
        return [(part, columns) for part, columns in own if not _checked(part).isdisjoint({"__dict__", *dict(columns)})]

    def _objection(self, variant: int) -> str:
        """Why the values of a variant do not go together; empty where they do."""
        for part, columns in self._choosy:
            changed: Any = object.__new__(type(part))  # its values have been looked at one by one
            vars(changed).update(vars(part))
            vars(changed).update({parameter: float(column[variant]) for parameter, column in columns})
            try:
                changed.__post_init__()
            except ParameterError as error:
                return in_one_line(error)
        return ""

    def _alone(self, variant: int) -> tuple[Array, str]:
        """Measures of one variant, and why it failed."""
        task, nothing = self._task, np.full(len(self._task.measures), np.nan)
        parameters, options = task.values(variant), dict(task.options)
        try:
            if task.steady:
                options["initial"] = steady_start(self._model, options["initial"] or {}, parameters)
            solution = self._model.simulate(task.t_end, parameters=parameters, **options)
        except ShaftworkError as error:
            return nothing, in_one_line(error)
        values = []
        for name, reader in task.measures.items():
            try:
                value = reader.of(solution, task.sn) if isinstance(reader, Measure) else float(reader(solution))
            except Exception as error:  # noqa: BLE001 (of the user's own function: a reason, not the end of the sweep)
                return nothing, f"measure '{name}': {type(error).__name__}: {in_one_line(error)}"
            if not np.isfinite(value):
                return nothing, f"measure '{name}' is {value}"
            values.append(value)
        return np.array(values), ""


def _checked(part: Component) -> set[str]:
    """The names that a part's check of its values reads, for the values that it has."""
    read = set[str]()

    class ToldParts(type(part)):  # type: ignore[misc] # the same part, which tells what is read of it
        def __getattribute__(self, name: str) -> Any:
            read.add(name)
            return super().__getattribute__(name)

    told: Any = object.__new__(ToldParts)
    object.__getattribute__(told, "__dict__").update(vars(part))
    with muted(NetworkWarning, AccuracyWarning):  # what is odd about it was said when it was made
        told.__post_init__()
    return read - {"__post_init__"}
