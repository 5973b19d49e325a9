"""Variants: what is measured is what a solution shows, side by side, one by one, in processes, and after a stop."""

from __future__ import annotations

import csv
import pickle
import sys
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.results.measures import Measure
from shaftwork.studies import Sweep, sweep
from shaftwork.sweep.sweep_task import Task, Worker

MEASURES = ("max shaft.tau", "rms shaft.tau", "mean motor.tau", "min J1.omega", "end J2.omega", "peak shaft.tau")


@cache
def crane_samples(count: int = 24) -> dict[str, np.ndarray]:
    """Random shafts and motors of the crane."""
    random = np.random.default_rng(7)
    return {
        "shaft.c": 24206.0 * random.uniform(0.5, 1.5, count),
        "shaft.d": 14.0 * random.uniform(0.5, 1.5, count),
        "motor.tau_k": 8.0 * random.uniform(0.9, 1.2, count),
    }


def crane_worker(measures: Iterable[str] = MEASURES) -> Worker:
    task = Task(
        sw.scenes.crane_start(), crane_samples(), {name: Measure.read(name) for name in measures}, {}, 2.0, OPTIONS
    )
    return Worker(task)


OPTIONS = {"rtol": 1e-8, "engine": "auto", "initial": None, "t_eval": 2}


def swing(damping: float = 0.0) -> sw.Network:
    """One inertia on a spring: after a step of torque the spring swings between zero and twice the torque."""
    net = sw.Network("swing")
    net.add(sw.TorqueSource("motor", tau=5.0), "a")
    net.add(sw.Inertia("J", J=2.0), "a")
    net.add(sw.Spring("shaft", c=800.0, d=damping), "a", "ground")
    return net


def test_a_grid_is_every_combination_the_last_name_fastest() -> None:
    made = sweep(swing(), {"motor.tau": [1.0, 2.0], "J.J": [1.0, 2.0, 3.0]}, t_end=0.1, measures=["end J.omega"])
    assert len(made) == 6
    assert made.parameters["motor.tau"].tolist() == [1, 1, 1, 2, 2, 2]
    assert made.parameters["J.J"].tolist() == [1, 2, 3, 1, 2, 3]
    omega = np.sqrt(800.0 / made.parameters["J.J"])
    expected = made.parameters["motor.tau"] / (made.parameters["J.J"] * omega) * np.sin(0.1 * omega)
    np.testing.assert_allclose(made.measures["end J.omega"], expected, rtol=1e-8)


@pytest.mark.parametrize("count", [4, 20])
def test_measures_equal_closed_forms(count: int) -> None:
    """One by one (4) and, where heyoka is there, side by side (20): the run ends in the middle of a period."""
    stiffness, end = np.linspace(500.0, 5000.0, count), 1.0
    names = [f"{kind} shaft.tau" for kind in ("max", "min", "peak", "mean", "rms", "end")]
    made = sweep(swing(), samples={"shaft.c": stiffness}, t_end=end, measures=names)
    omega = np.sqrt(stiffness / 2.0)
    cosine, sine = np.sinc(omega * end / np.pi), np.sinc(2 * omega * end / np.pi)
    expected = {
        "max": 10.0 + 0 * omega,
        "min": 0 * omega,
        "peak": 10.0 + 0 * omega,
        "mean": 5.0 * (1 - cosine),
        "rms": 5.0 * np.sqrt(1 - 2 * cosine + (1 + sine) / 2),
        "end": 5.0 * (1 - np.cos(omega * end)),
    }
    for kind, values in expected.items():
        # one by one a peak is refined to 1e-7 of its size
        np.testing.assert_allclose(made.measures[f"{kind} shaft.tau"], values, atol=2e-6, err_msg=kind)


@pytest.mark.slow
def test_16_variants_of_the_crane_agree_with_scipy() -> None:
    pytest.importorskip("numba")
    samples = {name: values[:16] for name, values in crane_samples().items()}
    fast = sweep(sw.scenes.crane_start(), samples=samples, t_end=0.7, measures=MEASURES)
    slow = sweep(sw.scenes.crane_start(), samples=samples, t_end=0.7, measures=MEASURES, engine="scipy", rtol=1e-10)
    assert fast.why == ""
    assert slow.why == "engine = 'scipy' was asked for"
    for name in MEASURES:
        size = np.abs(slow.measures[name]).max()
        np.testing.assert_allclose(fast.measures[name], slow.measures[name], atol=1e-6 * size or 1e-9, err_msg=name)


