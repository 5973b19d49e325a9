"""The model of a network with travelling waves whose parts change their mode."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property

from shaftwork.hybrid.equation_sets import EquationSets
from shaftwork.hybrid.hybrid_model import HybridModel
from shaftwork.hybrid.modes.mode_equations import ModeEquations
from shaftwork.hybrid.modes.mode_machines import ModeNames
from shaftwork.integrate.problem import Problem
from shaftwork.waves.hybrid_waves import WaveModeEquations
from shaftwork.waves.wave_model import WaveModel
from shaftwork.waves.wave_motion import engine_of_waves


class WaveEquationSets(EquationSets):
    """All sets of equations of a network with waves whose parts change their mode."""

    kind, model_kind = WaveModeEquations, WaveModel

    def engine(
        self,
        equations: ModeEquations,  # noqa: ARG002 (waves have one engine)
        modes: ModeNames,  # noqa: ARG002
        problem: Callable[[], Problem],  # noqa: ARG002
        engine: str,
    ) -> tuple[str, str]:
        """The engine for a phase, and why; see `EquationSets.engine`."""
        return engine_of_waves(engine)


class HybridWaveModel(WaveModel, HybridModel):
    """A network with travelling waves and parts that change their mode, ready to be simulated again and again."""

    @cached_property
    def equation_sets(self) -> EquationSets:
        """The equations of every combination of modes that a motion has come to."""
        return WaveEquationSets(self, self._rebuild)
