"""Which nodes rigid parts make one shaft, at which ratios, and what no ratio describes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import networkx as nx
from sympy import Expr, Float, S

from shaftwork.components.mechanics import LossyGear
from shaftwork.core.domains import ELECTRICAL
from shaftwork.core.errors import Diagnostic
from shaftwork.network.graph import GROUND, CircuitGraph, GraphBranch, GraphPart
from shaftwork.network.kinds import Kind
from shaftwork.network.netlist import listed
from shaftwork.numerics.tolerances import SAME


@dataclass(frozen=True)
class Scale:
    """What a speed and a power at a node are for those at another one.

    Law: omega = ratio omega', P = P' / power; hence tau' = ratio power tau, and J' = J ratio^2 power for any store.

    Args:
        ratio: speed of the node over speed of the other.
        power: share of the node's power that arrives at the other; 1 without lossy gears.
        ratio_law: the ratio in the symbols of the network.
        power_law: the share in the symbols of the network.
    """

    ratio: float = 1.0
    power: float = 1.0
    ratio_law: Expr = S.One
    power_law: Expr = S.One

    @property
    def through(self) -> float:
        """A torque at the other shaft over the torque here: ratio * power."""
        return self.ratio * self.power

    def __mul__(self, other: Scale) -> Scale:
        return Scale(
            self.ratio * other.ratio,
            self.power * other.power,
            self.ratio_law * other.ratio_law,
            self.power_law * other.power_law,
        )

    def __truediv__(self, other: Scale) -> Scale:
        return Scale(
            self.ratio / other.ratio,
            self.power / other.power,
            self.ratio_law / other.ratio_law,
            self.power_law / other.power_law,
        )

    def agrees(self, other: Scale) -> bool:
        """Whether both are the same but for rounding."""
        return math.isclose(self.ratio, other.ratio, rel_tol=SAME) and math.isclose(
            self.power, other.power, rel_tol=SAME
        )


class Clusters:
    """Nodes that turn at fixed ratios, in groups that grow together; a scale is to the first node of its group."""

    def __init__(self, nodes: Iterable[int]) -> None:
        self._of = {node: (node, Scale()) for node in nodes}
        self._members = {node: [node] for node in self._of}

    def __contains__(self, node: int) -> bool:
        return node in self._of

    def __getitem__(self, node: int) -> tuple[int, Scale]:
        """First node of the group, and the scale of the node to it."""
        return self._of[node]

    def members(self, node: int) -> tuple[int, ...]:
        """The group of a node, in the order of the nodes."""
        return tuple(sorted(self._members[self._of[node][0]]))

    def join(self, node: int, other: int, scale: Scale) -> None:
        """Make one group of two apart, where `scale` is that of `node` to `other`."""
        (first, from_first), (second, to_second) = self._of[node], self._of[other]
        ratio = scale * to_second / from_first
        if len(self._members[first]) > len(self._members[second]):
            first, second, ratio = second, first, Scale() / ratio
        for member in self._members.pop(first):
            self._of[member] = (second, self._of[member][1] * ratio)
            self._members[second].append(member)

    def lock(self, node: int) -> None:
        """Take out a group whose speed is zero, which has no ratio to anything."""
        for member in self._members.pop(self._of[node][0]):
            del self._of[member]


@dataclass(frozen=True)
class Term:
    """A node in a row.

    Args:
        node: its number.
        factor: of its speed.
        law: the factor in the symbols of the network.
        power: what share of its power arrives at the nodes whose share is 1; of ideal parts 1 everywhere.
        power_law: the share in the symbols of the network.
    """

    node: int
    factor: float
    law: Expr
    power: float = 1.0
    power_law: Expr = S.One


@dataclass(frozen=True)
class SpeedConstraint:
    """Sum of factor * speed over nodes is zero: what a rigid part demands."""

    part: str
    terms: tuple[Term, ...]


@dataclass(frozen=True, eq=False)
class Kinematics:
    """What is rigid in a network and what turns at which ratio.

    Args:
        rigid: nodes in groups that rigid parts make one shaft.
        shafts: nodes in groups at one ratio, whatever is between them: the whole train, where there is one.
        absorbed: places of the rigid parts, which are in the ratios and need no place in a referred network.
        problems: what has no ratio.
    """

    rigid: Clusters
    shafts: Clusters
    absorbed: tuple[int, ...]
    problems: tuple[Diagnostic, ...]


def kinematics(graph: CircuitGraph, drives: Mapping[str, str]) -> Kinematics:
    """The ratios of a network.

    Args:
        graph: of the network.
        drives: by name of a lossy gear, the side "a" or "b" that drives; by default that of the sources.
    """
    moving = [node for node, domain in enumerate(graph.domains) if domain is not ELECTRICAL]
    absorbed = tuple(place for place, part in enumerate(graph.parts) if _is_rigid(graph, part))
    parts = [graph.parts[place] for place in absorbed]
    rows = [_row(graph, graph.branches[index]) for part in parts for index in part.branches]
    lossless = _joined(Clusters(moving), rows, [])
    problems: list[Diagnostic] = []
    for number, row in enumerate(rows):
        part = next(part for part in parts if part.name == row.part)
        if isinstance(part.component, LossyGear):
            lossy = _with_loss(graph, part, row, drives.get(part.name), lossless)
            problems += [lossy] if isinstance(lossy, Diagnostic) else []
            rows[number] = row if isinstance(lossy, Diagnostic) else lossy
    if problems:
        return Kinematics(lossless, lossless, absorbed, tuple(problems))
    rigid, shafts = _joined(Clusters(moving), rows, problems), _joined(Clusters(moving), rows, [])
    for place, part in enumerate(graph.parts):
        if place not in absorbed:
            problems += _along(graph, part, shafts)
    return Kinematics(rigid, shafts, absorbed, tuple(problems))


def _is_rigid(graph: CircuitGraph, part: GraphPart) -> bool:
    """Whether a part is nothing but a rigid connection between mechanical nodes; a lossy gear is that at any moment."""
    branches = [graph.branches[index] for index in part.branches]
    mechanical = all(graph.domains[node] is not ELECTRICAL for node in part.nodes.values() if node != GROUND)
    rigid = bool(branches) and mechanical and all(branch.template.kind is Kind.COUPLING for branch in branches)
    return rigid and (not part.modes or isinstance(part.component, LossyGear))


def _row(graph: CircuitGraph, branch: GraphBranch) -> SpeedConstraint:
    """The speeds of a coupling, each node once."""
    factors: dict[int, Expr] = {}
    for coefficient, plus, minus in branch.terms:
        named = graph.in_network_symbols(coefficient, branch)
        for node, factor in ((plus, named), (minus, -named)):
            factors[node] = factors.get(node, 0) + factor
    values = {symbol: Float(graph.parameters[symbol.name]) for law in factors.values() for symbol in law.free_symbols}
    terms = (Term(node, float(law.xreplace(values)), law) for node, law in factors.items() if node != GROUND)
    return SpeedConstraint(graph.part_of(branch.index).name, tuple(term for term in terms if term.factor))


def _with_loss(
    graph: CircuitGraph, gear: GraphPart, row: SpeedConstraint, side: str | None, moving: Clusters
) -> SpeedConstraint | Diagnostic:
    """The row of a lossy gear with what its driving side loses."""
    port = side or _driving_side(graph, gear, moving)
    if isinstance(port, Diagnostic):
        return port
    back = port == "b" and getattr(gear.component, "efficiency_back", None) is not None
    name = "efficiency_back" if back else "efficiency"
    share = float(gear.component.declared[name].magnitude(getattr(gear.component, name))[0])
    if share <= 0:
        return Diagnostic(
            "self-locking gear",
            f"LossyGear '{gear.name}' cannot be driven from its side b: {name} = {share:g}.",
            f"Where a drives, say so: drives={{'{gear.name}': 'a'}}.",
            (gear.name,),
        )
    driving, law = gear.nodes[port], graph.symbol_of(gear, name)
    terms = (replace(term, power=share, power_law=law) if term.node == driving else term for term in row.terms)
    return SpeedConstraint(row.part, tuple(terms))


def _driving_side(graph: CircuitGraph, gear: GraphPart, moving: Clusters) -> str | Diagnostic:
    """The side of a lossy gear on which every motor and source is."""
    sources_at: dict[str, list[str]] = {}
    for port in ("a", "b"):
        nodes = _beyond(graph, gear, gear.nodes[port], moving)
        sources_at[port] = [part.name for part in graph.parts if nodes & _gives_at(graph, part)]
    if bool(sources_at["a"]) != bool(sources_at["b"]):
        return "a" if sources_at["a"] else "b"
    why = "no source says which way that is"
    if round_it := [name for name in sources_at["a"] if name in sources_at["b"]]:
        why = f"it lies in a loop: {listed(round_it)} drives it from both of its sides"
    elif sources_at["a"]:
        why = f"sources are on both sides ({listed(sources_at['a'])}; {listed(sources_at['b'])})"
    return Diagnostic(
        "direction of power",
        f"LossyGear '{gear.name}' loses its share on the way of the power, and {why}.",
        f"Say which side drives: drives={{'{gear.name}': 'a'}}.",
        (gear.name,),
    )


def _gives_at(graph: CircuitGraph, part: GraphPart) -> set[int]:
    """The mechanical nodes at which a part may give power of its own, or from a circuit; only intersected."""
    nodes = [node for node in part.nodes.values() if node != GROUND]
    mechanical = {node for node in nodes if graph.domains[node] is not ELECTRICAL}
    return mechanical if part.component.role == "source" or len(mechanical) < len(nodes) else set()


def _beyond(graph: CircuitGraph, gear: GraphPart, start: int, moving: Clusters) -> set[int]:
    """The moving nodes that are joined to one of a gear without passing it; only intersected."""
    joints = nx.Graph()
    joints.add_node(start)
    for part in graph.parts:
        if part is not gear:
            nx.add_path(joints, [node for node in part.nodes.values() if node == start or node in moving])
    return set(nx.node_connected_component(joints, start))


def _joined(clusters: Clusters, rows: Sequence[SpeedConstraint], problems: list[Diagnostic]) -> Clusters:
    """Join nodes by rows of two, again and again, since rows of three become rows of two as others are joined."""
    waiting = list(rows)
    while True:
        left = [row for row in waiting if not _settled(clusters, row, problems)]
        if len(left) == len(waiting):
            problems += (_differential(clusters, row) for row in left)
            return clusters
        waiting = left


def _settled(clusters: Clusters, row: SpeedConstraint, problems: list[Diagnostic]) -> bool:
    """Whether a row is used up: it held a group at rest, joined two, or said what was known."""
    groups: dict[int, list[tuple[Term, Scale]]] = {}
    for term in row.terms:
        if term.node in clusters:
            first, scale = clusters[term.node]
            groups.setdefault(first, []).append((term, scale))
    if len(groups) > 2:
        return False
    if not all(_shares_agree(group) for group in groups.values()):
        problems.append(_two_ratios(row))
    elif len(groups) == 2:
        (a, of_a), (b, of_b) = groups.items()
        (sum_a, law_a), (sum_b, law_b) = _speed(of_a), _speed(of_b)
        if not (sum_a and sum_b):  # members that turn against each other hold the third
            clusters.lock(of_a[0][0].node if sum_a else of_b[0][0].node)
            return True
        clusters.join(a, b, Scale(-sum_b / sum_a, 1.0, -law_b / law_a) * _power(*of_a[0]) / _power(*of_b[0]))
    elif groups:
        (group,) = groups.values()
        if len(group) == 1:
            clusters.lock(group[0][0].node)
        elif not _turns(group):
            problems.append(_two_ratios(row))
    return True


def _speed(group: Sequence[tuple[Term, Scale]]) -> tuple[float, Expr]:
    """The factor of the first node's speed in a row, as a number and in symbols."""
    number = sum(term.factor * scale.ratio for term, scale in group)
    return number, sum(term.law * scale.ratio_law for term, scale in group)


