// Views of the search itself: what each layer settled, whether annealing proceeded as asked, who descends from whom, how the
// weight is shared out, what the clouds learnt, which parameters trade off, what the dead had wrong.

import { figure, token } from "./chart_looks.js";
import { layerColour } from "./theme.js";
import { categories, distinct, extent, grouped, logarithmic, numbers, onScreen, screenUnit, tipOf, withUnit } from "./view_sheet.js";

/** @import { Sheet } from "./view_sheet.js" */
/**
 * What a drawing knows beside its tables. `label`: of a parameter; `room`: pixels of height that are free; `go`: show a frame.
 * @typedef {{ layer: number | null, limb: string | null, parameter: string | null, particle: number | null, camera: string | null, frame: number, over: boolean,
 *   layers: number, label: (name: string) => string, room: number, whatIf: any[] | null, score: [string, string] }} At
 * @typedef {(sheet: Sheet, tables: any, at: At) => string} Drawing fills a sheet with tables (rows by key); the exact numbers of what is chosen in a sentence
 */

const ROW = 13;
const FEW = 24;
const layerName = (layer) => String(layer + 1);
/** Of what is negative or nothing there is no logarithm. */
const decades = (value) => (value > 0 ? Math.log10(value) : null);

/** Columns of a map, named above it, where they are seen however long the map is. */
const aboveMap = (names) => categories(names, "", { position: "top", axisLine: { show: false } });

/** Rows of a map: parameters under their limbs, in the body's order. */
function parameterAxis(names, at) {
  return categories(names, "", { inverse: true, axisLabel: { interval: 0, fontSize: names.length > FEW ? 9.5 : 11, width: 130, overflow: "truncate", formatter: (name) => at.label(name) } });
}

/** Variance reduction of a frame: two maps that share one scale, and the chosen parameter over the layers. */
function varianceOfFrame(sheet, { layers: rows, settled }, at) {
  const names = distinct(rows.map((row) => row.parameter));
  const first = new Map(settled.map((row) => [row.parameter, row.first]));
  const count = Math.max(...rows.map((row) => row.layer)) + 1;
  const share = (row, key) => (first.get(row.parameter) > 0 ? decades(row[key] / first.get(row.parameter)) : null);
  const values = rows.flatMap((row) => [share(row, "before"), share(row, "after")]).filter((value) => value !== null);
  const [low, high] = [Math.floor(Math.min(0, ...values)), Math.max(0.01, ...values)];
  const chosen = at.parameter && names.includes(at.parameter) ? at.parameter : settled.reduce((best, row) => ((row.reduction ?? 0) > (best.reduction ?? 0) ? row : best)).parameter;
  const height = Math.max(names.length * ROW, at.room - 76);
  const [one, two, three] = sheet.columns(3, { gutters: [142, 26, 112], shares: [1, 1, 1.1], right: 14 });
  for (const [column, key, title, isLeft] of /** @type {const} */ ([[one, "before", "Before noise", true], [two, "after", "After noise", false]])) {
    const plot = sheet.plot({ ...column, top: 0, height }, {
      title, unit: isLeft ? "share of the first layer's variance" : "", below: 12, x: aboveMap(Array.from({ length: count }, (_, layer) => layerName(layer))),
      y: isLeft ? parameterAxis(names, at) : { ...parameterAxis(names, at), axisLabel: { show: false } },
    });
    sheet.heat(plot, {
      cells: rows.map((row) => [row.layer, names.indexOf(row.parameter), share(row, key) ?? "-"]), low, high, framed: count <= FEW && names.length <= 2 * FEW,
      ends: ["100 %", `${figure(100 * 10 ** low)} %`], key: isLeft ? null : { left: two.left + two.width + 10, top: 46, height: Math.min(90, height - 40) },
      click: ({ value }) => ({ layer: value[0], parameter: names[value[1]] }),
      tip: ({ value }) => {
        const row = rows.find((entry) => entry.layer === value[0] && entry.parameter === names[value[1]]);
        return tipOf(`${at.label(row.parameter)}, layer ${row.layer + 1} of ${count}`, [["as weighed", `${figure(row.weighed)} ${row.unit}²`], ["before noise", `${figure(row.before)} ${row.unit}²`],
          ["after noise", `${figure(row.after)} ${row.unit}²`], ["of the first", `${figure((100 * row[key]) / first.get(row.parameter))} %`]]);
      },
    });
    sheet.chosen(plot, { column: at.layer, row: at.parameter ? names.indexOf(at.parameter) : null });
  }
  const own = rows.filter((row) => row.parameter === chosen);
  const plot = sheet.plot({ ...three, top: 0, height: Math.max(90, at.room - 84) }, {
    title: at.label(chosen), unit: `variance, ${own[0].unit}²`, names: ["as weighed", "before noise", "after noise"], x: categories(own.map((row) => layerName(row.layer)), "layer"), y: logarithmic(),
    over: (points) => tipOf(`layer ${points[0].axisValue}`, points.map((point) => [point.seriesName, point.data?.value ?? point.data])),
  });
  const line = (name, key, colour, more = {}) => sheet.line(plot, name, own.map((row) => (row[key] > 0 ? row[key] : null)), token(colour), { ...more, click: ({ dataIndex }) => ({ layer: own[dataIndex].layer, parameter: chosen }) });
  line("as weighed", "weighed", "text-quiet", { dashed: true });
  line("before noise", "before", "before");
  line("after noise", "after", "after");
  sheet.chosen(plot, { column: at.layer });
  const now = own.find((row) => row.layer === (at.layer ?? count - 1));
  return `${at.label(chosen)}, layer ${now.layer + 1} of ${count}: variance ${figure(now.weighed)} ${now.unit}² as weighed, ${figure(now.before)} before noise, ${figure(now.after)} after noise.`;
}

