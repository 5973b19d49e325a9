"""Parts that hold and slip: one set of equations with reactions, beside those of each combination by itself.

In equations of its own what is joined is one inertia, so both ways share neither states nor matrices. Reactions are
numbers in explicit rows where each part holds inertias of its own; matrices tell them where there are many others.
"""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

import shaftwork as sw
from shaftwork.hybrid.hybrid_run import HybridRun
from shaftwork.hybrid.hybrid_solution import solution
from shaftwork.pipeline.arguments import Demand
from tests.properties.examples import share_of_examples

COUNT = 14
"""So many frictions are above the number from which on they share one set of equations."""
OTHERS = pytest.mark.parametrize("engine", ["auto", "scipy-radau", "sundials"])


def chain(kinds: tuple[str, ...], *, ratio: float = 1.0) -> sw.Network:
    """A chain of inertias that a torque swings, with a part that rubs on each, or between it and the next."""
    net = sw.Network("chain")
    net.add(sw.TorqueSource("motor", tau=12.0 * sympy.sin(6.0 * sw.t)), "n0")
    for k, kind in enumerate(kinds):
        net.add(sw.Inertia(f"J{k}", J=0.1 + 0.01 * k), f"n{k}")
        here, after = f"n{k}", f"n{k + 1}"
        if kind == "friction":
            net.add(sw.DryFriction(f"x{k}", tau_c=0.3, tau_s=0.4, omega_s=0.5, d=0.01), here)
        elif kind == "load":
            net.add(sw.CoulombLoad(f"x{k}", tau=0.25), here)
        elif kind == "brake":
            net.add(sw.Brake(f"x{k}", tau=0.8, t_on=0.3, t_rise=0.2, t_off=1.1), here)
        else:
            net.add(sw.Clutch(f"x{k}", tau=0.9, t_on=0.1), here, after)
        if k and k % 5 == 0:
            net.add(sw.Backlash(f"gap{k}", gap=0.01, c=400.0, d=0.2), f"n{k - 1}", here)
        elif k:
            net.add(sw.Spring(f"spring{k}", c=200.0, d=0.05), f"n{k - 1}", here)
    last = len(kinds)
    net.add(sw.Inertia(f"J{last}", J=0.4), f"n{last}")
    net.add(sw.Spring(f"spring{last}", c=90.0, d=0.02), f"n{last - 1}", f"n{last}")
    net.add(sw.Gear("gear", ratio=ratio * 2.0), f"n{last}", "out")
    net.add(sw.Inertia("J", J=0.7), "out")
    return net


KINDS = st.lists(st.sampled_from(["friction", "load", "brake", "clutch"]), min_size=COUNT, max_size=COUNT).map(tuple)


def by_combinations(model: Any, t_end: float) -> sw.Solution:
    """The motion in equations of its own for each combination."""
    run = HybridRun(
        model.equation_sets,
        {},
        Demand((0.0, t_end), 1e-10, None, np.linspace(0.0, t_end, 11), "auto", 10**6, None),
        by_combination=True,
    )
    run.march(None)
    return solution(run, "own")


def assert_alike(one: sw.Solution, own: sw.Solution, speeds: list[str], losses: list[str], share: float) -> None:
    largest = max(np.abs(own[name]).max() for name in speeds)
    for name in speeds:
        np.testing.assert_allclose(one[name], own[name], rtol=0, atol=share * largest)
    assert one.energy_residual < 1e-8
    for name in losses:
        assert one.energy.lost_in[name] == pytest.approx(own.energy.lost_in[name], abs=share * own.energy.work)


@pytest.mark.slow
@given(KINDS, st.sampled_from(["auto", "scipy"]))
@share_of_examples(0.05)
def test_reactions_lead_to_the_motion_of_the_equations_of_each_combination(kinds: tuple[str, ...], engine: str) -> None:
    model = chain(kinds).compile()
    one, own = model.simulate(0.25, rtol=1e-10, engine=engine, t_eval=11), by_combinations(model, 0.25)
    speeds = [f"J{k}.omega" for k in range(COUNT + 1)] + ["J.omega"]
    assert_alike(one, own, speeds, [f"x{k}" for k in range(COUNT)], 1e-6)  # as engines agree elsewhere


FEW = st.lists(st.sampled_from(["friction", "load", "brake", "clutch"]), min_size=1, max_size=4).map(tuple)


@given(FEW)
@share_of_examples(0.02)
def test_so_do_those_of_few_parts_which_are_numbers_in_rows(kinds: tuple[str, ...]) -> None:
    model = chain(kinds).compile()
    one, own = model.simulate(1.5, rtol=1e-10, t_eval=11), by_combinations(model, 1.5)
    speeds = [f"J{k}.omega" for k in range(len(kinds) + 1)] + ["J.omega"]
    assert one.events == tuple((pytest.approx(time, abs=1e-7), *rest) for time, *rest in own.events)
    assert_alike(one, own, speeds, [f"x{k}" for k in range(len(kinds))], 1e-8)  # both by series of the same tolerance


