"""Controllers that were designed as linear systems: they read any speeds and torques of a network and act at its nodes.

A continuous one is a set of integrators, across stores of the domain of signals. A sampled one has stores that rest
between its sampling instants.
"""

from __future__ import annotations

import ast
import reprlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
from sympy import Add, Expr, Float, Integer

from shaftwork.components.base import Component, Port, Role, Signal, component, number_of
from shaftwork.components.branches import AcrossLaw, AcrossStore, Branch, ThroughLaw, across_of, measured_of
from shaftwork.components.laws import t as TIME
from shaftwork.components.sampling import Sampler
from shaftwork.core.domains import ELECTRICAL, ROTATION, SIGNAL, TRANSLATION
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import LARGEST, is_quantity, parameter

MOST = 64
"""Rows and columns of a matrix: each entry is a term of a law that is printed and compiled."""
ACTS = {
    "torque": (ROTATION, ThroughLaw),
    "force": (TRANSLATION, ThroughLaw),
    "current": (ELECTRICAL, ThroughLaw),
    "voltage": (ELECTRICAL, AcrossLaw),
}
"""What a controller can give to its node: the domain, and the kind of branch that gives it."""


@dataclass(frozen=True)
class Gains:
    """A matrix of numbers.

    Args:
        rows: of equal length; a list of numbers is one row, a number a matrix of one entry.

    Raises:
        ParameterError: they are no finite numbers, or rows of different length.
    """

    rows: Any

    def __post_init__(self) -> None:
        try:
            values = np.asarray(self.rows)
        except ValueError:  # rows of different length
            values = np.array("")
        values = values.reshape((0, 0)) if values.size == 0 else np.atleast_2d(values)
        real = values.dtype.kind in "iuf" and not is_quantity(self.rows)
        if not real or values.ndim > 2 or max(values.shape) > MOST or not (np.abs(values) <= LARGEST).all():
            raise ParameterError(
                f"{reprlib.repr(self.rows)} is no matrix of up to {MOST} by {MOST} finite numbers. Write rows of equal "
                "length: [[0, 1], [-2, -3]]."
            )
        object.__setattr__(self, "rows", tuple(tuple(map(float, row)) for row in values.tolist()))

    def __repr__(self) -> str:
        """The text that `read` makes the same of."""
        return str([list(row) for row in self.rows])

    @classmethod
    def read(cls, value: Any) -> Gains:
        """A matrix from its text, "[[0, 1], [-2, -3]]", from rows of numbers or an array.

        Raises:
            ParameterError: it is none.
        """
        literal = _literal(value) if isinstance(value, str) else None
        return cls(value if literal is None else literal)

    @property
    def array(self) -> Any:
        """(n, m)."""
        return np.array(self.rows, dtype=float).reshape(len(self.rows), len(self.rows[0]) if self.rows else 0)


@dataclass(frozen=True)
class Listed:
    """One or more names, in their order.

    Args:
        names: a text for one name, or several.

    Raises:
        ParameterError: there are none, or they are no texts.
    """

    names: Any

    def __post_init__(self) -> None:
        names = (self.names,) if isinstance(self.names, str) else self.names
        right = isinstance(names, Sequence) and 0 < len(names) <= MOST
        if not right or not all(isinstance(name, str) and name.strip() for name in names):
            raise ParameterError(f'{reprlib.repr(self.names)} must be 1 to {MOST} names, such as ["J2.omega"].')
        object.__setattr__(self, "names", tuple(names))

    def __repr__(self) -> str:
        """The text that `read` makes the same of."""
        return str(list(self.names))

    @classmethod
    def read(cls, value: Any) -> Listed:
        """Names from their text, '["J1.omega", "J2.omega"]', a text for one of them, or a sequence of texts.

        Raises:
            ParameterError: they are none.
        """
        listed = isinstance(value, str) and value.lstrip().startswith("[")
        return cls(_literal(value) if listed else value)


def _literal(text: str) -> Any:
    """The lists of numbers or names that a text is, or None."""
    try:
        return ast.literal_eval(text.strip())
    except (SyntaxError, ValueError, TypeError, RecursionError, MemoryError):
        return None


