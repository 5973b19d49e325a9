"""A long shaft in print: closed, short, in letters that are not those of its inside."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import shaftwork as sw
from shaftwork.equations.records import Equations
from shaftwork.equations.spelling import without_marks


def drive(model: object, **shaft: float) -> sw.Network:
    """A motor, a shaft, a gear behind it and a load."""
    net = sw.Network("drive")
    net.add(sw.KlossMotor("motor", tau_k=30.0, s_k=0.2, n_sync=1500), "m")
    net.add(sw.Inertia("J1", J=0.02), "m")
    net.add(sw.Shaft("line", length=2.0, diameter=0.02, model=model, **shaft), "m", "x")
    net.add(sw.Gear("gear", ratio=2.0), "x", "y")
    net.add(sw.Inertia("J2", J=0.3), "y")
    return net


def undefined(equations: Equations, form: str) -> set[str]:
    """The variables that stand in a form and are neither states nor coordinates nor defined in it."""
    text = equations.latex(form=form)
    states = {row.symbol.name for row in equations.states}
    known = {"varphi"} if form == "second-order" else set()
    return {
        latex
        for letter in equations.letters
        if not letter.parameter and letter.name not in states
        for latex in [without_marks(equations.symbol_names[letter.name])]
        if latex in text and f"\n{latex} &=" not in text and not any(word in latex for word in known)
    }


@pytest.mark.parametrize("form", ["state", "second-order"])
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_every_letter_of_a_wave_is_defined_in_the_form_itself(friction: float, form: str) -> None:
    equations = drive(sw.Wave(), friction=friction).equations()
    assert undefined(equations, form) == set()
    delayed = re.findall(r"\nh_\{.*?\} &= .*\]_\{t - ", equations.latex(form=form))
    assert len(delayed) == (4 if friction else 2)


def test_what_arrives_is_written_in_the_states() -> None:
    """Behind the gear the shaft's end turns with twice the speed of J2."""
    (row,) = re.findall(r"\nh_\{a,.*", drive(sw.Wave()).equations().latex(form="state"))
    assert r"\omega_{2}" in row
    assert r"i_{\mathrm{gear}}" in row


def test_the_waves_of_both_halves_have_letters_and_words_of_their_own() -> None:
    document = drive(sw.Wave(), friction=0.3).equations().document()
    for letter, end in ((r"a,\mathrm{line},1", "a"), (r"\mathrm{middle},\mathrm{line},2", r"middle, no.\ 2")):
        assert f"$h_{{{letter}}}$ & torque wave that arrives at {end} & line" in document


@pytest.mark.slow
@pytest.mark.parametrize("model", [sw.CentralDifference(80), sw.CentralDifference(20)], ids=repr)
def test_rates_of_twist_are_defined_once_and_not_called_nodes(model: object) -> None:
    equations = drive(model, damping=0.05).equations()
    document = equations.document()
    assert "line.twist" not in document
    assert "by line)" not in document
    assert document.count(r"\omega_{\mathrm{twist},\mathrm{line},0} &=") == 1
    assert [row.what for row in equations.eliminated if row.kind == "speed"] == ["inertia J2"]


@pytest.mark.slow
def test_central_differences_take_no_more_lines_for_more_nodes() -> None:
    small, large = (drive(sw.CentralDifference(m), damping=0.05).equations().document() for m in (40, 80))
    assert len(small.splitlines()) == len(large.splitlines())


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="pdflatex is not installed")
def test_a_product_with_a_long_sum_is_broken_inside_the_sum(tmp_path: Path) -> None:
    net = drive(sw.Spectral(4), damping=0.1)
    (tmp_path / "report.tex").write_text(net.equations().document(), encoding="utf-8")
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "report.tex"]
    log = subprocess.run(command, cwd=tmp_path, capture_output=True, encoding="latin-1", check=True).stdout
    assert max(map(float, re.findall(r"Overfull \\hbox \(([0-9.]+)pt", log)), default=0.0) < 10.0


