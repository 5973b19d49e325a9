"""Controllers in what is written for other tools, and in stepped motions."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import shaftwork as sw


def loop(sample_time: float | None) -> sw.Network:
    """A PI controller of the speed behind a spring."""
    last = -1.6 if sample_time else 8.0
    net = sw.Network("loop")
    net.add(sw.Inertia("J1", J=0.5), "a")
    net.add(sw.Spring("shaft", c=400.0, d=1.0), "a", "b")
    net.add(sw.Inertia("J2", J=1.0), "b")
    net.add(sw.TorqueSource("load", tau=0.0), "b")
    pi = sw.TransferFunctionController(
        "pi",
        numerator=[2.0, last],
        denominator=[1.0, -1.0 if sample_time else 0.0],
        measured="J2.omega",
        reference=10.0,
        sample_time=sample_time,
    )
    net.add(pi, "a")
    return net


WRITERS: dict[str, Callable[[sw.Network], Any]] = {
    "Modelica": lambda net: net.to_modelica(),
    "flat Modelica": lambda net: net.to_modelica(form="flat"),
    "SPICE": lambda net: net.to_spice(),
}


@pytest.mark.parametrize("writer", WRITERS)
def test_what_is_written_without_instants_refuses_a_sampled_controller(writer: str) -> None:
    with pytest.raises(sw.CompileError, match=r"'pi' acts every 0\.05 s .*continuous controller"):
        WRITERS[writer](loop(0.05))


def test_a_part_of_modelica_cannot_read_another_one() -> None:
    with pytest.raises(sw.CompileError, match=r"'pi' reads J2\.omega.*form 'flat'"):
        loop(None).to_modelica()
    assert "der(" in loop(None).to_modelica(form="flat")


@pytest.mark.parametrize("sample_time", [None, 0.05, 0.013])
def test_many_steps_of_a_loop_are_one_run(sample_time: float | None) -> None:
    model = loop(sample_time).compile()
    run, speeds = model.start(inputs=["load.tau"], rtol=1e-11), []
    for _ in range(100):
        run.step(0.01)
        speeds.append(run["J2.omega"])
    whole = model.simulate(1.0, t_eval=101, rtol=1e-11)["J2.omega"][1:]
    assert np.abs(np.array(speeds) - whole).max() < 1e-9 * np.abs(whole).max()


@pytest.mark.parametrize("friction", [0.0, 2.0])
def test_a_reference_that_is_set_from_outside_is_what_a_sampled_controller_takes(friction: float) -> None:
    """It is set before the first sample, and once again between two of them."""

    def net(reference: object) -> sw.Network:
        net = loop(0.05)
        net.replace(net_part(net, reference))
        if friction:
            net.add(sw.CoulombLoad("friction", tau=friction), "b")
        return net

    run = net(0.0).compile().start(inputs=["pi.reference"], rtol=1e-11)
    for k in range(50):
        run.set("pi.reference", 100.0 if k < 26 else 40.0)
        run.step(0.02)
    wanted = net(sw.Table([0.0, 0.51999, 0.52, 1.0], [100.0, 100.0, 40.0, 40.0])(sw.t)).simulate(1.0, rtol=1e-11)
    assert run["J2.omega"] == pytest.approx(wanted["J2.omega"][-1], rel=1e-8)


def net_part(net: sw.Network, reference: object) -> sw.Component:
    """The controller with another reference."""
    part = next(placed.part for placed in net.netlist().placed if placed.part.name == "pi")
    return dataclasses.replace(part, reference=reference)
