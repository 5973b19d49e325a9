"""Models and motions that are stored (pickled): as what they are made of, from which they are made again when needed.

Compiled code cannot be stored. A model is its network and the options of its compilation; a motion is its states at the
output times, and the call that led to them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Protocol
from weakref import WeakValueDictionary

from shaftwork.core.errors import AccuracyWarning, NetworkWarning
from shaftwork.core.notices import muted
from shaftwork.network.netlist import Netlist
from shaftwork.pipeline.arguments import Demand
from shaftwork.pipeline.motion_start import Ending
from shaftwork.results.solution import Solution


class Simulated(Protocol):
    """What `Model` is here."""

    netlist: Netlist

    def simulate(self, *args: Any, **options: Any) -> Solution:
        """Integrate the motion."""
        ...


Rebuild = Callable[[Netlist], Simulated]
"""Makes the model of a network."""
_LIVING: WeakValueDictionary[tuple[Rebuild, Netlist], Simulated] = WeakValueDictionary()
"""Models that have been stored or made again: all motions of one network that a process reads share one."""


def remember(model: Simulated, rebuild: Rebuild) -> tuple[Rebuild, Netlist]:
    """What a model is stored as."""
    _LIVING[rebuild, model.netlist] = model
    return rebuild, model.netlist


def model_again(rebuild: Rebuild, netlist: Netlist) -> Simulated:
    """The model of a network; its author has been warned when it was first made."""
    model = _LIVING.get((rebuild, netlist))
    if model is None:
        with muted(NetworkWarning):
            model = _LIVING[rebuild, netlist] = rebuild(netlist)
    return model


def call_of(
    motion: Solution, demand: Demand, values: Mapping[str, float], initial: Mapping[str, Any] | None
) -> dict[str, Any]:
    """The arguments of `Model.simulate` that lead to a motion again, by the engine that was taken.

    A motion through phases has an engine for each, which is chosen anew.
    """
    return {
        "t_start": demand.span[0],
        "t_end": demand.span[1],
        "rtol": demand.rtol,
        "atol": demand.atol,
        "t_eval": "steps" if demand.t_eval is None else demand.t_eval.copy(),
        "engine": demand.engine if motion.phases else motion.engine,
        "max_steps": demand.max_steps,
        "parameters": dict(values),
        "initial": initial if initial is None or isinstance(initial, Ending) else dict(initial),
    }


class Repetition:
    """The call that has led to a motion.

    Args:
        rebuild: makes the model again.
        netlist: of which it is a motion.
        options: of `Model.simulate`.
        model: the model itself, where it is at hand.
    """

    def __init__(
        self, rebuild: Rebuild, netlist: Netlist, options: Mapping[str, Any], model: Simulated | None = None
    ) -> None:
        self._rebuild, self._netlist, self._options, self._model = rebuild, netlist, options, model

    def __call__(self) -> Solution:
        """The motion, made again."""
        model = self._model or model_again(self._rebuild, self._netlist)
        with muted(NetworkWarning, AccuracyWarning):  # its author has seen them
            return model.simulate(**self._options)

    def __reduce__(self) -> tuple[Any, ...]:
        if self._model is not None:
            remember(self._model, self._rebuild)
        return Repetition, (self._rebuild, self._netlist, self._options)
