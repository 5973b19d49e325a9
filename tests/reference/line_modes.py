"""An independent reference: modes of lossless lines from the transcendental equation, exact, and none missed.

It shares only the description of a line with the library, whose `modes(exact=True)` searches the complex plane instead.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from shaftwork.core.errors import ParameterError
from tests.reference.exact_shafts.line import Array, Section, SectionLine, Side

Counts = npt.NDArray[np.int64]

# Below this the difference 1 - sin(y)/y is taken from its series, beyond it the difference itself is accurate.
SMALL = 0.3


@dataclass(frozen=True)
class LineModes:
    """Natural frequencies and mode shapes of a line, each of unit modal inertia.

    Law: phi_k(x) cos(omega_k t), with the integral of J' phi_k^2 and the sum of J phi_k^2 over the discs equal to 1, so
    that the motion under torques M_j(t) at junctions j is the sum over k of phi_k(x) q_k(t), where
    q_k'' + omega_k^2 q_k = sum over j of phi_k(x_j) M_j(t).

    Args:
        line: the line.
        frequencies: in Hz, shape (k,), rising; 0 is the rotation as a rigid body.
        starts: angle and torque at the left end of each section, shape (2, n, k).
        ends: angle and torque at the right end of each section, shape (2, n, k).
    """

    line: SectionLine
    frequencies: Array
    starts: Array
    ends: Array

    def angles(self, stations: Array) -> Array:
        """Shapes of angle and of speed, shape (k, stations).

        Args:
            stations: distances from the left end in m.

        Raises:
            ParameterError: a station lies outside the line.
        """
        return self._at(stations, "right")[0]

    def torques(self, stations: Array, side: Side = "right") -> Array:
        """Shapes of the torque that the left part gives to the right part, shape (k, stations).

        Args:
            stations: distances from the left end in m.
            side: on which side of a disc, where a station is a junction.

        Raises:
            ParameterError: a station lies outside the line.
        """
        return self._at(stations, side)[1]

    def _at(self, stations: Array, side: Side) -> tuple[Array, Array]:
        omega = 2 * math.pi * self.frequencies
        columns = []
        for station in np.atleast_1d(stations):
            index, distance = self.line.locate(float(station), side)
            section = self.line.sections[index]
            # The nearer end, because the angle of a heavy disc is small and would drown in the roundings of others.
            if distance <= section.length / 2:
                columns.append(_advance(section, omega, self.starts[:, index], distance))
            else:
                columns.append(_advance(section, omega, self.ends[:, index], distance - section.length))
        shapes = np.array(columns)
        return shapes[:, 0].T, shapes[:, 1].T


def modes(line: SectionLine, count: int | None = None, *, f_max: float | None = None) -> LineModes:
    """Natural frequencies and mode shapes, the first `count` or all up to `f_max`.

    Law: as for `natural_frequencies`; a shape is swept from both ends and joined in the section where the two sweeps
    agree best, so that shapes that are concentrated inside the line are as accurate as the others.

    Args:
        line: a line without losses.
        count: how many modes, the rigid one included.
        f_max: largest frequency in Hz.

    Raises:
        ParameterError: the line has losses, or not exactly one of `count` and `f_max` is given.
    """
    frequencies = natural_frequencies(line, count, f_max=f_max)
    elastic = 2 * math.pi * frequencies[frequencies > 0]
    starts, ends = _shapes(line, elastic)
    root = np.sqrt(_modal_inertia(line, elastic, starts, ends))
    starts, ends = starts / root, ends / root
    if elastic.size < frequencies.size:
        rigid = np.zeros((2, len(line.sections), 1))
        rigid[0] = line.inertia**-0.5
        starts, ends = np.concatenate([rigid, starts], axis=-1), np.concatenate([rigid, ends], axis=-1)
    return LineModes(line, frequencies, starts, ends)


def natural_frequencies(line: SectionLine, count: int | None = None, *, f_max: float | None = None) -> Array:
    """Natural frequencies in Hz, rising, the first `count` or all up to `f_max`, to rounding.

    Law: write angle and torque in a section as phi = A cos(psi), tau = Z omega A sin(psi). Then psi grows by
    omega delay along a section, and tan(psi+) = (Z- tan(psi-) + omega J) / Z+ at a disc. So psi at the right end rises
    steadily with omega, and each time that it passes the end condition there is one mode more: `modes_below` counts
    them, and bisection of the count finds every one, however close two may lie.

    Args:
        line: a line without losses.
        count: how many frequencies; a line with two free ends has the frequency 0 first.
        f_max: largest frequency in Hz.

    Raises:
        ParameterError: the line has losses, or not exactly one of `count` and `f_max` is given.

    Source: Holzer's sweep with the count of Wittrick and Williams, A general algorithm for computing natural
    frequencies of elastic structures, 1971, here as the phase angle of Pruefer.
    """
    _check_lossless(line)
    if f_max is None and count is not None and count >= 1:
        upper = _upper_bound(line, count)
    elif count is None and f_max is not None and 0 < f_max < math.inf:
        upper = 2 * math.pi * f_max
        count = int(_sweep(line, np.array([upper])).modes_below[0])
    else:
        raise ParameterError(
            "Give either the count of the modes, 1 or more, or f_max, their largest frequency in Hz, "
            f"and not count={count!r} with f_max={f_max!r}."
        )
    rigid = int(line.ends == ("free", "free"))
    roots = _bisect(line, np.arange(rigid, count), upper)
    return np.concatenate([np.zeros(rigid), roots / (2 * math.pi)])


def modes_below(line: SectionLine, frequencies: Array) -> Counts:
    """How many modes, the rigid one included, lie below each frequency in Hz.

    Raises:
        ParameterError: the line has losses.
    """
    _check_lossless(line)
    return _sweep(line, 2 * math.pi * np.atleast_1d(np.asarray(frequencies, dtype=float))).modes_below


def _check_lossless(line: SectionLine) -> None:
    if not line.lossless:
        raise ParameterError("A line with damping or friction has no real modes. Take line.without_losses().")


def _advance(section: Section, omega: Array, state: Array, distance: float) -> Array:
    """Angle and torque (2, k) `distance` further to the right in a section."""
    angle, torque = state
    theta = omega * (distance * math.sqrt(section.inertia / section.stiffness))
    compliance = distance / section.stiffness * np.sinc(theta / math.pi)
    return np.array(
        [
            angle * np.cos(theta) - torque * compliance,
            torque * np.cos(theta) + angle * section.impedance * omega * np.sin(theta),
        ]
    )


@dataclass(frozen=True)
class _ModeSweep:
    """Motions that meet the left end condition, one for each angular frequency; each section's are scaled apart.

    Args:
        starts: angle and torque at the left end of each section, shape (2, n, k).
        ends: angle and torque at the right end of each section, shape (2, n, k).
        sizes: logarithm of the factor by which they are to be multiplied, shape (n, k).
        modes_below: number of natural frequencies below each angular frequency, shape (k,).
    """

    starts: Array
    ends: Array
    sizes: Array
    modes_below: Counts


def _sweep(line: SectionLine, omega: Array) -> _ModeSweep:
    """Sweep from the left to the right end, counting the half turns of the phase psi."""
    held_left, held_right = line.clamped[0], line.clamped[-1]
    state = np.array([np.full_like(omega, 0.0 if held_left else 1.0), np.full_like(omega, -1.0 if held_left else 0.0)])
    sign = np.ones_like(omega)
    size = np.zeros_like(omega)
    nodes = np.zeros(omega.shape, dtype=np.int64)
    starts, ends, sizes = [], [], []
    for section, disc in zip(line.sections, line.discs, strict=False):
        start = np.array([state[0], state[1] + disc * omega**2 * state[0]])
        scale = np.maximum(np.abs(start[0]), np.abs(start[1]) * section.length / section.stiffness)
        start, size = start / scale, size + np.log(scale)
        phase = np.arctan2(sign * start[1], sign * start[0] * section.impedance * omega)
        state = _advance(section, omega, start, section.length)
        after = np.where(state[0] == 0, -np.sign(state[1]), np.sign(state[0]))
        # psi passes an odd multiple of pi/2 where the angle changes its sign: the parity is known, rounding or not.
        odd = after != sign
        turns = (phase + omega * section.delay) / math.pi
        nodes += 2 * np.rint((turns - odd) / 2).astype(np.int64) + odd
        sign = after
        starts.append(start)
        ends.append(state)
        sizes.append(size)
    torque = state[1] + line.discs[-1] * omega**2 * state[0]
    below = nodes if held_right else nodes + (sign * torque > 0)
    return _ModeSweep(np.stack(starts, axis=1), np.stack(ends, axis=1), np.array(sizes), below)


def _upper_bound(line: SectionLine, count: int) -> float:
    """An angular frequency above the first `count` natural frequencies."""
    upper = math.pi * (count + 1) / math.fsum(section.delay for section in line.sections)
    while _sweep(line, np.array([upper])).modes_below[0] < count:
        upper *= 2
    return upper


def _bisect(line: SectionLine, wanted: Counts, upper: float) -> Array:
    """The angular frequencies at which the count of modes passes from k to k + 1, for each k that is wanted."""
    low, high = np.zeros(wanted.size), np.full(wanted.size, upper)
    while True:
        middle = low + (high - low) / 2
        if not ((low < middle) & (middle < high)).any():
            return middle
        above = _sweep(line, middle).modes_below > wanted
        low, high = np.where(above, low, middle), np.where(above, middle, high)


def _shapes(line: SectionLine, omega: Array) -> tuple[Array, Array]:
    """Angles and torques at the starts and at the ends of the sections, shape (2, n, k) each, of any size."""
    left, mirrored = _sweep(line, omega), _sweep(line.mirrored(), omega)
    # Seen from the right end, angles are the same and torques change their sign.
    turn = np.array([1.0, -1.0])[:, None, None]
    right = _ModeSweep(
        turn * mirrored.ends[:, ::-1], turn * mirrored.starts[:, ::-1], mirrored.sizes[::-1], mirrored.modes_below
    )
    meeting, factor = _join(line, omega, left, right)
    columns = np.arange(omega.size)
    from_left = np.exp(left.sizes - left.sizes[meeting, columns])
    from_right = np.exp(right.sizes - right.sizes[meeting, columns]) * factor
    index = np.arange(len(line.sections))[:, None]
    starts = np.where(index <= meeting, left.starts * from_left, right.starts * from_right)
    ends = np.where(index < meeting, left.ends * from_left, right.ends * from_right)
    return starts, ends


def _join(line: SectionLine, omega: Array, left: _ModeSweep, right: _ModeSweep) -> tuple[Counts, Array]:
    """The section (k,) in which the sweeps are joined, and the factor (k,) of the right one's motion in it.

    The two motions span a parallelogram of the same area Z omega A_left A_right sin(psi_left - psi_right) in every
    section, so they differ least in direction where the product of their sizes is largest.
    """
    root = np.sqrt(np.array([section.impedance for section in line.sections])[:, None] * omega)
    weights = np.array([root, 1 / root])
    mine, theirs = weights * left.ends, weights * right.ends
    squares = (theirs**2).sum(axis=0)
    products = np.log((mine**2).sum(axis=0)) / 2 + np.log(squares) / 2 + left.sizes + right.sizes
    meeting = np.argmax(products, axis=0)
    factors = (mine * theirs).sum(axis=0) / squares
    return meeting, factors[meeting, np.arange(omega.size)]


def _modal_inertia(line: SectionLine, omega: Array, starts: Array, ends: Array) -> Array:
    """Integral of J' phi^2 and sum of J phi^2 over the discs, shape (k,)."""
    total = np.zeros_like(omega)
    for index, section in enumerate(line.sections):
        angle, slope = starts[0, index], starts[1, index] / (section.impedance * omega)
        y = 2 * omega * section.delay
        mean_square = (angle**2 * (2 - _sinc_defect(y)) + slope**2 * _sinc_defect(y)) / 2
        mean_product = angle * slope * np.sin(y / 2) ** 2 / (y / 2)
        total += section.inertia * section.length * (mean_square - mean_product)
    angles = np.concatenate([starts[0], ends[0, -1:]])
    moving = np.array([0.0 if clamped else disc for disc, clamped in zip(line.discs, line.clamped, strict=True)])
    total += moving @ angles**2
    return total


def _sinc_defect(y: Array) -> Array:
    """1 - sin(y)/y without cancellation."""
    with np.errstate(divide="ignore", invalid="ignore"):
        direct = 1 - np.sin(y) / y
    square = np.minimum(y, SMALL) ** 2
    series = square / 6 * (1 - square / 20 * (1 - square / 42 * (1 - square / 72 * (1 - square / 110))))
    return np.where(y < SMALL, series, direct)
