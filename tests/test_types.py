"""What type checkers say to a client: every public name is one, and README's examples have no errors."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import shaftwork as sw
from shaftwork.components import REGISTRY

ROOT = Path(__file__).parents[1]
EXAMPLE = re.compile(r"^```python\n(.*?)^```$", re.MULTILINE | re.DOTALL)
SETTINGS = {
    "typeCheckingMode": "strict",
    "extraPaths": [str(ROOT / "src")],
    "reportUnusedExpression": False,  # an example names what there is: `sol["shaft.tau"], sol["J2.omega"]`
}
CHECKERS = {
    # What lies in `src` is to the client what is installed: errors in there are not the client's.
    "mypy": ("mypy", "--strict", "--follow-imports=silent", "--cache-dir", str(ROOT / ".mypy_cache" / "client")),
    "basedpyright": ("basedpyright", "--level", "error", "--pythonpath", sys.executable),  # pyright with its own node
}


@pytest.mark.parametrize("name", ["_private", "NoSuchPart"])
def test_a_name_that_the_package_does_not_have_is_an_attribute_error(name: str) -> None:
    with pytest.raises(AttributeError, match=f"has no attribute '{name}'"):
        getattr(sw, name)


def test_every_name_that_the_package_lists_it_has_beside_components_of_a_user() -> None:
    sw.component(type("OwnInertia", (sw.Inertia,), {"__module__": "client"}))
    try:
        assert "OwnInertia" not in dir(sw)
        assert all(hasattr(sw, name) for name in dir(sw))
    finally:
        del REGISTRY["OwnInertia"]


@pytest.mark.slow
@pytest.mark.parametrize("checker", CHECKERS)
def test_a_client_under_strict_types_may_use_every_public_name_and_the_examples(checker: str, tmp_path: Path) -> None:
    if "CI" not in os.environ:
        pytest.importorskip(checker, reason="type checkers come with the extra 'lint'; CI has it")
    names = dir(sw)
    assert len(names) > 100
    uses = "".join(f"print(sw.{name})\n" for name in names)
    examples = EXAMPLE.findall((ROOT / "README.md").read_text(encoding="utf-8"))
    assert examples
    (tmp_path / "names.py").write_text(f"import shaftwork as sw\n\n{uses}", encoding="utf-8")
    (tmp_path / "examples.py").write_text("\n".join(examples), encoding="utf-8")
    (tmp_path / "pyrightconfig.json").write_text(json.dumps(SETTINGS), encoding="utf-8")
    run = subprocess.run(
        (sys.executable, "-m", *CHECKERS[checker], "names.py", "examples.py"),
        cwd=tmp_path,
        env=os.environ | {"MYPYPATH": str(ROOT / "src"), "PYTHONPATH": ""},
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr
