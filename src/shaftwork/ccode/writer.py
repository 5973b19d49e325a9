"""The texts of the files of a model in C."""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple, cast

from sympy import Symbol

from shaftwork.ccode.c_printing import Statements, array
from shaftwork.ccode.c_texts import filled, names_of, runtime
from shaftwork.ccode.equation_set import EquationSet
from shaftwork.ccode.instants import Instants
from shaftwork.ccode.set_functions import (
    LATER,
    ArrayLayout,
    SetFunctions,
    function_of_sets,
    samples_of_sets,
    stored_symbol,
    take_up_of_sets,
)
from shaftwork.codegen.state_transfer import StateTransfer
from shaftwork.components.laws import t as TIME
from shaftwork.core.errors import SignalError
from shaftwork.formulation.form import Names
from shaftwork.network.netlist import listed
from shaftwork.pipeline.arguments import NOMINAL

if TYPE_CHECKING:
    from shaftwork.ccode.mode_tables import ModeTables
    from shaftwork.hybrid.hybrid_model import HybridModel
    from shaftwork.pipeline.model import Model


class Variable(NamedTuple):
    """A number of the C code.

    Args:
        name: in the network.
        unit: its unit, in SI.
        value: the default of a parameter or an input; of other variables 0.
        nominal: the usual size of a state, at a speed of one; of other variables 1.
    """

    name: str
    unit: str
    value: float = 0.0
    nominal: float = 1.0


