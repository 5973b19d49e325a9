"""Modes: closed forms, zeros, overdamped modes, normalisation, invariance, large networks, pictures."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.components import REGISTRY
from shaftwork.frequency.eigenvalues import LARGEST_DENSE


def _two_masses(d: float = 0.0, *, rename: str = "", scale: float = 1.0) -> sw.Network:
    net = sw.Network("two masses")
    net.add(sw.Inertia(f"{rename}J1", J=2.0 * scale), f"{rename}a")
    net.add(sw.Spring(f"{rename}shaft", c=1e4 * scale, d=d * scale), f"{rename}a", f"{rename}b")
    net.add(sw.Inertia(f"{rename}J2", J=3.0 * scale), f"{rename}b")
    return net


def _chain(n: int, d: float = 0.0, *, J: float = 1e-3, c: float = 1e4) -> sw.Network:
    net = sw.Network("chain")
    for k in range(n):
        net.add(sw.Inertia(f"J{k}", J=J), f"n{k}")
        if k:
            net.add(sw.Spring(f"s{k}", c=c, d=d), f"n{k - 1}", f"n{k}")
    return net


def _chain_rates(n: int, J: float = 1e-3, c: float = 1e4) -> np.ndarray:
    """2 sqrt(c / J) sin(k pi / 2n), k = 0..n-1: the free chain of equal inertias."""
    return 2 * np.sqrt(c / J) * np.sin(np.arange(n) * np.pi / (2 * n))


def test_two_masses_swing_against_each_other() -> None:
    modes = _two_masses().modes()
    assert modes.names == ("rigid body of J1, J2", "mode 1")
    assert modes.frequencies[0] == 0.0
    assert modes.rates[0] == 0.0
    np.testing.assert_allclose(modes.frequencies[1], np.sqrt(1e4 * (1 / 2 + 1 / 3)) / (2 * np.pi), rtol=1e-14)
    assert not modes.damping.any()
    np.testing.assert_allclose(modes.shapes["J2.omega"], [1.0, -2 / 3], rtol=1e-14)
    np.testing.assert_allclose(modes.shapes["b.omega"], modes.shapes["J2.omega"])


def test_a_shape_holds_every_quantity_with_the_laws_between_them() -> None:
    """tau_c' = c omega_rel, tau = tau_c + d omega_rel, each with rate times amplitude for the derivative."""
    modes = _two_masses(d=40.0).modes()
    rate, shape = modes.rates, modes.shapes
    np.testing.assert_allclose(rate * shape["shaft.tau_c"], 1e4 * shape["shaft.omega_rel"], atol=1e-9)
    np.testing.assert_allclose(shape["shaft.tau"], shape["shaft.tau_c"] + 40.0 * shape["shaft.omega_rel"], atol=1e-11)
    np.testing.assert_allclose(3.0 * rate * shape["J2.omega"], shape["shaft.tau"], atol=1e-9)
    assert set(shape) >= {"J1.omega", "J1.tau", "a.omega", "shaft.power"}
    with pytest.raises(sw.SignalError, match=r"No quantity 'shaft\.torque'.*shaft\.tau"):
        shape["shaft.torque"]


def test_damping_is_that_of_one_mode_oscillator() -> None:
    """lambda^2 + d m lambda + c m = 0 with m = 1/J1 + 1/J2."""
    modes = _two_masses(d=40.0).modes()
    m = 1 / 2 + 1 / 3
    assert modes.damping[1] == pytest.approx(40.0 * m / (2 * np.sqrt(1e4 * m)), rel=1e-13)
    assert modes.frequencies[1] == pytest.approx(np.sqrt(1e4 * m) / (2 * np.pi), rel=1e-14)
    assert modes.damped_frequencies[1] == pytest.approx(modes.rates[1].imag / (2 * np.pi), rel=1e-15)


