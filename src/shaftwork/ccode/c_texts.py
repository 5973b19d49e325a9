"""Texts of C code that are the same for all models, and those made of lists."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files

from shaftwork.ccode.c_printing import text_of

ARGUMENTS = {
    "rates": ("x", "dx"),
    "jacobian": ("x", "slopes"),
    "outputs": ("x", "y"),
    "stores": ("x", "stored"),
    "take_up": ("stored", "x"),
    "samples": ("x", "after"),
    "guards": ("x", "g"),
    "across": ("x", "speeds"),
    "begins": ("x", "holds"),
    "masses": ("x", "mass"),
    "loads": ("stored", "right"),
    "shares": ("x", "gains"),
}
"""Functions that differ by the set of equations: the array that each reads, and that which it fills."""


def signature(name: str) -> str:
    """How a function of `ARGUMENTS` is declared."""
    read, filled_in = ARGUMENTS[name]
    return f"void {name}(const NAME *m, double t, const double *restrict {read}, double *restrict {filled_in})"


def names_of(kind: str, what: str, texts: Sequence[str]) -> str:
    """A public list of names or units."""
    lines = "\n".join(f"    {text_of(text)}," for text in (*texts, ""))
    return f"const char *const NAME_{kind}_{what}[NAME_{kind.upper()}S + 1] = {{\n{lines}\n}};"


def runtime(file: str) -> str:
    """C code that is the same for all models."""
    return files(__package__ or "").joinpath("runtime", file).read_text(encoding="utf-8")


def filled(text: str, name: str, places: Mapping[str, object]) -> str:
    """C code with the name of the model and the sizes of its arrays."""
    text = re.sub(r"@(\w+)@", lambda match: str(places[match[1]]), text)
    return re.sub(r"\bNAME(?=\b|_)", name, re.sub(r"\bNAME_H\b", f"{name.upper()}_H", text))


@cache
def runtime_names() -> frozenset[str]:
    """All names and words in the C code that is the same for all models; only asked for membership."""
    folder = files(__package__ or "").joinpath("runtime")
    texts = (re.sub(r"/\*.*?\*/", "", file.read_text(encoding="utf-8"), flags=re.DOTALL) for file in folder.iterdir())
    return frozenset(word for text in texts for word in re.findall(r"[A-Za-z_]\w*", text))
