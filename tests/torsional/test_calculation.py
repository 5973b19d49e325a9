"""The calculation as a whole: exact shafts, gears, misfire, tables, power, life, and what is refused."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import shaftwork as sw
from shaftwork.torsional import Section
from tests.torsional.trains import AMPLITUDES, ORDERS, engine, harmonics, line, speeds

RPM = math.pi / 30


def test_exact_shafts_stand_beside_meshes_that_converge_to_them() -> None:
    n = speeds(20.0, 90.0, 15)
    exact = sw.torsional_calculation(line(sw.Lumped(10)), n, exact=True)
    errors = []
    for m in (10, 20):
        lumped = sw.torsional_calculation(line(sw.Lumped(m)), n)
        places = [int(np.abs(exact.speeds - speed).argmin()) for speed in n]
        ours = [int(np.abs(lumped.speeds - speed).argmin()) for speed in n]
        reference, values = exact.orders_of("first.tau_a")[places], lumped.orders_of("first.tau_a")[ours]
        errors.append(float(np.abs(values - reference).max() / np.abs(reference).max()))
    # half cells at the ends are right to the square of their length
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.3)


def test_waves_give_what_exact_shafts_give() -> None:
    lossless = [line(sw.Lumped(4)), line(sw.Lumped(4))]
    for net in lossless:
        for name in ("first", "second"):
            part = next(part for part in net.parts if part.name == name)
            net.replace(part.changed(damping=0.0, model=sw.Wave() if net is lossless[0] else sw.Lumped(4)))
    n = speeds(20.0, 90.0, 5)
    calculations = [sw.torsional_calculation(net, n, exact=k == 1) for k, net in enumerate(lossless)]
    # the speeds of peaks, which each looks for, differ by its rounding
    waves, exact = (one.orders_of("second.tau_a")[np.isin(one.speeds, n)] for one in calculations)
    assert waves == pytest.approx(exact, rel=1e-9)  # the same equations


def geared(ratio: float) -> sw.Network:
    net = sw.Network("geared")
    net.add(sw.HarmonicTorque("engine", harmonics=sw.Harmonics((1.0, 2.0), (50.0, 20.0), (0.3, 0.8))), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Spring("quill", c=3e4, d=20.0), "a", "b")
    net.add(sw.Gear("gear", ratio=ratio), "b", "c")
    net.add(sw.Inertia("J2", J=2.0), "c")
    net.add(sw.HarmonicTorque("propeller", harmonics=sw.Harmonics((4.0,), (30.0,), (0.5,))), "c")
    net.add(sw.Damper("water", d=5.0), "c")
    return net


def test_orders_behind_a_gear_are_counted_in_turns_of_the_first_shaft() -> None:
    calculation = sw.torsional_calculation(geared(2.5), [30.0, 60.0])
    assert calculation.orders == pytest.approx((1.0, 1.6, 2.0))
    assert sw.torsional_calculation(geared(-2.5), [30.0, 60.0]).orders == pytest.approx((1.0, 1.6, 2.0))


def test_a_shaft_that_turns_back_runs_through_its_harmonics_in_reverse() -> None:
    """A torque at the angle -phi on a reversed shaft is the mirrored torque at phi on the reference shaft."""
    there, back = (sw.torsional_calculation(geared(sign * 2.5), [30.0, 60.0]) for sign in (1, -1))
    mirrored = geared(2.5)
    mirrored.replace(sw.HarmonicTorque("propeller", harmonics=sw.Harmonics((4.0,), (30.0,), (math.pi - 0.5,))))
    expected = sw.torsional_calculation(mirrored, [30.0, 60.0])["quill"].torques
    assert back["quill"].torques == pytest.approx(expected, rel=1e-9)
    assert np.abs(back["quill"].torques - there["quill"].torques).max() > 1.0


def test_power_fed_is_power_lost() -> None:
    for calculation in (
        sw.torsional_calculation(engine(), speeds()),
        sw.torsional_calculation(line(sw.Spectral(8)), speeds(20.0, 90.0)),
        sw.torsional_calculation(line(sw.Spectral(8)), speeds(20.0, 90.0), exact=True),
    ):
        fed, lost = sum(calculation.power_fed.values()), sum(calculation.power_lost.values())
        assert lost == pytest.approx(fed, rel=1e-8)  # rounding of large reactive powers
        assert min(float(power.min()) for power in calculation.power_lost.values()) > -1e-8 * float(fed.max())


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=10, deadline=None)
def test_power_closes_and_amplitudes_keep_below_their_sum_in_random_trains(seed: int) -> None:
    draw = np.random.default_rng(seed)
    net, count = sw.Network("random"), int(draw.integers(2, 6))
    for k in range(count):
        net.add(sw.Inertia(f"J{k}", J=float(draw.uniform(0.1, 10))), f"n{k}")
        net.add(sw.Damper(f"d{k}", d=float(draw.uniform(0.1, 20))), f"n{k}")
        if k:
            net.add(
                sw.Spring(f"s{k}", c=float(10 ** draw.uniform(3, 6)), d=float(draw.uniform(0, 30))),
                f"n{k - 1}",
                f"n{k}",
            )
        if k == 0 or draw.random() < 0.5:
            orders = tuple(np.sort(draw.choice(np.arange(1, 13) / 2, 3, replace=False)).tolist())
            torque = sw.Harmonics(orders, tuple(draw.uniform(1, 50, 3)), tuple(draw.uniform(-3, 3, 3)))
            net.add(sw.HarmonicTorque(f"h{k}", harmonics=torque, firing_angle=float(draw.uniform(0, 6))), f"n{k}")
    calculation = sw.torsional_calculation(net, [20.0, 50.0, 110.0])
    fed, lost = sum(calculation.power_fed.values()), sum(calculation.power_lost.values())
    assert lost == pytest.approx(fed, rel=1e-6, abs=1e-9)
    for one in calculation.values():
        assert (one.amplitude <= one.arithmetic * (1 + 1e-9)).all()
        assert (one.amplitude >= one.by_order.max(axis=1) * (1 - 1e-9)).all() or len(one.orders) > 1


def test_all_cylinders_together_leave_the_orders_of_the_firing_alone_in_a_rigid_engine() -> None:
    net = sw.Network("rigid")
    for k, angle in enumerate(sw.HarmonicTorque.firing_angles((1, 3, 4, 2)), 1):
        net.add(sw.HarmonicTorque(f"cylinder {k}", harmonics=harmonics(), firing_angle=angle), "crank")
    net.add(sw.Inertia("J1", J=1.0), "crank")
    net.add(sw.Spring("shaft", c=1e5, d=50.0), "crank", "load")
    net.add(sw.Inertia("J2", J=3.0), "load")
    firing = sw.torsional_calculation(net, [50.0, 60.0])["shaft"].by_order[0]
    others = [k for k, order in enumerate(ORDERS) if order != 2.0]
    assert firing[others].max() < 1e-12 * firing.max()  # four phases that cancel
    failing = sw.torsional_calculation(net, [50.0, 60.0], misfire="cylinder 2")["shaft"].by_order[0]
    alone = sw.torsional_calculation(
        net, [50.0, 60.0], misfire={"cylinder 1": 0.0, "cylinder 3": 0.0, "cylinder 4": 0.0}
    )["shaft"].by_order[0]
    assert failing[others] == pytest.approx(alone[others], rel=1e-9)  # what is missing is what one gives
    assert failing[3] == pytest.approx(0.75 * firing[3], rel=1e-9)


def test_a_cylinder_that_misfires_may_have_other_harmonics() -> None:
    changed = sw.torsional_calculation(engine(), [50.0, 60.0], misfire={"cylinder 3": harmonics(0.25)})
    scaled = sw.torsional_calculation(engine(), [50.0, 60.0], misfire={"cylinder 3": 0.25})
    assert changed["s2"].torques == pytest.approx(scaled["s2"].torques, rel=1e-12)
    assert changed.misfiring == ("cylinder 3",)
    assert "cylinder 3 misfiring" in str(changed)


def test_resonances_are_among_the_speeds_and_peaks_are_not_missed() -> None:
    coarse = sw.torsional_calculation(engine(), [30.0, 200.0])
    fine = sw.torsional_calculation(engine(), np.linspace(30.0, 200.0, 4001))
    for shaft in coarse:
        assert coarse[shaft].amplitude.max() == pytest.approx(fine[shaft].amplitude.max(), rel=0.01)


def test_an_undamped_resonance_is_infinite_and_no_number_is_missing() -> None:
    net = sw.Network("undamped")
    net.add(sw.HarmonicTorque("h", harmonics=sw.Harmonics((1.0, 2.0), (5.0, 3.0))), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Spring("s", c=200.0), "a", "b")
    net.add(sw.Inertia("J2", J=1.0), "b")
    calculation = sw.torsional_calculation(net, [5.0, 19.0, 25.0], sections=[Section("s", diameter=0.02)])
    vibration = calculation["s"]
    assert not np.isnan(vibration.stress).any()
    resonant = np.abs(calculation.speeds - 20.0).argmin()
    assert vibration.amplitude[resonant] > 1e9
    assert str(calculation)


@pytest.mark.slow
def test_where_the_propeller_law_bends_each_speed_has_its_operating_point() -> None:
    net = engine()
    net.remove("load")
    net.add(sw.FanLoad("water", tau_n=900.0, n_n=1000.0, omega_s=0.1), "n5")
    calculation = sw.torsional_calculation(net, [40.0, 120.0])
    for number, speed in enumerate(calculation.speeds):
        point = {f"J{k}.omega": speed for k in range(6)}
        expected = sw.torsional_calculation(net, [speed, 2 * speed], at=point)
        assert calculation["s4"].torques[number] == pytest.approx(expected["s4"].torques[0], rel=1e-9)
    diagram = calculation.campbell(orders=(1, 2), f_max=80.0)
    assert diagram.orders == (1.0, 2.0)


def test_holzer_tables_balance_torques_mass_by_mass() -> None:
    net = engine()
    for k in range(5):
        net.replace(sw.Spring(f"s{k}", c=1e5 * (k + 1)))
    net.remove("load")
    table = sw.torsional_calculation(net, [40.0, 200.0], sections=[Section("s0", diameter=0.05)]).modes
    assert len(table) >= 1
    for mode in table.modes:
        assert mode.masses[0].amplitude == pytest.approx(1.0)
        square = (2 * math.pi * mode.frequency) ** 2
        total = 0.0
        for number, mass in enumerate(mode.masses):
            inertia = next(part.J for part in net.parts if part.name == mass.name)
            assert mass.torque == pytest.approx(inertia * square * mass.amplitude, rel=1e-8, abs=1e-6)
            total += inertia * square * mass.amplitude
            if number < 5:
                assert mode.shafts[number].torque == pytest.approx(total, rel=1e-6, abs=1e-6 * square)
        assert total == pytest.approx(0.0, abs=1e-6 * square)  # nothing is left behind the last mass
        assert mode.shafts[0].stress == pytest.approx(mode.shafts[0].torque * 16 / (math.pi * 0.05**3))
        assert mode.name in str(table)


@pytest.mark.slow
def test_limits_verdicts_tables_and_pictures_of_the_scene_agree() -> None:
    net = sw.scenes.ship_engine()
    sections = [
        Section("intermediate shaft", design="intermediate, flange", strength=560e6),
        Section("propeller shaft", design="propeller", strength=560e6, scf=1.5),
    ]
    calculation = sw.torsional_calculation(net, np.linspace(200, 945, 30) * RPM, sections=sections, rated=900 * RPM)
    shaft = calculation["propeller shaft"]
    assert shaft.section is not None
    assert shaft.section.diameter == 0.13
    assert shaft.notch_stress == pytest.approx(1.5 * shaft.stress)
    assert shaft.limits is not None
    assert bool((shaft.stress > shaft.limits[0]).any()) == bool(shaft.barred)
    for one in shaft.barred:
        for speed in one.exceeded[0]:
            again = sw.torsional_calculation(net, [speed, 2 * speed], sections=sections, rated=900 * RPM)
            limit = shaft.section.permitted(speed / (900 * RPM))[0]
            assert again["propeller shaft"].stress[0] == pytest.approx(float(limit), rel=1e-6)
    assert calculation.permitted is all(one.allowed for v in calculation.values() for one in v.barred)
    frame = calculation.to_pandas()
    rows = frame[frame["shaft"] == "propeller shaft"]
    assert rows["tau_c"].to_numpy() == pytest.approx(shaft.limits[0])
    assert len(calculation.plot().axes) == 2
    assert len(calculation.plot("crank 1").axes) == 1
    assert "<table>" in calculation._repr_html_()


def test_a_cycle_takes_from_the_life_what_its_half_range_takes() -> None:
    net = sw.Network("one order")
    net.add(sw.HarmonicTorque("h", harmonics=sw.Harmonics((2.0,), (40.0,))), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Spring("s", c=2e4, d=5.0), "a", "b")
    net.add(sw.Inertia("J2", J=1.0), "b")
    calculation = sw.torsional_calculation(net, [20.0, 50.0], sections=[Section("s", diameter=0.02, scf=2.0)])
    sn = sw.SNLine(amplitude=10e6, cycles=1e6, slope=5.0)
    life = calculation.damage("s", sn, 20.0)
    stress = 2 * calculation["s"].stress[0]
    # two swings of order 2 in a turn
    assert life.damage == pytest.approx(2 / float(sn.borne(stress)), rel=0.01)  # 64 points of a swing
    assert life.hours == pytest.approx(1 / life.damage * 2 * math.pi / 20.0 / 3600, rel=1e-9)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"speeds": [0.0, 1.0]}, "ascending and above 0"),
        ({"speeds": 3.0}, "two or more speeds"),
        ({"sections": [Section("s9", diameter=1.0)]}, "'s9' is no spring or shaft here. There are: s"),
        ({"sections": [Section("s1")]}, "is a spring, which has no diameter"),
        ({"sections": [Section("s1", diameter=1.0), Section("s1", diameter=2.0)]}, "'s1' has two"),
        ({"sections": ["s1"]}, "is no section"),
        ({"sections": [Section("s1", diameter=1.0, design="propeller", strength=5e8)]}, "Give rated="),
        ({"misfire": "cylinder 9"}, "'cylinder 9' is no HarmonicTorque"),
        ({"misfire": 2}, "must be the name of a cylinder"),
        ({"rated": -1.0}, "rated = -1.0 must be above 0"),
        ({"permissible": {"s9": 1.0}}, "permissible: 's9' is no spring or shaft here"),
        ({"permissible": {"s1": -1.0}}, r"permissible\['s1'\] = -1.0 must be above 0"),
        ({"permissible": 5.0}, "must say by shaft what torque may last"),
    ],
)
def test_what_is_wrong_is_said_once(options: dict[str, object], message: str) -> None:
    with pytest.raises(sw.ParameterError, match=message):
        sw.torsional_calculation(engine(), **{"speeds": [10.0, 20.0], **options})


def test_a_train_without_excitation_or_with_a_shaft_that_slips_is_refused() -> None:
    net = engine()
    for k in range(1, 5):
        net.remove(f"cylinder {k}")
    with pytest.raises(sw.ParameterError, match="has no HarmonicTorque"):
        sw.torsional_calculation(net, [10.0, 20.0])
    net = engine()
    net.add(sw.Inertia("far", J=1.0), "far")
    net.add(sw.HarmonicTorque("other", harmonics=harmonics()), "far")
    net.add(sw.TorqueSource("link", tau=1.0), "far", "n5")
    with pytest.raises(sw.ParameterError, match="does not follow from that of 'n0'"):
        sw.torsional_calculation(net, [10.0, 20.0])
    braked = engine()
    braked.add(sw.CoulombLoad("rub", tau=3.0), "n5")
    with pytest.raises(sw.ParameterError, match="A torsional calculation of 'engine' needs a point"):
        sw.torsional_calculation(braked, [10.0, 20.0])
    with pytest.raises(sw.SignalError, match="'s9' is no spring or shaft of 'engine'"):
        sw.torsional_calculation(engine(), [10.0, 20.0])["s9"]
    assert len(AMPLITUDES) == len(ORDERS)


def test_an_undamped_resonance_is_named_with_the_shafts_that_lack_damping_and_what_to_give() -> None:
    net = sw.Network("undamped")
    net.add(sw.HarmonicTorque("h", harmonics=sw.Harmonics((1.0, 2.0), (5.0, 3.0))), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Spring("s", c=200.0), "a", "b")
    net.add(sw.Inertia("J2", J=1.0), "b")
    calculation = sw.torsional_calculation(net, [15.0, 25.0])
    assert [(one.order, one.mode) for one in calculation.undamped] == [(1.0, "mode 1")]
    assert calculation["s"].verdict == "NO BOUND where nothing damps"
    (note,) = calculation.notes
    assert "mode 1 (3.1831 Hz) at 190.99 1/min in order 1" in note
    assert "Without damping: 's'" in note
    damping = 0.01 * 200 / 20.0  # a loss factor of 1 % at 20 rad/s
    assert f"d = {damping:.3g} N m s/rad for 's'" in note
    with pytest.raises(sw.ParameterError, match=r"no bound at 20 rad/s.*Without damping: 's'"):
        calculation.waveform("s", 20.0)
    net.replace(sw.Spring("s", c=200.0, d=damping))
    damped = sw.torsional_calculation(net, [15.0, 25.0])
    assert not damped.notes
    # of two equal masses half of the torque passes, magnified by 1 / loss factor
    assert damped["s"].by_order.max() == pytest.approx(2.5 / 0.01, rel=1e-3)


@pytest.mark.parametrize("exact", [False, True])
def test_what_rounding_alone_bounds_is_infinite(exact: bool) -> None:  # noqa: FBT001 (of the parametrisation)
    net = line(sw.Lumped(12))
    for name in ("first", "second"):
        part = next(part for part in net.parts if part.name == name)
        net.replace(part.changed(damping=0.0))
    net.remove("friction")
    net.remove("water")
    calculation = sw.torsional_calculation(net, [20.0, 90.0], exact=exact)
    assert calculation.undamped
    for one in calculation.undamped:
        place = int(np.abs(calculation.speeds - one.speed).argmin())
        assert np.isinf(calculation["first"].amplitude[place])
    assert np.isfinite(calculation["first"].amplitude[[0, -1]]).all()


def test_a_damper_at_a_node_of_a_mode_leaves_it_undamped() -> None:
    net = sw.Network("symmetric")
    net.add(sw.HarmonicTorque("h", harmonics=sw.Harmonics((1.0,), (5.0,))), "a")
    for node, inertia in (("a", 1.0), ("b", 0.5), ("c", 1.0)):
        net.add(sw.Inertia(f"J{node}", J=inertia), node)
    net.add(sw.Spring("s1", c=400.0), "a", "b")
    net.add(sw.Spring("s2", c=400.0), "b", "c")
    net.add(sw.Damper("middle", d=3.0), "b")
    calculation = sw.torsional_calculation(net, [10.0, 45.0])
    assert [one.mode for one in calculation.undamped] == ["mode 1"]  # the ends swing against each other
    assert len(calculation.resonances) == 2  # the other one is damped


def test_a_shaft_without_damping_is_told_its_own_damping() -> None:
    net = sw.Network("undamped shaft")
    net.add(sw.HarmonicTorque("h", harmonics=sw.Harmonics((1.0,), (5.0,))), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Shaft("line", length=2.0, diameter=0.02, model=sw.Lumped(2)), "a", "b")
    net.add(sw.Inertia("J2", J=1.0), "b")
    (note,) = sw.torsional_calculation(net, [20.0, 45.0]).notes
    frequency = float(sw.torsional_calculation(net, [20.0, 45.0]).undamped[0].frequency)
    stiffness = 79.3e9 * math.pi * 0.02**4 / 32
    assert f"damping = {0.01 * stiffness / (2 * math.pi * frequency):.3g} N m^2 s/rad for 'line'" in note


def test_a_permissible_torque_is_judged_with_the_speeds_that_exceed_it() -> None:
    free = sw.torsional_calculation(engine(), np.linspace(30.0, 200.0, 18))
    bound = float(free["s4"].amplitude.max()) / 2
    permissible = {"s4": bound, "s0": 1e6}
    calculation = sw.torsional_calculation(engine(), np.linspace(30.0, 200.0, 18), permissible=permissible)
    assert calculation["s0"].verdict == "below the permissible torque"
    assert calculation["s0"].permitted is True
    assert calculation["s4"].verdict == "ABOVE the permissible torque"
    assert calculation.permitted is False
    assert free.permitted is None
    ends = [speed for span in calculation["s4"].exceeded for speed in span if 30.0 < speed < 200.0]
    assert ends
    for speed in ends:
        again = sw.torsional_calculation(engine(), [speed, 2 * speed])["s4"].amplitude[0]
        assert again == pytest.approx(bound, rel=1e-6)
    assert "s4: above its permissible torque from" in str(calculation)
    heads, row = calculation.heads, next(row for row in calculation.table if row[0] == "s4")
    assert row[heads.index("permissible kN m")] == f"{bound / 1e3:.5g}"


def test_the_row_of_a_shaft_is_at_the_speed_that_governs_it_and_has_its_units() -> None:
    sections = [Section("s4", diameter=0.03, design="intermediate, flange", strength=500e6, scf=1.5)]
    calculation = sw.torsional_calculation(engine(), np.linspace(30.0, 180.0, 16), sections=sections, rated=171.0)
    shaft = calculation["s4"]
    assert shaft.limits is not None
    share = shaft.stress / shaft.limits[0]
    assert shaft.governing == int(share.argmax())
    row = dict(zip(calculation.heads, next(row for row in calculation.table if row[0] == "s4"), strict=True))
    k = shaft.governing
    assert float(row["at 1/min"]) == pytest.approx(shaft.speeds[k] / RPM, rel=1e-4)  # five digits
    assert float(row["stress N/mm^2"]) == pytest.approx(shaft.stress[k] / 1e6, rel=1e-3)  # four digits
    assert float(row["at notch N/mm^2"]) == pytest.approx(1.5 * shaft.stress[k] / 1e6, rel=1e-3)
    assert float(row["tau_c N/mm^2"]) == pytest.approx(shaft.limits[0][k] / 1e6, rel=1e-3)
    assert float(row["tau_t N/mm^2"]) == pytest.approx(shaft.limits[1][k] / 1e6, rel=1e-3)
    assert "permissible kN m" not in calculation.heads  # nothing fills that column
    for head in calculation.heads:
        assert head in calculation._repr_html_()


def test_speeds_that_end_below_those_of_the_rule_are_told() -> None:
    sections = [Section("s4", diameter=0.06, design="intermediate, flange", strength=500e6)]
    short = sw.torsional_calculation(engine(), [30.0, 150.0], sections=sections, rated=150.0)
    assert any("asks for those up to 1504" in note for note in short.notes)
    full = sw.torsional_calculation(engine(), [30.0, 157.5], sections=sections, rated=150.0)
    assert not any("asks for" in note for note in full.notes)


def test_heat_is_sorted_and_has_the_speed_of_the_most() -> None:
    calculation = sw.torsional_calculation(engine(), speeds())
    powers = [power for _, power, _ in calculation.heat]
    assert powers == sorted(powers, reverse=True)
    for part, power, speed in calculation.heat:
        assert calculation.power_lost[part][list(calculation.speeds).index(speed)] == power


def test_modes_say_at_which_speed_they_are_taken() -> None:
    assert "the same at all speeds" in sw.torsional_calculation(engine(), [40.0, 120.0]).modes.title
    net = engine()
    net.remove("load")
    net.add(sw.TorqueSource("water", tau=-0.01 * sw.omega**2), "n5")
    assert "operating point at 1145.9 1/min" in sw.torsional_calculation(net, [40.0, 120.0]).modes.title


def test_what_loses_nothing_loses_nothing_at_an_undamped_resonance_either() -> None:
    """There the amplitudes are infinite, and the power of a spring without damping, or of an inertia, is no number."""
    net = sw.Network("undamped")
    net.add(sw.HarmonicTorque("e", harmonics=sw.Harmonics(orders=(1.0, 2.0), amplitudes=(500.0, 500.0))), "a")
    net.add(sw.Inertia("J1", J=8.0), "a")
    net.add(sw.Spring("s", c=2e5, d=0), "a", "b")
    net.add(sw.Inertia("J2", J=12.0), "b")
    calculation = sw.torsional_calculation(net, np.linspace(50, 180, 10))
    assert not np.isfinite(calculation["s"].amplitude).all()
    assert all((power == 0.0).all() or np.abs(power).max() < 1e-6 for power in calculation.power_lost.values())
    assert calculation.heat == ()
