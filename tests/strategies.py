"""Random networks for hypothesis: well posed by construction, and broken on purpose.

A network is a list of self-contained steps; each adds parts at nodes picked by number, so hypothesis shrinks it by
deleting steps and lowering numbers. What keeps every network well posed, and its start from rest unambiguous:

- any motion that the couplings allow moves a store or a loss: a new node comes with one, or is tied by a coupling;
- a coupling joins clusters of rigidly related nodes that were apart, or repeats one that exists, so nothing locks;
- a prescribed speed or voltage has a node of its own, and only springs, losses and a geared inertia touch it;
- torque and force steps act on a store, current steps beside a resistor, so no step divides between springs or coils.

All values are round decimals and span two decades for each kind of part.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

from hypothesis import strategies as st

from tests.reference.mna import GROUND, Piece

Network = tuple[Piece, ...]
RATIOS = (
    2.0,
    0.5,
    3.0,
    1.5,
    2.5,
    0.25,
    4.0,
)  # exact in binary, so that the ratios around a loop of gears multiply exactly
RADII = (0.1, 0.125, 0.2, 0.25, 0.5)
# power of ten of the smallest value of each parameter
LOWEST = {"J": -1, "m": 0, "c": 2, "d": -1, "R": 0, "L": -2, "C": -4, "k": -1}
LOWEST |= {"tau": 0, "f": 0, "omega": -1, "u": 0, "i": -1}
TRANSLATION_LOWEST = {"c": 3, "d": 0}
SHORT = {
    "Inertia": "J",
    "Mass": "m",
    "TorqueSource": "motor",
    "PlanetaryGear": "planetary",
    "TranslationalSpring": "rope",
}


@dataclass(frozen=True)
class Step:
    """One move: where it starts, where else it may go, three choices, and the numbers of its parameters."""

    move: str
    at: int
    to: int
    flags: tuple[bool, bool, bool]
    marks: tuple[int, ...]


@dataclass
class Builder:
    """The network so far, with the nodes that may be grown on, by domain."""

    max_inertias: int
    dependent: bool
    pieces: list[Piece] = field(default_factory=list)
    rotation: list[str] = field(default_factory=list)
    translation: list[str] = field(default_factory=list)
    electrical: list[str] = field(default_factory=list)
    heavy: list[str] = field(default_factory=list)
    supplies: list[str] = field(default_factory=list)
    cluster: dict[str, int] = field(default_factory=dict)
    scale: dict[str, float] = field(default_factory=dict)
    count: dict[str, int] = field(default_factory=dict)
    marks: tuple[int, ...] = ()
    used: int = 0

    def number(self, stem: str) -> str:
        self.count[stem] = self.count.get(stem, 0) + 1
        return f"{stem}{self.count[stem]}"

    def mark(self) -> int:
        self.used += 1
        return self.marks[self.used % len(self.marks)]

    def add(self, kind: str, *nodes: str, names: str = "", **values: float) -> None:
        """Add a part; the parameters called by a letter in ``names`` get the step's next numbers."""
        for key in names.split():
            translational = kind in ("TranslationalSpring", "TranslationalDamper")
            lowest, mark = (TRANSLATION_LOWEST if translational else LOWEST)[key], self.mark()
            values[key] = float(f"{10 + mark % 90}e{lowest - 1 + mark // 90}")
        self.pieces.append(Piece(kind, self.number(SHORT.get(kind, kind.lower())), nodes, values))
        if kind in ("Inertia", "Mass"):
            self.heavy.append(nodes[0])

    def node(self, domain: list[str], stem: str, like: str = "") -> str:
        """A new node; ``like`` is the node that a coupling ties it to."""
        name = self.number(stem)
        domain.append(name)
        self.cluster[name] = self.cluster[like] if like else len(self.cluster)
        self.scale[name] = self.scale.get(like, 1.0)
        return name

    def spring(self, a: str, b: str, *, damped: bool) -> None:
        self.add("Spring", a, b, names="c d" if damped else "c")

    def rotor(self, *, like: str = "") -> str:
        name = self.node(self.rotation, "r", like)
        self.add("Inertia", name, names="J")
        return name

    def full(self) -> bool:
        return sum(p.type in ("Inertia", "Mass") for p in self.pieces) >= self.max_inertias - 1

    def gear(self, a: str, b: str) -> None:
        """A gear to the new node b; it is turned so that referred inertias stay within moderate ratios."""
        ratio = RATIOS[self.mark() % len(RATIOS)]
        if not 0.2 < self.scale[a] / ratio < 5.0:
            ratio = 1.0 / ratio if ratio in (2.0, 0.5, 0.25, 4.0) else 1.0
        self.add("Gear", a, b, ratio=ratio)
        self.scale[b] = self.scale[a] / ratio

    def join(self, a: str, b: str) -> None:
        old, new = self.cluster[b], self.cluster[a]
        self.cluster = {name: new if group == old else group for name, group in self.cluster.items()}


