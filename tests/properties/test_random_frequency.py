"""Frequency response and modes of random trains against a referee that eliminates nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import Phase, find, given, settings
from hypothesis import strategies as st
from scipy.optimize import linear_sum_assignment

from shaftwork.frequency.linear_model import LinearModel
from tests.properties.examples import (
    across_signals,
    assert_equal_signals,
    compiled,
    inner_drives,
    share_of_examples,
    through_signals,
)
from tests.reference import mna
from tests.reference.mna import SOURCE_VALUE
from tests.reference.pencil import Reduced
from tests.strategies import Network, networks

F = np.array([0.03, 0.7, 5.0])


def _amplitudes(r: Reduced, source: int, f: np.ndarray) -> np.ndarray:
    """All unknowns (unknowns, k) under the source exp(s t), s = 2 pi i f: x = (s I - J)^-1 G, y = -sum s^k N^k H."""
    made = np.zeros((r.V.shape[0], len(f)), dtype=complex)
    for k, s in enumerate(2j * np.pi * f):
        made[:, k] = r.V @ np.linalg.solve(s * np.eye(len(r.J)) - r.J, r.G[:, source].astype(complex))
        term = r.H[:, source].astype(complex)
        for _ in range(r.index + 1):
            made[:, k] -= r.W @ term
            term = s * (r.N @ term)
    return made


def _transfer(linear: LinearModel, f: np.ndarray) -> np.ndarray:
    """C (s I - A)^-1 B + D + s D1, (outputs, inputs, k)."""
    identity = np.eye(len(linear.states))
    made = [
        linear.C @ np.linalg.solve(s * identity - linear.A, linear.B) + linear.D + s * linear.D1 for s in 2j * np.pi * f
    ]
    return np.stack(made, axis=2)


@st.composite
def _driven(draw: st.DrawFn) -> Network:
    pieces = draw(networks())
    return (*pieces, *draw(inner_drives(pieces))) if draw(st.booleans()) else pieces


def test_random_networks_have_several_sources() -> None:
    def several(pieces: Network) -> bool:
        return sum(piece.type in SOURCE_VALUE for piece in pieces) > 2

    find(_driven(), several, settings=settings(max_examples=100, phases=(Phase.generate,)))


@pytest.mark.slow
@share_of_examples(0.2)
@given(_driven())
def test_every_quantity_responds_to_all_sources_as_the_referee_says(pieces: Network) -> None:
    """Tolerance 1e-6 of the largest amplitude of the same quantity; see the comparison in time for who rounds.

    All sources swing at once, so that no quantity is compared with the rounding of one that rests.
    """
    d = mna.descriptor(pieces)
    r = mna.reduce(d)
    drives = [piece for piece in pieces if piece.type in SOURCE_VALUE]
    inputs = [f"{drive.name}.{SOURCE_VALUE[drive.type]}" for drive in drives]
    z = sum((_amplitudes(r, k, F) for k in range(len(drives))), start=np.zeros((len(d.unknowns), len(F))))
    response = mna.named(d.unknowns, r.determined, F.astype(complex), z)
    wanted = across_signals(pieces, response) | dict(through_signals(pieces, response))
    linear = compiled(pieces).linearize(outputs=tuple(wanted))
    assert sorted(linear.inputs) == sorted(inputs)
    found = dict(zip(linear.outputs, _transfer(linear, F).sum(axis=1), strict=True))
    some = list(wanted)[:: max(1, len(wanted) // 3)]
    found |= {name: sum(linear.frequency_response(own, name, F).values for own in inputs) for name in some}
    assert_equal_signals(found, wanted, 1e-6)


@pytest.mark.slow
@share_of_examples(0.2)
@given(networks(max_inertias=12))
def test_the_modes_are_the_eigenvalues_of_the_whole_descriptor_system(pieces: Network) -> None:
    """Those that are not zero, each pair once; tolerance 1e-6 of the largest, as two may nearly be one."""
    rates, referee = compiled(pieces).linearize(inputs=()).modes().rates, mna.spectrum(pieces)
    size = max(np.abs(referee).max(initial=0.0), 1e-300)
    own = np.concatenate([rates, rates[rates.imag > 0].conj()])
    own, referee = (values[np.abs(values) > 1e-5 * size] for values in (own, referee))
    assert len(own) == len(referee)
    distance = np.abs(own[:, None] - referee)
    assert distance[linear_sum_assignment(distance)].max(initial=0.0) < 1e-6 * size


@share_of_examples(0.1)
@given(networks(max_inertias=12))
def test_a_shape_satisfies_the_equations_of_its_mode(pieces: Network) -> None:
    """A x = rate x in every mode, to 1e-7 of the largest term of all modes, in states of equal units."""
    linear = compiled(pieces).linearize(inputs=())
    modes, A = linear.modes(), linear.slopes.A
    left, right = A @ modes.vectors, modes.vectors * modes.rates
    weights = linear.slopes.weights[:, None]
    size = (weights * (abs(A) @ np.abs(modes.vectors))).max(axis=0, initial=0.0)
    assert (np.abs(weights * (left - right)) <= 1e-7 * size.max(initial=0.0)).all()
