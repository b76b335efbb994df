// Which charts there are, and what each of them shows.

const AXES = ["x", "y", "z", "φ", "θ", "ψ"];
const SUBSCRIPTS = "₁₂₃₄₅₆₇";

function perAxis(name, symbol, count) {
  return Array.from({ length: count }, (_, i) => ({
    name: `${name}.${i}`,
    label: `${symbol} ${AXES[i]}`,
    colour: `series-${i + 1}`,
    factor: 1,
  }));
}

function one(name, label, colour, factor = 1) {
  return { name, label, colour, factor };
}

/**
 * Each with the series it draws from a scenario. Values times `factor` are in `unit`; `span` is a range
 * that never changes; `weight` is the chart's share of the height; `rms` a series whose mean size in view
 * is worth knowing.
 */
export const CHARTS = [
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
    unit: "m",
    series: ({ axes }) => perAxis("error", "e", axes),
  },
  {
    id: "factor",
    title: "Regulating factor k",
    unit: "",
    span: [0, 1],
    applies: ({ knobs }) => knobs["law.kind"] === "mtj",
    // Two of the three forms of k are the same on all axes: a line beneath must show beside the one above.
    series: ({ axes }) => perAxis("factor", "k", axes).map((series, i) => ({ ...series, width: 1.5 + 1.5 * (axes - 1 - i) })),
  },
  {
    id: "torque",
    title: "Joint torque τ",
    unit: "N m",
    series: ({ joints }) =>
      Array.from({ length: joints }, (_, i) => ({
        name: `torque.${i}`,
        label: `τ${SUBSCRIPTS[i]}`,
        colour: `series-${i + 1}`,
        factor: 1,
      })),
    limits: ({ torque_limit }) =>
      (torque_limit ?? []).flatMap((limit, i) =>
        limit === null ? [] : [-limit, limit].map((value) => ({ value, colour: `series-${i + 1}` })),
      ),
    note: ({ torque_limit }) =>
      torque_limit ? `limits ${torque_limit.map((limit) => (limit === null ? "none" : `±${limit}`)).join(", ")} N m` : "no limits",
  },
  {
    id: "force",
    title: "Task force Q̂",
    unit: "N",
    series: ({ axes }) => perAxis("force", "Q̂", axes),
  },
  {
    id: "memory",
    title: "Memory h",
    unit: "N",
    applies: ({ knobs }) => knobs["law.kind"] === "mtj",
    series: ({ axes }) => perAxis("memory", "h", axes),
  },
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
