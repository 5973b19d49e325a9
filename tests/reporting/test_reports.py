"""Reports say what the engineer needs, with the numbers of the motion, in every format."""

from __future__ import annotations

import math
import re
import shutil
import subprocess
import unicodedata
from html.parser import HTMLParser
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import shaftwork as sw
from shaftwork.cli import main
from shaftwork.latex.printing import printed_number
from shaftwork.reporting.report import SECTIONS
from shaftwork.scenes import SCENES
from tests.latex.test_equations_in_print import compile_latex, compiles, overfull

CHROMIUM = shutil.which("chromium")
LOADED = re.compile(r"""<(?:script|link|img|iframe)[^>]+(?:src|href)=["'](?!data:|#)""")
HEADINGS = [
    *("Introduction", "Drive train and circuit", "Parts and values", "Assumptions", "Equations"),
    *("Initial and operating conditions", "Natural frequencies", "Motion", "Extremes", "Energy balance and accuracy"),
    *("Load cycles and life", "Nomenclature", "References", "Model file"),
]


@pytest.fixture(scope="module")
def crane() -> sw.Report:
    """The report on the crane, with words of the user."""
    return sw.report(SCENES["crane"], author="A. Engineer", revision="B", text={"introduction": "It *travels*."})


class _Text(HTMLParser):
    """The words of a page, without scripts, styles and the LaTeX beside its formulas."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.words: list[str] = []
        self.inside = ""
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: object) -> None:  # noqa: ARG002
        self.inside = tag if tag in ("script", "style", "annotation") else self.inside

    def handle_endtag(self, tag: str) -> None:
        self.inside = "" if tag == self.inside else self.inside

    def handle_data(self, data: str) -> None:
        if not self.inside:
            self.words.append(data)


def _text_of(report: sw.Report, folder: Path) -> str:
    """The text of its PDF, in columns as on the page."""
    report.save(folder / "report.pdf")
    command = ["pdftotext", "-layout", "report.pdf", "-"]
    return subprocess.run(command, cwd=folder, capture_output=True, check=True, encoding="utf-8").stdout


def test_a_report_has_every_section_that_has_anything_to_say(crane: sw.Report) -> None:
    assert [heading for heading, _ in crane.sections] == HEADINGS


def test_its_extremes_are_those_of_the_motion(crane: sw.Report) -> None:
    assert crane.solution is not None
    table = dict(crane.sections)["Extremes"]
    for name in SCENES["crane"].signals:
        least, most, mean, end = crane.solution.extremes.row(name)
        lines = table.replace(r"\allowbreak ", "").splitlines()
        row = next(line for line in lines if line.removeprefix("{}").startswith(name))
        assert re.findall(r"\$(-?[0-9][^$]*)\$", row) == [
            printed_number(float(value), digits)
            for value, digits in ((least, 5), (least.t, 4), (most, 5), (most.t, 4), (mean, 5), (end, 5))
        ]


def test_every_equation_stands_once(crane: sw.Report) -> None:
    printed = dict(crane.sections)["Equations"]
    blocks = re.findall(r"\\paragraph\{(.*?)\}.*?\\begin\{align\*\}\n(.*?)\n\\end\{align\*\}", printed, re.DOTALL)
    lines = [(heading, line.rstrip("\\ ")) for heading, body in blocks for line in body.split("\\\\\n")]
    assert len(lines) == len(set(lines)) > 20


def test_every_phase_that_is_printed_has_its_states() -> None:
    printed = dict(sw.report(SCENES["crane"], phases=["brake locked, load stuck"]).sections)["Equations"]
    assert "brake locked, load stuck" in printed
    assert r"States: $\tau_{c,\mathrm{sh}}$." in printed


def test_words_of_the_user_are_markdown(crane: sw.Report) -> None:
    assert crane.sections[0] == ("Introduction", "It \\emph{travels}.\n")


def test_no_number_of_a_table_is_lost_on_the_page() -> None:
    words = "|length|count|\n|---|---|\n|200 mm|4|\n|7|8|\n\nin C:\\dir\\new\n"
    calculation = sw.torsional_calculation(sw.scenes.ship_engine(), np.array([20.0, 60.0, 90.0]))
    report = sw.report(
        sw.scenes.ship_engine(), torsional=calculation, sections=["torsional"], text={"introduction": words}
    )
    shown = " ".join(" ".join(_Text(report.html).words).split())
    for cell in ("200 mm 4", "7 8", r"C:\dir\new", *(" ".join(row[:4]) for row in calculation.table)):
        assert cell in shown


NAMES = (
    *("a{b", '6" disc', "it's 'q'", "$x$ #1 100 % & a_b", "x^2~y", r"C:\new\input{x}", "<b>bold</b>|", "ωelle Δ m² λ₂"),
    *("中心轴", "größe", "[3] *", "a--b,,c `d` ?`", r"\end{verbatim}", "}", "100", "*"),
)


@pytest.fixture(scope="module")
def named() -> sw.Report:
    """A report on a network whose title, parts, nodes and origins have all signs; pictures have no fonts for them."""
    net = sw.Network(f"net {' '.join(NAMES)}")
    for name in NAMES:
        net.add(sw.TorqueSource(f"source {name}", tau=1.0), f"node {name}")
        net.add(sw.Inertia(name, J=1.0), f"node {name}")
    for before, after in pairwise(NAMES):
        net.add(sw.Spring(f"shaft {after}", c=100.0, d=1.0), f"node {before}", f"node {after}")
    return sw.report(
        net,
        t_end=0.1,
        author=NAMES[3],
        revision=NAMES[9],
        origins={name: f"of {name}" for name in NAMES},
        assumptions=NAMES,
        references=NAMES,
        sections=["parts", "assumptions", "equations", "extremes", "nomenclature", "references", "model file"],
    )


def _words(text: str) -> str:
    """Words with one space between them, and letters of formulas as those outside them."""
    return " ".join(unicodedata.normalize("NFKC", text.replace("\u2019", "'")).split())


@pytest.mark.parametrize("name", NAMES)
def test_a_name_of_any_signs_stands_on_the_page_as_it_is(named: sw.Report, name: str) -> None:
    page = _words("".join(_Text(named.html).words))
    for cell in (f"of {name}", f"node {name}", f"source {name}"):
        assert _words(cell) in page


@pytest.mark.skipif(shutil.which("pdftotext") is None, reason="pdftotext is not installed")
def test_names_of_any_signs_stand_in_the_pdf_as_they_are(named: sw.Report, tmp_path: Path) -> None:
    words = _words(_text_of(named, tmp_path)).replace(" ", "")
    for name in NAMES:
        # letters of which this machine has no font are boxes
        assert "中" in name or f"of{_words(name)}".replace(" ", "") in words


@compiles
def test_names_of_any_signs_compile_and_the_source_says_what_pdflatex_lacks(named: sw.Report, tmp_path: Path) -> None:
    named.save(tmp_path / "report.tex")
    source = (tmp_path / "report.tex").read_text(encoding="utf-8")
    assert r"\DeclareUnicodeCharacter{4E2D}{[U+4E2D]}" in source
    assert "% pdflatex lacks some letters of this document" in source
    compile_latex(source, tmp_path)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"autor": "x"}, r"there is no 'autor'\. There are: signals"),
        ({"references": "Smith 1999"}, r"must be a list of texts, such as \['Smith 1999'\]"),
        ({"author": 5}, r"author = 5 must be a text\."),
        ({"date": 2026}, r"date = 2026 must be a text\."),
        ({"title": None, "revision": b"A"}, r"revision = b'A' must be a text\."),
        ({"speeds": 5}, r"speeds = 5 must be a sequence\. Write speeds=\[5\]"),
        ({"speeds": ["fast"]}, r"speeds = \['fast'\] must be numbers in rad/s, 0 or more"),
        ({"speeds": [1.0, float("nan")]}, r"must be numbers in rad/s"),
        ({"orders": [-1.0]}, r"orders = \[-1\.0\] must be numbers, 0 or more"),
        ({"sections": 5}, r"sections = 5 must be a sequence"),
        ({"sections": ["parts", 5]}, r"sections: 5 must be a text"),
        ({"signals": [1]}, r"signals: 1 must be a text"),
        ({"origins": ["J1"]}, r"origins = \['J1'\] must say by part"),
        ({"origins": {"J1": 4711}}, r"origins: 4711, where 'J1' comes from, must be a text"),
        ({"sn": 3.0}, r"sn = 3\.0 must be an S-N line"),
        ({"sn": {"shaft.tau": None}}, r"sn = None must be an S-N line"),
        ({"torsional": True}, r"torsional = True must be a torsional calculation, sw\.torsional_calculation"),
        ({"comparison": "all"}, r"comparison = 'all' must be a comparison of shaft models"),
        ({"solution": None, "text": "words"}, r"text = 'words' must say by section"),
        ({"text": {"introduction": 5}}, r"text of section 'introduction': 5 must be a text in Markdown"),
        ({"text": {"introduction": Path("none.md")}}, r"text of section 'introduction': 'none.md' cannot be read"),
        ({"t_end": "long"}, r"t_end = 'long'"),
        ({"solution": "other"}, r"of another network than 'crane start': 'J1\.J' has another value"),
        ({"solution": "same", "t_end": 5.0}, "Leave out one of them"),
    ],
)
def test_what_would_be_dropped_without_a_word_is_refused(given: dict[str, Any], said: str) -> None:
    net, other = sw.scenes.crane_start(), sw.scenes.crane_start()
    other.replace(sw.Inertia("J1", J=5.0, symbol="1"))
    motions = {"same": net, "other": other}
    if given.get("solution"):
        given = given | {"solution": motions[given["solution"]].simulate(0.1)}
    with pytest.raises(sw.ParameterError, match=said):
        sw.report(net, **given)


def test_only_networks_and_motions_are_reported() -> None:
    with pytest.raises(sw.ParameterError, match="5 is no network"):
        sw.report(5)  # type: ignore[arg-type]
    with pytest.raises(sw.ParameterError, match=r"solution = 5 must be a motion, net\.simulate"):
        sw.report(sw.scenes.crane_start(), solution=5)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("![plan](http://example.org/a.png)", r"the picture 'http://example\.org/a\.png' is not on this machine"),
        ("![plan](//example.org/a.png)", "a report fetches nothing"),
        ("![plan](data:image/png;base64,AAAA)", "a report fetches nothing"),
        ("![plan](none.png)", r"is not there: .*none\.png is no file"),
        ("![plan](plan.svg)", r"must be a file \.png, \.jpg, \.jpeg"),
        ("[x](javascript:alert)", r"the link 'javascript:alert' leads to no page\. Links may begin with: http"),
        ("[x](<java\tscript:alert>)", "leads to no page"),
        ("[x](&#106;avascript:alert)", "leads to no page"),
        ("[x](JaVaScRiPt:alert)", "leads to no page"),
        ("[x][y]\n\n[y]: vbscript:run", "leads to no page"),
        ("<file:///etc/passwd>", "leads to no page"),
        ("| a |\n|---|\n| [x](data:text/html,y) |\n", "leads to no page"),
    ],
)
def test_words_show_and_open_nothing_that_a_document_cannot_have(
    words: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with pytest.raises(sw.ParameterError, match=said):
        sw.report(sw.scenes.crane_start(), sections=[], text={"introduction": words})


WORDS = """# Scope

