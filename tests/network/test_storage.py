"""Networks in text files: the round trip is exact, and what cannot be read is named."""

from __future__ import annotations

from pathlib import Path

import pytest
import sympy
from hypothesis import given
from hypothesis import strategies as st

import shaftwork as sw
from tests.reference.mna import Piece
from tests.strategies import networks


def network_of(pieces: tuple[Piece, ...]) -> sw.Network:
    net = sw.Network("random")
    for piece in pieces:
        net.add(getattr(sw, piece.type)(piece.name, **piece.values), *piece.nodes)
    return net


@given(networks(max_inertias=6))
def test_a_loaded_network_is_the_saved_one(tmp_path_factory: pytest.TempPathFactory, pieces: tuple) -> None:
    net = network_of(pieces)
    path = tmp_path_factory.mktemp("models") / "net.toml"
    net.save(path)
    loaded = sw.Network.load(path)
    assert loaded.netlist() == net.netlist()
    loaded.save(path.with_name("again.toml"))
    assert path.with_name("again.toml").read_bytes() == path.read_bytes()


@pytest.mark.parametrize(
    "law",
    [
        -22.4 * sympy.tanh(sw.omega / 0.01),
        sw.Step(10.0, start=0.1) * sympy.sin(3 * sw.t),
        sw.Table([0.0, 1.0], [0.0, 5.0])(sw.omega),
        sympy.Piecewise((1.0, sw.phi < 0.25), (sympy.Rational(1, 3) * sw.omega**2, True)),
    ],
)
def test_laws_come_back_as_the_same_expressions(law: sympy.Expr, tmp_path: Path) -> None:
    net = sw.Network("law")
    net.add(sw.Inertia("J", J=0.1), "a")
    net.add(sw.TorqueSource("T", tau=law, symbol="e"), "a")
    net.save(tmp_path / "law.toml")
    loaded = sw.Network.load(tmp_path / "law.toml")
    assert loaded.netlist() == net.netlist()
    assert loaded.parts[1].symbol == "e"


def test_tables_and_defaults_come_back(tmp_path: Path) -> None:
    net = sw.Network("table")
    net.add(sw.Inertia("J", J=0.1), "a")
    net.add(sw.TorqueSource("T", tau=sw.Table([0, 1, 2], [0, 5, 0])), "a")
    net.add(sw.CoulombLoad("load", tau=1.0), "a")
    net.save(tmp_path / "table.toml")
    text = (tmp_path / "table.toml").read_text(encoding="utf-8")
    assert "omega_s" not in text  # a default is not written
    assert sw.Network.load(tmp_path / "table.toml").netlist() == net.netlist()


def written(tmp_path: Path, part: str) -> Path:
    path = tmp_path / "model.toml"
    path.write_text(f'format = 1\nname = "m"\n\n[[part]]\n{part}\n', encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("part", "words"),
    [
        ('type = "Inertiaa"\nname = "J"\nnodes = ["a"]\nJ = 1.0', "Inertia"),
        ('type = "Inertia"\nname = "J"\nnodes = ["a"]\nj = 1.0', "moment of inertia"),
        ('type = "Inertia"\nname = "J"\nnodes = ["a"]\nJ = "2*t"', "must be a number"),
        ('type = "TorqueSource"\nname = "T"\nnodes = ["a"]\ntau = "sine(t)"', "sin"),
        ('type = "TorqueSource"\nname = "T"\nnodes = ["a"]\ntau = "__import__(\'os\')"', "T"),
    ],
)
def test_what_cannot_be_read_is_named_with_what_would_be_right(part: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(sw.ModelFileError, match=words) as caught:
        sw.Network.load(written(tmp_path, part))
    assert "model.toml" in str(caught.value)


def test_endless_laws_are_refused_before_they_are_read(tmp_path: Path) -> None:
    law = "+".join(["sin(t)"] * 100)
    parts = "".join(
        f'\n[[part]]\ntype = "TorqueSource"\nname = "T{k}"\nnodes = ["a"]\ntau = "{law}"\n' for k in range(50)
    )
    path = tmp_path / "laws.toml"
    path.write_text(f'format = 1\nname = "m"\n{parts}', encoding="utf-8")
    with pytest.raises(sw.ModelFileError, match="words together"):
        sw.Network.load(path)


def test_a_part_that_has_no_text_form_is_named(tmp_path: Path) -> None:
    net = sw.Network("m")
    net.add(sw.Inertia("J", J=float("nan")), "a")
    with pytest.raises(sw.ModelFileError, match="'J': J must be a finite number"):
        net.save(tmp_path / "m.toml")


@given(st.text(max_size=200))
def test_no_text_runs_or_crashes(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    path = tmp_path_factory.mktemp("models") / "any.toml"
    path.write_bytes(text.encode("utf-8", "surrogatepass"))
    with pytest.raises(sw.ModelFileError):
        sw.Network.load(path)
