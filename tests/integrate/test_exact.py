"""The exact engine against closed modal solutions and arbitrary precision."""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction

import mpmath
import numpy as np
import pytest
from scipy import sparse

import shaftwork as sw
from shaftwork.integrate.linear import linear_system, propagation
from shaftwork.integrate.linear.linear_system import find_modes
from shaftwork.integrate.linear.precise import FixedPoint
from shaftwork.integrate.problem import LinearInputs, Problem


def linear_problem(matrix, forcing, start, times, **options) -> Problem:
    matrix = sparse.csr_array(matrix)
    n = matrix.shape[0]
    return Problem(
        rhs=lambda t, x: matrix @ x + forcing(t),
        jacobian=lambda _t, _x: matrix.tocsc(),
        x0=np.asarray(start, dtype=float),
        t0=float(times[0]),
        t_end=float(times[-1]),
        names=tuple(f"x{i}" for i in range(n)),
        atol=np.full(n, 1e-12),
        t_eval=times,
        linear=LinearInputs(matrix, forcing),
        **options,
    )


def chain(n, stiffness, times, damping=0.0) -> Problem:
    """Inertias of 1 kg m2 in a row, a torque of 1 N m on the first: speeds, then spring torques."""
    difference = sparse.diags_array([np.ones(n - 1), -np.ones(n - 1)], offsets=[0, 1], shape=(n - 1, n))
    matrix = sparse.block_array(
        [[-damping * (difference.T @ difference), -difference.T], [stiffness * difference, None]]
    )
    torque = np.eye(1, 2 * n - 1)[0]
    return linear_problem(matrix, lambda _t: torque, np.zeros(2 * n - 1), times)


def chain_solution(n, stiffness, times):
    """Closed form: a chain's stiffness matrix is Toeplitz, its modes are cosines."""
    mode = np.arange(1, n)
    frequency = 2 * np.sqrt(stiffness) * np.sin(mode * np.pi / (2 * n))
    shapes = np.sqrt(2 / n) * np.cos(np.pi * np.outer(np.arange(n) + 0.5, mode) / n)
    angle = np.outer(times, frequency)
    speeds = times[:, None] / n + (shapes[0] * np.sin(angle) / frequency) @ shapes.T
    angles = (shapes[0] * 2 * np.sin(angle / 2) ** 2 / frequency**2) @ shapes.T
    return speeds, stiffness * (angles[:, :-1] - angles[:, 1:])


@pytest.mark.parametrize(("n", "end"), [(2, 100.0), (5, 100.0), (20, 100.0)])
def test_a_chain_is_right_after_thousands_of_periods(n, end):
    # The fastest mode turns through 2e4 rad; rounding its frequency alone (1e-16) costs 2e-12 of that.
    times = np.linspace(0.0, end, 201)
    trajectory = propagation.solve(chain(n, 1e4, times))
    speeds, torques = chain_solution(n, 1e4, times)
    assert np.abs(trajectory.x[:, :n] - speeds).max() < 1e-11 * np.abs(speeds).max()
    assert np.abs(trajectory.x[:, n:] - torques).max() < 1e-11 * np.abs(torques).max()


@pytest.mark.slow
def test_a_long_chain_is_solved_by_sparse_products():
    times = np.linspace(0.0, 0.2, 201)
    problem = chain(1000, 1e6, times)
    assert problem.linear is not None
    assert not propagation.prefers_dense(problem, problem.linear)
    trajectory = propagation.solve(problem)
    speeds, torques = chain_solution(1000, 1e6, times)
    assert np.abs(trajectory.x[:, :1000] - speeds).max() < 1e-11 * np.abs(speeds).max()
    assert np.abs(trajectory.x[:, 1000:] - torques).max() < 1e-11 * np.abs(torques).max()
    middle = np.array([0.05 + 1e-4, 0.1 + 1e-4])
    expected = chain_solution(1000, 1e6, middle)[0]
    assert np.abs(trajectory.dense(middle)[:, :1000] - expected).max() < 1e-11 * np.abs(speeds).max()


