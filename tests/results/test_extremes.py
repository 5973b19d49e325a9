"""True extremes: against modal solutions that bracket them, at jumps, at the ends, along shafts, in every engine."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import shaftwork as sw
from tests.properties.examples import share_of_examples
from tests.reference.modal_extremes import Chain, Oscillations

RTOL = 1e-9
RIGHT = 1e-8
"""Of the extreme itself: the bar for a motion that is right to 1e-9 of its states."""
STEPPED = 1e-7
"""The same of an engine that follows a thousand swings step by step: their errors add up, to 1.5e-8 at worst seen."""
SMALL = 1e-4
"""Of the larger extreme of the pair: the other one is held to no less than this part of it, so to 1e-12 of the larger.

An extreme is a sum of modes in double precision, here and in the reference. Of a torque of 3e-6 N m that runs ahead of
a wave whose modes add up to 104 N m, 1e-13 N m is rounding; `Oscillations.rounding` is allowed on top.
"""


def random_chain(seed: int, most: int) -> tuple[Chain, float]:
    """A chain of up to so many rotors with a random damping, and the end of a motion of up to 1000 of its swings."""
    random = np.random.default_rng(seed)
    n = int(random.integers(2, most + 1))

    def spread(low: float, high: float, size: int) -> np.ndarray:
        return np.asarray(10.0 ** random.uniform(low, high, size))

    damped = random.choice([0.0, 0.2, 1.0])
    damping = np.where(random.random(n - 1) < damped, spread(-4.0, 0.5, n - 1), 0.0)
    to_frame = np.where(random.random(n) < 0.2, spread(-3.0, 0.0, n), 0.0)
    to_frame[0] = spread(-2.0, 0.0, 1)[0]
    torque = np.where(random.random(n) < 0.3, random.normal(size=n) * 20.0, 0.0)
    torque[-1] = 10.0
    speeds = np.where(random.random(n) < 0.3, random.normal(size=n) * 5.0, 0.0)
    chain = Chain(spread(-2.0, 0.5, n), spread(2.0, 4.5, n - 1), damping, to_frame, torque, speeds)
    fastest = float(np.sqrt(4.0 * chain.c.max() / chain.J.min()))
    return chain, float(2 * np.pi / fastest * 10.0 ** random.uniform(0.0, 3.0))


def network_of(chain: Chain) -> tuple[sw.Network, dict[str, float]]:
    """The chain as a user writes it, and its start values."""
    net = sw.Network("chain")
    for k, J in enumerate(chain.J.tolist()):
        net.add(sw.Inertia(f"J{k}", J=J), f"n{k}")
        if chain.torque[k]:
            net.add(sw.TorqueSource(f"push{k}", tau=float(chain.torque[k])), f"n{k}")
        if chain.b[k]:
            net.add(sw.Damper(f"bearing{k}", d=float(chain.b[k])), f"n{k}")
    for k, c in enumerate(chain.c.tolist()):
        net.add(sw.Spring(f"shaft{k}", c=c, d=float(chain.d[k])), f"n{k}", f"n{k + 1}")
    return net, {f"J{k}.omega": float(speed) for k, speed in enumerate(chain.speeds) if speed}


def check_extremes(seed: int, most: int, engine: str, right: float) -> None:
    """Those of a speed and of a torque of a random chain of up to so many rotors, to this part of the extreme."""
    chain, t_end = random_chain(seed, most)
    net, initial = network_of(chain)
    sol = net.simulate(t_end=t_end, rtol=RTOL, engine=engine, initial=initial)
    place = seed % len(chain.c)
    for name, exact in ((f"J{place}.omega", chain.speed(place)), (f"shaft{place}.tau", chain.torque_between(place))):
        turned = Oscillations(exact.rates, -exact.weights, -exact.level)
        (_, top), (_, opposite) = exact.largest(t_end), turned.largest(t_end)
        size = max(abs(top), abs(opposite), 1e-300)
        for found, value in ((sol.max(name), top), (sol.min(name), -opposite)):
            assert abs(found - value) <= right * max(abs(value), SMALL * size) + exact.rounding
            there = float(exact(np.array([found.t]))[0])  # it is reached when it says
            assert abs(there - found) <= right * size + exact.rounding


@pytest.mark.slow
@share_of_examples(0.04)
@given(st.integers(0, 2**32 - 1))
def test_extremes_of_linear_trains_are_those_of_their_modes(seed: int) -> None:
    check_extremes(seed, 100, "auto", RIGHT)


@pytest.mark.slow
def test_an_extreme_far_below_its_modes_is_right_to_their_rounding() -> None:
    check_extremes(2078, 100, "auto", RIGHT)


@pytest.mark.slow
@share_of_examples(0.04)
@pytest.mark.parametrize(("engine", "most", "right"), [("scipy", 40, STEPPED), ("heyoka", 20, RIGHT)])
@given(seed=st.integers(0, 2**32 - 1))
def test_extremes_of_linear_trains_do_not_depend_on_the_engine(seed: int, engine: str, most: int, right: float) -> None:
    check_extremes(seed, most, engine, right)
