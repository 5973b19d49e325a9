"""A model on one screen: what an interpreter shows of it."""

from __future__ import annotations

from shaftwork.codegen.compiled_model import CompiledModel
from shaftwork.core.screen import counted, named, on_one_screen


def overview(model: CompiledModel) -> str:
    """States, parameters with their values, and the modes of parts that change theirs."""
    sizes = f"{counted(len(model.states), 'state')}, {counted(len(model.parameters), 'parameter')}"
    kind = "linear" if not model.form.waves and model.linear else "nonlinear"
    values = [f"{name} = {value:.6g}" for name, value in model.parameters.items()]
    changing = [
        f"{part.name}: {', '.join(dict.fromkeys(mode.words for element in part.modes for mode in element.options))}"
        for part in model.form.graph.parts
        if part.modes
    ]
    waves = [model.form.graph.part_of(end).name for end in model.form.waves[::2]]
    lines = [
        *named("states", model.states),
        *named("travelling waves", waves),
        *named("parameters", values, most=6),
        *(
            line
            for text in changing[:6]
            for line in named(text.partition(": ")[0], text.partition(": ")[2].split(", "))
        ),
    ]
    return on_one_screen(
        f"Model of '{model.form.graph.name}': {sizes}, {kind if not changing else 'parts that change their mode'}",
        lines,
        len(lines),
    )
