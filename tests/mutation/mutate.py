"""How good are the tests? Put small faults into the source, one at a time, and see whether a test fails.

    python -m tests.mutation.mutate --count 300 --seed 1 --out build/mutation

The faults: a comparison that takes or leaves its edge (< to <=, == to !=), a sign (+ to -, unary minus dropped), a
number times 1.01 (an integer plus 1), a bound of a slice or an index shifted by one, `and` for `or`, True for False, a
statement left out (a call, a raise, an assignment to what exists without it). They fall on lines drawn by `--seed`, on
each package by its number of lines but on none fewer than `--least`; on what is executed only, not on annotations,
decorators, docstrings, f-strings and the texts of errors.

First, one run of the default tests finds which of them reach which line, and how long each takes (`reach.py`). Then
each fault is put into a copy of the repository, and the tests that reach its line run there until one fails: one case
of each test function first, those that reach the most lines of its file per second first, as many as take `--seconds`
together. A fault that makes them take more than `CPU_LIMIT` seconds of processor time is killed by that, as they take
far less without it. Each result is a line of `results.jsonl`; a second call goes on where the first stopped. Remove the
folder to start anew.

A survivor is to be read: either it changes nothing that the library promises, or a test is missing, or the code is
dead. Needs pytest-cov. Not part of the test run; 300 faults take one to two hours on one core.
"""

from __future__ import annotations

import argparse
import compileall
import importlib
import json
import os
import random
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from py_compile import PycInvalidationMode

import pytest

from tests.mutation.candidates import Candidate, candidates
from tests.mutation.reach import Reach, measure

ROOT = Path(__file__).parents[2]
PACKAGE = Path("src", "shaftwork")
CPU_LIMIT = (
    40  # seconds, for tests that take 20 without the fault under the coverage tool, unless `--seconds` says more
)
FIXED = 0.1  # seconds that a test takes whatever it does
MEMORY_LIMIT = 8 * 2**30
LOADED_ONCE = ("numpy", "scipy.linalg", "scipy.integrate", "scipy.optimize", "sympy", "networkx", "mpmath")


@dataclass(frozen=True)
class Mutant:
    """A fault in a file, as the results name it."""

    file: str
    line: int
    kind: str
    old: str
    new: str
    start: int

    @property
    def package(self) -> str:
        """The folder under src/shaftwork that the file is in."""
        return Path(self.file).relative_to(PACKAGE).parts[0]


def draw(tree: Path, count: int, seed: int, least: int) -> tuple[Mutant, ...]:
    """`count` faults on as many lines, the same for the same source and seed."""
    by_package: dict[str, list[Mutant]] = defaultdict(list)
    for file in sorted((tree / PACKAGE).rglob("*.py")):
        source = file.read_bytes()
        for candidate in candidates(source):
            mutant = _mutant(file.relative_to(tree), source, candidate)
            by_package[mutant.package].append(mutant)
    lines = {package: len({(one.file, one.line) for one in mutants}) for package, mutants in by_package.items()}
    dice = random.Random(seed)  # noqa: S311 - no secret
    drawn = [
        mutant
        for package, mutants in sorted(by_package.items())
        for mutant in _draw_lines(
            dice, mutants, min(lines[package], max(least, round(count * lines[package] / sum(lines.values()))))
        )
    ]
    dice.shuffle(drawn)  # a campaign that is cut short has still seen every package
    return tuple(drawn)


def faulty(source: bytes, mutant: Mutant) -> bytes:
    """The file with the fault."""
    return source[: mutant.start] + mutant.new.encode() + source[mutant.start + len(mutant.old.encode()) :]


def _mutant(file: Path, source: bytes, candidate: Candidate) -> Mutant:
    old = source[candidate.start : candidate.end].decode()
    return Mutant(str(file), candidate.line, candidate.kind, old, candidate.text, candidate.start)


