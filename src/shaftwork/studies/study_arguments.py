"""What a user asks a study for, checked before anything runs: measures, engines, and models of a shaft."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, TypeVar

from shaftwork.components.shaft_models import CentralDifference, Lumped, OneSpring, ShaftModel, Spectral, Wave
from shaftwork.core.errors import ParameterError
from shaftwork.integrate.engines import ENGINES

NAMES = ("auto", *ENGINES, "wave")
"""What an engine may be called in a study."""

Item = TypeVar("Item")


def several(name: str, items: Iterable[Item]) -> tuple[Item, ...]:
    """A sequence that a user gave.

    Raises:
        ParameterError: it is one text, whose letters nobody means, or no sequence.
    """
    if isinstance(items, str) or not isinstance(items, Iterable):
        raise ParameterError(f"{name} = {items!r} must be a sequence. Write {name}=[{items!r}].")
    return tuple(items)


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


def engine_names(engines: Iterable[str]) -> tuple[str, ...]:
    """Engines by name.

    Raises:
        ParameterError: there is no such engine.
    """
    names = several("engines", engines)
    if unknown := [name for name in names if name not in NAMES]:
        raise ParameterError(f"There is no engine {unknown[0]!r}. Take some of: {', '.join(NAMES)}.")
    return names


def shaft_models(models: Iterable[ShaftModel | str]) -> tuple[ShaftModel, ...]:
    """Models, or their texts.

    Raises:
        ParameterError: a text is no model.
    """
    return tuple(m if isinstance(m, ShaftModel) else ShaftModel.read(m) for m in several("models", models))


LADDER: tuple[ShaftModel, ...] = (
    Wave(3),
    OneSpring(),
    *(Spectral(n) for n in (2, 4, 8, 16, 32, 48)),
    *(Lumped(m) for m in (5, 10, 20, 40, 80, 160)),
    *(Lumped(m, ends="full") for m in (5, 10, 20, 40, 80, 160)),
    *(CentralDifference(m, order=4) for m in (10, 20, 40)),
    *(CentralDifference(m) for m in (10, 20, 40, 80)),
    *(CentralDifference(m, closure="printed") for m in (10, 20, 40, 80)),
)
"""The models and sizes that are compared where none are named; the four variants of Popenda 2019 among them."""


def rungs(models: Iterable[str] | None, sizes: Iterable[int] | None) -> tuple[ShaftModel, ...]:
    """Models by their texts, in several sizes where they are named without one.

    Args:
        models: such as "Lumped", "Lumped(20)" or "CentralDifference(closure='printed')"; None for all kinds.
        sizes: of those that have one; None for those of `LADDER`.

    Raises:
        ParameterError: one is no model, or has no such size.
    """
    numbers = None if sizes is None else list(sizes)
    if models is None:
        named = [(model, False) for model in dict.fromkeys(map(_without_size, LADDER))]
    else:
        read = [(text, ShaftModel.read(text if "(" in text else f"{text}()")) for text in models]
        named = [(model, _names_its_size(text, model)) for text, model in read]
    if not named:
        raise ParameterError("Name a model, such as --models Lumped Spectral.")
    return tuple(rung for model, sized in named for rung in ([model] if sized else _in_sizes(model, numbers)))


def _in_sizes(model: ShaftModel, sizes: Sequence[int] | None) -> list[ShaftModel]:
    """A model in the given sizes, or in those of the ladder."""
    size = next(iter(dataclasses.fields(model)), None)
    if size is None or isinstance(model, Wave):
        return [model]
    if sizes is None:
        return [rung for rung in LADDER if _without_size(rung) == _without_size(model)] or [model]
    return [dataclasses.replace(model, **{size.name: number}) for number in sizes]


def _without_size(model: ShaftModel) -> ShaftModel:
    """A model of the same kind in its default size."""
    return dataclasses.replace(model, **{field.name: field.default for field in dataclasses.fields(model)[:1]})


def _names_its_size(text: str, model: ShaftModel) -> bool:
    """Whether the text of a model has its size, as its first value or by its name."""
    inside = text.partition("(")[2]
    names = [f"{field.name}=" for field in dataclasses.fields(model)[:1]]
    return inside.rstrip(") ").split(",")[0].strip().isdigit() or any(n in inside.replace(" ", "") for n in names)


def text_of(model: ShaftModel) -> str:
    """The model with its size and what differs from the default, so that a row is short."""
    fields = dataclasses.fields(model)
    shown = [f for k, f in enumerate(fields) if k == 0 or getattr(model, f.name) != f.default]
    return f"{type(model).__name__}({', '.join(f'{f.name}={getattr(model, f.name)!r}' for f in shown)})"


def family_of(model: str) -> str:
    """The text of a model without its size."""
    name, _, arguments = model.rstrip(")").partition("(")
    _, comma, choices = arguments.partition(",")
    return f"{name}{comma}{choices}"