def _pick(names: list[str], index: int) -> str:
    return names[index % len(names)]


def _fallback(b: Builder, s: Step) -> None:
    b.add("Damper", _pick(b.rotation, s.at), GROUND, names="d")


def _spring(b: Builder, s: Step) -> None:
    b.spring(_pick(b.rotation, s.at), b.rotor(), damped=s.flags[0])


def _damper(b: Builder, s: Step) -> None:
    b.add("Damper", _pick(b.rotation, s.at), b.rotor(), names="d")


def _series(b: Builder, s: Step) -> None:
    """A massless node between springs, or between a spring and a damper, or with a third spring."""
    start, between = _pick(b.rotation, s.at), b.number("r")
    b.spring(start, between, damped=s.flags[0])
    if s.flags[2]:
        b.add("Damper", between, b.rotor(), names="d")
    elif b.dependent or s.flags[0]:
        b.spring(between, b.rotor(), damped=s.flags[1])
        if s.at % 2:
            b.spring(between, _pick(b.rotation, s.to), damped=False)
    else:
        b.spring(between, b.rotor(), damped=True)


def _gear(b: Builder, s: Step) -> None:
    start = _pick(b.rotation, s.at)
    if b.dependent and s.flags[0]:
        b.gear(start, end := b.rotor(like=start))
    else:
        end = b.node(b.rotation, "r", start)
        b.gear(start, end)
        b.spring(end, b.rotor(), damped=s.flags[1])
    if b.dependent and s.flags[2]:
        gear = next(p for p in reversed(b.pieces) if p.type == "Gear")
        other = b.rotor(like=end)
        b.add("Gear", end, other, ratio=2.0)
        b.add("Gear", start, other, ratio=2.0 * gear.values["ratio"])
        b.scale[other] = b.scale[end] / 2.0


def _planetary(b: Builder, s: Step) -> None:
    sun = _pick(b.rotation, s.at)
    carrier = b.rotor(like=sun) if b.dependent or s.flags[1] else b.node(b.rotation, "r", sun)
    if s.flags[0]:
        ring = GROUND if s.flags[1] else b.number("r")
        if ring != GROUND:
            b.add("Ground", ring)
    else:
        ring = b.node(b.rotation, "r", sun)
        if b.dependent and s.flags[2]:
            b.add("Inertia", ring, names="J")
        else:
            b.add("Damper", ring, GROUND, names="d")
    if carrier not in b.heavy:
        b.spring(carrier, b.rotor(), damped=True)
    b.add("PlanetaryGear", sun, carrier, ring, ratio=(1.5, 2.0, 3.0)[b.mark() % 3])


def _closing_gear(b: Builder, s: Step) -> None:
    start, end = _pick(b.rotation, s.at), _pick(b.rotation, s.to)
    if b.cluster[start] == b.cluster[end]:
        return _fallback(b, s)
    b.add("Gear", start, end, ratio=RATIOS[s.marks[0] % len(RATIOS)])
    return b.join(start, end)


def _mesh(b: Builder, s: Step) -> None:
    start, end = _pick(b.rotation, s.at), _pick(b.rotation, s.to)
    if start == end:
        end = GROUND
    if s.flags[0]:
        b.spring(start, end, damped=s.flags[1])
    else:
        b.add("Damper", start, end, names="d")
    if b.dependent and s.flags[0] and s.flags[2]:
        b.spring(start, end, damped=not s.flags[1])


