// Views of the search itself: what each layer settled, whether annealing proceeded as asked, who
// descends from whom, how the weight is shared out, what the clouds learnt, which parameters trade
// off, what the dead had wrong.

import { figure, token } from "./chart_looks.js";
import { layerAxis, layerInSearch, layerNumber, layerOfSides, layerValue } from "./layer_axis.js";
import { searchName } from "./studio/shown_layers.js";
import { layerColour } from "./theme.js";
import {
  byLayer,
  categories,
  distinct,
  extent,
  grouped,
  KEY,
  layersOfAll,
  logarithmic,
  NARROW,
  numbers,
  onScreen,
  screenUnit,
  sidesOf,
  tipOf,
  withUnit,
} from "./view_sheet.js";

/** @import { Sheet } from "./view_sheet.js" */
/**
 * What a drawing knows beside its tables. `label`: of a parameter; `room`: pixels of height that
 * are free; `tried`: the same tables of the trial that is shown, else null. `searchLayers`,
 * `searches`: how the frame's layers are counted.
 * @typedef {{ searchLayers: number, searches: number, layer: number | null, limb: string | null,
 *   parameter: string | null, particle: number | null, camera: string | null, frame: number, over:
 *   boolean, layers: number, label: (name: string) => string, room: number, tried: any, score:
 *   [string, string] }} At
 * @typedef {(sheet: Sheet, tables: any, at: At) => string} Drawing fills a sheet with tables (rows
 *   by key); the exact numbers of what is chosen in a sentence
 */

const ROW = 13;
const FEW = 24;
/** Of what is negative or nothing there is no logarithm. */
const decades = (value) => (value > 0 ? Math.log10(value) : null);

/** Columns of a map, named above it, where they are seen however long the map is. */
const ABOVE = { position: "top", axisLine: { show: false } };
const aboveMap = (names) => categories(names, "", ABOVE);

/** Rows of a map: parameters under their limbs, in the body's order. */
function parameterAxis(names, at) {
  return categories(names, "", {
    inverse: true,
    axisLabel: {
      interval: 0,
      fontSize: names.length > FEW ? 9.5 : 11,
      width: 130,
      overflow: "truncate",
      formatter: (name) => at.label(name),
    },
  });
}

/**
 * Decades below the first layer's variance that a colour tells apart: the same in every frame and
 * run.
 */
const DECADES = 3;

/**
 * Variance reduction of a frame: two maps that share one scale, and the chosen parameter over the
 * layers.
 */
function varianceOfFrame(sheet, tables, at) {
  const { layers: rows, settled } = tables;
  const sides = sidesOf(tables, at);
  const names = distinct(rows.map((row) => row.parameter));
  const first = new Map(settled.map((row) => [row.parameter, row.first]));
  const layers = layersOfAll(sides, "layers");
  const tried = at.tried?.layers ?? null;
  // Both sides as shares of what is stored of the first layer.
  const share = (row, key) =>
    first.get(row.parameter) > 0 ? decades(row[key] / first.get(row.parameter)) : null;
  const reduced = (best, row) => ((row.reduction ?? 0) > (best.reduction ?? 0) ? row : best);
  const chosen =
    at.parameter && names.includes(at.parameter) ? at.parameter : settled.reduce(reduced).parameter;
  // Beside a scene there is no room for three: the parameter over the layers stands below its maps.
  const isNarrow = sheet.width < NARROW;
  const height = Math.max(names.length * ROW, isNarrow ? 0 : at.room - 76);
  const shape = isNarrow
    ? { gutters: [142, -36], right: 58 }
    : { gutters: [142, 26, 112], shares: [1, 1, 1.1], right: 14 };
  const [one, two, aside] = sheet.columns(isNarrow ? 2 : 3, {
    ...shape,
    height: [height, height, Math.max(90, at.room - 84)],
    stacks: false,
  });
  const three = aside ?? {
    left: one.left,
    width: sheet.width - one.left - 24,
    height: 120,
    isBelow: true,
  };
  const rowAt = (list, layer, place) =>
    list?.find((entry) => entry.layer === layer && entry.parameter === names[place]);
  const maps = /** @type {const} */ ([
    [one, "before", "Before noise", true],
    [two, "after", "After noise", false],
  ]);
  for (const [column, key, title, isLeft] of maps) {
    const plot = sheet.plot(column, {
      title,
      unit: isLeft
        ? `share of the first layer's variance${tried ? "; ◤ stored, ◢ tried" : ""}`
        : "",
      below: 12,
      x: layerAxis(layers, at, ABOVE),
      y: isLeft
        ? parameterAxis(names, at)
        : { ...parameterAxis(names, at), axisLabel: { show: false } },
    });
    const cellsOf = (list) =>
      list.map((row) => [row.layer, names.indexOf(row.parameter), share(row, key) ?? "-"]);
    sheet.splitHeat(plot, {
      cells: cellsOf(rows),
      tried: tried && cellsOf(tried),
      low: -DECADES,
      high: 0,
      framed: layers.length <= FEW && names.length <= 2 * FEW,
      ends: ["100 %", `${figure(100 * 10 ** -DECADES)} %`],
      key: isLeft ? 0 : Math.min(90, height - 40),
      click: ({ value }) => ({ layer: value[0], parameter: names[value[1]] }),
      tip: ({ value: [layer, place] }) => {
        const [row, other] = [rowAt(rows, layer, place), rowAt(tried, layer, place)];
        const { unit, parameter } = row ?? other;
        const shown = (name) =>
          [row, ...(tried ? [other] : [])]
            .map((entry) => (entry ? figure(entry[name]) : "–"))
            .join(" → ") + ` ${unit}²`;
        const of = row ?? other;
        return tipOf(`${at.label(parameter)}, ${layerOfSides(layer, at)}`, [
          ["as weighed", shown("weighed")],
          ["before noise", shown("before")],
          ["after noise", shown("after")],
          ["of the first", `${figure((100 * of[key]) / first.get(parameter))} %`],
        ]);
      },
    });
    sheet.chosen(plot, {
      column: at.layer,
      row: at.parameter ? names.indexOf(at.parameter) : null,
    });
  }
  const { unit } = rows.find((row) => row.parameter === chosen);
  const lines = sides.flatMap(({ name, tables: own, colour }) => {
    const mine = own.layers.filter((row) => row.parameter === chosen);
    const of = (key) =>
      byLayer(mine, layers, key).map((value) => (value !== null && value > 0 ? value : null));
    const noise = [
      [name || "before noise", of("before"), name ? colour : "series-1", {}],
      [
        named(name, "after noise"),
        of("after"),
        name ? colour : "series-0",
        { dashed: Boolean(name) },
      ],
    ];
    return name ? noise : [["as weighed", of("weighed"), "text-quiet", { dashed: true }], ...noise];
  });
  const plot = sheet.plot(three, {
    title: at.label(chosen),
    unit: `variance, ${unit}²${at.tried ? "; dashed: after noise" : ""}`,
    names: at.tried ? sides.map(({ name }) => name) : lines.map(([name]) => name),
    x: layerAxis(layers, at),
    y: logarithmic(),
    over: tipOfLayer(at),
  });
  const click = ({ dataIndex }) => ({ layer: layers[dataIndex], parameter: chosen });
  for (const [name, data, colour, more] of lines)
    sheet.line(plot, name, data, token(colour), { ...more, click });
  sheet.chosen(plot, { column: at.layer });
  const last = Math.max(...rows.map((row) => row.layer));
  const layer = at.layer ?? last;
  const words = sides.map(({ name, tables: own }) => {
    const now = rowAt(own.layers, name ? layer : Math.min(layer, last), names.indexOf(chosen));
    const what = now
      ? `variance ${figure(now.weighed)} ${now.unit}² as weighed, ${figure(now.before)} before noise, ${figure(now.after)} after noise`
      : "no such layer";
    return name ? `${name}: ${what}` : what;
  });
  return `${at.label(chosen)}, ${layerOfSides(layer, at)}: ${words.join("; ")}.`;
}

