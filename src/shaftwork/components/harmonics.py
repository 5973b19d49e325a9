"""Harmonics: amplitudes and phases of a torque by order, that is by swings per turn, as records and as expressions."""

from __future__ import annotations

import contextlib
import math
import reprlib
from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from sympy import Abs, Atom, Expr, Float, Integer, Rational, cos, sin

from shaftwork.components.branches import Abbreviated
from shaftwork.components.tables import Table
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import call_in, in_si, numbers_in_si, whole

MOST_ORDERS = 200
"""Orders of one torque: no engine has a table of half as many, and equations and code carry each."""
SAMPLES = 720
"""Angles per turn at which the mechanism of a cylinder is sampled: its series falls as (stroke / 2 rod)^order, to
rounding before order 60 for any rod longer than the stroke."""


@dataclass(frozen=True)
class Harmonics:
    """The swing of a torque over the turns of its shaft: an amplitude and a phase for each order.

    Law: sum_k T_k cos(k phi + psi_k), times (|omega| / omega_n)^exponent where an exponent is given.

    Args:
        orders: (k,) swings per turn, above 0; a four-stroke cylinder has 0.5, 1, 1.5, ...
        amplitudes: (k,) T in N m; with `speeds` (n, k).
        phases: psi in rad, of the same shape; 0 by default.
        speeds: (n,) ascending speeds in rad/s at which the rows hold. Between them T cos(psi) and T sin(psi) are
            linear, beyond them constant.
        exponent: 2 for the torque of a propeller or of reciprocating masses; 0 by default.
        omega_n: the speed in rad/s at which the amplitudes hold, where there is an exponent.

    Raises:
        ParameterError: the lengths differ, or a value is out of its bounds.
    """

    orders: tuple[float, ...]
    amplitudes: tuple[Any, ...]
    phases: tuple[Any, ...] = ()
    speeds: tuple[float, ...] = ()
    exponent: float = 0.0
    omega_n: float | None = None

    def __post_init__(self) -> None:
        orders = _numbers("orders", self.orders, "1", 1)
        if (
            not orders.size
            or orders.size > MOST_ORDERS
            or (orders <= 0).any()
            or len(set(orders.tolist())) < len(orders)
        ):
            raise ParameterError(
                f"Harmonics: orders = {reprlib.repr(self.orders)} must be up to {MOST_ORDERS} different numbers above "
                "0, such as (0.5, 1, 1.5)."
            )
        speeds = _numbers("speeds", self.speeds, "rad/s", 1)
        if len(speeds) == 1 or (speeds < 0).any() or (np.diff(speeds) <= 0).any():
            raise ParameterError(
                f"Harmonics: speeds = {reprlib.repr(self.speeds)} must be two or more, ascending from 0 or above; "
                "leave them out where the amplitudes are the same at all speeds."
            )
        shape = (len(speeds), len(orders)) if len(speeds) else (len(orders),)
        tables = {
            "amplitudes": _numbers("amplitudes", self.amplitudes, "N*m", len(shape)),
            "phases": _numbers("phases", self.phases, "rad", len(shape)) if len(self.phases) else np.zeros(shape),
        }
        for name, values in tables.items():
            if values.shape != shape:
                words = f"{len(speeds)} speeds with a row of {len(orders)} each" if len(speeds) else f"{len(orders)}"
                raise ParameterError(
                    f"Harmonics: {name} has the shape {values.shape}, and there are {len(orders)} orders"
                    f"{f' at {len(speeds)} speeds' if len(speeds) else ''}. Give {words}."
                )
        exponent = in_si("Harmonics: exponent", self.exponent, at_least=0, at_most=6)
        if (self.omega_n is None) != (exponent == 0):
            raise ParameterError("Harmonics: exponent and omega_n, the speed at which amplitudes hold, go together.")
        omega_n = None if self.omega_n is None else in_si("Harmonics: omega_n", self.omega_n, "rad/s", above=0)
        checked = {
            "orders": tuple(orders.tolist()),
            **{name: _as_tuples(values) for name, values in tables.items()},
            "speeds": tuple(speeds.tolist()),
            "exponent": exponent,
            "omega_n": omega_n,
        }
        for name, value in checked.items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        """The text that `read` makes the same of: without phases, speeds and growth that it has not."""
        required = ("orders", "amplitudes")
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        said = (f"{name}={value!r}" for name, value in values.items() if name in required or np.any(value))
        return f"Harmonics({', '.join(said)})"

    @classmethod
    def read(cls, text: Any) -> Harmonics:
        """Harmonics from their text "Harmonics(orders=(1.0,), amplitudes=(50.0,))".

        Raises:
            ParameterError: they are none.
        """
        match call_in(text):
            case (cls.__name__, values, options):
                with contextlib.suppress(TypeError):
                    return cls(*values, **options)
        raise ParameterError(
            f"{reprlib.repr(text)} are no harmonics. Write Harmonics(orders=(0.5, 1), amplitudes=(40.0, 90.0))."
        )

    @classmethod
    def gas_force(cls, orders: Any, cosines: Any, sines: Any, *, bore: float, stroke: float, speeds: Any = ()) -> Self:
        """Harmonics of a cylinder from the coefficients of its tangential pressure.

        Law: torque = pi bore^2 / 4 stroke / 2 sum_k (a_k cos(k phi) + b_k sin(k phi)), phi from top dead centre.

        Args:
            orders: (k,) per turn.
            cosines: (k,) a in Pa, the tangential force over the area of the piston; with `speeds` (n, k).
            sines: b in Pa, of the same shape.
            bore: m.
            stroke: m, twice the radius of the crank.
            speeds: (n,) rad/s at which the rows hold, as of `Harmonics`: coefficients of a load that goes with it.

        Raises:
            ParameterError: the lengths differ, or a value is out of its bounds.
        """
        dimensions = 2 if len(speeds) else 1
        a, b = _numbers("cosines", cosines, "Pa", dimensions), _numbers("sines", sines, "Pa", dimensions)
        if a.shape != b.shape:
            raise ParameterError(
                f"Harmonics: cosines have the shape {a.shape} and sines {b.shape}. Give one of each for every order"
                f"{' at every speed' if dimensions == 2 else ''}."
            )
        lever = math.pi / 4 * in_si("bore", bore, "m", above=0) ** 2 * in_si("stroke", stroke, "m", above=0) / 2
        return cls(orders, _as_tuples(lever * np.hypot(a, b)), _as_tuples(np.arctan2(-b, a)), speeds)

    @classmethod
    def reciprocating(cls, mass: float, *, stroke: float, rod: float) -> Self:
        """Harmonics of the masses that move to and fro in a cylinder: piston, and a part of the connecting rod.

        Law: torque = -mass x' x'' omega^2 with x(phi) = r cos(phi) + (rod^2 - r^2 sin(phi)^2)^(1/2), r = stroke / 2,
        and primes by phi, from top dead centre; it grows with the square of the speed. It is the torque at a steady
        speed. Left out is -mass x'^2 d(omega)/dt, that of an inertia that changes with the angle: its mean over a turn,
        `HarmonicTorque.reciprocating_inertia`, belongs to the inertia of the throw; its swing about this mean couples
        the orders, and matters where pistons are heavy beside the throw, as in slow two-stroke engines ("secondary
        resonance"). A simulation has all of it with `Inertia(J=mass * x'(phi)^2)` instead of these harmonics.

        Args:
            mass: kg.
            stroke: m.
            rod: length of the connecting rod, m.

        Raises:
            ParameterError: a value is out of its bounds.
        """
        m, (slope, bend) = in_si("mass", mass, "kg", above=0), crank_slopes(stroke, rod)
        parts = np.fft.rfft(-m * slope * bend) * 2 / SAMPLES
        negligible = 1e-6  # of the largest: no mass is known so well
        numbers = np.flatnonzero(np.abs(parts) > negligible * np.abs(parts).max())
        # what moves to and fro is the same on both sides of top dead centre, so there are sines alone
        amplitudes, phases = np.abs(parts[numbers].imag), np.copysign(np.pi / 2, parts[numbers].imag)
        return cls(
            tuple(numbers.tolist()), tuple(amplitudes.tolist()), tuple(phases.tolist()), exponent=2.0, omega_n=1.0
        )

    @classmethod
    def propeller(cls, blades: int, torque: float, omega_n: float, shares: Sequence[float] = (0.05, 0.01)) -> Self:
        """Harmonics of a propeller: multiples of its number of blades, as shares of a torque that goes as omega^2.

        Args:
            blades: number.
            torque: mean torque at the nominal speed, N m.
            omega_n: nominal speed, rad/s.
            shares: amplitudes of the orders blades, 2 blades, ..., over the mean torque; the default is chosen.

        Raises:
            ParameterError: a value is out of its bounds.
        """
        count = whole(blades, 2, 20)
        if count is None:
            raise ParameterError(f"Harmonics: blades = {blades!r} must be a whole number from 2 to 20.")
        size = in_si("torque", torque, "N*m", above=0)
        parts = _numbers("shares", shares, "1", 1)
        orders = tuple(float(count * (k + 1)) for k in range(len(parts)))
        return cls(orders, tuple((size * parts).tolist()), exponent=2.0, omega_n=omega_n)

    def at(self, omega: Any) -> NDArray[Any]:
        """Complex amplitudes T exp(i psi) in N m at speeds of the shaft in rad/s: (k,) at one, (n, k) at several."""
        speed = np.abs(np.asarray(omega, dtype=float))
        parts = np.asarray(self.amplitudes) * np.exp(1j * np.asarray(self.phases))
        if self.speeds:
            columns = [
                np.interp(speed, self.speeds, column.real) + 1j * np.interp(speed, self.speeds, column.imag)
                for column in parts.T
            ]
            parts = np.stack(columns, axis=-1)
        growth = np.ones_like(speed) if self.omega_n is None else (speed / self.omega_n) ** self.exponent
        return np.asarray(growth[..., None] * parts)

    def torque(self, angle: Expr, speed: Expr) -> Expr:
        """The sum over the orders as an expression of angle in rad and speed in rad/s."""
        parts = np.asarray(self.amplitudes) * np.exp(1j * np.asarray(self.phases))
        total: Expr = Integer(0)
        for number, order in enumerate(self.orders):
            turn = _order(order) * angle
            if self.speeds:
                column = parts[:, number]
                even, odd = (Table(self.speeds, values.tolist())(Abs(speed)) for values in (column.real, column.imag))
                total += even * cos(turn) - odd * sin(turn)
            elif self.amplitudes[number]:
                total += Float(self.amplitudes[number]) * cos(turn + _phase(self.phases[number]))
        if self.omega_n is None:
            return total
        return (
            total * (Abs(speed) if self.exponent % 2 else speed) ** _order(self.exponent) / self.omega_n**self.exponent
        )

    def summed(self, angle: Expr, speed: Expr) -> Expr:
        """The same as one term, which equations print as a sum over k beside a table; 0 where nothing swings."""
        if not np.any(self.amplitudes):
            return Integer(0)
        varies = self.omega_n is not None or self.speeds
        return HarmonicSum(angle, speed if varies else Integer(0), HarmonicTable(self))


