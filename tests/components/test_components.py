"""What every component declares, and how wrong arguments are answered."""

from __future__ import annotations

import copy
import dataclasses
import pickle
import re
from typing import Any

import pytest
import sympy

import shaftwork as sw
from shaftwork.components import REGISTRY
from shaftwork.components.branches import ACROSS, IdealCoupling
from shaftwork.components.laws import t
from shaftwork.core.domains import DOMAINS
from shaftwork.network.graph import resolve
from shaftwork.network.kinds import Kind
from shaftwork.network.templates import make_template

OWN = [name for name, kind in REGISTRY.items() if kind.__module__.startswith("shaftwork.components.")]


TOGETHER = {
    "CageMotor": {"tau_a": 3.0, "tau_s": 2.0, "tau_k": 4.0, "n_k": 1.0},
    "HardStop": {"upper": 1.5},
    "HarmonicTorque": {"harmonics": sw.Harmonics((1.0, 2.0), (1.5, 0.5))},
    "LossyGear": {"efficiency": 0.9},
    "PullOutDrive": {"s_k": 0.2},
    "StateSpaceController": {"measured": "J.omega", "D": 1.5},
    "TransferFunctionController": {"measured": "J.omega"},
}
"""Values where those of a part must suit each other."""


def _made(name: str, **changes: Any) -> sw.Component:
    kind = REGISTRY[name]
    values = {key: 1.5 for key, declared in kind.declared.items() if declared.required and declared.at_most != 1}
    return kind("part", **{**values, **TOGETHER.get(name, {}), **changes})


@pytest.mark.parametrize("name", OWN)
def test_every_component_is_a_public_name_with_a_law_in_its_docstring(name: str) -> None:
    assert getattr(sw, name) is REGISTRY[name]
    assert "Law:" in str(REGISTRY[name].__doc__)


def test_what_a_base_class_declares_for_all_of_its_parts_comes_last() -> None:
    shared = ["ratio", "efficiency", "t_on", "t_off"]
    for kind in (sw.KlossMotor, sw.CageMotor, sw.TableMotor, sw.FrequencyDrive):
        assert [*kind.declared][-4:] == shared
    assert [*sw.CoulombLoad.declared] == ["tau", "omega_s"]
    assert [*sw.Clutch.declared] == [*sw.Brake.declared]


@pytest.mark.parametrize("name", OWN)
def test_every_parameter_declares_unit_and_meaning(name: str) -> None:
    for declared in REGISTRY[name].declared.values():
        assert declared.unit
        assert declared.meaning
        assert declared.required or declared.magnitude(declared.default)[1] is None


@pytest.mark.parametrize("name", OWN)
def test_every_component_is_a_frozen_value(name: str) -> None:
    part = _made(name)
    assert part == _made(name)
    assert hash(part) == hash(_made(name))
    with pytest.raises(dataclasses.FrozenInstanceError):
        part.name = "other"  # type: ignore[misc]


@pytest.mark.parametrize("name", OWN)
def test_what_must_be_above_a_bound_may_be_as_small_as_one_likes(name: str) -> None:
    """What is small depends on the machine, and a component does not know it; but for pure numbers and angles."""
    sizes = [one for one in REGISTRY[name].declared.values() if one.above is not None and one.unit not in {"1", "rad"}]
    assert [one.objection(1e-6) for one in sizes] == [None] * len(sizes)
    assert all("must be above 0" in (one.objection(0.0) or "") for one in sizes)


@pytest.mark.parametrize("name", OWN)
def test_a_ratio_is_never_zero_and_an_efficiency_never_zero_or_above_one(name: str) -> None:
    wrong = [("ratio", 0.0), ("efficiency", 0.0), ("efficiency", 1.01), ("efficiency_back", 1.01)]
    declared = REGISTRY[name].declared
    assert all("must be" in (declared[key].objection(value) or "") for key, value in wrong if key in declared)


@pytest.mark.parametrize("name", [name for name in OWN if {"t_on", "t_off"} <= REGISTRY[name].declared.keys()])
def test_what_would_never_be_on_is_refused(name: str) -> None:
    with pytest.raises(sw.ParameterError, match="t_off = 1 s is not later than t_on = 1 s"):
        _made(name, t_on=1.0, t_off=1.0)
    assert _made(name, t_on=1.0, t_off=1.5).name == "part"


@pytest.mark.parametrize("name", OWN)
def test_every_component_refuses_what_it_does_not_know_with_what_it_takes(name: str) -> None:
    with pytest.raises(sw.ParameterError, match="It takes a name and"):
        _made(name, wrong=1.0)
    required = [key for key, declared in REGISTRY[name].declared.items() if declared.required]
    if required:
        with pytest.raises(sw.ParameterError, match="|".join(map(repr, required))):
            REGISTRY[name]("part")


@pytest.mark.parametrize("name", OWN)
def test_couplings_are_power_conserving_and_others_end_at_ports(name: str) -> None:
    """Every end of a branch is a port, an inner node or the frame."""
    part = _made(name)
    values = resolve(part)[0]
    ends = {None, *(port.name for port in (*part.ports, *part.inner_ports()))}
    for branch in make_template(part, values).branches:
        found = [*branch.ends, *(end for _, plus, minus in branch.terms for end in (plus, minus))]
        assert set(found) <= ends
        assert (branch.kind is Kind.COUPLING) == bool(branch.terms)


