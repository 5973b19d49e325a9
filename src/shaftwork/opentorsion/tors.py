"""Files in the TORS format, JSON that openTorsion and its editor read and write.

A file lists components, each a row of elements along a shaft, and says which component goes on at which element of
another. Lengths and diameters are in mm, all else in SI units.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any

from shaftwork.core.errors import ModelFileError, NetworkWarning
from shaftwork.core.notices import warn
from shaftwork.opentorsion.train import Disc, Element, GearMesh, ShaftElement, unique

DENSITY, SHEAR_MODULUS = 8000.0, 80e9
"""kg/m^3 and Pa, where a file does not say, as openTorsion has them."""
LARGEST_FILE = 2_500_000
"""Bytes, as of model files."""
KINDS = ("Disk", "ShaftDiscrete", "ShaftContinuous", "GearElement")
FOREIGN = {"Disk": "stiffness", "ShaftDiscrete": "inertia"}
"""What older files have besides, as zero: openTorsion takes no notice of it."""


def read_tors(path: str | Path) -> tuple[str, tuple[Element, ...]]:
    """The name of the system in a file, and its elements.

    Raises:
        ModelFileError: the file cannot be read, or is not in the TORS format; says where.
    """
    try:
        content = Path(path).read_bytes()
    except (OSError, ValueError) as error:
        raise ModelFileError(f"{path} cannot be read: {error}. Give the path of a TORS file.") from None
    if len(content) > LARGEST_FILE:
        raise ModelFileError(f"{path} has more than {LARGEST_FILE} bytes. Split the model.")
    try:
        system = json.loads(content)
    except (ValueError, RecursionError) as error:
        raise ModelFileError(f"{path} is no JSON: {error}. Give a file in the TORS format of openTorsion.") from None
    try:
        return tors_elements(system)
    except ModelFileError as error:
        raise ModelFileError(f"{path}: {error}") from None


def tors_elements(system: Any) -> tuple[str, tuple[Element, ...]]:
    """The name of a system, and its elements.

    Where a component goes on in the middle of another one, both stand at that element; openTorsion's own reader puts
    the rest of the first one behind the other.

    Raises:
        ModelFileError: it is not in the TORS format; says where.
    """
    name = system.get("name", "openTorsion") if isinstance(system, Mapping) else None
    if not isinstance(name, str) or not isinstance(system.get("components"), list):
        raise ModelFileError('A TORS system is an object with "name", "components" and "structure".')
    components = {_text(component, "name", "a component"): component for component in system["components"]}
    if len(components) < len(system["components"]):
        raise ModelFileError("Two components have one name. Give each its own.")
    return name, tuple(_TableReading(components, _connections(system, components)).elements())


def _connections(system: Mapping[str, Any], components: Mapping[str, Any]) -> dict[tuple[str, str], list[str]]:
    """By component and element, the components that go on there."""
    following: dict[tuple[str, str], list[str]] = {}
    pairs = system.get("structure", [])
    for pair in pairs if isinstance(pairs, list) else [pairs]:
        if not (isinstance(pair, list) and len(pair) == 2 and all(isinstance(end, str) and "." in end for end in pair)):
            raise ModelFileError(
                f'"structure" has {_short(pair)}. Write pairs ["component.element", "component.element"].'
            )
        (owner, _, element), (other, _, _) = (end.partition(".") for end in pair)
        if missing := [name for name in (owner, other) if name not in components]:
            raise ModelFileError(f"\"structure\" names the component '{missing[0]}', which is not in the file.")
        following.setdefault((owner, element), []).append(other)
    return following


@dataclass
class _TableReading:
    """The way through the components of a file, from the one that follows none."""

    components: Mapping[str, Any]
    following: Mapping[tuple[str, str], list[str]]
    taken: set[str] = field(default_factory=set)

    def elements(self) -> Iterator[Element]:
        followers = [name for names in self.following.values() for name in names]
        starts = [name for name in self.components if name not in followers]
        if len(starts) != 1 or len(set(followers)) < len(followers):
            what = f"{len(starts)} components follow no other" if len(starts) != 1 else "a component follows two others"
            raise ModelFileError(f"{what}. Join all components to one tree, from one start.")
        numbers = count(1)
        waiting = [(starts[0], 0)]
        reached = 0
        while waiting:
            reached += 1
            yield from self._component(*waiting.pop(0), numbers, waiting)
        if reached < len(self.components):
            raise ModelFileError("Some components follow each other in a ring. Join all components to one tree.")

    def _component(
        self, name: str, node: int, numbers: Iterator[int], waiting: list[tuple[str, int]]
    ) -> Iterator[Element]:
        component = self.components[name]
        rows = component.get("elements")
        if not isinstance(rows, list):
            raise ModelFileError(f"component '{name}': \"elements\" is {_short(rows)}. Write a list of elements.")
        gears: dict[str, tuple[int, Mapping[str, Any]]] = {}
        labels = set[str]()
        for row in rows:
            label = _text(row, "name", f"component '{name}'")
            place = f"component '{name}', element '{label}'"
            title = unique(f"{name}.{label}", self.taken)
            labels.add(label)
            kind = row.get("type")
            if "excitation" in row:
                warn(
                    f"{place}: its excitation is not read: it is a share of a torque that the file does not have. Add "
                    f"sw.HarmonicTorque at '{title}'.",
                    NetworkWarning,
                )
            if (foreign := FOREIGN.get(str(kind))) is not None and row.get(foreign):
                raise ModelFileError(
                    f"{place}: a {kind} has no {foreign}. Write that of a shaft as a Disk, and add "
                    "that of a disk to the network."
                )
            match kind:
                case "Disk":
                    yield Disc(title, node, _number(row, "inertia", place), _number(row, "damping", place, 0.0))
                case "ShaftDiscrete" | "ShaftContinuous":
                    right = next(numbers)
                    yield _shaft(row, kind, place, title, (node, right))
                    node = right
                case "GearElement":
                    parent = gears.get(str(row.get("parent")))
                    if "diameter" not in row and "teeth" not in row:
                        raise ModelFileError(f'{place}: "diameter" and "teeth" are missing. Give one of them.')
                    if row.get("parent") and parent is None:
                        raise ModelFileError(f"{place}: its parent '{row['parent']}' is no gear before it.")
                    child = node if parent is None else next(numbers)
                    yield Disc(title, child, _number(row, "inertia", place), _number(row, "damping", place, 0.0))
                    if parent is not None:
                        yield GearMesh(title, parent[0], child, _ratio(row, parent[1], place))
                    gears[label], node = (child, row), child
                case _:
                    raise ModelFileError(f"{place}: its type is {_short(kind)}. Types are: {', '.join(KINDS)}.")
            waiting += [(other, node) for other in self.following.get((name, label), ())]
        if strange := [element for owner, element in self.following if owner == name and element not in labels]:
            raise ModelFileError(f"component '{name}' has no element '{strange[0]}', which \"structure\" names.")


def _shaft(row: Mapping[str, Any], kind: str, place: str, title: str, nodes: tuple[int, int]) -> ShaftElement:
    damping = _number(row, "damping", place, 0.0)
    if kind == "ShaftDiscrete":
        return ShaftElement(title, *nodes, _number(row, "stiffness", place), damping)
    length = 1e-3 * _number(row, "length", place)
    outer, inner = (1e-3 * _number(row, key, place) for key in ("outerDiameter", "innerDiameter"))
    if not (length > 0 and 0 <= inner < outer):
        raise ModelFileError(
            f"{place}: a length of {1e3 * length:g} mm and diameters of {1e3 * inner:g} and {1e3 * outer:g} mm are no "
            "shaft. Give a length and an outer diameter above the inner one."
        )
    polar = math.pi * (outer**4 - inner**4) / 32
    sixth = _number(row, "density", place, DENSITY) * polar * length / 6
    return ShaftElement(title, *nodes, SHEAR_MODULUS * polar / length, damping, sixth)


def _ratio(gear: Mapping[str, Any], parent: Mapping[str, Any], place: str) -> float:
    """Of a gear to its parent, by teeth or by diameters."""
    key = "teeth" if "teeth" in gear and "teeth" in parent else "diameter"
    if ("teeth" in gear) != ("teeth" in parent) and not ("diameter" in gear and "diameter" in parent):
        raise ModelFileError(f"{place}: one gear of the pair has teeth, the other a diameter. Give the same of both.")
    sizes = [_number(row, key, place) for row in (gear, parent)]
    if min(sizes) <= 0:
        raise ModelFileError(f"{place}: {key} of {min(sizes):g}. Give a number above zero.")
    return sizes[0] / sizes[1]


def _text(row: Any, key: str, place: str) -> str:
    value = row.get(key) if isinstance(row, Mapping) else None
    if not isinstance(value, str) or not value.isprintable() or not value.strip():
        raise ModelFileError(f'{place}: "{key}" is {_short(value)}. Write a text.')
    return value


def _number(row: Mapping[str, Any], key: str, place: str, default: float | None = None) -> float:
    value = row.get(key, default)
    try:
        if isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
            return float(value)
    except OverflowError:
        pass
    raise ModelFileError(f'{place}: "{key}" is {_short(value)}. Write a finite number.')


def _short(value: Any) -> str:
    text = "missing" if value is None else repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
