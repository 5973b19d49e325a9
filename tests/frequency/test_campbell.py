"""The interference diagram: crossings of constant and of moving natural frequencies with excitation orders."""

from __future__ import annotations

import pickle
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
import sympy
from hypothesis import given, settings
from hypothesis import strategies as st

import shaftwork as sw


def _two_masses() -> sw.Network:
    net = sw.Network("two masses")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Spring("shaft", c=1e4), "a", "b")
    net.add(sw.Inertia("J2", J=3.0), "b")
    return net


def _stiffening() -> sw.Network:
    """A disc on a spring that stiffens with the speed of another shaft: c = 900 + n^2, f(n) = sqrt(c / J) / 2 pi."""
    net = sw.Network("stiffening")
    net.add(sw.Inertia("rotor", J=1.0), "r")
    net.add(sw.Inertia("disc", J=4.0), "d")
    net.add(sw.TorqueSource("spring", tau=-900.0 * sw.phi - sw.phi**3 / 3.0), "d")
    return net


def test_constant_frequencies_cross_orders_where_the_closed_form_says() -> None:
    f = np.sqrt(1e4 * (1 / 2 + 1 / 3)) / (2 * np.pi)
    diagram = _two_masses().campbell(np.linspace(0.0, 100.0, 5), orders=(0.5, 1, 2, 6))
    found = [(made.order, made.speed) for made in diagram.crossings]
    wanted = [(6, 2 * np.pi * f / 6), (2, np.pi * f), (1, 2 * np.pi * f)]  # order 1/2 meets it at 183 rad/s
    np.testing.assert_allclose(found, wanted, rtol=1e-13)
    assert {made.mode for made in diagram.crossings} == {"mode 1"}
    assert diagram.modes == ("mode 1",)
    np.testing.assert_allclose(diagram.frequencies, f, rtol=1e-13)
    np.testing.assert_allclose([made.frequency for made in diagram.crossings], f, rtol=1e-13)


def test_the_highest_frequency_of_interest_limits_modes_and_crossings() -> None:
    net = sw.scenes.shaft_chain(m=8)
    diagram = net.campbell(np.linspace(0.0, 5000.0, 3), orders=(1, 2, 20), f_max=2000.0)
    assert diagram.crossings
    assert max(made.frequency for made in diagram.crossings) <= 2000.0
    assert len(diagram.modes) == (net.modes().frequencies <= 2000.0).sum() - 1


def test_frequencies_that_move_with_the_speed_are_met_exactly() -> None:
    """(900 + n^2) / 4 = (k n)^2 at n = sqrt(900 / (4 k^2 - 1)): the linearised spring at the angle phi = n."""
    diagram = _stiffening().campbell(np.linspace(1.0, 40.0, 14), orders=(1, 2), at=lambda n: {"spring.phi": n})
    wanted = sorted((float(np.sqrt(900.0 / (4 * k**2 - 1))), float(k)) for k in (1, 2))
    found = [(made.speed, made.order) for made in diagram.crossings]
    np.testing.assert_allclose(found, wanted, rtol=1e-10)
    assert diagram.frequencies.shape == (14, 1)
    np.testing.assert_allclose(
        2 * np.pi * diagram.frequencies[:, 0], np.sqrt((900 + diagram.speeds**2) / 4), rtol=1e-12
    )


def test_an_operating_point_may_be_the_same_at_all_speeds() -> None:
    net = _stiffening()
    diagram = net.campbell([0.0, 40.0], 1, at={"spring.phi": 40.0})
    assert diagram.crossings[0].speed == pytest.approx(25.0, rel=1e-12)


def test_a_mode_that_ceases_to_swing_has_no_frequency_there() -> None:
    """A damper that grows with speed: from n = 20 on the spring is overdamped, and no order meets it."""
    net = sw.Network("governed")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Spring("s", c=100.0), "a", "wall")
    net.add(sw.Ground("frame"), "wall")
    net.add(sw.TorqueSource("brake", tau=-(sw.omega**2) / 2.0), "a")
    diagram = net.campbell([5.0, 15.0, 25.0], 1, at=lambda n: {"J.omega": n})
    np.testing.assert_array_equal(diagram.frequencies[:, 0] > 0, [True, True, False])
    assert [made.order for made in diagram.crossings] == [1.0]  # at 10 rad/s


