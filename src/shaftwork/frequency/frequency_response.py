"""Frequency response of a network near a point: steady amplitudes under a sinusoidal input."""

from __future__ import annotations

import reprlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse.linalg import splu

from shaftwork.core.errors import ParameterError, SignalError, no_quantity
from shaftwork.frequency.exact_lines import Motions
from shaftwork.frequency.linearization import Linearization
from shaftwork.results.observer import Array, Complex, array_in_si, blocks
from shaftwork.results.plotting import new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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


def frequencies_of(f: Any) -> Array:
    """(k,) frequencies in Hz that a user gave.

    Raises:
        ParameterError: they are no positive, finite numbers.
    """
    frequencies = array_in_si("f", f, "Hz")
    if not frequencies.size:
        raise ParameterError(f"f = {reprlib.repr(f)} is no list of frequencies. Give Hz, such as [1.0, 10.0, 100.0].")
    if (wrong := np.flatnonzero(~(np.isfinite(frequencies) & (frequencies > 0)))).size:
        raise ParameterError(
            f"f[{wrong[0]}] = {frequencies[wrong[0]]:g} must be a finite frequency above 0 Hz. For the limit of slow "
            "inputs give a small one."
        )
    return frequencies


class DrivenSystem(Protocol):
    """Equations M(s) x = r(s) of a network that swings as exp(s t) under its inputs, in states of equal units."""

    size: float
    """Norm of the matrix at s = 0, 1/s."""

    def driven(self, s: Complex, number: int) -> Complex:
        """The right-hand side (k, n) under an input of amplitude one, at s (k,)."""
        ...

    def solved(self, s: Complex, right: Complex) -> Complex:
        """Solutions (k, n, 2) of right-hand sides (k, n, 2), NaN where the matrix is singular."""
        ...


def frequency_response(
    title: str, slopes: Motions, system: DrivenSystem, names: tuple[str, str], f: Any
) -> FrequencyResponse:
    """The response of one quantity to one input, by their names; see `LinearModel.frequency_response`.

    Law: M(s) x = r(s) with s = 2 pi i f, and the output from x, v and s v, by which the derivatives that rigidly driven
    inertias ask for are exact.
    """
    source, output = names
    if source not in slopes.inputs:
        raise SignalError(f"'{source}' is no input here. There are: {', '.join(slopes.inputs) or 'none'}.")
    if not isinstance(output, str) or output not in slopes.units:
        raise no_quantity(output, title, slopes.units)
    frequencies = frequencies_of(f)
    v = np.zeros((len(slopes.inputs), len(frequencies)), dtype=complex)
    v[slopes.inputs.index(source)] = 1.0
    unit = slopes.units.get(source, "1")
    (values,) = forced_amplitudes(slopes, system, 2j * np.pi * frequencies, v, (output,))
    return FrequencyResponse(title, source, output, (unit, slopes.units[output]), frequencies, values)


def forced_amplitudes(
    slopes: Motions, system: DrivenSystem, s: Complex, v: Complex, outputs: Sequence[str]
) -> list[Complex]:
    """The complex amplitudes of quantities under inputs that swing as exp(s t), each (k,), along a part (k, places).

    Infinite where an undamped natural frequency is hit exactly and the quantity takes part in its mode.

    Args:
        slopes: the network near the point.
        system: its equations.
        s: (k,) 1/s, not 0.
        v: (m, k) amplitudes of all inputs.
        outputs: names of quantities.
    """
    forced = _Forced(slopes, system, tuple(outputs))
    chunks, hit = list[list[Complex]](), np.zeros(len(s), dtype=bool)
    for here in blocks(len(s), 4 * len(slopes.weights)):
        values, hit[here] = forced.read(s[here], v[:, here])
        chunks.append(values)
    amplitudes = [np.concatenate(parts) for parts in zip(*chunks, strict=True)]
    for k in np.flatnonzero(hit).tolist():
        for amplitude, limit in zip(amplitudes, forced.limits(s[k], v[:, k : k + 1]), strict=True):
            amplitude[k] = limit
    return amplitudes


