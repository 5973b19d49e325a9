"""A compiled model as files of C code."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from shaftwork.ccode.c_texts import names_in
from shaftwork.ccode.writer import CodeWriter, Variable
from shaftwork.components.laws import as_expression
from shaftwork.core.errors import CompileError, ParameterError
from shaftwork.core.files import replaced
from shaftwork.core.parameters import in_si
from shaftwork.network.netlist import listed
from shaftwork.pipeline.arguments import STAND_IN, Names, as_names

if TYPE_CHECKING:
    from shaftwork.pipeline.model import Model

RESERVED = frozenset(
    re.findall(
        r"\w+",
        "auto continue extern float goto inline main register short signed typedef union unsigned volatile "
        "abs acos acosh asin asinh atan atan2 atanh cbrt cos cosh erf exp hypot log log10 log2 pow sin sinh sqrt "
        "tan tanh",
    )
)
"""Words of the language and its mathematics that the runtime does not use; only asked for membership."""
LONGEST = 40
"""Signs of a name: 63 of a function's name count in C99, and what it does stands behind the name."""


@dataclass(frozen=True)
class CCode:
    """A model in C: the texts of its files, and what stands in its arrays.

    Args:
        name: of the model in C, with which all public names of the code begin.
        header: text of its header.
        source: text of its source.
        example: text of an example program.
        states, parameters, inputs, outputs: in the order of the arrays of the code.
        stores: names of all that is stored, whose start values may be set.
        machines: names of the parts that change their mode.
        guards: how many guards there are at most.
    """

    name: str
    header: str
    source: str
    example: str
    states: tuple[Variable, ...]
    parameters: tuple[Variable, ...]
    inputs: tuple[Variable, ...]
    outputs: tuple[Variable, ...]
    stores: tuple[str, ...]
    machines: tuple[str, ...]
    guards: int

    def write(self, folder: str | Path) -> tuple[Path, ...]:
        """Write the files into a folder, which is made where there is none; returns their paths.

        Raises:
            OSError: a file cannot be written.
        """
        paths = tuple(Path(folder, file) for file in _files(self.name))
        paths[0].parent.mkdir(parents=True, exist_ok=True)
        for path, text in zip(paths, (self.header, self.source, self.example), strict=True):
            with replaced(path) as stream:
                stream.write(text)
        return paths


def c_code(
    model: Model,
    *,
    name: str | None = None,
    inputs: Names = (),
    outputs: Names = None,
    t_end: float = 10.0,
) -> CCode:
    """A model in C; arguments and errors as of `Model.to_c`."""
    end = in_si("t_end", t_end, "s", above=0)
    called = c_name(model.name) if name is None else checked_name(name)
    values = _input_values(model, as_names(inputs or ()))
    if values:
        model = model.with_values(dict.fromkeys(values, STAND_IN))
    _refuse(model, [*values])
    writer = CodeWriter(model, values, None if outputs is None else as_names(outputs))
    return CCode(
        called,
        *writer.texts(called, end),
        writer.states,
        writer.parameters,
        writer.inputs,
        writer.outputs,
        writer.stores,
        tuple(writer.modes.machines) if writer.modes else (),
        writer.modes.most_guards if writer.modes else 0,
    )


def c_name(title: str) -> str:
    """A name in C for a title: "crane train 2" is crane_train_2."""
    plain = re.sub(r"\W+", "_", title, flags=re.ASCII).strip("_")[:LONGEST] or "model"
    plain = plain if plain[0].isalpha() else f"model_{plain}"[:LONGEST]
    return f"{plain}_model" if is_taken(plain) else plain


def file_names(title: str) -> tuple[str, str, str]:
    """Header, source and example of a model with a title."""
    return _files(c_name(title))


def _files(name: str) -> tuple[str, str, str]:
    return f"{name}.h", f"{name}.c", "main.c"


def is_taken(name: str) -> bool:
    """Whether a name stands for something in the code that is the same for all models."""
    return (
        name in RESERVED
        or name in names_in("shaftwork.ccode", "runtime")
        or re.fullmatch(r"[a-z]\d+", name) is not None
    )


def checked_name(name: Any) -> str:
    """A name that the user gives.

    Raises:
        ParameterError: it is no name in C.
    """
    if (
        not isinstance(name, str)
        or not re.fullmatch(rf"[A-Za-z]\w{{0,{LONGEST - 1}}}", name, re.ASCII)
        or is_taken(name)
    ):
        raise ParameterError(
            f"name = {name!r} must be a name in C, such as 'crane': at most {LONGEST} letters, digits and _, a letter "
            "first, and nothing that the code itself is made of. All functions of the code begin with it."
        )
    return name


def _input_values(model: Model, inputs: Sequence[str]) -> dict[str, float]:
    """The default value of each input: that of its law at t = 0 and at rest, or 0 where it has none there.

    Raises:
        ParameterError: it is no parameter that may vary with the time.
    """
    parts = {part.name: part.component for part in model.form.graph.parts}
    # the momentum of an inertia that changes would need the rate of its change
    pairs = ((name, part) for name, part in parts.items() if part.role != "store")
    laws = [f"{name}.{key}" for name, part in pairs for key, item in part.declared.items() if item.law]
    values: dict[str, float] = {}
    for name in inputs:
        if name not in laws:
            raise ParameterError(
                f"inputs: '{name}' is no parameter that may vary with the time. "
                f"There are: {listed(laws, 12) or 'none'}."
            )
        owner, _, key = name.rpartition(".")
        law = as_expression(getattr(parts[owner], key) or 0.0)
        first = law.subs(dict.fromkeys(law.free_symbols, 0))
        values[name] = float(first) if first.is_finite else 0.0
    return values


def _refuse(model: Model, inputs: Sequence[str]) -> None:
    """Refuse what has no code in C.

    Raises:
        CompileError: waves, or an input whose rate would be needed.
    """
    form, title = model.form, model.name
    if form.waves:
        raise CompileError(f"'{title}' has travelling waves, whose equations need the past. Take model=Spectral(16).")
    rigid = {
        form.graph.part_of(k).name
        for link in form.dependent_across
        for k in form.tree.loops[link]
        if k in form.across_inputs
    }
    for name in inputs:
        if name.rpartition(".")[0] in rigid:
            raise CompileError(
                f"inputs: '{name}' turns an inertia rigidly, which would need its rate as well. Put a spring between "
                "them, or give a torque."
            )
