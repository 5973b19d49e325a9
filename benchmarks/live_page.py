"""How many updates a second does a live page have, and what does one cost?

Run `python -m benchmarks.live_page`. CPU: process time of one answer, median, split into the run, the reading of all
curves, and JSON. Updates: a slider of the page in chromium is moved without a break for some seconds; the page asks
anew as soon as an answer is there. Server, browser and whatever else the machine does share its cores.
"""

from __future__ import annotations

import json
import os
import shutil
import statistics
import time
from collections.abc import Callable, Iterator

from playwright.sync_api import sync_playwright

from shaftwork.live.server import serving
from shaftwork.live.session import POINTS, Session
from shaftwork.scenes import SCENES

MOVED = {"crane-start": "shaft.c", "crane": "shaft.c", "six-phases": "shaft.gap", "excavator": "shaft.c"}
"""Scenes, and the value that is changed in each."""
ROUNDS, SECONDS = 60, 6.0
DRAG = """async ([name, seconds]) => {
  const slider = document.querySelector(`input[type="range"][data-name="${name}"]`);
  const drawn = [];
  const duration = () => Number(byId("state").textContent.match(/drawn in (\\d+) ms/)[1]);
  const shown = new MutationObserver(() => drawn.push(duration()));
  shown.observe(byId("state"), { childList: true });
  const end = performance.now() + 1000 * seconds;
  for (let tick = -400; performance.now() < end; tick = tick < 400 ? tick + 3 : -400) {
    slider.value = tick;
    slider.dispatchEvent(new Event("input"));
    await new Promise(resolve => setTimeout(resolve, 5));
  }
  return drawn;
}"""
"""Moves a slider in the page, and tells how long each update took to draw, in ms."""


def cpu_of(action: Callable[[float], object]) -> float:
    """Median CPU in ms of an action with another factor for the value each time."""
    times = []
    for number in range(ROUNDS):
        start = time.process_time()
        action(0.9 + 0.2 * number / ROUNDS)
        times.append(1e3 * (time.process_time() - start))
    return statistics.median(times)


def costs(session: Session, name: str) -> tuple[float, float, float]:
    """CPU in ms of an answer: the run, the reading, JSON."""
    value = session.sliders[name].value
    run = cpu_of(lambda f: session.model.simulate(session.t_end, t_eval=POINTS, parameters={name: f * value}))
    whole = cpu_of(lambda f: session.answer({"set": {name: f * value * 1.001}}))
    answer = session.answer({"set": {name: value}})
    return run, whole - run, cpu_of(lambda _: json.dumps(answer, allow_nan=False))


def drawn(session: Session, name: str) -> list[float]:
    """How long each update of a page took to draw, in ms, while a slider moved."""
    with serving(session) as address, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1300, "height": 900})
        page.goto(address)
        page.wait_for_selector("#drawing svg")
        times: list[float] = page.evaluate(DRAG, [name, SECONDS])
        browser.close()
    return times


def rows() -> Iterator[str]:
    """The table in Markdown."""
    yield "| scene | run | read | JSON | drawn in the browser | updates a second |"
    yield "|---|---|---|---|---|---|"
    for scene, name in MOVED.items():
        session = Session(SCENES[scene])
        run, read, text = costs(session, name)
        times = drawn(session, name)
        cells = (f"{run:.1f}", f"{read:.1f}", f"{text:.1f}", f"{statistics.median(times):.0f}")
        yield f"| `{scene}` | {' | '.join(cells)} | {len(times) / SECONDS:.0f} |"


if __name__ == "__main__":
    load = os.getloadavg()[0]
    print(f"CPU in ms of an answer, {POINTS} times; {os.cpu_count()} cores, on which {load:.1f} programs ran before:\n")
    print("\n".join(rows()))
