"""A compiled model as an FMU: C code with the functions of FMI around it, its description and a binary."""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import subprocess
import sys
import zipfile
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from shaftwork.ccode.c_export import CCode, c_code, c_name
from shaftwork.ccode.c_texts import names_in
from shaftwork.ccode.equation_set import EquationSet
from shaftwork.ccode.writer import Variable
from shaftwork.core.errors import CompileError, ParameterError
from shaftwork.core.files import drafted, in_a_folder
from shaftwork.core.parameters import in_si
from shaftwork.fmu.unit_description import KINDS, build_description, model_description
from shaftwork.fmu.unit_interface import UnitInterface, UnitVariable
from shaftwork.pipeline.arguments import STAND_IN

if TYPE_CHECKING:
    from shaftwork.pipeline.model import Model

VERSIONS = ("3.0", "2.0")
SOURCES = ("unit.c", "fmi2.c", "fmi3.c", "unit.h", "unit_api.inc", "unit_config.h")
"""Files beside those of the model."""
_KINDS = {"both": KINDS, "model exchange": KINDS[:1], "co-simulation": KINDS[1:]}
_SYSTEMS = {"Linux": "linux", "Darwin": "darwin", "Windows": "windows"}
_MACHINES = {"amd64": "x86_64", "arm64": "aarch64", "i686": "x86"}
_EXTENSIONS = {"Linux": ".so", "Darwin": ".dylib", "Windows": ".dll"}
SMALL = ("-ffunction-sections", "-fdata-sections", "-fno-asynchronous-unwind-tables", "-fno-math-errno")
"""Options of the compiler that leave out what an FMU does not use: code of other uses, tables and `errno`."""
_DAY = (1980, 1, 1, 0, 0, 0)  # of all files in the archive: the same network gives the same bytes


def export_unit(
    model: Model,
    path: str | Path,
    version: str,
    kind: str,
    inputs: Sequence[str],
    outputs: Sequence[str] | None,
    t_end: float,
    *,
    binary: bool,
) -> Path:
    """Write an FMU; arguments and errors as of `Model.to_fmu`."""
    place = in_a_folder(path)
    if not place.name or place.is_dir():
        raise ParameterError(f"path = '{path}' is a folder. Name a file in it, such as 'train.fmu'.")
    if version not in VERSIONS:
        raise ParameterError(f"version = {version!r} of FMI is none of: {', '.join(VERSIONS)}.")
    if kind not in _KINDS:
        raise ParameterError(f"kind = {kind!r} of an FMU is none of: {', '.join(map(repr, _KINDS))}.")
    code = _code(model, inputs, outputs)
    end = in_si("t_end", t_end, "s", above=0)
    unit = _interface(model, code, outputs, end)
    texts = _sources(unit, code, version)
    compiled = tuple(name for name in texts if name.endswith(".c"))
    members = {"modelDescription.xml": model_description(unit, version, _KINDS[kind], compiled)}
    members |= {f"sources/{name}": text.encode() for name, text in texts.items()}
    if version == "3.0":
        members["sources/buildDescription.xml"] = build_description(code.name, compiled)
    if binary:
        members |= _binary(code.name, texts, version)
    _write(place, members)
    return place


def _code(model: Model, inputs: Sequence[str], outputs: Sequence[str] | None) -> CCode:
    """The C code; states are read in any case, and what is stored and no state in any mode is an output like others."""
    plain, words = c_name(model.name), names_in("shaftwork.fmu", "sources")
    name = f"{plain}_model" if plain in words or f"{plain}.c" in SOURCES else None
    if outputs is None:
        return c_code(model, name=name, inputs=inputs)
    if isinstance(outputs, str):
        raise ParameterError(f"outputs = {outputs!r} must be a list of names, such as [{outputs!r}].")
    code = c_code(model, name=name, inputs=inputs, outputs=[one for one in outputs if one not in model.states])
    states = {variable.name for variable in code.states}  # only asked for membership
    if states >= {one for one in outputs if one in model.states}:
        return code
    return c_code(model, name=name, inputs=inputs, outputs=[one for one in outputs if one not in states])


