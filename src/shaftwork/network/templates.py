"""From a component to its branches: one symbolic template for each class and pattern of zeros, shared by all its parts.

A parameter that is exactly zero is put into the laws as the number 0 before anything else is made of them. So a damping
of zero leaves no branch, a resistance of zero becomes a rigid joint, and neither leaves a trace in equations or code.
"""

from __future__ import annotations

import copy
import dataclasses
import itertools
import reprlib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import SimpleNamespace
from typing import Any, Generic, TypeVar, get_args

from sympy import Expr, Float, Integer, S, Symbol

from shaftwork.components.base import Component, Derived
from shaftwork.components.branches import (
    ACROSS,
    HISTORY,
    INTEGRAL,
    RATE,
    AcrossLaw,
    AcrossStore,
    Branch,
    Delayed,
    DelayLine,
    End,
    IdealCoupling,
    LossyCoupling,
    ThroughLaw,
    ThroughStore,
    in_full,
    readings_in,
    rigid,
    through_of,
)
from shaftwork.components.laws import t as TIME
from shaftwork.components.modes import ModeChoice, Modes, has_mode, mode_symbol
from shaftwork.core.domains import DOMAINS
from shaftwork.core.errors import ShaftworkError
from shaftwork.network.kinds import CHANGE, Kind, Resolved, beyond_constant, changes, law_of, resolved, spring

T = TypeVar("T")
Choices = tuple[ModeChoice, ...] | None
"""Of the elements of a part with modes; () for the first modes, None for their forms with numbers as parameters."""


@dataclass(frozen=True, eq=False)
class BranchTemplate:
    """A branch in symbols of its own component.

    Args:
        kind: what the law is; it decides the place in the normal tree.
        law: capacity, stiffness or conductance of a store or conductance; through or across variable of the others.
        ends: first and second end.
        terms: of a coupling, (coefficient, first end, second end); else empty.
        label: name of its through variable where the part has several.
        symbols: the parameters that the expressions contain, in the order of their declaration.
        printed: the law as equations print it, in letters of derived quantities; of a store that changes, all of it.
        line: at an end of a line, its impedance and delay: of the conductance and of the history, whose law is
            `HISTORY`; the next two branches of a line are its other end.
        through: of a coupling that loses power, the factors of its through variable, one for each term; else empty.
        conservative: what a through law takes in it gives back.
        stored: what a through law stores, J, in INTEGRAL, time and parameters; of a store that changes, of ACROSS too.
        meter: whether nothing passes through it, and its angle alone is recorded.
    """

    kind: Kind
    law: Expr
    ends: tuple[End, End]
    terms: tuple[tuple[Expr, End, End], ...]
    label: str
    symbols: tuple[Symbol, ...]
    printed: Expr
    line: tuple[Expr, Expr] | None = None
    through: tuple[Expr, ...] = ()
    conservative: bool = False
    stored: Expr = S.Zero
    meter: bool = False

    @property
    def balances(self) -> tuple[tuple[Expr, End, End], ...]:
        """Of a coupling, (factor of its through variable, first end, second end); else empty."""
        return with_factors(self.terms, self.through)

    @property
    def has_integral(self) -> bool:
        """Whether the law reads the angle, position or flux linkage of its branch."""
        return bool(self.law.has(INTEGRAL))

    @cached_property
    def reads(self) -> tuple[Symbol, ...]:
        """What the law reads of other ports and branches of its part."""
        return readings_in(self.law)

    @property
    def is_history(self) -> bool:
        """Whether it is what has come from the other end of a line."""
        return bool(self.law == HISTORY)


def with_factors(terms: tuple[tuple[Expr, T, T], ...], factors: tuple[Expr, ...]) -> tuple[tuple[Expr, T, T], ...]:
    """The terms of a coupling with other factors; as they are where there are none."""
    if not factors:
        return terms
    return tuple((factor, plus, minus) for factor, (_, plus, minus) in zip(factors, terms, strict=True))


@dataclass(frozen=True, eq=False)
class Template:
    """All branches of a component with a given pattern of zero parameters, and the derived quantities in their laws.

    The modes are those of its elements, in symbols of the component; numbers of modes are the last parameters.
    """

    branches: tuple[BranchTemplate, ...]
    parameters: tuple[str, ...]
    derived: tuple[Derived, ...]
    modes: tuple[Modes, ...] = ()


