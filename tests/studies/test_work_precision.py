"""The comparison of shaft models: its truth, its errors, and what it says when a model fails."""

from __future__ import annotations

import csv
import itertools
import sys
from pathlib import Path

import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.scenes.long_shafts import LOAD_INERTIA, MOTOR_INERTIA, RATED_TORQUE
from shaftwork.studies.study_arguments import LADDER, rungs
from shaftwork.studies.truth import QUANTITIES, exact_motion
from shaftwork.studies.work_precision import _timed, affordable_end, work_precision
from shaftwork.studies.work_precision_result import Trial, WorkPrecision
from tests.reference.exact_shafts.exact_motion import JunctionTorque, motion
from tests.reference.exact_shafts.line import Section, SectionLine

SMALL = (sw.OneSpring(), sw.Lumped(10), sw.Lumped(20), sw.CentralDifference(10), sw.Spectral(8), sw.Wave(3))


@pytest.mark.slow
def test_the_truth_of_a_train_is_that_of_characteristics() -> None:
    net, t = sw.scenes.shaft_step(), np.linspace(0.001, 0.05, 50)
    truth = exact_motion(net, "line", 0.05, t)
    assert truth.source == "travelling waves"
    line = SectionLine((Section.of_geometry(1.0, 0.02),), (MOTOR_INERTIA, LOAD_INERTIA))
    exact = motion(line, [JunctionTorque(0, lambda t: np.full_like(t, RATED_TORQUE))], 0.05)
    torques = {"tau_a": exact.torque_in(0, t, "left"), "tau_b": exact.torque_in(0, t, "right")}
    speeds = {"omega_a": exact.junction_speed(0, t), "omega_b": exact.junction_speed(1, t)}
    for name, values in (torques | speeds).items():
        assert np.abs(values - truth.values[name]).max() < 1e-9 * np.abs(values).max()
    assert np.abs(exact.torque(0.5, t) - truth.values["tau_mid"]).max() < 1e-8


@pytest.mark.slow
def test_the_truth_knows_a_shaft_that_is_wired_backwards() -> None:
    def wired(*nodes: str) -> sw.Network:
        net = sw.Network("train")
        net.add(sw.TorqueSource("motor", tau=5 * sympy.sin(300 * sw.t)), "m")
        net.add(sw.Inertia("Je", J=0.025), "m")
        net.add(sw.Shaft("line", length=1.0, diameter=0.02), *nodes)
        net.add(sw.Inertia("Jm", J=0.11), "l")
        return net

    t = np.linspace(0.001, 0.02, 20)
    both = [exact_motion(wired(*nodes), "line", 0.02, t) for nodes in (("m", "l"), ("l", "m"))]
    assert [truth.source for truth in both] == ["travelling waves"] * 2
    there, back = (truth.values for truth in both)
    np.testing.assert_allclose(back["tau_a"], -there["tau_b"], atol=1e-12)
    np.testing.assert_allclose(back["omega_a"], there["omega_b"], atol=1e-12)
    np.testing.assert_allclose(back["tau_mid"], -there["tau_mid"], atol=1e-12)


@pytest.mark.slow
def test_other_networks_have_other_truths() -> None:
    t = np.linspace(0.001, 0.01, 10)
    damped = sw.scenes.shaft_step(damping=1.0)
    assert exact_motion(damped, "line", 0.01, t).source == "Spectral(64)"
    net = sw.Network("motor")
    net.add(sw.KlossMotor("motor", tau_k=30.0, s_k=0.2, n_sync=1500), "m")
    net.add(sw.Inertia("Je", J=0.025), "m")
    net.add(sw.Shaft("line", length=1.0, diameter=0.02), "m", "l")
    net.add(sw.Inertia("Jm", J=0.11), "l")
    assert exact_motion(net, "line", 0.01, t).source == "travelling waves"


@pytest.mark.slow
def test_the_study_ranks_the_models_as_their_orders_say() -> None:
    study = work_precision(sw.scenes.shaft_step(), "line", t_end=0.05, models=SMALL, points=101)
    trial = {found.model: found for found in study.trials}
    assert set(QUANTITIES) <= set(study.columns)
    assert trial["Wave(places=3)"].error < 1e-8
    # frequencies: second order, and central differences four times worse at equal size
    assert trial["Lumped(m=10)"].errors["f_3"] / trial["Lumped(m=20)"].errors["f_3"] == pytest.approx(4, rel=0.05)
    assert trial["CentralDifference(m=10)"].errors["f_3"] / trial["Lumped(m=10)"].errors["f_3"] == pytest.approx(
        4, rel=0.05
    )
    assert trial["Spectral(n=8)"].errors["f_3"] < 1e-9
    assert trial["Spectral(n=8)"].error < trial["Lumped(m=20)"].error < trial["OneSpring()"].error
    best = study.cheapest(1e-6)
    assert best is not None
    assert best.model == "Wave(places=3)"
    assert study.cheapest(1e-15) is None
    assert "end torques to 1e-06: Wave(places=3) on wave" in study.advice
    # up to 3.9 kHz the shaft has three modes; central differences show two of them twice, one spring has one
    extra = {name: each.extra_modes for name, each in trial.items()}
    assert extra == {
        "OneSpring()": -2,
        "Lumped(m=10)": 0,
        "Lumped(m=20)": 0,
        "CentralDifference(m=10)": 2,
        "Spectral(n=8)": 0,
        "Wave(places=3)": 0,
    }


