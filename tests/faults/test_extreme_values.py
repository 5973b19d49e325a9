"""Values that nobody means: each is admissible by itself, but what the equations make of it is not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import shaftwork as sw
from tests.properties.examples import processor_time_limit

USES: dict[str, Callable[[sw.Network], Any]] = {
    "auto": lambda net: net.simulate(0.01),
    "scipy": lambda net: net.simulate(0.01, engine="scipy"),
    "exact": lambda net: net.simulate(0.01, engine="exact"),
    "modes": lambda net: net.modes(count=3),
    "steady state": lambda net: net.compile().steady_state(t=0.0),
}


def line(diameter: float) -> sw.Network:
    net = sw.Network("line")
    net.add(sw.TorqueSource("motor", tau=1.0), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Shaft("shaft", length=1.0, diameter=diameter, model=sw.Spectral(4)), "a", "b")
    net.add(sw.Damper("water", d=9.0), "b", "ground")
    return net


@pytest.mark.parametrize("use", USES)
@pytest.mark.parametrize("diameter", [1e-60, 1e30, 1e60])
def test_a_shaft_whose_stiffness_leaves_the_range_of_numbers_is_named(use: str, diameter: float) -> None:
    with pytest.raises(sw.ParameterError, match=r"Shaft 'shaft': .* Look for a value in a wrong unit"):
        USES[use](line(diameter))


def test_an_input_that_is_infinite_at_the_start_is_left_to_engines_that_step() -> None:
    """It is not searched for ever finer panels, in which polynomials would follow it."""
    net = sw.Network("pushed")
    net.add(sw.TorqueSource("motor", tau=1 / sw.t), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    with pytest.raises(sw.SimulationError, match=r"At t = 0 s tau = 1/t of TorqueSource 'motor' has no"):
        net.simulate(1.0)


LAWS = {
    "powers of which sympy does not know that they are real": (
        "tanh((t + omega)**40 * Piecewise((omega**((t + omega + 2)**200), phi > 3), (9**((t + omega)**200), True)))"
    ),
    "integers beyond those of a machine": f"Piecewise((omega*{7**24}, omega < 1), (omega + 2, True))",
    "a table of a power": (
        "*".join(f"(Max(Table([0, 1], [1, 5])(t**-1000), sign(phi), 3*omega) + {k})" for k in range(3))
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS)
def test_a_law_is_soon_compiled_and_runs_or_is_named(law: str, tmp_path: Path) -> None:
    head = 'format = 1\nname = "one"\n[[part]]\ntype = "Inertia"\nname = "J"\nnodes = ["a"]\nJ = 1.0\n'
    part = f'[[part]]\ntype = "TorqueSource"\nname = "pull"\nnodes = ["a"]\ntau = "{law}"\n'
    (tmp_path / "one.toml").write_text(head + part)
    with processor_time_limit(20.0):  # it takes a second, and took hours
        model = sw.Network.load(tmp_path / "one.toml").compile()
        try:
            assert model.simulate(0.01).t[-1] == 0.01
        except sw.SimulationError as error:
            assert str(error)  # noqa: PT017 (some of them have no value at the start)
