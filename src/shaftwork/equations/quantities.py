"""Which sympy symbol stands for which quantity of a network: node speeds, speeds across parts, torques, angles.

Symbols carry the names under which results are read ("J1.omega", "shaft.tau"), so that an equation and a signal that
share a name share a sign: the torque of a source is the one that it gives to its node, that of a spring goes from its
node a to its node b.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from sympy import Expr, Integer, Symbol

from shaftwork.components.branches import INTEGRAL, RATE, End
from shaftwork.core.domains import ELECTRICAL, Domain, Quantity
from shaftwork.core.errors import CompileError
from shaftwork.formulation.form import branch_name, integral_name
from shaftwork.network.graph import GROUND, CircuitGraph, GraphBranch, GraphPart, readings_of
from shaftwork.network.kinds import Kind

Ends = tuple[int, int]
INSTEAD = " Take form='state'."
"""How an error about the second-order form ends; a document, which has the state form, leaves it out."""


def running_number(label: str) -> str:
    """The number at the end of a branch's label, "3" of "tau_c_3", or nothing."""
    head, _, number = label.rpartition("_")
    return number if head and number.isdecimal() else ""


def rate_of(symbol: Symbol) -> Symbol:
    """The symbol of a quantity's time derivative."""
    return Symbol(f"der({symbol.name})", real=True)


def is_rate(symbol: Symbol) -> bool:
    """Whether a symbol stands for a derivative by time."""
    return str(symbol.name).startswith("der(")


def refuse_controlled(graph: CircuitGraph) -> None:
    """Refuse laws that read others of their part, and couplings that lose power, where positions are all that there is.

    Raises:
        CompileError: there is one.
    """
    for branch in graph.branches:
        if branch.template.through:
            part = graph.parts[branch.part].name
            raise CompileError(f"'{part}' loses a part of the torque that it passes on.{INSTEAD}")
        if branch.template.reads:
            part = graph.parts[branch.part].name
            raise CompileError(f"A law of '{part}' reads other quantities than its own speed.{INSTEAD}")


@dataclass(frozen=True, eq=False)
class ThroughQuantity:
    """What a part lets through between two nodes: its parallel branches together, under one symbol.

    Args:
        part: place of the part in the part table.
        branches: the branches, all from `plus` to `minus`; what prescribes an across variable stands alone.
        plus: number of the node that gives.
        minus: number of the node that takes.
        sign: 1 where the symbol is what `plus` gives, -1 where it is what `plus` receives (sources).
        label: tells the flows of a part apart; empty where it has only one.
    """

    part: int
    branches: tuple[int, ...]
    plus: int
    minus: int
    sign: int
    label: str


@dataclass(frozen=True, eq=False)
class Pair:
    """The across variable between two nodes, named after the first part that joins them.

    Args:
        part: place of the part in the part table.
        symbol: the across variable.
        label: tells the pairs of a part apart; empty where it has only one.
    """

    part: int
    symbol: Symbol
    label: str


