"""What a shaft bears over the speed range: vibratory torque and stress in every order and together, and its verdict."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from shaftwork.core.errors import ParameterError
from shaftwork.results.observer import RPM, Array, Complex
from shaftwork.torsional.barred_ranges import BarredRange
from shaftwork.torsional.order_sums import half_range
from shaftwork.torsional.shaft_sections import MPA, Section


@dataclass(frozen=True, eq=False)
class ShaftVibration:
    """The vibration of one shaft at all speeds, at the place along it that bears most at each.

    Args:
        shaft: name of the spring or shaft.
        speeds: (n,) rad/s of the reference shaft.
        orders: (k,) per turn of it.
        torques: (n, k) complex amplitudes, N m.
        places: (n,) where along the shaft, m; None for a spring.
        section: with its diameter; None where none is given.
        limits: (n,) tau_c and tau_t in Pa; None where the section has no design.
        barred: the ranges in which tau_c is exceeded; empty where it never is, or nothing is known of it.
        permissible: vibratory torque that the maker of the part permits to last, N m; None where none is given.
        exceeded: from and to which speed in rad/s the torque is above it; a pair for each such interval.
    """

    shaft: str
    speeds: Array
    orders: tuple[float, ...]
    torques: Complex
    places: Array | None
    section: Section | None
    limits: tuple[Array, Array] | None
    barred: tuple[BarredRange, ...] = ()
    permissible: float | None = None
    exceeded: tuple[tuple[float, float], ...] = ()

    @cached_property
    def amplitude(self) -> Array:
        """(n,) vibratory torque in N m: half of peak to peak over a cycle, all orders together."""
        return half_range(self.torques, self.orders)

    @property
    def by_order(self) -> Array:
        """(n, k) amplitude of each order, N m."""
        return np.abs(self.torques)

    @property
    def arithmetic(self) -> Array:
        """(n,) the sum of the amplitudes of all orders in N m, which no phases can exceed."""
        return np.asarray(self.by_order.sum(axis=1))

    @property
    def stress(self) -> Array:
        """(n,) nominal vibratory stress, Pa.

        Raises:
            ParameterError: no section of the shaft is given.
        """
        return self._section.stress(self.amplitude)

    @property
    def notch_stress(self) -> Array:
        """(n,) the same times the stress concentration of the section, Pa.

        Raises:
            ParameterError: no section of the shaft is given.
        """
        return self._section.scf * self.stress

    @property
    def peak(self) -> int:
        """The place of the largest vibratory torque among the speeds."""
        return int(self.amplitude.argmax())

    @property
    def largest_order(self) -> float:
        """The order with the largest amplitude at the peak."""
        return self.orders[int(self.by_order[self.peak].argmax())]

    @property
    def governing(self) -> int:
        """The place of the speed that decides: of the largest stress over tau_c, else of the largest torque."""
        if self.limits is None:
            return self.peak
        share = self.stress / self.limits[0]
        return int(share.argmax()) if share.any() else self.peak

    @property
    def permitted(self) -> bool | None:
        """Whether it may run: every range above tau_c may be barred, and the torque stays below the permissible one.

        None where neither a design of the section nor a permissible torque is given.
        """
        judged = [] if self.limits is None else [all(one.allowed for one in self.barred)]
        judged += [] if self.permissible is None else [not self.exceeded]
        return all(judged) if judged else None

    @property
    def verdict(self) -> str:
        """The same in words."""
        verdicts = []
        if not np.isfinite(self.amplitude).all():
            verdicts.append("NO BOUND where nothing damps")
        if self.limits is not None:
            allowed = "permitted with a barred range" if all(one.allowed for one in self.barred) else "NOT permitted"
            verdicts.append(allowed if self.barred else "below tau_c at all speeds")
        if self.permissible is not None:
            verdicts.append(f"{'ABOVE' if self.exceeded else 'below'} the permissible torque")
        return ", ".join(verdicts) or "no limit given"

    @property
    def notes(self) -> tuple[str, ...]:
        """The ranges in which it exceeds a limit, a sentence each."""
        above = [f"{start * RPM:.5g} to {end * RPM:.5g} 1/min" for start, end in self.exceeded]
        passed = f"{self.shaft}: above its permissible torque from {' and '.join(above)}"
        return (*(f"{self.shaft}: {one}" for one in self.barred), *([passed] if above else []))

    @property
    def _section(self) -> Section:
        if self.section is None:
            raise ParameterError(
                f"No section of '{self.shaft}' is given. Give sections=[Section('{self.shaft}', diameter=...)]."
            )
        return self.section

    @property
    def row(self) -> tuple[str, ...]:
        """The shaft in a line of a table, at the governing speed, under `HEADS`; "-" where nothing is given."""
        k = self.governing
        order = self.orders[int(self.by_order[k].argmax())]
        permissible = "-" if self.permissible is None else f"{self.permissible / 1e3:.5g}"
        stresses = ["-"] * 4
        if self.section is not None:
            at_notch = f"{self.notch_stress[k] / MPA:.4g}" if self.section.scf > 1 else "-"
            stresses[:2] = f"{self.stress[k] / MPA:.4g}", at_notch
        if self.limits is not None and np.isfinite(self.limits[0][k]):
            stresses[2:] = (f"{limit[k] / MPA:.4g}" for limit in self.limits)
        torque, speed = f"{self.amplitude[k] / 1e3:.5g}", f"{self.speeds[k] * RPM:.5g}"
        return (self.shaft, torque, speed, f"{order:g}", permissible, *stresses, self.verdict)


HEADS = (
    "shaft",
    "torque kN m",
    "at 1/min",
    "order",
    "permissible kN m",
    "stress N/mm^2",
    "at notch N/mm^2",
    "tau_c N/mm^2",
    "tau_t N/mm^2",
    "verdict",
)
"""Heads of `ShaftVibration.row`: half of peak to peak of torque and stress."""


def worst_along(torques: Complex, orders: tuple[float, ...], places: tuple[float, ...]) -> tuple[Complex, Array | None]:
    """The torques (n, k) at the place that bears most at each speed, and that place (n,) in m.

    Args:
        torques: (n, k), or along a shaft (n, k, places).
        orders: (k,).
        places: along the shaft in m; none for a spring.
    """
    if torques.ndim == 2:
        return torques, None
    speeds, count, along = torques.shape
    amplitude = half_range(np.moveaxis(torques, 2, 1).reshape(speeds * along, count), orders).reshape(speeds, along)
    worst = amplitude.argmax(axis=1)
    return torques[np.arange(speeds), :, worst], np.asarray(places)[worst]
