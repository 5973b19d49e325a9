"""The table of a motion: of each quantity its extremes, mean and end."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from shaftwork.results.solution import Solution


def summary(solution: Solution, names: Sequence[str]) -> str:
    """A line for each quantity: unit, minimum and maximum with their times, mean over time, value at the end.

    Args:
        solution: the motion.
        names: of quantities, at least one.
    """
    width = max(len(name) for name in names)
    head = f"{'':{width}}  {'unit':8} {'minimum':>12} {'at s':>8} {'maximum':>12} {'at s':>8} {'mean':>12} {'end':>12}"
    return "\n".join([head, *(_line(solution, name, width) for name in names)])


def _line(solution: Solution, name: str, width: int) -> str:
    values, t = solution[name] + 0.0, solution.t  # no -0 on the screen
    low, high = int(values.argmin()), int(values.argmax())
    mean = float(((values[1:] + values[:-1]) / 2) @ (t[1:] - t[:-1]) / (t[-1] - t[0]))
    return (
        f"{name:{width}}  {solution.observer.units[name]:8} {values[low]:12.5g} {t[low]:8.4g} "
        f"{values[high]:12.5g} {t[high]:8.4g} {mean:12.5g} {values[-1]:12.5g}"
    )