def substitution(part: Component) -> dict[Any, Any]:
    """The names that users write in laws: omega, phi; v, s; u, psi of the branch, and the letters of the part."""
    names: dict[Any, Any] = {}
    for domain in DOMAINS:
        if any(port.domain is domain for port in part.ports):
            names[Symbol(domain.across.name, real=True)] = ACROSS
            names[Symbol(domain.integral.name, real=True)] = INTEGRAL
    return {**names, **part.letters}


def make_template(part: Component, values: Mapping[str, Any], choices: Choices = ()) -> Template:
    """The branches of a part whose parameter values are floats or, for laws, expressions.

    Args:
        part: the part.
        values: of its parameters.
        choices: what is chosen for its modes.
    """
    translate = substitution(part)
    placed: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, float):
            placed[name] = Symbol(name, real=True) if value else Integer(0)
        else:
            placed[name] = value.xreplace(translate) if isinstance(value, Expr) else value
    symbols = {Symbol(name, real=True): name for name, value in values.items() if isinstance(value, float) and value}
    p = SimpleNamespace(**placed, form=None, mode=mode_symbol("mode"))
    derived = tuple(_derived(part, p))
    modes = tuple(part.modes(p))
    symbols |= _choose(p, modes, choices)
    ends = (part.ports[0].name, part.ports[1].name if len(part.ports) > 1 else None)
    resolver = _Resolver(ends, tuple(symbols), _in_parameters(derived))
    yielded = _without_absent(tuple(part.branches(p)))
    branches = tuple(
        template for number, branch in enumerate(yielded, 1) for template in resolver.templates(branch, number)
    )
    return Template(branches, tuple(symbols.values()), _occurring(derived, itertools.chain(*resolver.read)), modes)


def _choose(p: Any, modes: tuple[Modes, ...], choices: Choices) -> dict[Symbol, str]:
    """Put the chosen forms and numbers of modes into `p`; symbol and name of the numbers that stay parameters."""
    by_default = tuple(ModeChoice(m.options[0].form, None if choices is None else m.options[0].value) for m in modes)
    free: dict[Symbol, str] = {}
    for element, choice in zip(modes, choices or by_default, strict=True):
        setattr(p, element.form, choice.form)
        if choice.value is not None:
            setattr(p, element.symbol, Float(choice.value) if choice.value % 1 else Integer(int(choice.value)))
        else:
            setattr(p, element.symbol, mode_symbol(element.symbol))
            free[mode_symbol(element.symbol)] = element.symbol
    return free


def _without_absent(branches: tuple[Branch, ...]) -> tuple[Branch, ...]:
    """The branches, with laws that read zero in place of what a store lets through that is left out."""
    stores = (branch for branch in branches if isinstance(branch, ThroughStore))
    absent = {through_of(store.label): Integer(0) for store in stores if store.stiffness == 0}

    def with_zeros(branch: Branch) -> Branch:
        match branch:
            case ThroughLaw(Expr() as law):
                return dataclasses.replace(branch, through=law.xreplace(absent))
            case AcrossLaw(Expr() as law):
                return dataclasses.replace(branch, across=law.xreplace(absent))
        return branch

    return tuple(map(with_zeros, branches)) if absent else branches


def _derived(part: Component, p: Any) -> Iterator[Derived]:
    """The derived quantities of a part, each given to `p` as a symbol, or as the number 0 where it is that."""
    for quantity in part.derived(p):
        if hasattr(p, quantity.name):
            raise ShaftworkError(f"{type(part).__name__}: {quantity.name!r} is derived, but exists already. Rename it.")
        setattr(p, quantity.name, Symbol(quantity.name, real=True) if quantity.law != 0 else Integer(0))
        if quantity.law != 0:
            yield quantity


def _in_parameters(derived: tuple[Derived, ...]) -> dict[Symbol, Expr]:
    laws: dict[Symbol, Expr] = {}
    for quantity in derived:
        laws[Symbol(quantity.name, real=True)] = quantity.law.xreplace(laws)
    return laws


def _occurring(derived: tuple[Derived, ...], laws: Iterable[Expr]) -> tuple[Derived, ...]:
    """Those that stand in the laws, or in the law of one that does."""
    symbols = set[Symbol]().union(*(law.free_symbols for law in laws))  # only asked for membership
    occurring: list[Derived] = []
    for item in reversed(derived):
        if Symbol(item.name, real=True) in symbols:
            symbols |= item.law.free_symbols
            occurring.append(item)
    return tuple(reversed(occurring))