def _power(term: Term, scale: Scale) -> Scale:
    """The share of a row's power that a term gets, against the first node of its group."""
    return Scale(1.0, term.power / scale.power, power_law=term.power_law / scale.power_law)


def _shares_agree(group: Sequence[tuple[Term, Scale]]) -> bool:
    shares = [_power(term, scale).power for term, scale in group]
    return all(math.isclose(share, shares[0], rel_tol=SAME) for share in shares)


def _turns(group: Sequence[tuple[Term, Scale]]) -> bool:
    """Whether a row between nodes of known ratios says the same as they do."""
    parts = [term.factor * scale.ratio for term, scale in group]
    return abs(sum(parts)) <= SAME * sum(map(abs, parts))


def _two_ratios(row: SpeedConstraint) -> Diagnostic:
    return Diagnostic(
        "two ratios",
        f"'{row.part}' closes a loop of gears round which ratios or losses differ, so that its shafts have two ratios.",
        "Make the ratios round the loop agree, or take the part out.",
        (row.part,),
    )


def _differential(clusters: Clusters, row: SpeedConstraint) -> Diagnostic:
    return Diagnostic(
        "differential",
        f"'{row.part}' has no fixed member: {sum(term.node in clusters for term in row.terms)} of its shafts turn, and "
        "none of them has a ratio to another one alone.",
        "Hold a member with a Ground or join two by a gear; a brake that may slip is no fixed member.",
        (row.part,),
    )


