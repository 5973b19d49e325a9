"""The text of Modelica models: what they declare and connect, with the lines; nothing of what it means."""

from __future__ import annotations

from dataclasses import dataclass, field

from shaftwork.modelica.reading.modelica_tokens import TokenCursor, fault, tokens_of_text

CLASSES = ("model", "block", "package", "class", "connector", "record", "function", "type", "operator")
_BEFORE_CLASSES = ("encapsulated", "partial", "final", "redeclare", "replaceable", "inner", "outer", "pure", "impure")
_BLOCKS = ("if", "for", "when", "while")
_READ = "Read are declarations and connect(...): write what it does as parts, or as blocks of Modelica.Blocks.Sources."
_PREFIXES = ("parameter", "constant", "final", "inner", "outer", "input", "output", "flow", "discrete", "replaceable")


@dataclass(frozen=True)
class SyntaxTerm:
    """An expression: an operator, a function, a name or a literal.

    Args:
        kind: "number", "name", "text", "bool", "call", "array", "if", or an operator such as "+" or "<=".
        value: of a literal, or the name.
        parts: of an operator or a call.
        line: where it begins.
    """

    kind: str
    value: str = ""
    parts: tuple[SyntaxTerm, ...] = ()
    line: int = 0


@dataclass(frozen=True)
class Modification:
    """name(inner...) = value in a declaration."""

    name: str
    value: SyntaxTerm | None
    inner: tuple[Modification, ...]
    line: int


@dataclass(frozen=True)
class Declaration:
    """A component or parameter.

    Args:
        prefixes: "parameter", "constant", ...
        type: name of its class.
        name: of the component.
        modifiers: in brackets behind the name.
        value: behind the equals sign.
        condition: behind `if`.
        line: where it stands.
        is_array: whether it has dimensions.
    """

    prefixes: tuple[str, ...]
    type: str
    name: str
    modifiers: tuple[Modification, ...]
    value: SyntaxTerm | None
    condition: SyntaxTerm | None
    line: int
    is_array: bool = False


@dataclass
class ClassText:
    """A class: what it declares, connects and holds."""

    kind: str
    name: str
    line: int
    declarations: list[Declaration] = field(default_factory=list)
    connects: list[tuple[str, str, int]] = field(default_factory=list)
    imports: dict[str, str] = field(default_factory=dict)
    classes: list[ClassText] = field(default_factory=list)
    faults: list[tuple[int, str]] = field(default_factory=list)
    t_end: SyntaxTerm | None = None
    t_start: SyntaxTerm | None = None
    t_start_line: int = 0


def parse(text: str) -> tuple[str, tuple[ClassText, ...]]:
    """The name behind `within`, and the classes of a file.

    Raises:
        ModelFileError: the text is no Modelica; says where.
    """
    return _Parser(tuple(tokens_of_text(text))).file()


