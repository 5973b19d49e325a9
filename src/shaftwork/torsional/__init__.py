"""Torsional vibration calculation: forced response by orders, stresses, permitted stresses, barred speed ranges."""

from __future__ import annotations

from shaftwork.torsional.barred_ranges import BarredRange
from shaftwork.torsional.calculation import torsional_calculation
from shaftwork.torsional.holzer import HolzerMass, HolzerMode, HolzerShaft, HolzerTable
from shaftwork.torsional.shaft_sections import DESIGNS, Section
from shaftwork.torsional.shaft_vibration import ShaftVibration
from shaftwork.torsional.torsional_result import TorsionalCalculation

__all__ = [
    "DESIGNS",
    "BarredRange",
    "HolzerMass",
    "HolzerMode",
    "HolzerShaft",
    "HolzerTable",
    "Section",
    "ShaftVibration",
    "TorsionalCalculation",
    "torsional_calculation",
]
