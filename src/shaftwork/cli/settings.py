"""Values of parameters and quantities as they are written on the command line."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, TypeVar

from shaftwork.core.errors import MissingExtraError, ModelFileError, ParameterError
from shaftwork.core.parameters import UNIT

if TYPE_CHECKING:
    from shaftwork.components.base import Component
    from shaftwork.core.parameters import Parameter
    from shaftwork.pipeline.network import Network
    from shaftwork.results.observer import Array

Item = TypeVar("Item")

_QUANTITY = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(?:(%)|(?:\s1)?\s*(/\s*[^\W\d].*)|([^\W\d].*))")
"""A number and a unit behind it: 3 kg, 94 %, 1500 1/min or 1500/min."""
_OF_SPEED = re.compile(r"(-?)(?:(\d+\.?\d*|\.\d+)\s*\*\s*)?n(?:\s*/\s*(\d+\.?\d*|\.\d+))?")
"""A multiple of the speed n of a diagram: n, -n, 2*n, n/3, 2*n/3."""


def with_settings(net: Network, settings: Iterable[str]) -> Network:
    """The network with other values, each written as part.parameter=value.

    Raises:
        ParameterError: there is no such parameter, or the value is not admissible.
        MissingExtraError: a value has a unit, and pint is not installed.
    """
    from shaftwork.pipeline.network import with_values

    return with_values(net, once("--set", (setting(net, text) for text in settings)))


def setting(net: Network, text: str) -> tuple[str, Any]:
    """The parameter and the value of part.parameter=value.

    Raises:
        ParameterError: there is no such parameter, or the value is not admissible.
        MissingExtraError: the value has a unit, and pint is not installed.
    """
    name, written = named(text, "--set", "shaft.c=2e4")
    part, declared = parameter_of(net, name)
    value = _value(name, declared, written)
    _, objection = declared.magnitude(value)
    if objection is not None:
        unit = "" if declared.record is not None or declared.unit == "1" else f" in {declared.unit}"
        raise ParameterError(
            f"{text}: {declared.name} of {type(part).__name__} '{part.name}' {objection}. Give it "
            f"({declared.meaning}){unit}{f', {declared.bounds}' if declared.bounds else ''}."
        )
    return name, value


def numbers(net: Network, text: str) -> tuple[str, list[Any]]:
    """The parameter and the values of part.parameter=value,value,... or part.parameter=first:last:count.

    Raises:
        ParameterError: there is no such parameter, or these are no values.
        MissingExtraError: a value has a unit, and pint is not installed.
    """
    import numpy as np

    name, written = named(text, "--vary", "shaft.c=2e4,3e4 or shaft.c=2e4:4e4:11")
    _, declared = parameter_of(net, name)
    ends = written.split(":")
    if len(ends) == 1:
        return name, [_value(name, declared, item) for item in written.split(",")]
    count = int(ends[2]) if len(ends) == 3 and re.fullmatch(r" *[0-9]{1,9} *", ends[2]) else 0
    most = 1_000_000  # more is a typing error
    if not 2 <= count <= most:
        raise ParameterError(f"{text}: write first:last:count with a count from 2 to {most}, such as {name}=1:2:11.")
    first, last = (declared.magnitude(_value(name, declared, end)) for end in ends[:2])
    if objection := first[1] or last[1]:
        raise ParameterError(f"{text}: {name} {objection}.")
    return name, np.linspace(first[0], last[0], count).tolist()


def varied(net: Network, texts: Iterable[str], settings: Iterable[str]) -> dict[str, list[Any]]:
    """The parameters that a sweep varies and their values, each text as of `numbers`.

    Args:
        net: the network.
        texts: of `--vary`.
        settings: of `--set`, for parameters that are not varied.

    Raises:
        ParameterError: a text is wrong, or a parameter is there twice.
        MissingExtraError: a value has a unit, and pint is not installed.
    """
    values = once("--vary", (numbers(net, text) for text in texts))
    for name in (named(text, "--set", "shaft.c=2e4")[0] for text in settings):
        if name in values:
            raise ParameterError(f"--vary gives '{name}' its values, so --set {name}=... has no effect. Leave it out.")
    return values


def speeds_in(text: str) -> Array:
    """(k,) speeds in rad/s, written in 1/min as first:last:count or with commas between them.

    Raises:
        ParameterError: they are none.
    """
    import numpy as np

    from shaftwork.results.observer import RPM

    most = 100_000  # more is a typing error
    ends = text.split(":")
    try:
        if len(ends) == 3:
            n = np.linspace(float(ends[0]), float(ends[1]), min(int(ends[2]), most))
        else:
            n = np.array([float(speed) for speed in text.split(",")])
    except ValueError:
        n = np.empty(0)
    if not (n.size and bool(((n >= 0) & (n < math.inf)).all())):
        raise ParameterError(
            f"--speeds {text}: write first:last:count in 1/min, such as 300:900:61, or speeds with commas between them."
        )
    return np.asarray(n / RPM)


def follows_speed(text: str) -> bool:
    """Whether a quantity of a point is a multiple of the speed n."""
    return _OF_SPEED.fullmatch(named(text, "--at", "J1.omega=n")[1]) is not None


def point(texts: Iterable[str], n: float | None = None, option: str = "--at") -> dict[str, Any]:
    """Quantities and their values, each written as name=value: a number in SI, or one with its unit.

    Args:
        texts: of the option.
        n: speed in rad/s, where values may be multiples of it.
        option: its name.

    Raises:
        ParameterError: one is none, or is there twice.
        MissingExtraError: a value has a unit, and pint is not installed.
    """
    return once(option, (_of_point(text, n, option) for text in texts))


def _of_point(text: str, n: float | None, option: str) -> tuple[str, Any]:
    name, written = named(text, option, "J1.omega=100")
    multiple = None if n is None else _OF_SPEED.fullmatch(written)
    if n is not None and multiple and (divisor := float(multiple[3] or 1)):
        return name, float(f"{multiple[1]}{multiple[2] or 1}") * n / divisor
    try:
        return name, float(written)
    except ValueError:
        if _QUANTITY.fullmatch(written):
            return name, _quantity(name, written)
        multiples = "" if n is None else ", or a multiple of the speed such as n, 2*n or n/3"
        raise ParameterError(f"{text}: {written!r} must be a number in SI, or one with its unit{multiples}.") from None


def once(option: str, pairs: Iterable[tuple[str, Item]]) -> dict[str, Item]:
    """Names and their values as a mapping.

    Raises:
        ParameterError: a name is there twice; the last value would hold, and nobody would see that the first does not.
    """
    values: dict[str, Item] = {}
    for name, value in pairs:
        if name in values:
            raise ParameterError(f"{option} gives '{name}' twice. Give it once.")
        values[name] = value
    return values


def named(text: str, option: str, example: str) -> tuple[str, str]:
    """Both sides of the first equals sign.

    Raises:
        ParameterError: a side is empty.
    """
    name, _, written = (side.strip() for side in text.partition("="))
    if not name or not written:
        raise ParameterError(f"{option} {text!r}: write name=value, such as {option} {example}.")
    return name, written


def parameter_of(net: Network, name: str) -> tuple[Component, Parameter]:
    """A part and the declaration of one of its parameters, by "part.parameter".

    Raises:
        ParameterError: there is none; the message lists what there is.
    """
    owner, _, parameter = name.rpartition(".")
    part = next((part for part in net.parts if part.name == owner), None)
    if part is None:
        raise ParameterError(f"There is no part '{owner}'. The parts are: {_some([part.name for part in net.parts])}.")
    if parameter not in part.declared:
        listed = _some([f"{owner}.{key}" for key in part.declared])
        there = f"has: {listed}" if part.declared else "has no parameters"
        raise ParameterError(f"There is no parameter '{name}'. {type(part).__name__} '{owner}' {there}.")
    return part, part.declared[parameter]


def _value(name: str, declared: Parameter, text: str) -> Any:
    """A number in SI, a quantity with its unit, a law, or the text of a record."""
    if declared.record is not None:
        return text
    try:
        return float(text)
    except ValueError:
        pass
    why = f"give a number in {declared.unit} ({declared.meaning}), or with a unit."
    if declared.law:
        from shaftwork.modelfiles.storage import law_of

        try:
            return law_of(name.rpartition(".")[2], text)
        except ModelFileError as error:
            why = str(error)
    if _QUANTITY.fullmatch(text.strip()):  # no law reads so
        return _quantity(name, text)
    raise ParameterError(f"{name}={text}: {why}")


def _quantity(name: str, text: str) -> Any:
    try:
        from pint import application_registry
    except ImportError:
        raise MissingExtraError("pint", "units", f"{name}={text} with a unit") from None
    longest = 100  # characters
    number = _QUANTITY.fullmatch(text.strip())
    unit = "" if number is None else "percent" if number[2] else number[3] or number[4]
    if number is None or len(text) > longest or not UNIT.fullmatch(unit):
        raise ParameterError(
            f"{name}={text[:longest]} is no number with a unit. Write the number, then units with * / and "
            "powers of one digit, such as '3 kg*m**2'."
        )
    try:
        return application_registry.Quantity(f"{number[1]} {unit}")
    except Exception as error:  # noqa: BLE001 (pint raises what its tokeniser does, too)
        raise ParameterError(f"{name}={text} is no number with a unit: {error}.") from None


def _some(names: Sequence[str], most: int = 20) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
