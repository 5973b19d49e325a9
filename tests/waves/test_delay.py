"""The delay engine against modes, Taylor series between kinks, closed solutions, a lumped chain and itself."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.polynomial import polynomial
from scipy import sparse
from scipy.integrate import solve_ivp

from shaftwork.core.errors import AccuracyWarning, SimulationError
from shaftwork.waves.delay_engine import engine as delay
from shaftwork.waves.delay_engine.collocation import POINTS
from shaftwork.waves.delay_engine.lines import DelayProblem, Lines, Past, WaveHistory

# The steel shaft of Popenda (8)-(23): 1 m long, 20 mm thick.
DENSITY, MODULUS = 7900.0, 77.5e9
Z = np.pi * 0.02**4 / 32 * np.sqrt(DENSITY * MODULUS)
T = 1.0 / np.sqrt(MODULUS / DENSITY)
JA, JB, TORQUE, T_END = 0.11, 0.025, 12.7, 0.2


def two_inertias(torque, t_end=T_END, inertias=(JA, JB), **options) -> DelayProblem:
    """A shaft between two inertias, a torque(t (k,)) on the first: linear unless said otherwise."""
    J = np.array(inertias)[:, None]

    def rhs(t, x, h):
        return (np.stack([torque(t), np.zeros_like(t)]) - Z * x - h) / J

    settings = {"linear": True, "rtol": 1e-9, "breakpoints": (), **options}
    return DelayProblem(
        rhs=rhs,
        speeds=lambda _t, x, _h: x,
        jacobian=lambda _t, _x, _h: np.diag(-Z / J[:, 0]),
        delays=np.array([T]),
        impedances=np.array([Z]),
        x0=np.zeros(2),
        t0=0.0,
        t_end=t_end,
        names=("J1.omega", "J2.omega"),
        atol=np.full(2, 1e-12),
        **settings,
    )


def step(t):
    return np.full_like(t, TORQUE)


def torques(trajectory):
    return Z * trajectory.v + trajectory.h


def taylor(times, inertias=(JA, JB), degree=14):
    """Speeds and torques (k, 4) by the Taylor series of each delay; T Z / J = 0.005, so 14 terms leave nothing out."""
    J, waves, v = np.array(inertias), np.zeros((2, degree + 1)), np.zeros(2)
    index, found = np.floor(times / T).astype(int), np.empty((times.size, 4))
    for number in range(index.max() + 1):
        h, speeds = -waves[::-1], np.zeros((2, degree + 1))
        speeds[:, 0] = v
        for k in range(degree):
            force = np.array([TORQUE if k == 0 else 0.0, 0.0]) - Z * speeds[:, k] - h[:, k]
            speeds[:, k + 1] = T * force / J / (k + 1)
        chosen = index == number
        rows = np.concatenate([speeds, Z * speeds + h])
        found[chosen] = polynomial.polyval(times[chosen] / T - number, rows.T).T
        waves, v = 2 * Z * speeds + h, speeds.sum(axis=1)
    return found


def modal_speeds(times, modes=20000):
    """End speeds (k, 2) by superposition of exact modes: omega T + atan(JA omega / Z) + atan(JB omega / Z) = k pi."""
    k = np.arange(1, modes + 1)
    omega = (k - 0.9) * np.pi / T
    for _ in range(50):
        a, b = JA * omega / Z, JB * omega / Z
        slope = T + JA / Z / (1 + a**2) + JB / Z / (1 + b**2)
        omega = np.maximum(omega - (omega * T + np.arctan(a) + np.arctan(b) - k * np.pi) / slope, omega / 3)
    a, s = JA * omega / Z, omega * T
    far = np.cos(s) - a * np.sin(s)
    line = (1 + a**2) / 2 + (1 - a**2) * np.sin(2 * s) / (4 * s) - a * np.sin(s) ** 2 / s
    amplitude = TORQUE / (JA + JB * far**2 + Z * T * line) / omega
    rigid = TORQUE * times[:, None] / (JA + JB + Z * T)
    return rigid + np.sin(np.multiply.outer(times, omega)) @ np.stack([amplitude, amplitude * far], axis=1)


KINDS = {"steady": {"steady": True}, "driven": {}, "marched": {"linear": False}}


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_the_step_torque_is_answered_as_by_modes_and_by_taylor_series(kind):
    # Asked 1e-9; the modes left out weigh about 1 / (2 modes**2) = 1e-9 of the first, which is a tenth of the speed.
    times = np.sort(np.random.default_rng(1).uniform(0, T_END, 300))
    trajectory = delay.solve(two_inertias(step, t_eval=times, **KINDS[kind]))
    expected = taylor(times)
    size = np.abs(expected).max(axis=0)
    assert (np.abs(trajectory.x - expected[:, :2]).max(axis=0) < 1e-9 * size[:2]).all()
    assert (np.abs(torques(trajectory) - expected[:, 2:]).max(axis=0) < 1e-9 * size[2:]).all()
    assert (np.abs(trajectory.v - modal_speeds(times)).max(axis=0) < 1e-9 * size[:2]).all()


@pytest.mark.parametrize("kind", KINDS)
def test_dense_output_is_the_solution_everywhere(kind):
    trajectory = delay.solve(two_inertias(step, t_end=20 * T, **KINDS[kind]))
    times = np.linspace(0, 20 * T, 1234, endpoint=False)
    expected = taylor(times)
    h, v = trajectory.waves(times)
    found = np.hstack([trajectory.dense(times), Z * v + h])
    assert (np.abs(found - expected).max(axis=0) < 1e-9 * np.abs(expected).max(axis=0)).all()
    assert trajectory.steps[0] == 0.0
    assert trajectory.steps[-1] == 20 * T
    assert np.allclose(trajectory.t, trajectory.steps, rtol=0, atol=0)


@pytest.mark.parametrize("kind", KINDS)
def test_a_torque_that_is_switched_on_off_the_grid_gives_the_same_motion_later(kind):
    later = 7.377 * T
    times = np.linspace(later, 50 * T, 999)
    problem = two_inertias(
        lambda t: TORQUE * (t > later), t_end=50 * T, breakpoints=(later,), t_eval=times, **KINDS[kind]
    )
    trajectory = delay.solve(problem)
    # The times are rounded to 2e-18 s, less than 1e-14 of a delay.
    expected = taylor(np.maximum(times - later, 0.0))
    assert (np.abs(trajectory.x - expected[:, :2]).max(axis=0) < 1e-9 * np.abs(expected[:, :2]).max(axis=0)).all()
    assert np.abs(torques(trajectory)[1:] - expected[1:, 2:]).max() < 1e-9 * np.abs(expected[:, 2:]).max()


@pytest.mark.parametrize("kind", KINDS)
def test_a_jump_of_the_state_travels_along_the_line(kind):
    blow, kick = 2.6 * T, 3.0
    problem = two_inertias(
        lambda t: 0 * t, 10 * T, breakpoints=(blow,), jump=lambda _t, x: x + kick * np.eye(2)[0], **KINDS[kind]
    )
    trajectory = delay.solve(problem)
    before = np.flatnonzero(trajectory.t == blow)[0]
    assert np.allclose(trajectory.x[before : before + 2, 0], [0.0, kick], atol=1e-12)
    # The inertia keeps its speed for an instant, so 2 Z kick leaves it and arrives a delay later.
    h, _ = trajectory.waves(blow + T * np.array([1 - 1e-9, 1 + 1e-9]))
    assert np.allclose(h[:, 1], [0.0, -2 * Z * kick], atol=1e-7 * Z * kick)


def massless(source, far_speed, t_end=8 * T, **options) -> DelayProblem:
    """A line without a state: a torque source behind a matched damper at a, a law for the speed of the end b."""
    return DelayProblem(
        rhs=lambda t, _x, _h: np.empty((0, t.size)),
        speeds=lambda t, _x, h: np.stack([(source(t) - h[0]) / (2 * Z), far_speed(h[1])]),
        jacobian=lambda _t, _x, _h: np.empty((0, 0)),
        delays=np.array([T]),
        impedances=np.array([Z]),
        x0=np.empty(0),
        t0=0.0,
        t_end=t_end,
        names=(),
        atol=np.empty(0),
        **options,
    )


def pulse(t):
    return TORQUE * np.exp(-(((t - 1.5 * T) / (0.2 * T)) ** 2))


@pytest.mark.parametrize("linear", [True, False])
def test_a_matched_end_returns_nothing(linear):
    times = np.linspace(0, 8 * T, 500)
    problem = massless(pulse, lambda h: -h / (2 * Z), t_eval=times, rtol=1e-10, linear=linear)
    trajectory = delay.solve(problem)
    assert np.abs(trajectory.h[:, 1]).max() > 0.99 * TORQUE  # the pulse did arrive
    assert np.abs(trajectory.h[:, 0]).max() < 1e-12 * TORQUE


@pytest.mark.parametrize(("far_speed", "sign"), [(lambda h: 0 * h, 1.0), (lambda h: -h / Z, -1.0)])
@pytest.mark.parametrize("linear", [True, False])
def test_clamped_ends_return_a_torque_and_free_ends_its_opposite(far_speed, sign, linear):
    times = np.linspace(0, 8 * T, 500)
    trajectory = delay.solve(massless(pulse, far_speed, t_eval=times, rtol=1e-10, linear=linear))
    expected = sign * pulse(times - 2 * T) * (times > 2 * T)
    # The pulse begins with a jump of e**-56 at t0.
    assert np.abs(trajectory.h[:, 0] - expected).max() < 1e-9 * TORQUE


@pytest.mark.parametrize("linear", [True, False])
def test_a_rectangular_pulse_keeps_its_edges(linear):
    edges = (0.37 * T, 0.93 * T)
    times = np.linspace(0, 8 * T, 777)
    problem = massless(
        lambda t: TORQUE * ((t > edges[0]) & (t < edges[1])),
        lambda h: 0 * h,
        breakpoints=edges,
        t_eval=times,
        linear=linear,
        steady=True,
    )
    trajectory = delay.solve(problem)
    expected = TORQUE * ((times - 2 * T > edges[0]) & (times - 2 * T < edges[1]))
    assert np.abs(trajectory.h[:, 0] - expected).max() < 1e-12 * TORQUE


def energy(trajectory, times, parts=64):
    """Kinetic energy of the inertias and energy of the waves that left in the last delay, at times (k,)."""
    points, weights = np.polynomial.legendre.leggauss(8)
    # No panel ends inside a part.
    inner = (times[:, None, None] - T) + T / parts * (np.arange(parts)[:, None] + (1 + points) / 2)
    h, v = trajectory.waves(inner.ravel())
    waves = ((2 * Z * v + h) ** 2).sum(axis=1).reshape(inner.shape) @ weights * T / parts / 2
    return trajectory.dense(times) ** 2 @ [JA / 2, JB / 2] + waves.sum(axis=1) / (4 * Z)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "delays"), [("steady", 3000), ("driven", 3000), ("marched", 1000), ("steady", 8e6)])
def test_energy_is_kept(kind, delays):
    # 8e6 delays are 1e5 periods of the first mode.
    times = np.array([30.0, delays / 2, delays - 10]) * T
    problem = two_inertias(
        lambda t: TORQUE * (t < 20 * T),
        delays * T,
        breakpoints=(20 * T,),
        t_eval=times,
        **KINDS[kind],
    )
    found = energy(delay.solve(problem), times)
    assert np.abs(found / found[0] - 1).max() < 1e-9


def test_a_long_motion_is_leapt_through_as_it_is_marched(monkeypatch):
    times = np.sort(np.random.default_rng(2).uniform(0, 3000 * T, 10))
    problem = two_inertias(step, 3000 * T, t_eval=times, steady=True)
    whole = delay.solve(problem)
    monkeypatch.setattr(delay, "LONG", 1000)
    leapt = delay.solve(problem)
    assert leapt.statistics["steps"] < whole.statistics["steps"]
    assert np.abs(leapt.x - whole.x).max() < 1e-11 * np.abs(whole.x).max()
    assert np.abs(torques(leapt) - torques(whole)).max() < 1e-9 * np.abs(torques(whole)).max()
    assert np.array_equal(leapt.dense(times), leapt.x)
    assert leapt.steps.size == whole.steps.size


@pytest.mark.parametrize("kind", KINDS)
def test_a_steady_rotation_stays(kind):
    problem = two_inertias(step, 30 * T, speeds0=np.array([50.0, 50.0]), torque0=np.array([TORQUE]), **KINDS[kind])
    J = np.array([JA, JB])
    problem = replace(
        problem,
        rhs=lambda _t, x, h: (np.array([[TORQUE], [-TORQUE]]) - Z * x - h) / J[:, None],
        x0=np.full(2, 50.0),
    )
    trajectory = delay.solve(problem)
    assert np.abs(trajectory.x - 50).max() < 1e-12 * 50
    assert np.abs(torques(trajectory) - [TORQUE, -TORQUE]).max() < 1e-12 * 50 * Z


@pytest.mark.slow
@pytest.mark.parametrize("ratio", [1e-2, 1e-3, 1e-7, 1e-12])
@pytest.mark.parametrize("rtol", [1e-5, 1e-8])
def test_a_light_end_neither_rings_nor_lags(ratio, rtol):
    # Until the echo returns the light end follows tau / Z (1 - exp(-Z t / J)); its layer lasts ratio * T.
    inertia = ratio * Z * T
    times = np.linspace(0.003 * T, 6 * T, 601)  # not at the kinks: what happens inside a layer is not asked
    problem = two_inertias(step, 6 * T, (inertia, JB), rtol=rtol, t_eval=times, steady=True)
    trajectory = delay.solve(problem)
    early = times < 2 * T
    expected = TORQUE / Z * -np.expm1(-times[early] / T / ratio)
    # A few panels follow each other, each within the tolerance.
    assert np.abs(trajectory.v[early, 0] - expected).max() < 10 * rtol * TORQUE / Z
    finer = delay.solve(replace(problem, rtol=1e-10))
    assert np.abs(trajectory.v - finer.v).max() < 20 * rtol * np.abs(finer.v).max()
    assert np.abs(trajectory.h - finer.h).max() < 20 * rtol * np.abs(finer.h).max()


# Two lines whose delays have no common measure, a motor with a pull-out torque, a load that grows with the cube.
T1, T2, Z1, Z2, MOTOR, LOAD = 1e-3, 1e-3 * (np.sqrt(5) - 1) * 0.65, 0.4, 0.9, 2e-3, 5e-3


def kloss(omega):
    slip = 1 - omega / 300.0
    return 10 * slip / (slip**2 + 0.0625)


def kloss_slope(omega):
    slip = 1 - omega / 300.0
    return 10 * (0.0625 - slip**2) / (slip**2 + 0.0625) ** 2 / -300.0


def joined_lines(rtol, times, delays=(T1, T2), jacobian=np.asarray) -> DelayProblem:
    def rhs(_t, x, h):
        load = -0.02 * x[1] - 2e-4 * x[1] ** 3
        return np.stack([(kloss(x[0]) - Z1 * x[0] - h[0]) / MOTOR, (load - Z2 * x[1] - h[3]) / LOAD])

    def speeds(_t, x, h):
        junction = -(h[1] + h[2]) / (Z1 + Z2)
        return np.stack([x[0], junction, junction, x[1]])

    def slopes(_t, x, _h):
        load = -0.02 - 6e-4 * x[1] ** 2
        return jacobian(np.diag([(kloss_slope(x[0]) - Z1) / MOTOR, (load - Z2) / LOAD]))

    return DelayProblem(
        rhs=rhs,
        speeds=speeds,
        jacobian=slopes,
        delays=np.array(delays),
        impedances=np.array([Z1, Z2]),
        x0=np.zeros(2),
        t0=0.0,
        t_end=float(times[-1]),
        names=("motor.omega", "load.omega"),
        atol=np.full(2, 1e-10),
        rtol=rtol,
        t_eval=times,
    )


@pytest.mark.slow
def test_lines_of_incommensurate_delays_converge_with_the_tolerance():
    times = np.linspace(0, 0.03, 211)
    truth = delay.solve(joined_lines(1e-11, times))
    size = np.abs(truth.x).max(axis=0), np.abs(truth.v).max(axis=0), np.abs(truth.h).max(axis=0)
    for rtol in (1e-3, 1e-5, 1e-7, 1e-9):
        found = delay.solve(joined_lines(rtol, times))
        missed = found.x - truth.x, found.v - truth.v, found.h - truth.h
        # The scale is that of the wave 2 Z v + h, which exceeds both of its parts.
        assert all((np.abs(miss).max(axis=0) < 5 * rtol * part).all() for miss, part in zip(missed, size, strict=True))


def lumped_chain(cells, times):
    """Speeds (k, 2) of motor and load, each line a chain of cells with half cells at its ends."""
    inertia = np.zeros(2 * cells + 1)
    stiffness = np.repeat([Z1 * cells / T1, Z2 * cells / T2], cells)
    for first, cell in ((0, Z1 * T1 / cells), (cells, Z2 * T2 / cells)):
        inertia[first : first + cells] += cell / 2
        inertia[first + 1 : first + cells + 1] += cell / 2
    inertia[[0, -1]] += MOTOR, LOAD

    def rhs(_t, y):
        omega, torque = y[: inertia.size], y[inertia.size :]
        force = -np.diff(torque, prepend=0.0, append=0.0)
        force[0] += kloss(omega[0])
        force[-1] += -0.02 * omega[-1] - 2e-4 * omega[-1] ** 3
        return np.concatenate([force / inertia, -stiffness * np.diff(omega)])

    y0 = np.zeros(4 * cells + 1)
    return solve_ivp(rhs, (0, times[-1]), y0, "RK45", times, rtol=1e-6, atol=1e-8).y[[0, 2 * cells]].T


@pytest.mark.slow
def test_lumped_chains_come_nearer_with_the_square_of_their_cells():
    times = np.linspace(0, 0.02, 101)
    found = delay.solve(joined_lines(1e-8, times)).x
    coarse, fine = (np.abs(lumped_chain(cells, times) - found).max() / found.max() for cells in (75, 150))
    assert fine < 1e-5
    assert 3.4 < coarse / fine < 4.6  # 4 but for the fronts, which a chain smears


def test_dense_and_sparse_jacobians_give_the_same_motion():
    times = np.linspace(0, 0.01, 51)
    dense, by_sparse = (
        delay.solve(joined_lines(1e-8, times, jacobian=kind)) for kind in (np.asarray, sparse.csc_array)
    )
    assert np.abs(dense.x - by_sparse.x).max() < 1e-12 * np.abs(dense.x).max()


@pytest.mark.parametrize("kind", [np.asarray, sparse.csc_array])
def test_a_network_of_many_states_hangs_on_a_line(kind):
    # A chain of 60 springs and inertias, its end free, on an end of the line: enough for sparse factors.
    n = 60
    A = sparse.diags_array([np.full(n - 1, -2e3), np.full(n - 1, 2e3)], offsets=[1, -1], shape=(n, n)).toarray()
    A[0, 0] = -Z / 1e-2

    def rhs(t, x, h):
        slopes = A @ x
        slopes[0] += (np.sin(300 * t) - h[0]) / 1e-2
        return slopes

    times = np.linspace(0, 15 * T, 61)
    problem = DelayProblem(
        rhs=rhs,
        speeds=lambda _t, x, h: np.stack([x[0], -h[1] / Z]),
        jacobian=lambda _t, _x, _h: kind(A),
        delays=np.array([T]),
        impedances=np.array([Z]),
        x0=np.zeros(n),
        t0=0.0,
        t_end=15 * T,
        names=tuple(f"x{k}" for k in range(n)),
        atol=np.full(n, 1e-12),
        t_eval=times,
    )
    found, matched = delay.solve(problem), delay.solve(replace(problem, linear=True))
    assert np.abs(found.x - matched.x).max() < 1e-7 * np.abs(found.x).max()


@pytest.mark.parametrize("first", [joined_lines, None], ids=["marched", "on the lattice"])
def test_a_run_goes_on_where_another_one_ended(first):
    times = np.linspace(0, 0.02, 201)
    later = 0.00777777
    whole = joined_lines(1e-9, times) if first else two_inertias(step, 0.02, t_eval=times)
    uncut, early = delay.solve(whole), delay.solve(replace(whole, t_end=later, t_eval=None))
    assert early.past is not None
    rest = times[times > later]
    late = delay.solve(replace(whole, t0=later, t_eval=rest, x0=early.x[-1], past=early.past(later)))
    for name in ("x", "h", "v"):
        expected = getattr(uncut, name)
        assert np.abs(getattr(late, name) - expected[times > later]).max() < 1e-8 * np.abs(expected).max()
    # The kinks that were under way when the run was cut still end panels of the second one.
    assert late.statistics["steps"] < 1.2 * uncut.statistics["steps"]


@pytest.mark.parametrize("delays", [(2 * T, T), (3 * T, 2 * T), (T, T)])
def test_the_lattice_and_the_march_agree(delays):
    def rhs(t, x, h):
        return np.stack([(TORQUE * np.cos(900 * t) - Z1 * x[0] - h[0]) / MOTOR, (-Z2 * x[1] - h[3]) / LOAD])

    def speeds(t, x, h):
        junction = (np.sin(700 * t) - h[1] - h[2]) / (Z1 + Z2 + 0.3)
        return np.stack([x[0], junction, junction, x[1]])

    times = np.linspace(0, 0.02, 301)
    problem = joined_lines(1e-9, times, delays)
    problem = replace(problem, rhs=rhs, speeds=speeds, jacobian=lambda *_: np.diag([-Z1 / MOTOR, -Z2 / LOAD]))
    lattice, march = delay.solve(replace(problem, linear=True)), delay.solve(problem)
    assert "rhs" not in lattice.statistics
    assert np.abs(lattice.x - march.x).max() < 1e-8 * np.abs(march.x).max()
    assert np.abs(lattice.v - march.v).max() < 1e-8 * np.abs(march.v).max()
    assert np.abs(lattice.h - march.h).max() < 1e-8 * np.abs(march.h).max()


@pytest.mark.parametrize("linear", [True, False])
def test_a_failure_says_when_where_and_why(linear):
    problem = two_inertias(lambda t: np.where(t > 5.3 * T, np.nan, 1.0), 9 * T, breakpoints=(5.3 * T,), linear=linear)
    with pytest.raises(SimulationError, match=r"delay engine failed at t = 0\.0016.* not finite"):
        delay.solve(problem)


@pytest.mark.parametrize("kind", KINDS)
def test_too_many_panels_are_refused(kind):
    with pytest.raises(SimulationError, match="50 steps"):
        delay.solve(two_inertias(step, 100 * T, max_steps=50, **KINDS[kind]))


def test_as_many_panels_as_are_allowed_may_be_taken():
    problem = two_inertias(step, 9 * T, linear=False)
    steps = delay.solve(problem).statistics["steps"]
    assert delay.solve(replace(problem, max_steps=steps)).statistics["steps"] == steps
    with pytest.raises(SimulationError, match=f"{steps - 1} steps"):
        delay.solve(replace(problem, max_steps=steps - 1))


def test_a_motion_without_bounds_is_named():
    problem = two_inertias(step, 10 * T, linear=False)
    problem = replace(
        problem, rhs=lambda _t, x, h: x**3 * 1e6 + 1e3 - Z * x - h, jacobian=lambda _t, x, _h: np.diag(3e6 * x**2)
    )
    with pytest.raises(SimulationError, match=r"delay engine.*J1\.omega"):
        delay.solve(problem)


def test_a_speed_that_is_not_finite_is_named():
    with pytest.raises(SimulationError, match="the speed of a line's end is not finite"):
        delay.solve(massless(pulse, lambda h: np.full_like(h, np.nan), rtol=1e-6))


def test_a_layer_that_is_too_narrow_so_late_is_named():
    # Late in a run times are rounded to more than the part of a delay that rtol lets an engine step over.
    problem = two_inertias(step, 3000 * T, (1e-14 * Z * T, JB), rtol=1e-11)
    with pytest.raises(SimulationError, match="too narrow to be resolved"):
        delay.solve(problem)


def test_a_long_motion_that_its_panels_cannot_resolve_says_so(monkeypatch):
    # Ends that start with a jump of their speed excite all modes alike, and these run out of step.
    monkeypatch.setattr(delay, "MOST_PANELS_FAR", 4)
    times = np.array([1e5, 2e5]) * T
    problem = replace(two_inertias(step, 2e5 * T, rtol=1e-7, t_eval=times, steady=True), x0=np.array([1.0, -1.0]))
    with pytest.warns(AccuracyWarning, match="wrinkles finer than [34] panels in a delay"):
        delay.solve(problem)


def test_what_arrives_over_two_panels_is_what_left_in_each() -> None:
    """A wave with a kink where the panels meet: each point has the polynomial of its own."""

    def wave(t: np.ndarray) -> np.ndarray:
        return np.where(t < -0.4, -(t + 0.4), 3.0 * (t + 0.4))

    starts, lengths = np.array([-1.0, -0.4]), np.array([0.6, 0.4])
    left = starts[:, None] + lengths[:, None] * (1 + POINTS) / 2
    past = Past(starts, lengths, np.array([[wave(times), 2 * wave(times)] for times in left]))
    history = WaveHistory(Lines.of(np.array([1.0])), past, 1e-12)
    arrived, cut = history.arriving(0.0, 1.0, np.full(2, 1e-9))
    expected = wave(-1.0 + (1 + POINTS) / 2)
    np.testing.assert_allclose(arrived, [-2 * expected, -expected], atol=1e-13)
    assert cut == pytest.approx(0.6)  # where the kink arrives
