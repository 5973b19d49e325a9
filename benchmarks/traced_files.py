"""Through how many files and functions does a reader have to go who follows one run?

Run `python -m benchmarks.traced_files`. Counts the files and functions of the package that run while the crane's start
is compiled and simulated, whose load sticks at rest; while a drive whose laws are smooth is; and while one with a dry
friction is. Imports do not count: what a module does while it is loaded is not part of the run.
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
        if event == "call" and frame.f_code.co_flags & CO_OPTIMIZED and not loads(frame):
            seen.add(frame.f_code)

    sys.setprofile(called)
    try:
        run()
    finally:
        sys.setprofile(None)
    return {code for code in seen if code.co_filename.startswith(PACKAGE) and not code.co_name.startswith("<")}


def loads(frame: FrameType | None) -> bool:
    """Whether a frame runs while a module is loaded."""
    while frame is not None:
        if frame.f_code.co_filename == "<frozen importlib._bootstrap>":
            return True
        frame = frame.f_back
    return False


def smooth() -> sw.Network:
    """Two masses and a shaft behind an induction motor, without friction."""
    net = sw.Network("smooth")
    net.add(sw.KlossMotor("motor", tau_k=270.0, s_k=0.2, n_sync=40.0), "rotor")
    net.add(sw.Inertia("J1", J=27.35), "rotor")
    net.add(sw.Spring("shaft", c=24206.0, d=14.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=62.5), "wheel")
    return net


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
    friction = with_friction()
    model, plain = sw.scenes.crane_start().compile(), smooth().compile()
    runs = {
        "compile the crane": sw.scenes.crane_start().compile,
        "simulate the crane": lambda: model.simulate(6.5),
        "compile a smooth drive": smooth().compile,
        "simulate a smooth drive": lambda: plain.simulate(6.5),
        "simulate it once more": lambda: plain.simulate(6.5),
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
