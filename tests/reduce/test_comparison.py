"""What is compared is alike: the same part, the same train, the same start; and what is not known is not said."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.latex.document import PREAMBLE
from tests.latex.test_equations_in_print import compile_latex, compiles, overfull
from tests.reduce.test_simplify import chain


def geared(tau: float = 10.0, damping: float = 0.1) -> sw.Network:
    net = sw.Network("geared")
    net.add(sw.TorqueSource("M", tau=tau), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Gear("g", ratio=4.0), "a", "b")
    net.add(sw.Spring("s", c=100.0, d=damping), "b", "c")
    net.add(sw.Inertia("J2", J=2.0), "c")
    return net


def parallel() -> sw.Network:
    net = sw.Network("parallel")
    net.add(sw.TorqueSource("M", tau=10.0), "a")
    net.add(sw.Inertia("J1", J=1.0), "a")
    net.add(sw.Spring("s", c=30.0), "a", "b")
    net.add(sw.Spring("beside", c=70.0), "a", "b")
    net.add(sw.Damper("oil", d=5.0), "a", "b")
    net.add(sw.Inertia("J2", J=2.0), "b")
    net.add(sw.ViscousLoad("v", d=0.1), "b")
    return net


@pytest.mark.slow
@pytest.mark.parametrize(("keep", "share"), [("s", 0.3), ("beside", 0.7), ("oil", 0.0)])
def test_of_one_mass_the_kept_part_has_its_share_of_the_torque_beside_others(keep: str, share: float) -> None:
    """Once the swing is damped out the train carries as much in this part, but for what the load takes by and by."""
    small = sw.reduce.simplify(parallel(), 1, keep)
    lost = small.compare(20.0, engine="exact")
    whole = sw.reduce.simplify(parallel(), 1, "s").compare(20.0, engine="exact").after / 0.3
    assert lost.after == pytest.approx(share * whole, rel=1e-12, abs=1e-12)
    assert lost.peaks[1] == pytest.approx(share * np.abs(whole).max(), rel=1e-9)
    # the load slows down the twist as exp(-t/30 s), and behind it the twist follows within 5 / 100 s: 2e-3 of 8 N m
    assert lost.after[-1] == pytest.approx(lost.before[-1], abs=0.02)


def test_of_several_masses_the_kept_part_is_compared_with_itself_beside_others() -> None:
    lost = sw.reduce.simplify(parallel(), 2, "s").compare(5.0, engine="exact")
    assert lost.rms_error < 1e-12
    assert lost.rms_error_by_modes < 1e-10


@pytest.mark.parametrize("name", ["parameters", "initial"])
def test_other_values_of_the_train_have_no_place_in_the_small_models(name: str) -> None:
    small = sw.reduce.simplify(geared(), 2, "s")
    given = {"parameters": {"J1.J": 2.0}, "initial": {"J1.omega": 40.0}}[name]
    with pytest.raises(sw.ParameterError, match=f"compare: {name}"):
        small.compare(2.0, **{name: given})
    assert small.compare(2.0, **{name: {}}).rms_error < 1e-6  # an engine at 1e-8


def test_a_known_motion_is_that_of_the_train_as_it_is() -> None:
    small = sw.reduce.simplify(geared(), 2, "s")
    others = {
        "M.tau = 20 instead of 10": geared().simulate(2.0, parameters={"M.tau": 20.0}),
        r"s\.d = 0 instead of 0\.1": geared(damping=0.0).simulate(2.0),
        "does not start from rest, but with J1.omega": geared().simulate(2.0, initial={"J1.omega": 40.0}),
        "starts at 1 s, and t_start is 0 s": geared().simulate(2.0, t_start=1.0),
        r"is not that of 'geared': M\.tau = 0 instead of 10, g\.ratio = 0 instead of 4, .*, \.\.\.": chain(
            [1.0, 1.0], [1.0]
        ).simulate(2.0),
        "before = 3 is no motion": 3,
    }
    for message, before in others.items():
        with pytest.raises(sw.ParameterError, match=message):
            small.compare(2.0, before=before)  # type: ignore[arg-type]
    undamped = sw.reduce.simplify(geared(damping=0.0), 2, "s")
    with pytest.raises(sw.ParameterError, match=r"s\.d = 0\.1 instead of 0\."):
        undamped.compare(2.0, before=geared(damping=0.0).simulate(2.0, parameters={"s.d": 0.1}))
    own = geared(tau=20.0).simulate(2.0, parameters={"M.tau": 10.0}, initial={"J1.omega": 0.0})
    assert small.compare(2.0, before=own).rms_error < 1e-6


@pytest.mark.slow
def test_a_motion_says_what_it_was_made_of() -> None:
    net = geared(damping=0.0)
    for found, damping in ((net.simulate(1.0), None), (net.simulate(1.0, parameters={"s.d": 0.3}), 0.3)):
        assert found.parameters.get("s.d") == damping
        assert found.parameters["J1.J"] == 1.0
        assert found.at([0.5]).parameters == found.parameters
    braked = sw.scenes.crane_train()
    started = braked.simulate(0.01, parameters={"shaft.c": 3e4}, initial={"crane.v": 1.0})
    assert (started.parameters["shaft.c"], dict(started.initial)) == (3e4, {"crane.v": 1.0})


@pytest.mark.slow
def test_names_of_modes_are_free_whatever_the_nodes_and_parts_are_called() -> None:
    """Names of the train stay; a node "mode 1" with a load on it is no mode."""

    def train(node: str, part: str) -> sw.Network:
        net = chain([1.0, 1.0, 0.4, 0.4, 0.4], [10.0, 30.0, 30.0, 30.0])
        net.add(sw.Spring("far", c=30.0), "4", node)
        net.add(sw.Inertia("J5", J=0.4), node)
        net.add(sw.ViscousLoad(part, d=0.3), node)
        return net

    plain = sw.reduce.simplify(train("5", "load"), 3, "c0")
    same = [sw.reduce.simplify(train(*names), 3, "c0") for names in (("mode 1", "load"), ("5", "mode 1"))]
    same.append(sw.reduce.simplify(train("base of mode 1", "spring of mode 1"), 3, "c0"))
    wanted = plain.compare(5.0, engine="exact")
    for small in same:
        assert small.compare(5.0, engine="exact").by_modes == pytest.approx(wanted.by_modes, abs=1e-10)
    (load,) = (item for item in same[0].by_modes.netlist().placed if item.part.name == "load")
    assert load.nodes == ("mode 1",)


@pytest.mark.parametrize(
    ("part", "nodes"),
    [
        (sw.TorqueSource("pulls", tau=10.0 - 50.0 * sw.phi), ("0",)),
        (sw.Backlash("pulls", gap=0.0, c=100.0), ("1", "ground")),
        (sw.HardStop("pulls", upper=0.1), ("1",)),
    ],
)
def test_what_pulls_by_the_angle_is_named_and_no_limit_is_promised(part: sw.Component, nodes: tuple[str, ...]) -> None:
    net = chain([1.0, 2.0, 0.5], [100.0, 3000.0])
    assert sw.reduce.simplify(net, 3, "c0").by_angle == ()
    assert "valid up to inf Hz" in str(sw.reduce.simplify(net, 3, "c0"))
    net.add(part, *nodes)
    whole, small = (sw.reduce.simplify(net, masses, "c0") for masses in (3, 2))
    for each in (whole, small):
        assert each.by_angle == ("pulls",)
        assert str(each).endswith("frequencies without the stiffness that pulls may have to the frame")
    assert "valid" not in str(whole)
    assert "valid up to 4" in str(small)


def test_what_goes_with_time_and_speed_is_no_stiffness() -> None:
    assert sw.reduce.simplify(sw.scenes.crane_train(), 2, "shaft").by_angle == ()


@pytest.mark.slow
def test_the_limit_of_validity_is_missed_by_as_much_as_its_documentation_says() -> None:
    """0.30 f_l is the limit of one mode; all modes together have been measured, with 1621 chains."""
    missed = [error for seed in range(160) if (error := _missed_at_the_limit(seed)) is not None]
    assert len(missed) > 60
    # one in twelve misses more than 11 %: of n chains n/12 with a deviation of sqrt(n/12), of which there are 3
    assert sum(error > 0.11 for error in missed) < len(missed) / 12 + 3 * np.sqrt(len(missed) / 12)
    assert float(np.median(missed)) < 0.1


def _missed_at_the_limit(seed: int) -> float | None:
    """Largest relative error of the kept torque below the limit; None where the limit is above the first resonance."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 9))
    masses, kept = int(rng.integers(2, count)), int(rng.integers(count - 1))
    inertias, springs = np.exp(rng.uniform(-3, 3, count)), np.exp(rng.uniform(3, 8, count - 1))
    small = sw.reduce.simplify(chain(inertias.tolist(), springs.tolist()), masses, f"c{kept}")
    if small.valid_up_to > 0.9 * small.frequencies[0].before:
        return None
    made = small.groupings[0].chain
    place = next(k for k, link in enumerate(made.links) if link.has(f"c{kept}"))
    few = np.array([station.inertia for station in made.stations]), np.array([link.c for link in made.links])
    rates = 2 * np.pi * np.linspace(small.valid_up_to / 50, small.valid_up_to, 50)
    return max(abs(_torque(*few, place, rate) / _torque(inertias, springs, kept, rate) - 1) for rate in rates)


