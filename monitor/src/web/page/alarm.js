// The banner for what must not go unnoticed.

const WORDS = {
  no_plant: "There is no plant. Start one with “mtj up”, or with “mtj plant”.",
  plant_silent: "The plant is silent.",
  no_controller: "The plant is waiting for a controller. Start one with “mtj controller”.",
  controller_silent: "The controller is silent.",
  no_monitor: "The connection to the monitor is lost; trying to reach it again.",
};

/** Shows one alarm at a time. What a screen reader announces changes only with the alarm itself. */
export class Alarm {
  #banner;
  #words;
  #detail;

  constructor(banner) {
    this.#banner = banner;
    this.#words = banner.querySelector("[role=alert]");
    this.#detail = banner.querySelector(".detail");
  }

  /** Takes `{code, sentence}`, or null if all is well. */
  show(alarm) {
    const code = alarm?.code ?? "";
    if (this.#banner.dataset.code !== code) {
      this.#banner.dataset.code = code;
      this.#banner.hidden = code === "";
      this.#words.textContent = code === "" ? "" : (WORDS[code] ?? alarm.sentence);
      document.title = code === "" ? "mtj" : `⚠ mtj: ${code.replace("_", " ")}`;
    }
    const detail = alarm && WORDS[code] ? alarm.sentence : "";
    if (this.#detail.textContent !== detail) this.#detail.textContent = detail;
  }
}
