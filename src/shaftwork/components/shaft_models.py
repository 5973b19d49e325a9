"""How a long shaft becomes finitely many speeds and torques: the exchangeable models of a `Shaft`."""

from __future__ import annotations

import contextlib
import reprlib
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.polynomial.legendre import leggauss

from shaftwork.components.shaft_meshes import SUMMATION_BY_PARTS, Mesh, central, central_as_printed
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import call_in, in_si, whole
from shaftwork.numerics.polynomials import lobatto_rule, to_slopes

MOST_ELEMENTS = 100_000
"""Elements of a model; more is a typing error."""
MOST_SPECTRAL = 200
"""Degree up to which the nodes and weights are right to rounding; beyond it, join several shafts."""


@dataclass(frozen=True)
class ShaftModel:
    """Base of the models."""

    @classmethod
    def read(cls, text: Any) -> ShaftModel:
        """A model from its text, such as "Lumped(20)" or "CentralDifference(m=40, order=4)".

        Raises:
            ParameterError: it is no model.
        """
        models = {model.__name__: model for model in MODELS}
        match call_in(text):
            case (name, values, options) if name in models:
                with contextlib.suppress(TypeError):
                    return models[name](*values, **options)
        raise ParameterError(
            f"{reprlib.repr(text)} is no shaft model. The models are: {', '.join(models)}; write for example "
            "Lumped(20)."
        )

    @lru_cache(maxsize=32)  # noqa: B019 (of few models, which are small, one for all that are equal)
    def mesh(self) -> Mesh:
        """The nodes, stations and weights."""
        return self._mesh()

    def _mesh(self) -> Mesh:
        raise ParameterError(f"{self!r} has no mesh.")


@dataclass(frozen=True)
class Rigid(ShaftModel):
    """No twist: the inertia of the shaft moves as one with what is at its ends."""


@dataclass(frozen=True)
class OneSpring(ShaftModel):
    """The stiffness of the whole shaft, and no inertia."""


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

    def __post_init__(self) -> None:
        _whole(self, "m", 1, MOST_ELEMENTS)
        _one_of(self, "ends", ("half", "full"))

    def _mesh(self) -> Mesh:
        m = self.m
        return Mesh(
            intervals=m,
            nodes=tuple(k / m for k in range(m + 1)),
            inertias=(0.5, *[1.0] * (m - 1), 0.5) if self.ends == "half" else (m / (m + 1),) * (m + 1),
            stations=tuple((k + 0.5) / m for k in range(m)),
            lengths=(1.0,) * m,
            weights=tuple(((k, 1.0), (k + 1, -1.0)) for k in range(m)),
        )


