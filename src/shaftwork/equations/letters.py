"""How a symbol is printed: its letter, its subscript from the part's name, and no two symbols alike."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import count

from sympy import Expr, Float, Symbol

from shaftwork.components.base import Derived
from shaftwork.core.domains import ELECTRICAL, Quantity
from shaftwork.core.parameters import Parameter
from shaftwork.equations.notations import Letter, Notation, parted
from shaftwork.equations.quantities import Quantities, ThroughQuantity, running_number
from shaftwork.equations.spelling import GREEK, chosen_subscript, escaped, indexed, split_index, without_marks
from shaftwork.formulation.form import StateForm
from shaftwork.network.graph import GROUND, GraphBranch, GraphPart
from shaftwork.network.kinds import Kind

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
    "x": "state of a controller",
    "w": "rate of that state",
    "z": "integral of that state",
}
"""The quantities of the domains in words."""


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
            return f"{chosen_subscript(stem)}{indexed(index)}"
        stem, index = split_index(self.name)
        stem = stem.rstrip() if index else stem  # "mesh 1" is mesh, 1
        comma = "" if style and stem.endswith("_") else ","
        if style == 0:
            stem = self._short(stem, index)
        text = comma.join(part for part in (f"\\mathrm{{{escaped(stem)}}}" if stem else "", indexed(index)) if part)
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


def letters_of(
    form: StateForm, quantities: Quantities, notation: Notation
) -> tuple[Mapping[str, str], tuple[Letter, ...]]:
    """LaTeX of every symbol by name, and the letters of a notation in the order of the parts, for the nomenclature.

    Parts of one class whose names differ by a number are printed in one style, so that they stay a series.
    """
    bearers = (*_parts(form, quantities, notation), *_nodes(quantities, notation))
    series: dict[tuple[str, str], list[Named]] = {}
    for family, bearer in bearers:
        series.setdefault((family, split_index(bearer.name)[0]), []).append(bearer)
    printed: dict[str, str] = {}
    taken: set[str] = {"t"}  # only asked for membership, so its order does not matter
    for members in series.values():
        for style in count():
            styled = {
                letter.name: letter.printed(member.subscript(style)) for member in members for letter in member.letters
            }
            seen = {without_marks(latex) for latex in styled.values()}
            if taken.isdisjoint(seen) and len(seen) == len(styled):
                break
        printed.update(styled)
        taken.update(seen)
    letters = (replace(letter, owner=bearer.name) for _, bearer in bearers for letter in bearer.letters)
    return printed, tuple(letters)


def _parts(form: StateForm, quantities: Quantities, notation: Notation) -> Iterator[tuple[str, Named]]:
    graph = form.graph
    variables: dict[int, list[Letter]] = {number: [] for number in range(len(graph.parts))}
    for number, letter in _quantity_letters(form, quantities):
        variables[number].append(letter)
    for number, part in enumerate(graph.parts):
        declarations = [part.component.declared[name] for name in part.parameters]
        parameters = parameter_letters(part.name, (*declarations, *part.derived))
        letters = tuple(_told_apart(_distinct(map(notation.written, (*parameters, *variables[number])))))
        shortable = (*part.component.declared, *(letter.base for letter in letters))
        yield type(part.component).__name__, Named(part.name, letters, part.component.symbol, shortable)


def parameter_letters(part: str, declarations: Iterable[Parameter | Derived]) -> Iterator[Letter]:
    """The letters of parameters and of what is derived from them."""
    for declared in declarations:
        base, mark = parted(declared.latex)
        yield Letter(
            f"{part}.{declared.name}", _upright(base), _upright(mark), declared.unit, declared.meaning, parameter=True
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
        meaning = f"{letter.meaning} across" if sign else letter.meaning
        place = _between(graph.parts[pair.part], *ends)
        yield pair.part, replace(letter, base=sign + letter.base, meaning=meaning, place=place)
    holding = {branch.part for branch in graph.branches if branch.terms and _numbered(quantities, branch)}
    for flow in quantities.flows:
        yield from ((flow.part, letter) for letter in _flow_letters(quantities, flow, holds=flow.part in holding))
    for branch in graph.branches:
        yield from ((branch.part, letter) for letter in _branch_letters(quantities, branch))
    for state in form.states:
        if state.kind == "integral":
            branch = graph.branches[state.branch]
            quantity = quantities.domain((branch.plus, branch.minus)).integral
            label = state.name.rsplit(".", 1)[1].removeprefix(quantity.name).removeprefix("_")
            letter = _letter(quantities.integral(branch.index), quantity, label)
            yield branch.part, replace(letter, place=_between(graph.part_of(branch.index), branch.plus, branch.minus))


def _flow_letters(quantities: Quantities, flow: ThroughQuantity, *, holds: bool) -> Iterator[Letter]:
    """What passes through parallel branches of a part, and through a spring among them.

    Args:
        holds: whether the part has a joint too, whose torque is another one.
    """
    quantity = quantities.domain((flow.plus, flow.minus)).through
    ends = (flow.plus, flow.minus) if flow.sign > 0 or flow.minus == GROUND else (flow.minus, flow.plus)
    place = _between(quantities.graph.parts[flow.part], *ends)
    letter = replace(_letter(quantities.through(flow), quantity, flow.label), place=place)
    beside = holds and flow.label.isdecimal()
    yield replace(letter, meaning=f"{letter.meaning} of its law") if beside else letter
    for index in flow.branches if len(flow.branches) > 1 else ():
        template = quantities.graph.branches[index].template
        if template.kind is Kind.THROUGH_STORE:
            alone = _letter(quantities.store(index), quantity, template.label)
            spring = "inductance" if quantity is ELECTRICAL.through else "spring"
            yield replace(alone, meaning=f"{alone.meaning} of the {spring} alone", place=place)


def _branch_letters(quantities: Quantities, branch: GraphBranch) -> Iterator[Letter]:
    """The position that a source prescribes, the wave that arrives at an end of a line, the reaction of a coupling."""
    if branch.template.kind is Kind.ACROSS_SOURCE:
        quantity = quantities.domain((branch.plus, branch.minus)).integral
        symbol = quantities.integral(branch.index)
        _, _, label = symbol.name.partition(f".{quantity.name}_")
        place = _between(quantities.graph.part_of(branch.index), branch.plus, branch.minus)
        yield replace(_letter(symbol, quantity, label), place=place)
    if branch.template.is_history:
        line, _, end = branch.template.label.partition("_")
        meaning = f"torque wave that arrives at {end}"
        symbol = quantities.history(branch.index)
        yield Letter(symbol.name, "h", _mark(end), "N*m", meaning, number=split_index(line)[1])
    if branch.terms:
        quantity = quantities.multiplier_quantity(branch.index)
        letter = _letter(quantities.multiplier(branch.index), quantity, quantities.multiplier_label(branch.index))
        holds = _numbered(quantities, branch)
        through = "" if letter.number else _between(quantities.graph.part_of(branch.index), *branch.terms[0][1:])
        letter = replace(letter, place=f"that its coupling transmits {through}".rstrip())
        yield replace(letter, meaning=f"{letter.meaning} that holds it") if holds else letter


def _numbered(quantities: Quantities, joint: GraphBranch) -> bool:
    """Whether a number alone tells the torque of a joint from others of its part."""
    return quantities.multiplier_label(joint.index).isdecimal()


def _node_letters(quantities: Quantities) -> Iterator[tuple[int, Letter]]:
    """Speed and angle of the nodes that a store or source owns, and of those inside a part."""
    graph = quantities.graph
    for node, branch in quantities.owners.items():
        domain, part = graph.domains[node], graph.branches[branch].part
        label, place = graph.branches[branch].template.label, _between(graph.parts[part], node, GROUND)
        of_angle = label.removeprefix(f"{domain.across.name}_")
        yield part, replace(_letter(quantities.node(node), domain.across, label), place=place)
        yield part, replace(_letter(quantities.angle(node), domain.integral, of_angle), place=place)
    for node, (part, port) in quantities.inner.items():
        domain, (stem, digits) = graph.domains[node], split_index(port)
        for symbol, quantity in ((quantities.node(node), domain.across), (quantities.angle(node), domain.integral)):
            letter = _letter(symbol, quantity, f"{stem}_{digits}")
            words = " ".join(stem.split("_"))
            yield part, replace(letter, meaning=f"{letter.meaning} of {words}" if words else letter.meaning)


def _between(part: GraphPart, plus: int, minus: int) -> str:
    """The place of a branch within its part by the names of its ports: "at b", "inside", "from leg a to winding a".

    Numbers of ports are left out: letters that differ by a number alone have one meaning.
    """
    names = {node: " ".join(split_index(port)[0].split("_")) for port, node in part.nodes.items() if node != GROUND}
    words = [names[node] for node in (plus, minus) if node in names]
    if all(words):
        return f"from {words[0]} to {words[1]}" if len(words) > 1 else f"at {words[0]}" if words else ""
    return "inside"


def _told_apart(letters: tuple[Letter, ...]) -> Iterator[Letter]:
    """The letters of one part, with their places in their meanings where these are alike but for a number."""
    alike: dict[str, set[tuple[str, ...]]] = {}  # only counted
    for letter in letters:
        alike.setdefault(letter.meaning, set()).add((letter.base, letter.mark, letter.number and "number"))
    for letter in letters:
        told = letter.parameter or len(alike[letter.meaning]) == 1 or not letter.place
        yield letter if told else replace(letter, meaning=f"{letter.meaning} {letter.place}")


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
    first: dict[str, Letter] = {}
    for letter in letters:
        first.setdefault(letter.name, letter)
    by_latex: dict[str, Letter] = {}
    for letter in sorted(first.values(), key=lambda letter: letter.parameter):
        marks = (letter.mark + "0" * times for times in count())
        free = next(new for mark in marks if (new := replace(letter, mark=mark)).printed("") not in by_latex)
        by_latex[free.printed("")] = free
    order = {name: place for place, name in enumerate(first)}
    return tuple(sorted(by_latex.values(), key=lambda letter: order[letter.name]))


def _nodes(quantities: Quantities, notation: Notation) -> Iterator[tuple[str, Named]]:
    """Nodes whose speed is named after no part."""
    for number, name in enumerate(quantities.graph.nodes):
        if number not in quantities.owners and number not in quantities.inner:
            domain = quantities.graph.domains[number]
            letters = (
                _letter(quantities.node(number), domain.across),
                _letter(quantities.angle(number), domain.integral),
            )
            yield f"node of {domain.name}", Named(name, tuple(map(notation.written, letters)), None, ())


def with_derived(values: Mapping[str, float], definitions: Mapping[Symbol, Expr]) -> dict[str, float]:
    """Values of parameters, and of what is derived from them."""
    numbers = dict(values)
    for symbol, law in definitions.items():
        numbers[symbol.name] = float(law.xreplace({each: Float(numbers[each.name]) for each in law.free_symbols}))
    return numbers
