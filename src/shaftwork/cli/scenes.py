"""`shaftwork scenes`."""

from __future__ import annotations

from argparse import Namespace

from shaftwork.cli.command import Command, Data, Say


def run(_: Namespace, say: Say) -> Data:
    """The ready scenes, a line each."""
    from shaftwork.scenes import SCENES

    width = max(len(name) for name in SCENES)
    for scene in SCENES.values():
        say(f"{scene.name:{width}}  {scene.title} ({scene.source})")
    fields = ("name", "title", "source", "t_end", "signals", "chosen", "phases")
    return {"scenes": [{field: getattr(scene, field) for field in fields} for scene in SCENES.values()]}


COMMAND = Command("scenes", "the ready scenes, a line each with the source", run, model=False, machines=True)
