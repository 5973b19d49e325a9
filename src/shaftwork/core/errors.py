"""The errors of the package: one base, one child for each stage in which a user can meet them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from difflib import get_close_matches
from importlib import import_module
from typing import Any, Literal

Severity = Literal["error", "warning", "note"]


@dataclass(frozen=True)
class Diagnostic:
    """One thing that is wrong with, or worth saying about, a network.

    Args:
        kind: short name of the diagnosis, stable across releases ("massless node").
        message: what is wrong, with the part and the node.
        hint: what exists instead and the next step.
        parts: names of the parts concerned.
        nodes: names of the nodes concerned.
        severity: "error" stops the assembly; "warning" is raised as `NetworkWarning`; "note" is only listed.
    """

    kind: str
    message: str
    hint: str
    parts: tuple[str, ...] = ()
    nodes: tuple[str, ...] = ()
    severity: Severity = "error"

    def __str__(self) -> str:
        return f"{self.kind}: {self.message} {self.hint}".rstrip()


class ShaftworkError(Exception):
    """Base of every error that Shaftwork raises on purpose."""


class ParameterError(ShaftworkError, ValueError):
    """A parameter is missing, out of its bounds, not finite or of the wrong unit."""


class NetworkError(ShaftworkError, ValueError):
    """A network cannot be assembled; `problems` holds every reason found, not only the first."""

    def __init__(self, title: str, problems: tuple[Diagnostic, ...]) -> None:
        self.problems, self._title = problems, title
        count = "1 problem" if len(problems) == 1 else f"{len(problems)} problems"
        lines = [f"{title}: {count}", *(f"  {number}. {problem}" for number, problem in enumerate(problems, 1))]
        super().__init__("\n".join(lines))

    def __reduce__(self) -> tuple[Any, ...]:
        return NetworkError, (self._title, self.problems)


class NetworkWarning(UserWarning):
    """A network can be assembled, but probably does not do what its author expects."""


class AccuracyWarning(UserWarning):
    """A result is less accurate than was asked; says by how much and why."""


class ModelFileError(ShaftworkError, ValueError):
    """A model file or an expression in it cannot be read."""


class CompileError(ShaftworkError):
    """A network's equations cannot be turned into an explicit model."""


class SimulationError(ShaftworkError, RuntimeError):
    """An integration failed: says when, in which state and why."""


def in_one_line(error: Exception) -> str:
    """What an error says in one line; of a network that cannot be assembled, its first problem."""
    lines = str(error).splitlines() or [""]
    return f"{lines[0]}: {error.problems[0]}" if isinstance(error, NetworkError) and error.problems else lines[0]


def as_reason(text: str) -> str:
    """The first line of an error, as a reason within a sentence."""
    line = text.splitlines()[0].rstrip(".")
    return line[0].lower() + line[1:]


def no_value(t: float, law: str) -> SimulationError:
    """The error of a law that has no real value at a time in s of a motion.

    Args:
        t: s.
        law: in words, "tau = sqrt(1 - t) of TorqueSource 'pull'".
    """
    return SimulationError(
        f"At t = {t:.9g} s {law} has no real value. Give a law that has one at all times, speeds and angles of the "
        "motion: a root or a logarithm of Max(0, ...), a power of Abs(...), a divisor that is never zero, a Piecewise "
        "that ends with True."
    )


class MissingExtraError(ShaftworkError, ImportError):
    """An optional library is needed; the message names the extra that brings it."""

    def __init__(self, library: str, extra: str, purpose: str) -> None:
        super().__init__(f"{purpose} needs {library}. Install it with: pip install 'shaftwork[{extra}]'", name=library)
        self._needs = library, extra, purpose

    def __reduce__(self) -> tuple[Any, ...]:
        return MissingExtraError, self._needs


def imported(library: str, extra: str, purpose: str) -> Any:
    """An optional library.

    Args:
        library: to import.
        extra: that brings it.
        purpose: who needs it, "Solution.to_pandas()".

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        return import_module(library)
    except ImportError:
        raise MissingExtraError(library, extra, purpose) from None


class SignalError(ShaftworkError, KeyError):
    """A solution was asked for a quantity that it does not have; the message lists those that it has."""

    def __str__(self) -> str:
        return str(self.args[0])


def no_quantity(name: object, title: str, names: Iterable[str]) -> SignalError:
    """The error of a quantity that is not there: what its part has, or else which parts are like it.

    Args:
        name: what was asked for, "shaft.tua" or "shaft".
        title: of the network.
        names: of all quantities, "part.quantity".
    """
    by_owner: dict[str, list[str]] = {}
    for other in names:
        by_owner.setdefault(other.rpartition(".")[0], []).append(other)
    text = str(name)
    owner = text if text in by_owner else text.rpartition(".")[0] or text
    if owner in by_owner:
        there = f"'{owner}' has: {', '.join(by_owner[owner])}."
    else:
        close = get_close_matches(owner, by_owner, n=3) or list(by_owner)[:12]
        there = f"There is no part or node '{owner}'. Close to it: {', '.join(close)}."
    return SignalError(f"No quantity {name!r} in '{title}'. {there}")
