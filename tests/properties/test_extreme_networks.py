"""Networks whose parameters lie up to 24 decades apart: every quantity is right, or the run warns or refuses.

The reference is `reference.balls`: rational matrices of the netlist and exponentials in ball arithmetic. Values count
as right to 1e-6 of the largest of their kind in the run. ``SHAFTWORK_EXTREMES`` sets how many networks are tried with
each engine; 2000 take hours.
"""

from __future__ import annotations

import os
import warnings

import numpy as np
import pytest
from hypothesis import settings

import shaftwork as sw
from tests.properties.extremes import extreme, largest_error, outcome, reference
from tests.reference.balls import respond
from tests.reference.mna import GROUND, Piece
from tests.reference.pencil import IllPosedError

pytest.importorskip("flint")

COUNT = int(os.environ.get("SHAFTWORK_EXTREMES", max(20, settings().max_examples // 5)))
# Engines that step give up early: a motion that rings 1e12 times has no end for them.
LIMITS = {"banded": 3000, "scipy-radau": 400, "sundials": 20_000, "heyoka": 5000, "scipy": 5000}
ENGINES = ("auto", "exact", *(name for name in LIMITS if sw.integrate.engines.available(name)))


def verdicts(engine: str, count: int) -> dict[int, str]:
    """Of each network of the first so many, what a run came to."""
    options = {"max_steps": LIMITS[engine]} if engine in LIMITS else {}
    found = {}
    for seed in range(count):
        case = extreme(seed)
        try:
            response = reference(case)
        except IllPosedError:
            continue
        found[seed] = outcome(case, response, engine, **options).verdict
    return found


@pytest.mark.slow
@pytest.mark.parametrize(
    "engine", ["auto", "exact", *(pytest.param(name, marks=pytest.mark.slow) for name in ENGINES[2:])]
)
def test_a_network_of_extreme_values_is_right_or_says_that_it_is_not(engine: str) -> None:
    found = verdicts(engine, COUNT)
    assert [seed for seed, verdict in found.items() if verdict == "silent"] == []
    if engine in ("auto", "exact"):  # to refuse or to warn is the exception
        assert sum(verdict == "right" for verdict in found.values()) >= 0.9 * len(found)


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "engine"), [(20296, "sundials"), (22657, "sundials")])
def test_what_a_long_search_has_found_says_that_it_is_wrong(seed: int, engine: str) -> None:
    """20296: off by 1.0055e-6 beside a strong damper, where the exact motion itself is known to 3e-8.

    22657: off by 1.6e-6 of the largest torque between parts, within which springs have six times as much.
    """
    pytest.importorskip("sksundae")
    case = extreme(seed)
    assert outcome(case, reference(case), engine, max_steps=LIMITS[engine]).verdict != "silent"


def slow_train(damping: float, inertia: float) -> tuple[Piece, ...]:
    """A train with rates of 1e-4 to 1 1/s, and a light rotor behind a strong damper."""
    return (
        Piece("TorqueSource", "motor", ("a",), {"tau": 10.0}),
        Piece("Inertia", "J1", ("a",), {"J": 100.0}),
        Piece("Spring", "shaft", ("a", "b"), {"c": 50.0, "d": 1.0}),
        Piece("Inertia", "J2", ("b",), {"J": 200.0}),
        Piece("Damper", "strong", ("b", "c"), {"d": damping}),
        Piece("Inertia", "light", ("c",), {"J": inertia}),
        Piece("Damper", "bearing", ("b", GROUND), {"d": 1e-2}),
    )


@pytest.mark.parametrize(("damping", "inertia"), [(1e6, 1e-5), (1e8, 1e-6), (1e11, 1e-9)])
def test_speeds_and_springs_beside_a_strong_damper_on_a_light_rotor_are_right(damping: float, inertia: float) -> None:
    """Rates from 1e11 (1e20) to 5e-5 1/s: floats lose the slow ones. The damper's own torque may be said to be lost."""
    pieces = slow_train(damping, inertia)
    times = np.linspace(0.0, 1000.0, 11)
    wanted = respond(pieces, times)
    net = sw.Network("slow train")
    for piece in pieces:
        net.add(getattr(sw, piece.type)(piece.name, **piece.values), *piece.nodes)
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "strong damping", sw.AccuracyWarning)
        sol = net.simulate(1000.0, t_eval=times)
    assert sol.engine == "exact"
    assert "whole numbers" in sol.why
    values = {f"{node}.omega": sol[f"{node}.omega"] for node in "abc"} | {"shaft.tau": sol["shaft.tau"]}
    exact = {f"{node}.omega": wanted.across[node] for node in "abc"} | {"shaft.tau": wanted.through["shaft.through"]}
    assert largest_error(values, exact) < 1e-12  # each state is rounded once


@pytest.mark.slow
def test_the_motion_between_outputs_is_as_right_as_at_them() -> None:
    pieces = slow_train(1e6, 1e-5)
    times = np.concatenate([np.geomspace(1e-13, 1.0, 40), np.linspace(2.0, 1000.0, 60)])
    wanted = respond(pieces, times).across
    net = sw.Network("slow train")
    for piece in pieces:
        net.add(getattr(sw, piece.type)(piece.name, **piece.values), *piece.nodes)
    sol = net.simulate(1000.0, t_eval=3)
    for at in (sol.at(times), sol.at(times[:5])):  # many from polynomials, few anew
        for node in "abc":
            exact = wanted[node][: len(at.t)]
            assert np.abs(at[f"{node}.omega"] - exact).max() < 1e-11 * np.abs(exact).max()
    assert sol.energy_residual < 1e-9


@pytest.mark.slow
def test_an_engine_that_is_further_off_than_its_tolerance_says_so() -> None:
    """CVODE over 1400 radians of an oscillation that hardly fades, at rtol 1e-8."""
    pytest.importorskip("sksundae")
    net = sw.Network("swing")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Spring("shaft", c=1e4, d=1e-3), "a", "b")
    net.add(sw.Inertia("J2", J=1.0), "b")
    with pytest.warns(sw.AccuracyWarning, match=r"'sundials' is off by .*exact motion.*engine='exact'"):
        net.simulate(10.0, engine="sundials", initial={"J1.omega": 1.0})


def test_the_reference_equals_a_closed_form() -> None:
    """An inertia of 2 with a damper of 0.5 to the ground under 3: 6 (1 - exp(-t / 4))."""
    pieces = (
        Piece("TorqueSource", "motor", ("a",), {"tau": 3.0}),
        Piece("Inertia", "J", ("a",), {"J": 2.0}),
        Piece("Damper", "bearing", ("a", GROUND), {"d": 0.5}),
    )
    times = np.array([0.0, 1.0, 40.0])
    assert respond(pieces, times).across["a"] == pytest.approx(-6 * np.expm1(-times / 4), rel=1e-15)
