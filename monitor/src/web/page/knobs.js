// The knobs of the running loop. A control shows the value in effect. While a request is on its way, it
// shows the requested value, marked as such; if the plant refuses, it shows the reason.

import { forgetToken, token } from "./token.js";

/** The shortest time between two requests of a slider that is dragged, ms. */
const THROTTLE = 200;
/** How long an accepted value is shown without the new scenario, ms. */
const SCENARIO_TIMEOUT = 3_000;
/** How long the monitor may take to answer, ms. */
const TIMEOUT = 15_000;

/** Latencies a slider stops at, ms: fine near zero, where they matter most. */
const LATENCIES = [
  ...Array.from({ length: 20 }, (_, i) => i * 0.05),
  ...Array.from({ length: 16 }, (_, i) => 1 + i * 0.25),
  ...Array.from({ length: 16 }, (_, i) => 5 + i),
].map((ms) => Number(ms.toFixed(2)));

/** A duration like "10 ms" in milliseconds; null for other texts. */
export function milliseconds(text) {
  const [, number, unit] = /^\s*([\d.eE+-]+)\s*(ns|us|µs|ms|s|min)\s*$/.exec(text ?? "") ?? [];
  const factor = { ns: 1e-6, us: 1e-3, "µs": 1e-3, ms: 1, s: 1e3, min: 6e4 }[unit];
  return factor === undefined || Number.isNaN(Number(number)) ? null : Number((Number(number) * factor).toPrecision(9));
}

/** A number or a list as the user types it, in TOML. */
function list(text) {
  const parts = text.replace(/[[\]]/g, " ").split(/[\s,;]+/).filter(Boolean);
  return parts.length > 1 ? `[${parts.join(", ")}]` : (parts[0] ?? "");
}

/** The shortest text for a number, a list, or rows. */
function matrix(value) {
  const numbers = [value ?? []].flat();
  if (numbers.some(Array.isArray)) return JSON.stringify(value);
  return new Set(numbers).size === 1 ? String(numbers[0]) : numbers.join(", ");
}

