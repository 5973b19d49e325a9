"""What cannot be referred is refused by name; what is referred is proven to do the same."""

from __future__ import annotations

from typing import Any

import pytest

import shaftwork as sw
from shaftwork.components import REGISTRY
from shaftwork.core.domains import ROTATION, TRANSLATION, Domain
from shaftwork.network.netlist import Placed
from shaftwork.reduce import referred_parts
from shaftwork.reduce.kinematics import Scale

VALUES: dict[str, dict[str, Any]] = {
    "CageMotor": {"tau_a": 5310.0, "tau_s": 4350.0, "tau_k": 5550.0, "tau_n": 2410.0, "n_n": 985.0, "n_sync": 1000.0},
    "HardStop": {"upper": 0.1},
    "HarmonicTorque": {"harmonics": sw.Harmonics((0.5, 2.0), (1.5, 0.7), (0.3, -1.0))},
    "TorqueSource": {"tau": 3 * sw.omega + sw.phi**2 + sw.t},
    "ForceSource": {"f": 3 * sw.v + sw.s},
    "PullOutDrive": {"tau_k": 9.0, "s_k": 0.2, "n_sync": 3000.0},
    "RandomLoad": {"mean": 3.0, "std": 1.0, "interval": 0.1},
    "Hoist": {"m": 100.0, "radius": 0.2, "efficiency": 0.9},
    "DryFriction": {"tau_c": 3.0, "tau_s": 4.0},
    "Conveyor": {"m": 100.0, "radius": 0.2, "friction": 0.03, "incline": 0.3, "d": 2.0},
    "Brake": {"tau": 10.0, "on": sw.omega - 10},
    "Shaft": {"length": 1.0, "diameter": 0.1, "inner_diameter": 0.02, "damping": 3.0},
    "StateSpaceController": {"measured": "J2.omega", "D": 1.0},
    "TransferFunctionController": {"measured": "J2.omega", "numerator": 1.0, "denominator": 1.0},
    "SpeedController": {"omega_ref": 100 * sw.t, "k_p": 3.0, "t_i": 0.1, "tau_max": 40.0},
}
ONE_WAY = {"AveragedBLDC", "BLDCMotor", "Hoist", "InductionMachine"}
"""They have a direction, one node and no sign that could turn it."""
BY_TURNS = {"HarmonicTorque"}
"""Their law counts the turns of their own shaft, and whole orders of one are none of another."""
MEASURING = {"StateSpaceController", "TransferFunctionController"}
"""They read quantities of others, which are other ones at the reference shaft: `refer` refuses the network."""
ALONG_A_LINE = {"Rope"}
"""There is no such part that turns."""
BUILT_IN = {name: kind for name, kind in REGISTRY.items() if kind.__module__.startswith("shaftwork.components.")}


def seen(kind: type[sw.Component], scale: Scale, domain: Domain = ROTATION) -> Any:
    values = VALUES.get(kind.__name__) or {item.name: 1.0 for item in kind.declared.values() if item.required}
    part = kind("part", **values)
    nodes = tuple("abc"[: len(part.ports)])
    return referred_parts.referred_part(Placed(part, nodes), nodes, scale, domain)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in BUILT_IN if name not in MEASURING])
def test_every_mechanical_component_is_referred_or_refused(name: str) -> None:
    kind = BUILT_IN[name]
    if any(port.domain in (ROTATION, TRANSLATION) for port in kind.ports):
        domain = TRANSLATION if name in ALONG_A_LINE else ROTATION
        if name in BY_TURNS:
            assert "its law is not that of any such part behind a gear" in seen(kind, Scale(2.0), domain)
            return
        assert isinstance(seen(kind, Scale(-2.5), domain), str) is (name in ONE_WAY)
        # a machine of one pole pair is one of two pairs at half its speed, and there is none of two and a half
        assert not isinstance(seen(kind, Scale(2.0), domain), str)
        assert isinstance(seen(kind, Scale(0.4), domain), str) is ("pole_pairs" in kind.declared)


@pytest.mark.parametrize("name", sorted(ALONG_A_LINE))
def test_a_part_that_exists_along_a_line_alone_is_refused_on_a_shaft(name: str) -> None:
    assert "there is no rotation part" in seen(BUILT_IN[name], Scale(2.0), ROTATION)


