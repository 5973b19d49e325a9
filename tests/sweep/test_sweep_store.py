"""The file of a sweep: what is damaged in it is named with its line, and nothing that is no sweep's is written over."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shaftwork as sw
from shaftwork.sweep.sweep_store import check_of

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


@pytest.fixture(scope="module")
def lines(tmp_path_factory: pytest.TempPathFactory) -> list[str]:
    """Of a whole file: what the sweep is, and three chunks."""
    path = tmp_path_factory.mktemp("store") / "whole.jsonl"
    swept(path)
    made = path.read_text().splitlines()
    assert len(made) == 4
    return made


@pytest.fixture(scope="module")
def whole() -> dict[str, np.ndarray]:
    """The measures of the sweep without a store."""
    return swept(None).measures


def chunk(**changes: Any) -> str:
    whole = {"variants": [0, 1], "values": [[1.0, 2.0], [3.0, 4.0]], "reasons": ["", ""], "left": 0} | changes
    made = {key: value for key, value in whole.items() if value != "no"}
    return json.dumps(made | {"check": check_of(made)})


@pytest.mark.slow
@pytest.mark.parametrize(
    ("line", "says"),
    [
        ('{"variants": [0, 1], "val', "it is not whole"),
        ("", "it is not whole"),
        ("\x00" * 40, "it is not whole"),
        ("\xfc\xff", "it is not whole"),
        ("[" * 100_000, "it is not whole"),
        ("[]", "no chunk of a sweep"),
        ("3", "no chunk of a sweep"),
        ("{}", "it lacks 'variants', 'values', 'reasons'"),
        (chunk(values="no"), "it lacks 'values'"),
        (chunk(variants=[0, 20]), "different whole numbers from 0 to 19"),
        (chunk(variants=[-1, 0]), "different whole numbers from 0 to 19"),
        (chunk(variants=[1, 1]), "different whole numbers from 0 to 19"),
        (chunk(variants=[0.5, 1]), "different whole numbers from 0 to 19"),
        (chunk(variants=[True, 0]), "different whole numbers from 0 to 19"),
        (chunk(variants={"0": 1}), "different whole numbers from 0 to 19"),
        (chunk(values=[[1.0, 2.0]]), "not 2 numbers for each of its 2 variants"),
        (chunk(values=[[1.0], [2.0]]), "not 2 numbers for each of its 2 variants"),
        (chunk(values=[1.0, 2.0]), "not 2 numbers for each of its 2 variants"),
        (chunk(values=[[1.0, "2"], [3.0, 4.0]]), "not 2 numbers for each of its 2 variants"),
        (chunk(values=[[1.0, float("nan")], [3.0, 4.0]]), "not 2 numbers for each of its 2 variants"),
        (chunk(values=[[1.0, 10**400], [3.0, 4.0]]), "not 2 numbers for each of its 2 variants"),
        (chunk(reasons=[""]), "not a text for each of its 2 variants"),
        (chunk(reasons=["", None]), "not a text for each of its 2 variants"),
        (chunk(left=3), "'left' is not a whole number from 0 to 2"),
        (chunk().replace("4.0", "5.0"), "its digits are not those that were written"),
    ],
)
def test_a_damaged_line_is_named_and_without_it_the_sweep_goes_on(
    tmp_path: Path, lines: list[str], whole: dict[str, np.ndarray], line: str, says: str
) -> None:
    """What the line had is computed anew, to the same digits."""
    path = tmp_path / "store.jsonl"
    path.write_bytes("\n".join([*lines[:2], line, lines[3], ""]).encode("latin-1"))
    before = path.read_bytes()
    with pytest.raises(sw.ParameterError, match=r"store\.jsonl' is damaged in line 3: .*Delete this line") as caught:
        swept(path)
    assert says in str(caught.value)
    assert path.read_bytes() == before
    path.write_text("\n".join([*lines[:2], lines[3], ""]))
    resumed = swept(path)
    for name, values in whole.items():
        np.testing.assert_array_equal(resumed.measures[name], values)


@pytest.mark.parametrize("text", ["[1]\n", "5\n", "null\n", "{}\n", "remarks, without an end of line", '{"format": 1}'])
def test_what_is_no_file_of_a_sweep_is_refused_and_stays_as_it_is(tmp_path: Path, text: str) -> None:
    path = tmp_path / "other.txt"
    path.write_text(text)
    with pytest.raises(sw.ParameterError, match=r"other\.txt' (is no file of a sweep: line 1|holds another sweep)"):
        swept(path)
    assert path.read_text() == text


@pytest.mark.parametrize(("version", "told"), [("0.0.9", "version 0.0.9"), (None, "an earlier version")])
def test_a_store_of_another_version_is_refused_and_stays_as_it_is(
    tmp_path: Path, lines: list[str], version: str | None, told: str
) -> None:
    title = json.loads(lines[0])
    assert title.pop("version") == sw.__version__
    path = tmp_path / "store.jsonl"
    path.write_text("\n".join([json.dumps(title | ({"version": version} if version else {})), *lines[1:], ""]))
    before = path.read_bytes()
    with pytest.raises(sw.ParameterError, match=f"begun by {told} of Shaftwork, and this is {sw.__version__}"):
        swept(path)
    assert path.read_bytes() == before


def test_a_heading_that_was_cut_off_is_written_anew(tmp_path: Path, lines: list[str]) -> None:
    path = tmp_path / "store.jsonl"
    path.write_text(lines[0][:30])
    swept(path)
    assert path.read_text().splitlines() == lines


def test_variants_that_two_calls_have_both_stored_count_once(tmp_path: Path) -> None:
    pytest.importorskip("heyoka")
    net = sw.Network("swing")
    net.add(sw.TorqueSource("motor", tau=5.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Spring("shaft", c=700.0, d=1.0), "a", "ground")
    damping = np.linspace(1.0, 2.0, 16)
    damping[3] = 0.0  # has other equations

    def resumed() -> sw.studies.Sweep:
        return sw.studies.sweep(net, samples={"shaft.d": damping}, t_end=0.1, measures=["end J.omega"], store=path)

    path = tmp_path / "store.jsonl"
    whole = resumed()
    title, *chunks = path.read_text().splitlines()
    path.write_text("\n".join([title, *chunks, *chunks, ""]))
    again = resumed()
    assert again.why == whole.why
    assert again.why.startswith("1 of 16 variants ran one by one")
    np.testing.assert_array_equal(again.measures["end J.omega"], whole.measures["end J.omega"])
