"""Claims about gears that rub, checked by hand-derived motions and by scipy on equations of their own."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

import shaftwork as sw
from shaftwork.components import REGISTRY
from shaftwork.core.errors import CompileError, NetworkError

J_A, J_B, RATIO, ETA, ETA_BACK = 0.1, 5.0, 10.0, 0.8, 0.7
ENGINES = ("heyoka", "scipy", "sundials")


def train(motor: Any, load: Any, *, gear: sw.Component | None = None, **values: Any) -> sw.Network:
    """Motor, gear and load; values other than those above are given by name."""
    net = sw.Network("hoist")
    made = {"ratio": RATIO, "efficiency": ETA, "efficiency_back": ETA_BACK}
    net.add(sw.Inertia("J_a", J=values.pop("J_a", J_A)), "rotor")
    net.add(sw.TorqueSource("motor", tau=motor), "rotor")
    net.add(gear or sw.LossyGear("gear", **{**made, **values}), "rotor", "drum")
    net.add(sw.Inertia("J_b", J=J_B), "drum")
    net.add(sw.TorqueSource("load", tau=load), "drum")
    return net


def mesh(motor: float, load: float) -> float:
    """Acceleration of a while the gear turns forward, by hand.

    J_a alpha = motor - tau_a and J_b alpha / ratio = load + ratio eta tau_a, with 1 / eta_b for eta where b drives.
    """
    heavy = J_B / RATIO**2
    driving = (ETA * motor + load / RATIO) / (heavy + ETA * J_A)
    driven = (motor + ETA_BACK * load / RATIO) / (J_A + ETA_BACK * heavy)
    return driving if motor >= J_A * driving else driven


def modes(sol: sw.Solution) -> list[str]:
    return [row.modes["gear"] for row in sol.phases]


@pytest.mark.slow
@pytest.mark.parametrize("engine", ENGINES)
def test_a_motion_with_power_both_ways_is_that_of_the_equations_by_hand(engine: Any) -> None:
    """The right-hand side is continuous where the power reverses, so that scipy needs no events at rtol 1e-12."""
    start, end = 200.0, 6.0

    def rhs(t: float, _: Any) -> list[float]:
        return [mesh(5 * np.sin(2 * t), -20.0)]

    truth = solve_ivp(rhs, (0, end), [start], "DOP853", rtol=1e-12, atol=1e-12, max_step=0.05)
    net = train(5 * sympy.sin(2 * sw.t), -20.0)
    sol = net.simulate(end, rtol=1e-10, engine=engine, initial={"J_a.omega": start})
    assert sol["J_a.omega"][-1] == pytest.approx(truth.y[0, -1], rel=1e-8)
    assert set(modes(sol)) == {"driving forward", "driven forward"}
    assert len(sol.phases) == 5
    assert sol.energy_residual < 1e-10


def test_the_power_reverses_where_the_torque_of_the_motor_accelerates_its_own_rotor_alone() -> None:
    """At a ramp of the motor's torque: with nothing in the mesh, alpha = load / (J_b ratio) ratio^2 = motor / J_a."""
    alpha = RATIO * -20.0 / J_B
    net = train(sw.t - 10.0, -20.0)
    sol = net.simulate(10.0, rtol=1e-10, initial={"J_a.omega": 500.0})
    assert modes(sol) == ["driven forward", "driving forward"]
    assert sol.events[-1][0] == pytest.approx(10.0 + J_A * alpha, abs=1e-9)


@pytest.mark.parametrize(("motor", "mode", "efficiency"), [(8.0, "driving", ETA), (-8.0, "driven", ETA_BACK)])
def test_in_steady_travel_the_share_of_the_power_that_arrives_is_the_efficiency(
    motor: float, mode: str, efficiency: float
) -> None:
    """Hauling up, and braking what is let down: after 60 time constants, to rounding."""
    net = train(motor, motor * -1e-9)
    net.add(sw.TorqueSource("brake or pull", tau=-40 * sw.omega + (0 if motor > 0 else 400)), "drum")
    sol = net.simulate(60.0, rtol=1e-10, initial={"J_a.omega": 10.0})
    p_a, p_b = (sol[f"gear.tau_{end}"][-1] * sol[f"gear.omega_{end}"][-1] for end in "ab")
    assert modes(sol)[-1] == f"{mode} forward"
    given, taken = (p_a, -p_b) if mode == "driving" else (p_b, -p_a)
    assert given > 0
    assert taken / given == pytest.approx(efficiency, rel=1e-12)
    assert sol["gear.power"][-1] == pytest.approx((1 - efficiency) * given, rel=1e-12)
    assert sol.energy_residual < 1e-10
    assert sol.energy.lost_in["gear"] > 0


