"""Components: everything that can be put on a drive train. Importing the package enters them all in the registry."""

from __future__ import annotations

from shaftwork.components import (
    bldc,
    bucket_wheel,
    contacts,
    controllers,
    drives,
    electrical,
    friction,
    induction_machine,
    loads,
    lossy_gear,
    machines,
    motors,
    rotation,
    shafts,
    sources,
    translation,
)
from shaftwork.components.base import REGISTRY, Component, Port, Signal, component
from shaftwork.components.tables import Table

__all__ = [
    "REGISTRY",
    "Component",
    "Port",
    "Signal",
    "Table",
    "bldc",
    "bucket_wheel",
    "component",
    "contacts",
    "controllers",
    "drives",
    "electrical",
    "friction",
    "induction_machine",
    "loads",
    "lossy_gear",
    "machines",
    "motors",
    "rotation",
    "shafts",
    "sources",
    "translation",
]
