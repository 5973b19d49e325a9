"""Exact inverses: of rational matrices, against the product with what they invert."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

from shaftwork.codegen.array_form.elements import inverse_of_fractions

ENTRIES = st.fractions(-5, 5, max_denominator=7) | st.just(Fraction(0))


@given(st.integers(1, 4).flatmap(lambda n: st.lists(st.lists(ENTRIES, min_size=n, max_size=n), min_size=n, max_size=n)))
def test_a_matrix_times_its_inverse_is_exactly_one(rows: list[list[Fraction]]) -> None:
    matrix = np.array(rows, dtype=object)
    assume(abs(np.linalg.det(matrix.astype(float))) > 1e-9)  # regular, beyond the doubt of a float
    assert (matrix @ inverse_of_fractions(matrix) == np.eye(len(matrix))).all()