def _draw_lines(dice: random.Random, mutants: Iterable[Mutant], count: int) -> Iterator[Mutant]:
    """One fault on each of `count` lines, of a kind drawn from those that the line can have."""
    by_line: dict[tuple[str, int], list[Mutant]] = defaultdict(list)
    for mutant in mutants:
        by_line[mutant.file, mutant.line].append(mutant)
    for on_line in dice.sample(list(by_line.values()), count):
        kind = dice.choice(sorted({mutant.kind for mutant in on_line}))
        yield dice.choice([mutant for mutant in on_line if mutant.kind == kind])


def ordered(tests: Iterable[str], reach: Reach, file: Path, seconds: float) -> list[str]:
    """The tests to run, the most promising first, as many as take `seconds` together, and one at least."""
    lines = reach.lines_in(file)
    cases: Counter[str] = Counter()
    ranked = []
    for test in sorted(tests, key=lambda test: (-lines[test] / (reach.durations[test] + FIXED), test)):
        function = test.split("[", maxsplit=1)[0]
        ranked.append((cases[function], len(ranked), test))
        cases[function] += 1
    chosen: list[str] = []
    for *_, test in sorted(ranked):
        if not chosen or reach.durations[test] <= seconds:
            chosen.append(test)
            seconds -= reach.durations[test]
    return chosen


def verdict(tree: Path, tests: list[str], cpu_limit: float) -> dict[str, object]:
    """Run tests in a child process, which has what `LOADED_ONCE` names in memory already."""
    began = time.monotonic()
    report = tree / "first-failure.txt"
    report.unlink(missing_ok=True)
    child = os.fork()
    if child == 0:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)
        os.setsid()
        _run_and_leave(tree, tests, report, int(cpu_limit))
    status = _status(child, wall_limit=10 * cpu_limit)
    failure = report.read_text(encoding="utf-8") if report.exists() else ""
    log = (tree / "child.log").read_text(encoding="utf-8", errors="replace")
    if status == "killed" and not failure:
        if "ERROR: not found" in log and (whole := [*dict.fromkeys(name.split("[")[0] for name in tests)]) != tests:
            return verdict(tree, whole, cpu_limit)  # the fault has changed the name of a case
        if "while loading conftest" not in log:
            msg = f"pytest ended without a failed test: {log}"
            raise RuntimeError(msg)
        failure = "(import)"
    return {"status": status, "seconds": round(time.monotonic() - began, 1), "failure": failure}


def _status(child: int, wall_limit: float) -> str:
    end = time.monotonic() + wall_limit
    while time.monotonic() < end:
        process, state = os.waitpid(child, os.WNOHANG)
        if process:
            code = os.waitstatus_to_exitcode(state)
            if code in {-signal.SIGXCPU, -signal.SIGKILL}:
                return "timeout"
            return "killed" if code else "survived"
        time.sleep(0.05)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return "timeout"


class _FirstFailure:
    """A pytest plugin that keeps the name of what failed."""

    def __init__(self, report: Path) -> None:
        self.report = report

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self.report.write_text(report.nodeid, encoding="utf-8")

    def pytest_collectreport(self, report: pytest.CollectReport) -> None:
        if report.failed:
            self.report.write_text(f"{report.nodeid} (import)", encoding="utf-8")


def _run_and_leave(tree: Path, tests: list[str], report: Path, cpu_limit: int) -> None:
    silence = os.open(tree / "child.log", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(silence, 1)
    os.dup2(silence, 2)
    resource.setrlimit(resource.RLIMIT_CPU, (cpu_limit, cpu_limit + 5))
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_LIMIT, MEMORY_LIMIT))
    os.chdir(tree)
    for name in [name for name in sys.modules if name.split(".")[0] == "tests"]:
        del sys.modules[name]
    sys.path[:] = [str(tree), str(tree / "src"), *(place for place in sys.path if place not in {"", str(ROOT)})]
    os.environ["PYTHONPATH"] = f"{tree / 'src'}{os.pathsep}{tree}"
    options = ["-x", "-q", "-n", "0", "-p", "no:cacheprovider", "--no-header"]
    code = 1
    try:
        code = int(pytest.main([*options, *tests], plugins=[_FirstFailure(report)]))
    finally:
        sys.stdout.flush()
        os._exit(code)


