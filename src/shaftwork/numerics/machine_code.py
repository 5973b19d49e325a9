"""How right-hand sides in machine code are called, and the functions of numbers in them: for numba."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from typing import Any

import numpy as np
from llvmlite import ir
from numba import cfunc, njit, types
from numba.core import cgutils
from numba.extending import get_cython_function_address, intrinsic

from shaftwork.numerics.lane_functions import LANE_FUNCTIONS, LANES, NUMBERS, Numbers

VECTOR, MATRIX = types.Array(types.float64, 1, "C"), types.Array(types.float64, 2, "C")
CONSTANT = types.Array(types.float64, 1, "C", readonly=True)
SYSTEM = (types.float64, VECTOR, VECTOR, VECTOR)
"""What a system takes: t in s, x (n,), p (parameters,) and an array that it writes."""

_quantile = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double, ctypes.c_int)(
    get_cython_function_address("scipy.special.cython_special", "ndtri")
)


def compiled(signature: Any = None) -> Callable[[Any], Any]:
    """Compile a function, and keep it for other processes where there is a folder for it."""

    def decorate(function: Any) -> Any:
        try:
            return njit(signature, error_model="numpy", cache=True)(function)
        except RuntimeError:  # no folder can be written
            return njit(signature, error_model="numpy")(function)

    return decorate


inner = njit(error_model="numpy", no_cpython_wrapper=True, no_cfunc_wrapper=True, no_rewrites=True)  # type: ignore[call-overload]
"""Compile a function that compiled ones alone call, without what would let Python call it."""

_written: Any = intrinsic
"""Functions of which this file writes the machine code itself."""


class Body:
    """The machine code of a function of `SYSTEM`, as it is written.

    Args:
        context: numba's.
        builder: llvmlite's; its instructions may be used beside what is here.
        arguments: of the function.
    """

    def __init__(self, context: Any, builder: Any, arguments: Sequence[Any]) -> None:
        self._context, self.builder, self.t = context, builder, arguments[0]
        data = (context.make_array(VECTOR)(context, builder, value=array).data for array in arguments[1:])
        self._data = dict(zip(("x", "p", "written"), data, strict=True))

    def number(self, value: float) -> Any:
        """A number."""
        return ir.Constant(ir.DoubleType(), value)

    def bit(self, *, value: bool) -> Any:
        """A condition that is known."""
        return ir.Constant(ir.IntType(1), value)

    def _place(self, array: str, place: int, row: Any) -> Any:
        number = ir.Constant(ir.IntType(64), place)
        return self.builder.gep(self._data[array], [number if row is None else self.builder.add(row, number)])

    def read(self, array: str, place: int, row: Any = None) -> Any:
        """A number of an array, x or p, at a place behind the row of a loop if there is one."""
        return self.builder.load(self._place(array, place, row))

    def write(self, place: int, value: Any, row: Any = None) -> None:
        """Write a number, at a place behind the row of a loop if there is one."""
        self.builder.store(value, self._place("written", place, row))

    @contextmanager
    def loop(self, first: int, last: int) -> Iterator[Any]:
        """The row of a loop from a first one to one before the last."""
        start, end = (ir.Constant(ir.IntType(64), row) for row in (first, last))
        with cgutils.for_range(self.builder, end, start) as loop:
            yield loop.index

    def array(self, values: Sequence[float]) -> Any:
        """A constant array."""
        return self._context.make_constant_array(self.builder, CONSTANT, np.array(values, dtype=float))

    def intrinsic(self, name: str, value: Any) -> Any:
        """A function that processors have."""
        return self.builder.call(self.builder.module.declare_intrinsic(f"llvm.{name}", [value.type]), [value])

    def call(self, function: Any, *values: Any) -> Any:
        """A function of numbers and constant arrays that numba knows."""
        context, is_number = self._context, [isinstance(value.type, ir.DoubleType) for value in values]
        arguments = tuple(types.float64 if number else CONSTANT for number in is_number)
        kind = context.typing_context.resolve_value_type(function)
        code = context.get_function(kind, kind.get_call_type(context.typing_context, arguments, {}))
        context.add_linking_libs(getattr(code, "libs", ()))
        return code(self.builder, values)


class LaneBody(Body):
    """The machine code of a function of many systems side by side, whose numbers stand in rows of `LANES`.

    Args:
        context: numba's.
        builder: llvmlite's.
        arguments: of the function: the address of the first row, and the number of the row that it writes first.
        rows: the first row of each array.
    """

    def __init__(self, context: Any, builder: Any, arguments: Sequence[Any], rows: Mapping[str, int]) -> None:
        self._context, self.builder, self._rows = context, builder, rows
        self._memory = builder.inttoptr(arguments[0], NUMBERS.as_pointer())
        self._written = builder.gep(self._memory, [arguments[1]])
        self.t = self.read("moment", 0)

    def number(self, value: float) -> Any:
        return ir.Constant(NUMBERS, [value] * LANES)

    def bit(self, *, value: bool) -> Any:
        return ir.Constant(ir.VectorType(ir.IntType(1), LANES), [value] * LANES)

    def _at(self, first: Any, place: int, row: Any) -> Any:
        number = ir.Constant(ir.IntType(64), place)
        return self.builder.gep(first, [number if row is None else self.builder.add(row, number)])

    def read(self, array: str, place: int, row: Any = None) -> Any:
        return self.builder.load(self._at(self._memory, self._rows[array] + place, row), align=8)

    def write(self, place: int, value: Any, row: Any = None) -> None:
        self.builder.store(value, self._at(self._written, place, row), align=8)

    def put(self, array: str, place: int, value: Any, row: Any = None) -> None:
        """Write numbers of an array of which this is not the one that the function writes."""
        self.builder.store(value, self._at(self._memory, self._rows[array] + place, row), align=8)

    def intrinsic(self, name: str, *values: Any) -> Any:
        first, *others = (Numbers(self.builder, value) for value in values)
        return first.intrinsic(name, *others).value

    def call(self, function: Any, *values: Any) -> Any:
        if function in LANE_FUNCTIONS:
            return self.builder.call(self._function(function), values)
        return self.call_one_by_one(function, *values)

    def _function(self, function: Any) -> Any:
        """A function of all lanes, once in what is compiled; beyond its range a lane takes that of one number."""
        name, module = f"lanes.{function.__name__}", self.builder.module
        if name not in module.globals:
            code = ir.Function(module, ir.FunctionType(NUMBERS, [NUMBERS]), name)
            code.linkage = "internal"
            code.attributes.add("noinline")
            inside = copy(self)
            inside.builder = build = ir.IRBuilder(code.append_basic_block())
            x, (write, low, high) = Numbers(build, code.args[0]), LANE_FUNCTIONS[function]
            result, good = write(x), x.between(low, high)
            bits = ir.IntType(LANES)
            with build.if_then(build.icmp_unsigned("!=", build.bitcast(good, bits), bits(-1)), likely=False):
                alone = Numbers(build, inside.call_one_by_one(function, x.value))
                build.ret(result.where(good, alone).value)
            build.ret(result.value)
        return module.globals[name]

    def call_one_by_one(self, function: Any, *values: Any) -> Any:
        """A function of one lane after the other."""
        result = self.number(0.0)
        for lane in range(LANES):
            number = ir.Constant(ir.IntType(32), lane)
            one = [self.builder.extract_element(v, number) if v.type == NUMBERS else v for v in values]
            result = self.builder.insert_element(result, super().call(function, *one), number)
        return result

    def run(self, address: int, row: int) -> None:
        """Run another function of this memory, which writes from a row on."""
        whole = ir.IntType(64)
        kind = ir.FunctionType(ir.VoidType(), [whole, whole]).as_pointer()
        function = self.builder.inttoptr(ir.Constant(whole, address), kind)
        memory = self.builder.ptrtoint(self._memory, whole)
        self.builder.call(function, [memory, ir.Constant(whole, row)])


def lane_function(write: Callable[[LaneBody], None], rows: Mapping[str, int]) -> Any:
    """A function of the memory of a block of lanes and a number of a row, from what writes it; see `LaneBody`."""

    @_written
    def body(_typing, memory, row):  # type: ignore[no-untyped-def]
        def lowered(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            write(LaneBody(context, builder, arguments, rows))
            return context.get_dummy_value()

        return types.void(memory, row), lowered

    return cfunc(types.void(types.int64, types.int64))(lambda memory, row: body(memory, row))  # noqa: PLW0108


@_written
def run_at(_typing, address, memory, row):  # type: ignore[no-untyped-def]
    """Call a `lane_function` by its address, with an array as memory and the number of the row that it writes first."""

    def lowered(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        whole = ir.IntType(64)
        function = builder.inttoptr(arguments[0], ir.FunctionType(ir.VoidType(), [whole, whole]).as_pointer())
        data = context.make_array(signature.args[1])(context, builder, value=arguments[1]).data
        builder.call(function, [builder.ptrtoint(data, whole), arguments[2]])
        return context.get_dummy_value()

    return types.void(address, memory, row), lowered


def machine_function(write: Callable[[Body], None]) -> Any:
    """A function of `SYSTEM` in machine code, from what writes it.

    Numba would take a second for the hundreds of lines of Python that a network is: to find types and to lower them.
    """

    @_written
    def body(_typing, t, x, p, written):  # type: ignore[no-untyped-def]
        def lowered(context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
            write(Body(context, builder, arguments))
            return context.get_dummy_value()

        return types.void(t, x, p, written), lowered

    return cfunc(types.void(*SYSTEM))(lambda t, x, p, written: body(t, x, p, written))  # noqa: PLW0108 (numba compiles functions)


@_written
def call_at(_typing, address, t, x, p, written):  # type: ignore[no-untyped-def]
    """Call a function of `SYSTEM` by its address: one in an argument would have its type looked up at each call."""

    def lowered(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kinds = [context.get_value_type(kind) for kind in signature.args[1:]]
        function = builder.inttoptr(arguments[0], ir.FunctionType(ir.VoidType(), kinds).as_pointer())
        builder.call(function, arguments[1:])
        return context.get_dummy_value()

    return types.void(address, t, x, p, written), lowered


@njit(error_model="numpy")
def interpolate(x, xs, ys):  # type: ignore[no-untyped-def]
    """Value of a table, as `components.tables.interpolate` has it."""
    if not x > xs[0]:
        return x if math.isnan(x) else ys[0]
    if x >= xs[-1]:
        return ys[-1]
    k = np.searchsorted(xs, x, side="right")
    return (ys[k] - ys[k - 1]) / (xs[k] - xs[k - 1]) * (x - xs[k - 1]) + ys[k - 1]


@njit(error_model="numpy")
def interpolation_slope(x, xs, ys):  # type: ignore[no-untyped-def]
    """Slope of a table, as `components.tables.interpolation_slope` has it."""
    k = np.searchsorted(xs, x, side="right")
    return (ys[k] - ys[k - 1]) / (xs[k] - xs[k - 1]) if 0 < k < xs.size else 0.0


@njit
def _split_mix(start, number):  # type: ignore[no-untyped-def]
    word = start + number * np.uint64(0x9E3779B97F4A7C15)
    word = (word ^ (word >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    word = (word ^ (word >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return word ^ (word >> np.uint64(31))


@njit(error_model="numpy")
def held_noise(x, seed):  # type: ignore[no-untyped-def]
    """Value of `HeldNoise`, as `components.noise.held` has it; NaN beyond the whole numbers of 64 bits."""
    if not abs(x) < 2.0**63:
        return math.nan
    start = _split_mix(np.float64(seed + 0.0).view(np.uint64), np.uint64(1))
    word = _split_mix(start, np.uint64(np.int64(math.floor(x))))
    return _quantile((np.float64(word >> np.uint64(11)) + 0.5) / 2.0**53, 0)
