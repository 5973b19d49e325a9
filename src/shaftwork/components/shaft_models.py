"""How a long shaft becomes finitely many speeds and torques: the exchangeable models of a `Shaft`.

Every model but the wave is the same construction. The speeds omega_j stand at nodes x_j, each with a share of the
shaft's inertia; the torques tau_k stand at stations y_k, each with a share of its length and so of its compliance. One
matrix of weights w joins them, in both equations:

    d(tau_k)/dt / (C' / l_k) = sum_j w_kj omega_j,     J' h_j d(omega_j)/dt = - sum_k w_kj tau_k + torque at the ends.

Because it is the same matrix, the energy of the shaft changes by the powers at its two ends and by nothing else,
whatever the weights are.
"""

from __future__ import annotations

import ast
import reprlib
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np
from numpy.polynomial.legendre import Legendre, leggauss, legvander

from shaftwork.core.errors import ParameterError

MOST_ELEMENTS = 100_000
"""Elements of a model; more is a typing error."""
MOST_SPECTRAL = 200
"""Degree up to which the nodes and weights are right to rounding; beyond it, join several shafts."""


@dataclass(frozen=True, eq=False)
class Mesh:
    """A shaft of unit length as speeds at nodes and torques at stations.

    Args:
        nodes: (n,) places of the speeds, from 0 to 1.
        inertias: (n,) share of the inertia at each; they sum to 1.
        stations: (k,) places of the torques.
        lengths: (k,) share of the length, and so of the compliance, of each; they sum to 1.
        weights: for each torque the nodes and factors that its rate of twist is the sum of.
    """

    nodes: tuple[float, ...]
    inertias: tuple[float, ...]
    stations: tuple[float, ...]
    lengths: tuple[float, ...]
    weights: tuple[tuple[tuple[int, float], ...], ...]


@dataclass(frozen=True)
class ShaftModel:
    """Base of the models."""

    purpose: ClassVar[str] = ""

    @classmethod
    def read(cls, text: Any) -> ShaftModel:
        """A model from its text, such as "Lumped(20)" or "CentralDifference(m=40, order=4)".

        Raises:
            ParameterError: it is no model.
        """
        known = {model.__name__: model for model in MODELS}
        listed = f"The models are: {', '.join(known)}; write for example Lumped(20)."
        match _call(text):
            case (name, values, named) if name in known:
                try:
                    return known[name](*values, **named)
                except TypeError:
                    pass
        raise ParameterError(f"{reprlib.repr(text)} is no shaft model. {listed}")

    def mesh(self) -> Mesh:
        """The nodes, stations and weights."""
        return _mesh_of(self)

    def _mesh(self) -> Mesh:
        raise ParameterError(f"{self!r} has no mesh.")


def _call(text: Any) -> tuple[str, list[Any], dict[str, Any]] | None:
    """A call such as "Lumped(20)" as name, values and named values, None where it is not one of plain values."""
    try:
        call = ast.parse(text, mode="eval").body
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name):
            named = {str(item.arg): ast.literal_eval(item.value) for item in call.keywords}
            return call.func.id, [ast.literal_eval(value) for value in call.args], named
    except (SyntaxError, ValueError, TypeError, RecursionError, MemoryError):
        pass
    return None


@lru_cache(maxsize=32)
def _mesh_of(model: ShaftModel) -> Mesh:
    return model._mesh()  # noqa: SLF001 (the same class, made once for equal models)


@dataclass(frozen=True)
class Rigid(ShaftModel):
    """No twist: the inertia of the shaft moves as one with what is at its ends."""

    purpose: ClassVar[str] = "no twist; the shaft's inertia stays"


@dataclass(frozen=True)
class OneSpring(ShaftModel):
    """The stiffness of the whole shaft, and no inertia."""

    purpose: ClassVar[str] = "one massless spring"


@dataclass(frozen=True)
class Lumped(ShaftModel):
    """A chain of m springs between m + 1 inertias.

    With half cells at its ends it is of second order in 1/m: an inertia J/m at each inner node, J/(2m) at the ends.
    With full cells it has m + 1 equal inertias and is of first order. Source: Popenda 2019, (1)-(4).

    Args:
        m: number of springs.
        ends: "half" or "full" cells.
    """

    m: int = 20
    ends: str = "half"

    purpose: ClassVar[str] = "chain of m springs, half cells at its ends; second order"

    def __post_init__(self) -> None:
        _whole(self, "m", 1, MOST_ELEMENTS)
        _one_of(self, "ends", ("half", "full"))

    def _mesh(self) -> Mesh:
        m = self.m
        half = 0.5 / m
        full = 1 / (m + 1)
        return Mesh(
            nodes=tuple(k / m for k in range(m + 1)),
            inertias=(half, *[1 / m] * (m - 1), half) if self.ends == "half" else (full,) * (m + 1),
            stations=tuple((k + 0.5) / m for k in range(m)),
            lengths=(1 / m,) * m,
            weights=tuple(((k, 1.0), (k + 1, -1.0)) for k in range(m)),
        )


