"""Catalogues, and which of their motors a motion may have."""

from __future__ import annotations

import math
import re
import warnings
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import shaftwork as sw
from shaftwork.sizing.catalogue import OWN, TYPICAL
from shaftwork.sizing.motor_choice import _reasons
from tests.properties.examples import share_of_examples

MOTORS = {motor.name: motor for motor in sw.sizing.catalogue()}
MOTOR = MOTORS["112M 4 kW 4-pole"]
HEADER = "name,power,n_n,n_sync,tau_n,tau_a,tau_s,tau_k,J"
ROW = "M,4000,1455,1500,26.25,63,52.5,81.38,0.015"


def motion(top: float, J: float, load: float, lengths: tuple[float, float, float, float]) -> sw.Solution:
    t = np.cumsum(lengths)
    net = sw.Network("hoist")
    net.add(sw.SpeedSource("drive", omega=sw.Table([0.0, *t], [0.0, top, top, 0.0, 0.0])), "shaft")
    net.add(sw.Inertia("J", J=J), "shaft")
    net.add(sw.TorqueSource("load", tau=-sw.Step(load) + sw.Step(load, t[2])), "shaft")
    return net.simulate(float(t[3]))


@pytest.mark.slow
@share_of_examples(0.1)
@given(
    share=st.floats(0.3, 1.4),
    load=st.floats(1.0, 40.0),
    J=st.floats(0.01, 0.3),
    rotor=st.sampled_from([0.0, 0.01]),
    cooling=st.floats(0.2, 1.0),
)
def test_the_rotor_is_accelerated_too_and_flux_above_the_rated_speed_is_weak(
    share: float, load: float, J: float, rotor: float, cooling: float
) -> None:
    """Against quadrature of the closed form: heat of torque over flux, cooling in proportion to the speed."""
    top, lengths = share * MOTOR.n_n * math.pi / 30, (0.5, 2.0, 0.25, 4.0)
    made = sw.sizing.duty(motion(top, J, load, lengths), "drive", cooling=cooling, n_cooling=1000.0, cycle=10.0)
    (found,) = sw.sizing.choose(made, [MOTOR], rotor=rotor).candidates

    inertia = J + MOTOR.J - rotor
    torques = [load + inertia * top / 0.5, load, load - inertia * top / 0.25]
    x, w = np.polynomial.legendre.leggauss(12)

    def over_ramp(of: object, kink: float) -> float:
        """Mean along a straight line from 0 to the top speed of something that kinks at the rated speed."""
        ends = [0.0, min(kink, 1.0), 1.0]
        parts = ((a + (b - a) * (x + 1) / 2, (b - a) / 2) for a, b in pairwise(ends))
        return float(sum((w @ of(u)) * half for u, half in parts))  # type: ignore[operator]

    weak = over_ramp(lambda u: np.maximum(u * share, 1.0) ** 2, 1 / share)
    heat = weak * (0.5 * torques[0] ** 2 + 0.25 * torques[2] ** 2) + 2.0 * (torques[1] * max(share, 1.0)) ** 2
    cools = over_ramp(lambda u: cooling + (1 - cooling) * np.minimum(u * share, 1.0), 1 / share)
    time = 0.75 * cools + 2.0 * (cooling + (1 - cooling) * min(share, 1.0)) + 7.25 * cooling
    assert found.tau_thermal == pytest.approx(math.sqrt(heat / time), rel=1e-10)
    # in a panel as short as 1e-5 of the cycle the slope of the speed has a rounding of some 1e-9
    assert found.tau_peak == pytest.approx(max(map(abs, torques)), rel=1e-8)
    limits = MOTOR.limit(np.array([top * 30 / math.pi]))
    assert found.reserve == pytest.approx(float(limits[0]) / found.tau_peak, rel=1e-8)