/** What a line is called, of one of both sides. */
const named = (side, name) => (side ? `${side}, ${name}` : name);
/** What stands over a layer of a plot. */
const tipOfLayer = (/** @type {At} */ at) => (points) =>
  tipOf(
    layerInSearch(Number(points[0].axisValue) - 1, at),
    points
      .filter((point) => point.seriesName && !point.seriesName.startsWith("series"))
      .map((point) => [point.seriesName, point.data?.value ?? point.data]),
  );

/**
 * Of frames that are searched several times over the rows of the last search, whose result is the
 * frame's; `step`: its layers counted from 0.
 */
function lastSearches(rows) {
  return [...grouped(rows, "frame").values()].flatMap((own) => {
    const search = Math.max(...own.map((row) => row.search));
    const its = own.filter((row) => row.search === search);
    const first = Math.min(...its.map((row) => row.layer));
    return its.map((row) => ({ ...row, step: row.layer - first }));
  });
}

/** Decades to either side of a run's median that a colour tells apart: the same in every run. */
const DECADES_BESIDE = 1.5;

/**
 * Variance of the run: parameters over the frames, and the chosen parameter as layers over frames.
 */
function varianceOfRun(sheet, { last, parameter: searched }, at) {
  const parameter = lastSearches(searched);
  const frames = last.map((row) => row.frame);
  const names = Object.keys(last[0] ?? {}).filter((name) => name !== "frame");
  const medians = new Map(
    names.map((name) => {
      const own = last
        .map((row) => row[name])
        .filter((value) => value > 0)
        .sort((a, b) => a - b);
      return [name, own[own.length >> 1] ?? 0];
    }),
  );
  const cells = last.flatMap((row, column) =>
    names.map((name, place) => [
      column,
      place,
      medians.get(name) > 0 ? (decades(row[name] / medians.get(name)) ?? "-") : "-",
    ]),
  );
  const bound = DECADES_BESIDE;
  const height = Math.max(names.length * ROW, at.room - 60);
  const [one, two] = sheet.columns(2, {
    height,
    least: [names.length * ROW, 0],
    gutters: [142, 92],
    shares: [1.5, 1],
    right: 16,
  });
  const whole = sheet.plot(
    { ...one, width: one.width - (one.isBelow ? 50 : 0) },
    {
      title: "Last set, by frame",
      unit: "variance beside the run's median, log scale",
      below: 12,
      x: aboveMap(frames.map(String)),
      y: parameterAxis(names, at),
    },
  );
  sheet.heat(whole, {
    cells,
    low: -bound,
    high: bound,
    colours: ["less", "none", "more"],
    framed: false,
    ends: [`≥ ${figure(10 ** bound)}×`, `≤ ÷ ${figure(10 ** bound)}`],
    key: KEY,
    click: ({ value }) => ({ frame: frames[value[0]], parameter: names[value[1]] }),
    tip: ({ value }) =>
      tipOf(`${at.label(names[value[1]])}, frame ${frames[value[0]]}`, [
        ["variance", last[value[0]][names[value[1]]]],
        ["run's median", medians.get(names[value[1]])],
      ]),
  });
  sheet.chosen(whole, {
    column: frames.indexOf(at.frame),
    row: at.parameter ? names.indexOf(at.parameter) : null,
  });
  if (!parameter.length) {
    sheet.words(
      "Choose a parameter: a click on its row shows it layer by layer over the frames.",
      two,
    );
    return "";
  }
  const levels = Math.max(...parameter.map((row) => row.step)) + 1;
  const own = distinct(parameter.map((row) => row.frame));
  // As in a frame's map: shares of what its first layer's set has.
  const first = new Map(
    parameter.filter((row) => row.step === 0).map((row) => [row.frame, row.weighed]),
  );
  const shareOf = (row) =>
    first.get(row.frame) > 0 ? (decades(row.before / first.get(row.frame)) ?? "-") : "-";
  const plot = sheet.plot(two, {
    title: at.label(at.parameter ?? ""),
    unit: "before noise, share of each first layer's variance",
    x: categories(own.map(String), "frame"),
    y: categories(
      Array.from({ length: levels }, (_, layer) => layerValue(layer)),
      "layer",
      { inverse: true, nameGap: 24 },
    ),
  });
  sheet.heat(plot, {
    cells: parameter.map((row) => [
      own.indexOf(row.frame),
      row.step,
      shareOf(row),
      row.layer,
      row.before,
    ]),
    low: -DECADES,
    high: 0,
    framed: false,
    click: ({ value }) => ({ frame: own[value[0]], layer: value[3] }),
    tip: ({ value }) =>
      tipOf(`frame ${own[value[0]]}, layer ${value[1] + 1}`, [
        ["before noise", value[4]],
        ["of the first", `${figure(100 * 10 ** value[2])} %`],
      ]),
  });
  sheet.chosen(plot, {
    column: own.indexOf(at.frame),
    row: parameter.find((row) => row.frame === at.frame && row.layer === at.layer)?.step ?? null,
  });
  return at.parameter
    ? `${at.label(at.parameter)}: last variance ${figure(last[frames.indexOf(at.frame)]?.[at.parameter])} in frame ${at.frame}, median of the run ${figure(medians.get(at.parameter))}.`
    : "";
}

