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
def names_in(package: str, folder: str) -> frozenset[str]:
    """All names and words in the C code of a package that is the same for all models; only asked for membership."""
    texts = (file.read_text(encoding="utf-8") for file in files(package).joinpath(folder).iterdir())
    codes = (re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL) for text in texts)
    return frozenset(word for code in codes for word in re.findall(r"[A-Za-z_]\w*", code))
