"""Which model a command is about, until when, and about which point."""

from __future__ import annotations

from argparse import Namespace
from typing import TYPE_CHECKING

from shaftwork.cli.command import FALLBACK_END
from shaftwork.cli.settings import point, with_settings
from shaftwork.core.errors import ModelFileError, ParameterError

if TYPE_CHECKING:
    from shaftwork.pipeline.model import Model
    from shaftwork.pipeline.network import Network
    from shaftwork.scenes.catalog import Scene


def load(options: Namespace) -> tuple[Network, Scene | None]:
    """The network of a scene or a model file with the values that were set, and the scene if it is one.

    Raises:
        ModelFileError: it is neither.
        ParameterError: a value cannot be set.
    """
    from shaftwork.pipeline.network import Network
    from shaftwork.scenes import SCENES

    name = options.model
    scene = SCENES.get(name)
    if scene is None and not name.endswith(".toml"):
        raise ModelFileError(f"'{name}' is neither a scene nor a .toml file. The scenes are: {', '.join(SCENES)}.")
    return with_settings(Network.load(name) if scene is None else scene(), options.set), scene


def end_of(options: Namespace, scene: Scene | None) -> float:
    """The end of the motion in s: as given, of the scene, or `FALLBACK_END`.

    Raises:
        ParameterError: no motion can end then.
    """
    from shaftwork.pipeline.arguments import time_span

    end = options.t_end if options.t_end is not None else scene.t_end if scene else FALLBACK_END
    return time_span(0.0, end)[1]


def start_of(options: Namespace, model: Model) -> dict[str, float] | None:
    """The start values of a motion: of the steady state at t = 0 where that is wanted, with those given; None for rest.

    Raises:
        ParameterError: a start value is none.
        SimulationError: there is no steady state.
    """
    from shaftwork.pipeline.model import steady_start

    given = point(options.initial, option="--initial")
    return steady_start(model, given) if options.steady else given or None


def point_of(options: Namespace, net: Network) -> dict[str, float] | None:
    """The point about which a network is linearised: as named, the steady operation, or None for rest.

    Raises:
        ParameterError: both are asked for.
        SimulationError: there is no steady operation.
    """
    if options.steady and options.at:
        raise ParameterError("--steady and --at both name a point. Leave out one of them.")
    if options.steady:
        model = net.compile()
        return model.steady_state() if options.t is None else model.steady_state(t=options.t)
    return point(options.at) or None