@dataclass(frozen=True)
class CentralDifference(ShaftModel):
    """Central differences for speed and torque at the same m + 1 equidistant nodes.

    Inside the shaft the equations are (20) and (21) of Popenda 2019 without damping. He leaves the closure at the ends
    open; here it is by summation by parts, which keeps the energy balance exactly: one-sided differences over half a
    cell at order 2, Strand's boundary rows at order 4. Speeds at odd nodes know torques at even ones only, so half of
    the modes are spurious.

    Args:
        m: number of intervals.
        order: 2 or 4.

    Source: Popenda 2019, (16)-(23); Strand, Summation by parts for finite difference approximations for d/dx, 1994.
    """

    m: int = 20
    order: int = 2

    purpose: ClassVar[str] = "speeds and torques at the same nodes; spurious modes"

    def __post_init__(self) -> None:
        _one_of(self, "order", (2, 4))
        _whole(self, "m", 2 if self.order == 2 else 2 * len(_FOURTH_NORM), MOST_ELEMENTS)

    def _mesh(self) -> Mesh:
        m = self.m
        inside, norm, rows = (_SECOND, _SECOND_NORM, _SECOND_ROWS) if self.order == 2 else _FOURTH_ALL
        shares = [1.0] * (m + 1)
        shares[: len(norm)], shares[m + 1 - len(norm) :] = norm, norm[::-1]
        weights = []
        for k in range(m + 1):
            if k < len(rows):
                row = [(j, -q) for j, q in enumerate(rows[k])]
            elif k > m - len(rows):
                row = [(m - j, q) for j, q in enumerate(rows[m - k])][::-1]
            else:
                row = [(k + offset, -q) for offset, q in inside]
            weights.append(tuple((j, weight) for j, weight in row if weight))
        places = tuple(k / m for k in range(m + 1))
        parts = tuple(share / m for share in shares)
        return Mesh(nodes=places, inertias=parts, stations=places, lengths=parts, weights=tuple(weights))


@dataclass(frozen=True)
class Spectral(ShaftModel):
    """One polynomial of degree n for the speed, one of degree n - 1 for the torque.

    The speeds stand at the n + 1 nodes of Gauss and Lobatto, whose quadrature makes the inertia diagonal; the torques
    at the n nodes of Gauss, where the derivative of the speed is evaluated exactly. The error of the lowest modes falls
    faster than any power of n, and there are no spurious ones.

    Args:
        n: degree.

    Source: Canuto, Hussaini, Quarteroni, Zang, Spectral Methods, 2006.
    """

    n: int = 8

    purpose: ClassVar[str] = "one polynomial; the error of the low modes falls exponentially"

    def __post_init__(self) -> None:
        _whole(self, "n", 1, MOST_SPECTRAL)

    def _mesh(self) -> Mesh:
        nodes, inertias = lobatto(self.n)
        stations, lengths = leggauss(self.n)
        slopes = -_derivative(nodes, stations) * lengths[:, None]
        return Mesh(
            nodes=tuple(((nodes + 1) / 2).tolist()),
            inertias=tuple((inertias / 2).tolist()),
            stations=tuple(((stations + 1) / 2).tolist()),
            lengths=tuple((lengths / 2).tolist()),
            weights=tuple(tuple(enumerate(row)) for row in slopes.tolist()),
        )


@dataclass(frozen=True)
class Wave(ShaftModel):
    """Two travelling waves: the exact solution of the shaft without internal damping.

    What leaves one end arrives at the other a delay L sqrt(density / shear_modulus) later. Bearing friction is light:
    it is lumped, half of it in the middle and a quarter at each end, as is usual for lines with losses, which is right
    for motions slower than the delay. Such a network is solved by the engine "wave" alone.

    Args:
        places: number of places, the ends among them, at which speed and torque are read along the shaft.

    Source: Bergeron 1949; Dommel, Digital computer solution of electromagnetic transients, 1969.
    """

    places: int = 5

    purpose: ClassVar[str] = "travelling waves; exact without internal damping"

    def __post_init__(self) -> None:
        _whole(self, "places", 2, MOST_ELEMENTS)


