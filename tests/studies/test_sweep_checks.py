"""Whether the values of a part go together is asked where they vary, and of those that do not it is known."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

import numpy as np
import pytest

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