class CodeWriter:
    """Writes the texts of a model.

    Args:
        model: the compiled network, in which inputs are parameters.
        inputs: their default values, "part.parameter" to value.
        wanted: names of the outputs, or None for all quantities.
    """

    def __init__(self, model: Model, inputs: Mapping[str, float], wanted: Sequence[str] | None) -> None:
        self._model, self._inputs, self._wanted = model, inputs, wanted

    @cached_property
    def modes(self) -> ModeTables | None:
        """What changes its mode; None where nothing does."""
        if not self._model.phased:
            return None
        from shaftwork.ccode.mode_tables import ModeTables

        return ModeTables(cast("HybridModel", self._model))

    @cached_property
    def sets(self) -> tuple[EquationSet, ...]:
        """The sets of equations; of one that contradicts itself the first stands in its place."""
        return (EquationSet(self._model),) if self.modes is None else self.modes.sets

    @cached_property
    def parameters(self) -> tuple[Variable, ...]:
        """The parameters of all sets, but for inputs and the numbers of modes."""
        besides = {*self._inputs, *(self.modes.numbers if self.modes else ())}  # only asked for membership
        values: dict[str, float] = {}
        for one in self.sets:
            values |= {k: v for k, v in one.form.graph.parameters.items() if k not in besides and k not in values}
        return tuple(Variable(name, self._unit(name), value) for name, value in values.items())

    @cached_property
    def inputs(self) -> tuple[Variable, ...]:
        """The inputs."""
        return tuple(Variable(name, self._unit(name), value) for name, value in self._inputs.items())

    def _unit(self, name: str) -> str:
        owner, _, parameter = name.rpartition(".")
        part = next(part for part in self._model.form.graph.parts if part.name == owner)
        declared = part.component.declared.get(parameter)
        return declared.unit if declared else "1"

    @cached_property
    def states(self) -> tuple[Variable, ...]:
        """The states of all sets."""
        units = {state.name: state.unit for one in self.sets for state in one.form.states}
        tolerances = ChainMap(*(dict(one.nominal) for one in self.sets))
        return tuple(Variable(name, unit, nominal=tolerances[name] / NOMINAL) for name, unit in units.items())

    @cached_property
    def stores(self) -> tuple[str, ...]:
        """Names of all that is stored."""
        return StateTransfer(self.sets[0].form).names

    @cached_property
    def outputs(self) -> tuple[Variable, ...]:
        """The outputs that are wanted; by default all quantities that every set of equations tells.

        Raises:
            SignalError: there is no such quantity, or some phase does not tell it.
        """
        units = Names(self.sets[0].form).units
        names = [name for name in units if not name.endswith((".power", ".energy"))]
        told = [name for name in names if all(one.observables.quantity(name) is not None for one in self.sets)]
        wanted = told if self._wanted is None else self._wanted
        for name in wanted:
            if name not in told:
                why = "is an energy, a power or told in some phases alone" if name in units else "does not exist"
                raise SignalError(f"outputs: '{name}' {why}. There are: {listed(told, 12)}.")
        return tuple(Variable(name, units[name]) for name in wanted)

    @cached_property
    def _names(self) -> dict[Symbol, str]:
        """The code of every symbol."""
        names = {TIME: "t", LATER: "(m->t + 2.0 * clearance(m->t))"}
        for letter, variables in (("m->p", self.parameters), ("m->u", self.inputs), ("x", self.states)):
            names |= {Symbol(v.name, real=True): f"{letter}[{k}]" for k, v in enumerate(variables)}
        names |= {stored_symbol(name): f"stored[{k}]" for k, name in enumerate(self.stores)}
        numbers = self.modes.numbers if self.modes else ()
        return names | {Symbol(name, real=True): f"m->number[{k}]" for k, name in enumerate(numbers)}

    def texts(self, name: str, t_end: float) -> tuple[str, str, str]:
        """Header, source and example under a name; the end of the example's motion in s."""
        modes = self.modes
        sizes = {"STATES": len(self.states), "STORES": len(self.stores), "PARAMETERS": len(self.parameters)}
        sizes |= {"INPUTS": len(self.inputs), "OUTPUTS": len(self.outputs)}
        sizes |= {"MACHINES": len(modes.machines) if modes else 0, "GUARDS": modes.most_guards if modes else 0}
        places = {**sizes, "TITLE": self._model.name.replace("/", "|"), "T_END": repr(float(t_end))}
        whole = (runtime("header.h"), self._source, runtime("main.c"))
        header, source, example = (filled(text, name, places) for text in whole)
        return header, source, example

    @cached_property
    def _source(self) -> str:
        modes, statements = self.modes, Statements(self._names, self._model.name)
        states, outputs = (tuple(v.name for v in some) for some in (self.states, self.outputs))
        layout = ArrayLayout(states, self.stores, outputs, statements)
        functions = [SetFunctions(one, layout) for one in self.sets]
        still = [symbol for symbol, code in self._names.items() if code.startswith(("m->p", "m->u"))]
        tied = any(one.ties for one in functions)
        called = {"loads": tied, "masses": tied or modes is not None}  # impacts need the inertias as well
        names = [name for name in functions[0].assignments if called.get(name, True)]
        body = [function_of_sets(name, [one.assignments[name] for one in functions], statements) for name in names]
        body += [take_up_of_sets(functions), samples_of_sets(functions)]
        body += modes.texts(functions, statements) if modes else [runtime("no_modes.c")]
        body.append(Instants(self._model.form.graph, still).text(statements))
        text = "\n".join([*(text for _, text in statements.matrices.values()), *body])
        tables = [
            array("const double", f"TABLE_{k}_{axis}", [*map(repr, points)])
            for table, k in statements.tables.items()
            for axis, points in (("X", table.xs), ("Y", table.ys))
        ]
        calls = {"points.c": "table", "noise.c": "held_noise("}
        calls |= {
            f"{name}.c": f"{name}("
            for name in ("table", "table_slope", "next_level", "next_whole", "next_zero", "is_due")
        }
        helpers = ["numbers.c"] * (modes is not None or "solve(" in text)
        helpers += [file for file, call in calls.items() if call in text]
        events = ("events.c", "impacts.c", "iteration.c") if modes else ("smooth.c",)
        nominal = array("const double", "NOMINAL", [repr(NOMINAL * state.nominal) for state in self.states])
        chosen = {state.name for state in self.sets[0].form.states}  # only asked for membership
        starts = [str(self.stores.index(name)) if name in chosen else "-1" for name in states]
        nominal = f"{nominal}\n{array('const int', 'START_OF', starts)}"
        first = [runtime("head.c"), nominal, *tables, *map(runtime, helpers), text]
        last = map(runtime, ("dop853.c", "solver.c", "jumps.c", *events, "common.c"))
        return "\n".join([*first, *last, *(modes.names if modes else ()), self._init])

    @property
    def _init(self) -> str:
        """Names and units, and the function that puts default values in."""
        lists = {"state": self.states, "parameter": self.parameters, "input": self.inputs, "output": self.outputs}
        texts = [names_of("store", "names", self.stores)]
        texts.append(names_of("machine", "names", self.modes.machines if self.modes else ()))
        for kind, variables in lists.items():
            texts.append(names_of(kind, "names", [variable.name for variable in variables]))
            texts.append(names_of(kind, "units", [variable.unit for variable in variables]))
        lines = [f"    m->p[{k}] = {variable.value!r};" for k, variable in enumerate(self.parameters)]
        lines += [f"    m->u[{k}] = {variable.value!r};" for k, variable in enumerate(self.inputs)]
        return "\n".join([*texts, _INIT, *lines, "    (void)NAME_start(m, 0.0);", "}", ""])


_INIT = """void NAME_init(NAME *m)
{
    memset(m, 0, sizeof *m);
    m->look_ahead = 1e-6;
    m->most_steps = 1000000;"""