def _frame(b: Builder, s: Step) -> None:
    wall = b.number("r")
    b.add("Ground", wall)
    b.spring(_pick(b.rotation, s.at), wall, damped=s.flags[0])


def _more_inertia(b: Builder, s: Step) -> None:
    b.add("Inertia", _pick(b.rotation, s.at), names="J")


def _parallel_gear(b: Builder, s: Step) -> None:
    gears = [p for p in b.pieces if p.type == "Gear"]
    if not gears:
        return _fallback(b, s)
    twin = gears[s.at % len(gears)]
    return b.add("Gear", *twin.nodes, **twin.values)


def _torque(b: Builder, s: Step) -> None:
    rotors = [n for n in b.heavy if n in b.rotation]
    b.add("TorqueSource", _pick(rotors, s.at), names="tau")


def _speed(b: Builder, s: Step) -> None:
    driven = output = b.number("r")
    b.add("SpeedSource", driven, names="omega")
    if b.dependent and s.flags[0]:
        output = b.number("r")
        b.add("Gear", driven, output, ratio=RATIOS[b.mark() % len(RATIOS)])
    if b.dependent and s.flags[1]:
        b.add("Inertia", output, names="J")
    if s.flags[2]:
        b.add("Damper", output, _pick(b.rotation, s.at), names="d")
    else:
        b.spring(output, _pick(b.rotation, s.at), damped=s.flags[0])


def _drum(b: Builder, s: Step) -> None:
    shaft = _pick(b.rotation, s.at)
    rope = b.node(b.translation, "x", shaft)
    b.add("Wheel" if s.flags[0] else "Drum", shaft, rope, radius=RADII[b.mark() % len(RADII)])
    if b.dependent and s.flags[1]:
        b.add("Mass", rope, names="m")
    else:
        load = b.node(b.translation, "x")
        b.add("TranslationalSpring", rope, load, names="c d" if s.flags[2] else "c")
        b.add("Mass", load, names="m")


def _travel(b: Builder, s: Step) -> None:
    """A further mass, a rope between two places, a damper to the track or a force; first of all a drum."""
    if not b.translation:
        return _drum(b, s)
    start, end = _pick(b.translation, s.at), _pick(b.translation, s.to)
    masses = [n for n in b.heavy if n in b.translation]
    if s.flags[0] and not b.full():
        b.add("TranslationalSpring", start, load := b.node(b.translation, "x"), names="c d" if s.flags[1] else "c")
        return b.add("Mass", load, names="m")
    if s.flags[1]:
        return b.add("ForceSource", _pick(masses, s.at), names="f")
    if start != end and s.flags[2]:
        return b.add("TranslationalSpring", start, end, names="c")
    return b.add("TranslationalDamper", start, end if start != end else GROUND, names="d")


def _island(b: Builder, s: Step) -> None:
    supply = b.number("e")
    if s.flags[0]:
        b.add("CurrentSource", supply, GROUND, names="i")
        b.add("Resistor", supply, GROUND, names="R")
        b.electrical.append(supply)
        return
    b.add("VoltageSource", supply, GROUND, names="u")
    if b.dependent and s.flags[1]:
        b.add("Capacitor", supply, GROUND, names="C")
    end = b.node(b.electrical, "e")
    b.add("Inductor" if s.flags[2] else "Resistor", supply, end, names="L" if s.flags[2] else "R")
    b.add("Resistor", end, GROUND, names="R")


def _circuit(b: Builder, s: Step) -> None:
    """Resistors, coils and capacitors between old and new nodes, loops of capacitors, cutsets of coils."""
    if not b.electrical:
        return _island(b, s)
    start, end = _pick(b.electrical, s.at), _pick([*b.electrical, GROUND], s.to)
    if start == end:
        end = GROUND
    kind, name = (("Resistor", "R"), ("Inductor", "L"), ("Capacitor", "C"))[s.marks[0] % 3]
    if s.flags[0]:
        between = b.number("e")
        if kind == "Inductor" and b.dependent and s.flags[1]:
            b.add("Inductor", between, GROUND, names="L")
        else:
            b.add("Resistor", between, GROUND, names="R")
            b.electrical.append(between)
        b.add(kind, start, between, names=name)
        return b.add(
            "Inductor" if kind == "Inductor" else "Resistor", between, end, names="L" if kind == "Inductor" else "R"
        )
    b.add(kind, start, end, names=name)
    if b.dependent and kind == "Capacitor":
        b.add("Capacitor", start, GROUND, names="C")
        if end != GROUND and s.flags[1]:
            b.add("Capacitor", end, GROUND, names="C")
    return None


