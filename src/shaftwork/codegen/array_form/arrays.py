"""The right-hand side as array code: a sparse matrix for the linear part beside the few nonlinear rows. Any size."""

from __future__ import annotations

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from scipy import sparse
from sympy import Expr

from shaftwork.codegen.array_form.algebraic_loops import LoopSolver
from shaftwork.codegen.array_form.elements import Array, GainMatrix, node_matrix, rationals
from shaftwork.codegen.array_form.inputs import Inputs, where
from shaftwork.codegen.array_form.matrices import LinearPart, MatrixAssembly
from shaftwork.codegen.code import vectorised
from shaftwork.components.branches import ACROSS, INTEGRAL
from shaftwork.components.laws import t as TIME
from shaftwork.formulation.form import StateForm
from shaftwork.network.kinds import Kind


class ArrayProgram:
    """Right-hand side, Jacobian and recovery of every branch quantity, for any parameter vector.

    Args:
        form: the state form.
    """

    def __init__(self, form: StateForm) -> None:
        self.form = form
        self.assembly = MatrixAssembly(form, form.outputs)
        order = self.assembly.inputs.tolist()
        self.inputs = Inputs(form, order)
        solved = tuple(dict.fromkeys((*form.loop_laws, *form.inertial)))
        self.loop_places = np.array([order.index(branch) for branch in solved], dtype=np.intp)
        self.loop_in_tree = np.array([branch in form.tree.tree[Kind.LAW] for branch in solved], dtype=bool)

    def __reduce__(self) -> tuple[Any, ...]:
        return ArrayProgram, (self.form,)  # compiled code cannot be stored

    @cached_property
    def shares(self) -> GainMatrix:
        """(nodes, branches): what passes through the tree branches where a unit is put in at a node."""
        return node_matrix(self.form, self.form.tree.shares)

    def bind(self, p: Array) -> BoundArrays:
        """The program with its matrices made for one parameter vector."""
        return BoundArrays(self, np.array(p, dtype=float), self.assembly(np.asarray(p, dtype=float)))


