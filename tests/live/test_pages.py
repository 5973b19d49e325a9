"""A browser moves the sliders of a page, and sees what the library computes."""

from __future__ import annotations

import json
import os
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page, sync_playwright

import shaftwork as sw
from shaftwork.cli import main
from shaftwork.live.server import serving
from shaftwork.live.session import POINTS, Session
from shaftwork.scenes import SCENES

CHROMIUM = shutil.which("chromium")

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(
        CHROMIUM is None and "CI" not in os.environ, reason="needs chromium (Debian package); CI has it"
    ),
]


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield chromium
        chromium.close()


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    """One that takes no request to the internet and no error."""
    opened = browser.new_page(viewport={"width": 1300, "height": 900})
    opened.set_default_timeout(60_000)
    wrong: list[str] = []
    opened.on("console", lambda message: wrong.append(message.text) if message.type in ("error", "warning") else None)
    opened.on("pageerror", lambda error: wrong.append(str(error)))
    inside = ("http://127.0.0.1:", "file:", "data:", "blob:")
    opened.on("request", lambda request: None if request.url.startswith(inside) else wrong.append(request.url))
    yield opened
    opened.close()
    assert wrong == []


@pytest.fixture(scope="module")
def session() -> Session:
    return Session(SCENES["crane"])


@pytest.fixture(scope="module")
def address(session: Session) -> Iterator[str]:
    with serving(session) as address:
        yield address
    session.closing.clear()


SAID = """([name, said]) => {
  const wrong = document.querySelector(`input[type="text"][data-name="${name}"]`).parentElement.querySelector(".wrong");
  return wrong.textContent === said && wrong.hidden === (said === "");
}"""
SETTLED = "() => document.querySelectorAll('.stale').length === 0 && byId('results').dataset.set"


def settled(page: Page) -> dict[str, float]:
    """Wait until everything on a page is that of its values; these."""
    return json.loads(page.wait_for_function(SETTLED).json_value())  # type: ignore[no-any-return]


def move(page: Page, name: str, tick: int) -> None:
    page.locator(f'input[type="range"][data-name="{name}"]').fill(str(tick))


def enter(page: Page, name: str, text: str) -> None:
    field = page.locator(f'input[type="text"][data-name="{name}"]')
    field.fill(text)
    field.press("Enter")


def curve(page: Page, name: str) -> Any:
    """What is drawn of a quantity."""
    return page.evaluate("name => Array.from(byId('plot').data.find(one => one.name === name).y)", name)


def row(page: Page, table: str, first: str) -> list[float]:
    """The numbers of a row, as exact as the page has them."""
    return page.evaluate(  # type: ignore[no-any-return]
        """([table, first]) => [...byId(table).tBodies[0].rows]
           .find(row => [...row.cells].some(cell => cell.textContent === first))
           .querySelectorAll('[data-value]').values().map(cell => Number(cell.dataset.value)).toArray()""",
        [table, first],
    )


def test_a_slider_moves_curves_extremes_frequencies_phases_and_drawing_to_what_the_library_computes(
    page: Page, address: str
) -> None:
    page.goto(address)
    assert settled(page) == {}
    assert "token" not in page.url
    before, drawing = curve(page, "shaft.tau"), page.locator("#drawing").inner_html()
    move(page, "shaft.c", -250)  # half of the way to a quarter of the stiffness
    values = settled(page)
    assert values == {"shaft.c": pytest.approx(24206 / 2, rel=1e-3)}
    motion = SCENES["crane"]().simulate(10.0, parameters=values, t_eval=POINTS)
    assert curve(page, "shaft.tau") == motion["shaft.tau"].tolist() != before
    least, most = motion.min("shaft.tau"), motion.max("shaft.tau")
    assert row(page, "extremes", "shaft.tau")[1:] == [least, least.t, most, most.t]
    modes = motion_network(values).modes()
    assert row(page, "modes", "mode 1") == [modes.frequencies[0], modes.damping[0]]
    starts = page.evaluate("() => [...byId('phases').tBodies[0].rows].map(row => Number(row.cells[0].dataset.value))")
    assert starts == [phase.start for phase in motion.phases]
    assert page.locator("#drawing").inner_html() != drawing


