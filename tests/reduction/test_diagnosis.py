"""Each fault of structure and of values is said with part, node and next step; nothing is raised, nothing said twice."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from shaftwork.components import electrical, loads, machines, rotation, sources, translation  # noqa: F401 - registers
from shaftwork.components.base import REGISTRY, Component
from shaftwork.components.laws import Heaviside, Ramp, Step, Table, omega, phi, t
from shaftwork.core.errors import ParameterError, Problem
from shaftwork.network.netlist import Netlist, Placed
from shaftwork.reduction.diagnosis import diagnose
from tests.malformations import malformed_networks
from tests.strategies import Network, networks