def _dependencies(model: Model, code: CCode) -> dict[str, tuple[str, ...]]:
    """The states and inputs in each rate and output; of a network whose modes change them nothing is told."""
    if model.phased:
        return {}
    inputs = dict.fromkeys((variable.name for variable in code.inputs), STAND_IN)
    equations = EquationSet(model.with_values(inputs) if inputs else model)
    rates = {state.name: rate for state, rate in zip(equations.rows.states, equations.rows.rates, strict=True)}
    laws = {f"der({name})": rate for name, rate in rates.items()}
    laws |= {_shown(name, code): equations.observables.quantity(name) for name, *_ in code.outputs}
    moving = (*rates, *inputs)
    read = {
        name: {symbol.name for symbol in law.free_symbols} for name, law in laws.items()
    }  # only asked for membership
    return {name: tuple(other for other in moving if other in symbols) for name, symbols in read.items()}


def _interface(model: Model, code: CCode, outputs: Sequence[str] | None, t_end: float) -> UnitInterface:
    """What the unit shows: states that are outputs as well, and other outputs."""
    states = {variable.name for variable in code.states}  # only asked for membership
    others = states | {variable.name for variable in code.inputs}
    wanted = tuple(variable.name for variable in code.outputs) if outputs is None else tuple(outputs)
    token = hashlib.sha256(f"{code.header}\0{code.source}".encode()).hexdigest()
    return UnitInterface(
        title=model.name,
        identifier=code.name,
        token="{" + "-".join((token[:8], token[8:12], token[12:16], token[16:20], token[20:32])) + "}",
        parameters=tuple(_bounded(model, v, 1.0) for v in code.parameters),
        inputs=tuple(_bounded(model, v, abs(v.value) or 1.0) for v in code.inputs),
        states=tuple(UnitVariable(v.name, v.unit, 0.0, v.nominal) for v in code.states),
        outputs=tuple(UnitVariable(_shown(v.name, code), v.unit) for v in code.outputs if v.name not in others),
        shown=frozenset(states & {*wanted}),
        indicators=code.guards,
        dependencies=_dependencies(model, code),
        t_end=t_end,
    )


def _bounded(model: Model, variable: Variable, nominal: float) -> UnitVariable:
    """A parameter or an input with the bounds that its part declares; those of FMI are inclusive."""
    owner, _, name = variable.name.rpartition(".")
    part = next(part for part in model.form.graph.parts if part.name == owner)
    limits = part.component.declared.get(name)
    if limits is None:
        return UnitVariable(variable.name, variable.unit, variable.value, nominal)
    lowest = limits.above if limits.at_least is None else limits.at_least
    return UnitVariable(variable.name, variable.unit, variable.value, nominal, lowest, limits.at_most)


def _shown(name: str, code: CCode) -> str:
    """The name of an output, told from that of a parameter: `load.tau_now` is the torque at an instant."""
    return f"{name}_now" if any(name == parameter.name for parameter in code.parameters) else name


def _sources(unit: UnitInterface, code: CCode, version: str) -> dict[str, str]:
    """The files of source code by name."""
    folder = files("shaftwork.fmu") / "sources"
    layer = f"fmi{version[0]}.c"
    texts = {f"{code.name}.c": code.source}
    texts |= {name: (folder / name).read_text(encoding="utf-8") for name in ("unit.c", layer, "unit.h", "unit_api.inc")}
    return {**texts, f"{code.name}.h": code.header, "unit_config.h": _configuration(unit, code)}


