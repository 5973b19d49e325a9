"""From the real machine to the small model: a train referred to one shaft, and one of few masses."""

from __future__ import annotations

from shaftwork.reduce.comparison import Comparison
from shaftwork.reduce.grouping import Grouping
from shaftwork.reduce.groups import Group, GroupTable
from shaftwork.reduce.losses import FrequencyLoss, FrequencyTable
from shaftwork.reduce.reference_shaft import Referred, refer
from shaftwork.reduce.referred_parts import Entry
from shaftwork.reduce.scales import Scale
from shaftwork.reduce.simplification import Simplified, simplify
from shaftwork.reduce.table import ReductionTable

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
