"""Networks are changed part by part, stand within other networks, and say on one screen what is in them."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import sympy

import shaftwork as sw


def stage(ratio: float = 5.0) -> sw.Network:
    """A gear on a shaft."""
    net = sw.Network("stage", ports=("in_", "out"))
    net.add(sw.Gear("gear", ratio=ratio), "in_", "middle")
    net.add(sw.Inertia("J", J=0.1), "middle")
    net.add(sw.Spring("shaft", c=1e4, d=2.0), "middle", "out")
    return net


def driven(first: sw.Network, second: sw.Network) -> sw.Network:
    """A motor, two stages and a load."""
    net = sw.Network("drive")
    net.add(sw.TorqueSource("motor", tau=sw.Step(1.0, start=0.1)), "rotor")
    net.add(sw.Inertia("J1", J=0.02), "rotor")
    net.add(first, "rotor", "mid", name="first")
    net.add(sw.Inertia("J_mid", J=0.3), "mid")
    net.add(second, "mid", "wheel", name="second")
    net.add(sw.Inertia("J2", J=8.0), "wheel")
    return net


def flat() -> sw.Network:
    """The same drive, part by part."""
    net = sw.Network("drive")
    net.add(sw.TorqueSource("motor", tau=sw.Step(1.0, start=0.1)), "rotor")
    net.add(sw.Inertia("J1", J=0.02), "rotor")
    for name, a, b, ratio in (("first", "rotor", "mid", 5.0), ("second", "mid", "wheel", 3.0)):
        net.add(sw.Gear(f"{name}_gear", ratio=ratio), a, f"{name}_middle")
        net.add(sw.Inertia(f"{name}_J", J=0.1), f"{name}_middle")
        net.add(sw.Spring(f"{name}_shaft", c=1e4, d=2.0), f"{name}_middle", b)
        if name == "first":
            net.add(sw.Inertia("J_mid", J=0.3), "mid")
    net.add(sw.Inertia("J2", J=8.0), "wheel")
    return net


def test_a_network_used_twice_moves_as_its_parts_do() -> None:
    sol, other = driven(stage(), stage(3.0)).simulate(0.5), flat().simulate(0.5)
    assert "first.shaft.tau" in sol.names
    assert "second.middle.omega" in sol.names
    for name in ("first.shaft.tau", "second.J.omega", "second.gear.tau_b"):
        assert np.array_equal(sol[name], other[name.replace(".", "_", 1)]), name


def test_parameters_and_start_values_within_a_network_have_its_name() -> None:
    net = driven(stage(), stage())
    model = net.compile()
    sol = model.simulate(0.1, parameters={"second.gear.ratio": 3.0}, initial={"first.J.omega": 1.0})
    assert np.array_equal(sol.x, driven(stage(), stage(3.0)).simulate(0.1, initial={"first.J.omega": 1.0}).x)
    assert sol["first.J.omega"][0] == 1.0


def test_a_network_stands_within_one_that_stands_within_another() -> None:
    line = sw.Network("line", ports=("a", "b"))
    line.add(stage(), "a", "half", name="front")
    line.add(sw.Inertia("J_half", J=0.3), "half")
    line.add(stage(3.0), "half", "b", name="rear")
    net = sw.Network("drive")
    net.add(sw.TorqueSource("motor", tau=sw.Step(1.0, start=0.1)), "rotor")
    net.add(sw.Inertia("J1", J=0.02), "rotor")
    net.add(line, "rotor", "wheel")
    net.add(sw.Inertia("J2", J=8.0), "wheel")
    sol = net.simulate(0.5)
    assert np.allclose(sol["line.rear.shaft.tau"], flat().simulate(0.5)["second_shaft.tau"], rtol=1e-12, atol=1e-12)
    net.add(sw.Spring("odd", c=-1.0), "line.rear.middle", "wheel")
    net.replace(sw.Spring("line.rear.shaft", c=-1.0))
    assert {part for problem in net.check() for part in problem.parts} == {"odd", "line.rear.shaft"}
    assert "Spring 'line.rear.shaft': c = -1.0 must be at least 0" in str(net.check()[0])


def test_a_network_with_networks_in_it_is_saved_and_loaded(tmp_path: Path) -> None:
    net = driven(stage(), stage(3.0))
    net.save(tmp_path / "drive.toml")
    again = sw.Network.load(tmp_path / "drive.toml")
    assert again.netlist() == net.netlist()
    assert np.array_equal(again.simulate(0.1).x, net.simulate(0.1).x)


def test_the_ports_of_a_network_are_saved_and_loaded(tmp_path: Path) -> None:
    stage().save(tmp_path / "stage.toml")
    loaded = sw.Network.load(tmp_path / "stage.toml")
    assert loaded.ports == ("in_", "out")
    assert driven(loaded, stage(3.0)).netlist() == driven(stage(), stage(3.0)).netlist()


def test_parts_of_two_networks_have_their_own_letters() -> None:
    text = driven(stage(), stage()).equations().latex()
    assert r"c_{\mathrm{first" in text
    assert r"c_{\mathrm{second" in text
    named = sw.Network("stage", ports=("in_", "out"))
    named.add(sw.Spring("shaft", c=1e4, symbol="w"), "in_", "out")
    equations = driven(named, named).equations()
    letters = [letter for name, letter in equations.symbol_names.items() if name.endswith("shaft.c")]
    assert len(letters) == len({*letters}) == 2


def test_a_network_is_added_as_it_stands() -> None:
    first = stage()
    net = driven(first, first)
    first.replace(sw.Gear("gear", ratio=7.0))
    assert [part.ratio for part in net.parts if isinstance(part, sw.Gear)] == [5.0, 5.0]


def test_several_ports_may_be_joined_at_one_node_or_at_the_frame() -> None:
    net = sw.Network("held")
    net.add(stage(), "rotor", "ground", name="first")
    assert {placed.nodes for placed in net.netlist().placed} == {
        ("rotor", "first.middle"),
        ("first.middle",),
        ("first.middle", "ground"),
    }


@pytest.mark.parametrize(
    ("add", "words"),
    [
        (lambda net: net.add(stage(), "rotor"), "is given 1 nodes, but its ports are: in_, out"),
        (lambda net: net.add(sw.Network("bare"), "rotor"), "Network 'bare' has no ports"),
        (lambda net: net.add(sw.Network("odd", ports=("in_",)), "rotor"), "its port 'in_' is no node"),
        (lambda net: net.add(stage(), "rotor", 3), "a node is named by a text, not by 3"),
        (lambda net: net.add(sw.Inertia("J", J=1.0), "rotor", name="K"), "name = 'K' is for networks within networks"),
        (lambda _net: sw.Network("odd", ports=("a", "a")), "must be names of nodes, each once"),
        (lambda _net: sw.Network("odd", ports=(3,)), "ports = (3,) must be names of nodes"),
    ],
)
def test_a_network_that_cannot_be_joined_is_refused_where_it_is_added(add: object, words: str) -> None:
    with pytest.raises(sw.ShaftworkError) as refused:
        add(sw.Network("drive"))  # type: ignore[operator]
    assert words in str(refused.value)


def test_a_part_and_a_network_of_one_name_are_told_apart() -> None:
    net = driven(stage(), stage())
    net.add(sw.Inertia("first", J=1.0), "rotor")
    problems = [str(problem) for problem in net.check() if problem.severity == "error"]
    assert any("has a dot in its name, and 'first' is a part" in problem for problem in problems), problems


@pytest.mark.parametrize("name", [".J", "J.", "a..b", "ground.J", " .J"])
def test_a_name_with_dots_names_the_network_before_each_of_them(name: str) -> None:
    net = flat()
    net.add(sw.Inertia(name, J=1.0), "rotor")
    assert [problem.kind for problem in net.check()] == ["part name"]


def test_a_part_is_removed_with_the_nodes_where_nothing_is_left() -> None:
    net = flat()
    net.remove("second_J")
    assert "second_J" not in {part.name for part in net.parts}
    net.remove("J2")
    net.remove("second_shaft")
    assert "wheel" not in net.nodes


def test_a_network_within_another_is_removed_with_all_its_parts() -> None:
    net = driven(stage(), stage())
    net.remove("first")
    assert [part.name for part in net.parts] == [
        "motor",
        "J1",
        "J_mid",
        "second.gear",
        "second.J",
        "second.shaft",
        "J2",
    ]


def test_a_part_is_replaced_where_it_stands() -> None:
    net = flat()
    order = [part.name for part in net.parts]
    net.replace(sw.Shaft("first_shaft", length=1.0, diameter=0.05, density=7900.0, shear_modulus=77.5e9))
    assert [part.name for part in net.parts] == order
    assert next(placed for placed in net.netlist().placed if placed.part.name == "first_shaft").nodes == (
        "first_middle",
        "mid",
    )


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy])
def test_a_copy_of_a_network_is_changed_alone(copied: Callable[[sw.Network], sw.Network]) -> None:
    net = sw.Network("first", ports=("a",))
    net.add(sw.Inertia("J", J=2.0), "a")
    net.add(sw.Damper("d", d=1.0), "a")
    before, other = net.netlist(), copied(net)
    assert isinstance(other, sw.Network)
    assert other.netlist() == before
    other.replace(sw.Inertia("J", J=5.0))
    other.remove("d")
    other.add(sw.TorqueSource("T", tau=1.0), "a")
    other.name = "second"
    assert net.netlist() == before
    assert [part.name for part in other.parts] == ["J", "T"]


@pytest.mark.parametrize("change", ["remove", "replace"])
def test_what_is_not_there_is_answered_with_what_is(change: str) -> None:
    net = flat()
    with pytest.raises(sw.ParameterError, match=r"no part 'J_nid' in 'drive'\. Close to it: J_mid"):
        net.remove("J_nid") if change == "remove" else net.replace(sw.Inertia("J_nid", J=1.0))
    with pytest.raises(sw.ParameterError, match="Close to it: motor, J1"):
        net.remove("zzz") if change == "remove" else net.replace(sw.Inertia("zzz", J=1.0))


def test_what_is_no_component_replaces_none() -> None:
    net = flat()
    with pytest.raises(sw.ShaftworkError, match=r"replace\(\) takes a component such as .*, not 'J1'"):
        net.replace("J1")  # type: ignore[type-var]


def long_chain(count: int) -> sw.Network:
    net = sw.Network("chain")
    net.add(sw.KlossMotor("motor", tau_k=9.6, s_k=0.25, n_sync=3000), "n0")
    for k in range(count):
        net.add(sw.Inertia(f"J{k}", J=1.0 + k), f"n{k}")
        net.add(sw.Spring(f"spring {k}", c=1e4), f"n{k}", f"n{k + 1}")
    net.add(sw.Inertia("end", J=1.0), f"n{count}")
    return net


@pytest.mark.slow
@pytest.mark.parametrize(
    "net", [sw.Network(), flat(), sw.scenes.crane(gap=0.01), long_chain(300)], ids=lambda n: n.name
)
def test_everything_fits_on_one_screen(net: sw.Network) -> None:
    shown = [repr(net)]
    if net.parts:
        model, equations = net.compile(), net.equations()
        shown += [repr(model), repr(model.simulate(0.01)), str(equations), repr(equations), repr(net.graph())]
    for text in shown:
        assert "object at 0x" not in text
        assert 1 <= len(text.splitlines()) <= 25, text
        assert max(map(len, text.splitlines())) <= 100, text
        assert f"'{net.name}'" in text.splitlines()[0]


def test_a_network_says_its_parts_nodes_and_values() -> None:
    text = repr(flat())
    assert text.splitlines()[0] == "Network 'drive': 10 parts at 5 nodes"
    assert "  Spring        first_shaft   first_middle, mid" in text
    assert "c=10000, d=2" in text
    assert "and 5" in repr(long_chain(300)).splitlines()[-1]


def test_a_model_says_its_states_and_modes() -> None:
    text = repr(sw.scenes.crane(gap=0.01).compile())
    assert "states" in text
    assert "shaft: open, in contact" in text


def test_equations_are_printed_in_words_and_formulas() -> None:
    text = str(flat().equations())
    assert "first_shaft" in text
    assert "=" in text


@pytest.mark.slow
def test_a_motion_says_its_phases_and_events() -> None:
    sol = sw.scenes.crane(gap=0.01).simulate(0.5)
    assert f"{len(sol.events)} event" in repr(sol)
    assert sol.engine in repr(sol)


def test_a_law_and_a_table_are_shown_in_short() -> None:
    net = sw.Network("laws")
    net.add(sw.TorqueSource("a", tau=sw.Table([0.0, 1.0], [0.0, 5.0])), "rotor")
    net.add(sw.TorqueSource("b", tau=-22.4 * sympy.tanh(sw.omega / 0.01)), "rotor")
    assert "tau=Table of 2 points" in repr(net)
    assert "tanh" in repr(net)


def test_networks_are_equal_by_name_ports_parts_and_nodes() -> None:
    assert stage() == stage()
    assert copy.copy(stage()) == stage()
    assert stage(3.0) != stage()
    moved = stage()
    moved.remove("shaft")
    moved.add(sw.Spring("shaft", c=1e4, d=2.0), "out", "middle")
    assert moved != stage()
    renamed, closed = stage(), stage()
    renamed.name, closed.ports = "other", ()
    assert renamed != stage()
    assert closed != stage()
    assert stage() != "stage"
