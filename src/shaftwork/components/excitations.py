"""Excitations: torques that swing so many times per turn of their shaft, as those of engines and propellers."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Any, ClassVar

import numpy as np

from shaftwork.components.base import Component, Port, Role, component
from shaftwork.components.branches import ACROSS, INTEGRAL, Branch, ThroughLaw
from shaftwork.components.harmonics import Harmonics, crank_slopes
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import in_si, parameter


@component
class HarmonicTorque(Component):
    """A torque that swings with the angle of its shaft, given to node a and taken from node b where it has one.

    Law: tau = mean + scale sum_k T_k cos(k (phi - alpha) + psi_k), positive raises the speed of a, with phi the angle
    of a relative to b and T, psi the harmonics. A cylinder of an engine is one, with its firing angle alpha; so is a
    propeller. A simulation reads the angle as it swings. Linear analyses take it at one angle, and `modes` and
    `campbell` warn of that. `torsional_calculation` takes the mean for the operating point, and the swing at the angle
    of a steadily turning shaft as the excitation. Analogue: a current source.
    """

    harmonics: Harmonics = parameter("1", "orders with amplitudes and phases", record=Harmonics)
    mean: Any = parameter("N*m", "mean torque", law=True, default=0.0, latex=r"\bar\tau")
    firing_angle: float = parameter("rad", "angle at which its cycle begins", default=0.0, latex=r"\alpha")
    scale: float = parameter("1", "share of the swing", default=1.0, latex=r"\kappa")

    role: ClassVar[Role] = "source"
    swing: ClassVar[str] = "scale"
    ports: ClassVar = (Port("a"), Port("b", optional=True))

    def __post_init__(self) -> None:
        super().__post_init__()
        if (objection := self.declared["harmonics"].magnitude(self.harmonics)[1]) is not None:
            raise ParameterError(f"HarmonicTorque '{self.name}': harmonics {objection}.")

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughLaw(-p.mean - p.scale * p.harmonics.summed(INTEGRAL - p.firing_angle, ACROSS))

    @staticmethod
    def reciprocating_inertia(mass: float, *, stroke: float, rod: float) -> float:
        """The mean over a turn of the inertia of masses that move to and fro, kg m^2; it belongs to that of the throw.

        Law: mass times the mean of x'^2, about mass (stroke / 2)^2 / 2; arguments as of `Harmonics.reciprocating`.

        Raises:
            ParameterError: a value is out of its bounds.
        """
        slope, _ = crank_slopes(stroke, rod)
        return in_si("mass", mass, "kg", above=0) * float(np.mean(slope**2))

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
