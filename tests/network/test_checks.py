"""Each slip in a network that can be seen before its equations are made is said in the words of its author."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import Any

import numpy as np
import pint
import pytest
import sympy

import shaftwork as sw
from shaftwork.components import electrical, laws, mechanics, sources
from shaftwork.components.base import Component, Port, component
from shaftwork.components.branches import ACROSS, AcrossLaw, AcrossStore, Branch, IdealCoupling, ThroughLaw
from shaftwork.core.errors import Diagnostic
from shaftwork.core.parameters import parameter
from shaftwork.network.checks import connection_problems, examine
from shaftwork.network.grammar import FUNCTIONS
from shaftwork.network.graph import build_graph
from shaftwork.network.netlist import Netlist, Placed, Spelling

ROTOR = Placed(mechanics.Inertia("J1", J=1.0), ("rotor",))
SHAFT = Placed(mechanics.Spring("shaft", c=1e3, d=1.0), ("rotor", "wheel"))
WHEEL = Placed(mechanics.Inertia("J2", J=1.0), ("wheel",))
TRAIN = (ROTOR, SHAFT, WHEEL)


def typed_problems(net: Netlist) -> tuple[Diagnostic, ...]:
    return examine(net)[1]


def netlist(*further: tuple[Component, tuple[Any, ...]]) -> Netlist:
    """A sound train of two inertias with further parts."""
    return Netlist("train", (*TRAIN, *(Placed(part, nodes) for part, nodes in further)))


def typed(part: Component, *nodes: Any) -> Diagnostic:
    """The only problem that a part brings to the train as it is typed."""
    (problem,) = typed_problems(netlist((part, nodes)))
    return problem


def joined(*further: tuple[Component, tuple[str, ...]]) -> tuple[Diagnostic, ...]:
    """The problems of connection of the train with further parts."""
    return connection_problems(build_graph(netlist(*further)))


def test_a_sound_network_has_no_problems() -> None:
    assert typed_problems(netlist()) == ()
    assert joined() == ()


def test_a_network_without_parts_is_said_to_be_empty() -> None:
    (problem,) = typed_problems(Netlist("bare", ()))
    assert str(problem) == "empty network: 'bare' has no parts. Add parts: net.add(part, 'node')."


def test_equal_names_are_said_with_both_places() -> None:
    problem = typed(mechanics.Damper("shaft", d=1.0), "wheel")
    assert problem.message == "Damper 'shaft' at node 'wheel' has the name of Spring 'shaft' at nodes 'rotor', 'wheel'."
    assert "'shaft_2'" in problem.hint
    assert (problem.kind, problem.parts, problem.nodes) == ("duplicate name", ("shaft",), ("wheel",))


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("", "has no name"),
        (" ", "has no name"),
        ("ground", "stands for the frame"),
        ("a..b", "has a dot in its name"),
        ("two\nlines", "'two\\nlines' has no plain name"),
        ("n" * 201, "has no plain name"),
    ],
)
def test_a_part_that_cannot_be_named_is_said(name: str, words: str) -> None:
    problem = typed(mechanics.Inertia(name, J=1.0), "wheel")
    assert problem.kind == "part name"
    assert words in problem.message


@pytest.mark.parametrize(
    ("node", "kind"), [("", "node name"), (3, "node name"), ("a\nb", "node name"), ("J1.b", "dotted node name")]
)
def test_a_node_that_cannot_be_named_is_said(node: Any, kind: str) -> None:
    problem = typed(mechanics.Inertia("J3", J=1.0), node)
    assert problem.kind == kind
    assert "Inertia 'J3'" in problem.message


@pytest.mark.parametrize("nodes", [("rotor",), ("rotor", "wheel", "one more"), ()])
def test_a_wrong_number_of_nodes_is_said_with_the_ports(nodes: tuple[str, ...]) -> None:
    problem = typed(mechanics.Gear("g", ratio=2.0), *nodes)
    assert problem.kind == "node count"
    assert problem.message.endswith("but its ports are: a, b.")
    assert problem.hint == "Write net.add(part, 'node a', 'node b')."


def test_an_optional_port_may_be_left_out() -> None:
    assert typed_problems(netlist((mechanics.Damper("bearing", d=1.0), ("rotor",)))) == ()


def test_a_node_of_another_domain_is_said_with_the_part_that_came_first() -> None:
    problem = typed(electrical.Resistor("R", R=1.0), "rotor", "ground")
    assert problem.kind == "wrong domain"
    assert "domain electrical, but node 'rotor' belongs to rotation since Inertia 'J1' stands there" in problem.message


@pytest.mark.parametrize(
    ("part", "nodes"),
    [
        (mechanics.Spring("s", c=1.0), ("rotor", "rotor")),
        (mechanics.Damper("d", d=1.0), ("ground",)),
        (mechanics.Inertia("J3", J=1.0), ("ground",)),
        (electrical.VoltageSource("u", u=1.0), ("ground", "ground")),
    ],
)
def test_a_part_with_all_ends_at_one_node_does_nothing(part: Component, nodes: tuple[str, ...]) -> None:
    problem = typed(part, *nodes)
    assert problem.kind == "no effect"
    assert f"'{part.name}'" in problem.message
    assert problem.message.endswith(f"at node '{nodes[0]}' and does nothing there.")


def test_a_machine_with_its_terminals_joined_is_allowed() -> None:
    assert typed_problems(netlist((electrical.DCMachine("m", k=1.0, R=1.0), ("ground", "ground", "rotor")))) == ()


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (-1.0, "J = -1.0 must be at least 0"),
        (float("nan"), "J = nan must be a finite number"),
        (float("inf"), "J = inf must be a finite number"),
        ("heavy", "must be a number or a law, not str 'heavy'"),
        (None, "must be a number or a law, not NoneType"),
        (1j, "must be a number or a law, not complex"),
        ([1.0, 2.0], "must be a number or a law, not list"),
        (np.zeros(3), "must be a number or a law, not ndarray"),
    ],
)
def test_a_bad_value_is_said_with_unit_and_bounds(value: Any, words: str) -> None:
    problem = typed(mechanics.Inertia("J3", J=value), "wheel")
    assert words in problem.message
    law = ", or a formula such as 20 * sympy.sin(3 * sw.t)" if isinstance(value, str) else ""
    hint = f"Give J (moment of inertia, also over its angle or time) in kg*m^2, at least 0{law}."
    assert (problem.kind, problem.hint) == ("parameter", hint)
    assert (problem.parts, problem.nodes) == (("J3",), ("wheel",))


@pytest.mark.slow
def test_a_wrong_unit_is_said_with_the_right_one() -> None:
    problem = typed(mechanics.Inertia("J3", J=3 * pint.UnitRegistry().meter), "wheel")  # type: ignore[arg-type]
    assert problem.kind == "wrong unit"
    assert "is given in 'meter', but needs kg*m^2" in problem.message


def test_a_law_with_a_unit_is_said_to_be_written_in_plain_numbers() -> None:
    torque = 10 * pint.UnitRegistry().Unit("N*m") * laws.t
    problem = typed(sources.TorqueSource("motor", tau=torque), "wheel")
    assert problem.kind == "wrong unit"
    assert "tau has a unit but is no number; a law is written in plain numbers" in problem.message


@pytest.mark.parametrize(
    ("law", "words"),
    [
        (laws.v, "reads v, which belongs to another domain"),
        (sympy.Symbol("omega"), "contains a symbol omega of your own"),
        (sympy.Symbol("k") * laws.t, "contains the symbol k, which has no value"),
        (sympy.Function("f")(laws.t), "contains the unknown function f"),
        (sympy.I * laws.t, "is not a finite real law"),
        (sympy.ceiling(laws.t), "contains the unknown function ceiling"),
        (3.0 * sympy.erf(laws.omega) + 1, "contains the unknown function erf"),
        (sympy.Mod(laws.t, 2), "contains the unknown function Mod"),
        (sympy.gamma(laws.t), "contains the unknown function gamma"),
        (sympy.Derivative(sympy.sin(laws.t), laws.t), "contains the unknown function Derivative"),
        (sympy.Integral(sympy.sin(laws.t), (laws.t, 0, laws.t)), "contains the unknown function Integral"),
        (sympy.Piecewise((1, laws.t < 0.5)), "has Piecewise((1, t < 0.5)), without a value where no condition holds"),
        (laws.t < 1, "is a StrictLessThan, not a number or a law"),
        (sympy.Matrix([laws.t, 1]), "not a number or a law"),
    ],
)
def test_a_law_that_cannot_be_evaluated_is_said(law: Any, words: str) -> None:
    problem = typed(sources.TorqueSource("motor", tau=law), "rotor")
    assert problem.kind == "law"
    assert words in problem.message
    assert "TorqueSource 'motor': tau" in problem.message


def test_a_condition_in_place_of_a_law_is_answered_with_the_law_that_says_it() -> None:
    problem = typed(sources.TorqueSource("motor", tau=laws.omega > 3), "rotor")
    assert "omega - 3 in place of omega > 3" in problem.hint


@pytest.mark.parametrize("law", [laws.omega, laws.phi * laws.t])
def test_a_prescribed_speed_may_depend_on_time_alone(law: sympy.Expr) -> None:
    problem = typed(sources.SpeedSource("drive", omega=law), "rotor")
    assert "may depend on time t alone" in problem.message
    assert problem.kind == "law"


def test_laws_of_time_speed_angle_and_tables_are_allowed() -> None:
    law = laws.Step(3.0, 1.0) - laws.omega * laws.Table([0, 1], [0, 1])(laws.omega) + sympy.sin(laws.phi)
    parts = (sources.TorqueSource("a", tau=law), sources.TorqueSource("b", tau=laws.Table([0, 1], [0, 1])))
    assert typed_problems(netlist(*((part, ("rotor",)) for part in parts))) == ()


def test_an_unknown_function_is_answered_with_those_of_the_grammar() -> None:
    problem = typed(sources.TorqueSource("motor", tau=sympy.ceiling(laws.t)), "rotor")
    for name in (*FUNCTIONS, "Piecewise", "Table"):
        assert name in problem.hint


def test_every_function_of_the_grammar_is_allowed() -> None:
    """No name of the grammar is refused by the check that refuses the others."""
    known = [function.make(*[laws.omega, sympy.Integer(2)][: function.fewest]) for function in FUNCTIONS.values()]
    curves = [laws.Table([0, 1], [0, 1])(laws.omega), laws.Ramp(1.0, 0.1), sympy.Max(laws.t, laws.omega, 2.0)]
    for law in (*known, *curves, sympy.Piecewise((1, (laws.t < 1) | ~(laws.omega > 2)), (2, True))):
        assert typed_problems(netlist((sources.TorqueSource("motor", tau=law + laws.t), ("rotor",)))) == ()


def odd(make: Callable[[Any], Iterable[Any]]) -> Component:
    """A part of a user's class, whose branches come from a function of its parameters."""

    @component
    class Odd(Component):
        k: float = parameter("1", "a factor", default=2.0)
        ports = (Port("a"), Port("b", optional=True))

        def branches(self, p: Any) -> Iterator[Branch]:
            yield from make(p)

    return Odd("odd")


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda p: [AcrossStore(p.k / p.missing)], "missing"),
        (lambda _: [ThroughLaw(ACROSS, ("a", "nowhere"))], "'nowhere', which is no port"),
        (lambda _: [AcrossStore(laws.Step(2.0, 1.0, before=1.0))], "jumps at t = 1 s"),
        (lambda _: ["a"], "branch 1 is 'a', which is no branch"),
        (lambda _: [AcrossStore(1.0), None], "branch 2 is None, which is no branch"),
        (lambda _: [ThroughLaw("2*across")], "branch 1 (ThroughLaw) has '2*across', not a number or an expression"),
        (lambda _: [ThroughLaw([1.0])], "branch 1 (ThroughLaw) has [1.0], not a number"),
        (lambda _: [ThroughLaw(laws.t < 1)], "branch 1 (ThroughLaw) has t < 1, not a number"),
        (lambda _: [ThroughLaw(sympy.nan, label="drag")], "branch 1 (ThroughLaw 'drag') has nan, which has no finite"),
        (lambda _: [ThroughLaw(sympy.erf(ACROSS))], "a branch law contains the unknown function erf"),
    ],
)
def test_an_error_in_a_users_component_is_said_and_not_raised(make: Any, words: str) -> None:
    problem = typed(odd(make), "rotor")
    assert problem.kind == "component"
    assert "Odd 'odd': " in problem.message
    assert words in problem.message