class _Parser(TokenCursor):
    """Goes through the tokens by the grammar."""

    # classes

    def file(self) -> tuple[str, tuple[ClassText, ...]]:
        """All of a file."""
        within = ""
        if self._accept("within"):
            within = "" if self._at(";") else self._dotted()
            self._expect(";")
        classes: list[ClassText] = []
        while self._next.kind != "end":
            classes.append(self._class())
            self._accept(";")
        return within, tuple(classes)

    def _begins_class(self) -> bool:
        place = self._place
        while self._tokens[place].text in _BEFORE_CLASSES:
            place += 1
        return self._tokens[place].text in CLASSES and self._tokens[place + 1].kind == "name"

    def _class(self) -> ClassText:
        while self._accept(*_BEFORE_CLASSES):
            pass
        if not self._at(*CLASSES):
            raise fault(self._next.line, f"a model is expected, and there is {self._shown}.")
        kind = self._take().text
        name = self._name()
        result = ClassText(kind, name.text, name.line)
        if self._accept("="):  # a class that is another one, or an enumeration
            result.faults.append((name.line, f"'{name.text}' stands for another class, which is not read."))
            self._skip_to(";")
            return result
        self._comment()
        if kind == "function":  # what calls it is refused
            while not (self._accept("end") and self._at(name.text)):
                if self._take().kind == "end":
                    raise fault(name.line, f"'{name.text}' has no end.")
            self._take()
        else:
            self._deeper(lambda: self._body(result))
        return result

    def _body(self, result: ClassText) -> None:
        section = ""
        while not self._accept("end"):
            line = self._next.line
            if self._next.kind == "end":
                raise fault(result.line, f"'{result.name}' has no end.")
            if self._accept("public", "protected"):
                section = ""
            elif self._at("initial", "equation", "algorithm"):
                begins = "initial " * (self._accept("initial") is not None)
                section = begins + self._take().text
                if section != "equation":
                    result.faults.append((line, f"an {section} section is not read. {_READ}"))
            elif self._accept("annotation"):
                self._annotation(result)
                self._accept(";")
            elif section == "equation":
                self._equation(result)
            elif section:
                self._skip_statement()
            else:
                self._element(result)
        end = self._name()
        if end.text != result.name:
            raise fault(end.line, f"'end {result.name}' is expected, and there is 'end {end.text}'.")

    def _annotation(self, result: ClassText) -> None:
        first = self._place
        self._skip_brackets()
        for place in range(first, self._place - 1):
            name, sign = self._tokens[place : place + 2]
            if name.text in ("StartTime", "StopTime") and sign.text == "=":
                behind, self._place = self._place, place + 2
                if name.text == "StopTime":
                    result.t_end = self.expression()
                else:
                    result.t_start, result.t_start_line = self.expression(), name.line
                self._place = behind

    def _equation(self, result: ClassText) -> None:
        line = self._next.line
        if self._accept("connect"):
            self._expect("(")
            first = self._connector(result)
            self._expect(",")
            result.connects.append((first, self._connector(result), line))
            self._expect(")")
            self._comment()
            self._expect(";")
            return
        what = {"if": "an if equation", "for": "a for loop", "when": "a when equation", "while": "a while loop"}
        result.faults.append((line, f"{what.get(self._next.text, 'an equation')} is not read. {_READ}"))
        self._skip_statement()

    def _connector(self, result: ClassText) -> str:
        name = self._dotted()
        if self._at("["):
            result.faults.append((self._next.line, f"'{name}' is an array, which is not read."))
            self._skip_to("]")
            while self._accept("."):
                name += "." + self._name().text
        return name

    def _skip_to(self, sign: str) -> None:
        line = self._next.line
        while self._take().text != sign:
            if self._next.kind == "end":
                raise fault(line, f"'{sign}' is expected behind this.")

    def _skip_statement(self) -> None:
        """An equation or statement, with all inside it where it is an if, for, when or while."""
        depth, brackets, begins, has_equals = 0, 0, True, False
        while True:
            token = self._take()
            if token.kind == "end":
                raise fault(token.line, "an equation has no end.")
            if begins and token.text in _BLOCKS:
                depth += 1
            elif begins and token.text == "end" and self._accept(*_BLOCKS):
                depth -= 1
            if token.text == ";" and depth <= 0:
                return
            brackets += {"(": 1, ")": -1}.get(token.text, 0)
            has_equals = token.text != ";" and (has_equals or token.text in ("=", ":="))
            opens = token.text in ("then", "else", "loop") and not brackets and not has_equals  # of no if expression
            begins = token.text == ";" or opens

    def _element(self, result: ClassText) -> None:
        line = self._next.line
        if self._accept("import"):
            self._import(result)
        elif self._accept("extends"):
            base = self._dotted()
            if "Icons" not in base.split("."):
                result.faults.append((line, f"it extends '{base}', which is not read."))
            self._skip_to(";")
        elif self._at(*_BLOCKS):
            raise fault(line, f"'{self._next.text}' stands where declarations do. {_READ}")
        elif self._begins_class():
            result.classes.append(self._class())
            self._accept(";")
        else:
            self._declarations(result)

    def _import(self, result: ClassText) -> None:
        name = self._dotted()
        alias = name.rpartition(".")[2]
        if self._accept("="):
            alias, name = name, self._dotted()
        if self._accept(".*") or (self._at(".") and self._take()):
            self._accept("*")
            alias = "*"
        result.imports[alias] = name
        self._skip_to(";")

    def _declarations(self, result: ClassText) -> None:
        prefixes: list[str] = []
        while token := self._accept(*_PREFIXES):
            prefixes.append(token.text)
        type_name = self._dotted()
        is_array = self._dimensions()
        while True:
            name = self._name()
            array = self._dimensions() or is_array
            modifiers = self._modifiers() if self._at("(") else ()
            value = self.expression() if self._accept("=", ":=") else None
            condition = self.expression() if self._accept("if") else None
            self._comment()
            result.declarations.append(
                Declaration(tuple(prefixes), type_name, name.text, modifiers, value, condition, name.line, array)
            )
            if not self._accept(","):
                break
        if self._accept("constrainedby"):
            self._skip_to(";")
            return
        self._expect(";")

    def _dimensions(self) -> bool:
        if not self._at("["):
            return False
        self._skip_to("]")
        return True

    def _modifiers(self) -> tuple[Modification, ...]:
        self._expect("(")
        modifiers: list[Modification] = []

        def read() -> None:
            while not self._at(")"):
                self._accept("redeclare")
                while self._accept("each", "final", "replaceable"):
                    pass
                line, name = self._next.line, self._dotted()
                inner = self._modifiers() if self._at("(") else ()
                value = self.expression() if self._accept("=") else None
                self._comment()
                modifiers.append(Modification(name, value, inner, line))
                if not self._accept(","):
                    break

        self._deeper(read)
        self._expect(")")
        return tuple(modifiers)

    # expressions, by rising precedence

    def expression(self) -> SyntaxTerm:
        """An expression."""
        terms: list[SyntaxTerm] = []
        self._deeper(lambda: terms.append(self._choice()))
        return terms[0]

    def _choice(self) -> SyntaxTerm:
        line = self._next.line
        if not self._accept("if", "elseif"):
            return self._binary(0)
        condition = self.expression()
        self._expect("then")
        then = self.expression()
        other = self.expression() if self._at("elseif") else None
        if other is None:
            self._expect("else")
            other = self.expression()
        return SyntaxTerm("if", "", (condition, then, other), line)

    def _binary(self, level: int) -> SyntaxTerm:
        if level == len(_LEVELS):
            return self._power()
        line = self._next.line
        if _LEVELS[level] == ("not",):
            return (
                SyntaxTerm("not", "", (self._binary(level + 1),), line)
                if self._accept("not")
                else self._binary(level + 1)
            )
        if "+" in _LEVELS[level] and (sign := self._accept("-", "+")):
            first = self._binary(level + 1)
            left = SyntaxTerm("negative", "", (first,), line) if sign.text == "-" else first
        else:
            left = self._binary(level + 1)
        while sign := self._accept(*_LEVELS[level]):
            left = SyntaxTerm(sign.text.removeprefix("."), "", (left, self._binary(level + 1)), line)
        return left

    def _power(self) -> SyntaxTerm:
        line, base = self._next.line, self._primary()
        if self._accept("^", ".^"):
            return SyntaxTerm("^", "", (base, self._primary()), line)
        return base

    def _primary(self) -> SyntaxTerm:
        token = self._next
        if self._accept("("):
            inner = self.expression()
            self._expect(")")
            return inner
        if opened := self._accept("{", "["):
            closing = "}" if opened.text == "{" else "]"
            return self._array(closing, token.line)
        if token.kind in ("number", "text"):
            return SyntaxTerm(token.kind, self._take().text, (), token.line)
        if self._accept("true", "false"):
            return SyntaxTerm("bool", token.text, (), token.line)
        name = self._dotted()
        if self._accept("("):
            return SyntaxTerm("call", name, self._array(")", token.line).parts, token.line)
        return SyntaxTerm("name", name, (), token.line)

    def _array(self, closing: str, line: int) -> SyntaxTerm:
        """Values up to a bracket; rows between semicolons are arrays in an array."""
        rows: list[list[SyntaxTerm]] = [[]]
        while not self._accept(closing):
            named = self._next.kind == "name" and self._tokens[self._place + 1].text == "="
            if named:
                self._place += 2
            value = self.expression()
            if self._at("for"):
                raise fault(self._next.line, "an array that 'for' makes is not read. Write its values one by one.")
            if self._accept(":"):
                value, named = self.expression(), True
            rows[-1].append(SyntaxTerm("named or range", "", (value,), value.line) if named else value)
            if self._accept(";"):
                rows.append([])
            elif not self._accept(","):
                self._expect(closing)
                break
        if closing != "]":
            return SyntaxTerm("array", "", tuple(rows[0]), line)
        return SyntaxTerm("array", "", tuple(SyntaxTerm("array", "", tuple(row), line) for row in rows), line)


_LEVELS: tuple[tuple[str, ...], ...] = (
    ("or",),
    ("and",),
    ("not",),
    ("<", "<=", ">", ">=", "==", "<>"),
    ("+", "-", ".+", ".-"),
    ("*", "/", ".*", "./"),
)
