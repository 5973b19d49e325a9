"""Motions come back from files to the last bit; what a file does not hold is read from the motion made again."""

from __future__ import annotations

import random
import sys
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray
from hypothesis import given, settings
from hypothesis import strategies as st

import shaftwork as sw
from shaftwork.motionfiles.loading import solution_of
from shaftwork.motionfiles.record import record_text
from shaftwork.scenes import SCENES
from tests.mangling import mangled
from tests.pipeline.test_stored import LONG, train
from tests.strategies import networks

ENDS = (".nc", ".h5", ".parquet")


@cache
def motion(kind: str) -> sw.Solution:
    match kind:
        case "linear":
            return train().simulate(
                0.2, t_eval=50, engine="scipy", parameters={"shaft.c": 2e4}, initial={"J1.omega": 3.0}
            )
        case "steps":
            return train().simulate(0.2, t_eval="steps", engine="scipy", rtol=1e-6)
        case "angles":
            return train().simulate(0.2, angles=["J2"], t_eval=20, engine="scipy")
        case "hybrid":
            return sw.scenes.crane(gap=0.01).simulate(0.5, t_eval=60, engine="scipy")
        case "chain":
            return train(sw.Shaft("shaft", **LONG, model=sw.Lumped(5))).simulate(0.01, t_eval=20, engine="scipy")
        case "wave":
            return train(sw.Shaft("shaft", **LONG, model=sw.Wave())).simulate(0.03, t_eval=50)
    net = sw.scenes.crane(gap=0.01)
    return net.simulate(0.6, initial=net.simulate(0.3, engine="scipy"), t_eval=40, engine="scipy")


KINDS = ("linear", "steps", "angles", "hybrid", "chain", "wave", "continued")


def same(first: Any, second: Any) -> bool:
    return bool(np.array_equal(first, second, equal_nan=True))


@pytest.mark.parametrize("end", [".nc", ".parquet"])
@pytest.mark.parametrize("kind", KINDS)
def test_a_motion_comes_back_to_the_last_bit(kind: str, end: str, tmp_path: Path) -> None:
    sol = motion(kind)
    sol.save(tmp_path / f"motion{end}")
    again = sw.load_solution(tmp_path / f"motion{end}")
    assert same(again.t, sol.t)
    assert same(again.x, sol.x)
    for name in ("name", "states", "engine", "why", "events", "phases", "rtol", "caveat"):
        assert getattr(again, name) == getattr(sol, name), name
    for name in ("parameters", "initial", "statistics"):
        assert dict(getattr(again, name)) == dict(getattr(sol, name)), name
    assert [name for name in (*sol, *sol.places) if not same(again[name], sol[name])] == []
    assert not {"dense", "observer"} & vars(again).keys()  # none of it was made again
    assert repr(again) == repr(sol)


@pytest.mark.parametrize("kind", KINDS)
def test_what_was_not_saved_is_read_from_the_motion_made_again(kind: str, tmp_path: Path) -> None:
    sol = motion(kind)
    torque = next(name for name in sol if name.endswith(("shaft.tau", "shaft.tau_a", "shaft.tau_b")) or ".tau" in name)
    sol.save(tmp_path / "motion.nc", torque)
    again = sw.load_solution(tmp_path / "motion.nc")
    assert set(again.saved) <= {torque}
    assert [name for name in (*sol, *sol.places) if not same(again[name], sol[name])] == []
    between = np.linspace(sol.t[0], sol.t[-1], 7)[1:-1]
    assert same(again.at(between)[torque], sol.at(between)[torque])
    assert again.energy_residual == sol.energy_residual


def test_a_motion_from_a_file_can_be_saved_again_and_continued(tmp_path: Path) -> None:
    sol = motion("continued")
    sol.save(tmp_path / "first.nc")
    sw.load_solution(tmp_path / "first.nc").save(tmp_path / "second.parquet")
    again = sw.load_solution(tmp_path / "second.parquet")
    assert same(again.x, sol.x)
    net = sw.scenes.crane(gap=0.01)
    run: Callable[[sw.Solution], sw.Solution] = lambda before: net.simulate(0.8, initial=before, engine="scipy")  # noqa: E731
    assert same(run(again).x, run(sol).x)


