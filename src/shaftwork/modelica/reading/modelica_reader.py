"""A Modelica model of plain parts as a network: what it declares, connects and starts from."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from shaftwork.components.mechanics import Ground
from shaftwork.core.errors import ModelFileError, ShaftworkError
from shaftwork.modelica.modelica_expressions import Identifiers
from shaftwork.modelica.reading.modelica_syntax import ClassText, Declaration, Modification, parse
from shaftwork.modelica.reading.modelica_terminals import JoinedTerminals
from shaftwork.modelica.reading.modelica_tokens import LONGEST, fault
from shaftwork.modelica.reading.modelica_values import ModelicaValues
from shaftwork.modelica.reading.read_classes import (
    BLOCKS,
    CLASSES,
    REQUIRED,
    SIGNALS,
    SPRINGS_BELOW,
    ReadClass,
    UnreadError,
    can_be_supported,
    supported,
)
from shaftwork.network.netlist import REFERENCE, Netlist, Origin, Placed
from shaftwork.pipeline.network import Network
from shaftwork.results.solution import Solution

_QUANTITY = re.compile(r"(Real|Integer|Boolean|String)|(.*\.)?(SI|SIunits|NonSI|Types)\.\w+", re.ASCII)
_ASIDE = re.compile(
    r"useHeatPort|T|T_ref|alpha|stateSelect|animation|useSupport[RT]?|smoothness|(phi|s)_nominal|[wv]_small"
)
"""Parameters that change nothing that is read."""
_SPEEDS, _ANGLES = {"w": "omega", "v": "v"}, ("phi", "s")
_RELATIVE = {"w_rel": "omega_rel", "v_rel": "v_rel"}
_STORES = {"Inductor": {"i": "i"}, "Capacitor": {"v": "u"}}


@dataclass(frozen=True)
class ModelicaModel:
    """A model that was read: a network, and what a Modelica file says of its motion besides.

    Args:
        network: its parts, named as in the file.
        initial: start values as `Model.simulate` takes them, {"J1.omega": 3.0}.
        t_end: end of its experiment, s; None where it has none.
    """

    network: Network
    initial: Mapping[str, float]
    t_end: float | None

    def simulate(self, t_end: float | None = None, **options: Any) -> Solution:
        """The motion from the start values of the file, by default to the end of its experiment.

        Args:
            t_end: s.
            options: as for `Network.simulate`.

        Raises:
            ModelFileError: neither the file nor the call says where it ends.
        """
        if t_end is None and self.t_end is None:
            raise ModelFileError("The model has no experiment(StopTime = ...). Give t_end.")
        end = self.t_end if t_end is None else t_end
        return self.network.simulate(end, **{"initial": self.initial or None, **options})  # type: ignore[arg-type]


def read_modelica(source: str | Path, model: str | None = None) -> ModelicaModel:
    """Read a Modelica model of parts of the Modelica Standard Library: Rotational, Translational, Electrical.Analog.

    Read are parameters with arithmetic, parts with their values and start values, connect, and blocks that give
    signals of time. Anything else is refused with its line. Nothing in the file is executed.

    Args:
        source: the path of a file; or its text, which has more than one line.
        model: its name, where the file has several.

    Raises:
        ModelFileError: the file cannot be read as a network; says where and why.
    """
    text, name = _text_of(source)
    try:
        within, classes = parse(text)
        chosen, outer = _chosen(classes, model)
        return _Reading(name, chosen, within, outer).result()
    except ModelFileError as error:
        raise ModelFileError(f"{name}: {error}") from None


def _text_of(source: str | Path) -> tuple[str, str]:
    if isinstance(source, str) and "\n" in source.strip():
        return source, "Modelica text"
    if not isinstance(source, str | Path) or not str(source).strip() or "\0" in str(source):
        raise ModelFileError(f"{source!r} is neither the path of a Modelica file nor a text of several lines.")
    try:
        with Path(source).open(encoding="utf-8-sig") as file:
            return file.read(LONGEST + 1), str(source)
    except (OSError, UnicodeDecodeError) as error:
        why = getattr(error, "strerror", None) or error
        raise ModelFileError(f"{source} cannot be read: {why}. Give the path of a Modelica file.") from None


def _chosen(classes: tuple[ClassText, ...], wanted: str | None) -> tuple[ClassText, tuple[ClassText, ...]]:
    """The class that is read, and those around it."""
    candidates = list(_models(classes, ()))
    if wanted is not None:
        candidates = [(one, outer) for one, outer in candidates if wanted in _names_of(one, outer)]
    else:
        candidates = [(one, outer) for one, outer in candidates if one.connects] or candidates
    if len(candidates) != 1:
        names = ", ".join(_names_of(one, outer)[-1] for one, outer in _models(classes, ())) or "none"
        what = "no such model" if wanted is not None and not candidates else f"{len(candidates)} models to choose from"
        raise ModelFileError(f"there is {what}. Name one of: {names}.")
    return candidates[0]


def _models(classes: Any, outer: tuple[ClassText, ...]) -> Iterator[tuple[ClassText, tuple[ClassText, ...]]]:
    for one in classes:
        if one.kind in ("model", "block", "class"):
            yield one, outer
        yield from _models(one.classes, (*outer, one))


def _names_of(one: ClassText, outer: tuple[ClassText, ...]) -> tuple[str, str]:
    return one.name, ".".join(part.name for part in (*outer, one))


@dataclass
class _ModelInstance:
    """A part of the file."""

    declaration: Declaration
    entry: ReadClass
    values: dict[str, Any]
    starts: dict[str, float]


class _Reading:
    """Makes a network of a class."""

    def __init__(self, source: str, text: ClassText, within: str, outer: tuple[ClassText, ...]) -> None:
        self._source, self._text = source, text
        self._imports = {k: v for one in (*outer, text) for k, v in one.imports.items()}
        names = [*filter(None, within.split(".")), *(one.name for one in outer)]
        self._around = [".".join(names[:k]) for k in range(len(names), 0, -1)]
        terms = {d.name: d.value for one in (*outer, text) for d in one.declarations if _is_parameter(d)}
        self._values = ModelicaValues(terms)
        self._nodes, self._places = JoinedTerminals(), JoinedTerminals()
        self._signals: dict[str, Any] = {}
        self._instances: dict[str, _ModelInstance] = {}
        names = [declaration.name for declaration in text.declarations]
        other = Identifiers(names).unused("frame")
        self._names = {**{name: name for name in names}, REFERENCE: other}  # which no part can be called
        self._inputs: dict[str, str] = {}
        self._joined = set[str]()  # only asked for membership

    def result(self) -> ModelicaModel:
        """The network and what belongs to it."""
        for line, what in sorted(self._text.faults):
            raise fault(line, what)
        for declaration in self._text.declarations:
            self._declare(declaration)
        for first, second, line in self._text.connects:
            self._connect(first, second, line)
        if not self._instances:
            raise fault(self._text.line, f"'{self._text.name}' has no parts that are read.")
        frame = self._frame()
        placed = [item for name, instance in self._instances.items() for item in self._placed(name, instance, frame)]
        taken = {node for item in placed if not isinstance(item.part, Ground) for node in item.nodes}
        parts: list[Placed] = []
        for item in placed:
            if not isinstance(item.part, Ground):
                parts.append(item)
            elif item.nodes[0] in taken:  # one holds the node, and one where nothing else is holds nothing
                parts.append(item)
                taken.remove(item.nodes[0])
        network = Network._of(Netlist(self._text.name, tuple(parts)))  # noqa: SLF001 (as `Network.load` does)
        if self._text.t_start is not None and self._values.of(self._text.t_start) != 0.0:
            raise fault(self._text.t_start_line, "an experiment that begins at another StartTime than 0 is not read.")
        end = None if self._text.t_end is None else self._values.of(self._text.t_end)
        return ModelicaModel(network, self._initial(), end if isinstance(end, float) and end > 0 else None)

    # declarations

    def _declare(self, declaration: Declaration) -> None:
        if _is_parameter(declaration):
            return
        line, name = declaration.line, declaration.name
        if _QUANTITY.fullmatch(declaration.type):
            if declaration.value is None:
                raise fault(line, f"the variable '{name}' is not read: its equation could be anything.")
            return  # it shows something and changes nothing
        if declaration.is_array:
            raise fault(line, f"'{name}' is an array of parts, which is not read. Write them one by one.")
        if declaration.condition is not None and self._values.of(declaration.condition) is False:
            return
        if name in self._instances or name in self._signals:
            raise fault(line, f"'{name}' is declared twice.")
        full = self._full_name(declaration.type)
        block = full.removeprefix(f"{BLOCKS}.")
        if full.startswith(BLOCKS) and block in SIGNALS:
            defaults, law = SIGNALS[block]
            values, _ = self._modifiers(declaration, defaults)
            self._signals[name] = self._built(lambda: law(values), line, name)
        elif full in CLASSES:
            entry = CLASSES[full]
            values, starts = self._modifiers(declaration, entry.values)
            self._instances[name] = _ModelInstance(declaration, entry, values, starts)
            for other in entry.rigid[1:]:
                self._nodes.join(f"{name}.{entry.rigid[0]}", f"{name}.{other}")
        else:
            raise fault(
                line,
                f"'{name}' is of the class '{declaration.type}', which is not read. Read are parts of "
                "Modelica.Mechanics.Rotational, Translational and Electrical.Analog that docs/modelica.md lists.",
            )

    def _full_name(self, name: str) -> str:
        first, dot, rest = name.partition(".")
        candidates = [f"{self._imports[first]}{dot}{rest}"] if first in self._imports else []
        candidates += [f"{self._imports['*']}.{name}"] if "*" in self._imports else []
        candidates += [name, *(f"{place}.{name}" for place in self._around)]
        classes = (*CLASSES, *(f"{BLOCKS}.{block}" for block in SIGNALS))
        return next((candidate for candidate in candidates if candidate in classes), name)

    def _modifiers(
        self, declaration: Declaration, defaults: Mapping[str, Any]
    ) -> tuple[dict[str, Any], dict[str, float]]:
        """The values of a part, and its start values."""
        values, starts = dict(defaults), dict[str, float]()
        for modifier in declaration.modifiers:
            if modifier.name in defaults or (modifier.name == "freqHz" and "f" in defaults):
                if modifier.value is None:
                    raise fault(modifier.line, f"'{declaration.name}.{modifier.name}' has no value.")
                key = "f" if modifier.name == "freqHz" else modifier.name
                values[key] = self._values.of(modifier.value)
            elif modifier.inner and modifier.value is None:
                starts |= self._start(modifier)
            elif not _ASIDE.fullmatch(modifier.name):
                raise fault(
                    modifier.line,
                    f"'{declaration.name}' has no parameter '{modifier.name}' that is read. It has: "
                    f"{', '.join(defaults) or 'none'}.",
                )
        return values, starts

    def _start(self, modifier: Modification) -> dict[str, float]:
        inner = {one.name: one for one in modifier.inner}
        fixed = inner.get("fixed")
        begins = inner.get("start")
        value = 0.0 if begins is None or begins.value is None else self._values.of(begins.value)
        is_fixed = fixed is not None and fixed.value is not None and self._values.of(fixed.value) is True
        if not isinstance(value, float):
            raise fault(modifier.line, f"the start of '{modifier.name}' is no number.")
        if modifier.name in (*_SPEEDS, *_ANGLES, "phi_rel", "s_rel", "i") or (modifier.name in _RELATIVE and is_fixed):
            return {modifier.name: value}
        if is_fixed and (value or modifier.name.startswith("a")):
            raise fault(modifier.line, f"a fixed start of '{modifier.name}' is not read. Give speeds and angles.")
        return {}

    # connections

    def _connect(self, first: str, second: str, line: int) -> None:
        one, other = (self._terminal(name, line) for name in (first, second))
        if one[0] == other[0] == "node":
            self._nodes.join(first, second)
            self._places.join(first, second)
            self._joined |= {first, second}
            return
        pairs = {one[0]: first, other[0]: second}
        if pairs.keys() == {"output", "input"}:
            self._inputs[pairs["input"]] = pairs["output"].partition(".")[0]
        elif "measured" not in pairs:
            raise fault(line, f"connect({first}, {second}) joins what is not read as a pair.")

    def _terminal(self, name: str, line: int) -> tuple[str, str]:
        """What a connector is: a node, the output or input of a signal, or what a sensor shows."""
        owner, _, port = name.partition(".")
        if owner in self._signals and port == "y":
            return "output", owner
        if (instance := self._instances.get(owner)) is not None:
            entry = instance.entry
            if port in entry.connectors or (port == "support" and entry.support):
                return "node", owner
            if port and port == entry.signal:
                return "input", owner
            if ".Sensors." in self._full_name(instance.declaration.type):
                return "measured", owner
        raise fault(line, f"there is no connector '{name}' that is read.")

    def _frame(self) -> frozenset[str]:
        """The nodes at the frame."""
        return frozenset(
            self._nodes.of(f"{name}.{instance.entry.connectors[0]}")
            for name, instance in self._instances.items()
            if instance.declaration.type.endswith("Fixed")
        )

    # parts

    def _placed(self, name: str, instance: _ModelInstance, frame: frozenset[str]) -> list[Placed]:
        """The parts of an instance at their nodes."""
        line, entry = instance.declaration.line, instance.entry
        if (signal := self._inputs.get(f"{name}.{entry.signal}")) is not None:
            instance.values[entry.signal] = self._signals[signal]
        if missing := [key for key, value in instance.values.items() if value is REQUIRED]:
            raise fault(line, f"'{name}' has no value of '{missing[0]}'. Give it in the file.")
        parts = self._built(lambda: list(entry.make(self._names[name], instance.values)), line, name)
        supports = (one.value for one in instance.declaration.modifiers if one.name.startswith("useSupport"))
        if f"{name}.support" not in self._joined and any(
            v is not None and self._values.of(v) is True for v in supports
        ):
            raise fault(line, f"the support of '{name}' is joined to nothing. Join it to a Fixed, or leave it out.")
        if f"{name}.support" in self._joined and self._nodes.of(f"{name}.support") not in frame:
            if not all(map(can_be_supported, parts)):
                raise fault(line, f"the support of '{name}' is not at a Fixed, which alone is read.")
            parts = self._built(lambda: [supported(*placed) for placed in parts], line, name)
        origin = Origin(self._source, {"": line})
        return [
            Placed(part, tuple(self._node(f"{name}.{port}") for port in ports), origin=origin) for part, ports in parts
        ]

    def _node(self, terminal: str) -> str:
        """The name of the node at a terminal; a dot in it would be one inside a part."""
        return self._nodes.of(terminal).replace(".", "_")

    def _built(self, build: Any, line: int, name: str) -> Any:
        try:
            return build()
        except (UnreadError, ShaftworkError, ArithmeticError, TypeError, ValueError) as error:
            why = (str(error).splitlines() or [type(error).__name__])[0].rstrip(".")
            raise fault(line, f"'{name}': {why}.") from None

    # the start

    def _initial(self) -> dict[str, float]:
        """Start values of speeds, and of twists that follow from angles and lengths."""
        initial: dict[str, float] = {}
        positions = dict(self._positions())
        for name, instance in self._instances.items():
            kind = instance.declaration.type.rpartition(".")[2]
            letters = {"Inertia": _SPEEDS, "Mass": _SPEEDS, **_STORES}.get(kind, {})
            initial |= {f"{name}.{letters[key]}": start for key, start in instance.starts.items() if key in letters}
        rests = not any(initial.values())
        initial = {key: value for key, value in initial.items() if not rests}
        for name, instance in self._instances.items():
            kind = instance.declaration.type.rpartition(".")[2]
            for key, ours in _RELATIVE.items():
                if key in instance.starts and not (rests and not instance.starts[key]):
                    initial[f"{name}.{ours}"] = -instance.starts[key]
            if instance.entry.compliant:
                twist = self._twist(name, instance, positions)
                if twist:
                    letter = "s" if "s_rel0" in instance.values else "phi"
                    relative = "" if instance.values.get("b", 0.0) > SPRINGS_BELOW else "_rel"  # a gap has its angle
                    initial[f"{name}.{letter}{relative}"] = twist
        return initial

    def _twist(self, name: str, instance: _ModelInstance, positions: Mapping[str, float]) -> float:
        """The twist of a against b beyond the relaxed one."""
        relaxed = instance.values.get("phi_rel0", instance.values.get("s_rel0", 0.0))
        for key in ("phi_rel", "s_rel"):
            if key in instance.starts:
                return float(relaxed - instance.starts[key])
        ends = [positions.get(self._places.of(f"{name}.{port}")) for port in ("flange_a", "flange_b")]
        if None in ends:
            if any(positions.values()) or relaxed:
                raise fault(
                    instance.declaration.line, f"the angle or position at an end of '{name}' at the start is not told."
                )
            return 0.0
        return float(ends[0] - ends[1] + relaxed)  # type: ignore[operator]

    def _positions(self) -> Iterator[tuple[str, float]]:
        """The angle or position at the start of what is joined to masses and fixed places."""
        for name, instance in self._instances.items():
            kind, values = instance.declaration.type.rpartition(".")[2], instance.values
            if kind == "Fixed":
                yield self._places.of(f"{name}.flange"), values.get("phi0", values.get("s0", 0.0))
            elif kind in ("Inertia", "Mass"):
                middle = next((instance.starts[key] for key in _ANGLES if key in instance.starts), 0.0)
                for port in instance.entry.connectors:
                    parameter, factor = dict(instance.entry.shift).get(port, ("", 0.0))
                    yield self._places.of(f"{name}.{port}"), middle + factor * values.get(parameter, 0.0)


def _is_parameter(declaration: Declaration) -> bool:
    return bool({"parameter", "constant"} & set(declaration.prefixes)) and bool(_QUANTITY.fullmatch(declaration.type))
