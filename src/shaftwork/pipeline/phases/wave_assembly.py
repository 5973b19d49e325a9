"""The equations of a combination of modes beside travelling waves: what arrives follows the states.

Between two events what arrives at the ends of the lines is known. So a moment has it behind its states, with its rates:
x = (states, h, dh/dt), and everything that is read at an instant is read as without waves.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial

import numpy as np

from shaftwork.codegen.code import around
from shaftwork.codegen.elements import Array
from shaftwork.codegen.waves import WaveSystem
from shaftwork.pipeline.arguments import NOMINAL
from shaftwork.pipeline.phases.assemblies import Limits, ModeEquations, Motion, Near

RATE = "rate of "


class WaveAssembly(ModeEquations):
    """One set of equations with ends of waves, and its guards."""

    @property
    def clocks(self) -> tuple[int, ...]:
        """None: panels resolve what changes with time alone by themselves."""
        return ()

    @property
    def ends(self) -> tuple[str, ...]:
        """A name for what arrives at each end of a line, the same in all combinations of modes."""
        graph = self.model.form.graph
        owners = ((graph.part_of(k).name, graph.branches[k].template.label) for k in self.model.form.waves)
        return tuple(f"{name}.{label} arriving" for name, label in owners)

    def arriving(self, x: Array) -> dict[str, float]:
        """What arrives, behind the states of a moment, and its rates, by name."""
        names = (*self.ends, *(RATE + name for name in self.ends))
        return dict(zip(names, x[len(self.model.states) :].tolist(), strict=True))

    def taking(self, t: float, held: Mapping[str, float], p: Array) -> Array:
        """The states with which the equations take up what was stored, and what arrives; zero of what is not told."""
        names = (*self.ends, *(RATE + name for name in self.ends))
        return np.concatenate([super().taking(t, held, p), [held.get(name, 0.0) for name in names]])

    def sizes(self, p: Array) -> list[float]:
        """The nominal size of each state; of what arrives that of a wave with a nominal speed."""
        impedances, _ = WaveSystem(self.bound(p)).lines
        return [*super().sizes(p), *(2 * NOMINAL * np.repeat(impedances, 2)).tolist(), *np.zeros(2 * impedances.size)]

    def motion(self, p: Array) -> tuple[Motion, Limits, Near]:
        """Rates and guards together, guards alone, and guards `around` an instant."""
        bound, guards = self.bound(p), self.guards(p)
        count = len(self.ends)
        still = [0.0] * count

        def limits(t: float, x: list[float]) -> list[float]:
            return guards(np.array([t]), np.array([x]))[0].tolist()  # type: ignore[no-any-return]

        def motion(t: float, x: list[float]) -> tuple[list[float], list[float]]:
            return [*bound.rhs(t, np.array(x)).tolist(), *x[-count:], *still], limits(t, x)

        return motion, limits, partial(around, motion, limits)
