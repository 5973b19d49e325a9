"""Declared parameters: unit, bounds, default and meaning are data that checks, docs and LaTeX tables are made from."""

from __future__ import annotations

import ast
import dataclasses
import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from operator import index
from typing import Any

from shaftwork.core.errors import ParameterError

REQUIRED: Any = object()
"""Stands for the default of a parameter that has none."""

SMALLEST, LARGEST = 1e-60, 1e60
"""Sizes of values in SI: beyond them products of a few parameters leave the range of floating-point numbers."""
ANGLES = ("radian", "degree", "turn", "revolution", "gradian", "arc")
PER_ANGLE = ("rad", "N*m/A")
"""In SI units of what is per angle or speed: a torque constant in N*m/A is one of V*s/rad, too."""
RATES = ("minute", "hour", "hertz")
"""In units of speeds that are given in revolutions as a rule."""
UNIT = re.compile(r"(?:[^\W\d]\w*+|(?:\*\*|\^) *[-+]?\d(?:\.\d+)?(?! *(?:\*\*|\^))|[*/() ·])*+")
"""Names of units, their products and quotients, and powers of one digit: the reader behind computes any other number,
of any size."""
BOUNDS = ("above", "at_least", "at_most", "nonzero", "whole", "law", "record")
"""Fields of `Parameter` that say which values are admissible."""


def refuse_fields(record: Any, /, **fields: tuple[bool, str]) -> None:
    """Refuse a record with a field that is not what it must be.

    Args:
        record: a dataclass.
        **fields: by name of a field, whether it is right, and in words what would be.

    Raises:
        ParameterError: a field is not right; names the first.
    """
    for name, (right, words) in fields.items():
        if not right:
            value = repr(getattr(record, name))
            shown = value if len(value) <= 80 else f"{value[:77]}..."
            raise ParameterError(f"{type(record).__name__}: {name} = {shown} must be {words}.")


def is_label(value: Any) -> bool:
    """Whether a text can stand behind the dot of a quantity's name: printable, without dots."""
    return isinstance(value, str) and bool(value.strip()) and value.isprintable() and "." not in value


