"""The compiled model: scalar or array code, parameters as arguments, what one evaluation costs."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import shaftwork as sw


def _chain(n: int, **spring: float) -> sw.Network:
    net = sw.Network(f"chain of {n}")
    net.add(sw.TorqueSource("motor", tau=5.0), "n0")
    for k in range(n):
        net.add(sw.Inertia(f"J{k}", J=1.0 + 0.1 * k), f"n{k}")
    for k in range(n - 1):
        net.add(sw.Spring(f"s{k}", **({"c": 100.0, "d": 0.1} | spring)), f"n{k}", f"n{k + 1}")
    return net


def test_a_small_model_is_unrolled_and_a_large_one_is_not() -> None:
    assert _chain(10).compile().cost().form == "scalar"
    large = _chain(40).compile()
    assert large.rows is None
    assert large.scalar is None
    assert large.cost().form == "array"


def test_array_code_multiplies_and_adds_once_for_each_entry_of_its_matrices() -> None:
    """And reads what its laws need by such a matrix: each load the speed of its node."""
    net = _chain(40)
    before = net.compile().cost().operations
    for k in range(0, 40, 2):
        net.add(sw.TorqueSource(f"load{k}", tau=-(sw.omega**3)), f"n{k}")
    after = net.compile().cost().operations
    gained = {name: number - before.get(name, 0) for name, number in after.items()}
    assert gained == {"mul": 40, "add": 40, "law": 20}  # one to read each speed and one for each torque


def test_unrolled_code_shares_common_terms() -> None:
    """The torque of every damped spring stands in two rows, but is computed once."""
    model = _chain(2).compile()
    assert model.scalar is not None
    assert model.rows is not None
    written_out = sum(rate.count_ops() for rate in model.rows.rates)
    assert 0 < model.cost().total < written_out


def test_parameters_are_arguments_in_the_order_of_the_parts() -> None:
    model = _chain(2).compile()
    assert list(model.parameters) == ["motor.tau", "J0.J", "J1.J", "s0.c", "s0.d"]
    rest = np.zeros(3)
    np.testing.assert_array_equal(model.rhs(0.0, rest), [5.0, 0.0, 0.0])
    np.testing.assert_array_equal(model.rhs(0.0, rest, model.vector({"motor.tau": 8.0, "J0.J": 4.0})), [2.0, 0.0, 0.0])


def test_parameters_of_a_model_cannot_be_written_to() -> None:
    """A value that is written there would change nothing; `simulate(parameters=...)` takes it."""
    model = _chain(2).compile()
    with pytest.raises(TypeError, match="does not support item assignment"):
        model.parameters["s0.c"] = 1.0  # type: ignore[index]


def test_an_unknown_parameter_is_told_what_there_is() -> None:
    model = _chain(2).compile()
    with pytest.raises(sw.ParameterError, match=r"stiffness.*s0\.c"):
        model.vector({"s0.stiffness": 1.0})
    with pytest.raises(sw.ParameterError, match=r"s0\.stiffness.*s0\.c"):
        model.simulate(1.0, parameters={"s0.stiffness": 1.0})
    with pytest.raises(sw.ParameterError, match="at least 0"):
        model.simulate(1.0, parameters={"s0.c": -1.0})


@pytest.mark.parametrize("n", [3, 40], ids=["scalar", "array"])
def test_both_forms_of_the_code_solve_the_same_chain(n: int) -> None:
    """Momentum: the sum of J omega is tau t, to rounding, whichever code computes it."""
    sol = _chain(n).simulate(1.0, t_eval=[0.5, 1.0], engine="exact")
    momentum = sum((1.0 + 0.1 * k) * sol[f"J{k}.omega"] for k in range(n))
    np.testing.assert_allclose(momentum, [2.5, 5.0], rtol=1e-11)


def test_a_law_that_cannot_be_evaluated_ends_in_a_named_error() -> None:
    """sqrt of a negative speed."""
    net = sw.Network("undefined")
    net.add(sw.TorqueSource("brake", tau=-1.0 - sympy.sqrt(sw.omega)), "r")
    net.add(sw.Inertia("J", J=1.0), "r")
    model = net.compile()
    assert np.isnan(model.rhs(0.0, np.array([-1.0]))).all()
    with pytest.raises(sw.SimulationError, match=r"tau = .*sqrt\(omega\).* of TorqueSource 'brake' has no real value"):
        model.simulate(1.0)


def test_signs_of_zero_and_steps_agree_with_numpy() -> None:
    """sign(0) = 0 and Heaviside(0) = 1/2, in unrolled code as in arrays."""
    net = sw.Network("switching")
    net.add(sw.TorqueSource("relay", tau=-3.0 * sympy.sign(sw.omega) + sympy.Heaviside(sw.omega)), "r")
    net.add(sw.Inertia("J", J=1.0), "r")
    model = net.compile()
    for speed, rate in ((-2.0, 3.0), (0.0, 0.5), (2.0, -2.0)):
        assert model.rhs(0.0, np.array([speed]))[0] == rate
        assert model.bind().rhs(0.0, np.array([speed]))[0] == rate


def test_linear_is_what_has_constant_coefficients() -> None:
    def linear(law: object) -> bool:
        net = sw.Network("law")
        net.add(sw.TorqueSource("source", tau=law), "r")
        net.add(sw.Inertia("J", J=1.0), "r")
        return net.compile().linear

    assert linear(5.0)
    assert linear(sympy.sin(sw.t))
    assert linear(2.0 - 0.5 * sw.omega - 3.0 * sw.phi)
    assert not linear(sw.omega**2)
    assert not linear(sw.t * sw.omega)
    assert not linear(sympy.sin(sw.phi))


def test_the_generated_code_names_nothing_but_time_states_and_parameters() -> None:
    model = _chain(3).compile()
    assert model.scalar is not None
    source = model.scalar.source
    assert source.startswith("def ")
    assert "import" not in source
    assert "return [" in source


@pytest.mark.parametrize("n", [3, 40], ids=["scalar", "array"])
def test_the_constants_of_a_law_are_those_that_were_given(n: int) -> None:
    """Printed with 15 digits, as sympy does, a third and 0.7 / 0.49 would be other floats."""
    net = _chain(n)
    net.add(sw.TorqueSource("load", tau=sw.t / 3.0 + 1.4285714285714286 * sw.omega**2), "n0")
    rest = np.zeros(2 * n - 1)
    rest[0] = 1.0
    rate = net.compile().rhs(1.0, rest)[0]
    assert rate == 5.0 + 1.0 / 3.0 + 1.4285714285714286 - 0.1