def test_brakes_in_circles_that_open_at_one_instant_leave_what_those_that_are_left_can_hold() -> None:
    """Until 1 s all turns as one; then f4 alone rubs on J3, at its 2 N m, and the others have gone."""
    net, inertias = sw.Network("circles"), (2.57, 1.21, 1.74, 1.59, 0.35)
    for name, nodes, tau, t_off in (
        ("f1", "20", 2.0, 1.0),
        ("f10", "14", 10.0, 1.0),
        ("f6", "24", 10.0, None),
        ("f5", "31", 10.0, 1.0),
        ("f2", "41", 5.0, 1.0),
        ("f4", "13", 2.0, 1.5),
        ("f11", "0", 20.0, 1.5),
        ("f3", "13", 5.0, 1.0),
        ("f9", "01", 5.0, None),
        ("f8", "20", 5.0, 1.0),
        ("f0", "21", 10.0, 1.0),
        ("f7", "1", 20.0, 1.0),
    ):
        net.add(sw.Brake(name, tau=tau, t_off=t_off), *(f"n{node}" for node in nodes))
    for k, inertia in enumerate(inertias):
        net.add(sw.Inertia(f"J{k}", J=inertia), f"n{k}")
    net.add(sw.TorqueSource("motor", tau=-20.0 + sw.Step(40.0, start=1.0)), "n1")
    sol = net.simulate(2.0)
    # of 20 N m 5 go to J0, which f11 holds until 1.5 s, and 2 to J3
    assert sol["J3.omega"][-1] == pytest.approx(2.0 * 0.5 / inertias[3], rel=1e-9)
    assert sol["J0.omega"][-1] == pytest.approx(5.0 * 0.5 / inertias[0], rel=1e-9)
    assert sol["J1.omega"][-1] == pytest.approx((13.0 * 0.5 + 15.0 * 0.5) / inertias[1], rel=1e-9)


@OTHERS
def test_what_is_stuck_stands_still_to_the_last_bit_and_shows_its_reaction(engine: str) -> None:
    net = sw.Network("stuck")
    for k in range(COUNT):
        net.add(sw.TorqueSource(f"pull{k}", tau=sympy.Float(0.1 * (k + 1))), f"n{k}")
        net.add(sw.Inertia(f"J{k}", J=0.3), f"n{k}")
        net.add(sw.DryFriction(f"x{k}", tau_c=1.05), f"n{k}")
    sol = net.simulate(2.0, engine=engine)
    for k in range(COUNT):
        pull = 0.1 * (k + 1)
        if pull < 1.05:
            assert not sol[f"J{k}.omega"].any()
            np.testing.assert_allclose(sol[f"x{k}.tau"], pull, rtol=1e-15)
        else:
            np.testing.assert_allclose(sol[f"J{k}.omega"], (pull - 1.05) / 0.3 * sol.t, rtol=1e-7, atol=1e-12)


@OTHERS
def test_clutches_engage_at_the_common_speed_and_turn_as_one_to_the_last_bit(engine: str) -> None:
    """Every second wheel turns at 10 rad/s; its clutch with the next needs J 10 / (2 tau) seconds."""
    net = sw.Network("pairs")
    for k in range(COUNT):
        net.add(sw.Inertia(f"A{k}", J=0.2), f"a{k}")
        net.add(sw.Inertia(f"B{k}", J=0.2), f"b{k}")
        net.add(sw.Clutch(f"x{k}", tau=1.0 + 0.1 * k), f"a{k}", f"b{k}")
    model = net.compile()
    sol = model.simulate(1.5, engine=engine, rtol=1e-10, initial={f"A{k}.omega": 10.0 for k in range(COUNT)})
    for k in range(COUNT):
        when = 0.2 * 10.0 / (2 * (1.0 + 0.1 * k))
        (event,) = (event for event in sol.events if event[1] == f"x{k}" and event[0] > 0)
        assert event[0] == pytest.approx(when, abs=1e-8)
        after = sol.t > when
        np.testing.assert_array_equal(sol[f"A{k}.omega"][after], sol[f"B{k}.omega"][after])
        np.testing.assert_allclose(sol[f"A{k}.omega"][after], 5.0, rtol=1e-8)


def test_where_two_hold_one_wheel_the_first_carries_what_it_can() -> None:
    """Then no reactions tell the motion, and the combination has equations of its own."""
    net = sw.Network("two on one")
    for k in range(COUNT):
        net.add(sw.TorqueSource(f"pull{k}", tau=sympy.Float(3.0)), f"n{k}")
        net.add(sw.Inertia(f"J{k}", J=0.3), f"n{k}")
        net.add(sw.DryFriction(f"x{k}", tau_c=2.0), f"n{k}")
    net.add(sw.Brake("brake", tau=40.0, t_on=0.5), "n0")
    sol = net.simulate(2.0)
    stopped = sol.t > 0.6
    assert not sol["J0.omega"][stopped].any()
    np.testing.assert_allclose(sol["x0.tau"][stopped], 2.0, rtol=1e-12)
    np.testing.assert_allclose(sol["brake.tau"][stopped], 1.0, rtol=1e-12)
    np.testing.assert_allclose(sol["J1.omega"], sol.t / 0.3, rtol=1e-7)


