"""Long shafts: every model against closed forms, against each other and against the parts that it stands for."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import sympy

import shaftwork as sw

STEEL = {"length": 1.0, "diameter": 0.02, "density": 7900.0, "shear_modulus": 77.5e9}
AREA = np.pi * 0.02**4 / 32
INERTIA, STIFFNESS = 7900.0 * AREA, 77.5e9 * AREA
MODELS = (
    sw.Lumped(1),
    sw.Lumped(7),
    sw.Lumped(6, ends="full"),
    sw.CentralDifference(2),
    sw.CentralDifference(7),
    sw.CentralDifference(8, order=4),
    sw.CentralDifference(3, closure="printed"),
    sw.CentralDifference(7, closure="printed"),
    sw.CentralDifference(7, form="paper"),
    sw.CentralDifference(8, form="paper"),
    sw.Spectral(1),
    sw.Spectral(2),
    sw.Spectral(9),
    sw.Spectral(40),
)
# of the lossless shaft with 0.025 and 0.11 (0.025) kg m2 at its ends, by the transcendental equation
TRUE = {0.11: (38.88573365, 1567.02210303, 3132.59539509), 0.025: (49.64737792, 1567.62972935, 3132.89957778)}


def train(model: object, load: float = 0.11, **shaft: float) -> sw.Network:
    """A motor with a step of torque, a shaft and a load."""
    net = sw.Network("train")
    net.add(sw.TorqueSource("motor", tau=12.7), "m")
    net.add(sw.Inertia("Je", J=0.025), "m")
    net.add(sw.Shaft("line", **STEEL, **shaft, model=model), "m", "l")
    net.add(sw.Inertia("Jm", J=load), "l")
    return net


@pytest.mark.parametrize("model", MODELS, ids=repr)
def test_a_mesh_shares_out_the_whole_shaft_and_a_rigid_rotation_twists_nothing(model: sw.Lumped) -> None:
    mesh = model.mesh()
    # sums of at most 80 numbers: to rounding; the printed closure leaves out half an interval at each end
    left_out = 1 if "printed" in repr(model) else 0
    assert sum(mesh.inertias) == pytest.approx(mesh.intervals - left_out, rel=1e-13)
    assert sum(mesh.lengths) == pytest.approx(mesh.intervals, rel=1e-13)
    for row in mesh.weights:
        assert sum(weight for _, weight in row) == pytest.approx(0, abs=1e-12)
    assert (mesh.nodes[0], mesh.nodes[-1]) == (0, 1)
    assert list(mesh.nodes) == sorted(mesh.nodes)


@pytest.mark.parametrize("model", MODELS, ids=repr)
def test_a_uniform_twist_of_the_speeds_is_seen_by_every_torque_alike(model: sw.Lumped) -> None:
    """omega = 1 - x: the rate of twist of a station is its share of the length."""
    mesh = model.mesh()
    speeds = 1 - np.array(mesh.nodes)
    twists = [sum(weight * speeds[j] for j, weight in row) for row in mesh.weights]
    np.testing.assert_allclose(
        np.array(twists) * mesh.intervals, mesh.lengths, atol=1e-12
    )  # to rounding, through a solve of degree 40


def test_a_lumped_shaft_is_the_chain_of_its_parts() -> None:
    """To rounding: eight inertias, seven damped springs and eight bearings, wired by hand."""
    m, damping, friction = 7, 0.3, 0.02
    net = sw.Network("chain")
    net.add(sw.TorqueSource("motor", tau=12.7), "n0")
    net.add(sw.Inertia("Je", J=0.025), "n0")
    for k in range(m + 1):
        share = (0.5 if k in (0, m) else 1.0) / m
        net.add(sw.Inertia(f"J{k}", J=INERTIA * share), f"n{k}")
        net.add(sw.Damper(f"d{k}", d=friction * share), f"n{k}")
    for k in range(m):
        net.add(sw.Spring(f"c{k}", c=STIFFNESS * m, d=damping * m), f"n{k}", f"n{k + 1}")
    net.add(sw.Inertia("Jm", J=0.11), f"n{m}")
    chain, shaft = (made.simulate(0.05) for made in (net, train(sw.Lumped(m), damping=damping, friction=friction)))
    for name in ("Jm.omega", "Je.omega"):
        np.testing.assert_allclose(shaft[name], chain[name], atol=1e-11 * chain[name].max())
    np.testing.assert_allclose(
        shaft["line.tau"][:, 1:-1], np.stack([chain[f"c{k}.tau"] for k in range(m)], 1), atol=1e-8
    )
    np.testing.assert_allclose(
        shaft["line.omega"], np.stack([chain[f"J{k}.omega"] for k in range(m + 1)], 1), atol=1e-9
    )


@pytest.mark.slow
@pytest.mark.parametrize("model", [sw.Rigid(), sw.OneSpring(), *MODELS], ids=repr)
def test_momentum_and_energy_are_kept_by_every_model(model: object) -> None:
    sol = train(model).simulate(0.02, t_eval=[0.013, 0.02])
    massless = isinstance(model, sw.OneSpring)
    momentum = 0.025 * sol["Je.omega"] + 0.11 * sol["Jm.omega"]
    if not massless:
        rigid = isinstance(model, sw.Rigid)
        shares = np.array([0.5, 0.5] if rigid else model.mesh().inertias) / (1 if rigid else model.mesh().intervals)
        momentum = momentum + INERTIA * sol["line.omega"] @ shares
    assert momentum == pytest.approx(12.7 * sol.t, rel=1e-10)
    assert sol.energy_residual < 1e-9  # the quadrature of the powers, not the motion


@pytest.mark.slow
@pytest.mark.parametrize("model", [sw.Lumped(60), sw.CentralDifference(60, order=4), sw.Spectral(24)], ids=repr)
def test_damped_models_agree_with_each_other(model: object) -> None:
    """With internal damping the motion is smooth, and fine models see the same one."""
    reference = train(sw.Spectral(32), damping=2.0, friction=0.05).simulate(0.05)
    sol = train(model, damping=2.0, friction=0.05).simulate(0.05)
    for name, tolerance in (("Jm.omega", 1e-5), ("line.tau_b", 3e-3)):  # Lumped(60) is good to (1/60)^2 of a wave
        assert np.abs(sol[name] - reference[name]).max() < tolerance * np.abs(reference[name]).max()


def test_a_bored_shaft_has_the_difference_of_two_solid_ones() -> None:
    net = sw.Network("bored")
    net.add(sw.Shaft("line", **STEEL, inner_diameter=0.015, model=sw.Lumped(2)), "a", "b")
    form = net.compile()
    bored = np.pi * (0.02**4 - 0.015**4) / 32
    rates = form.jacobian(0.0, np.zeros(len(form.states))).toarray()
    # free at both ends, with inertias 1/4, 1/2, 1/4: rates of 8 and 16 stiffness / inertia squared
    found = np.unique(np.round(np.linalg.eigvals(rates).imag ** 2, 0))
    ratio = 77.5e9 * bored / (7900 * bored)
    assert found[-1] == pytest.approx(16 * ratio, rel=1e-6)


def test_stepped_shafts_and_discs_are_shafts_in_a_row() -> None:
    """Two halves are the whole shaft, whatever stands at the joint: to the accuracy of the spectral model."""
    half = {**STEEL, "length": 0.5}
    net = sw.Network("halves")
    net.add(sw.TorqueSource("motor", tau=12.7), "m")
    net.add(sw.Inertia("Je", J=0.025), "m")
    net.add(sw.Shaft("first", **half, model=sw.Spectral(12)), "m", "x")
    net.add(sw.Shaft("second", **half, model=sw.Spectral(12)), "x", "l")
    net.add(sw.Inertia("Jm", J=0.11), "l")
    compiled = net.compile()
    found = np.linalg.eigvals(compiled.jacobian(0.0, np.zeros(len(compiled.states))).toarray()).imag
    lowest = np.sort(found[found > 1.0])[:3] / (2 * np.pi)
    np.testing.assert_allclose(lowest, TRUE[0.11], rtol=1e-9)


def test_a_shaft_between_gears_and_frame_plugs_in_anywhere() -> None:
    """A clamped shaft behind a gear: lowest frequency of a quarter wave, with the gear's ratio in the inertia."""
    net = sw.Network("geared")
    net.add(sw.Inertia("J", J=1e-12), "a")
    net.add(sw.Gear("g", ratio=3.0), "a", "b")
    net.add(sw.Shaft("line", **STEEL, model=sw.Spectral(12)), "b", "ground")
    compiled = net.compile()
    found = np.linalg.eigvals(compiled.jacobian(0.0, np.zeros(len(compiled.states))).toarray()).imag
    quarter = np.sqrt(77.5e9 / 7900) / 4
    # the inertia behind the gear, 9e-12 kg m2, is 1e-8 of that of the shaft
    assert found[found > 1].min() / (2 * np.pi) == pytest.approx(quarter, rel=1e-6)


