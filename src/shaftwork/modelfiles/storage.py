"""Networks to text files and back: what `textfile` reads and writes, in terms of components; laws as text."""

from __future__ import annotations

import reprlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NoReturn

import sympy
from sympy import Expr
from sympy.core.relational import Relational
from sympy.printing.precedence import PRECEDENCE
from sympy.printing.str import StrPrinter

from shaftwork.components import REGISTRY, Component, Table
from shaftwork.components.laws import SYMBOLS
from shaftwork.components.tables import Interpolation
from shaftwork.core.errors import ModelFileError, ParameterError
from shaftwork.core.files import replaced
from shaftwork.modelfiles import textfile
from shaftwork.modelfiles.own_parts import checked_trust, import_modules, modules_of
from shaftwork.modelfiles.textfile import ModelText, PartText
from shaftwork.network.expressions import parse
from shaftwork.network.grammar import COMPARISONS, FUNCTION_NAMES, FUNCTIONS, LIMITS, fault_of, tokens_of
from shaftwork.network.netlist import Netlist, Origin, Placed, title

AS_IN = "as in "
"""Before the name of an earlier part whose record a part has, too."""
_SIGNS = {relation: sign for sign, relation in COMPARISONS.items()}


def netlist_text(netlist: Netlist) -> str:
    """The text of a model file.

    A law without symbols, such as pi or 2 pi, is written as its number.

    Raises:
        ModelFileError: a parameter has no text form.
    """
    parts = tuple(_with_records_once(map(_part_text, netlist.placed)))
    modules = modules_of(item.part for item in netlist.placed)
    return textfile.write(ModelText(netlist.name, parts, netlist.ports, netlist.impacts, modules))


def write_netlist(netlist: Netlist, path: str | Path) -> None:
    """Write a netlist to a file, as `netlist_text`.

    Raises:
        ModelFileError: a parameter has no text form, or the file cannot be written.
    """
    place, text = _path_of(path), netlist_text(netlist)
    try:
        with replaced(place) as file:
            file.write(text)
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise ModelFileError(
            f"{place} cannot be written: {why}. Give the path of a file in a folder that exists."
        ) from None


def read_netlist(path: str | Path, trust: Any = ()) -> Netlist:
    """Read a netlist from a file.

    Args:
        path: of the file.
        trust: packages whose modules may be imported where the file names them.

    Raises:
        ModelFileError: the file is no model; says where and what would be right.
        ParameterError: `trust` has no names of packages.
    """
    trusted = checked_trust(trust)
    return netlist_of(textfile.read(_path_of(path)), path, trusted)


def netlist_of(model: ModelText, path: str | Path, trusted: Sequence[str] = ()) -> Netlist:
    """The netlist that a text is; arguments and errors as of `read_netlist`."""
    try:
        import_modules(model.modules, [part.type for part in model.parts if _class_of(part.type) is None], trusted)
        _refuse_endless_laws(model)
        placed = tuple(_placed(part, str(path)) for part in _with_all_records(model.parts))
        return Netlist(model.name, placed, model.ports, model.impacts)
    except ModelFileError as error:
        raise ModelFileError(f"{path}: {error}") from None


def law_of(key: str, text: str) -> float | Expr | Table:
    """The law that a text means: a number, an expression, or a table alone, whose argument the part chooses.

    Args:
        key: name of the parameter.
        text: an expression, or a table `{ x = [...], y = [...] }`.

    Raises:
        ModelFileError: it is none.
    """
    if text.lstrip().startswith("{"):
        return textfile.read_table(key, text)
    law = parse(text)
    if isinstance(law, Interpolation) and text.rstrip().endswith("])"):  # without an argument of its own
        return law.table
    return law if law.free_symbols else float(law)


def _path_of(path: str | Path) -> Path:
    try:
        return Path(path)
    except TypeError:
        raise ModelFileError(f"{path!r} is no path. Give the place of a model file, such as 'crane.toml'.") from None


def _refuse_endless_laws(model: ModelText) -> None:
    words = 0
    for part in model.parts:
        for name, value in part.parameters.items():
            if not isinstance(value, str) or not _is_law(_class_of(part.type), name):
                continue
            try:
                words += len(tokens_of(value))
            except ModelFileError as error:
                raise _fault(part, name, f"{name}: {error}") from None
            if words > LIMITS.file_words:
                raise ModelFileError(
                    f"The laws of the file have more than {LIMITS.file_words} words together. Give curves as tables, "
                    "or build the network in Python."
                )


