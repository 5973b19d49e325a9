"""The tables behind a document: what the motion can be computed anew from is there, and nothing without effect."""

from __future__ import annotations

import re

import pytest
import sympy

import shaftwork as sw
from shaftwork.network.graph import effective
from tests.beds import bed_of, registered

FREQUENCY = sw.Table([0.0, 0.5, 2.0, 6.0, 8.0, 30.0], [0.7, 0.7, 10.0, 10.25, 0.7, 0.7])
BRAKE = sw.Table([0.0, 0.3, 0.4, 8.0, 8.2, 30.0], [2e5, 2e5, 0.0, 0.0, 2e5, 1.9e5])


def hoist() -> sw.Network:
    net = sw.Network("hoist")
    net.add(sw.FrequencyDrive("motor", tau_k=2000.0, s_k=0.08, n_sync=1500, f=FREQUENCY), "shaft")
    net.add(sw.Inertia("rotor", J=400.0), "shaft")
    net.add(sw.Brake("brake", tau=BRAKE, t_off=20.0), "shaft")
    net.add(sw.PumpLoad("pump", tau_n=3.0, n_n=100.0), "shaft")
    net.add(sw.Backlash("gap", gap=0.1, c=1e3), "shaft", "far")
    net.add(sw.Inertia("wheel", J=1.0), "far")
    return net


def rows(document: str) -> list[tuple[str, ...]]:
    """The cells of all tables of the nomenclature."""
    text = document.partition(r"\section{Nomenclature}")[2]
    return [
        tuple(cell.strip() for cell in line.removesuffix(r"\\").split("&")) for line in text.splitlines() if "&" in line
    ]


def points(cell: str) -> list[tuple[float, float]]:
    return [(float(x), float(y)) for x, y in re.findall(r"\$(\S+) \\mapsto (\S+)\$", cell)]


def test_parameters_that_a_given_law_or_a_mode_replaces_are_not_listed() -> None:
    listed = {(row[1], row[2]) for row in rows(hoist().equations().document())}
    assert not any(
        "ramp" in meaning or "boost" in meaning
        for meaning, owner in listed
        if owner == "motor" and "by default" not in meaning
    )
    assert not any("stay together" in meaning for meaning, _ in listed)  # omega_rest of rigid flanks
    assert ("whole free twist", "gap") in listed
    assert ("rated frequency", "motor") in listed
    assert ("time from which it acts no more", "brake") in listed  # in the laws of no mode, but in what ends them
    net = hoist()
    net.replace(sw.FrequencyDrive("motor", tau_k=2000.0, s_k=0.08, n_sync=1500, boost=0.2))
    net.replace(sw.Backlash("gap", gap=0.1, omega_rest=1e-3))
    listed = {(row[1], row[2]) for row in rows(net.equations().document())}
    assert ("duration of the ramp", "motor") in listed
    assert ("frequency at which the boost ends", "motor") in listed
    assert ("of rigid flanks, speed up to which they stay together", "gap") in listed


@pytest.mark.slow
@pytest.mark.parametrize("phase", ["brake locked, pump stuck", "brake released"])
@pytest.mark.parametrize("form", [None, "lagrange"])
def test_every_point_of_a_law_stands_there_whatever_the_phase(phase: str, form: str | None) -> None:
    net = hoist()
    if form == "lagrange":
        net.remove("pump")
        phase = phase.partition(",")[0]
    equations = net.equations(phase=phase)
    if form == "lagrange":
        from shaftwork.lagrange.lagrange import lagrangian

        document = lagrangian(equations).document()
    else:
        document = equations.document(values=True)
    laws = {row[1]: points(row[2]) for row in rows(document) if r"\mapsto" in row[2]}
    assert laws["motor"] == list(zip(FREQUENCY.xs, FREQUENCY.ys, strict=True))
    assert laws["brake"] == list(zip(BRAKE.xs, BRAKE.ys, strict=True))


def test_a_long_table_runs_over_rows_and_a_table_within_a_formula_has_its_points_below() -> None:
    long = sw.Table([k / 7 for k in range(100)], [float(k * k) for k in range(100)])
    net = sw.Network("laws")
    net.add(sw.TorqueSource("pull", tau=long), "a")
    net.add(sw.TorqueSource("push", tau=3 * sympy.sin(sw.t) + FREQUENCY(sw.omega)), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    found = [row for row in rows(net.equations().document()) if r"\mapsto" in row[2]]
    own = [points(row[2]) for row in found]
    assert [point for row in own[:-2] for point in row] == [
        (pytest.approx(x, rel=1e-14), y) for x, y in zip(long.xs, long.ys, strict=True)
    ]
    assert len(own[:-2]) == 3
    assert [row[1] for row in found] == ["pull", "", "", "push", ""]
    assert r"\sin" in found[3][2]
    assert own[-1] == list(zip(FREQUENCY.xs, FREQUENCY.ys, strict=True))


def test_the_torque_of_a_law_and_the_one_that_holds_are_told_apart() -> None:
    listed = [row[:3] for row in rows(hoist().equations(phase="brake released, pump stuck").document())]
    assert (r"$\tau_{\mathrm{pump},1}$", "torque of its law", "pump") in listed
    assert (r"$\tau_{\mathrm{pump},2}$", "torque that holds it", "pump") in listed


@pytest.mark.slow
@pytest.mark.parametrize("name", registered())
def test_a_parameter_without_effect_changes_no_motion(name: str) -> None:
    """What is not listed may have another value: the same motion to the last digit."""
    model = bed_of(name).compile()
    graph = model.form.graph
    hidden = model.parameters.keys() - effective(graph)
    assert hidden == {"DryFriction": {"subject.omega_s"}, "HardStop": {"subject.omega_rest"}}.get(name, set())
    for key in hidden:
        first, other = (
            model.simulate(0.2, engine="scipy", parameters={key: factor * model.parameters[key]}) for factor in (1, 1.5)
        )
        for state in first.states:
            assert (first[state] == other[state]).all()