@dataclass(frozen=True)
class Auto(ShaftModel):
    """The smallest spectral model whose natural frequencies are right up to a highest one.

    The shaft by itself, free at one end and clamped or free at the other, is compared with its exact frequencies; of
    all models the spectral one needs the fewest states at any tolerance below a few per cent, as
    `shaftwork compare` shows.

    Args:
        f_max: highest frequency that matters, Hz.
        tolerance: relative error of the natural frequencies up to it.
    """

    f_max: float = 1000.0
    tolerance: float = 1e-3

    purpose: ClassVar[str] = "the smallest spectral model that is right up to a frequency"

    def __post_init__(self) -> None:
        for name, least, most in (("f_max", 0.0, 1e12), ("tolerance", 1e-12, 0.1)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= most:
                raise ParameterError(f"Auto: {name} = {value!r} must be a number from {least:g} to {most:g}.")

    def chosen(self, delay: float) -> Spectral:
        """The model for a shaft that a wave crosses in a delay, s.

        Raises:
            ParameterError: the shaft is too long for one polynomial.
        """
        waves = 2 * self.f_max * delay  # half waves along the shaft at the highest frequency
        for n in range(1, MOST_SPECTRAL + 1):
            if n > waves and _frequency_error(Spectral(n), waves) <= self.tolerance:
                return Spectral(n)
        raise ParameterError(
            f"{self!r} asks for {waves:.0f} half waves along the shaft, more than one polynomial holds. "
            f"Divide the shaft into several in a row, or lower f_max."
        )


def _frequency_error(model: ShaftModel, half_waves: float) -> float:
    """Largest relative error of the natural frequencies up to a number of half waves, free-free and clamped-free."""
    mesh = model.mesh()
    weights = np.zeros((len(mesh.lengths), len(mesh.nodes)))
    for k, row in enumerate(mesh.weights):
        for j, weight in row:
            weights[k, j] += weight
    matrix = weights / np.sqrt(np.array(mesh.lengths))[:, None] / np.sqrt(np.array(mesh.inertias))[None, :]
    worst = 0.0
    for first, kept in ((1.0, matrix), (0.5, matrix[:, 1:])):
        exact = np.pi * np.arange(first, max(half_waves, 1.0) + 0.5)  # the first mode always counts
        rates = np.sort(np.linalg.svd(kept, compute_uv=False))
        rates = rates[rates > 1e-6]
        if len(rates) < len(exact):
            return np.inf
        worst = max(worst, float(np.abs(rates[: len(exact)] / exact - 1).max()))
    return worst


MODELS: tuple[type[ShaftModel], ...] = (Rigid, OneSpring, Lumped, CentralDifference, Spectral, Wave, Auto)

# Interior stencils as (offset, factor), and the first rows and norm of the boundary closure, times the interval.
_SECOND = ((-1, -1 / 2), (1, 1 / 2))
_SECOND_NORM = (1 / 2,)
_SECOND_ROWS = ((-1 / 2, 1 / 2),)
_FOURTH = ((-2, 1 / 12), (-1, -2 / 3), (1, 2 / 3), (2, -1 / 12))
_FOURTH_NORM = (17 / 48, 59 / 48, 43 / 48, 49 / 48)
_FOURTH_ROWS = (
    (-1 / 2, 59 / 96, -1 / 12, -1 / 32),
    (-59 / 96, 0.0, 59 / 96),
    (1 / 12, -59 / 96, 0.0, 59 / 96, -1 / 12),
    (1 / 32, 0.0, -59 / 96, 0.0, 2 / 3, -1 / 12),
)
_FOURTH_ALL = (_FOURTH, _FOURTH_NORM, _FOURTH_ROWS)


@lru_cache(maxsize=32)
def lobatto(degree: int) -> tuple[Any, Any]:
    """Nodes of [-1, 1] and weights (degree + 1,) of the quadrature of Gauss and Lobatto."""
    polynomial = Legendre.basis(degree)
    inner = polynomial.deriv().roots() if degree > 1 else np.empty(0)
    for _ in range(2):  # the roots of a series are good to some ten digits, Newton's method does the rest
        inner = inner - polynomial.deriv()(inner) / polynomial.deriv(2)(inner) if degree > 1 else inner
    nodes = np.concatenate([[-1.0], np.sort(inner.real), [1.0]])
    nodes = (nodes - nodes[::-1]) / 2
    return nodes, 2 / (degree * (degree + 1) * polynomial(nodes) ** 2)


def _derivative(nodes: Any, places: Any) -> Any:
    """Matrix (places, nodes) from values at nodes to the slopes of their polynomial at other places."""
    degree = len(nodes) - 1
    slopes = np.stack([Legendre.basis(k).deriv()(places) for k in range(degree + 1)], axis=1)
    matrix: Any = np.linalg.solve(legvander(nodes, degree).T, slopes.T).T
    return matrix - matrix.sum(axis=1, keepdims=True) / (degree + 1)  # a rigid rotation twists nothing, to the last bit


def _whole(model: ShaftModel, name: str, least: int, most: int) -> None:
    value = getattr(model, name)
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise ParameterError(
            f"{type(model).__name__}: {name} = {value!r} must be a whole number from {least} to {most}."
        )


def _one_of(model: ShaftModel, name: str, choices: tuple[Any, ...]) -> None:
    value = getattr(model, name)
    if value not in choices:
        listed = ", ".join(repr(choice) for choice in choices)
        raise ParameterError(f"{type(model).__name__}: {name} = {value!r} must be one of: {listed}.")
