"""What is printed of the equations, and in which order: blocks of lines under headings."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

from sympy import Add, Expr, Float, Symbol, preorder_traversal

from shaftwork.components.noise import HeldNoise, SmoothNoise
from shaftwork.core.domains import ELECTRICAL, ROTATION, SIGNAL, TRANSLATION
from shaftwork.core.errors import CompileError
from shaftwork.equations.assembly import Sides, sides, terms_of
from shaftwork.equations.dimensions import unit_of
from shaftwork.equations.notations import in_letters
from shaftwork.equations.quantities import Quantities, ThroughQuantity, rate_of
from shaftwork.equations.spelling import INDEX_CLOSES, INDEX_OPENS, in_text
from shaftwork.latex.compact_rows import SpectralShaft, compact_assembly, in_sums, spectral_shafts
from shaftwork.latex.field_lines import lines_of_field
from shaftwork.latex.harmonic_tables import HarmonicTables
from shaftwork.latex.nomenclature import Cells, breakable, unit
from shaftwork.latex.printing import Line, Writer, with_rates
from shaftwork.latex.shaft_sums import MEANING, Sums, printed_sums, printed_weights, rows_of_sums
from shaftwork.network.kinds import Kind

if TYPE_CHECKING:
    from shaftwork.equations.kirchhoff import Eliminated, Row
    from shaftwork.equations.records import Equations

AUXILIARY = (r"\sigma", r"\zeta", r"\xi", r"\chi")
"""Letters for sums that occur more than once in a law, such as a slip."""
ORDINALS = ("first", "second", "third")
BALANCES = {ROTATION: "torques", TRANSLATION: "forces", ELECTRICAL: "currents", SIGNAL: "rates"}


@dataclass(frozen=True)
class Block:
    """Equations under a heading, or a remark where there are none."""

    heading: str
    lines: tuple[Line, ...]
    remark: str = ""


@dataclass(frozen=True, eq=False)
class Blocks:
    """Prints the records of a network as blocks.

    Args:
        equations: the records.
        values: print the parameters' values instead of their symbols.
    """

    equations: Equations
    values: bool

    def kirchhoff(self, *, twists: bool = True) -> Iterator[Block]:
        """Balances, loops, couplings and laws.

        Args:
            twists: print whose integrals the angles in laws are; not needed above the state form, which says it.
        """
        domains = dict.fromkeys(self.equations.form.graph.domains)
        balanced = " and ".join(", ".join(BALANCES[domain] for domain in domains).rsplit(", ", 1))
        nodes = [row for number, row in enumerate(self.rows.nodes) if number not in self.inside | self.twists]
        balances = (summed.balance() for summed in self.sums)
        yield Block(f"Balance of {balanced} at the nodes", (*self._lines(nodes), *balances))
        loops = [row for row in self.rows.loops if self._ends_of(row.link)[0] not in self.twists]
        rates = (line for summed in self.sums for line in summed.loops())
        yield Block("Speeds around the loops", (*self._lines(loops), *rates))
        lossy = any(branch.template.through for branch in self.equations.form.graph.branches)
        yield Block("Couplings" if lossy else "Ideal couplings", tuple(self._lines(self._couplings())))
        integrals = [row for row in self.rows.states if row.name in self._integrals] if twists else []
        yield Block("Laws of the parts", (*self._laws(), *self._lines(integrals)))

    def _couplings(self) -> Iterator[Row]:
        """The couplings that say what no loop says."""
        rows = self.rows
        around = {_to_rounding(row.expression) for row in rows.loops}  # only asked for membership
        along = {branch for shaft in self.shafts for branch in shaft.couplings}  # so is this
        for row in rows.couplings:
            said = _to_rounding(row.expression), _to_rounding(-row.expression)
            if row.branches[0] not in along and around.isdisjoint(said):
                yield row

    @cached_property
    def _integrals(self) -> frozenset[str]:
        return frozenset(state.name for state in self.equations.form.states if state.kind == "integral")

    @property
    def used(self) -> tuple[str, ...]:
        """The names of the quantities in all that has been printed so far, without rates and sums."""
        used = dict.fromkeys(map(_without_rate, self.writer.used))
        for family in (family for shaft in self.shafts for family in shaft.families):
            if any(symbol.name in used for symbol in family):
                used.update(dict.fromkeys(str(symbol.name) for symbol in family))
        return tuple(used)

    def helpers(self) -> Iterator[Cells]:
        """Rows of a nomenclature: letters for sums in laws that have been printed so far, and for weights."""
        units = {letter.name: letter.unit for letter in self.equations.letters}
        graph = self.equations.form.graph
        for flow, (shared, _) in self._split.items():
            of = f"in the law of ${self.equations.symbol_names[self.quantities.through(flow).name]}$"
            for ordinal, (letter, total) in zip(ORDINALS, shared, strict=False):
                units[letter.name] = unit_of(total, units)
                if letter.name in self.writer.used:
                    which = f"{ordinal} sum" if len(shared) > 1 else "sum"
                    name, owner = self._auxiliary_names[letter.name], breakable(graph.parts[flow.part].name)
                    yield f"${name}$", f"{which} {of}", owner, unit(units[letter.name])
            noises = (noise for term in self._split[flow][1] for noise in term.atoms(HeldNoise, SmoothNoise))
            for name in sorted({self.writer.latex(noise).partition(r"\left(")[0] for noise in noises}):
                yield f"${name}$", "function with random values", breakable(graph.parts[flow.part].name), "--"
        yield from self.tables.helpers()
        yield from rows_of_sums(self.sums, self.used)

    def derived(self) -> Block:
        """The definitions of the letters that stand for several parameters; nothing where numbers are printed."""
        definitions = {} if self.values else self.equations.definitions
        pairs = in_letters(definitions, self.equations.inverses)
        weights = {summed.shaft.mark: summed.definition() for summed in self.sums}
        return Block(
            "Derived quantities",
            (*(self.writer.line(sides(symbol, (law,))) for symbol, law in pairs), *weights.values()),
            MEANING if weights else "",
        )

    def orders(self) -> Block:
        """The tables of the orders of torques that swing with the angle."""
        return Block("Orders of the torques", tuple(self.tables.lines()), self.tables.remark)

    @cached_property
    def tables(self) -> HarmonicTables:
        """Of the orders in the laws."""
        return HarmonicTables(self.equations.form.graph)

    @cached_property
    def shafts(self) -> tuple[SpectralShaft, ...]:
        """The shafts whose rows are printed as sums."""
        return spectral_shafts(self.equations.assembly.quantities)

    @cached_property
    def sums(self) -> tuple[Sums, ...]:
        """Their general rows."""
        return tuple(Sums(shaft, self.writer) for shaft in self.shafts)

    @cached_property
    def rows(self) -> Equations:
        """The equations with the whole torques along these shafts in them, and with h in the inertia of their ends."""
        if not self.shafts:
            return self.equations
        return self.equations.from_assembly(compact_assembly(self.equations.form, self.shafts))

    @property
    def quantities(self) -> Quantities:
        """The symbols of these rows."""
        return self.rows.assembly.quantities

    @cached_property
    def inside(self) -> frozenset[int]:
        """The nodes between the ends of these shafts."""
        return frozenset(node for shaft in self.shafts for node in shaft.inside)

    @cached_property
    def twists(self) -> frozenset[int]:
        """The nodes whose speeds are rates of twist of these shafts."""
        return frozenset(node for shaft in self.shafts for node in shaft.twists)

    def _ends_of(self, branch: int) -> tuple[int, int]:
        return self.rows.assembly.ends(branch)

    def _is_summed(self, branch: int) -> bool:
        return self._ends_of(branch)[0] in self.inside | self.twists

    def state(self, *, laws: bool = True) -> Iterator[Block]:
        """Rates of the states, what stands in them, and what was eliminated.

        Args:
            laws: print the laws that stand in the rates; not needed below Kirchhoff's equations, which contain them.
        """
        rows = [row for row in self.rows.states if not self._is_summed(row.branches[0])]
        shown = [row.sides if row.explicit and _rates_in(row.coupled.left) <= 1 else row.coupled for row in rows]
        coupled = any(shape is not row.sides for shape, row in zip(shown, rows, strict=True))
        remark = "Rates that stand together on a left side are coupled by inertias or springs." if coupled else ""
        summed = (line for sums in self.sums for line in sums.states())
        yield Block("State equations", (*map(self._line, shown), *summed), remark)
        algebraic = [row for row in self.rows.eliminated if row.kind == "algebraic"]
        standing = self._laws_in_states() if laws else ()
        yield Block("where", (*standing, *self._lines(algebraic)))
        dependent = [row for row in self.rows.eliminated if row.kind in ("speed", "torque")]
        yield Block("Eliminated quantities", tuple(self._explained(dependent)))

    def fields(self) -> Iterator[Block]:
        """Long shafts before they are divided.

        Raises:
            CompileError: there are none.
        """
        if not self.equations.fields:
            raise CompileError(f"'{self.equations.form.graph.name}' has no Shaft. Take form='state'.")
        for field in self.equations.fields:
            along, boundary, definitions = lines_of_field(field, values=self.values)
            yield Block(f"Along {field.part.name}", along)
            yield Block("At its ends", boundary)
            yield Block("Derived quantities", definitions)

    def summed_between(self, free: Collection[str]) -> tuple[Sums, ...]:
        """The shafts whose rows are printed as sums in Lagrange's equations: the nodes at both ends are free."""
        nodes = self.equations.form.graph.nodes
        return tuple(sums for sums in self.sums if {nodes[sums.part.nodes[end]] for end in ("a", "b")} <= set(free))

    @cached_property
    def writer(self) -> Writer:
        """Prints the expressions of this network."""
        names = {**self.equations.symbol_names, **self._auxiliary_names}
        graph = self.equations.form.graph
        weights = {name: latex for shaft in self.shafts for name, latex in printed_weights(shaft).items()}
        sums = [printed_sums(shaft, names) for shaft in self.shafts]
        names |= {name: latex for of_shaft in (weights, *sums) for name, latex in of_shaft.items()}
        parameters = {*(letter.name for letter in self.equations.letters if letter.parameter), *weights}
        order = sorted(names, key=lambda name: name not in parameters)
        ordered = with_rates({name: names[name] for name in order}, self.equations.notation.rate_of)
        values = self.equations.values if self.values else {}
        printed = {**ordered, **_dotted(self.equations)}
        angles = map(self.quantities.angle, range(len(graph.nodes)))
        rates = {name for name in printed if name.startswith("der(")}
        last = rates | {angle.name for angle in angles} | {name for of_shaft in sums for name in of_shaft}
        return Writer(printed, parameters, last, values, self.equations.inverses, self.tables.marked)

    def _line(self, row: Sides, remark: str = "") -> Line:
        return self.writer.line(in_sums(row, self.shafts), remark)

    def _lines(self, rows: Iterable[Row]) -> Iterator[Line]:
        seen: dict[str, None] = {}
        for row in rows:
            if not row.trivial:
                line = self._line(row.sides)
                if line.text not in seen:
                    yield line
                seen[line.text] = None

    def _explained(self, rows: Iterable[Eliminated]) -> Iterator[Line]:
        for row in rows:
            if not row.trivial:
                yield self._line(row.sides, rf"\text{{({_with_indices(row.why)})}}")

    def _laws(self) -> Iterator[Line]:
        quantities = self.quantities
        for row in self.rows.laws:
            if self._is_summed(row.branches[0]):
                continue
            flow = quantities.flow_of[row.branches[0]]
            if row.left == quantities.through(flow):
                yield from self.law(flow, {})
            elif not row.trivial:
                yield self.writer.line(self._by_inverse(row.sides))
        for summed in self.sums:
            yield from summed.laws()

    def _by_inverse(self, row: Sides) -> Sides:
        """The law of a store, with the reciprocal of its coefficient beside the rate where that has the letter."""
        term = row.groups[0].terms[0]
        for symbol, inverse in self.equations.inverses.items() if not self.values else ():
            if term.is_Mul and symbol in term.args:
                return sides(inverse * row.left, (term / symbol,))
        return row

    def _laws_in_states(self) -> Iterator[Line]:
        """Nonlinear laws and sources, in terms of the states."""
        assembly = self.rows.assembly
        flows = dict.fromkeys(assembly.quantities.flow_of[branch] for branch in sorted(assembly.lumped))
        for flow in flows:
            across = assembly.quantities.across((flow.plus, flow.minus))
            sign = -1 if across.could_extract_minus_sign() else 1
            around = sign * Add(*assembly.around(flow.branches[0]))
            yield from self.law(flow, {} if across == 0 else {sign * across: around})
        for source in self.equations.form.across_sources:
            prescribed = assembly.law_of_source(source)
            if self._stands(source) and prescribed.groups[0].terms != (prescribed.left,):
                yield self.writer.line(prescribed)
        for end, other in assembly.opposite.items():
            yield self.writer.line(assembly.law_of_history(end, Add(*assembly.around(other))))

    def _stands(self, source: int) -> bool:
        """Whether a prescribed across variable stands anywhere by its letter, and not by the sum that it is."""
        if not self.equations.assembly.is_sum(source):
            return True
        rows = (*self.rows.states, *self.rows.eliminated)
        letters = self.quantities.across(self.equations.assembly.ends(source)).free_symbols
        return any(not letters.isdisjoint(row.expression.free_symbols) for row in rows)

    def law(self, flow: ThroughQuantity, replaced: Mapping[Expr, Expr]) -> Iterator[Line]:
        """A flow's law, and the letters in it; nothing where the law is a parameter alone."""
        symbol = self.quantities.through(flow)
        shared, terms = self._split[flow]
        if terms != (symbol,):
            yield self.writer.line(sides(symbol, (term.xreplace(replaced) for term in terms)))
            for letter, expression in shared:
                yield self.writer.line(sides(letter, terms_of(expression.xreplace(replaced))))

    @cached_property
    def _split(self) -> dict[ThroughQuantity, tuple[tuple[tuple[Symbol, Expr], ...], tuple[Expr, ...]]]:
        """For each flow the letters in its law and the terms that contain them."""
        assembly = self.rows.assembly
        split = {}
        for number, flow in enumerate(assembly.quantities.flows):
            if any(assembly.kind(branch) is Kind.ACROSS_SOURCE for branch in flow.branches):
                continue
            ((_, terms),) = assembly.law_of_flow(flow).groups
            split[flow] = _shared_sums(terms, f"flow {number}")
        return split

    @cached_property
    def _auxiliary_names(self) -> dict[str, str]:
        taken = {*self.equations.symbol_names.values()}  # only asked for membership
        names: dict[str, str] = {}
        for flow, (shared, _) in self._split.items():
            through = self.equations.symbol_names[self.quantities.through(flow).name]
            subscript = re.sub(r"^[^_]*", "", through)
            free = iter(letter + subscript for letter in AUXILIARY if letter + subscript not in taken)
            names.update({symbol.name: next(free) for symbol, _ in shared})
        return names


