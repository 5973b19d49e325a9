"""The text of a network in Modelica, in either form: the work of `Network.to_modelica`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Literal

from sympy import Float, Symbol

from shaftwork.codegen.compiled_model import CompiledModel
from shaftwork.codegen.start_values import initial_state
from shaftwork.components.discontinuities import breakpoints
from shaftwork.components.laws import t as TIME
from shaftwork.core.errors import CompileError, ParameterError
from shaftwork.core.parameters import in_si
from shaftwork.formulation.form import StateForm
from shaftwork.formulation.sampling_instants import refuse_sampled
from shaftwork.modelica.component_writer import component_text
from shaftwork.modelica.flat_model import flat_text, in_one_mode
from shaftwork.network.netlist import Netlist, title

Form = Literal["component", "flat"]
Library = Literal["standard", "inline"]
_BESIDE = 1e-9
"""Share of a time beside which a law is read to see whether it jumps there."""


def modelica_text(
    netlist: Netlist,
    sound: Callable[[Netlist], StateForm],
    form: Form,
    library: Library,
    t_end: float,
    initial: Mapping[str, float] | None,
) -> str:
    """The text; `Network.to_modelica` says of what.

    Args:
        netlist: of the network.
        sound: makes its state form, or raises what is wrong with it.
        form, library, t_end, initial: as there.
    """
    for option, value, values in (
        ("form", form, ("component", "flat")),
        ("library", library, ("standard", "inline")),
    ):
        if value not in values:
            raise ParameterError(f"{option} = {value!r} must be {' or '.join(map(repr, values))}.")
    end = in_si("t_end", t_end, "s", above=0)
    state_form = sound(netlist)
    refuse_sampled(state_form, "its instants are not written", CompileError)
    if form == "component":
        start = _start(state_form, initial)
        return component_text(state_form, inline=library == "inline", t_end=end, start=start)
    changing = [part.name for part in state_form.graph.parts if part.modes]
    if changing:
        state_form = sound(in_one_mode(netlist, state_form.graph))
    _refuse_impulses(state_form)
    # a source shows the torque that it gives to its node, a gap what its node gives to it
    turned = tuple(f"{name}.{through}" for name in changing for through in ("tau", "f"))
    return flat_text(state_form, _start(state_form, initial), end, turned)


def _start(form: StateForm, initial: Mapping[str, float] | None) -> dict[str, float]:
    """The start value of each state by name, 0 where all is at rest."""
    names = [state.name for state in form.states]
    if not initial and not form.has_impulses:
        return dict.fromkeys(names, 0.0)
    model = CompiledModel(form)
    return dict(zip(names, initial_state(model.bind(), initial or {}, 0.0).tolist(), strict=True))


def _refuse_impulses(form: StateForm) -> None:
    """Raise the error of prescribed speeds that jump where inertias follow them: rates hold no impulse.

    Raises:
        CompileError: there is one.
    """
    numbers = {Symbol(name, real=True): Float(value) for name, value in form.graph.parameters.items()}
    sources = form.across_sources if form.dependent_across else ()
    for source in sources:
        law = form.law_of(source).xreplace(numbers)
        for time in breakpoints(law):
            before, after = (float(law.subs(TIME, time + side * _BESIDE * max(1, abs(time)))) for side in (-1, 1))
            if time > 0 and abs(after - before) > 1e-6 * max(abs(after), abs(before)):
                raise CompileError(
                    f"{title(form.graph.part_of(source).component)} jumps at t = {time:g} s, and gives an impulse to "
                    "what is rigidly joined to it, which rates do not hold. Write the jump as a Ramp."
                )
