"""The tables of a reduction in print: inside the margins, with formulas that say what was done."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import pytest

import shaftwork as sw
from shaftwork.latex.document import PREAMBLE
from tests.latex.test_equations_in_print import compile_latex, compiles, overfull


@cache
def hoist() -> sw.Network:
    """A planetary with a held ring, a lossy stage and a drum; names that LaTeX would read otherwise."""
    net = sw.Network("planetary hoist")
    net.add(sw.KlossMotor("motor", tau_k=40.0, s_k=0.2, n_sync=1500), "rotor")
    net.add(sw.Inertia("J_rotor", J=0.1), "rotor")
    net.add(sw.Spring("coupling", c=2000.0, d=0.5), "rotor", "sun")
    net.add(sw.Inertia("J_sun", J=0.01), "sun")
    net.add(sw.PlanetaryGear("planets", ratio=3.0), "sun", "carrier", "ring")
    net.add(sw.Ground("frame"), "ring")
    net.add(sw.LossyGear("reducer_stage_2", ratio=4.5, efficiency=0.96), "carrier", "drum shaft")
    net.add(sw.Inertia("J_drum & 50% {x}", J=1.5), "drum shaft")
    net.add(sw.Backlash("drum_splines", c=5e5, d=12.0, gap=0.01), "drum shaft", "drum end")
    net.add(sw.Inertia("J_end", J=0.2), "drum end")
    net.add(sw.Drum("drum", radius=0.2), "drum end", "rope")
    net.add(sw.TranslationalSpring("wire_rope", c=1e6, d=300.0), "rope", "hook")
    net.add(sw.Mass("load", m=150.0), "hook")
    net.add(sw.ForceSource("weight", f=-9.81 * 150.0), "hook")
    return net


TRAINS = {
    "crane": (sw.scenes.crane_train, "wheel", "rotor", "shaft"),
    "crane with losses": (lambda: sw.scenes.crane_train(losses="gears"), "wheel", "wheel", "shaft"),
    "excavator": (sw.scenes.excavator_train, "wheel", "wheel", "shaft"),
    "hoist": (hoist, "drum shaft", "rotor", "coupling"),
}


@pytest.mark.slow
@compiles
@pytest.mark.parametrize("name", TRAINS)
def test_tables_keep_inside_the_margins(name: str, tmp_path: Path) -> None:
    make, slow, fast, keep = TRAINS[name]
    net, drives = make(), {"reducer_stage_2": "a"} if name == "hoist" else None
    tables = [sw.reduce.refer(net, to, drives=drives).table.latex() for to in (slow, fast)]
    tables += [sw.reduce.simplify(net, masses, keep, drives=drives).table.latex() for masses in (1, 2, 3, 4)]
    log = compile_latex("\n\n".join((PREAMBLE, r"\begin{document}", *tables, r"\end{document}")), tmp_path)
    assert max(overfull(log), default=0.0) < 10.0  # points: less than a letter and a half


def test_a_formula_is_a_product_and_no_difference() -> None:
    """The sun turns i + 1 times as fast as the carrier; that the sign of both is turned twice is no part of it."""
    table = sw.reduce.refer(hoist(), "drum shaft", drives={"reducer_stage_2": "a"}).table
    rows = {entry.part: row for entry, row in zip(table, _formulas(table.latex()), strict=True)}
    planets, stage = r"\left(i_{\mathrm{planets}} + 1\right)^{2}", r"_{\mathrm{reducer\_stage},2}"
    assert (
        rows["J_sun"]
        == rf"$J'_{{\mathrm{{sun}}}} = J_{{\mathrm{{sun}}}} \, \eta{stage} \, i{stage}^{{2}} \, {planets}$"
    )
    assert not any(" - " in row for row in rows.values())
    assert "J_sun.J * (reducer_stage_2.efficiency*reducer_stage_2.ratio**2*(planets.ratio + 1)**2)" in str(table)


def test_a_gear_that_reverses_puts_its_sign_before_the_whole() -> None:
    """A planetary whose carrier is held turns the ring against the sun, i times as slowly."""
    net = sw.Network("reversing")
    net.add(sw.TorqueSource("motor", tau=5.0), "sun")
    net.add(sw.Inertia("J1", J=1.0), "sun")
    net.add(sw.PlanetaryGear("planets", ratio=3.0), "sun", "carrier", "ring")
    net.add(sw.Ground("frame"), "carrier")
    net.add(sw.Inertia("J2", J=1.0), "ring")
    table = sw.reduce.refer(net, "ring").table
    assert table["motor.tau"].referred == -15.0
    motor, inertia, _ = _formulas(table.latex())
    assert motor == r"$\tau'_{\mathrm{motor}} = -\tau_{\mathrm{motor}} \, i_{\mathrm{planets}}$"
    assert inertia == r"$J'_{1} = J_{1} \, i_{\mathrm{planets}}^{2}$"


def named_at_length() -> sw.Network:
    """Names of seventy letters, with and without places to break them, and laws of every kind."""
    net = sw.Network("long names")
    net.add(sw.TorqueSource("motor", tau=5 * sw.t**2 + 3 * sw.omega), "a")
    net.add(sw.TorqueSource("curve", tau=sw.Table(list(range(20)), list(range(20)))), "a")
    net.add(sw.Inertia("J" * 70, J=2.0), "a")
    net.add(sw.Gear("gear with a very long name that nobody would ever use in practice, really", ratio=-3.0), "a", "b")
    net.add(sw.Spring("spring_of_the_second_shaft_between_the_gear_and_the_drum_of_the_hoist", c=1e4), "b", "c")
    net.add(sw.Inertia("motorshaftcoupling", J=1.0), "c")
    return net


def test_a_law_is_printed_as_it_is_and_as_it_is_at_the_reference_shaft() -> None:
    latex = sw.reduce.refer(named_at_length(), "c").table.latex()
    _, laws = latex.split(r"\paragraph{Laws}")
    assert r"\tau_{\mathrm{motor}} &= 3 \, \omega + 5 \, t^{2}" in laws
    assert r"\tau'_{\mathrm{motor}} &= 27 \, \omega' - 15 \, t^{2}" in laws
    assert r"\tau_{\mathrm{curve}} &= (0,\, 0)\, (1,\, 1)\, (2,\, 2)\, " in laws
    assert r"\tau'_{\mathrm{curve}} &= (0,\, 0)\, (1,\, -3)\, (2,\, -6)\, " in laws
    assert r"\paragraph{Laws}" not in sw.reduce.refer(sw.scenes.crane_train(), "wheel").table.latex()


@compiles
def test_names_of_seventy_letters_stay_in_their_columns(tmp_path: Path) -> None:
    """A column of a fixed width that is too narrow for its words is an overfull box; that of the table is another."""
    table = sw.reduce.refer(named_at_length(), "c").table.latex()
    log = compile_latex(f"{PREAMBLE}\n\\begin{{document}}\n{table}\n\\end{{document}}", tmp_path)
    assert max(overfull(log), default=0.0) < 10.0  # points: less than a letter and a half


def test_a_table_of_groups_has_units_the_letter_of_the_gap_and_what_is_rigid() -> None:
    small = sw.reduce.simplify(hoist(), 3, "drum_splines", drives={"reducer_stage_2": "a"}, to="drum shaft")
    latex = small.table.latex()
    assert r"$c$ & $500000$ & $\mathrm{N\,m/rad}$ & " in latex
    assert r"$\Delta$ & $0.01$ & $\mathrm{rad}$ & " in latex
    assert small.table.rigid
    assert latex.count("rigid now & ") == 1


def _formulas(latex: str) -> list[str]:
    rows = [line.split(" & ") for line in latex.splitlines() if line.count(" & ") == 6]
    return [row[1].replace(r"\allowbreak ", " ").replace(r"\, ", r"\, ").replace("  ", " ") for row in rows[1:]]
