"""Formulas of torque-speed curves, for numbers and for expressions."""

from __future__ import annotations

from typing import Any

from sympy import sqrt

from shaftwork.core.errors import ParameterError


def pull_out_slip(tau_k: Any, tau_n: Any, n_n: Any, n_sync: Any) -> Any:
    """The slip at the pull-out torque for which Kloss' curve passes through the rated point.

    Law: s_k = s_n (u + sqrt(u^2 - 1)), u = tau_k / tau_n, s_n = 1 - n_n / n_sync: the larger root of
    tau_n / tau_k = 2 / (s_n/s_k + s_k/s_n), so that the rated point lies on the stable branch. Source: Marinkovic
    2012, (2).

    Args:
        tau_k: pull-out torque, N m; a number or an expression, as are the others.
        tau_n: rated torque, N m, less than tau_k.
        n_n: rated speed, 1/min.
        n_sync: synchronous speed, 1/min.
    """
    overload = tau_k / tau_n
    return (1 - n_n / n_sync) * (overload + sqrt(overload**2 - 1))


def refuse_rated_point(title: str, tau_k: float, tau_n: float, n_n: float, n_sync: float) -> None:
    """Refuse a rated point that Kloss' curve does not pass through; arguments as for `pull_out_slip`.

    Raises:
        ParameterError: its torque is not less than the pull-out torque, or its speed not less than the synchronous one.
    """
    if tau_n >= tau_k:
        raise ParameterError(
            f"{title}: the rated torque tau_n = {tau_n:g} N m is not less than the pull-out torque tau_k = {tau_k:g} "
            "N m, so that the curve never reaches the rated point. Give tau_k in N m at the motor shaft; a catalogue "
            "that prints tau_k / tau_n means that many times tau_n."
        )
    if n_n >= n_sync:
        raise ParameterError(
            f"{title}: the rated speed n_n = {n_n:g} 1/min is not less than the synchronous speed n_sync = {n_sync:g} "
            "1/min, so that there is no slip. Give n_sync = 60 f / pole pairs, the next of these speeds above n_n."
        )


def pull_up_share(tau_a: Any, tau_s: Any, tau_k: Any) -> Any:
    """Pull-up speed over pull-out speed where a catalogue does not give it.

    Law: w / (1 + w), w = sqrt((tau_a - tau_s) / (3 (tau_k - tau_s))). Chosen: the source leaves it open. With it the
    quartic falls and rises as it should for any three torques with tau_a - tau_s < 64 (tau_k - tau_s), and the pull-up
    point goes to standstill where tau_a goes to tau_s.

    Args:
        tau_a: locked-rotor torque, N m; a number or an expression, as are the others.
        tau_s: pull-up torque, N m.
        tau_k: pull-out torque, N m.
    """
    ratio = sqrt((tau_a - tau_s) / (3 * (tau_k - tau_s)))
    return ratio / (1 + ratio)


def bend(tau_a: Any, tau_s: Any, tau_k: Any, share: Any) -> Any:
    """How far the quartic through the three torques of a cage motor bends away from a cubic, N m.

    Law: with x = (n - n_s) / (n_k - n_s) the quartic is tau_s + (tau_k - tau_s) x^2 (3 - 2 x) + B x^2 (1 - x)^2, whose
    values and slopes at x = 0 and x = 1 are those asked for whatever B is; B makes it tau_a at standstill.

    Args:
        tau_a: locked-rotor torque, N m; a number or an expression, as are the others.
        tau_s: pull-up torque, N m.
        tau_k: pull-out torque, N m.
        share: n_s / n_k, between 0 and 1.
    """
    return (1 - share) ** 4 / share**2 * (tau_a - tau_s) - (tau_k - tau_s) * (1 - share) * (3 - share)


def kloss(tau_k: Any, slip: Any, s_k: Any) -> Any:
    """Kloss' formula 2 tau_k s s_k / (s^2 + s_k^2). Source: Marinkovic 2012, (2)."""
    return 2 * tau_k * slip * s_k / (slip**2 + s_k**2)
