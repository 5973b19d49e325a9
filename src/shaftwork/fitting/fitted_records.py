"""Records of measurements: their columns, and values in ascending order without what is missing."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import LARGEST, is_quantity, numbers_in_si
from shaftwork.results.observer import array_in_si


class RecordedSeries(NamedTuple):
    """One recorded quantity.

    Args:
        quantity: its name.
        at: (k,) times in s, or frequencies in Hz.
        measured: (k,) values, or (2 k,) real parts before imaginary ones.
    """

    quantity: str
    at: Array
    measured: Array


def read_records(record: Any, units: Mapping[str, str]) -> tuple[str, list[dict[str, RecordedSeries]]]:
    """Whether over times "t" or frequencies "f", and what each of one or several records holds, by label.

    Args:
        record: one or several.
        units: of quantities, SI.

    Raises:
        ParameterError: there is none, or one is none, says which; some are over times and some over frequencies.
    """
    listed = record if isinstance(record, list | tuple) else [record]
    if not listed:
        raise ParameterError("There is no record. Give {'t': times, 'shaft.tau': values}, or several in a list.")
    domains, records = zip(
        *(_read(one, units, number, len(listed)) for number, one in enumerate(listed, 1)), strict=True
    )
    if len(set(domains)) > 1:
        raise ParameterError("Some records are over times and some over frequencies. Fit them one after the other.")
    if len(records) == 1:
        return domains[0], list(records)
    return domains[0], [
        {f"{name} ({number})": one for name, one in series.items()} for number, series in enumerate(records, 1)
    ]


def _read(record: Any, units: Mapping[str, str], number: int, count: int) -> tuple[str, dict[str, RecordedSeries]]:
    """Whether over times "t" or frequencies "f", and what is recorded there; an error says in which of several.

    Raises:
        ParameterError: as `_series` says.
    """
    try:
        return _series(record, units)
    except ParameterError as error:
        if count == 1:
            raise
        raise ParameterError(f"Record {number}: {error}") from None


def _series(record: Any, units: Mapping[str, str]) -> tuple[str, dict[str, RecordedSeries]]:
    """Whether over times "t" or frequencies "f", and what is recorded there, in ascending order.

    Raises:
        ParameterError: there is neither or both, a column has another length, no value or one that is too large, or
            all values are at the start.
    """
    if not hasattr(record, "items"):
        raise ParameterError(
            f"{reprlib.repr(record)} is no record. Give {{'t': times, 'shaft.tau': values}}, or what "
            "pandas.read_csv has read of a file."
        )
    columns = {str(name): values for name, values in record.items()}
    domains = [name for name in ("t", "f") if name in columns]
    if len(domains) != 1 or len(columns) < 2:
        raise ParameterError(
            "A record has a column 't' of times in s or 'f' of frequencies in Hz, and beside it what was measured. "
            f"There are: {', '.join(columns) or 'none'}."
        )
    domain = domains[0]
    places = _unmasked(columns.pop(domain))
    if not np.size(places):
        raise ParameterError(f"'{domain}' is empty: the record has no rows.")
    at = array_in_si(domain, places, {"t": "s", "f": "Hz"}[domain])
    if (missing := np.flatnonzero(~np.isfinite(at))).size:
        raise ParameterError(f"'{domain}' has no finite value in row {missing[0]}, counted from zero. Leave it out.")
    if not (at.size and at.min() >= 0.0):
        raise ParameterError(f"'{domain}' must be numbers from zero on. A motion starts at t = 0 s.")
    _refuse_huge(domain, at)
    series = {name: _one_series(name, column, at, domain, units.get(name)) for name, column in columns.items()}
    if domain == "t" and not any(one.at[-1] for one in series.values()):
        names = ", ".join(f"'{name}'" for name in series)
        raise ParameterError(f"{names}: all values are at t = 0 s, where a motion only starts. Give later ones.")
    return domain, series


def _one_series(name: str, column: Any, at: Array, domain: str, unit: str | None) -> RecordedSeries:
    """A column in ascending order, without what is missing."""
    if is_quantity(column):
        if unit is None:
            raise ParameterError(f"'{name}' has a unit, and what it is in SI is not known. Give plain numbers.")
        column = numbers_in_si(name, column, unit)
    values = np.asarray(_unmasked(column))
    if domain == "t" and np.iscomplexobj(values):
        raise ParameterError(f"'{name}' is complex: a frequency response has a column 'f' in place of 't'.")
    if values.shape != at.shape:
        raise ParameterError(f"'{name}' has {values.shape} values, and '{domain}' {at.shape}. They must be as many.")
    order = np.argsort(at, kind="stable")
    try:
        ordered = values[order].astype(float if domain == "t" else complex)
    except (TypeError, ValueError):
        listed = values.tolist()
        row, wrong = next(((k, one) for k, one in enumerate(listed) if not _is_number(one)), (0, listed[0]))
        raise ParameterError(
            f"'{name}' holds {wrong!r} in row {row}, counted from zero, which is no number. Read the file with "
            "na_values=[...] or decimal=',' of pandas, or drop the column."
        ) from None
    there = np.isfinite(ordered)
    if not there.any():
        raise ParameterError(f"'{name}' has no finite value.")
    _refuse_huge(name, ordered[there])
    parts = [ordered] if domain == "t" else [ordered.real, ordered.imag]
    return RecordedSeries(name, at[order][there], np.concatenate([part[there] for part in parts]))


def _unmasked(column: Any) -> Any:
    """A column without a mask: what is under one is no value."""
    return np.ma.filled(column.astype(object), np.nan) if np.ma.is_masked(column) else column


def _is_number(value: Any) -> bool:
    try:
        complex(value)
    except (TypeError, ValueError):
        return False
    return True


def _refuse_huge(name: str, values: Array) -> None:
    if (largest := np.abs(values).max()) > LARGEST:
        raise ParameterError(
            f"'{name}' has a value of size {largest:g}; records hold numbers in SI up to {LARGEST:g}. Correct it, "
            "or leave its row out."
        )
