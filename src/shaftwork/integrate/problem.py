"""What an engine is given and what it returns: plain arrays and functions, no symbols."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from shaftwork.core.errors import SimulationError
from shaftwork.numerics.zeros import around

Array = NDArray[np.float64]
Cached = TypeVar("Cached")
Explain = Callable[[Array, Array], SimulationError | None]


class Fractions(NamedTuple):
    """The system x' = A x + G v(t) without any rounding but that of its parameters and inputs.

    Args:
        A: (n, n) full array of `fractions.Fraction`.
        G: (n, m) the same.
        inputs: v(t), (m,) floats.
    """

    A: Any
    G: Any
    inputs: Callable[[float], Array]


class Observed(NamedTuple):
    """The speeds of a linear network, what passes through its branches, and what laws leave of that.

    Args:
        values: from times (k,) and states (k, n) to (k, m): across, through, and what should be zero.
        kinds: (m,) their units; "" of a multiplier of a coupling, which counts against all that passes through.
        names: (m,) their parts.
        direct: (m,) whether a value is a speed or a state; what dampers give is a difference times their d.
        inner: (m,) whether a value passes through one of several branches side by side in a part.
        first_through: number of the first value that passes through a branch.
        first_left: number of the first value that should be zero.
    """

    values: Callable[[Array, Array], Array]
    kinds: tuple[str, ...]
    names: tuple[str, ...]
    direct: Any
    inner: Any
    first_through: int
    first_left: int


@dataclass(frozen=True)
class LinearInputs:
    """A linear system x' = A x + u(t) whose input is smooth between its breakpoints.

    Args:
        A: (n, n) scipy.sparse.csr_array, 1/s times the units of the states.
        forcing: u(t), shape (n,), or (n, k) at times (k,); evaluated strictly inside a piece it is that piece's own.
        fractions: makes the same system without rounding, or None where there is no such form.
        straight: whether u is a straight line between breakpoints.
    """

    A: Any
    forcing: Callable[[Any], Array]
    fractions: Callable[[], Fractions | None] = lambda: None
    straight: bool = True
    _cache: dict[str, tuple[object, Any]] = field(default_factory=dict, init=False, repr=False, compare=False)

    def cached(self, name: str, make: Callable[[], Cached], key: object = None) -> Cached:
        """What engines make of the system, for the next run with the same parameters; for the last key of a name."""
        entry = self._cache.get(name)
        if entry is None or entry[0] != key:
            entry = self._cache[name] = key, make()
        value: Cached = entry[1]
        return value


class MachineRates(NamedTuple):
    """A right-hand side in machine code, with its parameters.

    Args:
        rates: compiled by numba: (t, x (n,), p (parameters,), dx (n,)) writes dx.
        watched: the same, (t, x, p, values (m,)): guards, and behind them switches.
        guards: how many of these are guards.
        switches: how many are switches.
        values: from the parameters of the model to those of the code.
        p: the latter.
    """

    rates: Any
    watched: Any
    guards: int
    switches: int
    values: Callable[[Array], Array]
    p: Array


@dataclass(frozen=True)
class Guards:
    """What ends a phase of a motion.

    Args:
        values: from times (k,) and states (k, n) to (k, m).
        sides: (m,) 1 where the rise of a value through zero ends the phase, -1 where its fall does, 0 where neither.
        offsets: (m,) how far it has to go beyond zero: more than rounding moves it, or it would end where it begins.
        sizes: (m,) of the values where the phase begins.
    """

    values: Callable[[Array, Array], Array]
    sides: Array
    offsets: Array
    sizes: Array


class Reset(NamedTuple):
    """How a run goes on past a guard in the same equations.

    Args:
        p: (p,) what the program is made of from there on.
        ends: number and side of each guard that ends the phase from there on.
        offsets: (m,) of all guards.
        equations: makes the right-hand side from there on.
        x: (n,) the first states, where they are others than those in which the guard was met.
    """

    p: Array
    ends: Sequence[tuple[int, float]]
    offsets: Sequence[float]
    equations: Callable[[], Callable[[float, Array], Array]]
    x: Array | None = None


# An engine with a tolerance may be off by this many times of it, 1e-6 at the usual one: errors add up over its steps.
TOLERATED = 100.0
# The error of as many steps as a run has taken is no surprise either, up to this part.
UNSURPRISING = 1e-6


class SeriesError(SimulationError):
    """A Taylor series does not show the motion, and another engine may go on.

    Its terms are not finite, where the motion runs away or a law is not smooth, sqrt at 0; or it has hidden a guard.

    Args:
        message: of the error.
        obstacle: what is in the way, without the next step.
    """

    def __init__(self, message: str, obstacle: str = "a law is not smooth where the motion passes") -> None:
        super().__init__(message)
        self.obstacle = obstacle


class StickingError(SeriesError):
    """A motion sticks where laws on both sides drive it back, or only touches the place: another engine can tell.

    Args:
        message, obstacle: as for `SeriesError`.
        driven_back: whether both sides drive it back there, so that no engine goes on.
    """

    def __init__(self, message: str, obstacle: str, *, driven_back: bool) -> None:
        super().__init__(message, obstacle)
        self.driven_back = driven_back


class PastGuards(Protocol):
    """How a run goes on past guards; only engines that gain by it ask."""

    def __call__(self, number: int, met: int, t: float, x: Array) -> Reset | None:
        """How it goes on in the same equations with the same state, or None where it must end.

        Args:
            number: of guards met before.
            met: the guard.
            t: time, s.
            x: (n,) state.
        """
        ...

    def refuse_missed(self, met: int | None, t: float, x: Array) -> None:
        """Where a run has ended, look whether it has passed a guard unseen, other than the one that ended it.

        Raises:
            SeriesError: it has.
        """
        ...


@dataclass(frozen=True, kw_only=True)
class TimedProblem:
    """What every problem says of its span of time, its states and its run.

    Args:
        x0: (n,) start state.
        t0: start time in s.
        t_end: end time in s, greater than t0.
        names: n state names for messages, such as "J1.omega".
        atol: (n,) absolute tolerances, in the units of the states.
        rtol: relative tolerance.
        breakpoints: strictly increasing times in (t0, t_end) where an input jumps or kinks. An engine ends a step there
            and starts anew; inside a piece it never evaluates the equations at or past the piece's end.
        jump: state after a breakpoint from (breakpoint, state before it), or None where the state is continuous.
        sides: from t0, a breakpoint or t_end to the times in s at which inputs are read just before and just after it.
        guards: what ends the run before `t_end`, or None where nothing does. An engine then returns what it has, up to
            the time at which the first guard is met, located as exactly as its solution allows; see `Trajectory.met`.
        t_eval: strictly increasing output times in [t0, t_end], or None for the engine's own steps. At a breakpoint the
            state after the jump is the output.
        explain: from times (k,) and states (k, n) to the error of the first of these times at which a law has no value,
            or None where all have one.
        max_steps: an engine gives up, with a reason, after this many steps.
        earlier_steps: of the same motion, before this part of it; they are told with the reason.
        progress: told again and again the time in s that an engine has reached, or None. What it raises ends the run.
    """

    x0: Array
    t0: float
    t_end: float
    names: tuple[str, ...]
    atol: Array
    rtol: float = 1e-8
    breakpoints: tuple[float, ...] = ()
    jump: Callable[[float, Array], Array] | None = None
    sides: Callable[[float], tuple[float, float]] = around
    guards: Guards | None = None
    t_eval: Array | None = None
    explain: Explain | None = None
    max_steps: int = 10_000_000
    earlier_steps: int = 0
    progress: Callable[[float], None] | None = None


@dataclass(frozen=True, kw_only=True)
class Problem(TimedProblem):
    """An initial value problem x' = rhs(t, x) on [t0, t_end], smooth between its breakpoints.

    Args:
        rhs: right-hand side, (time, (n,)) to a new (n,) array.
        jacobian: d rhs / d x as a scipy.sparse.csc_array (n, n), or None.
        jacobians: the same from times (k,) and states (k, n), full arrays or sparse, or None.
        switches: what makes the right-hand side jump or bend where its sign changes with the motion, from times (k,)
            and states (k, n) to (k, m), or None where nothing does. An engine ends a step at such a change
            (`Crossings`), or finds it by its own means.
        past_guards: how the run goes on past guards, or None where each of them ends it.
        linear: the same system in linear form, where it is one; else None.
        observed: all quantities of a linear network, or None.
        symbolic: the same system as a heyoka program with its parameters (`codegen.taylor.heyoka.BoundProgram`), a
            function that makes this where an engine asks for it, or None where there is none.
        compiled: makes the same right-hand side in machine code, or None where there is none; or None.
        rough: from times (k,) and states (k, n) to the first time at which any part of a law has no value or no slope,
            be it in a branch that does not hold, and that law in words.
        overall: the size of the largest state where it stays below one: so much smaller is a tolerance for all states.
        estimates: of decay rates by name, which an engine keeps for its next run with these equations.
        rates: the right-hand side from times (k,) and states (k, n) to (k, n), or None where there is only `rhs`.
    """

    rhs: Callable[[float, Array], Array]
    jacobian: Callable[[float, Array], Any] | None
    jacobians: Callable[[Array, Array], list[Any]] | None = None
    switches: Callable[[Array, Array], Array] | None = None
    past_guards: PastGuards | None = None
    linear: LinearInputs | None = None
    observed: Observed | None = None
    symbolic: Any = None
    compiled: Callable[[], MachineRates | None] | None = None
    rough: Callable[[Array, Array], tuple[float, str] | None] | None = None
    overall: float = 1.0
    estimates: dict[str, Any] = field(default_factory=dict, repr=False, compare=False)
    rates: Callable[[Array, Array], Array] | None = None

    @property
    def straight(self) -> LinearInputs | None:
        """The linear form, where there is one and its inputs are straight lines between breakpoints."""
        return self.linear if self.linear is not None and self.linear.straight else None

    @cached_property
    def program(self) -> Any:
        """The heyoka program of `symbolic`, or None: runs of other engines do not even load heyoka."""
        return self.symbolic() if callable(self.symbolic) else self.symbolic

    @cached_property
    def machine(self) -> MachineRates | None:
        """What `compiled` makes, or None."""
        return None if self.compiled is None else self.compiled()


@dataclass(frozen=True, kw_only=True)
class DaeProblem(TimedProblem):
    """An implicit problem residual(t, x, dx/dt) = 0 of index 1 on [t0, t_end]; x holds states and algebraic unknowns.

    The algebraic ones of `x0` are a first guess.

    Args:
        residual: (time, x (n,), dx/dt (n,)) to a new (n,) array.
        derivative0: (n,) first guess of dx/dt at the start.
        algebraic: indices of the unknowns whose derivative does not appear.
        switches: as in `Problem`.
    """

    residual: Callable[[float, Array, Array], Array]
    derivative0: Array
    algebraic: tuple[int, ...]
    switches: Callable[[Array, Array], Array] | None = None


AnyProblem = TypeVar("AnyProblem", bound=TimedProblem)


def changed(problem: AnyProblem, **values: Any) -> AnyProblem:
    """The same problem with other values; `dataclasses.replace` takes longer than many a phase of a motion."""
    copy = object.__new__(type(problem))
    vars(copy).update(vars(problem), **values)
    return copy


def tightened(problem: AnyProblem, share: float) -> AnyProblem:
    """The same problem with a part of its tolerances."""
    return changed(problem, rtol=share * problem.rtol, atol=share * problem.atol)


class DenseOutput(Protocol):
    """The solution between the output times; an engine may make it when it is first asked for."""

    @property
    def steps(self) -> Array:
        """Every time (s,) at which a step ended, t0 first: between two neighbours the solution is smooth."""

    def __call__(self, times: Array) -> Array:
        """States (k, n) at any times (k,) inside [t0, t_end], to about the accuracy of the steps."""


@dataclass(frozen=True)
class Trajectory:
    """What an engine found.

    Args:
        t: (k,) times: `Problem.t_eval`, or the ends of the steps (both sides of a breakpoint with a jump are listed).
        x: (k, n) states.
        dense: the solution at any time; at a breakpoint the state after the jump.
        statistics: counts by name: "steps", "rhs", "jacobians", "switches" as far as the engine knows them.
        doubt: what rounding may have changed, as a part of the largest state of its unit, where the engine can tell.
        remark: a sentence on how the engine has gone about it, where that is out of the ordinary.
        caveat: what makes its numbers worth less than the tolerance says, in a sentence; empty where nothing does.
        met: the guard that ended the run, or None where it went on to `Problem.t_end`.
        end: time in s and state (n,) where the run ended; known of a run with guards.
    """

    t: Array
    x: Array
    dense: DenseOutput
    statistics: Mapping[str, int] = field(default_factory=dict)
    doubt: float = field(default=0.0, kw_only=True)
    remark: str = field(default="", kw_only=True)
    caveat: str = field(default="", kw_only=True)
    met: int | None = field(default=None, kw_only=True)
    end: tuple[float, Array] | None = field(default=None, kw_only=True)

    @property
    def steps(self) -> Array:
        """Every time (s,) at which a step ended, t0 first: between two neighbours `dense` is smooth."""
        return self.dense.steps


class Engine(Protocol):
    """An engine solves a `Problem`, or raises `SimulationError` with the time, the state and the reason.

    It is a function of the problem, and `integrate/engines.py` has an entry for it. It ends a step at every breakpoint
    and goes on from `jump`, as well as where a switch changes its sign. It gives up after `max_steps`, never returns a
    state that is not finite, and calls `progress` after its steps. Where its entry has `following` it ends at the first
    guard that is met. For a method of single steps `stepping.march` does all this. Another loop finds the pieces, their
    first states, functions that are never asked outside them and dense output of the whole run in `smooth_intervals`.
    """

    def __call__(self, problem: Problem) -> Trajectory: ...