def test_the_table_lists_speeds_in_both_units() -> None:
    text = str(_two_masses().campbell([0.0, 100.0], (1, 2)))
    assert "2 crossings from 0 to 100 rad/s" in text
    assert "91.2871" in text
    assert "871.728" in text


@pytest.mark.parametrize("speeds", [[1.0], [2.0, 1.0], [-1.0, 1.0], [0.0, float("nan")], "fast", None], ids=repr)
def test_speeds_that_do_not_ascend_are_named(speeds: Any) -> None:
    with pytest.raises(sw.ParameterError, match="two or more speeds in rad/s, ascending"):
        _two_masses().campbell(speeds)


@pytest.mark.parametrize(("orders", "said"), [((), "one or more"), ((1, 0), "orders = 0"), ("x", "orders = 'x'")])
def test_orders_that_are_none_are_named(orders: Any, said: str) -> None:
    with pytest.raises(sw.ParameterError, match=said):
        _two_masses().campbell([0.0, 1.0], orders)


def test_the_picture_has_a_line_for_each_mode_and_order_and_a_dot_for_each_crossing() -> None:
    pytest.importorskip("matplotlib")
    diagram = _two_masses().campbell([0.0, 100.0], (1, 2, 3), f_max=20.0)
    (axis,) = diagram.plot().axes
    assert len(axis.lines) == 1 + 3 + 1
    assert len(axis.lines[-1].get_xdata()) == len(diagram.crossings)
    np.testing.assert_allclose(axis.lines[-1].get_xdata(), [made.speed * 30 / np.pi for made in diagram.crossings])
    np.testing.assert_allclose(axis.get_xlim(), [0.0, 100.0 * 30 / np.pi])


def _pump(friction: float = 5.0) -> sw.Network:
    """A motor, a shaft and a pump whose friction holds it at rest."""
    net = sw.Network("pump drive")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Spring("shaft", c=1e4), "a", "b")
    net.add(sw.Inertia("J2", J=3.0), "b")
    net.add(sw.CoulombLoad("pump", tau=friction), "b")
    return net


def test_a_pump_that_sticks_at_rest_has_the_frequencies_of_a_running_one_where_it_runs() -> None:
    """Clamped at the pump c / J1, running c (1/J1 + 1/J2)."""
    net = _pump()
    held, running = np.sqrt(1e4 * np.array([1 / 2, 1 / 2 + 1 / 3])) / (2 * np.pi)
    diagram = net.campbell([10.0, 100.0], 1, at=lambda n: {"J1.omega": n, "J2.omega": n})
    np.testing.assert_allclose(diagram.frequencies[:, 0], running, rtol=1e-12)
    assert diagram.about == (
        "at points from J1.omega = 10, J2.omega = 10 (pump slipping forward) to "
        "J1.omega = 100, J2.omega = 100 (pump slipping forward)"
    )
    at_rest = net.campbell([10.0, 100.0], 1, at={})
    np.testing.assert_allclose(at_rest.frequencies[:, 0], held, rtol=1e-12)
    assert at_rest.about == "at rest (pump stuck)"
    assert str(at_rest).startswith("pump drive at rest (pump stuck): 1 crossing from 10 to 100 rad/s")


@pytest.mark.parametrize("build", [_pump, _stiffening, sw.scenes.crane], ids=["friction", "law", "scene"])
def test_what_swings_otherwise_where_it_runs_must_be_given_a_point(build: Any) -> None:
    net = build()
    with pytest.raises(sw.ParameterError, match=r"needs a point: .* depends on how it runs") as refused:
        net.campbell([0.0, 100.0])
    assert "at=lambda n: {" in str(refused.value)
    assert "at=model.steady_state()" in str(refused.value)


def test_the_picture_says_about_what_it_is_linearised() -> None:
    pytest.importorskip("matplotlib")
    (axis,) = _pump().campbell([0.0, 100.0], 1, at={}).plot().axes
    assert axis.get_title() == "linearised at rest (pump stuck)"
    (axis,) = _two_masses().campbell([0.0, 100.0], 1).plot().axes
    assert axis.get_title() == ""


