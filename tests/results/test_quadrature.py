from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shaftwork.results.course import LobattoPanels, integrate

STEPS = np.array([0.0, 1.0, 3.0])


@pytest.mark.slow
@given(st.floats(0.0, 3.0))
def test_a_jump_and_a_kink_within_a_step_are_integrated_to_1e_10(place: float) -> None:
    def integrand(panels: LobattoPanels) -> np.ndarray:
        after = panels.times - place
        return np.array([after > 0, np.maximum(after, 0.0)], dtype=float)

    jump, kink = integrate(integrand, STEPS).totals
    assert jump == pytest.approx(3.0 - place, abs=1e-10)
    assert kink == pytest.approx(0.5 * (3.0 - place) ** 2, abs=1e-10)


def test_polynomials_up_to_degree_13_are_integrated_to_rounding_with_a_jump_at_every_step_end() -> None:
    integrals = integrate(lambda made: np.where(made.times < 1.0, made.times**13, 1.0)[None], STEPS)
    (value,), panels = integrals.totals, integrals.panels
    assert value == pytest.approx(1.0 / 14.0 + 2.0, rel=1e-14)
    assert len(panels.start) < 200


def test_a_thousand_oscillations_in_one_step_are_integrated_to_1e_12() -> None:
    rate = 1.0 + 2.0e3j * np.pi
    (value,) = integrate(lambda made: np.exp(rate * made.times).real[None], np.array([0.0, 1.0])).totals
    assert value == pytest.approx(((np.exp(rate) - 1.0) / rate).real, abs=1e-12 * np.e)


def test_noise_is_integrated_as_far_as_it_goes() -> None:
    random = np.random.default_rng(1)
    integrals = integrate(lambda made: 1.0 + 1e-6 * random.normal(size=(1, *made.times.shape)), STEPS, most=100_000)
    (value,), panels = integrals.totals, integrals.panels
    assert value == pytest.approx(3.0, abs=1e-7)
    assert len(panels.start) < 4 * 100_000


def test_panels_fill_the_run_and_can_be_split_anywhere() -> None:
    panels = integrate(lambda made: np.abs(made.times - 0.7)[None], STEPS).panels
    split = panels.split(np.array([0.7, 2.2]))
    for made in (panels, split):
        assert np.array_equal(made.start[1:], made.end[:-1])
        assert (made.start[0], made.end[-1]) == (0.0, 3.0)
    assert {0.7, 2.2} <= set(split.start.tolist())
    assert split.integrals(np.abs(split.times - 0.7)).sum() == pytest.approx(0.7**2 / 2 + 2.3**2 / 2, rel=1e-13)
