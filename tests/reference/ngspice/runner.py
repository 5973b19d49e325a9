"""Runs ngspice as a batch process and refines its time step until the result no longer changes."""

from __future__ import annotations

import subprocess
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from tests.reference.ngspice.cases import Case

Array = NDArray[np.float64]
OPTIONS = "reltol=1e-6 abstol=1e-12 vntol=1e-9 chgtol=1e-18 method=trap"


def run_ngspice(
    netlist: str, expressions: tuple[str, ...], t_end: float, step: float, options: str = OPTIONS
) -> tuple[Array, Array]:
    """A transient analysis from rest with at most `step` s between its points.

    Returns:
        Times in s, shape (k,), and the values of the expressions, shape (k, number of expressions).

    Raises:
        RuntimeError: ngspice stopped early or wrote no result; with what it printed.
    """
    names = [f"signal{number}" for number in range(len(expressions))]
    deck = [
        "* equivalent circuit of a drive train",
        netlist.strip(),
        f".options {options}",
        f".tran {step!r} {t_end!r} 0 {step!r} uic",
        ".control",
        "set numdgt=14",
        "set wr_singlescale",
        "run",
        *(f"let {name} = {expression}" for name, expression in zip(names, expressions, strict=True)),
        f"wrdata result.txt {' '.join(names)}",
        "quit",
        ".endc",
        ".end",
    ]
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "deck.cir").write_text("\n".join(deck) + "\n", encoding="ascii")
        command = ["ngspice", "-b", "deck.cir"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=120)
        result = Path(folder, "result.txt")
        table = np.loadtxt(result, ndmin=2) if result.exists() else np.empty((0, 1 + len(names)))
    if table.shape[0] < 2 or table[-1, 0] < t_end * (1.0 - 1e-9):
        message = f"ngspice gave no result up to {t_end} s:\n{done.stdout}\n{done.stderr}"
        raise RuntimeError(message)
    return table[:, 0], table[:, 1:]


def converged(case: Case, times: Array, tolerance: float = 1e-4) -> tuple[Array, float]:
    """The case's signals at given times, the step halved until they change by less than `tolerance` of their maxima.

    Returns:
        Values of shape (number of times, number of signals), and the last change, relative to each signal's maximum.

    Raises:
        RuntimeError: ten halvings were not enough.
    """
    expressions = tuple(expression for expression, _ in case.signals)
    coarse: Array | None = None
    change = np.inf
    for halving in range(11):
        t, values = run_ngspice(case.netlist, expressions, case.t_end, case.t_end / 1000.0 / 2**halving)
        fine = np.column_stack([np.interp(times, t, column) for column in values.T])
        if coarse is not None:
            change = float(np.max(np.abs(fine - coarse) / np.max(np.abs(fine), axis=0)))
            if change < tolerance:
                return fine, change
        coarse = fine
    message = f"{case.name}: ngspice still changes by {change:.1e} of the maximum after ten halvings of its step"
    raise RuntimeError(message)
