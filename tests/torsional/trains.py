"""Trains of the tests: an engine of cylinders on a crankshaft, with flywheel and load."""

from __future__ import annotations

import numpy as np

import shaftwork as sw

ORDERS = (0.5, 1.0, 1.5, 2.0, 2.5, 3.0)
AMPLITUDES = (120.0, 260.0, 210.0, 180.0, 90.0, 60.0)
PHASES = (0.4, -1.1, 0.2, 2.5, -0.7, 1.3)
INERTIAS = (0.6, 0.7, 0.65, 0.6, 9.0, 4.0)
STIFFNESSES = (2.0e5, 2.2e5, 2.1e5, 3.0e5, 4.0e4)
DAMPINGS = (15.0, 12.0, 10.0, 20.0, 30.0)
BRAKE = 60.0
"""Damping of the load, N m s."""


def harmonics(scale: float = 1.0) -> sw.Harmonics:
    return sw.Harmonics(ORDERS, tuple(scale * a for a in AMPLITUDES), PHASES)


def engine(scale: float = 1.0) -> sw.Network:
    """Four cylinders, flywheel and load."""
    net = sw.Network("engine")
    for k, angle in enumerate(sw.HarmonicTorque.firing_angles((1, 3, 4, 2))):
        net.add(sw.HarmonicTorque(f"cylinder {k + 1}", harmonics=harmonics(scale), firing_angle=angle), f"n{k}")
    for k, inertia in enumerate(INERTIAS):
        net.add(sw.Inertia(f"J{k}", J=inertia), f"n{k}")
    for k, (c, d) in enumerate(zip(STIFFNESSES, DAMPINGS, strict=True)):
        net.add(sw.Spring(f"s{k}", c=c, d=d), f"n{k}", f"n{k + 1}")
    net.add(sw.Damper("load", d=BRAKE), "n5")
    return net


def line(model: sw.Lumped | sw.Spectral | sw.Wave) -> sw.Network:
    """One excited flywheel, two shafts in a row and a propeller."""
    net = sw.Network("line")
    net.add(sw.HarmonicTorque("engine", harmonics=sw.Harmonics((2, 4, 6), (900.0, 500.0, 200.0))), "a")
    net.add(sw.Inertia("flywheel", J=40.0), "a")
    net.add(sw.Damper("friction", d=20.0), "a")
    for name, ends, diameter in (("first", ("a", "b"), 0.12), ("second", ("b", "c"), 0.14)):
        net.add(sw.Shaft(name, length=3.0, diameter=diameter, inner_diameter=0.04, damping=200.0, model=model), *ends)
    net.add(sw.Inertia("propeller", J=30.0), "c")
    net.add(sw.Damper("water", d=80.0), "c")
    return net


def speeds(first: float = 40.0, last: float = 200.0, count: int = 9) -> np.ndarray:
    return np.linspace(first, last, count)
