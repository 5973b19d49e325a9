"""Modes of a network near a point: frequencies, damping and shapes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, fields
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from shaftwork.core.errors import ParameterError, no_quantity
from shaftwork.core.notebook import html_table
from shaftwork.core.parameters import in_si, whole
from shaftwork.core.screen import counted
from shaftwork.core.storing import StoredByFields
from shaftwork.frequency.eigenvalues import eigenmodes
from shaftwork.frequency.exact_lines import Motions
from shaftwork.frequency.linearization import Linearization
from shaftwork.numerics.tolerances import EQUAL, TYPED
from shaftwork.results.observer import Array, Complex
from shaftwork.results.plotting import new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from shaftwork.animation.animation import Animation


@dataclass(frozen=True, eq=False)
class NaturalModes(StoredByFields):
    """The free motions of a network near a point, each x(t) = Re(shape exp(rate t)).

    In order: what does not change at all (rigid-body modes, constant torques in closed loops), what decays or grows
    without swinging, and what swings, by ascending frequency. A pair of conjugate rates is one mode.

    Args:
        title: of the network.
        names: "rigid body of rotor, wheel", "decay 1", "growth 1", "mode 1", ...
        rates: (k,) eigenvalues, 1/s, with imaginary part 0 or above.
        vectors: (n, k) the states in each mode.
        slopes: the network near the point.
    """

    title: str
    names: tuple[str, ...]
    rates: Complex
    vectors: Complex
    slopes: Motions

    def __getstate__(self) -> dict[str, Any]:
        return {field.name: getattr(self, field.name) for field in fields(self)}  # shapes are made anew

    def __len__(self) -> int:
        return len(self.rates)

    @property
    def frequencies(self) -> Array:
        """(k,) natural frequencies |rate| / 2 pi in Hz, ascending; exactly 0 for modes that do not swing."""
        return natural_frequencies(self.rates)

    @property
    def damped_frequencies(self) -> Array:
        """(k,) frequencies Im(rate) / 2 pi in Hz, with which the motion passes through zero."""
        return np.asarray(self.rates.imag / (2 * np.pi), dtype=float)

    @property
    def damping(self) -> Array:
        """(k,) damping ratios -Re(rate) / |rate|: 0 undamped, 1 decays without swinging, negative grows."""
        return damping_ratios(self.rates)

    @cached_property
    def shapes(self) -> Mapping[str, Complex]:
        """From a quantity such as "shaft.tau" to its complex amplitudes (k,) in all modes; along a shaft (k, places).

        The largest speed in a mode is 1; where the motions have several units, in that with the most kinetic energy.
        """
        return _Shapes(self, _free(self.slopes, self.rates, self.vectors))

    @property
    def table(self) -> tuple[tuple[str, float, float, complex, str], ...]:
        """A row for each mode: name, frequency in Hz, damping ratio, rate in 1/s, the node that moves most."""
        numbers = zip(self.frequencies.tolist(), self.damping.tolist(), self.rates.tolist(), strict=True)
        largest = _largest_nodes(self)
        return tuple((name, *row, node) for name, row, node in zip(self.names, numbers, largest, strict=True))

    def __str__(self) -> str:
        width = max([len(name) for name in self.names], default=4)
        lines = [f"{'mode':<{width}}  {'Hz':>12}  {'damping':>10}  {'rate in 1/s':>26}  moves most"]
        for name, frequency, damping, rate, node in self.table:
            shown = f"{rate.real:z.5g}{rate.imag:+.5g}j" if rate.imag else f"{rate.real:z.5g}"
            lines.append(f"{name:<{width}}  {frequency:>12.6g}  {damping:>z10.4g}  {shown:>26}  {node}")
        return "\n".join([f"{self.title}: {counted(len(self), 'mode')}", *lines])

    def _repr_html_(self) -> str:
        rows = [
            [name, f"{f:.6g}", f"{60 * f:.6g}", f"{damping:z.4g}", node] for name, f, damping, _, node in self.table
        ]
        return html_table(
            f"{self.title}: {counted(len(self), 'mode')}", ("mode", "Hz", "1/min", "damping", "moves most"), rows
        )

    def animate(self, number: int, seconds: float = 4.0) -> Animation:
        """A mode as a moving picture, its discs at the nodes that rotate, as many swings as fit (extra `plot`).

        Args:
            number: row of the table, from 0.
            seconds: how long it is shown.

        Raises:
            ParameterError: there is no such mode, or nothing rotates.
            MissingExtraError: matplotlib is not installed.
        """
        from shaftwork.animation.animation import swinging

        self._refuse_unknown((number,))
        shapes = {
            name.rpartition(".")[0]: complex(self.shapes[name][number])
            for name, (unit, _) in self.slopes.nodes.items()
            if unit == "rad/s" and "." not in name.rpartition(".")[0]
        }
        frequency = self.frequencies[number]
        title = f"{self.title}, {self.names[number]}: {frequency:.6g} Hz, damping {self.damping[number]:.3g}"
        return swinging(title, shapes, seconds)

    def _refuse_unknown(self, numbers: tuple[int, ...]) -> None:
        if wrong := [number for number in numbers if number not in range(len(self))]:
            raise ParameterError(f"There is no mode {wrong[0]}: '{self.title}' has {len(self)}, counted from 0.")

    def plot(self, *numbers: int) -> Figure:
        """The speeds of the nodes in each mode, in the order of the network (extra `plot`).

        Args:
            *numbers: rows of the table, from 0; by default the lowest that swing.

        Raises:
            ParameterError: there is no such mode.
            MissingExtraError: matplotlib is not installed.
        """
        self._refuse_unknown(numbers)
        most = 6  # modes where nobody says which
        swinging = np.flatnonzero(self.rates.imag > 0)[:most].tolist()
        return _plot(self, numbers or tuple(swinging) or tuple(range(min(most, len(self)))))


class _Shapes(Mapping[str, Complex]):
    """Amplitudes by quantity, computed when read."""

    def __init__(self, modes: NaturalModes, read: Callable[[str], Complex]) -> None:
        self._title, self._slopes, self._read = modes.title, modes.slopes, read

    def __getitem__(self, name: str) -> Complex:
        if name not in self._slopes.units and name not in self._slopes.profiles:
            raise no_quantity(name, self._title, (*self._slopes.units, *self._slopes.profiles))
        return np.asarray(self._read(name))

    def __contains__(self, name: object) -> bool:
        return name in self._slopes.units or name in self._slopes.profiles

    def __iter__(self) -> Iterator[str]:
        return iter({**self._slopes.units, **self._slopes.profiles})

    def __len__(self) -> int:
        return len({**self._slopes.units, **self._slopes.profiles})


def find_modes(title: str, slopes: Linearization, count: int | None = None, f_max: float | None = None) -> NaturalModes:
    """The modes of a network near a point, the eigenvalues and eigenvectors of A; see `LinearModel.modes`."""
    count, top = checked_count(count), largest_rate(f_max)
    acting, following = states_that_act(slopes.angles, slopes.A)
    weights = slopes.weights[acting]
    scaled = sparse.diags_array(weights) @ slopes.A[acting][:, acting] @ sparse.diags_array(1 / weights)
    rates, shapes = eigenmodes(sparse.csr_array(scaled), count)
    vectors = np.zeros((len(slopes.states), len(rates)), dtype=complex)
    vectors[acting] = shapes / weights[:, None]
    vectors[following] = (slopes.A @ vectors)[following] * (rates != 0) / np.where(rates == 0, 1.0, rates)
    below = np.abs(rates) <= top
    return modes_of(title, slopes, rates[below], vectors[:, below])


def natural_frequencies(rates: Complex) -> Array:
    """|rate| / 2 pi in Hz of each rate in 1/s, and 0 where it does not swing, without an imaginary part above 0."""
    return np.asarray(np.where(rates.imag > 0, np.abs(rates), 0.0) / (2 * np.pi), dtype=float)


def damping_ratios(rates: Complex) -> Array:
    """-Re(rate) / |rate| of each rate in 1/s: 0 undamped, 1 decays without swinging, negative grows; 0 for no rate."""
    size = np.abs(rates)
    return np.where(size > 0, -rates.real / np.where(size > 0, size, 1.0), 0.0) + 0.0


def largest_rate(f_max: float | None) -> float:
    """|rate| in 1/s of a highest frequency in Hz that a user gave; infinite for None.

    Raises:
        ParameterError: it is no frequency.
    """
    return np.inf if f_max is None else 2 * np.pi * in_si("f_max", f_max, "Hz", above=0)


def checked_count(count: int | None) -> int | None:
    """A number of modes that a user gave.

    Raises:
        ParameterError: it is none.
    """
    if count is not None and (number := whole(count)) is None:
        raise ParameterError(f"count = {count!r} must be a number of modes, 1 or more; leave it out for all.")
    return None if count is None else number


def modes_of(title: str, slopes: Motions, rates: Complex, vectors: Complex) -> NaturalModes:
    """The record of motions that go as exp(rate t): in order, with names, each of size one.

    Args:
        title: of the network.
        slopes: the network near the point.
        rates: (k,) 1/s, with imaginary part 0 or above.
        vectors: (n, k) the states in each mode, of any size.
    """
    order = np.lexsort((np.abs(rates), rates.imag > 0, rates != 0))
    rates, vectors = rates[order], _scaled(slopes, rates[order], vectors[:, order])
    return NaturalModes(title, _names(slopes, rates, vectors), rates, vectors, slopes)


def states_that_act(angles: int, *matrices: Any) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The states that have modes, and the rest, angles that are only recorded and follow from the others.

    Args:
        angles: how many of the states, the last ones, are angles.
        *matrices: sparse (., n), by which the states act.
    """
    acts = np.sum([np.asarray(abs(matrix).sum(axis=0)).ravel() for matrix in matrices], axis=0) > 0
    acts[: len(acts) - angles] = True
    return np.flatnonzero(acts), np.flatnonzero(~acts)


