"""What is printed of the equations, and in which order: blocks of lines under headings."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import zip_longest
from typing import TYPE_CHECKING

from sympy import Add, Expr, Float, Integer, Symbol, preorder_traversal

from shaftwork.core.domains import ELECTRICAL, ROTATION, TRANSLATION
from shaftwork.core.errors import CompileError
from shaftwork.equations.assembly import FactoredTerms, Sides, sides, terms_of, tidy
from shaftwork.equations.notations import in_letters
from shaftwork.equations.quantities import ThroughQuantity, rate_of
from shaftwork.equations.second_order import SecondOrder
from shaftwork.equations.spelling import INDEX_CLOSES, INDEX_OPENS, in_text
from shaftwork.latex.printing import LINE_WIDTH, Line, Writer, printed_width, with_rates
from shaftwork.latex.shaft_blocks import MEANING, WEIGHTS, Sums, lines_of_field, sums_of
from shaftwork.network.kinds import Kind

if TYPE_CHECKING:
    from shaftwork.equations.kirchhoff import Eliminated, Row, StateEquation
    from shaftwork.equations.records import Equations

AUXILIARY = (r"\sigma", r"\zeta", r"\xi", r"\chi")
"""Letters for sums that occur more than once in a law, such as a slip."""
BALANCES = {ROTATION: "torques", TRANSLATION: "forces", ELECTRICAL: "currents"}


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
        equations = self.equations
        domains = dict.fromkeys(equations.form.graph.domains)
        balanced = " and ".join(", ".join(BALANCES[domain] for domain in domains).rsplit(", ", 1))
        nodes = [row for number, row in enumerate(equations.nodes) if number not in self.inside]
        balances = (summed.balance() for summed in self.sums)
        yield Block(f"Balance of {balanced} at the nodes", (*self._lines(nodes), *balances))
        loops = [row for row in equations.loops if equations.assembly.ends(row.link)[0] not in self.twists]
        rates = (line for summed in self.sums for line in summed.loops())
        yield Block("Speeds around the loops", (*self._lines(loops), *rates))
        around = {_to_rounding(row.expression) for row in equations.loops}  # only asked for membership
        said = [(_to_rounding(row.expression), _to_rounding(-row.expression)) for row in equations.couplings]
        couplings = [row for row, both in zip(equations.couplings, said, strict=True) if around.isdisjoint(both)]
        lossy = any(branch.template.through for branch in equations.form.graph.branches)
        yield Block("Couplings" if lossy else "Ideal couplings", tuple(self._lines(couplings)))
        integrals = [row for row in equations.states if row.name in self._integrals] if twists else []
        yield Block("Laws of the parts", (*self._laws(), *self._lines(integrals)))

    @cached_property
    def _integrals(self) -> frozenset[str]:
        return frozenset(state.name for state in self.equations.form.states if state.kind == "integral")

    def derived(self) -> Block:
        """The definitions of the letters that stand for several parameters; nothing where numbers are printed."""
        definitions = {} if self.values else self.equations.definitions
        pairs = in_letters(definitions, self.equations.inverses)
        weights = (WEIGHTS,) if self.sums else ()
        return Block(
            "Derived quantities",
            (*(self.writer.line(sides(symbol, (law,))) for symbol, law in pairs), *weights),
            MEANING if weights else "",
        )

    @cached_property
    def sums(self) -> tuple[Sums, ...]:
        """The shafts whose rows are printed as sums."""
        return sums_of(self.equations.assembly.quantities, self.writer)

    @cached_property
    def inside(self) -> frozenset[int]:
        """The nodes between the ends of these shafts."""
        return frozenset(node for summed in self.sums for node in summed.inside)

    @cached_property
    def twists(self) -> frozenset[int]:
        """The nodes whose speeds are rates of twist of these shafts."""
        return frozenset(node for summed in self.sums for node in summed.twists)

    def _is_summed(self, row: StateEquation) -> bool:
        return self.equations.assembly.ends(row.branches[0])[0] in self.inside | self.twists

    def state(self, *, laws: bool = True) -> Iterator[Block]:
        """Rates of the states, what stands in them, and what was eliminated.

        Args:
            laws: print the laws that stand in the rates; not needed below Kirchhoff's equations, which contain them.
        """
        rows = [row for row in self.equations.states if not self._is_summed(row)]
        shown = [row.sides if row.explicit and _rates_in(row.coupled.left) <= 1 else row.coupled for row in rows]
        coupled = any(shape is not row.sides for shape, row in zip(shown, rows, strict=True))
        remark = "Rates that stand together on a left side are coupled by inertias or springs." if coupled else ""
        summed = (line for sums in self.sums for line in sums.states())
        yield Block("State equations", (*map(self.writer.line, shown), *summed), remark)
        algebraic = [row for row in self.equations.eliminated if row.kind == "algebraic"]
        standing = self._laws_in_states() if laws else ()
        yield Block("where", (*standing, *self._lines(algebraic)))
        dependent = [row for row in self.equations.eliminated if row.kind in ("speed", "torque")]
        yield Block("Eliminated quantities", tuple(self._explained(dependent)))

    def second_order(self) -> Iterator[Block]:
        """M phi'' + D phi' + K phi = T: as matrices where they fit on a page, else row by row."""
        form = self.equations.second_order
        size = len(form.coordinates)
        # The matrices of more than six coordinates are wider than a page.
        lines = tuple(self._matrices(form)) if size <= 6 else ()
        if not lines or max(map(_matrix_width, lines)) > LINE_WIDTH:
            lines = tuple(self._motions(form))
        yield Block("Equations of motion", lines)
        flows = self.equations.assembly.quantities.flows
        by_symbol = [flow for flow in flows if self.equations.assembly.quantities.through(flow) in form.laws]
        laws = [line for flow in by_symbol for line in self.law(flow, form.at.motion)]
        assembly = self.equations.assembly
        for end, other in assembly.opposite.items():
            across = assembly.quantities.across(assembly.ends(other)).xreplace(form.at.motion)
            laws.append(self.writer.line(assembly.law_of_history(end, across)))
        yield Block("where", tuple(laws), r"Angles are counted from the untwisted position.")

    def fields(self) -> Iterator[Block]:
        """Long shafts before they are divided.

        Raises:
            CompileError: there are none.
        """
        if not self.equations.fields:
            raise CompileError(f"'{self.equations.form.graph.name}' has no Shaft. Take form='state'.")
        for field in self.equations.fields:
            along, boundary, definitions = lines_of_field(field, values=self.values)
            yield Block(f"Along {in_text(field.part.name)}", along)
            yield Block("At its ends", boundary)
            yield Block("Derived quantities", definitions)

    def _matrices(self, form: SecondOrder) -> Iterator[Line]:
        yield Line(
            r"\mathbf{M} \, \ddot{\mathbf{q}} + \mathbf{D} \, \dot{\mathbf{q}} + \mathbf{K} \, \mathbf{q}",
            (r"\mathbf{T}",),
        )
        size = range(len(form.coordinates))
        transposed = " & ".join(map(self.writer.latex, form.coordinates))
        yield Line(r"\mathbf{q}", (rf"\begin{{bmatrix}} {transposed} \end{{bmatrix}}^{{\mathsf{{T}}}}",))
        for name, entries in (("M", form.mass), ("D", form.damping), ("K", form.stiffness)):
            rows = ([entries.get((i, j), Integer(0)) for j in size] for i in size)
            yield Line(rf"\mathbf{{{name}}}", (self._matrix(rows),))
        yield Line(r"\mathbf{T}", (self._matrix([force] for force in form.forces),))

    def _matrix(self, rows: Iterable[Iterable[Expr]]) -> str:
        inner = r" \\ ".join(" & ".join(self.writer.latex(tidy(entry)) for entry in row) for row in rows)
        return rf"\begin{{bmatrix}} {inner} \end{{bmatrix}}"

    def _motions(self, form: SecondOrder) -> Iterator[Line]:
        """Row by row; shafts whose ends are coordinates have one row for all inside."""
        nodes, summed = self.equations.form.graph.nodes, self.summed_between(form.nodes)
        inside = {nodes[node] for sums in summed for node in sums.inside}
        yield from (self._motion(form, row) for row, node in enumerate(form.nodes) if node not in inside)
        for sums in summed:
            yield from sums.motion()

    def summed_between(self, free: Collection[str]) -> tuple[Sums, ...]:
        """The shafts whose rows are printed as sums in the equations of motion: the nodes at both ends are free."""
        nodes = self.equations.form.graph.nodes
        return tuple(sums for sums in self.sums if {nodes[sums.part.nodes[end]] for end in ("a", "b")} <= set(free))

    def _motion(self, form: SecondOrder, row: int) -> Line:
        left = self.writer.pieces((FactoredTerms(Integer(1), tuple(map(tidy, form.terms(row)))),))
        force = form.forces[row]
        right = self.writer.pieces(sides(Integer(0), terms_of(force)).groups) or ("0",)
        return Line("", (*left, f"= {right[0]}", *right[1:]), relation="")

    @cached_property
    def writer(self) -> Writer:
        """Prints the expressions of this network."""
        names = {**self.equations.symbol_names, **self._auxiliary_names}
        graph = self.equations.form.graph
        parameters = {letter.name for letter in self.equations.letters if letter.parameter}
        order = sorted(names, key=lambda name: name not in parameters)
        ordered = with_rates({name: names[name] for name in order}, self.equations.notation.rate_of)
        values = self.equations.values if self.values else {}
        printed = {**ordered, **_dotted(self.equations)}
        angles = map(self.equations.assembly.quantities.angle, range(len(graph.nodes)))
        last = {name for name in printed if name.startswith("der(")} | {angle.name for angle in angles}
        return Writer(printed, parameters, last, values, self.equations.inverses)

    def _lines(self, rows: Iterable[Row]) -> Iterator[Line]:
        seen: dict[str, None] = {}
        for row in rows:
            if not row.trivial:
                line = self.writer.line(row.sides)
                if line.text not in seen:
                    yield line
                seen[line.text] = None

    def _explained(self, rows: Iterable[Eliminated]) -> Iterator[Line]:
        for row in rows:
            if not row.trivial:
                yield self.writer.line(row.sides, rf"\text{{({_with_indices(row.why)})}}")

    def _laws(self) -> Iterator[Line]:
        for row in self.equations.laws:
            flow = self.equations.assembly.quantities.flow_of[row.branches[0]]
            if row.left == self.equations.assembly.quantities.through(flow):
                yield from self.law(flow, {})
            elif not row.trivial:
                yield self.writer.line(self._by_inverse(row.sides))

    def _by_inverse(self, row: Sides) -> Sides:
        """The law of a store, with the reciprocal of its coefficient beside the rate where that has the letter."""
        term = row.groups[0].terms[0]
        for symbol, inverse in self.equations.inverses.items() if not self.values else ():
            if term.is_Mul and symbol in term.args:
                return sides(inverse * row.left, (term / symbol,))
        return row

    def _laws_in_states(self) -> Iterator[Line]:
        """Nonlinear laws and sources, in terms of the states."""
        assembly = self.equations.assembly
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
        rows = (*self.equations.states, *self.equations.eliminated)
        letters = self.equations.assembly.quantities.across(self.equations.assembly.ends(source)).free_symbols
        return any(not letters.isdisjoint(row.expression.free_symbols) for row in rows)

    def law(self, flow: ThroughQuantity, replaced: Mapping[Expr, Expr]) -> Iterator[Line]:
        """A flow's law, and the letters in it; nothing where the law is a parameter alone."""
        symbol = self.equations.assembly.quantities.through(flow)
        shared, terms = self._split[flow]
        if terms != (symbol,):
            yield self.writer.line(sides(symbol, (term.xreplace(replaced) for term in terms)))
            for letter, expression in shared:
                yield self.writer.line(sides(letter, terms_of(expression.xreplace(replaced))))

    @cached_property
    def _split(self) -> dict[ThroughQuantity, tuple[tuple[tuple[Symbol, Expr], ...], tuple[Expr, ...]]]:
        """For each flow the letters in its law and the terms that contain them."""
        assembly = self.equations.assembly
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
            through = self.equations.symbol_names[self.equations.assembly.quantities.through(flow).name]
            subscript = re.sub(r"^[^_]*", "", through)
            free = iter(letter + subscript for letter in AUXILIARY if letter + subscript not in taken)
            names.update({symbol.name: next(free) for symbol, _ in shared})
        return names


