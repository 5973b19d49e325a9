"""Tables of the modes as Holzer's method writes them: mass by mass the relative amplitude, between them the torque."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, overload

import numpy as np

from shaftwork.core.screen import in_columns
from shaftwork.numerics.tolerances import TYPED
from shaftwork.results.observer import Complex
from shaftwork.torsional.shaft_sections import MPA, Section

if TYPE_CHECKING:
    from shaftwork.frequency.natural_modes import NaturalModes


class HolzerMass(NamedTuple):
    """A mass in a mode.

    Attributes:
        name: of the inertia.
        amplitude: its angle over that of the measuring mass; below 0 where it swings against it.
        torque: J omega^2 times its angle, with omega = 2 pi frequency, N m for 1 rad at the measuring mass.
    """

    name: str
    amplitude: float
    torque: float


class HolzerShaft(NamedTuple):
    """A shaft in a mode.

    Attributes:
        name: of the spring or shaft.
        torque: the largest along it, N m for 1 rad at the measuring mass.
        stress: nominal, Pa for 1 rad there; None where no section is given.
    """

    name: str
    torque: float
    stress: float | None


@dataclass(frozen=True)
class HolzerMode:
    """A mode as a table.

    Law: between two masses in a row the torque changes by J omega^2 times the angle of the mass. Amplitudes are those
    of the damped mode in phase with the measuring mass.

    Args:
        name: "mode 1".
        frequency: Hz.
        damping: ratio.
        measure: the mass whose amplitude is 1.
        masses: in the order of the train.
        shafts: in the order of the train.
    """

    name: str
    frequency: float
    damping: float
    measure: str
    masses: tuple[HolzerMass, ...]
    shafts: tuple[HolzerShaft, ...]

    def __str__(self) -> str:
        head = f"{self.name}: {self.frequency:.6g} Hz, damping {self.damping:.4g}, for 1 rad of {self.measure}"
        masses = [("mass", "amplitude", "inertia torque in kN m")]
        masses += [(one.name, f"{one.amplitude:.5g}", f"{one.torque / 1e3:.5g}") for one in self.masses]
        shafts = [("shaft", "torque in kN m", "stress in N/mm^2")]
        shafts += [
            (one.name, f"{one.torque / 1e3:.5g}", "-" if one.stress is None else f"{one.stress / MPA:.5g}")
            for one in self.shafts
        ]
        return "\n".join([head, *(f"  {line}" for line in (*in_columns(masses), *in_columns(shafts)))])


@dataclass(frozen=True)
class HolzerTable:
    """The modes of a train, by ascending frequency.

    Args:
        title: of the network.
        modes: those that swing.
    """

    title: str
    modes: tuple[HolzerMode, ...]

    def __len__(self) -> int:
        return len(self.modes)

    @overload
    def __getitem__(self, number: int) -> HolzerMode: ...

    @overload
    def __getitem__(self, number: slice) -> tuple[HolzerMode, ...]: ...

    def __getitem__(self, number: int | slice) -> HolzerMode | tuple[HolzerMode, ...]:
        return self.modes[number]

    def __str__(self) -> str:
        return "\n".join([self.title, *map(str, self.modes)])


def holzer_table(modes: NaturalModes, shafts: Mapping[str, str], sections: Sequence[Section]) -> HolzerTable:
    """The table of the modes of a train.

    Args:
        modes: of the train.
        shafts: from the name of each shaft to its torque.
        sections: with their diameters.
    """
    inertias = [(name, node) for name, node in modes.slopes.masses if f"{name}.tau" in modes.slopes.units]
    places = list(modes.slopes.nodes)
    inertias.sort(key=lambda one: places.index(one[1]))
    of_shafts = {section.shaft: section for section in sections}
    torques = {name: modes.shapes[torque] for name, torque in shafts.items()}
    speeds = [modes.shapes[node] for _, node in inertias]
    forces = [modes.shapes[f"{name}.tau"] for name, _ in inertias]
    rows = []
    for number in np.flatnonzero(modes.rates.imag > 0).tolist():
        turned = np.array([speed[number] for speed in speeds]) / modes.rates[number]
        size = np.abs(turned)
        # a first mass that stands but for rounding is no measure
        first = 0 if size[0] > TYPED * size.max() else int(size.argmax())
        scale = 1 / turned[first]
        masses = []
        for (name, _), angle, force in zip(inertias, turned, forces, strict=True):
            amplitude = float((scale * angle).real)
            # J omega^2 times the angle, as Holzer adds it up; of a damped mode the torque has another phase too
            stiffness = float(abs(force[number] / angle)) if angle else 0.0
            masses.append(HolzerMass(name, amplitude, stiffness * amplitude))
        passed = [_shaft(name, scale * torque[number], of_shafts.get(name)) for name, torque in torques.items()]
        damping, frequency = float(modes.damping[number]), float(modes.frequencies[number])
        measure = inertias[first][0]
        rows.append(HolzerMode(modes.names[number], frequency, damping, measure, tuple(masses), tuple(passed)))
    return HolzerTable(modes.title, tuple(rows))


def _shaft(name: str, torque: Complex, section: Section | None) -> HolzerShaft:
    along = np.atleast_1d(torque)
    largest = float(along[np.abs(along).argmax()].real)
    return HolzerShaft(name, largest, None if section is None else float(section.stress(largest)))
