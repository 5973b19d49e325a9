"""Modes: the ways in which a part works, what holds in each, and what ends it.

A gap is open or in contact, a brake slips or holds, a diode conducts or blocks. In each mode the part has laws of its
own. Two modes of the same *form* have the same branches and differ in one number, which stands in their laws as
`p.mode`; so they share equations and compiled code. Another form has other branches, a rigid joint for instance, and so
the network has other equations. A network makes those of a combination of forms when a motion first comes there.

What has modes is a mode machine: a part, or a piece of one. `Component.branches` finds the form of its mode as `p.form`
and the number as `p.mode`; of a machine with a label as `p.form_<label>` and `p.mode_<label>`.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import isfinite

from sympy import Expr, Symbol, false, true
from sympy.logic.boolalg import Boolean

from shaftwork.components.branches import ACROSS, INTEGRAL, THROUGH, End, is_pair, named_in
from shaftwork.components.laws import t as TIME
from shaftwork.core.parameters import is_label, refuse_fields

ANEW = ""
"""Of a `Leave`: to whichever mode a motion would start in, other than the one that ends."""


@dataclass(frozen=True)
class Leave:
    """What ends a mode: a guard, and the mode that follows.

    Args:
        when: the guard: the mode ends where it rises above zero. It may contain, beside the part's parameters and the
            time, ACROSS, THROUGH and INTEGRAL of the machine (see `Modes`), `p.mode`, and `across_of`, `through_of` and
            `integral_of`.
        to: name of the mode that follows; `ANEW` stands for the one in which a motion would start there.
        rebound: of an impact, the share of the speed across the machine that comes back after it. The machine is rigid
            for an instant, by the form of `to`, and is thrown back unless the speed is below `rest`; then the
            mode that follows is `to`, otherwise the one before goes on.
        rest: speed below which there is no rebound, in the unit of the across variable.
    """

    when: Expr
    to: str
    rebound: Expr | None = None
    rest: Expr | None = None

    def __post_init__(self) -> None:
        refuse_fields(
            self,
            when=(isinstance(self.when, Expr), "an expression that rises above zero where the mode ends"),
            to=(isinstance(self.to, str), "the name of a mode, or ANEW"),
            rebound=(self.rebound is None or isinstance(self.rebound, Expr), "an expression of p.name, or None"),
            rest=(self.rest is None or isinstance(self.rest, Expr), "an expression of p.name, or None"),
        )

    @cached_property
    def by_torque(self) -> bool:
        """Whether a torque ends the mode, and not speeds, twists and the time alone."""
        return self._reads(THROUGH)

    @cached_property
    def by_speed(self) -> bool:
        """Whether the mode ends as the speed across the machine passes through zero."""
        return self.when in (ACROSS, -ACROSS)

    @cached_property
    def by_twist(self) -> bool:
        """Whether twists and the time alone end the mode, whatever else changes at that instant."""
        return self.rebound is None and not self._reads(ACROSS) and not self._reads(THROUGH)

    @cached_property
    def by_time(self) -> bool:
        """Whether the time alone ends the mode."""
        return self.by_twist and not self.when.has(INTEGRAL) and self.when.has(TIME)

    def _reads(self, variable: Symbol) -> bool:
        """Whether a variable of the machine, ACROSS or THROUGH, or the same of another branch stands in the guard."""
        return any(symbol == variable or named_in(symbol)[0] == variable.name for symbol in self.when.free_symbols)


@dataclass(frozen=True)
class Mode:
    """One way in which a mode machine works.

    Args:
        name: of its own among the modes of the machine.
        leaves: what ends it.
        value: the number that stands in the laws as `p.mode`.
        form: which branches the part has; modes of equal form share equations.
        starts: a motion begins in the first mode whose condition holds, in ACROSS, INTEGRAL and the time; in the first
            of all where none does.
        says: how phases of a motion and events call it; modes that say the same are told apart inside only.
        at_rest: the form in place of `form` where nothing moves across the machine, as others hold both of its ends;
            None where its laws are the same then.
    """

    name: str
    leaves: tuple[Leave, ...] = ()
    value: float = 0.0
    form: str = ""
    starts: Boolean = true
    says: str = ""
    at_rest: str | None = None

    def __post_init__(self) -> None:
        leaves = isinstance(self.leaves, tuple) and all(isinstance(leave, Leave) for leave in self.leaves)
        refuse_fields(
            self,
            name=(isinstance(self.name, str) and bool(self.name), "a text such as 'open'"),
            leaves=(leaves, "a tuple of Leave(when, to)"),
            value=(isinstance(self.value, int | float) and isfinite(self.value), "a finite number"),
            form=(isinstance(self.form, str), "a text"),
            starts=(isinstance(self.starts, Boolean), "a condition such as ACROSS > 0, or NEVER"),
            says=(isinstance(self.says, str), "a text"),
            at_rest=(self.at_rest is None or isinstance(self.at_rest, str), "the name of a form, or None"),
        )

    @property
    def words(self) -> str:
        """How phases and events call it."""
        return self.says or self.name

    @property
    def forms(self) -> tuple[str, ...]:
        """The form, and that of rest where it is another one."""
        return (self.form,) if self.at_rest is None else (self.form, self.at_rest)

    @cached_property
    def gives_way(self) -> tuple[tuple[float, str], ...]:
        """The sides of THROUGH on which it is limited, and the modes that follow there: where an impact leads to."""
        slopes = ((leave.when.diff(THROUGH), leave.to) for leave in self.leaves if leave.when.has(THROUGH))
        return tuple((float(slope), to) for slope, to in slopes if slope.is_number)


@dataclass(frozen=True)
class Modes:
    """The modes of a mode machine, which is a part or a piece of one that changes its mode on its own.

    Args:
        options: the modes. In the first the machine is not rigid: in it a network is printed and checked, and
            the state at the start of a motion is read.
        ends: the ports that ACROSS is of (the first less the second); THROUGH is what the first one gives to the part.
        angle: label of the branch that INTEGRAL is of, in all forms; by default the only one that reads it.
        label: of the machine, where the part has several.
        law: where the modes are the pieces of one through law in ACROSS, INTEGRAL and time, that law.
    """

    options: tuple[Mode, ...]
    ends: tuple[End, End] | None = None
    angle: str = ""
    label: str = ""
    law: Expr | None = None

    def __post_init__(self) -> None:
        right = isinstance(self.options, tuple) and all(isinstance(mode, Mode) for mode in self.options)
        options = self.options if right else ()
        names = [mode.name for mode in options]
        words = "one or more Mode(...) in a tuple, each with a name of its own"
        refuse_fields(
            self,
            options=(0 < len(names) == len({*names}), words),
            ends=(self.ends is None or is_pair(self.ends), "None, or a pair of ports such as ('a', 'b')"),
            angle=(isinstance(self.angle, str), "the label of a branch"),
            label=(self.label == "" or is_label(self.label), "a text without dots"),
            law=(self.law is None or isinstance(self.law, Expr), "an expression in ACROSS, INTEGRAL and t, or None"),
        )

    def __getitem__(self, name: str) -> Mode:
        """A mode by name."""
        return self._by_name[name]

    @cached_property
    def _by_name(self) -> dict[str, Mode]:
        return {mode.name: mode for mode in self.options}

    @cached_property
    def passes_on(self) -> bool:
        """Whether torques within the part end its modes: it passes them on by their direction, as a gear that rubs."""
        leaves = (leave for mode in self.options for leave in mode.leaves)
        return any(leave.by_torque and not leave.when.has(THROUGH) for leave in leaves)

    @property
    def symbol(self) -> str:
        """Name of the number in laws."""
        return f"mode_{self.label}" if self.label else "mode"

    @property
    def form(self) -> str:
        """Name under which `Component.branches` finds the form."""
        return f"form_{self.label}" if self.label else "form"


@dataclass(frozen=True)
class ModeChoice:
    """What is chosen for a mode machine when branches are made: a form, and a number or None for a parameter.

    Args:
        form: of the mode.
        value: the number for `p.mode` in laws; None leaves a parameter in its place.
    """

    form: str
    value: float | None = None


def mode_symbol(name: str) -> Symbol:
    """The symbol of the number of a machine's mode, by its name in `p`."""
    return Symbol(name, real=True)


def has_mode(law: Expr) -> bool:
    """Whether the number of a mode stands in a law."""
    return any(symbol.name == "mode" or symbol.name.startswith("mode_") for symbol in law.free_symbols)


NEVER = false
"""The condition of a mode in which no motion begins."""
