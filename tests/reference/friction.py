"""Closed forms of motions with dry friction, stops and clutches: constant torques and linear springs.

J is an inertia (kg m2), c a stiffness (N m/rad), tau_c kinetic and tau_s static friction (N m), omega a speed (rad/s).
"""

from __future__ import annotations

from dataclasses import dataclass
from math import atan, cos, pi, sin, sqrt


@dataclass(frozen=True)
class StickSlip:
    """A block on a belt, held by a spring against the wall; from the unstretched spring on, carried by the belt.

    The belt drags the block with it until the spring pulls with tau_s, then the block swings about the place where the
    spring pulls with tau_c until it is as fast as the belt again. By energy it then is as far from that place as it was
    at the start of the slip, on the other side: from the first slip on the motion is periodic.
    """

    J: float
    c: float
    tau_c: float
    tau_s: float
    belt: float

    @property
    def first_slip(self) -> float:
        """Time in s of the first breakaway."""
        return self.tau_s / (self.c * self.belt)

    @property
    def slip(self) -> float:
        """Duration of a slip in s: tan(w T / 2) = -(tau_s - tau_c) w / (c belt)."""
        w = sqrt(self.c / self.J)
        return 2.0 * (pi - atan((self.tau_s - self.tau_c) * w / (self.c * self.belt))) / w

    @property
    def stick(self) -> float:
        """Duration of a stick in s, after a slip."""
        return 2.0 * (self.tau_s - self.tau_c) / (self.c * self.belt)

    @property
    def period(self) -> float:
        """Of the limit cycle, s."""
        return self.slip + self.stick

    def events(self, count: int) -> tuple[float, ...]:
        """The first times at which the block breaks away, is caught, breaks away, ..."""
        starts = (self.first_slip + k // 2 * self.period for k in range(count))
        return tuple(start + (k % 2) * self.slip for k, start in enumerate(starts))

    def angle(self, t: float) -> float:
        """Of the block against the unstretched spring, rad."""
        if t <= self.first_slip:
            return self.belt * t
        w, swing = sqrt(self.c / self.J), (self.tau_s - self.tau_c) / self.c
        since = (t - self.first_slip) % self.period
        if since <= self.slip:
            return self.tau_c / self.c + swing * cos(w * since) + self.belt / w * sin(w * since)
        return self.tau_c / self.c - swing + self.belt * (since - self.slip)


@dataclass(frozen=True)
class Bounces:
    """An inertia from rest at the angle `height`, driven by a constant torque against a stop at 0 with restitution."""

    J: float
    tau: float
    height: float
    restitution: float

    def impact(self, n: int) -> float:
        """Time in s of the nth impact, from 1: flights are a geometric series."""
        fall, e = sqrt(2.0 * self.J * self.height / self.tau), self.restitution
        return fall * (1.0 + 2.0 * e * (1.0 - e ** (n - 1)) / (1.0 - e))

    def speed_after(self, n: int) -> float:
        """Just after the nth impact, rad/s."""
        return self.restitution**n * sqrt(2.0 * self.tau * self.height / self.J)

    @property
    def rest(self) -> float:
        """Time in s by which infinitely many impacts have happened."""
        fall, e = sqrt(2.0 * self.J * self.height / self.tau), self.restitution
        return fall * (1.0 + e) / (1.0 - e)


@dataclass(frozen=True)
class CoulombOscillator:
    """An inertia on a spring with dry friction to ground, from rest at the twist `start`.

    Every half cycle is half a cosine about +-tau_c/c, so turning points lose 2 tau_c/c each, 4 tau_c/c a cycle, until
    the spring at a turning point pulls with no more than tau_s.
    """

    J: float
    c: float
    tau_c: float
    tau_s: float
    start: float

    @property
    def half_period(self) -> float:
        """Time in s between two turning points; friction does not change it."""
        return pi * sqrt(self.J / self.c)

    @property
    def turning_points(self) -> tuple[float, ...]:
        """Angles in rad, the start and the place of rest included."""
        points = [self.start]
        while abs(points[-1]) > self.tau_s / self.c:
            side = 1.0 if points[-1] > 0.0 else -1.0
            points.append(side * 2.0 * self.tau_c / self.c - points[-1])
        return tuple(points)

    @property
    def rest(self) -> tuple[float, float]:
        """Time in s at which it comes to rest for good, and the angle in rad at which it stays."""
        points = self.turning_points
        return (len(points) - 1) * self.half_period, points[-1]


@dataclass(frozen=True)
class RampedBreakaway:
    """An inertia held by dry friction under the torque rate * t."""

    J: float
    tau_c: float
    tau_s: float
    rate: float

    @property
    def time(self) -> float:
        """Of the breakaway, s."""
        return self.tau_s / self.rate

    def reaction(self, t: float) -> float:
        """Torque of the friction in N m, against the driving one."""
        return self.rate * t if t <= self.time else self.tau_c

    def omega(self, t: float) -> float:
        """Speed, rad/s."""
        since = max(0.0, t - self.time)
        return since * (0.5 * self.rate * (t + self.time) - self.tau_c) / self.J if since else 0.0


@dataclass(frozen=True)
class Engagement:
    """A clutch of constant torque between two inertias of different speeds, each with a constant torque of its own.

    J1 w1' = tau_1 - tau,   J2 w2' = tau_2 + tau,   w1 > w2 at the start.
    """

    J1: float
    J2: float
    omega_1: float
    omega_2: float
    tau: float
    tau_1: float = 0.0
    tau_2: float = 0.0

    @property
    def time(self) -> float:
        """Until the speeds are equal, s."""
        return (self.omega_1 - self.omega_2) / ((self.tau - self.tau_1) / self.J1 + (self.tau + self.tau_2) / self.J2)

    @property
    def omega(self) -> float:
        """The common speed then, rad/s."""
        return self.omega_1 + (self.tau_1 - self.tau) / self.J1 * self.time

    @property
    def loss(self) -> float:
        """Heat in J: the torque times the angle that has slipped."""
        return 0.5 * self.tau * (self.omega_1 - self.omega_2) * self.time

    @property
    def carried(self) -> float:
        """Torque from the first to the second inertia once they turn as one, N m; it holds while this is below tau."""
        return (self.J2 * self.tau_1 - self.J1 * self.tau_2) / (self.J1 + self.J2)


def stop(J: float, omega: float, tau: float) -> tuple[float, float]:
    """Time in s and angle in rad in which a brake of the torque tau stops the inertia J."""
    return J * omega / tau, 0.5 * J * omega**2 / tau


def capacity_parallel(*tau: float) -> float:
    """What dry contacts between the same two nodes hold together, N m."""
    return sum(tau)


def capacity_series(*tau: float) -> float:
    """What dry contacts one behind the other hold, N m: the weakest slips, the others stay locked."""
    return min(tau)
