"use strict";

/* The train as it moves: discs turn, slowed; shafts twist, exaggerated; gaps, brakes and clutches say their mode. */

const SWING = 0.6; // amplitude of a mode, rad
const SWINGS = 0.5; // of a mode per second
const TWIST = 0.8; // the largest twist as drawn, rad
const TURN = 5; // the largest speed as drawn, rad/s
const HEIGHT = 150; // of a row of discs, pixels
const HOLDS = /stuck|locked|engaged|contact|closed|conducting/;

/** The largest of 1, 2 and 5 times a power of ten up to a number. */
function rounded(number) {
  const power = 10 ** Math.floor(Math.log10(number));
  return [5, 2, 1].find(factor => factor * power <= number * (1 + 1e-9)) * power;
}

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

/** Integral of values over times, by trapezoids. */
function integral(t, values) {
  const sums = new Float64Array(t.length);
  for (let k = 1; k < t.length; k++) sums[k] = sums[k - 1] + ((t[k] - t[k - 1]) * (values[k] + values[k - 1])) / 2;
  return sums;
}

function largest(arrays) {
  let size = 0;
  for (const values of arrays) for (const value of values) size = Math.max(size, Math.abs(value));
  return size;
}

class Stage {
  constructor(canvas, train) {
    this.canvas = canvas;
    this.train = train;
    this.rows = 1 + Math.max(0, ...train.nodes.map(node => node.row));
    this.columns = 1 + Math.max(0, ...train.nodes.map(node => node.column));
    this.next = train.nodes.map((_, k) => train.links.filter(link => link.a === k || link.b === k));
    this.mode = null;
  }

  /** Take a motion: curves by name, its phases, values of parameters, and how many of its seconds one second plays. */
  update(t, curves, phases, value, rate) {
    const { nodes, links } = this.train;
    this.t = t;
    this.phases = phases;
    this.angles = nodes.map(node => integral(t, curves[node.speed]));
    this.twists = new Map();
    for (const link of links) {
      if (link.twist) this.twists.set(link, curves[link.twist]);
      else if (link.role === "store") this.twists.set(link, this.angles[link.a].map((angle, k) => angle - this.angles[link.b][k]));
    }
    this.ratios = new Map(links.filter(link => link.ratio).map(link => [link, value(link.ratio)]));
    const inertias = nodes.map(node => node.inertias.reduce((sum, name) => sum + (value(name) || 0), 0));
    const most = turns => Math.max(...inertias.filter((_, k) => nodes[k].turns === turns));
    const share = (inertia, k) => (inertia / most(nodes[k].turns)) ** 0.2;
    this.sizes = inertias.map((inertia, k) => (inertia > 0 ? Math.max(0.35, share(inertia, k)) : 0.25));
    const fastest = largest(nodes.map(node => curves[node.speed])) * rate;
    this.slowed = fastest > TURN ? rounded(TURN / fastest) : 1;
    const twist = largest(this.twists.values());
    this.exaggerated = twist > 0 && twist < TWIST ? rounded(TWIST / twist) : 1;
  }

  /** In words, how it is drawn. */
  get scale() {
    if (!this.train.nodes.length) return "This network has too many nodes to be drawn in motion.";
    if (this.mode) return `${this.mode.name} swings at ${SWINGS} Hz in place of ${this.mode.frequency.toPrecision(4)} Hz.`;
    const slow = this.slowed < 1 ? `turning slowed 1:${Math.round(1 / this.slowed)}` : "turning as it is";
    return `Drawn with ${slow}, twist ${this.exaggerated > 1 ? `exaggerated ${this.exaggerated} times` : "as it is"}.`;
  }

  /** Angles of all nodes at a time of the motion, as drawn. */
  drawnAngles(time) {
    const place = placeOf(this.t, time);
    const angles = new Array(this.train.nodes.length);
    for (let first = 0; first < angles.length; first++) {
      if (angles[first] !== undefined) continue;
      angles[first] = this.slowed * read(this.angles[first], place);
      for (const queue = [first]; queue.length; ) {
        const node = queue.shift();
        for (const link of this.next[node]) {
          const other = link.a === node ? link.b : link.a;
          if (angles[other] !== undefined) continue;
          angles[other] = this.across(link, node === link.a, angles[node], other, place);
          queue.push(other);
        }
      }
    }
    return angles;
  }

