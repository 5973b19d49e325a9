"""The right-hand side as text in four languages, and as machine code: the same numbers as `rhs`."""

from __future__ import annotations

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy
from numpy.typing import NDArray

import shaftwork as sw
from shaftwork.components.shaft_models import ShaftModel
from shaftwork.core.errors import CompileError, MissingExtraError, ParameterError
from shaftwork.scenes import SCENES

Array = NDArray[np.float64]
STEEL = {"length": 1.0, "diameter": 0.02, "density": 7900.0, "shear_modulus": 77.5e9}
CLOSE = 1e-12
"""Of the largest term in a sum: coefficients are rounded in another order."""


def shaft(model: ShaftModel) -> sw.Network:
    net = sw.Network("shaft")
    net.add(sw.TorqueSource("motor", tau=10 * sympy.sin(3 * sw.t)), "a")
    net.add(sw.Inertia("Je", J=0.025), "a")
    net.add(sw.Shaft("line", **STEEL, damping=0.1, friction=0.2, model=model), "a", "b")
    net.add(sw.Inertia("Jm", J=0.11), "b")
    net.add(sw.TorqueSource("load", tau=-0.1 * sw.omega**2 - sympy.sign(sw.omega)), "b")
    return net


def crane() -> Any:
    return SCENES["crane"].build().compile().phase("brake slipping forward, load slipping forward")


MODELS: dict[str, Callable[[], Any]] = {
    "lumped": lambda: shaft(sw.Lumped(9)).compile(),
    "central differences": lambda: shaft(sw.CentralDifference(9)).compile(),
    "the paper's": lambda: shaft(sw.CentralDifference(9, form="paper")).compile(),
    "long": lambda: shaft(sw.Lumped(90)).compile(),
    "crane": crane,
}


def numpy_text(model: Any) -> Callable[[float, Array, Array], Array]:
    names: dict[str, Any] = {}
    exec(model.source("numpy"), names)  # noqa: S102 (what is tested)
    return names["rhs"]  # type: ignore[no-any-return]


