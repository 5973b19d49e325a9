"""Start values of random networks: each is met with all else at rest, or refused with names that work."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import shaftwork as sw
from shaftwork.codegen.model_observer import ModelObserver
from shaftwork.codegen.state_transfer import StateTransfer
from shaftwork.components.shaft_models import ShaftModel
from tests.properties.examples import compiled, network_of, share_of_examples
from tests.strategies import Network, networks
from tests.trains import Train, trains

ROUNDING = 1e-9
"""Of the largest speed, or the largest torque: by so much start values may differ and not contradict each other."""
SHORT = 1e-9
"""s; only the first instant of a motion is looked at."""
VALUES = st.sampled_from([1.0, -3.0, 250.0, 1e-6, 0.0])
TWISTS = st.sampled_from([1e-3, -2e-3, 0.0])
"""rad; inside all rigid limits, beyond which no motion starts."""
MESHES = (sw.OneSpring(), sw.Lumped(1), sw.Lumped(4), sw.Spectral(3), sw.CentralDifference(5), sw.Rigid())


def observables(model: sw.Model) -> list[str]:
    """All that can be read of a network, states as well."""
    return [*dict.fromkeys((*model.states, *ModelObserver(model.form, model.bind).units))]


def values_of(names: Iterable[str], data: st.DataObject) -> dict[str, float]:
    """A value for each name."""
    return {name: data.draw(TWISTS if name.endswith(".phi") else VALUES) for name in names}


def at_the_start(model: sw.Model, initial: Mapping[str, float]) -> sw.Solution:
    """The motion for an instant."""
    return model.simulate(SHORT, initial=initial, t_eval=[0.0, SHORT], engine="scipy")


def named_in(message: str) -> list[str]:
    """The start values that a refusal asks for."""
    found = re.search(r"initial=\{(.*?)\}", message)
    return re.findall(r"'([^']+)':", found.group(1)) if found else []


def is_torque(name: str) -> bool:
    return name.rpartition(".")[2].partition("_")[0] in ("tau", "f", "i", "reaction", "phi", "s", "psi")


def assert_met(sol: sw.Solution, initial: Mapping[str, float]) -> None:
    """Every value holds, as part of the largest one of its kind; with an impact at once, it holds before that."""
    if any(time == 0.0 for time, *_ in sol.events):
        return
    for kind in (True, False):
        names = [name for name in initial if is_torque(name) is kind]
        size = max((abs(initial[name]) for name in names), default=0.0)
        size = max([size, *(abs(sol.x[0, k]) for k, name in enumerate(sol.states) if is_torque(name) is kind)])
        for name in names:
            reached = sol[name][0]
            if np.ndim(reached):  # along a shaft; at its ends, inertia of a mesh takes a share
                reached = reached[1:-1] if len(reached) > 2 else reached
            assert np.abs(reached - initial[name]).max() <= ROUNDING * size, name


def slopes(model: sw.Model, names: Iterable[str]) -> Any:
    """(names, n) by differences of what the model reads; the networks are linear."""
    observer, n = ModelObserver(model.form, model.bind), len(model.states)
    x, t = np.vstack([np.zeros(n), np.eye(n)]), np.zeros(n + 1)
    values = np.array([x[:, model.states.index(m)] if m in model.states else observer.signal(m, t, x) for m in names])
    values = values.reshape(-1, n + 1)
    return values[:, 1:] - values[:, :1]


def assert_all_else_rests(model: sw.Model, sol: sw.Solution, initial: Mapping[str, float]) -> None:
    """Every store that moves has a value of its own, or can have no other one beside the values that are given."""
    rest = model.simulate(SHORT, t_eval=[0.0, SHORT], engine="scipy")
    stores = StateTransfer(model.form)
    unit = np.vstack([np.zeros(len(model.states)), np.eye(len(model.states))])
    rows = stores.of(model.bind, np.zeros(len(unit)), unit)
    rows = (rows[1:] - rows[0]).T
    change = sol.x[0] - rest.x[0]
    torque = np.array([state.kind != "across" for state in model.form.states])
    for kind in (True, False):
        mine = torque == kind
        moved = np.abs(rows[:, mine] @ change[mine])
        told = [name for name in initial if is_torque(name) is kind]
        known = slopes(model, told)[:, mine]
        for store, size, row in zip(stores.names, moved, rows[:, mine], strict=True):
            if store in initial or size <= ROUNDING * moved.max(initial=0.0):
                continue
            rank = np.linalg.matrix_rank(known, tol=1e-9 * np.abs(known).max(initial=1e-300))
            with_it = np.vstack([known, row])
            assert np.linalg.matrix_rank(with_it, tol=1e-9 * np.abs(with_it).max()) == rank, store


def assert_met_or_told(model: sw.Model, initial: Mapping[str, float], data: st.DataObject) -> sw.Solution | None:
    """The motion that starts with values; where it is refused, the names in the message work, whatever their values."""
    try:
        sol = at_the_start(model, initial)
    except sw.ParameterError as refusal:
        message = str(refusal)
    else:
        assert_met(sol, initial)
        return sol
    other = values_of(named_in(message), data)
    assert other or not model.states, message
    assert_met(at_the_start(model, other), other)
    return None


def some_values(names: list[str], data: st.DataObject) -> dict[str, float]:
    """Values for some names."""
    return values_of(data.draw(st.lists(st.sampled_from(names), min_size=1, max_size=4, unique=True)), data)


@given(networks(min_parts=4, max_inertias=10), st.data())
@share_of_examples(0.06)
def test_start_values_are_met_with_all_else_at_rest_or_refused_with_names_that_work(
    pieces: Network, data: st.DataObject
) -> None:
    model = compiled(pieces)
    initial = some_values(observables(model), data)
    if (sol := assert_met_or_told(model, initial, data)) is not None:
        assert_all_else_rests(model, sol, initial)


@given(networks(min_parts=4, max_inertias=6), st.sampled_from(MESHES), st.sampled_from([0.0, 4.0]), st.data())
@share_of_examples(0.03)
def test_start_values_beside_a_shaft_are_met_or_refused_with_names_that_work(
    pieces: Network, mesh: ShaftModel, damping: float, data: st.DataObject
) -> None:
    net = network_of(pieces)
    rotors = st.sampled_from([piece.nodes[0] for piece in pieces if piece.type == "Inertia"])
    net.add(sw.Shaft("line", length=1.7, diameter=0.03, damping=damping, model=mesh), data.draw(rotors), "c")
    net.add(sw.Gear("last", ratio=2.0), "c", "free")
    net.add(sw.Inertia("end", J=0.3), "free")
    model = compiled(net)
    along = ["line.tau"] * (not isinstance(mesh, sw.Rigid))
    assert_met_or_told(model, some_values([*observables(model), *along], data), data)


@pytest.mark.slow
@given(trains(6), st.data())
@share_of_examples(0.06)
def test_start_values_of_networks_with_modes_are_met_or_refused_with_names_that_work(
    train: Train, data: st.DataObject
) -> None:
    model = train.compiled()
    assert_met_or_told(model, some_values(observables(model), data), data)
