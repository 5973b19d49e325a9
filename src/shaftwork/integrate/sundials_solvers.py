"""The solvers of SUNDIALS as runs use them: opened at the start of a piece, and read inside their last step."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from shaftwork.core.calls import unprinted
from shaftwork.core.notices import FILTERS
from shaftwork.integrate.engines import ENGINES
from shaftwork.integrate.problem import Array, DaeProblem, Problem
from shaftwork.integrate.smooth_intervals import GuardedFunctions, SmoothInterval, failure
from shaftwork.numerics.polynomials import Interpolant, interpolation_times
from shaftwork.numerics.tolerances import CLEARANCE

Method = Literal["BDF", "Adams"]

# SUNDIALS interpolates inside a step by a polynomial of at most this degree.
DEGREES = {"BDF": 5, "Adams": 12}
FINEST = ENGINES["sundials"].finest


@dataclass(frozen=True)
class OpenedSolver:
    """A SUNDIALS solver at the start of a piece.

    Args:
        solver: CVODE or IDA, with its first step still to take.
        start: (n,) consistent start state.
        guard: what CVODE calls.
        outgrown: whether the solver must be opened anew, because its pattern misses entries of the Jacobian.
        degree: of its polynomials inside a step, at most.
    """

    solver: Any
    start: Array
    guard: GuardedFunctions | None = None
    outgrown: Callable[[], bool] = lambda: False
    degree: int = DEGREES["BDF"]

    def inside(self, times: Array) -> Array:
        """States (k, n) at times (k,) inside the last step."""
        return np.array([self.solver.step(time).y.copy() for time in times]).reshape(times.size, self.start.size)


class StepInside:
    """The states inside the last step: for many times from a polynomial, as each costs a call of SUNDIALS.

    Args:
        opened: the solver.
        start: of the step, s.
        x: (n,) state there.
        end: of the step, s.
        y: (n,) state there.
    """

    def __init__(self, opened: OpenedSolver, start: float, x: Array, end: float, y: Array) -> None:
        self._opened, self._ends, self._states = opened, (start, end), (x, y)
        self._polynomial: Interpolant | None = None

    def __call__(self, times: Array) -> Array:
        if self._polynomial is None:
            if times.size < self._opened.degree - 1:
                return self._opened.inside(times)
            (start, end), (x, y) = self._ends, self._states
            inner = self._opened.inside(interpolation_times(start, end, self._opened.degree)[1:-1])
            self._polynomial = Interpolant(start, end, np.vstack([x, inner, y]))
        return self._polynomial(times)


class JacobianPattern:
    """The places of the Jacobian's entries in one run: they grow when a law starts to act, a stop that is hit.

    Args:
        size: number of states.
    """

    def __init__(self, size: int) -> None:
        self._size = size
        # An entry is known by its place along the columns. The diagonal belongs to the matrices that SUNDIALS makes.
        self._places = np.arange(size, dtype=np.int64) * (size + 1)
        self._frozen = self._places
        self._last: tuple[Any, Any, NDArray[np.intp], NDArray[np.bool_]] | None = None

    @property
    def grown(self) -> bool:
        """Whether entries were met that the frozen pattern has not."""
        return self._frozen.size != self._places.size

    def add(self, matrix: Any) -> NDArray[np.int64]:
        """Add the places of a matrix, a scipy.sparse.csc_array (n, n); they are returned."""
        columns = np.repeat(np.arange(self._size, dtype=np.int64), np.diff(matrix.indptr))
        places: NDArray[np.int64] = columns * self._size + matrix.indices
        self._places = np.union1d(self._places, places)
        return places

    def freeze(self) -> Any:
        """Fix the pattern for a solver: a scipy.sparse.csc_array (n, n) of ones."""
        self._frozen, self._last = self._places, None
        columns, rows = np.divmod(self._frozen, self._size)
        # SUNDIALS is built with int indices and reads these arrays as they lie in memory.
        starts = np.searchsorted(columns, np.arange(self._size + 1)).astype(np.int32)
        return sparse.csc_array((np.ones(rows.size), rows.astype(np.int32), starts), shape=(self._size, self._size))

    def values(self, matrix: Any) -> Array:
        """The entries of a matrix in the order of the frozen pattern; those that it has elsewhere are left out."""
        last = self._last
        if last is None or not (np.array_equal(last[0], matrix.indptr) and np.array_equal(last[1], matrix.indices)):
            places = self.add(matrix)
            cells = np.minimum(np.searchsorted(self._frozen, places), self._frozen.size - 1)
            last = self._last = matrix.indptr, matrix.indices, cells, self._frozen[cells] == places
        data = np.zeros(self._frozen.size)
        data[last[2][last[3]]] = matrix.data[last[3]]
        return data


def open_cvode(
    problem: Problem, piece: SmoothInterval, x: Array, method: Method, pattern: JacobianPattern
) -> OpenedSolver:
    """CVODE at the start of a piece, in a state x (n,)."""
    from sksundae.cvode import CVODE

    guard = GuardedFunctions(problem, piece)

    def rhs(t: float, y: Array, derivative: Array) -> None:
        derivative[:] = guard.rhs(t, y)

    options: dict[str, Any] = {"method": method, "rtol": max(problem.rtol, FINEST), "atol": problem.atol}
    if problem.jacobian is not None:
        options |= _linear_solver(guard, piece, x, pattern)
    least = CLEARANCE * float(np.spacing(abs(piece.start)))
    if _first_change(problem, x, guard.rhs(piece.start, x)) < least:
        options["first_step"] = least
    with FILTERS, warnings.catch_warnings():
        # It says that the pattern is only used as a pattern, since the Jacobian is given.
        warnings.filterwarnings("ignore", message="Custom sparse Jacobian")
        solver = CVODE(rhs, **options)
    solver.init_step(piece.start, x)
    return OpenedSolver(solver, x, guard, lambda: pattern.grown, DEGREES[method])


def _first_change(problem: Problem, x: Array, rates: Array) -> float:
    """The time in s in which a state (n,) moves by its tolerance or a tenth of itself.

    SUNDIALS takes no longer first step, and the time would stand still where a light wheel at rest is hit.
    """
    with np.errstate(all="ignore"):
        return float(np.min((problem.atol + 0.1 * np.abs(x)) / np.abs(rates), initial=np.inf))


def _linear_solver(
    guard: GuardedFunctions, piece: SmoothInterval, x: Array, pattern: JacobianPattern
) -> dict[str, Any]:
    # Up to here a dense factorisation beats SuperLU. A band solver is not used: the binding passes its Jacobian as a
    # full matrix, which costs more than the factorisation saves.
    if x.size <= 100:

        def fill_dense(t: float, y: Array, _: Array, full: Array) -> None:
            full[:] = guard.dense_jacobian(t, y)

        return {"linsolver": "dense", "jacfn": fill_dense}
    pattern.add(guard.jacobian(piece.start, x))
    order = pattern.freeze()

    def fill_sparse(t: float, y: Array, _: Array, data: Array) -> None:
        data[:] = pattern.values(guard.jacobian(t, y))

    return {"linsolver": "sparse", "sparsity": order, "jacfn": fill_sparse}


def open_ida(problem: DaeProblem, piece: SmoothInterval, x: Array) -> OpenedSolver:
    """IDA at the start of a piece, in consistent values that it finds near x (n,).

    Raises:
        SimulationError: it finds none.
    """
    from sksundae.ida import IDA

    def residual(t: float, y: Array, derivative: Array, values: Array) -> None:
        values[:] = problem.residual(piece.inside(t), y, derivative)

    solver = IDA(
        residual,
        rtol=max(problem.rtol, FINEST),
        atol=problem.atol,
        algebraic_idx=list(problem.algebraic),
        calc_initcond="yp0",
        calc_init_dt=1e-3 * (piece.end - piece.start),
    )
    try:
        with unprinted():
            start = solver.init_step(piece.start, x, problem.derivative0)
    except RuntimeError as error:
        reason = f"IDA found no consistent initial values ({error})"
        raise failure(problem, "sundials", piece.start, x, reason) from error
    return OpenedSolver(solver, start.y.copy())
