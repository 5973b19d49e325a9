"""The referee: modified nodal analysis of a drive train, without any elimination.

The library chooses states by a normal tree and eliminates the rest; the referee does neither, so a shared mistake is
unlikely. Every node speed, every torque and every current is an unknown of one descriptor system E z' = A z + B u(t):
a row of balance for each node, a row of law for each part.

``simulate`` is exact: the quasi-Weierstrass form of the whole system (``pencil``) and one matrix exponential of the
state and its inputs together. ``nonlinear.simulate_nonlinear`` gives the same form to SUNDIALS IDA.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.linalg import block_diag, expm

from tests.reference.pencil import RANK_TOLERANCE, Array, Descriptor, IllPosedError, Reduced, reduce

GROUND = "ground"

TERMINALS: dict[str, tuple[str, ...]] = {
    "Inertia": ("rotor",),
    "Mass": ("body",),
    "Spring": ("a", "b"),
    "TranslationalSpring": ("a", "b"),
    "Damper": ("a", "b"),
    "TranslationalDamper": ("a", "b"),
    "Ground": ("node",),
    "Gear": ("a", "b"),
    "PlanetaryGear": ("sun", "carrier", "ring"),
    "Drum": ("rotation", "translation"),
    "Wheel": ("rotation", "translation"),
    "Resistor": ("p", "n"),
    "Inductor": ("p", "n"),
    "Capacitor": ("p", "n"),
    "VoltageSource": ("p", "n"),
    "CurrentSource": ("p", "n"),
    "DCMachine": ("p", "n", "rotor"),
    "TorqueSource": ("node",),
    "ForceSource": ("node",),
    "SpeedSource": ("node",),
}
CAPACITY = {"Inertia": "J", "Mass": "m", "Capacitor": "C"}
STORE = {"Spring": "store", "TranslationalSpring": "store", "Inductor": "through", "DCMachine": "store"}
SOURCE_VALUE = {
    "VoltageSource": "u",
    "CurrentSource": "i",
    "TorqueSource": "tau",
    "ForceSource": "f",
    "SpeedSource": "omega",
}


@dataclass(frozen=True)
class Piece:
    """One part of a network: type, name, nodes in the order of ``TERMINALS``, parameters in SI units."""

    type: str
    name: str
    nodes: tuple[str, ...]
    values: Mapping[str, Any]


@dataclass(frozen=True)
class Signal:
    """u(t) = row . w(t) with w' = matrix w and w(0) = start: constants, ramps, harmonics and exponentials, exactly."""

    matrix: Array
    row: Array
    start: Array


def constant(value: float) -> Signal:
    """A step at t = 0 to ``value``."""
    return Signal(np.zeros((1, 1)), np.ones(1), np.array([value]))


def ramp(rate: float) -> Signal:
    """u(t) = rate * t."""
    return Signal(np.array([[0.0, 1.0], [0.0, 0.0]]), np.array([rate, 0.0]), np.array([0.0, 1.0]))


def sine(amplitude: float, omega: float) -> Signal:
    """u(t) = amplitude * sin(omega * t)."""
    return Signal(np.array([[0.0, omega], [-omega, 0.0]]), np.array([amplitude, 0.0]), np.array([0.0, 1.0]))


def rise(amplitude: float, rate: float) -> Signal:
    """u(t) = amplitude * (1 - exp(-rate * t)): a smooth start that is consistent with rest."""
    return Signal(np.diag([0.0, -rate]), np.array([amplitude, -amplitude]), np.ones(2))


@dataclass(frozen=True)
class Response:
    """Histories by name: ``across[node]`` and ``through["part.through"]``, which the (first) node gives to the part.

    A coupling or machine has one ``part.through_terminal`` for each terminal; the state of a spring (its torque without
    damping) and of a machine (its current) is ``part.store``.
    """

    t: Array
    across: dict[str, Array]
    through: dict[str, Array]
    undetermined: tuple[str, ...]


