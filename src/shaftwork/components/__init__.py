"""Components: everything that can be put on a drive train. Importing the package enters them all in the registry."""

from __future__ import annotations

from importlib import import_module

from shaftwork.components.base import REGISTRY, Component, Port, Signal, component
from shaftwork.components.tables import Table

FAMILIES = (
    "mechanics",
    "contacts",
    "friction",
    "shafts",
    "sources",
    "controllers",
    "excitations",
    "loads",
    "bucket_wheel",
    "motors",
    "drives",
    "electrical",
    "controlled",
    "bldc",
)
"""The modules of components, in the order in which they are shown."""
for family in FAMILIES:
    import_module(f"{__name__}.{family}")

__all__ = ["FAMILIES", "REGISTRY", "Component", "Port", "Signal", "Table", "component"]
