"""A sweep on a device of JAX, here the processor itself: the measures of the lanes in machine code."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.components.noise import HeldNoise, held
from shaftwork.components.tables import Interpolation
from shaftwork.studies import Sweep, sweep

pytest.importorskip("numba")
jax = pytest.importorskip("jax")
CPU = jax.devices("cpu")[0]


def has_gpu() -> bool:
    try:
        return bool(jax.devices("gpu"))
    except RuntimeError:
        return False


def samples(count: int, **sizes: float) -> dict[str, np.ndarray]:
    random = np.random.default_rng(5)
    return {name.replace("_", "."): size * random.uniform(0.7, 1.3, count) for name, size in sizes.items()}


CRANE: dict[str, Any] = {
    "samples": samples(20, shaft_c=24206.0, shaft_d=14.0),
    "t_end": 6.5,
    "measures": ["max shaft.tau", "min motor.tau", "peak shaft.tau", "mean J2.omega", "rms shaft.tau", "end J2.omega"],
}


def agree(one: Sweep, other: Sweep, tolerance: float) -> None:
    """To a part of the largest value of each measure."""
    for name, values in one.measures.items():
        size = max(np.abs(values).max(), 1e-3)
        np.testing.assert_allclose(other.measures[name], values, rtol=0, atol=tolerance * size, err_msg=name)


@pytest.fixture(scope="module")
def crane() -> Sweep:
    return sweep(sw.scenes.crane_start(), **CRANE)


def train(seed: int) -> sw.Network:
    """A chain of random inertias, springs, dampers and a gear, driven by a sine, a table of the speed and steps."""
    random, net = np.random.default_rng(seed), sw.Network(f"train {seed}")
    t, law = sw.t, 20 * sympy.sin(random.uniform(3, 30) * sw.t) * sympy.exp(-sw.t)
    law += 5 * sympy.Heaviside(t - random.uniform(0.2, 0.8)) + 3 * sympy.tanh(2 - sw.omega)
    net.add(sw.TorqueSource("motor", tau=law), "n0")
    count = int(random.integers(2, 5))
    for k in range(count):
        net.add(sw.Inertia(f"J{k}", J=random.uniform(0.5, 5.0)), f"n{k}")
        if k:
            net.add(sw.Spring(f"c{k}", c=10 ** random.uniform(2, 4), d=random.uniform(0, 3)), f"n{k - 1}", f"n{k}")
    net.add(sw.Damper("load", d=random.uniform(0.1, 2.0)), f"n{count - 1}")
    if seed % 2:
        net.add(sw.Backlash("gap", gap=0.05, c=500.0, d=1.0), "n0", "behind")
        net.add(sw.Inertia("loose", J=0.5), "behind")
        net.add(sw.DryFriction("friction", tau_c=random.uniform(1.0, 4.0)), f"n{count - 1}")
    return net


@pytest.mark.slow
@pytest.mark.parametrize("seed", [11, 12])
def test_random_trains_agree_with_the_lanes_in_machine_code(seed: int) -> None:
    """Both have the same steps up to rounding: 1e-8 is the tolerance that was asked for."""
    call: dict[str, Any] = {
        "samples": samples(16, J0_J=2.0, J1_J=3.0),
        "t_end": 1.5,
        "measures": [f"{kind} c1.tau" for kind in ("max", "min", "peak", "mean", "rms", "end")],
    }
    one, other = sweep(train(seed), **call), sweep(train(seed), on=CPU, **call)
    assert one.why == other.why
    assert other.errors == {}
    agree(one, other, 1e-8)


@pytest.mark.slow
def test_the_crane_and_what_single_precision_costs(crane: Sweep) -> None:
    net, few = sw.scenes.crane_start(), {name: column[:16] for name, column in CRANE["samples"].items()}
    double = sweep(net, on=CPU, **CRANE)
    assert double.why == ""
    agree(crane, double, 1e-8)
    alone = sweep(net, on=CPU, **{**CRANE, "samples": few})
    for name, values in alone.measures.items():  # those beside a variant change no bit
        assert values.tobytes() == double.measures[name][:16].tobytes()
    single = sweep(net, on=CPU, precision="single", **CRANE)
    assert set(single.errors) == set(CRANE["measures"])
    assert 0.0 < max(single.errors.values()) < 1e-4  # a thousand rounding units
    assert "off by single precision: max shaft.tau" in str(single.best("end J2.omega", 2))
    agree(crane, single, 10 * max(single.errors.values()))


@pytest.mark.skipif(not has_gpu(), reason="there is no graphics processor")
def test_the_crane_on_a_graphics_processor(crane: Sweep) -> None:
    agree(crane, sweep(sw.scenes.crane_start(), on="gpu", **CRANE), 1e-8)
    single = sweep(sw.scenes.crane_start(), on="gpu", precision="single", **CRANE)
    agree(crane, single, 10 * max(single.errors.values()))


@pytest.mark.slow
@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_functions_are_those_of_numpy(kind: Any) -> None:
    from shaftwork.codegen.machine_program import Terms
    from shaftwork.codegen.taylor.heyoka_parameters import Fixed
    from shaftwork.numerics.traced_code import rows_of

    x, xs, ys = sympy.Symbol("x", real=True), (-1.0, 0.5, 2.0), (1.0, 4.0, -2.0)
    laws = [
        *(getattr(sympy, name)(x / 3) for name in ("sin", "cos", "tan", "asin", "acos", "atan", "sinh", "tanh")),
        *(sympy.exp(x), sympy.log(x + 3), sympy.erf(x), sympy.gamma(x + 3), sympy.sqrt(x + 3), (x + 3) ** 2.5),
        *(sympy.atan2(x, 2), sympy.Mod(x, 0.73), sympy.Abs(x), sympy.floor(x), sympy.sign(x), sympy.Max(x, 0.1)),
        *(sympy.Heaviside(x), sympy.Piecewise((x, x < 0), (2 * x, sympy.And(x > 0, x < 1)), (3, True)), 1 / (x + 3)),
    ]
    values = np.linspace(-2.0, 2.5, 41)
    with jax.enable_x64(new_val=True):
        memory = {"x": values.astype(kind)[None], "moment": values[None]}
        laws += [Interpolation(x, sw.Table(xs, ys)), HeldNoise(3 * x, 7.0)]

        def write(body: Any) -> None:
            terms = Terms(body, Fixed((), (x,), laws), {x: ("x", 0)})
            for place, law in enumerate(laws):
                body.write(place, terms.value(law))

        rows = np.asarray(rows_of(jax, memory, write))
    exact = [sympy.lambdify(x, law, "scipy")(memory["x"][0].astype(float)) for law in laws[:-2]]
    exact += [np.interp(values, xs, ys), held(3 * values, 7.0)]
    tolerance = 1e-12 if kind is np.float64 else 1e-4
    for law, row, expected in zip(laws, rows, exact, strict=True):
        np.testing.assert_allclose(row, expected, rtol=tolerance, atol=tolerance, err_msg=str(law))


def test_what_a_device_cannot_do_runs_one_by_one() -> None:
    call: dict[str, Any] = {"samples": samples(16, shaft_c=2e4), "t_end": 0.01}
    made = sweep(sw.scenes.crane_start(), on=CPU, precision="single", measures={"mine": lambda _: 1.0}, **call)
    assert "a function of a whole solution" in made.why
    assert made.errors == {}


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"on": "tpu"}, "'tpu' must be a client of Dask"),
        ({"precision": "single"}, "on='gpu'"),
        ({"on": CPU, "precision": "half"}, "'half'"),
        pytest.param(
            {"on": "gpu"}, "sees no graphics processor, but .*jax", marks=pytest.mark.skipif(has_gpu(), reason="one is")
        ),
    ],
)
def test_what_is_no_device_is_refused(options: dict[str, Any], message: str) -> None:
    with pytest.raises(sw.ParameterError, match=message):
        sweep(sw.scenes.crane_start(), {"shaft.c": [1e4]}, t_end=0.01, measures=["max shaft.tau"], **options)


def test_without_jax_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "jax", None)
    with pytest.raises(sw.MissingExtraError, match="gpu"):
        sweep(sw.scenes.crane_start(), {"shaft.c": [1e4]}, t_end=0.01, measures=["max shaft.tau"], on="gpu")


def test_a_store_of_one_precision_is_refused_by_the_other(tmp_path: Path) -> None:
    call: dict[str, Any] = {"samples": samples(4, shaft_c=2e4), "t_end": 0.01, "measures": ["max shaft.tau"]}
    store = tmp_path / "store.sqlite"
    sweep(sw.scenes.crane_start(), on=CPU, precision="single", store=store, **call)
    with pytest.raises(sw.ParameterError, match="differs in its options"):
        sweep(sw.scenes.crane_start(), on=CPU, store=store, **call)