@pytest.mark.slow
def test_variants_side_by_side_are_those_of_any_order_and_grouping() -> None:
    pytest.importorskip("numba")
    worker = crane_worker()
    assert worker.why == ""
    whole = worker.run(np.arange(24))
    order = np.random.default_rng(1).permutation(24)
    mixed = np.concatenate([worker.run(part).values for part in (order[:5], order[5:6], order[6:])])
    np.testing.assert_array_equal(mixed, whole.values[order])  # to the last bit
    other = pickle.loads(pickle.dumps(crane_worker()._task))  # noqa: S301 (what a process gets)
    np.testing.assert_array_equal(Worker(other).run(np.arange(24)).values, whole.values)


@pytest.mark.slow
def test_variants_with_a_gap_and_a_brake_change_their_modes_each_at_its_own_time() -> None:
    pytest.importorskip("numba")
    net = sw.Network("gap and brake")
    net.add(sw.TorqueSource("motor", tau=100.0), "rotor")
    net.add(sw.Inertia("J1", J=27.35), "rotor")
    net.add(sw.Backlash("shaft", gap=0.003, c=24206.0, d=14.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=62.5), "wheel")
    net.add(sw.Brake("brake", tau=150.0, t_on=0.3), "wheel")
    random = np.random.default_rng(2)
    samples = {"shaft.c": random.uniform(2e4, 3e4, 16), "brake.t_on": random.uniform(0.2, 0.4, 16)}
    names = ("max shaft.tau", "min shaft.tau", "end J1.omega", "mean shaft.tau")
    fast = sweep(net, samples=samples, t_end=0.8, measures=names)
    assert fast.why == ""
    model = net.compile()
    for row in (0, 7, 15):
        values = {name: float(column[row]) for name, column in samples.items()}
        solution = model.simulate(0.8, parameters=values, rtol=1e-10)
        for name in names:
            expected = Measure.read(name).of(solution)
            assert fast.measures[name][row] == pytest.approx(expected, rel=1e-6, abs=1e-8), name


def test_torques_at_both_ends_of_a_mesh_are_those_of_single_runs() -> None:
    """At the second end the last spring gives what the node takes: the same sign as at the first."""
    pytest.importorskip("numba")
    net = sw.Network("meshed")
    net.add(sw.TorqueSource("motor", tau=5 * sw.t), "a")
    net.add(sw.Inertia("J1", J=0.5), "a")
    net.add(sw.Shaft("line", length=1.0, diameter=0.02, model=sw.Lumped(3)), "a", "b")
    net.add(sw.Inertia("J2", J=0.5), "b")
    net.add(sw.ViscousLoad("load", d=0.2), "b")
    measures = ("end line.tau_a", "end line.tau_b")
    fast = sweep(net, samples={"J2.J": np.linspace(0.4, 0.6, 16)}, t_end=0.3, measures=measures)
    assert fast.why == ""
    solution = net.compile().simulate(0.3, parameters={"J2.J": 0.6}, rtol=1e-10)
    for name in measures:
        assert fast.measures[name][-1] == pytest.approx(Measure.read(name).of(solution), rel=1e-6), name


def test_variants_of_a_gear_before_a_gap_run_side_by_side() -> None:
    """The speed behind the gear, which goes on over each contact, is read by the ratio of its variant."""
    pytest.importorskip("numba")
    net = sw.Network("geared gap")
    net.add(sw.TorqueSource("motor", tau=100.0), "m")
    net.add(sw.Inertia("J0", J=2.0), "m")
    net.add(sw.Gear("gear", ratio=2.0), "m", "rotor")
    net.add(sw.Inertia("J1", J=27.35), "rotor")
    net.add(sw.Backlash("shaft", gap=0.003, c=24206.0, d=14.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=62.5), "wheel")
    ratios = np.linspace(1.5, 3.0, 16)
    measures = ("max shaft.tau", "end J0.omega")
    fast = sweep(net, samples={"gear.ratio": ratios}, t_end=0.2, measures=measures)
    assert fast.why == ""
    solution = net.compile().simulate(0.2, parameters={"gear.ratio": 3.0}, rtol=1e-10)
    for name in measures:
        assert fast.measures[name][-1] == pytest.approx(Measure.read(name).of(solution), rel=1e-9), name


