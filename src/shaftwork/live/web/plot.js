"use strict";

/* Curves over time, one axis for each unit, and tables. */

const MOST_MARKED = 60; // changes of mode up to which each is a line across the curves
const AXIS = { type: "linear", ticklabeloverflow: "allow" }; // else data are searched for dates, and labels measured
const hidden = new Set(); // names of curves that are not drawn
const COLOURS = ["#1c4f8f", "#c4540a", "#2a7d3f", "#a3262a", "#6d4aa8", "#7a5230", "#b8478f", "#555b63"];

function traces(answer, named) {
  return layout.axes.flatMap((axis, place) =>
    axis.signals.map(name => ({
      x: answer.t,
      y: answer.curves[name],
      name: named ? name : `${name}, reference`,
      yaxis: place ? `y${place + 1}` : "y",
      mode: "lines",
      line: named ? { width: 1.4, color: colourOf(name) } : { width: 1, color: "#9aa3b0", dash: "dot" },
      visible: !hidden.has(name),
    })),
  );
}

/** A switch for each curve: plotly's legend measures its texts anew at every update, and no key reaches it. */
function makeLegend() {
  for (const name of layout.axes.flatMap(axis => axis.signals)) {
    const [label, box] = ["label", "input"].map(kind => document.createElement(kind));
    Object.assign(box, { type: "checkbox", checked: true });
    box.style.accentColor = colourOf(name);
    box.addEventListener("change", () => {
      if (box.checked) hidden.delete(name);
      else hidden.add(name);
      drawPlot();
    });
    label.append(box, name);
    byId("legend").append(label);
  }
}

function colourOf(name) {
  return COLOURS[layout.axes.flatMap(axis => axis.signals).indexOf(name) % COLOURS.length];
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
      visible: !hidden.has(row.name),
    })),
  );
}

function axisOf(name) {
  const place = layout.axes.findIndex(axis => axis.signals.includes(name));
  return place ? `y${place + 1}` : "y";
}

/** Lines at the changes of mode, as one shape: each of many would be measured for itself. */
function phaseLines() {
  const starts = shown.phases.slice(1).map(row => row.start);
  if (!starts.length || starts.length > MOST_MARKED) return [];
  const path = starts.map(start => `M${start},0L${start},1`).join("");
  return [{ type: "path", yref: "paper", path, line: { width: 0.5, color: "#9aa3b0" } }];
}

function drawPlot() {
  const count = layout.axes.length;
  const sheet = {
    height: 90 + 190 * count,
    margin: { l: 64, r: 12, t: 8, b: 40 },
    uirevision: "same",
    showlegend: false,
    xaxis: { ...AXIS, title: { text: "t in s" }, anchor: count > 1 ? `y${count}` : "y", range: [shown.t[0], shown.t.at(-1)] },
    shapes: phaseLines(),
  };
  layout.axes.forEach((axis, place) => {
    const domain = [1 - (place + 1) / count + (place < count - 1 ? 0.04 : 0), 1 - place / count];
    sheet[place ? `yaxis${place + 1}` : "yaxis"] = { ...AXIS, title: { text: spelled(axis.unit) }, domain };
  });
  const before = reference ? traces(reference, false) : [];
  Plotly.react("plot", [...before, ...traces(shown, true), ...marks()], sheet, { responsive: true, displaylogo: false });
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
