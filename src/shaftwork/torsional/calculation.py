"""The torsional vibration calculation: from a train and its speeds to stresses, limits and barred ranges."""

from __future__ import annotations

import reprlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from difflib import get_close_matches
from typing import TYPE_CHECKING, Any

import numpy as np

from shaftwork.components.mechanics import Spring
from shaftwork.components.shafts import Shaft
from shaftwork.core.errors import ParameterError
from shaftwork.core.parameters import in_si
from shaftwork.numerics.tolerances import TYPED
from shaftwork.pipeline.arguments import Point, Time, repeated, several
from shaftwork.pipeline.network import Network, network_of
from shaftwork.results.observer import Array, array_in_si
from shaftwork.torsional.barred_ranges import BarredRange, barred_ranges, exceeded_spans
from shaftwork.torsional.order_excitations import Misfire
from shaftwork.torsional.shaft_sections import Section
from shaftwork.torsional.shaft_vibration import ShaftVibration, worst_along
from shaftwork.torsional.torsional_result import TorsionalCalculation
from shaftwork.torsional.undamped_resonances import without_bound

if TYPE_CHECKING:
    from shaftwork.torsional.forced_train import ForcedTrain, Resonance


def torsional_calculation(
    net: Network,
    speeds: Any,
    *,
    sections: Sequence[Section] = (),
    rated: Any = None,
    misfire: Misfire = None,
    permissible: Mapping[str, Any] | None = None,
    at: Point | Callable[[float], Point] = None,
    exact: bool = False,
    t: Time = None,
) -> TorsionalCalculation:
    """Forced torsional vibration of a train over its speed range, by superposition of the orders of its excitations.

    Law: at the steady speed n of the reference shaft, that of the first `HarmonicTorque`, the order k of every torque
    swings as exp(i k n t). The train is linear about its operating point, and each order passes through it for itself.
    The waveform over a cycle is their sum, and the vibratory torque is half of its peak to peak. To the given speeds
    are added those at which an order meets a natural frequency, and some beside each, so that no peak is missed.

    Args:
        net: the train, with a `HarmonicTorque` for each cylinder, propeller or other torque that swings by the angle.
        speeds: (n,) rad/s of the reference shaft, ascending and above 0.
        sections: of shafts at which stresses are looked at; with a design, what is permitted too.
        rated: maximum continuous speed of the reference shaft, rad/s; needed where a section has a design.
        misfire: the name of a cylinder without swing, or several; or by name a share of the swing, or the `Harmonics`
            that it has then (compression without injection).
        permissible: by spring or shaft the vibratory torque in N m that may last: of an elastic coupling, a gear or a
            crank, as its maker gives it.
        at: the point about which the train swings, as for `Model.linearize`, or a function from the speed to it; by
            default the whole train turns with the reference shaft.
        exact: every shaft but a rigid one and one spring is taken as it is, without a mesh.
        t: time at which laws are read, s.

    Raises:
        ParameterError: there is no harmonic torque, or an argument is not what it must be; says what would be.
        NetworkError: the network cannot be assembled; lists every reason.
    """
    from shaftwork.torsional.forced_train import forced_train

    rising = _ascending(speeds)
    train = forced_train(network_of(net), misfire, at, exact=exact, t=t)
    shafts = _torques_of(train.network)
    of_shafts = _completed(several("sections", sections), net, shafts)
    bounds = _permissible({} if permissible is None else permissible, shafts)
    top = None if rated is None else in_si("rated", rated, "rad/s", above=0)
    if top is None and (bare := [one.shaft for one in of_shafts.values() if one.design is not None]):
        raise ParameterError(
            f"The section of '{bare[0]}' has a design, whose permitted stress depends on the rated speed. Give rated=, "
            "the maximum continuous speed in rad/s."
        )
    resonances = train.resonances(rising)
    n = _refined(rising, [(one.speed, one.damping) for one in resonances])
    n = _distinct([*n, *_peaks(n, _vibrations(train, shafts, n, resonances), train, shafts)])
    vibrations = {
        shaft: _judged(replace(vibration, section=of_shafts.get(shaft)), train, shafts[shaft], top, bounds.get(shaft))
        for shaft, vibration in _vibrations(train, shafts, n, resonances).items()
    }
    return TorsionalCalculation(net.name, n, train.orders, vibrations, resonances, top, train.failing, train, shafts)


