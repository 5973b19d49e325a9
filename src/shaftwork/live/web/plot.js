"use strict";

/* Curves over time, one axis for each unit, and tables. */

const MOST_MARKED = 60; // changes of mode up to which each is a line across the curves
const COLOURS = ["#1c4f8f", "#c4540a", "#2a7d3f", "#a3262a", "#6d4aa8", "#7a5230", "#b8478f", "#555b63"];

function traces(answer, named) {
  return setup.axes.flatMap((axis, place) =>
    axis.signals.map(name => ({
      x: answer.t,
      y: answer.curves[name],
      name: named ? name : `${name}, reference`,
      yaxis: place ? `y${place + 1}` : "y",
      mode: "lines",
      line: named ? { width: 1.4, color: colourOf(name) } : { width: 1, color: "#9aa3b0", dash: "dot" },
      showlegend: named,
    })),
  );
}

function colourOf(name) {
  return COLOURS[setup.axes.flatMap(axis => axis.signals).indexOf(name) % COLOURS.length];
}

function marks() {
  return extremes.flatMap(row =>
    [
      ["min", "smallest"],
      ["max", "largest"],
    ].map(([key, words]) => ({
      x: [row[`t_${key}`]],
      y: [row[key]],
      name: `${row.name}, ${words}`,
      yaxis: axisOf(row.name),
      mode: "markers",
      marker: { size: 7, color: colourOf(row.name), symbol: "circle-open" },
      showlegend: false,
    })),
  );
}

function axisOf(name) {
  const place = setup.axes.findIndex(axis => axis.signals.includes(name));
  return place ? `y${place + 1}` : "y";
}

function drawPlot() {
  const count = setup.axes.length;
  const layout = {
    height: 90 + 190 * count,
    margin: { l: 64, r: 12, t: 24, b: 40 },
    uirevision: "same",
    legend: { orientation: "h", y: 1.01, yanchor: "bottom" },
    xaxis: { title: { text: "t in s" }, anchor: count > 1 ? `y${count}` : "y", range: [shown.t[0], shown.t.at(-1)] },
    shapes: shown.phases.length > MOST_MARKED ? [] : shown.phases.slice(1).map(row => ({ type: "line", yref: "paper", x0: row.start, x1: row.start, y0: 0, y1: 1, line: { width: 0.5, color: "#9aa3b0" } })),
  };
  setup.axes.forEach((axis, place) => {
    const domain = [1 - (place + 1) / count + (place < count - 1 ? 0.04 : 0), 1 - place / count];
    layout[place ? `yaxis${place + 1}` : "yaxis"] = { title: { text: axis.unit }, domain };
  });
  const kept = reference ? traces(reference, false) : [];
  Plotly.react("plot", [...kept, ...traces(shown, true), ...marks()], layout, { responsive: true, displaylogo: false });
}

function fill(table, rows) {
  const body = byId(table).tBodies[0];
  body.replaceChildren(
    ...rows.map(cells => {
      const row = document.createElement("tr");
      row.append(
        ...cells.map(content => {
          const cell = document.createElement("td");
          if (content instanceof Node) cell.append(content);
          else if (typeof content === "number") {
            cell.textContent = printed(content);
            cell.dataset.value = content;
          } else cell.textContent = content;
          return cell;
        }),
      );
      return row;
    }),
  );
}
