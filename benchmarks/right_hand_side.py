"""One evaluation of the right-hand side: model.rhs before and after model.compiled(), numpy by hand, and the same in C.

    python -m benchmarks.right_hand_side

A drive of motor, damped shaft of m elements and load; and the crane, whose three states show what a call costs. The C
code is what gcc -O3 makes of `model.source("c")`, called a million times within C. Processor time, medians of seven.
"""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
import numpy as np

import shaftwork as sw
from shaftwork.scenes import SCENES

M = 1000
RADIUS, DENSITY, SHEAR, DAMPING = 0.01, 7900.0, 77.5e9, 0.01
LOOP = """void many(long n, double t, const double *x, const double *p, double *rates)
{
    while (n--) {
        rhs(t, x, p, rates);
        __asm__ volatile("" ::: "memory");
    }
}
"""


def microseconds(run: Callable[[], object], times: int = 2000) -> float:
    """Processor time of one call, median of seven."""
    found = []
    for _ in range(7):
        begun = time.process_time()
        for _ in range(times):
            run()
        found.append((time.process_time() - begun) / times * 1e6)
    return float(np.median(found))


def drive() -> sw.Model:
    """Motor, shaft of M elements and load."""
    net = sw.Network("drive")
    net.add(sw.TorqueSource("motor", tau=12.7), "a")
    net.add(sw.Inertia("Je", J=0.025), "a")
    steel = {"length": 1.0, "diameter": 2 * RADIUS, "density": DENSITY, "shear_modulus": SHEAR, "damping": DAMPING}
    net.add(sw.Shaft("line", **steel, model=sw.Lumped(M)), "a", "b")
    net.add(sw.Inertia("Jm", J=0.11), "b")
    return net.compile()


def by_hand(x: Any) -> Any:
    """The same in numpy."""
    area, dx = np.pi * RADIUS**4 / 2, 1 / M
    inertia, stiffness = DENSITY * area, SHEAR * area
    speeds, elastic = x[: M + 1], x[M + 1 :]
    twist = speeds[:-1] - speeds[1:]
    torque = elastic + DAMPING / dx * twist
    rates = np.empty(2 * M + 1)
    rates[0] = (12.7 - torque[0]) / (0.025 + inertia * dx / 2)
    rates[1:M] = (torque[:-1] - torque[1:]) / (inertia * dx)
    rates[M] = torque[-1] / (0.11 + inertia * dx / 2)
    rates[M + 1 :] = stiffness / dx * twist
    return rates


def in_c(model: Any, x: Any, p: Any) -> float:
    """Microseconds of one evaluation within C."""
    with tempfile.TemporaryDirectory() as folder:
        source = Path(folder, "rhs.c")
        source.write_text(
            model.source("c").replace("void rhs", "__attribute__((noinline)) void rhs") + LOOP, encoding="utf-8"
        )
        library = Path(folder, "rhs.so")
        subprocess.run(["gcc", "-O3", "-march=native", "-shared", "-fPIC", "-o", library, source, "-lm"], check=True)
        many = ctypes.CDLL(str(library)).many
        doubles = np.ctypeslib.ndpointer(dtype=float)
        many.argtypes, many.restype = [ctypes.c_long, ctypes.c_double, doubles, doubles, doubles], None
        rates = np.empty(len(x))
        return microseconds(lambda: many(100_000, 0.0, x, p, rates), 1) / 100_000


@numba.njit
def often(into: Any, times: int, x: Any, p: Any, rates: Any) -> None:
    """Call machine code from machine code."""
    for _ in range(times):
        into(0.0, x, p, rates)


def table(name: str, model: Any, hand: Callable[[Any], Any] | None) -> None:
    """Print the times of one model."""
    x, p = np.random.default_rng(0).standard_normal(len(model.states)), np.array(model.defaults)
    other = [p * (1 + 1e-9 * k) for k in range(50)]
    before = {
        "rhs before": microseconds(lambda: model.rhs(0.0, x)),
        "rhs before, other parameters": microseconds(lambda: [model.rhs(0.0, x, q) for q in other], 1) / 50,
    }
    if hand is not None:
        assert np.allclose(hand(x), model.rhs(0.0, x), rtol=1e-9, atol=1e-6)
        before["numpy by hand"] = microseconds(lambda: hand(x))
    compiled = model.compiled()
    rates = compiled(0.0, x, p)
    often(compiled.into, 1, x, p, rates)
    rows = {
        "C": in_c(model, x, p),
        "compiled.into, in machine code": microseconds(lambda: often(compiled.into, 10**5, x, p, rates), 1) / 10**5,
        "compiled.into": microseconds(lambda: compiled.into(0.0, x, p, rates)),
        "compiled": microseconds(lambda: compiled(0.0, x, p)),
        "compiled, other parameters": microseconds(lambda: [compiled(0.0, x, q) for q in other], 40) / 50,
        "rhs": microseconds(lambda: model.rhs(0.0, x)),
        "rhs, other parameters": microseconds(lambda: [model.rhs(0.0, x, q) for q in other], 40) / 50,
        **before,
    }
    for label, value in rows.items():
        print(f"{name} ({len(x)} states)  {label:30s} {value:8.2f} us  {value / rows['C']:6.1f} times C")


def main() -> None:
    """Print both tables."""
    table("drive", drive(), by_hand)
    table("crane", SCENES["crane"].build().compile().phase("brake slipping forward, load slipping forward"), None)


if __name__ == "__main__":
    main()
