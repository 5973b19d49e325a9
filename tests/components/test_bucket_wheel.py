"""The digging torque against the source's algorithm in plain Python, and its mean against the closed form.

Statistical bounds are set for a false alarm of one in a million, were the seeds drawn anew; the seeds here are fixed.
"""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np
import pytest

import shaftwork as sw
from shaftwork.components import noise
from shaftwork.components.bucket_wheel import SOILS
from tests.reference import bucket_wheel

SIGMAS = NormalDist().inv_cdf(1 - 1e-6 / 2)


def turning(wheel: sw.Component, omega: float, t_end: float, t_eval: object = None) -> sw.Solution:
    """The wheel at a steady speed."""
    net = sw.Network("turning")
    net.add(sw.SpeedSource("drive", omega=omega), "shaft")
    net.add(wheel, "shaft")
    return net.simulate(t_end, t_eval=t_eval)


@pytest.mark.slow
@pytest.mark.parametrize("omega", [5.0, -3.0])
@pytest.mark.parametrize(
    ("buckets", "alpha"), [(8, 2.0), (8, 0.75 * math.pi), (7, 2.5), (9, math.pi), (3, 1.6), (20, 1.8)]
)
def test_the_torque_is_that_of_the_algorithm_at_every_angle(buckets: int, alpha: float, omega: float) -> None:
    """To the rounding of an angle of 100 rad times the steepest slope of a profile, 1 / (1.6 - pi/2) = 34 per rad."""
    soil = SOILS["fault zone"]
    wheel = sw.BucketWheelLoad("dig", radius=3.0, edge=0.7, alpha=alpha, buckets=buckets, soil="fault zone", seed=4.0)
    sol = turning(wheel, omega, 20.0, 997)
    wanted = [
        bucket_wheel.torque(
            phi,
            buckets=buckets,
            radius=3.0,
            edge=0.7,
            alpha=alpha,
            resistance=lambda j: max(0.0, soil.mean + soil.std * noise.normal(j, 4.0)),
        )
        for phi in sol["dig.phi"].tolist()
    ]
    np.testing.assert_allclose(-np.sign(omega) * sol["dig.tau"], wanted, atol=1e-11 * max(wanted), rtol=0)


@pytest.mark.slow
def test_the_mean_torque_is_that_of_the_closed_form() -> None:
    """Of the mean over n passes, each a draw of variance std^2, and exact otherwise: whole pitches at even steps."""
    passes, each = 4096, 64
    wheel = sw.BucketWheelLoad("dig", radius=3.0, edge=0.7, alpha=2.2, seed=11.0)
    middle = (np.arange(passes * each) + 0.5) / each  # in pitches; one unit of time each
    sol = turning(wheel, 2 * math.pi / 8, float(passes), middle)
    soil = SOILS["grey clay"]
    spread = SIGMAS * soil.std / soil.mean / math.sqrt(passes)
    assert wheel.mean_torque == pytest.approx(3.0 * 0.7 * soil.mean * 8 / (2 * math.pi) * (1 + (2.2 - math.pi / 2) / 2))
    assert -sol["dig.tau"].mean() == pytest.approx(wheel.mean_torque, rel=spread)


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [25.0, -25.0])
def test_at_a_shaft_before_its_reducer_the_wheel_gives_the_torque_that_comes_there(ratio: float) -> None:
    values = {"radius": 3.0, "edge": 0.7, "soil": "fault zone", "seed": 4.0}
    there = turning(sw.BucketWheelLoad("dig", **values), 0.5, 20.0, 401)["dig.tau"]
    before = turning(sw.BucketWheelLoad("dig", ratio=ratio, **values), 0.5 * ratio, 20.0, 401)["dig.tau"]
    assert ratio * before == pytest.approx(there, rel=1e-9, abs=1e-6)


@pytest.mark.slow
def test_the_torque_is_continuous_where_buckets_come_and_go() -> None:
    """The steepest profile climbs by 1 / (2 - pi/2) per rad: a fine step in the angle changes the torque by no more."""
    wheel = sw.BucketWheelLoad("dig", radius=3.0, edge=0.7, seed=4.0)
    sol = turning(wheel, 1.0, 6.3, 63001)
    largest = 5 * 3.0 * 0.7 * 1.5e5 / (2 - math.pi / 2)
    assert np.abs(np.diff(sol["dig.tau"][1:])).max() < largest * 1e-4