def test_what_runs_side_by_side_runs_one_by_one_where_it_must() -> None:
    pytest.importorskip("numba")
    stiffness, damping = np.linspace(500.0, 900.0, 16), np.full(16, 2.0)
    damping[3] = 0.0  # has other equations
    damping[5], stiffness[6] = 1e9, 1e12  # are stiff
    made = sweep(swing(1.0), samples={"shaft.c": stiffness, "shaft.d": damping}, t_end=1.0, measures=["max shaft.tau"])
    assert made.why.startswith("3 of 16 variants ran one by one: 2 because it is stiff or swings very often")
    assert made.why.endswith("; 1 because it has a zero where others have none, or ratios that meet")
    assert made.measures["max shaft.tau"][3] == pytest.approx(10.0, abs=1e-6)
    assert (np.delete(made.measures["max shaft.tau"], [3, 6]) < 9.9).all()


def test_a_variant_that_fails_is_a_row_with_its_reason() -> None:
    def last(solution: sw.Solution) -> float:
        return 1.0 / float(solution["J.omega"][-1] > 0)

    times = [0.5, 2.0, 3.0]
    net = swing()
    net.add(sw.KlossMotor("late", tau_k=1.0, s_k=0.2, n_sync=1500, t_on=0.1, t_off=1.0), "a")
    made = sweep(net, {"late.t_on": times}, t_end=0.1, measures={"end": "end J.omega", "own": last})
    assert made.failed.tolist() == [False, True, True]
    assert "t_on = 2" in made.reasons[1]
    assert "t_off" in made.reasons[2]
    made = sweep(swing(), {"motor.tau": [-5.0, 5.0]}, t_end=0.1, measures={"own": last})
    assert made.reasons == ("measure 'own': ZeroDivisionError: float division by zero", "")
    assert np.isnan(made.measures["own"][0])
    assert "ZeroDivisionError" in str(made)


def test_a_variant_that_cannot_be_assembled_says_its_first_problem() -> None:
    made = sweep(swing(), {"J.J": [1.0, 0.0], "shaft.c": [800.0, 0.0]}, t_end=0.1, measures=["end J.omega"])
    assert made.failed.tolist() == [False, False, False, True]
    assert made.reasons[3].startswith("'swing' cannot be assembled: 1 problem: massless node: ")


