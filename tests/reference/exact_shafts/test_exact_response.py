from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest
from scipy.linalg import solve_banded

from shaftwork.core.errors import ParameterError
from tests.reference.exact_shafts.exact_response import Complex, Drive, frequency_response, laplace_response
from tests.reference.exact_shafts.line import Array, Section, SectionLine
from tests.reference.line_modes import modes

SHAFT = Section.of_geometry(1.0, 0.02)
DAMPED = (
    Section.of_geometry(1.0, 0.02, damping=0.02, friction=1e-3),
    Section.of_geometry(0.4, 0.05, 0.03, damping=0.3),
    Section.of_geometry(2.0, 0.03, friction=0.02),
)
LINE = SectionLine(DAMPED, (0.025, 0.0, 0.3, 0.11), dampers=(0.01, 0.0, 0.2, 0.0))
# Tens of operations for each section, none of which cancels.
ROUNDING = 1e-13


def high_precision_speeds(line: SectionLine, s: complex, junction: int) -> list[mpmath.mpc]:
    """Speeds of all junctions for a unit torque, from the dense admittance matrix in 80 digits."""
    size, s = len(line.discs), mpmath.mpc(s)
    admittance = mpmath.matrix(size, size)
    for index, section in enumerate(line.sections):
        shunt = s * section.inertia + section.friction
        series = s / (section.stiffness + s * mpmath.mpf(section.damping))
        impedance = shunt / mpmath.sqrt(shunt * series)  # of the same branch as gamma
        gamma = mpmath.sqrt(shunt * series) * section.length
        for own in (index, index + 1):
            admittance[own, own] += impedance * mpmath.coth(gamma)
        admittance[index, index + 1] -= impedance * mpmath.csch(gamma)
        admittance[index + 1, index] -= impedance * mpmath.csch(gamma)
    for index, (disc, damper, clamped) in enumerate(zip(line.discs, line.dampers, line.clamped, strict=True)):
        admittance[index, index] += s * disc + damper
        if clamped:
            for other in range(size):
                admittance[index, other] = int(index == other)
    torque = mpmath.matrix(size, 1)
    torque[junction] = 1
    return list(mpmath.lu_solve(admittance, torque))


@pytest.mark.parametrize("junction", [0, 1, 2])
@pytest.mark.parametrize("s", [1e-3j, 2j, 1.0 + 300j, -20 + 5e3j, 3e4j, 500.0])
@pytest.mark.parametrize("ends", [("free", "free"), ("free", "clamped")])
def test_speeds_of_a_damped_line_agree_with_80_digits(junction: int, s: complex, ends: tuple[str, str]) -> None:
    line = SectionLine(LINE.sections, LINE.discs, LINE.dampers, ends)  # type: ignore[arg-type]
    found = laplace_response(line, np.array([s]), junction).speeds(line.junctions)[0]
    with mpmath.workdps(80):
        expected = [complex(value) for value in high_precision_speeds(line, s, junction)]
    scale = abs(expected[junction])
    assert found == pytest.approx(np.array(expected), rel=ROUNDING, abs=ROUNDING * scale)


def test_stiff_and_soft_sections_beside_each_other_lose_no_digits_at_low_frequency() -> None:
    line = SectionLine(tuple(Section(1.0, 1e-4, k, friction=1e-6) for k in (1e3, 1e15, 1e6)), (1e-9, 0.1, 1e3, 1e-3))
    s = np.array([1e-6j, 1e-2j, 1.0j])
    found = laplace_response(line, s, 0).speeds(line.junctions)
    for row, point in zip(found, s, strict=True):
        with mpmath.workdps(80):
            expected = [complex(value) for value in high_precision_speeds(line, complex(point), 0)]
        assert row == pytest.approx(np.array(expected), rel=ROUNDING)


@pytest.mark.parametrize("seed", range(60))
def test_speeds_of_random_lines_of_extreme_ratios_agree_with_200_digits(seed: int) -> None:
    draw = np.random.default_rng(seed)
    parts = int(draw.integers(1, 6))
    sections = tuple(
        Section(*10 ** draw.uniform(-4, 4, 3), *10 ** draw.uniform(-6, 3, 2) * (draw.random(2) > 0.3))
        for _ in range(parts)
    )
    discs, dampers = (10 ** draw.uniform(-9, 9, (2, parts + 1)) * (draw.random((2, parts + 1)) > 0.3)).tolist()
    line = SectionLine(sections, tuple(discs), tuple(dampers), ("free", "clamped" if draw.random() < 0.5 else "free"))
    s = complex(*10 ** draw.uniform(-6, [2, 3]) * [draw.random() > 0.5, 1])
    exponents = [
        abs(np.sqrt((s * part.inertia + part.friction) * s / (part.stiffness + s * part.damping))) * part.length
        for part in sections
    ]
    junction = int(draw.integers(0, parts))
    found = laplace_response(line, np.array([s]), junction).speeds(line.junctions)[0]
    with mpmath.workdps(200):
        expected = np.array([complex(value) for value in high_precision_speeds(line, s, junction)])
    # Rounding of the exponents G is all that errors grow with. What is 1e-14 of the driven speed counts as none.
    tolerance = 3 * ROUNDING * max(1.0, *exponents)
    assert found == pytest.approx(expected, rel=tolerance, abs=1e-14 * tolerance * abs(expected[junction]))


