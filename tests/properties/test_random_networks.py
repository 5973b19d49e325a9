"""The library against a referee that eliminates nothing: hundreds of random trains, every node and every part."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from hypothesis import Phase, find, given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from shaftwork import t
from tests.properties.examples import (
    across_signals,
    assert_equal_signals,
    compiled,
    inner_drives,
    processor_time_limit,
    share_of_examples,
    through_signals,
)
from tests.reference import mna
from tests.reference.mna import SOURCE_VALUE, Piece
from tests.strategies import Network, networks

TIMES = np.linspace(0.0, 0.5, 6)


@st.composite
def driven_networks(draw: st.DrawFn) -> tuple[Network, dict[str, mna.Signal]]:
    """A network whose sources step at t = 0, or rise along straight lines, and the referee's signals of the latter."""
    pieces = draw(networks())
    if draw(st.booleans()):
        return pieces, {}
    pieces = (*pieces, *draw(inner_drives(pieces)))
    signals = {p.name: mna.ramp(p.values[SOURCE_VALUE[p.type]]) for p in pieces if p.type in SOURCE_VALUE}
    return pieces, signals


def _rising(pieces: Network, signals: Mapping[str, mna.Signal]) -> Network:
    """The pieces with the values of the named sources times t, as laws of the library."""
    return tuple(
        Piece(p.type, p.name, p.nodes, {key: value * t for key, value in p.values.items()}) if p.name in signals else p
        for p in pieces
    )


@pytest.mark.slow
@pytest.mark.parametrize(("fewest", "most"), [(2, 2), (25, 30)])
def test_the_random_networks_are_small_and_large(fewest: int, most: int) -> None:
    def fits(pieces: Network) -> bool:
        return fewest <= sum(piece.type in ("Inertia", "Mass") for piece in pieces) <= most

    find(networks(), fits, settings=settings(max_examples=5000, phases=(Phase.generate,)))


@pytest.mark.slow
@share_of_examples()
@given(driven_networks())
def test_every_speed_and_every_torque_equals_that_of_the_referee(
    driven: tuple[Network, dict[str, mna.Signal]],
) -> None:
    """Tolerance 1e-7 of the largest value of the same quantity.

    Both sides are exact up to rounding. It is the referee that rounds most: it takes the torque of a geared inertia
    from an equation of higher index, which costs it half of its sixteen digits in one network of some thousands.
    """
    pieces, signals = driven
    with processor_time_limit(30.0):
        solution = compiled(_rising(pieces, signals)).simulate(TIMES[-1], t_eval=TIMES, engine="exact")
    response = mna.simulate(pieces, signals, TIMES)
    wanted = across_signals(pieces, response) | dict(through_signals(pieces, response))
    assert_equal_signals({name: solution[name] for name in wanted}, wanted, 1e-7)


@share_of_examples(0.2)
@given(networks(max_inertias=12))
def test_the_eigenvalues_are_those_of_the_whole_descriptor_system(pieces: Network) -> None:
    """Those that are not zero; zeros (free bodies, loops of springs) are counted by how the equations are written.

    Tolerance 1e-6 of the largest: rounding parts a double eigenvalue by the square root of the rounding.
    """
    model = compiled(pieces)
    own = np.linalg.eigvals(model.jacobian(0.0, np.zeros(len(model.states))).toarray())
    referee = mna.spectrum(pieces)
    size = max(np.abs(referee).max(initial=0.0), 1e-300)
    own, referee = (values[np.abs(values) > 1e-5 * size] for values in (own, referee))
    assert len(own) == len(referee)
    distance = np.abs(own[:, None] - referee)
    assert distance[linear_sum_assignment(distance)].max(initial=0.0) < 1e-6 * size
