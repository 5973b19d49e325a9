"""What of a network can be differentiated: its symbolic equations, by the parameters in which they are smooth."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from sympy import Symbol

from shaftwork.components.laws import t as TIME
from shaftwork.components.noise import HeldNoise, SmoothNoise
from shaftwork.components.slopes import slope
from shaftwork.core.errors import CompileError, ParameterError
from shaftwork.pipeline.model import Model
from shaftwork.reduction.explicit_rows import Rows

NO_DERIVATIVE = {
    "decisive": "decides which equations hold, so nothing is smooth in it. Give it a value that is not exactly zero, "
    "and ratios that are not alike.",
    "whole": "is a whole number, so nothing is smooth in it. Take the difference of two variants, studies.sweep(...).",
    "seed": "is the seed of a noise: another number is another noise. Leave it out.",
    "edge": "moves a switch that is exactly at the start or at the end of the motion, where it comes in or goes out. "
    "Take another t_end, or leave it out.",
}


def rows_of(model: Model) -> Rows:
    """The symbolic equations of a model.

    Raises:
        CompileError: it has none.
    """
    if model.rows is None:
        raise CompileError(
            f"'{model.name}' has no symbolic equations to differentiate: it is too large, too closely coupled, or "
            "holds waves. Take fewer elements, such as model=Lumped(10), or differences of two runs."
        )
    return model.rows


def smooth_parameters(
    model: Model, asked: Sequence[str] | None, used: Sequence[Model], span: tuple[float, float] | None = None
) -> tuple[str, ...]:
    """The parameters by which to differentiate.

    Args:
        model: the compiled network.
        asked: names; None for all in which the equations are smooth.
        used: models of all equations that hold on the way.
        span: start and end of the motion, s; None where there is none.

    Raises:
        ParameterError: there is no such parameter, or nothing is smooth in it.
    """
    declared = {
        f"{placed.part.name}.{name}": made
        for placed in model.netlist.placed
        for name, made in placed.part.declared.items()
    }
    known = [name for name in model.parameters if name in declared]
    reasons = {name: "whole" for name in known if declared[name].whole}
    for one in used:
        reasons |= dict.fromkeys((*one.form.graph.zeros, *one.form.tree.frozen), "decisive")
        reasons |= dict.fromkeys(_seeds(one), "seed")
        if span is not None:
            reasons |= dict.fromkeys(_at_edges(one, span), "edge")
    if asked is None:
        return tuple(name for name in known if name not in reasons)
    for name in asked:
        if name in reasons:
            raise ParameterError(f"'{name}' {NO_DERIVATIVE[reasons[name]]}")
        if name not in known:
            raise ParameterError(f"There is no parameter '{name}' with a number. There are: {', '.join(known)}.")
    return tuple(asked)


def _seeds(model: Model) -> Iterator[str]:
    graph = model.form.graph
    for branch in graph.branches:
        law = graph.in_network_symbols(branch.template.law, branch)
        for noise in law.atoms(HeldNoise, SmoothNoise):
            yield from (symbol.name for symbol in noise.args[1].free_symbols)


def _at_edges(model: Model, span: tuple[float, float]) -> Iterator[str]:
    """Parameters that move a switch of a law of time, or of a mode, which is at the start or at the end of a motion."""
    switching, p = model.switching, model.defaults
    instants = switching.timeline(p, *span)
    after, before = instants.sides(span[0])[1], instants.sides(span[1])[0]
    values = dict(zip((Symbol(name, real=True) for name in model.parameters), p.tolist(), strict=True))
    for time, aside in ((span[0], after - span[0]), (span[1], span[1] - before)):
        for argument in switching.passed(p, time - aside, time + aside, modes=True) if aside else ():
            here = {**values, TIME: time}
            yield from (s.name for s in argument.free_symbols - {TIME} if slope(argument, s).xreplace(here) != 0)