@pytest.mark.slow
@pytest.mark.parametrize("losses", [{}, {"damping": 0.1, "friction": 0.2}], ids=["lossless", "lossy"])
def test_a_shaft_of_high_degree_is_printed_as_sums(losses: dict[str, float]) -> None:
    small = drive(sw.Spectral(16), **losses).equations()
    state = small.latex(form="state")
    for row in (
        r"\frac{d \omega_{\mathrm{line},j}}{d t} &= - \frac{1}{L_{\mathrm{line}} \, J'_{\mathrm{line}} \, h_{j}} \,"
        r" \sum_{k = 0}^{15} w_{k,j} \, \tau_{" + (r"\mathrm{total}," if losses else "") + r"\mathrm{line},k}",
        r"\frac{d \tau_{" + ("c," if losses else "") + r"\mathrm{line},k}}{d t} &= "
        r"\frac{C'_{\mathrm{line}}}{L_{\mathrm{line}} \, \lambda_{k}} \, "
        r"\sum_{j = 0}^{16} w_{k,j} \, \omega_{\mathrm{line},j}",
        r"\omega_{\mathrm{line},16} &= \omega_{b,\mathrm{line}}",
        r"w_{k,j} &= - \lambda_{k} \, \ell_{j}'(y_{k})",
    ):
        assert state.count(row) == 1, row
    assert undefined(small, "state") == set()
    assert r"\frac{d \omega_{\mathrm{line},3}}{d t}" not in state


def test_the_weights_are_what_is_printed_about_them() -> None:
    """Lagrange polynomials on the roots of (1 - x^2) P_n'(x); 1e-10 is what their coefficients lose to rounding."""
    degree = 8
    mesh = sw.Spectral(degree).mesh()
    nodes = (1 + np.array([-1.0, *np.sort(np.polynomial.Legendre.basis(degree).deriv().roots().real), 1.0])) / 2
    places, doubled = np.polynomial.legendre.leggauss(degree)
    stations, weights = (1 + places) / 2, doubled / 2
    for j in range(degree + 1):
        lagrange = np.polynomial.Polynomial.fromroots(np.delete(nodes, j))
        lagrange = lagrange / lagrange(nodes[j])
        made = [dict(row)[j] for row in mesh.weights]
        np.testing.assert_allclose(made, -weights * lagrange.deriv()(stations), atol=1e-10)
        np.testing.assert_allclose(mesh.inertias[j], lagrange.integ()(1.0) - lagrange.integ()(0.0), atol=1e-10)
    np.testing.assert_allclose(mesh.lengths, weights, atol=1e-14)


@pytest.mark.slow
@pytest.mark.parametrize("values", [False, True])
def test_sums_are_printed_by_value_too_and_in_the_second_order_form(values: bool) -> None:  # noqa: FBT001
    net = sw.Network("line")
    net.add(sw.TorqueSource("drive", tau=12.7), "m")
    net.add(sw.Shaft("line", length=2.0, diameter=0.02, damping=0.1, model=sw.Spectral(16)), "m", "x")
    text = net.equations().latex(form="second-order", values=values)
    assert text.count(r"\sum_{i = 0}^{16} w_{k,i} \, \varphi_{\mathrm{line},i}") == 3  # at both ends and inside
    assert (r"622.821 \sum" in text) == values
    assert r"\ddot{\varphi}_{\mathrm{line},3}" not in text


@pytest.mark.parametrize("model", [sw.Lumped(3), sw.Spectral(3)], ids=repr)
def test_the_torque_of_a_damped_spring_is_told_from_that_of_the_spring_alone(model: object) -> None:
    """Where bearings take torques too, which have numbers of their own."""
    equations = drive(model, damping=0.1, friction=0.2).equations()
    for row in equations.laws:
        assert row.left not in row.right.free_symbols, row.equation
