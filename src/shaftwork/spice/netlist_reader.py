"""Circuits from netlists of SPICE and lcapy."""

from __future__ import annotations

import math
import os
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from operator import attrgetter
from pathlib import Path
from typing import Any, Literal

from shaftwork.components.controlled import (
    TransmissionLine,
    VoltageControlledCurrentSource,
    VoltageControlledSwitch,
    VoltageControlledVoltageSource,
)
from shaftwork.components.electrical import Capacitor, Resistor
from shaftwork.core.errors import ModelFileError, ParameterError
from shaftwork.core.parameters import in_si
from shaftwork.network.netlist import REFERENCE, Placed, is_name
from shaftwork.pipeline.network import Network
from shaftwork.results.solution import Solution
from shaftwork.spice.devices import DeviceModel, Devices
from shaftwork.spice.lcapy_devices import LcapyDevices, kind_of, with_joined_nodes
from shaftwork.spice.netlist_lines import ANALYSES, LineError, NetlistLine, flattened, lines_of
from shaftwork.spice.spice_numbers import NetlistValues

Dialect = Literal["spice", "lcapy"]
MOST_FAULTS = 8
"""Lines that an error lists; of more it says how many there are."""
PARAMETERS = (".param", ".params", ".global_param")
READING = (VoltageControlledVoltageSource, VoltageControlledCurrentSource, VoltageControlledSwitch)
"""Parts whose last two ends let no current pass."""
OPEN = 1e12
"""Resistance in ohm of what is open."""
BEFORE = -1e-12
"""Time in s at which what has always been so is read: a step of lcapy comes at zero."""


@dataclass(frozen=True)
class SpiceCircuit:
    """A circuit that was read from a netlist: a network, and how its motion begins and ends.

    Args:
        network: the parts; those of a subcircuit X1 are named "X1.R1", node 0 is "ground".
        initial: start values, "C1.u" and "L1.i", by name in SI.
        from_rest: whether all else is zero at the start; otherwise it begins in the steady state, as SPICE does without
            `uic`.
        t_end: end of the motion in s; None where the netlist has none.
        t_steady: time in s at which sources are read for that steady state.
        swings: what has swung for ever before the start, as the "ac" of lcapy: the input, "V1.u", its angular frequency
            in rad/s and its complex amplitude at time zero.
    """

    network: Network
    initial: Mapping[str, float] = field(default_factory=dict)
    from_rest: bool = False
    t_end: float | None = None
    t_steady: float = 0.0
    swings: tuple[tuple[str, float, complex], ...] = ()

    def start(self, *, algebraic_loops: Literal["refuse", "solve"] = "refuse") -> dict[str, float]:
        """Start values for `Model.simulate`.

        Raises:
            SimulationError: no steady state is there to begin with.
        """
        if self.from_rest:
            return dict(self.initial)
        model = self.network.compile(algebraic_loops=algebraic_loops)
        if not (model.states or model.form.waves):
            return dict(self.initial)
        steady = model.steady_state(t=self.t_steady)
        start = dict(steady)
        if self.swings:
            near = model.linearize(steady, t=self.t_steady)
            for source, omega, amplitude in self.swings:
                for name in near.states:
                    response = near.frequency_response(source, name, abs(omega) / (2 * math.pi)).values[0]
                    start[name] += (response * (amplitude if omega > 0 else amplitude.conjugate())).real
        return {**start, **self.initial}

    def simulate(
        self, t_end: float | None = None, *, algebraic_loops: Literal["refuse", "solve"] = "refuse", **options: Any
    ) -> Solution:
        """The motion that the netlist describes; the options are those of `Network.simulate`.

        Args:
            t_end: end of the motion, s; by default that of the netlist.
            algebraic_loops: as of `Network.compile`.

        Raises:
            ParameterError: neither is there an end in the netlist nor one given.
            SimulationError: no steady state is there to begin with.
        """
        end = self.t_end if t_end is None else t_end
        if end is None:
            raise ParameterError("The netlist has no .tran that says when its motion ends. Give t_end, in s.")
        options = {"initial": self.start(algebraic_loops=algebraic_loops), **options}
        return self.network.simulate(end, algebraic_loops=algebraic_loops, **options)


