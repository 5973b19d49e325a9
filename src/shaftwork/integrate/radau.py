"""scipy's Radau: an implicit method of order 5 for stiff systems."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.integrate import Radau

from shaftwork.integrate.inner import StepPolynomial
from shaftwork.integrate.problem import Array


class RadauSteps:
    """Steps from a time to another one; `t` and `y` are where it is.

    Args:
        rhs: right-hand side.
        jacobian: its slopes by the states, in full or of scipy.sparse; None for differences.
        t: start, s.
        y: (n,) state there.
        end: s.
        rtol: relative tolerance.
        atol: (n,) absolute tolerances.
        longest: no step is longer, s.

    Source: Hairer, Wanner, Solving Ordinary Differential Equations II.
    """

    def __init__(
        self,
        rhs: Callable[[float, Array], Array],
        jacobian: Callable[[float, Array], Any] | None,
        t: float,
        y: Array,
        end: float,
        rtol: float,
        atol: Array,
        longest: float,
    ) -> None:
        self._solver = Radau(rhs, t, y, end, rtol=rtol, atol=atol, jac=jacobian, max_step=longest)

    @property
    def t(self) -> float:
        """Where it is, s."""
        return float(self._solver.t)

    @property
    def y(self) -> Array:
        """(n,) the state there."""
        return np.asarray(self._solver.y)

    @property
    def nfev(self) -> int:
        """Evaluations of the right-hand side."""
        return int(self._solver.nfev)

    @property
    def njev(self) -> int:
        """Evaluations of the Jacobian."""
        return int(self._solver.njev)

    @property
    def finished(self) -> bool:
        """Whether it has come to the end."""
        return bool(self._solver.status == "finished")

    def step(self) -> str:
        """Take one step; says why where there is none."""
        if np.isnan(self._solver.h_abs):  # scipy would look for a first step without end
            return "no first step was found"
        reason = self._solver.step()
        return str(reason or "the step failed") if self._solver.status == "failed" else ""

    def inside(self) -> StepPolynomial:
        """The states inside the last step."""
        found = self._solver.dense_output()
        return StepPolynomial(found.t_old, found.h, found.y_old, found.Q.T, alternates=False)
