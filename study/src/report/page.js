"use strict";
const byId = id => document.getElementById(id);
const data = JSON.parse(byId("data").textContent);
const { x, y, series, panels, seeds } = data.layout;

const escape = text => String(text).replace(/[&<>"]/g, c => `&#${c.charCodeAt(0)};`);
const short = n => n === null || n === undefined ? "–" : String(Number(n.toPrecision(4)));

// A figure marks a cell with its panel, its column, and its row or its curve.
const across = y ?? series;
const panelOf = at => panels.reduce((n, axis) => n * data.axes[axis].labels.length + at[axis], 0);
const keyOf = at => [panelOf(at), at[x], across === null ? 0 : at[across]].join();
const cells = new Map(data.cells.map(cell => [keyOf(cell[0]), cell]));

const command = ([at, , , , , , , searched]) => searched ?? data.command + at.map((i, axis) => data.axes[axis].flags[i]).join("");

function draw(index) {
  const figures = document.querySelectorAll("template.figure");
  byId("figure").replaceChildren(figures[index].content.cloneNode(true));
}

function tell(cell) {
  const [at, medians, spread, points, diverged, error, limit] = cell;
  const pair = (name, text) => `<div><dt>${escape(name)}</dt><dd>${escape(text)}</dd></div>`;
  const positions = at.map((i, axis) => seeds.includes(axis)
    ? "" : pair(data.axes[axis].name, data.axes[axis].labels[i]));
  const range = i => spread && spread[0][i] !== null ? ` (${short(spread[0][i])} to ${short(spread[1][i])})` : "";
  const measured = data.measures.map((name, i) => pair(name, short(medians[i]) + range(i)));
  const ran = pair("diverged", points > 1 ? `${diverged} of ${points}` : diverged ? "yes" : "no");
  const inTheWay = limit ? pair("limit in the way", limit) : "";
  byId("point").innerHTML = `<dl>${positions.join("")}</dl><dl>${measured.join("")}${ran}${inTheWay}${error ? pair("error", error) : ""}</dl>`
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
const markAt = event => event.target.closest && event.target.closest("[data-at]");
byId("figure").addEventListener("mouseover", event => {
  const mark = markAt(event);
  if (mark && !held) tell(cells.get(mark.dataset.at));
});
byId("figure").addEventListener("click", event => {
  const mark = markAt(event);
  document.querySelectorAll(".chosen").forEach(other => other.classList.remove("chosen"));
  held = Boolean(mark);
  if (!mark) return;
  mark.classList.add("chosen");
  const cell = cells.get(mark.dataset.at);
  tell(cell);
  copy(command(cell));
});
byId("point").addEventListener("click", event => { if (event.target.closest("button")) copy(event.target.textContent); });
byId("measure").innerHTML = data.shown.map((title, i) => `<option value="${i}">${escape(title)}</option>`).join("");
byId("measure").addEventListener("change", event => { held = false; draw(event.target.value); });
document.title = data.title;
byId("title").textContent = data.title;
byId("summary").textContent = `${data.points} points of the scenario ${data.scenarioName}. Click a point to copy the command that replays it.`
  + (seeds.length ? " A cell shows the median of its seeds." : "") + ` ${data.spans}`;
byId("failed").textContent = data.failed;
byId("failed").hidden = !data.failed;
byId("scenario").textContent = data.scenario;
byId("study").textContent = data.study;
draw(0);