CASES = {
    "rigid body": np.array([[0.0, 1.0], [0.0, 0.0]]),
    "defective": np.array([[-2.0, 1.0, 0.0], [0.0, -2.0, 1.0], [0.0, 0.0, -2.0]]),
    "stiff": np.array([[-1e6, 1e3, 0.0], [1.0, -1.0, 2.0], [0.0, -2.0, -0.1]]),
    "badly scaled": np.array([[-1e-3, 1e-8], [-1e9, 0.0]]),
    "zero": np.zeros((2, 2)),
}


@pytest.mark.parametrize("name", CASES)
def test_a_ramp_is_propagated_as_in_arbitrary_precision(name):
    matrix = CASES[name]
    n = len(matrix)
    level, slope, start = np.arange(1.0, n + 1), np.arange(n, 0.0, -1), np.ones(n)
    # Steps that are neither equal nor round, and a pair of equal ones.
    times = np.array([0.0, 0.3, 0.61, 0.92, 1.7, 2.0])
    trajectory = propagation.solve(linear_problem(matrix, lambda t: level + slope * t, start, times))
    augmented = mpmath.matrix(n + 2)
    for i in range(n):
        for j in range(n):
            augmented[i, j] = mpmath.mpf(matrix[i, j])
        augmented[i, n], augmented[i, n + 1] = slope[i], level[i]
    augmented[n, n + 1] = 1
    with mpmath.workdps(60):
        begin = mpmath.matrix([*start, 0, 1])
        rows = [mpmath.expm(augmented * mpmath.mpf(t), method="taylor") * begin for t in times]
    expected = np.array([[float(row[i]) for i in range(n)] for row in rows])
    assert (np.abs(trajectory.x - expected).max(axis=0) < 1e-11 * np.abs(expected).max(axis=0)).all()


def test_dense_and_sparse_propagation_agree(monkeypatch):
    times = np.linspace(0.0, 2.0, 101)
    problem = chain(15, 1e3, times, damping=0.5)
    found = []
    for dense in (True, False):
        monkeypatch.setattr(propagation, "prefers_dense", lambda *_, dense=dense: dense)
        found.append(propagation.solve(problem).x)
    assert np.abs(found[0] - found[1]).max() < 1e-11 * np.abs(found[0]).max()


def test_the_matrix_exponential_replaces_modes_that_are_of_no_use(monkeypatch):
    times = np.linspace(0.0, 2.0, 101)
    problem = chain(15, 1e3, times, damping=0.5)
    by_modes = propagation.solve(problem)
    monkeypatch.setattr(linear_system, "find_modes", lambda _matrix: None)
    by_exponential = propagation.solve(problem)
    assert np.abs(by_modes.x - by_exponential.x).max() < 1e-11 * np.abs(by_modes.x).max()
    asked = np.linspace(0.013, 1.99, 57)
    assert np.abs(by_modes.dense(asked) - by_exponential.dense(asked)).max() < 1e-11 * np.abs(by_modes.x).max()


@pytest.mark.slow
def test_output_times_whose_steps_grow_by_a_rounding_each_are_met(monkeypatch):
    times = np.linspace(0.0, 1.0, 20001)
    times += 1e-16 * np.arange(times.size) ** 2
    monkeypatch.setattr(linear_system, "find_modes", lambda _matrix: None)
    trajectory = propagation.solve(chain(3, 1e4, times))
    speeds, _ = chain_solution(3, 1e4, times)
    assert np.abs(trajectory.x[:, :3] - speeds).max() < 1e-11 * np.abs(speeds).max()


def test_its_own_grid_is_refined_nowhere_and_needs_no_output_times():
    problem = chain(3, 1e2, np.linspace(0.0, 1.0, 11))
    trajectory = propagation.solve(replace(problem, t_eval=None))
    speeds, _ = chain_solution(3, 1e2, trajectory.t)
    assert np.abs(trajectory.x[:, :3] - speeds).max() < 1e-12


