"""Exact shafts in the frequency domain: against transfer matrices, closed forms and converged meshes."""

from __future__ import annotations

from typing import Any

import mpmath
import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

import shaftwork as sw
from shaftwork.components.shaft_models import ShaftModel
from shaftwork.frequency import exact_spectrum
from tests.properties.examples import share_of_examples
from tests.reference.exact_shafts.exact_response import frequency_response
from tests.reference.exact_shafts.line import Section, SectionLine
from tests.reference.line_modes import modes as line_modes
from tests.reference.line_modes import natural_frequencies

STEEL = {"density": 7900.0, "shear_modulus": 77.5e9}
SECTION = Section.of_geometry(1.0, 0.02, **STEEL)
LOSSY = {"damping": 2e-3, "friction": 0.05}
ROUNDING = 1e-11
"""Of rates and amplitudes; a mesh of 24 to 40 elements is converged to it, and the condition of some is 1e4."""


def _train(model: ShaftModel, J: tuple[float, float] = (0.025, 0.11), **values: float) -> sw.Network:
    net = sw.Network("train")
    net.add(sw.TorqueSource("motor", tau=0.0), "m")
    net.add(sw.Inertia("Je", J=J[0]), "m")
    geometry = {"length": 1.0, "diameter": 0.02, **STEEL, **values}
    net.add(sw.Shaft("line", **geometry, model=model), "m", "l")
    net.add(sw.Inertia("Jm", J=J[1]), "l")
    return net


def _branched(model: ShaftModel, **values: float) -> sw.Network:
    """A hollow shaft, a gear, and behind it two equal branches of two steps each: half of the modes come in pairs."""
    net = sw.Network("branched")
    net.add(sw.TorqueSource("motor", tau=0.0), "m")
    net.add(sw.Inertia("J0", J=0.05), "m")
    net.add(
        sw.Shaft("in", length=0.8, diameter=0.03, inner_diameter=0.01, model=model, **STEEL, **values), "m", "pinion"
    )
    net.add(sw.Gear("gear", ratio=2.5), "pinion", "wheel")
    net.add(sw.Inertia("J1", J=0.1), "wheel")
    for k in "123":
        net.add(sw.Shaft(f"b{k}", length=1.3, diameter=0.04, model=model, **STEEL, **values), "wheel", f"x{k}")
        net.add(sw.Shaft(f"c{k}", length=0.7, diameter=0.03, model=model, **STEEL, **values), f"x{k}", f"e{k}")
        net.add(sw.Inertia(f"L{k}", J=0.2), f"e{k}")
    return net


def _crane(model: ShaftModel, *, rotor: bool = True) -> sw.Network:
    """A motor with a falling curve, a load that grows with speed, a gear between shafts of very different stiffness."""
    net = sw.Network("crane")
    net.add(sw.KlossMotor("motor", tau_k=60.0, s_k=0.2, n_sync=3000.0), "m")
    if rotor:
        net.add(sw.Inertia("rotor", J=0.02), "m")
    net.add(sw.Shaft("in", length=1.0, diameter=0.02, friction=0.02, model=model, **STEEL), "m", "pinion")
    net.add(sw.Gear("gear", ratio=10.0), "pinion", "wheel")
    net.add(sw.Shaft("out", length=3.0, diameter=0.06, model=model, **STEEL), "wheel", "d")
    net.add(sw.Inertia("drum", J=8.0), "d")
    net.add(sw.TorqueSource("load", tau=-0.02 * sw.omega**3), "d")
    return net


def _supplied(model: ShaftModel) -> sw.Network:
    net = sw.Network("supplied")
    net.add(sw.VoltageSource("supply", u=100.0), "plus", "ground")
    net.add(sw.DCMachine("machine", k=0.5, R=0.3, L=0.01), "plus", "ground", "rotor")
    net.add(sw.Inertia("J", J=0.01), "rotor")
    net.add(sw.Shaft("shaft", length=2.0, diameter=0.02, damping=1e-3, model=model, **STEEL), "rotor", "l")
    net.add(sw.Spring("coupling", c=500.0, d=0.1), "l", "k")
    net.add(sw.ViscousLoad("load", d=0.05), "k")
    return net