def _without_rate(name: str) -> str:
    """The name of a quantity by that of its rate or of the rate of that."""
    while name.startswith("der("):
        name = name[4:-1]
    return name


def _rates_in(left: Expr) -> int:
    names = (str(symbol.name) for symbol in left.free_symbols)
    return sum(name.startswith("der(") and name.endswith(")") for name in names)


def _to_rounding(expression: Expr) -> Expr:
    """An expression to compare with others that were added up in another order."""
    return expression.xreplace({number: Float(number, 12) for number in expression.atoms(Float)})


def _shared_sums(terms: tuple[Expr, ...], owner: str) -> tuple[tuple[tuple[Symbol, Expr], ...], tuple[Expr, ...]]:
    """Sums of a law under symbols of their own, and the law with these symbols: long ones that occur several times, and
    those that alone, as factors, are longer than a line.
    """
    nodes = [node for term in terms for node in preorder_traversal(term)]
    counted = Counter(node for node in nodes if node.is_Add)
    factors = {node for product in nodes if product.is_Mul for node in product.args}  # only asked for membership
    # a sum of fewer operations is not worth a letter; a factor of so many terms can only be broken standing alone
    candidates = [
        node
        for node, times in counted.items()
        if node not in terms and (node in factors and len(node.args) >= 6 if times == 1 else node.count_ops() >= 3)
    ]
    shared: list[tuple[Symbol, Expr]] = []
    for node in candidates[: len(AUXILIARY) - 1]:
        letter = Symbol(f"{owner}, sum {len(shared) + 1}", real=True)
        if sum(term.has(node) for term in terms):
            terms = tuple(term.xreplace({node: letter}) for term in terms)
            shared.append((letter, node))
    return tuple(shared), terms


def _dotted(equations: Equations) -> dict[str, str]:
    """Rates of angles and positions with dots, as the second-order form has them."""
    quantities, names = equations.assembly.quantities, equations.symbol_names
    dotted: dict[str, str] = {}
    for angle in map(quantities.angle, range(len(equations.form.graph.nodes))):
        letter, underscore, subscript = names[angle.name].partition("_")
        velocity = rate_of(angle)
        dotted[velocity.name] = rf"\dot{{{letter}}}{underscore}{subscript}"
        dotted[rate_of(velocity).name] = rf"\ddot{{{letter}}}{underscore}{subscript}"
    return dotted


def _with_indices(sentence: str) -> str:
    """A sentence for a remark, in which the numbers of parts are indices as in formulas, so that a series stays one."""
    words = (re.fullmatch(r"([A-Za-z]+)([0-9]+)", word) or word for word in sentence.split(" "))
    return " ".join(
        in_text(word) if isinstance(word, str) else f"{word[1]}$_{{{INDEX_OPENS}{word[2]}{INDEX_CLOSES}}}$"
        for word in words
    )
