"""The systems of the sources, ready to run: `crane_start()`, `shaft_chain(m=40)`; `SCENES` lists them all."""

from __future__ import annotations

from shaftwork.scenes.bldc_shaft import BLDC_SHAFT, bldc_shaft
from shaftwork.scenes.catalog import Scene
from shaftwork.scenes.crane import CRANE, CRANE_START, SIX_PHASES, crane, crane_start, six_phases
from shaftwork.scenes.crane_train import CRANE_TRAIN, crane_train
from shaftwork.scenes.excavator import EXCAVATOR, excavator
from shaftwork.scenes.excavator_train import EXCAVATOR_TRAIN, excavator_train
from shaftwork.scenes.shaft_chain import SHAFT_CHAIN, shaft_chain
from shaftwork.scenes.shaft_step import SHAFT_STEP, shaft_step
from shaftwork.scenes.ship_line import SHIP_LINE, ship_line

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
    "ship_line",
    "six_phases",
]
