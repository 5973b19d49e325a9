"""What the package promises to who installs it: versions, files, and tests that run without the tools of developers."""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tomllib
from itertools import chain
from pathlib import Path

import pytest

import shaftwork as sw

ROOT = Path(__file__).parents[2]
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
CI = (ROOT / ".ci/run").read_text(encoding="utf-8")


def test_the_lowest_versions_of_libraries_are_those_with_which_scenes_run() -> None:
    """heyoka has erfc from 7.13.1 on, sympy prints tables from 1.14 on; CI runs tests on exactly these versions."""
    printed = subprocess.run([sys.executable, ".ci/lowest.py"], cwd=ROOT, check=True, capture_output=True, text=True)
    lowest = dict(line.split("==") for line in printed.stdout.splitlines())
    assert (lowest["heyoka"], lowest["sympy"]) == ("7.13.1", "1.14")
    declared = [*SETTINGS["project"]["dependencies"], *chain(*SETTINGS["project"]["optional-dependencies"].values())]
    own = [need for need in declared if not need.startswith("shaftwork[")]
    assert {re.split(r"[>=;]", need)[0] for need in own} == set(lowest)  # each has its lowest version
    assert re.search(r'\.ci/lowest\.py >"(.+)"\n.*-c "\1"', CI)


def test_each_version_of_python_that_is_promised_runs_in_ci() -> None:
    versions = re.findall(r"Python :: (3\.\d+)$", "\n".join(SETTINGS["project"]["classifiers"]), re.MULTILINE)
    assert versions[0] == SETTINGS["project"]["requires-python"].removeprefix(">=")
    newer = re.search(r"^for version in (.*); do$", CI, re.MULTILINE)
    assert newer is not None
    assert set(versions[1:]) <= set(newer[1].split())


def test_what_readme_links_to_is_in_the_source_distribution() -> None:
    packed = SETTINGS["tool"]["hatch"]["build"]["targets"]["sdist"]["include"]
    always = ("/pyproject.toml", "/README.md", "/LICENSE", "/.gitignore")  # hatchling adds them
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    linked = {f"/{target.partition('#')[0]}" for target in re.findall(r"\]\((?!https?:)([^)#]+)", text)}
    assert "/CONTRIBUTING.md" in linked
    assert {name for name in linked if not name.startswith((*packed, *always))} == set()


@pytest.mark.slow
def test_random_examples_run_without_the_coverage_tool() -> None:
    place = "tests/network/test_expressions.py::test_what_was_read_can_be_written"
    run = subprocess.run(
        [sys.executable, "-m", "pytest", "-p", "no:pytest_cov", "-p", "no:cacheprovider", "-n", "0", "-qm", "", place],
        cwd=ROOT,
        check=False,
        capture_output=True,
        text=True,
    )
    assert "1 passed" in run.stdout, run.stdout + run.stderr


@pytest.mark.parametrize("name", ["reduce", "scenes", "sizing", "studies"])
def test_a_sub_package_is_loaded_when_it_is_first_asked_for(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(sw, name, raising=False)  # as no import had been yet
    assert getattr(sw, name).__name__ == f"shaftwork.{name}"


@pytest.mark.slow
@pytest.mark.study
def test_fewer_examples_than_the_default_break_no_property() -> None:
    options = ("-q", "-n", "0", "-p", "no:cacheprovider", "-m", "not slow", "tests/properties")
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *options],
        cwd=ROOT,
        env={**os.environ, "SHAFTWORK_EXAMPLES": "2"},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-2000:]
