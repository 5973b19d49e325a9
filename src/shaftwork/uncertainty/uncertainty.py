"""Measures of a motion whose parameters are uncertain: their distribution, and what it comes from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from shaftwork.core.errors import ParameterError
from shaftwork.pipeline.arguments import inner_share
from shaftwork.pipeline.network import Network
from shaftwork.results.observer import Array
from shaftwork.sweep.sweep import Measures, sweep
from shaftwork.sweep.sweep_result import Sweep
from shaftwork.uncertainty.draws import Design, Distribution, distributions_in_si, refuse_samples
from shaftwork.uncertainty.uncertainty_result import Uncertainty

Columns = Mapping[str, Array]


def uncertainty(
    net: Network | Callable[[Columns], Columns],
    distributions: Mapping[str, Distribution],
    *,
    measures: Measures | None = None,
    samples: int = 1024,
    method: str = "random",
    level: float = 0.95,
    seed: int = 0,
    **options: Any,
) -> Uncertainty:
    """Draw parameters from their distributions, simulate each sample, and say what that does to measures.

    Law: "random" draws independent samples. "sobol" estimates by Saltelli's scheme which share of the variance comes
    from each parameter: S1 by itself, ST with all that it does together with others. "morris" screens many parameters
    at little cost. The range of each, from the 1 % to the 99 % quantile of its distribution, is divided into three
    equal steps, and effects are changes over two of them, times 1.5: mu* is the mean size of the change over the whole
    range, sigma its spread, which is large where a parameter acts together with others, or not in proportion. Single
    values have no equal steps, so that "morris" takes no lists and no discrete distributions. Parameters are taken as
    independent of each other.

    Args:
        net: the network; or a function from columns of samples by parameter to columns of results by measure.
        distributions: by parameter, a frozen one of scipy.stats, (low, high) for a uniform one, or a list of values
            that are equally likely, such as the seeds of a noise. Values of pairs and lists may have units.
        measures: as in `sweep`.
        samples: how many; of "sobol" a power of two, and as many for each parameter and twice more are simulated; of
            "morris" the trajectories, each of one motion more than there are parameters.
        method: "random", "sobol" or "morris", the last two with the extra `uncertainty`.
        level: of confidence.
        seed: of the random numbers.
        **options: of `sweep`: t_end, rtol, engine, initial, processes, store and so on.

    Raises:
        ParameterError: an argument is out of its range, a sample is not admissible, or "morris" is given single values.
        MissingExtraError: SALib is not installed.
    """
    level = inner_share("level", level)
    known = distributions_in_si(net if isinstance(net, Network) else None, distributions)
    design = Design(known, method, samples, seed)
    if isinstance(net, Network):
        if measures is None:
            raise ParameterError("Name what is measured, measures=['max shaft.tau'].")
        refuse_samples(net, design)
        return Uncertainty(sweep(net, samples=design.columns, measures=measures, **options), design, level)
    if not callable(net):
        raise ParameterError(f"{net!r} is neither a network nor a function of columns of samples.")
    if ignored := [*(["measures"] if measures is not None else []), *options]:
        raise ParameterError(f"{ignored[0]} is for a network; a function gives all its results. Leave it out.")
    given = net(design.columns)
    if not (isinstance(given, Mapping) and given):
        raise ParameterError(f"The function gives {given!r}. It must give columns of results by measure.")
    results = {str(name): np.asarray(column, dtype=float) for name, column in given.items()}
    rows = len(next(iter(design.columns.values())))
    if wrong := [name for name, column in results.items() if column.shape != (rows,)]:
        raise ParameterError(f"The function gives '{wrong[0]}' another length than the {rows} samples.")
    reasons = tuple("" if np.isfinite(row).all() else "no finite value" for row in zip(*results.values(), strict=True))
    return Uncertainty(Sweep(getattr(net, "__name__", "function"), design.columns, results, {}, reasons), design, level)
