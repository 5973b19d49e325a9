"""Components: everything that can be put on a drive train. Importing the package enters them all in the registry."""

from __future__ import annotations

from shaftwork.components import contacts, electrical, loads, machines, rotation, shafts, sources, translation
from shaftwork.components.base import REGISTRY, Component, Port, Signal, component
from shaftwork.components.laws import Table

__all__ = [
    "REGISTRY",
    "Component",
    "Port",
    "Signal",
    "Table",
    "component",
    "contacts",
    "electrical",
    "loads",
    "machines",
    "rotation",
    "shafts",
    "sources",
    "translation",
]
