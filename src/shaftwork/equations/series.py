"""Series of equal rows: rows that differ by a running number are printed as the first, a general one and the last."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence

from shaftwork.equations.notation import INDEX_CLOSES, INDEX_OPENS
from shaftwork.equations.printing import Line

SHORTEST_SERIES = 5
"""Fewer equal rows are printed one by one."""
INDEX = re.compile(f"{INDEX_OPENS}([0-9]+){INDEX_CLOSES}")

Shape = tuple[str, ...]


def shortened(lines: Sequence[Line]) -> tuple[Line, ...]:
    """The lines with every series printed as first row, general row and last row (Popenda 2019, (2) and (4))."""
    return tuple(printed for run in runs([line.text for line in lines]) for printed in _printed(lines[run.start : run.stop]))


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


def _printed(run: Sequence[Line]) -> tuple[Line, ...]:
    if len(run) < SHORTEST_SERIES:
        return tuple(run)
    return (run[0], _general(run), run[-1])


def _general(run: Sequence[Line]) -> Line:
    """The row with running number k; the number of its left side is k itself."""
    second = run[1]
    rising = _step(run[0].text, second.text) or ()
    base = next(int(index) for index, rise in zip(INDEX.findall(second.text), rising, strict=True) if rise)
    last = base + len(run) - 3
    steps = iter(rising)

    def general(match: re.Match[str]) -> str:
        offset = int(match.group(1)) - base
        return f"k{offset:+d}".removesuffix("+0") if next(steps) else match.group(1)

    line = second.mapped(lambda text: INDEX.sub(general, text))
    return Line(line.left, line.pieces, rf"\text{{for }} k = {base}, \dots, {last}")