def test_a_bare_shaft_has_the_cotangent_of_its_delay_as_mobility() -> None:
    line, f = SectionLine((SHAFT,), (0.0, 0.0)), np.array([1.0, 400.0, 1e3, 2.2e4])
    theta = 2 * math.pi * f * SHAFT.delay
    response = frequency_response(line, f, 0)
    # cot(theta) with theta up to 44 takes on theta roundings.
    assert response.speeds(np.array([0.0]))[:, 0] == pytest.approx(
        -1j / (SHAFT.impedance * np.tan(theta)), rel=100 * ROUNDING
    )
    assert response.speeds(np.array([1.0]))[:, 0] == pytest.approx(
        -1j / (SHAFT.impedance * np.sin(theta)), rel=100 * ROUNDING
    )


def test_at_low_frequency_the_line_is_one_inertia() -> None:
    line, f = SectionLine(tuple(SHAFT for _ in range(3)), (0.025, 0.0, 1e-3, 0.11)), np.array([1e-6])
    response = frequency_response(line, f, 1).speeds(np.array([0.0, 1.5, 3.0]))
    # (f / f_1)^2 is below 1e-13.
    assert response == pytest.approx(np.full((1, 3), 1 / (2j * math.pi * f[0] * line.inertia)), rel=1e-12)


def test_at_rest_the_line_is_its_friction() -> None:
    friction = math.fsum([*LINE.dampers, *(part.friction * part.length for part in LINE.sections)])
    response = frequency_response(LINE, np.array([0.0]), 0)
    assert response.speeds(LINE.junctions) == pytest.approx(np.full((1, 4), 1 / friction), rel=ROUNDING)
    passed = response.torques(np.array([0.0, 1.0]))[0]
    assert passed[0] - passed[1] == pytest.approx(DAMPED[0].friction / friction, rel=1e-10)


@pytest.mark.parametrize("f", [1e5, 1e8, 1e12])
def test_high_frequencies_die_out_in_damped_sections_without_overflow(f: float) -> None:
    line = SectionLine((DAMPED[0],) * 50, (0.0,) * 51)
    response = frequency_response(line, np.array([f]), 0)
    s = 2j * math.pi * f
    # A wave that never returns sees the characteristic impedance alone.
    impedance = np.sqrt((s * DAMPED[0].inertia + DAMPED[0].friction) * (DAMPED[0].stiffness / s + DAMPED[0].damping))
    speeds = response.speeds(np.array([0.0, 25.3, 50.0]))[0]
    assert speeds[0] == pytest.approx(1 / impedance, rel=ROUNDING)
    assert abs(speeds[1]) < 1e-50
    assert np.isfinite(response.torques(np.array([0.0, 25.3, 50.0]))).all()


def test_a_driven_speed_is_taken_and_a_driven_torque_is_shared_by_both_sides() -> None:
    f = np.array([3.0, 50.0, 2e3])
    for junction, station in enumerate(LINE.junctions):
        at = np.array([station])
        moved = frequency_response(LINE, f, junction, drive="speed")
        assert moved.speeds(at) == pytest.approx(np.ones((3, 1)), rel=ROUNDING)
        turned = frequency_response(LINE, f, junction)
        local = (2j * math.pi * f * LINE.discs[junction] + LINE.dampers[junction]) * turned.speeds(at)[:, 0]
        into = turned.torques(at)[:, 0] if junction < 3 else 0
        out_of = turned.torques(at, side="left")[:, 0] if junction > 0 else 0
        assert local + into - out_of == pytest.approx(np.ones(3), rel=ROUNDING, abs=ROUNDING)


@pytest.mark.parametrize("drive", ["torque", "speed"])
def test_speed_and_torque_are_continuous_over_a_junction_without_a_disc(drive: Drive) -> None:
    response = frequency_response(LINE, np.array([3.0, 200.0]), 0, drive=drive)
    below, at = response.torques(np.array([1.0]), side="left"), response.torques(np.array([1.0]))
    assert below == pytest.approx(at, rel=ROUNDING)
    assert response.speeds(np.array([1.0 - 1e-9])) == pytest.approx(response.speeds(np.array([1.0])), rel=1e-6)


def test_the_motion_at_a_is_the_same_under_a_torque_at_b_as_the_other_way_round() -> None:
    f = np.array([0.1, 30.0, 1e3, 2e4])
    there = frequency_response(LINE, f, 0).speeds(LINE.junctions[[2]])
    back = frequency_response(LINE, f, 2).speeds(LINE.junctions[[0]])
    assert there == pytest.approx(back, rel=ROUNDING)


