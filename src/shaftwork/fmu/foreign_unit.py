"""An FMU of another tool, loaded through FMPy and evaluated as a function of time, its states and its input."""

from __future__ import annotations

import contextlib
import math
import shutil
import threading
import weakref
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from tempfile import mkdtemp
from types import MappingProxyType
from typing import Any, Self

import numpy as np

from shaftwork.core.errors import ParameterError, SimulationError, imported
from shaftwork.fmu.unit_interface import base_unit

MOST_STATES = 256
"""Continuous states that an FMU in a network may have: each is a state of the network."""
_NUMBERS = ("Real", "Float64")
_BASE_UNITS = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
_SI = {"speed": "rad/s", "torque": "N*m"}
"""The SI units of what an FMU and its node give each other."""


@dataclass(frozen=True)
class FMU:
    """A functional mock-up unit: a file for model exchange, FMI 2.0 or 3.0, that stands in a network as a part.

    Its binary is loaded and runs in this process, so take files of people you trust.

    Args:
        path: of the file.
        speed: name of its variable for the speed of the node, in rad/s or a unit that its description tells in SI.
        torque: name of its variable for the torque on the node, in N m or a unit that its description tells in SI.
        start: values of its parameters and of its other inputs, by name, in the units of the FMU.

    Raises:
        MissingExtraError: FMPy is not installed.
        ParameterError: the file cannot be read, has no such variable, has one in the unit of another quantity, or
            holds what a right-hand side cannot.
    """

    path: Path
    speed: str
    torque: str
    start: Mapping[str, float] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        if not isinstance(self.path, str | Path):
            raise ParameterError(f"path = {self.path!r} must be the name of a file, such as 'motor.fmu'.")
        if not isinstance(self.start, Mapping):
            raise ParameterError(f"start = {self.start!r} must map names to values, such as {{'shaft.c': 80.0}}.")
        object.__setattr__(self, "path", Path(self.path).resolve())
        object.__setattr__(self, "start", MappingProxyType(dict(self.start)))
        self._refuse_unfit()
        for name, value in self.start.items():
            self._variable(name, ("parameter", "input"), "start")
            if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
                raise ParameterError(f"FMU '{self.path.name}': start['{name}'] = {value!r} must be a finite number.")
        for name, what in ((self.speed, "speed"), (self.torque, "torque")):
            if self._variable(name, ("input", "output"), what).variability == "discrete":
                raise ParameterError(
                    f"FMU '{self.path.name}': {what} names '{name}', which changes at events alone, and a part of a "
                    "network has none. Name a continuous variable."
                )
            self.scale(what)

    def __reduce__(self) -> tuple[Any, ...]:
        return FMU, (self.path, self.speed, self.torque, dict(self.start))

    def __repr__(self) -> str:
        return f"FMU({str(self.path)!r}, speed={self.speed!r}, torque={self.torque!r}, start={dict(self.start)!r})"

    @classmethod
    def read(cls, _text: object) -> Self:
        """No text stands for an FMU: its binary would run because a model file says so.

        Args:
            _text: anything.

        Raises:
            ParameterError: always.
        """
        raise ParameterError(
            "an FMU is a program that would run in this process, and no text in a file may ask for that. Build the "
            "part in a script, with fmu=sw.FMU('file.fmu', speed=..., torque=...). To store a motion with it, pickle "
            "it, or take its numbers with to_pandas() or to_xarray()"
        )

    @cached_property
    def description(self) -> Any:
        """FMPy's reading of its modelDescription.xml."""
        fmpy = imported("fmpy", "fmi", "sw.FMU")
        try:
            return fmpy.read_model_description(str(self.path))
        except Exception as error:  # noqa: BLE001 (FMPy raises whatever its XML and ZIP readers do)
            reason = " ".join(str(error).split())[:300]
            raise ParameterError(f"'{self.path}' is no FMU that can be read: {reason}") from None

    @property
    def states(self) -> tuple[str, ...]:
        """Names of its continuous states."""
        return tuple(unknown.variable.derivative.name for unknown in self.description.derivatives)

    def _variable(self, name: str, causalities: tuple[str, ...], what: str) -> Any:
        fitting = [v for v in self.description.modelVariables if v.causality in causalities and v.type in _NUMBERS]
        for variable in fitting:
            if variable.name == name:
                return variable
        names = ", ".join(v.name for v in fitting[:20]) or "none"
        raise ParameterError(
            f"FMU '{self.path.name}': {what} names '{name}', which is no {' or '.join(causalities)} that is a number. "
            f"It has: {names}."
        )

    def _refuse_unfit(self) -> None:
        """Refuse what a right-hand side cannot evaluate."""
        unit = self.description
        events = int(unit.numberOfEventIndicators or 0)
        reason = ""
        if not str(unit.fmiVersion).startswith(("2.", "3.")):
            reason = f"is of FMI {unit.fmiVersion}; export it as FMI 2.0 or 3.0"
        elif unit.modelExchange is None:
            reason = (
                "is for co-simulation alone: it keeps its states to itself, and a right-hand side cannot ask it. "
                "Export it for model exchange, or step it beside a run of model.start(...)"
            )
        elif events:
            reason = (
                f"has {events} event indicators: it changes its equations by itself, which a part of a network may "
                "not. Export it without events, or for co-simulation, and step it beside a run of model.start(...)"
            )
        elif len(unit.derivatives) > MOST_STATES:
            reason = f"has {len(unit.derivatives)} states; at most {MOST_STATES} can be states of a network"
        elif any(unknown.variable.shape for unknown in unit.derivatives):
            reason = "has arrays as states; export it with scalars"
        if reason:
            raise ParameterError(f"FMU '{self.path.name}' {reason}.")

    def scale(self, what: str) -> float:
        """The SI value of one of the unit that the FMU declares; 1 where it declares none.

        Args:
            what: "speed" or "torque".

        Raises:
            ParameterError: the unit is that of another quantity, or nothing tells what it is in SI.
        """
        name = getattr(self, what)
        variable = self._variable(name, ("input", "output"), what)
        unit = variable.unit or getattr(variable.declaredType, "unit", None)
        if unit is None:
            return 1.0
        exponents, factor, offset = self._in_base_units(unit)
        if exponents != base_unit(_SI[what])[0] or offset or factor == 0.0 or not math.isfinite(factor):
            raise ParameterError(
                f"FMU '{self.path.name}': {what} names '{name}', whose unit '{unit}' does not agree with "
                f"'{_SI[what]}'. Name a variable of that quantity, or give its unit a BaseUnit in modelDescription.xml."
            )
        return factor

    def _in_base_units(self, unit: str) -> tuple[dict[str, int], float, float]:
        """Exponents of SI base units, factor and offset; where the FMU does not tell them, from the unit's name."""
        try:
            for declared in self.description.unitDefinitions:
                if declared.name == unit and (base := declared.baseUnit) is not None:
                    exponents = {si: int(getattr(base, si)) for si in _BASE_UNITS}
                    return {si: n for si, n in exponents.items() if n}, float(base.factor), float(base.offset)
            return *base_unit(unit.replace(".", "*")), 0.0
        except (KeyError, ValueError):  # a number that is none, or a name that is none here
            return {}, 1.0, 0.0

    def gives(self, name: str) -> bool:
        """Whether a variable is one of its outputs."""
        return any(v.name == name and v.causality == "output" for v in self.description.modelVariables)

    def feeds_through(self, output: str) -> bool:
        """Whether an output depends on an input at once; true where its author does not say."""
        for unknown in self.description.outputs:
            if unknown.variable.name == output:
                dependencies = unknown.dependencies
                return dependencies is None or any(v.causality == "input" for v in dependencies)
        return True


