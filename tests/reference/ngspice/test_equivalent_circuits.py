"""Shaftwork against ngspice: the same drive trains, typed by hand as equivalent circuits."""

from __future__ import annotations

import os
import shutil

import numpy as np
import pytest

import shaftwork as sw
from tests.reference.ngspice.cases import CASES, Case
from tests.reference.ngspice.runner import converged


def network(case: Case) -> sw.Network:
    net = sw.Network(case.name)
    for part in case.parts:
        net.add(getattr(sw, part.type)(part.name, **part.values), *part.nodes)
    return net


@pytest.mark.slow
@pytest.mark.skipif(
    shutil.which("ngspice") is None and "CI" not in os.environ, reason="needs ngspice (Debian package); CI has it"
)
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_train_moves_like_its_equivalent_circuit(case: Case) -> None:
    times = np.linspace(0.0, case.t_end, 201)[1:]
    expected, change = converged(case, times)
    solution = network(case).simulate(t_end=case.t_end, rtol=1e-10, t_eval=times)
    # The trapezoidal rule is of second order: halving the step leaves a third of the last change. Twice the change is
    # ample for that and still below 1e-3.
    tolerance = 2.0 * change
    assert tolerance < 1e-3
    for column, (_, quantity) in zip(expected.T, case.signals, strict=True):
        error = np.max(np.abs(solution[quantity] - column)) / np.max(np.abs(column))
        assert error < tolerance, f"{quantity} differs by {error:.1e} of its maximum"
