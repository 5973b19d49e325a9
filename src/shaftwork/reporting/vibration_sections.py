"""Sections on vibrations: natural frequencies, Campbell diagram, torsional calculation, models of a shaft compared."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from shaftwork.core.errors import ShaftworkError
from shaftwork.equations.spelling import in_text
from shaftwork.latex.nomenclature import breakable
from shaftwork.reporting.latex_parts import columns, number, paragraphs, picture

if TYPE_CHECKING:
    from shaftwork.reporting.subject import Subject

MOST_MODES = 30
"""Modes in the table, the lowest."""


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
    diagram = subject.network.campbell(subject.speeds, subject.orders, at=subject.at)
    subject.figures["campbell"] = diagram.plot()
    rows = [
        (number(one.speed * 30 / math.pi), number(one.order), number(one.frequency), in_text(one.mode))
        for one in diagram.crossings
    ]
    heads = ("Speed in 1/min", "Order", "Frequency in Hz", "Mode")
    return paragraphs(picture("campbell", "Campbell diagram"), columns(heads, rows, (2, 1, 2, 3)))


def torsional(subject: Subject) -> str:  # noqa: ARG001 (until there is a calculation)
    """The torsional vibration calculation."""
    return ""


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
