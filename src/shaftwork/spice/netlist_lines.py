"""Lines of netlists: comments, continuations and subcircuits resolved, words split; each knows where it stands."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from shaftwork.core.errors import ModelFileError
from shaftwork.network.netlist import first_few

LARGEST_TEXT, MOST_ELEMENTS, DEEPEST = 2_500_000, 20_000, 20
"""Characters of a netlist, elements with those of its subcircuits, and subcircuits inside each other."""
REFERENCES = ("0", "gnd")
_WORD = re.compile(r"\{[^{}]*\}|'[^']*'|\"[^\"]*\"|[^\s(),={}'\"]+|[=(){}'\"]")
_ELEMENT = re.compile(r"[rlcvi]\w*\s+\S+\s+\S+\s+(?:dc\s+)?[-+.\d]\S*$", re.IGNORECASE)
ENDS = {"r": 2, "l": 2, "c": 2, "v": 2, "i": 2, "d": 2, "e": 4, "g": 4, "s": 4, "t": 4, "f": 2, "h": 2, "k": 0, "b": 2}
"""How many nodes an element has behind its name, by its first letter."""
ANALYSES = (
    *(
        "ac",
        "csparam",
        "dc",
        "disto",
        "fft",
        "four",
        "hb",
        "lin",
        "meas",
        "measure",
        "nodeset",
        "noise",
        "op",
        "opt",
        "option",
    ),
    *("options", "plot", "print", "probe", "pss", "pz", "save", "sens", "step", "tf", "title", "width"),
)
"""Commands that change nothing in the circuit and its motion, which are left out."""


class LineError(ModelFileError):
    """What cannot be read in a line."""

    def __init__(self, line: NetlistLine, why: str) -> None:
        self.number = line.number
        text = line.text if len(line.text) <= 80 else f"{line.text[:77]}..."
        super().__init__(f"line {line.number} '{text}': {why}")


@dataclass(frozen=True)
class Scope:
    """The parameters of a circuit or of one instance of a subcircuit: they read each other, in whatever order.

    Args:
        outer: that of the circuit around it.
        texts: by name the line that says a parameter, and its text.
        numbers: what has been read of them so far, and what was given as numbers.
        reading: names that are being read, each for the one before it.
    """

    outer: Scope | None = None
    texts: dict[str, tuple[NetlistLine, str]] = field(default_factory=dict)
    numbers: dict[str, Any] = field(default_factory=dict)
    reading: list[str] = field(default_factory=list)

    def add(self, line: NetlistLine, pairs: Mapping[str, str]) -> None:
        """Take in the parameters of a line; a later one of a name wins, as in ngspice, but not over a number."""
        self.texts.update({name: (line, text) for name, text in pairs.items() if name not in self.numbers})


@dataclass(frozen=True)
class NetlistLine:
    """A line with those that continue it.

    Args:
        number: of its first line in the text, from 1.
        text: as it stands, without comments.
        words: names, numbers and expressions; "=" and parentheses are words of their own.
        prefix: of an element of a subcircuit, the name of this with a dot.
        nodes: of an element of a subcircuit, the nodes outside by those inside.
        scope: of an element of a subcircuit, its parameters.
    """

    number: int
    text: str
    words: tuple[str, ...]
    prefix: str = ""
    nodes: Mapping[str, str] = field(default_factory=dict)
    scope: Scope | None = None

    def in_scope(self, name: str) -> Iterator[str]:
        """A name as it is in the subcircuit of this line, in that around it, and so on to the outermost."""
        parts = self.prefix.lower().split(".")[:-1]
        for count in range(len(parts), -1, -1):
            yield ".".join((*parts[:count], name.lower()))

    @property
    def command(self) -> str:
        """Its first word, without case."""
        return self.words[0].lower()

    def error(self, why: str) -> LineError:
        """The error of something in it."""
        return LineError(self, why)

    def node(self, name: str) -> str:
        """The name of a node in the whole circuit."""
        plain = name.lower()
        if plain in REFERENCES:
            return "0"
        return self.nodes.get(plain, f"{self.prefix}{plain}")

    def pairs(self, start: int) -> dict[str, str]:
        """The words from a place on as key = value.

        Raises:
            LineError: they are no pairs.
        """
        words = [word for word in self.words[start:] if word not in "()"]
        keys, signs, values = words[::3], words[1::3], words[2::3]
        if len(keys) != len(values) or any(sign != "=" for sign in signs):
            raise self.error(f"'{' '.join(words)}' is not of the form key=value key=value")
        return {key.lower(): value for key, value in zip(keys, values, strict=True)}

    def parameters(self) -> dict[str, str]:
        """What a .param says: expressions of several words too, with or without braces.

        Raises:
            LineError: it is not of the form name=expression.
        """
        before, *pairs = re.split(r"([A-Za-z_]\w*)\s*=", self.text)
        if before.strip().lower() != self.command or not pairs:
            raise self.error("parameters are written .param name=expression")
        return {name.lower(): text.strip(" ,\t") for name, text in zip(pairs[::2], pairs[1::2], strict=True)}


@dataclass(frozen=True)
class Subcircuit:
    """The definition of a subcircuit: its line, its nodes, its parameters by default and its lines."""

    line: NetlistLine
    nodes: tuple[str, ...]
    values: Mapping[str, str]
    lines: tuple[NetlistLine, ...]


def lines_of(text: str, *, lcapy: bool) -> tuple[NetlistLine, ...]:
    """The lines of a text that mean something, in their order.

    Raises:
        ModelFileError: it is too long, or its first line in SPICE is no title.
    """
    if len(text) > LARGEST_TEXT:
        raise ModelFileError(f"the netlist has {len(text)} characters, more than {LARGEST_TEXT}. Split it.")
    return tuple(_plain_lines(text) if lcapy else _spice_lines(text))


def _plain_lines(text: str) -> Iterator[NetlistLine]:
    """Lines of lcapy: what stands behind a semicolon is drawing, what begins with # or % a comment."""
    for number, row in enumerate(text.splitlines(), 1):
        content, _, drawing = row.partition(";")
        hints = [hint.strip() for hint in drawing.split(",")]
        if content.strip() and content.strip()[0] not in "#%*" and "nosim" not in hints:
            yield NetlistLine(number, content.strip(), tuple(_WORD.findall(content)) or (content.strip(),))