/** Schedule: α, β, the effective number and the time of each layer, stored beside tried. */
function scheduleOfFrame(sheet, tables, at) {
  const sides = sidesOf(tables, at);
  const layers = layersOfAll(sides, "layers");
  const isNarrow = sheet.width < NARROW;
  const has = (key) => sides.some((side) => side.tables.layers.some((row) => row[key] !== null));
  // Stored and tried, or survival and moves, are told apart by a legend of its own line, above all four.
  const above = at.tried || has("acceptance") ? 18 : 0;
  const whole = Math.max(120, at.room - 76 - above);
  const height = isNarrow ? Math.max(100, (at.room - 152 - above) / 2) : whole;
  const columns = sheet.columns(isNarrow ? 2 : 4, {
    height,
    gutters: 52,
    right: 10,
    stacks: false,
  });
  const places = [0, 1, 2, 3].map((place) => ({
    ...columns[place % columns.length],
    top: above + (place < columns.length ? 0 : height + 76),
  }));
  const click = ({ dataIndex }) => ({ layer: layers[dataIndex] });
  /** @param {[string, string, string, any][]} kinds name, key, colour of one side alone, style */
  const draw = (column, title, unit, y, kinds) => {
    const x = layerAxis(layers, at);
    const plot = sheet.plot(places[column], { title, unit, x, y, over: tipOfLayer(at) });
    for (const { name: side, tables: own, colour } of sides) {
      for (const [name, key, alone, more] of kinds) {
        const data = byLayer(own.layers, layers, key);
        const called = kinds.length > 1 || !side ? named(side, name) : side;
        sheet.line(plot, called, data, token(side ? colour : alone), { ...more, click });
      }
      const alarmed = own.layers.filter((row) => row.alarm);
      const key = kinds[kinds.length - 1][1];
      if (alarmed.length)
        sheet.series(plot, {
          type: "scatter",
          name: "alarm",
          symbol: "triangle",
          symbolSize: 9,
          itemStyle: { color: token("bad") },
          data: alarmed.map((row) => ({
            value: [layerValue(row.layer), row[key]],
            words: row.alarm,
          })),
          click: ({ dataIndex }) => ({ layer: alarmed[dataIndex].layer }),
          tip: ({ data }) => tipOf("Alarm", [[data.words, ""]]),
        });
    }
    sheet.chosen(plot, { column: at.layer });
  };
  const asked = { dashed: true, stepped: true };
  /** @type {[string, string, string, any][]} */
  const moves = has("acceptance") ? [["moves taken", "acceptance", "layer-9", {}]] : [];
  const betas = sides.flatMap((side) => side.tables.layers.map((row) => row.beta));
  const positive = betas.every((value) => value === null || value > 0);
  if (has("alpha_reached"))
    draw(0, "Survival α", "dashed: asked", numbers("", { min: 0, max: 1, scale: false }), [
      ["asked", "alpha_wanted", "text-quiet", asked],
      ...moves,
      ["reached", "alpha_reached", "accent", {}],
    ]);
  else draw(0, "Best log weight", "nats", numbers(), [["best", "best_log_weight", "accent", {}]]);
  const beta = positive ? logarithmic() : numbers();
  if (has("temper"))
    draw(1, "Exponent of the set", "how much of the likelihood it is a sample with", numbers(), [
      ["exponent", "temper", "accent", {}],
    ]);
  else if (has("beta")) draw(1, "Exponent β", "log scale", beta, [["β", "beta", "accent", {}]]);
  else draw(1, "Particles", "in each layer", numbers(), [["particles", "particles", "accent", {}]]);
  const counts = sides.map((side) => side.tables.layers.at(-1).particles).join(" and ");
  draw(2, "Effective number", `of ${counts} particles, log scale`, logarithmic("", { min: 1 }), [
    ["particles", "particles", "text-quiet", { dashed: true }],
    ["effective", "effective", "accent", {}],
  ]);
  const spent = sides.map(({ tables: own }) =>
    figure(own.layers.reduce((sum, row) => sum + (row.milliseconds ?? 0), 0)),
  );
  const plot = sheet.plot(places[3], {
    title: "Time",
    unit: `${spent.join(" and ")} ms in all`,
    x: layerAxis(layers, at),
    y: numbers("", { scale: false }),
  });
  for (const { name, tables: own, colour } of sides)
    sheet.series(plot, {
      name: name || "time",
      type: "bar",
      barMaxWidth: 22,
      click,
      data: byLayer(own.layers, layers, "milliseconds").map((value, index) => ({
        value,
        itemStyle: { color: name ? token(colour) : layerColour(index, layers.length) },
      })),
      tip: ({ dataIndex, value }) =>
        tipOf(named(name, layerInSearch(dataIndex, at)), [["time", `${figure(value)} ms`]]),
    });
  sheet.chosen(plot, { column: at.layer });
  if (at.tried) sheet.legend(["stored", "tried"], columns[0].left, 4, 160);
  else if (has("acceptance")) sheet.legend(["reached", "moves taken"], columns[0].left, 4, 220);
  const words = sides.map(({ name, tables: own }) => {
    const row = own.layers.find((one) => one.layer === at.layer) ?? own.layers.at(-1);
    const what = `${layerOfSides(row.layer, at)}: β ${figure(row.beta)}, α asked ${figure(row.alpha_wanted)}, reached ${figure(row.alpha_reached)}, effective number ${figure(row.effective)} of ${row.particles}${Number.isFinite(row.largest) ? `, largest weight ${figure(100 * row.largest)} %` : ""}${sampledWords(row)}${row.alarm ? `. Alarm: ${row.alarm}` : ""}`;
    return name ? `${name}: ${what}` : `L${what.slice(1)}`;
  });
  return `${words.join("; ")}.`;
}

/** What a sampled posterior's layer says besides, with a comma before. */
function sampledWords({ temper, acceptance, log_evidence: evidence }) {
  if (!Number.isFinite(temper)) return "";
  const taken = Number.isFinite(acceptance)
    ? `, ${figure(100 * acceptance)} % of the moves taken`
    : "";
  return `, exponent of the set ${figure(temper)}${taken}, log evidence ${figure(evidence)} nats`;
}

