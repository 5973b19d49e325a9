"""Parts that change their mode as models: gaps as one law, friction, brakes and freewheels by what holds at rest.

A joint that holds is not a smaller network there, as it is here: the relative acceleration stays an unknown, and one
variable `s` is the torque while the joint holds and stands for the acceleration while it does not. So all modes have
the same unknowns. Source: Otter, Elmqvist, Mattsson, Hybrid modeling in Modelica based on the synchronous data flow
principle, 1999.
"""

from __future__ import annotations

from sympy import And, Expr, Float, Integer, Not, true
from sympy.logic.boolalg import Boolean

from shaftwork.components.branches import ACROSS, INTEGRAL, THROUGH
from shaftwork.components.friction import GIVES_WAY
from shaftwork.components.modes import Mode, ModeChoice, Modes
from shaftwork.core.domains import ELECTRICAL
from shaftwork.core.errors import CompileError
from shaftwork.formulation.form import StateForm
from shaftwork.modelica.indexed_rows import difference
from shaftwork.modelica.modelica_expressions import ModelicaPrinter
from shaftwork.modelica.part_models import PartModel
from shaftwork.network.graph import GraphPart, resolve
from shaftwork.network.kinds import Kind
from shaftwork.network.netlist import title
from shaftwork.network.templates import BranchTemplate, make_template

_NEXT = "Simplify the part, or export the circuit or the C code of the network."


def part_model(form: StateForm, part: GraphPart) -> PartModel:
    """The model of a part by the kind of its modes.

    Raises:
        CompileError: its modes have no Modelica form.
    """
    if not part.modes:
        return PartModel(form, part)
    if all(modes.law is not None for modes in part.modes):
        return _ContactModel(form, part)
    if len(part.modes) == 1:
        names = {mode.name for mode in part.modes[0].options}
        if {"forward", "backward", "stuck"} <= names <= {"forward", "backward", "stuck", "waiting", "released"}:
            return _FrictionModel(form, part)
        if names in ({"free", "locked"}, {"open", "closed", "over"}):
            return _FreewheelModel(form, part) if "free" in names else _SwitchModel(form, part)
    raise CompileError(
        f"{title(part.component)} changes its mode in a way that is not written in Modelica. {_hint(part)}"
    )


def _hint(part: GraphPart) -> str:
    rigid = "c" in part.component.declared and getattr(part.component, "c", 0) is None
    return "Give its flanks a stiffness c." if rigid else _NEXT


class _ModeModel(PartModel):
    """A part with one mode machine between two ends."""

    @property
    def modes(self) -> Modes:
        """Its modes."""
        return self.part.modes[0]

    def law(self, expression: Expr, across: str) -> str:
        """A law of the speed across, the twist and the time, as text."""
        plus, minus = self.part.ends_of(self.modes)
        names = {ACROSS: across, **self.symbols}
        if expression.has(INTEGRAL):
            names[INTEGRAL] = self.twist(plus, minus)
        return ModelicaPrinter(names, self.title, self.values).doprint(expression)

    @property
    def across(self) -> str:
        """What is across the machine."""
        plus, minus = self.part.ends_of(self.modes)
        return difference((self.places.get(plus), self.places.get(minus)))

    def give(self, through: str) -> None:
        """Let a variable flow in at the first end of the machine and out at the second."""
        ends = self.part.ends_of(self.modes)
        for port in self.ports:
            sign = {ends[0]: "", ends[1]: "-"}.get(port)
            self.equations.append(f"{self.flow_at(port)} = {'0' if sign is None else f'{sign}{through}'};")

    def by_time(self, condition: Boolean) -> Boolean:
        """A condition of the time alone.

        Raises:
            CompileError: it is not.
        """
        if getattr(self.part.component, "on", None) is not None or condition.has(ACROSS, INTEGRAL):
            raise CompileError(f"{self.title}: a law `on` is not written in Modelica. Give t_on and t_off instead.")
        return condition


class _ContactModel(_ModeModel):
    """A gap or stop whose flanks spring: one law of twist and speed."""

    def constitute(self) -> None:
        law = self.modes.law if self.modes.law is not None else Integer(0)
        name = self.names.unused("through")
        plus, _ = self.part.ends_of(self.modes)
        self.declare(name, self.domains[str(plus)].through.unit)
        self.equations.append(f"{name} = {self.law(law, self.across)};")
        self.give(name)


