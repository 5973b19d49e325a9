"""Modes instead of groups: frequencies are upper bounds, and with all modes the network moves as the train does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import eigh

import shaftwork as sw
from tests.properties.examples import share_of_examples
from tests.reduce.test_simplify import chain, frequencies

sizes = st.lists(st.integers(-20, 20).map(lambda k: round(10 ** (k / 20), 3)), min_size=3, max_size=9)


@share_of_examples(0.06)
@given(sizes, st.integers(0, 63), st.integers(2, 9), st.sampled_from([0.0, 300.0]))
def test_the_network_by_modes_has_the_frequencies_of_the_table_and_none_below_the_train(
    inertias: list[float], pick: int, masses: int, bearing: float
) -> None:
    """Against the projection of the train's own matrices; with a bearing it hangs on a spring."""
    stiffnesses = [1000.0 * (1 + (7 * k + pick) % 5) for k in range(len(inertias) - 1)]
    kept, masses = pick % len(stiffnesses), min(masses, len(inertias))
    net = chain(inertias, stiffnesses)
    if bearing:
        net.add(sw.Spring("bearing", c=bearing), f"{len(inertias) - 1}", "ground")
    small = sw.reduce.simplify(net, masses, f"c{kept}")
    found = small.by_modes.modes().frequencies
    listed = np.array([row.by_modes for row in small.frequencies if row.by_modes is not None])
    assert found[-len(listed) :] == pytest.approx(listed, rel=1e-8)
    true = np.array([row.before for row in small.frequencies])[: len(listed)]
    assert (listed >= true * (1 - 1e-9)).all()
    if not bearing:
        assert true == pytest.approx(frequencies(inertias, stiffnesses)[: len(listed)], rel=1e-8)
        assert listed == pytest.approx(_projected(inertias, stiffnesses, kept, masses)[: len(listed)], rel=1e-8)


def _projected(inertias: list[float], stiffnesses: list[float], kept: int, masses: int) -> np.ndarray:
    """By constraint modes and fixed modes, as Craig and Bampton write it down."""
    count = len(inertias)
    stiffness = np.zeros((count, count))
    for k, c in enumerate(stiffnesses):
        stiffness[k : k + 2, k : k + 2] += c * np.array([[1, -1], [-1, 1]])
    ends, rest = [kept, kept + 1], [k for k in range(count) if k not in (kept, kept + 1)]
    basis = np.zeros((count, masses))
    basis[ends] = np.eye(2, masses)
    if rest:
        inner = stiffness[np.ix_(rest, rest)]
        basis[np.ix_(rest, [0, 1])] = -np.linalg.solve(inner, stiffness[np.ix_(rest, ends)])
        shapes = eigh(inner, np.diag(np.array(inertias)[rest]))[1]
        basis[np.ix_(rest, range(2, masses))] = shapes[:, : masses - 2]
    squares = eigh(basis.T @ stiffness @ basis, basis.T @ np.diag(inertias) @ basis, eigvals_only=True)
    return np.sqrt(np.maximum(squares[1:], 0)) / (2 * np.pi)


INERTIAS, STIFFNESSES = [2.0, 0.2, 0.5, 1.0, 0.3, 3.0], [900.0, 3000.0, 500.0, 2000.0, 800.0]


@pytest.mark.slow
def test_with_all_modes_it_moves_as_the_train_wherever_a_torque_acts() -> None:
    """Damping as a share of stiffness, which each mode has by itself."""
    net = chain(INERTIAS, STIFFNESSES, damping=1e-3)
    net.add(sw.TorqueSource("brake", tau=-3 * sw.omega), "1")
    net.add(sw.Damper("bearing", d=0.7), "5")
    net.add(sw.TorqueSource("load", tau=-0.5), "4")
    lost = sw.reduce.simplify(net, len(INERTIAS), "c2").compare(2.0, engine="exact")
    assert lost.rms_error_by_modes < 1e-10
    assert abs(lost.peak_error_by_modes) < 1e-10


@pytest.mark.slow
def test_one_mode_more_is_nearer_to_the_train() -> None:
    net = chain(INERTIAS, STIFFNESSES, damping=1e-4)
    errors = [
        sw.reduce.simplify(net, masses, "c2").compare(1.0, engine="exact").rms_error_by_modes
        for masses in range(2, len(INERTIAS) + 1)
    ]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 1e-9


@pytest.mark.slow
def test_a_gap_that_is_kept_is_kept_by_modes_as_well() -> None:
    net = sw.Network("gap")
    net.add(sw.TorqueSource("motor", tau=10 * sw.t), "a")
    for node, size in (("a", 1.0), ("b", 0.5), ("c", 0.2), ("d", 2.0)):
        net.add(sw.Inertia(f"J{node}", J=size), node)
    net.add(sw.Spring("ab", c=3000.0, d=3.0), "a", "b")
    net.add(sw.Backlash("shaft", gap=0.01, c=1000.0, d=1.0), "b", "c")
    net.add(sw.Spring("cd", c=4000.0, d=4.0), "c", "d")
    net.add(sw.CoulombLoad("load", tau=2.0), "d")
    lost = sw.reduce.simplify(net, 4, "shaft").compare(1.0)
    assert lost.rms_error_by_modes < 1e-6  # all modes are there; runs of an engine at 1e-8 with events
    assert "modes" in str(lost)


def test_a_network_by_modes_is_saved_and_read(tmp_path: Path) -> None:
    small = sw.reduce.simplify(chain(INERTIAS, STIFFNESSES), 4, "c2")
    small.by_modes.save(tmp_path / "modes.toml")
    assert sw.Network.load(tmp_path / "modes.toml").netlist() == small.by_modes.netlist()


@pytest.mark.slow
def test_a_brake_that_locks_a_place_which_all_modes_move_leaves_equations_to_compile() -> None:
    """Its place is held by the sum of all speeds there. The train, whose brake holds one of them, moves alike."""
    net = sw.Network("braked")
    net.add(sw.TorqueSource("motor", tau=sw.Step(9.0) - sw.Step(9.0, start=1.0)), "0")
    for k, size in enumerate((2.0, 0.2, 0.5, 1.0, 0.3, 3.0)):
        net.add(sw.Inertia(f"J{k}", J=size), f"{k}")
    for k, c in enumerate(STIFFNESSES):
        net.add(sw.Spring(f"c{k}", c=c, d=1e-3 * c), f"{k}", f"{k + 1}")
    net.add(sw.Brake("brake", tau=30.0, t_on=1.0), "1")
    small = sw.reduce.simplify(net, len(INERTIAS), "c3")
    model = small.by_modes.compile()
    before, after = (each.simulate(2.0, t_eval=2001) for each in (net, model))
    held = [row.modes for row in after.phases if row.modes["brake"] == "locked"]
    assert held == [row.modes for row in before.phases if row.modes["brake"] == "locked"]
    assert held
    assert model.equation_sets.of(("stuck",)).model.rows is not None
    # two runs of an engine at 1e-8, with the instant of locking found by each
    assert after["c3.tau"] == pytest.approx(before["c3.tau"], abs=1e-6 * np.abs(before["c3.tau"]).max())