/** Of frames that are searched several times over the rows of the last search, whose result is the frame's; `step`: its layers counted from 0. */
export function lastSearches(rows) {
  return [...grouped(rows, "frame").values()].flatMap((own) => {
    const search = Math.max(...own.map((row) => row.search));
    const its = own.filter((row) => row.search === search);
    const first = Math.min(...its.map((row) => row.layer));
    return its.map((row) => ({ ...row, step: row.layer - first }));
  });
}

/** Variance of the run: parameters over the frames, and the chosen parameter as layers over frames. */
function varianceOfRun(sheet, { last, parameter: searched }, at) {
  const parameter = lastSearches(searched);
  const frames = last.map((row) => row.frame);
  const names = Object.keys(last[0] ?? {}).filter((name) => name !== "frame");
  const medians = new Map(names.map((name) => { const own = last.map((row) => row[name]).filter((value) => value > 0).sort((a, b) => a - b); return [name, own[own.length >> 1] ?? 0]; }));
  const cells = last.flatMap((row, column) => names.map((name, place) => [column, place, medians.get(name) > 0 ? decades(row[name] / medians.get(name)) ?? "-" : "-"]));
  const [low, high] = extent(cells.map((cell) => cell[2]));
  const bound = Math.max(0.3, Math.abs(low), Math.abs(high));
  const height = Math.max(names.length * ROW, at.room - 60);
  const [one, two] = sheet.columns(2, { gutters: [142, 92], shares: [1.5, 1], right: 16 });
  const whole = sheet.plot({ ...one, top: 0, height }, { title: "Last set, by frame", unit: "variance beside the run's median, log scale", below: 12, x: aboveMap(frames.map(String)), y: parameterAxis(names, at) });
  sheet.heat(whole, {
    cells, low: -bound, high: bound, colours: ["less", "none", "more"], framed: false, ends: [`${figure(10 ** bound)}×`, `÷ ${figure(10 ** bound)}`], key: { left: one.left + one.width + 10, top: 40 },
    click: ({ value }) => ({ frame: frames[value[0]], parameter: names[value[1]] }),
    tip: ({ value }) => tipOf(`${at.label(names[value[1]])}, frame ${frames[value[0]]}`, [["variance", last[value[0]][names[value[1]]]], ["run's median", medians.get(names[value[1]])]]),
  });
  sheet.chosen(whole, { column: frames.indexOf(at.frame), row: at.parameter ? names.indexOf(at.parameter) : null });
  if (!parameter.length) { sheet.words("Choose a parameter: a click on its row shows it layer by layer over the frames.", two.left, 40, two.width); return ""; }
  const levels = Math.max(...parameter.map((row) => row.step)) + 1;
  const own = distinct(parameter.map((row) => row.frame));
  const logs = parameter.map((row) => decades(row.before)).filter((value) => value !== null);
  const [least, most] = extent(logs);
  const plot = sheet.plot({ ...two, top: 0, height }, { title: at.label(at.parameter ?? ""), unit: "variance before noise, layers over frames", x: categories(own.map(String), "frame"), y: categories(Array.from({ length: levels }, (_, layer) => layerName(layer)), "layer", { inverse: true, nameGap: 24 }) });
  sheet.heat(plot, {
    cells: parameter.map((row) => [own.indexOf(row.frame), row.step, decades(row.before) ?? "-", row.layer]), low: least, high: most, framed: false,
    click: ({ value }) => ({ frame: own[value[0]], layer: value[3] }), tip: ({ value }) => tipOf(`frame ${own[value[0]]}, layer ${value[1] + 1}`, [["before noise", 10 ** value[2]]]),
  });
  sheet.chosen(plot, { column: own.indexOf(at.frame), row: parameter.find((row) => row.frame === at.frame && row.layer === at.layer)?.step ?? null });
  return at.parameter ? `${at.label(at.parameter)}: last variance ${figure(last[frames.indexOf(at.frame)]?.[at.parameter])} in frame ${at.frame}, median of the run ${figure(medians.get(at.parameter))}.` : "";
}