def test_the_equations_print_the_chain_with_a_running_index() -> None:
    latex = train(sw.Lumped(8), damping=0.1).equations().latex(form="kirchhoff")
    assert r"\tau_{\mathrm{line},k-1} - \tau_{\mathrm{line},k} \qquad \text{for } k = 1, \dots, 7" in latex
    assert r"\omega_{\mathrm{line},k} - \omega_{\mathrm{line},k+1} \qquad \text{for } k = 1, \dots, 6" in latex


def test_central_differences_print_as_in_the_source() -> None:
    latex = train(sw.CentralDifference(8)).equations().latex(form="state")
    assert r"\omega_{\mathrm{line},k-1}" in latex
    assert r"\omega_{\mathrm{line},k+1}" in latex
    assert r"\qquad \text{for } k = 2, \dots, 6" in latex


def test_diameters_change_without_a_new_model() -> None:
    model = train(sw.Spectral(6)).compile()
    thick = model.simulate(0.01, parameters={"line.diameter": 0.03})
    again = sw.Network("thick")
    again.add(sw.TorqueSource("motor", tau=12.7), "m")
    again.add(sw.Inertia("Je", J=0.025), "m")
    again.add(sw.Shaft("line", **{**STEEL, "diameter": 0.03}, model=sw.Spectral(6)), "m", "l")
    again.add(sw.Inertia("Jm", J=0.11), "l")
    np.testing.assert_allclose(thick["line.tau_a"], again.simulate(0.01)["line.tau_a"], rtol=1e-10, atol=1e-10)


