"""Every symbol that is printed is in the nomenclature, and no two of its rows say the same."""

from __future__ import annotations

import re

import pytest

from shaftwork.equations.records import Equations
from shaftwork.scenes import SCENES
from tests.beds import bed_of, registered
from tests.latex.test_nomenclature import rows

LETTER = re.compile(r"(?:\\Delta )?(?:\\[A-Za-z]+|[A-Za-z])'?(?:\^\{\([n0-9]+\)\})?_\{(?:[^{}]|\{[^{}]*\})*\}")


RUNNING = re.compile(r"(?:(?<=[{,])|(?<=[{,][a-z]))(?:\d+|[ijk](?:[-+]\d+)?)(?=[,}])")
"""At the end of a subscript, also behind the letter of a part, as in tau_{s2}."""


def letters(latex: str) -> set[str]:
    """The letters with a subscript; running numbers, and the indices that stand for them, as #."""
    plain = re.sub(r"\\d?dot\{(\\[a-z]+)\}", r"\1", latex.replace(r"\\", " "))
    plain = re.sub(r"\\sum_\{[^}]*\}", "", plain)
    return {RUNNING.sub("#", text) for text in LETTER.findall(plain)}


def equations_of(name: str) -> list[Equations]:
    if name not in SCENES:
        net = bed_of(name)
        return [net.equations(phase=net.start_phase() or None)]
    net = SCENES[name]()
    return [net.equations(phase=phase or None) for phase in SCENES[name].phases or (net.start_phase(),)]


@pytest.mark.slow
@pytest.mark.parametrize("name", [*SCENES, *registered()])
def test_every_printed_symbol_is_in_the_nomenclature_and_has_a_meaning_of_its_own(name: str) -> None:
    for equations in equations_of(name):
        text = equations.document()
        body, _, tables = text.partition(r"\section{Nomenclature}")
        printed = letters("".join(re.findall(r"\\begin\{align\*\}(.*?)\\end\{align\*\}", body, re.DOTALL)))
        assert printed - letters(tables) == set()
        listed = [row[1:3] for row in rows(text)[1:] if r"\mapsto" not in row[2] and row[1]]
        variables = listed[: next(k for k, row in enumerate(listed) if row == ("Meaning", "Of"))]
        assert sorted(variables) == sorted(set(variables))
