"""The names that a start value may have, and shafts of several elements: the torque along them, the speeds inside."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from typing import Any

import numpy as np
from scipy import sparse

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.array_form.linear_readings import GivenSpeeds, LinearQuantity, LinearReadings
from shaftwork.codegen.array_form.recovery import BranchHistory
from shaftwork.codegen.model_observer import ModelObserver
from shaftwork.components.base import Profile
from shaftwork.core.errors import SignalError
from shaftwork.core.notices import hint
from shaftwork.core.parameters import in_si
from shaftwork.formulation.form import StateForm, store_name
from shaftwork.network.graph import GraphPart
from shaftwork.network.kinds import Kind


@dataclass(frozen=True)
class WoundShaft:
    """A shaft whose torque can be given as a whole.

    Args:
        part: the shaft.
        profile: of its torque.
        states: numbers of its stores of torque among the states, in their order along the shaft.
    """

    part: GraphPart
    profile: Profile
    states: tuple[int, ...]

    def wind(self, bound: BoundArrays, t: float, x: Array, torque: float, fixed: Any) -> None:
        """Give each store what the damper beside it leaves of a torque, but where (n,) states keep their values."""
        states = list(self.states)
        beside = self.torques(bound, t, x) - x[states]
        x[states] = np.where(fixed[states], x[states], torque - beside)

    def torques(self, bound: BoundArrays, t: float, x: Array) -> Array:
        """(stores,) the torque at each store with the damper beside it.

        What is read at the very ends counts inertia there, so it is not read; a store there has the damper of the next.
        """
        columns = BranchHistory(bound, np.array([t]), x[None, :]).profile(self.part, self.profile)[0]
        inside, states = columns[1:-1], list(self.states)
        if len(inside) == len(states):
            return np.asarray(inside)
        return np.asarray(x[states] + np.pad(inside - x[states][1:-1], 1, mode="edge"))


def wound_shafts(form: StateForm) -> dict[str, WoundShaft]:
    """By the name of the torque along it, "line.tau", each shaft of several elements whose torques all are states."""
    shafts: dict[str, WoundShaft] = {}
    state = {branch: k for k, branch in enumerate(form.through_states, form.torques.start)}
    for part in form.graph.parts:
        stores = [k for k in part.branches if form.graph.branches[k].template.kind is Kind.THROUGH_STORE]
        for name, profile in part.component.profiles().items():
            if profile.kind == "through" and len(profile.of) > 2 and stores and all(k in state for k in stores):
                shafts[f"{part.name}.{name}"] = WoundShaft(part, profile, tuple(state[k] for k in stores))
    return shafts


def speeds_inside(form: StateForm, given: GivenSpeeds) -> dict[int, float]:
    """For each state that is a speed inside a shaft, what lies on the straight line between those of its ends."""
    owner = {form.graph.branches[branch].plus: k for k, branch in enumerate(form.across_states)}
    speeds: dict[int, float] = {}
    for nodes, places in _nodes_along(form):
        first, last = given.at_ends(nodes[0], nodes[-1])
        for node, share in zip(nodes[1:-1], places[1:-1], strict=True):
            if node in owner:
                speeds[owner[node]] = first + share * (last - first)
    return speeds


def inner_nodes(form: StateForm) -> frozenset[int]:
    """The nodes inside shafts of several elements."""
    return frozenset(node for nodes, _ in _nodes_along(form) for node in nodes[1:-1])


def node_of(form: StateForm, branch: int) -> int:
    """The node of an across store."""
    return max(form.graph.branches[branch].plus, form.graph.branches[branch].minus)


def speed_at(form: StateForm, node: int) -> str:
    """The name of the speed of a node with stores: of an inertia, or where a shaft alone ends, of the node."""
    graph, inside = form.graph, inner_nodes(form)
    for branch in (*form.across_states, *form.dependent_across):
        if node_of(form, branch) == node and inside.isdisjoint(graph.part_of(branch).nodes.values()):
            return store_name(graph, graph.branches[branch])
    return f"{graph.nodes[node]}.{graph.domains[node].across.name}"


def _nodes_along(form: StateForm) -> Iterator[tuple[list[int], tuple[float, ...]]]:
    """The nodes along each shaft of several elements, and their places in m."""
    for part in form.graph.parts:
        for profile in part.component.profiles().values():
            if profile.kind == "across" and not profile.lines and len(profile.of) > 2:
                yield [part.nodes[name] for ((_, name),) in profile.of], profile.places


class StartNames:
    """The quantities of a network as start values.

    Args:
        bound: the array program.
        t: time at which sources are read, s.
    """

    def __init__(self, bound: BoundArrays, t: float) -> None:
        self._form = form = bound.program.form
        self._bound = bound
        self._observer = ModelObserver(form, lambda: bound)
        self.readings = LinearReadings(bound, t)
        self.places = {state.name: k for k, state in enumerate(form.states)}
        """The states by name."""
        branches = form.graph.branches
        across, through = (
            {store_name(form.graph, branches[k]): k for k in dependent}
            for dependent in (form.dependent_across, form.dependent_through)
        )
        self.tied = across | through
        """The branches of the stores that are no states, by name: first inertias, then springs."""
        self.shafts = wound_shafts(form)
        """The shafts of several elements, by the name of the torque along them."""

    @cached_property
    def units(self) -> Mapping[str, str]:
        """The unit of every quantity by name."""
        units = dict(self._observer.units)
        units |= {state.name: state.unit for state in self._form.states}
        return units | {name: unit for name, (unit, _) in self._observer.profiles.items() if name in self._wound}

    @cached_property
    def _wound(self) -> Mapping[str, GraphPart]:
        """The parts that have a torque along them, by its name, as far as it can be given."""
        springs = {
            f"{part.name}.{name}": part
            for part in self._form.graph.parts
            for name, profile in part.component.profiles().items()
            if profile.kind == "through" and not profile.lines and len(profile.of) == 2
        }
        return springs | {name: shaft.part for name, shaft in self.shafts.items()}

    def checked(self, values: Mapping[str, float]) -> dict[str, float]:
        """Values in SI by name.

        Raises:
            SignalError: there is no such quantity.
            ParameterError: a value is not finite or of another unit.
        """
        for name in map(str, values):
            if name in self.units or name in self.tied:
                continue
            owner = name.rpartition(".")[0]
            siblings = (other for other in self.units if other.rpartition(".")[0] == owner)
            near = [other for other in siblings if other in self.places or self.quantity(other)] or [*self.places]
            raise SignalError(f"There is no speed, twist or torque '{name}' to start from. Near it: {', '.join(near)}.")
        return {
            str(name): in_si(f"the start value of '{name}'", value, self.units.get(str(name), "1"))
            for name, value in values.items()
        }

    def quantity(self, name: str) -> LinearQuantity | None:
        """A quantity by its name; None for one that is no sum of states."""
        if name in self.tied:
            index = self.tied[name]
            is_across = index in self._form.dependent_across
            return LinearQuantity(name, is_across, lambda h: (h.across if is_across else h.through)[index])
        quantities = self._observer.quantities
        if name in quantities.signals:
            part, signal = quantities.signals[name]
            return LinearQuantity(name, signal.kind == "across", lambda h: h.signal(part, signal))
        if name in quantities.nodes:
            number = quantities.nodes[name]
            return LinearQuantity(name, is_across=True, read=lambda h: np.asarray(h.potentials[number]))
        if name in self._wound:
            part, profile = self._wound[name], self._wound[name].component.profiles()[name.rpartition(".")[2]]
            return LinearQuantity(name, is_across=False, read=lambda h: h.profile(part, profile)[:, 0])
        return None

    def torque_along(self, name: str) -> str | None:
        """The name of the torque along the shaft of several elements whose quantity this is, if it is another one."""
        owner = name.rpartition(".")[0]
        return next((other for other, shaft in self.shafts.items() if shaft.part.name == owner and other != name), None)

    @cached_property
    def ties(self) -> Any:
        """(tied stores, n) what each of them is of the states, sparse, in the order of `tied`."""
        form, part = self._form, self._bound.part
        blocks = (
            (part.loops.T, form.dependent_across, form.across_states),
            (-part.cutsets, form.dependent_through, form.through_states),
        )
        ties = [
            sparse.csr_array(matrix)[np.array(tied, dtype=np.intp)][:, np.array(states, dtype=np.intp)]
            for matrix, tied, states in blocks
        ]
        no_angles = sparse.csr_array((0, len(form.integrals)))
        return sparse.csr_array(sparse.block_diag((*ties, no_angles)))

    def advice(self, name: str) -> str:
        """The start values to give instead of one, in words."""
        return _in_words(self._instead(name))

    def advice_for(self, stores: Iterable[str]) -> str:
        """The start values that tell all that some stores have to do with, in words."""
        return _in_words(self._states_together(k for name in stores for k in self._states_of(name)))

    def _instead(self, name: str) -> list[str]:
        """The names to give instead of one: what its part stores, else the speeds that it depends on, else all."""
        part = next((part for part in self._form.graph.parts if part.name == name.rpartition(".")[0]), None)
        quantity = self.quantity(name)
        is_across = quantity is not None and quantity.is_across
        whole = self.torque_along(name)
        if whole is not None and not is_across:
            return [whole]
        stored = [] if part is None else self._stored(part, is_across=is_across)
        if part is not None and not is_across:
            stored = stored or self._stored(part, is_across=True)
        if stored:
            return stored
        wanted = [quantity] if quantity is not None else []
        if part is not None and not is_across:
            wanted = [
                LinearQuantity("", is_across=True, read=partial(_potential, node)) for node in part.nodes.values()
            ]
        return self._states_together(self.readings.states_behind(wanted) or range(len(self.places)))

    def _stored(self, part: GraphPart, *, is_across: bool) -> list[str]:
        """What a part stores, speeds or everything else, by names that leave nothing open."""
        form = self._form
        kinds = ("across",) if is_across else ("through", "integral")
        names = [state.name for state in form.states if state.branch in part.branches and state.kind in kinds]
        tied = form.dependent_across if is_across else form.dependent_through
        names += [name for name, branch in self.tied.items() if branch in part.branches and branch in tied]
        names_to_give: dict[str, None] = {}
        for name in names:
            states = self._states_together(self._states_of(name))
            names_to_give |= dict.fromkeys([name] if len(states) == 1 else states)
        return [*names_to_give]

    def _states_of(self, name: str) -> list[int]:
        """The states that a store is made of."""
        if name in self.places:
            return [self.places[name]]
        return [int(k) for k in self.ties[[[*self.tied].index(name)]].nonzero()[1]]

    def _states_together(self, states: Iterable[int]) -> list[str]:
        """States, with those beside which they are in a tied store: given all at once, they leave none open."""
        together = np.zeros(len(self.places), dtype=bool)
        together[list(states)] = True
        entries, count = abs(self.ties), 0
        while count < (count := int(np.count_nonzero(together))):
            together |= ((entries @ together.astype(float) > 0).astype(float) @ entries) > 0
        return [name for name, place in self.places.items() if together[place]]


def _potential(node: int, history: BranchHistory) -> Array:
    return np.asarray(history.potentials[node])


def _in_words(names: Sequence[str]) -> str:
    if not names:
        return "Nothing here is stored that could be given."
    listed = ", ".join(f"'{name}': ..." for name in names)
    return f"Give {hint(f'initial={{{listed}}}', ' '.join(f'--at {name}=...' for name in names))}."
