"""What a component is: a name, declared parameters, ports, and the branches it yields. It knows no solver."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar, Literal, Self, TypeVar, dataclass_transform, get_args

from sympy import Expr, Symbol

from shaftwork.components.branches import Branch, End, is_pair
from shaftwork.components.modes import Modes
from shaftwork.components.sampling import Sampler
from shaftwork.core.domains import DOMAIN_NAMES, DOMAINS, ELECTRICAL, ROTATION, SIGNAL, Domain
from shaftwork.core.errors import NetworkWarning, ParameterError, ShaftworkError
from shaftwork.core.notices import muted
from shaftwork.core.parameters import Parameter, is_label, parameter, refuse_fields

Role = Literal["store", "loss", "source", "coupling"]
SignalKind = Literal["through", "across", "twist", "store"]
SIGNAL_KINDS: tuple[str, ...] = get_args(SignalKind)
_PAIR = "a pair of ports, such as ('a', 'b'), or ('a', None) against the reference"


@dataclass(frozen=True)
class Port:
    """A place where a component meets a node; `domain` None takes any node; an optional port may be left at rest."""

    name: str
    domain: Domain | None = ROTATION
    optional: bool = False

    def __post_init__(self) -> None:
        refuse_fields(
            self,
            name=(is_label(self.name), "a text without dots, such as 'a'"),
            domain=(self.domain is None or self.domain in (*DOMAINS, SIGNAL), f"{DOMAIN_NAMES}, or None for any node"),
            optional=(isinstance(self.optional, bool), "True or False"),
        )


@dataclass(frozen=True)
class Signal:
    """A quantity that can be read from a part: what it is made of, its sign and the quantity's name for the units.

    Args:
        kind: "through" (what the node at `ends[0]` gives to the part), "across" (of the two ends), "twist" (integral of
            across of the part's through store), "store" (the through variable of the store alone).
        ends: the port, or the pair of ports, that it belongs to.
        sign: 1 or -1.
        label: of the through store, where the part has several.
    """

    kind: SignalKind
    ends: tuple[End, End]
    domain: Domain | None
    sign: int = 1
    label: str = ""

    def __post_init__(self) -> None:
        refuse_fields(
            self,
            kind=(self.kind in SIGNAL_KINDS, f"one of {', '.join(map(repr, SIGNAL_KINDS))}"),
            ends=(is_pair(self.ends), _PAIR),
            domain=(self.domain is None or self.domain in (*DOMAINS, SIGNAL), f"{DOMAIN_NAMES}, or None"),
            sign=(self.sign in (1, -1), "1 or -1"),
            label=(self.label == "" or is_label(self.label), "a text without dots"),
        )


@dataclass(frozen=True)
class Profile:
    """A quantity along a part, read at several places at once.

    Args:
        kind: "across" (of nodes) or "through" (of branches).
        places: (k,) where, as shares of the way from the first end, ascending.
        length: the parameter that is the length of the way.
        of: for each place the sum that it is, as (factor, name): the name of a node, the label of a branch, or a port,
            which stands for what the part takes in there.
        domain: of the quantity.
        lines: for a part of lines that waves travel along, instead of `of`: for each place the label of its line, and
            the share of the way along that line.
    """

    kind: Literal["across", "through"]
    places: tuple[float, ...]
    length: str
    of: tuple[tuple[tuple[float, str], ...], ...]
    domain: Domain
    lines: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        refuse_fields(
            self,
            kind=(self.kind in ("across", "through"), "'across' or 'through'"),
            places=(_are_shares(self.places), "shares of the way from 0 to 1, ascending"),
            length=(is_label(self.length), "the name of a parameter"),
            of=(_are_sums(self.of), "for each place the sum that it is, such as ((1.0, 'a'),)"),
            domain=(self.domain in DOMAINS, DOMAIN_NAMES),
            lines=(_are_pairs(self.lines, str, float | int), "for each place a label and a share, such as ('h', 0.5)"),
        )


def _are_pairs(value: Any, first: Any, second: Any) -> bool:
    return isinstance(value, tuple | list) and all(
        isinstance(pair, tuple | list) and len(pair) == 2 and isinstance(pair[0], first) and isinstance(pair[1], second)
        for pair in value
    )


def _are_sums(value: Any) -> bool:
    return isinstance(value, tuple | list) and all(_are_pairs(terms, float | int, str) for terms in value)


def _are_shares(value: Any) -> bool:
    try:
        return all(0 <= low <= high <= 1 for low, high in pairwise((0.0, *value, 1.0)))
    except TypeError:
        return False


@dataclass(frozen=True)
class Derived:
    """A quantity that follows from a part's parameters, and that stands in its printed laws as a letter.

    Args:
        name: under which `Component.branches` finds it, `p.name`.
        law: in the parameters and in those derived before it.
        unit: SI unit.
        meaning: a few words.
        latex: the letter.
    """

    name: str
    law: Expr
    unit: str
    meaning: str
    latex: str

    def __post_init__(self) -> None:
        refuse_fields(
            self,
            name=(isinstance(self.name, str) and self.name.isidentifier(), "a name such as 'omega_k'"),
            law=(isinstance(self.law, Expr), "an expression of p.name"),
            **{field: (isinstance(getattr(self, field), str), "a text") for field in ("unit", "meaning", "latex")},
        )


@dataclass(frozen=True)
class Note:
    """Something worth saying about a part, which stops nothing: `net.check()` lists it with the part and its nodes.

    Args:
        kind: short name, stable across releases.
        message: what it is about, the rest of a sentence that begins with the part.
        hint: the next step.
        torque: with which the part starts, on its node; the loads that rest until it is exceeded are then named.
    """

    kind: str
    message: str
    hint: str
    torque: float | None = None


@dataclass(frozen=True)
class Component:
    """Base of all components. A subclass decorated with `component` declares parameters and yields branches.

    Args:
        name: unique name of the part in its network.
        symbol: subscript of the part's quantities in LaTeX; by default the name.
    """

    name: str
    symbol: str | None = parameter("1", "subscript in LaTeX", default=None)

    ports: ClassVar[tuple[Port, ...]] = (Port("a"), Port("b"))
    inner: ClassVar[tuple[Port, ...]] = ()
    signal_ports: ClassVar[frozenset[str]] = frozenset()  # inner ports of signals: what is stored there is no energy
    measures: ClassVar[tuple[str, ...]] = ()  # quantities of other parts that its laws read, by `measured_of`
    letters: ClassVar[Mapping[Symbol, Expr]] = {}  # in laws of users, beside those of its domain: what they stand for
    role: ClassVar[Role] = "store"
    swing: ClassVar[str] = ""  # the parameter that, at zero, leaves a law that swings with an angle its mean
    declared: ClassVar[Mapping[str, Parameter]] = {}

    def __new__(cls, *_args: Any, **_values: Any) -> Self:
        if "declared" not in vars(cls) or cls is Component:
            raise ShaftworkError(
                f"{cls.__name__} is not a component yet. Write @component above `class {cls.__name__}(Component):`; it "
                "reads the declared parameters and makes the constructor that takes them."
            )
        return super().__new__(cls)

    def __post_init__(self) -> None:
        """Hold records as records, also where their name or text was given: the same part is then equal to itself."""
        for name, declared in self.declared.items():
            if declared.record is not None:
                object.__setattr__(self, name, declared.magnitude(getattr(self, name))[0])

    def branches(self, p: Any) -> Iterator[Branch]:
        """Yield the branches; `p.name` is the symbol of parameter `name` (0 where its value is exactly zero)."""
        raise NotImplementedError

    def modes(self, p: Any) -> Iterator[Modes]:  # noqa: ARG002
        """Yield the modes of each mode machine in the part; by default there are none."""
        yield from ()

    def derived(self, p: Any) -> Iterator[Derived]:  # noqa: ARG002
        """Yield the quantities by whose letters the laws are printed; each is `p.name` from then on. By default none.

        Equations list those that occur with their definitions; computations know the parameters alone.
        """
        yield from ()

    def notes(self) -> Iterator[Note]:
        """Yield what is worth saying about the part by its values; by default nothing."""
        yield from ()

    def signals(self) -> dict[str, Signal]:
        """The quantities that can be read from the part; by default all that its ports and stores define."""
        return default_signals(self)

    def profiles(self) -> dict[str, Profile]:
        """The quantities that can be read along the part; by default none."""
        return {}

    def inner_ports(self) -> tuple[Port, ...]:
        """The nodes inside the part; by default the same for all parts of the class."""
        return self.inner

    def sampler(self) -> Sampler | None:
        """How its inner stores change at sampling instants; by default there are none."""
        return None

    def within(self, names: Mapping[str, str]) -> Self:
        """The same part in a network that is a part of another, from the new names of its parts and nodes."""
        return self.changed(name=names[self.name])

    def changed(self, **values: Any) -> Self:
        """The same part with other values, of which its author has been warned already."""
        with muted(NetworkWarning):
            return dataclasses.replace(self, **values)

    @property
    def values(self) -> dict[str, Any]:
        """Parameter values as given, in the order of their declaration."""
        return {name: getattr(self, name) for name in self.declared}


REGISTRY: dict[str, type[Component]] = {}
"""Every component class by name, in the order of definition; text files and the documentation read it."""

C = TypeVar("C", bound=Component)


@dataclass_transform(frozen_default=True, kw_only_default=True, field_specifiers=(parameter,))
def component(cls: type[C]) -> type[C]:
    """Make a class a component: a frozen record of its declared parameters, entered in the registry.

    Raises:
        ShaftworkError: the class is no `Component`, a field is not declared by `parameter`, or its ports or its role
            are not what they must be.
    """
    _refuse_wrong_class(cls)
    kind = dataclass(frozen=True)(cls)
    shared = _declared_by_bases(cls)  # they come last, as what a part has in common with others
    fields = sorted(
        (field for field in dataclasses.fields(kind) if field.name not in ("name", "symbol")),
        key=lambda field: field.name in shared,
    )
    if bare := [field.name for field in fields if "declare" not in field.metadata]:
        raise ShaftworkError(
            f"{cls.__name__}: {bare[0]} is not declared. Write {bare[0]}: float = parameter('unit', 'meaning'), or "
            "make it a ClassVar if all parts share it."
        )
    kind.declared = {field.name: field.metadata["declare"](field.name) for field in fields}
    _refuse_wrong_parameters(kind)
    _explain_wrong_arguments(kind)
    REGISTRY[kind.__name__] = kind
    return kind


def _declared_by_bases(cls: type[Component]) -> frozenset[str]:
    """The parameters that the base classes of a component declare which are dataclasses, but no components."""
    bases = (base for base in cls.__mro__[1:] if "__dataclass_fields__" in vars(base) and "declared" not in vars(base))
    return frozenset(name for base in bases for name in vars(base)["__annotations__"])


def _refuse_wrong_class(cls: type[Component]) -> None:
    name = cls.__name__
    if not issubclass(cls, Component):
        raise ShaftworkError(f"{name} is no Component. Write: class {name}(Component):")
    if cls.role not in get_args(Role):
        raise ShaftworkError(f"{name}: role = {cls.role!r} is none of: {', '.join(get_args(Role))}.")
    for field, ports in (("ports", cls.ports), ("inner", cls.inner)):
        if not isinstance(ports, tuple) or not all(isinstance(port, Port) for port in ports):
            raise ShaftworkError(f"{name}: {field} = {ports!r} must be a tuple such as (Port('a'), Port('b')).")
    names = [port.name for port in (*cls.ports, *cls.inner)]
    if not cls.ports or len(set(names)) < len(names):
        raise ShaftworkError(f"{name}: its ports are {names}. Give it one or more, each with a name of its own.")


def _refuse_wrong_parameters(kind: type[Component]) -> None:
    for name, declared in kind.declared.items():
        if name in dir(Component) or name in ("form", "mode") or name.startswith(("form_", "mode_")):
            raise ParameterError(
                f"{kind.__name__}: a parameter is named '{name}', which has a meaning here. Rename it."
            )
        _, objection = (None, None) if declared.required else declared.magnitude(declared.default)
        if objection is not None:
            raise ParameterError(f"{kind.__name__}: the default of {name} = {declared.default!r} {objection}.")


def _explain_wrong_arguments(kind: type[Component]) -> None:
    """Let the constructor answer a wrong or missing argument with the list of parameters."""
    plain: Callable[..., None] = kind.__init__
    signature = inspect.signature(plain)

    def __init__(self: Component, *args: Any, **kwargs: Any) -> None:  # noqa: N807
        try:
            signature.bind(self, *args, **kwargs)
        except TypeError as error:
            name = args[0] if args else kwargs.get("name", "?")
            rows = [
                f"{p.name} [{p.unit}] {p.meaning}{'' if p.required else f' (default {p.default})'}"
                for p in kind.declared.values()
            ]
            raise ParameterError(
                f"{kind.__name__} '{name}': {error}. It takes a name and: {'; '.join(rows) or 'no parameters'}."
            ) from None
        plain(self, *args, **kwargs)

    kind.__init__ = __init__  # type: ignore[method-assign]
    kind.__signature__ = signature  # type: ignore[attr-defined]


def default_signals(part: Component) -> dict[str, Signal]:
    """Signals by ports: one port gives (omega, tau), two of one domain (omega_rel, tau), more a pair for each port."""
    domains = {port.domain for port in part.ports}
    if None in domains:
        return {"reaction": Signal("through", (part.ports[0].name, None), None)}
    if len(part.ports) == 1:
        return _one_port(part)
    if len(part.ports) == 2 and len(domains) == 1 and part.role != "coupling":
        return _two_port(part)
    several: dict[str, Signal] = {}
    for port in part.ports:
        domain, ends = port.domain or ROTATION, (port.name, None)
        several[f"{domain.across.name}_{port.name}"] = Signal("across", ends, domain)
        several[f"{domain.through.name}_{port.name}"] = Signal("through", ends, domain)
    return several


def _one_port(part: Component) -> dict[str, Signal]:
    """A store shows what it takes in, a source or load what it gives to its node."""
    port = part.ports[0]
    domain, ends = port.domain or ROTATION, (port.name, None)
    sign = 1 if part.role == "store" else -1
    return {
        domain.across.name: Signal("across", ends, domain),
        domain.through.name: Signal("through", ends, domain, sign),
    }


def _two_port(part: Component) -> dict[str, Signal]:
    """A part between two nodes shows what a gives to b, a source what it gives to a."""
    first, second = part.ports
    domain, pair = first.domain or ROTATION, (first.name, second.name)
    suffix = "" if domain is ELECTRICAL else "_rel"
    signals = {
        domain.through.name: Signal("through", pair, domain, -1 if part.role == "source" else 1),
        domain.across.name + suffix: Signal("across", pair, domain),
    }
    if part.role == "store" and domain is not ELECTRICAL:
        signals[domain.integral.name + suffix] = Signal("twist", pair, domain)
        signals[domain.through.name + "_c"] = Signal("store", pair, domain)
    return signals


def number_of(part: Component, name: str) -> float | None:
    """A parameter in SI, None where it is left out or is no admissible number, which the checks of a network report."""
    value, objection = part.declared[name].magnitude(getattr(part, name))
    return value if objection is None and isinstance(value, float) else None