def _configuration(unit: UnitInterface, code: CCode) -> str:
    """The header that tells the same code for all models which one this is."""
    places = {_shown(variable.name, code): k for k, variable in enumerate(code.outputs)}
    sizes = {
        "PARAMETERS": len(unit.parameters),
        "INPUTS": len(unit.inputs),
        "STATES": len(unit.states),
        "OUTPUTS": len(unit.outputs),
        "ALL_OUTPUTS": len(code.outputs),
        "INDICATORS": unit.indicators,
    }
    stores = [code.stores.index(variable.name) for variable in code.states]
    lines = [
        "/* Which model this unit is. */",
        f'#include "{code.name}.h"',
        "",
        f"typedef {code.name} Model;",
        f"#define MODEL(function) {code.name}_##function",
        f'#define UNIT_NAME "{code.name}"',
        f'#define UNIT_TOKEN "{unit.token}"',
        *(f"#define UNIT_{name} {size}" for name, size in sizes.items()),
        _listed("UNIT_NOMINALS", [state.nominal for state in unit.states], "of each state its usual size"),
        _listed("UNIT_STORES_OF_STATES", stores, "of each state its place among the start values"),
        _listed(
            "UNIT_PLACES_OF_OUTPUTS", [places[v.name] for v in unit.outputs], "of each output among those of the model"
        ),
        "",
    ]
    return "\n".join(lines)


def _listed(name: str, numbers: Sequence[float], meaning: str) -> str:
    return f"#define {name} {{{', '.join(map(str, numbers)) or '0'}}} /* {meaning} */"


def _binary(name: str, texts: Mapping[str, str], version: str) -> dict[str, bytes]:
    """The shared library for this machine, by its path in the archive.

    Raises:
        CompileError: there is no C compiler, or it fails.
    """
    compiler = os.environ.get("CC") or next(filter(None, map(shutil.which, ("cc", "gcc", "clang"))), None)
    if compiler is None:
        raise CompileError(
            "model.to_fmu() found no C compiler for the binary of this machine. Install gcc or clang, set CC, or give "
            "binary=False for an FMU of source code, which the importing tool compiles."
        )
    system = platform.system()
    library = name + _EXTENSIONS.get(system, ".so")
    with TemporaryDirectory(prefix="shaftwork-fmu-") as folder:
        for file, text in texts.items():
            (Path(folder) / file).write_text(text, encoding="utf-8")
        sources = [file for file in texts if file.endswith(".c")]
        options = ["-std=c99", "-O2", "-shared", "-fPIC", "-fvisibility=hidden", "-s", *SMALL]
        options += ["-Wl,--gc-sections"] if system == "Linux" else []
        options.append("-Werror=implicit-function-declaration")  # else what is missing shows where the unit is loaded
        done = subprocess.run(  # noqa: S603 (the compiler of this machine, on code made here)
            [compiler, *options, "-o", library, *sources, "-lm"],
            cwd=folder,
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode != 0:
            raise CompileError(f"The C compiler {compiler} failed on the code of '{name}': {done.stderr.strip()[:500]}")
        return {f"binaries/{_platform(version)}/{library}": (Path(folder) / library).read_bytes()}


def _platform(version: str) -> str:
    """The name that FMI has for this machine."""
    system, machine = platform.system(), platform.machine().lower()
    if version == "2.0":
        short = {"Windows": "win"}.get(system, _SYSTEMS.get(system, "linux"))
        return f"{short}{64 if sys.maxsize > 2**32 else 32}"
    return f"{_MACHINES.get(machine, machine)}-{_SYSTEMS.get(system, 'linux')}"


def _write(place: Path, members: Mapping[str, bytes]) -> None:
    """Write the archive, which takes the place of one that was there once it is whole."""
    try:
        with drafted(place) as draft, zipfile.ZipFile(draft, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, data in members.items():
                member = zipfile.ZipInfo(name, _DAY)
                member.external_attr = 0o644 << 16
                archive.writestr(member, data, zipfile.ZIP_DEFLATED)
    except OSError as error:
        raise ParameterError(f"{place} cannot be written: {error.strerror or error}. Name another file.") from None
