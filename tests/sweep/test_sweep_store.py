"""The file of a sweep: what is damaged in it is computed anew or named, and nothing else is written over."""

from __future__ import annotations

import json
import re
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shaftwork as sw
from shaftwork.components import REGISTRY

STIFFNESSES = np.linspace(500.0, 900.0, 20)
"""More than two chunks of variants that run one by one."""


def swept(store: Path | None, t_end: float = 0.1) -> sw.studies.Sweep:
    net = sw.Network("swing")
    net.add(sw.TorqueSource("motor", tau=5.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Spring("shaft", c=700.0), "a", "b")
    net.add(sw.Inertia("J2", J=2.0), "b")
    return sw.studies.sweep(
        net,
        {"shaft.c": STIFFNESSES},
        t_end=t_end,
        measures=["max shaft.tau", "end J.omega"],
        engine="scipy",
        processes=1,
        store=store,
    )


@contextmanager
def opened(path: Path) -> Iterator[sqlite3.Connection]:
    with closing(sqlite3.connect(path)) as database, database:
        yield database


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("store") / "whole.sqlite"
    swept(path)
    with opened(path) as database:
        assert database.execute("SELECT count(*) FROM chunks").fetchone() == (3,)
    return path


def copied(whole: Path, path: Path) -> Path:
    path.write_bytes(whole.read_bytes())
    return path


def test_a_whole_file_gives_the_measures_to_the_last_bit(whole: Path, tmp_path: Path) -> None:
    again = swept(copied(whole, tmp_path / "store.sqlite"))
    for name, values in swept(None).measures.items():
        np.testing.assert_array_equal(again.measures[name], values)


@pytest.mark.parametrize(
    "change",
    [
        'UPDATE chunks SET alone = \'{"0": "no"}\' WHERE number = 2',
        'UPDATE chunks SET reasons = \'{"0": "no"}\' WHERE number = 2',
        "UPDATE chunks SET measured = zeroblob(128) WHERE number = 2",
        "UPDATE chunks SET variants = zeroblob(64) WHERE number = 2",
    ],
)
def test_a_chunk_that_was_changed_is_computed_anew_with_a_warning(whole: Path, tmp_path: Path, change: str) -> None:
    path = copied(whole, tmp_path / "store.sqlite")
    with opened(path) as database:
        database.execute(change)
    with pytest.warns(sw.AccuracyWarning, match=r"store\.sqlite': chunk 2 is damaged, and its variants are computed"):
        resumed = swept(path)
    for name, values in swept(None).measures.items():
        np.testing.assert_array_equal(resumed.measures[name], values)
    assert swept(path).measures["end J.omega"].tobytes() == resumed.measures["end J.omega"].tobytes()


@pytest.mark.parametrize("text", ["[1]\n", '{"format": 2, "network": "swing"}\n', "remarks\n" * 200])
def test_what_is_no_file_of_a_sweep_is_refused_and_stays_as_it_is(tmp_path: Path, text: str) -> None:
    path = tmp_path / "other.txt"
    path.write_text(text)
    with pytest.raises(sw.ParameterError, match=r"other\.txt' is no file of a sweep"):
        swept(path)
    assert path.read_text() == text


def test_the_database_of_something_else_is_refused_and_stays_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "other.sqlite"
    with opened(path) as database:
        database.execute("CREATE TABLE prices (part TEXT, price REAL)")
    before = path.read_bytes()
    with pytest.raises(sw.ParameterError, match=r"other\.sqlite' is a database of something else"):
        swept(path)
    assert path.read_bytes() == before


@pytest.mark.parametrize("library", ["shaftwork", "numpy"])
def test_a_store_of_another_version_is_refused(whole: Path, tmp_path: Path, library: str) -> None:
    path = copied(whole, tmp_path / "store.sqlite")
    with opened(path) as database:
        (text,) = database.execute("SELECT value FROM sweep WHERE what = 'libraries'").fetchone()
        now = json.loads(text)[library]
        older = json.dumps({**json.loads(text), library: "0.0.9"})
        database.execute("UPDATE sweep SET value = ? WHERE what = 'libraries'", (older,))
    with pytest.raises(sw.ParameterError, match=rf"begun with {library} 0\.0\.9, and this is {re.escape(now)}: other"):
        swept(path)


def test_a_store_of_another_sweep_is_not_called_damaged(whole: Path, tmp_path: Path) -> None:
    path = copied(whole, tmp_path / "store.sqlite")
    with pytest.raises(sw.ParameterError, match="holds another sweep, which differs in its t_end") as caught:
        swept(path, t_end=0.2)
    assert "damaged" not in str(caught.value)
    assert "Delete" not in str(caught.value)


def test_a_store_is_that_of_the_laws_of_its_parts(tmp_path: Path) -> None:
    """Two parts of the same name and numbers, whose laws differ, and rows of balls that are hit in two ways."""

    def fan(power: int) -> sw.Network:
        @sw.component
        class Fan(sw.Component):
            d: float = sw.parameter("1", "factor")
            role = "loss"
            ports = (sw.Port("a"),)

            def branches(self, p: Any) -> Iterator[Any]:
                yield sw.ThroughLaw(p.d * sw.ACROSS**power, ("a", None), "tau")

        del REGISTRY["Fan"]
        net = sw.Network("fan")
        net.add(sw.TorqueSource("motor", tau=5.0), "a")
        net.add(sw.Inertia("J", J=1.0), "a")
        net.add(Fan("fan", d=0.1), "a")
        return net

    def balls(impacts: str) -> sw.Network:
        net = sw.Network("balls", impacts=impacts)
        net.add(sw.TorqueSource("motor", tau=5.0), "a")
        net.add(sw.Inertia("J", J=1.0), "a")
        return net

    for number, (one, other) in enumerate(((fan(1), fan(3)), (balls("in turn"), balls("together")))):
        call: dict[str, Any] = {"t_end": 0.1, "measures": ["end J.omega"], "store": tmp_path / f"{number}.sqlite"}
        sw.studies.sweep(one, {"J.J": [1.0, 2.0]}, **call)
        with pytest.raises(sw.ParameterError, match="another sweep, which differs in its network"):
            sw.studies.sweep(other, {"J.J": [1.0, 2.0]}, **call)


def test_a_store_is_that_of_what_a_partial_function_is_given(tmp_path: Path) -> None:
    def scaled(solution: sw.Solution, factor: float) -> float:
        return factor * float(solution["J.omega"][-1])

    net = sw.Network("start")
    net.add(sw.TorqueSource("motor", tau=5.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    for factor in (1.0, 2.0):
        call: dict[str, Any] = {"t_end": 0.1, "measures": {"speed": partial(scaled, factor=factor)}, "processes": 1}
        if factor == 1.0:
            sw.studies.sweep(net, {"J.J": [1.0, 2.0]}, store=tmp_path / "store.sqlite", **call)
            continue
        with pytest.raises(sw.ParameterError, match="another sweep, which differs in its measures"):
            sw.studies.sweep(net, {"J.J": [1.0, 2.0]}, store=tmp_path / "store.sqlite", **call)


def test_a_store_is_a_file_and_says_of_what_another_sweep_differs(whole: Path, tmp_path: Path) -> None:
    with pytest.raises(sw.ParameterError, match="is no file, so nothing would be kept"):
        swept(":memory:")  # type: ignore[arg-type]
    path = copied(whole, tmp_path / "store.sqlite")
    with pytest.raises(sw.ParameterError, match=r"differs in its t_end \(0\.1, and here 0\.2\)"):
        swept(path, t_end=0.2)


def test_variants_that_are_stored_twice_count_once(tmp_path: Path) -> None:
    pytest.importorskip("numba")
    net = sw.Network("swing")
    net.add(sw.TorqueSource("motor", tau=5.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Spring("shaft", c=700.0, d=1.0), "a", "ground")
    damping = np.linspace(1.0, 2.0, 16)
    damping[3] = 0.0  # has other equations

    def resumed() -> sw.studies.Sweep:
        return sw.studies.sweep(net, samples={"shaft.d": damping}, t_end=0.1, measures=["end J.omega"], store=path)

    path = tmp_path / "store.sqlite"
    whole = resumed()
    with opened(path) as database:
        columns = "variants, measured, reasons, alone, digest"
        database.execute(f"INSERT INTO chunks ({columns}) SELECT {columns} FROM chunks")  # noqa: S608 (names above)
    again = resumed()
    assert again.why == whole.why
    assert again.why.startswith("1 of 16 variants ran one by one")
    np.testing.assert_array_equal(again.measures["end J.omega"], whole.measures["end J.omega"])


@pytest.mark.parametrize(
    "measure", [lambda _: 1.0, partial(max, key=lambda _: 1.0), object.__new__(type("F", (), {"__call__": len}))]
)
def test_a_store_takes_no_function_that_it_could_not_tell_from_another_one(tmp_path: Path, measure: Any) -> None:
    net = sw.Network("start")
    net.add(sw.Inertia("J", J=1.0), "a")
    with pytest.raises(sw.ParameterError, match="measure 'mine' is a lambda, or has no name that stays the same"):
        sw.studies.sweep(net, {"J.J": [1.0]}, t_end=0.1, measures={"mine": measure}, store=tmp_path / "store.sqlite")