@pytest.mark.parametrize(
    "branch",
    [
        ThroughLaw(sympy.nan * ACROSS),
        ThroughLaw(float("inf")),
        ThroughLaw(sympy.oo * ACROSS**2),
        ThroughLaw(sympy.I * ACROSS),
        AcrossLaw(sympy.zoo),
        AcrossStore(float("nan")),
        IdealCoupling(((1, "a", None), (sympy.nan, "b", None))),
    ],
    ids=str,
)
def test_a_branch_law_without_a_finite_value_is_said(branch: Branch) -> None:
    problem = typed(odd(lambda _: [branch]), "rotor")
    assert problem.kind == "component"
    assert f"Odd 'odd': branch 1 ({type(branch).__name__}) has " in problem.message
    assert "which has no finite real value" in problem.message


@pytest.mark.parametrize("number", [3, 3.0, np.float64(3.0), sympy.Rational(9, 3)], ids=lambda n: type(n).__name__)
def test_a_branch_takes_plain_numbers(number: Any) -> None:
    plain = odd(lambda _: [AcrossStore(number), ThroughLaw(number), ThroughLaw(number * ACROSS)])
    coupling = odd(lambda _: [IdealCoupling(((number, "a", None), (-number, "b", None)))])
    assert typed_problems(netlist((plain, ("rotor",)))) == ()
    assert typed_problems(netlist((coupling, ("rotor", "wheel")))) == ()
    (*_, store, torque, loss) = build_graph(netlist((plain, ("rotor",)))).branches
    assert [branch.template.law for branch in (store, torque, loss)] == pytest.approx([3.0, 3.0, 3.0])


