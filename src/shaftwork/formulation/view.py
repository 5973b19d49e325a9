"""The state form with names for what is in it, in drive-train words: for messages about its equations."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from shaftwork.components.branches import ACROSS
from shaftwork.core.domains import Domain
from shaftwork.formulation.form import StateForm
from shaftwork.network.graph import GROUND, ends_of
from shaftwork.network.kinds import Kind
from shaftwork.network.netlist import Spelling, title


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


def words_of(domain: Domain) -> Words:
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
        return next((words_of(self.graph.domains[node]) for node in nodes), _WORDS["rotation"])
