"""Which engine suits a problem."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TypeVar

from shaftwork.core.errors import MissingExtraError, ParameterError, SimulationError
from shaftwork.integrate.engines import ENGINES, GENERAL, available
from shaftwork.integrate.problem import Engine, Problem, SeriesError, StickingError, Trajectory, changed

Run = TypeVar("Run")
"""What a run with an engine gives."""

# An implicit method takes about so many steps for a transient and for a radian of an oscillation at rtol 1e-8.
TRANSIENT_STEPS, STEPS_PER_RADIAN = 300.0, 20.0


def choose(problem: Problem) -> tuple[str, str]:
    """The engine that suits a problem, and why, in one sentence.

    Engines for special systems are asked first (`EngineEntry.special`). Else stiffness decides between the best
    implicit engine here and the best explicit one.

    It looks at eigenvalues at a few states (milliseconds), so keep the answer where many similar problems are solved.
    """
    for name, entry in ENGINES.items():
        asked = entry.special and (problem.linear is not None or problem.x0.size > entry.asked_beyond)
        if asked and entry.installed and (why := entry.function("suits")(problem)):
            return name, why
    compiled = available("heyoka") and problem.program is not None
    with_numba = not compiled and available("numba") and problem.compiled is not None
    stiff = _stiff(problem, "heyoka" if compiled else "numba" if with_numba else "scipy")
    if stiff is not None:
        return stiff
    if compiled:
        return "heyoka", "The system is not stiff and its equations are compiled, so Taylor series are the fastest."
    reason = "heyoka cannot compile its equations" if available("heyoka") else "heyoka is not installed"
    if with_numba and problem.machine is not None:
        return "numba", f"The system is not stiff and {reason}, so DOP853 is taken, compiled by numba."
    if with_numba and (stiff := _stiff(problem, "scipy")) is not None:
        return stiff
    return "scipy", f"The system is not stiff and {reason}, so scipy's DOP853 is taken."


def implicit() -> str:
    """The engine for stiff systems here."""
    return "sundials" if available("sundials") else "scipy-radau"


def is_stiff(problem: Problem) -> bool:
    """Whether an implicit engine costs less than an explicit one that is not compiled."""
    return _stiff(problem, "scipy") is not None


def patience(problem: Problem) -> int:
    """Steps of heyoka that cost as much as a transient of an implicit engine: a stiff phase may be over by then."""
    states = problem.x0.size
    return int(TRANSIENT_STEPS * ENGINES["sundials"].seconds(states) / ENGINES["heyoka"].seconds(states))


def solve(
    problem: Problem, engine: str = "auto", why: str | None = None, *, fallback: bool = False
) -> tuple[Trajectory, str, str]:
    """Solve a problem with an engine by name, or with the one that suits it.

    Args:
        problem: what to solve.
        engine: "auto" or a key of `ENGINES`, that of waves aside.
        why: the reason of an earlier `choose`, where its answer is used again.
        fallback: whether another engine may go on where a Taylor series cannot; always so with "auto".

    Returns:
        The trajectory with its caveat, the name of the engine and why it was taken.

    Raises:
        ParameterError: no engine has this name.
        MissingExtraError: the engine's library is not installed.
        SimulationError: the engine failed.
    """
    name, reason = choose(problem) if engine == "auto" else (engine, f"The engine {engine!r} was asked for.")
    if name != "heyoka" or not (fallback or engine == "auto"):
        trajectory = _run(problem, name)
        return trajectory, name, f"{why or reason} {trajectory.remark}".rstrip()

    def run(other: str, steps: int, because: str) -> tuple[Trajectory, str, str]:
        return _run(changed(problem, max_steps=steps), other), other, because

    try:
        return run(name, problem.max_steps, why or reason)
    except SeriesError as error:
        failed = error
    return without_series(run, failed, problem.max_steps)


def without_series(run: Callable[[str, int, str], Run], failed: SeriesError, most: int) -> Run:
    """A run with other engines, tried one after another, where heyoka cannot go on.

    Args:
        run: makes it with an engine by name, so many steps at most, for a reason.
        failed: why heyoka cannot.
        most: steps.

    Raises:
        SimulationError: no engine goes on; of a motion that sticks where a law jumps heyoka says why.
    """
    if is_driven_back(failed):
        raise failed

    def because(name: str) -> str:
        return f"There is no Taylor series of the whole motion: {failed.obstacle}. So the engine {name!r} is taken."

    stiff_too = available("sundials")  # looked at only now: it takes a while to tell
    # 5000 steps of scipy take some seconds. A motion that comes to rest where a law has an infinite slope, as that of a
    # square root of the speed does, is infinitely stiff there, and an explicit method would need a million.
    ladder = [("scipy", min(most, 5000)), ("sundials", most)] if stiff_too else []
    for name, steps in ladder:
        with suppress(SimulationError):
            return run(name, steps, because(name))
    if stiff_too and isinstance(failed, StickingError):
        raise failed
    return run("scipy", most, because("scipy"))


def is_driven_back(failed: SimulationError) -> bool:
    """Whether a motion sticks where a law jumps, driven back there from both sides: no engine goes on."""
    return isinstance(failed, StickingError) and failed.driven_back


def _run(problem: Problem, name: str) -> Trajectory:
    """The run of an engine with the tolerance that it can keep, with what makes it worth less than it should be."""
    engine, entry = load(name), ENGINES[name]
    trajectory = engine(problem if problem.rtol >= entry.finest else changed(problem, rtol=entry.finest))
    if not trajectory.t.size or (problem.observed is None and entry.explicit):
        return trajectory
    if problem.observed is None:
        from shaftwork.integrate.linear.rounding_errors import spoiled

        said = spoiled(problem, trajectory.t, trajectory.x)
    else:
        from shaftwork.integrate.linear.verification import objection

        said = objection(problem, problem.observed, trajectory, name)
    return replace(trajectory, caveat=said) if said else trajectory


def check(name: str) -> None:
    """Refuse the name of an engine that there is not, or not for networks without waves.

    Raises:
        ParameterError: no engine has this name.
    """
    if name not in ("auto", *GENERAL):
        only = " The engine 'wave' is for networks with a shaft of model=Wave()." if name == "wave" else ""
        raise ParameterError(f"There is no engine {name!r} here. Take one of: auto, {', '.join(GENERAL)}.{only}")


def load(name: str) -> Engine:
    """The function of an engine, whose module is imported now.

    Raises:
        ParameterError: no engine has this name.
        MissingExtraError: the engine's library is not installed.
    """
    if name not in ENGINES or not ENGINES[name].module:
        check(name)
    entry = ENGINES[name]
    if not entry.installed:
        raise MissingExtraError(entry.distribution, entry.extra, f"engine={name!r}")
    return partial(entry.function("solve"), **entry.keywords)


def _stiff(problem: Problem, explicit: str) -> tuple[str, str] | None:
    """The implicit engine and why, where it costs less than an explicit one."""
    from shaftwork.integrate.stiffness import STABLE, bound_of_decay, jacobians, rates

    matrices, duration, name = [*jacobians(problem)], problem.t_end - problem.t0, implicit()
    explicit_step, implicit_step = (ENGINES[each].seconds(problem.x0.size) for each in (explicit, name))
    if bound_of_decay(matrices) * duration / STABLE * explicit_step <= TRANSIENT_STEPS * implicit_step:
        return None
    fastest = rates(matrices)
    problem.estimates.setdefault("decay", fastest.decay)
    stable_steps = fastest.decay * duration / STABLE
    transients, radians = 1 + len(problem.breakpoints), fastest.oscillation * duration
    implicit_steps = TRANSIENT_STEPS * transients + STEPS_PER_RADIAN * radians
    if stable_steps * explicit_step <= implicit_steps * implicit_step:
        return None
    return name, (
        f"The system is stiff: its fastest decay ({fastest.decay:.3g} 1/s) would force an explicit method to about "
        f"{stable_steps:.2g} steps, and an implicit one needs about {implicit_steps:.2g}."
    )
