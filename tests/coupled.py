"""Random networks in which more unknowns determine each other at once than anyone solves in symbols."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import sympy

import shaftwork as sw


def ladder(seed: int) -> sw.Network:
    """A motor behind a ladder of resistors with a source of voltage that the motor's speed drives."""
    random, net = np.random.default_rng(seed), sw.Network("ladder")
    net.add(sw.VoltageSource("battery", u=10 * sympy.sin(7 * sw.t) - 0.2 * sw.q), "n0", "ground")
    rungs: dict[str, Callable[[str], sw.Component]] = {
        "R": lambda name: sw.Resistor(name, R=random.uniform(1, 50)),
        "L": lambda name: sw.Inductor(name, L=random.uniform(0.1, 5)),
        "I": lambda name: sw.CurrentSource(name, i=random.uniform(-1, 1)),
    }
    steps = int(random.integers(4, 12))
    for k in range(steps):
        net.add(sw.Resistor(f"along{k}", R=random.uniform(1, 50)), f"n{k}", f"n{k + 1}")
        kind = random.choice(["R", "R", "R", "L", "I"])
        net.add(rungs[kind](f"{kind}{k}"), f"n{k + 1}", "ground")
    net.add(sw.CurrentSource("pump", i=0.1 * sympy.cos(3 * sw.t)), "n2", "n4")
    net.add(sw.DCMachine("machine", k=0.5, R=2.0), f"n{steps}", "ground", "shaft")
    net.add(sw.Inertia("J", J=0.2), "shaft")
    net.add(sw.VoltageControlledVoltageSource("follows", gain=0.3), "far", "n4", "n2", "ground")
    net.add(sw.Resistor("back", R=5.0), "far", "ground")
    net.add(sw.Inductor("choke", L=1.0), "n1", "coil")
    net.add(sw.CurrentControlledVoltageSource("shunt", r=2.0), "top", "ground", "coil", "ground")
    net.add(sw.Resistor("feeds", R=8.0), "top", "n3")
    return net


def damped(seed: int) -> sw.Network:
    """Gears without inertia between dampers, in loops."""
    random, net = np.random.default_rng(seed), sw.Network("damped")
    net.add(sw.TorqueSource("motor", tau=5.0), "a0")
    net.add(sw.Inertia("J", J=1.0), "a0")
    stages = int(random.integers(4, 8))
    for k in range(stages):
        net.add(sw.Damper(f"d{k}", d=random.uniform(1, 50)), f"a{k}", f"b{k}")
        net.add(sw.Gear(f"g{k}", ratio=random.uniform(0.5, 3)), f"b{k}", f"a{k + 1}")
        net.add(sw.Damper(f"e{k}", d=random.uniform(1, 50)), f"a{random.integers(0, k + 1)}", f"b{k}")
        if random.random() < 0.5:
            net.add(sw.Spring(f"c{k}", c=random.uniform(10, 50), d=0.3), f"b{k}", "ground")
    net.add(sw.Damper("last", d=2.0), f"a{stages}", "ground")
    return net


def summed(seed: int) -> sw.Network:
    """Inertias that carry four others, one of which grows with its angle, by planetary gears; with dry friction."""
    random, net = np.random.default_rng(seed), sw.Network("summed")
    count = int(random.integers(5, 8))
    for k in range(count):
        net.add(sw.TorqueSource(f"motor{k}", tau=1.0 + k - 2.0 * sw.omega), f"{k}")
        net.add(sw.Inertia(f"J{k}", J=random.uniform(0.3, 4)), f"{k}")
    for carried in range(4):
        for k in range(count - 1):
            here = "0" if k == 0 else f"s{carried}{k - 1}"
            gear = sw.PlanetaryGear(f"p{carried}{k}", ratio=random.uniform(0.4, 2.5))
            net.add(gear, here, f"s{carried}{k}", f"{k + 1}")
        size = 1.5 + sympy.cos(sw.phi) if carried == 0 else random.uniform(0.3, 4)
        net.add(sw.Inertia(f"carried{carried}", J=size), f"s{carried}{count - 2}")
    net.add(sw.Spring("shaft", c=20.0, d=0.2), "0", f"s1{count - 2}")
    return net


COUPLED = {"ladder": ladder, "damped": damped, "summed": summed}
