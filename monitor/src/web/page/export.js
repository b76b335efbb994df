// Exports what is shown: the numbers as CSV, the charts as PNG.

function download(blob, name) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
}

function fileName(session, ending) {
  const { store, view } = session;
  const scenario = (store.scenario?.name ?? "mtj").replace(/[^\w.-]+/g, "-");
  const from = Math.max(store.oldest, view.end - view.range);
  return `mtj-${scenario}-${from.toFixed(1)}s-${view.end.toFixed(1)}s.${ending}`;
}

/** The bins in view: time, minimum and maximum of every series drawn, and the changes. */
export function csv({ store, view }, strips) {
  const series = strips.flatMap((strip) => strip.series.map((s) => ({ unit: strip.unit, ...s })));
  const heads = series.flatMap(({ name, unit }) => {
    const column = unit === "" ? name : `${name} [${unit}]`;
    return [`${column} min`, `${column} max`];
  });
  const marks = store.marks.filter(({ accepted }) => accepted);
  const lines = [["time [s]", ...heads, "mark"].join(",")];
  const arrays = series.map(({ name, factor }) => ({ ...store.series.get(name), factor }));
  const number = (value, factor) => (Number.isNaN(value) ? "" : String(Number((value * factor).toPrecision(7))));
  let next = 0;
  const first = store.indexOf(view.end - view.range);
  while (next < marks.length && marks[next].time < store.times[first]) next += 1;
  for (let i = first; i < store.length && store.times[i] <= view.end; i += 1) {
    const words = [];
    while (next < marks.length && marks[next].time <= store.times[i]) words.push(marks[next++].words);
    const cells = arrays.flatMap(({ low, high, factor }) => (low ? [number(low[i], factor), number(high[i], factor)] : ["", ""]));
    const mark = words.length > 0 ? `"${words.join("; ").replaceAll('"', '""')}"` : "";
    lines.push([store.times[i].toFixed(3), ...cells, mark].join(","));
  }
  return `${lines.join("\n")}\n`;
}

export function downloadCsv(session, strips) {
  download(new Blob([csv(session, strips)], { type: "text/csv" }), fileName(session, "csv"));
}

/** One image of the charts in view, with their headings. */
export function picture({ store, palette }, markers, strips, ruler) {
  const ratio = strips[0].canvas.width / strips[0].canvas.clientWidth;
  const head = 22;
  const shown = strips.filter((strip) => !strip.element.hidden);
  const width = shown[0].canvas.clientWidth + 24;
  const height = 40 + markers.clientHeight + ruler.clientHeight + shown.reduce((sum, s) => sum + head + s.canvas.clientHeight, 0) + 12;
  const image = document.createElement("canvas");
  [image.width, image.height] = [width * ratio, height * ratio];
  const context = image.getContext("2d");
  context.scale(ratio, ratio);
  context.fillStyle = palette.colour("surface");
  context.fillRect(0, 0, width, height);
  context.textBaseline = "middle";
  context.fillStyle = palette.colour("ink");
  context.font = palette.font(14, 600);
  const { name, knobs } = store.scenario;
  context.fillText(`${name}  ·  ${knobs["law.kind"]}  ·  Tₛ = ${knobs["timing.sample_period"]}`, 12, 22);
  let y = 40;
  const paste = (canvas) => {
    context.drawImage(canvas, 12, y, canvas.clientWidth, canvas.clientHeight);
    y += canvas.clientHeight;
  };
  paste(markers);
  for (const strip of shown) {
    heading(context, strip, 12, y + head / 2, palette);
    y += head;
    paste(strip.canvas);
  }
  paste(ruler);
  return image;
}

function heading(context, strip, x, y, palette) {
  context.font = palette.font(12, 600);
  context.fillStyle = palette.colour("ink");
  context.fillText(strip.title, x, y);
  x += context.measureText(strip.title).width + 16;
  context.font = palette.font(11);
  for (const { label, colour } of strip.series) {
    context.fillStyle = palette.colour(colour);
    context.fillRect(x, y - 1.5, 14, 3);
    context.fillStyle = palette.colour("quiet");
    context.fillText(label, x + 18, y);
    x += 18 + context.measureText(label).width + 14;
  }
}

export function downloadPng(session, markers, strips, ruler) {
  const name = fileName(session, "png");
  picture(session, markers, strips, ruler).toBlob((blob) => blob && download(blob, name), "image/png");
}
