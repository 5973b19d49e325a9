"""The banded engine against modal solutions, the continuous shaft, closed forms and other engines."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import networkx as nx
import numpy as np
import pytest
from scipy import sparse
from scipy.optimize import brentq

import shaftwork as sw
from shaftwork.core.errors import ParameterError, SimulationError
from shaftwork.integrate import choice, scipy_ivp, stepping
from shaftwork.integrate.collocation import banded
from shaftwork.integrate.collocation.banded_stages import shifted_collocation
from shaftwork.integrate.collocation.shifted_matrix import ShiftedMatrix
from shaftwork.integrate.linear import propagation
from shaftwork.integrate.problem import LinearInputs, Problem

# A steel shaft of 1 m and 20 mm between a motor and a load: polar moment, inertia, torsional stiffness.
POLAR = np.pi * 0.02**4 / 32
INERTIA, STIFFNESS = 7900.0 * POLAR, 77.5e9 * POLAR
MOTOR, LOAD, TORQUE = 0.11, 0.025, 12.7
DAMPING_TIME = 1e-6


def chain_matrix(m, damping_time=DAMPING_TIME):
    """A, inertias and stiffness of the shaft as m springs between m + 1 inertias: speeds, then spring torques."""
    inertias = np.full(m + 1, INERTIA / m)
    inertias[[0, -1]] = inertias[[0, -1]] / 2 + [MOTOR, LOAD]
    stiffness = STIFFNESS * m
    difference = sparse.diags_array([np.ones(m), -np.ones(m)], offsets=[0, 1], shape=(m, m + 1))
    per_inertia = sparse.diags_array(1 / inertias)
    damping = -damping_time * stiffness * per_inertia @ difference.T @ difference
    matrix = sparse.block_array([[damping, -per_inertia @ difference.T], [stiffness * difference, None]], format="csr")
    return matrix, inertias, stiffness


def shaft(m, *, rtol=1e-6, damping_time=DAMPING_TIME, outputs=201, linear=True) -> Problem:
    """0.2 s of the shaft under a step of the motor torque."""
    matrix, inertias, stiffness = chain_matrix(m, damping_time)
    push = np.zeros(2 * m + 1)
    push[0] = TORQUE / inertias[0]
    carried = max(np.sqrt(stiffness * np.median(inertias)), damping_time * stiffness)
    return Problem(
        rhs=lambda _t, x: matrix @ x + push,
        jacobian=lambda _t, _x: matrix.tocsc(),
        x0=np.zeros(2 * m + 1),
        t0=0.0,
        t_end=0.2,
        names=tuple(f"x{k}" for k in range(2 * m + 1)),
        atol=rtol * 1e-3 * np.concatenate([np.ones(m + 1), np.full(m, carried)]),
        rtol=rtol,
        t_eval=np.linspace(0.0, 0.2, outputs),
        linear=LinearInputs(matrix, lambda _t: push) if linear else None,
    )


def torques(x, damping_time=DAMPING_TIME):
    """Torques (k, m) of the springs with the dampers beside them, from states (k, 2 m + 1)."""
    m = x.shape[1] // 2
    return x[:, m + 1 :] + damping_time * STIFFNESS * m * (x[:, :m] - x[:, 1 : m + 1])


def continuous_torque(place, times, modes=150):
    """Torque at a place of the continuous, internally damped shaft, by its modes and the static torque."""
    speed = np.sqrt(STIFFNESS / INERTIA)

    def condition(k):
        a, b = MOTOR / INERTIA, LOAD / INERTIA
        return (a * b * k * k - 1) * np.sin(k) - (a + b) * k * np.cos(k)

    # The slow mode of two masses on a spring, then one near each multiple of pi.
    edges = np.concatenate([[1e-3], np.pi * (np.arange(modes) + 0.5)])
    k = np.array([brentq(condition, low, high, xtol=1e-14) for low, high in pairwise(edges)])
    omega = k * speed
    weight = MOTOR / INERTIA * k
    mass = INERTIA * ((1 + weight**2) / 2 + (1 - weight**2) * np.sin(2 * k) / (4 * k) - weight * np.sin(k) ** 2 / k)
    mass += MOTOR + LOAD * (np.cos(k) - weight * np.sin(k)) ** 2
    slope = -k * (np.sin(k * place) + weight * np.cos(k * place))
    share = -STIFFNESS * slope * TORQUE / (mass * omega**2)
    decay = DAMPING_TIME * omega**2 / 2
    swing = np.sqrt(omega**2 - decay**2)
    angle = np.multiply.outer(times, swing)
    swinging = np.exp(-np.multiply.outer(times, decay)) * (np.cos(angle) - decay / swing * np.sin(angle))
    return TORQUE * (1 - (MOTOR + INERTIA * place) / (MOTOR + LOAD + INERTIA)) - swinging @ share


def one_step(method, z):
    """What a step makes of x' = z x, x = 1 over a step of 1: at its end, and in its middle by dense output."""
    half = len(method.poles)
    right = method.to_modes.sum(axis=1) * z
    upper = (right[:half] + 1j * right[half:]) / (method.poles - z)
    lower = (right[:half] - 1j * right[half:]) / (method.poles.conj() - z)
    modes = np.concatenate([(upper + lower) / 2, (upper - lower) / 2j])
    inside = method.increments(0.5)[0] @ modes + method.bump(0.5)[0] * (z - method.at_start @ modes)
    return 1 + method.at_end[0] @ modes, 1 + inside


