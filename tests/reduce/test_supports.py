"""Springs to the frame anywhere in a train: they are in the modes and in the static shapes of Craig and Bampton."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import eigh

import shaftwork as sw
from tests.properties.examples import share_of_examples
from tests.reduce.test_simplify import chain

sizes = st.lists(st.integers(-20, 20).map(lambda k: round(10 ** (k / 20), 3)), min_size=3, max_size=8)
supports = st.lists(st.sampled_from([0.0, 0.0, 30.0, 1000.0, 2e4]), min_size=8, max_size=8)


@share_of_examples(0.08)
@given(sizes, supports, st.integers(0, 63), st.integers(2, 8), st.sampled_from(["free", "driven"]))
def test_the_modes_of_a_supported_train_are_those_of_the_textbook(
    inertias: list[float], held: list[float], pick: int, masses: int, end: str
) -> None:
    """Against the projection of the train's matrices, also where a speed is prescribed at its end."""
    count = len(inertias)
    stiffnesses = [1000.0 * (1 + (7 * k + pick) % 5) for k in range(count - 1)]
    kept, net = pick % (count - 1), chain(inertias, stiffnesses)
    for k, c in enumerate(held[:count]):
        if c:
            net.add(sw.Spring(f"bearing{k}", c=c), f"{k}", "ground")
    fixed = [count - 1] if end == "driven" else []
    if fixed:
        net.add(sw.SpeedSource("servo", omega=1.0), f"{count - 1}")
    boundaries = sorted({kept, kept + 1, *fixed})
    masses = min(max(masses, len(boundaries) + (bool(fixed) and kept + 1 < count - 2)), count)
    small = sw.reduce.simplify(net, masses, f"c{kept}")
    listed = [row.by_modes for row in small.frequencies if row.by_modes is not None]
    wanted = projected(inertias, stiffnesses, held, boundaries, fixed, masses)
    # the projection squares the frequencies: eps (f_max / f)^2, with 100 between them at most 1e-12
    assert listed == pytest.approx(wanted, rel=1e-9)
    assert sorted(small.by_modes.modes().frequencies)[-len(listed) :] == pytest.approx(wanted, rel=1e-7)
    true = [row.before for row in small.frequencies]
    assert all(found >= exact * (1 - 1e-12) for found, exact in zip(listed, true, strict=False))


def projected(
    inertias: list[float],
    stiffnesses: list[float],
    held: list[float],
    boundaries: list[int],
    fixed: list[int],
    masses: int,
) -> np.ndarray:
    """Frequencies above zero, Hz, of a chain with the modes of Craig and Bampton alone, by matrices."""
    count = len(inertias)
    stiffness = np.diag(held[:count])
    for k, c in enumerate(stiffnesses):
        stiffness[k : k + 2, k : k + 2] += c * np.array([[1, -1], [-1, 1]])
    rest = [k for k in range(count) if k not in boundaries]
    basis = np.zeros((count, masses))
    basis[np.ix_(boundaries, range(len(boundaries)))] = np.eye(len(boundaries))
    if rest:
        inner = stiffness[np.ix_(rest, rest)]
        basis[np.ix_(rest, range(len(boundaries)))] = -np.linalg.solve(inner, stiffness[np.ix_(rest, boundaries)])
        shapes = eigh(inner, np.diag(np.array(inertias)[rest]))[1]
        basis[np.ix_(rest, range(len(boundaries), masses))] = shapes[:, : masses - len(boundaries)]
    basis = basis[:, [k for k in range(masses) if k >= len(boundaries) or boundaries[k] not in fixed]]
    squares = eigh(basis.T @ stiffness @ basis, basis.T @ np.diag(inertias) @ basis, eigvals_only=True)
    rates = np.sqrt(squares[0 if fixed or any(held[:count]) else 1 :])
    return rates / (2 * np.pi)


