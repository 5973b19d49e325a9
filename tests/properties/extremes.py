"""Random linear networks whose parameters lie many decades apart, and what a run of the library makes of them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from shaftwork import AccuracyWarning
from shaftwork.core.errors import ShaftworkError
from tests.properties.examples import Array, across_signals, compiled, network_of, through_signals
from tests.reference.balls import respond
from tests.reference.mna import GROUND, Piece, Response
from tests.strategies import BASE, Network, Step, build

LOWEST, HIGHEST = 1e-12, 1e12
"""Every parameter lies between these, in its SI unit."""
RIGHT = 1e-6
"""A value is right to this part of the largest of its kind in the run."""
MOVES = (*BASE, "planetary", "drum", "travel", "mesh", "closing_gear", "more_inertia", "circuit", "machine")
PARTS_OF_RUN = (0.0, 1e-6, 1e-3, 0.1, 1 / 3, 0.5, 0.9, 1.0)


@dataclass(frozen=True)
class Extreme:
    """A network, its start values by the referee's names and by the library's, and the end of the run in s."""

    pieces: Network
    stores: Mapping[str, float]
    initial: Mapping[str, float]
    end: float

    @property
    def times(self) -> Array:
        """Output times, s."""
        return self.end * np.array(PARTS_OF_RUN)


def extreme(seed: int) -> Extreme:
    """The network of a number: half of them spread all rates and impedances, half have one to three wild values."""
    rng = np.random.default_rng(seed)
    steps = [
        Step(
            str(rng.choice(MOVES)),
            int(rng.integers(64)),
            int(rng.integers(64)),
            (bool(rng.integers(2)), bool(rng.integers(2)), bool(rng.integers(2))),
            tuple(int(mark) for mark in rng.integers(180, size=4)),
        )
        for _ in range(int(rng.integers(1, 7)))
    ]
    pieces = build(steps, max_inertias=8, dependent=True)
    pieces, slow, fast = _spread(rng, pieces) if rng.random() < 0.5 else _wild(rng, pieces)
    stores, initial = _starts(rng, pieces)
    return Extreme(pieces, stores, initial, float(10.0 ** rng.uniform(np.log10(0.1 / fast), np.log10(10 / slow))))


def _spread(rng: np.random.Generator, pieces: Network) -> tuple[Network, float, float]:
    """Every part has a rate and an impedance of its own; their logarithms are uniform over widths drawn before."""
    rate, width = 10.0 ** rng.uniform(-3, 3), rng.uniform(0, 15)
    impedance, decades = 10.0 ** rng.uniform(-3, 3), rng.uniform(0, 10)

    def values(piece: Piece) -> dict[str, float]:
        r, Z = (
            rate * 10.0 ** rng.uniform(-width / 2, width / 2),
            impedance * 10.0 ** rng.uniform(-decades / 2, decades / 2),
        )
        by_name = {"J": Z / r, "m": Z / r, "c": Z * r, "d": Z, "R": Z, "L": Z / r, "C": 1 / (Z * r), "k": Z}
        by_name |= dict.fromkeys(("tau", "f", "omega", "u", "i"), float(10.0 ** rng.uniform(-1, 2)))
        if piece.type in ("Spring", "TranslationalSpring"):
            by_name["d"] = Z * 10.0 ** rng.uniform(-3, 3)
        return {name: float(np.clip(by_name.get(name, value), LOWEST, HIGHEST)) for name, value in piece.values.items()}

    changed = tuple(Piece(p.type, p.name, p.nodes, values(p)) for p in pieces)
    return changed, rate * 10.0 ** (-width / 2), rate * 10.0 ** (width / 2)


def _wild(rng: np.random.Generator, pieces: Network) -> tuple[Network, float, float]:
    """One to three values of an ordinary train are anything between the bounds."""
    places = [(k, name) for k, p in enumerate(pieces) for name in p.values if name not in ("ratio", "radius")]
    changed = list(pieces)
    for place in rng.permutation(len(places))[: rng.integers(1, 4)]:
        k, name = places[place]
        value = float(10.0 ** rng.uniform(np.log10(LOWEST), np.log10(HIGHEST)))
        changed[k] = Piece(changed[k].type, changed[k].name, changed[k].nodes, {**changed[k].values, name: value})
    return tuple(changed), 1e-2, 1e2


def _starts(rng: np.random.Generator, pieces: Network) -> tuple[dict[str, float], dict[str, float]]:
    """Start values of stores that no coupling, prescribed speed or neighbour binds; none in half of the networks."""
    stores: dict[str, float] = {}
    initial: dict[str, float] = {}
    if rng.random() < 0.5:
        return stores, initial
    bound = [
        n
        for p in pieces
        for n in p.nodes
        if p.type in ("Gear", "PlanetaryGear", "Drum", "SpeedSource", "Wheel", "DCMachine")
    ]
    heavy = [p.nodes[0] for p in pieces if p.type in ("Inertia", "Mass")]
    springs = [n for p in pieces if p.type in ("Spring", "TranslationalSpring") for n in p.nodes if n != GROUND]
    for p in pieces:
        value = float(rng.normal())
        if p.type == "Inertia" and p.nodes[0] not in bound and heavy.count(p.nodes[0]) == 1:
            stores[f"{p.nodes[0]}.across"], initial[f"{p.name}.omega"] = value, value
        if p.type == "Spring" and all(n == GROUND or n in heavy or springs.count(n) == 1 for n in p.nodes):
            stores[f"{p.name}.store"], initial[f"{p.name}.tau_c"] = value, value
    return stores, initial


@dataclass(frozen=True)
class Outcome:
    """What a run came to: "right", "said" (it warned), "refused" or "silent" (wrong without a word), and the error."""

    verdict: str
    error: float
    engine: str
    message: str = ""


def reference(case: Extreme) -> Response:
    """The exact response."""
    return respond(case.pieces, case.times, case.stores)


def outcome(case: Extreme, response: Response, engine: str = "auto", **options: object) -> Outcome:
    """Run a network with an engine and compare every speed and every torque."""
    wanted = across_signals(case.pieces, response) | dict(through_signals(case.pieces, response))
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            model = compiled(network_of(case.pieces))
            solution = model.simulate(
                case.end, t_eval=case.times, engine=engine, initial=case.initial or None, **options
            )
            values = {name: solution[name] for name in wanted}
        except ShaftworkError as refusal:
            return Outcome("refused", np.nan, engine, str(refusal))
    error = largest_error(values, wanted)
    words = [str(each.message) for each in said if issubclass(each.category, AccuracyWarning)]
    if words:
        return Outcome("said", error, solution.engine, words[0])
    return Outcome("right" if error <= RIGHT else "silent", error, solution.engine, solution.why)


def largest_error(values: Mapping[str, Array], wanted: Mapping[str, Array]) -> float:
    """The largest error of any quantity, as a part of the largest value of its kind (unit) in the run."""
    worst = 0.0
    for kind in dict.fromkeys(map(_kind, wanted)):
        names = [name for name in wanted if _kind(name) == kind]
        size = max(float(np.abs(wanted[name]).max()) for name in names)
        gap = max(float(np.abs(values[name] - wanted[name]).max()) for name in names)
        if not gap <= 1e-300:
            worst = max(worst, gap / max(size, 1e-300))
    return worst


def _kind(name: str) -> str:
    """The quantity of a signal; grounds of the generator hold shafts."""
    quantity = name.rpartition(".")[2].partition("_")[0]
    return "tau" if quantity == "reaction" else quantity
