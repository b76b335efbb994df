// The view: the time span of all charts, and the cursor.

/** The time spans with a button, s. */
export const RANGES = [5, 20, 60, 600];

/** Follows the newest data, or stands still. Dispatches "change" when any of it changes. */
export class View extends EventTarget {
  range = 20;
  /** The time of the cursor, s; null without one. */
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

  /** The time of the numbers in the legends: the cursor's, or the last one in view. */
  get instant() {
    return this.cursor ?? this.end;
  }

  /** Stops the view; data goes on. */
  hold() {
    if (this.#end === null) this.#move(this.#store.newest);
  }

  /** Follows the newest data. */
  follow() {
    this.#move(null);
  }

  /** Moves by some seconds; beyond the newest data it follows again. */
  pan(seconds) {
    const end = this.end + seconds;
    if (seconds > 0 && end >= this.#store.newest) return this.follow();
    this.#move(Math.max(end, this.#store.oldest + Math.min(this.range, 1)));
  }

  /** Sets the time span, s; the right end stays. */
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
