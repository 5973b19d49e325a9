"""The command that opens a live page: `shaftwork open`."""

from __future__ import annotations

from argparse import ArgumentParser, Namespace
from dataclasses import replace

from shaftwork.cli.command import Data, Say, command, end_option, load, start_of, start_options
from shaftwork.cli.reports import names_in
from shaftwork.cli.settings import point


def open_options(parser: ArgumentParser) -> None:
    """The options of `shaftwork open`."""
    end_option(parser, "that of the scene; of a model file 10")
    start_options(parser)
    parser.add_argument("--signals", metavar="NAME,...", type=names_in, help="quantities to draw, such as shaft.tau")
    parser.add_argument("--port", metavar="N", type=int, default=0, help="port of this machine (default: a free one)")
    parser.add_argument("--no-browser", action="store_true", help="print the address alone")


@command("sliders in the browser; motion, extremes, frequencies follow", open_options)
def open_page(options: Namespace, say: Say) -> Data:
    """A live page of a scene or a model file, until Ctrl-C."""
    from shaftwork.live.server import serve

    net, scene = load(options)
    subject = replace(scene, build=lambda: net) if scene else net
    serve(
        subject,
        port=options.port,
        browser=not options.no_browser,
        say=say,
        t_end=options.t_end,
        signals=options.signals,
        initial=start_of(options, net.compile()) if options.steady else point(options.initial, option="--initial"),
    )
    return {}
