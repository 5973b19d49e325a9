"""Shaftwork: wire a drive train, get its Kirchhoff equations, a fast model, a simulation and LaTeX.

Names are loaded when first used, so that `import shaftwork` costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # `X as X` says to type checkers that X is public
    from shaftwork import (
        live as live,
        reduce as reduce,
        scenes as scenes,
        sizing as sizing,
        spice as spice,
        studies as studies,
        torsional as torsional,
    )
    from shaftwork.components.base import (
        Component as Component,
        Port as Port,
        Signal as Signal,
        component as component,
    )
    from shaftwork.components.bldc import *
    from shaftwork.components.branches import (
        ACROSS as ACROSS,
        INTEGRAL as INTEGRAL,
        THROUGH as THROUGH,
        AcrossLaw as AcrossLaw,
        AcrossStore as AcrossStore,
        IdealCoupling as IdealCoupling,
        LossyCoupling as LossyCoupling,
        ThroughLaw as ThroughLaw,
        ThroughStore as ThroughStore,
        across_of as across_of,
        integral_of as integral_of,
        rigid as rigid,
        through_of as through_of,
    )
    from shaftwork.components.bucket_wheel import *
    from shaftwork.components.contacts import *
    from shaftwork.components.controllers import *
    from shaftwork.components.controlled import *
    from shaftwork.components.sources import *
    from shaftwork.components.excitations import *
    from shaftwork.components.harmonics import Harmonics as Harmonics
    from shaftwork.components.drives import *
    from shaftwork.components.electrical import *
    from shaftwork.components.friction import *
    from shaftwork.components.laws import (
        PWM as PWM,
        Ramp as Ramp,
        Step as Step,
        i as i,
        omega as omega,
        phi as phi,
        psi as psi,
        q as q,
        s as s,
        t as t,
        u as u,
        v as v,
    )
    from shaftwork.components.loads import *
    from shaftwork.components.modes import (
        ANEW as ANEW,
        NEVER as NEVER,
        Leave as Leave,
        Mode as Mode,
        Modes as Modes,
    )
    from shaftwork.components.drives import motors as motors
    from shaftwork.components.motors import *
    from shaftwork.components.noise import HeldNoise as HeldNoise, SmoothNoise as SmoothNoise
    from shaftwork.components.mechanics import *
    from shaftwork.components.shaft_models import (
        Auto as Auto,
        CentralDifference as CentralDifference,
        Lumped as Lumped,
        OneSpring as OneSpring,
        Rigid as Rigid,
        Spectral as Spectral,
        Wave as Wave,
    )
    from shaftwork.components.shafts import *
    from shaftwork.components.tables import Table as Table
    from shaftwork.core.domains import ELECTRICAL as ELECTRICAL, ROTATION as ROTATION, TRANSLATION as TRANSLATION
    from shaftwork.core.errors import (
        AccuracyWarning as AccuracyWarning,
        CompileError as CompileError,
        MissingExtraError as MissingExtraError,
        ModelFileError as ModelFileError,
        NetworkError as NetworkError,
        NetworkWarning as NetworkWarning,
        ParameterError as ParameterError,
        ShaftworkError as ShaftworkError,
        SignalError as SignalError,
        SimulationError as SimulationError,
    )
    from shaftwork.core.parameters import parameter as parameter
    from shaftwork.equations.notations import Inverse as Inverse, Notation as Notation
    from shaftwork.motionfiles.loading import load_solution as load_solution
    from shaftwork.opentorsion.opentorsion_reader import from_opentorsion as from_opentorsion
    from shaftwork.modelica.reading.modelica_reader import (
        ModelicaModel as ModelicaModel,
        read_modelica as read_modelica,
    )
    from shaftwork.fitting.fit import fit as fit
    from shaftwork.fitting.fit_result import Fit as Fit
    from shaftwork.fmu.fmu_parts import FMUSpeed as FMUSpeed, FMUTorque as FMUTorque
    from shaftwork.fmu.foreign_unit import FMU as FMU
    from shaftwork.optimization.optimize import optimize as optimize
    from shaftwork.optimization.optimum import Optimum as Optimum
    from shaftwork.pipeline.model import Model as Model
    from shaftwork.pipeline.network import Network as Network
    from shaftwork.reporting.report import Report as Report, report as report
    from shaftwork.results.fatigue import SNLine as SNLine
    from shaftwork.results.solution import Solution as Solution
    from shaftwork.torsional.calculation import torsional_calculation as torsional_calculation

__version__ = "0.1.0"

_HOME = {
    "shaftwork.components.base": ("Component", "Port", "Signal", "component"),
    "shaftwork.components.branches": (
        "ACROSS",
        "INTEGRAL",
        "THROUGH",
        "AcrossLaw",
        "AcrossStore",
        "IdealCoupling",
        "LossyCoupling",
        "ThroughLaw",
        "ThroughStore",
        "across_of",
        "integral_of",
        "rigid",
        "through_of",
    ),
    "shaftwork.components.modes": ("ANEW", "NEVER", "Leave", "Mode", "Modes"),
    "shaftwork.components.shaft_models": (
        "Auto",
        "CentralDifference",
        "Lumped",
        "OneSpring",
        "Rigid",
        "Spectral",
        "Wave",
    ),
    "shaftwork.components.drives": ("motors",),
    "shaftwork.components.bucket_wheel": ("Soil",),
    "shaftwork.components.harmonics": ("Harmonics",),
    "shaftwork.components.noise": ("HeldNoise", "SmoothNoise"),
    "shaftwork.components.tables": ("Table",),
    "shaftwork.components.laws": ("PWM", "Ramp", "Step", "i", "omega", "phi", "psi", "q", "s", "t", "u", "v"),
    "shaftwork.core.domains": ("ELECTRICAL", "ROTATION", "TRANSLATION"),
    "shaftwork.core.errors": (
        "AccuracyWarning",
        "CompileError",
        "MissingExtraError",
        "ModelFileError",
        "NetworkError",
        "NetworkWarning",
        "ParameterError",
        "ShaftworkError",
        "SignalError",
        "SimulationError",
    ),
    "shaftwork.core.parameters": ("parameter",),
    "shaftwork.equations.notations": ("Inverse", "Notation"),
    "shaftwork.motionfiles.loading": ("load_solution",),
    "shaftwork.opentorsion.opentorsion_reader": ("from_opentorsion",),
    "shaftwork.modelica.reading.modelica_reader": ("ModelicaModel", "read_modelica"),
    "shaftwork.fmu.fmu_parts": ("FMUSpeed", "FMUTorque"),
    "shaftwork.fmu.foreign_unit": ("FMU",),
    "shaftwork.pipeline.model": ("Model",),
    "shaftwork.pipeline.network": ("Network",),
    "shaftwork.reporting.report": ("Report", "report"),
    "shaftwork.results.fatigue": ("SNLine",),
    "shaftwork.results.solution": ("Solution",),
    "shaftwork.torsional.calculation": ("torsional_calculation",),
    "shaftwork.fitting.fit": ("fit",),
    "shaftwork.optimization.optimize": ("optimize",),
    "shaftwork.optimization.optimum": ("Optimum",),
    "shaftwork.fitting.fit_result": ("Fit",),
}
_PACKAGES = ("live", "reduce", "scenes", "sizing", "spice", "studies", "torsional")
_MODULE_OF = {name: module for module, names in _HOME.items() for name in names}


def __getattr__(name: str) -> Any:
    """Load a public name: one of the table above, a sub-package, or a component from the registry."""
    if name in _MODULE_OF:
        value = getattr(import_module(_MODULE_OF[name]), name)
    elif name in _PACKAGES:
        value = import_module(f"shaftwork.{name}")
    elif name.startswith("_"):
        raise AttributeError(f"module 'shaftwork' has no attribute '{name}'")
    else:
        components = _components()
        if name not in components:
            raise AttributeError(
                f"module 'shaftwork' has no attribute '{name}'. Components are: {', '.join(components)}."
            )
        value = components[name]
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*_MODULE_OF, *_PACKAGES, *_components()})


def _components() -> dict[str, Any]:
    """The components of the library; users' own stand in the registry beside them."""
    registry = import_module("shaftwork.components").REGISTRY
    return {name: made for name, made in registry.items() if made.__module__.startswith("shaftwork.")}
