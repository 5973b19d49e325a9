"""The state form of a network: which branches are states, inputs and dependent, ready to become rows or matrices.

With C, L the stores that are states (tree capacities, link compliances), G and R the tree and link conductances, w the
through variables of the nonlinear laws and sources, e the prescribed across variables, F the loops:

    v_R = F_CR' x_C + F_ER' e + F_GR' v_G                                         loops of the link conductances
    (G + Q_GR R F_GR') v_G = -Q_GR R (F_CR' x_C + F_ER' e) - Q_GL x_L - Q_GW w    cutsets of the tree conductances
    M x_C' = -Q_CR R v_R - Q_CL x_L - Q_CW w - Q_CK K F_EK' e'                    M = C + Q_CK K F_CK'
    N x_L' = F_CL' x_C + F_EL' e + F_GL' v_G - F_SL' S Q_SW w'                    N = L + F_SL' S Q_SL

K are the dependent capacities (rigidly geared inertias), S the dependent compliances (springs in series), and Q are the
cutsets: F itself but where a coupling loses power. It is exact: nothing is lost by the elimination, and every
eliminated quantity comes back from F and Q.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

from sympy import Expr

from shaftwork.components.base import Signal
from shaftwork.components.branches import RATE
from shaftwork.core.domains import ROTATION, Domain
from shaftwork.formulation.tree import NormalTree, normal_tree
from shaftwork.network.graph import GROUND, CircuitGraph, GraphBranch, GraphPart, Reading, readings_of, signals_of
from shaftwork.network.kinds import Kind, is_bounded

KINDS = ("across", "through", "integral", "rate")
"""What laws read besides what is across their own branches, in the order of `StateForm.readings`."""


@dataclass(frozen=True)
class State:
    """A state variable: its name, the branch that carries it, its quantity's unit and LaTeX symbol."""

    name: str
    branch: int
    kind: str
    unit: str
    latex: str


