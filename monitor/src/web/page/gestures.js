// Pointer, wheel and keys move the view of the charts.

/** Part of the range that a key or one notch of the wheel moves. */
const NOTCH = 0.1;

/** Elements that use some keys themselves: a selector, and a test of the keys. */
const OWN_KEYS = [
  ["input[type=radio]", (key) => key === " " || key.startsWith("Arrow")],
  ["input:not([type=radio]), select, textarea", () => true],
  ["button, a", (key) => key === " "],
];

/**
 * Lets pointer, wheel and keyboard move a view over the charts within `area`. Returns a function that
 * updates the cursor after the charts have moved beneath the pointer.
 */
export function attachGestures(area, view, columnsOf) {
  const stacked = matchMedia("(max-width: 1099.98px)");
  let drag = null;
  let hover = null;

  const chartAt = (event) => event.target.closest?.("canvas");
  const point = () => {
    const columns = hover && columnsOf(hover.canvas);
    const x = hover && hover.x - hover.canvas.getBoundingClientRect().left;
    view.point(columns && x >= columns.left ? columns.time(x) : null);
  };
  const leave = () => {
    hover = null;
    point();
  };

  area.addEventListener("pointermove", (event) => {
    const canvas = drag?.canvas ?? chartAt(event);
    if (!canvas) return leave();
    hover = { canvas, x: event.clientX };
    if (drag) {
      const seconds = (drag.x - event.clientX) * drag.step;
      drag.x = event.clientX;
      if (seconds !== 0) view.pan(seconds);
    }
    point();
  });
  area.addEventListener("pointerleave", () => drag || leave());
  area.addEventListener("pointerdown", (event) => {
    const canvas = chartAt(event);
    const columns = canvas && columnsOf(canvas);
    if (event.button !== 0 || !columns) return;
    drag = { x: event.clientX, step: columns.step, canvas };
    canvas.setPointerCapture(event.pointerId);
    area.classList.add("dragging");
  });
  for (const end of ["pointerup", "pointercancel"]) {
    area.addEventListener(end, (event) => {
      if (drag && event.pointerType !== "mouse") leave();
      drag = null;
      area.classList.remove("dragging");
    });
  }

  area.addEventListener(
    "wheel",
    (event) => {
      if (!chartAt(event)) return;
      const sideways = event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY);
      // Where the charts are part of a long page, a plain wheel scrolls that.
      if (stacked.matches && !sideways && !event.ctrlKey && !event.metaKey) return;
      event.preventDefault();
      const notches = (Math.abs(event.deltaX) > Math.abs(event.deltaY) ? event.deltaX : event.deltaY) / 100;
      if (event.ctrlKey || event.metaKey) view.show(view.range * 2 ** notches);
      else view.pan(notches * NOTCH * view.range);
    },
    { passive: false },
  );

  const keys = {
    ArrowLeft: () => view.pan(-NOTCH * view.range),
    ArrowRight: () => view.pan(NOTCH * view.range),
    PageUp: () => view.pan(-view.range),
    PageDown: () => view.pan(view.range),
    Home: () => view.pan(-Infinity),
    End: () => view.follow(),
    "+": () => view.show(view.range / 2),
    "-": () => view.show(view.range * 2),
    " ": () => (view.following ? view.hold() : view.follow()),
  };
  // Wherever the focus is, unless its element needs the key, or a long page needs it to scroll.
  document.addEventListener("keydown", (event) => {
    const { target, key } = event;
    if (event.ctrlKey || event.altKey || event.metaKey || !Object.hasOwn(keys, key)) return;
    if (OWN_KEYS.some(([elements, uses]) => target.matches(elements) && uses(key))) return;
    if (stacked.matches && !area.contains(target)) return;
    event.preventDefault();
    keys[key]();
  });
  return point;
}
