"""From a netlist to a model: the state form of a sound network, and the kind of model that it needs."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

from shaftwork.core.errors import NetworkError, NetworkWarning
from shaftwork.core.notices import warn
from shaftwork.formulation.diagnosis import diagnose
from shaftwork.formulation.form import StateForm
from shaftwork.network.netlist import Netlist
from shaftwork.pipeline.angles import with_angles
from shaftwork.pipeline.model import Model


def sound(netlist: Netlist, accepted: str = "") -> StateForm:
    """The state form of a network without errors but for an accepted kind; warnings are issued."""
    _, form, problems = diagnose(netlist)
    if errors := tuple(problem for problem in problems if problem.severity == "error" and problem.kind != accepted):
        raise NetworkError(f"'{netlist.name}' cannot be assembled", errors)
    for problem in problems:
        if problem.severity == "warning":
            warn(str(problem), NetworkWarning)
    assert form is not None  # noqa: S101 (only errors leave no form)
    return form


@dataclass(frozen=True)
class Compiler:
    """Makes models, with the options of `Network.compile`; a stored model is made again by it.

    Args:
        angles: parts whose angle is recorded.
        accepted: kind of problem that is accepted.
    """

    angles: tuple[str, ...]
    accepted: str

    def __call__(self, netlist: Netlist) -> Model:
        """The model of a network.

        Raises:
            NetworkError: it cannot be assembled.
        """
        with _without_collection():
            form = sound(netlist, self.accepted)
            if self.angles:
                form = with_angles(form.graph, self.angles)
            return _kind_of_model(form, netlist)(form, netlist, self)


def _kind_of_model(form: StateForm, netlist: Netlist) -> type[Model]:
    """The kind of model that a network needs; that of one phase, in which modes are chosen, has no phases."""
    if any(part.modes for part in form.graph.parts) and not any(item.choices for item in netlist.placed):
        if form.waves:
            from shaftwork.waves.hybrid_wave_model import HybridWaveModel

            return HybridWaveModel
        from shaftwork.hybrid.hybrid_model import HybridModel

        return HybridModel
    if form.waves:
        from shaftwork.waves.wave_model import WaveModel

        return WaveModel
    return Model


@contextmanager
def _without_collection() -> Iterator[None]:
    """Pause the garbage collector: an assembly makes many records that all live on, and looking through them again and
    again makes its cost grow faster than the network (by a third at 10000 inertias).
    """
    running = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if running:
            gc.enable()
