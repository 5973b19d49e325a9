"""Variables in arrays, and equal branches in a row: what a long shaft has many of is written once with an index."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from shaftwork.components.branches import End
from shaftwork.network.graph import GraphBranch

FEW = 3
"""Fewer equal rows are written one by one."""


@dataclass(frozen=True)
class IndexedPlace:
    """A variable, or an element of an array: its name and number, 0 of what is no array."""

    name: str
    number: int = 0

    def text(self, index: str = "", first: int = 0) -> str:
        """How it is written; in a loop over an index, which is `first` in the first row, by its distance from there."""
        if not self.number or not index:
            return f"{self.name}[{self.number}]" if self.number else self.name
        distance = self.number - first
        shift = f" {'+' if distance > 0 else '-'} {abs(distance)}" if distance else ""
        return f"{self.name}[{index}{shift}]"


Ends = tuple[IndexedPlace | None, IndexedPlace | None]
"""Where the across variables of the two ends of a branch stand; None is the reference."""


@dataclass
class RowGroup:
    """Equal branches: both ends of the next are the next in their rows.

    Args:
        branches: of the graph.
        word: what tells a single one from the others of its part.
    """

    branches: list[GraphBranch]
    word: str


def groups_of(branches: Sequence[GraphBranch], ends_of: Callable[[GraphBranch], Ends]) -> list[RowGroup]:
    """Branches in groups, in the order of their first ones."""
    groups: list[RowGroup] = []
    last: dict[object, tuple[RowGroup, int]] = {}
    for number, branch in enumerate(branches, 1):
        ends = ends_of(branch)
        numbers = [0 if place is None else place.number for place in ends]
        first = numbers[0] or numbers[1]
        key = (
            branch.template.kind,
            branch.template.law,
            *("" if place is None else place.name for place in ends),
            *(place and place - first for place in numbers),
        )
        group, before = last.get(key, (None, 0))
        if group is None or first != before + 1 or not _may_repeat(branch, ends):
            group = RowGroup([], str(number))
            groups.append(group)
        group.branches.append(branch)
        last[key] = group, first
    return [piece for group in groups for piece in _long_or_single(group)]


def _may_repeat(branch: GraphBranch, ends: Ends) -> bool:
    template = branch.template
    simple = not (template.terms or template.reads or template.has_integral or template.line)
    return simple and all(place is None or place.number for place in ends)


def _long_or_single(group: RowGroup) -> Iterator[RowGroup]:
    if len(group.branches) >= FEW:
        yield group
        return
    for count, branch in enumerate(group.branches):
        yield RowGroup([branch], group.word if not count else f"{group.word}_{count + 1}")


def runs_of(
    flows: Mapping[End, list[tuple[str, IndexedPlace]]], places: Mapping[End, IndexedPlace]
) -> Iterator[list[End]]:
    """Ends one after the other whose balances are equal but for the index.

    Args:
        flows: by end, what leaves it as (factor, variable).
        places: of the ends.
    """
    run: list[End] = []
    last: object = None
    for end, terms in flows.items():
        place = places[end]
        pattern = (
            place.name,
            *((factor, through.name, through.number and through.number - place.number) for factor, through in terms),
        )
        follows = bool(run) and pattern == last and place.number == places[run[-1]].number + 1
        if run and not follows:
            yield from _long_or_apart(run)
            run = []
        run.append(end)
        last = pattern
    yield from _long_or_apart(run)


def _long_or_apart(run: list[End]) -> Iterator[list[End]]:
    yield from [run] if len(run) >= FEW else ([end] for end in run)


def family(name: str) -> tuple[str, int]:
    """The word before the number at the end of a name, and the number; 0 where there is none."""
    word = re.sub(r"\d+$", "", name)
    return word, int(name[len(word) :] or 0)


def difference(ends: Ends, index: str = "", first: int = 0) -> str:
    """What is across two ends."""
    plus, minus = (None if place is None else place.text(index, first) for place in ends)
    if plus is None:
        return "0" if minus is None else f"(-{minus})"
    return plus if minus is None else f"({plus} - {minus})"


def total(terms: Sequence[tuple[str, IndexedPlace]], index: str = "", first: int = 0) -> str:
    """The sum of variables with factors "", "-" or "-(p.ratio) * "."""
    text = "".join(
        f"{' - ' if factor.startswith('-') else ' + '}{factor.removeprefix('-')}{place.text(index, first)}"
        for factor, place in terms
    )
    return text.removeprefix(" + ").removeprefix(" ") or "0"
