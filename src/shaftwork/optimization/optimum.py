"""What an optimisation has found: the best design, all descents, and which limits bind."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter

import numpy as np

from shaftwork.core.errors import SimulationError
from shaftwork.core.notebook import html_table
from shaftwork.core.screen import counted, in_columns
from shaftwork.numerics.tolerances import EQUAL
from shaftwork.pipeline.network import Network, with_values
from shaftwork.sweep.sweep_result import Limits


@dataclass(frozen=True, eq=False)
class Attempt:
    """One descent.

    Args:
        choice: the number taken of each catalogue.
        values: of variables and of what was chosen, in SI.
        goals: by name.
        message: why it ended; of one without a finite value of every goal which has none.
        success: whether it ended where the goal is least nearby.
        motions: computed for it.
        sizes: of the limited goals, by which it is judged how far a limit is missed.
        at_ends: the variables that ended at an end of their range.
    """

    choice: Mapping[str, int]
    values: Mapping[str, float]
    goals: Mapping[str, float]
    message: str
    success: bool
    motions: int
    sizes: Mapping[str, float]
    at_ends: tuple[str, ...] = ()

    @property
    def complete(self) -> bool:
        """Whether every goal has a finite value."""
        return all(map(np.isfinite, self.goals.values()))


@dataclass(frozen=True, eq=False)
class Optimum:
    """The best design that was found.

    Args:
        network: before.
        goal: what was made least or largest.
        maximize: whether largest.
        require: limits by goal.
        attempts: all descents.
        units: of parameters and goals by name, SI; not of functions, whose units are not known.
    """

    network: Network
    goal: str
    maximize: bool
    require: Mapping[str, Limits]
    attempts: tuple[Attempt, ...]
    units: Mapping[str, str]

    def meets(self, attempt: Attempt) -> bool:
        """Whether a design is within all limits, to a millionth of their size."""
        return attempt.complete and not missed(self.require, attempt.goals, attempt.sizes)

    @cached_property
    def best(self) -> Attempt:
        """The best of those that meet all limits.

        Raises:
            SimulationError: none does.
        """
        good = [attempt for attempt in self.attempts if self.meets(attempt)]
        if not good:
            raise SimulationError(self._failure)
        return (max if self.maximize else min)(good, key=lambda attempt: attempt.goals[self.goal])

    @property
    def _failure(self) -> str:
        """Why there is no best design."""
        count, complete = counted(len(self.attempts), "descent"), [a for a in self.attempts if a.complete]
        undefined = [f"{a.message} at {in_words(a.values)}" for a in self.attempts if not a.complete][:1]
        if not complete:
            return (
                f"None of {count} has a design with all goals: {undefined[0]}. Give functions that are numbers in the "
                "whole ranges, narrower ranges, or more starts."
            )
        nearest = min(complete, key=lambda a: max(missed(self.require, a.goals, a.sizes).values()))
        misses = "; ".join(
            f"{name} must be {self._limits(name)} and is {nearest.goals[name]:.6g}"
            for name in missed(self.require, nearest.goals, nearest.sizes)
        )
        said = "; ".join([f"the nearest has {in_words(nearest.values)}, where {misses}", *undefined])
        return f"None of {count} meets all limits: {said}. Widen a range or a limit, or take more starts."

    @property
    def values(self) -> dict[str, float]:
        """Variables and chosen parameters of the best design, in SI."""
        return dict(self.best.values)

    @property
    def designed(self) -> Network:
        """The network of the best design."""
        return with_values(self.network, self.values)

    def _rows(self) -> tuple[str, list[str], list[list[str]]]:
        best, verb = self.best, "largest" if self.maximize else "least"
        title = (
            f"{self.network.name}: {self.goal} {verb} at {best.goals[self.goal]:.6g}, by "
            f"{counted(len(self.attempts), 'descent')} and {sum(a.motions for a in self.attempts)} motions"
        )
        ends = dict.fromkeys(best.at_ends, "an end of its range")
        numbers = [(name, value, ends.get(name, "")) for name, value in best.values.items()]
        numbers += [(name, value, self._said(name)) for name, value in best.goals.items()]
        rows = [[name, f"{value:.6g}", self.units.get(name, ""), said] for name, value, said in numbers]
        rows += [[name, f"number {number}", "", "chosen"] for name, number in best.choice.items()]
        rows += [] if best.success else [["no minimum yet", "", "", best.message]]
        return title, ["", "best", "unit", ""], rows

    def _said(self, name: str) -> str:
        return self._limits(name) if name in self.require else "goal"

    def _limits(self, name: str) -> str:
        low, high = self.require[name]
        sides = [f"at {word} {end:g}" for word, end in (("least", low), ("most", high)) if end is not None]
        return " and ".join(sides)

    def __str__(self) -> str:
        title, header, rows = self._rows()
        return "\n".join([title, *in_columns([header, *rows], (1,))])

    def _repr_html_(self) -> str:
        return html_table(*self._rows())


def sizes_of(require: Mapping[str, Limits], first: Mapping[str, float]) -> dict[str, float]:
    """The size of each limited goal: of its limits, or where these are zero of its value at the start."""
    ends = {name: [abs(end) for end in limits if end is not None] for name, limits in require.items()}
    return {name: max(sizes, default=0.0) or abs(first[name]) or 1.0 for name, sizes in ends.items()}


def missed(require: Mapping[str, Limits], goals: Mapping[str, float], sizes: Mapping[str, float]) -> dict[str, float]:
    """By how much a limit is missed, in its size, by goal; the worst first, and none that is met to a millionth."""
    misses = dict[str, float]()
    for name, (low, high) in require.items():
        beyond = max(0.0 if low is None else low - goals[name], 0.0 if high is None else goals[name] - high)
        if beyond > EQUAL * sizes[name]:
            misses[name] = beyond / sizes[name]
    return dict(sorted(misses.items(), key=itemgetter(1), reverse=True))


def in_words(values: Mapping[str, float]) -> str:
    """Values by name, "J.J = 2, shaft.c = 1e+04"."""
    return ", ".join(f"{name} = {value:.9g}" for name, value in values.items())