def test_all_slips_are_reported_together_and_the_rest_can_be_assembled() -> None:
    broken = netlist(
        (mechanics.Inertia("J1", J=float("nan")), ("wheel",)),
        (mechanics.Gear("g", ratio=0.0), ("rotor", "out", "more")),
        (sources.TorqueSource("motor", tau=laws.v), ("rotor",)),
        (electrical.Resistor("R", R=-1.0), ("rotor", "ground")),
    )
    repaired, problems = examine(broken)
    kinds = ["duplicate name", "parameter", "node count", "parameter", "law", "wrong domain", "parameter"]
    assert [problem.kind for problem in problems] == kinds
    assert [placed.part.name for placed in repaired.placed] == ["J1", "shaft", "J2", "J1 (2)", "motor"]
    assert len(build_graph(repaired).branches) == 6  # J1, spring and damping, J2, J1 (2), motor


def test_a_loose_end_is_said_with_the_node_that_may_be_meant() -> None:
    (problem,) = joined((mechanics.Spring("line", c=1.0), ("rotor", "whel")))
    assert problem.message == "node 'whel': only Spring 'line' ends there, with its port b, so it can carry no load."
    assert problem.hint == "Join another part to 'whel' (did you mean node 'wheel'?), or remove 'line'."
    assert (problem.kind, problem.parts, problem.nodes) == ("loose end", ("line",), ("whel",))


