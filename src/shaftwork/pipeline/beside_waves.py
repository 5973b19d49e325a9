"""Which parts of a network travelling waves go along."""

from __future__ import annotations

from shaftwork.network.graph import CircuitGraph


def waving(graph: CircuitGraph) -> tuple[str, ...]:
    """Names of the parts that waves travel along."""
    histories = (branch.index for branch in graph.branches if branch.template.is_history)
    return tuple(dict.fromkeys(graph.part_of(index).name for index in histories))
