"""What does stick-slip of a drill string cost with each model of its pipe, and how exact is it?

Run `python -m benchmarks.drill_string`, or with a shorter end time in s behind it. 3000 m of drill pipe hang between a
top drive with a speed controller and a bit whose friction falls with its speed, so that it sticks and slips. Period:
mean time between two stops of the bit, the first left out. Error: of the speed of the bit at all output times, over its
largest, against waves at rtol 1e-12, which the method of steps confirms to 1e-10 (tests/reference/drill_string.py).
CPU: process time of one warm public call with 1201 output times, median of three, of one where it takes seconds.
"""

from __future__ import annotations

import os

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")  # read when numpy is loaded

import statistics
import sys
import time
import warnings
from typing import Any

import numpy as np
from sympy import Min

import shaftwork as sw

T_END, OUTPUTS = 60.0, 1201
LONG = 2.0
"""A run of so many seconds is timed once."""
RUNS: tuple[tuple[str, Any, dict[str, Any]], ...] = (
    ("Wave(), rtol 1e-6", sw.Wave(), {"rtol": 1e-6}),
    ("Wave(), rtol 1e-8", sw.Wave(), {"rtol": 1e-8}),
    ("Spectral(16)", sw.Spectral(16), {}),
    ("Spectral(24)", sw.Spectral(24), {}),
    ("Lumped(60), scipy", sw.Lumped(60), {"engine": "scipy"}),
)


def drill_string(model: Any) -> sw.Model:
    """The drill string as a user wires it."""
    net = sw.Network("drill string")
    net.add(sw.SpeedController("top drive", omega_ref=5 * Min(1, sw.t / 10), k_p=1000.0, t_i=5.0), "top")
    net.add(sw.Inertia("J_top", J=2000.0), "top")
    net.add(sw.Shaft("pipe", length=3000.0, diameter=0.127, inner_diameter=0.108, model=model), "top", "bit")
    net.add(sw.Inertia("J_bit", J=300.0), "bit")
    net.add(sw.DryFriction("rock", tau_c=5000.0, tau_s=8000.0, omega_s=1.0), "bit")
    return net.compile()


def period(sol: sw.Solution) -> float:
    """Mean time in s between two stops of the bit, the first left out."""
    stops = [time for time, _, _, after in sol.events if after == "stuck"]
    return float(np.mean(np.diff(stops[1:]))) if len(stops) > 2 else float("nan")


def timed(model: sw.Model, t_end: float, options: dict[str, Any]) -> tuple[sw.Solution, float]:
    """A motion, and the CPU of a warm run in s."""
    spent: list[float] = []
    model.simulate(t_end / 100, t_eval=2, **options)
    while not spent or (len(spent) < 3 and spent[0] < LONG):
        start = time.process_time()
        sol = model.simulate(t_end, t_eval=OUTPUTS, **options)
        spent.append(time.process_time() - start)
    return sol, statistics.median(spent)


def main(t_end: float) -> None:
    """Print period, largest speed, error and CPU of each model."""
    truth = drill_string(sw.Wave()).simulate(t_end, t_eval=OUTPUTS, rtol=1e-12)
    print(f"truth: period {period(truth):.7f} s, at most {truth['J_bit.omega'].max():.7f} rad/s\n")
    print("model               engine   events  period s   at most    error    CPU s")
    for name, model, options in RUNS:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", sw.AccuracyWarning)
            sol, cpu = timed(drill_string(model), t_end, options)
        speed = sol["J_bit.omega"]
        error = np.abs(speed - truth["J_bit.omega"]).max() / np.abs(truth["J_bit.omega"]).max()
        shown = f"{len(sol.events):6}  {period(sol):.6f}  {speed.max():.6f}  {error:7.0e}  {cpu:7.2f}"
        print(f"{name:18}  {sol.engine:7}  {shown}", flush=True)


if __name__ == "__main__":
    main(float(sys.argv[1]) if len(sys.argv) > 1 else T_END)
