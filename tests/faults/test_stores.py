"""What is written stays: whoever is killed, however full the disk, whoever else writes, whichever byte has changed."""

from __future__ import annotations

import json
import os
import resource
import subprocess
import sys
import threading
import warnings
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from random import Random

import pytest

import shaftwork as sw
from shaftwork.cli import DONE, INTERRUPTED, WRONG_INPUT, main
from shaftwork.core.files import replaced
from tests.faults.killed import VARIANTS

ROOT = Path(__file__).parents[2]


@contextmanager
def room(size: int) -> Iterator[None]:
    """No file grows beyond a size in bytes, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def swing() -> sw.Network:
    net = sw.Network("swing")
    net.add(sw.TorqueSource("motor", tau=5.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Spring("shaft", c=700.0), "a", "ground")
    return net


def swept(store: Path | None, **measures: object) -> sw.studies.Sweep:
    """Three chunks of variants that run one by one."""
    return sw.studies.sweep(
        swing(),
        {"shaft.c": [500.0 + 10 * k for k in range(20)]},
        t_end=0.05,
        measures=measures or {"peak": "max shaft.tau"},
        engine="exact",
        processes=1,
        store=store,
    )


@pytest.mark.slow
def test_a_sweep_that_is_killed_again_and_again_loses_nothing_and_does_nothing_twice(tmp_path: Path) -> None:
    one_thread = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    command = [sys.executable, "-m", "tests.faults.killed", str(tmp_path / "store.sqlite")]
    done = subprocess.run(command, cwd=ROOT, env=os.environ | one_thread, capture_output=True, text=True, check=True)
    made = json.loads(done.stdout)
    assert made["same"]
    assert made["seen"] == sorted(made["seen"])
    assert len(set(made["seen"])) > 2, "killed always at the same moment"
    assert made["stored"] == list(range(VARIANTS))
    assert made["failed"] == 0


def test_a_store_in_which_a_byte_has_changed_is_named_or_right(tmp_path: Path) -> None:
    path, random = tmp_path / "store.sqlite", Random(2)  # noqa: S311
    whole = swept(path).measures["peak"].tobytes()
    raw = path.read_bytes()
    named = 0
    for _ in range(60):
        place, bit = random.randrange(len(raw)), 1 << random.randrange(8)
        path.write_bytes(raw[:place] + bytes([raw[place] ^ bit]) + raw[place + 1 :])
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            try:
                assert swept(path).measures["peak"].tobytes() == whole
            except sw.ParameterError as error:
                named += str(error).startswith(f"store = '{path}' ")
        named += len(said)
    assert named  # most of the pages of a small database are empty


@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_a_store_that_was_cut_is_named(tmp_path: Path, share: float) -> None:
    path = tmp_path / "store.sqlite"
    swept(path)
    raw = path.read_bytes()
    path.write_bytes(raw[: int(share * len(raw))])
    with pytest.raises(
        sw.ParameterError, match=r"store\.sqlite' (is damaged: .*Delete the file|is no file of a sweep)"
    ):
        swept(path)


@pytest.mark.slow
@pytest.mark.parametrize("size", [0, 100, 9_000, 14_000])
def test_a_full_disk_ends_a_sweep_with_one_error_and_keeps_what_is_stored(tmp_path: Path, size: int) -> None:
    path = tmp_path / "store.sqlite"
    with room(size), pytest.raises(sw.ParameterError, match=r"store\.sqlite' (cannot be|is damaged)"):
        swept(path)
    if path.exists() and path.stat().st_size == 0:
        path.unlink()
    assert swept(path).measures["peak"].tobytes() == swept(None).measures["peak"].tobytes()


def test_a_second_sweep_on_a_store_is_refused_and_the_first_goes_on(tmp_path: Path) -> None:
    path, begun, over = tmp_path / "store.sqlite", threading.Event(), threading.Event()

    def peak(solution: sw.Solution) -> float:
        begun.set()
        over.wait(60.0)
        return float(solution.max("shaft.tau"))

    made: list[sw.studies.Sweep] = []
    first = threading.Thread(target=lambda: made.append(swept(path, peak=peak)))
    first.start()
    try:
        assert begun.wait(60.0)
        with pytest.raises(sw.ParameterError, match="is in use by another sweep"):
            swept(path, peak=peak)
    finally:
        over.set()
        first.join()
    assert made[0].measures["peak"].tobytes() == swept(path, peak=peak).measures["peak"].tobytes()


def test_a_folder_that_may_not_be_written_to_is_named(tmp_path: Path) -> None:
    (tmp_path / "shared").mkdir(mode=0o500)
    path = (
        Path("/proc/store.sqlite") if os.access(tmp_path / "shared", os.W_OK) else tmp_path / "shared" / "store.sqlite"
    )
    with pytest.raises(sw.ParameterError, match=r"store\.sqlite' cannot be used: .*that exists and may be written to"):
        swept(path)


def test_what_is_no_file_is_no_store(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for place in (tmp_path / "pipe", tmp_path, Path("/dev/null")):
        with pytest.raises(sw.ParameterError, match="cannot be used: it is no file"):
            swept(place)


def test_a_network_that_cannot_be_saved_leaves_the_older_file(tmp_path: Path) -> None:
    path = tmp_path / "net.toml"
    swing().save(path)
    before = path.read_bytes()
    with room(50), pytest.raises(sw.ModelFileError, match=r"net\.toml cannot be written: .*File too large"):
        swing().save(path)
    assert [made.name for made in tmp_path.iterdir()] == ["net.toml"]
    assert path.read_bytes() == before


@pytest.mark.slow
def test_threads_that_save_to_one_file_leave_a_whole_one(tmp_path: Path) -> None:
    """A network of 40 springs and one of 80 take turns; whoever comes last has written it all."""
    networks = []
    for count in (40, 80):
        net = sw.Network(f"{count} springs")
        for k in range(count):
            net.add(sw.Inertia(f"J{k}", J=1.0), f"n{k}")
            net.add(sw.Spring(f"s{k}", c=1e3), f"n{k}", f"n{k + 1}")
        networks.append(net)

    whole = [net.netlist() for net in networks]

    def save(net: sw.Network) -> None:
        for _ in range(10):
            net.save(tmp_path / "net.toml")
            assert sw.Network.load(tmp_path / "net.toml").netlist() in whole

    with ThreadPoolExecutor(4) as pool:
        list(pool.map(save, networks * 2))
    assert [path.name for path in tmp_path.iterdir()] == ["net.toml"]


def test_a_network_is_saved_through_a_link_and_keeps_the_rights_of_its_file(tmp_path: Path) -> None:
    (tmp_path / "far").mkdir()
    far, link = tmp_path / "far" / "net.toml", tmp_path / "link.toml"
    far.write_text("old")
    far.chmod(0o640)
    link.symlink_to(far)
    swing().save(link)
    assert link.is_symlink()
    assert sw.Network.load(far).netlist() == swing().netlist()
    assert far.stat().st_mode & 0o777 == 0o640


RUN = ("--t-end", "0.1", "--engine", "exact", "--out")


def test_a_full_disk_ends_a_run_with_one_line_and_keeps_the_older_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    swing().save(tmp_path / "net.toml")
    out = tmp_path / "out"
    assert main(["run", str(tmp_path / "net.toml"), *RUN, str(out)]) == DONE
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    capsys.readouterr()
    with room(200):
        assert main(["run", str(tmp_path / "net.toml"), *RUN, str(out)]) == WRONG_INPUT
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert said[0].startswith(f"shaftwork: --out {out} cannot be written: ")
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before


@pytest.mark.slow
@pytest.mark.parametrize("moment", range(8))
def test_a_run_that_ends_while_it_puts_its_files_in_place_is_followed_by_a_whole_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, moment: int
) -> None:
    """The older run has files that the next has not; whichever file was the last, the next run knows them all."""
    rubbing, out = swing(), tmp_path / "out"
    rubbing.add(sw.CoulombLoad("load", tau=0.1), "a")
    for net, name in ((rubbing, "rubbing"), (swing(), "swing")):
        net.save(tmp_path / f"{name}.toml")
    assert main(["run", str(tmp_path / "rubbing.toml"), "--t-end", "0.1", "--out", str(out)]) == DONE
    calls = iter(range(100))

    def stopped(method: object) -> object:
        def call(self: Path, *values: object, **options: object) -> object:
            if str(self).startswith(str(out)) and next(calls) == moment:
                raise KeyboardInterrupt
            return method(self, *values, **options)  # type: ignore[operator]

        return call

    with monkeypatch.context() as patch:
        patch.setattr(Path, "replace", stopped(Path.replace))
        patch.setattr(Path, "unlink", stopped(Path.unlink))
        code = main(["run", str(tmp_path / "swing.toml"), *RUN, str(out)])
    assert code in (DONE, INTERRUPTED)
    assert main(["run", str(tmp_path / "swing.toml"), *RUN, str(out)]) == DONE
    shown = {path.name for path in out.iterdir() if not path.name.startswith(".")}
    assert shown == {"signals.csv", "signals.png", "shaftwork.json"}


def test_an_error_while_a_file_is_written_names_the_users_path(tmp_path: Path) -> None:
    """Not that of the draft that takes its place in the end."""
    path = tmp_path / "table.csv"

    def write() -> None:
        with replaced(path) as file:
            file.write("half")
            Path(file.name).unlink()  # as a full disk or a colleague might

    with pytest.raises(FileNotFoundError) as failed:
        write()
    assert failed.value.filename == str(path)
    assert list(tmp_path.iterdir()) == []
