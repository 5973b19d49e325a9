"""How much CPU does the start of the crane cost at equal true error: Shaftwork, hand-written scipy, hand-written C?

Run `python -m benchmarks.crane_rivals`; it needs gcc. The system is that of Marinkovic 2012, section 3 (two inertias, a
damped spring, a Kloss motor, a smooth travel resistance), 6.5 s with 651 output times. Error: largest deviation of the
shaft torque from DOP853 at 1e-13 on the hand-typed equations, over the largest torque. CPU: process time of one warm
call, median.
"""

from __future__ import annotations

import ctypes
import math
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import sympy
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.integrate._ivp import dop853_coefficients as tableau

import shaftwork as sw
from shaftwork.codegen.taylor.heyoka import build
from shaftwork.integrate.problem import Problem
from shaftwork.integrate.taylor import heyoka_taylor

Array = NDArray[np.float64]
Solve = Callable[[float], Array]
"""From a relative tolerance to the shaft torque in N m at TIMES."""

J1, J2, C, D = 27.35, 62.5, 24206.0, 14.0
TAU_K, S_K, N_SYNC, RATIO, EFFICIENCY = 6.5, 0.506, 3000.0, 35.5, 0.95
TAU_W, OMEGA_S = 22.4, 0.01
PULL_OUT = TAU_K * RATIO * EFFICIENCY
OMEGA_SYNC = N_SYNC * math.pi / 30.0 / RATIO
T_END = 6.5
TIMES = np.linspace(0.0, T_END, 651)
START = np.zeros(3)
SCALE = np.array([1.0, 100.0, 1.0])
"""Size of the states (rad/s, N m, rad/s): absolute tolerances are the relative one times this."""

RTOLS = tuple(10.0 ** (-exponent / 2) for exponent in range(6, 24))


def rhs(_t: float, y: Array) -> list[float]:
    """The equations by hand: speed of J1, torque of the spring, speed of J2."""
    omega_1, spring, omega_2 = y.tolist()
    slip = 1.0 - omega_1 / OMEGA_SYNC
    motor = 2.0 * PULL_OUT * slip * S_K / (slip * slip + S_K * S_K)
    twist_rate = omega_1 - omega_2
    shaft = spring + D * twist_rate
    return [(motor - shaft) / J1, C * twist_rate, (shaft - TAU_W * math.tanh(omega_2 / OMEGA_S)) / J2]


def shaft_torque(states: Array) -> Array:
    """Torque that J1 gives to J2, from states of shape (3, k)."""
    return np.asarray(states[1] + D * (states[0] - states[2]))


def scipy_dop853(rtol: float) -> Array:
    """Hand-written numpy and scipy."""
    solution = solve_ivp(rhs, (0.0, T_END), START, method="DOP853", t_eval=TIMES, rtol=rtol, atol=rtol * SCALE)
    return shaft_torque(solution.y)


def reference() -> Array:
    """The truth that errors are measured against."""
    return scipy_dop853(1e-13)


def tableau_header() -> str:
    """The coefficients of DOP853 as sums over the non-zero ones, for dop853.c."""
    rows = {f"STAGE_{stage}": tableau.A[stage] for stage in range(1, tableau.N_STAGES_EXTENDED) if stage != 12}
    rows |= {"SOLUTION": tableau.B, "ERROR_3": tableau.E3, "ERROR_5": tableau.E5}
    rows |= {f"DENSE_{row}": weights for row, weights in enumerate(tableau.D)}
    lines = []
    for name, weights in rows.items():
        terms = (f"({weight.hex()}) * (k)[{stage}][i]" for stage, weight in enumerate(weights.tolist()) if weight)
        lines.append(f"#define {name}(k, i) ({' + '.join(terms)})\n")
    return "".join(lines)


class _Crane(ctypes.Structure):
    _fields_ = tuple(
        (name, ctypes.c_double)
        for name in ("J1", "J2", "c", "d", "pull_out", "slip_k", "omega_sync", "tau_w", "omega_s")
    )


class Counts(ctypes.Structure):
    """Steps, rejected steps and calls of the right-hand side of one run of the C program."""

    _fields_ = tuple((name, ctypes.c_long) for name in ("steps", "rejected", "rhs"))


def c_dop853(times: Array = TIMES) -> tuple[Solve, Counts]:
    """Compile dop853.c; the solver, its torque at some times in s, and the counts that its latest call left behind.

    Raises:
        RuntimeError: when a call's step size underflows.
    """
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "dop853_tableau.h").write_text(tableau_header(), encoding="ascii")
        library = Path(folder, "crane.so")
        source = Path(__file__).with_name("dop853.c")
        flags = ["-O3", "-march=native", "-shared", "-fPIC", f"-I{folder}"]
        subprocess.run(["gcc", *flags, "-o", library, source, "-lm"], check=True)
        run = ctypes.CDLL(str(library)).crane_start
    doubles = np.ctypeslib.ndpointer(np.float64, flags="C")
    number, pointer = ctypes.c_double, ctypes.POINTER
    run.argtypes = [
        pointer(_Crane), doubles, number, number, number, doubles, doubles, ctypes.c_int, doubles, pointer(Counts)
    ]  # fmt: skip
    crane = _Crane(J1, J2, C, D, PULL_OUT, S_K, OMEGA_SYNC, TAU_W, OMEGA_S)
    states, counts = np.empty((times.size, 3)), Counts()

    def solve(rtol: float) -> Array:
        if run(crane, START, 0.0, T_END, rtol, rtol * SCALE, times, times.size, states, counts):
            message = f"the step size underflows at rtol {rtol:g}"
            raise RuntimeError(message)
        return shaft_torque(states.T)

    return solve, counts


