"""The systems of the sources, ready to run: `crane_start()`, `shaft_chain(m=40)`; `SCENES` lists them all."""

from __future__ import annotations

from shaftwork.scenes.catalog import Scene
from shaftwork.scenes.crane import (
    CRANE,
    CRANE_START,
    CRANE_TRAIN,
    SIX_PHASES,
    crane,
    crane_start,
    crane_train,
    six_phases,
)
from shaftwork.scenes.excavator import EXCAVATOR, EXCAVATOR_TRAIN, excavator, excavator_train
from shaftwork.scenes.long_shafts import (
    BLDC_SHAFT,
    SHAFT_CHAIN,
    SHAFT_STEP,
    SHIP_LINE,
    bldc_shaft,
    shaft_chain,
    shaft_step,
    ship_line,
)
from shaftwork.scenes.ship_engine import SHIP_ENGINE, ship_engine

SCENES: dict[str, Scene] = {
    scene.name: scene
    for scene in (
        CRANE_START,
        CRANE,
        SIX_PHASES,
        EXCAVATOR,
        CRANE_TRAIN,
        EXCAVATOR_TRAIN,
        BLDC_SHAFT,
        SHAFT_CHAIN,
        SHAFT_STEP,
        SHIP_LINE,
        SHIP_ENGINE,
    )
}
"""Every scene by its name, in the order in which they are listed: the simplest crane first."""

__all__ = [
    "SCENES",
    "Scene",
    "bldc_shaft",
    "crane",
    "crane_start",
    "crane_train",
    "excavator",
    "excavator_train",
    "shaft_chain",
    "shaft_step",
    "ship_engine",
    "ship_line",
    "six_phases",
]
