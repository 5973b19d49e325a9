"""Long shafts in print before they are divided: rows along them, conditions at their ends, letters that they need."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from sympy import Derivative, Eq, Expr, Integer, Symbol
from sympy.core.function import AppliedUndef

from shaftwork.components.base import Derived
from shaftwork.core.domains import ROTATION
from shaftwork.equations.assembly import sides, terms_of
from shaftwork.equations.letters import parameter_letters, with_derived
from shaftwork.equations.notations import Letter, in_letters, inverses_of
from shaftwork.equations.spelling import without_marks
from shaftwork.latex.printing import Line, Writer, with_rates

if TYPE_CHECKING:
    from shaftwork.equations.fields import Field


def lines_of_field(field: Field, *, values: bool) -> tuple[tuple[Line, ...], tuple[Line, ...], tuple[Line, ...]]:
    """The rows, the boundary conditions and the definitions in LaTeX; with values there are no definitions."""
    found = (row.atoms(Derivative, AppliedUndef) for row in (*field.rows, *field.boundary))
    atoms = {atom: Symbol(str(atom), real=True) for of_row in found for atom in sorted(of_row, key=str)}
    writer, inverses = _field_writer(field, atoms, values=values), inverses_of(_field_letters(field))
    defined = () if values else in_letters(field.definitions, inverses)

    def line(row: Eq) -> Line:
        left, right = (side.xreplace(atoms).expand() for side in row.args)
        return writer.line(sides(left, terms_of(right)))

    return (
        tuple(dict.fromkeys(map(line, field.rows))),  # (14) and (15) have the same numbers
        tuple(map(line, field.boundary)),
        tuple(writer.line(sides(symbol, (law,))) for symbol, law in defined),
    )


def _field_letters(field: Field) -> tuple[Letter, ...]:
    """The letters of a shaft before it is divided."""
    component, name = field.part.component, field.part.name
    waves = Derived("v", Integer(0), "m/s", "speed of waves", "v")
    parameters = parameter_letters(name, (*component.declared.values(), *field.derived, waves))
    quantities = (("tau", ROTATION.through, ""), ("tau_c", ROTATION.through, "c"), ("omega", ROTATION.across, ""))
    variables = (Letter(f"{name}.{label}", q.latex, mark, q.unit, "") for label, q, mark in quantities)
    return tuple(map(field.equations.notation.written, (*parameters, *variables)))


def _field_names(field: Field) -> dict[str, str]:
    """These letters in LaTeX, with the subscript that the shaft's length has."""
    _, _, subscript = field.equations.symbol_names[f"{field.part.name}.length"].partition("_")
    printed = subscript.removeprefix("{").removesuffix("}")
    return {letter.name: letter.printed(printed) for letter in _field_letters(field)}


def _field_writer(field: Field, atoms: Mapping[Expr, Symbol], *, values: bool) -> Writer:
    """Prints parameters, quantities of the network, and functions of x and t by the symbols that stand for them."""
    equations, letters = field.equations, _field_letters(field)
    rates = with_rates(equations.symbol_names, equations.notation.rate_of)
    along = {name: latex for shaft in equations.fields for name, latex in _field_names(shaft).items()}
    functions = {symbol.name: _printed(atom, along) for atom, symbol in atoms.items()}
    names = {**along, **functions, **{name: latex for name, latex in rates.items() if name not in along}}
    parameters = {letter.name for letter in (*equations.letters, *letters) if letter.parameter}
    ordered = {name: names[name] for name in sorted(names, key=lambda name: name not in parameters)}
    numbers = with_derived(equations.values, field.definitions) if values else {}
    return Writer(ordered, parameters, [symbol.name for symbol in atoms.values()], numbers, inverses_of(letters))


def _printed(atom: Expr, letters: Mapping[str, str]) -> str:
    """A function of x and t, or a derivative of one."""
    function = atom.expr if isinstance(atom, Derivative) else atom
    where = ", ".join(without_marks(letters.get(str(place), str(place))) for place in function.args)
    text = f"{letters[str(function.func)]}({where})"
    if not isinstance(atom, Derivative):
        return text
    order = sum(times for _, times in atom.variable_count)
    power = f"^{{{order}}}" if order > 1 else ""
    below = r" \, ".join(rf"\partial {v}" + (f"^{{{n}}}" if n > 1 else "") for v, n in atom.variable_count)
    return rf"\frac{{\partial{power} {text}}}{{{below}}}"
