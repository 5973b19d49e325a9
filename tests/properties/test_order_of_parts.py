"""Random trains of which the parts are added in another order, under other names: impacts through gears among them."""

from __future__ import annotations

import itertools
import warnings
from dataclasses import replace
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import shaftwork as sw
from tests.properties.examples import Array, share_of_examples
from tests.properties.test_hybrid_reference import RESTS, SWITCHING, network
from tests.properties.test_time_stepping import GearedDraw
from tests.reference.hybrid_train import Train

SAME = 1e-9
"""Of the largest speed: sums are rounded in another order, and impacts and stiff contacts multiply that."""
FIRST = 3
"""Rebounds of each contact that are compared: where they come ever faster, rounding moves their times."""


def reordered(train: Train, seed: int) -> tuple[Train, Array, Array]:
    """The train with its inertias and joints in another order, and old numbers of the inertias and joints in that."""
    rng = np.random.default_rng(seed)
    inertias, joints = rng.permutation(len(train.inertias)), rng.permutation(len(train.joints))
    place = {-1: -1} | {int(old): new for new, old in enumerate(inertias)}
    moved = [replace(joint, a=place[joint.a], b=place[joint.b]) for joint in train.joints]
    sources = tuple(replace(source, a=place[source.a]) for source in reversed(train.sources))
    made = Train(
        tuple(train.inertias[k] for k in inertias),
        tuple(train.speeds[k] for k in inertias),
        tuple(moved[k] for k in joints),
        sources,
        train.t_end,
    )
    return made, inertias, joints


