// The colours of the canvases: those of the style sheet for the current theme.

const ORDER = ["auto", "light", "dark"];

/** Reads the style sheet's colours whenever the theme changes, and dispatches "change". */
export class Palette extends EventTarget {
  #colours = new Map();

  constructor() {
    super();
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.#refresh());
  }

  /** A colour by its name in the style sheet, without the dashes. */
  colour(name) {
    let colour = this.#colours.get(name);
    if (colour === undefined) {
      colour = getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
      this.#colours.set(name, colour);
    }
    return colour;
  }

  /** The font of the canvases, in so many CSS pixels. */
  font(size, weight = 400) {
    return `${weight} ${size}px ${this.colour("font")}`;
  }

  /** Makes a button step through the system's theme, light and dark; the choice is kept. */
  attach(button) {
    const show = (theme) => {
      if (theme === "auto") delete document.documentElement.dataset.theme;
      else document.documentElement.dataset.theme = theme;
      button.dataset.theme = theme;
      button.textContent = `Theme: ${theme}`;
      this.#refresh();
    };
    let theme = kept();
    if (!ORDER.includes(theme)) theme = "auto";
    show(theme);
    button.addEventListener("click", () => {
      theme = ORDER[(ORDER.indexOf(theme) + 1) % ORDER.length];
      keep(theme);
      show(theme);
    });
  }

  #refresh() {
    this.#colours.clear();
    this.dispatchEvent(new Event("change"));
  }
}

// A browser that may not store anything throws; the choice then lasts as long as the page.

function kept() {
  try {
    return localStorage.getItem("mtj.theme");
  } catch {
    return null;
  }
}

function keep(theme) {
  try {
    localStorage.setItem("mtj.theme", theme);
  } catch {
    // The choice is not kept, which does not matter.
  }
}
