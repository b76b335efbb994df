"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const byId = id => document.getElementById(id);
const { x, y, series, panels: panelAxes } = data.layout;
const isMap = y !== null;
const xAxis = data.axes[x], yAxis = isMap ? data.axes[y] : null;
const APART = 4;
let shown = data.shown[0], measure = data.measures.indexOf(shown.name);

const escape = text => String(text).replace(/[&<>"]/g, c => `&#${c.charCodeAt(0)};`);
const short = n => n === null || n === undefined ? "–" : String(Number(n.toPrecision(4)));
const value = cell => cell[2][measure] === null ? null : cell[2][measure] * shown.factor;
const isDiverged = cell => 2 * cell[5] > cell[4];
const command = cell => data.command + cell[1].map((at, axis) => data.axes[axis].flags[at]).join("");
const panelOf = cell => panelAxes.reduce((n, axis) => n * data.axes[axis].labels.length + cell[1][axis], 0);

// The same places as in the figures: the middle of a cell is a whole number.
const cellSize = (axis, length) => (length - (axis.isApart ? APART : 0)) / axis.labels.length;
const offset = (axis, length, place) =>
  (place + 0.5) * cellSize(axis, length) + (axis.isApart ? APART * Math.min(Math.max(place, 0), 1) : 0);
function placeOf(axis, number) {
  const known = axis.numbers.map((at, i) => [i, at]).filter(([, at]) => at !== null);
  let pair = null;
  for (let i = 1; i < known.length && (!pair || number > pair[1][1]); i++) pair = [known[i - 1], known[i]];
  if (!pair) return null;
  const [[i, from], [j, to]] = pair;
  const part = axis.isLog && from > 0 && number > 0
    ? Math.log(number / from) / Math.log(to / from) : (number - from) / (to - from);
  return i + part * (j - i);
}

function range() {
  let least = Infinity, most = 0;
  for (const cell of data.cells) {
    const numbers = isDiverged(cell) ? [] : [cell[2], ...(!isMap && cell[3] || [])].map(of => of[measure] * shown.factor);
    for (const n of numbers) if (n > 0) { least = Math.min(least, n); most = Math.max(most, n); }
  }
  if (!(least < Infinity)) return [0.5, 2];
  return least < most ? [least, most] : [least / 2, most * 2];
}
const part = (n, [least, most]) => Math.log(n / least) / Math.log(most / least);
const color = p => data.viridis[Math.round(Math.min(Math.max(p, 0), 1) * (data.viridis.length - 1))];

function axisBelow(axis, f) {
  const slanted = Math.max(...axis.labels.map(l => l.length)) > 8, taken = [];
  let out = "";
  for (const [place, label] of axis.ticks) {
    const at = f.left + offset(axis, f.width, place), room = slanted ? 13 : 10 + 6.2 * label.length;
    if (taken.some(other => Math.abs(other - at) < room)) continue;
    taken.push(at);
    const bottom = f.top + f.height;
    out += `<path class="tick" d="M${at} ${bottom}v4"/>` + (slanted
      ? `<text transform="translate(${at + 3} ${bottom + 12}) rotate(-40)" text-anchor="end">${escape(label)}</text>`
      : `<text x="${at}" y="${bottom + 16}" text-anchor="middle">${escape(label)}</text>`);
  }
  const middle = f.left + f.width / 2, below = f.top + f.height + (slanted ? 70 : 33);
  return out + `<text x="${middle}" y="${below}" text-anchor="middle">${escape(axis.title)}</text>`;
}
function leftLabels(ticks, title, f) {
  const taken = [];
  let out = "";
  for (const [at, label] of ticks) {
    if (taken.some(other => Math.abs(other - at) < 14)) continue;
    taken.push(at);
    out += `<path class="tick" d="M${f.left} ${at}h-4"/><text x="${f.left - 6}" y="${at + 4}" text-anchor="end">${escape(label)}</text>`;
  }
  return out + `<text transform="translate(12 ${f.top + f.height / 2}) rotate(-90)" text-anchor="middle">${escape(title)}</text>`;
}
function frameOf(width, height) {
  const slanted = Math.max(...xAxis.labels.map(l => l.length)) > 8;
  const f = { left: 54, top: 6, width: width - 62, height: height - (slanted ? 84 : 46) };
  f.box = `viewBox="0 0 ${width} ${height}"`;
  f.rect = `<rect class="frame" x="${f.left}" y="${f.top}" width="${f.width}" height="${f.height}"/>`;
  return f;
}

function map(panel, cells, scale) {
  const f = frameOf(300, 290), w = cellSize(xAxis, f.width), h = cellSize(yAxis, f.height);
  const rects = cells.map(([i, cell]) => {
    const n = value(cell);
    const fill = isDiverged(cell) ? "url(#far)" : n > 0 ? color(part(n, scale)) : "transparent";
    const left = f.left + offset(xAxis, f.width, cell[1][x]) - w / 2;
    const top = f.top + f.height - offset(yAxis, f.height, cell[1][y]) - h / 2;
    return `<rect class="cell" data-i="${i}" x="${left.toFixed(2)}" y="${top.toFixed(2)}" width="${(w + .2).toFixed(2)}" height="${(h + .2).toFixed(2)}" fill="${fill}"/>`;
  }).join("");
  let path = "", down = false;
  (data.limits[panel] || []).forEach((limit, column) => {
    const place = limit === null ? null : placeOf(yAxis, limit);
    if (place === null) { down = false; return; }
    const top = f.top + f.height - offset(yAxis, f.height, place);
    path += `${down ? "L" : "M"}${f.left + offset(xAxis, f.width, column)} ${top}`;
    down = true;
  });
  const clip = `<clipPath id="c${panel}"><rect x="${f.left}" y="${f.top}" width="${f.width}" height="${f.height}"/></clipPath>`;
  const line = path && ["under", "limit"].map(k => `<path class="${k}" clip-path="url(#c${panel})" d="${path}"/>`).join("");
  const ticks = yAxis.ticks.map(([at, label]) => [f.top + f.height - offset(yAxis, f.height, at), label]);
  return `<svg ${f.box}>${clip}${rects}${line}${f.rect}${axisBelow(xAxis, f)}${leftLabels(ticks, yAxis.title, f)}</svg>`;
}

function curves(panel, cells, [from, to]) {
  const least = from / 1.15, most = to * 1.15, f = frameOf(440, 330);
  const height = n => f.top + f.height * (1 - part(Math.max(n, least), [least, most]));
  const groups = new Map();
  for (const entry of cells) {
    const key = series === null ? 0 : entry[1][1][series];
    if (!isDiverged(entry[1]) && value(entry[1]) !== null) groups.set(key, [...groups.get(key) || [], entry]);
  }
  let out = "";
  for (const [key, run] of groups) {
    const stroke = data.colors[key % data.colors.length];
    run.sort((a, b) => a[1][1][x] - b[1][1][x]);
    const at = cell => f.left + offset(xAxis, f.width, cell[1][x]);
    const runs = [];
    run.forEach((entry, i) => {
      if (i && entry[1][1][x] === run[i - 1][1][1][x] + 1) runs[runs.length - 1].push(entry); else runs.push([entry]);
    });
    for (const part of runs) out += `<path d="M${part.map(([, c]) => `${at(c)} ${height(value(c))}`).join("L")}" fill="none" stroke="${stroke}" stroke-width="1.8"/>`;
    for (const [i, c] of run) {
      if (c[3]) out += `<path d="M${at(c)} ${height(c[3][0][measure] * shown.factor)}V${height(c[3][1][measure] * shown.factor)}" stroke="${stroke}" stroke-opacity=".55"/>`;
      out += `<circle cx="${at(c)}" cy="${height(value(c))}" r="2.6" fill="${stroke}"/><circle class="cell" data-i="${i}" cx="${at(c)}" cy="${height(value(c))}" r="7" fill="transparent"/>`;
    }
  }
  return `<svg ${f.box}>${out}${f.rect}${axisBelow(xAxis, f)}${leftLabels(decades(least, most).map(n => [height(n), short(n)]), shown.title, f)}</svg>`;
}
function decades(least, most) {
  const all = [];
  for (const digit of [1, 3, 2, 5]) for (let e = -12; e < 12; e++) all.push(Number(`${digit}e${e}`));
  return all.filter(n => n >= least && n <= most);
}

function legend(scale) {
  const far = `<span><svg width="26" height="14"><rect width="26" height="14" fill="url(#far)" stroke="var(--line)"/></svg>diverged</span>`;
  const hatch = `<svg width="0" height="0" style="position:absolute"><defs><pattern id="far" width="6" height="6" patternUnits="userSpaceOnUse" patternTransform="rotate(45)"><rect width="6" height="6" fill="var(--far)"/><rect width="1.6" height="6" fill="var(--hatch)"/></pattern></defs></svg>`;
  if (!isMap) {
    const names = series === null ? [] : data.axes[series].labels;
    return hatch + names.map((n, i) => `<span><svg width="22" height="4"><rect width="22" height="4" fill="${data.colors[i % data.colors.length]}"/></svg>${escape(n)}</span>`).join("")
      + (data.layout.seeds.length ? "<span>median; whiskers from least to greatest of the seeds</span>" : "");
  }
  const bar = `<span>${escape(shown.title)}: ${short(scale[0])}<i class="bar" style="background:linear-gradient(90deg,${data.viridis.join(",")})"></i>${short(scale[1])}, logarithmic</span>`;
  const limit = data.limits.length ? `<span><svg width="26" height="8" style="background:#fff"><path class="limit" d="M0 4h26"/></svg>${escape(data.limitCaption)}</span>` : "";
  return hatch + bar + far + limit;
}

function draw() {
  const scale = range(), groups = data.panels.map(() => []);
  data.cells.forEach((cell, i) => groups[panelOf(cell)].push([i, cell]));
  byId("legend").innerHTML = legend(scale);
  byId("figures").className = isMap ? "maps" : "curves";
  byId("figures").innerHTML = data.panels.map((panel, i) =>
    `<figure><figcaption>${escape(panel.title)}</figcaption>${(isMap ? map : curves)(i, groups[i], scale)}</figure>`).join("");
}

function tell(cell) {
  const pair = (name, text) => `<div><dt>${escape(name)}</dt><dd>${escape(text)}</dd></div>`;
  const at = cell[1].map((i, axis) => data.layout.seeds.includes(axis) ? "" : pair(data.axes[axis].name, `${data.axes[axis].labels[i]} ${data.axes[axis].unit}`));
  const spread = i => cell[3] && cell[3][0][i] !== null ? ` (${short(cell[3][0][i])} to ${short(cell[3][1][i])})` : "";
  const measured = data.measures.map((name, i) => pair(name, short(cell[2][i]) + spread(i)));
  const far = pair("diverged", cell[4] > 1 ? `${cell[5]} of ${cell[4]}` : cell[5] ? "yes" : "no");
  byId("point").innerHTML = `<dl>${at.join("")}</dl><dl>${measured.join("")}${far}${cell[6] ? pair("error", cell[6]) : ""}</dl>`
    + `<button title="Copy">${escape(command(cell))}</button>`;
}
async function copy(text) {
  const button = byId("point").querySelector("button");
  try { await navigator.clipboard.writeText(text); } catch {
    const area = Object.assign(document.body.appendChild(document.createElement("textarea")), { value: text });
    area.select(); document.execCommand("copy"); area.remove();
  }
  if (button) button.title = "Copied";
  if (button) button.style.outline = "2px solid #009e73";
}

let held = false;
const cellAt = event => event.target.closest && event.target.closest("[data-i]");
byId("figures").addEventListener("mouseover", event => {
  const at = cellAt(event);
  if (at && !held) tell(data.cells[at.dataset.i]);
});
byId("figures").addEventListener("click", event => {
  const at = cellAt(event);
  document.querySelectorAll(".chosen").forEach(other => other.classList.remove("chosen"));
  held = Boolean(at);
  if (!at) return;
  at.classList.add("chosen");
  const cell = data.cells[at.dataset.i];
  tell(cell);
  copy(command(cell));
});
byId("point").addEventListener("click", event => { if (event.target.closest("button")) copy(event.target.textContent); });
byId("measure").innerHTML = data.shown.map((s, i) => `<option value="${i}">${escape(s.title)}</option>`).join("");
byId("measure").addEventListener("change", event => {
  shown = data.shown[event.target.value];
  measure = data.measures.indexOf(shown.name);
  held = false;
  draw();
});
document.title = data.title;
byId("title").textContent = data.title;
byId("summary").textContent = `${data.points} points of the scenario ${data.scenarioName}. Click a point to copy the command that replays it.`;
byId("scenario").textContent = data.scenario;
byId("study").textContent = data.study;
draw();