@dataclass(frozen=True)
class Parameter:
    """The declaration of one parameter of a component.

    Args:
        name: keyword under which it is given.
        unit: SI unit as text, "1" for a pure number.
        meaning: what it is, a few words.
        default: value where the user gives none, or `REQUIRED`.
        above: exclusive lower bound, or None.
        at_least: inclusive lower bound, or None.
        at_most: inclusive upper bound, or None.
        nonzero: zero is refused.
        whole: only whole numbers are admitted.
        law: also takes a table or an expression of time, speed and angle.
        latex: LaTeX symbol.
        record: a class of records that the value is one of, instead of a number; its `read` makes one of a text.
    """

    name: str
    unit: str
    meaning: str
    default: Any = REQUIRED
    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None
    nonzero: bool = False
    whole: bool = False
    law: bool = False
    latex: str = ""
    record: Any = None

    def __post_init__(self) -> None:
        def is_bound(value: Any) -> bool:
            return value is None or (isinstance(value, int | float) and not math.isnan(value))

        readable = self.record is None or (
            isinstance(self.record, type) and callable(getattr(self.record, "read", None))
        )
        limits, texts = ("above", "at_least", "at_most"), ("unit", "meaning", "latex")
        flags = ("nonzero", "whole", "law")
        refuse_fields(
            self,
            **{name: (is_bound(getattr(self, name)), "a number, or None") for name in limits},
            **{name: (isinstance(getattr(self, name), str), "a text") for name in texts},
            **{name: (isinstance(getattr(self, name), bool), "True or False") for name in flags},
            record=(readable, "a class with a class method `read`, or None"),
        )

    @property
    def required(self) -> bool:
        """Whether the user must give a value."""
        return self.default is REQUIRED

    @property
    def bounds(self) -> str:
        """The admissible range in words, empty when every finite number will do."""
        rules = (
            (self.above, "above"),
            (self.at_least, "at least"),
            (self.at_most, "at most"),
        )
        words = [f"{text} {value:g}" for value, text in rules if value is not None]
        kinds = ((self.nonzero, "not zero"), (self.whole, "whole"))
        return " and ".join([*words, *(text for applies, text in kinds if applies)])

    def objection(self, value: float) -> str | None:
        """Why a number is not admissible, or None when it is."""
        if not math.isfinite(value):
            return "must be a finite number"
        if value and not SMALLEST <= abs(value) <= LARGEST:
            return f"must lie between {SMALLEST:g} and {LARGEST:g} in size, or be exactly zero"
        outside = (
            (self.above is not None and value <= self.above)
            or (self.at_least is not None and value < self.at_least)
            or (self.at_most is not None and value > self.at_most)
            or (self.nonzero and value == 0)
            or (self.whole and value != round(value))
        )
        return f"must be {self.bounds}" if outside else None

    def magnitude(self, value: Any) -> tuple[Any, str | None]:
        """The value in SI as a float (also a law's expression, or the record), and the objection to it, or None."""
        if value is None and self.default is None:
            return None, None
        if self.record is not None:
            return self._from_text(value)
        if is_quantity(value):
            return self._from_quantity(value)
        if value is None or isinstance(value, (bool, str, bytes, complex)):
            return value, f"must be a number{' or a law' if self.law else ''}, not {type(value).__name__} {value!r}"
        if self.law and getattr(value, "free_symbols", None):
            return value, None
        try:
            number = float(value)
        except (TypeError, ValueError, OverflowError):
            if self.law and callable(getattr(value, "has", None)):  # a table: a law of time without symbols
                return value, None
            return value, f"must be a number{' or a law' if self.law else ''}, not {type(value).__name__}"
        return number, self.objection(number)

    def _from_text(self, value: Any) -> tuple[Any, str | None]:
        if isinstance(value, self.record):
            return value, None
        try:
            return self.record.read(value), None
        except ParameterError as error:
            return value, f"cannot be read: {str(error).rstrip('.')}"

    def _from_quantity(self, value: Any) -> tuple[Any, str | None]:
        magnitude, objection = converted(value, self.unit)
        if objection is not None:
            return value, objection
        if getattr(magnitude, "ndim", 0):
            return value, "must be one number, not several"
        try:
            number = float(magnitude)
        except (TypeError, ValueError):
            return value, "has a unit but is no number; a law is written in plain numbers"
        return number, self.objection(number)


def call_in(text: Any) -> tuple[str, list[Any], dict[str, Any]] | None:
    """A call such as "Lumped(20)" as name, values and named values; None where a text is not one of plain values."""
    try:
        call = ast.parse(text, mode="eval").body
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name):
            options = {str(item.arg): ast.literal_eval(item.value) for item in call.keywords}
            return call.func.id, [ast.literal_eval(value) for value in call.args], options
    except (SyntaxError, ValueError, TypeError, RecursionError, MemoryError):
        pass
    return None


def is_quantity(value: Any) -> bool:
    """Whether a value has units."""
    return hasattr(value, "dimensionality") and hasattr(value, "to")


def briefly(value: Any) -> str:
    """A number for a title, and the unit of a quantity as diagrams write it: "80 1/min", "2 kN*m"."""
    return f"{value:.4g~C}".replace(" rpm", " 1/min") if is_quantity(value) else f"{value:.4g}"


def converted(value: Any, unit: str) -> tuple[Any, str | None]:
    """The number, or array of numbers, of a quantity in a unit; and the objection to its units, or None.

    Units with angles need care: to a library of units a revolution is 2 pi and a radian is 1, pure numbers. So a
    speed needs a unit that says which it counts, and a frequency counts revolutions, whatever it is given in. What is
    per speed, such as N*m*s/rad, may be given without an angle in seconds (N*m*s, per rad/s), but not per 1/min or Hz.
    """
    words = format(value.units, "D")
    counts_angle = any(word in words for word in ANGLES)
    if "rad/s" in unit and not counts_angle and (value.check("1/[time]") or "hertz" in words):
        return value, f"is given in '{value.units}', which may count revolutions or radians; give rpm or rad/s"
    if any(word in unit for word in PER_ANGLE) and not counts_angle and any(word in words for word in RATES):
        return value, f"is given in '{value.units}', which may count revolutions or radians; write rpm or rad into it"
    turns = {"1/min": "revolution / minute", "Hz": "revolution / second", "1/s": "revolution / second"}
    plain = {"1": "dimensionless", "1/min": "1 / minute", "Hz": "1 / second"}
    target = turns.get(unit) if counts_angle else None
    try:
        return value.to(target or plain.get(unit, unit)).magnitude, None
    except Exception as error:  # noqa: BLE001 (pint has its own classes, which must not be imported here)
        return value, f"is given in '{value.units}', but needs {'a pure number' if unit == '1' else unit} ({error})"


