"""Random trains with gaps, frictions, brakes, clutches, freewheels: every step is held against what its modes claim.

The claims are written here from the laws of the parts, in speeds, twists and torques that are read from the solution;
they share nothing with the guards that end phases.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from dataclasses import replace

import networkx as nx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shaftwork import NetworkWarning, SimulationError, Solution
from tests.properties.examples import Array, processor_time_limit, share_of_examples
from tests.trains import GROUND, Part, Train, trains

ENGINES = ("heyoka", "scipy", "sundials")
RTOL = 1e-9
# Dense output between steps is less exact than the steps, and a torque is a speed times stiffness over frequency.
CLOSE = 1e-6
# An engine's error grows with every event: the loosest of 300 pairs of runs with up to 40 events differed by 3e-7.
AGREE, MOST_EVENTS = 1e-5, 40
HOLDS = ("DryFriction", "CoulombLoad", "Brake", "Clutch", "Freewheel")
# What a mode needs at most: the loudest trains have some 200 events in a second.
CHANGES = 5000


def moved(train: Train, engine: str = "heyoka") -> Solution:
    """The motion of a train; a motion that has no end would be a failure."""
    with warnings.catch_warnings(), processor_time_limit(60.0):
        warnings.simplefilter("ignore", NetworkWarning)  # parts may be loose of each other on purpose
        model = train.compiled()
        initial = {name: value for name, value in train.initial.items() if name in model.states}
        return model.simulate(train.t_end, engine=engine, rtol=RTOL, initial=initial)


def inside_phases(sol: Solution) -> tuple[Array, Array]:
    """Times inside every accepted step, and the phase of each; an instant between two phases belongs to neither."""
    steps = sol.steps
    shares = np.array([0.0, 0.21, 0.5, 0.83])
    times = np.unique(np.concatenate([steps[:1], (steps[:-1] + np.outer(shares, np.diff(steps))).ravel(), steps[-1:]]))
    starts = np.array([phase.start for phase in sol.phases])
    times = times[~np.isin(times, starts)]
    return times, np.searchsorted(starts, times, side="right") - 1


def rounded(speed: Array) -> Array:
    """The size of a speed in rad/s that is zero but for the rounding of sums of others."""
    return np.maximum(np.abs(speed) - 1e-13, 0.0)


class Witness:
    """A motion at times inside its phases, and what the modes of its parts claim there.

    Args:
        train: what moves.
        sol: its motion.
    """

    def __init__(self, train: Train, sol: Solution) -> None:
        self.times, index = inside_phases(sol)
        self._at, self._train = sol.at(self.times), train
        self._phases = [sol.phases[k].modes for k in index.tolist()]
        speeds = {part.nodes[0]: self._at[f"{part.name}.omega"] for part in train.parts if part.type == "Inertia"}
        self._speeds = {**speeds, GROUND: np.zeros(self.times.size)}
        self._slow = CLOSE * max(1.0, *(np.abs(speed).max() for speed in speeds.values()))

    def objections(self) -> Iterator[str]:
        """Every claim that fails: part, mode, claim, time and by how much."""
        for part in self._train.parts:
            if self._phases and part.name in self._phases[0]:
                words = np.array([modes[part.name] for modes in self._phases])
                tau = self._at[f"{part.name}.tau"] * (-1.0 if part.type == "CoulombLoad" else 1.0)
                a, b = part.ends
                judged = {"Freewheel": self._freewheel, "Backlash": self._contact, "HardStop": self._contact}
                claims = judged.get(part.type, self._friction)(part, words, self._speeds[a] - self._speeds[b], tau)
                for claim, beyond in claims:
                    if beyond.size and beyond.max() > 0:
                        k = int(np.argmax(beyond))
                        yield f"{part.name} {words[k]}: {claim} at {self.times[k]!r} s, by {beyond[k]:.3g}"

    @staticmethod
    def _weak(tau: Array) -> float:
        return float(CLOSE * max(1.0, np.abs(tau).max()))

    def _friction(self, part: Part, words: Array, speed: Array, tau: Array) -> Iterator[tuple[str, Array]]:
        forward, backward = np.char.endswith(words, "forward"), np.char.endswith(words, "backward")
        held, apart = np.isin(words, ("stuck", "locked", "engaged")), np.isin(words, ("released", "open"))
        yield "is no mode", 1.0 * ~(forward | backward | held | apart)
        yield "slips backward", forward * (-speed - self._slow)
        yield "slips forward", backward * (speed - self._slow)
        yield "moves", held * rounded(speed)
        yield "pushes", np.where(forward, -tau, np.where(backward, tau, 0.0)) - self._weak(tau)
        yield "holds more than it can", held * (np.abs(tau) - self._capacity(part) - self._weak(tau))
        begins, ends = part.values.get("t_on", -math.inf), part.values.get("t_off", math.inf)
        clear = (np.abs(self.times - begins) > 1e-9) & (np.abs(self.times - ends) > 1e-9)
        acts = (self.times > begins) & (self.times < ends)
        yield "does not act", 1.0 * (clear & acts & apart)
        yield "acts", clear & ~acts & ~apart
        yield "has a torque", apart * np.abs(tau)

    def _capacity(self, part: Part) -> Array:
        most = next(part.values[name] for name in ("tau", "tau_s", "tau_c") if name in part.values)
        after = np.maximum(self.times - part.values.get("t_on", 0.0), 0.0)
        if "t_rise" in part.values:
            return np.asarray(most * np.minimum(1.0, after / part.values["t_rise"]))
        if "t_lag" in part.values:
            return np.asarray(most * (1.0 - np.exp(-after / part.values["t_lag"])))
        return np.full(self.times.size, most)

    def _freewheel(self, _: Part, words: Array, speed: Array, tau: Array) -> Iterator[tuple[str, Array]]:
        locked = words == "locked"
        yield "overruns", ~locked * (speed - self._slow)
        yield "has a torque", ~locked * np.abs(tau)
        yield "moves", locked * rounded(speed)
        yield "pulls", locked * (-tau - self._weak(tau))

    def _contact(self, part: Part, words: Array, speed: Array, tau: Array) -> Iterator[tuple[str, Array]]:
        twist, half = self._at[f"{part.name}.phi"], part.values.get("gap", math.inf) / 2
        upper, lower = part.values.get("upper", half), part.values.get("lower", -half)
        is_open, ahead, behind = (words == word for word in ("open", "in contact", "in contact backward"))
        yield "is no mode", 1.0 * ~(is_open | ahead | behind)
        yield "has a torque", is_open * np.abs(tau)
        yield "pulls", np.where(ahead, -tau, np.where(behind, tau, 0.0)) - self._weak(tau)
        if part.is_rigid:
            yield "is beyond its limit", is_open * (np.maximum(twist - upper, lower - twist) - CLOSE)
            yield "moves", ~is_open * rounded(speed)
            yield "is off its limit", np.where(ahead, np.abs(twist - upper), 0.0) - CLOSE
            yield "is off its limit", np.where(behind, np.abs(lower - twist), 0.0) - CLOSE
            return
        c, d = part.values["c"], part.values["d"]
        yield "does not touch", np.where(ahead, upper - twist, np.where(behind, twist - lower, 0.0)) - CLOSE
        # beyond its limit it is open only while its flanks part faster than they spring back
        above, below = (
            c * (twist - limit) + d * speed if math.isfinite(limit) else 0 * twist for limit in (upper, lower)
        )
        yield "has missed a contact", np.where(is_open & (twist > upper + CLOSE), above, 0.0) - self._weak(above)
        yield "has missed a contact", np.where(is_open & (twist < lower - CLOSE), -below, 0.0) - self._weak(below)
        wrong = np.where(ahead, np.abs(tau - above), np.where(behind, np.abs(tau - below), 0.0))
        yield "breaks its law", wrong - self._weak(tau)


@pytest.mark.slow
@given(trains())
@share_of_examples(0.3)
def test_every_step_lies_in_the_region_of_its_modes(train: Train) -> None:
    sol = moved(train)
    assert list(Witness(train, sol).objections()) == []
    assert len(sol.events) < CHANGES
    assert [phase.start for phase in sol.phases[1:]] == [phase.end for phase in sol.phases[:-1]]


def clear(train: Train) -> set[str]:
    """Parts whose events are the same whoever finds them: what they hold is not shared with others.

    Two that hold the same shaft share its torque as they like. Where rigid flanks or freewheels rest, any of them may
    be the first to part as a torque through all of them goes through zero.
    """
    joints = nx.MultiGraph()
    for part in train.parts:
        if part.type in (*HOLDS, "Gear") or part.is_rigid:
            joints.add_edge(*part.ends, name=part.name)
    simple = nx.Graph(joints)
    bridges = {frozenset(pair) for pair in nx.bridges(simple)}
    alone = {p.name for p in train.parts if frozenset(p.ends) in bridges and joints.number_of_edges(*p.ends) == 1}
    rests = any(part.type == "Freewheel" or part.is_rigid for part in train.parts)
    springy = {p.name for p in train.parts if p.type in ("Backlash", "HardStop") and not p.is_rigid}
    return set() if rests else springy | alone


def by_part(sol: Solution, names: set[str]) -> dict[str, list[tuple[float, str, str]]]:
    """The events of each part, in their order."""
    return {name: [(time, *modes) for time, part, *modes in sol.events if part == name] for name in sorted(names)}


def assert_alike(train: Train, one: Solution, other: Solution) -> None:
    """The same end, and the same events at the same times where they are determined."""
    if max(len(one.events), len(other.events)) > MOST_EVENTS:
        return
    speeds = [f"{part.name}.omega" for part in train.parts if part.type == "Inertia"]
    ends = [np.array([sol[name][-1] for name in speeds]) for sol in (one, other)]
    np.testing.assert_allclose(*ends, rtol=0, atol=AGREE * max(1.0, np.abs(ends[0]).max()))
    names = clear(train)
    here, there = by_part(one, names), by_part(other, names)
    for name in sorted(names):
        assert [event[1:] for event in here[name]] == [event[1:] for event in there[name]], name
        times = [[event[0] for event in events] for events in (here[name], there[name])]
        np.testing.assert_allclose(*times, rtol=0, atol=AGREE)


@pytest.mark.slow
@given(trains(most=5))
@share_of_examples(0.12)
def test_engines_agree_in_the_end_and_in_the_events(train: Train) -> None:
    found = {engine: moved(train, engine) for engine in ENGINES}
    for engine in ENGINES[1:]:
        assert list(Witness(train, found[engine]).objections()) == []
        assert_alike(train, found["heyoka"], found[engine])


@pytest.mark.slow
@given(trains(most=5), st.floats(0.01, 0.99))
@share_of_examples(0.2)
def test_a_motion_that_is_cut_and_goes_on_is_the_whole_motion(train: Train, share: float) -> None:
    """Cut at a time of its own, and at the time of an event."""
    whole = moved(train)
    if len(whole.events) > MOST_EVENTS:
        return
    model, speeds = train.compiled(), [f"{part.name}.omega" for part in train.parts if part.type == "Inertia"]
    for cut in (share * train.t_end, *(event[0] for event in whole.events[1:2])):
        times = np.linspace(cut, train.t_end, 20)
        rest = model.simulate(train.t_end, rtol=RTOL, initial=whole.at([cut])).at(times[1:])
        for name in speeds:
            expected = whole.at(times[1:])[name]
            np.testing.assert_allclose(rest[name], expected, rtol=0, atol=AGREE * max(1.0, np.abs(whole[name]).max()))


@pytest.mark.slow
@given(trains(most=5))
@share_of_examples(0.1)
def test_energy_goes_to_the_parts_that_lose_it_and_none_is_left_over(train: Train) -> None:
    sol = moved(train)
    balance = sol.energy
    # the integration's own error, over up to 200 events
    assert balance.residual < 1e-7
    size = max(balance.work, float(np.abs(balance.stored).max()), 1e-9)
    for part in train.parts:
        loss = balance.lost_in.get(part.name, 0.0)
        assert loss >= -1e-9 * size, part.name
        if part.type in ("Inertia", "Gear", "TorqueSource"):
            assert loss <= 1e-12 * size, part.name
    assert math.fsum(balance.lost_in.values()) == pytest.approx(balance.lost[-1], rel=1e-9, abs=1e-9 * size)
    # a contact that springs back holds what it has taken up, so at no instant anything comes back
    assert np.diff(balance.lost).min() >= -1e-9 * size


def turned(part: Part) -> Part:
    """The part with its ends exchanged, where it has the same law both ways round."""
    if part.type not in ("Spring", "Backlash", "DryFriction", "Clutch"):
        return part
    return replace(part, nodes=part.nodes[::-1])


@pytest.mark.slow
@given(trains(most=5), st.randoms(use_true_random=False))
@share_of_examples(0.1)
def test_names_order_and_direction_of_parts_change_nothing(train: Train, random: object) -> None:
    parts = [turned(part) for part in train.parts]
    random.shuffle(parts)  # type: ignore[attr-defined]
    names = {
        node: f"n{k}" for k, node in enumerate(sorted({n for p in parts for n in p.nodes} - {GROUND}, reverse=True))
    }
    renamed = tuple(replace(part, nodes=tuple(names.get(n, n) for n in part.nodes)) for part in parts)
    one, other = moved(train), moved(replace(train, parts=renamed))
    if max(len(one.events), len(other.events)) > MOST_EVENTS:
        return
    for part in train.parts:
        if part.type == "Inertia":
            speeds = one[f"{part.name}.omega"][-1], other[f"{part.name}.omega"][-1]
            assert speeds[0] == pytest.approx(speeds[1], rel=AGREE, abs=AGREE), part.name


@pytest.mark.slow
def test_a_train_that_cannot_go_on_ends_in_one_named_error() -> None:
    """A wheel between two stops that throw back all its speed, a billionth of a radian apart."""
    train = Train(
        (
            Part("Inertia", "J", ("a",), {"J": 1.0}),
            Part("HardStop", "stop", ("a",), {"upper": 1e-9, "lower": 0.0, "restitution": 1.0}),
        ),
        {"J.omega": 1.0},
        5.0,
    )
    with pytest.raises(SimulationError, match="HardStop 'stop' changes again and again"):
        moved(train)
