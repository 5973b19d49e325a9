"""How a symbol is printed: its letter, its subscript from the part's name, and no two symbols alike."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import count

from sympy import Symbol

from shaftwork.components.base import Derived
from shaftwork.core.domains import ELECTRICAL, Quantity
from shaftwork.core.parameters import Parameter
from shaftwork.equations.notations import Notation
from shaftwork.equations.quantities import Quantities, running_number
from shaftwork.equations.spelling import GREEK, chosen_subscript, escaped
from shaftwork.network.graph import GraphBranch, GraphPart
from shaftwork.network.kinds import Kind
from shaftwork.reduction.form import StateForm

INDEX_OPENS, INDEX_CLOSES = "\ue000", "\ue001"
"""Marks around the number at the end of a subscript, to recognise rows that differ by it alone; never printed."""

WORDS = {
    "omega": "angular speed",
    "tau": "torque",
    "phi": "angle",
    "v": "speed",
    "f": "force",
    "s": "position",
    "u": "voltage",
    "i": "current",
    "psi": "flux linkage",
}
"""The quantities of the domains in words."""


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
    """

    name: str
    base: str
    mark: str
    unit: str
    meaning: str
    parameter: bool = False
    owner: str = ""
    number: str = ""

    def printed(self, subscript: str) -> str:
        """The symbol in LaTeX."""
        subscripts = ",".join(text for text in (self.mark, subscript, _index(self.number)) if text)
        return f"{self.base}_{{{subscripts}}}" if subscripts else self.base


@dataclass(frozen=True)
class Named:
    """A part or node and the letters that bear its name."""

    name: str
    letters: tuple[Letter, ...]
    chosen: str | None
    shortable: tuple[str, ...]

    def subscript(self, style: int) -> str:
        """The subscript: as short as it may be (0), the whole name (1), the name and a number (2, 3, ...)."""
        if self.chosen is not None and style == 0:
            stem, index = split_index(str(self.chosen))  # `symbol=1` is a fair choice, and printing never fails
            return f"{chosen_subscript(stem)}{_index(index)}"
        stem, index = split_index(self.name)
        comma = "" if style and stem.endswith("_") else ","
        if style == 0:
            stem = self._short(stem, index)
        text = comma.join(part for part in (f"\\mathrm{{{escaped(stem)}}}" if stem else "", _index(index)) if part)
        return text if style < 2 else f"{text},({style})"

    def _short(self, stem: str, index: str) -> str:
        """A stem without the letter of the part that stands before it: "J_rotor" is rotor, "Jm" is m, "J1" is 1."""
        stem = stem.rstrip("_") if index else stem
        if index and (stem in self.shortable or len(stem) <= 1):
            return ""
        letter, _, rest = stem.partition("_")
        if letter in self.shortable and rest.strip("_"):
            return rest
        return stem[1:] if not index and stem[:1] in self.shortable and len(stem) == 2 else stem


def _index(digits: str) -> str:
    return f"{INDEX_OPENS}{digits}{INDEX_CLOSES}" if digits else ""


def without_marks(latex: str) -> str:
    """LaTeX as it is printed."""
    return latex.replace(INDEX_OPENS, "").replace(INDEX_CLOSES, "")


def split_index(name: str) -> tuple[str, str]:
    """A name as its stem and the digits at its end."""
    stem = name.rstrip("0123456789")
    return stem, name[len(stem) :]


