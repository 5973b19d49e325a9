"""Frequency response of a network near a point: steady amplitudes under a sinusoidal input."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from shaftwork.core.errors import MissingExtraError, ParameterError, SignalError, no_quantity
from shaftwork.core.parameters import numbers_in_si
from shaftwork.core.screen import in_lines
from shaftwork.results.observer import Array
from shaftwork.results.slopes import Complex, DeviationEquations, Motions

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DENSE = 48
"""States up to which many frequencies are solved at once by dense elimination; beyond, one by one and sparse."""
ENTRIES = 4_000_000
"""Numbers held at once."""
ROUNDINGS = 64
"""A natural frequency is hit when it is nearer than so many rounding errors."""
ASIDE, FARTHEST = 1e-6, 0.1
"""Where one is hit, the response is read so far to both sides, or farther in a stiff network, by these fractions."""


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """The complex amplitude of an output under the input cos(2 pi f t) of amplitude one, once transients have died.

    numpy takes it for its values: `abs(response)`, `numpy.angle(response)`.

    Args:
        title: of the network.
        input: name of the input.
        output: name of the output.
        units: of the input and of the output.
        f: (k,) frequencies, Hz.
        values: (k,) output over input; infinite where an undamped natural frequency is hit exactly.
    """

    title: str
    input: str
    output: str
    units: tuple[str, str]
    f: Array
    values: Complex

    @property
    def magnitude(self) -> Array:
        """(k,) amplitude of the output for an input of amplitude one."""
        return np.abs(self.values)

    @property
    def phase(self) -> Array:
        """(k,) phase of the output before that of the input, rad, from -pi to pi."""
        return np.asarray(np.angle(self.values))

    @property
    def infinite(self) -> tuple[float, ...]:
        """The frequencies in Hz at which the response has no bound: undamped resonance, hit exactly."""
        return tuple(self.f[np.isinf(self.values)].tolist())

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:  # noqa: FBT001 (numpy's protocol)
        return np.array(self.values, dtype=dtype) if copy or dtype is not None else self.values

    def __len__(self) -> int:
        return len(self.values)

    def __iter__(self) -> Iterator[complex]:
        return iter(self.values.tolist())

    def __getitem__(self, place: Any) -> Any:
        return self.values[place]

    def __abs__(self) -> Array:
        return self.magnitude

    def __str__(self) -> str:
        finite = np.where(np.isfinite(self.values), self.magnitude, 0.0)
        top = int(finite.argmax())
        text = (
            f"{self.output} over {self.input} in '{self.title}': {len(self)} frequencies from {self.f.min():g} to "
            f"{self.f.max():g} Hz, largest {finite[top]:.6g} at {self.f[top]:.6g} Hz"
        )
        if self.infinite:
            text += f"; infinite at {', '.join(f'{f:.6g}' for f in self.infinite)} Hz (undamped resonance)"
        return text

    def plot(self) -> Figure:
        """The Bode plot: magnitude and phase over frequency (extra `plot`).

        Raises:
            MissingExtraError: matplotlib is not installed.
        """
        return _bode(self)


def frequencies(f: Any) -> Array:
    """(k,) frequencies in Hz that a user gave.

    Raises:
        ParameterError: they are no positive, finite numbers.
    """
    plain = numbers_in_si("f", f, "Hz")
    try:
        given = np.atleast_1d(np.asarray(plain, dtype=float))
    except (TypeError, ValueError):
        given = np.empty(0)
    if given.ndim != 1 or not given.size:
        raise ParameterError(f"f = {reprlib.repr(f)} is no list of frequencies. Give Hz, such as [1.0, 10.0, 100.0].")
    if wrong := [k for k in range(len(given)) if not (np.isfinite(given[k]) and given[k] > 0)]:
        raise ParameterError(
            f"f[{wrong[0]}] = {given[wrong[0]]:g} must be a finite frequency above 0 Hz. For the limit of slow inputs "
            f"give a small one."
        )
    return given


class DrivenSystem(Protocol):
    """The states of a network under one input that swings as exp(s t)."""

    def nearness(self, s: complex) -> float:
        """The distance from s within which an eigenvalue is hit, 1/s."""
        ...

    def solve(self, s: Complex) -> tuple[Complex, NDArray[np.bool_]]:
        """States (n, k) at frequencies s (k,), and where an eigenvalue is hit (their states are not to be used)."""
        ...


def frequency_response(title: str, slopes: DeviationEquations, names: tuple[str, str], f: Any) -> FrequencyResponse:
    """The response of one quantity to one input.

    Law: (s I - A) x = (B + s B1) v with s = 2 pi i f, and the output from x, v and s v, by which the derivatives that
    rigidly driven inertias ask for are exact.

    Args:
        title: of the network.
        slopes: the network near the point.
        names: of the input, one of `slopes.inputs`, and of the output.
        f: frequencies, Hz.

    Raises:
        ParameterError: f holds no positive, finite numbers.
        SignalError: there is no such input or output.
    """
    return response(title, slopes, lambda number: _Matrices(slopes, number), names, f)


def response(
    title: str, slopes: Motions, system: Callable[[int], DrivenSystem], names: tuple[str, str], f: Any
) -> FrequencyResponse:
    """The response of one quantity to one input, from a system that gives the states.

    Args:
        title: of the network.
        slopes: the network near the point.
        system: of one input, by its number.
        names: of the input, one of `slopes.inputs`, and of the output.
        f: frequencies, Hz.

    Raises:
        ParameterError: f holds no positive, finite numbers.
        SignalError: there is no such input or output.
    """
    source, output = names
    if source not in slopes.inputs:
        raise SignalError(f"'{source}' is no input here. There are: {', '.join(slopes.inputs) or 'none'}.")
    if not isinstance(output, str) or output not in slopes.units:
        raise no_quantity(output, title, slopes.units)
    given = frequencies(f)
    number = slopes.inputs.index(source)

    def read(s: Complex, x: Complex) -> Complex:
        v = np.zeros((len(slopes.inputs), len(s)), dtype=complex)
        v[number] = 1.0
        return slopes.swinging(s, x, v)(output)

    unit = slopes.units.get(source, "1")
    values = _values(system(number), len(slopes.states), 2j * np.pi * given, read)
    return FrequencyResponse(title, source, output, (unit, slopes.units[output]), given, values)


def _values(system: DrivenSystem, states: int, s: Complex, read: Callable[[Complex, Complex], Complex]) -> Complex:
    """The response at complex frequencies s, chunk by chunk; where a pole is hit, by its limit."""
    values, hit = np.empty(len(s), dtype=complex), np.zeros(len(s), dtype=bool)
    chunk = max(1, ENTRIES // max(1, 4 * states))
    for first in range(0, len(s), chunk):
        here = slice(first, first + chunk)
        x, hit[here] = system.solve(s[here])
        values[here] = read(s[here], x)
    for k in np.flatnonzero(hit).tolist():
        values[k] = _limit(system, s[k], read)
    return values


def _limit(system: DrivenSystem, s: complex, read: Callable[[Complex, Complex], Complex]) -> complex:
    """The response at a natural frequency: infinite, or finite where input or output does not take part in the mode.

    A pole turns its sign there, so the difference of both sides grows towards it, and without one it vanishes.
    """
    aside = min(max(ASIDE, 1e3 * system.nearness(s) / abs(s)), FARTHEST)
    beside = s * (1 + aside * np.array([-2.0, -1.0, 1.0, 2.0]))
    far_below, below, above, far_above = read(beside, system.solve(beside)[0])
    if abs(above - below) > abs(far_above - far_below):
        return complex(np.inf, 0.0)
    return complex((above + below) / 2)


class _Matrices:
    """(s I - A) x = (B + s B1) v for one input, in states of equal units."""

    def __init__(self, slopes: DeviationEquations, number: int) -> None:
        self._weights = slopes.weights
        scale = sparse.diags_array(slopes.weights)
        self._matrix = sparse.csc_array(scale @ slopes.A @ sparse.diags_array(1 / slopes.weights))
        self._level = slopes.weights * slopes.B[:, number]
        self._rate = slopes.weights * slopes.B1[:, number]
        self._size = float(abs(self._matrix).sum(axis=0).max()) if self._matrix.nnz else 0.0
        self._probe = np.random.default_rng(0).normal(size=len(slopes.weights))  # takes part in every mode

    def nearness(self, s: complex) -> float:
        """The distance from s within which an eigenvalue is hit, 1/s."""
        return float(np.finfo(float).eps * max(ROUNDINGS * abs(s), self._size))

    def solve(self, s: Complex) -> tuple[Complex, NDArray[np.bool_]]:
        """States (n, k) at frequencies s (k,), and where an eigenvalue is hit (their states are not to be used)."""
        size = len(self._weights)
        if not size:
            return np.zeros((0, len(s)), dtype=complex), np.zeros(len(s), dtype=bool)
        right = np.empty((len(s), size, 2), dtype=complex)
        right[:, :, 0], right[:, :, 1] = self._level + np.multiply.outer(s, self._rate), self._probe
        solved = self._dense(s, right) if size <= DENSE else self._sparse(s, right)
        found, hit = without_hits(solved, self._probe, np.array([self.nearness(value) for value in s]))
        return found / self._weights[:, None], hit

    def _dense(self, s: Complex, right: Complex) -> Complex:
        matrices = s[:, None, None] * np.eye(len(self._weights)) - self._matrix.toarray()
        try:
            return np.asarray(np.linalg.solve(matrices, right))
        except np.linalg.LinAlgError:
            return self._sparse(s, right)

    def _sparse(self, s: Complex, right: Complex) -> Complex:
        identity = sparse.eye_array(len(self._weights), format="csc")
        solved = np.empty_like(right, dtype=complex)
        for k, value in enumerate(s):
            try:
                solved[k] = splu(sparse.csc_array(value * identity - self._matrix)).solve(right[k].astype(complex))
            except RuntimeError:  # exactly singular
                solved[k] = np.nan
        return solved


def without_hits(solved: Complex, probe: Array, near: Array) -> tuple[Complex, NDArray[np.bool_]]:
    """The states (n, k), and where an eigenvalue is hit; their states are made 0.

    Args:
        solved: (k, n, 2) the states, and the solution for a right-hand side that takes part in every mode.
        probe: (n,) that right-hand side.
        near: (k,) the distance within which an eigenvalue is hit.
    """
    length = np.linalg.norm(solved[:, :, 1], axis=1)
    hit = ~(length * near <= np.linalg.norm(probe))  # also where it is NaN
    return np.where(hit, 0.0, solved[:, :, 0].T), np.asarray(hit)


def _bode(response: FrequencyResponse) -> Figure:
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingExtraError("matplotlib", "plot", "FrequencyResponse.plot()") from None
    order = np.argsort(response.f)
    order = order[np.isfinite(response.values[order]) & (response.values[order] != 0)]
    f, values = response.f[order], response.values[order]
    figure = Figure(figsize=(9, 5.5), layout="constrained")
    magnitude, phase = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    magnitude.loglog(f, np.abs(values), linewidth=1.2)
    magnitude.set_ylabel(f"{response.output} / {response.input}{_quotient(*response.units)}")
    phase.semilogx(f, np.degrees(np.unwrap(np.angle(values))), linewidth=1.2)
    phase.set_ylabel("phase in degrees")
    phase.yaxis.set_major_locator(_degrees())
    phase.set_xlabel("f in Hz")
    for axis in (magnitude, phase):
        axis.grid(alpha=0.3, which="both")
        for f_infinite in response.infinite:
            axis.axvline(f_infinite, color="0.5", linestyle=":", linewidth=1.0)
    figure.suptitle(in_lines(response.title, 9.0))
    return figure


def _degrees() -> Any:
    from matplotlib.ticker import MaxNLocator

    return MaxNLocator(nbins=6, steps=[1, 1.5, 3, 4.5, 9, 10])


def _quotient(below: str, above: str) -> str:
    units: Sequence[str] = [unit.replace("*", " ") for unit in (above, below)]
    return "" if units[0] == units[1] else f"\nin ({units[0]}) / ({units[1]})"
