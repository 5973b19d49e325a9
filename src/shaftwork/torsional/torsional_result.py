"""The record of a torsional calculation: tables, pictures, waveforms, life and power."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from shaftwork.core.errors import ParameterError, SignalError, imported
from shaftwork.core.notebook import html_table
from shaftwork.core.parameters import in_si
from shaftwork.core.screen import counted, in_columns
from shaftwork.numerics.tolerances import TYPED
from shaftwork.results.fatigue import Damage, SNLine, damage, rainflow
from shaftwork.results.observer import RPM, Array, Complex
from shaftwork.torsional.barred_ranges import overlapping
from shaftwork.torsional.holzer import HolzerTable, holzer_table
from shaftwork.torsional.order_sums import POINTS, cycle_of, waveform
from shaftwork.torsional.shaft_sections import LAST
from shaftwork.torsional.shaft_vibration import HEADS, ShaftVibration, worst_along
from shaftwork.torsional.undamped_resonances import is_undamped, undamped_note, without_bound

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from shaftwork.frequency.campbell import Campbell
    from shaftwork.torsional.forced_train import ForcedTrain, Resonance


@dataclass(frozen=True, eq=False)
class TorsionalCalculation(Mapping[str, ShaftVibration]):
    """A torsional vibration calculation, by shaft: `calculation["shaft 1"].stress`.

    Args:
        title: of the network.
        speeds: (n,) rad/s of the reference shaft: those given, resonances, and some beside each.
        orders: (k,) excited, per turn of it.
        shafts: the vibration of every spring and shaft.
        resonances: where orders meet natural frequencies, by ascending speed.
        rated: maximum continuous speed, rad/s; None where none was given.
        misfiring: the cylinders that misfire.
        train: what is shaken, for further questions.
        torques: from the name of each shaft to that of its torque.
    """

    title: str
    speeds: Array
    orders: tuple[float, ...]
    shafts: Mapping[str, ShaftVibration]
    resonances: tuple[Resonance, ...]
    rated: float | None
    misfiring: tuple[str, ...]
    train: ForcedTrain
    torques: Mapping[str, str]

    def __getitem__(self, shaft: str) -> ShaftVibration:
        if shaft not in self.shafts:
            raise SignalError(
                f"'{shaft}' is no spring or shaft of '{self.title}'. There are: {', '.join(self.shafts)}."
            )
        return self.shafts[shaft]

    def __contains__(self, shaft: object) -> bool:
        return shaft in self.shafts

    def __iter__(self) -> Any:
        return iter(self.shafts)

    def __len__(self) -> int:
        return len(self.shafts)

    @property
    def heading(self) -> str:
        """The train, what misfires, the range and how much is in it."""
        failing = f", {' and '.join(self.misfiring)} misfiring" if self.misfiring else ""
        return (
            f"Torsional vibration of '{self.title}'{failing}: {self.speeds[0] * RPM:.5g} to "
            f"{self.speeds[-1] * RPM:.5g} 1/min, {counted(len(self.orders), 'order')}, "
            f"{counted(len(self.resonances), 'resonance')}"
        )

    @property
    def barred(self) -> tuple[tuple[float, float], ...]:
        """The speeds that all shafts together bar, (start, end) in rad/s."""
        return overlapping([one for vibration in self.shafts.values() for one in vibration.barred])

    @property
    def permitted(self) -> bool | None:
        """Whether the train may run with its barred ranges; None where no shaft has a limit."""
        judged = [one.permitted for one in self.shafts.values() if one.permitted is not None]
        return all(judged) if judged else None

    @property
    def heads(self) -> tuple[str, ...]:
        """Heads of `table`, with their units."""
        return self._filled[0]

    @property
    def table(self) -> tuple[tuple[str, ...], ...]:
        """By shaft, at the speed that governs it: vibratory torque, speed, main order, stresses, limits, verdict.

        Torque and stress are half of peak to peak. The speed is that at which the stress is the largest part of tau_c;
        without a limit, that of the largest torque. Columns in which no shaft has anything are left out.
        """
        return self._filled[1:]

    @cached_property
    def _filled(self) -> tuple[tuple[str, ...], ...]:
        rows = [HEADS, *(one.row for one in self.shafts.values())]
        columns = [column for column in zip(*rows, strict=True) if {*column[1:]} != {"-"}]
        return tuple(zip(*columns, strict=True))

    @property
    def notes(self) -> tuple[str, ...]:
        """What is said beside the table: ranges above limits, speeds not looked at, resonances without damping."""
        notes = [note for one in self.shafts.values() for note in one.notes]
        judged = self.rated is not None and any(one.limits is not None for one in self.shafts.values())
        if judged and self.rated is not None and self.speeds[-1] < LAST * self.rated * (1 - TYPED):
            notes.append(
                f"The speeds end at {self.speeds[-1] * RPM:.5g} 1/min, and the rule asks for those up to "
                f"{LAST * self.rated * RPM:.5g} 1/min, {LAST:g} of the rated one. Give speeds up to there."
            )
        return (*notes, *filter(None, (undamped_note(self.undamped, self.train.network, self.torques),)))

    @property
    def undamped(self) -> tuple[Resonance, ...]:
        """Resonances that nothing damps, where torques have no bound in a linear calculation."""
        return tuple(filter(is_undamped, self.resonances))

    def __str__(self) -> str:
        return "\n".join([self.heading, *in_columns([self.heads, *self.table]), *self.notes])

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        return html_table(self.heading, self.heads, self.table, " ".join(self.notes))

    def orders_of(self, name: str) -> Complex:
        """(n, k) complex amplitudes of any quantity, "flywheel.omega", in every order; along a shaft (n, k, places).

        Raises:
            SignalError: there is no such quantity.
        """
        return np.asarray(self.train.amplitudes(self.speeds, (name,))[name])

    def waveform(self, name: str, speed: Any) -> tuple[Array, Array]:
        """A quantity over one cycle at a speed, without its mean.

        Args:
            name: a shaft, whose torque at its worst place is meant, or any quantity that is not read along a part.
            speed: of the reference shaft, rad/s.

        Returns:
            Angles of the reference shaft (m,) from 0 on in rad, and values (m,).

        Raises:
            SignalError: there is no such quantity.
            ParameterError: the orders have no common cycle.
        """
        parts = self._parts(name, speed)
        phi = np.linspace(0.0, 2 * np.pi * self._turns, self._points)
        return phi, waveform(parts[None, :], self.orders, phi)[0]

    @property
    def _turns(self) -> int:
        turns = cycle_of(self.orders)
        if turns is None:
            raise ParameterError(
                f"The orders of '{self.title}' have no common cycle, as its gears have odd ratios, so that no waveform "
                "comes back. Its amplitudes are half ranges over all phases."
            )
        return turns

    @property
    def _points(self) -> int:
        return int(POINTS * max(self.orders) * self._turns) + 1

    def _parts(self, name: str, speed: Any) -> Complex:
        """(k,) amplitudes at a speed."""
        n = np.array([in_si("speed", speed, "rad/s", above=0)])
        quantity = self.torques.get(name, name)
        amplitudes = self.train.amplitudes(n, (quantity,))[quantity]
        if name not in self.torques and amplitudes.ndim > 2:
            raise SignalError(f"'{name}' is read along a part. Name the shaft, '{name.rpartition('.')[0]}'.")
        if name in self.torques:
            amplitudes = without_bound(amplitudes, self.train, n, self.resonances)
        parts = np.asarray(worst_along(amplitudes, self.orders, self.train.places(quantity))[0][0])
        if not np.isfinite(parts).all():
            raise ParameterError(
                f"'{name}' has no bound at {n[0]:g} rad/s ({n[0] * RPM:.5g} 1/min). "
                f"{undamped_note(self.undamped, self.train.network, self.torques) or 'Add damping.'}"
            )
        return parts

    def damage(self, shaft: str, sn: SNLine, speed: Any, mean: float = 0.0) -> Damage:
        """What one cycle at a speed takes from the life of a shaft, by Miner's rule; `hours` is the life there.

        The amplitudes of the S-N line are stresses in Pa with the stress concentration of the section where one is
        given, else torques in N m; see the page of [load cycles](life.md).

        Args:
            shaft: name.
            sn: the S-N line.
            speed: of the reference shaft, rad/s.
            mean: torque that lasts, N m.

        Raises:
            SignalError: there is no such shaft.
            ParameterError: an argument is not what it must be.
            MissingExtraError: the package rainflow is not installed.
        """
        section = self[shaft].section
        if not isinstance(sn, SNLine):
            raise ParameterError(f"sn = {sn!r} must be an S-N line, SNLine(amplitude=60e6, cycles=2e6, slope=5).")
        phi, torque = self.waveform(shaft, speed)
        # from its highest value on, every cycle of a swing that comes back closes
        torque = np.roll(torque[:-1], -int(torque[:-1].argmax())) + in_si("mean", mean, "N*m")
        torque = np.append(torque, torque[0])
        values = torque if section is None else section.scf * section.stress(torque)
        times = phi / in_si("speed", speed, "rad/s", above=0)
        name, unit = (f"{shaft}.tau", "N*m") if section is None else (f"stress of {shaft}", "Pa")
        cycles = rainflow(lambda t: np.interp(t, times, values), times, title=self.title, name=name, unit=unit)
        return damage(cycles, sn)

    @cached_property
    def modes(self) -> HolzerTable:
        """The modes up to half as high again as the highest excitation as Holzer tables.

        Where they depend on the speed, they are those about the operating point of the highest speed, which the title
        says; `train.modes(speed, f_max)` has those about another.
        """
        speed = float(self.speeds[-1])
        top = 1.5 * max(self.orders) * speed / (2 * np.pi)
        sections = [one.section for one in self.shafts.values() if one.section is not None]
        holzer = holzer_table(self.train.modes(speed, top), self.torques, sections)
        about = (
            f"about its operating point at {speed * RPM:.5g} 1/min, the highest speed"
            if callable(self.train.at)
            else "the same at all speeds"
        )
        title = f"Modes of '{self.title}' up to {top:.5g} Hz, {about}"
        return HolzerTable(title, tuple(mode for mode in holzer.modes if mode.frequency <= top))

    def campbell(self, orders: Any = None, f_max: float | None = None) -> Campbell:
        """Natural frequencies at the operating point of each speed, with the excited orders.

        Args:
            orders: to be drawn; by default those that are excited.
            f_max: highest frequency of interest, Hz.

        Raises:
            ParameterError: as of `Network.campbell`.
        """
        return self.train.campbell(self.speeds, self.orders if orders is None else orders, f_max)

    @cached_property
    def power_lost(self) -> Mapping[str, Array]:
        """By part the mean power (n,) in W that it takes out of the vibration; below 0 where it feeds it.

        Law: sum_k Re(conj(tau_k) omega_k) / 2. All parts together take what `power_fed` says. At a resonance that
        nothing damps it is infinite for parts that take any at other speeds, and 0 for the others.
        """
        ports = self.train.ports
        names = tuple(dict.fromkeys(name for several in ports.values() for port in several for name in port[:2]))
        read = self.train.amplitudes(self.speeds, names)
        lost = {}
        for part, several in ports.items():
            pairs = [(read[port.through], read[port.across], port.sign) for port in several]
            still = np.zeros(len(self.speeds))
            power = sum((_mean_power(*pair) for pair in pairs), self.power_fed.get(part, still))
            swinging = sum((_mean_power(np.abs(tau), np.abs(omega), 1.0) for tau, omega, _ in pairs), still)
            bounded = np.isfinite(swinging)
            takes = np.abs(power[bounded]).max(initial=0.0) > TYPED * swinging[bounded].max(initial=0.0)
            lost[part] = power if takes else np.where(bounded, power, 0.0)
        return lost

    @cached_property
    def power_fed(self) -> Mapping[str, Array]:
        """By excitation the mean power (n,) in W that it feeds into the vibration."""
        from shaftwork.torsional.order_excitations import amplitudes_of

        excitations = self.train.excitations
        table = amplitudes_of(excitations, self.orders, self.speeds)
        speeds = {one.source.name: self.train.ports[one.source.name][0].across for one in excitations}
        read = self.train.amplitudes(self.speeds, tuple(speeds.values()))
        return {
            name: _mean_power(torques, read[speed], 1.0)
            for (name, speed), torques in zip(speeds.items(), table, strict=True)
        }

    @property
    def heat(self) -> tuple[tuple[str, float, float], ...]:
        """Parts that turn vibration into heat, the most first: name, largest mean power in W, its speed in rad/s."""
        most = [
            (part, float(power.max()), float(self.speeds[power.argmax()])) for part, power in self.power_lost.items()
        ]
        least = TYPED * max((power for _, power, _ in most if np.isfinite(power)), default=0.0)  # the rest is rounding
        return tuple(sorted((one for one in most if one[1] > least), key=lambda one: -one[1]))

    def to_pandas(self) -> pd.DataFrame:
        """A row for each shaft and speed: torques in N m, stresses and limits in Pa (extra `data`).

        Raises:
            MissingExtraError: pandas is not installed.
        """
        frames: type[pd.DataFrame] = imported("pandas", "data", "TorsionalCalculation.to_pandas()").DataFrame
        rows = []
        for one in self.shafts.values():
            columns: dict[str, Any] = {"shaft": one.shaft, "speed": self.speeds, "n": self.speeds * RPM}
            columns |= {"torque": one.amplitude, "arithmetic": one.arithmetic}
            if one.section is not None:
                columns |= {"stress": one.stress, "notch_stress": one.notch_stress}
            if one.limits is not None:
                columns |= dict(zip(("tau_c", "tau_t"), one.limits, strict=True))
            if one.permissible is not None:
                columns["permissible"] = one.permissible
            rows += frames(columns).to_dict("records")
        return frames(rows)

    def plot(self, *shafts: str) -> Figure:
        """Vibratory stress (or torque, without a section) over speed with its largest orders and limits (extra `plot`).

        Args:
            *shafts: names; by default those with a section or a permissible torque, or else all.

        Raises:
            SignalError: there is no such shaft.
            MissingExtraError: matplotlib is not installed.
        """
        from shaftwork.torsional.torsional_pictures import picture

        looked_at = (
            name for name, one in self.shafts.items() if one.section is not None or one.permissible is not None
        )
        named = shafts or tuple(looked_at)
        return picture(self.heading, [self[name] for name in named or tuple(self.shafts)])


def _mean_power(through: Complex, across: Complex, sign: float) -> Array:
    """(n,) over a cycle, in W; of orders without a bound infinite."""
    with np.errstate(invalid="ignore"):  # of orders without a bound
        power = sign * (np.conj(through) * across).real / 2
    parts = np.where(np.isfinite(through) & np.isfinite(across), power, np.inf)
    return np.asarray(parts.sum(axis=1))
