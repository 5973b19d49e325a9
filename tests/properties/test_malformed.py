"""Wrong networks are refused in the library's own words: no traceback of another library, no hang, no NaN."""

from __future__ import annotations

import warnings
from collections.abc import Iterable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import shaftwork as sw
from tests.malformations import BREAKERS, malformed_networks
from tests.properties.examples import network_of, processor_time_limit, share_of_examples
from tests.reference.mna import GROUND, Piece
from tests.strategies import Network, build, networks

ODD_VALUES = (0.0, 1e-30, 1e-12, 1e12, 1e30, -1.0)

NAMED: dict[str, tuple[str, ...]] = {
    "dangling_end": ("loose end", "Spring 'loose'", "'nowhere'"),
    "floating_part": ("floating part", "Spring 'adrift'", "'island_a'", "'island_b'"),
    "floating_circuit": ("'adrift'", "'adrift_too'", "'f1'", "'f2'", "ground"),
    "contradictory_speeds": ("SpeedSource 'first_speed'", "SpeedSource 'second_speed'", "'r1'"),
    "contradictory_speeds_through_a_gear": ("'first_speed'", "'second_speed'", "Gear 'between'", "'output'"),
    "speed_against_ground": ("SpeedSource 'speed'", "Ground 'wall'", "'r1'"),
    "speed_against_a_locked_gear_loop": ("SpeedSource 'speed'", "Gear 'fast'", "Gear 'slow'", "'r1'"),
    "locked_gear_loop": ("locked", "Gear 'fast'", "Gear 'slow'", "'output'", "'r1'", "2", "3"),
    "torque_on_a_massless_node": ("massless node", "TorqueSource 'torque'", "'alone'"),
    "torque_on_a_massless_gear": ("massless node", "TorqueSource 'torque'", "'alone'", "'output'"),
    "contradictory_voltages": ("VoltageSource 'u1'", "VoltageSource 'u2'", "'f1'"),
    "current_into_an_open_node": ("CurrentSource 'i'", "'f1'"),
    "shorted_voltage": ("VoltageSource 'u'", "'ground'"),
    "duplicate_name": ("duplicate name", "'J1'", "'r1'", "TorqueSource"),
    "missing_node": ("Spring 'spring1'", "'r1'", "a, b"),
    "too_many_nodes": ("Spring 'spring1'", "'one_more'", "a, b"),
    "empty_node_name": ("Spring 'spring1'", "''"),
    "both_ends_on_one_node": ("Spring 'spring1'", "'r1'", "does nothing"),
    "wrong_domain": ("Resistor 'stray'", "'r1'", "electrical", "rotation"),
    "negative_parameter": ("Inertia 'J1'", "J = -1.0", "at least 0"),
    "nan_parameter": ("Inertia 'J1'", "J = nan", "finite"),
    "infinite_parameter": ("Inertia 'J1'", "J = inf", "finite"),
    "text_parameter": ("Inertia 'J1'", "J = 'heavy'", "number"),
    "no_parameter_value": ("Inertia 'J1'", "J = None", "number"),
    "complex_parameter": ("Inertia 'J1'", "J = 1j", "number"),
    "list_parameter": ("Inertia 'J1'", "J = [1.0, 2.0]", "number"),
    "zero_ratio": ("Gear 'flat'", "ratio = 0.0", "not zero"),
    "zero_radius": ("Drum 'flat'", "radius = 0.0", "not zero"),
    "missing_parameter": ("Inertia 'J1'", "'J'", "moment of inertia"),
    "unknown_parameter": ("Inertia 'J1'", "'stiffnes'", "moment of inertia"),
    "empty_network": ("no parts",),
}
"""What the message must name, for each way of breaking the network of `_sound`."""


def _sound() -> Network:
    """A motor, a spring and two inertias: the least network that every breaker can break."""
    return build([])


def _report(pieces: Iterable[Piece]) -> str:
    """The whole report of a network, whether it is refused at once, by `compile`, or only warned about."""
    try:
        net = network_of(pieces)
        found = net.check()
        if any(problem.severity == "error" for problem in found):
            net.compile()
    except sw.ShaftworkError as error:
        return str(error)
    return "\n".join(str(problem) for problem in found)