def test_a_part_whose_law_does_not_scale_so_is_found_out(monkeypatch: pytest.MonkeyPatch) -> None:
    """By their units alone a hoist's radius and a motor's gear would stay as they are."""
    monkeypatch.setattr(referred_parts, "OF_CLASS", {})
    assert isinstance(seen(sw.Hoist, Scale(2.5)), str)
    assert isinstance(seen(sw.DCMachine, Scale(2.5)), str)


def test_a_part_of_ones_own_says_how_it_scales() -> None:
    @sw.component
    class Lever(sw.Component):
        arm: float = sw.parameter("m", "arm")
        ports = (sw.Port("a"),)

        def branches(self, p: Any) -> Any:
            yield sw.ThroughLaw(5.0 * p.arm)

    try:
        assert isinstance(seen(Lever, Scale(2.5)), str)
        Lever.referred = {"arm": (1, 1)}  # type: ignore[attr-defined]
        assert seen(Lever, Scale(2.5, 0.5)).placed.part.arm == 1.25
    finally:
        del REGISTRY["Lever"]


def test_a_part_of_ones_own_scales_by_its_units_where_it_says_nothing_else() -> None:
    """A row of bearings, by friction per metre, takes the square of the ratio as a damper does."""

    @sw.component
    class Bearings(sw.Component):
        d: float = sw.parameter("N*s/rad", "friction per metre")
        length: float = sw.parameter("m", "length of the row")
        ports = (sw.Port("a"),)

        def branches(self, p: Any) -> Any:
            yield sw.ThroughLaw(p.d * p.length * sw.ACROSS)

    try:
        part = seen(Bearings, Scale(2.5, 0.5)).placed.part
        assert (part.d, part.length) == (2.5**2 * 0.5, 1.0)
    finally:
        del REGISTRY["Bearings"]


