"""What `shaftwork check` says of a network before anything is simulated."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from shaftwork.codegen.compiled_model import CompiledModel
from shaftwork.core.errors import SimulationError
from shaftwork.core.screen import counted
from shaftwork.pipeline.model import Model
from shaftwork.pipeline.network import Network


def structure_report(net: Network, model: Model, t_end: float) -> str:
    """Structure, states, time constants, stiffness, and the engine that "auto" would take, as text.

    Args:
        net: the network.
        model: compiled from it.
        t_end: end of the motion that the engine is chosen for, s.
    """
    return "\n".join(_lines(net, model, t_end))


def _lines(net: Network, model: Model, t_end: float) -> Iterator[str]:
    from shaftwork.frequency.eigenvalues import LARGEST_DENSE

    graph = model.form.graph
    counts = (len(graph.parts), "part"), (len(graph.nodes), "node"), (len(graph.branches), "branch")
    yield f"{net.name}: {', '.join(counted(number, what) for number, what in counts)}"
    for problem in net.check():
        yield f"  {problem.severity}: {problem}"
    if graph.zeros:
        yield f"left out, being zero: {_some(graph.zeros)}"
    equations, phase = _equations(model)
    when = " in motion" if phase else ""
    yield f"states{when} ({len(equations.states)}): {_some(equations.states)}"
    dependent = [graph.part_of(k).name for k in (*model.form.dependent_across, *model.form.dependent_through)]
    if dependent:
        yield f"eliminated stores ({len(dependent)}): {_some(dependent)}"
    cost = equations.cost()
    yield f"right-hand side{when}: {cost.form} code, {cost.total} operations; {cost.entries} entries in the linear part"
    if 0 < len(equations.states) <= LARGEST_DENSE:
        for point in _points(model, equations, phase):
            yield from _time_constants(*point)
    name, why = model.choose_engine(t_end)
    yield f"engine for {t_end:g} s: {name}, {why}"


def _equations(model: Model) -> tuple[CompiledModel, str]:
    """The equations, and their phase: where parts change their mode that in which nothing holds."""
    if not model.phased:
        return model, ""
    from shaftwork.hybrid.named_phases import whole_name

    phase = whole_name(model.form.graph)
    return model.phase(phase), phase


def _points(
    model: Model, equations: CompiledModel, phase: str
) -> Iterator[tuple[str, Sequence[str], NDArray[np.float64]]]:
    """Words, states and slopes at rest; where parts change their mode also of the phase in which nothing holds."""
    states = equations.states
    slopes = np.asarray(equations.jacobian(0.0, np.zeros(len(states))).toarray())
    if not phase:
        yield "at rest", states, slopes
        return
    with suppress(SimulationError):  # a law has no finite slope there, as those below say of the phase in motion
        rest = model.linearize()
        yield rest.title.removeprefix(model.name).strip(), rest.states, _dense(rest.A)
    yield f"in motion ({phase})", states, slopes


def _dense(matrix: Any) -> NDArray[np.float64]:
    return np.asarray(matrix.toarray() if sparse.issparse(matrix) else matrix)


def _time_constants(words: str, states: Sequence[str], jacobian: NDArray[np.float64]) -> Iterator[str]:
    if not np.isfinite(jacobian).all():
        steep = [states[k] for k in np.flatnonzero(~np.isfinite(jacobian).all(axis=1)).tolist()]
        yield f"time constants {words}: none, since {_some(steep)} has no finite slope there"
        return
    eigenvalues: NDArray[np.complex128] = np.linalg.eigvals(jacobian).astype(complex)
    size = np.abs(eigenvalues)
    moving = eigenvalues[size > 1e-9 * size.max(initial=0.0)]
    swings = np.unique(np.round(np.abs(moving[moving.imag > 1e-9 * np.abs(moving)]) / (2 * np.pi), 12))
    decays = np.sort(-1 / moving.real[moving.real < -1e-12 * np.abs(moving)])
    if swings.size:
        yield f"natural frequencies {words} ({swings.size}): {_some([f'{f:.5g}' for f in swings])} Hz"
    if decays.size:
        ratio = decays[-1] / decays[0]
        yield f"time constants {words}: {decays[0]:.3g} s to {decays[-1]:.3g} s, stiffness ratio {ratio:.3g}"
    if not (swings.size or decays.size):
        yield f"time constants {words}: none"
    if (moving.real > 1e-9 * np.abs(moving)).any():
        yield f"unstable {words}: grows within {1 / moving.real.max():.3g} s (a motor's starting curve does this)"


def _some(names: Sequence[object], most: int = 12) -> str:
    listed = [str(name) for name in names]
    return ", ".join(listed if len(listed) <= most else [*listed[: most - 1], "...", listed[-1]])
