"""Motion of lossless lines in time, by characteristics and with spectral accuracy."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.polynomial import legendre

from shaftwork.core.errors import ParameterError, SimulationError
from shaftwork.numerics.polynomials import radau_nodes, to_integrals, to_legendre
from tests.reference.exact_shafts.line import Array, SectionLine, Side

# Delays are multiples of a common step where their ratios are such fractions, up to this relative difference.
LARGEST_DENOMINATOR = 1000
COMMENSURATE = 1e-13
# Panels are halved down to this part of the common step and up to this number: more means a law that is not smooth.
SHORTEST_PANEL = 2.0**-48
MOST_PANELS = 4096
# Times that differ by so many rounding units are one time.
ROUNDINGS = 8
NEWTON_STEPS = 30
EPSILON = float(np.finfo(float).eps)


@dataclass(frozen=True)
class JunctionTorque:
    """A torque on a junction, smooth between its breakpoints.

    Args:
        junction: number of the junction, 0 for the left end, n for the right end.
        law: torque in N m, a number or a function of an array of times; with `of_speed` a function of times and speeds.
        breakpoints: times in s at which the law or one of its derivatives jumps; it may jump at 0. A jump that is not
            given is found with many more panels, a pulse much shorter than a panel may be missed.
        of_speed: whether the law also depends on the speed of the junction, smoothly.
    """

    junction: int
    law: float | Callable[..., Array]
    breakpoints: tuple[float, ...] = ()
    of_speed: bool = False


@dataclass(frozen=True)
class LineMotion:
    """The motion of a lossless line: polynomials on panels between which alone it may have jumps and kinks.

    At a jump the value just after it is returned.

    Args:
        line: the line.
        edges: ends of the panels in s, shape (N + 1,).
        rightward: Legendre coefficients of the speed of the wave that leaves the left end of each section, (N, n, q).
        leftward: the same for the right ends and the waves to the left, (N, n, q).
        junction_speeds: Legendre coefficients of the speeds of the junctions, (N, n + 1, q).
        step: common step in s of which all delays are multiples.
        error: estimated error of speeds relative to the largest speed, and of torques relative to the largest speed
            times the impedance: the last coefficients, summed over all panels, and a rounding for each step.
    """

    line: SectionLine
    edges: Array
    rightward: Array
    leftward: Array
    junction_speeds: Array
    initial_speed: float
    step: float
    error: float

    def junction_speed(self, junction: int, t: Array) -> Array:
        """Speed of a junction in rad/s at times t, of the shape of t."""
        self.line.junction(junction)
        return self._value(self.junction_speeds[:, junction], t, self.initial_speed)

    def torque_in(self, section: int, t: Array, side: Side) -> Array:
        """Torque in N m at the left or right end of a section at times t, of the shape of t."""
        distance = 0.0 if side == "left" else self.line.sections[section].length
        return self._state(section, distance, t)[1]

    def speed(self, station: float, t: Array) -> Array:
        """Speed in rad/s at a distance in m from the left end of the line, of the shape of t."""
        return self._state(*self.line.locate(station), t)[0]

    def torque(self, station: float, t: Array, side: Side = "right") -> Array:
        """Torque in N m that the left part gives to the right part at a station, of the shape of t.

        Args:
            station: distance from the left end in m.
            t: times in s.
            side: on which side of a disc, where the station is a junction.
        """
        return self._state(*self.line.locate(station, side), t)[1]

    def _state(self, section: int, distance: float, t: Array) -> tuple[Array, Array]:
        part = self.line.sections[section]
        whole = part.delay
        elapsed = whole * (distance / part.length)
        times = np.asarray(t, dtype=float)
        right = self._value(self.rightward[:, section], times - elapsed, self.initial_speed / 2)
        left = self._value(self.leftward[:, section], times - (whole - elapsed), self.initial_speed / 2)
        return right + left, part.impedance * (right - left)

    def _value(self, coefficients: Array, t: Array, at_rest: float) -> Array:
        times = np.asarray(t, dtype=float)
        end = float(self.edges[-1])
        if times.size and float(times.max()) > end + ROUNDINGS * math.ulp(end):
            raise ParameterError(f"The motion is known up to {end:g} s, and {float(times.max()):g} s is asked for.")
        panel = np.clip(np.searchsorted(self.edges, times, side="right") - 1, 0, self.edges.size - 2)
        start, length = self.edges[panel], np.diff(self.edges)[panel]
        place = np.clip(2 * (times - start) / length - 1, -1.0, 1.0)
        basis = legendre.legvander(place, coefficients.shape[-1] - 1)
        values = np.einsum("...q,...q->...", basis, coefficients[panel])
        return np.where(times < 0, at_rest, values.reshape(times.shape))


def motion(
    line: SectionLine,
    torques: Sequence[JunctionTorque],
    t_end: float,
    *,
    initial_speed: float = 0.0,
    order: int = 16,
    tolerance: float = 1e-14,
) -> LineMotion:
    """The motion under torques, from a steady rotation without torque, which a clamped end stops at t = 0.

    Law: in each section speed = a + b and tau = Z (a - b), where the wave a to the right and the wave b to the left
    arrive unchanged at the other end after the delay. So a junction obeys
    J d omega/dt + (d + Z_left + Z_right) omega = M(t, omega) + 2 Z_left a_in + 2 Z_right b_in, the waves known.
    It is solved by Radau collocation on panels. The panels repeat with the common step of all delays and contain the
    breakpoints, so that no kink, however often reflected, lies inside one; where the Legendre coefficients of a
    speed do not decay, the panel is halved from this period on.

    Args:
        line: sections without damping and friction; their delays must be multiples of one step. Discs may be 0,
            dampers at the junctions are allowed.
        torques: torques on junctions; their laws are asked up to one step beyond t_end.
        t_end: end of the motion in s.
        initial_speed: in rad/s.
        order: nodes of a panel, at least 4.
        tolerance: size of the last two coefficients of a panel relative to the largest speed, above which it is halved.

    Raises:
        ParameterError: a section has losses, the delays have no common step, a torque's junction is clamped, or t_end
            or the order is too small.
        SimulationError: a torque is not finite, or so rough in time or speed that halving panels does not help.

    Source: characteristics as in Branin, Transient analysis of lossless transmission lines, 1967; collocation as in
    Hairer and Wanner, Solving Ordinary Differential Equations II, 1996.
    """
    if not all(section.lossless for section in line.sections):
        raise ParameterError(
            "Motion by characteristics needs sections without damping and friction. Take line.without_losses(), or "
            "invert laplace_response in time."
        )
    if not (0 < t_end < math.inf and order >= 4):
        raise ParameterError(
            f"A motion needs t_end above 0 s and an order of at least 4, not {t_end!r} s and {order!r}."
        )
    for torque in torques:
        if line.clamped[line.junction(torque.junction)]:
            raise ParameterError(f"The torque on junction {torque.junction} does nothing: the junction is clamped.")
    march = _March(line, tuple(torques), initial_speed, order, tolerance)
    for _ in range(max(1, math.ceil(t_end / march.step * (1 - ROUNDINGS * EPSILON)))):
        march.advance()
    return march.motion()


def common_step(line: SectionLine) -> tuple[float, tuple[int, ...]]:
    """The largest step in s of which the delays of all sections are multiples, and those multiples.

    Raises:
        ParameterError: there is none, with multiples of moderate size.
    """
    delays = [section.delay for section in line.sections]
    shortest = min(delays)
    ratios = [Fraction(delay / shortest).limit_denominator(LARGEST_DENOMINATOR) for delay in delays]
    parts = math.lcm(*(ratio.denominator for ratio in ratios))
    misfit = max(abs(delay / shortest / float(ratio) - 1) for delay, ratio in zip(delays, ratios, strict=True))
    if misfit > COMMENSURATE or parts > LARGEST_DENOMINATOR:
        listed = ", ".join(f"{delay:.9g} s" for delay in delays)
        raise ParameterError(
            f"The delays of the sections, {listed}, are not multiples of one common step with at most "
            f"{LARGEST_DENOMINATOR} parts in the shortest. Choose lengths whose ratios are simple fractions."
        )
    multiples = tuple(int(ratio * parts) for ratio in ratios)
    return math.fsum(delays) / sum(multiples), multiples


class _Basis:
    """Collocation at so many Radau points (q,) of [0, 1], the end included: (q, q) matrices of values at the nodes."""

    def __init__(self, order: int) -> None:
        points = radau_nodes(order)
        self.nodes: Array = (points + 1) / 2
        self.integrals: Array = to_integrals(points) / 2
        """From 0 to each node."""
        self.derivatives = np.asarray(np.linalg.inv(self.integrals))
        """At the nodes, of polynomials that are 0 at the start."""
        self.coefficients = to_legendre(points)
        """Of Legendre polynomials."""
        first, second = (legendre.legvander((points + shift) / 2, order - 1) for shift in (-1, 1))
        self.halves: tuple[Array, Array] = (first @ self.coefficients, second @ self.coefficients)
        """Values at the nodes of the first and of the second half."""


@dataclass(frozen=True)
class _Period:
    """One common step: values at the nodes of its P panels.

    Args:
        edges: ends of the panels within the period in s, shape (P + 1,).
        rightward: waves that leave the left ends of the sections, shape (P, n, q).
        leftward: waves that leave the right ends, shape (P, n, q).
        speeds: of the junctions, shape (P, n + 1, q).
    """

    edges: Array
    rightward: Array
    leftward: Array
    speeds: Array

    def halved(self, chosen: Array, halves: tuple[Array, Array]) -> _Period:
        """The same period with the chosen panels cut into two, its polynomials unchanged."""
        middles = (self.edges[:-1] + np.diff(self.edges) / 2)[chosen]
        count = np.where(chosen, 2, 1)
        first = np.cumsum(count) - count

        def cut(values: Array) -> Array:
            new = np.repeat(values, count, axis=0)
            for half, matrix in enumerate(halves):
                new[first[chosen] + half] = values[chosen] @ matrix.T
            return new

        edges = np.sort(np.concatenate([self.edges, middles]))
        return _Period(edges, cut(self.rightward), cut(self.leftward), cut(self.speeds))


class _March:
    """The periods of a motion, one after the other; the first ones are the rest before t = 0."""

    def __init__(
        self, line: SectionLine, torques: tuple[JunctionTorque, ...], initial_speed: float, order: int, tolerance: float
    ) -> None:
        self.line, self.torques, self.initial_speed, self.tolerance = line, torques, initial_speed, tolerance
        self.step, self.multiples = common_step(line)
        self.basis = _Basis(order)
        impedances = np.array([section.impedance for section in line.sections])
        self.impedance = impedances[:, None]
        self.load = np.array(line.dampers) + np.append(0.0, impedances) + np.append(impedances, 0.0)
        edges = self._edges()
        sections, panels = len(line.sections), edges.size - 1
        waves = np.full((panels, sections, order), initial_speed / 2)
        rest = _Period(edges, waves, waves, np.full((panels, sections + 1, order), initial_speed))
        self.periods = [rest] * max(self.multiples)
        self.scale = abs(initial_speed)
        self.error = 0.0
        self._prepare(edges)

    def _edges(self) -> Array:
        """Ends of the panels in each period: all that breakpoints leave when they are divided by the step."""
        edges = [0.0, self.step]
        for time in sorted({time for torque in self.torques for time in torque.breakpoints if time > 0}):
            offset = time - self.step * math.floor(time / self.step)
            if min(abs(offset - edge) for edge in edges) > ROUNDINGS * math.ulp(time):
                edges.append(offset)
        return np.array(sorted(edges))

    def _prepare(self, edges: Array) -> None:
        """Matrices by which the speeds at the nodes follow from the speed at the start of a panel and the torques."""
        self.edges = edges
        length = np.diff(edges)[:, None, None, None]
        disc = np.array(self.line.discs)[:, None, None]
        load = self.load[:, None, None]
        one, integrals, derivatives = np.eye(self.basis.nodes.size), self.basis.integrals, self.basis.derivatives
        # The same equation integrated or as it is, so that the larger of its two terms is not rounded by a product.
        heavy = disc > load * length
        rate = disc / length
        matrix = np.where(heavy, disc * one + load * length * integrals, rate * derivatives + load * one)
        start = np.where(heavy, disc, rate * derivatives.sum(axis=1, keepdims=True))
        torque = np.where(heavy, length * integrals, one)
        solution = np.linalg.solve(matrix, np.concatenate([start, torque], axis=-1))
        solution[:, np.array(self.line.clamped)] = 0.0
        self.from_start, self.from_torque = solution[..., 0], solution[..., 1:]

    def advance(self) -> None:
        """Append the next period, on halved panels where it is not resolved otherwise."""
        while True:
            period = self._solve()
            parts = (period.speeds, period.rightward, period.leftward)
            scale = max(self.scale, *(float(np.fmax.reduce(np.abs(part), axis=None)) for part in parts))
            last = np.abs(period.speeds @ self.basis.coefficients[-2:].T).max(axis=(1, 2))
            # Each reflection adds a rounding to the waves.
            noise = 4 * EPSILON * math.sqrt(len(self.periods))
            unresolved = ~(last <= (self.tolerance + noise) * scale)
            if not unresolved.any():
                self.periods.append(period)
                self.scale = scale
                self.error += float(last.sum()) + EPSILON * scale
                return
            failed = np.isnan(last)
            # What follows a panel without a solution has none either.
            self._halve(np.arange(last.size) == failed.argmax() if failed.any() else unresolved)

    def _halve(self, chosen: Array) -> None:
        lengths = np.diff(self.edges)
        if float(lengths[chosen].min()) < SHORTEST_PANEL * self.step or lengths.size > MOST_PANELS:
            time = self._start() + float(self.edges[:-1][chosen][lengths[chosen].argmin()])
            raise SimulationError(
                f"The motion is not smooth near t = {time:.9g} s. Give the times at which a torque or its slope jumps "
                "as breakpoints, and make torques smooth in the speed."
            )
        oldest = len(self.periods) - max(self.multiples)
        self.periods[oldest:] = [period.halved(chosen, self.basis.halves) for period in self.periods[oldest:]]
        self._prepare(self.periods[-1].edges)

    def _start(self) -> float:
        return (len(self.periods) - max(self.multiples)) * self.step

    def _solve(self) -> _Period:
        """The next period on the present panels."""
        last = self.periods[-1]
        arriving = [self.periods[-multiple] for multiple in self.multiples]
        from_left = np.stack([period.rightward[:, index] for index, period in enumerate(arriving)], axis=1)
        from_right = np.stack([period.leftward[:, index] for index, period in enumerate(arriving)], axis=1)
        times = self._times()
        forcing = self._torques(times)
        forcing[:, 1:] += 2 * self.impedance * from_left
        forcing[:, :-1] += 2 * self.impedance * from_right
        answers = (self.from_torque @ forcing[..., None])[..., 0]
        speeds = np.empty_like(answers)
        speed = last.speeds[-1, :, -1]
        for panel, answer in enumerate(answers):
            speeds[panel] = self.from_start[panel] * speed[:, None] + answer
            self._add_speed_torques(panel, times[panel], speeds[panel])
            speed = speeds[panel, :, -1]
        return _Period(self.edges, speeds[:, :-1] - from_right, speeds[:, 1:] - from_left, speeds)

    def _times(self) -> Array:
        """Times of the nodes, shape (P, q), clearly inside their panels: a torque may jump at both ends."""
        start = self._start()
        edges = start + self.edges
        slack = ROUNDINGS * math.ulp(start + self.step)
        nodes = edges[:-1, None] + np.diff(self.edges)[:, None] * self.basis.nodes
        inside = np.minimum(nodes, edges[1:, None] - slack)
        middle = (edges[:-1] + edges[1:])[:, None] / 2
        return np.maximum(inside, np.minimum(edges[:-1, None] + slack, middle))

    def _torques(self, times: Array) -> Array:
        """Torques that depend on time alone, shape (P, n + 1, q)."""
        values = np.zeros((times.shape[0], self.load.size, times.shape[1]))
        for torque in self.torques:
            if not torque.of_speed:
                applied = torque.law(times) if callable(torque.law) else torque.law
                if not np.isfinite(applied).all():
                    raise SimulationError(
                        f"The torque on junction {torque.junction} is not finite near t = {times[0, 0]:.9g} s."
                    )
                values[:, torque.junction] += applied
        return values

    def _add_speed_torques(self, panel: int, times: Array, speeds: Array) -> None:
        """Replace the speeds (n + 1, q) without torques that depend on speed by those with them."""
        for junction in {torque.junction: None for torque in self.torques if torque.of_speed}:
            laws = [torque.law for torque in self.torques if torque.of_speed and torque.junction == junction]
            gain = self.from_torque[panel, junction]
            free = speeds[junction].copy()
            speed = free
            for _ in range(NEWTON_STEPS):
                shift = 1e-8 * max(float(np.abs(speed).max()), self.scale, 1e-8)
                here, beside = (sum(law(times, w) for law in laws if callable(law)) for w in (speed, speed + shift))
                residual = free + gain @ here - speed
                change = np.linalg.solve(np.eye(speed.size) - gain * ((beside - here) / shift), residual)
                speed = speed + change
                if float(np.abs(change).max()) <= 1e-10 * float(np.abs(speed).max()) + EPSILON * self.scale:
                    break
            else:
                speed = np.full_like(speed, np.nan)
            speeds[junction] = speed

    def motion(self) -> LineMotion:
        """The record of all periods since t = 0."""
        periods = self.periods[max(self.multiples) :]
        starts = (self.step * number + period.edges[:-1] for number, period in enumerate(periods))
        edges = np.concatenate([*starts, [self.step * len(periods)]])

        def coefficients(name: str) -> Array:
            return np.concatenate([getattr(period, name) for period in periods]) @ self.basis.coefficients.T

        right, left, speeds = (coefficients(name) for name in ("rightward", "leftward", "speeds"))
        error = self.error / self.scale if self.scale else 0.0
        return LineMotion(self.line, edges, right, left, speeds, self.initial_speed, self.step, error)
