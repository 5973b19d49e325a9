"""Drawings, read back: nothing overlaps, and every connection of the network is there and no other."""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import combinations, pairwise, permutations
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

import shaftwork as sw
from shaftwork.drawing.canvas import Drawing, DrawnGroup
from shaftwork.drawing.texts import box_of
from shaftwork.scenes import SCENES
from tests.properties.examples import network_of
from tests.strategies import Network, networks

Box = tuple[float, float, float, float]
"""Left, bottom, right, top."""
Point = tuple[float, float]
Segment = tuple[Point, Point]
NEAR = 0.5
"""Points, in which a line that ends at a symbol may miss it: half of a thin line."""


def boxes_of(group: DrawnGroup) -> Iterator[Box]:
    """The box of a symbol and those of its texts, but for letters within the symbol."""
    xs = [x + r for stroke in group.strokes for x, _ in stroke.points for r in (-stroke.radius, stroke.radius)]
    ys = [y + r for stroke in group.strokes for _, y in stroke.points for r in (-stroke.radius, stroke.radius)]
    symbol = min(xs), min(ys), max(xs), max(ys)
    yield symbol
    yield from (box for box in map(box_of, group.texts) if not inside(box, symbol))


def inside(box: Box, other: Box) -> bool:
    return other[0] <= box[0] and other[1] <= box[1] and box[2] <= other[2] and box[3] <= other[3]


def meet(box: Box, other: Box) -> bool:
    return box[0] < other[2] and other[0] < box[2] and box[1] < other[3] and other[1] < box[3]


def crosses(segment: Segment, box: Box, margin: float) -> bool:
    """Whether an upright or level line meets a box with a margin around it."""
    (x1, y1), (x2, y2) = segment
    line = min(x1, x2), min(y1, y2), max(x1, x2), max(y1, y2)
    grown = box[0] - margin, box[1] - margin, box[2] + margin, box[3] + margin
    return line[0] <= grown[2] and grown[0] <= line[2] and line[1] <= grown[3] and grown[1] <= line[3]


SVG = "{http://www.w3.org/2000/svg}"
NUMBER = re.compile(r"-?[\d.]+")


def points_of(shape: ET.Element) -> list[Point]:
    """The corners of a path, the ends of an arc, or the corners of the square around a circle; y points down."""
    if shape.tag == f"{SVG}circle":
        x, y, r = (float(shape.get(key, "")) for key in ("cx", "cy", "r"))
        return [(x + dx, y + dy) for dx in (-r, r) for dy in (-r, r)]
    path = re.sub(r"A\S+ \S+ \S+ \S+ \S+", "", shape.get("d", ""))
    numbers = [float(text) for text in NUMBER.findall(path)]
    return list(zip(numbers[::2], numbers[1::2], strict=True))


@dataclass
class Wires:
    """The lines of a node, and the corners of its marks with the name beside each."""

    lines: list[Segment] = field(default_factory=list)
    heads: list[list[Point]] = field(default_factory=list)
    names: list[str] = field(default_factory=list)


def read_back(drawing: Drawing) -> tuple[dict[str, Wires], dict[str, list[Box]]]:
    """The wires of each node, and the boxes of the symbols of each part, from the SVG alone."""
    wires: dict[str, Wires] = {}
    boxes: dict[str, list[Box]] = defaultdict(list)
    for group in ET.fromstring(drawing.svg).iter(f"{SVG}g"):  # noqa: S314 (our own)
        name = group.get("id", "").partition(":")[2]
        shapes = [shape for shape in group if shape.tag in (f"{SVG}path", f"{SVG}circle")]
        if name.startswith("node "):
            lines = [pair for shape in shapes if shape.get("fill") == "none" for pair in pairwise(points_of(shape))]
            heads = [points_of(shape) for shape in shapes if shape.tag == f"{SVG}path" and shape.get("fill") != "none"]
            names = ["".join(run.text or "" for run in text) for text in group.iter(f"{SVG}text")]
            wires[name.removeprefix("node ")] = Wires(lines, heads, names)
        elif name.startswith("part "):
            xs, ys = zip(*(point for shape in shapes for point in points_of(shape)), strict=True)
            boxes[name.removeprefix("part ")].append((min(xs), min(ys), max(xs), max(ys)))
    return wires, boxes


