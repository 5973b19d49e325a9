"""Transfer functions as quotients of polynomials in s, whose coefficients are made of the parameters' symbols.

They are quotients of two determinants of the tableau, by Cramer's rule; computed exactly, in fractions.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

import networkx as nx
import numpy as np
from mpmath import mpf, polyroots, workdps
from numpy.typing import NDArray
from sympy import Add, Expr, Float, Integer, Poly, Rational, Symbol, lcm, prime, sring, together

from shaftwork.core.errors import CompileError, ParameterError, SignalError, no_quantity
from shaftwork.equations.determinants import MOST_TERMS, TooManyTermsError, determinant
from shaftwork.equations.point_values import DIGITS, Numbers, Values, exact, fraction
from shaftwork.equations.slopes import LawSlopes, Slope
from shaftwork.equations.tableau import S, Sum, Tableau, Unknown, refuse_waves
from shaftwork.reduction.form import Names
from shaftwork.reduction.source_inputs import Place, places_of

if TYPE_CHECKING:  # the records make transfer functions through this module
    from shaftwork.equations.records import Equations

FEW = 1000
"""The largest denominator of a fraction that is printed as one."""

MOST_NUMBERS = 200_000
"""Terms of the minors where these are polynomials in s alone."""
SHORT = 600
"""Terms of a quotient up to which all common factors are looked for: it takes seconds."""
STEPS, EXTRA = 1000, 10
"""Steps in which roots are improved, and the binary digits more for each of them: what cancels in a polynomial."""

Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class TransferFunction:
    """A quantity over an input in the image domain: numerator / denominator, without common factors.

    `H(2j * pi * f)` is the frequency response. Where there are symbols, `poles`, `zeros`, `coefficients` and values
    are those with the parameters of the network and laws at rest; others by `numeric`.

    Args:
        input: name of the input.
        output: name of the quantity.
        numerator: polynomial in s with exact coefficients, in symbols of parameters, and of slopes.
        denominator: the same.
        slopes: what the symbols of slopes of laws stand for, in quantities at the point about which all moves little.
        equations: of the network.
    """

    input: str
    output: str
    numerator: Poly
    denominator: Poly
    slopes: Mapping[Symbol, Slope]
    equations: Equations
    s = S

    @cached_property
    def expression(self) -> Expr:
        """The quotient, for sympy."""
        above, below = self.printed
        return above / below

    @property
    def printed(self) -> tuple[Expr, Expr]:
        """Numerator and denominator as they are read: numbers in few digits, the first of the denominator 1."""
        first = self.denominator.LC() if self.denominator.LC().is_number else Integer(1)
        return _readable(self.numerator, first), _readable(self.denominator, first)

    def numeric(
        self, parameters: Values | None = None, at: Values | None = None, *, t: float | None = None
    ) -> TransferFunction:
        """The same in numbers.

        Args:
            parameters: values in place of those of the network, as {"shaft.c": 2e4}.
            at: the point at which laws have their slopes, {"J1.omega": 8.0}, with all that they read; by default rest.
            t: time at which laws are read, s; by default after their last breakpoint; of parts that change their mode,
                at rest, 0.

        Raises:
            ParameterError: there is no such parameter or quantity, one has no such value, a law has no finite slope at
                the point, or there are numbers already.
        """
        if not self._symbols and (parameters or at):
            raise ParameterError("This transfer function is in numbers already. Make it without values=True.")
        numbers = Numbers(self.equations, parameters, at, t)
        numbers.add(self.slopes)
        above, below = (_in_numbers(p.as_expr(), numbers.known) for p in (self.numerator, self.denominator))
        if not below:
            raise ParameterError(f"{self.output} / {self.input} has no finite value with these numbers.")
        above, below = above.cancel(below, include=True)
        return replace(self, numerator=above, denominator=below, slopes={})

    @property
    def _symbols(self) -> bool:
        """Whether there are symbols in the coefficients."""
        return bool(self.numerator.free_symbols_in_domain | self.denominator.free_symbols_in_domain)

    @cached_property
    def _numeric(self) -> TransferFunction:
        return self.numeric() if self._symbols else self

    def coefficients(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Numerator and denominator in numbers, from the highest power of s down, the first of the denominator 1.

        Raises:
            ParameterError: one is larger than floats are.
        """
        made = self._numeric
        first = made.denominator.LC()
        above, below = (
            np.array([float(c / first) for c in p.all_coeffs()]) for p in (made.numerator, made.denominator)
        )
        if not (np.isfinite(above).all() and np.isfinite(below).all()):
            raise ParameterError(
                f"The denominator has degree {made.denominator.degree()}, and coefficients larger than floats are. "
                "Take poles() and zeros(), or values at s."
            )
        return above, below

    def poles(self) -> Complex:
        """Zeros of the denominator, 1/s; each as often as it occurs."""
        return _roots(self._numeric.denominator)

    def zeros(self) -> Complex:
        """Zeros of the numerator, 1/s; each as often as it occurs."""
        return _roots(self._numeric.numerator)

    def __call__(self, s: Any) -> Complex:
        """Values at complex s, 1/s, of the same shape.

        Raises:
            ParameterError: one of them is a pole, or no finite number.
        """
        made, at = self._numeric, np.asarray(s, dtype=complex)
        if not np.isfinite(at).all():
            raise ParameterError(f"s = {at[~np.isfinite(at)][0]} is no finite number.")
        found = [_divided(made.numerator, made.denominator, complex(value)) for value in at.ravel()]
        return np.array(found, dtype=complex).reshape(at.shape)

    def latex(self) -> str:
        """The equation for a LaTeX document (needs amsmath), and below it what the letters of slopes stand for."""
        from shaftwork.equations.transfer_print import in_latex

        return in_latex(self)

    _repr_latex_ = latex

    def __str__(self) -> str:
        above, below = self.printed
        lines = [f"{self.output} / {self.input} = ({above}) / ({below})"]
        return "\n".join((*lines, *(f"  {letter} = {made.value}" for letter, made in self.slopes.items())))

    __repr__ = __str__