def test_a_gear_without_losses_is_an_ideal_one() -> None:
    """Through standstill and reversals of power; the errors of two runs at rtol 1e-11."""
    motor = 5 * sympy.sin(2 * sw.t)
    lossless = train(motor, -1.0, efficiency=1.0, efficiency_back=1.0).simulate(8.0, rtol=1e-11)
    ideal = train(motor, -1.0, gear=sw.Gear("gear", ratio=RATIO)).simulate(8.0, rtol=1e-11)
    t = np.linspace(0, 8, 200)
    for name in ("J_a.omega", "gear.tau_a", "gear.tau_b"):
        np.testing.assert_allclose(lossless.at(t)[name], ideal.at(t)[name], atol=1e-8)
    assert lossless.energy.lost_in["gear"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("ratio", [RATIO, -RATIO])
def test_at_rest_it_holds_as_far_as_neither_side_overcomes_the_loss(ratio: float) -> None:
    """A load beta (referred to a) holds a between eta_b |beta| and |beta| / eta; breakaway to 1e-9 s."""
    load = -20.0 * np.sign(ratio)
    start = 1.7
    up = train(start + 0.5 * sw.t, load, ratio=ratio).simulate(4.0)
    assert modes(up) == ["stuck", "driving forward"]
    assert up.events[0][0] == pytest.approx((2.0 / ETA - start) / 0.5, abs=1e-9)
    down = train(start - 0.5 * sw.t, load, ratio=ratio).simulate(2.0)
    assert modes(down) == ["stuck", "driven backward"]
    assert down.events[0][0] == pytest.approx((start - 2.0 * ETA_BACK) / 0.5, abs=1e-9)
    held = up.t < up.events[0][0]
    assert np.all(up["J_a.omega"][held] == 0)
    assert np.all(up["J_b.omega"][held] == 0)


@pytest.mark.parametrize("before", [True, False], ids=["before the gear", "behind it"])
@pytest.mark.parametrize("holds", ["brake", "clutch", "friction"])
@pytest.mark.parametrize("motor", [0.0, 30.0, 36.5, 44.0, 60.0, 100.0])
def test_a_friction_that_holds_takes_what_the_teeth_leave(motor: float, holds: str, before: bool) -> None:  # noqa: FBT001
    """A load of 800 behind 20 : 1 asks 36 of the shaft where it drives and 44.4 where it is driven, whatever holds."""
    made = {
        "brake": sw.Brake("brake", tau=200.0),
        "clutch": sw.Clutch("brake", tau=200.0),
        "friction": sw.DryFriction("brake", tau_c=150.0, tau_s=200.0),
    }[holds]
    net = sw.Network("lift")
    net.add(sw.Inertia("J1", J=0.05), "m")
    net.add(sw.Inertia("J2", J=5.0), "d")
    gear = sw.LossyGear("gear", ratio=20.0, efficiency=0.9)
    for part, nodes in ((made, ("m", "ground")), (gear, ("m", "d")))[:: 1 if before else -1]:
        net.add(part, *nodes)
    net.add(sw.TorqueSource("motor", tau=motor), "m")
    net.add(sw.TorqueSource("weight", tau=-800.0), "d")
    sol = net.simulate(0.5)
    assert np.all(sol["J1.omega"] == 0.0)
    assert sol["gear.tau_a"][-1] == pytest.approx(min(max(motor, 36.0), 40.0 / 0.9), rel=1e-12)
    assert abs(sol["brake.tau"][-1]) == pytest.approx(abs(motor - sol["gear.tau_a"][-1]), abs=1e-12)


@pytest.mark.parametrize("before", [True, False], ids=["before the gear", "behind it"])
def test_a_motor_overcomes_friction_and_gear_together(before: bool) -> None:  # noqa: FBT001
    """0.2 of the bearing and 0.1 / 0.5 of the load are overcome by 10 t at 0.04 s."""
    net = sw.Network("rising torque")
    net.add(sw.Inertia("J1", J=0.01), "m")
    net.add(sw.Inertia("J2", J=0.05), "w")
    gear = sw.LossyGear("gear", ratio=5.0, efficiency=0.5, efficiency_back=0.3)
    for part, nodes in ((sw.DryFriction("bearing", tau_c=0.2), ("m",)), (gear, ("m", "w")))[:: 1 if before else -1]:
        net.add(part, *nodes)
    net.add(sw.TorqueSource("motor", tau=10 * sw.t), "m")
    net.add(sw.TorqueSource("load", tau=-0.5), "w")
    sol = net.simulate(0.3, rtol=1e-10)
    inertia = 0.01 + 0.05 / (0.5 * 5.0**2)
    assert sol["J1.omega"][-1] == pytest.approx(5 * (0.3 - 0.04) ** 2 / inertia, rel=1e-9)


def test_a_clutch_beside_a_gear_that_holds_carries_nothing() -> None:
    """Between the same nodes either may hold; the gear does, whichever comes first."""
    for order in (("gear", "clutch"), ("clutch", "gear")):
        net = sw.Network("bridged")
        parts = {
            "gear": sw.LossyGear("gear", ratio=1.0, efficiency=0.5, efficiency_back=-0.3),
            "clutch": sw.Clutch("clutch", tau=100.0, t_on=0.5),
        }
        net.add(sw.Inertia("J1", J=1.0), "a")
        net.add(sw.Inertia("J2", J=2.0), "b")
        for name in order:
            net.add(parts[name], "a", "b")
        net.add(sw.TorqueSource("motor", tau=5.0), "a")
        net.add(sw.TorqueSource("load", tau=-3.0), "b")
        sol = net.simulate(1.0)
        assert sol["J1.omega"][-1] == 0.0
        assert sol["clutch.tau"][-1] == 0.0


@pytest.mark.parametrize("ratio", [RATIO, -RATIO])
def test_a_load_drives_the_rotor_of_a_gear_that_does_not_lock(ratio: float) -> None:
    load = -20.0 * np.sign(ratio)
    sol = train(0.0, load, ratio=ratio).simulate(3.0)
    alpha = -2.0 * ETA_BACK / (J_A + ETA_BACK * J_B / RATIO**2)
    assert modes(sol) == ["driven backward"]
    assert sol["J_a.omega"][-1] == pytest.approx(3 * alpha, rel=1e-12)


@pytest.mark.parametrize("back", [0.0, -0.2])
@pytest.mark.parametrize("engine", ENGINES)
def test_a_gear_that_locks_itself_holds_any_load_and_is_driven_down_by_a(back: float, engine: Any) -> None:
    held = train(0.0, -20.0, efficiency_back=back).simulate(1e4, engine=engine)
    assert modes(held) == ["stuck"]
    assert np.all(held["J_b.omega"] == 0)
    lowered = train(-2 * sw.t, -20.0, efficiency_back=back).simulate(0.9, rtol=1e-10, engine=engine)
    assert modes(lowered)[-1] == "driven backward"
    begin = -back * 2.0 / 2
    inertia = J_A + back * J_B / RATIO**2
    assert lowered["J_a.omega"][-1] == pytest.approx(-((0.9 - begin) ** 2) / inertia, rel=1e-9)
    assert lowered.energy_residual < 1e-10


def test_a_load_that_changes_its_sign_leaves_a_self_locking_gear_at_rest() -> None:
    load = sympy.Piecewise((-20.0, sw.t < 1), (20.0, sw.t < 2), (-sw.t, True))
    sol = train(0.0, load, efficiency_back=-0.2).simulate(3.0)
    assert set(modes(sol)) == {"stuck"}
    assert np.all(sol["J_b.omega"] == 0)
    np.testing.assert_allclose(sol["gear.tau_b"], sol["load.tau"], rtol=1e-15)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_self_locking_gear_stops_its_load_in_the_time_that_the_loss_allows(engine: Any) -> None:
    back, omega = -0.2, -10.0
    sol = train(0.0, -20.0, efficiency_back=back).simulate(4.0, engine=engine, initial={"J_a.omega": omega})
    assert modes(sol) == ["driven backward", "stuck"]
    assert sol.events[-1][0] == pytest.approx(-omega * (J_A + back * J_B / RATIO**2) / (2.0 * -back), rel=1e-9)
    assert sol["J_a.omega"][-1] == 0.0
    assert sol.energy_residual < 1e-9


def test_a_self_locking_gear_before_too_much_inertia_jams_and_loses_all_energy_at_once() -> None:
    """J_a + eta_b J_b / ratio^2 < 0: no rate satisfies the law, so the motion ends with the motor's torque."""
    motor = sympy.Piecewise((-3.0, sw.t < 1), (0.0, True))
    sol = train(motor, -20.0, efficiency_back=-0.2, J_a=0.009).simulate(2.0)
    assert modes(sol) == ["driving backward", "stuck"]
    assert sol.events[-1][0] == 1.0
    assert sol["J_b.omega"][-1] == 0.0
    assert sol.energy.stored[-1] == 0.0
    assert sol.energy_residual < 1e-12


def chain(first: sw.Component, second: sw.Component) -> sw.Network:
    net = sw.Network("two stages")
    net.add(sw.Inertia("J_a", J=0.1), "rotor")
    net.add(sw.TorqueSource("motor", tau=5 * sympy.sin(3 * sw.t)), "rotor")
    net.add(first, "rotor", "x")
    net.add(sw.Spring("shaft", c=200.0, d=0.5), "x", "y")
    net.add(second, "y", "drum")
    net.add(sw.Inertia("J_b", J=30.0), "drum")
    net.add(sw.Damper("bearing", d=3.0), "drum")
    return net


def _stage(torque: float, omega: float, efficiency: float, back: float) -> float:
    """Torque at the fast side from that at the slow side (referred to the fast one), by the sign of the power."""
    return torque / efficiency if torque * omega > 0 else torque * back


@pytest.mark.slow
def test_two_stages_with_a_spring_between_move_as_by_hand() -> None:
    """Each mesh takes its own side of the law by the power through it; nothing sticks, so the rates by hand suffice.

    They jump where a speed changes its sign, which costs scipy's short steps some digits.
    """
    i, k = 3.0, -4.0

    def rhs(t: float, x: Any) -> list[float]:
        omega, drum, twist = x
        rate = omega / i - k * drum
        torque = 200.0 * twist + 0.5 * rate
        at_a = _stage(torque / i, omega, 0.9, 0.8)
        passed = torque * (0.85 if torque * drum * k > 0 else 1 / 0.7)
        return [(5 * np.sin(3 * t) - at_a) / 0.1, (k * passed - 3.0 * drum) / 30.0, rate]

    net = chain(
        sw.LossyGear("gear", ratio=i, efficiency=0.9, efficiency_back=0.8),
        sw.LossyGear("second", ratio=k, efficiency=0.85, efficiency_back=0.7),
    )
    sols = [net.simulate(5.0, rtol=1e-9, engine=engine) for engine in ENGINES]
    truth = solve_ivp(rhs, (0, 5.0), [0.0] * 3, "RK45", rtol=1e-9, atol=1e-11, max_step=1e-3)
    for sol in sols:
        assert len(sol.events) == len(sols[0].events) > 20
        assert sol["J_b.omega"][-1] == pytest.approx(truth.y[1, -1], rel=1e-5)
        assert sol["J_b.omega"][-1] == pytest.approx(sols[0]["J_b.omega"][-1], rel=1e-7)
        assert sol.energy_residual < 1e-10


def mesh_of(*through: Callable[[Any], Any], **values: Any) -> sw.Component:
    """A coupling with losses that knows no modes, whose through variables have the given factors."""

    @sw.component
    class Mesh(sw.Component):
        """Law: omega_a = ratio omega_b, torques as given."""

        ratio: float = sw.parameter("1", "ratio")
        share: float = sw.parameter("1", "of the torque that arrives", default=1.0)

        role = "coupling"

        def branches(self, p: Any) -> Iterator[Any]:
            terms = ((sympy.Integer(1), "a", None), (-p.ratio, "b", None))
            yield sw.LossyCoupling(terms, tuple(factor(p) for factor in through))

    del REGISTRY["Mesh"]  # no public component
    name = values.pop("name", "gear")
    return Mesh(name, **values)


def one_way(name: str, *, ratio: float, share: float) -> sw.Component:
    """Law: tau_b = -ratio share tau_a, whichever side drives."""
    return mesh_of(lambda _: sympy.Integer(1), lambda p: -p.ratio * p.share, name=name, ratio=ratio, share=share)


def massless() -> sw.Network:
    """Springs in series through a mesh, a damper on a node without inertia, and an inertia joined by another mesh."""
    net = sw.Network("massless")
    net.add(sw.Inertia("J1", J=0.4), "1")
    net.add(sw.TorqueSource("T", tau=2.0 * sympy.cos(sw.t)), "1")
    net.add(sw.Spring("c1", c=30.0), "1", "2")
    net.add(one_way("m1", ratio=2.0, share=0.8), "2", "3")
    net.add(sw.Spring("c2", c=50.0), "3", "4")
    net.add(sw.Inertia("J2", J=3.0), "4")
    net.add(one_way("m2", ratio=-3.0, share=0.7), "4", "5")
    net.add(sw.Inertia("J3", J=9.0), "5")
    net.add(sw.Damper("d1", d=2.0), "5", "6")
    net.add(one_way("m3", ratio=1.5, share=0.6), "6", "7")
    net.add(sw.Damper("d2", d=4.0), "7")
    return net


def by_hand(t: float, x: dict[str, float]) -> dict[str, float]:
    """Rates of `massless` for its states, derived with pencil and paper."""
    slow = x["J2.omega"]
    third = slow / -3.0
    sixth = 2.0 * third / (2.0 + 4.0 / 1.5**2 / 0.6)  # 2 (third - sixth) = 4 sixth / 1.5^2 / 0.6
    damped = 2.0 * (third - sixth)
    # torque q at node 2, 2 * 0.8 q at node 3; q'/30 = omega_1 - 2 omega_3 and 1.6 q'/50 = omega_3 - omega_4
    q = x.get("c1.tau_c", x.get("c2.tau_c", 0.0) / 1.6)
    rate = (x["J1.omega"] - 2.0 * slow) / (1 / 30.0 + 2.0 * 1.6 / 50.0)
    # -3 * 0.7 tau = -(J3 third' + damped) for the torque tau that node 4 gives
    inertia = 3.0 + 9.0 / (3.0 * 3.0 * 0.7)
    return {
        "J1.omega": (2.0 * np.cos(t) - q) / 0.4,
        "J2.omega": (1.6 * q + damped / (3.0 * 0.7)) / inertia,
        "c1.tau_c": rate,
        "c2.tau_c": 1.6 * rate,
    }


@pytest.mark.parametrize("form", ["rows", "arrays"])
def test_losses_reach_inertias_dampers_and_springs_without_states_of_their_own(form: str) -> None:
    model = massless().compile()
    x = {name: 0.3 + k for k, name in enumerate(model.states)}
    truth = by_hand(0.5, x)
    values = np.array(list(x.values()))
    p = model.defaults
    rates = model.rhs(0.5, values) if form == "rows" else model.arrays.bind(p).rhs(0.5, values)
    assert len(model.states) == 3
    np.testing.assert_allclose(rates, [truth[name] for name in model.states], rtol=1e-13)


def test_losses_of_meshes_balance_the_energy_and_every_node_its_torques() -> None:
    sol = massless().simulate(5.0, rtol=1e-10)
    assert sol.energy_residual < 1e-10
    assert sol.energy.lost_in["m1"] != 0
    np.testing.assert_allclose(sol["m1.tau_b"], -1.6 * sol["m1.tau_a"], rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(sol["m1.tau_b"], -sol["c2.tau"], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(sol["m3.tau_b"], -sol["d2.tau"], rtol=1e-12, atol=1e-12)


def test_small_motions_see_the_torque_ratios() -> None:
    """The response to a torque at a node without an inertia of its own, against the same by hand."""
    net = train(0.0, 0.0, gear=one_way("gear", ratio=RATIO, share=ETA))
    net.add(sw.Damper("bearing", d=1.0), "drum")
    frequency = 0.3
    found = net.frequency_response("motor.tau", "J_b.omega", [frequency])
    heavy = J_B + RATIO**2 * ETA * J_A
    assert np.ravel(found)[0] == pytest.approx(RATIO * ETA / (1.0 + 2j * np.pi * frequency * heavy), rel=1e-12)


def test_equations_print_the_torques_with_their_efficiency_in_each_mode() -> None:
    net = train(5.0, -20.0)
    text = net.equations().latex()
    assert r"i_{\mathrm{gear}} \, \eta_{\mathrm{gear}} \, \tau_{\mathrm{gear}}" in text
    assert "Ideal couplings" not in text
    back = net.equations(phase="gear driven forward").latex()
    assert r"\eta_{b,\mathrm{gear}} \, \tau_{\mathrm{gear}}" in back
    with pytest.raises(CompileError, match="loses a part of the torque"):
        net.equations().latex("second-order")


def test_a_coupling_that_lets_no_torque_through_is_named() -> None:
    net = sw.Network("nothing balances")
    net.add(sw.TorqueSource("motor", tau=1.0), "rotor")
    net.add(mesh_of(lambda _: sympy.Integer(0), lambda p: -p.ratio, ratio=3.0), "rotor", "drum")
    net.add(sw.Inertia("J", J=1.0), "drum")
    with pytest.raises(NetworkError, match="lets no torque through"):
        net.compile()


@pytest.mark.parametrize(("share", "jams"), [(-0.4, False), (-0.6, True)])
@pytest.mark.parametrize("first", ["rotor", "drum"])
def test_a_coupling_that_brakes_more_than_the_inertia_before_it_is_named(first: str, share: float, jams: bool) -> None:  # noqa: FBT001
    """At J_b + ratio^2 share J_a = 0, whichever of the inertias is the state."""
    net = sw.Network("jams")
    inertias = {"rotor": 0.1, "drum": 5.0}
    for node in sorted(inertias, key=lambda node: node != first):
        net.add(sw.Inertia(f"J {node}", J=inertias[node]), node)
    net.add(one_way("gear", ratio=RATIO, share=share), "rotor", "drum")
    if jams:
        with pytest.raises(NetworkError, match="it jams"):
            net.compile()
    else:
        net.compile()


def test_an_impact_keeps_the_momentum_that_the_mesh_lets_through() -> None:
    """A rigid gap closes: the rotor counts with ratio^2 eta J_a; the gear loses its share of what it gives up."""
    net = train(0.0, 0.0)
    net.add(sw.Backlash("gap", gap=2.0), "drum", "wheel")
    net.add(sw.Inertia("J_w", J=7.0), "wheel")
    before = 3.0
    sol = net.simulate(1.0, rtol=1e-10, initial={"J_a.omega": RATIO * before})
    inertia = J_B + RATIO**2 * ETA * J_A
    assert sol["J_w.omega"][-1] == pytest.approx(before * inertia / (inertia + 7.0), rel=1e-12)
    assert sol.energy_residual < 1e-12


def test_beside_travelling_waves_it_is_as_beside_their_mesh() -> None:
    found = []
    for model in (sw.Wave(), sw.Spectral(8)):
        net = train(5.0, 0.0)
        shaft = sw.Shaft("line", length=1.0, diameter=0.02, density=7900.0, shear_modulus=77.5e9, model=model)
        net.add(shaft, "drum", "wheel")
        net.add(sw.Inertia("J_w", J=1.0), "wheel")
        found.append(net.simulate(0.2, t_eval=21))
    assert found[0]["J_w.omega"] == pytest.approx(found[1]["J_w.omega"], rel=1e-6, abs=1e-6)
    assert found[0].energy_residual < 1e-9


TRAINS: tuple[Callable[[], sw.Component], ...] = (
    lambda: sw.LossyGear("gear", ratio=RATIO, efficiency=ETA),
    lambda: sw.LossyGear("gear", ratio=-RATIO, efficiency=ETA, efficiency_back=-0.1),
)


@pytest.mark.slow
@pytest.mark.parametrize("gear", TRAINS, ids=("both ways", "self-locking"))
def test_engines_agree_through_standstill_and_gap(gear: Callable[[], sw.Component]) -> None:
    """With a gap and dry friction beside it; errors grow through some thirty events."""
    net = sw.Network("with a gap")
    net.add(sw.Inertia("J_a", J=J_A), "rotor")
    net.add(sw.TorqueSource("motor", tau=4 * sympy.sin(4 * sw.t)), "rotor")
    net.add(gear(), "rotor", "drum")
    net.add(sw.Inertia("J_m", J=1.0), "drum")
    net.add(sw.Backlash("gap", gap=0.02, c=2000.0, d=5.0), "drum", "wheel")
    net.add(sw.Inertia("J_b", J=J_B), "wheel")
    net.add(sw.DryFriction("friction", tau_c=2.0), "wheel")
    sols = [net.simulate(3.0, rtol=1e-10, engine=engine) for engine in ENGINES]
    for sol in sols:
        assert [event[1:] for event in sol.events] == [event[1:] for event in sols[0].events]
        assert sol["J_b.omega"][-1] == pytest.approx(sols[0]["J_b.omega"][-1], rel=1e-6, abs=1e-8)
        assert sol.energy_residual < 1e-9