@pytest.mark.parametrize(("family", "order"), [("radau", 11), ("gauss", 12)])
def test_a_step_has_the_order_of_its_family_and_dense_output_order_seven(family, order):
    method = shifted_collocation(family, 6)
    errors = [np.abs(one_step(method, 1j * angle) - np.exp(1j * angle * np.array([1.0, 0.5]))) for angle in (2.0, 1.0)]
    end, inside = np.log2(errors[0] / errors[1])
    # The error of one step is an order higher; at an angle of 2 the next term of its series still shows.
    assert abs(end - (order + 1)) < 0.3
    assert abs(inside - 8) < 0.3


@pytest.mark.parametrize("decay", [1e3, 1e6, 1e9])
def test_what_is_too_stiff_dies_out_in_one_step_of_radau(decay):
    # The last coefficients of its two polynomials let R(z) tend to -6 / |z|.
    assert abs(one_step(shifted_collocation("radau", 6), -decay)[0]) < 7 / decay


@pytest.mark.parametrize("angle", [0.1, 3.0, 1e2, 1e5])
def test_gauss_keeps_the_amplitude_of_any_oscillation(angle):
    # Rounding in the eigenvectors of the stage equations is amplified by their condition, about 300.
    assert abs(abs(one_step(shifted_collocation("gauss", 6), 1j * angle)[0]) - 1) < 1e-12


def tree_matrix(graph, damping):
    """Unit inertias on the nodes of a graph, springs with dampers on its edges."""
    difference = nx.incidence_matrix(graph, oriented=True).T
    matrix = sparse.block_array([[-damping * (difference.T @ difference), -difference.T], [difference, None]])
    return sparse.csc_array(matrix)


def star(arms, cells):
    graph = nx.Graph()
    for arm in range(arms):
        nx.add_path(graph, [0, *(1 + arm * cells + cell for cell in range(cells))])
    return graph