def transfer_function(
    equations: Equations, names: tuple[str, str], *, values: bool, at: Values | None, t: float | None
) -> TransferFunction:
    """The transfer function from an input to a quantity.

    Args:
        equations: of the network.
        names: of the input and of the quantity.
        values: put in numbers from the start; then networks may be large.
        at: with values, the point at which laws have their slopes.
        t: with values, the time at which laws are read, s; None as for `numeric`.

    Raises:
        SignalError: there is no such input or quantity.
        CompileError: a shaft is a travelling wave; the network is too large for symbols; or it has several motions.
        ParameterError: with values, `at` names no quantity, or a law has no finite slope there.
    """
    refuse_waves(equations.form)
    if not values and (at is not None or t is not None):
        raise ParameterError("at and t put numbers in. Take values=True, or numeric(at=...) of what this makes.")
    (place,) = places_of(equations.form.graph, names[:1])
    slopes = LawSlopes(equations.assembly.quantities)
    tableau = Tableau(equations.assembly, slopes)
    read, direct = _output(equations, tableau, place, names[1])
    rows = tableau.rows(read)
    known: dict[Symbol, Rational] | None = None
    if values:
        numbers = Numbers(equations, None, at, t)
        numbers.add(slopes.letters)
        known = numbers.known
    entered = tableau.entered(place)
    try:
        above, below = _reduced(*_quotient(_reached(rows, read), entered, (read, direct), known))
    except TooManyTermsError:
        raise CompileError(
            "The network has too many loops for determinants in numbers. Take frequency_response."
            if values
            else "The polynomials have thousands of terms in symbols, more than anyone reads. Take values=True, which "
            "puts in the parameters' values."
        ) from None
    if not below:
        raise CompileError(
            f"The equations of '{equations.form.graph.name}' near this point are singular: they leave a speed or "
            "torque undetermined. Take another point, or another phase."
        )
    left = above.as_expr().free_symbols | below.as_expr().free_symbols
    kept = {letter: slope for letter, slope in slopes.letters.items() if letter in left}
    return TransferFunction(*names, Poly(above.as_expr(), S), Poly(below.as_expr(), S), kept, equations)


