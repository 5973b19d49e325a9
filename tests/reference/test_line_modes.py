from __future__ import annotations

import itertools
import math

import mpmath
import numpy as np
import pytest

from shaftwork.core.errors import ParameterError
from tests.reference.exact_shafts.line import Array, End, Section, SectionLine
from tests.reference.line_modes import LineModes, modes, modes_below, natural_frequencies

SHAFT = Section.of_geometry(1.0, 0.02)
STEPPED = tuple(Section.of_geometry(0.1 + 0.2 * i, 0.02 + 0.03 * (i % 2)) for i in range(4))
# Sections of equal delay whose impedances alternate: they have stop bands, and fewer modes than their length promises.
STOPPING = tuple(Section(1.0, 1.0 if index % 2 else 1e-3, 1.0 if index % 2 else 1e-3) for index in range(9))
# Sections 1e12 times as stiff as others and discs from 1e-9 to 1e9 kg m2, massless junctions among them.
EXTREME = SectionLine(
    tuple(Section(1.0, 1e-4, stiffness) for stiffness in (1e3, 1e15, 1e9, 1e3, 1e15)),
    (1e-9, 0.1, 1e9, 0.0, 1e-9, 1e3),
)
# Bisection ends at the neighbouring float; the sweep adds a few roundings for each section.
ROUNDING = 2e-14
ENDS: tuple[tuple[End, End], ...] = tuple(itertools.product(("free", "clamped"), repeat=2))


def high_precision_count(line: SectionLine, frequency: mpmath.mpf) -> int:
    """Modes below a frequency by Wittrick and Williams: clamped modes and negative pivots, with 60 digits."""
    omega = 2 * mpmath.pi * frequency
    diagonal = [-mpmath.mpf(disc) * omega for disc in line.discs]
    links, clamped_modes = [], 0
    for index, section in enumerate(line.sections):
        impedance = mpmath.sqrt(mpmath.mpf(section.inertia) * section.stiffness)
        theta = omega * mpmath.mpf(section.length) * mpmath.sqrt(mpmath.mpf(section.inertia) / section.stiffness)
        clamped_modes += int(mpmath.floor(theta / mpmath.pi))
        diagonal[index] += impedance * mpmath.cot(theta)
        diagonal[index + 1] += impedance * mpmath.cot(theta)
        links.append(impedance * mpmath.csc(theta))
    first, last = int(line.clamped[0]), len(diagonal) - int(line.clamped[-1])
    negative, pivot = 0, None
    for index in range(first, last):
        pivot = diagonal[index] - (links[index - 1] ** 2 / pivot if pivot is not None else 0)
        negative += pivot < 0
    return clamped_modes + negative


def modal_inertias(shapes: LineModes) -> Array:
    """Integrals of J' phi_i phi_k and the sums over the discs, by Gauss quadrature."""
    line = shapes.line
    nodes, weights = np.polynomial.legendre.leggauss(60)
    total = np.zeros((shapes.frequencies.size, shapes.frequencies.size))
    for start, section in zip(line.junctions, line.sections, strict=False):
        angles = shapes.angles(start + section.length * (nodes + 1) / 2)
        total += section.inertia * section.length / 2 * (angles * weights) @ angles.T
    for station, disc, clamped in zip(line.junctions, line.discs, line.clamped, strict=True):
        angle = shapes.angles(np.array([station]))[:, 0]
        total += 0 if clamped else disc * np.outer(angle, angle)
    return total


@pytest.mark.parametrize(
    ("ends", "half_waves"),
    [
        (("free", "free"), np.arange(6)),
        (("clamped", "free"), np.arange(6) + 0.5),
        (("free", "clamped"), np.arange(6) + 0.5),
        (("clamped", "clamped"), np.arange(1, 7)),
    ],
)
def test_a_bare_shaft_has_whole_or_half_multiples_of_v_over_2_L(ends: tuple[End, End], half_waves: Array) -> None:
    expected = half_waves / (2 * SHAFT.delay)
    assert natural_frequencies(SectionLine((SHAFT,), (0.0, 0.0), ends=ends), 6) == pytest.approx(expected, rel=1e-14)


@pytest.mark.parametrize("ends", ENDS)
@pytest.mark.parametrize("parts", [2, 3, 4])
def test_a_shaft_cut_into_parts_keeps_its_modes_though_they_have_nodes_at_the_cuts(
    ends: tuple[End, End], parts: int
) -> None:
    whole = modes(SectionLine((SHAFT,), (0.02, 0.03), ends=ends), 8)
    discs = (0.02, *[0.0] * (parts - 1), 0.03)
    cut = modes(SectionLine((Section.of_geometry(1 / parts, 0.02),) * parts, discs, ends=ends), 8)
    assert cut.frequencies == pytest.approx(whole.frequencies, rel=ROUNDING)
    stations = np.linspace(0.0, 1.0, 13)
    # Shapes of bare modes have size Jshaft^-0.5, about 130; they take on some ten roundings.
    assert np.abs(cut.angles(stations) - whole.angles(stations)).max() < 1e-11 * np.abs(whole.angles(stations)).max()


