"""The engine for lossless lines: a network of ordinary differential equations whose lines are delays."""

from __future__ import annotations

import numpy as np

from shaftwork.integrate.lossless import commensurate
from shaftwork.integrate.lossless.lines import DelayProblem, DelayTrajectory
from shaftwork.integrate.lossless.march import March
from shaftwork.integrate.lossless.waveforms import trajectory


def solve(problem: DelayProblem) -> DelayTrajectory:
    """Integrate by Gauss collocation of order 16 on panels between the kinks, none longer than the shortest delay.

    Law: on such a panel all h are known, so only the states are solved for. A jump or kink of a wave, born at t0, at
    a breakpoint or in a law, ends a panel, and ends one again a delay later at the far end of its line, for as long
    as it moves a wave by more than the tolerance. Delays without a common measure so make ever more panels, in
    proportion to the square of the time for two of them; kinks nearer than a part 1e-4 rtol of a delay are one, and
    weak ones stay inside a panel, which is then halved at the kink if it does not resolve them: the error follows
    rtol, and `max_steps` is the bound. Where the panels of a line repeat with its delay the nodes coincide, h is
    taken from them, and Gauss quadrature of the exchanged power is exact: energy is kept to rounding. Elsewhere h is
    the polynomial of its panel, one-sided at the panel's ends, checked between the nodes.

    A panel is halved until the Legendre coefficients that states and waves leave out are below a tenth of the
    tolerance, so the panels are graded towards the boundary layer of a light end. A layer that is narrower than the
    hundredth part of rtol times the shortest delay is stepped over by Radau IIA, which leaves no ringing; in it the
    output is that of a straightened layer. Linear networks whose delays have a common measure are solved by one
    constant map a panel, and long ones with constant inputs and few outputs by its powers
    (`shaftwork.integrate.lossless.commensurate`).

    Raises:
        SimulationError: a value is not finite, Newton's method fails, a layer cannot be resolved, or too many panels.

    Source: Bergeron, Du coup de belier en hydraulique au coup de foudre en electricite, 1949; Bellen and Zennaro,
    Numerical Methods for Delay Differential Equations, 2003; Hairer, Lubich, Wanner, Geometric Numerical Integration,
    IV.2.
    """
    with np.errstate(all="ignore"):
        if problem.linear and problem.past is None and (found := commensurate.solve(problem)) is not None:
            return found
        march = March(problem)
        march.run()
    return trajectory(problem, *march.panels())
