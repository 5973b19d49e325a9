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
from shaftwork.spice.netlist_lines import NetlistLine

SCALES = {"t": 1e12, "g": 1e9, "meg": 1e6, "k": 1e3, "mil": 25.4e-6, "m": 1e-3, "u": 1e-6, "µ": 1e-6, "μ": 1e-6}
SCALES |= {"n": 1e-9, "p": 1e-12, "f": 1e-15}
"""Suffixes of numbers, without case: a mega is "meg", a milli "m"."""
_DIGITS = r"(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?"
_NUMBER = re.compile(rf"([-+]?{_DIGITS})(meg|mil|[tgkmuµμnpf])?[a-zµμ°Ω]*", re.IGNORECASE)
_IN_TEXT = re.compile(rf"(?<![\w.])({_DIGITS})(meg|mil|[tgkmuµμnpf])?\w*", re.IGNORECASE)
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
        parameters: by name, without case in SPICE.
        lcapy: whether names have case, and suffixes do not exist.
    """

    def __init__(self, parameters: Mapping[str, float], *, lcapy: bool) -> None:
        self.parameters, self._lcapy = dict(parameters), lcapy
        self.missing: dict[str, NetlistLine] = {}
        """Names without a value, and where they stand."""

    def number(self, line: NetlistLine, text: str) -> float:
        """A number.

        Raises:
            LineError: it is none, or not finite.
        """
        plain = number_in(text)
        law = sympy.Float(plain) if plain is not None and math.isfinite(plain) else self.law(line, text)
        if law.has(t):
            raise line.error(f"'{text}' depends on time t, where a number is needed")
        value = float(law)
        if not math.isfinite(value):
            raise line.error(f"'{text}' is no finite number")
        return value

    def law(self, line: NetlistLine, text: str) -> Expr:
        """A number or an expression of time.

        Raises:
            LineError: it is none, or names what has no value.
        """
        return self._expression(line, text, tuple(reversed(line.values)))

    def _expression(self, line: NetlistLine, text: str, scopes: tuple[Mapping[str, str], ...]) -> Expr:
        inner = text.strip().strip("{}'\"").strip()
        inner = inner if self._lcapy else _IN_TEXT.sub(_plain, inner.lower())
        inner = re.sub(r"\b([A-Za-z]+)\s*\(", lambda match: f"{FUNCTIONS.get(match[1], match[1])}(", inner)
        names = [name for name in dict.fromkeys(_NAME.findall(inner.replace("^", "**"))) if name != "t"]
        called = {match[1] for match in re.finditer(r"([A-Za-z_]\w*)\s*\(", inner)}  # only asked for membership
        symbols = {name: sympy.Symbol(name, real=True) for name in names if name not in called and name != "pi"}
        try:
            law = parse(inner.replace("^", "**"), (t, *symbols.values()))
        except ModelFileError as error:
            raise line.error(f"'{text}' cannot be read: {str(error).splitlines()[0]}") from None
        read = {symbol: self._parameter(line, name, scopes) for name, symbol in symbols.items() if law.has(symbol)}
        value: Expr = law.xreplace(read)
        if value.has(sympy.nan, sympy.oo, sympy.zoo, -sympy.oo, sympy.I) or value.free_symbols - {t}:
            raise line.error(f"'{text}' is not finite and real")
        return value

    def _parameter(self, line: NetlistLine, name: str, scopes: tuple[Mapping[str, str], ...]) -> Expr:
        for k, scope in enumerate(scopes):
            if name in scope:  # it is written in what is around the subcircuit
                return self._expression(line, scope[name], scopes[k + 1 :])
        if name not in self.parameters:
            self.missing.setdefault(name, line)
        return sympy.Float(self.parameters.get(name, 1.0))


def _plain(match: re.Match[str]) -> str:
    return repr(float(match[1]) * SCALES.get((match[2] or "").lower(), 1.0))
