"""Units of parameters, and of measures of a motion, in which limits are given."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from shaftwork.codegen.model_observer import ModelObserver
from shaftwork.core.errors import NetworkWarning, no_quantity
from shaftwork.core.notices import muted
from shaftwork.core.parameters import numbers_in_si, without_unit
from shaftwork.pipeline.network import Network
from shaftwork.results.measures import Measure


def units_of(net: Network, measures: Mapping[str, Any]) -> dict[str, str]:
    """Units by name of measures; those of functions are not known.

    Raises:
        NetworkError: the network cannot be assembled.
        SignalError: a measure is of a quantity that does not exist.
    """
    with muted(NetworkWarning):  # the study compiles it as well, and warns
        model = net.compile()
    observer, units = ModelObserver(model.form, model.bind), dict[str, str]()
    for name, measure in measures.items():
        if isinstance(measure, Measure):
            there = observer.units if measure.quantity in observer.units else _along(observer)
            if measure.quantity not in there:
                raise no_quantity(measure.quantity, model.name, observer.units)
            units[name] = "1" if measure.kind == "damage" else there[measure.quantity]
    return units


def _along(observer: ModelObserver) -> dict[str, str]:
    """Units of quantities along parts."""
    return {name: unit for name, (unit, _) in observer.profiles.items()}


def parameter_units(net: Network, names: Iterable[str]) -> dict[str, str]:
    """Units of parameters "part.name" that there are, by name."""
    parts = {placed.part.name: placed.part for placed in net.netlist().placed}
    split = ((name, *name.rpartition(".")) for name in names)
    return {name: parts[owner].declared[parameter].unit for name, owner, _, parameter in split}


def limits_in_si(name: str, limits: Any, unit: str | None) -> Any:
    """A limit of a measure, or a pair of them, in SI.

    Args:
        name: of the argument, for the message.
        limits: numbers or quantities.
        unit: of the measure; None where it is not known.

    Raises:
        ParameterError: a unit is wrong, or the measure has none that is known.
    """
    if unit is None:
        for limit in limits if isinstance(limits, tuple | list) else [limits]:
            without_unit(name, limit, "of what the function gives, as N m")
    return numbers_in_si(name, limits, unit or "1")
