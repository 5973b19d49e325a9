"""What does the exported C code of a crane cost beside DOP853 written by hand in C for this one system?

Run `python -m benchmarks.c_code`; it needs gcc. The start is that of benchmarks/crane_rivals.py, its end state alone.
Error: largest deviation of the shaft torque at the end, over the largest torque. CPU: process time of a run in C,
median; one call of `ctypes` makes both. Then the crane from rest to rest with gap and brake, whose 60 events C follows
as well, beside the library.
"""

from __future__ import annotations

import ctypes
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

import shaftwork as sw
from benchmarks import crane_rivals as rivals
from shaftwork.ccode.c_export import c_code
from shaftwork.scenes import SCENES

FLAGS = ["-std=c99", "-O3", "-march=native", "-shared", "-fPIC"]
RUN = """
int run(double t_end, double rtol, double *x);
int run(double t_end, double rtol, double *x)
{
    NAME m;
    NAME_init(&m);
    int fault = NAME_start(&m, 0.0);
    if (!fault) fault = NAME_integrate(&m, t_end, rtol);
    for (int i = 0; i < NAME_STATES; i++) x[i] = m.x[i];
    return fault;
}
"""
"""A whole motion in one call."""


def exported(model: sw.Model) -> Callable[[float, float], np.ndarray]:
    """The exported code: from end in s and tolerance to the states at the end.

    Raises:
        RuntimeError: a run has a fault.
    """
    code = c_code(model)
    with tempfile.TemporaryDirectory() as folder:
        _, source, _ = code.write(folder)
        source.write_text(code.source + RUN.replace("NAME", code.name), encoding="utf-8")
        library = Path(folder, "model.so")
        subprocess.run(["gcc", *FLAGS, "-o", library, source, "-lm"], check=True)
        run = ctypes.CDLL(str(library)).run
    run.argtypes = [ctypes.c_double, ctypes.c_double, np.ctypeslib.ndpointer(np.float64, flags="C")]
    states = np.empty(len(code.states))

    def solve(t_end: float, rtol: float) -> np.ndarray:
        if run(t_end, rtol, states):
            message = f"fault at rtol {rtol:g}"
            raise RuntimeError(message)
        return states.copy()

    return solve


def main() -> None:
    """Print error and CPU of both, and their CPU at an error of 1e-6."""
    truth = rivals.reference()[-1:]
    largest = float(np.abs(rivals.reference()).max())
    by_hand, names = rivals.c_dop853(times=np.array([rivals.T_END]))[0], rivals.crane_model().states
    code, order = (
        exported(rivals.crane_model()),
        [names.index(name) for name in ("J1.omega", "shaft.tau_c", "J2.omega")],
    )

    def ours(rtol: float) -> np.ndarray:
        return rivals.shaft_torque(code(rivals.T_END, rtol)[order, None])

    cpu = {}
    for title, solve in (("by hand", by_hand), ("exported", ours)):
        points = rivals.work_precision(solve, truth, scale=largest)
        for point in points:
            print(f"{title:10s} rtol {point.rtol:.1e}   error {point.error:.1e}   {1e6 * point.cpu:8.1f} us")
        cpu[title] = rivals.cpu_at(points, 1e-6)
    print(f"at an error of 1e-6: {cpu['exported'] / cpu['by hand']:.2f} times the CPU of the code by hand")
    scene = SCENES["six-phases"]
    model = scene().compile()
    run = exported(model)
    in_c = rivals.cpu_of(lambda: run(scene.t_end, 1e-8))
    model.simulate(scene.t_end, t_eval=2)
    begins = time.process_time()
    model.simulate(scene.t_end, t_eval=2)
    here = time.process_time() - begins
    print(f"crane with gap and brake: {1e3 * in_c:.2f} ms in C, {1e3 * here:.1f} ms by the library")


if __name__ == "__main__":
    main()