def test_the_power_that_goes_in_is_the_power_that_is_lost() -> None:
    f = np.array([5.0, 120.0, 3e3])
    response = frequency_response(LINE, f, 0)
    nodes, weights = np.polynomial.legendre.leggauss(80)
    lost = np.abs(response.speeds(LINE.junctions)) ** 2 @ np.array(LINE.dampers)
    s = (2j * math.pi * f)[:, None]
    for start, section in zip(LINE.junctions, LINE.sections, strict=False):
        stations = start + section.length * (nodes + 1) / 2
        gradient = s * response.torques(stations) / (section.stiffness + s * section.damping)
        density = section.friction * np.abs(response.speeds(stations)) ** 2 + section.damping * np.abs(gradient) ** 2
        lost += density @ weights * section.length / 2
    # Quadrature of waves with at most 3 periods in a section is exact with 80 nodes; the real part is a small
    # part of the mobility near the anti-resonances.
    assert response.speeds(np.array([0.0]))[:, 0].real == pytest.approx(lost, rel=1e-11)


def test_a_shaft_with_a_damper_of_its_impedance_at_its_end_answers_like_an_endless_one() -> None:
    line = SectionLine((SHAFT, SHAFT), (0.0,) * 3, dampers=(0.0, 0.0, SHAFT.impedance))
    f = np.array([1.0, 777.0, 5e4])
    response = frequency_response(line, f, 0)
    assert response.speeds(np.array([0.0]))[:, 0] == pytest.approx(np.full(3, 1 / SHAFT.impedance), rel=ROUNDING)
    delayed = np.exp(-2j * math.pi * f * 1.25 * SHAFT.delay)
    # The phase of some hundred radians carries as many roundings.
    assert response.torques(np.array([1.25]))[:, 0] == pytest.approx(delayed, rel=100 * ROUNDING)


def test_the_poles_are_the_natural_frequencies_and_the_residues_the_shapes() -> None:
    line = SectionLine(tuple(SHAFT for _ in range(2)), (0.025, 0.01, 0.11))
    shapes = modes(line, 6)
    omega = 2 * math.pi * shapes.frequencies[1:]
    distance = 1e-9 * omega
    speeds = laplace_response(line, 1j * omega + distance, 0).speeds(np.array([1.3]))[:, 0]
    angles = shapes.angles(np.array([0.0, 1.3]))[1:]
    # Near a pole phi(0) phi(x) / (2 (s - s_k)) remains; the other modes are 1e-9 of it times ratios of shapes below
    # 1e4, and the distance from the pole is known to 1e-14 / 1e-9.
    assert speeds * distance == pytest.approx(angles[:, 0] * angles[:, 1] / 2, rel=1e-4)


def test_a_pole_a_clamped_junction_and_an_unknown_drive_are_refused() -> None:
    line = SectionLine((SHAFT,), (0.025, 0.11), ends=("free", "free"))
    with pytest.raises(ParameterError, match=r"infinite at s = 0\+0j 1/s"):
        frequency_response(line, np.array([0.0, 1.0]), 0)
    clamped = SectionLine((SHAFT,), (0.025, 0.0), ends=("free", "clamped"))
    with pytest.raises(ParameterError, match="Junction 1 is clamped"):
        frequency_response(clamped, np.array([1.0]), 1)
    with pytest.raises(ParameterError, match="not by 'angle'"):
        frequency_response(clamped, np.array([1.0]), 0, drive="angle")  # type: ignore[arg-type]


def lumped_speeds(line: SectionLine, s: complex, cells: int) -> Complex:
    """Speeds of the ends of a one-section line under a unit torque at the left end, of a chain with half cells."""
    section = line.sections[0]
    step = section.length / cells
    share = np.full(cells + 1, step)
    share[[0, -1]] /= 2
    link = (section.stiffness / s + section.damping) / step
    own = share * (s * section.inertia + section.friction)
    own[[0, -1]] += s * np.array(line.discs) + np.array(line.dampers)
    own += link * np.array([1, *[2] * (cells - 1), 1])
    bands = np.zeros((3, cells + 1), dtype=complex)
    bands[0, 1:] = bands[2, :-1] = -link
    bands[1] = own
    torque = np.zeros(cells + 1)
    torque[0] = 1
    return np.asarray(solve_banded((1, 1), bands, torque))[[0, -1]]


def test_a_fine_lumped_chain_comes_nearer_with_the_square_of_its_cells() -> None:
    line, f = SectionLine((DAMPED[0],), (1e-4, 2e-4), dampers=(0.02, 0.0)), 900.0
    exact = frequency_response(line, np.array([f]), 0).speeds(line.junctions)[0]
    errors: Array = np.array(
        [np.abs(lumped_speeds(line, 2j * math.pi * f, cells) - exact).max() for cells in (40, 80, 160, 320)]
    )
    # The next term of the error is (pi f delay / cells)^2, below one per cent.
    assert errors[:-1] / errors[1:] == pytest.approx(np.full(3, 4.0), rel=0.02)
    assert errors[-1] < 1e-4 * np.abs(exact).max()
