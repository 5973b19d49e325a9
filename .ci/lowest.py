"""Prints, as constraints for pip, the lowest version of every library that pyproject.toml promises to work with."""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
needed = [*project["dependencies"], *(need for needs in project["optional-dependencies"].values() for need in needs)]
lowest = {match[1]: match[2] for need in needed if (match := re.match(r"([\w.-]+)>=([\d.]+)", need))}
sys.stdout.writelines(f"{name}=={version}\n" for name, version in lowest.items())
