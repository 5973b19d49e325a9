"""Makes what the pages show from the code: outputs of their examples, tables of components, help texts.

    python docs/generate.py             writes README.md and docs/*.md anew where something has changed
    python docs/generate.py PAGE ...    these pages alone
    python docs/generate.py --slow ...  with the tables that take minutes

A page is Markdown. Its `python` blocks run from top to bottom in one namespace and in an empty folder; a `text`, `toml`
or `latex` block right after one holds what it printed. A `console` block holds command lines after "$ " and what they
print. Readers do not see these, which stand between the blocks:

    <!-- python ... -->                     code that runs like a block
    <!--= expression -->figure<!--/-->      a figure in a sentence: what the expression is in that namespace
    ![text](pictures/x.png)<!-- drawn: expression -->    a picture: the matplotlib figure that the expression is
    <!-- made: name --> ... <!-- end -->    what the function of this name in `MADE` returns
    <!-- measured: script --> ... <!-- end -->    what a script of benchmarks/ prints on the machine that it names
    <!-- given: 250 kW, two masses -->      figures that no code makes: of sources, norms and definitions

The tests (tests/docs) find every figure of a page in one of these, or in what its examples are and print; a number in
words is a figure, together with what it counts.
"""

from __future__ import annotations

import contextlib
import inspect
import io
import math
import os
import re
import shlex
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from shaftwork.cli import main as command_line
from shaftwork.components import FAMILIES, REGISTRY, Component, Port
from shaftwork.core.parameters import Parameter
from shaftwork.integrate.engines import ENGINES
from shaftwork.scenes import SCENES
from shaftwork.studies.stability import Stability, stability

ROOT = Path(__file__).parents[1]
PAGES = (ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md")))
NOTEBOOKS = tuple(sorted((ROOT / "notebooks").glob("*.ipynb")))

BLOCK = re.compile(r"^```(?P<language>\w+)\n(?P<body>.*?)^```$", re.MULTILINE | re.DOTALL)
MADE_PART = re.compile(r"(?P<start><!-- made: (?P<name>[\w ]+) -->\n).*?(?P<end><!-- end -->)", re.DOTALL)
HIDDEN = re.compile(
    r"<!-- python\n(?P<code>.*?)-->|<!--=(?P<expression>.*?)-->(?P<figure>.*?)<!--/-->"
    r"|\((?P<picture>pictures/[\w-]+\.png)\)<!-- drawn: (?P<drawn>.*?) -->",
    re.DOTALL,
)
"""Code that runs, figures that are computed, and pictures that are drawn, between the blocks."""
RESOLUTION = 100
"""Pixels per inch of a picture: a small file that is sharp in a column of text."""
OUTPUT = ("text", "toml", "latex", "c")
"""Languages of the blocks that hold what the block before them printed."""
ROUNDING = 1e-8
"""Errors below this are not told apart: they are rounding, which differs from one machine to the next."""
MACHINE = re.compile(r"^\d+(?= steps[,;])|(?<=; energy residual )\S+(?= of the work done)", re.MULTILINE)
"""What the command says of its own arithmetic: steps and the rounding that is left in the energy balance. Both differ
from one machine to the next; nothing else on a page may."""


def remade(page: Path, text: str, *, slow: bool = False, draw: bool = False) -> str:
    """The text of a page with everything in it that is made from the code made anew.

    Args:
        page: its file, for messages.
        text: the page as it stands.
        slow: whether what takes minutes is made anew, too.
        draw: whether pictures that do not show what the code says are drawn anew.

    Raises:
        ValueError: an example prints something that the page does not show, or a picture shows something else
            (without `draw`).
        Exception: whatever an example raises.
    """

    def made(match: re.Match[str]) -> str:
        name = match["name"]
        return match[0] if name in SLOW and not slow else f"{match['start']}{MADE[name]()}{match['end']}"

    text = MADE_PART.sub(made, text)
    # components that a page defines are forgotten after it
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder), mock.patch.dict(REGISTRY):
        return "".join(_executed(page, text, draw=draw))


def _executed(page: Path, text: str, *, draw: bool) -> Iterator[str]:
    """The page piece by piece, with the outputs of its blocks and the figures of its sentences replaced."""
    namespace: dict[str, Any] = {"__name__": "__main__"}
    place, printed = 0, ""
    for match in BLOCK.finditer(text):
        between, language, body = text[place : match.start()], match["language"], match["body"]
        if printed and (between.strip() or language not in OUTPUT):
            line = text.count("\n", 0, place)
            raise ValueError(f"{page.name}:{line}: the example prints {printed[:60]!r}, which is not shown.")
        yield _told(between, page, text.count("\n", 0, place), namespace, draw=draw)
        if printed:
            body, printed = printed, ""
        elif language == "python":
            printed = _run(body, page, text.count("\n", 0, match.start("body")), namespace)
        elif language == "console":
            body = "".join(f"{line}\n{_answer(line)}" for line in body.splitlines() if line.startswith("$ "))
        yield f"```{language}\n{body}```"
        place = match.end()
    if printed:
        raise ValueError(f"{page.name}: the last example prints {printed[:60]!r}, which is not shown.")
    yield _told(text[place:], page, text.count("\n", 0, place), namespace, draw=draw)


