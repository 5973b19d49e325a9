"""The modelDescription.xml of an FMU, of FMI 2.0 or 3.0."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from shaftwork.fmu.unit_interface import UnitInterface, UnitVariable, base_unit

KINDS = ("ModelExchange", "CoSimulation")
_SAID = {
    "2.0": {
        "ModelExchange": {"completedIntegratorStepNotNeeded": "true"},
        "CoSimulation": {"canHandleVariableCommunicationStepSize": "true"},
        "": {
            "canGetAndSetFMUstate": "true",
            "canSerializeFMUstate": "true",
            "providesDirectionalDerivative": "true",
            "canNotUseMemoryManagementFunctions": "true",
        },
    },
    "3.0": {
        "ModelExchange": {"needsCompletedIntegratorStep": "false"},
        "CoSimulation": {"canHandleVariableCommunicationStepSize": "true"},
        "": {
            "canGetAndSetFMUState": "true",
            "canSerializeFMUState": "true",
            "providesDirectionalDerivatives": "true",
        },
    },
}
"""What the units can do, by version and kind."""


def model_description(unit: UnitInterface, version: str, kinds: Sequence[str], sources: Sequence[str]) -> bytes:
    """The text of modelDescription.xml.

    Args:
        unit: what it shows.
        version: "2.0" or "3.0".
        kinds: of `KINDS`.
        sources: names of the files of source code.
    """
    older = version == "2.0"
    root = Element(
        "fmiModelDescription",
        {
            "fmiVersion": version,
            "modelName": unit.title,
            ("guid" if older else "instantiationToken"): unit.token,
            "generationTool": "Shaftwork",
            "variableNamingConvention": unit.convention,
        },
    )
    if older:
        root.set("numberOfEventIndicators", str(unit.indicators))
    for kind in KINDS:
        if kind in kinds:
            says = {**_SAID[version][kind], **_SAID[version][""]}
            element = SubElement(root, kind, {"modelIdentifier": unit.identifier, **says})
            if older:
                files = SubElement(element, "SourceFiles")
                for source in sources:
                    SubElement(files, "File", {"name": source})
    _add_units(root, unit)
    SubElement(root, "DefaultExperiment", {"startTime": "0", "stopTime": repr(unit.t_end), "tolerance": "1e-06"})
    variables = SubElement(root, "ModelVariables")
    for variable in _variables(unit, version):
        variables.append(variable)
    (_structure_2 if older else _structure_3)(SubElement(root, "ModelStructure"), unit)
    return _text(root)


def build_description(identifier: str, sources: Sequence[str]) -> bytes:
    """The text of buildDescription.xml of FMI 3.0.

    Args:
        identifier: of the unit.
        sources: names of the files of source code.
    """
    root = Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    files = SubElement(SubElement(root, "BuildConfiguration", {"modelIdentifier": identifier}), "SourceFileSet")
    files.set("language", "C99")
    for source in sources:
        SubElement(files, "SourceFile", {"name": source})
    return _text(root)


def _text(root: Element) -> bytes:
    indent(root)
    return bytes(tostring(root, encoding="UTF-8", xml_declaration=True)) + b"\n"


def _add_units(root: Element, unit: UnitInterface) -> None:
    definitions = SubElement(root, "UnitDefinitions")
    for name in unit.units:
        exponents, factor = base_unit(name)
        numbers: dict[str, Any] = {**exponents} if factor == 1.0 else {**exponents, "factor": factor}
        attributes = {key: str(value) for key, value in numbers.items()}
        SubElement(SubElement(definitions, "Unit", {"name": name}), "BaseUnit", attributes)


def _variables(unit: UnitInterface, version: str) -> Iterator[Element]:
    make = _scalar_2 if version == "2.0" else _scalar_3
    references = unit.references
    moving = {"variability": "continuous"}
    calculated = {**moving, "initial": "calculated"}
    yield make(0, UnitVariable("time", "s"), {"causality": "independent", **moving})
    for variable in unit.parameters:
        roles = {"causality": "parameter", "variability": "tunable", "initial": "exact"}
        yield make(references[variable.name], variable, roles)
    for variable in unit.inputs:
        yield make(references[variable.name], variable, {"causality": "input", **moving})
    for variable in unit.states:
        causality = "output" if variable.name in unit.shown else "local"
        yield make(references[variable.name], variable, {"causality": causality, **moving, "initial": "exact"})
    for state, variable in zip(unit.states, unit.rates, strict=True):
        derivative = references[state.name] + (version == "2.0")  # FMI 2.0 counts variables from 1
        yield make(references[variable.name], variable, {"causality": "local", **calculated}, derivative)
    for variable in unit.outputs:
        yield make(references[variable.name], variable, {"causality": "output", **calculated})
    for k in range(unit.indicators if version == "3.0" else 0):
        variable = UnitVariable(_indicator_name(unit, k), "1")
        yield make(len(references) + 1 + k, variable, {"causality": "local", **calculated})


def _indicator_name(unit: UnitInterface, number: int) -> str:
    name = f"event_indicator_{number + 1}"
    return name if name not in unit.references else f"{name}_"


def _scalar_2(reference: int, variable: UnitVariable, roles: dict[str, str], derivative: int | None = None) -> Element:
    element = Element("ScalarVariable", {"name": variable.name, "valueReference": str(reference), **roles})
    SubElement(element, "Real", _numbers(variable, derivative))
    return element


def _scalar_3(reference: int, variable: UnitVariable, roles: dict[str, str], derivative: int | None = None) -> Element:
    attributes = {"name": variable.name, "valueReference": str(reference), **roles}
    return Element("Float64", attributes | _numbers(variable, derivative))


def _numbers(variable: UnitVariable, derivative: int | None) -> dict[str, str]:
    """Attributes of the type: its unit, its numbers, and of a rate the variable whose derivative it is."""
    attributes = {
        "unit": None if variable.unit == "1" else variable.unit,
        "min": variable.lowest,
        "max": variable.highest,
        "nominal": None if variable.nominal == 1.0 else variable.nominal,
        "start": variable.start,
        "derivative": derivative,
    }
    return {name: str(value) for name, value in attributes.items() if value is not None}


def _unknowns(unit: UnitInterface) -> tuple[list[str], list[str], list[str]]:
    """Names of outputs, of rates, and of what is computed at the start."""
    outputs = [v.name for v in unit.states if v.name in unit.shown] + [v.name for v in unit.outputs]
    rates = [v.name for v in unit.rates]
    return outputs, rates, rates + [v.name for v in unit.outputs]


def _structure_2(structure: Element, unit: UnitInterface) -> None:
    for tag, names in zip(("Outputs", "Derivatives", "InitialUnknowns"), _unknowns(unit), strict=True):
        if names:
            group = SubElement(structure, tag)
            for name in names:
                attributes = {"index": str(unit.references[name] + 1)}
                SubElement(group, "Unknown", attributes | _dependencies(unit, name, tag, 1))


def _structure_3(structure: Element, unit: UnitInterface) -> None:
    for tag, names in zip(("Output", "ContinuousStateDerivative", "InitialUnknown"), _unknowns(unit), strict=True):
        for name in names:
            attributes = {"valueReference": str(unit.references[name])}
            SubElement(structure, tag, attributes | _dependencies(unit, name, tag, 0))
    for k in range(unit.indicators):
        SubElement(structure, "EventIndicator", {"valueReference": str(len(unit.references) + 1 + k)})


def _dependencies(unit: UnitInterface, name: str, tag: str, first: int) -> dict[str, str]:
    references = None if tag.startswith("InitialUnknown") else unit.depends_on(name)
    return {} if references is None else {"dependencies": " ".join(str(k + first) for k in references)}
