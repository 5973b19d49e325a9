"""Extreme drives: no silent failure, and a judge that knows one when it sees it."""

from __future__ import annotations

import csv
import dataclasses
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import shaftwork as sw
from docs.generate import extreme_drives
from shaftwork.integrate.engines import available
from shaftwork.studies.stability import FAITHFUL, RIGHT, distances, judge, stability
from shaftwork.studies.stability_cases import CASES, TORQUE, Case
from shaftwork.studies.truth import ENDS, exact, predicted
from tests.reference.extreme_drives import continuous

NAMED = {case.name: case for case in CASES}
MESHES = (sw.Lumped(10), sw.CentralDifference(10), sw.CentralDifference(10, order=4), sw.Spectral(8))


@pytest.fixture(scope="module")
def study() -> sw.studies.Stability:
    """Every case with every model and engine, as the page prints it: some minutes."""
    return extreme_drives()


@pytest.mark.slow
@pytest.mark.study
@pytest.mark.xdist_group("study of stability")
def test_nothing_is_wrong_without_a_word(study: sw.studies.Stability) -> None:
    assert study.wrong == ()
    assert study.counts["right"] > 40
    assert "wrong without a warning: 0" in str(study)


@pytest.mark.slow
@pytest.mark.study
@pytest.mark.xdist_group("study of stability")
def test_what_does_not_run_names_its_reason(study: sw.studies.Stability) -> None:
    for cell in study.cells:
        assert bool(cell.why) or cell.verdict in ("right", "coarse")
        assert cell.verdict not in ("warned", "failed", "unknown")
        if cell.verdict == "too long":
            assert f"{NAMED[cell.case].steps} steps were not enough" in cell.why


@pytest.mark.slow
@pytest.mark.study
@pytest.mark.xdist_group("study of stability")
def test_auto_always_runs_where_the_model_can(study: sw.studies.Stability) -> None:
    """It is refused for two reasons alone: damped waves, and an end of a shaft without inertia where nothing is."""
    refused = {cell.why for cell in study.cells if cell.engine == "auto" and cell.verdict not in ("right", "coarse")}
    for why in refused:
        assert "waves travel without internal damping" in why or "cannot be assembled" in why, why


@pytest.mark.slow
@pytest.mark.study
@pytest.mark.xdist_group("study of stability")
def test_what_auto_does_agrees_with_the_models_own_motion_far_closer_than_the_bound(
    study: sw.studies.Stability,
) -> None:
    """The bound is 1e-3. Auto stays below 1e-6, at a stiffness ratio of 1e12 by the roundings of the fast modes."""
    for cell in study.cells:
        if cell.engine == "auto" and np.isfinite(cell.deviation):
            assert cell.deviation < 1e-6, cell
        if np.isfinite(cell.energy):
            assert cell.energy < 1e-6, cell


@pytest.mark.slow
@pytest.mark.study
@pytest.mark.xdist_group("study of stability")
def test_waves_are_right_in_every_case_that_they_take(study: sw.studies.Stability) -> None:
    """To the tolerance of the run, 1e-8, times some amplification; the exact two-port is known to 1e-6."""
    cells = [cell for cell in study.cells if cell.ran == "wave"]
    assert {cell.case for cell in cells} >= {"100000 periods", "10 km", "clamped end", "inertia ratio 1e-09"}
    assert all(cell.error < 1e-6 for cell in cells)


def test_a_matched_end_returns_less_than_a_millionth_of_the_pulse() -> None:
    case = NAMED["matched end, pulse"]
    run = case.network(sw.Wave(3)).simulate(case.t_end, t_eval=case.times)
    back = run.t > (case.rise + 0.01) * case.delay
    assert np.abs(run["line.tau_b"]).max() == pytest.approx(TORQUE, rel=1e-12)
    assert np.abs(run["line.omega_a"][back]).max() * case.impedance < 1e-6 * TORQUE


def test_a_matched_end_returns_nothing_of_a_step() -> None:
    """The drive end sees the impedance alone, as if the shaft had no other end."""
    case = NAMED["matched end, step"]
    run = case.network(sw.Wave(3)).simulate(case.t_end, t_eval=case.times)
    np.testing.assert_allclose(run["line.omega_a"] * case.impedance, TORQUE, rtol=1e-9)


