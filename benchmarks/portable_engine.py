"""What does a motion cost without heyoka, which has wheels for Linux alone?

Run `python -m benchmarks.portable_engine`. Scenes by `heyoka`, `numba` and `scipy` at rtol 1e-8, 201 outputs. First:
wall time in s of the first call in this process, in which code is compiled; what numba keeps for other processes is
made before. CPU: process time in ms of one warm public call, median of five. Error: of the states at the outputs,
over the largest of each, against heyoka at 1e-13.
"""

from __future__ import annotations

import os

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")  # read when numpy is loaded

import statistics
import time
import warnings

import numpy as np

import shaftwork as sw

SCENES = {"crane-start": 10.0, "crane": 10.0, "excavator": 10.0, "bldc-shaft": 0.2, "ship-engine": 2.0}
ENGINES = ("heyoka", "numba", "scipy")
RUNS = 5


def measured(model: sw.Model, t_end: float, engine: str, truth: sw.Solution) -> str:
    """First call in s, warm CPU in ms, steps and error."""
    start = time.perf_counter()
    run = model.simulate(t_end, t_eval=201, engine=engine)
    first, spent = time.perf_counter() - start, list[float]()
    while len(spent) < RUNS and sum(spent) < 5.0:
        begin = time.process_time()
        run = model.simulate(t_end, t_eval=201, engine=engine)
        spent.append(time.process_time() - begin)
    sizes = np.maximum(np.abs(truth.x).max(axis=0), 1e-9)
    error = (np.abs(run.x - truth.x).max(axis=0) / sizes).max()
    return f"{first:8.2f}   {1e3 * statistics.median(spent):9.2f}   {run.statistics['steps']:6}   {error:7.0e}"


def main() -> None:
    """Print a table."""
    sw.scenes.crane_start().simulate(0.1, engine="numba")  # compiles the loops, once for all processes
    print("scene         engine    first s      CPU ms    steps     error")
    for name, t_end in SCENES.items():
        model = scene(name).compile()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", sw.AccuracyWarning)
            truth = model.simulate(t_end, t_eval=201, rtol=1e-13)
            for engine in ENGINES:
                print(f"{name:12}  {engine:7}  {measured(scene(name).compile(), t_end, engine, truth)}", flush=True)


def scene(name: str) -> sw.Network:
    """A scene by its name."""
    network: sw.Network = getattr(sw.scenes, name.replace("-", "_"))()
    return network


if __name__ == "__main__":
    main()
