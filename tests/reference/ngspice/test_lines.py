"""Travelling waves against ngspice's lossless transmission line: torque is current, speed is voltage."""

from __future__ import annotations

import os
import shutil

import numpy as np
import pytest

import shaftwork as sw
from tests.reference.exact_shafts.line import Section
from tests.reference.ngspice.cases import Case
from tests.reference.ngspice.runner import converged

SECTION = Section.of_geometry(1.0, 0.02, density=7900.0, shear_modulus=77.5e9)
NEEDS_NGSPICE = pytest.mark.skipif(
    shutil.which("ngspice") is None and "CI" not in os.environ, reason="needs ngspice (Debian package); CI has it"
)


@NEEDS_NGSPICE
def test_a_shaft_between_two_inertias_moves_like_a_transmission_line() -> None:
    """A ramp of 1 ms to 12.7 N m: the line of ngspice interpolates its history linearly, which a step would show."""
    netlist = f"""
Itorque 0 a PWL(0 0 1m 12.7 1 12.7)
CJe a 0 0.025
Vline a s 0
Tline s 0 b 0 Z0={1 / SECTION.impedance!r} TD={SECTION.delay!r}
CJm b 0 0.11
"""
    signals = (("v(a)", "Je.omega"), ("v(b)", "Jm.omega"), ("i(Vline)", "line.tau_a"))
    case = Case("line", netlist, (), signals, 0.03)
    times = np.linspace(0.0, case.t_end, 151)[1:]
    expected, change = converged(case, times, tolerance=5e-4)
    net = sw.Network("line")
    net.add(sw.TorqueSource("motor", tau=sw.Ramp(12.7, 1e-3)), "a")
    net.add(sw.Inertia("Je", J=0.025), "a")
    shaft = sw.Shaft("line", length=1.0, diameter=0.02, density=7900.0, shear_modulus=77.5e9, model=sw.Wave())
    net.add(shaft, "a", "b")
    net.add(sw.Inertia("Jm", J=0.11), "b")
    solution = net.simulate(case.t_end, t_eval=times)
    for column, (_, quantity) in zip(expected.T, signals, strict=True):
        error = np.max(np.abs(solution[quantity] - column)) / np.max(np.abs(column))
        # as for the other circuits: twice the last change of ngspice's own result, and below 1e-3
        assert error < max(2 * change, 1e-3), f"{quantity} differs by {error:.1e} of its maximum"


@NEEDS_NGSPICE
def test_a_matched_line_lets_the_torque_leave_in_both() -> None:
    netlist = f"""
Itorque 0 a PWL(0 0 0.1m 1 1 1)
Vline a s 0
Tline s 0 b 0 Z0={1 / SECTION.impedance!r} TD={SECTION.delay!r}
Rend b 0 {1 / SECTION.impedance!r}
Rleak a 0 1e9
"""
    case = Case("matched", netlist, (), (("v(a)", "line.omega_a"), ("v(b)", "line.omega_b")), 2e-3)
    times = np.linspace(0.0, case.t_end, 81)[1:]
    expected, change = converged(case, times, tolerance=5e-4)
    net = sw.Network("matched")
    net.add(sw.TorqueSource("motor", tau=sw.Ramp(1.0, 1e-4)), "a")
    shaft = sw.Shaft("line", length=1.0, diameter=0.02, density=7900.0, shear_modulus=77.5e9, model=sw.Wave())
    net.add(shaft, "a", "b")
    net.add(sw.Damper("end", d=SECTION.impedance), "b")
    solution = net.simulate(case.t_end, t_eval=times)
    for column, (_, quantity) in zip(expected.T, case.signals, strict=True):
        error = np.max(np.abs(solution[quantity] - column)) / np.max(np.abs(column))
        assert error < max(2 * change, 1e-3), f"{quantity} differs by {error:.1e} of its maximum"
