"""Model files: a network as TOML text, read and written without knowing any component.

    format = 1
    name = "crane travel"

    [[part]]
    type = "Spring"
    name = "shaft"
    nodes = ["rotor", "wheel"]
    c = 24206.0
    d = 14.0

Values are numbers, texts (laws, see `storage.write`) and tables `{ x = [...], y = [...] }`. A file is plain data, which
`tomllib` reads. Keys of many dots, with which it would take hours, are refused before.
"""

from __future__ import annotations

import json
import math
import os
import re
import tomllib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from shaftwork.components.tables import Table
from shaftwork.core.errors import ModelFileError, ParameterError
from shaftwork.modelfiles.own_parts import MODULE
from shaftwork.network.grammar import LIMITS
from shaftwork.network.netlist import IMPACTS, MAXIMUM_NAME, Impacts, is_name

FORMATS = (1, 2)
"""Versions of the format; the second can name modules. A file is of the first that can say what it says."""
FORMAT = FORMATS[0]
LARGEST_FILE = 2_500_000
"""Bytes of a model file; 20000 parts take about 2 000 000."""

Value = int | float | str | Table
"""What a parameter may be in a file."""

_RESERVED = ("type", "name", "nodes", "symbol")
_KEY = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_LINE = re.compile(r"[ \t]*(?:(?P<part>\[\[[ \t]*part[ \t]*\]\])|(?P<key>[A-Za-z_][A-Za-z0-9_]*)[ \t]*=)")
_TEXT = re.compile(r"""#[^\n]*|(?P<multiline>\"{3}|'{3})|"(?:[^"\\\n]|\\.)*"|'[^'\n]*'|(?P<unclosed>["'])""")
_DOTS = re.compile(r"\.[ \t]*[\w\"'-]+[ \t]*\.")
_USE = (
    "Write [[part]], then lines key = value; a value is a number, a text, a list of texts, or { x = [...], y = [...] }."
)


@dataclass(frozen=True)
class PartText:
    """One part as it stands in a file.

    Args:
        type: name of the component's class.
        name: name of the part.
        nodes: the nodes that it is wired to, in the order of its ports.
        parameters: its parameters in the order of the file; an int stays an int, a float a float.
        symbol: subscript in LaTeX, empty for none, or None for the name.
        lines: of the file, counted from 1: that of its header under "", and that of each key.

    Raises:
        ModelFileError: a field could not stand in a file.
    """

    type: str
    name: str
    nodes: tuple[str, ...]
    parameters: Mapping[str, Value] = field(default_factory=dict)
    symbol: str | None = None
    lines: Mapping[str, int] = field(default_factory=dict, compare=False, repr=False)

    def __post_init__(self) -> None:
        _check_name("type", self.type)
        _check_name("name", self.name)
        if not isinstance(self.nodes, tuple) or not self.nodes:
            state = "is missing" if self.nodes is None else f"is {_shown(self.nodes)}"
            raise ModelFileError(f'nodes {state}. Give one node or more, such as nodes = ["rotor", "wheel"].')
        for node in self.nodes:
            _check_name("nodes", node)
        if self.symbol not in (None, ""):  # parts with an empty symbol have letters without a subscript
            _check_name("symbol", self.symbol)
        object.__setattr__(self, "parameters", {key: _checked(key, value) for key, value in self.parameters.items()})


@dataclass(frozen=True)
class ModelText:
    """A network as it stands in a file.

    Args:
        name: of the network.
        parts: in order.
        ports: if it is a part of others.
        impacts: as of `Netlist`.
        modules: that define parts which are not of the library.

    Raises:
        ModelFileError: a field could not stand in a file.
    """

    name: str
    parts: tuple[PartText, ...] = ()
    ports: tuple[str, ...] = ()
    impacts: Impacts = IMPACTS[0]
    modules: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        _check_name("name", self.name)
        if not isinstance(self.ports, tuple) or len({*map(str, self.ports)}) < len(self.ports):
            raise ModelFileError(
                f'ports is {_shown(self.ports)}. Give nodes, each once, such as ports = ["in", "out"].'
            )
        for port in self.ports:
            _check_name("ports", port)
        if self.impacts not in IMPACTS:
            words = " or ".join(map(_quoted, IMPACTS))
            raise ModelFileError(f"impacts is {_shown(self.impacts)}. Give {words}, or leave it out.")
        names = self.modules if isinstance(self.modules, tuple) else (None,)
        if not all(isinstance(name, str) and MODULE.fullmatch(name) for name in names):
            raise ModelFileError(f'modules is {_shown(self.modules)}. Give names such as ["mypackage.parts"].')


def read(source: str | os.PathLike[str]) -> ModelText:
    """The model in a text, or in the file at a path.

    Args:
        source: a str is the text itself, a `pathlib.Path` the place of a file.

    Raises:
        ModelFileError: there is no such file, or it is no model file; the message has the line, the part, the key and
            the next step.
    """
    title, text = ("model", source) if isinstance(source, str) else (os.fspath(source), _text_of(Path(source)))
    try:
        return _model(text, is_file=not isinstance(source, str))
    except ModelFileError as error:
        raise ModelFileError(f"{title}: {error}") from None


