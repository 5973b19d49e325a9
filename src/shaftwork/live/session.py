"""A session: a network compiled once, which answers what a page asks of it. It knows no server."""

from __future__ import annotations

import threading
import time
import warnings
from base64 import b64encode
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from shaftwork.animation.turning import Train, train_of
from shaftwork.codegen.model_observer import ModelObserver
from shaftwork.core.errors import ShaftworkError, SimulationError, no_quantity
from shaftwork.core.notices import FILTERS
from shaftwork.core.screen import MOST_MODES
from shaftwork.frequency.exact_networks import exact_shafts
from shaftwork.frequency.natural_modes import NaturalModes
from shaftwork.live.page_requests import checked, objections
from shaftwork.live.sliders import Slider, StartField, sliders_of, start_fields_of
from shaftwork.live.stage import described, moved
from shaftwork.live.work import ADVICE, LIMITS, MOST_STEPS, WatchedSolution, Work
from shaftwork.pipeline.arguments import FALLBACK_END, checked_parameters
from shaftwork.pipeline.network import Network, network_of, with_values
from shaftwork.results.observer import ANGLES, Array
from shaftwork.results.plotting import MOST_SIGNALS, grouped
from shaftwork.results.solution import Solution
from shaftwork.scenes.catalog import Scene

POINTS = 600
"""Output times of a motion: as many as a plot on a screen has room for."""


