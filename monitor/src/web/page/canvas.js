// A canvas in CSS pixels that knows its size and whether it is visible.

/** Keeps a canvas as sharp as the screen, and calls `changed` when its size or visibility changes. */
export class Surface {
  width = 0;
  height = 0;
  visible = false;

  constructor(canvas, changed) {
    this.canvas = canvas;
    this.context = canvas.getContext("2d");
    new ResizeObserver(([entry]) => {
      this.#resize(entry.contentRect.width, entry.contentRect.height);
      changed();
    }).observe(canvas);
    new IntersectionObserver((entries) => {
      this.visible = entries.at(-1).isIntersecting;
      if (this.visible) changed();
    }).observe(canvas);
  }

  #resize(width, height) {
    // More than two device pixels to a CSS pixel cost time and show no more.
    const ratio = Math.min(2, devicePixelRatio || 1);
    this.width = width;
    this.height = height;
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
    this.context.setTransform(ratio, 0, 0, ratio, 0, 0);
  }

  clear() {
    this.context.clearRect(0, 0, this.width, this.height);
    return this.context;
  }
}

/** Draws a straight line through the middle of pixels, so that it is sharp. */
export function rule(context, x1, y1, x2, y2) {
  const sharp = (value) => Math.round(value) + 0.5;
  const vertical = x1 === x2;
  context.moveTo(vertical ? sharp(x1) : x1, vertical ? y1 : sharp(y1));
  context.lineTo(vertical ? sharp(x2) : x2, vertical ? y2 : sharp(y2));
}
