"""The records say what the network is, know where every row comes from, and agree with the rows that are compiled."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from typing import Any, ClassVar
from unittest import mock

import numpy as np
import pytest
from hypothesis import given
from sympy import Derivative, Expr, Function, Rational, Symbol, dsolve, exp, simplify, sin

from shaftwork.components.base import REGISTRY, Component, Derived, Port, component
from shaftwork.components.branches import ACROSS, AcrossStore, Branch
from shaftwork.components.laws import t
from shaftwork.components.mechanics import Damper, Gear, Inertia, Spring
from shaftwork.components.shaft_models import (
    CentralDifference,
    Lumped,
    OneSpring,
    Rigid,
    ShaftModel,
    Spectral,
    Wave,
)
from shaftwork.components.sources import TorqueSource
from shaftwork.core.errors import ShaftworkError
from shaftwork.core.parameters import parameter
from shaftwork.equations.kirchhoff import kirchhoff
from shaftwork.equations.quantities import rate_of
from shaftwork.equations.records import Equations
from shaftwork.formulation.explicit_rows import BlockTooLargeError, explicit_rows
from shaftwork.formulation.form import state_form
from shaftwork.network.netlist import NetworkBuilder
from shaftwork.scenes import SCENES
from tests.equations.networks import (
    MECHANICAL,
    crane,
    dc_drive,
    equations_of,
    from_pieces,
    graph_of,
    hoist,
    shaft,
    train,
)
from tests.properties.examples import share_of_examples
from tests.strategies import Network, networks


def symbol(name: str) -> Symbol:
    return Symbol(name, real=True)


def known_quantities(equations: Equations) -> dict[Symbol, Expr]:
    """Every quantity that is no state or parameter, by the records that say what it is."""
    known = {row.left: row.right for row in equations.eliminated if row.kind != "reaction" and not row.trivial}
    states = {row.symbol for row in equations.states}
    for row in (*equations.loops, *equations.laws):
        if row.left.is_Symbol and row.left not in states and not row.left.name.startswith("der(") and not row.trivial:
            known.setdefault(row.left, row.right)
    return known


def resolved(expression: Expr, known: dict[Symbol, Expr]) -> Expr:
    for _ in range(20):
        if known.keys().isdisjoint(expression.free_symbols):
            return expression
        expression = expression.xreplace(known)
    raise AssertionError(f"{expression} does not come to rest")


def assert_agrees_with_compiled_rows(equations: Equations) -> None:
    try:
        rows = explicit_rows(equations.form)
    except BlockTooLargeError:
        return
    known = known_quantities(equations)
    chance = random.Random(1)  # noqa: S311 - any numbers will do
    values = {symbol(name): value for name, value in equations.values.items()}
    values |= {state: chance.uniform(-1, 1) for state in rows.states} | {symbol("t"): 0.7}
    for row, rate in zip(equations.states, rows.rates, strict=True):
        printed, compiled = float(resolved(row.rate, known).xreplace(values)), float(rate.xreplace(values))
        # both are exact in exact numbers; 1e-9 leaves room for rounding in sums that cancel
        assert math.isclose(printed, compiled, rel_tol=1e-9, abs_tol=1e-9 * largest(rate, values)), row.name


def largest(expression: Expr, values: dict[Symbol, float]) -> float:
    return max(abs(float(term.xreplace(values))) for term in expression.expand().as_ordered_terms())


@pytest.mark.parametrize("name", [*MECHANICAL, "dc drive"])
def test_printed_rates_are_the_compiled_rates(name: str) -> None:
    assert_agrees_with_compiled_rows(equations_of(MECHANICAL[name]() if name in MECHANICAL else dc_drive()))


def test_a_changing_torque_between_springs_in_series_is_in_their_rate() -> None:
    """The node between them has no inertia: the springs share what the source gives, and its slope twists them."""
    net = NetworkBuilder("series")
    net.add(Inertia("J1", J=0.5), "a")
    net.add(Spring("s1", c=100.0), "a", "between")
    net.add(TorqueSource("pull", tau=5.0 * t + sin(3.0 * t)), "between")
    net.add(Spring("s2", c=300.0), "between", "b")
    net.add(Inertia("J2", J=2.0), "b")
    assert_agrees_with_compiled_rows(equations_of(net))


SHAFTS = (
    OneSpring(),
    Lumped(3),
    Lumped(3, ends="full"),
    CentralDifference(3),
    CentralDifference(4, 2, "printed"),
    Spectral(3),
)


@pytest.mark.parametrize("model", [Rigid(), *SHAFTS], ids=repr)
@pytest.mark.parametrize("bore", [0.0, 0.01])
def test_rates_in_letters_of_derived_quantities_are_the_compiled_rates(model: ShaftModel, bore: float) -> None:
    assert_agrees_with_compiled_rows(equations_of(shaft(model, inner_diameter=bore, damping=0.3, friction=0.1)))


@pytest.mark.parametrize("model", SHAFTS, ids=repr)
def test_the_geometry_of_a_shaft_stands_in_the_definitions_alone(model: ShaftModel) -> None:
    equations = equations_of(shaft(model))
    geometry = {symbol(f"line.{name}") for name in ("diameter", "density", "shear_modulus")}
    for row in equations.rows:
        assert geometry.isdisjoint(row.left.free_symbols | row.right.free_symbols)
    polar = np.pi * 0.02**4 / 32
    expected = {"line.area_moment": polar, "line.line_inertia": 7900 * polar, "line.line_stiffness": 77.5e9 * polar}
    found = {name: value for name, value in equations.values.items() if name not in equations.form.graph.parameters}
    for name, value in expected.items():
        if name in found or not isinstance(model, OneSpring):
            assert found[name] == pytest.approx(value, rel=1e-14)


def test_only_derived_quantities_that_occur_are_defined() -> None:
    names = {
        repr(model): [made.name for made in equations_of(shaft(model)).definitions] for model in (*SHAFTS[:1], Wave())
    }
    assert names == {
        "OneSpring()": ["line.area_moment", "line.line_stiffness"],
        "Wave(places=5)": ["line.area_moment", "line.impedance", "line.delay"],
    }
    assert not equations_of(crane()).definitions


def test_computations_know_no_derived_quantities() -> None:
    form = state_form(graph_of(shaft(CentralDifference(3))))
    allowed = {symbol(name) for name in form.graph.parameters}
    for branch in form.graph.branches:
        assert form.graph.in_network_symbols(branch.template.law, branch).free_symbols <= allowed | {ACROSS}


def test_a_derived_quantity_does_not_take_the_name_of_a_parameter() -> None:
    with mock.patch.dict(REGISTRY):

        @component
        class Twice(Component):
            J: float = parameter("kg*m^2", "inertia")

            ports: ClassVar[tuple[Port, ...]] = (Port("a"),)

            def derived(self, p: Any) -> Iterator[Derived]:
                yield Derived("J", 2 * p.J, "kg*m^2", "twice", "K")

            def branches(self, p: Any) -> Iterator[Branch]:
                yield AcrossStore(p.J)

        net = NetworkBuilder("twice")
        net.add(Twice("two", J=1.0), "a")
        with pytest.raises(ShaftworkError, match="Twice: 'J' is derived, but exists already"):
            graph_of(net)


@share_of_examples(0.2)
@given(pieces=networks(max_inertias=6))
def test_printed_rates_are_the_compiled_rates_of_random_networks(pieces: Network) -> None:
    assert_agrees_with_compiled_rows(equations_of(from_pieces(pieces)))


def test_the_crane_has_the_equations_of_the_textbook() -> None:
    equations = equations_of(crane())
    J1, J2, w1, w2 = map(symbol, ("J1.J", "J2.J", "J1.omega", "J2.omega"))
    motor, shaft, load, spring = map(symbol, ("motor.tau", "shaft.tau", "tau(load)", "shaft.tau_c"))
    c, d, twist = map(symbol, ("shaft.c", "shaft.d", "shaft.omega_rel"))
    first, second = equations.nodes
    assert (first.left, first.right) == (J1 * rate_of(w1), motor - shaft)
    assert (second.left, second.right) == (J2 * rate_of(w2), shaft + load)
    assert {(row.left, row.right) for row in equations.loops if not row.trivial} == {(twist, w1 - w2)}
    laws = {row.left: row.right for row in equations.laws}
    assert laws[shaft] == spring + d * twist
    assert laws[rate_of(spring)] == c * twist


def test_a_row_knows_its_parts_branches_and_nodes() -> None:
    equations = equations_of(crane())
    node = equations.nodes[0]
    assert (node.node, node.nodes, node.parts) == ("rotor", ("rotor",), ("motor", "J1", "shaft"))
    assert dict(node.coefficients) == dict.fromkeys(node.branches, 1)
    loop = next(row for row in equations.loops if row.parts == ("J1", "shaft", "J2"))
    assert loop.nodes == ("rotor", "wheel")
    assert sorted(loop.coefficients.values()) == [-1, 1]


def test_a_gear_enters_the_balance_with_its_ratio() -> None:
    equations = equations_of(MECHANICAL["geared inertias"]())
    gear = equations.form.graph.parts[3].branches[0]
    assert [row.coefficients[gear] for row in equations.nodes] == [1, -symbol("g.ratio")]


def test_every_state_has_its_symbol_unit_and_rate() -> None:
    equations = equations_of(crane())
    assert [(row.name, row.unit) for row in equations.states] == [
        ("J1.omega", "rad/s"),
        ("J2.omega", "rad/s"),
        ("shaft.tau_c", "N*m"),
    ]
    assert all(row.symbol == symbol(row.name) and row.left == rate_of(row.symbol) for row in equations.states)


def test_eliminated_quantities_say_why_and_what_they_are() -> None:
    equations = equations_of(hoist())
    found = {(row.kind, row.why): row for row in equations.eliminated}
    tied = found["speed", "inertia Jd is rigidly tied to drive by g2"]
    assert (tied.left, tied.right) == (symbol("Jd.omega"), symbol("drive.omega") / symbol("g2.ratio"))
    series = found["torque", "spring s1 is in series with s2"]
    assert (series.left, series.right) == (symbol("s1.tau_c"), symbol("s2.tau_c"))
    assert found["speed", "node wall is held at rest by frame"].right == 0
    assert any(row.kind == "algebraic" and "no store at" in row.why for row in equations.eliminated)


def test_parameters_of_zero_and_redundant_gears_are_noted() -> None:
    assert any("s1.d, s2.d" in note for note in equations_of(hoist()).notes)
    assert any(note.startswith("g3 says what") for note in equations_of(MECHANICAL["redundant gears"]()).notes)


def test_rates_of_many_coupled_inertias_stay_together() -> None:
    net = NetworkBuilder("differentials")
    for k in range(5):
        net.add(Inertia(f"J{k}", J=1.0 + k), f"n{k}")
    for k in range(4):
        net.add(Spring(f"s{k}", c=1.0), f"n{k}", f"n{k + 1}")
    from shaftwork.components.mechanics import PlanetaryGear

    for k in range(3):
        net.add(Inertia(f"C{k}", J=1.0), f"c{k}")
        net.add(PlanetaryGear(f"p{k}", ratio=2.0), f"n{k}", f"c{k}", f"n{k + 1}")
    equations = equations_of(net)
    assert [row.explicit for row in equations.states if row.name.endswith("omega")] == [False] * 4 + [True]
    assert len(equations.states[0].left.free_symbols & {rate_of(row.symbol) for row in equations.states}) > 1
    assert "coupled" in equations.latex(form="state")


def test_a_large_network_costs_nothing_before_it_is_read(monkeypatch: pytest.MonkeyPatch) -> None:
    form = state_form(graph_of(train(200)))
    made: list[object] = []
    from shaftwork.equations.assembly import Assembly

    balance = Assembly.balance
    monkeypatch.setattr(Assembly, "balance", lambda self, node: made.append(node) or balance(self, node))
    equations = kirchhoff(form)
    assert not made
    assert equations.nodes[7].parts == ("J8", "s7", "s8")
    assert not made
    assert equations.nodes[7].right == symbol("s7.tau") - symbol("s8.tau")
    assert made == [7]


def test_the_balance_of_a_reversed_source_keeps_its_sign() -> None:
    net = NetworkBuilder("reversed")
    net.add(Inertia("J1", J=1.0), "a")
    net.add(Inertia("J2", J=1.0), "b")
    net.add(TorqueSource("T", tau=5.0), "b", "a")
    net.add(Gear("g", ratio=2.0), "a", "c")
    net.add(Inertia("J3", J=1.0), "c")
    first, second, *_ = equations_of(net).nodes
    assert first.right.coeff(symbol("T.tau")) == -1
    assert second.right == symbol("T.tau")


def test_rows_in_time_are_differential_equations_that_sympy_solves() -> None:
    net = NetworkBuilder("spin-up")
    net.add(TorqueSource("motor", tau=3.0), "a")
    net.add(Inertia("J1", J=2.0), "a")
    net.add(Damper("D1", d=0.5), "a")
    equations = equations_of(net)
    (state,) = equations.states
    row = equations.in_time(state.equation)
    speed = Function("J1.omega", real=True)(t)
    assert row.has(Derivative(speed, t))
    values = {symbol: Rational(equations.values[symbol.name]) for symbol in row.free_symbols - {t}}
    solved = dsolve(row.xreplace(values), speed, ics={speed.subs(t, 0): 0})
    assert simplify(solved.rhs - 6 * (1 - exp(-t / 4))) == 0


def test_der_of_der_is_a_second_derivative() -> None:
    net = NetworkBuilder("pendulum")
    net.add(Inertia("J1", J=2.0), "a")
    net.add(Spring("c1", c=5.0), "a", "ground")
    equations = equations_of(net)
    angle = equations.second_order.coordinates[0]
    row = equations.in_time(equations.second_order.residual(0))
    assert row.has(Derivative(Function(angle.name, real=True)(t), (t, 2)))


@pytest.mark.parametrize("scene", ["crane", "bldc-shaft", "shaft-step"])
def test_no_row_is_an_identity_or_says_what_another_has_said(scene: str) -> None:
    net = SCENES[scene].build()
    equations = net.equations(phase=net.start_phase() or None)
    said = [row.expression for row in equations.rows]
    assert 0 not in said
    assert len({*said, *(-expression for expression in said)}) == 2 * len(said)
    whole = (*equations.nodes, *equations.loops, *equations.couplings, *equations.laws, *equations.states)
    assert all(row.trivial or {row.expression, -row.expression} & {*said} for row in (*whole, *equations.eliminated))
