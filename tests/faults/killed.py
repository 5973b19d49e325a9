"""A sweep that is killed at twenty moments of its work; prints what it has then, as JSON.

    python -m tests.faults.killed STORE

In a process of its own, which has no threads and may fork.
"""

from __future__ import annotations

import json
import os
import signal
import sqlite3
import sys
import time
from contextlib import closing
from pathlib import Path
from random import Random
from typing import Any

import numpy as np

import shaftwork as sw

KILLS, VARIANTS = 20, 200


def swept(store: Path | None) -> sw.studies.Sweep:
    net = sw.Network("swing")
    net.add(sw.TorqueSource("motor", tau=5.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Spring("shaft", c=700.0), "a", "b")
    net.add(sw.Inertia("J2", J=2.0), "b")
    samples = {"shaft.c": np.linspace(500.0, 900.0, VARIANTS)}
    measures = ["max shaft.tau", "end J.omega"]
    return sw.studies.sweep(
        net, samples=samples, t_end=0.1, measures=measures, engine="scipy", processes=1, store=store
    )


def stored(store: Path) -> list[int]:
    """The variants of all chunks, each as often as it stands there."""
    if not store.exists():
        return []
    with closing(sqlite3.connect(store)) as database:
        tables = database.execute("SELECT name FROM sqlite_master WHERE name = 'chunks'").fetchall()
        rows = database.execute("SELECT variants FROM chunks").fetchall() if tables else []
    return [variant for (numbers,) in rows for variant in np.frombuffer(numbers, dtype="<i8").tolist()]


def main(store: Path) -> dict[str, Any]:
    began = time.monotonic()
    whole = swept(None)
    usual, random, seen = time.monotonic() - began, Random("killed"), list[int]()  # noqa: S311
    for _ in range(KILLS):
        child = os.fork()
        if child == 0:
            swept(store)
            os._exit(0)
        time.sleep(random.uniform(0.0, 0.25 * usual))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        seen.append(len(stored(store)))
    made = swept(store)
    same = all((made.measures[name] == values).all() for name, values in whole.measures.items())
    return {"seen": seen, "same": same, "stored": sorted(stored(store)), "failed": int(made.failed.sum())}


if __name__ == "__main__":
    sys.stdout.write(json.dumps(main(Path(sys.argv[1]))))