def read(
    source: str | os.PathLike[str],
    values: Mapping[str, Any] | None = None,
    *,
    dialect: Dialect | None = None,
    ideal_diodes: bool = False,
) -> SpiceCircuit:
    """A circuit from a netlist of SPICE or lcapy: R, L, C, V, I, E, F, G, H, K, T, D, S, X; of lcapy W, TF and SW too.

    What is not understood is refused with its line. Nothing in a netlist is executed, and no other file is read.

    Args:
        source: a str is the text itself, a `pathlib.Path` the place of a file.
        values: of names that stand in place of numbers, {"R1": 50.0}; they win over .param.
        dialect: by default "lcapy" where lines have drawing hints behind a semicolon, or wires; else "spice", where the
            first line is the title.
        ideal_diodes: diodes conduct without voltage, instead of exponentially by their model.

    Raises:
        ModelFileError: there is no such file, or lines are not understood; lists them.
        ParameterError: an argument is none of these.
    """
    if not isinstance(source, str | os.PathLike):
        raise ParameterError(f"source = {source!r} must be the text of a netlist, or the pathlib.Path of a file.")
    title, text = ("netlist", source) if isinstance(source, str) else (os.fspath(source), _text_of(Path(source)))
    if dialect not in (None, "spice", "lcapy"):
        raise ParameterError(f"dialect = {dialect!r} must be 'spice', 'lcapy' or None.")
    if values is not None and not isinstance(values, Mapping):
        raise ParameterError(f"values = {values!r} must map names to numbers, such as {{'R1': 50.0}}.")
    numbers = {str(name): in_si(f"values['{name}']", value) for name, value in (values or {}).items()}
    try:
        return _NetlistReader(text, numbers, dialect or _dialect_of(text), ideal_diodes).circuit(Path(title).stem)
    except ModelFileError as error:
        raise ModelFileError(f"{title}: {error}") from None


