"""Incidence, loop and cutset matrices: what Kirchhoff's laws say of motions, and of each other."""

from __future__ import annotations

import numpy as np
import pytest
import sympy
from hypothesis import given

import shaftwork as sw
from shaftwork.equations.records import NamedMatrix
from tests.properties.examples import Array, network_of, share_of_examples
from tests.strategies import Network, networks


def numbers(made: NamedMatrix, net: sw.Network) -> Array:
    known = {sympy.Symbol(name, real=True): value for name, value in net.equations().values.items()}
    return np.array(made.matrix.xreplace(known).tolist(), dtype=float).reshape(made.matrix.shape)


def test_a_shaft_between_two_inertias_has_the_matrices_that_one_writes_down() -> None:
    net = sw.Network("two masses")
    net.add(sw.TorqueSource("motor", tau=1.0), "a")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Spring("shaft", c=50.0), "a", "b")
    net.add(sw.Inertia("J2", J=3.0), "b")
    eqs = net.equations()
    assert eqs.incidence.rows == ("a", "b")
    assert eqs.incidence.columns == ("motor.tau", "J1.tau", "shaft.tau_c", "J2.tau")
    assert eqs.incidence.matrix == sympy.Matrix([[1, 1, 1, 0], [0, 0, -1, 1]])
    assert eqs.loop_matrix.rows == ("motor.tau", "shaft.tau_c")
    assert eqs.loop_matrix.matrix == sympy.Matrix([[1, -1, 0, 0], [0, -1, 1, 1]])
    assert eqs.cutset_matrix.rows == ("J1.tau", "J2.tau")
    assert eqs.cutset_matrix.matrix == sympy.Matrix([[1, 1, 1, 0], [0, 0, -1, 1]])
    assert eqs.incidence["b", "shaft.tau_c"] == -1
    with pytest.raises(KeyError, match=r"There is no 'c'\. There are: a, b"):
        eqs.incidence["c", "shaft.tau_c"]


def test_a_gear_stands_with_its_ratio() -> None:
    net = sw.Network("geared")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Gear("gear", ratio=3.0), "a", "b")
    net.add(sw.Spring("shaft", c=50.0), "b", "c")
    net.add(sw.Inertia("J2", J=3.0), "c")
    eqs = net.equations()
    ratio = sympy.Symbol("gear.ratio", real=True)
    assert eqs.incidence["a", "gear.tau"] == 1
    assert eqs.incidence["b", "gear.tau"] == -ratio
    assert eqs.loop_matrix["shaft.tau_c", "J1.tau"] == -1 / ratio


@share_of_examples(0.25)
@given(networks(max_inertias=8))
def test_loops_and_cutsets_of_random_networks_are_orthogonal_and_cutsets_are_sums_of_balances(pieces: Network) -> None:
    """B Q' = 0 but for couplings, which have nothing across; a cutset is a sum of the balances of nodes."""
    net = network_of(pieces)
    eqs = net.equations()
    A, B, Q = (numbers(made, net) for made in (eqs.incidence, eqs.loop_matrix, eqs.cutset_matrix))
    graph = eqs.form.graph
    couplings = {branch.index for branch in graph.branches if branch.terms}
    # a coupling has nothing across it, and so no loop tells anything of it
    others = [k for k in range(len(graph.branches)) if k not in couplings]
    size = max(1.0, np.abs(B).max(initial=0.0) * np.abs(Q).max(initial=0.0))
    trees = [k for k, name in enumerate(eqs.cutset_matrix.rows) if eqs.cutset_matrix.columns.index(name) in others]
    np.testing.assert_allclose(B[:, others] @ Q[np.ix_(trees, others)].T, 0.0, atol=1e-9 * size)
    links = [k for k in eqs.form.tree.loops if k not in couplings]
    assert np.linalg.matrix_rank(B) == len(links)
    rank = np.linalg.matrix_rank(A)
    assert np.linalg.matrix_rank(Q) == len(graph.branches) - len(eqs.form.tree.loops)
    assert np.linalg.matrix_rank(np.vstack([A, Q])) == rank