class Session:
    """A network that answers a page: values of parameters in, curves, extremes, frequencies and a drawing out.

    Args:
        subject: a network, or a scene, whose title, end time and signals are taken.
        t_end: end of the motion, s; by default that of the scene, or 10.
        signals: quantities to draw; by default those of the scene, or the first states.
        initial: start values of speeds, twists and torques, as of `simulate`; the rest is zero.

    Raises:
        NetworkError: the network cannot be assembled; lists every reason.
        SignalError: there is no such quantity.

    Examples:
        >>> import shaftwork as sw
        >>> session = sw.live.Session(sw.scenes.SCENES["crane-start"])
        >>> session.answer({"set": {"J2.J": 100.0}, "want": ["extremes"]})["extremes"][0]["name"]
        'shaft.tau'
    """

    def __init__(
        self,
        subject: Network | Scene,
        *,
        t_end: float | None = None,
        signals: Sequence[str] | None = None,
        initial: Mapping[str, float] | None = None,
    ) -> None:
        scene = subject if isinstance(subject, Scene) else None
        self.network = scene() if scene else network_of(subject)
        self.scene = scene
        """What it is, where it is one."""
        self.t_end = t_end if t_end is not None else scene.t_end if scene else FALLBACK_END
        self.initial = dict(initial or {})
        """Start values where a request gives none."""
        self.closing = threading.Event()
        """Set to end what is being computed."""
        self._chosen = tuple(signals if signals is not None else scene.signals if scene else ())
        self.model = self.network.compile(angles=self._angles((*self.initial, *self._chosen)))
        self._observer = ModelObserver(self.model.form, lambda: self.model.bind(self.model.defaults))
        names = dict.fromkeys((*self._observer.units, *self._observer.profiles, *self.model.states))
        for name in self._chosen:
            if name not in names:
                raise no_quantity(str(name), self.model.name, names)
        self._last: tuple[tuple[Any, ...], Solution] | None = None
        self._first: Solution | None = None
        self._work = Work(self._is_open)

    def _is_open(self) -> bool:
        return not self.closing.is_set()

    def _angles(self, names: Sequence[str]) -> list[str]:
        """The parts whose angle, position or flux linkage is among quantities by name."""
        parts = {part.name for part in self.network.parts}
        pairs = (name.rpartition(".") for name in names if isinstance(name, str))
        return list(dict.fromkeys(owner for owner, _, name in pairs if name in ANGLES and owner in parts))

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
    def starts(self) -> Mapping[str, StartField]:
        """What a motion may start with, by name."""
        return start_fields_of(self.model, self._observer, self.initial)

    @cached_property
    def signals(self) -> tuple[str, ...]:
        """The quantities that are drawn."""
        motion = self._first_motion()
        return self._chosen or tuple(name for name in motion.states if name in motion)[:MOST_SIGNALS]

    @cached_property
    def _train(self) -> Train:
        return moved(train_of(self._first_motion().observer))

    @cached_property
    def layout(self) -> dict[str, Any]:
        """What stays while values change: the axes of the plot, and the train that the page moves."""
        motion = self._first_motion()
        units = {name: motion.reader.unit(name) for name in self.signals}
        axes = grouped({name: (motion.t, motion[name]) for name in self.signals}, units)
        return {
            "axes": [{"unit": unit, "signals": names} for unit, names in axes],
            "stage": described(self._train, self.sliders),
        }

    @property
    def setup(self) -> dict[str, Any]:
        """What a page must know before it asks: title, sliders, fields of start values."""
        return {
            "title": self.title,
            "source": self.scene.source if self.scene else "",
            "t_end": self.t_end,
            "sliders": [asdict(slider) for slider in self.sliders.values()],
            "starts": [asdict(field) for field in self.starts.values()],
        }

    def drawing(self, values: Mapping[str, Any]) -> str:
        """The network with values of parameters as SVG, for a page of HTML."""
        svg = with_values(self.network, values).draw(values=True).svg
        return svg[svg.index("<svg") :]

    def answer(self, request: Mapping[str, Any], waits: Callable[[], bool] = lambda: True) -> dict[str, Any]:
        """What a page shows for values of parameters, as plain data for JSON; the work has the limits of `Work`.

        Args:
            request: "set", values by "part.parameter" in SI, those of the network elsewhere; "initial", start values by
                quantity (by default those of the session); "want", some of "curves", "layout", "extremes", "modes" and
                "drawing" (by default the curves, which take the least time); "t_end", s; "at", the time in s of the
                motion about which modes are, by default rest.
            waits: whether anybody still waits for the answer; asked again and again.

        Returns:
            By what is wanted: "t" and "curves", (k,) doubles as plotly takes them, with "train", the angles of its
            nodes as they are shown, and "phases"; "layout"; "extremes"; "modes"; "drawing", SVG. Always "milliseconds"
            and "warnings". Or "error", what the library says to values that cannot be, and in "fields" the same by the
            field of the request and the name.
        """
        self._work = Work(lambda: self._is_open() and waits())
        with FILTERS, warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            try:
                whole = checked(request)
                if fields := objections(self.model.netlist, self.starts, whole):
                    texts = dict.fromkeys(text for of in fields.values() for text in of.values())
                    return {"error": "\n".join(texts), "fields": fields}
                answer = self._answer(whole)
            except ShaftworkError as error:
                return {"error": str(error)}
        return answer | {"warnings": list(dict.fromkeys(str(one.message) for one in caught))}

    def _answer(self, request: Mapping[str, Any]) -> dict[str, Any]:
        values, wanted = request["set"], request["want"]
        motion, simulated = self._motion(request)
        start, answer = time.perf_counter(), dict[str, Any]()
        if "layout" in wanted:
            answer["layout"] = self.layout
        if "curves" in wanted:
            answer |= self._curves(motion)
        reading = time.perf_counter() - start
        if "extremes" in wanted:
            answer["extremes"] = [self._extreme(motion, name) for name in self.signals]
        if "modes" in wanted:
            answer |= self._modes(values, motion, request.get("at"))
        if "drawing" in wanted:
            answer["drawing"] = self.drawing(values)
        return answer | {"milliseconds": {"simulate": 1e3 * simulated, "read": 1e3 * reading}}

    def motion(self, request: Mapping[str, Any], waits: Callable[[], bool] = lambda: True) -> Solution:
        """The motion of a request, within the limits of an answer; arguments as of `answer`.

        Raises:
            ShaftworkError: values cannot be, or the work ended before the motion did.
        """
        self._work = Work(lambda: self._is_open() and waits())
        return self._motion(checked(request))[0]

    def _motion(self, request: Mapping[str, Any]) -> tuple[Solution, float]:
        """The motion, and the seconds that it took; the last one is kept."""
        values, initial = request.get("set", {}), request.get("initial", self.initial)
        t_end = request.get("t_end", self.t_end)
        key = (t_end, *values.items(), None, *initial.items())
        if self._last is not None and self._last[0] == key:
            return self._last[1], 0.0
        start = time.perf_counter()
        try:
            motion = self.model.simulate(
                t_end,
                t_eval=POINTS,
                parameters=values,
                initial=initial or None,
                max_steps=MOST_STEPS,
                progress=self._go_on,
            )
        except SimulationError as error:
            if f"{MOST_STEPS} steps were not enough" in str(error):  # the next step is another one than in a program
                raise SimulationError(
                    f"The motion has not come to its end at t = {t_end:g} s: {LIMITS}. {ADVICE}"
                ) from None
            raise
        watched = WatchedSolution.of(motion, self._go_on)
        self._last, self._first = (key, watched), self._first or watched
        return watched, time.perf_counter() - start

    def _first_motion(self) -> Solution:
        """By which is chosen what stays: where the network's own values give no motion, others may."""
        return self._first or self._motion({})[0]

    def _go_on(self, reached: float | None = None) -> None:
        self._work.go_on(reached)

    def _curves(self, motion: Solution) -> dict[str, Any]:
        curves = {name: motion[name] for name in self.signals}
        unbounded = [name for name, values in curves.items() if not np.isfinite(values).all()]
        if unbounded:
            raise SimulationError(
                f"{unbounded[0]} has no finite value at some time of the motion. Give its law a finite slope, or draw "
                "other signals."
            )
        return {
            "t": _doubles(motion.t),
            "curves": {name: _doubles(_worst(values)) for name, values in curves.items()},
            "train": self._shown(motion),
            "phases": [{"start": row.start, "end": row.end, "modes": dict(row.modes)} for row in motion.phases],
            "engine": motion.engine,
        }

    def _shown(self, motion: Solution) -> dict[str, Any] | None:
        """The angles of the train as it is played; None where there is nothing to play."""
        if not self._train.nodes:
            return None
        lasting = min(12.0, max(4.0, float(motion.t[-1] - motion.t[0])))  # s, that eyes follow
        turning = self._train.turning(motion.t, motion.__getitem__, lasting)
        return {
            "seconds": lasting,
            "words": turning.words,
            "angles": [_doubles(angle) for angle in turning.angles.T],
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
        nodes = self._train.nodes
        shapes = np.array([modes.shapes[node.speed] for node in nodes], dtype=complex).reshape(len(nodes), len(modes))
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

    def _modes_about(self, values: Mapping[str, Any], point: Solution | None) -> NaturalModes:
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
