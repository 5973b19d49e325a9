"""A train that turns steadily and is shaken by orders: the amplitudes of its quantities at any speed.

Joins the frequency domain to the torsional calculation: it is loaded where one is made.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from shaftwork.codegen.model_observer import ModelObserver
from shaftwork.codegen.start_values import initial_state
from shaftwork.components.base import Signal
from shaftwork.core.calls import BoundedCache
from shaftwork.core.errors import ParameterError, no_quantity
from shaftwork.core.parameters import in_si
from shaftwork.core.storing import StoredByFields
from shaftwork.frequency import campbell as diagram
from shaftwork.frequency.analysis import refuse_no_point, speeds_to_give, turning_speeds
from shaftwork.frequency.exact_lines import ExactSlopes
from shaftwork.frequency.exact_networks import exact_shafts, small_motions
from shaftwork.frequency.exact_spectrum import ExactProblem
from shaftwork.frequency.frequency_response import StateEquations, forced_amplitudes
from shaftwork.frequency.linear_model import ExactModel, LinearModel, linear_model
from shaftwork.frequency.linearization import Linearization
from shaftwork.frequency.natural_modes import NaturalModes
from shaftwork.network.graph import GROUND, CircuitGraph, GraphPart, signals_of
from shaftwork.pipeline.arguments import Point, Time
from shaftwork.pipeline.compiler import Compiler
from shaftwork.pipeline.model import Model
from shaftwork.pipeline.network import LOOP, Network
from shaftwork.results.observer import Array, Complex
from shaftwork.torsional.order_excitations import (
    Misfire,
    OrderExcitation,
    amplitudes_of,
    order_excitations,
    orders_of,
    with_ratios,
    without_swing,
)


class Resonance(NamedTuple):
    """A speed at which an order meets a natural frequency.

    Args:
        speed: of the reference shaft, rad/s.
        order: per turn of it.
        mode: its name.
        frequency: Hz.
        damping: ratio.
    """

    speed: float
    order: float
    mode: str
    frequency: float
    damping: float


class PortPower(NamedTuple):
    """Where a part takes in power: the product of a torque (force, current) and the speed that belongs to it."""

    through: str
    across: str
    sign: float


@dataclass(frozen=True, eq=False)
class TurningTrain:
    """The operating points of a train that turns as a whole: all speeds go with that of the reference shaft.

    Args:
        model: the train.
        ratios: by name of a speed, its multiple.
    """

    model: Model
    ratios: Mapping[str, float]

    def __call__(self, speed: float) -> Point:
        """The point at a speed in rad/s."""
        return {name: speed * ratio for name, ratio in self.ratios.items()}

    @cached_property
    def _turning(self) -> Array:
        """(n,) the states at 1 rad/s."""
        return initial_state(self.model.bind(self.model.vector()), self.ratios, 0.0)

    def near(self, t: Time, inputs: tuple[str, ...]) -> Callable[[float], LinearModel]:
        """From a speed in rad/s to the train about its point, with the laws of a time in s; assembled once for all."""
        p = self.model.vector()
        time = self.model.settled(p) if t is None else in_si("t", t, "s")
        slopes = Linearization(self.model, p, self._turning, time, inputs)

        def about(speed: float) -> LinearModel:
            x = speed * self._turning
            return linear_model(f"{self.model.name} at {speed:.5g} rad/s", slopes.moved(x, time), None, x, time)

        return about


@dataclass(frozen=True, eq=False)
class ForcedTrain(StoredByFields):
    """A train with its excitations, compiled once for all speeds.

    Args:
        network: the train with mean torques alone.
        model: it, compiled.
        excitations: with the ratios of their shafts.
        at: the point about which small motions are taken, or a function from the speed to it.
        exact: whether shafts are taken without a mesh.
        t: time at which laws are read, s.
    """

    network: Network
    model: Model
    excitations: tuple[OrderExcitation, ...]
    at: Point | Callable[[float], Point]
    exact: bool
    t: Time

    @property
    def failing(self) -> tuple[str, ...]:
        """The cylinders that misfire."""
        return tuple(one.source.name for one in self.excitations if one.changed)

    @cached_property
    def orders(self) -> tuple[float, ...]:
        """(k,) of the reference shaft, ascending."""
        return orders_of(self.excitations)

    @cached_property
    def _near(self) -> Callable[[float], LinearModel | ExactModel]:
        """From a speed in rad/s to the train about its point; one for all speeds where the point is the same."""
        motions = small_motions(self.model, Compiler((), LOOP), every=self.exact)
        inputs, at = tuple(one.name for one in self.excitations), self.at
        if not callable(at):
            always = motions(at, self.t, inputs)
            return lambda _: always
        # Speeds beside some ten resonances, and what a user gives, are some hundred.
        points = BoundedCache[float, LinearModel | ExactModel](2000)
        if isinstance(at, TurningTrain) and not exact_shafts(self.model.netlist, every=self.exact):
            about = at.near(self.t, inputs)
            return lambda speed: points(speed, lambda: about(speed))
        return lambda speed: points(speed, lambda: motions(at(speed), self.t, inputs))

    def amplitudes(self, speeds: Array, names: Sequence[str]) -> dict[str, Complex]:
        """Complex amplitudes of quantities in every order at speeds in rad/s: (n, k), along a part (n, k, places).

        Law: of the order k the torques of all sources swing as exp(i k n t), and each quantity with them. Infinite
        where an undamped natural frequency is hit exactly.

        Raises:
            SignalError: there is no such quantity.
        """
        if not callable(self.at):
            return self._about(self._near(0.0), speeds, names)
        rows = [self._about(self._near(float(speed)), np.array([speed]), names) for speed in speeds]
        return {name: np.concatenate([row[name] for row in rows]) for name in names}

    def _about(self, near: LinearModel | ExactModel, speeds: Array, names: Sequence[str]) -> dict[str, Complex]:
        slopes = near.slopes
        for name in names:
            if name not in slopes.units and name not in slopes.profiles:
                raise no_quantity(name, near.title, (*slopes.units, *slopes.profiles))
        system = ExactProblem(slopes) if isinstance(slopes, ExactSlopes) else StateEquations(slopes)
        s = 1j * np.multiply.outer(speeds, np.asarray(self.orders)).ravel()
        v = amplitudes_of(self.excitations, self.orders, speeds).reshape(len(self.excitations), -1)
        values = forced_amplitudes(slopes, system, s, v, names)
        shape = (len(speeds), len(self.orders))
        return {name: each.reshape(*shape, *each.shape[1:]) for name, each in zip(names, values, strict=True)}

    def places(self, name: str) -> tuple[float, ...]:
        """The places in m at which a quantity along a part is read; of any other none."""
        profiles = ModelObserver(self.model.form, self.model.bind).profiles
        return profiles[name][1] if name in profiles else ()

    def modes(self, speed: float, f_max: float | None) -> NaturalModes:
        """The modes about the point of a speed in rad/s, up to a frequency in Hz."""
        near = self._near(speed)
        return near.modes(None, f_max if isinstance(near, ExactModel) else None)

    def resonances(self, speeds: Array) -> tuple[Resonance, ...]:
        """Where excited orders meet natural frequencies between the first and the last of the speeds, ascending."""
        top = max(self.orders) * float(speeds[-1]) / (2 * np.pi)
        if not callable(self.at):
            modes = self.modes(float(speeds[0]), top)
            swinging = [row for row in modes.table if row[3].imag > 0]
            met = [
                Resonance(2 * np.pi * frequency / order, order, name, frequency, damping)
                for name, frequency, damping, _, _ in swinging
                for order in self.orders
            ]
            inside = (one for one in met if speeds[0] <= one.speed <= speeds[-1])
            return tuple(sorted(inside))
        return tuple(
            Resonance(one.speed, one.order, one.mode, one.frequency, self._damping(one.speed, one.frequency))
            for one in self.campbell(speeds, self.orders, top).crossings
        )

    def campbell(self, speeds: Array, orders: Any, f_max: float | None) -> diagram.Campbell:
        """Natural frequencies at the operating points from the first to the last of the speeds, with orders.

        Raises:
            ParameterError: orders or f_max are not what they must be.
        """

        def modes(speed: float, f_max: float) -> tuple[NaturalModes, str]:
            return self.modes(speed, f_max), self._near(speed).phase

        # Frequencies are smooth over the speed: between two of 41, 2.5 % of the range apart, they are nearly straight.
        coarse = np.linspace(speeds[0], speeds[-1], 41)
        return diagram.campbell(self.network.name, modes, coarse, orders, f_max, constant=not callable(self.at))

    def _damping(self, speed: float, frequency: float) -> float:
        modes = self.modes(speed, 1.1 * frequency)
        return float(modes.damping[np.abs(modes.frequencies - frequency).argmin()])

    @cached_property
    def ports(self) -> Mapping[str, tuple[PortPower, ...]]:
        """By part, where it takes in power."""
        graph = self.model.form.graph
        return {part.name: tuple(_ports_of(graph, part)) for part in graph.parts}


def _ports_of(graph: CircuitGraph, part: GraphPart) -> Iterator[PortPower]:
    signals: dict[tuple[Any, ...], dict[str, tuple[str, Signal]]] = {}
    for name, signal in signals_of(graph, part).items():
        if signal.kind in ("through", "across"):
            signals.setdefault(signal.ends, {})[signal.kind] = (name, signal)
    for pair in signals.values():
        if len(pair) == 2:
            (through, first), (across, second) = pair["through"], pair["across"]
            yield PortPower(f"{part.name}.{through}", f"{part.name}.{across}", float(first.sign * second.sign))


def forced_train(
    net: Network,
    misfire: Misfire,
    at: Point | Callable[[float], Point],
    *,
    exact: bool,
    t: Time,
) -> ForcedTrain:
    """The train of a network and what excites it.

    Raises:
        ParameterError: there is no harmonic torque, the speed of its shaft does not follow from that of the first, or
            the train swings otherwise where it runs and no point is given.
        NetworkError: the network cannot be assembled.
    """
    excitations = order_excitations(net, misfire)
    steady = without_swing(net, excitations)
    model = Compiler((), LOOP)(steady.netlist())
    graph = model.form.graph
    reference, ratios = _ratios(graph, excitations)
    if at is None:
        at = _turning(model, reference)
    return ForcedTrain(steady, model, with_ratios(excitations, ratios), at, exact, t)


def _ratios(graph: CircuitGraph, excitations: Sequence[OrderExcitation]) -> tuple[int, list[float]]:
    """The node of the reference shaft, and the speeds of the shafts of all excitations over its own.

    Raises:
        ParameterError: one does not follow.
    """
    parts = {part.name: part for part in graph.parts}
    nodes = [parts[one.source.name].nodes for one in excitations]
    reference = next(node for node in nodes[0].values() if node != GROUND)
    speeds = {GROUND: 0.0, **turning_speeds(graph, reference)}
    ratios = []
    for one, ends in zip(excitations, nodes, strict=True):
        first, *others = ends.values()
        missing = next((node for node in ends.values() if node not in speeds), None)
        if missing is not None:
            raise ParameterError(
                f"HarmonicTorque '{one.source.name}': the speed of its node '{graph.node_name(missing)}' does not "
                f"follow from that of '{graph.node_name(reference)}', so that its orders have no frequency. Join "
                "them by springs, shafts or gears. Of a planetary gear between them hold the third shaft: wire it to "
                "'ground', or give it a SpeedSource of omega = 0; a brake or a friction there may slip."
            )
        ratios.append(speeds[first] - sum(speeds[node] for node in others))
        if ratios[-1] == 0:
            raise ParameterError(
                f"HarmonicTorque '{one.source.name}': its two nodes turn alike, so that its angle stays. Give it the "
                "one node whose angle counts."
            )
    return reference, ratios


def _turning(model: Model, reference: int) -> Point | Callable[[float], Point]:
    """The train that turns as a whole, where its laws depend on the speed; else rest, as it is the same everywhere.

    Raises:
        ParameterError: how the train turns is open, or its parts change their mode.
    """
    modal = any(part.modes for part in model.form.graph.parts)
    if model.linear and not modal:
        return None
    ratios = speeds_to_give(model, reference)
    if modal or any(ratio is None for ratio in ratios.values()):
        refuse_no_point(model, "A torsional calculation")
    return TurningTrain(model, {name: float(ratio or 0.0) for name, ratio in ratios.items()})
