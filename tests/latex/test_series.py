"""A series stands where its first row stood and names exactly the rows that it replaces."""

from __future__ import annotations

import pytest

from shaftwork.components.mechanics import Damper, Inertia, Spring
from shaftwork.equations.spelling import INDEX_CLOSES, INDEX_OPENS
from shaftwork.latex.printing import Line
from shaftwork.latex.series import shortened
from shaftwork.network.netlist import NetworkBuilder
from tests.equations.networks import equations_of


def row(number: int, letter: str = "x", *, against: int | None = None) -> Line:
    """The line x_n = y_m, by default with m = n."""
    left, right = (f"{INDEX_OPENS}{value}{INDEX_CLOSES}" for value in (number, number if against is None else against))
    return Line(f"{letter}_{{{left}}}", (f"y_{{{right}}}",))


def printed(lines: list[Line]) -> list[str]:
    return [f"{line.left} = {' '.join(line.pieces)} {line.remark}".strip() for line in shortened(lines)]


@pytest.mark.parametrize(
    ("numbers", "span"),
    [
        ((1, 2, 3, 4, 5), r"1, \dots, 5"),
        ((1, 2, 3, 4, 6, 7, 8, 9, 10), r"1, \dots, 4, 6, \dots, 10"),
        ((2, 4, 6, 8, 10), r"2, 4, \dots, 10"),
        ((1, 2, 4, 8, 16), "1, 2, 4, 8, 16"),
        ((5, 4, 3, 2, 1), r"1, \dots, 5"),
    ],
)
def test_a_series_lists_its_numbers(numbers: tuple[int, ...], span: str) -> None:
    assert printed([row(k) for k in numbers]) == [rf"x_{{k}} = y_{{k}} \text{{for }} k = {span}"]


def test_rows_in_between_keep_their_place() -> None:
    lines = [row(0, "a"), *(row(k, "b" if k == 5 else "x") for k in range(1, 11)), row(11, "c")]
    assert [text[0] for text in printed(lines)] == ["a", "x", "b", "c"]


def test_an_index_that_stays_is_printed_as_it_is() -> None:
    lines = [row(k, against=7) for k in range(1, 7)] + [row(3, "z", against=k) for k in range(2, 8)]
    assert printed(lines) == [
        r"x_{k} = y_{7} \text{for } k = 1, \dots, 6",
        r"z_{3} = y_{k} \text{for } k = 2, \dots, 7",
    ]


def test_an_offset_between_indices_is_kept() -> None:
    assert printed([row(k, against=k - 2) for k in range(4, 9)]) == [r"x_{k} = y_{k-2} \text{for } k = 4, \dots, 8"]


def test_a_series_with_many_gaps_is_parted_and_nothing_is_lost() -> None:
    squares = [k * k for k in range(36)]
    texts = printed([row(k) for k in squares])
    assert len(texts) > 1
    named = [int(number) for text in texts for number in text.rpartition("k = ")[2].split(", ")]
    assert named == squares


def test_a_train_with_one_different_cell_keeps_its_order() -> None:
    net = NetworkBuilder("train")
    for k in range(1, 26):
        net.add(Inertia(f"J{k}", J=0.1), f"n{k}")
        if k > 1:
            net.add(Spring(f"s{k - 1}", c=1e4, d=0.1), f"n{k - 1}", f"n{k}")
    net.add(Damper("brake", d=1.0), "n6")
    rows = equations_of(net).latex(form="kirchhoff").partition("align*}\n")[2].splitlines()[:4]
    assert [text.partition(" ")[0] for text in rows] == ["J_{1}", "J_{k}", "J_{6}", "J_{25}"]
    assert r"k = 2, \dots, 5, 7, \dots, 24" in rows[1]