/** Schedule of the run: the ends of each frame's annealing over the frames. */
function scheduleOfRun(sheet, { frames: rows }, at) {
  const places = sheet.columns(3, { height: Math.max(110, at.room - 76) });
  const names = rows.map((row) => String(row.frame));
  const click = ({ dataIndex }) => ({ frame: rows[dataIndex].frame });
  const draw = (column, title, unit, y, lines) => {
    const plot = sheet.plot(places[column], {
      title,
      unit,
      x: categories(names, "frame"),
      y,
      over: (points) =>
        tipOf(
          `frame ${points[0].axisValue}`,
          points
            .filter((point) => point.data !== undefined)
            .map((point) => [point.seriesName, point.data?.value ?? point.data]),
        ),
    });
    for (const [name, key, colour] of lines)
      sheet.line(
        plot,
        name,
        rows.map((row) => row[key]),
        token(colour),
        { symbols: rows.length < 3, click, triggerLineEvent: true },
      );
    sheet.chosen(plot, { column: String(at.frame) });
  };
  if (rows.some((row) => Number.isFinite(row.log_evidence)))
    draw(0, "Log evidence", "nats", numbers(), [["log evidence", "log_evidence", "accent"]]);
  else
    draw(0, "Exponent β", "of the first and last layer, log scale", logarithmic(), [
      ["first layer", "beta_first", "layer-0"],
      ["last layer", "beta_last", "layer-9"],
    ]);
  draw(1, "Least survival α", "reached in a frame", numbers("", { min: 0, scale: false }), [
    ["least α", "least_alpha", "accent"],
  ]);
  draw(2, "Least effective number", "log scale", logarithmic("", { min: 1 }), [
    ["least effective number", "least_effective", "accent"],
  ]);
  const row = rows.find((one) => one.frame === at.frame);
  return row
    ? `Frame ${row.frame}: β from ${figure(row.beta_first)} to ${figure(row.beta_last)}, least α ${figure(row.least_alpha)}, least effective number ${figure(row.least_effective)}, ${row.alarms} layers with an alarm.`
    : "";
}

/** Where each particle stands in its layer's column, 0 to 1: beside its parent's place. */
function familyPlaces(rows) {
  const places = new Map();
  const byNumber = [...grouped(rows, "layer")].sort((a, b) => a[0] - b[0]);
  for (const [layer, own] of byNumber) {
    const above = places.get(layer - 1);
    const nearest = (a, b) => (above.get(a.parent) ?? 1) - (above.get(b.parent) ?? 1);
    const before = above ? nearest : (a, b) => Number(b.survives) - Number(a.survives);
    const order = [...own].sort((a, b) => before(a, b) || b.weight - a.weight);
    const place = (index) => (order.length > 1 ? index / (order.length - 1) : 0.5);
    places.set(layer, new Map(order.map((row, index) => [row.particle, place(index)])));
  }
  return places;
}

/** What stands at a particle of a genealogy. */
function tipOfParticle(row, side, /** @type {At} */ at) {
  const second = row.second_parent === null ? [] : [["second parent", row.second_parent]];
  return tipOf(named(side, `particle ${row.particle} of ${layerInSearch(row.layer, at)}`), [
    ["parent", row.parent ?? "–"],
    .../** @type {[string, any][]} */ (second),
    ["first ancestor", row.ancestor ?? "–"],
    ["children", row.children],
    ["weight", `${figure(100 * row.weight)} %`],
    ["log weight", row.log_weight],
    ["survives", row.survives ? "yes" : "no"],
  ]);
}

/** Genealogy: a column a layer, ribbons from particles to their children; tried in a band below. */
function genealogy(sheet, tables, at) {
  const sides = sidesOf(tables, at);
  const layers = layersOfAll(sides, "particles");
  const height = Math.max(130, at.room - 76);
  const [one, two] = sheet.columns(2, {
    height,
    least: [220, 0],
    gutters: [at.tried ? 48 : 30, 62],
    shares: [2.4, 1],
  });
  const bands = sides.length;
  const plot = sheet.plot(one, {
    title: "Particles and their parents",
    unit: "bright: has descendants in the last layer; dashed: crossover's second parent",
    x: layerAxis(layers, at, { axisLine: { onZero: false } }),
    y: {
      type: "value",
      min: -0.03,
      max: 1.03,
      inverse: true,
      splitLine: { show: false },
      interval: 0.5 / bands,
      axisLine: { show: false },
      axisLabel: {
        show: bands > 1,
        showMinLabel: false,
        showMaxLabel: false,
        formatter: (value) => ({ 0.25: "stored", 0.75: "tried" })[value] ?? "",
      },
    },
  });
  sides.forEach(({ name: side, tables: own }, band) => {
    const rows = own.particles;
    const found = familyPlaces(rows);
    const places = (layer, particle) => {
      const place = found.get(layer)?.get(particle);
      return place === undefined ? undefined : (band + 0.02 + 0.96 * place) / bands;
    };
    const colour = (layer) => layerColour(layer, layers.length);
    const ribbons = (chosen, key) =>
      rows
        .filter((row) => row.layer > 0 && row[key] !== null && chosen(row))
        .filter((row) => places(row.layer - 1, row[key]) !== undefined)
        .map((row) => ({
          coords: [
            [row.layer - 1, places(row.layer - 1, row[key])],
            [row.layer, places(row.layer, row.particle)],
          ],
          lineStyle: { color: colour(row.layer) },
        }));
    const lines = (data, style) =>
      data.length &&
      sheet.series(plot, {
        name: side,
        type: "lines",
        coordinateSystem: "cartesian2d",
        silent: true,
        data,
        lineStyle: style,
        progressive: 0,
        tooltip: { show: false },
      });
    lines(
      ribbons((row) => !row.survives, "parent"),
      { width: 0.6, opacity: 0.16, curveness: 0.02 },
    );
    lines(
      ribbons((row) => row.survives, "second_parent"),
      { width: 0.8, opacity: 0.5, type: [3, 3] },
    );
    lines(
      ribbons((row) => row.survives, "parent"),
      { width: 1.3, opacity: 0.85 },
    );
    const heaviest = Math.max(...rows.map((row) => row.weight ?? 0)) || 1;
    const ring = { borderColor: token("text"), borderWidth: 2 };
    sheet.series(plot, {
      name: side,
      type: "scatter",
      data: rows.map((row) => ({
        value: [row.layer, places(row.layer, row.particle)],
        row,
        symbolSize: 2.5 + 7 * Math.sqrt((row.weight ?? 0) / heaviest),
        itemStyle: {
          color: colour(row.layer),
          opacity: row.survives ? 1 : 0.3,
          ...(row.particle === at.particle && row.layer === at.layer ? ring : {}),
        },
      })),
      click: ({ data }) => ({ layer: data.row.layer, particle: data.row.particle }),
      tip: ({ data: { row } }) => tipOfParticle(row, side, at),
    });
  });
  sheet.chosen(plot, { column: at.layer });
  const count = sheet.plot(two, {
    title: "Distinct ancestors",
    unit: "in the first set, log scale; dashed: with descendants",
    x: layerAxis(layers, at),
    y: logarithmic("", { min: 1 }),
    over: tipOfLayer(at),
  });
  const click = ({ dataIndex }) => ({ layer: layers[dataIndex] });
  for (const { name, tables: own, colour } of sides) {
    const of = (key) => byLayer(own.ancestors, layers, key).map((value) => value || null);
    const quiet = token(name ? colour : "text-quiet");
    sheet.line(count, named(name, "with descendants"), of("with_descendants"), quiet, {
      dashed: true,
      click,
    });
    sheet.line(count, named(name, "ancestors"), of("ancestors"), token(colour), { click });
  }
  sheet.chosen(count, { column: at.layer });
  const chosen = tables.particles.find(
    (row) =>
      row.particle === at.particle && row.layer === (at.layer ?? tables.ancestors.at(-1).layer),
  );
  if (chosen && !at.tried)
    return `Particle ${chosen.particle} of ${layerInSearch(chosen.layer, at)}: parent ${chosen.parent ?? "none"}, first ancestor ${chosen.ancestor ?? "unknown"}, ${chosen.children} children, ${chosen.survives ? "has" : "has no"} descendants in the last layer.`;
  const words = sides.map(({ name, tables: own }) => {
    const last = own.ancestors.at(-1);
    const what = `he ${last.particles} particles of ${layerInSearch(last.layer, at)} descend from ${last.ancestors} of the first set`;
    return name ? `${name}: t${what}` : `T${what}`;
  });
  return `${words.join("; ")}.`;
}

