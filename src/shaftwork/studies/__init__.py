"""Studies: variants of a network, and which model and engine reach an asked accuracy at the least cost.

Those that are features of their own are loaded when they are first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from shaftwork.studies.stability import Cell, Stability, stability
from shaftwork.studies.stability_cases import Case
from shaftwork.studies.work_precision import work_precision
from shaftwork.studies.work_precision_result import Trial, WorkPrecision

if TYPE_CHECKING:
    from shaftwork.sensitivities.parametric_motion import TrajectorySensitivities, trajectory_sensitivities
    from shaftwork.sensitivities.sensitivities import frequency_sensitivities, motion_sensitivities
    from shaftwork.sweep.sweep import sweep
    from shaftwork.sweep.sweep_result import Sweep
    from shaftwork.uncertainty.bands import Bands, bands
    from shaftwork.uncertainty.uncertainty import uncertainty
    from shaftwork.uncertainty.uncertainty_result import Probability, Uncertainty

__all__ = [
    "Bands",
    "Case",
    "Cell",
    "Probability",
    "Stability",
    "Sweep",
    "TrajectorySensitivities",
    "Trial",
    "Uncertainty",
    "WorkPrecision",
    "bands",
    "frequency_sensitivities",
    "motion_sensitivities",
    "stability",
    "sweep",
    "trajectory_sensitivities",
    "uncertainty",
    "work_precision",
]

_HOME = {
    "Bands": "shaftwork.uncertainty.bands",
    "Probability": "shaftwork.uncertainty.uncertainty_result",
    "Uncertainty": "shaftwork.uncertainty.uncertainty_result",
    "bands": "shaftwork.uncertainty.bands",
    "uncertainty": "shaftwork.uncertainty.uncertainty",
    "TrajectorySensitivities": "shaftwork.sensitivities.parametric_motion",
    "Sweep": "shaftwork.sweep.sweep_result",
    "frequency_sensitivities": "shaftwork.sensitivities.sensitivities",
    "motion_sensitivities": "shaftwork.sensitivities.sensitivities",
    "sweep": "shaftwork.sweep.sweep",
    "trajectory_sensitivities": "shaftwork.sensitivities.parametric_motion",
}


def __getattr__(name: str) -> Any:
    """Load a study that is a feature of its own."""
    if name not in _HOME:
        raise AttributeError(f"module 'shaftwork.studies' has no attribute '{name}'")
    value = globals()[name] = getattr(import_module(_HOME[name]), name)
    return value
