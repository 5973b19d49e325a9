"""C code compiled and called: the code of a model as a library."""

from __future__ import annotations

import ctypes
import subprocess
from pathlib import Path

import numpy as np

from shaftwork.ccode.c_export import CCode

STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Wshadow", "-Wconversion", "-Werror"]
"""The code compiles silently."""


class Library:
    """One instance of a model in C.

    Args:
        code: the model.
        folder: for its files.
        flags: of the compiler.
    """

    def __init__(self, code: CCode, folder: Path, flags: tuple[str, ...] = ("-O0",)) -> None:
        self.code = code
        code.write(folder)
        library = folder / "library.so"
        command = [
            "gcc",
            *STRICT,
            *flags,
            "-shared",
            "-fPIC",
            "-o",
            str(library),
            str(folder / f"{code.name}.c"),
            "-lm",
        ]
        subprocess.run(command, check=True, capture_output=True, text=True)
        self.functions = ctypes.CDLL(str(library))
        self.struct = _struct(code)()
        for name, kind in (
            ("next_time", ctypes.c_double),
            ("mode_name", ctypes.c_char_p),
            ("message", ctypes.c_char_p),
        ):
            self._function(name).restype = kind
        self._function("init")(ctypes.byref(self.struct))

    def _function(self, name: str) -> ctypes._CFuncPtr:
        return getattr(self.functions, f"{self.code.name}_{name}")

    def call(self, name: str, *arguments: float) -> int:
        """A function of the instance; a fault is an error."""
        result = self._function(name)(ctypes.byref(self.struct), *map(ctypes.c_double, arguments))
        assert result >= 0, (self.struct.t, self._function("message")(result))
        return int(result)

    def read(self, name: str, t: float, x: np.ndarray, size: int) -> np.ndarray:
        """What a function of time and states writes into an array."""
        into = np.zeros(max(size, 1))
        states = np.ascontiguousarray([*x, 0.0])
        pointer = ctypes.POINTER(ctypes.c_double)
        self._function(name)(
            ctypes.byref(self.struct), ctypes.c_double(t), states.ctypes.data_as(pointer), into.ctypes.data_as(pointer)
        )
        return into[:size]

    @property
    def x(self) -> np.ndarray:
        """The states."""
        return np.array(self.struct.x[: len(self.code.states)])

    def outputs(self) -> dict[str, float]:
        """The outputs now, by name."""
        y = self.read("outputs", self.struct.t, self.x, len(self.code.outputs))
        return dict(zip((variable.name for variable in self.code.outputs), y.tolist(), strict=True))

    @property
    def modes(self) -> list[str]:
        """The mode of each part that changes its mode."""
        numbers = enumerate(self.struct.mode[: len(self.code.machines)])
        return [self._function("mode_name")(k, number).decode() for k, number in numbers]


def _struct(code: CCode) -> type[ctypes.Structure]:
    states, parameters, inputs = len(code.states), len(code.parameters), len(code.inputs)
    number, real, whole = ctypes.c_double, ctypes.c_double, ctypes.c_int

    class Instance(ctypes.Structure):
        _fields_ = (
            ("t", real),
            ("x", real * (states + 1)),
            ("p", real * (parameters + 1)),
            ("u", real * (inputs + 1)),
            ("start", real * (len(code.stores) + 1)),
            ("number", number * (len(code.machines) + 1)),
            ("mode", whole * (len(code.machines) + 1)),
            ("set", whole),
            ("side", whole * (code.guards + 1)),
            ("clear", real * (code.guards + 1)),
            ("met", whole),
            *((name, real) for name in ("next", "since", "until", "h", "look_ahead")),
            ("most_steps", ctypes.c_long),
            ("fault", whole),
            *((name, ctypes.c_long) for name in ("steps", "rejected", "events")),
        )

    return Instance