def _torque(inertias: np.ndarray, springs: np.ndarray, place: int, rate: float) -> float:
    """In a spring, for a unit torque at this rate at the first mass."""
    matrix = np.diag(-(rate**2) * inertias)
    for k, c in enumerate(springs):
        matrix[k : k + 2, k : k + 2] += c * np.array([[1, -1], [-1, 1]])
    angles = np.linalg.solve(matrix, np.eye(len(inertias))[0])
    return float(springs[place] * (angles[place] - angles[place + 1]))


def test_masses_on_ropes_alone_are_refused_with_a_way_that_works() -> None:
    net = sw.Network("rope")
    net.add(sw.ForceSource("F", f=10.0), "x1")
    for k, mass in enumerate((2.0, 2.0, 1.0), 1):
        net.add(sw.Mass(f"m{k}", m=mass), f"x{k}")
    for k in (1, 2):
        net.add(sw.TranslationalSpring(f"r{k}", c=100.0), f"x{k}", f"x{k + 1}")
    with pytest.raises(sw.NetworkError) as caught:
        sw.reduce.simplify(net, 2, "r1")
    drum, nothing = "Drum('drum', radius=1.0)", "TorqueSource('none', tau=0.0)"
    assert drum in str(caught.value)
    assert nothing in str(caught.value)
    net.add(sw.Drum("drum", radius=1.0), "shaft", "x1")
    net.add(sw.TorqueSource("none", tau=0.0), "shaft")
    small = sw.reduce.simplify(net, 2, "r1")
    assert [row.value for row in small.table.rows] == [2.0, 100.0, 3.0]
    assert small.compare(2.0, engine="exact").peaks[1] == pytest.approx(2 * 10.0 * 3.0 / 5.0, rel=1e-9)


