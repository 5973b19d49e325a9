"""Load cycles and damage of the quantities of a motion, by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from shaftwork.core.errors import ParameterError, SignalError
from shaftwork.results.fatigue import Damage, SNLine, damage
from shaftwork.results.rainflow import Rainflow, rainflow

if TYPE_CHECKING:
    from shaftwork.results.solution import Solution


def load_cycles(solution: Solution, name: str, place: int | None, smallest: float) -> Rainflow:
    """The load cycles of a quantity; see `Solution.rainflow`."""
    places = _places(solution, name)
    if place is None and not places:
        solution[name]  # refuses a name that does not exist, and says which do
        unit, title = solution.observer.units[name], name
    elif place is not None and place in range(len(places)):
        unit, title = solution.observer.profiles[name][0], f"{name} at {places[place]:g} m"
    elif places:
        raise SignalError(
            f"'{name}' is read at {len(places)} places along the part; say which by place=0 to {len(places) - 1}. "
            f"places['{name}'] has them in m."
        )
    else:
        raise SignalError(f"'{name}' is not read along a part. Leave out place={place!r}.")

    read = solution.reader.quantity(name, place)
    return rainflow(read, solution.steps, title=solution.name, name=title, unit=unit, smallest=smallest)


def damage_of(solution: Solution, name: str, sn: object, smallest: float) -> Damage:
    """The damage of a quantity; at the worst place, where it is read along a part."""
    if not isinstance(sn, SNLine):
        raise ParameterError(f"sn = {sn!r} must be an S-N line, such as SNLine(amplitude=300.0, cycles=1e6, slope=5).")
    places = range(len(_places(solution, name))) or (None,)
    found = [damage(load_cycles(solution, name, place, smallest), sn) for place in places]
    return max(found, key=lambda one: one.damage)


def damages(solution: Solution, sn: SNLine | Mapping[str, SNLine], smallest: float) -> dict[str, Damage]:
    """The damage of every shaft and spring, or of the quantities that S-N lines are given for."""
    lines = dict(sn) if isinstance(sn, Mapping) else dict.fromkeys(_twisted(solution), sn)
    if not lines:
        raise SignalError(
            f"There is no shaft or spring in '{solution.name}'. Name a quantity: damage('part.tau', sn=...)."
        )
    return {name: damage_of(solution, name, line, smallest) for name, line in lines.items()}


def _places(solution: Solution, name: str) -> tuple[float, ...]:
    profiles = solution.observer.profiles
    return profiles[name][1] if isinstance(name, str) and name in profiles else ()


def _twisted(solution: Solution) -> tuple[str, ...]:
    """The torques of all that is twisted: springs and gaps have a twist, long shafts a torque along them."""
    units = solution.observer.units
    parts = dict.fromkeys(name.rpartition(".")[0] for name in units)
    twisted = (
        part for part in parts if f"{part}.phi_rel" in units or {f"{part}.phi", f"{part}.omega_rel"} <= units.keys()
    )
    along = (name for name in solution.observer.profiles if name.endswith(".tau"))
    return (*(f"{part}.tau" for part in twisted if f"{part}.tau" in units), *along)