@dataclass(frozen=True, eq=False)
class Quantities:
    """The symbols of a network's quantities, made when first asked for.

    Args:
        graph: the circuit graph.
        laws: coefficients by their branches that are written otherwise than their parts have them.
    """

    graph: CircuitGraph
    laws: Mapping[int, Expr] = field(default_factory=dict)

    @cached_property
    def flows(self) -> tuple[ThroughQuantity, ...]:
        """Every flow of every part, in the order of the parts."""
        return tuple(flow for number in range(len(self.graph.parts)) for flow in self._flows_of(number))

    @cached_property
    def flow_of(self) -> dict[int, ThroughQuantity]:
        """The flow that a branch belongs to; across stores and couplings belong to none."""
        return {branch: flow for flow in self.flows for branch in flow.branches}

    def domain(self, ends: Ends) -> Domain:
        """The domain of a pair of nodes."""
        return self.graph.domains[max(ends)]

    def law(self, branch: int) -> Expr:
        """Coefficient or law of a branch in the parameters and derived quantities of the network."""
        template = self.graph.branches[branch].template
        if template.kind is Kind.ACROSS_STORE and template.printed.has(INTEGRAL):
            return self.printed(branch).xreplace({INTEGRAL: self.integral(self.graph.change_of(branch))})
        return self.history(branch) if template.is_history else self.printed(branch)

    def printed(self, branch: int) -> Expr:
        """The same; of a wave that arrives, what left the other end."""
        read = {"across": self.node, "through": self.carried, "integral": self.integral, "rate": self.rate}
        others = readings_of(self.graph, branch).items()
        return self.own_law(branch).xreplace({symbol: read[reading.kind](reading.of) for symbol, reading in others})

    def own_law(self, branch: int) -> Expr:
        """A law in parameters and derived quantities of the network, but not in what it reads of others."""
        if branch in self.laws:
            return self.laws[branch]
        record = self.graph.branches[branch]
        law: Expr = record.template.printed.xreplace(self._of_network[record.part])
        return law

    @cached_property
    def _of_network(self) -> tuple[dict[Symbol, Symbol], ...]:
        """For each part its own symbols of parameters and derived quantities, and those of the network."""
        names = [(part, (*part.parameters, *(derived.name for derived in part.derived))) for part in self.graph.parts]
        return tuple({Symbol(k, real=True): self.graph.symbol_of(part, k) for k in of_part} for part, of_part in names)

    def history(self, branch: int) -> Symbol:
        """What arrives at an end of a line."""
        return Symbol(f"{self.graph.part_of(branch).name}.{self.graph.branches[branch].template.label}", real=True)

    def node(self, number: int) -> Expr:
        """The across variable of a node: that of the store or source which joins it to the reference, else its own."""
        return Integer(0) if number == GROUND else self._nodes[number]

    def across(self, ends: Ends) -> Expr:
        """The across variable between two nodes."""
        plus, minus = ends
        if ends in self.pairs:
            return self.pairs[ends].symbol
        if (minus, plus) in self.pairs:
            return -self.pairs[minus, plus].symbol
        return self.node(plus) - self.node(minus)

    def angle(self, number: int) -> Symbol:
        """The angle, position or flux linkage of a node: the integral of its across variable."""
        return self._angles[number]

    @cached_property
    def _angles(self) -> tuple[Symbol, ...]:
        """Named after the part that defines the speed, and after the node where the part has several of that name."""
        graph = self.graph
        of_nodes = [self._angle_name(number) for number in range(len(graph.nodes))]
        between = (branch for branch in graph.branches if branch.minus != GROUND)
        read = (integral_name(graph, branch) for branch in between if branch.index in graph.integrated[branch.part])
        counted = Counter((*of_nodes, *read))
        named = zip(of_nodes, graph.domains, graph.nodes, strict=True)
        names = (name if counted[name] == 1 else f"{domain.integral.name}({node})" for name, domain, node in named)
        return tuple(Symbol(name, real=True) for name in names)

    def _angle_name(self, number: int) -> str:
        """The name of a node's angle after the part that defines its speed; of a node without one after the node."""
        quantity, owner = self.graph.domains[number].integral, self.owners.get(number)
        if owner is None:
            return f"{quantity.name}({self.graph.nodes[number]})"
        number_within = running_number(self.graph.branches[owner].template.label)
        ending = f"_{number_within}" if number_within else ""
        return f"{self.graph.part_of(owner).name}.{quantity.name}{ending}"

    def rate(self, branch: int) -> Expr:
        """The rate of what is across a branch."""
        across = self.across((self.graph.branches[branch].plus, self.graph.branches[branch].minus))
        return across.xreplace({symbol: rate_of(symbol) for symbol in across.free_symbols})

    def integral(self, branch: int) -> Symbol:
        """The integral of what is across a branch: of a law that reads it, or of a prescribed speed."""
        record, part = self.graph.branches[branch], self.graph.part_of(branch)
        name = integral_name(self.graph, record)
        if branch not in self.graph.integrated[record.part] and record.template.kind is Kind.ACROSS_SOURCE:
            if self.owners.get(record.plus) == branch:
                return self.angle(record.plus)
            siblings = (self.graph.branches[index].template.kind for index in part.branches)
            name += f"_{self._label(record)}" if sum(kind is Kind.ACROSS_SOURCE for kind in siblings) > 1 else ""
        return Symbol(name, real=True)

    def through(self, flow: ThroughQuantity) -> Symbol:
        """The through variable of a flow: a state, where it is a lone store; a parameter, where that is all its law."""
        first = self.graph.branches[flow.branches[0]]
        if len(flow.branches) == 1 and first.template.kind is Kind.THROUGH_STORE:
            return self.store(first.index)
        if len(flow.branches) == 1 and first.template.kind is Kind.THROUGH_SOURCE:
            law = flow.sign * self.law(first.index)
            # the torque of a part with modes has the same letter in all of them
            if law.is_Symbol and law.name in self.graph.parameters and not self.graph.parts[flow.part].modes:
                return law
        return self._named(flow.part, self.domain((flow.plus, flow.minus)).through, flow.label)

    def store(self, branch: int) -> Symbol:
        """The through variable of a through store alone, without the loss beside it."""
        return Symbol(branch_name(self.graph, self.graph.branches[branch]), real=True)

    def passing(self, branch: int) -> tuple[Symbol, int]:
        """Symbol and sign of what passes through a branch whose law does not give it by what is across."""
        match self.graph.branches[branch].template.kind:
            case Kind.THROUGH_STORE:
                return self.store(branch), 1
            case Kind.COUPLING:
                return self.multiplier(branch), self.multiplier_sign(branch)
        return self.through(self.flow_of[branch]), self.flow_of[branch].sign

    def carried(self, branch: int) -> Expr:
        """What passes through a store or a source, as laws read it."""
        symbol, sign = self.passing(branch)
        return sign * symbol

    def multiplier(self, branch: int) -> Symbol:
        """The through variable of a coupling: a term of coefficient r takes r times it from its node."""
        part = self.graph.branches[branch].part
        return self._named(part, self.multiplier_quantity(branch), self.multiplier_label(branch))

    def multiplier_sign(self, branch: int) -> int:
        """The sign of that symbol, so that it means what the signal of its name does.

        What holds a load at rest is then, as the load's torque while it moves, what it gives to its node.
        """
        terms = self.graph.branches[branch].template.terms
        return self._sign_between(self.graph.part_of(branch), terms[0][1:]) if len(terms) == 1 else 1

    def multiplier_label(self, branch: int) -> str:
        """What tells a coupling from the other branches of its part; empty where it is the only one."""
        several = len(self.graph.part_of(branch).branches) > 1
        return self._label(self.graph.branches[branch]) if several else ""

    def multiplier_quantity(self, branch: int) -> Quantity:
        """What a coupling's through variable is: that of its first term of coefficient 1 or -1."""
        terms = self.graph.branches[branch].terms
        unit = [term for term in terms if abs(term[0]) == 1]
        _, plus, minus = (unit or terms)[0]
        return self.domain((plus, minus)).through

    @cached_property
    def owners(self) -> dict[int, int]:
        """For a node the branch to the reference whose across variable is its own: a source, else the first store."""
        owners: dict[int, int] = {}
        for branch in self._defining:
            if branch.minus == GROUND != branch.plus:
                owners.setdefault(branch.plus, branch.index)
        return owners

    @cached_property
    def inner(self) -> dict[int, tuple[int, str]]:
        """For a node inside a part whose across variable is its own: the place of the part, and the port's name."""
        return {
            part.nodes[port.name]: (place, port.name)
            for place, part in enumerate(self.graph.parts)
            for port in part.component.inner_ports()
            if part.nodes[port.name] not in self.owners
        }

    @cached_property
    def _defining(self) -> tuple[GraphBranch, ...]:
        kinds = (Kind.ACROSS_SOURCE, Kind.ACROSS_STORE)
        return tuple(branch for kind in kinds for branch in self.graph.branches if branch.template.kind is kind)

    @cached_property
    def _nodes(self) -> tuple[Symbol, ...]:
        return tuple(self._node_symbol(number) for number in range(len(self.graph.nodes)))

    def _node_symbol(self, number: int) -> Symbol:
        if number in self.owners:
            return self._defined(self.graph.branches[self.owners[number]])
        return Symbol(f"{self.graph.domains[number].across.name}({self.graph.nodes[number]})", real=True)

    @cached_property
    def pairs(self) -> dict[Ends, Pair]:
        """The across variables between two nodes that have a symbol, by their ends."""
        pairs: dict[Ends, Pair] = {}
        for branch in self._defining:
            ends = (branch.plus, branch.minus)
            if branch.minus != GROUND and ends not in pairs and ends[::-1] not in pairs:
                pairs[ends] = Pair(branch.part, self._defined(branch), branch.template.label)
        for flow in self.flows:
            ends = (flow.plus, flow.minus)
            if GROUND not in ends and ends not in pairs and ends[::-1] not in pairs:
                quantity = self.domain(ends).across
                suffix = "" if self.domain(ends) is ELECTRICAL else "_rel"
                label = f"{quantity.name}{suffix}" + (f"_{flow.label}" if flow.label else "")
                symbol = Symbol(f"{self.graph.parts[flow.part].name}.{label}", real=True)
                pairs[ends] = Pair(flow.part, symbol, flow.label)
        return pairs

    def _defined(self, branch: GraphBranch) -> Symbol:
        """The symbol of the across variable that a store or a source defines."""
        law = self.own_law(branch.index)
        if branch.template.kind is Kind.ACROSS_SOURCE and law.is_Symbol and law.name in self.graph.parameters:
            return law
        domain, label = self.domain((branch.plus, branch.minus)), branch.template.label
        of_source = branch.template.kind is Kind.ACROSS_SOURCE and label == domain.through.name
        ending = "" if of_source else label.removeprefix(f"{domain.across.name}_")
        return self._named(branch.part, domain.across, ending)

    def _named(self, part: int, quantity: Quantity, label: str) -> Symbol:
        """The symbol "part.quantity", or "quantity(part)" where a parameter of the part has taken that name."""
        owner = self.graph.parts[part].name
        ending = f"_{label}" if label else ""
        name = f"{owner}.{quantity.name}{ending}"
        return Symbol(f"{quantity.name}{ending}({owner})" if name in self.graph.parameters else name, real=True)

    def _flows_of(self, number: int) -> Iterator[ThroughQuantity]:
        part = self.graph.parts[number]
        parallel: dict[tuple[int, int, bool], tuple[int, ...]] = {}
        for index in part.branches:
            branch = self.graph.branches[index]
            if branch.template.kind not in (Kind.COUPLING, Kind.ACROSS_STORE):
                prescribes = branch.template.kind is Kind.ACROSS_SOURCE  # takes what the balance leaves, by no law
                key = (branch.plus, branch.minus, prescribes)
                parallel[key] = (*parallel.get(key, ()), index)
        ends = [(plus, minus) for plus, minus, prescribes in parallel if not prescribes]
        labels = self._flow_labels(part, tuple(parallel.values()), ends)
        for ((plus, minus, _), branches), label in zip(parallel.items(), labels, strict=True):
            yield ThroughQuantity(number, branches, plus, minus, self._sign(part, branches), label)

    def _flow_labels(self, part: GraphPart, flows: Sequence[tuple[int, ...]], ends: Collection[Ends]) -> list[str]:
        """What tells the flows of a part apart: numbers where these do; nothing where there is only one torque.

        Args:
            part: the part.
            flows: the branches of each flow.
            ends: those of flows that follow a law.
        """
        branches = [self.graph.branches[index] for index in part.branches]
        terms = [branch.terms for branch in branches if len(branch.terms) == 1]
        holds = any((plus, minus) in ends for ((_, plus, minus),) in terms)  # by a torque beside that of the law
        if len(flows) == 1 and not holds and not any(RATE in branch.template.reads for branch in branches):
            return [""]
        first = [self.graph.branches[indices[0]] for indices in flows]
        labels = [self._label(branch) for branch in first]
        numbers = [running_number(label) or label for label in labels]
        if len(set(numbers)) == len(numbers):
            return numbers
        # springs and dampers in different places; the label of parallel ones is that of the store among them
        quantities = [self.domain((branch.plus, branch.minus)).through for branch in first]
        return [
            f"total_{number}" if len(indices) > 1 else label.removeprefix(f"{quantity.name}_")
            for indices, number, label, quantity in zip(flows, numbers, labels, quantities, strict=True)
        ]

    def _sign(self, part: GraphPart, branches: tuple[int, ...]) -> int:
        """The sign of the signal of the same name, so that both mean the same torque."""
        templates = [self.graph.branches[index].template for index in branches]
        if any(template.kind is Kind.THROUGH_STORE for template in templates):
            return 1
        return self._sign_between(part, templates[0].ends)

    def _sign_between(self, part: GraphPart, ends: tuple[End, End]) -> int:
        signals = part.component.signals().values()
        return next((s.sign for s in signals if s.kind == "through" and s.ends == ends), 1)

    def _label(self, branch: GraphBranch) -> str:
        template, siblings = branch.template, self.graph.parts[branch.part].branches
        if template.kind is Kind.ACROSS_SOURCE and template.label == ELECTRICAL.through.name:
            return ""  # its current, which a law reads, is that of the part
        if template.label:
            return template.label
        names = [symbol.name for symbol in template.symbols]
        return names[0] if len(names) == 1 else str(siblings.index(branch.index) + 1)
