"""A rope goes slack when its load is thrown up: its flight in closed form, and a damped one integrated on its own."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import shaftwork as sw

G, M, C, RADIUS, SPEED, STOP = 9.81, 2000.0, 8e5, 0.5, 1.0, 0.25
RATE = np.sqrt(C / M)
"""Of the load on the rope, 1/s: the drum's stop throws it up, since SPEED is above G / RATE."""


def hoist(rope: sw.Component) -> sw.Network:
    """A drum that hoists a load with SPEED and stops at once."""
    net = sw.Network("stop while hoisting")
    net.add(sw.SpeedSource("drive", omega=sw.Step(-SPEED / RADIUS, start=STOP, before=SPEED / RADIUS)), "shaft")
    net.add(sw.Drum("drum", radius=RADIUS), "shaft", "top")
    net.add(rope, "top", "hook")
    net.add(sw.Mass("load", m=M), "hook")
    net.add(sw.ForceSource("weight", f=-M * G), "hook")
    return net


def test_a_load_that_is_thrown_up_flies_and_falls_back_into_its_rope() -> None:
    """Without damping: f = m g - v sqrt(c m) sin(w t) until it is zero, free flight, and the same swing again."""
    model = hoist(sw.Rope("rope", c=C)).compile(angles="load")
    sol = model.simulate(1.2, initial={"load.v": SPEED, "rope.s": M * G / C}, rtol=1e-12)
    slack = STOP + np.arcsin(G / (RATE * SPEED)) / RATE
    leaving = np.sqrt(SPEED**2 - (G / RATE) ** 2)
    taut = slack + 2 * leaving / G
    found = [(event[0], event[3]) for event in sol.events[:2]]
    assert found == [(pytest.approx(slack, abs=1e-10), "slack"), (pytest.approx(taut, abs=1e-10), "taut")]
    assert [row.name for row in sol.phases[:3]] == ["rope taut", "rope slack", "rope taut"]

    during = np.linspace(slack, taut, 50)[1:-1]
    flown = during - slack
    assert sol.at(during)["load.v"] == pytest.approx(leaving - G * flown, abs=1e-9)
    assert sol.at(during)["rope.f"] == pytest.approx(0.0, abs=0.0)
    assert sol.at(during)["rope.s"] == pytest.approx(-(leaving * flown - G * flown**2 / 2), abs=1e-10)
    assert sol.max("rope.f") == pytest.approx(M * G + SPEED * np.sqrt(C * M), rel=1e-9)
    assert sol.max("rope.f").t == pytest.approx(taut + (np.pi / 2 + np.arcsin(G / (RATE * SPEED))) / RATE, abs=1e-6)
    assert sol.min("rope.f") >= -1e-6
    assert sol.energy_residual < 1e-9


@pytest.mark.slow
def test_a_rope_with_damping_moves_as_the_law_integrated_on_its_own() -> None:
    """The damper acts while the rope is stretched and never pushes: f = max(0, c s + d v) where s > 0."""
    d = 6e3

    def force(stretch: float, speed: float) -> float:
        return max(0.0, C * stretch + d * speed) if stretch > 0 else 0.0

    def rates(_: float, x: np.ndarray) -> tuple[float, float]:
        return -x[1], force(x[0], -x[1]) / M - G  # of the stretch, and of the speed of the load

    own = solve_ivp(rates, (STOP, 1.2), (M * G / C, SPEED), rtol=1e-11, atol=1e-13, max_step=1e-4, dense_output=True)
    sol = hoist(sw.Rope("rope", c=C, d=d)).simulate(1.2, initial={"load.v": SPEED, "rope.s": M * G / C}, rtol=1e-11)
    times = np.linspace(STOP, 1.2, 400)[1:]
    stretch, speed = own.sol(times)
    assert sol.at(times)["load.v"] == pytest.approx(speed, abs=1e-7)
    assert sol.at(times)["rope.s"] == pytest.approx(stretch, abs=1e-8)
    forces = [force(*pair) for pair in zip(stretch, -speed, strict=True)]
    assert sol.at(times)["rope.f"] == pytest.approx(forces, abs=1e-2)
    assert sol.min("rope.f") >= -1e-6
    assert sol.energy_residual < 1e-9


def test_a_taut_rope_is_a_spring_and_a_spring_pushes_where_a_rope_does_not() -> None:
    start = {"load.v": SPEED, "rope.f": M * G}
    spring = hoist(sw.TranslationalSpring("rope", c=C, d=6e3)).simulate(1.2, initial=start)
    assert spring.min("rope.f") < -1e4
    rope = hoist(sw.Rope("rope", c=C, d=6e3)).simulate(1.2, initial={"load.v": SPEED, "rope.s": M * G / C})
    slack = rope.events[0][0]
    before = np.linspace(0.0, slack, 200)[:-1]
    assert rope.at(before)["rope.f"] == pytest.approx(spring.at(before)["rope.f"], rel=1e-7)


def test_a_load_hangs_on_its_rope_in_the_steady_state() -> None:
    net = hoist(sw.Rope("rope", c=C, d=6e3))
    net.replace(sw.SpeedSource("drive", omega=0.0))
    model = net.compile()
    steady = model.steady_state(t=0.0)
    assert steady["rope.s"] == pytest.approx(M * G / C, rel=1e-9)
    sol = model.simulate(1.0, initial=steady)
    assert sol.min("rope.f") == pytest.approx(M * G, rel=1e-9)
    assert net.modes(at=steady).frequencies[-1] == pytest.approx(RATE / (2 * np.pi), rel=1e-6)
