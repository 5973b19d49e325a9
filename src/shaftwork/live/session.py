"""A session: a network compiled once, which answers what a page asks of it. It knows no server."""

from __future__ import annotations

import threading
import time
import warnings
from base64 import b64encode
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from shaftwork.core.errors import ShaftworkError, SimulationError
from shaftwork.core.notices import FILTERS
from shaftwork.core.screen import MOST_MODES, MOST_SIGNALS
from shaftwork.frequency.exact_networks import exact_shafts
from shaftwork.frequency.natural_modes import Modes
from shaftwork.live.page_requests import checked
from shaftwork.live.sliders import Slider, sliders_of
from shaftwork.live.stage import Stage, stage_of
from shaftwork.pipeline.arguments import checked_parameters
from shaftwork.pipeline.network import Network, network_of, with_values
from shaftwork.results.observer import Array
from shaftwork.results.plotting import grouped
from shaftwork.results.solution import Solution
from shaftwork.scenes.catalog import Scene

POINTS = 600
"""Output times of a motion: as many as a plot on a screen has room for."""
END = 10.0
"""End of the motion of a network without a scene, s."""


class Session:
    """A network that answers a page: values of parameters in, curves, extremes, frequencies and a drawing out.

    Args:
        subject: a network, or a scene, whose title, end time and signals are taken.
        t_end: end of the motion, s; by default that of the scene, or 10.
        signals: quantities to draw; by default those of the scene, or the first states.

    Raises:
        NetworkError: the network cannot be assembled; lists every reason.
        SimulationError: it cannot be simulated as it is.
        SignalError: there is no such quantity.

    Examples:
        >>> import shaftwork as sw
        >>> session = sw.live.Session(sw.scenes.SCENES["crane-start"])
        >>> session.answer({"set": {"J2.J": 100.0}, "want": ["extremes"]})["extremes"][0]["name"]
        'shaft.tau'
    """

    def __init__(
        self, subject: Network | Scene, *, t_end: float | None = None, signals: Sequence[str] | None = None
    ) -> None:
        scene = subject if isinstance(subject, Scene) else None
        self.network = scene() if scene else network_of(subject)
        self.scene = scene
        """What it is, where it is one."""
        self.t_end = t_end if t_end is not None else scene.t_end if scene else END
        self.closing = threading.Event()
        """Set to end what is being computed."""
        self.model = self.network.compile()
        self._last: tuple[tuple[Any, ...], Solution] | None = None
        motion, _ = self._motion({}, self.t_end)
        states = tuple(name for name in motion.states if name in motion)[:MOST_SIGNALS]
        self.signals = tuple(signals if signals is not None else scene.signals if scene else states)
        for name in self.signals:
            motion.reader.unit(name)  # refuses one that is not there

    @property
    def title(self) -> str:
        """Of the page."""
        title = self.scene.title if self.scene else self.network.name
        return title[:1].upper() + title[1:]

    @cached_property
    def sliders(self) -> Mapping[str, Slider]:
        """What can be changed, by name."""
        return sliders_of(self.model)

    @cached_property
    def stage(self) -> Stage:
        """What the page moves."""
        return stage_of(self.network.graph(), self._motion({}, self.t_end)[0].names)

    @cached_property
    def setup(self) -> dict[str, Any]:
        """What a page must know before it asks: title, sliders, axes of the plot, the train that it moves."""
        motion, _ = self._motion({}, self.t_end)
        units = {name: motion.reader.unit(name) for name in self.signals}
        axes = grouped({name: (motion.t, motion[name]) for name in self.signals}, units)
        return {
            "title": self.title,
            "source": self.scene.source if self.scene else "",
            "t_end": self.t_end,
            "sliders": [slider.described() for slider in self.sliders.values()],
            "axes": [{"unit": unit, "signals": names} for unit, names in axes],
            "stage": self.stage.described(),
        }

    def answer(self, request: Mapping[str, Any]) -> dict[str, Any]:
        """What a page shows for values of parameters, as plain data for JSON.

        Args:
            request: "set", values by "part.parameter" in SI, those of the network elsewhere; "want", some of "curves",
                "extremes", "modes" and "drawing" (by default the curves, which take the least time); "t_end", s; "at",
                the time in s of the motion about which modes are, by default rest.

        Returns:
            By what is wanted: "t" and "curves", (k,) doubles as plotly takes them; "phases"; "extremes"; "modes";
            "drawing", SVG. Always "milliseconds" and "warnings". Or "error", what the library says to values that
            cannot be.
        """
        with FILTERS, warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                answer = self._answer(checked(request))
            except ShaftworkError as error:
                return {"error": str(error)}
        return answer | {"warnings": list(dict.fromkeys(str(one.message) for one in caught))}

    def _answer(self, request: Mapping[str, Any]) -> dict[str, Any]:
        values, wanted = request["set"], request["want"]
        motion, simulated = self._motion(values, request.get("t_end", self.t_end))
        start, answer = time.perf_counter(), dict[str, Any]()
        if "curves" in wanted:
            answer |= self._curves(motion)
        reading = time.perf_counter() - start
        if "extremes" in wanted:
            answer["extremes"] = [self._extreme(motion, name) for name in self.signals]
        if "modes" in wanted:
            answer |= self._modes(values, motion, request.get("at"))
        if "drawing" in wanted:
            svg = with_values(self.network, values).draw(values=True).svg
            answer["drawing"] = svg[svg.index("<svg") :]
        return answer | {"milliseconds": {"simulate": 1e3 * simulated, "read": 1e3 * reading}}

    def _motion(self, values: Mapping[str, Any], t_end: Any) -> tuple[Solution, float]:
        """The motion, and the seconds that it took; the last one is kept."""
        key = (t_end, *values.items())
        if self._last is not None and self._last[0] == key:
            return self._last[1], 0.0
        start = time.perf_counter()
        motion = self.model.simulate(t_end, t_eval=POINTS, parameters=values, progress=self._go_on)
        self._last = key, motion
        return motion, time.perf_counter() - start

    def _go_on(self, reached: float) -> None:
        if self.closing.is_set():
            raise SimulationError(f"The session was closed at t = {reached:g} s of the motion.")

    def _curves(self, motion: Solution) -> dict[str, Any]:
        curves = {name: motion[name] for name in self.signals}
        for name in self.stage.signals:  # a spring without stiffness has no twist that is read
            curves.setdefault(name, motion[name] if name in motion else np.zeros_like(motion.t))
        unbounded = [name for name, values in curves.items() if not np.isfinite(values).all()]
        if unbounded:
            raise SimulationError(
                f"{unbounded[0]} has no finite value at some time of the motion. Give its law a finite slope, or draw "
                "other signals."
            )
        return {
            "t": _doubles(motion.t),
            "curves": {name: _doubles(_worst(values)) for name, values in curves.items()},
            "phases": [{"start": row.start, "end": row.end, "modes": dict(row.modes)} for row in motion.phases],
            "engine": motion.engine,
        }

    @staticmethod
    def _extreme(motion: Solution, name: str) -> dict[str, Any]:
        row = motion.extremes.row(name)
        return {
            "name": name,
            "unit": row.least.unit,
            "min": float(row.least),
            "t_min": row.least.t,
            "max": float(row.most),
            "t_max": row.most.t,
        }

    def _modes(self, values: Mapping[str, Any], motion: Solution, at: float | None) -> dict[str, Any]:
        """The modes about rest, or about a time of the motion; where there are none, why."""
        try:
            modes = self._modes_about(values, None if at is None else motion.at([float(at)]))
        except ShaftworkError as error:
            return {"modes": [], "without modes": str(error)}
        shapes = np.array([modes.shapes[node["speed"]] for node in self.stage.nodes], dtype=complex)
        shapes = shapes.reshape(len(self.stage.nodes), len(modes))
        return {
            "modes": [
                {
                    "name": name,
                    "frequency": frequency,
                    "damping": damping,
                    "node": node,
                    "shape": [[float(one.real), float(one.imag)] for one in shapes[:, k]],
                }
                for k, (name, frequency, damping, _, node) in enumerate(modes.table[:MOST_MODES])
            ]
        }

    def _modes_about(self, values: Mapping[str, Any], point: Solution | None) -> Modes:
        if exact_shafts(self.model.netlist, every=False):  # waves are in no matrix
            return with_values(self.network, values).modes(point)
        return self.model.linearize(point, parameters=values).modes()

    def changed(self, values: Mapping[str, Any]) -> Network | Scene:
        """The network with other values, as the scene where it is one: to be saved, reported, or opened anew.

        Raises:
            ParameterError: there is no such parameter, or a value is not admissible.
        """
        network = with_values(self.network, checked_parameters(self.model.netlist, values))
        return network if self.scene is None else replace(self.scene, build=lambda: network)

    def page(self, sliders: Sequence[str], counts: Sequence[int] = ()) -> str:
        """A page of HTML that needs no server: answers are computed before, along one or two sliders.

        Args:
            sliders: one or two parameters, "part.parameter".
            counts: of values along each; by default 21 of one, 11 of each of two.

        Raises:
            ParameterError: there is no such parameter, or there are more than two.
            MissingExtraError: plotly is not installed (extra `live`).
        """
        from shaftwork.live.page import static_page

        return static_page(self, sliders, counts)

    def save(self, path: str | Path, sliders: Sequence[str], counts: Sequence[int] = ()) -> None:
        """Write the page of `page` to a file."""
        Path(path).write_text(self.page(sliders, counts), encoding="utf-8")


def _worst(values: Array) -> Array:
    """(k,) a quantity; of one along a part that of the largest size at each time."""
    if values.ndim == 1:
        return values
    return np.take_along_axis(values, np.abs(values).argmax(axis=1)[:, None], axis=1)[:, 0]


def _doubles(values: Array) -> dict[str, str]:
    """Numbers as plotly takes them, without rounding and many times faster than as text."""
    return {"dtype": "f8", "bdata": b64encode(values.astype("<f8").tobytes()).decode()}