def test_the_network_that_is_broken_below_is_sound() -> None:
    assert _survives(_sound()) is None


def test_every_way_of_breaking_a_network_has_its_message() -> None:
    assert tuple(NAMED) == tuple(BREAKERS)


@pytest.mark.parametrize("kind", BREAKERS)
def test_a_broken_network_is_told_what_and_where(kind: str) -> None:
    report = _report(BREAKERS[kind](_sound(), 0))
    missing = [text for text in NAMED[kind] if text not in report]
    assert not missing, report


def test_a_locked_gear_loop_is_worth_a_warning_and_stands_still() -> None:
    net = network_of(BREAKERS["locked_gear_loop"](_sound(), 0))
    with pytest.warns(sw.NetworkWarning, match="locked gear loop"):
        sol = net.simulate(1.0)
    assert not np.abs(sol["r1.omega"]).any()
    assert np.isfinite(sol["fast.tau_a"]).all()


def test_all_problems_of_a_network_are_reported_together() -> None:
    pieces = _sound()
    for kind in ("nan_parameter", "floating_part", "contradictory_speeds", "torque_on_a_massless_node"):
        pieces = BREAKERS[kind](pieces, 0)
    with pytest.raises(sw.NetworkError) as caught:
        network_of(pieces).compile()
    kinds = [problem.kind for problem in caught.value.problems]
    assert sorted(kinds) == ["floating part", "massless node", "parameter", "two speed sources"]
    assert str(caught.value).startswith("'random train' cannot be assembled: 4 problems\n  1. parameter: Inertia 'J1'")


def _survives(pieces: Network) -> sw.ShaftworkError | None:
    """The error that refuses a network, or None when it runs and everything in it stays finite.

    Any other exception passes, and so fails the test; warnings of numpy, scipy and sympy count as exceptions here.
    """
    with processor_time_limit(30.0), warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.NetworkWarning)
        warnings.simplefilter("ignore", sw.AccuracyWarning)  # it says what is wrong, which is all that is asked
        try:
            net = network_of(pieces)
        except sw.ShaftworkError as error:
            return error
        errors = tuple(problem for problem in net.check() if problem.severity == "error")
        if errors:
            with pytest.raises(sw.NetworkError) as refused:
                net.compile()
            assert refused.value.problems == errors
            return refused.value
        model = net.compile()
        try:
            sol = model.simulate(0.01, t_eval=3)
        except (sw.SimulationError, sw.CompileError) as error:  # matrices that values far apart make singular
            return error
        strange = [name for name in sol if not np.isfinite(sol[name]).all()]
        assert not strange, strange
    return None


@pytest.mark.slow
@share_of_examples(2)
@given(malformed_networks())
def test_a_network_broken_on_purpose_is_refused_or_runs(broken: tuple[Network, str]) -> None:
    """Refused, except where the damage happens to be legal: a port that may be left out, a gear loop that is locked."""
    pieces, kind = broken
    error = _survives(pieces)
    if kind in ("missing_node", "negative_parameter", "locked_gear_loop"):
        return
    assert isinstance(error, sw.ShaftworkError), kind
    assert not isinstance(error, sw.SimulationError), kind


@st.composite
def torn_networks(draw: st.DrawFn) -> Network:
    """A network with some parts missing, some ends at other nodes and some values beyond reason."""
    pieces = draw(networks(max_inertias=6))
    dice = draw(st.randoms(use_true_random=False))
    nodes = [*dict.fromkeys(node for piece in pieces for node in piece.nodes), GROUND]
    torn = []
    for piece in pieces:
        fate = dice.random()
        ends, values = piece.nodes, dict(piece.values)
        if fate < 0.1:
            continue
        if fate < 0.2:
            ends = tuple(dice.choice(nodes) if dice.random() < 0.5 else node for node in ends)
        elif fate < 0.3 and values:
            values[dice.choice([*values])] = dice.choice(ODD_VALUES)
        torn.append(Piece(piece.type, piece.name, ends, values))
    return tuple(torn)


@pytest.mark.slow
@share_of_examples(2)
@given(torn_networks())
def test_a_network_torn_at_random_is_refused_or_runs(pieces: Network) -> None:
    _survives(pieces)