/** Schedule: α, β, the effective number and the time of each layer; while a frame is annealed again, before and after. */
function scheduleOfFrame(sheet, { layers: rows }, at) {
  const names = rows.map((row) => layerName(row.layer));
  const again = at.whatIf;
  const height = Math.max(120, at.room - 76);
  const places = sheet.columns(4, { gutters: 52, right: 10 });
  const click = ({ dataIndex }) => ({ layer: rows[dataIndex].layer });
  const draw = (column, title, unit, y, lines) => {
    const plot = sheet.plot({ ...places[column], top: 0, height }, { title, unit, x: categories(names, "layer"), y, over: (points) => tipOf(`layer ${points[0].axisValue}`, points.filter((point) => point.seriesName && !point.seriesName.startsWith("series")).map((point) => [point.seriesName, point.data?.value ?? point.data])) });
    for (const [name, data, colour, more] of lines) sheet.line(plot, name, data, token(colour), { ...more, click });
    const alarmed = rows.filter((row) => row.alarm);
    if (alarmed.length && column < 3) sheet.series(plot, { type: "scatter", name: "alarm", symbol: "triangle", symbolSize: 9, itemStyle: { color: token("bad") }, data: alarmed.map((row) => ({ value: [layerName(row.layer), lines.at(-1)[1][rows.indexOf(row)]], words: row.alarm })), click: ({ dataIndex }) => ({ layer: alarmed[dataIndex].layer }), tip: ({ data }) => tipOf("Alarm", [[data.words, ""]]) });
    sheet.chosen(plot, { column: at.layer === null ? null : layerName(at.layer) });
  };
  const of = (key) => rows.map((row) => row[key]);
  const beside = (key, colour = "accent") => (again ? [["before", of(key), "before", {}], ["after", again.map((layer) => layer[AGAIN[key]] ?? null), "after", {}]] : [["reached", of(key), colour, {}]]);
  const positive = (values) => values.every((value) => value === null || value > 0);
  if (of("alpha_reached").some((value) => value !== null)) draw(0, "Survival α", "asked and reached", numbers("", { min: 0, max: 1, scale: false }), [["asked", of("alpha_wanted"), "text-quiet", { dashed: true, stepped: true }], ...beside("alpha_reached")]);
  else draw(0, "Best log weight", "nats", numbers(), beside("best_log_weight"));
  if (of("beta").some((value) => value !== null)) draw(1, "Exponent β", "log scale", positive(of("beta")) ? logarithmic() : numbers(), beside("beta"));
  else draw(1, "Particles", "in each layer", numbers(), beside("particles"));
  draw(2, "Effective number", `of ${rows.at(-1).particles} particles, log scale`, logarithmic("", { min: 1 }), [["particles", of("particles"), "text-quiet", { dashed: true }], ...(again ? [["before", of("effective"), "before", {}], ["after", again.map((layer) => layer.effective_share * layer.particles), "after", {}]] : [["effective", of("effective"), "accent", {}]])]);
  const plot = sheet.plot({ ...places[3], top: 0, height }, { title: "Time", unit: `${figure(of("milliseconds").reduce((sum, one) => sum + (one ?? 0), 0))} ms in all`, x: categories(names, "layer"), y: numbers("", { scale: false }) });
  sheet.series(plot, { type: "bar", barMaxWidth: 22, data: rows.map((row, index) => ({ value: row.milliseconds, itemStyle: { color: layerColour(index, rows.length) } })), click, tip: ({ dataIndex, value }) => tipOf(`layer ${dataIndex + 1}`, [["time", `${figure(value)} ms`]]) });
  sheet.chosen(plot, { column: at.layer === null ? null : layerName(at.layer) });
  if (again) sheet.legend(["before", "after"], places[0].left + places[0].width - 110, 8, 110);
  const row = rows.find((one) => one.layer === at.layer) ?? rows.at(-1);
  return `Layer ${row.layer + 1} of ${rows.length}: β ${figure(row.beta)}, α asked ${figure(row.alpha_wanted)}, reached ${figure(row.alpha_reached)}, effective number ${figure(row.effective)} of ${row.particles}, largest weight ${figure(100 * row.largest)} %${row.alarm ? `. Alarm: ${row.alarm}` : ""}.`;
}
/** A layer's numbers in the events, by their names in the table. */
const AGAIN = { alpha_reached: "alpha_reached", beta: "beta", best_log_weight: "best_log_weight", particles: "particles" };

