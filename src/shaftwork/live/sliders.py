"""Sliders: which values of parameters a page offers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import Parameter
from shaftwork.pipeline.model import Model

SPAN = 4.0
"""A slider goes from the value divided by this factor to the value times it."""


@dataclass(frozen=True)
class Slider:
    """One parameter as a page offers it; its value divides the range into two halves, each of equal ratios.

    Args:
        name: "part.parameter".
        meaning: what it is, a few words.
        unit: SI unit.
        value: of the network.
        low: the value at the left end.
        high: the value at the right end.
        whole: whether only whole numbers are admitted.
    """

    name: str
    meaning: str
    unit: str
    value: float
    low: float
    high: float
    whole: bool

    def values(self, count: int) -> list[float]:
        """At most `count` values from one end to the other, that of the network among them."""
        halves = ((self.low, self.value, count - count // 2), (self.value, self.high, count // 2 + 1))
        spread = [np.geomspace(*half) for half in halves if half[0] != half[1]]
        values = np.unique(np.concatenate([*spread, [self.value]]))
        exact = np.where(np.isclose(values, self.value, rtol=1e-12), self.value, values)
        return [float(value) for value in np.unique(np.rint(exact) if self.whole else exact)]

    def described(self) -> dict[str, Any]:
        """As the page takes it."""
        return asdict(self)


def sliders_of(model: Model) -> Mapping[str, Slider]:
    """A slider for every parameter of a model, by name, in the order of the network."""
    declared = {
        f"{item.part.name}.{key}": one for item in model.netlist.placed for key, one in item.part.declared.items()
    }
    return {name: _slider(name, declared[name], value) for name, value in model.parameters.items()}


def _slider(name: str, declared: Parameter, value: float) -> Slider:
    low, high = sorted((value / SPAN, value * SPAN))
    if declared.at_least is not None:
        low = max(low, declared.at_least or value / SPAN)  # zero is at no end of equal ratios
    if declared.above is not None and low <= declared.above:
        low = (declared.above + value) / 2
    if declared.at_most is not None:
        high = min(high, declared.at_most)
    if declared.whole:
        low, high = max(1.0, float(np.ceil(low))), float(np.floor(high))
    return Slider(name, declared.meaning, declared.unit, value, low, high, declared.whole)


def chosen(sliders: Mapping[str, Slider], names: Any) -> list[Slider]:
    """Sliders by name.

    Raises:
        ParameterError: there is none of this name, or one is there twice.
    """
    if strange := [name for name in names if name not in sliders]:
        raise ParameterError(f"There is no slider '{strange[0]}'. There are: {', '.join(sliders)}.")
    if len({*names}) < len(names):
        raise ParameterError(f"sliders = {', '.join(names)} has a name twice. Name each parameter once.")
    return [sliders[name] for name in names]