@dataclass(frozen=True)
class Controller(Component):
    """Base of controllers: linear systems from the deviations of what they measure to what they give to their nodes.

    A subclass says `matrices`. There is a port for each output: "a" of a single one, else "a_1", "a_2", ...
    """

    # ruff takes a field of any type for mutable
    measured: Any = parameter("1", "what it reads, such as J2.omega, shaft.tau_c", record=Listed)  # noqa: RUF009
    reference: Any = parameter("1", "what the first is to be, in its SI unit", law=True, default=0.0, latex="r")  # noqa: RUF009
    setpoints: Any = parameter("1", "what each of them is to be besides", record=Gains, default=None)  # noqa: RUF009
    acts: Any = parameter("1", f"at its nodes: {', '.join(ACTS)}", record=Listed, default="torque")  # noqa: RUF009
    sample_time: float | None = parameter("s", "time between samples; continuous", above=0, default=None, latex="T")

    role: ClassVar[Role] = "source"
    ports: ClassVar = (Port("a"),)

    def __post_init__(self) -> None:
        for name, declared in self.declared.items():
            objection = declared.magnitude(getattr(self, name))[1]
            if objection is not None and (declared.record is not None or name == "sample_time"):
                raise ParameterError(f"{type(self).__name__} '{self.name}': {name} {objection}.")
        super().__post_init__()
        self._refuse_wrong_sizes()
        inner = [f"x_{k}" for k in range(1, len(self.matrices()[0]) + 1)]
        inner += self._held()
        domains = [ACTS[kind][0] for kind in self.acts.names]
        places = [f"_{k}" for k in range(1, len(domains) + 1)] if len(domains) > 1 else [""]
        ports = tuple(Port(f"a{place}", domain) for place, domain in zip(places, domains, strict=True))
        shown: dict[str, Any] = {"ports": ports, "inner": tuple(Port(name, SIGNAL) for name in inner)}
        shown |= {"signal_ports": frozenset(inner), "measures": self.measured.names}
        for name, value in shown.items():  # of this part, in place of those of its class
            object.__setattr__(self, name, value)

    def matrices(self) -> tuple[Any, Any, Any, Any]:
        """A, B, C, D: arrays (n, n), (n, k), (m, n), (m, k)."""
        raise NotImplementedError

    def _refuse_wrong_sizes(self) -> None:
        title = f"{type(self).__name__} '{self.name}'"
        if others := {*getattr(self.reference, "free_symbols", ())} - {TIME}:
            raise ParameterError(
                f"{title}: reference depends on {min(map(str, others))}, but may depend on the time t alone. What is "
                "to follow another quantity measures that one, too."
            )
        if strange := [kind for kind in self.acts.names if kind not in ACTS]:
            raise ParameterError(f"{title}: acts = {strange[0]!r} is none of: {', '.join(ACTS)}.")
        A, B, C, D = self.matrices()
        n, k, m = len(A), len(self.measured.names), len(self.acts.names)
        for name, matrix, shape in (("A", A, (n, n)), ("B", B, (n, k)), ("C", C, (m, n)), ("D", D, (m, k))):
            if matrix.shape != shape:
                more = name in "CD" and len(matrix) > m
                hint = " Name what each output is: acts=['torque', 'torque']." if more else ""
                raise ParameterError(
                    f"{title}: {name} has the shape {matrix.shape} and must have {shape}, as A has {n} rows and "
                    f"{k} measured quantities lead to {m} outputs ({', '.join(self.acts.names)}).{hint}"
                )
        if self.setpoints is not None and self.setpoints.array.size != k:
            raise ParameterError(f"{title}: setpoints = {self.setpoints} must be {k} numbers, one for each quantity.")

    def _setpoints(self) -> Any:
        k = len(self.measured.names)
        return np.zeros(k) if self.setpoints is None else self.setpoints.array.ravel()

    def _held(self) -> tuple[str, ...]:
        """Of a sampled one the names of its outputs as they are held; else none."""
        outputs = 0 if self.sample_time is None else len(self.acts.names)
        return tuple(f"x_u_{k}" for k in range(1, outputs + 1))

    def inner_ports(self) -> tuple[Port, ...]:
        """One for each state, and of a sampled one for each output that it holds."""
        return self.inner

    def signals(self) -> dict[str, Signal]:
        """What it gives to each node and what is across it there, and its states."""
        signals: dict[str, Signal] = {}
        for port in self.ports:
            domain, place = port.domain or ROTATION, port.name.removeprefix("a")
            signals[f"{domain.across.name}{place}"] = Signal("across", (port.name, None), domain)
            signals[f"{domain.through.name}{place}"] = Signal("through", (port.name, None), domain, -1)
        return signals | {port.name: Signal("across", (port.name, None), SIGNAL) for port in self.inner}

    def branches(self, p: Any) -> Iterator[Branch]:
        A, B, C, D = self.matrices()
        states, sampler = [f"x_{k}" for k in range(1, len(A) + 1)], self.sampler()
        x = [across_of(name) for name in states]
        for name in (*states, *self._held()):
            yield AcrossStore(Integer(1), (name, None), name)
        if sampler is None:
            points = [Float(value) if value else Integer(0) for value in self._setpoints().tolist()]
            e = [point - measured_of(name) for point, name in zip(points, self.measured.names, strict=True)]
            e[0] += p.reference
            for name, row, gains in zip(states, A, B, strict=True):
                yield ThroughLaw(_sum(row, x) + _sum(gains, e), (None, name), name.replace("x", "w"))
            outputs = [_sum(row, x) + _sum(gains, e) for row, gains in zip(C, D, strict=True)]
        else:
            outputs = [across_of(name) for name in self._held()]
        for law, port, kind in zip(outputs, self.ports, self.acts.names, strict=True):
            branch = ACTS[kind][1]
            label = port.name.replace("a", "u") if len(self.ports) > 1 else "u"
            yield branch(-law if branch is ThroughLaw else law, (port.name, None), label)

    def sampler(self) -> Sampler | None:
        """The step that a sampled one makes."""
        period = number_of(self, "sample_time")
        if period is None:
            return None
        reference, _ = self.declared["reference"].magnitude(self.reference)
        return Sampler(period, *self.matrices(), self.measured.names, self._setpoints(), reference)

    def within(self, names: Mapping[str, str]) -> Self:
        """Under its new name, with what it measures under the new names of its parts and nodes."""
        parted = (name.rpartition(".") for name in self.measured.names)
        measured = [f"{names.get(owner, owner)}.{quantity}" for owner, _, quantity in parted]
        return self.changed(name=names[self.name], measured=measured)