@pytest.mark.parametrize("name", ["m = 2", "inertia ratio 10000", "free end", "clamped end"])
@pytest.mark.parametrize("model", MESHES, ids=repr)
def test_what_a_model_must_do_tends_to_what_the_shaft_does(name: str, model: sw.Lumped) -> None:
    """A model of three times the size has end speeds closer to the truth: two computations without common code."""
    case = NAMED[name]
    truth = exact(case).values
    finer = dataclasses.replace(model, **{dataclasses.fields(model)[0].name: 30})
    errors = []
    for size in (model, finer):
        own = predicted(case, size)
        assert own is not None
        errors.append(np.abs(own.values["omega_a"] - truth["omega_a"]).mean())
    assert errors[1] < 0.7 * errors[0]


def test_what_a_chain_must_do_is_what_newton_says_of_it() -> None:
    """Half cells, springs and a damper by hand, solved by another method."""
    case, m = dataclasses.replace(NAMED["matched end, step"], drive=2.0, load=0.5, damping=0.02), 5
    own = predicted(case, sw.Lumped(m))
    inertia, c, d = case.inertia, case.stiffness * m, case.dashpot * m
    masses = np.full(m + 1, inertia / m)
    masses[[0, -1]] = inertia / m / 2 + np.array([2.0, 0.5]) * inertia

    def rates(_: float, x: np.ndarray) -> np.ndarray:
        speeds, torques = x[: m + 1], x[m + 1 :]
        twist = speeds[:-1] - speeds[1:]
        through = torques + d * twist
        push = np.concatenate([[TORQUE], through]) - np.concatenate([through, [case.impedance * speeds[-1]]])
        return np.concatenate([push / masses, c * twist])

    found = solve_ivp(rates, (0, case.t_end), np.zeros(2 * m + 1), t_eval=case.times, rtol=1e-10, atol=1e-10)
    assert own is not None
    np.testing.assert_allclose(own.values["omega_a"], found.y[0], rtol=1e-7, atol=1e-6)
    np.testing.assert_allclose(own.values["omega_b"], found.y[m], rtol=1e-7, atol=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_the_truth_is_that_of_the_continuous_shaft(case: Case) -> None:
    """By characteristics, or by the inverted two-port: computations without network, equations or engine."""
    truth, reference = exact(case), continuous(case)
    error, _, _ = distances(truth.values, reference, None)
    assert error < 1e-6 + truth.error + reference.error
    assert truth.error + reference.error < 1e-4


@pytest.mark.parametrize("name", ["gear ratio 0.01", "smooth torque", "inertia ratio 1e-09"])
def test_the_two_truths_agree_where_both_hold(name: str) -> None:
    """Characteristics, and the two-port with a spring that has a part 1e-9 of the shaft's compliance."""
    case = NAMED[name]
    waves, ports = continuous(case), continuous(dataclasses.replace(case, spring=1e9))
    assert (waves.source, ports.source) == ("characteristics", "exact two-port")
    error, _, _ = distances(ports.values, waves, None)
    # the load of 1e-9 of the shaft's inertia swings on the spring, by its boundary layer
    assert error < 1e-5 + ports.error
    assert ports.error < 1e-5


def test_the_truth_of_a_late_period_is_that_of_an_early_one() -> None:
    """A free shaft rings for ever, and its outputs lie at the same places of each period."""
    case = NAMED["100000 periods"]
    early, late = (exact(dataclasses.replace(case, periods=k)) for k in (5, 500))
    for name in ("omega_a", "omega_b"):
        np.testing.assert_allclose(late.values[name], early.values[name], rtol=1e-9)
        assert early.values[name].max() > 0


def test_a_stiff_spring_behind_the_shaft_is_none() -> None:
    case = dataclasses.replace(NAMED["smooth torque"], damping=0.02)
    plain, sprung = (predicted(dataclasses.replace(case, spring=spring), sw.Lumped(5)) for spring in (0.0, 1e7))
    assert plain is not None
    assert sprung is not None
    for name in ENDS:
        size = np.abs(plain.values[name]).max()
        np.testing.assert_allclose(sprung.values[name], plain.values[name], rtol=0, atol=1e-4 * size)


def test_momentum_is_the_impulse_of_the_motor() -> None:
    """Another law than those the study compares with, from the speeds along the shaft."""
    case = NAMED["impulse"]
    for model in (sw.Lumped(10), sw.CentralDifference(10), sw.Spectral(8)):
        run = case.network(model).simulate(case.t_end, t_eval=case.times)
        of_shaft = run["line.omega"] @ np.array(model.mesh().inertias) / model.mesh().intervals * case.inertia
        ends = case.inertia * (case.drive * run["line.omega_a"] + case.load * run["line.omega_b"])
        given = TORQUE * np.minimum(run.t, case.rise * case.delay)
        # the residue of 1e-10 is that of the propagation, step by step
        assert np.abs(of_shaft + ends - given).max() < 1e-9 * given.max()


@pytest.mark.parametrize(
    ("model", "spoilt"),
    [
        (sw.Lumped(10), lambda own: {name: 1.02 * value for name, value in own.items()}),
        (sw.Lumped(10), lambda own: own | {"tau_b": -own["tau_b"]}),
        (sw.Spectral(8), lambda own: {name: np.roll(value, 1) for name, value in own.items()}),
        (sw.Spectral(8), lambda own: own | {"omega_a": np.where(own["omega_a"] > 0, np.nan, own["omega_a"])}),
        (sw.OneSpring(), lambda own: own | {"tau_a": own["tau_a"] * np.linspace(1, 0, len(own["tau_a"]))}),
    ],
    ids=["2 per cent too large", "sign", "one output late", "not finite", "decays"],
)
def test_a_spoilt_run_is_called_wrong(model: sw.Lumped, spoilt: object) -> None:
    """The same run is called right or coarse before, and is only warned of where a warning was given."""
    case = NAMED["inertia ratio 10000"]
    truth, own = exact(case), predicted(case, model)
    assert own is not None
    for values, verdicts in ((own.values, ("right", "coarse")), (spoilt(own.values), ("wrong",))):  # type: ignore[operator]
        error, _, deviation = distances(values, truth, own)
        assert judge(error, deviation, np.nan, truth.error, warned=False) in verdicts
    assert judge(error, deviation, np.nan, truth.error, warned=True) == "warned"


@pytest.mark.parametrize(
    ("error", "deviation", "energy", "verdict"),
    [
        (RIGHT / 2, FAITHFUL / 2, FAITHFUL / 2, "right"),
        (RIGHT / 2, np.nan, np.nan, "right"),
        (RIGHT / 2, 2 * FAITHFUL, np.nan, "wrong"),
        (RIGHT / 2, FAITHFUL / 2, 2 * FAITHFUL, "wrong"),
        (2 * RIGHT, FAITHFUL / 2, np.nan, "coarse"),
        (2 * RIGHT, np.nan, np.nan, "unknown"),
        (2 * RIGHT, np.nan, 2 * FAITHFUL, "wrong"),
        (np.nan, np.nan, np.nan, "wrong"),
        (np.inf, np.inf, np.nan, "wrong"),
    ],
)
def test_a_verdict_needs_evidence(error: float, deviation: float, energy: float, verdict: str) -> None:
    assert judge(error, deviation, energy, 0.0, warned=False) == verdict


def test_a_silent_failure_reaches_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs whose torques are a tenth too small, in every place where a table could lose it; the truth is as it was."""
    truth = exact(NAMED["10 km"])
    monkeypatch.setattr(sys.modules["shaftwork.studies.stability"], "exact", lambda _: truth)
    read = sw.Solution.__getitem__
    monkeypatch.setattr(sw.Solution, "__getitem__", lambda run, name: read(run, name) * (0.9 if "tau" in name else 1))
    found = stability(["10 km"], models=[sw.Lumped(10), "Wave(3)"], engines=["auto"])
    assert [cell.verdict for cell in found.wrong] == ["wrong", "wrong"]
    assert found.counts["wrong"] == 2
    assert "wrong without a warning: 2" in str(found)


def test_steps_that_are_not_enough_are_too_long() -> None:
    case = dataclasses.replace(NAMED["free end"], steps=20)
    engines = filter(available, ["scipy", "heyoka", "numba", "sundials", "banded"])
    cells = stability([case], models=[sw.Lumped(10)], engines=[*engines]).cells
    assert {cell.verdict for cell in cells} == {"too long"}


@pytest.mark.slow
def test_an_explicit_engine_shortens_its_steps_and_never_becomes_unstable() -> None:
    """A finer chain of the same drive: the steps grow in proportion to its highest frequency, 2 m / delay."""
    case = dataclasses.replace(NAMED["free end"], delays=2.0)
    steps, errors = [], []
    for m in (40, 80, 160):
        run = case.network(sw.Lumped(m)).simulate(case.t_end, t_eval=case.times, engine="scipy", rtol=1e-3)
        own = predicted(case, sw.Lumped(m))
        steps.append(run.statistics["steps"])
        assert own is not None
        errors.append(np.abs(run["line.omega_a"] - own.values["omega_a"]).max() / own.values["omega_a"].max())
    assert 1.6 < steps[2] / steps[1] < 2.4
    # ten times the tolerance of a step, over some hundred steps
    assert max(errors) < 1e-2


@pytest.mark.slow
@pytest.mark.study
@pytest.mark.xdist_group("study of stability")
def test_the_table_is_written_and_drawn(study: sw.studies.Stability, tmp_path: Path) -> None:
    study.to_csv(tmp_path / "table.csv")
    rows = list(csv.DictReader((tmp_path / "table.csv").read_text(encoding="utf-8").splitlines()))
    assert len(rows) == len(study.cells)
    assert float(rows[0]["error"]) == study.cells[0].error
    pytest.importorskip("matplotlib")
    figure = study.plot()
    assert [text.get_text() for text in figure.axes[0].get_yticklabels()] == list(
        dict.fromkeys(cell.case for cell in study.cells)
    )


@pytest.mark.parametrize("engines", [["auto"], ["auto", "exact", "scipy"]], ids=len)
def test_every_cell_has_a_place_of_its_own_in_the_picture_and_no_label_covers_another(engines: list[str]) -> None:
    pytest.importorskip("matplotlib")
    printed = "CentralDifference(m=10, closure='printed')"
    other = "CentralDifference(m=12, order=4)"
    models = ["CentralDifference(m=10)", printed, other, "Lumped(m=10)", "Lumped(m=20)", "Wave(places=5)"]
    study = sw.studies.Stability(
        tuple(
            sw.studies.Cell(case, model, engine, engine, "coarse", error=1e-2)
            for case in ("clamped end", "m = 2")
            for model in models
            for engine in engines
        )
    )
    figure = study.plot()
    figure.canvas.draw()
    cells = figure.axes[0]
    places = [text.get_position() for text in cells.texts]
    assert len(places) == len(set(places)) == sum(np.isfinite(cell.error) for cell in study.cells)
    walls = [line.get_xdata()[0] for line in cells.lines if line.get_color() == "black"]
    assert walls == [k * len(engines) - 0.5 for k in range(1, len(models))]  # between kinds
    above = cells.child_axes[0].get_xticklabels()
    assert [label.get_text().replace("\n", "") for label in above] == [
        "CentralDifference", "CentralDifference(closure='printed')", "CentralDifference(order=4)",
        "Lumped(m=10)", "Lumped(m=20)", "Wave",
    ]  # fmt: skip
    for labels in (above, cells.get_xticklabels(), cells.get_yticklabels()):
        boxes = [label.get_window_extent() for label in labels]
        assert not any(one.overlaps(other) for one, other in pairwise(boxes))


def test_unknown_names_are_answered_with_those_there_are() -> None:
    with pytest.raises(sw.ParameterError, match=r"no case 'hot'\. There are: stiffness ratio 1e-09"):
        stability(["hot"])
    with pytest.raises(sw.ParameterError, match=r"no engine 'euler'\. Take some of: auto, exact"):
        stability(["1 mm"], engines=["euler"])
    with pytest.raises(sw.ParameterError, match="is no shaft model"):
        stability(["1 mm"], models=["Fluid(3)"])


def test_a_case_is_a_record_that_can_be_made() -> None:
    """A user's own case, judged like the others."""
    case = Case("soft tube", length=3.0, diameter=0.05, load=7.0, form="sine", rise=30.0)
    found = stability([case], models=["Spectral(12)"], engines=["auto"])
    assert [cell.verdict for cell in found.cells] == ["right"]
    assert set(ENDS) == set(exact(case).values)
