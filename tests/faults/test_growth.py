"""Many calls: neither memory nor open files grow; of networks that are gone some code stays, in a bounded cache."""

from __future__ import annotations

import gc
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import sympy

import shaftwork as sw
from tests.faults.growth import train

ROOT = Path(__file__).parents[2]
CALLS = {"compile": 60, **dict.fromkeys(("heyoka", "scipy", "exact", "wave", "phases", "modes"), 200)}
CALLS |= dict.fromkeys(("sundials", "scipy-radau", "banded"), 100) | {"phases": 400}
BOUND = 2.0
"""MiB by which memory may grow from a fifth of the calls to all of them; measured are 0.1."""
BOUND_OF_CODE = 12.0
"""The same for networks, whose code is kept in a cache of bounded size; measured are 4."""


@pytest.mark.slow
@pytest.mark.parametrize("what", CALLS)
def test_many_calls_leave_neither_memory_nor_files_behind(what: str) -> None:
    environment = os.environ | dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    command = [sys.executable, "-m", "tests.faults.growth", what, str(CALLS[what])]
    done = subprocess.run(command, cwd=ROOT, env=environment, capture_output=True, text=True, check=True)
    memory, files = zip(*json.loads(done.stdout), strict=True)
    assert (memory[-1] - memory[0]) / 2**20 < (BOUND_OF_CODE if what == "compile" else BOUND)
    assert files[-1] == files[0]


@pytest.mark.parametrize(
    "law",
    [-sw.omega, -sympy.Abs(sw.omega - 3), -sympy.tanh(1e3 * (sw.omega - 1)), -sympy.floor(1e3 * sw.phi)],
    ids=["smooth", "switching", "fading", "counting"],
)
@pytest.mark.slow
@pytest.mark.heyoka
@pytest.mark.parametrize("sticks", [False, True])
def test_of_a_model_that_is_gone_no_compiled_code_stays(law: sympy.Expr, sticks: bool) -> None:  # noqa: FBT001
    """What its events call must not lead back to it."""
    gc.collect()
    before = integrators()
    net = train(sticks=sticks)
    net.add(sw.TorqueSource("extra", tau=law), "b")
    model = net.compile()
    motion = model.simulate(0.02, engine="heyoka")
    assert integrators() > before
    del net, model, motion
    gc.collect()
    assert integrators() == before


def integrators() -> int:
    return sum(type(made).__name__.startswith("taylor_adaptive") for made in gc.get_objects())
