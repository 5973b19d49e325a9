"""The referee itself is judged here: closed forms, conservation, and its two routes against each other.

Tolerances: the exact route loses about 1e-13 on systems this small, so 1e-11 of the largest value leaves room for
another BLAS; IDA is asked for 1e-10 per step and keeps about 1e-7 over a run.
"""

from __future__ import annotations

from math import exp, pi, tanh

import numpy as np
import pytest
from hypothesis import assume, given

from tests.malformations import BREAKERS
from tests.properties.examples import share_of_examples
from tests.reference.chain import chain, equal_chain
from tests.reference.crane import Crane, kloss_slip, shaft_torque, taylor
from tests.reference.mna import (
    GROUND,
    SOURCE_VALUE,
    Piece,
    Response,
    constant,
    ramp,
    rest_jumps,
    rise,
    simulate,
    sine,
    spectrum,
    stored_energy,
)
from tests.reference.nonlinear import Law, simulate_nonlinear
from tests.reference.pencil import IllPosedError, spectral_distance
from tests.strategies import Network, build, networks

EXACT = 1e-11
T = np.linspace(0.0, 2.0, 41)


def part(kind: str, name: str, *nodes: str, **values: float) -> Piece:
    return Piece(kind, name, nodes, values)


def close(actual: np.ndarray, expected: np.ndarray, tolerance: float = EXACT) -> bool:
    return bool(np.abs(actual - expected).max() <= tolerance * max(1.0, np.abs(expected).max()))


TWO_MASSES = (
    part("Inertia", "J1", "a", J=2.0),
    part("Spring", "shaft", "a", "b", c=100.0),
    part("Inertia", "J2", "b", J=3.0),
    part("TorqueSource", "motor", "a", tau=5.0),
)


def test_two_masses_swing_at_their_natural_frequency() -> None:
    omega = np.sqrt(100.0 * (1 / 2 + 1 / 3))
    assert spectral_distance(spectrum(TWO_MASSES), np.array([0.0, 1j * omega, -1j * omega])) < EXACT
    r = simulate(TWO_MASSES, None, T)
    assert close(r.through["shaft.through"], 5.0 * 3 / 5 * (1 - np.cos(omega * T)))
    assert close(2 * r.across["a"] + 3 * r.across["b"], 5.0 * T)
    assert close(r.through["motor.through"], np.full_like(T, -5.0))


def test_geared_inertias_move_as_one_and_the_gear_carries_the_difference() -> None:
    net = (
        part("Inertia", "fast", "a", J=2.0),
        part("Gear", "gear", "a", "b", ratio=4.0),
        part("Inertia", "slow", "b", J=8.0),
        part("TorqueSource", "motor", "a", tau=5.0),
    )
    r = simulate(net, None, T)
    assert close(r.across["a"], 5.0 * T / (2.0 + 8.0 / 16.0))
    assert close(r.across["b"], r.across["a"] / 4.0)
    assert close(r.through["gear.through_a"], np.full_like(T, 5.0 - 2.0 * 2.0))
    assert close(r.through["gear.through_b"], -4.0 * r.through["gear.through_a"])


def test_the_torque_of_parallel_gears_is_undetermined_and_everything_else_is_not() -> None:
    single = (*TWO_MASSES, part("Gear", "g1", "b", "c", ratio=3.0), part("Inertia", "J3", "c", J=1.0))
    double = (*single, part("Gear", "g2", "b", "c", ratio=3.0))
    one, two = simulate(single, None, T), simulate(double, None, T)
    assert two.undetermined == ("g1.through_a", "g1.through_b", "g2.through_a", "g2.through_b")
    assert all(close(two.across[node], one.across[node]) for node in one.across)
    assert all(close(two.through[name], one.through[name]) for name in two.through)
    assert spectral_distance(spectrum(single), spectrum(double)) < EXACT