def test_modes_responses_and_matrices_say_about_what_they_are_linearised() -> None:
    net = _pump()
    model, point = net.compile(), {"J1.omega": 8.0, "J2.omega": 8.0}
    sol = net.simulate(1.0, initial=point)
    assert net.modes().title == "pump drive at rest (pump stuck)"
    running = "pump drive at J1.omega = 8, J2.omega = 8 (pump slipping forward)"
    assert net.modes(point).title == running
    assert model.linearize(sol.at([0.5])).title == "pump drive at t = 0.5 s of a motion (pump slipping forward)"
    net.add(sw.TorqueSource("shaker", tau=0.0), "a")
    assert net.frequency_response("shaker.tau", "shaft.tau", [1.0], point).title == running
    assert _two_masses().modes().title == "two masses"
    assert _stiffening().modes({"spring.phi": 4.0}).title == "stiffening at spring.phi = 4"
    assert _stiffening().modes().title == "stiffening at rest"
    train = sw.scenes.shaft_chain(m=12)
    train.add(sw.TorqueSource("fan", tau=-sw.omega * abs(sw.omega)), train.nodes[-1])
    states = train.compile().states
    title = train.modes(dict.fromkeys(states, 0.0)).title
    assert title == f"{train.name} at {states[0]} = 0, {states[1]} = 0, {states[2]} = 0, ..."


@pytest.mark.slow
def test_titles_name_the_time_at_which_laws_that_depend_on_it_are_read() -> None:
    net = sw.Network("ramp")
    net.add(sw.FrequencyDrive("m", tau_k=8.0, s_k=0.3, n_sync=3000), "a")  # rises until 5 s
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Spring("s", c=100.0), "a", "b")
    net.add(sw.Inertia("K", J=1.0), "b")
    point = {"J.omega": 3.0, "K.omega": 3.0}
    assert net.modes(point).title == "ramp at J.omega = 3, K.omega = 3, laws at t = 6 s"
    assert net.modes(t=2.0).title == "ramp at rest, laws at t = 2 s"
    assert net.modes(t=2.0, exact=True).title == "ramp at rest, laws at t = 2 s"
    assert net.frequency_response("m.tau", "s.tau", [1.0], t=3.0).title == "ramp at rest, laws at t = 3 s"
    moment = net.simulate(5.0).at([4.0])
    assert net.modes(moment).title == "ramp at t = 4 s of a motion"
    assert net.modes(moment, t=1.0).title == "ramp at t = 4 s of a motion, laws at t = 1 s"
    diagram = net.campbell(np.linspace(1.0, 300.0, 3), at=lambda n: {"J.omega": n, "K.omega": n})
    assert (
        diagram.heading
        == "ramp at points from J.omega = 1, K.omega = 1 to J.omega = 300, K.omega = 300, laws at t = 6 s"
    )
    net.add(sw.Brake("brake", tau=1.0, t_on=7.0), "b")
    assert net.modes(t=2.0).title == "ramp at rest, laws at t = 2 s (brake released)"


@pytest.mark.parametrize("parts", [(), (sw.Brake("brake", tau=10.0, t_on=30.0),)], ids=["", "brake"])
def test_the_time_of_a_steady_state_is_that_of_the_point(parts: tuple[sw.Component, ...]) -> None:
    """A damping that grows by the second, 0.1 t: 0.2 at 2 s, and 0.8 at 8 s, where the last breakpoint is past."""
    net = sw.Network("ageing")
    net.add(sw.TorqueSource("motor", tau=sw.Table([0.0, 7.0], [1.0, 1.0])), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.TorqueSource("bearing", tau=-0.1 * sw.t * sw.omega), "a")
    for part in parts:
        net.add(part, "a")
    model = net.compile()
    steady = model.steady_state(t=2.0)
    assert steady["J1.omega"] == pytest.approx(5.0)
    for point in (steady, pickle.loads(pickle.dumps(steady))):  # noqa: S301 (our own)
        linear = model.linearize(point)
        assert linear.t == 2.0
        assert linear.A[0, 0] == pytest.approx(-0.2)
        assert net.modes(point).rates[0] == pytest.approx(-0.2)
        assert "laws at t = 2 s" in net.modes(point).title
        assert abs(net.frequency_response("motor.tau", "J1.omega", 1e-6, at=point).values[0]) == pytest.approx(5.0)
    assert model.linearize(steady, t=4.0).A[0, 0] == pytest.approx(-0.4)