class _Resolver:
    """Branches as templates; a law that many share is looked at once; `read` has all of them, as equations print them.

    Args:
        default: ends of a branch that names none.
        symbols: symbols of the parameters, in the order of their declaration.
        derived: laws of the derived quantities in the parameters.
    """

    def __init__(self, default: tuple[End, End], symbols: tuple[Symbol, ...], derived: Mapping[Symbol, Expr]) -> None:
        self._default, self._symbols, self._derived = default, symbols, derived
        self._reduced: dict[Any, tuple[Resolved, ...] | None] = {}
        self.read: dict[Any, tuple[tuple[Expr, ...], tuple[Symbol, ...]]] = {}

    def templates(self, branch: Branch, number: int) -> Iterator[BranchTemplate]:
        """None when the law vanishes, a rigid joint when it is infinite, two when it is affine."""
        match branch:
            case IdealCoupling() | LossyCoupling():
                exact = tuple((law_of(factor, branch, number), plus, minus) for factor, plus, minus in branch.terms)
                through = branch.through if isinstance(branch, LossyCoupling) else ()
                factors = tuple(law_of(factor, branch, number) for factor in through)
                yield self._template(Kind.COUPLING, Integer(0), (None, None), exact, branch.label, factors)
            case AcrossStore(law, ends, label) | ThroughStore(law, ends, label) | ThroughLaw(law, ends, label):
                if (kinds := self._resolved(branch, law, number)) is None:
                    yield from self._changing(branch, law_of(law, branch, number), number)
                    return
                for kind, reduced in kinds:
                    joint = rigid(ends or self._default).terms if kind is Kind.COUPLING else ()
                    where = (None, None) if joint else ends or self._default
                    template = self._template(kind, reduced, where, joint, label)
                    yield self._with_energy(template, branch, number) if isinstance(branch, ThroughLaw) else template
            case DelayLine(impedance, delay, ends, label):
                impedance, delay = law_of(impedance, branch, number), law_of(delay, branch, number)
                line, symbols = self._in_parameters(impedance, delay)
                arrived = -Delayed(2 * impedance * ACROSS + HISTORY, delay)
                for end in ends or self._default:
                    impedes = self._template(Kind.CONDUCTANCE, impedance, (end, None), (), str(end))
                    history = self._template(Kind.THROUGH_SOURCE, HISTORY, (end, None), (), f"{label}_{end}")
                    yield dataclasses.replace(impedes, line=(line[0], line[1]))
                    yield dataclasses.replace(history, symbols=symbols, printed=arrived, line=(line[0], line[1]))
            case AcrossLaw(law, ends, label):
                across = law_of(law, branch, number)
                yield self._template(Kind.ACROSS_SOURCE, across, ends or self._default, (), label)
            case _:
                kinds = ", ".join(kind.__name__ for kind in get_args(Branch))
                raise ShaftworkError(
                    f"branch {number} is {reprlib.repr(branch)}, which is no branch. branches() yields: {kinds}."
                )

    def _changing(self, branch: Any, law: Expr, number: int) -> Iterator[BranchTemplate]:
        """A store that depends on its angle or on time.

        Raises:
            StoreFaultError: it is an inertia that jumps.
        """
        ends, label = branch.ends or self._default, branch.label
        if isinstance(branch, ThroughStore):
            through, stored = spring(law)
            piece = ThroughLaw(through, ends, label, stored is None, Integer(0) if stored is None else stored)
            yield from self.templates(piece, number)
            return
        constant, beyond, energy = beyond_constant(law)
        store, rest = (
            self._template(kind, piece, ends, (), f"{label}{ending}")
            for kind, piece, ending in ((Kind.ACROSS_STORE, constant, ""), (Kind.LAW, beyond, CHANGE))
        )
        yield dataclasses.replace(store, printed=law)
        yield dataclasses.replace(
            rest, printed=rest.printed.xreplace({RATE: Integer(0)}), stored=energy.xreplace(self._derived)
        )

    def _resolved(self, branch: Branch, law: Any, number: int) -> tuple[Resolved, ...] | None:
        """The kinds and laws of a store or law; None of a store that depends on its angle or on time."""
        key = (type(branch), law)
        try:
            return self._reduced[key]
        except (KeyError, TypeError):  # a law that is no expression may have no hash
            expression = law_of(law, branch, number)
        is_store = isinstance(branch, AcrossStore | ThroughStore)
        kinds = None if is_store and changes(expression) else tuple(resolved(branch, expression))
        self._reduced[key] = kinds
        return kinds

    def _template(
        self,
        kind: Kind,
        law: Expr,
        ends: tuple[End, End],
        terms: tuple[tuple[Expr, End, End], ...],
        label: str,
        through: tuple[Expr, ...] = (),
    ) -> BranchTemplate:
        (explicit, *factors), symbols = self._in_parameters(
            law, *(coefficient for coefficient, _, _ in terms), *through
        )
        placed, others = with_factors(terms, tuple(factors[: len(terms)])), tuple(factors[len(terms) :])
        return BranchTemplate(kind, explicit, ends, placed, label, symbols, law, through=others)

    def _with_energy(self, template: BranchTemplate, branch: ThroughLaw, number: int) -> BranchTemplate:
        """A through law with what it says of its energy, which the part of it has that is not linear in the speed.

        Raises:
            ShaftworkError: what it stores is not that of its angle.
        """
        stored = law_of(branch.stored, branch, number).xreplace(self._derived)
        strange = stored.free_symbols - {INTEGRAL, TIME, *self._symbols}
        if strange or has_mode(stored) or not (stored == 0 or law_of(branch.through, branch, number).has(INTEGRAL)):
            raise ShaftworkError(
                f"branch {number} (ThroughLaw) has stored = {reprlib.repr(stored)}. Write it in p.name and "
                "in INTEGRAL, which its law must read, for all modes alike."
            )
        if stored == 0 or template.kind is Kind.CONDUCTANCE:
            return dataclasses.replace(template, conservative=True) if branch.conservative else template
        _, symbols = self._in_parameters(template.law, stored)
        return dataclasses.replace(template, conservative=branch.conservative, stored=stored, symbols=symbols)

    def _in_parameters(self, *laws: Expr) -> tuple[tuple[Expr, ...], tuple[Symbol, ...]]:
        """Laws without derived quantities and abbreviations, and the symbols in them."""
        if laws not in self.read:
            explicit = tuple(in_full(law.xreplace(self._derived)) for law in laws)
            symbols = frozenset().union(*(law.free_symbols for law in explicit))
            self.read[laws] = explicit, tuple(symbol for symbol in self._symbols if symbol in symbols)
        return self.read[laws]


