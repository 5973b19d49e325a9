"""Elements of netlists as parts of a network."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from sympy import exp

from shaftwork.components.base import Component
from shaftwork.components.controlled import (
    CurrentControlledCurrentSource,
    CurrentControlledVoltageSource,
    TransmissionLine,
    VoltageControlledCurrentSource,
    VoltageControlledSwitch,
    VoltageControlledVoltageSource,
)
from shaftwork.components.electrical import (
    Capacitor,
    CurrentSource,
    Diode,
    Inductor,
    Resistor,
    Transformer,
    VoltageSource,
)
from shaftwork.components.laws import smaller, u
from shaftwork.core.errors import ParameterError
from shaftwork.network.graph import resolve
from shaftwork.network.netlist import REFERENCE, Placed, first_few
from shaftwork.spice.netlist_lines import ENDS, NetlistLine
from shaftwork.spice.source_waveforms import source_law
from shaftwork.spice.spice_numbers import NetlistValues

THERMAL = 1.380649e-23 * 300.15 / 1.602176634e-19
"""Thermal voltage in V at 27 degrees Celsius, at which SPICE takes its diodes."""
LARGEST_EXPONENT = 80.0
"""Up to here a diode is exponential: 1e-14 A times e^80 is beyond any current."""
DEAD_WITHOUT_CAPACITY = ("vj", "m", "fc", "eg", "xti", "tnom")
"""Parameters of diodes that change nothing at 27 degrees Celsius where there is no capacity."""
_LAW = re.compile(r"\S+\s+\S+\s+\S+\s+([vi])\s*=\s*(.+)", re.IGNORECASE)
_READING = re.compile(r"\b([vi])\s*\(([^()]*)\)", re.IGNORECASE)
_BRACES = str.maketrans("{}", "()")
DeviceModel = tuple[NetlistLine, str, Mapping[str, str]]
"""Of a .model its line, its type and its parameters."""


@dataclass(frozen=True)
class Devices:
    """Makes parts of the lines of a netlist, and remembers what is stored in them at the start.

    Args:
        values: reads numbers.
        models: the .model lines, by name.
        span: step and end of the analysis, s; zero where there is none.
        couplings: of inductors that are coupled, the line that couples them.
        followed: names of voltage sources whose current others follow, and how many do.
        ideal_diodes: whether diodes are ideal.
    """

    values: NetlistValues
    models: Mapping[str, DeviceModel]
    span: tuple[float, float]
    followed: Mapping[str, int]
    ideal_diodes: bool = False
    placed: list[Placed] = field(default_factory=list)
    initial: dict[str, float] = field(default_factory=dict)
    inductors: dict[str, tuple[NetlistLine, float, tuple[str, str]]] = field(default_factory=dict)
    meters: dict[str, list[tuple[str, str]]] = field(default_factory=dict)
    swings: list[tuple[str, float, complex]] = field(default_factory=list)

    def add(self, line: NetlistLine) -> None:
        """Add what a line is.

        Raises:
            LineError: it is not understood.
        """
        kind = line.command[0]
        makers: dict[str, Callable[[NetlistLine, str], None]] = {
            "r": self._resistor,
            "c": self._capacitor,
            "l": self._inductor,
            "v": self._voltage,
            "i": self._current,
            "e": self._controlled,
            "g": self._controlled,
            "f": self._following,
            "h": self._following,
            "t": self._line,
            "d": self._diode,
            "s": self._switch,
            "b": self._expressed,
        }
        if kind not in makers:
            kinds = ", ".join(sorted(one.upper() for one in (*makers, "k", "x")))
            raise line.error(f"there is no part for elements of type {kind.upper()} here. Known are {kinds}")
        if len(line.words) < ENDS[kind] + 2:
            raise line.error(f"it has a name, {ENDS[kind]} nodes and a value; some of that is missing")
        makers[kind](line, f"{line.prefix}{line.words[0]}")

    def place(self, part: Component, *nodes: str) -> None:
        """Add a part between nodes of the netlist.

        Raises:
            ParameterError: a value is out of its bounds.
        """
        for name, value, objection in resolve(part)[1]:
            raise ParameterError(f"{name} = {value} {objection}")
        self.placed.append(Placed(part, tuple(REFERENCE if node == "0" else node for node in nodes)))

    def _ends(self, line: NetlistLine, count: int = 2) -> tuple[str, ...]:
        return tuple(map(line.node, line.words[1 : count + 1]))

    def _value(self, line: NetlistLine, name: str, start: float | None = None) -> tuple[float, dict[str, str]]:
        """The value of a resistor, capacitor or inductor, and its other parameters."""
        words = line.words
        if words[4:5] == ("=",):  # R = 1k
            pairs = line.pairs(3)
            value = pairs.pop(name, None)
        else:
            value, pairs = words[3], line.pairs(4)
        if value is None or pairs.keys() - ({"ic"} if start is not None else set()):
            wrong = ", ".join(pairs.keys() - {"ic"}) or f"no {name.upper()}"
            raise line.error(f"{wrong}: it takes {name.upper()}{' and IC' if start is not None else ''} alone")
        return self.values.number(line, value), pairs

    def _resistor(self, line: NetlistLine, name: str) -> None:
        resistance, _ = self._value(line, "r")
        if resistance >= 0:
            self.place(Resistor(name, R=resistance), *self._ends(line))
        else:  # it delivers power
            self.place(CurrentSource(name, i=-u / resistance), *self._ends(line))

    def _capacitor(self, line: NetlistLine, name: str) -> None:
        capacitance, pairs = self._value(line, "c", 0.0)
        self.place(Capacitor(name, C=capacitance), *self._ends(line))
        if "ic" in pairs:
            self.initial[f"{name}.u"] = self.values.number(line, pairs["ic"])

    def _inductor(self, line: NetlistLine, name: str) -> None:
        inductance, pairs = self._value(line, "l", 0.0)
        p, n = self._ends(line)
        self.inductors[name.lower()] = line, inductance, (p, n)
        if "ic" in pairs:
            self.initial[f"{name}.i"] = self.values.number(line, pairs["ic"])
        self.place(Inductor(name, L=inductance), p, n)

    def _voltage(self, line: NetlistLine, name: str) -> None:
        self._metered(line, name, source_law(line, self.values, self.span))

    def _metered(self, line: NetlistLine, name: str, law: Any) -> None:
        """A voltage source with a place in series for each that follows its current."""
        p, n = self._ends(line)
        count = self.followed.get(name.lower(), 0)
        inner = [f"{name} {k}" for k in range(1, count + 1)]
        meters = [*zip((p, *inner), inner, strict=False)]
        if count and law == 0:  # it measures a current, and is nothing else
            meters[-1] = (meters[-1][0], n)
        else:
            self.place(VoltageSource(name, u=law), inner[-1] if inner else p, n)
        self.meters[name.lower()] = meters

    def _current(self, line: NetlistLine, name: str) -> None:
        p, n = self._ends(line)  # SPICE counts the current through the source, ours is delivered
        self.place(CurrentSource(name, i=source_law(line, self.values, self.span)), n, p)

    def _expressed(self, line: NetlistLine, name: str) -> None:
        """A B source; of voltages its law may read the one between its own nodes."""
        match = _LAW.match(line.text)
        if match is None:
            raise line.error("a B source has two nodes and V=expression or I=expression")
        kind, (p, n) = match[1].lower(), self._ends(line)
        own = {f"{p},{n}": "(u_own)", f"{n},{p}": "(-u_own)"}
        own |= {node: text for node, text in ((p, "(u_own)"), (n, "(-u_own)")) if {p, n} - {node} == {"0"}}

        def read(reading: re.Match[str]) -> str:
            nodes = ",".join(line.node(word.strip()) for word in reading[2].split(","))
            if reading[1] in "iI" or nodes not in own or kind == "v":
                raise line.error(
                    f"its law reads {reading[0]}: laws of time are read, and of the voltage across the source where it "
                    "gives a current. What is proportional to another voltage or current is an E, F, G or H"
                )
            return own[nodes]

        text = _READING.sub(read, match[2]).translate(_BRACES)
        law = self.values.law(line, text, u_own=u)
        if kind == "v":
            self._metered(line, name, law)
        else:
            self.place(CurrentSource(name, i=-law), p, n)

    def _controlled(self, line: NetlistLine, name: str) -> None:
        line = replace(line, words=tuple(word for word in line.words if word not in "()"))
        if len(line.words) != 6 or line.words[3].lower().startswith(("poly", "value", "vol", "cur", "table")):
            raise line.error("it has four nodes and a gain; other forms, as POLY and VALUE, are not read")
        gain = self.values.number(line, line.words[5])
        part = VoltageControlledVoltageSource(name, gain=gain)
        self.place(
            part if line.command[0] == "e" else VoltageControlledCurrentSource(name, g=gain), *self._ends(line, 4)
        )

    def _following(self, line: NetlistLine, name: str) -> None:
        if len(line.words) != 5:
            raise line.error("it has two nodes, the name of a voltage source and a gain; other forms are not read")
        gain, source = self.values.number(line, line.words[4]), f"{line.prefix}{line.words[3]}".lower()
        if not self.meters.get(source):
            raise line.error(f"there is no voltage source '{line.words[3]}' whose current it could follow")
        meter = self.meters[source].pop(0)
        part: Component = CurrentControlledVoltageSource(name, r=gain)
        if line.command[0] == "f":
            part = CurrentControlledCurrentSource(name, gain=gain)
        self.place(part, *self._ends(line), *meter)

    def _line(self, line: NetlistLine, name: str) -> None:
        pairs = line.pairs(5)
        if pairs.keys() - {"z0", "zo", "td", "f", "nl"}:
            raise line.error("a line has Z0 and TD, or F and NL; nothing else is read")
        impedance = self.values.number(line, pairs.get("z0", pairs.get("zo", "50")))
        near, far = line.node(line.words[1]), line.node(line.words[3])
        if {line.node(line.words[2]), line.node(line.words[4])} != {"0"}:
            raise line.error("both lower ends of a line must be at node 0: others are not read")
        if "td" in pairs:
            delay = self.values.number(line, pairs["td"])
        elif "f" in pairs:
            delay = self.values.number(line, pairs.get("nl", "0.25")) / self._above_zero(line, pairs["f"])
        else:
            raise line.error("it has no TD and no F, so that its delay is not known")
        self.place(TransmissionLine(name, Z_0=impedance, delay=delay), near, far)

    def _above_zero(self, line: NetlistLine, text: str) -> float:
        value = self.values.number(line, text)
        if not value > 0:
            raise line.error(f"'{text}' must be above zero")
        return value

    def _model(self, line: NetlistLine, name: str, kind: str, defaults: Mapping[str, float]) -> dict[str, float]:
        """The parameters of a model; those that have no default must be zero."""
        scoped = next((one for one in line.in_scope(name) if one in self.models), None)
        if scoped is None:
            there = first_few([*self.models]) or "none"
            raise line.error(f"there is no .model '{name}'. Given are: {there}")
        origin, other, pairs = self.models[scoped]
        if other != kind:
            raise line.error(f".model {name} is of type '{other}', not '{kind}'")
        unread = DEAD_WITHOUT_CAPACITY if kind == "d" and "cjo" not in pairs and "cj0" not in pairs else ()
        read = {key: self.values.number(origin, text) for key, text in pairs.items() if key not in unread}
        standard = {"level": 1.0}
        if strange := [key for key, value in read.items() if key not in defaults and value != standard.get(key, 0.0)]:
            names = ", ".join(defaults)
            raise origin.error(f"{', '.join(strange)} of a model of type {kind} is not read. Known: {names}")
        return {key: read.get(key, value) for key, value in defaults.items()}

    def _diode(self, line: NetlistLine, name: str) -> None:
        p, n = self._ends(line)
        if self.ideal_diodes:
            self.place(Diode(name), p, n)
            return
        if len(line.words) > 4:
            raise line.error("a diode has two nodes and a model; area and initial voltage are not read")
        model = self._model(line, line.words[3], "d", {"is": 1e-14, "n": 1.0, "rs": 0.0})
        if model["rs"]:
            self.place(Resistor(f"{name} rs", R=model["rs"]), p, f"{name} inner")
            p = f"{name} inner"
        current = model["is"] * (exp(smaller(u / (model["n"] * THERMAL), LARGEST_EXPONENT)) - 1)
        self.place(CurrentSource(name, i=-current), p, n)

    def _switch(self, line: NetlistLine, name: str) -> None:
        flags = [word.lower() for word in line.words[6:]]
        if flags not in ([], ["off"]):
            raise line.error(f"'{' '.join(flags)}' is not read: a switch begins as its voltage has it, or open")
        model = self._model(line, line.words[5], "sw", {"vt": 0.0, "vh": 0.0, "ron": 1.0, "roff": 1e12})
        closed, opened, threshold, hysteresis = (model[key] for key in ("ron", "roff", "vt", "vh"))
        part = VoltageControlledSwitch(name, R_on=closed, R_off=opened, u_t=threshold, u_h=hysteresis)
        self.place(part, *self._ends(line, 4))

    def couple(self, line: NetlistLine) -> None:
        """Put the equivalent circuit of two inductors that are coupled in their place.

        Law: u_1 = L_1 i_1' + M i_2', u_2 = M i_1' + L_2 i_2' with M = k sqrt(L_1 L_2): a leakage (1 - k^2) L_1 in
        series with an ideal transformer of ratio M / L_2, beside whose other side is L_2.

        Raises:
            LineError: it names no two inductors, or one that another line couples, or k is not between 0 and 1.
        """
        if len(line.words) != 4:
            raise line.error("a coupling has two inductors and a factor; more of them are not read")
        names = [f"{line.prefix}{word}".lower() for word in line.words[1:3]]
        if names[0] == names[1] or not all(name in self.inductors for name in names):
            raise line.error("it must name two inductors of the netlist that no other line couples")
        factor = self.values.number(line, line.words[3])
        if not 0 < abs(factor) <= 1:
            raise line.error(f"its factor is {factor:g}, and must be between 0 and 1 in size")
        (first, one, near), (second, other, far) = (self.inductors.pop(name) for name in names)
        if not (one > 0 and other > 0):
            raise line.error("inductors that are coupled must be above zero")
        name, partner = (f"{item.prefix}{item.words[0]}" for item in (first, second))
        self.placed[:] = [item for item in self.placed if item.part.name != name]
        i_1, i_2 = (self.initial.get(f"{item}.i", 0.0) for item in (name, partner))
        ratio, inner = factor * math.sqrt(one / other), f"{name} inner"
        if 1 - factor**2 > 0:
            self.place(Inductor(name, L=(1 - factor**2) * one), near[0], inner)
        else:
            inner = near[0]
            self.initial.pop(f"{name}.i", None)
        label = f"{line.prefix}{line.words[0]}"
        self.place(Transformer(label, ratio=ratio), inner, near[1], *far)
        if i_1 or i_2:
            self.initial[f"{partner}.i"] = i_2 + ratio * i_1
