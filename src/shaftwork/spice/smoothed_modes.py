"""Parts that change their mode, as one law each: SPICE knows no modes, and its laws should be smooth.

What rubs has the sign of its speed as a hyperbolic tangent: it creeps where it should stick. Diodes, freewheels and
switches are conductances, large while they conduct. Contacts that spring have the law of all their modes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import sympy
from sympy import Expr, Piecewise, Symbol, tanh
from sympy.core.relational import Relational

from shaftwork.components.branches import ACROSS, THROUGH
from shaftwork.components.controlled import VoltageControlledSwitch
from shaftwork.components.friction import SLIPPING, STUCK
from shaftwork.components.laws import larger, smaller, t
from shaftwork.components.mechanics import LossyGear
from shaftwork.components.modes import Modes, mode_symbol
from shaftwork.network.graph import CircuitGraph, GraphBranch, GraphPart
from shaftwork.spice.spice_laws import NoSpiceFormError

SMOOTH, CONDUCTING, BLOCKING = (Symbol(f"{{{name}}}") for name in ("smooth", "g_on", "g_off"))
"""Parameters of a deck: speed over which a friction changes its sign, conductances of what conducts and blocks."""

CREEPS = "sticking is creeping: sign(speed) is tanh(speed / smooth)"
INSTEAD = (
    "Take a part with smooth laws: a contact with a stiffness c, a brake that is on from t_on, an AveragedBLDC, whose "
    "laws are the means of a BLDCMotor over its commutations."
)


@dataclass(frozen=True)
class SmoothedPart:
    """What stands for the modes of a part.

    Args:
        laws: by branch the law in place of its own, in ACROSS, INTEGRAL, the time and parameters of the part; of a mesh
            the torque of its second shaft, in ACROSS and THROUGH of its first one.
        added: laws of further branches, and their ends.
        notes: what is smoothed, for the comment of the part.
    """

    laws: Mapping[int, Expr] = field(default_factory=dict)
    added: tuple[tuple[Expr, int, int], ...] = ()
    notes: tuple[str, ...] = ()


def smoothed(part: GraphPart, graph: CircuitGraph) -> SmoothedPart:
    """The laws of a part without its modes.

    Raises:
        NoSpiceFormError: it has modes that no law stands for.
    """
    laws: dict[int, Expr] = {}
    added: list[tuple[Expr, int, int]] = []
    notes: list[str] = []
    for machine in () if isinstance(part.component, VoltageControlledSwitch) else part.modes:  # that is an S element
        moded = [graph.branches[k] for k in part.branches if mode_symbol(machine.symbol) in _symbols(graph.branches[k])]
        if isinstance(part.component, LossyGear):
            laws[part.branches[0]] = _meshing(part.component)
            notes.append(CREEPS)
        elif machine.law is not None:
            (branch,) = moded
            laws[branch.index] = _touching(machine.law) if getattr(part.component, "d", 0) else machine.law
        elif _rubs(machine):
            laws |= _rubbing(machine, moded)
            notes.append(CREEPS)
        elif (closed := _closing(machine)) is not None:
            plus, minus = (part.node_at(end) for end in part.ends_of(machine))
            added.append((closed, plus, minus))
            laws |= {branch.index: sympy.S.Zero for branch in moded}
            notes.append("g_on while it conducts, g_off while it blocks")
        else:
            names = ", ".join(dict.fromkeys(mode.words for mode in machine.options))
            raise NoSpiceFormError(f"it changes between the modes {names}, which no law of SPICE stands for", INSTEAD)
    return SmoothedPart(laws, tuple(added), tuple(notes))


def _touching(contact: Expr) -> Expr:
    """A law of flanks whose damping sets in over a small depth: at a jump of torque ngspice may find no step."""
    depth = SMOOTH / 1000
    pieces = ((push, beyond.gts - beyond.lts) for push, beyond in contact.args if beyond != sympy.true)
    return sympy.Add(*(push * larger(0, smaller(1, beyond / depth)) for push, beyond in pieces))


def _meshing(gear: LossyGear) -> Expr:
    """The torque into shaft b: that of shaft a times the ratio, less the share that friction takes of its size."""
    ratio, drives, driven = (Symbol(name, real=True) for name in ("ratio", "efficiency", "efficiency_back"))
    if gear.efficiency_back is None:
        driven = drives
    elif gear.efficiency_back <= 0:
        raise NoSpiceFormError("it locks itself, which no law of SPICE stands for", "Take an efficiency_back above 0.")
    mean, half = (drives + 1 / driven) / 2, (drives - 1 / driven) / 2
    return -ratio * (mean * THROUGH + half * sympy.Abs(THROUGH) * tanh(ACROSS / SMOOTH))


def _symbols(branch: GraphBranch) -> frozenset[Symbol]:
    template = branch.template
    return frozenset(template.law.free_symbols.union(*(factor.free_symbols for factor, *_ in template.balances)))


def _rubs(machine: Modes) -> bool:
    """Whether it slips forward and backward, sticks, and may be released, at times that are known."""
    if [mode.value for mode in machine.options[:3]] != [1.0, -1.0, 0.0]:
        return False
    forward, _, stuck, *apart = machine.options
    forms = [mode.form for mode in machine.options]
    conditions = forward.starts.subs(ACROSS, 1)
    return (
        forms == [SLIPPING, SLIPPING, STUCK, *[SLIPPING] * len(apart)]
        and forward.at_rest is None
        and any(leave.when.has(THROUGH) for leave in stuck.leaves)
        and _of_time(conditions)
    )


def _of_time(condition: sympy.Basic) -> bool:
    """Whether what begins and ends does so at known times, once each."""
    return all(
        not relation.has(ACROSS) and (relation.lhs - relation.rhs).diff(t).is_number
        for relation in condition.atoms(Relational)
    )


def _rubbing(machine: Modes, branches: list[GraphBranch]) -> dict[int, Expr]:
    """The laws of what rubs, by branch, with a smooth sign of its speed in place of its mode."""
    mode = mode_symbol(machine.symbol)
    condition = machine.options[0].starts.subs(ACROSS, 1)
    laws: dict[int, Expr] = {}
    for branch in branches:
        law = branch.template.law
        if all(law.subs(mode, value) == 0 for value in (1, -1, 0)):  # it carries an angle alone
            laws[branch.index] = sympy.S.Zero
            continue
        slipping = law.subs(mode, tanh(ACROSS / SMOOTH))
        laws[branch.index] = slipping if condition == sympy.true else Piecewise((slipping, condition), (0, True))
    return laws


def _closing(machine: Modes) -> Expr | None:
    """The law of a diode, freewheel or switch: open in its first mode, and a rigid joint in the second."""
    apart, joined, *over = machine.options
    if joined.form != STUCK or any(mode.form == STUCK for mode in (apart, *over)):
        return None
    whens = [[leave.when for leave in mode.leaves] for mode in (apart, joined)]
    if whens == [[ACROSS], [-THROUGH]]:
        return Piecewise((CONDUCTING * ACROSS, ACROSS > 0), (BLOCKING * ACROSS, True))
    leaves = [leave for mode in machine.options for leave in mode.leaves]
    if all(leave.when.free_symbols.isdisjoint({ACROSS, THROUGH}) and leave.rebound is None for leave in leaves):
        return Piecewise((CONDUCTING * ACROSS, joined.starts), (BLOCKING * ACROSS, True))
    return None
