"""What does a variant of the crane start cost in a sweep, how right is it, and does a stopped sweep go on?

Run `python -m benchmarks.sweep [VARIANTS]`; 10000 by default. Random stiffness, damping and pull-out torque; measured
are the largest torque of the shaft and the speed at the end of 6.5 s. CPU: process time of the public call, set-up
included, of the first call of this process and of a later one; less that of a call with a tenth of the variants it is
without. The first one compiles, or finds what earlier processes have left in numba's cache, which with NUMBA_CACHE_DIR
in an empty folder is nothing. Error: against scipy at rtol 1e-10.
"""

from __future__ import annotations

import resource
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import shaftwork as sw
from shaftwork.studies import Sweep, sweep
from shaftwork.sweep.sweep_task import CHUNK, Chunk, Worker

T_END = 6.5
MEASURES = {"peak": "max shaft.tau", "speed": "end J2.omega"}


def samples(count: int) -> dict[str, np.ndarray]:
    """Random variants."""
    random = np.random.default_rng(1)
    ranges = {"shaft.c": 24206.0, "shaft.d": 14.0, "motor.tau_k": 8.0}
    return {name: value * random.uniform(0.7, 1.3, count) for name, value in ranges.items()}


def timed(count: int, **options: object) -> tuple[Sweep, float]:
    """A sweep and its CPU time in s."""
    start = time.process_time()
    made = sweep(sw.scenes.crane_start(), samples=samples(count), t_end=T_END, measures=MEASURES, **options)  # type: ignore[arg-type]
    return made, time.process_time() - start


def resumes(count: int, whole: Sweep) -> bool:
    """Whether a sweep that is stopped in the middle ends with the same numbers."""
    run, chunks = Worker.run, iter(range(count))

    def stop(self: Worker, variants: np.ndarray) -> Chunk:
        if next(chunks) * CHUNK >= count // 2:
            raise KeyboardInterrupt
        return run(self, variants)

    with tempfile.TemporaryDirectory() as folder:
        store = Path(folder) / "sweep.jsonl"
        Worker.run = stop  # type: ignore[method-assign]
        try:
            timed(count, store=store)
        except KeyboardInterrupt:
            pass
        finally:
            Worker.run = run  # type: ignore[method-assign]
        made, _ = timed(count, store=store)
    return all(np.array_equal(made.measures[name], whole.measures[name]) for name in MEASURES)


def main(count: int = 10_000) -> None:
    """Measure and print."""
    _, first_call = timed(count)
    _, short = timed(max(count // 10, 16))
    made, long = timed(count)
    slope = (long - short) / (count - max(count // 10, 16)) * 1e6
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    print(f"{count} variants, {int(made.failed.sum())} failed; {made.why or 'side by side'}")
    calls = f"{first_call / count * 1e6:.0f} us in the first call, {long / count * 1e6:.0f} us in a later one"
    print(f"CPU per variant: {calls}, {slope:.0f} us without set-up; memory {memory:.0f} MiB")
    first = {name: values[:16] for name, values in samples(count).items()}
    same, truth = (
        sweep(sw.scenes.crane_start(), samples=first, t_end=T_END, measures=MEASURES, engine=engine, rtol=rtol)
        for engine, rtol in (("auto", 1e-8), ("scipy", 1e-10))
    )
    for name in MEASURES:
        error = np.abs(same.measures[name] / truth.measures[name] - 1).max()
        assert np.array_equal(same.measures[name], made.measures[name][:16])
        print(f"largest error of '{name}' in 16 variants, against scipy: {error:.1e}")
    print(f"stopped in the middle it ends with the same numbers: {resumes(count, made)}")


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
