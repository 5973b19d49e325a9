"""Catalogues of motors: a table of the package, chosen as typical, or a file of the user's own."""

from __future__ import annotations

import csv
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, fields
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from shaftwork.components.drives import Nameplate
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import in_si, numbers_in_si
from shaftwork.numerics.tolerances import TYPED
from shaftwork.results.observer import RPM, Array

OWN = Path(__file__).with_name("motors.csv")
TYPICAL = "chosen: typical of a motor of this frame size and power; frame sizes by power after EN 50347"
SHOWN = 8
"""Mistakes of a file, and motors of a choice, that are named at once."""


@dataclass(frozen=True, kw_only=True)
class CatalogueMotor:
    """A cage motor of a catalogue.

    Args:
        name: of the motor.
        power: rated power, W.
        n_n: rated speed, 1/min.
        n_sync: synchronous speed, 1/min.
        tau_n: rated torque, N m; duty S1.
        tau_a: locked-rotor torque, N m.
        tau_s: pull-up torque, N m.
        tau_k: pull-out torque, N m.
        J: inertia of the rotor, kg m^2.
        n_max: highest speed that is allowed, 1/min; by default the synchronous one.
        f_n: rated frequency, Hz.
        frame: frame size.
        source: where the values are from.

    Raises:
        ParameterError: a value is out of its range, or they do not go together.
    """

    name: str
    power: float
    n_n: float
    n_sync: float
    tau_n: float
    tau_a: float
    tau_s: float
    tau_k: float
    J: float
    n_max: float | None = None
    f_n: float = 50.0
    frame: str = ""
    source: str = ""

    def __post_init__(self) -> None:
        if not self.name:
            raise ParameterError("name is empty. Give every motor a name.")
        for name, (unit, bounds) in NUMBERS.items():
            if getattr(self, name) is not None:
                object.__setattr__(self, name, in_si(name, getattr(self, name), unit, **bounds))
        product = self.tau_n * self.n_n / RPM
        if abs(product - self.power) > 0.05 * self.power:  # catalogues round
            raise ParameterError(
                f"power = {self.power:g} W, but tau_n = {self.tau_n:g} N m at n_n = {self.n_n:g} 1/min makes "
                f"{product:.4g} W. Give power in W, torques in N m, speeds in 1/min."
            )
        if not self.tau_s <= self.tau_a or not self.tau_s < self.tau_k:
            raise ParameterError(
                f"tau_s = {self.tau_s:g} N m must be less than tau_k = {self.tau_k:g} N m and not more than tau_a = "
                f"{self.tau_a:g} N m: the pull-up torque is the smallest on the way up."
            )
        if self.n_max is not None and self.n_max < self.n_n:
            raise ParameterError(f"n_max = {self.n_max:g} 1/min is less than the rated speed n_n = {self.n_n:g} 1/min.")
        _ = self.nameplate  # refuses a rated point that no curve passes through

    @cached_property
    def nameplate(self) -> Nameplate:
        """The motor as the parts of a network take it: `nameplate.cage("motor")`, `.kloss`, `.drive`."""
        names = ("power", "n_n", "tau_n", "n_sync", "tau_a", "tau_s", "tau_k", "f_n")
        values = {name: getattr(self, name) for name in names}
        chosen = dict.fromkeys(names, TYPICAL) if self.source == TYPICAL else {}
        return Nameplate(name=self.name, source=self.source, chosen=chosen, **values)

    @property
    def fastest(self) -> float:
        """Highest speed that is allowed, 1/min."""
        return self.n_sync if self.n_max is None else self.n_max

    def limit(self, n: Array) -> Array:
        """Largest torque in N m at speeds in 1/min, fed by an inverter that keeps voltage over frequency.

        Law: tau_k up to the pull-out speed n_k = n_sync (1 - s_k), then tau_k (n_k / n)^2, as of `PullOutDrive`; none
        beyond n_max. The inverter's own current limit is not in it. Source: Marinkovic 2012, (3a), (3b).

        Args:
            n: (k,) speeds without sign, 1/min.
        """
        speeds = np.asarray(numbers_in_si("n", n, "1/min"), dtype=float)
        n_k = self.n_sync * (1 - self.nameplate.s_k)
        weakened = self.tau_k * (n_k / np.maximum(speeds, n_k)) ** 2
        return np.where(speeds <= self.fastest * (1 + TYPED), weakened, 0.0)