/** Schedule of the run: the ends of each frame's annealing over the frames. */
function scheduleOfRun(sheet, { frames: rows }, at) {
  const places = sheet.columns(3, { gutters: 58 });
  const height = Math.max(110, at.room - 76);
  const names = rows.map((row) => String(row.frame));
  const click = ({ dataIndex }) => ({ frame: rows[dataIndex].frame });
  const draw = (column, title, unit, y, lines) => {
    const plot = sheet.plot({ ...places[column], top: 0, height }, { title, unit, x: categories(names, "frame"), y, over: (points) => tipOf(`frame ${points[0].axisValue}`, points.filter((point) => point.data !== undefined).map((point) => [point.seriesName, point.data?.value ?? point.data])) });
    for (const [name, key, colour] of lines) sheet.line(plot, name, rows.map((row) => row[key]), token(colour), { symbols: rows.length < 3, click, triggerLineEvent: true });
    sheet.chosen(plot, { column: String(at.frame) });
  };
  draw(0, "Exponent β", "of the first and last layer, log scale", logarithmic(), [["first layer", "beta_first", "layer-0"], ["last layer", "beta_last", "layer-9"]]);
  draw(1, "Least survival α", "reached in a frame", numbers("", { min: 0, scale: false }), [["least α", "least_alpha", "accent"]]);
  draw(2, "Least effective number", "log scale", logarithmic("", { min: 1 }), [["least effective number", "least_effective", "accent"]]);
  const row = rows.find((one) => one.frame === at.frame);
  return row ? `Frame ${row.frame}: β from ${figure(row.beta_first)} to ${figure(row.beta_last)}, least α ${figure(row.least_alpha)}, least effective number ${figure(row.least_effective)}, ${row.alarms} layers with an alarm.` : "";
}

/** Genealogy: a column a layer, particles beside their parents' places, ribbons to their children. */
function genealogy(sheet, { particles: rows, ancestors }, at) {
  const [one, two] = sheet.columns(2, { gutters: [30, 62], shares: [2.4, 1] });
  const height = Math.max(130, at.room - 76);
  const byLayer = [...grouped(rows, "layer")].sort((a, b) => a[0] - b[0]);
  const places = new Map();
  for (const [layer, own] of byLayer) {
    const above = places.get(layer - 1);
    const order = [...own].sort((a, b) => (above ? (above.get(a.parent) ?? 1) - (above.get(b.parent) ?? 1) : Number(b.survives) - Number(a.survives)) || b.weight - a.weight);
    places.set(layer, new Map(order.map((row, index) => [row.particle, order.length > 1 ? index / (order.length - 1) : 0.5])));
  }
  const plot = sheet.plot({ ...one, top: 0, height }, {
    title: "Particles and their parents", unit: "bright: has descendants in the last layer; dashed: crossover's second parent", x: categories(byLayer.map(([layer]) => layerName(layer)), "layer", { axisLine: { onZero: false } }),
    y: { type: "value", min: -0.03, max: 1.03, inverse: true, axisLabel: { show: false }, splitLine: { show: false }, axisLine: { show: false } },
  });
  const ribbons = (chosen, key) => rows.filter((row) => row.layer > 0 && row[key] !== null && chosen(row) && places.get(row.layer - 1)?.has(row[key]))
    .map((row) => ({ coords: [[row.layer - 1, places.get(row.layer - 1).get(row[key])], [row.layer, places.get(row.layer).get(row.particle)]], lineStyle: { color: layerColour(row.layer, byLayer.length) } }));
  const lines = (data, style) => data.length && sheet.series(plot, { type: "lines", coordinateSystem: "cartesian2d", silent: true, data, lineStyle: style, progressive: 0, tooltip: { show: false } });
  lines(ribbons((row) => !row.survives, "parent"), { width: 0.6, opacity: 0.16, curveness: 0.02 });
  lines(ribbons((row) => row.survives, "second_parent"), { width: 0.8, opacity: 0.5, type: [3, 3] });
  lines(ribbons((row) => row.survives, "parent"), { width: 1.3, opacity: 0.85 });
  const heaviest = Math.max(...rows.map((row) => row.weight ?? 0)) || 1;
  sheet.chosen(plot, { column: at.layer });
  sheet.series(plot, {
    type: "scatter", data: rows.map((row) => ({
      value: [row.layer, places.get(row.layer).get(row.particle)], row, symbolSize: 2.5 + 7 * Math.sqrt((row.weight ?? 0) / heaviest),
      itemStyle: { color: layerColour(row.layer, byLayer.length), opacity: row.survives ? 1 : 0.3, ...(row.particle === at.particle && row.layer === at.layer ? { borderColor: token("text"), borderWidth: 2 } : {}) },
    })),
    click: ({ data }) => ({ layer: data.row.layer, particle: data.row.particle }),
    tip: ({ data: { row } }) => tipOf(`particle ${row.particle} of layer ${row.layer + 1}`, [["parent", row.parent ?? "–"], ...(row.second_parent === null ? [] : /** @type {[string, any][]} */ ([["second parent", row.second_parent]])), ["first ancestor", row.ancestor ?? "–"], ["children", row.children], ["weight", `${figure(100 * row.weight)} %`], ["log weight", row.log_weight], ["survives", row.survives ? "yes" : "no"]]),
  });
  const count = sheet.plot({ ...two, top: 0, height }, { title: "Distinct ancestors", unit: "in the first set, log scale", x: categories(ancestors.map((row) => layerName(row.layer)), "layer"), y: logarithmic("", { min: 1 }), over: (points) => tipOf(`layer ${points[0].axisValue}`, points.map((point) => [point.seriesName, point.data])) });
  const click = ({ dataIndex }) => ({ layer: ancestors[dataIndex].layer });
  sheet.line(count, "with descendants", ancestors.map((row) => row.with_descendants || null), token("text-quiet"), { dashed: true, click });
  sheet.line(count, "ancestors", ancestors.map((row) => row.ancestors || null), token("accent"), { click });
  sheet.chosen(count, { column: at.layer === null ? null : layerName(at.layer) });
  const last = ancestors.at(-1);
  const chosen = rows.find((row) => row.particle === at.particle && row.layer === (at.layer ?? last.layer));
  return chosen ? `Particle ${chosen.particle} of layer ${chosen.layer + 1}: parent ${chosen.parent ?? "none"}, first ancestor ${chosen.ancestor ?? "unknown"}, ${chosen.children} children, ${chosen.survives ? "has" : "has no"} descendants in the last layer.`
    : `The ${last.particles} particles of layer ${last.layer + 1} descend from ${last.ancestors} of the first set.`;
}