def test_other_tools_read_names_units_and_title(tmp_path: Path) -> None:
    sol = motion("linear")
    sol.save(tmp_path / "motion.nc")
    data = xarray.load_dataset(tmp_path / "motion.nc", engine="h5netcdf")
    assert data["shaft.tau"].attrs["units"] == "N*m"
    assert data["t"].attrs["units"] == "s"
    assert data.attrs["title"] == "train"
    pandas = pytest.importorskip("pandas")
    sol.save(tmp_path / "motion.parquet")
    table = pandas.read_parquet(tmp_path / "motion.parquet")
    assert table.attrs["units"]["J2.omega"] == "rad/s"
    assert same(table["J2.omega"].to_numpy(), sol["J2.omega"])


def test_names_with_slashes_and_other_signs_come_back(tmp_path: Path) -> None:
    net = sw.Network("a/b")
    net.add(sw.TorqueSource("m/1", tau=1.0), "n")
    net.add(sw.Inertia("räd at 3 m", J=2.0), "n")
    sol = net.simulate(0.1, t_eval=5, engine="scipy")
    for end in ENDS:
        sol.save(tmp_path / f"m{end}")
        again = sw.load_solution(tmp_path / f"m{end}")
        assert [name for name in sol if not same(again[name], sol[name])] == []


def test_a_motion_that_went_on_with_waves_holds_what_was_saved_alone(tmp_path: Path) -> None:
    net = train(sw.Shaft("shaft", **LONG, model=sw.Wave()))
    sol = net.simulate(0.02, initial=net.simulate(0.01), t_eval=9)
    sol.save(tmp_path / "wave.nc", "J2.omega", "shaft.tau_a")
    again = sw.load_solution(tmp_path / "wave.nc")
    assert same(again["shaft.tau_a"], sol["shaft.tau_a"])
    with pytest.raises(sw.SignalError, match=r"holds the quantities that were saved alone: it went on .* waves"):
        again["shaft.tau_b"]
    with pytest.raises(sw.SignalError, match="Save those that are wanted when the motion is made"):
        again.save(tmp_path / "again.nc", "J2.omega")


@pytest.mark.slow
@settings(max_examples=8)
@given(networks(max_inertias=4), st.sampled_from(ENDS))
def test_motions_of_random_networks_come_back(
    tmp_path_factory: pytest.TempPathFactory, pieces: tuple[Any, ...], end: str
) -> None:
    net = sw.Network("random")
    for piece in pieces:
        net.add(getattr(sw, piece.type)(piece.name, **piece.values), *piece.nodes)
    with suppress(sw.NetworkError):
        sol = net.simulate(0.1, t_eval=7, engine="scipy")
        path = tmp_path_factory.mktemp("motions") / f"motion{end}"
        sol.save(path)
        again = sw.load_solution(path)
        assert same(again.x, sol.x)
        assert [name for name in sol if not same(again[name], sol[name])] == []


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::shaftwork.NetworkWarning", "ignore::shaftwork.AccuracyWarning")
@pytest.mark.parametrize("scene", ["crane", "six-phases", "excavator", "shaft-chain"])
def test_motions_of_scenes_come_back(scene: str, tmp_path: Path) -> None:
    sol = SCENES[scene]().simulate(0.02, t_eval=11)
    for end in (".nc", ".parquet"):
        sol.save(tmp_path / f"motion{end}")
        again = sw.load_solution(tmp_path / f"motion{end}")
        assert [name for name in (*sol, *sol.places) if not same(again[name], sol[name])] == []
        assert again.phases == sol.phases


@pytest.mark.parametrize("name", ["motion.csv", "motion", "motion.nc.gz"])
def test_another_end_of_the_name_is_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(sw.ParameterError, match=r"no end that is known\. Take one of: \.nc, \.h5, \.hdf5, \.parquet"):
        motion("linear").save(tmp_path / name)
    with pytest.raises(sw.ParameterError, match="Take one of"):
        sw.load_solution(tmp_path / name)


def test_wrong_places_and_quantities_are_named(tmp_path: Path) -> None:
    sol = motion("linear")
    with pytest.raises(sw.ParameterError, match="There is no folder"):
        sol.save(tmp_path / "none" / "m.nc")
    with pytest.raises(sw.ModelFileError, match="There is no file"):
        sw.load_solution(tmp_path / "m.nc")
    with pytest.raises(sw.ParameterError, match="must be the name of a file"):
        sw.load_solution(3)  # type: ignore[arg-type]
    with pytest.raises(sw.ParameterError, match=r"\[\] is no name"):
        sol.save(tmp_path / "m.nc", [])  # type: ignore[arg-type]
    with pytest.raises(sw.SignalError, match=r"shaft\.tua"):
        sol.save(tmp_path / "m.nc", "shaft.tua")
    (tmp_path / "taken.nc").mkdir()
    with pytest.raises(sw.ModelFileError, match="cannot be written"):
        sol.save(tmp_path / "taken.nc")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["taken.nc"]


