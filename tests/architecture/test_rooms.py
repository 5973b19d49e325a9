"""Every feature is a room: without its folder the rest of the package works, and its doors say what is gone."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "src" / "shaftwork"

USES = {
    "hybrid": "braked.simulate(0.1, engine='scipy')",
    "waves": "through_shaft.simulate(0.01)",
    "sweep": "at('sweep.sweep').sweep(net, {'shaft.c': [90, 110]}, t_end=0.1, measures=['max shaft.tau'])",
    "sensitivities": "at('sensitivities.sensitivities').motion_sensitivities(net, ['end J2.omega'], t_end=0.1)",
    "frequency": "net.modes()",
    "lagrange": "net.lagrangian()",
    "latex": "net.equations().latex()",
    "modelfiles": "sw.Network.load(net.save(folder / 'net.toml') or folder / 'net.toml')",
    "reduce": "sw.reduce.refer(net, 'wheel')",
    "sizing": "sw.sizing.duty",
    "drawing": "net.draw()",
    "analogues": "net.circuit().simulate(0.1)",
    "control": "net.compile().linearize().to_scipy()",
    "modelica": "net.to_modelica()",
    "ccode": "net.compile().to_c(folder)",
    "studies": "sw.studies.work_precision",
    "spice": "net.to_spice()",
    "animation": "net.simulate(0.1).animate()",
    "spectra": "net.simulate(0.1).spectrum('shaft.tau')",
    "reporting": "sw.report(net, sections=['parts'])",
    "torsional": "sw.torsional.Section",
    "uncertainty": "at('uncertainty.bands').bands(net, 'J2.omega', [0, 0.1], {'shaft.c': (90, 110)}, samples=2)",
    "optimization": "sw.optimize(net, {'shaft.c': (90, 110)}, 'max shaft.tau', t_end=0.1)",
    "fitting": "sw.fit(net, {'t': [0.1, 0.2], 'J2.omega': [0.1, 0.2]}, ['shaft.c'])",
    "live": "sw.live.Session(net, t_end=0.1)",
    "stepper": "net.compile().start().step(0.1)",
    "motionfiles": "net.simulate(0.1).save(folder / 'motion.nc')",
    "opentorsion": "sw.from_opentorsion({'components': [{'name': 'A', 'elements': []}]})",
    "fmu": "net.compile().to_fmu(folder / 'net.fmu', binary=False)",
}
"""By feature, something small that takes it."""

NEEDS = {
    "control": ("frequency",),
    "motionfiles": ("modelfiles",),
    "reporting": ("latex", "drawing", "modelfiles"),
    "live": ("reporting", "latex", "drawing", "modelfiles", "frequency", "animation"),
    "fmu": ("ccode",),
    "fitting": ("sensitivities",),
    "uncertainty": ("sweep",),
    "optimization": ("sensitivities", "sweep"),
}
"""By feature, those that it is made of."""

JOINS = {
    "animation": ("shaftwork.live",),
    "ccode": ("shaftwork.fmu.export_unit",),
    "drawing": ("shaftwork.reporting", "shaftwork.live"),
    "modelfiles": ("shaftwork.reporting", "shaftwork.live", "shaftwork.motionfiles"),
    "reporting": ("shaftwork.live",),
    "sensitivities": ("shaftwork.fitting", "shaftwork.optimization"),
    "sweep": ("shaftwork.uncertainty", "shaftwork.optimization"),
    "frequency": ("shaftwork.live", "shaftwork.torsional.forced_train"),
    "hybrid": (
        "shaftwork.waves.hybrid_wave_model",
        "shaftwork.waves.hybrid_waves",
        "shaftwork.sweep.switching",
        "shaftwork.stepper.hybrid_moments",
        "shaftwork.ccode.mode_tables",
    ),
    "latex": (
        "shaftwork.lagrange.lagrange_print",
        "shaftwork.reduce.reduction_print",
        "shaftwork.reporting",
        "shaftwork.live",
    ),
}
"""By feature, modules of other rooms that join these to it; they are loaded where both are at work."""

SCRIPT = """
import sys
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

import shaftwork as sw

gone, joins, uses, needs, folder = {gone!r}, {joins!r}, {uses!r}, {needs!r}, Path({folder!r})
assert Path(sw.__file__).is_relative_to(folder), sw.__file__

for module in walk_packages(sw.__path__, "shaftwork."):
    if not module.name.startswith((*joins, "shaftwork.__main__")):
        try:
            import_module(module.name)
        except ModuleNotFoundError as error:
            assert error.name == "heyoka", error  # which has wheels for Linux alone
rooms = {{name.split(".")[1] for name in sys.modules if name.startswith("shaftwork.")}}
assert gone not in rooms, gone

net = sw.Network("two masses")
net.add(sw.TorqueSource("motor", tau=10.0), "rotor")
net.add(sw.Inertia("J1", J=2.0), "rotor")
net.add(sw.Spring("shaft", c=100.0, d=1.0), "rotor", "wheel")
net.add(sw.Inertia("J2", J=3.0), "wheel")
braked = sw.Network("braked")
braked.add(sw.TorqueSource("motor", tau=10.0), "rotor")
braked.add(sw.Inertia("J", J=2.0), "rotor")
braked.add(sw.CoulombLoad("load", tau=4.0), "rotor")
through_shaft = sw.Network("through a shaft")
through_shaft.add(sw.TorqueSource("motor", tau=10.0), "rotor")
through_shaft.add(sw.Inertia("J", J=2.0), "rotor")
through_shaft.add(sw.Shaft("line", length=10.0, diameter=0.1, model=sw.Wave()), "rotor", "wheel")
through_shaft.add(sw.Inertia("J2", J=2.0), "wheel")

assert net.simulate(0.1).energy_residual < 1e-9
assert len(net.equations().states) == 3


def at(module):
    return import_module(f"shaftwork.{{module}}")


for feature, use in uses.items():
    try:
        eval(use)
    except ModuleNotFoundError as error:
        needed = (feature, *needs.get(feature, ()))
        assert gone in needed and error.name.startswith(f"shaftwork.{{gone}}"), (feature, error)
    else:
        assert feature != gone, f"{{use}} works without {{gone}}"
"""


def run_without(feature: str, folder: Path, uses: dict[str, str]) -> subprocess.CompletedProcess[str]:
    """Load and use a copy of the package in which the folder of a feature is missing."""
    package = folder / "shaftwork"
    package.mkdir()
    for item in SOURCE.iterdir():
        if item.name not in (feature, "__pycache__"):
            (package / item.name).symlink_to(item)
    script = SCRIPT.format(gone=feature, joins=JOINS.get(feature, ()), uses=uses, needs=NEEDS, folder=str(folder))
    environment = {**os.environ, "PYTHONPATH": str(folder)}
    return subprocess.run(
        [sys.executable, "-c", script], env=environment, capture_output=True, text=True, check=False, cwd=folder
    )


@pytest.mark.parametrize("feature", USES)
def test_without_the_folder_of_a_feature_the_rest_works(feature: str, tmp_path: Path) -> None:
    done = run_without(feature, tmp_path, USES)
    assert done.returncode == 0, done.stderr


def test_a_folder_that_others_need_is_missed(tmp_path: Path) -> None:
    done = run_without("results", tmp_path, {})
    assert "No module named 'shaftwork.results'" in done.stderr