/** Weight concentration: sorted weights of a layer, largest share and Pareto k̂ over the layers. */
function weights(sheet, { sorted, layers: rows }, at) {
  const [one, two, three] = sheet.columns(3, { gutters: [60, 56, 50], shares: [1.5, 1, 1] });
  const height = Math.max(120, at.room - 76);
  const layer = sorted[0]?.layer ?? at.layer ?? 0;
  const positive = sorted.filter((row) => row.weight > 0);
  const lowest = Math.min(...sorted.map((row) => row.rank));
  const plot = sheet.plot({ ...one, top: 0, height }, { title: `Weights of layer ${layer + 1}`, unit: "largest first, log scales", x: logarithmic("rank", { min: 1, nameGap: 20 }), y: logarithmic() });
  sheet.series(plot, {
    name: "weight", type: "line", data: positive.map((row) => ({ value: [row.rank - lowest + 1, row.weight], row })), showSymbol: true, symbolSize: (_value, { data }) => (data.row.particle === at.particle ? 11 : 4), lineStyle: { color: layerColour(layer, at.layers), width: 2 }, itemStyle: { color: layerColour(layer, at.layers) },
    click: ({ data }) => ({ layer, particle: data.row.particle }), tip: ({ data: { row } }) => tipOf(`particle ${row.particle}`, [["rank", row.rank - lowest + 1], ["weight", `${figure(100 * row.weight)} %`], ["cumulated", `${figure(100 * row.cumulated)} %`], ["log weight", row.log_weight]]),
  });
  const names = rows.map((row) => layerName(row.layer));
  const click = ({ dataIndex }) => ({ layer: rows[dataIndex].layer });
  const over = (points) => tipOf(`layer ${points[0].axisValue}`, points.map((point) => [point.seriesName, point.data]));
  const largest = sheet.plot({ ...two, top: 0, height }, { title: "Largest weight", unit: "share, log scale", x: categories(names, "layer"), y: logarithmic(), over });
  sheet.line(largest, "largest weight", rows.map((row) => row.largest), token("accent"), { click });
  sheet.chosen(largest, { column: at.layer === null ? null : layerName(at.layer) });
  const pareto = sheet.plot({ ...three, top: 0, height }, { title: "Pareto k̂", unit: "above 0.7 a few particles hold all", x: categories(names, "layer"), y: numbers("", { scale: false, max: ({ max }) => Math.max(1, Math.ceil(10 * max) / 10) }), over });
  sheet.marks(pareto, [{ y: 0.7, word: "0.7", colour: "warn", dashed: true }]);
  sheet.line(pareto, "k̂", rows.map((row) => row.k_hat), token("accent"), { click });
  sheet.chosen(pareto, { column: at.layer === null ? null : layerName(at.layer) });
  const row = rows.find((entry) => entry.layer === layer) ?? rows.at(-1);
  return `Layer ${row.layer + 1}: the heaviest of ${row.particles} particles holds ${figure(100 * row.largest)} %, ${row.for_90} hold 90 %, effective number ${figure(row.effective)}, k̂ ${figure(row.k_hat)}.`;
}

