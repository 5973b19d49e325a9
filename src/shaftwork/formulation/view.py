"""The state form with names for what is in it, in drive-train words: for messages about its equations.

Beside it stand the problems of controlled sources: at which instant what they read is known, and what is wrong where it
is not. A prescribed across variable is known before everything else, so one that reads others may read nothing but
states and what follows from states and sources of time. A through variable may read whatever does not depend on itself.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from shaftwork.components.branches import ACROSS
from shaftwork.core.domains import Domain
from shaftwork.core.errors import Diagnostic
from shaftwork.formulation.form import StateForm
from shaftwork.network.graph import GROUND, Reading, ends_of, readings_of
from shaftwork.network.kinds import Kind
from shaftwork.network.netlist import Spelling, at_nodes, title


@dataclass(frozen=True)
class Words:
    """What an engineer calls the quantities and parts of a domain."""

    across: str
    through: str
    store: str
    spring: str
    loss: str
    remedy: str


_WORDS = {
    "rotation": Words("speed", "torque", "inertia", "spring", "damper", "an Inertia, or a Damper to the frame"),
    "translation": Words("speed", "force", "mass", "spring", "damper", "a Mass, or a TranslationalDamper to the frame"),
    "electrical": Words(
        "voltage", "current", "capacitor", "inductor", "resistor", "a Resistor or a Capacitor to ground"
    ),
}


def domain_words(domain: Domain) -> Words:
    """The words of a domain."""
    return _WORDS.get(domain.name, _WORDS["rotation"])


class View:
    """The state form with names for what is in it."""

    def __init__(self, form: StateForm) -> None:
        self.form, self.graph, self.tree = form, form.graph, form.tree
        self.spelling = Spelling(form.graph.nodes)
        springs = form.tree.tree[Kind.THROUGH_STORE] if any(part.modes for part in form.graph.parts) else ()
        wanted = {*form.tree.tree[Kind.THROUGH_SOURCE], *form.tree.tree[Kind.LAW], *form.tree_conductances, *springs}
        self.moved: dict[int, list[int]] = {branch: [] for branch in wanted}
        for node, row in enumerate(form.tree.potentials if wanted else ()):
            for branch in wanted.intersection(row or ()):
                self.moved[branch].append(node)
        self.cutsets: dict[int, list[int]] = {branch: [] for branch in wanted}
        for link, balance in form.tree.cutsets.items() if wanted else ():
            for branch in wanted.intersection(balance):
                self.cutsets[branch].append(link)

    def kind(self, branch: int) -> Kind:
        """What the law of a branch is."""
        return self.graph.branches[branch].template.kind

    def is_controlled(self, branch: int) -> bool:
        """Whether a law reads other branches of its part, and not what is across its own."""
        template = self.graph.branches[branch].template
        return bool(template.reads) and not template.law.has(ACROSS)

    def parts(self, branches: Iterable[int]) -> tuple[str, ...]:
        """Names of the parts that branches belong to."""
        return tuple(dict.fromkeys(self.graph.part_of(branch).name for branch in branches))

    def titles(self, branches: Iterable[int]) -> str:
        """Parts with their classes, joined as in "A, B and C"."""
        names = list(dict.fromkeys(title(self.graph.part_of(branch).component) for branch in branches))
        shown = names if len(names) <= 8 else [*names[:7], f"{len(names) - 7} more"]
        return " and ".join(filter(None, (", ".join(shown[:-1]), shown[-1])))

    def nodes(self, numbers: Iterable[int]) -> tuple[str, ...]:
        """Names of the nodes that the user has named; of those inside a part only where there are no others."""
        names = tuple(dict.fromkeys(self.graph.nodes[node] for node in numbers if node != GROUND))
        return tuple(name for name in names if "." not in name) or names

    def ends(self, branches: Iterable[int]) -> tuple[str, ...]:
        """The nodes at the ends of branches."""
        edges = (edge for branch in branches for edge in ends_of(self.graph.branches[branch]))
        return self.nodes(node for _, plus, minus in edges for node in (plus, minus))

    def words(self, branch: int) -> Words:
        """The words of the domain in which a branch lies."""
        ends = ends_of(self.graph.branches[branch])
        nodes = (node for _, plus, minus in ends for node in (plus, minus) if node != GROUND)
        return next((domain_words(self.graph.domains[node]) for node in nodes), _WORDS["rotation"])


def reads_itself(view: View, law: int) -> bool:
    """Whether what a law among the links reads depends at the same instant on what it gives."""
    around = view.tree.loops[law] if view.graph.branches[law].template.law.has(ACROSS) else ()
    read = (tree for reading in readings_of(view.graph, law).values() for tree in _tree_branches(view, reading))
    return law in _deciding(view, (*around, *read))


def _tree_branches(view: View, reading: Reading) -> tuple[int, ...]:
    """The tree branches whose across variables make up what is read; of an integral, its rate."""
    match reading:
        case Reading("across", of):
            return () if of == GROUND else tuple(view.tree.potentials[of] or ())
        case Reading("integral", of):
            return tuple(view.tree.loops.get(of, (of,)))
    return ()


def _deciding(view: View, trees: Iterable[int]) -> tuple[int, ...]:
    """Laws and sources that decide the across variables of tree branches together with the states."""
    deciding: dict[int, None] = {}
    left, seen = list(trees), set[int]()
    while left:
        tree = left.pop()
        if tree in seen:
            continue
        seen.add(tree)
        if view.kind(tree) in (Kind.ACROSS_SOURCE, Kind.LAW):
            deciding[tree] = None
        elif view.kind(tree) is Kind.CONDUCTANCE:
            for link in view.cutsets[tree]:
                if view.kind(link) is Kind.CONDUCTANCE:
                    left.extend(view.tree.loops[link])
                elif view.kind(link) is not Kind.THROUGH_STORE:
                    deciding[link] = None
    return tuple(sorted(deciding))


def controlled_problems(view: View) -> Iterator[Diagnostic]:
    """Controlled sources that read what is not known, or that jolt a store."""
    laws = (*view.tree.tree[Kind.LAW], *view.tree.links[Kind.LAW], *view.form.controlled)
    reading = [law for law in sorted(laws) if view.graph.branches[law].template.reads]
    unknown = (
        problem
        for law in reading
        for each in readings_of(view.graph, law).values()
        for problem in _unknown(view, law, each)
    )
    yield from dict.fromkeys(unknown)  # one cause for all windings of a motor
    for law in view.form.controlled:
        yield from _beside_a_store(view, law)
    for law in reading:
        yield from _by_a_current(view, law)


def _unknown(view: View, law: int, reading: Reading) -> Iterator[Diagnostic]:
    trees, words = _tree_branches(view, reading), view.words(law)
    name = title(view.graph.part_of(law).component)
    nodes = view.nodes((reading.of,)) if reading.kind == "across" else view.ends((reading.of,))
    what = f"{name} reads what is across {at_nodes(nodes)}"
    parts = view.parts((law,))
    if series := [tree for tree in trees if view.kind(tree) is Kind.THROUGH_STORE]:
        there = view.words(series[0])
        message = f"{what}, where only {there.spring}s meet: it follows from how fast their {there.through} changes."
        hint = f"Let it read a {there.through}, or put a {there.loss} there."
        yield Diagnostic("controlled source", message, hint, parts, nodes)
    if law in view.form.controlled:
        moving = [k for k in _deciding(view, trees) if view.kind(k) is Kind.LAW or k in view.form.controlled]
        if moving:
            there = _words_for(view, reading)
            message = (
                f"{name} prescribes a {words.across} by the {there.across} of {at_nodes(nodes)}, which has no "
                f"{there.store}: what it reads depends on {view.titles(moving)} at the same instant."
            )
            hint = f"Give the node some {there.store}, so that its {there.across} is a state."
            yield Diagnostic("controlled source", message, hint, view.parts((law, *moving)), nodes)


def _words_for(view: View, reading: Reading) -> Words:
    """The words of the domain in which something is read."""
    return domain_words(view.graph.domains[reading.of]) if reading.kind == "across" else view.words(reading.of)


def _beside_a_store(view: View, law: int) -> Iterator[Diagnostic]:
    """A store whose through variable would be the rate of what a law reads."""
    stores = [link for link in view.tree.links[Kind.ACROSS_STORE] if law in view.tree.loops[link]]
    if stores:
        words = view.words(stores[0])
        message = (
            f"{view.titles((law,))} prescribes the {words.across} of {view.titles(stores)} by what it reads, so that "
            f"the {words.through} would be the rate of that."
        )
        hint = f"Put a {words.loss} or {words.spring} between the two."
        yield Diagnostic("controlled source", message, hint, view.parts((law, *stores)), view.ends(stores))


def _by_a_current(view: View, law: int) -> Iterator[Diagnostic]:
    """A current through a source of voltage that a law reads, and that another law decides at the same instant."""
    currents = {each.of for each in readings_of(view.graph, law).values() if each.kind == "through"}
    through = currents.intersection(view.tree.tree[Kind.ACROSS_SOURCE])
    balances = view.tree.cutsets.items() if through else ()
    # what resists is known after prescribed voltages and before all other laws
    unknown = (Kind.ACROSS_STORE, Kind.LAW, *((Kind.CONDUCTANCE,) if law in view.form.controlled else ()))
    answering = [link for link, row in balances if not through.isdisjoint(row) and view.kind(link) in unknown]
    if answering:
        words = view.words(law)
        message = (
            f"{view.titles((law,))} reads a {words.through} that {view.titles(answering)} decides at the same instant."
        )
        hint = f"It needs a series {words.spring}, so that its {words.through} is a state."
        yield Diagnostic("controlled source", message, hint, view.parts((law, *answering)), view.ends(through))
