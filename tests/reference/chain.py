"""Exact motion of a chain of inertias and damped springs, free at both ends, after a torque step.

Damping is proportional to stiffness, d = beta c, so the modes of the undamped chain stay uncoupled:

    q_k'' + beta lambda_k q_k' + lambda_k q_k = f_k.

``equal_chain`` uses the cosine modes of n equal inertias in closed form, lambda_k = 4 (c/J) sin^2(k pi / 2n), in which
the twist of a spring is a sine mode and no difference of near numbers is taken. ``chain`` takes any values: the
singular value decomposition of the weighted incidence matrix sqrt(c) D / sqrt(J), whose singular values are the natural
frequencies, gives speeds and twists without forming the stiffness matrix.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

Array = np.ndarray[Any, np.dtype[np.float64]]


@dataclass(frozen=True)
class Motion:
    """Speeds (rad/s), shape (time, n), and spring torques c twist + d twist rate (N m), shape (time, n - 1)."""

    omega: Array
    tau: Array


def _modal(frequency: Array, beta: float, t: Array) -> tuple[Array, Array]:
    """Speed and angle of oscillators from rest after a unit step, shape (time, mode); zero frequency is a free body."""
    sigma = 0.5 * beta * frequency**2
    delta = np.sqrt((sigma**2 - frequency**2).astype(complex))
    time = t[:, None]
    slow = -(frequency**2) / np.where(frequency > 0.0, sigma + delta, 1.0)  # delta - sigma without cancellation
    near = np.abs(delta) * time < 1e-4
    safe = np.where(near, 1.0, delta)
    # exp(-sigma t) sinh(delta t) / delta, and the same with cosh, from exponentials that never grow
    up, down = np.exp(slow * time), np.exp(-(sigma + delta) * time)
    square = (delta * time) ** 2
    speed = np.where(near, np.exp(-sigma * time) * time * (1.0 + square / 6.0), (up - down) / (2.0 * safe)).real
    rest = np.where(frequency > 0.0, frequency, 1.0) ** 2
    angle = np.where(frequency > 0.0, (1.0 - (0.5 * (up + down)).real - sigma * speed) / rest, 0.5 * time**2)
    return np.where(frequency > 0.0, speed, time), angle


def equal_chain(n: int, t: Sequence[float] | Array, *, J: float, c: float, beta: float, tau: float) -> Motion:
    """Response at t (s) of n inertias J (kg m2) and n - 1 springs c (N m/rad) with d = beta c to the torque tau (N m).

    The torque acts on the first inertia from t = 0 on; everything rests before.
    """
    k, j = np.arange(n), np.arange(n)
    frequency = 2.0 * np.sqrt(c / J) * np.sin(k * np.pi / (2 * n))
    speed, angle = _modal(frequency, beta, np.asarray(t, dtype=float))
    weight = np.where(k == 0, 1.0, 2.0) / n * np.cos(k * np.pi / (2 * n)) * tau / J
    mode = np.cos(np.outer(k, (2 * j + 1)) * np.pi / (2 * n))
    twist = 2.0 * np.sin(np.outer(k, j[1:]) * np.pi / n) * np.sin(k * np.pi / (2 * n))[:, None]
    return Motion((speed * weight) @ mode, c * ((angle + beta * speed) * weight) @ twist)


def chain(t: Sequence[float] | Array, *, J: Sequence[float], c: Sequence[float], beta: float, tau: float) -> Motion:
    """The same for n inertias J and n - 1 springs c of any values."""
    root_J, root_c = np.sqrt(np.asarray(J, dtype=float)), np.sqrt(np.asarray(c, dtype=float))
    n = len(root_J)
    incidence = np.eye(n - 1, n) - np.eye(n - 1, n, k=1)
    left, frequency, right = np.linalg.svd(root_c[:, None] * incidence / root_J)
    rigid = root_J / np.linalg.norm(root_J)
    modes = np.vstack([right[: n - 1], rigid])  # the free mode is known exactly
    frequency = np.append(frequency, 0.0)
    speed, angle = _modal(frequency, beta, np.asarray(t, dtype=float))
    force = modes[:, 0] * tau / root_J[0]
    elastic = ((angle + beta * speed) * force * frequency)[:, : n - 1]
    return Motion((speed * force) @ modes / root_J, elastic @ left.T * root_c)
