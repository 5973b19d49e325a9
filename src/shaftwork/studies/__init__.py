"""Studies: variants of a network, and which model and engine reach an asked accuracy at the least cost."""

from __future__ import annotations

from shaftwork.sensitivities.sensitivities import frequency_sensitivities, motion_sensitivities
from shaftwork.studies.stability import Cell, Stability, stability
from shaftwork.studies.stability_cases import Case
from shaftwork.studies.work_precision import work_precision
from shaftwork.studies.work_precision_result import Trial, WorkPrecision
from shaftwork.sweep.sweep import sweep
from shaftwork.sweep.sweep_result import Sweep

__all__ = [
    "Case",
    "Cell",
    "Stability",
    "Sweep",
    "Trial",
    "WorkPrecision",
    "frequency_sensitivities",
    "motion_sensitivities",
    "stability",
    "sweep",
    "work_precision",
]