def _free(slopes: Motions, rates: Complex, vectors: Complex) -> Callable[[str], Complex]:
    """From a name to the amplitudes of a quantity in motions that no input drives."""
    return slopes.swinging(rates, vectors, np.zeros((len(slopes.inputs), len(rates)), dtype=complex))


def _scaled(slopes: Motions, rates: Complex, vectors: Complex) -> Complex:
    """The shapes with their largest speed, in the unit with the most kinetic energy, equal to 1."""
    read = _free(slopes, rates, vectors)
    units = np.array(slopes.state_units)
    energy = np.abs(vectors * slopes.weights[:, None]) ** 2
    by_unit = {unit: energy[units == unit].sum(axis=0) for unit in _speed_units(slopes)}
    amplitudes = {
        unit: np.array([read(name) for name, (its, _) in slopes.nodes.items() if its == unit]) for unit in by_unit
    }
    scaled = vectors.copy()
    for k in range(vectors.shape[1]):
        unit = max(by_unit, key=lambda name: by_unit[name][k], default="")
        column = vectors[:, k] * slopes.weights
        if unit and by_unit[unit][k] > TYPED**2 * energy[:, k].sum():
            column = amplitudes[unit][:, k]
        size = np.abs(column)
        scaled[:, k] /= column[np.flatnonzero(size >= (1 - EQUAL) * size.max())[0]]
    return scaled


