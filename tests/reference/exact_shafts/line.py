"""Torsional lines: uniform sections of shaft in a row, with discs where they meet."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import Parameter

Array = npt.NDArray[np.float64]
End = Literal["free", "clamped"]
Side = Literal["left", "right"]

SECTION = (
    Parameter("length", "m", "length", above=0.0),
    Parameter("inertia", "kg m", "inertia per metre", above=0.0),
    Parameter("stiffness", "N m2", "torsional stiffness G I_p", above=0.0),
    Parameter("damping", "N m2 s", "internal damping", at_least=0.0),
    Parameter("friction", "N s", "bearing friction per metre", at_least=0.0),
)
GEOMETRY = (
    Parameter("diameter", "m", "outer diameter", above=0.0),
    Parameter("inner_diameter", "m", "inner diameter", at_least=0.0),
    Parameter("density", "kg/m3", "density", above=0.0),
    Parameter("shear_modulus", "Pa", "shear modulus", above=0.0),
)
DISC = Parameter("disc", "kg m2", "inertia at a junction", at_least=0.0)
DAMPER = Parameter("damper", "N m s", "viscous friction at a junction", at_least=0.0)


@dataclass(frozen=True)
class Section:
    """A uniform piece of shaft.

    Law: with speed omega and torque tau, the torque that the left part gives to the right part,
    -d tau/dx = J' d omega/dt + friction omega and tau = -G I_p d phi/dx - D' d omega/dx.
    Analogue: a transmission line with J' as capacitance and 1/(G I_p) as inductance per metre.

    Args:
        length: in m.
        inertia: J', inertia per metre in kg m.
        stiffness: G I_p in N m2.
        damping: D', internal damping in N m2 s: torque for a twist per metre that grows by 1 rad/(m s).
        friction: bearing friction per metre in N s: torque per metre for a speed of 1 rad/s.

    Raises:
        ParameterError: a value is not finite or out of its bounds.

    Source: Popenda 2019, (8)-(10); the friction is added to (8).
    """

    length: float
    inertia: float
    stiffness: float
    damping: float = 0.0
    friction: float = 0.0

    def __post_init__(self) -> None:
        for parameter in SECTION:
            _check("section", parameter, getattr(self, parameter.name))

    @classmethod
    def of_geometry(
        cls,
        length: float,
        diameter: float,
        inner_diameter: float = 0.0,
        *,
        density: float = 7900.0,
        shear_modulus: float = 77.5e9,
        damping: float = 0.0,
        friction: float = 0.0,
    ) -> Section:
        """A solid or hollow round shaft: I_p = pi (d^4 - d_i^4) / 32, J' = density I_p, stiffness = shear_modulus I_p.

        Args:
            length: in m.
            diameter: outer diameter in m.
            inner_diameter: in m, 0 for a solid shaft.
            density: in kg/m3.
            shear_modulus: in Pa.
            damping: D' in N m2 s.
            friction: in N s.

        Raises:
            ParameterError: a value is not finite or out of its bounds, or the bore is as wide as the shaft.
        """
        for parameter, value in zip(GEOMETRY, (diameter, inner_diameter, density, shear_modulus), strict=True):
            _check("section", parameter, value)
        if inner_diameter >= diameter:
            raise ParameterError(
                f"The inner_diameter of a section must be less than its diameter {diameter:g} m, "
                f"and is {inner_diameter:g} m."
            )
        area_moment = math.pi / 32 * (diameter**4 - inner_diameter**4)
        return cls(length, density * area_moment, shear_modulus * area_moment, damping, friction)

    @property
    def delay(self) -> float:
        """Time in s that a wave takes through the lossless section."""
        return self.length * math.sqrt(self.inertia / self.stiffness)

    @property
    def impedance(self) -> float:
        """Torque per speed of a wave in the lossless section, in N m s."""
        return math.sqrt(self.inertia) * math.sqrt(self.stiffness)

    @property
    def lossless(self) -> bool:
        """Whether the section has neither damping nor friction."""
        return self.damping == 0 and self.friction == 0


@dataclass(frozen=True)
class SectionLine:
    """Sections in a row with a disc at each of their n + 1 junctions, the two ends included.

    Args:
        sections: the n sections from left to right.
        discs: inertia at each junction in kg m2, n + 1 values; 0 where there is none.
        dampers: viscous friction at each junction against the ground in N m s, n + 1 values, or none at all.
        ends: "free" or "clamped" for the left and the right end; the disc and the damper of a clamped end rest.

    Raises:
        ParameterError: there is no section, the numbers of values differ, or a value is out of its bounds.
    """

    sections: tuple[Section, ...]
    discs: tuple[float, ...]
    dampers: tuple[float, ...] = ()
    ends: tuple[End, End] = ("free", "free")

    def __post_init__(self) -> None:
        junctions = len(self.sections) + 1
        if junctions == 1:
            raise ParameterError("A line needs at least one section.")
        object.__setattr__(self, "dampers", self.dampers or (0.0,) * junctions)
        for name, parameter, values in (("discs", DISC, self.discs), ("dampers", DAMPER, self.dampers)):
            if len(values) != junctions:
                raise ParameterError(
                    f"A line of {junctions - 1} sections has {junctions} junctions, its ends included, "
                    f"and {len(values)} {name} are given. Give one value for each junction, 0 where there is none."
                )
            for value in values:
                _check("line", parameter, value)
        if len(self.ends) != 2 or any(end not in {"free", "clamped"} for end in self.ends):
            raise ParameterError(f"The ends of a line must be two of 'free' and 'clamped', and are {self.ends!r}.")

    @property
    def length(self) -> float:
        """Length of all sections in m."""
        return float(self.junctions[-1])

    @property
    def junctions(self) -> Array:
        """Distances of the junctions from the left end in m, shape (n + 1,)."""
        return np.concatenate([[0.0], np.cumsum([section.length for section in self.sections])])

    @property
    def inertia(self) -> float:
        """Inertia of all sections and discs in kg m2."""
        return math.fsum([*self.discs, *(section.inertia * section.length for section in self.sections)])

    @property
    def lossless(self) -> bool:
        """Whether no section and no junction takes energy."""
        return not any(self.dampers) and all(section.lossless for section in self.sections)

    @property
    def clamped(self) -> tuple[bool, ...]:
        """Whether each junction is held, n + 1 values."""
        inner = (False,) * (len(self.sections) - 1)
        return (self.ends[0] == "clamped", *inner, self.ends[1] == "clamped")

    def without_losses(self) -> SectionLine:
        """The same line without dampers, damping and friction."""
        sections = tuple(dataclasses.replace(section, damping=0.0, friction=0.0) for section in self.sections)
        return SectionLine(sections, self.discs, ends=self.ends)

    def mirrored(self) -> SectionLine:
        """The same line read from right to left."""
        return SectionLine(self.sections[::-1], self.discs[::-1], self.dampers[::-1], (self.ends[1], self.ends[0]))

    def junction(self, number: int) -> int:
        """The number of a junction, checked: 0 is the left end, n the right one.

        Raises:
            ParameterError: there is no such junction.
        """
        if not 0 <= number <= len(self.sections):
            raise ParameterError(f"The line has the junctions 0 to {len(self.sections)}, and no junction {number}.")
        return number

    def locate(self, station: float, side: Side = "right") -> tuple[int, float]:
        """The section to which a station belongs, and its distance in m from the left end of that section.

        Args:
            station: distance from the left end of the line in m.
            side: which section is meant where the station is a junction; an end has only one.

        Raises:
            ParameterError: the station lies outside the line.
        """
        edges = self.junctions
        # A junction that the user computes is met up to rounding, and its section ends where it is as long as given.
        slack = 8 * np.spacing(edges[-1])
        if not -slack <= station <= edges[-1] + slack:
            raise ParameterError(
                f"The line reaches from 0 to {edges[-1]:g} m, and the station {station:g} m is outside."
            )
        nearest = int(np.abs(edges - station).argmin())
        last = len(self.sections) - 1
        if abs(edges[nearest] - station) > slack:
            index = int(np.searchsorted(edges, station)) - 1
            return index, station - float(edges[index])
        if nearest == 0 or (side == "right" and nearest <= last):
            return nearest, 0.0
        return nearest - 1, self.sections[nearest - 1].length


def _check(owner: str, parameter: Parameter, value: float) -> None:
    objection = parameter.objection(value)
    if objection is not None:
        raise ParameterError(f"The {parameter.name} of a {owner} ({parameter.unit}) {objection}, and is {value!r}.")
