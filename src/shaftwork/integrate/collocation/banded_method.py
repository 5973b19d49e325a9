"""Collocation methods of any number of stages, and their stage equations taken apart into complex shifts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, Literal

import numpy as np
from numpy.polynomial import legendre
from numpy.typing import NDArray

from shaftwork.integrate.problem import Array
from shaftwork.numerics.polynomials import legendre_integrals, radau_nodes, to_integrals, to_legendre

Complex = NDArray[np.complex128]
Family = Literal["radau", "gauss"]

PEAK_POINTS = 201


@dataclass(frozen=True, eq=False)
class ShiftedCollocation:
    """A polynomial u of degree s whose slope meets x' = f(t, x) at s nodes of the step.

    Law: the stage increments Z of one step h solve (1/h) A^-1 Z = f(x + Z). With the eigenvectors T of A^-1 and Z = T W
    this falls apart, for the linear part J of f, into (pole / h - J) W = T^-1 (f - J Z), one equation for each pole.
    The poles are conjugate pairs, so p = s / 2 of them do. The "modes" (s, n) are the real parts of these W above
    their imaginary parts.

    Args:
        nodes: (s,) inside [0, 1].
        poles: (p,) eigenvalues of A^-1 with positive imaginary part.
        to_modes: (s, s) the modes of values at the nodes, by the rows of T^-1.
        turn: (s, s) the modes, each times its pole.
        spread: (s, s) Legendre coefficients of h u' from the modes.
        nodal: (s + 1,) Legendre coefficients of the polynomial that vanishes at the nodes and is 1 at the start.

    Source: Hairer and Wanner, Solving Ordinary Differential Equations II, 1996, sections IV.5 and IV.8.
    """

    nodes: Array
    poles: Complex
    to_modes: Array
    turn: Array
    spread: Array
    nodal: Array

    @property
    def order(self) -> int:
        """Order of u inside the step; the ends of the steps are of about twice that."""
        return self.nodes.size

    def increments(self, theta: Any) -> Array:
        """(k, s) what the modes add to the state at parts theta (k,) of the step."""
        return legendre_integrals(self.spread, _centred(theta)) / 2

    def slopes(self, theta: Any) -> Array:
        """(k, s) the slope h u' from the modes at parts theta (k,) of the step."""
        return np.asarray(legendre.legvander(_centred(theta), self.order - 1) @ self.spread)

    def bump(self, theta: Any) -> Array:
        """(k,) the shape of the leading error of u for a defect of 1 in h u' at the start of the step.

        Added to u it gives one order more and, with Radau's nodes, a slope without jumps between the steps.
        """
        return legendre_integrals(self.nodal[:, None], _centred(theta))[:, 0] / 2

    @cached_property
    def quieting(self) -> complex:
        """The weight w for which F(z) = Re(w / (pole - z)), of the first pole and a real z, is 1 + O(z^2), and O(1/z).

        F(h J) takes stiff parts out of a vector and leaves what a step resolves.
        """
        pole = complex(self.poles[0])
        first, second = 1 / pole, 1 / pole**2
        return complex(*np.linalg.solve([[first.real, -first.imag], [second.real, -second.imag]], [1.0, 0.0]))

    @cached_property
    def peak(self) -> float:
        """Largest value of `bump`."""
        return float(np.abs(self.bump(np.linspace(0.0, 1.0, PEAK_POINTS))).max())

    @cached_property
    def at_start(self) -> Array:
        """(s,) the slope h u' from the modes at the start of the step."""
        return np.asarray(self.slopes(0.0)[0])

    @cached_property
    def at_end(self) -> Array:
        """(2, s) what the modes add to the state over the whole step, and the slope h u' at its end."""
        return np.vstack([self.increments(1.0), self.slopes(1.0)])


@lru_cache
def shifted_collocation(family: Family, stages: int) -> ShiftedCollocation:
    """The method of a family with an even number of stages.

    Args:
        family: "radau" (Radau IIA, order 2 s - 1): stiff motions are damped as they should be. "gauss" (order 2 s):
            keeps the energy of an undamped linear motion, and damps nothing.
        stages: s, even.
    """
    nodal = np.zeros(stages + 1)
    nodal[stages] = 1.0
    if family == "radau":
        points, nodal[stages - 1] = radau_nodes(stages), -1.0
    else:
        points = legendre.leggauss(stages)[0]
    poles, vectors = np.linalg.eig(np.linalg.inv(to_integrals(points) / 2))
    upper = np.flatnonzero(poles.imag > 0)
    rows, pole = np.linalg.inv(vectors)[upper], np.diag(poles[upper])
    shapes = to_legendre(points) @ (vectors * poles)[:, upper]
    return ShiftedCollocation(
        nodes=(points + 1) / 2,
        poles=poles[upper],
        to_modes=np.vstack([rows.real, rows.imag]),
        turn=np.block([[pole.real, -pole.imag], [pole.imag, pole.real]]),
        spread=np.hstack([2 * shapes.real, -2 * shapes.imag]),
        nodal=nodal / legendre.legval(-1.0, nodal),
    )


def _centred(theta: Any) -> Array:
    return 2 * np.atleast_1d(np.asarray(theta, dtype=float)) - 1
