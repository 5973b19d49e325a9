"""One number of a motion: the largest torque, its effective value, a speed at the end, the damage of a shaft."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from shaftwork.core.errors import ParameterError
from shaftwork.results.course import LobattoPanels, integrate
from shaftwork.results.fatigue import SNLine
from shaftwork.results.observer import Array, Read
from shaftwork.results.solution import Solution

KINDS: Mapping[str, str] = {
    "max": "the largest value",
    "min": "the smallest value",
    "peak": "the largest size",
    "mean": "the mean over time",
    "rms": "the effective value, root of the mean square over time",
    "end": "the value at the end",
    "damage": "the share of the life that the motion takes, with `sn`",
}
"""What a measure may say of a quantity."""
POWERS: Mapping[str, int] = {"mean": 1, "rms": 2}
"""Of the quantity, in the integral that makes a measure."""
EXTREMES: Mapping[str, tuple[float, ...]] = {"max": (1.0,), "min": (-1.0,), "peak": (1.0, -1.0)}
"""Measures that are the largest value of a quantity, times these signs."""


@dataclass(frozen=True)
class Measure:
    """One number of a motion, "max shaft.tau".

    Args:
        kind: one of `KINDS`.
        quantity: "part.quantity" or "node.quantity".
    """

    kind: str
    quantity: str

    def __str__(self) -> str:
        return f"{self.kind} {self.quantity}"

    @classmethod
    def read(cls, text: str) -> Measure:
        """A measure from its text.

        Raises:
            ParameterError: it is none.
        """
        kind, _, quantity = text.strip().partition(" ")
        if kind not in KINDS or not quantity.strip():
            raise ParameterError(
                f"'{text}' is no measure. Write what and of which quantity, such as 'max shaft.tau'; the first word "
                f"is one of: {', '.join(KINDS)}."
            )
        return cls(kind, quantity.strip())

    def of(self, solution: Solution, sn: Mapping[str, SNLine] | None = None) -> float:
        """Its value for a motion, from the dense output and not from the output times.

        Along a part it is that of the worst place.

        Args:
            solution: the motion.
            sn: S-N lines by quantity, for damage.

        Raises:
            SignalError: there is no such quantity.
        """
        if self.kind == "damage":
            return solution.damage(self.quantity, sn=(sn or {})[self.quantity]).damage
        if self.kind == "end":
            values = solution.at(solution.steps[-1:])[self.quantity].ravel()
            return float(values[np.abs(values).argmax()])
        if self.kind in EXTREMES:
            least, most = solution.extremes[self.quantity]
            return float({"max": most, "min": least, "peak": max(most, -least)}[self.kind])
        power, reader = POWERS[self.kind], solution.reader
        places = reader.numbers(self.quantity)
        return max((_mean(reader.quantity(self.quantity, place), reader.steps, power) for place in places), key=abs)


def _mean(read: Read, steps: Array, power: int) -> float:
    def integrand(panels: LobattoPanels) -> Array:
        times = panels.times
        return (read(times.ravel()) ** power).reshape(1, *times.shape)

    mean = float(integrate(integrand, steps).totals[0] / (steps[-1] - steps[0]))
    return float(np.sqrt(mean)) if power == 2 else mean
