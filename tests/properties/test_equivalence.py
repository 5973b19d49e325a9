"""Two ways to the same thing: symbolic rows and arrays, new parameters and a new network, many parts and one part."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, ClassVar

import numba
import numpy as np
import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

import shaftwork as sw
from shaftwork.components import REGISTRY
from tests.properties.examples import assert_equal_signals, compiled, inner_drives, network_of, share_of_examples
from tests.reference.mna import SOURCE_VALUE, Piece
from tests.strategies import Network, networks

TIMES = np.linspace(0.0, 0.5, 6)
SEEDS = st.integers(0, 2**32 - 1)
CURVE = sw.Table([-50.0, -3.0, 0.0, 4.0, 60.0], [9.0, 5.0, 4.0, -2.0, -7.0])
LAWS: tuple[Callable[[str], sw.Component], ...] = (
    lambda name: sw.KlossMotor(name, tau_k=9.6, s_k=0.25, n_sync=30.0, ratio=2.5, efficiency=0.95),
    lambda name: sw.CoulombLoad(name, tau=22.4, omega_s=0.5),
    lambda name: sw.TorqueSource(name, tau=-3.0 * sw.omega * sympy.Abs(sw.omega) + sympy.sin(4 * sw.t)),
    lambda name: sw.TorqueSource(name, tau=-20.0 * sympy.sin(sw.phi) + 5.0 * sympy.cos(2 * sw.t)),
    lambda name: sw.TorqueSource(name, tau=CURVE(sw.omega) + sw.Table([0.0, 0.7, 2.0], [0.0, 3.0, 1.0])(sw.t)),
    lambda name: sw.TorqueSource(name, tau=sw.Step(8.0, 0.3) * sympy.exp(-sw.t) + sympy.Max(sw.omega, -1.0) ** 2),
    lambda name: sw.ViscousLoad(name, d=0.3),
)


def _swinging(piece: Piece) -> Piece:
    """A source whose value swings."""
    if (key := SOURCE_VALUE.get(piece.type)) is None:
        return piece
    return Piece(piece.type, piece.name, piece.nodes, {key: piece.values[key] * sympy.sin(3 * sw.t + 1)})


@st.composite
def nonlinear_networks(draw: st.DrawFn, max_inertias: int = 8) -> sw.Network:
    """A random network whose sources swing, with motors, loads and laws of speed, angle and time on some inertias."""
    pieces = draw(networks(max_inertias=max_inertias))
    pieces = (*pieces, *draw(inner_drives(pieces)))
    net = network_of(_swinging(piece) for piece in pieces)
    rotors = [piece.nodes[0] for piece in pieces if piece.type == "Inertia"]
    for number, kind in enumerate(draw(st.lists(st.sampled_from(range(len(LAWS))), min_size=1, max_size=4))):
        net.add(LAWS[kind](f"law{number}"), rotors[draw(st.integers(0, 63)) % len(rotors)])
    return net


def _random_state(model: sw.Model, seed: int) -> tuple[float, Any]:
    """A time and a state: speeds, torques and currents of some units each, at no round number where a table bends."""
    dice = np.random.default_rng(seed)
    return float(dice.uniform(0.0, 2.0)), dice.normal(scale=3.0, size=len(model.states))


@pytest.mark.slow
@share_of_examples(0.2)
@given(nonlinear_networks(), SEEDS)
def test_symbolic_rows_equal_the_array_program(net: sw.Network, seed: int) -> None:
    """Tolerance 1e-9 of the largest term: a rate is a difference of torques over an inertia."""
    model = compiled(net)
    time, x = _random_state(model, seed)
    if model.rows is None:
        return
    bound = model.bind()
    terms = np.abs(model.jacobian(time, x).toarray()) @ np.abs(x) + np.abs(bound.rhs(time, np.zeros(len(x))))
    error = np.abs(model.rhs(time, x) - bound.rhs(time, x))
    assert (error <= 1e-9 * (terms + 1e-12 * terms.max(initial=0.0))).all()


@pytest.mark.slow
@share_of_examples(0.1)
@given(nonlinear_networks(), SEEDS)
def test_machine_code_equals_the_right_hand_side(net: sw.Network, seed: int) -> None:
    """Tolerance 1e-13 of the largest term: the same operations, in another order."""
    model = compiled(net)
    (time, x), program = _random_state(model, seed), model.machine_program
    if program is None:
        return
    call = numba.njit(lambda rates, t, x, p, dx: rates(t, x, p, dx))
    rates, right = np.empty_like(x), model.rhs(time, x)
    code, *_, p = program.bind(model.defaults)
    call(code, time, x, p, rates)
    terms = np.abs(model.jacobian(time, x).toarray()) @ np.abs(x) + np.abs(model.rhs(time, 0 * x))
    assert (np.abs(rates - right) <= 1e-13 * (terms + np.abs(right) + 1e-12 * terms.max(initial=0.0))).all()


@share_of_examples(0.2)
@given(nonlinear_networks(), SEEDS)
def test_the_jacobian_is_the_derivative_of_the_right_hand_side(net: sw.Network, seed: int) -> None:
    """Central differences with a step of 1e-5: curvature and cancellation leave 1e-6 of the row's largest slope."""
    model = compiled(net)
    time, x = _random_state(model, seed)
    jacobian, h = model.jacobian(time, x).toarray(), 1e-5
    for k in range(len(x)):
        step = h * np.eye(len(x))[k]
        difference = (model.rhs(time, x + step) - model.rhs(time, x - step)) / (2 * h)
        size = np.abs(jacobian).max(axis=1) + np.abs(model.rhs(time, x)) + 1.0
        assert (np.abs(jacobian[:, k] - difference) <= 1e-6 * size).all(), model.states[k]


