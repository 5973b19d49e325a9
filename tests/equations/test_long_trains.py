"""Equations of long gear trains: every ratio on the way counts, in closed form."""

from __future__ import annotations

import numpy as np
import pytest
from sympy import Symbol

import shaftwork as sw
from shaftwork.equations.quantities import rate_of

RATIO = 1.25


def row_of_gears(count: int) -> sw.Network:
    """Inertias of 1, 2, 3, ... kg m^2, each geared to the next."""
    net = sw.Network("row")
    net.add(sw.TorqueSource("motor", tau=2.0), "0")
    for k in range(count + 1):
        net.add(sw.Inertia(f"J{k}", J=1.0 + k), f"{k}")
        if k:
            net.add(sw.Gear(f"g{k}", ratio=RATIO), f"{k - 1}", f"{k}")
    return net


@pytest.mark.slow
def test_a_row_of_sixty_gears_is_one_inertia_and_each_reaction_drives_what_is_beyond() -> None:
    """J = sum J_k / (i_1 i_2 ... i_k)^2 at the motor; at a gear what is beyond it, at its first shaft."""
    equations = row_of_gears(60).equations()
    values = {Symbol(name, real=True): value for name, value in equations.values.items()}
    sizes, ratios = np.arange(1.0, 62.0), RATIO ** np.arange(61.0)
    acceleration = 2.0 / np.sum(sizes / ratios**2)
    (state,) = equations.states
    assert float(state.rate.xreplace(values)) == pytest.approx(acceleration, rel=1e-13)
    rates = {rate_of(Symbol(f"J{k}.omega", real=True)): acceleration / ratios[k] for k in range(61)}
    passed = [row.right for row in equations.eliminated if row.kind == "reaction"]
    torques = [float(torque.xreplace(values).xreplace(rates)) for torque in passed]
    beyond = [np.sum((sizes / ratios**2)[k:]) * ratios[k - 1] * acceleration for k in range(1, 61)]
    assert torques == pytest.approx(beyond, rel=1e-12)


@pytest.mark.slow
def test_energies_of_a_row_of_gears_lead_to_the_same_equations() -> None:
    made = row_of_gears(24).lagrangian()
    values = {Symbol(name, real=True): value for name, value in made.kirchhoff.values.items()}
    (motion,) = made.equations
    referred = np.sum(np.arange(1.0, 26.0) / RATIO ** (2 * np.arange(25.0)))
    (turning,) = made.coordinates
    assert float((motion.left / rate_of(rate_of(turning))).xreplace(values)) == pytest.approx(referred, rel=1e-13)
    assert made.proof().holds
