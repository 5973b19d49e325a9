"""What stands in an `opentorsion.Assembly`."""

from __future__ import annotations

from collections.abc import Iterator
from operator import index
from typing import Any

import numpy as np

from shaftwork.core.errors import ParameterError
from shaftwork.opentorsion.train import Disc, Element, GearMesh, ShaftElement, unique

LISTS = ("shaft_elements", "disk_elements", "gear_elements", "elastic_gear_elements")
"""What an assembly has; older ones have no elastic gears."""
MATRICES = ("M", "C", "K")


def is_assembly(source: Any) -> bool:
    """Whether something is an assembly of openTorsion, without importing it."""
    return hasattr(source, "shaft_elements") and hasattr(source, "assemble_M")


def elements_of(assembly: Any) -> tuple[Element, ...]:
    """The elements of an assembly, in its order: shafts, discs, gears.

    Raises:
        ParameterError: an element lacks a value, or a matrix of the assembly was changed after it was built.
    """
    for name in MATRICES:
        built = getattr(assembly, f"assemble_{name}")()
        if not np.array_equal(built, getattr(assembly, name)):
            raise ParameterError(
                f"The matrix {name} of the assembly is not the one that its elements make. Undo the change, and add a "
                "part for it to the network, such as a Spring or Damper from a node to 'ground'."
            )
    return tuple(_elements(assembly))


def _elements(assembly: Any) -> Iterator[Element]:
    taken = set[str]()
    shafts, discs, rigid, elastic = (tuple(getattr(assembly, name, None) or ()) for name in LISTS)
    for shaft in shafts:
        left, right = _whole(shaft, "nl"), _whole(shaft, "nr")
        values = (_number(shaft, name) for name in ("k", "c", "mass"))
        yield ShaftElement(unique(f"shaft {left}-{right}", taken), left, right, *values)
    for disc in discs:
        node = _whole(disc, "node")
        yield Disc(unique(f"disk {node}", taken), node, *(_number(disc, name) for name in ("I", "c", "k")))
    for gear in (*rigid, *elastic):
        node, name = _whole(gear, "node"), unique(f"gear {gear.node}", taken)
        yield Disc(name, node, _number(gear, "I"))
        if gear.parent is not None:
            ratio = _number(gear, "R") / _number(gear.parent, "R")
            flexible = (_number(gear, "k"), _number(gear, "c")) if gear in elastic else ()
            yield GearMesh(name, _whole(gear.parent, "node"), node, ratio, *flexible)


def _number(element: Any, name: str) -> float:
    value = getattr(element, name, None)
    try:
        return float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise ParameterError(f"{_title(element)} has {name} = {value!r}. Give a number.") from None


def _whole(element: Any, name: str) -> int:
    value = getattr(element, name, None)
    try:
        return index(value)  # type: ignore[arg-type]
    except TypeError:
        raise ParameterError(f"{_title(element)} has {name} = {value!r}. Give a whole number.") from None


def _title(element: Any) -> str:
    places = [f"{name} = {getattr(element, name)}" for name in ("nl", "nr", "node") if hasattr(element, name)]
    return f"The openTorsion {type(element).__name__} with {', '.join(places)}"
