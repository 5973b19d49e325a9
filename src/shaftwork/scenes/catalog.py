"""What a ready scene is, and the reducer, gear by gear, that several of them have."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from shaftwork.components.mechanics import Gear, Inertia, LossyGear, Spring
from shaftwork.core.errors import ParameterError
from shaftwork.pipeline.network import Network

T = TypeVar("T")
LITERATURE = {
    "Marinkovic 2012": "Z. Marinković, D. Marinković, G. Petrović, P. Milić: Modelling and simulation of dynamic "
    "behaviour of electric motor driven mechanisms. Technical Gazette 19(4), 2012, 717-725",
    "Popenda 2019": "A. Popenda: Mathematical modelling of transmission shafts based on electrical and mechanical "
    "similarities. Przegląd Elektrotechniczny, 2019",
}
"""The papers of the scenes by the names under which they are cited."""


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


DAMPING = 2e-5  # s, chosen: damping over stiffness of steel shafts and teeth, 0.5 % of critical at 80 Hz


@dataclass(frozen=True)
class GearStage:
    """A gear pair, and the shaft behind it.

    Args:
        ratio: speed of the pinion over that of the gear, each counted in its own direction.
        pinion: moment of inertia, kg m^2.
        gear: moment of inertia, kg m^2.
        mesh: stiffness of the teeth at the gear, N m/rad.
        shaft: stiffness of the shaft to the next pinion, N m/rad; none behind the last gear.
    """

    ratio: float
    pinion: float
    gear: float
    mesh: float
    shaft: float | None = None


def add_reducer(net: Network, stages: tuple[GearStage, ...], mesh: str, efficiency: float = 1.0) -> str:
    """Add the gears "gear 1", "gear 2" and so on, the meshes between them and the shafts behind.

    Args:
        net: in which "gear 1" is the node of the first pinion.
        stages: from the motor on.
        mesh: "elastic", or "rigid" where teeth are taken for stiff.
        efficiency: of each stage; at 1 its gears are ideal.

    Returns:
        The node of the last gear.

    Raises:
        ParameterError: there is no such mesh.
    """
    elastic = choice("mesh", mesh, "reducer", {"elastic": True, "rigid": False})
    gear = f"gear {2 * len(stages)}"
    for k, stage in enumerate(stages, 1):
        pinion, gear = f"gear {2 * k - 1}", f"gear {2 * k}"
        teeth = f"mesh {k}" if elastic else gear
        net.add(Inertia(pinion, J=stage.pinion, symbol=f"g{2 * k - 1}"), pinion)
        pair: dict[str, Any] = {"name": f"stage {k}", "ratio": stage.ratio, "symbol": f"{k}"}
        net.add(LossyGear(**pair, efficiency=efficiency) if efficiency < 1 else Gear(**pair), pinion, teeth)
        if elastic:
            net.add(steel(teeth, stage.mesh, f"m{k}"), teeth, gear)
        net.add(Inertia(gear, J=stage.gear, symbol=f"g{2 * k}"), gear)
        if stage.shaft is not None:
            net.add(steel(f"shaft {k + 1}", stage.shaft, f"s{k + 1}"), gear, f"gear {2 * k + 1}")
    return gear


def steel(name: str, c: float, symbol: str) -> Spring:
    """A shaft or mesh with the damping of steel."""
    return Spring(name, c=c, d=DAMPING * c, symbol=symbol)
