"""From the real machine to the small model: a train referred to one shaft, and one of few masses."""

from __future__ import annotations

from shaftwork.reduce.grouping import Group, Grouping, GroupTable
from shaftwork.reduce.kinematics import Scale
from shaftwork.reduce.losses import Comparison, FrequencyLoss, FrequencyTable
from shaftwork.reduce.reference_shaft import ReductionTable, Referred, refer
from shaftwork.reduce.referred_parts import Entry
from shaftwork.reduce.simplification import Simplified, simplify

__all__ = [
    "Comparison",
    "Entry",
    "FrequencyLoss",
    "FrequencyTable",
    "Group",
    "GroupTable",
    "Grouping",
    "ReductionTable",
    "Referred",
    "Scale",
    "Simplified",
    "refer",
    "simplify",
]
