"""Which motors of a catalogue give what a motion asks, and what keeps the others from it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from shaftwork.core.errors import ParameterError, imported
from shaftwork.core.parameters import in_si
from shaftwork.numerics.tolerances import SAME, TYPED
from shaftwork.results.course import LobattoPanels
from shaftwork.results.observer import RPM, Array
from shaftwork.sizing.catalogue import SHOWN, CatalogueMotor, catalogue
from shaftwork.sizing.duty import Duty, cooling_at
from shaftwork.sizing.motor_shaft import zeros
from shaftwork.sizing.reserve import speed_torque_plane

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

UNCHECKED = (
    "heat beyond equal copper losses: iron and friction, ambient temperature, altitude, harmonics of the inverter",
    "the inverter's own current and voltage limits",
    "starts on the mains: simulate those with `motor.nameplate.cage(...)` and look at the duty's reserve",
    "inertia ratio and stiffness for the speed control, loads on bearings and shaft end, noise",
)
"""What a choice says nothing about."""
ROTOR_IMPULSE = "the impulse on the motor's own rotor where the speed jumps: prescribe a ramp there"
"""What it says nothing about besides where a speed jumps."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A motor of a catalogue in a motion.

    Args:
        motor: of the catalogue.
        tau_thermal: the constant torque that heats it as the cycle does, its rotor accelerated besides, N m.
        tau_peak: largest torque in size, its rotor accelerated besides, N m.
        reserve: what it can give over what is asked, at the worst instant.
        n_worst: speed at this instant, 1/min.
        reasons: why it does not fit; empty where it does.
    """

    motor: CatalogueMotor
    tau_thermal: float
    tau_peak: float
    reserve: float
    n_worst: float
    reasons: tuple[str, ...]

    @property
    def fits(self) -> bool:
        """Whether nothing speaks against it."""
        return not self.reasons

    @property
    def thermal_use(self) -> float:
        """Thermal torque over rated torque."""
        return self.tau_thermal / self.motor.tau_n


@dataclass(frozen=True, eq=False)
class Choice:
    """The motors of a catalogue: those that fit, the smallest power first, then the others.

    Args:
        duty: what is asked.
        candidates: ranked.
        overload: reserve that was required.
        unchecked: what was not looked at.
    """

    duty: Duty
    candidates: tuple[Candidate, ...]
    overload: float
    unchecked: tuple[str, ...] = UNCHECKED

    @property
    def fitting(self) -> tuple[Candidate, ...]:
        """Those that fit, ranked."""
        return tuple(one for one in self.candidates if one.fits)

    @property
    def best(self) -> Candidate:
        """The one with the least rated power that fits; of equal ones the one with less inertia.

        Raises:
            ParameterError: none fits; says what keeps those from it that come nearest.
        """
        if not self.fitting:
            near = "; ".join(f"{one.motor.name}: {', '.join(one.reasons)}" for one in self.candidates[:3])
            raise ParameterError(
                f"None of {len(self.candidates)} motors fits '{self.duty.motor}' in '{self.duty.title}'. Nearest: "
                f"{near}. Take another gear ratio, a gentler motion or another catalogue."
            )
        return self.fitting[0]

    @property
    def columns(self) -> dict[str, Any]:
        """One entry for each motor: name, ratings, what is asked of it, and reasons."""
        rows = self.candidates
        return {
            "motor": [one.motor.name for one in rows],
            "power": np.array([one.motor.power for one in rows]),
            "n_n": np.array([one.motor.n_n for one in rows]),
            "tau_n": np.array([one.motor.tau_n for one in rows]),
            "tau_thermal": np.array([one.tau_thermal for one in rows]),
            "thermal_use": np.array([one.thermal_use for one in rows]),
            "tau_peak": np.array([one.tau_peak for one in rows]),
            "reserve": np.array([one.reserve for one in rows]),
            "fits": np.array([one.fits for one in rows]),
            "reason": ["; ".join(one.reasons) for one in rows],
        }

    def table(self) -> pd.DataFrame:
        """The columns as a data frame (extra `data`).

        Raises:
            MissingExtraError: pandas is not installed.
        """
        frames: type[pd.DataFrame] = imported("pandas", "data", "Choice.table()").DataFrame
        return frames(self.columns)

    def plot(self) -> Figure:
        """The motion in the plane of speed and torque, with the limits of the best motor (extra `plot`).

        Raises:
            MissingExtraError: matplotlib is not installed.
            ParameterError: none fits.
        """
        return speed_torque_plane(self.duty.shaft, self.duty.thermal("S1"), self.best.motor)

    def __str__(self) -> str:
        fitting = len(self.fitting)
        shown = [*self.fitting[:SHOWN], *self.candidates[fitting:][:SHOWN]]
        lines = [
            f"{self.duty.motor} in '{self.duty.title}': {fitting} of {len(self.candidates)} motors fit",
            f"{'motor':22}{'tau_n':>8}{'thermal':>9}{'use':>6}{'peak':>9}{'reserve':>9}  why not",
            *(
                f"{one.motor.name:22}{one.motor.tau_n:>8.4g}{one.tau_thermal:>9.4g}{one.thermal_use:>6.0%}"
                f"{one.tau_peak:>9.4g}{one.reserve:>9.3g}  {', '.join(one.reasons)}".rstrip()
                for one in shown
            ),
        ]
        if len(shown) < len(self.candidates):
            lines.append(f"and {len(self.candidates) - len(shown)} more")
        sources = dict.fromkeys(one.motor.source for one in self.candidates if one.motor.source)
        lines += [f"values: {text}" for text in sources]
        lines += [f"duty: {note}" for note in self.duty.notes]
        return "\n".join([*lines, *(f"not checked: {u}" for u in self.unchecked)])


def choose(
    duty: Duty,
    motors: str | Path | Sequence[CatalogueMotor] | None = None,
    *,
    overload: Any = 1.3,
    rotor: Any = 0.0,
) -> Choice:
    """Judge every motor of a catalogue for a prescribed motion, fed by an inverter that keeps voltage over frequency.

    Law: with the acceleration alpha of the motor and its inertia J a motor gives tau + (J - rotor) alpha, and nothing
    where the motion has it switched off, tau = 0. It fits if the thermal torque (S1, with the cooling of the duty and
    full cooling at its rated speed; above that speed the flux falls and the torque counts n / n_n times) is not above
    its rated torque, if its `limit` is at least `overload` times the torque at every instant, and if the speed does not
    exceed n_max.

    Args:
        duty: what is asked.
        motors: path of a CSV file, or motors; by default those of the package, which are typical and no maker's.
        overload: least ratio of what it can give to what is asked: practice leaves so much for voltage drops and
            the 10 % by which IEC 60034-1 lets the pull-out torque fall short.
        rotor: inertia in kg m^2, at the motor's shaft, of a rotor that the motion already has in it.

    Raises:
        ParameterError: an argument is out of its range, or the catalogue is wrong.
    """
    if not isinstance(duty, Duty):
        raise ParameterError(f"{type(duty).__name__} is no duty. Give what duty(solution, 'motor') returns.")
    listed = tuple(motors if isinstance(motors, Sequence) and not isinstance(motors, str) else catalogue(motors))
    if not listed or not all(isinstance(motor, CatalogueMotor) for motor in listed):
        raise ParameterError(
            "motors must be motors of a catalogue, one or more. Give the path of a CSV file, or a list of "
            "CatalogueMotor."
        )
    required = in_si("overload", overload, above=0)
    contained = in_si("rotor", rotor, "kg*m^2", at_least=0)
    demand = _demand(duty, np.array(list(dict.fromkeys(motor.n_n for motor in listed))))
    candidates = [_candidate(demand, motor, contained, required) for motor in listed]
    ranked = sorted(candidates, key=lambda one: (not one.fits, *_rank(one)))
    unchecked = (*UNCHECKED, ROTOR_IMPULSE) if duty.jumps.size else UNCHECKED
    return Choice(duty, tuple(ranked), required, unchecked)


@dataclass(frozen=True, eq=False)
class _Demand:
    """A motion at the nodes of panels in which it is smooth, and in which no motor comes to its rated speed.

    Args:
        duty: of the motion.
        panels: all of it.
        tau: (p, 8) torque, N m.
        alpha: (p, 8) acceleration where the motor is switched on, rad/s^2.
        n: (p, 8) size of the speed, 1/min.
        lasting: (p,) panels that are more than the surroundings of a jump, where slopes are those of rounding.
    """

    duty: Duty
    panels: LobattoPanels
    tau: Array
    alpha: Array
    n: Array
    lasting: NDArray[np.bool_]

    def thermal(self, tau: Array, motor: CatalogueMotor) -> float:
        """The torque in N m that heats a motor as torques (p, 8) do, with weakened flux above its rated speed."""
        heat = self.panels.integrals((tau * np.maximum(self.n / motor.n_n, 1.0)) ** 2).sum()
        cold, motion = self.duty.cooling, float(self.panels.length.sum())
        cooled = self.panels.integrals(cooling_at(self.n, cold, motor.n_n)).sum()
        return math.sqrt(heat / (cooled + (self.duty.duration - motion) * cold))


def _demand(duty: Duty, rated: Array) -> _Demand:
    """A motion for motors of rated speeds (r,), 1/min."""
    shaft, nodes = duty.shaft, duty.panels.times.ravel()
    n = np.abs(shaft.omega(nodes)) * RPM
    place, level = np.nonzero((n[:-1, None] < rated) != (n[1:, None] < rated))
    beyond = zeros(lambda t, n_n: np.abs(shaft.omega(t)) * RPM - n_n, nodes[place], nodes[place + 1], rated[level])
    panels = duty.panels.split(beyond)
    shape = panels.times.shape
    tau, omega = (values.reshape(shape) for values in shaft.read(panels.times.ravel()))
    # Shorter panels close in a jump: slopes in them are those of rounding.
    lasting = panels.length > 1e-5 * panels.length.sum()
    on = np.abs(tau) > SAME * duty.tau_peak  # what is switched off accelerates nothing
    return _Demand(duty, panels, tau, np.where(on, panels.slopes(omega), 0.0), np.abs(omega) * RPM, lasting)


def _candidate(demand: _Demand, motor: CatalogueMotor, contained: float, overload: float) -> Candidate:
    """A motor in a motion that already has some of its inertia, kg m^2, in it."""
    tau = demand.tau + (motor.J - contained) * demand.alpha
    thermal = demand.thermal(tau, motor)
    needed, n = np.abs(tau[demand.lasting]).ravel(), demand.n[demand.lasting].ravel()
    possible = motor.limit(n)
    used = np.divide(needed, possible, out=np.where(needed > 0, np.inf, 0.0), where=possible > 0)
    worst = int(used.argmax())
    reserve = 1 / float(used[worst]) if used[worst] else math.inf
    reasons = tuple(_reasons(motor, thermal, reserve, demand.duty.n_top, overload))
    return Candidate(motor, thermal, float(needed.max()), reserve, float(n[worst]), reasons)


def _reasons(motor: CatalogueMotor, thermal: float, reserve: float, n_top: float, overload: float) -> Iterator[str]:
    if n_top > motor.fastest * (1 + TYPED):
        yield f"speed {n_top:.4g} above {motor.fastest:.4g} 1/min"
    elif reserve < overload:
        yield f"overload reserve {reserve:.3g} below {overload:.3g}"
    if thermal > motor.tau_n:
        yield f"thermal torque {thermal:.4g} above {motor.tau_n:.4g} N m"


def _rank(one: Candidate) -> tuple[float, ...]:
    """Those that fit by power and inertia; the others by how far they are from fitting."""
    if one.fits:
        return one.motor.power, one.motor.J
    return (len(one.reasons), max(one.thermal_use, 1 / one.reserve if one.reserve else math.inf), one.motor.power)