def pieces_of(lines: list[Segment]) -> list[list[Segment]]:
    """Lines that belong together, where the end of one lies on another."""
    pieces, left = [], list(lines)
    while left:
        piece = [left.pop()]
        for line in piece:
            touching = [
                other
                for other in left
                if any(crosses((p, p), box_around(line), 0.1) for p in other)
                or any(crosses((p, p), box_around(other), 0.1) for p in line)
            ]
            piece += touching
            left = [other for other in left if other not in touching]
        pieces.append(piece)
    return pieces


def is_one(node: str, wires: Wires) -> bool:
    """Whether the lines of a node are one, or each piece of them ends at its name."""
    pieces = pieces_of(wires.lines)
    heads = [(min(xs), min(ys), max(xs), max(ys)) for xs, ys in (zip(*head, strict=True) for head in wires.heads)]
    marked = [piece for piece in pieces if any(crosses(line, head, 0.1) for line in piece for head in heads)]
    named = len(wires.names) == len(wires.heads) and set(wires.names) <= {node}
    return named and (len(pieces) <= 1 or len(marked) == len(pieces))


def box_around(segment: Segment) -> Box:
    (x1, y1), (x2, y2) = segment
    return min(x1, x2), min(y1, y2), max(x1, x2), max(y1, y2)


def check(net: sw.Network, *, as_circuit: bool, expected: dict[str, set[str]], analogy: str = "force-current") -> None:
    drawing = net.draw(as_circuit=as_circuit, analogy=analogy, values=True)
    parts = [group for group in drawing.groups if group.name.startswith("part ")]
    named = [box for group in drawing.groups if group.name.startswith("node ") for box in map(box_of, group.texts)]
    boxes = [*named, *(box for group in parts for box in boxes_of(group))]
    overlapping = [(a, b) for a, b in combinations(boxes, 2) if meet(a, b)]
    assert not overlapping
    wires, symbols = read_back(drawing)
    assert set(symbols) == {part for part, nodes in expected.items() if nodes}
    for node, lines in wires.items():
        assert is_one(node, lines), node
    for (_, one), (_, other) in permutations(wires.items(), 2):
        assert not [(s, t) for s in one.lines for p in s for t in other.lines if crosses((p, p), box_around(t), 0.1)]
    for part, places in symbols.items():
        touched = {node for node, each in wires.items() for box in places for s in each.lines if crosses(s, box, NEAR)}
        assert touched == expected[part], part
    texts = [*named, *(box for group in parts for box in map(box_of, group.texts))]
    segments = [s for group in drawing.groups if group.name.startswith("node ") for stroke in group.strokes
                if not stroke.radius for s in pairwise(stroke.points)]  # fmt: skip
    assert not [(s, box) for s in segments for box in texts if crosses(s, box, -NEAR)]


def nodes_of(net: sw.Network) -> dict[str, set[str]]:
    graph = net.graph()
    ends = {part.name: {part.nodes[port.name] for port in part.component.ports} for part in graph.parts}
    return {name: {graph.node_name(node) for node in nodes if node >= 0} for name, nodes in ends.items()}


@pytest.mark.parametrize("as_circuit", [False, True])
@pytest.mark.parametrize("name", list(SCENES))
def test_the_drawing_of_a_scene_has_its_connections_and_no_overlap(name: str, as_circuit: bool) -> None:  # noqa: FBT001
    net = SCENES[name]()
    check(net, as_circuit=as_circuit, expected=nodes_of(net))


@given(networks(min_parts=5, max_inertias=20), st.booleans())
def test_the_drawing_of_a_random_network_has_its_connections_and_no_overlap(
    pieces: Network,
    as_circuit: bool,  # noqa: FBT001
) -> None:
    net = network_of(pieces)
    check(net, as_circuit=as_circuit, expected=nodes_of(net))


@given(networks(min_parts=5, max_inertias=12))
def test_the_drawing_of_a_dual_has_its_connections_and_no_overlap(pieces: Network) -> None:
    net = network_of(pieces)
    try:
        dual = net.dual()
    except sw.NetworkError:
        return
    check(net, as_circuit=True, expected=nodes_of(dual), analogy="force-voltage")


@pytest.mark.parametrize("form", [{}, {"as_circuit": True}, {"as_circuit": True, "analogy": "force-voltage"}])
@pytest.mark.parametrize("width", [500.0, 680.0])
def test_a_chain_of_a_hundred_inertias_stays_within_the_width(form: dict[str, Any], width: float) -> None:
    left, _, right, _ = sw.scenes.shaft_chain(m=100).draw(values=True, width=width, **form).size
    assert right - left <= width


