"""Circuits and duals of random networks move as these do, and what is dual twice is what it was."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given

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
