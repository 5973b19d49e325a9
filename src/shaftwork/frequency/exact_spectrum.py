"""Modes of a network with exact shafts: started from a mesh, refined on the exact shafts, and counted.

The mesh says about where the rates are and how many lie together. Each is then a root of the exact problem to rounding,
and the argument principle counts the roots of that problem, which knows no mesh: where both numbers agree none is lost,
doubled or spurious. At an end that takes all that arrives, nothing comes back: there the mesh has modes and the shaft
has none, and what the mesh leads to is taken as far as it is what has been counted.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from shaftwork.core.errors import NetworkWarning, ParameterError, SimulationError
from shaftwork.core.notices import warn
from shaftwork.frequency.exact_lines import ExactSlopes
from shaftwork.frequency.frequency_response import solved_densely
from shaftwork.frequency.natural_modes import (
    NaturalModes,
    checked_count,
    largest_rate,
    modes_of,
    states_that_act,
)
from shaftwork.numerics.tolerances import EQUAL
from shaftwork.results.observer import Array, Complex, blocks

MODES = 10
"""Modes where nobody says how many."""
WIDER = 1.3
"""The mesh is right up to so many times the largest rate wanted: the circle for the count passes a gap between."""
BELOW = 0.5
"""Modes are sought up to this fraction of the rate at which, without number, they crowd."""
Starts = Callable[[float, int], NaturalModes]
"""The modes of the network with meshes that are right for |rate| up to a radius, the finer the later the attempt."""


class ExactProblem:
    """M(s) u = 0 in variables of equal units, with rows such that M'(s) is of size one.

    Args:
        slopes: the network with its shafts.
        acting: the states of the network between them that have modes; None for all.
    """

    def __init__(self, slopes: ExactSlopes, acting: NDArray[np.intp] | None = None) -> None:
        network, lines, weights = slopes.open, slopes.lines, slopes.weights
        states, inputs = len(network.states), len(network.inputs)
        x = np.arange(states) if acting is None else acting
        rows = np.repeat(np.sqrt(lines.impedance / lines.delay), 2)[:, None]
        w = weights[x][:, None]
        self._lines, self._scale = lines, 1 / weights[states:]
        self._A = w * network.A[x][:, x].toarray() / w.T
        self._C = rows * network.C[:, x].toarray() / w.T
        self._arriving, self._through = w * network.B[x, inputs:], rows * network.D[:, inputs:]
        self._rows = rows
        self._level = np.vstack([w * network.B[x, :inputs], rows * network.D[:, :inputs]])
        self._rate = np.vstack([w * network.B1[x, :inputs], np.zeros((len(rows), inputs))])
        self._states, self.unknowns = len(x), len(x) + len(rows)
        self.size = float(max([*abs(self._A).sum(axis=0), *(1 / lines.delay)]))

    def matrix(self, s: Complex) -> Complex:
        """M (k, n, n) at s (k,)."""
        matrix = self._joined(*self._lines.ends(s))
        matrix[:, : self._states, : self._states] -= self._A
        matrix[:, self._states :, : self._states] = -self._C
        diagonal = np.arange(self._states)
        matrix[:, diagonal, diagonal] += s[:, None]
        return matrix

    def slope(self, s: Complex) -> Complex:
        """d M / d s (k, n, n)."""
        matrix = self._joined(*self._lines.end_slopes(s))
        diagonal = np.arange(self._states)
        matrix[:, diagonal, diagonal] += 1.0
        return matrix

    def driven(self, s: Complex, number: int) -> Complex:
        """The right-hand side (k, n) under an input of amplitude one."""
        return np.asarray(self._level[:, number] + np.multiply.outer(s, self._rate[:, number]))

    def solved(self, s: Complex, right: Complex) -> Complex:
        """Solutions (k, n, 2) of right-hand sides (k, n, 2), NaN where the matrix is singular."""
        return np.concatenate([solved_densely(self.matrix(s[here]), right[here]) for here in self._blocks(s)])

    def count(self, radius: float) -> int:
        """How many roots have |s| below a radius, each as often as it is one.

        Law: the integral of trace(M^-1 M') ds / (2 pi i) around them, by the midpoint rule, which converges the
        faster the farther the nearest root is from the circle. Conjugate points add up to the real part.

        Raises:
            SimulationError: it does not become a whole number.
        """
        before = np.inf
        # Points on the half circle. Two numbers of points must agree, on nearly a whole number.
        for points in (256, 512, 1024, 2048, 4096, 8192, 16384):
            s = radius * np.exp(1j * np.pi * (np.arange(points) + 0.5) / points)
            roots = float(self._turning(s).mean())
            if abs(roots - before) < 0.01 and abs(roots - round(roots)) < 0.01:
                return round(roots)
            before = roots
        raise SimulationError(
            f"The modes up to {radius / (2 * np.pi):g} Hz cannot be counted: one is too near. Ask for another f_max."
        )

    def _blocks(self, s: Complex) -> Iterator[slice]:
        return blocks(len(s), 4 * self.unknowns**2)  # the matrix, its slope, and what they make

    def _joined(self, speeds: Complex, torques: Complex) -> Complex:
        """What V and W (k, q, 2, 2) do to the rows of the network and of the ends, (k, n, n), the rest zero."""
        count, shafts = speeds.shape[:2]
        ends = np.zeros((2, count, 2 * shafts, 2 * shafts), dtype=complex)
        for k in range(shafts):
            here = slice(2 * k, 2 * k + 2)
            ends[0, :, here, here] = speeds[:, k]
            ends[1, :, here, here] = torques[:, k] - self._lines.impedance[k] * speeds[:, k]
        speed, arriving = ends * self._scale
        matrix = np.zeros((count, self.unknowns, self.unknowns), dtype=complex)
        matrix[:, : self._states, self._states :] = -self._arriving @ arriving
        matrix[:, self._states :, self._states :] = self._rows * speed - self._through @ arriving
        return matrix

    def _turning(self, s: Complex) -> Array:
        """Real part (k,) of s trace(M^-1 M')."""
        pieces = (s[here] for here in self._blocks(s))
        traces = [np.trace(np.linalg.solve(self.matrix(z), self.slope(z)), axis1=1, axis2=2) for z in pieces]
        return np.asarray((s * np.concatenate(traces)).real)

    def roots(self, starts: Complex) -> tuple[Complex, Complex]:
        """Roots (g,) next to starts (g,) that lie close together, and their vectors (n, g) in the variables given.

        Law: two-sided inverse iteration of g vectors at once, with a Rayleigh quotient in the space that they span:
        M(s) and M'(s) between them make a small linear problem for the distances of all g roots from s. What is on the
        imaginary axis stays there (nothing is lost or supplied), and on the real axis.

        Raises:
            SimulationError: they were not found.
        """
        axis = next((unit for unit in (1.0, 1j) if not (starts / unit).imag.any()), None)
        centre, before = complex(starts.mean()), np.inf
        random = np.random.default_rng(0)
        right, left = (random.normal(size=(self.unknowns, len(starts))) + 0j for _ in range(2))
        for _ in range(30):
            s = np.array([centre])
            matrix, slope = self.matrix(s)[0], self.slope(s)[0]
            right = _basis(matrix, slope @ right)
            left = _basis(matrix.conj().T, slope.conj().T @ left)
            reduced = np.linalg.solve(left.conj().T @ slope @ right, left.conj().T @ matrix @ right)
            distances, shapes = np.linalg.eig(-reduced)
            if axis is not None:
                distances = (distances / axis).real * axis
            step = complex(distances.mean())
            centre += step
            # Found where a step is rounding, or is small and shrinks no more.
            if abs(step) <= 1e-15 * abs(centre) or before <= abs(step) <= 1e-9 * abs(centre):
                return centre + distances - step, right @ shapes
            before = abs(step)
        raise SimulationError(f"No mode was found next to the rate {starts[0]:.6g} 1/s.")


def _basis(matrix: Complex, vectors: Complex) -> Complex:
    """An orthonormal basis of matrix^-1 vectors; a singular value of zero is taken for a rounding error."""
    try:
        solved = np.linalg.solve(matrix, vectors)
    except np.linalg.LinAlgError:
        left, sizes, right = np.linalg.svd(matrix)
        floored = np.maximum(sizes, np.finfo(float).eps * sizes[0])[:, None]
        solved = right.conj().T @ (left.conj().T @ vectors / floored)
    return np.asarray(np.linalg.qr(solved)[0])


def find_exact_modes(
    title: str, slopes: ExactSlopes, starts: Starts, count: int | None = None, f_max: float | None = None
) -> NaturalModes:
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
        radius = min(radius, 1.001 * float(sizes[enough]))
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
    # At the rate -40 / T what fades grows to e^40, beyond rounding: the condition is 1e13 then, where nothing echoes.
    s = np.array([-40.0 / float(lines.delay.min())], dtype=complex)
    if np.isfinite(lines.crowding) or np.linalg.cond(_problem(slopes)[0].matrix(s)[0]) < 1e13:
        return np.inf
    # Up to three half waves the count tells an end that takes all from one that throws back some rounding.
    return 3.0 * np.pi / float(lines.delay.max())


def _lowest(modes: NaturalModes, count: int | None) -> NaturalModes:
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


def _settled(title: str, slopes: ExactSlopes, starts: Starts, radius: float) -> NaturalModes:
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
        new = [k for k in new if (np.abs(rates - roots[k]) > EQUAL / 2 * abs(roots[k])).all()]
        rates, vectors = np.append(rates, roots[new]), np.hstack([vectors, shapes[:, new]])
    return rates, vectors


def _together(starts: Complex) -> list[list[int]]:
    """Groups of starts that are equal, to be refined together."""
    groups: list[list[int]] = []
    for k in np.lexsort((starts.real, starts.imag)).tolist():
        near = groups and abs(starts[groups[-1][0]] - starts[k]) <= EQUAL * abs(starts[k])
        groups[-1].append(k) if near else groups.append([k])
    return groups


def _standing(slopes: ExactSlopes, mesh: NaturalModes, columns: NDArray[np.intp]) -> Complex:
    """What does not change at all, in which nothing moves along a shaft: as on the mesh, (n, k)."""
    places = {name: k for k, name in enumerate(mesh.slopes.states)}
    rows = [mesh.vectors[places[name]] if name in places else mesh.shapes[name] for name in slopes.open.states]
    middle = (f"{name}.{quantity}" for name in slopes.lines.names for quantity in ("omega", "tau"))
    rows += [(mesh.shapes[f"{quantity}_a"] + mesh.shapes[f"{quantity}_b"]) / 2 for quantity in middle]
    return np.array(rows).reshape(len(rows), len(mesh))[:, columns]
