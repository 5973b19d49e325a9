"""Which engine suits a problem."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import TypeVar

from shaftwork.core.errors import MissingExtraError, ParameterError, SimulationError
from shaftwork.integrate.engines import ADAMS, ENGINES, INNER
from shaftwork.integrate.problem import Engine, Problem, SeriesError, StickingError, Trajectory, changed

Run = TypeVar("Run")
"""What a run with an engine gives."""

# Why another engine goes on where heyoka stopped.
NO_SERIES = "There is no Taylor series of the whole motion: {}. So {} is taken."
IN_WORDS = {"scipy": "scipy's DOP853", "sundials": "the implicit CVODE"}


# On a damped chain the exact engine is taken up to this estimate of its time in s; the banded one may then be the
# faster, with 0.3 s at 1400 states and rtol 1e-8, where the exact one takes 4 s.
LONGEST_EXACT_CHAIN = 1.0
# Beyond this many states the banded engine is taken for stiff chains. A Kloss motor on a damped shaft of 601 states, at
# rtol 1e-6: 0.34 s (error 2e-6 of the largest torque), CVODE 13 s (error 1.5e-4); with 61 states 0.2 s and 1.6 s. There
# and on chains of 10000 elements it takes some hundred steps, each as long as some explicit ones.
LARGEST_NOT_BANDED, FEWEST_NOT_BANDED = 300, 1e4
STEP = {"scipy": 2e-4, "sundials": 5e-5, "scipy-radau": 2e-3, "heyoka": 2e-7}
"""Times of one step in s, that of heyoka for each state, measured at a few states on one core; their ratios matter."""
# An implicit method takes about so many steps for a transient and for a radian of an oscillation at rtol 1e-8.
TRANSIENT_STEPS, STEPS_PER_RADIAN = 300.0, 20.0

# Of these no run is so long that the rounding of speeds spoils torques: the stiffness bounds their steps.
EXPLICIT = ("heyoka", "scipy", ADAMS)


def choose(problem: Problem) -> tuple[str, str]:
    """The engine that suits a problem, and why, in one sentence.

    It looks at eigenvalues at a few states (milliseconds), so keep the answer where many similar problems are solved.
    """
    if problem.straight is not None:
        from shaftwork.integrate.linear.propagation import LONGEST_EXACT, cost

        seconds = cost(problem, problem.straight)
        longest = LONGEST_EXACT_CHAIN if seconds > LONGEST_EXACT_CHAIN and _is_damped_chain(problem) else LONGEST_EXACT
        if seconds <= longest:
            return "exact", "The system is linear with inputs of straight pieces, so it is propagated exactly."
        if _is_chain(problem):
            return "banded", f"The system is a long linear chain: exact propagation would take about {seconds:.2g} s."
    elif problem.linear is not None:
        from shaftwork.integrate.linear.propagation import drivable

        if drivable(problem):
            return "exact", "The system is linear with smooth inputs, so its modes are propagated without a step error."
    compiled = ENGINES["heyoka"].installed and problem.program is not None
    stiff = _stiff(problem, compiled=compiled)
    if stiff is not None:
        return stiff
    if compiled:
        return "heyoka", "The system is not stiff and its equations are compiled, so Taylor series are the fastest."
    reason = "heyoka cannot compile its equations" if ENGINES["heyoka"].installed else "heyoka is not installed"
    return "scipy", f"The system is not stiff and {reason}, so scipy's DOP853 is taken."


def is_stiff(problem: Problem) -> bool:
    """Whether an implicit engine costs less than an explicit one that is not compiled."""
    return _stiff(problem, compiled=False) is not None


def patience(problem: Problem) -> int:
    """Steps of heyoka that cost as much as a transient of an implicit engine: a stiff phase may be over by then."""
    return int(TRANSIENT_STEPS * STEP["sundials"] / (STEP["heyoka"] * problem.x0.size))


def solve(
    problem: Problem, engine: str = "auto", why: str | None = None, *, fallback: bool = False
) -> tuple[Trajectory, str, str]:
    """Solve a problem with an engine by name, or with the one that suits it.

    Args:
        problem: what to solve.
        engine: "auto" or a key of `ENGINES`.
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
        trajectory = _guarded(problem, load(name)(problem), name)
        return trajectory, name, f"{why or reason} {trajectory.remark}".rstrip()

    def run(other: str, steps: int, because: str) -> tuple[Trajectory, str, str]:
        return _guarded(problem, load(other)(changed(problem, max_steps=steps)), other), other, because

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
    implicit = ENGINES["sundials"].installed  # looked at only now: it takes a while to tell
    # 5000 steps of scipy take some seconds. A motion that comes to rest where a law has an infinite slope, as that of a
    # square root of the speed does, is infinitely stiff there, and an explicit method would need a million.
    ladder = [("scipy", min(most, 5000)), ("sundials", most)] if implicit else []
    for name, steps in ladder:
        with suppress(SimulationError):
            return run(name, steps, NO_SERIES.format(failed.obstacle, IN_WORDS[name]))
    if implicit and isinstance(failed, StickingError):
        raise failed
    return run("scipy", most, NO_SERIES.format(failed.obstacle, IN_WORDS["scipy"]))