RANDOM = np.random.default_rng(5)
SHUFFLED = nx.relabel_nodes(nx.path_graph(300), dict(enumerate(RANDOM.permutation(300).tolist())))
MATRICES = {
    "path": tree_matrix(nx.path_graph(300), 0.1),
    "undamped path": tree_matrix(nx.path_graph(300), 0.0),
    "shuffled path": tree_matrix(SHUFFLED, 0.1),
    "wide star": tree_matrix(star(60, 10), 0.1),
    "hub": tree_matrix(nx.star_graph(80), 0.0),
    "tree": tree_matrix(nx.balanced_tree(3, 4), 0.1),
    "random": sparse.csc_array(sparse.random_array((200, 200), density=0.02, rng=RANDOM)),
    "full": sparse.csc_array(RANDOM.standard_normal((12, 12))),
    "integrators": sparse.csc_array(np.diag(np.ones(9), 1)),
    "oscillator": sparse.csc_array(np.array([[0.0, 1.0], [-4.0, -0.1]])),
    "two speeds": sparse.csc_array(np.array([[-2.0, 1.0], [1.0, -2.0]])),
    "one": sparse.csc_array(np.array([[-3.0]])),
    "nothing": sparse.csc_array((3, 3)),
}


@pytest.mark.parametrize("name", MATRICES)
def test_a_shifted_matrix_is_solved_whatever_its_graph(name):
    matrix = MATRICES[name]
    shifted = ShiftedMatrix(matrix)
    for shift in (1 + 2j, 30 - 4j, 200 + 0.3j):
        right = RANDOM.standard_normal(matrix.shape[0]) + 1j * RANDOM.standard_normal(matrix.shape[0])
        solution = shifted.factor(shift)(right)
        residual = shift * solution - matrix @ solution - right
        assert np.abs(residual).max() < 1e-13 * (abs(shift) * np.abs(solution).max() + np.abs(right).max()) * 100


def test_a_matrix_may_gain_and_lose_entries():
    first = MATRICES["path"]
    second = first.tolil()
    second[3, 40], second[400, 400], second[500, 420] = 2.0, -1.0, 3.0
    shifted, right = ShiftedMatrix(first), np.ones(first.shape[0], dtype=complex)
    for matrix in (second.tocsc(), first):
        shifted.load(matrix)
        solution = shifted.factor(2 + 1j)(right)
        assert np.abs((2 + 1j) * solution - matrix @ solution - right).max() < 1e-12


@pytest.mark.parametrize("size", [2, 60])
def test_a_singular_matrix_is_told(size):
    matrix = sparse.csc_array(np.ones((size, size)))
    with pytest.raises(np.linalg.LinAlgError):
        ShiftedMatrix(matrix - sparse.eye_array(size)).factor(-1.0 + 0.0j)


@pytest.mark.slow
@pytest.mark.parametrize("linear", [True, False])
@pytest.mark.parametrize("rtol", [1e-4, 1e-6, 1e-8])
def test_the_error_of_a_damped_chain_follows_the_tolerance(rtol, linear):
    truth = torques(propagation.solve(shaft(60)).x)
    trajectory = banded.solve(shaft(60, rtol=rtol, linear=linear))
    error = np.abs(torques(trajectory.x) - truth).max() / np.abs(truth).max()
    # The tolerance bounds the error of a step; some hundred steps have about 2 of it, and a factor of 5 for safety.
    assert error < 10 * rtol
    assert trajectory.statistics["steps"] < 1500
    times = np.random.default_rng(2).uniform(0.0, 0.2, 50)
    between = torques(propagation.solve(replace(shaft(60), t_eval=np.sort(times))).x)
    assert np.abs(torques(trajectory.dense(np.sort(times))) - between).max() < 10 * rtol * np.abs(truth).max()


@pytest.mark.slow
def test_ten_thousand_elements_meet_the_continuous_shaft():
    trajectory = banded.solve(shaft(10000, rtol=3e-6))
    found = torques(trajectory.x[1:])
    times = trajectory.t[1:]
    truth = np.column_stack([continuous_torque((k + 0.5) / 10000, times) for k in (0, 5000, 9999)])
    # A run at rtol 1e-9 is within 1.3e-7 of the continuum: that is what chain and series of modes are worth.
    assert np.abs(found[:, [0, 5000, 9999]] - truth).max() < 1e-5 * np.abs(truth).max()


