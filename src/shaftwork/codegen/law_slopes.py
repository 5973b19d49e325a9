"""Slopes of all laws of a network at a point, algebraic loops passed through, and where there is none."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from shaftwork.codegen.arrays import BoundArrays
from shaftwork.codegen.elements import Array
from shaftwork.components.branches import ACROSS, INTEGRAL
from shaftwork.components.slopes import jumps
from shaftwork.core.errors import SimulationError
from shaftwork.core.notices import hint

NEARBY = 1e-9
"""A law is looked at so far to both sides of the point, as a fraction of it, to see whether it jumps there."""
JUMP = 1e-3
"""A law jumps where its two values differ by more than this fraction of them, its slope taken into account."""


def input_slopes(bound: BoundArrays, t: float, x: Array, enter: Any) -> tuple[Any, Any]:
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
    if bad := [row for made in (reads, integral) for row in made.tocoo().row[~np.isfinite(made.tocoo().data)]]:
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
    switching = np.array([jumps(made.law, ACROSS, INTEGRAL, *made.reads) for made in templates], dtype=bool)
    if not switching.any():
        return
    step_y, step_x = (NEARBY * np.maximum(np.abs(given), 1.0) for given in (y, x))
    above, below = (inputs.values(t, y + side * step_y, x + side * step_x, p) for side in (1.0, -1.0))
    by_y, by_x = inputs.slopes(t, y, x, p)
    expected = 2 * (by_y @ step_y + by_x @ step_x[: inputs.states])
    gap = np.abs(above - below - expected)
    if (bad := np.flatnonzero(switching & (gap > JUMP * np.maximum(np.abs(above), np.abs(below))))).size:
        raise SimulationError(f"{_laws_of(bound, bad)} a jump at this point and so no slope. {_elsewhere(t)}")


def _laws_of(bound: BoundArrays, places: Sequence[int] | NDArray[np.intp]) -> str:
    graph = bound.program.form.graph
    parts = (graph.part_of(int(bound.program.assembly.inputs[k])) for k in places)
    names = dict.fromkeys(f"{type(part.component).__name__} '{part.name}'" for part in parts)
    return f"The law of {', '.join(names)} has"


def _elsewhere(t: float) -> str:
    another, time = hint("at=model.steady_state()", "--steady"), hint("t=...", "--t S")
    return f"Name another point, such as {another} (the laws are read at t = {t:g} s; {time} names a time)."