@dataclass(frozen=True, eq=False)
class StateForm:
    """Graph, normal tree and the groups of branches in the equations above.

    Args:
        graph: the circuit graph.
        tree: its normal tree.
        angles: branches whose angle (position, flux linkage) is recorded although no law reads it.
    """

    graph: CircuitGraph
    tree: NormalTree
    angles: tuple[int, ...] = ()

    def law_of(self, branch: int) -> Expr:
        """The coefficient or law of a branch in the symbols of the network."""
        return self.graph.in_network_symbols(self.graph.branches[branch].template.law, self.graph.branches[branch])

    @property
    def loses_power(self) -> bool:
        """Whether a coupling does: then torques have other ratios than speeds, and cutsets other gains than loops."""
        return self.tree.cutsets is not self.tree.loops

    @property
    def across_sources(self) -> tuple[int, ...]:
        """Prescribed across variables: speeds, voltages."""
        return self.tree.tree[Kind.ACROSS_SOURCE]

    @property
    def across_inputs(self) -> tuple[int, ...]:
        """The inputs e: prescribed across variables, and those of tree laws, which an algebraic loop determines."""
        return self.across_sources + self.tree.tree[Kind.LAW]

    @cached_property
    def loop_laws(self) -> tuple[int, ...]:
        """Nonlinear laws whose across and through variables determine each other at a massless node.

        These are the laws in the tree, and those links in whose loop a tree conductance stands: its across variable
        depends on the law's own through variable. All other laws read states and inputs of time alone.
        """
        conductances = frozenset(self.tree_conductances)
        links = (link for link in self.tree.links[Kind.LAW] if not conductances.isdisjoint(self.tree.loops[link]))
        return (*self.tree.tree[Kind.LAW], *links)

    @cached_property
    def inertial(self) -> tuple[int, ...]:
        """Laws of what stores have beyond a constant: they read the rate of a speed that they help to determine."""
        return tuple(k for k in self.tree.links[Kind.LAW] if RATE in self.graph.branches[k].template.reads)

    @cached_property
    def doubtful(self) -> tuple[int, ...]:
        """Those of them whose store may vanish or have a pole somewhere."""
        laws = {k: self.graph.branches[self.graph.constant_of(k)].template.printed for k in self.inertial}
        return tuple(k for k, law in laws.items() if not is_bounded(law))

    @property
    def across_states(self) -> tuple[int, ...]:
        """Capacities in the tree: their across variables are states."""
        return self.tree.tree[Kind.ACROSS_STORE]

    @property
    def through_states(self) -> tuple[int, ...]:
        """Compliances among the links: their through variables are states."""
        return self.tree.links[Kind.THROUGH_STORE]

    @property
    def tree_conductances(self) -> tuple[int, ...]:
        """Conductances in the tree: their across variables are solved for."""
        return self.tree.tree[Kind.CONDUCTANCE]

    @property
    def link_conductances(self) -> tuple[int, ...]:
        """Conductances among the links."""
        return self.tree.links[Kind.CONDUCTANCE]

    @property
    def dependent_across(self) -> tuple[int, ...]:
        """Capacities whose across variable follows from others: rigidly geared inertias, capacitor loops."""
        return self.tree.links[Kind.ACROSS_STORE]

    @property
    def dependent_through(self) -> tuple[int, ...]:
        """Compliances whose through variable follows from others: springs in series, inductor cutsets."""
        return self.tree.tree[Kind.THROUGH_STORE]

    @property
    def laws(self) -> tuple[int, ...]:
        """The inputs w: nonlinear laws first, then sources that depend on time alone."""
        return self.tree.links[Kind.LAW] + self.tree.links[Kind.THROUGH_SOURCE]

    @cached_property
    def integrals(self) -> tuple[int, ...]:
        """Branches whose integrated across variable is read by a law or asked for: each adds a state."""
        laws = (*self.laws, *self.tree.tree[Kind.LAW])
        integrated = (index for index in laws if self.graph.branches[index].template.has_integral)
        read = (reading.of for reading in self.readings if reading.kind == "integral")
        return tuple(dict.fromkeys((*integrated, *read, *self.angles)))

    @cached_property
    def recorded(self) -> tuple[int, ...]:
        """Integrals that are asked for alone, which nothing reads: they may go on where all else is steady."""
        read = {reading.of for reading in self.readings if reading.kind == "integral"}
        return tuple(k for k in self.angles if k not in read and not self.graph.branches[k].template.has_integral)

    @cached_property
    def controlled(self) -> tuple[int, ...]:
        """Prescribed across variables that follow from other branches of their part, not from the time alone."""
        return tuple(index for index in self.across_sources if self.graph.branches[index].template.reads)

    @cached_property
    def readings(self) -> tuple[Reading, ...]:
        """What laws read besides what is across their own branches, each once: nodes, then branches."""
        laws = (*self.tree.links[Kind.LAW], *self.tree.tree[Kind.LAW], *self.controlled)
        readings = dict.fromkeys(reading for law in laws for reading in readings_of(self.graph, law).values())
        return tuple(sorted(readings, key=lambda reading: KINDS.index(reading.kind)))

    @cached_property
    def waves(self) -> tuple[int, ...]:
        """Histories at the ends of lines, both ends of a line in a row. They follow the states in x."""
        return tuple(branch.index for branch in self.graph.branches if branch.template.is_history)

    @cached_property
    def outputs(self) -> tuple[int, ...]:
        """Branches whose across variable is read: by a nonlinear law, by an integral or by a line."""
        laws = (*self.tree.links[Kind.LAW], *self.tree.tree[Kind.LAW])
        return tuple(dict.fromkeys((*laws, *self.integrals, *self.waves)))

    @property
    def has_impulses(self) -> bool:
        """Whether a jump of a source is an impulse to stores that are joined to it rigidly."""
        speeds = self.dependent_across and self.across_sources
        torques = (k for k in self.tree.links[Kind.THROUGH_SOURCE] if not self.graph.branches[k].template.meter)
        return bool(speeds or (self.dependent_through and any(True for _ in torques)))

    @cached_property
    def samples(self) -> bool:
        """Whether a part acts at sampling instants."""
        return any(part.component.sampler() is not None for part in self.graph.parts)

    @cached_property
    def states(self) -> tuple[State, ...]:
        """The states: speeds of the tree's stores, torques of the links' stores, integrals."""
        return (
            *(_across_state(self.graph, self.graph.branches[index]) for index in self.across_states),
            *(_through_state(self.graph, self.graph.branches[index]) for index in self.through_states),
            *(_integral_state(self.graph, self.graph.branches[index]) for index in self.integrals),
        )

    @cached_property
    def speeds(self) -> slice:
        """Where across variables are among the states."""
        return slice(len(self.across_states))

    @cached_property
    def torques(self) -> slice:
        """Where through variables are among the states."""
        return slice(self.speeds.stop, self.speeds.stop + len(self.through_states))

    @cached_property
    def integral_places(self) -> Mapping[int, int]:
        """Where the integrals are among the states, by branch."""
        return {branch: k for k, branch in enumerate(self.integrals, self.torques.stop)}


