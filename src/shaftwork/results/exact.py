"""A network near a point whose shafts are exact: the network between them by matrices, the shafts by their two-port.

The states x of the network, and V and W of each shaft (`exact_lines`), swing as exp(s t) where

    s x = A x + Bh h(s) + (B + s B1) v        what arrives at the ends, h = tau - Z omega, drives the network
    omega(s) = C x + Dh h(s) + D v            the ends of the shafts turn as the nodes do

with h(s) and omega(s) linear in V and W. One small matrix for each s: its solutions are the frequency response, its
singular points the rates of the modes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shaftwork.results.exact_lines import ExactLines
from shaftwork.results.exact_modes import Starts, find_exact_modes
from shaftwork.results.exact_problem import ExactProblem
from shaftwork.results.frequency import ENTRIES, ROUNDINGS, FrequencyResponse, response, without_hits
from shaftwork.results.modes import Modes
from shaftwork.results.observer import Array
from shaftwork.results.slopes import Complex, Motions, OpenSlopes


@dataclass(frozen=True, eq=False)
class ExactSlopes:
    """Small motions of a network with exact shafts, read by the names that they have with a mesh.

    Args:
        open: the network without the shafts.
        lines: the shafts.
        meshed: the same network with meshes, whose nodes say what can be read and how it is drawn.
        profiles: what can be read along a part, with unit and places in m.
        lengths: of the shafts, m.
    """

    open: OpenSlopes
    lines: ExactLines
    meshed: Motions
    profiles: Mapping[str, tuple[str, tuple[float, ...]]]
    lengths: tuple[float, ...]

    @property
    def states(self) -> tuple[str, ...]:
        """Those of the network, then speed and elastic torque of the middle of each shaft, over exp(-G / 2)."""
        return (*self.open.states, *(f"{name}.{part}" for name in self.lines.names for part in ("even", "odd")))

    @property
    def state_units(self) -> tuple[str, ...]:
        """(n,) their units."""
        return (*self.open.state_units, *("rad/s", "N*m") * len(self.lines.names))

    @cached_property
    def weights(self) -> Array:
        """(n,) factors with which the sum of squares is twice the stored energy, roughly."""
        delay, impedance = self.lines.delay, self.lines.impedance
        middle = np.stack([np.sqrt(impedance * delay), np.sqrt(delay / impedance)], axis=1)
        return np.concatenate([self.open.weights, middle.ravel()])

    @property
    def inputs(self) -> tuple[str, ...]:
        """The named inputs."""
        return self.open.inputs

    @cached_property
    def _inside(self) -> Mapping[str, tuple[int, float]]:
        """Nodes between the ends of shafts: the shaft and the share of the way."""
        found = {}
        for number, (name, length) in enumerate(zip(self.lines.names, self.lengths, strict=True)):
            for k, place in enumerate(self.meshed.profiles[f"{name}.omega"][1][1:-1], 1):
                found[f"{name}.{k}.omega"] = (number, place / length)
        return found

    @cached_property
    def units(self) -> Mapping[str, str]:
        """Every quantity that can be read, and its unit; the energy of a shaft is none."""
        held = {f"{name}.energy" for name in self.lines.names}
        known = {name: unit for name, unit in self.open.units.items() if name not in held}
        return known | {name: self.meshed.units[name] for name in self._inside}

    @property
    def nodes(self) -> Mapping[str, tuple[str, float]]:
        """The nodes of the meshed network, which are read exactly."""
        return self.meshed.nodes

    @property
    def masses(self) -> tuple[tuple[str, str], ...]:
        """Those of the meshed network."""
        return self.meshed.masses

    def arriving(self, s: Complex, x: Complex) -> Complex:
        """(ends, k) h = tau - Z omega at the ends of the shafts."""
        middle = x[len(self.open.states) :].reshape(len(self.lines.names), 2, x.shape[1])
        speeds, torques = self.lines.ends(s)
        made = np.einsum("kqij,qjk->qik", torques - self.lines.impedance[:, None, None] * speeds, middle)
        return np.asarray(made.reshape(2 * len(middle), x.shape[1]))

    def swinging(self, s: Complex, x: Complex, v: Complex) -> Callable[[str], Complex]:
        """A function from the name of a quantity to its amplitude (k,), along a part (k, places)."""
        own = len(self.open.states)
        middle = x[own:].reshape(len(self.lines.names), 2, x.shape[1])
        read = self.open.swinging(s, x[:own], np.vstack([v, self.arriving(s, x)]))
        inside: dict[int, Complex] = {}

        def along(number: int, places: Any) -> tuple[Complex, Complex]:
            return self.lines.along(number, s, middle[number], np.asarray(places) / self.lengths[number])

        def amplitude(name: str) -> Complex:
            owner, _, quantity = name.rpartition(".")
            if name in self.profiles and owner in self.lines.names:
                speed, torque = along(self.lines.names.index(owner), self.profiles[name][1])
                return speed if quantity == "omega" else torque
            if name not in self._inside:
                return read(name)
            number = self._inside[name][0]
            if number not in inside:
                inside[number] = along(number, self.meshed.profiles[f"{self.lines.names[number]}.omega"][1])[0]
            return np.asarray(inside[number][:, int(owner.rpartition(".")[2])])

        return amplitude


class _Driven:
    """The states under one input."""

    def __init__(self, slopes: ExactSlopes, number: int) -> None:
        self._slopes, self._problem = slopes, ExactProblem(slopes.open, slopes.lines, slopes.weights)
        self._number = number
        self._probe = np.random.default_rng(0).normal(size=len(slopes.weights))  # takes part in every mode

    def nearness(self, s: complex) -> float:
        """The distance from s within which a rate is hit, 1/s."""
        return float(np.finfo(float).eps * max(ROUNDINGS * abs(s), self._problem.size))

    def solve(self, s: Complex) -> tuple[Complex, NDArray[np.bool_]]:
        """States (n, k) at frequencies s (k,), and where a rate is hit."""
        size = len(self._probe)
        solved = np.empty((len(s), size, 2), dtype=complex)
        chunk = max(1, ENTRIES // size**2)
        for first in range(0, len(s), chunk):
            here = slice(first, first + chunk)
            right = np.empty((len(s[here]), size, 2), dtype=complex)
            right[:, :, 0], right[:, :, 1] = self._problem.driven(s[here], self._number), self._probe
            solved[here] = _solved(self._problem.matrix(s[here]), right)
        found, hit = without_hits(solved, self._probe, np.array([self.nearness(value) for value in s]))
        return found / self._slopes.weights[:, None], hit


def _solved(matrices: Complex, right: Complex) -> Complex:
    """Solutions (k, n, 2), NaN where a matrix is singular."""
    try:
        return np.asarray(np.linalg.solve(matrices, right))
    except np.linalg.LinAlgError:
        if len(matrices) == 1:
            return np.full_like(right, np.nan)
        return np.concatenate([_solved(matrices[k : k + 1], right[k : k + 1]) for k in range(len(matrices))])


@dataclass(frozen=True, eq=False)
class ExactModel:
    """Small motions about a point of a network with exact shafts: modes and frequency response.

    Args:
        title: of the network.
        slopes: the network near the point.
        starts: the modes of the network with meshes that are right up to a rate.
        phase: the modes of its parts at the point, "gap open, load stuck"; empty where none has several.
    """

    title: str
    slopes: ExactSlopes
    starts: Starts
    phase: str = ""

    def modes(self, count: int | None = None, f_max: float | None = None) -> Modes:
        """Frequencies, damping and shapes of the free motions.

        Args:
            count: the modes wanted, those of smallest |rate|; by default 10, or all up to f_max.
            f_max: the largest |rate| / 2 pi, Hz.

        Raises:
            ParameterError: count or f_max is out of its range, or modes without number crowd below it.
            SimulationError: it cannot be settled that all modes were found.

        Warns:
            NetworkWarning: an end takes all that arrives at it, so that there are fewer modes.
        """
        return find_exact_modes(self.title, self.slopes, self.starts, count, f_max)

    def frequency_response(self, input: str, output: str, f: Any) -> FrequencyResponse:  # noqa: A002
        """The complex amplitude of a quantity under a sinusoidal input of amplitude one.

        Args:
            input: one of `slopes.inputs`.
            output: any quantity, "part.quantity" or "node.quantity".
            f: (k,) frequencies, Hz.

        Raises:
            ParameterError: f holds no positive, finite numbers.
            SignalError: there is no such input or output.
        """
        return response(self.title, self.slopes, lambda number: _Driven(self.slopes, number), (input, output), f)