class _FrictionModel(_ModeModel):
    """What slips forward or backward, is stuck up to a limit, and may be off for a time."""

    def constitute(self) -> None:
        plus, _ = self.part.ends_of(self.modes)
        torque, speed = self.domains[str(plus)].through.unit, self.domains[str(plus)].across.unit
        for name, measure in (("speed", speed), ("acceleration", f"{speed}^2")):
            self.declare(name, measure)
        for name in ("slip_forward", "slip_backward", "most_forward", "most_backward", "through"):
            self.declare(name, torque)
        self.variables += [
            "Boolean start_forward(start = false);",
            "Boolean start_backward(start = false);",
            "Boolean stuck(start = false);",
            'Integer mode(start = 3, fixed = true) "1 forward, -1 backward, 0 stuck, 2 off, 3 not yet known";',
            'Real s "Torque while it is stuck, else in place of the acceleration";',
        ]
        active = self._active()
        on = "true" if active == true else self.law(active, "speed")
        off = self.law(self._torque(self._off), "speed") if self._off is not None else "0"
        self.equations += [
            f"speed = {self.across};",
            "acceleration = der(speed);",
            *(
                f"slip_{side} = {self.law(self._torque(self.modes[side]), 'speed')};"
                for side in ("forward", "backward")
            ),
            *(f"most_{side} = {self.law(self._limit(side), 'speed')};" for side in ("forward", "backward")),
            *(
                f"start_{side} = (initial() or pre(mode) == 2) and speed {past} 0 or pre(mode) == 0\n  and "
                f"(pre(stuck) and s {past} most_{side} or pre(start_{side}) and s {past} slip_{side});"
                for side, past in (("forward", ">"), ("backward", "<"))
            ),
        ]
        moving = "pre(mode) == 1 or start_forward or pre(mode) == -1 or start_backward"
        ahead = "start_forward or pre(mode) == 1 and not start_backward"
        if active == true:
            self.equations += [f"stuck = not ({moving});"]
            free, rest, ended = "", "", ""
        else:
            self.variables.append("Boolean on;")
            self.equations += [f"on = {on};", f"stuck = on and not ({moving});"]
            free, rest, ended = f"if not on then {off} else ", "if not on then s else ", "if not on then 2 else "
        self.equations += [
            f"through = if stuck then s else {free}if {ahead} then slip_forward else slip_backward;",
            f"acceleration = if stuck then 0 else {rest}s - (if {ahead} then most_forward else most_backward);",
            f"mode = {ended}if (pre(mode) == 1 or start_forward) and speed > 0 then 1",
            "  else if (pre(mode) == -1 or start_backward) and speed < 0 then -1 else 0;",
        ]
        self.give("through")

    @property
    def _off(self) -> Mode | None:
        return next((mode for mode in self.modes.options if mode.name in ("waiting", "released")), None)

    def _active(self) -> Boolean:
        idle = (mode.starts for mode in self.modes.options if mode.name in ("waiting", "released"))
        return self.by_time(And(*(Not(starts) for starts in idle)))

    def _torque(self, mode: Mode) -> Expr:
        """What passes through in a mode that is not rigid."""
        values = resolve(self.part.component)[0]
        template = make_template(self.part.component, values, (ModeChoice(mode.form, mode.value),))
        return sum((self._through(branch) for branch in template.branches), Integer(0))

    def _through(self, branch: BranchTemplate) -> Expr:
        if branch.ends != self.part.ends_of(self.modes) or branch.kind not in _LAWS or branch.reads:
            raise CompileError(f"{self.title} rubs in a way that is not written in Modelica. {_NEXT}")
        return branch.law * ACROSS if branch.kind is Kind.CONDUCTANCE else branch.law

    def _limit(self, side: str) -> Expr:
        """The torque at which it gives way to a side: where the guard of that is zero."""
        guard = next(leave.when for leave in self.modes["stuck"].leaves if leave.to == side)
        limit = -guard.subs(THROUGH, 0) / guard.diff(THROUGH)
        return limit.xreplace({factor: Integer(sign) for sign in (1, -1) for factor in (Float(sign * GIVES_WAY),)})


_LAWS = (Kind.CONDUCTANCE, Kind.LAW, Kind.THROUGH_SOURCE)


class _FreewheelModel(_ModeModel):
    """What holds one way and lets go the other way."""

    def constitute(self) -> None:
        plus, _ = self.part.ends_of(self.modes)
        domain = self.domains[str(plus)]
        self.declare("speed", domain.across.unit)
        self.declare("through", domain.through.unit)
        self.variables += [
            "Boolean locked(start = true, fixed = true);",
            'Real s "Torque while it is locked, else in place of the acceleration";',
        ]
        self.equations += [
            f"speed = {self.across};",
            "der(speed) = if locked then 0 else s;",
            "through = if locked then s else 0;",
            "locked = not (initial() and speed < 0) and (if pre(locked) then s >= 0 else speed > 0 and s > 0);",
        ]
        self.give("through")


class _SwitchModel(_ModeModel):
    """A switch, with the small resistance and leakage of diodes."""

    def constitute(self) -> None:
        closed = self.law(self.by_time(self.modes["closed"].starts), "voltage")
        self.variables += [
            'parameter Real Ron(unit = "Ohm") = 1e-6 "Resistance while closed";',
            'parameter Real Goff(unit = "S") = 1e-8 "Conductance while open";',
            f'Real voltage(unit = "{ELECTRICAL.across.unit}");',
            f'Real current(unit = "{ELECTRICAL.through.unit}");',
            "Boolean closed;",
            'Real s "Current while closed, voltage while open";',
        ]
        self.equations += [
            f"closed = {closed};",
            f"voltage = {self.across};",
            "voltage = if closed then Ron * s else s;",
            "current = if closed then s else Goff * s;",
        ]
        self.give("current")
