"""Curves of a motion as plots for a page of HTML: they can be zoomed, and say the value under the pointer."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from shaftwork.core.errors import imported
from shaftwork.reporting.latex_parts import PAGE
from shaftwork.results.plotting import curve, grouped
from shaftwork.results.solution import Solution

if TYPE_CHECKING:
    from shaftwork.reporting.report import Report


def plots(report: Report) -> Mapping[str, str]:
    """The plots of a report by the name of the picture that each replaces; the first brings the script that draws.

    Raises:
        MissingExtraError: plotly is not installed.
    """
    if report.solution is None or not report.curves:
        return {}
    plotly = imported("plotly.graph_objects", "report", "Report.html")
    config = {"responsive": True, "displaylogo": False}
    return {
        name: _plot(plotly, report.solution, signals).to_html(
            full_html=False, include_plotlyjs=number == 0, config=config, div_id=name
        )
        for number, (name, signals) in enumerate(report.curves.items())
    }


def _plot(plotly: Any, solution: Solution, signals: tuple[str, ...]) -> Any:
    """Curves of like size and the same unit on one axis, time in common, lines at the changes of mode."""
    units = {name: solution.reader.unit(name) for name in signals}
    curves = {name: curve(solution.reader, name) for name in signals}
    groups = grouped(curves, units)
    figure = plotly.Figure().set_subplots(len(groups), 1, shared_xaxes=True, vertical_spacing=0.06)
    for row, (unit, members) in enumerate(groups, 1):
        for name in members:
            times, values = curves[name]
            columns = values[:, None] if values.ndim == 1 else values
            for column in columns.T:
                figure.add_scatter(x=times, y=column, name=name, row=row, col=1, line={"width": 1.2})
        figure.update_yaxes(title_text=unit, row=row, col=1)
    if len(solution.events) <= PAGE.marks:
        for t, part, _, mode in solution.events:
            figure.add_vline(x=t, line_width=0.5, line_color="grey", name=f"{part} {mode}")
    figure.update_xaxes(title_text="t in s", row=len(groups), col=1)
    figure.update_layout(
        height=120 + PAGE.axis * len(groups), margin={"l": 60, "r": 20, "t": 30, "b": 50}, template="none"
    )
    figure.update_layout(legend={"orientation": "h", "y": 1.02, "yanchor": "bottom"})
    return figure