NUMBERS: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    "power": ("W", {"above": 0}),
    **dict.fromkeys(("n_n", "n_sync", "n_max"), ("1/min", {"above": 0})),
    **dict.fromkeys(("tau_n", "tau_a", "tau_s", "tau_k"), ("N*m", {"above": 0})),
    "J": ("kg*m^2", {"at_least": 0}),
    "f_n": ("Hz", {"above": 0}),
}
"""Unit and bounds of every number of a motor."""
COLUMNS = tuple(field.name for field in fields(CatalogueMotor))
NEEDED = tuple(field.name for field in fields(CatalogueMotor) if field.default is MISSING)


def catalogue(path: str | Path | None = None) -> tuple[CatalogueMotor, ...]:
    """The motors of a file, or those of the package, which are chosen as typical and no maker's.

    The file is CSV, its first line the names of the columns, in any order: those of `CatalogueMotor`. An empty cell is
    the default; lines that begin with # are remarks.

    Args:
        path: of the file.

    Raises:
        ParameterError: there is no such file, columns are missing or unknown, or rows are wrong; names them all.
    """
    if path is not None and not isinstance(path, str | Path):
        raise ParameterError(f"A catalogue is a file, and {path!r} is no path of one. Give that of a CSV file.")
    file = OWN if path is None else Path(path)
    try:
        text = file.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise ParameterError(f"The catalogue '{file}' cannot be read: {error}. Give the path of a CSV file.") from None
    lines = [
        (number, line) for number, line in enumerate(text.splitlines(), 1) if line.strip() and line.strip()[0] != "#"
    ]
    if len(lines) < 2:
        raise ParameterError(
            f"The catalogue '{file}' has no motors. Its first line names the columns, {', '.join(NEEDED)}; every other "
            "line is a motor."
        )
    columns = [name.strip() for name in _cells(lines[0][1])]
    _refuse_columns(file, columns)
    motors, wrong = list[CatalogueMotor](), list[str]()
    for number, line in lines[1:]:
        cells = _cells(line)
        try:
            motors.append(_motor(columns, cells, TYPICAL if path is None else file.name))
        except ParameterError as error:
            wrong.append(
                f"  line {number} ({cells[columns.index('name')] if len(cells) == len(columns) else ''}): {error}"
            )
    wrong += [f"  {name!r} is the name of {count} motors." for name, count in _twice(motors)]
    if wrong:
        more = [f"  and {len(wrong) - SHOWN} more"] if len(wrong) > SHOWN else []
        raise ParameterError("\n".join([f"The catalogue '{file}' has mistakes:", *wrong[:SHOWN], *more]))
    return tuple(motors)


def _refuse_columns(file: Path, columns: list[str]) -> None:
    missing = [name for name in NEEDED if name not in columns]
    unknown = [repr(name) for name in columns if name not in COLUMNS]
    twice = [repr(name) for name in dict.fromkeys(columns) if columns.count(name) > 1]
    wrong = [
        f"{text} {', '.join(names)}"
        for text, names in (("lacks", missing), ("has the unknown", unknown), ("has twice", twice))
        if names
    ]
    if wrong:
        raise ParameterError(
            f"The catalogue '{file}' {'; it '.join(wrong)}. Columns are {', '.join(NEEDED)}, and if you like "
            f"{', '.join(name for name in COLUMNS if name not in NEEDED)}; separated by commas, in SI and 1/min."
        )


def _cells(line: str) -> list[str]:
    """The cells of a line; none where a quote in it does not close."""
    try:
        return next(csv.reader([line], strict=True))
    except csv.Error:
        return []


def _motor(columns: list[str], cells: list[str], source: str) -> CatalogueMotor:
    """A motor from a line.

    Raises:
        ParameterError: the line is wrong.
    """
    if not cells:
        raise ParameterError("its quotes do not match. A motor is one line, and what is in quotes ends in it.")
    if len(cells) != len(columns):
        raise ParameterError(f"it has {len(cells)} cells, and there are {len(columns)} columns.")
    values: dict[str, Any] = {"source": source}
    for name, cell in zip(columns, map(str.strip, cells), strict=True):
        if cell:
            values[name] = _number(name, cell) if name in NUMBERS else cell
    if empty := [name for name in NEEDED if name not in values]:
        raise ParameterError(f"{', '.join(empty)} is empty.")
    return CatalogueMotor(**values)


def _number(name: str, cell: str) -> float:
    try:
        return float(cell)
    except ValueError:
        raise ParameterError(f"{name} = {cell!r} is no number. Write it with a point, without its unit.") from None


def _twice(motors: list[CatalogueMotor]) -> Iterator[tuple[str, int]]:
    names = [motor.name for motor in motors]
    return ((name, names.count(name)) for name in dict.fromkeys(names) if names.count(name) > 1)
