"""The built site: no warning, nothing from the internet, formulas that a browser draws, nothing cut off."""

from __future__ import annotations

import importlib
import json
import os
import re
import shutil
import subprocess
import sys
from html import unescape
from pathlib import Path

import pytest

from docs.generate import ROOT

CHROMIUM = shutil.which("chromium")

pytestmark = pytest.mark.slow

FENCE = re.compile(r"^```.*?^```$|`[^`\n]+`", re.MULTILINE | re.DOTALL)
FORMULA = re.compile(r"\$\$.+?\$\$|\$[^$\n]+\$", re.DOTALL)
PRINTED = re.compile(r"^```latex$.*?^```$", re.MULTILINE | re.DOTALL)
"""LaTeX that an example printed."""
DRAWN = re.compile(r"<(pre|code|script|math)\b.*?</\1>", re.DOTALL)
"""What may hold LaTeX: code, and formulas that are drawn."""
EXTERNAL = re.compile(r"""<(?:script|link|img)[^>]+(?:src|href)=["'](?:https?:)?//""")

MEASURED = """
<script>
addEventListener("load", () => {
  const all = query => [...document.querySelectorAll(query)];
  const height = shape => shape.getBoundingClientRect().height;
  const result = {
    formulas: all("math").filter(height).length,
    empty: all("math").filter(shape => !height(shape)).map(shape => shape.textContent),
    fractions: all("mfrac").map(shape => [...shape.children].map(part => part.getBoundingClientRect().top)),
    cut: all(".wy-table-responsive, .highlight pre, .highlight code, .formula, .wy-nav-content")
      .filter(shape => shape.scrollWidth > shape.clientWidth + 1 && shape.clientWidth)
      .map(shape => shape.textContent.trim().slice(0, 60)),
  };
  document.body.textContent = "MEASURED" + JSON.stringify(result) + "MEASURED";
});
</script>
"""
"""What a page says of itself once it is drawn: its formulas, where the halves of fractions are, what is cut off."""


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The site that SHAFTWORK_SITE names, as CI built it, or one without the outputs of notebooks."""
    if "SHAFTWORK_SITE" in os.environ:
        return Path(os.environ["SHAFTWORK_SITE"])
    pytest.importorskip("mkdocstrings_handlers", reason="needs the extra docs; CI has it")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "--quiet", "--strict", "--site-dir", str(folder)]
    environment = os.environ | {"EXECUTE_NOTEBOOKS": "false"}
    built = subprocess.run(command, cwd=ROOT, env=environment, check=False, capture_output=True, text=True)
    assert (built.returncode, built.stdout, built.stderr) == (0, "", "")
    return folder


def test_the_site_is_built_without_a_warning_and_loads_nothing_from_the_internet(site: Path) -> None:
    pages = tuple(site.rglob("*.html"))
    assert len(pages) > 20
    assert [page.name for page in pages if EXTERNAL.search(page.read_text(encoding="utf-8"))] == []
    assert [
        sheet.name for sheet in site.rglob("*.css") if re.search(r"url\([\"']?(https?:)?//", sheet.read_text())
    ] == []


def test_no_page_shows_latex_as_it_stands(site: Path) -> None:
    """Not even a notebook, whose cells show equations without dollars around them."""
    texts = {page.parent.name: DRAWN.sub("", page.read_text(encoding="utf-8")) for page in site.rglob("*.html")}
    assert [name for name, text in texts.items() if re.search(r"\\begin\{|\\frac|\$\$", text)] == []


@pytest.mark.skipif(CHROMIUM is None and "CI" not in os.environ, reason="needs chromium (Debian package); CI has it")
@pytest.mark.parametrize("name", ["states", "frequency", "names", "command-line", "components", "tutorial"])
def test_a_browser_without_network_draws_every_formula_and_cuts_nothing_off(
    site: Path, name: str, tmp_path: Path
) -> None:
    source = (ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8")
    formulas = len(FORMULA.findall(FENCE.sub("", source)))
    printed = sum(block.count(r"\begin{align*}") for block in PRINTED.findall(source))
    page = site / name / "measured.html"
    text = (site / name / "index.html").read_text(encoding="utf-8")
    page.write_text(text.replace("</head>", f"{MEASURED}</head>"), encoding="utf-8")
    shown = subprocess.run(
        [
            str(CHROMIUM),
            *("--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
            *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
            "--host-resolver-rules=MAP * ~NOTFOUND",
            f"--user-data-dir={tmp_path}",
            "--window-size=1400,1000",
            "--virtual-time-budget=10000",
            "--dump-dom",
            page.as_uri(),
        ],
        check=True,
        capture_output=True,
        text=True,
        timeout=120,
    ).stdout
    result = json.loads(unescape(shown.split("MEASURED")[-2]))
    assert (result["formulas"], result["empty"], result["cut"]) == (formulas + printed, [], [])
    assert all(above < below for above, below in result["fractions"])


def test_the_pages_that_a_browser_counts_have_formulas() -> None:
    """Else the counts above could agree at zero."""
    texts = (FENCE.sub("", (ROOT / "docs" / f"{name}.md").read_text()) for name in ("states", "frequency", "names"))
    assert [len(FORMULA.findall(text)) > 10 for text in texts] == [True] * 3


def test_words_in_a_formula_may_hold_formulas() -> None:
    """As in "J$_{2}$ is held at rest"; the converter by itself spells the words as letters."""
    pytest.importorskip("latex2mathml", reason="needs the extra docs; CI has it")
    page = importlib.import_module("docs.mathml")
    drawn = page.on_page_content(r'<span class="arithmatex">\(\omega = 0 \quad \text{(J$_{2}$ is held)}\)</span>')
    assert re.findall("<mtext>(.*?)</mtext>", drawn.replace("&#x000A0;", " ")) == ["(J", " is held)"]
