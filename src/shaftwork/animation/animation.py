"""Moving pictures of a motion and of mode shapes: HTML, GIF and MP4."""

from __future__ import annotations

import io
import json
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from shaftwork.animation.turning import SPEEDS, train_of
from shaftwork.core.errors import ParameterError
from shaftwork.core.files import in_a_folder
from shaftwork.core.parameters import in_si
from shaftwork.results.lettering import lettered, replaced
from shaftwork.results.observer import Array, PhaseRow, Reader
from shaftwork.results.plotting import curve, new_figure, plain

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Complex = NDArray[np.complex128]
RATE = 20
"""Pictures per second."""
FORMATS = (".gif", ".mp4", ".html")
LARGEST_SWING = np.pi / 4
"""As shown, rad."""
PLAYER = Template("""<div class="shaftwork-animation"><img alt="moving picture" style="max-width: 100%"><br>
<button type="button">play / pause</button>
<input type="range" aria-label="picture" min="0" max="$last" value="0" style="width: 60%">
<script>
{
  const player = document.currentScript.parentElement, pictures = $pictures;
  const [image, slider, button] = ["img", "input", "button"].map(name => player.querySelector(name));
  let plays = true;
  const show = () => { image.src = pictures[slider.value]; };
  slider.oninput = () => { plays = false; show(); };
  button.onclick = () => { plays = !plays; };
  setInterval(() => { if (plays) { slider.value = (Number(slider.value) + 1) % pictures.length; show(); } }, $wait);
  show();
}
</script></div>
""")
"""The page that plays pictures."""
RADIUS = 0.4
"""Of a disc, as a share of the distance of two."""


@dataclass(frozen=True, eq=False)
class Animation:
    """A moving picture: shown in notebooks, `save` writes GIF, MP4 and HTML.

    Args:
        figure: in which it moves.
        count: of its pictures.
        draw: brings the figure to one of them, by its number.
    """

    figure: Figure
    count: int
    draw: Callable[[int], None]

    def save(self, path: str | Path) -> None:
        """Write it; the format follows from the end of the name: .gif, .html, or .mp4, for which ffmpeg is needed.

        Raises:
            ParameterError: another end, no such folder, or ffmpeg is not installed.
        """
        from matplotlib.animation import FFMpegWriter, PillowWriter

        path = in_a_folder(path)
        match path.suffix.lower():
            case ".html":
                path.write_text(self._html, encoding="utf-8")
            case ".gif":
                self._moving.save(path, writer=PillowWriter(fps=RATE))
            case ".mp4":
                if not FFMpegWriter.isAvailable():
                    raise ParameterError("MP4 needs the program ffmpeg, which is not installed. Take .gif or .html.")
                self._moving.save(path, writer=FFMpegWriter(fps=RATE))
            case _:
                raise ParameterError(f"A moving picture is no '{path.suffix}'. Take {', '.join(FORMATS)}.")

    @property
    def _moving(self) -> Any:
        from matplotlib.animation import FuncAnimation
        from matplotlib.backends.backend_agg import FigureCanvasAgg

        FigureCanvasAgg(self.figure)
        return FuncAnimation(self.figure, self._drawn, frames=self.count, interval=1000 / RATE, init_func=tuple)

    def _drawn(self, number: int) -> tuple[()]:
        self.draw(number)
        return ()

    @cached_property
    def _html(self) -> str:
        """The pictures with a button that plays them and a slider, without anything from elsewhere."""
        pictures = []
        for number in range(self.count):
            self.draw(number)
            stream = io.BytesIO()
            self.figure.savefig(stream, format="png", dpi=80)
            pictures.append(f"data:image/png;base64,{b64encode(stream.getvalue()).decode()}")
        return PLAYER.substitute(pictures=json.dumps(pictures), last=self.count - 1, wait=round(1000 / RATE))

    def _repr_html_(self) -> str:
        return self._html


@dataclass(frozen=True)
class _MotionPicture:
    """Brings the figure of a motion to a picture; a record, as functions within functions cannot be stored."""

    times: Array
    angles: Array
    shares: Array
    """Of the largest torque."""
    spokes: Sequence[Any]
    lines: Sequence[Any]
    cursor: Any
    title: Any
    words: tuple[str, str]
    phases: tuple[PhaseRow, ...]

    def __call__(self, number: int) -> None:
        t = self.times[number]
        turn_spokes(self.spokes, self.angles[number])
        for line, share in zip(self.lines, self.shares[number], strict=True):
            line.set_color(_colour(share))
        self.cursor.set_xdata([t, t])
        phase = next((row.name for row in self.phases if row.start <= t <= row.end), "")
        network, slowness = self.words
        self.title.set_text(_written("\n".join((f"{network}, t = {t:.3f} s", slowness, phase))))


@dataclass(frozen=True)
class _ModePicture:
    """Brings the figure of a mode to a picture."""

    amplitudes: Complex
    spokes: Sequence[Any]
    turns: float
    """Of the swing from one picture to the next."""

    def __call__(self, number: int) -> None:
        turn_spokes(self.spokes, (self.amplitudes * np.exp(2j * np.pi * self.turns * number)).real)