@pytest.mark.slow
def test_a_variant_that_runs_away_leaves_those_beside_it_alone() -> None:
    """J w' = 1 + w^2 is w = tan(t / J), which has no end of the motion at 1 s where J < 2 / pi."""
    net = sw.Network("runaway")
    net.add(sw.TorqueSource("motor", tau=1 + sw.omega**2), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    inertias = np.linspace(2.0, 0.5, 17)
    made = sweep(net, samples={"J.J": inertias}, t_end=1.0, measures=["end J.omega"])
    assert made.failed.tolist() == (inertias < 2 / np.pi).tolist()
    assert all("t = " in reason for reason in made.reasons if reason)
    stay = ~made.failed
    np.testing.assert_allclose(made.measures["end J.omega"][stay], np.tan(1 / inertias[stay]), rtol=1e-6)


def test_requirements_filter_and_a_measure_ranks() -> None:
    made = sweep(
        swing(0.5),
        {"shaft.c": [400.0, 800.0, 1600.0], "motor.tau": [1.0, 5.0]},
        t_end=1.0,
        measures={"largest": "max shaft.tau", "swing": "peak J.omega"},
        require={"largest": (None, 9.0), "swing": (0.02, None)},
    )
    assert made.passed.any()
    assert not made.passed.all()
    best = made.best("largest")
    assert len(best) == made.passed.sum() > 1
    assert len(made.best("largest", 1)) == 1
    assert best.passed.all()
    assert (np.diff(best.measures["largest"]) >= 0).all()
    assert made.best("swing", 1, largest=True).measures["swing"][0] == made.measures["swing"][made.passed].max()
    with pytest.raises(sw.ParameterError, match="There is no measure 'tau'"):
        made.best("tau")
    worst = made.best("largest", largest=True, ignore_require=True)
    assert worst.measures["largest"].tolist() == sorted(made.measures["largest"].tolist(), reverse=True)
    assert worst.require == made.require
    assert not worst.passed[0]


def test_a_variant_that_does_not_pass_says_which_limits_it_misses_or_why_it_failed(tmp_path: Path) -> None:
    """The torque after 0.05 s is tau (1 - cos 1), the speed tau sin 1 / 40; a brake opens after it closes."""
    net = swing()
    net.add(sw.Brake("brake", tau=0.1, t_on=0.1, t_off=0.4), "a")
    made = sweep(
        net,
        {"motor.tau": [0.4, 5.0, 20.0], "brake.t_on": [0.1, 0.5]},
        t_end=0.05,
        measures={"largest": "max shaft.tau", "own": "end J.omega"},
        require={"largest": (1.0, 8.0), "own": (None, 0.2)},
    )
    texts = made.columns["reason"].tolist()
    assert texts[::2] == ["largest below 1 N*m", "", "largest above 8 N*m, own above 0.2 rad/s"]
    assert all("t_off" in text for text in texts[1::2])
    assert list(made.reasons) == ["", texts[1], "", texts[3], "", texts[5]]  # of those that failed alone
    assert made.passed.tolist() == [not text for text in texts]
    made.to_csv(tmp_path / "t.csv")
    with (tmp_path / "t.csv").open(newline="") as file:
        assert [row["reason"] for row in csv.DictReader(file)] == texts
    assert texts[0] in str(made).splitlines()[3]
    assert len(made.best("largest", ignore_require=True)) == 3  # none of those that failed


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"parameters": {"shaft.k": [1.0]}}, r"no parameter 'shaft.k'. There are: shaft.c, shaft.d"),
        ({"parameters": {"shaft.c": [1.0, -2.0]}}, r"shaft.*c = -2.0 must be at least 0"),
        (
            {"samples": {"shaft.c": np.array([1.0, -3.0, 2.0])}},
            r"shaft.*c = -3.0 in row 1 of 'shaft.c' must be at least 0",
        ),
        ({"samples": {"J.J": np.array([1.0, np.nan])}}, r"J.*J = nan in row 1 of 'J.J' must be a finite number"),
        ({"parameters": {"shaft.c": 3.0}}, r"must be a sequence of values"),
        ({"parameters": {"shaft.c": []}}, r"at least one parameter, and a value"),
        ({"samples": {"shaft.c": [1.0], "J.J": [1.0, 2.0]}}, r"differ in length: shaft.c 1, J.J 2"),
        ({}, r"Give a grid"),
        ({"parameters": {"J.J": [1.0]}, "measures": ["shaft.tau"]}, r"'shaft.tau' is no measure"),
        ({"parameters": {"J.J": [1.0]}, "measures": ["largest shaft.tau"]}, r"'largest shaft.tau' is no measure"),
        ({"parameters": {"J.J": [1.0]}, "measures": ["max"]}, r"'max' is no measure"),
        ({"parameters": {"J.J": [1.0]}, "measures": ["max shaft.torque"]}, r"'shaft' has: .*shaft.tau"),
        ({"parameters": {"J.J": [1.0]}, "measures": ["damage shaft.tau"]}, r"needs an S-N line"),
        ({"parameters": {"J.J": [1.0]}, "require": {"max": (0, 1)}}, r"there is no measure 'max'"),
        ({"parameters": {"J.J": [1.0]}, "require": {"end J.omega": 1.0}}, r"must be \(low, high\)"),
        ({"parameters": {"J.J": [1.0]}, "require": {"end J.omega": (None, "300")}}, r"'300' is a text. Give a number"),
        ({"parameters": {"J.J": [1.0]}, "require": {"end J.omega": (400, 100)}}, r"at least 400.0 and at most 100.0"),
        ({"parameters": {"J.J": [1.0]}, "require": {"end J.omega": (float("nan"), 1)}}, r"at least nan"),
        ({"parameters": {"J.J": [1.0]}, "initial": {"zz": 1}}, r"No quantity 'zz' in 'swing'"),
        ({"parameters": {"J.J": [1.0]}, "initial": 3}, r"initial = 3 must map"),
        ({"parameters": {"J.J": [1.0]}, "measures": None}, r"measures = None must be a list of names"),
        ({"parameters": {"J.J": [1.0]}, "processes": 0}, r"processes = 0"),
    ],
)
def test_what_is_wrong_is_refused_at_once(given: dict[str, object], message: str) -> None:
    with pytest.raises(sw.ShaftworkError, match=message):
        sweep(swing(), **({"t_end": 1.0, "measures": ["end J.omega"]} | given))  # type: ignore[arg-type]


