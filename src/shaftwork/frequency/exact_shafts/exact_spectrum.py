"""Modes of a network with exact shafts: started from a mesh, refined on the exact shafts, and counted.

The mesh says about where the rates are and how many lie together. Each is then a root of the exact problem to rounding,
and the argument principle counts the roots of that problem, which knows no mesh: where both numbers agree none is lost,
doubled or spurious. At an end that takes all that arrives, nothing comes back: there the mesh has modes and the shaft
has none, and what the mesh leads to is taken as far as it is what has been counted.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from shaftwork.core.errors import NetworkWarning, ParameterError, SimulationError
from shaftwork.core.notices import warn
from shaftwork.frequency.exact_shafts.exact_lines import ExactSlopes
from shaftwork.frequency.exact_shafts.exact_problem import ExactProblem
from shaftwork.frequency.model_slopes import Complex
from shaftwork.frequency.natural_modes import Modes, checked_count, largest_rate, modes_of, states_that_act
from shaftwork.results.observer import Array

MODES = 10
"""Modes where nobody says how many."""
WIDER = 1.3
"""The mesh is right up to so many times the largest rate wanted: the circle for the count passes a gap between."""
BELOW = 0.5
"""Modes are sought up to this fraction of the rate at which, without number, they crowd."""
TOGETHER = 1e-6
"""Starts that differ by less than this fraction are refined together; roots that differ by less than half are one."""
ROOM = 1.001
"""A circle for a number of modes reaches so many times as far as the next one."""
FADED, SINGULAR = 40.0, 1e13
"""At the rate -FADED / T what fades grows to beyond rounding: the matrix then has this condition where none echoes."""
AUDIBLE = 3.0
"""Half waves up to which the count tells an end that takes all from one that throws back some rounding."""

Starts = Callable[[float, int], Modes]
"""The modes of the network with meshes that are right for |rate| up to a radius, the finer the later the attempt."""


def find_exact_modes(
    title: str, slopes: ExactSlopes, starts: Starts, count: int | None = None, f_max: float | None = None
) -> Modes:
    """The modes of smallest |rate|; see `ExactModel.modes`."""
    wanted, limit = checked_count(count), min(BELOW * slopes.lines.crowding, _echo_limit(slopes))
    if f_max is not None:
        radius = largest_rate(f_max)
        if radius > limit:
            _stop(slopes, limit, f"f_max = {f_max:g} Hz")
        return _lowest(_settled(title, slopes, starts, min(radius, limit)), wanted)
    enough = MODES if wanted is None else wanted
    radius = min(np.pi * enough / float(slopes.lines.delay.sum()), limit)
    while slopes.lines.half_waves(radius).sum() > 1.01 * enough:  # a mode for each half wave, roughly
        radius /= 2
    sizes = np.sort(np.abs(starts(WIDER * radius, 0).rates))
    if len(sizes) > enough and sizes[enough] > 0:  # no farther than these few are, which the mesh knows
        radius = min(radius, ROOM * float(sizes[enough]))
    while True:
        modes = _settled(title, slopes, starts, radius)
        if len(modes) < enough and radius == limit and (wanted is not None or np.isinf(slopes.lines.crowding)):
            _stop(slopes, limit, f"count = {enough}")
        if len(modes) >= enough or radius == limit:
            return _lowest(modes, enough)
        radius = min(2 * radius, limit)


def _echo_limit(slopes: ExactSlopes) -> float:
    """The rate up to which modes can be named where an end takes all that arrives; infinite where none does."""
    lines = slopes.lines
    s = np.array([-FADED / float(lines.delay.min())], dtype=complex)
    if np.isfinite(lines.crowding) or np.linalg.cond(_problem(slopes)[0].matrix(s)[0]) < SINGULAR:
        return np.inf
    return AUDIBLE * np.pi / float(lines.delay.max())


def _lowest(modes: Modes, count: int | None) -> Modes:
    lowest = np.argsort(np.abs(modes.rates), kind="stable")[:count]
    return modes_of(modes.title, modes.slopes, modes.rates[lowest], modes.vectors[:, lowest])


def _stop(slopes: ExactSlopes, limit: float, wanted: str) -> None:
    """Say why modes are named up to a limit alone; where they crowd there, by an error."""
    if np.isinf(slopes.lines.crowding):
        warn(
            f"{wanted}: an end of a shaft takes all that arrives at it (a damper of the impedance of the shaft), and "
            f"what does not come back makes no mode. Modes are named up to f_max = {limit / (2 * np.pi):.4g} Hz, "
            f"beyond which rounding alone would make some; for amplitudes take frequency_response.",
            NetworkWarning,
        )
        return
    shaft = slopes.lines.names[int(slopes.lines.damping.argmax())]
    most = 0.99 * BELOW * slopes.lines.crowding / (2 * np.pi)  # also with the digits that are shown
    raise ParameterError(
        f"{wanted}: the internal damping of shaft '{shaft}' makes modes without number whose rates crowd at "
        f"-C'/D' = {-slopes.lines.crowding:.4g} 1/s. All modes can be named up to f_max = {most:.4g} Hz."
    )


def _settled(title: str, slopes: ExactSlopes, starts: Starts, radius: float) -> Modes:
    """All modes with |rate| up to a radius."""
    states, weights = len(slopes.open.states), slopes.weights[:, None]
    problem, acting, following = _problem(slopes)
    for attempt in range(3):
        mesh = starts(WIDER * radius, attempt)
        outer = _gap(np.abs(mesh.rates), radius)
        inside = np.flatnonzero(np.abs(mesh.rates) < outer)
        standing, starts_inside = inside[mesh.rates[inside] == 0], mesh.rates[inside][mesh.rates[inside] != 0]
        moving = problem.count(outer) - len(standing)
        rates, shapes = _refined(problem, starts_inside if moving else starts_inside[:0], outer)
        if int(np.where(rates.imag > 0, 2, 1).sum()) != moving:  # with the conjugate ones
            continue
        vectors = np.zeros((len(weights), len(rates)), dtype=complex)
        vectors[np.concatenate([acting, np.arange(states, len(weights))])] = shapes
        vectors /= weights
        change = slopes.open.A @ vectors[:states]
        change += slopes.open.B[:, len(slopes.inputs) :] @ slopes.arriving(rates, vectors)
        vectors[following] = change[following] / rates
        rates = np.concatenate([np.zeros(len(standing), dtype=complex), rates])
        vectors = np.hstack([_standing(slopes, mesh, standing), vectors])
        below = np.abs(rates) <= radius
        return modes_of(title, slopes, rates[below], vectors[:, below])
    raise SimulationError(
        f"The modes of '{title}' up to {radius / (2 * np.pi):.6g} Hz could not be settled: those found from a mesh "
        f"differ in number from the exact ones. Ask for another f_max or count. Where an end takes nearly all that "
        f"arrives (a damper of about the shaft's impedance), modes of a mesh mean nothing: take frequency_response."
    )


def _gap(sizes: Array, radius: float) -> float:
    """The middle of the widest gap between the sizes from a radius to WIDER times it."""
    edges = np.sort(np.concatenate([[radius, WIDER * radius], sizes[(sizes > radius) & (sizes < WIDER * radius)]]))
    first = int(np.diff(np.log(edges)).argmax())
    return float(np.sqrt(edges[first] * edges[first + 1]))


def _problem(slopes: ExactSlopes) -> tuple[ExactProblem, NDArray[np.intp], NDArray[np.intp]]:
    """The problem without angles that are only recorded; the states that it has, and those that follow."""
    acting, following = states_that_act(slopes.open.angles, slopes.open.A, slopes.open.C)
    return ExactProblem(slopes, acting), acting, following


def _refined(problem: ExactProblem, starts: Complex, radius: float) -> tuple[Complex, Complex]:
    """The different roots within a radius that starts lead to, and their vectors: the mesh may have more modes."""
    rates, vectors = np.zeros(0, dtype=complex), np.zeros((problem.unknowns, 0), dtype=complex)
    for group in _together(starts):
        try:
            roots, shapes = problem.roots(starts[group])
        except SimulationError:
            continue
        new = [k for k, root in enumerate(roots) if 0 < abs(root) < radius and root.imag >= 0]
        new = [k for k in new if (np.abs(rates - roots[k]) > TOGETHER / 2 * abs(roots[k])).all()]
        rates, vectors = np.append(rates, roots[new]), np.hstack([vectors, shapes[:, new]])
    return rates, vectors


def _together(starts: Complex) -> list[list[int]]:
    """Groups of starts that lie close together."""
    groups: list[list[int]] = []
    for k in np.lexsort((starts.real, starts.imag)).tolist():
        near = groups and abs(starts[groups[-1][0]] - starts[k]) <= TOGETHER * abs(starts[k])
        groups[-1].append(k) if near else groups.append([k])
    return groups


def _standing(slopes: ExactSlopes, mesh: Modes, columns: NDArray[np.intp]) -> Complex:
    """What does not change at all, in which nothing moves along a shaft: as on the mesh, (n, k)."""
    places = {name: k for k, name in enumerate(mesh.slopes.states)}
    rows = [mesh.vectors[places[name]] if name in places else mesh.shapes[name] for name in slopes.open.states]
    middle = (f"{name}.{quantity}" for name in slopes.lines.names for quantity in ("omega", "tau"))
    rows += [(mesh.shapes[f"{quantity}_a"] + mesh.shapes[f"{quantity}_b"]) / 2 for quantity in middle]
    return np.array(rows).reshape(len(rows), len(mesh))[:, columns]
