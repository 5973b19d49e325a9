"""Memory and open files over many calls; prints both at five moments, as JSON.

    python -m tests.faults.growth WHAT CALLS

In a process of its own, whose memory is that of the calls alone.
"""

from __future__ import annotations

import gc
import json
import os
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import shaftwork as sw

MOMENTS = 5
"""Looks at memory, the first after a fifth of the calls: till then caches fill."""


def train(stiffness: float = 24e3, *, sticks: bool = False) -> sw.Network:
    net = sw.Network(f"train of {stiffness!r}")
    net.add(sw.TorqueSource("motor", tau=50.0 - 2.0 * sw.omega), "a")
    net.add(sw.Inertia("J1", J=27.0), "a")
    net.add(sw.Spring("shaft", c=stiffness, d=14.0), "a", "b")
    net.add(sw.Inertia("J2", J=62.0), "b")
    net.add(sw.CoulombLoad("load", tau=20.0) if sticks else sw.TorqueSource("load", tau=-sw.omega), "b")
    return net


def line() -> sw.Network:
    net = sw.Network("line")
    net.add(sw.TorqueSource("motor", tau=5.0), "a")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Shaft("shaft", length=9.0, diameter=0.05, model=sw.Wave()), "a", "b")
    net.add(sw.Inertia("J2", J=6.0), "b")
    return net


def simulated(model: sw.Model, engine: str) -> Callable[[int], object]:
    """Runs with other values each, read as a user reads them."""

    def call(number: int) -> object:
        own = {} if engine == "wave" else {"parameters": {"shaft.c": 20e3 + number}}
        motion = model.simulate(0.02, engine=engine, t_eval=20, **own)  # type: ignore[arg-type]
        return motion.max("J1.omega"), motion.energy_residual

    return call


def compiled(number: int) -> object:
    """A network with laws and a structure of its own."""
    net = train(20e3 + number, sticks=number % 2 == 0)
    net.add(sw.TorqueSource("extra", tau=(number + 1.5) * sw.t ** (2 + number % 7)), "a")
    for k in range(number % 5):
        net.add(sw.Inertia(f"end{k}", J=1.0 + k), f"c{k}")
        net.add(sw.Spring(f"to{k}", c=1e3), "b", f"c{k}")
    return net.compile().simulate(1e-3, t_eval=2)


def made(what: str) -> Callable[[int], object]:
    if what == "compile":
        return compiled
    if what == "modes":
        net = train()
        return lambda number: net.modes(at={"J1.omega": float(number)}).frequencies
    if what == "phases":
        return simulated(train(sticks=True).compile(), "auto")
    return simulated((line() if what == "wave" else train()).compile(), what)


def resident() -> int:
    """Bytes of this process in memory."""
    return int(Path("/proc/self/statm").read_text("ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE")


def main(what: str, calls: int) -> list[tuple[int, int]]:
    warnings.simplefilter("ignore")
    call, seen = made(what), list[tuple[int, int]]()
    for number in range(calls):
        call(number)
        if (number + 1) % (calls // MOMENTS) == 0:
            gc.collect()
            seen.append((resident(), len(list(Path("/proc/self/fd").iterdir()))))
    return seen


if __name__ == "__main__":
    sys.stdout.write(json.dumps(main(sys.argv[1], int(sys.argv[2]))))
