"""A compiled network with its parameters as engines take it: the problem of a run, and the worth of its tolerances."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain
from typing import Any, NamedTuple

import numpy as np

from shaftwork.codegen.array_form.arrays import BoundArrays
from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.array_form.recovery import BranchHistory
from shaftwork.codegen.compiled_model import CompiledModel
from shaftwork.codegen.state_transfer import StateTransfer
from shaftwork.codegen.timeline import Timeline
from shaftwork.codegen.undefined_laws import rough, without_value
from shaftwork.core.calls import BoundedCache
from shaftwork.core.errors import AccuracyWarning
from shaftwork.core.notices import warn
from shaftwork.formulation.form import StateForm
from shaftwork.integrate.engines import ENGINES, too_fine
from shaftwork.integrate.problem import Fractions, LinearInputs, MachineRates, Observed, Problem
from shaftwork.network.graph import GROUND
from shaftwork.network.kinds import Kind
from shaftwork.pipeline.arguments import NOMINAL, Demand, Sizes
from shaftwork.pipeline.motion_start import Ending
from shaftwork.results.solution import Solution

HIDDEN = 10.0
"""A state is hidden where its absolute tolerance is more than this many times its relative one at its largest."""


@dataclass(frozen=True, eq=False)
class Prepared:
    """A model with a parameter vector: what depends on these alone, made once for a run of equal calls.

    Args:
        model: the compiled network.
        p: (parameters,) values.
    """

    model: CompiledModel
    p: Array

    @property
    def form(self) -> StateForm:
        """Of the model."""
        return self.model.form

    @cached_property
    def bound(self) -> BoundArrays:
        """The matrices, which many a run of compiled code can do without."""
        return self.model.bind(self.p)

    @cached_property
    def rhs(self) -> Callable[[float, Array], Array]:
        """The right-hand side."""
        scalar = self.model.scalar
        return self.bound.rhs if scalar is None else scalar.bind(self.p)

    def jacobian(self, t: float, x: Array) -> Any:
        """Of the right-hand side, sparse."""
        return self.bound.jacobian(t, x)

    @cached_property
    def _taylor(self) -> Any:
        program = self.model.taylor_program
        return None if program is None else program.bind(self.p)

    def symbolic(self) -> Any:
        """The heyoka program with the parameters, or None where there is none."""
        return self._taylor

    def compiled(self) -> MachineRates | None:
        """The right-hand side in machine code, or None where there is none."""
        program = self.model.machine_program
        return None if program is None else MachineRates(*program.bind(self.p))

    @cached_property
    def atol(self) -> Array:
        """(n,) absolute tolerances at the usual relative one."""
        return nominal_tolerances(self.form, self.model.arrays.assembly.coefficients(self.p))

    @cached_property
    def linear(self) -> LinearInputs | None:
        """The linear form, where the network is linear; waves have none, as no matrix holds a delay."""
        if not self.model.linear or self.form.waves:
            return None
        n, bound, straight = len(self.model.states), self.bound, self.model.degree is not None

        def fractions() -> Fractions | None:
            polynomials = bound.rational()
            return None if polynomials is None else Fractions(*polynomials)

        matrix = bound.jacobian(0.0, np.zeros(n)).tocsr()
        return LinearInputs(matrix, lambda t: bound.rhs(t, np.zeros((n, *np.shape(t)))), fractions, straight)

    def instants(self, span: tuple[float, float]) -> Timeline:
        """The instants of a run from start to end in s at which inputs jump or bend."""
        return self.model.switching.timeline(self.p, *span)

    def just_after(self, span: tuple[float, float]) -> float:
        """The time at which inputs are read once what jumps at the start has jumped, s."""
        return self.instants(span).sides(span[0])[1]

    def sampled(self, span: tuple[float, float]) -> Callable[[float, Array], Array] | None:
        """From a time in s and the states then to those after what controllers sample; None where none does.

        Args:
            span: start and end of the run, s.
        """
        if not self.form.samples:
            return None
        from shaftwork.control.sampled_steps import SampledSteps

        values = dict(zip(self.form.graph.parameters, self.p.tolist(), strict=True))
        return self._sampled(
            span, lambda: SampledSteps(self.form, values, lambda: self.bound, self.instants(span), span)
        )

    @cached_property
    def _sampled(self) -> BoundedCache[tuple[float, float], Callable[[float, Array], Array]]:
        return BoundedCache(1)

    def _jump(self, span: tuple[float, float]) -> Callable[[float, Array], Array] | None:
        """What a run does at an instant: first what is sampled, then the impulses of sources that jump."""
        sampled, instants = self.sampled(span), self.instants(span)
        if not self.form.has_impulses:
            return sampled
        if sampled is None:
            return lambda t, x: self.bound.impulse(x, *instants.sides(t))
        return lambda t, x: self.bound.impulse(sampled(t, x), *instants.sides(t))

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

    def problem(self, x0: Array, demand: Demand) -> Problem:
        """A run from states (n,) as an engine takes it."""
        model, span, instants = self.model, demand.span, self.instants(demand.span)
        return Problem(
            rhs=self.rhs,
            jacobian=self.jacobian,
            jacobians=lambda t, x: self.bound.jacobians(t, x),  # noqa: PLW0108 (which makes the matrices)
            x0=x0,
            t0=span[0],
            t_end=span[1],
            names=model.states,
            atol=demand.tolerances(self.atol, model.states),
            rtol=demand.rtol,
            overall=demand.sizes.overall,
            breakpoints=tuple(time for time in instants.stops if span[0] < time < span[1]),
            jump=self._jump(span),
            sides=instants.sides,
            switches=(lambda t, x: self.bound.switches(t, x))  # noqa: PLW0108 (which makes the matrices)
            if model.arrays.inputs.switching
            else None,
            t_eval=demand.t_eval,
            linear=self.linear,
            observed=observed(self) if model.linear else None,
            symbolic=self.symbolic,
            compiled=self.compiled,
            explain=lambda t, x: without_value(self.bound, t, x),
            rough=lambda t, x: rough(self.bound, t, x),
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

    model: CompiledModel
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


def in_its_size(form: StateForm, prepared: Prepared, demand: Demand, run: Callable[[Demand], Solution]) -> Solution:
    """A motion; where tolerances have hidden states, it is made again with those of its own size.

    The absolute tolerance of a state is a part of what it is at ordinary speeds. Where it never comes near that, no
    digit of it need be right. So what has been reached tells the sizes, and the next run has the tolerances of these.

    Args:
        form: of the equations with all that is stored.
        prepared: their tolerances for ordinary speeds.
        demand: what is asked of the run.
        run: makes the motion.
    """
    motion = run(demand)
    for _ in range(5):  # a motion that was hidden altogether shows its size after two or three runs
        sizes = None if demand.atol is not None else _hidden(motion, form, demand, prepared.atol)
        if sizes is None:
            break
        demand = replace(demand, sizes=sizes)
        motion = run(demand)
    return motion


def _hidden(motion: Solution, form: StateForm, demand: Demand, tolerances: Array) -> Sizes | None:
    """The sizes of a motion of which the tolerances have hidden something; None where they have not."""
    entry = ENGINES[motion.engine]
    if entry.absolute == "none" or not motion.states:
        return None
    largest, rtol = _largest(motion), demand.rtol
    overall = max(largest.values())
    if entry.absolute == "overall":
        # its one tolerance is absolute while all states are below one
        absolute = min(rtol, entry.loosest) * demand.sizes.overall
        return (
            Sizes(overall=10.0 ** math.floor(math.log10(overall))) if absolute > HIDDEN * rtol * overall > 0 else None
        )
    reached = np.array([largest.get(state.name, 0.0) for state in form.states])
    usual = demand.sizes.tolerances(tolerances, [state.name for state in form.states]) / NOMINAL
    is_angle = np.array([state.kind == "integral" for state in form.states], dtype=bool)
    ordinary = tolerances / NOMINAL
    speed = (reached / ordinary)[~is_angle].max(initial=0.0) or (reached / ordinary).max(initial=0.0)
    step = (demand.span[1] - demand.span[0]) / max(1, motion.statistics.get("steps", 1))
    # Rounding in a step moves each state at random, by 1e-14 of the size of all states together.
    floor = 1e-14 / rtol * speed * ordinary * np.where(is_angle, min(1.0, step), 1.0)
    if not ((reached > floor) & (NOMINAL * usual > HIDDEN * reached)).any():
        return None
    sizes = np.minimum(np.maximum(reached, floor), usual).tolist()
    return Sizes({state.name: size for state, size in zip(form.states, sizes, strict=True)})


def _largest(motion: Solution) -> dict[str, float]:
    """The largest absolute value of all that is stored."""
    # For an engine with one size of all states, the steps are not worth another run.
    enough = ENGINES[motion.engine].absolute == "overall" or len(motion.t) >= 64
    x = motion.x if enough else motion.dense(motion.steps)
    return dict(zip(motion.states, np.abs(x[:, : len(motion.states)]).max(axis=0).tolist(), strict=True))


def with_accuracy(motion: Solution, demand: Demand) -> Solution:
    """A motion that says with which tolerance it was made, where that is not the one that was asked for.

    Warns:
        AccuracyWarning: the motion has a caveat; or the engine that cannot keep the tolerance was asked for by name.
    """
    if motion.caveat:
        warn(motion.caveat, AccuracyWarning)
    told = too_fine(motion.engine, demand.rtol)
    if not told:
        return motion
    if demand.engine != "auto":
        warn(f"{told} Ask for no finer tolerance, or take another engine.", AccuracyWarning)
    return replace(motion, why=f"{motion.why.rstrip('.')}. {told}")
