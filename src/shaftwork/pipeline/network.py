"""The network with its verbs: check, equations, compile, simulate, save and load."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self

from shaftwork.core.errors import Diagnostic, ParameterError
from shaftwork.equations.kirchhoff import kirchhoff
from shaftwork.equations.records import Equations, NamedPhase
from shaftwork.network.graph import CircuitGraph
from shaftwork.network.netlist import Netlist
from shaftwork.pipeline.arguments import Point, Time, as_names
from shaftwork.pipeline.compiler import Compiler, diagnose_motion, sound
from shaftwork.pipeline.exported_network import ExportedNetwork
from shaftwork.pipeline.model import Model
from shaftwork.results.solution import Solution

if TYPE_CHECKING:
    from shaftwork.analogues.analogy import Analogy
    from shaftwork.core.domains import Domain
    from shaftwork.frequency.analysis import SmallMotions
    from shaftwork.frequency.campbell import Campbell
    from shaftwork.frequency.frequency_response import FrequencyResponse
    from shaftwork.frequency.natural_modes import NaturalModes
    from shaftwork.lagrange.lagrange import Lagrangian

LOOP = "algebraic loop"
"""The kind of problem that `algebraic_loops="solve"` accepts."""


class Network(ExportedNetwork):
    """A drive train: parts joined at nodes.

    Examples:
        >>> import shaftwork as sw
        >>> net = sw.Network("two masses")
        >>> _ = net.add(sw.TorqueSource("motor", tau=10.0), "rotor")
        >>> _ = net.add(sw.Inertia("J1", J=2.0), "rotor")
        >>> _ = net.add(sw.Spring("shaft", c=1e4, d=1.0), "rotor", "wheel")
        >>> _ = net.add(sw.Inertia("J2", J=3.0), "wheel")
        >>> round(float(net.simulate(t_end=1.0)["J1.omega"][-1]), 2)
        2.0
    """

    analogy: Analogy | None = None
    """Of a network that `circuit` or `dual` made, what the quantities of the first network are in it."""

    def check(self) -> tuple[Diagnostic, ...]:
        """Everything that is wrong with the network or worth saying about it. Never raises."""
        return diagnose_motion(self.netlist())[1]

    def graph(self) -> CircuitGraph:
        """The circuit graph: nodes, parts and an ordered table of branches; `.multigraph` is it for networkx.

        Raises:
            NetworkError: the network cannot be assembled; lists every reason.
        """
        return sound(self.netlist()).graph

    def expanded(self) -> Self:
        """The network with every long shaft written out part by part: inertias, springs and dampers of their own.

        The nodes inside a shaft "line" are "line 1", "line 2", ...; the parts there "line J 1", "line c 1", "line d 1".

        Raises:
            NetworkError: the network cannot be assembled; lists every reason.
            ParameterError: a shaft's model is no chain of springs, as `Lumped` is.
        """
        from shaftwork.network.expansion import expanded

        netlist = self.netlist()
        return self._of(expanded(netlist, sound(netlist).graph))

    def equations(self, *, expand: bool = False, phase: str | NamedPhase | None = None) -> Equations:
        """Kirchhoff's node and loop equations, laws, states and what was eliminated.

        Args:
            expand: of the network with its shafts written out part by part.
            phase: a phase of the motion, "gap open, load stuck", or a row of `Solution.phases`, whose name is used; by
                default every part is in its first mode, in which a brake slips; `start_phase` is that of the start.

        Raises:
            NetworkError: the network cannot be assembled; lists every reason.
            ParameterError: `expand`, and a shaft's model is no chain of springs, as `Lumped` is; or there is no such
                phase.
        """
        if expand:
            return self.expanded().equations(phase=phase)
        netlist = self.netlist()
        form = sound(netlist)
        if not any(part.modes for part in form.graph.parts) and phase is None:
            return kirchhoff(form)
        from shaftwork.hybrid.named_phases import equations_in

        return equations_in(netlist, form, "" if phase is None else phase, sound)

    def start_phase(self) -> str:
        """The phase in which a motion from rest begins, "gap open, load stuck"; empty where no part changes its mode.

        Raises:
            NetworkError: the network cannot be assembled; lists every reason.
            SimulationError: no modes go together at the start.
        """
        return self.compile().start_phase()

    def lagrangian(self, *, expand: bool = False, phase: str | NamedPhase | None = None) -> Lagrangian:
        """Energies, generalised coordinates and forces, and Lagrange's equations, with their proof by Kirchhoff's.

        Args:
            expand: of the network with its shafts written out part by part.
            phase: a phase of the motion, as for `equations`.

        Raises:
            NetworkError: the network cannot be assembled; lists every reason.
            ParameterError: as for `equations`.
        """
        from shaftwork.lagrange.lagrange import lagrangian

        return lagrangian(self.equations(expand=expand, phase=phase))

    def compile(
        self,
        *,
        angles: Sequence[str] = (),
        algebraic_loops: Literal["refuse", "solve"] = "refuse",
        expand: bool = False,
    ) -> Model:
        """The fast model.

        Args:
            expand: of the network with its shafts written out part by part.
            angles: parts whose angle (position, flux linkage) is recorded, besides those that a law reads: of a part
                at one node `phi`, between two that of the first against the second, of a gear `phi_a` and `phi_b`; not
                at a node without inertia between springs, which turns at once where a torque jumps.
            algebraic_loops: a nonlinear law at a massless node is refused with its name, or solved together with the
                motion (slower, and the solution need not be the only one).

        Raises:
            NetworkError: the network cannot be assembled; lists every reason.
        """
        if expand:
            return self.expanded().compile(angles=angles, algebraic_loops=algebraic_loops)
        if algebraic_loops not in ("refuse", "solve"):
            raise ParameterError(f"algebraic_loops = {algebraic_loops!r} must be 'refuse' or 'solve'.")
        return Compiler(as_names(angles), LOOP if algebraic_loops == "solve" else "")(self.netlist())

    def simulate(
        self,
        t_end: float,
        *,
        angles: Sequence[str] = (),
        algebraic_loops: Literal["refuse", "solve"] = "refuse",
        expand: bool = False,
        **options: Any,
    ) -> Solution:
        """Compile and integrate; the options are those of `compile` and of `Model.simulate`."""
        return self.compile(angles=angles, algebraic_loops=algebraic_loops, expand=expand).simulate(t_end, **options)

    def modes(
        self,
        at: Point = None,
        count: int | None = None,
        *,
        f_max: float | None = None,
        exact: bool = False,
        t: Time = None,
    ) -> NaturalModes:
        """Natural frequencies, damping and shapes, at rest or about a point.

        Args:
            at: the point, as for `Model.linearize`.
            count: the modes wanted, those of smallest |rate|; by default all, of exact shafts 10 or all up to f_max.
            f_max: the largest |rate| / 2 pi, Hz; by default there is none.
            exact: every shaft but a rigid one and one spring is taken as it is, without a mesh; a wave always is.
            t: time at which laws are read, s; by default as for `Model.linearize`.
        """
        return self._small_motions(self.compile(), exact=exact)(at, t, ()).modes(count, f_max)

    def frequency_response(
        self,
        input: str,  # noqa: A002 (it is what it is)
        output: str,
        f: Any,
        at: Point = None,
        *,
        exact: bool = False,
        t: Time = None,
    ) -> FrequencyResponse:
        """The complex amplitude of a quantity under a sinusoidal input of amplitude one, at rest or about a point.

        Args:
            input: what a source gives, "motor.tau".
            output: any quantity, "shaft.tau".
            f: (k,) frequencies, Hz.
            at: the point, as for `Model.linearize`.
            exact: every shaft but a rigid one and one spring is taken as it is, without a mesh; a wave always is.
            t: time at which laws are read, s; by default as for `Model.linearize`.
        """
        return self._small_motions(self.compile(), exact=exact)(at, t, input).frequency_response(input, output, f)

    def campbell(
        self,
        speeds: Any,
        orders: Any = (1, 2, 3),
        f_max: float | None = None,
        *,
        at: Point | Callable[[float], Point] = None,
        count: int | None = None,
        exact: bool = False,
        t: Time = None,
    ) -> Campbell:
        """Natural frequencies and excitation orders over the speed of a shaft, and where they meet.

        Args:
            speeds: (k,) rad/s, ascending.
            orders: excitations per turn.
            f_max: highest frequency of interest, Hz; by default the highest order at the highest speed.
            at: the point, as for `Model.linearize`, or a function from the speed to the point; a network that swings
                otherwise where it runs, by laws that are not linear or modes of its parts, must be given one.
            count: the modes wanted, those of smallest |rate|; by default all.
            exact: every shaft but a rigid one and one spring is taken as it is, without a mesh; a wave always is.
            t: time at which laws are read, s; by default as for `Model.linearize`.
        """
        from shaftwork.frequency.analysis import campbell

        model = self.compile()
        return campbell(model, self._small_motions(model, exact=exact), speeds, orders, f_max, at, count, t)

    @staticmethod
    def _small_motions(model: Model, *, exact: bool) -> SmallMotions:
        from shaftwork.frequency.exact_networks import small_motions

        return small_motions(model, Compiler((), LOOP), every=exact)

    def circuit(self) -> Network:
        """The analogue circuit, force-current: inertias are capacitors, springs inductors, dampers resistors.

        Sources are sources, gears transformers. What has no such element (brakes, gaps, motors with modes, long shafts)
        is a part with its laws between nodes of the circuit; parts of circuits stay as they are. It is simulated to the
        same numbers, and `circuit.analogy` tells their names.

        Raises:
            NetworkError: the network cannot be assembled; lists every reason.
        """
        from shaftwork.analogues.circuit import circuit

        return self._of_analogy(circuit(self.netlist(), sound(self.netlist())))

    def mechanical(self, domains: Mapping[str, Domain] | None = None) -> Network:
        """The drive train of which the network is the circuit: capacitors are inertias, inductors springs, and so on.

        Args:
            domains: of nodes that do not rotate, {"rope": TRANSLATION}; what is all ELECTRICAL stays as it is. What
                `circuit` made knows them.

        Raises:
            NetworkError: the network cannot be assembled, or a part has no counterpart, as a capacitor between two
                nodes; lists every reason.
        """
        from shaftwork.analogues.mechanical import mechanical

        sound(self.netlist())
        known = {} if self.analogy is None else self.analogy.domains
        return Network._of(mechanical(self.netlist(), {**known, **(domains or {})}))

    def dual(self) -> Network:
        """The dual circuit, force-voltage: inertias are inductors, springs capacitors, parallel is in series.

        Its voltages are torques and its currents speeds. Laws of speed and angle are laws of current and charge, and
        what rubs is a pair of diodes. Its nodes are the meshes of the graph, which must be planar; long shafts are
        written out, but for waves. `dual.analogy` tells names. Source: Popenda 2019, (5)-(7).

        Raises:
            NetworkError: the network cannot be assembled, a part has no dual, or the graph is not planar; lists every
                reason.
        """
        from shaftwork.analogues.dual import dual

        return self._of_analogy(dual(self.netlist(), sound(self.netlist())))

    @staticmethod
    def _of_analogy(analogy: Analogy) -> Network:
        network = Network._of(analogy.netlist)
        network.analogy = analogy
        return network

    def save(self, path: str | Path) -> None:
        """Write the network to a text file from which `load` makes the same network.

        Raises:
            ModelFileError: a part or a law has no text form.
        """
        from shaftwork.modelfiles.storage import write_netlist

        write_netlist(self.netlist(), path)

    @classmethod
    def load(cls, path: str | Path, *, trust: Sequence[str] = ()) -> Self:
        """Read a network from a text file. Nothing in the file is executed.

        Args:
            path: of the file.
            trust: packages whose modules may be imported, and so run, where the file names them for parts of one's own;
                by default none.

        Raises:
            ModelFileError: the file cannot be read as a network; says where and why.
            ParameterError: `trust` has no names of packages.
        """
        from shaftwork.modelfiles.storage import read_netlist

        return cls._of(read_netlist(path, trust))

    @classmethod
    def _of(cls, netlist: Netlist) -> Self:
        network = cls(netlist.name, netlist.ports, impacts=netlist.impacts)
        network._placed += netlist.placed
        return network


def network_of(network: Any) -> Network:
    """A network that a user gave.

    Raises:
        ParameterError: it is none.
    """
    if not isinstance(network, Network):
        raise ParameterError(f"{reprlib.repr(network)} is no network. Give the train, net = sw.Network('train').")
    return network


def with_values(network: Network, values: Mapping[str, Any]) -> Network:
    """The network with other values of parameters, "part.parameter"; the one given stays as it is."""
    return network._of(network.netlist().with_values(values))  # noqa: SLF001 (its own)
