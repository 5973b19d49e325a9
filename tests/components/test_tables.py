"""Measured curves from files and with units."""

from __future__ import annotations

import random
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import shaftwork as sw
from tests.mangling import mangled

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
        ("0,1\n0,2\n", {}, r"csv', line 2: column 0 must increase strictly, but 0\.0 follows 0\.0"),
        ("0,1\n1,nan\n", {}, r"csv', line 2: column 1 holds nan\. Mend"),
        ("0,1\n1,\n2,3\n", {}, r"line 2: column 1 holds no number"),
        ("0,1\n1,1_000\n", {}, r"line 2: column 1 holds no number"),
        ("0,1\n1,inf\n", {}, r"line 2: column 1 holds inf"),
        (
            "t,x,x\n0,1,2\n1,2,3\n",
            {"x": "t", "y": "x"},
            r"no line with numbers .*Name columns by their head or their num",
        ),
        ("0;1,5\n1;1.500\n", {"delimiter": ";", "decimal": ","}, r"line 2: column 1 holds no number"),
        ("2026-03-01T12:00,1\n7,2\n", {}, r"line 2: '7\.0' and .* are not of one kind"),
        ("2026-03-01T12:00,1\n2026-03-01T12:00:01Z,2\n", {}, r"line 2: .* time stamps with a time zone, or without"),
        ("2026-03-01T12:00,1\n2026-03-01T11:00,2\n", {}, r"line 2: column 0 must increase"),
        ("t,tau\n0,1\n1,2\n", {"units": ("s", "N*m")}, r"column 0 has no unit in its head, and is wanted in s"),
        ("t [s],tau [kg]\n0,1\n1,2\n", {"units": ("s", "N*m")}, r"column 1 is given in 'kilogram', but needs N\*m"),
        ("t [s],n [1/min]\n0,1\n1,2\n", {"units": ("s", "rad/s")}, r"may count revolutions or radians.*Give scale"),
        ("t [s],n [9**9**9]\n0,1\n1,2\n", {"units": ("s", "rad/s")}, r"has the unit '9\*\*9\*\*9' in its head"),
        ("t [s],n [foo]\n0,1\n1,2\n", {"units": ("s", "rad/s")}, r"has the unit 'foo', which is not one"),
        ("0,1\n1,2\n", {"units": "s"}, r"units = 's' must be two units"),
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


@pytest.mark.parametrize(
    "text",
    [
        "t [ms];omega [rpm]\n0;0\n500,5;60\n",
        "# bench\nt (ms);omega (rpm)\n0;0\n500,5;60\n",
        "t;omega\nms;rpm\n0;0\n500,5;60\n",
        "t [ms];omega [kN m]; omega [rpm]\n0;7;0\n500,5;7;60\n",
    ],
)
def test_units_in_the_head_are_converted_to_those_that_are_wanted(tmp_path: Path, text: str) -> None:
    path = tmp_path / "bench.csv"
    path.write_text(text, encoding="utf-8")
    y = "omega [rpm]" if "kN" in text else "omega"
    curve = sw.Table.from_csv(path, "t", y, delimiter=";", decimal=",", units=("s", "rad/s"))
    assert curve.xs == pytest.approx((0.0, 0.5005), rel=1e-15)
    assert curve.ys == pytest.approx((0.0, 2 * np.pi), rel=1e-15)
    with pytest.warns(sw.NetworkWarning, match="in (ms|rpm), and its numbers stand as they are"):
        assert sw.Table.from_csv(path, "t", y, delimiter=";", decimal=",").ys == (0.0, 60.0)
    same = sw.Table.from_csv(path, "t", y, delimiter=";", decimal=",", units=("ms", "rpm"))
    assert same == sw.Table([0.0, 500.5], [0.0, 60.0])


@pytest.mark.parametrize(
    ("unit", "wanted", "factor"),
    [
        ("Nm", "N*m", 1.0),
        ("kNm", "N*m", 1e3),
        ("N m", "N*m", 1.0),
        ("N·m", "N*m", 1.0),
        ("N*m*s/rad", "N*m*s/rad", 1.0),
        ("1/s", "Hz", 1.0),
        ("%", "1", 0.01),
        ("mm^2", "m^2", 1e-6),
    ],
)
def test_units_are_read_as_they_are_usually_written(tmp_path: Path, unit: str, wanted: str, factor: float) -> None:
    path = tmp_path / "bench.csv"
    path.write_text(f"t [s],y [{unit}]\n0,1\n1,2\n", encoding="utf-8")
    assert sw.Table.from_csv(path, "t", "y", units=("s", wanted)).ys == pytest.approx((factor, 2 * factor), rel=1e-15)