def _sum(factors: Any, terms: Sequence[Expr]) -> Expr:
    return Add(*(_number(factor) * term for factor, term in zip(factors.tolist(), terms, strict=True) if factor))


def _number(value: float) -> Expr:
    """Whole numbers as such, which print and multiply exactly."""
    return Integer(int(value)) if value % 1 == 0 and abs(value) < 1e6 else Float(value)


@component
class StateSpaceController(Controller):
    """A linear controller in states: of LQR, with an observer, or of any other design.

    Law: x' = A x + B e, u = C x + D e, with e = reference + setpoints - measured; the reference is that of the first
    measured quantity. With a sample time T it is x(k+1) = A x(k) + B e(k), u(k) = C x(k) + D e(k), and u is held until
    the next instant: the first is the start of the motion where that is a multiple of T. So a gain K of LQR, u = -K y,
    is D = K, and a PI controller has A = 0, B = 1, C = k_i, D = k_p, a sampled one A = 1, B = T instead.

    It measures speeds and voltages of parts and nodes, and what springs and inductors let through: `shaft.tau_c`. To
    measure an angle, let a state integrate the speed. Each output goes to a node of its own, as a torque, force,
    current or voltage. It has no output limits; a `SpeedController` has them, with anti-windup. Its states hold no
    energy of the drive. Analogue: a controlled current or voltage source. Source: Åström 2008, chapters 6 and 7.
    """

    A: Any = parameter("1", "states by states; none", record=Gains, default=None)
    B: Any = parameter("1", "states by deviations", record=Gains, default=None)
    C: Any = parameter("1", "outputs by states", record=Gains, default=None)
    D: Any = parameter("1", "outputs by deviations; zero", record=Gains, default=None)

    def matrices(self) -> tuple[Any, Any, Any, Any]:
        """As given; without A there are no states, without D there is no direct way through."""
        k, m = len(self.measured.names), len(self.acts.names)
        n = 0 if self.A is None else len(self.A.rows)
        needed = {"A, B and C, or D": self.D} if not n else {"B": self.B, "C": self.C}
        if missing := [names for names, gains in needed.items() if gains is None]:
            raise ParameterError(
                f"StateSpaceController '{self.name}': {missing[0]} must be given, else it does nothing. A gain alone "
                "is D = [[2.0]]; a continuous PI controller has A = 0, B = 1, C = k_i, D = k_p."
            )
        sized = ((self.A, (n, n)), (self.B, (n, k)), (self.C, (m, n)), (self.D, (m, k)))
        A, B, C, D = (
            np.zeros(shape) if gains is None or not (gains.rows or 0 not in shape) else gains.array
            for gains, shape in sized
        )
        return A, B, C, D

    @classmethod
    def from_control(cls, name: str, system: Any, **values: Any) -> Self:
        """A controller designed with python-control, or one of `scipy.signal`.

        Args:
            name: of the part.
            system: a `control.StateSpace` from deviations to outputs, or anything with A, B, C, D and dt. Where its
                inputs have names that `LinearModel.to_control` gave, "J2:omega", they are what it measures.
            **values: `measured` where the inputs have other names, `reference`, `acts` and the like.

        Raises:
            ParameterError: it has no matrices, or they and the values do not fit together.
        """
        try:
            matrices = {key: Gains(np.asarray(getattr(system, key))) for key in "ABCD"}
        except AttributeError:
            raise ParameterError(
                f"{cls.__name__} '{name}': {reprlib.repr(system)} has no matrices A, B, C, D. Give a state space, "
                "control.ss(system)."
            ) from None
        period = getattr(system, "dt", None)
        if isinstance(period, bool):
            raise ParameterError(
                f"{cls.__name__} '{name}': the system is discrete and has no sample time. Give it one, dt=0.01."
            )
        labels = [label.replace(":", ".") for label in getattr(system, "input_labels", ())]
        parameters = {**matrices, "measured": labels or None, "sample_time": period or None, **values}
        return cls(name, **{key: value for key, value in parameters.items() if value is not None})


