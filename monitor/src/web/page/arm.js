// The arm at scale: desired path, desired tip, true and measured tip with a fading trail; and a lens
// that magnifies the measured tip around the desired one.

import { quantity } from "./axis.js";
import { Surface, rule } from "./canvas.js";

/** The length of the trail, s, and in how many steps it fades. */
const TRAIL = 3;
const FADES = 12;
/** Free space around the drawing, as a part of it. */
const MARGIN = 0.1;

/** Steps of 1, 2, 5 for scale bars: the largest that is no longer than `length`. */
function barLength(length) {
  const power = 10 ** Math.floor(Math.log10(length));
  return [5, 2, 1].find((lead) => lead * power <= length * 1.0001) * power;
}

export class Arm {
  #session;
  #surface;
  #lens;
  #box = null;
  #lensScale = 0;

  constructor(canvas, lens, session) {
    this.canvas = canvas;
    this.#session = session;
    this.#surface = new Surface(canvas, session.redraw);
    this.#lens = new Surface(lens, session.redraw);
  }

  /** Sets the path of a scenario. */
  setScenario(scenario) {
    this.#box = { left: 0, right: 0, bottom: 0, top: 0 };
    this.#lensScale = 0;
    scenario.path.forEach((point) => this.#include(point));
  }

  #include([x, y]) {
    const box = this.#box;
    box.left = Math.min(box.left, x);
    box.right = Math.max(box.right, x);
    box.bottom = Math.min(box.bottom, y);
    box.top = Math.max(box.top, y);
  }

  draw() {
    const { store, view, palette } = this.#session;
    const surface = this.#surface;
    const scenario = store.scenario;
    if (!scenario || !surface.visible || surface.width < 2) return;
    const pose = store.poseAt(view.instant);
    const measured = pose?.arm;
    // An elbow may be outside the path; a diverged one must not make all else a dot.
    measured?.filter((point) => Math.hypot(...point) <= scenario.reach * 1.01).forEach((point) => this.#include(point));

    const box = this.#box;
    const span = Math.max(box.right - box.left, box.top - box.bottom) * (1 + 2 * MARGIN);
    const scale = Math.min(surface.width, surface.height) / span;
    const middle = [(box.left + box.right) / 2, (box.bottom + box.top) / 2];
    const at = ([x, y]) => [Math.min(surface.width, surface.height) / 2 + (x - middle[0]) * scale, surface.height / 2 - (y - middle[1]) * scale];

    const context = surface.clear();
    context.lineJoin = "round";
    context.lineCap = "round";
    this.#drawGrid(context, at, scale);
    context.strokeStyle = palette.colour("path");
    context.lineWidth = 1.5;
    line(context, scenario.path.map(at));
    this.#drawTrail(context, at);
    if (pose?.true_arm) this.#drawLinks(context, pose.true_arm.map(at), "arm-true", 5);
    if (measured) this.#drawLinks(context, measured.map(at), "arm", 2);
    this.#drawTips(context, at, pose);
    this.#drawLens();
  }

  #drawGrid(context, at, scale) {
    const { palette } = this.#session;
    const { width, height } = this.#surface;
    const step = barLength(70 / scale) || 1;
    const [x0, y0] = at([0, 0]);
    const pixels = step * scale;
    context.lineWidth = 1;
    context.strokeStyle = palette.colour("grid-faint");
    context.beginPath();
    for (let x = x0 % pixels; x < width; x += pixels) rule(context, x, 0, x, height);
    for (let y = y0 % pixels; y < height; y += pixels) rule(context, 0, y, width, y);
    context.stroke();
    context.strokeStyle = palette.colour("quiet");
    context.beginPath();
    rule(context, 10, height - 10, 10 + pixels, height - 10);
    rule(context, 10, height - 14, 10, height - 6);
    rule(context, 10 + pixels, height - 14, 10 + pixels, height - 6);
    context.stroke();
    context.fillStyle = palette.colour("quiet");
    context.font = palette.font(11);
    context.textAlign = "center";
    context.textBaseline = "bottom";
    context.fillText(`${step} m`, 10 + pixels / 2, height - 13);
  }

