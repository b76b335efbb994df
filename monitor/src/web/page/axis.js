// Axes, ticks, and the format of quantities.

const PREFIXES = [[1e9, "G"], [1e6, "M"], [1e3, "k"], [1, ""], [1e-3, "m"], [1e-6, "µ"], [1e-9, "n"]];
const MINUS = "\u2212";
const SPACE = "\u202f";

/** The SI prefix for a number of this size. */
function prefixFor(size) {
  if (!(size > 0)) return [1, ""];
  return PREFIXES.find(([factor]) => size >= factor * 0.9995) ?? PREFIXES.at(-1);
}

function digits(value, decimals) {
  return value.toFixed(decimals).replace("-", MINUS);
}

/** A quantity with three significant digits: "1.23 mm". */
export function quantity(value, unit) {
  if (value == null || !Number.isFinite(value)) return "–";
  if (unit === "") return digits(value, 3);
  const [factor, prefix] = prefixFor(Math.abs(value));
  const scaled = value / factor;
  const size = Math.abs(scaled);
  const decimals = size >= 99.95 || size === 0 ? 0 : size >= 9.995 ? 1 : 2;
  return `${digits(scaled, decimals)}${SPACE}${prefix}${unit}`;
}

/** A time span: "4.2 s", "3 min 20 s", "1 h 5 min". */
export function span(seconds) {
  if (seconds == null || !Number.isFinite(seconds)) return "–";
  if (seconds < 10) return `${seconds.toFixed(1)}${SPACE}s`;
  if (seconds < 60) return `${Math.floor(seconds)}${SPACE}s`;
  const minutes = Math.floor(seconds / 60);
  if (minutes < 60) return `${minutes}${SPACE}min ${Math.floor(seconds % 60)}${SPACE}s`;
  return `${Math.floor(minutes / 60)}${SPACE}h ${minutes % 60}${SPACE}min`;
}

/** The next step of 1, 2 or 5 times a power of ten. */
function niceStep(step) {
  const power = 10 ** Math.floor(Math.log10(step));
  const lead = step / power;
  return (lead <= 1.0001 ? 1 : lead <= 2.0001 ? 2 : lead <= 5.0001 ? 5 : 10) * power;
}

const TIME_STEPS = [0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 15, 30, 60, 120, 300];

/** Ticks of a time axis: {value, label}, at most `most` of them. */
export function timeTicks(from, to, most) {
  const step = TIME_STEPS.find((s) => (to - from) / s <= most) ?? 600;
  const decimals = step < 0.1 ? 2 : step < 1 ? 1 : 0;
  const ticks = [];
  for (let i = Math.ceil(from / step); i * step <= to; i += 1) {
    if (i >= 0) ticks.push({ value: i * step, label: `${(i * step).toFixed(decimals)}${SPACE}s` });
  }
  return ticks;
}

/** A linear axis: `place` maps a value to 0 (bottom) … 1 (top). */
class Linear {
  constructor(low, high, step, unit) {
    Object.assign(this, { low, high, step, unit });
  }

  place(value) {
    return (value - this.low) / (this.high - this.low);
  }

  /** Ticks at every step, with at most `most` labels, one of them at zero. */
  ticks(most) {
    const every = Math.ceil(Math.round((this.high - this.low) / this.step + 1) / most);
    const [factor, prefix] = this.unit === "" ? [1, ""] : prefixFor(Math.max(Math.abs(this.low), Math.abs(this.high)));
    const decimals = Math.max(0, -Math.floor(Math.log10(this.step / factor) + 1e-9));
    const ticks = [];
    for (let i = Math.round(this.low / this.step); i * this.step <= this.high + this.step * 1e-6; i += 1) {
      const number = digits((i * this.step) / factor, decimals);
      const label = i % every !== 0 ? "" : i === 0 ? "0" : this.unit === "" ? number : `${number}${SPACE}${prefix}${this.unit}`;
      ticks.push({ value: i * this.step, label });
    }
    return ticks;
  }
}

/** A logarithmic axis over whole decades. */
class Logarithmic {
  constructor(low, high, unit) {
    Object.assign(this, { low, high, unit });
  }

  place(value) {
    return value > 0 ? (Math.log10(value) - this.low) / (this.high - this.low) : -1;
  }

  ticks(most) {
    const every = Math.ceil((this.high - this.low) / most);
    const ticks = [];
    for (let decade = this.low; decade <= this.high; decade += 1) {
      const labelled = (this.high - decade) % every === 0;
      const [factor, prefix] = prefixFor(10 ** decade);
      const label = `${Math.round(10 ** decade / factor)}${SPACE}${prefix}${this.unit}`;
      ticks.push({ value: 10 ** decade, label: labelled ? label : "" });
    }
    return ticks;
  }

  /** Values of the faint lines between the decades. */
  minor() {
    const values = [];
    for (let decade = this.low; decade < this.high; decade += 1) {
      for (const lead of [2, 5]) values.push(lead * 10 ** decade);
    }
    return values;
  }
}

/** A linear axis for low … high; `last` is kept while it fits, so that the axis does not change all the time. */
export function linearAxis(low, high, most, unit, last) {
  const size = Math.max(Math.abs(low), Math.abs(high), 1e-9);
  if (high - low < size * 1e-3) [low, high] = [low - size * 0.5, high + size * 0.5];
  const step = niceStep((high - low) / most);
  const [bottom, top] = [Math.floor(low / step + 1e-6) * step, Math.ceil(high / step - 1e-6) * step];
  const suits = last instanceof Linear && last.most === most && last.low <= low && last.high >= high;
  if (suits && top - bottom > 0.45 * (last.high - last.low)) return last;
  return Object.assign(new Linear(bottom, top, step, unit), { most });
}

/** A logarithmic axis for low … high, five decades at most. */
export function logarithmicAxis(low, high, unit) {
  const top = Math.ceil(Math.log10(high) - 1e-6);
  const bottom = Math.max(Math.floor(Math.log10(low) + 1e-6), top - 5);
  return new Logarithmic(Math.min(bottom, top - 2), top, unit);
}