def _told(text: str, page: Path, line: int, namespace: dict[str, Any], *, draw: bool) -> str:
    """Sentences with their figures computed; hidden code between them runs."""

    def computed(match: re.Match[str]) -> str:
        place = line + text.count("\n", 0, match.start())
        if match["code"] is not None:
            if printed := _run(match["code"], page, place + 1, namespace):
                raise ValueError(f"{page.name}:{place}: hidden code prints {printed[:60]!r}, which is not shown.")
            return match[0]
        if match["drawn"] is not None:
            _drawn(ROOT / "docs" / match["picture"], eval(match["drawn"], namespace), draw=draw)  # noqa: S307 - as below
            return match[0]
        if text[: match.start()].rpartition("\n")[2].strip() in ("", "-"):
            raise ValueError(
                f"{page.name}:{place}: a computed figure begins the line, where Markdown takes it for HTML."
            )
        figure = eval(match["expression"], namespace)  # noqa: S307 - the examples of this repository
        return f"<!--={match['expression']}-->{figure}<!--/-->"

    return HIDDEN.sub(computed, text)


def curves(figure: Figure) -> str:
    """The curves of a figure, each by its label and its range to four digits."""
    lines = (line for axes in figure.axes for line in axes.lines)
    ranges = ((line.get_label(), np.asarray(line.get_ydata(), float)) for line in lines)
    return "; ".join(f"{label}: {values.min():.4g} to {values.max():.4g}" for label, values in ranges)


def _drawn(path: Path, figure: Figure, *, draw: bool) -> None:
    """Compare a picture with a figure: it says in its description which curves it shows."""
    text = curves(figure)
    if path.exists() and Image.open(path).text.get("Description") == text:
        return
    if not draw:
        raise ValueError(f"{path.name} does not show what the code says: {text}. Run python docs/generate.py.")
    figure.savefig(path, dpi=RESOLUTION, metadata={"Description": text})


def _run(code: str, page: Path, line: int, namespace: dict[str, Any]) -> str:
    """What an example prints; empty lines before it make line numbers in tracebacks those of the page."""
    output = io.StringIO()
    program = compile("\n" * line + code, str(page), "exec", dont_inherit=True)
    with contextlib.redirect_stdout(output), warnings.catch_warnings():
        warnings.simplefilter("error")
        exec(program, namespace)  # noqa: S102 - the examples of this repository
    return output.getvalue()


def _answer(line: str) -> str:
    """What a command line prints, errors included."""
    program, *arguments = shlex.split(line.removeprefix("$ "))
    if program != "shaftwork":
        raise ValueError(f"'{line}': only the command shaftwork is run here.")
    output = io.StringIO()
    with (
        mock.patch.dict(os.environ, COLUMNS="100", NO_COLOR="1"),
        contextlib.redirect_stdout(output),
        contextlib.redirect_stderr(output),
        contextlib.suppress(SystemExit),
    ):
        command_line(arguments)
    return output.getvalue()


def same(old: str, new: str) -> bool:
    """Whether two texts agree in all words and all digits, but for what `MACHINE` names."""
    return MACHINE.sub("#", old).split() == MACHINE.sub("#", new).split()


def components() -> dict[str, type[Component]]:
    """The components of the package by name, family by family; the registry also holds those of users."""
    own = ((name, cls) for name, cls in REGISTRY.items() if cls.__module__.startswith("shaftwork.components."))
    return dict(sorted(own, key=lambda item: FAMILIES.index(item[1].__module__.rpartition(".")[2])))


def component_list() -> str:
    """A line for each component: what it is, in the first sentence of its docstring, its ports and parameters."""
    lines = ["| component | what it is | ports | parameters |", "|---|---|---|---|"]
    for name, cls in components().items():
        what = inspect.cleandoc(cls.__doc__ or "").split("\n\n")[0].replace("\n", " ").partition(" Law: ")[0]
        declared = ", ".join(f"`{item}`" for item in cls.declared)
        lines.append(f"| [`{name}`](#{name.lower()}) | {what} | {_ports(cls)} | {declared} |")
    return "\n".join(lines) + "\n"


def _ports(cls: type[Component]) -> str:
    return ", ".join(f"{port.name} (optional)" if port.optional else port.name for port in cls.ports)


def _cells(item: Parameter | None) -> tuple[str, ...]:
    if item is None:
        return ("", "", "", "", "")
    written = repr if item.record else "{:g}".format
    default = "required" if item.required else "none" if item.default is None else written(item.default)
    meaning = f"{item.meaning} (law)" if item.law else item.meaning
    unit = item.unit.replace("*", "·").replace("^2", "²").replace("^3", "³")  # stars would be Markdown's
    return (f"`{item.name}`", unit, item.bounds, default, meaning)