def test_with_infinite_width_a_chain_is_one_row_without_marks() -> None:
    drawing = sw.scenes.shaft_chain(m=30).draw(width=math.inf)
    assert len({group.strokes[0].points[0][1] for group in drawing.groups if group.name.startswith("part J")}) == 1
    assert not any(group.texts for group in drawing.groups if group.name.startswith("node "))


def test_a_node_from_which_much_hangs_goes_on_in_the_next_row() -> None:
    net = sw.Network("twenty loads")
    net.add(sw.Inertia("J", J=1.0), "rotor")
    for k in range(20):
        net.add(sw.Damper(f"load {k}", d=1.0), "rotor")
    check(net, as_circuit=False, expected=nodes_of(net))
    left, _, right, _ = net.draw(values=True).size
    assert right - left <= 680.0


@pytest.mark.parametrize("width", [0.0, -1.0, math.nan, "wide"])
def test_a_width_that_is_none_is_refused(width: Any) -> None:
    with pytest.raises(sw.ParameterError, match=r"width = .* must be a number of points above 0"):
        sw.scenes.crane().draw(width=width)


def planetary() -> sw.Network:
    net = sw.Network("planetary gear")
    net.add(sw.PlanetaryGear("gear", ratio=3.0), "sun", "carrier", "ring")
    for node in ("sun", "carrier", "ring"):
        net.add(sw.Inertia(f"J {node}", J=1.0), node)
        net.add(sw.Damper(f"d {node}", d=1.0), node)
    return net


def test_a_planetary_gear_is_a_transformer_with_three_windings_each_at_its_node() -> None:
    net = planetary()
    check(net, as_circuit=True, expected=nodes_of(net))
    (group,) = [group for group in net.draw(as_circuit=True).groups if group.name == "part gear"]
    assert [text.words for text in group.texts] == ["sun", "ring", "carrier", r"$i_{\mathrm{gear}}$"]
    half_turns = [stroke for stroke in group.strokes if stroke.radius and stroke.angles != (0.0, 360.0)]
    assert len(half_turns) == 3 * 3


def test_the_transformers_of_a_planetary_gear_in_the_dual_have_their_own_ratios() -> None:
    """The sun has 1 turn, the ring 3 and the carrier 1 + 3 (Willis)."""
    drawing = planetary().draw(as_circuit=True, analogy="force-voltage")
    words = {group.name: [text.words for text in group.texts] for group in drawing.groups}
    ratios = {line for name in words if name.startswith("part gear ") for line in words[name] if " : " in line}
    assert ratios == {"0.33333 : 1", "0.25 : 1"}


@pytest.mark.parametrize("ends", [("a", "b", "c", "d"), ("a", "ground", "c", "d"), ("a", "b", "ground", "d")])
def test_a_transformer_with_floating_ends_has_two_coils_at_its_nodes(ends: tuple[str, ...]) -> None:
    net = sw.Network("transformer")
    net.add(sw.Transformer("T", ratio=2.0), *ends)
    for node in dict.fromkeys(ends):
        if node != "ground":
            net.add(sw.Capacitor(f"C {node}", C=1.0), node, "ground")
    check(net, as_circuit=True, expected=nodes_of(net))
    (group,) = [group for group in net.draw(as_circuit=True).groups if group.name == "part T"]
    assert len([stroke for stroke in group.strokes if stroke.radius and stroke.angles != (0.0, 360.0)]) == 2 * 3


def test_a_dual_has_the_letters_of_its_drive_train() -> None:
    net = sw.scenes.shaft_chain(m=2)
    words = {group.name: [text.words for text in group.texts] for group in
             net.draw(as_circuit=True, analogy="force-voltage").groups}  # fmt: skip
    assert words["part motor"] == [r"$\tau_{e}$"]
    assert words["part J1"] == ["$J_{1}$"]
    assert words["part c1"] == ["$1/c_{1}$"]


def test_an_analogy_that_is_none_or_no_circuit_is_refused() -> None:
    net = sw.scenes.shaft_chain(m=2)
    with pytest.raises(sw.ParameterError, match="must be 'force-current' or 'force-voltage'"):
        net.draw(as_circuit=True, analogy="impedance")  # type: ignore[arg-type]
    with pytest.raises(sw.ParameterError, match="as_circuit=True"):
        net.draw(analogy="force-voltage")


