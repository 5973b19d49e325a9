"""The induction machine as a circuit, beside Kloss' curve and beside its space-vector equations written by hand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import shaftwork as sw

DATA = {"U": 400.0, "f": 50.0, "L_m": 0.21, "L_s_sigma": 0.008, "L_r_sigma": 0.007, "R_r": 1.4, "pole_pairs": 2.0}
SUPPLY = 2 * np.pi * DATA["f"]
SYNCHRONOUS = SUPPLY / DATA["pole_pairs"]


def _at_speed(slip: float, **changed: float) -> sw.Model:
    net = sw.Network("test bench")
    net.add(sw.InductionMachine("m", **(DATA | changed)), "rotor")
    net.add(sw.SpeedSource("bench", omega=SYNCHRONOUS * (1 - slip)), "rotor", "ground")
    return net.compile()


def _steady(model: sw.Model) -> dict[str, float]:
    """The currents at t = 0 of the motion that repeats itself, of x' = A x + Re(B exp(j omega t))."""
    zero = np.zeros(len(model.states))
    A = model.jacobian(0.0, zero).toarray()
    B = model.rhs(0.0, zero) - 1j * model.rhs(np.pi / 2 / SUPPLY, zero)
    x = np.linalg.solve(1j * SUPPLY * np.eye(len(zero)) - A, B).real
    return dict(zip(model.states, x.tolist(), strict=True))


def _kloss(slip: float) -> float:
    """2 tau_k / (s / s_k + s_k / s) of the machine behind its magnetising inductance (Thevenin), with R_s = 0."""
    share = DATA["L_m"] / (DATA["L_m"] + DATA["L_s_sigma"])
    reactance = SUPPLY * (share * DATA["L_s_sigma"] + DATA["L_r_sigma"])
    s_k = DATA["R_r"] / reactance
    tau_k = 3 * DATA["pole_pairs"] / SUPPLY * (share * DATA["U"] / np.sqrt(3)) ** 2 / (2 * reactance)
    return float(2 * tau_k / (slip / s_k + s_k / slip))


@pytest.mark.parametrize("slip", [2.0, 1.0, 0.5, 0.3, 0.1, 0.03, 1e-3, -1e-3, -0.05, -0.4])
def test_without_stator_resistance_the_steady_torque_is_exactly_that_of_kloss(slip: float) -> None:
    """At standstill, as motor, brake and generator; the torque stays so over two periods of the supply."""
    model = _at_speed(slip)
    sol = model.simulate(0.04, initial=_steady(model), rtol=1e-12, engine="scipy", t_eval=101)
    # 1e-12 a step, of currents that magnetise beside a small torque at small slip
    np.testing.assert_allclose(sol["m.tau"], _kloss(slip), rtol=1e-9, atol=1e-9 * abs(_kloss(0.3)))


def test_with_leakage_on_one_side_alone_there_is_one_current_less_to_solve_for() -> None:
    """All leakage on the stator side: the same machine in other letters (gamma form)."""
    ratio = 1 + DATA["L_r_sigma"] / DATA["L_m"]  # currents of the rotor by this factor larger
    moved = {
        "L_m": DATA["L_m"] / ratio,
        "L_s_sigma": DATA["L_s_sigma"] + DATA["L_m"] - DATA["L_m"] / ratio,
        "L_r_sigma": 0.0,
        "R_r": DATA["R_r"] / ratio**2,
    }
    runs = [_at_speed(0.2, **changed, R_s=0.9).simulate(0.1, rtol=1e-11, engine="scipy") for changed in ({}, moved)]
    for name in ("m.tau", "m.i_alpha", "m.i_beta"):
        np.testing.assert_allclose(runs[0][name], runs[1][name], atol=1e-8 * np.abs(runs[0][name]).max())


R_S, J, LOAD = 1.1, 0.06, 0.02


def _by_hand(t: float, x: np.ndarray) -> list[float]:
    """Flux linkages of stator and rotor as complex numbers, and the speed; motion starts at 0.02 s."""
    stator, rotor, omega = x[0] + 1j * x[1], x[2] + 1j * x[3], x[4]
    L_s, L_r = (DATA["L_m"] + DATA[name] for name in ("L_s_sigma", "L_r_sigma"))
    det = L_s * L_r - DATA["L_m"] ** 2
    i, i_r = (L_r * stator - DATA["L_m"] * rotor) / det, (L_s * rotor - DATA["L_m"] * stator) / det
    u = np.sqrt(2 / 3) * DATA["U"] * np.exp(1j * SUPPLY * t) if t >= 0.02 else 0
    rates = u - R_S * i, -DATA["R_r"] * i_r + 1j * DATA["pole_pairs"] * omega * rotor
    tau = 1.5 * DATA["pole_pairs"] * (np.conj(stator) * i).imag
    return [rates[0].real, rates[0].imag, rates[1].real, rates[1].imag, (tau - LOAD * omega) / J]


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["scipy", "heyoka"])
def test_a_start_from_rest_follows_the_space_vector_equations(engine: str) -> None:
    net = sw.Network("direct start")
    net.add(sw.InductionMachine("m", **DATA, R_s=R_S, t_on=0.02), "rotor")
    net.add(sw.Inertia("J", J=J), "rotor")
    net.add(sw.Damper("load", d=LOAD), "rotor", "ground")
    sol = net.simulate(0.5, rtol=1e-10, engine=engine)
    assert np.all(sol["J.omega"][sol.t < 0.02] == 0)
    options: dict[str, Any] = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-12}
    truth = solve_ivp(_by_hand, (0.02, 0.5), np.zeros(5), t_eval=sol.t[sol.t >= 0.02], **options)
    running = sol.t >= 0.02
    # 1e-10 a step; the speed is damped, so that errors do not grow
    assert np.abs(sol["J.omega"][running] - truth.y[4]).max() < 1e-7 * truth.y[4].max()
    L_s, L_r = (DATA["L_m"] + DATA[name] for name in ("L_s_sigma", "L_r_sigma"))
    currents = (L_r * truth.y[:2] - DATA["L_m"] * truth.y[2:4]) / (L_s * L_r - DATA["L_m"] ** 2)
    for name, values in zip(("m.i_alpha", "m.i_beta"), currents, strict=True):
        assert np.abs(sol[name][running] - values).max() < 1e-6 * np.abs(values).max()
    assert sol.energy_residual < 1e-8
    assert sol["m.tau"][-1] == pytest.approx(LOAD * sol["J.omega"][-1], rel=1e-4)  # it runs steadily in the end