def test_time_stamps_are_seconds_from_the_first(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    rows = ("2026-03-01T23:59:59.75+01:00,1", "2026-03-01T23:00:00.000001Z,2", "2026-03-02 00:00:01+01:00,3")
    path.write_text("when,tau [Nm]\n" + "\n".join(rows), encoding="utf-8")
    curve = sw.Table.from_csv(path, "when", "tau", units=("s", "N*m"))
    assert curve == sw.Table([0.0, 0.250001, 1.25], [1, 2, 3])
    assert sw.Table.from_csv(path, "when", "tau", units=("ms", None)).xs == pytest.approx((0.0, 250.001, 1250.0))


def test_units_that_are_those_wanted_need_no_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pint", None)
    path = tmp_path / "bench.csv"
    path.write_text("t [s],tau [N*m],n [rpm]\n0,1,1\n1,2,2\n", encoding="utf-8")
    assert sw.Table.from_csv(path, "t", "tau", units=("s", "N*m")).ys == (1.0, 2.0)
    with pytest.raises(sw.MissingExtraError, match=r"shaftwork\[units\]"):
        sw.Table.from_csv(path, "t", "n", units=("s", "rad/s"))


@pytest.mark.slow
def test_mutated_records_are_read_or_refused(tmp_path: Path) -> None:
    chance, path = random.Random(3), tmp_path / "bench.csv"  # noqa: S311
    texts = [LOGGER, "t [ms],omega [rpm]\n0,0\n500,60\n", "2026-03-01T12:00:00,1\n2026-03-01T12:00:01.5,2\n"]
    for _ in range(1000):
        text = mangled(chance.choice(texts), chance, ";,.0123456789-eE:TZ[]()\"'\n\0 \u00e4\u0661*/^")
        path.write_text(text, encoding="utf-8")
        signs = {"delimiter": ";", "decimal": ","} if ";" in text else {}
        units = chance.choice(((None, None), ("s", "rad/s"), ("s", "N*m")))
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", sw.NetworkWarning)
                curve = sw.Table.from_csv(path, units=units, **signs)
        except sw.ParameterError:
            continue
        assert np.isfinite([*curve.xs, *curve.ys]).all()


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


EXCEL = b"sep=;\r\n" + "Zeit [ms];Drehzahl [U/min];Temp. [°C]\r\n0;0;20,5\r\n500;60;20,5\r\n".encode("cp1252")
CATMAN = "\ufeff# Start: 01.03.2026\nZeit\tDrehzahl\nms\trpm\n0,0\t0,0\n5,0e2\t60,0\n".encode()
LABVIEW = "time_ms\tspeed_rpm\r\n0\t0\r\n500\t60\r\n".encode("utf-16")
SCOPE = b"Time,Channel A\n(ms),(rpm)\n\n0.0,0.0\n500.0,60.0\n"
SETTINGS = b'Model,X1\nSample rate,2000\nRun (3),"a, b"\n\nt [ms],n [rpm]\n0,0\n500,60\n'
STAMPS = b'"when";"n (rpm)"\n"2026-03-01 12:00:00,000";"0"\n"2026-03-01 12:00:00,500";"60"\n'


@pytest.mark.parametrize(
    ("content", "columns", "signs"),
    [
        (EXCEL, ("Zeit", "Drehzahl"), ";,"),
        (CATMAN, ("Zeit", "Drehzahl"), "\t,"),
        (LABVIEW, ("time_ms", "speed"), "\t."),
        (SCOPE, ("Time", "Channel A"), ",."),
        (SETTINGS, ("t", "n"), ",."),
        (STAMPS, ("when", "n"), ";,"),
    ],
    ids=["spreadsheet", "units below", "UTF-16", "units in brackets below", "settings above", "time stamps"],
)
def test_files_of_six_loggers_are_read_by_names_and_by_numbers(
    tmp_path: Path, content: bytes, columns: tuple[str, str], signs: str
) -> None:
    path = tmp_path / "logger.csv"
    path.write_bytes(content)
    for x, y in (columns, (0, 1)):
        curve = sw.Table.from_csv(path, x, y, delimiter=signs[0], decimal=signs[1], units=("s", "rad/s"))
        assert curve.xs == pytest.approx((0.0, 0.5), rel=1e-15)
        assert curve.ys == pytest.approx((0.0, 2 * np.pi), rel=1e-15)
        with pytest.warns(sw.NetworkWarning, match="is in (ms|rpm|U/min), and its numbers stand as they are"):
            sw.Table.from_csv(path, x, y, delimiter=signs[0], decimal=signs[1])


def test_numbers_that_are_scaled_or_in_si_are_taken_without_a_word(tmp_path: Path) -> None:
    path = tmp_path / "bench.csv"
    path.write_text("t [ms],tau [Nm],shaft_max\n0,1,2\n500,2,3\n", encoding="utf-8")
    assert sw.Table.from_csv(path, "t", "tau", scale=(1e-3, 1)) == sw.Table([0, 0.5], [1, 2])
    assert sw.Table.from_csv(path, "t", "shaft_max", scale=(1e-3, 2)) == sw.Table([0, 0.5], [4, 6])


@pytest.mark.parametrize("gap", ["1,", "1,a", ",5", "1"])
def test_a_gap_in_the_first_line_is_refused_by_numbers_too(tmp_path: Path, gap: str) -> None:
    path = tmp_path / "bench.csv"
    path.write_text(f"{gap}\n2,3\n3,4\n", encoding="utf-8")
    with pytest.raises(sw.ParameterError, match=r"line 1: column . holds no number"):
        sw.Table.from_csv(path)


@pytest.mark.parametrize("gap", ["1,", "1,a", ",5"])
def test_a_gap_in_the_first_line_below_the_head_is_refused(tmp_path: Path, gap: str) -> None:
    """It is none of the lines of the head, which have no numbers there, as units have none."""
    path = tmp_path / "bench.csv"
    path.write_text(f"t,x\ns,V\n{gap}\n2,3\n3,4\n", encoding="utf-8")
    with pytest.raises(sw.ParameterError, match=r"line 3: column '.' holds no number"):
        sw.Table.from_csv(path, "t", "x")
