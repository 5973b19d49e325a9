"""Measured curves from files and with units."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import shaftwork as sw

LOGGER = """\ufeff# measured on the test bench
time;speed;torque
s;1/min;N m
0;0;0
0,5;700;125,5

1;1400;250
"""
"""As data loggers in many countries write it: a comment, units, a decimal comma, an empty line."""


@pytest.fixture
def logged(tmp_path: Path) -> Path:
    path = tmp_path / "bench.csv"
    path.write_text(LOGGER, encoding="utf-8")
    return path


def test_a_column_is_found_by_its_head_or_its_number_below_comments_and_units(logged: Path) -> None:
    wanted = sw.Table([0.0, 0.5, 1.0], [0.0, 125.5, 250.0])
    for columns in (("time", "torque"), (0, 2), ("time", 2)):
        assert sw.Table.from_csv(logged, *columns, delimiter=";", decimal=",") == wanted


def test_a_plain_file_needs_no_arguments_and_a_scale_changes_units(tmp_path: Path) -> None:
    path = tmp_path / "plain.csv"
    path.write_text("0,0\n500,1.5\n1000,3e0\n", encoding="utf-8")
    assert sw.Table.from_csv(path) == sw.Table([0, 500, 1000], [0, 1.5, 3])
    assert sw.Table.from_csv(str(path), scale=(1e-3, 1e3)) == sw.Table([0, 0.5, 1], [0, 1500, 3000])


def test_a_motion_under_a_curve_from_a_file_is_that_under_its_points(logged: Path) -> None:
    def end(curve: sw.Table) -> float:
        net = sw.Network("bench")
        net.add(sw.TorqueSource("motor", tau=curve), "a")
        net.add(sw.Inertia("J", J=2.0), "a")
        return float(net.simulate(1.0)["J.omega"][-1])

    curve = sw.Table.from_csv(logged, "time", "torque", delimiter=";", decimal=",")
    # the integral of the straight lines: 0.5 (0 + 125.5) / 2 + 0.5 (125.5 + 250) / 2, over J
    assert end(curve) == pytest.approx((0.25 * 125.5 + 0.25 * 375.5) / 2.0, rel=1e-12)


@pytest.mark.parametrize(
    ("text", "arguments", "message"),
    [
        (
            "t,tau\n0,1\n1,2\n",
            {"x": "time", "y": "tau"},
            r"no line with numbers in the columns 'time', 'tau'\. .*t, tau",
        ),
        ("t,tau\n0,1\n1,much\n", {"x": "t", "y": "tau"}, r"line 3: column 'tau' holds no number"),
        ("0,1\n1\n", {}, r"line 2: column 1 holds no number"),
        ("0,1\n1,2\n", {"y": 7}, r"no line with numbers in the columns 0, 7"),
        ("0;1\n1;2\n", {}, r"say delimiter and decimal"),
        ("", {}, r"It is empty"),
        ("0,1\n0,2\n", {}, r"csv': Table: x must increase strictly"),
        ("0,1\n1,nan\n", {}, r"csv': Table: y\[1\] = nan is not finite"),
        ("0,1\n1,2\n", {"delimiter": "."}, r"delimiter = '\.' must be one sign"),
    ],
)
def test_what_is_wrong_in_a_file_is_said_with_the_file_and_the_line(
    tmp_path: Path, text: str, arguments: dict[str, object], message: str
) -> None:
    path = tmp_path / "wrong.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(sw.ParameterError, match=message):
        sw.Table.from_csv(path, **arguments)


def test_a_file_that_is_not_there_or_no_text_is_named(tmp_path: Path) -> None:
    with pytest.raises(sw.ParameterError, match=r"'.*nowhere\.csv' cannot be read"):
        sw.Table.from_csv(tmp_path / "nowhere.csv")
    (tmp_path / "binary").write_bytes(b"\xff\xfe\x00\xd8")
    with pytest.raises(sw.ParameterError, match="cannot be read"):
        sw.Table.from_csv(tmp_path / "binary")


def test_times_of_laws_take_units_and_values_refuse_them() -> None:
    pint = pytest.importorskip("pint")
    units = pint.UnitRegistry()
    ms, torque = units.millisecond, units.newton * units.meter
    assert sw.Table(np.array([0.0, 500.0]) * ms, [0, 1]) == sw.Table([0, 0.5], [0, 1])
    assert sw.Table([0 * ms, 500 * ms], [0, 1]) == sw.Table([0, 0.5], [0, 1])
    assert sw.Step(1.0, start=500 * ms) == sw.Step(1.0, start=0.5)
    assert sw.Ramp(1.0, 500 * ms, start=250 * ms) == sw.Ramp(1.0, 0.5, start=0.25)
    for make in (
        lambda: sw.Table([0, 1], np.array([0, 1]) * torque),
        lambda: sw.Table(np.array([0, 1]) * torque, [0, 1]),
        lambda: sw.Step(1.0 * torque),
        lambda: sw.Ramp(1.0, 1.0, before=1.0 * torque),
        lambda: sw.Step(1.0, start=1.0 * torque),
    ):
        with pytest.raises(sw.ParameterError, match=r"newton|N m"):
            make()
