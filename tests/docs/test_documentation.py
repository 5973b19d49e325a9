"""What the pages say is so: examples run and print what stands there, tables are up to date, links and names exist."""

from __future__ import annotations

import importlib
import importlib.util
import json
import re
from pathlib import Path
from typing import Any

import pytest
import sympy

import shaftwork as sw
from docs.generate import NOTEBOOKS, PAGES, ROOT, SLOW, components, remade, same
from shaftwork.components import REGISTRY, Component

DOCS = ROOT / "docs"
TEXTS = {page.name: page.read_text(encoding="utf-8") for page in PAGES}
STORIES = TEXTS | {
    notebook.name: "".join(
        line for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"] for line in [*cell["source"], "\n"]
    )
    for notebook in NOTEBOOKS
}
BENCHMARKS = {path.name: path.read_text(encoding="utf-8") for path in sorted((ROOT / "benchmarks").glob("*.py"))}

CODE = re.compile(r"```.*?```|(?<!`)`([^`\n]+)`(?!`)", re.DOTALL)
"""Fenced blocks, and what stands between single quotes of code."""
LINK = re.compile(r"!?\[[^\]]*\]\(([^)\s]+)\)")
PATH = re.compile(r"\b(?:src|tests|docs|notebooks|benchmarks)/[\w./-]*\w")
QUALIFIED = re.compile(r"\bsw\.([A-Za-z]\w*)(?:\.([a-z]\w*))?")
MEMBER = re.compile(r"([A-Z][a-z]+\w*)\.([a-z]\w*)(?:\(.*\))?")
CAPITALISED = re.compile(r"([A-Z][a-z]+\w*)(?:\(.*\))?")
TEST = re.compile(r"`(test_\w+)`")
IMPORT = re.compile(r"^from (shaftwork[\w.]*) import (\([^)]*\)|.*)$", re.MULTILINE)
LARGEST_PICTURE = 150_000
LONGEST_README = 150


@pytest.mark.slow
@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_a_page_is_what_the_code_makes_of_it(page: Path) -> None:
    """Examples run, outputs, tables and help texts are up to date; `python docs/generate.py` makes them so."""
    for library in ("heyoka", "sksundae", "matplotlib", "pandas", "xarray"):
        pytest.importorskip(library, reason="the examples show what all extras together do")
    text = TEXTS[page.name]
    assert_same(text, remade(page, text))


@pytest.mark.slow
@pytest.mark.study
@pytest.mark.xdist_group("study of stability")
@pytest.mark.parametrize("page", [page for page in PAGES if any(name in TEXTS[page.name] for name in SLOW)])
def test_tables_that_take_minutes_are_what_the_code_makes_of_them(page: Path) -> None:
    text = TEXTS[page.name]
    assert_same(text, remade(page, text, slow=True))


def assert_same(text: str, made: str) -> None:
    """A page is what the code made of it, or the lines that differ are shown."""
    pairs = zip(text.splitlines(), made.splitlines(), strict=False)
    assert same(text, made), [(old, new) for old, new in pairs if not same(old, new)][:5]


@pytest.mark.parametrize(
    ("old", "new", "agree"),
    [
        (
            "299 steps, 1 change; energy residual 2.3e-14 of the work done",
            "301 steps, 1 change; energy residual 7e-15 of the work done",
            True,
        ),
        ("299 steps, 1 change", "299 steps, 2 changes", False),
        ("a residual of 2e-14", "a residual of 3e-14", False),
        ("| a  | b |", "| a | b |", True),
        ("shaft.tau  351.48", "shaft.tau   351.49", False),
        ("0.157080 rad/s", "0.157000 rad/s", False),
        ("shaft.tau  351.48", "motor.tau  351.48", False),
        ("engine heyoka", "engine heyoka: why", False),
        ("| `J` | kg*m^2 |", "| `J` | kg*m |", False),
    ],
)
def test_outputs_agree_in_all_words_and_all_digits_but_for_the_rounding_of_the_command(
    old: str,
    new: str,
    agree: bool,  # noqa: FBT001
) -> None:
    assert same(old, new) is agree


def test_a_figure_in_a_sentence_is_computed_where_it_stands() -> None:
    text = "```python\nm = 3\n```\n\n<!-- python\nn = 2 * m\n-->\n\nThere are <!--= n + 1 -->0<!--/--> of them.\n"
    assert remade(Path("page.md"), text) == text.replace("-->0<!--", "-->7<!--")


def test_an_example_whose_output_is_not_shown_is_an_error() -> None:
    with pytest.raises(ValueError, match="is not shown"):
        remade(Path("page.md"), "```python\nprint(1)\n```\n\nand so on\n")


