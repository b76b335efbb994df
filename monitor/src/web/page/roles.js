// The roles of the session, and the counts of the run.

import { span } from "./axis.js";

const TITLES = { plant: "Plant", controller: "Controller", monitor: "Monitor" };

/** The cards of plant, controller and monitor. */
export class Roles {
  #cards = new Map();
  #session = {};

  constructor(list) {
    for (const [role, title] of Object.entries(TITLES)) {
      const card = document.createElement("li");
      card.dataset.role = role;
      const heading = document.createElement("strong");
      heading.textContent = title;
      const state = document.createElement("span");
      state.className = "state";
      const details = document.createElement("span");
      details.className = "details";
      card.append(heading, state, details);
      list.append(card);
      this.#cards.set(role, { card, state, details });
    }
    this.#show("plant", "absent", "not heard yet");
    this.#show("controller", "absent", "not heard yet");
    this.#show("monitor", "absent", "");
  }

  /** Takes the session of the monitor. */
  setSession(hello) {
    this.#session = hello;
  }

  /** Takes the state of the session. */
  update(now) {
    for (const role of now.roles) {
      const about = [];
      if (role.role === "controller" && now.law) about.push(`law ${now.law}`);
      if (role.since_s != null && role.state === "connected") about.push(`for ${span(role.since_s)}`);
      if (role.host) about.push(`${role.host} · process ${role.process}`);
      if (role.role === "controller" && now.standing_by) {
        about.push(`${now.standing_by} more ${now.standing_by === 1 ? "stands" : "stand"} by`);
      }
      if (role.heard_s != null) about.push(role.heard_s < 0.3 ? "heard just now" : `heard ${span(role.heard_s)} ago`);
      this.#show(role.role, role.state, about.join(" · ") || "not heard yet");
    }
    const { session, bus, version } = this.#session;
    const others = now.dashboards === 1 ? "this dashboard" : `${now.dashboards} dashboards`;
    this.#show("monitor", "connected", `session ${session} over ${bus} · ${others} · mtj ${version}`);
  }

  /** Shows that the connection to the monitor is lost. */
  disconnect() {
    this.#show("monitor", "silent", "trying to reach it");
  }

  #show(role, state, details) {
    const card = this.#cards.get(role);
    if (!card) return;
    card.card.dataset.state = state;
    if (card.state.textContent !== state) card.state.textContent = state;
    if (card.details.textContent !== details) card.details.textContent = details;
  }
}

/** The counts of the run, and their increase within the view. */
export class Counts {
  #items;
  #session;

  constructor(list, session) {
    this.#session = session;
    this.#items = [...list.querySelectorAll("[data-count]")];
  }

  update(now) {
    const { store, view } = this.#session;
    for (const item of this.#items) {
      const name = item.dataset.count;
      const parts = name.split(" ").map((part) => now.counts?.[part]);
      const count = parts[0] == null ? null : parts.reduce((sum, part) => sum + (part ?? 0), 0);
      const inView = item.dataset.series && store.extent(item.dataset.series, view.end - view.range, view.end);
      const more = inView ? Math.round(inView.max - inView.min) : 0;
      const text = count == null ? "–" : count.toLocaleString("en").replaceAll(",", "\u202f");
      const [number, recent] = item.querySelectorAll("b, small");
      if (number.textContent !== text) number.textContent = text;
      if (recent) recent.textContent = more > 0 ? `+${more}` : "";
      item.classList.toggle("some", more > 0);
      if (inView) item.title = more > 0 ? `${more} of them in view` : "";
    }
  }
}
