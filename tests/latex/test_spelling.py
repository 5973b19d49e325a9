"""Names of any kind are printed as they are read, and do nothing but print."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from shaftwork.components.mechanics import Inertia, Spring
from shaftwork.equations.spelling import ACCENTED, chosen_subscript, escaped, in_text
from shaftwork.network.netlist import NetworkBuilder
from tests.equations.networks import equations_of
from tests.latex.test_equations_in_print import compile_latex, compiles, overfull, symbols

HOSTILE = (
    r"1}\input{/etc/passwd}{",
    r"\mathrm{a}\def\x{\x}\x",
    r"\write18{true}",
    r"\alphabet",
    r"\mathrm{\input{x}}",
    "^^5cinput",
    "a_b_c",
    "'²'²³",
    "%",
    "}",
    "$$",
    "\n\n",
    "",
)


@pytest.mark.parametrize(
    ("chosen", "printed"),
    [
        ("1", "1"),
        ("f", "f"),
        ("el", r"\mathrm{el}"),
        ("rotor,1", r"\mathrm{rotor},1"),
        (r"\alpha", r"\alpha "),
        (r"\alpha1'", r"\alpha 1'"),
        (r"\alpha 1'", r"\alpha 1'"),
        (r"\mathrm{in},\varphi", r"\mathrm{in},\varphi "),
        ("ω", r"\omega "),
        ("ü", r"\text{ü}"),
    ],
)
def test_a_chosen_subscript_may_hold_letters_digits_commas_primes_and_greek(chosen: str, printed: str) -> None:
    assert chosen_subscript(chosen) == printed


@pytest.mark.parametrize("chosen", HOSTILE)
def test_no_other_control_word_of_a_chosen_subscript_is_one_in_print(chosen: str) -> None:
    printed = chosen_subscript(chosen)
    for word in ("input", "def", "write", "alphabet", "x"):
        assert f"\\{word}" not in printed
    assert "^^" not in printed


@given(text=st.text())
def test_braces_and_comments_of_any_text_are_escaped(text: str) -> None:
    for printed in (escaped(text), chosen_subscript(text), in_text(text)):
        bare = printed.replace(r"\{", "").replace(r"\}", "")
        depths = [bare[:place].count("{") - bare[:place].count("}") for place in range(len(bare) + 1)]
        assert min(depths) == depths[-1] == 0
        assert "%" not in printed.replace(r"\%", "")


@compiles
def test_chosen_subscripts_of_a_stranger_compile(tmp_path: Path) -> None:
    net = NetworkBuilder("hostile")
    for k, chosen in enumerate(HOSTILE):
        net.add(Inertia(f"J{k}", J=1.0, symbol=chosen), f"n{k}")
        net.add(Spring(f"shaft {chosen} {k}", c=1.0, symbol=chosen), f"n{k}", "ground")
    compile_latex(equations_of(net).document(), tmp_path)


@pytest.mark.parametrize(
    ("name", "printed"),
    [
        ("größe", r"gr\text{öß}e"),
        ("Räder", r"R\text{ä}der"),
        ("Ra\u0308der", r"R\text{ä}der"),
        ("Łódź", r"\text{Łó}d\text{ź}"),
        ("ω²", r"\omega {^{2}}"),
        ("v₂", "v2"),
        ("Ω Δ", r"\Omega \ \Delta "),
        ("λ", r"\lambda "),
        ("ạ", "a"),
        ("90°", r"90{^{\circ}}"),
    ],
)
def test_letters_of_european_languages_are_kept(name: str, printed: str) -> None:
    assert escaped(name) == printed


@pytest.mark.slow
@compiles
def test_every_accented_letter_that_is_printed_as_it_is_compiles(tmp_path: Path) -> None:
    letters = re.findall(f"[{ACCENTED}]", "".join(map(chr, range(0xC0, 0x250))))
    assert len(letters) > 150
    net = NetworkBuilder("".join(letters))
    for k, letter in enumerate(letters):
        net.add(Inertia(f"{letter}x{k}", J=1.0), f"n{k}")
        net.add(Spring(f"{letter}s{k}", c=1.0), f"n{k}", "ground")
    compile_latex(equations_of(net).document(), tmp_path)


@pytest.mark.parametrize(
    ("name", "printed"),
    [
        ("J_rotor", r"J_{\mathrm{rotor}}"),
        ("J_rotor_2", r"J_{\mathrm{rotor},2}"),
        ("J_1", "J_{1}"),
        ("alpha_1", r"J_{\mathrm{alpha},1}"),
        ("n_1", "J_{1}"),
        ("fan_wheel", r"J_{\mathrm{fan\_wheel}}"),
        ("größe", r"J_{\mathrm{gr\text{öß}e}}"),
    ],
)
def test_a_name_in_parts_is_a_subscript_in_parts(name: str, printed: str) -> None:
    net = NetworkBuilder("one")
    net.add(Inertia(name, J=1.0), "a")
    assert symbols(net)[f"{name}.J"] == printed


def test_names_that_differ_by_an_underscore_are_told_apart() -> None:
    net = NetworkBuilder("two")
    net.add(Inertia("alpha1", J=1.0), "a")
    net.add(Inertia("alpha_1", J=1.0), "b")
    names = symbols(net)
    assert (names["alpha1.J"], names["alpha_1.J"]) == (r"J_{\mathrm{alpha},1}", r"J_{\mathrm{alpha\_}1}")


def test_a_number_may_be_chosen_as_a_subscript() -> None:
    net = NetworkBuilder("number")
    net.add(Inertia("flywheel", J=1.0, symbol=1), "a")  # type: ignore[arg-type]
    assert symbols(net)["flywheel.J"] == "J_{1}"


@compiles
def test_a_long_name_in_parts_keeps_inside_its_column(tmp_path: Path) -> None:
    net = NetworkBuilder("long")
    net.add(Inertia("wheel_of_the_large_fan_12", J=1.0, symbol="f"), "a")
    log = compile_latex(equations_of(net).document(), tmp_path)
    assert max(overfull(log), default=0.0) < 1.0  # points


@pytest.mark.parametrize(
    ("name", "printed"),
    [
        ("a_b", r"a\_b"),
        ("it's 'q'", r"it's \textquotesingle{}q\textquotesingle{}"),
        ("a--b,,c", "a-{}-b,{},c"),
        ("[3] *", "{}[3] *"),
        (r"C:\x", r"C:\textbackslash{}x"),
        ("ω²", r"$\omega$²"),
        ("中", "中"),
        ("\ue000a\x00\n", "U+E000aU+0000 "),
    ],
)
def test_names_outside_formulas_are_text(name: str, printed: str) -> None:
    assert in_text(name) == printed


@compiles
def test_a_document_says_what_pdflatex_prints_in_place_of_letters_that_it_lacks(tmp_path: Path) -> None:
    net = NetworkBuilder("中 ạ λ")
    net.add(Inertia("心", J=1.0), "n")
    net.add(Spring("轴 ω⁴", c=1.0), "n", "ground")
    document = equations_of(net).document()
    for line in (r"\DeclareUnicodeCharacter{4E2D}{[U+4E2D]}", r"\DeclareUnicodeCharacter{1EA1}{a}"):
        assert line in document
    compile_latex(document, tmp_path)
