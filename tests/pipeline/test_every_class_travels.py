"""Every public class can be pickled and copied, after all of it was read, and reads the same afterwards."""

from __future__ import annotations

import contextlib
import copy
import importlib
import inspect
import pickle
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any, is_typeddict

import numpy as np
import pytest
import sympy
from scipy import sparse

import shaftwork as sw
from shaftwork import studies
from shaftwork.results.measures import Measure
from shaftwork.sizing import catalogue, choose, duty
from shaftwork.studies.stability_cases import CASES
from tests.beds import bed_of

API = Path(__file__).parents[2] / "docs" / "api.md"
NOT_STORED = {
    "Session": "a conversation with a page: threads, and what it is asked at the moment",
    "Simulation": "it stands in the midst of a run; `save_state` gives what can be stored",
    "FMU": "the file of another tool, which is unpacked in this process",
    "FMUTorque": "a part of an FMU",
    "FMUSpeed": "a part of an FMU",
}
"""Public classes that stay in their process, and why."""
COMPILED = ("again", "dense", "observer", "reader", "extremes")
"""Of a motion, that with which more of it is read; what it reads is compared in `test_stored.py`."""


@cache
def public_classes() -> dict[str, type]:
    names = [line.removeprefix("::: ").strip() for line in API.read_text(encoding="utf-8").splitlines()]
    pairs = (name.rpartition(".") for name in names if name.startswith("shaftwork."))
    found = (getattr(importlib.import_module(module), name) for module, _, name in pairs)
    return {item.__name__: item for item in found if inspect.isclass(item) and not is_typeddict(item)}


def train() -> sw.Network:
    net = sw.Network("train")
    net.add(sw.TorqueSource("motor", tau=sw.Step(10.0, start=0.01) + sw.SmoothNoise(sw.t, 3)), "rotor")
    net.add(sw.Inertia("J1", J=2.0), "rotor")
    net.add(sw.Spring("shaft", c=1e4, d=1.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=3.0), "wheel")
    return net


def geared() -> sw.Network:
    net = train()
    net.add(sw.Gear("gear", ratio=4.0), "wheel", "slow")
    net.add(sw.Inertia("J3", J=30.0), "slow")
    net.add(sw.CoulombLoad("load", tau=5.0), "slow")
    return net


def lossy() -> sw.Network:
    net = train()
    net.add(sw.LossyGear("gear", ratio=4.0, efficiency=0.95), "wheel", "slow")
    net.add(sw.Inertia("J3", J=30.0), "slow")
    return net


def chain() -> sw.Network:
    net = train()
    net.add(sw.Spring("tail", c=2e4, d=1.0), "wheel", "end")
    net.add(sw.Inertia("J3", J=1.0), "end")
    return net


