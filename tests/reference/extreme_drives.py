"""What the drives of the study of stability really do, by the equations of the continuous shaft alone.

No network, no equations of one and no engine is used, so that the truth of the study can be compared with it.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from shaftwork.components.discontinuities import breakpoints
from shaftwork.studies.stability_cases import DENSITY, SHEAR_MODULUS, TORQUE, Case
from shaftwork.studies.truth import ENDS, ShaftMotion, function_of_time
from tests.reference.exact_shafts.exact_motion import JunctionTorque, motion
from tests.reference.exact_shafts.exact_response import Complex, laplace_response
from tests.reference.exact_shafts.line import Section, SectionLine

TERMS = 16384
"""Of the Fourier series that inverts a Laplace transform."""
DECAY = 12.0
"""Its abscissa times its period: what it repeats is exp(-2 DECAY) of the motion."""
MASSLESS = 1e-13
"""Inertia of a spring that is written as a section, of that of the shaft."""


def continuous(case: Case) -> ShaftMotion:
    """The motion of the continuous shaft.

    Without damping and springs by characteristics, to rounding; after a pulse on a free shaft it repeats itself, so
    late times are early ones. Otherwise by the exact two-port in s, inverted by a Fourier series.

    Source: Dubner and Abate, Numerical inversion of Laplace transforms, 1968.
    """
    if case.damping or case.spring:
        return _by_transform(case)
    late = case.t_end - 6 * case.delay if case.periods else 0.0
    t = case.times - late
    motor = JunctionTorque(0, function_of_time(case.torque), breakpoints(case.torque))
    junctions = motion(_line(case), [motor], case.t_end - late)
    values = {
        "tau_a": junctions.torque_in(0, t, "left"),
        "tau_b": junctions.torque_in(0, t, "right"),
        "omega_a": junctions.junction_speed(0, t),
        "omega_b": junctions.junction_speed(1, t),
    }
    return ShaftMotion(values, junctions.error, "characteristics")


def _line(case: Case) -> SectionLine:
    """The shaft, and a spring behind it as a section that hardly weighs anything."""
    bare = Section.of_geometry(case.length, case.diameter, density=DENSITY, shear_modulus=SHEAR_MODULUS)
    # two inertias J_s at a spring C'/L turn against each other at sqrt(2)/delay
    section = replace(bare, damping=math.sqrt(2) * case.damping * bare.stiffness * bare.delay)
    inertia, ends = bare.inertia * bare.length, ("free", "clamped" if case.clamped else "free")
    sections, discs, dampers = [section], [case.drive * inertia], [0.0]
    if case.spring:
        sections.append(Section(1.0, MASSLESS * inertia, case.spring * bare.stiffness / bare.length))
        discs.append(0.0)
        dampers.append(0.0)
    loads = (*discs, case.load * inertia), (*dampers, case.damper * bare.impedance)
    return SectionLine(tuple(sections), *loads, ends=ends)  # type: ignore[arg-type]


def _by_transform(case: Case) -> ShaftMotion:
    t, period = case.times, 2 * case.t_end
    s = np.asarray((DECAY + 1j * np.pi * np.arange(TERMS)) / period, dtype=np.complex128)
    response, ends = laplace_response(_line(case), s, 0), np.array([0.0, case.length])
    transforms = _transform(case, s)[:, None] * np.hstack([response.torques(ends, "left"), response.speeds(ends)])
    transforms[0] /= 2
    waves = np.exp(np.outer(t, s))
    values, coarser = ((waves[:, :count] @ transforms[:count]).real / period for count in (TERMS, TERMS // 2))
    sizes = np.repeat([np.abs(values[:, :2]).max(), np.abs(values[:, 2:]).max()], 2)
    error = float((np.abs(values - coarser).max(axis=0) / sizes).max())
    return ShaftMotion(dict(zip(ENDS, values.T, strict=True)), error, "exact two-port")


def _transform(case: Case, s: Complex) -> Complex:
    """Of the torque, (k,)."""
    rise = case.rise * case.delay
    turn = 2 * np.pi / rise
    match case.form:
        case "step":
            return TORQUE / s
        case "pulse":
            return np.asarray(-TORQUE * np.expm1(-s * rise) / s)
        case "ramp":
            return np.asarray(-TORQUE * np.expm1(-s * rise) / (s**2 * rise))
        case "sine":
            return TORQUE * turn**2 / (s * (s**2 + turn**2))