def component_pages() -> str:
    """A section for each component: what it is, its law, ports, parameters and quantities."""
    texts: list[str] = []
    family = ""
    for name, cls in components().items():
        if cls.__module__ != family:
            family = cls.__module__
            module, heading = sys.modules[family], family.rpartition(".")[2].replace("_", " ").capitalize()
            texts.append(f"## {heading}\n\n{(module.__doc__ or '').splitlines()[0]}\n")
        texts.append(f"### {name}\n\n{_described(cls)}")
    return "\n".join(texts)


def _described(cls: type[Component]) -> str:
    domains = ", ".join(_port(port) for port in cls.ports)
    empty = cls.__new__(cls)  # without values, which may have to suit each other; the quantities are those of the class
    quantities = ", ".join(f"`{name}`" for name in empty.signals())
    text = f"{inspect.cleandoc(cls.__doc__ or '')}\n\nPorts: {domains}. Quantities: {quantities}.\n"
    if not cls.declared:
        return text
    rows = "".join(f"| {' | '.join(_cells(item))} |\n" for item in cls.declared.values())
    return f"{text}\n| parameter | unit | bound | default | meaning |\n|---|---|---|---|---|\n{rows}"


def _port(port: Port) -> str:
    domain = port.domain.name if port.domain else "any domain"
    return f"{port.name} ({domain}, optional)" if port.optional else f"{port.name} ({domain})"


def engine_table() -> str:
    """The engines that a run may be asked for."""
    rows = (
        f"| `{name}` | {entry.method} | {f'extra `{entry.extra}`' if entry.extra else ''} | {entry.suited} |\n"
        for name, entry in ENGINES.items()
        if not entry.part_of
    )
    return "| name | method | needs | for |\n|---|---|---|---|\n" + "".join(rows)


def scene_table() -> str:
    """The scenes with their sources and what was chosen."""
    rows = (
        f"| `{scene.name}` | {scene.title} | {scene.source} | {'; '.join(scene.chosen)} |\n"
        for scene in SCENES.values()
    )
    return "| scene | what | source | chosen, because not printed there |\n|---|---|---|---|\n" + "".join(rows)


@cache
def extreme_drives() -> Stability:
    """Every extreme drive with every model and every engine: some minutes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the table counts them
        return stability()


def stability_models() -> str:
    """What each model of a shaft does in each case, by the engine auto."""
    kinds = ("Rigid", "OneSpring", "Lumped", "CentralDifference", "Spectral", "Wave")
    rows: dict[str, dict[str, str]] = {}
    for cell in extreme_drives().cells:
        if cell.engine == "auto":
            error = "" if math.isnan(cell.error) else " < 1e-08" if cell.error < ROUNDING else f" {cell.error:.0e}"
            rows.setdefault(cell.case, {})[cell.model.partition("(")[0]] = f"{cell.verdict}{error}"
    head = f"| case | {' | '.join(f'`{kind}`' for kind in kinds)} |\n|---|{'---|' * len(kinds)}\n"
    return head + "".join(
        f"| {case} | {' | '.join(row.get(kind, '') for kind in kinds)} |\n" for case, row in rows.items()
    )


def stability_engines() -> str:
    """How often each engine comes to which verdict; travelling waves have an engine of their own."""
    study = extreme_drives()
    verdicts = [verdict for verdict, count in study.counts.items() if count]
    lines = [f"| engine | {' | '.join(verdicts)} | no deviation beyond |", f"|---|{'---|' * (len(verdicts) + 1)}"]
    for engine in study.engines:
        cells = [c for c in study.cells if c.engine == engine and (c.model.startswith("Wave") == (engine == "wave"))]
        counts = (sum(cell.verdict == verdict for cell in cells) for verdict in verdicts)
        largest = max(cell.deviation for cell in cells if not math.isnan(cell.deviation))
        power = math.ceil(math.log10(max(largest, ROUNDING)))
        lines.append(f"| `{engine}` | {' | '.join(map(str, counts))} | 1e{power:03d} |")
    return "\n".join(lines) + "\n"


MADE: dict[str, Callable[[], str]] = {
    "component list": component_list,
    "component pages": component_pages,
    "engine table": engine_table,
    "scene table": scene_table,
    "stability models": stability_models,
    "stability engines": stability_engines,
}
SLOW = ("stability models", "stability engines")
"""What is made anew only where it is asked for: `python docs/generate.py --slow`, and the tests marked slow."""


def main() -> None:
    """Write every page anew that differs from what the code makes of it."""
    slow = "--slow" in sys.argv
    for page in [Path(name).resolve() for name in sys.argv[1:] if name != "--slow"] or PAGES:
        text = page.read_text(encoding="utf-8")
        made = remade(page, text, slow=slow, draw=True)
        if not same(text, made):
            page.write_text(made, encoding="utf-8")
            sys.stdout.write(f"written: {page.relative_to(ROOT)}\n")


if __name__ == "__main__":
    main()