def _names(slopes: Motions, rates: Complex, vectors: Complex) -> tuple[str, ...]:
    standing = iter(_standing(slopes, vectors[:, rates == 0]))
    names: list[str] = []
    counts = {"decay": 0, "growth": 0, "mode": 0}
    for rate in rates:
        if rate == 0:
            names.append(next(standing))
            continue
        kind = "mode" if rate.imag > 0 else "decay" if rate.real < 0 else "growth"
        counts[kind] += 1
        names.append(f"{kind} {counts[kind]}")
    return tuple(names)


def _standing(slopes: Motions, vectors: Complex) -> Iterator[str]:
    """Names for what does not change: the parts that move together, or else those that hold a torque."""
    if not vectors.size:
        return
    read = _free(slopes, np.zeros(vectors.shape[1], dtype=complex), vectors)
    speeds = np.array([np.abs(read(node)) for _, node in slopes.masses]).reshape(-1, vectors.shape[1])
    for speed, vector in zip(speeds.T, vectors.T, strict=True):
        moving = [slopes.masses[k][0] for k in np.flatnonzero(speed > TYPED)]
        size = np.abs(vector * slopes.weights)
        holding = [slopes.states[k].rpartition(".")[0] for k in np.flatnonzero(size > TYPED * size.max())]
        owners = list(dict.fromkeys(moving or holding))
        listed = ", ".join(owners if len(owners) <= 4 else [*owners[:2], "...", owners[-1]])
        yield f"rigid body of {listed}" if moving else f"constant in {listed}"


