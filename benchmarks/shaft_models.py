"""What does the motion of a long shaft cost with each model, and how exact is it?

Run `python -m benchmarks.shaft_models`. The shaft is the steel one of Popenda 2019 between 0.025 and 0.11 kg m2,
without damping, under a step of 12.7 N m at the motor, 0.2 s. Its motion is compared with the exact one by
characteristics: largest error of the torques and of the speeds at both ends, over the largest of each. CPU: process
time of one warm public call on one thread, median, with 401 output times. Beside it stands what is usual: a chain of
100 elements, typed by hand in numpy, by scipy's DOP853, as loosely as its own error of discretisation allows. At last,
a damped chain of up to 10000 elements.
"""

from __future__ import annotations

import os

os.environ.update(OPENBLAS_NUM_THREADS="1", OMP_NUM_THREADS="1", MKL_NUM_THREADS="1")  # read when numpy is loaded

import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

import shaftwork as sw
from shaftwork.scenes.long_shafts import LOAD_INERTIA, MOTOR_INERTIA, RATED_TORQUE
from tests.reference.exact_shafts.exact_motion import JunctionTorque, motion
from tests.reference.exact_shafts.line import Section, SectionLine

Array = NDArray[np.float64]

SECTION = Section.of_geometry(1.0, 0.02, density=7900.0, shear_modulus=77.5e9)
T_END, OUTPUTS, LONG_OUTPUTS = 0.2, 401, 201
RTOLS = tuple(10.0 ** (-quarter / 4) for quarter in range(8, 40))
DAMPING = 1e-6
"""Of the long chains, D'/C' in s."""
LONG_RTOL = 1e-5


@dataclass(frozen=True)
class Ends:
    """Torques (k, 2) in N m and speeds (k, 2) in rad/s at both ends of the shaft."""

    torques: Array
    speeds: Array

    def errors(self, truth: Ends) -> tuple[float, float]:
        """Largest error of the torques and of the speeds, over the largest of each."""
        pairs = ((self.torques, truth.torques), (self.speeds, truth.speeds))
        return tuple(float(np.abs(found - exact).max() / np.abs(exact).max()) for found, exact in pairs)  # type: ignore[return-value]


def exact(t: Array) -> Ends:
    """By characteristics."""
    line = SectionLine((SECTION,), (MOTOR_INERTIA, LOAD_INERTIA), (0.0, 0.0))
    found = motion(line, [JunctionTorque(0, lambda t: np.full_like(t, RATED_TORQUE))], T_END)
    torques = np.stack([found.torque_in(0, t, "left"), found.torque_in(0, t, "right")], axis=1)
    return Ends(torques, np.stack([found.junction_speed(0, t), found.junction_speed(1, t)], axis=1))


def by_model(model: sw.Model) -> Ends:
    """One public call, read at both ends."""
    run = model.simulate(T_END, t_eval=OUTPUTS)
    torques, speeds = (np.stack([run[f"line.{kind}_{end}"] for end in "ab"], axis=1) for kind in ("tau", "omega"))
    return Ends(torques, speeds)


def by_hand(m: int, rtol: float, t: Array) -> Ends:
    """The usual: half cells at both ends, numpy, DOP853."""
    inertia, stiffness = SECTION.inertia * SECTION.length / m, SECTION.stiffness * m / SECTION.length
    inertias = np.full(m + 1, inertia)
    inertias[[0, -1]] = MOTOR_INERTIA + inertia / 2, LOAD_INERTIA + inertia / 2

    def rhs(_t: float, x: Array) -> Array:
        speeds, torques = x[: m + 1], x[m + 1 :]
        rates = np.empty_like(x)
        rates[0] = RATED_TORQUE - torques[0]
        rates[1:m] = torques[:-1] - torques[1:]
        rates[m] = torques[-1]
        rates[: m + 1] /= inertias
        rates[m + 1 :] = stiffness * (speeds[:-1] - speeds[1:])
        return rates

    atol = rtol * np.repeat([1e-3, RATED_TORQUE], [m + 1, m])
    found = solve_ivp(rhs, (0.0, T_END), np.zeros(2 * m + 1), method="DOP853", t_eval=t, rtol=rtol, atol=atol).y
    # The torques at the ends are those beside the first and last spring and half of an element.
    first = found[m + 1] + inertia / 2 * (RATED_TORQUE - found[m + 1]) / inertias[0]
    last = found[-1] - inertia / 2 * found[-1] / inertias[-1]
    return Ends(np.stack([first, last], axis=1), found[[0, m]].T)


