"""Trains beside those of the other tests: a geared inline engine with propeller, and a V8 with generator.

The references are the matrices of openTorsion, a long simulation, and shafts without a mesh.
"""

from __future__ import annotations

import numpy as np
import opentorsion
import pytest
import sympy

import shaftwork as sw

ORDERS = tuple(k / 2 for k in range(1, 17))
RPM = np.pi / 30
PINION, WHEEL = 0.11, 0.32  # radii of the gear, m
RATIO = -WHEEL / PINION


def gas(scale: float = 1.0) -> sw.Harmonics:
    """Amplitudes that fall with the order, and phases without a pattern."""
    sizes = tuple(scale * 700.0 / (1 + order) ** 1.5 for order in ORDERS)
    return sw.Harmonics(ORDERS, sizes, tuple(2.4 * np.sin(3.1 * order) for order in ORDERS))


BLADES = sw.Harmonics((3.0, 6.0), (140.0, 35.0), (0.7, -1.9))
INERTIAS = (0.31, 0.28, 0.28, 0.33, 6.4, 0.22, 1.9, 21.0)
"""Four throws, flywheel, pinion, wheel and propeller, kg m2."""
SHAFTS = {(0, 1): (1.1e6, 9.0), (1, 2): (1.2e6, 7.0), (2, 3): (1.2e6, 8.0), (3, 4): (1.6e6, 12.0)} | {
    (4, 5): (6.0e4, 25.0),
    (6, 7): (3.2e5, 40.0),
}
"""From both ends of each to stiffness in N m/rad and damping in N m s."""
WATER = 130.0
"""Damping at the propeller, N m s."""


def geared(shaft: sw.Lumped | None = None) -> sw.Network:
    """Inline four, gear that turns back, propeller; with a model, the line to the propeller is a long shaft."""
    net = sw.Network("geared four")
    for k, angle in enumerate(sw.HarmonicTorque.firing_angles((1, 2, 4, 3))):
        net.add(sw.HarmonicTorque(f"cylinder {k + 1}", harmonics=gas(), firing_angle=angle), f"n{k}")
    for k, inertia in enumerate(INERTIAS):
        net.add(sw.Inertia(f"J{k}", J=inertia), f"n{k}")
    for (a, b), (c, d) in SHAFTS.items():
        if shaft is None or a != 6:
            net.add(sw.Spring(f"s{a}", c=c, d=d), f"n{a}", f"n{b}")
        else:
            net.add(sw.Shaft("line", length=6.0, diameter=0.125, damping=300.0, model=shaft), f"n{a}", f"n{b}")
    net.add(sw.Gear("gear", ratio=RATIO), "n5", "n6")
    net.add(sw.HarmonicTorque("blades", harmonics=BLADES), "n7")
    net.add(sw.Damper("water", d=WATER), "n7")
    return net


def genset() -> sw.Network:
    """V8 with two cylinders on each throw, flywheel, elastic coupling and generator."""
    net = sw.Network("V8 genset")
    angles = sw.HarmonicTorque.firing_angles((1, 5, 4, 2, 6, 3, 7, 8))
    for k, angle in enumerate(angles):
        net.add(sw.HarmonicTorque(f"cylinder {k + 1}", harmonics=gas(0.4), firing_angle=angle), f"throw {k // 2}")
    for k in range(4):
        net.add(sw.Inertia(f"throw {k}", J=0.12 + 0.01 * k), f"throw {k}")
        behind = f"throw {k + 1}" if k < 3 else "flywheel"
        net.add(sw.Spring(f"crank {k}", c=9e5 + 5e4 * k, d=60.0), f"throw {k}", behind)
    net.add(sw.Inertia("flywheel", J=2.6), "flywheel")
    net.add(sw.Spring("coupling", c=2.4e4, d=45.0), "flywheel", "rotor")
    net.add(sw.Inertia("rotor", J=5.5), "rotor")
    net.add(sw.Damper("load", d=30.0), "rotor")
    return net


def test_a_geared_engine_with_propeller_has_the_torques_of_opentorsion() -> None:
    calculation = sw.torsional_calculation(geared(), np.linspace(500, 2000, 16) * RPM)
    pinion = opentorsion.Gear(5, INERTIAS[5], PINION)
    wheel = opentorsion.Gear(6, INERTIAS[6], WHEEL, parent=pinion)
    discs = [opentorsion.Disk(k, J, c=WATER if k == 7 else 0.0) for k, J in enumerate(INERTIAS) if k not in (5, 6)]
    links = [opentorsion.Shaft(a, b, None, None, k=c, I=0.0, c=d) for (a, b), (c, d) in SHAFTS.items()]
    theirs = opentorsion.Assembly(links, disk_elements=discs, gear_elements=[pinion, wheel])
    joined = theirs.T(theirs.E())
    ours = {a: calculation.orders_of(f"s{a}.tau") for a, _ in SHAFTS}
    for number, speed in enumerate(calculation.speeds):
        torques = np.zeros((len(INERTIAS), len(calculation.orders)), dtype=complex)
        for k, angle in enumerate(sw.HarmonicTorque.firing_angles((1, 2, 4, 3))):
            for order, size, phase in zip(ORDERS, gas().amplitudes, gas().phases, strict=True):
                torques[k, _place(calculation.orders, order)] += size * np.exp(1j * (phase - order * angle))
        for order, size, phase in zip(BLADES.orders, BLADES.amplitudes, BLADES.phases, strict=True):
            # the propeller turns back: its harmonics run in reverse
            torques[7, _place(calculation.orders, order / abs(RATIO))] += size * np.exp(-1j * phase)
        omegas = speed * np.array(calculation.orders)
        angles, _ = theirs.ss_response(joined.T @ torques, omegas)
        for (a, b), (c, d) in SHAFTS.items():
            twist = (joined @ angles)[a] - (joined @ angles)[b]
            expected = (c + 1j * omegas * d) * twist
            assert (
                np.abs(ours[a][number] - expected).max() <= 1e-6 * np.abs(expected).max()
            )  # agrees to 1e-12 where measured


