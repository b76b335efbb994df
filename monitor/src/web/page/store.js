// The data of the page: the bins of the last ten minutes, the poses of the arm, the changes (marks).

/** How many bins are kept: ten minutes of 10 ms bins and a little. */
const KEPT = 61_000;
/** Length of the arrays; when they are full, the oldest bins are removed, all at once. */
const ROOM = 80_000;
/** How many poses are kept: ten minutes at 20 a second. */
const POSES = 12_000;
/** The most marks that are kept. */
const MARKS = 1_000;

/** Minimum and maximum of each bin, one array of each per series, oldest first. */
export class Store {
  run = null;
  scenario = null;
  marks = [];
  /** Poses of the arm: {time, arm, true_arm, desired}, oldest first. */
  poses = [];
  times = new Float64Array(ROOM);
  length = 0;
  series = new Map();

  /** Takes a scenario; a new run removes everything of the last one. */
  begin(scenario) {
    if (scenario.run !== this.run) {
      this.run = scenario.run;
      this.marks = [];
      this.poses = [];
      this.series.clear();
      this.length = 0;
    }
    this.scenario = scenario;
  }

  /** Takes bins, except those that it has from before a reconnection. */
  append({ t, series }) {
    let first = 0;
    if (this.length > 0) while (first < t.length && t[first] <= this.newest) first += 1;
    const count = t.length - first;
    if (count === 0) return;
    if (this.length + count > ROOM) this.#makeRoom(count);
    const start = this.length;
    for (let i = 0; i < count; i += 1) this.times[start + i] = t[first + i];
    for (const name of Object.keys(series)) if (!this.series.has(name)) this.#addSeries(name);
    for (const [name, { low, high }] of this.series) {
      const [lows, highs] = series[name] ?? [];
      for (let i = 0; i < count; i += 1) {
        low[start + i] = lows?.[first + i] ?? NaN;
        high[start + i] = highs?.[first + i] ?? NaN;
      }
    }
    this.length += count;
  }

  #addSeries(name) {
    const empty = () => new Float32Array(ROOM).fill(NaN);
    this.series.set(name, { low: empty(), high: empty() });
  }

  #makeRoom(count) {
    const from = Math.max(0, this.length - Math.max(0, KEPT - count));
    this.times.copyWithin(0, from, this.length);
    for (const { low, high } of this.series.values()) {
      low.copyWithin(0, from, this.length);
      high.copyWithin(0, from, this.length);
    }
    this.length -= from;
  }

  /** Takes a mark, unless it has it. */
  mark(mark) {
    const known = this.marks.some((m) => m.time === mark.time && m.words === mark.words && m.accepted === mark.accepted);
    if (known) return;
    this.marks.push(mark);
    this.marks.sort((a, b) => a.time - b.time);
    if (this.marks.length > MARKS) this.marks.shift();
  }

  /** Takes a pose of the arm. */
  pose(pose) {
    const last = this.poses.at(-1);
    if (last && pose.time <= last.time) this.poses.pop();
    this.poses.push(pose);
    if (this.poses.length > POSES * 1.1) this.poses.splice(0, this.poses.length - POSES);
  }

  /** Run time of the newest bin, s. */
  get newest() {
    return this.length > 0 ? this.times[this.length - 1] : 0;
  }

  /** Run time of the oldest bin, s. */
  get oldest() {
    return this.length > 0 ? this.times[0] : 0;
  }

  /** The first bin that does not begin before `time`. */
  indexOf(time) {
    let low = 0;
    let high = this.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.times[middle] < time) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** The last pose up to a time; null if there is none. */
  poseAt(time) {
    let low = 0;
    let high = this.poses.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.poses[middle].time <= time) low = middle + 1;
      else high = middle;
    }
    return low > 0 ? this.poses[low - 1] : null;
  }

  /** Minimum and maximum of a series in a time span; null without samples. */
  extent(name, from, to) {
    const series = this.series.get(name);
    if (!series) return null;
    let min = Infinity;
    let max = -Infinity;
    for (let i = this.indexOf(from); i < this.length && this.times[i] <= to; i += 1) {
      if (series.low[i] < min) min = series.low[i];
      if (series.high[i] > max) max = series.high[i];
    }
    return min <= max ? { min, max } : null;
  }

  /** Root mean square of a series in a time span, from the two extremes of each bin. */
  rms(name, from, to) {
    const series = this.series.get(name);
    if (!series) return null;
    let [sum, count] = [0, 0];
    for (let i = this.indexOf(from); i < this.length && this.times[i] <= to; i += 1) {
      if (Number.isNaN(series.low[i])) continue;
      sum += (series.low[i] ** 2 + series.high[i] ** 2) / 2;
      count += 1;
    }
    return count > 0 ? Math.sqrt(sum / count) : null;
  }

  /** The bin of a series nearest to a time, within `reach` seconds. */
  nearest(name, time, reach) {
    const series = this.series.get(name);
    if (!series) return null;
    const middle = this.indexOf(time);
    let best = null;
    for (const step of [-1, 1]) {
      for (let i = step < 0 ? middle - 1 : middle; i >= 0 && i < this.length; i += step) {
        const distance = Math.abs(this.times[i] - time);
        if (distance > reach || (best && distance >= best.distance)) break;
        if (!Number.isNaN(series.low[i])) {
          best = { distance, time: this.times[i], min: series.low[i], max: series.high[i] };
          break;
        }
      }
    }
    return best;
  }

  /**
   * Fills `low` and `high` with minimum and maximum of a series in each column of `step` seconds from
   * `from` on; NaN without samples.
   */
  envelope(name, from, step, low, high) {
    low.fill(NaN);
    high.fill(NaN);
    const series = this.series.get(name);
    if (!series) return;
    const end = from + low.length * step;
    for (let i = this.indexOf(from); i < this.length && this.times[i] < end; i += 1) {
      const min = series.low[i];
      if (Number.isNaN(min)) continue;
      const column = Math.min(low.length - 1, Math.floor((this.times[i] - from) / step));
      if (!(min >= low[column])) low[column] = min;
      if (!(series.high[i] <= high[column])) high[column] = series.high[i];
    }
  }
}
