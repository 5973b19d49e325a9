"""Derivatives by parameters, as tables that rank them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from shaftwork.core.errors import imported
from shaftwork.core.screen import in_columns
from shaftwork.results.observer import Array, Complex

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class FrequencySensitivities:
    """Derivatives of natural frequencies by parameters.

    Args:
        name: of the network.
        parameters: values in SI by name.
        rates: (k,) eigenvalues of the modes that swing, 1/s, by ascending frequency.
        slopes: (k, parameters) their derivatives by the parameters.
    """

    name: str
    parameters: Mapping[str, float]
    rates: Complex
    slopes: Complex

    @property
    def frequencies(self) -> Array:
        """(k,) natural frequencies |rate| / 2 pi, Hz."""
        from shaftwork.frequency.natural_modes import natural_frequencies

        return natural_frequencies(self.rates)

    @property
    def damping(self) -> Array:
        """(k,) damping ratios -Re(rate) / |rate|."""
        from shaftwork.frequency.natural_modes import damping_ratios

        return damping_ratios(self.rates)

    @property
    def of_frequencies(self) -> dict[str, Array]:
        """(k,) derivatives of the natural frequencies by each parameter, Hz per its unit."""
        change = (self.rates.conj()[:, None] * self.slopes).real / np.abs(self.rates)[:, None]
        return dict(zip(self.parameters, (change / (2 * np.pi)).T, strict=True))

    @property
    def of_damping(self) -> dict[str, Array]:
        """(k,) derivatives of the damping ratios by each parameter."""
        size = np.abs(self.rates)[:, None]
        grows = (self.rates.conj()[:, None] * self.slopes).real / size
        change = -self.slopes.real / size + self.rates.real[:, None] * grows / size**2
        return dict(zip(self.parameters, change.T, strict=True))

    @property
    def relative(self) -> dict[str, Array]:
        """(k,) percent by which each frequency rises where the parameter rises by one percent."""
        by = self.of_frequencies
        return {name: by[name] * value / self.frequencies for name, value in self.parameters.items()}

    def table(self) -> pd.DataFrame:
        """`relative` as a data frame, a column for each mode (extra `data`)."""
        return _frame(
            self.relative, [f"mode {k + 1}" for k in range(len(self.rates))], "FrequencySensitivities.table()"
        )

    def __str__(self) -> str:
        if not self.rates.size:
            return (
                f"{self.name}: no mode swings here, each is damped critically or more, or has no stiffness: there is "
                "no frequency to change. Network.modes() shows them all."
            )
        header = [f"{frequency:.6g} Hz" for frequency in self.frequencies]
        return _text(f"{self.name}: percent of a frequency for a percent of a parameter", header, self.relative)


@dataclass(frozen=True, eq=False)
class MotionSensitivities:
    """Derivatives of measures of a motion by parameters.

    Args:
        name: of the network.
        parameters: values in SI by name.
        measures: values by name.
        slopes: (parameters,) derivatives by measure.
    """

    name: str
    parameters: Mapping[str, float]
    measures: Mapping[str, float]
    slopes: Mapping[str, Array]

    def __getitem__(self, measure: str) -> dict[str, float]:
        """The derivatives of a measure by each parameter."""
        return dict(zip(self.parameters, self.slopes[measure].tolist(), strict=True))

    @property
    def relative(self) -> dict[str, Array]:
        """(measures,) percent by which each measure rises where the parameter rises by one percent."""
        values = np.array(list(self.measures.values()))
        by = np.array(list(self.slopes.values())).T
        return {
            name: row * value / np.where(values == 0.0, np.nan, values)
            for (name, value), row in zip(self.parameters.items(), by, strict=True)
        }

    def table(self) -> pd.DataFrame:
        """`relative` as a data frame, a column for each measure (extra `data`)."""
        return _frame(self.relative, list(self.measures), "MotionSensitivities.table()")

    def __str__(self) -> str:
        header = [f"{name} = {value:z.6g}" for name, value in self.measures.items()]
        return _text(f"{self.name}: percent of a measure for a percent of a parameter", header, self.relative)


def _frame(columns: Mapping[str, Array], names: Sequence[str], purpose: str) -> pd.DataFrame:
    frames: pd.DataFrame = imported("pandas", "data", purpose).DataFrame
    return frames.from_dict(dict(columns), orient="index", columns=names)


def _text(title: str, header: Sequence[str], rows: Mapping[str, Array]) -> str:
    """A table whose strongest row comes first."""
    order = sorted(rows, key=lambda name: -float(np.nan_to_num(np.abs(rows[name])).max(initial=0.0)))
    cells = [[name, *(f"{value:z9.4f}" for value in rows[name].tolist())] for name in order]
    return "\n".join([title, *in_columns([["", *header], *cells], range(1, len(header) + 1))])
