"""Connectors that connect equations join to nodes."""

from __future__ import annotations


class JoinedTerminals:
    """Terminals, and which of them are one node; the first of two stands for both."""

    def __init__(self) -> None:
        self._parents: dict[str, str] = {}

    def of(self, terminal: str) -> str:
        """The terminal that stands for all that it is joined with."""
        root = terminal
        while self._parents.get(root, root) != root:
            root = self._parents[root]
        while self._parents.get(terminal, terminal) != root:
            self._parents[terminal], terminal = root, self._parents[terminal]
        return root

    def join(self, first: str, second: str) -> None:
        """Make one of two."""
        one, other = self.of(first), self.of(second)
        if one != other:
            self._parents[other] = one
