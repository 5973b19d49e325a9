"""Sections on the motion: how it starts, its curves, phases, extremes, energies and load cycles."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from shaftwork.core.errors import MissingExtraError, ShaftworkError
from shaftwork.core.screen import counted
from shaftwork.equations.spelling import in_text
from shaftwork.latex.nomenclature import breakable, unit
from shaftwork.reporting.latex_parts import PAGE, columns, listed, number, paragraphs, picture
from shaftwork.reporting.subject import ReportSection, Subject
from shaftwork.results.fatigue import SNLine, twisted

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from shaftwork.results.solution import Solution


def conditions(subject: Subject) -> ReportSection:
    """Where the motion starts, in which modes, how long it lasts, and where it ends."""
    solution = subject.solution
    if solution is None:
        return ReportSection()
    start, end = solution.steps[0], solution.steps[-1]
    names = [name for name in dict.fromkeys((*solution.initial, *solution.states)) if name in solution]
    courses = [(name, solution[name]) for name in names[: PAGE.states]]
    rows = [
        (breakable(name), number(course[0]), number(course[-1]), unit(solution.reader.unit(name)))
        for name, course in courses
        if course.ndim == 1
    ]
    begins = "with the values below" if any(course[0].any() for _, course in courses) else "at rest"
    modes = f", in the modes: {solution.phases[0].name}" if solution.phases else ""
    said = [f"The motion starts {begins}{modes}.", f"It is computed from {start:g} s to {end:g} s."]
    if len(names) > PAGE.states:
        said.append(f"The first {PAGE.states} of {len(names)} quantities that say where it starts are listed.")
    said.append("What drives and loads it over time stands among the values and laws of the parts.")
    heads = ("Quantity", "At the start", "At the end", "Unit")
    return ReportSection(paragraphs(in_text(" ".join(said)), columns(heads, rows, (4, 2, 2, 2))))


def motion(subject: Subject) -> ReportSection:
    """Curves of the signals, and the phases of the motion."""
    solution = subject.solution
    if solution is None or not subject.signals:
        return ReportSection()
    pictures: list[str] = []
    figures: dict[str, Figure] = {}
    curves: dict[str, tuple[str, ...]] = {}
    count = -(-len(subject.signals) // PAGE.curves)
    for place in range(count):
        names = tuple(
            subject.signals[k] for k in range(len(subject.signals)) if k * count // len(subject.signals) == place
        )
        label = f"motion-{place + 1}"
        figures[label], curves[label] = solution.plot(*names), names
        pictures.append(picture(label, f"{', '.join(names)} over time"))
    return ReportSection(paragraphs(*pictures, _phases(solution)), figures, curves)


def _phases(solution: Solution) -> str:
    rows = solution.phases
    if not rows:
        return ""
    most = PAGE.phases
    shown = rows if len(rows) <= 2 * most else (*rows[:most], *rows[-most:])
    cells = [(number(row.start), number(row.end), in_text(row.name)) for row in shown]
    if len(rows) > 2 * most:
        cells.insert(most, (r"\ldots", r"\ldots", in_text(f"{len(rows) - 2 * most} more")))
    events = f"The motion has {counted(len(rows), 'phase')} and {counted(len(solution.events), 'event')}."
    return paragraphs(in_text(events), columns(("From s", "To s", "Phase"), cells, (1, 1, 6)))


def extremes(subject: Subject) -> ReportSection:
    """The true extremes of the signals and of all that is twisted, found between the output times too."""
    solution = subject.solution
    if solution is None:
        return ReportSection()
    names = dict.fromkeys((*subject.signals, *twisted(solution.reader)))
    rows = []
    for name, (least, most, mean, end) in solution.extremes.rows(tuple(names)).items():
        values = (number(least), number(least.t, 4), number(most), number(most.t, 4), number(mean), number(end))
        part, _, quantity = name.rpartition(".")
        rows.append((rf"{breakable(part)}.\allowbreak {breakable(quantity)} in {unit(least.unit)}", *values))
    said = "Extremes are those of the motion itself, searched between the output times, on both sides of every jump."
    heads = ("Quantity", "Minimum", "at s", "Maximum", "at s", "Mean", "End")
    return ReportSection(paragraphs(in_text(said), columns(heads, rows, (4.4, 4.25, 3.1, 4.25, 3.1, 4.15, 4.15))))


def energy(subject: Subject) -> ReportSection:
    """Who supplies and who loses energy, how much is left over, and how accurately was integrated."""
    solution = subject.solution
    if solution is None:
        return ReportSection()
    balance = solution.energy
    rows = [("supplied by", breakable(part), number(value)) for part, value in balance.supplied_by.items() if value]
    rows += [("lost in", breakable(part), number(value)) for part, value in balance.lost_in.items() if value]
    rows.append(("stored", "more than at the start", number(balance.stored[-1] - balance.stored[0])))
    said = (
        f"The engine {solution.engine} took {solution.statistics.get('steps', 0)} steps at the relative tolerance "
        f"{solution.rtol:g}. What is supplied less what is lost and stored is {balance.residual:.1e} of the work done "
        "at most; it measures the error of the integration without a reference."
    )
    return ReportSection(paragraphs(columns(("Energy", "Part", "J"), rows, (2, 4, 2)), in_text(said)))


def cycles(subject: Subject) -> ReportSection:
    """Load cycles of what is twisted, and the damage by its S-N line."""
    solution = subject.solution
    there = twisted(solution.reader) if solution else ()
    if solution is None or not there:
        return ReportSection()
    ranges = {name: solution.max(name) - solution.min(name) for name in there}
    names = sorted(there, key=lambda name: -ranges[name])[: PAGE.cycles]
    try:
        counts = {name: solution.rainflow(name, place=_worst_place(solution, name)) for name in names}
    except MissingExtraError as missing:
        return ReportSection(notes=(f"Load cycles are not counted: {missing}",))
    rows = [
        (breakable(name), number(count.range.max(initial=0.0)), number(count.count.sum()), unit(count.unit))
        for name, count in counts.items()
    ]
    said = (
        "Cycles are counted by rainflow after ASTM E1049; one that stays open counts half. Along a shaft those of the "
        "place with the largest torque stand here."
        + (f" Of {len(there)} shafts and springs those with the largest range do." if len(there) > len(names) else "")
    )
    table = columns(("Quantity", "Largest range", "Cycles", "Unit"), rows, (4, 2, 2, 2))
    if subject.sn is None:
        return ReportSection(paragraphs(in_text(said), table))
    try:
        damage = _damage(solution, subject.sn)
    except ShaftworkError as reason:
        return ReportSection(paragraphs(in_text(said), table), notes=(f"No damage: {reason}",))
    return ReportSection(paragraphs(in_text(said), table, damage))


def _worst_place(solution: Solution, name: str) -> int | None:
    """Of a quantity along a part the place of its largest value."""
    row = solution.extremes.row(name)
    place = max(row.least, row.most, key=abs).place
    return None if place is None else int(np.argmin(np.abs(solution.places[name] - place)))


def _damage(solution: Solution, sn: SNLine | Mapping[str, SNLine]) -> str:
    """Damage by quantity.

    Raises:
        ShaftworkError: a quantity has no load cycles.
    """
    damages = solution.damage(sn=sn)
    rows = [
        (breakable(name), number(worn.damage), number(worn.repetitions), number(worn.hours))
        for name, worn in damages.items()
    ]
    lines = sn if isinstance(sn, Mapping) else {"all": sn}
    said = [f"S-N line of {name}: {line!r}" for name, line in lines.items()]
    heads = ("Quantity", "Damage", "Motions to failure", "Hours to failure")
    return paragraphs(columns(heads, rows, (4, 2, 3, 3)), listed(said))
