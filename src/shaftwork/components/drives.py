"""Drives: induction motors at a frequency that changes; and the motors of the sources by their nameplates."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from types import MappingProxyType, SimpleNamespace
from typing import Any

from sympy import Abs, Expr, Float, Integer, Max, Piecewise, pi

from shaftwork.components.base import Derived, Note, component, number_of
from shaftwork.components.branches import ACROSS
from shaftwork.components.laws import Ramp, as_expression, t
from shaftwork.components.motors import CageMotor, CurveMotor, KlossMotor, kloss, pull_out_slip, refuse_rated_point
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import parameter


@component
class FrequencyDrive(CurveMotor):
    """An induction motor fed with a frequency that follows a law, such as the ramp of a soft start.

    Law: tau = ratio efficiency 2 tau_k flux^2 D D_k / (D^2 + D_k^2), with D = omega_0 f / f_n - ratio omega the speed
    by which the motor lags behind its field, omega_0 = 2 pi n_sync / 60, D_k = omega_0 s_k (f / f_n)^slip_exponent;
    flux = 1 while voltage over frequency is constant, f_n / f above f_n, where the voltage can rise no more, and
    1 + boost (1 - f / f_boost) below f_boost.

    Without `f` the frequency is f_0 until t_on (or 0 s), rises along a straight line during t_ramp, and stays at f_end,
    by default f_n. A frequency that falls makes the motor brake; one below zero turns it backwards.

    The lag D_k at which the motor pulls out is the same at every frequency (slip_exponent = 0): without stator
    resistance it is the rotor's resistance over its leakage inductance, so that the pull-out slip is s_k f_n / f. Below
    f = s_k f_n pull-out then lies at a negative speed, and at standstill the motor has 2 x / (1 + x^2) of
    tau_k flux^2, with x = f / (s_k f_n): a start from rest under load needs f_0 near s_k f_n, or a boost. In (3b)
    Marinkovic prints (n_k / n)^2 for (f_n / f)^2, which is slip_exponent = 1: the slip s_k at every frequency, where
    f > 0. The boost is chosen, as the source has none: a share of flux at standstill, since Kloss' formula knows no
    stator resistance for which a voltage would make up. Analogue: a controlled current source. Source: Marinkovic
    2012, (2), (3a), (3b), (18).
    """

    tau_k: float = parameter("N*m", "pull-out torque at f_n, at the motor shaft", above=0, latex=r"\tau_k")
    s_k: float = parameter("1", "slip at the pull-out torque at f_n", above=0)
    n_sync: float = parameter("1/min", "synchronous speed at f_n", above=0, latex=r"n_{sync}")
    f: Any = parameter("Hz", "frequency; by default a ramp from f_0 to f_end", law=True, default=None)
    f_n: float = parameter("Hz", "rated frequency", above=0, default=50.0)
    f_0: float = parameter("Hz", "frequency at which the ramp starts", at_least=0, default=2.5)
    f_end: float | None = parameter("Hz", "frequency at which it ends; f_n", above=0, default=None, latex="f_{end}")
    t_ramp: float = parameter("s", "duration of the ramp", above=0, default=5.0, latex="t_{ramp}")
    boost: float = parameter("1", "flux at standstill over rated flux, less 1", at_least=0, default=0.0, latex="b")
    f_boost: float = parameter("Hz", "frequency at which the boost ends", above=0, default=10.0, latex="f_b")
    slip_exponent: float = parameter("1", "how the lag at pull-out grows with f", at_least=0, default=0.0, latex="m")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.f is not None and self.f_end is not None:
            raise ParameterError(
                f"FrequencyDrive '{self.name}': f is the whole course of the frequency, and f_end the end of a ramp "
                "that there is without it. Leave one of them out."
            )

    def derived(self, p: Any) -> Iterator[Derived]:
        """Synchronous speed at the rated frequency, and by how much the motor lags behind it where it pulls out."""
        yield Derived("omega_0", 2 * pi * p.n_sync / 60, "rad/s", "synchronous speed at rated frequency", r"\omega_0")
        yield Derived("lag_k", p.s_k * p.omega_0, "rad/s", "lag at the pull-out torque", "D_k")

    def notes(self) -> Iterator[Note]:
        """Say where the start frequency is below the one at which pull-out lies at standstill, and no boost makes up.

        Of a motor with s_k of 1 or more nothing is said: it has less on the mains, too.
        """
        p = SimpleNamespace(**{name: number_of(self, name) for name in self.declared})
        f = p.f_0 if self.f is None else _value_at(self.declared["f"].magnitude(self.f)[0], p.t_on or 0.0)
        if f is None or p.s_k >= 1 or p.slip_exponent >= 1:
            return
        whole = p.f_n * p.s_k ** (1 / (1 - p.slip_exponent))
        if not 0 <= f < whole:
            return
        share = float(kloss(1.0, (f / whole) ** (1 - p.slip_exponent), 1.0))
        most = p.ratio * p.efficiency * p.tau_k
        torque = most * share * (1 + p.boost * max(0.0, 1 - f / p.f_boost)) ** 2
        if abs(torque) >= abs(most):
            return
        hint = f"Give {'f_0 =' if self.f is None else 'a frequency that begins at'} {math.ceil(10 * whole) / 10:g} Hz"
        if 0 < f < p.f_boost:
            hint += f", or boost = {math.ceil(100 * (share**-0.5 - 1) / (1 - f / p.f_boost)) / 100:g}"
        message = f"has {torque:.4g} N*m at standstill at {f:g} Hz, of a pull-out torque of {most:.4g} N*m"
        yield Note("weak start", message, f"{hint}, for a start with all of it.", torque)

    def torque(self, p: Any) -> Expr:
        f = _ramp(p) if p.f is None else p.f
        lag = p.omega_0 * f / p.f_n - p.ratio * ACROSS
        return kloss(p.tau_k * _flux(f, p) ** 2, lag, p.lag_k * (f / p.f_n) ** p.slip_exponent)


def _value_at(law: Any, time: float) -> float | None:
    """The value of a law at a time in s; None where it depends on more than the time."""
    value = as_expression(law).xreplace({t: Float(time)})
    return float(value) if value.is_comparable else None


def _ramp(p: Any) -> Expr:
    """The frequency of a start."""
    top = p.f_n if p.f_end is None else p.f_end
    return Ramp(top - p.f_0, p.t_ramp, 0 if p.t_on is None else p.t_on, p.f_0)


def _flux(f: Expr, p: Any) -> Expr:
    """Flux over rated flux; a ramp is above zero, and one that ends at the rated frequency is never weakened."""
    size = f if p.f is None else Abs(f)
    weakened = p.f is not None or p.f_end is not None
    return (1 + p.boost * Max(0, 1 - size / p.f_boost)) * (p.f_n / Max(p.f_n, size) if weakened else 1)


@component
class PullOutDrive(CurveMotor):
    """A frequency drive that always leads its motor to the pull-out point, as a curve over speed.

    Law: with the motor's speed n and n_k = n_sync (1 - s_k) it is tau_k for n < n_k, then Kloss' formula; with an
    overspeed x it is tau_k (n_k / n)^2 from n_k to x n_k, then Kloss' formula at x times the rated frequency, with the
    pull-out torque tau_k / x^2, the synchronous speed x n_sync and the slip s_k; times ratio and efficiency. These are
    curves 1 and 2 (x = 2, 100 Hz) of figure 6. Analogue: a voltage-controlled current source. Source: Marinkovic 2012,
    (2), (3a), (3b), (18).
    """

    tau_k: float = parameter("N*m", "pull-out torque at the motor shaft", above=0, latex=r"\tau_k")
    s_k: float = parameter("1", "slip at the pull-out torque", above=0)
    n_sync: float = parameter("1/min", "synchronous speed at rated frequency", above=0, latex=r"n_{sync}")
    overspeed: float | None = parameter("1", "highest over rated frequency", above=1, default=None, latex="x")

    def __post_init__(self) -> None:
        super().__post_init__()
        if (number_of(self, "s_k") or 0.0) >= 1:
            raise ParameterError(
                f"PullOutDrive '{self.name}': s_k = {self.s_k} must be below 1, or the motor pulls out at standstill. "
                "Take a FrequencyDrive."
            )

    def torque(self, p: Any) -> Expr:
        speed, synchronous = p.ratio * ACROSS, 2 * pi * p.n_sync / 60
        pull_out = synchronous * (1 - p.s_k)
        most, strongest = Integer(1), p.tau_k
        if p.overspeed is not None:
            most, strongest = p.overspeed, p.tau_k * (pull_out / Max(pull_out, speed)) ** 2
        running = kloss(p.tau_k / most**2, 1 - speed / (most * synchronous), p.s_k)
        return Piecewise((strongest, speed < most * pull_out), (running, True))


@dataclass(frozen=True)
class Nameplate:
    """A motor as its source describes it; from it come components, under names of their own.

    Args:
        name: of the motor.
        source: where it is printed.
        power: rated power, W.
        n_n: rated speed, 1/min.
        tau_n: rated torque, N m.
        n_sync: synchronous speed, 1/min.
        tau_a: locked-rotor torque, N m.
        tau_s: pull-up torque, N m.
        tau_k: pull-out torque, N m.
        f_n: rated frequency, Hz.
        chosen: the fields above that the source does not print, each with the reason for its value.

    Raises:
        ParameterError: the rated point does not lie below the pull-out torque and the synchronous speed.
    """

    name: str
    source: str
    power: float
    n_n: float
    tau_n: float
    n_sync: float
    tau_a: float
    tau_s: float
    tau_k: float
    f_n: float
    chosen: Mapping[str, str]

    def __post_init__(self) -> None:
        refuse_rated_point(f"Nameplate '{self.name}'", self.tau_k, self.tau_n, self.n_n, self.n_sync)

    @property
    def s_k(self) -> float:
        """The slip at the pull-out torque for which Kloss' curve passes through the rated point."""
        return float(pull_out_slip(self.tau_k, self.tau_n, self.n_n, self.n_sync))

    @property
    def table(self) -> str:
        """A line for each value, with its unit and whether it is printed or chosen, and why."""
        rows = (
            f"{name:7}{getattr(self, name):8g} {unit:6}{self.chosen.get(name, 'printed')}"
            for name, unit in _UNITS.items()
        )
        return "\n".join((f"{self.name} ({self.source})", *rows))

    def cage(self, name: str, **values: Any) -> CageMotor:
        """The motor with the torques of its catalogue; `values` are further parameters, such as ratio and t_off."""
        printed = {key: getattr(self, key) for key in ("tau_a", "tau_s", "tau_k", "n_sync", "tau_n", "n_n")}
        return CageMotor(name, **{**printed, **values})

    def kloss(self, name: str, **values: Any) -> KlossMotor:
        """The motor by Kloss' formula alone, from standstill on."""
        return KlossMotor(name, **{"tau_k": self.tau_k, "s_k": self.s_k, "n_sync": self.n_sync, **values})

    def drive(self, name: str, **values: Any) -> FrequencyDrive:
        """The motor on a frequency drive."""
        printed = {"tau_k": self.tau_k, "s_k": self.s_k, "n_sync": self.n_sync, "f_n": self.f_n}
        return FrequencyDrive(name, **{**printed, **values})