def state_form(graph: CircuitGraph, angles: tuple[int, ...] = ()) -> StateForm:
    """Graph to state form. Whether the form is solvable is for `diagnosis` to say."""
    return StateForm(graph, normal_tree(graph), angles)


def branch_name(graph: CircuitGraph, branch: GraphBranch) -> str:
    """A name for the branch's through variable that is unique in the network: "shaft.tau_c"."""
    part = graph.parts[branch.part]
    domain = _domain(graph, branch)
    label = branch.template.label or domain.through.name
    return f"{part.name}.{label}"


def store_name(graph: CircuitGraph, branch: GraphBranch) -> str:
    """The name that a store's state has, where it is one: "J1.omega", "shaft.tau_c"."""
    state_of = _across_state if branch.template.kind is Kind.ACROSS_STORE else _through_state
    return state_of(graph, branch).name


def integral_name(graph: CircuitGraph, branch: GraphBranch) -> str:
    """The name of the integral of what is across a branch: "gap.phi", "gap.phi_left" beside others of the part."""
    part = graph.parts[branch.part]
    name = f"{part.name}.{_domain(graph, branch).integral.name}"
    if branch.template.meter:
        return f"{name}_{branch.template.label}" if branch.template.label else name
    if all(other == branch.index for other in graph.integrated[branch.part]):
        return name
    return f"{name}_{branch.template.label or part.branches.index(branch.index) + 1}"


def _domain(graph: CircuitGraph, branch: GraphBranch) -> Domain:
    node = branch.plus if branch.plus >= 0 else branch.minus
    return graph.domains[node]


def _across_state(graph: CircuitGraph, branch: GraphBranch) -> State:
    quantity = _domain(graph, branch).across
    label = branch.template.label or quantity.name
    return State(f"{graph.parts[branch.part].name}.{label}", branch.index, "across", quantity.unit, quantity.latex)


def _through_state(graph: CircuitGraph, branch: GraphBranch) -> State:
    quantity = _domain(graph, branch).through
    return State(branch_name(graph, branch), branch.index, "through", quantity.unit, quantity.latex)


def _integral_state(graph: CircuitGraph, branch: GraphBranch) -> State:
    quantity = _domain(graph, branch).integral
    return State(integral_name(graph, branch), branch.index, "integral", quantity.unit, quantity.latex)


class Names:
    """The names of all quantities of a model; made once for all motions in the same equations.

    Args:
        form: the state form.
    """

    def __init__(self, form: StateForm) -> None:
        self._form, self._graph = form, form.graph

    @cached_property
    def signals(self) -> dict[str, tuple[GraphPart, Signal]]:
        """Signals of parts."""
        parts = self._graph.parts
        return {f"{p.name}.{name}": (p, signal) for p in parts for name, signal in signals_of(self._graph, p).items()}

    @cached_property
    def integrals(self) -> dict[str, int]:
        """States that are integrals, by number."""
        return {state.name: k for k, state in enumerate(self._form.states) if state.kind == "integral"}

    @cached_property
    def nodes(self) -> dict[str, int]:
        """Speeds of nodes and the like, by number of the node."""
        pairs = zip(self._graph.nodes, self._graph.domains, strict=True)
        return {f"{name}.{domain.across.name}": k for k, (name, domain) in enumerate(pairs)}

    @cached_property
    def units(self) -> Mapping[str, str]:
        """Every quantity that can be read and its unit; where a part and a node share a name, the part's is meant."""
        units = {f"{name}": domain.across.unit for name, domain in zip(self.nodes, self._graph.domains, strict=True)}
        units |= {name: _unit(signal) for name, (_, signal) in self.signals.items()}
        units |= {s.name: s.unit for s in self._form.states if s.kind == "integral"}
        units |= {f"{part.name}.power": "W" for part in self._graph.parts}
        return units | {f"{part.name}.energy": "J" for part in self._graph.parts}

    @property
    def wiring(self) -> Mapping[str, str]:
        """See `CircuitGraph.wiring`."""
        return self._graph.wiring

    def nodes_of(self, name: str) -> tuple[str, ...]:
        """Names of the nodes that a signal of a part or the speed of a node is of, the reference not among them."""
        if name not in self.signals:
            return (self._graph.node_name(self.nodes[name]),) if name in self.nodes else ()
        part, signal = self.signals[name]
        numbers = (part.nodes[end] for end in signal.ends if end is not None)
        return tuple(self._graph.node_name(number) for number in numbers if number != GROUND)


def _unit(signal: Signal) -> str:
    domain = signal.domain or ROTATION
    quantity = {"across": domain.across, "twist": domain.integral}.get(signal.kind, domain.through)
    return quantity.unit
