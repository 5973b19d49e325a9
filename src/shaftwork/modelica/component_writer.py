"""A network as a Modelica package: a model of parts that are joined by connect, and the models of its own parts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from importlib.resources import files
from typing import Any

from shaftwork.core.domains import ROTATION, Domain
from shaftwork.core.errors import CompileError
from shaftwork.formulation.form import StateForm
from shaftwork.modelica.mode_models import part_model
from shaftwork.modelica.modelica_expressions import Identifiers, functions_in, number, quoted
from shaftwork.modelica.part_models import PartModel
from shaftwork.modelica.standard_classes import FRAMES, StandardClass, standard_class
from shaftwork.network.graph import GROUND, GraphPart, resolve

LIBRARY = "library.mo"
"""The classes of the Modelica Standard Library that are used, written anew, for tools that have no library."""


def component_text(form: StateForm, *, inline: bool, t_end: float, start: Mapping[str, float]) -> str:
    """The package of a network.

    Args:
        form: the state form of the network.
        inline: whether the classes of the library are written into the package.
        t_end: end of the experiment, s.
        start: of each state by name.

    Raises:
        CompileError: a part, a law or a start value has no counterpart; names all such parts.
    """
    work = _Writer(form, start, inline=inline)
    lines, joints = work.instances(), work.connections()
    work.refuse()
    package = Identifiers()[form.graph.name]
    text = "\n".join(
        [
            f"package {package} {quoted(form.graph.name)}",
            "  // Written by Shaftwork, in SI units: parts joined by connect, then the models that the library has not",
            "",
            f"  model Network {quoted(form.graph.name)}",
            *(f"    {line}" for line in lines),
            "  equation",
            *(f"    {line}" for line in joints),
            f"    {experiment(t_end)}",
            "  end Network;",
            "",
        ]
    )
    models = [*work.models.values()]
    models += [functions] if (functions := functions_in("".join(models))) else []
    models += [files(__package__).joinpath(LIBRARY).read_text(encoding="utf-8")] if inline else []
    return "\n".join([text, *models, f"end {package};", ""])


def experiment(t_end: float) -> str:
    """What a tool is told of a run."""
    return f"annotation(experiment(StartTime = 0, StopTime = {number(t_end)}, Tolerance = 1e-8));"


class _Writer:
    """Goes through the parts and collects instances, terminals at nodes, models and what cannot be written."""

    def __init__(self, form: StateForm, start: Mapping[str, float], *, inline: bool) -> None:
        self._form, self._graph, self._inline, self._start = form, form.graph, inline, start
        self._begun: list[str] = []
        self._names = Identifiers()
        self._terminals: dict[tuple[int, Domain], list[str]] = {}
        self._frames: dict[Domain, str] = {}
        self._bodies: dict[str, str] = {}
        self._faults: list[str] = []
        self.models: dict[str, str] = {}

    def instances(self) -> list[str]:
        """The declarations of the parts."""
        lines = [line for part in self._graph.parts for line in self._instance(part)]
        return [*lines, *(f"{FRAMES[domain][0]} {name};" for domain, name in self._frames.items())]

    def connections(self) -> list[str]:
        """The connect equations, node by node."""
        lines: list[str] = []
        for (node, _), terminals in self._terminals.items():
            first, *others = terminals
            comment = f" {quoted(self._graph.node_name(node))}" if node != GROUND else ""
            lines += [f"connect({first}, {other}){comment};" for other in others]
        return lines

    def refuse(self) -> None:
        """Raise the error of what cannot be written, if there is any."""
        if self._faults:
            raise CompileError(f"'{self._graph.name}' has no Modelica form: {' '.join(self._faults)}")
        if others := [name for name, value in self._start.items() if value and name not in self._begun]:
            raise CompileError(
                f"'{self._graph.name}': the start value of {others[0]} has no place in an instance of its part. Start "
                "with speeds, currents and voltages alone, or take the form 'flat'."
            )

    def _instance(self, part: GraphPart) -> Iterator[str]:
        values = resolve(part.component)[0]
        name = self._names[part.name]
        if part.branches and {*part.branches} <= {*self._form.tree.redundant}:  # one equation too many for a tool
            yield f"// {part.name}, a {type(part.component).__name__}, is left out: other couplings say the same"
            return
        if type(part.component).__name__ == "Ground":
            node = part.nodes["a"]
            domain = ROTATION if node == GROUND else self._graph.domains[node]
            cls, connector = FRAMES[domain]
            self._join(node, domain, f"{name}.{connector}")
            yield f"{cls} {name} {quoted(part.name)};"
            return
        if part.component.measures:
            self._faults.append(
                f"'{part.name}' reads {part.component.measures[0]}, which no model of a part can. Take the form 'flat'."
            )
            return
        if (standard := standard_class(part, values)) is not None:
            if self._inline and standard.name.endswith("LossyGear"):
                self._faults.append(f"the gear '{part.name}' takes the class {standard.name}, which is not inline.")
            self._join_ports(part, {port: f"{name}.{pin}" for port, pin in standard.ports.items()})
            yield f"{standard.name} {name}({self._standard_values(part, standard, values)}) {quoted(part.name)};"
            return
        try:
            model = part_model(self._form, part)
            cls = self._class_of(model)
        except CompileError as error:
            self._faults.append(str(error))
            return
        self._join_ports(part, {port: f"{name}.{pin}" for port, pin in model.ports.items()})
        numbers = ", ".join(
            f"{text} = {number(values[key])}" for key, text in model.parameters.items() if key in values
        )
        yield f"{cls} {name}{f'({numbers})' if numbers else ''} {quoted(part.name)};"

    def _class_of(self, model: PartModel) -> str:
        """The name of the model of a part; parts with the same equations share one."""
        kind = type(model.part.component).__name__
        body = model.text(kind)
        if body not in self._bodies:
            cls = self._names.unused(kind)
            self._bodies[body] = cls
            self.models[cls] = body.replace(f"model {kind} ", f"model {cls} ", 1).replace(f"end {kind};", f"end {cls};")
        return self._bodies[body]

    def _standard_values(self, part: GraphPart, standard: StandardClass, values: Mapping[str, Any]) -> str:
        pairs = [f"{key} = {_value(of, values)}" for key, of in standard.values.items()]
        states = (*self._form.across_states, *self._form.through_states)
        stores = [branch for branch in part.branches if branch in states]
        if stores and standard.starts:
            name = next(state.name for state in self._form.states if state.branch == stores[0])
            self._begun.append(name)
            starts = dict.fromkeys(standard.starts, 0.0) | {standard.starts[0]: self._start[name]}
            pairs += [f"{key}(start = {number(start)}, fixed = true)" for key, start in starts.items()]
        return ", ".join(pairs)

    def _join_ports(self, part: GraphPart, pins: Mapping[str, str]) -> None:
        for port in part.component.ports:
            if port.name in pins:
                node = part.nodes[port.name]
                domain = port.domain or (ROTATION if node == GROUND else self._graph.domains[node])
                self._join(node, domain, pins[port.name])

    def _join(self, node: int, domain: Domain, terminal: str) -> None:
        if node == GROUND and domain not in self._frames:
            self._frames[domain] = self._names.unused("ground" if not self._frames else f"ground_{domain.name}")
            self._terminals[GROUND, domain] = [f"{self._frames[domain]}.{FRAMES[domain][1]}"]
        self._terminals.setdefault((node, domain), []).append(terminal)


def _value(of: Any, values: Mapping[str, Any]) -> str:
    value = values[of] if isinstance(of, str) else of(values)
    if isinstance(value, bool):
        return str(value).lower()
    return value if isinstance(value, str) else number(value)
