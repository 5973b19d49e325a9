"""What does a step of a stepped motion cost, and how far is it from real time?

Run `python -m benchmarks.stepper`. CPU: process time of one step, median over the motion. In it the input of a source
is set anew, the step made and a speed read; the mean has the steps with events in it, and those for which instants
ahead are looked up. "again" is a step by `simulate(initial=...)`, as one would write it without a stepper.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Sequence

import shaftwork as sw
from shaftwork.scenes import SCENES

PLACES = {"crane-start": "rotor", "crane": "rotor", "six-phases": "rotor", "excavator": "rotor", "crane-train": "rotor"}
PLACES |= {"excavator-train": "rotor"}
"""Scenes, and the node where a torque is given from outside."""
STEP, STEPS, FEW = 0.01, 600, 30


def network(name: str) -> sw.Network:
    """A scene with an input."""
    net = SCENES[name]()
    net.add(sw.TorqueSource("outside", tau=0.0), PLACES[name])
    return net


def torque(number: int) -> float:
    """What is set before a step: another value each time."""
    return 5.0 * math.sin(0.1 * number)


def stepped(model: sw.Model, engine: str, read: str, steps: int) -> list[float]:
    """CPU in ms of each step."""
    run, times = model.start(inputs=["outside.tau"], engine=engine), []
    for number in range(steps):
        start = time.process_time()
        run.set("outside.tau", torque(number))
        run.step(STEP)
        _ = run[read]
        times.append(1e3 * (time.process_time() - start))
    return times


def simulated(model: sw.Model, read: str) -> list[float]:
    """CPU in ms of steps by `simulate` alone."""
    motion, times = None, []
    for number in range(1, FEW + 1):
        start = time.process_time()
        motion = model.simulate(number * STEP, initial=motion, t_eval=2)
        _ = motion[read][-1]
        times.append(1e3 * (time.process_time() - start))
    return times


def main(names: Sequence[str] = tuple(PLACES), steps: int = STEPS) -> None:
    """Print a table."""
    print(f"CPU in ms of a step of {1e3 * STEP:g} ms with a new input: median (mean)")
    print(f"{'scene':16} {'auto':>16} {'scipy':>16} {'again':>16}   real time, auto")
    for name in names:
        model, read = network(name).compile(), SCENES[name].signals[-1]
        stepped(model, "auto", read, steps)  # compiles what the motion comes to
        rows = [
            stepped(model, "auto", read, steps),
            stepped(model, "scipy", read, min(steps, 100)),
            simulated(model, read),
        ]
        cells = [f"{statistics.median(row):.3f} ({statistics.mean(row):.2f})" for row in rows]
        print(
            f"{name:16} {' '.join(f'{cell:>16}' for cell in cells)}   {1e3 * STEP / statistics.mean(rows[0]):.0f} times"
        )


if __name__ == "__main__":
    main()