def test_the_lowest_frequency_of_a_train_on_a_stiff_support_is_near_already_with_two_ends() -> None:
    net = chain([1.0, 1.0, 1.0, 1.0], [100.0, 200.0, 300.0])
    net.add(sw.Spring("frame", c=1000.0), "3", "ground")
    found = [sw.reduce.simplify(net, masses, "c0").frequencies[0] for masses in (2, 3)]
    # from the 4 x 4 matrices, in five digits: the train, and Craig and Bampton
    assert [row.before for row in found] == pytest.approx([0.97548] * 2, abs=5e-6)
    assert [row.by_modes for row in found] == pytest.approx([0.97847, 0.97549], abs=5e-6)


def test_what_a_support_holds_at_rest_is_held_in_the_model_by_modes() -> None:
    """Two masses without a mode: the static shape alone carries a constant torque into the support, to all digits."""
    net = chain([2.0, 0.5, 0.2, 1.0], [800.0, 500.0, 700.0], damping=0.05)
    net.add(sw.Spring("frame", c=250.0, d=12.5), "3", "ground")
    lost = sw.reduce.simplify(net, 2, "c0").compare(60.0, engine="exact")
    assert lost.before[-1] == pytest.approx(1.0, rel=1e-3)
    assert lost.by_modes[-1] == pytest.approx(1.0, rel=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize("keep", ["c0", "c2", "c4"])
@pytest.mark.parametrize("drive", ["torque", "speed"])
def test_with_all_modes_a_supported_train_moves_as_it_is(keep: str, drive: str) -> None:
    """Damping as a share of stiffness, in the supports as well; torques at places that only modes and supports move."""
    net = chain([2.0, 0.2, 0.5, 1.0, 0.3, 3.0], [900.0, 3000.0, 500.0, 2000.0, 800.0], damping=1e-3)
    net.add(sw.Spring("bearing", c=400.0, d=0.4), "1", "ground")
    net.add(sw.Spring("bracket", c=600.0, d=0.6), "4", "ground")
    net.add(sw.Spring("beside", c=100.0, d=0.1), "ground", "4")
    net.add(sw.TorqueSource("load", tau=-0.5), "4")
    net.add(sw.Damper("oil", d=0.7), "4")
    if drive == "speed":
        net.add(sw.SpeedSource("servo", omega=sw.Table([0, 1, 2], [0, 3, 3])), "3")
    small = sw.reduce.simplify(net, 6, keep)
    lost = small.compare(2.0, engine="exact")
    assert lost.rms_error_by_modes < 1e-10
    names = {part.name for part in small.by_modes.parts}
    assert {"load", "oil"} <= names


def test_a_mode_that_the_kept_shaft_does_not_feel_behind_a_clamp_of_stiffness_swings_by_itself() -> None:
    """Behind 1e15 N m/rad the participation of what swings there is 1e-13 of its size."""
    net = chain([1.0, 0.5, 0.1, 2.0], [100.0, 100.0, 100.0], damping=1e-4)
    net.add(sw.Spring("clamp", c=1e15), "2", "ground")
    net.add(sw.TorqueSource("far", tau=3.0), "3")
    small = sw.reduce.simplify(net, 4, "c0")
    listed = [row.by_modes for row in small.frequencies]
    assert listed == pytest.approx([row.before for row in small.frequencies], rel=1e-12)
    assert np.sqrt(100.0 / 2.0) / (2 * np.pi) == pytest.approx(listed[1], rel=1e-9)
    found = small.by_modes.simulate(2.0, engine="exact", t_eval=101)
    true = net.simulate(2.0, engine="exact", t_eval=101)
    assert found["c0.tau"] == pytest.approx(true["c0.tau"], abs=1e-5 * np.abs(true["c0.tau"]).max())


def test_a_support_between_two_boundaries_has_its_own_damping_alone() -> None:
    """The damping of the springs on the way stays between the boundaries; all modes, so the motion is the train's."""
    net = chain([2.0, 0.2, 0.5, 1.0], [900.0, 3000.0, 500.0], damping=1e-3)
    net.add(sw.Spring("bearing", c=400.0, d=0.4), "2", "ground")
    net.add(sw.SpeedSource("servo", omega=sw.Table([0, 1, 2], [0, 3, 3])), "3")
    assert sw.reduce.simplify(net, 4, "c0").compare(2.0, engine="exact").rms_error_by_modes < 1e-10