def is_driven_back(failed: SimulationError) -> bool:
    """Whether a motion sticks where a law jumps, driven back there from both sides: no engine goes on."""
    return isinstance(failed, StickingError) and failed.driven_back


def _guarded(problem: Problem, trajectory: Trajectory, name: str) -> Trajectory:
    """The run, with what makes it worth less than it should be."""
    if not trajectory.t.size or (problem.observed is None and name in EXPLICIT):
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
    if name not in ("auto", *ENGINES):
        only = " The engine 'wave' is for networks with a shaft of model=Wave()." if name == "wave" else ""
        raise ParameterError(f"There is no engine {name!r} here. Take one of: auto, {', '.join(ENGINES)}.{only}")


def load(name: str) -> Engine:
    """The function of an engine.

    Raises:
        ParameterError: no engine has this name.
        MissingExtraError: the engine's library is not installed.
    """
    if name not in INNER:
        check(name)
    entry = INNER.get(name) or ENGINES[name]
    if not entry.installed:
        raise MissingExtraError(entry.distribution, entry.extra, f"engine={name!r}")
    match name:
        case "exact":
            from shaftwork.integrate.linear import propagation

            return propagation.solve
        case "heyoka":
            from shaftwork.integrate.taylor import heyoka_taylor

            return heyoka_taylor.solve
        case "sundials" | "sundials-adams":
            from shaftwork.integrate import sundials

            return partial(sundials.solve, method="BDF" if name == "sundials" else "Adams")
        case "banded":
            from shaftwork.integrate.collocation import banded

            return banded.solve
        case "scipy" | "scipy-radau":
            from shaftwork.integrate import scipy_ivp

            return partial(scipy_ivp.solve, method="DOP853" if name == "scipy" else "Radau")
    raise AssertionError(f"engine {name!r} of ENGINES is not loaded here")


def _stiff(problem: Problem, *, compiled: bool) -> tuple[str, str] | None:
    """The implicit engine and why, where it costs less than the explicit one."""
    from shaftwork.integrate.stiffness import STABLE, bound_of_decay, jacobians, rates

    matrices, duration = [*jacobians(problem)], problem.t_end - problem.t0
    name = "sundials" if ENGINES["sundials"].installed else "scipy-radau"
    explicit_step, implicit_step = STEP["heyoka"] * problem.x0.size if compiled else STEP["scipy"], STEP[name]
    most = bound_of_decay(matrices) * duration / STABLE
    if problem.x0.size <= LARGEST_NOT_BANDED and most * explicit_step <= TRANSIENT_STEPS * implicit_step:
        return None
    fastest = rates(matrices)
    problem.estimates.setdefault("decay", fastest.decay)
    explicit_steps = max(fastest.decay, fastest.oscillation) * duration / STABLE
    if problem.x0.size > LARGEST_NOT_BANDED and explicit_steps > FEWEST_NOT_BANDED and _is_damped_chain(problem):
        return "banded", (
            f"The system is a long damped chain: an explicit method would need about {explicit_steps:.2g} steps, "
            "and the equations of an implicit one are banded."
        )
    stable_steps = fastest.decay * duration / STABLE
    transients, radians = 1 + len(problem.breakpoints), fastest.oscillation * duration
    implicit_steps = TRANSIENT_STEPS * transients + STEPS_PER_RADIAN * radians
    if stable_steps * explicit_step <= implicit_steps * implicit_step:
        return None
    return name, (
        f"The system is stiff: its fastest decay ({fastest.decay:.3g} 1/s) would force an explicit method to about "
        f"{stable_steps:.2g} steps, and an implicit one needs about {implicit_steps:.2g}."
    )


def _is_chain(problem: Problem) -> bool:
    from shaftwork.integrate.collocation.banded import is_chain

    return is_chain(problem)


def _is_damped_chain(problem: Problem) -> bool:
    from shaftwork.integrate.collocation.banded import is_undamped

    return _is_chain(problem) and not is_undamped(problem)
