"""The models of a shaft that a user asks a study for, checked before anything runs."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence

from shaftwork.components.shaft_models import CentralDifference, Lumped, OneSpring, ShaftModel, Spectral, Wave
from shaftwork.core.errors import ParameterError
from shaftwork.pipeline.arguments import several


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