def test_an_underdamped_series_circuit_rings_as_its_closed_form() -> None:
    net = (
        part("VoltageSource", "u", "p", GROUND, u=10.0),
        part("Resistor", "R", "p", "q", R=2.0),
        part("Inductor", "L", "q", "s", L=0.5),
        part("Capacitor", "C", "s", GROUND, C=0.01),
    )
    sigma, wave = 2.0, np.sqrt(1 / (0.5 * 0.01) - 4.0)
    r = simulate(net, None, T)
    assert close(r.through["L.through"], 10.0 / (0.5 * wave) * np.exp(-sigma * T) * np.sin(wave * T))
    assert close(r.across["s"], 10 * (1 - np.exp(-sigma * T) * (np.cos(wave * T) + sigma / wave * np.sin(wave * T))))
    assert spectral_distance(spectrum(net), np.array([-sigma + 1j * wave, -sigma - 1j * wave])) < EXACT


def test_a_motor_without_a_coil_runs_up_exponentially() -> None:
    net = (
        part("VoltageSource", "u", "p", GROUND, u=12.0),
        part("DCMachine", "m", "p", GROUND, "rotor", k=0.5, R=2.0),
        part("Inertia", "J", "rotor", J=0.1),
    )
    rate = 0.5**2 / (2.0 * 0.1)
    r = simulate(net, None, T)
    assert close(r.across["rotor"], 24.0 * (1 - np.exp(-rate * T)))
    assert close(r.through["m.through_p"], 6.0 * np.exp(-rate * T))
    assert close(r.through["m.through_rotor"], -0.5 * r.through["m.through_p"])
    assert close(r.through["u.through"], -r.through["m.through_p"])


def test_a_current_source_raises_its_first_node() -> None:
    net = (part("CurrentSource", "i", "p", GROUND, i=3.0), part("Resistor", "R", "p", GROUND, R=2.0))
    r = simulate(net, None, T)
    assert close(r.across["p"], np.full_like(T, 6.0))
    assert close(r.through["i.through"], np.full_like(T, -3.0))


def test_a_planetary_gear_divides_torque_by_its_teeth() -> None:
    net = (
        part("Inertia", "Js", "sun", J=1.0),
        part("Inertia", "Jc", "carrier", J=2.0),
        part("Inertia", "Jr", "ring", J=3.0),
        part("PlanetaryGear", "p", "sun", "carrier", "ring", ratio=2.0),
        part("TorqueSource", "m", "sun", tau=5.0),
    )
    # Lagrange: J e' = tau - multiplier * (1, -3, 2), with (1, -3, 2) . e' = 0
    row, inertia = np.array([1.0, -3.0, 2.0]), np.array([1.0, 2.0, 3.0])
    multiplier = 5.0 / np.sum(row**2 / inertia)
    acceleration = (np.array([5.0, 0.0, 0.0]) - multiplier * row) / inertia
    r = simulate(net, None, T)
    assert all(close(r.across[n], a * T) for n, a in zip(("sun", "carrier", "ring"), acceleration, strict=True))
    assert close(r.through["p.through_carrier"], np.full_like(T, -3.0 * multiplier))


def test_a_drum_lifts_with_its_radius() -> None:
    net = (
        part("Inertia", "J", "a", J=1.0),
        part("Drum", "drum", "a", "x", radius=0.5),
        part("Mass", "m", "x", m=8.0),
        part("ForceSource", "weight", "x", f=-6.0),
    )
    r = simulate(net, None, T)
    assert close(r.across["a"], -0.5 * 6.0 * T / (1.0 + 8.0 * 0.25))
    assert close(r.across["x"], 0.5 * r.across["a"])


def test_a_prescribed_speed_accelerates_its_inertia() -> None:
    net = (part("SpeedSource", "drive", "a", omega=1.0), part("Inertia", "J", "a", J=2.0))
    for signal, speed, rate in (
        (ramp(3.0), 3.0 * T, np.full_like(T, 3.0)),
        (sine(2.0, 5.0), 2.0 * np.sin(5.0 * T), 10.0 * np.cos(5.0 * T)),
        (rise(2.0, 5.0), 2.0 * (1 - np.exp(-5.0 * T)), 10.0 * np.exp(-5.0 * T)),
        (constant(4.0), np.full_like(T, 4.0), np.zeros_like(T)),
    ):
        r = simulate(net, {"drive": signal}, T)
        assert close(r.across["a"], speed)
        assert close(r.through["J.through"], 2.0 * rate)


