"""The motors of the sources as their nameplates print them, with what had to be chosen marked so."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from shaftwork.components.drives import FrequencyDrive
from shaftwork.components.motors import CageMotor, KlossMotor, pull_out_slip, refuse_rated_point


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
