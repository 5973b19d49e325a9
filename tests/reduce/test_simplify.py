"""Few masses for many: the grouping that is taken, what it keeps and what it says it lost."""

from __future__ import annotations

import math
from itertools import combinations, pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import eigh

import shaftwork as sw
from tests.properties.examples import share_of_examples


def chain(inertias: list[float], stiffnesses: list[float], damping: float = 0.0) -> sw.Network:
    net = sw.Network("chain")
    net.add(sw.TorqueSource("motor", tau=1.0), "0")
    for k, inertia in enumerate(inertias):
        net.add(sw.Inertia(f"J{k}", J=inertia), f"{k}")
    for k, c in enumerate(stiffnesses):
        net.add(sw.Spring(f"c{k}", c=c, d=damping * c), f"{k}", f"{k + 1}")
    return net


def frequencies(inertias: list[float], stiffnesses: list[float]) -> np.ndarray:
    """Natural frequencies in Hz without that of the turning whole."""
    stiffness = np.zeros((len(inertias), len(inertias)))
    for k, c in enumerate(stiffnesses):
        stiffness[k : k + 2, k : k + 2] += c * np.array([[1, -1], [-1, 1]])
    return np.sqrt(eigh(stiffness, np.diag(inertias), eigvals_only=True)[1:]) / (2 * np.pi)


sizes = st.lists(st.integers(-20, 20).map(lambda k: round(10 ** (k / 20), 3)), min_size=4, max_size=10)


@share_of_examples(0.08)
@given(sizes, st.integers(0, 63))
def test_no_contiguous_grouping_is_better_on_the_lowest_frequency(inertias: list[float], pick: int) -> None:
    stiffnesses = [1000.0 * (1 + (7 * k + pick) % 5) for k in range(len(inertias) - 1)]
    kept = pick % len(stiffnesses)
    small = sw.reduce.simplify(chain(inertias, stiffnesses), 3, f"c{kept}")
    true = frequencies(inertias, stiffnesses)
    tried = [cuts for cuts in combinations(range(len(stiffnesses)), 2) if kept in cuts]
    groups = (groups_of(inertias, stiffnesses, cuts, kept) for cuts in tried)
    errors = [abs(frequencies(*made)[0] / true[0] - 1) for made in groups]
    taken = small.frequencies[0]
    assert taken.before == pytest.approx(true[0], rel=1e-9)
    assert abs(taken.error or 0.0) <= min(errors) + 1e-9
    assert len(small.groupings) == len(errors)


def groups_of(
    inertias: list[float], stiffnesses: list[float], cuts: tuple[int, ...], kept: int
) -> tuple[list[float], list[float]]:
    """Inertias and springs of the groups between cuts."""
    ends = [0, *(cut + 1 for cut in cuts), len(inertias)]
    groups = [list(range(a, b)) for a, b in pairwise(ends)]
    centres = []
    for group in groups:
        at_kept = [k for k in group if (k == kept and group[-1] == kept) or (k == kept + 1 and group[0] == kept + 1)]
        centres.append(at_kept[0] if at_kept else max(group, key=lambda k: inertias[k]))
    between = [1 / sum(1 / stiffnesses[k] for k in range(a, b)) for a, b in pairwise(centres)]
    return [sum(inertias[k] for k in group) for group in groups], between


INERTIAS, STIFFNESSES = [5.0, 0.2, 0.3, 1.0, 8.0], [3000.0, 9000.0, 1000.0, 20000.0]


def test_the_kept_shaft_and_the_inertia_on_either_side_of_it_stay() -> None:
    for masses in (2, 3, 4):
        small = sw.reduce.simplify(chain(INERTIAS, STIFFNESSES, damping=1e-3), masses, "c2")
        (shaft,) = (part for part in small.network.parts if part.name == "c2")
        assert (shaft.c, shaft.d) == (1000.0, 1.0)
        left = [g for g in small.groupings[0].groups if "2" in g or "0" in g]
        assert {node for group in left for node in group} <= {"0", "1", "2"}
        total = sum(part.J for part in small.network.parts if isinstance(part, sw.Inertia))
        assert total == pytest.approx(sum(INERTIAS), rel=1e-14)


@pytest.mark.slow
def test_as_many_masses_as_there_are_lose_nothing() -> None:
    small = sw.reduce.simplify(chain(INERTIAS, STIFFNESSES, damping=1e-4), 5, "c2")
    assert [row.error for row in small.frequencies] == pytest.approx([0.0] * 4, abs=1e-12)
    assert small.valid_up_to == np.inf
    lost = small.compare(0.5)
    assert abs(lost.peak_error) < 1e-9
    assert lost.rms_error < 1e-9