@pytest.mark.parametrize("model", [sw.Rigid(), sw.OneSpring(), *MODELS], ids=repr)
def test_a_model_is_saved_and_read_as_text(model: object, tmp_path: Path) -> None:
    train(model).save(tmp_path / "train.toml")
    again = sw.Network.load(tmp_path / "train.toml")
    assert again.netlist().placed == train(model).netlist().placed
    assert sw.Shaft("line", **STEEL, model=repr(model)).model == model


@pytest.mark.parametrize(
    ("model", "says"),
    [
        ("Lumped(0)", "m = 0 must be a whole number from 1"),
        ("Lumped(2.5)", "m = 2.5 must be a whole number"),
        ("Lumped(5, ends='open')", "must be one of: 'half', 'full'"),
        ("CentralDifference(4, order=4)", "whole number from 8"),
        ("CentralDifference(4, order=3)", "must be one of: 2, 4"),
        ("CentralDifference(2, closure='printed')", "whole number from 3"),
        ("CentralDifference(20, 4, 'printed')", "the printed closure is of order 2"),
        ("CentralDifference(4, second_difference='wide')", "must be one of: 'consistent', 'printed'"),
        ("Finite(3)", "no shaft model.*Lumped, CentralDifference, Spectral"),
        ("__import__('os').getcwd()", "no shaft model"),
        (12, "no shaft model"),
        ("Lumped(", "no shaft model"),
    ],
)
def test_a_wrong_model_is_answered_with_what_there_is(model: object, says: str) -> None:
    with pytest.raises(sw.ParameterError, match=f"(?s)Shaft 'line': model.*{says}"):
        sw.Shaft("line", **STEEL, model=model)


def test_quantities_along_the_shaft_have_a_column_for_each_place() -> None:
    sol = train(sw.Lumped(4)).simulate(0.01, t_eval=5)
    np.testing.assert_allclose(sol.places["line.tau"], [0, 0.125, 0.375, 0.625, 0.875, 1])
    np.testing.assert_allclose(sol.places["line.omega"], [0, 0.25, 0.5, 0.75, 1])
    assert sol["line.tau"].shape == (5, 6)
    np.testing.assert_array_equal(sol["line.tau"][:, 0], sol["line.tau_a"])
    np.testing.assert_array_equal(sol["line.tau"][:, -1], sol["line.tau_b"])
    np.testing.assert_array_equal(sol["line.omega"][:, -1], sol["Jm.omega"])


@pytest.mark.slow
@pytest.mark.parametrize("model", [sw.Rigid(), sw.Lumped(2), sw.Spectral(2), sw.Wave(3)], ids=repr)
def test_places_follow_the_length_in_any_unit_and_of_the_run(model: object) -> None:
    units = pytest.importorskip("pint").UnitRegistry()
    for name in ("line.tau", "line.omega"):
        shares = train(model).simulate(0.001).places[name]
        assert (shares[0], shares[-1]) == (0, 1)
        again = sw.Network("long")
        again.add(sw.Inertia("Je", J=0.025), "m")
        again.add(sw.Shaft("line", **{**STEEL, "length": 1500 * units.mm}, model=model), "m", "l")
        again.add(sw.Inertia("Jm", J=0.11), "l")
        np.testing.assert_allclose(again.simulate(0.001).places[name], 1.5 * shares, rtol=1e-15)
        longer = train(model).simulate(0.001, parameters={"line.length": 2.0})
        np.testing.assert_array_equal(longer.places[name], 2.0 * shares)


