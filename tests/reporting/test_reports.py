"""Reports say what the engineer needs, with the numbers of the motion, in every format."""

from __future__ import annotations

import re
import shutil
import subprocess
from html.parser import HTMLParser
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
    *("Introduction", "Drive train and circuit", "Parts and values", "Assumptions", "Equations", "Initial conditions"),
    *("Natural frequencies", "Motion", "Extremes", "Energy balance and accuracy", "Load cycles and life"),
    *("Nomenclature", "References", "Model file"),
]


@pytest.fixture(scope="module")
def crane() -> sw.Report:
    """The report on the crane, with words of the user."""
    return sw.report(SCENES["crane"], author="A. Engineer", revision="B", text={"introduction": "It *travels*."})


class _Text(HTMLParser):
    """The words of a page, without scripts and styles."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.words: list[str] = []
        self.inside = ""
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: object) -> None:  # noqa: ARG002
        self.inside = tag if tag in ("script", "style") else self.inside

    def handle_endtag(self, tag: str) -> None:
        self.inside = "" if tag == self.inside else self.inside

    def handle_data(self, data: str) -> None:
        if not self.inside:
            self.words.append(data)


def test_a_report_has_every_section_that_has_anything_to_say(crane: sw.Report) -> None:
    assert [heading for heading, _ in crane.sections] == HEADINGS


def test_its_extremes_are_those_of_the_motion(crane: sw.Report) -> None:
    assert crane.solution is not None
    table = dict(crane.sections)["Extremes"]
    for name in SCENES["crane"].signals:
        least, most, mean, end = crane.solution.extremes.row(name)
        row = next(line for line in table.splitlines() if line.replace(r"\allowbreak ", "").startswith(name))
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


def test_names_of_any_signs_are_in_the_document(tmp_path: Path) -> None:
    net = sw.Network("braces { and <b>")
    net.add(sw.TorqueSource("m", tau=1.0), "a")
    net.add(sw.Inertia("a{b", J=1.0), "a")
    net.add(sw.Spring('6" disc', c=100.0, d=1.0), "a", "b")
    net.add(sw.Inertia("100 % #1", J=1.0), "b")
    report = sw.report(net, t_end=1.0)
    report.save(tmp_path / "report.pdf")
    words = " ".join(_Text(report.html).words)
    assert all(name in words for name in ("a{b", "100 % #1", "braces { and <b>"))
    assert "\\mathrm" not in words.partition("Model file")[0]  # every formula is one


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"autor": "x"}, r"there is no 'autor'\. There are: signals"),
        ({"references": "Smith 1999"}, r"must be a list of texts, such as \['Smith 1999'\]"),
        ({"solution": "other"}, r"of another network than 'crane start': 'J1\.J' has another value"),
        ({"solution": "same", "t_end": 5.0}, "Leave out one of them"),
    ],
)
def test_what_would_be_dropped_without_a_word_is_refused(given: dict[str, Any], said: str) -> None:
    net, other = sw.scenes.crane_start(), sw.scenes.crane_start()
    other.replace(sw.Inertia("J1", J=5.0, symbol="1"))
    motions = {"same": net, "other": other}
    if "solution" in given:
        given = given | {"solution": motions[given["solution"]].simulate(0.1)}
    with pytest.raises(sw.ParameterError, match=said):
        sw.report(net, **given)


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


def test_where_values_come_from_is_a_column() -> None:
    parts = sw.report(
        sw.scenes.crane_start(), origins={"J1.J": "drawing 4711", "shaft": "catalogue"}, sections=["parts"]
    )
    rows = dict(parts.sections)["Parts and values"].splitlines()
    assert next(row for row in rows if "$J_{1}$" in row).rstrip("\\ ").endswith("drawing 4711")
    assert sum(row.rstrip("\\ ").endswith("catalogue") for row in rows) == 2  # stiffness and damping


def test_an_unknown_section_is_refused_with_those_that_there_are() -> None:
    with pytest.raises(sw.ParameterError, match=r"no section 'motions'\. There are: introduction, drawing, parts"):
        sw.report(SCENES["crane-start"], sections=["motions"])
    with pytest.raises(sw.ParameterError, match=r"text: there is no section 'preface'"):
        sw.report(SCENES["crane-start"], text={"preface": ""})
    with pytest.raises(sw.ParameterError, match="must be a list of names"):
        sw.report(SCENES["crane-start"], sections="motion")


def test_another_end_of_the_file_name_is_refused(crane: sw.Report, tmp_path: Path) -> None:
    with pytest.raises(sw.ParameterError, match=r"Take \.pdf, \.html, \.tex"):
        crane.save(tmp_path / "report.docx")


def test_the_page_needs_nothing_from_the_internet_and_has_all_words(crane: sw.Report) -> None:
    assert LOADED.findall(crane.html) == []
    words = " ".join(_Text(crane.html).words)
    assert all(heading in words for heading in HEADINGS)
    assert "Marinković" in words
    assert crane.html.count("<math") > 100
    assert crane.html.count('class="plotly-graph-div"') == 2  # the five signals in two pictures


@pytest.mark.skipif(shutil.which("pdftotext") is None, reason="pdftotext is not installed")
def test_the_pdf_has_every_section_and_number(crane: sw.Report, tmp_path: Path) -> None:
    crane.save(tmp_path / "report.pdf")
    done = subprocess.run(
        ["pdftotext", "-layout", "report.pdf", "-"], cwd=tmp_path, capture_output=True, check=True, encoding="utf-8"
    )
    assert all(heading in done.stdout for heading in HEADINGS)
    assert crane.solution is not None
    assert printed_number(float(crane.solution.max("shaft.tau")), 5) in done.stdout
    for part in SCENES["crane"]().parts:
        assert part.name in done.stdout


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
    assert names == {"report.tex", "report-train.pdf", "report-circuit.pdf", "shaftwork.json"}
    text = Path("signed/report.tex").read_text(encoding="utf-8")
    assert "$30$" in text
    assert r"It \textbf{holds}." in text
    assert main([*line, "--sections", "part", "--out", "signed"]) == 2


def test_sections_are_in_the_order_of_the_table() -> None:
    report = sw.report(SCENES["crane-start"], sections=["extremes", "drawing"])
    assert [heading for heading, _ in report.sections] == [SECTIONS["drawing"][0], SECTIONS["extremes"][0]]
