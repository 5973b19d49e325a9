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
ROUNDED = 1e-4
"""Of the larger extreme: the other one, such as the zero at the start, is compared with no less than this."""


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


def largest_error(seed: int, most: int, engine: str) -> float:
    """Of the extremes of a speed and of a torque of a random chain, as a fraction of the extreme."""
    chain, t_end = random_chain(seed, most)
    net, initial = network_of(chain)
    sol = net.simulate(t_end=t_end, rtol=RTOL, engine=engine, initial=initial)
    place = seed % len(chain.c)
    errors = []
    for name, exact in ((f"J{place}.omega", chain.speed(place)), (f"shaft{place}.tau", chain.torque_between(place))):
        turned = Oscillations(exact.rates, -exact.weights, -exact.level)
        (_, most), (_, opposite) = exact.largest(t_end), turned.largest(t_end)
        size = max(abs(most), abs(opposite), 1e-300)
        for found, value in ((sol.max(name), most), (sol.min(name), -opposite)):
            off = max(0.0, abs(found - value) - exact.rounding)
            errors.append(off / max(abs(value), ROUNDED * size))
            assert abs(float(exact(np.array([found.t]))[0]) - found) <= RIGHT * size  # it is reached when it says
    return float(max(errors))


@pytest.mark.slow
@share_of_examples(0.04)
@given(st.integers(0, 2**32 - 1))
def test_extremes_of_linear_trains_are_those_of_their_modes(seed: int) -> None:
    assert largest_error(seed, 100, "auto") <= RIGHT
