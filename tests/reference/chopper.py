"""A current controller with its chopper on two phases in series at rest, by matrix exponentials between switches.

2 L di/dt = U s - 2 R i with s = 1 while u > U acos(cos(2 pi f t)) / pi, u = k_p (i_ref - i) + u_i, and
du_i/dt = k_p / t_i (i_ref - i) + (min(U, max(0, u)) - u) / t_i. Every switch is found by Brent's method.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.optimize import brentq

Array = NDArray[np.float64]
LEAST = 1e-12
"""So far behind a switch its new side is read, s."""


@dataclass(frozen=True)
class Piece:
    """A time between switches: whether the chopper is on, and the limit beyond which u is, None within."""

    on: bool
    limit: float | None


@dataclass(frozen=True)
class Chopper:
    """The circuit; values as in `BLDCMotor`."""

    U: float
    R: float
    L: float
    i_ref: float
    k_p: float
    t_i: float
    f_c: float

    def asked(self, x: Array) -> float:
        """The voltage u at current and u_i (2,)."""
        return float(self.k_p * (self.i_ref - x[0]) + x[1])

    def piece(self, t: float, x: Array) -> Piece:
        """What holds at a time in s."""
        u = self.asked(x)
        on = u > self.U * math.acos(math.cos(2 * math.pi * self.f_c * t)) / math.pi
        return Piece(on, 0.0 if u < 0 else self.U if u > self.U else None)

    def moved(self, x: Array, piece: Piece, h: float) -> Array:
        """Current and u_i (2,) after a time h in s."""
        if piece.limit is None:
            integral = [-self.k_p / self.t_i, 0.0, self.k_p * self.i_ref / self.t_i]
        else:  # what it gains is (limit - u_i) / t_i
            integral = [0.0, -1 / self.t_i, piece.limit / self.t_i]
        rates = np.array([[-self.R / self.L, 0.0, self.U * piece.on / (2 * self.L)], integral, [0.0, 0.0, 0.0]])
        return np.asarray((expm(h * rates) @ [*x, 1.0])[:2])

    def run(self, times: Array, looks: int = 3000) -> Array:
        """Current and u_i (k, 2) at times (k,) in s from rest; pieces are looked at so often."""
        found, x, t = [], np.zeros(2), 0.0
        piece = self.piece(LEAST, x)
        for stop in np.union1d(times, np.linspace(0, times[-1], looks))[1:]:
            while t < stop:
                h = float(stop - t)
                if self.piece(stop, self.moved(x, piece, h)) != piece:
                    kept = partial(self._kept, t, x, piece)
                    h = brentq(kept, 0.0, h, xtol=1e-17, rtol=1e-15)
                    h = min(h + LEAST, float(stop - t))
                x, t = self.moved(x, piece, h), t + h
                piece = self.piece(t, x)
            if stop in times:
                found.append(x)
        return np.array(found)

    def _kept(self, t: float, x: Array, piece: Piece, h: float) -> float:
        """1 while a piece lasts, -1 after it."""
        return 1.0 if h == 0 or self.piece(t + h, self.moved(x, piece, h)) == piece else -1.0
