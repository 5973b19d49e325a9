"""What a report is about, and what the user says to it; and what a section of it has."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

from shaftwork.equations.records import Equations
from shaftwork.latex.blocks import Block, Blocks
from shaftwork.latex.document import printed_blocks
from shaftwork.pipeline.arguments import Point
from shaftwork.pipeline.network import Network
from shaftwork.reporting.latex_parts import PAGE
from shaftwork.results.fatigue import SNLine
from shaftwork.results.solution import Solution

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from shaftwork.drawing.canvas import Drawing

    Picture = Figure | Drawing | Path
    """What a report can show: a figure, a drawing, or a picture of the user's in a file."""


@dataclass(frozen=True, eq=False)
class ReportSection:
    """What a section says and shows.

    Args:
        text: in LaTeX; empty where it has nothing to say.
        figures: pictures by the name under which the text includes them.
        curves: of those that show the motion, the quantities.
        notes: what could not be computed, in words.
    """

    text: str = ""
    figures: Mapping[str, Picture] = field(default_factory=dict)
    curves: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class Subject:
    """What a report is about.

    Args:
        network: the drive train.
        solution: its motion; None for a report without one.
        source: where the system comes from, in words.
        signals: quantities that are drawn and listed.
        phases: combinations of modes whose equations are printed; by default those that last longest.
        at: the point about which frequencies are computed.
        speeds: (k,) rad/s, of a Campbell diagram; empty for none.
        orders: excitations per turn.
        sn: the S-N line of what is twisted, or one for each quantity.
        origins: where values come from, by part or "part.parameter".
        assumptions: what was chosen and why, a sentence each.
        references: literature, a line each.
        comparison: of models of a shaft, as `studies.work_precision` makes it.
        torsional: a torsional vibration calculation.
    """

    network: Network
    solution: Solution | None
    source: str
    signals: tuple[str, ...]
    phases: tuple[str, ...]
    at: Point
    speeds: Sequence[float]
    orders: Sequence[float]
    sn: SNLine | Mapping[str, SNLine] | None
    origins: Mapping[str, str]
    assumptions: tuple[str, ...]
    references: tuple[str, ...]
    comparison: Any
    torsional: Any

    @cached_property
    def equations(self) -> tuple[Equations, ...]:
        """Of the phases that are printed, in their order; of a network without phases its only ones."""
        return tuple(self.network.equations(phase=phase or None) for phase in self.printed_phases)

    @cached_property
    def printed(self) -> tuple[tuple[Blocks, tuple[Block, ...]], ...]:
        """What is printed of them, with what knows the letters in it."""
        of_phases = [Blocks(equations, values=False) for equations in self.equations]
        return tuple((blocks, printed_blocks(blocks, None)) for blocks in of_phases)

    @cached_property
    def printed_phases(self) -> tuple[str, ...]:
        """The combinations of modes whose equations are printed; ("",) where no part changes its mode."""
        if self.phases:
            return self.phases
        if self.solution is None or not self.solution.phases:
            return (self.network.start_phase(),)
        longest = sorted(self.durations, key=self.durations.__getitem__, reverse=True)[: PAGE.printed_phases]
        return tuple(name for name in self.durations if name in longest)

    @cached_property
    def durations(self) -> Mapping[str, float]:
        """How long the motion is in each combination of modes, s, in the order in which they first occur."""
        total: dict[str, float] = {}
        for row in self.solution.phases if self.solution else ():
            total[row.name] = total.get(row.name, 0.0) + row.end - row.start
        return total