def read_table(key: str, text: str) -> Table:
    """The table `{ x = [...], y = [...] }` in a text, as it stands behind a key of a file.

    Raises:
        ModelFileError: there is none.
    """
    values = dict[str, Any]()
    with suppress(ModelFileError):  # which would tell of parts
        values = _tables(f"{key} = {text}")
    if list(values) != [key] or not isinstance(values[key], dict):
        raise ModelFileError(f"{key} is {_shown(text)}. Write a table as {{ x = [0.0, 1.0], y = [0.0, 5.0] }}.")
    return _table(key, values[key])


def write(model: ModelText) -> str:
    """The text of a model: `read` of it is the same model, numbers to the last bit; equal models give equal texts."""
    lines = [f"format = {FORMATS[bool(model.modules)]}", f"name = {_quoted(model.name)}"]
    lines += [f"modules = [{', '.join(map(_quoted, model.modules))}]"] if model.modules else []
    lines += [f"ports = [{', '.join(map(_quoted, model.ports))}]"] if model.ports else []
    lines += [f"impacts = {_quoted(model.impacts)}"] if model.impacts != IMPACTS[0] else []
    for part in model.parts:
        lines += ["", "[[part]]", f"type = {_quoted(part.type)}", f"name = {_quoted(part.name)}"]
        lines.append(f"nodes = [{', '.join(_quoted(node) for node in part.nodes)}]")
        lines += [] if part.symbol is None else [f"symbol = {_quoted(part.symbol)}"]
        lines += [f"{key} = {_literal(value)}" for key, value in part.parameters.items()]
    return "\n".join(lines) + "\n"


def _quoted(text: str) -> str:
    # names and laws hold printable characters alone, and of these JSON escapes what TOML escapes, in the same way
    return json.dumps(text, ensure_ascii=False)


def _literal(value: Value) -> str:
    match value:
        case str():
            return _quoted(value)
        case Table():
            return f"{{ x = {list(value.xs)}, y = {list(value.ys)} }}"
    return repr(value)


def _text_of(path: Path) -> str:
    """The text of a file, at most one byte more than allowed."""
    try:
        if not path.is_file():
            reason = "is no file" if path.exists() else f"does not exist, seen from {Path.cwd()}"
            raise FileNotFoundError(reason)
        with path.open("rb") as file:
            content = file.read(LARGEST_FILE + 1)
    except (OSError, ValueError) as error:
        raise ModelFileError(f"{path} cannot be read: {error}. Give the path of a model file.") from None
    if len(content) > LARGEST_FILE:
        raise ModelFileError(f"{path}: has more than {LARGEST_FILE} bytes. Split the model.")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise ModelFileError(f"{path}, line {line}: is not UTF-8 ({error.reason}). Save it as UTF-8.") from None


def _tables(text: str) -> dict[str, Any]:
    """What TOML makes of a text.

    Raises:
        ModelFileError: it is no TOML, or has texts of several lines or keys of several dots.
    """
    for match in _TEXT.finditer(text):
        if match.lastgroup:
            line, quote = text.count("\n", 0, match.start()) + 1, match[0]
            if match["multiline"]:
                what = f"a text stands between {quote}. Write texts on one line between single quotes."
                raise ModelFileError(f"line {line}: {what}")
            raise ModelFileError(f"line {line}: {quote!r} is not expected here. Close each text with its quote. {_USE}")
    bare = _TEXT.sub('""', text)
    if dots := _DOTS.search(bare):
        line = bare.count("\n", 0, dots.start()) + 1
        raise ModelFileError(f"line {line}: a key has dots. Use letters, digits and _. {_USE}")
    try:
        return tomllib.loads(text)
    except RecursionError:
        raise ModelFileError(f"brackets stand inside each other too deep. {_USE}") from None
    except ValueError as error:
        place = re.search(r"\(at (.*)\)$", str(error))
        reason = str(error).partition(" (at ")[0]
        where = "" if place is None else f"{place[1].split(',')[0]}: "
        raise ModelFileError(f"{where}this is no TOML: {reason}. {_USE}") from None


def _part_lines(text: str) -> list[dict[str, int]]:
    """Lines of each part's header, under "", and of its keys, counted from 1."""
    parts: list[dict[str, int]] = []
    for number, line in enumerate(text.split("\n"), 1):
        if (match := _LINE.match(line)) is None:
            continue
        if match["part"]:
            parts.append({"": number})
        elif parts:
            parts[-1].setdefault(match["key"], number)
    return parts


