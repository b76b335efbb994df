// A strip chart: series over time, with their limits, the changes and the cursor.
//
// Every pixel column shows the minimum and the maximum of its samples, so no peak is lost however much
// time is in view. Columns begin at whole multiples of their width in time: a chart that moves does not
// shimmer, and is drawn again only when it has moved by a pixel.

import { linearAxis, logarithmicAxis, quantity, timeTicks } from "./axis.js";
import { Surface, rule } from "./canvas.js";

/** Samples farther apart than this are not joined by a line, s; or than five sample periods. */
const GAP = 0.25;
/** Space between the lines' highest point and the edge, CSS pixels. */
const MARGIN = 4;

/** The pixel columns of the view on a plot of some width. */
export class Columns {
  constructor(view, left, width) {
    this.left = left;
    this.count = Math.max(1, Math.floor(width));
    this.step = view.range / this.count;
    this.last = Math.floor(view.end / this.step + 1e-6);
    this.from = (this.last + 1 - this.count) * this.step;
    this.to = (this.last + 1) * this.step;
  }

  /** The position of a time, CSS pixels from the canvas's left. */
  x(time) {
    return this.left + (time - this.from) / this.step;
  }

  /** The time at a position. */
  time(x) {
    return this.from + (x - this.left) * this.step;
  }

  contains(time) {
    return time >= this.from && time <= this.to;
  }
}

/** Width of the space for the labels of vertical axes, which all charts share. */
export function gutter(width) {
  return width < 480 ? 52 : 64;
}

/** One chart: its heading with a legend that shows numbers, and its canvas. */
export class Strip {
  #definition;
  #session;
  #surface;
  #axis = null;
  #mean = null;
  #series = [];
  #unit = "";
  #shown = "";
  #low = new Float32Array(0);
  #high = new Float32Array(0);

