"""Sliders and fields: which values of parameters, and which start values, a page offers."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from shaftwork.core.domains import DOMAINS
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import Parameter, in_si
from shaftwork.equations.spelling import GREEK
from shaftwork.pipeline.model import Model
from shaftwork.results.observer import Observer

TWISTS = {"tau_c": "phi_rel", "f_c": "s_rel"}
"""By the elastic torque or force of a spring, which is its state, the twist or stretch that people think in."""
_GREEK = re.compile(rf"\\?(?:var)?({'|'.join(GREEK)})(?![A-Za-z])")


@dataclass(frozen=True)
class Slider:
    """One parameter as a page offers it; its value divides the range into two halves, each of equal ratios.

    Args:
        name: "part.parameter".
        symbol: its letter and subscript.
        meaning: what it is, a few words.
        unit: SI unit.
        bounds: the admissible range in words; empty where every finite number will do.
        value: of the network.
        low: the value at the left end.
        high: the value at the right end.
        whole: whether only whole numbers are admitted.
    """

    name: str
    symbol: tuple[str, str]
    meaning: str
    unit: str
    bounds: str
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


def sliders_of(model: Model, span: float = 4.0) -> Mapping[str, Slider]:
    """A slider for every parameter of a model, by name, from its value divided by `span` to its value times that."""
    declared = {
        f"{item.part.name}.{key}": one for item in model.netlist.placed for key, one in item.part.declared.items()
    }
    return {name: _slider(name, declared[name], value, span) for name, value in model.parameters.items()}


def _slider(name: str, declared: Parameter, value: float, span: float) -> Slider:
    low, high = sorted((value / span, value * span))
    if declared.at_least is not None:
        low = max(low, declared.at_least or value / span)  # zero is at no end of equal ratios
    if declared.above is not None and low <= declared.above:
        low = (declared.above + value) / 2
    if declared.at_most is not None:
        high = min(high, declared.at_most)
    if declared.whole:
        low, high = max(1.0, float(np.ceil(low))), float(np.floor(high))
    symbol, meaning = _symbol(declared.latex), declared.meaning
    return Slider(name, symbol, meaning, declared.unit, declared.bounds, value, low, high, declared.whole)


@dataclass(frozen=True)
class StartField:
    """A start value as a page offers it: letter and subscript, SI unit, and the value, None for rest."""

    name: str
    symbol: tuple[str, str]
    unit: str
    value: float | None


def start_fields_of(model: Model, observer: Observer, initial: Mapping[str, float]) -> Mapping[str, StartField]:
    """A field for every state of a model outside long shafts, of springs their twist, and for start values given."""
    shafts = {name.rpartition(".")[0] for name in observer.profiles}
    integrals = {domain.integral.name: domain.integral.unit for domain in DOMAINS}
    fields: dict[str, StartField] = {}
    for state in (*model.states, *initial):
        owner, _, quantity = state.rpartition(".")
        if owner in shafts and state not in initial:
            continue
        twist = f"{owner}.{TWISTS.get(quantity, '')}"
        name = twist if twist in observer.units and state not in initial else state
        unit = observer.units.get(name) or integrals.get(quantity, "")
        value = in_si(f"the start value of '{name}'", initial[name], unit or "1") if name in initial else None
        fields[name] = StartField(name, _symbol(name.rpartition(".")[2]), unit, value)
    return fields


def _symbol(latex: str) -> tuple[str, str]:
    """Letter and subscript of a symbol in LaTeX, or of a quantity's name: of "tau_off" τ and off."""
    letter, _, subscript = _GREEK.sub(_letter, re.sub(r"[{}]|\\bar", "", latex)).partition("_")
    return letter, subscript.replace("_", ",")


def _letter(match: re.Match[str]) -> str:
    size = "CAPITAL" if match[1][0].isupper() else "SMALL"
    return unicodedata.lookup(f"GREEK {size} LETTER {match[1].replace('ambda', 'amda')}")


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
