"""A test bed for every component of the library."""

from __future__ import annotations

import sympy

import shaftwork as sw
from shaftwork.components import REGISTRY
from shaftwork.core.domains import ELECTRICAL, ROTATION, TRANSLATION

VALUES = {
    "Inertia": {"J": 2.0},
    "Mass": {"m": 2.0},
    "Spring": {"c": 30.0, "d": 0.7},
    "TranslationalSpring": {"c": 30.0, "d": 0.7},
    "KlossMotor": {"tau_k": 5.0, "s_k": 0.3, "n_sync": 100.0, "ratio": 1.5, "efficiency": 0.9},
    "CageMotor": {"tau_a": 5.0, "tau_s": 4.0, "tau_k": 6.0, "n_k": 80.0, "n_sync": 100.0, "ratio": 1.5, "t_off": 0.3},
    "TableMotor": {"curve": sw.Table([0.0, 50.0, 100.0], [5.0, 6.0, 0.0]), "ratio": 1.5, "efficiency": 0.9},
    "FrequencyDrive": {"tau_k": 5.0, "s_k": 0.3, "n_sync": 100.0, "t_ramp": 0.3, "f_end": 80.0, "boost": 0.2},
    "PullOutDrive": {"tau_k": 5.0, "s_k": 0.3, "n_sync": 60.0, "overspeed": 2.0, "efficiency": 0.9},
    "SpeedController": {"omega_ref": 4.0, "k_p": 1.0, "t_i": 3.0, "tau_max": 50.0},
    "StateSpaceController": {"measured": ["store0.omega"], "A": 0.0, "B": 1.0, "C": 2.0, "D": 1.5, "reference": 4.0},
    "TransferFunctionController": {
        "measured": "store0.omega",
        "numerator": [1.5, 2.0],
        "denominator": [1.0, 3.0],
        "reference": 4.0,
    },
    "CoulombLoad": {"tau": 2.0, "omega_s": 0.3},
    "HardStop": {"upper": 0.1, "c": 5.0, "omega_rest": 1e-3},
    "LossyGear": {"ratio": 2.5, "efficiency": 0.8},
    "DCMachine": {"k": 0.4, "R": 1.5, "L": 0.3},
    "SpeedSource": {"omega": sympy.sin(3 * sw.t)},
    "VoltageSource": {"u": sympy.cos(3 * sw.t)},
    "TorqueSource": {"tau": 2 - sw.omega},
    "HarmonicTorque": {"harmonics": sw.Harmonics((0.5, 2.0), (1.5, 0.7), (0.3, -1.0)), "mean": 2.0},
    "ForceSource": {"f": 2 - sw.v},
    "CurrentSource": {"i": 1 - sw.u},
}


def registered() -> list[str]:
    """The components of the library."""
    return [name for name, kind in REGISTRY.items() if kind.__module__.startswith("shaftwork.components.")]


def bed_of(name: str) -> sw.Network:
    """The component with a moving store behind a lossy element at every port, and a push that starts the motion."""
    kind = REGISTRY[name]
    numbers = {key: 1.5 for key, declared in kind.declared.items() if declared.required}
    net = sw.Network(f"test bed of {name}")
    nodes = [f"n{k}" for k in range(len(kind.ports))]
    net.add(kind("subject", **{**numbers, **VALUES.get(name, {})}), *nodes)
    for k, (port, node) in enumerate(zip(kind.ports, nodes, strict=True)):
        push = 3.0 - k
        # a curve over speed needs the speed of a store, or it would stand in an equation that has no explicit solution
        direct = len(kind.ports) == 1 and kind.role in ("source", "loss")
        far = node if direct else f"far{k}"
        if port.domain is ELECTRICAL:
            net.add(sw.CurrentSource(f"push{k}", i=push), far, "ground")
            net.add(sw.Capacitor(f"store{k}", C=0.3), far, "ground")
            net.add(sw.Resistor(f"loss{k}", R=0.8), far, node)
        elif port.domain is TRANSLATION:
            net.add(sw.ForceSource(f"push{k}", f=push), far)
            net.add(sw.Mass(f"store{k}", m=0.3), far)
            net.add(sw.TranslationalDamper(f"loss{k}", d=0.8), far, node)
        else:
            assert port.domain in (ROTATION, None)
            net.add(sw.TorqueSource(f"push{k}", tau=push), far)
            net.add(sw.Inertia(f"store{k}", J=0.3), far)
            net.add(sw.Damper(f"loss{k}", d=0.8), far, "ground" if direct else node)
    return net
