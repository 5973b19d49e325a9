"""What a user asks a study for, checked before anything runs."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

from shaftwork.components.shaft_models import ShaftModel
from shaftwork.core.errors import ParameterError
from shaftwork.integrate.choice import ENGINES

NAMES = ("auto", *ENGINES, "wave")
"""What an engine may be called in a study."""

Item = TypeVar("Item")


def several(name: str, given: Iterable[Item]) -> tuple[Item, ...]:
    """A sequence that a user gave.

    Raises:
        ParameterError: it is one text, whose letters nobody means, or no sequence.
    """
    if isinstance(given, str) or not isinstance(given, Iterable):
        raise ParameterError(f"{name} = {given!r} must be a sequence. Write {name}=[{given!r}].")
    return tuple(given)


def engine_names(given: Iterable[str]) -> tuple[str, ...]:
    """Engines by name.

    Raises:
        ParameterError: there is no such engine.
    """
    asked = several("engines", given)
    if unknown := [name for name in asked if name not in NAMES]:
        raise ParameterError(f"There is no engine {unknown[0]!r}. Take some of: {', '.join(NAMES)}.")
    return asked


def shaft_models(given: Iterable[ShaftModel | str]) -> tuple[ShaftModel, ...]:
    """Models, or their texts.

    Raises:
        ParameterError: a text is no model.
    """
    asked = several("models", given)
    return tuple(model if isinstance(model, ShaftModel) else ShaftModel.read(model) for model in asked)
