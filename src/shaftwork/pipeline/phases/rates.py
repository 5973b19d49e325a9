"""The right-hand side of a phase, for engines in Python: one that is asked for often gets code of its own."""

from __future__ import annotations

from collections.abc import Callable
from itertools import count
from typing import TYPE_CHECKING

import numpy as np

from shaftwork.codegen.elements import Array
from shaftwork.codegen.model import ScalarProgram

if TYPE_CHECKING:
    from shaftwork.pipeline.phases.assemblies import Motion

FEW = 50
"""Right-hand sides that are not worth code of their own."""


def rates_of(program: ScalarProgram, motion: Motion, p: Array) -> Callable[[float, Array], Array]:
    """The right-hand side with its parameters.

    Args:
        program: the equations.
        motion: rates and guards, with parameters.
        p: the parameters.
    """
    asked, own = count(), list[Callable[[float, Array], Array]]()

    def rates(t: float, x: Array) -> Array:
        if next(asked) < FEW:
            return np.array(motion(t, x.tolist())[0])
        if not own:
            own.append(program.bind(p))
        return own[0](t, x)

    return rates
