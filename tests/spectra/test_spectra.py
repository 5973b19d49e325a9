"""Spectra show sines with their own amplitudes, over frequency and over order, and refuse what means nothing."""

from __future__ import annotations

import numpy as np
import pytest
import sympy

import shaftwork as sw


def swinging() -> sw.Solution:
    """A torque of two sines of whole periods in 2 s, beside a constant."""
    tau = 7.0 + 10.0 * sympy.sin(2 * sympy.pi * 12 * sw.t) + 3.0 * sympy.sin(2 * sympy.pi * 40 * sw.t)
    net = sw.Network("swinging")
    net.add(sw.TorqueSource("motor", tau=tau), "rotor")
    net.add(sw.Inertia("J", J=2.0), "rotor")
    return net.simulate(2.0)


def rising(slope: float = 20.0) -> sw.Solution:
    """A shaft whose speed rises, with a torque that swings three times per turn."""
    net = sw.Network("rising")
    net.add(sw.SpeedSource("drive", omega=10.0 + slope * sw.t), "rotor")
    net.add(sw.TorqueSource("ripple", tau=5.0 * sympy.sin(3 * sw.phi) + 1.0), "rotor")
    net.add(sw.Inertia("J", J=2.0), "rotor")
    return net.simulate(8.0, rtol=1e-10)


def test_sines_on_lines_have_their_own_amplitudes_and_the_mean_has_none() -> None:
    spectrum = swinging().spectrum("motor.tau")
    lines = dict(zip(spectrum.frequencies.tolist(), spectrum.amplitudes.tolist(), strict=True))
    assert (lines[12.0], lines[40.0]) == pytest.approx((10.0, 3.0), rel=1e-9)  # rounding of the FFT
    assert lines[0.0] < 1e-9
    assert [f for f, _ in spectrum.peaks[:2]] == [12.0, 40.0]
    assert "12" in str(spectrum)


def test_a_sine_between_two_lines_shows_at_least_85_percent() -> None:
    spectrum = swinging().spectrum("motor.tau", end=2.0 - 1.0 / 24.0)  # 12 Hz are 23.5 periods
    assert 8.45 < spectrum.peaks[0][1] <= 10.0  # Hann's largest loss is 15.1 %


def test_the_highest_frequency_can_be_chosen() -> None:
    spectrum = swinging().spectrum("motor.tau", f_max=30.0)
    assert spectrum.frequencies[-1] == 30.0
    assert spectrum.amplitudes[24] == pytest.approx(10.0, rel=1e-9)
    spectrum.plot()


def test_what_swings_with_the_angle_stays_on_its_order_while_the_speed_rises() -> None:
    spectra = rising().order_spectra("ripple.tau", "J.omega", turns=10, order_max=8)
    assert spectra.orders[30] == 3.0
    np.testing.assert_allclose(spectra.order(3.0), 5.0, rtol=1e-4)  # of the angle between the samples of the speed
    others = np.abs(spectra.orders - 3.0) > 0.25  # Hann's main lobe is two lines to each side
    assert spectra.amplitudes[:, others].max() < 1e-3 * 5.0
    assert (np.diff(spectra.speeds) > 0).all()
    np.testing.assert_allclose(spectra.speeds, 10.0 + 20.0 * spectra.times, rtol=1e-3)  # at the middle of a stretch
    spectra.plot()


def test_a_shaft_that_turns_backward_has_the_same_orders() -> None:
    net = sw.Network("backward")
    net.add(sw.SpeedSource("drive", omega=-20.0), "rotor")
    net.add(sw.TorqueSource("ripple", tau=5.0 * sympy.sin(3 * sw.phi)), "rotor")
    net.add(sw.Inertia("J", J=2.0), "rotor")
    spectra = net.simulate(8.0, rtol=1e-10).order_spectra("ripple.tau", "J.omega", turns=4, order_max=8)
    np.testing.assert_allclose(spectra.order(3.0), 5.0, rtol=1e-4)
    np.testing.assert_allclose(spectra.speeds, -20.0, rtol=1e-6)


def test_a_place_along_a_shaft_can_be_chosen() -> None:
    solution = sw.scenes.shaft_step().simulate(0.1)
    first, last = (
        solution.spectrum("line.tau", place=place).amplitudes for place in (0, len(solution.places["line.tau"]) - 1)
    )
    assert not np.allclose(first, last)
    with pytest.raises(sw.ParameterError, match=r"place = 99: 'line\.tau' .* has the places 0 to"):
        solution.spectrum("line.tau", place=99)


def test_what_means_nothing_is_refused() -> None:
    turning = rising(slope=-5.0)  # turns back at 2 s
    with pytest.raises(sw.ParameterError, match=r"stands or turns back at t = 2 s"):
        turning.order_spectra("ripple.tau", "J.omega")
    with pytest.raises(sw.ParameterError, match="Take fewer turns"):
        turning.order_spectra("ripple.tau", "J.omega", end=1.0, turns=100)
    with pytest.raises(sw.ParameterError, match="is no speed in rad/s"):
        turning.order_spectra("J.omega", "ripple.tau")
    with pytest.raises(sw.ParameterError, match="within the motion, from 0 to 8 s"):
        turning.spectrum("ripple.tau", start=7.0, end=9.0)
    with pytest.raises(sw.ParameterError, match="f_max"):
        turning.spectrum("ripple.tau", f_max=-1.0)
    with pytest.raises(sw.SignalError, match="ripple"):
        turning.spectrum("ripple.taus")


@pytest.mark.parametrize("seconds", [2.0, pytest.param(30.0, marks=pytest.mark.slow)])
def test_a_fast_swing_appears_at_its_own_frequency_however_long_the_span(seconds: float) -> None:
    """Samples that are too few would show it at another one, with its full amplitude."""
    net = sw.Network("fast")
    net.add(sw.TorqueSource("motor", tau=1.0), "a")
    net.add(sw.Inertia("J1", J=1e-3), "a")
    net.add(sw.Spring("shaft", c=1e5), "a", "b")
    net.add(sw.Inertia("J2", J=1e-3), "b")
    frequency = net.modes().frequencies[-1]
    (largest, _), *_ = net.simulate(seconds).spectrum("shaft.tau").peaks
    assert largest == pytest.approx(frequency, abs=1.0 / seconds)  # a line of the spectrum


@pytest.mark.slow
def test_what_no_sampling_shows_is_said() -> None:
    with pytest.warns(sw.AccuracyWarning, match="still changes by"):
        swinging_fast().spectrum("motor.tau")


def swinging_fast() -> sw.Solution:
    """A torque of 1 MHz over a second."""
    net = sw.Network("fast")
    net.add(sw.TorqueSource("motor", tau=sympy.sin(2 * sympy.pi * 1000003 * sw.t)), "rotor")
    net.add(sw.Inertia("J", J=2.0), "rotor")
    return net.simulate(1.0, t_eval=[0.0, 1.0])


def test_an_order_that_is_not_there_is_refused() -> None:
    with pytest.raises(sw.ParameterError, match=r"must be from 0 to 8, the highest order"):
        rising().order_spectra("ripple.tau", "J.omega", turns=4, order_max=8).order(1000.0)