def test_titles_name_no_time_where_no_law_depends_on_it() -> None:
    assert sw.scenes.crane_start().modes().title == "crane start at rest (load stuck)"
    assert sw.scenes.ship_line().modes().title == "ship line"


@pytest.mark.slow
def test_a_load_that_sticks_at_rest_leaves_the_modes_of_the_running_train() -> None:
    """lambda^2 - 1.5 c lambda + 11/36 c^2 = 0; at n = 0 the pump is clamped, and nothing is drawn across to that."""
    c = 25000.0
    net = sw.Network("pump")
    net.add(sw.KlossMotor("motor", tau_k=3000, s_k=0.1, n_sync=1500), "m")
    net.add(sw.Inertia("JM", J=6.0), "m")
    net.add(sw.Spring("l1", c=c), "m", "c")
    net.add(sw.Inertia("JC", J=2.0), "c")
    net.add(sw.Spring("l2", c=c), "c", "p")
    net.add(sw.Inertia("JP", J=3.0), "p")
    net.add(sw.CoulombLoad("pump", tau=100), "p")
    running = np.sqrt(np.sort(np.roots([1.0, -(1 / 6 + 2 / 2 + 1 / 3) * c, 11 / 36 * c**2]))) / (2 * np.pi)
    diagram = net.campbell(
        np.linspace(0.0, 157.08, 7), orders=3, at=lambda n: dict.fromkeys(("JM.omega", "JC.omega", "JP.omega"), n)
    )
    assert diagram.modes == tuple(f"mode {k} (pump {how})" for how in ("stuck", "slipping forward") for k in (1, 2))
    np.testing.assert_allclose([made.frequency for made in diagram.crossings], running, rtol=1e-3)  # beside a motor
    assert [made.mode for made in diagram.crossings] == list(diagram.modes[2:])
    np.testing.assert_array_equal(diagram.frequencies[0, 2:], 0.0)
    np.testing.assert_array_equal(diagram.frequencies[1:, :2], 0.0)
    above = net.campbell(
        np.linspace(1.0, 157.08, 7), orders=3, at=lambda n: dict.fromkeys(("JM.omega", "JC.omega", "JP.omega"), n)
    )
    assert above.modes == ("mode 1", "mode 2")
    np.testing.assert_allclose(
        [made.speed for made in diagram.crossings], [made.speed for made in above.crossings], rtol=1e-9
    )


@pytest.mark.slow
@settings(max_examples=12, deadline=None)
@given(data=st.data())
def test_crossings_of_trains_that_stick_in_a_part_of_the_range_are_those_of_each_phase(data: st.DataObject) -> None:
    """Each load is held up to a speed of its own: what orders meet are the frequencies of the train at that speed."""
    count = data.draw(st.integers(2, 4))
    size = st.floats(0.5, 8.0)
    net, starts = sw.Network("train"), {}
    for k in range(count):
        net.add(sw.Inertia(f"J{k}", J=data.draw(size)), f"n{k}")
        if k:
            net.add(sw.Spring(f"s{k}", c=1e4 * data.draw(size)), f"n{k - 1}", f"n{k}")
        if data.draw(st.booleans()):
            net.add(sw.CoulombLoad(f"load{k}", tau=data.draw(size)), f"n{k}")
            starts[k] = data.draw(st.sampled_from([0.0, 30.0, 71.0]))

    def at(n: float) -> dict[str, float]:
        return {f"J{k}.omega": max(n - starts.get(k, 0.0), 0.0) for k in range(count)}

    orders = (1, 3)
    diagram = net.campbell(np.linspace(0.0, 150.0, data.draw(st.integers(2, 9))), orders, at=at)
    for made in diagram.crossings:
        natural = net.modes(at(made.speed)).frequencies
        assert np.abs(natural - made.order * made.speed / (2 * np.pi)).min() <= 1e-9 * made.frequency
    edges = [0.0, *sorted({30.0, 71.0} & set(starts.values())), 150.0]
    wanted = [
        (speed, order)
        for low, high in pairwise(edges)
        for frequency in net.modes(at((low + high) / 2)).frequencies
        for order in orders
        if frequency > 0 and low < (speed := 2 * np.pi * float(frequency) / order) <= high
    ]
    found = [(made.speed, made.order) for made in diagram.crossings]
    np.testing.assert_allclose(found, sorted(wanted), rtol=1e-9)


