"""What each quantity of a network is in its analogue."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Any

import numpy as np
from numpy.typing import NDArray

from shaftwork.codegen.compiled_model import CompiledModel
from shaftwork.codegen.start_values import initial_state
from shaftwork.core.domains import Domain
from shaftwork.core.errors import ParameterError, SignalError
from shaftwork.core.parameters import in_si
from shaftwork.formulation.form import StateForm
from shaftwork.network.netlist import Netlist
from shaftwork.results.solution import Solution


@dataclass(frozen=True)
class Analogy:
    """An analogue of a network: its parts, and what the quantities of the network are in it.

    `Network.circuit` and `Network.dual` give it to the network that they make, as `analogy`.

    Args:
        original: name of the network that it is the analogue of.
        netlist: its own parts.
        quantities: by name of a quantity of the original the sum that it is, as factors by names of quantities of the
            analogue: {"J1.omega": {"J1.u": 1.0}, "shaft.tau": {"shaft.i": 1.0, "shaft d.i": 1.0}}.
        branches: by name of a part the branch of the graph of the original that it stands for.
        domains: of a circuit, the domain in the original of each node that does not rotate there.
        profiles: by name of a quantity along a shaft of the original, that is written out, such a sum for each place.
        form: the state form of the original, where its long shafts are written out.
    """

    original: str
    netlist: Netlist = field(repr=False)
    quantities: Mapping[str, Mapping[str, float]] = field(repr=False)
    branches: Mapping[str, int] = field(repr=False)
    domains: Mapping[str, Domain] = field(default_factory=dict, repr=False)
    profiles: Mapping[str, tuple[Mapping[str, float], ...]] = field(default_factory=dict, repr=False)
    form: StateForm | None = field(default=None, repr=False)

    def read(self, solution: Solution, name: str) -> NDArray[np.float64]:
        """A quantity of the original from a motion of the analogue, at the output times.

        Its shape is (k,), along a shaft (k, places).

        Args:
            solution: a motion of the analogue.
            name: of the quantity in the original, "J1.omega".

        Raises:
            SignalError: the original has no such quantity, or it cannot be read here.
        """
        if name in self.profiles:
            return np.stack([_total(solution, terms) for terms in self.profiles[name]], axis=1)
        return _total(solution, self._sum(name))

    def initial(self, values: Mapping[str, Any]) -> dict[str, float]:
        """Start values of the analogue from those of the original.

        Inside long shafts that are written out speeds lie between those of the ends, as in the original.

        Args:
            values: by name of a speed, twist or torque of the original, in SI.

        Raises:
            SignalError: the original has no such quantity.
            ParameterError: a quantity is a sum of several in the analogue, so that it tells none of them.
        """
        starts: dict[str, float] = {}
        for name, value in values.items():
            terms = self._sum(name)
            if len(terms) != 1:
                words = " + ".join(terms) or "nothing"
                raise ParameterError(
                    f"'{name}' is {words} in '{self.netlist.name}'. Give speeds of inertias and twists of springs."
                )
            ((other, factor),) = terms.items()
            starts[other] = in_si(name, value) / factor
        return {**self._inside_shafts(values), **starts}

    def _inside_shafts(self, values: Mapping[str, Any]) -> dict[str, float]:
        """What is stored in shafts that are written out, by names of the analogue."""
        if self.form is None or not self.profiles or not values:
            return {}
        shafts = {name.rpartition(".")[0] for name in self.profiles}  # only asked for membership
        in_units = {name: in_si(name, value) for name, value in values.items()}
        states = initial_state(CompiledModel(self.form).bind(), in_units, 0.0)
        starts: dict[str, float] = {}
        for state, value in zip(self.form.states, states, strict=True):
            terms = self.quantities.get(state.name, {})
            if state.name.rpartition(".")[0] in shafts and len(terms) == 1:
                ((other, factor),) = terms.items()
                starts[other] = float(value) / factor
        return starts

    def _sum(self, name: str) -> Mapping[str, float]:
        if name in self.quantities:
            return self.quantities[name]
        near = get_close_matches(name, self.quantities, n=3) or [*self.quantities][:6]
        raise SignalError(f"'{self.original}' has no quantity '{name}' to read here. Near it: {', '.join(near)}.")


def _total(solution: Solution, terms: Mapping[str, float]) -> NDArray[np.float64]:
    parts = [factor * solution[name] for name, factor in terms.items()]
    return sum(parts, np.zeros(np.shape(parts[0]) if parts else np.shape(solution.t)))
