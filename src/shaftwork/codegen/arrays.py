"""The right-hand side as array code: a sparse matrix for the linear part beside the few nonlinear rows. Any size."""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy import sparse

from shaftwork.codegen.elements import Array
from shaftwork.codegen.inputs import Inputs
from shaftwork.codegen.matrices import LinearPart, MatrixAssembly
from shaftwork.reduction.form import StateForm


class ArrayProgram:
    """Right-hand side, Jacobian and recovery of every branch quantity, for any parameter vector.

    Args:
        form: a state form without algebraic loops.
    """

    def __init__(self, form: StateForm) -> None:
        laws = form.outputs
        self.form = form
        self.assembly = MatrixAssembly(form, laws)
        self.inputs = Inputs(form, self.assembly.inputs.tolist(), laws)
        self._reading = self.inputs.reading()

    def bind(self, p: Array) -> BoundArrays:
        """The program with its matrices made for one parameter vector."""
        return BoundArrays(self, np.array(p, dtype=float), self.assembly(p))


class BoundArrays:
    """An `ArrayProgram` for one parameter vector."""

    def __init__(self, program: ArrayProgram, p: Array, part: LinearPart) -> None:
        self.program, self.p, self.part = program, p, part
        self._has_slopes = bool(part.B1.nnz)

    def values(self, t: Any, x: Array) -> tuple[Array, Array]:
        """Outputs y and inputs u at states x, (n,) or (n, k) with t (k,)."""
        inputs, part = self.program.inputs, self.part
        zero = np.zeros((inputs.outputs, *x.shape[1:]))
        y = part.C @ x
        if part.D.nnz:  # only inputs that depend on time alone reach the outputs, otherwise there is an algebraic loop
            first = inputs.values(t, zero, x, self.p)
            y = y + part.D @ (first * _column(inputs.of_time, x))
        return y, inputs.values(t, y, x, self.p)

    def rhs(self, t: Any, x: Array) -> Array:
        """x' at time t, (n,); or (n, k) for states (n, k) at times (k,)."""
        y, u = self.values(t, x)
        rate: Array = self.part.A @ x + self.part.B @ u
        if self._has_slopes:
            rate = rate + self.part.B1 @ self.program.inputs.time_slopes(t, y, x, self.p)
        return rate

    def jacobian(self, t: float, x: Array) -> Any:
        """d rhs / d x as scipy.sparse.csc_array (n, n)."""
        inputs, part = self.program.inputs, self.part
        y, _ = self.values(t, x)
        by_output, outputs, by_integral, states = self.program._reading
        across = inputs.across_slopes(t, y, x, self.p)[by_output]
        integral = inputs.integral_slopes(t, y, x, self.p)[by_integral]
        size = (inputs.size, inputs.states)
        slope = sparse.csr_array((across, (by_output, outputs)), shape=(inputs.size, inputs.outputs)) @ part.C
        slope = slope + sparse.csr_array((integral, (by_integral, states)), shape=size)
        return sparse.csc_array(part.A + part.B @ slope)

    def impulse(self, t: float, x: Array, before: float | None = None) -> Array:
        """The states after the inputs have jumped (impulses through rigid joints).

        Args:
            t: time after the jump.
            x: (n,) states before it.
            before: time before it; without it all inputs were zero.
        """
        if not self._has_slopes:
            return x
        inputs, zero = self.program.inputs, np.zeros(self.program.inputs.outputs)
        step = inputs.values(t, zero, x, self.p)
        if before is not None:
            step = step - inputs.values(before, zero, x, self.p)
        return np.asarray(x + self.part.B1 @ (step * inputs.of_time))


def _column(mask: Any, like: Array) -> Any:
    return mask.reshape(-1, *([1] * (like.ndim - 1)))