def test_two_discs_on_a_light_shaft_swing_like_two_masses_on_a_spring() -> None:
    # The shaft's inertia of 1e-18 of the discs' is below the rounding.
    line = SectionLine((Section(0.5, 1e-19, 300.0),), (0.1, 0.4))
    expected = math.sqrt(300.0 / 0.5 * (1 / 0.1 + 1 / 0.4)) / (2 * math.pi)
    assert natural_frequencies(line, 2)[1] == pytest.approx(expected, rel=ROUNDING)


@pytest.mark.parametrize("discs", [(0.025, 0.11), (0.025, 0.025), (1e-9, 1e3), (5.0, 1e-6)])
def test_a_shaft_with_two_discs_obeys_the_tangent_equation(discs: tuple[float, float]) -> None:
    line = SectionLine((SHAFT,), discs)
    found = natural_frequencies(line, 6)[1:]
    with mpmath.workdps(40):
        delay = mpmath.sqrt(mpmath.mpf(SHAFT.inertia) / SHAFT.stiffness)
        ratios = [mpmath.mpf(disc) / mpmath.mpf(SHAFT.inertia) for disc in discs]

        def residual(theta: mpmath.mpf) -> mpmath.mpf:
            first, second = (ratio * theta for ratio in ratios)
            return (1 - first * second) * mpmath.sin(theta) + (first + second) * mpmath.cos(theta)

        for frequency in found:
            guess = 2 * mpmath.pi * mpmath.mpf(float(frequency)) * delay
            theta = mpmath.findroot(residual, (guess * (1 - mpmath.mpf(10) ** -12), guess))
            assert abs(guess / theta - 1) < ROUNDING


@pytest.mark.parametrize(
    ("disc", "expected"),
    [
        (0.11, (0.0, 38.88573365, 1567.02210303, 3132.59539509)),
        (0.025, (0.0, 49.64737792, 1567.62972935, 3132.89957778)),
    ],
)
def test_the_shaft_of_popenda_has_its_known_frequencies(disc: float, expected: tuple[float, ...]) -> None:
    # The numbers are printed with ten digits or more.
    assert natural_frequencies(SectionLine((SHAFT,), (0.025, disc)), 4) == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("ends", ENDS)
@pytest.mark.parametrize("count", [5, 25])
@pytest.mark.parametrize(
    ("sections", "discs"),
    [(STEPPED, (0.1, 0.0, 2.0, 1e-3, 0.05)), (EXTREME.sections, EXTREME.discs), (STOPPING, (0.0,) * 10)],
)
def test_each_frequency_lies_where_the_count_in_60_digits_steps_up(
    sections: tuple[Section, ...], discs: tuple[float, ...], count: int, ends: tuple[End, End]
) -> None:
    line = SectionLine(sections, discs, ends=ends)
    found = natural_frequencies(line, count)
    assert found.size == count
    rigid = int(ends == ("free", "free"))
    with mpmath.workdps(60):
        for number, frequency in enumerate(found[rigid:], start=rigid):
            near = mpmath.mpf(float(frequency))
            assert high_precision_count(line, near * (1 - mpmath.mpf(ROUNDING))) <= number
            assert high_precision_count(line, near * (1 + mpmath.mpf(ROUNDING))) >= number + 1


@pytest.mark.parametrize("ends", ENDS)
def test_all_modes_up_to_a_frequency_are_as_many_as_wittrick_and_williams_count(ends: tuple[End, End]) -> None:
    line = SectionLine(STEPPED, (0.1, 0.0, 2.0, 1e-3, 0.05), ends=ends)
    for limit in (1.0, 5e3, 1e5):
        with mpmath.workdps(60):
            expected = high_precision_count(line, mpmath.mpf(limit))
        assert natural_frequencies(line, f_max=limit).size == expected
        assert modes_below(line, np.array([limit])).tolist() == [expected]


def test_pairs_of_almost_equal_frequencies_are_both_found() -> None:
    # Two equal shafts on both sides of a disc that hardly moves: each mode comes twice, 1e-9 or less apart.
    line = SectionLine((SHAFT, SHAFT), (0.0, 1e6, 0.0))
    found = natural_frequencies(line, 41)[1:].reshape(20, 2)
    quarter_waves = (np.arange(20) + 0.5) / (2 * SHAFT.delay)
    assert found[:, 0] == pytest.approx(quarter_waves, rel=ROUNDING)
    assert found[:, 1] == pytest.approx(quarter_waves, rel=1e-9)


