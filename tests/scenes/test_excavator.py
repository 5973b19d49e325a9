"""The excavator against the three numbers of Marinkovic 2012, figure 13."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

import numpy as np
import pytest

import shaftwork as sw
from shaftwork.scenes.excavator import T_DIG, T_END

SEEDS = 20
SOILS = ("fault zone", "transitional zone", "grey clay")


@cache
def torques(soil: str) -> np.ndarray[Any, Any]:
    """(seeds, times) of the shaft."""
    model = sw.scenes.excavator(soil).compile()
    runs = (model.simulate(T_END, t_eval=15001, parameters={"digging.seed": float(seed)}) for seed in range(SEEDS))
    return np.stack([run["shaft.tau"] for run in runs])


@pytest.mark.slow
def test_twenty_seeds_lie_around_the_three_printed_numbers() -> None:
    """Both extremes are those of the start, which no seed changes, but for a few seeds that dig beyond them."""
    tau = torques("grey clay")
    assert np.median(tau.max(axis=1)) == pytest.approx(2646.0, abs=2.0)
    assert tau.max() < 1.1 * 2646
    assert tau.min(axis=1) == pytest.approx(np.full(SEEDS, -1108.0), abs=5.0)
    means = tau.mean(axis=1)
    assert means.min() < 1337 < means.max()
    assert means.mean() == pytest.approx(1337.0, abs=3 * means.std() / np.sqrt(SEEDS))


@pytest.mark.slow
def test_the_harder_the_soil_the_higher_the_mean_torque() -> None:
    means = [torques(soil).mean() for soil in SOILS]
    assert means[0] < means[1] < means[2]


@pytest.mark.slow
def test_the_wheel_turns_in_the_air_until_5_s_and_then_digs() -> None:
    sol = sw.scenes.excavator().simulate(T_END, t_eval=3001)
    air, dug = sol["digging.tau"][sol.t < T_DIG], sol["digging.tau"][sol.t > T_DIG + 1.0]
    assert not air.any()
    assert (dug < 0).all()
    assert sol["shaft.tau"][sol.t <= T_DIG].min() < -1000 < 0 < sol["shaft.tau"][sol.t > T_DIG + 1.0].min()


def test_the_motor_makes_no_warning_that_the_scene_has_answered() -> None:
    """Warnings are errors here; a motor with this pull-up speed alone does warn."""
    sw.scenes.excavator()
    with pytest.warns(sw.NetworkWarning, match="turns once more"):
        sw.motors["excavator 250 kW"].cage("motor", n_s=537.0)


@pytest.mark.parametrize("soil", ["fault zone", "transitional zone", "grey clay"])
def test_a_soil_is_found_by_its_name_from_python_and_from_a_file(soil: str, tmp_path) -> None:
    net = sw.scenes.excavator(soil)
    net.save(tmp_path / "excavator.toml")
    text = (tmp_path / "excavator.toml").read_text(encoding="utf-8")
    by_name = re.sub(r"soil = .*", f'soil = "{soil}"', text)
    (tmp_path / "by name.toml").write_text(by_name, encoding="utf-8")
    with pytest.warns(sw.NetworkWarning, match="quartic"):
        loaded = sw.Network.load(tmp_path / "by name.toml")
    assert loaded.parts[-1].soil in (soil, net.parts[-1].soil)
    assert loaded.parts[-1].mean_torque == net.parts[-1].mean_torque


@pytest.mark.parametrize("kind", [sw.CageMotor, sw.BucketWheelLoad])
def test_the_excavator_as_a_train_has_the_same_motor_and_wheel(kind: type[sw.Component]) -> None:
    """Eleven masses, driven and braked as the scene of two."""
    train, scene = (made("fault zone", seed=3.0) for made in (sw.scenes.excavator_train, sw.scenes.excavator))
    assert sum(isinstance(part, sw.Inertia) for part in train.parts) == 11
    found, wanted = ([part for part in net.parts if isinstance(part, kind)] for net in (train, scene))
    assert len(found) == 1
    assert found == wanted


def test_an_unknown_soil_is_one_problem_that_names_those_there_are() -> None:
    with pytest.raises(sw.NetworkError, match=r"'sand' is no soil\. The soils are: fault zone,.* grey clay") as said:
        sw.scenes.excavator("sand").compile()
    assert len(said.value.problems) == 1
