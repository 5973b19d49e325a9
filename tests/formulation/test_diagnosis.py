"""Each fault of structure and of values is said with part, node and next step; nothing is raised."""

from __future__ import annotations

from typing import Any

import pytest
import sympy
from hypothesis import given

from shaftwork.components import bldc, electrical, loads, mechanics, sources  # noqa: F401 - registers all
from shaftwork.components.base import REGISTRY
from shaftwork.components.laws import Ramp, Step, omega, phi, t
from shaftwork.components.tables import Table
from shaftwork.core.errors import Diagnostic, ParameterError
from shaftwork.formulation.diagnosis import diagnose
from shaftwork.network.netlist import Netlist, Placed
from tests.malformations import malformed_networks
from tests.strategies import Network, networks


def part(kind: str, name: str, *nodes: str, **values: Any) -> Placed:
    return Placed(REGISTRY[kind](name, **values), nodes)


TRAIN = (
    part("Inertia", "J1", "rotor", J=1.0),
    part("Spring", "shaft", "rotor", "wheel", c=1e3, d=1.0),
    part("Inertia", "J2", "wheel", J=1.0),
)
MOTOR = {"tau_k": 9.6, "s_k": 0.25, "n_sync": 3000.0}


def problems(*further: Placed) -> tuple[Diagnostic, ...]:
    """What is said about a sound train of two inertias with further parts."""
    return diagnose(Netlist("train", (*TRAIN, *further)))[2]


def only(*further: Placed) -> Diagnostic:
    (problem,) = problems(*further)
    return problem


def test_a_sound_network_has_a_graph_a_form_and_no_problems() -> None:
    graph, form, said = diagnose(Netlist("train", TRAIN))
    assert graph is not None
    assert form is not None
    assert form.graph is graph
    assert said == ()


WINDINGS = {
    "BLDCMotor": {"U": 24.0, "R": 0.5, "L": 1e-3, "k": 0.05},
    "AveragedBLDC": {"U": 24.0, "R": 0.5, "L": 1e-3, "k": 0.05},
    "InductionMachine": {"U": 400.0, "f": 50.0, "L_m": 0.1, "L_s_sigma": 0.01, "L_r_sigma": 0.01, "R_r": 1.0},
}


@pytest.mark.parametrize("beside", ["nothing", "a damper", "a spring"])
@pytest.mark.parametrize("kind", WINDINGS)
def test_a_motor_with_windings_at_a_node_without_inertia_is_one_problem_for_all_of_them(kind: str, beside: str) -> None:
    others = {
        "nothing": (),
        "a damper": (part("Damper", "d", "bare", d=0.1),),
        "a spring": (part("Spring", "s", "bare", "rotor", c=100.0, d=1.0),),
    }
    problem = only(part(kind, "m", "bare", **WINDINGS[kind]), *others[beside])
    assert (problem.kind, problem.parts, problem.nodes) == ("controlled source", ("m",), ("bare",))
    assert "the speed of node 'bare', which has no inertia" in problem.message
    assert problem.hint.startswith("Give the node some inertia")


def test_two_speed_sources_on_one_rigid_group_are_named_with_the_gear_between() -> None:
    problem = only(
        part("SpeedSource", "first", "rotor", omega=1.0),
        part("Gear", "g", "rotor", "out", ratio=2.0),
        part("SpeedSource", "second", "out", omega=2.0),
    )
    assert problem.message == (
        "SpeedSource 'second' at node 'out' prescribes a speed that SpeedSource 'first' prescribes already "
        "through Gear 'g'."
    )
    assert problem.hint == "Keep one of them, or put a damper or spring between the two."
    assert (problem.kind, problem.severity) == ("two speed sources", "error")
    assert (problem.parts, problem.nodes) == (("second", "first", "g"), ("out", "rotor"))


def test_two_voltage_sources_in_parallel_are_named() -> None:
    said = problems(
        *(part("VoltageSource", name, "p", "ground", u=1.0) for name in ("u1", "u2")),
        part("DCMachine", "m", "p", "ground", "rotor", k=1.0, R=1.0),
    )
    assert [problem.kind for problem in said] == ["two voltage sources"]
    assert said[0].parts == ("u2", "u1")
    assert said[0].hint == "Keep one of them, or put a resistor or inductor between the two."


def test_a_speed_source_against_the_frame_is_named() -> None:
    problem = only(part("SpeedSource", "drive", "rotor", omega=1.0), part("Ground", "wall", "rotor"))
    assert problem.kind == "blocked speed source"
    assert "the speed of node 'rotor', which is held at zero through Ground 'wall'" in problem.message


LOCK = (part("Gear", "fast", "rotor", "out", ratio=2.0), part("Gear", "slow", "rotor", "out", ratio=3.0))


