"""The elements of SPICE that the branches of a network are: one or a few lines for each."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from sympy import Expr, Float, Symbol

from shaftwork.components.branches import ACROSS, INTEGRAL, THROUGH
from shaftwork.components.controlled import VoltageControlledSwitch
from shaftwork.components.discontinuities import breakpoints
from shaftwork.components.laws import replaced, t
from shaftwork.network.graph import GROUND, CircuitGraph, GraphBranch, GraphPart, readings_of, resolve
from shaftwork.network.kinds import Kind
from shaftwork.network.netlist import by_part, unused
from shaftwork.spice.smoothed_modes import SmoothedPart
from shaftwork.spice.spice_laws import of_time, printed, waveform

RESERVED = ("0", "gnd", "time")


class Labels:
    """Names as SPICE takes them: letters, digits and underscores, without case, each once."""

    def __init__(self) -> None:
        self._labels: dict[tuple[str, str, int], str] = {}
        self._taken = dict[str, set[str]]()  # only asked for membership

    def of(self, kind: str, name: str, key: int = 0) -> str:
        """The label of a name; the same name and key of the same kind have the same one."""
        if (kind, name, key) not in self._labels:
            plain = re.sub("[^A-Za-z0-9]", "_", name).lower() or "n"
            taken = self._taken.setdefault(kind, {*RESERVED})
            self._labels[kind, name, key] = unused(plain, taken, "{}_{}")
            taken.add(self._labels[kind, name, key])
        return self._labels[kind, name, key]


class Elements:
    """Writes branches as elements.

    Args:
        graph: of the network, in which the numbers of modes are parameters.
        parts: what stands for the modes of parts, by name.
        redundant: couplings that say what others have said already.
        stored: start values of stores and angles, by branch.
        t_end: end of the motion, s.
        edge: in what time a jump rises, s.
    """

    def __init__(
        self,
        graph: CircuitGraph,
        parts: Mapping[str, SmoothedPart],
        redundant: tuple[int, ...],
        stored: Mapping[int, float],
        t_end: float,
        edge: float,
    ) -> None:
        self._graph, self._parts, self._redundant, self._stored = graph, parts, redundant, stored
        self._t_end, self._edge = t_end, edge
        self._labels, self._parameters_of = Labels(), by_part(graph.parameters)
        self._measured = frozenset(
            reading.of
            for branch in graph.branches
            for reading in readings_of(graph, branch.index).values()
            if reading.kind == "through"
        )
        self._integrated: list[int] = []
        self._rated: list[int] = []
        self._switches: dict[float, int] = {}
        self._times: list[float] = []

    def node(self, number: int) -> str:
        """The label of a node."""
        return "0" if number == GROUND else self._labels.of("", self._graph.nodes[number])

    def of_part(self, part: GraphPart) -> Iterator[str]:
        """The lines of the elements of a part."""
        if isinstance(part.component, VoltageControlledSwitch):
            yield from self._switch(part)
            return
        name, smoothed = part.name, self._parts.get(part.name, SmoothedPart())
        branches = (self._graph.branches[k] for k in part.branches)
        lines = (branch for branch in branches if not self._is_end_of_line(branch))
        for branch in lines:
            yield from self._of_branch(branch, smoothed.laws.get(branch.index))
        for law, plus, minus in smoothed.added:
            label, numbers = self._labels.of("element", name), self._parameters(name)
            text = self._printed(self._of_time(self._in_numbers(law, numbers)), plus, minus, {})
            yield f"B{label} {self.node(plus)} {self.node(minus)} I = {text}"

    def rest(self) -> Iterator[str]:
        """The lines of what laws read besides voltages and currents: angles and rates."""
        for index in self._integrated:
            branch, label = self._graph.branches[index], self._angle(index)
            start = self._stored.get(index, 0.0)
            yield f"G{label} 0 {label} {self.node(branch.plus)} {self.node(branch.minus)} 1"
            yield f"C{label} {label} 0 1" + (f" IC={start!r}" if start else "")
        for index in self._rated:
            branch, label = self._graph.branches[index], self._rate(index)
            yield f"E{label} {label} 0 {self.node(branch.plus)} {self.node(branch.minus)} 1"
            yield f"V{label} {label} {label}_c 0"
            yield f"C{label} {label}_c 0 1"

    def clocks(self) -> Iterator[str]:
        """The lines of switches that laws of time read, and of a source whose corners are where laws bend."""
        for time, number in self._switches.items():
            yield f"Vfrom_{number} from_{number} 0 PWL(0 0 {max(time - self._edge, time / 2)!r} 0 {time!r} 1)"
        if bends := sorted({*self._times} - {*self._switches}):
            yield f"Vbends bends 0 PWL(0 0 {' '.join(f'{time!r} {k}' for k, time in enumerate(bends, 1))})"

    def _is_end_of_line(self, branch: GraphBranch) -> bool:
        """Whether it is one of the four branches of a line other than the first."""
        of_line = self._of_line(branch)
        return branch.index in of_line and of_line.index(branch.index) % 4 > 0

    def _of_line(self, branch: GraphBranch) -> list[int]:
        """The branches of lines in its part."""
        return [k for k in self._graph.part_of(branch.index).branches if self._graph.branches[k].template.line]

    def _switch(self, part: GraphPart) -> Iterator[str]:
        label, values = self._labels.of("element", part.name), resolve(part.component)[0]
        ends = " ".join(self.node(part.nodes[port.name]) for port in part.component.ports)
        pairs = (("vt", "u_t"), ("vh", "u_h"), ("ron", "R_on"), ("roff", "R_off"))
        yield f"S{label} {ends} {label}"
        yield f".model {label} sw({' '.join(f'{key}={values[name]!r}' for key, name in pairs)})"

    def _of_branch(self, branch: GraphBranch, law: Expr | None) -> Iterator[str]:
        template = branch.template
        symbols, numbers = template.law if law is None else law, self._parameters(self._part(branch))
        law = self._in_numbers(symbols, numbers)
        if law == 0 and template.kind is not Kind.ACROSS_SOURCE and not branch.terms:
            return
        label, plus, minus = self._element(branch), self.node(branch.plus), self.node(branch.minus)
        start = self._stored.get(branch.index, 0.0)
        condition = f" IC={start!r}" if start else ""
        if branch.index in self._measured:  # laws read its current, that of a source of zero volts
            yield f"V{label}_i {plus} {label}_i 0"
            plus = f"{label}_i"
        match template.kind:
            case Kind.ACROSS_STORE:
                yield f"C{label} {plus} {minus} {float(law)!r}{condition}"
            case Kind.THROUGH_STORE:
                yield f"L{label} {plus} {minus} {float(self._in_numbers(1 / symbols, numbers))!r}{condition}"
            case Kind.CONDUCTANCE if template.line is not None:
                yield self._line(branch)
            case Kind.CONDUCTANCE:
                yield f"R{label} {plus} {minus} {float(self._in_numbers(1 / symbols, numbers))!r}"
            case Kind.ACROSS_SOURCE:
                yield self._source("V", branch, law, plus, minus)
            case Kind.THROUGH_SOURCE | Kind.LAW:
                yield self._source("I", branch, law, plus, minus)
            case Kind.COUPLING if branch.index in self._redundant:
                yield "* (left out: other couplings say the same)"
            case Kind.COUPLING:
                yield from self._coupling(branch, law)

    def _source(self, kind: str, branch: GraphBranch, law: Expr, plus: str, minus: str) -> str:
        label, law = self._element(branch), self._of_time(law)
        if (value := waveform(law, self._t_end, self._edge)) is not None:
            return f"{kind}{label} {plus} {minus} {value}"
        reads = self._readings(branch)
        return f"B{label} {plus} {minus} {kind} = {self._printed(law, branch.plus, branch.minus, reads, branch.index)}"

    def _coupling(self, branch: GraphBranch, law: Expr) -> Iterator[str]:
        """Sources in series, whose voltages are those of the other terms, and sources of current in those."""
        label, numbers = self._element(branch), self._parameters(self._part(branch))
        across = [(float(self._in_numbers(c, numbers)), plus, minus) for c, plus, minus in branch.terms]
        through = [float(self._in_numbers(b, numbers)) for b, _, _ in branch.balances]
        (first, plus, minus), *others = across
        begin, end = self.node(plus), self.node(minus)
        if not others:
            yield f"V{label} {begin} {end} 0"
            return
        inner = [f"{label}_{k}" for k in range(1, len(others) + 1)]
        yield f"V{label} {begin} {inner[0]} 0"
        for k, (factor, other, back) in enumerate(others):
            far, count = end if k == len(others) - 1 else inner[k + 1], "" if len(others) == 1 else f"_{k + 1}"
            ends = f"{self.node(other)} {self.node(back)}"
            yield f"E{label}{count} {inner[k]} {far} {ends} {-factor / first!r}"
            if law.has(THROUGH):  # of teeth that rub the ratio of torques depends on who drives
                text = self._printed(law, plus, minus, {THROUGH: Symbol(f"i(V{label})")})
                yield f"B{label}{count} {ends} I = {text}"
            else:
                yield f"F{label}{count} {ends} V{label} {through[k + 1] / through[0]!r}"

    def _line(self, branch: GraphBranch) -> str:
        of_line = self._of_line(branch)
        far = self._graph.branches[of_line[of_line.index(branch.index) + 2]]
        assert branch.template.line is not None  # noqa: S101 (asked for before)
        numbers = self._parameters(self._part(branch))
        impedance, delay = (float(self._in_numbers(one, numbers)) for one in branch.template.line)
        ends = f"{self.node(branch.plus)} 0 {self.node(far.plus)} 0"
        return f"T{self._element(branch)} {ends} Z0={1 / impedance!r} TD={delay!r}"

    def _of_time(self, law: Expr) -> Expr:
        """A law with the voltages of switches in place of what jumps over time."""
        law, switches = of_time(law, self._t_end, self._edge)
        numbers = {time: self._switches.setdefault(time, len(self._switches) + 1) for time in switches}
        return law.xreplace({symbol: Symbol(f"v(from_{numbers[time]})") for time, symbol in switches.items()})

    def _printed(
        self, law: Expr, plus: int, minus: int, reads: Mapping[Symbol, Symbol], index: int | None = None
    ) -> str:
        """A law with the quantities of the circuit in it; the times at which it jumps are noted."""
        self._times += [time for time in breakpoints(law) if time > 0.0]
        texts: dict[Symbol, Symbol] = {ACROSS: Symbol(self._voltage(plus, minus)), **reads}
        if index is not None and law.has(INTEGRAL):
            texts[INTEGRAL] = Symbol(f"v({self._of_angle(index)})")
        return printed(replaced(law, texts))

    def _readings(self, branch: GraphBranch) -> dict[Symbol, Symbol]:
        """What the law of a branch reads, as ngspice calls it."""
        texts: dict[Symbol, Symbol] = {}
        for symbol, reading in readings_of(self._graph, branch.index).items():
            match reading.kind:
                case "across":
                    text = self._voltage(reading.of, GROUND)
                case "through":
                    text = f"i(V{self._element(self._graph.branches[reading.of])}_i)"
                case "integral":
                    text = f"v({self._of_angle(reading.of)})"
                case "rate":
                    self._rated.append(reading.of)
                    text = f"i(V{self._rate(reading.of)})"
            texts[symbol] = Symbol(text)
        return texts

    def _voltage(self, plus: int, minus: int) -> str:
        if plus == minus:
            return "0"
        if GROUND in (plus, minus):
            return f"v({self.node(plus)})" if minus == GROUND else f"(-v({self.node(minus)}))"
        return f"v({self.node(plus)},{self.node(minus)})"

    def _of_angle(self, index: int) -> str:
        if index not in self._integrated:
            self._integrated.append(index)
        return self._angle(index)

    def _angle(self, index: int) -> str:
        return f"{self._element(self._graph.branches[index])}_angle"

    def _rate(self, index: int) -> str:
        return f"{self._element(self._graph.branches[index])}_rate"

    def _element(self, branch: GraphBranch) -> str:
        """The label of a branch: the name of its part, with what tells it from others of that."""
        part = self._graph.parts[branch.part]
        if branch.index == part.branches[0]:
            return self._labels.of("element", part.name)
        letter = branch.template.symbols[0].name if len(branch.template.symbols) == 1 else branch.template.label
        text = f"{part.name} {letter or branch.index - part.branches[0] + 1}"
        return self._labels.of("element", text, branch.index)

    def _part(self, branch: GraphBranch) -> str:
        return self._graph.parts[branch.part].name

    def _parameters(self, name: str) -> Mapping[str, float]:
        return self._parameters_of.get(name, {})

    def _in_numbers(self, law: Expr, numbers: Mapping[str, float]) -> Expr:
        values = {symbol: Float(numbers[symbol.name]) for symbol in law.free_symbols if symbol.name in numbers}
        return replaced(law, {symbol: value for symbol, value in values.items() if symbol != t})
