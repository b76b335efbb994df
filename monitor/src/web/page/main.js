// Puts the page together: what the monitor says goes into the store, and from there onto the screen.
//
// For tests and for the console, `window.mtj` is what the page knows: `store` (bins, poses, marks; see
// store.js), `view` (span and cursor; see view.js), `live.connected`, and `drawn`, how many pictures
// were drawn so far.

import { Alarm } from "./alarm.js";
import { Arm } from "./arm.js";
import { charts } from "./charts.js";
import { downloadCsv, downloadPng } from "./export.js";
import { attachGestures } from "./gestures.js";
import { Histogram, showSpreads } from "./histogram.js";
import { Knobs } from "./knobs.js";
import { Live } from "./live.js";
import { Palette } from "./palette.js";
import { Counts, Roles } from "./roles.js";
import { Lane, Ruler } from "./ruler.js";
import { Store } from "./store.js";
import { Strip } from "./strip.js";
import { View } from "./view.js";

/** Least time between pictures, ms: twenty-five a second, or two if the user wants little motion. */
const FRAME = 40;
const CALM_FRAME = 500;
/** Pictures take this part of the time at most, as long as there are eight a second: a browser without
 * graphics hardware draws fewer of them. */
const SHARE = 0.4;
const SLOWEST_FRAME = 125;
/** Least time between readings of numbers, ms: faster nobody reads. */
const READING = 200;

const $ = (id) => document.getElementById(id);
const calm = matchMedia("(prefers-reduced-motion: reduce)");

const store = new Store();
const view = new View(store);
const palette = new Palette();
const session = {
  store,
  view,
  palette,
  redraw,
  get calm() {
    return calm.matches;
  },
};

let strips = [];
const lane = new Lane($("lane"), session);
const ruler = new Ruler($("ruler"), session);
const arm = new Arm($("arm"), $("lens"), session);
const histogram = new Histogram($("histogram"), session);
const roles = new Roles($("roles"));
const counts = new Counts($("counts"), session);
const alarm = new Alarm($("banner"));
const knobs = new Knobs($("knobs"));
const follow = attachGestures($("charts"), view, (canvas) => strips.find((strip) => strip.canvas === canvas)?.columns);

// Drawing: on demand, never more often than a frame's time, and not at all while nobody looks.

let waiting = false;
let lastDrawn = -Infinity;
let lastRead = -Infinity;
let cost = 0;
let newest = null;
const page = { store, view, drawn: 0 };
window.mtj = page;

function redraw() {
  if (waiting) return;
  waiting = true;
  const pace = Math.max(calm.matches ? CALM_FRAME : FRAME, Math.min(cost / SHARE, SLOWEST_FRAME));
  const pause = lastDrawn + pace - performance.now();
  setTimeout(() => requestAnimationFrame(draw), Math.max(0, pause));
}

function draw() {
  waiting = false;
  const now = performance.now();
  lastDrawn = now;
  page.drawn += 1;
  // What comes after this frame comes after the browser has put it on the screen.
  setTimeout(() => (cost += (performance.now() - now - cost) / 8));
  follow();
  for (const part of strips) part.draw();
  lane.draw();
  ruler.draw();
  arm.draw();
  if (now - lastRead < READING) return;
  lastRead = now;
  for (const strip of strips) strip.read();
  if (newest) read(newest);
}

/** Writes the numbers that have no curves. */
function read(now) {
  roles.hear(now);
  counts.hear(now);
  showSpreads($("spreads"), now);
  write("law", now.law ?? "–");
  write("time", `${now.time.toFixed(1)} s`);
}

// What the monitor says.

