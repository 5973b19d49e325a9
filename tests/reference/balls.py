"""The referee's answer without rounding: rational matrices of the netlist, and exponentials in ball arithmetic.

The descriptor system E z' = A z + B u of `mna` is split by rational elimination. With s a number for which s E - A is
regular and H = (s E - A)^-1 E, the space is the sum of the image of H^k and its kernel, k beyond the index:

    z = V y + W n,   y' = (s - J^-1) y + J^-1 G u,   n = sum_j N^j (s - d/dt)^j K u,   H V = V J,   H W = W N.

Source: Dai, Singular Control Systems, 1989, section 1.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from fractions import Fraction

import numpy as np
from flint import arb_mat, ctx, fmpq, fmpq_mat

from tests.reference.mna import SOURCE_VALUE, Piece, Response, descriptor, named
from tests.reference.pencil import Array, IllPosedError

INDEX = 4
"""More than the index of any network of the generator."""
BITS, MOST_BITS = 256, 8192
DIGITS = 1e-20
"""Radius of the balls that is small enough, as a part of the largest value of all."""


def rational(value: float) -> fmpq:
    """The number that a float is."""
    fraction = Fraction(float(value))
    return fmpq(fraction.numerator, fraction.denominator)


def _matrix(array: Array) -> fmpq_mat:
    return fmpq_mat(*array.shape, [rational(value) for value in array.ravel()])


def _kernel(matrix: fmpq_mat) -> list[list[fmpq]]:
    """A basis of the right kernel."""
    reduced, rank = matrix.rref()
    columns = matrix.ncols()
    pivots = [next(j for j in range(columns) if reduced[i, j] != 0) for i in range(rank)]
    basis = []
    for free in (j for j in range(columns) if j not in pivots):
        vector = [fmpq(0)] * columns
        vector[free] = fmpq(1)
        for i, pivot in enumerate(pivots):
            vector[pivot] = -reduced[i, free]
        basis.append(vector)
    return basis


def _image(matrix: fmpq_mat) -> list[list[fmpq]]:
    """A basis of the columns."""
    reduced, rank = matrix.transpose().rref()
    return [[reduced[i, j] for j in range(matrix.nrows())] for i in range(rank)]


def _part(matrix: fmpq_mat, rows: range, columns: range) -> fmpq_mat:
    return fmpq_mat(len(rows), len(columns), [matrix[i, j] for i in rows for j in columns])


def respond(pieces: Sequence[Piece], times: Array, stores: Mapping[str, float] | None = None) -> Response:
    """The response to sources that step at t = 0, each value to far more digits than a float has.

    Args:
        pieces: the network; everything is at rest before t = 0.
        times: s, increasing, not negative.
        stores: values of unknowns ("shaft.store", "rotor.across") before t = 0, where it is not at rest.

    Raises:
        IllPosedError: the equations leave something open.
    """
    system = descriptor(pieces)
    size = len(system.unknowns)
    E, A, B = (_matrix(array) for array in (system.E, system.A, system.B))
    u = fmpq_mat(
        len(system.sources), 1, [rational(p.values[SOURCE_VALUE[p.type]]) for p in pieces if p.type in SOURCE_VALUE]
    )
    before = fmpq_mat(size, 1, [rational((stores or {}).get(name, 0.0)) for name in system.unknowns])
    shift = fmpq(1009, 1000)
    if E.nrows() != size or (shift * E - A).det() == 0:
        raise IllPosedError("the equations leave something open")
    inverse = (shift * E - A).inv()
    H = inverse * E
    power = H
    for _ in range(INDEX - 1):
        power = power * H
    basis = [*_image(power), *_kernel(power)]
    dynamic = len(_image(power))
    T = fmpq_mat(size, size, [basis[j][i] for i in range(size) for j in range(size)])
    back = T.inv()
    form, drive, start = back * H * T, back * inverse * B * u, back * H * before
    y, n = range(dynamic), range(dynamic, size)
    one = range(1)
    columns = []
    inner, fast = _part(form, y, y), _part(form, n, n)
    settled, total = _part(drive, n, one), fmpq_mat(len(n), 1)
    for _ in range(INDEX + 1):
        total = total + settled
        settled = shift * (fast * settled)
    if dynamic:
        unwound = inner.inv()
        identity = fmpq_mat(dynamic, dynamic, [fmpq(int(i == j)) for i in y for j in y])
        generator = shift * identity - unwound
        force, first = unwound * _part(drive, y, one), unwound * _part(start, y, one)
    for time in times:
        if not dynamic:
            columns.append([float((T * total)[i, 0].p) / float((T * total)[i, 0].q) for i in range(size)])
            continue
        columns.append(_at(generator, force, first, T, total, rational(time)))
    z = np.array(columns).T
    return named(system.unknowns, [True] * size, times, z)


def _at(generator: fmpq_mat, force: fmpq_mat, first: fmpq_mat, T: fmpq_mat, total: fmpq_mat, time: fmpq) -> list[float]:
    """All unknowns at one time."""
    dynamic, size = generator.nrows(), T.nrows()
    entries = [
        time * (generator[i, j] if j < dynamic else force[i, 0]) if i < dynamic else fmpq(0)
        for i in range(dynamic + 1)
        for j in range(dynamic + 1)
    ]
    exponent = fmpq_mat(dynamic + 1, dynamic + 1, entries)
    before, bits = ctx.prec, BITS
    try:
        while bits <= MOST_BITS:
            ctx.prec = bits
            start = arb_mat(fmpq_mat(dynamic + 1, 1, [*(first[i, 0] for i in range(dynamic)), fmpq(1)]))
            moved = arb_mat(exponent).exp() * start
            full = arb_mat(size, 1, [moved[i, 0] if i < dynamic else total[i - dynamic, 0] for i in range(size)])
            z = arb_mat(T) * full
            values = [z[i, 0] for i in range(size)]
            largest = max(float(abs(value.mid())) for value in values)
            if all(value.is_finite() and float(value.rad()) <= DIGITS * largest * DIGITS for value in values):
                return [float(value.mid()) for value in values]
            bits *= 2
    finally:
        ctx.prec = before
    raise IllPosedError("no precision is enough")
