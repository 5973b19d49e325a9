"""Names and texts as LaTeX: whatever a name contains, what is printed compiles and does nothing but print."""

from __future__ import annotations

import re
import unicodedata

INDEX_OPENS, INDEX_CLOSES = "\ue000", "\ue001"
"""Marks around the number at the end of a subscript, to recognise rows that differ by it alone; never printed."""
ESCAPES = {
    "\\": r"\backslash ",
    "{": r"\text{\{}",
    "}": r"\text{\}}",
    "_": r"\_",
    "%": r"\%",
    "&": r"\&",
    "#": r"\#",
    "$": r"\$",
    "^": r"\wedge ",
    "~": r"\sim ",
    " ": r"\ ",
    "-": r"\text{-}",
    "'": r"\text{'}",
    '"': r"\text{''}",
    "`": r"\text{`}",
    "°": r"{^{\circ}}",
}
ACCENTED = "À-ÖØ-öø-ĥĨ-ķĹ-ľŁ-ňŊ-ťŨ-žȘ-ț"
"""Letters of Latin-1 and Latin Extended that the T1 encoding has, as ranges of a regular expression."""
SUPERSCRIPTS = "⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻ⁿ"
GREEK = (
    *("alpha", "beta", "gamma", "delta", "epsilon", "zeta", "eta", "theta", "iota", "kappa", "lambda", "mu", "nu"),
    *("xi", "pi", "rho", "sigma", "tau", "upsilon", "phi", "chi", "psi", "omega", "varepsilon", "vartheta", "varphi"),
    *("Gamma", "Delta", "Theta", "Lambda", "Xi", "Pi", "Sigma", "Upsilon", "Phi", "Psi", "Omega"),
)
"""Greek letters that are control words of LaTeX."""
PLAIN = re.compile(f"[A-Za-z0-9.,:;()'=/!?+*{ACCENTED}-]*")
"""Words that are printed outside formulas as they are."""
MARKS = ".,:;!?"
STRETCH = re.compile(f"(?P<accented>[{ACCENTED}]+)|(?P<raised>[{SUPERSCRIPTS}]+)|(?P<other>.)", re.DOTALL)
"""What is escaped in one go."""
ALLOWED = re.compile(
    r"(?P<word>[A-Za-z]{2,})"
    rf"|(?P<plain>\\(?:{'|'.join(GREEK)})(?![A-Za-z]) ?|\\mathrm\{{[A-Za-z0-9]+\}}|[A-Za-z0-9,'])"
    r"|(?P<other>.)",
    re.DOTALL,
)
"""What a chosen subscript may contain, and one character that it may not."""


def indexed(digits: str) -> str:
    """The number at the end of a subscript, between marks."""
    return f"{INDEX_OPENS}{digits}{INDEX_CLOSES}" if digits else ""


def without_marks(latex: str) -> str:
    """LaTeX as it is printed."""
    return latex.replace(INDEX_OPENS, "").replace(INDEX_CLOSES, "")


def split_index(name: str) -> tuple[str, str]:
    """A name as its stem and the digits at its end."""
    stem = name.rstrip("0123456789")
    return stem, name[len(stem) :]


def escaped(name: str) -> str:
    """Any text as LaTeX for an upright font in a formula: signs are escaped, letters that LaTeX lacks are named."""
    return "".join(map(_escape_stretch, STRETCH.finditer(unicodedata.normalize("NFC", name))))


def _escape_stretch(match: re.Match[str]) -> str:
    if match["accented"]:
        return rf"\text{{{match['accented']}}}"
    if match["raised"]:  # in braces of its own: two superscripts in a row are an error
        return f"{{^{{{_plain(match['raised'])}}}}}"
    return _escape(match["other"])


def _escape(character: str) -> str:
    if character in ESCAPES:
        return ESCAPES[character]
    if character.isascii() and character.isprintable():
        return character
    word = _greek(character)
    return f"\\{word} " if word in GREEK else _plain(character) or f"U{ord(character):04X}"


def _greek(character: str) -> str:
    """The name of a Greek letter as LaTeX spells it, for example of ω and Ω; empty for any other character."""
    match unicodedata.name(unicodedata.normalize("NFKC", character)[0], "").split():
        case ["GREEK", "SMALL" | "CAPITAL" as size, "LETTER", letter]:
            word = letter.replace("LAMDA", "LAMBDA").capitalize()
            return word.lower() if size == "SMALL" else word
    return ""


def _plain(text: str) -> str:
    """A text without accents and positions: "ạ" is a, "₂" is 2; empty where nothing is left."""
    apart = unicodedata.normalize("NFKD", text).replace("\N{MINUS SIGN}", "-")
    return "".join(c for c in apart if c.isascii() and (c.isalnum() or c in "+-"))


def chosen_subscript(text: str) -> str:
    """A subscript that a user has chosen: letters, digits, commas, primes and Greek letters; all else is escaped."""
    return "".join(
        rf"\mathrm{{{match['word']}}}" if match["word"] else _spaced(match["plain"] or "") or escaped(match["other"])
        for match in ALLOWED.finditer(unicodedata.normalize("NFC", text))
    )


def _spaced(text: str) -> str:
    """A control word with the one space that parts it from a letter after it."""
    return f"{text.rstrip()} " if text[:1] == "\\" and text[-1] != "}" else text


def in_text(text: str) -> str:
    """Any text outside formulas: words with signs that LaTeX reads otherwise are escaped."""
    return " ".join(map(_word_in_text, text.split(" ")))


def _word_in_text(word: str) -> str:
    """A word with the marks that end it behind the formula, if it is one."""
    name = word.rstrip(MARKS)
    return word if PLAIN.fullmatch(word) else f"$\\mathrm{{{escaped(name)}}}${word[len(name) :]}"