def _rates_in(left: Expr) -> int:
    names = (str(symbol.name) for symbol in left.free_symbols)
    return sum(name.startswith("der(") and name.endswith(")") for name in names)


def _to_rounding(expression: Expr) -> Expr:
    """An expression to compare with others that were added up in another order."""
    return expression.xreplace({number: Float(number, 12) for number in expression.atoms(Float)})


def _shared_sums(terms: tuple[Expr, ...], owner: str) -> tuple[tuple[tuple[Symbol, Expr], ...], tuple[Expr, ...]]:
    """Long sums that occur several times in a law, under symbols of their own, and the law with these symbols."""
    counted = Counter(node for term in terms for node in preorder_traversal(term) if node.is_Add)
    # a sum of fewer operations is not worth a letter
    candidates = [node for node, times in counted.items() if times > 1 and node.count_ops() >= 3]
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


def _matrix_width(line: Line) -> float:
    """Width of a matrix: that of its columns, and the room between them."""
    rows = (row.split("&") for row in line.pieces[0].split(r"\\"))
    columns = list(zip_longest(*rows, fillvalue=""))
    return sum(max(map(printed_width, column)) for column in columns) + 1.8 * (len(columns) - 1) + 2.0


def _with_indices(sentence: str) -> str:
    """A sentence for a remark, in which the numbers of parts are indices as in formulas, so that a series stays one."""
    words = (re.fullmatch(r"([A-Za-z]+)([0-9]+)", word) or word for word in sentence.split(" "))
    return " ".join(
        in_text(word) if isinstance(word, str) else f"{word[1]}$_{{{INDEX_OPENS}{word[2]}{INDEX_CLOSES}}}$"
        for word in words
    )