def test_the_page_of_components_has_every_parameter_of_every_component() -> None:
    for name, cls in components().items():
        assert f"[`{name}`](#{name.lower()})" in TEXTS["components.md"]
        assert all(f"`{item}`" in TEXTS["components.md"] for item in cls.declared)


@pytest.mark.parametrize("page", [*PAGES, ROOT / "CONTRIBUTING.md"], ids=lambda page: page.name)
def test_every_link_leads_to_a_file_and_a_heading(page: Path) -> None:
    for target in LINK.findall(page.read_text(encoding="utf-8")):
        if re.match("https?://", target):
            continue
        name, _, heading = target.partition("#")
        place = page.parent / name if name else page
        assert place.is_file(), target
        assert not heading or heading in _headings(place), target


def _headings(page: Path) -> set[str]:
    titles = re.findall(r"^#+ (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w]+", "-", title.lower()).strip("-") for title in titles}


def _inline(text: str) -> list[str]:
    return [found for found in CODE.findall(text) if found]


@pytest.mark.parametrize("name", STORIES)
def test_only_names_that_exist_are_named(name: str) -> None:
    text = STORIES[name]
    for owner, member in QUALIFIED.findall(text):
        assert hasattr(sw, owner), f"sw.{owner}"
        assert not member or _has(getattr(sw, owner), member), f"sw.{owner}.{member}"
    for code in _inline(text):
        if found := MEMBER.fullmatch(code):
            assert _has(getattr(sw, found[1]), found[2]), code
        elif found := CAPITALISED.fullmatch(code):
            assert hasattr(sw, found[1]) or hasattr(sympy, found[1]), code


@pytest.mark.parametrize("name", [*STORIES, *BENCHMARKS])
def test_what_pages_notebooks_and_benchmarks_import_is_there(name: str) -> None:
    """Also where they run in minutes only, so that a renamed class is seen at once."""
    for module, names in IMPORT.findall(STORIES[name] if name in STORIES else BENCHMARKS[name]):
        where = importlib.import_module(module)
        for imported in re.findall(r"\w+", names):
            if not hasattr(where, imported):
                importlib.import_module(f"{module}.{imported}")


def _has(owner: Any, member: str) -> bool:
    """Whether a class or module has a member, a field, or, a component, a quantity of this name."""
    if hasattr(owner, member) or member in getattr(owner, "__dataclass_fields__", ()):
        return True
    if not (isinstance(owner, type) and issubclass(owner, Component)):
        return False
    return member in owner("part", **{item.name: 1.0 for item in owner.declared.values() if item.required}).signals()


@pytest.mark.parametrize("name", STORIES)
def test_every_file_that_is_named_exists(name: str) -> None:
    missing = [path for path in PATH.findall(STORIES[name]) if not (ROOT / path).exists()]
    assert missing == []


def test_the_sign_page_names_every_test_of_signs_and_no_other() -> None:
    tests = (ROOT / "tests/properties/test_signs.py").read_text(encoding="utf-8")
    reversal = "test_a_reversed_part_changes_only_the_signs_of_its_own_signals"
    named = set(TEST.findall(TEXTS["signs.md"]))
    assert named - {reversal} == set(re.findall(r"^def (test_\w+)", tests, re.MULTILINE))
    assert f"def {reversal}" in (ROOT / "tests/properties/test_invariance.py").read_text(encoding="utf-8")


def test_every_term_of_the_glossary_stands_in_the_module_that_it_names() -> None:
    rows = [row.split("|") for row in TEXTS["glossary.md"].splitlines() if row.startswith("| ") and "`" in row]
    places = [module for row in rows for module in re.findall(r"`([\w.]+)`", row[-2])]
    assert len(places) >= 20
    missing = [place for place in places if importlib.util.find_spec(f"shaftwork.{place}") is None]
    assert missing == []


def test_the_page_of_the_interface_has_every_public_name() -> None:
    """Components have a page of their own, symbols of laws stand in the text."""
    shown = set()
    for path in re.findall(r"^::: ([\w.]+)$", TEXTS["api.md"], re.MULTILINE):
        module, _, name = path.rpartition(".")
        assert hasattr(importlib.import_module(module), name), path
        shown.add(name)
    own = {name for name, kind in REGISTRY.items() if not kind.__module__.startswith("shaftwork.")}  # of other tests
    public = set(dir(sw)) - set(components()) - own - {"scenes", "studies"}
    assert {name for name in public if name not in shown and f"`{name}`" not in TEXTS["api.md"]} == set()


