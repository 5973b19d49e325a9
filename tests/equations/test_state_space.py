"""State matrices in symbols against those of the linearised model."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
import sympy
from hypothesis import assume, given
from hypothesis import strategies as st

import shaftwork as sw
from shaftwork.equations.small_motions.state_space import StateSpace
from tests.properties.examples import Array, compiled, network_of, share_of_examples
from tests.strategies import Network, networks

MATRICES = ("A", "B", "C", "D", "B1", "D1")


def numbers(space: StateSpace, values: Mapping[str, float]) -> dict[str, Array]:
    known = {sympy.Symbol(name, real=True): sympy.Float(value) for name, value in values.items()}
    matrices = ((name, getattr(space, name)) for name in MATRICES)
    return {name: np.array(made.xreplace(known).tolist(), dtype=float).reshape(made.shape) for name, made in matrices}


@share_of_examples(0.25)
@given(networks(max_inertias=5), st.integers(0, 63))
def test_random_networks_have_the_matrices_of_their_linearised_model(pieces: Network, number: int) -> None:
    """1e-9 of the largest entry of a row: a sum of terms of both signs is rounded otherwise."""
    net = network_of(pieces)
    linear = compiled(net).linearize()
    names = [name for name in linear.slopes.units if not name.endswith((".power", ".energy"))]
    outputs = tuple(dict.fromkeys(names[(number + 7 * k) % len(names)] for k in range(5)))
    linear = compiled(net).linearize(outputs=outputs)
    equations = net.equations()
    try:
        space = equations.state_space(outputs=outputs)
    except sw.CompileError:
        assume(False)  # noqa: FBT003 (more rates are coupled than are solved in symbols)
    assert (space.states, space.inputs, space.outputs) == (linear.states, linear.inputs, linear.outputs)
    for name, found in numbers(space, equations.values).items():
        wanted = np.asarray(getattr(linear, name))
        size = np.abs(wanted).max(axis=1, initial=0.0, keepdims=True) + np.abs(wanted).max(initial=0.0) * 1e-6
        assert (np.abs(found - wanted) <= 1e-9 * size + 1e-300).all(), name


def test_a_motor_has_a_letter_for_its_slope_and_an_input_beside_it() -> None:
    space = sw.scenes.crane().equations().state_space(["motor.tau"], ["shaft.tau", "J2.omega"])
    J1, c, d = (sympy.Symbol(name, real=True) for name in ("J1.J", "shaft.c", "shaft.d"))
    (slope,) = space.slopes
    assert space.states == ("J1.omega", "J2.omega", "shaft.tau_c")
    assert space.A[0, 0] == (-slope - d) / J1
    assert list(space.A[2, :]) == [c, -c, 0]
    assert sympy.Matrix([1 / J1, 0, 0]) == space.B
    assert sympy.Matrix([[d, -d, 1], [0, 1, 0]]) == space.C
    assert sympy.zeros(2, 1) == space.D


def test_what_is_not_there_is_told() -> None:
    equations = sw.scenes.crane().equations()
    assert equations.state_space("motor.tau", "shaft.tau").outputs == ("shaft.tau",)
    with pytest.raises(sw.SignalError, match=r"'motr\.tau' is no input"):
        equations.state_space(["motr.tau"])
    with pytest.raises(sw.SignalError, match=r"No quantity 'J3\.omega'"):
        equations.state_space(outputs=["J3.omega"])
    with pytest.raises(sw.SignalError, match=r"'J2\.energy' is a product"):
        equations.state_space(outputs=["J2.energy"])
