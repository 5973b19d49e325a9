"""Numbers and expressions of netlists: suffixes, parameters, and laws of time."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

import sympy
from sympy import Expr

from shaftwork.components.laws import t
from shaftwork.core.errors import ModelFileError
from shaftwork.network.expressions import parse
from shaftwork.spice.netlist_lines import NetlistLine, Scope

SCALES = {"t": 1e12, "g": 1e9, "meg": 1e6, "k": 1e3, "mil": 25.4e-6, "m": 1e-3, "u": 1e-6, "µ": 1e-6, "μ": 1e-6}
SCALES |= {"n": 1e-9, "p": 1e-12, "f": 1e-15}
"""Suffixes of numbers, without case: a mega is "meg", a milli "m"."""
_DIGITS = r"(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?"
_NUMBER = re.compile(rf"([-+]?{_DIGITS})(meg|mil|[tgkmuµμnpf])?[a-zµμ°Ω]*", re.IGNORECASE)
_IN_TEXT = re.compile(rf"(?<![\w.])({_DIGITS})(meg|[tgkmuµμnpf])?\w*", re.IGNORECASE)  # there 1mil is 1m to ngspice
_NAME = re.compile(r"[A-Za-z_]\w*")
FUNCTIONS = {"abs": "Abs", "max": "Max", "min": "Min", "u": "Heaviside", "H": "Heaviside", "sgn": "sign", "ln": "log"}
"""Functions of netlists that have another name in laws."""


def number_in(text: str) -> float | None:
    """A number with a suffix and perhaps a unit, "2.2kOhm"; None where a text is none."""
    match = _NUMBER.fullmatch(text.strip())
    return None if match is None else float(match[1]) * SCALES.get((match[2] or "").lower(), 1.0)


class NetlistValues:
    """Reads numbers and laws, with the parameters that they name.

    Args:
        given: numbers by name, without case in SPICE, which win over parameters.
        lcapy: whether names have case, suffixes do not exist, and time is t.
    """

    def __init__(self, given: Mapping[str, float], *, lcapy: bool) -> None:
        self.parameters, self._lcapy = Scope(numbers={name: sympy.Float(value) for name, value in given.items()}), lcapy
        """Those of the whole circuit."""
        self.missing: dict[str, NetlistLine] = {}
        """Names without a value, and where they stand."""

    def number(self, line: NetlistLine, text: str) -> float:
        """A number.

        Raises:
            LineError: it is none, or not finite.
        """
        return float(self._constant(line, text, line.scope or self.parameters))

    def _constant(self, line: NetlistLine, text: str, scope: Scope) -> Expr:
        plain = number_in(text)
        law = (
            sympy.Float(plain)
            if plain is not None and math.isfinite(plain)
            else self._expression(line, text, scope, {})
        )
        if law.has(t):
            raise line.error(f"'{text}' depends on time, where a number is needed")
        if not math.isfinite(float(law)):
            raise line.error(f"'{text}' is no finite number")
        return sympy.Float(float(law))

    def law(self, line: NetlistLine, text: str, **known: Expr) -> Expr:
        """A number or an expression of time, and of names that stand for something known.

        Raises:
            LineError: it is none, or names what has no value.
        """
        return self._expression(line, text, line.scope or self.parameters, known)

    def parameter(self, line: NetlistLine, name: str, scope: Scope | None = None) -> Expr:
        """A parameter by name, by default of the whole circuit.

        Raises:
            LineError: its text is no number.
        """
        inner = scope or self.parameters
        # a parameter that reads its own name means that of the circuit around
        while inner.outer is not None and (
            name not in {**inner.numbers, **inner.texts} or inner.reading[-1:] == [name]
        ):
            inner = inner.outer
        if name in inner.reading[:-1]:
            names = ", ".join(inner.reading)
            raise line.error(f"its parameters {names} read each other. Write one of them as a number")
        if name in inner.texts and name not in {*inner.numbers, *inner.reading}:
            said, text = inner.texts[name]
            inner.reading.append(name)
            try:
                inner.numbers[name] = self._constant(said, f"{{{text}}}", inner)
            finally:
                inner.reading.pop()
        if name not in inner.numbers:
            self.missing.setdefault(name, line)
        return inner.numbers.get(name, sympy.Float(1.0))

    def _expression(self, line: NetlistLine, text: str, scope: Scope, known: Mapping[str, Expr]) -> Expr:
        inner = text.strip().strip("{}'\"").strip()
        inner = inner if self._lcapy else _IN_TEXT.sub(_plain, inner.lower())
        inner = re.sub(r"\b([A-Za-z]+)\s*\(", lambda match: f"{FUNCTIONS.get(match[1], match[1])}(", inner)
        called = {match[1] for match in re.finditer(r"([A-Za-z_]\w*)\s*\(", inner)}  # only asked for membership
        known = {"t" if self._lcapy else "time": t, **known}
        names = [name for name in dict.fromkeys(_NAME.findall(inner)) if name not in called and name != "pi"]
        symbols = {name: sympy.Symbol(name, real=True) for name in names}
        try:
            law = parse(inner.replace("^", "**"), symbols.values())
        except ModelFileError as error:
            raise line.error(f"'{text}' cannot be read: {str(error).splitlines()[0]}") from None
        read = {
            symbol: known[name] if name in known else self.parameter(line, name, scope)
            for name, symbol in symbols.items()
            if law.has(symbol)
        }
        value: Expr = law.xreplace(read)
        if value.has(sympy.nan, sympy.oo, sympy.zoo, -sympy.oo, sympy.I):
            raise line.error(f"'{text}' is not finite and real")
        return value


def _plain(match: re.Match[str]) -> str:
    return repr(float(match[1]) * SCALES.get((match[2] or "").lower(), 1.0))
