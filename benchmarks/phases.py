"""How much CPU does the crane with gap and brake cost at equal true error: every engine, and scipy by hand?

Run `python -m benchmarks.phases`. 62 events in 10 s; the rival is benchmarks/scipy_events.py, the truth has 40 digits.
Error: largest of the end state (speeds in rad/s, twist in 0.01 rad). CPU: process time of one warm public call with two
output times, median. A run that finds another number of events counts as wrong, whatever it says.
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Callable, Sequence

import numpy as np

import shaftwork as sw
from benchmarks import scipy_events as rival
from benchmarks.heyoka_events import BareCrane
from benchmarks.scipy_events import RTOLS, SCALE, Point

Run = Callable[[float], tuple[int, np.ndarray]]
"""From a relative tolerance to the number of events and the end state."""
ENGINES = ("heyoka", "scipy", "sundials", "scipy-radau")
FEW = (1e-3, 1e-6, 1e-8, 1e-10, 1e-12)
RADAU = (1e-3, 1e-6, 1e-8)
"""Its formulas are of order 5: tighter tolerances cost seconds."""
RTOL, ROUNDS, QUIET = 1e-7, 300, 0.1
"""Of the comparison with bare heyoka; the part of the fastest runs that is taken as undisturbed by other programs."""


def crane_model() -> sw.Model:
    """The crane wired as a user wires it."""
    net = sw.Network("crane")
    motor = sw.KlossMotor(
        "motor",
        tau_k=rival.TAU_K,
        s_k=rival.S_K,
        n_sync=rival.N_SYNC,
        ratio=rival.RATIO,
        efficiency=rival.EFFICIENCY,
        t_off=rival.T_BRAKE,
    )
    net.add(motor, "rotor")
    net.add(sw.Inertia("J1", J=rival.J1), "rotor")
    net.add(sw.Brake("brake", tau=rival.TAU_BRAKE, t_on=rival.T_BRAKE), "rotor")
    net.add(sw.Backlash("gap", gap=2.0 * rival.HALF_GAP, c=rival.C, d=rival.D), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=rival.J2), "wheel")
    net.add(sw.CoulombLoad("load", tau=rival.TAU_LOAD), "wheel")
    return net.compile()


def shaftwork(model: sw.Model, engine: str) -> Run:
    """The public call of one engine."""

    def run(rtol: float) -> tuple[int, np.ndarray]:
        sol = model.simulate(t_end=rival.T_END, engine=engine, rtol=rtol, t_eval=2)
        return len(sol.events), np.array([sol[name][-1] for name in ("J1.omega", "J2.omega", "gap.phi")])

    return run


def scipy_by_hand(max_step: float) -> Run:
    """scipy's DOP853 with terminal events."""

    def run(rtol: float) -> tuple[int, np.ndarray]:
        events, end = rival.crane(rtol, max_step)
        return len(events), end

    return run


def points(run: Run, rtols: Sequence[float], samples: int = 3) -> tuple[Point, ...]:
    """What every tolerance gave; an infinite error where it failed or lost an event."""
    count, truth = rival.truth()
    made = []
    for rtol in rtols:
        spent, events, error = [], 0, math.inf
        try:
            run(rtol)
            for _ in range(samples):
                start = time.process_time()
                events, end = run(rtol)
                spent.append(time.process_time() - start)
        except RuntimeError:
            spent = [math.nan]
        else:
            error = float(np.max(np.abs(end - truth) / SCALE)) if events == count else math.inf
        made.append(Point(rtol, events, error, statistics.median(spent)))
    return tuple(made)


def cheapest(curve: Sequence[Point], error: float) -> float:
    """CPU in s of the cheapest run with at most this error; infinite if there is none."""
    return min((point.cpu for point in curve if point.error <= error), default=math.inf)


def beside_bare_heyoka(model: sw.Model) -> str:
    """CPU of the public call and of bare heyoka, in turn: what disturbs one disturbs the other."""
    runs: tuple[Run, ...] = shaftwork(model, "auto"), BareCrane()
    spent: tuple[list[float], ...] = [], []
    for _ in range(ROUNDS):
        for run, times in zip(runs, spent, strict=True):
            start = time.process_time()
            run(RTOL)
            times.append(time.process_time() - start)
    (call, bare), (calm, bare_calm) = (
        [1e3 * sorted(times)[int(part * ROUNDS)] for times in spent] for part in (0.5, QUIET)
    )
    return (
        f"heyoka: {call:.2f} ms a call, {bare:.2f} ms bare, ratio {call / bare:.1f}; "
        f"undisturbed {calm:.2f} and {bare_calm:.2f} ms, ratio {calm / bare_calm:.1f}"
    )


def main() -> None:
    """Print the comparison with bare heyoka, every engine's points, then the CPU at equal errors."""
    model = crane_model()
    print(beside_bare_heyoka(model))
    curves = {f"scipy by hand, steps up to {step:g} s": points(scipy_by_hand(step), RTOLS) for step in (math.inf, 0.01)}
    for engine in ENGINES:
        rtols = {"heyoka": RTOLS, "scipy-radau": RADAU}.get(engine, FEW)
        curves[f"Shaftwork, {engine}"] = points(shaftwork(model, engine), rtols)
    for name, curve in curves.items():
        print(f"\n{name}\n      rtol  events    error     CPU ms")
        for point in curve:
            verdict = f"{point.error:7.0e}" if math.isfinite(point.error) else "  wrong"
            print(f"  {point.rtol:8.0e}  {point.events:6}  {verdict}  {1e3 * point.cpu:9.2f}")
    by_hand = [name for name in curves if name.startswith("scipy")]
    print("\nCPU in ms at a true error of, and how many times less than the faster run of scipy by hand")
    for error in (1e-6, 1e-8, 1e-9):
        best = min(cheapest(curves[name], error) for name in by_hand)
        print(f"  {error:.0e}  {'scipy by hand':24} {1e3 * best:9.2f}")
        for name, curve in curves.items():
            if name not in by_hand and math.isfinite(cost := cheapest(curve, error)):
                print(f"         {name:24} {1e3 * cost:9.2f}  {best / cost:6.2f}")


if __name__ == "__main__":
    main()