def _output(equations: Equations, tableau: Tableau, place: Place, name: str) -> tuple[Sum, int]:
    """A quantity as a sum of unknowns, and what the input itself adds to it.

    Raises:
        SignalError: there is no such quantity, or it is a power or an energy.
    """
    names, graph = Names(equations.form), equations.form.graph
    if name in names.signals:
        part, signal = names.signals[name]
        direct = 0
        if signal.kind == "through" and place.branch < 0 and part.name == graph.parts[place.part].name:
            first, second = place.signal.ends
            direct = signal.sign * place.signal.sign * ((first == signal.ends[0]) - (second == signal.ends[0]))
        return tableau.signal(part, signal), direct
    if name in names.integrals:
        return tableau.integral(graph.branches[equations.form.states[names.integrals[name]].branch]), 0
    if name in names.nodes:
        return tableau.node(names.nodes[name]), 0
    if name in names.units:
        raise SignalError(f"'{name}' is a product of speeds and torques: it has no transfer function.")
    raise no_quantity(name, graph.name, names.units)


def _reached(rows: Mapping[Unknown, Sum], read: Sum) -> Mapping[Unknown, Sum]:
    """The rows of the unknowns on which those that are read depend, or which depend on these."""
    trains: nx.Graph[Unknown] = nx.Graph()
    trains.add_nodes_from(rows)
    trains.add_edges_from((own, other) for own, row in rows.items() for other in row)
    reached = set[Unknown]().union(*(nx.node_connected_component(trains, unknown) for unknown in read))
    return {own: row for own, row in rows.items() if own in reached}


def _quotient(
    rows: Mapping[Unknown, Sum], entered: Mapping[Unknown, int], output: tuple[Sum, int], known: Values | None
) -> tuple[Any, Any]:
    """The output's determinant and that of the rows, as polynomials of one ring."""
    columns = {unknown: k for k, unknown in enumerate(rows)}
    read, direct = output
    bordered = [
        {columns[unknown]: entry for unknown, entry in row.items()}
        | ({len(rows): Integer(entered[own])} if own in entered else {})
        for own, row in rows.items()
    ]
    bordered.append({columns[unknown]: -entry for unknown, entry in read.items()})
    if direct:
        bordered[-1][len(rows)] = Integer(direct)
    if known is None:
        cleared = [_cleared(row) for row in bordered]
    else:
        cleared = [({k: _in_numbers(e, known).as_expr() for k, e in row.items()}, Integer(1)) for row in bordered]
    entries = [entry for row, _ in cleared for entry in row.values()]
    ring, (_, factor, *made) = sring([S, cleared[-1][1], *entries])
    left = iter(made)
    matrix = [{column: next(left) for column in row} for row, _ in cleared]
    own = [{column: entry for column, entry in row.items() if column < len(rows)} for row in matrix[:-1]]
    most = MOST_TERMS if known is None else MOST_NUMBERS
    return determinant(matrix, ring.one, most), determinant(own, ring.one, most) * factor


