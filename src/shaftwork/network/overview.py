"""A network on one screen: its parts, where they stand, and their values."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from shaftwork.components.base import Component
from shaftwork.components.tables import Table
from shaftwork.core.screen import counted, on_one_screen
from shaftwork.network.netlist import REFERENCE, Netlist, Placed


def overview(netlist: Netlist) -> str:
    """The parts of a network, a line each, as many as a screen has room for."""
    nodes = {node for placed in netlist.placed for node in placed.nodes if node != REFERENCE}  # only counted
    ports = f", ports {', '.join(netlist.ports)}" if netlist.ports else ""
    sizes = f"{counted(len(netlist.placed), 'part')} at {counted(len(nodes), 'node')}"
    return on_one_screen(f"Network '{netlist.name}': {sizes}{ports}", _lines(netlist.placed), len(netlist.placed))


def _lines(placed: tuple[Placed, ...]) -> Iterator[str]:
    shown = placed[:30]  # widths of columns are those of what is shown
    rows = [(type(item.part).__name__, str(item.part.name), ", ".join(map(str, item.nodes))) for item in shown]
    widths = [max(len(row[column]) for row in rows) for column in range(3)] if rows else []
    for item, row in zip(shown, rows, strict=True):
        columns = (text.ljust(min(width, 30)) for text, width in zip(row, widths, strict=True))
        yield f"  {'  '.join(columns)}  {_values(item.part)}".rstrip()


def _values(part: Component) -> str:
    """The values of a part that are not those by default."""
    values = ((name, getattr(part, name), declared.default) for name, declared in part.declared.items())
    return ", ".join(f"{name}={_short(value)}" for name, value, default in values if not _is(value, default))


def _is(value: Any, default: Any) -> bool:
    numbers = isinstance(value, int | float) and isinstance(default, int | float)
    return value is default or (numbers and bool(value == default))


def _short(value: Any) -> str:
    if isinstance(value, Table):
        return f"Table of {len(value.xs)} points"
    text = f"{value:.6g}" if isinstance(value, float) else str(value)
    return text if len(text) <= 30 else f"{text[:27]}..."
