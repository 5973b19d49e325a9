"""The referee for sources that depend on speed or on time in any way: SUNDIALS IDA on the reduced equations."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from sksundae.ida import IDA

from tests.reference.mna import GROUND, SOURCE_VALUE, Piece, Response, descriptor, named
from tests.reference.pencil import RANK_TOLERANCE, Array, IllPosedError, reduce


@dataclass(frozen=True)
class Law:
    """A source value as a function of time and of the across variable of its part, for ``simulate_nonlinear``.

    ``rate`` is its derivative, for a law of time alone that prescribes what a store must follow.
    """

    value: Callable[[float, float], float]
    rate: Callable[[float], float] | None = None


def simulate_nonlinear(
    pieces: Sequence[Piece], laws: Mapping[str, Law], t: Sequence[float] | Array, rtol: float = 1e-10
) -> Response:
    """Response from rest at the times t (t[0] is the start), by SUNDIALS IDA on the reduced form.

    ``laws`` replaces source values. The unknowns are the state x and the across variables that the laws read.
    """
    d = descriptor(pieces)
    r, by_name, n_sources = reduce(d), {p.name: p for p in pieces}, len(d.sources)
    reads = np.zeros((n_sources, len(d.unknowns)))
    for k, name in enumerate(d.sources):
        for node, sign in zip(by_name[name].nodes, (1.0, -1.0), strict=False):
            if node != GROUND:
                reads[k, d.unknowns.index(f"{node}.across")] = sign
    step = r.W @ r.N @ r.H  # the part of z that follows the rate of a source, as behind a prescribed speed
    rated = np.abs(step).max(axis=0, initial=0.0) > RANK_TOLERANCE * max(1.0, np.abs(r.W @ r.H).max(initial=0.0))
    fixed = {name: float(by_name[name].values[SOURCE_VALUE[by_name[name].type]]) for name in d.sources}
    for name, needed in zip(d.sources, rated, strict=True):
        if needed and name in laws and laws[name].rate is None:
            raise IllPosedError(f"the law of {name} needs its rate")

    def inputs(time: float, e: Array) -> Array:
        pairs = zip(d.sources, e.tolist(), strict=True)
        return np.array([laws[name].value(time, across) if name in laws else fixed[name] for name, across in pairs])

    def rates(time: float) -> Array:
        given = (laws[name].rate if name in laws else None for name in d.sources)
        return np.array([rate(time) if rate else 0.0 for rate in given])

    n, now, direct = r.J.shape[0], reads @ r.V, reads @ r.W @ r.H

    def residual(time: float, y: Array, rate: Array, out: Array) -> None:
        u = inputs(time, y[n:])
        out[:n] = rate[:n] - r.J @ y[:n] - r.G @ u
        out[n:] = now @ y[:n] - direct @ u - y[n:]

    times, start = np.asarray(t, dtype=float), np.zeros(n_sources)
    for _ in range(50):  # the across variables under a step; a fixed point, exact at once unless a law reads a jump
        start = -direct @ inputs(times[0], start)
    slopes = np.concatenate([r.G @ inputs(times[0], start), np.zeros(n_sources)])
    algebraic = list(range(n, n + n_sources))
    first = 1e-10 * float(times[-1] - times[0])  # IDA's own guess ignores how sharply a source may start
    atol = 1e-2 * rtol
    solver = IDA(residual, rtol=rtol, atol=atol, algebraic_idx=algebraic, first_step=first, max_num_steps=200_000)
    solution = solver.solve(times, np.concatenate([np.zeros(n), start]), slopes)
    if not solution.success:
        raise ArithmeticError(f"IDA stopped at t = {solution.t[-1]:g} s: {solution.message}")
    u = np.array([inputs(time, y[n:]) for time, y in zip(times, solution.y, strict=True)]).T
    z = r.V @ solution.y[:, :n].T - r.W @ (r.H @ u) - step @ np.array([rates(time) for time in times]).T
    return named(d.unknowns, r.determined.tolist(), times, z)
