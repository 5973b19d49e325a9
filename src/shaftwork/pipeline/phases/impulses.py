"""An impulse on its way through parts that pass torques on by their direction: gears that rub.

While an impulse grows, all speeds change in proportion to it as long as each gear turns the way it did and the same
side drives it. A gear that comes to rest is held by the rest of the impulse, or turned on or back. So an impact is a
motion of its own, with the impulse in the place of time (Routh, Dynamics of a System of Rigid Bodies, part I, 1905,
article 198); it is what a contact does that is stiff enough.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from shaftwork.codegen.elements import Array
from shaftwork.codegen.recovery import BranchHistory
from shaftwork.components.branches import ACROSS, through_of
from shaftwork.components.modes import Leave, Mode
from shaftwork.core.errors import NetworkError, SimulationError
from shaftwork.pipeline.phases.assemblies import ModeEquations
from shaftwork.pipeline.phases.hybrid_state import EPS, ROUNDINGS, HybridState, Regime
from shaftwork.pipeline.phases.mode_machines import ModeMachine, ModeNames
from shaftwork.pipeline.phases.regimes import Regimes, with_modes

# So many times gears may come to rest in one impact.
MOST_STAGES = 100
# What rounding leaves of speeds and impulses, as part of the largest.
NOTHING_OF = ROUNDINGS * EPS


Held = Mapping[str, float]
"""All that is stored, by name."""


class Blow(NamedTuple):
    """What an impulse leads to.

    Args:
        after: what follows.
        passing: the modes in which it passes.
        pressed: (contacts,) the impulses of contacts that are open in these modes.
        through: (branches,) what of them passes through tree branches.
    """

    after: HybridState
    passing: Regime
    pressed: Array = np.zeros(0)
    through: Array | float = 0.0


class ImpactStart(NamedTuple):
    """Where a part of an impact begins: all that is stored, and the speeds of gears; its inputs are those of a time."""

    moment: HybridState
    t: float
    held: Held
    speeds: Mapping[int, float]


class ImpactStage(NamedTuple):
    """A part of an impact in which speeds change in proportion: from where, to what, and how much of that."""

    start: ImpactStart
    blow: Blow
    share: float


class Impulses:
    """Follows impulses through gears.

    Args:
        regimes: combinations of modes.
        elements: of the network.
    """

    def __init__(self, regimes: Regimes, elements: Sequence[ModeMachine]) -> None:
        self._regimes, self._elements = regimes, elements
        self.gears = tuple(k for k, element in enumerate(elements) if element.modes.passes_on)
        """Elements that pass torques on by their direction."""

    def begins(self, moment: HybridState, t: float) -> ImpactStart:
        """Where an impact begins, with the inputs of a time in s."""
        speeds = dict(zip(self.gears, moment.speeds(self.gears, t), strict=True))
        return ImpactStart(moment, t, self._regimes.held(moment, t), speeds)

    def stages(
        self, t: float, start: ImpactStart, blow: Callable[[ImpactStart, Sequence[ImpactStage]], Blow]
    ) -> tuple[ImpactStage, ...]:
        """All parts of an impulse, of which the last leads to its end.

        Args:
            t: time after it in s at which inputs are read.
            start: before it.
            blow: the rest of it from a start on, all in the modes that gears have there, and after what stages.

        Raises:
            SimulationError: gears come to rest again and again.
        """
        made: list[ImpactStage] = []
        while len(made) < MOST_STAGES:
            start, found = self._consistent(t, start, lambda begun: blow(begun, made))
            share, number = min(self._coming_to_rest(t, start, found.after), default=(1.0, -1))
            made.append(ImpactStage(start, found, share))
            if number < 0:
                return tuple(made)
            modes = self._at_rest(found.after.regime.modes, number)
            start = self._reached(t, made[-1], modes, number)
        raise SimulationError(
            f"'{self._elements[number].name}' comes to rest again and again in one impact at t = {t:.9g} s. Give the "
            "contact that is hit a stiffness c and a damping d."
        )

    def _reached(self, t: float, stage: ImpactStage, modes: ModeNames, number: int) -> ImpactStart:
        """The end of a stage, at which a gear is at rest, in the modes that go on."""
        start, blow, share = stage
        held = {
            name: value + share * gain
            for (name, value), gain in zip(start.held.items(), self._gained(t, start, blow).values(), strict=True)
        }
        speeds = {k: v + share * (blow.after.across(k, t) - v) for k, v in start.speeds.items()}
        return ImpactStart(self._regimes.taking(modes, t, held), t, held, {**speeds, number: 0.0})

    def _in_modes(self, t: float, start: ImpactStart, modes: ModeNames) -> ImpactStart:
        """The same start in other modes of gears; one that jams has stopped in it."""
        made = ImpactStart(self._regimes.taking(modes, t, start.held), t, start.held, start.speeds)
        halted = {*self._stopped(made.moment)} - {*self._stopped(start.moment)}
        return self.begins(made.moment, t) if any(start.speeds[k] for k in halted) else made

    def _consistent(
        self, t: float, start: ImpactStart, blow: Callable[[ImpactStart], Blow]
    ) -> tuple[ImpactStart, Blow]:
        """The modes of gears in which an impulse passes as they say; a gear that turns, and has none, jams at once."""
        found, jammed, seen = self._passed(start, blow), set[int](), {start.moment.regime.modes}
        while True:
            if found is None or found.after is start.moment:
                start, found = self._released(t, start, blow) or (start, found or blow(start))
            turn = self._turned(t, start, found)
            if turn is None:
                return start, found
            number, to = turn
            modes = self._led(start.moment.regime.modes, number, to)
            if modes in seen:
                if number in jammed:
                    return start, found
                jammed.add(number)
                seen.clear()
                modes = self._at_rest(modes, number)
            start = self._in_modes(t, start, modes)
            found = self._passed(start, blow)
            seen.add(modes)

    def _passed(self, start: ImpactStart, blow: Callable[[ImpactStart], Blow]) -> Blow | None:
        """What an impulse leads to; None where the equations of a gear at rest contradict what it meets."""
        try:
            return blow(start)
        except NetworkError:
            if not self._stopped(start.moment):
                raise
            return None

    def _released(
        self, t: float, start: ImpactStart, blow: Callable[[ImpactStart], Blow]
    ) -> tuple[ImpactStart, Blow] | None:
        """Where gears at rest and what they meet hold each other, no impulse tells its way: which gear it turns.

        It is one of which the modes say so as well.
        """
        for k in self._stopped(start.moment):
            turning = (mode.name for mode in self._elements[k].modes.options if _turns(mode))
            ways = (with_modes(start.moment.regime.modes, {k: name}) for name in turning)
            for modes in filter(self._regimes.possible, ways):
                here = self._in_modes(t, start, modes)
                found = self._passed(here, blow)
                if found is None or found.after is here.moment:
                    continue
                turned = self._turned(t, here, found)
                if turned is None or turned[0] != k:
                    return here, found
        return None

    def _stopped(self, moment: HybridState) -> list[int]:
        """Gears in a mode of rest."""
        return [k for k in self.gears if not _turns(self._elements[k].modes[moment.regime.modes[k]])]

    def _turned(self, t: float, start: ImpactStart, found: Blow) -> tuple[int, str] | None:
        """The gear that an impulse brings out of its mode at once, and the mode that follows."""
        if not self.gears:
            return None
        assembly, p = found.passing.assembly, found.passing.p
        impulses = self._impulses(t, start, found)
        # a gear elsewhere has the rounding of what moves there, however small the impact is
        momentum = assembly.stores.momentum(assembly.bound(p), start.held)
        least = NOTHING_OF * max(np.abs(impulses).max(initial=0.0), momentum)
        ways = [
            (_guard(assembly, k, leave, impulses, p), k, leave.to)
            for k in self.gears
            for leave in self._elements[k].modes[start.moment.regime.modes[k]].leaves
            if leave.by_torque
        ]
        ways = [way for way in ways if way[0] > least]
        ways = ways or [(ends, k, to) for began, ends, k, to in self._stopping(t, start, found.after) if began >= 0]
        return max(ways)[1:] if ways else None

    def _coming_to_rest(self, t: float, start: ImpactStart, after: HybridState) -> Iterator[tuple[float, int]]:
        """The share of an impulse after which a gear is at rest, and which one."""
        return ((began / (began - ends), k) for began, ends, k, _ in self._stopping(t, start, after) if began < 0)

    def _stopping(self, t: float, start: ImpactStart, after: HybridState) -> Iterator[tuple[float, float, int, str]]:
        """Gears that would turn round: their speeds before and after, negative the way they turn, and what follows."""
        states = (made.x[: len(made.regime.assembly.model.states)] for made in (start.moment, after))
        least = NOTHING_OF * max(np.abs(x).max(initial=0.0) for x in states)
        for k, speed in start.speeds.items():
            speeds = speed, after.across(k, t)
            for leave in self._elements[k].modes[start.moment.regime.modes[k]].leaves:
                way = float(leave.when.diff(ACROSS))
                began, ends = (0.0 if abs(speed) <= least else way * speed for speed in speeds)
                if way and ends > 0:
                    yield began, ends, k, leave.to

    def _at_rest(self, modes: ModeNames, number: int) -> ModeNames:
        """Modes with a gear at rest, or as it then goes on where it cannot be held."""
        leaves = self._elements[number].modes[modes[number]].leaves
        return self._led(modes, number, next((leave.to for leave in leaves if leave.when.has(ACROSS)), modes[number]))

    def _led(self, modes: ModeNames, number: int, to: str) -> ModeNames:
        """Modes with another one of a gear; where its equations contradict others, one to which it leads."""
        ways = (to, *(leave.to for leave in self._elements[number].modes[to].leaves if leave.to != modes[number]))
        return next(filter(self._regimes.possible, (with_modes(modes, {number: name}) for name in ways)), modes)

    def _gained(self, t: float, start: ImpactStart, blow: Blow) -> dict[str, float]:
        """What all that is stored gains by the whole of an impulse."""
        then = self._regimes.held(blow.after, t)
        return {name: then[name] - value for name, value in start.held.items()}

    def given(self, t: float, stages: Sequence[ImpactStage], before: float | None = None) -> dict[str, float]:
        """What ideal sources give in an impulse, in J by part, their impulse times the mean of their speeds.

        Args:
            t: time after it in s at which they are read.
            stages: of the impulse.
            before: time before it, where it is they that jump; they do so in proportion to the impulse.
        """
        found: dict[str, float] = {}
        jumped = 0.0
        for stage in stages:
            assembly, p = stage.blow.passing.assembly, stage.blow.passing.p
            bound, stores, gained = assembly.bound(p), assembly.stores, self._gained(t, stage.start, stage.blow)
            then = jumped + stage.share * (1.0 - jumped)
            late = 1.0 if before is None else (jumped + then) / 2
            for time, weight in ((t, late), (before, 1.0 - late)):
                if time is None:
                    continue
                for part, energy in stores.given(bound, bound.sources(time), gained, stage.blow.through).items():
                    found[part] = found.get(part, 0.0) + stage.share * weight * energy
            jumped = then
        return found

    def lost(self, t: float, stages: Sequence[ImpactStage]) -> dict[str, float]:
        """What gears lose in an impulse, in J by part: what passes through the mesh at the mean of the speeds there."""
        found: dict[str, float] = {}
        for stage in stages if self.gears else ():
            impulses = self._impulses(t, stage.start, stage.blow)
            for k, began in stage.start.speeds.items():
                name, passing = self._elements[k].part.name, stage.blow.passing.assembly
                ends = stage.blow.after.across(k, t)
                moment, time, speed = (stage.blow.after, t, ends) if ends else (*stage.start[:2], began)
                # the speeds of a mesh are in proportion to that of its gear
                mean = (began + stage.share / 2 * (ends - began)) / speed if speed else 0.0
                pairs = zip(_meshes(passing, name), _across_meshes(moment, time, name), strict=True)
                lost = sum(stage.share * impulses[branch] * mean * across for branch, across in pairs)
                found[name] = found.get(name, 0.0) + float(lost)
        return found

    def _impulses(self, t: float, start: ImpactStart, found: Blow) -> Array:
        """(branches,) what passes through every branch at once."""
        assembly, p = found.passing.assembly, found.passing.p
        return assembly.stores.impulses(assembly.bound(p), self._gained(t, start, found)) + found.through


def _turns(mode: Mode) -> bool:
    """Whether a gear turns in a mode: then its speed ends it."""
    return any(leave.when.has(ACROSS) for leave in mode.leaves)


def _guard(assembly: ModeEquations, number: int, leave: Leave, impulses: Array, p: Array) -> float:
    """A guard by torques where impulses (branches,) act, beside which nothing else counts."""
    graph, total = assembly.model.form.graph, 0.0
    for branch in assembly.parts[assembly.elements[number].part.name].branches:
        share = leave.when.diff(through_of(graph.branches[branch].template.label))
        total += assembly.constant(number, share, p) * float(impulses[branch]) if share else 0.0
    return total


def _meshes(assembly: ModeEquations, name: str) -> list[int]:
    """The branches of a part in which power is lost on its way."""
    branches = assembly.model.form.graph.branches
    return [branch for branch in assembly.parts[name].branches if branches[branch].template.through]


def _across_meshes(moment: HybridState, t: float, name: str) -> list[float]:
    """The speeds on which the lambdas of a gear's meshes act."""
    assembly = moment.regime.assembly
    history = BranchHistory(assembly.bound(moment.regime.p), np.array([t]), moment.x[None, :])
    return [float(history.acted_on(assembly.parts[name], branch)[0]) for branch in _meshes(assembly, name)]
