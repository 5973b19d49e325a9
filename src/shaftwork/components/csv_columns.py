"""Two columns of a CSV file as numbers: heads, units, decimal signs, time stamps, and the line of what is wrong."""

from __future__ import annotations

import codecs
import csv
import io
import math
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime
from itertools import pairwise
from pathlib import Path

import numpy as np

from shaftwork.core.errors import NetworkWarning, ParameterError, imported
from shaftwork.core.notices import warn
from shaftwork.core.parameters import UNIT, converted

_HEAD = re.compile(
    r"(?P<name>.*?)\s*(?:\[(?P<square>[^\[\]]*)\]|\((?P<round>[^()]*)\)|_(?P<tail>[mnuµμ]s|rpm|deg|k?Nm|k[NW]|m[mAV]))"
)
"""A name and its unit: "omega [rpm]", "omega (rpm)" or "omega_rpm"."""
_TOGETHER = re.compile(r"\b([kM]?N)m\b")
_SPELLINGS = {"%": "percent", "°C": "degC", "°": "degree", "°/s": "degree/s"} | dict.fromkeys(("U/min", "r/min"), "rpm")
_NOT_SI = re.compile(
    r"[mnuµμkM](?:s|A|V|W|N|J|m|bar|N[ *·]?m)|min|h|rpm|[1Ur]/min|deg(?:ree)?|°[CF]?|deg/s|°/s|km/h|bar|%"
)
"""Units in which numbers are another quantity than in SI."""
Value = float | datetime


