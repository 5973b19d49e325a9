"""The result of a simulation: quantities by part, energy balance, statistics, export."""

from __future__ import annotations

import reprlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, overload

import numpy as np

from shaftwork.core.errors import AccuracyWarning, SignalError
from shaftwork.core.notebook import html_table
from shaftwork.core.notices import warn
from shaftwork.core.screen import counted, named, on_one_screen
from shaftwork.integrate.problem import TOLERATED, UNSURPRISING
from shaftwork.numerics.tolerances import EQUAL
from shaftwork.results.data_frames import to_pandas, to_xarray
from shaftwork.results.energy import EnergyBalance, energy_balance
from shaftwork.results.extremes import Extreme, Extremes, warn_of_coarse_samples
from shaftwork.results.fatigue import Damage, Rainflow, SNLine, damage_of, damages, load_cycles
from shaftwork.results.observer import Array, DenseStates, Observer, PhaseRow, Reader, array_in_si, span_of
from shaftwork.results.plotting import plot_signals
from shaftwork.results.stored_motion import Repeatable, StoredMotion, read_only

if TYPE_CHECKING:
    import pandas as pd
    import xarray
    from matplotlib.figure import Figure

    from shaftwork.animation.animation import Animation
    from shaftwork.spectra.order_spectra import OrderSpectra
    from shaftwork.spectra.spectrum import Spectrum