def _held(model: ShaftModel) -> sw.Network:
    """Two shafts side by side between a driven node and an inertia, and one to the frame: torques without motion."""
    net = sw.Network("held")
    net.add(sw.SpeedSource("drive", omega=10.0), "a")
    net.add(sw.Shaft("s1", length=1.0, diameter=0.02, model=model, **STEEL), "a", "b")
    net.add(sw.Inertia("J", J=0.02), "b")
    net.add(sw.Shaft("s2", length=1.0, diameter=0.02, model=model, **STEEL), "b", "a")
    net.add(sw.Shaft("s3", length=0.5, diameter=0.02, model=model, **STEEL), "b", "ground")
    return net


def _assert_equal_rates(found: Any, wanted: Any, tolerance: float = ROUNDING) -> None:
    assert len(found) == len(wanted)
    np.testing.assert_allclose(found.rates, wanted.rates, rtol=tolerance, atol=0)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("J", "printed"),
    [(0.11, (38.88573365, 1567.02210303, 3132.59539509)), (0.025, (49.64737792, 1567.62972935, 3132.89957778))],
)
@pytest.mark.parametrize("model", [sw.Lumped(3), sw.Wave(), sw.Auto(f_max=10.0, tolerance=0.1)])
def test_the_reference_shaft_has_its_printed_frequencies_whatever_its_model(
    J: float, printed: tuple[float, ...], model: ShaftModel
) -> None:
    """SOURCES, error 8: eight decimals; those beyond are of the transcendental equation, to rounding."""
    modes = _train(model, (0.025, J)).modes(exact=True)
    assert len(modes) == exact_spectrum.MODES
    np.testing.assert_allclose(modes.frequencies[1:4], printed, atol=5.1e-9)
    line = SectionLine((Section.of_geometry(1.0, 0.02),), (0.025, J))
    np.testing.assert_allclose(modes.frequencies, natural_frequencies(line, count=10), rtol=1e-14)
    assert not modes.damping.any()
    assert modes.names[0] == "rigid body of Je, line, Jm"


@pytest.mark.slow
@pytest.mark.parametrize("length", [1e-3, 1e4])
@pytest.mark.parametrize("J", [(1e-9, 1e3), (1e-4, 1e-9), (1e6, 1e-2), (1e6, 1e3)])
def test_no_mode_is_lost_at_extreme_ratios(length: float, J: tuple[float, float]) -> None:
    modes = _train(sw.Lumped(4), J, length=length).modes(count=12, exact=True)
    wanted = natural_frequencies(SectionLine((Section.of_geometry(length, 0.02),), J), count=12)
    np.testing.assert_allclose(modes.frequencies, wanted, rtol=1e-13)


@pytest.mark.slow
def test_a_stepped_shaft_with_discs_has_the_shapes_of_its_line() -> None:
    sections = ((0.4, 0.03), (1.1, 0.05), (0.7, 0.04))
    discs = (0.02, 0.0, 0.3, 0.08)
    net = sw.Network("stepped")
    for k, (length, diameter) in enumerate(sections):
        net.add(sw.Shaft(f"s{k}", length=length, diameter=diameter, model=sw.Lumped(7), **STEEL), f"n{k}", f"n{k + 1}")
    for k, J in enumerate(discs):
        if J:
            net.add(sw.Inertia(f"J{k}", J=J), f"n{k}")
    modes = net.modes(exact=True, f_max=9000.0)
    line = SectionLine(tuple(Section.of_geometry(*section) for section in sections), discs)
    wanted = line_modes(line, f_max=9000.0)
    np.testing.assert_allclose(modes.frequencies, wanted.frequencies, rtol=1e-13)
    start = 0.0
    for k, (length, _) in enumerate(sections):
        stations = start + np.linspace(0.0, 1.0, 8) * length
        shape = wanted.angles(stations) / wanted.angles(np.array([0.0]))
        found = modes.shapes[f"s{k}.omega"] / modes.shapes["n0.omega"][:, None]
        np.testing.assert_allclose(found, shape, atol=1e-10 * np.abs(shape).max())
        np.testing.assert_allclose(modes.shapes[f"s{k}.3.omega"], modes.shapes[f"s{k}.omega"][:, 3], rtol=1e-14)
        start += length


