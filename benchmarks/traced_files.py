"""Through how many files and functions does a reader have to go who follows one run?

Run `python benchmarks/traced_files.py`. Counts the files and functions of the package that run while the crane's start
is compiled, simulated, and simulated with a dry friction in place of its load. Imports do not count: what a module does
while it is loaded is not part of the run.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from inspect import CO_OPTIMIZED
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import shaftwork as sw

PACKAGE = str(Path(sw.__file__).parent)


def traced(run: Callable[[], Any]) -> set[CodeType]:
    """The functions of the package that run."""
    seen: set[CodeType] = set()

    def called(frame: FrameType, event: str, _argument: Any) -> None:
        if event == "call" and frame.f_code.co_flags & CO_OPTIMIZED:  # bodies of modules and classes are not
            seen.add(frame.f_code)

    sys.setprofile(called)
    try:
        run()
    finally:
        sys.setprofile(None)
    return {code for code in seen if code.co_filename.startswith(PACKAGE) and not code.co_name.startswith("<")}


def with_friction() -> sw.Network:
    """Two masses, a shaft, and a dry friction that sticks and slips."""
    net = sw.Network("friction")
    net.add(sw.TorqueSource("motor", tau=sw.Step(30.0, start=0.1)), "rotor")
    net.add(sw.Inertia("J1", J=27.35), "rotor")
    net.add(sw.Spring("shaft", c=24206.0, d=14.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=62.5), "wheel")
    net.add(sw.DryFriction("friction", tau_c=22.4), "wheel")
    return net


def main() -> None:
    """Print the counts."""
    crane, friction = sw.scenes.crane_start(), with_friction()
    model = crane.compile()
    runs = {
        "compile the crane": sw.scenes.crane_start().compile,
        "simulate the crane": lambda: model.simulate(6.5),
        "a dry friction, compiled and simulated": lambda: friction.simulate(2.0),
    }
    for name, run in runs.items():
        functions = traced(run)
        files = {code.co_filename for code in functions}
        sys.stdout.write(f"{name:40} {len(files):3} files, {len(functions):4} functions\n")
        if "-v" in sys.argv:
            sys.stdout.writelines(f"    {Path(file).relative_to(PACKAGE)}\n" for file in sorted(files))


if __name__ == "__main__":
    main()
