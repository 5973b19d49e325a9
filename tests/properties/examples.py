"""How many random networks are tried, and how a list of pieces becomes a network of the library.

``tests/conftest.py`` sets the number for the main comparison; every other property takes the share of it that its cost
allows.
"""

from __future__ import annotations

import signal
import warnings
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from types import FrameType

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from shaftwork import AccuracyWarning, Model, Network, NetworkWarning
from shaftwork.components import REGISTRY
from tests.reference.mna import GROUND, TERMINALS, Piece, Response
from tests.strategies import Network as Pieces

Array = NDArray[np.float64]
QUANTITIES = {"rotation": ("omega", "tau"), "translation": ("v", "f"), "electrical": ("u", "i")}


def share_of_examples(share: float = 1.0) -> settings:
    """Hypothesis settings for a property that is tried on this share of the examples, and on five at least."""
    return settings(max_examples=max(5, round(share * settings().max_examples)))


@contextmanager
def processor_time_limit(seconds: float) -> Iterator[None]:
    """Turn a hang into a failure: far more processor time than anything inside may need, however busy the machine."""

    def give_up(_number: int, _frame: FrameType | None) -> None:
        raise AssertionError(f"still running after {seconds:g} s of processor time")

    before = signal.signal(signal.SIGVTALRM, give_up)
    signal.setitimer(signal.ITIMER_VIRTUAL, seconds, 1.0)  # again, should a callback of an engine swallow the first
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)


def network_of(pieces: Iterable[Piece], name: str = "random train") -> Network:
    """The network of the library for the pieces that the referee reads."""
    net = Network(name)
    for piece in pieces:
        net.add(REGISTRY[piece.type](piece.name, **piece.values), *piece.nodes)
    return net


def compiled(net: Network | Iterable[Piece]) -> Model:
    """The model; a circuit beside the train is worth a warning to a user, but is meant here."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NetworkWarning)
        warnings.simplefilter("ignore", AccuracyWarning)
        return (net if isinstance(net, Network) else network_of(net)).compile()


def quantity_of(name: str) -> str:
    """The quantity of a signal ("gear.tau_a" is a tau), to compare errors with the size of what they are errors of.

    Forces count among the torques: radii are some 0.1 m to 1 m, and behind a drum both stand in one balance.
    """
    quantity = name.rpartition(".")[2].partition("_")[0]
    return "tau" if quantity == "f" else quantity


def _domain(piece: Piece, place: int) -> str:
    """The domain of a piece at one of its nodes, as the declaration of its ports says."""
    return REGISTRY[piece.type].ports[place].domain.name


def across_signals(pieces: Pieces, response: Response) -> dict[str, Array]:
    """Speeds and voltages of all nodes that the referee determines, by the library's names."""
    domains = {
        node: _domain(piece, place)
        for piece in pieces
        if piece.type != "Ground"
        for place, node in enumerate(piece.nodes)
    }
    return {
        f"{node}.{QUANTITIES[domains[node]][0]}": values for node, values in response.across.items() if node != GROUND
    }


def through_signals(pieces: Pieces, response: Response) -> Iterator[tuple[str, Array]]:
    """Torques, forces and currents of all parts that the referee determines, by the library's names and signs."""
    for piece in pieces:
        if piece.type == "Ground":
            signals = {"through": ("reaction", 1.0)}
        elif piece.type == "DCMachine":
            signals = {"through_p": ("i", 1.0), "through_rotor": ("tau", -1.0)}
        elif len(REGISTRY[piece.type].ports) > 1 and REGISTRY[piece.type].role == "coupling":
            pairs = zip(TERMINALS[piece.type], REGISTRY[piece.type].ports, strict=True)
            signals = {
                f"through_{terminal}": (f"{QUANTITIES[port.domain.name][1]}_{port.name}", 1.0)
                for terminal, port in pairs
            }
        else:
            sign = -1.0 if REGISTRY[piece.type].role == "source" else 1.0
            signals = {"through": (QUANTITIES[_domain(piece, 0)][1], sign)}
        for unknown, (name, sign) in signals.items():
            if (values := response.through.get(f"{piece.name}.{unknown}")) is not None:
                yield f"{piece.name}.{name}", sign * values


def assert_equal_signals(found: Mapping[str, Array], wanted: Mapping[str, Array], tolerance: float) -> None:
    """Equal within a fraction of the largest value that any signal of the same quantity takes."""
    largest: dict[str, float] = {}
    for name, values in wanted.items():
        largest[quantity_of(name)] = max(largest.get(quantity_of(name), 0.0), float(np.abs(values).max()))
    errors = {name: np.abs(found[name] - values).max() for name, values in wanted.items()}
    wrong = {
        name: f"{error:.3g} of {largest[quantity_of(name)]:.3g}"
        for name, error in errors.items()
        if not error <= tolerance * largest[quantity_of(name)] + 1e-300
    }
    assert not wrong, wrong


@st.composite
def inner_drives(draw: st.DrawFn, pieces: Pieces) -> Pieces:
    """Drives of places that have no store of their own, so that the derivatives of the sources enter the equations.

    They are a torque between two springs in series and a prescribed speed at the sun of a planetary gear. They must
    rise from zero: a step would leave open how it divides between the springs.
    """
    rotors = [piece.nodes[0] for piece in pieces if piece.type == "Inertia"]
    first, second = (rotors[draw(st.integers(0, 63)) % len(rotors)] for _ in range(2))
    push = (
        Piece("Spring", "first half", (first, "middle"), {"c": 300.0}),
        Piece("Spring", "second half", ("middle", GROUND if first == second else second), {"c": 500.0}),
        Piece("TorqueSource", "push", ("middle",), {"tau": 10.0}),
    )
    steer = (
        Piece("SpeedSource", "steer", ("steered",), {"omega": 2.0}),
        Piece("PlanetaryGear", "mixer", ("steered", first, "mixed"), {"ratio": 2.0}),
        Piece("Inertia", "flywheel", ("mixed",), {"J": 0.5}),
    )
    return (push if draw(st.booleans()) else ()) + (steer if draw(st.booleans()) else ())
