"""Elementary functions of eight lanes at once, as instructions: those of C's library take one number at a time.

Reductions and polynomials are those of fdlibm (Sun Microsystems 1993: e_rem_pio2, k_sin, k_cos, e_exp, e_log), and for
tanh and sinh those of Cephes (Moshier, Methods and Programs for Mathematical Functions, 1989). No error is larger than
2 units in the last place. Multiplications and additions may be fused; nothing relies on it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from llvmlite import ir

LANES = 8
"""Systems side by side in one call: as many numbers as a processor adds at once, or a few times as many."""
NUMBERS, WORDS = ir.VectorType(ir.DoubleType(), LANES), ir.VectorType(ir.IntType(64), LANES)
_MANTISSA, _BIAS, _MAGIC = 52, 1023, 1.5 * 2.0**52
"""Of numbers of 64 bits; and a number whose sum with a small one ends in the bits of the nearest whole number."""


def _value(numbers: Numbers | float) -> Any:
    return numbers.value if isinstance(numbers, Numbers) else ir.Constant(NUMBERS, [numbers] * LANES)


class Numbers:
    """The numbers of all lanes; Python's operators write the instructions.

    Args:
        build: llvmlite's builder.
        value: in it.
    """

    def __init__(self, build: ir.IRBuilder, value: Any) -> None:
        self.build, self.value = build, value

    def _with(self, name: str, one: Numbers | float, other: Numbers | float) -> Numbers:
        write = getattr(self.build, name)
        return Numbers(self.build, write(_value(one), _value(other), flags=("contract",)))

    def __add__(self, other: Numbers | float) -> Numbers:
        return self._with("fadd", self, other)

    def __sub__(self, other: Numbers | float) -> Numbers:
        return self._with("fsub", self, other)

    def __mul__(self, other: Numbers | float) -> Numbers:
        return self._with("fmul", self, other)

    def __truediv__(self, other: Numbers | float) -> Numbers:
        return self._with("fdiv", self, other)

    def __radd__(self, other: float) -> Numbers:
        return self._with("fadd", other, self)

    def __rsub__(self, other: float) -> Numbers:
        return self._with("fsub", other, self)

    __rmul__ = __mul__

    def __rtruediv__(self, other: float) -> Numbers:
        return self._with("fdiv", other, self)

    def intrinsic(self, name: str, *others: Numbers) -> Numbers:
        """A function that processors have."""
        title, kind = f"llvm.{name}.v{LANES}f64", ir.FunctionType(NUMBERS, [NUMBERS] * (1 + len(others)))
        function = self.build.module.declare_intrinsic(title, (), kind)
        return Numbers(self.build, self.build.call(function, [self.value, *(other.value for other in others)]))

    def below(self, limit: float) -> Any:
        """Where the numbers are below a limit."""
        return self.build.fcmp_ordered("<", self.value, _value(limit))

    def between(self, low: float, high: float) -> Any:
        """Where the numbers are neither below one nor above another, and are numbers."""
        above = self.build.fcmp_ordered(">=", self.value, _value(low))
        return self.build.and_(above, self.build.fcmp_ordered("<=", self.value, _value(high)))

    def where(self, condition: Any, other: Numbers | float) -> Numbers:
        """The numbers where a condition holds, others elsewhere."""
        return Numbers(self.build, self.build.select(condition, self.value, _value(other)))

    def word(self, name: str, other: Numbers | int) -> Numbers:
        """The numbers that an operation of whole numbers makes of their bits and those of others, or a word."""
        bits = [self.build.bitcast(part.value, WORDS) for part in (self, other) if isinstance(part, Numbers)]
        bits += [ir.Constant(WORDS, [other] * LANES)] if isinstance(other, int) else []
        return Numbers(self.build, self.build.bitcast(getattr(self.build, name)(*bits), NUMBERS))

    def polynomial(self, *coefficients: float) -> Numbers:
        """A polynomial, from its coefficients, the highest first."""
        value = Numbers(self.build, _value(coefficients[0]))
        for coefficient in coefficients[1:]:
            value = value * self + coefficient
        return value


def _circle(x: Numbers) -> tuple[Numbers, Numbers, Numbers]:
    """Sine and cosine of what is left of an angle beside the nearest multiple of pi/2, and bits that end in its number.

    As three parts of pi/2 have 33 bits each, nothing is lost where that number has less than 20.
    """
    nearest = x * 6.36619772367581382433e-01 + _MAGIC
    number = nearest - _MAGIC
    rest, lost = x - number * 1.57079632673412561417, Numbers(x.build, _value(0.0))
    for part in (6.07710050630396597660e-11, 2.02226624871116645580e-21):
        change, before = number * part, rest
        rest = before - change
        lost = lost + (change - (before - rest))
    lost = lost + number * 8.47842766036889956997e-32
    y = rest - lost  # of -0 it is -0
    tail = (rest - y) - lost
    z = y * y
    cubic = z * y
    bend = z.polynomial(
        1.58969099521155010221e-10, -2.50507602534068634195e-08, 2.75573137070700676789e-06,
        -1.98412698298579493134e-04, 8.33333333332248946124e-03,
    )  # fmt: skip
    sine = y - ((z * (0.5 * tail - cubic * bend) - tail) - cubic * -1.66666666666666324348e-01)
    bend = z * z.polynomial(
        -1.13596475577881948265e-11, 2.08757232129817482790e-09, -2.75573143513906633035e-07,
        2.48015872894767294178e-05, -1.38888888888741095749e-03, 4.16666666666666019037e-02,
    )  # fmt: skip
    half = 0.5 * z
    top = 1.0 - half
    return sine, top + (((1.0 - top) - half) + (z * bend - y * tail)), nearest


def _odd(number: Numbers) -> Any:
    """Where the number of a multiple of pi/2 is odd."""
    return number.build.trunc(number.build.bitcast(number.value, WORDS), ir.VectorType(ir.IntType(1), LANES))


def _sin(x: Numbers) -> Numbers:
    sine, cosine, number = _circle(x)
    return cosine.where(_odd(number), sine).word("xor", number.word("and_", 2).word("shl", 62))


def _cos(x: Numbers) -> Numbers:
    sine, cosine, number = _circle(x)
    return sine.where(_odd(number), cosine).word("xor", number.word("add", 1).word("and_", 2).word("shl", 62))


def _tan(x: Numbers) -> Numbers:
    sine, cosine, number = _circle(x)
    odd = _odd(number)
    return (0.0 - cosine).where(odd, sine) / sine.where(odd, cosine)


def _exp(x: Numbers) -> Numbers:
    nearest = x * 1.44269504088896338700 + _MAGIC
    number = nearest - _MAGIC
    high, low = x - number * 6.93147180369123816490e-01, number * 1.90821492927058770002e-10
    rest = high - low
    z = rest * rest
    c = rest - z * z.polynomial(
        4.13813679705723846039e-08, -1.65339022054652515390e-06, 6.61375632143793436117e-05,
        -2.77777777770155933842e-03, 1.66666666666666019037e-01,
    )  # fmt: skip
    power = nearest.word("add", _BIAS).word("shl", _MANTISSA)
    return power * (1.0 - ((low - (rest * c) / (2.0 - c)) - high))


def _log(x: Numbers) -> Numbers:
    half = 0x3FE6A09E667F3BCD  # the bits of the root of 1/2
    bits = x.word("add", (_BIAS << _MANTISSA) - half)
    exponent = bits.word("lshr", _MANTISSA).word("or_", 0x433 << _MANTISSA) - (2.0**_MANTISSA + _BIAS)
    f = bits.word("and_", (1 << _MANTISSA) - 1).word("add", half) - 1.0
    s, square = f / (2.0 + f), 0.5 * f * f
    z = s * s
    bend = z * z.polynomial(
        1.479819860511658591e-01, 1.531383769920937332e-01, 1.818357216161805012e-01, 2.222219843214978396e-01,
        2.857142874366239149e-01, 3.999999999940941908e-01, 6.666666666666735130e-01,
    )  # fmt: skip
    return exponent * 6.93147180369123816490e-01 - (
        (square - (s * (square + bend) + exponent * 1.90821492927058770002e-10)) - f
    )


def _tanh(x: Numbers) -> Numbers:
    size = x.intrinsic("fabs")
    size = size.where(size.below(20.0), 20.0)
    z = size * size
    small = size + size * z * (
        z.polynomial(-9.64399179425052238628e-1, -9.92877231001918586564e1, -1.61468768441708447952e3)
        / z.polynomial(1.0, 1.12811678491632931402e2, 2.23548839060100448583e3, 4.84406305325125486048e3)
    )
    large = 1.0 - 2.0 / (_exp(2.0 * size) + 1.0)
    return small.where(size.below(0.625), large).intrinsic("copysign", x)


def _sinh(x: Numbers) -> Numbers:
    size = x.intrinsic("fabs")
    z, power = size * size, _exp(size)
    small = size + size * z * (
        z.polynomial(
            -7.89474443963537015605e-1, -1.63725857525983828727e2, -1.15614435765005216044e4, -3.51754964808151394800e5
        )
        / z.polynomial(1.0, -2.77711081420602794433e2, 3.61578279834431989373e4, -2.11052978884890840399e6)
    )
    return small.where(size.below(1.0), 0.5 * power - 0.5 / power).intrinsic("copysign", x)


def _cosh(x: Numbers) -> Numbers:
    power = _exp(x)
    return 0.5 * power + 0.5 / power


class LaneFunction(NamedTuple):
    """A function of the numbers of all lanes.

    Args:
        write: its instructions.
        low: the smallest number for which they hold,
        high: and the largest.
    """

    write: Callable[[Numbers], Numbers]
    low: float
    high: float


_turns, _powers = 1e6, 708.0
LANE_FUNCTIONS: dict[Callable[..., float], LaneFunction] = {
    math.sin: LaneFunction(_sin, -_turns, _turns),
    math.cos: LaneFunction(_cos, -_turns, _turns),
    math.tan: LaneFunction(_tan, -_turns, _turns),
    math.exp: LaneFunction(_exp, -_powers, _powers),
    math.sinh: LaneFunction(_sinh, -_powers, _powers),
    math.cosh: LaneFunction(_cosh, -_powers, _powers),
    math.log: LaneFunction(_log, 2.0**-1022, 2.0**1023),
    math.tanh: LaneFunction(_tanh, -math.inf, math.inf),
}
"""What is written here, by the function of one number that stands in for it elsewhere."""
