"""What depends on the parameter vector alone, and is made once for a run of equal calls."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import chain
from typing import Any

import numpy as np

from shaftwork.codegen.arrays import BoundArrays
from shaftwork.codegen.elements import Array
from shaftwork.codegen.recovery import BranchHistory
from shaftwork.integrate.problem import LinearInputs, Observed
from shaftwork.network.graph import GROUND
from shaftwork.network.kinds import Kind
from shaftwork.reduction.form import StateForm

NOMINAL = 1e-3
"""Absolute tolerance as a fraction of the relative one, for a speed of 1 rad/s (m/s, V)."""


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
