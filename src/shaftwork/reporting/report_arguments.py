"""What a user gives to a report, checked before anything is computed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, TypedDict, cast

from shaftwork.core.errors import ParameterError
from shaftwork.numerics.tolerances import TYPED
from shaftwork.pipeline.arguments import Point, several
from shaftwork.pipeline.network import Network
from shaftwork.results.fatigue import SNLine
from shaftwork.results.observer import Array, array_in_si
from shaftwork.results.solution import Solution


class Contents(TypedDict, total=False):
    """What a report can have besides the network and its motion.

    Attributes:
        signals: quantities to draw and to list; by default those of the scene, or the states.
        phases: combinations of modes whose equations are printed; by default those that last longest.
        at: the point about which frequencies are computed, as for `Network.modes`.
        speeds: (k,) rad/s, of a Campbell diagram.
        orders: its excitations per turn, by default 1, 2 and 3.
        sn: the S-N line of what is twisted, or one for each quantity.
        origins: where values come from, by part or by "part.parameter": a column of the table of values.
        assumptions: what was chosen and why, a sentence each.
        references: literature, a line each.
        comparison: of models of a shaft, from `studies.work_precision`.
        torsional: a torsional vibration calculation.
    """

    signals: Sequence[str]
    phases: Sequence[str]
    at: Point
    speeds: Sequence[float]
    orders: Sequence[float]
    sn: SNLine | Mapping[str, SNLine]
    origins: Mapping[str, str]
    assumptions: Sequence[str]
    references: Sequence[str]
    comparison: Any
    torsional: Any


TEXTS = ("signals", "phases", "assumptions", "references")
"""Contents that are lists of texts."""
RECORDS = {
    "comparison": ("trials", "a comparison of shaft models, sw.studies.work_precision(...)"),
    "torsional": ("barred", "a torsional calculation, sw.torsional_calculation(...)"),
}
"""Contents that another feature computes: what they have, and where they come from."""


def checked(contents: Contents) -> Contents:
    """Contents as tuples and numbers in SI.

    Raises:
        ParameterError: a report has no such thing, or it is something else than it must be.
    """
    for name in contents:
        if name not in Contents.__annotations__:
            raise ParameterError(f"report: there is no {name!r}. There are: {', '.join(Contents.__annotations__)}.")
    result: dict[str, Any] = {name: value for name, value in contents.items() if value is not None}
    for name in set(TEXTS) & result.keys():
        result[name] = texts(name, result[name])
    for name, unit in (("speeds", "rad/s"), ("orders", "1")):
        if name in result:
            result[name] = _numbers(name, result[name], unit)
    for name in set(RECORDS) & result.keys():
        attribute, source = RECORDS[name]
        if not hasattr(result[name], attribute):
            raise ParameterError(f"{name} = {result[name]!r} must be {source}.")
    lines = result.get("sn")
    listed = lines.values() if isinstance(lines, Mapping) else [lines]
    if lines is not None and (wrong := [line for line in listed if not isinstance(line, SNLine)]):
        raise ParameterError(f"sn = {wrong[0]!r} must be an S-N line, sw.SNLine(...), or by quantity one for each.")
    if "origins" in result and not isinstance(result["origins"], Mapping):
        raise ParameterError(f"origins = {result['origins']!r} must say by part, {{'J1': 'drawing 4711'}}.")
    return cast("Contents", result)


def _numbers(name: str, values: Any, unit: str) -> Array:
    """(k,) numbers.

    Raises:
        ParameterError: they are none.
    """
    several(name, values)
    numbers = array_in_si(name, values, unit)
    if not (numbers.size and bool(((numbers >= 0) & (numbers < math.inf)).all())):
        raise ParameterError(f"{name} = {values!r} must be numbers{'' if unit == '1' else f' in {unit}'}, 0 or more.")
    return numbers


def texts(name: str, values: Any) -> tuple[str, ...]:
    """A list of texts.

    Raises:
        ParameterError: it is one text, or something else is in it.
    """
    if isinstance(values, str):
        raise ParameterError(f"{name} = {values!r} must be a list of texts, such as [{values!r}].")
    listed = several(name, values)
    if wrong := [value for value in listed if not isinstance(value, str)]:
        raise ParameterError(f"{name}: {wrong[0]!r} must be a text.")
    return listed


def checked_head(**head: Any) -> None:
    """Refuse what is no text in the head of a document.

    Raises:
        ParameterError: a value is neither a text nor left out.
    """
    for name, value in head.items():
        if value is not None and not isinstance(value, str):
            raise ParameterError(f"{name} = {value!r} must be a text.")


def section_names(argument: str, names: Any, there: Sequence[str]) -> tuple[str, ...]:
    """Names of sections.

    Raises:
        ParameterError: there is no such section.
    """
    wanted = texts(argument, names)
    for name in wanted:
        if name not in there:
            raise ParameterError(f"{argument}: there is no section {name!r}. There are: {', '.join(there)}.")
    return wanted


def refuse_foreign(solution: Any, network: Network) -> None:
    """Refuse the motion of another network.

    Raises:
        ParameterError: it has other parts, or other values of their parameters; or it is no motion.
    """
    if not isinstance(solution, Solution):
        raise ParameterError(f"solution = {solution!r} must be a motion, net.simulate(t_end).")
    there = {part.name: part.values for part in network.parts}
    named = {name.rpartition(".") for name in solution.parameters}
    strange = [part for part, _, _ in named if part not in there]
    other = [
        f"{part}.{name}"
        for part, _, name in named
        if isinstance(value := there.get(part, {}).get(name), float | int)
        and not isinstance(value, bool)
        and not math.isclose(value, solution.parameters[f"{part}.{name}"], rel_tol=TYPED)
    ]
    if strange or other:
        what = f"part '{min(strange)}'" if strange else f"'{min(other)}' has another value"
        raise ParameterError(
            f"solution is a motion of another network than '{network.name}': {what}. Give the network that it is of."
        )


def refuse_unknown(origins: Mapping[str, str], network: Network) -> None:
    """Refuse an origin of a part or parameter that there is not.

    Raises:
        ParameterError: there is none of this name.
    """
    there = {part.name: [f"{part.name}.{name}" for name in part.declared] for part in network.parts}
    for name, origin in origins.items():
        if not isinstance(origin, str):
            raise ParameterError(f"origins: {origin!r}, where {name!r} comes from, must be a text.")
        if name not in there and all(name not in parameters for parameters in there.values()):
            near = there.get(str(name).rpartition(".")[0]) or list(there)
            raise ParameterError(f"origins: there is no part or parameter {name!r}. There are: {', '.join(near[:20])}.")


def refuse_idle(contents: Contents, motion: Solution | None) -> None:
    """Refuse contents that would have no effect.

    Raises:
        ParameterError: they are of a motion or a diagram that the report does not have, or of none of its quantities.
    """
    if "orders" in contents and "speeds" not in contents:
        raise ParameterError("orders= are those of a Campbell diagram. Give its speeds= too.")
    if idle := [name for name in ("signals", "phases", "sn") if name in contents and motion is None]:
        raise ParameterError(f"{idle[0]}= needs a motion. Give t_end= or solution=.")
    lines = contents.get("sn")
    for name in lines if isinstance(lines, Mapping) else ():
        if motion is not None and name not in motion:
            raise ParameterError(f"sn: the motion has no quantity {name!r}. It has: {', '.join([*motion][:20])}.")