  constructor(definition, session) {
    this.#definition = definition;
    this.#session = session;
    this.element = document.createElement("section");
    this.element.className = "chart";
    this.element.id = `chart-${definition.id}`;
    this.element.dataset.weight = definition.weight ?? 1;
    const heading = document.createElement("header");
    const title = document.createElement("h3");
    title.textContent = definition.title;
    this.legend = document.createElement("ul");
    this.legend.className = "legend";
    this.canvas = document.createElement("canvas");
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `${definition.title} over time`);
    heading.append(title, this.legend);
    this.element.append(heading, this.canvas);
    this.#surface = new Surface(this.canvas, () => {
      this.#shown = "";
      session.redraw();
    });
  }

  get title() {
    return this.#definition.title;
  }

  /** What is drawn: {name, label, colour, factor, width}. */
  get series() {
    return this.#series;
  }

  get unit() {
    return this.#unit;
  }

  /** Makes the legend for the joints, the axes and the limits of a scenario. */
  setScenario(scenario) {
    const { unit } = this.#definition;
    this.#unit = typeof unit === "function" ? unit(scenario) : unit;
    this.#series = this.#definition.series(scenario);
    this.#axis = null;
    this.#shown = "";
    this.legend.replaceChildren(
      ...this.#series.map((series) => {
        const swatch = document.createElement("i");
        swatch.style.background = `var(--${series.colour})`;
        series.output = document.createElement("output");
        return entry(swatch, series.label, series.output);
      }),
    );
    const note = this.#definition.note?.(scenario);
    if (note) this.legend.append(entry(note));
    if (this.#definition.rms) {
      this.#mean = document.createElement("output");
      this.legend.append(entry("rms in view", this.#mean));
    }
  }

  /** Whether the law in effect has what the chart shows. */
  applies(scenario) {
    return this.#definition.applies?.(scenario) ?? true;
  }

  /** Writes the numbers at the cursor, or the newest ones, into the legend. */
  read() {
    const { store, view } = this.#session;
    const reach = Math.max(GAP, view.range / 100);
    for (const series of this.#series) {
      const bin = store.nearest(series.name, view.instant, reach);
      const value = bin && (Math.abs(bin.max) >= Math.abs(bin.min) ? bin.max : bin.min) * series.factor;
      write(series.output, quantity(value, series.unit ?? this.#unit));
    }
    if (!this.#mean) return;
    const rms = store.rms(this.#definition.rms, view.end - view.range, view.end);
    write(this.#mean, quantity(rms, this.#unit));
  }

  /** Draws if anything has changed. */
  draw() {
    const { store, view, palette } = this.#session;
    const surface = this.#surface;
    if (!surface.visible || surface.width < 2 || !store.scenario) return;
    const left = gutter(surface.width);
    const columns = new Columns(view, left, surface.width - left - 1);
    const fresh = view.range < 8 ? store.length : columns.last;
    const shown = [columns.last, columns.step, fresh, view.cursor, store.marks.length].join();
    if (shown === this.#shown) return;
    this.#shown = shown;
    this.columns = columns;

    const envelopes = this.#envelopes(columns);
    const plot = { top: MARGIN, bottom: surface.height - MARGIN };
    const most = Math.max(2, Math.floor((plot.bottom - plot.top) / 26));
    const axis = this.#scale(envelopes, most);
    const y = (value) => plot.bottom - axis.place(value) * (plot.bottom - plot.top);

    const context = surface.clear();
    this.#drawGrid(context, columns, axis, plot, y);
    this.#drawLimits(context, columns, axis, y);
    context.save();
    context.beginPath();
    context.rect(left, 0, surface.width - left, surface.height);
    context.clip();
    drawMarks(context, columns, store.marks, surface.height, palette);
    for (const envelope of envelopes) this.#drawSeries(context, columns, envelope, y);
    drawCursor(context, columns, view.cursor, surface.height, palette);
    context.restore();
  }

  /** Draws at the next chance even if nothing has changed: the theme or old data have. */
  forget() {
    this.#shown = "";
  }

  #envelopes(columns) {
    const size = this.#series.length * columns.count;
    if (this.#low.length !== size) {
      this.#low = new Float32Array(size);
      this.#high = new Float32Array(size);
    }
    return this.#series.map((series, i) => {
      const part = [i * columns.count, (i + 1) * columns.count];
      const low = this.#low.subarray(...part);
      const high = this.#high.subarray(...part);
      this.#session.store.envelope(series.name, columns.from, columns.step, low, high);
      return { series, low, high };
    });
  }

  #scale(envelopes, most) {
    const definition = this.#definition;
    let low = Infinity;
    let high = -Infinity;
    for (const envelope of envelopes) {
      const factor = envelope.series.factor;
      for (let i = 0; i < envelope.low.length; i += 1) {
        const [min, max] = [envelope.low[i] * factor, envelope.high[i] * factor];
        if (min < low && (min > 0 || !definition.logarithmic)) low = min;
        if (max > high) high = max;
      }
    }
    if (definition.logarithmic) {
      const some = high > 0 && low <= high;
      this.#axis = some ? logarithmicAxis(low, high, this.#unit) : (this.#axis ?? logarithmicAxis(1e-4, 1e-2, this.#unit));
    } else if (definition.span) {
      this.#axis = linearAxis(...definition.span, Math.min(most, 4), this.#unit, null);
    } else if (low <= high) {
      this.#axis = linearAxis(Math.min(low, 0), Math.max(high, 0), most, this.#unit, this.#axis);
    } else {
      this.#axis ??= linearAxis(0, 1, most, this.#unit, null);
    }
    return this.#axis;
  }

  #drawGrid(context, columns, axis, plot, y) {
    const { palette } = this.#session;
    const { width, height } = this.#surface;
    const left = columns.left;
    context.lineWidth = 1;
    if (axis.minor && (plot.bottom - plot.top) / (axis.high - axis.low) > 28) {
      context.strokeStyle = palette.colour("grid-faint");
      context.beginPath();
      for (const value of axis.minor()) rule(context, left, y(value), width, y(value));
      context.stroke();
    }
    const ticks = axis.ticks(Math.max(2, Math.floor((plot.bottom - plot.top) / 12)));
    context.strokeStyle = palette.colour("grid");
    context.beginPath();
    for (const tick of ticks) rule(context, left, y(tick.value), width, y(tick.value));
    for (const tick of timeTicks(columns.from, columns.to, columns.count / 80)) {
      rule(context, columns.x(tick.value), 0, columns.x(tick.value), height);
    }
    context.stroke();
    if (axis.low < 0 && axis.high > 0 && !axis.minor) {
      context.strokeStyle = palette.colour("axis");
      context.beginPath();
      rule(context, left, y(0), width, y(0));
      context.stroke();
    }
    context.fillStyle = palette.colour("quiet");
    context.font = palette.font(left < 60 ? 10 : 11);
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (const tick of ticks) {
      const middle = Math.min(height - 6, Math.max(6, y(tick.value)));
      context.fillText(tick.label, left - 6, middle);
    }
  }

  #drawLimits(context, columns, axis, y) {
    const { palette, store } = this.#session;
    const limits = this.#definition.limits?.(store.scenario) ?? [];
    context.save();
    context.setLineDash([6, 4]);
    for (const { value, colour } of limits) {
      if (value < axis.low || value > axis.high) continue;
      context.strokeStyle = palette.colour(colour);
      context.beginPath();
      rule(context, columns.left, y(value), this.#surface.width, y(value));
      context.stroke();
    }
    context.restore();
  }

  #drawSeries(context, columns, { series, low, high }, y) {
    const { palette, store } = this.#session;
    const gap = Math.max(GAP, 5 * samplePeriod(store.scenario)) / columns.step;
    context.strokeStyle = palette.colour(series.colour);
    context.lineWidth = series.width ?? 1.5;
    context.lineJoin = "bevel";
    context.beginPath();
    let before = -Infinity;
    let from = 0;
    for (let i = 0; i < columns.count; i += 1) {
      if (Number.isNaN(low[i])) continue;
      const x = columns.left + i + 0.5;
      let [start, end] = [y(low[i] * series.factor), y(high[i] * series.factor)];
      // From the last column's line to the nearer end of this one, so that the connection does not cross it.
      if (Math.abs(end - from) < Math.abs(start - from)) [start, end] = [end, start];
      if (i - before > Math.max(gap, 2)) {
        context.moveTo(x, start - 0.5);
        context.lineTo(x, start + 0.5);
      } else {
        context.lineTo(x, start);
      }
      if (end !== start) context.lineTo(x, end);
      from = end;
      before = i;
    }
    context.stroke();
  }
}