def test_the_third_port_of_a_planetary_gear_is_a_loose_end() -> None:
    (problem,) = joined((mechanics.PlanetaryGear("p", ratio=2.0), ("rotor", "wheel", "ring")))
    assert "only PlanetaryGear 'p' ends there, with its port ring" in problem.message


def test_a_floating_part_is_said_once() -> None:
    (problem,) = joined((mechanics.Spring("adrift", c=1.0), ("x", "y")))
    assert problem.message == "Spring 'adrift' at nodes 'x', 'y' shares no node with any other part."
    assert (problem.kind, problem.parts, problem.nodes) == ("floating part", ("adrift",), ("x", "y"))


@pytest.mark.parametrize(
    ("part", "nodes"),
    [
        (mechanics.Damper("d", d=1.0), ("x",)),
        (mechanics.Ground("wall"), ("x",)),
        (sources.SpeedSource("w", omega=1.0), ("x",)),
        (electrical.DCMachine("m", k=1.0, R=1.0), ("x", "y", "z")),
    ],
)
def test_a_part_alone_at_its_nodes_floats(part: Component, nodes: tuple[str, ...]) -> None:
    assert [problem.kind for problem in joined((part, nodes))] == ["floating part"]


def test_two_trains_in_one_network_are_a_note() -> None:
    brake = mechanics.TranslationalDamper("d", d=1.0)
    (problem,) = joined((mechanics.Mass("m1", m=1.0), ("car",)), (brake, ("car",)))
    assert problem.message == "'m1', 'd' at node 'car' share no node with 'J1', 'shaft', 'J2'."
    assert (problem.kind, problem.severity) == ("separate train", "note")


def ship(propeller: str) -> sw.Network:
    net = sw.Network("ship")
    net.add(sw.TorqueSource("engine", tau=100.0), "flange")
    net.add(sw.Inertia("J1", J=1.0), "flange")
    net.add(sw.Shaft("line", length=1.0, diameter=0.05), "flange", "prop")
    net.add(sw.Inertia("JP", J=3.0), propeller)
    net.add(sw.FanLoad("water", tau_n=100.0, n_n=100.0), propeller)
    return net