def test_where_there_is_no_model_by_modes_nothing_is_said_of_one() -> None:
    net = chain([1.0, 0.1, 2.0], [1000.0, 500.0])
    for masses, keep in ((1, "c0"), (2, ""), (1, "")):
        small = sw.reduce.simplify(net, masses, keep)
        assert small.by_modes is None
        assert "by modes" not in str(small)
        assert "By modes" not in small.frequencies.latex()
    small = sw.reduce.simplify(net, 2, "c0")
    assert str(small.frequencies).splitlines()[0].endswith("by modes Hz")
    assert str(small.frequencies).splitlines()[2].split()[-2:] == ["lost", "lost"]


def test_the_table_of_frequencies_is_a_sequence_of_its_rows() -> None:
    table = sw.reduce.simplify(chain([1.0, 0.1, 2.0], [1000.0, 500.0]), 2, "c0").frequencies
    assert len(table) == 2
    assert [row.mode for row in table] == [1, 2]
    assert table[-1].after is None


@compiles
def test_the_table_of_frequencies_prints_inside_the_margins(tmp_path: Path) -> None:
    net = chain([1.0, 0.1, 2.0], [1000.0, 1e14])
    tables = [sw.reduce.simplify(net, masses, "c0").frequencies.latex() for masses in (1, 2, 3)]
    assert r"\, \%$" in tables[1]
    assert r"\cdot 10^{" in tables[1]
    assert tables[0].count("lost") == 2
    log = compile_latex("\n\n".join((PREAMBLE, r"\begin{document}", *tables, r"\end{document}")), tmp_path)
    assert max(overfull(log), default=0.0) < 1.0


def driven(law: sympy.Expr, load: str = "a") -> sw.Network:
    """Three masses, the same but for a law and where a load is."""
    net = sw.Network("driven")
    net.add(sw.TorqueSource("T", tau=law), "a")
    net.add(sw.Inertia("J0", J=1.0), "a")
    net.add(sw.Spring("s", c=100.0, d=0.2), "a", "b")
    net.add(sw.Inertia("J1", J=2.0), "b")
    net.add(sw.Spring("q", c=300.0), "b", "c")
    net.add(sw.Inertia("J2", J=1.0), "c")
    net.add(sw.ViscousLoad("L", d=1.0), load)
    return net


LAW = 10 + 3 * sympy.sin(3 * sw.t)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("other", "text"),
    [
        (driven(30 * sympy.sin(3 * sw.t)), r"'T' is TorqueSource .*30\*sin\(3\*t\) instead of TorqueSource .*3\*sin"),
        (driven(sw.Table([0, 1, 2], [5, 0, 9])), r"'T' is TorqueSource .*Table"),
        (driven(LAW, "c"), r"'L' is ViscousLoad \(a c\) instead of ViscousLoad \(a a\)"),
    ],
)
def test_a_motion_under_another_law_or_of_another_wiring_is_refused(other: sw.Network, text: str) -> None:
    made = sw.reduce.simplify(driven(LAW), 3, "s")
    assert made.compare(2.0, before=driven(LAW).simulate(2.0)).rms_error == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(sw.ParameterError, match=text):
        made.compare(2.0, before=other.simulate(2.0))


@pytest.mark.slow
def test_a_comparison_may_start_late_and_take_any_outputs() -> None:
    made = sw.reduce.simplify(driven(LAW), 3, "s")
    assert made.compare(3.0, t_start=1.0).rms_error == pytest.approx(0.0, abs=1e-9)
    early = driven(LAW).simulate(4.0, t_eval=[1.0, 2.0, 3.0])
    assert made.compare(4.0, before=early).rms_error == pytest.approx(0.0, abs=1e-9)


@pytest.mark.slow
def test_an_error_of_none_has_no_sign() -> None:
    """Seven masses instead of eleven of the crane's train: the peak is lower by less than what is printed."""
    train = sw.scenes.crane_train()
    lost = sw.reduce.simplify(train, 7, "shaft").compare(1.0, modes=False)
    assert -5e-5 < lost.peak_error < 0
    assert "+0.00%" in str(lost)
    assert "-0.00%" not in str(lost)
