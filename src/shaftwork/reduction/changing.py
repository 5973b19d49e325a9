"""What has no equations beside an inertia that changes with its angle or with time."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from shaftwork.core.errors import Diagnostic
from shaftwork.network.graph import GraphPart
from shaftwork.network.wording import at_nodes, listed
from shaftwork.reduction.view import View


def changing_problems(view: View, jumping: Sequence[Diagnostic]) -> Iterator[Diagnostic]:
    """Impulses that would need the inertia of their instant, and travelling waves.

    Args:
        view: the state form.
        jumping: what is said of prescribed speeds that jump.
    """
    if not (changing := view.form.inertial):
        return
    store = view.words(changing[0]).store
    begin = f"{view.titles(changing)} at {at_nodes(view.ends(changing))}: its {store} changes during the motion,"
    rigid = [part for part in view.graph.parts if _strikes(part)]
    jumps = [problem.parts[0] for problem in jumping]
    waves = [*dict.fromkeys(view.graph.part_of(line).name for line in view.form.waves)]
    for others, what, hint in (
        ([part.name for part in rigid], "strikes rigidly", "Give the contact a stiffness c."),
        (jumps, "jumps, which is an impulse to what is joined to it", "Let it rise in a short while, as Ramp does."),
        (waves, "is a travelling wave", "Take model=Spectral(24) for the shaft."),
    ):
        if others:
            message = f"{begin} but {listed(others)} {what}."
            yield Diagnostic("changing inertia", message, hint, (*view.parts(changing), *others), view.ends(changing))


def _strikes(part: GraphPart) -> bool:
    """Whether a part has contacts from which speeds come back at once."""
    return any(leave.rebound is not None for modes in part.modes for mode in modes.options for leave in mode.leaves)