@dataclass(frozen=True)
class Columns:
    """Two columns of a file.

    Args:
        path: of the file.
        columns: names in the head, or numbers from 0, of the arguments and of the values.
        delimiter: between columns.
        decimal: sign.
        units: to which the columns are converted from the units in their heads; None for those to take as they are.
        scale: by which they are multiplied.
    """

    path: Path
    columns: tuple[str | int, str | int]
    delimiter: str
    decimal: str
    units: tuple[str | None, str | None]
    scale: tuple[float, float]

    def read(self) -> list[list[float]]:
        """The arguments and the values.

        Raises:
            ParameterError: as of `Table.from_csv`.
            MissingExtraError: a unit is to be converted, and pint is not installed.
        """
        try:
            lines = io.StringIO(_text(self.path.read_bytes()), newline="")
            rows = [(line, [cell.strip() for cell in row]) for line, row in _rows(lines, self.delimiter)]
        except (OSError, ValueError, csv.Error) as error:
            raise ParameterError(f"The table '{self.path}' cannot be read: {error}.") from None
        places, head, first = self._places(rows)
        points = [(line, self._values(line, row, places)) for line, row in rows[first:]]
        self._check_order([(line, x) for line, (x, _) in points])
        stamped = isinstance(points[0][1][0], datetime)
        units = ["s" if stamped else self._unit(0, places, head), self._unit(1, places, head)]
        xs, ys = zip(*(values for _, values in points), strict=True)
        seconds = [(x - xs[0]).total_seconds() if isinstance(x, datetime) else x for x in xs]
        return [self._converted(number, values, units[number]) for number, values in enumerate((seconds, ys))]

    def _places(self, rows: Sequence[tuple[int, list[str]]]) -> tuple[tuple[int, int], list[list[str]], int]:
        """Numbers of the columns, the rows of their head, and the number of the first row with numbers in them.

        Raises:
            ParameterError: there is no such row, or it has a gap.
        """
        start, places, gaps = 0, _places_in([], self.columns), list[tuple[int, list[str]]]()
        for count, (number, row) in enumerate(rows):
            if places is not None and None not in self._cells(row, places):
                for gap in gaps[:1]:
                    self._values(*gap, places)  # refuses it
                return places, [head for _, head in rows[start:count]], count
            named = _places_in(row, self.columns) if any(isinstance(column, str) for column in self.columns) else None
            if named is not None:
                start, places, gaps = count, named, []
            elif places is not None and self._is_gap(row, places):
                gaps.append((number, row))
        line = f" Its first line is: {', '.join(rows[0][1])}." if rows else " It is empty."
        raise ParameterError(
            f"'{self.path}' has no line with numbers in the columns {', '.join(map(repr, self.columns))}.{line} Name "
            "columns by their head or their number from 0, and say delimiter and decimal where they are not ',' and "
            "'.'."
        )

    def _cells(self, row: Sequence[str], places: tuple[int, int]) -> list[Value | None]:
        """What stands in the columns of a row; a time stamp can be an argument alone."""
        texts = [row[place] if 0 <= place < len(row) else "" for place in places]
        x, y = (_number(text, self.decimal) for text in texts)
        return [_stamp(texts[0]) if x is None else x, y]

    def _is_gap(self, row: Sequence[str], places: tuple[int, int]) -> bool:
        """Whether a row holds one number alone: not so a setting above the head of numbered columns, "rate,1000"."""
        x, y = self._cells(row, places)
        numbered = all(isinstance(column, int) for column in self.columns)
        setting = numbered and x is None and any(row[places[0] : places[0] + 1])
        return (x is None) != (y is None) and not setting

    def _values(self, line: int, row: Sequence[str], places: tuple[int, int]) -> list[Value]:
        values = []
        for column, value in zip(self.columns, self._cells(row, places), strict=True):
            if value is None or (isinstance(value, float) and not math.isfinite(value)):
                what = "no number" if value is None else str(value)
                raise ParameterError(
                    f"'{self.path}', line {line}: column {column!r} holds {what}. Mend or remove the line."
                )
            values.append(value)
        return values

    def _check_order(self, arguments: Sequence[tuple[int, Value]]) -> None:
        """Refuse arguments that do not increase, with their line."""
        for (_, before), (line, after) in pairwise(arguments):
            try:
                ascending = before < after  # type: ignore[operator]
            except TypeError:
                raise ParameterError(
                    f"'{self.path}', line {line}: '{after}' and '{before}' before it are not of one kind: numbers, "
                    "time stamps with a time zone, or without one. Write all alike."
                ) from None
            if not ascending:
                raise ParameterError(
                    f"'{self.path}', line {line}: column {self.columns[0]!r} must increase strictly, but {after} "
                    f"follows {before}. Sort the lines, and write a jump as a Step."
                )

    def _unit(self, number: int, places: tuple[int, int], head: Sequence[Sequence[str]]) -> str:
        """The unit in the head of a column: behind its name, or else in the last line above the numbers."""
        cells = [row[places[number]] for row in head if places[number] < len(row)]
        for cell in reversed(cells):
            if match := _HEAD.fullmatch(cell):
                return match["square"] or match["round"] or match["tail"] or ""
        return cells[-1] if len(cells) > 1 else ""

    def _converted(self, number: int, values: Sequence[float], unit: str) -> list[float]:
        """The values of a column in the unit that is wanted."""
        wanted, column, factor = self.units[number], self.columns[number], self.scale[number]
        if wanted is None and factor == 1.0 and _NOT_SI.fullmatch(unit):
            warn(
                f"'{self.path}', column {column!r} is in {unit}, and its numbers stand as they are. Give units or "
                f"scale to have them in SI, or units with {unit!r} where it is meant so.",
                NetworkWarning,
            )
        if wanted is None or unit == wanted:
            return [factor * value for value in values]
        written = _TOGETHER.sub(r"\1*m", _SPELLINGS.get(unit, unit)).replace("·", "*")
        where = f"'{self.path}', column {column!r}"
        if not written or len(written) > 50 or not UNIT.fullmatch(written.removeprefix("1")):
            what = f"has the unit {unit!r}" if unit else "has no unit"
            raise ParameterError(
                f"{where} {what} in its head, and is wanted in {wanted}. Write one such as 'omega [rpm]', or give "
                "scale instead of units."
            )
        registry = imported("pint", "units", f"Table.from_csv(units=...) of a column in {unit}").application_registry
        try:
            quantity = registry.Quantity(np.array(values), registry.Unit(written))
        except Exception as error:  # noqa: BLE001 (pint raises what its tokeniser does, too)
            raise ParameterError(f"{where} has the unit {unit!r}, which is not one: {error}.") from None
        numbers, objection = converted(quantity, wanted)
        if objection is not None:
            raise ParameterError(f"{where} {objection}. Give scale instead of units to say what it means.")
        return [factor * float(value) for value in numbers]


def _text(content: bytes) -> str:
    """The text of a file: UTF-8, UTF-16 with its mark, or else as Windows writes it in the west."""
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return content.decode("utf-16")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("cp1252")


def _rows(lines: Iterable[str], delimiter: str) -> Iterator[tuple[int, list[str]]]:
    reader = csv.reader(lines, delimiter=delimiter)
    return ((reader.line_num, row) for row in reader if any(map(str.strip, row)) and not row[0].startswith("#"))


def _places_in(head: Sequence[str], columns: tuple[str | int, str | int]) -> tuple[int, int] | None:
    """Numbers of the columns where a head has all names once, whole or but for their unit; else None."""
    bare = [match["name"] if (match := _HEAD.fullmatch(cell)) else cell for cell in head]
    places = []
    for column in columns:
        names = next((names for names in (head, bare) if names.count(column) == 1), None)
        if names is None and isinstance(column, str):
            return None
        places.append(column if isinstance(column, int) else list(names or ()).index(column))
    return places[0], places[1]


def _number(text: str, decimal: str) -> float | None:
    """The number that a text is, or None."""
    try:
        foreign = "_" in text or (decimal != "." and "." in text)  # 1.500 is 1500 where decimals stand behind a comma
        return None if foreign else float(text.replace(decimal, "."))
    except ValueError:
        return None


def _stamp(text: str) -> datetime | None:
    """The time stamp that a text is, as ISO 8601 writes it, or None."""
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        return None
