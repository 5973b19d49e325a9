"""What other tools and readers take of a network: drawings, and files in other languages."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Literal, cast

from shaftwork.core.errors import NetworkWarning, ShaftworkError
from shaftwork.core.files import write_text
from shaftwork.core.notices import muted
from shaftwork.equations.records import NamedPhase
from shaftwork.network.netlist import NetworkBuilder
from shaftwork.pipeline.arguments import Point
from shaftwork.pipeline.compiler import sound

if TYPE_CHECKING:
    from shaftwork.drawing.canvas import Drawing
    from shaftwork.pipeline.network import Network


class ExportedNetwork(NetworkBuilder):
    """A network that is drawn and written for other tools."""

    def draw(
        self,
        *,
        as_circuit: bool = False,
        analogy: Literal["force-current", "force-voltage"] = "force-current",
        values: bool = False,
        expand: bool = False,
        phase: str | NamedPhase | None = None,
        width: float = 680.0,
    ) -> Drawing:
        """The network as a drawing, placed without hints: shown in notebooks, `save` writes SVG, PDF, PNG and TikZ.

        Args:
            as_circuit: the analogue circuit (inertias are capacitors, compliances inductors, damping conductances,
                gears transformers) instead of the symbols of drive trains.
            analogy: "force-voltage" draws the dual circuit, with inertias as inductors and springs as capacitors; the
                letters are those of the drive train, as Popenda 2019 has it.
            values: the values of parameters below their letters.
            expand: of the network with its shafts written out part by part.
            phase: a phase of the motion, as for `equations`.
            width: of the drawing, pt, with letters of 10 pt. A longer row goes on in the next one, behind the name of
                the node at the end of both.

        Raises:
            NetworkError: the network cannot be assembled; lists every reason.
            ParameterError: as for `equations`; a width that is not above zero.
            MissingExtraError: matplotlib is not installed.
        """
        from shaftwork.drawing.pictures import dual_picture, picture, refuse_analogy

        refuse_analogy(analogy, as_circuit=as_circuit)
        network = cast("Network", self)
        equations = network.equations(expand=expand, phase=phase)
        if analogy == "force-voltage":
            dual = (network.expanded() if expand else network).dual()
            branches = {} if dual.analogy is None else dual.analogy.branches
            return dual_picture(equations, dual.graph(), branches, values=values, width=width)
        in_phase = None if phase is None else (network.graph(), phase)
        return picture(equations, in_phase, as_circuit=as_circuit, values=values, width=width)

    def _repr_html_(self) -> str | None:
        """What a notebook shows; nothing but the text where the network cannot be drawn, or is too large to be read."""
        if len(self.netlist().placed) > 200:
            return None
        try:
            with muted(NetworkWarning):
                return self.draw()._repr_svg_()
        except ShaftworkError:
            return None

    def to_spice(
        self,
        path: str | Path | None = None,
        *,
        t_end: float = 1.0,
        step: float | None = None,
        initial: Point = None,
    ) -> str:
        """The analogue circuit as a deck for ngspice: speeds are voltages, torques currents, modes smooth laws.

        Args:
            path: a file to which the text is written, "crane.cir"; by default none.
            t_end: end of the motion, s.
            step: longest step of ngspice, s; by default an 8000th of the motion.
            initial: start values, as for `Model.simulate`.

        Raises:
            NetworkError: the network cannot be assembled, or a part has no form in SPICE, as rigid contacts.
            ParameterError: the file cannot be written.
        """
        from shaftwork.spice.deck import deck

        return _written(deck(cast("Network", self).compile(), t_end, step, initial), path)

    def to_modelica(
        self,
        path: str | Path | None = None,
        *,
        form: Literal["component", "flat"] = "component",
        library: Literal["standard", "inline"] = "standard",
        t_end: float = 1.0,
        initial: Mapping[str, float] | None = None,
    ) -> str:
        """The network in Modelica: a package whose model `Network` joins parts, or one model of its equations.

        Args:
            path: a file to which the text is written, "crane.mo"; by default none.
            form: "component" has each part as an instance of the Modelica Standard Library where that has one, else of
                a model of its own in the package; "flat" has parameters, states, rates and quantities.
            library: "inline" writes the few classes of the library that are used into the package, so that tools
                without the library run it.
            t_end: end of the experiment, s.
            initial: start values, as for `Model.simulate`.

        Raises:
            NetworkError: the network cannot be assembled; lists every reason.
            CompileError: a part or a law has no such form; the message names it.
            ParameterError: there is no such form or library, or the file cannot be written.
        """
        from shaftwork.modelica.modelica_export import modelica_text

        return _written(modelica_text(self.netlist(), sound, form, library, t_end, initial), path)


def _written(text: str, path: str | Path | None) -> str:
    """A text, that is written to a file where one is named."""
    if path is not None:
        write_text(text, path)
    return text
