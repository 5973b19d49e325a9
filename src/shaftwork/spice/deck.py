"""A network as a deck for ngspice: its analogue circuit, in which speeds are voltages and torques currents."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping
from typing import Any

from shaftwork.core.errors import CompileError, Diagnostic, NetworkError, ParameterError
from shaftwork.core.parameters import in_si
from shaftwork.formulation.form import StateForm, integral_name, store_name
from shaftwork.formulation.sampling_instants import refuse_sampled
from shaftwork.network.graph import GraphPart
from shaftwork.network.kinds import Kind
from shaftwork.network.netlist import REFERENCE, title
from shaftwork.pipeline.model import Model
from shaftwork.spice.smoothed_modes import SmoothedPart, smoothed
from shaftwork.spice.spice_elements import Elements
from shaftwork.spice.spice_laws import NoSpiceFormError

STEPS = 8000
"""Steps of a run where no step is given: 80 for each period of 100 of them, which turns each by 5e-4 of itself."""
EDGE = 1e-3
"""Share of a step in which a jump rises; ngspice takes corners apart that are 5e-5 of a step from each other."""
SMOOTH = 1e-4
"""Speed in rad/s over which a friction changes its sign: of some 100 rad/s that is 1e-6."""
CONDUCTING, BLOCKING = 1e6, 1e-9
"""Conductances in S, N m s/rad, of what is rigid or open: far beyond those of drive trains in SI."""
OPTIONS = "reltol=1e-6 abstol=1e-12 vntol=1e-9 chgtol=1e-18 pivrel=0.1 method=trap"
"""With the small pivots that ngspice takes by default, rounding in undamped trains is a curvature to its step control,
which then gives up."""
WIDTH, UNBROKEN = 110, "\xa0"
"""Signs of a line; and a space at which none ends."""
HEAD = """\
* {name}
* Analogue circuit: speeds (rad/s, m/s) are voltages, torques (N m) and forces (N) currents,
* inertias and masses capacitors, springs inductors, dampers resistors, gears pairs of controlled sources.
* Run it with: ngspice -b FILE"""


def deck(model: Model, t_end: float, step: float | None, initial: Any) -> str:
    """The text of a deck: `Network.to_spice` says of what.

    Raises:
        NetworkError: the network cannot be assembled, or has parts that SPICE has no form for; lists every reason.
        CompileError: a controller samples.
        ParameterError: a time is not above zero.
    """
    end = in_si("t_end", t_end, "s", above=0)
    longest = end / STEPS if step is None else in_si("step", step, "s", above=0)
    if longest > end:
        raise ParameterError(
            f"step = {longest:g} s is longer than t_end = {end:g} s. Leave it out for t_end / {STEPS}."
        )
    form = model.form
    refuse_sampled(form, "no circuit does what it does", CompileError)
    parts, problems = _smoothed(form)
    elements = Elements(form.graph, parts, form.tree.redundant, _stored(model, initial), end, EDGE * longest)
    lines: list[str] = []
    for part in form.graph.parts:
        try:
            lines += ["", *_comments(part, parts, form), *elements.of_part(part)]
        except NoSpiceFormError as error:
            problems.append(_problem(part, error, form))
    if problems:
        raise NetworkError(f"'{model.name}' cannot be written for SPICE", tuple(problems))
    rest = _section("Angles (rad), positions (m) and accelerations that laws read", elements.rest())
    ends = "Switches from 0 to 1 at a time, and corners where laws bend: steps of ngspice end there"
    lines = [*_parameters(lines), *lines, *rest, *_section(ends, elements.clocks())]
    head = HEAD.format(name=" ".join(model.name.split())).splitlines()
    return "\n".join(_wrapped([*head, *lines, *_analysis(elements, form, end, longest)])) + "\n"


def _smoothed(form: StateForm) -> tuple[dict[str, SmoothedPart], list[Diagnostic]]:
    parts: dict[str, SmoothedPart] = {}
    problems: list[Diagnostic] = []
    for part in form.graph.parts:
        try:
            parts[part.name] = smoothed(part, form.graph)
        except NoSpiceFormError as error:
            problems.append(_problem(part, error, form))
    return parts, problems


def _problem(part: GraphPart, error: NoSpiceFormError, form: StateForm) -> Diagnostic:
    nodes = tuple(form.graph.node_name(number) for number in part.nodes.values())
    return Diagnostic("no SPICE form", f"{title(part.component)}: {error}.", error.instead, (part.name,), nodes)


def _stored(model: Model, initial: Any) -> dict[int, float]:
    """What is stored at the start, by branch; nothing at rest."""
    if not initial:
        return {}
    start = model.simulate(1e-12, initial=initial, t_eval=2)
    form, graph = model.form, model.form.graph
    names = {b.index: store_name(graph, b) for b in graph.branches if b.template.kind in _STORES}
    names |= {index: integral_name(graph, graph.branches[index]) for index in form.integrals}
    return {index: float(start[name][0]) for index, name in names.items()}


_STORES = (Kind.ACROSS_STORE, Kind.THROUGH_STORE)


def _comments(part: GraphPart, parts: Mapping[str, SmoothedPart], form: StateForm) -> Iterator[str]:
    component = part.component
    nodes = ", ".join(form.graph.node_name(part.nodes[port.name]) for port in component.ports)
    values = (
        f"{name} = {value!r} {component.declared[name].unit}".removesuffix(" 1").replace(" ", UNBROKEN)
        for name, value in component.values.items()
        if isinstance(value, int | float)
    )
    yield f"* {type(component).__name__} '{part.name}' at {nodes}: {', '.join(values)}".removesuffix(": ")
    for note in dict.fromkeys(parts.get(part.name, SmoothedPart()).notes):
        yield f"* ({note})"


def _parameters(lines: list[str]) -> Iterator[str]:
    """The parameters that laws read, each with what it means."""
    for name, value, meaning in (
        ("smooth", SMOOTH, "speed over which a friction changes its sign, rad/s or m/s"),
        ("g_on", CONDUCTING, "conductance of what conducts or is locked"),
        ("g_off", BLOCKING, "conductance of what blocks or is free"),
    ):
        if any(f"{{{name}}}" in line for line in lines):
            yield f".param {name}={value!r} ; {meaning}"


def _section(about: str, lines: Iterator[str]) -> list[str]:
    """Lines below a comment that says what they are; nothing where there are none."""
    section = [*lines]
    return ["", f"* {about}", *section] if section else []


def _analysis(elements: Elements, form: StateForm, t_end: float, step: float) -> Iterator[str]:
    yield ""
    yield f".options {OPTIONS}"
    yield f".tran {step!r} {t_end!r} 0 {step!r} uic"
    outer = dict.fromkeys(part.nodes[port.name] for part in form.graph.parts for port in part.component.ports)
    names = [elements.node(number) for number in outer if form.graph.node_name(number) != REFERENCE]
    yield f".print tran {' '.join(f'v({name})' for name in names)}"
    yield ".end"


def _wrapped(lines: list[str]) -> Iterator[str]:
    """Lines of at most `WIDTH` signs; what is longer goes on behind a plus."""
    for line in lines:
        follows = "*   " if line.startswith("*") else "+   "
        rows = textwrap.wrap(line, WIDTH, subsequent_indent=follows, break_long_words=False, break_on_hyphens=False)
        yield from (row.replace(UNBROKEN, " ") for row in rows or [""])
