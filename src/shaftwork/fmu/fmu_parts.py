"""Parts of a network whose laws an FMU evaluates."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, ClassVar

from sympy import Expr, Integer

from shaftwork.components.base import Component, Port, Role, component
from shaftwork.components.branches import ACROSS, AcrossLaw, Branch, ThroughLaw, ThroughStore, across_of, through_of
from shaftwork.components.external import External, Handle
from shaftwork.components.laws import t as TIME
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import parameter
from shaftwork.fmu.foreign_unit import FMU, MOST_STATES, ForeignUnit
from shaftwork.network.netlist import title

_PORTS = tuple(f"x{k}" for k in range(1, MOST_STATES + 1))


class _FMUPart(Component):
    """A part with the states of an FMU inside."""

    fmu: FMU
    role: ClassVar[Role] = "source"
    ports: ClassVar = (Port("a"),)
    signal_ports: ClassVar = frozenset(_PORTS)

    def inner_ports(self) -> tuple[Port, ...]:
        """Where the states of the FMU are stored."""
        return tuple(map(Port, _PORTS[: len(self.fmu.states)]))


@component
class FMUTorque(_FMUPart):
    """A torque on its node that an FMU gives as a function of the speed of the node, of time and of its own states.

    Law: tau = gain g(t, x, omega), positive raises the speed of the node, with x' = f(t, x, omega); f and g are those
    of the FMU, and x are states of the network: no error of coupling arises. They are counted from the values that the
    FMU starts with. It has begun its own time at 0 s and is told of no completed steps.
    Analogue: a current source. Source: FMI 3.0, section 3 (model exchange).
    """

    fmu: FMU = parameter("1", "the file, the names of its variables and its values", record=FMU)
    gain: float = parameter("1", "torque on the node over that of the FMU", default=1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        _refuse_wrong(self, ("speed", "torque"))

    def branches(self, p: Any) -> Iterator[Branch]:
        unit = Handle(ForeignUnit(p.fmu, "speed", "torque"))
        yield ThroughLaw(-p.gain * _law(unit, len(p.fmu.states), p.fmu, ACROSS), ("a", None), "tau")
        yield from _states(unit, p.fmu, across_of("a"))


@component
class FMUSpeed(_FMUPart):
    """Prescribes the speed of its node as an FMU gives it, from the torque on its shaft, time and its own states.

    Law: omega = g(t, x), with x' = f(t, x, tau), where tau is the torque that the node gives to the FMU; as of
    `FMUTorque` otherwise. An output that depends on the torque at once would be an algebraic loop, and is refused.
    Analogue: a voltage source. Source: FMI 3.0, section 3 (model exchange).
    """

    fmu: FMU = parameter("1", "the file, the names of its variables and its values", record=FMU)

    def __post_init__(self) -> None:
        super().__post_init__()
        _refuse_wrong(self, ("torque", "speed"))
        if self.fmu.feeds_through(self.fmu.speed):
            raise ParameterError(
                f"FMUSpeed '{self.name}': the speed of the FMU '{self.fmu.path.name}' depends on its input at once (by "
                "its ModelStructure), which makes an algebraic loop. Take an FMUTorque, or give the FMU an inertia."
            )

    def branches(self, p: Any) -> Iterator[Branch]:
        unit = Handle(ForeignUnit(p.fmu, "torque", "speed"))
        yield AcrossLaw(_law(unit, len(p.fmu.states), p.fmu, Integer(0)), ("a", None), "drive")
        yield from _states(unit, p.fmu, through_of("drive"))


def _law(unit: Handle, row: int, fmu: FMU, reads: Expr) -> Expr:
    states = (through_of(port) for port in _PORTS[: len(fmu.states)])
    return External(unit, Integer(row), Integer(-1), TIME, *states, reads)


def _states(unit: Handle, fmu: FMU, reads: Expr) -> Iterator[Branch]:
    """The states of an FMU as torques of springs of stiffness 1, whose speeds are their rates."""
    for row, port in enumerate(_PORTS[: len(fmu.states)]):
        yield AcrossLaw(-_law(unit, row, fmu, reads), (None, port))
        yield ThroughStore(Integer(1), (port, None), port)


def _refuse_wrong(part: Any, order: tuple[str, str]) -> None:
    fmu = part.fmu
    if (objection := part.declared["fmu"].magnitude(fmu)[1]) is not None:
        raise ParameterError(f"{title(part)}: fmu {objection}.")
    reads, gives = (getattr(fmu, name) for name in order)
    if fmu.gives(reads) or not fmu.gives(gives):
        raise ParameterError(
            f"{title(part)}: of the FMU '{fmu.path.name}' {order[0]} = '{reads}' must be an "
            f"input and {order[1]} = '{gives}' an output."
        )
