"""A component that is declared wrongly is refused where it is declared, or named by `check`, which never raises."""

from __future__ import annotations

import contextlib
import dataclasses
from collections.abc import Iterator
from typing import Any

import pytest
import sympy

import shaftwork as sw
from shaftwork.components import REGISTRY
from shaftwork.components.base import Derived, Profile
from shaftwork.components.branches import across_of

ODD: tuple[Any, ...] = (
    *("electrical", "", "a.b", 3, -1.5, 0, True, None, float("nan"), 1j),
    *((), ("a",), ("a", "nowhere"), (1, 2), ("a", "b", "c"), ["a"], ((1.0, "a"),), (("a",),), {"a": 1.0}),
    *(object(), int, sympy.Symbol("strange"), sympy.nan, sympy.true),
)
"""Values of wrong types, and names of what is not there."""

RECORDS: tuple[Any, ...] = (
    sw.Port("middle"),
    sw.Signal("through", ("a", "b"), sw.ROTATION),
    Profile("across", (0.0, 1.0), "c", (((1.0, "a"),), ((1.0, "b"),)), sw.ROTATION),
    Derived("d_k", sympy.Integer(2), "N*m*s/rad", "a damping", "d_k"),
    sw.AcrossStore(sympy.Integer(1), ("a", None), "omega_a"),
    sw.ThroughStore(sympy.Integer(1), ("a", "b"), "tau_1"),
    sw.ThroughLaw(sw.ACROSS, ("a", "b"), "tau_2"),
    sw.AcrossLaw(sympy.Integer(1), ("a", None), "e"),
    sw.IdealCoupling(((sympy.Integer(1), "a", None), (sympy.Integer(2), "b", None)), "g"),
    sw.LossyCoupling(((sympy.Integer(1), "a", None), (sympy.Integer(2), "b", None)), (1, 2), "l"),
    sw.Leave(sw.ACROSS - 1, "shut"),
    sw.Mode("open", (sw.Leave(sw.ACROSS - 1, "shut"),)),
    sw.Modes(
        (sw.Mode("open", (sw.Leave(sw.ACROSS - 1, "shut"),)), sw.Mode("shut", value=1.0, starts=sw.NEVER)), ("a", "b")
    ),
)
FIELDS = [
    pytest.param(record, field.name, id=f"{type(record).__name__}-{field.name}")
    for record in RECORDS
    for field in dataclasses.fields(record)
]


def net_with(record: Any) -> sw.Network:
    """A sound train with a part of its own class that declares one thing more."""

    def only(kind: Any, place: Any) -> Any:
        return place if isinstance(record, kind) else None

    class Odd(sw.Component):
        c: float = sw.parameter("N*m/rad", "stiffness", default=2.0)
        inner = (record,) if isinstance(record, sw.Port) else ()

        def branches(self, p: Any) -> Iterator[Any]:
            yield sw.ThroughStore(p.c)
            yield sw.ThroughLaw(p.c * sw.ACROSS)
            for port in self.inner:
                yield sw.ThroughLaw(sw.ACROSS, ("a", port.name), "inner")
            if type(record).__module__.endswith("branches"):
                yield record

        def derived(self, _p: Any) -> Iterator[Any]:
            yield from filter(None, [only(Derived, record)])

        def modes(self, _p: Any) -> Iterator[Any]:
            if isinstance(record, sw.Leave):
                yield sw.Modes((sw.Mode("open", (record,)), sw.Mode("shut", value=1.0)), ("a", "b"))
            elif isinstance(record, sw.Mode):
                yield sw.Modes((record, sw.Mode("shut", value=1.0)), ("a", "b"))
            else:
                yield from filter(None, [only(sw.Modes, record)])

        def signals(self) -> Any:
            return super().signals() | ({"odd": record} if isinstance(record, sw.Signal) else {})

        def profiles(self) -> Any:
            return {"along": record} if isinstance(record, Profile) else {}

    net = sw.Network("train")
    net.add(sw.TorqueSource("motor", tau=1.0), "rotor")
    net.add(sw.Inertia("J1", J=1.0), "rotor")
    net.add(sw.component(Odd)("odd"), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=1.0), "wheel")
    return net


@pytest.mark.parametrize("record", RECORDS, ids=lambda record: type(record).__name__)
def test_the_declarations_that_are_spoilt_below_are_sound(record: Any) -> None:
    problems = net_with(record).check()
    assert not any("odd" in problem.parts and problem.kind == "component" for problem in problems), problems


def test_a_mode_that_leads_to_none_there_is_is_named_with_those_there_are() -> None:
    modes = (sw.Mode("open", (sw.Leave(sw.ACROSS - 1, "ajar"),)), sw.Mode("shut", value=1.0, starts=sw.NEVER))
    (problem,) = (one for one in net_with(sw.Modes(modes, ("a", "b"))).check() if one.severity == "error")
    assert "a mode leads to 'ajar', which is none of: open, shut" in problem.message


