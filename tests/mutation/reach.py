"""Which tests reach a line of the source, and how long each test takes: one run of the tests with coverage contexts.

This module is also the pytest plugin of that run.
"""

from __future__ import annotations

import ast
import json
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from functools import cached_property
from pathlib import Path

import pytest
from coverage import CoverageData

DURATIONS = "MUTATION_DURATIONS"  # environment: the file that the plugin writes


def measure(tree: Path, results: Path, processes: int) -> None:
    """Run the default tests of `tree`; leave `lines.coverage` and `durations.json` in `results`."""
    settings = results / "coverage.ini"
    settings.write_text(f"[run]\nsource_pkgs = shaftwork\ndata_file = {results / 'lines.coverage'}\n")
    coverage = ("--cov", f"--cov-config={settings}", "--cov-context=test", "--cov-report=")
    plugins = ("-p", "tests.mutation.reach", "-p", "no:cacheprovider")
    command = (sys.executable, "-m", "pytest", "-q", "-n", str(processes), *plugins, *coverage)
    environment = {
        **os.environ,
        "PYTHONPATH": f"{tree / 'src'}{os.pathsep}{tree}",
        DURATIONS: str(results / "durations.json"),
    }
    subprocess.run((*command, "--ignore=tests/architecture"), cwd=tree, env=environment, check=True)


_durations: dict[str, float] = {}


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Random networks count here, too: `no_cover` is there to save time in the everyday run."""
    for item in items:
        item.own_markers = [marker for marker in item.own_markers if marker.name != "no_cover"]


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    _durations[report.nodeid] = _durations.get(report.nodeid, 0.0) + report.duration


def pytest_sessionfinish(session: pytest.Session) -> None:
    if not hasattr(session.config, "workerinput"):
        Path(os.environ[DURATIONS]).write_text(json.dumps(_durations), encoding="utf-8")


class Reach:
    """The map from lines to tests."""

    def __init__(self, tree: Path, results: Path) -> None:
        self.tree = tree
        self.durations: dict[str, float] = json.loads((results / "durations.json").read_text(encoding="utf-8"))
        self._data = CoverageData(str(results / "lines.coverage"))
        self._data.read()
        self._files: dict[Path, dict[int, frozenset[str]]] = {}

    def tests(self, file: Path, line: int) -> frozenset[str]:
        """The tests that run this line, or, where it is run by an import, the lines that mention what it defines."""
        statement = self._import_time_statement(file, line)
        if statement is None:
            lines = _lines_of_statement(self._trees[file], line)
            return frozenset().union(*(self._of_file(file).get(number, frozenset()) for number in lines))
        names = {
            node.id for node in ast.walk(statement) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
        }
        names |= {statement.name} if isinstance(statement, ast.FunctionDef) else set()
        return frozenset().union(
            *(self._of_file(other).get(number, frozenset()) for other, number in self._uses(names))
        )

    def lines_in(self, file: Path) -> Counter[str]:
        """How many lines of a file each test runs."""
        return Counter(test for tests in self._of_file(file).values() for test in tests)

    def _of_file(self, file: Path) -> dict[int, frozenset[str]]:
        if file not in self._files:
            lines = self._data.contexts_by_lineno(str(file))
            tests = {line: {context.split("|")[0] for context in contexts} for line, contexts in lines.items()}
            self._files[file] = {line: frozenset(names & self.durations.keys()) for line, names in tests.items()}
        return self._files[file]

    @cached_property
    def _trees(self) -> dict[Path, ast.Module]:
        files = sorted((self.tree / "src").rglob("*.py"))
        return {file: ast.parse(file.read_text(encoding="utf-8")) for file in files}

    def _import_time_statement(self, file: Path, line: int) -> ast.stmt | None:
        """The statement of a module or a class at this line; None for a line in the body of a function."""
        body: list[ast.stmt] = self._trees[file].body
        while True:
            inside = [node for node in body if node.lineno <= line <= (node.end_lineno or node.lineno)]
            match inside:
                case [ast.ClassDef() | ast.If() | ast.Try() as outer]:
                    body = outer.body
                case [ast.FunctionDef() as function]:
                    return None if line >= function.body[0].lineno else function
                case [statement]:
                    return statement
                case _:
                    return None

    def _uses(self, names: set[str]) -> Iterator[tuple[Path, int]]:
        for file, tree in self._trees.items():
            for function in (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)):
                for node in (inner for statement in function.body for inner in ast.walk(statement)):
                    name = (
                        node.attr
                        if isinstance(node, ast.Attribute)
                        else getattr(node, "id", getattr(node, "arg", None))
                    )
                    if name in names or (isinstance(node, ast.stmt) and function.name in names):
                        yield file, node.lineno


def _lines_of_statement(tree: ast.Module, line: int) -> range:
    """All lines of the smallest statement around this one: coverage knows a long statement by some of its lines."""
    around = [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.stmt) and node.lineno <= line <= (node.end_lineno or node.lineno)
    ]
    smallest = min(around, key=lambda node: (node.end_lineno or node.lineno) - node.lineno)
    body = getattr(smallest, "body", None)
    if body is None:
        return range(smallest.lineno, (smallest.end_lineno or line) + 1)
    return range(smallest.lineno, body[0].lineno) if line < body[0].lineno else range(line, line + 1)
