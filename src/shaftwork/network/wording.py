"""How messages name parts and nodes, and which other node a misspelt one may stand for."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

from shaftwork.components.base import Component


def title(part: Component) -> str:
    """A part as messages name it: "Gear 'stage 1'"."""
    return f"{type(part).__name__} '{part.name}'"


def listed(names: Sequence[str], most: int = 6) -> str:
    """Names in quotes; of many, the first few and the number of the others."""
    shown = [f"'{name}'" for name in names[:most]]
    return ", ".join(shown) + (f" and {len(names) - most} more" if len(names) > most else "")


def at_nodes(names: Sequence[str]) -> str:
    """Nodes as messages name them: "nodes 'rotor', 'wheel'"."""
    return f"node{'s' * (len(names) > 1)} {listed(names)}" if names else "no node"


class Spelling:
    """Node names that may stand for another by a slip: one letter too many, missing or wrong, other case or spaces."""

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names

    @cached_property
    def _by_variant(self) -> dict[str, list[str]]:
        made: dict[str, list[str]] = {}
        for name in self._names:
            for variant in _variants(name):
                made.setdefault(variant, []).append(name)
        return made

    def suggestion(self, names: Sequence[str]) -> str:
        """A question in parentheses for the first of the names that is like another node, else nothing."""
        own = frozenset(names)
        for name in names:
            likes = (other for variant in _variants(name) for other in self._by_variant.get(variant, ()))
            for other in likes:
                if other not in own and _digits(other) == _digits(name):  # n1 and n2 are two nodes, not a slip
                    return f" (did you mean node '{other}'?)"
        return ""


def _digits(name: str) -> str:
    return "".join(filter(str.isdigit, name))


def _variants(name: str) -> tuple[str, ...]:
    """The name without case and spaces, and all that come of it when one letter is left out."""
    plain = "".join(filter(str.isalnum, name.lower()))
    short = len(plain) - len(_digits(plain)) < 4
    return (plain, *(() if short else (plain[:k] + plain[k + 1 :] for k in range(len(plain)))))
