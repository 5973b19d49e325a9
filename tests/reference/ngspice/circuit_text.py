"""A circuit of the library as text for ngspice: enough for the scenes of these tests."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from sympy import Expr, Float, Symbol, pi
from sympy.printing.str import StrPrinter

import shaftwork as sw

SMOOTH = 1e-4
"""rad/s over which a friction that sticks changes its sign in ngspice, whose laws must be smooth."""


class _Printer(StrPrinter):
    """Expressions as ngspice reads them."""

    def _print_Piecewise(self, expression: Any) -> str:
        text = "0"
        for value, condition in reversed(expression.args):
            text = f"(({self._print(condition)}) ? ({self._print(value)}) : ({text}))"
        return text.replace("(True)", "(1)")

    def _print_Float(self, expression: Float) -> str:
        return repr(float(expression))


def circuit_text(circuit: sw.Network) -> str:
    """The elements of a circuit; nodes keep their names, with underscores in place of other signs."""
    return "\n".join(line for item in circuit.netlist().placed for line in _lines(item.part, item.nodes))


def label(name: str) -> str:
    """A name as ngspice takes it; the reference is 0."""
    return "0" if name == "ground" else "".join(sign if sign.isalnum() else "_" for sign in name).lower()


def _lines(part: Any, nodes: tuple[str, ...]) -> Iterator[str]:
    name, ends = label(part.name), " ".join(map(label, nodes))
    match type(part).__name__:
        case "Capacitor":
            yield f"C{name} {ends} {part.C!r}"
        case "Inductor":
            yield f"L{name} {ends} {part.L!r}"
        case "Resistor":
            yield f"R{name} {ends} {part.R!r}"
        case "CurrentSource":
            p, n = map(label, nodes)
            yield f"B{name} {n} {p} I = {_law(part.i, {sw.u: f'v({p},{n})'})}"
        case "VoltageSource":
            p, n = map(label, nodes)
            delivered = f"i(V{name}_i)"  # by a source of zero volts, which measures it
            yield f"V{name}_i {name}_i {p} 0"
            yield f"B{name} {name}_i {n} V = {_law(part.u, {sw.i: delivered})}"
        case "Ground":
            yield f"V{name} {ends} 0 0"
        case "Transformer":
            p1, n1, p2, n2 = map(label, nodes)
            yield f"V{name} {p1} {name}_1 0"
            yield f"E{name} {name}_1 {n1} {p2} {n2} {part.ratio!r}"
            yield f"F{name} {n2} {p2} V{name} {part.ratio!r}"
        case "ElectricalCoulombLoad":
            (p,) = map(label, nodes)
            yield f"B{name} {p} 0 I = {part.tau!r} * tanh(v({p}) / {SMOOTH!r})"
        case other:
            raise NotImplementedError(other)


def _law(law: Any, texts: Mapping[Symbol, str]) -> str:
    expression = law if isinstance(law, Expr) else Float(law)
    return _Printer().doprint(expression.subs({pi: pi.n(17), **{one: Symbol(text) for one, text in texts.items()}}))