def _spice_lines(text: str) -> Iterator[NetlistLine]:
    rows = text.splitlines()
    if rows and _ELEMENT.match(rows[0].strip()):
        raise NetlistLine(1, rows[0].strip(), ("",)).error(
            "the first line of SPICE is its title, not an element. Add one above"
        )
    joined: list[tuple[int, str]] = []
    for number, row in enumerate(rows[1:], 2):
        content = re.split(r";|\s\$\s|\s//\s", row)[0].strip()
        if content.startswith("+") and joined:
            first, before = joined[-1]
            joined[-1] = (first, f"{before} {content[1:].strip()}")
        elif content and content[0] not in "*#$":
            joined.append((number, content))
    skipped = False
    for number, content in joined:
        line = NetlistLine(number, content, tuple(_WORD.findall(content)) or (content,))
        if line.command == ".end":
            return
        if line.command in (".control", ".endc"):
            skipped = line.command == ".control"
        elif not skipped:
            yield line


def flattened(lines: tuple[NetlistLine, ...], parameters: Scope) -> tuple[NetlistLine, ...]:
    """The lines with those of subcircuits in place of their instances, around which are the parameters.

    Raises:
        LineError: a subcircuit is not there, does not end, has other nodes, or has too much in it.
    """
    everywhere = {word.lower(): word.lower() for line in lines if line.command == ".global" for word in line.words[1:]}
    outer, definitions = _definitions([line for line in lines if line.command != ".global"])
    flat: list[NetlistLine] = []
    for line in _expanded(outer, definitions, everywhere, parameters, 0):
        flat.append(line)
        if len(flat) > MOST_ELEMENTS:
            raise line.error(f"there are more than {MOST_ELEMENTS} elements, with those of subcircuits")
    return tuple(flat)


