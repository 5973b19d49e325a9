"""What goes over into other equations: its derivatives are those of what `StateTransfer` computes in numbers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from sympy import Symbol

from shaftwork.codegen.state_transfer import StateTransfer
from shaftwork.sensitivities.differentiation import StateTransferJacobian
from tests.properties.examples import Array, compiled, share_of_examples
from tests.strategies import Network, networks

STEP = 1e-5


def differences(function: object, value: float) -> Array:
    """Central, extrapolated: right to the fourth power of the step, and to the rounding over the step."""
    step = STEP * abs(value)

    def central(h: float) -> Array:
        return (np.array(function(value + h)) - np.array(function(value - h))) / (2 * h)  # type: ignore[operator]

    return (4 * central(step / 2) - central(step)) / 3


@pytest.mark.slow
@given(networks(max_inertias=6))
@share_of_examples(0.02)
def test_derivatives_of_stores_and_states_equal_central_differences(pieces: Network) -> None:
    model = compiled(pieces)
    if model.rows is None:
        return
    names = list(model.parameters)[:6]
    takeover = StateTransferJacobian(model.form, model.rows, [Symbol(name, real=True) for name in names])
    stores, dice = StateTransfer(model.form), np.random.default_rng(len(model.states))
    x, dx = dice.normal(size=len(model.states)), dice.normal(size=(len(model.states), len(names)))
    held, dheld = (dice.normal(size=(len(takeover.names), *shape)) for shape in ((), (len(names),)))
    still = np.zeros(len(names))
    values, shown = takeover.given(0.3, x, model.defaults, dx, still)
    assert takeover.names == stores.names
    np.testing.assert_allclose(values, stores.of(lambda: model.bind(model.defaults), *at(x))[0], rtol=1e-9, atol=1e-9)
    taken_x = stores.states(model.bind(model.defaults), 0.3, dict(zip(takeover.names, held, strict=True)))
    taken = takeover.taken(0.3, taken_x, model.defaults, held, dheld, still)
    for k, name in enumerate(names):
        value = model.parameters[name]

        def both(changed: float, k: int = k, name: str = name, value: float = value) -> Array:
            p, h = model.vector({name: changed}), changed - value
            known = dict(zip(takeover.names, held + h * dheld[:, k], strict=True))
            of = stores.of(lambda: model.bind(p), *at(x + h * dx[:, k]))[0]
            return np.concatenate([of, stores.states(model.bind(p), 0.3, known)])

        found = np.concatenate([shown[:, k], taken[:, k]])
        size = np.abs(np.concatenate([values, taken_x])).max() / abs(value) + np.abs(found).max()
        np.testing.assert_allclose(found, differences(both, value), atol=1e-8 * size, err_msg=name)


def at(x: Array) -> tuple[Array, Array]:
    """One time, and states there."""
    return np.array([0.3]), x[None, :]
