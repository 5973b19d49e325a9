"""Sections on vibrations: natural frequencies, Campbell diagram, torsional calculation, models of a shaft compared."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from shaftwork.core.errors import ParameterError, ShaftworkError
from shaftwork.core.screen import MOST_MODES
from shaftwork.equations.spelling import in_text
from shaftwork.latex.nomenclature import breakable
from shaftwork.reporting.latex_parts import PAGE, columns, listed, number, paragraphs, picture
from shaftwork.reporting.subject import ReportSection, Subject
from shaftwork.results.observer import RPM


def frequencies(subject: Subject) -> ReportSection:
    """Natural frequencies, damping and shapes about the point of the report."""
    try:
        modes = subject.network.modes(subject.at)
    except ShaftworkError as reason:
        if subject.at is not None:
            raise  # it is what the user asked for
        return ReportSection(notes=(f"Natural frequencies are left out: {reason}",))
    first = sorted(modes.table, key=lambda row: row[3].imag <= 0)  # those that swing
    rows = [
        (in_text(name), number(f), number(60 * f), number(damping, 4), in_text(node))
        for name, f, damping, _, node in first[:MOST_MODES]
    ]
    swinging = sum(row[3].imag > 0 for row in first)
    more = f"{swinging} of {len(first)} modes swing, the others decay. The table has the first {MOST_MODES} of them."
    more, swings = more if len(first) > MOST_MODES else "", swinging > 0
    shapes = picture("modes", "Speeds of the nodes in the lowest modes") if swings else ""
    heads = ("Mode", "Frequency in Hz", "in 1/min", "Damping ratio", "Moves most")
    text = paragraphs(in_text(f"{modes.title}."), in_text(more), columns(heads, rows, (4, 3, 3, 3, 3)), shapes)
    return ReportSection(text, {"modes": modes.plot()} if swings else {})


def campbell(subject: Subject) -> ReportSection:
    """Natural frequencies and orders over the speed, and where they meet."""
    if not len(subject.speeds):
        return ReportSection()
    try:
        if subject.torsional is not None:  # it knows the point of each speed
            diagram = subject.torsional.campbell(subject.orders)
        else:
            diagram = subject.network.campbell(subject.speeds, subject.orders, at=subject.at)
    except ParameterError:
        raise  # of what the user gave
    except ShaftworkError as reason:
        return ReportSection(notes=(f"The Campbell diagram is left out: {reason}",))
    rows = [
        (number(one.speed * RPM), number(one.order), number(one.frequency), in_text(one.mode))
        for one in diagram.crossings
    ]
    heads = ("Speed in 1/min", "Order", "Frequency in Hz", "Mode")
    text = paragraphs(picture("campbell", "Campbell diagram"), columns(heads, rows, (2, 1, 2, 3)))
    return ReportSection(text, {"campbell": diagram.plot()})


def torsional(subject: Subject) -> ReportSection:
    """The torsional calculation: vibratory torques and stresses with their limits, barred speeds, modes, heat."""
    calculation = subject.torsional
    if calculation is None:
        return ReportSection()
    judged = [name for name, shaft in calculation.items() if shaft.limits is not None]
    rows = [tuple(map(_limits_in_print, row)) for row in calculation.table]
    heads = tuple(
        _limits_in_print(head if head.startswith("tau_") else head[:1].upper() + head[1:]) for head in calculation.heads
    )
    rule = (
        "Each row is at the speed that governs the shaft: of the largest stress over tau_c or, without a limit, of the "
        "largest torque. Torques and stresses are half of peak to peak over a cycle, from all orders with their "
        "phases. Stresses are nominal; permitted ones are those of IACS UR M68."
    )
    text = paragraphs(
        _limits_in_print(f"{calculation.heading}. {rule}"),
        *_split(heads, rows),
        _with_letters(listed(tuple(map(_with_squares, calculation.notes)))),
        picture("torsional", "Vibratory stress or torque over the speed, with the permitted stresses"),
        _resonances(calculation),
        *map(_holzer, calculation.modes[: PAGE.holzer]),
        _heat(calculation),
    )
    return ReportSection(text, {"torsional": calculation.plot(*judged)})


def _split(heads: tuple[str, ...], rows: Sequence[tuple[str, ...]]) -> Iterator[str]:
    """The table of shafts as one of torques with the verdict, and one of stresses where there are any."""
    stresses = [k for k, head in enumerate(heads) if "mm" in head]
    torques = [k for k in range(len(heads)) if k not in stresses]
    for chosen in (torques, [0, *stresses] if stresses else []):
        shares = [{0: 3, len(heads) - 1: 4}.get(k, 2) for k in chosen]
        yield columns([heads[k] for k in chosen], [[row[k] for k in chosen] for row in rows], shares) if chosen else ""


def _limits_in_print(text: str) -> str:
    """A text of the calculation with the letters of the rule as formulas."""
    return _with_letters(in_text(_with_squares(text)))


def _with_squares(text: str) -> str:
    return text.replace("mm^2", "mm²")


def _with_letters(latex: str) -> str:
    for limit in ("c", "t"):
        latex = latex.replace(rf"tau\_{limit}", rf"$\tau_{limit}$")
    return latex


def _holzer(mode: Any) -> str:
    """A mode as Holzer's table: amplitudes and torques of the masses, torques and stresses of the shafts."""
    title = (
        f"{mode.name.capitalize()}: {mode.frequency:.5g} Hz, damping {mode.damping:.3g}, for 1 rad of {mode.measure}"
    )
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
            number(one.speed * RPM),
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
    rows = [(breakable(part), number(power), number(speed * RPM)) for part, power, speed in calculation.heat]
    return columns(("Heat of the vibration in", "W, at most", "at 1/min"), rows, (3, 2, 2))


def shaft_models(subject: Subject) -> ReportSection:
    """Error and run time of models of a shaft."""
    compared = subject.comparison
    if compared is None:
        return ReportSection()
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
    text = paragraphs(
        in_text(said),
        picture("shaft-models", "Error of models of the shaft against their run time"),
        columns(heads, rows, (3, 2, 2, 2, 2)),
    )
    return ReportSection(text, {"shaft-models": compared.plot()})