def test_modes_that_cross_keep_their_names_and_their_meetings() -> None:
    """Two discs apart, one on a spring that stiffens with the speed: its frequency passes that of the other."""
    net = _stiffening()
    net.add(sw.Inertia("other", J=1.0), "o")
    net.add(sw.Spring("s", c=400.0), "o", "wall")
    net.add(sw.Ground("frame"), "wall")
    diagram = net.campbell(np.linspace(1.0, 60.0, 8), 1, at=lambda n: {"spring.phi": n})
    constant, rising = (diagram.frequencies[:, k] * 2 * np.pi for k in (1, 0))
    np.testing.assert_allclose(constant, 20.0, rtol=1e-12)
    np.testing.assert_allclose(rising, np.sqrt((900 + diagram.speeds**2) / 4), rtol=1e-12)
    found = [(made.mode, made.speed) for made in diagram.crossings]
    assert [name for name, _ in found] == ["mode 1", "mode 2"]
    np.testing.assert_allclose([speed for _, speed in found], [np.sqrt(300.0), 20.0], rtol=1e-10)


def test_a_jump_of_the_frequencies_is_no_crossing() -> None:
    """A spring that is stiffer from a twist of 20 rad on: order 1 passes between 10 and 40 rad/s, meeting neither."""
    net = sw.Network("two springs")
    net.add(sw.Inertia("J", J=1.0), "a")
    stiff = sw.Table([0.0, 20.0, 40.0], [0.0, 20.0 * 100.0, 20.0 * 100.0 + 20.0 * 1600.0])
    net.add(sw.TorqueSource("spring", tau=-stiff(sw.phi)), "a")
    diagram = net.campbell([12.0, 35.0], 1, at=lambda n: {"spring.phi": n})
    np.testing.assert_allclose(2 * np.pi * diagram.frequencies[:, 0], [10.0, 40.0], rtol=1e-6)
    assert not diagram.crossings


def test_the_axis_ends_above_the_highest_mode_unless_an_end_is_given() -> None:
    pytest.importorskip("matplotlib")
    diagram = _two_masses().campbell([0.0, 157.0], 48)
    assert max(diagram.frequencies[0]) < diagram.plot().axes[0].get_ylim()[1] < 1.3 * max(diagram.frequencies[0])
    assert [made.order for made in diagram.crossings] == [48]
    given = _two_masses().campbell([0.0, 157.0], 48, f_max=500.0)
    assert given.plot().axes[0].get_ylim()[1] == 500.0


@pytest.mark.slow
def test_the_titles_of_pictures_are_whole() -> None:
    """Points of long names and many phases would run out of the picture on both sides."""
    pytest.importorskip("matplotlib")
    net = sw.Network("the drive of the conveyor between the stockyard and the second crusher of the plant")
    names = [f"inertia of section {k}" for k in range(1, 4)]
    for k, name in enumerate(names):
        net.add(sw.Inertia(name, J=1.0), f"n{k}")
        net.add(sw.CoulombLoad(f"idlers of section {k}", tau=5.0), f"n{k}")
        if k:
            net.add(sw.Spring(f"belt {k}", c=1e4), f"n{k - 1}", f"n{k}")
    net.add(sw.TorqueSource("motor of the head drum", tau=0.0), "n0")
    point = {f"{name}.omega": 20.0 for name in names}
    drawn = [
        net.campbell([10.0, 50.0], at=lambda n: dict.fromkeys(point, n)),
        net.modes(point),
        net.frequency_response("motor of the head drum.tau", "belt 1.tau", [1.0, 10.0, 50.0], point),
        net.simulate(0.1, initial=point),
    ]
    for figure in (record.plot() for record in drawn):
        figure.draw_without_rendering()
        axes = figure.axes[0]
        for text in (figure._suptitle, axes.title):
            if text.get_text():
                box = text.get_window_extent()
                assert box.x0 >= 0
                assert box.x1 <= figure.bbox.width
                assert box.y1 <= figure.bbox.height


