"""Excitations: torques that swing so many times per turn of their shaft, as those of engines and propellers."""

from __future__ import annotations

import contextlib
import math
import reprlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from sympy import Abs, Expr, Float, Integer, Rational, cos, sin

from shaftwork.components.base import Component, Port, Role, component
from shaftwork.components.branches import ACROSS, INTEGRAL, Branch, ThroughLaw
from shaftwork.components.tables import Table
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import call_in, in_si, numbers_in_si, parameter, whole

MOST_ORDERS = 200
"""Orders of one torque; more is a typing error."""
SAMPLES = 720
"""Angles per turn at which the mechanism of a cylinder is sampled: its series falls as (stroke / 2 rod)^order."""
NEGLIGIBLE = 1e-6
"""Orders of the reciprocating masses below this fraction of the largest are left out."""


@dataclass(frozen=True)
class Harmonics:
    """The swing of a torque over the turns of its shaft: an amplitude and a phase for each order.

    Law: sum_k A_k cos(k phi + psi_k), times (|omega| / omega_n)^exponent where an exponent is given.

    Args:
        orders: (k,) swings per turn, above 0; a four-stroke cylinder has 0.5, 1, 1.5, ...
        amplitudes: (k,) A in N m; with `speeds` (n, k).
        phases: psi in rad, of the same shape; 0 by default.
        speeds: (n,) ascending speeds in rad/s at which the rows hold. Between them A cos(psi) and A sin(psi) are
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
        fields = {
            "orders": tuple(orders.tolist()),
            **{name: _as_tuples(values) for name, values in tables.items()},
            "speeds": tuple(speeds.tolist()),
            "exponent": exponent,
            "omega_n": omega_n,
        }
        for name, value in fields.items():
            object.__setattr__(self, name, value)

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
    def gas_force(cls, orders: Any, cosines: Any, sines: Any, *, bore: float, stroke: float) -> Self:
        """Harmonics of a cylinder from the coefficients of its tangential pressure.

        Law: torque = pi bore^2 / 4 stroke / 2 sum_k (a_k cos(k phi) + b_k sin(k phi)), phi from top dead centre.

        Args:
            orders: (k,) per turn.
            cosines: (k,) a in Pa, the tangential force over the area of the piston.
            sines: (k,) b in Pa.
            bore: m.
            stroke: m, twice the radius of the crank.

        Raises:
            ParameterError: the lengths differ, or a value is out of its bounds.
        """
        a, b = _numbers("cosines", cosines, "Pa", 1), _numbers("sines", sines, "Pa", 1)
        if len(a) != len(b):
            raise ParameterError(f"Harmonics: {len(a)} cosines and {len(b)} sines. Give one of each for every order.")
        lever = math.pi / 4 * in_si("bore", bore, "m", above=0) ** 2 * in_si("stroke", stroke, "m", above=0) / 2
        return cls(orders, tuple((lever * np.hypot(a, b)).tolist()), tuple(np.arctan2(-b, a).tolist()))

    @classmethod
    def reciprocating(cls, mass: float, *, stroke: float, rod: float) -> Self:
        """Harmonics of the masses that move to and fro in a cylinder: piston, and a part of the connecting rod.

        Law: torque = -mass x' x'' omega^2 with x(phi) = r cos(phi) + (rod^2 - r^2 sin(phi)^2)^(1/2), r = stroke / 2,
        and primes by phi, from top dead centre; it grows with the square of the speed.

        Args:
            mass: kg.
            stroke: m.
            rod: length of the connecting rod, m.

        Raises:
            ParameterError: a value is out of its bounds.
        """
        m, r = in_si("mass", mass, "kg", above=0), in_si("stroke", stroke, "m", above=0) / 2
        share = r / in_si("rod", rod, "m", above=2 * r)
        phi = 2 * math.pi * np.arange(SAMPLES) / SAMPLES
        lean = np.sqrt(1 - (share * np.sin(phi)) ** 2)
        slope = -np.sin(phi) - share * np.sin(phi) * np.cos(phi) / lean
        bend = -np.cos(phi) - share * np.cos(2 * phi) / lean - share**3 * np.sin(2 * phi) ** 2 / (4 * lean**3)
        parts = np.fft.rfft(-m * r**2 * slope * bend) * 2 / SAMPLES
        kept = np.flatnonzero(np.abs(parts) > NEGLIGIBLE * np.abs(parts).max())
        amplitudes, phases = np.abs(parts[kept]), np.angle(parts[kept])
        return cls(tuple(kept.tolist()), tuple(amplitudes.tolist()), tuple(phases.tolist()), exponent=2.0, omega_n=1.0)

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
        """Complex amplitudes A exp(i psi) in N m at speeds of the shaft in rad/s: (k,) at one, (n, k) at several."""
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


@component
class HarmonicTorque(Component):
    """A torque that swings with the angle of its shaft, given to node a and taken from node b where it has one.

    Law: tau = mean + scale sum_k A_k cos(k (phi - phi_f) + psi_k), positive raises the speed of a, with phi the angle
    of a relative to b and A, psi the harmonics. A cylinder of an engine is one, with its firing angle phi_f; so is a
    propeller. A simulation reads the angle as it swings. Linear analyses have it at one angle, which `modes` and
    `campbell` warn of; `torsional_calculation` takes the mean for the train, and the swing, at the angle of a shaft
    that turns steadily, as its excitation. Analogue: a current source.
    """

    harmonics: Harmonics = parameter("1", "orders with amplitudes and phases", record=Harmonics)
    mean: Any = parameter("N*m", "mean torque", law=True, default=0.0, latex=r"\bar\tau")
    firing_angle: float = parameter("rad", "angle at which its cycle begins", default=0.0, latex=r"\varphi_f")
    scale: float = parameter("1", "share of the swing; 0 where a cylinder misfires", default=1.0, latex="f")

    role: ClassVar[Role] = "source"
    swing: ClassVar[str] = "scale"
    ports: ClassVar = (Port("a"), Port("b", optional=True))

    def __post_init__(self) -> None:
        super().__post_init__()
        if (objection := self.declared["harmonics"].magnitude(self.harmonics)[1]) is not None:
            raise ParameterError(f"HarmonicTorque '{self.name}': harmonics {objection}.")

    def branches(self, p: Any) -> Iterator[Branch]:
        swing = p.harmonics.torque(INTEGRAL - p.firing_angle, ACROSS) if p.scale != 0 else Integer(0)
        yield ThroughLaw(-p.mean - p.scale * swing)

    @staticmethod
    def firing_angles(order: Sequence[int], turns: int = 2) -> tuple[float, ...]:
        """The firing angles of cylinders 1, 2, ... in rad, evenly spaced over a cycle.

        Args:
            order: the cylinders in the order in which they fire, such as (1, 3, 4, 2).
            turns: of a cycle, 2 for four-stroke, 1 for two-stroke.

        Raises:
            ParameterError: it is no order of cylinders, or no cycle.
        """
        numbers = list(order) if isinstance(order, Sequence) and not isinstance(order, str) else []
        if not numbers or sorted(numbers) != list(range(1, len(numbers) + 1)):
            raise ParameterError(
                f"order = {order!r} must name each of the cylinders 1, 2, ... once, such as (1, 3, 4, 2)."
            )
        if turns not in (1, 2):
            raise ParameterError(f"turns = {turns!r} of a cycle: 2 for four-stroke, 1 for two-stroke.")
        step = 2 * math.pi * turns / len(numbers)
        return tuple(step * numbers.index(cylinder) for cylinder in range(1, len(numbers) + 1))