def test_a_torque_step_between_two_springs_splits_by_their_stiffness() -> None:
    net = (
        part("Inertia", "J1", "a", J=1.0),
        part("Spring", "s1", "a", "m", c=100.0),
        part("Spring", "s2", "m", "b", c=300.0),
        part("Inertia", "J2", "b", J=1.0),
        part("TorqueSource", "t", "m", tau=8.0),
    )
    r = simulate(net, None, [0.0])
    assert close(r.through["s1.through"], np.array([-2.0]))
    assert close(r.through["s2.through"], np.array([6.0]))
    assert rest_jumps(net) == ("s1", "s2")
    given_start = {"a.across": 0.0, "b.across": 0.0, "s1.store": 0.0}
    assert close(simulate(net, None, [0.0], x0=given_start).through["s2.through"], np.array([8.0]))


def test_a_start_that_leaves_a_state_open_is_refused() -> None:
    with pytest.raises(IllPosedError, match="does not fix the state"):
        simulate(TWO_MASSES, None, T, x0={"a.across": 1.0})


def test_an_initial_twist_swings_back() -> None:
    start = {"a.across": 0.0, "b.across": 0.0, "shaft.store": 7.0}
    r = simulate(TWO_MASSES, {"motor": 0.0}, T, x0=start)
    assert close(r.through["shaft.through"], 7.0 * np.cos(np.sqrt(100 * 5 / 6) * T))
    assert close(stored_energy(TWO_MASSES, r), np.full_like(T, 7.0**2 / 200.0))


@pytest.mark.parametrize(
    "kind",
    [
        "contradictory_speeds",
        "contradictory_speeds_through_a_gear",
        "speed_against_ground",
        "speed_against_a_locked_gear_loop",
        "contradictory_voltages",
        "torque_on_a_massless_node",
        "torque_on_a_massless_gear",
        "current_into_an_open_node",
        "shorted_voltage",
        "duplicate_name",
    ],
)
def test_contradictions_are_refused_not_solved(kind: str) -> None:
    with pytest.raises(IllPosedError):
        spectrum(BREAKERS[kind](TWO_MASSES, 0))


def test_a_locked_gear_loop_stands_still() -> None:
    r = simulate(BREAKERS["locked_gear_loop"](TWO_MASSES, 0), None, T)
    assert close(r.across["a"], np.zeros_like(T))


def test_ida_agrees_on_a_nonlinear_motor_with_the_hand_typed_crane() -> None:
    crane = Crane()
    slip_per_speed = crane.ratio / (2.0 * pi * crane.n_sync / 60.0)

    def motor(_: float, omega: float) -> float:
        slip = 1.0 - slip_per_speed * omega
        return 2.0 * crane.ratio * crane.efficiency * crane.tau_k * slip * crane.s_k / (slip**2 + crane.s_k**2)

    net = (
        part("Inertia", "J1", "a", J=crane.J1),
        part("Spring", "shaft", "a", "b", c=crane.c, d=crane.d),
        part("Inertia", "J2", "b", J=crane.J2),
        part("TorqueSource", "motor", "a", tau=0.0),
        part("TorqueSource", "load", "b", tau=0.0),
    )
    laws = {"motor": Law(motor), "load": Law(lambda _, omega: -crane.tau_w * tanh(omega / crane.omega_s))}
    times = np.linspace(0.0, 1.0, 21)
    assert close(simulate_nonlinear(net, laws, times).through["shaft.through"], shaft_torque(crane, times), 2e-7)


@pytest.mark.slow
def test_the_crane_reference_is_good_to_1e_12() -> None:
    times = [0.0, 0.01, 0.05, 0.1, 0.2]
    assert close(shaft_torque(Crane(), times), taylor(Crane(), times), 1e-12)


def test_the_chosen_pull_out_slip_passes_through_the_rated_point() -> None:
    s_k, s_n = kloss_slip(7.6), 1.0 - 2510.0 / 3000.0
    assert 2 * 7.6 / (s_n / s_k + s_k / s_n) == pytest.approx(3.8, rel=1e-14)
    assert s_k > s_n


