"""Shafts written out part by part."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import shaftwork as sw
from tests.properties.examples import share_of_examples


def train(model: object, **shaft: float) -> sw.Network:
    net = sw.Network("train")
    net.add(sw.KlossMotor("motor", tau_k=30.0, s_k=0.2, n_sync=1500), "m")
    net.add(sw.Inertia("Je", J=0.025), "m")
    net.add(sw.Shaft("line", length=1.0, diameter=0.02, **shaft, model=model), "m", "x")
    net.add(sw.Gear("gear", ratio=2.0), "x", "y")
    net.add(sw.Shaft("second", length=0.6, diameter=0.03, **shaft, model=model), "y", "l")
    net.add(sw.Inertia("Jm", J=0.3), "l")
    return net


@pytest.mark.slow
@share_of_examples(0.04)
@given(
    m=st.integers(1, 7),
    ends=st.sampled_from(["half", "full"]),
    damping=st.sampled_from([0.0, 0.02]),
    friction=st.sampled_from([0.0, 0.3]),
)
def test_the_chain_of_parts_equals_the_array(m: int, ends: str, damping: float, friction: float) -> None:
    """The same equations in another order of additions; 1e-9 is what a run at 1e-12 makes of the rounding."""
    net = train(sw.Lumped(m, ends=ends), damping=damping, friction=friction)
    array, chain = net.compile(), net.compile(expand=True)
    assert len(array.states) == len(chain.states)
    one, other = (model.simulate(0.02, engine="scipy", rtol=1e-12, t_eval=21) for model in (array, chain))
    for name in ("Je.omega", "Jm.omega", "motor.tau", "gear.tau_a"):
        np.testing.assert_allclose(one[name], other[name], atol=1e-9 * np.abs(one[name]).max())
    for k in range(1, m):
        inside = one["line.omega"][:, k]
        np.testing.assert_allclose(inside, other[f"line {k}.omega"], atol=1e-9 * np.abs(inside).max())


def test_every_row_of_the_chain_is_printed() -> None:
    equations = train(sw.Lumped(4)).equations(expand=True)
    assert sum("line J" in row.name for row in equations.states) == 4  # its first end turns with Je
    assert [part.name for part in train(sw.Lumped(2)).expanded().parts][1:7] == [
        "Je",
        "line J m",
        "line J 1",
        "line J x",
        "line c m",
        "line c 1",
    ]


def test_a_chain_within_a_network_within_another_is_joined_to_its_neighbours() -> None:
    """The array and the chain are the same matrices, so that 1e-9 leaves room for rounding alone."""
    inner, net = sw.Network("inner", ports=("a",)), sw.Network("outer")
    inner.add(sw.Shaft("line", length=1.0, diameter=0.02, model=sw.Lumped(2)), "a", "b")
    inner.add(sw.Inertia("J2", J=1.0), "b")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(inner, "a", name="first")
    chain = net.expanded()
    assert chain.nodes == ("a", "first.line 1", "first.b")
    assert [part.name for part in chain.parts if "line" in part.name] == [
        *("first.line J a", "first.line J 1", "first.line J first.b", "first.line c a", "first.line c 1")
    ]
    np.testing.assert_allclose(chain.modes().frequencies[1:], net.modes().frequencies[1:], rtol=1e-9)


def test_a_chain_has_the_ports_of_its_network() -> None:
    net = sw.Network("shafted", ports=("a", "b"))
    net.add(sw.Shaft("line", length=1.0, diameter=0.02, model=sw.Lumped(2)), "a", "b")
    assert net.expanded().ports == ("a", "b")


def test_one_spring_is_a_spring() -> None:
    (spring,) = (part for part in train(sw.OneSpring()).expanded().parts if part.name.startswith("line"))
    assert isinstance(spring, sw.Spring)
    assert spring.c == pytest.approx(79.3e9 * np.pi * 0.02**4 / 32, rel=1e-14)


def test_a_rigid_shaft_stays_as_it_is() -> None:
    net = train(sw.Rigid())
    assert net.expanded().parts == net.parts


def test_the_parts_of_a_chain_have_short_letters() -> None:
    text = train(sw.Lumped(3), damping=0.02, friction=0.3).equations(expand=True).latex(form="kirchhoff")
    for letter in ("J", "c", "d", r"\omega"):
        assert rf"{letter}_{{\mathrm{{line}},1}}" in text
    assert r"d_{\mathrm{bearing},\mathrm{line},1}" in text


@pytest.mark.parametrize("model", [sw.Spectral(4), sw.CentralDifference(8), sw.Wave()])
def test_what_is_no_chain_of_springs_is_named(model: object) -> None:
    with pytest.raises(sw.ParameterError, match=r"Shaft 'line': model=.* is no chain of springs.*Lumped\(m\) can"):
        train(model).expanded()
