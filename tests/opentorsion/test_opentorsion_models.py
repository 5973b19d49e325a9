"""Models of openTorsion become networks with the same frequencies, or are refused with the place."""

from __future__ import annotations

import copy
import json
import random
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import opentorsion as ot
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import eigh, eigvals

import shaftwork as sw
from tests.mangling import mangled

Array = np.ndarray


def spring(left: int, right: int, k: float, **values: float) -> ot.Shaft:
    return ot.Shaft(left, right, k=k, **values)


def two_discs() -> ot.Assembly:
    return ot.Assembly([spring(0, 1, 9.775e6)], disk_elements=[ot.Disk(0, 211.4), ot.Disk(1, 8.3)])


def pinions() -> ot.Assembly:
    """Friswell, Penny, Garvey and Lees 2010, a motor and two rotors."""
    parent = ot.Gear(1, 25e-6, 1)
    gears = [parent, ot.Gear(2, 25e-6, 1, parent=parent)]
    shafts = [spring(0, 1, 1e4), spring(2, 3, 5e3), spring(1, 4, 5e3)]
    return ot.Assembly(
        shafts, disk_elements=[ot.Disk(0, 4e-4), ot.Disk(3, 7e-4), ot.Disk(4, 7e-4)], gear_elements=gears
    )


def five_discs() -> ot.Assembly:
    """Friswell et al. 2010, example 9.7.1."""
    shafts = [spring(k, k + 1, c) for k, c in enumerate((12e3, 12e3, 14e3, 10e3))]
    discs = [ot.Disk(k, J) for k, J in enumerate((3.5e-3, 3.5e-3, 3.5e-3, 0.15, 0.05))]
    return ot.Assembly(shafts, disk_elements=discs)


def branches() -> ot.Assembly:
    """Friswell et al. 2010, example 9.6.3: shafts by their size, without mass."""
    sizes = ((0, 1, 2.5e3, 200.0), (3, 5, 3.5e3, 250.0), (4, 6, 3.5e3, 250.0))
    shafts = [ot.Shaft(left, right, L, d, G=68e9, rho=0) for left, right, L, d in sizes]
    gears = [ot.Gear(1, 200, 0.5)]
    gears += [ot.Gear(2, 200, 0.5, parent=gears[0]), ot.Gear(3, 800, 0.8, parent=gears[0])]
    gears += [ot.Gear(4, 800, 0.8, parent=gears[1])]
    discs = [ot.Disk(0, 3200), ot.Disk(5, 450), ot.Disk(6, 450)]
    return ot.Assembly(shafts, disk_elements=discs, gear_elements=gears)


def drill_string(count: int = 8) -> ot.Assembly:
    """Friswell et al. 2010, example 9.9: a hollow shaft of 800 m as elements with mass."""
    shafts = [ot.Shaft(k, k + 1, 800e3 / count, 780, idl=650, G=75e9, rho=8000) for k in range(count)]
    return ot.Assembly(shafts, disk_elements=[ot.Disk(0, 200), ot.Disk(count, 10)])


def held() -> ot.Assembly:
    """Friswell et al. 2010, example 9.6, shortened: discs that springs hold to the frame."""
    shafts = [spring(0, 1, 2.5e6), spring(1, 2, 4e7)]
    return ot.Assembly(shafts, disk_elements=[ot.Disk(0, 90, k=1e7), ot.Disk(1, 140), ot.Disk(2, 350, k=3e6)])


def windmill() -> ot.Assembly:
    discs = [ot.Disk(k, J) for k, J in enumerate((1e7, 5770, 97030))]
    return ot.Assembly([spring(0, 1, 3.67e8), spring(1, 2, 5.496e9)], disk_elements=discs)


def car() -> ot.Assembly:
    gears = [ot.Gear(1, 3100, 1)]
    gears += [ot.Gear(2, 100, 2, parent=gears[0]), ot.Gear(4, 110, 2, parent=gears[0])]
    shafts = [spring(0, 1, 23470, c=150), spring(2, 3, 80e3 * 6.4423, c=150), spring(4, 5, 80e3 * 9.994, c=150)]
    discs = [ot.Disk(0, 3100), ot.Disk(3, 300), ot.Disk(5, 172)]
    return ot.Assembly(shafts, disk_elements=discs, gear_elements=gears)