/** Weight concentration: sorted weights of a layer, largest share and Pareto k̂ over the layers. */
function weights(sheet, tables, at) {
  const sides = sidesOf(tables, at);
  const layers = layersOfAll(sides, "layers");
  const [one, two, three] = sheet.columns(3, {
    height: Math.max(120, at.room - 76),
    gutters: [60, 56, 50],
    shares: [1.5, 1, 1],
  });
  const layer = tables.sorted[0]?.layer ?? at.layer ?? 0;
  const shown = sides.map(({ tables: own }) => layerInSearch(own.sorted[0]?.layer ?? 0, at));
  const plot = sheet.plot(one, {
    title: `Weights of ${distinct(shown).join(" and ")}`,
    unit: "largest first, log scales",
    names: at.tried ? ["stored", "tried"] : null,
    x: logarithmic("rank", { min: 1, nameGap: 20 }),
    y: logarithmic(),
  });
  for (const { name, tables: own, colour: token_ } of sides) {
    const lowest = Math.min(...own.sorted.map((row) => row.rank));
    const colour = name ? token(token_) : layerColour(layer, at.layers);
    const size = (_value, { data }) => (data.row.particle === at.particle ? 11 : 4);
    sheet.series(plot, {
      name: name || "weight",
      type: "line",
      showSymbol: true,
      symbolSize: size,
      data: own.sorted
        .filter((row) => row.weight > 0)
        .map((row) => ({ value: [row.rank - lowest + 1, row.weight], row })),
      lineStyle: { color: colour, width: 2 },
      itemStyle: { color: colour },
      click: ({ data }) => ({ layer, particle: data.row.particle }),
      tip: ({ data: { row } }) =>
        tipOf(named(name, `particle ${row.particle}`), [
          ["rank", row.rank - lowest + 1],
          ["weight", `${figure(100 * row.weight)} %`],
          ["cumulated", `${figure(100 * row.cumulated)} %`],
          ["log weight", row.log_weight],
        ]),
    });
  }
  const click = ({ dataIndex }) => ({ layer: layers[dataIndex] });
  const draw = (place, title, unit, key, y, marks = []) => {
    const x = layerAxis(layers, at);
    const drawn = sheet.plot(place, { title, unit, x, y, over: tipOfLayer(at) });
    sheet.marks(drawn, marks);
    for (const { name, tables: own, colour } of sides) {
      const data = byLayer(own.layers, layers, key);
      sheet.line(drawn, name || title.toLowerCase(), data, token(colour), { click });
    }
    sheet.chosen(drawn, { column: at.layer });
  };
  draw(two, "Largest weight", "share, log scale", "largest", logarithmic());
  const most = ({ max }) => Math.max(1, Math.ceil(10 * max) / 10);
  const limit = [{ y: 0.7, word: "0.7", colour: "warn", dashed: true }];
  const y = numbers("", { scale: false, max: most });
  draw(three, "Tail of the weights", "Pareto k̂; above 0.7 a few hold all", "k_hat", y, limit);
  const words = sides.map(({ name, tables: own }) => {
    const now = own.sorted[0]?.layer ?? layer;
    const row = own.layers.find((entry) => entry.layer === now) ?? own.layers.at(-1);
    const what = `${layerInSearch(row.layer, at)}: the heaviest of ${row.particles} particles holds ${figure(100 * row.largest)} %, ${row.for_90} hold 90 %, effective number ${figure(row.effective)}, tail k̂ ${figure(row.k_hat)}`;
    return name ? `${name}: ${what}` : `L${what.slice(1)}`;
  });
  return `${words.join("; ")}.`;
}

/**
 * First and last cloud: every parameter's interval before and after, and the chosen one's densities
 * over the layers.
 */