  across(link, forward, angle, other, place) {
    if (this.twists.has(link)) {
      const twist = this.exaggerated * read(this.twists.get(link), place);
      return forward ? angle - twist : angle + twist;
    }
    const ratio = this.ratios.get(link);
    if (ratio) return forward ? angle / ratio : angle * ratio;
    return this.slowed * read(this.angles[other], place);
  }

  /** Draw a time of the motion, or of a chosen mode the instant `clock` in s. */
  draw(time, clock) {
    const width = this.canvas.clientWidth;
    const height = HEIGHT * this.rows;
    const density = window.devicePixelRatio || 1;
    if (this.canvas.width !== Math.round(width * density) || this.canvas.height !== Math.round(height * density)) {
      this.canvas.width = Math.round(width * density);
      this.canvas.height = Math.round(height * density);
      this.canvas.style.height = `${height}px`;
    }
    const pen = this.canvas.getContext("2d");
    pen.setTransform(density, 0, 0, density, 0, 0);
    pen.clearRect(0, 0, width, height);
    if (!this.t || !this.train.nodes.length) return;
    const phase = 2 * Math.PI * SWINGS * clock;
    const angles = this.mode
      ? this.mode.shape.map(([real, imaginary]) => SWING * (real * Math.cos(phase) - imaginary * Math.sin(phase)))
      : this.drawnAngles(time);
    const room = width / this.columns;
    const places = this.train.nodes.map(node => ({ x: (node.column + 0.5) * room, y: (node.row + 0.42) * HEIGHT }));
    const radius = Math.min(42, 0.4 * room);
    const modes = this.mode ? {} : (this.phases.findLast(row => row.start <= time) || this.phases[0] || { modes: {} }).modes;
    for (const link of this.train.links) this.drawLink(pen, link, places, angles, modes, room);
    this.train.nodes.forEach((node, k) => this.drawNode(pen, node, places[k], radius * this.sizes[k], angles[k], room));
    this.train.nodes.forEach((_, k) => this.drawEnds(pen, k, places[k], radius * this.sizes[k], modes, room));
  }

  drawLink(pen, link, places, angles, modes, room) {
    const [a, b] = [places[link.a], places[link.b]];
    const mode = modes[link.part];
    const half = link.ratio ? 9 : 6;
    const open = mode !== undefined && !HOLDS.test(mode);
    pen.lineWidth = 1;
    pen.strokeStyle = open ? "#b35c00" : "#59616d";
    const [near, far] = open ? [0.44, 0.56] : [0.5, 0.5]; // an open part leaves its middle free
    const at = share => ({ x: a.x + share * (b.x - a.x), y: a.y + share * (b.y - a.y) });
    const [one, other] = [angles[link.a], angles[link.b]];
    const middle = (one + other) / 2;
    this.drawShaft(pen, a, at(near), half, one, open ? one : middle);
    this.drawShaft(pen, at(far), b, half, open ? other : middle, other);
    pen.fillStyle = open ? "#b35c00" : "#59616d";
    pen.font = "11px system-ui, sans-serif";
    pen.textAlign = "center";
    const words = mode === undefined ? link.part : `${link.part}: ${mode}`;
    if (mode !== undefined || room > 80) pen.fillText(words, (a.x + b.x) / 2, (a.y + b.y) / 2 - half - 5);
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

  drawNode(pen, node, at, radius, angle, room) {
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
    if (room > 45) {
      pen.fillStyle = "#1c1c1c";
      pen.font = "11px system-ui, sans-serif";
      pen.textAlign = "center";
      pen.fillText(node.name, at.x, at.y + Math.max(radius, 12) + 14);
    }
  }

  drawEnds(pen, k, at, radius, modes, room) {
    pen.font = "11px system-ui, sans-serif";
    pen.textAlign = "center";
    let y = at.y + Math.max(radius, 12) + 28;
    for (const end of this.train.ends.filter(one => one.node === k)) {
      const mode = modes[end.part];
      if (mode === undefined) continue;
      pen.fillStyle = HOLDS.test(mode) ? "#1a6b2f" : "#b35c00";
      pen.fillText(room > 45 ? `${end.part}: ${mode}` : mode, at.x, y);
      y += 13;
    }
  }
}
