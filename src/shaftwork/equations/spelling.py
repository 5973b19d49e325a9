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
    "&": r"\text{\&}",
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
"""Signs in a formula."""
ESCAPES_IN_TEXT = {
    "\\": r"\textbackslash{}",
    "^": r"\textasciicircum{}",
    "~": r"\textasciitilde{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "`": r"\`{}",
    "°": r"\textdegree{}",
    **{sign: f"\\{sign}" for sign in "{}_%&#$"},
}
"""Signs outside formulas."""
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
"""Words that a notebook shows outside formulas as they are."""
MARKS = ".,:;!?"
SET_UP = "–—‘’‚“”„‹›«»…€£§¶©®™×÷±µ·†‡¹²³¼½¾¿¡"
"""Signs besides accented letters that LaTeX prints with T1 fonts."""
LETTER = r"[^\W\d_]"
IN_TEXT = re.compile(
    rf"(?P<ligature>(?P<sign>[-,])(?=(?P=sign)))|(?P<quote>(?<!{LETTER})'|'(?!{LETTER}))|(?P<other>.)", re.DOTALL
)
"""A sign that LaTeX would draw together with the next one, a straight quote, which is no apostrophe, or any other."""
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
    if word in GREEK:
        return f"\\{word} "
    return _plain(character) or (rf"\text{{{character}}}" if character.isprintable() else f"U{ord(character):04X}")


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
    """Any text outside formulas: whatever it holds, a document shows the same.

    Letters that LaTeX has only in formulas are formulas. Those that it has not at all stay as they are; a document
    says before its text what pdflatex prints in their place (`stand_ins`).
    """
    printed = "".join(map(_in_text, IN_TEXT.finditer(unicodedata.normalize("NFC", text))))
    return f"{{}}{printed}" if printed[:1] in ("[", "*") else printed  # at the end of a row they are options of it


def _in_text(match: re.Match[str]) -> str:
    if match["quote"]:
        return r"\textquotesingle{}"
    character = match[0]
    if match["ligature"]:
        return f"{character}{{}}"
    if character in ESCAPES_IN_TEXT:
        return ESCAPES_IN_TEXT[character]
    if character.isascii() and character.isprintable():
        return character
    word = _greek(character)
    if word in GREEK:
        return rf"$\{word}$"
    if character.isspace():
        return " "
    return character if character.isprintable() else f"U+{ord(character):04X}"


def stand_ins(latex: str) -> str:
    """Lines for the preamble of a document with letters that pdflatex has not; empty where it has all.

    It prints letters without their accents, and else their numbers.
    """
    signs = dict.fromkeys(latex)
    lacking = [sign for sign in signs if not (sign.isascii() or sign in SET_UP or re.match(f"[{ACCENTED}]", sign))]
    if not lacking:
        return ""
    declared = [rf"\DeclareUnicodeCharacter{{{ord(sign):04X}}}{{{_stand_in(sign)}}}" for sign in lacking]
    lines = (
        "% pdflatex lacks some letters of this document, and prints others in their place. lualatex prints them,",
        r"% with \setmainfont{a font that has them}.",
        r"\ifdefined\pdftexversion",
        *declared,
        r"\else",
        r"\usepackage{fontspec}",
        r"\fi",
    )
    return "".join(f"{line}\n" for line in lines)


def _stand_in(sign: str) -> str:
    if sign in SUPERSCRIPTS:
        return rf"\textsuperscript{{{_plain(sign)}}}"
    word = _greek(sign)
    return rf"\ensuremath{{\{word}}}" if word in GREEK else _plain(sign) or f"[U+{ord(sign):04X}]"


def in_notebook(text: str) -> str:
    """Any text outside formulas for MathJax, which reads no escapes there: words that need some are formulas."""
    return " ".join(map(_word_in_notebook, text.split(" ")))


def _word_in_notebook(word: str) -> str:
    """A word with the marks that end it behind the formula, if it is one."""
    name = word.rstrip(MARKS)
    return word if PLAIN.fullmatch(word) else f"$\\mathrm{{{escaped(name)}}}${word[len(name) :]}"