def motion_network(values: dict[str, float]) -> sw.Network:
    """The crane with another stiffness."""
    net = SCENES["crane"]()
    net.replace(next(part for part in net.parts if part.name == "shaft").changed(c=values["shaft.c"]))
    return net


def test_a_value_that_cannot_be_shows_the_sentence_of_the_library_and_the_last_good_picture(
    page: Page, address: str
) -> None:
    page.goto(address)
    settled(page)
    before = curve(page, "J1.omega")
    field = page.locator('input[type="text"][data-name="J1.J"]')
    for text, said in {
        "-3": "Inertia 'J1': J = -3 must be at least 0.",
        "heavy": "Inertia 'J1': J = 'heavy' must be a number or a law, not str 'heavy'.",
    }.items():
        enter(page, "J1.J", text)
        page.wait_for_function(SAID, arg=["J1.J", said])
        assert page.locator("#message").is_hidden()
        assert field.get_attribute("aria-invalid") == "true"
        assert curve(page, "J1.omega") == before
    page.click("text=Start of the motion")
    enter(page, "J1.omega", "fast")
    page.wait_for_function(
        SAID, arg=["J1.omega", "the start value of 'J1.omega' = 'fast' must be a number, not str 'fast'."]
    )
    enter(page, "J1.J", "30")
    page.wait_for_function(SAID, arg=["J1.J", ""])
    enter(page, "J1.omega", "")
    page.wait_for_function(SAID, arg=["J1.omega", ""])
    assert settled(page) == {"J1.J": 30}
    assert field.get_attribute("aria-invalid") == "false"


def test_an_end_that_no_page_can_reach_is_named_and_the_page_goes_on(page: Page, address: str) -> None:
    page.goto(address)
    settled(page)
    for text, said in {
        "soon": "t_end = 'soon' must be a number, not str 'soon'.",
        "-1": "t_end = -1 must be a finite",
    }.items():
        page.fill("#end", text)
        page.press("#end", "Enter")
        page.wait_for_function(
            "said => byId('message').textContent.startsWith(said) && !byId('message').hidden", arg=said
        )
        assert page.get_attribute("#end", "aria-invalid") == "true"
    page.fill("#end", "5")
    page.press("#end", "Enter")
    page.wait_for_function("() => byId('message').hidden && shown.t.at(-1) === 5")


def test_a_start_value_changes_the_motion_as_in_simulate(page: Page, address: str) -> None:
    page.goto(address)
    settled(page)
    page.click("text=Start of the motion")
    enter(page, "J1.omega", "2")
    enter(page, "shaft.phi_rel", "0.01")
    settled(page)
    motion = SCENES["crane"]().simulate(10.0, initial={"J1.omega": 2.0, "shaft.phi_rel": 0.01}, t_eval=POINTS)
    assert curve(page, "shaft.tau") == motion["shaft.tau"].tolist()


def test_the_drawing_is_there_before_the_first_answer(page: Page, session: Session) -> None:
    """The server answers only after the page was looked at."""
    looked = threading.Event()
    answer = session.answer

    def later(*arguments: Any) -> Any:
        looked.wait(60)
        return answer(*arguments)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(session, "answer", later)
        with serving(session) as address:
            page.goto(address)
            assert page.locator("#drawing svg").is_visible()
            assert page.locator("#computing").is_visible()
            assert page.locator("#plot").is_hidden()
            looked.set()
            settled(page)
            assert page.locator("#computing").is_hidden()
            assert page.locator("#plot").is_visible()
    session.closing.clear()