def roots() -> Iterator[Any]:
    """Something of everything, from which the other classes can be reached."""
    plain, hybrid, long = train(), geared(), chain()
    model, phased = plain.compile(), hybrid.compile()
    motion, through_phases = model.simulate(1.0), phased.simulate(1.0)
    f, orders = np.linspace(1.0, 30.0, 5), {"shaft.c": [9e3, 1e4]}
    yield from (plain, hybrid, model, phased, motion, through_phases)
    yield model.start().save_state()
    yield sw.spice.read("divider\nV1 a 0 5\nR1 a b 1k\nC1 b 0 1u\n.end\n")
    yield sw.read_modelica("model M\n  Modelica.Mechanics.Rotational.Components.Inertia J1(J = 1);\nequation\nend M;\n")
    yield phased.phase(through_phases.phases[-1].name)
    yield phased.phase(through_phases.phases[0])
    equations, switching = plain.equations(), hybrid.equations()
    yield from (equations, switching, plain.lagrangian(), long.lagrangian().proof())
    for made in (equations, switching):
        yield from (made.transfer_function("motor.tau", "shaft.tau"), made.state_space(), made.second_order)
    yield equations.transfer_function("motor.tau", "shaft.tau", values=True)
    yield from (
        model.linearize(),
        phased.linearize(),
        plain.modes(),
        plain.frequency_response("motor.tau", "J2.omega", f),
    )
    yield plain.campbell([1.0, 50.0])
    yield from (motion.energy, motion.spectrum("shaft.tau"), motion.rainflow("shaft.tau"))
    yield motion.order_spectra("J1.omega", "J1.omega", turns=0.1, start=0.3)
    yield motion.damage("shaft.tau", sn=sw.SNLine(amplitude=10.0, cycles=1e6, slope=5))
    yield from (plain.draw(), hybrid.draw(as_circuit=True), plain.circuit(), plain.circuit().analogy, plain.dual())
    yield from (motion.animate(seconds=0.5), plain.modes().animate(1, seconds=0.5))
    yield sw.report(plain, sections=["parts"])
    yield studies.sweep(plain, orders, t_end=0.1, measures={"peak": "max shaft.tau"})
    yield studies.frequency_sensitivities(plain, parameters=["shaft.c"])
    yield studies.motion_sensitivities(plain, {"peak": "max shaft.tau"}, t_end=0.1, parameters=["shaft.c"])
    yield studies.trajectory_sensitivities(plain, "shaft.tau", [0.0, 0.1], parameters=["shaft.c"])
    uncertain = studies.uncertainty(plain, {"J2.J": (2.0, 4.0)}, t_end=0.1, measures=["max shaft.tau"], samples=4)
    yield from (uncertain, uncertain.probability("max shaft.tau", above=0.0))
    yield studies.bands(plain, "shaft.tau", [0.0, 0.1], {"J2.J": [2.0, 4.0]})
    best = sw.optimize(plain, {"J2.J": (2.0, 4.0)}, "max shaft.tau", t_end=0.1)
    yield from (best, best.best)
    times = np.linspace(0.0, 0.1, 5)
    yield sw.fit(plain, {"t": times, "J2.omega": plain.simulate(0.1, t_eval=times)["J2.omega"]}, ["J2.J"])
    steel = {"length": 1.0, "diameter": 0.05, "density": 7850.0, "shear_modulus": 80e9}
    line = train()
    line.replace(sw.Shaft("shaft", **steel, model=sw.Lumped(3)))
    coarse = [sw.Lumped(2), sw.Lumped(4)]
    yield studies.work_precision(line, "shaft", t_end=1e-3, models=coarse, engines=["scipy"], rtols=[1e-6], points=21)
    yield studies.stability(cases=CASES[:1], models=coarse[:1], engines=["scipy"])
    yield from (sw.reduce.refer(hybrid, to="slow"), sw.reduce.simplify(long, masses=2, keep="shaft"))
    yield from (duty(motion, "motor"), choose(duty(motion, "motor")), catalogue(), sw.motors, sw.scenes.SCENES)
    calculation = torsional()
    yield from (calculation, calculation.modes.modes)
    yield from (model.cost(), line.equations().fields, lossy().lagrangian())
    yield sw.reduce.simplify(long, masses=2, keep="shaft").compare(0.1)
    yield from parts()
    yield from errors()


def torsional() -> Any:
    ship = sw.scenes.ship_engine()
    sections = [sw.torsional.Section("crank 4", diameter=0.15)]
    return sw.torsional_calculation(ship, np.linspace(80.0, 90.0, 2), sections=sections)


class Letters:
    """Stands for the parameters of a part: each is a symbol, and the mode is its first."""

    def __getattr__(self, name: str) -> sympy.Symbol:
        return sympy.Symbol(name, positive=True)


def parts() -> Iterator[Any]:
    """Declarations: components of one's own, laws, models of shafts."""
    yield from (sw.Lumped(5), sw.CentralDifference(4), sw.Spectral(5), sw.Wave(), sw.Rigid(), sw.OneSpring(), sw.Auto())
    yield from (sw.Table([0, 1], [0, 2]), sw.HeldNoise(sw.t, 3), sw.SmoothNoise(sw.t, 3), sw.Soil(mean=5e4, std=1e3))
    yield from (sw.Spring("s", c=1.0), sw.Notation(), sw.Inverse("K", "m", "a"))
    yield from (Measure.read("max shaft.tau"), sw.sizing.Reserve(1.5, 2.0, 1400.0, 4.0, 6.0))
    yield sw.torsional.BarredRange(80.0, 90.0, ((82.0, 88.0),), (85.0,), 5e7, 0.7, allowed=True)
    fan = train()
    fan.add(sw.TorqueSource("fan", tau=-(sw.omega**2)), "wheel")
    yield fan.equations().transfer_function("motor.tau", "shaft.tau").slopes
    letters = Letters()
    for name in (
        "Inertia",
        "Spring",
        "SpeedSource",
        "Gear",
        "LossyGear",
        "CoulombLoad",
        "HardStop",
        "DCMachine",
        "Shaft",
    ):
        part = bed_of(name).parts[0]
        yield from (*part.branches(letters), *part.modes(letters), *part.derived(letters))
        yield from (part.signals(), part.profiles())