def crane_model() -> sw.Model:
    """The crane wired as a user wires it."""
    net = sw.Network("crane travel")
    motor = sw.KlossMotor("motor", tau_k=TAU_K, s_k=S_K, n_sync=N_SYNC, ratio=RATIO, efficiency=EFFICIENCY)
    net.add(motor, "rotor")
    net.add(sw.Inertia("J1", J=J1), "rotor")
    net.add(sw.Spring("shaft", c=C, d=D), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=J2), "wheel")
    net.add(sw.TorqueSource("load", tau=-TAU_W * sympy.tanh(sw.omega / OMEGA_S)), "wheel")
    return net.compile()


def shaftwork_simulate(engine: str = "auto") -> Solve:
    """The public call on a compiled model, and reading the torque of the shaft."""
    model = crane_model()

    def solve(rtol: float) -> Array:
        return np.asarray(model.simulate(t_end=T_END, rtol=rtol, t_eval=TIMES, engine=engine)["shaft.tau"])

    return solve


def shaftwork_engine() -> Solve:
    """The Taylor engine alone on the same model: from a prepared problem to states at the output times."""
    model = crane_model()
    assert model.rows is not None
    program = build(model.rows.states, sw.t, model.rows.parameters, model.rows.rates).bind(model.defaults)

    def solve(rtol: float) -> Array:
        problem = Problem(
            rhs=model.rhs,
            jacobian=None,
            x0=START,
            t0=0.0,
            t_end=T_END,
            names=model.states,
            atol=rtol * SCALE,
            rtol=rtol,
            t_eval=TIMES,
            symbolic=program,
        )
        omega_1, omega_2, spring = heyoka_taylor.solve(problem).x.T
        return shaft_torque(np.array([omega_1, spring, omega_2]))

    return solve


@dataclass(frozen=True)
class Point:
    """What one tolerance gave.

    Args:
        rtol: the tolerance asked for.
        error: largest deviation from the truth over the largest torque.
        cpu: CPU of one warm call in s, median.
    """

    rtol: float
    error: float
    cpu: float


def cpu_of(call: Callable[[], object], samples: int = 9, shortest: float = 0.02) -> float:
    """CPU of one warm call in s: median of samples that each last `shortest` seconds of CPU or one call."""
    start = time.process_time()
    call()
    calls = max(1, math.ceil(shortest / max(time.process_time() - start, 1e-6)))
    spent = []
    for _ in range(samples):
        start = time.process_time()
        for _ in range(calls):
            call()
        spent.append((time.process_time() - start) / calls)
    return statistics.median(spent)


def work_precision(
    solve: Solve, truth: Array, rtols: Sequence[float] = RTOLS, samples: int = 9, scale: float | None = None
) -> tuple[Point, ...]:
    """True error, as part of the largest true value or of a scale, and CPU of one solver over a range of tolerances."""
    largest = float(np.max(np.abs(truth))) if scale is None else scale
    solve(rtols[0])
    return tuple(
        Point(rtol, float(np.max(np.abs(solve(rtol) - truth))) / largest, cpu_of(lambda r=rtol: solve(r), samples))
        for rtol in rtols
    )


def cpu_at(points: Sequence[Point], error: float) -> float:
    """CPU in s that reaches a true error, interpolated between the cheapest points (logarithms of both).

    A solver whose cheapest point is more accurate already is taken there; one that never reaches the error costs
    infinity.
    """
    front: list[Point] = []
    for point in sorted(points, key=lambda point: (point.cpu, point.error)):
        if not front or point.error < front[-1].error:
            front.append(point)
    if front[-1].error > error:
        return math.inf
    front.reverse()
    errors, cpus = (np.log([getattr(point, name) for point in front]) for name in ("error", "cpu"))
    return float(np.exp(np.interp(math.log(error), errors, cpus)))


def main() -> None:
    """Print every solver's points, then the CPU at equal errors."""
    truth = reference()
    solvers = {
        "C DOP853": c_dop853()[0],
        "scipy DOP853": scipy_dop853,
        "Shaftwork, engine": shaftwork_engine(),
        "Shaftwork, model.simulate": shaftwork_simulate(),
    }
    curves = {name: work_precision(solve, truth) for name, solve in solvers.items()}
    for name, points in curves.items():
        print(f"\n{name}\n      rtol     error    CPU ms")
        for point in points:
            print(f"  {point.rtol:8.1e}  {point.error:8.1e}  {1e3 * point.cpu:8.4f}")
    print("\nCPU in ms at a true error of")
    for error in (1e-6, 1e-8, 1e-9):
        row = "   ".join(f"{name} {1e3 * cpu_at(points, error):.4f}" for name, points in curves.items())
        print(f"  {error:.0e}   {row}")


if __name__ == "__main__":
    main()
