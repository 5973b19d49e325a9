"""What a ready scene is."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from shaftwork.core.errors import ParameterError
from shaftwork.pipeline.network import Network

T = TypeVar("T")


@dataclass(frozen=True)
class Scene:
    """A system from the literature, ready to run.

    Args:
        name: name on the command line.
        title: one line.
        source: author, equation or section.
        build: makes the network; its keyword arguments vary the scene.
        t_end: end of the motion, s.
        signals: the quantities worth looking at.
        chosen: what the source does not print and how it was chosen.
        phases: the phases that the source has equations for, in its order; the others follow from them.
    """

    name: str
    title: str
    source: str
    build: Callable[..., Network]
    t_end: float
    signals: tuple[str, ...]
    chosen: tuple[str, ...] = ()
    phases: tuple[str, ...] = ()

    def __call__(self, **options: Any) -> Network:
        return self.build(**options)


def choice(what: str, name: str, scene: str, options: Mapping[str, T]) -> T:
    """What an option of a scene stands for.

    Raises:
        ParameterError: there is no such option.
    """
    if name not in options:
        raise ParameterError(f"There is no {what} {name!r} of the {scene}. There are: {', '.join(options)}.")
    return options[name]
