"""Variants in the same modes, which go on side by side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shaftwork.codegen.elements import Array
from shaftwork.pipeline.phases.mode_machines import ModeNames

Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class VariantGroup:
    """Variants in the same modes, ready to go on.

    Args:
        modes: of every element; empty where nothing changes its mode.
        lanes: (k,) numbers of the variants.
        t: (k,) s.
        x: (n, k) states.
    """

    modes: ModeNames
    lanes: Index
    t: Array
    x: Array

    def some(self, on: Mask | Index) -> VariantGroup:
        """Those of the lanes (k,) that are marked, or those that are named."""
        return VariantGroup(self.modes, self.lanes[on], self.t[on], self.x[:, on])


def joined(groups: Sequence[VariantGroup]) -> list[VariantGroup]:
    """Groups in the same modes as one."""
    alike: dict[ModeNames, list[VariantGroup]] = {}
    for group in groups:
        if group.lanes.size:
            alike.setdefault(group.modes, []).append(group)
    return [
        VariantGroup(
            modes,
            np.concatenate([one.lanes for one in several]),
            np.concatenate([one.t for one in several]),
            np.concatenate([one.x for one in several], axis=1),
        )
        for modes, several in alike.items()
    ]