def _outcome(run: Callable[[], sw.Solution]) -> dict[str, Any] | type[sw.ShaftworkError]:
    """Node speeds, torques and so on of a run, or the class of the error that refuses it."""
    try:
        sol = run()
    except sw.ShaftworkError as error:
        return type(error)
    return {name: sol[name] for name in sol if name.count(".") == 1 and not name.endswith("power")}


@share_of_examples(0.2)
@pytest.mark.filterwarnings("ignore::shaftwork.NetworkWarning")
@given(networks(max_inertias=8), st.integers(0, 10**6), st.sampled_from([0.0, 0.0, 0.37, 2.0, 1.5, 80.0]))
def test_a_new_parameter_value_equals_a_network_built_with_it(pieces: Network, place: int, value: float) -> None:
    """Also values that become zero, or were zero, or decide whether gears lock. Tolerance 1e-9: another tree may serve.

    Torques inside a redundant or locked group of gears are left out: only their sum is determined.
    """
    places = [
        (piece, key)
        for piece in pieces
        for key, declared in REGISTRY[piece.type].declared.items()
        if not declared.law and declared.objection(value) is None
    ]
    if not places:
        return
    piece, key = places[place % len(places)]
    rebuilt = tuple(Piece(p.type, p.name, p.nodes, {**p.values, key: value}) if p is piece else p for p in pieces)
    model = compiled(pieces)
    options: dict[str, Any] = {"t_eval": TIMES, "engine": "exact"}
    changed = _outcome(lambda: model.simulate(TIMES[-1], parameters={f"{piece.name}.{key}": value}, **options))
    built = _outcome(lambda: compiled(rebuilt).simulate(TIMES[-1], **options))
    if isinstance(built, type) or isinstance(changed, type):
        assert changed == built
        return
    form = compiled(rebuilt).form
    couplings = {p.name for p in pieces if REGISTRY[p.type].role == "coupling"}
    if form.tree.redundant or model.form.tree.redundant:
        built = {name: found for name, found in built.items() if name.partition(".")[0] not in couplings}
    assert_equal_signals(changed, built, 1e-9)


def _chain(*between: tuple[sw.Component, tuple[str, ...]], tau: Any = 5.0) -> sw.Network:
    """A motor and an inertia at node a, an inertia at node b, and what is between."""
    net = sw.Network("chain")
    net.add(sw.TorqueSource("motor", tau=tau), "a")
    net.add(sw.Inertia("J1", J=2.0), "a")
    for part, nodes in between:
        net.add(part, *nodes)
    net.add(sw.Inertia("J2", J=3.0), "b")
    return net


def _speeds(net: sw.Network, **options: Any) -> dict[str, Any]:
    sol = net.simulate(TIMES[-1], t_eval=TIMES, **options)
    return {name: sol[name] for name in ("J1.omega", "J2.omega", "J1.tau", "J2.tau")}


@pytest.mark.parametrize("stiffnesses", [(100.0, 300.0), (100.0, 300.0, 50.0, 70.0)])
def test_springs_in_series_equal_one_spring_of_their_common_stiffness(stiffnesses: tuple[float, ...]) -> None:
    nodes = ["a", *(f"s{k}" for k in range(1, len(stiffnesses))), "b"]
    series = [(sw.Spring(f"s{k}", c=c), (nodes[k], nodes[k + 1])) for k, c in enumerate(stiffnesses)]
    one = sw.Spring("s", c=1.0 / sum(1.0 / c for c in stiffnesses))
    assert len(_chain(*series).compile().states) == 3
    assert_equal_signals(_speeds(_chain(*series)), _speeds(_chain((one, ("a", "b")))), 1e-11)


def test_inertias_at_one_node_equal_their_sum() -> None:
    spring = (sw.Spring("s", c=100.0, d=0.5), ("a", "b"))
    several = _chain(spring)
    several.add(sw.Inertia("more", J=1.5), "b")
    several.add(sw.Inertia("still more", J=0.5), "b")
    one = _chain(spring)
    one.add(sw.Inertia("sum", J=2.0), "b")
    assert len(several.compile().states) == 3
    assert_equal_signals(_speeds(several), _speeds(one), 1e-11)


