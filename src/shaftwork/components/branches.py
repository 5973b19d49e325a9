"""The closed set of branch laws: everything a component can be made of.

A branch runs from its first end to its second; its through variable is what the first node gives to the branch, its
across variable is the first node's value less the second's. Power through * across is therefore absorbed by the branch.

A label names the branch's own variable where its part has several, that of an across store its across variable:
"tau_c", "omega_3". A number at its end is a running one, and equations print equal rows with an index in its place.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from sympy import Expr, Function, Integer, S, Symbol

from shaftwork.core.parameters import is_label, refuse_fields

ACROSS = Symbol("across", real=True)
"""The across variable of the branch in whose law it stands."""
INTEGRAL = Symbol("integral", real=True)
"""The integral of the across variable of the branch in whose law it stands (an angle, a position)."""

THROUGH = Symbol("through", real=True)
"""The through variable of a part, what its first node gives to it; guards of modes read it, laws do not."""

RATE = Symbol("rate of across", real=True)
"""The rate of the across variable of the branch in whose law it stands: of what a store has beyond a constant."""

HISTORY = Symbol("history", real=True)
"""What has come from the other end of the line in whose law it stands."""


class Delayed(Function):  # type: ignore[misc]
    """An expression as it was some time ago, for print: (expression, time in s)."""

    nargs = 2

    def _latex(self, printer: Any) -> str:
        return rf"\left[ {printer.doprint(self.args[0])} \right]_{{t - {printer.doprint(self.args[1])}}}"


class Abbreviated(Function):  # type: ignore[misc]
    """A long expression in a law that equations print by a short form; what computes reads it in full, `doit()`."""


def in_full(law: Expr) -> Expr:
    """A law with what print abbreviates in full."""
    return law.xreplace({short: short.doit() for short in law.atoms(Abbreviated)})


def across_of(port: str) -> Symbol:
    """In a law or guard: the across variable of a port or inner node of the same part, against the reference."""
    return Symbol(f"across of {port}", real=True)


def through_of(label: str) -> Symbol:
    """In a law or guard: the through variable of the branch of this label of the same part."""
    return Symbol(f"through of {label}", real=True)


def integral_of(label: str) -> Symbol:
    """In a law or guard: the integral of the across variable of the branch of this label of the same part."""
    return Symbol(f"integral of {label}", real=True)


MEASURED = "measured"
"""What symbols of `measured_of` say that they stand for."""


def measured_of(name: str) -> Symbol:
    """In a law of a part that `measures` it: a quantity of another part or node, "J2.omega", "shaft.tau_c"."""
    return Symbol(f"{MEASURED} of {name}", real=True)


def named_in(symbol: Symbol) -> tuple[str, str]:
    """What `across_of`, `through_of`, `integral_of` or `RATE` stands for: its kind and the name; else ("", "")."""
    kind, of, name = symbol.name.partition(" of ")
    return (kind, name) if of else ("", "")


def readings_in(law: Expr) -> tuple[Symbol, ...]:
    """The symbols of a law that stand for other branches and ports of its part, in the order of their names."""
    readings = (symbol for symbol in law.free_symbols if named_in(symbol)[0])
    return tuple(sorted(readings, key=lambda symbol: str(symbol.name)))


End = str | None
"""A port or an inner node of the component; None is the reference of the domain (speed zero)."""


def is_end(value: Any) -> bool:
    """Whether it can be an end of a branch: the name of a port, or None for the reference."""
    return value is None or is_label(value)


def is_pair(value: Any) -> bool:
    """Whether it can be the two ends of a branch."""
    return isinstance(value, tuple | list) and len(value) == 2 and all(map(is_end, value))


_PAIR = "None for the first two ports, or a pair of ports such as ('a', 'b'), where None is the reference"


class _Wired:
    """Base of branches between two ends. Laws are looked at where the branch is used, with its part's name."""

    ends: tuple[End, End] | None
    label: str

    def __post_init__(self) -> None:
        refuse_fields(
            self,
            ends=(self.ends is None or is_pair(self.ends), _PAIR),
            label=(self.label == "" or is_label(self.label), "a text without dots"),
        )


