"""Exact sensitivities equal central differences of the computed frequencies and motions."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import shaftwork as sw
from shaftwork.pipeline.model import Model
from shaftwork.results.measures import Measure
from shaftwork.studies import frequency_sensitivities, motion_sensitivities

STEP = 2e-4
"""Of a parameter, relative; two such differences, extrapolated, are right to its fourth power times a large number."""
MEASURES = {"max": "max shaft.tau", "min": "min J1.omega", "peak": "peak s2.tau", "end": "end J2.omega"}
MEASURES |= {"mean": "mean shaft.tau", "rms": "rms s2.tau"}


@cache
def train() -> tuple[sw.Network, Model]:
    net = sw.Network("train")
    net.add(sw.KlossMotor("motor", tau_k=8.0, s_k=0.6, n_sync=3000.0, ratio=35.5, efficiency=0.95), "rotor")
    net.add(sw.Inertia("J1", J=27.35), "rotor")
    net.add(sw.Spring("shaft", c=24206.0, d=14.0), "rotor", "mid")
    net.add(sw.Inertia("Jm", J=5.0), "mid")
    net.add(sw.Gear("g", ratio=2.5), "mid", "low")
    net.add(sw.Spring("s2", c=5e4, d=3.0), "low", "wheel")
    net.add(sw.Inertia("J2", J=62.5), "wheel")
    net.add(sw.Damper("b", d=12.0), "wheel")
    return net, net.compile()


def differences(values: object, parameter: float) -> np.ndarray:
    """Central differences by a parameter, extrapolated."""

    def central(step: float) -> np.ndarray:
        above, below = (np.array(values(parameter + side * step)) for side in (1, -1))  # type: ignore[operator]
        return (above - below) / (2 * step)

    step = STEP * abs(parameter)
    return (4 * central(step / 2) - central(step)) / 3


@pytest.mark.slow
def test_frequencies_and_damping_equal_central_differences() -> None:
    net, model = train()
    made = frequency_sensitivities(net)
    assert len(made.frequencies) == 2
    for name, value in made.parameters.items():

        def both(changed: float, name: str = name) -> list[float]:
            modes = model.linearize(parameters={name: changed}).modes()
            swings = modes.frequencies > 0
            return [*modes.frequencies[swings], *modes.damping[swings]]

        expected = differences(both, value) * value
        found = value * np.concatenate([made.of_frequencies[name], made.of_damping[name]])
        np.testing.assert_allclose(found, expected, atol=1e-6 * made.frequencies.min(), err_msg=name)
    np.testing.assert_allclose(made.frequencies, (f := model.linearize().modes().frequencies)[f > 0], rtol=1e-12)


def test_a_frequency_is_as_stiff_as_its_springs_and_as_slow_as_its_inertias() -> None:
    """The square of a frequency is homogeneous: of degree 1 in all stiffnesses, -1 in all inertias, without damping."""
    net = sw.Network("chain")
    for k, node in enumerate("abc"):
        net.add(sw.Inertia(f"J{k}", J=1.0 + k), node)
    net.add(sw.Spring("s", c=300.0), "a", "b")
    net.add(sw.Spring("r", c=500.0), "b", "c")
    by = frequency_sensitivities(net).relative
    np.testing.assert_allclose(by["s.c"] + by["r.c"], 0.5, rtol=1e-10)
    np.testing.assert_allclose(by["J0.J"] + by["J1.J"] + by["J2.J"], -0.5, rtol=1e-10)


def test_the_crane_at_rest_is_that_of_its_phase() -> None:
    net = sw.scenes.crane_start()
    made = frequency_sensitivities(net)
    np.testing.assert_allclose(made.frequencies, net.modes().frequencies[-1:], rtol=1e-12)
    assert made.relative["shaft.c"][0] == pytest.approx(0.5, abs=1e-4)
    assert made.of_frequencies["J2.J"] == 0  # stuck


def test_modes_that_share_a_frequency_have_no_derivative() -> None:
    net = sw.Network("twins")
    net.add(sw.Inertia("J", J=1.0), "m")
    for name in ("p", "q"):
        net.add(sw.Inertia(name, J=1.0), name)
        net.add(sw.Spring(f"s{name}", c=100.0), name, "ground")
    with pytest.raises(sw.SimulationError, match="has the rate of another one"):
        frequency_sensitivities(net)


def scales(inertia: float, pendulums: int) -> sw.Network:
    """Two slow modes below 1 Hz beside one of sqrt(1e3 / inertia) rad/s, with alike pendulums on it."""
    net = sw.Network("scales")
    net.add(sw.Inertia("fast", J=inertia), "a")
    net.add(sw.Spring("s", c=1e3), "a", "b")
    net.add(sw.Inertia("B", J=50.0), "b")
    net.add(sw.Spring("t", c=5.0, d=0.01), "b", "c")
    net.add(sw.Inertia("C", J=20.0), "c")
    net.add(sw.Spring("u", c=2.0), "c", "ground")
    for k in range(pendulums):
        net.add(sw.Inertia(f"P{k}", J=1.0), f"p{k}")
        net.add(sw.Spring(f"w{k}", c=3.0, d=0.1), f"p{k}", "c")
    return net


@pytest.mark.parametrize("inertia", [1e-9, 1e-14])
def test_slow_modes_beside_a_very_fast_one_have_derivatives(inertia: float) -> None:
    """They are those of the chain without what is fast, whose mass and twist change them by 1e-9 / 50 and less."""
    made, slow = frequency_sensitivities(scales(inertia, 0)), frequency_sensitivities(scales(1e-3, 0))
    assert made.frequencies[2] == pytest.approx(np.sqrt(1e3 / inertia) / (2 * np.pi), rel=1e-6)
    for name in ("t.c", "u.c", "B.J", "C.J"):
        # 1e-3 / 50 is the mass on the other side; rounding moves a rate of 0.1 by 1e-16 * 3e8 at most
        np.testing.assert_allclose(made.relative[name][:2], slow.relative[name][:2], atol=2e-5, err_msg=name)


@pytest.mark.parametrize("inertia", [1e-3, 1e-9, 1e-14])
def test_equal_modes_are_refused_beside_slow_and_fast_ones(inertia: float) -> None:
    """Of three pendulums two modes leave the chain at rest: equal, and different by rounding."""
    with pytest.raises(sw.SimulationError, match=r"Mode 3, 0\.27566\d Hz, has the rate of another one"):
        frequency_sensitivities(scales(inertia, 3))


def test_where_nothing_swings_the_table_says_so() -> None:
    net = sw.Network("over")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Spring("s", c=100.0, d=50.0), "a", "ground")  # 2 sqrt(c J) = 20 is critical
    assert str(frequency_sensitivities(net)).startswith("over: no mode swings here")


@pytest.mark.parametrize(
    ("measures", "message"),
    [
        ({"f": len}, r"measure 'f' = <built-in function len> must be a name, such as 'max shaft.tau'"),
        ({"f": 3}, "measure 'f' = 3 must be a name"),
        (None, "measures = None must be a list of names"),
        ([], "Name a measure"),
        ([3], "'3' is no measure"),
        ({1: "end J1.omega", "1": "end J2.omega"}, "Two measures are called '1'"),
    ],
)
def test_what_is_no_name_of_a_measure_is_refused(measures: object, message: str) -> None:
    with pytest.raises(sw.ParameterError, match=message):
        motion_sensitivities(train()[0], measures, t_end=0.1)  # type: ignore[arg-type]


@pytest.mark.slow
def test_measures_of_a_motion_equal_central_differences() -> None:
    net, model = train()
    made = motion_sensitivities(net, MEASURES, t_end=0.8, rtol=1e-10)
    readers = {name: Measure.read(text) for name, text in MEASURES.items()}
    for name in ("shaft.c", "shaft.d", "J2.J", "g.ratio", "motor.tau_k"):
        value = made.parameters[name]

        def all_of(changed: float, name: str = name) -> list[float]:
            solution = model.simulate(0.8, parameters={name: changed}, rtol=1e-13, t_eval=2)
            return [reader.of(solution) for reader in readers.values()]

        expected = differences(all_of, value) * value
        for measure, number in zip(MEASURES, expected, strict=True):
            size = abs(made.measures[measure]) or 1.0
            assert abs(made[measure][name] * value - number) < 1e-6 * size, (measure, name)


def test_start_values_are_those_of_the_motion() -> None:
    net, model = train()
    made = motion_sensitivities(net, ["end J1.omega"], t_end=0.1, initial={"J1.omega": 3.0}, parameters=["J1.J"])
    assert made.measures["end J1.omega"] == pytest.approx(
        float(model.simulate(0.1, initial={"J1.omega": 3.0})["J1.omega"][-1]), rel=1e-7
    )
    with pytest.raises(sw.ParameterError, match="is no state"):
        motion_sensitivities(net, ["end J1.omega"], t_end=0.1, initial={"shaft.phi_rel": 0.1})


def test_the_strongest_parameter_comes_first() -> None:
    lines = str(frequency_sensitivities(train()[0])).splitlines()
    assert lines[0].startswith("train: percent of a frequency")
    assert lines[2].startswith("Jm.J")
    frame = pytest.importorskip("pandas").DataFrame
    assert isinstance(frequency_sensitivities(train()[0]).table(), frame)


def test_what_has_no_derivative_is_refused() -> None:
    net, _ = train()
    with pytest.raises(sw.ParameterError, match=r"no parameter 'shaft\.k'"):
        frequency_sensitivities(net, parameters=["shaft.k"])
    with pytest.raises(sw.ParameterError, match="has no derivative here"):
        motion_sensitivities(net, ["damage shaft.tau"], t_end=0.1)
    with pytest.raises(sw.ParameterError, match=r"'shaft\.energy' has no derivative here"):
        motion_sensitivities(net, ["end shaft.energy"], t_end=0.1)
    undamped = sw.Network("undamped")
    undamped.add(sw.Inertia("J", J=1.0), "a")
    undamped.add(sw.Spring("s", c=100.0, d=0.0), "a", "ground")
    assert "s.d" not in frequency_sensitivities(undamped).parameters
    with pytest.raises(sw.ParameterError, match="decides which equations hold"):
        frequency_sensitivities(undamped, parameters=["s.d"])


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gear.ratio", "drive.omega"])
def test_what_moves_the_start_of_a_shaft_has_no_derivative_unless_its_speeds_are_given(name: str) -> None:
    """Speeds inside run straight between those of the ends, of which a gear or a source determines one."""
    net = sw.Network("wound")
    if name == "gear.ratio":
        net.add(sw.Inertia("J0", J=0.1), "m")
        net.add(sw.Gear("gear", ratio=3.0), "m", "a")
    else:
        net.add(sw.SpeedSource("drive", omega=10.0), "a")
    net.add(sw.Shaft("line", length=1.7, diameter=0.031, model=sw.Lumped(3)), "a", "b")
    net.add(sw.Inertia("J", J=0.2), "b")
    initial = {"line.omega_b": 4.0} | ({"J0.omega": 30.0} if name == "gear.ratio" else {})
    measure = "end line.omega_b"
    with pytest.raises(sw.ParameterError, match=f"'{name}' moves the start: line.omega_1, line.omega_2 follow"):
        motion_sensitivities(net, [measure], t_end=5e-4, initial=initial, parameters=[name])
    left = motion_sensitivities(net, [measure], t_end=5e-4, initial=initial)
    assert name not in left.parameters
    assert "J.J" in left.parameters
    initial |= {"line.omega_1": 8.0, "line.omega_2": 6.0}
    made, model = motion_sensitivities(net, [measure], t_end=5e-4, initial=initial), net.compile()

    def end(value: float) -> list[float]:
        solution = model.simulate(5e-4, initial=initial, parameters={name: value}, rtol=1e-13, t_eval=2)
        return [float(solution["line.omega_b"][-1])]

    expected = differences(end, made.parameters[name])[0]
    assert made[measure][name] == pytest.approx(expected, rel=1e-6)
