// The connection to the monitor: receives its messages, and reconnects when it is lost.

/** Without a message for this long the connection is lost, ms; the monitor sends twenty a second. */
const SILENCE = 4_000;
/** Time between attempts, ms: doubled from the first to the longest, with a random part. */
const FIRST_WAIT = 250;
const LONGEST_WAIT = 5_000;

/** Dispatches "message" (with the object in `detail`), "open" and "lost" (with the ms until the next attempt). */
export class Live extends EventTarget {
  connected = false;
  #address;
  #socket = null;
  #wait = FIRST_WAIT;
  #lastMessage = 0;
  #retry = null;

  /** `address` is a function: when it reconnects, the page asks for what it does not have yet. */
  constructor(address) {
    super();
    this.#address = address;
    setInterval(() => this.#checkSilence(), 1_000);
    // Reconnect at once when the page is shown again or the network returns.
    for (const event of ["online", "focus"]) addEventListener(event, () => this.#retryNow());
    document.addEventListener("visibilitychange", () => document.hidden || this.#retryNow());
    this.#connect();
  }

  #connect() {
    this.#retry = null;
    const socket = new WebSocket(this.#address());
    this.#socket = socket;
    this.#lastMessage = performance.now();
    socket.addEventListener("message", (event) => this.#receive(socket, event));
    socket.addEventListener("close", () => this.#disconnect(socket));
  }

  #receive(socket, event) {
    if (socket !== this.#socket) return;
    this.#lastMessage = performance.now();
    if (!this.connected) {
      this.connected = true;
      this.#wait = FIRST_WAIT;
      this.dispatchEvent(new Event("open"));
    }
    this.dispatchEvent(new CustomEvent("message", { detail: JSON.parse(event.data) }));
  }

  #disconnect(socket) {
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
    if (!socket || performance.now() - this.#lastMessage < SILENCE) return;
    // Closing a dead connection properly can take a minute.
    socket.close();
    this.#disconnect(socket);
  }

  #retryNow() {
    if (this.#retry === null) return;
    clearTimeout(this.#retry);
    this.#connect();
  }
}