def _along(graph: CircuitGraph, part: GraphPart, shafts: Clusters) -> Iterator[Diagnostic]:
    """A spring, a gap or any part that stays joins nodes of one ratio."""
    nodes = [node for node in part.nodes.values() if node in shafts]
    for node in nodes[1:]:
        (first, scale), (second, other) = shafts[nodes[0]], shafts[node]
        if first != second:
            shafts.join(nodes[0], node, Scale())
        elif not scale.agrees(other):
            here, there = graph.node_name(nodes[0]), graph.node_name(node)
            yield Diagnostic(
                "two ratios",
                f"'{part.name}' closes a loop: by the way round it, {_difference(scale, other, here, there)}.",
                "No one ratio refers a shaft that its own gears twist; take the part out, or leave the train as it is.",
                (part.name,),
                (here, there),
            )


def _difference(scale: Scale, other: Scale, here: str, there: str) -> str:
    """In what two scales differ, in as many digits as it takes to see that."""
    if not math.isclose(scale.ratio, other.ratio, rel_tol=SAME):
        return f"node '{here}' turns {_unlike_one(scale.ratio / other.ratio)} times as fast as node '{there}'"
    share = _unlike_one(scale.power / other.power)
    return f"power at node '{here}' counts {share} times what it does at node '{there}'"


def _unlike_one(value: float) -> str:
    shown = (f"{value:.{digits}g}" for digits in range(6, 18))
    return next(text for text in shown if float(text) != 1.0)