def test_overdamped_modes_are_listed_as_two_decays() -> None:
    modes = _two_masses(d=400.0).modes()
    m = 1 / 2 + 1 / 3
    wanted = np.sort_complex(np.roots([1.0, 400.0 * m, 1e4 * m]))[::-1]
    assert modes.names == ("rigid body of J1, J2", "decay 1", "decay 2")
    np.testing.assert_allclose(modes.rates[1:], wanted, rtol=1e-12)
    assert not modes.frequencies.any()
    np.testing.assert_array_equal(modes.damping, [0.0, 1.0, 1.0])


@pytest.mark.parametrize("d", [0.0, 1e-3])
@pytest.mark.parametrize("n", [2, 20, 101])
def test_the_chain_has_the_frequencies_of_its_closed_form(n: int, d: float) -> None:
    """Rounding grows with the largest rate over the rate in question, n at most; 1e-12 leaves room for it."""
    modes, rates = _chain(n, d).modes(), _chain_rates(n)
    np.testing.assert_allclose(2 * np.pi * modes.frequencies, rates, rtol=1e-12)
    np.testing.assert_allclose(modes.damping[1:], d / 1e4 * rates[1:] / 2, rtol=1e-8, atol=1e-16)
    assert modes.frequencies[0] == 0.0


def test_a_mode_shape_of_the_chain_is_a_cosine() -> None:
    n, k = 30, 4
    modes = _chain(n).modes()
    shape = np.array([modes.shapes[f"J{i}.omega"][k] for i in range(n)])
    wanted = np.cos(k * np.pi * (np.arange(n) + 0.5) / n)
    np.testing.assert_allclose(shape / shape[0], wanted / wanted[0], atol=1e-12)
    assert shape[np.abs(shape).argmax()] == pytest.approx(1.0, rel=1e-12)


@pytest.mark.slow
def test_the_lowest_modes_of_a_long_chain_are_the_lowest_of_all() -> None:
    """Shift and invert: 1e-10 of the exact frequencies and damping, at 5999 states and losses of a millionth."""
    n, d = 3000, 1e-3
    modes, rates = _chain(n, d).modes(count=9), _chain_rates(n)[:9]
    assert len(modes) == 9
    np.testing.assert_allclose(2 * np.pi * modes.frequencies, rates, rtol=1e-10)
    np.testing.assert_allclose(modes.rates.real, -d / 1e4 * rates**2 / 2, rtol=1e-6, atol=1e-14)
    assert modes.rates[0] == 0.0


def test_a_count_takes_the_lowest_of_a_short_chain_as_well() -> None:
    some, every = _chain(40).modes(count=5), _chain(40).modes()
    np.testing.assert_allclose(some.frequencies, every.frequencies[:5], rtol=1e-12)
    assert some.names == every.names[:5]