def test_a_contradictory_gear_loop_is_a_warning_with_both_ratios() -> None:
    problem = only(*LOCK)
    assert problem.message == (
        "Gear 'fast' and Gear 'slow' close a loop with omega('rotor') = 2 omega('out') by Gear 'fast', but 3 "
        "omega('out') by Gear 'slow': this is possible only while nodes 'rotor', 'out' stand still, locked."
    )
    assert (problem.kind, problem.severity) == ("locked gear loop", "warning")
    assert (problem.parts, problem.nodes) == (("fast", "slow"), ("rotor", "out"))


def test_the_ratios_of_a_longer_loop_multiply() -> None:
    problem = only(
        part("Gear", "g1", "rotor", "middle", ratio=2.0),
        part("Gear", "g2", "middle", "out", ratio=3.0),
        part("Gear", "g3", "rotor", "out", ratio=-5.0),
    )
    assert (
        "omega('rotor') = 6 omega('out') by Gear 'g1' and Gear 'g2', but -5 omega('out') by Gear 'g3'"
        in problem.message
    )


def test_a_planetary_gear_that_locks_is_named_without_ratios() -> None:
    problem = only(
        part("Gear", "g", "rotor", "carrier", ratio=2.0),
        part("Ground", "frame", "ring"),
        part("PlanetaryGear", "stage", "rotor", "carrier", "ring", ratio=3.0),
    )
    assert problem.message == (
        "Gear 'g' and PlanetaryGear 'stage' close a loop: this is possible only while nodes 'rotor', 'carrier' stand "
        "still, locked."
    )


def test_a_gear_that_locks_only_the_ring_of_a_planetary_gear_says_so() -> None:
    problem = problems(
        part("Inertia", "J3", "ring", J=1.0),
        part("Gear", "g", "rotor", "carrier", ratio=4.0),
        part("PlanetaryGear", "stage", "rotor", "carrier", "ring", ratio=3.0),
    )[0]
    assert problem.message.endswith("this is possible only while node 'ring' stands still, locked.")
    assert problem.nodes == ("ring",)


def test_a_speed_source_against_a_locked_gear_loop_names_the_gears() -> None:
    blocked, locked = problems(*LOCK, part("SpeedSource", "drive", "rotor", omega=1.0))
    assert (blocked.kind, locked.kind) == ("blocked speed source", "locked gear loop")
    assert "held at zero through Gear 'fast' and Gear 'slow'" in blocked.message
    assert blocked.parts == ("drive", "fast", "slow")


def test_a_redundant_gear_loop_is_allowed_and_noted_with_its_ratios() -> None:
    redundant, fixed = problems(*(part("Gear", name, "rotor", "out", ratio=2.0) for name in ("g1", "g2")))
    assert redundant.message == "Gear 'g2' asks for nothing that is not held by Gear 'g1' already."
    assert (redundant.kind, redundant.severity, redundant.parts) == ("redundant coupling", "note", ("g2", "g1"))
    assert "'g1.ratio', 'g2.ratio' match in a closed loop" in fixed.message
    assert (fixed.kind, fixed.severity, fixed.parts) == ("fixed ratios", "note", ("g1", "g2"))


def test_a_frame_at_the_frame_is_noted() -> None:
    assert "held by the frame already" in only(part("Ground", "wall", "ground")).message


def test_a_massless_node_with_only_a_torque_is_named_with_the_node_that_may_be_meant() -> None:
    problem = only(part("TorqueSource", "motor", "whel", tau=1.0))
    assert problem.message == (
        "node 'whel' has no inertia, no damper and no spring: nothing answers the torque of TorqueSource 'motor'."
    )
    assert problem.hint == "Give it an Inertia, or a Damper to the frame (did you mean node 'wheel'?)."
    assert (problem.kind, problem.parts, problem.nodes) == ("massless node", ("motor",), ("whel",))


def test_torques_on_a_massless_gear_are_all_named() -> None:
    loose, massless = problems(
        part("Gear", "g", "a", "out", ratio=2.0),
        part("TorqueSource", "one", "out", tau=1.0),
        part("TorqueSource", "two", "out", tau=t),
    )
    assert (loose.kind, loose.nodes) == ("loose end", ("a",))
    assert massless.parts == ("one", "two")
    assert massless.nodes == ("a", "out")
    assert "nothing answers the torque of TorqueSource 'one' and TorqueSource 'two'" in massless.message


def test_a_current_into_an_open_node_is_said_in_words_of_circuits() -> None:
    problem = only(part("CurrentSource", "i", "open", "ground", i=1.0))
    assert "node 'open' has no capacitor, no resistor and no inductor: nothing answers the current" in problem.message


