"""The models of a shaft that are compared, from small to large."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable

from shaftwork.components.shaft_models import CentralDifference, Lumped, OneSpring, ShaftModel, Spectral, Wave
from shaftwork.core.errors import ParameterError

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
    asked = list(models) if models is not None else list(dict.fromkeys(map(_kind, LADDER)))
    wanted = None if sizes is None else list(sizes)
    made: list[ShaftModel] = []
    for text in asked:
        model = ShaftModel.read(text if "(" in text else f"{text}()")
        size = next(iter(dataclasses.fields(model)), None)
        given = size is None or isinstance(model, Wave) or _has_size(text, size.name)
        same = [known for known in LADDER if _kind(known) == _kind(model)] or [model]
        if given:
            made.append(model)
        elif wanted is None:
            made += same
        else:
            assert size is not None  # noqa: S101 (else it is given)
            made += [dataclasses.replace(model, **{size.name: number}) for number in wanted]
    if not made:
        raise ParameterError("Name a model, such as --models Lumped Spectral.")
    return tuple(made)


def _kind(model: ShaftModel) -> str:
    """The text of a model without its size."""
    fields = [field for field in dataclasses.fields(model)[1:] if getattr(model, field.name) != field.default]
    return f"{type(model).__name__}({', '.join(f'{f.name}={getattr(model, f.name)!r}' for f in fields)})"


def _has_size(text: str, name: str) -> bool:
    """Whether a text names the size, as its first value or by its name."""
    _, _, inside = text.partition("(")
    first = inside.rstrip(") ").split(",")[0].strip()
    return first.isdigit() or f"{name}=" in inside.replace(" ", "")


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