@dataclass(frozen=True)
class CentralDifference(ShaftModel):
    """Central differences for speed and torque at the same equidistant nodes.

    Inside the shaft, with Delta x = L / m:

        J' d(omega_k)/dt = - (tau_{k+1} - tau_{k-1}) / (2 Delta x)
                           + D' (omega_{k+1} - 2 omega_k + omega_{k-1}) / Delta x^2
        d(tau_k)/dt / C' = - (omega_{k+1} - omega_{k-1}) / (2 Delta x)

    The lossless part is (20) and (21) of Popenda 2019. Speeds at odd nodes know torques at even ones only, so half of
    the modes are spurious; the damping, which joins neighbours, damps those most. His (20) carries the damping on the
    torque, (D' / J') times its second difference, which is the same partial differential equation but asks for torques
    beyond the ends; to take their slope for zero there would lose the damping at a heavy end and not converge. He
    prints the second difference in (19) over 2 Delta x^2, which halves the damping.

    From the second elastic mode on, natural frequencies have four times the error of `Lumped(m)`, whose cells are
    halved at the ends. Against m equal lumps, the other model of the source, the printed closure is better there, and
    worse at the lowest frequency.

    Args:
        m: number of intervals.
        order: 2 or 4, of the differences of torque and speed; that of the damping is 2.
        closure: at the ends, "sbp" or "printed". "sbp" is summation by parts: torques at all m + 1 nodes, one-sided
            differences over half a cell at order 2, Strand's boundary rows at order 4. "printed" reads (20)-(23) as
            they stand, torques at the m - 1 inner nodes: the machines see the torques next to them, as in (22) and
            (23), which stand for the undefined ones of (21) too; the speeds at the ends enter by
            omega_0 - (omega_1 + omega_2) / 2 over 1.5 Delta x, the one row that then makes no energy. The ends have no
            inertia of the shaft, which is too light by one part in m: first order. Speeds that alternate from node to
            node twist nothing, a spurious motion of frequency zero. Order 2 alone.
        second_difference: of the damping, "consistent" or "printed", which has half of it whatever m is.
        form: "network", a circuit that makes no energy, as above, or "paper": (20)-(23) letter by letter, with the
            torque M_k between the ends as state and the damping on it, for k = 1, ..., m - 1. The machines turn at
            omega_0 and omega_m, which he numbers 1 and m, and see M_1 and M_{m-1}. He leaves M_0 and M_m open; here
            they are M_1 and M_{m-1}, the only ones with which (21) and the machines' equations see the same torques.
            Closure and second difference are then "printed". With an even m the speeds at even nodes and the torques at
            odd ones, which the machines see, move by themselves; the others follow them, and give nothing back.

    Source: Popenda 2019, (16)-(23); Strand, Summation by parts for finite difference approximations for d/dx, 1994.
    """

    m: int = 20
    order: int = 2
    closure: str = "sbp"
    second_difference: str = "consistent"
    form: str = "network"

    def __post_init__(self) -> None:
        _one_of(self, "form", ("network", "paper"))
        if self.form == "paper":
            object.__setattr__(self, "closure", "printed")
            object.__setattr__(self, "second_difference", "printed")
        _one_of(self, "order", tuple(SUMMATION_BY_PARTS))
        _one_of(self, "closure", ("sbp", "printed"))
        _one_of(self, "second_difference", ("consistent", "printed"))
        if self.closure == "printed" and self.order != 2:
            raise ParameterError(
                f"{self!r}: the printed closure is of order 2. Leave order out, or take closure='sbp'."
            )
        closed = len(SUMMATION_BY_PARTS[self.order][1])
        _whole(self, "m", 2 * closed if self.closure == "sbp" else 3, MOST_ELEMENTS)

    def _mesh(self) -> Mesh:
        dampers = (1.0 if self.second_difference == "consistent" else 2.0,) * self.m
        nodes = tuple(k / self.m for k in range(self.m + 1))
        if self.closure == "printed":
            return central_as_printed(self.m, nodes, dampers)
        return central(self.m, nodes, dampers, self.order)


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

    def __post_init__(self) -> None:
        _whole(self, "n", 1, MOST_SPECTRAL)

    def _mesh(self) -> Mesh:
        nodes, inertias = lobatto_rule(self.n)
        stations, lengths = leggauss(self.n)
        # a rigid rotation twists nothing, to the last bit
        slopes = -to_slopes(nodes, stations) * lengths[:, None]
        return Mesh(
            intervals=1,
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
    for motions slower than the delay and for d' L well below the impedance; from a tenth of it on, a run warns. Such a
    network is solved by the engine "wave" alone.

    Args:
        places: number of places, the ends among them, at which speed and torque are read along the shaft.

    Source: Bergeron 1949; Dommel, Digital computer solution of electromagnetic transients, 1969.
    """

    places: int = 5

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

    def __post_init__(self) -> None:
        for name, unit, least, most in (("f_max", "Hz", 0.0, 1e12), ("tolerance", "1", 1e-12, 0.1)):
            value = in_si(f"Auto: {name}", getattr(self, name), unit, at_least=least, at_most=most)
            object.__setattr__(self, name, value)

    def chosen(self, delay: float) -> Spectral:
        """The model for a shaft that a wave crosses in a delay, s.

        Raises:
            ParameterError: the shaft is too long for one polynomial.
        """
        waves = 2 * self.f_max * delay  # half waves along the shaft at the highest frequency
        if (degree := _smallest_degree(waves, self.tolerance)) is None:
            raise ParameterError(
                f"{self!r} asks for {waves:.0f} half waves along the shaft, more than one polynomial holds. "
                f"Divide the shaft into several in a row, or lower f_max."
            )
        return Spectral(degree)


@lru_cache(maxsize=256)
def _smallest_degree(half_waves: float, tolerance: float) -> int | None:
    """Of the spectral models that are right up to a number of half waves; None where none is."""
    degrees = range(int(half_waves) + 1, MOST_SPECTRAL + 1)
    return next((n for n in degrees if _frequency_error(Spectral(n), half_waves) <= tolerance), None)


def _frequency_error(model: ShaftModel, half_waves: float) -> float:
    """Largest relative error of the natural frequencies up to a number of half waves, free-free and clamped-free."""
    mesh = model.mesh()
    weights = np.zeros((len(mesh.lengths), len(mesh.nodes)))
    for k, row in enumerate(mesh.weights):
        for j, weight in row:
            weights[k, j] += weight
    matrix = weights / np.sqrt(np.array(mesh.lengths))[:, None] / np.sqrt(np.array(mesh.inertias))[None, :]
    worst = 0.0
    for first, columns in ((1.0, matrix), (0.5, matrix[:, 1:])):
        exact = np.pi * np.arange(first, max(half_waves, 1.0) + 0.5)  # the first mode always counts
        rates = np.sort(np.linalg.svd(columns, compute_uv=False))
        rates = rates[rates > 1e-6]
        if len(rates) < len(exact):
            return np.inf
        worst = max(worst, float(np.abs(rates[: len(exact)] / exact - 1).max()))
    return worst


MODELS: tuple[type[ShaftModel], ...] = (Rigid, OneSpring, Lumped, CentralDifference, Spectral, Wave, Auto)


def _whole(model: ShaftModel, name: str, least: int, most: int) -> None:
    if (count := whole(getattr(model, name), least, most)) is None:
        shown = f"{type(model).__name__}: {name} = {getattr(model, name)!r}"
        raise ParameterError(f"{shown} must be a whole number from {least} to {most}.")
    object.__setattr__(model, name, count)


def _one_of(model: ShaftModel, name: str, choices: tuple[Any, ...]) -> None:
    if (value := getattr(model, name)) not in choices:
        listed = ", ".join(map(repr, choices))
        raise ParameterError(f"{type(model).__name__}: {name} = {value!r} must be one of: {listed}.")