@pytest.mark.slow
def test_the_number_of_steps_does_not_grow_with_the_chain():
    # With a bandwidth that stays the same, the cost of a step is linear in the number of elements.
    steps = [banded.solve(shaft(m, rtol=1e-5)).statistics["steps"] for m in (100, 1000, 4000)]
    assert max(steps) < 1.1 * min(steps)


def energy(x, inertias, stiffness):
    m = inertias.size - 1
    return (x[:, : m + 1] ** 2 @ inertias + (x[:, m + 1 :] ** 2).sum(axis=1) / stiffness) / 2


def released(m, rtol, damping_time):
    """The shaft without torque, whose two ends turn against each other at the start."""
    matrix, inertias, stiffness = chain_matrix(m, damping_time)
    start = np.concatenate([np.linspace(1.0, -1.0, m + 1), np.zeros(m)])
    still = LinearInputs(matrix, lambda _t: np.zeros(2 * m + 1))
    problem = replace(shaft(m, rtol=rtol), x0=start, linear=still, t_eval=None)
    return problem, inertias, stiffness


def test_from_rest_a_motion_takes_hardly_more_steps_than_where_its_size_is_known() -> None:
    """The tolerance grows with the states; that of rest alone costs several times the steps."""
    problem = shaft(60)
    found = banded.solve(problem)
    known = banded.solve(replace(problem, atol=problem.rtol * np.abs(found.x).max(axis=0)))
    assert found.statistics["steps"] < 2 * known.statistics["steps"]


def test_an_undamped_chain_keeps_its_energy_at_any_tolerance():
    problem, inertias, stiffness = released(40, 1e-3, 0.0)
    trajectory = banded.solve(problem)
    stored = energy(trajectory.x, inertias, stiffness)
    # Rounding of some hundred steps; the tolerance is 1e-3.
    assert np.abs(stored / stored[0] - 1).max() < 1e-10


@pytest.mark.slow
def test_a_damped_chain_loses_what_its_dampers_take():
    problem, inertias, stiffness = released(40, 1e-7, DAMPING_TIME)
    trajectory = banded.solve(problem)
    stored = energy(trajectory.x, inertias, stiffness)
    nodes, weights = np.polynomial.legendre.leggauss(8)
    lost = 0.0
    for start, end in pairwise(trajectory.t):
        x = trajectory.dense(start + (end - start) * (nodes + 1) / 2)
        power = DAMPING_TIME * stiffness * (np.diff(x[:, :41], axis=1) ** 2).sum(axis=1)
        lost += (end - start) / 2 * weights @ power
    assert abs(stored[0] - stored[-1] - lost) < 1e-6 * stored[0]


@pytest.mark.parametrize("linear", [True, False])
@pytest.mark.parametrize("name", ["oscillator", "relaxation"])
@pytest.mark.parametrize("rtol", [1e-3, 1e-6, 1e-9])
def test_closed_solutions_with_a_jump_are_met(request, name, rtol, linear):
    case = request.getfixturevalue(name)
    problem = case.problem if linear else replace(case.problem, linear=None)
    trajectory = banded.solve(replace(problem, rtol=rtol))
    times = np.random.default_rng(1).uniform(0.0, 3.0, 100)
    for t, x in ((trajectory.t, trajectory.x), (times, trajectory.dense(times))):
        truth = case.solution(t)
        assert (np.abs(x - truth).max(axis=0) < 10 * rtol * np.abs(truth).max(axis=0)).all()