def test_all_modes_of_a_very_long_chain_are_refused_with_the_way_out() -> None:
    with pytest.raises(sw.ParameterError, match=r"modes\(count=20\)"):
        _chain(LARGEST_DENSE // 2 + 2).modes()


@pytest.mark.parametrize("count", [0, -1, 2.5, True, "all"])
def test_a_count_that_is_none_is_named(count: object) -> None:
    with pytest.raises(sw.ParameterError, match=r"count = .* must be a number of modes"):
        _two_masses().modes(count=count)  # type: ignore[arg-type]


def test_a_gear_refers_inertia_and_stiffness_by_its_square() -> None:
    """J2 beyond a gear of ratio r is J2 / r^2 at the motor; the spring c at the slow side is c / r^2 there."""
    r, J1, J2, J3, c = 5.0, 0.2, 30.0, 12.0, 8e3
    net = sw.Network("geared")
    net.add(sw.Inertia("J1", J=J1), "a")
    net.add(sw.Gear("gear", ratio=r), "a", "b")
    net.add(sw.Inertia("J2", J=J2), "b")
    net.add(sw.Spring("shaft", c=c), "b", "e")
    net.add(sw.Inertia("J3", J=J3), "e")
    first = J1 + J2 / r**2
    wanted = np.sqrt(c / r**2 * (1 / first + r**2 / J3)) / (2 * np.pi)
    modes = net.modes()
    np.testing.assert_allclose(modes.frequencies, [0.0, wanted], rtol=1e-14)
    assert modes.names[0] == "rigid body of J1, J2, J3"  # J2 is no state, and moves all the same
    np.testing.assert_allclose(modes.shapes["b.omega"], modes.shapes["a.omega"] / r, rtol=1e-14)
    assert not modes.damping.any()


def test_a_planetary_train_has_a_rigid_mode_for_each_of_its_two_freedoms() -> None:
    net = sw.Network("planetary")
    net.add(sw.PlanetaryGear("set", ratio=2.0), "sun", "carrier", "ring")
    for name, J in (("sun", 0.1), ("carrier", 0.5), ("ring", 0.8)):
        net.add(sw.Inertia(f"J{name}", J=J), name)
    net.add(sw.Spring("shaft", c=1e3), "carrier", "out")
    net.add(sw.Inertia("Jout", J=2.0), "out")
    modes = net.modes()
    np.testing.assert_array_equal(modes.rates[:2], [0.0, 0.0])
    assert modes.rates[2].imag > 0
    shapes = modes.shapes
    np.testing.assert_allclose(shapes["sun.omega"] + 2 * shapes["ring.omega"], 3 * shapes["carrier.omega"], atol=1e-12)


def test_an_electrical_resonance_is_that_of_r_l_c() -> None:
    R, L, C = 3.0, 0.02, 5e-6
    net = sw.Network("series circuit")
    net.add(sw.VoltageSource("supply", u=1.0), "p", "n")
    net.add(sw.Resistor("R", R=R), "p", "x")
    net.add(sw.Inductor("L", L=L), "x", "y")
    net.add(sw.Capacitor("C", C=C), "y", "n")
    net.add(sw.Ground("earth"), "n")
    modes = net.modes()
    assert modes.names == ("mode 1",)
    assert modes.frequencies[0] == pytest.approx(1 / np.sqrt(L * C) / (2 * np.pi), rel=1e-13)
    assert modes.damping[0] == pytest.approx(R / 2 * np.sqrt(C / L), rel=1e-13)


def test_two_trains_have_modes_of_their_own() -> None:
    net = _two_masses()
    for placed in _two_masses(rename="other ", scale=7.0).netlist().placed:
        net.add(placed.part, *placed.nodes)
    modes = net.modes()
    assert modes.names == ("rigid body of J1, J2", "rigid body of other J1, other J2", "mode 1", "mode 2")
    np.testing.assert_allclose(modes.frequencies[2], modes.frequencies[3], rtol=1e-13)
    np.testing.assert_array_equal(modes.shapes["other J1.omega"][[0]], [0.0])
    assert not (modes.shapes["J1.omega"] * modes.shapes["other J1.omega"]).any()


def test_springs_side_by_side_hold_a_constant_torque() -> None:
    net = _two_masses()
    net.add(sw.Spring("second", c=5e3), "a", "b")
    modes = net.modes()
    assert modes.names[:2] == ("rigid body of J1, J2", "constant in shaft, second")
    np.testing.assert_array_equal(modes.rates[:2], [0.0, 0.0])
    assert len(modes) == 3


def test_an_angle_that_is_only_recorded_adds_no_mode() -> None:
    net = _two_masses(d=3.0)
    plain, recorded = net.modes(), net.compile(angles=["J1", "J2"]).linearize().modes()
    np.testing.assert_allclose(recorded.rates, plain.rates, rtol=1e-14)
    np.testing.assert_allclose(
        recorded.shapes["J2.phi"][1] * recorded.rates[1], recorded.shapes["J2.omega"][1], rtol=1e-12
    )
    assert recorded.names == plain.names


def test_an_angle_that_a_law_reads_is_a_spring() -> None:
    net = sw.Network("pendulum")
    net.add(sw.Inertia("J", J=2.0), "a")
    net.add(sw.TorqueSource("weight", tau=-50.0 * sw.phi - 3.0 * sw.phi**3), "a")
    assert net.modes().frequencies == pytest.approx([np.sqrt(25.0) / (2 * np.pi)], rel=1e-14)
    stiffer = net.modes({"weight.phi": 1.0})
    assert stiffer.frequencies == pytest.approx([np.sqrt(59.0 / 2.0) / (2 * np.pi)], rel=1e-13)


def test_about_an_operating_point_the_motor_damps_and_at_rest_of_its_curve_it_drives() -> None:
    net = sw.scenes.crane_start()
    running = net.modes(net.compile().steady_state())
    assert running.names == ("decay 1", "mode 1")
    assert (running.damping > 0).all()
    net = sw.Network("starting")
    net.add(sw.KlossMotor("motor", tau_k=9.6, s_k=0.25, n_sync=3000), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    modes = net.modes()
    assert modes.names == ("growth 1",)
    assert modes.damping[0] == -1.0


def test_names_and_units_of_measure_change_nothing_but_names() -> None:
    """All values times 1e-6 leave frequencies and damping; 1e-13 is rounding."""
    plain, other = _two_masses(d=40.0).modes(), _two_masses(d=40.0, rename="x ", scale=1e-6).modes()
    np.testing.assert_allclose(other.rates, plain.rates, rtol=1e-13)
    np.testing.assert_allclose(other.shapes["x J2.omega"], plain.shapes["J2.omega"], rtol=1e-12)


def test_stiffness_over_twelve_orders_keeps_the_slow_frequency() -> None:
    """The slow mode lies 1e6 below the fast one; 1e-9 is the rounding of the fast one seen from the slow."""
    net = sw.Network("stiff")
    for k, J in enumerate((1.0, 2.0, 3.0)):
        net.add(sw.Inertia(f"J{k}", J=J), f"n{k}")
    net.add(sw.Spring("soft", c=1.0), "n0", "n1")
    net.add(sw.Spring("hard", c=1e12), "n1", "n2")
    slow = np.sqrt(1.0 * (1 / 1.0 + 1 / 5.0)) / (2 * np.pi)
    np.testing.assert_allclose(net.modes().frequencies[:2], [0.0, slow], rtol=1e-9)


@pytest.mark.slow
def test_the_table_is_the_same_in_every_process() -> None:
    code = (
        "import shaftwork as sw\n"
        "net = sw.scenes.shaft_chain(m=6, damping=1.0)\n"
        "modes = net.modes()\n"
        "print(modes); print(modes.shapes['J3.omega'].tobytes().hex())"
    )
    runs = [subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True) for _ in range(2)]
    assert runs[0].stdout == runs[1].stdout
    assert "rigid body of" in runs[0].stdout


def test_a_drive_without_motion_has_no_modes() -> None:
    net = sw.Network("static")
    net.add(sw.SpeedSource("drive", omega=2.0), "a")
    net.add(sw.Damper("bearing", d=3.0), "a")
    assert len(net.modes()) == 0
    assert str(net.modes()).splitlines() == [
        "static: 0 modes",
        "mode            Hz     damping                 rate in 1/s  moves most",
    ]


def test_the_picture_shows_the_modes_asked_for() -> None:
    pytest.importorskip("matplotlib")
    modes = _chain(5).modes()
    figure = modes.plot(1, 2)
    assert figure.get_suptitle() == "chain: speeds of the nodes"
    assert [axis.get_title(loc="left").split(":")[0] for axis in figure.axes] == ["mode 1", "mode 2"]
    np.testing.assert_allclose(figure.axes[0].lines[0].get_ydata()[0], 1.0)
    with pytest.raises(sw.ParameterError, match="There is no mode 9"):
        modes.plot(9)


def test_the_spectral_shaft_has_the_frequencies_of_the_wave_equation() -> None:
    """The shaft of Popenda 2019, J_m = 0.11: the numbers are those of the transcendental equation, ten digits."""
    net = sw.Network("distributed")
    net.add(sw.Inertia("Je", J=0.025), "a")
    shaft = sw.Shaft(
        "line", length=1.0, diameter=0.02, density=7900.0, shear_modulus=77.5e9, damping=0.0, model=sw.Spectral(16)
    )
    net.add(shaft, "a", "b")
    net.add(sw.Inertia("Jm", J=0.11), "b")
    modes = net.modes()
    np.testing.assert_allclose(modes.frequencies[:4], [0.0, 38.88573365, 1567.02210303, 3132.59539509], rtol=2e-10)
    along = modes.shapes["line.omega"]
    assert along.shape[0] == len(modes)
    np.testing.assert_allclose(along[:, [0, -1]].T, [modes.shapes["a.omega"], modes.shapes["b.omega"]], atol=1e-14)


@pytest.mark.slow
def test_at_rest_laws_are_read_at_the_start_and_parts_are_in_the_mode_they_have_there() -> None:
    """The load sticks and the brake, which comes on after 6.5 s, does not yet; the motor's curve drives at standstill.

    Damping is 4 % of critical, so |rate| is that of the inertias and springs to a part in a hundred.
    """
    net = sw.scenes.crane()
    stuck, moving = net.modes(), net.modes(at={"J1.omega": 8.0, "J2.omega": 8.0}, t=0.0)
    assert stuck.frequencies == pytest.approx([np.sqrt(24206.0 / 27.35) / (2 * np.pi)], rel=0.01)
    assert moving.frequencies == pytest.approx([0, np.sqrt(24206.0 * (1 / 27.35 + 1 / 62.5)) / (2 * np.pi)], rel=0.01)
    assert stuck.title == "crane at rest, laws at t = 0 s (brake released, load stuck)"
    assert (
        moving.title == "crane at J1.omega = 8, J2.omega = 8, laws at t = 0 s (brake released, load slipping forward)"
    )
    assert net.modes(t=8.0).title == "crane at rest, laws at t = 8 s (brake locked, load stuck)"


def test_a_shape_is_scaled_by_the_unit_with_the_most_kinetic_energy() -> None:
    """A drum against four masses: it has 0.77 of their energy, and more than any of them alone."""
    net = sw.Network("drum")
    net.add(sw.Inertia("drum", J=1.3 * 4.0 * 0.5**2), "shaft")
    net.add(sw.Drum("winding", radius=0.5), "shaft", "rope end")
    net.add(sw.TranslationalSpring("rope", c=100.0), "rope end", "m1")
    for k in range(1, 5):
        net.add(sw.Mass(f"mass {k}", m=1.0), f"m{k}")
        if k > 1:
            net.add(sw.TranslationalSpring(f"link {k}", c=1e7), f"m{k - 1}", f"m{k}")
    modes = net.modes()
    swing = int(np.flatnonzero(modes.frequencies > 0)[0])
    masses = [abs(modes.shapes[f"mass {k}.v"][swing]) for k in range(1, 5)]
    assert max(masses) == pytest.approx(1.0, rel=1e-12)
    assert abs(modes.shapes["drum.omega"][swing]) * 0.5 == pytest.approx(1 / 1.3, rel=1e-3)


def test_what_swings_with_an_angle_is_no_spring() -> None:
    """Its slope at one angle would be one; a part of one's own says by `swing` what takes it away."""

    @sw.component
    class Ripple(sw.Component):
        size: float = sw.parameter("N*m", "swing", default=500.0)

        ports = (sw.Port("a"),)
        role = "source"
        swing = "size"

        def branches(self, p: Any) -> Iterator[Any]:
            yield sw.ThroughLaw(-p.size * sympy.sin(2 * sw.INTEGRAL))

    try:
        gas = sw.HarmonicTorque("gas", harmonics=sw.Harmonics((2.0,), (500.0,), (-np.pi / 2,)))
        for swinging in (Ripple("gas"), gas):
            net = sw.Network("two masses")
            net.add(swinging, "a")
            net.add(sw.Inertia("J1", J=1.0), "a")
            net.add(sw.Spring("shaft", c=1e3), "a", "b")
            net.add(sw.Inertia("J2", J=1.0), "b")
            modes = net.modes()
            assert modes.rates[0] == 0.0  # it turns freely
            assert modes.frequencies[-1] == pytest.approx(np.sqrt(2e3) / (2 * np.pi), rel=1e-12)
    finally:
        REGISTRY.pop("Ripple", None)