def _pump_behind_a_shaft() -> sw.Network:
    net = sw.Network("pump")
    net.add(sw.TableMotor("motor", curve=sw.Table([0, 1400, 1500, 1600], [200, 250, 0, -250])), "m")
    net.add(sw.Inertia("JM", J=0.5), "m")
    shaft = {"length": 2.0, "diameter": 0.04, "density": 7900.0, "shear_modulus": 77.5e9}
    net.add(sw.Shaft("line", **shaft, model=sw.Lumped(20)), "m", "p")
    net.add(sw.Inertia("JP", J=0.8), "p")
    net.add(sw.PumpLoad("pump", tau_n=100, n_n=1450), "p")
    return net


@pytest.mark.slow
def test_the_point_that_a_refused_diagram_names_is_that_of_the_running_drive() -> None:
    """The inertias at both ends of a shaft; what turns inside it follows them."""
    net = _pump_behind_a_shaft()
    with pytest.raises(sw.ParameterError) as refused:
        net.campbell([0.0, 100.0])
    assert "at=lambda n: {'JM.omega': n, 'JP.omega': n};" in str(refused.value)
    assert "--at" not in str(refused.value)
    diagram = net.campbell([0.0, 100.0], 3, f_max=60.0, at=lambda n: {"JM.omega": n, "JP.omega": n})
    everywhere = {name: 100.0 for name in net.compile().states if "omega" in name}
    (running,) = (f for f in net.modes(everywhere).frequencies if 0 < f < 60)
    assert [made.mode for made in diagram.crossings] == ["mode 1 (pump slipping forward)"]
    assert diagram.crossings[0].frequency == pytest.approx(running, rel=1e-3)  # the pump's curve at another speed


def test_the_point_that_a_refused_diagram_names_follows_gears_and_drums() -> None:
    net = sw.Network("hoist")
    net.add(sw.KlossMotor("motor", tau_k=600.0, s_k=0.1, n_sync=1500), "m")
    net.add(sw.Inertia("JM", J=1.0), "m")
    net.add(sw.Spring("coupling", c=1e5), "m", "g")
    net.add(sw.Inertia("JG", J=0.1), "g")
    net.add(sw.Backlash("lash", c=1e6, gap=0.01), "g", "h")
    net.add(sw.Inertia("JH", J=0.05), "h")
    net.add(sw.LossyGear("gear", ratio=124, efficiency=0.94), "h", "d")
    net.add(sw.Drum("drum", radius=0.4), "d", "r")
    net.add(sw.TranslationalSpring("rope", c=4e6), "r", "l")
    net.add(sw.Mass("load", m=2e4), "l")
    with pytest.raises(sw.ParameterError) as refused:
        net.campbell([0.0, 100.0])
    assert "{'JM.omega': n, 'JG.omega': n, 'JH.omega': n, 'load.v': n/310};" in str(refused.value)


@pytest.mark.slow
def test_a_point_that_leaves_a_load_at_rest_is_noticed_once() -> None:
    net = _pump_behind_a_shaft()
    said = "leaves 'JP.omega' at 0, where 'pump' depends on it"
    with pytest.warns(sw.NetworkWarning, match=said) as caught:
        net.campbell([0.0, 50.0, 100.0], f_max=60.0, at=lambda n: {"JM.omega": n, "line.omega_1": n})
    assert len(caught) == 1
    with pytest.warns(sw.NetworkWarning, match=said):
        net.compile().linearize({"JM.omega": 10.0})
    with pytest.warns(sw.NetworkWarning, match=said):
        net.modes({"JM.omega": 10.0}, exact=True, f_max=60.0)
    assert net.modes({"JM.omega": 10.0, "JP.omega": 0.0}).title.endswith("(pump stuck)")  # meant so
    assert net.modes({"line.tau": 10.0}).title.endswith("(pump stuck)")


def test_a_point_may_leave_out_what_follows_the_speeds_given() -> None:
    """Behind a rigid gear, and where nothing depends on the speed but linear parts."""
    net = sw.Network("geared")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Gear("gear", ratio=3.0), "a", "b")
    net.add(sw.Inertia("J2", J=2.0), "b")
    net.add(sw.CoulombLoad("load", tau=2.0), "b")
    net.add(sw.Spring("s", c=1e4, d=1.0), "b", "c")
    net.add(sw.Inertia("J3", J=2.0), "c")
    net.add(sw.ViscousLoad("bearing", d=0.1), "c")
    assert net.modes({"J1.omega": 6.0}).title == "geared at J1.omega = 6 (load slipping forward)"