/** First and last cloud: every parameter's interval before and after, and the chosen one's densities over the layers. */
function clouds(sheet, { summary, own: steps, ridges, marks }, at) {
  const byParameter = grouped(summary, "parameter");
  const names = [...byParameter.keys()];
  const marked = new Map(marks.map((row) => [row.parameter, row]));
  const chosen = ridges[0]?.parameter ?? names[0];
  const height = Math.max(names.length * ROW, at.room - 76);
  const [one, two] = sheet.columns(2, { gutters: [142, 40], shares: [1.15, 1] });
  const places = new Map(names.map((name) => {
    const first = byParameter.get(name)[0];
    const half = (first.q95 - first.q05) / 2;
    return [name, (value) => (half > 0 && Number.isFinite(value) ? (value - first.median) / half : null)];
  }));
  const all = sheet.plot({ ...one, top: 0, height }, { title: "5 % to 95 % of the particles", unit: "in half widths of the first cloud", names: ["first cloud", "last cloud", "estimate", "truth"], below: 12, x: numbers("", { scale: false, min: -2, max: 2, interval: 1, position: "top" }), y: parameterAxis(names, at) });
  const bar = (name, which, colour, thickness) => sheet.series(all, {
    name, type: "custom", encode: { x: [0, 1], y: 2 }, clip: true, itemStyle: { color: token(colour) },
    data: names.flatMap((parameter, row) => { const own = which(byParameter.get(parameter)); const place = places.get(parameter); const ends = [place(own.q05), place(own.q95)]; return ends[0] === null ? [] : [{ value: [...ends, row], own }]; }),
    renderItem: (_params, api) => {
      const [from, to] = [api.coord([Math.max(-2, api.value(0)), api.value(2)]), api.coord([Math.min(2, api.value(1)), api.value(2)])];
      return { type: "rect", shape: { x: from[0], y: from[1] - thickness / 2, width: Math.max(1, to[0] - from[0]), height: thickness, r: 2 }, style: { fill: token(colour), opacity: 0.85 } };
    },
    click: ({ data }) => ({ parameter: data.own.parameter }),
    tip: ({ data: { own } }) => tipOf(`${at.label(own.parameter)}, layer ${own.layer + 1}`, [["median", withUnit(own.median, own.unit)], ["5 %", withUnit(own.q05, own.unit)], ["95 %", withUnit(own.q95, own.unit)], ["deviation", withUnit(own.deviation, own.unit)]]),
  });
  bar("first cloud", (own) => own[0], "before", 9);
  bar("last cloud", (own) => own.at(-1), "after", 4);
  const point = (name, key, colour, symbol) => sheet.series(all, {
    name, type: "scatter", symbol, symbolSize: 8, itemStyle: { color: token(colour), borderColor: token("surface"), borderWidth: 1 },
    data: names.flatMap((parameter, row) => { const place = places.get(parameter)(marked.get(parameter)?.[key]); return place === null ? [] : [{ value: [Math.max(-2, Math.min(2, place)), row], parameter }]; }),
    click: ({ data }) => ({ parameter: data.parameter }), tip: ({ data }) => tipOf(at.label(data.parameter), [[name, withUnit(marked.get(data.parameter)[key], marked.get(data.parameter).unit)]]),
  });
  point("estimate", "estimate", "text", "circle");
  point("truth", "truth", "truth", "diamond");
  sheet.chosen(all, { row: names.indexOf(chosen) });

  // The first layer's set as it was drawn, then every layer's set as it was weighted.
  const own = [...grouped(ridges.map((row) => ({ ...row, set: row.weighted ? row.layer : -1 })), "set")];
  const { unit, lower, upper, estimate, truth } = marked.get(chosen) ?? { unit: "" };
  const [least, greatest] = extent(ridges.map((row) => row.value));
  const nameOf = (set) => (set < 0 ? "drawn" : layerName(set));
  const plot = sheet.plot({ ...two, top: 0, height: Math.max(90, at.room - 66) }, {
    title: at.label(chosen), unit: `${screenUnit(unit)}, density of each layer's set`, x: numbers("", { scale: false, min: onScreen(least, unit), max: onScreen(greatest, unit), axisLabel: { formatter: (value) => figure(value), hideOverlap: true, showMinLabel: false, showMaxLabel: false } }),
    y: { ...numbers("", {}), scale: false, min: 0, max: own.length, interval: 1, axisLabel: { formatter: (value) => (own[own.length - 1 - value] ? nameOf(own[own.length - 1 - value][0]) : "") }, splitLine: { show: false } },
  });
  own.forEach(([set, rows], index) => {
    const base = own.length - 1 - index;
    const most = Math.max(...rows.map((row) => row.density)) || 1;
    const colour = set < 0 ? token("before") : layerColour(set, Math.max(at.layers, own.length - 1));
    const dim = at.layer !== null && at.layer !== set;
    sheet.series(plot, {
      name: nameOf(set), type: "custom", z: 2 + index, encode: { x: 0, y: 1 }, data: [[onScreen(rows[0].value, unit), base]], clip: false,
      renderItem: (_params, api) => {
        const points = rows.map((row) => api.coord([onScreen(row.value, unit), base + (1.15 * row.density) / most]));
        const ends = [api.coord([onScreen(rows.at(-1).value, unit), base]), api.coord([onScreen(rows[0].value, unit), base])];
        return { type: "polygon", shape: { points: [...points, ...ends] }, style: { fill: colour, opacity: dim ? 0.18 : 0.6, stroke: colour, lineWidth: dim ? 0.5 : 1.4 } };
      },
      click: () => ({ layer: Math.max(0, set), parameter: chosen }),
      tip: () => { const row = steps.find((entry) => entry.layer === Math.max(0, set) && Boolean(entry.weighted) === set >= 0); return tipOf(`${at.label(chosen)}, ${set < 0 ? "first set as drawn" : `layer ${set + 1}`}`, [["mean", withUnit(row?.mean, unit)], ["deviation", withUnit(row?.deviation, unit)], ["median", withUnit(row?.median, unit)]]); },
    });
  });
  const near = (value) => Number.isFinite(value) && value >= least && value <= greatest;
  sheet.marks(plot, [{ x: near(lower) ? onScreen(lower, unit) : null, word: "limit", dashed: true }, { x: near(upper) ? onScreen(upper, unit) : null, word: "limit", dashed: true }, { x: near(estimate) ? onScreen(estimate, unit) : null, word: "estimate", colour: "text" }, { x: near(truth) ? onScreen(truth, unit) : null, word: "truth", colour: "truth" }]);
  const [first, last] = [byParameter.get(chosen)[0], byParameter.get(chosen).at(-1)];
  return `${at.label(chosen)}: ${withUnit(first.mean, unit)} ± ${withUnit(first.deviation, unit)} in the first set, ${withUnit(last.mean, unit)} ± ${withUnit(last.deviation, unit)} in the last; estimate ${withUnit(estimate, unit)}${Number.isFinite(truth) ? `, truth ${withUnit(truth, unit)}` : ""}.`;
}