/** An entry of the legend without a line. */
function entry(...parts) {
  const item = document.createElement("li");
  item.append(...parts);
  return item;
}

function write(output, text) {
  if (output.textContent !== text) output.textContent = text;
}

/** Vertical lines at accepted and at refused changes. */
function drawMarks(context, columns, marks, height, palette) {
  context.save();
  context.lineWidth = 1;
  for (const mark of marks) {
    if (!columns.contains(mark.time)) continue;
    context.strokeStyle = palette.colour(mark.accepted ? "mark" : "refused");
    context.setLineDash(mark.accepted ? [] : [2, 3]);
    context.beginPath();
    rule(context, columns.x(mark.time), 0, columns.x(mark.time), height);
    context.stroke();
  }
  context.restore();
}

/** The cursor, at the same time in all charts. */
function drawCursor(context, columns, time, height, palette) {
  if (time === null || !columns.contains(time)) return;
  context.strokeStyle = palette.colour("cursor");
  context.lineWidth = 1;
  context.beginPath();
  rule(context, columns.x(time), 0, columns.x(time), height);
  context.stroke();
}

function samplePeriod(scenario) {
  const [, number, unit] = /^\s*([\d.eE+-]+)\s*(\S+)$/.exec(scenario?.knobs["timing.sample_period"] ?? "") ?? [];
  return Number(number ?? 0) * ({ ns: 1e-9, us: 1e-6, "µs": 1e-6, ms: 1e-3, s: 1 }[unit] ?? 0);
}