def test_a_first_mode_that_joins_rigidly_is_refused_with_what_to_write_instead() -> None:
    """The others are rigid where their form differs from that of the first."""
    holding = (sw.Mode("held", (sw.Leave(sw.THROUGH - 1, "free"),)), sw.Mode("free", form="free", starts=sw.NEVER))

    class Odd(sw.Component):
        def modes(self, _p: Any) -> Iterator[sw.Modes]:
            yield sw.Modes(holding, ("a", "b"))

        def branches(self, p: Any) -> Iterator[Any]:
            yield sw.ThroughLaw(1.0) if p.form else sw.rigid(("a", "b"))

    net = sw.Network("train")
    net.add(sw.Inertia("J1", J=1.0), "rotor")
    net.add(sw.component(Odd)("odd"), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=1.0), "wheel")
    (problem,) = (one for one in net.check() if one.severity == "error")
    assert "its first mode, 'held', joins its ends rigidly" in problem.message


def _run_unless_refused(net: sw.Network) -> None:
    """Check a network, and run it where it has no errors; anything but an error of the package's passes."""
    if any(problem.severity == "error" for problem in net.check()):
        return
    with contextlib.suppress(sw.ShaftworkError):
        sol = net.simulate(0.01, t_eval=2)
        assert all(sol[name].shape[0] == 2 for name in (*sol, *sol.places))


@pytest.mark.filterwarnings("ignore::shaftwork.NetworkWarning", "ignore::shaftwork.AccuracyWarning")
@pytest.mark.parametrize(("record", "field"), FIELDS)
def test_a_field_of_a_wrong_type_is_named_where_it_is_declared_or_by_check(record: Any, field: str) -> None:
    for odd in ODD:
        try:
            net = net_with(dataclasses.replace(record, **{field: odd}))
        except sw.ParameterError as refused:
            words = str(refused)
        else:
            _run_unless_refused(net)
            continue
        assert type(record).__name__ in words, words
        assert field in words, words


@pytest.mark.parametrize("domain", ["electrical", "rotation", 3, sw.Port("a")], ids=str)
def test_a_port_of_no_domain_is_answered_with_the_domains(domain: Any) -> None:
    with pytest.raises(sw.ParameterError, match="ROTATION, TRANSLATION or ELECTRICAL") as refused:
        sw.Port("p", domain)
    assert "domain" in str(refused.value)


def test_the_domains_are_public_names() -> None:
    assert [domain.name for domain in (sw.ROTATION, sw.TRANSLATION, sw.ELECTRICAL)] == [
        "rotation",
        "translation",
        "electrical",
    ]
    assert sw.Port("p", sw.ELECTRICAL).domain is sw.ELECTRICAL


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"unit": 3}, "unit = 3"),
        ({"meaning": None}, "meaning = None"),
        ({"at_lest": 0}, "no 'at_lest'. It takes: default, latex, above"),
        ({"at_least": "0"}, "at_least = '0' must be a number"),
        ({"law": "yes"}, "law = 'yes' must be True or False"),
        ({"record": 3}, "record = 3 must be a class"),
        ({"latex": 3}, "latex = 3 must be a text"),
    ],
)
def test_a_wrong_argument_of_parameter_is_named(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(sw.ParameterError) as refused:
        sw.parameter(**({"unit": "1", "meaning": "a factor"} | arguments))
    assert words in str(refused.value)


@pytest.mark.parametrize(
    ("name", "default", "words"),
    [
        ("k", "much", "the default of k = 'much' must be a number"),
        ("k", -1.0, "the default of k = -1.0 must be at least 0"),
        ("mode", 1.0, "a parameter is named 'mode', which has a meaning here"),
        ("branches", 1.0, "a parameter is named 'branches', which has a meaning here"),
    ],
)
def test_a_parameter_that_no_part_can_have_is_named_with_its_class(name: str, default: Any, words: str) -> None:
    field = sw.parameter("1", "a factor", at_least=0, default=default)
    body = {"__annotations__": {name: "float"}, name: field, "ports": (sw.Port("a"),)}
    with pytest.raises(sw.ParameterError) as refused:
        sw.component(type("Odd", (sw.Component,), body))
    assert f"Odd: {words}" in str(refused.value)


def test_a_prescribed_speed_that_reads_its_own_speed_and_angle_is_told_what_it_may_read() -> None:
    net = sw.Network("led")
    net.add(sw.SpeedSource("lead", omega=3.0 + sw.omega + sw.phi), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    (problem,) = net.check()
    assert "reads omega, phi, but may depend on time t alone" in problem.message


def test_a_law_that_reads_a_port_that_is_not_there_is_told_so() -> None:
    @sw.component
    class Astray(sw.Component):
        """Law: tau = omega of a port that it lacks."""

        role = "source"
        ports = (sw.Port("a"),)

        def branches(self, p: Any) -> Iterator[Any]:  # noqa: ARG002
            yield sw.ThroughLaw(across_of("elsewhere"), ("a", None))

    try:
        net = sw.Network("astray")
        net.add(Astray("part"), "a")
        net.add(sw.Inertia("J", J=1.0), "a")
        assert "a law reads across_of('elsewhere'), but the part has no such port" in str(net.check()[0])
    finally:
        del REGISTRY["Astray"]
