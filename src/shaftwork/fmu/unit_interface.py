"""What an FMU shows to the outside: its variables with units and start values, and what depends on what."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

_BASE = {
    "kg": {"kg": 1},
    "m": {"m": 1},
    "s": {"s": 1},
    "A": {"A": 1},
    "rad": {"rad": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "Pa": {"kg": 1, "m": -1, "s": -2},
    "J": {"kg": 1, "m": 2, "s": -2},
    "W": {"kg": 1, "m": 2, "s": -3},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    "H": {"kg": 1, "m": 2, "s": -2, "A": -2},
    "F": {"kg": -1, "m": -2, "s": 4, "A": 2},
    "Hz": {"s": -1},
}
_FACTORS = {"min": ("s", 60.0)}


def base_unit(unit: str) -> tuple[dict[str, int], float]:
    """Exponents of SI base units and the factor to them of a unit such as "N*m*s/rad".

    Args:
        unit: as parameters declare it.
    """
    exponents: dict[str, int] = {}
    scale = 1.0
    for place, part in enumerate(unit.split("/")):
        for name, _, text in (factor.partition("^") for factor in part.split("*")):
            if name == "1":
                continue
            power = int(text or 1) * (1 if place == 0 else -1)
            base, size = _FACTORS.get(name, (name, 1.0))
            scale *= size**power
            for si, exponent in _BASE[base].items():
                exponents[si] = exponents.get(si, 0) + power * exponent
    return {si: exponent for si, exponent in exponents.items() if exponent}, scale


@dataclass(frozen=True)
class UnitVariable:
    """A variable of an FMU.

    Args:
        name: "J2.omega".
        unit: SI unit.
        start: value before the start; None of what follows from others.
        nominal: usual size.
        lowest: least value that has a sense, or None.
        highest: largest value that has a sense, or None.
    """

    name: str
    unit: str
    start: float | None = None
    nominal: float = 1.0
    lowest: float | None = None
    highest: float | None = None


@dataclass(frozen=True)
class UnitInterface:
    """All variables of an FMU; their value references count through them in this order, behind that of the time, 0.

    Args:
        title: of the network.
        identifier: its name as C code has it.
        token: tells this interface and these equations from all others.
        parameters: that a user may set.
        inputs: that a user gives over time.
        states: continuous ones.
        outputs: what else can be read.
        shown: names of the states that are outputs as well.
        indicators: number of event indicators.
        dependencies: by the name of an output or a rate, "der(J2.omega)", the states and inputs that it depends on;
            what is not listed may depend on everything.
        t_end: end of a usual motion, s.
    """

    title: str
    identifier: str
    token: str
    parameters: tuple[UnitVariable, ...]
    inputs: tuple[UnitVariable, ...]
    states: tuple[UnitVariable, ...]
    outputs: tuple[UnitVariable, ...]
    shown: frozenset[str]
    indicators: int
    dependencies: Mapping[str, tuple[str, ...]]
    t_end: float

    @cached_property
    def rates(self) -> tuple[UnitVariable, ...]:
        """Derivatives of the states."""
        return tuple(UnitVariable(f"der({state.name})", _per_second(state.unit)) for state in self.states)

    @property
    def _variables(self) -> tuple[UnitVariable, ...]:
        return (*self.parameters, *self.inputs, *self.states, *self.rates, *self.outputs)

    @cached_property
    def references(self) -> dict[str, int]:
        """Value references by name."""
        return {variable.name: k for k, variable in enumerate(self._variables, 1)}

    @cached_property
    def units(self) -> tuple[str, ...]:
        """All units that occur but that of pure numbers, in the order of the variables."""
        units = dict.fromkeys(("s", *(variable.unit for variable in self._variables)))
        return tuple(unit for unit in units if unit != "1")

    @property
    def convention(self) -> str:
        """Of names: "structured" where each is made of identifiers, so that tools show a tree; else "flat"."""
        names = (part for name in self.references for part in _plain(name).split("."))
        return "structured" if all(name.isascii() and name.isidentifier() for name in names) else "flat"

    def depends_on(self, name: str) -> tuple[int, ...] | None:
        """Value references of what an output or rate depends on; None where it may be anything."""
        others = (name,) if name in self.shown else self.dependencies.get(name)
        return None if others is None else tuple(sorted(self.references[other] for other in others))


def _plain(name: str) -> str:
    return name.removeprefix("der(").removesuffix(")") if name.startswith("der(") else name


def _per_second(unit: str) -> str:
    return f"{unit}^2" if unit.endswith("/s") else f"{unit}/s"
