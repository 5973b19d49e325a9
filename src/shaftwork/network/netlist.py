"""The network: its builder, the only mutable object of the library; the netlist, which is frozen; names in messages."""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from functools import cached_property
from itertools import chain, count
from typing import Any, Literal, Self, TypeVar, get_args, overload

from shaftwork.components.base import Component
from shaftwork.components.modes import ModeChoice
from shaftwork.components.tables import Table
from shaftwork.core.errors import ParameterError, ShaftworkError
from shaftwork.core.screen import counted, on_one_screen

REFERENCE = "ground"
"""The node name that stands for the reference of every domain (speed zero)."""


@dataclass(frozen=True)
class Origin:
    """Where a part stands in a model file.

    Args:
        file: its path.
        lines: that of the part under "", and that of each parameter.
    """

    file: str
    lines: Mapping[str, int]

    def of(self, parameter: str = "") -> str:
        """The place of a parameter in words, "crane.toml, line 8"; of the part where it is not in the file."""
        return f"{self.file}, line {self.lines.get(parameter, self.lines[''])}"


@dataclass(frozen=True)
class Placed:
    """A component and the nodes at its ports, in the order of the ports.

    Args:
        part: the component.
        nodes: one for each port.
        choices: of a part with modes, what is chosen for each of its elements; by default its first modes.
        origin: where it stands in a model file, if it comes from one.
    """

    part: Component
    nodes: tuple[str, ...]
    choices: tuple[ModeChoice, ...] = ()
    origin: Origin | None = field(default=None, compare=False, repr=False)


Impacts = Literal["in turn", "together"]
"""How rigid contacts that touch are hit; see `Netlist`."""
IMPACTS: tuple[Impacts, ...] = get_args(Impacts)


@dataclass(frozen=True)
class Netlist:
    """An ordered list of placed components under a name.

    Args:
        name: of the network.
        placed: its components.
        ports: the nodes at which it is joined to other networks.
        impacts: "in turn": what touches is hit after what hits it, as in a row of balls; "together": in one instant.
        free_modes: whether the numbers of first modes are parameters, so that equations hold in modes of equal form.
    """

    name: str
    placed: tuple[Placed, ...]
    ports: tuple[str, ...] = ()
    impacts: Impacts = IMPACTS[0]
    free_modes: bool = False

    def within(self, name: str, nodes: tuple[str, ...]) -> tuple[Placed, ...]:
        """The parts as those of another network, named "name.part".

        Args:
            name: of this network in the other.
            nodes: of the other network, one for each port.

        Raises:
            ParameterError: there are no ports, another number of nodes, or a port is no node.
        """
        if not self.ports:
            raise ParameterError(
                f"Network '{self.name}' has no ports. Name the nodes at which it is joined to others: "
                f"Network('{self.name}', ports=('in_', 'out'))."
            )
        if len(nodes) != len(self.ports):
            pattern = ", ".join(f"'node {port}'" for port in self.ports)
            raise ParameterError(
                f"Network '{self.name}' is given {len(nodes)} nodes, but its ports are: {', '.join(self.ports)}. "
                f"Write net.add(part, {pattern}, name='{name}')."
            )
        inside = dict.fromkeys(node for item in self.placed for node in item.nodes)
        if strange := [port for port in self.ports if port not in inside or port == REFERENCE]:
            names = ", ".join(node for node in inside if node != REFERENCE)
            raise ParameterError(f"Network '{self.name}': its port '{strange[0]}' is no node. Its nodes are: {names}.")
        outside = {**{node: f"{name}.{node}" for node in inside}, REFERENCE: REFERENCE}
        outside |= dict(zip(self.ports, nodes, strict=True))
        renamed = {**outside, **{item.part.name: f"{name}.{item.part.name}" for item in self.placed}}

        def moved(item: Placed) -> Placed:
            return replace(item, part=item.part.within(renamed), nodes=tuple(outside[node] for node in item.nodes))

        return tuple(map(moved, self.placed))

    def with_values(self, values: Mapping[str, Any]) -> Netlist:
        """The same parts with some parameters, "part.name", replaced."""
        changed = by_part(values)
        return self.with_parts(lambda part: replace(part, **changed[part.name]) if part.name in changed else part)

    def with_parts(self, change: Callable[[Component], Component]) -> Netlist:
        """The same network with what a function makes of each part, at the same nodes and in the same modes."""
        return replace(self, placed=tuple(replace(item, part=change(item.part)) for item in self.placed))

    def with_choices(self, choices: Mapping[str, tuple[ModeChoice, ...]]) -> Netlist:
        """The same parts with what is chosen for those that have modes, by name of the part."""
        placed = (replace(item, choices=choices.get(item.part.name, item.choices)) for item in self.placed)
        return replace(self, placed=tuple(placed))