class ForeignUnit:
    """One instance of an FMU as a pure function: time, states and input to the rates of the states and the output.

    Input and output are in SI. The states are counted from those that it starts with, as all that a network stores is
    zero at rest.

    Args:
        fmu: the file with its values.
        reads: what is set, "speed" or "torque".
        gives: what is read, the other of them.
    """

    def __init__(self, fmu: FMU, reads: str, gives: str) -> None:
        self._fmu, self._reads, self._gives = fmu, reads, gives
        self._input, self._output = getattr(fmu, reads), getattr(fmu, gives)
        self._input_scale, self._output_scale = fmu.scale(reads), fmu.scale(gives)
        self.key = f"{fmu} of {fmu.path.stat().st_mtime_ns}, {gives} by {reads}"
        self._lock = threading.Lock()
        self._last: tuple[tuple[float, ...], list[float]] = ((), [])

    def __reduce__(self) -> tuple[Any, ...]:
        return ForeignUnit, (self._fmu, self._reads, self._gives)

    def value(self, output: int, arguments: tuple[float, ...]) -> float:
        """The rate of a state, or behind the last of them what the unit gives.

        Args:
            output: index of the state.
            arguments: time in s, states, and the input.

        Raises:
            SimulationError: the FMU refuses to evaluate there.
        """
        with self._lock:
            if arguments != self._last[0]:
                self._last = arguments, self._evaluated(*arguments)
            return self._last[1][output]

    def _evaluated(self, t: float, *numbers: float) -> list[float]:
        try:
            *rates, output = self._instance.evaluated(t, np.array(numbers[:-1]), numbers[-1] / self._input_scale)
            return [*rates, output * self._output_scale]
        except SimulationError:
            raise
        except Exception as error:  # noqa: BLE001 (FMPy raises plain exceptions)
            reason = " ".join(str(error).split())[:300]
            raise SimulationError(
                f"The FMU '{self._fmu.path.name}' failed at t = {t:.9g} s, {self._input} = {numbers[-1]:.9g}: {reason}"
            ) from None

    @cached_property
    def _instance(self) -> _Instance:
        return _Instance(self._fmu, self._input, self._output)