@pytest.mark.parametrize("ends", ENDS)
@pytest.mark.parametrize(("sections", "discs"), [(STEPPED, (0.1, 0.0, 2.0, 1e-3, 0.05)), ((SHAFT,), (0.0, 0.0))])
def test_modes_are_orthogonal_and_of_unit_inertia(
    sections: tuple[Section, ...], discs: tuple[float, ...], ends: tuple[End, End]
) -> None:
    shapes = modes(SectionLine(sections, discs, ends=ends), 8)
    # Sums of a few hundred products of numbers near 1.
    assert np.abs(modal_inertias(shapes) - np.eye(8)).max() < 1e-13


def test_modes_of_extreme_lines_are_orthogonal_and_of_unit_inertia() -> None:
    # Frequencies are good to ROUNDING and lie 1e-4 apart or more, so shapes mix by 1e-10 at most.
    shapes = modes(EXTREME, 12)
    assert np.abs(modal_inertias(shapes) - np.eye(12)).max() < 1e-10


@pytest.mark.parametrize("seed", range(25))
def test_modes_of_random_lines_of_extreme_ratios_are_where_60_digits_put_them(seed: int) -> None:
    draw = np.random.default_rng(seed)
    parts = draw.integers(1, 7)
    sections = tuple(Section(*10 ** draw.uniform([-4, -4, -4], [4, 4, 12])) for _ in range(parts))
    discs = tuple(float(disc) for disc in 10 ** draw.uniform(-9, 9, parts + 1) * (draw.random(parts + 1) > 0.3))
    line = SectionLine(sections, discs, ends=ENDS[draw.integers(4)])
    shapes = modes(line, 10)
    with mpmath.workdps(60):
        for number, frequency in enumerate(shapes.frequencies):
            near = mpmath.mpf(float(frequency))
            if near > 0:
                assert high_precision_count(line, near * (1 - mpmath.mpf(ROUNDING))) <= number
                assert high_precision_count(line, near * (1 + mpmath.mpf(ROUNDING))) >= number + 1
    # The quadrature takes 60 nodes a section; shapes lose the digits by which discs outweigh each other's amplitudes.
    if shapes.frequencies[-1] * math.fsum(section.delay for section in sections) < 15:
        assert np.abs(modal_inertias(shapes) - np.eye(10)).max() < 1e-8


def test_shapes_obey_the_law_of_the_shaft_and_of_its_discs() -> None:
    line = SectionLine(STEPPED, (0.1, 0.0, 2.0, 1e-3, 0.05))
    shapes = modes(line, 8)
    omega = 2 * math.pi * shapes.frequencies
    stations, h = np.array([0.05, 0.2, 0.3, 0.7]), 1e-4
    differences = (shapes.angles(stations + h) - shapes.angles(stations - h)) / (2 * h)
    stiffness = [line.sections[line.locate(float(x))[0]].stiffness for x in stations]
    torques = shapes.torques(stations)
    # Central differences: (k h)^2 / 6 with k = omega / v up to 8 per metre is 1e-7.
    assert np.abs(torques + differences * stiffness).max() < 1e-6 * np.abs(torques).max()
    jumps = shapes.torques(line.junctions[1:-1]) - shapes.torques(line.junctions[1:-1], side="left")
    expected = omega[:, None] ** 2 * line.discs[1:-1] * shapes.angles(line.junctions[1:-1])
    assert np.abs(jumps - expected).max() < 1e-12 * np.abs(torques).max()


def test_a_shape_concentrated_in_the_middle_is_the_same_from_both_ends() -> None:
    # Discs with one light one among them: its mode falls by a factor of about 50 from disc to disc.
    discs = [1.0] * 21
    discs[8] = 0.02
    line = SectionLine((Section(0.1, 1e-6, 100.0),) * 20, tuple(discs))
    shapes, mirrored = modes(line, 21), modes(line.mirrored(), 21)
    ours = shapes.angles(line.junctions)[20]
    theirs = mirrored.angles(line.junctions)[20][::-1]
    assert np.abs(ours).argmax() == 8
    assert abs(ours[0] / ours[8]) < 1e-12
    signs = np.sign(theirs[8] * ours[8])
    # Every amplitude is good relative to itself, small as it is.
    assert ours == pytest.approx(signs * theirs, rel=1e-10)


@pytest.mark.parametrize("arguments", [{}, {"count": 0}, {"count": 3, "f_max": 10.0}, {"f_max": math.inf}])
def test_modes_are_asked_for_by_number_or_by_frequency(arguments: dict[str, float]) -> None:
    with pytest.raises(ParameterError, match="either the count of the modes"):
        natural_frequencies(SectionLine((SHAFT,), (0.0, 0.0)), **arguments)  # type: ignore[arg-type]


def test_a_line_with_losses_has_no_real_modes() -> None:
    damped = SectionLine((Section(1.0, 1.0, 1.0, damping=0.1),), (0.0, 0.0))
    for ask in (natural_frequencies, modes):
        with pytest.raises(ParameterError, match="without_losses"):
            ask(damped, 3)
    assert natural_frequencies(damped.without_losses(), 2).size == 2