def _ascending(speeds: Any) -> Array:
    n = array_in_si("speeds", speeds, "rad/s")
    if len(n) < 2 or not (np.isfinite(n).all() and n[0] > 0 and (np.diff(n) > 0).all()):
        raise ParameterError(
            f"speeds = {reprlib.repr(speeds)} must be two or more speeds in rad/s, ascending and above 0, such as "
            "numpy.linspace(20, 160, 71)."
        )
    return n


def _torques_of(net: Network) -> dict[str, str]:
    """From the name of every spring and shaft to its torque."""
    shafts = {part.name: f"{part.name}.tau" for part in net.parts if isinstance(part, Spring | Shaft)}
    if not shafts:
        raise ParameterError(f"'{net.name}' has no Spring or Shaft that could vibrate. Add one between its inertias.")
    return shafts


def _permissible(permissible: Mapping[str, Any], shafts: Mapping[str, str]) -> dict[str, float]:
    """Permissible torques in N m by shaft.

    Raises:
        ParameterError: one is not above 0, or of no spring or shaft.
    """
    if not isinstance(permissible, Mapping):
        raise ParameterError(
            f"permissible = {reprlib.repr(permissible)} must say by shaft what torque may last, {{'coupling': 4000.0}}."
        )
    for name in permissible:
        _refuse_no_shaft("permissible", name, shafts)
    return {name: in_si(f"permissible['{name}']", torque, "N*m", above=0) for name, torque in permissible.items()}


def _refuse_no_shaft(argument: str, name: str, shafts: Mapping[str, str]) -> None:
    if name not in shafts:
        close = get_close_matches(str(name), shafts, n=3) or tuple(shafts)[:12]
        raise ParameterError(f"{argument}: '{name}' is no spring or shaft here. There are: {', '.join(close)}.")


def _completed(sections: Sequence[Any], net: Network, shafts: Mapping[str, str]) -> dict[str, Section]:
    """Sections by their shaft, with diameters and bores of shafts where they were left out.

    Raises:
        ParameterError: one is no section, of no shaft, without a diameter, or of a shaft that has one.
    """
    if wrong := [one for one in sections if not isinstance(one, Section)]:
        raise ParameterError(f"sections: {reprlib.repr(wrong[0])} is no section. Write Section('shaft', diameter=0.2).")
    if twice := repeated(one.shaft for one in sections):
        raise ParameterError(f"sections: '{twice}' has two. Give one, or calculate again with the other.")
    parts = {part.name: part for part in net.parts}
    completed = {}
    for one in sections:
        _refuse_no_shaft("sections", one.shaft, shafts)
        part = parts[one.shaft]
        if isinstance(part, Shaft):
            diameter, bore = in_si("diameter", part.diameter, "m"), in_si("bore", part.inner_diameter, "m")
            completed[one.shaft] = one.of(diameter, bore)
        elif one.diameter is None:
            raise ParameterError(f"sections: '{one.shaft}' is a spring, which has no diameter. Give diameter= in m.")
        else:
            completed[one.shaft] = one.of(one.diameter, 0.0)
    return completed


def _refined(speeds: Array, resonances: Sequence[tuple[float, float]]) -> Array:
    """The speeds with those of resonances, and some beside each by its damping."""
    # In damping ratios: the response falls to 0.7 at 1 and to 0.24 at 4, so lines between these show a peak as it is.
    spread = (0.0, -0.5, 0.5, -1.0, 1.0, -2.0, 2.0, -4.0, 4.0)
    beside = [speed * (1 + damping * step) for speed, damping in resonances for step in (spread if damping else (0.0,))]
    return _distinct([*speeds, *(speed for speed in beside if speeds[0] <= speed <= speeds[-1])])


