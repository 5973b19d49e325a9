"""Claims about the work of compiling: it grows in proportion to the network."""

import sys
from collections.abc import Callable

import pytest

import shaftwork as sw


def _shaft(n: int) -> sw.Network:
    """One damped shaft as n elements."""
    return sw.scenes.shaft_step(sw.Lumped(n), damping=1e-3)


def _train(n: int) -> sw.Network:
    """n inertias, with springs, dampers and gears of ratio 1 between them."""
    net = sw.Network("train")
    net.add(sw.TorqueSource("motor", tau=1.0), "n0")
    for k in range(n):
        net.add(sw.Inertia(f"J{k}", J=1.0 + k % 3), f"n{k}")
        net.add(sw.Spring(f"s{k}", c=1e4, d=1.0), f"n{k}", f"m{k}")
        net.add(sw.Gear(f"g{k}", ratio=2.0), f"m{k}", f"n{k + 1}")
        net.add(sw.Damper(f"d{k}", d=0.1), f"n{k}")
    net.add(sw.Inertia("load", J=1.0), f"n{n}")
    return net


def _calls(call: Callable[[], object]) -> int:
    """How often functions are entered or go on."""
    count = 0

    def counted(_frame: object, event: str, _argument: object) -> None:
        nonlocal count
        count += event == "call"

    sys.setprofile(counted)
    try:
        call()
    finally:
        sys.setprofile(None)
    return count


@pytest.mark.parametrize(("network", "n"), [(_shaft, 500), (_train, 60)])
def test_four_times_the_network_takes_at_most_five_times_the_calls(
    network: Callable[[int], sw.Network], n: int
) -> None:
    """In proportion it is 4; a look at all branches for each branch would make it 16. A first one fills the caches."""
    network(n).compile()
    small, large = network(n), network(4 * n)
    assert _calls(large.compile) < 5.0 * _calls(small.compile)
