"""Problems with closed solutions, in every form that an engine may ask for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest
import sympy
from scipy import sparse

from shaftwork.codegen.taylor.heyoka import build
from shaftwork.integrate.engines import available
from shaftwork.integrate.problem import Array, LinearInputs, Problem

STEP_TIME, T_END = 1.0, 3.0


@dataclass(frozen=True)
class Case:
    """A linear problem with a step of its input and a jump of its state at `STEP_TIME`, and its solution."""

    problem: Problem
    solution: Callable[[Array], Array]
    asked: list[float]


def make_case(matrix: Array, before: Array, after: Array, kick: Array, start: Array) -> Case:
    """X' = A x + before (after from `STEP_TIME` on, when `kick` is added to x); A regular, diagonalisable."""
    values, vectors = np.linalg.eig(matrix)
    inverse = np.linalg.inv(vectors)

    def flow(state: Array, level: Array, elapsed: Array) -> Array:
        rest = -np.linalg.solve(matrix, level)
        modal = np.exp(np.multiply.outer(elapsed, values)) * (inverse @ (state - rest))
        return (modal @ vectors.T).real + rest

    turned = flow(start, before, np.array([STEP_TIME]))[0] + kick

    def solution(t: Array) -> Array:
        early, late = flow(start, before, t), flow(turned, after, np.maximum(t - STEP_TIME, 0.0))
        return np.where((t < STEP_TIME)[:, None], early, late)

    asked: list[float] = []

    def forcing(t: float) -> Array:
        asked.append(t)
        return before if t < STEP_TIME else after

    time, *symbols = sympy.symbols(f"t x:{start.size}")
    rows = tuple(
        sum(float(matrix[i, j]) * symbols[j] for j in range(start.size))
        + sympy.Piecewise((float(before[i]), time <= STEP_TIME), (float(after[i]), True))
        for i in range(start.size)
    )
    problem = Problem(
        rhs=lambda t, x: matrix @ x + forcing(t),
        jacobian=lambda _t, _x: sparse.csc_array(matrix),
        x0=start,
        t0=0.0,
        t_end=T_END,
        names=tuple(f"J{i}.omega" for i in range(start.size)),
        atol=np.full(start.size, 1e-12),
        breakpoints=(STEP_TIME,),
        jump=lambda _t, x: x + kick,
        t_eval=np.linspace(0.0, T_END, 31),
        linear=LinearInputs(sparse.csr_array(matrix), forcing),
        symbolic=build(tuple(symbols), time, (), rows).bind(np.array([])) if available("heyoka") else None,
    )
    return Case(problem, solution, asked)


@pytest.fixture
def oscillator() -> Case:
    """A lightly damped oscillator of 20 rad/s: not stiff."""
    matrix = np.array([[0.0, 1.0], [-400.0, -0.4]])
    return make_case(matrix, np.array([0.0, 50.0]), np.array([0.0, -80.0]), np.array([0.0, 1.5]), np.array([0.1, 0.0]))


@pytest.fixture
def relaxation() -> Case:
    """Rates of 2000, 30 and 1 per second in a row: stiff."""
    matrix = np.array([[-2000.0, 0.0, 0.0], [30.0, -30.0, 0.0], [0.0, 1.0, -1.0]])
    return make_case(matrix, np.array([2000.0, 0.0, 0.0]), np.array([0.0, 5.0, 0.0]), np.full(3, 0.25), np.zeros(3))