@dataclass(frozen=True, eq=False)
class Solution(StoredMotion):
    """A motion.

    Args:
        name: title of the network.
        t: (k,) output times, s.
        x: (k, n) states at these times.
        states: n state names.
        engine: the engine that solved it.
        why: why this engine was taken.
        statistics: counts of the solver: steps, right-hand sides, ...
        dense: states (k, n) at any times (k,) within the run; knows the ends of the integration steps.
        observer: recovers quantities from states.
        events: (time, part, from, to) of every change of mode, times in s.
        phases: the spans of time between them.
        parameters: what the network was made of, "part.parameter" to value in SI, where it is not zero.
        initial: the start values that were given.
        rtol: relative tolerance of a step that was asked for.
        caveat: what makes the numbers worth less than the tolerance says, in a sentence; empty where nothing does.
        again: makes the motion again. One that is stored (pickled) has no compiled code: when more of it is read than
            is stored, the motion is made again.
        saved: quantities at the output times besides the states, of a motion from a file.
    """

    name: str
    t: Array
    x: Array
    states: tuple[str, ...]
    engine: str
    why: str
    statistics: Mapping[str, int]
    dense: DenseStates
    observer: Observer
    events: tuple[tuple[float, str, str, str], ...] = ()
    phases: tuple[PhaseRow, ...] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    initial: Mapping[str, float] = field(default_factory=dict)
    rtol: float = 1e-8
    caveat: str = ""
    again: Repeatable | None = None
    saved: Mapping[str, Array] = field(default_factory=dict)

    def __post_init__(self) -> None:
        vars(self)["t"] = np.array(self.t)  # the times may be those that the user gave
        self._protect()

    @cached_property
    def steps(self) -> Array:
        """(s,) ends of the integration steps."""
        return read_only(self.dense.steps)

    @property
    def names(self) -> tuple[str, ...]:
        """Every quantity that can be read."""
        return tuple(self.observer.units)

    def __getitem__(self, name: str) -> Array:
        """(k,) a quantity at the output times, such as "shaft.tau"; (k, places) one along a shaft, see `places`.

        Where it has no value at a time, as 0/0, it is what the quantity goes to on the side of the next step; an
        `AccuracyWarning` says where it goes to nothing finite.

        Raises:
            SignalError: there is no such quantity; the message lists what the part has.
        """
        if isinstance(name, str) and name in self.states:  # without the compiled code, which one that is stored has not
            return self.x[:, self.states.index(name)].copy()
        if isinstance(name, str) and name in self.saved:
            return self.saved[name].copy()
        return self.reader.values(name, self.t, self.x)

    @property
    def places(self) -> Mapping[str, Array]:
        """Every quantity that is read along a part, and the places in m from its first end."""
        return {name: np.array(places) for name, (_, places) in self.observer.profiles.items()}

    def __contains__(self, name: object) -> bool:
        return isinstance(name, str) and name in self.observer.units

    def __iter__(self) -> Iterator[str]:
        return iter(self.observer.units)

    def at(self, t: Sequence[float] | Array) -> Solution:
        """The same motion at other times, from the solver's dense output.

        Raises:
            SignalError: these are no times, or one lies outside the run.
            ParameterError: they have the unit of something else.
        """
        first, last = self.steps[0], self.steps[-1]
        times = array_in_si("t", t, "s")
        if not times.size:
            raise SignalError(
                f"{reprlib.repr(t)} is no list of times. Give times in s from {first:g} to {last:g}, such as "
                f"[{first:g}, {last:g}]."
            )
        if not (np.isfinite(times).all() and first <= times.min() and times.max() <= last):
            raise SignalError(
                f"The run goes from t = {first:g} s to {last:g} s; asked for {times.min()} to {times.max()}."
            )
        return replace(self, t=times, x=self.dense(times), saved={})

    @cached_property
    def reader(self) -> Reader:
        """Reads quantities at any times, many of them at the same times."""
        return Reader(self.name, self.states, self.observer, self.dense)

    @cached_property
    def extremes(self) -> Extremes:
        """Minimum and maximum of every quantity, by name, each searched when it is first asked for."""
        return Extremes(self.reader)

    def max(self, name: str) -> Extreme:
        """The largest value of a quantity, such as "shaft.tau", and its time; along a part that of the worst place.

        It is that of the motion, from the dense output, not of the output times.

        Raises:
            SignalError: there is no such quantity.
        """
        return self.extremes[name][1]

    def min(self, name: str) -> Extreme:
        """The smallest value of a quantity, as `max`."""
        return self.extremes[name][0]

    @cached_property
    def energy(self) -> EnergyBalance:
        """The energy balance over the run.

        An `AccuracyWarning` says where it leaves more unexplained than the tolerance leads one to expect.
        """
        balance = energy_balance(self.observer, self.dense, self.steps)
        if balance.residual > max(TOLERATED * self.rtol, UNSURPRISING):
            start, end = balance.worst_step
            warn(
                f"The energy balance of '{self.name}' leaves {balance.residual:.1g} of the work done unexplained, more "
                f"than rtol = {self.rtol:.1g} leads one to expect, most of it from t = {start:.6g} to {end:.6g} s: the "
                f"engine {self.engine!r} has missed something there, such as a law that is steep or has no value. Look "
                "at that time, and compare with another engine or a smaller rtol.",
                AccuracyWarning,
            )
        return balance

    @property
    def energy_residual(self) -> float:
        """What the energy balance leaves unexplained, as a fraction of the work done; warns as `energy` does."""
        return self.energy.residual

    def to_pandas(self, *names: str) -> pd.DataFrame:
        """A table over time of the named quantities, by default of all that have one value at a time (extra `data`).

        One along a shaft has a column for each place, "line.tau at 0.5 m".

        An `AccuracyWarning` says where output times are too far apart to show how the named quantities, or else the
        states, swing.
        """
        table = to_pandas(self, names or self.names)
        self._warn_of_coarse_samples(names)
        return table

    def to_xarray(self, *names: str) -> xarray.Dataset:
        """A data set over time of the named quantities, as `to_pandas` takes them, with units (extra `data`).

        One along a shaft has its places in m as second dimension, "line.tau.x". Warns as `to_pandas` does.
        """
        data = to_xarray(self, names or self.names, {"title": self.name, "engine": self.engine, "why": self.why})
        self._warn_of_coarse_samples(names)
        return data

    def plot(self, *names: str) -> Figure:
        """Curves over time, those of like size and the same unit on one axis, and the phases below (extra `plot`)."""
        return plot_signals(self.reader, names or self.states, self.phases, self.events)

    def animate(
        self, *names: str, start: float | None = None, end: float | None = None, seconds: float = 8.0
    ) -> Animation:
        """The motion as a moving picture: discs turn, shafts are coloured by their torque, curves run below.

        Turning is slowed down and twists are enlarged, by factors that the picture names. Notebooks show it.

        Args:
            *names: quantities whose curves stand below; by default the first states.
            start: of the span that is shown, s.
            end: of the span, s.
            seconds: how long it is shown.

        Raises:
            MissingExtraError: matplotlib is not installed.
            ParameterError: nothing rotates, or the span is not within the motion.
            SignalError: there is no such quantity.
        """
        from shaftwork.animation.animation import animate

        return animate(self.reader, names or self.states[:3], self.phases, span_of(self.reader, start, end), seconds)

    def rainflow(self, name: str, *, place: int | None = None, smallest: float = EQUAL) -> Rainflow:
        """The load cycles of a quantity, such as "shaft.tau", over the run (extra `life`).

        Peaks and valleys are those of the motion, from the dense output, not of the output times.

        Args:
            name: of the quantity.
            place: index in `places` of a quantity that is read along a part.
            smallest: cycles up to this fraction of the whole range are left out.

        Raises:
            MissingExtraError: the package rainflow is not installed.
            ParameterError: `smallest` is no fraction.
            SignalError: there is no such quantity or place.
        """
        return load_cycles(self.reader, name, place, smallest)

    def spectrum(
        self,
        name: str,
        *,
        place: int | None = None,
        start: float | None = None,
        end: float | None = None,
        f_max: float | None = None,
    ) -> Spectrum:
        """The amplitude spectrum of a quantity, such as "shaft.tau", over the run or a span of it.

        Args:
            name: of the quantity.
            place: index in `places` of a quantity that is read along a part; by default the middle one.
            start: of the span, s.
            end: of the span, s.
            f_max: highest frequency, Hz; by default sampling is refined until there is little above it.

        Raises:
            ParameterError: the span is not within the motion, or there is no such place.
            SignalError: there is no such quantity.
        """
        from shaftwork.spectra.spectrum import spectrum

        return spectrum(self.reader, name, place, start, end, f_max)

    def order_spectra(
        self,
        name: str,
        speed: str,
        *,
        place: int | None = None,
        turns: float = 8.0,
        order_max: float = 20.0,
        start: float | None = None,
        end: float | None = None,
    ) -> OrderSpectra:
        """Spectra of a quantity over the order of a shaft, while its speed changes: a waterfall.

        Args:
            name: of the quantity, such as "shaft.tau".
            speed: of the shaft, such as "motor.omega", which must turn one way.
            place: index in `places` of a quantity that is read along a part; by default the middle one.
            turns: of the shaft in each spectrum; its lines are 1 / turns of an order apart.
            order_max: highest order.
            start: of the span, s.
            end: of the span, s.

        Raises:
            ParameterError: the shaft does not turn one way, or not often enough; an argument is out of its range.
            SignalError: there is no such quantity.
        """
        from shaftwork.spectra.order_spectra import order_spectra

        return order_spectra(self.reader, name, speed, place, turns, order_max, (start, end))

    @overload
    def damage(self, name: str, *, sn: SNLine, smallest: float = EQUAL) -> Damage: ...

    @overload
    def damage(
        self, name: None = None, *, sn: SNLine | Mapping[str, SNLine], smallest: float = EQUAL
    ) -> dict[str, Damage]: ...

    def damage(
        self, name: str | None = None, *, sn: SNLine | Mapping[str, SNLine], smallest: float = EQUAL
    ) -> Damage | dict[str, Damage]:
        """What the motion takes from the life of a part, at the worst place of a long shaft (extra `life`).

        Args:
            name: of the quantity; by default the torques of all shafts, springs and gaps.
            sn: the S-N line; without `name` one for all, or one by the name of each quantity.
            smallest: as in `rainflow`.

        Raises:
            MissingExtraError: the package rainflow is not installed.
            ParameterError: `sn` is no S-N line.
            SignalError: there is no such quantity, or no shaft.
        """
        if name is None:
            return damages(self.reader, sn, smallest)
        return damage_of(self.reader, name, sn, smallest)

    def _warn_of_coarse_samples(self, names: Sequence[str]) -> None:
        if "dense" in vars(self):  # one that is stored would have to be made again
            warn_of_coarse_samples(self.reader, self.t, self.x, names)

    def _repr_html_(self) -> str:
        title, why, *_ = repr(self).splitlines()
        spans = [(f"{row.start:.6g}", f"{row.end:.6g}", row.name) for row in self.phases]
        return html_table(title, ("from s", "to s", "phase"), spans, why.strip())

    def __repr__(self) -> str:
        span = f"{counted(len(self.t), 'time')} from {self.t[0]:g} to {self.t[-1]:g} s"
        title = f"Solution of '{self.name}': {span}, {counted(len(self.states), 'state')}, engine {self.engine}"
        events = [f"{time:.6g} s {part} {after}" for time, part, _, after in self.events]
        phases = [f"{row.name} (from {row.start:.6g} s)" for row in self.phases]
        lines = [
            f"  {self.why}",
            *named("states", self.states),
            *named(counted(len(phases), "phase"), phases, most=6),
            *named(counted(len(events), "event"), events, most=6),
            '  Read a quantity with sol["part.quantity"]; all are in sol.names.',
        ]
        return on_one_screen(title, lines, len(lines))
