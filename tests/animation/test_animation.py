"""Moving pictures show true angles, slowed and enlarged by the factors that they name."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.font_manager import findfont
from matplotlib.ft2font import FT2Font
from PIL import Image

import shaftwork as sw
from shaftwork.animation.turning import FASTEST, TWIST, Train, Turning, train_of
from tests.reporting.test_reports import LOADED


def geared() -> sw.Solution:
    """Two discs on a shaft, and a third one behind a gear, with all angles recorded."""
    net = sw.Network("geared")
    net.add(sw.TorqueSource("motor", tau=10.0), "rotor")
    net.add(sw.Inertia("J1", J=2.0), "rotor")
    net.add(sw.Spring("shaft", c=1e3, d=1.0), "rotor", "pinion")
    net.add(sw.Inertia("J2", J=1.0), "pinion")
    net.add(sw.Gear("gear", ratio=3.0), "pinion", "wheel")
    net.add(sw.Inertia("J3", J=4.0), "wheel")
    return net.compile(angles=["J1", "J2", "J3"]).simulate(4.0, rtol=1e-10)


def turned(solution: sw.Solution, times: np.ndarray) -> tuple[Train, Turning]:
    train = train_of(solution.reader.observer)
    return train, train.turning(times, lambda name: solution.reader.quantity(name)(times), 4.0)


def test_angles_are_those_of_the_motion_slowed_and_twists_enlarged() -> None:
    solution = geared()
    times = np.linspace(0.0, 4.0, 1601)
    train, shown = turned(solution, times)
    assert [node.name for node in train.nodes] == ["rotor", "pinion", "wheel"]
    true = np.column_stack([solution.at(times)[f"{name}.phi"] for name in ("J1", "J2", "J3")])
    mean = true[:, :2].mean(axis=1)
    scale = np.abs(true).max()
    expected = mean / shown.slowed + shown.enlarged * (true[:, 0] - mean)
    np.testing.assert_allclose(shown.angles[:, 0], expected, atol=1e-6 * scale)  # of the integral
    np.testing.assert_allclose(shown.angles[:, 2], true[:, 2] / shown.slowed, atol=1e-6 * scale)
    twist = shown.angles[:, 0] - shown.angles[:, 1]
    np.testing.assert_allclose(twist, shown.enlarged * solution.at(times)["shaft.phi_rel"], atol=1e-9)  # read, rounding
    assert [(part.nodes, part.torque) for part in train.joints] == [((0, 1), "shaft.tau")]


def test_what_is_shown_is_of_a_size_that_can_be_seen() -> None:
    """Nothing turns faster than the eye can follow, and the factors are round, so that a softer shaft twists more."""
    solution = geared()
    _, shown = turned(solution, np.linspace(0.0, 4.0, 81))
    mean = shown.angles[:, :2].mean(axis=1)
    assert np.abs(np.diff(mean)).max() <= FASTEST * 4.0 / 81 * (1 + 1e-9)
    largest = np.abs(shown.angles[:, 0] - mean).max()
    assert TWIST / 2.5 <= largest <= TWIST * (1 + 1e-9)  # of 1, 2 and 5 neighbours differ by no more
    for factor in (shown.slowed, shown.enlarged):
        assert f"{factor:.0e}"[0] in "125"
        assert factor == pytest.approx(float(f"{factor:.0e}"), rel=1e-12)


def test_a_train_begins_with_the_twist_that_it_starts_with() -> None:
    net = sw.Network("wound up")
    net.add(sw.Inertia("J1", J=2.0), "rotor")
    net.add(sw.Spring("shaft", c=1e3, d=1.0), "rotor", "wheel")
    net.add(sw.Inertia("J2", J=1.0), "wheel")
    wound = net.simulate(1.0, initial={"shaft.phi_rel": 0.02})
    _, shown = turned(wound, np.linspace(0.0, 1.0, 401))
    assert shown.angles[0, 0] - shown.angles[0, 1] == pytest.approx(0.02 * shown.enlarged)


def test_files_hold_every_picture(tmp_path: Path) -> None:
    moving = geared().animate("shaft.tau", seconds=0.5)
    moving.save(tmp_path / "train.gif")
    with Image.open(tmp_path / "train.gif") as gif:
        assert gif.n_frames == moving.count == 10
    moving.save(tmp_path / "train.html")
    page = (tmp_path / "train.html").read_text(encoding="utf-8")
    assert page.count("data:image/png;base64") == 10
    assert LOADED.findall(page) == []


def test_a_mode_swings_with_its_shape() -> None:
    modes = sw.scenes.crane_train().modes()
    moving = modes.animate(2, seconds=2.0)
    spokes = moving.figure.axes[0].lines
    at_rest, turned = (_angles(moving, spokes, number) for number in (10, 0))
    names = [text.get_text() for text in moving.figure.axes[0].texts]
    shapes = np.array([modes.shapes[f"{name}.omega"][2].real for name in names])
    np.testing.assert_allclose(turned, np.pi / 4 * shapes / np.abs(shapes).max(), atol=1e-6)  # of complex shapes
    assert np.abs(at_rest).max() < np.abs(turned).max()
    with pytest.raises(sw.ParameterError, match="There is no mode 99"):
        modes.animate(99)


def _angles(moving: object, spokes: object, number: int) -> np.ndarray:
    moving.draw(number)  # type: ignore[attr-defined]
    ends = [(line.get_xdata(), line.get_ydata()) for line in spokes]  # type: ignore[attr-defined]
    return np.array([np.arcsin((x[1] - x[0]) / 0.8) for x, _ in ends])


def test_what_cannot_be_shown_is_refused(tmp_path: Path) -> None:
    solution = geared()
    with pytest.raises(sw.ParameterError, match="seconds"):
        solution.animate(seconds=1e6)
    with pytest.raises(sw.ParameterError, match=r"no \'\.avi\'"):
        solution.animate(seconds=0.5).save(tmp_path / "train.avi")
    net = sw.Network("hoist")
    net.add(sw.ForceSource("weight", f=-1.0), "hook")
    net.add(sw.Mass("load", m=1.0), "hook")
    with pytest.raises(sw.ParameterError, match="Nothing in 'hoist' rotates"):
        net.simulate(1.0).animate()
    with pytest.raises(sw.ParameterError, match="nothing rotates"):
        net.modes().animate(0)


@pytest.mark.parametrize("made", ["solution", "modes", "sweep"])
def test_notebooks_show_tables_and_no_markup_of_names(made: str) -> None:
    net = sw.Network("a <b> & c")
    net.add(sw.TorqueSource("motor", tau=1.0), "rotor")
    net.add(sw.Inertia("J", J=1.0), "rotor")
    shown = {
        "solution": lambda: net.simulate(1.0),
        "modes": net.modes,
        "sweep": lambda: sw.studies.sweep(net, {"J.J": [1.0, 2.0]}, t_end=1.0, measures=["max J.omega"]),
    }[made]()
    assert "a &lt;b&gt; &amp; c" in shown._repr_html_()


def named(letters: str) -> sw.Network:
    net = sw.Network(f"{letters} drive")
    net.add(sw.TorqueSource("motor", tau=10.0), f"rotor {letters}")
    net.add(sw.Inertia("J1", J=2.0), f"rotor {letters}")
    net.add(sw.Spring(letters, c=100.0, d=1.0), f"rotor {letters}", "wheel")
    net.add(sw.Inertia("J2", J=3.0), "wheel")
    return net


def test_letters_that_no_installed_font_has_are_their_numbers(tmp_path: Path) -> None:
    """Nothing warns of boxes; U+3106C is so rare that no usual font has it."""
    net = named("\U0003106c")
    moving = net.simulate(1.0).animate("\U0003106c.tau", seconds=0.1)
    moving.save(tmp_path / "train.gif")
    assert [text.get_text() for text in moving.figure.axes[0].texts] == ["rotor U+3106C", "wheel"]
    assert moving.figure.axes[0].get_title().startswith("U+3106C drive, t = ")
    swinging = net.modes().animate(1, seconds=0.1)
    swinging.save(tmp_path / "mode.gif")
    assert "U+3106C drive" in swinging.figure.get_suptitle()


def test_letters_are_drawn_in_an_installed_font_that_has_them(tmp_path: Path) -> None:
    """STIX comes with matplotlib as DejaVu does; the letter is one that it has besides."""
    there = {name: FT2Font(findfont(name)).get_charmap().keys() for name in ("STIXGeneral", "DejaVu Sans")}
    letter = next(chr(k) for k in sorted(there["STIXGeneral"] - there["DejaVu Sans"]) if chr(k).isprintable())
    moving = named(letter).simulate(1.0).animate(seconds=0.1)
    moving.save(tmp_path / "train.gif")
    name = moving.figure.axes[0].texts[0]
    assert name.get_text() == f"rotor {letter}"
    assert "DejaVu Sans" in name.get_fontfamily() != ["DejaVu Sans"]
