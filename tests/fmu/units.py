"""FMUs of our own, as FMPy sees them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from ctypes import POINTER, c_double
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
from fmpy.simulation import instantiate_fmu

import shaftwork as sw

VERSIONS = ("3.0", "2.0")
KINDS = ("ModelExchange", "CoSimulation")


def two_masses(tau: Any = 10.0) -> sw.Network:
    """A motor turns two inertias with a damped shaft between them; smooth at all times."""
    net = sw.Network("two masses")
    net.add(sw.TorqueSource("motor", tau=tau), "rotor")
    net.add(sw.Inertia("J1", J=1.5), "rotor")
    net.add(sw.Spring("shaft", c=50.0, d=0.5), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=3.0), "wheel")
    return net


class Instance:
    """An instance of an FMU.

    Args:
        path: of the file.
        folder: where it has been unpacked.
        kind: of `KINDS`.
    """

    def __init__(self, path: Path, folder: Path, kind: str) -> None:
        self.description = fmpy.read_model_description(str(path))
        self.new = self.description.fmiVersion.startswith("3")
        self.unit = instantiate_fmu(str(folder), self.description, fmi_type=kind)
        self.references = {v.name: v.valueReference for v in self.description.modelVariables}
        self.size = len(self.description.derivatives)
        letter = "Float64" if self.new else "Real"
        self._get, self._set = getattr(self.unit, f"get{letter}"), getattr(self.unit, f"set{letter}")

    def begin(self, tolerance: float = 1e-10, **start: float) -> None:
        """Initialise, with start values whose dots are written as double underscores."""
        if self.new:
            self.set(**start)
            self.unit.enterInitializationMode(tolerance=tolerance, startTime=0.0)
        else:
            self.unit.setupExperiment(tolerance=tolerance, startTime=0.0)
            self.set(**start)
            self.unit.enterInitializationMode()
        self.unit.exitInitializationMode()

    def set(self, **values: float) -> None:
        for name, value in values.items():
            self._set([self.references[name.replace("__", ".")]], [value])

    def get(self, *names: str) -> list[float]:
        return [float(value) for value in self._get([self.references[name] for name in names])]

    def step(self, t: float, size: float) -> None:
        self.unit.doStep(t, size)

    def rates(self, t: float, x: Sequence[float]) -> list[float]:
        """The rates at a time and states."""
        states, rates = np.array(x, dtype=float), np.empty(self.size)
        self.unit.setTime(t)
        self.unit.setContinuousStates(states.ctypes.data_as(POINTER(c_double)), self.size)
        read = self.unit.getContinuousStateDerivatives if self.new else self.unit.getDerivatives
        read(rates.ctypes.data_as(POINTER(c_double)), self.size)
        return [float(rate) for rate in rates]

    def nominals(self) -> list[float]:
        """The usual sizes of the states."""
        sizes = np.empty(self.size)
        self.unit.getNominalsOfContinuousStates(sizes.ctypes.data_as(POINTER(c_double)), self.size)
        return [float(size) for size in sizes]

    def slope(self, unknowns: Sequence[str], knowns: Sequence[str], seed: Sequence[float]) -> list[float]:
        """The directional derivative."""
        places = [self.references[name] for name in unknowns], [self.references[name] for name in knowns]
        return [float(value) for value in self.unit.getDirectionalDerivative(*places, seed)]

    def keep(self) -> Any:
        return self.unit.getFMUState() if self.new else self.unit.getFMUstate()

    def restore(self, state: Any) -> None:
        (self.unit.setFMUState if self.new else self.unit.setFMUstate)(state)

    def drop(self, state: Any) -> None:
        (self.unit.freeFMUState if self.new else self.unit.freeFMUstate)(state)

    def serialised(self, state: Any) -> bytes:
        return bytes((self.unit.serializeFMUState if self.new else self.unit.serializeFMUstate)(state))

    def deserialised(self, data: bytes) -> Any:
        return (self.unit.deserializeFMUState if self.new else self.unit.deSerializeFMUstate)(data)


@contextmanager
def instances(path: Path, kind: str, count: int = 1) -> Iterator[list[Instance]]:
    """Instances of an FMU, which are freed in the end.

    Args:
        path: of the file.
        kind: of `KINDS`.
        count: how many.
    """
    folder = path.with_suffix("")
    if not folder.exists():  # a library that is loaded must not be written again
        fmpy.extract(str(path), unzipdir=folder)
    several = [Instance(path, folder, kind) for _ in range(count)]
    try:
        yield several
    finally:
        for one in several:
            one.unit.terminate()
            one.unit.fmi3FreeInstance(one.unit.component) if one.new else one.unit.fmi2FreeInstance(one.unit.component)
