"""What a page may ask of a session."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import in_si
from shaftwork.live.sliders import StartField
from shaftwork.network.netlist import Netlist
from shaftwork.pipeline.arguments import checked_parameter, time_span

WANTED = ("curves", "layout", "extremes", "modes", "drawing")
"""What a request may want, from what takes the least time on."""
FIELDS = {
    "set": (dict,),
    "initial": (dict,),
    "want": (list,),
    "t_end": (float, int, str),
    "at": (float, int, type(None)),
}
"""What a request may have, and as what; a time that is a text is refused by the library, in its words."""


def checked(request: Mapping[str, Any]) -> Mapping[str, Any]:
    """A request with its defaults.

    Raises:
        ParameterError: it is none.
    """
    if not isinstance(request, Mapping):
        raise ParameterError("A request must be an object, such as {'set': {'J1.J': 2.0}, 'want': ['curves']}.")
    for name, value in request.items():
        if name not in FIELDS:
            raise ParameterError(f"A request has no {name!r}. It has: {', '.join(FIELDS)}.")
        if not isinstance(value, FIELDS[name]):
            raise ParameterError(f"{name} = {value!r} of a request is of the wrong kind.")
    whole = {"set": {}, "want": [WANTED[0]], **request}
    if strange := [name for name in whole["want"] if name not in WANTED]:
        raise ParameterError(f"A request wants no {strange[0]!r}. It may want: {', '.join(WANTED)}.")
    return whole


def objections(
    netlist: Netlist, starts: Mapping[str, StartField], request: Mapping[str, Any]
) -> dict[str, dict[str, str]]:
    """What the library says to values of a request that cannot be, by field of the request and by name."""

    def start(name: str, value: Any) -> None:
        in_si(f"the start value of '{name}'", value, starts[name].unit if name in starts else "1")

    checks: dict[str, Callable[[str, Any], Any]] = {
        "set": lambda name, value: checked_parameter(netlist, name, value),
        "initial": start,
        "t_end": lambda _, end: time_span(0.0, end),
    }
    values = {"initial": {}, **request, "t_end": {key: request[key] for key in ("t_end",) if key in request}}
    said: dict[str, dict[str, str]] = {}
    for field, check in checks.items():
        for name, value in values[field].items():
            try:
                check(name, value)
            except ParameterError as error:
                said.setdefault(field, {})[name] = str(error)
    return said
