"""The door to models of openTorsion."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from shaftwork.core.errors import ParameterError
from shaftwork.opentorsion.assemblies import elements_of, is_assembly
from shaftwork.opentorsion.tors import read_tors, tors_elements
from shaftwork.opentorsion.train import network_of_elements
from shaftwork.pipeline.network import Network


def from_opentorsion(source: Any, name: str | None = None) -> Network:
    """The network of an openTorsion model: its natural frequencies and responses are those of the matrices M, C, K.

    Discs are inertias, shafts springs, gears gears that turn against each other; node 3 is "n3". An element of a shaft
    with mass has a consistent mass matrix, which is three inertias, two at its ends and one at their mean speed.

    Args:
        source: an `opentorsion.Assembly`; or a system in openTorsion's JSON format TORS, as a path or as a dict.
        name: of the network; by default that of the system, or "openTorsion".

    Raises:
        ModelFileError: the file or dict is not in the TORS format; says in which component and element.
        ParameterError: it is neither, or a matrix of the assembly was changed after it was built.
    """
    title = "openTorsion"
    if is_assembly(source):
        elements = elements_of(source)
    elif isinstance(source, Mapping):
        title, elements = tors_elements(source)
    elif isinstance(source, str | Path):
        title, elements = read_tors(source)
    else:
        raise ParameterError(
            f"{type(source).__name__} is no openTorsion model. Give an opentorsion.Assembly, the path of a TORS file "
            "(JSON), or what json.load makes of one."
        )
    return network_of_elements(title if name is None else name, elements)
