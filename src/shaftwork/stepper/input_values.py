"""Inputs and parameters that are set while a motion is stepped, and the model in which they are numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from shaftwork.components.base import Component
from shaftwork.core.errors import ParameterError
from shaftwork.network.netlist import Netlist, first_few
from shaftwork.pipeline.arguments import STAND_IN, Names, as_names, checked_parameters

if TYPE_CHECKING:
    from shaftwork.pipeline.model import Model


class Settings:
    """The values that are set, and the model in which they are numbers.

    An input is a value that may also be a law: what a source gives, "motor.tau". It holds its law until it is set. From
    then on it is a parameter, in a model of its own in which a zero is a value like others.

    Args:
        model: of the network.
        parameters: values that differ from the network's.
        inputs: what will be set again and again; their model is compiled at once.

    Raises:
        ParameterError: there is no such input or parameter, or a value is not admissible.
    """

    def __init__(self, model: Model, parameters: Mapping[str, float] | None, inputs: Names) -> None:
        self._base, self.values = model, dict[str, float]()
        self._numbers, self._laws = (_names(model.netlist, kind) for kind in (_is_number, _is_law))
        self.inputs = () if inputs is None else as_names(inputs)
        for name in self.inputs:
            if name not in self._laws and name not in self._numbers:
                self._refuse(name)
        self._replaced: tuple[str, ...] = ()
        self.model, self.in_model = model, dict[str, float]()
        """The model in which the values hold, and those that it takes as parameters: others are in its structure."""
        for name, value in (parameters or {}).items():
            self.set(name, value)
        laws = dict.fromkeys(name for name in self.inputs if name in self._laws)
        if laws and tuple(laws) != self._replaced:
            _ = self._standing(tuple(dict.fromkeys((*self._replaced, *laws)))).states

    def restore(self, values: Mapping[str, float]) -> None:
        """Go back to values that were set before."""
        self.values, self._replaced = {}, ()
        self.model, self.in_model = self._base, {}
        for name, value in values.items():
            self.set(name, value)

    def set(self, name: str, value: Any) -> bool:
        """Set an input or a parameter, and tell whether the model is the same as before.

        Raises:
            ParameterError: there is none of this name, or the value is not admissible.
        """
        if not isinstance(name, str) or (name not in self._laws and name not in self._numbers):
            self._refuse(name)
        before, replaced = self.model, self._replaced
        if name in self._laws and name not in replaced:
            replaced = (*replaced, name)
        netlist = self._standing(replaced).netlist
        part = name.rpartition(".")[0]
        of_part = {other: number for other, number in self.values.items() if other.rpartition(".")[0] == part}
        values = {**self.values, name: checked_parameters(netlist, {**of_part, name: value})[name]}
        self.model, self.in_model = self._model_of(values, replaced)
        self.values, self._replaced = values, replaced
        return self.model is before

    def _model_of(self, values: dict[str, float], replaced: tuple[str, ...]) -> tuple[Model, dict[str, float]]:
        """The model in which values hold, and those that it takes as parameters."""
        model = self._standing(replaced)
        if not model.changes_structure({**values, **{name: values[name] or STAND_IN for name in replaced}}):
            return model, values
        others = {name: value for name, value in values.items() if name not in replaced}
        return model.variant(others), {name: values[name] for name in replaced}

    def _standing(self, replaced: tuple[str, ...]) -> Model:
        return self._base.variant(dict.fromkeys(replaced, STAND_IN)) if replaced else self._base

    def _refuse(self, name: Any) -> None:
        names, title = {**self._laws, **self._numbers}, self._base.name
        of_part = [other for other in names if other.rpartition(".")[0] == str(name).rpartition(".")[0]]
        there = f"There are: {first_few(of_part or [*names], 12)}." if names else "It has none."
        raise ParameterError(f"'{title}' has no input or parameter {name!r}. {there}")


def _names(netlist: Netlist, suits: Callable[[Component, str], bool]) -> dict[str, None]:
    """The parameters of a kind, as "part.parameter"."""
    pairs = ((placed.part, key) for placed in netlist.placed for key in placed.part.declared)
    return {f"{part.name}.{key}": None for part, key in pairs if suits(part, key)}


def _is_number(part: Component, key: str) -> bool:
    return isinstance(part.declared[key].magnitude(part.values[key])[0], float)


def _is_law(part: Component, key: str) -> bool:
    return part.declared[key].law and part.values[key] is not None
