"""Cases from `mutations`, each within limits of time and memory; prints what is no success and no named error.

    python -m tests.faults.fuzz files|laws|commands FIRST COUNT

In a process of its own, since a limit of memory is for good and a crash ends it.
"""

from __future__ import annotations

import contextlib
import gc
import io
import os
import resource
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from random import Random
from types import FrameType

import shaftwork as sw
from shaftwork.cli import DONE, FAILED, WRONG_INPUT, main
from shaftwork.modelfiles.storage import write
from shaftwork.network.expressions import parse
from tests.faults.mutations import command_line, extreme_file, law, model_file

SECONDS, AT_WORK = 2.0, 20.0
"""Of processor time for each case; for one that computes, as a search for a steady state does."""
MEMORY = 2**30
"""Bytes for each case beside those of the libraries."""
LARGE = 200
"""States from which on a model is compiled and not simulated."""


class OverrunError(BaseException):
    """Still at work after twice its time; no `except Exception` takes it."""


def load_and_run(random: Random, folder: Path) -> str:
    text = model_file(random)
    path = folder / "model.toml"
    path.write_text(text, "utf-8", "surrogatepass")
    made: list[sw.Model] = []
    with _judged(text) as verdict:
        made.append(sw.Network.load(path).compile())
    return verdict[0] or _run(random, made, text)


def _run(random: Random, made: list[sw.Model], text: str) -> str:
    """The fault of a short run of what was compiled."""
    with _judged(text, AT_WORK) as verdict:
        if made and random.random() < 0.3 and len(made[0].states) < LARGE:
            made[0].simulate(1e-3, max_steps=1000)
    return verdict[0]


ENGINES = ("auto", "scipy", "scipy-radau", "heyoka", "sundials", "exact", "banded")


def study(random: Random, folder: Path) -> str:
    text = extreme_file(random)
    path = folder / "model.toml"
    path.write_text(text, "utf-8")
    what = random.randrange(8)
    with _judged(f"study {what}\n{text}", AT_WORK) as verdict:
        net = sw.Network.load(path)
        match what:
            case 0:
                net.modes(count=3)
            case 1:
                net.campbell([0.0, 10.0, 100.0], count=3, f_max=1e3)
            case 2:
                net.compile().steady_state()
            case 3:
                net.check()
                net.equations().latex()
            case 4:
                net.modes(count=3, exact=True)
            case _:
                solution = net.compile().simulate(1e-2, max_steps=300, engine=random.choice(ENGINES))
                assert solution.energy_residual is not None
                solution.max(solution.states[0] if solution.states else solution.names[0])
    return verdict[0]


def read_law(random: Random, _: Path) -> str:
    text, made = law(random), list[sw.Model]()
    with _judged(text) as verdict:
        read = parse(text)
        if parse(write(read)) != read:
            verdict[0] = f"reads back otherwise: {text}"
        if random.random() < 0.5:
            net = sw.Network("one mass")
            net.add(sw.TorqueSource("motor", tau=read), "a")
            net.add(sw.Inertia("J", J=1.0), "a")
            made.append(net.compile())
    return verdict[0] or _run(random, made, text)


def command(random: Random, folder: Path) -> str:
    words = command_line(random, folder)
    out, err = io.StringIO(), io.StringIO()
    with _judged(repr(words), AT_WORK) as verdict, contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            code = main(words)
        except SystemExit as end:  # argparse
            code = int(end.code or 0)
        said = err.getvalue()
        if code not in (DONE, FAILED, WRONG_INPUT) or "Traceback" in said or "' failed with " in said:
            verdict[0] = f"{code}: {said}\n{words!r}\n{_model_of(words)}"
        elif code != DONE and "shaftwork" not in said:
            verdict[0] = f"{code} without a message: {said!r}\n{words!r}"
    return verdict[0]


def _model_of(words: list[str]) -> str:
    return next((Path(word).read_text("utf-8") for word in words if Path(word).name == "model.toml"), "")


@contextlib.contextmanager
def _judged(case: str, seconds: float = SECONDS) -> Iterator[list[str]]:
    """The fault of what runs inside, empty where there is none; a named error is none."""
    verdict = [""]
    began = time.process_time()
    signal.setitimer(signal.ITIMER_PROF, 2 * seconds, 0.5)
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            yield verdict
    except sw.ShaftworkError as error:
        if not str(error).strip():
            verdict[0] = f"{type(error).__name__} without a word"
    except (Exception, OverrunError) as error:  # noqa: BLE001 (that is the question)
        verdict[0] = f"{type(error).__name__}: {error}\n{''.join(traceback.format_exception(error)[-6:])}"
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    spent = time.process_time() - began
    if spent > seconds:
        verdict[0] = f"{spent:.1f} s of processor time\n{verdict[0]}"
    foreign = [one for one in caught if not issubclass(one.category, (sw.NetworkWarning, sw.AccuracyWarning))]
    if foreign and not verdict[0]:
        verdict[0] = (
            f"warns {foreign[0].category.__name__}: {foreign[0].message} ({foreign[0].filename}:{foreign[0].lineno})"
        )
    if verdict[0]:
        verdict[0] += f"\n{case}"


def _overrun(_number: int, _frame: FrameType | None) -> None:
    raise OverrunError


KINDS: dict[str, Callable[[Random, Path], str]] = {
    "files": load_and_run,
    "laws": read_law,
    "commands": command,
    "studies": study,
}


def faults(kind: str, first: int, count: int, before: Callable[[str], object] = lambda _: None) -> Iterator[str]:
    """What is wrong, case by case.

    Args:
        kind: one of `KINDS`.
        first: number of the first case.
        count: how many.
        before: called before each case with its name.
    """
    _load_libraries()
    usual = signal.signal(signal.SIGPROF, _overrun)
    try:
        with tempfile.TemporaryDirectory() as folder:
            for case in (f"{kind} {number}" for number in range(first, first + count)):
                before(case)
                if fault := KINDS[kind](Random(case), Path(folder)):  # noqa: S311
                    yield f"{case}: {fault}"
    finally:
        signal.signal(signal.SIGPROF, usual)


def _in_little_room(case: str) -> None:
    gc.collect()  # what earlier cases have left would count as time of this one
    _limit_memory()
    os.write(2, f"\0{case}".encode())  # if it crashes


def _load_libraries() -> None:
    for engine in ("scipy", "heyoka", "sundials", "scipy-radau"):
        sw.scenes.crane_start().simulate(1e-2, engine=engine)
    with contextlib.redirect_stdout(io.StringIO()):
        main(["modes", "ship-line", "--set", "disc1.J=3 kg*m^2", "--exact"])


def _limit_memory() -> None:
    """Let addresses grow by `MEMORY` beyond those that libraries and earlier cases hold."""
    pages = int(Path("/proc/self/statm").read_text("ascii").split()[0])
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    resource.setrlimit(resource.RLIMIT_AS, (pages * os.sysconf("SC_PAGE_SIZE") + MEMORY, hard))


if __name__ == "__main__":
    _load_libraries()
    gc.disable()
    gc.freeze()
    for fault in faults(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]), _in_little_room):
        sys.stdout.write(f"{fault}\n\0\n")