class BoundArrays:
    """An `ArrayProgram` for one parameter vector.

    Args:
        program: the equations.
        p: parameters.
        part: their matrices.
        full: whether small matrices are multiplied in full: quicker, but what cancels may leave rounding.
    """

    def __init__(self, program: ArrayProgram, p: Array, part: LinearPart, *, full: bool = False) -> None:
        p = p.copy() if p.flags.writeable else p
        p.flags.writeable = False  # so that what laws read of it is looked up once
        self.program, self.p, self.part = program, p, part
        factors: tuple[Any, ...] = part.factors if full else tuple(factor.sparse for factor in part.factors)
        self._A, self._B, self._B1, self._C, self._D = factors
        self._has_slopes, self._controls = bool(part.B1.nnz), program.inputs.controls
        loops = program.loop_places
        form = program.form
        owners = tuple(dict.fromkeys(form.graph.part_of(law).name for law in form.loop_laws)) if form.waves else ()
        self.loops = None
        if loops.size:
            linear = not form.loop_laws
            self.loops = LoopSolver(program.inputs, part, loops, program.loop_in_tree, self.p, owners, linear=linear)

    def __reduce__(self) -> tuple[Any, ...]:
        return _bound_again, (self.program, self.p, self.part, None if self.loops is None else self.loops.last)

    def with_laws(self, p: Array) -> BoundArrays:
        """The same matrices for a parameter vector that differs in the laws alone."""
        return BoundArrays(self.program, p, self.part)

    def values(self, t: Any, x: Array) -> tuple[Array, Array]:
        """Outputs y and inputs u at states x, (n,) or (n, k) with t (k,)."""
        if self.loops is not None:
            return self.loops.values(t, x)
        inputs = self.program.inputs
        y = self._outputs(t, x)
        return y, inputs.values(t, y, x, self.p)

    def full(self) -> tuple[Array, Array, Array] | None:
        """A, B and C in full where x' = A x + B u and y = C x; None where more enters, or where they are large."""
        A, B, _, C, D = self.part.factors
        if self.loops is not None or self._has_slopes or not D.is_zero or A.full is None or B.full is None:
            return None
        return None if C.full is None else (A.full, B.full, C.full)

    @cached_property
    def lines(self) -> tuple[Array, Array]:
        """Impedances in N m s and delays in s (q / 2,) of lossless lines."""
        graph, pairs = self.program.form.graph, []
        for branch in self.program.form.waves[::2]:
            template, places = graph.branches[branch].template, graph.part_of(branch).parameters
            values = [float(self.p[places[symbol.name]]) for symbol in template.symbols]
            pairs.append([vectorised(template.symbols, quantity)(*values) for quantity in template.line or ()])
        impedances, delays = np.array(pairs, dtype=float).T
        return impedances, delays

    def outputs(self, t: Any, x: Array) -> Array:
        """Outputs y alone; arguments as for `values`."""
        return self._outputs(t, x) if self.loops is None else self.values(t, x)[0]

    def _outputs(self, t: Any, x: Array) -> Array:
        """Outputs y where there are no loops."""
        inputs = self.program.inputs
        if not inputs.outputs:
            return np.empty((0, *x.shape[1:]))
        y: Array = self._C @ x[: inputs.states]
        if self.part.D.nnz:  # only inputs of time alone and controlled sources reach the outputs: else there is a loop
            y = y + self._D @ inputs.sources(t, x, self.p)
            if self._controls.size:
                y = y + self._D @ where(inputs.controlled, inputs.values(t, y, x, self.p))
        return y

    def switches(self, t: Array, x: Array) -> Array:
        """What jumps or bends a law where its sign changes, (k, m), at times (k,) and states (k, n)."""
        y = self.outputs(t, x.T)
        return self.program.inputs.switches(t, y, x.T, self.p).T

    @cached_property
    def _constant(self) -> Array | None:
        """What inputs that parameters alone tell add to x'; None where others enter."""
        if self.loops is not None or self._has_slopes or not self.program.inputs.constant:
            return None
        return np.asarray(self._B @ self.values(0.0, np.zeros(self.program.inputs.states))[1])

    def rhs(self, t: Any, x: Array) -> Array:
        """x' at time t, (n,); or (n, k) for states (n, k) at times (k,)."""
        if (constant := self._constant) is not None:
            rate: Array = self._A @ x
            rate += constant if x.ndim == 1 else constant[:, None]
            return rate
        return self.rates(t, x, *self.values(t, x))

    def rates(self, t: Any, x: Array, y: Array, u: Array) -> Array:
        """x' from the states and the inputs that go with them."""
        rate: Array = self._A @ x[: self.program.inputs.states] + self._B @ u
        if self._has_slopes:
            rate = rate + self._B1 @ self.program.inputs.source_rates(t, y, x, self.p)
        return rate

    def jacobian(self, t: float, x: Array) -> Any:
        """d rhs / d x as scipy.sparse.csc_array (n, n)."""
        if self.loops is not None:
            return self.loops.jacobian(t, x)
        A, B, slope = self._with_slopes(t, x)
        return sparse.csc_array(A + B @ slope)

    def jacobians(self, times: Array, states: Array) -> list[Any]:
        """The same at times (k,) and states (k, n): full arrays where they are small, for a fraction of the time."""
        inputs, x = self.program.inputs, states.T
        A, B, _, C, _ = (factor.full for factor in self.part.factors)
        if self.loops is None and not self._controls.size and A is not None and B is not None and C is not None:
            slopes = inputs.along(times, self._outputs(times, x), x, self.p, C, np.eye(inputs.states))
            if np.isfinite(slopes).all():
                return list(A + B @ np.moveaxis(slopes, 2, 0))
        return [self.jacobian(t, state) for t, state in zip(times.tolist(), states, strict=True)]

    def _with_slopes(self, t: float, x: Array) -> tuple[Any, Any, Any]:
        """A, B and the slopes (m, n) of the inputs by the states: of scipy.sparse, or full arrays in half the time."""
        inputs, part, controls = self.program.inputs, self.part, self._controls
        y, _ = self.values(t, x)
        A, B, _, C, _ = (factor.full for factor in part.factors)
        if A is not None and B is not None and C is not None:
            full = inputs.along(t, y, x, self.p, C, np.eye(inputs.states))
            if controls.size:
                full = full + inputs.along(t, y, x, self.p, part.D[:, controls] @ full[controls])
            if np.isfinite(full).all():  # else only the states on which an infinite slope depends are to see it
                return A, B, full
        by_y, by_x = inputs.slopes(t, y, x, self.p)
        slope = by_y @ part.C + by_x
        if controls.size:
            slope = slope + by_y @ (part.D[:, controls] @ slope[controls])
        return part.A, part.B, slope

    def rational(self) -> tuple[Array, Array, Callable[[float], Array]] | None:
        """The equations x' = A x + G v(t) of a linear network without any rounding, v(t) in floats.

        Returns:
            A (n, n) and G (n, m) as fractions, and v; None where laws and nodes make an algebraic loop.
        """
        if self.loops is not None:
            return None
        inputs, part = self.program.inputs, self.program.assembly.rational(self.p)
        x0, y0 = np.zeros(inputs.states), np.zeros(inputs.outputs)
        by_y, by_x = (rationals(slopes.toarray()) for slopes in inputs.slopes(0.0, y0, x0, self.p))
        slope = by_y @ part.C + by_x
        slope = slope + by_y @ (part.D[:, self._controls] @ slope[self._controls])

        def at_rest(t: float) -> Array:
            """u and u' where nothing moves."""
            y, u = self.values(t, x0)
            return np.concatenate([u, inputs.source_rates(t, y, x0, self.p)])

        return part.A + part.B @ slope, np.hstack([part.B, part.B1]), at_rest

    def sources(self, t: float) -> Array:
        """(inputs,) what depends on the time alone at a time in s; zero for other inputs."""
        return self.program.inputs.sources(t, np.zeros(self.program.inputs.states), self.p)

    def law_values(self, branch: int, law: Expr, t: Array, x: Array, across: Any = 0.0) -> Array:
        """(k,) an expression of time, of what is across a branch, its integral and its template's symbols.

        Args:
            branch: its number.
            law: the expression.
            t: (k,) times, s.
            x: (n, k) states.
            across: (k,) what is across the branch, where the expression reads it.
        """
        form, template = self.program.form, self.program.form.graph.branches[branch].template
        angle: Any = x[form.integral_places[branch]] if branch in form.integral_places else 0.0
        names = form.graph.part_of(branch).parameters
        values = self.p[[names[symbol.name] for symbol in template.symbols]]
        return np.asarray(vectorised((TIME, ACROSS, INTEGRAL, *template.symbols), law)(t, across, angle, *values))

    def moving_laws(self, t: float) -> tuple[int, ...]:
        """The branches whose laws change with time at a time."""
        inputs = self.program.inputs
        slopes = inputs.time_slopes(t, np.zeros(inputs.outputs), np.zeros(inputs.states), self.p)
        return tuple(map(int, self.program.assembly.inputs[slopes != 0]))

    def impulse(self, x: Array, before: float | None, after: float) -> Array:
        """The states after the inputs have jumped (impulses through rigid joints).

        Args:
            x: (n,) states before it.
            before: time just before the jump; None where all inputs were zero.
            after: time just after it.
        """
        if not self._has_slopes:
            return x
        inputs = self.program.inputs
        step = inputs.sources(after, x, self.p)
        if before is not None:
            step = step - inputs.sources(before, x, self.p)
        states = x.copy()
        states[: inputs.states] += self._B1 @ step  # what arrives by waves follows the states
        return states


def _bound_again(program: ArrayProgram, p: Array, part: LinearPart, last: Array | None) -> BoundArrays:
    """The program for a parameter vector, whose loops go on from where they were when it was stored."""
    bound = BoundArrays(program, p, part)
    if bound.loops is not None and last is not None:
        bound.loops.start_from(last)
    return bound
