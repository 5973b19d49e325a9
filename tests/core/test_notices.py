"""A warning stands at the line of the user, whichever way led to it."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import pytest

import shaftwork as sw


def locked() -> sw.Network:
    """Two gears in a loop whose ratios contradict each other, so that nothing turns."""
    net = sw.Network("locked")
    net.add(sw.TorqueSource("motor", tau=1.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Gear("first", ratio=2.0), "a", "b")
    net.add(sw.Gear("second", ratio=3.0), "b", "a")
    return net


def rubbing() -> sw.Network:
    """A travelling wave whose bearing friction is too heavy to be lumped."""
    net = sw.Network("rubbing")
    net.add(sw.TorqueSource("motor", tau=1.0), "a")
    net.add(sw.Shaft("line", length=2.0, diameter=0.05, friction=50.0, model=sw.Wave()), "a", "b")
    net.add(sw.Inertia("J", J=1.0), "b")
    net.add(sw.CoulombLoad("load", tau=0.1), "b")
    return net


VERBS: dict[str, Callable[[sw.Network], object]] = {
    "graph": lambda net: net.graph(),
    "equations": lambda net: net.equations(),
    "lagrangian": lambda net: net.lagrangian(),
    "compile": lambda net: net.compile(),
    "simulate": lambda net: net.simulate(0.001),
    "modes": lambda net: net.modes(),
    "expanded": lambda net: net.expanded(),
}


@pytest.mark.parametrize("verb", VERBS)
def test_a_warning_about_a_network_stands_where_the_user_asked(verb: str) -> None:
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        VERBS[verb](locked())
    own = [made for made in told if made.category is sw.NetworkWarning]
    assert own
    code = VERBS[verb].__code__  # type: ignore[attr-defined]
    assert {(made.filename, made.lineno) for made in own} == {(__file__, code.co_firstlineno)}


def test_a_warning_about_waves_stands_where_the_user_asked() -> None:
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        rubbing().simulate(0.001)
    own = [made for made in told if "its bearing friction" in str(made.message)]
    assert [made.filename for made in own] == [__file__]