def test_studies_refuse_what_is_no_network() -> None:
    for study in (
        lambda: sweep(3, {"J.J": [1.0]}, t_end=1.0, measures=["end J.omega"]),  # type: ignore[arg-type]
        lambda: sw.studies.frequency_sensitivities(3),  # type: ignore[arg-type]
        lambda: sw.studies.motion_sensitivities(3, ["end J.omega"], t_end=1.0),  # type: ignore[arg-type]
    ):
        with pytest.raises(sw.ParameterError, match="3 is no network"):
            study()


def test_damage_is_that_of_the_solution() -> None:
    pytest.importorskip("rainflow")
    line = sw.SNLine(amplitude=300.0, cycles=1e6, slope=5)
    made = sweep(swing(), {"motor.tau": [5.0]}, t_end=1.0, measures=["damage shaft.tau"], sn=line)
    expected = swing().simulate(1.0).damage("shaft.tau", sn=line).damage
    assert made.measures["damage shaft.tau"][0] == pytest.approx(expected, rel=1e-9)


def stopped(path: Path, monkeypatch: pytest.MonkeyPatch, after: int, **call: object) -> None:
    """A sweep that its user stops after some chunks."""
    run, count = Worker.run, iter(range(1000))

    def stop(self: Worker, variants: np.ndarray) -> object:
        if next(count) == after:
            raise KeyboardInterrupt
        return run(self, variants)

    with monkeypatch.context() as patch:
        patch.setattr(Worker, "run", stop)
        with pytest.raises(KeyboardInterrupt):
            sweep(swing(), store=path, **call)  # type: ignore[arg-type]


