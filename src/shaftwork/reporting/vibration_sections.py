"""Sections on vibrations: natural frequencies, Campbell diagram, torsional calculation, models of a shaft compared."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from shaftwork.core.errors import ShaftworkError
from shaftwork.equations.spelling import in_text
from shaftwork.latex.nomenclature import breakable
from shaftwork.reporting.latex_parts import columns, listed, number, paragraphs, picture

if TYPE_CHECKING:
    from shaftwork.reporting.subject import Subject

HOLZER_MODES = 3
"""Modes in tables of their own, the lowest."""
MOST_MODES = 30
"""Modes in the table, the lowest, and resonances: a page."""


def frequencies(subject: Subject) -> str:
    """Natural frequencies, damping and shapes about the point of the report."""
    try:
        modes = subject.network.modes(subject.at)
    except ShaftworkError as reason:
        subject.notes.append(f"Natural frequencies are left out: {reason}")
        return ""
    rows = [
        (in_text(name), number(f), number(60 * f), number(damping, 4), in_text(node))
        for name, f, damping, _, node in modes.table[:MOST_MODES]
    ]
    more = f"The {MOST_MODES} lowest of {len(modes)} modes." if len(modes) > MOST_MODES else ""
    shapes = ""
    if (modes.rates.imag > 0).any():
        subject.figures["modes"] = modes.plot()
        shapes = picture("modes", "Speeds of the nodes in the lowest modes")
    heads = ("Mode", "Frequency in Hz", "in 1/min", "Damping ratio", "Moves most")
    return paragraphs(in_text(f"{modes.title}."), in_text(more), columns(heads, rows, (4, 3, 3, 3, 3)), shapes)


def campbell(subject: Subject) -> str:
    """Natural frequencies and orders over the speed, and where they meet."""
    if not len(subject.speeds):
        return ""
    try:
        diagram = subject.network.campbell(subject.speeds, subject.orders, at=subject.at)
    except ShaftworkError as reason:
        subject.notes.append(f"The Campbell diagram is left out: {reason}")
        return ""
    subject.figures["campbell"] = diagram.plot()
    rows = [
        (number(one.speed * 30 / math.pi), number(one.order), number(one.frequency), in_text(one.mode))
        for one in diagram.crossings
    ]
    heads = ("Speed in 1/min", "Order", "Frequency in Hz", "Mode")
    return paragraphs(picture("campbell", "Campbell diagram"), columns(heads, rows, (2, 1, 2, 3)))


def torsional(subject: Subject) -> str:
    """The torsional calculation: vibratory torques and stresses with their limits, barred speeds, modes, heat."""
    calculation = subject.torsional
    if calculation is None:
        return ""
    judged = [name for name, shaft in calculation.items() if shaft.limits is not None]
    subject.figures["torsional"] = calculation.plot(*judged)
    rows = [tuple(map(_limits_in_print, row)) for row in calculation.table]
    heads = tuple(
        _limits_in_print(head if head.startswith("tau_") else head[:1].upper() + head[1:]) for head in calculation.heads
    )
    rule = (
        "Each row is at the speed that governs the shaft: of the largest stress over tau_c or, without a limit, of the "
        "largest torque. Torques and stresses are half of peak to peak over a cycle, from all orders with their "
        "phases. Stresses are nominal; permitted ones are those of IACS UR M68."
    )
    return paragraphs(
        _limits_in_print(f"{calculation.heading}. {rule}"),
        columns(heads, rows, (3, *(1.5 for _ in heads[2:]), 4)),
        _with_letters(listed(tuple(map(_with_squares, calculation.notes)))),
        picture("torsional", "Vibratory stress or torque over the speed, with the permitted stresses"),
        _resonances(calculation),
        *map(_holzer, calculation.modes[:HOLZER_MODES]),
        _heat(calculation),
    )


def _limits_in_print(text: str) -> str:
    """A text of the calculation with the letters of the rule as formulas."""
    return _with_letters(in_text(_with_squares(text)))


def _with_squares(text: str) -> str:
    return text.replace("mm^2", "mm²")


def _with_letters(latex: str) -> str:
    for limit in ("c", "t"):
        latex = latex.replace(rf"$\mathrm{{tau\_{limit}}}$", rf"$\tau_{limit}$")
    return latex


def _holzer(mode: Any) -> str:
    """A mode as Holzer's table: amplitudes and torques of the masses, torques and stresses of the shafts."""
    title = f"{mode.name}: {mode.frequency:.5g} Hz, damping {mode.damping:.3g}, for 1 rad of {mode.measure}"
    masses = [(breakable(one.name), number(one.amplitude), number(one.torque / 1e3)) for one in mode.masses]
    shafts = [
        (breakable(one.name), number(one.torque / 1e3), "--" if one.stress is None else number(one.stress / 1e6))
        for one in mode.shafts
    ]
    return paragraphs(
        f"\\subsection{{{in_text(title)}}}",
        columns(("Mass", "Amplitude", "Torque in kN m"), masses, (4, 3, 3)),
        columns(("Shaft", "Torque in kN m", r"Stress in N/mm$^2$"), shafts, (4, 3, 3)),
    )


def _resonances(calculation: Any) -> str:
    """Where excited orders meet natural frequencies, from the lowest speed on."""
    rows = [
        (
            number(one.speed * 30 / math.pi),
            number(one.order),
            in_text(one.mode),
            number(one.frequency),
            number(one.damping),
        )
        for one in calculation.resonances[:MOST_MODES]
    ]
    heads = ("Resonance at 1/min", "Order", "Mode", "Frequency in Hz", "Damping ratio")
    return columns(heads, rows, (3, 2, 3, 3, 3))


def _heat(calculation: Any) -> str:
    """What parts turn into heat, at the speed at which each does most."""
    rows = [(breakable(part), number(power), number(speed * 30 / math.pi)) for part, power, speed in calculation.heat]
    return columns(("Heat of the vibration in", "W, at most", "at 1/min"), rows, (3, 2, 2))


def shaft_models(subject: Subject) -> str:
    """Error and run time of models of a shaft."""
    compared = subject.comparison
    if compared is None:
        return ""
    subject.figures["shaft-models"] = compared.plot()
    rows = [
        (
            breakable(trial.model),
            in_text(trial.engine),
            number(trial.states),
            number(1e3 * trial.cpu),
            number(max(trial.errors.values()), 2) if trial.errors else "--",
        )
        for trial in compared.trials
    ]
    said = f"Errors of the shaft {compared.shaft} are relative to {compared.truth[0]}."
    heads = ("Model", "Engine", "States", "CPU ms", "Largest error")
    return paragraphs(
        in_text(said),
        picture("shaft-models", "Error of models of the shaft against their run time"),
        columns(heads, rows, (3, 2, 2, 2, 2)),
    )