def test_every_kind_of_problem_on_the_page_is_one_of_the_code() -> None:
    names = ("diagnosis", "value_diagnosis", "view")
    sources = ("network/checks.py", "components/drives.py", *(f"formulation/{name}.py" for name in names))
    code = "".join((ROOT / "src/shaftwork" / source).read_text(encoding="utf-8") for source in sources)
    table = re.findall(r"^\| ([a-z, ]+) \| (?:error|warning|note) \|", TEXTS["diagnosis.md"], re.MULTILINE)
    kinds = [kind.strip() for row in table for kind in row.split(",")]
    assert len(kinds) > 20
    made_of_words = {
        "two speed sources": "two {words.across} sources",
        "blocked speed source": "blocked {words.across} source",
    }
    assert [kind for kind in kinds if f'"{made_of_words.get(kind, kind)}"' not in code] == []


def test_pictures_show_what_the_code_says_now() -> None:
    """`python -m docs.pictures` makes them so."""
    images = pytest.importorskip("PIL.Image", reason="matplotlib brings it")
    sources = importlib.import_module("docs.pictures").sources()
    shown = {name: images.open(DOCS / "pictures" / name).text.get("Description") for name in sources}
    assert shown == sources


def test_the_readme_is_short() -> None:
    assert len(TEXTS["README.md"].splitlines()) <= LONGEST_README


@pytest.mark.parametrize("name", STORIES)
def test_no_page_promises_anything(name: str) -> None:
    """What was planned once was written about as planned long after it was there."""
    assert re.findall(r"\b(?:planned|not yet|coming soon|TODO|in future|will be added)\b", STORIES[name]) == []


@pytest.mark.parametrize(
    ("page", "told", "untrue"),
    [
        ("analogy.md", "is the force-voltage analogy", "analogy of its [sources]"),
        ("analogy.md", "Abdelkader 2016 draw no circuits", "a distributed shaft is planned"),
        ("sources.md", "Z. Marinković, D. Marinković", "D. Marinković, Z. Marinković"),
        ("sources.md", "from the second elastic mode on", "not at equal m"),
        ("design.md", "The engines of scipy and SUNDIALS are files", "One file for each engine"),
        ("design.md", "The long `Shaft` is the one exception", "know branches, never components"),
        ("model-files.md", "A loaded network is equal to the saved one", "The round trip is exact"),
        ("README.md", "what is loaded is equal to what was saved", "the round trip is exact"),
        (
            "shaft-chain.ipynb",
            "`model=sw.Spectral(n)` or `sw.Wave()`",
            "(waves with delay, spectral elements) are planned",
        ),
        (
            "is-the-paper-right.ipynb",
            "So the paper is right about its own two models",
            "At equal size the chain is four times better",
        ),
    ],
)
def test_what_was_found_untrue_is_put_right(page: str, told: str, untrue: str) -> None:
    assert untrue not in STORIES[page]
    assert told in " ".join(STORIES[page].split())


def test_pictures_are_small_and_all_of_them_are_shown() -> None:
    pictures = tuple(sorted((DOCS / "pictures").iterdir()))
    assert pictures
    for picture in pictures:
        assert picture.stat().st_size < LARGEST_PICTURE, picture.name
        assert any(f"pictures/{picture.name}" in text for text in TEXTS.values()), picture.name


@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda notebook: notebook.name)
def test_notebooks_are_stored_without_outputs(notebook: Path) -> None:
    cells = [cell for cell in json.loads(notebook.read_text(encoding="utf-8"))["cells"] if cell["cell_type"] == "code"]
    assert cells
    assert [cell["source"] for cell in cells if cell["outputs"] or cell["execution_count"] is not None] == []


def test_a_computed_figure_that_begins_a_line_is_an_error() -> None:
    """Markdown would take the line for HTML."""
    for start in ("", "- ", "  "):
        with pytest.raises(ValueError, match="begins the line"):
            remade(Path("page.md"), f"There are\n{start}<!--= 2 + 2 -->4<!--/--> of them.\n")


@pytest.mark.parametrize("name", TEXTS)
def test_a_page_says_its_purpose_first_and_in_short_sentences(name: str) -> None:
    """The mean of its sentences is at most 20 words, without tables, lists of names and code."""
    prose = CODE.sub("code", re.sub(r"<!--.*?-->|\$\$.*?\$\$", "", TEXTS[name], flags=re.DOTALL))
    paragraphs = [
        part for part in re.split(r"\n\s*\n", prose) if not part.lstrip().startswith(("#", "|", "!", ":", "-"))
    ]
    sentences = re.split(r"(?<=[.!?:])\s+", " ".join(paragraphs))
    if name not in ("README.md", "index.md"):
        assert sentences[0].startswith("This page ")
    assert len(" ".join(sentences).split()) / len(sentences) <= 20