  #drawTrail(context, at) {
    const { store, view, palette, calm } = this.#session;
    const [xs, ys] = [store.series.get("tip.0"), store.series.get("tip.1")];
    if (!xs || !ys) return;
    const end = view.instant;
    context.strokeStyle = palette.colour("measured");
    context.lineWidth = 2;
    const first = store.indexOf(end - TRAIL);
    const last = Math.min(store.indexOf(end + 1e-9), store.length - 1);
    const stride = Math.max(1, Math.floor((last - first) / 240));
    let points = [];
    let fade = 0;
    for (let i = first; i <= last; i += stride) {
      if (Number.isNaN(xs.low[i]) || Number.isNaN(ys.low[i])) continue;
      points.push(at([(xs.low[i] + xs.high[i]) / 2, (ys.low[i] + ys.high[i]) / 2]));
      const age = Math.min(FADES - 1, Math.floor(((store.times[i] - (end - TRAIL)) / TRAIL) * FADES));
      if (age > fade) {
        context.globalAlpha = calm ? 0.5 : (fade + 1) / FADES;
        line(context, points);
        points = points.slice(-1);
        fade = age;
      }
    }
    context.globalAlpha = 1;
    line(context, points);
  }

  #drawLinks(context, points, colour, width) {
    const { palette } = this.#session;
    context.strokeStyle = palette.colour(colour);
    context.lineWidth = width;
    line(context, points);
    context.fillStyle = palette.colour(colour);
    for (const [x, y] of points.slice(0, -1)) disc(context, x, y, width);
  }

  #drawTips(context, at, pose) {
    const { palette } = this.#session;
    if (pose?.desired) {
      const [x, y] = at(pose.desired);
      context.strokeStyle = palette.colour("desired");
      context.lineWidth = 2;
      context.beginPath();
      context.arc(x, y, 7, 0, 2 * Math.PI);
      context.stroke();
    }
    if (pose?.true_arm) cross(context, at(pose.true_arm.at(-1)), palette.colour("true"), 6);
    if (pose?.arm) {
      const [x, y] = at(pose.arm.at(-1));
      context.fillStyle = palette.colour("measured");
      disc(context, x, y, 3.5);
    }
  }

  /** The measured tip and its trail as seen from the desired one, which is the centre. */
  #drawLens() {
    const { store, view, palette } = this.#session;
    const { width, height, visible } = this.#lens;
    if (!visible || width < 2) return;
    const context = this.#lens.clear();
    const [xs, ys] = [store.series.get("error.0"), store.series.get("error.1")];
    const radius = width / 2 - 2;
    const end = view.instant;
    const first = store.indexOf(end - TRAIL);
    const last = Math.min(store.indexOf(end + 1e-9), store.length - 1);
    const points = [];
    let largest = 0;
    for (let i = first; xs && ys && i <= last; i += Math.max(1, Math.floor((last - first) / 240))) {
      if (Number.isNaN(xs.low[i]) || Number.isNaN(ys.low[i])) continue;
      // e is desired − measured: from the desired tip, the measured one is at −e.
      points.push([-(xs.low[i] + xs.high[i]) / 2, -(ys.low[i] + ys.high[i]) / 2]);
      largest = Math.max(largest, Math.hypot(...points.at(-1)));
    }
    if (largest > 0 && (largest > this.#lensScale || largest < this.#lensScale / 4)) {
      this.#lensScale = roundUp(largest * 1.05);
    }
    const [x0, y0] = [width / 2, width / 2];
    context.strokeStyle = palette.colour("grid");
    context.lineWidth = 1;
    context.beginPath();
    for (const part of [0.5, 1]) {
      context.moveTo(x0 + radius * part, y0);
      context.arc(x0, y0, radius * part, 0, 2 * Math.PI);
    }
    rule(context, x0 - radius, y0, x0 + radius, y0);
    rule(context, x0, y0 - radius, x0, y0 + radius);
    context.stroke();
    if (this.#lensScale === 0) return;
    const at = ([x, y]) => [x0 + (x / this.#lensScale) * radius, y0 - (y / this.#lensScale) * radius];
    context.strokeStyle = palette.colour("measured");
    context.lineWidth = 1.5;
    context.lineJoin = "round";
    const old = points.slice(0, Math.ceil(points.length / 2) + 1);
    context.globalAlpha = 0.35;
    line(context, old.map(at));
    context.globalAlpha = 1;
    line(context, points.slice(old.length - 1).map(at));
    context.strokeStyle = palette.colour("desired");
    context.beginPath();
    context.arc(x0, y0, 4, 0, 2 * Math.PI);
    context.stroke();
    context.fillStyle = palette.colour("measured");
    if (points.length > 0) disc(context, ...at(points.at(-1)), 3.5);
    context.fillStyle = palette.colour("ink");
    context.font = palette.font(11, 500);
    context.textAlign = "center";
    context.textBaseline = "bottom";
    context.fillText(`± ${quantity(this.#lensScale, "m").replace(/\.0+(?=\D)/, "")}`, x0, height);
  }
}

function roundUp(value) {
  const power = 10 ** Math.floor(Math.log10(value));
  return ([1, 2, 5].find((lead) => lead * power >= value) ?? 10) * power;
}

function line(context, points) {
  if (points.length < 2) return;
  context.beginPath();
  points.forEach(([x, y], i) => (i === 0 ? context.moveTo(x, y) : context.lineTo(x, y)));
  context.stroke();
}

function disc(context, x, y, radius) {
  context.beginPath();
  context.arc(x, y, radius, 0, 2 * Math.PI);
  context.fill();
}

function cross(context, [x, y], colour, size) {
  context.strokeStyle = colour;
  context.lineWidth = 1.5;
  context.beginPath();
  rule(context, x - size, y, x + size, y);
  rule(context, x, y - size, x, y + size);
  context.stroke();
}
