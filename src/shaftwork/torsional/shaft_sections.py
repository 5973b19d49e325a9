"""Cross-sections of shafts: their stress under torque, and what the rules for propulsion shafts permit."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import in_si
from shaftwork.results.observer import Array

MPA = 1e6
"""Pa in 1 N/mm^2, in which the rules are written; diameters there are in mm."""
TRANSIENT, STEP, LAST = 0.8, 0.9, 1.05
"""Speeds over the rated one, by UR M68: below the first a range may be barred and passed, from the second on the
permissible stress is the same, and up to the third it is given."""


@dataclass(frozen=True)
class ShaftDesign:
    """What a rule says of a design of a shaft.

    Args:
        factor: C_K.
        strongest: tensile strengths in Pa up to which carbon and alloy steel count.
    """

    factor: float
    strongest: tuple[float, float]


_LINE, _AFT = (600 * MPA, 800 * MPA), (600 * MPA, 600 * MPA)
DESIGNS: dict[str, ShaftDesign] = {
    "intermediate, flange": ShaftDesign(1.0, _LINE),
    "intermediate, shrink fit": ShaftDesign(1.0, _LINE),
    "intermediate, tapered keyway": ShaftDesign(0.60, _LINE),
    "intermediate, cylindrical keyway": ShaftDesign(0.45, _LINE),
    "intermediate, radial hole": ShaftDesign(0.50, _LINE),
    "intermediate, slot": ShaftDesign(0.30, _LINE),
    "thrust, collar": ShaftDesign(0.85, _LINE),
    "thrust, roller bearing": ShaftDesign(0.85, _LINE),
    "propeller": ShaftDesign(0.55, _AFT),
    "stern tube": ShaftDesign(0.80, _AFT),
}
"""Designs by name. "propeller" is the length from the aftmost bearing to the propeller, "stern tube" that before it.
Source: IACS UR M68, as in the Rules of the Korean Register 2025, part 5, chapter 4, 202 and table 5.4.1."""


@dataclass(frozen=True)
class Section:
    """A cross-section of a shaft at which stresses are looked at.

    Law: tau = T / W, W = pi diameter^3 / 16 (1 - (bore / diameter)^4), nominal; at a notch scf times as much.

    Args:
        shaft: name of the spring or shaft that passes the torque on.
        diameter: m; that of the `Shaft` by default, of a spring it must be given.
        bore: m; that of the `Shaft` by default, else none.
        scf: stress concentration of a keyway, fillet or hole, given; rules have theirs in C_K, for the nominal stress.
        design: one of `torsional.DESIGNS`, whose permissible stresses are looked at; none by default.
        strength: specified minimum tensile strength in Pa, needed with a design.
        alloy: whether it is an alloy steel.

    Raises:
        ParameterError: a value is out of its bounds, there is no such design, or its strength is missing.
    """

    shaft: str
    diameter: float | None = field(default=None, kw_only=True)
    bore: float | None = field(default=None, kw_only=True)
    scf: float = field(default=1.0, kw_only=True)
    design: str | None = field(default=None, kw_only=True)
    strength: float | None = field(default=None, kw_only=True)
    alloy: bool = field(default=False, kw_only=True)

    def __post_init__(self) -> None:
        if not isinstance(self.shaft, str):
            raise ParameterError(f"Section: shaft = {self.shaft!r} must be the name of a spring or shaft.")
        numbers: dict[str, tuple[str, dict[str, float]]] = {
            "diameter": ("m", {"above": 0}),
            "bore": ("m", {"at_least": 0}),
            "scf": ("1", {"at_least": 1}),
            "strength": ("Pa", {"at_least": 100 * MPA, "at_most": 3000 * MPA}),
        }
        for name, (unit, bounds) in numbers.items():
            if (value := getattr(self, name)) is not None:
                object.__setattr__(self, name, in_si(f"Section '{self.shaft}': {name}", value, unit, **bounds))
        if self.design is not None and self.design not in DESIGNS:
            raise ParameterError(
                f"Section '{self.shaft}': there is no design {self.design!r}. There are: {'; '.join(DESIGNS)}."
            )
        if (self.design is None) != (self.strength is None):
            raise ParameterError(
                f"Section '{self.shaft}': design and strength, the tensile strength in Pa, go together. Give both."
            )
        if self.diameter is not None and (self.bore or 0.0) >= self.diameter:
            raise ParameterError(
                f"Section '{self.shaft}': bore = {self.bore:g} m must be smaller than diameter = {self.diameter:g} m."
            )

    def of(self, diameter: float, bore: float) -> Section:
        """The same with diameter and bore where they were left out."""
        return Section(
            self.shaft,
            diameter=diameter if self.diameter is None else self.diameter,
            bore=bore if self.bore is None else self.bore,
            scf=self.scf,
            design=self.design,
            strength=self.strength,
            alloy=self.alloy,
        )

    @property
    def modulus(self) -> float:
        """W in m^3; of a section whose diameter is known."""
        assert self.diameter is not None  # noqa: S101 (the calculation has completed it)
        return math.pi * self.diameter**3 / 16 * (1 - ((self.bore or 0.0) / self.diameter) ** 4)

    def stress(self, torque: Any) -> Array:
        """Nominal shear stress in Pa under torques in N m."""
        return np.asarray(torque, dtype=float) / self.modulus

    def permitted(self, ratio: Any) -> tuple[Array, Array]:
        """The stresses that are permitted to last, tau_c, and while a barred range is passed, tau_t, in Pa.

        Law, in N/mm^2 and mm: tau_c = (sigma_B + 160) / 18 C_K C_D (3 - 2 ratio^2) below ratio = 0.9 and 1.38 for the
        last factor from there to 1.05; C_D = 0.35 + 0.93 diameter^-0.2; tau_t = 1.7 tau_c / C_K^(1/2) below 0.8. From
        0.8 on no range may be barred, and tau_t is tau_c. Beyond 1.05 the rule has no limit: both are infinite.
        They are nominal stresses, half of peak to peak over a cycle, beside those of the mean torque.

        Args:
            ratio: of the speed to the rated one, any shape.

        Raises:
            ParameterError: the section has no design, or a ratio is no number from 0 on.

        Source: IACS UR M68, as in the Rules of the Korean Register 2025, part 5, chapter 4, 202; for what stress is
        meant, Lloyd's Register, Rules for Naval Ships 2023, volume 2, part 5, chapter 1, 3.1.
        """
        if self.design is None or self.strength is None:
            raise ParameterError(f"Section '{self.shaft}' has no design. Give design= and strength=.")
        assert self.diameter is not None  # noqa: S101 (as above)
        design = DESIGNS[self.design]
        try:
            speed = np.asarray(ratio, dtype=float)
        except (TypeError, ValueError):
            speed = np.full(1, np.nan)
        if not (speed >= 0.0).all():
            raise ParameterError(f"ratio = {ratio!r} must be speeds over the rated one, 0 or more.")
        strength = min(self.strength, design.strongest[self.alloy]) / MPA
        size = 0.35 + 0.93 * (1e3 * self.diameter) ** -0.2
        shape = np.where(speed < STEP, 3 - 2 * speed**2, 1.38)
        lasting = (strength + 160) / 18 * design.factor * size * shape * MPA
        lasting = np.where(speed <= LAST, lasting, np.inf)
        return lasting, np.where(speed < TRANSIENT, 1.7 * lasting / math.sqrt(design.factor), lasting)