@pytest.mark.slow
def test_a_train_that_nothing_drives_is_told_by_its_motion() -> None:
    """By a misspelt node, the propeller is none of the line; what is given a speed moves, and a driven train, too."""
    said = r"stays at rest: .*'JP', 'water' at node 'propeller'.*did you mean node 'prop'"
    with pytest.warns(sw.NetworkWarning, match=said):
        ship("propeller").simulate(0.01)
    ship("propeller").simulate(0.01, initial={"JP.omega": 3.0})
    ship("prop").simulate(0.01)
    driven = ship("propeller")
    driven.add(sw.TorqueSource("wake", tau=1.0), "propeller")
    driven.simulate(0.01)


def test_a_gap_that_is_open_drives_no_train() -> None:
    """It has a torque beyond its limits alone."""
    net = sw.Network("two trains")
    net.add(sw.TorqueSource("motor", tau=1.0), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Inertia("J2", J=1.0), "b")
    net.add(sw.Backlash("gap", gap=0.1, c=1e4, d=10.0), "b", "c")
    net.add(sw.Inertia("J3", J=1.0), "c")
    net.add(sw.Inertia("J4", J=1.0), "a")
    (problem,) = net.check()
    assert problem.kind == "separate train"
    assert "nothing drives that train" in problem.message
    with pytest.warns(sw.NetworkWarning, match="stays at rest: .*'J2', 'gap', 'J3'"):
        net.simulate(0.1)


@pytest.mark.parametrize("node", ["Ground", "GROUND"])
def test_a_node_that_is_written_like_the_frame_is_told_apart(node: str) -> None:
    net = sw.Network("braked")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Inertia("other", J=1.0), node)
    net.add(sw.Brake("brake", tau=1.0), "a", node)
    (problem,) = net.check()
    assert (problem.kind, problem.severity, problem.nodes) == ("nearly ground", "warning", (node,))
    assert "'ground', in small letters" in problem.message


def named_as(part: str, at: str) -> sw.Network:
    net = sw.Network("names")
    net.add(sw.TorqueSource("motor", tau=1.0), "rotor")
    net.add(sw.Inertia("J1", J=1.0), "rotor")
    net.add(sw.Spring("shaft", c=100.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=1.0), "wheel")
    net.add(sw.Inertia(part, J=1.0), at)
    return net


def test_a_part_with_the_name_of_a_node_where_it_is_not_is_said() -> None:
    net = named_as("wheel", "rotor")
    said = (
        "shared name: Inertia 'wheel' and node 'wheel' have the same name: 'wheel.omega' is read and set at node "
        "'rotor', where the part is, and that of node 'wheel' cannot be read. Rename one of them, for example the part "
        "'wheel_2'."
    )
    with pytest.warns(sw.NetworkWarning) as caught:
        sol = net.simulate(1.0, t_eval=11)
    assert [str(one.message) for one in caught] == [said]
    assert np.array_equal(sol["wheel.omega"], sol["J1.omega"])  # as the message says
    assert not np.allclose(sol["wheel.omega"], sol["J2.omega"])


@pytest.mark.parametrize(("part", "at"), [("wheel", "wheel"), ("wheel_2", "rotor")])
def test_a_part_at_the_node_of_its_name_has_its_speed(part: str, at: str) -> None:
    assert named_as(part, at).check() == ()


def test_a_part_without_the_quantity_of_a_node_may_have_its_name() -> None:
    """A damper has a speed between its ends, omega_rel, but none of its own."""
    net = named_as("J3", "wheel")
    net.add(sw.Damper("rotor", d=1.0), "rotor", "wheel")
    assert net.check() == ()


def test_an_inertia_alone_is_a_train() -> None:
    assert connection_problems(build_graph(Netlist("one", (ROTOR,)))) == ()


@pytest.mark.parametrize(
    ("name", "like"),
    [("whel", "wheel"), ("wheell", "wheel"), ("wehel", "wheel"), ("Wheel ", "wheel"), ("n2", "")],
)
def test_a_slip_of_one_letter_is_recognised_and_another_number_is_not(name: str, like: str) -> None:
    suggestion = Spelling(["wheel", "output", "n1", name]).suggestion([name])
    assert suggestion == (f" (did you mean node '{like}'?)" if like else "")
