"""Energy and network theory lead to the same equations of motion."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Callable
from itertools import chain
from typing import Any

import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st
from sympy import Rational, Symbol, cancel, expand, powsimp

import shaftwork as sw
from shaftwork.equations.quantities import rate_of
from shaftwork.equations.second_order import second_order
from shaftwork.formulation.tree import normal_tree
from shaftwork.lagrange.lagrange import Lagrangian, lagrangian
from tests.beds import bed_of, registered
from tests.equations.networks import MECHANICAL, dc_drive, equations_of, from_pieces, mixed_train, shaft
from tests.properties.examples import inner_drives, share_of_examples
from tests.strategies import Network, networks
from tests.trains import Train, trains


def of(name: str) -> Lagrangian:
    return lagrangian(equations_of(MECHANICAL[name]()))


def quantity(name: str) -> Symbol:
    return Symbol(name, real=True)


def vanishes(difference: Any) -> bool:
    return bool(powsimp(expand(difference)) == 0 or cancel(difference) == 0)


def wired(name: str, *parts: tuple[Any, ...]) -> sw.Network:
    net = sw.Network(name)
    for part, *nodes in parts:
        net.add(part, *nodes)
    return net


def driven(*parts: tuple[Any, ...]) -> sw.Network:
    """A part or more at the node of an inertia with a load behind a spring."""
    rest = (
        (sw.Inertia("J1", J=1.0), "a"),
        (sw.Spring("s", c=100.0, d=1.0), "a", "b"),
        (sw.Inertia("J2", J=2.0), "b"),
        (sw.FanLoad("fan", tau_n=5.0, n_n=1450), "b"),
    )
    return wired("driven", *parts, *rest)


def closed_gears(third: float) -> sw.Network:
    gears = (
        (sw.Gear("g1", ratio=1.2), "a", "b"),
        (sw.Gear("g2", ratio=1.5), "b", "c"),
        (sw.Gear("g3", ratio=third), "a", "c"),
    )
    inertias = ((sw.Inertia(f"J{node}", J=1.0), node) for node in "abc")
    return wired("closed gears", *gears, *inertias, (sw.Spring("s", c=5.0, d=1.0), "c", "ground"))


def shaft_of(model: Any, **values: float) -> sw.Network:
    return sw.Network._of(shaft(model, **values).netlist())


MACHINE = {"U": 400.0, "f": 50.0, "L_m": 0.1, "L_s_sigma": 0.01, "L_r_sigma": 0.02, "R_r": 0.5, "R_s": 0.4}
BLDC = {"U": 540.0, "R": 0.5, "L": 9e-3, "k": 0.7, "pole_pairs": 2.0}
WHOLE: dict[str, Callable[[], sw.Network]] = {
    "direct-current drive": lambda: sw.Network._of(dc_drive().netlist()),
    "50 parts": lambda: sw.Network._of(mixed_train().netlist()),
    "induction machine": lambda: driven((sw.InductionMachine("M", **MACHINE, pole_pairs=2.0), "a")),
    "mean of a BLDC motor": lambda: driven((sw.AveragedBLDC("M", **BLDC), "a")),
    "speed controller": lambda: driven((sw.SpeedController("M", omega_ref=sw.Ramp(0, 1, 0, 9), k_p=2.0, t_i=0.5), "a")),
    "limited controller": lambda: driven((sw.SpeedController("M", omega_ref=9.0, k_p=2.0, t_i=0.5, tau_max=8.0), "a")),
    "gears in a closed loop": lambda: closed_gears(1.8),
    "gears that hold each other": lambda: closed_gears(2.0),
    "step of speed behind a gear": lambda: driven(
        (sw.SpeedSource("w", omega=sw.Step(3.0, 0.5)), "d"), (sw.Gear("g", ratio=-2.0), "d", "a")
    ),
    "speed between two nodes": lambda: driven(
        (sw.SpeedSource("w", omega=4.0), "a", "d"), (sw.Inertia("J", J=1.0), "d")
    ),
    "nothing free": lambda: wired(
        "turned", (sw.Inertia("J", J=1.0), "a"), (sw.SpeedSource("w", omega=sympy.sin(sw.t)), "a")
    ),
    "wave": lambda: shaft_of(sw.Wave()),
    "wave with losses": lambda: shaft_of(sw.Wave(), friction=0.1),
    "lumped": lambda: shaft_of(sw.Lumped(20), damping=0.1),
    "central differences": lambda: shaft_of(sw.CentralDifference(12, order=4), damping=0.1, friction=0.1),
    "spectral": lambda: shaft_of(sw.Spectral(8), damping=0.1, friction=0.1),
}
"""Networks with circuits, controlled sources, losses and long shafts."""


@pytest.mark.parametrize("name", MECHANICAL)
def test_lagranges_equations_are_kirchhoffs(name: str) -> None:
    proof = of(name).proof()
    assert proof.holds, str(proof)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::shaftwork.core.errors.NetworkWarning")  # of impulses and of gears that lock
@pytest.mark.parametrize("name", WHOLE)
def test_so_they_are_with_circuits_controllers_and_long_shafts(name: str) -> None:
    proof = WHOLE[name]().lagrangian().proof()
    assert proof.holds, str(proof)


@pytest.mark.slow
@pytest.mark.parametrize("name", sw.scenes.SCENES)
def test_so_they_are_in_every_phase_of_every_scene(name: str) -> None:
    scene = sw.scenes.SCENES[name]
    for phase in scene.phases or (None,):
        proof = scene().lagrangian(phase=phase).proof()
        assert proof.holds, str(proof)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::shaftwork.core.errors.NetworkWarning")
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name == "BLDCMotor" else ()) for name in registered()]
)
def test_so_they_are_with_every_component_in_every_mode(name: str) -> None:
    net = bed_of(name)
    (subject,) = (part for part in net.graph().parts if part.name == "subject")
    chosen = [
        [f"subject.{modes.label}".rstrip(".") + f" {mode.name}" for mode in modes.options] for modes in subject.modes
    ]
    for phase in chain.from_iterable(chosen) if chosen else (None,):
        made = net.lagrangian(phase=phase)
        assert made.proof().holds, str(made.proof())
    assert made.latex(values=True)


@pytest.mark.slow
@pytest.mark.parametrize("legs", [("high", "low", "open"), ("open", "high", "low"), ("open", "open", "open")])
def test_so_they_are_for_every_way_a_bldc_motor_is_fed(legs: tuple[str, ...]) -> None:
    """The voltage of each leg is prescribed, and each flux linkage has a letter of its own."""
    net = driven((sw.BLDCMotor("M", **BLDC), "a"))
    made = net.lagrangian(phase=", ".join(f"M.{leg} {mode}" for leg, mode in zip("abc", legs, strict=True)))
    assert made.proof().holds, str(made.proof())
    assert len(made.prescribed) == sum(mode != "open" for mode in legs) + (legs == ("open",) * 3)


@pytest.mark.parametrize("mode", ["driving forward", "driven forward", "driven backward", "stuck"])
def test_a_gear_with_losses_is_a_constraint_whose_reaction_does_work(mode: str) -> None:
    net = driven((sw.TorqueSource("M", tau=9.0), "m"), (sw.LossyGear("g", ratio=3.0, efficiency=0.9), "m", "a"))
    net.add(sw.Inertia("J0", J=0.1), "m")
    made = net.lagrangian(phase=f"g {mode}")
    assert made.proof().holds, str(made.proof())
    assert len(made.constraints) == (mode != "stuck")


@pytest.mark.slow
@share_of_examples(0.5)
@given(pieces=networks(max_inertias=6))
def test_they_are_kirchhoffs_for_random_networks(pieces: Network) -> None:
    proof = lagrangian(equations_of(from_pieces(pieces))).proof()
    assert proof.holds, str(proof)


PRESCRIBED = {
    "number": 3.0,
    "time": 2.0 * sw.t,
    "sine": 1.0 + 0.2 * sympy.sin(30.0 * sw.t),
    "step": sw.Step(5.0, 0.1),
    "ramp": sw.Ramp(5.0, 0.3, 0.1),
    "table": sw.Table([0.0, 0.2, 0.5], [0.0, 4.0, 3.0]),
    "table of a sine": sw.Table([-1.0, 0.0, 1.0], [0.0, 4.0, 3.0])(sympy.sin(sw.t)),
    "largest": sympy.Max(1.0, 3.0 * sw.t),
    "least": sympy.Min(sw.Ramp(2.0, 1.0), sympy.Abs(sw.t - 0.5)),
    "pieces": sympy.Piecewise((sw.t, sw.t < 1.0), (1.0 / (1.0 + sw.t), True)),
    "root": sympy.sqrt(1.0 + sw.t),
    "noise": sw.SmoothNoise(10.0 * sw.t, 3),
    "product": sw.Step(2.0, 0.1) * sympy.exp(-sw.t),
}


@pytest.mark.slow
@pytest.mark.parametrize("law", PRESCRIBED)
@pytest.mark.parametrize(("driven", "heavy"), [("sun", "carrier"), ("carrier", "ring"), ("ring", "sun")])
def test_they_are_kirchhoffs_beside_a_prescribed_speed_of_any_law(law: str, driven: str, heavy: str) -> None:
    """The speed enters the coordinates through the planetary gear, so its law stands in sums that must cancel."""
    net = wired(
        "planetary",
        (sw.SpeedSource("drive", omega=PRESCRIBED[law]), driven),
        (sw.PlanetaryGear("planetary", ratio=3.0), "sun", "carrier", "ring"),
        (sw.Inertia("J1", J=0.1), heavy),
        *((sw.Damper(f"bearing of {port}", d=2.0), port) for port in ("sun", "carrier", "ring")),
        (sw.Spring("s", c=100.0, d=1.0), "carrier", "load"),
        (sw.Inertia("J2", J=0.2), "load"),
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.NetworkWarning)  # a step drives an inertia by an impulse
        proof = net.lagrangian().proof()
    assert proof.holds, str(proof)


@pytest.mark.slow
@share_of_examples(0.2)
@given(pieces=networks(max_inertias=5), data=st.data())
def test_they_are_kirchhoffs_for_random_networks_with_speeds_of_any_law(pieces: Network, data: st.DataObject) -> None:
    laws = st.sampled_from(list(PRESCRIBED))
    pieces = (*pieces, *data.draw(inner_drives(pieces)))
    sources = {p.name: PRESCRIBED[data.draw(laws)] for p in pieces if p.type in ("SpeedSource", "VoltageSource")}
    made = [
        dataclasses.replace(p, values=dict.fromkeys(p.values, sources[p.name])) if p.name in sources else p
        for p in pieces
    ]
    proof = lagrangian(equations_of(from_pieces(made))).proof()
    assert proof.holds, str(proof)


@pytest.mark.filterwarnings("ignore::shaftwork.core.errors.NetworkWarning")
@share_of_examples(0.2)
@given(train=trains(most=5), data=st.data())
def test_they_are_kirchhoffs_in_any_phase_of_random_trains(train: Train, data: st.DataObject) -> None:
    net = wired("train", *((getattr(sw, part.type)(part.name, **part.values), *part.nodes) for part in train.parts))
    changing = [(part.name, modes.options) for part in net.graph().parts for modes in part.modes]
    chosen = ", ".join(f"{name} {data.draw(st.sampled_from(options)).name}" for name, options in changing)
    proof = net.lagrangian(phase=chosen).proof()
    assert proof.holds, str(proof)


@pytest.mark.parametrize("name", MECHANICAL)
def test_lagranges_equations_are_the_second_order_form(name: str) -> None:
    assert_second_order(of(name), {})


@pytest.mark.slow
@share_of_examples(0.2)
@given(pieces=networks(max_inertias=6, electrical=False))
def test_lagranges_equations_are_the_second_order_form_of_random_networks(pieces: Network) -> None:
    """Symbol by symbol, but for ratios whose values the structure rests on: 2 and 1/2 in a row twist no spring."""
    made = lagrangian(equations_of(from_pieces(pieces)))
    graph = made.kirchhoff.form.graph
    meeting = {quantity(name): Rational(str(graph.parameters[name])) for name in normal_tree(graph).frozen}
    assert_second_order(made, meeting)


def assert_second_order(made: Lagrangian, values: dict[Symbol, Rational]) -> None:
    form = second_order(made.kirchhoff.form.graph)
    assert form.coordinates == made.coordinates
    for row, equation in enumerate(made.equations):
        motion = equation.expression.xreplace(dict(made.laws))
        assert vanishes((form.residual(row) + motion).subs(values)), equation.coordinate


@pytest.mark.parametrize("name", ["crane", "planetary hoist", "prescribed speed behind gears", "lifted mass"])
def test_the_rows_are_what_differentiating_the_energies_gives(name: str) -> None:
    """d/dt(dL/dq') - dL/dq + dR/dq' - Q with sympy's own derivatives of the whole expressions."""
    made = of(name)
    moving = {q: rate_of(q) for q in (*made.coordinates, *made.velocities)} | dict(made.prescribed)
    for row, velocity in zip(made.equations, made.velocities, strict=True):
        momentum = made.lagrangian.diff(velocity)
        rate = momentum.diff(sw.t) + sum(momentum.diff(symbol) * speed for symbol, speed in moving.items())
        left = rate - made.lagrangian.diff(row.coordinate) + made.dissipation.diff(velocity) - row.force
        assert vanishes(left + row.expression)


def test_another_networks_equations_are_told_from_the_right_ones() -> None:
    """Kirchhoff's equations of the crane with a brake at its wheel: one balance differs, by the torque of the brake."""
    crane = MECHANICAL["crane"]
    braked = crane()
    braked.add(sw.TorqueSource("brake", tau=-3.0), "wheel")
    proof = dataclasses.replace(lagrangian(equations_of(crane())), kirchhoff=equations_of(braked)).proof()
    assert not proof.holds
    assert {row.of: row.difference for row in proof.rows if row.difference != 0} == {"J2.phi": quantity("brake.tau")}
    assert "are NOT Kirchhoff's" in str(proof)
    assert "J2.phi  difference brake.tau  from wheel" in str(proof)


def test_a_motion_that_does_not_belong_to_the_couplings_is_found() -> None:
    """The equations of a hoist with another ratio of its gear."""
    made = of("planetary hoist")
    one, two = quantity("planetary.ratio"), quantity("g2.ratio")
    motion = {symbol: found.xreplace({one: 2 * two}) for symbol, found in made.motion.items()}
    rows = dataclasses.replace(made, motion=motion).proof().rows
    assert {row.kind for row in rows if row.difference != 0} >= {"motion", "coupling"}


def test_an_equation_of_motion_less_is_found() -> None:
    made = of("crane")
    proof = dataclasses.replace(made, equations=made.equations[:1]).proof()
    assert all(row.difference == 0 for row in proof.rows)
    assert not proof.holds


def test_gears_in_a_closed_loop_hold_for_every_ratio_that_closes_it() -> None:
    """1.2 * 1.5 = 1.8 is typed in decimals; the proof is for all ratios."""
    proof = closed_gears(1.8).lagrangian().proof()
    first, second, third = (quantity(f"g{k}.ratio") for k in (1, 2, 3))
    assert dict(proof.given) == {third: first * second}
    assert "given that g3.ratio = g1.ratio*g2.ratio" in str(proof)
    assert [str(symbol) for symbol in proof.reactions] == ["g1.tau", "g2.tau"]


def test_a_third_by_a_decimal_fraction_closes_a_loop_of_gears() -> None:
    net = closed_gears(1.8)
    net.add(sw.Gear("back", ratio=1 / 1.8), "c", "a")
    assert net.lagrangian().proof().holds


def test_every_row_knows_its_parts_branches_nodes_and_force() -> None:
    made = of("geared inertias")
    (row,) = made.equations
    assert (row.parts, row.nodes, row.node) == (("J1", "J2", "motor", "d"), ("a", "b"), "a")
    assert row.displacements == {"a": 1, "b": 1 / quantity("g.ratio")}
    assert row.force == made.forces[0] == quantity("motor.tau")
    assert row.branches == tuple(k for k, made in enumerate(made.kirchhoff.form.graph.branches) if not made.terms)


def test_a_gap_in_contact_stores_potential_energy() -> None:
    net = wired(
        "gap",
        (sw.Inertia("J1", J=1.0), "a"),
        (sw.Backlash("gap", gap=0.1, c=100.0, d=1.0), "a", "b"),
        (sw.Inertia("J2", J=1.0), "b"),
        (sw.TorqueSource("T", tau=1.0), "a"),
    )
    twist = quantity("J1.phi") - quantity("J2.phi")
    closed = net.lagrangian(phase="gap in contact")
    assert vanishes(closed.potential - quantity("gap.c") * (twist - quantity("gap.gap") / 2) ** 2 / 2)
    assert closed.phase == "gap in contact"
    assert net.lagrangian().potential == 0


def test_the_lagrangian_of_the_crane_is_its_kinetic_less_its_potential_energy() -> None:
    energies = of("crane")
    J1, J2, c, d = (quantity(name) for name in ("J1.J", "J2.J", "shaft.c", "shaft.d"))
    phi1, phi2 = energies.coordinates
    w1, w2 = energies.velocities
    assert expand(energies.lagrangian - (J1 * w1**2 + J2 * w2**2 - c * (phi1 - phi2) ** 2) / 2) == 0
    assert expand(energies.dissipation - d * (w1 - w2) ** 2 / 2) == 0


def test_the_coordinate_of_a_circuit_is_flux_linkage() -> None:
    """A capacitor's energy is kinetic, a coil's potential; the machine ties flux to angle by its constant."""
    made = WHOLE["direct-current drive"]().lagrangian()
    L, k, angle = quantity("M.L"), quantity("M.k"), quantity("J.phi")
    flux = quantity("psi(M.resistor)")
    assert made.coordinates == (angle, flux)
    assert vanishes(made.potential - (flux - k * angle) ** 2 / (2 * L))
    resonant = wired("resonant", (sw.Capacitor("C", C=1e-3), "p", "ground"), (sw.Inductor("L", L=1e-2), "p", "ground"))
    resonant.add(sw.CurrentSource("i", i=1.0), "p", "ground")
    made = resonant.lagrangian()
    assert made.kinetic == quantity("C.C") * quantity("der(C.psi)") ** 2 / 2
    assert made.potential == quantity("C.psi") ** 2 / (2 * quantity("L.L"))
    assert made.proof().holds


def masses(*inertias: str, ratio: float | None = None) -> sw.Network:
    """The schemes of Abdelkader 2016: a motor at the first mass, a resistance at every mass, springs between them."""
    net = sw.Network("scheme")
    net.add(sw.TorqueSource("T", tau=50.0, symbol=""), inertias[0])
    for k, node in enumerate(inertias, 1):
        net.add(sw.Inertia(f"J{k}", J=float(k)), node)
        net.add(sw.TorqueSource(f"r{k}", tau=-1.0 * k, symbol=f"r{k}"), node)
        if k > 1 and node != inertias[k - 2]:
            net.add(sw.Spring(f"h{k - 1}{k}", c=1e3), inertias[k - 2], node)
    if ratio is not None:
        net.add(sw.Gear("g", ratio=ratio), *inertias)
    return net


ABDELKADER = (
    r"\mathcal{L} &= E_k - E_p",  # (19)
    r"Q_{1} &= \tau + \tau_{r1}",  # (21)
    r"Q_{2} &= \tau_{r2}",  # (22)
    r"Q_{3} &= \tau_{r3}",
    r"E_k &= \frac{J_{1} \, \dot{\varphi}_{1}^{2}}{2} + \frac{J_{2} \, \dot{\varphi}_{2}^{2}}{2} "
    r"+ \frac{J_{3} \, \dot{\varphi}_{3}^{2}}{2}",  # (23)
    r"E_p &= \frac{c_{12} \, \left(\varphi_{1} - \varphi_{2}\right)^{2}}{2} "
    r"+ \frac{c_{23} \, \left(\varphi_{2} - \varphi_{3}\right)^{2}}{2}",  # (24)
    r"J_{1} \, \ddot{\varphi}_{1} &= \tau + \tau_{r1} - c_{12} \left( \varphi_{1} - \varphi_{2} \right)",  # (25)
    r"J_{2} \, \ddot{\varphi}_{2} &= \tau_{r2} + c_{12} \left( \varphi_{1} - \varphi_{2} \right) "
    r"- c_{23} \left( \varphi_{2} - \varphi_{3} \right)",
    r"J_{3} \, \ddot{\varphi}_{3} &= \tau_{r3} + c_{23} \left( \varphi_{2} - \varphi_{3} \right)",
)


def test_three_masses_print_abdelkader_21_to_25() -> None:
    """His resistances T_r count against the motion, here every torque of a source counts with it."""
    lines = masses("a", "b", "c").lagrangian().latex().splitlines()
    assert [line for line in ABDELKADER if line not in {found.removesuffix(r" \\") for found in lines}] == []
    numbers = masses("a", "b", "c").lagrangian().latex(values=True)
    assert r"3 \, \ddot{\varphi}_{3} &= - 3 + 1000 \left( \varphi_{2} - \varphi_{3} \right)" in numbers


@pytest.mark.parametrize("count", [2, 3])
def test_the_schemes_with_springs_are_abdelkader_25_and_29(count: int) -> None:
    """Of (29) the second row is J2 dw2/dt, not J1 as it is printed."""
    made = masses(*"abc"[:count]).lagrangian()
    T, resist = quantity("T.tau"), [-quantity(f"r{k}.tau") for k in range(1, count + 1)]
    angles = [quantity(f"J{k}.phi") for k in range(1, count + 1)]
    springs = [quantity(f"h{k}{k + 1}.c") * (angles[k - 1] - angles[k]) for k in range(1, count)]
    for k, row in enumerate(made.equations):
        before, after = springs[k - 1] if k else T, springs[k] if k < count - 1 else 0
        acceleration = quantity(f"der(der(J{k + 1}.phi))")
        assert row.left == quantity(f"J{k + 1}.J") * acceleration
        assert expand(row.right - (before - after - resist[k])) == 0
        assert row.force == (0 if k else T) - resist[k]  # (21), (22), (27), (28)


def test_the_scheme_with_one_mass_is_abdelkader_31() -> None:
    (row,) = masses("a", "a").lagrangian().equations
    J1, J2, T, r1, r2 = (quantity(name) for name in ("J1.J", "J2.J", "T.tau", "r1.tau", "r2.tau"))
    assert expand(row.left - (J1 + J2) * quantity("der(der(J1.phi))")) == 0
    assert expand(row.right - (T + r1 + r2)) == 0


def test_a_rigid_train_has_the_inertia_and_torque_of_abdelkader_16_and_17() -> None:
    net = masses("a", "b", ratio=3.0)
    rigid = wired("rigid", *((item.part, *item.nodes) for item in net.netlist().placed if item.part.name != "h12"))
    rigid.add(sw.Drum("drum", radius=0.1), "b", "rope")
    rigid.add(sw.Mass("m", m=20.0), "rope")
    rigid.add(sw.ForceSource("F", f=-9.81 * 20.0), "rope")
    (row,) = rigid.lagrangian().equations
    i, rho = quantity("g.ratio"), quantity("drum.radius") / quantity("g.ratio")
    inertia = quantity("J1.J") + quantity("J2.J") / i**2 + quantity("m.m") * rho**2
    torque = quantity("T.tau") + quantity("r1.tau") + quantity("r2.tau") / i + quantity("F.f") * rho
    assert vanishes(row.left - inertia * quantity("der(der(J1.phi))"))
    assert vanishes(row.force - torque)


def test_shafts_are_written_out_where_that_is_asked_for() -> None:
    net = shaft_of(sw.Lumped(3))
    made = net.lagrangian(expand=True)
    assert [str(q) for q in made.coordinates] == [str(q) for q in net.expanded().lagrangian().coordinates]
    assert made.proof().holds


def test_what_cannot_be_assembled_or_named_is_refused() -> None:
    with pytest.raises(sw.NetworkError, match="has no parts"):
        sw.Network("empty").lagrangian()
    with pytest.raises(sw.ParameterError, match="There is no phase 'load gone'"):
        sw.scenes.crane_start().lagrangian(phase="load gone")


def test_loops_and_laws_are_compared_as_they_stand() -> None:
    proof = of(next(iter(MECHANICAL))).proof()
    compared = [row for row in proof.rows if row.kind != "motion"]
    assert compared
    assert all(row.factors == (1,) for row in compared)
