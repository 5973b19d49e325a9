"""A part that the Modelica Standard Library has not, as a model of its own: the equations of its branches."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from sympy import Expr, Symbol

from shaftwork.components.branches import ACROSS, INTEGRAL, RATE, End, named_in
from shaftwork.core.domains import ELECTRICAL, ROTATION, TRANSLATION, Domain
from shaftwork.formulation.form import StateForm
from shaftwork.modelica.indexed_rows import FEW, IndexedPlace, RowGroup, difference, family, groups_of, runs_of, total
from shaftwork.modelica.modelica_expressions import Identifiers, ModelicaPrinter, quoted, symbols_of, unit
from shaftwork.modelica.standard_classes import CONNECTORS
from shaftwork.network.graph import GROUND, GraphBranch, GraphPart, resolve, signals_of
from shaftwork.network.kinds import Kind
from shaftwork.network.netlist import title

INTEGRALS = {ROTATION: "phi", TRANSLATION: "s", ELECTRICAL: "psi"}
FLOWS = {ROTATION: "tau", TRANSLATION: "f", ELECTRICAL: "i"}


class PartModel:
    """The text of the model of one part.

    Args:
        form: the state form of the network.
        part: of its graph.
    """

    def __init__(self, form: StateForm, part: GraphPart) -> None:
        self.form, self.graph, self.part = form, form.graph, part
        component = part.component
        self.title = title(component)
        self.branches = [self.graph.branches[k] for k in part.branches]
        self.domains: dict[str, Domain] = {}
        for port in (*component.ports, *component.inner_ports()):
            node = part.nodes[port.name]
            self.domains[port.name] = port.domain or (ROTATION if node == GROUND else self.graph.domains[node])
        self.names = Identifiers()
        self.ports = {port.name: self.names[port.name] for port in component.ports}
        self.parameters = {name: self.names.unused(name) for name in part.parameters}
        self.symbols = symbols_of(self.parameters)
        self.values = {Symbol(name, real=True): value for name, value in resolve(component)[0].items()}
        self._signals = {name: self.names.unused(name) for name in signals_of(self.graph, part)}
        self.variables: list[str] = []
        self.equations: list[str] = []
        self.places = self._places_of_ends()

    def text(self, name: str) -> str:
        """The model under a name.

        Raises:
            CompileError: a law has no counterpart in Modelica.
        """
        self._declare_ends()
        self.constitute()
        self._show_signals()
        about = (type(self.part.component).__doc__ or "").split("\n")[0]
        inside = [*self._connectors(), *self._parameters(), *self.variables]
        lines = [f"  model {name} {quoted(about)}", *(f"    {line}" for line in inside)]
        return "\n".join([*lines, "  equation", *(f"    {line}" for line in self.equations), f"  end {name};", ""])

    def constitute(self) -> None:
        """Write the laws of the branches, and the balances of what passes through them."""
        groups = groups_of(self.branches, self.ends_of)
        throughs = self._throughs(groups)
        for group in groups:
            self._write_law(group, throughs)
        self._balance(groups, throughs)

    def declare(self, name: str, measure: str, *, start: bool = False, size: int = 0) -> None:
        """A variable or an array, which begins at zero where it is a state."""
        each = "each " if size else ""
        begins = f"{each}start = 0, {each}fixed = true, " if start else ""
        length = f"[{size}]" if size else ""
        self.variables.append(f'Real {name}{length}({begins}{each}unit = "{unit(measure)}");')

    def angle_at(self, end: End) -> str:
        """The angle or position of a flange."""
        return f"{self.ports[str(end)]}.{INTEGRALS[self.domains[str(end)]]}"

    def flow_at(self, end: End) -> str:
        """What flows into the part at a port."""
        return f"{self.ports[str(end)]}.{FLOWS[self.domains[str(end)]]}"

    def ends_of(self, branch: GraphBranch) -> tuple[IndexedPlace | None, IndexedPlace | None]:
        """Where the across variables of the ends of a branch stand."""
        plus, minus = branch.template.ends
        return self.places.get(plus), self.places.get(minus)

    def domain_of(self, branch: GraphBranch) -> Domain:
        """The domain of a branch that is no coupling; of a coupling that of its first end."""
        ends = branch.template.ends if not branch.terms else branch.template.terms[0][1:]
        return self.domains[next(end for end in ends if end is not None)]

    def _connectors(self) -> Iterator[str]:
        for port, name in self.ports.items():
            yield f"{CONNECTORS[self.domains[port]]} {name};"

    def _parameters(self) -> Iterator[str]:
        declared = self.part.component.declared
        for name, text in self.parameters.items():
            if name in declared:
                yield f'parameter Real {text}(unit = "{unit(declared[name].unit)}") {quoted(declared[name].meaning)};'

    def _places_of_ends(self) -> dict[End, IndexedPlace]:
        """Where the across variable of each port and inner node stands; nodes in a row share an array."""
        inner = [port.name for port in self.part.component.inner_ports()]
        row = [name for name in inner if name.isdigit()]
        places: dict[End, IndexedPlace] = {}
        for name, domain in self.domains.items():
            word, digits = family(name)
            if len(row) >= FEW and (name in row or name in ("a", "b")):
                numbers = {"a": 1, "b": len(row) + 2}
                places[name] = IndexedPlace(self.names[f"{domain.across.name} along"], numbers.get(name) or digits + 1)
            elif name in inner and digits and sum(family(other)[0] == word for other in inner) >= FEW:
                places[name] = IndexedPlace(self.names[f"{domain.across.name} {word}"], digits)
            elif domain is ELECTRICAL and name in self.ports:
                places[name] = IndexedPlace(f"{self.ports[name]}.v")
            else:
                places[name] = IndexedPlace(self.names.unused(f"{domain.across.name}_{name}"))
        return places

    def _declare_ends(self) -> None:
        """Declare the across variables of ports and inner nodes, and take those of flanges from their angles."""
        arrays: dict[str, list[str]] = {}
        for end, place in self.places.items():
            domain = self.domains[str(end)]
            if place.number:
                arrays.setdefault(place.name, []).append(str(end))
            elif domain is not ELECTRICAL or end not in self.ports:
                self.declare(place.name, domain.across.unit, start=self._is_state(end))
            if end in self.ports and domain is not ELECTRICAL:
                self.equations.append(f"{place.text()} = der({self.angle_at(end)});")
        for name, ends in arrays.items():
            size = max(self.places[end].number for end in ends)
            self.declare(name, self.domains[ends[0]].across.unit, start=all(map(self._is_state, ends)), size=size)

    def _is_state(self, end: End) -> bool:
        """Whether the across variable of an end is that of a store of this part that is a state."""
        states = frozenset(self.form.across_states)
        return any(branch.index in states and branch.template.ends == (end, None) for branch in self.branches)

    def _throughs(self, groups: list[RowGroup]) -> dict[int, IndexedPlace]:
        """The through variable of each branch, declared."""
        throughs: dict[int, IndexedPlace] = {}
        for group in groups:
            branch, size = group.branches[0], len(group.branches)
            quantity = self.domain_of(branch).through
            label = "" if branch.template.kind is Kind.ACROSS_STORE else branch.template.label  # which names its speed
            stem = label or f"{quantity.name}_{group.word}"
            stem = family(label)[0].rstrip("_") if label and size > 1 else stem
            name = self.names.unused(stem)
            size = size if size > 1 else 0
            self.declare(name, quantity.unit, start=branch.index in self.form.through_states, size=size)
            throughs |= {one.index: IndexedPlace(name, k if size else 0) for k, one in enumerate(group.branches, 1)}
        return throughs

    def _write_law(self, group: RowGroup, throughs: Mapping[int, IndexedPlace]) -> None:
        branch, size = group.branches[0], len(group.branches)
        index = "k" if size > 1 else ""
        if branch.terms:
            self.equations.append(self._coupling(branch))
            return
        across, through = difference(self.ends_of(branch), index, 1), throughs[branch.index].text(index, 1)
        law = self._printed(branch, throughs, across)
        line = {
            Kind.ACROSS_STORE: f"{law} * der({across}) = {through};",
            Kind.THROUGH_STORE: f"der({through}) = {law} * {across};",
            Kind.CONDUCTANCE: f"{through} = {law} * {across};",
            Kind.ACROSS_SOURCE: f"{across} = {law};",
        }.get(branch.template.kind, f"{through} = {law[1:-1] if law.startswith('(') else law};")
        self.equations += [f"for k in 1:{size} loop", f"  {line}", "end for;"] if index else [line]

    def _coupling(self, branch: GraphBranch) -> str:
        printer = ModelicaPrinter(self.symbols, self.title)
        terms = (
            f"{_times(printer.doprint(factor))}{difference((self.places.get(plus), self.places.get(minus)))}"
            for factor, plus, minus in branch.template.terms
        )
        return f"0 = {' + '.join(terms)};"

    def _printed(self, branch: GraphBranch, throughs: Mapping[int, IndexedPlace], across: str) -> str:
        law = branch.template.law
        if branch.template.is_history:
            return self._arrived(branch, throughs)
        names: dict[Symbol, str] = {ACROSS: across, RATE: f"der({across})", **self.symbols}
        if law.has(INTEGRAL):
            names[INTEGRAL] = self._integral(branch)
        names |= {symbol: self._reading(symbol, throughs) for symbol in branch.template.reads if symbol not in names}
        return self.printed(law, names)

    def printed(self, law: Expr, names: Mapping[Symbol, str]) -> str:
        """A law as a factor."""
        text = ModelicaPrinter(names, self.title, self.values).doprint(law)
        return text if re.fullmatch(r"[\w.\[\]]+", text) else f"({text})"

    def _reading(self, symbol: Symbol, throughs: Mapping[int, IndexedPlace]) -> str:
        kind, name = named_in(symbol)
        if kind == "across":
            return self.places[name].text()
        labelled = [b for b in self.branches if b.template.label == name and b.template.kind is not Kind.COUPLING]
        carrying = [b for b in labelled if b.template.kind in (Kind.THROUGH_STORE, Kind.ACROSS_SOURCE)]
        if kind == "through":
            return throughs[carrying[0].index].text()
        return self._integral(labelled[0])

    def _arrived(self, branch: GraphBranch, throughs: Mapping[int, IndexedPlace]) -> str:
        """What comes from the other end of a line, late."""
        word = branch.template.label.rpartition("_")[0]
        histories = (other for other in self.branches if other.template.is_history and other is not branch)
        far = next(other for other in histories if other.template.label.rpartition("_")[0] == word)
        impedance, travel = (self.printed(law, self.symbols) for law in branch.template.line or ())
        delay = self.names[f"travel_{word}"]
        declared = f'parameter Real {delay}(unit = "s") = {travel} "travel time of a wave";'
        self.variables += [] if declared in self.variables else [declared]
        wave = f"2 * {impedance} * {difference(self.ends_of(far))} + {throughs[far.index].text()}"
        return f"-delay({wave}, {delay})"

    def _integral(self, branch: GraphBranch) -> str:
        """The integral of what is across a branch: a difference of angles, or a variable of its own."""
        plus, minus = branch.template.ends
        domain = self.domain_of(branch)
        if domain is not ELECTRICAL and {plus, minus} - {None} <= self.ports.keys():
            return self.twist(plus, minus)
        name = self.names[f"{INTEGRALS[domain]}_{branch.index - self.branches[0].index + 1}"]
        equation = f"der({name}) = {difference(self.ends_of(branch))};"
        if equation not in self.equations:
            self.declare(name, domain.integral.unit, start=True)
            self.equations.append(equation)
        return name

    def twist(self, plus: End, minus: End) -> str:
        """The angle of one flange against another."""
        if plus is None or minus is None:
            return self.angle_at(plus) if minus is None else f"(-{self.angle_at(minus)})"
        return f"({self.angle_at(plus)} - {self.angle_at(minus)})"

    def _balance(self, groups: list[RowGroup], throughs: Mapping[int, IndexedPlace]) -> None:
        """What flows into a port passes on through branches, and at inner nodes nothing is left."""
        flows: dict[End, list[tuple[str, IndexedPlace]]] = {end: [] for end in self.places}
        printer = ModelicaPrinter(self.symbols, self.title)
        for branch in (branch for group in groups for branch in group.branches):
            for factor, plus, minus in branch.template.balances or ((None, *branch.template.ends),):
                scale = "" if factor is None else _times(printer.doprint(factor))
                for end, sign in ((plus, ""), (minus, "-")):
                    if end is not None:
                        flows[end].append((f"{sign}{scale}", throughs[branch.index]))
        for port in self.ports:
            self.equations.append(f"{self.flow_at(port)} = {total(flows.pop(port))};")
        for run in runs_of(flows, self.places):
            first = self.places[run[0]].number
            row = f"0 = {total(flows[run[0]], 'k' if len(run) > 1 else '', first)};"
            loop = [f"for k in {first}:{first + len(run) - 1} loop", f"  {row}", "end for;"]
            self.equations += loop if len(run) > 1 else [row]

    def _show_signals(self) -> None:
        """What the part shows, under the names that it has here."""
        for name, signal in signals_of(self.graph, self.part).items():
            domain, sign = signal.domain or ROTATION, "-" if signal.sign < 0 else ""
            if signal.kind == "across":
                plus, minus = (self.places.get(end) for end in signal.ends)
                value, measure = difference((plus, minus)), domain.across.unit
            elif signal.kind == "through" and signal.ends[0] in self.ports:
                value, measure = self.flow_at(signal.ends[0]), domain.through.unit
            else:
                continue
            self.declare(self._signals[name], measure)
            self.equations.append(f"{self._signals[name]} = {sign}{value};")


def _times(factor: str) -> str:
    """A factor in front of what it multiplies."""
    return "" if factor == "1" else f"({factor}) * "
