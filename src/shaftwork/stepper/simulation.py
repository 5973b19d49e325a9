"""A motion that is stepped from outside, between whose steps inputs and parameters are set."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from shaftwork.core.errors import ParameterError, ShaftworkError, SimulationError
from shaftwork.core.parameters import in_si
from shaftwork.integrate.choice import check
from shaftwork.pipeline.arguments import Demand, Given, Names, relative_tolerance
from shaftwork.pipeline.motion_start import ending_of, handed_over, time_of_start
from shaftwork.results.solution import Solution
from shaftwork.stepper.input_values import Settings
from shaftwork.stepper.moments import Moment, MomentState, Observations, plain_moment, smooth_engine

if TYPE_CHECKING:
    from shaftwork.pipeline.model import Model

AHEAD = 128
"""Steps for which the instants are looked up at which inputs jump."""
MOST_STEPS = 10_000_000
"""Of an engine in one step from outside."""


@dataclass(frozen=True, eq=False)
class SavedState:
    """All that a stepped motion goes on with; it can be stored (pickled), and restored as often as is wanted.

    Args:
        network: name of the network.
        wiring: by part, what it is and where.
        t: time, s.
        values: of inputs and parameters that were set.
        origin: start values, or where the motion had come to when something last happened.
        place: where it has come to since, or None.
        clock: time in s, number of equal steps since, and their length in s.
        ahead: time in s for which the next moment is prepared.
        engine: that goes on, or "".
    """

    network: str
    wiring: Mapping[str, str]
    t: float
    values: Mapping[str, float]
    origin: Given
    place: MomentState | None
    clock: tuple[float, int, float]
    ahead: float
    engine: str


class Simulation:
    """A motion that is stepped from outside: `Model.start` begins one.

    Between two steps everything that was set holds. Steps are as long as is asked; inside them an engine takes its own,
    with its error control, and events (a gap that closes, a friction that sticks, a diode) are where they are in one
    run. So many short steps are the same motion as one run of `simulate` with the same inputs.

    Args:
        model: of the network.
        t_start: as of `Model.simulate`, as are the next three and `engine`.
        initial: start values by name, or a motion that goes on.
        parameters: values by name.
        rtol: relative tolerance.
        atol: absolute tolerance. That of ordinary speeds by default, also where a motion is tiny, as no step is made
            twice: give it there.
        engine: the integrator.
        inputs: what will be set again and again, "motor.tau": what is a law there is compiled as a number ahead.

    Raises:
        ParameterError: an argument is out of its range; there is no such input.
        SignalError: `initial` names nothing that is stored.
    """

    def __init__(
        self,
        model: Model,
        *,
        t_start: float | None = None,
        initial: Mapping[str, float] | Solution | None = None,
        parameters: Mapping[str, float] | None = None,
        inputs: Names = None,
        rtol: float = 1e-8,
        atol: float | Sequence[float] | None = None,
        engine: str = "auto",
        **others: Any,
    ) -> None:
        if others:
            raise ParameterError(
                f"start() has no option {next(iter(others))!r}. It has: inputs, t_start, initial, parameters, rtol, "
                "atol, engine. What a step leads to is read after it, run['J2.omega']."
            )
        if not model.form.waves:
            check(engine)
        if parameters is not None and not isinstance(parameters, Mapping):
            raise ParameterError(f"parameters = {parameters!r} must map names to values, such as {{'shaft.c': 3e4}}.")
        self._options = Demand((0.0, 1.0), relative_tolerance(rtol), atol, None, engine, MOST_STEPS, None)
        self._is_smooth = bool(smooth_engine(engine))
        self._settings = Settings(model, parameters, inputs)
        self._cached: dict[Any, Observations] = {}
        started: Any = ending_of(initial, model.form.graph) if isinstance(initial, Solution) else initial
        self._wiring, self._name = model.form.graph.wiring, model.name
        self._origin: Given = dict(started) if type(started) is dict else started
        self._t = in_si("t_start", time_of_start(t_start, started), "s")
        self._clock = self._t, 0, 0.0
        self._moment: Moment | None = None
        self._moved = False
        self._motion: Solution | None = None
        self._engine, self._failed, self._ahead = "", "", 1e-3
        _ = self._now  # refuses start values that cannot be

    def __repr__(self) -> str:
        return f"<Simulation of '{self._name}' at t = {self._t:.9g} s>"

    @property
    def t(self) -> float:
        """The time that the motion has come to, s."""
        return self._t

    @property
    def names(self) -> tuple[str, ...]:
        """All that can be read."""
        names = self._now.readings.names.units
        return tuple(dict.fromkeys((*names, *self._settings.model.states)))

    @property
    def modes(self) -> Mapping[str, str]:
        """The mode of every part that changes its mode, in the words of `Solution.phases`; empty where none does."""
        return dict(self._now.words)

    def __getitem__(self, name: str) -> Any:
        """A quantity now, "J2.omega", in SI: after whatever jumps at this instant, with the inputs that are set.

        A float; (places,) an array of what is read along a part.

        Raises:
            SignalError: there is no such quantity; the message lists what the part has.
            SimulationError: it has no finite value here.
        """
        model = self._settings.model
        if self._motion is None and model.form.waves:  # what is on its way is known of a motion alone
            span = self._t, self._t + self._ahead / AHEAD
            self._motion = model.run_once(self._settings.in_model, self._origin, self._demand(span)).at([self._t])
        if self._motion is None:
            return self._now[name]
        value = self._motion[name][-1]
        return value if np.ndim(value) else float(value)

    def set(self, name: str, value: float) -> None:
        """Set an input of a source, "motor.tau", or any parameter, from now on: it holds until it is set again.

        A law that was there before ends at this instant. A speed that is prescribed, or a ratio, may change other
        speeds at once, as an impact does.

        Args:
            name: "part.parameter".
            value: in SI, or with a unit.

        Raises:
            ParameterError: there is none of this name, or the value is not admissible.
            CompileError: the network has no motion with it.
            SimulationError: the motion has failed before.
        """
        self._refuse_failed()
        moment, settings, before = self._moment, copy(self._settings), dict(vars(self))
        same = settings.set(name, value)
        self._settings = settings
        # one that is only looked at is left, so that looking changes no bit of what follows
        if self._moved and same and moment is not None and moment.set(name, settings.values[name]):
            return
        try:
            self._leave(moment)
            if not same or not all(name in readings.in_laws for readings in self._cached.values()):
                _ = self._now
        except ShaftworkError:
            vars(self).update(before)
            raise

    def step(self, dt: float) -> None:
        """Go on by a time.

        Args:
            dt: s, above zero.

        Raises:
            ParameterError: dt is no such time.
            SimulationError: the motion cannot go on; says when, in which state and why. Then it stays where it was, and
                a state that was saved can be restored.
        """
        self._refuse_failed()
        length = in_si("dt", dt, "s", above=0)
        since, count, usual = self._clock if self._clock[2] == length else (self._t, 0, length)
        end = since + (count + 1) * usual  # a hundred times 0.01 s is 1 s
        if not end > self._t:
            raise ParameterError(f"dt = {dt} s is lost in the rounding of t = {self._t} s. Give a longer step.")
        try:
            if self._goes_smoothly(end):
                self._moved = True
            else:
                self._run_to(end, length)
        except ShaftworkError as error:
            self._failed = str(error)
            raise
        self._t, self._clock = end, (since, count + 1, usual)

    def save_state(self) -> SavedState:
        """All that the motion goes on with from here, to come back with `restore`; it pickles.

        What follows is the same to the last bit, with each engine.
        """
        place = self._moment.place if self._moved and self._moment is not None else None
        values = dict(self._settings.values)
        return SavedState(
            self._name, self._wiring, self._t, values, self._origin, place, self._clock, self._ahead, self._engine
        )

    def restore(self, state: SavedState) -> None:
        """Go on from a state that was saved, of this motion or of another one of the same network.

        Raises:
            ParameterError: it is none, or one of another network.
        """
        if not isinstance(state, SavedState):
            raise ParameterError(f"{type(state).__name__} is no state. Give what save_state() has returned.")
        if state.wiring != self._wiring:
            raise ParameterError(
                f"The state is one of '{state.network}', which is another network than '{self._name}'. "
                "Give a state of the same network; numbers of its parts may differ."
            )
        self._settings.restore(state.values)
        self._t, self._origin, self._clock, self._engine = state.t, state.origin, state.clock, state.engine
        self._ahead, self._motion, self._failed, self._moment, self._moved = state.ahead, None, "", None, False
        if state.place is not None:
            self._moment, self._moved = self._moment_at(state.place.span, state.place), True

    def _refuse_failed(self) -> None:
        if self._failed:
            raise SimulationError(
                f"The motion has failed before and stands at t = {self._t:.9g} s: {self._failed} Restore a state that "
                "was saved, or start anew."
            )

    @property
    def _now(self) -> Moment:
        """The network at this instant, with what is set."""
        if self._moment is None:
            self._moment = self._moment_at((self._t, self._t + self._ahead))
            self._moved = False
        return self._moment

    def _moment_at(self, span: tuple[float, float], place: MomentState | None = None) -> Moment:
        model: Any = self._settings.model
        further = self._settings.in_model, self._origin, self._demand(span), self._cached, place
        moment: Moment = model.moment(*further) if model.phased else plain_moment(model, *further)
        return moment

    def _demand(self, span: tuple[float, float], engine: str = "") -> Demand:
        options = self._options
        return Demand(span, options.rtol, options.atol, np.array([span[1]]), engine or options.engine, MOST_STEPS, None)

    def _leave(self, moment: Moment | None) -> None:
        """Forget what was prepared for this instant, and keep what goes on from it."""
        if moment is not None and self._moved:
            self._origin = moment.ending()
        self._moment, self._motion, self._moved = None, None, False

    def _goes_smoothly(self, end: float) -> bool:
        """Whether nothing happens up to a time in s, and the motion has come there."""
        if not self._is_smooth or self._settings.model.form.waves:
            return False
        if end >= self._now.demand.span[1]:  # for which it was prepared
            self._ahead = AHEAD * (end - self._t)
            self._leave(self._moment)
        return self._now.advance(end)

    def _run_to(self, end: float, length: float) -> None:
        """Go on to a time in s as `simulate` does from where the motion has come to."""
        self._ahead = AHEAD * length
        self._leave(self._moment)
        model, values = self._settings.model, self._settings.in_model
        span = self._t, end
        try:
            motion = model.run_once(values, self._origin, self._demand(span, self._engine))
        except SimulationError:
            if not self._engine or self._options.engine != "auto":
                raise
            motion = model.run_once(values, self._origin, self._demand(span))
        if self._options.engine == "auto" and not model.phased and not model.form.waves and model.states:
            self._engine = motion.engine  # to choose anew takes longer than many a step
        self._origin = ending = handed_over(motion, {**model.parameters, **values})
        if ending.read == end and (model.form.waves or not self._is_smooth):  # where no moment is made anyway
            self._motion = motion