def errors() -> Iterator[Exception]:
    with contextlib.suppress(sw.NetworkError):
        sw.Network("empty").compile()
    for call in (
        sw.Network("empty").compile,
        lambda: train().simulate(1.0)["shaft.x"],
        lambda: sw.Network.load("none"),
    ):
        try:
            call()
        except sw.ShaftworkError as error:
            yield error
    yield from (sw.MissingExtraError("pint", "units", "a unit"), sw.SimulationError("s"), sw.CompileError("c"))
    yield from (sw.ParameterError("p"), sw.NetworkWarning("n"), sw.AccuracyWarning("a"))


def attributes(thing: Any) -> dict[str, Any]:
    """What can be read of an object of the library, its methods apart."""
    values = {}
    for name in dir(thing):
        if not name.startswith("_") and name not in COMPILED:
            with contextlib.suppress(Exception):  # a part of it that this one has not
                values[name] = getattr(thing, name)
    return {name: value for name, value in values.items() if not callable(value) or is_ours(value)}


def is_ours(thing: Any) -> bool:
    return str(type(thing).__module__).startswith("shaftwork.") and not isinstance(thing, type | sympy.Basic)


def inside(thing: Any) -> Iterator[Any]:
    if isinstance(thing, Mapping):
        yield from list(thing.values())[:20]
    elif isinstance(thing, tuple | list):
        yield from thing[:20]
    if is_ours(thing):
        yield from attributes(thing).values()


def reached(things: Iterator[Any], wanted: Mapping[str, type], deep: int = 5) -> dict[str, list[Any]]:
    """By class, the first two of its objects that are met on the way through some objects."""
    met: dict[str, list[Any]] = {name: [] for name in wanted}
    seen: dict[int, Any] = {}
    layer = list(things)
    for _ in range(deep):
        fresh = {id(thing): thing for thing in layer if id(thing) not in seen}
        seen |= fresh
        for thing in fresh.values():
            for name, cls in wanted.items():
                if isinstance(thing, cls) and len(met[name]) < 2:
                    met[name].append(thing)
        layer = [other for thing in fresh.values() for other in inside(thing)]
    return met


def alike(first: Any, second: Any, deep: int = 3) -> bool:
    """Whether two objects read the same, numbers to the last bit."""
    if type(first) is not type(second):
        return False
    if isinstance(first, np.ndarray):
        return np.array_equal(first, second, equal_nan=first.dtype.kind in "fc")
    if sparse.issparse(first):
        return alike(first.toarray(), second.toarray())
    if isinstance(first, Mapping):
        return list(first) == list(second) and all(alike(first[key], second[key], deep) for key in first)
    if isinstance(first, tuple | list):
        return len(first) == len(second) and all(alike(*pair, deep) for pair in zip(first, second, strict=True))
    if isinstance(first, float):
        return first == second or (first != first and second != second)  # noqa: PLR0124 (NaN)
    if isinstance(first, BaseException):
        return str(first) == str(second)
    if is_ours(first) and deep:
        mine, other = attributes(first), attributes(second)
        return mine.keys() == other.keys() and all(alike(mine[name], other[name], deep - 1) for name in mine)
    return (
        is_ours(first) or not hasattr(type(first), "__eq__") or type(first).__eq__ is object.__eq__ or first == second
    )


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of motions as short as these, and of deprecated attributes that sympy lists
def test_every_public_class_is_stored_with_all_that_was_read_of_it() -> None:
    classes = {name: cls for name, cls in public_classes().items() if name not in NOT_STORED}
    met = reached(roots(), classes)
    assert [name for name, things in met.items() if not things] == []
    failures = []
    for name, things in met.items():
        for thing in things:
            for store in (lambda item: pickle.loads(pickle.dumps(item)), copy.deepcopy):  # noqa: S301 (written here)
                try:
                    again = store(thing)
                    if not alike(thing, again):
                        failures.append(f"{name}: reads otherwise")
                except (pickle.PicklingError, TypeError, AttributeError) as error:
                    failures.append(f"{name}: {error!r}")
    assert failures == []
