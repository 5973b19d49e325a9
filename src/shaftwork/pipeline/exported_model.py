"""What other tools take of a compiled model."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal, cast

from shaftwork.codegen.compiled_model import CompiledModel
from shaftwork.pipeline.arguments import Names

if TYPE_CHECKING:
    from shaftwork.pipeline.model import Model


class ExportedModel(CompiledModel):
    """A compiled model that is written for other tools."""

    def to_fmu(
        self,
        path: str | Path,
        *,
        version: Literal["3.0", "2.0"] = "3.0",
        kind: Literal["both", "model exchange", "co-simulation"] = "both",
        inputs: Sequence[str] = (),
        outputs: Sequence[str] | None = None,
        t_end: float = 10.0,
        binary: bool = True,
    ) -> Path:
        """Write the model as a functional mock-up unit (FMI), which other tools of simulation import; returns its path.

        All that simulates is in it, with modes and events; its source code is inside, so that it can be compiled for
        another machine. The states of all parts and the parameters keep their names.

        Args:
            path: of the file, "crane.fmu".
            version: of FMI.
            kind: for "model exchange" the importing tool integrates; for "co-simulation" the unit does so itself, by a
                method of order 8 that ends its steps at events.
            inputs: parameters that the importing tool gives over time, such as what a source gives, "motor.tau".
            outputs: quantities; by default all.
            t_end: end of a usual motion, s, which the unit proposes.
            binary: whether it is compiled for this machine, by the C compiler that is found here.

        Raises:
            ParameterError: an argument is none of those that there are.
            SignalError: there is no such input or output.
            CompileError: the network has travelling waves or other things of which there is no C code; or there is no C
                compiler.
        """
        from shaftwork.fmu.export_unit import export_unit

        return export_unit(cast("Model", self), path, version, kind, inputs, outputs, t_end, binary=binary)

    def to_c(
        self,
        folder: str | Path,
        *,
        name: str | None = None,
        inputs: Names = (),
        outputs: Names = None,
        t_end: float = 10.0,
    ) -> tuple[Path, ...]:
        """Write the model as C99 code into a folder: NAME.h, NAME.c and an example main.c; returns their paths.

        Args:
            folder: is made where there is none.
            name: of the model in C; by default that of the network.
            inputs: parameters that the program sets as it runs, "motor.tau", in place of their laws.
            outputs: any quantities; by default all but energies and powers.
            t_end: end of the motion in the example, s.

        Raises:
            CompileError, ParameterError, SignalError: there is no such code, name, input or output; says why.
        """
        from shaftwork.ccode.c_export import c_code

        return c_code(cast("Model", self), name=name, inputs=inputs, outputs=outputs, t_end=t_end).write(folder)