def _is_law(cls: type[Component] | None, name: str) -> bool:
    """Whether a text of this parameter is read as a law."""
    return cls is not None and name in cls.declared and cls.declared[name].law


def _part_text(placed: Placed) -> PartText:
    part = placed.part
    values = {name: _saved(part, name) for name in part.declared if not _is_default(part, name)}
    return PartText(type(part).__name__, part.name, placed.nodes, values, part.symbol)


def _with_records_once(parts: Iterable[PartText]) -> Iterator[PartText]:
    """Parts with each long record once: a later part that has the same says of whom it is, "as in cylinder 1"."""
    long = 80  # characters; a shorter one is easier to read where it is
    owners: dict[tuple[str, Any], str] = {}
    for part in parts:
        values = dict(part.parameters)
        for name, text in part.parameters.items():
            if _is_record(part, name) and isinstance(text, str) and len(text) > long:
                owner = owners.setdefault((name, text), part.name)
                values[name] = text if owner == part.name else f"{AS_IN}{owner}"
        yield replace(part, parameters=values)


def _with_all_records(parts: Iterable[PartText]) -> Iterator[PartText]:
    """The same read: parts with their records in full.

    Raises:
        ModelFileError: a record is that of a part which does not stand before, or has none of that name.
    """
    before: dict[str, Mapping[str, Any]] = {}
    for part in parts:
        values = dict(part.parameters)
        for name, text in part.parameters.items():
            if _is_record(part, name) and isinstance(text, str) and text.startswith(AS_IN):
                owner = text.removeprefix(AS_IN)
                if name not in before.get(owner, {}):
                    raise _fault(
                        part,
                        name,
                        f"{name} = {text!r}: no part above is '{owner}' and has {name}. Name one, or write it out.",
                    )
                values[name] = before[owner][name]
        before[part.name] = values
        yield replace(part, parameters=values)


def _is_record(part: PartText, name: str) -> bool:
    declared = getattr(_class_of(part.type), "declared", {}).get(name)
    return declared is not None and declared.record is not None


def _is_default(part: Component, name: str) -> bool:
    declared = part.declared[name]
    if declared.default is None:
        return getattr(part, name) is None
    kinds = (float,) if declared.record is None else (declared.record,)
    return not declared.required and isinstance(value := getattr(part, name), kinds) and value == declared.default


def _saved(part: Component, name: str) -> Any:
    declared = part.declared[name]
    value, objection = declared.magnitude(getattr(part, name))
    if objection is not None:
        raise ModelFileError(f"{title(part)}: {name} {objection}, so it cannot be saved.")
    if declared.record is not None:
        if (objection := declared.magnitude(repr(value))[1]) is not None:  # a record that no text stands for
            raise ModelFileError(f"{title(part)} cannot be saved: {name} {objection}.")
        return repr(value)
    if not isinstance(value, Expr) or isinstance(value, Table):
        return value
    if fault := fault_of(value):  # before the text is made, which would be refused where it is read again
        raise ModelFileError(f"{title(part)}: {name} {fault}, so it cannot be saved. Write large numbers as floats.")
    try:
        return write(value)
    except ModelFileError as error:
        raise ModelFileError(f"{title(part)}: {name} cannot be saved: {error}") from None


def _class_of(name: str) -> type[Component] | None:
    """The class of a part by its name; of "ElectricalBrake", as `Network.circuit` makes it, the image of a class."""
    original = REGISTRY.get(name.removeprefix("Electrical"))
    if name in REGISTRY or original is None:
        return REGISTRY.get(name)
    from shaftwork.analogues.images import image_class

    return image_class(original)


def _placed(part: PartText, path: str) -> Placed:
    cls = _class_of(part.type)
    if cls is None:
        close = get_close_matches(part.type, REGISTRY, n=3) or tuple(REGISTRY)
        raise _fault(
            part,
            "type",
            f"there is no component '{part.type}'. Close to it: {', '.join(close)}. "
            "A component of your own must be imported before the file is loaded.",
        )
    values = {name: _read(part, cls, name, value) for name, value in part.parameters.items()}
    try:
        component = cls(part.name, symbol=part.symbol, **values)
    except ParameterError as error:
        reason = str(error).removeprefix(f"{part.type} '{part.name}': ")
        named = [name for name in values if name not in cls.declared] or [reason.split(maxsplit=1)[0]]
        raise _fault(part, named[0], reason) from None
    return Placed(component, part.nodes, origin=Origin(path, part.lines))


