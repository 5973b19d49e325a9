"""Sizing: what a motion asks of its motor, and which motor of a catalogue gives it."""

from __future__ import annotations

from shaftwork.sizing.catalogue import CatalogueMotor, catalogue
from shaftwork.sizing.duty import Duty, Flow, duty
from shaftwork.sizing.motor_choice import Candidate, Choice, choose
from shaftwork.sizing.reserve import Reserve

__all__ = ["Candidate", "CatalogueMotor", "Choice", "Duty", "Flow", "Reserve", "catalogue", "choose", "duty"]
