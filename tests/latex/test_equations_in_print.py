"""What is printed can be compiled, read, and told apart."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from sympy import Add, Heaviside, Piecewise, sin

from shaftwork.components import base
from shaftwork.components.branches import Branch, ThroughLaw
from shaftwork.components.electrical import DCMachine, Resistor, VoltageSource
from shaftwork.components.friction import Brake
from shaftwork.components.laws import omega, t
from shaftwork.components.loads import Conveyor
from shaftwork.components.mechanics import Damper, Inertia, Spring
from shaftwork.components.shaft_models import CentralDifference, Lumped, ShaftModel, Wave
from shaftwork.components.sources import TorqueSource
from shaftwork.core.errors import CompileError, ShaftworkError
from shaftwork.core.parameters import parameter
from shaftwork.latex.printing import WIDEST_CASE, printed_number, printed_width
from shaftwork.network.netlist import NetworkBuilder
from shaftwork.scenes import SCENES
from tests.equations.networks import MECHANICAL, crane, dc_drive, equations_of, hoist, mixed_train, shaft, train

ROOT = Path(__file__).parents[2]
compiles = pytest.mark.skipif(shutil.which("pdflatex") is None, reason="pdflatex is not installed")
NETWORKS: dict[str, Callable[[], NetworkBuilder]] = {
    **MECHANICAL,
    "dc drive": dc_drive,
    "train of 50": train,
    "50 parts": mixed_train,
}


def compile_latex(source: str, folder: Path) -> str:
    """Compile a document; what pdflatex said."""
    (folder / "report.tex").write_text(source, encoding="utf-8")
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "report.tex"]
    done = subprocess.run(command, cwd=folder, capture_output=True, encoding="latin-1", check=False)
    assert done.returncode == 0, done.stdout[-2000:]
    return done.stdout


def overfull(log: str) -> list[float]:
    """By how many points lines are too wide."""
    return [float(width) for width in re.findall(r"Overfull \\hbox \(([0-9.]+)pt too wide\)", log)]


@pytest.mark.slow
@compiles
@pytest.mark.parametrize("name", ["crane", "train of 50", "50 parts", "planetary hoist", "dc drive"])
@pytest.mark.parametrize("values", [False, True])
def test_a_document_compiles_and_keeps_inside_its_margins(name: str, values: bool, tmp_path: Path) -> None:  # noqa: FBT001
    log = compile_latex(equations_of(NETWORKS[name]()).document(values=values), tmp_path)
    assert max(overfull(log), default=0.0) < 10.0  # points: what sticks out is less than a letter and a half


@pytest.mark.slow
@compiles
@pytest.mark.parametrize("scene", ["excavator", "bldc-shaft"])
@pytest.mark.parametrize("values", [False, True])
def test_the_document_of_a_scene_with_long_laws_keeps_inside_its_margins(
    scene: str,
    values: bool,  # noqa: FBT001
    tmp_path: Path,
) -> None:
    log = compile_latex(SCENES[scene]().equations().document(values=values), tmp_path)
    assert max(overfull(log), default=0.0) < 10.0


@pytest.mark.slow
@compiles
def test_names_with_any_characters_compile(tmp_path: Path) -> None:
    net = NetworkBuilder(r"50% of {A} & B_1 \x ~^#$ ü ω 中 <|>")
    names = (
        "J_1",
        "50% load",
        "a&b",
        r"back\slash",
        "{brace}",
        "hash#",
        "dollar$",
        "hat^",
        "tilde~",
        "ü ω 中",
        "it's",
        "a-b",
    )
    for k, name in enumerate(names):
        net.add(Inertia(name, J=1.0), f"{name} node")
        if k:
            net.add(Spring(f"spring {name}", c=1.0, d=1.0), f"{names[k - 1]} node", f"{name} node")
    net.add(Spring("end", c=1.0), f"{names[-1]} node", "mass<less>_node")
    net.add(Damper("bearing", d=1.0), "mass<less>_node")
    compile_latex(equations_of(net).document(), tmp_path)


@pytest.mark.parametrize("name", NETWORKS)
def test_no_two_symbols_look_alike(name: str) -> None:
    printed = [*symbols(NETWORKS[name]()).values()]
    assert len(set(printed)) == len(printed)


def symbols(net: NetworkBuilder) -> dict[str, str]:
    names = equations_of(net).symbol_names
    return {name: re.sub("[\ue000\ue001]", "", latex) for name, latex in names.items()}


def test_a_part_named_like_its_parameter_has_its_number_as_subscript() -> None:
    names = symbols(crane())
    assert (names["J1.J"], names["J1.omega"]) == ("J_{1}", r"\omega_{1}")
    assert names["shaft.c"] == r"c_{\mathrm{shaft}}"
    assert names["shaft.tau_c"] == r"\tau_{c,\mathrm{shaft}}"
    assert names["motor.tau_k"] == r"\tau_{k,\mathrm{motor}}"


@pytest.mark.parametrize("armature", [{}, {"R": 0.3}, {"L": 1e-3}, {"R": 0.3, "L": 1e-3}])
def test_the_currents_of_a_machine_are_told_apart(armature: dict[str, float]) -> None:
    net = NetworkBuilder("machine")
    net.add(VoltageSource("supply", u=24.0), "s", "ground")
    net.add(Resistor("cable", R=0.1), "s", "p")
    net.add(DCMachine("M", k=0.05, **armature), "p", "ground", "rotor")
    net.add(Inertia("J", J=1e-3), "rotor")
    names = symbols(net)
    assert len({*names.values()}) == len(names)
    assert names["M.i_k"] == r"i_{k,\mathrm{M}}"


def test_a_chosen_subscript_is_printed() -> None:
    net = NetworkBuilder("chosen")
    net.add(Inertia("flywheel", J=1.0, symbol="f"), "a")
    net.add(TorqueSource("drive", tau=1.0, symbol="el"), "a")
    names = symbols(net)
    assert (names["flywheel.J"], names["drive.tau"]) == ("J_{f}", r"\tau_{\mathrm{el}}")


def test_parts_whose_subscripts_coincide_are_told_apart() -> None:
    net = NetworkBuilder("coincident")
    net.add(Inertia("J1", J=1.0), "a")
    net.add(Inertia("other", J=1.0, symbol="1"), "b")
    net.add(Spring("s1", c=1.0), "a", "b")
    net.add(Spring("k1", c=1.0), "b", "ground")
    names = symbols(net)
    assert (names["J1.J"], names["other.J"]) == ("J_{1}", r"J_{\mathrm{other}}")
    assert (names["s1.c"], names["k1.c"]) == ("c_{1}", r"c_{\mathrm{k},1}")


@pytest.mark.slow
def test_a_series_of_equal_rows_is_one_general_row() -> None:
    text = equations_of(train()).latex()
    general = r"J_{k} \, \frac{d \omega_{k}}{d t} &= \tau_{k-1} - \tau_{k} \qquad \text{for } k = 2, \dots, 49"
    assert general in text
    assert len(text.splitlines()) < 40
    assert max(map(printed_width, text.splitlines())) < 100


def test_a_row_that_differs_in_a_value_is_left_out_of_its_series() -> None:
    net = NetworkBuilder("values")
    for k in range(1, 9):
        net.add(Inertia(f"J{k}", J=0.5 if k == 4 else 1.5), f"n{k}")
        net.add(Damper(f"d{k}", d=2.0), f"n{k}")
    text = equations_of(net).latex(form="state", values=True)
    series, other = text.splitlines()[-3:-1]
    assert series.startswith(r"\frac{d \omega_{k}}{d t} &=")
    assert series.endswith(r"\text{for } k = 1, 2, 3, 5, \dots, 8 \\")
    assert other.startswith(r"\frac{d \omega_{4}}{d t} &=")


def test_a_general_row_stands_for_exactly_the_rows_that_it_replaces() -> None:
    whole = equations_of(train(9)).latex(form="kirchhoff")
    general = re.search(r"^(J_\{k\}.*?) \\qquad \\text\{for \} k = 2, \\dots, 8", whole, re.MULTILINE)
    assert general
    small = equations_of(train(5)).latex(form="kirchhoff")
    third = general[1].replace("k-1", "2").replace("{k}", "{3}")
    assert third in small


def test_central_differences_are_printed_as_in_the_source() -> None:
    """Popenda 2019, (20)-(23) without damping, C' = 1 / S'_c."""
    text = equations_of(shaft(CentralDifference(10, closure="printed"))).latex(form="state")
    machine, speed, torque = (
        rf"\frac{{d {letter}}}{{d t}} &= " for letter in (r"\omega_{\mathrm{e}}", r"\omega_{k}", r"\tau_{k}")
    )
    for line in (
        machine + r"\frac{1}{J_{\mathrm{e}}} \left( \tau_{\mathrm{motor}} - \tau_{1} \right)",
        speed
        + r"\frac{1}{2 \, J' \, \Delta x} \left( \tau_{k-1} - \tau_{k+1} \right) \qquad \text{for } k = 2, \dots, 8",
        torque
        + r"\frac{C'}{2 \, \Delta x} \left( \omega_{k-1} - \omega_{k+1} \right) \qquad \text{for } k = 2, \dots, 8",
        r"J' &= \rho \, I_{p}",
        r"C' &= G \, I_{p}",
        r"\Delta x &= \frac{L}{10}",
    ):
        assert text.count(line) == 1, line


def test_derived_quantities_have_values_units_and_one_definition() -> None:
    equations = equations_of(shaft(Lumped(5), damping=0.3))
    document = equations.document()
    assert document.count(r"C' &= G \, I_{p}") == 1
    assert r"$C'$ & stiffness of unit length & line & $1217.37$ & $\mathrm{N\,m^2/rad}$" in document
    assert r"\pi \, d^{4}" not in document.replace(r"I_{p} &= \frac{\pi \, d^{4}}{32}", "")
    numbers = equations.latex(values=True)
    assert "C'" not in numbers
    assert r"\frac{d \tau_{c,k}}{d t} &= 6086.84 \, \Delta \omega_{k}" in numbers


@pytest.mark.slow
@compiles
@pytest.mark.parametrize(
    "model", [Lumped(5), CentralDifference(6), CentralDifference(6, closure="printed"), Wave()], ids=repr
)
def test_a_document_about_a_shaft_keeps_inside_its_margins(model: ShaftModel, tmp_path: Path) -> None:
    damping = {} if isinstance(model, Wave) else {"damping": 0.3}
    log = compile_latex(equations_of(shaft(model, **damping)).document(), tmp_path)
    assert max(overfull(log), default=0.0) < 10.0


def test_values_replace_the_symbols_of_parameters() -> None:
    text = equations_of(crane()).latex(values=True)
    assert r"27.35 \, \frac{d \omega_{1}}{d t} &= \tau_{\mathrm{motor}} - \tau_{\mathrm{shaft}}" in text
    assert "c_{" not in text.replace(r"\tau_{c,", "")


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (24206.0, "24206"),
        (0.1, "0.1"),
        (1 / 3, "0.333333"),
        (7.75e10, r"7.75 \cdot 10^{10}"),
        (1e-5, r"1 \cdot 10^{-5}"),
    ],
)
def test_numbers_have_sensible_digits(value: float, text: str) -> None:
    assert printed_number(value) == text


def test_a_long_row_is_broken_before_a_term() -> None:
    net = NetworkBuilder("star")
    net.add(Inertia("hub", J=1.0), "hub")
    for name in "abcdefgh":
        net.add(Spring(f"spoke_{name}", c=1.0, d=1.0), "hub", f"rim_{name}")
        net.add(Inertia(f"rim_{name}", J=1.0), f"rim_{name}")
    text = equations_of(net).latex(form="state")
    hub = text.split(r"\frac{d \omega_{\mathrm{rim")[0]
    assert hub.count(r"\\") >= 3
    assert hub.count(r"\biggl") == hub.count(r"\biggr") == 1
    assert all(re.match(r"&\\quad [+-] ", row) for row in hub.splitlines() if row.startswith(r"&\quad"))


def test_a_case_that_is_a_long_sum_has_all_its_terms_in_rows_of_limited_width() -> None:
    net = NetworkBuilder("pieces")
    angles = [3 * k * t for k in range(2, 10)]
    net.add(TorqueSource("m", tau=Piecewise((Add(*map(sin, angles)), t < 1), (0, True))), "a")
    net.add(Inertia("J", J=1.0), "a")
    text = equations_of(net).latex("kirchhoff")
    (case,) = re.findall(r"\\begin\{array\}\{@\{\}l@\{\}\} (.*?) \\end\{array\}", text)
    rows = case.split(r" \\ ")
    assert len(rows) > 1
    assert all(row.startswith("+ ") for row in rows[1:])
    assert all(printed_width(row) <= WIDEST_CASE + 2 for row in rows)  # the sign before a row has a width of its own
    assert [int(n) for n in re.findall(r"(\d+) \\, t", case)] == list(range(6, 30, 3))


@pytest.mark.slow
@pytest.mark.parametrize("name", NETWORKS)
@pytest.mark.parametrize("form", ["kirchhoff", "state", "second-order"])
def test_every_form_of_every_network_is_balanced(name: str, form: str) -> None:
    equations = equations_of(NETWORKS[name]())
    if form == "second-order" and name == "dc drive":
        with pytest.raises(CompileError, match="electrical"):
            equations.latex(form=form)
        return
    text = equations.latex(form=form)  # type: ignore[arg-type]
    assert text.count(r"\begin{align*}") == text.count(r"\end{align*}") > 0
    assert text.count("{") == text.count("}")
    assert text.count(r"\left") == text.count(r"\right")
    assert not re.search("[\ue000-\ue003]", text)


def test_no_other_form_is_taken() -> None:
    with pytest.raises(ShaftworkError, match="take 'kirchhoff', 'state', 'second-order' or 'field'"):
        equations_of(crane()).latex(form="lagrange")  # type: ignore[arg-type]


def test_a_notebook_shows_headings_and_equations() -> None:
    shown = equations_of(crane())._repr_latex_()
    assert shown.startswith(r"$\textbf{Balance of torques at the nodes}$")
    assert r"\paragraph" not in shown


def test_a_coefficient_that_is_a_sum_keeps_its_brackets() -> None:
    text = equations_of(hoist()).latex(form="state")
    assert re.search(
        r"\\left\(J_\{\\mathrm\{m\}\} \+ .*\\right\) \\, \\frac\{d \\omega_\{\\mathrm\{m\}\}\}\{d t\}", text
    )


@pytest.mark.slow
def test_the_same_network_prints_the_same_bytes_in_another_process() -> None:
    code = (
        "from tests.equations.networks import *;"
        "print(*(equations_of(make()).document() for make in (crane, hoist, dc_drive, mixed_train, train)))"
    )
    printed = [
        subprocess.run(
            [sys.executable, "-c", code],
            cwd=ROOT,
            capture_output=True,
            check=True,
            env={"PYTHONHASHSEED": seed, "PYTHONPATH": f"{ROOT / 'src'}:{ROOT}", "PATH": ""},
        ).stdout
        for seed in ("1", "2")
    ]
    assert printed[0] == printed[1]
    assert len(printed[0]) > 10_000


def test_a_parameter_that_looks_like_a_variable_gets_a_subscript(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(base, "REGISTRY", {})  # leaves the library's own list of components alone

    @base.component
    class Preloaded(base.Component):
        """A torque that is not what it is called."""

        tau: float = parameter("N*m", "preload", latex=r"\tau")

        ports = (base.Port("a"),)

        def branches(self, p: Any) -> Iterator[Branch]:
            yield ThroughLaw(-2 * p.tau)

    net = NetworkBuilder("preloaded")
    net.add(Inertia("J", J=1.0), "a")
    net.add(Preloaded("p", tau=3.0), "a")
    names = symbols(net)
    assert (names["p.tau"], names["tau(p)"]) == (r"\tau_{0,\mathrm{p}}", r"\tau_{\mathrm{p}}")


@pytest.mark.slow
@compiles
@pytest.mark.parametrize("name", ["crane", "50 parts", "dc drive"])
def test_a_document_is_right_after_one_run(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")  # a PDF holds the time of the run
    source = equations_of(NETWORKS[name]()).document()
    log = compile_latex(source, tmp_path)
    once = (tmp_path / "report.pdf").read_bytes()
    assert "Rerun" not in log
    compile_latex(source, tmp_path)
    assert (tmp_path / "report.pdf").read_bytes() == once


def test_a_law_is_printed_once_below_the_balances() -> None:
    equations = equations_of(crane())
    law = r"\tau_{\mathrm{motor}} &="
    assert equations.latex().count(law) == equations.latex(form="state").count(law) == 1
    kirchhoff, state = equations.document().split(r"\section{State form}")
    assert kirchhoff.count(law) == 1
    assert law not in state.partition(r"\section{Second-order form}")[0]


def test_a_document_leaves_out_a_form_that_there_is_not_and_says_why_once() -> None:
    equations = equations_of(dc_drive())
    with pytest.raises(CompileError, match="electrical nodes"):
        equations.latex(form="second-order")
    with pytest.raises(CompileError, match="electrical nodes"):
        equations.document(form="second-order")
    text = equations.document(title="A drive")
    assert r"\section{Second-order form}" not in text
    assert text.count("There is no second-order form: the network has electrical nodes.") == 1
    assert r"\title{A drive}" in text


def test_a_nomenclature_names_the_parameter_and_a_remark_has_names_as_text() -> None:
    net = NetworkBuilder("stop")
    net.add(Inertia("J", J=50.0), "a")
    net.add(Brake("brake", tau=1e4), "a")
    net.add(Conveyor("belt", m=1000.0, radius=0.5, friction=0.3, incline=0.35), "a")
    text = equations_of(net).document()
    for row in (r"$r_{\mathrm{belt}}$ & radius of the drum &", r"$\delta_{\mathrm{belt}}$ & incline of the belt &"):
        assert row in text
    remarks = text.partition(r"\section{Remarks}")[2]
    assert r"brake.t\_rise, brake.t\_lag, belt.d" in remarks


@pytest.mark.parametrize("arguments", [(), (0,), (1,)])
def test_a_unit_step_is_printed_as_one(arguments: tuple[int, ...]) -> None:
    net = NetworkBuilder("step")
    net.add(Inertia("J", J=1.0), "a")
    net.add(TorqueSource("T", tau=3 * Heaviside(omega, *arguments) ** 2), "a")
    text = equations_of(net).latex(form="kirchhoff")
    assert r"\mathrm{H}\left(\omega_{\mathrm{J}}\right)" in text
    assert "theta" not in text


def test_a_factor_of_two_terms_stands_before_their_bracket() -> None:
    """As textbooks print Newton's law of an inertia between a motor and a shaft."""
    net = NetworkBuilder("pair")
    net.add(TorqueSource("motor", tau=omega - 1, symbol="M"), "a")
    net.add(Inertia("J1", J=1.0), "a")
    net.add(Spring("shaft", c=5.0, symbol="sh"), "a", "b")
    net.add(Inertia("J2", J=2.0), "b")
    text = re.sub(r" +", " ", equations_of(net).latex(form="state"))
    assert r"&= \frac{1}{J_{1}} \left( \tau_{M} - \tau_{\mathrm{sh}} \right)" in text


@pytest.mark.parametrize(
    ("J", "printed"),
    [(0.5, r"2 \left( \tau_{M} - \tau_{\mathrm{sh}} \right)"), (1.0, r"\tau_{M} - \tau_{\mathrm{sh}}")],
)
def test_a_factor_in_numbers_stands_before_the_bracket_unless_it_is_one(J: float, printed: str) -> None:
    net = NetworkBuilder("pair")
    net.add(TorqueSource("motor", tau=omega - 1, symbol="M"), "a")
    net.add(Inertia("J1", J=J), "a")
    net.add(Spring("shaft", c=5.0, symbol="sh"), "a", "b")
    net.add(Inertia("J2", J=2.0), "b")
    text = re.sub(r" +", " ", equations_of(net).latex(form="state", values=True))
    assert rf"\frac{{d \omega_{{1}}}}{{d t}} &= {printed} \\" in text