def copied(to: Path) -> Path:
    """A copy of what git tracks or would track, whose compiled files are known by their content, not their age."""
    listed = ("git", "ls-files", "--cached", "--others", "--exclude-standard")
    for name in subprocess.run(listed, cwd=ROOT, check=True, capture_output=True, text=True).stdout.splitlines():
        if (ROOT / name).is_file():
            (to / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(ROOT / name, to / name)
    compileall.compile_dir(to / "src", quiet=1, force=True, invalidation_mode=PycInvalidationMode.CHECKED_HASH)
    return to


def tried(tree: Path, mutant: Mutant, reach: Reach, seconds: float) -> dict[str, object]:
    """Put the fault in, run the tests that reach it, take it out."""
    file = tree / mutant.file
    source = file.read_bytes()
    broken = faulty(source, mutant)
    try:
        compile(broken, mutant.file, "exec")
    except SyntaxError:
        return {"status": "invalid"}
    reaching = reach.tests(file, mutant.line)
    if not reaching:
        return {"status": "survived", "tests": 0, "of": 0}
    tests = ordered(reaching, reach, file, seconds)
    file.write_bytes(broken)
    try:
        result = verdict(tree, tests, max(CPU_LIMIT, 2 * seconds))
    finally:
        file.write_bytes(source)
    return {**result, "tests": len(tests), "of": len(reaching)}


def table(results: Iterable[dict[str, object]]) -> str:
    """What became of the faults, by package."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for result in results:
        for package in (Path(str(result["file"])).relative_to(PACKAGE).parts[0], "all"):
            counts[package][str(result["status"])] += 1
    states = ("killed", "timeout", "survived", "invalid")
    rows = [f"{'':12}" + "".join(f"{state:>10}" for state in states)]
    rows += [
        f"{package:12}" + "".join(f"{counted[state]:>10}" for state in states)
        for package, counted in sorted(counts.items(), key=lambda item: (item[0] == "all", item[0]))
    ]
    return "\n".join(rows)


def main() -> None:
    parser = argparse.ArgumentParser(description="Mutation testing of src/shaftwork.")
    parser.add_argument("--count", type=int, default=300, help="how many faults")
    parser.add_argument("--seed", type=int, default=1, help="which faults")
    parser.add_argument("--least", type=int, default=10, help="the fewest faults on a package")
    parser.add_argument("--seconds", type=float, default=20.0, help="of tests per fault")
    parser.add_argument("--processes", type=int, default=2, help="for the run that finds what reaches which line")
    parser.add_argument("--out", type=Path, default=ROOT / "build" / "mutation", help="folder of the results")
    arguments = parser.parse_args()
    os.environ.setdefault("SHAFTWORK_EXAMPLES", "5")  # of each property
    out = arguments.out.resolve()
    out.mkdir(parents=True, exist_ok=True)
    if not (out / "durations.json").exists():
        measure(copied(out / "tree"), out, arguments.processes)
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # as Ctrl-C does: the fault is taken out
    for library in LOADED_ONCE:
        importlib.import_module(library)
    results = out / "results.jsonl"
    lines = results.read_text(encoding="utf-8").splitlines() if results.exists() else []
    finished = [json.loads(line) for line in lines]
    names = {(result["file"], result["start"], result["new"]) for result in finished}
    reach = Reach(out / "tree", out)
    for mutant in draw(out / "tree", arguments.count, arguments.seed, arguments.least):
        if (mutant.file, mutant.start, mutant.new) not in names:
            finished.append({**asdict(mutant), **tried(out / "tree", mutant, reach, arguments.seconds)})
            with results.open("a", encoding="utf-8") as file:
                file.write(json.dumps(finished[-1]) + "\n")
    for one in (one for one in finished if one["status"] == "survived"):
        print(f"{one['file']}:{one['line']} {one['old']} -> {one['new']}  ({one['tests']} of {one['of']} tests)")  # noqa: T201
    print(table(finished))  # noqa: T201


if __name__ == "__main__":
    main()
