"use strict";

/* The train as it moves: discs turn, slowed; shafts twist, enlarged; gaps, brakes and clutches say their mode. */

const SWING = 0.6; // amplitude of a mode, rad
const SWINGS = 0.5; // of a mode per second
const HEIGHT = 184; // of a row of discs, pixels
const MIDDLE = 84; // of a disc, from the upper edge of its row, pixels
const LARGEST = 42; // radius of a disc, pixels
const NARROWEST = 84; // column, pixels: a train that needs more than the screen has is scrolled
const LINE = 13; // height of a line of text, pixels
const HOLDS = /stuck|locked|engaged|contact|closed|conducting/;

/** The place of a time among ascending times, with its fraction. */
function placeOf(t, time) {
  let low = 0;
  let high = t.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (t[middle] <= time) low = middle;
    else high = middle;
  }
  const width = t[high] - t[low];
  return { low, high, share: width > 0 ? Math.min(1, Math.max(0, (time - t[low]) / width)) : 0 };
}

function read(values, place) {
  return values[place.low] + place.share * (values[place.high] - values[place.low]);
}

class Stage {
  constructor(canvas, train) {
    this.canvas = canvas;
    this.train = train;
    this.rows = 1 + Math.max(0, ...train.nodes.map(node => node.row));
    this.columns = 1 + Math.max(0, ...train.nodes.map(node => node.column));
    this.mode = null;
  }

  /** Take a motion: its times, the angles of the train at these, its phases, and values of parameters. */
  update(t, train, phases, value) {
    const { nodes } = this.train;
    this.t = t;
    this.phases = phases;
    this.shown = train;
    if (!train) return;
    this.angles = train.angles.map(numbers);
    const inertias = nodes.map(node => node.inertias.reduce((sum, name) => sum + (value(name) || 0), 0));
    const most = turns => Math.max(...inertias.filter((_, k) => nodes[k].turns === turns));
    const share = (inertia, k) => (inertia / most(nodes[k].turns)) ** 0.2;
    this.sizes = inertias.map((inertia, k) => (inertia > 0 ? Math.max(0.35, share(inertia, k)) : 0.25));
  }

  /** In words, how it is drawn. */
  get scale() {
    if (!this.shown) return "Nothing turns or slides, or too many nodes for a drawing in motion.";
    if (this.mode) {
      const { name, frequency } = this.mode;
      return frequency ? `${name} swings at ${SWINGS} Hz in place of ${printed(frequency, 4)} Hz.` : `Shape of ${name}, which does not swing.`;
    }
    return `Drawn with ${this.shown.words}.`;
  }

  /** Draw a time of the motion, or of a chosen mode the instant `clock` in s. */
  draw(time, clock) {
    const width = Math.max(this.canvas.parentElement.clientWidth, NARROWEST * this.columns);
    const height = HEIGHT * this.rows;
    const density = window.devicePixelRatio || 1;
    if (this.canvas.width !== Math.round(width * density) || this.canvas.height !== Math.round(height * density)) {
      this.canvas.width = Math.round(width * density);
      this.canvas.height = Math.round(height * density);
      Object.assign(this.canvas.style, { width: `${width}px`, height: `${height}px` });
    }
    const pen = this.canvas.getContext("2d");
    pen.setTransform(density, 0, 0, density, 0, 0);
    pen.clearRect(0, 0, width, height);
    if (!this.shown) return;
    const phase = 2 * Math.PI * SWINGS * clock;
    const place = placeOf(this.t, time);
    const angles = this.mode
      ? this.mode.shape.map(([real, imaginary]) => SWING * (real * Math.cos(phase) - imaginary * Math.sin(phase)))
      : this.angles.map(angle => read(angle, place));
    const room = width / this.columns;
    const places = this.train.nodes.map(node => ({ x: (node.column + 0.5) * room, y: node.row * HEIGHT + MIDDLE }));
    const radius = Math.min(LARGEST, 0.4 * room);
    const modes = this.mode ? {} : (this.phases.findLast(row => row.start <= time) || this.phases[0] || { modes: {} }).modes;
    for (const link of this.train.links) this.drawLink(pen, link, places, angles, modes);
    this.train.nodes.forEach((node, k) => this.drawNode(pen, node, places[k], radius * this.sizes[k], angles[k]));
    for (const link of this.train.links) this.nameLink(pen, link, places, modes);
    this.train.nodes.forEach((_, k) => this.nameNode(pen, k, places[k], radius * this.sizes[k], modes, room));
  }

