"""Every engine says how far it is, and stops where its caller says so: Ctrl-C, or what a callback raises."""

from __future__ import annotations

import _thread
import hashlib
import threading

import numpy as np
import pytest

import shaftwork as sw
from shaftwork.core.calls import interruptible

RUNS = {
    "scipy": ("pump", 1e3),
    "scipy-radau": ("pump", 1e3),
    "sundials": ("pump", 1e3),
    "heyoka": ("pump", 1e4),
    "banded": ("pump", 1e3),
    "wave": ("wave", 10.0),
}
"""The drive, and an end that needs many steps; s."""


class Enough(Exception):  # noqa: N818 (not an error of the run)
    """What a caller raises who has seen enough."""


def drive(line: str) -> sw.Network:
    net = sw.Network(line)
    net.add(sw.KlossMotor("motor", tau_k=80.0, s_k=0.2, n_sync=1500), "rotor")
    net.add(sw.Inertia("J1", J=0.4), "rotor")
    model = sw.Wave() if line == "wave" else sw.Lumped(3)
    net.add(sw.Shaft("line", length=3.0, diameter=0.05, damping=0.0, model=model), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=1.5), "wheel")
    net.add(sw.FanLoad("fan", tau_n=20.0, n_n=1450), "wheel")
    return net


@pytest.mark.slow
@pytest.mark.parametrize("engine", RUNS)
def test_a_run_says_how_far_it_is_and_stops_where_its_caller_raises(engine: str) -> None:
    line, t_end = RUNS[engine]
    times: list[float] = []

    def progress(t: float) -> None:
        times.append(t)
        if len(times) == 3:
            raise Enough

    with pytest.raises(Enough):
        drive(line).simulate(t_end, engine=engine, progress=progress)
    assert 0 < times[0] <= times[1] <= times[2] < t_end


@pytest.mark.slow
def test_a_motion_of_several_phases_says_how_far_it_is() -> None:
    times: list[float] = []
    sol = sw.scenes.crane(gap=0.003).simulate(9.0, engine="scipy", progress=times.append)
    assert len(times) >= sol.statistics["steps"]
    assert max(times) == pytest.approx(9.0)


@pytest.mark.slow
def test_breaks_leave_a_compiled_run_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """The steps are the same; heyoka drops what its time holds beyond a double, so that states round otherwise."""
    compiled = drive("pump").compile()
    whole = compiled.simulate(0.5, engine="heyoka")
    monkeypatch.setattr("shaftwork.integrate.taylor.heyoka_taylor.UNINTERRUPTED", 1)
    parts = compiled.simulate(0.5, engine="heyoka", max_steps=whole.statistics["steps"])  # to the very last
    np.testing.assert_allclose(whole.x, parts.x, rtol=1e-12, atol=1e-12 * np.abs(whole.x).max())
    assert whole.statistics == parts.statistics
    assert (whole.steps == parts.steps).all()
    early, late = (sol.at([0.1234, 0.4]).x for sol in (whole, parts))
    np.testing.assert_allclose(early, late, rtol=1e-12, atol=1e-12 * np.abs(whole.x).max())


def test_ctrl_c_ends_the_wait_for_compiled_code() -> None:
    done: list[bool] = []

    def work() -> None:
        hashlib.pbkdf2_hmac("sha256", b"", b"", 10_000_000)  # some seconds without Python's lock
        done.append(True)

    threading.Timer(0.1, _thread.interrupt_main).start()
    with pytest.raises(KeyboardInterrupt):
        interruptible(work)
    assert not done


def test_what_compiled_code_gives_or_raises_passes_through() -> None:
    assert interruptible(divmod, 7, 2) == (3, 1)
    with pytest.raises(ZeroDivisionError, match="by zero"):
        interruptible(divmod, 7, 0)


def test_the_exact_engine_says_how_far_it_is_at_each_instant_of_its_inputs() -> None:
    net = sw.Network("steps")
    net.add(sw.TorqueSource("motor", tau=sw.Step(1.0, 1.0) + sw.Step(2.0, 2.5)), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    times: list[float] = []
    assert net.simulate(4.0, progress=times.append).engine == "exact"
    assert times == [1.0, 2.5, 4.0]