def test_an_ever_stiffer_shaft_tends_to_a_rigid_one() -> None:
    """The shaft's own oscillation falls with 1/sqrt(c): tau J2 / (J1 (J1 + J2) w), w^2 = c (1/J1 + 1/J2)."""
    rigid = _speeds(_chain((sw.Gear("joint", ratio=1.0), ("a", "b"))))
    errors = []
    for c in (1e4, 1e6, 1e8, 1e10):
        soft = _speeds(_chain((sw.Spring("s", c=c), ("a", "b"))))
        errors.append(np.abs(soft["J1.omega"] - rigid["J1.omega"]).max())
        assert errors[-1] <= 1.001 * 5.0 * 3.0 / (5.0 * 2.0) / np.sqrt(c * (1 / 2.0 + 1 / 3.0))
    assert errors[-1] < 1e-4 * np.abs(rigid["J1.omega"]).max()


@pytest.mark.filterwarnings("ignore::shaftwork.NetworkWarning")
def test_a_second_gear_of_the_same_ratio_changes_nothing() -> None:
    gear = (sw.Gear("gear", ratio=2.5), ("a", "b"))
    twin = (sw.Gear("twin", ratio=2.5), ("a", "b"))
    assert_equal_signals(_speeds(_chain(gear, twin)), _speeds(_chain(gear)), 1e-12)


@share_of_examples(0.1)
@given(networks(max_inertias=12))
def test_the_powers_of_all_parts_sum_to_zero_at_every_instant(pieces: Network) -> None:
    """Tellegen's theorem, with every power recovered by its own way from the states; 1e-9 of the largest power."""
    sol = compiled(pieces).simulate(TIMES[-1], t_eval=TIMES, engine="exact")
    powers = np.array([sol[f"{piece.name}.power"] for piece in pieces])
    assert np.abs(powers.sum(axis=0)).max() <= 1e-9 * np.abs(powers).max()


@share_of_examples(0.1)
@given(networks(max_inertias=6))
def test_stored_energy_is_what_was_supplied_less_what_was_lost(pieces: Network) -> None:
    """The states are exact; the work is integrated from them by quadrature, good to 1e-9 over 500 intervals."""
    assert compiled(pieces).simulate(0.2, engine="exact").energy_residual < 1e-8


@pytest.fixture
def fan() -> Iterator[type[sw.Component]]:
    """A component of a user: a fan with its rotor, whose drag grows with the square of the speed."""

    @sw.component
    class Fan(sw.Component):
        """Law: tau = J d(omega)/dt + k omega |omega|."""

        J: float = sw.parameter("kg*m^2", "moment of inertia", above=0)
        k: float = sw.parameter("N*m*s^2/rad^2", "drag", at_least=0, default=0.1)

        ports: ClassVar = (sw.Port("hub"),)

        def branches(self, p: Any) -> Any:
            yield sw.AcrossStore(p.J)
            yield sw.ThroughLaw(p.k * sw.ACROSS * sympy.Abs(sw.ACROSS))

    yield Fan
    del REGISTRY["Fan"]


def test_a_component_of_a_user_works_like_those_of_the_library(fan: Any, tmp_path: Path) -> None:
    """Terminal speed sqrt(tau / k), reached as tanh: omega = w tanh(t tau / (w J))."""
    assert REGISTRY["Fan"] is fan
    net = sw.Network("fan")
    net.add(sw.TorqueSource("motor", tau=2.0), "hub")
    net.add(fan("fan", J=0.5, k=0.125), "hub")
    net.save(tmp_path / "fan.toml")
    again = sw.Network.load(tmp_path / "fan.toml")
    assert again.netlist() == net.netlist()
    sol = again.simulate(1.0, rtol=1e-10)
    speed = 4.0 * np.tanh(sol.t * 2.0 / (4.0 * 0.5))
    np.testing.assert_allclose(sol["fan.omega"], speed, atol=1e-8)
    np.testing.assert_allclose(sol["fan.tau"], 2.0, rtol=1e-9)
    np.testing.assert_allclose(sol["fan.energy"], 0.25 * speed**2, atol=1e-8)
    assert sol.energy_residual < 1e-9
    assert again.compile().steady_state() == pytest.approx({"fan.omega": 4.0})
    other = again.simulate(1.0, t_eval=[1.0], rtol=1e-10, parameters={"fan.k": 0.0})
    assert other["fan.omega"][0] == pytest.approx(4.0, rel=1e-9)
    with pytest.raises(sw.ParameterError, match="above 0"):
        again.simulate(1.0, parameters={"fan.J": -1.0})
    with pytest.raises(sw.ParameterError, match="moment of inertia"):
        fan("fan")
