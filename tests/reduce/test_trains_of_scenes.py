"""The real trains of the scenes: they reduce to the numbers that Marinkovic 2012 prints, and their losses are true."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import shaftwork as sw

T_END = 0.5
"""s: the start of the motor, five swings of the crane's shaft."""


@cache
def crane(mesh: str = "elastic") -> tuple[sw.Network, sw.Solution]:
    net = sw.scenes.crane_train(mesh=mesh)
    return net, net.simulate(T_END, t_eval=2001)


def inertias(net: sw.Network) -> list[float]:
    return [part.J for part in net.parts if isinstance(part, sw.Inertia)]


@pytest.mark.slow
@pytest.mark.parametrize("mesh", ["elastic", "rigid"])
def test_the_ten_masses_of_the_crane_reduce_to_the_printed_numbers(mesh: str) -> None:
    net = sw.scenes.crane_train(mesh=mesh)
    small = sw.reduce.simplify(net, 2, "shaft")
    assert len(sw.reduce.simplify(net, 1).chain.stations) == (10 if mesh == "elastic" else 7)
    assert inertias(small.network) == pytest.approx([27.35, 62.5], rel=1e-13)
    parts = {part.name: part for part in small.network.parts}
    assert (parts["shaft"].c, parts["shaft"].d) == (24206.0, 14.0)
    assert parts["motor"].ratio == pytest.approx(35.5, rel=1e-14)
    assert parts["motor"].efficiency == 0.95
    assert parts["brake"].tau == pytest.approx(323.76, rel=1e-13)
    assert parts["load"].tau == 22.4


@pytest.mark.slow
@pytest.mark.parametrize("mesh", ["elastic", "rigid"])
def test_the_eleven_masses_of_the_excavator_reduce_to_the_printed_numbers(mesh: str) -> None:
    net = sw.scenes.excavator_train(mesh=mesh)
    small = sw.reduce.simplify(net, 2, "shaft")
    assert len(small.chain.stations) == (11 if mesh == "elastic" else 7)
    assert inertias(small.network) == pytest.approx([27.0, 8.2], rel=1e-13)
    parts = {part.name: part for part in small.network.parts}
    assert (parts["shaft"].c, parts["shaft"].d) == (1608.0, 0.0)
    assert parts["digging"].ratio == pytest.approx(120.0, rel=1e-14)


def test_losses_in_the_gears_take_their_share_of_inertia_and_brake() -> None:
    """(18) of the source for the torques; and what accelerates the rotor passes the gears as well."""
    plain, lossy = (sw.reduce.refer(sw.scenes.crane_train(losses=where), "wheel") for where in ("torques", "gears"))
    assert lossy.table["brake.tau"].referred == pytest.approx(323.76, rel=1e-12)
    assert lossy.table["motor.efficiency"].referred == pytest.approx(0.95, rel=1e-12)
    assert lossy.table["rotor.J"].referred == pytest.approx(0.95 * plain.table["rotor.J"].referred, rel=1e-12)


@pytest.mark.slow
def test_the_loss_of_two_masses_is_what_the_train_and_the_crane_of_the_source_differ_by() -> None:
    """Both simulated on their own; the scene `crane` was written down from the source."""
    net, train = crane()
    lost = sw.reduce.simplify(net, 2, "shaft").compare(T_END, before=train)
    source = sw.scenes.crane().simulate(T_END, t_eval=2001)
    fine = np.linspace(0.0, T_END, 200_001)
    peak = np.abs(source.at(fine)["shaft.tau"]).max() / np.abs(train.at(fine)["shaft.tau"]).max() - 1
    two = source["shaft.tau"]
    rms = np.sqrt(np.mean((two - train["shaft.tau"]) ** 2) / np.mean(train["shaft.tau"] ** 2))
    # two runs of an engine at its tolerance of 1e-8
    assert lost.peak_error == pytest.approx(peak, abs=1e-7)
    assert lost.rms_error == pytest.approx(rms, abs=1e-7)
    assert lost.by_modes == pytest.approx(two, abs=1e-5)
    assert lost.rms_error > 0.1  # the peak is nearly the same, at another time: two masses swing faster


@pytest.mark.slow
def test_the_loss_of_three_masses_is_that_of_its_network_and_modes_have_their_own() -> None:
    net, train = crane()
    small = sw.reduce.simplify(net, 3, "shaft")
    lost = small.compare(T_END, before=train)
    for torque, model in ((lost.after, small.network), (lost.by_modes, small.by_modes)):
        assert torque == pytest.approx(model.simulate(T_END, t_eval=2001)["shaft.tau"], abs=1e-9)
    assert max(abs(lost.peak_error), abs(lost.peak_error_by_modes)) < 0.02
    assert [line.split()[0] for line in str(lost).splitlines()] == ["model", "train", "groups", "modes"]


@pytest.mark.slow
def test_every_step_from_seven_masses_to_one_loses_more() -> None:
    net, train = crane(mesh="rigid")
    steps = [sw.reduce.simplify(net, masses, "shaft") for masses in (7, 3, 2, 1)]
    errors = [step.compare(T_END, before=train, modes=False).rms_error for step in steps]
    assert errors[0] < 1e-6
    assert errors == sorted(errors)
    assert [step.valid_up_to for step in steps] == sorted((step.valid_up_to for step in steps), reverse=True)


@pytest.mark.slow
def test_one_mass_has_the_torque_that_moves_what_is_beyond_the_shaft() -> None:
    net, train = crane()
    one = sw.reduce.simplify(net, 1, "shaft")
    lost = one.compare(T_END, before=train)
    assert lost.by_modes is None
    rigid = one.network.simulate(T_END, t_eval=2001)
    (name,) = (part.name for part in one.network.parts if isinstance(part, sw.Inertia))
    expected = 62.5 / 89.85 * rigid[f"{name}.tau"] - rigid["load.tau"]
    assert lost.after == pytest.approx(expected, rel=1e-9, abs=1e-6)
    assert lost.peak_error < -0.3


@pytest.mark.slow
def test_the_excavator_loses_little_to_two_masses() -> None:
    net = sw.scenes.excavator_train(mesh="rigid")
    small = sw.reduce.simplify(net, 2, "shaft")
    lost = small.compare(1.0, modes=False)
    source = sw.scenes.excavator().simulate(1.0, t_eval=lost.t)["shaft.tau"]
    assert lost.after == pytest.approx(source, abs=1e-6 * np.abs(source).max())
    assert abs(lost.peak_error) < 0.05


@pytest.mark.slow
def test_a_known_motion_must_end_where_it_is_compared() -> None:
    net, train = crane()
    with pytest.raises(sw.ParameterError, match=r"ends at 0\.5 s, and t_end is 2 s"):
        sw.reduce.simplify(net, 2, "shaft").compare(2.0, before=train)


@pytest.mark.parametrize(("options", "message"), [({"mesh": "soft"}, "no mesh"), ({"losses": "none"}, "no place of")])
def test_wrong_options_of_a_train_are_answered_with_those_that_there_are(options: dict[str, str], message: str) -> None:
    with pytest.raises(sw.ParameterError, match=f"There is {message}"):
        sw.scenes.crane_train(**options)