@pytest.mark.slow
def test_a_model_that_fails_is_a_row_with_its_reason(tmp_path: Path) -> None:
    models, told = (sw.Wave(), sw.Spectral(4)), list[Trial]()
    study = work_precision(
        sw.scenes.shaft_step(),
        "line",
        t_end=0.01,
        models=models,
        engines=("scipy",),
        points=np.int64(11),
        report=told.append,
    )
    assert tuple(told) == study.trials
    failed, good = study.trials
    assert "knows no travelling waves" in failed.why
    assert np.isinf(failed.error)
    assert good.engine == "scipy"
    study.to_csv(tmp_path / "study.csv")
    rows = list(csv.DictReader((tmp_path / "study.csv").read_text(encoding="utf-8").splitlines()))
    assert [row["model"] for row in rows] == ["Wave(places=5)", "Spectral(n=4)"]
    assert float(rows[1]["tau_a"]) == good.errors["tau_a"]
    assert study.plot().axes[0].get_xlabel() == "CPU time of a warm call in ms"


def test_an_unknown_shaft_is_answered_with_those_there_are() -> None:
    with pytest.raises(sw.ParameterError, match=r"no shaft 'axle'\. It has: line"):
        work_precision(sw.scenes.shaft_step(), "axle", t_end=0.1)


@pytest.mark.slow
def test_the_ship_line_is_solved_alike_by_waves_and_by_polynomials() -> None:
    """Smooth torque: the spectral model of degree 8 is good to 1e-6 of the speeds."""
    waves, smooth = (sw.scenes.ship_line(model).simulate(2.0, t_eval=201) for model in (sw.Wave(), sw.Spectral(12)))
    for name in ("propeller.omega", "flywheel.omega"):
        assert np.abs(waves[name] - smooth[name]).max() < 1e-6 * np.abs(smooth[name]).max()
    assert np.abs(waves["shaft2.tau_a"] - smooth["shaft2.tau_a"]).max() < 2e-3 * np.abs(smooth["shaft2.tau_a"]).max()


@pytest.mark.slow
def test_frequencies_are_judged_with_the_damping_at_the_ends() -> None:
    net = sw.scenes.shaft_step()
    net.add(sw.Damper("brake", d=200.0), "load end")
    study = work_precision(net, "line", t_end=0.005, models=["Wave(3)", "Spectral(8)"], points=11)
    for trial in study.trials:
        assert max(trial.errors["f_2"], trial.errors["f_3"]) < 1e-9
        assert trial.setup > 0


@pytest.mark.parametrize("wrong", [{"engines": "scipy"}, {"engines": ("foo",)}, {"points": 0}, {"models": "Wave()"}])
def test_a_wrong_argument_is_one_clear_error(wrong: dict[str, object]) -> None:
    with pytest.raises(sw.ParameterError, match=r"must be|There is no engine"):
        work_precision(sw.scenes.shaft_step(), "line", t_end=0.1, **wrong)  # type: ignore[arg-type]


def test_the_table_has_a_line_for_each_trial_and_a_reason_behind_one_that_failed() -> None:
    good = Trial("OneSpring()", "scipy", 3, 0.1, 0.01, {"tau_a": 1e-3}, 0, asked="scipy")
    failed = Trial("Wave(places=5)", "scipy", 0, 0.0, np.inf, {}, why="knows no waves", asked="scipy")
    assert str(WorkPrecision("train", "line", (good, failed), ("waves", 1e-9))).splitlines() == [
        "train, shaft 'line', errors against waves (1e-09)",
        "model           engine  states  set-up ms  CPU ms  tau_a    extra modes",
        "OneSpring()     scipy   3       100        10.00   1.0e-03  0",
        "Wave(places=5)  scipy   -       -          -       -        -  knows no waves",
    ]


def test_a_model_that_takes_too_long_is_given_up_and_says_when(monkeypatch: pytest.MonkeyPatch) -> None:
    net = sw.scenes.shaft_step()
    monkeypatch.setattr(sys.modules["shaftwork.studies.work_precision"], "LONGEST", -1.0)
    with pytest.raises(sw.SimulationError, match=r"given up after -1 s at t = .* of 0\.01 s"):
        _timed(net.compile(), "line", Trial("", "scipy", 0, 0.0, np.inf, {}, asked="scipy"), 0.01, np.array([0.01]))