@pytest.mark.parametrize("linear", [True, False])
def test_both_sides_of_a_jump_are_listed_and_no_piece_is_left(oscillator, linear):
    oscillator.asked.clear()
    problem = oscillator.problem if linear else replace(oscillator.problem, linear=None)
    trajectory = banded.solve(replace(problem, t_eval=None))
    before, after = np.flatnonzero(trajectory.t == 1.0)
    assert np.allclose(trajectory.x[after] - trajectory.x[before], [0.0, 1.5], rtol=0, atol=1e-12)
    assert np.array_equal(trajectory.dense(np.array([1.0]))[0], trajectory.x[after])
    assert (np.diff(trajectory.steps) > 0).all()
    assert trajectory.statistics["steps"] == trajectory.steps.size - 1
    asked = np.array(oscillator.asked)
    assert 1.0 not in asked
    assert 0.0 < asked.min() < asked.max() < 3.0


def test_a_ramp_is_exact_to_rounding_where_the_motion_is_a_polynomial():
    problem = Problem(
        rhs=lambda t, x: np.array([2 + 3 * t, x[0]]),
        jacobian=lambda _t, _x: sparse.csc_array(np.array([[0.0, 0.0], [1.0, 0.0]])),
        x0=np.array([1.0, 0.0]),
        t0=0.0,
        t_end=2.0,
        names=("omega", "phi"),
        atol=np.full(2, 1e-9),
        t_eval=np.linspace(0.0, 2.0, 9),
        linear=LinearInputs(sparse.csr_array(np.array([[0.0, 0.0], [1.0, 0.0]])), lambda t: np.array([2 + 3 * t, 0.0])),
    )
    t = problem.t_eval
    truth = np.column_stack([1 + 2 * t + 1.5 * t**2, t + t**2 + t**3 / 2])
    for form in (problem, replace(problem, linear=None)):
        assert np.abs(banded.solve(form).x - truth).max() < 1e-12


def against_a_stop(m=20) -> Problem:
    """The shaft, whose load runs against a stop of 1e4 N m/rad with 3 N m s/rad after an angle of 0.05 rad."""
    matrix, inertias, stiffness = chain_matrix(m)
    n = 2 * m + 2
    full = sparse.lil_array((n, n))
    full[: n - 1, : n - 1] = matrix
    full[n - 1, m] = 1.0
    full = full.tocsr()

    def rhs(_t, x):
        rate = full @ x
        rate[0] += TORQUE / inertias[0]
        if x[-1] > 0.05:
            rate[m] -= (1e4 * (x[-1] - 0.05) + 3.0 * x[m]) / inertias[m]
        return rate

    def jacobian(_t, x):
        touched = full.tolil()
        if x[-1] > 0.05:
            touched[m, m] -= 3.0 / inertias[m]
            touched[m, n - 1] -= 1e4 / inertias[m]
        return touched.tocsc()

    size = np.concatenate([np.ones(m + 1), np.full(m, max(1.0, DAMPING_TIME * stiffness)), [1.0]])
    return Problem(
        rhs=rhs,
        jacobian=jacobian,
        x0=np.zeros(n),
        t0=0.0,
        t_end=0.1,
        names=(),
        atol=1e-9 * size,
        rtol=1e-6,
        t_eval=np.linspace(0.0, 0.1, 101),
    )


@pytest.mark.slow
def test_a_stop_that_no_step_foresees_is_met():
    # Before the contact the equations are linear, so the contraction of Newton's method is perfect there and says
    # nothing of the step that meets the stop; nor has the Jacobian its entries.
    problem = against_a_stop()
    truth = scipy_ivp.solve(replace(problem, rtol=1e-8, atol=problem.atol * 1e-2), method="Radau").x
    assert truth[:, -1].max() > 0.05
    trajectory = banded.solve(problem)
    error = np.abs(trajectory.x - truth).max(axis=0) / np.abs(truth).max(axis=0)
    # Contact begins with a jump of the damper's torque, which a step shares out to the tolerance at best.
    assert error.max() < 3e-5
    again = trajectory.dense(problem.t_eval)
    assert (np.abs(again - trajectory.x).max(axis=0) < 1e-6 * np.abs(truth).max(axis=0)).all()