def crank_slopes(stroke: float, rod: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """First and second derivative of the way of a piston by the angle, m, at `SAMPLES` angles from top dead centre.

    Args:
        stroke: m.
        rod: length of the connecting rod, m.

    Raises:
        ParameterError: a value is out of its bounds.
    """
    r = in_si("stroke", stroke, "m", above=0) / 2
    share = r / in_si("rod", rod, "m", above=2 * r)
    phi = 2 * math.pi * np.arange(SAMPLES) / SAMPLES
    lean = np.sqrt(1 - (share * np.sin(phi)) ** 2)
    slope = -np.sin(phi) - share * np.sin(phi) * np.cos(phi) / lean
    bend = -np.cos(phi) - share * np.cos(2 * phi) / lean - share**3 * np.sin(2 * phi) ** 2 / (4 * lean**3)
    return r * slope, r * bend


def _numbers(name: str, values: Any, unit: str, dimensions: int) -> NDArray[Any]:
    """Finite numbers that a user gave, in SI.

    Raises:
        ParameterError: they are none, or nested otherwise.
    """
    try:
        numbers = np.asarray(numbers_in_si(f"Harmonics: {name}", values, unit), dtype=float)
    except (TypeError, ValueError):
        numbers = np.array(np.nan)
    if not np.isfinite(numbers).all() or numbers.ndim != dimensions:
        shape = "a list of finite numbers" if dimensions == 1 else "a list of finite numbers for each speed"
        raise ParameterError(f"Harmonics: {name} = {reprlib.repr(values)} must be {shape}, in {unit}.")
    return numbers


def _as_tuples(values: NDArray[Any]) -> tuple[Any, ...]:
    return tuple(tuple(row) if isinstance(row, list) else row for row in values.tolist())


def _order(value: float) -> Expr:
    """A half or whole order as a fraction, so that equations read well."""
    short = Rational(value).limit_denominator(100)
    return short if float(short) == value else Float(value)


def _phase(value: float) -> Expr:
    return Float(value) if value else Integer(0)


class HarmonicTable(Atom):  # type: ignore[misc]
    """The orders of a torque inside an expression.

    Args:
        harmonics: the orders with their amplitudes and phases.
        mark: index of the letters T_k and psi_k, which tells them from those of others; print sets it.
    """

    is_commutative = True

    def __new__(cls, harmonics: Harmonics, mark: str = "") -> Self:
        table: Self = super().__new__(cls)
        table.harmonics, table.mark = harmonics, mark
        return table

    harmonics: Harmonics
    mark: str

    def __getnewargs__(self) -> tuple[Harmonics, str]:
        return self.harmonics, self.mark

    def _hashable_content(self) -> tuple[str, str]:
        return repr(self.harmonics), self.mark  # texts, by which sympy sorts the terms of a sum

    def _sympystr(self, _printer: Any) -> str:
        return repr(self.harmonics)

    @property
    def letters(self) -> tuple[str, str]:
        """T_k and psi_k in LaTeX."""
        index = f"{{{self.mark}, k}}" if self.mark else "{k}"
        return f"T_{index}", rf"\psi_{index}"


class HarmonicSum(Abbreviated):
    """The sum over the orders of a torque, printed as such: (angle in rad, speed in rad/s, `HarmonicTable`).

    The speed is 0 where the amplitudes are the same at all.
    """

    nargs = 3

    @property
    def table(self) -> HarmonicTable:
        """The orders."""
        return self.args[2]  # type: ignore[no-any-return]

    @classmethod
    def eval(cls, angle: Expr, speed: Expr, table: HarmonicTable) -> Expr | None:
        """Its value where angle and speed are numbers; None elsewhere."""
        return table.harmonics.torque(angle, speed) if angle.is_number and speed.is_number else None

    def doit(self, **_hints: Any) -> Expr:
        """All its terms."""
        return self.table.harmonics.torque(self.args[0], self.args[1])

    def _eval_derivative(self, symbol: Any) -> Expr:
        return self.doit().diff(symbol)

    def _eval_is_extended_real(self) -> bool:
        return True

    def _latex(self, printer: Any, exp: str | None = None) -> str:
        harmonics, (amplitude, phase) = self.table.harmonics, self.table.letters
        angle, speed = (str(printer._print(one)) for one in self.args[:2])  # noqa: SLF001 (as in tables.py)
        angle = rf"\left({angle}\right)" if self.args[0].is_Add else angle
        if harmonics.speeds:
            amplitude, phase = (rf"{letter}(|{speed}|)" for letter in (amplitude, phase))
        text = rf"\sum_{{k}} {amplitude} \, \cos\left(k \, {angle} + {phase}\right)"
        if harmonics.omega_n is not None:
            base = speed if harmonics.exponent % 2 == 0 else rf"\left|{speed}\right|"
            if harmonics.omega_n != 1:
                base = rf"\left(\frac{{{base}}}{{{printer._print(Float(harmonics.omega_n))}}}\right)"  # noqa: SLF001
            text = rf"{base}^{{{harmonics.exponent:g}}} \, {text}"
        return text if exp is None else rf"\left({text}\right)^{{{exp}}}"