def c_text(model: Any, folder: Path) -> Callable[[float, Array, Array], Array]:
    (folder / "rhs.c").write_text(model.source("c"), encoding="utf-8")
    command = ["gcc", "-std=c99", "-O3", "-Wall", "-Werror", "-shared", "-fPIC", "-o", "rhs.so", "rhs.c", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    function = ctypes.CDLL(str(folder / "rhs.so")).rhs
    doubles = np.ctypeslib.ndpointer(dtype=float, flags="C_CONTIGUOUS")
    function.argtypes, function.restype = [ctypes.c_double, doubles, doubles, doubles], None

    def rhs(t: float, x: Array, p: Array) -> Array:
        rates = np.empty(len(x))
        function(t, x, p, rates)
        return rates

    return rhs


def sympy_text(model: Any) -> Callable[[float, Array, Array], Array]:
    names: dict[str, Any] = {}
    exec(model.source("sympy"), names)  # noqa: S102 (what is tested)
    function = sympy.lambdify([names["t"], names["x"], names["p"]], names["rates"])
    return lambda t, x, p: np.array(function(t, x, p), dtype=float)


def agree(model: Any, function: Callable[[float, Array, Array], Array]) -> None:
    rng = np.random.default_rng(1)
    for _ in range(3):
        x = rng.uniform(0.5, 2.0, len(model.states))
        p = model.defaults * rng.uniform(0.9, 1.1, len(model.defaults))
        expected = model.rhs(0.7, x, p)
        size = np.abs(expected).max()
        np.testing.assert_allclose(function(0.7, x, p), expected, rtol=CLOSE, atol=100 * CLOSE * size)


@pytest.mark.parametrize("name", MODELS)
def test_the_text_for_numpy_gives_the_rates(name: str) -> None:
    model = MODELS[name]()
    agree(model, numpy_text(model))


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
@pytest.mark.parametrize("name", MODELS)
def test_the_text_for_c_gives_the_rates(name: str, tmp_path: Path) -> None:
    model = MODELS[name]()
    agree(model, c_text(model, tmp_path))


@pytest.mark.parametrize("name", [name for name in MODELS if name != "long"])
def test_the_text_for_sympy_gives_the_rates(name: str) -> None:
    model = MODELS[name]()
    agree(model, sympy_text(model))


@pytest.mark.parametrize("name", MODELS)
def test_machine_code_gives_the_rates(name: str) -> None:
    agree(MODELS[name](), MODELS[name]().compiled())


def test_the_right_hand_side_is_machine_code_once_this_is_made() -> None:
    plain, made = (MODELS["long"]() for _ in range(2))
    made.compiled()
    rng = np.random.default_rng(0)
    for _ in range(3):
        x, p = rng.standard_normal(len(plain.states)), plain.defaults * rng.uniform(0.5, 2.0, len(plain.defaults))
        expected = plain.rhs(0, x, p)
        np.testing.assert_allclose(made.rhs(0, x, p), expected, rtol=1e-9, atol=1e-12 * np.abs(expected).max())
    with pytest.raises(sw.ParameterError, match=r"give .* numbers, one for each state"):
        made.rhs(0.0, np.zeros(3))


@pytest.mark.parametrize(
    "x", [np.zeros(2), np.zeros((3, 1)), np.zeros(3, dtype=int), np.zeros(3, dtype=np.float32)], ids=str
)
def test_machine_code_refuses_arrays_that_it_would_read_beyond_or_cut_off(x: Any) -> None:
    net = sw.Network("two")
    net.add(sw.Inertia("a", J=1.0), "a")
    net.add(sw.Spring("s", c=2.0), "a", "b")
    net.add(sw.Inertia("b", J=1.0), "b")
    model = net.compile()
    made, p = model.compiled(), np.array(model.defaults)
    for arguments in ((x, p), (np.zeros(3), p[:1])):
        with pytest.raises(sw.ParameterError, match=r"give 3 states and 3 parameters of float64"):
            made(0.0, *arguments)


@pytest.mark.parametrize("x", [["a"] * 3, {"a.omega": 1.0}, np.array([1j, 0, 0])], ids=repr)
def test_states_that_are_no_real_numbers_are_refused(x: Any) -> None:
    net = sw.Network("two")
    net.add(sw.Inertia("a", J=1.0), "a")
    net.add(sw.Spring("s", c=2.0), "a", "b")
    net.add(sw.Inertia("b", J=1.0), "b")
    with pytest.raises(sw.ParameterError, match="must be 3 real numbers, one for each state"):
        net.compile().rhs(0.0, x)


def inertia(law: Any) -> Any:
    net = sw.Network("one inertia")
    net.add(sw.TorqueSource("motor", tau=law), "a")
    net.add(sw.Inertia("J", J=0.1), "a")
    return net.compile()


LAWS: dict[str, Any] = {
    "pieces of one slope": sympy.Piecewise((1, sw.omega > 0.4), (-1, True)),
    "linear pieces": sympy.Piecewise((2 * sw.omega + 1, sw.omega > 0.4), (2 * sw.omega - 3, True)),
    "the largest": sympy.Max(sw.omega, 0.5) - sympy.Min(sw.omega, 0.3, sw.t),
    "a cube root": sw.omega ** sympy.Rational(1, 3),
    "numbers with names": sympy.GoldenRatio * sympy.E * sympy.pi * sw.omega,
    "steps": sympy.Heaviside(sw.omega - 0.4) + sympy.sign(sw.omega - 0.6),
    "logic": sympy.Piecewise((1, (sw.omega > 0.2) & (sw.t < 1)), (2 * sw.omega, sw.omega < 0.1), (3, True)),
}


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
@pytest.mark.parametrize("law", LAWS)
def test_laws_have_one_value_in_all_languages(law: str, tmp_path: Path) -> None:
    model = inertia(LAWS[law])
    functions = (numpy_text(model), c_text(model, tmp_path), sympy_text(model), inertia(LAWS[law]).compiled())
    for speed in (0.05, 0.3, 0.5, 0.9):
        x = np.array([speed])
        expected = model.rhs(0.7, x)
        for function in functions:
            np.testing.assert_allclose(function(0.7, x, model.defaults), expected, rtol=1e-14)


def test_parts_whose_pieces_are_parameters_have_a_text() -> None:
    net = sw.Network("drive")
    net.add(sw.FrequencyDrive("drive", tau_k=50.0, s_k=0.2, n_sync=1500.0), "a")
    net.add(sw.Inertia("J", J=0.1), "a")
    model = net.compile()
    x = np.array([3.0])
    np.testing.assert_allclose(numpy_text(model)(0.1, x, model.defaults), model.rhs(0.1, x), rtol=1e-14)


def test_a_network_without_states_has_no_rates() -> None:
    net = sw.Network("still")
    net.add(sw.SpeedSource("source", omega=3.0), "a")
    net.add(sw.Damper("damper", d=10.0), "a")
    model = net.compile()
    assert model.compiled()(0.0, np.empty(0), np.array(model.defaults)).shape == (0,)


def test_the_text_of_a_long_shaft_is_no_longer_than_that_of_a_short_one() -> None:
    short, long = (shaft(sw.Lumped(m)).compile().source("c") for m in (10, 200))
    assert short.count("\n") == long.count("\n")
    assert "for (int i = 1; i < 200; i++)" in long


@pytest.mark.parametrize("name", MODELS)
def test_rates_of_many_states_are_those_of_each(name: str) -> None:
    model = MODELS[name]()
    many = np.random.default_rng(2).uniform(0.5, 2.0, (len(model.states), 4))
    times = np.array([0.1, 0.2, 0.3, 0.4])
    expected = np.stack([model.rhs(t, x) for t, x in zip(times, many.T, strict=True)], axis=1)
    size = np.abs(expected).max()
    np.testing.assert_allclose(model.rhs(times, many), expected, rtol=CLOSE, atol=CLOSE * size)
    np.testing.assert_allclose(model.rhs(0.1, many)[:, 0], expected[:, 0], rtol=CLOSE, atol=CLOSE * size)
    np.testing.assert_allclose(
        numpy_text(model)(0.1, many, model.defaults)[:, 0], expected[:, 0], rtol=1e-9, atol=1e-10 * size
    )


def test_states_of_another_number_are_refused() -> None:
    model = MODELS["lumped"]()
    with pytest.raises(ParameterError, match="x has the shape"):
        model.rhs(0.0, np.zeros((3, 2)))
    assert model.rhs(0.0, np.zeros((len(model.states), 0))).shape == (len(model.states), 0)
    with pytest.raises(ParameterError, match="t has the shape"):
        model.rhs(np.zeros(3), np.zeros((len(model.states), 2)))


def test_what_has_no_text_is_said() -> None:
    model = MODELS["lumped"]()
    with pytest.raises(ParameterError, match="no source in 'fortran'"):
        model.source("fortran")
    with pytest.raises(CompileError, match="travelling waves"):
        shaft_of_waves().compile().source()
    net = sw.Network("table")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.TorqueSource("motor", tau=sw.Table([0.0, 1.0], [0.0, 1.0])), "a")
    with pytest.raises(CompileError, match="a table or noise"):
        net.compile().source("c")
    with pytest.raises(CompileError, match="each phase has equations of its own"):
        SCENES["crane"].build().compile().source()


def shaft_of_waves() -> sw.Network:
    net = sw.Network("waves")
    net.add(sw.Inertia("Je", J=0.025), "a")
    net.add(sw.Shaft("line", **STEEL, model=sw.Wave()), "a", "b")
    net.add(sw.Inertia("Jm", J=0.11), "b")
    return net


def test_without_numba_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    model = MODELS["lumped"]()
    monkeypatch.setattr("shaftwork.codegen.compiled_model.find_spec", lambda _name: None)
    with pytest.raises(MissingExtraError, match=r"numba.*shaftwork\[fast\]"):
        model.compiled()
