"""A network near a point as matrices, with its modes and its frequency response."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from shaftwork.core.errors import no_quantity
from shaftwork.core.screen import counted
from shaftwork.frequency.exact_lines import ExactSlopes
from shaftwork.frequency.exact_spectrum import ExactProblem, Starts, find_exact_modes
from shaftwork.frequency.frequency_response import FrequencyResponse, StateEquations, frequency_response
from shaftwork.frequency.linearization import Linearization
from shaftwork.frequency.natural_modes import NaturalModes, find_modes
from shaftwork.results.observer import Array


@dataclass(frozen=True, eq=False)
class LinearModel:
    """Small motions about a point.

    Law: z' = A z + B v,  y = C z + D v + D1 v',  transfer function C (s I - A)^-1 B + D + s D1,

    in deviations from the point: v inputs, y outputs, z = x - B1 v with x the states. B1 and D1 are zero unless an
    input prescribes the speed of an inertia rigidly, or winds up springs in series: then its derivative acts on the
    states, which z takes up, and on the torques there, which is D1.

    Args:
        title: of the network.
        states: n names.
        inputs: m names.
        outputs: k names.
        point: value of each state at the point.
        t: time at which the laws are read, s.
        slopes: the network near the point.
        phase: the modes of its parts at the point, "gap open, load stuck"; empty where none has several.
    """

    title: str
    states: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    point: Mapping[str, float]
    t: float
    slopes: Linearization
    phase: str = ""

    @property
    def A(self) -> Any:
        """(n, n); a numpy array up to 1000 states, beyond a scipy.sparse.csr_array."""
        return _plain(self.slopes.A)

    @property
    def B(self) -> Array:
        """(n, m)."""
        return np.asarray(self.slopes.B + self.slopes.A @ self.slopes.B1)

    @property
    def B1(self) -> Array:
        """(n, m); x = z + B1 v are the states themselves."""
        return self.slopes.B1

    @property
    def C(self) -> Any:
        """(k, n); a numpy array up to 1000 states, beyond a scipy.sparse.csr_array."""
        return _plain(self._C)

    @cached_property
    def D(self) -> Array:
        """(k, m)."""
        identity = np.eye(len(self.inputs))
        return self._read(self.slopes.B1, identity, 0 * identity)

    @cached_property
    def D1(self) -> Array:
        """(k, m), factors of the derivatives of the inputs."""
        identity = np.eye(len(self.inputs))
        return self._read(0 * self.slopes.B1, 0 * identity, identity)

    @cached_property
    def _C(self) -> Any:
        """Few states reach an output of a large network: groups of them are tried, and split where one does."""
        size = len(self.states)
        if self.outputs == self.states:
            return sparse.eye_array(size, format="csr")
        # Groups of states whose effect on the outputs is computed at once, and the parts that one is split into.
        block, parts = 256, 16
        weight = np.random.default_rng(0).uniform(1.0, 2.0, size)  # so that two of a group cannot cancel
        groups = np.array_split(np.arange(size), min(size, block)) if size else []
        while any(len(group) > 1 for group in groups):
            reached = [self._of_groups(groups[k : k + block], weight).any(axis=0) for k in range(0, len(groups), block)]
            active = [group for group, reaches in zip(groups, np.concatenate(reached), strict=True) if reaches]
            groups = [part for group in active for part in np.array_split(group, min(len(group), parts))]
        blocks = [self._of_groups(groups[k : k + block], np.ones(size)) for k in range(0, len(groups), block)]
        values = np.hstack([np.zeros((len(self.outputs), 0)), *blocks])
        rows, columns = np.nonzero(values)
        places = np.array([group[0] for group in groups], dtype=np.intp)[columns]
        return sparse.csr_array((values[rows, columns], (rows, places)), shape=(len(self.outputs), size))

    def _of_groups(self, groups: Sequence[NDArray[np.intp]], weight: Array) -> Array:
        """(outputs, groups) for motions in which the states of one group move by their weights."""
        x = np.zeros((len(self.states), len(groups)))
        for k, group in enumerate(groups):
            x[group, k] = weight[group]
        none = np.zeros((len(self.inputs), len(groups)))
        return self._read(x, none, none)

    def _read(self, x: Array, v: Array, v_rate: Array) -> Array:
        """(outputs, k) for deviations of the states (n, k), the inputs (m, k) and their derivatives (m, k)."""
        places = {name: k for k, name in enumerate(self.states)}
        read = self.slopes.motion(x.astype(complex), v.astype(complex), v_rate.astype(complex))
        rows = [x[places[name]] if name in places else read(name).real for name in self.outputs]
        return np.array(rows).reshape(len(self.outputs), x.shape[1])

    def modes(self, count: int | None = None, f_max: float | None = None) -> NaturalModes:
        """Frequencies, damping and shapes of the free motions.

        Args:
            count: the modes wanted, those of smallest |rate|; by default all.
            f_max: the largest |rate| / 2 pi, Hz; by default there is none.

        Raises:
            ParameterError: count or f_max is out of its range, or the network is too large for all modes.
            SimulationError: the lowest modes of a large network were not found.
        """
        return find_modes(self.title, self.slopes, count, f_max)

    def frequency_response(self, input: str, output: str, f: Any) -> FrequencyResponse:  # noqa: A002
        """The complex amplitude of a quantity under a sinusoidal input of amplitude one.

        Args:
            input: one of `inputs`.
            output: any quantity, "part.quantity" or "node.quantity".
            f: (k,) frequencies, Hz.

        Raises:
            ParameterError: f holds no positive, finite numbers.
            SignalError: there is no such input or output.
        """
        return frequency_response(self.title, self.slopes, StateEquations(self.slopes), (input, output), f)

    def to_control(self) -> Any:
        """A `control.StateSpace` of python-control: z are its states, and names have ":" in place of each ".".

        A name also has parentheses in place of brackets. Where B1 is not zero the states are z = x - B1 v.

        Raises:
            MissingExtraError: python-control is not installed (extra `control`).
            ParameterError: two names are one in python-control.
            SimulationError: an output depends on the rate of an input, D1; says which.
        """
        from shaftwork.control.linear_export import as_control

        return as_control(self)

    def to_scipy(self) -> Any:
        """A `scipy.signal.StateSpace`, without names: states, inputs and outputs in the order of this model.

        Raises:
            SimulationError: an output depends on the rate of an input, D1; says which.
        """
        from shaftwork.control.linear_export import as_scipy

        return as_scipy(self)

    def to_csv(self, path: str | Path) -> None:
        """Write the matrices with their names.

        Args:
            path: a file, "linear.csv", for one table [A B; C D] with states and outputs as rows, states and inputs as
                columns; or a folder, for A.csv, B.csv, C.csv and D.csv. Where D1 is not zero it is there, too.

        Raises:
            ParameterError: there is no folder for the file, or the folder's name is that of a file.
        """
        from shaftwork.control.linear_export import write_csv

        write_csv(self, path)

    def __repr__(self) -> str:
        pairs = (self.states, "state"), (self.inputs, "input"), (self.outputs, "output")
        sizes = ", ".join(counted(len(names), word) for names, word in pairs)
        return f"<LinearModel of '{self.title}': {sizes}>"


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

    def modes(self, count: int | None = None, f_max: float | None = None) -> NaturalModes:
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
        return frequency_response(self.title, self.slopes, ExactProblem(self.slopes), (input, output), f)


def linear_model(
    title: str, slopes: Linearization, outputs: tuple[str, ...] | None, x: Array, t: float, phase: str = ""
) -> LinearModel:
    """The record of a network near a point.

    Args:
        title: of the network.
        slopes: the network near the point.
        outputs: names of the outputs; None for the states.
        x: (n,) the states at the point.
        t: time at which the laws are read, s.
        phase: the modes of its parts there, in words.

    Raises:
        SignalError: there is no such output.
    """
    names = slopes.states if outputs is None else outputs
    for name in () if outputs is None else outputs:
        if name not in slopes.units and name not in slopes.states:
            raise no_quantity(name, title, slopes.units)
    point = dict(zip(slopes.states, x.tolist(), strict=True))
    return LinearModel(title, slopes.states, slopes.inputs, names, point, t, slopes, phase)


def _plain(matrix: Any) -> Any:
    return matrix.toarray() if matrix.shape[1] <= 1000 else matrix  # 8 MB
