"""Makes the pictures of the first page and of the live page; others are drawn by their examples (`generate.py`).

python -m docs.pictures             needs the extra `live`, playwright, chromium, pdflatex and pdftoppm

Each file says in its description what it was made of, `sources()`; the tests compare that with what the code says now.
"""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from matplotlib.image import imread, imsave
from PIL import Image
from playwright.sync_api import sync_playwright

from docs.generate import RESOLUTION, curves
from shaftwork import scenes
from shaftwork.live import Session, serving
from shaftwork.scenes.crane import WHEEL_RADIUS

PICTURES = Path(__file__).parent / "pictures"
EQUATIONS, START, LIVE = "crane-equations.png", "crane-start.png", "live.png"

COLOURS = 128
"""Of a photograph, which is then a third as large."""
MARGIN = 20
"""White pixels around what is printed."""

FRAME = r"""\documentclass[10pt]{article}
\usepackage{amsmath}
\usepackage[paperwidth=125mm,paperheight=%dmm,margin=5mm]{geometry}
\pagestyle{empty}
\setlength{\parindent}{0pt}
\begin{document}
%s
\end{document}
"""


def crane_start() -> Figure:
    """Torques and travel speed of the crane's start."""
    scene = scenes.SCENES["crane-start"]
    net = scene()
    sol = net.simulate(scene.t_end, t_eval=2601)
    figure = Figure(figsize=(6.6, 5.2), layout="constrained")
    torque, speed = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    torque.plot(sol.t, sol["shaft.tau"], linewidth=0.8, label="shaft")
    torque.plot(sol.t, sol["motor.tau"], linewidth=1.4, label="motor, at the wheel shaft")
    peak = sol.max("shaft.tau")
    torque.plot([peak.t], [peak], "o", markersize=4, color="black", label=f"largest: {peak:.1f} N m at {peak.t:.3f} s")
    torque.set_ylabel("torque in N m")
    torque.legend(frameon=False, loc="upper right")
    speed.plot(sol.t, WHEEL_RADIUS * sol["J2.omega"], linewidth=1.4, label="speed of the crane")
    speed.axhline(1.08, color="0.5", linewidth=0.8, linestyle="--", label="1.08 m/s, printed")
    speed.set_ylabel("speed in m/s")
    turns = next(part.values["ratio"] for part in net.parts if part.name == "motor") * 30 / np.pi / WHEEL_RADIUS
    of_motor = speed.secondary_yaxis("right", functions=(lambda v: v * turns, lambda n: n / turns))
    of_motor.set_ylabel("at the motor shaft in 1/min")
    speed.set_xlabel("t in s")
    speed.legend(frameon=False, loc="lower right")
    for axis in (torque, speed):
        axis.grid(alpha=0.3)
        axis.set_xlim(0.0, scene.t_end)
    return figure


def sources() -> dict[str, str]:
    """What each picture shows, as text: its LaTeX, or its curves."""
    return {
        EQUATIONS: scenes.crane_start().equations().latex(form="kirchhoff"),
        START: curves(crane_start()),
    }


def typeset(body: str, picture: Path, height: int = 150) -> None:
    """A LaTeX body as a picture, cut to what is printed on it.

    Args:
        body: LaTeX that needs amsmath.
        picture: the PNG file, with its ending.
        height: of the page in mm, enough for all of it.
    """
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "page.tex").write_text(FRAME % (height, body), encoding="utf-8")
        for command in (
            ("pdflatex", "-interaction=batchmode", "-halt-on-error", "page.tex"),
            ("pdftoppm", "-png", "-gray", "-singlefile", "-r", str(RESOLUTION), "page.pdf", "page"),
        ):
            subprocess.run(command, cwd=folder, check=True, stdout=subprocess.DEVNULL)  # noqa: S603 - fixed programs
        page = np.atleast_3d(imread(Path(folder, "page.png")))[..., 0]
    rows, columns = (np.flatnonzero((page < 1).any(axis=axis)) for axis in (1, 0))
    inside = page[: rows[-1] + MARGIN, max(0, columns[0] - MARGIN) : columns[-1] + MARGIN]
    imsave(picture, inside, cmap="gray", vmin=0, vmax=1, metadata={"Description": body})


def photograph(picture: Path) -> None:
    """The live page of the crane with another stiffness, beside the curves of before."""
    with serving(Session(scenes.SCENES["crane"])) as address, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1000, "height": 920})
        page.goto(address)
        page.wait_for_selector("#drawing svg")
        page.click("#keep")
        page.locator('input[type="range"][data-name="shaft.c"]').fill("-300")
        page.locator("#time").fill("672")
        page.wait_for_selector(".stale", state="attached")
        page.wait_for_function("() => !document.querySelector('.stale')")
        page.screenshot(path=picture)
        browser.close()
    Image.open(picture).quantize(COLOURS).save(picture, optimize=True)


def main() -> None:
    """Write all pictures."""
    PICTURES.mkdir(exist_ok=True)
    texts = sources()
    crane_start().savefig(PICTURES / START, dpi=RESOLUTION, metadata={"Description": texts[START]})
    typeset(texts[EQUATIONS], PICTURES / EQUATIONS)
    photograph(PICTURES / LIVE)


if __name__ == "__main__":
    main()
