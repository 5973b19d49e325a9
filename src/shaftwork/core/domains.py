"""The three physical domains and their quantities (mobility analogy: speed is across, torque is through)."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Quantity:
    """A physical quantity: its name in code, its LaTeX symbol and its SI unit."""

    name: str
    latex: str
    unit: str


@dataclass(frozen=True)
class Domain:
    """A domain: what its nodes have in common (across), what flows through its branches, and the integral of across."""

    name: str
    across: Quantity
    through: Quantity
    integral: Quantity

    def __reduce__(self) -> str:
        """Stored by its name below: there is one of each, and it is compared with `is`."""
        return self.name.upper()


ROTATION = Domain(
    "rotation",
    across=Quantity("omega", r"\omega", "rad/s"),
    through=Quantity("tau", r"\tau", "N*m"),
    integral=Quantity("phi", r"\varphi", "rad"),
)
TRANSLATION = Domain(
    "translation",
    across=Quantity("v", "v", "m/s"),
    through=Quantity("f", "f", "N"),
    integral=Quantity("s", "s", "m"),
)
ELECTRICAL = Domain(
    "electrical",
    across=Quantity("u", "u", "V"),
    through=Quantity("i", "i", "A"),
    integral=Quantity("psi", r"\psi", "V*s"),
)
SIGNAL = Domain(
    "signal",
    across=Quantity("x", "x", "1"),
    through=Quantity("w", "w", "1/s"),
    integral=Quantity("z", "z", "s"),
)
"""What the states of a controller are in: numbers, whose product with their rates is no power."""
DOMAINS = (ROTATION, TRANSLATION, ELECTRICAL)
DOMAIN_NAMES = "ROTATION, TRANSLATION or ELECTRICAL of this package"
"""What a user can give as a domain, in words."""
