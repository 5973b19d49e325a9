"""What depends on the parameter vector alone, and is made once for a run of equal calls."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from shaftwork.codegen.arrays import BoundArrays
from shaftwork.codegen.elements import Array
from shaftwork.integrate.problem import LinearInputs
from shaftwork.network.templates import Kind
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

    @cached_property
    def bound(self) -> BoundArrays:
        """The matrices, which many a run of compiled code can do without."""
        return self.bind(self.p)

    def jacobian(self, t: float, x: Array) -> Any:
        """Of the right-hand side, sparse."""
        return self.bound.jacobian(t, x)


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
