"""Extremes of many quantities, which are read together, are those of each alone."""

from __future__ import annotations

import shaftwork as sw


def test_extremes_that_are_read_together_are_those_of_each_alone_to_the_last_bit() -> None:
    model = sw.scenes.shaft_step().compile()
    together, alone = (model.simulate(0.02).extremes for _ in range(2))
    names = tuple(together)
    assert together.rows(names) == {name: alone.row(name) for name in names}
