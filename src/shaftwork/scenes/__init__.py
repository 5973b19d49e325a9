"""The systems of the sources, ready to run: `crane_start()`, `shaft_chain(m=40)`; `SCENES` lists them all."""

from __future__ import annotations

from shaftwork.scenes.bldc_shaft import bldc_shaft
from shaftwork.scenes.catalog import SCENES, Scene
from shaftwork.scenes.crane import crane, crane_start, six_phases
from shaftwork.scenes.excavator import excavator
from shaftwork.scenes.shaft_chain import shaft_chain
from shaftwork.scenes.shaft_step import shaft_step
from shaftwork.scenes.ship_line import ship_line

__all__ = [
    "SCENES",
    "Scene",
    "bldc_shaft",
    "crane",
    "crane_start",
    "excavator",
    "shaft_chain",
    "shaft_step",
    "ship_line",
    "six_phases",
]
