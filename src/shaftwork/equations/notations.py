"""The letters of other sources: one table for each, which equations are printed by on request."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import NamedTuple

from sympy import Expr, Symbol

from shaftwork.core.domains import DOMAINS
from shaftwork.core.errors import ParameterError
from shaftwork.equations.spelling import indexed

INVERSE = " inverse"
"""At the end of the name of a letter that stands for the reciprocal of a parameter."""
QUANTITIES = {
    quantity.name: quantity for domain in DOMAINS for quantity in (domain.across, domain.through, domain.integral)
}
"""Speeds, torques and angles of all domains by their names."""
_NAMES = {(quantity.latex, quantity.unit): name for name, quantity in QUANTITIES.items()}


@dataclass(frozen=True)
class Letter:
    """A symbol before its part's subscript is added.

    Args:
        name: name of the sympy symbol.
        base: the letter in LaTeX.
        mark: subscript of its own, before that of the part.
        unit: SI unit.
        meaning: a few words for the nomenclature.
        parameter: whether it is a parameter, with a value.
        owner: name of the part or node that it belongs to.
        number: running number within the part.
        place: where within the part, in words, for parts with several quantities of one meaning.
    """

    name: str
    base: str
    mark: str
    unit: str
    meaning: str
    parameter: bool = False
    owner: str = ""
    number: str = ""
    place: str = ""

    def printed(self, subscript: str) -> str:
        """The symbol in LaTeX."""
        subscripts = ",".join(text for text in (self.mark, subscript, indexed(self.number)) if text)
        return f"{self.base}_{{{subscripts}}}" if subscripts else self.base


class Inverse(NamedTuple):
    """A letter for the reciprocal of a parameter, as for a compliance in place of a stiffness.

    Attributes:
        latex: the letter.
        unit: its SI unit.
        meaning: a few words for the nomenclature.
    """

    latex: str
    unit: str
    meaning: str


@dataclass(frozen=True)
class Notation:
    """How a source writes equations.

    Args:
        quantities: LaTeX of speeds, torques and angles, by the names "omega", "tau", "phi", "v", "f", "s", "u", "i" and
            "psi"; others keep theirs. Torques and speeds among the parameters have the same letters.
        parameters: LaTeX of parameters, by (letter, SI unit) of the nomenclature, such as ("d", "N*m*s/rad").
        rate: LaTeX of a time derivative, with {} for what is derived. A letter with a dot gets a second one.
    """

    quantities: Mapping[str, str] = field(default_factory=dict)
    parameters: Mapping[tuple[str, str], str | Inverse] = field(default_factory=dict)
    rate: str = r"\frac{{d {}}}{{d t}}"

    def __post_init__(self) -> None:
        if unknown := [name for name in self.quantities if name not in QUANTITIES]:
            raise ParameterError(
                f"Notation: there is no quantity {', '.join(map(repr, unknown))}. There are: {', '.join(QUANTITIES)}."
            )
        try:
            says = self.rate.format("x") != self.rate.format("y")
        except (IndexError, KeyError, ValueError):  # of braces that are not doubled
            says = False
        if not says:
            raise ParameterError(
                f"Notation: rate = {self.rate!r} has no {{}} for what is derived; other braces stand twice."
            )

    def written(self, letter: Letter) -> Letter:
        """A letter as this source has it."""
        whole = f"{letter.base}_{letter.mark}" if letter.mark else letter.base
        chosen = self.parameters.get((whole, letter.unit)) if letter.parameter else None
        if isinstance(chosen, Inverse):
            named = replace(letter, name=f"{letter.name}{INVERSE}", unit=chosen.unit, meaning=chosen.meaning)
            return _spelt(named, chosen.latex)
        if chosen is not None:
            return _spelt(letter, chosen)
        sign = r"\Delta " if letter.base.startswith(r"\Delta ") else ""
        quantity = _NAMES.get((letter.base.removeprefix(sign), letter.unit), "")
        if quantity not in self.quantities:
            return letter
        spelt = _spelt(letter, self.quantities[quantity])
        return replace(spelt, base=sign + spelt.base, mark=",".join(filter(None, (spelt.mark, letter.mark))))

    def rate_of(self, latex: str) -> str:
        """A time derivative."""
        dotted = latex.startswith(r"\dot{")
        return latex.replace(r"\dot{", r"\ddot{", 1) if dotted else self.rate.format(latex)


def _spelt(letter: Letter, latex: str) -> Letter:
    base, mark = parted(latex)
    return replace(letter, base=base, mark=mark)


def parted(latex: str) -> tuple[str, str]:
    """A letter and its subscript without the braces around it."""
    base, _, mark = latex.partition("_")
    return base, mark[1:-1] if mark.startswith("{") and mark.endswith("}") else mark


def inverses_of(letters: Iterable[Letter]) -> dict[Symbol, Symbol]:
    """For each parameter that has a letter for its reciprocal the symbol of that."""
    names = (letter.name for letter in letters if letter.name.endswith(INVERSE))
    return {Symbol(name.removesuffix(INVERSE), real=True): Symbol(name, real=True) for name in names}


def in_letters(definitions: Mapping[Symbol, Expr], inverses: Mapping[Symbol, Symbol]) -> Iterator[tuple[Symbol, Expr]]:
    """Definitions, those of parameters that have a letter for their reciprocal as such."""
    for symbol, law in definitions.items():
        yield (inverses[symbol], 1 / law) if symbol in inverses else (symbol, law)


OWN = Notation()
STIFFNESS, DAMPING = "N*m/rad", "N*m*s/rad"
NOTATIONS: Mapping[str, Notation] = {
    # Popenda 2019: torques M, and susceptibilities S_c in place of stiffnesses
    "popenda": Notation(
        quantities={"tau": "M"},
        parameters={
            ("c", STIFFNESS): Inverse("S_c", "rad/(N*m)", "torsional susceptibility"),
            ("C'", "N*m^2/rad"): Inverse("S'_c", "rad/(N*m^2)", "torsional susceptibility per length"),
            ("d", DAMPING): "D",
        },
    ),
    # Marinković et al. 2011: torques T, damping b, speeds as rates of angles
    "marinkovic": Notation(quantities={"tau": "T", "omega": r"\dot{\varphi}"}, parameters={("d", DAMPING): "b"}),
    # Modelica.Mechanics.Rotational and Translational, and Modelica.Electrical.Analog
    "modelica": Notation(
        quantities={"omega": "w", "u": "v"}, parameters={("i", "1"): r"\mathrm{ratio}"}, rate=r"\mathrm{{der}}({})"
    ),
}
"""The notations that equations are printed in by name."""


def notation_of(name: str | Notation) -> Notation:
    """A notation by its name.

    Raises:
        ParameterError: there is no such one.
    """
    if isinstance(name, Notation):
        return name
    if not isinstance(name, str) or name not in NOTATIONS:
        raise ParameterError(
            f"There is no notation {name!r}. There are: {', '.join(map(repr, NOTATIONS))}; or give a Notation."
        )
    return NOTATIONS[name]
