"""The scenes against what their sources print."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.scenes.crane import MOTOR, WHEEL_RADIUS
from tests.reference.mna import Piece, spectrum


@pytest.mark.slow
@pytest.mark.parametrize("name", list(sw.scenes.SCENES))
def test_every_scene_runs_to_its_end_with_its_signals(name: str) -> None:
    scene = sw.scenes.SCENES[name]
    sol = scene().simulate(scene.t_end)
    assert sol.t[-1] == scene.t_end
    for signal in scene.signals:
        assert np.isfinite(sol[signal]).all()
    assert sol.energy_residual < 1e-8
    assert scene.source
    assert scene.chosen


def test_the_crane_travels_at_about_1_08_m_s_after_about_5_s() -> None:
    sol = sw.scenes.crane_start().simulate(12.0)
    speed = WHEEL_RADIUS * sol["J2.omega"]
    assert speed[-1] == pytest.approx(1.08, abs=0.01)
    reached = sol.t[np.argmax(speed > 0.98 * speed[-1])]
    assert reached == pytest.approx(5.0, abs=0.25)
    assert sol["shaft.tau"][-1] == pytest.approx(22.4, abs=0.2)


def test_the_crane_motor_passes_through_its_rated_point() -> None:
    motor = sw.scenes.crane_start().parts[0]
    slip = 1 - MOTOR.n_n / motor.n_sync
    assert 2 * motor.tau_k / (slip / motor.s_k + motor.s_k / slip) == pytest.approx(MOTOR.tau_n)


def test_the_chain_has_the_frequencies_of_its_elements_and_nears_the_exact_shaft() -> None:
    exact = np.array([38.88573365, 1567.02210303])  # Hz: transcendental equation of the lossless shaft
    errors = []
    for m in (10, 20, 40):
        net = sw.scenes.shaft_chain(m)
        model = net.compile()
        values = np.linalg.eigvals(model.jacobian(0.0, np.zeros(len(model.states))).toarray())
        ours = np.sort(values.imag[values.imag > 1.0]) / (2 * np.pi)
        pieces = [
            Piece(type(p.part).__name__, p.part.name, p.nodes, {k: float(v) for k, v in p.part.values.items()})
            for p in net.netlist().placed
        ]
        referee = spectrum(pieces)
        assert ours == pytest.approx(np.sort(referee.imag[referee.imag > 1.0]) / (2 * np.pi), rel=1e-9)
        errors.append(np.abs(ours[:2] / exact - 1))
    # equal lumps at the ends carry half an element too much: first order
    for coarse, fine in pairwise(errors):
        assert 1.7 < coarse[1] / fine[1] < 2.5


def test_the_printed_shear_modulus_is_offered() -> None:
    soft = sw.scenes.shaft_chain(5, shear_modulus=7.75e9).compile()  # Pa: 7750 MN/m2
    hard = sw.scenes.shaft_chain(5).compile()
    assert hard.parameters["c1.c"] == pytest.approx(10 * soft.parameters["c1.c"])


def test_a_chain_needs_two_elements() -> None:
    with pytest.raises(sw.ParameterError, match="2 or more"):
        sw.scenes.shaft_chain(1)


def test_the_crane_motor_pulls_out_above_its_rated_torque() -> None:
    with pytest.raises(sw.ParameterError, match="must be more than the rated"):
        sw.scenes.crane_start(3.8)


def test_the_list_of_scenes_begins_with_the_simplest_crane() -> None:
    assert list(sw.scenes.SCENES)[:4] == ["crane-start", "crane", "six-phases", "excavator"]


def test_the_step_on_a_rigid_shaft_accelerates_all_inertia() -> None:
    sol = sw.scenes.shaft_step(sw.Rigid(), torque=5.0).simulate(0.2)
    shaft = 7900.0 * math.pi * 0.02**4 / 32  # 1 m of 20 mm, steel
    assert sol["Jm.omega"][-1] == pytest.approx(5.0 * 0.2 / (0.11 + 0.025 + shaft), rel=1e-9)


def test_the_ship_line_loses_its_speed_to_the_water() -> None:
    """9 kN m s on 8.3 t m2 and the shafts, turning as one."""
    shafts = sum(7850.0 * math.pi * d**4 / 32 * length for length, d in ((4.5, 0.42), (9.0, 0.38), (6.0, 0.46)))
    (rate,) = sw.scenes.ship_line(sw.Rigid()).modes({}).rates
    assert rate == pytest.approx(-9e3 / (2800.0 + 2 * 160.0 + 5200.0 + shafts), rel=1e-9)


def test_the_engine_of_the_ship_line_pulsates_five_times_a_turn() -> None:
    engine = sw.scenes.ship_line().parts[0]
    turn = 2 * np.pi / 12.5
    torque = sympy.lambdify(sw.t, engine.tau)
    waves = np.abs(np.fft.rfft(torque(np.linspace(0.0, turn, 100, endpoint=False))))
    assert np.flatnonzero(waves > 1e-9 * waves.max()).tolist() == [0, 5]


def test_the_buckets_of_the_excavator_cut_by_the_first_seed_unless_told_otherwise() -> None:
    assert sw.scenes.excavator().parts == sw.scenes.excavator(seed=1.0).parts
    assert sw.scenes.excavator().parts != sw.scenes.excavator(seed=2.0).parts