/** For each kind of control: how it shows a value, and how it writes the user's text for `--set`. */
const FORMS = {
  choice: { show: (value) => String(value ?? "none"), write: (text) => text },
  list: { show: matrix, write: list },
  matrix: { show: matrix, write: (text) => (/\[\s*\[/.test(text) ? text : list(text)) },
  number: { show: (value) => (value == null ? "" : String(value)), write: (text) => text.trim().replace(",", ".") },
  duration: {
    show: (value) => (value ?? "").replace(/(\d)([a-zµ])/, "$1 $2"),
    // A number without a unit is in ms.
    write: (text) => (/[a-zµ]\s*$/.test(text) ? text.replace(/\s+/g, "") : `${text.trim().replace(",", ".")}ms`),
  },
  latency: { show: (value) => String(milliseconds(value) ?? 0), write: (text) => `${text.trim().replace(",", ".")}ms` },
};

/** An element with a class and children. */
function create(tag, name, ...children) {
  const element = document.createElement(tag);
  if (name) element.className = name;
  element.append(...children);
  return element;
}

/** A text in which `_x` is a subscript. */
function subscripted(words) {
  const [, before, low, after] = /^(.*?)_(\S+)(.*)$/.exec(words) ?? [];
  return low === undefined ? [words] : [before, create("sub", "", low), after];
}

/** Values with another label on their button. */
const WORDS = { none: "off", false: "off", true: "on" };

function radio(name, word, title = "") {
  const input = create("input");
  Object.assign(input, { type: "radio", name, value: word });
  const label = create("label", "", input, create("span", "", WORDS[word] ?? word));
  label.title = title;
  return label;
}

function field(id, unit) {
  const input = create("input");
  Object.assign(input, { id, autocomplete: "off" });
  return create("span", "number", input, ...(unit ? [create("i", "", unit)] : []));
}

/** The control of a parameter that the monitor describes. */
function control({ key, label, form, words, unit, default: usual, help }, choices = words.map((word) => radio(key, word))) {
  const id = key.replaceAll(".", "-");
  const isChoice = choices.length > 0;
  const name = create(isChoice ? "span" : "label", isChoice ? "label" : "", ...subscripted(label));
  const element = create("div", "knob", name);
  if (isChoice) {
    element.setAttribute("role", "radiogroup");
    element.setAttribute("aria-label", label);
    element.append(create("span", "choice", ...choices));
  } else {
    name.htmlFor = id;
  }
  if (form !== "choice") element.append(field(id, unit));
  if (form !== "choice" && isChoice) {
    element.classList.add("either");
    Object.assign(element.querySelector(".number input"), { placeholder: "other", ariaLabel: label });
  }
  Object.assign(element.dataset, { key, form });
  element.title = usual ? `${help} Default: ${usual}.` : help;
  return element;
}

/** The controls of parameters; two neighbours of the same form are side by side. */
function controls(parameters) {
  const elements = [];
  for (let i = 0; i < parameters.length; i += 1) {
    const [one, other] = parameters.slice(i, i + 2);
    const pairs = other && one.form === other.form && one.words.length + other.words.length === 0;
    elements.push(pairs ? create("div", "pair stacked", control(one), control(other)) : control(one));
    if (pairs) i += 1;
  }
  return elements;
}

/** One key of the scenario and its control. */
class Knob {
  #element;
  #form;
  #send;
  #inputs;
  #slider;
  #refusal;
  #value = null;
  #edited = false;
  #pending = 0;
  #awaited = false;

  constructor(element, send) {
    this.key = element.dataset.key;
    this.#element = element;
    this.#form = FORMS[element.dataset.form];
    this.#send = send;
    this.#slider = element.querySelector("input[type=range]");
    this.#inputs = [...element.querySelectorAll("input:not([type=range])")];
    this.#refusal = document.createElement("p");
    this.#refusal.className = "refusal";
    this.#refusal.id = `refusal-${this.key.replaceAll(".", "-")}`;
    this.#refusal.setAttribute("role", "status");
    element.append(this.#refusal);
    this.#inputs.forEach((input) => this.#attach(input));
    if (this.#slider) this.#attachSlider();
  }

  #attach(input) {
    if (input.type === "radio") {
      input.addEventListener("change", () => this.request(input.value));
      return;
    }
    input.addEventListener("input", () => (this.#edited = true));
    input.addEventListener("change", () => this.#edited && this.request(input.value));
    input.addEventListener("keydown", (event) => {
      if (event.key !== "Escape") return;
      this.#reset();
    });
  }

  #attachSlider() {
    const slider = this.#slider;
    slider.max = LATENCIES.length - 1;
    let [next, timer, last] = [null, null, -Infinity];
    const send = () => {
      timer = null;
      if (next === null) return;
      last = performance.now();
      const value = next;
      next = null;
      this.request(String(value));
    };
    slider.addEventListener("input", () => {
      next = LATENCIES[slider.valueAsNumber];
      this.#edited = true;
      this.#inputs[0].value = next;
      this.#describe(next);
      timer ??= setTimeout(send, Math.max(0, THROTTLE - (performance.now() - last)));
    });
  }

  #describe(value) {
    this.#slider.setAttribute("aria-valuetext", `${value} ms`);
  }

  /** Requests a value, given as the user typed it. */
  async request(text) {
    this.#edited = false;
    if (text.trim() === "") return this.#reset();
    this.#element.classList.add("pending");
    this.#refuse("");
    this.#pending += 1;
    this.#awaited = true;
    const answer = await this.#send({ set: [`${this.key}=${this.#form.write(text)}`] });
    this.#pending -= 1;
    if (this.#pending > 0) return;
    if (answer.accepted && this.#awaited) {
      setTimeout(() => this.#show(), SCENARIO_TIMEOUT);
      return;
    }
    this.#show();
    if (!answer.accepted) this.#refuse(answer.reason);
  }

  /** Shows the value in effect, unless the user edits it or a request is on its way. */
  #show() {
    if (this.#pending === 0 && !this.#edited) this.#reset();
  }

  /** Takes the value in effect. */
  setValue(value) {
    if (String(value) !== String(this.#value)) this.#refuse("");
    this.#value = value;
    this.#awaited = false;
    this.#show();
  }

  #reset() {
    this.#edited = false;
    this.#element.classList.remove("pending");
    const text = this.#form.show(this.#value);
    const radios = this.#inputs.filter(({ type }) => type === "radio");
    for (const input of radios) input.checked = input.value === text;
    const isChosen = radios.some(({ checked }) => checked);
    for (const input of this.#inputs) if (input.type !== "radio") input.value = isChosen ? "" : text;
    if (!this.#slider) return;
    const ms = Number(text);
    const distance = (i) => Math.abs(LATENCIES[i] - ms);
    this.#slider.value = LATENCIES.reduce((best, _, i) => (distance(i) < distance(best) ? i : best), 0);
    this.#describe(ms);
  }

  #refuse(reason) {
    this.#refusal.textContent = reason.replace(/^--set: /, "");
    this.#element.classList.toggle("refused", reason !== "");
    for (const input of this.#inputs) {
      if (reason !== "") {
        input.setAttribute("aria-invalid", "true");
        input.setAttribute("aria-describedby", this.#refusal.id);
      } else {
        input.removeAttribute("aria-invalid");
        input.removeAttribute("aria-describedby");
      }
    }
  }
}

/** The whole panel. */
export class Knobs {
  #panel;
  #controls;
  #lock;
  #status;
  /** The permanent knobs with the choice of the law, and the knobs of the law in effect. */
  #knobs;
  #lawKnobs = [];
  #laws = [];
  #law = null;
  #token = token();
  #readOnly = false;
  #paused = null;

  constructor(panel) {
    this.#panel = panel;
    this.#controls = panel.querySelector("fieldset.all");
    this.#lock = panel.querySelector("#knobs-locked");
    this.#status = panel.querySelector("#knobs-status");
    this.#knobs = this.#attach(panel);
    panel.addEventListener("submit", (event) => event.preventDefault());
    for (const button of panel.querySelectorAll("button[data-set]")) {
      button.addEventListener("click", () => this.#press(button, { set: button.dataset.set.split(" ") }));
    }
    for (const button of panel.querySelectorAll("button[data-do]")) {
      button.addEventListener("click", () => this.#press(button, this.#action(button.dataset.do)));
    }
    const save = panel.querySelector("#save");
    save.addEventListener("click", () => this.#save(save));
    this.#showLock();
  }

  /** Makes knobs of the controls in a part of the panel. */
  #attach(part) {
    return [...part.querySelectorAll("[data-key]")].map((element) => new Knob(element, (knob) => this.post(knob)));
  }

  /** Makes the control that selects the law. */
  #setLaws(laws) {
    const choices = laws.map(({ name, title, equation }) => radio("law.kind", name, `${title}: ${equation}`));
    const part = create("div", "", control({ key: "law.kind", label: "law", form: "choice", help: "" }, choices));
    const place = this.#panel.querySelector("#law-knobs");
    place.querySelector("[data-key='law.kind']")?.remove();
    this.#knobs = [...this.#knobs.filter(({ key }) => key !== "law.kind"), ...this.#attach(part)];
    place.append(...part.children);
    this.#laws = laws;
    this.#law = null;
  }

  /** Makes the knobs of a law, with a group for each subtable of the scenario. */
  #setLaw(law) {
    this.#law = law;
    for (const element of this.#panel.querySelectorAll(".of-law")) element.remove();
    const groups = Map.groupBy(law?.parameters ?? [], ({ key }) => key.split(".").slice(1, -1).join(" "));
    const own = create("div", "of-law", ...controls(groups.get("") ?? []));
    groups.delete("");
    const others = [...groups].map(([table, parameters]) => {
      const { title, symbol } = law.signals.find(({ key }) => key === table) ?? {};
      const legend = title ? `${title} ${symbol}` : table[0].toUpperCase() + table.slice(1);
      return create("fieldset", "of-law", create("legend", "", legend), ...controls(parameters));
    });
    this.#lawKnobs = [own, ...others].flatMap((part) => this.#attach(part));
    this.#panel.querySelector("#law-knobs").append(own);
    this.#panel.querySelector("#plant-knobs").before(...others);
  }

  #action(name) {
    if (name === "pause") return this.#paused ? "resume" : "pause";
    if (name !== "kick") return name;
    const field = (id) => this.#panel.querySelector(`#${id}`);
    const torque = Array(field("kick-joint").options.length).fill(0);
    torque[field("kick-joint").selectedIndex] = field("kick-torque").valueAsNumber || 0;
    return { kick: { torque, milliseconds: field("kick-duration").valueAsNumber || 0 } };
  }

  async #press(button, knob, path = "/knob") {
    button.classList.add("pending");
    const answer = await this.post(knob, path);
    button.classList.remove("pending");
    this.#status.textContent = answer.accepted ? "" : answer.reason;
    this.#status.hidden = answer.accepted;
    return answer;
  }

  /** Saves the last seconds, and says where. */
  async #save(button) {
    const { file } = await this.#press(button, {}, "/save");
    this.#panel.querySelector("#saved").textContent = file ? `saved in ${file}` : "";
  }

  /** Takes the session of the monitor. */
  setSession(hello) {
    this.#readOnly = hello.read_only;
    this.#panel.querySelector("#save").hidden = !hello.saves;
    this.#showLock();
    if (JSON.stringify(hello.laws) !== JSON.stringify(this.#laws)) this.#setLaws(hello.laws);
  }

  /** Takes the values in effect. */
  setScenario(scenario) {
    const law = this.#laws.find(({ name }) => name === scenario.knobs["law.kind"]);
    if (law !== this.#law) this.#setLaw(law);
    for (const knob of [...this.#knobs, ...this.#lawKnobs]) knob.setValue(scenario.knobs[knob.key]);
    const joint = this.#panel.querySelector("#kick-joint");
    if (joint.options.length !== scenario.joints) {
      joint.replaceChildren(...Array.from({ length: scenario.joints }, (_, i) => new Option(`joint ${i + 1}`)));
    }
    for (const button of this.#panel.querySelectorAll("button[data-set]")) {
      const holds = button.dataset.set.split(" ").every((set) => isInEffect(set, scenario.knobs));
      button.setAttribute("aria-pressed", holds);
    }
  }

  /** Takes the phase of the run. */
  setPhase(phase) {
    const paused = phase === "paused";
    if (paused === this.#paused) return;
    this.#paused = paused;
    this.#panel.querySelector("button[data-do=pause]").textContent = paused ? "Resume run" : "Pause run";
  }

  /** Sends a request to the plant, or to the monitor; the result is always an answer. */
  async post(knob, path = "/knob") {
    try {
      const response = await fetch(path, {
        method: "POST",
        headers: { "Content-Type": "application/json", Authorization: `Bearer ${this.#token}` },
        body: JSON.stringify(knob),
        signal: AbortSignal.timeout(TIMEOUT),
      });
      const answer = await response.json().catch(() => ({}));
      if (response.status === 401) {
        forgetToken();
        this.#token = null;
        this.#showLock("The token was refused: a monitor has another one each time it starts.");
      }
      const accepted = response.ok && answer.accepted === true;
      return { accepted, file: answer.file, reason: answer.reason ?? `the monitor answered ${response.status}` };
    } catch {
      return { accepted: false, reason: "the monitor does not answer" };
    }
  }

  #showLock(refused = "") {
    const locked = this.#readOnly || !this.#token;
    this.#controls.disabled = locked;
    this.#lock.hidden = !locked;
    const how = "To turn knobs, open the address with “#token=…” that the monitor printed when it started.";
    this.#lock.textContent = this.#readOnly ? "This monitor was started with --read-only: no knobs can be turned." : `${refused} ${how}`.trim();
  }
}

/** Whether the scenario has this `key=value`. */
function isInEffect(set, knobs) {
  const [key, value] = set.split("=");
  const now = knobs[key] ?? "none";
  return String(now) === value || (milliseconds(value) !== null && milliseconds(String(now)) === milliseconds(value));
}
