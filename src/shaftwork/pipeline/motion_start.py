"""How a motion starts: at rest, from values by name, or where another motion ended, as if there had been no end.

And how one that was stored (pickled) is made again when it is needed, as compiled code cannot be stored: a model from
its network and the options of its compilation, a motion from the call that led to it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from weakref import WeakValueDictionary

from shaftwork.core.errors import AccuracyWarning, Diagnostic, NetworkWarning, ParameterError
from shaftwork.core.notices import muted, warn
from shaftwork.core.parameters import in_si
from shaftwork.network.graph import CircuitGraph
from shaftwork.network.netlist import Netlist, first_few, listed
from shaftwork.numerics.tolerances import SAME
from shaftwork.pipeline.arguments import Demand
from shaftwork.results.solution import Solution


class Ending(dict[str, float]):
    """All that a motion hands over at its last output time: start values by name, and what they do not tell.

    Args:
        stored: the speed of every inertia, the torque of every spring, every angle, in SI.
        t: the time, s.
        read: the time at which inputs are read, s: at the end of a run before whatever jumps there.
        modes: of every element that changes its mode.
        parameters: of the motion, "part.parameter" to value in SI, where it is not zero.
        waves: on their way through shafts; None where there are none, or a run in leaps does not know them.
    """

    def __init__(
        self,
        stored: Mapping[str, float],
        t: float,
        read: float,
        modes: Mapping[str, str],
        parameters: Mapping[str, float],
        waves: object,
    ) -> None:
        super().__init__(stored)
        self.t, self.read, self.modes, self.parameters, self.waves = t, read, dict(modes), dict(parameters), waves

    def __bool__(self) -> bool:
        return True  # waves may be all that goes on

    def __repr__(self) -> str:
        beside = f"t={self.t!r}, modes={self.modes}, parameters={self.parameters}, waves={self.waves!r}"
        return f"Ending({super().__repr__()}, {beside})"

    def beside(self, arriving: Mapping[str, float]) -> Ending:
        """The same with what arrives by waves, by name."""
        if not arriving:
            return self
        return Ending({**self, **arriving}, self.t, self.read, self.modes, self.parameters, self.waves)

    def changed(self, parameters: Mapping[str, float]) -> frozenset[str]:
        """The names of the parameters that are others from now on."""
        names = {**self.parameters, **parameters}
        return frozenset(name for name in names if self.parameters.get(name, 0.0) != parameters.get(name, 0.0))

    def refuse_lacking(self, names: Iterable[str]) -> None:
        """Refuse to go on where something is stored that the motion did not store.

        Raises:
            ParameterError: names what is missing.
        """
        if missing := tuple(name for name in names if name not in self):
            raise ParameterError(
                f"initial is a motion that does not tell {listed(missing)}, stored here: it was simulated without some "
                "angles=..., or with a zero in place of a value. Simulate it as this one; or give all start values by "
                "name, initial={name: sol[name][-1] for name in sol.states} and those, with t_start=sol.t[-1]."
            )


def rewired(here: Mapping[str, str], there: Mapping[str, str]) -> list[str]:
    """What is another part, elsewhere or of another law in a network there than it is here, each in a few words."""
    names = dict.fromkeys((*here, *there))
    absent = "not there"
    return [
        f"'{name}' is {there.get(name, absent)} instead of {here.get(name, absent)}"
        for name in names
        if here.get(name) != there.get(name)
    ]


def ending_of(motion: Solution, graph: CircuitGraph) -> Ending:
    """Where a motion ended: at its last output time.

    Args:
        motion: of the same network, whose parameters may have had other values.
        graph: of the network.

    Raises:
        ParameterError: it is a motion of another network; names what differs.
    """
    if other := rewired(graph.wiring, motion.observer.wiring):
        raise ParameterError(
            f"initial is a motion of '{motion.name}', which is another network than '{graph.name}': "
            f"{first_few(other)}. Give a motion of the same network; numbers of its parts may differ. "
            "Or begin with start values, initial={name: sol[name][-1] for name in sol.states} and t_start=sol.t[-1]."
        )
    return handed_over(motion, motion.parameters)


def handed_over(motion: Solution, parameters: Mapping[str, float]) -> Ending:
    """Where a motion with these values of the parameters ended; it is of the network that goes on."""
    t, x = float(motion.t[-1]), motion.x[-1]
    observer, carried = motion.observer, getattr(motion.dense, "carried", None)
    waves = None if carried is None else carried(t)
    return Ending(observer.held(t, x), t, observer.read_at(t), observer.modes_at(t), parameters, waves)


def time_of_start(t_start: Any, initial: Any) -> Any:
    """The start of a motion, s: 0 by default, and the end of the motion that goes on.

    Raises:
        ParameterError: another time is given than that at which the motion ended.
    """
    if not isinstance(initial, Ending):
        return 0.0 if t_start is None else t_start
    if t_start is not None and not math.isclose(in_si("t_start", t_start, "s"), initial.t, rel_tol=SAME):
        raise ParameterError(
            f"t_start = {t_start} is not the time at which the motion ended that goes on, {initial.t:.9g} s. Leave "
            "t_start out; initial=sol.at([t]) goes on from a time t within the motion."
        )
    return initial.t


def refuse_motion(initial: Any, what: str) -> None:
    """Refuse a motion where start values by name are wanted.

    Raises:
        ParameterError: it is one.
    """
    if isinstance(initial, Solution):
        raise ParameterError(
            f"{what} takes start values by name, not a motion. Give those of its end, "
            "initial={name: sol[name][-1] for name in sol.states}."
        )


def warn_of_rest(name: str, resting: Iterable[Diagnostic], initial: Mapping[str, float]) -> None:
    """Warn of trains that nothing joins to the drive and that no start value moves.

    Args:
        name: of the network.
        resting: these trains, as `resting_trains` finds them.
        initial: start values.
    """
    moved = {str(name).rpartition(".")[0] for name, value in initial.items() if value}
    for train in resting:
        if moved.isdisjoint((*train.parts, *train.nodes)):
            warn(f"'{name}' has a train that stays at rest: {train}", NetworkWarning)


Rebuild = Callable[[Netlist], Any]
"""Makes the model of a network."""
_LIVING: WeakValueDictionary[tuple[Rebuild, Netlist], Any] = WeakValueDictionary()
"""Models that have been stored or made again: all motions of one network that a process reads share one."""


def remember(model: Any, rebuild: Rebuild) -> tuple[Rebuild, Netlist]:
    """What a model is stored as."""
    _LIVING[rebuild, model.netlist] = model
    return rebuild, model.netlist


def model_again(rebuild: Rebuild, netlist: Netlist) -> Any:
    """The model of a network; its author has been warned when it was first made."""
    model = _LIVING.get((rebuild, netlist))
    if model is None:
        with muted(NetworkWarning):
            model = _LIVING[rebuild, netlist] = rebuild(netlist)
    return model


@dataclass(frozen=True, eq=False)
class Repetition:
    """The call that has led to a motion; it leads there again by the engine that was taken.

    A motion through phases has an engine for each, which is chosen anew.

    Args:
        rebuild: makes the model again.
        netlist: of which it is a motion.
        demand: what was asked.
        engine: the one to take.
        values: parameters that differ from the network's.
        initial: start values.
        model: the model itself, where it is at hand.
    """

    rebuild: Rebuild
    netlist: Netlist
    demand: Demand
    engine: str
    values: Mapping[str, float]
    initial: Mapping[str, float] | None
    model: Any = None

    def __call__(self) -> Solution:
        """The motion, made again."""
        model, demand = self.model or model_again(self.rebuild, self.netlist), self.demand
        with muted(NetworkWarning, AccuracyWarning):  # its author has seen them
            motion: Solution = model.simulate(
                demand.span[1],
                t_start=demand.span[0],
                rtol=demand.rtol,
                atol=demand.atol,
                t_eval="steps" if demand.t_eval is None else demand.t_eval,
                engine=self.engine,
                initial=self.initial,
                parameters=self.values,
                max_steps=demand.max_steps,
            )
            return motion

    def save(self, motion: Solution, path: str | Path, names: Sequence[str]) -> None:
        """Write the motion to a file, with this call; see `Solution.save`."""
        from shaftwork.motionfiles.motion_files import write_motion

        write_motion(self, motion, path, names)

    def __reduce__(self) -> tuple[Any, ...]:
        if self.model is not None:
            remember(self.model, self.rebuild)
        demand = replace(self.demand, progress=None)
        return Repetition, (self.rebuild, self.netlist, demand, self.engine, self.values, self.initial)
