"""Sections, what the rules permit there, and the ranges that follow."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import shaftwork as sw
from shaftwork.torsional import DESIGNS, Section
from shaftwork.torsional.barred_ranges import barred_ranges, overlapping
from tests.torsional.trains import engine, speeds

MPA = 1e6


@pytest.mark.parametrize(
    ("section", "ratio", "lasting", "passing"),
    [
        # by hand: (560 + 160) / 18 = 40; C_D = 0.35 + 0.93 400^-0.2 = 0.630588; 3 - 2 0.5^2 = 2.5
        (Section("s", diameter=0.4, design="intermediate, flange", strength=560e6), 0.5, 63.0588, 107.2000),
        # strength counts up to 600: 760 / 18 = 42.2222; C_D = 0.35 + 0.93 300^-0.2 = 0.647206; 0.85 1.38
        (Section("s", diameter=0.3, design="thrust, collar", strength=650e6), 0.95, 32.0540, 32.0540),
        # 42.2222; C_D = 0.35 + 0.93 250^-0.2 = 0.658244; 0.55 (3 - 2 0.7^2); over sqrt(0.55)
        (Section("s", diameter=0.25, design="propeller", strength=700e6, alloy=True), 0.7, 30.8775, 70.7799),
    ],
)
def test_permitted_stresses_are_those_of_a_hand_calculation(
    section: Section, ratio: float, lasting: float, passing: float
) -> None:
    tau_c, tau_t = section.permitted(ratio)
    assert tau_c / MPA == pytest.approx(lasting, rel=2e-6)  # six digits by hand
    assert tau_t / MPA == pytest.approx(passing, rel=2e-6)


def test_alloy_steel_counts_up_to_800_but_not_in_the_propeller_shaft() -> None:
    def limit(design: str, strength: float, *, alloy: bool) -> float:
        return float(Section("s", diameter=0.3, design=design, strength=strength, alloy=alloy).permitted(0.5)[0])

    assert limit("intermediate, slot", 900e6, alloy=True) == limit("intermediate, slot", 800e6, alloy=True)
    assert limit("intermediate, slot", 800e6, alloy=True) > limit("intermediate, slot", 600e6, alloy=True)
    assert limit("intermediate, slot", 900e6, alloy=False) == limit("intermediate, slot", 600e6, alloy=False)
    assert limit("propeller", 900e6, alloy=True) == limit("propeller", 600e6, alloy=False)


@pytest.mark.parametrize("design", DESIGNS)
def test_the_limit_falls_with_the_speed_and_ends_beyond_105_percent(design: str) -> None:
    ratios = np.linspace(0.0, 1.05, 106)
    tau_c, tau_t = Section("s", diameter=0.2, design=design, strength=500e6).permitted(ratios)
    assert (np.diff(tau_c) <= 0).all()
    assert np.abs(np.diff(tau_c)).max() < 0.04 * tau_c[0]  # no jump where the two formulas meet
    assert (tau_t[ratios < 0.8] > tau_c[ratios < 0.8]).all()
    assert (tau_t[ratios >= 0.8] == tau_c[ratios >= 0.8]).all()
    assert np.isinf(Section("s", diameter=0.2, design=design, strength=500e6).permitted(1.06)[0])


def test_a_bore_and_a_notch_raise_the_stress() -> None:
    solid, hollow = Section("s", diameter=0.1), Section("s", diameter=0.1, bore=0.06)
    assert solid.stress(1000.0) == pytest.approx(1000 * 16 / (math.pi * 0.1**3))
    assert hollow.stress(1000.0) == pytest.approx(solid.stress(1000.0) / (1 - 0.6**4))


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"diameter": 0.1, "bore": 0.1}, "bore = 0.1 m must be smaller than diameter = 0.1 m"),
        ({"design": "square"}, "no design 'square'. There are: intermediate, flange"),
        ({"design": "propeller"}, "design and strength.* go together"),
        ({"strength": 5e8}, "design and strength.* go together"),
        ({"design": "propeller", "strength": 560}, "strength = 560 must be at least 1e"),
        ({"scf": 0.5}, "scf = 0.5 must be at least 1"),
        ({"diameter": -1}, "diameter = -1 must be above 0"),
    ],
)
def test_a_wrong_section_is_refused(values: dict[str, float], message: str) -> None:
    with pytest.raises(sw.ParameterError, match=message):
        Section("shaft", **values)


def hump(centre: float, height: float, width: float) -> tuple[np.ndarray, np.ndarray]:
    speeds = np.linspace(10.0, 105.0, 951)
    return speeds, height / (1 + ((speeds - centre) / width) ** 2)


def test_a_barred_range_is_that_of_the_formula_or_the_exceeded_one_where_that_is_wider() -> None:
    limits = np.full(951, 50.0), np.full(951, 90.0)
    for width, wider in ((1.0, False), (20.0, True)):
        speeds, stress = hump(50.0, 80.0, width)
        (only,) = barred_ranges(
            speeds, stress, limits, lambda n, w=width: 80.0 / (1 + ((n - 50) / w) ** 2) - 50.0, rated=100.0
        )
        crossing = width * math.sqrt(0.6)
        assert only.exceeded[0] == pytest.approx((50 - crossing, 50 + crossing), rel=1e-8)
        assert only.critical == pytest.approx((50.0,))
        formula = (16 * 50 / 17.5, 17.5 * 50 / 16)
        assert (only.start, only.end) == pytest.approx(only.exceeded[0] if wider else formula, rel=1e-8)
        assert only.allowed
        assert only.share == pytest.approx(80 / 90)


@pytest.mark.parametrize(("centre", "height"), [(78.0, 80.0), (50.0, 95.0), (100.0, 60.0)])
def test_no_range_may_reach_four_fifths_of_the_rated_speed_nor_be_passed_above_tau_t(
    centre: float, height: float
) -> None:
    speeds, stress = hump(centre, height, 1.0)
    limits = np.full(951, 50.0), np.full(951, 90.0)
    (only,) = barred_ranges(speeds, stress, limits, lambda n: height / (1 + (n - centre) ** 2) - 50.0, rated=100.0)
    assert not only.allowed
    assert "NOT permitted" in str(only)


def test_ranges_that_overlap_are_one() -> None:
    speeds = np.linspace(10.0, 105.0, 951)

    def stress(n: np.ndarray) -> np.ndarray:
        return 80 / (1 + (n - 40) ** 2) + 80 / (1 + (n - 43) ** 2)

    limits = np.full(951, 50.0), np.full(951, 90.0)
    (only,) = barred_ranges(speeds, stress(speeds), limits, lambda n: float(stress(np.array(n))) - 50.0, 100.0)
    assert len(only.exceeded) == len(only.critical) == 2
    assert only.start == pytest.approx(16 * only.critical[0] / (18 - only.critical[0] / 100))
    assert overlapping([only, only]) == ((only.start, only.end),)


@pytest.mark.parametrize("ratio", [math.nan, -1.0, "a"])
def test_a_ratio_that_is_no_speed_has_no_limit(ratio: Any) -> None:
    section = sw.torsional.Section("s", diameter=0.1, design="propeller", strength=5e8)
    with pytest.raises(sw.ParameterError, match="must be speeds over the rated one, 0 or more"):
        section.permitted(ratio)


def test_a_barred_range_does_not_depend_on_the_speeds_that_are_given() -> None:
    """Peaks between them are looked for, so a coarse list has the critical speed of a fine one."""
    section = Section("s3", diameter=0.08, design="intermediate, flange", strength=560e6)
    by_count = []
    for count in (7, 31, 161, 801):
        calculation = sw.torsional_calculation(engine(), speeds(count=count), sections=[section], rated=300.0)
        shaft = calculation["s3"]
        by_count.append([shaft.stress.max(), shaft.speeds[shaft.peak]])
        by_count[-1] += [speed for one in shaft.barred for speed in (one.start, one.end, *one.critical)]
    assert len(by_count[0]) == 2 + 2 * 3  # two ranges
    for others in by_count[1:]:
        assert others == pytest.approx(by_count[0], rel=1e-5)  # parabolas through the last quarter of a spacing
