"""Variants in the same modes, which go on side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shaftwork.codegen.elements import Array
from shaftwork.pipeline.phases.assemblies import ModeNames

LEARNED = 32
"""Variants, and steps of each, from which it is learned what makes for many steps."""

Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Group:
    """Variants in the same modes, ready to go on.

    Args:
        modes: of every element; empty where nothing changes its mode.
        lanes: (k,) numbers of the variants.
        t: (k,) s.
        x: (n, k) states.
        halvings: of the time from sample to sample.
    """

    modes: ModeNames
    lanes: Index
    t: Array
    x: Array
    halvings: int = 0

    def some(self, on: Mask | Index) -> Group:
        """Those of the lanes (k,) that are marked, or those that are named."""
        return Group(self.modes, self.lanes[on], self.t[on], self.x[:, on], self.halvings)


def joined(groups: Sequence[Group]) -> list[Group]:
    """Groups in the same modes as one."""
    alike: dict[tuple[ModeNames, int], list[Group]] = {}
    for group in groups:
        if group.lanes.size:
            alike.setdefault((group.modes, group.halvings), []).append(group)
    return [
        Group(
            modes,
            np.concatenate([one.lanes for one in several]),
            np.concatenate([one.t for one in several]),
            np.concatenate([one.x for one in several], axis=1),
            halvings,
        )
        for (modes, halvings), several in alike.items()
    ]


class Pace:
    """Which variants take many steps, so that those beside each other take a like number: lanes wait for the slowest.

    What comes out for a variant does not depend on those beside it.
    """

    def __init__(self) -> None:
        self._slopes: Array | None = None

    def learn(self, columns: Array, steps: Index) -> None:
        """Fit a plane to the steps (k,) that variants (names, k) have taken; once."""
        if self._slopes is None and steps.size >= LEARNED and steps.mean() >= LEARNED:
            size = columns.std(axis=1)
            size[size == 0.0] = 1.0
            scaled = (columns - columns.mean(axis=1)[:, None]) / size[:, None]
            self._slopes = np.linalg.lstsq(scaled.T, steps - steps.mean(), rcond=None)[0] / size

    def order(self, columns: Array) -> Index:
        """(k,) variants (names, k) by the steps that are to be expected; as they are until something is known."""
        if self._slopes is None:
            return np.arange(columns.shape[1])
        return np.argsort(self._slopes @ columns, kind="stable")
