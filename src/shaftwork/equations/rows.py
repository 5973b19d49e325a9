"""One equation each: it knows its parts, branches and nodes, and becomes sympy when it is first read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from sympy import Add, Eq, Expr, Symbol

from shaftwork.equations.assembly import FactoredTerms, Sides


@dataclass(frozen=True, eq=False)
class Row:
    """One equation and where it comes from.

    Args:
        parts: names of the parts that take part, in the order of the network.
        branches: their branches.
        nodes: names of the nodes concerned.
        make: makes both sides; called when the row is first read.
    """

    parts: tuple[str, ...]
    branches: tuple[int, ...]
    nodes: tuple[str, ...]
    make: Callable[[], Sides]

    @cached_property
    def sides(self) -> Sides:
        """Left side, and the groups of terms on the right, as they are printed."""
        return self.make()

    @property
    def left(self) -> Expr:
        """The left side."""
        return self.sides.left

    @property
    def groups(self) -> tuple[FactoredTerms, ...]:
        """The right side as groups of terms under a common factor."""
        return self.sides.groups

    @cached_property
    def right(self) -> Expr:
        """The right side as one expression."""
        return Add(*(factor * Add(*terms) for factor, terms in self.groups))

    @property
    def equation(self) -> Eq:
        """Left side = right side."""
        return Eq(self.left, self.right, evaluate=False)

    @property
    def expression(self) -> Expr:
        """Right side less left side; zero where the equation holds."""
        return self.right - self.left

    @property
    def trivial(self) -> bool:
        """Whether both sides are the same symbol, so that there is nothing to print."""
        return bool(self.expression == 0)


@dataclass(frozen=True, eq=False)
class NodeEquation(Row):
    """The balance at a node. `expression` is the sum of all that it receives, which is zero (Popenda 2019, (1)-(3)).

    Args:
        node: name of the node.
        taken: makes `coefficients`.
    """

    node: str
    taken: Callable[[], Mapping[int, Expr]]

    @cached_property
    def coefficients(self) -> Mapping[int, Expr]:
        """For each branch the factor with which it takes its through variable from the node: 1, -1 or a ratio."""
        return self.taken()


@dataclass(frozen=True, eq=False)
class LoopEquation(Row):
    """Speed around the fundamental loop of a link (Popenda 2019, (4)).

    Args:
        link: the link's branch number.
        summed: makes `coefficients`.
    """

    link: int
    summed: Callable[[], tuple[tuple[int, Expr], ...]]

    @cached_property
    def coefficients(self) -> Mapping[int, Expr]:
        """For each tree branch of the loop the factor with which its across variable enters."""
        return dict(self.summed())


@dataclass(frozen=True, eq=False)
class LawEquation(Row):
    """The law of a branch, or of the parallel branches of a part; that of an across store is in its node's balance."""


@dataclass(frozen=True, eq=False)
class CouplingEquation(Row):
    """What an ideal coupling imposes on the speeds of its nodes."""


@dataclass(frozen=True, eq=False)
class StateEquation(Row):
    """The rate of a state.

    Args:
        name: name of the state.
        symbol: its symbol.
        unit: its SI unit.
        solved: makes `explicit`.
        make_coupled: makes `coupled`.
    """

    name: str
    symbol: Symbol
    unit: str
    solved: Callable[[], bool]
    make_coupled: Callable[[], Sides]

    @cached_property
    def explicit(self) -> bool:
        """False where more rates are coupled than are solved symbolically; the left side then holds them all."""
        return self.solved()

    @cached_property
    def coupled(self) -> Sides:
        """The row before it is solved: where several rates stand in it, it is far shorter so."""
        return self.make_coupled()

    @property
    def rate(self) -> Expr:
        """d(state)/dt, where the row is explicit; else what the coupled rates on the left side sum up to."""
        return self.right


@dataclass(frozen=True, eq=False)
class Eliminated(Row):
    """A quantity that is no state although it might have been, or is algebraic, and how it follows.

    Args:
        what: name of the quantity.
        why: the reason in words.
        kind: "speed" (of a geared store or node), "torque" (of a store in series), "algebraic" or "reaction".
    """

    what: str
    why: str
    kind: Literal["speed", "torque", "algebraic", "reaction"]