function clouds(sheet, { summary, own: steps, ridges, marks }, at) {
  const tried = at.tried;
  const byParameter = grouped(summary, "parameter");
  const names = [...byParameter.keys()];
  const marked = new Map(marks.map((row) => [row.parameter, row]));
  const chosen = ridges[0]?.parameter ?? names[0];
  const height = Math.max(names.length * ROW, at.room - 76);
  const [one, two] = sheet.columns(2, {
    height: [height, Math.max(90, at.room - 66)],
    least: [names.length * ROW, 260],
    gutters: [142, 40],
    shares: [1.15, 1],
  });
  const places = new Map(
    [...byParameter].map(([name, [first]]) => {
      const half = (first.q95 - first.q05) / 2;
      return [
        name,
        (value) => (half > 0 && Number.isFinite(value) ? (value - first.median) / half : null),
      ];
    }),
  );
  const all = sheet.plot(one, {
    title: "5 % to 95 % of the particles",
    unit: "in half widths of the first cloud",
    names: ["first cloud", "last cloud", ...(tried ? ["tried"] : []), "estimate", "truth"],
    below: 12,
    x: numbers("", { scale: false, min: -2, max: 2, interval: 1, position: "top" }),
    y: parameterAxis(names, at),
  });
  const placed = (parameter, value) => places.get(parameter)?.(value) ?? null;
  const bar = (name, which, colour, thickness, lower = 0) =>
    sheet.series(all, {
      name,
      type: "custom",
      z: name === "first cloud" ? 2 : 3,
      encode: { x: [0, 1], y: 2 },
      clip: true,
      itemStyle: { color: token(colour) },
      data: names.flatMap((parameter, row) => {
        const own = which(byParameter.get(parameter), parameter);
        const ends = [placed(parameter, own.q05), placed(parameter, own.q95)];
        return ends[0] === null ? [] : [{ value: [...ends, row], own }];
      }),
      renderItem: (_params, api) => {
        const [from, to] = [
          api.coord([Math.max(-2, api.value(0)), api.value(2)]),
          api.coord([Math.min(2, api.value(1)), api.value(2)]),
        ];
        return {
          type: "rect",
          shape: {
            x: from[0],
            y: from[1] - thickness / 2 + lower,
            width: Math.max(1, to[0] - from[0]),
            height: thickness,
            r: 2,
          },
          style: { fill: token(colour), opacity: 0.85 },
        };
      },
      click: ({ data }) => ({ parameter: data.own.parameter }),
      tip: ({ data: { own } }) =>
        tipOf(`${at.label(own.parameter)}, ${layerInSearch(own.layer, at)}`, [
          ["median", withUnit(own.median, own.unit)],
          ["5 %", withUnit(own.q05, own.unit)],
          ["95 %", withUnit(own.q95, own.unit)],
          ["deviation", withUnit(own.deviation, own.unit)],
        ]),
    });
  bar("first cloud", (own) => own[0], "layer-0", 9);
  bar(
    "last cloud",
    (own) => own.at(-1),
    tried ? "stored" : "layer-9",
    tried ? 3 : 4,
    tried ? -2 : 0,
  );
  const triedOf = tried && grouped(tried.summary, "parameter");
  if (tried)
    bar("tried", (own, parameter) => triedOf.get(parameter)?.at(-1) ?? own.at(-1), "tried", 3, 2);
  const point = (name, key, colour, symbol) =>
    sheet.series(all, {
      name,
      type: "scatter",
      z: 4,
      symbol,
      symbolSize: 8,
      itemStyle: { color: token(colour), borderColor: token("surface"), borderWidth: 1 },
      data: names.flatMap((parameter, row) => {
        const place = placed(parameter, marked.get(parameter)?.[key]);
        return place === null
          ? []
          : [{ value: [Math.max(-2, Math.min(2, place)), row], parameter }];
      }),
      click: ({ data }) => ({ parameter: data.parameter }),
      tip: ({ data }) =>
        tipOf(at.label(data.parameter), [
          [name, withUnit(marked.get(data.parameter)[key], marked.get(data.parameter).unit)],
        ]),
    });
  point("estimate", "estimate", "text", "circle");
  point("truth", "truth", "truth", "diamond");
  sheet.chosen(all, { row: names.indexOf(chosen) });

  // The first layer's set as it was drawn, then every layer's set as it was weighted.
  const sets = (rows) =>
    grouped(
      rows.map((row) => ({ ...row, set: row.weighted ? row.layer : -1 })),
      "set",
    );
  const [storedSets, triedSets] = [sets(ridges), tried ? sets(tried.ridges) : new Map()];
  const order = distinct([...storedSets.keys(), ...triedSets.keys()]).sort((a, b) => a - b);
  const own = order.map((set) => /** @type {[number, any[]]} */ ([set, storedSets.get(set) ?? []]));
  const { unit, lower, upper, estimate, truth } = marked.get(chosen) ?? { unit: "" };
  const [least, greatest] = extent([...ridges, ...(tried?.ridges ?? [])].map((row) => row.value));
  const nameOf = (set) => (set < 0 ? "drawn" : layerNumber(set, at));
  const plot = sheet.plot(two, {
    title: at.label(chosen),
    unit: `${screenUnit(unit)}, density of each layer's set`,
    x: numbers("", {
      scale: false,
      min: onScreen(least, unit),
      max: onScreen(greatest, unit),
      axisLabel: {
        formatter: (value) => figure(value),
        hideOverlap: true,
        showMinLabel: false,
        showMaxLabel: false,
      },
    }),
    y: {
      ...numbers("", {}),
      scale: false,
      min: 0,
      max: own.length,
      interval: 1,
      axisLabel: {
        formatter: (value) =>
          own[own.length - 1 - value] ? nameOf(own[own.length - 1 - value][0]) : "",
        hideOverlap: true,
      },
      splitLine: { show: false },
    },
  });
  // Where a search begins, above its first layer's set; the first set as drawn belongs to the first
  // search.
  const starts = own.flatMap(([set], index) =>
    at.searches > 1 && set >= 0 && set % at.searchLayers === 0
      ? [
          {
            y: own.length - (set ? index : 0),
            word: searchName(set / at.searchLayers),
            dashed: true,
          },
        ]
      : [],
  );
  sheet.marks(plot, starts);
  const setName = (set) => (set < 0 ? "drawn" : layerValue(set));
  own.forEach(([set, stored], index) => {
    for (const [side, rows] of [stored, triedSets.get(set) ?? []].entries()) {
      if (!rows.length) continue;
      const base = own.length - 1 - index;
      const most = Math.max(...rows.map((row) => row.density)) || 1;
      const alone =
        set < 0 ? token("ghost") : layerColour(set, Math.max(at.layers, own.length - 1));
      const colour = tried ? token(side ? "tried" : "stored") : alone;
      const dim = at.layer !== null && at.layer !== set;
      sheet.series(plot, {
        name: side ? named("tried", setName(set)) : setName(set),
        type: "custom",
        z: 2 + 2 * index + side,
        encode: { x: 0, y: 1 },
        data: [[onScreen(rows[0].value, unit), base]],
        clip: false,
        renderItem: (_params, api) => {
          const points = rows.map((row) =>
            api.coord([onScreen(row.value, unit), base + (1.15 * row.density) / most]),
          );
          const ends = [
            api.coord([onScreen(rows.at(-1).value, unit), base]),
            api.coord([onScreen(rows[0].value, unit), base]),
          ];
          return {
            type: "polygon",
            shape: { points: [...points, ...ends] },
            style: {
              fill: colour,
              opacity: dim ? 0.18 : tried ? 0.45 : 0.6,
              stroke: colour,
              lineWidth: dim ? 0.5 : 1.4,
            },
          };
        },
        click: () => ({ layer: Math.max(0, set), parameter: chosen }),
        tip: () => {
          const row = (side ? tried.own : steps).find(
            (entry) => entry.layer === Math.max(0, set) && Boolean(entry.weighted) === set >= 0,
          );
          return tipOf(
            `${at.label(chosen)}, ${set < 0 ? "first set as drawn" : layerInSearch(set, at)}`,
            [
              ["mean", withUnit(row?.mean, unit)],
              ["deviation", withUnit(row?.deviation, unit)],
              ["median", withUnit(row?.median, unit)],
            ],
          );
        },
      });
    }
  });
  const near = (value) => Number.isFinite(value) && value >= least && value <= greatest;
  sheet.marks(
    plot,
    [
      { x: near(lower) ? onScreen(lower, unit) : null, word: "limit", dashed: true },
      { x: near(upper) ? onScreen(upper, unit) : null, word: "limit", dashed: true },
      { x: near(estimate) ? onScreen(estimate, unit) : null, word: "estimate", colour: "text" },
      { x: near(truth) ? onScreen(truth, unit) : null, word: "truth", colour: "truth" },
    ],
    [onScreen(least, unit), onScreen(greatest, unit)],
  );
  const words = (list) => {
    const mine = list.filter((row) => row.parameter === chosen);
    const [first, last] = [mine[0], mine.at(-1)];
    return `${withUnit(first.mean, unit)} ± ${withUnit(first.deviation, unit)} in the first set, ${withUnit(last.mean, unit)} ± ${withUnit(last.deviation, unit)} in the last`;
  };
  const beside = tried ? `; tried ${words(tried.summary)}` : "";
  return `${at.label(chosen)}: ${words(summary)}${beside}; estimate ${withUnit(estimate, unit)}${Number.isFinite(truth) ? `, truth ${withUnit(truth, unit)}` : ""}.`;
}