class _Stamper:
    """Collects unknowns and rows; a coefficient is added to, never overwritten."""

    def __init__(self) -> None:
        self.index: dict[str, int] = {}
        self.balance: dict[str, dict[str, float]] = {}
        self.rows: list[tuple[dict[str, float], dict[str, float], dict[str, float]]] = []
        self.sources: list[str] = []

    def unknown(self, name: str) -> str:
        self.index.setdefault(name, len(self.index))
        return name

    def across(self, node: str, factor: float = 1.0) -> dict[str, float]:
        return {} if node == GROUND else {self.unknown(f"{node}.across"): factor}

    def gap(self, nodes: tuple[str, ...], factor: float = 1.0) -> dict[str, float]:
        """Across variable of the first node over the second one, or over ground."""
        a, b = (*nodes, GROUND)[:2]
        return {} if a == b else self.across(a, factor) | self.across(b, -factor)

    def leave(self, node: str, through: str, factor: float = 1.0) -> None:
        """The node gives factor * through to a part."""
        if node != GROUND:
            self.across(node)
            row = self.balance.setdefault(node, {})
            row[through] = row.get(through, 0.0) + factor

    def branch(self, piece: Piece) -> str:
        """The through variable of a part with one or two terminals."""
        name = self.unknown(f"{piece.name}.through")
        self.leave(piece.nodes[0], name)
        if len(piece.nodes) == 2:
            self.leave(piece.nodes[1], name, -1.0)
        return name

    def law(
        self, now: dict[str, float], rate: dict[str, float] | None = None, source: dict[str, float] | None = None
    ) -> None:
        """The row rate . z' = now . z + source . u."""
        self.rows.append((rate or {}, now, source or {}))

    def matrices(self) -> Descriptor:
        rows = self.rows + [({}, row, {}) for row in self.balance.values()]
        size = len(self.index)
        E, A, B = np.zeros((len(rows), size)), np.zeros((len(rows), size)), np.zeros((len(rows), len(self.sources)))
        column = {name: k for k, name in enumerate(self.sources)}
        for k, (rate, now, source) in enumerate(rows):
            for matrix, entries, places in ((E, rate, self.index), (A, now, self.index), (B, source, column)):
                for name, value in entries.items():
                    matrix[k, places[name]] += value
        return Descriptor(E, A, B, tuple(self.index), tuple(self.sources))


def _across_store(m: _Stamper, p: Piece) -> None:
    m.law({m.branch(p): 1.0}, rate=m.gap(p.nodes, p.values[CAPACITY[p.type]]))


def _spring(m: _Stamper, p: Piece) -> None:
    through, store = m.branch(p), m.unknown(f"{p.name}.store")
    m.law(m.gap(p.nodes, p.values["c"]), rate={store: 1.0})
    m.law({through: -1.0, store: 1.0} | m.gap(p.nodes, p.values.get("d", 0.0)))


def _damper(m: _Stamper, p: Piece) -> None:
    m.law({m.branch(p): -1.0} | m.gap(p.nodes, p.values["d"]))


def _resistor(m: _Stamper, p: Piece) -> None:
    m.law({m.branch(p): -p.values["R"]} | m.gap(p.nodes))


def _inductor(m: _Stamper, p: Piece) -> None:
    m.law(m.gap(p.nodes), rate={m.branch(p): p.values["L"]})


def _coupling(m: _Stamper, p: Piece) -> None:
    """The row sum r_k e_k = 0; its multiplier drives r_k * multiplier into terminal k, so no power is lost."""
    ratio = p.values.get("ratio", p.values.get("radius", 0.0))
    rows = {"Gear": (1.0, -ratio), "PlanetaryGear": (1.0, -(1.0 + ratio), ratio)}
    multiplier = m.unknown(f"{p.name}.multiplier")
    constraint: dict[str, float] = {}
    for terminal, node, r in zip(TERMINALS[p.type], p.nodes, rows.get(p.type, (-ratio, 1.0)), strict=True):
        through = m.unknown(f"{p.name}.through_{terminal}")
        m.leave(node, through)
        m.law({through: -1.0, multiplier: r})
        for name, value in m.across(node, r).items():
            constraint[name] = constraint.get(name, 0.0) + value
    m.law(constraint)