def base(*, gear: sw.Component | None = None) -> sw.Network:
    net = sw.Network("train")
    net.add(sw.TorqueSource("motor", tau=1.0), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(gear or sw.Gear("gear", ratio=3.0), "a", "b")
    net.add(sw.Inertia("J2", J=1.0), "b")
    return net


def refused(net: sw.Network, to: str = "a", **options: Any) -> str:
    with pytest.raises(sw.NetworkError) as caught:
        sw.reduce.refer(net, to, **options)
    return str(caught.value)


def test_a_spring_that_is_twisted_by_the_gear_beside_it_is_refused() -> None:
    net = base()
    net.add(sw.Spring("brace", c=1.0), "a", "b")
    message = refused(net)
    assert "'brace' closes a loop: by the way round it, node 'a' turns 3 times as fast as node 'b'" in message


@pytest.mark.parametrize(("apart", "shown"), [(2.5e-8, "1.00000003"), (-3e-12, "0.999999999997")])
def test_ratios_that_differ_by_little_are_shown_in_as_many_digits_as_tell_them_apart(apart: float, shown: str) -> None:
    net = base(gear=sw.Gear("gear", ratio=4.0 * (1 + apart)))
    net.add(sw.Gear("back", ratio=0.25), "b", "c")
    net.add(sw.Spring("brace", c=1.0), "a", "c")
    assert f"node 'a' turns {shown} times as fast as node 'c'" in refused(net)


def test_a_loop_in_which_power_is_lost_but_no_speed_is_refused_by_the_power() -> None:
    net = base(gear=sw.LossyGear("gear", ratio=4.0, efficiency=0.8))
    net.add(sw.Gear("back", ratio=0.25), "b", "c")
    net.add(sw.Spring("brace", c=1.0), "a", "c")
    assert "power at node 'a' counts 0.8 times what it does at node 'c'" in refused(net, drives={"gear": "a"})


def test_a_differential_is_refused_and_one_with_a_fixed_ring_is_not() -> None:
    net = base()
    net.add(sw.PlanetaryGear("planets", ratio=2.0), "b", "carrier", "ring")
    net.add(sw.Inertia("J3", J=1.0), "carrier")
    net.add(sw.Inertia("J4", J=1.0), "ring")
    assert "'planets' has no fixed member: 3 of its shafts turn" in refused(net)
    net.add(sw.Ground("frame"), "ring")
    small = sw.reduce.refer(net, "a")
    assert small.ratio("J3") == pytest.approx(1 / 9, rel=1e-15)
    assert small.at_rest == ("J4",)


def test_losses_need_a_direction_of_power() -> None:
    net = base(gear=sw.LossyGear("gear", ratio=3.0, efficiency=0.9, efficiency_back=0.8))
    assert sw.reduce.refer(net, "b").torque_ratio("J1") == pytest.approx(2.7)
    net.add(sw.TorqueSource("load", tau=-1.0), "b")
    message = refused(net)
    assert "direction of power" in message
    assert "drives={'gear': 'a'}" in message
    assert sw.reduce.refer(net, "b", drives={"gear": "a"}).torque_ratio("J1") == pytest.approx(2.7)
    assert sw.reduce.refer(net, "b", drives={"gear": "b"}).torque_ratio("J1") == pytest.approx(3 / 0.8)


def test_a_machine_is_referred_by_its_torque_constant_but_not_behind_losses() -> None:
    def driven(gear: sw.Component) -> sw.Network:
        net = sw.Network("servo")
        net.add(sw.VoltageSource("supply", u=24.0), "plus", "ground")
        net.add(sw.DCMachine("motor", k=0.1, R=1.0, L=0.01), "plus", "ground", "a")
        net.add(sw.Inertia("J1", J=1.0), "a")
        net.add(gear, "a", "b")
        net.add(sw.Inertia("J2", J=1.0), "b")
        return net

    small = sw.reduce.refer(driven(sw.Gear("gear", ratio=3.0)), "b")
    assert small.table["motor.k"].referred == pytest.approx(0.3)
    assert "DCMachine 'motor' cannot be referred" in refused(
        driven(sw.LossyGear("gear", ratio=3.0, efficiency=0.9)), "b"
    )


def test_other_trains_and_wrong_nodes_are_named() -> None:
    net = base()
    net.add(sw.Inertia("J3", J=1.0), "c")
    assert "Inertia 'J3' is not joined to 'a' by any shaft" in refused(net)
    with pytest.raises(sw.ParameterError, match=r"no mechanical node of 'train'\. There are: a, b\."):
        sw.reduce.refer(base(), "d")
    with pytest.raises(sw.ParameterError, match="there is no LossyGear 'gear'"):
        sw.reduce.refer(base(), "a", drives={"gear": "a"})


@pytest.mark.filterwarnings("ignore:locked gear loop")
def test_members_that_turn_against_each_other_hold_the_carrier() -> None:
    """omega_sun + 2 omega_ring = 3 omega_carrier with omega_sun = -2 omega_ring."""
    net = base(gear=sw.Gear("gear", ratio=-2.0))
    net.add(sw.PlanetaryGear("planets", ratio=2.0), "a", "carrier", "b")
    net.add(sw.Spring("arm", c=10.0), "carrier", "tip")
    net.add(sw.Inertia("J3", J=1.0), "carrier")
    net.add(sw.Inertia("J4", J=1.0), "tip")
    message = refused(net)
    assert "Inertia 'J4' is not joined to 'a' by any shaft" in message
    assert "J3" not in message
    with pytest.raises(sw.ParameterError, match="Node 'carrier' of 'train' is held at rest"):
        sw.reduce.refer(net, "carrier")


def test_gears_round_a_loop_must_agree_in_ratio_and_losses() -> None:
    net = base()
    net.add(sw.LossyGear("other", ratio=3.0, efficiency=0.9), "a", "b")
    assert "'other' closes a loop of gears round which ratios or losses differ" in refused(net, drives={"other": "a"})


@pytest.mark.filterwarnings("ignore:locked gear loop")
def test_a_planetary_gear_must_agree_with_gears_between_all_its_members() -> None:
    """omega_sun + 2 omega_ring = 3 omega_carrier: with a sun thrice as fast as ring and carrier they would all rest."""
    net = base()
    net.add(sw.Gear("other", ratio=3.0), "a", "c")
    net.add(sw.PlanetaryGear("planets", ratio=2.0), "a", "c", "b")
    assert "'planets' closes a loop of gears round which ratios or losses differ" in refused(net)


def test_a_lossy_gear_in_a_loop_is_refused_with_the_reason() -> None:
    net = base(gear=sw.LossyGear("lossy", ratio=3.0, efficiency=0.9))
    net.add(sw.Gear("other", ratio=3.0), "a", "c")
    net.add(sw.Spring("shaft", c=10.0), "b", "c")
    message = refused(net)
    assert "it lies in a loop: 'motor' drives it from both of its sides" in message
    assert "drives={'lossy': 'a'}" in message


def test_a_self_locking_gear_is_driven_from_one_side() -> None:
    net = base(gear=sw.LossyGear("worm", ratio=3.0, efficiency=0.4, efficiency_back=-0.5))
    assert sw.reduce.refer(net, "b").torque_ratio("J1") == pytest.approx(1.2)
    assert "'worm' cannot be driven from its side b" in refused(net, drives={"worm": "b"})
    with pytest.raises(sw.ParameterError, match="side 'c' of 'worm' must be 'a' or 'b'"):
        sw.reduce.refer(net, "a", drives={"worm": "c"})


def test_what_was_not_referred_is_not_found_by_name() -> None:
    small = sw.reduce.refer(base(), "b")
    with pytest.raises(sw.SignalError, match="No part 'gear' was referred to 'b'"):
        small.ratio("gear")
    with pytest.raises(sw.SignalError, match=r"No parameter 'gear\.ratio'"):
        small.table["gear.ratio"]


def test_a_viscous_load_is_a_damper_to_the_frame_where_the_reference_translates() -> None:
    net = sw.Network("lift")
    net.add(sw.TorqueSource("motor", tau=5.0), "a")
    net.add(sw.Inertia("J", J=2.0), "a")
    net.add(sw.ViscousLoad("bearing", d=0.4), "a")
    net.add(sw.Drum("drum", radius=-0.2), "a", "b")
    net.add(sw.Mass("load", m=10.0), "b")
    small = sw.reduce.refer(net, "b")
    (damper,) = (part for part in small.network.parts if part.name == "bearing")
    assert isinstance(damper, sw.TranslationalDamper)
    assert damper.d == pytest.approx(0.4 / 0.2**2, rel=1e-14)
    before, after = net.simulate(20.0), small.network.simulate(20.0)
    assert after["load.v"] == pytest.approx(before["load.v"], rel=1e-8)
    net.add(sw.CoulombLoad("seal", tau=1.0), "a")
    assert "CoulombLoad 'seal' cannot be referred: there is no translation part that does what it does" in refused(
        net, "b"
    )


def test_the_page_names_all_that_has_a_counterpart_along_a_line() -> None:
    """Inertia, spring, damper, gap, source of torque and viscous load, and the parts along a line themselves."""
    turning = {name for name, kind in BUILT_IN.items() if any(port.domain is ROTATION for port in kind.ports)}
    there = {name for name in turning if not isinstance(seen(BUILT_IN[name], Scale(2.0), TRANSLATION), str)}
    assert there == {"Inertia", "Spring", "Damper", "Backlash", "TorqueSource", "ViscousLoad"}


def test_what_has_no_counterpart_along_a_line_is_refused_by_name() -> None:
    net = sw.Network("lift")
    net.add(sw.KlossMotor("motor", tau_k=9.0, s_k=0.2, n_sync=1500), "a")
    net.add(sw.Inertia("J", J=2.0), "a")
    net.add(sw.Brake("brake", tau=20.0), "a")
    net.add(sw.HardStop("stop", upper=10.0), "a")
    net.add(sw.Drum("drum", radius=0.2), "a", "b")
    net.add(sw.Mass("load", m=10.0), "b")
    message = refused(net, "b")
    for part in ("KlossMotor 'motor'", "Brake 'brake'", "HardStop 'stop'"):
        assert f"{part} cannot be referred: there is no translation part that does what it does" in message
    assert message.count("Refer to its own shaft, to='a'") == 3


def test_what_is_no_train_and_no_side_is_refused() -> None:
    for drives in ("a", ["gear"], 5):
        with pytest.raises(sw.ParameterError, match=r"drives = .* must say the side of each gear by its name"):
            sw.reduce.refer(base(), "a", drives=drives)  # type: ignore[arg-type]
    with pytest.raises(sw.ParameterError, match="'x' is no network"):
        sw.reduce.refer("x", to="a")  # type: ignore[arg-type]
    with pytest.raises(sw.ParameterError, match="'x' is no network"):
        sw.reduce.simplify("x", 3)  # type: ignore[arg-type]


def test_a_chain_at_a_node_that_moves_along_a_line_is_refused_with_the_reason() -> None:
    net = sw.Network("lift")
    net.add(sw.Inertia("D", J=0.5), "d")
    net.add(sw.Drum("drum", radius=0.3), "d", "r")
    net.add(sw.TranslationalSpring("rope", c=1e4), "r", "cab")
    net.add(sw.Mass("cabin", m=300.0), "cab")
    with pytest.raises(sw.NetworkError, match="no part turns"):
        sw.reduce.simplify(net, 2, "rope", to="cab")
    assert sw.reduce.simplify(net, 2, "rope", to="d")
