"""How messages name parts and nodes, and which other node a misspelt one may stand for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import cached_property
from itertools import chain

from shaftwork.components.base import Component

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
