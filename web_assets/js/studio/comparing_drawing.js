// The curves of runs that are compared: over the frames, their difference from the first, and by
// layer of a frame.

import { figure } from "../chart_looks.js";
import { seriesColour } from "../theme.js";
import { categories, distinct, logarithmic, numbers, records, tipOf } from "../view_sheet.js";

const tipOfFrame = (points) =>
  tipOf(
    `frame ${points[0].axisValue}`,
    points.filter((point) => point.seriesName).map((point) => [point.seriesName, point.data]),
  );
const tipOfLayer = (points) =>
  tipOf(
    `layer ${points[0].axisValue}`,
    points.map((point) => [point.seriesName, point.data]),
  );

/** The colours' numbers of all runs that were compared on this page. @type {Map<string, number>} */
const given = new Map();

/**
 * The colour's number of each run: it stays with the run, whichever of them is open and whatever
 * joins.
 * @param {string[]} runs
 * @returns {Map<string, number>}
 */
export function coloursOf(runs) {
  const taken = new Set();
  for (const run of runs) {
    const own = given.get(run);
    // As many colours as runs: a scene gives its own run the one that the others leave.
    if (own === undefined || own >= runs.length || taken.has(own)) given.delete(run);
    else taken.add(own);
  }
  for (const run of [...runs].sort()) {
    if (given.has(run)) continue;
    const free = runs.findIndex((_, at) => !taken.has(at));
    given.set(run, free);
    taken.add(free);
  }
  return new Map(runs.map((run) => [run, given.get(run) ?? 0]));
}

/**
 * How many layers are drawn: a swarm's have no effective number, as many as it has do not squeeze
 * the others' together.
 */
const layersOf = (layered) =>
  Math.max(
    1,
    ...layered.flatMap(({ layers }) =>
      layers.filter((row) => row.effective !== null).map((row) => row.layer + 1),
    ),
  );

/**
 * The layers of a frame's last search, whose result the frame is, counted in it, however often the
 * frame was searched.
 * @param {any} schedule the answer of the view
 */
export function lastSearch({ tables, search_layers: layers, searches }) {
  const first = layers * (searches - 1);
  return records(tables[0])
    .filter((row) => row.layer >= first)
    .map((row) => ({ ...row, layer: row.layer - first, chosen: row.layer }));
}

/**
 * Draw them; the numbers of the shown frame in a sentence.
 * @param {any} sheet
 * @param {{ curves: any[], runs: string[], frame: number | null, layer: number | null,
 *   layered: { run: string, layers: any[] }[] }} what `layered`: the layers of the shown frame's
 * last search, by run
 * @param {number} room
 */
export function drawCompared(sheet, { curves, runs, frame: shown, layer, layered }, room) {
  const key = curves.some((row) => row.error !== null) ? "error" : "log_weight";
  const unit = key === "error" ? "mean error, mm" : "log weight, nats";
  const all = distinct(curves.map((row) => row.frame)).sort((a, b) => a - b);
  const measured = new Map(curves.map((row) => [`${row.run}/${row.frame}`, row[key]]));
  const measuredAt = (run, frame) => measured.get(`${run}/${frame}`) ?? null;
  const [first, second, third] = sheet.columns(3, { height: Math.max(110, room - 76) });
  const names = all.map(String);
  const toFrame = (at) => (all[at] === undefined ? null : { frame: all[at] });
  const click = ({ dataIndex }) => toFrame(dataIndex);
  const common = { over: tipOfFrame, click: (x) => toFrame(Math.round(x)) };
  const symbols = all.length < 3;
  const colours = coloursOf(runs);
  const colourOf = (/** @type {string} */ run) => seriesColour(colours.get(run) ?? 0);

  const plot = sheet.plot(first, {
    ...common,
    title: "Over the frames",
    unit,
    names: runs,
    x: categories(names, "frame"),
    y: numbers("", key === "error" ? { scale: false, min: 0 } : {}),
  });
  runs.forEach((run) => {
    const values = all.map((frame) => measuredAt(run, frame));
    sheet.line(plot, run, values, colourOf(run), { symbols, click });
  });

  const nearer = key === "error" ? "nearer" : "lower";
  const difference = sheet.plot(second, {
    ...common,
    title: "Difference",
    unit: `from ${runs[0]}; below 0 the other is ${nearer}`,
    x: categories(names, "frame"),
    y: numbers("", { scale: false }),
  });
  sheet.marks(difference, [{ y: 0 }]);
  runs.slice(1).forEach((run) => {
    const values = all.map((frame) => {
      const [one, other] = [measuredAt(runs[0], frame), measuredAt(run, frame)];
      return one === null || other === null ? null : other - one;
    });
    sheet.line(difference, run, values, colourOf(run), { symbols, click });
  });
  for (const one of [plot, difference]) sheet.chosen(one, { column: String(shown) });

  const most = layersOf(layered);
  const layerNames = Array.from({ length: most }, (_, at) => String(at + 1));
  const layers = sheet.plot(third, {
    title: "Effective number",
    unit: `by layer of the last search, frame ${shown}, log scale`,
    x: categories(layerNames, "layer"),
    y: logarithmic("", { min: 1 }),
    over: tipOfLayer,
  });
  const own = layered[0]?.layers ?? [];
  const toLayer = ({ dataIndex }) => ({ layer: own[dataIndex]?.chosen ?? null });
  for (const { run, layers: rows } of layered.filter((one) => one.layers.length)) {
    const values = rows.slice(0, most).map((row) => row.effective);
    sheet.line(layers, run, values, colourOf(run), { click: toLayer });
  }
  const chosen = own.findIndex((row) => row.chosen === layer);
  sheet.chosen(layers, { column: chosen < 0 ? null : chosen });
  const said = runs.map((run) => `${run}: ${figure(measured.get(`${run}/${shown}`))}`);
  return `${said.join(", ")} (${unit}, frame ${shown}).`;
}