Work = Callable[[Component, Mapping[str, Any], Choices], T]


class Shared(Generic[T]):
    """A result for each class of parts, pattern of zeros, laws and choices of modes.

    A part may look at its own numbers besides, as a shaft does for a mesh that suits its length. What it reads is
    noted, and a part that differs in any of that gets a result of its own.

    Args:
        work: makes the result of a part, its values in SI and the choices of its modes.
    """

    def __init__(self, work: Work[T]) -> None:
        self._work = work
        self._results: dict[Any, list[tuple[Mapping[str, Any], T]]] = {}

    def of(self, part: Component, values: Mapping[str, Any], choices: Choices = ()) -> tuple[T, Mapping[str, Any]]:
        """The result for a part, and what was read of such a part besides; arguments as of `work`."""
        pattern = tuple((float, bool(value)) if isinstance(value, float) else value for value in values.values())
        results = self._results.setdefault((type(part), pattern, choices), [])
        for read, result in results:
            if all(_same(getattr(part, name), value) for name, value in read.items()):
                return result, read
        read = dict[str, Any]()
        result = self._work(_noting(part, read), values, choices)
        results.append((read, result))
        return result, read


def _same(first: Any, second: Any) -> bool:
    try:
        return first is second or bool(first == second)
    except Exception:  # noqa: BLE001 (arrays, quantities of other units: whatever does not compare is another value)
        return False


def _noting(part: Component, read: dict[str, Any]) -> Component:
    """A copy of a part that notes which of its own values are read."""
    cls, fields = type(part), frozenset(part.__dataclass_fields__)

    def __getattribute__(self: Any, name: str) -> Any:  # noqa: N807
        if name in fields:
            read[name] = cls.__getattribute__(self, name)
        elif name == "__dict__":
            read.update({field: cls.__getattribute__(self, field) for field in fields})
        return cls.__getattribute__(self, name)

    noting = copy.copy(part)
    members = {"__getattribute__": __getattribute__, "declared": cls.declared, "__doc__": cls.__doc__}
    object.__setattr__(noting, "__class__", type(cls.__name__, (cls,), members))
    return noting