@pytest.mark.parametrize(
    ("ending", "begins"), [("svg", b"<?xml"), ("pdf", b"%PDF"), ("png", b"\x89PNG"), ("tex", b"\\begin{tikz")]
)
def test_a_drawing_is_written_in_each_format(tmp_path: Path, ending: str, begins: bytes) -> None:
    path = tmp_path / f"crane.{ending}"
    sw.scenes.crane().draw(values=True).save(path)
    assert path.read_bytes().startswith(begins)


def test_equal_networks_give_equal_files() -> None:
    assert sw.scenes.crane().draw().svg == sw.scenes.crane().draw().svg


def test_another_end_of_a_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(sw.ParameterError, match=r"no '\.gif'. Take \.svg, \.pdf, \.png, \.tex"):
        sw.scenes.crane().draw().save(tmp_path / "crane.gif")


@pytest.mark.parametrize("ending", ["png", "tex"])
def test_a_file_that_no_program_could_read_is_refused(tmp_path: Path, ending: str) -> None:
    drawing = sw.scenes.shaft_chain(m=600).draw(values=True, width=300.0)
    with pytest.raises(sw.ParameterError, match=rf"pt long, and a file \.{ending} may have .* choose a width="):
        drawing.save(tmp_path / f"chain.{ending}")


def test_a_phase_is_drawn_with_contacts_and_its_words() -> None:
    net = sw.scenes.six_phases()
    drawing = net.draw(as_circuit=True, phase=net.start_phase())
    words = {group.name: [text.words for text in group.texts] for group in drawing.groups}
    assert words["part brake"] == ["brake", "released"]
    assert words["part load"] == ["load", "stuck"]


def test_a_locked_brake_is_a_closed_contact_and_an_open_gap_a_break() -> None:
    """The line between the rings of a closed contact goes on straight, that of a break is slanted."""
    drawing = sw.scenes.six_phases().draw(as_circuit=True, phase="brake locked, shaft open, load stuck")
    lines = {group.name: group.strokes[2] for group in drawing.groups if group.name in ("part brake", "part shaft")}
    (x1, _), (x2, _) = lines["part brake"].points
    (_, y1), (_, y2) = lines["part shaft"].points
    assert x1 == x2  # it hangs
    assert y1 != y2  # it lies


@pytest.mark.parametrize(("words", "touching"), [("locked", True), ("released", False)])
def test_the_plates_of_a_brake_touch_in_the_drive_train_where_it_is_locked(words: str, touching: bool) -> None:  # noqa: FBT001
    drawing = sw.scenes.six_phases().draw(phase=f"brake {words}, shaft open, load stuck")
    (brake,) = [group for group in drawing.groups if group.name == "part brake"]
    upper, lower = ([y for _, y in stroke.points] for stroke in brake.strokes if stroke.fill is not None)
    assert (min(upper) == max(lower)) is touching


@pytest.mark.parametrize("as_circuit", [False, True])
@pytest.mark.parametrize("name", [name for name in SCENES if SCENES[name]().start_phase()])
def test_the_modes_at_the_start_of_a_scene_stand_beside_its_parts(name: str, as_circuit: bool) -> None:  # noqa: FBT001
    net = SCENES[name]()
    phase = net.start_phase()
    groups = {group.name: group for group in net.draw(as_circuit=as_circuit, phase=phase).groups if group.texts}
    for words in phase.split(", "):
        part, _, mode = words.partition(" ")
        if f"part {part}" in groups:  # a machine has several elements with modes of their own
            assert mode in {text.words for text in groups[f"part {part}"].texts}


def test_a_network_that_cannot_be_assembled_has_no_picture_and_an_error_that_says_why() -> None:
    net = sw.Network("torque on nothing")
    net.add(sw.TorqueSource("motor", tau=1.0), "rotor")
    assert net._repr_html_() is None
    with pytest.raises(sw.NetworkError):
        net.draw()


def test_a_notebook_shows_the_drawing() -> None:
    assert sw.scenes.crane()._repr_html_().startswith("<svg")


@pytest.mark.parametrize("scene", ["six-phases", "ship-line"])
def test_the_dual_of_open_gaps_and_of_shafts_that_are_no_chains_is_drawn(scene: str) -> None:
    """A gap is open in the first modes, so its branch is in no equation there; a spectral shaft has no parts inside."""
    net = sw.scenes.SCENES[scene]()
    check(net, as_circuit=True, expected=nodes_of(net.dual()), analogy="force-voltage")
