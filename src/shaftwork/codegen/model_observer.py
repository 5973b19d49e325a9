"""The names of all quantities of a compiled model, and their values along a trajectory."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array, blocks
from shaftwork.codegen.array_form.recovery import BranchHistory, branches_with_power
from shaftwork.codegen.state_transfer import StateTransfer
from shaftwork.codegen.timeline import NOTHING, Timeline
from shaftwork.components.base import Component, Profile
from shaftwork.core.errors import SignalError
from shaftwork.formulation.form import Names, StateForm
from shaftwork.network.graph import CircuitGraph, GraphPart
from shaftwork.network.kinds import Kind


class DenseWaves(Protocol):
    """States, and histories behind them, at any time."""

    @property
    def steps(self) -> Array:
        """Ends of the steps, the start first, s."""
        ...

    def __call__(self, times: Array) -> Array:
        """(k, n) at times (k,)."""
        ...


@runtime_checkable
class WaveReadings(Protocol):
    """What a motion of a network with lines can tell besides."""

    def held(self, times: Array) -> Array:
        """(k, lines) energy in J that is on its way in each line at times (k,)."""
        ...

    def leaving(self, times: Array) -> Array:
        """(k, ends) the waves 2 Z v + h in N m that leave the ends at times (k,), also before the start."""
        ...


class Impact(NamedTuple):
    """An instant at which energy is given or lost at once.

    Args:
        time: s.
        part: that is hit; it loses what no other does. Empty where sources jump and nothing is hit.
        given: what sources give then, in J by part.
        lost: what others lose, in J by part.
    """

    time: float
    part: str
    given: Mapping[str, float]
    lost: Mapping[str, float]


class ModelObserver:
    """Recovers every quantity of a network from its states.

    Args:
        form: the state form.
        bind: makes the array program with the parameter vector of the run; called when a quantity is first read.
        instants: times at which inputs jump: there they are read after the jump, as the states are, and where a time is
            listed twice in a row, first before it.
        quantities: those of the form, where they are known.
    """

    def __init__(
        self,
        form: StateForm,
        bind: Callable[[], BoundArrays],
        instants: Timeline = NOTHING,
        quantities: Names | None = None,
    ) -> None:
        self._form, self._bind, self._instants = form, bind, instants
        self.quantities = Names(form) if quantities is None else quantities
        self._graph: CircuitGraph = form.graph
        self._last: tuple[Array, Array, BranchHistory] | None = None

    @property
    def units(self) -> Mapping[str, str]:
        """Every quantity that can be read and its unit; where a part and a node share a name, the part's is meant."""
        return self.quantities.units

    @property
    def wiring(self) -> Mapping[str, str]:
        """By part, what it is, where it is, and what is no number of it."""
        return self.quantities.wiring

    def nodes_of(self, name: str) -> tuple[str, ...]:
        """The moving nodes that a torque or speed is of, by its name in `units`; none for other quantities."""
        return self.quantities.nodes_of(name)

    def history(self, t: Array, x: Array) -> BranchHistory:
        """All branch quantities along a trajectory; the last one asked for is kept."""
        if self._last is None or self._last[0] is not t or self._last[1] is not x:
            self._last = t, x, BranchHistory(self._bind(), self._instants.one_sided(t), x)
        return self._last[2]

    def _read(self, t: Array, x: Array, read: Callable[[BranchHistory], Array]) -> Array:
        """What is read of a trajectory; of a large one in blocks of times, since all branches take much memory."""
        parts = [*blocks(len(t), len(self._graph.branches))]
        if len(parts) == 1:
            return read(self.history(t, x))
        times, bound = self._instants.one_sided(t), self._bind()
        return np.concatenate([read(BranchHistory(bound, times[part], x[part])) for part in parts])

    def signal(self, name: str, t: Array, x: Array, dense: DenseWaves | None = None) -> Array:
        """(k,) a quantity by its name in `units`; the energy of waves is read from the motion behind the states.

        Raises:
            SignalError: such an energy, and no motion.
        """
        if name in self.quantities.signals:
            part, signal = self.quantities.signals[name]
            return self._read(t, x, lambda history: history.signal(part, signal) + 0.0)  # no -0.0, as of a sign alone
        if name in self.quantities.integrals:
            return np.asarray(x[:, self.quantities.integrals[name]])
        if name in self.quantities.nodes:
            return self._read(t, x, lambda history: np.array(history.potentials[self.quantities.nodes[name]]))
        owner, quantity = name.rsplit(".", 1)
        part = next(part for part in self._graph.parts if part.name == owner)
        if quantity == "power":
            return self._read(t, x, lambda history: history.absorbed(part))
        stored = self._read(t, x, lambda history: history.stored(part))
        return stored if part not in self._lines else stored + self._in_waves(t, dense)[owner]

    @cached_property
    def _lines(self) -> tuple[GraphPart, ...]:
        """For each line the part that it belongs to."""
        return tuple(self._graph.part_of(end) for end in self._form.waves[::2])

    def _in_waves(self, t: Array, dense: DenseWaves | None) -> dict[str, Array]:
        """Energy (k,) on its way in the lines of each part that has lines.

        Raises:
            SignalError: there are lines, and no motion along them.
        """
        if not self._lines:
            return {}
        energies: dict[str, Array] = {}
        for part, column in zip(self._lines, _carrying(dense).held(t).T, strict=True):
            energies[part.name] = energies.get(part.name, 0.0) + column
        return energies

    @cached_property
    def _profiles(self) -> dict[str, tuple[GraphPart, Profile]]:
        parts = self._graph.parts
        return {f"{p.name}.{name}": (p, profile) for p in parts for name, profile in p.component.profiles().items()}

    @cached_property
    def profiles(self) -> Mapping[str, tuple[str, tuple[float, ...]]]:
        """Every quantity that can be read along a part: its unit, and the places in m from the part's first end."""
        return {
            name: (
                profile.domain.across.unit if profile.kind == "across" else profile.domain.through.unit,
                tuple(float(self._bind().p[part.parameters[profile.length]]) * share for share in profile.places),
            )
            for name, (part, profile) in self._profiles.items()
        }

    def profile(self, name: str, t: Array, x: Array, dense: DenseWaves) -> Array:
        """(k, places) a quantity along a part by its name in `profiles`."""
        part, profile = self._profiles[name]
        if profile.lines:
            return _along_lines(self._bind(), part, profile, t, _carrying(dense))
        return self._read(t, x, lambda history: history.profile(part, profile))

    def impacts(self, dense: DenseWaves) -> tuple[Impact, ...]:
        """Instants at which sources jump that are rigidly joined to what stores energy.

        Law: what a source gives is the impulse through it times the mean of its speeds, as of a jump that is a steep
        ramp; nothing is lost.
        """
        return tuple(self._jumps(dense)) if self._form.has_impulses else ()

    def _jumps(self, dense: DenseWaves) -> Iterator[Impact]:
        bound, stores = self._bind(), StateTransfer(self._form)
        for time in self._instants.times:
            sides = np.array(self._instants.sides(time))
            if sides[0] == sides[1]:
                continue
            x = dense(np.array([np.nextafter(time, -np.inf), time]))
            gains = np.diff(stores.of(lambda: bound, sides, x), axis=0)[0].tolist()
            gained = dict(zip(stores.names, gains, strict=True))
            sources = [bound.values(t, states)[1] for t, states in zip(sides.tolist(), x, strict=True)]
            if energies := stores.given(bound, (sources[0] + sources[1]) / 2, gained):
                yield Impact(time, "", energies, {})

    def stored(self, t: Array, x: Array, dense: DenseWaves) -> dict[str, Array]:
        """Stored energy by part; of sources those that have stores of their own, such as windings."""
        history = BranchHistory(self._bind(), self._instants.one_sided(t), x)
        parts = (part for part in self._graph.parts if part.component.role != "source" or self._stores(part))
        stored = {part.name: history.stored(part) for part in parts}
        return stored | {name: stored[name] + energy for name, energy in self._in_waves(t, dense).items()}

    def held(self, t: float, x: Array) -> dict[str, float]:
        """All that is stored at a time in s with the states (n,), by name."""
        stores = StateTransfer(self._form)
        return stores.at_once(self._bind, self.read_at(t), x)

    def read_at(self, t: float) -> float:
        """When inputs are read at a time in s: after what jumps there, or at the end of a run before it."""
        return self._instants.sides(t)[1]

    def modes_at(self, t: float) -> dict[str, str]:  # noqa: ARG002
        """No part changes its mode."""
        return {}

    def _stores(self, part: GraphPart) -> bool:
        templates = (self._graph.branches[k].template for k in branches_with_power(self._graph, part))
        return any(one.kind in (Kind.ACROSS_STORE, Kind.THROUGH_STORE) or one.stored != 0 for one in templates)

    def powers(self, t: Array, x: Array) -> tuple[dict[str, Array], dict[str, Array]]:
        """Lost and supplied power by part; of weights, and of sources with resistors or dampers of their own, both."""
        history = BranchHistory(self._bind(), self._instants.one_sided(t), x)
        parts = self._graph.parts
        sources = [part for part in parts if part.component.role == "source"]
        lost = {part.name: history.lost(part) for part in parts if part not in sources}
        supplied = {part.name: -history.lost(part) for part in sources}
        for part in sources:
            kinds = {self._graph.branches[k].template.kind for k in part.branches}
            if Kind.CONDUCTANCE in kinds and len(kinds) > 1:  # a law that is linear in the speed is still a source
                lost[part.name] = history.heat(part)
                supplied[part.name] = supplied[part.name] + lost[part.name]
        weights = (p for p in parts if any(self._graph.branches[k].template.conservative for k in p.branches))
        for part in (part for part in weights if part not in sources):
            supplied[part.name] = -history.lifted(part)
            lost[part.name] = lost[part.name] + supplied[part.name]
        return lost, supplied

    def part(self, name: str) -> Component:
        """A component of the network, with the parameter values of this motion.

        Raises:
            SignalError: there is none of this name.
        """
        parts = {part.name: part for part in self._graph.parts}
        if name not in parts:
            raise SignalError(f"There is no part '{name}' in '{self._graph.name}'. There are: {', '.join(parts)}.")
        component, p = parts[name].component, self._bind().p
        places = parts[name].parameters
        return component.changed(**{key: float(p[places[key]]) for key in component.declared if key in places})