def _behind(*parts: tuple[sw.Component, str, str]) -> sw.Network:
    net = sw.Network("train")
    net.add(sw.TorqueSource("m", tau=10.0 * (1 - sw.omega / 99) * (1 + 0.1 * sympy.sin(4 * sw.phi))), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    for part, a, b in parts:
        net.add(part, a, b)
    return net


GEAR = (sw.Gear("g", ratio=4.0), "a", "b")
J2, J3 = sw.Inertia("J2", J=1.0), sw.Inertia("J3", J=1.0)


@pytest.mark.parametrize(
    ("parts", "more", "point"),
    [
        ([GEAR, (sw.Spring("s", c=1e3), "b", "c")], [(J2, "c")], {"J1.omega": "n", "J2.omega": "n/4"}),
        ([GEAR, (sw.Clutch("cl", tau=9.0), "b", "c")], [(J2, "c")], {"J1.omega": "n", "J2.omega": "n/4"}),
        ([GEAR, (sw.Backlash("bl", gap=0.1, c=9.0), "b", "c")], [(J2, "c")], {"J1.omega": "n", "J2.omega": "n/4"}),
        ([GEAR, (sw.Freewheel("fw"), "b", "c")], [(J2, "c")], {"J1.omega": "n", "J2.omega": "n/4"}),
        (
            [GEAR, (sw.Shaft("w", length=1.0, diameter=0.05, model=sw.Wave()), "b", "c")],
            [(J2, "c")],
            {"J1.omega": "n", "J2.omega": "n/4"},
        ),
        (
            [(sw.Drum("d", radius=0.25), "a", "r"), (sw.Rope("rope", c=1e4), "r", "hook")],
            [(sw.Mass("load", m=1.0), "hook")],
            {"J1.omega": "n", "load.v": "n/4"},
        ),
    ],
    ids=["spring", "clutch", "gap", "free wheel", "wave", "rope"],
)
def test_the_point_that_a_message_names_follows_gears_through_all_that_joins(
    parts: Any, more: Any, point: dict[str, str]
) -> None:
    """Also beside a law of the angle, which does not hold the shaft."""
    net = _behind(*parts)
    for part, node in more:
        net.add(part, node)
    with pytest.raises(sw.ParameterError, match="needs a point") as refused:
        net.campbell([0.0, 100.0])
    named = ", ".join(f"'{name}': {speed}" for name, speed in point.items())
    assert f"at=lambda n: {{{named}}}" in str(refused.value)


def test_a_speed_that_a_free_planetary_gear_leaves_open_is_left_to_the_user() -> None:
    net = _behind()
    net.add(sw.PlanetaryGear("p", ratio=3.0), "a", "carrier", "ring")
    net.add(J2, "carrier")
    net.add(J3, "ring")
    with pytest.raises(sw.ParameterError, match=r"\{'J1.omega': n, 'J\d.omega': \.\.\.\}"):
        net.campbell([0.0, 100.0])


def test_a_torque_that_pulsates_with_the_angle_is_not_linearised_at_one_angle_without_a_word() -> None:
    """The mean law alone has the modes of the running machine, and no warning; at rest the angle stays."""

    def machine(pulse: float) -> sw.Network:
        net = sw.Network("machine")
        net.add(sw.TorqueSource("e", tau=(100.0 - sw.omega) * (1 + pulse * sympy.sin(4 * sw.phi))), "a")
        net.add(sw.Inertia("J", J=1.0), "a")
        net.add(sw.ViscousLoad("l", d=1.0), "a")
        return net

    with pytest.warns(sw.AccuracyWarning, match=r"'e\.phi' does not stay.*'e' gives bends.*at e\.phi = 0 rad"):
        machine(0.1).modes({"J.omega": 50.0})
    np.testing.assert_allclose(machine(0.0).modes({"J.omega": 50.0}).rates, [-2.0], rtol=1e-12)
    machine(0.1).modes()