def _machine(b: Builder, s: Step) -> None:
    """A machine with resistance, coil or both; on purpose also an ideal one, which ties a capacitor to an inertia."""
    if not b.electrical:
        _island(b, s)
    p, n = _pick(b.electrical, s.at), _pick([GROUND, *b.electrical], s.to)
    free = [r for r in b.rotation if r in b.heavy]
    armature = " ".join(key for key, wanted in zip("RL", s.flags, strict=False) if wanted)
    if not armature and not b.dependent:
        armature = "R L"
    if not armature:
        n = GROUND
        p = b.number("e")
        b.add("Resistor", _pick(b.electrical, s.at), p, names="R")
        b.add("Capacitor", p, GROUND, names="C")
    b.add("DCMachine", p, n if n != p else GROUND, _pick(free, s.to), names=f"k {armature}")


GROWTH = {"spring": _spring, "damper": _damper, "series": _series, "gear": _gear}
MOVES: dict[str, Callable[[Builder, Step], None]] = {
    **GROWTH,
    "planetary": _planetary,
    "drum": _drum,
    "travel": _travel,
    "mesh": _mesh,
    "closing_gear": _closing_gear,
    "frame": _frame,
    "ground_damper": _fallback,
    "torque": _torque,
    "speed": _speed,
    "more_inertia": _more_inertia,
    "parallel_gear": _parallel_gear,
    "circuit": _circuit,
    "machine": _machine,
}
BASE = ("spring", "damper", "series", "gear", "frame", "ground_damper", "torque", "speed")
ADDS_INERTIAS = (*GROWTH, "planetary", "drum", "more_inertia")


def build(steps: list[Step], *, max_inertias: int = 30, dependent: bool = True) -> Network:
    """The network that the steps describe, from a motor and two inertias with a damped spring between them."""
    b = Builder(max_inertias, dependent, marks=(0, 45, 100, 130))
    first = b.rotor()
    b.add("TorqueSource", first, names="tau")
    b.spring(first, b.rotor(), damped=True)
    for step in steps:
        b.marks, b.used = step.marks, 0
        crowded = step.move in ADDS_INERTIAS and sum(p.type in ("Inertia", "Mass") for p in b.pieces) + 3 > max_inertias
        (_fallback if crowded else MOVES[step.move])(b, step)
    return tuple(b.pieces)


@st.composite
def networks(
    draw: st.DrawFn,
    min_parts: int = 4,
    max_inertias: int = 30,
    *,
    electrical: bool = True,
    translation: bool = True,
    planetaries: bool = True,
    loops: bool = True,
    dependent: bool = True,
) -> Network:
    """A well-posed network of at least ``min_parts`` parts (each step adds one or more) and 2 to ``max_inertias``
    inertias and masses; the switches allow machines and circuits, drums and masses, planetary gears, loops of springs
    and gears, and dependent stores (inertias on both sides of a gear, loops of capacitors, redundant gears and so on).
    """
    moves = list(BASE)
    moves += ["circuit", "machine"] * electrical + ["drum", "travel"] * translation + ["planetary"] * planetaries
    moves += ["mesh", "closing_gear"] * loops + ["more_inertia", "parallel_gear"] * dependent
    where = st.integers(0, 63)
    one = st.builds(
        Step,
        move=st.sampled_from(moves),
        at=where,
        to=where,
        flags=st.tuples(st.booleans(), st.booleans(), st.booleans()),
        marks=st.tuples(*(st.integers(0, 179) for _ in range(4))),
    )
    fewest = max(0, min_parts - 4)
    most = draw(st.integers(fewest, fewest + max_inertias))
    steps = draw(st.lists(one, min_size=most, max_size=most))
    return build(steps, max_inertias=max_inertias, dependent=dependent)
