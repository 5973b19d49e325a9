"""Equations of networks whose parts change their mode: they say for which modes they hold, and are as short there."""

from __future__ import annotations

import shutil
import subprocess
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest
import sympy

import shaftwork as sw
from shaftwork.cli import main
from shaftwork.equations.records import Equations


@cache
def gapped() -> sw.Network:
    net = sw.Network("gapped")
    net.add(sw.Inertia("J1", J=2.0), "a")
    net.add(sw.Backlash("gap", gap=0.02, c=100.0, d=3.0), "a", "b")
    net.add(sw.Inertia("J2", J=5.0), "b")
    net.add(sw.TorqueSource("soft", tau=-7 * sw.phi - sw.phi**3), "b")
    net.add(sw.TorqueSource("firm", tau=4 - 11 * sw.phi), "b")
    net.add(sw.CoulombLoad("load", tau=1.0), "b")
    return net


def entry(equations: Equations, matrix: str, *place: int) -> sympy.Expr:
    return getattr(equations.second_order, matrix).get(place, 0)


def test_a_gap_in_contact_stands_in_the_stiffness_and_its_width_in_the_torques() -> None:
    c, d, width = (sympy.Symbol(f"gap.{name}", real=True) for name in ("c", "d", "gap"))
    touching = gapped().equations(phase="gap in contact")
    assert entry(touching, "damping", 0, 0) == d
    assert [entry(touching, "stiffness", *place) for place in ((0, 0), (0, 1), (1, 1))] == [c, -c, c + 11]
    assert touching.second_order.forces[0] == c * width / 2
    assert entry(gapped().equations(phase="gap in contact backward"), "stiffness", 0, 0) == c
    assert entry(gapped().equations(phase="gap open"), "stiffness", 0, 0) == 0


def test_a_law_that_bends_stays_a_torque_as_a_whole() -> None:
    soft = sympy.Symbol("soft.tau", real=True)
    angle = sympy.Symbol("J2.phi", real=True)
    laws = gapped().equations().second_order.laws
    assert laws[soft] == -7 * angle - angle**3
    assert not any(symbol.name.startswith("firm") for symbol in laws)


@pytest.mark.parametrize(
    ("asked", "whole"),
    [
        (None, "gap open, load slipping forward"),
        ("load stuck", "gap open, load stuck"),
        ("load stuck, gap in contact", "gap in contact, load stuck"),
    ],
)
def test_equations_say_for_which_modes_they_hold(asked: str | None, whole: str) -> None:
    equations = gapped().equations(phase=asked)
    assert equations.phase == whole
    for form in ("kirchhoff", "state", "second-order"):
        assert equations.latex(form).startswith(f"\\allowdisplaybreaks\n\\paragraph{{Phase}}\\mbox{{}}\n{whole}\n")  # type: ignore[arg-type]
    assert equations._repr_latex_().startswith(f"$\\textbf{{Phase}}$ {whole}\n")
    assert f"\\section{{Phase}}\n{whole}\n" in equations.document()


def test_a_phase_of_a_motion_is_asked_for_by_its_row() -> None:
    row = gapped().simulate(0.01, initial={"J2.omega": 1.0}).phases[0]
    assert gapped().equations(phase=row).phase == row.name
    assert gapped().equations().latex("state", phase=row) == gapped().equations(phase=row.name).latex("state")
    with pytest.raises(sw.ParameterError, match="must be a text"):
        gapped().equations(phase=3)  # type: ignore[arg-type]


@pytest.mark.parametrize("part", ["brake", "load"])
def test_a_torque_has_one_letter_and_one_sign_in_the_balances_of_all_phases(part: str) -> None:
    """The same as the signal: what a brake takes from its node, what a load gives to it; also where they hold."""
    net = sw.Network("rubbing")
    net.add(sw.TorqueSource("pull", tau=3.0), "a")
    net.add(sw.Inertia("J", J=2.0), "a")
    rubs = {"brake": sw.Brake("brake", tau=1.0), "load": sw.CoulombLoad("load", tau=1.0)}
    net.add(rubs[part], "a")
    sign = {"brake": -1, "load": 1}[part]
    for mode in ("slipping forward", "slipping backward", "locked" if part == "brake" else "stuck"):
        equations = net.equations(phase=f"{part} {mode}")
        (balance,) = equations.nodes
        letters = {symbol.name: symbol for symbol in balance.expression.free_symbols}
        assert sorted(letters) == sorted(["J.J", "der(J.omega)", "pull.tau", f"tau({part})"])
        assert balance.expression.coeff(letters[f"tau({part})"]) == sign * balance.expression.coeff(letters["pull.tau"])


def test_what_holds_beside_another_torque_of_its_part_has_a_letter_of_its_own() -> None:
    net = sw.Network("hoist")
    net.add(sw.Inertia("J", J=2.0), "a")
    net.add(sw.Hoist("load", m=5.0, radius=0.1, efficiency=0.5), "a")
    stuck = net.equations(phase="load stuck")
    (balance,) = stuck.nodes
    assert {"load.tau_1", "load.tau_2"} < {symbol.name for symbol in balance.expression.free_symbols}
    assert "load.tau" not in {symbol.name for symbol in balance.expression.free_symbols}
    (weight,) = (row.right for row in stuck.laws)  # what a locked brake holds before it
    assert str(weight) == "-load.tau_h"