@component
class TransferFunctionController(Controller):
    """A linear controller as a quotient of polynomials, from one measured quantity to one output.

    Law: u = N(s) / M(s) (reference + setpoint - measured), with coefficients from the highest power of s down; a PI
    controller k_p + k_i / s is numerator=[k_p, k_i], denominator=[1, 0]. With a sample time they are polynomials in z,
    and u is held between the instants. Its states are those of the controllable canonical form.
    Analogue: a controlled current or voltage source. Source: Åström 2008, chapter 8.
    """

    numerator: Any = parameter("1", "coefficients, from the highest power down", record=Gains)
    denominator: Any = parameter("1", "coefficients, from the highest power down", record=Gains)

    def matrices(self) -> tuple[Any, Any, Any, Any]:
        """The controllable canonical form."""
        title = f"TransferFunctionController '{self.name}'"
        for name in ("numerator", "denominator"):
            gains = getattr(self, name)
            if len(gains.rows) != 1 or (name == "denominator" and not gains.array.any()):
                raise ParameterError(
                    f"{title}: {name} = {gains} must be one row of coefficients from the highest power down, such as "
                    "[2.0, 1.0], of a denominator not zeros alone."
                )
        if len(self.measured.names) > 1 or len(self.acts.names) > 1:
            raise ParameterError(f"{title}: it leads from one measured quantity to one output. Take several of them.")
        above, below = (np.trim_zeros(gains.array.ravel(), "f") for gains in (self.numerator, self.denominator))
        n = below.size - 1
        if above.size > below.size:
            raise ParameterError(
                f"{title}: its denominator is of degree {n}, below the numerator's {above.size - 1}, and no states "
                "give such an output. Add a fast pole: k_d s is k_d s / (T s + 1)."
            )
        with np.errstate(over="ignore"):
            above, below = above / below[0], below / below[0]
        if not np.abs([*above, *below]).max() <= LARGEST:
            raise ParameterError(
                f"{title}: the first coefficient of its denominator is next to zero beside the others. Leave it out."
            )
        a, b = below, np.concatenate([np.zeros(n + 1 - above.size), above])
        A = np.vstack([-a[None, 1:], np.eye(n)[:-1]]) if n else np.zeros((0, 0))
        return A, np.eye(n)[:, :1].reshape(n, 1), (b[1:] - b[0] * a[1:]).reshape(1, n), np.array([[b[0]]])
