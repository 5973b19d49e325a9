"""Circuits and duals of random networks move as these do, and what is dual twice is what it was."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

import shaftwork as sw
from tests.properties.examples import assert_equal_signals, compiled, network_of, share_of_examples
from tests.strategies import Network, networks

TIMES = np.linspace(0.0, 0.5, 6)
ROUNDING = 1e-9
"""Of the largest value of the same quantity. Both sides are exact up to rounding, in other states."""


def motion(net: sw.Network) -> sw.Solution:
    return compiled(net).simulate(TIMES[-1], t_eval=TIMES, engine="exact")


def assert_moves_alike(analogue: sw.Network, net: sw.Network, names: Iterable[str] = ()) -> None:
    """Every quantity of the network, but for power and energy, read from its analogue."""
    expected, solution = motion(net), motion(analogue)
    assert analogue.analogy is not None
    names = tuple(names) or [name for name in expected if not name.endswith((".power", ".energy"))]
    wanted = {name: expected[name] for name in names}
    assert_equal_signals({name: analogue.analogy.read(solution, name) for name in wanted}, wanted, ROUNDING)


@pytest.mark.slow
@share_of_examples()
@given(networks())
def test_a_circuit_moves_like_its_network(pieces: Network) -> None:
    net = network_of(pieces)
    circuit = net.circuit()
    assert {domain.name for domain in circuit.graph().domains} == {"electrical"}
    assert_moves_alike(circuit, net)


@pytest.mark.slow
@share_of_examples()
@given(networks())
def test_a_dual_moves_like_its_network_where_there_is_one(pieces: Network) -> None:
    net = network_of(pieces)
    try:
        dual = net.dual()
    except sw.NetworkError as error:
        assert [problem.kind for problem in error.problems] == ["not planar"]  # noqa: PT017 (most have a dual)
        return
    assert_moves_alike(dual, net)


LAWS = (
    sw.TorqueSource("law 0", tau=12 - 0.7 * sw.omega - 0.1 * sw.omega * sympy.Abs(sw.omega)),
    sw.TorqueSource("law 1", tau=5 * sympy.cos(2 * sw.phi) + 3 * sympy.sin(4 * sw.t)),
    sw.TorqueSource("law 2", tau=sw.Table([-5, 0, 3, 8, 20], [12, 10, 7, 2, -3])(sw.omega)),
    sw.KlossMotor("law 3", tau_k=15.0, n_sync=250.0, s_k=0.3),
    sw.FanLoad("law 4", tau_n=8.0, n_n=100.0, static=0.1),
    sw.DryFriction("law 5", tau_c=2.0, tau_s=3.0, d=0.1),
    sw.Brake("law 6", tau=4.0, t_on=0.1, t_off=0.3),
)


@st.composite
def loaded_networks(draw: st.DrawFn) -> sw.Network:
    """Networks with laws of speed, angle and time at some of their inertias."""
    pieces = draw(networks(max_inertias=8, electrical=False))
    net = network_of(pieces)
    rotors = [piece.nodes[0] for piece in pieces if piece.type == "Inertia"]
    for law in draw(st.lists(st.sampled_from(LAWS), min_size=1, max_size=3, unique_by=lambda law: law.name)):
        net.add(law, draw(st.sampled_from(rotors)))
    return net


@pytest.mark.slow
@share_of_examples(0.5)
@given(loaded_networks())
def test_a_dual_has_the_laws_of_its_network(net: sw.Network) -> None:
    try:
        dual = net.dual()
    except sw.NetworkError as error:  # not planar, or two frictions hold one shaft
        assert all(one.kind == "not planar" or "can hold too" in one.message for one in error.problems)  # noqa: PT017
        return
    assert dual.analogy is not None
    if any(problem.kind == "massless node" for problem in dual.check()):
        return  # a friction at a prescribed speed: nothing in its mesh answers the source
    expected, found = (one.simulate(TIMES[-1], t_eval=TIMES, rtol=1e-12) for one in (net, dual))
    wanted = {name: expected[name] for name in dual.analogy.quantities if name in expected}
    # the two may have other states, so that they take other steps
    assert_equal_signals({name: dual.analogy.read(found, name) for name in wanted}, wanted, ROUNDING)


@pytest.mark.slow
@share_of_examples(0.5)
@given(networks(max_inertias=12))
def test_the_dual_of_a_dual_has_the_quantities_of_the_network(pieces: Network) -> None:
    net = network_of(pieces)
    try:
        dual = net.dual()
        twice = dual.dual()
    except sw.NetworkError as error:
        assert [problem.kind for problem in error.problems] == ["not planar"]  # noqa: PT017
        return
    assert_moves_alike(twice, dual)
    stores = {type(part).__name__: 0 for part in twice.parts}
    for part in twice.parts:
        stores[type(part).__name__] += 1
    circuit = net.circuit()
    for kind in ("Capacitor", "Inductor"):
        assert stores.get(kind, 0) == sum(type(part).__name__ == kind for part in circuit.parts)


@pytest.mark.slow
@share_of_examples(0.5)
@given(networks(max_inertias=12))
def test_the_drive_train_of_a_circuit_is_what_it_was(pieces: Network) -> None:
    net = network_of(pieces)
    back = net.circuit().mechanical()
    expected, solution = motion(net), motion(back)
    names = [name for name in expected if name.endswith((".omega", ".v", ".u", ".tau", ".f"))]
    assert_equal_signals({name: solution[name] for name in names}, {name: expected[name] for name in names}, ROUNDING)