@pytest.mark.slow
def test_the_best_motor_is_the_smallest_that_nothing_speaks_against() -> None:
    made = sw.sizing.duty(motion(150.0, 0.05, 12.0, (0.5, 3.0, 0.5, 1.0)), "drive")
    choice = sw.sizing.choose(made)
    best = choice.best
    assert best.fits
    assert all(one.motor.power >= best.motor.power for one in choice.fitting)
    assert len(choice.candidates) == len(MOTORS)
    for one in choice.candidates:
        heat, peak = one.tau_thermal <= one.motor.tau_n, one.reserve >= choice.overload
        assert one.fits == (heat and peak and made.n_top <= one.motor.fastest)
        assert heat or any("thermal torque" in reason for reason in one.reasons)
        assert peak or any("overload reserve" in reason or "speed" in reason for reason in one.reasons)
    assert made.reserve(best.motor.limit).ratio > best.reserve  # which the rotor takes some of
    table = choice.table()
    assert table["motor"][0] == best.motor.name
    assert table["fits"].sum() == len(choice.fitting)
    text = str(choice)
    assert "chosen: typical" in text
    assert "not checked: " in text
    labels = [entry.get_text() for entry in choice.plot().axes[0].get_legend().get_texts()]
    assert labels == ["rated torque", f"limit of {best.motor.name}", "thermal torque, S1"]


def test_each_reason_is_named_and_none_that_fits_is_an_error() -> None:
    made = sw.sizing.duty(motion(150.0, 0.05, 24.0, (0.5, 8.0, 0.5, 0.1)), "drive")
    weak = replace(MOTOR, tau_n=20.0, power=20.0 * MOTOR.n_n * math.pi / 30, name="hot")
    slow = replace(MOTOR, n_max=1456.0, n_n=1400.0, power=26.25 * 1400 * math.pi / 30, name="slow")
    small = replace(MOTOR, tau_k=42.0, tau_s=40.0, tau_a=41.0, name="small")
    fast = sw.sizing.duty(motion(155.0, 0.05, 2.0, (0.5, 8.0, 0.5, 0.1)), "drive")
    reasons = {one.motor.name: one.reasons for one in sw.sizing.choose(made, [weak, small, MOTOR]).candidates}
    assert reasons[MOTOR.name] == ()
    assert any(reason.startswith("thermal torque") for reason in reasons["hot"])
    assert re.fullmatch(r"overload reserve .* below 1.3", reasons["small"][0])
    assert sw.sizing.choose(fast, [slow]).candidates[0].reasons == ("speed 1480 above 1456 1/min",)
    with pytest.raises(
        sw.ParameterError, match=r"None of 1 motors fits 'drive' in 'hoist'. Nearest: hot: .*thermal torque"
    ):
        _ = sw.sizing.choose(made, [weak]).best
    for arguments, says in (
        ((made, []), "one or more"),
        ((made, ["M"]), "one or more"),
        (("motor",), "str is no duty"),
    ):
        with pytest.raises(sw.ParameterError, match=says):
            sw.sizing.choose(*arguments)  # type: ignore[arg-type]
    for bounds in ({"overload": 0.0}, {"rotor": -1.0}):
        with pytest.raises(sw.ParameterError, match="must be"):
            sw.sizing.choose(made, **bounds)


@pytest.mark.slow
def test_a_motor_that_is_switched_off_is_not_asked_to_accelerate_its_rotor() -> None:
    made = sw.sizing.duty(sw.scenes.crane().simulate(10.0), "motor", cycle=40.0)
    heavy = replace(MOTOR, J=1.0)
    braked = sw.sizing.choose(made, [heavy]).candidates[0]
    started = sw.sizing.duty(sw.scenes.crane().simulate(6.4), "motor", cycle=40.0)
    assert braked.tau_peak == pytest.approx(sw.sizing.choose(started, [heavy]).candidates[0].tau_peak, rel=1e-3)


