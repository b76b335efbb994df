// The charts, and what each of them shows.

const SUBSCRIPTS = "₁₂₃₄₅₆₇";

function one(name, label, colour, factor = 1) {
  return { name, label, colour, factor };
}

/** The series of a quantity that has a number for each axis, for each joint, or one for the arm. */
function list({ key, symbol, per }, { axes, joints }) {
  const of = { axis: axes.map(({ name }) => ` ${name}`), joint: [...SUBSCRIPTS.slice(0, joints)], arm: [""] };
  return of[per].map((index, i) => one(`${key}.${i}`, symbol + index, `series-${i + 1}`));
}

/**
 * `series` makes the series of a chart for a scenario. A value times `factor` is in `unit`, or in the unit
 * of its series; `span` is a fixed range; `weight` is the chart's share of the height; `rms` is the series
 * whose root mean square in view is shown.
 */
const MOTION = [
  {
    id: "norm",
    title: "Tracking error, norm ‖e‖",
    unit: "m",
    logarithmic: true,
    weight: 2,
    rms: "error.norm",
    series: () => [{ ...one("law_error.norm", "as the law saw it", "series-under"), width: 3 }, one("error.norm", "measured", "series-1")],
  },
  {
    id: "error",
    title: "Tracking error e",
    // Metres and radians have one scale without a unit; the legend tells them apart.
    unit: ({ axes }) => (axes.every(({ unit }) => unit === axes[0].unit) ? axes[0].unit : ""),
    series: (scenario) =>
      list({ key: "error", symbol: "e", per: "axis" }, scenario).map((series, i) => ({ ...series, unit: scenario.axes[i].unit })),
  },
  {
    id: "torque",
    title: "Joint torque τ",
    unit: "N m",
    series: (scenario) => list({ key: "torque", symbol: "τ", per: "joint" }, scenario),
    limits: ({ torque_limit }) =>
      (torque_limit ?? []).flatMap((limit, i) =>
        limit === null ? [] : [-limit, limit].map((value) => ({ value, colour: `series-${i + 1}` })),
      ),
    note: ({ torque_limit }) =>
      torque_limit ? `limits ${torque_limit.map((limit) => (limit === null ? "none" : `±${limit}`)).join(", ")} N m` : "no limits",
  },
];

const TIMING = [
  {
    id: "trip",
    title: "Round trip and residence",
    unit: "s",
    logarithmic: true,
    series: () => [one("round_trip", "round trip", "series-1", 1e-6), one("residence", "residence", "series-2", 1e-6)],
  },
  {
    id: "latency",
    title: "Latency, sample to application",
    unit: "s",
    series: () => [one("latency", "latency", "series-3", 1e-3)],
  },
  {
    id: "period",
    title: "Sample-period jitter",
    unit: "s",
    series: () => [one("period_deviation", "deviation from Tₛ", "series-4", 1e-6)],
  },
];

/** The chart of a signal, shown while a law with this signal is in effect. */
function chart(signal, laws) {
  const shows = (law) => law.signals.some(({ key }) => key === signal.key);
  const names = laws.filter(shows).map(({ name }) => name);
  return {
    id: signal.key,
    title: `${signal.title} ${signal.symbol}`,
    unit: signal.unit,
    span: signal.range,
    applies: ({ knobs }) => names.includes(knobs["law.kind"]),
    // Signals with a range are often equal on all axes: a hidden line must be wider than the one above it.
    series: (scenario) =>
      list(signal, scenario).map((series, i, all) => (signal.range ? { ...series, width: 1.5 * (all.length - i) } : series)),
  };
}

/** All charts, those of the laws' signals among them. */
export function charts(laws) {
  const signals = new Map(laws.flatMap(({ signals }) => signals).map((signal) => [signal.key, signal]));
  return [...MOTION, ...[...signals.values()].map((signal) => chart(signal, laws)), ...TIMING];
}
