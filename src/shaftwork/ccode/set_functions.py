"""The functions of one set of equations in C: rates, slopes, outputs, what is stored, states from it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from sympy import Add, Expr, Float, Integer, Symbol

from shaftwork.ccode.c_printing import TERM, Statements, array, function
from shaftwork.ccode.c_texts import signature
from shaftwork.ccode.equation_set import EquationSet
from shaftwork.codegen.state_transfer import StateTransfer
from shaftwork.components.law_slopes import slope
from shaftwork.components.laws import as_expression
from shaftwork.components.laws import t as TIME
from shaftwork.formulation.form import store_name
from shaftwork.formulation.gains import exact_of
from shaftwork.formulation.tree import Row
from shaftwork.network.kinds import Kind

LATER = Symbol("later", real=True)
"""The time behind an instant, at which what is asked of sampled controllers has jumped."""


@dataclass(frozen=True)
class ArrayLayout:
    """What stands in which place of the arrays of the C code.

    Args:
        states: names of the states of all sets of equations.
        stores: names of everything that is stored.
        outputs: names of the outputs.
        statements: writes expressions.
    """

    states: tuple[str, ...]
    stores: tuple[str, ...]
    outputs: tuple[str, ...]
    statements: Statements


class SetFunctions:
    """What the functions compute in one set of equations.

    Args:
        equations: the set.
        layout: of all sets.
    """

    def __init__(self, equations: EquationSet, layout: ArrayLayout) -> None:
        self.layout = layout
        self.form, self.rows, self.observables = equations.form, equations.rows, equations.observables
        self.places = [layout.states.index(state.name) for state in self.form.states]
        """Where its states are among those of all sets."""

    @property
    def ties(self) -> bool:
        """Whether inertias among the states carry others."""
        return bool(self.form.dependent_across and self.form.across_states)

    @property
    def _slack(self) -> bool:
        """Whether springs among the states carry others."""
        return bool(self.form.dependent_through and self.form.through_states)

    @cached_property
    def assignments(self) -> Mapping[str, Mapping[str, Expr]]:
        """By the name of a function what it assigns, target to expression."""
        outputs = {f"y[{k}]": self.observables.quantity(name) for k, name in enumerate(self.layout.outputs)}
        stored = {f"stored[{k}]": self.observables.store(name) for k, name in enumerate(self.layout.stores)}
        moving = {"rates": self._rates(), "jacobian": self._jacobian()}
        return {**moving, "outputs": outputs, "stores": stored, "masses": self._masses(), "loads": dict(self._loads())}

    def assigned(self, targets: Sequence[str], expressions: Sequence[Expr]) -> Iterator[str]:
        """Lines that assign expressions to targets."""
        return self.layout.statements.assigned(targets, expressions)

    def _rates(self) -> Mapping[str, Expr]:
        """The rates of the states, and of what is stored and no state here: all have some in all modes."""
        rates = {f"dx[{place}]": rate for place, rate in zip(self.places, self.rows.rates, strict=True)}
        branches = StateTransfer(self.form).branches
        others = {name: k for k, name in enumerate(self.layout.states) if k not in self.places and name in branches}
        return rates | {f"dx[{k}]": self._store_rate(branches[name]) for name, k in others.items()}

    def _store_rate(self, number: int) -> Expr:
        """The rate of the speed of an inertia, or of the torque of a spring, that follows others."""
        branch, law = self.form.graph.branches[number], self.form.law_of(number)
        if branch.template.kind is Kind.ACROSS_STORE:
            return self.observables.through(number) / law
        part, (first, second) = self.form.graph.parts[branch.part], branch.template.ends
        return law * (self.observables.across(part, first) - self.observables.across(part, second))

    def _jacobian(self) -> Mapping[str, Expr]:
        size, states = len(self.layout.states), list(zip(self.places, self.rows.states, strict=True))
        return {
            f"slopes[{row * size + column}]": slope(rate, state)
            for row, rate in zip(self.places, self.rows.rates, strict=True)
            for symbols in [rate.free_symbols]
            for column, state in states
            if state in symbols
        }

    def _masses(self) -> Mapping[str, Expr]:
        """C + Q K F': the inertias of the states with all that turns with them, an array (n, n) of zeros before."""
        form, n = self.form, len(self.form.across_states)
        entries = {(k, k): form.law_of(branch) for k, branch in enumerate(form.across_states)}
        for link in form.dependent_across:
            loop, cutset = self._row(form.tree.loops, link), self._row(form.tree.cutsets, link)
            for (first, share), (second, gain) in ((one, other) for one in cutset for other in loop):
                at = form.across_states.index(first), form.across_states.index(second)
                entries[at] = entries.get(at, Integer(0)) + share * form.law_of(link) * gain
        return {f"mass[{row * n + column}]": entry for (row, column), entry in entries.items()}

    def _row(self, rows: Mapping[int, Row], link: int) -> list[tuple[int, Expr]]:
        """Gains of states of speed in the loop or the cutset of a link."""
        row = {tree: gain for tree, gain in rows[link].items() if tree in self.form.across_states}
        return list(zip(row, exact_of(row.values()), strict=True))

    def solved(self) -> tuple[str, ...]:
        """Lines that find the states that tie others, closest to what was stored: see `codegen.state_transfer`."""
        lines = ["masses(m, t, stored, mass);", "loads(m, t, stored, right);"] if self.ties else []
        lines += [f"solve({len(self.form.across_states)}, mass, 1, right);"] if self.ties else []
        return (*lines, *(self._torques_taken_up() if self._slack else ()))

    def taken(self) -> Iterator[str]:
        """Lines that put these states in their places, and all others as they were stored."""
        if self.ties:
            yield from (f"x[{place}] = right[{k}];" for k, place in enumerate(self.places[self.form.speeds]))
        tied = {"across": self.ties, "through": self._slack, "integral": False}
        pairs = zip(self.places, self.form.states, strict=True)
        free = {f"x[{place}]": stored_symbol(state.name) for place, state in pairs if not tied[state.kind]}
        yield from self.assigned([*free], [*free.values()])

    def samples(self) -> Iterator[tuple[str, ...]]:
        """By sampled controller, lines with what it holds after an instant: see `components.sampling`."""
        graph = self.form.graph
        for part in graph.parts:
            if (sampler := part.component.sampler()) is None:
                continue
            names = {key: f"{part.name}.{key}" for key in ("reference", "sample_time")}
            values = {"reference": as_expression(sampler.reference), "sample_time": Float(sampler.period)}
            reference, period = (
                Symbol(name, real=True) if name in graph.parameters else values[key] for key, name in names.items()
            )
            e = [point - self._measured(name) for point, name in zip(sampler.setpoints, sampler.measured, strict=True)]
            e[0] += reference.xreplace({TIME: LATER})
            x = [Symbol(f"{part.name}.x_{k + 1}", real=True) for k in range(len(sampler.A))]
            steps = {f"{part.name}.x_u_{k + 1}": row for k, row in enumerate(np.hstack((sampler.C, sampler.D)))}
            steps |= {symbol.name: row for symbol, row in zip(x, np.hstack((sampler.A, sampler.B)), strict=True)}
            targets = [f"after[{self.layout.states.index(name)}]" for name in steps]
            sums = [
                Add(*(float(gain) * one for gain, one in zip(row, [*x, *e], strict=True))) for row in steps.values()
            ]
            due = self.assigned(["const double period"], [period])
            yield ("{", *due, "if (is_due(m->t, period)) {", *self.assigned(targets, sums), "}", "}")

    def _measured(self, name: str) -> Expr:
        quantity = self.observables.quantity(name)
        return self.observables.store(name) if quantity is None else quantity

    def _loads(self) -> Iterator[tuple[str, Expr]]:
        """(C + Q K F') x = C v + Q K (v_K - F_E' e): the right-hand side."""
        form = self.form
        right = {k: form.law_of(k) * self._stored(k) for k in form.across_states}
        for link in form.dependent_across:
            row = form.tree.loops[link]
            pairs = zip(row, exact_of(row.values()), strict=True)
            prescribed = Add(*(gain * self.rows.across[tree] for tree, gain in pairs if tree in form.across_inputs))
            for tree, share in self._row(form.tree.cutsets, link):
                right[tree] += share * form.law_of(link) * (self._stored(link) - prescribed)
        yield from ((f"right[{k}]", momentum) for k, momentum in enumerate(right.values()))

    def _torques_taken_up(self) -> Iterator[str]:
        """(1 / L + F' Q / S) x = i / L - F' (i_S + Q_SW w) / S."""
        form, n = self.form, len(self.form.through_states)
        number = {branch: k for k, branch in enumerate(form.through_states)}
        entries = {(k, k): 1 / form.law_of(branch) for branch, k in number.items()}
        right = {k: self._stored(branch) / form.law_of(branch) for branch, k in number.items()}
        for tree in form.dependent_through:
            shares = {link: row[tree] for link, row in form.tree.cutsets.items() if tree in row}
            cutset = list(zip(shares, exact_of(shares.values()), strict=True))
            gains = {link: form.tree.loops[link][tree] for link in number if tree in form.tree.loops[link]}
            given = Add(*(share * self._given(link) for link, share in cutset if link not in number))
            for link, gain in zip(gains, exact_of(gains.values()), strict=True):
                right[number[link]] -= gain * (self._stored(tree) + given) / form.law_of(tree)
                for other, share in cutset:
                    if other in number:
                        at = number[link], number[other]
                        entries[at] = entries.get(at, Integer(0)) + gain * share / form.law_of(tree)
        yield f"double slack[{n * n}] = {{0.0}}, twist[{n}];"
        yield from self._block([f"slack[{row * n + column}]" for row, column in entries], [*entries.values()])
        yield from self._block([f"twist[{k}]" for k in range(n)], [*right.values()])
        yield f"solve({n}, slack, 1, twist);"
        yield from (f"x[{place}] = twist[{k}];" for k, place in enumerate(self.places[form.torques]))

    def _block(self, targets: Sequence[str], expressions: Sequence[Expr]) -> Iterator[str]:
        """Assignments with names of their own."""
        yield "{"
        yield from (f"    {line}" for line in self.assigned(targets, expressions))
        yield "}"

    def _given(self, link: int) -> Expr:
        """What a source gives by the time alone; what follows from the states gives nothing at once."""
        through = self.rows.through.get(link, Integer(0))
        return Integer(0) if through.free_symbols & {*self.rows.states} else through

    def _stored(self, branch: int) -> Expr:
        return stored_symbol(store_name(self.form.graph, self.form.graph.branches[branch]))


