"""Networks to text files and back: what `textfile` reads and writes, in terms of components."""

from __future__ import annotations

from difflib import get_close_matches
from pathlib import Path
from typing import Any

from sympy import Expr

from shaftwork.components import REGISTRY, Component, Table
from shaftwork.core.errors import ModelFileError, ParameterError
from shaftwork.network import expressions, textfile
from shaftwork.network.expression_reader import parse
from shaftwork.network.grammar import fault_of, tokens_of
from shaftwork.network.netlist import Netlist, Placed
from shaftwork.network.textfile import ModelText, PartText
from shaftwork.network.wording import title

MAXIMUM_LAW_WORDS = 4000
"""Numbers, names and signs of all laws of a file together, some 400 laws: more take too long to read."""


def write_netlist(netlist: Netlist, path: str | Path) -> None:
    """Write a netlist to a file.

    A law without symbols, such as pi or 2 pi, is written as its number.

    Raises:
        ModelFileError: a parameter has no text form, or the file cannot be written.
    """
    place = _path_of(path)
    text = textfile.write(ModelText(netlist.name, tuple(_part_text(placed) for placed in netlist.placed)))
    try:
        place.write_text(text, encoding="utf-8", newline="\n")
    except (OSError, ValueError) as error:
        raise ModelFileError(
            f"{place} cannot be written: {error}. Give the path of a file in a folder that exists."
        ) from None


def read_netlist(path: str | Path) -> Netlist:
    """Read a netlist from a file.

    Raises:
        ModelFileError: the file is no model; says where and what would be right.
    """
    model = textfile.read(_path_of(path))
    try:
        _refuse_endless_laws(model)
        return Netlist(model.name, tuple(_placed(part) for part in model.parts))
    except ModelFileError as error:
        raise ModelFileError(f"{path}: {error}") from None


def _path_of(path: str | Path) -> Path:
    try:
        return Path(path)
    except TypeError:
        raise ModelFileError(f"{path!r} is no path. Give the place of a model file, such as 'crane.toml'.") from None


def _refuse_endless_laws(model: ModelText) -> None:
    laws = [
        value
        for part in model.parts
        for name, value in part.parameters.items()
        if isinstance(value, str) and not _is_record(REGISTRY.get(part.type), name)
    ]
    words = 0
    for law in laws:
        words += len(tokens_of(law))
        if words > MAXIMUM_LAW_WORDS:
            raise ModelFileError(
                f"The laws of the file have more than {MAXIMUM_LAW_WORDS} words together ({len(laws)} laws). "
                f"Give curves as tables, or build the network in Python."
            )


def _is_record(cls: type[Component] | None, name: str) -> bool:
    """Whether a parameter is a record with a text of its own, such as the model of a shaft."""
    return cls is not None and name in cls.declared and cls.declared[name].record is not None


def _part_text(placed: Placed) -> PartText:
    part = placed.part
    values = {name: _written(part, name) for name in part.declared if not _is_default(part, name)}
    return PartText(type(part).__name__, part.name, placed.nodes, values, part.symbol)


def _is_default(part: Component, name: str) -> bool:
    declared = part.declared[name]
    if declared.default is None:
        return getattr(part, name) is None
    kinds = (float,) if declared.record is None else (declared.record,)
    return not declared.required and isinstance(value := getattr(part, name), kinds) and value == declared.default


def _written(part: Component, name: str) -> Any:
    declared = part.declared[name]
    value, objection = declared.magnitude(getattr(part, name))
    if objection is not None:
        raise ModelFileError(f"{title(part)}: {name} {objection}, so it cannot be saved.")
    if declared.record is not None:
        return repr(value)
    if not isinstance(value, Expr) or isinstance(value, Table):
        return value
    if fault := fault_of(value):  # before the text is made, which would be refused where it is read again
        raise ModelFileError(f"{title(part)}: {name} {fault}, so it cannot be saved. Write large numbers as floats.")
    try:
        return expressions.write(value)
    except ModelFileError as error:
        raise ModelFileError(f"{title(part)}: {name} cannot be saved: {error}") from None


def _placed(part: PartText) -> Placed:
    cls = REGISTRY.get(part.type)
    if cls is None:
        close = get_close_matches(part.type, REGISTRY, n=3) or tuple(REGISTRY)
        raise ModelFileError(
            f"Part '{part.name}': there is no component '{part.type}'. Close to it: {', '.join(close)}. "
            f"A component of your own must be imported before the file is loaded."
        )
    values = {name: _read(part, cls, name, value) for name, value in part.parameters.items()}
    try:
        return Placed(cls(part.name, symbol=part.symbol, **values), part.nodes)
    except ParameterError as error:
        raise ModelFileError(str(error)) from None


def _read(part: PartText, cls: type[Component], name: str, value: Any) -> Any:
    if not isinstance(value, str) or _is_record(cls, name):
        return value
    if name not in cls.declared or not cls.declared[name].law:
        raise ModelFileError(
            f"Part '{part.name}': {name} = '{value}' must be a number. The laws of {part.type} are: "
            f"{', '.join(key for key, declared in cls.declared.items() if declared.law) or 'none'}."
        )
    try:
        law = parse(value)
        return law if law.free_symbols else float(law)
    except ModelFileError as error:
        raise ModelFileError(f"Part '{part.name}', {name}: {error}") from None
