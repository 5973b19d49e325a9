"""What is asked of values and names before a sweep, and what it says of the way it ran."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.components import REGISTRY


@pytest.fixture
def limited() -> Iterator[type[sw.Component]]:
    """A load of one's own whose least torque must not be above its largest; it counts how often it is asked."""

    @sw.component
    class Limited(sw.Component):
        least: float = sw.parameter("N*m", "least torque")
        most: float = sw.parameter("N*m", "largest torque")
        drag: float = sw.parameter("N*m*s/rad", "torque over speed", default=1.0)
        asked: ClassVar[list[int]] = []
        role: ClassVar = "source"
        ports: ClassVar = (sw.Port("a"),)

        def __post_init__(self) -> None:
            self.asked.append(1)
            if self.least > self.most:
                raise sw.ParameterError(f"Limited '{self.name}': least is above most.")

        def branches(self, p: Any) -> Any:
            yield sw.ThroughLaw(p.most + p.drag * sw.ACROSS)

    yield Limited
    del REGISTRY["Limited"]


def train(load: sw.Component) -> sw.Network:
    net = sw.Network("train")
    net.add(sw.TorqueSource("motor", tau=5.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(load, "a")
    return net


def test_a_check_that_reads_nothing_that_varies_is_not_made_for_every_variant(limited: Any) -> None:
    net, count = train(limited("load", least=1.0, most=2.0)), 64
    limited.asked.clear()
    found = sw.studies.sweep(
        net, samples={"load.drag": np.linspace(0.5, 2.0, count)}, t_end=40.0, measures={"speed": "end J.omega"}
    )
    assert not found.failed.any()
    assert len(limited.asked) < count
    assert found.measures["speed"] == pytest.approx((5.0 - 2.0) / np.linspace(0.5, 2.0, count), rel=1e-7)


def test_a_check_that_reads_what_varies_is_made_for_every_variant(limited: Any) -> None:
    most = np.linspace(0.5, 2.0, 31)
    found = sw.studies.sweep(
        train(limited("load", least=1.0, most=2.0)),
        samples={"load.most": most, "load.drag": np.linspace(1.0, 2.0, 31)},
        t_end=1.0,
        measures=["end J.omega"],
    )
    assert (found.failed == (most < 1.0)).all()
    assert {reason for reason in found.reasons if reason} == {"Limited 'load': least is above most."}


@pytest.mark.parametrize("name", ["load.tau", "passed", "reason"])
def test_a_measure_does_not_take_the_name_of_another_column(name: str) -> None:
    net = train(sw.CoulombLoad("load", tau=1.0))
    with pytest.raises(sw.ParameterError, match=f"No measure can be called '{name}'"):
        sw.studies.sweep(net, {"load.tau": [1.0, 2.0]}, t_end=0.1, measures={name: "end J.omega"})


def test_a_data_frame_with_two_columns_of_one_name_is_refused() -> None:
    frame = pytest.importorskip("pandas").DataFrame([[1.0, 2.0], [3.0, 4.0]], columns=["J.J", "J.J"])
    net = train(sw.CoulombLoad("load", tau=1.0))
    with pytest.raises(sw.ParameterError, match=r"There are two columns 'J\.J'"):
        sw.studies.sweep(net, samples=frame, t_end=0.1, measures=["end J.omega"])


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (-1.0, "tau = -1.0 in row 41 of 'load.tau' must be at least 0"),
        (np.nan, "tau = nan in row 41 of 'load.tau' must be a finite number"),
        (-np.inf, "tau = -inf in row 41 of 'load.tau' must be a finite number"),
        ("a", "tau = 'a' in row 41 of 'load.tau' must be a number"),
    ],
)
@pytest.mark.parametrize("kind", [list, lambda values: np.array(values, dtype=object), np.array])
def test_what_is_not_admissible_in_a_table_is_named_by_row_and_column(kind: Any, wrong: Any, words: str) -> None:
    if kind is np.array and wrong == "a":
        return  # of numpy a text would make all of them texts
    column = kind([1.0] * 41 + [wrong] + [2.0] * 9)
    net = train(sw.CoulombLoad("load", tau=1.0))
    with pytest.raises(sw.ParameterError, match=words):
        sw.studies.sweep(net, samples={"J.J": np.ones(51), "load.tau": column}, t_end=0.1, measures=["end J.omega"])