def function_of_sets(name: str, sets: Sequence[Mapping[str, Expr]], statements: Statements) -> str:
    """The function of all sets of equations: each row and each term once, in a block for the sets that need it.

    A term is read in sets that need it alone: blocks of more sets come first.

    Args:
        name: of the function, as in `c_texts.ARGUMENTS`.
        sets: what each of them assigns, target to expression.
        statements: writes expressions.
    """
    rows: dict[tuple[str, Expr], int] = {}  # to the sets that need it, as bits of a number
    for number, one in enumerate(sets):
        for row in one.items():
            rows[row] = rows.get(row, 0) | 1 << number
    code = statements.code_of([expression for _, expression in rows])
    lines = [(target, value, need) for ((target, _), need), value in zip(rows.items(), code.values, strict=True)]
    needs = dict.fromkeys((*code.systems, *code.terms), 0)
    for _, value, need in lines:
        needs |= {term: needs[term] | need for term in TERM.findall(value)}
    for reader, value in reversed(code.terms.items()):
        needs |= {term: needs[term] | needs[reader] for term in TERM.findall(value)}
    for reader, text in reversed(code.systems.items()):  # which have terms of their own
        needs |= {term: needs[term] | needs[reader] for term in TERM.findall("".join(text)) if term in code.systems}
    lines = [*((term, value, needs[term]) for term, value in code.terms.items()), *lines]
    always = (1 << len(sets)) - 1
    reads = ((term, need) for _, value, need in lines for term in TERM.findall(value) if term in code.terms)
    crossing = dict.fromkeys(term for term, need in reads if needs[term] not in (need, always))
    together: dict[int, list[str]] = {}
    for target, value, need in lines:
        head = "const double " if target in needs and target not in crossing else ""
        together.setdefault(need, []).append(f"{head}{target} = {value};")
    blocks: list[tuple[int, Sequence[str]]] = []
    for vector, (declaration, *solved) in code.systems.items():
        blocks += [(always, [declaration]), (needs[vector], solved)]
    blocks.append((always, [f"double {term} = 0.0;" for term in crossing]))
    return _in_blocks(name, blocks + sorted(together.items(), key=lambda block: -block[0].bit_count()), len(sets))


