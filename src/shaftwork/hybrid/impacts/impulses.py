"""An impulse on its way through parts that pass torques on by their direction: gears that rub.

While an impulse grows, all speeds change in proportion to it as long as each gear turns the way it did and the same
side drives it. A gear that comes to rest is held by the rest of the impulse, or turned on or back. So an impact is a
motion of its own, with the impulse in the place of time (Routh, Dynamics of a System of Rigid Bodies, part I, 1905,
article 198); it is what a contact does that is stiff enough.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.array_form.recovery import BranchHistory
from shaftwork.components.branches import ACROSS, through_of
from shaftwork.components.modes import Leave, Mode
from shaftwork.core.errors import NetworkError, SimulationError
from shaftwork.hybrid.consistency import ROUNDINGS
from shaftwork.hybrid.hybrid_state import HybridState, Regime
from shaftwork.hybrid.hybrid_transfer import HybridTransfer
from shaftwork.hybrid.modes.mode_equations import ModeEquations
from shaftwork.hybrid.modes.mode_machines import ModeNames, with_modes
from shaftwork.numerics.tolerances import EPS

NOTHING_OF = ROUNDINGS * EPS
"""What rounding leaves of speeds and impulses, as part of the largest."""


class ImpulseOutcome(NamedTuple):
    """What an impulse leads to.

    Args:
        after: what follows.
        passing: the modes in which it passes.
        pressed: (contacts,) the impulses of contacts that are open in these modes.
        through: (branches,) what of them passes through tree branches.
    """

    after: HybridState
    passing: Regime
    pressed: Array | float = 0.0
    through: Array | float = 0.0


class ImpactStart(NamedTuple):
    """Where a part of an impact begins: all that is stored, and the speeds of gears; its inputs are those of a time."""

    state: HybridState
    t: float
    stored: Mapping[str, float]
    speeds: Mapping[int, float]


class ImpactStage(NamedTuple):
    """A part of an impact in which speeds change in proportion: from where, to what, and how much of that."""

    start: ImpactStart
    outcome: ImpulseOutcome
    share: float


class Impulses:
    """Follows impulses through gears.

    Args:
        transfer: from one combination of modes to another.
    """

    def __init__(self, transfer: HybridTransfer) -> None:
        self._transfer, self._machines = transfer, transfer.machines
        self.gears = tuple(k for k, machine in enumerate(self._machines) if machine.modes.passes_on)
        """Machines that pass torques on by their direction."""

    def begins(self, state: HybridState, t: float) -> ImpactStart:
        """Where an impact begins, with the inputs of a time in s."""
        speeds = dict(zip(self.gears, state.speeds(self.gears, t), strict=True))
        return ImpactStart(state, t, state.stored(t), speeds)

    def stages(
        self,
        t: float,
        start: ImpactStart,
        impulse: Callable[[ImpactStart, Sequence[ImpactStage]], ImpulseOutcome],
        most: int = 100,
    ) -> tuple[ImpactStage, ...]:
        """All parts of an impulse, of which the last leads to its end.

        Args:
            t: time after it in s at which inputs are read.
            start: before it.
            impulse: to what the rest of it leads from a start on, all in the modes that gears have there, and after
                what stages.
            most: so many times gears may come to rest in it.

        Raises:
            SimulationError: gears come to rest again and again.
        """
        stages: list[ImpactStage] = []
        while len(stages) < most:
            start, outcome = self._consistent(t, start, lambda begun: impulse(begun, stages))
            share, number = min(self._coming_to_rest(t, start, outcome.after), default=(1.0, -1))
            stages.append(ImpactStage(start, outcome, share))
            if number < 0:
                return tuple(stages)
            modes = self._at_rest(outcome.after.regime.modes, number)
            start = self._reached(t, stages[-1], modes, number)
        raise SimulationError(
            f"'{self._machines[number].name}' comes to rest again and again in one impact at t = {t:.9g} s. Give the "
            "contact that is hit a stiffness c and a damping d."
        )

    def _reached(self, t: float, stage: ImpactStage, modes: ModeNames, number: int) -> ImpactStart:
        """The end of a stage, at which a gear is at rest, in the modes that go on."""
        start, outcome, share = stage
        gained = self._gained(t, start, outcome)
        stored = {name: value + share * gained[name] for name, value in start.stored.items()}
        speeds = {k: v + share * (outcome.after.across(k, t) - v) for k, v in start.speeds.items()}
        return ImpactStart(self._transfer.with_stored(modes, t, stored), t, stored, {**speeds, number: 0.0})

    def _in_modes(self, t: float, start: ImpactStart, modes: ModeNames) -> ImpactStart:
        """The same start in other modes of gears; one that jams has stopped in it."""
        new = ImpactStart(self._transfer.with_stored(modes, t, start.stored), t, start.stored, start.speeds)
        halted = {*self._stopped(new.state)} - {*self._stopped(start.state)}
        return self.begins(new.state, t) if any(start.speeds[k] for k in halted) else new

    def _consistent(
        self, t: float, start: ImpactStart, impulse: Callable[[ImpactStart], ImpulseOutcome]
    ) -> tuple[ImpactStart, ImpulseOutcome]:
        """The modes of gears in which an impulse passes as they say; a gear that turns, and has none, jams at once."""
        outcome, jammed, seen = self._passed(start, impulse), set[int](), {start.state.regime.modes}
        while True:
            if outcome is None or outcome.after is start.state:
                start, outcome = self._released(t, start, impulse) or (start, outcome or impulse(start))
            turn = self._turned(t, start, outcome)
            if turn is None:
                return start, outcome
            number, to = turn
            modes = self._led(start.state.regime.modes, number, to)
            if modes in seen:
                if number in jammed:
                    return start, outcome
                jammed.add(number)
                seen.clear()
                modes = self._at_rest(modes, number)
            start = self._in_modes(t, start, modes)
            outcome = self._passed(start, impulse)
            seen.add(modes)

    def _passed(self, start: ImpactStart, impulse: Callable[[ImpactStart], ImpulseOutcome]) -> ImpulseOutcome | None:
        """What an impulse leads to; None where the equations of a gear at rest contradict what it meets."""
        try:
            return impulse(start)
        except NetworkError:
            if not self._stopped(start.state):
                raise
            return None

    def _released(
        self, t: float, start: ImpactStart, impulse: Callable[[ImpactStart], ImpulseOutcome]
    ) -> tuple[ImpactStart, ImpulseOutcome] | None:
        """Where gears at rest and what they meet hold each other, no impulse tells its way: which gear it turns.

        It is one of which the modes say so as well.
        """
        for k in self._stopped(start.state):
            turning = (mode.name for mode in self._machines[k].modes.options if _turns(mode))
            options = (with_modes(start.state.regime.modes, {k: name}) for name in turning)
            for modes in filter(self._transfer.possible, options):
                here = self._in_modes(t, start, modes)
                outcome = self._passed(here, impulse)
                if outcome is None or outcome.after is here.state:
                    continue
                turned = self._turned(t, here, outcome)
                if turned is None or turned[0] != k:
                    return here, outcome
        return None

    def _stopped(self, state: HybridState) -> list[int]:
        """Gears in a mode of rest."""
        return [k for k in self.gears if not _turns(state.regime.mode(k))]

    def _turned(self, t: float, start: ImpactStart, outcome: ImpulseOutcome) -> tuple[int, str] | None:
        """The gear that an impulse brings out of its mode at once, and the mode that follows."""
        if not self.gears:
            return None
        equations, p = outcome.passing.equations, outcome.passing.p
        impulses = self._impulses(t, start, outcome)
        # a gear elsewhere has the rounding of what moves there, however small the impact is
        momentum = equations.stores.momentum(equations.bound(p), start.stored)
        least = NOTHING_OF * max(np.abs(impulses).max(initial=0.0), momentum)
        exceeded = [
            (_guard(equations, k, leave, impulses, p), k, leave.to)
            for k in self.gears
            for leave in start.state.regime.mode(k).leaves
            if leave.by_torque
        ]
        exceeded = [turn for turn in exceeded if turn[0] > least]
        turning = (turn for turn in self._stopping(t, start, outcome.after) if turn[0] >= 0)
        exceeded = exceeded or [(ends, k, to) for _, ends, k, to in turning]
        return max(exceeded)[1:] if exceeded else None

    def _coming_to_rest(self, t: float, start: ImpactStart, after: HybridState) -> Iterator[tuple[float, int]]:
        """The share of an impulse after which a gear is at rest, and which one."""
        return ((began / (began - ends), k) for began, ends, k, _ in self._stopping(t, start, after) if began < 0)

    def _stopping(self, t: float, start: ImpactStart, after: HybridState) -> Iterator[tuple[float, float, int, str]]:
        """Gears that would turn round: their speeds before and after, negative the way they turn, and what follows."""
        states = (one.x[: len(one.regime.model.states)] for one in (start.state, after))
        least = NOTHING_OF * max(np.abs(x).max(initial=0.0) for x in states)
        for k, speed in start.speeds.items():
            speeds = speed, after.across(k, t)
            for leave in start.state.regime.mode(k).leaves:
                slope = float(leave.when.diff(ACROSS))
                began, ends = (0.0 if abs(speed) <= least else slope * speed for speed in speeds)
                if slope and ends > 0:
                    yield began, ends, k, leave.to

    def _at_rest(self, modes: ModeNames, number: int) -> ModeNames:
        """Modes with a gear at rest, or as it then goes on where it cannot be held."""
        leaves = self._machines[number].modes[modes[number]].leaves
        return self._led(modes, number, next((leave.to for leave in leaves if leave.when.has(ACROSS)), modes[number]))

    def _led(self, modes: ModeNames, number: int, to: str) -> ModeNames:
        """Modes with another one of a gear; where its equations contradict others, one to which it leads."""
        names = (to, *(leave.to for leave in self._machines[number].modes[to].leaves if leave.to != modes[number]))
        return next(filter(self._transfer.possible, (with_modes(modes, {number: name}) for name in names)), modes)

    def _gained(self, t: float, start: ImpactStart, outcome: ImpulseOutcome) -> dict[str, float]:
        """What all that is stored gains by the whole of an impulse."""
        then = outcome.after.stored(t)
        return {name: then[name] - value for name, value in start.stored.items()}

    def given(self, t: float, stages: Sequence[ImpactStage], before: float | None = None) -> dict[str, float]:
        """What ideal sources give in an impulse, in J by part, their impulse times the mean of their speeds.

        Args:
            t: time after it in s at which they are read.
            stages: of the impulse.
            before: time before it, where it is they that jump; they do so in proportion to the impulse.
        """
        energies, jumped = list[Mapping[str, float]](), 0.0
        for stage in stages:
            equations, p = stage.outcome.passing.equations, stage.outcome.passing.p
            bound, stores, gained = equations.bound(p), equations.stores, self._gained(t, stage.start, stage.outcome)
            then = jumped + stage.share * (1.0 - jumped)
            late = 1.0 if before is None else (jumped + then) / 2
            for time, weight in ((t, late), (before, 1.0 - late)):
                if time is None:
                    continue
                whole = stores.given(bound, bound.sources(time), gained, stage.outcome.through)
                energies.append({part: stage.share * weight * energy for part, energy in whole.items()})
            jumped = then
        return summed(energies)

    def lost(self, t: float, stages: Sequence[ImpactStage]) -> dict[str, float]:
        """What gears lose in an impulse, in J by part: what passes through the mesh at the mean of the speeds there."""
        energies: list[Mapping[str, float]] = []
        for stage in stages if self.gears else ():
            impulses = self._impulses(t, stage.start, stage.outcome)
            for k, began in stage.start.speeds.items():
                name, passing = self._machines[k].part.name, stage.outcome.passing.equations
                ends = stage.outcome.after.across(k, t)
                state, time, speed = (stage.outcome.after, t, ends) if ends else (*stage.start[:2], began)
                # the speeds of a mesh are in proportion to that of its gear
                mean = (began + stage.share / 2 * (ends - began)) / speed if speed else 0.0
                pairs = zip(_meshes(passing, name), _across_meshes(state, time, name), strict=True)
                energies += [{name: float(sum(stage.share * impulses[mesh] * mean * across for mesh, across in pairs))}]
        return summed(energies)

    def _impulses(self, t: float, start: ImpactStart, outcome: ImpulseOutcome) -> Array:
        """(branches,) what passes through every branch at once."""
        equations, p = outcome.passing.equations, outcome.passing.p
        return equations.stores.impulses(equations.bound(p), self._gained(t, start, outcome)) + outcome.through


def summed(energies: Iterable[Mapping[str, float]]) -> dict[str, float]:
    """Energies by part of several together."""
    total: dict[str, float] = {}
    for part, energy in chain.from_iterable(each.items() for each in energies):
        total[part] = total.get(part, 0.0) + energy
    return total


def _turns(mode: Mode) -> bool:
    """Whether a gear turns in a mode: then its speed ends it."""
    return any(leave.when.has(ACROSS) for leave in mode.leaves)


def _guard(equations: ModeEquations, number: int, leave: Leave, impulses: Array, p: Array) -> float:
    """A guard by torques where impulses (branches,) act, beside which nothing else counts."""
    graph, total = equations.model.form.graph, 0.0
    for branch in equations.parts[equations.machines[number].part.name].branches:
        share = leave.when.diff(through_of(graph.branches[branch].template.label))
        total += equations.constant(number, share, p) * float(impulses[branch]) if share else 0.0
    return total


def _meshes(equations: ModeEquations, name: str) -> list[int]:
    """The branches of a part in which power is lost on its way."""
    branches = equations.model.form.graph.branches
    return [branch for branch in equations.parts[name].branches if branches[branch].template.through]


def _across_meshes(state: HybridState, t: float, name: str) -> list[float]:
    """The speeds on which the lambdas of a gear's meshes act."""
    equations = state.regime.equations
    history = BranchHistory(equations.bound(state.regime.p), np.array([t]), state.x[None, :])
    return [float(history.acted_on(equations.parts[name], branch)[0]) for branch in _meshes(equations, name)]