def _place(orders: tuple[float, ...], order: float) -> int:
    return int(np.abs(np.array(orders) - order).argmin())


@pytest.mark.slow
def test_a_generator_set_that_misfires_comes_in_a_long_simulation_to_the_sum_of_its_orders() -> None:
    speed, misfire = 1500 * RPM, "cylinder 3"
    calculation = sw.torsional_calculation(genset(), [0.9 * speed, speed], misfire=misfire)
    net = genset()
    for k, angle in enumerate(sw.HarmonicTorque.firing_angles((1, 5, 4, 2, 6, 3, 7, 8)), 1):
        scale = 0.0 if f"cylinder {k}" == misfire else 0.4
        net.replace(sw.TorqueSource(f"cylinder {k}", tau=gas(scale).torque(speed * sw.t - angle, sympy.Integer(0))))
    inertia = 5.5 + 2.6 + sum(0.12 + 0.01 * k for k in range(4))
    cycle = 4 * np.pi / speed
    cycles = round(18 * inertia / 30.0 / cycle)  # the slowest motion has decayed to e^-18, 1.5e-8
    angles, _ = calculation.waveform("coupling", speed)
    times = cycles * cycle + angles / speed
    motion = net.simulate(times[-1], t_eval=times, rtol=1e-11)
    for shaft in ("crank 0", "crank 3", "coupling"):
        torque = calculation.waveform(shaft, speed)[1]
        assert np.abs(motion[f"{shaft}.tau"] - torque).max() < 1e-6 * np.abs(torque).max()


@pytest.mark.slow
def test_behind_a_gear_meshes_converge_to_the_exact_shaft() -> None:
    n = np.linspace(500, 2000, 6) * RPM
    exact = sw.torsional_calculation(geared(sw.Lumped(4)), n, exact=True)
    errors = []
    for m in (8, 16):
        lumped = sw.torsional_calculation(geared(sw.Lumped(m)), n)
        ours, reference = (
            one.orders_of("line.tau_a")[[int(np.abs(one.speeds - speed).argmin()) for speed in n]]
            for one in (lumped, exact)
        )
        errors.append(float(np.abs(ours - reference).max() / np.abs(reference).max()))
    assert errors[1] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.3)  # cells are right to the square of their length


def planetary(held: str) -> sw.Network:
    """An engine, a planetary gear whose ring is held, and a propeller at the carrier."""
    net = sw.Network(f"planetary gear, {held}")
    net.add(sw.HarmonicTorque("engine", harmonics=sw.Harmonics((1.0, 2.0), (50.0, 20.0))), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Spring("quill", c=3e4, d=20.0), "a", "sun")
    net.add(sw.PlanetaryGear("gear", ratio=3.0), "sun", "carrier", "ground" if held == "frame" else "ring")
    if held == "speed":
        net.add(sw.SpeedSource("hold", omega=0.0), "ring")
    if held == "spring":
        net.add(sw.Spring("support", c=1e12), "ring", "ground")
    if held == "brake":
        net.add(sw.Brake("hold", tau=500.0), "ring")
    net.add(sw.Inertia("J2", J=2.0), "carrier")
    net.add(sw.HarmonicTorque("propeller", harmonics=sw.Harmonics((4.0,), (30.0,), (0.4,))), "carrier")
    net.add(sw.Damper("water", d=5.0), "carrier")
    return net


def test_behind_a_planetary_gear_whose_ring_is_held_orders_are_those_of_a_gear() -> None:
    plain = planetary("frame")
    plain.remove("gear")
    plain.add(sw.Gear("gear", ratio=4.0), "sun", "carrier")
    expected = sw.torsional_calculation(plain, [30.0, 60.0])
    for held, closeness in (("frame", 1e-12), ("speed", 1e-12), ("spring", 1e-6)):
        calculation = sw.torsional_calculation(planetary(held), [30.0, 60.0])
        assert calculation.orders == pytest.approx((1.0, 2.0))  # 4 behind a ratio of 4 is 1
        assert calculation["quill"].torques == pytest.approx(expected["quill"].torques, rel=closeness)


def test_a_ring_that_may_slip_leaves_the_speed_open_and_is_told() -> None:
    with pytest.raises(sw.ParameterError, match=r"does not follow from that of 'a'.*hold the third shaft"):
        sw.torsional_calculation(planetary("brake"), [30.0, 60.0])