def _definitions(lines: list[NetlistLine]) -> tuple[list[NetlistLine], dict[str, Subcircuit]]:
    outer: list[NetlistLine] = []
    definitions: dict[str, Subcircuit] = {}
    inside: list[NetlistLine] = []
    opening: NetlistLine | None = None
    for line in lines:
        if line.command == ".subckt":
            if opening is not None or len(line.words) < 2:
                raise line.error("a subcircuit is named, .subckt name nodes, and not defined in another one")
            opening, inside = line, []
        elif line.command == ".ends" and opening is not None:
            definition = _subcircuit(opening, tuple(inside))
            if (first := definitions.setdefault(opening.words[1].lower(), definition)) is not definition:
                raise opening.error(
                    f"line {first.line.number} defines this subcircuit, too, and ngspice would take that. Rename one"
                )
            opening = None
        elif line.command == ".ends":
            raise line.error("no subcircuit begins before it")
        else:
            (outer if opening is None else inside).append(line)
    if opening is not None:
        raise opening.error("the subcircuit does not end. Write .ends behind its last line")
    return outer, definitions


def _subcircuit(line: NetlistLine, lines: tuple[NetlistLine, ...]) -> Subcircuit:
    names, start = _before_pairs(line, 2)
    return Subcircuit(line, tuple(map(str.lower, names)), line.pairs(start), lines)


def _before_pairs(line: NetlistLine, start: int) -> tuple[tuple[str, ...], int]:
    """The words of a line before those of the form key = value, and where these begin."""
    words = line.words
    first = next((k for k in range(start, len(words)) if words[k : k + 1] == ("=",)), len(words) + 1) - 1
    names = tuple(word for word in words[start:first] if word.lower() not in ("params:", "params"))
    return names, first


def _expanded(
    lines: Sequence[NetlistLine],
    definitions: Mapping[str, Subcircuit],
    everywhere: Mapping[str, str],
    outer: Scope,
    depth: int,
) -> Iterator[NetlistLine]:
    for line in lines:
        if line.command[0] != "x":
            yield line
            continue
        names, start = _before_pairs(line, 1)
        if not names:
            raise line.error("it names no subcircuit. Write X1 nodes name")
        *nodes, name = names
        definition = definitions.get(name.lower())
        if definition is None:
            there = first_few([*definitions]) or "none"
            raise line.error(f"there is no subcircuit '{name}'. Defined in this netlist: {there}")
        if len(nodes) != len(definition.nodes):
            raise line.error(f"it has {len(nodes)} nodes, but subcircuit '{name}' has {len(definition.nodes)}")
        if depth >= DEEPEST:
            raise line.error(f"subcircuits are inside each other more than {DEEPEST} times")
        prefix = f"{line.prefix}{line.words[0]}."
        outside = {**everywhere, **dict(zip(definition.nodes, map(line.node, nodes), strict=True))}
        scope = Scope(outer)
        scope.add(definition.line, definition.values)
        pairs = line.pairs(start)
        if "m" in pairs.keys() - definition.values.keys():
            raise line.error("M puts several of a subcircuit in parallel, which is not read. Write them one by one")
        for one in (one for one in definition.lines if one.command == ".param"):
            scope.add(one, one.parameters())
        scope.add(line, pairs)  # read inside too, as in ngspice
        circuit = (one for one in definition.lines if one.command != ".param")
        inner = [NetlistLine(one.number, one.text, one.words, prefix, outside, scope) for one in circuit]
        yield from _expanded(inner, definitions, everywhere, scope, depth + 1)