def _carrying(dense: DenseWaves | None) -> WaveReadings:
    """The motion, which knows the waves on their way.

    Raises:
        SignalError: there is none.
    """
    if not isinstance(dense, WaveReadings):
        raise SignalError("A wave is on its way, and one instant does not tell it. Read it of a motion.")
    return dense


def _along_lines(bound: BoundArrays, part: GraphPart, profile: Profile, t: Array, dense: WaveReadings) -> Array:
    """(k, places) torque or speed along a part that is made of lines.

    Law: tau = (f - g) / 2, omega = (f + g) / (2 Z), with f and g the waves that have left the two ends and come by.
    """
    ends, (impedances, delays) = bound.program.form.waves, bound.lines
    labels = {bound.program.form.graph.branches[k].template.label: k for k in part.branches}
    values = np.empty((len(t), len(profile.lines)))
    for place, (label, share) in enumerate(profile.lines):
        first = ends.index(labels[f"{label}_a" if f"{label}_a" in labels else f"{label}_middle"])
        impedance, delay = float(impedances[first // 2]), float(delays[first // 2])
        f = dense.leaving(t - share * delay)[:, first]
        g = dense.leaving(t - (1 - share) * delay)[:, first + 1]
        values[:, place] = (f - g) / 2 if profile.kind == "through" else (f + g) / (2 * impedance)
    return values
