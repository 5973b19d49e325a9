"""The words of a Modelica text with their lines, and a cursor that goes through them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from shaftwork.core.errors import ModelFileError

_TOKENS = re.compile(
    r"""(?P<space>\s+|//[^\n]*|/\*.*?\*/)
    |(?P<text>"(?:[^"\\]|\\.)*")
    |(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)
    |(?P<name>[A-Za-z_]\w*|'(?:[^'\\\n]|\\.)+')
    |(?P<sign>:=|<=|>=|==|<>|\.\+|\.-|\.\*|\./|\.\^|[-+*/^()\[\]{},;:=<>.])""",
    re.VERBOSE | re.DOTALL | re.ASCII,
)
DEEPEST = 40
"""Brackets in brackets that are read; no model has as many."""
LONGEST = 2_000_000
"""Characters of a file that are read."""


@dataclass(frozen=True)
class ModelicaToken:
    """A word, number, text or sign, and its line."""

    kind: str
    text: str
    line: int


def fault(line: int, what: str) -> ModelFileError:
    """The error of a line."""
    return ModelFileError(f"line {line}: {what}")


def tokens_of_text(text: str) -> Iterator[ModelicaToken]:
    """The words of a text.

    Raises:
        ModelFileError: a sign has no meaning, or there are too many.
    """
    if len(text) > LONGEST:
        raise ModelFileError(f"it has more than {LONGEST} characters. Give the file of one model.")
    place, line = 0, 1
    text = text.removeprefix("\ufeff")
    while place < len(text):
        match = _TOKENS.match(text, place)
        if match is None:
            raise fault(line, f"{text[place]!r} begins nothing that Modelica has.")
        kind = str(match.lastgroup)
        if kind != "space":
            yield ModelicaToken(kind, match.group(), line)
        line += match.group().count("\n")
        place = match.end()
    yield ModelicaToken("end", "the end of the file", line)


class TokenCursor:
    """Reads tokens from the first to the last.

    Args:
        tokens: of a text; the last one is its end.
    """

    def __init__(self, tokens: Sequence[ModelicaToken]) -> None:
        self._tokens, self._place, self._depth = tokens, 0, 0

    @property
    def _next(self) -> ModelicaToken:
        return self._tokens[self._place]

    def _take(self) -> ModelicaToken:
        token = self._next
        self._place += token.kind != "end"
        return token

    def _at(self, *words: str) -> bool:
        return self._next.text in words and self._next.kind in ("name", "sign")

    def _accept(self, *words: str) -> ModelicaToken | None:
        return self._take() if self._at(*words) else None

    def _expect(self, word: str) -> ModelicaToken:
        if not self._at(word):
            raise fault(self._next.line, f"'{word}' is expected, and there is {self._shown}.")
        return self._take()

    @property
    def _shown(self) -> str:
        return self._next.text if self._next.kind == "end" else f"'{self._next.text[:30]}'"

    def _name(self) -> ModelicaToken:
        if self._next.kind != "name":
            raise fault(self._next.line, f"a name is expected, and there is {self._shown}.")
        return self._take()

    def _dotted(self) -> str:
        self._accept(".")
        names = [self._name().text]
        while self._at(".") and self._tokens[self._place + 1].kind == "name":
            self._take()
            names.append(self._take().text)
        return ".".join(names)

    def _comment(self) -> None:
        """Skip a text, texts that are added to it, and an annotation."""
        while self._next.kind == "text":
            self._take()
            self._accept("+")
        if self._accept("annotation"):
            self._skip_brackets()

    def _skip_brackets(self) -> None:
        line, depth = self._next.line, 0
        while True:
            token = self._take()
            if token.kind == "end":
                raise fault(line, "a bracket is never closed.")
            depth += {"(": 1, ")": -1}.get(token.text, 0) if token.kind == "sign" else 0
            if not depth:
                return

    def _deeper(self, read: Callable[[], None]) -> None:
        self._depth += 1
        if self._depth > DEEPEST:
            raise fault(self._next.line, f"more than {DEEPEST} classes or brackets are in each other.")
        read()
        self._depth -= 1
