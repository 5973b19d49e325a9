from __future__ import annotations

import math
from typing import Any

import pytest

from shaftwork.core.errors import ParameterError
from tests.reference.exact_shafts.line import Section, SectionLine

SHAFT = Section.of_geometry(1.0, 0.02)


def test_a_hollow_section_is_the_solid_one_less_its_bore() -> None:
    hollow, bore, solid = (Section.of_geometry(2.0, *d) for d in ((0.03, 0.02), (0.02,), (0.03,)))
    # A subtraction of two numbers of like size: a few roundings.
    assert hollow.inertia == pytest.approx(solid.inertia - bore.inertia, rel=1e-15)
    assert hollow.stiffness == pytest.approx(solid.stiffness - bore.stiffness, rel=1e-15)


def test_a_wire_is_as_soft_as_the_fourth_power_of_its_diameter() -> None:
    wire = Section.of_geometry(1e-3, 2e-5)
    assert wire.stiffness == pytest.approx(1e-12 * SHAFT.stiffness, rel=1e-14)
    assert wire.inertia == pytest.approx(1e-12 * SHAFT.inertia, rel=1e-14)


def test_a_shaft_of_jelly_is_as_soft_as_its_material() -> None:
    jelly = Section.of_geometry(1.0, 0.02, density=7900.0, shear_modulus=77.5e-4)
    assert jelly.stiffness == pytest.approx(1e-13 * SHAFT.stiffness, rel=1e-14)
    with pytest.raises(ParameterError, match=r"shear_modulus of a section \(Pa\) must be above 0,"):
        Section.of_geometry(1.0, 0.02, density=7900.0, shear_modulus=0.0)


def test_delay_and_impedance_are_those_of_the_material() -> None:
    # Popenda 2019, (15): v = (G / rho)^0.5; Z = J' v. Square roots and products: a few roundings.
    speed = math.sqrt(77.5e9 / 7900)
    assert SHAFT.delay == pytest.approx(1.0 / speed, rel=1e-15)
    assert SHAFT.impedance == pytest.approx(SHAFT.inertia * speed, rel=1e-15)


def test_a_station_at_a_junction_belongs_to_the_side_that_is_asked_for() -> None:
    line = SectionLine((SHAFT, SHAFT), (0.0, 0.0, 0.0))
    assert line.locate(1.0, "left") == (0, 1.0)
    assert line.locate(1.0, "right") == (1, 0.0)
    assert line.locate(0.0, "left") == (0, 0.0)
    assert line.locate(line.length, "right") == (1, 1.0)


def test_a_station_that_misses_a_junction_by_a_rounding_is_the_junction() -> None:
    line = SectionLine((Section.of_geometry(0.1, 0.02), Section.of_geometry(0.2, 0.02)), (0.0, 0.0, 0.0))
    assert line.locate(0.3 - 2**-54, "right") == line.locate(0.1 + 0.2, "right")
    assert line.locate(math.nextafter(0.1, 0.0)) == (1, 0.0)


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        (lambda: Section(0.0, 1.0, 1.0), "length of a section.*above 0"),
        (lambda: Section(1.0, 1.0, math.inf), "stiffness of a section.*finite"),
        (lambda: Section(1.0, 1.0, 1.0, damping=-1.0), "damping of a section.*at least 0"),
        (lambda: Section.of_geometry(1.0, 0.02, 0.02), "inner_diameter.*less than its diameter"),
        (lambda: SectionLine((), (0.0,)), "at least one section"),
        (lambda: SectionLine((SHAFT,), (0.0,)), "1 sections has 2 junctions.*1 discs are given"),
        (lambda: SectionLine((SHAFT,), (0.0, -1.0)), "disc of a line.*at least 0"),
        (lambda: SectionLine((SHAFT,), (0.0, 0.0), ends=("free", "pinned")), "'free' and 'clamped'"),  # type: ignore[arg-type]
        (lambda: SectionLine((SHAFT,), (0.0, 0.0)).locate(1.1), "station 1.1 m is outside"),
        (lambda: SectionLine((SHAFT,), (0.0, 0.0)).junction(2), "junctions 0 to 1"),
    ],
)
def test_what_is_no_line_is_refused_with_the_reason(wrong: Any, text: str) -> None:
    with pytest.raises(ParameterError, match=text):
        wrong()