def steam_turbine() -> ot.Assembly:
    """Gunter and Chen 2001, example 8.1: two turbines on one propeller, in pounds and inches."""
    unit = 0.11298
    gears = [ot.Gear(1, 0.826e6 * unit, 9.4094)]
    gears += [ot.Gear(2, 0, 1, parent=gears[0]), ot.Gear(3, 1.283e4 * unit, 40.0424)]
    gears += [ot.Gear(4, 0, 9.4094, parent=gears[2]), ot.Gear(6, 0, 1, parent=gears[0])]
    gears += [ot.Gear(7, 2.723e4 * unit, 78.2365)]
    gears += [ot.Gear(8, 0, 9.4094, parent=gears[5])]
    lines = ((0, 1, 826e6), (2, 3, 203.94e6), (4, 5, 30.51e6), (6, 7, 24.17e6), (8, 9, 14.26e6))
    shafts = [spring(left, right, k * unit) for left, right, k in lines]
    masses = ((0, 2.454e6, 3.86e6), (5, 1.509e4, 108.77), (9, 2.612e2, 42.738))
    discs = [ot.Disk(node, J * unit, c=d * unit) for node, J, d in masses]
    return ot.Assembly(shafts, disk_elements=discs, gear_elements=gears)


def soft_teeth() -> ot.Assembly:
    parent = ot.ElasticGear(1, 2.0, 50.0)
    gears = [parent, ot.ElasticGear(2, 5.0, 150.0, k=3e5, c=20.0, parent=parent)]
    shafts = [spring(0, 1, 2e5, c=5.0), spring(2, 3, 4e5, c=7.0)]
    return ot.Assembly(shafts, disk_elements=[ot.Disk(0, 1.0, c=2.0), ot.Disk(3, 30.0)], elastic_gear_elements=gears)


EXAMPLES: tuple[Callable[[], ot.Assembly], ...] = (
    two_discs,
    pinions,
    five_discs,
    branches,
    drill_string,
    held,
    windmill,
    car,
    steam_turbine,
    *((soft_teeth,) if hasattr(ot, "ElasticGear") else ()),
)


def frequencies_of(assembly: ot.Assembly) -> Array:
    """Hz, without the free rotation, from the matrices of the assembly as a symmetric eigenvalue problem."""
    squares = eigh(assembly.K, assembly.M, eigvals_only=True)
    return np.sqrt(squares[squares > 1e-9 * squares.max()]) / (2 * np.pi)


def rates_of(assembly: ot.Assembly) -> Array:
    """1/s, with damping, those that are not the free rotation."""
    n = len(assembly.M)
    inverse = np.linalg.inv(assembly.M)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ assembly.K, -inverse @ assembly.C]])
    rates = eigvals(A)
    return rates[np.abs(rates) > 1e-6 * np.abs(rates).max()]


def undamped(assembly: ot.Assembly) -> ot.Assembly:
    for element in (*assembly.shaft_elements, *assembly.disk_elements, *(assembly.elastic_gear_elements or ())):
        if element.c:
            element.c = 0.0
    assembly.C = assembly.assemble_C()
    return assembly


@pytest.mark.parametrize("example", EXAMPLES)
def test_frequencies_are_those_of_opentorsion(example: Callable[[], ot.Assembly]) -> None:
    assembly = undamped(example())
    ours = np.sort(sw.from_opentorsion(assembly).modes().frequencies)
    theirs = frequencies_of(assembly)
    assert ours[-len(theirs) :] == pytest.approx(theirs, rel=1e-10)
    assert np.all(ours[: -len(theirs)] < 1e-6 * theirs[-1])


@pytest.mark.parametrize("example", EXAMPLES)
def test_damped_rates_are_those_of_opentorsion(example: Callable[[], ot.Assembly]) -> None:
    assembly = example()
    assembly = ot.Assembly(
        assembly.shaft_elements,
        [ot.Disk(disc.node, disc.I, disc.c or 1e-3 * disc.I, disc.k) for disc in assembly.disk_elements],
        assembly.gear_elements,
        assembly.elastic_gear_elements,
    )
    ours = np.linalg.eigvals(sw.from_opentorsion(assembly).compile().linearize().A)
    # an unsymmetric eigenvalue problem: rounding moves rates by some 1e-15 of the largest, times their condition
    for rate in rates_of(assembly):
        assert np.abs(ours - rate).min() < 1e-9 * np.abs(rates_of(assembly)).max()


def test_a_forced_response_is_that_of_opentorsion() -> None:
    assembly = car()
    net = sw.from_opentorsion(assembly)
    net.add(sw.TorqueSource("shake", tau=0.0), "n0")
    f = np.array([0.1, 0.7, 3.0, 12.0])
    ours = net.frequency_response("shake.tau", "disk 0.omega", f).values
    torques = np.zeros((len(assembly.M), len(f)), dtype=complex)
    torques[0] = 1.0
    _, speeds = assembly.ss_response(torques, 2 * np.pi * f)
    assert np.abs(ours / speeds[0] - 1).max() < 1e-10


