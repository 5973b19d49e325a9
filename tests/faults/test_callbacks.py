"""What a user's own function raises comes out as it went in: the same object, whichever engine has called it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.components.shaft_models import ShaftModel


class OwnError(Exception):
    """Of the user."""


class OwnStop(BaseException):
    """Of the user, and no error."""


ERRORS = (
    *(OwnError, OwnStop, KeyboardInterrupt, ValueError, RuntimeError, RecursionError, ArithmeticError, StopIteration),
    *(MemoryError, sw.SimulationError, sw.ParameterError),
)


def train(*loads: sw.Component, model: ShaftModel | None = None) -> sw.Network:
    """Two inertias and what is between them: a spring, or a shaft with a model."""
    net = sw.Network("train")
    net.add(sw.TorqueSource("motor", tau=50.0 - 2.0 * sw.omega), "a")
    net.add(sw.Inertia("J1", J=27.0), "a")
    shaft = (
        sw.Spring("shaft", c=24e3, d=14.0)
        if model is None
        else sw.Shaft("shaft", length=9.0, diameter=0.05, model=model)
    )
    net.add(shaft, "a", "b")
    net.add(sw.Inertia("J2", J=62.0), "b")
    for load in loads:
        net.add(load, "b")
    return net


NETWORKS: dict[str, Callable[[], sw.Network]] = {
    "linear": train,
    "nonlinear": lambda: train(sw.TorqueSource("load", tau=-(sw.omega**3))),
    "switching": lambda: train(sw.TorqueSource("load", tau=-5 * sympy.Abs(sw.omega - 0.2))),
    "sticking": lambda: train(sw.CoulombLoad("load", tau=20.0), sw.TorqueSource("pulse", tau=sw.Step(1.0, start=0.2))),
    "waves": lambda: train(sw.TorqueSource("load", tau=-(sw.omega**3)), model=sw.Wave()),
}
RUNS = (
    *[(name, engine) for name in ("nonlinear", "switching", "sticking") for engine in ("scipy", "scipy-radau")],
    *[(name, engine) for name in ("nonlinear", "switching", "sticking") for engine in ("heyoka", "sundials", "auto")],
    *[("linear", engine) for engine in ("scipy", "scipy-radau", "heyoka", "sundials", "banded")],
    ("waves", "auto"),
)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "engine"), RUNS)
def test_what_progress_raises_comes_out_of_every_engine(
    name: str, engine: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "shaftwork.integrate.taylor.heyoka_taylor.UNINTERRUPTED", 5
    )  # heyoka tells it in runs as short, too
    model = NETWORKS[name]().compile()
    for kind in ERRORS:
        error = kind("of the user")

        def tell(_: float, error: BaseException = error) -> None:
            raise error

        with pytest.raises(kind) as caught:
            model.simulate(0.5, engine=engine, progress=tell)
        assert caught.value is error
        assert error.__cause__ is None
        assert error.__context__ is None
        assert caught.traceback[-1].name == "tell"
    assert model.simulate(0.5, engine=engine).t[-1] == 0.5  # the model is none the worse


@pytest.mark.parametrize("engine", ["heyoka", "sundials", "scipy"])
def test_progress_is_told_of_the_run_and_not_when_it_is_read(engine: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Some engines make parts of a run again for what is read between output times."""
    monkeypatch.setattr("shaftwork.integrate.taylor.heyoka_taylor.UNINTERRUPTED", 5)
    told: list[float] = []
    motion = NETWORKS["nonlinear"]().simulate(0.5, engine=engine, progress=told.append)
    assert told
    told.clear()
    assert motion.max("shaft.tau") > 0
    assert motion.energy_residual < 1e-6
    assert told == []


@pytest.mark.parametrize("kind", [OwnStop, KeyboardInterrupt])
@pytest.mark.parametrize("processes", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_sweep_ends_with_what_is_no_error_of_a_measure(kind: type[BaseException], processes: int) -> None:
    with pytest.raises(kind, match="of the user"):
        sw.studies.sweep(
            train(),
            {"shaft.c": [2e4, 3e4]},
            t_end=0.1,
            measures={"own": STOPS[kind]},
            processes=processes,
        )


def _own_stop(_: sw.Solution) -> float:
    raise OwnStop("of the user")


def _interrupt(_: sw.Solution) -> float:
    raise KeyboardInterrupt("of the user")


STOPS: dict[type[BaseException], Callable[[sw.Solution], float]] = {OwnStop: _own_stop, KeyboardInterrupt: _interrupt}


@pytest.mark.slow
def test_what_a_point_over_speed_or_a_report_raises_comes_out_of_their_studies() -> None:
    error = OwnError("of the user")

    def fail(_: object) -> Any:
        raise error

    with pytest.raises(OwnError) as caught:
        train().campbell(np.linspace(0.0, 100.0, 3), at=fail)
    assert caught.value is error
    net = train(model=sw.Spectral(4))
    with pytest.raises(OwnError) as caught:
        sw.studies.work_precision(net, "shaft", t_end=0.01, models=["Lumped(4)"], engines=["scipy"], report=fail)
    assert caught.value is error


def test_progress_that_is_no_function_is_refused_by_name() -> None:
    with pytest.raises(sw.ParameterError, match="progress = 3 must be a function of the time"):
        train().simulate(0.01, progress=3)  # type: ignore[arg-type]