@pytest.mark.parametrize("start", [0.0, 0.5])
def test_the_impulse_of_a_speed_that_jumps_is_in_no_figure_and_the_choice_says_so(start: float) -> None:
    """Of the impulse of all torque, J omega + d omega t, the first part is not in the mean torque."""
    net = sw.Network("hard")
    net.add(sw.SpeedSource("drive", omega=sw.Step(10.0, start) if start else 10.0), "shaft")
    net.add(sw.Inertia("J", J=3.0), "shaft")
    net.add(sw.Gear("gear", ratio=-2.0), "shaft", "wheel")
    net.add(sw.ViscousLoad("load", d=4.0), "wheel")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.NetworkWarning)  # that the torque is an impulse, which is the point
        sol = net.simulate(2.0)
    for named in ({"motor": "drive"}, {"torque": "gear.tau_b", "speed": "wheel.omega"}):
        made = sw.sizing.duty(sol, **named)  # type: ignore[arg-type]
        (note,) = made.notes
        assert f"the speed jumps at {start:g} s; what an inertia rigidly there takes at once is in no figure" in note
        assert note.startswith("from rest") is (start == 0)
    made = sw.sizing.duty(sol, "drive", ratio=3.0)
    assert made.tau_mean * made.duration == pytest.approx(1.0 * 10.0 * (2.0 - start) / 3, rel=1e-10)
    choice = sw.sizing.choose(made)
    for text in made.notes:
        assert f"duty: {text}\n" in str(choice)
    assert "not checked: the impulse on the motor's own rotor where the speed jumps" in str(choice)


@pytest.mark.slow
def test_a_motor_that_runs_or_that_a_store_starts_gives_no_impulse() -> None:
    crane = sw.scenes.crane_start()
    running = crane.simulate(1.0, initial=crane.compile().steady_state())
    assert running["rotor.omega"][0] > 1.0
    soft = sw.Network("soft")
    soft.add(sw.SpeedSource("drive", omega=10.0), "motor")
    soft.add(sw.Spring("shaft", c=100.0, d=1.0), "motor", "wheel")
    soft.add(sw.Inertia("J", J=1.0), "wheel")
    for made in (
        sw.sizing.duty(running, "motor"),
        sw.sizing.duty(soft.simulate(1.0), torque="shaft.tau", speed="J.omega"),
        sw.sizing.duty(sw.scenes.crane().simulate(1.0), "motor"),
    ):
        assert made.jumps.size == 0
        assert "jump" not in str(made)
        assert "impulse" not in str(sw.sizing.choose(made))


@pytest.mark.slow
def test_the_packages_motors_are_marked_as_chosen_and_make_parts_of_a_network() -> None:
    assert OWN.read_text(encoding="utf-8").startswith("#")
    assert "CHOSEN" in OWN.read_text(encoding="utf-8")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for motor in MOTORS.values():
            assert motor.source == TYPICAL
            assert motor.nameplate.table.count("chosen") == 9  # the title names the source too
            motor.nameplate.cage("motor", ratio=10.0)
    net = sw.Network("bench")
    net.add(MOTOR.nameplate.cage("motor"), "shaft")
    net.add(sw.Inertia("J", J=0.1 + MOTOR.J), "shaft")
    assert sw.sizing.duty(net.simulate(3.0), "motor").tau_max == pytest.approx(MOTOR.tau_k, rel=1e-6)


def test_the_limit_is_that_of_a_drive_that_always_leads_the_motor_to_the_pull_out_point() -> None:
    net = sw.Network("bench")
    values = {"tau_k": MOTOR.tau_k, "s_k": MOTOR.nameplate.s_k, "n_sync": MOTOR.n_sync}
    net.add(sw.PullOutDrive("motor", **values, overspeed=3.0), "shaft")
    net.add(sw.Inertia("J", J=1.0), "shaft")
    model = net.compile()
    speeds = np.array([0.0, 700.0, 1100.0, 1300.0, 1500.0, 2400.0, 3500.0])
    torques = [float(model.rhs(0.0, np.array([n * np.pi / 30]))[0]) for n in speeds]
    assert MOTOR.limit(speeds) == pytest.approx(torques, rel=1e-9)
    assert MOTOR.limit(np.array([3601.0])).tolist() == [0.0]


