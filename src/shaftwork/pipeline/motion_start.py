"""How a motion starts: at rest, from values by name, or where another motion ended, as if there had been no end."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.starts.start_values import initial_state
from shaftwork.codegen.state_transfer import StateTransfer
from shaftwork.core.errors import AccuracyWarning, Diagnostic, NetworkWarning, ParameterError
from shaftwork.core.notices import warn
from shaftwork.core.parameters import in_si
from shaftwork.network.checks import resting_trains
from shaftwork.network.graph import CircuitGraph
from shaftwork.network.netlist import first_few, listed
from shaftwork.pipeline.prepared import EngineModel, Prepared
from shaftwork.results.solution import Solution

if TYPE_CHECKING:
    from shaftwork.waves.wave_motion import CarriedWaves, WaveStart

_RESTING: WeakKeyDictionary[CircuitGraph, tuple[Diagnostic, ...]] = WeakKeyDictionary()
"""What `resting_trains` gives: it takes as long as a short run."""
SAME_TIME = 1e-12
"""Times that differ by less than this fraction are one: units are converted."""


def waving(graph: CircuitGraph) -> tuple[str, ...]:
    """Names of the parts that waves travel along."""
    histories = (branch.index for branch in graph.branches if branch.template.is_history)
    return tuple(dict.fromkeys(graph.part_of(index).name for index in histories))


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
        waves: CarriedWaves | None,
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
    t, x = float(motion.t[-1]), motion.x[-1]
    observer, carried = motion.observer, getattr(motion.dense, "carried", None)
    waves = carried(t) if waving(graph) and carried is not None else None
    return Ending(observer.held(t, x), t, observer.read_at(t), observer.modes_at(t), motion.parameters, waves)


def time_of_start(t_start: Any, initial: Any) -> Any:
    """The start of a motion, s: 0 by default, and the end of the motion that goes on.

    Raises:
        ParameterError: another time is given than that at which the motion ended.
    """
    if not isinstance(initial, Ending):
        return 0.0 if t_start is None else t_start
    if t_start is not None and not math.isclose(in_si("t_start", t_start, "s"), initial.t, rel_tol=SAME_TIME):
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


def warn_of_rest(graph: CircuitGraph, initial: Mapping[str, float]) -> None:
    """Warn of trains that nothing joins to the drive and that no start value moves.

    Args:
        graph: the network.
        initial: start values.
    """
    moved = {str(name).rpartition(".")[0] for name, value in initial.items() if value}
    if (resting := _RESTING.get(graph)) is None:
        resting = _RESTING[graph] = resting_trains(graph)
    for train in resting:
        if moved.isdisjoint((*train.parts, *train.nodes)):
            warn(f"'{graph.name}' has a train that stays at rest: {train}", NetworkWarning)


def start_of(
    model: EngineModel, prepared: Prepared, initial: Mapping[str, float] | None, span: tuple[float, float]
) -> tuple[Array, WaveStart | CarriedWaves | None]:
    """The states (n,) at the start, and the waves where they are not at rest.

    Args:
        model: the compiled equations.
        prepared: their parameters.
        initial: start values, or where another motion ended; None for rest.
        span: start and end of the run, s.

    Raises:
        SignalError: there is no such quantity.
        ParameterError: values are not finite, contradict each other or leave something open.
    """
    if initial is None and not model.form.has_impulses:
        return np.zeros(len(model.states)), None
    _, after = model.switching.timeline(prepared.p, *span).sides(span[0])
    values = dict(zip(model.parameters, prepared.p.tolist(), strict=True))
    if isinstance(initial, Ending) and (initial.waves is not None or not model.form.waves):
        return _taken_up(prepared, initial, after, changes=bool(initial.changed(values))), initial.waves
    if not model.form.waves:
        return initial_state(prepared.bound, {} if initial is None else initial, after), None
    from shaftwork.waves.wave_motion import start_of_waves

    if isinstance(initial, Ending):
        warn_of_lost_waves(span[0], in_leaps=True)
        initial = {name: initial[name] for name in model.states}
    elif initial and span[0] != 0:
        warn_of_lost_waves(span[0])
    return start_of_waves(prepared.bound, model.twin.bind(model.twin.vector(values)), initial or {}, after)


def _taken_up(prepared: Prepared, ending: Ending, after: float, *, changes: bool) -> Array:
    """The states (n,) that go on with what was stored, after what jumps at that instant.

    Args:
        prepared: the equations.
        ending: of the motion before.
        after: time at which inputs are read from now on, s.
        changes: whether a parameter is another one: what is rigidly joined may then have to change its speeds at once.
    """
    form, bound, stores = prepared.form, prepared.bound, StateTransfer(prepared.form)
    if changes:
        ending.refuse_lacking(stores.names)
        x = stores.states(bound, ending.read, ending)
    else:  # without the full matrices of all stores, which a large network has no room for
        ending.refuse_lacking(state.name for state in form.states)
        x = np.array([ending[state.name] for state in form.states])
    return bound.impulse(x, ending.read, after) if form.has_impulses and after != ending.read else x


def warn_of_lost_waves(t_start: float, *, in_leaps: bool = False) -> None:
    """Warn of a motion that goes on at a time in s without what was on its way.

    Args:
        t_start: the time, s.
        in_leaps: whether the motion before is known and has leapt through its waves; else only start values are.
    """
    why, remedy = "start values tell of their ends alone", "Give the motion itself, initial=sol"
    if in_leaps:
        why, remedy = "a long run leaps from one output time to the next", "Simulate it with t_eval='steps'"
    warn(
        f"The motion goes on at t_start = {t_start:g} s without the waves that were on their way through shafts: "
        f"{why}, and the torque of a shaft begins as in steady operation. {remedy}; or simulate all of it in one run, "
        "or take another model of the shaft, such as Lumped(20).",
        AccuracyWarning,
    )