@pytest.mark.slow
def test_digging_begins_when_it_is_told_to_and_as_slowly() -> None:
    full = turning(sw.BucketWheelLoad("dig", radius=3.0, edge=0.7), 1.0, 4.0, 401)
    late = turning(sw.BucketWheelLoad("dig", radius=3.0, edge=0.7, t_on=1.0), 1.0, 4.0, 401)
    slow = turning(sw.BucketWheelLoad("dig", radius=3.0, edge=0.7, t_on=1.0, rise=2.0), 1.0, 4.0, 401)
    np.testing.assert_array_equal(late["dig.tau"], np.where(late.t < 1.0, 0.0, full["dig.tau"]))
    rising = full["dig.tau"] * np.clip((slow.t - 1.0) / 2.0, 0, 1)
    np.testing.assert_allclose(slow["dig.tau"], rising, rtol=1e-12, atol=1e-6)  # a kink is read some roundings after it


def test_soils_are_those_of_the_table_in_newtons_per_metre() -> None:
    assert {name: (soil.mean / 100, soil.std / 100) for name, soil in SOILS.items()} == {
        "fault zone": (436, 104),
        "transitional zone": (610, 107),
        "grey clay": (692, 158),
    }


def test_a_wrong_resistance_of_a_soil_is_said_of_the_soil() -> None:
    with pytest.raises(sw.ParameterError, match=r"Soil: mean = -5 must be above 0"):
        sw.Soil(-5, 1)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wrong", "answer"),
    [
        ({"soil": "gold"}, "fault zone, transitional zone, grey clay"),
        ({"soil": "Soil(-1.0, 0.0)"}, "cannot be read"),
        ({"buckets": 8.5}, "whole number from 3 to 100"),
        ({"buckets": "many"}, "whole number from 3 to 100"),
        ({"alpha": 1.5}, "above"),
    ],
)
def test_wrong_wheels_are_answered_with_what_there_is(wrong: dict, answer: str) -> None:
    net = sw.Network("wheel")
    net.add(sw.SpeedSource("drive", omega=1.0), "shaft")
    net.add(sw.BucketWheelLoad("dig", **{"radius": 3.0, "edge": 0.7, **wrong}), "shaft")
    assert any(answer in str(problem) for problem in net.check())


@pytest.mark.parametrize("name", ["Gray clay", "grey clay", "GREY  CLAY", "Fault zone", "Transitional Zone"])
def test_a_soil_is_read_as_the_source_prints_it(name: str) -> None:
    """Table 1 of the source has capitals, and "gray"."""
    wheel = sw.BucketWheelLoad("wheel", radius=3.0, edge=0.6, soil=name)
    assert sw.Soil.read(name) == SOILS[name.lower().replace("gray", "grey").replace("  ", " ")]
    assert wheel.mean_torque == sw.BucketWheelLoad("wheel", radius=3.0, edge=0.6, soil=sw.Soil.read(name)).mean_torque


@pytest.mark.slow
def test_a_wheel_that_digs_at_once_from_a_time_on_gives_nothing_before_and_its_torque_after() -> None:
    values = {"radius": 3.0, "edge": 0.7, "buckets": 8, "soil": "fault zone", "seed": 4.0, "rise": 0.0}
    times = np.array([0.0, 0.9, 1.1, 1.7, 2.0])
    late, always = (turning(sw.BucketWheelLoad("dig", **values, t_on=t), 5.0, 2.0, times) for t in (1.0, 0.0))
    assert (late["dig.tau"][:2] == 0.0).all()
    np.testing.assert_allclose(late["dig.tau"][2:], always["dig.tau"][2:], rtol=1e-9)
    assert (always["dig.tau"] != 0.0).all()


def test_the_mean_torque_of_a_wheel_that_cannot_be_is_refused() -> None:
    with pytest.raises(sw.ParameterError, match=r"BucketWheelLoad 'dig': radius = -1\.0 must be above 0"):
        _ = sw.BucketWheelLoad("dig", radius=-1.0, edge=0.6).mean_torque