def test_the_motion_plays_and_a_mode_swings(page: Page, address: str) -> None:
    page.goto(address)
    settled(page)
    picture = "() => byId('stage').toDataURL()"
    first = page.evaluate(picture)
    page.click("#play")
    page.wait_for_function("() => time() > 0.2")
    page.click("#play")
    assert page.evaluate(picture) != first
    assert "enlarged" in page.inner_text("#scale")
    page.check("#at")  # while the crane travels, both masses swing
    assert settled(page) == {}
    page.check('[aria-label="Swing mode 1"]')
    assert page.inner_text("#scale").startswith("mode 1 swings at 0.5 Hz in place of 5.67")
    swinging = page.evaluate(picture)
    page.wait_for_function("before => byId('stage').toDataURL() !== before", arg=swinging)


def test_files_are_saved_with_the_values_of_the_page(page: Page, address: str, tmp_path: Path) -> None:
    page.goto(address)
    enter(page, "J2.J", "70.5")
    settled(page)
    with page.expect_download() as saved:
        page.click('[data-file="model.toml"]')
    saved.value.save_as(tmp_path / "model.toml")
    parts = {part.name: part.values for part in sw.Network.load(tmp_path / "model.toml").parts}
    assert parts["J2"]["J"] == 70.5


def test_a_reference_stays_while_values_change(page: Page, address: str) -> None:
    page.goto(address)
    settled(page)
    before = curve(page, "shaft.tau")
    page.click("#keep")
    move(page, "J2.J", 200)
    settled(page)
    assert curve(page, "shaft.tau, reference") == before != curve(page, "shaft.tau")
    page.click("#reset")
    settled(page)
    assert curve(page, "shaft.tau") == before


def test_the_page_fits_on_a_telephone_and_every_control_has_a_name(page: Page, address: str) -> None:
    page.set_viewport_size({"width": 400, "height": 800})
    page.goto(address)
    settled(page)
    assert page.evaluate("() => document.documentElement.scrollWidth") <= 400
    nameless = page.evaluate(
        """() => [...document.querySelectorAll('input, button, canvas')]
           .filter(one => !(one.labels?.length || one.getAttribute('aria-label') || one.textContent.trim()))
           .filter(one => !one.closest('#plot')).map(one => one.outerHTML)"""
    )
    assert nameless == []


def test_a_page_without_a_server_has_answers_along_its_sliders(page: Page, tmp_path: Path, session: Session) -> None:
    file = tmp_path / "live.html"
    session.save(file, ["shaft.c", "J2.J"], (3, 5))
    page.goto(file.as_uri())
    assert settled(page) == {}
    assert page.locator('input[type="range"][data-name]').count() == 2
    move(page, "shaft.c", 0)
    enter(page, "J2.J", "120")  # the nearest answer is that of twice the inertia
    values = settled(page)
    assert values == {"shaft.c": pytest.approx(24206 / 4), "J2.J": pytest.approx(125.0)}
    motion = SCENES["crane"]().simulate(10.0, parameters=values, t_eval=POINTS)
    assert curve(page, "shaft.tau") == motion["shaft.tau"].tolist()
    assert row(page, "extremes", "shaft.tau")[3] == motion.max("shaft.tau")
    page.click("#play")
    page.wait_for_function("() => time() > 0.2")


def test_the_command_writes_a_live_page_beside_the_report(page: Page, tmp_path: Path) -> None:
    folder = tmp_path / "out"
    line = ["report", "crane-start", "--html", "--live", "shaft.c", "--t-end", "1", "--sections", "parts"]
    assert main([*line, "--out", str(folder)]) == 0
    assert {path.name for path in folder.iterdir()} == {"live.html", "report.html", "shaftwork.json"}
    page.goto((folder / "live.html").as_uri())
    assert settled(page) == {}
    move(page, "shaft.c", 20)
    assert settled(page) == {"shaft.c": 4 * 24206}
