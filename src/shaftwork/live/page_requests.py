"""What a page may ask of a session."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from shaftwork.core.errors import ParameterError

WANTED = ("curves", "extremes", "modes", "drawing")
"""What a request may want, from what takes the least time on."""
FIELDS = {"set": (dict,), "want": (list,), "t_end": (float, int, str), "at": (float, int, type(None))}
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