def _text_of(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise ModelFileError(f"'{path}' cannot be read: {error.strerror}.") from None


def _dialect_of(text: str) -> Dialect:
    rows = [row.strip() for row in text.splitlines()]
    hints = ("right", "left", "up", "down", "rotate")
    drawn = any(hint.strip().startswith(hints) for row in rows for hint in row.partition(";")[2].split(","))
    return "lcapy" if drawn or any(row[:1] == "W" and len(row.split()) == 3 for row in rows[1:]) else "spice"


class _NetlistReader:
    """Reads one netlist."""

    def __init__(self, text: str, values: Mapping[str, float], dialect: Dialect, ideal_diodes: bool) -> None:  # noqa: FBT001
        self._lcapy, self._ideal_diodes = dialect == "lcapy", ideal_diodes
        names = values if self._lcapy else {name.lower(): value for name, value in values.items()}
        self._values = NetlistValues(names, lcapy=self._lcapy)
        self._title = "" if self._lcapy else (text.splitlines() or [""])[0].strip().lstrip("*").strip()
        lines = lines_of(text, lcapy=self._lcapy)
        self._lines = with_joined_nodes(lines) if self._lcapy else flattened(lines, self._values.parameters)
        self._models: dict[str, DeviceModel] = {}
        self._start_voltages: list[tuple[NetlistLine, str, str]] = []
        self._faults: list[LineError] = []
        self._span: tuple[float, float] = (0.0, 0.0)
        self._uic: NetlistLine | None = None

    def circuit(self, title: str) -> SpiceCircuit:
        """The circuit."""
        elements = [line for line in self._lines if line.command[0] != "."]
        for line in self._lines:
            if line.command in PARAMETERS:
                self._attempt(line, self._parameter)
        for name, (line, *_) in [*self._values.parameters.texts.items()]:
            self._attempt(line, lambda line, name=name: self._values.parameter(line, name))
        for line in self._lines:
            if line.command[0] == "." and line.command not in PARAMETERS:
                self._attempt(line, self._command)
        devices = self._devices(elements)
        for line in sorted(elements, key=lambda line: _turn(self._kind(line))):
            self._attempt(line, devices.couple if self._kind(line) == "K" else devices.add)
        begins = self._lcapy or self._uic is not None  # otherwise SPICE begins in the steady state, whatever IC says
        initial = {**devices.initial, **self._voltages(devices.placed)} if begins else {}
        if self._start_voltages and not begins:
            self._faults.append(
                self._start_voltages[0][0].error("without uic in .tran it holds a node, which is not read")
            )
        charged = any(name.endswith(".u") and value for name, value in initial.items())
        if self._uic and charged and any(isinstance(item.part, TransmissionLine) for item in devices.placed):
            self._faults.append(
                self._uic.error(
                    "it begins with charged capacitors and lines without charge, which is not read together"
                )
            )
        self._refuse()
        if not devices.placed:
            why = "A str is the text of a netlist; give a file as pathlib.Path(...)."
            raise ModelFileError(f"it has no elements. {why}")
        if all(REFERENCE not in item.nodes for item in devices.placed):
            raise ModelFileError("no element is at node 0, the reference. Join one to it.")
        network = Network(self._title if is_name(self._title) else title)
        for item in _with_names([*devices.placed, *_open_ends(devices.placed)]):
            network.add(item.part, *item.nodes)
        from_rest = self._uic is not None or (self._lcapy and bool(initial))
        t_steady = BEFORE if self._lcapy else 0.0
        return SpiceCircuit(network, initial, from_rest, self._span[1] or None, t_steady, tuple(devices.swings))

    def _kind(self, line: NetlistLine) -> str:
        return kind_of(line.words[0]) if self._lcapy else line.command[0].upper()

    def _devices(self, elements: list[NetlistLine]) -> Devices:
        followers = (line for line in elements if self._kind(line) in _FOLLOWERS and len(line.words) > 3)
        followed = Counter(f"{line.prefix}{line.words[3]}".lower() for line in followers)
        kind = LcapyDevices if self._lcapy else Devices
        return kind(self._values, self._models, self._span, followed, self._ideal_diodes)

    def _attempt(self, line: NetlistLine, step: Any) -> None:
        try:
            step(line)
        except LineError as error:
            self._faults.append(error)
        except ParameterError as error:  # of a part whose values are out of their bounds
            self._faults.append(line.error(str(error)))
        except RecursionError:
            self._faults.append(line.error("its parameters read others, and these others, more than 100 deep"))

    def _parameter(self, line: NetlistLine) -> None:
        self._values.parameters.add(line, line.parameters())

    def _command(self, line: NetlistLine) -> None:
        command = line.command[1:]
        if command in ANALYSES:
            return
        match command:
            case "model":
                self._model(line)
            case "ic":
                self._starts(line)
            case "tran":
                self._analysis(line)
            case _:
                raise line.error(f"the command .{command} is not read. Write what it brings into the netlist")

    def _model(self, line: NetlistLine) -> None:
        if len(line.words) < 3:
            raise line.error("a model has a name and a type")
        model = line, line.words[2].lower(), line.pairs(3)
        if (first := self._models.setdefault(f"{line.prefix}{line.words[1]}".lower(), model)) is not model:
            raise line.error(f"line {first[0].number} has this model, too, and ngspice would take that. Rename one")

    def _starts(self, line: NetlistLine) -> None:
        words = [word for word in line.words[1:] if word not in "(),"]
        if len(words) % 4 or any(
            group[0].lower() != "v" or group[2] != "=" for group in zip(*[iter(words)] * 4, strict=True)
        ):
            raise line.error("start values are written .ic V(node)=value")
        for _, node, _, value in zip(*[iter(words)] * 4, strict=True):
            self._start_voltages.append((line, line.node(node), value))

    def _analysis(self, line: NetlistLine) -> None:
        words = [word.lower() for word in line.words[1:]]
        if "uic" in words:
            self._uic = line
        times = [self._values.number(line, word) for word in words if word != "uic"]
        if not 2 <= len(times) <= 4 or min(times) < 0 or not times[1]:
            raise line.error("it is written .tran step end, the end above zero, with uic to begin from rest")
        self._span = times[0], times[1]

    def _voltages(self, placed: list[Placed]) -> dict[str, float]:
        """Start voltages of capacitors between nodes whose voltages are given."""
        if not self._start_voltages:
            return {}
        voltages = {REFERENCE: 0.0}
        for line, node, text in self._start_voltages:
            try:
                voltages[node] = self._values.number(line, text)
            except LineError as error:
                self._faults.append(error)
        initial: dict[str, float] = {}
        for item in placed:
            if isinstance(item.part, Capacitor):
                first, second = (voltages.get(node, 0.0) for node in item.nodes)
                initial |= {f"{item.part.name}.u": first - second} if first != second else {}
        return initial

    def _refuse(self) -> None:
        """Refuse what was not understood.

        Raises:
            ModelFileError: there is any; lists the lines.
        """
        faults = [*dict.fromkeys(map(str, sorted(self._faults, key=attrgetter("number"))))]
        if faults:
            rest = f"\n  and {len(faults) - MOST_FAULTS} lines more" if len(faults) > MOST_FAULTS else ""
            count = "a line is" if len(faults) == 1 else f"{len(faults)} lines are"
            rows = "\n  ".join(faults[:MOST_FAULTS])
            raise ModelFileError(f"{count} not understood:\n  {rows}{rest}")
        if missing := self._values.missing:
            name, line = next(iter(missing.items()))
            raise ModelFileError(
                f"{len(missing)} names have no value: {', '.join(missing)}; '{name}' stands in line {line.number}. "
                f"Give them, values={{'{name}': 1.0}}."
            )


_FOLLOWERS = ("F", "H", "CCCS", "CCVS")


def _turn(kind: str) -> int:
    """When an element is made: what follows a current after all sources, what couples inductors after these."""
    return 2 if kind == "K" else int(kind in _FOLLOWERS)


def _open_ends(placed: list[Placed]) -> Iterator[Placed]:
    """A resistor to the reference at each node that one element alone reaches: SPICE lets it be, a network does not."""
    reached = Counter(node for item in placed for node in item.nodes[: 2 if isinstance(item.part, READING) else None])
    for node in dict.fromkeys(node for item in placed for node in item.nodes):
        if reached[node] < 2 and node != REFERENCE:
            yield Placed(Resistor(f"open {node}", R=OPEN), (node, REFERENCE))


def _with_names(placed: list[Placed]) -> Iterator[Placed]:
    """Parts at nodes that have the name of no part: quantities are read by either."""
    names = {item.part.name for item in placed}  # only asked for membership
    for item in placed:
        yield replace(item, nodes=tuple(f"{node} node" if node in names else node for node in item.nodes))
