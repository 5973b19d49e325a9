"""The file of a sweep: what is damaged in it is computed anew or named, and nothing else is written over."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import pytest

import shaftwork as sw

STIFFNESSES = np.linspace(500.0, 900.0, 20)
"""More than two chunks of variants that run one by one."""


def swept(store: Path | None) -> sw.studies.Sweep:
    net = sw.Network("swing")
    net.add(sw.TorqueSource("motor", tau=5.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Spring("shaft", c=700.0), "a", "b")
    net.add(sw.Inertia("J2", J=2.0), "b")
    return sw.studies.sweep(
        net,
        {"shaft.c": STIFFNESSES},
        t_end=0.1,
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
        "UPDATE chunks SET alone = alone + 1 WHERE number = 2",
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


def test_a_store_of_another_version_is_refused(whole: Path, tmp_path: Path) -> None:
    path = copied(whole, tmp_path / "store.sqlite")
    with opened(path) as database:
        assert database.execute("SELECT value FROM sweep WHERE what = 'version'").fetchone() == (sw.__version__,)
        database.execute("UPDATE sweep SET value = '0.0.9' WHERE what = 'version'")
    with pytest.raises(
        sw.ParameterError, match=rf"begun by version 0\.0\.9 of Shaftwork, and this is {sw.__version__}"
    ):
        swept(path)


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
