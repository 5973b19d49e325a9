"""Start values of random networks: each is met with all else at rest, or refused with names that work."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

import shaftwork as sw
from shaftwork.codegen.observer import ModelObserver
from shaftwork.codegen.stores import Stores
from tests.properties.examples import compiled, share_of_examples
from tests.strategies import Network, networks
from tests.trains import Train, trains

ROUNDING = 1e-9
"""Of the largest speed, or the largest torque: by so much start values may differ and not contradict each other."""
SHORT = 1e-9
"""s; only the first instant of a motion is looked at."""
VALUES = st.sampled_from([1.0, -3.0, 250.0, 1e-6, 0.0])


def observables(model: sw.Model) -> list[str]:
    """All that can be read of a network, states as well."""
    return [*dict.fromkeys((*model.states, *ModelObserver(model.form, model.bind).units))]


def at_the_start(model: sw.Model, initial: Mapping[str, float]) -> sw.Solution:
    """The motion for an instant."""
    return model.simulate(SHORT, initial=initial, t_eval=[0.0, SHORT], engine="scipy")


def named_in(message: str) -> list[str]:
    """The start values that a refusal asks for."""
    found = re.search(r"initial=\{(.*?)\}", message)
    return re.findall(r"'([^']+)':", found.group(1)) if found else []


def is_torque(name: str) -> bool:
    return name.rpartition(".")[2].partition("_")[0] in ("tau", "f", "i", "phi", "s", "psi")


def assert_met(sol: sw.Solution, initial: Mapping[str, float]) -> None:
    """Every value holds, as part of the largest one of its kind."""
    for kind in (True, False):
        names = [name for name in initial if is_torque(name) is kind]
        size = max((abs(initial[name]) for name in names), default=0.0)
        size = max([size, *(abs(sol.x[0, k]) for k, name in enumerate(sol.states) if is_torque(name) is kind)])
        for name in names:
            assert abs(sol[name][0] - initial[name]) <= ROUNDING * size, name


def slopes(model: sw.Model, names: Iterable[str]) -> Any:
    """(names, n) by differences of what the model reads; the networks are linear."""
    observer, n = ModelObserver(model.form, model.bind), len(model.states)
    x, t = np.vstack([np.zeros(n), np.eye(n)]), np.zeros(n + 1)
    values = np.array([x[:, model.states.index(m)] if m in model.states else observer.signal(m, t, x) for m in names])
    values = values.reshape(-1, n + 1)
    return values[:, 1:] - values[:, :1]


def assert_rest_besides(model: sw.Model, sol: sw.Solution, initial: Mapping[str, float]) -> None:
    """Every store that moves has a value of its own, or no other one beside the values that are given."""
    rest = model.simulate(SHORT, t_eval=[0.0, SHORT], engine="scipy")
    stores = Stores(model.form)
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


def check(model: sw.Model, initial: Mapping[str, float], values: st.DataObject, *, linear: bool) -> bool:
    """Whether a start is met; where it is refused, the names in the message must work, with any values."""
    try:
        sol = at_the_start(model, initial)
    except sw.ParameterError as refusal:
        other = {name: values.draw(VALUES) for name in named_in(str(refusal))}
        assert other or not model.states, str(refusal)
        assert_met(at_the_start(model, other), other)
        return False
    assert_met(sol, initial)
    if linear:
        assert_rest_besides(model, sol, initial)
    return True


@given(networks(min_parts=4, max_inertias=10), st.data())
@share_of_examples(0.06)
def test_start_values_are_met_with_all_else_at_rest_or_refused_with_names_that_work(
    pieces: Network, data: st.DataObject
) -> None:
    model = compiled(pieces)
    names = data.draw(st.lists(st.sampled_from(observables(model)), min_size=1, max_size=4, unique=True))
    check(model, {name: data.draw(VALUES) for name in names}, data, linear=True)
