"""Which model a command is about."""

from __future__ import annotations

from argparse import Namespace
from typing import TYPE_CHECKING

from shaftwork.cli.command import FALLBACK_END

if TYPE_CHECKING:
    from shaftwork.pipeline.network import Network
    from shaftwork.scenes.catalog import Scene


def load(options: Namespace) -> tuple[Network, Scene | None]:
    """The network of a scene or a model file, and the scene if it is one.

    Raises:
        ModelFileError: it is neither.
    """
    from shaftwork.core.errors import ModelFileError
    from shaftwork.pipeline.network import Network
    from shaftwork.scenes import SCENES

    name = options.model
    if name in SCENES:
        return SCENES[name](), SCENES[name]
    if not name.endswith(".toml"):
        raise ModelFileError(f"'{name}' is neither a scene nor a .toml file. The scenes are: {', '.join(SCENES)}.")
    return Network.load(name), None


def end_of(options: Namespace, scene: Scene | None, fallback: float = FALLBACK_END) -> float:
    """The end of the motion in s: as given, of the scene, or a fallback.

    Raises:
        ParameterError: no motion can end then.
    """
    from shaftwork.pipeline.arguments import time_span

    end = options.t_end if options.t_end is not None else scene.t_end if scene else fallback
    return time_span(0.0, end)[1]