/** Coupling: correlations of a layer's set in the order of settling, and one parameter against its nearest partners. */
function coupling(sheet, { matrix, order, particles }, at) {
  const names = [...order].sort((a, b) => a.place - b.place).map((row) => row.parameter);
  const size = Math.max(at.room - 76, Math.min(names.length * 12, 520));
  const [one, two] = sheet.columns(2, { gutters: [142, 30], shares: [1, 1.15] });
  const plot = sheet.plot({ left: one.left, width: one.width - 50, top: 0, height: size }, { title: "Correlation", unit: "in the order of settling", below: 16, x: categories(names, "", { axisLabel: { show: false } }), y: parameterAxis(names, at) });
  sheet.heat(plot, {
    cells: matrix.map((row) => [names.indexOf(row.second), names.indexOf(row.first), row.correlation ?? "-"]),
    low: -1, high: 1, colours: ["less", "none", "more"], ends: ["+1", "−1"], key: { left: one.left + one.width - 40, top: 40 }, framed: names.length < FEW,
    click: ({ value }) => ({ parameter: names[value[1]] }), tip: ({ value }) => tipOf(`${at.label(names[value[1]])} × ${at.label(names[value[0]])}`, [["correlation", value[2]]]),
  });
  const of = (row) => Math.abs(row.correlation ?? 0);
  const pairs = matrix.filter((row) => row.first !== row.second);
  const strongest = pairs.reduce((best, row) => (of(row) > of(best ?? { correlation: 0 }) ? row : best), null);
  const chosen = at.parameter && names.includes(at.parameter) ? at.parameter : strongest?.first ?? names[0];
  sheet.chosen(plot, { row: names.indexOf(chosen) });
  const partners = distinct(pairs.filter((row) => [row.first, row.second].includes(chosen)).sort((a, b) => of(b) - of(a)).map((row) => (row.first === chosen ? row.second : row.first))).slice(0, 6);
  const unitOf = (name) => order.find((row) => row.parameter === name)?.unit ?? "";
  const [across, down] = two.width > 560 ? [3, 2] : [2, 3];
  const [width, height] = [two.width / across - 44, size / down - 60];
  const most = Math.max(...particles.map((row) => row.weight ?? 0)) || 1;
  partners.slice(0, across * down).forEach((partner, index) => {
    const small = sheet.plot({ left: two.left + 20 + (index % across) * (width + 44), top: Math.floor(index / across) * (height + 60), width, height: Math.max(40, height) }, {
      title: at.label(partner), unit: figure(pairs.find((row) => [row.first, row.second].includes(partner) && [row.first, row.second].includes(chosen))?.correlation), x: numbers("", { axisLabel: { show: false }, splitLine: { show: false } }), y: numbers("", { axisLabel: { show: false }, splitLine: { show: false } }), below: 12,
    });
    sheet.series(small, {
      type: "scatter", symbolSize: (_value, { data }) => (data.row.particle === at.particle ? 11 : 3 + 4 * Math.sqrt((data.row.weight ?? 0) / most)), itemStyle: { color: token("accent"), opacity: 0.55 },
      data: particles.map((row) => ({ value: [onScreen(row[chosen], unitOf(chosen)), onScreen(row[partner], unitOf(partner))], row })), click: ({ data }) => ({ particle: data.row.particle }),
      tip: ({ data: { row } }) => tipOf(`particle ${row.particle}`, [[at.label(chosen), withUnit(row[chosen], unitOf(chosen))], [at.label(partner), withUnit(row[partner], unitOf(partner))], ["weight", `${figure(100 * row.weight)} %`]]),
    });
  });
  if (!partners.length) sheet.words("Nothing moves together with this parameter.", two.left, 40, two.width);
  return `${at.label(chosen)} against ${partners.slice(0, 3).map((name) => `${at.label(name)} (${figure(pairs.find((row) => [row.first, row.second].includes(name) && [row.first, row.second].includes(chosen))?.correlation)})`).join(", ")}.`;
}