class _Forced:
    """The amplitudes of quantities of a network that is driven."""

    def __init__(self, slopes: Motions, system: DrivenSystem, outputs: tuple[str, ...]) -> None:
        self._slopes, self._system, self._outputs = slopes, system, outputs
        self._probe = np.random.default_rng(0).normal(size=len(slopes.weights))  # takes part in every mode

    def read(self, s: Complex, v: Complex) -> tuple[list[Complex], NDArray[np.bool_]]:
        """The amplitudes, and where an eigenvalue is hit (there they are not to be used)."""
        right = np.zeros((len(s), len(self._probe), 2), dtype=complex)
        for number in np.flatnonzero(v.any(axis=1)).tolist():
            right[:, :, 0] += v[number][:, None] * self._system.driven(s, number)
        right[:, :, 1] = self._probe
        solved = self._system.solved(s, right)
        length = np.linalg.norm(solved[:, :, 1], axis=1)
        hit = ~(length * self._nearness(s) <= np.linalg.norm(self._probe))  # also where it is NaN
        solved[hit] = 0.0
        x = np.asarray(solved[:, :, 0].T / self._slopes.weights[:, None])
        read = self._slopes.swinging(s, x, v)
        return [read(name) for name in self._outputs], hit

    def _nearness(self, s: Complex) -> Array:
        """The distance from s within which an eigenvalue is hit, 1/s."""
        # 64 rounding errors of s, or those of the matrix
        return np.asarray(np.finfo(float).eps * np.maximum(64 * np.abs(s), self._system.size))

    def limits(self, s: complex, v: Complex) -> list[Complex]:
        """The amplitudes at a natural frequency: infinite, or finite where input or output does not take part in it.

        A pole turns its sign there, so the difference of both sides grows towards it, and without one it vanishes.
        """
        # so far to both sides, by a fraction of s; farther in a stiff network
        aside = min(max(1e-6, 1e3 * float(self._nearness(np.array([s]))[0]) / abs(s)), 0.1)
        steps = np.array([-2.0, -1.0, 1.0, 2.0])
        sides, _ = self.read(s * (1 + aside * steps), np.repeat(v, len(steps), axis=1))
        return [
            np.where(np.abs(above - below) > np.abs(far_above - far_below), complex(np.inf, 0.0), (above + below) / 2)
            for far_below, below, above, far_above in sides
        ]


class StateEquations:
    """(s I - A) x = (B + s B1) v, in states of equal units."""

    def __init__(self, slopes: Linearization) -> None:
        scale, weights = sparse.diags_array(slopes.weights), slopes.weights[:, None]
        self._matrix = sparse.csc_array(scale @ slopes.A @ sparse.diags_array(1 / slopes.weights))
        self._level, self._rate = weights * slopes.B, weights * slopes.B1
        self.size = float(abs(self._matrix).sum(axis=0).max()) if self._matrix.nnz else 0.0

    def driven(self, s: Complex, number: int) -> Complex:
        """The right-hand side (k, n) under an input of amplitude one, at s (k,)."""
        return np.asarray(self._level[:, number] + np.multiply.outer(s, self._rate[:, number]))

    def solved(self, s: Complex, right: Complex) -> Complex:
        """Solutions (k, n, 2) of right-hand sides (k, n, 2), NaN where the matrix is singular."""
        size = self._matrix.shape[0]
        # Dense elimination solves all frequencies at once; of more states one by one, and sparse, is faster.
        if size <= 48:
            return solved_densely(s[:, None, None] * np.eye(size) - self._matrix.toarray(), right)
        identity = sparse.eye_array(size, format="csc")
        solved = np.empty_like(right, dtype=complex)
        for k, value in enumerate(s):
            try:
                solved[k] = splu(sparse.csc_array(value * identity - self._matrix)).solve(right[k].astype(complex))
            except RuntimeError:  # exactly singular
                solved[k] = np.nan
        return solved


def solved_densely(matrices: Complex, right: Complex) -> Complex:
    """Solutions (k, n, m) of dense systems, NaN where a matrix is singular."""
    try:
        return np.asarray(np.linalg.solve(matrices, right))
    except np.linalg.LinAlgError:
        if len(matrices) == 1:
            return np.full_like(right, np.nan)
        return np.concatenate([solved_densely(matrices[k : k + 1], right[k : k + 1]) for k in range(len(matrices))])


def _bode(response: FrequencyResponse) -> Figure:
    order = np.argsort(response.f)
    order = order[np.isfinite(response.values[order]) & (response.values[order] != 0)]
    f, values = response.f[order], response.values[order]
    figure = new_figure("FrequencyResponse.plot()", 9.0, 5.5, response.title)
    magnitude, phase = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    magnitude.loglog(f, np.abs(values), linewidth=1.2)
    magnitude.set_ylabel(f"{response.output} / {response.input}{_quotient(*response.units)}")
    phase.semilogx(f, np.degrees(np.unwrap(np.angle(values))), linewidth=1.2)
    phase.set_ylabel("phase in degrees")
    phase.locator_params(axis="y", nbins=6, steps=[1, 1.5, 3, 4.5, 9, 10])
    phase.set_xlabel("f in Hz")
    for axis in (magnitude, phase):
        axis.grid(alpha=0.3, which="both")
        for f_infinite in response.infinite:
            axis.axvline(f_infinite, color="0.5", linestyle=":", linewidth=1.0)
    return figure


def _quotient(below: str, above: str) -> str:
    return "" if above == below else f"\nin ({above.replace('*', ' ')}) / ({below.replace('*', ' ')})"