def notation(form: StateForm, quantities: Quantities, source: Notation) -> tuple[Mapping[str, str], tuple[Letter, ...]]:
    """LaTeX of every symbol by name, and the letters of a source in the order of the parts, for the nomenclature.

    Parts of one class whose names differ by a number are printed in one style, so that they stay a series.
    """
    bearers = (*_parts(form, quantities, source), *_nodes(quantities, source))
    series: dict[tuple[str, str], list[Named]] = {}
    for family, bearer in bearers:
        series.setdefault((family, split_index(bearer.name)[0]), []).append(bearer)
    printed: dict[str, str] = {}
    taken: set[str] = {"t"}  # only asked for membership, so its order does not matter
    for members in series.values():
        for style in count():
            made = {
                letter.name: letter.printed(member.subscript(style)) for member in members for letter in member.letters
            }
            seen = {without_marks(latex) for latex in made.values()}
            if taken.isdisjoint(seen) and len(seen) == len(made):
                break
        printed.update(made)
        taken.update(seen)
    letters = (replace(letter, owner=bearer.name) for _, bearer in bearers for letter in bearer.letters)
    return printed, tuple(letters)


def _parts(form: StateForm, quantities: Quantities, source: Notation) -> Iterator[tuple[str, Named]]:
    graph = form.graph
    own: dict[int, list[Letter]] = {number: [] for number in range(len(graph.parts))}
    for number, letter in _quantity_letters(form, quantities):
        own[number].append(letter)
    for number, part in enumerate(graph.parts):
        letters = _distinct(map(source.written, (*_parameters(part), *own[number])))
        shortable = (*part.component.declared, *(letter.base for letter in letters))
        yield type(part.component).__name__, Named(part.name, letters, part.component.symbol, shortable)


def _parameters(part: GraphPart) -> Iterator[Letter]:
    """Those of the parameters, then those that are derived from them."""
    declarations: list[Parameter | Derived] = [part.component.declared[name] for name in part.parameters]
    for declared in (*declarations, *part.derived):
        base, _, mark = declared.latex.partition("_")
        mark = mark[1:-1] if mark.startswith("{") and mark.endswith("}") else mark
        yield Letter(
            f"{part.name}.{declared.name}",
            _upright(base),
            _upright(mark),
            declared.unit,
            declared.meaning,
            parameter=True,
        )


def _upright(text: str) -> str:
    if text in GREEK:
        return f"\\{text}"
    return rf"\mathrm{{{escaped(text)}}}" if re.fullmatch(r"[A-Za-z]{2,}|\w*_\w*", text) else text


def _quantity_letters(form: StateForm, quantities: Quantities) -> Iterator[tuple[int, Letter]]:
    """The quantities that are named after a part, with the number of the part."""
    graph = quantities.graph
    yield from _node_letters(quantities)
    for ends, pair in quantities.pairs.items():
        quantity = quantities.domain(ends).across
        sign = "" if quantity is ELECTRICAL.across else r"\Delta "
        letter = _letter(pair.symbol, quantity, pair.label)
        yield (
            pair.part,
            replace(letter, base=sign + letter.base, meaning=f"{letter.meaning} across" if sign else letter.meaning),
        )
    holding = {branch.part for branch in graph.branches if branch.terms and _numbered(quantities, branch)}
    for flow in quantities.flows:
        quantity, several = quantities.domain((flow.plus, flow.minus)).through, len(flow.branches) > 1
        letter = _letter(quantities.through(flow), quantity, flow.label)
        beside = flow.part in holding and flow.label.isdecimal()
        yield flow.part, replace(letter, meaning=f"{letter.meaning} of its law") if beside else letter
        for index in flow.branches:
            template = graph.branches[index].template
            if several and template.kind is Kind.THROUGH_STORE:
                yield flow.part, _letter(quantities.store(index), quantity, template.label)
    for branch in graph.branches:
        if branch.template.kind is Kind.ACROSS_SOURCE:
            quantity = quantities.domain((branch.plus, branch.minus)).integral
            symbol = quantities.integral(branch.index)
            _, _, label = symbol.name.partition(f".{quantity.name}_")
            yield branch.part, _letter(symbol, quantity, label)
        if branch.template.is_history:
            line, _, end = branch.template.label.partition("_")
            meaning = f"torque wave that arrives at {end}"
            symbol = quantities.history(branch.index)
            yield branch.part, Letter(symbol.name, "h", _mark(end), "N*m", meaning, number=split_index(line)[1])
        if branch.terms:
            quantity = quantities.multiplier_quantity(branch.index)
            label = quantities.multiplier_label(branch.index)
            letter = _letter(quantities.multiplier(branch.index), quantity, label)
            holds = branch.part in holding and _numbered(quantities, branch)
            yield branch.part, replace(letter, meaning=f"{letter.meaning} that holds it") if holds else letter
    for state in form.states:
        if state.kind == "integral":
            branch = graph.branches[state.branch]
            quantity = quantities.domain((branch.plus, branch.minus)).integral
            label = state.name.rsplit(".", 1)[1].removeprefix(quantity.name).removeprefix("_")
            yield branch.part, _letter(quantities.integral(branch.index), quantity, label)


