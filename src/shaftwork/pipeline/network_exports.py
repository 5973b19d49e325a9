"""What a network becomes in other languages: doors of the rooms that write them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Literal

from shaftwork.network.netlist import NetworkBuilder
from shaftwork.pipeline.compiler import sound


class NetworkExports(NetworkBuilder):
    """A network as text for other tools; `Network` has these methods."""

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
        from shaftwork.modelica.modelica_export import modelica_text, write_text

        text = modelica_text(self.netlist(), sound, form, library, t_end, initial)
        if path is not None:
            write_text(text, path)
        return text