def _distinct(speeds: Sequence[float]) -> Array:
    """The speeds, ascending, each once."""
    n = np.unique(speeds)
    return np.asarray(n[np.concatenate([[True], np.diff(n) > TYPED * n[1:]])])


def _vibrations(
    train: ForcedTrain, shafts: Mapping[str, str], speeds: Array, resonances: Sequence[Resonance]
) -> dict[str, ShaftVibration]:
    """The vibration of every shaft, whose torques have these names, at speeds (n,)."""
    amplitudes = train.amplitudes(speeds, tuple(shafts.values()))
    vibrations = {}
    for shaft, torque in shafts.items():
        swings = without_bound(amplitudes[torque], train, speeds, resonances)
        torques, places = worst_along(swings, train.orders, train.places(torque))
        vibrations[shaft] = ShaftVibration(shaft, speeds, train.orders, torques, places, None, None)
    return vibrations


def _peaks(
    speeds: Array, vibrations: Mapping[str, ShaftVibration], train: ForcedTrain, shafts: Mapping[str, str]
) -> Array:
    """(p,) the speeds of the peaks of all shafts between speeds (n,) that show one, of a tenth of the largest or more.

    All are halved in at once between their neighbours, as a speed costs less beside others; at last a parabola has the
    speed to about 1e-5, and its height to the square of that.
    """
    tops = []
    for shaft, vibration in vibrations.items():
        size = vibration.amplitude
        least = 0.1 * size[np.isfinite(size)].max(initial=0.0)
        inner = (size[1:-1] > size[:-2]) & (size[1:-1] >= size[2:]) & np.isfinite(size[1:-1]) & (size[1:-1] >= least)
        tops += [(shaft, place + 1) for place in np.flatnonzero(inner).tolist()]
    low, high = (np.array([speeds[place + side] for _, place in tops]) for side in (-1, 1))
    places, rows = np.array([0.25, 0.5, 0.75]), np.arange(len(tops))
    for _ in range(4 if tops else 0):
        between = low[:, None] + (high - low)[:, None] * places
        every, where = np.unique(between, return_inverse=True)
        at = _vibrations(train, shafts, every, ())
        size = np.array([at[shaft].amplitude[row] for (shaft, _), row in zip(tops, where.reshape(-1, 3), strict=True)])
        width, middle = high - low, between[rows, size.argmax(axis=1)]
        bend = 2 * size[:, 1] - size[:, 0] - size[:, 2]
        vertex = between[:, 1] + width / 8 * (size[:, 2] - size[:, 0]) / np.where(bend > 0.0, bend, np.inf)
        low, high = middle - width / 4, middle + width / 4
    return np.clip(vertex, low, high) if tops else np.empty(0)


def _judged(
    vibration: ShaftVibration, train: ForcedTrain, torque: str, rated: float | None, permissible: float | None
) -> ShaftVibration:
    """The vibration with its limits, and the ranges in which it exceeds them."""
    section, speeds = vibration.section, vibration.speeds

    def at(speed: float) -> ShaftVibration:
        """The vibration at one more speed in rad/s."""
        one = np.array([speed])
        torques, _ = worst_along(train.amplitudes(one, (torque,))[torque], train.orders, train.places(torque))
        return replace(vibration, speeds=one, torques=torques, places=None)

    barred: tuple[BarredRange, ...] = ()
    limits = None
    if section is not None and section.design is not None and rated is not None:
        limits = section.permitted(speeds / rated)
        barred = barred_ranges(
            speeds,
            vibration.stress,
            limits,
            lambda speed: float(at(speed).stress[0] - section.permitted(speed / rated)[0]),
            rated,
        )
    exceeded: tuple[tuple[float, float], ...] = ()
    if permissible is not None:
        exceeded = exceeded_spans(
            speeds,
            vibration.amplitude,
            np.full_like(speeds, permissible),
            lambda speed: float(at(speed).amplitude[0]) - permissible,
        )
    return replace(vibration, limits=limits, barred=barred, permissible=permissible, exceeded=exceeded)
