"""Series of equal rows: rows that differ by a running number alone are printed as one general row."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

from shaftwork.equations.spelling import INDEX_CLOSES, INDEX_OPENS
from shaftwork.latex.printing import Line

INDEX = re.compile(f"{INDEX_OPENS}([0-9]+){INDEX_CLOSES}")
Numbers = tuple[int, ...]


@dataclass(frozen=True)
class Series:
    """Rows that differ by a running number alone.

    Args:
        members: the place of the row of each number, numbers rising.
        running: for each index in a row whether it runs; the first that runs is the number itself.
    """

    members: Mapping[int, int]
    running: tuple[bool, ...]

    @property
    def first(self) -> int:
        """The place of the row that stands before all others."""
        return min(self.members.values())

    @cached_property
    def stretches(self) -> tuple[Numbers, ...]:
        """The numbers in order, those of equal distance together where that is shorter than to list them."""
        return tuple(_stretches(tuple(self.members)))


def shortened(lines: Sequence[Line]) -> tuple[Line, ...]:
    """The lines with every series as one general row and its numbers (Popenda 2019, (2) and (4)).

    A series stands where its first row stood; all other rows keep their order.
    """
    series = series_in([line.text for line in lines])
    inside = replaced(series)
    return tuple(
        _general(lines, series[place]) if place in series else line
        for place, line in enumerate(lines)
        if place in series or place not in inside
    )


def series_in(texts: Sequence[str]) -> dict[int, Series]:
    """The series among texts by the place of their first member."""
    families: dict[str, dict[int, Numbers]] = {}
    for place, text in enumerate(texts):
        if numbers := tuple(map(int, INDEX.findall(text))):
            families.setdefault(INDEX.sub(INDEX_OPENS, text), {})[place] = numbers
    return {series.first: series for family in families.values() for series in _series_of(family)}


def replaced(series: Mapping[int, Series]) -> frozenset[int]:
    """The places of all members of some series."""
    return frozenset(place for each in series.values() for place in each.members.values())


def listed(stretch: Numbers, text: Callable[[int], str], dots: str) -> str:
    """The members of a stretch as people list them: "1", "1, ..., 9" or, of every second, "1, 3, ..., 9"."""
    if len(stretch) == 1:
        return text(stretch[0])
    before = stretch[:1] if stretch[1] == stretch[0] + 1 else stretch[:2]
    return ", ".join((*map(text, before), dots, text(stretch[-1])))


def _series_of(family: Mapping[int, Numbers]) -> Iterator[Series]:
    """The series in texts that are the same but for their indices, longest first."""
    shortest = 5  # fewer equal rows are printed one by one
    left = dict(family)
    while len(left) >= shortest:
        longest = max(_candidates(left), key=lambda series: len(series.members))
        if len(longest.members) < shortest:
            return
        # Numbers with more than six gaps do not fit on a line: the rest is a series of its own.
        numbers = dict.fromkeys(number for stretch in longest.stretches[:6] for number in stretch)
        yield Series({number: longest.members[number] for number in numbers}, longest.running)
        for number in numbers:
            del left[longest.members[number]]


def _candidates(family: Mapping[int, Numbers]) -> Iterator[Series]:
    """For each set of indices that may run together the texts in which they do and all other indices stay."""
    vectors = list(family.values())
    pairs = itertools.pairwise(vectors)
    changing = (tuple(a != b for a, b in zip(before, after, strict=True)) for before, after in pairs)
    for running in dict.fromkeys(((True,) * len(vectors[0]), *changing)):
        if not any(running):
            continue
        alike: dict[Numbers, dict[int, int]] = {}
        for place, numbers in family.items():
            base = numbers[running.index(True)]
            offsets = tuple(number - base * runs for number, runs in zip(numbers, running, strict=True))
            alike.setdefault(offsets, {}).setdefault(base, place)
        members = max(alike.values(), key=len)
        yield Series(dict(sorted(members.items())), running)


def _stretches(numbers: Numbers) -> Iterator[Numbers]:
    """Rising numbers as stretches of equal distance; a number that is in none is a stretch of its own."""
    start = 0
    while start < len(numbers):
        end = start + 1
        while end < len(numbers) and numbers[end] - numbers[end - 1] == numbers[start + 1] - numbers[start]:
            end += 1
        # Fewer than four numbers of equal distance are listed one by one.
        if end - start < 4:
            end = start + 1
        yield numbers[start:end]
        start = end


def _general(lines: Sequence[Line], series: Series) -> Line:
    """The row with running number k; j where it sums over orders k."""
    letter = "j" if any(r"\sum_{k}" in piece for piece in lines[series.first].pieces) else "k"
    number, place = next((number, place) for number, place in series.members.items() if place == series.first)
    running = iter(series.running)

    def general(match: re.Match[str]) -> str:
        return f"{letter}{int(match[1]) - number:+d}".removesuffix("+0") if next(running) else match[1]

    line = lines[place].mapped(lambda text: INDEX.sub(general, text))
    numbers = ", ".join(listed(stretch, str, r"\dots") for stretch in series.stretches)
    return replace(line, remark=r" \quad ".join(filter(None, (line.remark, rf"\text{{for }} {letter} = {numbers}"))))
