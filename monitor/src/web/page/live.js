// The connection to the monitor: hears what it says, and comes back by itself when it is lost.

/** Nothing heard for so long counts as lost, ms; the monitor speaks twenty times a second. */
const SILENCE = 4_000;
/** Waits between attempts, ms: doubled from the first to the longest, and never twice the same. */
const FIRST_WAIT = 250;
const LONGEST_WAIT = 5_000;

/** Says "message" (with the object in `detail`), "open" and "lost" (with the ms until the next attempt). */
export class Live extends EventTarget {
  connected = false;
  #address;
  #socket = null;
  #wait = FIRST_WAIT;
  #heard = 0;
  #retry = null;

  /** `address` is a function: on coming back the page asks for what it does not have yet. */
  constructor(address) {
    super();
    this.#address = address;
    setInterval(() => this.#checkSilence(), 1_000);
    // A page that is shown again, or a network that returns, should not wait.
    for (const event of ["online", "focus"]) addEventListener(event, () => this.#retryNow());
    document.addEventListener("visibilitychange", () => document.hidden || this.#retryNow());
    this.#connect();
  }

  #connect() {
    this.#retry = null;
    const socket = new WebSocket(this.#address());
    this.#socket = socket;
    this.#heard = performance.now();
    socket.addEventListener("message", (event) => this.#hear(socket, event));
    socket.addEventListener("close", () => this.#lose(socket));
  }

  #hear(socket, event) {
    if (socket !== this.#socket) return;
    this.#heard = performance.now();
    if (!this.connected) {
      this.connected = true;
      this.#wait = FIRST_WAIT;
      this.dispatchEvent(new Event("open"));
    }
    this.dispatchEvent(new CustomEvent("message", { detail: JSON.parse(event.data) }));
  }

  #lose(socket) {
    if (socket !== this.#socket) return;
    this.connected = false;
    this.#socket = null;
    const wait = this.#wait * (0.75 + Math.random() / 2);
    this.#wait = Math.min(2 * this.#wait, LONGEST_WAIT);
    this.#retry = setTimeout(() => this.#connect(), wait);
    this.dispatchEvent(new CustomEvent("lost", { detail: wait }));
  }

  #checkSilence() {
    const socket = this.#socket;
    if (!socket || performance.now() - this.#heard < SILENCE) return;
    // Closing a dead connection properly can take a minute; it is given up instead.
    socket.close();
    this.#lose(socket);
  }

  #retryNow() {
    if (this.#retry === null) return;
    clearTimeout(this.#retry);
    this.#connect();
  }
}
