// The view: which span of time all charts show, and where the cursor is.

/** The spans that there are buttons for, s. */
export const RANGES = [5, 20, 60, 600];

/** Follows the newest data, or holds still at an instant. Says "change" when anything of it changes. */
export class View extends EventTarget {
  range = 20;
  /** Where the cursor is, s; null if nowhere. */
  cursor = null;
  #end = null;
  #store;

  constructor(store) {
    super();
    this.#store = store;
  }

  get following() {
    return this.#end === null;
  }

  /** The last instant in view, s. */
  get end() {
    return this.#end ?? this.#store.newest;
  }

  /** The instant that single numbers are about: the cursor's, or the last one. */
  get instant() {
    return this.cursor ?? this.end;
  }

  /** Freezes the view; data goes on. */
  hold() {
    if (this.#end === null) this.#move(this.#store.newest);
  }

  /** Goes to the newest data and stays with it. */
  follow() {
    this.#move(null);
  }

  /** Moves by some seconds; beyond the newest data it follows again. */
  pan(seconds) {
    const end = this.end + seconds;
    if (seconds > 0 && end >= this.#store.newest) return this.follow();
    this.#move(Math.max(end, this.#store.oldest + Math.min(this.range, 1)));
  }

  /** Shows a span of so many seconds; what is at the right stays there. */
  show(range) {
    this.range = Math.min(600, Math.max(1, range));
    this.#changed();
  }

  point(time) {
    if (time === this.cursor) return;
    this.cursor = time;
    this.#changed();
  }

  #move(end) {
    this.#end = end;
    this.#changed();
  }

  #changed() {
    this.dispatchEvent(new Event("change"));
  }
}