def test_the_number_of_masses_is_an_integer_of_any_kind_and_nothing_else() -> None:
    net = chain(INERTIAS, STIFFNESSES)
    plain = sw.reduce.simplify(net, 3, "c2")
    for masses in (np.int64(3), np.uint8(3), np.array(3)):
        small = sw.reduce.simplify(net, masses, "c2")  # type: ignore[arg-type]
        assert small.network.name == plain.network.name
        assert str(small.table) == str(plain.table)
    for wrong in (3.0, "3", True, np.True_, np.float64(3.0), np.array([3]), 0, 6):
        with pytest.raises(sw.ParameterError, match="must be a whole number from 1 to the 5 inertias"):
            sw.reduce.simplify(net, wrong, "c2")  # type: ignore[arg-type]


def test_springs_in_series_are_one_that_loses_as_much_in_a_slow_twist() -> None:
    """Abdelkader 2016, (15). With a node without inertia between them there is nothing to approximate."""
    net = chain([2.0, 0.0, 3.0], [1000.0, 4000.0], damping=1e-3)
    small = sw.reduce.simplify(net, 2)
    (spring,) = (part for part in small.network.parts if isinstance(part, sw.Spring))
    assert spring.c == pytest.approx(800.0, rel=1e-14)
    assert spring.d == pytest.approx(1.0 * 0.8**2 + 4.0 * 0.2**2, rel=1e-14)
    assert spring.name == "c0"
    assert str(small.table).splitlines()[2].endswith("c0, c1")


def test_gaps_in_series_are_one_gap_between_two_masses() -> None:
    """One torque closes all of them: its twist is that of all gaps and all compliances."""
    net = chain([2.0, 0.001, 0.001, 3.0], [1000.0])
    net.add(sw.Backlash("tooth", gap=0.01, c=4000.0, d=4.0), "1", "2")
    net.add(sw.Backlash("claw", gap=0.02, c=2000.0), "2", "3")
    small = sw.reduce.simplify(net, 2)
    (gap,) = (part for part in small.network.parts if isinstance(part, sw.Backlash))
    assert gap.gap == pytest.approx(0.03, rel=1e-14)
    assert gap.c == pytest.approx(1 / (1 / 1000 + 1 / 4000 + 1 / 2000), rel=1e-14)
    assert gap.d == pytest.approx(4.0 * (gap.c / 4000) ** 2, rel=1e-14)
    assert [row.value for row in small.table.rows if row.quantity == "gap"] == [gap.gap]
    net.add(sw.Spring("beside", c=10.0), "1", "2")
    with pytest.raises(sw.NetworkError, match="Backlash 'tooth' lies beside beside"):
        sw.reduce.simplify(net, 2)


def test_the_limit_of_validity_is_where_the_first_lost_mode_would_swing_along_by_a_tenth() -> None:
    small = sw.reduce.simplify(chain(INERTIAS, STIFFNESSES), 3, "c2")
    lost = next(row.before for row in small.frequencies if row.error is None or abs(row.error) > 0.05)
    assert 1 / (1 - (small.valid_up_to / lost) ** 2) == pytest.approx(1.1, rel=1e-12)


def test_a_small_model_has_the_mean_torque_and_says_what_it_misses_of_the_peak() -> None:
    net = chain(INERTIAS, STIFFNESSES, damping=1e-3)
    small = sw.reduce.simplify(net, 2, "c2")
    lost = small.compare(20.0, engine="exact")
    # a constant torque accelerates what is beyond the shaft, and both have the same inertia there
    assert lost.before.mean() == pytest.approx(9.0 / 14.5, rel=0.01)
    assert lost.after.mean() == pytest.approx(9.0 / 14.5, rel=0.01)
    assert 1e-3 < abs(lost.peak_error) < 0.2


def test_a_train_with_gears_is_referred_first_and_motor_and_load_stay() -> None:
    net = sw.Network("geared")
    net.add(sw.KlossMotor("motor", tau_k=9.6, s_k=0.25, n_sync=3000), "a")
    net.add(sw.Inertia("rotor", J=0.01), "a")
    net.add(sw.Spring("input", c=1e4), "a", "b")
    net.add(sw.Inertia("pinion", J=0.001), "b")
    net.add(sw.Gear("gear", ratio=10.0), "b", "c")
    net.add(sw.Backlash("shaft", gap=0.01, c=2e4, d=5.0), "c", "d")
    net.add(sw.Inertia("wheel", J=3.0), "d")
    net.add(sw.CoulombLoad("load", tau=5.0), "d")
    small = sw.reduce.simplify(net, 2, "shaft")
    assert {part.name for part in small.network.parts} == {"motor", "rotor", "shaft", "wheel", "load"}
    (rotor,) = (part for part in small.network.parts if part.name == "rotor")
    assert math.isclose(rotor.J, 1.1, rel_tol=1e-14)
    assert small.table.rigid == ("input",)
    assert "rigid now: input" in str(small)
    assert r"\begin{longtable}" in small.table.latex()


