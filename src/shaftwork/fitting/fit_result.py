"""What a fit has found: values with their intervals, what the record cannot tell, residuals."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.core.notebook import html_table
from shaftwork.core.screen import counted, in_columns
from shaftwork.fitting.curves import Scaling
from shaftwork.fitting.estimation import Estimate
from shaftwork.fitting.spreads import LOSSES, Data
from shaftwork.numerics.tolerances import EQUAL
from shaftwork.pipeline.arguments import inner_share
from shaftwork.pipeline.network import Network, with_values
from shaftwork.results.plotting import new_figure, plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure


AT_START = "at t = 0"
"""In place of the unit of an unknown start value."""


@dataclass(frozen=True, eq=False)
class Fit:
    """Parameters of a network that fit a record.

    Args:
        network: that was fitted.
        units: of the unknowns by name; `AT_START` of start values.
        scaling: of the unknowns, with the values that the fit began with.
        samples: by quantity, times (k,) in s or frequencies in Hz.
        data: what was measured.
        estimate: what was found, in scaled unknowns.
        domain: "t" or "f".
        initial: start values of states; of several records those of the first.
        by_differences: whether some derivatives had to be had by differences.
        others: where further starts ended that were followed to the end, best first.
        tried: how many starts there were.
    """

    network: Network
    units: Mapping[str, str]
    scaling: Scaling
    samples: Mapping[str, Array]
    data: Data
    estimate: Estimate
    domain: str
    initial: Mapping[str, float]
    by_differences: bool
    others: tuple[Estimate, ...] = ()
    tried: int = 1

    @cached_property
    def values(self) -> dict[str, float]:
        """All that was fitted, in SI."""
        return dict(zip(self.scaling.names, self.scaling.values(self.estimate.unknowns).tolist(), strict=True))

    @property
    def parameters(self) -> dict[str, float]:
        """The fitted parameters, for `Model.simulate(parameters=...)`."""
        return {name: value for name, value in self.values.items() if self.units[name] != AT_START}

    @property
    def starts(self) -> dict[str, float]:
        """The start values, fitted ones among them, for `Model.simulate(initial=...)`."""
        return {**self.initial, **{name: value for name, value in self.values.items() if self.units[name] == AT_START}}

    @property
    def fitted(self) -> Network:
        """The network with the fitted parameters; start values are no part of it."""
        return with_values(self.network, self.parameters)

    @property
    def noise(self) -> dict[str, float]:
        """Standard deviations of the noise by quantity, in SI."""
        return dict(zip(self.samples, self.estimate.deviations.tolist(), strict=True))

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations of the parameters in SI; infinite where the record tells nothing."""
        at = self.estimate.unknowns
        sizes = self.estimate.sizes * self.scaling.slopes(at) * self.scaling.stretch(at)
        return dict(zip(self.scaling.names, sizes.tolist(), strict=True))

    def intervals(self, level: float = 0.95) -> dict[str, tuple[float, float]]:
        """Confidence intervals by parameter, in SI.

        Law: t-quantiles of the scaled unknowns, of a normal distribution where `sigma` was given. So the interval of a
        parameter that stays above zero does as well. That of a damping, a gap or another one that may be zero is even
        on both sides. Where a parameter ended at a bound, the interval is what there were without it. All are cut at
        their bounds, and hold what was fitted, whatever derivatives tell of a better place.

        Args:
            level: the share of records whose interval holds the true value.

        Raises:
            ParameterError: it does not lie between 0 and 1.
        """
        found = self.estimate
        reach = found.reach(inner_share("level", level))
        middle = np.where(self.scaling.to_zero | found.at_bounds, found.step, 0.0)
        low, high = (self.scaling.ends(found.unknowns, middle + sign * reach, found.bounds) for sign in (-1.0, 1.0))
        fitted = self.scaling.values(found.unknowns)
        pairs = zip(np.minimum(low, fitted).tolist(), np.maximum(high, fitted).tolist(), strict=True)
        return dict(zip(self.scaling.names, pairs, strict=True))

    @property
    def correlations(self) -> Array:
        """(m, m) of the fitted parameters: near one or minus one where the record tells them apart hardly.

        Of those that it does not tell at all they are those of what it does not tell.
        """
        found = self.estimate
        unseen = found.directions[np.isinf(found.spreads)]
        hidden = np.isinf(np.diag(found.covariance))
        covariance = np.where(hidden[:, None] & hidden, unseen.T @ unseen, found.covariance)
        sizes = np.sqrt(np.diag(covariance))
        return np.where(hidden[:, None] != hidden, 0.0, covariance / np.outer(sizes, sizes))

    @property
    def unseen(self) -> tuple[tuple[float, dict[str, float]], ...]:
        """Combinations that the record cannot tell: how far each is known, as a part of its size, and its shares.

        A combination is a relative change of several parameters at once. One counts as unseen where its standard
        deviation is more than its size.
        """
        pairs = zip(self.estimate.spreads.tolist(), self.estimate.directions, strict=True)
        return tuple(
            (
                spread,
                {name: share for name, share in zip(self.scaling.names, row.tolist(), strict=True) if abs(share) > 0.1},
            )
            for spread, row in pairs
            if spread > 1.0
        )

    @property
    def caveat(self) -> str:
        """Why the intervals do not hold; empty where what is left may be noise.

        Law: the correlation of neighbouring residuals is above three standard deviations of that of white noise, and
        what is left is above a millionth of the largest value, which may be errors of computation. From a correlation
        of 0.5 on the model is to blame. Where `sigma` is given, its mean square is five standard deviations above it.
        """
        measured, correlation, parts = self.measured, self.correlation, list[str]()
        left = {name: self._left(number) for number, name in enumerate(self.samples)}
        alike = {
            name: correlation[name]
            for name, values in measured.items()
            if correlation[name] > 3 / len(values) ** 0.5
            and self.noise[name] * left[name] > EQUAL * np.abs(values).max()
        }
        if apart := [name for name, share in alike.items() if share > 0.5]:
            parts.append(
                f"The model does not follow the record of {', '.join(apart)}: neighbouring residuals are alike, so "
                "what is left is no noise, and the intervals do not hold. Take other starts, starts=8, or add what the "
                "model lacks."
            )
        elif alike:
            wider = max(((1 + share) / (1 - share)) ** 0.5 for share in alike.values())
            parts.append(
                f"Neighbouring residuals of {', '.join(alike)} are alike: true intervals are some {wider:.2g} times as "
                "wide. Take samples farther apart, or add what the model lacks."
            )
        parts += [
            f"What is left of {name} is {left[name]:.2g} times the sigma that was given, so the intervals are too "
            "narrow. Leave sigma out, or add what the model lacks."
            for name, values in measured.items()
            if self.data.deviations is not None and left[name] ** 2 > 1 + 5 * (2 / len(values)) ** 0.5
        ]
        begun = min(float(at[0]) for at in self.samples.values())
        if parts and self.domain == "t" and 2 * begun > max(float(at[-1]) for at in self.samples.values()):
            parts.append(f"Times count from the start of the motion, and the record begins at {begun:.6g} s.")
        return " ".join(parts)

    def _left(self, number: int) -> float:
        """How large what is left of a series is, in deviations of its noise; outliers of a robust loss count little."""
        away = self.estimate.residuals[self.data.series == number] / self.estimate.deviations[number]
        _, weight, _ = LOSSES[self.data.loss](away**2)
        return float((weight * away**2).mean() ** 0.5)

    @cached_property
    def residuals(self) -> dict[str, Array]:
        """(k,) by quantity, computed less measured; of a response complex."""
        return self._by_quantity(self.estimate.residuals)

    @property
    def measured(self) -> dict[str, Array]:
        """(k,) by quantity, as recorded."""
        return self._by_quantity(self.data.measured)

    def _by_quantity(self, values: Array) -> dict[str, Array]:
        parts = {name: values[self.data.series == number] for number, name in enumerate(self.samples)}
        if self.domain == "t":
            return parts
        return {name: part[: len(part) // 2] + 1j * part[len(part) // 2 :] for name, part in parts.items()}

    @property
    def correlation(self) -> dict[str, float]:
        """Of neighbouring residuals by quantity: within 2 / sqrt(k) of zero where what is left is white noise."""
        correlations = {}
        for name, values in self.residuals.items():
            power = float((np.abs(values) ** 2).sum())
            correlations[name] = float((values[1:] * values[:-1].conj()).sum().real) / power if power else 0.0
        return correlations

    def plot(self) -> Figure:
        """What was measured and computed, and below it the residuals (extra `plot`).

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        count = len(self.samples)
        figure = new_figure("Fit.plot()", 9.0, 1.2 + 3.4 * count, str(self).partition("\n")[0])
        rows = figure.subplots(2 * count, 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": [2, 1] * count})
        for number, (name, at) in enumerate(self.samples.items()):
            curve, rest = rows[2 * number, 0], rows[2 * number + 1, 0]
            measured, residuals = self.measured[name], self.residuals[name]
            shown = np.abs if self.domain == "f" else np.asarray
            curve.plot(at, shown(measured), ".", color="0.6", markersize=3, label="measured")
            curve.plot(at, shown(measured + residuals), color="tab:blue", linewidth=1, label="fitted")
            curve.set_ylabel(plain(name))
            curve.legend(loc="best", fontsize=8)
            rest.plot(at, shown(residuals), ".", color="tab:red", markersize=2)
            rest.axhline(0.0, color="0.3", linewidth=0.6)
            rest.set_ylabel("residual")
        rows[-1, 0].set_xlabel("t in s" if self.domain == "t" else "f in Hz")
        return figure

    def _rows(self) -> tuple[str, list[str], list[list[str]], list[str]]:
        """Title, headings, rows and notes."""
        names, level = ", ".join(self.samples), 0.95
        unknowns, size = counted(len(self.values), "unknown"), self.data.measured.size
        title = f"{self.network.name}: {unknowns} from {size} values of {names}"
        rows = [
            [name, f"{value:.6g}", f"{low:.6g}", f"{high:.6g}", f"{self.scaling.start[name]:.6g}", self.units[name]]
            for (name, value), (low, high) in zip(self.values.items(), self.intervals(level).values(), strict=True)
        ]
        notes = [
            f"{name}: noise {noise:.3g}, correlation of neighbours {self.correlation[name]:z.2f}"
            for name, noise in self.noise.items()
        ]
        for spread, shares in self.unseen:
            words = ", ".join(f"{name} {share:+.2f}" for name, share in shares.items())
            extent = "not at all" if np.isinf(spread) else f"to {100 * spread:.0f} % only" if spread < 10 else "hardly"
            notes.append(f"The record tells this combination {extent}: {words}.")
        notes += [self._told_of_starts()] if self.tried > 1 else []
        notes += [self.caveat] if self.caveat else []
        if self.estimate.message:
            notes.append(f"This is no minimum yet: {self.estimate.message}.")
        if not self.estimate.freedom[np.isfinite(np.diag(self.estimate.covariance))].all():
            notes.append("There are as many unknowns as values to tell the noise by. Give more of them, or sigma.")
        if self.by_differences:
            notes.append("Derivatives by differences.")
        gone = self.estimate.unknowns < self.scaling.floor
        ends = zip(gone.tolist(), self.intervals(level).items(), strict=True)
        if zeros := [name for small, (name, (low, _)) in ends if small and low == 0.0]:
            notes.append(f"As well zero as not, for all that the record tells: {', '.join(zeros)}.")
        ended = [name for name, ends in zip(self.scaling.names, self.estimate.at_bounds.tolist(), strict=True) if ends]
        if ended:
            notes.append(f"At a bound, by which its interval is cut: {', '.join(ended)}.")
        return title, ["", "fitted", "95 % from", "to", "start", "unit"], rows, notes

    def _told_of_starts(self) -> str:
        other = [end for end in self.others if not self.estimate.alike(end)]
        told = f"Of {self.tried} starts {1 + len(self.others)} were followed to the end, "
        told += f"{1 + len(self.others) - len(other)} to this minimum."
        if not other:
            return told
        values = zip(self.scaling.names, self.scaling.values(other[0].unknowns).tolist(), strict=True)
        words = ", ".join(f"{name} = {value:.6g}" for name, value in values)
        return f"{told} In the next one chi^2 is larger by {other[0].deviance - self.estimate.deviance:.3g}: {words}."

    def __str__(self) -> str:
        title, header, rows, notes = self._rows()
        return "\n".join([title, *in_columns([header, *rows], range(1, len(header) - 1)), *notes])

    def _repr_html_(self) -> str:
        title, header, rows, notes = self._rows()
        return html_table(title, header, rows, " ".join(notes))