def cpu(call: Callable[[], object], runs: int) -> float:
    """Median process time in s of a call, after two that warm it up."""
    spent = []
    for _ in range(runs + 2):
        start = time.process_time()
        call()
        spent.append(time.process_time() - start)
    return statistics.median(spent[2:])


def compared(sizes: tuple[tuple[str, int], ...] = (("Spectral", 16), ("Lumped", 100)), hand: int = 100) -> None:
    """Print errors and CPU of the models, and of the chain by hand at the loosest tolerance that leaves its own error.

    Args:
        sizes: models with a number of elements, which stand beside the travelling waves.
        hand: elements of the chain by hand.
    """
    t = np.linspace(0.0, T_END, OUTPUTS)
    truth = exact(t)
    print("model                       torques    speeds   CPU in ms")
    costs = {}
    for model in (sw.Wave(), *(getattr(sw, name)(size) for name, size in sizes)):
        compiled = sw.scenes.shaft_step(model).compile()
        errors = by_model(compiled).errors(truth)
        costs[model] = errors, cpu(lambda compiled=compiled: by_model(compiled), 15)
        print(f"{model!s:26}  {errors[0]:.1e}   {errors[1]:.1e}  {1e3 * costs[model][1]:8.2f}")
    own = by_model(sw.scenes.shaft_step(sw.Lumped(hand)).compile()).errors(truth)
    rtol = next(rtol for rtol in RTOLS if by_hand(hand, rtol, t).errors(truth)[0] <= 1.1 * own[0])
    errors, seconds = by_hand(hand, rtol, t).errors(truth), cpu(lambda: by_hand(hand, rtol, t), 3)
    print(f"{f'by hand, m = {hand}, {rtol:.0e}':26}  {errors[0]:.1e}   {errors[1]:.1e}  {1e3 * seconds:8.2f}")
    best = min(cost for (torques, _), cost in costs.values() if torques < 1e-6)
    print(f"the best model at 1e-6: {1e3 * best:.2f} ms, a {seconds / best:.0f}th of the chain by hand")


def long_chain(m: int) -> sw.Network:
    """The damped shaft as m elements."""
    return sw.scenes.shaft_step(sw.Lumped(m), damping=DAMPING * SECTION.stiffness)


def long_chains(sizes: tuple[int, ...] = (100, 300, 1000, 3000, 10000)) -> None:
    """Print set-up, solution, reading, cost of a step, memory and error of long chains by the banded engine."""
    largest = sizes[-1]
    # First of all: a process takes the largest memory of the one that it was forked from for its own.
    whole, solved = memory(largest), memory(largest, read=False)
    print(f"\nmemory at m = {largest}: {whole:.0f} MiB, {solved:.0f} MiB before its torques are read")
    print("     m   set-up in s   solve in s   read in s   steps   ms a step   error")
    truth = end_torques(
        sw.scenes.shaft_step(sw.Spectral(48), damping=DAMPING * SECTION.stiffness).simulate(
            T_END, t_eval=LONG_OUTPUTS, rtol=1e-11
        )
    )
    for m in sizes:
        start = time.process_time()
        compiled = long_chain(m).compile()
        setup = time.process_time() - start
        solving, reading = [], []
        for _ in range(3):
            start = time.process_time()
            run = compiled.simulate(T_END, t_eval=LONG_OUTPUTS, rtol=LONG_RTOL, engine="banded")
            solved = time.process_time()
            found = end_torques(run)
            solving.append(solved - start)
            reading.append(time.process_time() - solved)
        solve, read, steps = statistics.median(solving), statistics.median(reading), run.statistics["steps"]
        error = np.abs(found - truth).max() / np.abs(truth).max()
        step = 1e3 * solve / steps
        print(f"{m:6}   {setup:11.3f}   {solve:10.3f}   {read:9.3f}   {steps:5}   {step:9.3f}   {error:.0e}")


def end_torques(run: sw.Solution) -> Array:
    """(k, 2) in N m."""
    return np.stack([run["line.tau_a"], run["line.tau_b"]], axis=1)


def memory(m: int, *, read: bool = True) -> float:
    """Largest memory in MiB of a process that solves m elements and reads their end torques."""
    code = (
        f"import sys; sys.path.insert(0, {sys.path[0]!r}); import resource, benchmarks.shaft_models as s; "
        f"run = s.long_chain({m}).simulate(s.T_END, t_eval=s.LONG_OUTPUTS, rtol=s.LONG_RTOL, engine='banded'); "
        f"{'s.end_torques(run); ' if read else ''}"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)"
    )
    return float(subprocess.run([sys.executable, "-c", code], check=True, stdout=subprocess.PIPE, text=True).stdout)


def main() -> None:
    """Print both tables."""
    compared()
    long_chains()


if __name__ == "__main__":
    main()