def test_the_damped_shaft_responds_as_its_transfer_matrix() -> None:
    f = np.geomspace(0.1, 2e4, 300)
    net = _train(sw.Lumped(10), **LOSSY)
    line = SectionLine((Section.of_geometry(1.0, 0.02, **LOSSY),), (0.025, 0.11))
    wanted = frequency_response(line, f, 0)
    for name, values in (("line.omega_b", wanted.speeds([1.0])), ("line.tau_b", wanted.torques([1.0], "left"))):
        found = net.frequency_response("motor.tau", name, f, exact=True)
        np.testing.assert_allclose(found.values, values[:, 0], rtol=1e-12)


@pytest.mark.slow
def test_a_bare_free_shaft_is_a_cotangent() -> None:
    """omega_a / tau_a = cot(w T) / (i Z) without anything at its ends, also at 0 and beyond 1000 half waves."""
    net = sw.Network("bare")
    net.add(sw.TorqueSource("motor", tau=0.0), "a")
    net.add(sw.Shaft("line", length=1.0, diameter=0.02, model=sw.Wave(), **STEEL), "a", "b")
    T = np.sqrt(STEEL["density"] / STEEL["shear_modulus"])
    Z = np.pi * 0.02**4 / 32 * np.sqrt(STEEL["density"] * STEEL["shear_modulus"])
    f = np.array([0.01, 0.123, 0.25, 0.4, 7.1, 1000.3]) / T
    found = net.frequency_response("motor.tau", "a.omega", f).values * Z
    np.testing.assert_allclose(found, -1j / np.tan(2 * np.pi * f * T), atol=1e-11)
    np.testing.assert_allclose(net.modes().frequencies * T, np.arange(10) / 2, rtol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("values", [{}, LOSSY])
def test_meshes_converge_to_the_exact_branches_with_their_equal_frequencies(values: dict[str, float]) -> None:
    exact, mesh = (net.modes(exact=isinstance(model, sw.Lumped), f_max=2500.0) for model, net in (
        (made, _branched(made, **values)) for made in (sw.Lumped(5), sw.Spectral(24))))  # fmt: skip
    _assert_equal_rates(exact, mesh, 1e-9)  # the rounding of the mesh, in the slow decay of the whole
    pairs = np.isclose(exact.rates[1:], exact.rates[:-1], rtol=1e-10, atol=0)
    assert pairs.sum() >= 4
    read = exact.shapes
    np.testing.assert_allclose(read["J1.tau"], 0.1 * exact.rates * read["wheel.omega"], atol=1e-8)
    balance = read["gear.tau_b"] + read["J1.tau"] + sum(read[f"b{k}.tau_a"] for k in "123")
    assert np.abs(balance).max() < 1e-9 * np.abs(read["b1.tau_a"]).max()
    amplitudes = np.array([read[f"L{k}.omega"] for k in "123"]).T[1:][np.concatenate([pairs[1:] & pairs[:-1], [False]])]
    assert np.linalg.matrix_rank(amplitudes) <= 2


@pytest.mark.slow
@pytest.mark.parametrize("output", ["c2.tau_b", "c1.3.omega"])
def test_meshes_converge_to_the_exact_response(output: str) -> None:
    f = np.geomspace(0.5, 2500.0, 100)
    mesh = _branched(sw.Spectral(24), **LOSSY)
    exact = _branched(sw.Spectral(24), **LOSSY).frequency_response("motor.tau", output, f, exact=True)
    np.testing.assert_allclose(exact.values, mesh.frequency_response("motor.tau", output, f).values, rtol=1e-9)


@pytest.mark.slow
def test_torques_that_hold_without_motion_are_modes_of_rate_zero() -> None:
    exact, mesh = _held(sw.Wave()).modes(f_max=6000.0), _held(sw.Spectral(28)).modes(f_max=6000.0)
    _assert_equal_rates(exact, mesh)
    assert exact.names[:2] == ("constant in s1, s3", "constant in s2, s3")
    torque = exact.shapes["s1.tau"]
    np.testing.assert_allclose(torque[0], exact.shapes["drive.tau"][0], rtol=1e-12)
    f = np.linspace(10.0, 3000.0, 40)
    found = (
        _held(model).frequency_response("drive.omega", "drive.tau", f).values for model in (sw.Wave(), sw.Spectral(28))
    )
    np.testing.assert_allclose(next(found), next(found), rtol=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize("rotor", [True, False])
def test_laws_enter_by_their_slopes_at_the_operating_point(rotor: bool) -> None:  # noqa: FBT001
    """Without its rotor the motor is at a massless node, where speed and torque of its curve depend on each other."""
    exact, mesh = _crane(sw.Lumped(6), rotor=rotor), _crane(sw.Spectral(28), rotor=rotor)
    at, near = exact.compile().steady_state(), mesh.compile().steady_state()
    found = exact.modes(at, exact=True, f_max=1500.0)
    _assert_equal_rates(found, mesh.modes(near, f_max=1500.0))
    assert (found.rates.real < -1.0).all()
    assert (exact.modes(exact=True, f_max=1500.0).rates.real > 0).any()  # at rest the motor's curve rises
    f = np.geomspace(0.1, 1500.0, 60)
    for output in ("out.tau_a", "motor.power"):
        responses = (
            net.frequency_response("load.tau", output, f, at=point, exact=net is exact).values
            for net, point in ((exact, at), (mesh, near))
        )
        np.testing.assert_allclose(next(responses), next(responses), rtol=1e-9)


def test_a_load_that_sticks_holds_its_end_of_an_exact_shaft() -> None:
    """A disc on a clamped shaft: J omega = Z cot(omega T), of which rounding is left."""
    net = sw.Network("stuck")
    net.add(sw.Inertia("J1", J=0.03), "a")
    net.add(sw.Shaft("shaft", length=1.0, diameter=0.02, **STEEL), "a", "b")
    net.add(sw.Inertia("J2", J=0.1), "b")
    net.add(sw.CoulombLoad("load", tau=10.0), "b")
    modes = net.modes(exact=True, count=1)
    assert modes.title == "stuck at rest (load stuck)"
    wave, polar = np.sqrt(STEEL["shear_modulus"] / STEEL["density"]), np.pi * 0.02**4 / 32
    omega, impedance = modes.rates[0].imag, polar * np.sqrt(STEEL["density"] * STEEL["shear_modulus"])
    np.testing.assert_allclose(0.03 * omega * np.tan(omega * 1.0 / wave), impedance, rtol=1e-9)
    assert abs(modes.rates[0].real) < 1e-9 * omega


RUNNING = {"a.omega": 4.0, "b.omega": 4.0, "c.omega": 2.0}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("part", "at", "phase"),
    [
        (sw.DryFriction("rub", tau_c=10.0, tau_s=20.0), None, "rub stuck"),
        (sw.DryFriction("rub", tau_c=10.0, tau_s=20.0, omega_s=3.0), RUNNING, "rub slipping forward"),
        (sw.Freewheel("wheel"), None, "wheel locked"),
        (sw.Freewheel("wheel"), {"b.omega": 0.0, "c.omega": 2.0}, "wheel free"),
        (sw.Backlash("gap", gap=0.1, c=1e5, d=3.0), {"gap.phi": 0.06}, "gap in contact"),
        (sw.Backlash("gap", gap=0.1), None, "gap open"),
        (sw.Brake("brake", tau=10.0, on=1.0), None, "brake locked"),
        (sw.LossyGear("gear", ratio=2.0, efficiency=0.9), RUNNING, "gear driving forward"),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)
def test_parts_are_in_the_mode_that_goes_on_at_the_point(part: sw.Component, at: Any, phase: str) -> None:
    """As with a mesh of 16 pieces, whose error is rounding here; without the mode a stuck load would be a damper."""
    nets = []
    for model in (sw.Lumped(6), sw.Spectral(16)):
        net = sw.Network("train")
        net.add(sw.TorqueSource("motor", tau=3.0), "b")
        net.add(sw.Inertia("J1", J=20.0), "a")
        net.add(sw.Shaft("shaft", length=6.0, diameter=0.14, model=model), "a", "b")
        net.add(sw.Inertia("J2", J=90.0), "b")
        net.add(part, "b", "c")
        net.add(sw.Inertia("J3", J=9.0), "c")
        nets.append(net)
    exact, mesh = nets[0].modes(at, exact=True, f_max=300.0), nets[1].modes(at, f_max=300.0)
    assert exact.title == mesh.title
    assert exact.title.endswith(f"({phase})")
    _assert_equal_rates(exact, mesh)
    f = np.array([1.0, 30.0, 250.0])
    responses = (net.frequency_response("motor.tau", "J3.omega", f, at=at, exact=net is nets[0]).values for net in nets)
    np.testing.assert_allclose(next(responses), next(responses), rtol=1e-9, atol=1e-15)


@pytest.mark.slow
def test_a_motion_with_waves_is_a_point() -> None:
    net = _crane(sw.Wave())
    sol = net.simulate(0.4, t_eval=401)
    speeds = {f"{name}.omega": float(sol[f"{name}.omega"][-1]) for name in ("rotor", "drum")}
    found = net.modes(sol.at([0.4]), f_max=1000.0)
    np.testing.assert_allclose(found.rates, net.modes(speeds, f_max=1000.0).rates, rtol=1e-10)
    with pytest.raises(sw.SimulationError, match=r"'in' is a travelling wave.*net\.modes\(\).*Spectral\(16\)"):
        net.compile().linearize()


def test_a_torque_that_holds_a_shaft_against_a_spring_is_the_same_in_both() -> None:
    """A mode of rate zero: nothing turns, and what the shaft takes in the spring takes to the frame."""
    net = sw.Network("held")
    net.add(sw.SpeedSource("drive", omega=10.0), "a")
    net.add(sw.Shaft("line", length=1.0, diameter=0.02, model=sw.Wave(), **STEEL), "a", "b")
    net.add(sw.Inertia("J", J=0.02), "b")
    net.add(sw.Spring("holder", c=500.0), "b", "ground")
    modes = net.modes({}, 2)
    assert modes.rates[0] == 0
    np.testing.assert_allclose(modes.shapes["line.tau"][0], modes.shapes["holder.tau"][0], rtol=1e-9)


@pytest.mark.parametrize(("second", "count"), [(10.000001j, 1), (11j, 2)])
def test_two_starts_that_lead_to_one_root_are_no_two_modes(second: complex, count: int) -> None:
    """The mesh is then too coarse to tell them apart, and a finer one is made."""

    class Found:
        unknowns = 2

        def roots(self, starts: Any) -> Any:
            return np.array([10j if abs(starts[0]) < 10 else second]), np.zeros((2, 1))

    rates, _ = exact_spectrum._refined(Found(), np.array([8j, 12j]), 20.0)  # type: ignore[arg-type]
    assert len(rates) == count


@pytest.mark.slow
def test_the_first_modes_of_a_shaft_with_much_friction_are_those_up_to_a_frequency() -> None:
    """Friction makes more half waves than the delay alone tells."""
    net = _train(sw.Wave(), friction=1.0)
    first, many = net.modes({}, 3), net.modes({}, f_max=4000.0)
    assert len(many) > len(first) == 3
    np.testing.assert_allclose(first.rates, many.rates[:3], rtol=1e-9)


@pytest.mark.slow
def test_an_angle_that_no_slope_reads_is_the_integral_of_its_speed_in_each_mode() -> None:
    """A spring by the square of its angle is none at rest, and only records the angle."""
    net = _train(sw.Wave())
    net.add(sw.TorqueSource("spring", tau=-3 * sw.phi**2), "l")
    modes = net.modes({}, 4)
    angle, speed = (modes.shapes[name][1:] for name in ("spring.phi", "Jm.omega"))
    np.testing.assert_allclose(angle * modes.rates[1:], speed, rtol=1e-9)
    assert (modes.rates.real == 0).all()  # exactly: nothing is lost


@pytest.mark.slow
def test_the_point_of_a_motion_is_its_end_in_time_too() -> None:
    """A brake that grips harder by the second: modes about a motion read it where the motion ends, or when told."""
    net = sw.Network("gripping")
    net.add(sw.TorqueSource("brake", tau=-(0.1 + 50 * sw.t) * sw.omega - 0.02 * sw.omega**3), "m")
    net.add(sw.Inertia("rotor", J=0.02), "m")
    net.add(sw.Shaft("shaft", length=1.0, diameter=0.02, model=sw.Wave(), **STEEL), "m", "l")
    net.add(sw.Inertia("load", J=0.05), "l")
    sol = net.simulate(0.01, initial={"rotor.omega": 5.0})
    end = {name: float(sol[name][-1]) for name in ("rotor.omega", "load.omega")}
    for t, time in ((None, 0.01), (0.002, 0.002)):
        found, wanted = net.modes(sol.at([0.01]), 3, t=t), net.modes(end, 3, t=time)
        np.testing.assert_allclose(found.rates, wanted.rates, rtol=1e-9)


@pytest.mark.slow
def test_an_electrical_supply_and_a_soft_coupling_stand_beside_an_exact_shaft() -> None:
    exact, mesh = _supplied(sw.Lumped(3)), _supplied(sw.Spectral(32))
    _assert_equal_rates(exact.modes(exact=True, f_max=2500.0), mesh.modes(f_max=2500.0))
    f = np.geomspace(0.1, 2500.0, 60)
    for output in ("shaft.tau_b", "supply.i", "coupling.phi_rel"):
        found = exact.frequency_response("supply.u", output, f, exact=True).values
        np.testing.assert_allclose(found, mesh.frequency_response("supply.u", output, f).values, rtol=1e-10)


def _exact_rate(damping: float, friction: float, start: complex) -> complex:
    """The root of the transcendental equation of two discs on a lossy shaft, with 40 digits."""
    with mpmath.workdps(40):
        area = mpmath.pi * mpmath.mpf(0.02) ** 4 / 32
        inertia, stiffness, disc = 7900 * area, mpmath.mpf(77.5e9) * area, mpmath.mpf(0.1)

        def gap(s: Any) -> Any:
            shunt, series = s * inertia + friction, s / (stiffness + s * damping)
            gamma = mpmath.sqrt(shunt * series)
            cosh, sinhc = mpmath.cosh(gamma), mpmath.sinh(gamma) / gamma
            return s * disc * (cosh + s * disc * series * sinhc) + s * disc * cosh + shunt * sinhc

        return complex(mpmath.findroot(gap, mpmath.mpc(start)))


@pytest.mark.slow
@pytest.mark.parametrize(("damping", "friction"), [(1.0, 1e-3), (1e-2, 1.0), (1e-6, 1e3), (100.0, 1.0)])
def test_rates_of_slight_and_of_overwhelming_losses_agree_with_40_digits(damping: float, friction: float) -> None:
    modes = _train(sw.Lumped(4), (0.1, 0.1), damping=damping, friction=friction).modes(exact=True)
    wanted = [_exact_rate(damping, friction, rate) for rate in modes.rates.tolist()]
    np.testing.assert_allclose(modes.rates, wanted, rtol=1e-11)
    assert len(set(wanted)) == len(wanted)


def test_modes_that_crowd_are_named_with_the_frequency_up_to_which_all_are_known() -> None:
    net = _train(sw.Lumped(10), damping=1.0)
    assert len(net.modes(exact=True)) == 2
    with pytest.raises(sw.ParameterError, match=r"f_max = 200 Hz.*'line'.*-1217 1/s.*f_max = 95\.9"):
        net.modes(exact=True, f_max=200.0)
    with pytest.raises(sw.ParameterError, match=r"count = 3: .*crowd"):
        net.modes(count=3, exact=True)
    with pytest.raises(sw.ParameterError, match=r"half waves along shaft 'line'.*smaller f_max"):
        _train(sw.Wave()).modes(f_max=1e6)


@pytest.mark.slow
def test_what_the_meshes_lose_is_no_result(monkeypatch: pytest.MonkeyPatch) -> None:
    """The count of the exact modes knows no mesh: with one mode of the mesh left out nothing is returned."""
    net = _train(sw.Wave())
    monkeypatch.setattr(exact_spectrum, "_together", lambda starts, real=exact_spectrum._together: real(starts[:-1]))
    with pytest.raises(sw.SimulationError, match="could not be settled"):
        net.modes(f_max=4000.0)


def _open_ended(d: float, J: float = 0.0, side: float = 0.0) -> sw.Network:
    """A shaft that ends in a damper; at its start nothing, an inertia, or another shaft too."""
    net = sw.Network("open ended")
    net.add(sw.TorqueSource("motor", tau=0.0), "m")
    net.add(sw.Shaft("line", length=1.0, diameter=0.02, **STEEL, model=sw.Wave()), "m", "l")
    net.add(sw.Damper("end", d=d), "l")
    if J:
        net.add(sw.Inertia("Je", J=J), "m")
    if side:
        net.add(sw.Shaft("side", length=0.7, diameter=0.02, **STEEL, model=sw.Wave()), "m", "s")
        net.add(sw.Inertia("Js", J=side), "s")
    return net


@pytest.mark.slow
def test_at_a_matched_end_everything_leaves_and_no_mode_is_made_up() -> None:
    """Behind an inertia J the shaft is a damper Z: the one mode is -Z / J. A side branch keeps its own."""
    impedance = SECTION.impedance
    for asked in ({"count": 3}, {}, {"f_max": 9000.0}):
        for J, rates in ((0.0, []), (0.025, [-impedance / 0.025])):
            with pytest.warns(sw.NetworkWarning, match=r"takes all that arrives.*f_max = 4698 Hz"):
                modes = _open_ended(impedance, J).modes(**asked)
            np.testing.assert_allclose(modes.rates, rates, rtol=1e-11)
    assert len(_open_ended(impedance).modes(f_max=3000.0)) == 0
    both = _open_ended(impedance, 0.025, 0.1).modes(f_max=3000.0)
    inertia = _train(sw.Wave(), (0.025, 0.1), length=0.7)
    inertia.add(sw.Damper("open", d=impedance), "m")
    _assert_equal_rates(both, inertia.modes(f_max=3000.0), 1e-9)


def test_an_end_that_throws_back_a_little_has_the_modes_of_its_echo() -> None:
    """With the share r thrown back exp(-2 s T) = r has the roots s = (ln r + 2 pi i k) / 2 T."""
    delay = float(np.sqrt(7900 / 77.5e9))
    modes = _open_ended(SECTION.impedance * (1 - 0.2) / (1 + 0.2)).modes(count=4)
    np.testing.assert_allclose(modes.rates, (np.log(0.2) + 2j * np.pi * np.arange(4)) / (2 * delay), rtol=1e-11)


@pytest.mark.slow
def test_an_undamped_resonance_that_is_hit_is_infinite() -> None:
    net = _train(sw.Wave())
    response = net.frequency_response("motor.tau", "line.tau_b", [30.0, float(net.modes().frequencies[2])])
    assert np.isfinite(response.values[0])
    assert np.isinf(response.values[1])


@pytest.mark.slow
def test_the_mirrored_train_has_the_same_modes_and_mirrored_shapes() -> None:
    values = {"length": 1.0, "diameter": 0.02, **STEEL, **LOSSY, "model": sw.Lumped(6)}
    modes = []
    for nodes in (("a", "b"), ("b", "a")):
        net = sw.Network("one disc")
        net.add(sw.Inertia("J", J=0.03), "a")
        net.add(sw.Shaft("s", **values), *nodes)
        modes.append(net.modes(count=8, exact=True))
    _assert_equal_rates(*modes, 1e-13)
    for quantity, sign in (("omega", 1.0), ("tau", -1.0)):
        here, there = (each.shapes[f"s.{quantity}"] / each.shapes["a.omega"][:, None] for each in modes)
        np.testing.assert_allclose(here, sign * there[:, ::-1], atol=1e-11 * np.abs(here).max())


@pytest.mark.slow
def test_an_interference_diagram_of_waves_meets_the_orders_of_a_fine_mesh() -> None:
    speeds, orders = np.linspace(50.0, 250.0, 5), (1, 2, 12)

    def at(speed: float) -> dict[str, float]:
        return {"rotor.omega": speed, "drum.omega": speed / 10}

    exact = _crane(sw.Lumped(6)).campbell(speeds, orders, at=at, f_max=450.0, exact=True)
    mesh = _crane(sw.Spectral(24)).campbell(speeds, orders, at=at, f_max=450.0)
    found, wanted = ([(made.speed, made.order, made.frequency) for made in each.crossings] for each in (exact, mesh))
    np.testing.assert_allclose(found, wanted, rtol=1e-8)
    assert {order for _, order, _ in found} == {1.0, 2.0, 12.0}
    np.testing.assert_allclose(exact.frequencies, mesh.frequencies, rtol=1e-10)
    constant = _train(sw.Wave()).campbell([0.0, 300.0], (1, 40), f_max=2000.0)
    assert [made.order for made in constant.crossings] == [40.0, 1.0, 40.0]


def test_a_picture_shows_the_nodes_between_the_ends() -> None:
    pytest.importorskip("matplotlib")
    modes = _train(sw.Lumped(6)).modes(exact=True, f_max=4000.0)
    figure = modes.plot(1, 2)
    assert len(figure.axes[0].lines[0].get_xdata()) == 7


_SHAFT = st.tuples(
    st.sampled_from([0.3, 0.7, 1.0, 1.9]),
    st.sampled_from([0.015, 0.03, 0.06]),
    st.sampled_from([0.0, 0.5, 0.9]),
    st.sampled_from([0.0, 1e-5, 1e-3]),
    st.sampled_from([0.0, 1e-3, 0.1]),
    st.sampled_from([0.0, 0.3, 3.0]),
)


@pytest.mark.slow
@settings(share_of_examples(0.01), phases=(Phase.generate,))
@given(st.lists(_SHAFT, min_size=1, max_size=3), st.sampled_from([0.2, 1.0, 3.7]), st.booleans())
def test_random_trains_are_those_of_a_converged_mesh(shafts: list[Any], ratio: float, branched: bool) -> None:  # noqa: FBT001
    """One to three shafts, in a row or from one wheel, hollow, lossy, with or without discs; four half waves each."""

    def network(model: ShaftModel) -> sw.Network:
        net = sw.Network("random")
        net.add(sw.Inertia("J", J=0.01), "start")
        net.add(sw.Gear("gear", ratio=ratio), "start", "n0")
        for k, (length, diameter, bore, damping, friction, disc) in enumerate(shafts):
            size = {"length": length, "diameter": diameter, "inner_diameter": bore * diameter}
            losses = {"damping": damping * diameter**4 * 1e7, "friction": friction}
            shaft = sw.Shaft(f"s{k}", **size, **losses, **STEEL, model=model)
            net.add(shaft, "n0" if branched else f"n{k}", f"n{k + 1}")
            if disc:
                net.add(sw.Inertia(f"D{k}", J=disc * diameter**4 * 1e4), f"n{k + 1}")
        return net

    f_max = 2.0 / (max(length for length, *_ in shafts) * np.sqrt(STEEL["density"] / STEEL["shear_modulus"]))
    exact = network(sw.Lumped(2)).modes(exact=True, f_max=f_max)
    mesh = network(sw.Spectral(40)).modes(f_max=f_max)
    assert len(exact) == len(mesh)
    size = np.abs(mesh.rates).max(initial=1.0)
    np.testing.assert_allclose(exact.rates, mesh.rates, rtol=1e-9, atol=1e-12 * size)  # slow ones drown in its rounding


@pytest.mark.parametrize("count", [2, 3, 5, 8])
def test_shapes_of_a_damped_shaft_move_its_ends_as_their_nodes_do(count: int) -> None:
    """J d(omega)/dt = tau, and the speed of the shaft at its end is that of the inertia there."""
    modes = _train(sw.Lumped(8), damping=2e-3).modes(exact=True, count=count)
    swings = modes.rates.imag > 0
    speed, torque = modes.shapes["Je.omega"][swings], modes.shapes["Je.tau"][swings]
    np.testing.assert_allclose(torque, modes.rates[swings] * 0.025 * speed, rtol=ROUNDING)
    np.testing.assert_allclose(np.array(modes.shapes["line.omega"])[swings, 0], speed, rtol=ROUNDING)
