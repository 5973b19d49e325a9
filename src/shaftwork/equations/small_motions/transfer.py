"""Transfer functions as quotients of polynomials in s, whose coefficients are made of the parameters' symbols.

They are quotients of two determinants of the tableau, by Cramer's rule; computed exactly, in fractions.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from mpmath import mpf, polyroots, workdps
from numpy.typing import NDArray
from sympy import QQ, QQ_I, Add, Expr, Float, Integer, Poly, Rational, Symbol
from sympy.polys.densetools import dup_eval

from shaftwork.core.errors import CompileError, ParameterError, SignalError, no_quantity
from shaftwork.core.storing import StoredByFields
from shaftwork.equations.small_motions.point_slopes import FRACTION_DIGITS, LawSlopes, PointValues, Slope, Values
from shaftwork.equations.small_motions.tableau import (
    INPUT,
    S,
    Tableau,
    TooManyTermsError,
    in_numbers,
    linear_form,
    quotient,
    with_laws,
)
from shaftwork.formulation.form import Names
from shaftwork.formulation.gains import LARGEST_DENOMINATOR
from shaftwork.formulation.source_inputs import places_of, with_inputs

if TYPE_CHECKING:
    from shaftwork.equations.records import Equations


Complex = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class TransferFunction(StoredByFields):
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
        numbers = PointValues(self.equations, parameters, at, t).with_slopes(self.slopes)
        above, below = (in_numbers(p.as_expr(), numbers) for p in (self.numerator, self.denominator))
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
        numeric = self._numeric
        first = numeric.denominator.LC()
        above, below = (
            np.array([float(c / first) for c in p.all_coeffs()]) for p in (numeric.numerator, numeric.denominator)
        )
        if not (np.isfinite(above).all() and np.isfinite(below).all()):
            raise ParameterError(
                f"The denominator has degree {numeric.denominator.degree()}, and coefficients larger than floats are. "
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
        numeric, at = self._numeric, np.asarray(s, dtype=complex)
        if not np.isfinite(at).all():
            raise ParameterError(f"s = {at[~np.isfinite(at)][0]} is no finite number.")
        values = [_divided(numeric.numerator, numeric.denominator, complex(value)) for value in at.ravel()]
        return np.array(values, dtype=complex).reshape(at.shape)

    def latex(self) -> str:
        """The equation for a LaTeX document (needs amsmath), and below it what the letters of slopes stand for."""
        from shaftwork.latex.quotients import typeset_quotient

        return typeset_quotient(self)

    _repr_latex_ = latex

    def __str__(self) -> str:
        above, below = self.printed
        lines = [f"{self.output} / {self.input} = ({above}) / ({below})"]
        return "\n".join((*lines, *(f"  {letter} = {slope.value}" for letter, slope in self.slopes.items())))

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
    if not values and (at is not None or t is not None):
        raise ParameterError("at and t put numbers in. Take values=True, or numeric(at=...) of what this makes.")
    slopes = LawSlopes(equations.assembly.quantities)
    linear = linear_form(equations, slopes)
    places = places_of(equations.form.graph, names[:1])
    form, (branch,) = with_inputs(linear, places)
    tableau = Tableau(with_laws(form, {branch: places[0].signal.sign * INPUT}))
    read = tableau.sum(_output(equations, tableau, names[1]))
    rows = tableau.rows(read)
    numbers = PointValues(equations, None, at, t).with_slopes(slopes.letters) if values else None
    try:
        above, below = quotient(rows, read, numbers)
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
    standing = {letter: slope for letter, slope in slopes.letters.items() if letter in left}
    return TransferFunction(*names, Poly(above.as_expr(), S), Poly(below.as_expr(), S), standing, equations)


def _output(equations: Equations, tableau: Tableau, name: str) -> Expr:
    """A quantity in unknowns.

    Raises:
        SignalError: there is no such quantity, or it is a power or an energy.
    """
    names, states = Names(equations.form), equations.form.states
    if name in names.signals:
        return tableau.signal(*names.signals[name])
    if name in names.integrals:
        return tableau.integral(states[names.integrals[name]].branch)
    if name in names.nodes:
        return tableau.quantities.node(names.nodes[name])
    if name in names.units:
        raise SignalError(f"'{name}' is a product of speeds and torques: it has no transfer function.")
    raise no_quantity(name, equations.form.graph.name, names.units)


def _divided(above: Poly, below: Poly, s: complex) -> complex:
    """A quotient at a complex number: exact but for the last division."""
    at = QQ_I(*(QQ(*part.as_integer_ratio()) for part in (s.real, s.imag)))
    numerator, denominator = (
        dup_eval([QQ_I(QQ(int(c.p), int(c.q)), 0) for c in polynomial.all_coeffs()], at, QQ_I)
        for polynomial in (above, below)
    )
    if not denominator:
        raise ParameterError(f"s = {s:g} is a pole.")
    quotient = numerator / denominator
    return complex(float(quotient.x), float(quotient.y))


def _roots(polynomial: Poly) -> Complex:
    """Zeros, each as often as it occurs, sorted by size; those of several equal factors too have full digits.

    Law: the eigenvalues of the companion matrix, improved by Durand's and Kerner's method in many digits.
    """
    roots = [root for factor, times in polynomial.sqf_list()[1] for root in _simple_roots(factor) * times]
    return np.array(sorted(roots, key=lambda root: (abs(root), root.imag)), dtype=complex)


def _simple_roots(polynomial: Poly) -> list[complex]:
    coefficients, degree = polynomial.all_coeffs(), polynomial.degree()
    with workdps(FRACTION_DIGITS):
        numbers = [mpf(int(c.p)) / int(c.q) for c in coefficients]
        last = next(c for c in reversed(numbers) if c)
        size = (abs(last / numbers[0])) ** (mpf(1) / degree)  # of the roots, all in all
        scaled = [c * size ** (degree - k) for k, c in enumerate(numbers)]
        guesses = np.roots([float(c / scaled[0]) for c in scaled])
        # About ten binary digits cancel in a polynomial for each of its roots.
        roots = polyroots(scaled, maxsteps=1000, extraprec=10 * degree, roots_init=guesses.tolist())
        return [complex(root * size) for root in roots]


def _readable(polynomial: Poly, first: Expr) -> Expr:
    """A polynomial over a number, with floats in place of long fractions."""
    return Add(*(_rounded(coefficient / first) * S**power for (power,), coefficient in polynomial.terms()))


def _rounded(coefficient: Expr) -> Expr:
    long = (
        number
        for number in coefficient.atoms(Rational)
        if number.q > LARGEST_DENOMINATOR or abs(number.p) > LARGEST_DENOMINATOR**2
    )
    return coefficient.xreplace({number: Float(number) for number in long})