@st.composite
def assemblies(draw: st.DrawFn) -> ot.Assembly:
    """Chains with mass or without, with gears between them, and an elastic pair where this openTorsion has them."""
    size = st.floats(0.1, 10.0)
    shafts, discs, gears, node = [], [ot.Disk(0, draw(size))], [], 0
    for _ in range(draw(st.integers(1, 3))):
        for _ in range(draw(st.integers(1, 4))):
            mass = draw(st.sampled_from((0.0, 0.1))) * draw(size)
            shafts.append(spring(node, node + 1, 1e4 * draw(size), I=mass))
            node += 1
            discs.append(ot.Disk(node, draw(size)))
        parent = ot.Gear(node, draw(size), draw(size))
        gears += [parent, ot.Gear(node + 1, draw(size), draw(size), parent=parent)]
        node += 1
        shafts.append(spring(node, node + 1, 1e4 * draw(size)))
        node += 1
        discs.append(ot.Disk(node, draw(size)))
    return ot.Assembly(shafts, disk_elements=discs, gear_elements=gears)


@given(assemblies())
def test_random_assemblies_have_the_frequencies_of_opentorsion(assembly: ot.Assembly) -> None:
    ours = np.sort(sw.from_opentorsion(assembly).modes().frequencies)
    theirs = frequencies_of(assembly)
    assert ours[-len(theirs) :] == pytest.approx(theirs, rel=1e-10)


def test_what_was_put_into_a_matrix_is_refused() -> None:
    assembly = two_discs()
    assembly.K[0, 0] += 1e6
    with pytest.raises(sw.ParameterError, match=r"matrix K .* not the one that its elements make.*Spring or Damper"):
        sw.from_opentorsion(assembly)


def test_a_value_out_of_range_is_named_by_the_check_of_the_network() -> None:
    system = changed(wind_turbine(), lambda s: s["components"][1]["elements"][0].update(stiffness=-1.0))
    with pytest.raises(sw.NetworkError, match=r"Spring 'Shaft\.Shaft 1': c = -1"):
        sw.from_opentorsion(system).modes()


@pytest.mark.parametrize("source", [3, None, [1.0], object()])
def test_what_is_no_model_is_refused(source: Any) -> None:
    with pytest.raises(sw.ParameterError, match=r"is no openTorsion model\. Give an opentorsion\.Assembly"):
        sw.from_opentorsion(source)


def element(kind: str, name: str, **values: Any) -> dict[str, Any]:
    return {"name": name, "type": kind, "damping": 0.0, **values}


def wind_turbine() -> dict[str, Any]:
    """The sample of openTorsion's editor: a rotor, a shaft and a turbine."""
    rotor = [
        element("Disk", "Disk 1", inertia=3430, damping=1),
        element("ShaftDiscrete", "Shaft 1", stiffness=5.55e9),
        element("Disk", "Disk 2", inertia=95200),
    ]
    shaft, turbine = [element("ShaftDiscrete", "Shaft 1", stiffness=3.68e8)], [element("Disk", "Disk 1", inertia=9.2e6)]
    parts = {"Rotor": rotor, "Shaft": shaft, "Turbine": turbine}
    return {
        "name": "wind turbine",
        "components": [{"name": name, "elements": elements} for name, elements in parts.items()],
        "structure": [["Rotor.Disk 2", "Shaft.Shaft 1"], ["Shaft.Shaft 1", "Turbine.Disk 1"]],
    }


def gearbox() -> dict[str, Any]:
    """A motor on one shaft of a gear, two loads on the others, shafts by their size."""
    steel = {"length": 400.0, "innerDiameter": 0.0, "outerDiameter": 60.0, "density": 7850.0}
    box = [
        element("Disk", "motor", inertia=0.5),
        element("ShaftContinuous", "in", **steel),
        element("GearElement", "wheel", inertia=0.1, teeth=20, diameter=0.1),
        element("GearElement", "left", inertia=0.2, teeth=50, diameter=0.25, parent="wheel"),
        element("ShaftDiscrete", "left shaft", stiffness=3e4),
        element("Disk", "left load", inertia=2.0),
        element("GearElement", "right", inertia=0.3, teeth=40, diameter=0.2, parent="wheel"),
        element("ShaftContinuous", "right shaft", **steel | {"innerDiameter": 20.0}),
    ]
    load = [element("Disk", "load", inertia=3.0), element("ShaftDiscrete", "tail", stiffness=2e4)]
    end = [element("Disk", "end", inertia=1.0)]
    parts = {"box": box, "load": load, "end": end}
    return {
        "name": "gearbox",
        "components": [{"name": name, "elements": elements} for name, elements in parts.items()],
        "structure": [["box.right shaft", "load.load"], ["load.tail", "end.end"]],
    }


