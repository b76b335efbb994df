// A histogram of round trip and residence over the last ten seconds.

import { quantity } from "./axis.js";
import { Surface, rule } from "./canvas.js";

const SERIES = [
  { name: "round_trip", colour: "series-1" },
  { name: "residence", colour: "series-2" },
];
/** Space for the labels of the axis, CSS pixels. */
const FOOT = 18;
const HEAD = 14;

export class Histogram {
  #session;
  #surface;
  #counts = null;
  #spreads = {};

  constructor(canvas, session) {
    this.canvas = canvas;
    this.#session = session;
    this.#surface = new Surface(canvas, () => this.draw());
  }

  /** Takes the state of the session; the histogram comes less often than the rest. */
  update(now) {
    this.#spreads = { round_trip: now.round_trip, residence: now.residence };
    if (!now.histogram) return;
    this.#counts = now.histogram;
    this.draw();
  }

  draw() {
    const { palette } = this.#session;
    const surface = this.#surface;
    if (!this.#counts || !surface.visible || surface.width < 2) return;
    const { edges_us: edges } = this.#counts;
    const context = surface.clear();
    const plot = { left: 4, right: surface.width - 4, top: HEAD, bottom: surface.height - FOOT };
    const [first, last] = this.#occupied();
    if (first > last) return;
    const [low, high] = [Math.log10(edges[first]), Math.log10(edges[last + 1])];
    const x = (us) => plot.left + ((Math.log10(us) - low) / (high - low)) * (plot.right - plot.left);
    this.#drawAxis(context, plot, x, edges[first], edges[last + 1]);

    const most = Math.max(...SERIES.flatMap(({ name }) => this.#counts[name]), 1);
    for (const { name, colour } of SERIES) {
      context.fillStyle = palette.colour(colour);
      context.globalAlpha = 0.45;
      context.beginPath();
      this.#counts[name].forEach((count, i) => {
        if (count === 0 || i < first || i > last) return;
        const left = x(edges[i]);
        // A single sample in ten thousand must be visible.
        const height = Math.max(2, (count / most) * (plot.bottom - plot.top));
        context.rect(left, plot.bottom - height, Math.max(1, x(edges[i + 1]) - left - 1), height);
      });
      context.fill();
      context.globalAlpha = 1;
    }
    this.#drawSpread(context, plot, x, edges[last + 1]);
  }

  /** First and last bin with samples: whole decades would leave most of the width empty. */
  #occupied() {
    const { edges_us: edges } = this.#counts;
    let [first, last] = [edges.length, -1];
    for (const { name } of SERIES) {
      this.#counts[name].forEach((count, i) => {
        if (count > 0) [first, last] = [Math.min(first, i), Math.max(last, i)];
      });
    }
    return [Math.max(0, first - 2), Math.min(edges.length - 2, last + 2)];
  }

  #drawAxis(context, plot, x, low, high) {
    const { palette } = this.#session;
    context.strokeStyle = palette.colour("grid");
    context.fillStyle = palette.colour("quiet");
    context.font = palette.font(11);
    context.textAlign = "center";
    context.textBaseline = "top";
    context.lineWidth = 1;
    context.beginPath();
    const decades = Math.log10(high / low);
    const leads = decades < 1.2 ? [1, 2, 5] : [1];
    let free = -Infinity;
    for (let power = Math.floor(Math.log10(low)); power <= Math.ceil(Math.log10(high)); power += 1) {
      for (const lead of leads) {
        const us = lead * 10 ** power;
        if (us < low || us > high) continue;
        rule(context, x(us), plot.top, x(us), plot.bottom + 3);
        const label = us < 999 ? `${us} µs` : us < 999e3 ? `${us / 1e3} ms` : `${us / 1e6} s`;
        const half = context.measureText(label).width / 2;
        const middle = Math.min(Math.max(x(us), half), plot.right - half);
        if (middle - half < free) continue;
        free = middle + half + 8;
        context.fillText(label, middle, plot.bottom + 5);
      }
    }
    rule(context, plot.left, plot.bottom, plot.right, plot.bottom);
    context.stroke();
  }

  /** p50, p99 and maximum of the round trip. */
  #drawSpread(context, plot, x, high) {
    const { palette } = this.#session;
    const spread = this.#spreads.round_trip;
    if (!spread) return;
    context.strokeStyle = palette.colour("series-1");
    context.fillStyle = palette.colour("ink");
    context.font = palette.font(10);
    context.textBaseline = "top";
    let free = -Infinity;
    for (const name of ["p50", "p99", "max"]) {
      const us = spread[name];
      if (!(us > 0) || us > high) continue;
      context.beginPath();
      rule(context, x(us), plot.top, x(us), plot.bottom);
      context.stroke();
      const half = context.measureText(name).width / 2;
      const middle = Math.min(Math.max(x(us), half), plot.right - half);
      if (middle - half < free) continue;
      free = middle + half + 4;
      context.textAlign = "center";
      context.fillText(name, middle, 1);
    }
  }
}

/** The table of p50, p99 and maximum beside the histogram. */
export function showSpreads(table, now) {
  for (const row of table.querySelectorAll("tr[data-spread]")) {
    const spread = now[row.dataset.spread];
    for (const cell of row.querySelectorAll("td[data-part]")) {
      cell.textContent = spread ? quantity(spread[cell.dataset.part] * 1e-6, "s") : "–";
    }
  }
}