@pytest.mark.parametrize("library", ["h5netcdf", "pyarrow"])
def test_a_missing_library_is_named_with_its_extra(
    library: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    end = {"h5netcdf": ".nc", "pyarrow": ".parquet"}[library]
    motion("linear").save(tmp_path / f"m{end}")
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(sw.MissingExtraError, match=rf"{library}.*shaftwork\[files\]"):
        motion("linear").save(tmp_path / f"other{end}")
    with pytest.raises(sw.MissingExtraError, match=rf"{library}.*shaftwork\[files\]"):
        sw.load_solution(tmp_path / f"m{end}")


def test_newer_files_and_other_files_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "m.nc"
    xarray.Dataset({"a": ("t", [1.0])}, coords={"t": [0.0]}).to_netcdf(path, engine="h5netcdf")
    with pytest.raises(sw.ModelFileError, match=r"m\.nc cannot be read"):
        sw.load_solution(path)
    motion("linear").save(path)
    data = xarray.load_dataset(path, engine="h5netcdf")
    said = str(data["shaftwork"].item())
    for text, words in (
        (said.replace('"format": 1', '"format": 2', 1), r"format is 2, and this version reads 1\. Update"),
        (said.replace("[[part]]", "[[prat]]"), r"m\.nc: .*prat"),
        (said.replace('"call"', '"clal"'), r"no motion that was saved: KeyError\('call'\)"),
        ("{}", "no motion that was saved"),
        ("[]", "no motion that was saved"),
    ):
        data["shaftwork"] = ((), text)
        data.to_netcdf(path, engine="h5netcdf")
        with pytest.raises(sw.ModelFileError, match=words):
            sw.load_solution(path)


@pytest.mark.slow
def test_damaged_files_are_read_or_refused(tmp_path: Path) -> None:
    chance, path = random.Random(5), tmp_path / "m.parquet"  # noqa: S311
    motion("linear").save(path, "shaft.tau")
    whole = path.read_bytes()
    for _ in range(300):
        content = bytearray(whole)
        for _ in range(chance.randint(1, 20)):
            content[chance.randrange(len(content))] = chance.randrange(256)
        path.write_bytes(bytes(content[: chance.choice((len(content), chance.randrange(len(content))))]))
        with suppress(sw.ModelFileError):
            sw.load_solution(path)


@pytest.mark.slow
@pytest.mark.filterwarnings(
    "ignore::shaftwork.NetworkWarning"
)  # a value that was changed may be one that a part warns of
def test_what_a_file_says_is_read_or_refused_however_it_is_changed() -> None:
    sol, chance = motion("hybrid"), random.Random(6)  # noqa: S311
    said = record_text(sol, sol.again)
    columns = {name: sol[name] for name in sol.states}
    for _ in range(700):
        with suppress(sw.ModelFileError):
            solution_of(mangled(said, chance, '{}[]":,.0123456789-eEnul\\'), sol.t, columns, ())


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("end", [".nc", ".parquet"])
def test_flipped_bits_are_refused_or_change_no_number(tmp_path: Path, end: str) -> None:
    """Sums stand beside all quantities: a fault of the disk is never another motion (h5netcdf warns as it closes)."""
    sol, path, refused = motion("linear"), tmp_path / f"motion{end}", 0
    sol.save(path, "shaft.tau", "J1.energy")
    data, places = path.read_bytes(), random.Random(1)  # noqa: S311 (repeatable)
    for _ in range(20):
        damaged = bytearray(data)
        for _ in range(3):
            damaged[places.randrange(len(data))] ^= 1 << places.randrange(8)
        path.write_bytes(damaged)
        try:
            again = sw.load_solution(path)
        except sw.ModelFileError:
            refused += 1
        else:
            assert all((again[name] == sol[name]).all() for name in ("shaft.tau", "J1.energy", "J1.omega"))
    assert refused > 5  # a flip of what no sum stands beside, as a free place, may change nothing