def test_rows_of_a_data_frame_are_counted_from_zero_whatever_its_index() -> None:
    frame = pytest.importorskip("pandas").DataFrame({"load.tau": [1.0, None, 3.0]}, index=[7, 8, 9])
    net = train(sw.CoulombLoad("load", tau=1.0))
    with pytest.raises(sw.ParameterError, match=r"tau = nan in row 1 of 'load\.tau'"):
        sw.studies.sweep(net, samples=frame, t_end=0.1, measures=["end J.omega"])


@pytest.mark.parametrize("values", [[1.0, 1.5, 2.0], np.array([3.0, 1.0, 2.5, 1.0])])
def test_what_must_be_whole_is_refused_wherever_it_is_not(values: Any) -> None:
    net = train(sw.AveragedBLDC("m", U=48.0, R=0.5, L=1e-3, k=0.1, pole_pairs=2))
    with pytest.raises(sw.ParameterError, match=r"'m': pole_pairs = [12]\.5 must be .*whole"):
        sw.studies.sweep(net, {"m.pole_pairs": values}, t_end=0.1, measures=["end J.omega"])


def test_why_names_the_cause() -> None:
    net = sw.Network("start")
    net.add(sw.SpeedSource("motor", omega=sympy.sin(sw.t)), "a")
    net.add(sw.Spring("shaft", c=100.0, d=0.1), "a", "b")
    net.add(sw.Inertia("J", J=1.0), "b")
    made = sw.studies.sweep(net, {"J.J": np.linspace(1.0, 2.0, 16)}, t_end=0.1, measures=["end J.omega"])
    assert made.why.startswith("a speed is prescribed")


