"""The stores of a part: their names are those of states."""

from __future__ import annotations

from shaftwork.components.base import Component
from shaftwork.core.domains import ROTATION
from shaftwork.network.templates import BranchTemplate, Kind


def check_stores(part: Component, templates: tuple[BranchTemplate, ...]) -> None:
    """That no two stores of a part have one name: it is that of a state.

    Raises:
        ValueError: two have.
    """
    domains = {port.name: port.domain for port in (*part.ports, *part.inner_ports())}
    found: set[str] = set()  # only asked for membership
    for made in templates:
        if made.kind not in (Kind.ACROSS_STORE, Kind.THROUGH_STORE):
            continue
        domain = next((domains[end] for end in made.ends if end is not None), None) or ROTATION
        name = made.label or (domain.across if made.kind is Kind.ACROSS_STORE else domain.through).name
        if name in found:
            raise ValueError(f"two of its stores have the name {name!r}; give each branch a label of its own")
        found.add(name)