def _machine(m: _Stamper, p: Piece) -> None:
    k, R, L = p.values["k"], p.values.get("R", 0.0), p.values.get("L", 0.0)
    current = m.unknown(f"{p.name}.store")
    for terminal, node, factor in zip(TERMINALS[p.type], p.nodes, (1.0, -1.0, -k), strict=True):
        through = m.unknown(f"{p.name}.through_{terminal}")
        m.leave(node, through)
        m.law({through: -1.0, current: factor})
    m.law({current: -R} | m.gap(p.nodes[:2]) | m.across(p.nodes[2], -k), rate={current: L})


def _source(m: _Stamper, p: Piece) -> None:
    through = m.branch(p)
    m.sources.append(p.name)
    if p.type in ("SpeedSource", "VoltageSource"):
        m.law(m.gap(p.nodes), source={p.name: -1.0})
    else:
        m.law({through: 1.0}, source={p.name: 1.0})


def _ground(m: _Stamper, p: Piece) -> None:
    m.branch(p)
    m.law(m.across(p.nodes[0]))


STAMPS: dict[str, Callable[[_Stamper, Piece], None]] = {
    **dict.fromkeys(CAPACITY, _across_store),
    **dict.fromkeys(("Spring", "TranslationalSpring"), _spring),
    **dict.fromkeys(("Damper", "TranslationalDamper"), _damper),
    **dict.fromkeys(("Gear", "PlanetaryGear", "Drum", "Wheel"), _coupling),
    **dict.fromkeys(SOURCE_VALUE, _source),
    "Resistor": _resistor,
    "Inductor": _inductor,
    "DCMachine": _machine,
    "Ground": _ground,
}


def descriptor(pieces: Sequence[Piece]) -> Descriptor:
    """Every equation of the network, none combined with another."""
    stamper = _Stamper()
    for piece in pieces:
        STAMPS[piece.type](stamper, piece)
    return stamper.matrices()


def spectrum(pieces: Sequence[Piece]) -> np.ndarray[Any, np.dtype[np.complex128]]:
    """Finite eigenvalues in 1/s, ordered by modulus; loops of springs and free bodies contribute zeros."""
    values = np.linalg.eigvals(reduce(descriptor(pieces)).J).astype(complex)
    return values[np.lexsort((values.imag, values.real, np.abs(values)))]


def _signals(pieces: Sequence[Piece], u: Mapping[str, Signal | float] | None) -> list[Signal]:
    given = {p.name: (u or {}).get(p.name, p.values[SOURCE_VALUE[p.type]]) for p in pieces if p.type in SOURCE_VALUE}
    return [value if isinstance(value, Signal) else constant(float(value)) for value in given.values()]


def named(names: tuple[str, ...], determined: Sequence[bool], t: Array, z: Array) -> Response:
    """The histories z of all unknowns, shape (unknown, time), sorted by what they are."""
    across, through = {GROUND: np.zeros_like(t)}, {}
    for name, known, history in zip(names, determined, z, strict=True):
        stem, _, kind = name.rpartition(".")
        if known and kind == "across":
            across[stem] = history
        elif known and kind != "multiplier":
            through[name] = history
    lost = tuple(n for n, known in zip(names, determined, strict=True) if not known and not n.endswith(".multiplier"))
    return Response(t, across, through, lost)


def _output(r: Reduced, row: Array, matrix: Array) -> Array:
    """Return what adds to V x as (this) w in z, for the exosystem w' = matrix w, u = row w."""
    term, total = r.H @ row, np.zeros((r.H.shape[0], matrix.shape[0]))
    for _ in range(r.index + 1):
        total -= term
        term = r.N @ term @ matrix
    return r.W @ total