def test_where_the_first_variant_fails_the_others_run_side_by_side_all_the_same() -> None:
    pytest.importorskip("numba")
    net = sw.Network("stop")
    net.add(sw.TorqueSource("motor", tau=2.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.HardStop("h", upper=0.3, lower=-0.1, c=1e4, d=10.0), "a", "b")
    net.add(sw.Inertia("J2", J=2.0), "b")
    alone = net.simulate(0.5)["J.omega"][-1]
    found = sw.studies.sweep(
        net, samples={"h.upper": np.r_[-5.0, np.full(15, 0.3)]}, t_end=0.5, measures=["end J.omega"], processes=1
    )
    assert found.why == ""
    assert "must be below upper" in found.reasons[0]
    assert found.measures["end J.omega"][1:] == pytest.approx(alone, rel=1e-6)  # both to rtol 1e-8


@pytest.mark.parametrize("first", [-0.05, 0.0, 0.3])
def test_whatever_the_first_variant_is_each_starts_at_its_rigid_limit_as_if_alone(first: float) -> None:
    """Pushed for t = 0.5 s by 2 N m, J of 1 kg m^2 turns alone, or with J2 of 2 kg m^2 from an upper limit of zero."""
    net = sw.Network("stop")
    net.add(sw.TorqueSource("motor", tau=2.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    net.add(sw.HardStop("h", upper=0.3, lower=-0.1), "a", "b")
    net.add(sw.Inertia("J2", J=2.0), "b")
    upper = np.r_[first, -0.05, 0.0, np.full(13, 0.3)]
    found = sw.studies.sweep(net, samples={"h.upper": upper}, t_end=0.5, measures=["end J.omega"], processes=1)
    speeds = np.select([upper < 0.0, upper == 0.0], [np.nan, 1.0 / 3.0], 1.0)
    assert found.measures["end J.omega"] == pytest.approx(speeds, rel=1e-7, nan_ok=True)  # rtol is 1e-8
    assert ["is rigid" in reason for reason in found.reasons] == np.isnan(speeds).tolist()
    assert "first of them fails" not in found.why


@pytest.mark.slow
def test_what_hardly_moves_is_known_with_a_smaller_tolerance() -> None:
    """A linear motion is proportional to its load; the absolute tolerance, that of 0.001 rad/s, is not."""
    pytest.importorskip("numba")

    def peaks(size: float) -> np.ndarray:
        net = train(sw.Damper("d", d=0.2))
        net.add(sw.TorqueSource("slow", tau=size * sympy.sin(sw.t)), "a")
        net.add(sw.Spring("s", c=50.0, d=0.1), "a", "b")
        net.add(sw.Inertia("J2", J=1.0), "b")
        samples = {"motor.tau": np.full(16, size), "J2.J": np.linspace(0.5, 2.0, 16)}
        made = sw.studies.sweep(net, samples=samples, t_end=30.0, measures=["max s.tau"], rtol=1e-12)
        assert made.why == ""
        return made.measures["max s.tau"] / size

    np.testing.assert_allclose(peaks(1e-8), peaks(1.0), rtol=1e-5)  # as docs/sweeps.md says


UNGUARDED = """
import shaftwork as sw
net = sw.Network("train")
net.add(sw.SpeedSource("drive", omega=10 * sw.t), "a")
net.add(sw.Spring("shaft", c=100.0, d=1.0), "a", "b")
net.add(sw.Inertia("J", J=1.0), "b")
sw.studies.sweep(net, {"J.J": [1.0, 2.0, 3.0, 4.0]}, t_end=0.1, measures=["end J.omega"], processes=2)
"""


@pytest.mark.slow
def test_a_script_without_a_guard_is_told_so_once(tmp_path: Path) -> None:
    """The processes run the script again: each of them printed a page of its own."""
    script = tmp_path / "script.py"
    script.write_text(UNGUARDED)
    told = subprocess.run([sys.executable, script], capture_output=True, text=True, check=False, timeout=120).stderr
    assert "must do so under 'if __name__ == \"__main__\":'" in told.splitlines()[-1]
    assert "bootstrapping" not in told
    assert "spawn" not in told


def test_a_grid_of_absurd_size_is_refused_with_its_number() -> None:
    net = train(sw.Damper("d", d=0.2))
    values = np.linspace(1.0, 2.0, 1280)
    grid = {"J.J": values, "d.d": values, "motor.tau": values}
    with pytest.raises(sw.ParameterError, match=r"A grid of 1280 x 1280 x 1280 values has 2097152000 variants"):
        sw.studies.sweep(net, grid, t_end=0.1, measures=["end J.omega"])


def test_a_measure_that_other_processes_do_not_find_is_refused_where_they_are_asked_for() -> None:
    call: dict[str, Any] = {"t_end": 0.1, "measures": {"speed": lambda solution: float(solution["J.omega"][-1])}}
    net = train(sw.Damper("oil", d=1.0))
    assert not sw.studies.sweep(net, {"J.J": [1.0, 2.0]}, **call).failed.any()
    inside = {**call, "measures": {"speed": partial(call["measures"]["speed"])}}
    with pytest.raises(sw.ParameterError, match=r"do not find the measure 'speed'"):
        sw.studies.sweep(net, {"J.J": [1.0, 2.0]}, processes=2, **inside)
    with pytest.raises(
        sw.ParameterError, match=r"processes = 2: other processes do not find the measure 'speed'.* lambda"
    ):
        sw.studies.sweep(net, {"J.J": [1.0, 2.0]}, processes=2, **call)


def test_a_part_of_a_class_that_other_processes_do_not_find_is_named(limited: Any) -> None:
    net = train(limited("load", least=1.0, most=2.0))
    call: dict[str, Any] = {"t_end": 0.1, "measures": ["end J.omega"], "engine": "scipy"}
    assert not sw.studies.sweep(net, {"J.J": [1.0, 2.0]}, **call).failed.any()
    with pytest.raises(sw.ParameterError, match=r"processes = 2: other processes do not find the class of 'load'"):
        sw.studies.sweep(net, {"J.J": [1.0, 2.0]}, processes=2, **call)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"initial": {"J.omega": np.nan}}, r"the start value of 'J\.omega' = nan must be a finite number"),
        ({"initial": {"J.omega": "x"}}, r"the start value of 'J\.omega' = 'x'"),
        ({"t_eval": [0.0, 100.0]}, "t_eval must hold strictly increasing times between 0 and 0.1 s"),
        ({"samples": {"J.J": np.ma.masked_array([1.0, 2.0], [False, True])}}, r"'J\.J' has values that are masked"),
    ],
)
def test_what_is_wrong_for_all_variants_is_no_reason_of_each(change: dict[str, Any], words: str) -> None:
    call: dict[str, Any] = {"samples": {"J.J": [1.0, 2.0]}, "t_end": 0.1, "measures": ["end J.omega"], **change}
    with pytest.raises(sw.ParameterError, match=words):
        sw.studies.sweep(train(sw.Damper("oil", d=1.0)), **call)


def test_a_named_engine_follows_each_variant_by_itself() -> None:
    pytest.importorskip("numba")
    call: dict[str, Any] = {"t_end": 0.1, "measures": ["end J.omega"], "processes": 1}
    net = train(sw.Damper("oil", d=1.0))
    made = sw.studies.sweep(net, {"J.J": np.linspace(1.0, 2.0, 20)}, engine="numba", **call)
    assert made.why == "engine = 'numba' was asked for"
    alone = net.compile().simulate(0.1, engine="numba", parameters={"J.J": 1.0}, t_eval=2)
    assert made.measures["end J.omega"][0] == alone["J.omega"][-1]