def test_a_nonlinear_law_on_a_massless_node_is_an_algebraic_loop() -> None:
    problem = only(part("KlossMotor", "motor", "hub", **MOTOR), part("Spring", "s", "hub", "rotor", c=1.0))
    assert problem.message == (
        "node 'hub' has no inertia: the torque of KlossMotor 'motor' and the speed that it depends on determine each "
        "other, a nonlinear equation at every instant."
    )
    assert problem.hint == "Give the node some inertia, however small."
    assert (problem.kind, problem.parts, problem.nodes) == ("algebraic loop", ("motor",), ("hub",))


def test_a_nonlinear_law_beside_a_damper_on_a_massless_node_is_an_algebraic_loop() -> None:
    problem = only(part("KlossMotor", "motor", "hub", **MOTOR), part("Damper", "d", "hub", "rotor", d=1.0))
    assert "beside Damper 'd', the torque of KlossMotor 'motor'" in problem.message
    assert (problem.kind, problem.parts, problem.nodes) == ("algebraic loop", ("motor", "d"), ("hub",))


def test_a_law_of_the_angle_alone_beside_a_damper_is_no_loop() -> None:
    assert problems(part("TorqueSource", "cam", "hub", tau=-(phi**3)), part("Damper", "d", "hub", "rotor", d=1.0)) == ()


def test_nodes_on_springs_alone_have_no_speed() -> None:
    problem = only(*(part("Spring", name, "x", "y", c=1.0) for name in ("s1", "s2")))
    assert problem.message == (
        "nodes 'x', 'y' hang on nothing but 's1', 's2': nothing there has inertia, a damper to the frame or a "
        "prescribed speed ('s1.d', 's2.d' are zero and left out)."
    )
    assert problem.hint == "Give one of the nodes an Inertia, or a Damper to the frame, or a Ground."
    assert (problem.kind, problem.parts, problem.nodes) == ("undetermined speed", ("s1", "s2"), ("x", "y"))


def test_a_circuit_that_is_nowhere_grounded_is_named() -> None:
    problem = only(part("Resistor", "R", "p", "n", R=1.0), part("Inductor", "L", "p", "n", L=1.0))
    assert problem.message == "the circuit at nodes 'p', 'n' ('R', 'L') is joined to ground nowhere."
    assert problem.hint == "Add a Ground at 'p'."


def test_a_circuit_that_floats_behind_diodes_is_told_of_a_resistor_to_ground() -> None:
    rectifier = (part("CurrentSource", "I", "p", "n", i=1.0), part("Resistor", "R", "p", "n", R=1.0))
    diodes = (part("Diode", "D1", "p", "frame"), part("Diode", "D2", "n", "frame"))
    found = problems(*rectifier, *diodes, part("Resistor", "load", "frame", "end", R=1.0), part("Ground", "g", "end"))
    (problem,) = (problem for problem in found if problem.severity == "error")
    assert problem.hint == (
        "Add a Ground at 'p'; where that would bridge 'D1', 'D2', which join it to ground at times only, a Resistor of "
        "1e6 ohm from there to ground instead."
    )


def test_a_jump_of_a_speed_that_carries_an_inertia_is_a_warning() -> None:
    problem = only(part("SpeedSource", "drive", "rotor", omega=Step(3.0, 1.5)))
    assert problem.message == (
        "SpeedSource 'drive' jumps at t = 1.5 s, but Inertia 'J1' is rigidly joined to it: the torque is an impulse."
    )
    assert (problem.kind, problem.severity) == ("jumping source", "warning")
    assert (problem.parts, problem.nodes) == (("drive", "J1"), ("rotor",))


@pytest.mark.parametrize(
    "law",
    [3.0, Step(3.0), Ramp(3.0, 1e-3, 1.0), Table([0, 1, 1.001, 2], [0, 0, 1, 1]), sympy.Abs(t - 1), sympy.Max(t, 1)],
)
def test_a_speed_that_does_not_jump_after_the_start_is_no_warning(law: Any) -> None:
    assert problems(part("SpeedSource", "drive", "rotor", omega=law)) == ()


@pytest.mark.parametrize("law", [sympy.Heaviside(t - 1), sympy.sign(t - 1), Ramp(1.0, 0.5, 0.1) + Step(1e-6, 1.0)])
def test_every_form_of_a_jump_is_seen(law: Any) -> None:
    assert "jumps at t = 1 s" in only(part("SpeedSource", "drive", "rotor", omega=law)).message


def test_a_jump_behind_a_spring_is_no_warning() -> None:
    parts = (part("SpeedSource", "drive", "hub", omega=Step(3.0, 1.0)), part("Spring", "s", "hub", "rotor", c=1.0))
    assert problems(*parts) == ()


