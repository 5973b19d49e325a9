"""Sensitivities of random trains with gaps, frictions, brakes, clutches and impacts equal central differences."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import shaftwork as sw
from shaftwork.results.measures import Measure
from shaftwork.studies import motion_sensitivities
from tests.properties.examples import Array, share_of_examples
from tests.trains import Train, trains

STEP = 2e-6
"""Of a parameter, relative; the order of events is then the same, nearly always."""
CLOSE = 1e-6
MOST_REFUSED = 1
"""Of five trains: what rests on two parts at once, or starts on a limit, has no derivative that can be known."""
MOST_EVENTS = 40
"""An error grows with every event, and that of a difference is the same error over its step."""


@pytest.mark.slow
@given(st.lists(trains(most=3), min_size=5, max_size=5))
@share_of_examples(0.004)
def test_sensitivities_equal_central_differences_and_are_seldom_refused(several: list[Train]) -> None:
    assert sum(not agrees(train) for train in several) <= MOST_REFUSED


def agrees(train: Train) -> bool:
    """Compare one parameter of a train, if it is not refused."""
    last = [part.name for part in train.parts if part.type == "Inertia"][-1]
    measures = ["end inertia1.omega", f"mean {last}.omega"]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.NetworkWarning)  # parts may be loose of each other on purpose
        warnings.simplefilter("ignore", sw.AccuracyWarning)
        net = sw.Network("train")
        for part in train.parts:
            net.add(getattr(sw, part.type)(part.name, **part.values), *part.nodes)
        model = net.compile()
        states = {state.name for state in model.form.states}
        initial = {name: value for name, value in train.initial.items() if name in states}
        try:
            made = motion_sensitivities(net, measures, t_end=train.t_end, initial=initial)
        except sw.SimulationError:
            return False
        names = [name for name in made.parameters if not name.endswith((".efficiency", ".restitution", ".omega_rest"))]
        name = names[len(train.parts) % len(names)]
        value = made.parameters[name]

        def of(share: float) -> tuple[Array, list[tuple[str, ...]]]:
            changed = {name: value * (1 + share)}
            run = model.simulate(train.t_end, initial=initial, parameters=changed, rtol=1e-13, t_eval=2)
            read = np.array([Measure.read(text).of(run) for text in measures])
            return read, [tuple(event[1:]) for event in run.events]

        runs = [of(share) for share in (0.0, STEP, -STEP, STEP / 2, -STEP / 2)]
    if any(events != runs[0][1] for _, events in runs) or len(runs[0][1]) > MOST_EVENTS:
        return True
    far, near = ((runs[k][0] - runs[k + 1][0]) / (2 * step) for k, step in ((1, STEP), (3, STEP / 2)))
    found = value * np.array([made[text][name] for text in measures])
    expected = 2 * near - far  # where one of two that come together moves, the error is of first order
    size = max(1.0, float(np.abs(runs[0][0]).max()), float(np.abs(expected).max()))
    assert (np.abs(found - expected) <= CLOSE * size + 2 * np.abs(near - far)).all(), (name, found, expected)
    return True
