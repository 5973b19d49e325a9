"""Small motions about a point: laws replaced by their slopes there, inputs placed beside the sources.

    x' = A x + B v + B1 v'

in deviations from the point, with v the inputs. B1 is there where a prescribed speed drives an inertia rigidly, or a
torque winds up springs in series: the derivative of the input then enters the equations.
"""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from shaftwork.codegen.array_form.arrays import ArrayProgram, BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.array_form.recovery import BranchHistory, GivenHistory, branches_with_power
from shaftwork.codegen.compiled_model import CompiledModel
from shaftwork.codegen.model_observer import DenseWaves, ModelObserver
from shaftwork.components.branches import ACROSS, INTEGRAL
from shaftwork.components.law_slopes import jumps, slope
from shaftwork.core.errors import SimulationError
from shaftwork.core.notices import hint
from shaftwork.formulation.form import StateForm
from shaftwork.formulation.sampling_instants import refuse_sampled
from shaftwork.formulation.source_inputs import places_of, with_inputs
from shaftwork.network.graph import GROUND, GraphPart
from shaftwork.network.kinds import Kind
from shaftwork.results.observer import Complex


def refuse_waves(form: StateForm) -> None:
    """Refuse a network of whose lines nothing is told.

    Raises:
        SimulationError: a line has a delay that no matrix holds.
    """
    if not form.waves:
        return
    line = form.graph.part_of(form.waves[0])
    if not hasattr(line.component, "model"):  # of a circuit, no shaft
        raise SimulationError(
            f"{type(line.component).__name__} '{line.name}' has a delay that no matrix holds, and exact modes are "
            "those of shafts. Take n inductors of Z_0 delay / n with capacitors of delay / (Z_0 n), or simulate it."
        )
    raise SimulationError(
        f"Shaft '{line.name}' is a travelling wave, whose delay no matrix holds. Its modes and its frequency response "
        "are those of net.modes() and net.frequency_response(); for matrices take model=Spectral(16)."
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
        refuse_sampled(model.form, "no matrices A, B, C, D hold its motion")
        if arriving is None:
            refuse_waves(model.form)
        places = places_of(model.form.graph, inputs)
        form, branches = with_inputs(model.form, places)
        x = x if arriving is None else np.concatenate([x, arriving])
        self._form = form
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
        self.B1: Array = (part.B1 @ self._enter).toarray()
        self.weights = _energy_weights(self._bound)
        self._take_slopes(t, x)

    def _take_slopes(self, t: float, x: Array) -> None:
        """The matrices that follow from the slopes of the laws at a point."""
        part, form = self._bound.part, self._form
        self._point = (t, x)
        self._by_state, self._by_input = _input_slopes(self._bound, t, x, self._enter)
        self.A = sparse.csr_array(part.A + part.B @ self._by_state)
        self.B = (part.B @ self._by_input).toarray()
        ends = [form.outputs.index(branch) for branch in form.waves]
        self.C = sparse.csr_array(part.C[ends] + part.D[ends] @ self._by_state)
        self.D = (part.D[ends] @ self._by_input).toarray()

    def moved(self, x: Array, t: float) -> Linearization:
        """The same network and inputs near another point, without assembling anew.

        Args:
            x: (n,) states there.
            t: time at which laws are read, s.

        Raises:
            SimulationError: a law has no finite slope there.
        """
        other = copy.copy(self)
        vars(other).pop("_nominal", None)
        other._take_slopes(t, x)  # noqa: SLF001 (of its own class)
        return other

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
        place_of: dict[int, float] = {}
        place = -1.0
        for part in graph.parts:
            for node, step in _in_a_row(part, stores):
                if node not in place_of and node != GROUND:
                    place += step
                    place_of[node] = place
        across = {node: graph.domains[node].across for node in place_of}
        return {
            f"{graph.nodes[node]}.{variable.name}": (variable.unit, place_of[node]) for node, variable in across.items()
        }

    @cached_property
    def masses(self) -> tuple[tuple[str, str], ...]:
        """(part, across variable of its node) for every across store, also those that are no states."""
        graph, form = self._form.graph, self._form
        masses = []
        for k in sorted((*form.across_states, *form.dependent_across)):
            node = graph.branches[k].plus if graph.branches[k].plus != GROUND else graph.branches[k].minus
            if node != GROUND:  # the end of a shaft that is held
                masses.append((graph.part_of(k).name, f"{graph.nodes[node]}.{graph.domains[node].across.name}"))
        return tuple(masses)

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
        state, entering, rate = (np.hstack([each.real, each.imag]) for each in (x, v, v_rate))
        u = self._by_state @ state + self._by_input @ entering
        change = self.A @ state + self.B @ entering + self.B1 @ rate
        history = _Deviations(self._nominal, state, u, self._enter @ rate, change)
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


def _input_slopes(bound: BoundArrays, t: float, x: Array, enter: Any) -> tuple[Any, Any]:
    """The inputs u of the linear part by the states (m, n) and by the inputs from outside (m, k).

    Law: K du = S dx + E v with the slopes of the laws in S, and in K what reaches the laws through other inputs.

    Args:
        bound: the array program for one parameter vector.
        t: time at which the laws are read, s.
        x: (n,) states at the point.
        enter: (m, k) sparse, E: where the inputs from outside enter.

    Raises:
        SimulationError: a law has no finite slope at the point, or an algebraic loop turns over there.
    """
    program, part = bound.program, bound.part
    inputs = program.inputs
    y, _ = bound.values(t, x)
    _refuse_jumps(bound, t, y, x)
    reads, integral = inputs.slopes(t, y, x, bound.p)
    if bad := [row for matrix in (reads, integral) for row in matrix.tocoo().row[~np.isfinite(matrix.tocoo().data)]]:
        raise SimulationError(f"{_laws_of(bound, bad)} no finite slope at this point. {_elsewhere(t)}")
    slopes, through = reads @ part.C + integral, sparse.csr_array(reads @ part.D)
    if bound.loops is None:  # through D a law reads sources alone, and of those the controlled ones others
        passed = sparse.eye_array(inputs.size, format="csr") + through + through @ through
        return sparse.csr_array(passed @ slopes), sparse.csr_array(passed @ enter)
    return _through_loops(bound, slopes, through, enter)


def _through_loops(bound: BoundArrays, slopes: Any, through: Any, enter: Any) -> tuple[Any, Any]:
    """The same with algebraic loops, of which there are few: dense."""
    program, part = bound.program, bound.part
    K, S = np.eye(through.shape[0]) - through.toarray(), slopes.toarray()
    tree = program.loop_places[program.loop_in_tree]
    K[tree] = part.tree_law_u.toarray() - through.toarray()[tree]
    S[tree] -= part.tree_law_x.toarray()
    if not np.linalg.cond(K) * np.finfo(float).eps < 1:
        raise SimulationError(
            f"{_laws_of(bound, program.loop_places)} no slope at this point: speed and torque of the algebraic loop "
            f"turn over there. Linearise elsewhere, or give the massless node an inertia."
        )
    solved = np.linalg.solve(K, np.hstack([S, enter.toarray()]))
    return sparse.csr_array(solved[:, : S.shape[1]]), sparse.csr_array(solved[:, S.shape[1] :])


def _refuse_jumps(bound: BoundArrays, t: float, y: Array, x: Array) -> None:
    """Raise where a law that switches with its speed or angle does so at the point itself."""
    inputs, graph, p = bound.program.inputs, bound.program.form.graph, bound.p
    templates = [graph.branches[int(k)].template for k in bound.program.assembly.inputs]
    switching = np.array([jumps(template.law, ACROSS, INTEGRAL, *template.reads) for template in templates], dtype=bool)
    if not switching.any():
        return
    # A law is read so near to the point, on both sides of it. It jumps where its two values differ by more than a
    # thousandth of them, its slope taken into account.
    step_y, step_x = (1e-9 * np.maximum(np.abs(values), 1.0) for values in (y, x))
    above, below = (inputs.values(t, y + side * step_y, x + side * step_x, p) for side in (1.0, -1.0))
    by_y, by_x = inputs.slopes(t, y, x, p)
    expected = 2 * (by_y @ step_y + by_x @ step_x[: inputs.states])
    gap = np.abs(above - below - expected)
    if (bad := np.flatnonzero(switching & (gap > 1e-3 * np.maximum(np.abs(above), np.abs(below))))).size:
        raise SimulationError(f"{_laws_of(bound, bad)} a jump at this point and so no slope. {_elsewhere(t)}")


def _laws_of(bound: BoundArrays, places: Sequence[int] | NDArray[np.intp]) -> str:
    graph = bound.program.form.graph
    parts = (graph.part_of(int(bound.program.assembly.inputs[k])) for k in places)
    names = dict.fromkeys(f"{type(part.component).__name__} '{part.name}'" for part in parts)
    return f"The law of {', '.join(names)} has"


def _elsewhere(t: float) -> str:
    another, time = hint("at=model.steady_state()", "--steady"), hint("t=...", "--t S")
    return f"Name another point, such as {another} (the laws are read at t = {t:g} s; {time} names a time)."


def _in_a_row(part: GraphPart, stores: set[int]) -> list[tuple[int, float]]:
    """The nodes of a part from its first end to its last, each with its distance from the one before, on average 1."""
    first, *others = (part.nodes[port.name] for port in part.component.ports)
    along = next((profile for profile in part.component.profiles().values() if profile.kind == "across"), None)
    if along is None or along.lines:
        inside = (node for node in part.nodes.values() if node in stores and node not in (first, *others))
        return [(node, 1.0) for node in (first, *inside, *others)]
    steps = np.diff(along.places)
    nodes = [part.nodes[name] for ((_, name),) in along.of]
    return [(nodes[0], 1.0), *zip(nodes[1:], (steps / steps.mean()).tolist(), strict=True)]


class _Deviations(GivenHistory):
    """All branch quantities of a small motion about a point; for the arguments after that see `GivenHistory`."""

    def __init__(self, nominal: BranchHistory, x: Any, u: Any, slopes: Any, rate: Any) -> None:
        super().__init__(nominal.bound, x, u, slopes, rate)
        self._nominal = nominal

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

    def _read(self, t: Array, x: Array, read: Callable[[BranchHistory], Array]) -> Array:  # noqa: ARG002 (as of the motion)
        return read(self.motion)

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
