"""The table of engines: all that the rest of the library knows of each, in one place."""

from __future__ import annotations

import importlib.util
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from importlib import import_module
from typing import Any, Literal, get_args

from shaftwork.numerics.tolerances import EPS

EngineName = Literal["auto", "exact", "heyoka", "numba", "sundials", "scipy", "scipy-radau", "banded", "wave"]
ENGINE_NAMES: tuple[EngineName, ...] = get_args(EngineName)
"""What a run may be asked for: `auto` for the engine that suits, or the name of one in `ENGINES`."""


@dataclass(frozen=True, kw_only=True)
class EngineEntry:
    """What an engine is, needs and keeps: errors, help texts, documentation and `auto` follow from it.

    Args:
        module: of `shaftwork.integrate`, imported when a run takes the engine: its `solve` is the engine
            (`problem.Engine`). Empty for the engine of networks with waves, which is in their room.
        keywords: with which `solve` is called beside the problem.
        method: in a few words, for the table of engines in the documentation.
        suited: for which systems, in a few words, for the same table.
        library: module it needs beyond numpy and scipy, or None.
        distribution: name of that library for pip.
        extra: the extra that brings it.
        special: whether it is for special systems. Then its module has `suits(problem)` as well: a sentence why `auto`
            takes it for a problem, empty where it does not. `auto` asks these engines about linear problems and about
            large ones, in the order of the table, before it weighs the others.
        asked_beyond: number of states beyond which a problem is large for that.
        step: about how long one step takes in s, and how much longer for each state. `auto` compares those of the
            engines that `choice.choose` names; of others nobody reads it.
        explicit: whether stability bounds its steps: then no run is so long that the rounding of speeds spoils torques.
        finest: the finest relative tolerance that it is given; 0 where it has no step error.
        loosest: the loosest one that it runs with.
        absolute: whether `each` state has an absolute tolerance, all have one `overall`, or there are `none`.
        following: of an engine that follows guards, the part of the tolerance that it then runs with, and the loosest
            one: an error grows with every change of mode, by some hundreds through sixty contacts, so measure these
            two on the scene crane. None where it follows none, and is refused where parts change their mode.
        unless_stiff: the entry that replaces it in motions with changes of mode that are not stiff; empty for none.
        part_of: the engine as users call it, where this is another method of it; empty where it is one itself.
    """

    module: str = ""
    keywords: Mapping[str, Any] = field(default_factory=dict)
    method: str
    suited: str
    library: str | None = None
    distribution: str = ""
    extra: str = ""
    special: bool = False
    asked_beyond: float = math.inf
    step: tuple[float, float] = (0.0, 0.0)
    explicit: bool = False
    finest: float = 0.0
    loosest: float = 1.0
    absolute: Literal["each", "overall", "none"] = "each"
    following: tuple[float, float] | None = None
    unless_stiff: str = ""
    part_of: str = ""

    @property
    def installed(self) -> bool:
        """Whether the library it needs can be imported."""
        return self.library is None or importlib.util.find_spec(self.library) is not None

    def function(self, name: str) -> Any:
        """A function of its module, which is imported now."""
        return getattr(import_module(f"{__package__}.{self.module}"), name)

    def seconds(self, states: int) -> float:
        """About how long a step takes."""
        fixed, each = self.step
        return fixed + each * states


_SCIPY = EngineEntry(
    module="scipy_ivp",
    keywords={"method": "DOP853"},
    method="DOP853",
    suited="everything that is not stiff",
    step=(2e-4, 0.0),
    explicit=True,
    finest=100 * EPS,  # below, scipy's methods only warn
    following=(1 / 30, 1e-7),
)
_SUNDIALS = EngineEntry(
    module="sundials",
    keywords={"method": "BDF"},
    method="CVODE (BDF), IDA for algebraic loops",
    suited="stiff models",
    library="sksundae",
    distribution="scikit-sundae",
    extra="stiff",
    step=(5e-5, 0.0),
    finest=8 * EPS,  # below, near the rounding of numbers, SUNDIALS refuses
    following=(1 / 300, 1e-8),
    unless_stiff="sundials-adams",
)

ENGINES: dict[str, EngineEntry] = {
    "exact": EngineEntry(
        module="linear.propagation",
        method="mode by mode, or matrix exponential",
        suited="linear models",
        special=True,
        absolute="none",
    ),
    "heyoka": EngineEntry(
        module="taylor.heyoka_taylor",
        method="Taylor series of adaptive order, compiled by LLVM",
        suited="everything that is not stiff, in networks that are not large",
        library="heyoka",
        distribution="heyoka",
        extra="fast",
        step=(0.0, 2e-7),
        explicit=True,
        finest=1e-15,
        loosest=1e-10,  # the cost grows only with the logarithm, and a loose one loses events
        absolute="overall",
        following=(1.0, 1e-12),
    ),
    "numba": EngineEntry(
        module="explicit.dormand_prince",
        method="DOP853, compiled by numba",
        suited="everything that is not stiff, where there is no heyoka",
        library="numba",
        distribution="numba",
        extra="fast",
        step=(2e-5, 5e-8),
        explicit=True,
        finest=100 * EPS,
        following=(1 / 30, 1e-7),
    ),
    "sundials": _SUNDIALS,
    "sundials-adams": replace(
        _SUNDIALS,
        keywords={"method": "Adams"},
        method="CVODE with Adams' formulas",
        explicit=True,
        following=(1 / 100, 1e-8),
        unless_stiff="",
        part_of="sundials",
    ),
    "scipy": _SCIPY,
    "scipy-radau": replace(
        _SCIPY,
        keywords={"method": "Radau"},
        method="Radau IIA",
        suited="stiff models without the extra",
        step=(2e-3, 0.0),
        explicit=False,
    ),
    "banded": EngineEntry(
        module="collocation.banded",
        method="Radau IIA of order 11, Gauss of order 12 where nothing is damped; sparse linear systems",
        suited="long chains, linear or stiff",
        special=True,
        asked_beyond=300,  # at 61 states CVODE takes 1.6 s where it takes 0.2 s, at 601 states 13 s and 0.34 s
        finest=1e-11,  # below, the rounding in its stage equations is larger
    ),
    "wave": EngineEntry(
        method="waves by their delays, and collocation between",
        suited="shafts with `model=Wave()`, and these alone",
        finest=1e-12,  # below, the rounding of coefficients of rounded numbers on a wave is larger
        absolute="none",
        following=(1.0, 1e-6),  # its panels leave out a tenth of the tolerance
    ),
}

GENERAL = tuple(name for name, entry in ENGINES.items() if entry.module and not entry.part_of)
"""The engines that may be asked for in every network without waves."""


def available(name: str) -> bool:
    """Whether the engine of this name can be used here."""
    return ENGINES[name].installed


def too_fine(name: str, rtol: float) -> str:
    """What is to be said of a tolerance that is finer than the finest of an engine; empty where nothing is."""
    finest = ENGINES[name].finest
    if rtol >= finest:
        return ""
    return f"rtol = {rtol:.2g} is finer than the engine {name!r} can keep: the run is made with {finest:.2g}."