MODELS = [
    sw.OneSpring(),
    sw.Lumped(10),
    sw.Lumped(40),
    sw.Lumped(100),
    sw.CentralDifference(40),
    pytest.param(sw.CentralDifference(20, order=4), marks=pytest.mark.slow),
    pytest.param(sw.Spectral(16), marks=pytest.mark.slow),
]


@pytest.mark.parametrize("load", [0.11, pytest.param(0.025, marks=pytest.mark.slow)])
@pytest.mark.parametrize("model", MODELS, ids=str)
def test_a_lossless_shaft_keeps_its_energy_for_100000_periods(model, load):
    """The shaft of Popenda 2019. The first mode turns 1e5 times, the highest 1e7 times and more."""
    shaft = sw.Shaft("line", length=1.8, diameter=0.028, density=7860.0, shear_modulus=77.5e9, model=model)
    net = sw.Network("free")
    net.add(sw.Inertia("Je", J=0.025), "a")
    net.add(shaft, "a", "b")
    net.add(sw.Gear("gear", ratio=2.0), "b", "c")
    net.add(sw.Inertia("Jm", J=4 * load), "c")
    period = 1 / min(f for f in net.modes().frequencies if f > 1.0)
    late = np.append(0.0, 1e5 * period + np.linspace(0.0, period, 50))
    run = net.simulate(late[-1], t_eval=late, engine="exact", initial={"Je.omega": 1.0})
    # Each state is as exact as its frequency; only the roundings of the sum of squares are left.
    stored = run.energy.stored
    assert np.abs(stored - stored[0]).max() < 1e-13 * stored[0]
    assert run.energy_residual < 1e-13


def test_the_modes_of_a_lossless_network_lose_nothing_and_are_complete():
    """A chain with more torques than speeds and one with more speeds than torques, side by side: three at rest."""
    held = np.array([[1.0, -1.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0], [0.0, 1.0, -1.0], [1.0, 0.0, 0.0]])
    free = np.array([[1.0, -1.0, 0.0], [0.0, 5.0, -5.0]])
    coupling = np.block([[held, np.zeros((5, 3))], [np.zeros((2, 3)), free]])
    inertias, springs = np.geomspace(1e-3, 10.0, 6), np.geomspace(1e2, 1e6, 7)
    matrix = np.zeros((13, 13))
    matrix[:6, 6:], matrix[6:, :6] = -coupling.T / inertias[:, None], springs[:, None] * coupling
    modes = find_modes(matrix)
    assert modes is not None
    assert (modes.values.real == 0.0).all()
    assert (modes.values == 0.0).sum() == 3
    again = ((modes.vectors * modes.values) @ modes.inverse).real
    assert np.abs(again - matrix).max() < 1e-13 * np.abs(matrix).max()
    assert np.abs((modes.vectors @ modes.inverse).real - np.eye(13)).max() < 1e-13


@pytest.mark.parametrize("spoilt", [(0, 0), (0, 1), (2, 0)], ids=["damping", "one-sided", "ring of speeds"])
def test_what_is_not_lossless_keeps_its_own_decay(spoilt):
    matrix = np.array([[0.0, -1.0, 0.0], [4.0, 0.0, -2.0], [0.0, 3.0, 0.0]])
    matrix[spoilt] -= 0.5
    modes = find_modes(matrix)
    assert modes is not None
    expected = np.linalg.eigvals(matrix)
    assert np.abs(modes.values.real).max() == pytest.approx(np.abs(expected.real).max(), abs=1e-14)


def test_what_nothing_drives_stays_in_whole_numbers() -> None:
    """A matrix of zeros has no rate that would say how long a unit of time is."""
    kept = FixedPoint(np.array([[Fraction(0), Fraction(0)], [Fraction(0), Fraction(0)]], dtype=object), 3.0)
    assert kept.squares == 2  # of units of 2 s