def test_one_mass_has_no_shaft_to_compare() -> None:
    small = sw.reduce.simplify(chain(INERTIAS, STIFFNESSES), 1)
    assert [part.J for part in small.network.parts if isinstance(part, sw.Inertia)] == [14.5]
    with pytest.raises(sw.ParameterError, match="no kept shaft"):
        small.compare(1.0)


def test_what_is_no_chain_is_refused_by_name() -> None:
    net = chain(INERTIAS, STIFFNESSES)
    with pytest.raises(sw.ParameterError, match="keep = 'J0' is no shaft between two inertias"):
        sw.reduce.simplify(net, 2, "J0")
    with pytest.raises(sw.ParameterError, match="keep = 'x' is no part"):
        sw.reduce.simplify(net, 2, "x")
    with pytest.raises(sw.ParameterError, match="from 1 to the 5 inertias"):
        sw.reduce.simplify(net, 6, "c2")
    net.add(sw.Spring("branch", c=10.0), "2", "5")
    net.add(sw.Inertia("J5", J=1.0), "5")
    with pytest.raises(sw.NetworkError, match="At node '2' 3 shafts meet"):
        sw.reduce.simplify(net, 2, "c2")
    net.add(sw.Backlash("gap", gap=0.1), "5", "6")
    net.add(sw.Shaft("long", length=1.0, diameter=0.1), "6", "7")
    net.add(sw.Inertia("J6", J=1.0), "6")
    with pytest.raises(sw.NetworkError) as caught:
        sw.reduce.simplify(net, 2, "c2")
    assert "Backlash 'gap' has rigid flanks" in str(caught.value)
    assert "Shaft 'long' joins 6, 7. net.expanded()" in str(caught.value)


def test_a_circuit_and_a_bearing_stay_beside_their_group() -> None:
    net = chain([1.0, 0.1, 2.0], [1000.0, 500.0])
    net.add(sw.VoltageSource("supply", u=24.0), "plus", "ground")
    net.add(sw.DCMachine("servo", k=0.1, R=1.0), "plus", "ground", "1")
    net.add(sw.Damper("bearing", d=0.1), "2")
    net.add(sw.Damper("oil", d=0.3), "1", "0")
    small = sw.reduce.simplify(net, 2, "c0")
    nodes = {item.part.name: item.nodes for item in small.network.netlist().placed}
    assert nodes["servo"] == ("plus", "ground", "1")
    assert nodes["bearing"] == ("1",)
    assert nodes["oil"] == ("1", "0")
    assert nodes["supply"] == ("plus", "ground")


def test_a_massless_end_and_a_shaft_without_a_spring_are_named() -> None:
    net = chain([1.0, 1.0], [1000.0])
    net.add(sw.Spring("end", c=10.0), "1", "2")
    net.add(sw.TorqueSource("load", tau=-1.0), "2")
    with pytest.raises(sw.NetworkError, match="Node '2' has no inertia"):
        sw.reduce.simplify(net, 2, "c0")
    net = chain([1.0, 1.0], [1000.0])
    net.add(sw.Damper("clutch", d=10.0), "1", "2")
    net.add(sw.Inertia("J2", J=1.0), "2")
    with pytest.raises(sw.NetworkError, match="Between '1' and '2' there is no spring"):
        sw.reduce.simplify(net, 2, "c0")


@pytest.mark.slow
def test_the_peaks_that_are_compared_lie_between_the_output_times_too() -> None:
    """As many masses as there are: with the output times far apart both must find the peak of the closed form."""
    net = chain([1.0, 2.0], [1.1e6])
    lost = sw.reduce.simplify(net, 2, "c0").compare(10.0, engine="exact", t_eval=np.linspace(0.0, 10.0, 7))
    peak = 2 * 1.0 * 2.0 / 3.0  # twice what accelerates the mass beyond
    assert lost.peaks == pytest.approx((peak, peak), rel=1e-9)
    assert np.abs(lost.before).max() < 0.999 * peak
    assert lost.peak_error_by_modes == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("t_end", [None, "a", -1.0])
def test_an_end_that_is_no_time_is_refused(t_end: object) -> None:
    small = sw.reduce.simplify(chain([1.0, 2.0], [1e3]), 2, "c0")
    with pytest.raises(sw.ParameterError, match="t_end"):
        small.compare(t_end)  # type: ignore[arg-type]


def test_without_a_motor_the_step_of_torque_is_at_the_first_inertia() -> None:
    """Its groupings are those of the same train with a motor there."""
    inertias, stiffnesses = [1.0, 3.0, 0.5, 2.0, 4.0], [100.0, 300.0, 200.0, 50.0]
    driven = chain(inertias, stiffnesses)
    alone = chain(inertias, stiffnesses)
    alone.remove("motor")
    found = [sw.reduce.simplify(net, 3, keep="c1") for net in (driven, alone)]
    errors = [[grouping.torque_error for grouping in made.groupings] for made in found]
    np.testing.assert_allclose(errors[1], errors[0], rtol=1e-12)
    assert len(set(errors[0])) > 1
