"""Columns of values that a user gave to a study, in SI."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.core.errors import ParameterError

Checked = Callable[[Any, str], float]
"""From a value, and words for where it stands, to the number in SI, or a ParameterError that says both."""


def has_many(values: Any) -> bool:
    """Whether something is a sequence of values: a list, an array, one with units, a column of a data frame."""
    return isinstance(values, Iterable) and not isinstance(values, str | bytes) and getattr(values, "ndim", 1) > 0


def column_in_si(name: str, values: Any, checked: Checked, *, rows: bool = False) -> Array:
    """(k,) values of one parameter in SI, each admissible by itself.

    Args:
        name: of the parameter.
        values: numbers or quantities.
        checked: makes one of them a number in SI.
        rows: whether these are rows of a table, whose number a message then says.

    Raises:
        ParameterError: they are no sequence, or one of them is not admissible.
    """
    if not has_many(values):
        advice = "one for each row" if rows else f"such as [{values!r}]"
        raise ParameterError(f"'{name}': {values!r} must be a sequence of values, {advice}.")
    values = values.to_numpy() if hasattr(values, "to_numpy") else values
    if np.ma.is_masked(values):
        raise ParameterError(f"'{name}' has values that are masked. Leave their rows out.")
    if not isinstance(values, np.ndarray):
        values = list(values)
        values = np.array(values) if all(type(value) is float for value in values) else values

    def where(place: int) -> str:
        return f" in row {place} of '{name}'" if rows else ""

    if isinstance(values, np.ndarray) and values.dtype == float and values.ndim == 1:
        for place in _telling(values):
            checked(float(values[place]), where(place))
        return np.array(values)  # that of the caller may change
    listed = values.tolist() if isinstance(values, np.ndarray) else values
    return np.array([checked(value, where(place)) for place, value in enumerate(listed)], dtype=float)


def _telling(values: Array) -> list[int]:
    """Of many numbers the places of those that tell whether all are admissible.

    Bounds are on values and on sizes, refuse zero, or refuse what is not whole.
    """
    wrong = np.flatnonzero(~np.isfinite(values))
    if wrong.size or not values.size:
        return [int(place) for place in wrong[:1]]
    sizes = np.abs(values)
    smallest = np.where(sizes > 0.0, sizes, np.inf).argmin()
    broken = np.abs(values - np.round(values)).argmax()
    return sorted({int(place) for place in (values.argmin(), values.argmax(), sizes.argmin(), smallest, broken)})
