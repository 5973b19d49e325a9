"""A compiled network as engines take it: all that depends on parameters alone, and the problem of one run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.array_form.recovery import BranchHistory
from shaftwork.codegen.compiled_model import CompiledModel
from shaftwork.codegen.start_values import initial_state
from shaftwork.codegen.state_transfer import StateTransfer
from shaftwork.codegen.time_switches import Switching
from shaftwork.codegen.undefined_laws import rough, without_value
from shaftwork.core.calls import BoundedCache
from shaftwork.core.errors import CompileError
from shaftwork.formulation.form import StateForm
from shaftwork.integrate.engines import available
from shaftwork.integrate.problem import Fractions, LinearInputs, Observed, Problem
from shaftwork.network.graph import GROUND
from shaftwork.network.kinds import Kind
from shaftwork.pipeline.arguments import NOMINAL, Demand
from shaftwork.pipeline.motion_start import Ending


@dataclass(frozen=True, eq=False)
class Prepared:
    """Everything that depends on the parameter vector alone, made once for a run of equal calls."""

    p: Array
    bind: Callable[[Array], BoundArrays]
    rhs: Callable[[float, Array], Array]
    symbolic: Callable[[], Any]
    linear: LinearInputs | None
    atol: Array
    form: StateForm

    @cached_property
    def bound(self) -> BoundArrays:
        """The matrices, which many a run of compiled code can do without."""
        return self.bind(self.p)

    def jacobian(self, t: float, x: Array) -> Any:
        """Of the right-hand side, sparse."""
        return self.bound.jacobian(t, x)

    def taken_up(self, ending: Ending, after: float) -> Array:
        """The states (n,) that go on with what another motion stored, after what jumps at that instant.

        Where a parameter is another one, what is rigidly joined may have to change its speeds at once.

        Args:
            ending: of the motion before.
            after: time at which inputs are read from now on, s.
        """
        if ending.changed(dict(zip(self.form.graph.parameters, self.p.tolist(), strict=True))):
            stores = StateTransfer(self.form)
            ending.refuse_lacking(stores.names)
            x = stores.states(self.bound, ending.read, ending)
        else:  # without the full matrices of all stores, which a large network has no room for
            names = [state.name for state in self.form.states]
            ending.refuse_lacking(names)
            x = np.array([ending[name] for name in names])
        return self.bound.impulse(x, ending.read, after) if self.form.has_impulses and after != ending.read else x


class EngineModel(CompiledModel):
    """A compiled network whose motions engines can find.

    Args:
        form: the state form.
    """

    def __init__(self, form: StateForm) -> None:
        super().__init__(form)
        self._prepared = BoundedCache[bytes, Prepared](1)

    @cached_property
    def switching(self) -> Switching:
        """What switches because of the time alone."""
        return Switching(self.form)

    def settled(self, p: Array) -> float:
        """A time in s after which no law switches any more, for a parameter vector."""
        return max((0.0, *self.switching.known(p))) + 1.0

    def prepare(self, p: Array) -> Prepared:
        """Everything that depends on a parameter vector alone; the last one is kept."""
        return self._prepared(p.tobytes(), lambda: self._prepare(p))

    def _prepare(self, p: Array) -> Prepared:
        scalar = self.scalar
        return Prepared(
            p=p,
            bind=self.bind,
            rhs=self.bind(p).rhs if scalar is None else scalar.bind(p),
            symbolic=cache(lambda: None if self._program is None else self._program.bind(p)),
            linear=self._linear_inputs(p),
            atol=nominal_tolerances(self.form, self.arrays.assembly.coefficients(p)),
            form=self.form,
        )

    @cached_property
    def _program(self) -> Any:
        """The heyoka program, where there are rows, heyoka is installed and knows every function in them."""
        if self.rows is None or not available("heyoka"):
            return None
        from shaftwork.codegen.taylor.heyoka import build
        from shaftwork.components.laws import t as time

        try:
            return build(self.rows.states, time, self.rows.parameters, self.rows.rates)
        except CompileError:
            return None

    def _linear_inputs(self, p: Array) -> LinearInputs | None:
        """The linear form, where the network is linear."""
        if not self.linear:
            return None
        n, bound, straight = len(self.states), self.bind(p), self.degree is not None

        def fractions() -> Fractions | None:
            polynomials = bound.rational()
            return None if polynomials is None else Fractions(*polynomials)

        matrix = bound.jacobian(0.0, np.zeros(n)).tocsr()
        return LinearInputs(matrix, lambda t: bound.rhs(t, np.zeros((n, *np.shape(t)))), fractions, straight)

    def start(
        self, prepared: Prepared, initial: Mapping[str, float] | None, span: tuple[float, float]
    ) -> tuple[Array, Any]:
        """The states (n,) at the start of a run, and what else is on its way then; without waves that is nothing.

        Args:
            prepared: the equations.
            initial: start values, or where another motion ended; None for rest.
            span: start and end of the run, s.

        Raises:
            SignalError: there is no such quantity.
            ParameterError: values are not finite, contradict each other or leave something open.
        """
        if initial is None and not self.form.has_impulses:
            return np.zeros(len(self.states)), None
        after = self.just_after(prepared, span)
        if isinstance(initial, Ending):
            return prepared.taken_up(initial, after), None
        return initial_state(prepared.bound, initial or {}, after), None

    def just_after(self, prepared: Prepared, span: tuple[float, float]) -> float:
        """The time at which inputs are read once what jumps at the start has jumped, s."""
        return self.switching.timeline(prepared.p, *span).sides(span[0])[1]

    def problem(self, prepared: Prepared, x0: Array, demand: Demand) -> Problem:
        """A run from states (n,) as an engine takes it."""
        span, rtol = demand.span, demand.rtol
        instants = self.switching.timeline(prepared.p, *span)
        return Problem(
            rhs=prepared.rhs,
            jacobian=prepared.jacobian,
            x0=x0,
            t0=span[0],
            t_end=span[1],
            names=self.states,
            atol=demand.tolerances(prepared.atol, self.states),
            rtol=rtol,
            overall=demand.sizes.overall,
            breakpoints=tuple(time for time in instants.stops if span[0] < time < span[1]),
            jump=(lambda t, x: prepared.bound.impulse(x, *instants.sides(t))) if self.form.has_impulses else None,
            sides=instants.sides,
            switches=(lambda t, x: prepared.bound.switches(t, x))  # noqa: PLW0108 (which makes the matrices)
            if self.arrays.inputs.switching
            else None,
            t_eval=demand.t_eval,
            linear=prepared.linear,
            observed=observed(prepared) if self.linear else None,
            symbolic=prepared.symbolic,
            explain=lambda t, x: without_value(prepared.bound, t, x),
            rough=lambda t, x: rough(prepared.bound, t, x),
            max_steps=demand.max_steps,
            progress=demand.progress,
        )


class OperatingPoint(NamedTuple):
    """A point about which a network moves.

    Args:
        model: the equations that hold there.
        p: their parameter vector.
        time: at which laws are read, s.
        x: (n,) states.
        phase: the modes of the parts, in words; empty where none changes its mode.
    """

    model: EngineModel
    p: Array
    time: float
    x: Array
    phase: str = ""


def observed(prepared: Prepared) -> Observed:
    """What the branches of a linear network show to the engines.

    A spring and a damper side by side in a part count together too: their sum is what others feel. The through
    variable of a conductance in the tree comes from the balance of a node, so its law tells what rounding has left.
    """
    form, graph = prepared.form, prepared.form.graph
    parts = [(part, part.nodes[port.name]) for part in graph.parts for port in part.component.ports]
    nodes = {node: part.name for part, node in parts if node != GROUND}
    places, tree = list(nodes), list(form.tree_conductances)
    beside: dict[tuple[int, int, int], list[int]] = {}
    for branch in graph.branches:
        beside.setdefault((branch.part, branch.plus, branch.minus), []).append(branch.index)
    pairs = [branches for branches in beside.values() if len(branches) > 1]

    def values(times: Array, states: Array) -> Array:
        history = BranchHistory(prepared.bound, times, states)
        left = history.through[tree] - prepared.bound.part.coefficients[tree][:, None] * history.across[tree]
        sums = [history.through[pair].sum(axis=0, keepdims=True) for pair in pairs]
        return np.concatenate([history.potentials[places], history.through, *sums, left]).T

    domains = [graph.domains[max(branch.plus, branch.minus)] for branch in graph.branches]
    through = [  # that of a coupling is a multiplier, whatever its ratios make of it
        "" if branch.template.kind is Kind.COUPLING else domain.through.unit
        for branch, domain in zip(graph.branches, domains, strict=True)
    ]
    shown = [*range(len(through)), *(pair[0] for pair in pairs), *tree]
    kinds = (*(graph.domains[node].across.unit for node in nodes), *(through[branch] for branch in shown))
    owners = [graph.part_of(branch.index).name for branch in graph.branches]
    names = (*nodes.values(), *(owners[branch] for branch in shown))
    direct = np.arange(len(kinds)) < len(nodes)
    direct[[len(nodes) + branch for branch in form.through_states]] = True
    inner = np.isin(
        [*[-1] * len(nodes), *range(len(through)), *[-1] * len(pairs), *tree], list(chain.from_iterable(pairs))
    )
    return Observed(values, kinds, names, direct, inner, len(nodes), len(kinds) - len(tree))


def nominal_tolerances(form: StateForm, coefficients: Array) -> Array:
    """(n,) absolute tolerance of each state as a fraction of the relative one: of its size at a speed of one.

    A store of torque has its impedance sqrt(stiffness * inertia), or the damping beside it where that is larger: a
    tolerance below what an overdamped spring carries is lost in the rounding of an implicit step.
    """
    graph = form.graph
    damping = np.zeros(len(graph.parts))
    for branch in graph.branches:
        if branch.template.kind is Kind.CONDUCTANCE:
            damping[branch.part] = max(damping[branch.part], coefficients[branch.index])
    inertias = coefficients[list(form.across_states)]
    typical = float(np.median(inertias)) if inertias.size else 1.0
    springs = list(form.through_states)
    beside = damping[[graph.branches[index].part for index in springs]]
    torques = np.maximum(np.sqrt(np.abs(coefficients[springs]) * typical), beside)
    return NOMINAL * np.concatenate([np.ones(len(inertias)), torques, np.ones(len(form.integrals))])
