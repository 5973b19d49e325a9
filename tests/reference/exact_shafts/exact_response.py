"""Frequency response of lines with damping and friction, from the exact two-port of each section."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from shaftwork.core.errors import ParameterError
from tests.reference.exact_shafts.line import Array, Section, SectionLine, Side

Complex = npt.NDArray[np.complex128]
Drive = Literal["torque", "speed"]


@dataclass(frozen=True)
class Response:
    """The motion of a line, per unit of a torque or of a speed at one junction, as it depends on s.

    Args:
        line: the line.
        s: complex angular frequencies in rad/s, shape (k,).
        drive: "torque" or "speed", prescribed at the junction.
        junction: number of the driven junction.
    """

    line: SectionLine
    s: Complex
    drive: Drive
    junction: int
    _parts: tuple[_ResponseSweep, _ResponseSweep]
    _factors: tuple[Complex, Complex]

    def speeds(self, stations: Array) -> Complex:
        """Speed at stations, shape (k, stations), in rad/s per N m or per rad/s.

        Args:
            stations: distances from the left end in m.

        Raises:
            ParameterError: a station lies outside the line.
        """
        return self._at(stations, "right")[0]

    def torques(self, stations: Array, side: Side = "right") -> Complex:
        """Torque that the left part gives to the right part, shape (k, stations), in N m per N m or per rad/s.

        Args:
            stations: distances from the left end in m.
            side: on which side of a disc, where a station is a junction.

        Raises:
            ParameterError: a station lies outside the line.
        """
        return self._at(stations, side)[1]

    def _at(self, stations: Array, side: Side) -> tuple[Complex, Complex]:
        columns = []
        for station in np.atleast_1d(stations):
            index, distance = self.line.locate(float(station), side)
            if index < self.junction:
                speed, torque = self._parts[0].at(index, distance)
                columns.append((self._factors[0] * speed, self._factors[0] * torque))
            else:
                mirrored = len(self.line.sections) - 1 - index
                speed, torque = self._parts[1].at(mirrored, self.line.sections[index].length - distance)
                columns.append((self._factors[1] * speed, -self._factors[1] * torque))
        values = np.array(columns)
        return values[:, 0].T, values[:, 1].T


def frequency_response(line: SectionLine, frequencies: Array, junction: int, *, drive: Drive = "torque") -> Response:
    """Response to sinusoids: `laplace_response` at s = 2 pi i f.

    Args:
        line: the line.
        frequencies: in Hz, shape (k,).
        junction: where the line is driven, 0 for the left end, n for the right end.
        drive: whether a torque or a speed is prescribed there.

    Raises:
        ParameterError: there is no such junction, it is clamped, or the line resonates without bound.
    """
    return laplace_response(line, 2j * math.pi * np.asarray(frequencies, dtype=float), junction, drive=drive)


def laplace_response(line: SectionLine, s: Complex, junction: int, *, drive: Drive = "torque") -> Response:
    """Response of speed and torque, from rest, for complex s.

    Law: along a section [speed, tau] obeys the two-port [[cosh G, -B sinhc G], [-C sinhc G, cosh G]] with
    C = (s J' + friction) L, B = s L / (G I_p + s D'), G = (B C)^0.5 and sinhc G = sinh(G)/G. The motions that meet the
    left and the right end condition are swept towards the driven junction, so that both grow and nothing cancels,
    with exp(-G) taken out of each section, so that nothing overflows. The relative error is some roundings of the
    largest G.
    Analogue: the lossy transmission line with its series and shunt impedance.

    Args:
        line: the line.
        s: complex angular frequencies in rad/s, shape (k,).
        junction: where the line is driven, 0 for the left end, n for the right end.
        drive: whether a torque or a speed is prescribed there.

    Raises:
        ParameterError: there is no such junction or drive, the junction is clamped, or s is a pole of the response.

    Source: Popenda 2019, (8)-(12), with d/dt replaced by s.
    """
    line.junction(junction)
    if line.clamped[junction]:
        raise ParameterError(
            f"Junction {junction} is clamped and cannot be driven. Make this end free and prescribe its speed instead."
        )
    if drive not in {"torque", "speed"}:
        raise ParameterError(f"A line is driven by a 'torque' or by a 'speed', and not by {drive!r}.")
    points = np.atleast_1d(np.asarray(s, dtype=complex))
    left = _sweep(line, points, junction)
    right = _sweep(line.mirrored(), points, len(line.sections) - junction)
    with np.errstate(divide="ignore", invalid="ignore"):
        if drive == "speed":
            factors = 1 / left.speed, 1 / right.speed
        else:
            local = points * line.discs[junction] + line.dampers[junction]
            total = local * left.speed * right.speed - left.torque * right.speed - right.torque * left.speed
            factors = right.speed / total, left.speed / total
    infinite = ~(np.isfinite(factors[0]) & np.isfinite(factors[1]))
    if infinite.any():
        pole = complex(points[infinite][0])
        raise ParameterError(
            f"The response to a {drive} at junction {junction} is infinite at s = {pole:g} 1/s: a pole."
        )
    return Response(line, points, drive, junction, (left, right), factors)


@dataclass(frozen=True)
class _ResponseSweep:
    """The motion that meets the left end condition, of any size, from the left end to the driven junction.

    Args:
        sections: sections from the left end to the junction.
        s: complex angular frequencies, shape (k,).
        starts: speed and torque at the left end of each section, right of its disc, each section's scaled apart.
        logs: logarithm of the factor by which each section's motion is to be multiplied to fit `speed` and `torque`.
        speed: at the junction.
        torque: left of the disc of the junction.
    """

    sections: tuple[Section, ...]
    s: Complex
    starts: tuple[tuple[Complex, Complex], ...]
    logs: tuple[Complex, ...]
    speed: Complex
    torque: Complex

    def at(self, index: int, distance: float) -> tuple[Complex, Complex]:
        """Speed and torque in a section, `distance` from its left end."""
        section = self.sections[index]
        speed, torque, grown = _advance(section, self.s, *self.starts[index], distance)
        factor = np.exp(self.logs[index] + grown)
        return speed * factor, torque * factor


def _sweep(line: SectionLine, s: Complex, junction: int) -> _ResponseSweep:
    """Sweep from the left end to a junction."""
    clamped = line.clamped[0]
    speed = np.full_like(s, 0.0 if clamped else 1.0)
    torque = np.full_like(s, -1.0 if clamped else 0.0)
    sections = line.sections[:junction]
    starts, growths = [], []
    for section, disc, damper in zip(sections, line.discs, line.dampers, strict=False):
        torque = torque - (s * disc + damper) * speed
        scale = np.maximum(np.abs(speed), np.abs(torque) / section.impedance)
        speed, torque = speed / scale, torque / scale
        starts.append((speed, torque))
        speed, torque, grown = _advance(section, s, speed, torque, section.length)
        growths.append((np.log(scale), grown))
    logs: list[Complex] = []
    passed = np.zeros_like(s)
    for scale_log, grown in reversed(growths):
        passed = passed + grown
        logs.append(-passed)
        passed = passed + scale_log
    return _ResponseSweep(sections, s, tuple(starts), tuple(reversed(logs)), speed, torque)


def _advance(
    section: Section, s: Complex, speed: Complex, torque: Complex, distance: float
) -> tuple[Complex, Complex, Complex]:
    """Speed and torque `distance` further to the right, both without a factor exp(G), and that G."""
    shunt = (s * section.inertia + section.friction) * distance
    series = s * distance / (section.stiffness + s * section.damping)
    exponent = np.sqrt(shunt * series)
    double = -np.expm1(-2 * exponent)
    with np.errstate(divide="ignore", invalid="ignore"):
        sinhc = np.where(exponent == 0, 1.0, double / (2 * exponent))
    cosh = 1 - double / 2
    return speed * cosh - torque * series * sinhc, torque * cosh - speed * shunt * sinhc, exponent