@pytest.mark.parametrize(
    ("part", "kinds"),
    [
        (sw.Spring("p", c=1.0, d=1.0), [Kind.THROUGH_STORE, Kind.CONDUCTANCE]),
        (sw.Spring("p", c=1.0), [Kind.THROUGH_STORE]),
        (sw.Spring("p", c=0.0, d=1.0), [Kind.CONDUCTANCE]),
        (sw.Inertia("p", J=0.0), []),
        (sw.Resistor("p", R=0.0), [Kind.COUPLING]),
        (sw.Inductor("p", L=0.0), [Kind.COUPLING]),
        (sw.Capacitor("p", C=0.0), []),
        (sw.DCMachine("p", k=1.0), [Kind.COUPLING, Kind.COUPLING, Kind.COUPLING]),
        (sw.CoulombLoad("p", tau=0.0), []),
        (sw.TorqueSource("p", tau=0.0), []),
    ],
    ids=str,
)
def test_a_zero_removes_a_branch_or_makes_it_rigid(part: sw.Component, kinds: list[Kind]) -> None:
    """No torque flows through a spring of zero; no voltage drops over a resistance of zero."""
    values = {key: float(value) for key, value in part.values.items()}
    assert [branch.kind for branch in make_template(part, values).branches] == kinds


@pytest.mark.parametrize(
    ("law", "kinds"),
    [
        (5.0, [Kind.THROUGH_SOURCE]),
        (sympy.sin(t), [Kind.THROUGH_SOURCE]),
        (-2.0 * sw.omega, [Kind.CONDUCTANCE]),
        (4.0 - 2.0 * sw.omega, [Kind.CONDUCTANCE, Kind.THROUGH_SOURCE]),
        (-(sw.omega**2), [Kind.LAW]),
        (sw.t * sw.omega, [Kind.LAW]),
        (-3.0 * sw.phi, [Kind.LAW]),
    ],
    ids=str,
)
def test_a_law_that_is_linear_in_speed_joins_the_linear_part(law: Any, kinds: list[Kind]) -> None:
    value = law if isinstance(law, float) else sympy.sympify(law)
    assert [made.kind for made in make_template(sw.TorqueSource("p", tau=law), {"tau": value}).branches] == kinds


def test_a_branch_may_be_written_in_ten_lines_by_a_user_without_a_trace_in_the_library() -> None:
    assert all(REGISTRY[name].__module__.startswith("shaftwork.components.") for name in OWN)
    gear = next(iter(sw.Gear("g", ratio=2.0).branches(type("P", (), {"ratio": sympy.Symbol("ratio")}))))
    assert isinstance(gear, IdealCoupling)
    assert ACROSS not in gear.terms[0][0].free_symbols


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ({"role": "foo"}, "Mine: role = 'foo' is none of: store, loss, source, coupling."),
        ({"ports": ("a",)}, "Mine: ports = ('a',) must be a tuple such as (Port('a'), Port('b'))."),
        ({"ports": [sw.Port("a")]}, "must be a tuple such as"),
        ({"inner": ("m",)}, "Mine: inner = ('m',) must be a tuple"),
        ({"ports": ()}, "Mine: its ports are []. Give it one or more"),
        ({"inner": (sw.Port("a"),)}, "Mine: its ports are ['a', 'b', 'a']"),
        ({"k": 1.0, "__annotations__": {"k": "float"}}, "Mine: k is not declared. Write k: float = parameter("),
    ],
    ids=str,
)
def test_a_class_that_is_no_sound_component_is_refused_when_it_is_made(body: dict[str, Any], words: str) -> None:
    with pytest.raises(sw.ShaftworkError, match=re.escape(words)):
        sw.component(type("Mine", (sw.Component,), body))
    assert "Mine" not in REGISTRY


def test_a_class_that_was_not_decorated_is_told_the_decorator() -> None:
    class Bare(sw.Component):
        k: float = sw.parameter("1", "a factor")

    class Derived(sw.Inertia):
        pass

    for make in (lambda: Bare("b", k=1.0), lambda: Derived("d", J=1.0), lambda: sw.Component("c")):
        with pytest.raises(sw.ShaftworkError, match=r"is not a component yet\. Write @component above `class "):
            sw.Network().add(make(), "a")
    with pytest.raises(sw.ShaftworkError, match=r"int is no Component\. Write: class int\(Component\)"):
        sw.component(int)  # type: ignore[type-var]


def test_a_part_can_be_copied_and_sent() -> None:
    part = sw.Spring("shaft", c=1.0)
    assert copy.deepcopy(part) == part
    assert pickle.loads(pickle.dumps(part)) == part  # noqa: S301 (our own bytes)


def test_domains_share_no_quantity() -> None:
    """Signals are told apart by the names of their quantities."""
    names = [q.name for domain in DOMAINS for q in (domain.across, domain.through, domain.integral)]
    assert len(set(names)) == len(names) == 9