| length | count |
|--------|-------|
| 200 mm | 4     |
| [3]    | *8*   |

![The plan](plan.png)

A [page](https://example.org/a_b?c=d#e), `x_1 = "{}"`, <b>no tag</b>, ~~nor this~~.

```python
a = {"b": 1}  # 50 %
```

"""


@compiles
def test_words_and_their_pictures_are_in_every_format(tmp_path: Path) -> None:
    from matplotlib.figure import Figure

    Figure(figsize=(1, 1)).savefig(tmp_path / "plan.png")
    (tmp_path / "words.md").write_text(WORDS, encoding="utf-8")
    report = sw.report(sw.scenes.crane_start(), sections=[], text={"introduction": tmp_path / "words.md"})
    words = _words("".join(_Text(report.html).words))
    for part in ("Scope", "200 mm 4", "[3] 8", "The plan", "page", 'x_1 = "{}"', "<b>no tag</b>", '{"b": 1}', "50 %"):
        assert part in words
    assert 'href="https://example.org/a_b?c=d#e"' in report.html
    assert "data:image/png;base64," in report.html
    report.save(tmp_path / "report.tex")
    assert (tmp_path / "report-introduction-1.png").read_bytes() == (tmp_path / "plan.png").read_bytes()
    compile_latex((tmp_path / "report.tex").read_text(encoding="utf-8"), tmp_path)
    text = _words(_text_of(report, tmp_path))
    assert "200 mm 4" in text
    assert "[3] 8" in text


@pytest.mark.parametrize("ending", ["pdf", "html", "tex"])
def test_no_file_in_a_folder_that_is_not_there(ending: str, crane: sw.Report, tmp_path: Path) -> None:
    with pytest.raises(sw.ParameterError, match=r"There is no folder '.*none' for 'report\..*'\. Make it"):
        crane.save(tmp_path / "none" / f"report.{ending}")
    with pytest.raises(sw.ParameterError, match="must be the name of a file"):
        crane.save(5)  # type: ignore[arg-type]
    (tmp_path / f"taken.{ending}").mkdir()
    with pytest.raises(sw.ShaftworkError, match="cannot be written"):
        crane.save(tmp_path / f"taken.{ending}")


def test_an_origin_of_nothing_is_refused() -> None:
    with pytest.raises(sw.ParameterError, match=r"origins: there is no part or parameter 'J1\.j'. There are: J1\.J"):
        sw.report(sw.scenes.crane_start(), origins={"J1.j": "drawing"})


def test_what_cannot_be_computed_stands_among_the_assumptions() -> None:
    net = sw.Network("no file")
    net.add(sw.TorqueSource("motor", tau=1.0), "a")
    net.add(sw.Inertia("J", J=1.0), "a")
    report = sw.report(net)
    assert [heading for heading, _ in report.sections][:3] == [
        "Drive train and circuit",
        "Parts and values",
        "Equations",
    ]
    assert "Motion" not in dict(report.sections)


def test_what_is_wanted_and_cannot_be_drawn_is_said() -> None:
    net = sw.Network("long")
    for k in range(70):
        net.add(sw.Inertia(f"J{k}", J=1.0), f"n{k}")
        net.add(sw.Spring(f"c{k}", c=1.0), f"n{k}", f"n{k + 1}")
    net.add(sw.Inertia("last", J=1.0), "n70")
    ((heading, text),) = sw.report(net, sections=["drawing"]).sections
    assert heading == "Left out"
    assert "Drawings of more than" in text


def test_a_parameter_stands_in_the_table_under_the_letter_of_the_equations(crane: sw.Report) -> None:
    """A released brake has no torque, so that its letter is free there; where it slips, the torque has the letter."""
    sections = dict(crane.sections)
    assert r"\tau_{B} &= \tau_{0,B}" in sections["Equations"]
    (row,) = (row for row in sections["Parts and values"].splitlines() if "$323.76$" in row)
    assert row.startswith(r"$\tau_{0,B}$")


def test_the_orders_of_a_torque_stand_among_the_values() -> None:
    report = sw.report(sw.scenes.ship_engine(), sections=["parts"])
    text = dict(report.sections)["Parts and values"]
    assert "Orders with amplitudes and phases of piston 1, piston 2, piston 3, piston 4: exponent = 2" in text
    wake = text.partition("phases of wake")[2]
    assert "$4$ & $250$ & $0$" in wake


def test_start_values_are_those_of_the_motion_in_whatever_unit_they_are_given() -> None:
    from pint import application_registry

    net = sw.scenes.crane_start()
    motion = net.simulate(0.01, initial={"J1.omega": application_registry.Quantity(30, "rpm"), "J2.omega": 3.0})
    text = dict(sw.report(net, solution=motion, sections=["conditions"]).sections)["Initial and operating conditions"]
    assert "starts with the values below, in the modes: load slipping forward" in text
    assert f"J1.omega & ${printed_number(np.pi, 5)}$" in text


def test_only_what_is_twisted_has_load_cycles() -> None:
    net = sw.scenes.ship_engine()
    report = sw.report(net, t_end=0.02, sections=["cycles"])
    text = dict(report.sections)["Load cycles and life"]
    assert "Of 7 shafts and springs" in text
    assert "combustion" not in text


def test_where_values_come_from_is_a_column() -> None:
    parts = sw.report(
        sw.scenes.crane_start(), origins={"J1.J": "drawing 4711", "shaft": "catalogue"}, sections=["parts"]
    )
    rows = dict(parts.sections)["Parts and values"].splitlines()
    assert next(row for row in rows if "$J_{1}$" in row).rstrip("\\ ").endswith("drawing 4711")
    assert sum(row.rstrip("\\ ").endswith("catalogue") for row in rows) == 2  # stiffness and damping


def test_values_that_are_computed_come_from_no_drawing() -> None:
    parts = sw.report(sw.scenes.crane(), origins={"motor": "catalogue"}, sections=["parts"])
    rows = dict(parts.sections)["Parts and values"].splitlines()
    (slip,) = (row for row in rows if "slip at the pull-out torque" in row)
    assert slip.rstrip("\\ ").endswith("computed")


def test_an_unknown_section_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(sw.ParameterError, match=r"no section 'motions'\. There are: introduction, drawing, parts"):
        sw.report(SCENES["crane-start"], sections=["motions"])
    with pytest.raises(sw.ParameterError, match=r"text: there is no section 'preface'"):
        sw.report(SCENES["crane-start"], text={"preface": ""})
    with pytest.raises(sw.ParameterError, match=r"sections = 'motion' must be a list of texts, such as"):
        sw.report(SCENES["crane-start"], sections="motion")


def test_another_end_of_the_file_name_is_refused(crane: sw.Report, tmp_path: Path) -> None:
    with pytest.raises(sw.ParameterError, match=r"Take \.pdf, \.html, \.tex"):
        crane.save(tmp_path / "report.docx")


def test_the_page_needs_nothing_from_the_internet_and_has_all_words(crane: sw.Report) -> None:
    assert LOADED.findall(crane.html) == []
    words = _words(" ".join(_Text(crane.html).words))
    assert all(heading in words for heading in HEADINGS)
    assert _words("Marinković") in words
    assert crane.html.count("<math") > 100
    assert crane.html.count('class="plotly-graph-div"') == 2  # the five signals in two pictures


@pytest.mark.skipif(shutil.which("pdftotext") is None, reason="pdftotext is not installed")
def test_the_pdf_has_every_section_and_number(crane: sw.Report, tmp_path: Path) -> None:
    text = _text_of(crane, tmp_path)
    assert all(heading in text for heading in HEADINGS)
    assert crane.solution is not None
    assert printed_number(float(crane.solution.max("shaft.tau")), 5) in text
    for part in SCENES["crane"]().parts:
        assert part.name in text


@pytest.mark.slow
@compiles
@pytest.mark.parametrize("name", SCENES)
def test_the_report_of_every_scene_compiles_inside_its_margins(name: str, tmp_path: Path) -> None:
    report = sw.report(SCENES[name])
    for ending in ("tex", "pdf", "html"):
        report.save(tmp_path / f"report.{ending}")
    log = compile_latex((tmp_path / "report.tex").read_text(encoding="utf-8"), tmp_path)
    assert overfull(log) == []
    assert LOADED.findall((tmp_path / "report.html").read_text(encoding="utf-8")) == []


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")
def test_a_browser_draws_the_page_without_an_error(crane: sw.Report, tmp_path: Path) -> None:
    crane.save(tmp_path / "report.html")
    command = [str(CHROMIUM), "--headless", "--no-sandbox", "--disable-gpu", "--enable-logging=stderr", "--v=0"]
    command += ["--virtual-time-budget=8000", "--window-size=400,900", "--dump-dom", str(tmp_path / "report.html")]
    done = subprocess.run(command, capture_output=True, check=True, encoding="utf-8", timeout=120)
    assert "CONSOLE" not in done.stderr
    assert done.stdout.count('class="main-svg"') >= 2  # what plotly draws


def test_the_command_writes_the_files_of_a_report(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("words.md").write_text("It **holds**.", encoding="utf-8")
    line = ["report", "crane-start", "--set", "J1.J=30", "--tex", "--author", "B", "--text", "conclusions=words.md"]
    assert main([*line, "--sections", "parts,drawing", "--out", "signed"]) == 0
    names = {path.name for path in Path("signed").iterdir()}
    assert names == {"report.tex", *(f"report-{name}.pdf" for name in ("train", "circuit", "dual")), "shaftwork.json"}
    text = Path("signed/report.tex").read_text(encoding="utf-8")
    assert "$30$" in text
    assert r"It \textbf{holds}." in text
    assert main([*line, "--sections", "part", "--out", "signed"]) == 2


def test_sections_are_in_the_order_of_the_table() -> None:
    report = sw.report(SCENES["crane-start"], sections=["extremes", "drawing"])
    assert [heading for heading, _ in report.sections] == [SECTIONS["drawing"][0], SECTIONS["extremes"][0]]


@pytest.mark.parametrize(
    ("contents", "message"),
    [
        ({"at": {"x.y": 3.0}}, "There is no speed, twist or torque 'x.y'"),
        ({"at": {"J1.omega": math.nan}}, "'J1.omega' = nan must be a finite number"),
        ({"t_end": 1.0, "sn": {"foo.tau": sw.SNLine(amplitude=5.0, cycles=1e6, slope=5.0)}}, "no quantity 'foo.tau'"),
        ({"speeds": [30.0, 10.0]}, "must be two or more speeds"),
        ({"orders": [1.0]}, "Give its speeds= too"),
        ({"sections": ["motion"]}, "say nothing"),
        ({"signals": ["J1.omega"]}, "needs a motion"),
        ({"text": {"conclusions": "[a](other.md)"}}, "'other.md' leads to no page"),
    ],
)
def test_what_is_asked_for_is_in_the_report_or_refused(contents: dict[str, Any], message: str) -> None:
    """A document that someone signs leaves nothing out that he has asked for."""
    net = sw.Network("two masses")
    net.add(sw.TorqueSource("motor", tau=10.0), "rotor")
    net.add(sw.Inertia("J1", J=2.0), "rotor")
    net.add(sw.Spring("shaft", c=100.0, d=1.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=3.0), "wheel")
    with pytest.raises(sw.ShaftworkError, match=re.escape(message)):
        sw.report(net, **contents)


def test_modes_that_swing_come_first_and_the_dual_circuit_is_drawn() -> None:
    """A shaft in elements has more decays than modes that swing, and lower ones."""
    report = sw.report(SCENES["ship-engine"], sections=["drawing", "frequencies"], t_end=0.05)
    assert "dual" in report.figures
    rows = re.findall(r"(?:mode|decay) \d+ & \$([\d.]+)\$ & ", dict(report.sections)["Natural frequencies"])
    frequencies = [float(value) for value in rows]
    assert len(frequencies) > 5
    swinging = [value > 0 for value in frequencies]
    assert swinging == sorted(swinging, reverse=True)