def test_equations_without_modes_name_no_phase() -> None:
    equations = sw.scenes.shaft_chain(3).equations()
    assert equations.phase == ""
    assert "Phase" not in equations.latex() + equations._repr_latex_() + equations.document()


@pytest.mark.slow
def test_a_curve_of_several_pieces_that_is_switched_is_one_list_of_cases() -> None:
    """The cases of the time come first; the torque is the same as before the switch, and zero after it."""
    net = sw.Network("switched")
    net.add(sw.motors["KBF-90 LA 2"].cage("motor", t_on=1.0, t_off=2.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    (law,) = (row.right for row in net.equations().laws)
    assert len(law.atoms(sympy.Piecewise)) == 1
    assert net.equations().latex("kirchhoff").count(r"\begin{cases}") == 1
    sol = net.simulate(3.0, engine="scipy", t_eval=[0.5, 1.0, 1.5, 2.5])
    assert sol["motor.tau"].tolist()[::3] == [0.0, 0.0]
    assert sol["motor.tau"][1] == pytest.approx(7.0, rel=1e-14)
    assert sol["motor.tau"][2] > 0


def printed(capsys: pytest.CaptureFixture[str], *arguments: str) -> str:
    """What `shaftwork latex` prints."""
    assert main(["latex", *arguments]) == 0
    return capsys.readouterr().out


@pytest.mark.slow
def test_a_document_of_a_scene_has_each_of_its_phases_and_compiles(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    text = printed(capsys, "six-phases", "--document")
    said = [line for before, line in pairwise(text.splitlines()) if before == r"\section{Phase}"]
    assert [sorted(each.split(", ")) for each in said] == [
        sorted(each.split(", ")) for each in sw.scenes.SCENES["six-phases"].phases
    ]
    assert text.count(r"\begin{document}") == text.count(r"\end{document}") == 1
    if shutil.which("pdflatex"):
        (tmp_path / "report.tex").write_text(text, encoding="utf-8")
        command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "report.tex"]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, encoding="latin-1", check=False)
        assert done.returncode == 0, done.stdout[-2000:]


@pytest.mark.slow
def test_without_a_phase_the_command_prints_the_one_in_which_the_motion_begins(
    capsys: pytest.CaptureFixture[str],
) -> None:
    begins = sw.scenes.bldc_shaft().simulate(1e-6).phases[0].name
    assert sw.scenes.bldc_shaft().start_phase() == begins
    for options in ((), ("--document",)):
        assert begins in printed(capsys, "bldc-shaft", *options)
    assert sw.scenes.shaft_chain(3).start_phase() == ""


@pytest.mark.parametrize(
    ("form", "title"),
    [("kirchhoff", "Kirchhoff's equations"), ("state", "State form"), ("second-order", "Second-order form")],
)
def test_a_document_is_of_the_form_that_is_asked_for(form: str, title: str, capsys: pytest.CaptureFixture[str]) -> None:
    text = printed(capsys, "crane-start", "--document", "--form", form)
    titles = [line for line in text.splitlines() if line.startswith(r"\section{")]
    assert titles == [r"\section{Phase}", rf"\section{{{title}}}", r"\section{Nomenclature}", *titles[3:]]
    assert titles[3:] in ([], [r"\section{Remarks}"])
    with pytest.raises(sw.ShaftworkError, match="no form 'newton'"):
        gapped().equations().document("newton")  # type: ignore[arg-type]


def test_the_kirchhoff_form_says_whose_integral_the_twist_of_a_gap_is() -> None:
    net = sw.Network("gapped")
    net.add(sw.Inertia("J1", J=2.0, symbol="1"), "a")
    net.add(sw.Backlash("gap", gap=0.02, c=100.0, symbol="g"), "a", "b")
    net.add(sw.Inertia("J2", J=5.0, symbol="2"), "b")
    equations = net.equations(phase="gap in contact")
    rate = r"\frac{d \varphi_{g}}{d t} &= \omega_{1} - \omega_{2}"
    assert rate in equations.latex("kirchhoff")
    assert equations.latex().count(rate) == 1  # below, among the states
    assert rate in equations.document("kirchhoff")


def switched(**motor: float) -> sw.Network:
    """A motor that is off from 6.5 s on, beside a brake that is on from then on."""
    net = sw.Network("switched")
    net.add(sw.motors["KBF-90 LA 2"].cage("motor", symbol="M", t_off=6.5, **motor), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Brake("brake", tau=20.0, t_on=6.5), "a")
    return net


def test_a_motor_that_is_off_in_a_phase_is_printed_without_torque() -> None:
    off = switched().equations(phase="brake slipping forward").latex()
    assert r"\tau_{M} &= 0" in off
    assert r"\begin{cases}" not in off
    assert r"t_{\mathrm{off},M}" not in off
    on = switched().equations(phase="brake released").latex()
    assert on.count(r"\text{for}") == 2  # the pieces of the curve
    assert r"t_{\mathrm{off},M}" not in on


def test_a_motor_that_is_switched_within_a_phase_keeps_its_cases_of_the_time() -> None:
    net = switched(t_on=1.0)
    assert r"t_{\mathrm{on},M}" in net.equations(phase="brake released").latex()
    assert r"t_{\mathrm{off},M}" not in net.equations(phase="brake released").latex()