def animate(
    reader: Reader,
    names: Sequence[str],
    phases: Sequence[PhaseRow],
    span: tuple[float, float],
    seconds: float,
) -> Animation:
    """A motion as a moving picture; arguments as of `Solution.animate`."""
    count = pictures_of(seconds)
    train = train_of(reader.observer, SPEEDS[:1])
    if not train.nodes:
        raise ParameterError(f"Nothing in '{reader.title}' rotates, so there are no discs to show.")
    times = np.linspace(*span, count)
    samples = 20  # of a speed for each picture: its angle is integrated from them
    fine = np.linspace(*span, samples * (count - 1) + 1)
    shown = train.turning(fine, lambda name: reader.quantity(name)(fine), seconds)
    angles = shown.angles[::samples]
    figure = new_figure("Solution.animate()", max(6.0, 1.3 * len(train.nodes)), 4.6)
    discs, below = figure.subplots(2, 1, height_ratios=(3, 2))
    spokes = draw_discs(discs, [node.name for node in train.nodes])
    ends = [(a + RADIUS, b - RADIUS) for a, b in (part.nodes for part in train.joints)]
    lines = [discs.plot(places, [0.0, 0.0], linewidth=4.0, zorder=0)[0] for places in ends]
    torques = np.column_stack([reader.quantity(part.torque)(times) for part in train.joints] or [np.zeros((count, 0))])
    largest = np.abs(torques).max(initial=np.finfo(float).tiny)
    for name in names:
        below.plot(*curve(reader, name), linewidth=1.0, label=_written(f"{name} in {reader.unit(name)}"))
    below.set(xlim=span, xlabel="t in s")
    below.legend(loc="upper right", fontsize="small")
    cursor = below.axvline(times[0], color="black", linewidth=0.8)
    title = discs.set_title("", fontsize="small")

    draw = _MotionPicture(
        times, angles, torques / largest, spokes, lines, cursor, title, (reader.title, shown.words), tuple(phases)
    )
    draw(0)
    lettered(figure)
    return Animation(figure, count, draw)


def swinging(title: str, shapes: Mapping[str, complex], seconds: float) -> Animation:
    """A mode as a moving picture.

    Args:
        title: above it.
        shapes: complex amplitudes of the nodes by name, of which only the ratios count.
        seconds: how long it is shown.

    Raises:
        ParameterError: nothing rotates.
    """
    if not shapes:
        raise ParameterError(f"{title}: nothing rotates in it, so there are no discs to show.")
    count = pictures_of(seconds)
    figure = new_figure("Modes.animate()", max(6.0, 1.3 * len(shapes)), 2.8, replaced(title))
    spokes = draw_discs(figure.subplots(), tuple(shapes))
    amplitudes = np.array(list(shapes.values()))
    largest = np.abs(amplitudes).max() or 1.0
    swings = max(1, round(seconds / 2.0))  # which take 2 s, as eyes follow them
    draw = _ModePicture(LARGEST_SWING * amplitudes / largest, spokes, swings / count)
    draw(0)
    lettered(figure)
    return Animation(figure, count, draw)


def pictures_of(seconds: float) -> int:
    """How many pictures last so long.

    Raises:
        ParameterError: too few or too many.
    """
    lasting, longest = in_si("seconds", seconds, "s"), 2000 / RATE  # of 2000 pictures
    if not 0.1 <= lasting <= longest:
        raise ParameterError(f"seconds = {lasting:g} must be from 0.1 to {longest:g}.")
    return round(lasting * RATE)


def draw_discs(axes: Axes, names: Sequence[str]) -> list[Any]:
    """Discs in a row with their names; the spokes that turn."""
    from matplotlib.patches import Circle

    for number, name in enumerate(names):
        axes.add_patch(Circle((number, 0.0), RADIUS, facecolor="0.85", edgecolor="0.3"))
        axes.text(number, -RADIUS - 0.12, _written(name), ha="center", va="top", fontsize="small", rotation=20)
    axes.set(xlim=(-0.6, len(names) - 0.4), ylim=(-1.0, 0.6), aspect="equal")
    axes.set_axis_off()
    return [axes.plot([], [], color="0.1", linewidth=2.0)[0] for _ in names]


def turn_spokes(spokes: Sequence[Any], angles: Array) -> None:
    """Turn the spokes of discs to angles, counted from the top in the sense of the clock."""
    for number, (spoke, angle) in enumerate(zip(spokes, angles.tolist(), strict=True)):
        x, y = RADIUS * np.sin(angle), RADIUS * np.cos(angle)
        spoke.set_data([number - x, number + x], [-y, y])


def _written(text: str) -> str:
    """A text for a picture, in which names are no formulas and every letter can be drawn."""
    return plain(replaced(text))


def _colour(share: float) -> tuple[float, float, float]:
    """Grey without torque, red with the largest positive one, blue with the largest negative one."""
    strength = min(1.0, abs(share))
    rest = 0.7 * (1.0 - strength)
    return (0.7 + 0.3 * strength, rest, rest) if share > 0 else (rest, rest, 0.7 + 0.3 * strength)
