"""The engine for linear systems: propagation by the matrix exponential, exact at any step."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import pairwise

import numpy as np

from shaftwork.core.errors import ParameterError
from shaftwork.integrate.linear.linear_system import (
    OWN_INTERVALS,
    LinearSystem,
    are_even,
    driven,
    polynomials,
    propagator_of,
    straight_line,
    system_of,
)
from shaftwork.integrate.linear.precise import (
    Nearby,
    PrecisePiece,
    PreciseSystem,
    precise_piece,
    precise_system,
    seconds,
)
from shaftwork.integrate.linear.rounding_errors import WORTH_SAYING, difference, doubt
from shaftwork.integrate.problem import Array, LinearInputs, Problem, Trajectory
from shaftwork.integrate.smooth_intervals import SmoothInterval, both_sides, failure, pieces, piecewise, start_of_piece
from shaftwork.integrate.stiffness import LARGEST_EIGENVALUES, is_chain, is_undamped

# States up to which inputs that are no straight lines are followed mode by mode.
LARGEST_DRIVEN = 600
# `auto` takes the engine up to this estimate of its time in s, and where rounding spoils a run, one in whole numbers is
# made up to it.
LONGEST_EXACT = 10.0


def suits(problem: Problem) -> str:
    """Why `auto` takes this engine for a linear problem; empty where it does not."""
    if problem.straight is not None:
        seconds = cost(problem, problem.straight)
        # of a damped chain the banded engine takes 0.3 s at 1400 states and rtol 1e-8, and this one 4 s
        longest = LONGEST_EXACT / 10
        if seconds > longest and not (is_chain(problem) and not is_undamped(problem)):
            longest = LONGEST_EXACT
        if seconds > longest:
            return ""
        return "The system is linear with inputs of straight pieces, so it is propagated exactly."
    if drivable(problem):
        return "The system is linear with smooth inputs, so its modes are propagated without a step error."
    return ""


def solve(problem: Problem) -> Trajectory:
    """Propagate x' = A x + u(t), from output to output without a step error.

    Law: a small A with well-conditioned modes is solved mode by mode, with u a straight line in each piece, or any
    smooth function, which becomes polynomials that leave out 1e-13 of it. Otherwise u must be a straight line; with
    z = (x, s, 1) and z' = M z, where M holds A and the two coefficients of u, z(t + h) = exp(M h) z(t). A may then be
    singular, defective or stiff.

    Raises:
        ParameterError: the system is not linear, or its forcing is neither straight nor driven mode by mode.
        SimulationError: the motion is unbounded.

    Source: Van Loan, Computing integrals involving the matrix exponential, 1978; Al-Mohy and Higham, Computing the
    action of the matrix exponential, 2011.
    """
    linear = problem.linear
    if linear is None:
        raise ParameterError(
            "The exact engine needs a linear system, and here a law is not linear in speed and angle. "
            "Take the engine 'auto'."
        )
    if not linear.straight and not drivable(problem):
        raise ParameterError(
            "The exact engine takes an input that is no straight line between breakpoints only where the system is "
            f"small (up to {LARGEST_DRIVEN} states), its modes are well conditioned and polynomials resolve the input; "
            "take the engine 'auto'."
        )
    system = system_of(linear)
    trajectory = _propagated(problem, system, _in_floats(problem, system))
    part = doubt(problem, trajectory, _lost(problem, system, trajectory))
    if part <= WORTH_SAYING:
        return replace(trajectory, doubt=part)
    precise = _precise(problem, system)
    if precise is None:
        return replace(trajectory, doubt=_moved_by_rounding(problem, linear, trajectory))
    lost = "it" if part >= 1 else f"a part of {part:.1g} of it"
    remark = f"Floats may lose {lost}, so it is computed in whole numbers of {precise.power.bits} bits."
    try:
        trajectory = _propagated(
            problem, system, lambda piece, x: precise_piece(problem, precise, piece, x, _nearby(problem, system, piece))
        )
    except OverflowError as error:
        raise failure(problem, "exact", problem.t_end, trajectory.x[-1], str(error)) from error
    return replace(trajectory, remark=remark, statistics={"bits": precise.power.bits})


def _moved_by_rounding(problem: Problem, linear: LinearInputs, trajectory: Trajectory) -> float:
    """What rounding may change in a run that is too long for whole numbers, as a part of the largest value of its kind.

    Law: the run is made again with every entry of A one rounding away, up or down at random, and the two differ by
    about as much as either is off. It is 1 where the changed matrix has no modes of use.
    """
    rounded = linear.A.copy()
    rounded.data = rounded.data * (1 + np.finfo(float).eps * np.random.default_rng(0).choice((-1.0, 1.0), rounded.nnz))
    system = LinearSystem(replace(linear, A=rounded))
    if not linear.straight and system.modes is None:
        return 1.0
    problem = replace(problem, progress=None)
    return difference(problem, trajectory, _propagated(problem, system, _in_floats(problem, system)))


def _nearby(problem: Problem, system: LinearSystem, piece: SmoothInterval) -> Nearby:
    """The motion in floats from the node before each time: over so short a time they lose little."""
    level, slope = straight_line(problem, system.forcing, piece)
    modes, scale = system.modes, system.scale
    if modes is None:
        return propagator_of(system, level, slope, dense_form=True).between

    def between(nodes: Array, states: Array, times: Array) -> Array:
        index = np.clip(np.searchsorted(nodes, times, side="right") - 1, 0, nodes.size - 1)
        values = np.empty((times.size, states.shape[1]))
        for k in np.unique(index):
            line = (level + slope * (nodes[k] - nodes[0])) / scale, slope / scale
            values[index == k] = modes.response(states[k] / scale, *line, times[index == k] - nodes[k]) * scale
        return values

    return between


def _lost(problem: Problem, system: LinearSystem, trajectory: Trajectory) -> Array:
    """(n,) what rounding may change in each state.

    Law: A is known to eps |A|, so in the scale of `balance` x is known to c eps |A| t |x|, c the condition of modes.
    """
    turns = max(1.0, system.norm * (problem.t_end - problem.t0))
    size = float(np.linalg.norm(np.abs(trajectory.x / system.scale).max(axis=0, initial=0.0)))
    return np.asarray(np.finfo(float).eps * system.condition * turns * size * system.scale)


def _propagated(
    problem: Problem, system: LinearSystem, span_of: Callable[[SmoothInterval, Array], _ExactInterval | PrecisePiece]
) -> Trajectory:
    """The motion from piece to piece."""
    x = np.asarray(problem.x0, dtype=float)
    spans: list[_ExactInterval | PrecisePiece] = []
    for piece in pieces(problem):
        start = start_of_piece(problem, piece, x)
        with np.errstate(over="ignore", invalid="ignore"):
            span = span_of(piece, start)
        spans.append(span)
        x = span.end
        if problem.progress is not None:
            problem.progress(piece.end)
        if not np.isfinite(x).all():
            raise failure(problem, "exact", piece.end, x, "the motion is unbounded")
    starts = np.array([piece.start for piece in pieces(problem)])
    dense = _ExactDense(spans, starts, system.norm, x.size)
    if problem.t_eval is None:
        t, states = both_sides(problem, [span.times for span in spans], [span.at(span.times) for span in spans])
    else:
        t = np.asarray(problem.t_eval, dtype=float)
        states = dense(t)
    steps = sum(span.times.size - 1 for span in spans if isinstance(span, _ExactInterval))
    return Trajectory(t, states, dense, {"steps": steps})


def _precise(problem: Problem, system: LinearSystem) -> PreciseSystem | None:
    """The system in whole numbers; None where a run would take too long, or inputs are no straight lines."""
    turns = system.norm * (problem.t_end - problem.t0)
    outputs = OWN_INTERVALS if problem.t_eval is None else problem.t_eval.size
    slow = seconds(problem.x0.size, turns, outputs) > LONGEST_EXACT
    return None if slow or problem.straight is None else precise_system(problem, problem.straight)


def reference(problem: Problem) -> Trajectory | None:
    """The motion against which another engine is measured; None where it would take too long or is in doubt itself."""
    linear = problem.linear
    if linear is None or problem.x0.size > LARGEST_EIGENVALUES or not (linear.straight or drivable(problem)):
        return None
    trajectory = solve(problem)
    return trajectory if trajectory.doubt <= WORTH_SAYING else None


def drivable(problem: Problem) -> bool:
    """Whether inputs that are no straight lines can be followed mode by mode."""
    linear = problem.linear
    if linear is None or linear.straight or problem.x0.size > LARGEST_DRIVEN or system_of(linear).modes is None:
        return False
    return _inputs(problem, linear) is not None


def _inputs(problem: Problem, linear: LinearInputs) -> dict[SmoothInterval, Array] | None:
    """Values of the inputs of every piece of a run that resolve them, or None where in one piece none do."""
    spans, duration = pieces(problem), problem.t_end - problem.t0

    def resolved() -> dict[SmoothInterval, Array] | None:
        # inputs of more values, states by nodes, are left to engines that step
        values, left = dict[SmoothInterval, Array](), 10_000_000
        for piece in spans:
            length = piece.end - piece.start
            # where an input is nothing but short blows, the nodes of fewer panels in a run may all lie between these
            fewest = math.ceil(512 * length / duration)
            nodes = polynomials(partial(_inside, linear, piece), length, fewest, left)
            if nodes is None:
                return None
            values[piece], left = nodes, left - nodes.size
        return values

    return linear.cached("inputs", resolved, spans)


def _inside(linear: LinearInputs, piece: SmoothInterval, elapsed: Array) -> Array:
    """The inputs (n, k) at times (k,) after the start of a piece, on its side of jumps."""
    return linear.forcing(np.clip(piece.start + elapsed, piece.low, piece.high))


def prefers_dense(problem: Problem, linear: LinearInputs) -> bool:
    """Whether a dense exponential of A costs less than products of the sparse A with vectors."""
    return _dense_cost(problem) <= _sparse_cost(problem, linear)


def cost(problem: Problem, linear: LinearInputs) -> float:
    """About how many seconds the exact engine takes for a linear problem."""
    return min(_dense_cost(problem), _sparse_cost(problem, linear))


def _dense_cost(problem: Problem) -> float:
    n, intervals = _size(problem)
    # a core does some 1e10 multiplications of dense products a second
    return (30 * float(n) ** 3 * (1 + len(problem.breakpoints)) + intervals * n**2) / 1e10


def _sparse_cost(problem: Problem, linear: LinearInputs) -> float:
    system = system_of(linear)
    # of the truncated Taylor series of `expm_multiply`
    products = 6 * system.norm * (problem.t_end - problem.t0) + 20 * _size(problem)[1]
    # a call takes a core 1e-5 s, and for the entries it does 5e8 multiplications a second
    return float(products * (1e-5 + system.matrix.nnz / 5e8))


def _size(problem: Problem) -> tuple[int, int]:
    return problem.x0.size + 2, OWN_INTERVALS if problem.t_eval is None else problem.t_eval.size


@dataclass(frozen=True)
class _ExactInterval:
    """One piece, propagated.

    Args:
        times: (k,) nodes in s.
        end: (n,) state at the last of them.
        at: states (m, n) at any times (m,) of the piece.
    """

    times: Array
    end: Array
    at: Callable[[Array], Array]


class _ExactDense:
    """The motion at any time of the run.

    Args:
        spans: the pieces.
        starts: of them, s.
        rate: no mode is faster, 1/s.
        size: number of states n.
    """

    def __init__(self, spans: Sequence[_ExactInterval | PrecisePiece], starts: Array, rate: float, size: int) -> None:
        self._spans, self._starts, self._rate, self._size = spans, starts, rate, size

    @cached_property
    def steps(self) -> Array:
        """The nodes, and ever longer steps after the start of a piece: what fades fast there lies between some."""
        return np.unique(np.concatenate([self._graded(span.times) for span in self._spans]))

    def _graded(self, nodes: Array) -> Array:
        first = float(nodes[1] - nodes[0])
        # the shortest is still told from rounding
        halvings = int(np.clip(np.ceil(np.log2(max(1.0, self._rate * first))), 0, 40))
        return np.concatenate([nodes[:1] + first * 0.5 ** np.arange(halvings, 0, -1), nodes])

    def __call__(self, times: Array) -> Array:
        return piecewise(self._starts, [span.at for span in self._spans], self._size, times)


def _in_floats(problem: Problem, system: LinearSystem) -> Callable[[SmoothInterval, Array], _ExactInterval]:
    """The motion in a piece from its first state (n,): in modes, or by exponentials where these are of no use."""
    dense_form = problem.straight is None or prefers_dense(problem, problem.straight)
    modes = system.modes if dense_form else None
    if modes is None:
        return partial(_by_exponentials, problem, system, dense_form=dense_form)
    linear = problem.linear
    inputs = None if linear is None or linear.straight else _inputs(problem, linear)

    def span(piece: SmoothInterval, x: Array) -> _ExactInterval:
        start, scale = x / system.scale, system.scale
        motion: Callable[[Array], Array]  # of times after the start of the piece
        if inputs is None:
            level, slope = straight_line(problem, system.forcing, piece)
            motion = partial(modes.response, start, level / scale, slope / scale)
        else:
            motion = driven(modes, inputs[piece] / scale[:, None, None], start, piece.end - piece.start)

        def at(times: Array) -> Array:
            states = motion(times - piece.start) * scale
            states[times == piece.start] = x  # without the rounding of the way to the modes and back
            return states

        nodes = _nodes(problem, piece, fewest=0 if inputs is None else OWN_INTERVALS)  # a blow may lie between outputs
        return _ExactInterval(nodes, at(np.array([piece.end]))[0], at)

    return span


def _by_exponentials(
    problem: Problem, system: LinearSystem, piece: SmoothInterval, x: Array, *, dense_form: bool
) -> _ExactInterval:
    """The motion in a piece from node to node; times between start from the node before them."""
    times, (level, slope) = _nodes(problem, piece), straight_line(problem, system.forcing, piece)
    propagator = propagator_of(system, level, slope, dense_form=dense_form)
    states = np.empty((times.size, x.size))
    states[0] = x
    for first, count in _equal_steps(times):
        step = (times[first + count] - times[first]) / count
        block = propagator.march(states[first], times[first] - piece.start, step, count)
        states[first + 1 : first + 1 + count] = block
    return _ExactInterval(times, states[-1], partial(propagator.between, times, states))


def _nodes(problem: Problem, piece: SmoothInterval, *, fewest: int = 0) -> Array:
    """The output times in a piece and its ends; the engine's own grid where there are none, or fewer in the run."""
    outputs = np.empty(0) if problem.t_eval is None else np.asarray(problem.t_eval, dtype=float)
    if problem.t_eval is None or outputs.size < fewest:
        share = (piece.end - piece.start) / (problem.t_end - problem.t0)
        return np.linspace(piece.start, piece.end, max(2, int(OWN_INTERVALS * share)) + 1)
    inner = outputs[(outputs > piece.start) & (outputs < piece.end)]
    return np.concatenate([[piece.start], inner, [piece.end]])


def _equal_steps(times: Array) -> Iterator[tuple[int, int]]:
    """Runs (first node, number of steps) of steps that are equal up to the rounding of the times."""
    steps = np.diff(times)
    changes = np.flatnonzero(np.abs(np.diff(steps)) > 4 * np.spacing(np.abs(times).max())) + 1
    runs = list(pairwise([0, *changes.tolist(), steps.size]))[::-1]
    while runs:
        first, last = runs.pop()
        if are_even(times[first : last + 1]):
            yield first, last - first
        else:  # steps that grow by a rounding each
            middle = (first + last) // 2
            runs += [(middle, last), (first, middle)]
