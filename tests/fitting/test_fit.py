"""Fits of records that are computed for known values, with noise: true values come back, within their intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pytest
import sympy

import shaftwork as sw
from shaftwork.fitting.curves import Scaling
from shaftwork.fitting.several_starts import starts_from
from shaftwork.sensitivities.legs import DifferentiatedMotion
from shaftwork.sensitivities.parametric_motion import ParametricMotion


def gapped(rng: np.random.Generator) -> sw.Network:
    net = sw.Network("gap")
    net.add(sw.TorqueSource("motor", tau=30.0 * sympy.sin(3.0 * sw.t)), "rotor")
    net.add(sw.Inertia("J1", J=rng.uniform(1.0, 3.0)), "rotor")
    coupling = sw.Backlash("shaft", c=rng.uniform(300.0, 2000.0), d=rng.uniform(1.0, 5.0), gap=rng.uniform(0.01, 0.05))
    net.add(coupling, "rotor", "wheel")
    net.add(sw.Inertia("J2", J=rng.uniform(1.0, 3.0)), "wheel")
    net.add(sw.Damper("load", d=rng.uniform(0.5, 2.0)), "wheel")
    return net


def sticking(rng: np.random.Generator) -> sw.Network:
    net = sw.Network("friction")
    net.add(sw.TorqueSource("motor", tau=30.0 * sympy.sin(2.0 * sw.t)), "rotor")
    net.add(sw.Inertia("J1", J=rng.uniform(1.0, 3.0)), "rotor")
    net.add(sw.Spring("shaft", c=rng.uniform(300.0, 2000.0), d=rng.uniform(1.0, 5.0)), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=rng.uniform(1.0, 3.0)), "wheel")
    net.add(sw.CoulombLoad("load", tau=rng.uniform(5.0, 15.0)), "wheel")
    return net


def smooth(rng: np.random.Generator) -> sw.Network:
    net = sw.Network("smooth")
    net.add(sw.KlossMotor("motor", tau_k=rng.uniform(8.0, 12.0), s_k=0.25, n_sync=3000, ratio=35.5), "rotor")
    net.add(sw.Inertia("J1", J=rng.uniform(20.0, 30.0)), "rotor")
    net.add(sw.Spring("shaft", c=rng.uniform(1e4, 3e4), d=rng.uniform(10.0, 50.0)), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=rng.uniform(40.0, 80.0)), "wheel")
    net.add(sw.Damper("load", d=rng.uniform(1.0, 5.0)), "wheel")
    return net


def record(net: sw.Network, names: Sequence[str], rng: np.random.Generator, t_end: float = 4.0) -> dict[str, object]:
    """401 values of quantities, with noise of 2 percent."""
    t = np.linspace(0.0, t_end, 401)
    sol = net.simulate(t_end, t_eval=t)
    return {"t": t, **{name: sol[name] + rng.normal(0.0, 0.02 * np.abs(sol[name]).max(), t.size) for name in names}}


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:The model does not follow")  # from 15 % off some end in a local minimum
def test_true_values_are_within_their_intervals_as_often_as_these_say() -> None:
    inside = []
    for seed in range(50):
        rng = np.random.default_rng(seed)
        net, names = (
            (gapped(rng), ["shaft.gap", "shaft.c", "shaft.d", "J2.J"]),
            (sticking(rng), ["load.tau", "shaft.c", "shaft.d", "J2.J"]),
            (smooth(rng), ["shaft.c", "shaft.d", "motor.tau_k", "load.d"]),
            (smooth(rng), ["motor.tau_k", "shaft.c", "shaft.d", "load.d"]),
            (smooth(rng), ["shaft.d", "shaft.c", "motor.tau_k", "load.d"]),
        )[seed % 5]
        true = net.compile().parameters
        start = {name: true[name] * rng.uniform(0.85, 1.15) for name in names}
        fit = sw.fit(net, record(net, ["shaft.tau", "J2.omega"], rng), names, start=start)
        inside.append([low <= true[name] <= high for name, (low, high) in fit.intervals().items()])
    # of 50 cases of 0.95, 44 to 50 with a probability of 0.99; of all 200, which hang together, 180
    assert 44 <= sum(row[0] for row in inside) <= 50
    assert np.sum(inside) >= 180


def test_the_crane_comes_back() -> None:
    net, rng = sw.scenes.crane_start(), np.random.default_rng(3)
    t = np.linspace(0.0, 6.5, 326)
    measured = net.simulate(6.5, t_eval=t)["shaft.tau"] + rng.normal(0.0, 3.0, t.size)
    fit = sw.fit(net, {"t": t, "shaft.tau": measured}, ["shaft.c", "shaft.d"], start={"shaft.c": 22000.0})
    true = net.compile().parameters
    for name, (low, high) in fit.intervals(0.999).items():
        assert low < true[name] < high
        assert high - low < 0.1 * true[name]
    assert fit.noise["shaft.tau"] == pytest.approx(3.0, rel=0.15)  # of 326 values, to some 4 percent
    assert abs(fit.correlation["shaft.tau"]) < 4 * t.size**-0.5
    assert not fit.by_differences
    assert not fit.unseen
    for level in (95, 0.0, -1.0):
        with pytest.raises(sw.ParameterError, match=rf"level = {level} must lie between 0 and 1"):
            fit.intervals(level)
    assert fit.fitted.compile().parameters["shaft.c"] == fit.values["shaft.c"]


def test_a_record_without_noise_gives_the_values_themselves() -> None:
    net = gapped(np.random.default_rng(5))
    t = np.linspace(0.0, 4.0, 201)
    sol = net.simulate(4.0, t_eval=t, rtol=1e-11)
    true = net.compile().parameters
    names = ["shaft.c", "shaft.gap", "J2.J"]
    fit = sw.fit(net, {"t": t, "J2.omega": sol["J2.omega"]}, names, start={name: 0.93 * true[name] for name in names})
    assert fit.values == pytest.approx({name: true[name] for name in names}, rel=1e-6)


def test_speeds_alone_do_not_tell_how_heavy_a_train_is() -> None:
    net, rng = smooth(np.random.default_rng(0)), np.random.default_rng(1)
    names = ["shaft.c", "shaft.d", "J1.J", "J2.J", "motor.tau_k", "load.d"]
    fit = sw.fit(net, record(net, ["J2.omega"], rng), names)
    ((spread, shares),) = fit.unseen
    assert np.isinf(spread)
    # all by the same factor: equal shares, to the tolerance of the derivatives
    assert np.abs(list(shares.values())) == pytest.approx(np.full(6, 6**-0.5), rel=1e-3)
    assert all(np.isinf(deviation) for deviation in fit.deviations.values())
    assert fit.correlations == pytest.approx(np.ones((6, 6)), rel=1e-3)
    assert "not at all" in str(fit)
    prior = sw.fit(net, record(net, ["J2.omega"], rng), names, priors={"J1.J": (net.compile().parameters["J1.J"], 0.1)})
    assert all(np.isfinite(spread) for spread, _ in prior.unseen)


def test_a_start_value_is_found_with_the_parameters() -> None:
    net, rng = sw.Network("decay"), np.random.default_rng(2)
    net.add(sw.Spring("shaft", c=100.0, d=0.5), "wheel", "ground")
    net.add(sw.Inertia("J", J=2.0), "wheel")
    net.add(sw.CoulombLoad("bearing", tau=2.0), "wheel")
    t = np.linspace(0.0, 3.0, 301)
    speed = net.simulate(3.0, initial={"J.omega": 5.0}, t_eval=t)["J.omega"] + rng.normal(0.0, 0.05, t.size)
    fit = sw.fit(net, {"t": t, "J.omega": speed}, ["J.omega", "shaft.c"], start={"J.omega": 4.0, "shaft.c": 95.0})
    low, high = fit.intervals(0.999)["J.omega"]
    assert low < 5.0 < high
    assert fit.starts == {"J.omega": fit.values["J.omega"]}
    assert fit.parameters == {"shaft.c": fit.values["shaft.c"]}


def test_an_unknown_that_starts_at_zero_has_the_size_of_what_it_does() -> None:
    net, rng = sw.Network("decay"), np.random.default_rng(2)
    net.add(sw.Spring("shaft", c=100.0, d=0.5), "wheel", "ground")
    net.add(sw.Inertia("J", J=2.0), "wheel")
    t = np.linspace(0.0, 3.0, 301)
    speed = net.simulate(3.0, initial={"shaft.tau_c": 200.0}, t_eval=t)["J.omega"] + rng.normal(0.0, 2.0, t.size)
    fit = sw.fit(net, {"t": t, "J.omega": speed}, ["shaft.tau_c", "shaft.c"])
    assert fit.deviations["shaft.tau_c"] > 1.0  # N m, more than one in SI, and little beside 200
    assert fit.values["shaft.tau_c"] == pytest.approx(200.0, abs=4 * fit.deviations["shaft.tau_c"])
    assert not fit.unseen


def test_a_parameter_that_is_zero_in_the_network_is_fitted_from_its_start() -> None:
    net = sw.Network("decay")
    net.add(sw.Spring("shaft", c=100.0), "wheel", "ground")
    net.add(sw.Inertia("J", J=2.0), "wheel")
    t = np.linspace(0.0, 3.0, 101)
    damped = net.compile().simulate(3.0, initial={"J.omega": 5.0}, parameters={"shaft.d": 0.7}, t_eval=t, rtol=1e-10)
    record, initial = {"t": t, "J.omega": damped["J.omega"]}, {"J.omega": 5.0}
    fit = sw.fit(net, record, "shaft.d", start={"shaft.d": 0.2}, initial=initial)
    assert fit.values["shaft.d"] == pytest.approx(0.7, rel=1e-6)
    with pytest.raises(sw.ParameterError, match=r"'shaft\.d' is zero"):
        sw.fit(net, record, "shaft.d", initial=initial)


def test_a_switch_at_the_end_of_the_record_by_the_network_alone_can_be_fitted() -> None:
    """What counts is where the motion switches whose derivatives are taken: at the start of the fit, 0.3 s."""

    def pulled(t_off: float) -> sw.Network:
        net = sw.Network("pulled")
        net.add(sw.KlossMotor("motor", tau_k=5.0, s_k=0.3, n_sync=1500.0, t_on=0.1, t_off=t_off), "a")
        net.add(sw.Inertia("J", J=1.0), "a")
        return net

    t = np.linspace(0.0, 0.5, 51)
    record = {"t": t, "J.omega": pulled(0.35).simulate(0.5, t_eval=t, rtol=1e-10)["J.omega"]}
    fit = sw.fit(pulled(0.5), record, "motor.t_off", start={"motor.t_off": 0.3})
    assert fit.values["motor.t_off"] == pytest.approx(0.35, rel=1e-6)  # motions to 1e-8
    with pytest.raises(sw.ParameterError, match="exactly at the start or at the end"):
        sw.fit(pulled(0.3), record, "motor.t_off", start={"motor.t_off": 0.5})


def test_records_with_loads_and_start_values_of_their_own_are_fitted_together() -> None:
    net, rng = sw.scenes.crane_start(), np.random.default_rng(6)
    model, t = net.compile(), np.linspace(0.0, 4.0, 201)
    loads = [{"load.tau": 15.0}, {"load.tau": 30.0}]
    starts = [{"J1.omega": 1.0, "J2.omega": 1.0}, {"J1.omega": 6.0, "J2.omega": 6.0}]
    motions = [
        model.simulate(4.0, parameters=load, initial=start, t_eval=t)["shaft.tau"]
        for load, start in zip(loads, starts, strict=True)
    ]
    records = [{"t": t, "shaft.tau": tau + rng.normal(0.0, 3.0, t.size)} for tau in motions]
    unknowns, start, true = ["shaft.c", "shaft.d"], {"shaft.c": 21000.0}, model.parameters
    both = sw.fit(net, records, unknowns, start=start, parameters=loads, initial=starts)
    assert list(both.noise) == ["shaft.tau (1)", "shaft.tau (2)"]
    for name, (low, high) in both.intervals(0.999).items():
        assert low < true[name] < high
    single = [
        sw.fit(net, record, unknowns, start=start, parameters=load, initial=states)
        for record, load, states in zip(records, loads, starts, strict=True)
    ]
    # what independent records tell adds up: 1 / s^2 = sum 1 / s_k^2 for parameters that hang together hardly
    for name in unknowns:
        expected = sum(fit.deviations[name] ** -2 for fit in single) ** -0.5
        assert both.deviations[name] == pytest.approx(expected, rel=0.05)


def test_a_network_that_is_made_again_is_fitted_alike_and_other_starts_end_there() -> None:
    rng = np.random.default_rng(11)
    records = record(smooth(np.random.default_rng(4)), ["shaft.tau"], rng)
    names, true = ["shaft.c", "shaft.d"], smooth(np.random.default_rng(4)).compile().parameters
    fits = [
        sw.fit(smooth(np.random.default_rng(4)), records, names, start={"shaft.c": share * true["shaft.c"]})
        for share in (0.9, 0.9, 1.15)
    ]
    assert fits[0].values == fits[1].values
    for name in names:  # where a fit ends is right to a ten-thousandth of the deviation and more
        assert fits[2].values[name] == pytest.approx(fits[0].values[name], abs=1e-3 * fits[0].deviations[name])


def test_a_start_at_which_the_rest_of_the_record_is_out_of_step_is_led_by_its_beginning(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    net, rng = sw.scenes.crane_start(), np.random.default_rng(12)
    t = np.linspace(0.0, 6.5, 651)
    measured = net.simulate(6.5, t_eval=t)["shaft.tau"] + rng.normal(0.0, 3.0, t.size)
    shares, motion = list[float](), ParametricMotion.motion

    def counted(self: ParametricMotion, values: Mapping[str, float], share: float = 1.0) -> DifferentiatedMotion:
        shares.append(share)
        return motion(self, values, share)

    monkeypatch.setattr(ParametricMotion, "motion", counted)
    fit = sw.fit(net, {"t": t, "shaft.tau": measured}, ["shaft.c", "shaft.d"], start={"shaft.c": 17000.0})
    assert fit.noise["shaft.tau"] == pytest.approx(3.0, rel=0.1)
    assert shares.count(1.0) < 10  # some fifteen over the whole record alone


def gap_and_friction() -> tuple[sw.Network, dict[str, object]]:
    """A train and a record of it."""
    net, rng = sw.Network("gap and friction"), np.random.default_rng(0)
    net.add(sw.TorqueSource("motor", tau=30.0 * sympy.sin(3.0 * sw.t)), "rotor")
    net.add(sw.Inertia("J1", J=2.0), "rotor")
    net.add(sw.Backlash("shaft", c=800.0, d=3.0, gap=0.03), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=1.5), "wheel")
    net.add(sw.CoulombLoad("load", tau=6.0), "wheel")
    t = np.linspace(0.0, 3.0, 151)
    sol = net.simulate(3.0, t_eval=t)
    noisy = {
        name: sol[name] + rng.normal(0.0, 0.02 * np.abs(sol[name]).max(), t.size) for name in ("shaft.tau", "J2.omega")
    }
    return net, {"t": t, **noisy}


FAR = {"shaft.gap": 0.09, "load.tau": 12.0, "shaft.c": 1600.0}


@pytest.mark.slow
def test_one_of_several_starts_finds_the_truth_that_a_start_far_off_misses() -> None:
    net, measured = gap_and_friction()
    with pytest.warns(sw.AccuracyWarning, match=r"does not follow the record of shaft\.tau"):
        alone = sw.fit(net, measured, list(FAR), start=FAR)
    best = sw.fit(net, measured, list(FAR), start=FAR, starts=8)
    true = net.compile().parameters
    for name, (low, high) in best.intervals(0.999).items():
        assert low < true[name] < high
        assert not alone.intervals(0.999)[name][0] < true[name] < alone.intervals(0.999)[name][1]
    assert alone.caveat in str(alone)
    assert not best.caveat
    assert best.estimate.deviance < min(other.deviance for other in best.others)
    assert "Of 8 starts 3 were followed to the end" in str(best)  # the first and a quarter of seven
    assert "In the next one chi^2 is larger by" in str(best)


def test_starts_that_end_alike_are_counted_and_the_same_seed_gives_the_same() -> None:
    net, measured = gap_and_friction()
    unknowns = {"shaft.gap": (0.01, 0.1), "load.tau": (2.0, 12.0), "shaft.c": (300.0, 3000.0)}
    first, again = (sw.fit(net, measured, unknowns, starts=3, seed=2) for _ in range(2))
    assert str(first) == str(again)
    assert "Of 3 starts 2 were followed to the end, 2 to this minimum." in str(first)


def test_chi_squared_of_deviations_that_are_given_is_the_sum_of_squares() -> None:
    net, measured = gap_and_friction()
    sigma = {"shaft.tau": 0.45, "J2.omega": 0.09}
    two = [sw.fit(net, measured, ["shaft.c"], sigma=sigma, parameters={"load.tau": tau}) for tau in (6.0, 6.05)]
    sums = [sum(((fit.residuals[name] / sigma[name]) ** 2).sum() for name in sigma) for fit in two]
    # residuals are those of the last step by derivatives, to some 1e-8
    assert two[1].estimate.deviance - two[0].estimate.deviance == pytest.approx(sums[1] - sums[0], rel=1e-6)


def test_a_model_without_what_the_record_shows_is_told_from_a_right_one() -> None:
    _, measured = gap_and_friction()
    stiff = sw.Network("no gap")
    stiff.add(sw.TorqueSource("motor", tau=30.0 * sympy.sin(3.0 * sw.t)), "rotor")
    stiff.add(sw.Inertia("J1", J=2.0), "rotor")
    stiff.add(sw.Spring("shaft", c=800.0, d=3.0), "rotor", "wheel")
    stiff.add(sw.Inertia("J2", J=1.5), "wheel")
    stiff.add(sw.Damper("load", d=1.0), "wheel")
    with pytest.warns(sw.AccuracyWarning, match="intervals do not hold"):
        fit = sw.fit(stiff, measured, ["shaft.c", "load.d"])
    assert "J2.omega" in fit.caveat
    assert fit.correlation["J2.omega"] > 0.5


def undamped(rng: np.random.Generator) -> tuple[sw.Network, dict[str, object]]:
    """A spring without damping, and a record of it that swings freely, with noise."""
    net = sw.Network("undamped")
    net.add(sw.Spring("shaft", c=100.0), "wheel", "ground")
    net.add(sw.Inertia("J", J=2.0), "wheel")
    t = np.linspace(0.0, 3.0, 61)
    speed = net.simulate(3.0, initial={"J.omega": 5.0}, t_eval=t)["J.omega"]
    return net, {"t": t, "J.omega": speed + rng.normal(0.0, 0.1, t.size)}


def test_the_interval_of_a_damping_that_is_zero_begins_there_and_ends_where_it_does() -> None:
    inside = 0
    for seed in range(40):
        net, measured = undamped(np.random.default_rng(seed))
        fit = sw.fit(net, measured, ["shaft.c", "shaft.d"], start={"shaft.d": 0.3}, initial={"J.omega": 5.0})
        low, high = fit.intervals()["shaft.d"]
        inside += low <= 0.0
        assert 0.0 <= low <= high < 0.2  # the deviation is some 0.03
    assert inside >= 35  # of 40 cases of 0.975, with a probability of 0.999


def test_an_interval_is_cut_at_the_bound_at_which_the_fit_ended() -> None:
    net, rng = smooth(np.random.default_rng(4)), np.random.default_rng(11)
    true, records = net.compile().parameters["shaft.c"], record(net, ["shaft.tau"], rng)
    free = sw.fit(net, records, ["shaft.c"])
    middle = free.values["shaft.c"] * (1 - free.deviations["shaft.c"] / true)  # a deviation below
    bound = sw.fit(net, records, {"shaft.c": (0.5 * true, middle)}, start={"shaft.c": 0.9 * true})
    assert bound.values["shaft.c"] == pytest.approx(middle, rel=1e-6)
    low, high = bound.intervals()["shaft.c"]
    assert low == pytest.approx(free.intervals()["shaft.c"][0], rel=1e-4)  # as the derivatives there tell it
    assert high == pytest.approx(middle, rel=1e-9)
    assert "At a bound, by which its interval is cut: shaft.c." in str(bound)


def test_a_drive_that_mostly_stands_still_tells_a_robust_loss_no_noise() -> None:
    net, rng = sw.Network("stop"), np.random.default_rng(1)
    net.add(sw.Inertia("J", J=2.0), "wheel")
    net.add(sw.CoulombLoad("brake", tau=4.0), "wheel")
    t = np.linspace(0.0, 6.0, 121)
    speed = net.simulate(6.0, initial={"J.omega": 5.0}, t_eval=t)["J.omega"]
    measured = {"t": t, "J.omega": np.where(speed > 0.1, speed + rng.normal(0.0, 0.1, t.size), 0.0)}
    start, initial = {"brake.tau": 3.5}, {"J.omega": 5.0}
    with pytest.raises(sw.ParameterError, match=r"Half of the values of 'J\.omega' or more are met to rounding"):
        sw.fit(net, measured, ["brake.tau"], start=start, initial=initial, loss="huber")
    given = sw.fit(net, measured, ["brake.tau"], start=start, initial=initial, loss="huber", sigma=0.1)
    low, high = given.intervals(0.999)["brake.tau"]
    assert low < 4.0 < high


def test_noise_far_above_sigma_is_said() -> None:
    net, measured = undamped(np.random.default_rng(3))
    with pytest.warns(sw.AccuracyWarning, match=r"left of J\.omega is \d(\.\d)? times the sigma"):
        sw.fit(net, measured, ["shaft.c"], initial={"J.omega": 5.0}, sigma=0.02)


def test_noise_that_hangs_together_is_said_with_how_much_wider_intervals_are() -> None:
    net, rng = sw.scenes.crane_start(), np.random.default_rng(5)
    t = np.linspace(0.0, 6.5, 1001)
    noise = np.zeros(t.size)
    for k, new in enumerate(rng.normal(0.0, 3.0, t.size)):
        noise[k] = 0.4 * noise[k - 1] + new
    measured = {"t": t, "shaft.tau": net.simulate(6.5, t_eval=t)["shaft.tau"] + noise}
    with pytest.warns(sw.AccuracyWarning, match=r"true intervals are some 1\.[4-6] times as wide"):
        sw.fit(net, measured, ["shaft.c", "shaft.d"])


def test_starts_between_zero_and_a_bound_fill_the_range() -> None:
    scaling = Scaling({"d": 5.0}, np.array([True]), np.array([5.0]), np.array([True]))
    bounds = scaling.unknowns(np.array([0.0])), scaling.unknowns(np.array([50.0]))
    points = starts_from(scaling, scaling.unknowns(np.array([5.0])), bounds, 41, 0)
    values = np.sort([scaling.values(point)[0] for point in points[1:]])
    assert values == pytest.approx(np.linspace(0.0, 50.0, 40), abs=3.0)


def test_a_profile_is_named_with_the_places_that_can_be_recorded() -> None:
    net = sw.Network("line")
    net.add(sw.TorqueSource("motor", tau=10.0), "a")
    net.add(sw.Shaft("shaft", length=1.0, diameter=0.03, damping=1.0, model=sw.Lumped(m=3)), "a", "b")
    net.add(sw.Inertia("J", J=1.0), "b")
    with pytest.raises(sw.ParameterError, match=r"'shaft\.tau' has values at many.*shaft\.tau_a or shaft\.tau_b"):
        sw.fit(net, {"t": [0.1, 0.2], "shaft.tau": [1.0, 2.0]}, ["J.J"])


def test_a_frequency_response_tells_stiffness_and_damping() -> None:
    net, rng = sw.scenes.crane_start(), np.random.default_rng(4)
    point, f = {"J1.omega": 8.0, "J2.omega": 8.0}, np.linspace(1.0, 15.0, 60)
    response = net.frequency_response("motor.tau", "shaft.tau", f, at=point).values
    noisy = response + rng.normal(0.0, 0.02, f.size) + 1j * rng.normal(0.0, 0.02, f.size)
    fit = sw.fit(
        net,
        {"f": f, "shaft.tau / motor.tau": noisy},
        ["shaft.c", "shaft.d"],
        start={"shaft.c": 21000.0, "shaft.d": 10.0},
        at=point,
    )
    true = net.compile().parameters
    for name, (low, high) in fit.intervals(0.999).items():
        assert low < true[name] < high
    assert fit.by_differences
    assert fit.residuals["shaft.tau / motor.tau"].dtype == complex


def test_missing_values_and_the_order_of_rows_change_nothing() -> None:
    net, rng = sticking(np.random.default_rng(7)), np.random.default_rng(8)
    rows = record(net, ["J1.omega"], rng)
    t, speed = np.asarray(rows["t"]), np.asarray(rows["J1.omega"])
    plain = sw.fit(net, {"t": t, "J1.omega": speed}, ["load.tau"])
    order = rng.permutation(t.size + 1)
    mixed = {"t": np.append(t, 1.0)[order], "J1.omega": np.append(speed, np.nan)[order]}
    assert sw.fit(net, mixed, "load.tau").values == pytest.approx(plain.values, rel=1e-9)


def test_a_controller_that_samples_is_fitted_by_differences() -> None:
    net, rng = sw.Network("loop"), np.random.default_rng(9)
    net.add(sw.Inertia("J", J=2.0), "wheel")
    net.add(sw.Damper("load", d=0.4), "wheel")
    controller = sw.TransferFunctionController(
        "loop", numerator=[-3.0], denominator=[1.0], measured="J.omega", reference=10.0, sample_time=0.05
    )
    net.add(controller, "wheel")
    fit = sw.fit(net, record(net, ["J.omega"], rng, 3.0), ["J.J"], start={"J.J": 1.6})
    low, high = fit.intervals(0.999)["J.J"]
    assert low < 2.0 < high
    assert fit.by_differences


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"record": {"t": [0.0, 1.0]}}, "beside it what was measured"),
        ({"record": {"shaft.tau": [0.0, 1.0]}}, "column 't'"),
        ({"record": {"t": [0.0, 1.0], "shaft.tau": [1.0]}}, "as many"),
        ({"record": {"t": [-1.0, 1.0], "shaft.tau": [1.0, 2.0]}}, "from zero on"),
        ({"record": {"t": [0.0, 1.0], "shaft.tau": [np.nan, np.nan]}}, "no finite value"),
        ({"record": {"t": [0.0, 1.0, 2.0], "shaft.tau": ["3.5", "4.5", "n/a"]}}, "holds 'n/a' in row 2"),
        ({"record": {"t": 3.0, "shaft.tau": [1.0, 2.0]}}, "as many"),
        (
            {"record": {"t": np.ma.masked_array([0.0, 1.0], [0, 1]), "shaft.tau": [1.0, 2.0]}},
            "'t' has no finite value in row 1",
        ),
        ({"record": {"t": [], "shaft.tau": []}}, "'t' is empty"),
        ({"record": {"t": [0.0, np.nan], "shaft.tau": [0.0, 1.0]}}, "'t' has no finite value in row 1"),
        ({"record": {"t": [0.0], "shaft.tau": [0.0]}}, r"'shaft\.tau': all values are at t = 0 s"),
        ({"record": {"t": [0.0, 1.0], "shaft.tau": [0.0, np.nan]}}, "Give later ones"),
        ({"record": {"t": [0.0, 1.0], "shaft.tau": [0.0, 1e300]}}, r"'shaft\.tau' has a value of size 1e\+300"),
        ({"record": {"t": [0.0, 1e300], "shaft.tau": [0.0, 1.0]}}, "'t' has a value of size"),
        ({"record": {"f": [1.0, 2.0], "shaft.tau / motor.tau": [1.0, 1e300j]}}, "has a value of size"),
        (
            {"record": [{"t": [1.0], "shaft.tau": [1.0]}, {"t": [0.0], "shaft.tau": [1.0]}]},
            r"Record 2: 'shaft\.tau': all",
        ),
        ({"record": 3}, "is no record"),
        ({"unknowns": []}, "Nothing is unknown"),
        ({"unknowns": ["shaft.c", "shaft.c"]}, "named twice"),
        ({"unknowns": ["shaft.k"]}, "no parameter 'shaft.k'"),
        ({"unknowns": {"shaft.c": (3e4, 1e4)}}, "is no range"),
        ({"unknowns": {"shaft.c": 3e4}}, "is no range"),
        ({"unknowns": {"shaft.c": (3e4, 4e4)}}, "is where the fit starts"),
        ({"start": {"J1.J": 2.0}}, "is not unknown"),
        ({"priors": {"J1.J": (2.0, 1.0)}}, "is not unknown"),
        ({"priors": {"shaft.c": (2e4, -1.0)}}, "standard deviation"),
        ({"sigma": 0.0}, "sigma"),
        ({"sigma": "x"}, "sigma"),
        ({"priors": {"shaft.c": 3.0}}, "must be .value, standard deviation."),
        ({"priors": {"shaft.c": ("a", 1.0)}}, "prior of 'shaft.c'"),
        (
            {"record": {"t": [0.0, 1.0], "shaft.tau": ["a", "b"]}},
            "holds 'a' in row 0, counted from zero, which is no number",
        ),
        ({"record": {"t": [0.0, 1.0], "shaft.tau": np.array([1.0, "b"], dtype=object)}}, "holds 'b' in row 1"),
        ({"unknowns": 5}, "5 is no name"),
        ({"priors": [3.0]}, r"priors = \[3\.0\] must map unknowns"),
        ({"unknowns": {"J1.omega": ("x", 2.0)}}, "J1.omega"),
        ({"sigma": {}}, "no value for 'shaft.tau'"),
        ({"sigma": {"shaft.tau": 1.0, "J1.omega": 1.0}}, "sigma names 'J1.omega', which is not recorded"),
        ({"record": []}, "no record"),
        (
            {"record": [{"t": [1.0], "shaft.tau": [1.0]}, {"f": [1.0], "shaft.tau / motor.tau": [1.0]}]},
            "some over freq",
        ),
        ({"initial": [{}, {}]}, "2 entries for 1 records"),
        ({"initial": 3.0}, "must be values by name"),
        ({"parameters": {"shaft.c": 2e4}}, "is unknown and has a value"),
        ({"start": {"shaft.c": "x"}}, "shaft"),
        ({"loss": "absolute"}, "no loss 'absolute'"),
        ({"starts": 0}, "starts = 0 must be a whole number"),
        ({"seed": -1}, "seed = -1 must be a whole number, 0 or more"),
        ({"record": {"f": [1.0, 2.0], "shaft.tau": [1.0, 2.0]}}, "is no response"),
        ({"record": {"t": [1.0], "shaft.tau": [1.0]}, "unknowns": ["shaft.c", "shaft.d"]}, "1 values for 2 unknowns"),
    ],
)
def test_what_is_wrong_is_said(change: dict[str, object], words: str) -> None:
    arguments: dict[str, object] = {
        "record": {"t": [0.5, 1.0, 1.5], "shaft.tau": [100.0, 200.0, 150.0]},
        "unknowns": ["shaft.c"],
        **change,
    }
    with pytest.raises(sw.ParameterError, match=words):
        sw.fit(sw.scenes.crane_start(), **arguments)  # type: ignore[arg-type]


def test_values_that_are_masked_are_missing_and_units_are_converted() -> None:
    pint = pytest.importorskip("pint")
    net, rng = smooth(np.random.default_rng(5)), np.random.default_rng(6)
    plain = record(net, ["shaft.tau"], rng)
    values = np.array(plain["shaft.tau"])
    values[7] = 1e5
    masked = np.ma.masked_array(values, np.arange(values.size) == 7)
    missing = np.where(masked.mask, np.nan, values)
    fits = [
        sw.fit(net, {**plain, "shaft.tau": column}, ["shaft.c"]).values
        for column in (missing, masked, pint.Quantity(missing / 1e3, "kN*m"))
    ]
    assert fits[0] == fits[1]
    assert fits[2]["shaft.c"] == pytest.approx(fits[0]["shaft.c"], rel=1e-9)  # rounding of the conversion


def test_what_a_record_does_not_tell_is_no_lack_of_values() -> None:
    net, rng = smooth(np.random.default_rng(5)), np.random.default_rng(6)
    net.add(sw.Brake("brake", tau=20.0, t_on=100.0), "wheel")  # long after the record
    fit = sw.fit(net, record(net, ["shaft.tau"], rng), ["shaft.c", "brake.tau"])
    assert "The record tells this combination not at all: brake.tau" in str(fit)
    assert "as many unknowns as values" not in str(fit)


def test_an_interval_holds_what_was_fitted_even_where_that_is_no_minimum() -> None:
    net, rng = smooth(np.random.default_rng(5)), np.random.default_rng(6)
    of_ms = record(net, ["shaft.tau"], rng)
    with pytest.warns(sw.AccuracyWarning):  # a record over another motion than that of the network
        fit = sw.fit(net, {**of_ms, "t": 10.0 * np.asarray(of_ms["t"])}, ["shaft.c", "shaft.d"])
    for name, (low, high) in fit.intervals().items():
        assert low <= fit.values[name] <= high


def test_a_record_of_zeros_beside_another_one_is_fitted() -> None:
    net, rng = sw.Network("a drive and one at rest"), np.random.default_rng(3)
    net.add(sw.TorqueSource("motor", tau=4.0), "a")
    net.add(sw.Inertia("J", J=2.0), "a")
    net.add(sw.Damper("oil", d=1.0), "a")
    net.add(sw.TorqueSource("none", tau=0.0), "b")
    net.add(sw.Inertia("other", J=1.0), "b")
    measured = record(net, ["J.omega"], rng, 3.0)
    fit = sw.fit(net, {**measured, "other.omega": np.zeros(len(measured["t"]))}, ["oil.d"], start={"oil.d": 1.4})
    low, high = fit.intervals(0.999)["oil.d"]
    assert low < 1.0 < high


def test_where_nothing_is_left_to_tell_the_noise_by_it_is_as_large_as_what_is_left() -> None:
    times = np.array([0.5, 1.0])
    fit = sw.fit(
        sw.scenes.crane_start(),
        {"t": times, "shaft.tau": [150.0, 120.0]},
        {"shaft.c": (2.0e4, 2.6e4), "shaft.d": (10.0, 16.0)},
    )
    left = np.abs(fit.estimate.residuals).max()
    assert fit.noise["shaft.tau"] <= left * (1 + 1e-9)  # rounding


def test_a_picture_shows_the_record_and_what_is_left() -> None:
    net, rng = sticking(np.random.default_rng(7)), np.random.default_rng(8)
    figure = sw.fit(net, record(net, ["J1.omega", "shaft.tau"], rng), ["load.tau"]).plot()
    assert [axes.get_ylabel() for axes in figure.axes] == ["J1.omega", "residual", "shaft.tau", "residual"]
