"""Files of older formats are read for ever, and the schema says what a file may hold."""

from __future__ import annotations

import copy
import tomllib
from pathlib import Path
from typing import Any

import jsonschema
import pytest

import shaftwork as sw
from shaftwork.modelfiles import schema
from shaftwork.scenes import SCENES
from tests.beds import bed_of, registered

OLD = Path(__file__).parent / "format_1"
"""The scenes as the first format has them: never written anew."""
SHIPPED = Path(schema.__file__).with_name("model-file.schema.json")
CHECKER = jsonschema.Draft202012Validator(schema.model_schema())


@pytest.mark.filterwarnings("ignore:CageMotor:shaftwork.NetworkWarning")  # the excavator's own curve turns once more
@pytest.mark.parametrize("path", sorted(OLD.glob("*.toml")), ids=lambda path: path.stem)
def test_files_of_the_first_format_are_read_as_they_were(path: Path) -> None:
    assert sw.Network.load(path) == SCENES[path.stem]()


def test_there_is_an_old_file_for_every_scene_of_that_time() -> None:
    assert len(list(OLD.glob("*.toml"))) >= 7


def test_the_schema_that_is_shipped_is_that_of_the_parts() -> None:
    anew = "python -m shaftwork.modelfiles.schema > src/shaftwork/modelfiles/model-file.schema.json"
    assert SHIPPED.read_text(encoding="utf-8") == schema.schema_text(), f"Write it anew: {anew}"
    jsonschema.Draft202012Validator.check_schema(schema.model_schema())


@pytest.mark.parametrize("scene", SCENES)
def test_files_of_scenes_fit_the_schema(scene: str, tmp_path: Path) -> None:
    assert faults(SCENES[scene](), tmp_path) == []


@pytest.mark.parametrize("name", registered())
def test_files_of_every_component_fit_the_schema(name: str, tmp_path: Path) -> None:
    assert faults(bed_of(name), tmp_path) == []


def faults(net: sw.Network, folder: Path) -> list[str]:
    net.save(folder / "net.toml")
    return [error.message for error in CHECKER.iter_errors(read(folder / "net.toml"))]


def read(path: Path) -> dict[str, Any]:
    return tomllib.loads(path.read_text(encoding="utf-8"))


@pytest.mark.parametrize(
    "change",
    [
        {"format": 3},
        {"name": ""},
        {"extra": 1},
        {"impacts": "at once"},
        {"part": {"type": "Spring", "J": 1.0}},
        {"part": {"J": -1.0}},
        {"part": {"J": True}},
        {"part": {"type": "Gear", "nodes": ["a", "b"], "ratio": 0}},
        {"part": {"nodes": ["a", "b"]}},
        {"part": {"nodes": "a"}},
        {"part": {"omega": 3.0}},
    ],
    ids=str,
)
def test_what_a_file_may_not_hold_does_not_fit_the_schema(change: dict[str, Any]) -> None:
    right: dict[str, Any] = {"format": 1, "name": "m"}
    right["part"] = [{"type": "Inertia", "name": "J", "nodes": ["a"], "J": 1.0}]
    assert list(CHECKER.iter_errors(right)) == []
    wrong = copy.deepcopy(right)
    wrong["part"][0] |= change.pop("part", {})
    assert list(CHECKER.iter_errors(wrong | change))
