// The banner of the most important alarm.

const WORDS = {
  no_plant: "There is no plant. Start one with “mtj up”, or with “mtj plant”.",
  plant_silent: "The plant is silent.",
  no_controller: "The plant is waiting for a controller. Start one with “mtj controller”.",
  controller_silent: "The controller is silent.",
  two_plants: "Two plants are in this session.",
  diverged: "The arm diverged. Reset begins anew.",
  stopped: "A joint left its limits. The arm brakes until it is resumed or reset.",
  safe_state: "The arm is in its safe state.",
  no_monitor: "The connection to the monitor is lost; trying to reach it again.",
};

/** Shows one alarm. The text for screen readers changes only with the kind of alarm. */
export class Alarm {
  #banner;
  #words;
  #detail;

  constructor(banner) {
    this.#banner = banner;
    this.#words = banner.querySelector("[role=alert]");
    this.#detail = banner.querySelector(".detail");
  }

  /** Shows `{code, sentence}`; null hides the banner. */
  show(alarm) {
    const code = alarm?.code ?? "";
    if (this.#banner.dataset.code !== code) {
      this.#banner.dataset.code = code;
      this.#banner.hidden = code === "";
      this.#words.textContent = code === "" ? "" : (WORDS[code] ?? alarm.sentence);
      document.title = code === "" ? "mtj" : `⚠ mtj: ${code.replaceAll("_", " ")}`;
    }
    const detail = alarm && WORDS[code] ? alarm.sentence : "";
    if (this.#detail.textContent !== detail) this.#detail.textContent = detail;
  }
}
