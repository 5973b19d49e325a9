"""What must not matter: names, the order of the parts, which way round a part stands, the process that it runs in."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shaftwork import Solution
from shaftwork.components import REGISTRY
from tests.properties.examples import assert_equal_signals, compiled, share_of_examples
from tests.reference.mna import GROUND, Piece
from tests.strategies import Network, networks

TIMES = np.linspace(0.0, 0.5, 6)
ROUNDING = 1e-9
"""Another tree, or another order of sums, rounds differently; stiff springs turn 1e-16 into some 1e-11."""
REVERSIBLE = ("Spring", "TranslationalSpring", "Damper", "TranslationalDamper", "Resistor", "Inductor", "Capacitor")
REVERSIBLE_SOURCES = {"VoltageSource": "u", "CurrentSource": "i"}
ROOT = Path(__file__).parents[2]


def _run(pieces: Network) -> tuple[Solution, bool]:
    """The motion, and whether couplings share a load in a way that their stiffness would decide."""
    model = compiled(pieces)
    return model.simulate(TIMES[-1], t_eval=TIMES, engine="exact"), bool(model.form.tree.redundant)


def _assert_same_motion(first: Network, second: Network, found_as: Callable[[str], tuple[str, float]]) -> None:
    """Every signal of the first network is in the second one, under another name and sign."""
    (before, redundant), (after, _) = _run(first), _run(second)
    kinds = {piece.name: REGISTRY[piece.type].role for piece in first}
    wanted, found = {}, {}
    for name in before:
        owner, _, quantity = name.rpartition(".")
        shared = redundant and kinds.get(owner) == "coupling" and quantity[:1] in ("t", "f", "i", "r")
        inside = "." in owner  # nodes inside a part have no name of the user's, and no side of their own
        if not shared and not inside and quantity != "power":
            other, sign = found_as(name)
            wanted[name], found[name] = before[name], sign * after[other]
    assert_equal_signals(found, wanted, ROUNDING)


@pytest.mark.slow
@share_of_examples(0.1)
@given(networks(max_inertias=12), st.randoms(use_true_random=False))
def test_names_of_parts_and_nodes_change_nothing(pieces: Network, dice: st.Random) -> None:
    """New names sort in another order than the old ones, which would show where anything is sorted by name."""
    old = [*(p.name for p in pieces), *{n: None for p in pieces for n in p.nodes if n != GROUND}]
    order = list(range(len(old)))
    dice.shuffle(order)
    new = {name: f"{'zyxw'[k % 4]}_{k} {name[0]}" for name, k in zip(old, order, strict=True)} | {GROUND: GROUND}
    renamed = tuple(Piece(p.type, new[p.name], tuple(new[n] for n in p.nodes), p.values) for p in pieces)

    def found_as(name: str) -> tuple[str, float]:
        owner, _, quantity = name.rpartition(".")
        return f"{new[owner]}.{quantity}", 1.0

    _assert_same_motion(pieces, renamed, found_as)


@pytest.mark.slow
@share_of_examples(0.1)
@given(networks(max_inertias=12), st.randoms(use_true_random=False))
def test_the_order_of_the_parts_changes_nothing(pieces: Network, dice: st.Random) -> None:
    shuffled = list(pieces)
    dice.shuffle(shuffled)
    _assert_same_motion(pieces, tuple(shuffled), lambda name: (name, 1.0))


def _reversed(piece: Piece) -> Piece:
    """The same part, the other way round."""
    nodes = piece.nodes[::-1]
    if piece.type in REVERSIBLE and len(nodes) == 2:
        return Piece(piece.type, piece.name, nodes, piece.values)
    if (value := REVERSIBLE_SOURCES.get(piece.type)) is not None:
        return Piece(piece.type, piece.name, nodes, {value: -piece.values[value]})
    if piece.type == "Gear":
        return Piece(piece.type, piece.name, nodes, {"ratio": 1.0 / piece.values["ratio"]})
    if piece.type == "DCMachine":
        p, n, rotor = piece.nodes
        return Piece(piece.type, piece.name, (n, p, rotor), {**piece.values, "k": -piece.values["k"]})
    return piece


@share_of_examples(0.1)
@given(networks(max_inertias=12), st.randoms(use_true_random=False))
def test_a_reversed_part_changes_only_the_signs_of_its_own_signals(pieces: Network, dice: st.Random) -> None:
    turned = tuple(_reversed(piece) if dice.random() < 0.5 else piece for piece in pieces)
    changed = {old.name: old.type for old, new in zip(pieces, turned, strict=True) if new.nodes != old.nodes}
    port = {"a": "b", "b": "a"}

    def found_as(name: str) -> tuple[str, float]:
        owner, _, quantity = name.rpartition(".")
        kind = changed.get(owner)
        if kind is None or quantity in ("power", "energy"):
            return name, 1.0
        if kind == "Gear":
            stem, _, end = quantity.partition("_")
            return f"{owner}.{stem}_{port[end]}", 1.0
        mechanical = kind == "DCMachine" and quantity in ("omega", "tau")
        return name, 1.0 if mechanical else -1.0

    _assert_same_motion(pieces, turned, found_as)


PRINT_EVERYTHING = """
import random
import shaftwork as sw
from tests.properties.examples import compiled, network_of
from tests.strategies import MOVES, Step, build
from shaftwork.scenes import crane_start

def nets():
    yield crane_start()
    for seed in range(6):
        dice = random.Random(seed)
        steps = [
            Step(dice.choice(list(MOVES)), dice.randrange(64), dice.randrange(64),
                 tuple(dice.random() < 0.5 for _ in range(3)), tuple(dice.randrange(180) for _ in range(4)))
            for _ in range(3 + seed)
        ]
        yield network_of(build(steps, max_inertias=10))

for net in nets():
    model = compiled(net)
    print(model.states, list(model.parameters), net.check())
    print(model.scalar.source if model.scalar else None)
    for form in ("kirchhoff", "state"):
        print(net.equations().latex(form=form))
"""


def _in_another_process(hash_seed: int) -> bytes:
    environment = {**os.environ, "PYTHONHASHSEED": str(hash_seed)}
    path = os.pathsep.join([str(ROOT / "src"), str(ROOT)])
    environment["PYTHONPATH"] = os.pathsep.join(filter(None, [path, environment.get("PYTHONPATH", "")]))
    done = subprocess.run(
        [sys.executable, "-c", PRINT_EVERYTHING], env=environment, cwd=ROOT, capture_output=True, check=False
    )
    assert done.returncode == 0, done.stderr.decode()
    return done.stdout


@pytest.mark.slow
def test_another_process_prints_the_same_equations_code_and_states_byte_by_byte() -> None:
    """Hash seeds order sets of texts differently, so a set on the way would show."""
    first, second = _in_another_process(1), _in_another_process(2)
    assert b"def function(" in first
    assert first == second