def motion(train: Train) -> tuple[Array, list[list[float]]]:
    """The speeds at the end, and the times of the first rebounds of each joint."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.NetworkWarning)  # parts may be loose of each other
        sol = network(train).simulate(train.t_end, rtol=1e-12, t_eval=2)
    rebounds = [
        [time for time, name, _, after in sol.events if name == f"x{k}" and after == "rebound"][:FIRST]
        for k in range(len(train.joints))
    ]
    return np.array([sol[f"J{k}.omega"][-1] for k in range(len(train.inertias))]), rebounds


@pytest.mark.slow
@given(st.integers(0, 10**6))
@share_of_examples(0.02)
def test_the_order_of_parts_beside_lossy_gears_changes_nothing(seed: int) -> None:
    """Torques that several parts hold together they carry in their order, so of events those of contacts are told."""
    train = GearedDraw(seed, ("rigid", *SWITCHING), most=5).train()
    other, inertias, joints = reordered(train, seed)
    (speeds, rebounds), (found, found_rebounds) = motion(train), motion(other)
    uncertain = RESTS * any(joint.restitution for joint in train.joints)
    size = max(1.0, np.abs(speeds).max())
    np.testing.assert_allclose(found, speeds[inertias], rtol=0, atol=SAME * size + uncertain)
    for k, old in enumerate(joints):
        np.testing.assert_allclose(found_rebounds[k], rebounds[old], rtol=0, atol=1e-7)


Placed = tuple[sw.Component, tuple[str, ...]]


@st.composite
def inverter_legs(draw: st.DrawFn) -> list[Placed]:
    """Two switches that feed a coil, with the diodes beside them or some of them, and a motor or a resistor."""
    upper_off, lower_on, end = draw(st.sampled_from([(0.1, 0.1, 0.2), (0.1, 0.12, 0.2), (0.05, 0.05, 0.1)]))
    feeds = "p" if draw(st.booleans()) else "behind"
    parts: list[Placed] = [
        (sw.VoltageSource("supply", u=draw(st.sampled_from([24.0, 12.0]))), ("p", "ground")),
        (sw.Switch("upper", t_off=upper_off), (feeds, "x")),
        (sw.Switch("lower", t_on=lower_on, t_off=end), ("x", "ground")),
        (sw.Switch("again", t_on=end), (feeds, "x")),
        (sw.Diode("low"), ("ground", "x")),
    ]
    if feeds != "p":
        parts.append((sw.Resistor("source", R=0.05), ("p", feeds)))
    if draw(st.booleans()):
        parts.append((sw.Diode("high"), ("x", feeds)))
    if draw(st.booleans()):
        parts.append((sw.DCMachine("motor", k=0.3, R=0.5, L=0.02), ("x", "ground", "shaft")))
        parts.append((sw.Inertia("J", J=0.02), ("shaft",)))
        parts.append((sw.DryFriction("friction", tau_c=0.4), ("shaft",)))
    else:
        parts.append((sw.Resistor("R", R=draw(st.sampled_from([0.5, 2.0]))), ("x", "y")))
        parts.append((sw.Inductor("L", L=0.02), ("y", "ground")))
    return parts


@st.composite
def gearboxes(draw: st.DrawFn) -> list[Placed]:
    """A planetary gear of which one shaft may have no inertia, with what holds between its shafts and on the frame."""
    parts: list[Placed] = [(sw.PlanetaryGear("planets", ratio=draw(st.sampled_from([1.0, 2.0, 3.0]))), ("s", "c", "r"))]
    pairs = draw(st.lists(st.sampled_from(["sc", "cr", "sr", "s", "c", "r"]), min_size=1, max_size=4))
    massless = draw(st.sampled_from(["", *sorted({node for pair in pairs for node in pair})]))
    inertias = {"s": 1.0, "c": 0.7, "r": 0.5}
    parts += [(sw.Inertia(f"J{node}", J=J), (node,)) for node, J in inertias.items() if node != massless]
    for k, pair in enumerate(pairs):
        kind, tau = draw(st.sampled_from(["friction", "clutch", "freewheel"])), draw(st.sampled_from([0.2, 2.0, 20.0]))
        nodes = tuple(pair) if len(pair) > 1 else (pair, "ground")
        if kind == "friction":
            parts.append((sw.DryFriction(f"x{k}", tau_c=tau), nodes))
        elif kind == "clutch":
            parts.append((sw.Clutch(f"x{k}", tau=tau, t_on=draw(st.sampled_from([0.0, 0.1]))), nodes))
        else:
            parts.append((sw.Freewheel(f"x{k}"), nodes))
    tau = sw.Step(7.0, start=0.1, before=draw(st.sampled_from([0.0, -7.0])))
    return [*parts, (sw.TorqueSource("motor", tau=tau), (draw(st.sampled_from(["s", "c", "r"])),))]


@st.composite
def rings(draw: st.DrawFn) -> list[Placed]:
    """Inertias in a ring of frictions that hold more at rest than in motion, and clutches let go at one instant."""
    nodes = "abcde"[: draw(st.integers(3, 5))]
    torque = st.integers(-25, 25).map(float)
    parts: list[Placed] = [(sw.Inertia(f"J{node}", J=draw(st.integers(1, 9)) / 2), (node,)) for node in nodes]
    for node in nodes:
        before, after = draw(torque), draw(torque)
        parts.append((sw.TorqueSource(f"m{node}", tau=sw.Step(after - before, start=0.05, before=before)), (node,)))
    for k, node in enumerate(nodes):
        pair = (node, nodes[(k + 1) % len(nodes)])
        kind, slips = draw(st.sampled_from(["friction", "off", "on", "clutch"])), draw(st.integers(2, 8))
        if kind == "friction":
            parts.append((sw.DryFriction(f"x{k}", tau_c=slips, tau_s=slips + 6.0, omega_s=0.0), pair))
        else:
            when = {"off": {"t_off": 0.05}, "on": {"t_on": 0.05}, "clutch": {}}[kind]
            parts.append((sw.Clutch(f"x{k}", tau=7.0 * slips, **when), pair))
    return parts


@st.composite
def held_gears(draw: st.DrawFn) -> list[Placed]:
    """One or two gears that rub, at rest and under torques that turn round, beside what holds their shafts."""
    nodes = "abc"[: draw(st.integers(2, 3))]
    torque = st.integers(-25, 25).map(float)
    parts: list[Placed] = [(sw.Inertia(f"J{node}", J=draw(st.integers(1, 9)) / 2), (node,)) for node in nodes]
    for node in nodes:
        before, after = draw(torque), draw(torque)
        parts.append((sw.TorqueSource(f"m{node}", tau=sw.Step(after - before, start=0.05, before=before)), (node,)))
    for k, pair in enumerate(itertools.pairwise(nodes)):
        ratio = draw(st.sampled_from([1.0, 2.0, -3.0]))
        ahead, back = draw(st.sampled_from([(0.9, 0.9), (0.6, 0.4), (0.5, 0.0), (0.4, -0.3)]))
        parts.append((sw.LossyGear(f"g{k}", ratio=ratio, efficiency=ahead, efficiency_back=back), pair))
    for k in range(draw(st.integers(1, 3))):
        at, slips = draw(st.sampled_from([*nodes, *itertools.pairwise(nodes)])), draw(st.integers(2, 30))
        pair = at if isinstance(at, tuple) else (at, "ground")
        kind = draw(st.sampled_from(["friction", "off", "on", "clutch"]))
        if kind == "friction":
            parts.append(
                (sw.DryFriction(f"x{k}", tau_c=slips, tau_s=draw(st.sampled_from([slips, slips + 6.0]))), pair)
            )
        else:
            when = {"off": {"t_off": 0.1}, "on": {"t_on": 0.1}, "clutch": {}}[kind]
            parts.append((sw.Clutch(f"x{k}", tau=slips, **when), pair))
    return parts


@given(inverter_legs() | gearboxes() | rings() | held_gears(), st.randoms(use_true_random=False))
@share_of_examples(0.05)
def test_the_order_of_switches_and_of_what_holds_a_gearbox_changes_nothing(parts: list[Placed], rng: Random) -> None:
    sums = []
    other = rng.sample(parts, len(parts))
    for order in (parts, other):
        net = sw.Network("train")
        for part, nodes in order:
            net.add(part, *nodes)
        sol = net.simulate(0.3, rtol=1e-10, t_eval=np.linspace(0.0, 0.3, 8))
        assert sol.energy_residual < 1e-8
        sums.append({name: sol[name] for name in sol.states})
    size = max(1.0, *(np.abs(values).max() for values in sums[0].values()))
    for name, values in sums[0].items():
        np.testing.assert_allclose(sums[1][name], values, rtol=0, atol=1e-8 * size)