class _Instance:
    """A loaded binary in its continuous-time mode.

    Args:
        fmu: the file with its values.
        input_name: of the variable that is set.
        output_name: of the variable that is read.
    """

    def __init__(self, fmu: FMU, input_name: str, output_name: str) -> None:
        fmpy, simulation = (imported(name, "fmi", "sw.FMU") for name in ("fmpy", "fmpy.simulation"))
        description = fmu.description
        folder = mkdtemp(prefix="shaftwork-fmu-")
        weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)
        fmpy.extract(str(fmu.path), unzipdir=folder)
        with contextlib.chdir("."):  # FMPy stays in the folder of a binary that cannot be loaded
            self._unit = simulation.instantiate_fmu(folder, description, fmi_type="ModelExchange")
        references = {v.name: v.valueReference for v in description.modelVariables}
        self._input, self._output = [references[input_name]], [references[output_name]]
        newer = str(description.fmiVersion).startswith("3.")
        kind, rates = ("Float64", "getContinuousStateDerivatives") if newer else ("Real", "getDerivatives")
        self._set, self._get = getattr(self._unit, f"set{kind}"), getattr(self._unit, f"get{kind}")
        self._rates = getattr(self._unit, rates)
        self._size = len(description.derivatives)
        if newer and (count := self._unit.getNumberOfContinuousStates()) != self._size:
            raise SimulationError(
                f"The binary of the FMU '{fmu.path.name}' has {count} continuous states, but its modelDescription.xml "
                f"tells {self._size}. They are not of the same export: make the FMU anew."
            )
        if not newer:
            self._unit.setupExperiment(startTime=0.0)
        start = [[references[name]] for name in fmu.start], list(fmu.start.values())
        for reference, value in zip(*start, strict=True):
            self._set(reference, [value])
        self._unit.enterInitializationMode()
        self._unit.exitInitializationMode()
        update = self._unit.updateDiscreteStates if newer else self._unit.newDiscreteStates
        needed = next_event = True
        while needed:
            needed, _, _, _, next_event, when = update()
        if next_event:
            raise SimulationError(
                f"The FMU '{fmu.path.name}' announces an event at t = {when:.9g} s, and a part of a network may have "
                "none. Export it for co-simulation and step it beside a run of model.start(...)."
            )
        self._unit.enterContinuousTimeMode()
        self._start = self._states(self._unit.getContinuousStates)

    def _states(self, read: Any) -> np.ndarray[Any, Any]:
        values = np.empty(self._size)
        if self._size:
            read(_pointer(values), self._size)
        return values

    def evaluated(self, t: float, deviations: np.ndarray[Any, Any], value: float) -> list[float]:
        """Rates of the states and the output, at a time in s, states less those of the start, and an input."""
        states = self._start + deviations
        self._unit.setTime(t)
        if self._size:
            self._unit.setContinuousStates(_pointer(states), self._size)
        self._set(self._input, [value])
        return [*self._states(self._rates).tolist(), *map(float, self._get(self._output))]


def _pointer(values: np.ndarray[Any, Any]) -> Any:
    from ctypes import POINTER, c_double

    return values.ctypes.data_as(POINTER(c_double))