def test_values_that_cancel_are_named() -> None:
    problem = only(part("Damper", "d", "rotor", "hub", d=2.0), part("TorqueSource", "motor", "hub", tau=2 * omega))
    assert problem.message == (
        "the values of Damper 'd' and TorqueSource 'motor' at node 'hub' cancel each other, so that no speed follows "
        "from a torque there."
    )
    assert (problem.kind, problem.parts, problem.nodes) == ("cancelling values", ("d", "motor"), ("hub",))


def test_a_negative_damping_that_does_not_cancel_is_allowed() -> None:
    assert problems(part("Damper", "d", "rotor", "hub", d=2.0), part("TorqueSource", "m", "hub", tau=1.9 * omega)) == ()


@pytest.mark.parametrize("ratio", [1e-55, 1e55])
def test_ratios_beyond_what_numbers_hold_are_named(ratio: float) -> None:
    gears = [part("Gear", f"g{k}", f"n{k}", f"n{k + 1}", ratio=ratio) for k in range(7)]
    inertias = [part("Inertia", f"I{k}", f"n{k}", J=1.0) for k in range(8)]
    _, _, (problem,) = diagnose(Netlist("extreme", (*gears, *inertias)))
    assert problem.kind == "extreme ratios"
    assert problem.parts == tuple(f"g{k}" for k in range(7))


def test_ratios_that_vanish_while_the_states_are_chosen_are_named() -> None:
    gears = [part("Gear", f"g{k}", f"n{k}", f"n{k + 1}", ratio=1e-55) for k in range(6, -1, -1)]
    graph, form, said = diagnose(Netlist("vanishing", (*gears, part("Damper", "d", "n0", d=1.0))))
    assert graph is not None
    assert form is None
    assert [problem.kind for problem in said][1:] == ["extreme ratios"]


def test_ratios_that_are_only_large_are_allowed() -> None:
    gears = [part("Gear", f"g{k}", f"n{k}", f"n{k + 1}", ratio=1e6) for k in range(3)]
    inertias = [part("Inertia", f"I{k}", f"n{k}", J=1.0) for k in range(4)]
    assert diagnose(Netlist("large", (*gears, *inertias)))[2] == ()


def test_problems_of_all_stages_are_reported_together() -> None:
    said = problems(
        part("Inertia", "bad", "rotor", J=-1.0),
        part("Spring", "loose", "rotor", "nowhere", c=1.0),
        part("TorqueSource", "motor", "alone", tau=1.0),
        *LOCK,
    )
    assert [problem.kind for problem in said] == ["parameter", "loose end", "massless node", "locked gear loop"]


@pytest.mark.parametrize(
    "parts",
    [
        (part("Gear", "g", "wheel", "hub", ratio=2.0), part("Resistor", "stray", "hub", "rotor", R=1.0)),
        (part("Gear", "flat", "rotor", "out", ratio=0.0), part("Gear", "g", "rotor", "out", ratio=2.0)),
    ],
)
def test_what_follows_from_a_slip_is_not_said_beside_it(parts: tuple[Placed, ...]) -> None:
    assert len({problem.parts for problem in problems(*parts)}) == 1


def test_a_network_that_is_typed_wrong_has_no_form() -> None:
    graph, form, _ = diagnose(Netlist("bad", (*TRAIN, part("Inertia", "J3", "rotor", J=-1.0))))
    assert graph is None
    assert form is None


def test_problems_of_a_kind_come_in_the_order_of_the_parts() -> None:
    parts = tuple(part("Spring", f"s{k}", "rotor", f"loose{k}", c=1.0) for k in range(50))
    said = problems(*parts)
    assert [problem.parts for problem in said] == [(f"s{k}",) for k in range(50)]


def placed(net: Network) -> tuple[Placed, ...]:
    return tuple(part(piece.type, piece.name, *piece.nodes, **piece.values) for piece in net)


@pytest.mark.slow
@given(networks())
def test_no_well_posed_network_is_refused(net: Network) -> None:
    assert [problem for problem in diagnose(Netlist("random", placed(net)))[2] if problem.severity == "error"] == []


ALLOWED = ("locked_gear_loop", "missing_node")  # locked is a warning; the missing node may be that of an optional port


@pytest.mark.slow
@given(malformed_networks())
def test_every_malformed_network_is_refused_in_words_that_name_the_place(broken: tuple[Network, str]) -> None:
    net, kind = broken
    try:
        parts = placed(net)
    except ParameterError:
        assert kind in ("missing_parameter", "unknown_parameter")
        return
    said = diagnose(Netlist("broken", parts))[2]
    assert all(problem.parts or problem.nodes or problem.kind == "empty network" for problem in said)
    assert kind in ALLOWED or any(problem.severity == "error" for problem in said)