@pytest.mark.slow
def test_a_law_of_the_speed_may_stand_at_either_end() -> None:
    """A nonlinear motor and a smooth brake: the same motion by an explicit and an implicit engine."""
    net = train(sw.Spectral(6), damping=0.5)
    net.add(sw.TorqueSource("brake", tau=-5 * sympy.tanh(sw.omega / 0.5)), "l")
    first, second = (net.simulate(0.05, engine=name, rtol=1e-9) for name in ("auto", "scipy-radau"))
    assert np.abs(first["line.tau_b"] - second["line.tau_b"]).max() < 1e-5 * np.abs(first["line.tau_b"]).max()


@pytest.mark.slow
@pytest.mark.parametrize(("f_max", "tolerance"), [(100.0, 1e-3), (2000.0, 1e-2), (5000.0, 1e-3), (20000.0, 1e-6)])
def test_auto_takes_the_smallest_spectral_model_that_is_right_up_to_its_frequency(
    f_max: float, tolerance: float
) -> None:
    part = sw.Shaft("line", **STEEL, model=sw.Auto(f_max=f_max, tolerance=tolerance))
    speed = np.sqrt(77.5e9 / 7900)

    def error(n: int) -> float:
        net = sw.Network("free")
        net.add(sw.Shaft("line", **STEEL, model=sw.Spectral(n)), "a", "b")
        compiled = net.compile()
        found = np.linalg.eigvals(compiled.jacobian(0.0, np.zeros(len(compiled.states))).toarray()).imag
        lowest = np.sort(found[found > 1.0]) / (2 * np.pi)
        exact = speed / 2 * np.arange(1, max(f_max / (speed / 2), 1) + 0.5)
        return float(np.abs(lowest[: len(exact)] / exact - 1).max()) if len(lowest) >= len(exact) else np.inf

    assert error(part.resolved.n) <= tolerance
    assert part.resolved.n == 1 or error(part.resolved.n - 1) > tolerance / 10  # the clamped shaft decides too


@pytest.mark.slow
def test_auto_chooses_again_for_the_parameters_of_a_run() -> None:
    """A shaft of ten times the length has the model that a new network takes; another inertia asks for no new one."""

    def built(**values: float) -> sw.Network:
        net = sw.Network("train")
        net.add(sw.TorqueSource("motor", tau=10.0), "m")
        net.add(sw.Inertia("Je", J=0.025), "m")
        net.add(sw.Shaft("line", **STEEL | values, model=sw.Auto(f_max=2000.0)), "m", "l")
        net.add(sw.Inertia("Jm", J=0.11), "l")
        return net

    model = built(length=1.0).compile()
    given = {"line.length": 10.0, "line.density": 7800.0, "Je.J": 0.03}
    changed = model.simulate(0.02, parameters=given, t_eval=41)
    fresh = built(length=10.0, density=7800.0).simulate(0.02, parameters={"Je.J": 0.03}, t_eval=41)
    assert changed.states == fresh.states
    assert len(changed.states) > len(model.states)
    np.testing.assert_allclose(changed["line.tau_b"], fresh["line.tau_b"], rtol=1e-12, atol=1e-12)
    for parameter, value in (("Je.J", 0.05), ("line.length", 1.001), ("line.diameter", 0.03)):
        assert not model.changes_structure({parameter: value})
    with pytest.raises(sw.ParameterError, match="half waves along the shaft"):
        model.simulate(0.02, parameters={"line.length": 1000.0})


def test_a_bore_must_be_smaller_than_the_shaft() -> None:
    with pytest.raises(sw.ParameterError, match=r"inner_diameter = 0\.02 must be smaller than the diameter 0\.02"):
        sw.Shaft("line", **STEEL, inner_diameter=0.02)


def test_a_shaft_is_a_chain_of_twenty_elements_unless_told_otherwise() -> None:
    assert sw.Shaft("line", length=1.0, diameter=0.1).model == sw.Lumped() == sw.Lumped(20)


def test_a_wave_has_two_places_at_least() -> None:
    with pytest.raises(sw.ParameterError, match="places = 1 must be a whole number from 2"):
        sw.Wave(places=1)
    assert sw.Wave(places=2).places == 2