@pytest.mark.parametrize("impacts", ["in turn", "together"])
def test_a_row_of_rigid_contacts_shares_one_set_of_equations(impacts: Any) -> None:
    """Inelastic impacts of a wheel that catches one after another keep the momentum: v_k = 4 / (k + 1)."""
    net = sw.Network("train of wagons", impacts=impacts)
    net.add(sw.Inertia("J0", J=1.0), "n0")
    for k in range(1, COUNT + 1):
        net.add(sw.Inertia(f"J{k}", J=1.0), f"n{k}")
        net.add(sw.Backlash(f"gap{k}", gap=0.2), f"n{k - 1}", f"n{k}")
    model = net.compile()
    sol = model.simulate(5.0, initial={"J0.omega": 4.0}, rtol=1e-10)
    hits = np.cumsum([0.1 * k / 4.0 for k in range(1, COUNT + 1)])
    assert [event[0] for event in sol.events] == pytest.approx(hits[hits < 5.0], abs=1e-9)
    caught = int(np.count_nonzero(hits < 5.0))
    assert {float(sol[f"J{k}.omega"][-1]) for k in range(caught + 1)} == {float(sol["J0.omega"][-1])}
    assert sol["J0.omega"][-1] == pytest.approx(4.0 / (caught + 1), rel=1e-9)
    assert len(model.equation_sets._by_forms) == 1  # no combination has equations of its own
    lost = sum(sol.energy.lost_in[f"gap{k}"] for k in range(1, COUNT + 1))
    assert lost == pytest.approx(8.0 - 8.0 / (caught + 1), rel=1e-9)


@pytest.mark.slow
def test_a_motion_of_many_frictions_goes_on_where_it_ended_and_can_be_stored() -> None:
    model = chain(("friction", "clutch", "brake", "load") * 4).compile()
    whole = model.simulate(1.5, rtol=1e-10)
    first = model.simulate(0.7, rtol=1e-10)
    model, first = (pickle.loads(pickle.dumps(made)) for made in (model, first))  # noqa: S301 (of our own making)
    rest = model.simulate(1.5, rtol=1e-10, initial=first)
    for name in ("J0.omega", "J9.omega", "J.omega"):
        assert rest[name][-1] == pytest.approx(whole[name][-1], abs=1e-6 * np.abs(whole[name]).max())


def test_a_hundred_frictions_need_one_set_of_equations_whatever_holds() -> None:
    """A wave of slip runs down a chain and has not come to its end: of 2^100 combinations it meets some twenty."""
    net = sw.Network("chain")
    net.add(sw.TorqueSource("motor", tau=30.0 * sympy.sin(6.0 * sw.t)), "n0")
    for k in range(100):
        net.add(sw.Inertia(f"J{k}", J=0.1), f"n{k}")
        net.add(sw.DryFriction(f"x{k}", tau_c=0.3), f"n{k}")
        if k:
            net.add(sw.Spring(f"spring{k}", c=200.0, d=0.05), f"n{k - 1}", f"n{k}")
    model = net.compile()
    sol = model.simulate(0.5)
    assert len({tuple(phase.modes.values()) for phase in sol.phases}) > 20
    assert not sol["J99.omega"].any()
    assert sol.energy_residual < 1e-8


@pytest.mark.parametrize("others", [0, 12])
def test_a_friction_with_a_torque_of_rest_holds_that_in_a_ring_of_clutches_whatever_else_there_is(others: int) -> None:
    """It holds up to 10 N m at rest and 5 in motion; the clutches share what is left of 20 N m on three inertias."""
    net = sw.Network("ring")
    net.add(sw.TorqueSource("motor", tau=20.0), "a")
    for node in "abc":
        net.add(sw.Inertia(f"J{node}", J=1.0), node)
    net.add(sw.DryFriction("friction", tau_c=5.0, tau_s=10.0, omega_s=0.0), "a", "b")
    net.add(sw.Clutch("k1", tau=30.0), "b", "c")
    net.add(sw.Clutch("k2", tau=30.0), "c", "a")
    for k in range(others):
        net.add(sw.Inertia(f"I{k}", J=1.0), f"p{k}")
        net.add(sw.DryFriction(f"g{k}", tau_c=1.0), f"p{k}")
    sol = net.simulate(1.0)
    torques = [sol[f"{name}.tau"][-1] for name in ("friction", "k1", "k2")]
    np.testing.assert_allclose(torques, [10.0, 10.0 / 3, -10.0 / 3], rtol=1e-9)