@pytest.mark.slow
def test_a_sweep_that_was_stopped_goes_on_to_identical_results(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "swing.jsonl"
    call = {"samples": {"shaft.c": np.linspace(500.0, 900.0, 20)}, "t_end": 0.2, "engine": "scipy"}
    call |= {"measures": ["max shaft.tau", "end J.omega"]}
    stopped(path, monkeypatch, 1, **call)
    done: list[int] = []
    run = Worker.run
    with monkeypatch.context() as patch:
        patch.setattr(Worker, "run", lambda self, variants: (done.extend(variants.tolist()), run(self, variants))[1])
        resumed = sweep(swing(), store=path, **call)  # type: ignore[arg-type]
    assert done == list(range(8, 20))
    whole = sweep(swing(), **call)  # type: ignore[arg-type]
    for name, values in whole.measures.items():
        np.testing.assert_array_equal(resumed.measures[name], values)
    again = sweep(swing(), store=path, require={"end J.omega": (0.0, None)}, **call)  # type: ignore[arg-type]
    np.testing.assert_array_equal(again.measures["max shaft.tau"], whole.measures["max shaft.tau"])


@pytest.mark.parametrize(
    ("changed", "what"),
    [
        ({"t_end": 0.3}, "t_end"),
        ({"parameters": {"J.J": [1.0, 3.0]}}, "parameters"),
        ({"measures": ["end J.omega"]}, "measures"),
        ({"rtol": 1e-9}, "options"),
    ],
)
def test_a_store_of_another_sweep_is_refused_by_what_differs(
    tmp_path: Path, changed: dict[str, object], what: str
) -> None:
    call: dict[str, object] = {"parameters": {"J.J": [1.0, 2.0]}, "t_end": 0.2, "measures": ["max shaft.tau"]}
    call["store"] = tmp_path / "store.jsonl"
    sweep(swing(), **call)  # type: ignore[arg-type]
    with pytest.raises(sw.ParameterError, match=f"differs in its {what}"):
        sweep(swing(), **(call | changed))  # type: ignore[arg-type]


def test_a_store_of_another_network_and_what_is_no_store_are_refused(tmp_path: Path) -> None:
    call: dict[str, object] = {"parameters": {"J.J": [1.0]}, "t_end": 0.2, "measures": ["max shaft.tau"]}
    sweep(swing(), store=tmp_path / "a", **call)  # type: ignore[arg-type]
    with pytest.raises(sw.ParameterError, match="differs in its network"):
        sweep(swing(2.0), store=tmp_path / "a", **call)  # type: ignore[arg-type]
    (tmp_path / "b").write_text("c = 3\n")
    with pytest.raises(sw.ParameterError, match="is no file of a sweep"):
        sweep(swing(), store=tmp_path / "b", **call)  # type: ignore[arg-type]
    with pytest.raises(sw.ParameterError, match="cannot be used: unable to open database file"):
        sweep(swing(), store=tmp_path / "missing" / "c", **call)  # type: ignore[arg-type]


def small() -> Sweep:
    return sweep(swing(), {"shaft.c": [500.0, 600.0]}, t_end=0.5, measures=["max shaft.tau"], require=LIMITS)


LIMITS = {"max shaft.tau": (0.0, 9.99)}


def test_results_are_a_table_a_file_and_a_picture(tmp_path: Path) -> None:
    made = small()
    assert str(made).splitlines()[0] == f"swing: 2 variants, {int(made.passed.sum())} passed, 0 failed"
    made.to_csv(tmp_path / "t.csv")
    with pytest.raises(sw.ParameterError, match="cannot be written"):
        made.to_csv(tmp_path / "missing" / "t.csv")
    assert (tmp_path / "t.csv").read_text().splitlines()[0] == "shaft.c,max shaft.tau,passed,reason"
    frame = pytest.importorskip("pandas").DataFrame
    assert isinstance(made.table(), frame)
    assert list(made.table().columns) == ["shaft.c", "max shaft.tau", "passed", "reason"]
    pytest.importorskip("matplotlib")
    (axes,) = made.plot().axes
    assert [tick.get_text() for tick in axes.get_xticklabels()] == ["shaft.c\nin N*m/rad", "max shaft.tau\nin N*m"]
    tau = made.measures["max shaft.tau"]
    limits = [line.get_ydata()[0] for line in axes.lines if line.get_color() == "tab:red"]
    np.testing.assert_allclose(limits, (np.array([0.0, 9.99]) - tau.min()) / (np.ptp(tau) or 1.0))
    with pytest.raises(sw.ParameterError, match="There is no column 'J'"):
        made.plot("J")


@pytest.mark.slow
def test_processes_give_the_same() -> None:
    """The one test that starts a process: it costs seconds."""
    call = {"samples": {"shaft.c": np.linspace(500.0, 900.0, 9)}, "t_end": 0.2, "measures": ["max shaft.tau"]}
    one, two = (sweep(swing(), processes=count, **call) for count in (1, 2))  # type: ignore[arg-type]
    np.testing.assert_array_equal(one.measures["max shaft.tau"], two.measures["max shaft.tau"])


@pytest.mark.slow
def test_the_largest_torque_of_a_motor_is_its_pull_out_torque_to_1e_8() -> None:
    """Shafts of many kinds make the slip pass that of the pull-out torque once or, swinging, several times."""
    pytest.importorskip("numba")
    random, count = np.random.default_rng(3), 400
    samples = {
        "shaft.c": 24206.0 * random.uniform(0.5, 1.5, count),
        "shaft.d": 14.0 * random.uniform(0.5, 1.5, count),
        "motor.tau_k": random.uniform(6.0, 10.0, count),
    }
    made = sweep(sw.scenes.crane_start(), samples=samples, t_end=6.5, measures=["max motor.tau"], processes=1)
    assert made.why == ""
    np.testing.assert_allclose(made.measures["max motor.tau"], samples["motor.tau_k"] * 35.5 * 0.95, rtol=1e-8)


@pytest.mark.slow
def test_a_guard_that_is_met_just_after_a_sample_leaves_extremes_right() -> None:
    """A clutch closes at 1 s, within rounding of a sample: from there to the guard it is 1e-14 s."""
    pytest.importorskip("numba")
    net = sw.Network("clutch")
    net.add(sw.TorqueSource("motor", tau=100.0), "a")
    net.add(sw.Inertia("J1", J=27.0), "a")
    net.add(sw.Spring("shaft", c=2e4, d=14.0), "a", "b")
    net.add(sw.Inertia("J2", J=60.0), "b")
    net.add(sw.Clutch("clutch", tau=100.0, t_on=1.0), "b", "c")
    net.add(sw.Inertia("J3", J=30.0), "c")
    samples = {"shaft.c": np.linspace(6e3, 4e4, 24)[:16]}
    names = ["max J1.omega", "min shaft.tau"]
    fast = sweep(net, samples=samples, t_end=2.5, measures=names)
    slow = sweep(net, samples=samples, t_end=2.5, measures=names, engine="scipy", rtol=1e-10)
    assert fast.why == ""
    for name in names:
        size = np.abs(slow.measures["max J1.omega"] if name.endswith("omega") else 100.0).max()  # of the motion
        np.testing.assert_allclose(fast.measures[name], slow.measures[name], atol=1e-9 * size, rtol=0, err_msg=name)


def test_a_picture_of_many_variants_shows_some_all_over_the_table_and_says_so() -> None:
    pytest.importorskip("matplotlib")
    columns = {"J.J": np.repeat([1.0, 2.0, 3.0], 1000), "d.d": np.tile(np.arange(1000.0), 3)}
    made = sw.studies.Sweep("many", columns, {"y": columns["d.d"]}, {}, ("",) * 3000)
    (axes,) = made.plot().axes
    lines = np.array(axes.collections[0].get_segments())[:, :, 1]
    assert len(lines) == 2000
    assert {*np.unique(lines[:, 0]).tolist()} == {0.0, 0.5, 1.0}
    assert axes.get_title() == "many: 3000 variants, 3000 meet the requirements, 2000 of them shown"


def test_what_none_passes_is_a_table_of_no_rows() -> None:
    made = sweep(
        swing(), {"shaft.c": [500.0]}, t_end=0.5, measures=["max shaft.tau"], require={"max shaft.tau": (99, None)}
    )
    best = made.best("max shaft.tau", 1)
    assert len(best) == 0
    assert str(best).splitlines()[0] == "swing: 0 variants, 0 passed, 0 failed"
    assert [len(column) for column in best.columns.values()] == [0, 0, 0, 0]
    assert len(made.rows([0]).best("max shaft.tau", 99)) == 0
    for count in (0, "a", 1.5):
        with pytest.raises(sw.ParameterError, match="must be a number, 1 or more"):
            made.best("max shaft.tau", count)  # type: ignore[arg-type]


def test_a_sweep_of_variants_that_all_fail_says_why_they_ran_one_by_one() -> None:
    net = sw.Network("falling")
    net.add(sw.TorqueSource("m", tau=sympy.Piecewise((5, sw.omega < 3), (1, True))), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Damper("d", d=1.0), "a")
    made = sweep(net, {"J.J": np.linspace(1.0, 2.0, 40)}, t_end=3.0, measures=["max J.omega"], processes=1)
    assert made.failed.all()
    assert made.why


def test_a_picture_of_a_sweep_names_the_extra_that_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    net = sw.Network("one")
    net.add(sw.TorqueSource("m", tau=1.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    made = sweep(net, {"J.J": [1.0, 2.0]}, t_end=1.0, measures=["max J.omega"], processes=1)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    with pytest.raises(sw.MissingExtraError, match=r"Sweep\.plot\(\) needs matplotlib"):
        made.plot()


def test_a_result_is_never_minus_zero() -> None:
    net = sw.Network("reversed")
    net.add(sw.TorqueSource("m", tau=0.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.Gear("g", ratio=-2.0), "a", "b")
    net.add(sw.Spring("s", c=1.0), "b", "c")
    net.add(sw.Inertia("K", J=1.0), "c")
    names = ["end b.omega", "max b.omega", "min b.omega", "mean b.omega"]
    made = sweep(net, {"J.J": np.linspace(1.0, 2.0, 40)}, t_end=1.0, measures=names, processes=1)
    for name in names:
        assert not np.signbit(made.measures[name]).any()
