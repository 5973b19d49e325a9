"""Model files, laws and command lines that no author would write: those of the library, changed at random.

Everything is drawn from a `random.Random`, so a case is its seed.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from random import Random

import shaftwork as sw
from shaftwork.components import REGISTRY
from shaftwork.modelfiles.storage import netlist_text
from shaftwork.network.grammar import FUNCTIONS
from tests.beds import bed_of, registered

ODD_NUMBERS = (
    *("nan", "inf", "-inf", "+inf", "1e400", "-1e400", "1e308", "-1e308", "5e-324", "1e-320", "1e-60", "1e60", "1e61"),
    *("0", "0.0", "-0.0", "-1", "1", "2", "3", "1e30", "-1e30", "1e-30", "1e12", "1e-12", "-1e-3", "0.5", "1e5", "100"),
    *("9223372036854775807", "9223372036854775808", "-9223372036854775808", "1" + "0" * 45, "9" * 4400, "0x7f", "0b1"),
    *("1_000", "1e", ".5", "5.", "--1", "1.0.0", "true", "false", "1979-05-27", "07:32:00", "{}", "[]", "''", '""'),
    *("[1.0]", "[[1.0]]", "[[[[1.0]]]]", '["a"]', "{ x = [0.0, 1.0], y = [0.0, 5.0] }", "{ x = [], y = [] }"),
    *("{ x = [1.0, 0.0], y = [0.0, 5.0] }", "{ x = [0.0, nan], y = [0.0, 5.0] }", "{ x = [0.0], y = [5.0] }"),
    *("{ x = [0.0, 5e-324], y = [-1e308, 1e308] }", "{ y = [1.0], x = [1.0] }", "{ x = { y = 1 } }", "'3 kg*m^2'"),
)
ODD_NAMES = (
    *("", " ", ".", "..", "a.b", "J1.omega", "ground", "None", "lambda", "__class__", "t", "pi", "omega", "%s", "{0}"),
    *("$x$", "\\\\", "\\n", "\\u0000", "\\u202e", "\\ud800", "\\U0001F600", "ω", "é", "e\u0301", "😀", "a" * 200),
    *("a" * 201, "a" * 10_000, "1", "-1", "a b", "a,b", "a=b", "#", "[[part]]", "'", "\\u00a0", "ﬁ", "０", "&", "<b>"),
)
ODD_RECORDS = (
    *("Lumped(1)", "Lumped(0)", "Lumped(-1)", "Lumped(3)", "Lumped(10**9)", "Lumped(9**9**9)", "Lumped(1e400)"),
    *("Lumped(2.5)", "Lumped('3')", "Lumped(m=3, m=4)", "Lumped(*[3])", "Lumped(**{'m': 3})", "Lumped", "Lumped()"),
    *("Spectral(2)", "Spectral(200)", "Spectral(201)", "Wave()", "Wave(2)", "Wave(1)", "Rigid()", "OneSpring()"),
    *("CentralDifference(8, order=4)", "CentralDifference(8, order=3)", "CentralDifference(4, closure='printed')"),
    *(
        "Auto()",
        "Auto(f_max=1e12)",
        "Auto(nan)",
        "Auto(1.0, 0.0)",
        "Lumped(300)",
        "Wave(300)",
        "__import__('os')",
        "(" * 300,
        "[" * 300 + "]" * 300,
    ),
    *("grey clay", "Soil(mean=-1.0, std=0.0)", "Soil(mean=inf, std=nan)", "Soil(1)", "-" * 5000 + "1"),
)
COMMON = ("t", "omega", "t", "omega", "phi", "pi", "0", "1", "2", "3", "0.5", "7", "1/3", "-1", "1e3", "0.01", "10.0")
ATOMS = (
    *("t", "omega", "phi", "v", "s", "u", "psi", "pi", "0", "1", "2", "3", "0.0", "0.5", "7", "1/3", "1e308", "1e-308"),
    *("5e-324", "1e40", "10**40", "9**9**9", "9**9**9**9", "1/0", "0**0", "0**-1", "(-1)**0.5", "1e400", "nan", "inf"),
    *("oo", "I", "E", "M", "True", "False", "__import__('os')", "lambda: 0", "x.y", "x[0]", "factorial(9)", "gamma(t)"),
    *("99999999999999999999", "0.1", "1000", "-1", "Table([0, 1], [0, 5])", "Table([0], [1])(t)", "Table([], [])"),
    *("Table([0, 1e-300], [-1e308, 1e308])(omega)", "2**-1074", "t**1000", "t**-1000", "t**1001", "1e-400", "e", "''"),
)
INFIX = ("+", "-", "*", "/", "**", "+", "-", "*", "/")
COMPARE = ("<", "<=", ">", ">=", "==", "!=")
WORDS = (
    *INFIX,
    *COMPARE,
    *FUNCTIONS,
    *"(),[]",
    "and",
    "or",
    "not",
    "^",
    "=",
    "%",
    "//",
    "!",
    "|",
    "@",
    ":",
    ";",
    "\\",
    "ω",
)
COMMANDS = ("scenes", "check", "latex", "run", "modes", "campbell", "sweep", "compare", "export")
Change = Callable[[Random, str], str]


@cache
def written() -> tuple[str, ...]:
    """What `save` writes of the scenes and of a small network around each component."""
    scenes = [scene() for scene in sw.scenes.SCENES.values()]
    scenes += [sw.scenes.crane(gap=0.003), sw.scenes.crane(load="random"), sw.scenes.crane(start="frequency")]
    return tuple(netlist_text(net.netlist()) for net in [*scenes, *map(bed_of, registered())])


def model_file(random: Random) -> str:
    """A model file, changed in one to four places."""
    text = random.choice(written())
    changes = SOUND if random.random() < 0.7 else CHANGES
    for _ in range(random.choice((1, 1, 2, 2, 3, 4))):
        text = random.choice(changes)(random, text)
    return text


def extreme_file(random: Random) -> str:
    """A model file in which one to three numbers have other sizes, up to the largest that are admitted."""
    text = random.choice(written())
    for _ in range(random.choice((1, 1, 2, 3))):
        text = random.choice((_sized, _sized, _sized, _scaled))(random, text)
    return text


def law(random: Random, depth: int = 5) -> str:
    """A text of the grammar of laws, or nearly."""
    text = _value(random, random.randint(0, depth))
    for _ in range(random.choice((0, 0, 0, 0, 0, 1, 2))):
        text = _spoilt_law(random, text)
    return text


def command_line(random: Random, folder: Path) -> list[str]:
    """The words of a call of the command, in which models are files in a folder."""
    name = random.choice(COMMANDS)
    words = [name]
    if name != "scenes":
        words += [_model(random, folder), *_options(random, name, folder)]
    for _ in range(random.choice((0, 0, 0, 1, 2))):
        words = _spoilt_words(random, words) if words else words
    return [word.replace("\0", "") for word in words]  # a system passes no other


# --- model files ------------------------------------------------------------------------------------------------------


def _line(random: Random, text: str, change: Callable[[str], Sequence[str]]) -> str:
    lines = text.splitlines()
    if not lines:
        return text
    k = random.randrange(len(lines))
    return "\n".join([*lines[:k], *change(lines[k]), *lines[k + 1 :]]) + "\n"


def _swapped(random: Random, items: list[str]) -> list[str]:
    if items:
        i, k = random.randrange(len(items)), random.randrange(len(items))
        items[i], items[k] = items[k], items[i]
    return items


def _substituted(random: Random, text: str, pattern: str, new: str) -> str:
    """One place that fits a pattern, replaced."""
    places = list(re.finditer(pattern, text, re.MULTILINE))
    if not places:
        return text
    place = random.choice(places)
    return text[: place.start(1)] + new + text[place.end(1) :]


def _blocks(random: Random, text: str) -> str:
    head, *parts = text.split("\n[[part]]")
    if not parts:
        return text
    k = random.randrange(len(parts))
    match random.randrange(4):
        case 0:
            parts.insert(random.randrange(len(parts)), parts[k])  # of the same name
        case 1:
            del parts[k]
        case 2:
            _swapped(random, parts)
        case _:
            count = random.choice((2, 10, 40))
            parts += [re.sub(r'(name = "[^"]*)"', rf'\g<1>{n}"', parts[k], count=1) for n in range(count)]
    return "\n[[part]]".join([head, *parts])


def _number(random: Random, text: str) -> str:
    return _substituted(random, text, r"= (.*\d.*)$", random.choice(ODD_NUMBERS))


def _scaled(random: Random, text: str) -> str:
    places = re.findall(r"= (-?\d[\d.e+-]*)$", text, re.MULTILINE)
    if not places:
        return text
    old = random.choice(places)
    new = float(old) * random.choice((-1.0, 0.0, 1e-9, 1e-3, 10.0, 1e3, 1e9, 1e20, 1.0 + 1e-15))
    return text.replace(f"= {old}\n", f"= {new!r}\n", 1)


def _sized(random: Random, text: str) -> str:
    size = random.choice(
        ("1e60", "1e-60", "1e30", "1e-30", "1e12", "1e-12", "1e6", "1e-6", "0.0", "1.0", "-1e30", "1e154")
    )
    return _substituted(random, text, r"^\w+ = (-?\d[\d.e+-]*)$", size)


def _name(random: Random, text: str) -> str:
    known = re.findall(r'"([^"]+)"', text) or [""]
    name = random.choice([*ODD_NAMES, *random.choices(known, k=30)])
    return _substituted(random, text, r'"([^"\n]*)"', name)


def _node(random: Random, text: str) -> str:
    """A part wired to another node of the network, or to the frame."""
    nodes = re.findall(r'"([^"]*)"', " ".join(re.findall(r"^nodes = .*$", text, re.MULTILINE))) or ["a"]
    places = list(re.finditer(r'(?<=[\[ ])"([^"\n]*)"(?=[\],])', text))
    if not places:
        return text
    place = random.choice(places)
    return text[: place.start(1)] + random.choice([*nodes, "ground", "new"]) + text[place.end(1) :]


def _type(random: Random, text: str) -> str:
    return _substituted(random, text, r'^type = "(\w*)"', random.choice([*REGISTRY, "Network", "object", ""]))


def _law(random: Random, text: str) -> str:
    return _substituted(random, text, r"^(?:tau|f|omega|v|u|i|[a-z_]\w*) = (.*)$", f'"{law(random)}"')


def _record(random: Random, text: str) -> str:
    return _substituted(random, text, r'^(?:model|soil|kind) = "(.*)"$', random.choice(ODD_RECORDS))


def _tokens(random: Random, text: str) -> str:
    tokens = re.findall(r"\w+|\s+|[^\w\s]", text)
    k = random.randrange(len(tokens)) if tokens else 0
    match random.randrange(3):
        case 0:
            del tokens[k : k + 1]
        case 1:
            tokens.insert(k, random.choice(tokens or [""]))
        case _:
            _swapped(random, tokens)
    return "".join(tokens)


def _letters(random: Random, text: str) -> str:
    k = random.randrange(len(text) + 1)
    new = random.choice(
        [*"\x00\r\n\t\"'[]{}=,#\\", "\ufeff", "\u2028", "é", "😀", "[" * 500, "a" * 5000, "[[part]]\n" * 50]
    )
    return text[:k] + new + text[k + random.choice((0, 1, 1, 20)) :]


SOUND: tuple[Change, ...] = (_scaled, _scaled, _scaled, _number, _node, _node, _law, _law, _record, _blocks, _type)
"""Those after which a file can often still be read."""
CHANGES: tuple[Change, ...] = (
    lambda random, text: _line(random, text, lambda _line: []),
    lambda random, text: _line(random, text, lambda line: [line, line]),
    lambda random, text: "\n".join(_swapped(random, text.splitlines())) + "\n",
    lambda random, text: text[: random.randrange(len(text) + 1)],
    *(_blocks, _number, _number, _number, _scaled, _scaled, _name, _name, _type, _law, _record, _tokens, _letters),
)

# --- laws -------------------------------------------------------------------------------------------------------------


def _value(random: Random, depth: int) -> str:
    if depth <= 0:
        return random.choice(COMMON if random.random() < 0.93 else ATOMS)
    inner = lambda: _value(random, depth - random.choice((1, 1, 1, 2)))  # noqa: E731
    match random.randrange(9):
        case 0 | 1 | 2:
            return f"({inner()} {random.choice(INFIX)} {inner()})"
        case 3:
            return f"{inner()} {random.choice(INFIX)} {inner()}"
        case 4 | 5:
            name = random.choice(list(FUNCTIONS))
            count = random.randint(FUNCTIONS[name].fewest, min(FUNCTIONS[name].most, 3))
            return f"{name}({', '.join(inner() for _ in range(count))})"
        case 6:
            return f"Piecewise(({inner()}, {_condition(random, depth - 1)}), ({inner()}, True))"
        case 7:
            return f"Table([{random.choice(('0, 1, 2', '-1, 0, 1e-3', '0, 1, 1e308'))}], [1, 5, -1])({inner()})"
    return _grown(random, inner())


def _condition(random: Random, depth: int) -> str:
    left, right = _value(random, depth - 1), _value(random, depth - 2)
    test = f"{left} {random.choice(COMPARE)} {right}"
    match random.randrange(6):
        case 0:
            return f"not ({test})"
        case 1:
            return f"{test} {random.choice(('and', 'or'))} {_condition(random, depth - 2)}" if depth > 0 else test
    return test


def _grown(random: Random, text: str) -> str:
    """The same again and again, as deep or as wide as an attacker would make it."""
    many = random.choice((2, 3, 8, 28, 40, 200))
    text = text[:120]
    match random.randrange(6):
        case 0:
            return "(" * many + text + ")" * many
        case 1:
            return f"{random.choice(list(FUNCTIONS))}(" * many + text + ")" * many
        case 2:
            return random.choice(("+", "*", "**", "-", "/")).join([f"({text})"] * many)
        case 3:
            return "*".join(f"({text} + {k})" for k in range(many))
        case 4:
            return f"({text} + t + omega)**{many}"
    return "-" * many + text


def _spoilt_law(random: Random, text: str) -> str:
    tokens = re.findall(r"\w+|\*\*|[^\w\s]", text)
    k = random.randrange(len(tokens)) if tokens else 0
    match random.randrange(4):
        case 0:
            del tokens[k : k + 1]
        case 1:
            tokens[k:k] = [random.choice([*WORDS, *ATOMS])]
        case 2:
            tokens[k : k + 1] = [random.choice([*WORDS, *ATOMS])]
        case _:
            _swapped(random, tokens)
    return " ".join(tokens)


# --- command lines ----------------------------------------------------------------------------------------------------

SMALL = (
    "crane-start",
    "six-phases",
    "shaft-chain",
    "shaft-step",
    "ship-line",
    "crane-train",
    "excavator",
    "bldc-shaft",
)
SETTINGS = (
    *(
        "shaft.c=2e4",
        "J1.J=3 kg*m^2",
        "J1.J=3 kg",
        "J1.J=1e400 kg*m^2",
        "J1.J=3 kg*m**9**9**9",
        "J1.J=3 kg*9**9**9*m**2",
    ),
    *(
        "J1.J=3 m",
        "J1.J=3 __import__('os')",
        "J1.J=1 " + "(" * 300,
        "J1.J=3 kg*m^2 + 1 s",
        "J1.J=2 turn",
        "shaft.c=1 %",
    ),
    *(
        "shaft.c=",
        "=",
        "shaft",
        "shaft.c=2=3",
        "shaft.model=Lumped(5)",
        "line.model=Wave()",
        "load.tau=sin(t)",
        "J1.J=0",
    ),
    *(
        "load.tau=9**9**9",
        "motor.tau=10*sin(t)",
        "shaft.c=0",
        "shaft.d=0",
        "J2.J=inf",
        "J2.J=nan",
        "J1.name=x",
        "J1.J=١",
    ),
    *("motor.tau_k=1e-300", "shaft.gap=0.001", "a.b.c=1", "J1.J=1_0", "shaft.c=1e60", "shaft.c=1e-60", "J1.symbol=2"),
)
ENDS = ("0.01", "0.001", "0", "-1", "nan", "inf", "1e400", "1e-300", "1e-9", "x", "", "0.01 s", "1_0e-3")
COUNTS = ("0", "-1", "1", "3", "nan", "1e3", "99999999999999999999", "x", "")
POINTS = ("J1.omega=8", "J1.omega=nan", "J1.omega=1e400", "J1.omega", "=", "x=1", "J2.omega=1e30", "shaft.tau=5")


def _model(random: Random, folder: Path) -> str:
    match random.randrange(10):
        case 0 | 1 | 2:
            return random.choice(SMALL)
        case 3:
            return random.choice(
                ("", "-", ".", "..", "x", "gone.toml", ".toml", "/", "a" * 5000 + ".toml", "ω.toml", "-x")
            )
    path = folder / "model.toml"
    path.write_text(model_file(random) if random.random() < 0.7 else random.choice(written()), "utf-8", "replace")
    return str(path)


def _options(random: Random, name: str, folder: Path) -> list[str]:
    options: list[str] = []
    for _ in range(random.choice((0, 0, 1, 2))):
        options += ["--set", random.choice(SETTINGS) if random.random() < 0.8 else f"motor.tau={law(random, 3)}"]
    if name in ("run", "sweep", "compare"):
        options += ["--t-end", "0.01" if random.random() < 0.7 else random.choice(ENDS)]
    for choices in OPTIONS.get(name, ()):
        if random.random() < 0.35:
            flag, *values = choices
            options += [flag, *([random.choice(values)] if values else [])]
    if name == "sweep":
        options += ["--vary", random.choice(VARIED), "--measure", random.choice(MEASURED)]
    if name == "campbell":
        options += ["--n-max", random.choice(("3000", "0", "-1", "nan", "inf", "1e400", "x"))]
    if name == "export" and random.random() < 0.5:
        options += [
            str(folder / random.choice(("new.toml", "new", "model.toml", "no/new.toml", ".toml", "a" * 300 + ".toml")))
        ]
    return [option.replace("FOLDER", str(folder)) for option in options]


VARIED = (
    *(
        "shaft.c=2e4,3e4",
        "shaft.c=1e4:2e4:3",
        "shaft.c=1:2:99999999999",
        "shaft.c=1:2:1",
        "shaft.c=1:nan:3",
        "shaft.c=,",
    ),
    *(
        "J1.J=1,0",
        "J1.J=-1",
        "x.y=1",
        "shaft.c=",
        "shaft.c=1:2:3:4",
        "shaft.c=1e308:-1e308:3",
        "J1.J=1 kg*m^2,2 kg*m^2",
    ),
    *("load.tau=sin(t)", "shaft.model=Rigid()", "shaft.c=inf", "J1.J=1e400,1", "shaft.c=2e4:3e4:²"),
)
MEASURED = (
    *(
        "max shaft.tau",
        "end J1.omega",
        "max",
        "",
        "max x.y",
        "damage shaft.tau",
        "shaft.c",
        "rms J2.omega",
        "MAX shaft.tau",
    ),
)
_POINT = (
    *(
        ("--at", *POINTS),
        ("--steady",),
        ("--count", *COUNTS),
        ("--f-max", "100", "0", "-1", "nan", "inf", "x"),
        ("--exact",),
    ),
)
_OUT = ("--out", "FOLDER/out", "FOLDER/model.toml", "", " ", "FOLDER/a/b/c", "/proc/x", "a" * 300)
_ENGINE = ("--engine", "auto", "scipy", "scipy-radau", "heyoka", "sundials", "exact", "banded", "wave", "x", "")
_RTOL = ("--rtol", "1e-6", "1e-12", "0", "-1", "nan", "inf", "1e-400", "1", "x")
OPTIONS: dict[str, tuple[tuple[str, ...], ...]] = {
    "run": (_ENGINE, _RTOL, ("--signals", "shaft.tau", "x", ",", "", "J1.phi", "J1.omega,J1.omega"), ("--json",)),
    "modes": (*_POINT, ("--json",)),
    "campbell": (
        *_POINT,
        ("--orders", "1,2", "0", "nan", "x", "", "1e400", "-1"),
        ("--n-min", "0", "5000", "nan", "x"),
    ),
    "latex": (
        ("--form", "kirchhoff", "state", "second-order", "lagrange", "x"),
        ("--phase", "load stuck", "x", ""),
        ("--values",),
        ("--document",),
    ),
    "sweep": (
        ("--require", "max shaft.tau<=300", "x<=1", "max shaft.tau<=nan", "max shaft.tau", "<=", ">=<="),
        ("--processes", "1", "0", "-1", "x"),
        ("--store", "FOLDER/store.jsonl", "FOLDER/model.toml", "", "FOLDER/no/x", "/dev/null"),
        _RTOL,
        _ENGINE,
        ("--json",),
    ),
    "compare": (("--shaft", "line", "shaft", "x", ""),),
}


def _spoilt_words(random: Random, words: list[str]) -> list[str]:
    k = random.randrange(len(words))
    match random.randrange(5):
        case 0:
            return words[:k] + words[k + 1 :]
        case 1:
            return [*words[:k], words[k], *words[k:]]
        case 2:
            return _swapped(random, words)
        case 3:
            return [
                *words[:k],
                words[k] + random.choice(("", "x", "=", "ω", "\n", "\udcff", "%s", "-")),
                *words[k + 1 :],
            ]
    return [
        *words[:k],
        random.choice(("--", "-", "--set", "--x", "-h", "--version", "--json", "@file", "é" * 3000)),
        *words[k:],
    ]
