// The page: messages of the monitor go into the store, and from there to the screen.
//
// For tests and the console, `window.mtj` holds `store` (bins, poses, marks; see store.js), `view` (time
// span and cursor; see view.js), `live.connected`, and `drawn`, the number of frames drawn so far.

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
import { Markers, Ruler } from "./ruler.js";
import { Store } from "./store.js";
import { Strip } from "./strip.js";
import { View } from "./view.js";

/** Shortest time between frames, ms: twenty-five a second, or two if the user wants little motion. */
const FRAME = 40;
const REDUCED_FRAME = 500;
/** The largest part of the time that drawing takes, as long as there are eight frames a second: a browser
 * without graphics hardware draws fewer. */
const SHARE = 0.4;
const SLOWEST_FRAME = 125;
/** Shortest time between updates of numbers, ms: a reader needs that long. */
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
const markers = new Markers($("markers"), session);
const ruler = new Ruler($("ruler"), session);
const arm = new Arm($("arm"), $("lens"), session);
const histogram = new Histogram($("histogram"), session);
const roles = new Roles($("roles"));
const counts = new Counts($("counts"), session);
const alarm = new Alarm($("banner"));
const knobs = new Knobs($("knobs"));
const follow = attachGestures($("charts"), view, (canvas) => strips.find((strip) => strip.canvas === canvas)?.columns);

// Drawing: on demand, at most once a frame, and not while the page is hidden.

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
  const pace = Math.max(calm.matches ? REDUCED_FRAME : FRAME, Math.min(cost / SHARE, SLOWEST_FRAME));
  const pause = lastDrawn + pace - performance.now();
  setTimeout(() => requestAnimationFrame(draw), Math.max(0, pause));
}

function draw() {
  waiting = false;
  const now = performance.now();
  lastDrawn = now;
  page.drawn += 1;
  // The timeout runs after the browser has shown the frame, so the cost includes that.
  setTimeout(() => (cost += (performance.now() - now - cost) / 8));
  follow();
  for (const part of strips) part.draw();
  markers.draw();
  ruler.draw();
  arm.draw();
  if (now - lastRead < READING) return;
  lastRead = now;
  for (const strip of strips) strip.read();
  if (newest) read(newest);
}

/** Writes the numbers that have no curves. */
function read(now) {
  roles.update(now);
  counts.update(now);
  showSpreads($("spreads"), now);
  write("law", now.law ?? "–");
  write("time", `${now.time.toFixed(1)} s`);
}

// The messages of the monitor.

const handlers = {
  hello(hello) {
    roles.setSession(hello);
    knobs.setSession(hello);
    layOut(hello.laws);
  },
  scenario(scenario) {
    const before = store.scenario;
    const another = scenario.run !== store.run;
    store.begin(scenario);
    if (another) {
      view.follow();
      joined = null;
      showChanges();
    }
    if (another || JSON.stringify(before.torque_limit) !== JSON.stringify(scenario.torque_limit)) {
      for (const strip of strips) strip.setScenario(scenario);
    }
    if (another || JSON.stringify(before.path) !== JSON.stringify(scenario.path)) arm.setScenario(scenario);
    hideCharts(scenario);
    $("scenario").textContent = scenario.name;
    $("clock").textContent = `${scenario.clock}, Tₛ = ${scenario.knobs["timing.sample_period"]}`;
    knobs.setScenario(scenario);
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
    histogram.update(now);
    knobs.setPhase(now.phase);
    if (now.joined?.time !== joined?.time) {
      joined = now.joined;
      showChanges();
    }
    write("phase", now.phase ?? "no plant");
    $("status").dataset.phase = now.phase ?? "none";
    redraw();
  },
  mark(mark) {
    store.mark(mark);
    showChanges();
    redraw();
  },
};

let laws = "";

/** Makes the charts of the laws, unless they are the same as before a reconnection. */
function layOut(described) {
  if (JSON.stringify(described) === laws) return;
  laws = JSON.stringify(described);
  strips = charts(described).map((definition) => new Strip(definition, session));
  $("strips").replaceChildren(...strips.map((strip) => strip.element));
  if (!store.scenario) return;
  for (const strip of strips) strip.setScenario(store.scenario);
  hideCharts(store.scenario);
}

/** Hides the charts of signals that the law in effect does not have. */
function hideCharts(scenario) {
  for (const strip of strips) strip.element.hidden = !strip.applies(scenario);
}

function write(id, text) {
  if ($(id).textContent !== text) $(id).textContent = text;
}

/** When the monitor joined the run: {time, words}; null if it was there from the start. */
let joined = null;

/** Lists the newest changes, and when the monitor joined: earlier changes are not known. */
function showChanges() {
  const entries = store.marks.map(({ time, accepted, words, reason }) => ({
    time,
    words: accepted ? words : `refused: ${(reason ?? words).replace(/^--set: /, "")}`,
    refused: !accepted,
  }));
  if (joined) entries.push(joined);
  entries.sort((a, b) => b.time - a.time);
  const items = entries.slice(0, 12).map(({ time, words, refused = false }) => {
    const item = document.createElement("li");
    const when = document.createElement("time");
    when.textContent = `${time.toFixed(1)} s`;
    const what = document.createElement("span");
    what.textContent = words;
    item.append(when, what);
    item.classList.toggle("refused", refused);
    return item;
  });
  $("changes").replaceChildren(...items);
}

const address = `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/live`;
page.live = new Live(() => (store.length > 0 ? `${address}?run=${store.run}&since=${store.newest}` : address));
page.live.addEventListener("message", ({ detail }) => handlers[detail.kind]?.(detail));
page.live.addEventListener("lost", () => {
  alarm.show({ code: "no_monitor", sentence: "" });
  newest = null;
  roles.disconnect();
});

// The buttons above the charts.

for (const button of document.querySelectorAll("button[data-range]")) {
  button.addEventListener("click", () => view.show(Number(button.dataset.range)));
}
$("hold").addEventListener("click", () => (view.following ? view.hold() : view.follow()));
$("follow").addEventListener("click", () => view.follow());
$("csv").addEventListener("click", () => downloadCsv(session, strips.filter((strip) => !strip.element.hidden)));
$("png").addEventListener("click", () => downloadPng(session, markers.canvas, strips, ruler.canvas));
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
