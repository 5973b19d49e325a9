"""Series of equal rows: rows that differ by a running number alone are printed as one general row."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

from shaftwork.equations.notation import INDEX_CLOSES, INDEX_OPENS
from shaftwork.equations.printing import Line

SHORTEST_SERIES = 5
"""Fewer equal rows are printed one by one."""
INDEX = re.compile(f"{INDEX_OPENS}([0-9]+){INDEX_CLOSES}")


def shortened(lines: Sequence[Line]) -> tuple[Line, ...]:
    """The lines with every series as one general row and the range of its index (Popenda 2019, (2) and (4))."""
    gathered = [lines[place] for place in together([line.text for line in lines])]
    found = (gathered[run.start : run.stop] for run in runs([line.text for line in gathered]))
    return tuple(line for run in found for line in (run if len(run) < SHORTEST_SERIES else (_general(run),)))


def together(texts: Sequence[str]) -> tuple[int, ...]:
    """The places of the texts, members of long series drawn to the first of them, all else in its order."""
    families: dict[str, list[int]] = {}
    for place, text in enumerate(texts):
        if INDEX.search(text):
            families.setdefault(INDEX.sub(INDEX_OPENS, text), []).append(place)
    drawn = {family[0]: family for family in families.values() if len(family) >= SHORTEST_SERIES}
    following = {place for family in drawn.values() for place in family[1:]}
    return tuple(
        member for place in range(len(texts)) if place not in following for member in drawn.get(place, [place])
    )


def runs(texts: Sequence[str]) -> Iterator[range]:
    """Longest stretches of texts in which, from one to the next, some indices rise by one and nothing else changes."""
    start, rising = 0, None
    for place in range(1, len(texts) + 1):
        step = _step(texts[place - 1], texts[place]) if place < len(texts) else None
        if step is not None and (rising is None or rising == step):
            rising = step
            continue
        yield range(start, place)
        start, rising = place, None


def _step(before: str, after: str) -> tuple[int, ...] | None:
    """By how much each index rises, if all rise by 0 or 1 and the texts are else the same; None if not."""
    if INDEX.sub("", before) != INDEX.sub("", after):
        return None
    steps = tuple(int(b) - int(a) for a, b in zip(INDEX.findall(before), INDEX.findall(after), strict=True))
    return steps if set(steps) <= {0, 1} and any(steps) else None


def _general(run: Sequence[Line]) -> Line:
    """The row with running number k; the first number that rises is k itself."""
    first = run[0]
    rising = _step(first.text, run[1].text) or ()
    base = next(int(index) for index, rise in zip(INDEX.findall(first.text), rising, strict=True) if rise)
    steps = iter(rising)

    def general(match: re.Match[str]) -> str:
        offset = int(match.group(1)) - base
        return f"k{offset:+d}".removesuffix("+0") if next(steps) else match.group(1)

    line = first.mapped(lambda text: INDEX.sub(general, text))
    span = rf"\text{{for }} k = {base}, \dots, {base + len(run) - 1}"
    return replace(line, remark=r" \quad ".join(filter(None, (line.remark, span))))