@pytest.mark.parametrize("system", [wind_turbine(), gearbox()], ids=lambda system: system["name"])
def test_systems_in_files_have_the_frequencies_of_opentorsion(system: dict[str, Any], tmp_path: Path) -> None:
    path = tmp_path / "system.json"
    path.write_text(json.dumps(system), encoding="utf-8")
    assembly = ot.Assembly.from_tors(system)
    ours = np.sort(sw.from_opentorsion(path).modes().frequencies)
    theirs = frequencies_of(assembly)
    # the damping of 1 N m s/rad of one disc moves the frequency by less than 1e-13 of it
    assert ours[-len(theirs) :] == pytest.approx(theirs, rel=1e-10)
    assert sw.from_opentorsion(system, "mine").name == "mine"


def test_parts_have_the_names_of_component_and_element() -> None:
    net = sw.from_opentorsion(gearbox())
    names = [part.name for part in net.parts]
    assert {"box.motor", "box.in", "box.wheel", "box.left mesh", "load.tail", "end.end"} <= set(names)


def test_what_follows_in_the_middle_of_a_component_stands_beside_the_rest() -> None:
    system = wind_turbine()
    system["structure"] = [["Rotor.Disk 1", "Shaft.Shaft 1"], ["Shaft.Shaft 1", "Turbine.Disk 1"]]
    net = sw.from_opentorsion(system)
    wired = {item.part.name: item.nodes for item in net.netlist().placed}
    assert wired["Rotor.Shaft 1"][0] == wired["Shaft.Shaft 1"][0] == wired["Rotor.Disk 1"][0]


def changed(system: dict[str, Any], change: Callable[[dict[str, Any]], Any]) -> dict[str, Any]:
    other = copy.deepcopy(system)
    change(other)
    return other


WRONG = {
    r'"components" and "structure"': lambda s: s.pop("components"),
    r'component \'Rotor\', element \'Disk 1\': "inertia" is missing': lambda s: s["components"][0]["elements"][0].pop(
        "inertia"
    ),
    r'"inertia" is nan': lambda s: s["components"][0]["elements"][0].update(inertia=float("nan")),
    r"its type is 'Disc'\. Types are: Disk": lambda s: s["components"][0]["elements"][0].update(type="Disc"),
    r"element 'Disk 1': its type is missing": lambda s: s["components"][0]["elements"][0].update(
        {"": 1.0, "type": None}
    ),
    r"names the component 'Rotr', which is not": lambda s: s["structure"][0].__setitem__(0, "Rotr.Disk 2"),
    r"has no element 'Disk 9'": lambda s: s["structure"][0].__setitem__(0, "Rotor.Disk 9"),
    r"0 components follow no other": lambda s: s["structure"].append(["Turbine.Disk 1", "Rotor.Disk 1"]),
    r"2 components follow no other": lambda s: s["structure"].pop(),
    r"a component follows two others": lambda s: s["structure"].append(["Rotor.Disk 1", "Turbine.Disk 1"]),
    r"Two components have one name": lambda s: s["components"][1].update(name="Rotor"),
    r"a Disk has no stiffness": lambda s: s["components"][0]["elements"][0].update(stiffness=1.0),
}


@pytest.mark.parametrize("words", WRONG)
def test_what_is_wrong_in_a_system_is_named_with_its_place(words: str) -> None:
    with pytest.raises(sw.ModelFileError, match=words):
        sw.from_opentorsion(changed(wind_turbine(), WRONG[words]))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"parent": "wheels"}, r"element 'left': its parent 'wheels' is no gear before it"),
        ({"teeth": 0}, r"teeth of 0\. Give a number above zero"),
        ({"diameter": None, "teeth": None}, r"\"teeth\" is missing"),
    ],
)
def test_what_is_wrong_with_gears_is_named(change: dict[str, Any], words: str) -> None:
    system = gearbox()
    system["components"][0]["elements"][3].update(change)
    with pytest.raises(sw.ModelFileError, match=words):
        sw.from_opentorsion(system)


@pytest.mark.parametrize("text", ["", "{", "[" * 100000, '"x"', "[]", "nul", "\0"])
def test_a_file_that_is_no_system_is_refused(text: str, tmp_path: Path) -> None:
    path = tmp_path / "system.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(sw.ModelFileError, match=r"system\.json"):
        sw.from_opentorsion(path)
    with pytest.raises(sw.ModelFileError, match="cannot be read"):
        sw.from_opentorsion(tmp_path / "none.json")


@pytest.mark.slow
def test_mutated_systems_are_read_or_refused(tmp_path: Path) -> None:
    chance, path = random.Random(7), tmp_path / "system.json"  # noqa: S311
    for _ in range(1000):
        system = json.dumps(chance.choice((wind_turbine(), gearbox())))
        text = mangled(system, chance, '{}[]":,.0123456789-eE nul\\\u00e4', changes=6, longest=20)
        path.write_text(text, encoding="utf-8")
        with suppress(sw.ModelFileError):
            sw.from_opentorsion(path).check()  # which never raises