def _reduced(above: Any, below: Any) -> tuple[Any, Any]:
    """The same quotient without common factors.

    Of a long one only factors that hold s are looked for: where numerator and denominator have none in common for one
    choice of the parameters, they have none at all.

    Raises:
        TooManyTermsError: a long one has such a factor.
    """
    ring = above.ring
    if not (above and below) or len(above) + len(below) <= SHORT or ring.ngens == 1:
        return above.cancel(below) if below else (above, below)
    powers = np.min([*above.itermonoms(), *below.itermonoms()], axis=0)
    above, below = (p.exquo(ring.term_new(tuple(powers.tolist()), ring.domain.one)) for p in (above, below))
    place = ring.symbols.index(S)
    numbers = [
        (x, number)
        for k, (x, number) in enumerate(zip(ring.gens, _distinct_primes(ring.ngens), strict=True))
        if k != place
    ]
    tried = [p.evaluate(numbers) for p in (above, below)]
    if tried[0].gcd(tried[1]).is_ground:
        return above, below
    raise TooManyTermsError


def _distinct_primes(count: int) -> list[int]:
    return [prime(7 + 3 * k) for k in range(count)]


def _cleared(row: Mapping[int, Expr]) -> tuple[dict[int, Expr], Expr]:
    """A row without fractions of symbols, and by what it has been multiplied."""
    parts = {column: exact(together(entry)).as_numer_denom() for column, entry in row.items()}
    common = Integer(1)
    for _, below in parts.values():
        common = lcm(common, below)
    return {column: (above * (common / below).cancel()).expand() for column, (above, below) in parts.items()}, common


def _in_numbers(expression: Expr, known: Mapping[Symbol, Rational]) -> Poly:
    """A polynomial in s whose coefficients are fractions."""
    found = Poly(exact(expression).xreplace(dict(known)), S)
    return Poly([fraction(coefficient) for coefficient in found.all_coeffs()], S)


def _divided(above: Poly, below: Poly, s: complex) -> complex:
    """A quotient at a complex number: exact but for the last division."""
    (a, b), (c, d) = (_at(polynomial.all_coeffs(), s) for polynomial in (above, below))
    size = c * c + d * d
    if not size:
        raise ParameterError(f"s = {s:g} is a pole.")
    return complex(float((a * c + b * d) / size), float((b * c - a * d) / size))


def _at(coefficients: Iterable[Rational], s: complex) -> tuple[Fraction, Fraction]:
    real, imaginary = Fraction(s.real), Fraction(s.imag)
    x, y = Fraction(0), Fraction(0)
    for c in coefficients:
        x, y = x * real - y * imaginary + Fraction(int(c.p), int(c.q)), x * imaginary + y * real
    return x, y


def _roots(polynomial: Poly) -> Complex:
    """Zeros, each as often as it occurs, sorted by size; those of several equal factors too have full digits.

    Law: the eigenvalues of the companion matrix, improved by Durand's and Kerner's method in many digits.
    """
    found = [root for factor, times in polynomial.sqf_list()[1] for root in _simple_roots(factor) * times]
    return np.array(sorted(found, key=lambda root: (abs(root), root.imag)), dtype=complex)


def _simple_roots(polynomial: Poly) -> list[complex]:
    coefficients, degree = polynomial.all_coeffs(), polynomial.degree()
    with workdps(DIGITS):
        numbers = [mpf(int(c.p)) / int(c.q) for c in coefficients]
        last = next(c for c in reversed(numbers) if c)
        size = (abs(last / numbers[0])) ** (mpf(1) / degree)  # of the roots, all in all
        scaled = [c * size ** (degree - k) for k, c in enumerate(numbers)]
        guesses = np.roots([float(c / scaled[0]) for c in scaled])
        found = polyroots(scaled, maxsteps=STEPS, extraprec=EXTRA * degree, roots_init=guesses.tolist())
        return [complex(root * size) for root in found]


def _readable(polynomial: Poly, first: Expr) -> Expr:
    """A polynomial over a number, with floats in place of long fractions."""
    return Add(*(_rounded(coefficient / first) * S**power for (power,), coefficient in polynomial.terms()))


def _rounded(coefficient: Expr) -> Expr:
    long = (number for number in coefficient.atoms(Rational) if number.q > FEW or abs(number.p) > FEW**2)
    return coefficient.xreplace({number: Float(number) for number in long})
