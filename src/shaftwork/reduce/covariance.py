"""Whether a part at the reference shaft does the same as another one behind a gear, tried on its laws."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

from sympy import Expr, Float, Symbol

from shaftwork.components.base import Component
from shaftwork.components.branches import ACROSS, INTEGRAL, THROUGH, End, named_in, readings_in
from shaftwork.components.laws import t
from shaftwork.components.modes import Leave, Mode, ModeChoice, Modes
from shaftwork.core.domains import ELECTRICAL
from shaftwork.network.graph import resolve
from shaftwork.network.kinds import Kind
from shaftwork.network.templates import BranchTemplate, Template, make_template
from shaftwork.numerics.tolerances import TYPED
from shaftwork.reduce.kinematics import Scale

LINEAR = (Kind.ACROSS_STORE, Kind.THROUGH_STORE, Kind.CONDUCTANCE)


def does_the_same(part: Component, referred: Component, scale: Scale) -> bool:
    """Whether the one at the reference shaft has the laws of the other behind a gear, in all modes.

    Law: with across = ratio across' and through' = ratio power through every store, law, coupling and guard agrees.

    Args:
        part: as it is.
        referred: as it is at the reference shaft.
        scale: of its speeds and powers to those of the reference shaft.
    """
    old, new = _PartView.of(part, scale), _PartView.of(referred, Scale())
    if len(old.modes) != len(new.modes):
        return False
    forms = [dict.fromkeys(form for mode in element.options for form in mode.forms) for element in old.modes]
    try:
        guards = all(_guards_agree(old, new, *pair) for pair in zip(old.modes, new.modes, strict=True))
        return guards and all(
            _agree(old.chosen(tuple(map(ModeChoice, chosen))), new.chosen(tuple(map(ModeChoice, chosen))))
            for chosen in product(*forms)
        )
    except (TypeError, ValueError, ArithmeticError):
        return False  # what has no value at the points cannot be compared


@dataclass(frozen=True, eq=False)
class _PartView:
    """A part with the values of its parameters, its branches in one combination of forms, and its scale."""

    part: Component
    scale: Scale
    template: Template

    @classmethod
    def of(cls, part: Component, scale: Scale, choices: tuple[ModeChoice, ...] = ()) -> _PartView:
        return cls(part, scale, make_template(part, resolve(part)[0], choices))

    def chosen(self, choices: tuple[ModeChoice, ...]) -> _PartView:
        return self.of(self.part, self.scale, choices) if choices else self

    @property
    def modes(self) -> tuple[Modes, ...]:
        return self.template.modes

    @cached_property
    def numbers(self) -> Mapping[Symbol, Float]:
        values = resolve(self.part)[0]
        return {Symbol(name, real=True): Float(value) for name, value in values.items() if isinstance(value, float)}

    def value(self, law: Expr, at: Mapping[Symbol, float]) -> float:
        """A law at a point.

        Raises:
            TypeError: it has no real value there.
        """
        values = {**self.numbers, **{symbol: Float(value) for symbol, value in at.items()}}
        return float(law.xreplace(values).evalf())

    def scale_at(self, end: End) -> Scale:
        """What a node of the part is scaled by: nothing in a circuit."""
        ports = (*self.part.ports, *self.part.inner_ports())
        electrical = any(port.name == end and port.domain is ELECTRICAL for port in ports)
        return Scale() if electrical else self.scale

    def scale_of(self, branch: BranchTemplate) -> Scale:
        """What a branch is scaled by, by either of its ends."""
        return next((self.scale_at(end) for end in branch.ends if end is not None), self.scale)

    def ends_beside(self, other: _PartView, branch: BranchTemplate) -> tuple[End | None, ...]:
        """The ends of a branch; an optional port that the other part does not have is left at the frame."""
        ports = {port.name for port in other.part.ports}
        frame = [port.name for port in self.part.ports if port.optional and port.name not in ports]
        return tuple(None if end in frame else end for end in branch.ends)

    def behind(self, symbol: Symbol, at_branch: Scale) -> float:
        """By what an argument of a law at the reference shaft is multiplied to be that of the part as it was.

        Args:
            symbol: the argument.
            at_branch: what the branch of the law is scaled by.
        """
        if symbol in (ACROSS, INTEGRAL):
            return at_branch.ratio
        if symbol == THROUGH:
            return 1 / at_branch.through
        kind, name = named_in(symbol)  # of another port or branch of the part
        if kind == "across":
            return self.scale_at(name).ratio
        if kind:
            scales = (self.scale_of(branch) for branch in self.template.branches if branch.label == name)
            read = next(scales, self.scale)
            return read.ratio if kind == "integral" else 1 / read.through
        return -1.0 if symbol != t and at_branch.ratio < 0 else 1.0  # slipping forward is slipping backward


def _samples(symbols: Sequence[Symbol], modes: Sequence[Modes]) -> Iterator[dict[Symbol, float]]:
    """Each symbol at one point after another, the numbers of modes at all that there are; time is not negative."""
    numbers = {element.symbol: tuple(dict.fromkeys(mode.value for mode in element.options)) for element in modes}
    mode_symbols = [symbol for symbol in symbols if symbol.name in numbers]
    # Arguments at which laws are compared: between them they pass most limits and knees.
    arguments = (0.37, -1.93, 41.7, 0.0083)
    for values in product(*(numbers[symbol.name] for symbol in mode_symbols)):
        for first in range(len(arguments)):
            chosen = {symbol: arguments[(first + k) % len(arguments)] for k, symbol in enumerate(symbols)}
            chosen |= dict(zip(mode_symbols, values, strict=True))
            yield {symbol: abs(value) if symbol == t else value for symbol, value in chosen.items()}


def _agree(old: _PartView, new: _PartView) -> bool:
    return all(
        before.kind is after.kind
        and before.ends == new.ends_beside(old, after)
        and _same_branch(old, new, before, after)
        for before, after in zip(old.template.branches, new.template.branches, strict=True)
    )


def _same_branch(old: _PartView, new: _PartView, before: BranchTemplate, after: BranchTemplate) -> bool:
    if before.terms:
        return _proportional(old, new, before, after)
    scale = old.scale_of(before)
    square = scale.ratio * scale.through
    if before.line is not None and after.line is not None:
        pairs = zip(before.line, after.line, (square, 1.0), strict=True)
        return all(_close(new.value(b, {}), factor * old.value(a, {})) for a, b, factor in pairs)
    factor = square if before.kind in LINEAR else scale.through
    if before.kind is Kind.ACROSS_SOURCE:
        factor = 1 / scale.ratio
    laws = _evaluated(old, new, (before.law, after.law), (ACROSS, INTEGRAL, t), scale)
    return all(_close(now, factor * was) for was, now in laws)


def _evaluated(
    old: _PartView, new: _PartView, laws: tuple[Expr, Expr], symbols: tuple[Symbol, ...], at_branch: Scale
) -> Iterator[tuple[float, float]]:
    """A law before and after, point by point: there as the part was, here with what its arguments are then."""
    before, after = laws
    arguments = tuple(dict.fromkeys((*symbols, *readings_in(after), *_modes_in(after))))
    for at in _samples(arguments, old.modes):
        there = {symbol: value * old.behind(symbol, at_branch) for symbol, value in at.items()}
        yield old.value(before, there), new.value(after, at)


def _modes_in(law: Expr) -> tuple[Symbol, ...]:
    symbols = (symbol for symbol in law.free_symbols if str(symbol.name).partition("_")[0] == "mode")
    return tuple(sorted(symbols, key=lambda symbol: str(symbol.name)))


def _proportional(old: _PartView, new: _PartView, before: BranchTemplate, after: BranchTemplate) -> bool:
    """Whether a coupling asks for the same speeds, and shares the same torques."""
    ends = [(plus if plus is not None else minus) for _, plus, minus in before.terms]
    scales = [old.scale_at(end) for end in ends]
    for laws, others, factors in (
        (before.terms, after.terms, [end_scale.ratio for end_scale in scales]),
        (before.balances, after.balances, [end_scale.through for end_scale in scales]),
    ):
        was = [old.value(law, {}) * factor for (law, *_), factor in zip(laws, factors, strict=True)]
        now = [new.value(law, {}) for law, *_ in others]
        if not all(_close(one * was[0], other * now[0]) for one, other in zip(now, was, strict=True)):
            return False
    return True


def _close(one: float, other: float) -> bool:
    return math.isclose(one, other, rel_tol=TYPED)


def _guards_agree(old: _PartView, new: _PartView, before: Modes, after: Modes) -> bool:
    """Whether each mode ends where the same one ended; forward and backward are exchanged where the part turns."""
    end = before.ends[0] if before.ends else old.part.ports[0].name
    at_ends = old.scale_at(end)
    backwards = at_ends.ratio < 0
    twins = {mode.name: after[_turned_mode(mode, after).name if backwards else mode.name] for mode in before.options}

    def agree(leave: Leave, other: Leave) -> bool:
        laws, symbols = (leave.when, other.when), (ACROSS, THROUGH, INTEGRAL, t)
        to = twins[leave.to].name if leave.to in twins else leave.to
        return other.to == to and _same_sign(_evaluated(old, new, laws, symbols, at_ends))

    for mode in before.options:
        left = list(twins[mode.name].leaves)
        for leave in mode.leaves:
            match = next((other for other in left if agree(leave, other)), None)
            if match is None:
                return False
            left.remove(match)
        if left:
            return False
    return True


def _turned_mode(mode: Mode, after: Modes) -> Mode:
    """Of slipping forward slipping backward; a mode without a direction itself."""
    opposite = (other for other in after.options if (other.value, other.form) == (-mode.value, mode.form))
    return next(opposite, mode) if mode.value else mode


def _same_sign(pairs: Iterable[tuple[float, float]]) -> bool:
    """Whether a guard is a positive multiple of another one."""
    factors: list[float] = []
    for was, now in pairs:
        if was == 0 or now == 0:
            if was != now:
                return False
            continue
        factors.append(now / was)
    return all(factor > 0 and _close(factor, factors[0]) for factor in factors)
