"""Netlists with faults at random are read, or refused in the library's own words: no other error, and no hang."""

from __future__ import annotations

import re
import warnings
from random import Random

import pytest

import shaftwork as sw
from tests.properties.examples import processor_time_limit
from tests.spice.test_reading import CIRCUITS

LCAPY = """
V 1 0 step 20; down
R 1 2 3; right=1.5
L 2 3 1 0.5; right
C 3 0_1 {2*0.1}; down
TF1 4 0 3 0 2; right
SW1 4 5 no 0.2; right
R2 5 0 1; down
E1 6 0 opamp 5 0 10; right
R3 6 0 1; down
K1 L L 0.5; size=2
W 0 0_1; right
"""
NETLISTS = (*(text for text, _ in CIRCUITS.values()), LCAPY)
ODD = (
    *(
        "0",
        "-1",
        "nan",
        "inf",
        "1e999",
        "1e-999",
        "1k1",
        "--1",
        "1.0.0",
        "{",
        "}",
        "{}",
        "{1/0}",
        "{x}",
        "{9^9^9^9}",
        "'",
    ),
    *(
        "(",
        ")",
        "=",
        ",",
        "+",
        "*",
        ";",
        ".end",
        ".ends",
        ".subckt",
        ".subckt a b",
        ".param x={x}",
        ".tran",
        ".ic v(1)=1",
    ),
    *(
        ".model m d(",
        "X1 1 2 two",
        "K1 L1 L2 1",
        "V1",
        "R",
        "gnd",
        "0",
        "é",
        "\x00",
        "\t",
        "1" * 500,
        "{" + "(" * 300 + ")",
    ),
    *(
        "{__import__('os')}",
        "{a.b}",
        "{lambda: 0}",
        "uic",
        "IC=1",
        "SIN(",
        "PULSE(0 1 0 0 0 0 1e-30)",
        "PWL()",
        "opamp",
    ),
)
SECONDS = 20.0
"""Of processor time for one netlist, a hundred times what the largest of them takes."""


def mutated(random: Random) -> str:
    """A netlist with one to four faults."""
    text = random.choice(NETLISTS)
    for _ in range(random.randint(1, 4)):
        lines = text.splitlines()
        at = random.randrange(len(lines))
        words = re.findall(r"\S+|\s+", lines[at]) or [""]
        word = random.randrange(len(words))
        change = random.randrange(8)
        if change == 0:
            del lines[at]
        elif change == 1:
            lines.insert(at, random.choice(lines))
        elif change == 2:
            lines.insert(at, random.choice(ODD))
        elif change == 3:
            words[word] = random.choice(ODD)
        elif change == 4:
            words[word] = random.choice(re.findall(r"\S+", text))
        elif change == 5:
            del words[word]
        elif change == 6:
            lines[at] = lines[at][: random.randrange(len(lines[at]) + 1)]
            words = [lines[at]]
        else:
            place = random.randrange(len(lines[at]) + 1)
            words = [lines[at][:place], random.choice("0123456789abkmu.()={}'*+-;"), lines[at][place:]]
        if change in (3, 4, 5, 6, 7):
            lines[at] = "".join(words)
        text = "\n".join(lines) or "title"
    return text


def outcome(text: str) -> str:
    """What a reader sees: the text is read and checked, or refused."""
    with processor_time_limit(SECONDS), warnings.catch_warnings():
        warnings.simplefilter("ignore", sw.NetworkWarning)
        try:
            circuit = sw.spice.read(text)
        except sw.ModelFileError as error:
            assert str(error).startswith("netlist: ")  # noqa: PT017 (most are refused)
            return "refused"
        return "unsound" if any(problem.severity == "error" for problem in circuit.network.check()) else "read"


def outcomes(first: int, count: int) -> set[str]:
    return {outcome(mutated(Random(seed))) for seed in range(first, first + count)}  # noqa: S311


def test_netlists_with_faults_are_read_or_refused() -> None:
    assert outcomes(0, 150) == {"read", "refused", "unsound"}


@pytest.mark.slow
def test_two_thousand_netlists_with_faults_are_read_or_refused() -> None:
    assert outcomes(1000, 2000) == {"read", "refused", "unsound"}