def by_part(values: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Values of "part.parameter", for each part by parameter."""
    parts: dict[str, dict[str, Any]] = {}
    for name, value in values.items():
        owner, _, parameter = name.rpartition(".")
        parts.setdefault(owner, {})[parameter] = value
    return parts


def overview(netlist: Netlist) -> str:
    """The parts of a network, a line each, as many as a screen has room for."""
    nodes = {node for placed in netlist.placed for node in placed.nodes if node != REFERENCE}  # only counted
    ports = f", ports {', '.join(netlist.ports)}" if netlist.ports else ""
    sizes = f"{counted(len(netlist.placed), 'part')} at {counted(len(nodes), 'node')}"
    return on_one_screen(f"Network '{netlist.name}': {sizes}{ports}", _lines(netlist.placed), len(netlist.placed))


def _lines(placed: tuple[Placed, ...]) -> Iterator[str]:
    shown = placed[:30]  # widths of columns are those of what is shown
    rows = [(type(item.part).__name__, str(item.part.name), ", ".join(map(str, item.nodes))) for item in shown]
    widths = [max(len(row[column]) for row in rows) for column in range(3)] if rows else []
    for item, row in zip(shown, rows, strict=True):
        columns = (text.ljust(min(width, 30)) for text, width in zip(row, widths, strict=True))
        yield f"  {'  '.join(columns)}  {_values(item.part)}".rstrip()


def _values(part: Component) -> str:
    """The values of a part that are not those by default."""
    values = ((name, getattr(part, name), declared.default) for name, declared in part.declared.items())
    return ", ".join(f"{name}={_short(value)}" for name, value, default in values if not _is(value, default))


def _is(value: Any, default: Any) -> bool:
    alike = type(value) is type(default) or (isinstance(value, int | float) and isinstance(default, int | float))
    return value is default or (alike and bool(value == default))


def _short(value: Any) -> str:
    if isinstance(value, Table):
        return f"Table of {len(value.xs)} points"
    text = f"{value:.6g}" if isinstance(value, float) else str(value)
    return text if len(text) <= 30 else f"{text[:27]}..."


MAXIMUM_NAME = 200
"""Characters of a name of a part, node, type or symbol."""
SHORTEST = 4
"""Letters of a name that another may be a slip of: of shorter ones too many are alike."""


def is_name(value: object) -> bool:
    """Whether something can name a part or a node: 1 to `MAXIMUM_NAME` printable characters."""
    return isinstance(value, str) and 0 < len(value) <= MAXIMUM_NAME and value.isprintable() and bool(value.strip())


def title(part: Component) -> str:
    """A part as messages name it: "Gear 'stage 1'"."""
    return f"{type(part).__name__} '{part.name}'"


def unused(name: str, taken: Container[str], pattern: str = "{} {}") -> str:
    """A name, or with the first number behind it, from 2, that makes it another than those that are taken."""
    numbered = chain((name,), (pattern.format(name, number) for number in count(2)))
    return next(candidate for candidate in numbered if candidate not in taken)


def listed(names: Sequence[str], most: int = 6) -> str:
    """Names in quotes; of many, the first few and the number of the others."""
    return first_few([f"'{name}'" for name in names], most)


def first_few(texts: Sequence[str], most: int = 3, separator: str = ", ") -> str:
    """The first few of some texts, and the number of the others."""
    return separator.join(texts[:most]) + (f" and {len(texts) - most} more" if len(texts) > most else "")


def at_nodes(names: Sequence[str]) -> str:
    """Nodes as messages name them: "nodes 'rotor', 'wheel'"."""
    return f"node{'s' * (len(names) > 1)} {listed(names)}" if names else "no node"


class Spelling:
    """Node names that may stand for another by a slip: one letter, case or spaces, or the begin of the other alone."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names

    @cached_property
    def _by_variant(self) -> dict[str, list[str]]:
        names: dict[str, list[str]] = {}
        for name in self._names:
            for variant in _variants(name):
                names.setdefault(variant, []).append(name)
        return names

    def suggestion(self, names: Sequence[str]) -> str:
        """A question in parentheses for the first of the names that is like another node, else nothing."""
        excluded = frozenset(names)
        for name in names:
            likes = (other for variant in _variants(name) for other in self._by_variant.get(variant, ()))
            for other in chain(likes, self._begun_alike(_plain(name))):
                if other not in excluded and _digits(other) == _digits(name):  # n1 and n2 are two nodes, not a slip
                    return f" (did you mean node '{other}'?)"
        return ""

    @cached_property
    def _plain(self) -> list[tuple[str, str]]:
        return [(plain, name) for name in self._names if len(plain := _plain(name)) >= SHORTEST]

    def _begun_alike(self, name: str) -> Iterator[str]:
        """The nodes whose names are the begin of this one, or begin with it."""
        if len(name) >= SHORTEST:
            yield from (other for plain, other in self._plain if plain.startswith(name) or name.startswith(plain))


def _digits(name: str) -> str:
    return "".join(filter(str.isdigit, name))


def _plain(name: str) -> str:
    return "".join(filter(str.isalnum, name.lower()))


def _variants(name: str) -> tuple[str, ...]:
    """The name without case and spaces, and all that come of it when one letter is left out."""
    plain = _plain(name)
    short = len(plain) - len(_digits(plain)) < SHORTEST
    return (plain, *(() if short else (plain[:k] + plain[k + 1 :] for k in range(len(plain)))))


C = TypeVar("C", bound=Component)
N = TypeVar("N", bound="NetworkBuilder")


class NetworkBuilder:
    """Parts and the nodes that they join.

    Args:
        name: title of the network, used in reports.
        ports: of a network that is a part of others, the nodes at which it is joined to them.
        impacts: rigid contacts that touch are hit "in turn", as a row of balls, or "together", in one instant.

    Raises:
        ParameterError: the ports are no texts, or two are the same; impacts are neither.
    """

    def __init__(self, name: str = "network", ports: Sequence[str] = (), *, impacts: Impacts = IMPACTS[0]) -> None:
        self.name, self.impacts = name, impacts
        if impacts not in IMPACTS:
            raise ParameterError(f"impacts = {impacts!r} must be one of: {', '.join(map(repr, IMPACTS))}.")
        self.ports = (ports,) if isinstance(ports, str) else tuple(ports)
        if not all(isinstance(port, str) and port for port in self.ports) or len({*self.ports}) < len(self.ports):
            raise ParameterError(f"ports = {ports!r} must be names of nodes, each once: ports=('in_', 'out').")
        self._placed: list[Placed] = []

    def __copy__(self) -> Self:
        """A network of the same parts, which are immutable; what is added, replaced or removed in one is so there."""
        copy = object.__new__(type(self))
        vars(copy).update(vars(self), _placed=[*self._placed])
        return copy

    def __eq__(self, other: object) -> bool:
        """Whether name, ports, parts and nodes are equal, in their order; not from which file they come."""
        return self.netlist() == other.netlist() if isinstance(other, NetworkBuilder) else NotImplemented

    __hash__ = None  # type: ignore[assignment]  # what can be changed must not be found by what it was

    @overload
    def add(self, part: C, *nodes: str) -> C: ...

    @overload
    def add(self, part: N, *nodes: str, name: str = "") -> N: ...

    def add(self, part: C | N, *nodes: str, name: str = "") -> C | N:
        """Add a part with its ports at the given nodes, which come to be when first named.

        A network with ports is added part by part, as it stands: what was named "shaft" in it is "first.shaft" then,
        and so are its nodes but for the ports, which become the given nodes.

        Args:
            part: a component, or a network with ports.
            *nodes: one node name for each port, in the order of the ports; "ground" is the frame (speed zero).
            name: of a network within this one, "first"; by default its own.

        Returns:
            The part.

        Raises:
            ShaftworkError: `part` is neither, a node is no text, or a network is not joined at each of its ports.
                Everything else that may be wrong with a network is reported together by `check`.
        """
        if not isinstance(part, Component | NetworkBuilder):
            raise ShaftworkError(
                f"add() takes a component such as Inertia('J1', J=1.0), not {type(part).__name__} {part!r}."
            )
        if strange := [node for node in nodes if not isinstance(node, str) or not node]:
            raise ShaftworkError(
                f"{type(part).__name__} '{part.name}': a node is named by a text, not by {strange[0]!r}. "
                f"Write net.add(part, 'rotor', 'wheel')."
            )
        if isinstance(part, NetworkBuilder):
            self._placed += part.netlist().within(name or part.name, nodes)
        elif name:
            raise ShaftworkError(
                f"name = {name!r} is for networks within networks: a part has its name, '{part.name}'."
            )
        else:
            self._placed.append(Placed(part, nodes))
        return part

    def remove(self, name: str) -> None:
        """Remove a part, or a network within this one with all its parts. Nodes where nothing is left are no more.

        Raises:
            ParameterError: there is none of this name; the message says what there is.
        """
        numbers = self._numbers(name) or [
            number for number, placed in enumerate(self._placed) if str(placed.part.name).startswith(f"{name}.")
        ]
        if not numbers:
            raise self._unknown(name)
        self._placed = [placed for number, placed in enumerate(self._placed) if number not in numbers]

    def replace(self, part: C) -> C:
        """Put a part in the place of the one of its name, at the same nodes.

        Returns:
            The part.

        Raises:
            ShaftworkError: `part` is no component.
            ParameterError: there is none of its name, or there are several; the message says what there is.
        """
        if not isinstance(part, Component):
            raise ShaftworkError(f"replace() takes a component such as Inertia('J1', J=1.0), not {part!r}.")
        numbers = self._numbers(part.name)
        if not numbers:
            raise self._unknown(part.name)
        if len(numbers) > 1:
            raise ParameterError(f"'{self.name}' has {len(numbers)} parts named '{part.name}'. Rename them first.")
        self._placed[numbers[0]] = replace(self._placed[numbers[0]], part=part)
        return part

    def _numbers(self, name: str) -> list[int]:
        return [number for number, placed in enumerate(self._placed) if placed.part.name == name]

    def _unknown(self, name: str) -> ParameterError:
        names = [str(placed.part.name) for placed in self._placed]
        names = get_close_matches(str(name), names, n=3) or names[:12]
        return ParameterError(
            f"There is no part '{name}' in '{self.name}'. Close to it: {', '.join(names) or 'none, it has no parts'}."
        )

    @property
    def parts(self) -> tuple[Component, ...]:
        """The parts in the order in which they were added."""
        return tuple(placed.part for placed in self._placed)

    @property
    def nodes(self) -> tuple[str, ...]:
        """The nodes in the order in which they were first named."""
        return tuple(dict.fromkeys(node for placed in self._placed for node in placed.nodes))

    def netlist(self) -> Netlist:
        """The network as it stands, frozen."""
        return Netlist(self.name, tuple(self._placed), self.ports, self.impacts)

    def __repr__(self) -> str:
        return overview(self.netlist())
