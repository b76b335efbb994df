// What all charts share: the descriptions of changes above them, and the time axis below.

import { timeTicks } from "./axis.js";
import { Surface, rule } from "./canvas.js";
import { Columns, gutter } from "./strip.js";

/** The time axis. */
export class Ruler {
  #surface;
  #session;

  constructor(canvas, session) {
    this.canvas = canvas;
    this.#session = session;
    this.#surface = new Surface(canvas, session.redraw);
  }

  draw() {
    const { view, palette } = this.#session;
    const surface = this.#surface;
    if (!surface.visible || surface.width < 2) return;
    const left = gutter(surface.width);
    const columns = new Columns(view, left, surface.width - left - 1);
    const context = surface.clear();
    context.font = palette.font(11);
    context.fillStyle = palette.colour("quiet");
    context.strokeStyle = palette.colour("axis");
    context.textBaseline = "middle";
    context.beginPath();
    for (const { value, label } of timeTicks(columns.from, columns.to, columns.count / 80)) {
      const x = columns.x(value);
      rule(context, x, 0, x, 5);
      const half = context.measureText(label).width / 2;
      context.textAlign = "center";
      context.fillText(label, Math.min(Math.max(x, left + half), surface.width - half - 1), 13);
    }
    context.stroke();
    context.textAlign = "right";
    context.fillText("time", left - 6, 13);
    if (view.cursor !== null && columns.contains(view.cursor)) this.#drawCursor(context, columns);
  }

  #drawCursor(context, columns) {
    const { view, palette } = this.#session;
    const label = `${view.cursor.toFixed(columns.step < 0.01 ? 3 : 2)} s`;
    const width = context.measureText(label).width + 10;
    const x = Math.min(Math.max(columns.x(view.cursor), columns.left + width / 2), this.#surface.width - width / 2);
    context.fillStyle = palette.colour("cursor");
    context.fillRect(x - width / 2, 3, width, 18);
    context.fillStyle = palette.colour("surface");
    context.textAlign = "center";
    context.fillText(label, x, 13);
  }
}

const ROW = 16;
const ROWS = 2;

/** The longest description of a change above the charts, characters; the list of changes has all of it. */
const LONGEST = 46;

function shortened(words) {
  return words.length > LONGEST ? `${words.slice(0, LONGEST - 1)}…` : words;
}

/** Describes the changes in view; where space is short, the newest ones. */
export class Markers {
  #surface;
  #session;

  constructor(canvas, session) {
    this.canvas = canvas;
    this.#session = session;
    this.#surface = new Surface(canvas, session.redraw);
  }

  draw() {
    const { store, view, palette } = this.#session;
    const surface = this.#surface;
    if (!surface.visible || surface.width < 2) return;
    const left = gutter(surface.width);
    const columns = new Columns(view, left, surface.width - left - 1);
    const context = surface.clear();
    context.font = palette.font(11, 500);
    context.textAlign = "left";
    context.textBaseline = "middle";
    context.lineWidth = 1;
    // Each row is free up to here, coming from the right; no text crosses a line.
    const free = Array(ROWS).fill(surface.width);
    const lines = [];
    for (const mark of store.marks.filter(({ time }) => columns.contains(time)).reverse()) {
      const x = columns.x(mark.time);
      context.fillStyle = palette.colour(mark.accepted ? "mark" : "refused");
      context.strokeStyle = context.fillStyle;
      const words = shortened(mark.accepted ? mark.words : `refused: ${mark.words.replace(/^--set: /, "")}`);
      const width = context.measureText(words).width;
      const place = [x + 5, x - 5 - width]
        .flatMap((start) => free.map((limit, row) => ({ start, row, limit })))
        .find(({ start, limit }) => {
          const end = Math.max(start + width, x);
          return start >= 0 && end <= limit && !lines.some((line) => line > start && line < end);
        });
      context.beginPath();
      rule(context, x, place ? place.row * ROW + 2 : ROW * ROWS - 4, x, surface.height);
      context.stroke();
      if (!place) continue;
      context.fillText(words, place.start, place.row * ROW + ROW / 2 + 1);
      free[place.row] = Math.min(place.start, x) - 8;
      lines.push(x);
    }
  }
}
