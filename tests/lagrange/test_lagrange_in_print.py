"""Lagrange's equations in print: balanced, compiled by pdflatex, every letter explained."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest

import shaftwork as sw
from shaftwork.lagrange.lagrange import Lagrangian
from tests.lagrange.test_lagrange import WHOLE, closed_gears, of
from tests.latex.test_equations_in_print import compile_latex, compiles, overfull


@pytest.mark.parametrize("name", ["planetary hoist", "prescribed speed behind gears", "torque of angle and speed"])
def test_the_print_is_balanced_and_has_no_marks(name: str) -> None:
    for text in (of(name).latex(), of(name).latex(values=True), of(name)._repr_latex_()):
        assert text.count(r"\begin{align*}") == text.count(r"\end{align*}") >= 4
        assert text.count("{") == text.count("}")
        assert text.count(r"\left") == text.count(r"\right")
        assert not any("\ue000" <= character <= "\ue003" for character in text)


@pytest.mark.slow
def test_a_shaft_with_weights_is_printed_as_sums() -> None:
    text = WHOLE["spectral"]().lagrangian().latex()
    assert r"\frac{1}{2} \, L \, J' \, \sum_{i = 0}^{8} h_{i} \, \dot{\varphi}_{i}^{2}" in text
    assert r"\Bigl( \sum_{i = 0}^{8} w_{k,i} \, \varphi_{i} \Bigr)^{2}" in text
    assert r"\frac{w_{k,0}}{\lambda_{k}}" in text  # what it gives to its end
    assert text.count(r"\\") < 30


PRINTED: dict[str, Callable[[], Lagrangian]] = {
    **{
        name: lambda name=name: WHOLE[name]().lagrangian()
        for name in ("spectral", "wave with losses", "induction machine")
    },  # type: ignore[misc]
    "closed gears": lambda: closed_gears(1.8).lagrangian(),
    "planetary hoist": lambda: of("planetary hoist"),
    "prescribed speed behind gears": lambda: of("prescribed speed behind gears"),
    "motor by its catalogue": lambda: sw.scenes.crane().lagrangian(),
}


@pytest.mark.slow
@compiles
@pytest.mark.parametrize("name", PRINTED)
@pytest.mark.parametrize("values", [False, True])
def test_a_document_compiles_and_keeps_inside_its_margins(name: str, values: bool, tmp_path: Path) -> None:  # noqa: FBT001
    log = compile_latex(PRINTED[name]().document(values=values), tmp_path)
    assert max(overfull(log), default=0.0) < 10.0  # points, as for the document of Kirchhoff's equations


@pytest.mark.slow
@pytest.mark.parametrize("name", PRINTED)
def test_a_document_has_all_that_is_printed_and_says_what_its_letters_are(name: str) -> None:
    made = PRINTED[name]()
    text = made.document()
    printed = set(made.latex().splitlines()) - {r"\allowdisplaybreaks", r"\paragraph{Phase}\mbox{}"}
    assert printed <= set(text.splitlines())
    explained = text.partition(r"\section{Nomenclature}")[2]
    for symbol in made.coordinates:
        letter = re.sub("[\ue000\ue001]", "", made.kirchhoff.symbol_names[symbol.name])
        running = name == "spectral" and re.fullmatch(r"\\varphi_\{[2-6]\}", letter)  # drawn together in one row
        row = rf"^[^&]*\${re.escape(letter)}\$[^&]* & [^&]+ \(coordinate\) & "
        assert running or re.search(row, explained, re.MULTILINE), letter
    assert r"$E_k$ & kinetic energy & -- & $\mathrm{J}$" in explained
    assert (r"$E_p$ & potential energy" in explained) is bool(made.springs)
    assert (r"$\mathcal{R}$ & " in explained) is bool(made.dampers)
    assert "angular speed" not in explained  # rates of angles are printed as such
    assert (r"\section{Phase}" in text) is bool(made.phase)


@pytest.mark.slow
@compiles
@pytest.mark.parametrize("form", ["kirchhoff", "lagrange"])
def test_a_motor_by_its_catalogue_keeps_inside_the_margins_with_values(form: str, tmp_path: Path) -> None:
    """The case of a quartic is a sum that is wider than the page once its parameters are numbers."""
    net = sw.scenes.crane_train()
    made = net.lagrangian() if form == "lagrange" else net.equations()
    log = compile_latex(made.document(values=True), tmp_path)
    assert max(overfull(log), default=0.0) < 10.0


@pytest.mark.parametrize(("driven", "said"), [("", "for all } k"), ("a", "for all other } k"), ("ab", None)])
def test_forces_of_zero_are_named_only_where_there_are_some(driven: str, said: str | None) -> None:
    net = sw.Network("pair")
    for k, node in enumerate("ab"):
        net.add(sw.Inertia(f"J{k}", J=1.0), node)
        if node in driven:
            net.add(sw.TorqueSource(f"pull{k}", tau=1.0 + k), node)
    net.add(sw.Spring("s", c=5.0), "a", "b")
    text = net.lagrangian().latex()
    assert ("for all" in text) is (said is not None)
    assert said is None or said in text