def test_a_motion_that_takes_too_long_is_compared_over_a_part_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    """A clock that goes on by three seconds each time it is read stands for a slow engine."""
    module, clock = sys.modules["shaftwork.studies.work_precision"], itertools.count(step=3)
    assert affordable_end(sw.scenes.bldc_shaft(), "line", 0.002) == 0.002
    monkeypatch.setattr(module.time, "thread_time", lambda: float(next(clock)))
    assert 0 < affordable_end(sw.scenes.bldc_shaft(), "line", 0.02) < 0.01


def test_models_are_named_with_sizes_or_without() -> None:
    assert rungs(["Lumped"], [5, 7]) == (sw.Lumped(5), sw.Lumped(7))
    assert rungs(["Lumped(3)", "OneSpring"], [5]) == (sw.Lumped(3), sw.OneSpring())
    printed = rungs(["CentralDifference(closure='printed')"], None)
    assert printed == tuple(sw.CentralDifference(m, closure="printed") for m in (10, 20, 40, 80))
    assert set(rungs(None, None)) >= set(LADDER) - {sw.Wave(3)}
    with pytest.raises(sw.ParameterError, match="is no shaft model"):
        rungs(["Foo"], None)


def test_every_kind_of_model_is_tried_whatever_the_budget_and_what_is_left_out_says_why() -> None:
    models, told = [sw.Lumped(5), sw.Lumped(10), sw.Spectral(2), sw.Spectral(4)], list[Trial]()
    study = work_precision(
        sw.scenes.shaft_step(), "line", t_end=0.01, models=models, points=11, budget=1e-9, report=told.append
    )
    assert [trial.model for trial in study.trials] == ["Lumped(m=5)", "Lumped(m=10)", "Spectral(n=2)", "Spectral(n=4)"]
    assert [trial.model for trial in told] == ["Lumped(m=5)", "Spectral(n=2)", "Lumped(m=10)", "Spectral(n=4)"]
    assert [bool(trial.errors) for trial in study.trials] == [True, False, True, False]
    ((why, left_out),) = study.left_out.items()
    assert why == "not tried, since the budget of 1e-09 s of CPU is spent"
    assert left_out == ("Lumped(m=10)", "Spectral(n=4)")
    assert [trial.model for trial in study.representatives] == ["Lumped(m=5)", "Spectral(n=2)"]
    assert why in study.plot().get_supxlabel()


def test_a_tighter_tolerance_is_a_row_of_its_own_and_courses_are_laid_over_each_other() -> None:
    """The error along rtol, of a model whose own error is none: a shaft of one spring, without inertia."""
    net = sw.Network("swing")
    net.add(sw.TorqueSource("motor", tau=5 * sympy.sin(300 * sw.t)), "a")
    net.add(sw.Inertia("Ja", J=0.025), "a")
    net.add(sw.Shaft("line", length=1.0, diameter=0.02), "a", "b")
    net.add(sw.Inertia("Jb", J=0.11), "b")
    study = work_precision(
        net, "line", t_end=0.02, models=["Spectral(12)"], engines=["scipy-radau"], rtols=[1e-3, 1e-6], points=21
    )
    loose, tight = study.trials
    assert (loose.rtol, tight.rtol) == (1e-3, 1e-6)
    assert loose.error > 10 * tight.error
    assert "rtol" in str(study).splitlines()[1]
    upper, lower = study.plot_courses("a").axes
    drawn = {line.get_label(): line.get_ydata() for line in upper.lines}
    np.testing.assert_array_equal(drawn["travelling waves"], study.courses[:, 0])
    apart = np.abs(drawn[tight.model] - study.courses[:, 0])
    # drawn at a rounding of the largest torque at least, so that a motion that is the exact one has a picture
    np.testing.assert_allclose(lower.lines[0].get_ydata(), apart, rtol=0, atol=1e-12 * np.abs(study.courses).max())
    assert lower.lines[0].get_ydata().min() > 0


@pytest.mark.slow
def test_a_drive_with_an_inverter_and_a_damped_shaft_has_a_truth_that_two_degrees_agree_on() -> None:
    study = work_precision(
        sw.scenes.bldc_shaft(), "line", t_end=0.01, models=["Spectral(4)", "Lumped(5)", "Wave()"], points=21
    )
    assert study.truth[0].startswith("Spectral(")
    assert study.truth[1] < 1e-6
    spectral, lumped, wave = study.trials
    assert 10 * spectral.error < lumped.error < 1e-3  # five sections bend the second mode by a percent
    assert "internal damping" in wave.why
