"""A network that is an analogue of another one, and what each quantity of the other is in it."""

from __future__ import annotations

from collections.abc import Mapping
from difflib import get_close_matches
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from shaftwork.core.errors import ParameterError, SignalError
from shaftwork.network.netlist import Netlist
from shaftwork.pipeline.network import Network
from shaftwork.results.solution import Solution


class Analogue(Network):
    """A network with the equations of another one in other quantities: `Network.circuit` and `Network.dual` make it.

    It is a network as any other. Besides it tells what the quantities of the first network are in it.

    Attributes:
        original: the network that it is the analogue of.
        quantities: by name of a quantity of the original the sum that it is, as factors by names of quantities of this
            one: {"J1.omega": {"J1.u": 1.0}, "shaft.tau": {"shaft.i": 1.0, "shaft d.i": 1.0}}.
        branches: by name of a part the branch of the graph of the original that it stands for.
    """

    original: Network
    quantities: Mapping[str, Mapping[str, float]]
    branches: Mapping[str, int]

    @classmethod
    def made(
        cls,
        netlist: Netlist,
        original: Network,
        quantities: Mapping[str, Mapping[str, float]],
        branches: Mapping[str, int],
    ) -> Self:
        """The analogue of a network, from its parts."""
        analogue = cls._of(netlist)
        analogue.original, analogue.quantities, analogue.branches = original, quantities, branches
        return analogue

    def read(self, solution: Solution, name: str) -> NDArray[np.float64]:
        """A quantity of the original network from a motion of this one, at the output times.

        Its shape is (k,), along a shaft (k, places).

        Args:
            solution: a motion of this network.
            name: of the quantity in the original network, "J1.omega".

        Raises:
            SignalError: the original has no such quantity, or it cannot be read here.
        """
        terms = [factor * solution[other] for other, factor in self._sum(name).items()]
        return sum(terms, np.zeros(np.shape(terms[0]) if terms else np.shape(solution.t)))

    def initial(self, values: Mapping[str, Any]) -> dict[str, float]:
        """Start values of this network from those of the original.

        Args:
            values: by name of a speed, twist or torque of the original, in SI.

        Raises:
            SignalError: the original has no such quantity.
            ParameterError: a quantity is a sum of several here, and none of them is told by it alone.
        """
        starts: dict[str, float] = {}
        for name, value in values.items():
            terms = self._sum(name)
            if len(terms) != 1:
                words = " + ".join(terms) or "nothing"
                raise ParameterError(f"'{name}' is {words} in '{self.name}'. Give start values of speeds and springs.")
            ((other, factor),) = terms.items()
            starts[other] = float(value) / factor
        return starts

    def _sum(self, name: str) -> Mapping[str, float]:
        if name in self.quantities:
            return self.quantities[name]
        near = get_close_matches(name, self.quantities, n=3) or [*self.quantities][:6]
        raise SignalError(f"'{self.original.name}' has no quantity '{name}' to read here. Near it: {', '.join(near)}.")
