"""The state form: what the states of a network are, and what is eliminated."""

from __future__ import annotations

import numpy as np
import pytest

import shaftwork as sw
from shaftwork.formulation.explicit_rows import explicit_rows
from shaftwork.formulation.form import StateForm, state_form
from shaftwork.network.graph import build_graph

Placed = tuple[sw.Component, tuple[str, ...]]


def _form(*placed: Placed) -> StateForm:
    net = sw.Network("by hand")
    for part, nodes in placed:
        net.add(part, *nodes)
    return state_form(build_graph(net.netlist()))


TWO_MASSES: tuple[Placed, ...] = (
    (sw.TorqueSource("motor", tau=5.0), ("a",)),
    (sw.Inertia("J1", J=2.0), ("a",)),
    (sw.Spring("shaft", c=10.0, d=0.1), ("a", "b")),
    (sw.Inertia("J2", J=3.0), ("b",)),
)


def test_states_are_speeds_first_then_torques_in_the_order_of_the_parts() -> None:
    form = _form(*TWO_MASSES)
    assert [state.name for state in form.states] == ["J1.omega", "J2.omega", "shaft.tau_c"]
    assert [state.unit for state in form.states] == ["rad/s", "rad/s", "N*m"]


def test_no_angle_is_a_state_unless_a_law_reads_it() -> None:
    pendulum = (sw.TorqueSource("gravity", tau=-3.0 * sw.phi), ("b",))
    assert not _form(*TWO_MASSES).integrals
    assert [state.name for state in _form(*TWO_MASSES, pendulum).states][-1] == "gravity.phi"


@pytest.mark.parametrize(
    ("extra", "eliminated"),
    [
        ((sw.Inertia("J3", J=1.0), ("b",)), 1),
        ((sw.Spring("twin", c=4.0), ("a", "b")), 0),
        ((sw.Damper("bearing", d=0.0), ("b",)), 0),
    ],
    ids=["an inertia beside another", "a spring beside another", "a damper of zero"],
)
def test_stores_that_follow_from_others_are_eliminated(extra: Placed, eliminated: int) -> None:
    form = _form(*TWO_MASSES, extra)
    assert len(form.dependent_across) + len(form.dependent_through) == eliminated


def test_a_parameter_of_exactly_zero_leaves_no_trace() -> None:
    form = _form(
        (sw.Inertia("J1", J=2.0), ("a",)),
        (sw.Spring("shaft", c=10.0), ("a", "b")),
        (sw.Inertia("J2", J=3.0), ("b",)),
        (sw.Damper("bearing", d=0.0), ("b",)),
        (sw.Inertia("hub", J=0.0), ("b",)),
    )
    assert form.graph.zeros == ("shaft.d", "bearing.d", "hub.J")
    assert list(form.graph.parameters) == ["J1.J", "shaft.c", "J2.J"]
    rates = explicit_rows(form).rates
    assert {symbol.name for rate in rates for symbol in rate.free_symbols} <= {
        *form.graph.parameters,
        *(state.name for state in form.states),
    }


def test_rows_of_the_two_mass_drive_are_those_of_the_textbook() -> None:
    """J1 w1' = tau - tau_c - d (w1 - w2), J2 w2' = tau_c + d (w1 - w2), tau_c' = c (w1 - w2). Popenda 2019, (1)-(4)."""
    form = _form(*TWO_MASSES)
    rows = explicit_rows(form)
    w1, w2, twist = rows.states
    J1, tau, c, d, J2 = (
        next(symbol for symbol in rows.parameters if symbol.name == name)
        for name in ("J1.J", "motor.tau", "shaft.c", "shaft.d", "J2.J")
    )
    wanted = ((tau - twist - d * (w1 - w2)) / J1, (twist + d * (w1 - w2)) / J2, c * (w1 - w2))
    assert all((rate - want).expand() == 0 for rate, want in zip(rows.rates, wanted, strict=True))


def test_geared_inertias_add_by_the_square_of_the_ratio() -> None:
    """J = J1 + J2 / ratio^2, seen from the side of J1. Marinkovic 2012, (18)."""
    net = sw.Network("geared")
    net.add(sw.TorqueSource("motor", tau=5.0), "a")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Gear("gear", ratio=4.0), "a", "b")
    net.add(sw.Inertia("J2", J=8.0), "b")
    model = net.compile()
    assert model.states == ("J1.omega",)
    np.testing.assert_allclose(model.rhs(0.0, np.zeros(1)), 5.0 / (2.0 + 8.0 / 16.0), rtol=1e-15)
