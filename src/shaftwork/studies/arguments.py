"""What a user asks a study for, checked before anything runs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any, TypeVar

from shaftwork.components.shaft_models import ShaftModel
from shaftwork.core.errors import ParameterError
from shaftwork.integrate.engines import ENGINES

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


def by_name(measures: Any) -> dict[str, Any]:
    """What a user wants measured, by the names given to it; of a list each measure is its own name.

    Raises:
        ParameterError: it is neither a mapping nor a list, there is nothing in it, or two have the same name.
    """
    if isinstance(measures, str):
        measures = [measures]
    if not isinstance(measures, Iterable):
        raise ParameterError(f"measures = {measures!r} must be a list of names, such as ['max shaft.tau'].")
    if not isinstance(measures, Mapping):
        measures = {text: text for text in map(str, measures)}
    if not measures:
        raise ParameterError("Name a measure, such as measures=['max shaft.tau'].")
    if twice := repeated(map(str, measures)):
        raise ParameterError(f"Two measures are called '{twice}'. Give each a name of its own.")
    return {str(name): measure for name, measure in measures.items()}


def repeated(names: Iterable[str]) -> str:
    """The first name that is there twice; empty where none is."""
    return next((name for name, count in Counter(names).items() if count > 1), "")


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
