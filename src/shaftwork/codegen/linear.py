"""Small motions about a point: laws replaced by their slopes there, inputs placed beside the sources.

    x' = A x + B v + B1 v'

in deviations from the point, with v the inputs. B1 is there where a prescribed speed drives an inertia rigidly, or a
torque winds up springs in series: the derivative of the input then enters the equations.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from shaftwork.codegen.arrays import ArrayProgram, BoundArrays
from shaftwork.codegen.elements import Array
from shaftwork.codegen.law_slopes import input_slopes
from shaftwork.codegen.model import CompiledModel
from shaftwork.codegen.observer import ModelObserver
from shaftwork.codegen.recovery import BranchHistory, branches_with_power
from shaftwork.codegen.waves import DenseWaves
from shaftwork.components.branches import ACROSS, INTEGRAL
from shaftwork.components.slopes import slope
from shaftwork.core.errors import SimulationError
from shaftwork.network.graph import GROUND, GraphPart
from shaftwork.network.kinds import Kind
from shaftwork.reduction.form import StateForm
from shaftwork.reduction.source_inputs import places_of, with_inputs

Complex = NDArray[np.complexfloating[Any, Any]]


def refuse_waves(form: StateForm) -> None:
    """Refuse a network of whose lines nothing is told.

    Raises:
        SimulationError: a line has a delay that no matrix holds.
    """
    if form.waves:
        raise SimulationError(
            f"Shaft '{form.graph.part_of(form.waves[0]).name}' is a travelling wave, whose delay no matrix holds. Its "
            "modes and its frequency response are those of net.modes() and net.frequency_response(); for matrices take "
            "model=Spectral(16)."
        )


class Linearization:
    """A network near a point, as matrices and as a way to read every quantity of a small motion.

    Args:
        model: the compiled model.
        p: parameter vector.
        x: (n,) states at the point.
        t: time at which laws are read, s.
        inputs: names of the inputs.
        arriving: (q,) what arrives at the ends of lines at the point; its deviations are further inputs, after the
            named ones. Without it there must be no line.

    Raises:
        SignalError: there is no such input.
        SimulationError: a law has no finite slope at the point, or a line has a delay that no matrix holds.
    """

    def __init__(
        self, model: CompiledModel, p: Array, x: Array, t: float, inputs: Sequence[str], arriving: Array | None = None
    ) -> None:
        if arriving is None:
            refuse_waves(model.form)
        places = places_of(model.form.graph, inputs)
        form, branches = with_inputs(model.form, places)
        x = x if arriving is None else np.concatenate([x, arriving])
        self._form, self._point = form, (t, x)
        self._bound = model.bind(p) if form is model.form else ArrayProgram(form).bind(p)
        if self._bound.loops is not None and (solved := model.bind(p).loops) is not None:
            self._bound.loops.start_from(solved.solve(t, x))  # the same of several solutions
        self.states = tuple(state.name for state in form.states)
        self.state_units = tuple(state.unit for state in form.states)
        self.angles = len(form.integrals)
        self.inputs = tuple(inputs)
        part, order = self._bound.part, {int(k): row for row, k in enumerate(self._bound.program.assembly.inputs)}
        rows = [order[branch] for branch in (*branches, *form.waves)]
        entries = (
            [*(float(place.signal.sign) for place in places), *[1.0] * len(form.waves)],
            (rows, range(len(rows))),
        )
        self._enter = sparse.csr_array(entries, shape=(len(order), len(rows)))
        self._by_state, self._by_input = input_slopes(self._bound, t, x, self._enter)
        self.A = sparse.csr_array(part.A + part.B @ self._by_state)
        self.B = (part.B @ self._by_input).toarray()
        self.B1 = (part.B1 @ self._enter).toarray()
        ends = [form.outputs.index(branch) for branch in form.waves]
        self.C = sparse.csr_array(part.C[ends] + part.D[ends] @ self._by_state)
        self.D = (part.D[ends] @ self._by_input).toarray()
        self.weights = _energy_weights(self._bound)

    @cached_property
    def _names(self) -> _Reader:
        return _Reader(self._form, self._matrices)

    def _matrices(self) -> BoundArrays:
        return self._bound

    @cached_property
    def units(self) -> Mapping[str, str]:
        """Every quantity that can be read and its unit."""
        return self._names.units

    @cached_property
    def profiles(self) -> Mapping[str, tuple[str, tuple[float, ...]]]:
        """Every quantity that can be read along a part: its unit, and the places in m."""
        return self._names.profiles

    @cached_property
    def nodes(self) -> Mapping[str, tuple[str, float]]:
        """The across variable of every node that a part is joined to or that stores something: its unit and a place.

        In the order of the parts, one after the other; those inside a shaft lie between its ends as they do there.
        """
        graph, form = self._form.graph, self._form
        stores = {graph.branches[k].plus for k in (*form.across_states, *form.dependent_across)}
        found: dict[int, float] = {}
        place = -1.0
        for part in graph.parts:
            for node, step in _in_a_row(part, stores):
                if node not in found and node != GROUND:
                    place += step
                    found[node] = place
        across = {node: graph.domains[node].across for node in found}
        return {f"{graph.nodes[node]}.{made.name}": (made.unit, found[node]) for node, made in across.items()}

    @cached_property
    def masses(self) -> tuple[tuple[str, str], ...]:
        """(part, across variable of its node) for every across store, also those that are no states."""
        graph, form = self._form.graph, self._form
        found = []
        for k in sorted((*form.across_states, *form.dependent_across)):
            node = graph.branches[k].plus if graph.branches[k].plus != GROUND else graph.branches[k].minus
            if node != GROUND:  # the end of a shaft that is held
                found.append((graph.part_of(k).name, f"{graph.nodes[node]}.{graph.domains[node].across.name}"))
        return tuple(found)

    def swinging(self, s: Complex, x: Complex, v: Complex) -> Callable[[str], Complex]:
        """`motion` where everything goes as exp(s t), s (k,)."""
        return self.motion(x, v, s * v)

    def motion(self, x: Complex, v: Complex, v_rate: Complex) -> Callable[[str], Complex]:
        """A function from the name of a quantity to its deviation (k,), along a part (k, places).

        Args:
            x: (n, k) deviations of the states.
            v: (m, k) those of the inputs.
            v_rate: (m, k) their derivatives by time.
        """
        state, given, rate = (np.hstack([each.real, each.imag]) for each in (x, v, v_rate))
        u = self._by_state @ state + self._by_input @ given
        change = self.A @ state + self.B @ given + self.B1 @ rate
        history = _Deviations(self._bound, state, (u, self._enter @ rate, change), self._nominal)
        count = x.shape[1]

        def read(name: str) -> Complex:
            self._names.motion = history
            along = name in self.profiles
            values = self._names.along(name) if along else self._names.signal(name, history.t, history.x.T)
            return np.asarray(values[:count] + 1j * values[count:])

        return read

    @cached_property
    def _nominal(self) -> BranchHistory:
        t, x = self._point
        return BranchHistory(self._bound, np.array([t]), x[None, :])


def _in_a_row(part: GraphPart, stores: set[int]) -> list[tuple[int, float]]:
    """The nodes of a part from its first end to its last, each with its distance from the one before, on average 1."""
    first, *others = (part.nodes[port.name] for port in part.component.ports)
    along = next((made for made in part.component.profiles().values() if made.kind == "across"), None)
    if along is None or along.lines:
        inside = (node for node in part.nodes.values() if node in stores and node not in (first, *others))
        return [(node, 1.0) for node in (first, *inside, *others)]
    steps = np.diff(along.places)
    nodes = [part.nodes[name] for ((_, name),) in along.of]
    return [(nodes[0], 1.0), *zip(nodes[1:], (steps / steps.mean()).tolist(), strict=True)]


class _Deviations(BranchHistory):
    """All branch quantities of a small motion about a point."""

    def __init__(self, bound: BoundArrays, x: Any, given: tuple[Any, Any, Any], nominal: BranchHistory) -> None:
        super().__init__(bound, np.zeros(x.shape[1]), x.T)
        self._given, self._nominal = given, nominal

    @property
    def inputs(self) -> tuple[Array, Array, Array]:
        return self._given

    def stored(self, part: GraphPart) -> Array:
        energy = np.zeros(len(self.t))
        for index in branches_with_power(self.form.graph, part):
            coefficient = self.bound.part.coefficients[index]
            match self.form.graph.branches[index].template.kind:
                case Kind.ACROSS_STORE:
                    energy += coefficient * self._nominal.across[index] * self.across[index]
                case Kind.THROUGH_STORE:
                    energy += self._nominal.through[index] * self.through[index] / coefficient
        for index, template in self._sprung(part):
            for symbol in (one for one in (INTEGRAL, ACROSS) if template.stored.has(one)):
                force = self._nominal.of_law(index, slope(template.stored, symbol))
                energy += force * self.of_law(index, symbol)
        return energy

    def absorbed(self, part: GraphPart) -> Array:
        about, power = self._nominal, np.zeros(len(self.t))
        for k in part.branches:
            power += about.acted_on(part, k) * self.through[k] + about.through[k] * self.acted_on(part, k)
        return power


class _Reader(ModelObserver):
    """Reads small motions by name, one at a time."""

    motion: BranchHistory

    def history(self, t: Array, x: Array) -> BranchHistory:  # noqa: ARG002 (they are those of the motion)
        return self.motion

    def signal(self, name: str, t: Array, x: Array, dense: DenseWaves | None = None) -> Array:
        """(k,) a quantity by its name in `units`; the energy of a part is that in its stores, lines apart."""
        owner, _, quantity = name.rpartition(".")
        if quantity == "energy" and name not in self.quantities.signals:
            return self.motion.stored(next(part for part in self._graph.parts if part.name == owner))
        return super().signal(name, t, x, dense)

    def along(self, name: str) -> Array:
        """(k, places) a quantity along a part by its name in `profiles`."""
        return self.motion.profile(*self._profiles[name])


def _energy_weights(bound: BoundArrays) -> Array:
    """(n,) factors of the states with which the sum of squares is twice the stored energy, but for planetary gears.

    What is rigidly joined to a store or in series with it counts with it. An angle stores nothing and keeps its size.
    """
    form, F, k = bound.program.form, bound.part.loops, bound.part.coefficients
    C, L = list(form.across_states), list(form.through_states)
    K, S = list(form.dependent_across), list(form.dependent_through)
    inertia = k[C] + (F[C][:, K] ** 2) @ k[K]
    compliance = 1 / k[L] + (F[S][:, L] ** 2).T @ (1 / k[S])
    return np.concatenate([np.sqrt(inertia), np.sqrt(compliance), np.ones(len(form.integrals))])
