"""Combined ratios: what they are equal to, and how they are printed."""

from __future__ import annotations

import operator
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from sympy import Symbol, cancel

from shaftwork.formulation.gains import Gain, add, coefficient, divide, simplified

VALUES = {Symbol("a", real=True): 2.0, Symbol("b", real=True): 0.5, Symbol("c", real=True): 3.0}
COMBINED = {"*": operator.mul, "+": lambda first, second: add(first, second, []), "/": divide}


@pytest.mark.slow
@given(st.lists(st.sampled_from("*+/"), min_size=1, max_size=8), st.randoms(use_true_random=False))
def test_combined_ratios_are_simplified_alike_alone_and_together(operations: list[str], random: Random) -> None:
    """Made of each other at random; each is equal to its value, and has no common factor above and below."""
    made: list[Gain] = [coefficient(symbol, VALUES) for symbol in VALUES]  # type: ignore[misc]
    for operation in operations:
        made.append(COMBINED[operation](random.choice(made), random.choice(made)))
    together = simplified(made)
    assert together == [simplified((gain,))[0] for gain in made]
    for gain, expression in zip(made, together, strict=True):
        assert float(expression.xreplace(VALUES)) == pytest.approx(gain.value, rel=1e-12)
        assert expression == cancel(expression)
