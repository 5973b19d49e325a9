"""The engines by name: what each needs and how fine a tolerance it keeps; `choice.load` says where each is."""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass, replace
from typing import Literal, get_args

from shaftwork.numerics.tolerances import EPS

EngineName = Literal["auto", "scipy", "scipy-radau", "heyoka", "sundials", "exact", "banded", "wave"]
ENGINE_NAMES: tuple[EngineName, ...] = get_args(EngineName)
"""What a run may be asked for: an engine by name, or `auto` for the one that suits."""


@dataclass(frozen=True)
class EngineEntry:
    """What an engine needs and keeps.

    Args:
        library: module it needs beyond numpy and scipy, or None.
        distribution: name of that library for pip.
        extra: the extra that brings it.
        finest: relative tolerance below which it takes none; 0 where it has no step error.
        loosest: the one above which it takes none.
        following: of an engine that follows guards, the part of the tolerance that it then runs with, and the loosest
            one: an error grows with every change of mode, by some hundreds through sixty contacts.
        absolute: whether it has an absolute tolerance.
    """

    library: str | None = None
    distribution: str = ""
    extra: str = ""
    finest: float = 0.0
    loosest: float = 1.0
    following: tuple[float, float] | None = None
    absolute: bool = True

    @property
    def installed(self) -> bool:
        """Whether the library it needs can be imported."""
        return self.library is None or importlib.util.find_spec(self.library) is not None


# Below these tolerances scipy's methods only warn, SUNDIALS refuses (near the rounding of numbers), the rounding in the
# stage equations of the banded engine is larger, and so is that of coefficients of rounded numbers on a wave.
_SCIPY = EngineEntry(finest=100 * EPS, following=(1 / 30, 1e-7))
WAVE = EngineEntry(
    finest=1e-12,
    following=(1.0, 1e-6),  # its panels leave out a tenth of the tolerance
    absolute=False,
)
"""The engine of networks with waves, which no others can take: it is in their room, and they load it."""

ENGINES: dict[str, EngineEntry] = {
    "exact": EngineEntry(absolute=False),
    "heyoka": EngineEntry(
        "heyoka",
        "heyoka",
        "fast",
        finest=1e-15,
        loosest=1e-10,  # the cost grows only with the logarithm, and a loose one loses events
        following=(1.0, 1e-12),
    ),
    "sundials": EngineEntry("sksundae", "scikit-sundae", "stiff", finest=8 * EPS, following=(1 / 300, 1e-8)),
    "scipy": _SCIPY,
    "scipy-radau": _SCIPY,
    "banded": EngineEntry(finest=1e-11),
}

# Another method of an engine, which a run chooses by itself.
ADAMS = "sundials-adams"
INNER = {ADAMS: replace(ENGINES["sundials"], following=(1 / 100, 1e-8))}


def available(name: str) -> bool:
    """Whether the engine of this name can be used here."""
    return ENGINES[name].installed


def too_fine(name: str, rtol: float) -> str:
    """What is to be said of a tolerance that is finer than the finest of an engine; empty where nothing is."""
    finest = ENGINES.get(name, WAVE).finest
    if rtol >= finest:
        return ""
    return f"rtol = {rtol:.2g} is finer than the engine {name!r} can keep: the run is made with {finest:.2g}."
