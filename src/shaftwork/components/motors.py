"""Motors by their torque-speed curve: Kloss' formula, the torques of a catalogue, or a table."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, ClassVar

from sympy import Expr, Mul, Piecewise, pi, sqrt

from shaftwork.components.base import Component, Derived, Port, Role, component, number_of
from shaftwork.components.branches import ACROSS, Branch, ThroughLaw
from shaftwork.components.laws import no_less, t
from shaftwork.components.switch_times import refuse_no_time_on
from shaftwork.components.tables import Interpolation, Table
from shaftwork.core.errors import NetworkWarning, ParameterError
from shaftwork.core.notices import warn
from shaftwork.core.parameters import parameter


def on_time() -> Any:
    """Declares `t_on`, the time from which a motor gives torque; None for always."""
    return parameter("s", "time from which it gives torque", default=None, latex=r"t_{on}")


def off_time() -> Any:
    """Declares `t_off`, the time from which a motor gives none; None for never."""
    return parameter("s", "time from which it gives none", default=None, latex=r"t_{off}")


def while_on(law: Expr, p: Any) -> Expr:
    """A law from `p.t_on` until `p.t_off`, exactly zero before and after; the law itself where neither is given.

    The cases of a law that has some follow those of the time: equations print one list of them, not one in another.
    """
    before = [] if p.t_on is None else [(0, t < p.t_on)]
    cases = _cases(law)
    if p.t_off is None:
        return Piecewise(*before, *cases) if before else law
    if len(cases) > 1:
        return Piecewise(*before, (0, t >= p.t_off), *cases)
    return Piecewise(*before, (law, t < p.t_off), (0, True))


def _cases(law: Expr) -> tuple[tuple[Expr, Any], ...]:
    """The values and conditions of a multiple of a piecewise law; of any other law itself alone."""
    factors = Mul.make_args(law)
    pieces = [factor for factor in factors if isinstance(factor, Piecewise)]
    if len(pieces) != 1:
        return ((law, True),)
    others = Mul(*(factor for factor in factors if factor is not pieces[0]))
    return tuple((others * value, condition) for value, condition in pieces[0].args)


@dataclass(frozen=True)
class CurveMotor(Component):
    """Base of motors by a torque-speed curve, seen through a gear of `ratio` and `efficiency`."""

    ratio: float = parameter("1", "motor speed over node speed", nonzero=True, default=1.0, latex="i")
    efficiency: float = parameter("1", "efficiency of the gear", above=0, at_most=1, default=1.0, latex=r"\eta")
    t_on: float | None = on_time()
    t_off: float | None = off_time()

    role: ClassVar[Role] = "source"
    ports: ClassVar = (Port("a"),)

    def __post_init__(self) -> None:
        super().__post_init__()
        refuse_no_time_on(self)

    def torque(self, p: Any) -> Expr:
        """The torque at the motor shaft, in parameters and the speed ACROSS of the node."""
        raise NotImplementedError

    def branches(self, p: Any) -> Iterator[Branch]:
        yield ThroughLaw(-while_on(p.ratio * p.efficiency * self.torque(p), p))


@component
class KlossMotor(CurveMotor):
    """An induction motor by Kloss' formula, seen through a gear of given ratio and efficiency.

    Law: tau = ratio efficiency 2 tau_k s s_k / (s^2 + s_k^2), slip s = 1 - ratio omega / (2 pi n_sync / 60).
    Analogue: a voltage-controlled current source. Source: Marinkovic 2012, (2), (18).
    The efficiency multiplies the torque in both directions of power flow, as the source prints it.
    """

    tau_k: float = parameter("N*m", "pull-out torque at the motor shaft", above=0, latex=r"\tau_k")
    s_k: float = parameter("1", "slip at the pull-out torque", above=0)
    n_sync: float = parameter("1/min", "synchronous speed", above=0, latex=r"n_{sync}")

    def torque(self, p: Any) -> Expr:
        return kloss(p.tau_k, _slip(p), p.s_k)


@component
class CageMotor(CurveMotor):
    """A squirrel-cage motor by the torques of its catalogue, seen through a gear of given ratio and efficiency.

    Law: with the motor's speed n, the quartic through (0, tau_a), (n_s, tau_s) with slope 0 and (n_k, tau_k) with slope
    0 for 0 <= n < n_k, Kloss' 2 tau_k s s_k / (s^2 + s_k^2) with the slip s = 1 - n / n_sync for n >= n_k, tau_a for
    n < 0; times ratio and efficiency. Without n_k it is the one for which Kloss' curve passes through the rated point
    (tau_n, n_n), which is not read otherwise; without n_s it is that of `pull_up_share`. Above the synchronous speed
    the motor is a generator, with -tau_k at the slip -s_k. Turned backwards it gives its locked-rotor torque: chosen,
    as the quartic says nothing there. Analogue: a voltage-controlled current source. Source: Marinkovic 2012, (1), (2),
    (18). A `NetworkWarning` tells where the quartic does not fall to tau_s and rise to tau_k.
    """

    tau_a: float = parameter("N*m", "locked-rotor torque at the motor shaft", above=0, latex=r"\tau_A")
    tau_s: float = parameter("N*m", "pull-up torque, the smallest on the way up", above=0, latex=r"\tau_S")
    tau_k: float = parameter("N*m", "pull-out torque", above=0, latex=r"\tau_K")
    n_sync: float = parameter("1/min", "synchronous speed", above=0, latex=r"n_{sync}")
    tau_n: float | None = parameter("N*m", "rated torque", above=0, default=None)
    n_n: float | None = parameter("1/min", "rated speed", above=0, default=None)
    n_k: float | None = parameter("1/min", "speed at the pull-out torque", above=0, default=None, latex="n_K")
    n_s: float | None = parameter("1/min", "speed at the pull-up torque", above=0, default=None, latex="n_S")

    def __post_init__(self) -> None:
        super().__post_init__()
        _check_curve(self)

    def derived(self, p: Any) -> Iterator[Derived]:
        """Pull-out slip, the speeds of the two points in rad/s, and what makes a quartic of the cubic between them."""
        slip = pull_out_slip(p.tau_k, p.tau_n, p.n_n, p.n_sync) if p.n_k is None else 1 - p.n_k / p.n_sync
        yield Derived("slip_k", slip, "1", "slip at the pull-out torque", "s_K")
        top = 2 * pi * p.n_sync / 60 * (1 - p.slip_k)
        yield Derived("omega_k", top, "rad/s", "speed at the pull-out torque", r"\omega_K")
        yield Derived("share", _share(p), "1", "pull-up speed over pull-out speed", r"\alpha")
        yield Derived("width", p.omega_k * (1 - p.share), "rad/s", "speed from pull-up to pull-out", "W")
        rise = p.tau_k - p.tau_s
        free = -2 * rise * p.share * (1 - p.share)  # what `bend` is with `pull_up_share`, also where tau_a is tau_s
        curved = free if p.n_s is None else bend(p.tau_a, p.tau_s, p.tau_k, p.share)
        yield Derived("bend", curved, "N*m", "bends the cubic to the quartic", "B")

    def torque(self, p: Any) -> Expr:
        speed = p.ratio * ACROSS
        x = (speed - p.omega_k * p.share) / p.width
        quartic = p.tau_s + (p.tau_k - p.tau_s) * x**2 * (3 - 2 * x) + p.bend * x**2 * (1 - x) ** 2
        running = kloss(p.tau_k, _slip(p), p.slip_k)
        return Piecewise((p.tau_a, speed < 0), (quartic, speed < p.omega_k), (running, True))


@component
class WoundRotorMotor(CurveMotor):
    """A slip-ring motor that starts over resistors in its rotor circuit, which are taken out step by step.

    Law: Kloss' tau = ratio efficiency 2 tau_k s S / (s^2 + S^2), with the slip s = 1 - ratio omega / (2 pi n_sync / 60)
    and S = s_k r, r the resistance of the rotor circuit over that of the rotor alone, a law of time or of speed:
    resistance moves the pull-out point and keeps the pull-out torque. Where the law falls below 1 the slip rings are
    closed and r = 1.
    Analogue: a voltage-controlled current source. Source: Marinkovic 2012, (2), (18).
    """

    tau_k: float = parameter("N*m", "pull-out torque at the motor shaft", above=0, latex=r"\tau_k")
    s_k: float = parameter("1", "slip at the pull-out torque with slip rings closed", above=0)
    n_sync: float = parameter("1/min", "synchronous speed", above=0, latex=r"n_{sync}")
    resistance: Any = parameter(
        "1", "resistance of the rotor circuit over that of the rotor", at_least=1, law=True, latex="r"
    )

    def torque(self, p: Any) -> Expr:
        return kloss(p.tau_k, _slip(p), p.s_k * no_less(p, "resistance", 1))


@component
class TableMotor(CurveMotor):
    """A motor by its measured torque over speed, seen through a gear of given ratio and efficiency.

    Law: tau = ratio efficiency curve(n), with n the speed of the motor in 1/min: straight lines between the points of
    the table, constant beyond them. For wound-rotor motors, motors of any other kind, and parts of a curve where the
    motor brakes. Analogue: a voltage-controlled current source. Source: Marinkovic 2012, (18).
    """

    curve: Any = parameter("N*m", "torque over the motor's speed in 1/min: a Table, or one number", law=True)

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.curve, Expr) and not isinstance(self.curve, Table) and not self.curve.is_number:
            raise ParameterError(
                f"TableMotor '{self.name}': curve = {self.curve} is an expression. Give Table(speeds, torques) with "
                "speeds in 1/min, or take a TorqueSource, whose law reads omega."
            )

    def torque(self, p: Any) -> Expr:
        speed = 60 * p.ratio * ACROSS / (2 * pi)
        # a table alone becomes a law of time wherever a law is given; here its argument is the speed
        return p.curve.table(speed) if isinstance(p.curve, Interpolation) else p.curve


def _slip(p: Any) -> Expr:
    """The slip at a speed of the node."""
    return 1 - p.ratio * ACROSS / (2 * pi * p.n_sync / 60)


def _share(p: Any) -> Expr:
    """Pull-up speed over pull-out speed, as given or chosen."""
    return pull_up_share(p.tau_a, p.tau_s, p.tau_k) if p.n_s is None else 2 * pi * p.n_s / 60 / p.omega_k


def _check_curve(motor: CageMotor) -> None:
    """Say of the torques and speeds of a cage motor what does not go together.

    Raises:
        ParameterError: they give no curve.
    """
    numbers = {name: number_of(motor, name) for name in _CURVE}
    if any(value is None and getattr(motor, name) is not None for name, value in numbers.items()):
        return  # the checks of the network name what is no admissible number
    tau_a, tau_s, tau_k, n_sync, n_n, tau_n, n_k, n_s = (numbers[name] or 0.0 for name in _CURVE)
    title = f"CageMotor '{motor.name}'"
    if not tau_s < tau_k or tau_s > tau_a:
        raise ParameterError(
            f"{title}: tau_s = {tau_s:g} N m must be less than tau_k = {tau_k:g} N m and not more than tau_a = "
            f"{tau_a:g} N m: the pull-up torque is the smallest on the way up."
        )
    if not n_k:
        if not tau_n or not n_n:
            raise ParameterError(f"{title}: give the rated point tau_n and n_n, or the pull-out speed n_k.")
        refuse_rated_point(title, tau_k, tau_n, n_n, n_sync)
        n_k = n_sync * (1 - float(pull_out_slip(tau_k, tau_n, n_n, n_sync)))
    if not 0 < n_k < n_sync:
        raise ParameterError(
            f"{title}: the pull-out speed n_k = {n_k:g} 1/min must lie between 0 and n_sync = {n_sync:g} 1/min. "
            "Where it follows from the rated point, give n_k itself."
        )
    if n_s >= n_k:
        raise ParameterError(f"{title}: n_s = {n_s:g} 1/min must be less than the pull-out speed {n_k:g} 1/min.")
    _warn_of_turns(title, (tau_a, tau_s, tau_k), n_k, n_s)


_CURVE = ("tau_a", "tau_s", "tau_k", "n_sync", "n_n", "tau_n", "n_k", "n_s")


def _warn_of_turns(title: str, torques: tuple[float, float, float], n_k: float, n_s: float) -> None:
    """Warn where the quartic turns elsewhere than at the pull-up and the pull-out point.

    With x as in `bend` its slope is 2 x (1 - x) (3 (tau_k - tau_s) + B (1 - 2 x)), so that it turns once more at
    x = (1 + 3 (tau_k - tau_s) / B) / 2.
    """
    free = float(pull_up_share(*torques))
    share = n_s / n_k if n_s else free
    if share == 0:
        return  # a pull-up point at standstill, and a cubic
    curved = bend(*torques, share)
    turn = (1 + 3 * (torques[2] - torques[1]) / curved) / 2 if curved else math.inf
    speed = n_k * (share + turn * (1 - share))
    if 0 < speed < n_k:
        other = f"a speed n_s nearer to {free * n_k:.4g} 1/min, or none" if n_s else "n_s"
        warn(
            f"{title}: the quartic through its three torques turns once more at {speed:.4g} 1/min, so that the torque "
            f"does not fall to tau_s and rise to tau_k as it should. Give {other}.",
            NetworkWarning,
        )


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