def _model(text: str, *, is_file: bool) -> ModelText:
    if len(text) > LARGEST_FILE:
        raise ModelFileError(f"there are more than {LARGEST_FILE} characters. Split the model.")
    if "=" not in text:
        what = _shown(text) if text.strip() else "an empty text"
        hint = "" if is_file else ' To read a file, give its place as pathlib.Path("crane.toml").'
        raise ModelFileError(f"{what} has no line key = value. A model starts with: format = {FORMAT}.{hint}")
    tables = _tables(text)
    if "format" not in tables:
        raise ModelFileError(f"the key format is missing. Start the file with: format = {FORMAT}")
    version = tables["format"]
    if type(version) is not int or version not in FORMATS:
        raise ModelFileError(
            f"format is {_shown(version)}, and this version reads the formats {' and '.join(map(str, FORMATS))}. "
            "Update the package if the file is newer."
        )
    keys = ("format", "name", *(["modules"] if version > FORMAT else []), "ports", "impacts")
    if unknown := [key for key in tables if key not in (*keys, "part")]:
        raise ModelFileError(
            f"the key {unknown[0]} is unknown here. Before the first [[part]] stand {', '.join(keys[:-1])} and "
            f"{keys[-1]}."
        )
    name: Any = tables.get("name")
    ports: Any = tables.get("ports", [])
    parts, lines = tables.get("part", []), _part_lines(text)
    if not isinstance(parts, list) or len(parts) != len(lines):
        raise ModelFileError(f"part is {_shown(parts)}. {_USE}")
    impacts: Any = tables.get("impacts", IMPACTS[0])
    texts = tuple(_part(table, places) for table, places in zip(parts, lines, strict=True))
    modules: Any = tables.get("modules", [])
    lists = (tuple(names) if isinstance(names, list) else names for names in (ports, modules))
    ports, modules = lists
    return ModelText(name, texts, ports, impacts, modules)


def _part(table: dict[str, Any], lines: Mapping[str, int]) -> PartText:
    fields: dict[str, Any] = {key: table.get(key) for key in _RESERVED}
    kind, name, nodes, symbol = fields.values()
    try:
        parameters = {
            key: _table(key, value) if isinstance(value, dict) else value
            for key, value in table.items()
            if key not in _RESERVED
        }
        return PartText(kind, name, tuple(nodes) if isinstance(nodes, list) else nodes, parameters, symbol, lines)
    except ModelFileError as error:
        line = lines.get(str(error).split(maxsplit=1)[0], lines[""])
        raise ModelFileError(f"line {line}, part {_shown(name) if name else 'without a name'}: {error}") from None


def _table(key: str, value: dict[str, Any]) -> Table:
    columns = list(value.values())
    numbers = [item for column in columns if isinstance(column, list) for item in column]
    if list(value) != ["x", "y"] or not all(isinstance(column, list) for column in columns):
        raise ModelFileError(f"{key} is {_shown(value)}. Write a table as {{ x = [0.0, 1.0], y = [0.0, 5.0] }}.")
    if wrong := [item for item in numbers if type(item) not in (int, float)]:
        raise ModelFileError(f"{key} has {_shown(wrong[0])} in its table. Tables hold numbers alone.")
    try:
        return Table(*columns)
    except ParameterError as error:
        raise ModelFileError(f"{key} has a wrong table. {error}") from None


def _check_name(key: str, value: Any) -> None:
    if not isinstance(value, str):
        missing = "is missing" if value is None else f"is {_shown(value)}"
        raise ModelFileError(f'{key} {missing}. Write names as texts in quotes, such as "shaft".')
    if not is_name(value):
        raise ModelFileError(
            f"{key} is {_shown(value)}. Use 1 to {MAXIMUM_NAME} printable characters, without line ends and tabs."
        )


def _checked(key: str, value: Any) -> Value:
    """A parameter's value as it can stand in a file."""
    if not isinstance(key, str) or not _KEY.fullmatch(key) or key in _RESERVED or len(key) > 64:
        raise ModelFileError(f"{key} is no name of a parameter. Use letters, digits and _, not {', '.join(_RESERVED)}.")
    match value:
        case bool():
            raise ModelFileError(f"{key} is {_shown(value)}, which is no number. Write 0, 1 or a text.")
        case int() if abs(value) < 2**63:  # as TOML has them
            return int(value)
        case float() if math.isfinite(value):
            return float(value)
        case str() if len(value) > LIMITS.length:
            raise ModelFileError(
                f"{key} has {len(value)} characters, more than {LIMITS.length}. Use a Table of fewer points."
            )
        case str() if value.isprintable():
            return value
        case Table():
            return value
    raise ModelFileError(
        f"{key} is {_shown(value)}. Give a finite number (integers to 2**63 - 1), a text of printable characters, or a "
        "table { x = [...], y = [...] }."
    )


def _shown(value: Any) -> str:
    """A value as the file writes it, shortened."""
    words = {True: "true", False: "false"}
    try:
        shown = words[value] if isinstance(value, bool) else repr(value)
    except ValueError:  # Python writes no integer of more than 4300 digits, which TOML has in hexadecimal
        shown = "an endless integer"
    return shown if len(shown) <= 60 else f"{shown[:57]}..."