def _read(part: PartText, cls: type[Component], name: str, value: Any) -> Any:
    """A value of the file as the component takes it."""
    declared = cls.declared.get(name)
    if declared is None or declared.record is not None or not isinstance(value, str):
        return value
    if not declared.law:
        unit = "pure number" if declared.unit == "1" else f"number in {declared.unit}"
        reason = f"{name} = {reprlib.repr(value)} must be a {unit} ({declared.meaning}), written without quotes"
        raise _fault(part, name, f"{reason} and without a unit, such as {name} = 1.0.")
    try:
        return law_of(name, value)
    except ModelFileError as error:
        raise _fault(part, name, f"{name}: {error}") from None


def _fault(part: PartText, key: str, reason: str) -> ModelFileError:
    """What is wrong with a part, with its line in the file and, of a law, the unit of its values."""
    declared = getattr(_class_of(part.type), "declared", {}).get(key)
    unit = f" It is a law for {key} in {declared.unit}." if declared is not None and declared.law else ""
    return ModelFileError(f"line {part.lines.get(key, part.lines[''])}, {part.type} '{part.name}': {reason}{unit}")


def write(expression: sympy.Expr) -> str:
    """The text of an expression: `parse` of it is the same expression, floats to the last bit.

    Args:
        expression: a law of the package's symbols.

    Raises:
        ModelFileError: a part is not in the grammar, or sympy builds the expression differently when it is read again.
    """
    try:
        text: str = _LawPrinter().doprint(expression)
    except RecursionError:
        raise ModelFileError("the expression is nested too deeply for text. Split it or use a Table.") from None
    if (again := parse(text)) != expression:
        raise ModelFileError(
            f"the expression {text[:200]} reads back as {str(again)[:200]}, because sympy rewrites it whenever it is "
            "built. Save the rewritten form: expression.func(*expression.args), or sympy.expand(expression)."
        )
    return text


class _LawPrinter(StrPrinter):  # type: ignore[misc]
    """Expressions as sympy prints them, where the grammar of `parse` has another form or less."""

    def _print_Symbol(self, node: sympy.Symbol) -> str:
        return str(node.name) if node in SYMBOLS else self._refused(node)

    def _print_Function(self, node: sympy.Function) -> str:
        function = FUNCTIONS.get(node.func.__name__)
        is_listed = isinstance(node, sympy.Piecewise) or (function is not None and function.make is node.func)
        return str(super()._print_Function(node)) if is_listed else self._refused(node)

    def _print_Float(self, node: sympy.Float) -> str:
        value = float(node)
        if sympy.Float(value) != node:
            raise ModelFileError(
                f"the number {node} has more digits than a float. Round it with sympy.Float(number, 15)."
            )
        return repr(value)

    def _print_Exp1(self, _node: sympy.Expr) -> str:
        return "exp(1)"

    def _print_Relational(self, node: Relational) -> str:
        sides = [self.parenthesize(side, PRECEDENCE["Add"]) for side in (node.lhs, node.rhs)]
        return f" {_SIGNS[node.func]} ".join(sides)

    def _print_And(self, node: sympy.And) -> str:
        return " and ".join(self.parenthesize(part, PRECEDENCE["And"]) for part in sympy.ordered(node.args))

    def _print_Or(self, node: sympy.Or) -> str:
        return " or ".join(self.parenthesize(part, PRECEDENCE["Or"]) for part in sympy.ordered(node.args))

    def _print_Not(self, node: sympy.Not) -> str:
        return f"not {self.parenthesize(node.args[0], PRECEDENCE['Relational'])}"

    def _refused(self, node: sympy.Basic) -> NoReturn:
        names = ", ".join(symbol.name for symbol in SYMBOLS)
        raise ModelFileError(
            f"{str(node)[:80]} ({node.func.__name__}) is not in the grammar of model files. "
            f"Symbols: {names} of this package, pi. Functions: {FUNCTION_NAMES}. Tabulate it, or keep this law in a "
            "script."
        )