def numbers_in_si(name: str, values: Any, unit: str = "1") -> Any:
    """Numbers that a user gave, in SI: of a quantity, of an array of one, or of a list of quantities; else as they are.

    Args:
        name: of the argument, for the message.
        values: the numbers or quantities.
        unit: SI unit.

    Raises:
        ParameterError: the units are wrong.
    """
    if is_quantity(values):
        numbers, objection = converted(values, unit)
        if objection is not None:
            raise ParameterError(f"{name} {objection}.")
        return numbers
    mixed = isinstance(values, list | tuple) or str(getattr(values, "dtype", "")) == "object"
    if mixed and any(map(is_quantity, values)):
        return [numbers_in_si(f"{name}[{place}]", value, unit) for place, value in enumerate(values)]
    return values


def without_unit(name: str, value: Any, whose: str) -> Any:
    """A value whose unit hangs on something that is not known here: a number is itself, a quantity is refused.

    Args:
        name: of the argument, for the message.
        value: the number or quantity.
        whose: in whose SI unit it counts, such as "of the law, as N m".

    Raises:
        ParameterError: it is a quantity.
    """
    if is_quantity(value):
        raise ParameterError(f"{name} = {value} has a unit. Give a number in the SI unit {whose}.")
    return value


_argument = lru_cache(maxsize=256)(Parameter)
"""The declaration of an argument of a function: a short run asks for some of them again and again."""


def in_si(name: str, value: Any, unit: str = "1", **bounds: Any) -> float:
    """A number that a user gave as an argument, in SI; a quantity with units is converted.

    Args:
        name: of the argument, for the message.
        value: the number or quantity.
        unit: SI unit.
        **bounds: as of `Parameter`.

    Raises:
        ParameterError: it is no number, of the wrong unit or outside its bounds.
    """
    number, objection = _argument(name, unit, "", **bounds).magnitude(value)
    if objection is not None:
        raise ParameterError(f"{name} = {value!r} {objection}.")
    return float(number)


def whole(value: Any, least: int = 1, most: float = math.inf) -> int | None:
    """A count of any kind of integer, numpy's too, as Python's own; None where it is none or out of its range."""
    if isinstance(value, bool) or getattr(getattr(value, "dtype", None), "kind", "") == "b":  # numpy's bool too
        return None
    try:
        count = index(value)
    except TypeError:
        return None
    return count if count is not None and least <= count <= most else None


def parameter(unit: str, meaning: str, *, default: Any = REQUIRED, latex: str = "", **bounds: Any) -> Any:
    """Declare a parameter of a component: a dataclass field that carries its `Parameter` declaration.

    Args:
        unit: SI unit as text.
        meaning: what it is, a few words.
        default: value where the user gives none; without it the parameter is required.
        latex: LaTeX symbol, by default the name.
        **bounds: `above`, `at_least`, `at_most`, `nonzero`, `whole`, `law`, `record` of `Parameter`.

    Raises:
        ParameterError: there is no such bound, or an argument is of the wrong kind.
    """
    if unknown := [name for name in bounds if name not in BOUNDS]:
        raise ParameterError(f"parameter() takes no '{unknown[0]}'. It takes: default, latex, {', '.join(BOUNDS)}.")

    def declare(name: str) -> Parameter:
        return Parameter(name=name, unit=unit, meaning=meaning, default=default, latex=latex or name, **bounds)

    declare("")  # what is wrong is said here, where it is written
    metadata: dict[str, Callable[[str], Parameter]] = {"declare": declare}
    return dataclasses.field(
        default=dataclasses.MISSING if default is REQUIRED else default, metadata=metadata, kw_only=True
    )
