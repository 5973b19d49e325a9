"""The JSON schema of model files, made of the declarations of the parts.

It is shipped as `model-file.schema.json`, which editors of TOML take. `python -m shaftwork.modelfiles.schema` prints
it.
"""

from __future__ import annotations

import json
from typing import Any

from shaftwork.components import REGISTRY, Component
from shaftwork.core.parameters import Parameter
from shaftwork.modelfiles.own_parts import MODULE
from shaftwork.modelfiles.textfile import FORMATS
from shaftwork.network.netlist import IMPACTS, MAXIMUM_NAME

TABLE = {
    "type": "object",
    "properties": {axis: {"type": "array", "items": {"type": "number"}, "minItems": 2} for axis in "xy"},
    "required": ["x", "y"],
    "additionalProperties": False,
}


def model_schema() -> dict[str, Any]:
    """The schema, draft 2020-12. Types that are not of the library may have any parameter."""
    kinds = {name: kind for name, kind in REGISTRY.items() if kind.__module__.startswith("shaftwork.components.")}
    name = {"type": "string", "minLength": 1, "maxLength": MAXIMUM_NAME}
    names = {"type": "array", "items": name, "uniqueItems": True}
    wired = {"type": name, "name": name, "nodes": {"type": "array", "items": name, "minItems": 1}}
    part = {
        "type": "object",
        "properties": {**wired, "symbol": {"type": "string", "maxLength": MAXIMUM_NAME}},
        "required": list(wired),
        "allOf": [_case(kind) for kind in kinds.values()],
    }
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "Shaftwork model file",
        "type": "object",
        "properties": {
            "format": {"enum": list(FORMATS)},
            "name": name,
            "modules": {"type": "array", "items": {"type": "string", "pattern": f"^{MODULE.pattern}$"}},
            "ports": names,
            "impacts": {"enum": list(IMPACTS)},
            "part": {"type": "array", "items": {"$ref": "#/$defs/part"}},
        },
        "required": ["format", "name"],
        "additionalProperties": False,
        "$defs": {"table": TABLE, "part": part},
    }


def _case(kind: type[Component]) -> dict[str, Any]:
    """What holds for the parts of one type."""
    fewest = max((number for number, port in enumerate(kind.ports, 1) if not port.optional), default=1)
    parameters = {name: _values(declared) for name, declared in kind.declared.items()}
    then = {
        "properties": {
            "type": True,
            "name": True,
            "symbol": True,
            "nodes": {"minItems": fewest, "maxItems": len(kind.ports)},
            **parameters,
        },
        "required": [name for name, declared in kind.declared.items() if declared.required],
        "additionalProperties": False,
    }
    return {"if": {"properties": {"type": {"const": kind.__name__}}}, "then": then}


def _values(declared: Parameter) -> dict[str, Any]:
    """The admissible values of a parameter."""
    unit = "" if declared.unit == "1" else f", {declared.unit}"
    about = {"description": f"{declared.meaning}{unit}"}
    if declared.record is not None:
        return {**about, "type": "string"}
    limits = {"exclusiveMinimum": declared.above, "minimum": declared.at_least, "maximum": declared.at_most}
    number: dict[str, Any] = {"type": "number", **{key: limit for key, limit in limits.items() if limit is not None}}
    number |= {"multipleOf": 1} if declared.whole else {}
    number |= {"not": {"const": 0}} if declared.nonzero else {}
    if not declared.law:
        return {**about, **number}
    return {**about, "anyOf": [number, {"type": "string"}, {"$ref": "#/$defs/table"}]}


def schema_text() -> str:
    """The schema as it is shipped."""
    return json.dumps(model_schema(), indent=1, ensure_ascii=False) + "\n"


if __name__ == "__main__":
    print(schema_text(), end="")  # noqa: T201 (a file to be redirected)
