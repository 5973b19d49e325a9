"""Elements of lcapy's netlists where they are other than those of SPICE."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import sympy
from sympy import Piecewise

from shaftwork.components.controlled import VoltageControlledCurrentSource, VoltageControlledVoltageSource
from shaftwork.components.electrical import CurrentSource, Resistor, Switch, Transformer
from shaftwork.components.laws import t
from shaftwork.spice.devices import Devices
from shaftwork.spice.netlist_lines import NetlistLine

LONG_NAMES = (
    *("TF", "SW", "NR", "AM", "VM", "GY", "TP", "TL", "TR", "RL", "CPE", "REL", "BAT", "FB", "VCVS", "VCCS", "CCCS"),
    *("CCVS", "Cable", "ANT", "SP", "BL", "MX", "XT", "MISC", "MT", "ADC", "DAC", "RV", "TV", "FS"),
)
"""Types of elements with more than one letter."""
DRAWN = ("A", "O", "P", "VM")
"""What is drawn, and lets no current pass."""
JOINED = ("W", "AM")
"""What joins its nodes."""


def kind_of(name: str) -> str:
    """The type of an element, by the letters that its name begins with."""
    return next((kind for kind in LONG_NAMES if name.startswith(kind)), name[0])


def with_joined_nodes(lines: tuple[NetlistLine, ...]) -> tuple[NetlistLine, ...]:
    """The lines without wires, whose ends are one node; node 0 gives them its name.

    Raises:
        LineError: a wire has not two ends.
    """
    parents: dict[str, str] = {}

    def first(node: str) -> str:
        while node in parents:
            node = parents[node]
        return node

    others: list[NetlistLine] = []
    for line in lines:
        if kind_of(line.words[0]) in DRAWN:
            continue
        if kind_of(line.words[0]) not in JOINED:
            others.append(line)
            continue
        if len(line.words) < 3:
            raise line.error("a wire has two nodes")
        one, other = (first(word) for word in line.words[1:3])
        if one != other:
            keep, leave = (other, one) if other == "0" else (one, other)
            parents[leave] = keep
    return tuple(replace(line, nodes={word: first(word) for word in line.words[1:]}) for line in others)


@dataclass(frozen=True)
class LcapyDevices(Devices):
    """Makes parts of lcapy's lines: sources deliver at their first node, values have names, nodes have case."""

    def add(self, line: NetlistLine) -> None:
        """Add what a line is.

        Raises:
            LineError: it is not understood.
        """
        makers: dict[str, Callable[[NetlistLine, str], None]] = {
            "R": self._resistor,
            "NR": self._resistor,
            "C": self._store,
            "L": self._store,
            "V": self._voltage,
            "BAT": self._voltage,
            "I": self._current,
            "E": self._controlled,
            "VCVS": self._controlled,
            "G": self._controlled,
            "VCCS": self._controlled,
            "F": self._following,
            "CCCS": self._following,
            "H": self._following,
            "CCVS": self._following,
            "TF": self._transformer,
            "SW": self._timed_switch,
        }
        kind = kind_of(line.words[0])
        if kind not in makers:
            kinds = ", ".join((*makers, "K", "W"))
            raise line.error(f"there is no part for elements of type {kind} here. Known are {kinds}")
        if len(line.words) < 3:
            raise line.error("it has a name and two nodes; some of that is missing")
        makers[kind](line, line.words[0])

    def _ends(self, line: NetlistLine, count: int = 2) -> tuple[str, ...]:
        return tuple(line.nodes[word] for word in line.words[1 : count + 1])

    def _resistor(self, line: NetlistLine, name: str) -> None:
        self.place(Resistor(name, R=self._named(line, 3)), *self._ends(line))

    def _named(self, line: NetlistLine, place: int) -> float:
        """A value, which has the name of the element where it is not given."""
        return self.values.number(line, line.words[place] if len(line.words) > place else line.words[0])

    def _store(self, line: NetlistLine, name: str) -> None:
        words = (*line.words[:3], line.words[3] if len(line.words) > 3 else name)
        start = ("IC", "=", line.words[4]) if len(line.words) > 4 else ()
        changed = replace(line, words=(*words, *start))
        (self._capacitor if kind_of(name) == "C" else self._inductor)(changed, name)

    def _law(self, line: NetlistLine) -> Any:
        words = [word for word in line.words[3:] if word not in "(),"]
        match words:
            case []:
                return self._named(line, 3)
            case ["dc" | "step" as kind, *rest] if len(rest) < 2:
                value = self.values.number(line, rest[0] if rest else line.words[0])
                return value if kind == "dc" else value * sympy.Heaviside(t)
            case ["ac", *rest] if len(rest) < 4:
                by_default = (line.words[0], "0", "omega_0")
                amplitude, angle, speed = (self.values.number(line, word) for word in (*rest, *by_default[len(rest) :]))
                return amplitude * sympy.cos(speed * t + angle)
            case [value] if value not in ("s", "noise"):
                return self.values.law(line, value)
        raise line.error("the source is not understood. Known are: a value, {an expression of t}, dc, step, ac")

    def _since_zero(self, source: str, law: Any) -> Any:
        """A law as lcapy takes it: what is constant or swings has always done so, all else begins at time zero."""
        constant: Any = 0
        for term in sympy.Add.make_args(sympy.expand_mul(law)):
            factor, wave = term.as_independent(t, as_Add=False)
            angle = wave.args[0] if isinstance(wave, sympy.cos | sympy.sin) else t**2
            if wave == 1:
                constant += factor
            elif not (speed := angle.diff(t)).has(t):
                phase = angle.subs(t, 0) - (sympy.pi / 2 if isinstance(wave, sympy.sin) else 0)
                self.swings.append((source, float(speed), complex(factor * sympy.exp(sympy.I * phase))))
        return law if law == constant else Piecewise((constant, t < 0), (law, True))

    def _voltage(self, line: NetlistLine, name: str) -> None:
        self._metered(line, name, self._since_zero(f"{name}.u", self._law(line)))

    def _current(self, line: NetlistLine, name: str) -> None:
        self.place(CurrentSource(name, i=self._since_zero(f"{name}.i", self._law(line))), *self._ends(line))

    def _controlled(self, line: NetlistLine, name: str) -> None:
        kind, words = kind_of(name), [word for word in line.words if word != "opamp"]
        p, n, cp, cn = (line.nodes.get(word, word) for word in (*words[1:5], *"????")[:4])
        if len(words) < 5 or line.words[3] in ("fdopamp", "inamp", "amp", "noisyopamp"):
            if kind == "G" and len(words) < 5:
                self.place(Resistor(name, R=1 / self._above_zero(line, line.words[-1])), p, n)
                return
            raise line.error("of controlled sources those with four nodes and a gain are read, and plain opamps")
        if any(self.values.number(line, word) for word in words[6:]):
            raise line.error("an opamp with a common-mode gain or a resistance is not read")
        gain = self.values.number(line, words[5] if len(words) > 5 else name)
        if kind in ("E", "VCVS"):
            self.place(VoltageControlledVoltageSource(name, gain=gain), p, n, cp, cn)
        else:
            self.place(VoltageControlledCurrentSource(name, g=-gain), p, n, cp, cn)

    def _transformer(self, line: NetlistLine, name: str) -> None:
        words = [word for word in line.words if word not in ("core", "scs")]
        if not 5 <= len(words) <= 7:
            raise line.error("of transformers those with two windings are read")
        turns = [self.values.number(line, word) for word in (words[5:] or [name])]
        if 0 in turns:
            raise line.error("a winding has no turns")
        self.place(Transformer(name, ratio=turns[0] / (turns[1] if len(turns) > 1 else 1.0)), *self._ends(line, 4))

    def _timed_switch(self, line: NetlistLine, name: str) -> None:
        kind = next((word for word in line.words[3:] if word in ("no", "nc", "push", "spdt")), "no")
        times = [word for word in line.words[3:] if word != kind]
        if kind not in ("no", "nc") or len(times) > 1:
            raise line.error("of switches those that open or close once are read, no and nc")
        when = self.values.number(line, times[0] if times else "0")
        if kind == "no":
            self.place(Switch(name, t_on=when), *self._ends(line))
        else:
            self.place(Switch(name, t_on=min(0.0, when) - 1.0, t_off=when), *self._ends(line))