const MOST_AXES = 14;
const MOST_LINES = 300;

/** Survivors and dead: parallel coordinates of a layer's particles, and how far the two groups lie apart. */
function survivors(sheet, { particles, difference }, at) {
  const ranked = [...difference].sort((a, b) => Math.abs(b.difference ?? 0) - Math.abs(a.difference ?? 0));
  const names = ranked.slice(0, MOST_AXES).map((row) => row.parameter);
  const unitOf = (name) => difference.find((row) => row.parameter === name)?.unit ?? "";
  const [one, two] = sheet.columns(2, { gutters: [24, 150], shares: [2.3, 1], right: 20 });
  const height = Math.max(150, at.room - 92);
  sheet.heading("Particles of the layer", "coloured: survive, grey: die; the parameters that differ most first", one.left, 0);
  const kept = [...particles].sort((a, b) => a.rank - b.rank).slice(0, MOST_LINES);
  sheet.option.parallel = { left: one.left + 10, top: 74, width: one.width - 30, height: height - 46, parallelAxisDefault: { type: "value", scale: true, nameTextStyle: { color: token("text-quiet"), fontSize: 10, width: 74, overflow: "truncate" }, axisLine: { lineStyle: { color: token("line-strong") } }, axisTick: { show: false }, axisLabel: { show: false }, splitLine: { show: false } } };
  sheet.option.parallelAxis = [...names.map((name, dim) => ({ dim, name: at.label(name), nameRotate: names.length > 7 ? 18 : 0, nameGap: 12, nameLocation: "end", axisLabel: { formatter: () => "" } })), { dim: names.length, name: "log weight", nameRotate: names.length > 7 ? 18 : 0, nameGap: 12, nameLocation: "end", axisLabel: { formatter: () => "" } }];
  const lines = (name, chosen, style, z) => {
    const own = kept.filter(chosen);
    const id = `p${sheet.option.series.length}`;
    sheet.option.series.push({ id, name, type: "parallel", z, data: own.map((row) => ({ value: [...names.map((parameter) => onScreen(row[parameter], unitOf(parameter))), row.log_weight], row, lineStyle: row.particle === at.particle ? { color: token("text"), width: 3, opacity: 1 } : style })), lineStyle: style, tooltip: { formatter: ({ data: { row } }) => tipOf(`particle ${row.particle}`, [["rank", row.rank], ["log weight", row.log_weight], ["weight", `${figure(100 * row.weight)} %`], ["children", row.children]]) } });
    sheet.clicks.set(id, ({ data }) => ({ particle: data.row.particle }));
  };
  lines("dead", (row) => !row.survives, { color: token("text-quiet"), width: 0.8, opacity: 0.22 }, 1);
  lines("survivors", (row) => row.survives, { color: layerColour(at.layer ?? at.layers - 1, at.layers), width: 1.2, opacity: 0.7 }, 2);
  const shown = ranked.slice(0, MOST_AXES).map((row) => row.parameter);
  const plot = sheet.plot({ ...two, top: 0, height: Math.max(height, shown.length * 14) }, { title: "Survivors less dead", unit: "in deviations of the layer", x: numbers("", { scale: false }), y: parameterAxis(shown, at) });
  sheet.series(plot, {
    type: "bar", barMaxWidth: 10, data: ranked.slice(0, MOST_AXES).map((row) => ({ value: row.difference, row, itemStyle: { color: token((row.difference ?? 0) < 0 ? "less" : "more"), opacity: (row.p_value ?? 1) < 0.05 ? 1 : 0.35 } })),
    click: ({ data }) => ({ parameter: data.row.parameter }), tip: ({ data: { row } }) => tipOf(at.label(row.parameter), [["survivors' mean", withUnit(row.survivors, row.unit)], ["dead's mean", withUnit(row.dead, row.unit)], ["difference", `${figure(row.difference)} deviations`], ["Kolmogorov–Smirnov p", row.p_value]]),
  });
  sheet.chosen(plot, { row: at.parameter && shown.includes(at.parameter) ? shown.indexOf(at.parameter) : null });
  const [most] = ranked;
  const count = particles.filter((row) => row.survives).length;
  return `${count} of ${particles.length} particles survive this layer. ${most ? `They differ most in ${at.label(most.parameter)}: ${withUnit(most.survivors, most.unit)} against ${withUnit(most.dead, most.unit)}, ${figure(most.difference)} deviations.` : ""}`;
}

/** How each view is drawn: of a frame and, where it has that, of the run. @type {Record<string, { frame?: Drawing, run?: Drawing }>} */
export const SEARCH_VIEWS = {
  variance: { frame: varianceOfFrame, run: varianceOfRun },
  schedule: { frame: scheduleOfFrame, run: scheduleOfRun },
  genealogy: { frame: genealogy },
  weights: { frame: weights },
  clouds: { frame: clouds },
  coupling: { frame: coupling },
  survivors: { frame: survivors },
};