def _largest_nodes(modes: NaturalModes) -> list[str]:
    amplitudes = np.array([np.abs(modes.shapes[name]) for name in modes.slopes.nodes])
    names = [name.rpartition(".")[0] for name in modes.slopes.nodes]
    if not names:
        return [""] * len(modes)
    largest = (amplitudes >= (1 - EQUAL) * amplitudes.max(axis=0)).argmax(axis=0)
    return [names[k] if amplitudes[k, mode] > 0 else "" for mode, k in enumerate(largest)]


def _plot(modes: NaturalModes, numbers: tuple[int, ...]) -> Figure:
    figure = new_figure("Modes.plot()", 9.0, 1.0 + 1.5 * len(numbers), f"{modes.title}: speeds of the nodes")
    axes = np.atleast_1d(figure.subplots(len(numbers), 1, sharex=True))
    nodes = modes.slopes.nodes
    for axis, number in zip(axes, numbers, strict=True):
        for unit in _speed_units(modes.slopes):
            places = [place for its, place in nodes.values() if its == unit]
            shape = np.array([modes.shapes[name][number] for name, (its, _) in nodes.items() if its == unit])
            (line,) = axis.plot(places, shape.real, marker="o", markersize=3, linewidth=1.2, label=unit)
            if np.abs(shape.imag).max() > TYPED**0.5:
                later = f"{unit}, a quarter period before"
                axis.plot(places, shape.imag, "--", linewidth=1.0, color=line.get_color(), alpha=0.5, label=later)
        frequency, damping = modes.frequencies[number], modes.damping[number]
        axis.set_title(f"{modes.names[number]}: {frequency:.6g} Hz, damping {damping:.3g}", loc="left", fontsize=10)
        axis.axhline(0.0, color="0.6", linewidth=0.6)
        top = max([1.0, *(float(np.abs(line.get_ydata()).max()) for line in axis.lines)])
        axis.set_ylim(-1.1 * top, 1.1 * top)
        axis.grid(alpha=0.3)
    if len(fullest := max(axes, key=lambda axis: len(axis.lines)).lines) > 2:
        fullest[0].axes.legend(loc="best", frameon=False, fontsize=8)
    named = [(place, name.rpartition(".")[0]) for name, (_, place) in nodes.items()]
    named = [(place, name) for place, name in named if "." not in name]  # those inside a part speak for themselves
    shown = named[:: max(1, -(-len(named) // 20))]  # names of more nodes would overlap
    axes[-1].set_xticks([place for place, _ in shown], [name for _, name in shown], rotation=45)
    return figure


def _speed_units(slopes: Motions) -> tuple[str, ...]:
    return tuple(dict.fromkeys(unit for unit, _ in slopes.nodes.values()))