class _Coupled:
    """Base of couplings of several pairs of ends."""

    terms: tuple[tuple[Expr, End, End], ...]
    label: str

    def __post_init__(self) -> None:
        terms = self.terms
        right = isinstance(terms, tuple | list) and len(terms) > 0
        right = right and all(isinstance(term, tuple | list) and len(term) == 3 and is_pair(term[1:]) for term in terms)
        refuse_fields(
            self,
            terms=(right, "one or more triples (coefficient, first port, second port), such as ((1, 'a', None),)"),
            label=(self.label == "" or is_label(self.label), "a text without dots"),
        )


@dataclass(frozen=True)
class AcrossStore(_Wired):
    """Through = capacity * d(across)/dt: inertia, mass, capacitor.

    A capacity may depend on INTEGRAL and t, the across variable then is against the reference: d(C v)/dt - C_s v^2 / 2.
    """

    capacity: Expr
    ends: tuple[End, End] | None = None
    label: str = ""


@dataclass(frozen=True)
class ThroughStore(_Wired):
    """d(through)/dt = stiffness * across: shaft compliance, spring, inductor (stiffness 1/L).

    A stiffness may depend on INTEGRAL and t: through = stiffness * INTEGRAL.
    """

    stiffness: Expr
    ends: tuple[End, End] | None = None
    label: str = ""


@dataclass(frozen=True)
class ThroughLaw(_Wired):
    """Through = f(across, integral of across, t): damper, friction, motor curve, load, resistor, source of torque.

    It may read other ports and branches of its part besides, and is then a controlled source. A `conservative` one, as
    a weight, gives back what it takes: in a part that loses energy its work is supplied, and not lost. One that springs
    back, as a contact, has `stored` energy, in J in INTEGRAL, t and parameters: what it takes beyond that is lost.
    """

    through: Expr
    ends: tuple[End, End] | None = None
    label: str = ""
    conservative: bool = False
    stored: Expr = S.Zero

    def __post_init__(self) -> None:
        super().__post_init__()
        refuse_fields(self, conservative=(isinstance(self.conservative, bool), "True or False"))


@dataclass(frozen=True)
class AcrossLaw(_Wired):
    """Across = f(t): prescribed speed, voltage source; a controlled one where it reads other branches of its part.

    What it reads then must follow from states and from sources that depend on time alone: so must its own current, by
    `through_of` its label.
    """

    across: Expr
    ends: tuple[End, End] | None = None
    label: str = ""


@dataclass(frozen=True)
class IdealCoupling(_Coupled):
    """Sum of coefficient * across over the terms is zero, power conserving: gear, drum, machine, rigid joint.

    Every term is (coefficient, first end, second end); the through variable of a term is coefficient * lambda with one
    lambda for the coupling, so that the powers of the terms sum to zero.
    """

    terms: tuple[tuple[Expr, End, End], ...]
    label: str = ""


@dataclass(frozen=True)
class LossyCoupling(_Coupled):
    """The speeds of an `IdealCoupling`, but other ratios of the through variables: a mesh of gears that rub.

    Sum of coefficient * across over the terms is zero; the through variable of a term is its own number of `through`
    times lambda. What power the terms take in is lost.
    """

    terms: tuple[tuple[Expr, End, End], ...]
    through: tuple[Expr, ...]
    label: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        right = isinstance(self.through, tuple | list) and len(self.through) == len(self.terms)
        refuse_fields(self, through=(right, "a tuple of numbers or expressions, one for each term"))


@dataclass(frozen=True)
class DelayLine(_Wired):
    """A lossless line between two ends, each against the reference: what leaves the one arrives at the other later.

    Law: at each end through = impedance * across + history, and the history of an end at time t is minus
    2 * impedance * across + history of the other end at time t - delay. Source: Bergeron 1949.
    """

    impedance: Expr
    delay: Expr
    ends: tuple[str, str] | None = None
    label: str = "h"


Branch = AcrossStore | ThroughStore | ThroughLaw | AcrossLaw | IdealCoupling | LossyCoupling | DelayLine


def rigid(ends: tuple[End, End] | None, label: str = "") -> IdealCoupling:
    """The coupling that holds two ends at the same across value."""
    first, second = ends or (None, None)
    return IdealCoupling(((Integer(1), first, second),), label)