def _numbered(quantities: Quantities, joint: GraphBranch) -> bool:
    """Whether a number alone tells the torque of a joint from others of its part."""
    return quantities.multiplier_label(joint.index).isdecimal()


def _node_letters(quantities: Quantities) -> Iterator[tuple[int, Letter]]:
    """Speed and angle of the nodes that a store or source owns, and of those inside a part."""
    graph = quantities.graph
    for node, branch in quantities.owners.items():
        domain, part = graph.domains[node], graph.branches[branch].part
        label = graph.branches[branch].template.label
        yield part, _letter(quantities.node(node), domain.across, label)
        yield part, _letter(quantities.angle(node), domain.integral, label.removeprefix(f"{domain.across.name}_"))
    for node, (part, port) in quantities.inner.items():
        domain, (stem, digits) = graph.domains[node], split_index(port)
        for symbol, quantity in ((quantities.node(node), domain.across), (quantities.angle(node), domain.integral)):
            letter = _letter(symbol, quantity, f"{stem}_{digits}")
            yield part, replace(letter, meaning=f"{letter.meaning} of {stem}" if stem else letter.meaning)


def _letter(symbol: Symbol, quantity: Quantity, label: str = "") -> Letter:
    """The letter of a quantity; the label of its branch is the mark, "tau_c" of a torque is c, "tau_c_3" is c and 3."""
    stem = label.removeprefix(f"{quantity.name}_")
    number = stem if stem.isdecimal() else running_number(stem)
    mark = stem[: len(stem) - len(number)].rstrip("_")
    return Letter(symbol.name, quantity.latex, _mark(mark), quantity.unit, WORDS[quantity.name], number=number)


def _mark(text: str) -> str:
    """Words as a subscript: one letter in italics, Greek ones as such, others upright."""
    return ",".join(word if len(word) == 1 else _upright(word) for word in text.split("_") if word)


def _distinct(letters: Iterable[Letter]) -> tuple[Letter, ...]:
    """The letters of one part, each symbol once; a parameter that looks like a variable gets the subscript 0."""
    kept: dict[str, Letter] = {}
    for letter in letters:
        kept.setdefault(letter.name, letter)
    made: dict[str, Letter] = {}
    for letter in sorted(kept.values(), key=lambda letter: letter.parameter):
        marks = (letter.mark + "0" * times for times in count())
        free = next(own for mark in marks if (own := replace(letter, mark=mark)).printed("") not in made)
        made[free.printed("")] = free
    order = {name: place for place, name in enumerate(kept)}
    return tuple(sorted(made.values(), key=lambda letter: order[letter.name]))


def _nodes(quantities: Quantities, source: Notation) -> Iterator[tuple[str, Named]]:
    """Nodes whose speed is named after no part."""
    for number, name in enumerate(quantities.graph.nodes):
        if number not in quantities.owners and number not in quantities.inner:
            domain = quantities.graph.domains[number]
            letters = (
                _letter(quantities.node(number), domain.across),
                _letter(quantities.angle(number), domain.integral),
            )
            yield f"node of {domain.name}", Named(name, tuple(map(source.written, letters)), None, ())
