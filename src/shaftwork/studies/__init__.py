"""Studies: which model and which engine reach an asked accuracy at the least cost."""

from __future__ import annotations

from shaftwork.studies.stability import Cell, Stability, stability
from shaftwork.studies.stability_cases import Case
from shaftwork.studies.work_precision import Trial, WorkPrecision, work_precision

__all__ = ["Case", "Cell", "Stability", "Trial", "WorkPrecision", "stability", "work_precision"]
