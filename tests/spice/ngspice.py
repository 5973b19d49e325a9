"""Runs a deck in ngspice and reads the voltages that it writes."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

Array = NDArray[np.float64]
NEEDS_NGSPICE = pytest.mark.skipif(
    shutil.which("ngspice") is None and "CI" not in os.environ, reason="needs ngspice (Debian package); CI has it"
)


def run_deck(deck: str, seconds: float = 60.0) -> dict[str, Array]:
    """Every voltage and current of the transient analysis of a deck, by name, and `time`.

    Raises:
        RuntimeError: ngspice stopped or wrote nothing; with what it said.
    """
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder, "deck.cir")
        place.write_text(deck, encoding="utf-8")
        command = ["ngspice", "-b", "-r", "deck.raw", "deck.cir"]
        done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, timeout=seconds)
        raw = Path(folder, "deck.raw")
        said = f"{done.stdout[-1500:]}\n{done.stderr[-1500:]}"
        if not raw.exists() or "doAnalyses" in done.stderr:
            raise RuntimeError(said)
        return _columns(raw.read_bytes())


def _columns(raw: bytes) -> dict[str, Array]:
    head, _, data = raw.partition(b"Binary:\n")
    lines = head.decode("ascii", "replace").splitlines()
    count = next(int(line.split(":")[1]) for line in lines if line.startswith("No. Variables"))
    first = lines.index("Variables:") + 1
    names = [line.split("\t")[2] for line in lines[first : first + count]]
    table = np.frombuffer(data[: len(data) // (8 * count) * 8 * count]).reshape(-1, count)
    return {name.lower(): table[:, k].copy() for k, name in enumerate(names)}