  drawLink(pen, link, places, angles, modes) {
    const [a, b] = [places[link.a], places[link.b]];
    const mode = modes[link.part];
    const half = 6;
    const open = mode !== undefined && !HOLDS.test(mode);
    pen.lineWidth = 1;
    pen.strokeStyle = open ? "#b35c00" : "#59616d";
    const [near, far] = open ? [0.44, 0.56] : [0.5, 0.5]; // an open part leaves its middle free
    const at = share => ({ x: a.x + share * (b.x - a.x), y: a.y + share * (b.y - a.y) });
    const [one, other] = [angles[link.a], angles[link.b]];
    const middle = (one + other) / 2;
    const isApart = open || !link.twists; // each half turns with its end
    this.drawShaft(pen, a, at(near), half, one, isApart ? one : middle);
    this.drawShaft(pen, at(far), b, half, isApart ? other : middle, other);
  }

  /** The name of a part between two nodes, above all discs of its row; of one between rows, in its middle. */
  nameLink(pen, link, places, modes) {
    const [a, b] = [places[link.a], places[link.b]];
    const mode = modes[link.part];
    const colour = mode !== undefined && !HOLDS.test(mode) ? "#b35c00" : "#59616d";
    const lines = wrapped(pen, mode === undefined ? link.part : `${link.part}: ${mode}`, Math.max(NARROWEST, Math.abs(b.x - a.x)) - 8);
    const y = a.y === b.y ? a.y - LARGEST - LINE * lines.length + 6 : (a.y + b.y) / 2;
    write(pen, lines, (a.x + b.x) / 2, y, colour);
  }

  /** A piece of a shaft with lines along its surface, which show how it turns and twists. */
  drawShaft(pen, a, b, half, from, to) {
    for (const side of [-half, half]) {
      pen.beginPath();
      pen.moveTo(a.x, a.y + side);
      pen.lineTo(b.x, b.y + side);
      pen.stroke();
    }
    pen.save();
    pen.strokeStyle = "#1c4f8f";
    pen.lineWidth = 1.5;
    for (let line = 0; line < 4; line++) this.drawFibre(pen, a, b, half, from, to, (line * Math.PI) / 2);
    pen.restore();
  }

  /** A line along the surface of a shaft, where it is in front. */
  drawFibre(pen, a, b, half, from, to, offset) {
    const steps = 12;
    pen.beginPath();
    for (let k = 0; k <= steps; k++) {
      const angle = from + ((to - from) * k) / steps + offset;
      const x = a.x + ((b.x - a.x) * k) / steps;
      const y = a.y + ((b.y - a.y) * k) / steps - half * Math.sin(angle);
      if (k && Math.cos(angle) > 0) pen.lineTo(x, y);
      else pen.moveTo(x, y);
    }
    pen.stroke();
  }

  drawNode(pen, node, at, radius, angle) {
    pen.lineWidth = 1.5;
    pen.strokeStyle = "#1c1c1c";
    pen.fillStyle = "#eef2f8";
    pen.beginPath();
    if (node.turns) pen.arc(at.x, at.y, radius, 0, 2 * Math.PI);
    else pen.rect(at.x - radius, at.y - radius / 2, 2 * radius, radius);
    pen.fill();
    pen.stroke();
    pen.beginPath();
    if (node.turns) {
      pen.moveTo(at.x, at.y);
      pen.lineTo(at.x + radius * Math.cos(angle), at.y - radius * Math.sin(angle));
    } else {
      const turns = angle / (2 * Math.PI) + 0.5;
      const x = at.x - radius + 2 * radius * (turns - Math.floor(turns));
      pen.moveTo(x, at.y - radius / 2);
      pen.lineTo(x, at.y + radius / 2);
    }
    pen.strokeStyle = "#1c4f8f";
    pen.lineWidth = 3;
    pen.stroke();
  }

  /** The name of a node below it, and the modes of the parts that are there alone. */
  nameNode(pen, k, at, radius, modes, room) {
    const name = wrapped(pen, this.train.nodes[k].name, room - 4);
    let y = at.y + Math.max(radius, 12) + 14;
    write(pen, name, at.x, y, "#1c1c1c");
    y += LINE * name.length;
    for (const end of this.train.ends.filter(one => one.node === k && modes[one.part] !== undefined)) {
      const lines = wrapped(pen, `${end.part}: ${modes[end.part]}`, room - 4);
      write(pen, lines, at.x, y, HOLDS.test(modes[end.part]) ? "#1a6b2f" : "#b35c00");
      y += LINE * lines.length;
    }
  }
}

/** Words in lines as wide as there is room. */
function wrapped(pen, text, width) {
  pen.font = "11px system-ui, sans-serif";
  const lines = [];
  for (const word of text.split(" ")) {
    const longer = lines.length ? `${lines.at(-1)} ${word}` : word;
    if (lines.length && pen.measureText(longer).width <= width) lines[lines.length - 1] = longer;
    else lines.push(word);
  }
  return lines;
}

/** Lines of text about a place, with a white edge that parts them from what is below. */
function write(pen, lines, x, y, colour) {
  Object.assign(pen, { textAlign: "center", lineWidth: 3, strokeStyle: "#fff", fillStyle: colour });
  lines.forEach((line, k) => {
    pen.strokeText(line, x, y + LINE * k);
    pen.fillText(line, x, y + LINE * k);
  });
}