def _in_blocks(name: str, blocks: Sequence[tuple[int, Sequence[str]]], count: int) -> str:
    """A function of blocks, of which each stands beside the sets that need it, all or some, as bits of a number."""
    some = [*dict.fromkeys(need for need, _ in blocks if need != (1 << count) - 1)]
    size, table = 32, f"BLOCKS_OF_{name.upper()}"  # bits of a number
    words = -(-len(some) // size)
    lines = [f"const uint32_t *const needs = {table} + {words} * m->set;"] if some else []
    for need, block in blocks:
        if need in some:
            word, bit = divmod(some.index(need), size)
            lines += [f"if ((needs[{word}] >> {bit} & 1u) != 0u) {{", *(f"    {line}" for line in block), "}"]
        else:
            lines += block
    text = function(signature(name), lines)
    if not some:
        return text
    members = [sum((need >> number & 1) << k for k, need in enumerate(some)) for number in range(count)]
    bits = [f"0x{member >> size * word & (1 << size) - 1:x}u" for member in members for word in range(words)]
    comment = f"/* Of each set of equations the blocks of `{name}` that it needs, as bits. */\n"
    return f"{comment}{array('const uint32_t', table, bits)}\n{text}"


def take_up_of_sets(sets: Sequence[SetFunctions]) -> str:
    """The function `take_up` of all sets of equations."""
    solved, taken = dict[tuple[str, ...], int](), dict[str, int]()
    for number, one in enumerate(sets):
        solved[one.solved()] = solved.get(one.solved(), 0) | 1 << number
        for line in one.taken():
            taken[line] = taken.get(line, 0) | 1 << number
    always = (1 << len(sets)) - 1
    blocks: list[tuple[int, Sequence[str]]] = [(need, lines) for lines, need in solved.items() if lines]
    blocks += [
        (need, [line for line, other in taken.items() if other == need]) for need in dict.fromkeys(taken.values())
    ]
    if any(one.ties for one in sets):
        blocks.insert(0, (always, ["double mass[NX * NX] = {0.0}, right[NX] = {0.0};"]))
    return _in_blocks("take_up", blocks, len(sets))


def samples_of_sets(sets: Sequence[SetFunctions]) -> str:
    """The function `samples` of all sets of equations."""
    needs = dict[tuple[str, ...], int]()
    for number, one in enumerate(sets):
        for lines in one.samples():
            needs[lines] = needs.get(lines, 0) | 1 << number
    return _in_blocks("samples", [(need, lines) for lines, need in needs.items()], len(sets))


def stored_symbol(name: str) -> Symbol:
    """What stands for something stored before an event, by its name."""
    return Symbol(f"stored {name}", real=True)