/**
 * Coupling: correlations of a layer's set in the order of settling, and one parameter against its
 * nearest partners.
 */
function coupling(sheet, { matrix, order, particles }, at) {
  const tried = at.tried;
  const names = [...order].sort((a, b) => a.place - b.place).map((row) => row.parameter);
  const size = Math.max(at.room - 76, Math.min(names.length * 12, 520));
  const [one, two] = sheet.columns(2, {
    height: size,
    least: Math.min(names.length * 12, 520),
    gutters: [142, 30],
    shares: [1, 1.15],
  });
  const plot = sheet.plot(
    { ...one, width: one.width - 50 },
    {
      title: "Correlation",
      unit: `in the order of settling${tried ? "; ◤ stored, ◢ tried" : ""}`,
      below: 16,
      x: categories(names, "", { axisLabel: { show: false } }),
      y: parameterAxis(names, at),
    },
  );
  const cellsOf = (list) =>
    list.map((row) => [
      names.indexOf(row.second),
      names.indexOf(row.first),
      row.correlation ?? "-",
    ]);
  sheet.splitHeat(plot, {
    cells: cellsOf(matrix),
    tried: tried && cellsOf(tried.matrix),
    low: -1,
    high: 1,
    colours: ["less", "none", "more"],
    ends: ["+1", "−1"],
    key: KEY,
    framed: names.length < FEW,
    click: ({ value }) => ({ parameter: names[value[1]] }),
    tip: ({ value }) =>
      tipOf(`${at.label(names[value[1]])} × ${at.label(names[value[0]])}`, [
        [
          value[3] === undefined
            ? "correlation"
            : value[3]
              ? "correlation, tried"
              : "correlation, stored",
          value[2],
        ],
      ]),
  });
  const of = (row) => Math.abs(row.correlation ?? 0);
  const pairs = matrix.filter((row) => row.first !== row.second);
  const strongest = pairs.reduce(
    (best, row) => (of(row) > of(best ?? { correlation: 0 }) ? row : best),
    null,
  );
  const chosen =
    at.parameter && names.includes(at.parameter) ? at.parameter : (strongest?.first ?? names[0]);
  sheet.chosen(plot, { row: names.indexOf(chosen) });
  const partners = distinct(
    pairs
      .filter((row) => [row.first, row.second].includes(chosen))
      .sort((a, b) => of(b) - of(a))
      .map((row) => (row.first === chosen ? row.second : row.first)),
  ).slice(0, 6);
  const unitOf = (name) => order.find((row) => row.parameter === name)?.unit ?? "";
  const [across, down] = two.width > 560 ? [3, 2] : [2, 3];
  const [width, height] = [two.width / across - 44, two.height / down - 60];
  const start = two.isBelow ? sheet.height : 0;
  const most = Math.max(...particles.map((row) => row.weight ?? 0)) || 1;
  partners.slice(0, across * down).forEach((partner, index) => {
    const small = sheet.plot(
      {
        left: two.left + 20 + (index % across) * (width + 44),
        top: start + Math.floor(index / across) * (Math.max(40, height) + 60),
        width,
        height: Math.max(40, height),
      },
      {
        title: at.label(partner),
        unit: figure(
          pairs.find(
            (row) =>
              [row.first, row.second].includes(partner) && [row.first, row.second].includes(chosen),
          )?.correlation,
        ),
        x: numbers("", { axisLabel: { show: false }, splitLine: { show: false } }),
        y: numbers("", { axisLabel: { show: false }, splitLine: { show: false } }),
        below: 12,
      },
    );
    for (const [cloud, name, colour] of tried
      ? [
          [particles, "stored", "stored"],
          [tried.particles, "tried", "tried"],
        ]
      : [[particles, "", "accent"]])
      sheet.series(small, {
        name,
        type: "scatter",
        symbolSize: (_value, { data }) =>
          data.row.particle === at.particle ? 11 : 3 + 4 * Math.sqrt((data.row.weight ?? 0) / most),
        itemStyle: { color: token(colour), opacity: 0.55 },
        data: cloud.map((row) => ({
          value: [onScreen(row[chosen], unitOf(chosen)), onScreen(row[partner], unitOf(partner))],
          row,
        })),
        click: ({ data }) => ({ particle: data.row.particle }),
        tip: ({ data: { row } }) =>
          tipOf(`particle ${row.particle}`, [
            [at.label(chosen), withUnit(row[chosen], unitOf(chosen))],
            [at.label(partner), withUnit(row[partner], unitOf(partner))],
            ["weight", `${figure(100 * row.weight)} %`],
          ]),
      });
  });
  if (!partners.length) sheet.words("Nothing moves together with this parameter.", two);
  const withChosen = (list, name) =>
    figure(
      list.find(
        (row) =>
          row.first !== row.second &&
          [name, chosen].includes(row.first) &&
          [name, chosen].includes(row.second),
      )?.correlation,
    );
  return `${at.label(chosen)} against ${partners
    .slice(0, 3)
    .map(
      (name) =>
        `${at.label(name)} (${withChosen(matrix, name)}${tried ? `, tried ${withChosen(tried.matrix, name)}` : ""})`,
    )
    .join(", ")}.`;
}

