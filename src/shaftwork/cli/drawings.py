"""The command that draws: `shaftwork draw`."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace

from shaftwork.cli.command import Data, Say, command, load


def draw_options(parser: ArgumentParser) -> None:
    """The options of `shaftwork draw`."""
    parser.add_argument("file", metavar="FILE", help="file to write: .svg, .pdf, .png, or .tex for TikZ")
    parser.add_argument("--circuit", action="store_true", help="the analogue circuit instead of the drive train")
    parser.add_argument("--dual", action="store_true", help="the dual circuit, force-voltage, instead of it")
    parser.add_argument("--values", action="store_true", help="the values of parameters too")
    parser.add_argument("--phase", metavar="WORDS", help="in one phase, such as 'gap open, load stuck'")
    parser.add_argument(
        "--width", metavar="PT", type=float, default=680.0, help="of the drawing; longer rows are broken"
    )
    parser.add_argument("--expand", action="store_true", help="with long shafts written out part by part")


@command("draw the network, as a drive train or as a circuit", draw_options)
def draw(options: Namespace, say: Say) -> Data:
    """A drawing of a network in a file."""
    net, _ = load(options)
    drawing = net.draw(
        as_circuit=options.circuit or options.dual,
        analogy="force-voltage" if options.dual else "force-current",
        values=options.values,
        expand=options.expand,
        phase=options.phase or None,
        width=options.width,
    )
    drawing.save(options.file)
    say(f"written: {options.file}")
    return {}
