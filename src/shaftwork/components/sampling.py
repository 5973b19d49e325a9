"""What a sampled controller does at its sampling instants: a linear step from what it reads to what it holds."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

Matrix = Any


@dataclass(frozen=True, eq=False)
class Sampler:
    """A step of a discrete linear system with a zero-order hold.

    Law: at t = k T, u = C x + D e and then x = A x + B e, with e what is asked less what is measured. In between x and
    u rest: they are across stores of the part, whose labels are x_1, x_2, ... and x_u_1, x_u_2, ...

    Args:
        period: T in s.
        A, B, C, D: (n, n), (n, k), (m, n), (m, k) arrays.
        measured: k names of what is read, "J2.omega".
        setpoints: (k,) what is asked of each, beside the law of the first.
        reference: the law that is asked of the first besides, a number, table or expression of time.
    """

    period: float
    A: Matrix
    B: Matrix
    C: Matrix
    D: Matrix
    measured: tuple[str, ...]
    setpoints: Any
    reference: Any