def _wired_chain(J: list[float], c: list[float], beta: float, tau: float) -> Network:
    rotors = [part("Inertia", f"J{k}", f"n{k}", J=value) for k, value in enumerate(J)]
    springs = [part("Spring", f"s{k}", f"n{k}", f"n{k + 1}", c=value, d=beta * value) for k, value in enumerate(c)]
    return (*rotors, *springs, part("TorqueSource", "step", "n0", tau=tau))


@pytest.mark.parametrize("beta", [0.0, 1e-3, 1.0])
def test_the_chains_agree_with_the_referee_and_with_each_other(beta: float) -> None:
    rng = np.random.default_rng(5)
    J, c = rng.uniform(0.1, 1.0, 9).tolist(), rng.uniform(100.0, 1000.0, 8).tolist()
    pairs = (
        (chain(T, J=J, c=c, beta=beta, tau=2.0), _wired_chain(J, c, beta, 2.0)),
        (equal_chain(9, T, J=0.5, c=300.0, beta=beta, tau=2.0), _wired_chain([0.5] * 9, [300.0] * 8, beta, 2.0)),
    )
    for motion, net in pairs:
        r = simulate(net, None, T)
        # at beta = 1 s the exponential of the referee squares a matrix of norm 1e4 and loses as much more
        assert all(close(motion.omega[:, k], r.across[f"n{k}"], 20 * EXACT) for k in range(9))
        assert all(close(motion.tau[:, k], r.through[f"s{k}.through"], 20 * EXACT) for k in range(8))


def _power(net: Network, r: Response) -> np.ndarray:
    """Power that all nodes give to all parts, W; Tellegen says zero."""
    across = r.across
    total = np.zeros_like(r.t)
    for p in net:
        names = [n for n in r.through if n.startswith(f"{p.name}.through")]
        if len(names) == 1:
            second = across[p.nodes[1]] if len(p.nodes) == 2 else 0.0
            total += r.through[names[0]] * (across[p.nodes[0]] - second)
        else:
            total += sum(r.through[n] * across[node] for n, node in zip(names, p.nodes, strict=True))
    return total


@pytest.mark.slow
@share_of_examples(0.5)
@given(networks(max_inertias=12))
def test_random_networks_are_well_posed_passive_and_rest_unambiguously(net: Network) -> None:
    eigenvalues = spectrum(net)
    fastest = np.abs(eigenvalues).max()
    assert eigenvalues.real.max() <= 1e-6 * fastest  # a double zero is known to the root of the rounding error
    assert rest_jumps(net) == ()
    r = simulate(net, {p.name: 0.0 for p in net if p.type in SOURCE_VALUE}, [0.0, 1.0])
    assert all(np.abs(history).max() == 0.0 for history in r.across.values())


@share_of_examples(0.5)
@given(networks(max_inertias=8))
def test_powers_sum_to_zero_in_random_networks(net: Network) -> None:
    r = simulate(net, None, np.linspace(0.0, 0.5, 6))
    assume(not r.undetermined)  # the torques of a redundant gear are missing from the sum
    largest = max(np.abs(h).max() for h in r.through.values()) * max(np.abs(h).max() for h in r.across.values())
    assert np.abs(_power(net, r)).max() <= 1e-8 * max(1.0, largest)


@pytest.mark.slow
@share_of_examples(0.3)
@given(networks(max_inertias=8))
def test_ida_and_the_exponential_agree_on_random_networks(net: Network) -> None:
    times, rate = np.linspace(0.0, 0.2, 5), 15.0
    values = {p.name: p.values[SOURCE_VALUE[p.type]] for p in net if p.type in SOURCE_VALUE}

    def smooth(value: float) -> Law:
        return Law(lambda t, _: value * (1.0 - exp(-rate * t)), lambda t: value * rate * exp(-rate * t))

    laws = {name: smooth(value) for name, value in values.items()}
    exact = simulate(net, {name: rise(value, rate) for name, value in values.items()}, times)
    stepped = simulate_nonlinear(net, laws, times)
    for one, two in ((exact.across, stepped.across), (exact.through, stepped.through)):
        largest = max(np.abs(history).max() for history in one.values())
        assert max(np.abs(one[name] - two[name]).max() for name in one) <= 1e-7 * largest


def test_the_same_steps_build_the_same_network() -> None:
    assert build([]) == build([])
    assert len({p.name for p in build([])}) == len(build([]))
