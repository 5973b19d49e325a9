"""What does an event cost in a chain of k gaps that spring, and in one of k dry frictions?

Run `python -m benchmarks.contact_chains`, or with the largest k: `python -m benchmarks.contact_chains 8`. A torque that
swings pushes the first inertia, and the contacts behind it open and close, or slip and stick. CPU: process time of the
first public call, which compiles, and of a second one; per event of the second one. Set OPENBLAS_NUM_THREADS=1, as
threads that wait for each other count as CPU. The exponent is that of k between
neighbouring sizes. To see what heyoka saves, give the engine: `python -m benchmarks.contact_chains 64 scipy`.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from typing import Any

import sympy

import shaftwork as sw

SIZES = (1, 2, 4, 8, 16, 32, 64, 128, 256)
INERTIA, PULL = 0.1, 20 * sympy.sin(12 * sw.t)
T_END = 1.0


def gaps(k: int) -> sw.Network:
    """Inertia, gap, inertia, shaft, inertia, gap, ..."""
    net = sw.Network("chain of gaps")
    net.add(sw.TorqueSource("pull", tau=PULL), "a0")
    net.add(sw.Inertia("Ja0", J=INERTIA), "a0")
    for n in range(k):
        net.add(sw.Backlash(f"gap{n}", gap=0.01, c=1e3, d=1.0), f"a{n}", f"b{n}")
        net.add(sw.Inertia(f"Jb{n}", J=INERTIA), f"b{n}")
        net.add(sw.Spring(f"shaft{n}", c=1e4, d=1.0), f"b{n}", f"a{n + 1}")
        net.add(sw.Inertia(f"Ja{n + 1}", J=INERTIA), f"a{n + 1}")
    return net


def frictions(k: int) -> sw.Network:
    """Inertias on shafts, each of which rubs on the frame."""
    net = sw.Network("chain of frictions")
    net.add(sw.TorqueSource("pull", tau=PULL), "n0")
    net.add(sw.Inertia("J0", J=INERTIA), "n0")
    for n in range(k):
        net.add(sw.Spring(f"shaft{n}", c=1e3, d=0.5), f"n{n}", f"n{n + 1}")
        net.add(sw.Inertia(f"J{n + 1}", J=INERTIA), f"n{n + 1}")
        net.add(sw.DryFriction(f"rub{n}", tau_c=0.2), f"n{n + 1}")
    return net


def timed(run: Callable[[], Any]) -> tuple[float, Any]:
    """CPU in s, and what came of it."""
    start = time.process_time()
    made = run()
    return time.process_time() - start, made


def main(most: int, engine: str) -> None:
    """Print a row for each size.

    Args:
        most: largest k.
        engine: its name, or "auto".
    """
    for chain in (gaps, frictions):
        print(f"\n{chain.__name__}\n     k  compile s  first s  second s  events  ms/event  exponent  engine")
        before: tuple[int, float] | None = None
        for k in (size for size in SIZES if size <= most):
            compiling, model = timed(chain(k).compile)
            run = lambda model=model: model.simulate(T_END, engine=engine, t_eval=2)  # noqa: E731
            first, _ = timed(run)
            second, sol = timed(run)
            each = second / max(1, len(sol.events))
            exponent = math.log(each / before[1]) / math.log(k / before[0]) if before else math.nan
            before = k, each
            row = f"{k:6} {compiling:10.2f} {first:8.2f} {second:9.3f} {len(sol.events):7} {1e3 * each:9.2f}"
            print(f"{row} {exponent:9.1f}  {sol.engine}", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else SIZES[-1], sys.argv[2] if len(sys.argv) > 2 else "auto")
