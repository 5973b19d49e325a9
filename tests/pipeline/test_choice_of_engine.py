"""Which engine a model takes: named before a run as in it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
import sympy

import shaftwork as sw
from shaftwork.integrate.engines import ENGINES


def joined(*parts: sw.Component) -> sw.Network:
    net = sw.Network("joined")
    for part in parts:
        net.add(part, "a")
    return net


def looped() -> sw.Model:
    """A fan without inertia behind a spring."""
    net = sw.Network("looped")
    net.add(sw.Inertia("J", J=2.0), "disc")
    net.add(sw.Spring("shaft", c=500.0), "disc", "fan")
    net.add(sw.TorqueSource("fan", tau=-3 * sw.omega - sw.omega**3), "fan")
    return net.compile(algebraic_loops="solve")


CHOICES: dict[str, Callable[[], sw.Model]] = {
    "nothing stored": lambda: joined(sw.SpeedSource("drive", omega=5.0), sw.Inertia("J", J=1.0)).compile(),
    "linear": lambda: joined(sw.TorqueSource("motor", tau=5.0), sw.Inertia("J", J=1.0)).compile(),
    "modes": lambda: joined(
        sw.TorqueSource("motor", tau=5.0), sw.Inertia("J", J=1.0), sw.CoulombLoad("load", tau=1.0)
    ).compile(),
    "wave": lambda: sw.scenes.shaft_step(sw.Wave()).compile(),
    "loop": looped,
}


@pytest.mark.parametrize("name", CHOICES)
def test_the_engine_that_is_named_before_a_run_is_that_of_the_run(name: str) -> None:
    model = CHOICES[name]()
    sol = model.simulate(0.1)
    assert model.choose_engine(0.1) == (sol.engine, sol.why)


@pytest.mark.slow
def test_loops_without_sundials_are_solved_by_radau_and_refused_where_it_is_asked_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(ENGINES, "sundials", replace(ENGINES["sundials"], library="not_there"))
    sol = looped().simulate(0.01, initial={"J.omega": 1.0})
    assert (sol.engine, "massless nodes" in sol.why) == ("scipy-radau", True)
    with pytest.raises(sw.MissingExtraError, match="engine='sundials'"):
        looped().simulate(0.1, engine="sundials")


@pytest.mark.parametrize(("engine", "finest"), [("banded", "1e-11"), ("scipy", "2.2e-14"), ("sundials", "1.8e-15")])
def test_an_engine_that_is_asked_for_says_where_it_cannot_keep_a_tolerance(engine: str, finest: str) -> None:
    pytest.importorskip("sksundae")
    model = sw.scenes.shaft_chain(m=3).compile()
    with pytest.warns(
        sw.AccuracyWarning, match=f"finer than the engine '{engine}' can keep: .* with {finest}. Ask for"
    ):
        sol = model.simulate(1e-4, engine=engine, rtol=1e-15)
    assert (
        sol.why
        == f"asked for. rtol = 1e-15 is finer than the engine '{engine}' can keep: the run is made with {finest}."
    )
    assert model.simulate(1e-4, engine=engine, rtol=1e-10).why == "asked for"


def test_an_engine_that_auto_takes_says_it_where_it_says_why() -> None:
    waves, exact = CHOICES["wave"](), CHOICES["linear"]()
    assert waves.simulate(1e-3, rtol=1e-13).why.endswith(
        "together. rtol = 1e-13 is finer than the engine 'wave' can keep: the run is made with 1e-12."
    )
    assert "finer" not in exact.simulate(1e-3, rtol=1e-15).why


@pytest.mark.slow
@pytest.mark.parametrize("frequency", [sw.Table([0.0, 1.0], [0.7, 0.7]), sw.Table([0.0, 0.5, 1.0], [0.7, 20.0, 5.0])])
@pytest.mark.parametrize(
    "part",
    [
        sw.Backlash("coupling", gap=0.008, c=4e5, d=50.0),
        sw.Clutch("coupling", tau=sw.Table([0.0, 0.4, 0.6, 1.0], [900.0, 900.0, 0.0, 0.0])),
    ],
    ids=lambda part: repr(part)[:60],
)
def test_the_engine_that_is_announced_runs_a_drive_by_a_frequency_past_changes_of_mode(
    part: sw.Component, frequency: sw.Table
) -> None:
    """The law has a quotient by the frequency, so the series are compared with the equations: with those in force."""
    net = sw.Network("drive by a frequency")
    net.add(sw.FrequencyDrive("motor", tau_k=2000.0, s_k=0.08, n_sync=1500, f=frequency), "a")
    net.add(sw.Inertia("J1", J=3.0), "a")
    net.add(part, "a", "b")
    net.add(sw.Inertia("J2", J=0.2), "b")
    net.add(sw.TorqueSource("load", tau=-600.0), "b")
    model = net.compile()
    sol = model.simulate(1.0)
    assert (sol.engine, sol.why) == model.choose_engine(1.0)
    assert sol.engine in ("heyoka", "numba")
    other = model.simulate(1.0, engine="scipy", rtol=1e-10)
    assert len(sol.events) == len(other.events) > 0
    assert sol.max("coupling.tau") == pytest.approx(float(other.max("coupling.tau")), rel=1e-6)


@pytest.mark.slow
@pytest.mark.heyoka
def test_another_engine_says_what_was_in_the_way_of_the_series() -> None:
    net = sw.Network("rough")
    net.add(sw.TorqueSource("pull", tau=sympy.sqrt(sw.t)), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    sol = net.simulate(1.0)
    assert sol.engine == "scipy"
    assert "after t = 0 s a law, or one of its derivatives, is not finite" in sol.why
    assert sol["J.omega"][-1] == pytest.approx(2 / 3, rel=1e-6)


def chain(k: int, *parts: sw.Component) -> sw.Model:
    """Inertias with k gaps that spring between them, and parts at the last one."""
    net = sw.Network("chain")
    net.add(sw.TorqueSource("pull", tau=20 * sympy.sin(12 * sw.t)), "n0")
    net.add(sw.Inertia("J0", J=0.1), "n0")
    for n in range(k):
        net.add(sw.Backlash(f"gap{n}", gap=0.004, c=1e3, d=1.0), f"n{n}", f"n{n + 1}")
        net.add(sw.Inertia(f"J{n + 1}", J=0.1), f"n{n + 1}")
    for part in parts:
        net.add(part, f"n{k}")
    return net.compile()


@pytest.mark.heyoka
def test_a_long_chain_of_gaps_is_compiled_and_moves_as_its_arrays_say() -> None:
    model = chain(32)
    sol = model.simulate(0.3, t_eval=2)
    assert sol.engine == "heyoka"
    other = model.simulate(0.3, t_eval=2, engine="scipy", rtol=1e-7)
    assert [event[1:] for event in sol.events] == [event[1:] for event in other.events]
    assert len(sol.events) > 10
    assert sol.x[-1] == pytest.approx(other.x[-1], rel=1e-6, abs=1e-7)


@pytest.mark.parametrize(("stops", "compiled"), [(0, True), (2, True), (3, False)])
def test_a_large_network_with_many_sets_of_equations_is_left_to_arrays(stops: int, *, compiled: bool) -> None:
    model = chain(70, *(sw.HardStop(f"stop{n}", lower=-1.0, upper=1.0) for n in range(stops)))
    assert (model.rows is not None) == compiled
