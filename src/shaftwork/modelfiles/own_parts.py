"""Parts that are not of the library: a file names their modules, which are imported where they are trusted."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from importlib import import_module
from typing import Any

from shaftwork.components import REGISTRY, Component
from shaftwork.core.errors import ModelFileError, ParameterError, in_one_line

MODULE = re.compile(r"[^\W\d]\w{0,63}(?:\.[^\W\d]\w{0,63}){0,9}")
"""The name of a module."""


def modules_of(parts: Iterable[Component]) -> tuple[str, ...]:
    """The modules that define the parts which are not of the library; of those in a script there is none to import."""
    modules = dict.fromkeys(_defined(type(part)).__module__ for part in parts)
    return tuple(name for name in modules if name != "__main__" and not name.startswith("shaftwork."))


def checked_trust(trust: Any) -> tuple[str, ...]:
    """The packages that a user trusts.

    Raises:
        ParameterError: these are no names of modules.
    """
    names = tuple(trust) if isinstance(trust, Iterable) and not isinstance(trust, str | bytes) else None
    if names is None or not all(isinstance(name, str) and MODULE.fullmatch(name) for name in names):
        raise ParameterError(f"trust = {trust!r} must be a list of packages whose code may run, such as ['mypackage'].")
    return names


def import_modules(modules: Sequence[str], missing: Sequence[str], trust: Sequence[str]) -> None:
    """Import the modules of a file whose parts are not there yet.

    Args:
        modules: that the file names.
        missing: types of its parts that are not there; without any nothing is imported.
        trust: packages whose modules may be imported.

    Raises:
        ModelFileError: a module is not trusted, or cannot be imported.
    """
    for module in modules if missing else ():
        if not any(module == package or module.startswith(f"{package}.") for package in trust):
            raise ModelFileError(
                f"the part '{missing[0]}' is of the module '{module}', whose code a file may not run. If you know it, "
                f"import it before, or load with trust=['{module.partition('.')[0]}']."
            )
        try:
            import_module(module)
        except Exception as error:
            raise ModelFileError(f"the module '{module}' cannot be imported: {in_one_line(error)}.") from error


def _defined(kind: type[Component]) -> type[Component]:
    """The class as its author wrote it, of which that of a circuit is an image."""
    return next((base for base in kind.__mro__ if REGISTRY.get(base.__name__) is base), kind)