const hear = {
  hello(hello) {
    roles.greet(hello);
    knobs.greet(hello);
    layOut(hello.laws);
  },
  scenario(scenario) {
    const before = store.scenario;
    const another = scenario.run !== store.run;
    store.begin(scenario);
    if (another) view.follow();
    if (another || JSON.stringify(before.torque_limit) !== JSON.stringify(scenario.torque_limit)) {
      for (const strip of strips) strip.adopt(scenario);
    }
    if (another || JSON.stringify(before.path) !== JSON.stringify(scenario.path)) arm.adopt(scenario);
    hideCharts(scenario);
    $("scenario").textContent = scenario.name;
    $("clock").textContent = `${scenario.clock}, Tₛ = ${scenario.knobs["timing.sample_period"]}`;
    knobs.adopt(scenario);
    redraw();
  },
  bins(bins) {
    store.append(bins);
    redraw();
  },
  now(now) {
    if (now.arm) store.pose({ time: now.time, arm: now.arm, true_arm: now.true_arm, desired: now.desired });
    newest = now;
    alarm.show(now.alarm);
    histogram.hear(now);
    knobs.hear(now.phase);
    write("phase", now.phase ?? "no plant");
    $("status").dataset.phase = now.phase ?? "none";
    redraw();
  },
  mark(mark) {
    store.mark(mark);
    log();
    redraw();
  },
};

let laws = "";

/** Makes the charts for what the laws show, unless they are the same as before a reconnection. */
function layOut(described) {
  if (JSON.stringify(described) === laws) return;
  laws = JSON.stringify(described);
  strips = charts(described).map((definition) => new Strip(definition, session));
  $("strips").replaceChildren(...strips.map((strip) => strip.element));
  if (!store.scenario) return;
  for (const strip of strips) strip.adopt(store.scenario);
  hideCharts(store.scenario);
}

/** Charts of what the law in effect does not have take no room. */
function hideCharts(scenario) {
  for (const strip of strips) strip.element.hidden = !strip.applies(scenario);
}

function write(id, text) {
  if ($(id).textContent !== text) $(id).textContent = text;
}

/** The newest changes in words. */
function log() {
  const items = store.marks.slice(-12).reverse().map((mark) => {
    const item = document.createElement("li");
    const time = document.createElement("time");
    time.textContent = `${mark.time.toFixed(1)} s`;
    const words = document.createElement("span");
    words.textContent = mark.accepted ? mark.words : `refused: ${(mark.reason ?? mark.words).replace(/^--set: /, "")}`;
    item.append(time, words);
    item.classList.toggle("refused", !mark.accepted);
    return item;
  });
  $("changes").replaceChildren(...items);
}

const address = `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`;
page.live = new Live(() => (store.length > 0 ? `${address}?run=${store.run}&since=${store.newest}` : address));
page.live.addEventListener("message", ({ detail }) => hear[detail.kind]?.(detail));
page.live.addEventListener("lost", () => {
  alarm.show({ code: "no_monitor", sentence: "" });
  newest = null;
  roles.lose();
});

// The buttons above the charts.

for (const button of document.querySelectorAll("button[data-range]")) {
  button.addEventListener("click", () => view.show(Number(button.dataset.range)));
}
$("hold").addEventListener("click", () => (view.following ? view.hold() : view.follow()));
$("follow").addEventListener("click", () => view.follow());
$("csv").addEventListener("click", () => downloadCsv(session, strips.filter((strip) => !strip.element.hidden)));
$("png").addEventListener("click", () => downloadPng(session, lane.canvas, strips, ruler.canvas));
view.addEventListener("change", () => {
  for (const button of document.querySelectorAll("button[data-range]")) {
    button.setAttribute("aria-pressed", Number(button.dataset.range) === view.range);
  }
  $("hold").setAttribute("aria-pressed", !view.following);
  $("follow").setAttribute("aria-pressed", view.following);
  $("charts").classList.toggle("held", !view.following);
  lastRead = -Infinity;
  redraw();
});
palette.addEventListener("change", () => {
  for (const strip of strips) strip.forget();
  histogram.draw();
  redraw();
});
palette.attach($("theme"));
view.show(20);
