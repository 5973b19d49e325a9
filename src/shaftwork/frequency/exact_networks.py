"""Networks with exact shafts in the frequency domain: which shafts, at which point, and the meshes to start from."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, cast

import numpy as np

from shaftwork.codegen.array_form.elements import Array
from shaftwork.codegen.array_form.recovery import BranchHistory
from shaftwork.codegen.model_observer import ModelObserver
from shaftwork.codegen.start_values import initial_state
from shaftwork.components.modes import ModeChoice
from shaftwork.components.shaft_models import MOST_SPECTRAL, OneSpring, Rigid, Spectral, Wave
from shaftwork.components.shafts import Shaft
from shaftwork.core.calls import BoundedCache
from shaftwork.core.errors import AccuracyWarning, NetworkWarning, ParameterError
from shaftwork.core.notices import muted
from shaftwork.frequency.analysis import (
    SmallMotions,
    about,
    input_names,
    moment_of,
    near,
    operating_point,
    titled,
)
from shaftwork.frequency.exact_lines import ExactLines, ExactSlopes
from shaftwork.frequency.linear_model import ExactModel
from shaftwork.frequency.linearization import Linearization
from shaftwork.frequency.natural_modes import NaturalModes, find_modes
from shaftwork.network.graph import resolve
from shaftwork.network.netlist import Netlist
from shaftwork.pipeline.arguments import Names, Point, Time
from shaftwork.pipeline.model import Model
from shaftwork.results.solution import Solution

if TYPE_CHECKING:
    from shaftwork.hybrid.hybrid_model import HybridModel

Compile = Callable[[Netlist], Model]
OWN = Spectral(16)
"""The mesh in place of a wave where quantities are named and operating points are read."""


def small_motions(model: Model, compiled: Compile, *, every: bool) -> SmallMotions:
    """The way from a point to the network near it: by matrices, or with exact shafts where there are any.

    Args:
        model: the network as it is.
        compiled: makes the model of a changed netlist.
        every: whether all its shafts are exact, or those alone that are waves.
    """
    shafts = exact_shafts(model.netlist, every=every)
    if shafts and model.phased:
        return ExactPhases(cast("HybridModel", model), compiled, shafts).near
    if shafts:
        return ExactNetwork(model, compiled, shafts).near
    return model.near


def exact_shafts(netlist: Netlist, *, every: bool) -> dict[str, Shaft]:
    """The shafts that are taken without a mesh, by name."""
    shafts = {placed.part.name: placed.part for placed in netlist.placed if isinstance(placed.part, Shaft)}
    without = Rigid | OneSpring
    return {
        name: shaft
        for name, shaft in shafts.items()
        if isinstance(shaft.resolved, Wave) or (every and not isinstance(shaft.resolved, without))
    }


class ExactNetwork:
    """A network with some shafts exact, compiled once for many points.

    Args:
        model: the network as it is.
        compiled: makes the model of a changed netlist.
        shafts: the exact ones, by name, in the order of the network.
    """

    def __init__(self, model: Model, compiled: Compile, shafts: Mapping[str, Shaft]) -> None:
        self._model, self._compiled, self._shafts = model, compiled, shafts
        self._meshes = BoundedCache[tuple[int, ...], Model]()

    @cached_property
    def _own(self) -> Model:
        """The network with meshes, as it is but for waves."""
        return _without_waves(self._model, self._compiled, self._shafts)

    @cached_property
    def _open(self) -> Model:
        """The network in which the exact shafts are lossless waves: an impedance beside a history at each end."""
        lossless: dict[str, Any] = {"model": Wave(), "damping": 0.0, "friction": 0.0}
        changed = {name: dataclasses.replace(shaft, **lossless) for name, shaft in self._shafts.items()}
        return _with_shafts(self._model, self._compiled, changed)

    @cached_property
    def _values(self) -> tuple[Mapping[str, float], ...]:
        """The parameters of the exact shafts in SI."""
        return tuple(resolve(shaft)[0] for shaft in self._shafts.values())

    @cached_property
    def lines(self) -> ExactLines:
        """The exact shafts."""
        rows = []
        for p in self._values:
            area = np.pi * (p["diameter"] ** 4 - p["inner_diameter"] ** 4) / 32
            stiffness, impedance = p["shear_modulus"] * area, area * np.sqrt(p["density"] * p["shear_modulus"])
            delay = p["length"] * np.sqrt(p["density"] / p["shear_modulus"])
            rows.append((delay, impedance, p["friction"] * p["length"] / (2 * impedance), p["damping"] / stiffness))
        return ExactLines(tuple(self._shafts), *np.array(rows).T)

    def near(self, at: Point, t: Time = None, inputs: Names = ()) -> ExactModel:
        """The network near a point; arguments as for `Model.linearize`.

        Raises:
            SignalError: there is no such input.
            SimulationError: a law has no finite slope at the point.
        """
        point, t = _on_meshes(at, t, self._model, self._own, self.lines.names)
        p = self._own.vector()
        time, x = operating_point(self._own, p, point, t, self._own.settled(p))
        return self.around(time, x, inputs, titled(self._model.name, near(self._own, at, time)))

    def around(self, time: float, x: Array, inputs: Names, title: str, phase: str = "") -> ExactModel:
        """The network near a point that is known.

        Args:
            time: at which laws are read, s.
            x: (n,) the states of the network with meshes in place of waves.
            inputs: names; None for all sources.
            title: what is linearised.
            phase: the modes of its parts there, in words.

        Raises:
            SignalError: there is no such input.
            SimulationError: a law has no finite slope at the point.
        """
        values, names = self._read(time, x), input_names(self._own, inputs)
        slopes = ExactSlopes(
            open=self._opened(values, time, names, BranchHistory(self._own.bind(), np.array([time]), x[None, :])),
            lines=self.lines,
            meshed=Linearization(self._own, self._own.vector(), x, time, ()),
            profiles=ModelObserver(self._model.form, self._model.bind).profiles,
            lengths=tuple(p["length"] for p in self._values),
        )
        return ExactModel(title, slopes, partial(self._starts, values, time), phase)

    def _read(self, time: float, x: Array) -> dict[str, float]:
        """The states of the open network at the point, and speeds and torques of the ends of the shafts."""
        places = {name: k for k, name in enumerate(self._own.states)}
        observer = ModelObserver(self._own.form, self._own.bind)
        ends = (
            f"{name}.{quantity}_{end}" for name in self.lines.names for quantity in ("omega", "tau") for end in "ab"
        )
        at = (np.array([time]), x[None, :])
        return {
            name: float(x[places[name]]) if name in places else float(observer.signal(name, *at)[0])
            for name in (*self._open.states, *ends)
        }

    def _opened(
        self, values: Mapping[str, float], time: float, inputs: tuple[str, ...], point: BranchHistory
    ) -> Linearization:
        """The open network at the point, its algebraic loops solved as they are there."""
        graph = self._open.form.graph
        branches = {part.name: part.branches for part in point.form.graph.parts}
        loops = self._open.bind().loops
        if loops is not None:
            parts = ((k, graph.part_of(k)) for k in self._open.form.loop_laws)
            same = [branches[part.name][part.branches.index(k)] for k, part in parts]
            loops.start_from(point.through[same, 0])
        x = np.array([values[name] for name in self._open.states])
        arriving = [
            sign * values[f"{name}.tau_{end}"] - impedance * values[f"{name}.omega_{end}"]
            for name, impedance in zip(self.lines.names, self.lines.impedance.tolist(), strict=True)
            for end, sign in (("a", 1.0), ("b", -1.0))
        ]
        return Linearization(self._open, self._open.vector(), x, time, inputs, np.array(arriving))

    def _starts(self, values: Mapping[str, float], time: float, radius: float, attempt: int) -> NaturalModes:
        """The modes of the network with meshes that are right for |rate| up to a radius."""
        model = self._meshed(radius, attempt)
        torques = tuple(f"{name}.tau_{end}" for name in self.lines.names for end in "ab")
        start = {name: value for name, value in values.items() if name not in torques}
        x = np.zeros(len(model.states)) if model.linear else initial_state(model.bind(), start, time)
        return find_modes(model.name, Linearization(model, model.vector(), x, time, ()))

    def _meshed(self, radius: float, attempt: int) -> Model:
        waves = self.lines.half_waves(radius)
        # Two for each half wave and eight besides start a search to some nine digits; each attempt is finer.
        degrees = tuple(int(n) for n in np.ceil((2.0 * waves + 8) * 1.4**attempt))
        if max(degrees) > MOST_SPECTRAL:
            shaft = self.lines.names[int(waves.argmax())]
            raise ParameterError(
                f"Up to {radius / (2 * np.pi):.4g} Hz there are {waves.max():.0f} half waves along shaft '{shaft}', "
                f"more than are sought for. Give a smaller f_max or count, or divide the shaft into several in a row."
            )
        shafts = zip(self._shafts.items(), degrees, strict=True)
        changed = {name: dataclasses.replace(shaft, model=Spectral(degree)) for (name, shaft), degree in shafts}
        return self._meshes(degrees, lambda: _with_shafts(self._model, self._compiled, changed))


class ExactPhases:
    """A network whose parts change their mode, with some shafts exact; compiled once for each phase.

    Args:
        model: the network as it is.
        compiled: makes the model of a changed netlist.
        shafts: the exact ones, by name, in the order of the network.
    """

    def __init__(self, model: HybridModel, compiled: Compile, shafts: Mapping[str, Shaft]) -> None:
        self._model, self._compiled, self._shafts = model, compiled, shafts
        self._networks = BoundedCache[tuple[str, ...], ExactNetwork]()

    @cached_property
    def _own(self) -> HybridModel:
        """The network with meshes in place of waves, which tells the modes at a point."""
        meshed = _without_waves(self._model, self._compiled, self._shafts)
        return cast("HybridModel", meshed)  # its other parts are the same

    def near(self, at: Point, t: Time = None, inputs: Names = ()) -> ExactModel:
        """The network near a point, in the modes that go on there; arguments as for `Model.linearize`.

        Raises:
            SignalError: there is no such input.
            SimulationError: a law has no finite slope at the point.
        """
        point, t = _on_meshes(at, t, self._model, self._own, tuple(self._shafts))
        time, state = self._own.hybrid_state_at({}, point, t)
        modes = state.regime.modes
        network = self._networks(modes, lambda: ExactNetwork(self._in(modes), self._compiled, self._shafts))
        phase = self._model.words(state)
        title = titled(self._model.name, about(self._model, at, time), phase)
        return network.around(time, state.x, inputs, title, phase)

    def _in(self, modes: tuple[str, ...]) -> Model:
        """The network in one phase."""
        equation_sets, chosen = self._model.equation_sets, dict[str, tuple[ModeChoice, ...]]()
        netlist = equation_sets.of(modes).model.netlist
        forms = {item.part.name: iter(item.choices) for item in netlist.placed}
        for machine, name in zip(equation_sets.machines, modes, strict=True):
            owner = machine.part.name
            choice = dataclasses.replace(next(forms[owner]), value=machine.modes[name].value)
            chosen[owner] = (*chosen.get(owner, ()), choice)
        with muted(NetworkWarning):
            return self._compiled(netlist.with_choices(chosen))


def _with_shafts(model: Model, compiled: Compile, shafts: Mapping[str, Shaft]) -> Model:
    """The network with some shafts replaced, by name, in the modes that are chosen.

    Its warnings are those of the network itself, already given.
    """
    if not shafts:
        return model
    with muted(NetworkWarning, AccuracyWarning):
        return compiled(model.netlist.with_parts(lambda part: shafts.get(part.name, part)))


def _without_waves(model: Model, compiled: Compile, shafts: Mapping[str, Shaft]) -> Model:
    """The network with meshes in place of its waves."""
    waves = {name: shaft for name, shaft in shafts.items() if isinstance(shaft.resolved, Wave)}
    return _with_shafts(model, compiled, {name: dataclasses.replace(shaft, model=OWN) for name, shaft in waves.items()})


def _on_meshes(at: Point, t: Time, model: Model, meshed: Model, shafts: tuple[str, ...]) -> tuple[Point, Time]:
    """A point and its time for a network with meshes: of a motion with waves the speeds and torques that these have."""
    if not isinstance(at, Solution) or meshed is model:
        return at, t
    time, x = moment_of(at, model.states)
    ends = {name: float(at[name][0]) for shaft in shafts for name in (f"{shaft}.omega_a", f"{shaft}.omega_b")}
    values = x[: len(model.states)].tolist()  # behind the states x has the waves
    return {**dict(zip(model.states, values, strict=True)), **ends}, time if t is None else t
