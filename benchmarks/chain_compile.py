"""How much CPU and memory does a chain wired part by part cost, from the parts to the compiled model and its Jacobian?

Run `python -m benchmarks.chain_compile`. The chain has n inertias and n - 1 damped springs under a torque step at its
first inertia. CPU: process time, median; memory: the largest of a process of its own. The motion is compared with the
modal solution in closed form.
"""

from __future__ import annotations

import resource
import statistics
import subprocess
import sys
import time

import numpy as np

import shaftwork as sw

J, C, BETA, TAU = 0.1, 1e4, 1e-6, 1.0
SIZES = (20, 1000, 10000)


def wired(n: int) -> sw.Network:
    """The chain, part by part."""
    net = sw.Network("chain")
    net.add(sw.TorqueSource("motor", tau=TAU), "n0")
    net.add(sw.Inertia("J0", J=J), "n0")
    for k in range(1, n):
        net.add(sw.Spring(f"s{k}", c=C, d=BETA * C), f"n{k - 1}", f"n{k}")
        net.add(sw.Inertia(f"J{k}", J=J), f"n{k}")
    return net


def ready(n: int) -> sw.Model:
    """From the parts to a model whose right-hand side and Jacobian have been evaluated."""
    model = wired(n).compile()
    x = np.zeros(len(model.states))
    model.rhs(0.0, x)
    model.jacobian(0.0, x)
    return model


def cpu(n: int, runs: int) -> float:
    """Median CPU in s of `ready`."""
    spent = []
    for _ in range(runs):
        start = time.process_time()
        ready(n)
        spent.append(time.process_time() - start)
    return statistics.median(spent)


def exact_speeds(n: int, t: np.ndarray) -> np.ndarray:
    """Speeds (times, n) of the chain by its cosine modes."""
    k = np.arange(n)
    frequency = 2 * np.sqrt(C / J) * np.sin(np.pi * k / (2 * n))
    place = np.arange(n)[:, None]
    shape = np.cos(np.pi * k * (place + 0.5) / n)
    weight = shape[0] * np.where(k == 0, 1.0, 2.0) / (n * J) * TAU
    decay = BETA * frequency**2 / 2
    swing = np.sqrt(np.maximum(frequency**2 - decay**2, 1e-300))
    amplitude = np.where(
        k == 0, t[:, None], np.exp(-decay * t[:, None]) * np.sin(swing * t[:, None]) / np.where(k == 0, 1.0, swing)
    )
    return np.asarray((amplitude * weight) @ shape.T)


def peak_memory(n: int) -> float:
    """Largest memory in MiB of a process that makes the model of n inertias."""
    code = f"import sys; sys.path.insert(0, {sys.path[0]!r}); from benchmarks.chain_compile import ready; ready({n})"
    subprocess.run([sys.executable, "-c", code], check=True)
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024


def main() -> None:
    """Print CPU, growth, memory and the error of the motion."""
    ready(5)
    spent = {n: cpu(n, 9 if n < 5000 else 3) for n in SIZES}
    for n, seconds in spent.items():
        print(f"n = {n:6}: {seconds:8.4f} s CPU")
    print(f"growth from {SIZES[1]} to {SIZES[2]}: {spent[SIZES[2]] / spent[SIZES[1]]:.1f}-fold")
    print(f"memory at n = {SIZES[2]}: {peak_memory(SIZES[2]):.0f} MiB")
    for n in SIZES[:2]:
        model = ready(n)
        start = time.process_time()
        sol = model.simulate(0.2, t_eval=201)
        seconds = time.process_time() - start
        truth = exact_speeds(n, sol.t)
        error = np.abs(sol.x[:, :n] - truth).max() / np.abs(truth).max()
        print(f"n = {n}: 0.2 s of motion, engine {sol.engine}, {seconds:.3f} s CPU, error {error:.1e} of the largest")


if __name__ == "__main__":
    main()