def test_a_catalogue_of_the_users_own_may_have_remarks_other_orders_and_empty_cells(tmp_path: Path) -> None:
    file = tmp_path / "mine.csv"
    file.write_text(
        f'# mine\n\nframe,{HEADER},n_max\n"112M, foot",{ROW},\n,{ROW.replace("M,", "N,")},2000\n', "utf-8-sig"
    )
    first, second = sw.sizing.catalogue(file)
    assert (first.frame, first.name, first.n_max, first.fastest, first.source) == (
        "112M, foot",
        "M",
        None,
        1500,
        "mine.csv",
    )
    assert (second.frame, second.fastest, second.f_n) == ("", 2000.0, 50.0)
    made = sw.sizing.duty(motion(150.0, 0.05, 12.0, (0.5, 3.0, 0.5, 1.0)), "drive")
    for given_as in (file, str(file), [first, second]):
        assert [one.motor for one in sw.sizing.choose(made, given_as).candidates] == [first, second]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "has no motors. Its first line names the columns, name, power"),
        (HEADER, "has no motors"),
        (f"{HEADER.replace(',J', '')}\n{ROW}", "lacks J. Columns are name, power"),
        (f"{HEADER},price,{'J'}\n{ROW},3,1", "has the unknown 'price'; it has twice 'J'"),
        (HEADER + "\n" + ROW.replace("M,", '"M\nfoot",'), "line 2 .*its quotes do not match. A motor is one line"),
        (f"{HEADER}\n{ROW},7", r"line 2 \(\): it has 10 cells, and there are 9 columns"),
        (f"{HEADER}\n{ROW.replace('4000', '4 kW')}", r"line 2 \(M\): power = '4 kW' is no number"),
        (
            f"{HEADER}\n{ROW.replace('4000', '4')}",
            "power = 4 W, but tau_n = 26.25 N m at n_n = 1455 1/min makes 4000 W",
        ),
        (f"{HEADER}\n{ROW.replace('81.38', '3.1')}", "tau_s = 52.5 N m must be less than tau_k = 3.1"),
        (f"{HEADER}\n{ROW.replace('1500', '1400')}", "rated speed n_n = 1455 1/min is not less than"),
        (f"{HEADER}\n{ROW.replace('0.015', '-1')}", "J = -1.0 must be at least 0"),
        (f"{HEADER}\n{ROW.replace('0.015', 'nan')}", "J = nan must be a finite number"),
        (f"{HEADER}\n{ROW.replace('0.015', '')}", "J is empty"),
        (f"{HEADER},n_max\n{ROW},900", "n_max = 900 1/min is less than the rated speed"),
        (f"{HEADER}\n{ROW}\n{ROW}", "'M' is the name of 2 motors"),
        ("\n".join([HEADER, *[ROW.replace("4000", "x")] * 12]), r"line 9 .*\n  and 4 more"),
    ],
)
def test_mistakes_of_a_catalogue_are_named_with_their_lines(tmp_path: Path, text: str, says: str) -> None:
    file = tmp_path / "bad.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(sw.ParameterError, match=says) as caught:
        sw.sizing.catalogue(file)
    assert "bad.csv" in str(caught.value)


def test_a_catalogue_that_is_not_there_or_no_text_is_refused(tmp_path: Path) -> None:
    binary = tmp_path / "motors.xlsx"
    binary.write_bytes(bytes(range(256)))
    for path in (tmp_path / "nothing.csv", tmp_path, binary):
        with pytest.raises(sw.ParameterError, match="cannot be read"):
            sw.sizing.catalogue(path)


def test_what_is_no_path_of_a_catalogue_is_refused() -> None:
    made = sw.sizing.duty(motion(100.0, 0.1, 10.0, (1.0, 1.0, 1.0, 1.0)), "drive")
    for ask in (lambda: sw.sizing.catalogue(5), lambda: sw.sizing.choose(made, 3)):  # type: ignore[arg-type]
        with pytest.raises(sw.ParameterError, match="is no path of one"):
            ask()


def test_without_a_rotor_the_inertias_of_the_network_are_all_of_the_load() -> None:
    made = sw.sizing.duty(motion(100.0, 0.1, 5.0, (0.5, 2.0, 0.25, 4.0)), "drive")
    (found,), (whole,), (less,) = (
        sw.sizing.choose(made, [MOTOR], **given).candidates for given in ({}, {"rotor": 0.0}, {"rotor": 0.05})
    )
    assert found.tau_peak == whole.tau_peak > less.tau_peak
    assert found.tau_thermal == whole.tau_thermal > less.tau_thermal


def test_a_motor_may_be_used_up_to_its_rated_torque() -> None:
    assert [*_reasons(MOTOR, MOTOR.tau_n, 2.0, 100.0, 1.3)] == []
    (reason,) = _reasons(MOTOR, math.nextafter(MOTOR.tau_n, math.inf), 2.0, 100.0, 1.3)
    assert reason.startswith("thermal torque")