def simulate(
    pieces: Sequence[Piece],
    u: Mapping[str, Signal | float] | None,
    t: Sequence[float] | Array,
    x0: Mapping[str, float] | None = None,
) -> Response:
    """Exact response at the increasing times t >= 0, by the exponential of the reduced system and its inputs.

    Without ``x0`` everything rests for t < 0 and the sources act from t = 0 on: momentum and flux are kept through
    the jump. ``x0`` gives values at t = 0+ by unknown ("rotor.across", "shaft.store", ...), as many as fix the state.
    ``u`` replaces source values by signals, by the name of the source.
    """
    d = descriptor(pieces)
    r, signals, times = reduce(d), _signals(pieces, u), np.asarray(t, dtype=float)
    matrix = block_diag(np.zeros((0, 0)), *(s.matrix for s in signals))
    row = block_diag(np.zeros((0, 0)), *(s.row[None, :] for s in signals))
    w0 = np.concatenate([np.zeros(0), *(s.start for s in signals)])
    n, output = r.J.shape[0], _output(r, row, matrix)
    state = np.concatenate([np.zeros(n), w0])
    if x0 is not None:
        places = [d.unknowns.index(name) for name in x0]
        target = np.array(list(x0.values())) - output[places] @ w0
        state[:n], _, rank, _ = np.linalg.lstsq(r.V[places], target, rcond=RANK_TOLERANCE)
        if rank < n or not np.allclose(r.V[places] @ state[:n], target, rtol=1e-8, atol=1e-8 * np.abs(target).max()):
            raise IllPosedError("the given start does not fix the state, or contradicts itself")
    generator = np.block([[r.J, r.G @ row], [np.zeros((len(w0), n)), matrix]])
    states, now = [], 0.0
    steps: dict[float, Array] = {}
    for time in times:
        step = float(f"{time - now:.12g}")  # equal steps share one exponential; `now` keeps the rounding from adding up
        if step not in steps:
            steps[step] = expm(generator * step)
        state, now = steps[step] @ state, now + step
        states.append(state)
    z = np.hstack([r.V, output]) @ np.array(states).T
    return named(d.unknowns, r.determined.tolist(), times, z)


def rest_jumps(pieces: Sequence[Piece], u: Mapping[str, Signal | float] | None = None) -> tuple[str, ...]:
    """Stores whose start after a step depends on more than their own zero: where "rest" needs the conservation laws.

    A torque step on a massless node between two springs splits by their stiffness, a voltage step over two capacitors
    by their capacity. Stores that the sources fix altogether (an inertia on a speed source) are not counted.
    """
    d = descriptor(pieces)
    r, response = reduce(d), simulate(pieces, u, [0.0])
    free = {name for name, row in zip(d.unknowns, r.V, strict=True) if np.abs(row).max(initial=0.0) > RANK_TOLERANCE}
    noise = 1e-8 * max(1.0, *(abs(history[0]) for history in response.through.values()))
    found = []
    for p in pieces:
        if p.type in CAPACITY:
            names, value = [f"{n}.across" for n in p.nodes], _across(response, p)[0]
        elif p.type in STORE and p.values.get("L", p.values.get("c", 0.0)) > 0.0:
            names = [f"{p.name}.{STORE[p.type]}"]
            value = response.through.get(names[0], np.zeros(1))[0]
        else:
            continue
        if abs(value) > noise and free.intersection(names):
            found.append(p.name)
    return tuple(found)


def _across(response: Response, p: Piece) -> Array:
    return response.across[p.nodes[0]] - (response.across[p.nodes[1]] if len(p.nodes) == 2 else 0.0)


def stored_energy(pieces: Sequence[Piece], response: Response) -> Array:
    """Energy in all inertias, springs, capacitors and inductors, J, over the times of the response."""
    total = np.zeros_like(response.t)
    for p in pieces:
        if p.type in CAPACITY:
            total += 0.5 * p.values[CAPACITY[p.type]] * _across(response, p) ** 2
        elif p.type in STORE:
            compliance = 1.0 / p.values["c"] if "c" in p.values else p.values.get("L", 0.0)
            total += 0.5 * compliance * response.through[f"{p.name}.{STORE[p.type]}"] ** 2
    return total
