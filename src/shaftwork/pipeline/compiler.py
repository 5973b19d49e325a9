"""From a netlist to a model: the state form of a sound network, and the kind of model that it needs."""

from __future__ import annotations

import gc
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

from shaftwork.core.errors import Diagnostic, NetworkError, NetworkWarning
from shaftwork.core.notices import warn
from shaftwork.formulation.angles import with_angles
from shaftwork.formulation.diagnosis import diagnose
from shaftwork.formulation.form import StateForm
from shaftwork.network.checks import SEPARATE, resting_trains
from shaftwork.network.netlist import Netlist
from shaftwork.pipeline.model import Model


def sound(netlist: Netlist) -> StateForm:
    """The state form of a network without errors, its parts in their first modes; warnings are issued."""
    return _sound(netlist, *diagnose(netlist)[1:])


def diagnose_motion(netlist: Netlist) -> tuple[StateForm | None, tuple[Diagnostic, ...]]:
    """The state form in which the numbers of modes are parameters, and every problem; nothing is raised.

    What a part lacks in its first mode, a node that a gap alone holds for one, is said of that.
    """
    _, form, problems = diagnose(replace(netlist, free_modes=True))
    if form is not None and _has_modes(form, netlist) and _errors(problems):
        in_first_modes = diagnose(netlist)[2]
        problems = in_first_modes if _errors(in_first_modes) else problems
    return form, problems


def _errors(problems: Iterable[Diagnostic], accepted: str = "") -> tuple[Diagnostic, ...]:
    return tuple(problem for problem in problems if problem.severity == "error" and problem.kind != accepted)


def _sound(netlist: Netlist, form: StateForm | None, problems: tuple[Diagnostic, ...], accepted: str = "") -> StateForm:
    """The state form, where nothing is wrong but for an accepted kind; warnings are issued."""
    if errors := _errors(problems, accepted):
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
            diagnosed, problems = diagnose_motion(netlist)
            form = _sound(netlist, diagnosed, problems, self.accepted)
            if self.angles:
                form = with_angles(form.graph, self.angles)
            apart = any(problem.kind == SEPARATE for problem in problems)
            return _kind_of_model(form, netlist)(form, netlist, self, resting_trains(form.graph) if apart else ())


def _has_modes(form: StateForm, netlist: Netlist) -> bool:
    """Whether parts of a network change their mode, and none is chosen."""
    return any(part.modes for part in form.graph.parts) and not any(item.choices for item in netlist.placed)


def _kind_of_model(form: StateForm, netlist: Netlist) -> type[Model]:
    """The kind of model that a network needs; that of one phase, in which modes are chosen, has no phases."""
    if _has_modes(form, netlist):
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
