"""Files, laws and command lines from anywhere: a result or an error in the library's words, soon, in little room.

A case has 2 s of processor time and 1 GiB (`fuzz`); a command and a study, which compute, have 20 s.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.faults.fuzz import faults

ROOT = Path(__file__).parents[2]
EXAMPLES = int(os.environ.get("SHAFTWORK_EXAMPLES", "20"))
FEW = {"laws": 200, "files": 60, "commands": 0, "studies": 0}
"""Cases that are tried in this process, within limits of time alone."""
SHARE = {"laws": 20, "files": 10, "commands": 5, "studies": 2}
"""Cases for each of SHAFTWORK_EXAMPLES."""


def fuzz(kind: str, first: int, count: int) -> None:
    one_thread = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    done = subprocess.run(
        [sys.executable, "-m", "tests.faults.fuzz", kind, str(first), str(count)],
        capture_output=True,
        text=True,
        errors="replace",
        check=False,
        cwd=ROOT,
        env=os.environ | one_thread,
    )
    last = done.stderr.rpartition("\0")[2]
    assert done.stdout == ""
    assert done.returncode == 0, f"ended with {done.returncode} in the case {last}"
    assert last.strip() == f"{kind} {first + count - 1}"


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["laws", "files"])
def test_a_few_hundred_wrong_inputs_end_in_a_result_or_a_named_error(kind: str) -> None:
    assert list(faults(kind, 0, FEW[kind])) == []


@pytest.mark.slow
@pytest.mark.parametrize("kind", SHARE)
def test_many_wrong_inputs_end_in_a_result_or_a_named_error(kind: str) -> None:
    fuzz(kind, FEW[kind], SHARE[kind] * EXAMPLES)