_UNITS = {
    "power": "W",
    "n_n": "1/min",
    "tau_n": "N m",
    "n_sync": "1/min",
    "tau_a": "N m",
    "tau_s": "N m",
    "tau_k": "N m",
    "f_n": "Hz",
}

_CRANE = Nameplate(
    name="KBF-90 LA 2",
    source="Marinkovic 2012, sections 2.1 and 2.2.1",
    power=1000.0,
    n_n=2510.0,
    tau_n=3.8,
    n_sync=3000.0,
    tau_a=7.0,
    tau_s=6.4,
    tau_k=8.0,
    f_n=50.0,
    chosen={
        "n_sync": "chosen: two poles at 50 Hz; the crane's 1.08 m/s are 2930 1/min",
        "tau_a": "chosen: only drawn in figure 5; between tau_s and tau_k",
        "tau_s": "chosen: only drawn in figure 5; 0.8 tau_k",
        "tau_k": "chosen: only drawn in figure 5; with it the crane starts in about 5 s, as in figures 9 and 10",
    },
)

_EXCAVATOR = Nameplate(
    name="excavator 250 kW",
    source="Marinkovic 2012, section 2.2.1",
    power=250e3,
    n_n=985.0,
    tau_n=2410.0,
    n_sync=1000.0,
    tau_a=5310.0,
    tau_s=4350.0,
    tau_k=5550.0,
    f_n=50.0,
    chosen={
        "n_sync": "chosen: six poles at 50 Hz, the next synchronous speed above the rated one",
        "f_n": "chosen: the 50 Hz of the other motor",
    },
)

motors: Mapping[str, Nameplate] = MappingProxyType({plate.name: plate for plate in (_CRANE, _EXCAVATOR)})
"""The motors of the sources by name."""