const MOST_AXES = 14;
const AXIS_ROOM = 56;
const MOST_LINES = 300;

/**
 * Survivors and dead: parallel coordinates of a layer's particles, and how far the two groups lie
 * apart.
 */
function survivors(sheet, { particles, difference }, at) {
  const tried = at.tried;
  const ranked = [...difference].sort(
    (a, b) => Math.abs(b.difference ?? 0) - Math.abs(a.difference ?? 0),
  );
  const unitOf = (name) => difference.find((row) => row.parameter === name)?.unit ?? "";
  const height = Math.max(150, at.room - 92);
  const [one, two] = sheet.columns(2, {
    height: Math.max(height, MOST_AXES * 14),
    least: [200, MOST_AXES * 14],
    gutters: [24, 150],
    shares: [2.3, 1],
    right: 20,
  });
  const names = ranked
    .slice(0, Math.min(MOST_AXES, Math.floor(one.width / AXIS_ROOM)))
    .map((row) => row.parameter);
  sheet.heading(
    "Particles of the layer",
    `${tried ? "survivors, stored and tried" : "coloured: survive, grey: die"}; the parameters that differ most first`,
    one.left,
    0,
    one.width + 12,
  );
  const heaviest = (list) => [...list].sort((a, b) => a.rank - b.rank).slice(0, MOST_LINES);
  const kept = heaviest(particles);
  sheet.option.parallel = {
    left: one.left + 10,
    top: 74,
    width: one.width - 30,
    height: (one.isBelow ? one.height : height) - 46,
    parallelAxisDefault: {
      type: "value",
      scale: true,
      nameTextStyle: { color: token("text-quiet"), fontSize: 10, width: 74, overflow: "truncate" },
      axisLine: { lineStyle: { color: token("line-strong") } },
      axisTick: { show: false },
      axisLabel: { show: false },
      splitLine: { show: false },
    },
  };
  sheet.option.parallelAxis = [
    ...names.map((name, dim) => ({
      dim,
      name: at.label(name),
      nameRotate: names.length > 7 ? 18 : 0,
      nameGap: 12,
      nameLocation: "end",
      axisLabel: { formatter: () => "" },
    })),
    {
      dim: names.length,
      name: "log weight",
      nameRotate: names.length > 7 ? 18 : 0,
      nameGap: 12,
      nameLocation: "end",
      axisLabel: { formatter: () => "" },
    },
  ];
  sheet.height = Math.max(sheet.height, 74 + (one.isBelow ? one.height : height) - 30);
  const lines = (name, chosen, style, z, list = kept) => {
    const own = list.filter(chosen);
    const id = `p${sheet.option.series.length}`;
    sheet.option.series.push({
      id,
      name,
      type: "parallel",
      z,
      data: own.map((row) => ({
        value: [
          ...names.map((parameter) => onScreen(row[parameter], unitOf(parameter))),
          row.log_weight,
        ],
        row,
        lineStyle:
          row.particle === at.particle ? { color: token("text"), width: 3, opacity: 1 } : style,
      })),
      lineStyle: style,
      tooltip: {
        formatter: ({ data: { row } }) =>
          tipOf(`particle ${row.particle}`, [
            ["rank", row.rank],
            ["log weight", row.log_weight],
            ["weight", `${figure(100 * row.weight)} %`],
            ["children", row.children],
          ]),
      },
    });
    sheet.clicks.set(id, ({ data }) => ({ particle: data.row.particle }));
  };
  if (!tried)
    lines(
      "dead",
      (row) => !row.survives,
      { color: token("text-quiet"), width: 0.8, opacity: 0.22 },
      1,
    );
  const alone = layerColour(at.layer ?? at.layers - 1, at.layers);
  const style = (colour) => ({ color: colour, width: 1.2, opacity: tried ? 0.5 : 0.7 });
  lines(
    tried ? "stored" : "survivors",
    (row) => row.survives,
    style(tried ? token("stored") : alone),
    2,
  );
  if (tried)
    lines("tried", (row) => row.survives, style(token("tried")), 3, heaviest(tried.particles));
  const shown = ranked.slice(0, MOST_AXES).map((row) => row.parameter);
  const plot = sheet.plot(two, {
    title: "Survivors less dead",
    unit: "in deviations of the layer",
    x: numbers("", { scale: false }),
    y: parameterAxis(shown, at),
  });
  const byName = tried && new Map(tried.difference.map((row) => [row.parameter, row]));
  for (const [name, list] of /** @type {[string, any[]][]} */ (
    tried
      ? [
          ["stored", ranked],
          ["tried", ranked.map((row) => byName.get(row.parameter))],
        ]
      : [["", ranked]]
  ))
    sheet.series(plot, {
      name,
      type: "bar",
      barMaxWidth: 10,
      data: list.slice(0, MOST_AXES).map((row) => ({
        value: row.difference,
        row,
        itemStyle: {
          color: token(name || ((row.difference ?? 0) < 0 ? "less" : "more")),
          opacity: (row.p_value ?? 1) < 0.05 ? 1 : 0.35,
        },
      })),
      click: ({ data }) => ({ parameter: data.row.parameter }),
      tip: ({ data: { row } }) =>
        tipOf(at.label(row.parameter), [
          ["survivors' mean", withUnit(row.survivors, row.unit)],
          ["dead's mean", withUnit(row.dead, row.unit)],
          ["difference", `${figure(row.difference)} deviations`],
          ["Kolmogorov–Smirnov p", row.p_value],
        ]),
    });
  sheet.chosen(plot, {
    row: at.parameter && shown.includes(at.parameter) ? shown.indexOf(at.parameter) : null,
  });
  const [most] = ranked;
  const alive = (list) =>
    `${list.filter((row) => row.survives).length} of ${list.length} particles`;
  return `${alive(particles)} survive this layer${tried ? `, tried ${alive(tried.particles)}` : ""}. ${most ? `They differ most in ${at.label(most.parameter)}: ${withUnit(most.survivors, most.unit)} against ${withUnit(most.dead, most.unit)}, ${figure(most.difference)} deviations.` : ""}`;
}

/**
 * How each view is drawn: of a frame and, where it has that, of the run.
 * @type {Record<string, { frame?: Drawing, run?: Drawing }>}
 */
export const SEARCH_VIEWS = {
  variance: { frame: varianceOfFrame, run: varianceOfRun },
  schedule: { frame: scheduleOfFrame, run: scheduleOfRun },
  genealogy: { frame: genealogy },
  weights: { frame: weights },
  clouds: { frame: clouds },
  coupling: { frame: coupling },
  survivors: { frame: survivors },
};
