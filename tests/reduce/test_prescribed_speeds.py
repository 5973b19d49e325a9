"""A prescribed speed is a boundary of what swings: its node is kept, with inertia or without, in groups and modes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import shaftwork as sw
from tests.properties.examples import share_of_examples
from tests.reduce.test_supports import projected

INERTIAS, STIFFNESSES = (1.0, 0.5, 2.0, 1.0, 3.0), (2e3, 1e3, 4e3, 1e3)


def servo(*places: int, inertias: tuple[float, ...] = INERTIAS, damping: float = 0.0) -> sw.Network:
    """A train of five masses, with speeds prescribed at some of them; where an inertia is zero there is none."""
    net = sw.Network("servo")
    for place in places:
        net.add(sw.SpeedSource(f"servo{place}", omega=sw.Table([0, 1, 2], [0, 10, 10])), f"{place}")
    for k, size in enumerate(inertias):
        if size:
            net.add(sw.Inertia(f"J{k}", J=size), f"{k}")
    for k, c in enumerate(STIFFNESSES):
        net.add(sw.Spring(f"s{k}", c=c, d=damping * c), f"{k}", f"{k + 1}")
    return net


def own_frequencies(net: sw.Network) -> list[float]:
    return [float(f) for f in net.modes().frequencies if f > 1e-6]


@pytest.mark.parametrize(
    ("places", "masses", "keep"), [((0,), 3, "s1"), ((0,), 3, "s0"), ((2,), 4, "s1"), ((0, 4), 4, "s2"), ((4,), 2, "")]
)
def test_a_prescribed_speed_is_a_clamp_to_what_swings(places: tuple[int, ...], masses: int, keep: str) -> None:
    net = servo(*places)
    small = sw.reduce.simplify(net, masses, keep)
    assert [row.before for row in small.frequencies] == pytest.approx(own_frequencies(net), rel=1e-9)
    after = [row.after for row in small.frequencies if row.after is not None]
    assert after == pytest.approx(own_frequencies(small.network), rel=1e-9)
    for tried in small.groupings:
        assert {(f"{place}",) for place in places} <= set(tried.groups)
    errors = [made.frequency_error for made in small.groupings]
    assert errors == sorted(errors)
    assert abs(small.frequencies[0].error or 0.0) == pytest.approx(errors[0], abs=1e-12)


def test_the_torque_of_a_prescribed_acceleration_is_that_of_the_relative_motion() -> None:
    """One mass on a spring behind a speed: a step of acceleration a swings the spring by J a."""
    net = sw.Network("one mass")
    net.add(sw.SpeedSource("servo", omega=5.0 * sw.t), "0")
    net.add(sw.Inertia("J0", J=1.0), "0")
    net.add(sw.Spring("s0", c=2e3), "0", "1")
    net.add(sw.Inertia("J1", J=0.7), "1")
    net.add(sw.Spring("stiff", c=1e9), "1", "2")
    net.add(sw.Inertia("J2", J=1.3), "2")
    small = sw.reduce.simplify(net, 2, "s0")
    assert small.groupings[0].torque_error < 1e-5
    assert small.compare(0.5).peaks[1] == pytest.approx(2 * 2.0 * 5.0, rel=1e-4)


def test_too_few_groups_for_a_prescribed_speed_are_refused_and_one_mass_moves_as_prescribed() -> None:
    with pytest.raises(sw.ParameterError, match=r"prescribed at '0' \('servo0'\).*masses = 3 or more, or 1 for"):
        sw.reduce.simplify(servo(0), 2, "s1")
    with pytest.raises(sw.ParameterError, match=r"at '0', '4' \('servo0', 'servo4'\).*masses = 3 or more\."):
        sw.reduce.simplify(servo(0, 4), 1, "s1")
    rigid = sw.reduce.simplify(servo(0), 1, "s1")
    assert [row.after for row in rigid.frequencies] == [None] * 4
    assert rigid.compare(2.0).peaks[1] == pytest.approx(6.0 * 10.0, rel=1e-9)


def without(inertias: tuple[float, ...], places: tuple[int, ...]) -> tuple[float, ...]:
    return tuple(0.0 if place in places else size for place, size in enumerate(inertias))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("places", "keep"), [((0,), "s1"), ((0,), "s0"), ((2,), "s1"), ((2,), "s0"), ((0, 4), "s3"), ((0, 4), "s1")]
)
def test_a_node_of_a_prescribed_speed_needs_no_inertia(places: tuple[int, ...], keep: str) -> None:
    """What is there moves as prescribed, so that neither frequencies nor the torque of the shaft depend on it."""
    bare, laden = servo(*places, inertias=without(INERTIAS, places)), servo(*places)
    for masses in (4, 5):
        small, other = (sw.reduce.simplify(net, masses, keep) for net in (bare, laden))
        assert [row.before for row in small.frequencies] == pytest.approx(own_frequencies(bare), rel=1e-9)
        assert [row.after for row in small.frequencies] == [row.after for row in other.frequencies]
        assert [made.groups for made in small.groupings] == [made.groups for made in other.groupings]
        found, wanted = small.compare(1.0, engine="exact"), other.compare(1.0, engine="exact")
        size = np.abs(wanted.before).max()
        assert found.after == pytest.approx(wanted.after, abs=1e-10 * size)
        assert found.by_modes == pytest.approx(wanted.by_modes, abs=1e-10 * size)
        inertias = {part.name for part in small.network.parts if isinstance(part, sw.Inertia)}
        assert inertias.isdisjoint(f"J{place}" for place in places)


def test_one_mass_behind_a_speed_without_inertia_is_all_there_is() -> None:
    rigid = sw.reduce.simplify(servo(0, inertias=without(INERTIAS, (0,))), 1, "s0")
    assert rigid.compare(2.0).peaks[1] == pytest.approx(6.5 * 10.0, rel=1e-9)
    with pytest.raises(sw.ParameterError, match="from 1 to the 5 inertias and prescribed speeds of the chain"):
        sw.reduce.simplify(servo(0, inertias=without(INERTIAS, (0,))), 6, "s0")


def test_a_massless_node_without_a_prescribed_speed_is_still_refused() -> None:
    net = servo(0, inertias=without(INERTIAS, (0, 4)))
    net.add(sw.TorqueSource("load", tau=-1.0), "4")
    with pytest.raises(sw.NetworkError, match="Node '4' has no inertia"):
        sw.reduce.simplify(net, 3, "s1")


sizes = st.lists(st.integers(-15, 15).map(lambda k: round(10 ** (k / 20), 3)), min_size=4, max_size=8)


@share_of_examples(0.06)
@given(sizes, st.integers(0, 63), st.integers(2, 8), st.sampled_from([1, 2]))
def test_by_modes_the_node_of_a_prescribed_speed_is_a_boundary(
    inertias: list[float], pick: int, masses: int, held: int
) -> None:
    """Against constraint modes and fixed modes as Craig and Bampton write them down, by the network's own modes."""
    count = len(inertias)
    places = sorted({pick % count, (3 * pick + 1) % count} if held == 2 else {pick % count})
    kept = (pick // 4) % (count - 1)
    boundaries = sorted({*places, kept, kept + 1})
    net, stiffnesses = sw.Network("servo"), [1000.0 * (1 + (7 * k + pick) % 5) for k in range(count - 1)]
    for k, size in enumerate(inertias):
        net.add(sw.Inertia(f"J{k}", J=size), f"{k}")
    for k, c in enumerate(stiffnesses):
        net.add(sw.Spring(f"s{k}", c=c), f"{k}", f"{k + 1}")
    for place in places:
        net.add(sw.SpeedSource(f"drive{place}", omega=1.0), f"{place}")
    masses = min(max(masses, len({*boundaries} | {k + 1 for k in places} | {k - 1 for k in places})), count)
    small = sw.reduce.simplify(net, masses, f"s{kept}")
    wanted = projected(inertias, stiffnesses, [0.0] * len(inertias), boundaries, places, masses)
    listed = [row.by_modes for row in small.frequencies if row.by_modes is not None]
    assert listed == pytest.approx(wanted, rel=1e-8)
    assert own_frequencies(small.by_modes) == pytest.approx(wanted, rel=1e-7)
    true = [row.before for row in small.frequencies]
    assert all(found >= exact * (1 - 1e-9) for found, exact in zip(listed, true, strict=False))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("places", "keep"), [((0,), "s2"), ((0, 4), "s2"), ((0, 4), "s1"), ((0, 2), "s3"), ((1,), "s3")]
)
def test_with_all_modes_it_moves_as_the_train_between_its_prescribed_speeds(places: tuple[int, ...], keep: str) -> None:
    """Damping as a share of stiffness, which each mode has by itself, and parts at places between the boundaries."""
    net = servo(*places, damping=1e-3)
    net.add(sw.TorqueSource("brake", tau=-3 * sw.omega), "1")
    net.add(sw.TorqueSource("load", tau=-0.5), "3")
    small = sw.reduce.simplify(net, 5, keep)
    lost = small.compare(2.0, engine="exact")
    assert lost.rms_error_by_modes < 1e-10
    assert abs(lost.peak_error_by_modes) < 1e-10
    for place in places:  # what it takes to prescribe the speed is the same as well: no inertia is lost
        before, after = (each.simulate(2.0, engine="exact")[f"servo{place}.tau"] for each in (net, small.by_modes))
        assert after == pytest.approx(before, abs=1e-9 * np.abs(before).max())


def test_what_was_without_torque_has_an_error_of_zero_or_infinity() -> None:
    lost = sw.reduce.simplify(servo(0, 1), 4, "s0").compare(2.0)
    assert lost.peaks == (0.0, 0.0)
    assert (lost.peak_error, lost.rms_error, lost.rms_error_by_modes) == (0.0, 0.0, 0.0)
    other = replace(lost, after=lost.after + 1.0, extremes=(0.0, 1.0, 0.0))
    assert (other.peak_error, other.rms_error) == (np.inf, np.inf)