@pytest.mark.slow
def test_a_run_can_be_repeated_to_the_last_bit():
    problem = against_a_stop()
    first, second = (banded.solve(problem) for _ in range(2))
    assert np.array_equal(first.x, second.x)
    assert np.array_equal(first.steps, second.steps)


@pytest.mark.slow
def test_a_network_of_shaft_and_motor_agrees_with_another_stiff_engine():
    net = sw.Network("shaft")
    net.add(sw.KlossMotor("motor", tau_k=TORQUE, s_k=0.2, n_sync=1500), "n0")
    net.add(sw.Inertia("J0", J=MOTOR), "n0")
    m = 20
    for k in range(1, m + 1):
        net.add(sw.Spring(f"s{k}", c=STIFFNESS * m, d=DAMPING_TIME * STIFFNESS * m), f"n{k - 1}", f"n{k}")
        net.add(sw.Inertia(f"J{k}", J=INERTIA / m if k < m else LOAD), f"n{k}")
    model = net.compile()
    found = model.simulate(0.05, rtol=1e-7, engine="banded", t_eval=101)
    other = model.simulate(0.05, rtol=1e-8, engine="scipy-radau", t_eval=101)
    for name in ("J0.omega", "s1.tau", f"s{m}.tau"):
        assert np.abs(found[name] - other[name]).max() < 3e-6 * np.abs(other[name]).max()
    assert found.energy_residual < 1e-6


@pytest.mark.slow
def one_speed(rhs, jacobian, **options) -> Problem:
    given = {"x0": np.zeros(1), "t0": 0.0, "t_end": 3.0, "names": ("motor.omega",), "atol": np.array([1e-9])}
    return Problem(rhs=rhs, jacobian=jacobian, **(given | options))


@pytest.mark.parametrize(
    ("rhs", "reason"),
    [
        (lambda _t, x: x**2 + 1.0, r"failed at t = 1\.570"),
        (lambda _t, x: np.sqrt(1.0 - x) + 1.0, r"derivative of 'motor.omega' was nan at t = 0\.61"),
    ],
)
def test_a_motion_that_cannot_go_on_is_named(rhs, reason):
    slope = sparse.csc_array(np.array([[1.0]]))
    with pytest.raises(SimulationError, match=reason):
        banded.solve(one_speed(rhs, lambda _t, _x: slope.copy()))


@pytest.mark.slow
def test_a_motion_that_two_laws_drive_back_to_their_jump_is_named(monkeypatch):
    monkeypatch.setitem(stepping.Pace.__init__.__kwdefaults__, "every", 100)
    jacobian, start = sparse.csc_array((1, 1)), np.ones(1)
    problem = one_speed(lambda _t, x: -np.sign(x) - 0.5, lambda _t, _x: jacobian, x0=start, max_steps=20_000)
    with pytest.raises(SimulationError, match=r"banded engine failed at t = 0\.66666.*both sides of a jump"):
        banded.solve(problem)


def test_a_run_ends_when_its_steps_are_used_up(oscillator):
    with pytest.raises(SimulationError, match=r"banded engine.*3 steps were not enough"):
        banded.solve(replace(oscillator.problem, max_steps=3, rtol=1e-10))


def test_a_problem_without_jacobian_is_refused(oscillator):
    with pytest.raises(ParameterError, match="needs a Jacobian"):
        banded.solve(replace(oscillator.problem, linear=None, jacobian=None))


def test_auto_takes_it_for_long_damped_chains_only():
    assert choice.choose(shaft(60))[0] == "exact"
    assert choice.choose(shaft(1000))[0] == "banded"
    engine, why = choice.choose(shaft(1000, linear=False))
    assert engine == "banded"
    assert "long damped chain" in why
    assert choice.choose(shaft(20, linear=False))[0] != "banded"
    assert choice.choose(shaft(1000, linear=False, damping_time=0.0))[0] != "banded"
