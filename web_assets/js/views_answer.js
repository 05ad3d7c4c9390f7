// Views of the answer: what the likelihood looks like around it, which camera and term pulls where,
// whether there is a second answer, whether another seed agrees, whether the spread predicts the
// error; and weight and error over the frames.

import { figure, token } from "./chart_looks.js";
import { layerAxis, layerInSearch } from "./layer_axis.js";
import { limbLook } from "./limb_looks.js";
import { isChosenLimb, limbGroup } from "./selection.js";
import { layerColour, seriesColour } from "./theme.js";
import {
  categories,
  distinct,
  extent,
  grouped,
  KEY,
  layersOfAll,
  logarithmic,
  numbers,
  onScreen,
  screenUnit,
  sidesOf,
  tipOf,
  withUnit,
} from "./view_sheet.js";

/** @import { Drawing } from "./views_search.js" */

const nats = (value) => `${figure(value)} nats`;
const LIMB_ROW = 18;
/** A difference on a log scale to both sides, level within `level` of nothing. */
const signedDecades = (value, level) => Math.sign(value) * Math.log10(1 + Math.abs(value) / level);
const WHOLE = "whole body";

/** Of a line in pose space: a pose at a place of it, from its ends. */
function poseAt(ends, place, [first, last]) {
  const share = last === first ? 0 : (place - first) / (last - first);
  return ends.map((row) => row.from + share * (row.to - row.from));
}

/**
 * Landscape: the log weight along a line or over two parameters, at each layer's β, by camera and
 * term.
 */
function landscape(sheet, { slice, terms, tempered, plane, rug, marks, ends, scale }, at) {
  const unit = slice[0]?.unit ?? "";
  const isParameter = Boolean(at.parameter) && unit !== "";
  const height = Math.max(130, at.room - 76);
  const x = (name = "") => numbers(name, { scale: true });
  const nameOf = isParameter
    ? `${at.label(at.parameter)}, ${screenUnit(unit)}`
    : "from the estimate (0) to the other pose (1)";
  const tried =
    at.tried?.slice?.length && (at.tried.slice[0].unit ?? "") === unit ? at.tried : null;
  const range = extent(slice.map((row) => row.at));
  const put = (value) => onScreen(value, unit);
  const back = (value) => (unit === "rad" ? (value * Math.PI) / 180 : value);
  const ghost = (value) => ({
    ghosts: [{ colour: "accent", pose: poseAt(ends, value, range) }],
    place: value,
  });
  const inTried = (at.tried?.marks ?? [])
    .filter((row) => row.name === "estimate")
    .map((row) => ({ ...row, name: "tried" }));
  const markSpots = [...marks, ...inTried].map((row) => ({
    x: put(row.at),
    word: row.name,
    colour: { truth: "truth", estimate: "text", tried: "tried" }[row.name] ?? "accent",
  }));
  if (plane.length)
    return landscapePlane(sheet, { plane, rug, marks, scale }, at, { unit, height, put });
  const [one, two, three] = sheet.columns(3, {
    height,
    gutters: [62, 40, 58],
    shares: [1.4, 1, 1.2],
  });
  const main = sheet.plot(one, {
    title: "Log weight",
    unit: `${nameOf}; a click moves the body there`,
    x: x(),
    y: numbers(""),
    click: (value) => ghost(back(value)),
    over: (points) =>
      tipOf(
        `${figure(points[0].axisValue)}${screenUnit(unit)}`,
        points
          .filter((point) => ["log weight", "stored", "tried"].includes(point.seriesName))
          .map((point) => [point.seriesName, nats(point.data[1])]),
      ),
    names: tried ? ["stored", "tried"] : null,
  });
  const finite = slice.filter((row) => Number.isFinite(row.log_weight));
  const [low, high] = extent(finite.map((row) => row.log_weight));
  const outside = slice.filter((row) => row.possible === false);
  if (outside.length) {
    const edges = [
      slice.find((row) => row.possible !== false)?.at,
      slice.findLast((row) => row.possible !== false)?.at,
    ];
    sheet.marks(
      main,
      edges
        .filter((edge) => edge !== undefined && edge !== range[0] && edge !== range[1])
        .map((edge) => ({ x: put(edge), word: "limit", dashed: true })),
    );
  }
  const curve = (rows) => rows.map((row) => [put(row.at), row.log_weight]);
  sheet.line(
    main,
    tried ? "stored" : "log weight",
    curve(slice),
    token(tried ? "stored" : "accent"),
    { symbols: false },
  );
  if (tried) sheet.line(main, "tried", curve(tried.slice), token("tried"), { symbols: false });
  const own = rug.filter((row) => at.layer === null || row.layer === at.layer);
  const bounds = extent(slice.map((row) => row.at));
  if (tried)
    sheet.series(main, {
      name: "tried particles",
      type: "scatter",
      symbol: "rect",
      symbolSize: [1.5, 9],
      itemStyle: { color: token("tried"), opacity: 0.75 },
      data: tried.rug
        .filter((row) => row.at >= bounds[0] && row.at <= bounds[1])
        .map((row) => ({ value: [put(row.at), low - 0.1 * (high - low || 1)], row })),
      tip: ({ data: { row } }) =>
        tipOf(`tried particle ${row.particle}, ${layerInSearch(row.layer, at)}`, [
          ["log weight", nats(row.log_weight)],
        ]),
    });
  sheet.series(main, {
    name: "particles",
    type: "scatter",
    symbol: "rect",
    symbolSize: [1.5, 9],
    data: own
      .filter((row) => row.at >= bounds[0] && row.at <= bounds[1])
      .map((row) => ({
        value: [put(row.at), low - 0.04 * (high - low || 1)],
        row,
        itemStyle: { color: layerColour(row.layer, at.layers), opacity: 0.75 },
      })),
    click: ({ data }) => ({ layer: data.row.layer, particle: data.row.particle }),
    tip: ({ data: { row } }) =>
      tipOf(`particle ${row.particle}, ${layerInSearch(row.layer, at)}`, [
        ["place", isParameter ? withUnit(row.at, unit) : figure(row.at)],
        ["log weight", nats(row.log_weight)],
      ]),
  });
  sheet.marks(main, markSpots, [put(range[0]), put(range[1])]);

  const layers = [...grouped(tempered, "layer")];
  const most = new Map(
    layers.map(([layer, rows]) => [layer, Math.max(...rows.map((row) => row.density)) || 1]),
  );
  const beta = sheet.plot(two, {
    title: "At each layer's β",
    unit: `density, each to its own height${tried ? "; dashed: tried" : ""}`,
    x: x(),
    y: numbers("", { scale: false, min: 0, max: 1.05, axisLabel: { show: false } }),
  });
  for (const [layer, rows] of layers) {
    sheet.line(
      beta,
      `layer ${layer + 1}`,
      rows.map((row) => ({ value: [put(row.at), row.density / (most.get(layer) ?? 1)], row })),
      layerColour(layer, at.layers),
      {
        width: at.layer === layer ? 3 : 1.4,
        symbols: false,
        triggerLineEvent: true,
        click: () => ({ layer }),
        emphasis: { focus: "series" },
        tip: () => tipOf(layerInSearch(layer, at), [["β", rows[0].beta]]),
      },
    );
  }
  for (const [layer, rows] of tried ? grouped(tried.tempered, "layer") : []) {
    const top = Math.max(...rows.map((row) => row.density)) || 1;
    sheet.line(
      beta,
      `tried, layer ${layer + 1}`,
      rows.map((row) => [put(row.at), row.density / top]),
      layerColour(layer, at.layers),
      {
        dashed: true,
        width: at.layer === layer ? 3 : 1.2,
        symbols: false,
        tip: () => tipOf(`tried, ${layerInSearch(layer, at)}`, [["β", rows[0].beta]]),
      },
    );
  }
  sheet.marks(
    beta,
    markSpots.map((one) => ({ ...one, word: "" })),
  );

  const groups = [
    ...grouped(
      terms.map((row) => ({ ...row, name: [row.camera, row.term].filter(Boolean).join(" · ") })),
      "name",
    ),
  ];
  const part = sheet.plot(three, {
    title: "By camera and term",
    unit: "log-likelihood beside its best, nats",
    names: groups.map(([name]) => name),
    x: x(),
    y: numbers(""),
  });
  groups.forEach(([name, rows], index) => {
    const best = Math.max(...rows.map((row) => row.value).filter(Number.isFinite));
    const dim = at.camera !== null && rows[0].camera !== at.camera;
    sheet.line(
      part,
      name,
      rows.map((row) => [put(row.at), row.value - best]),
      seriesColour(index),
      {
        width: at.camera === rows[0].camera ? 3 : 1.5,
        symbols: false,
        triggerLineEvent: true,
        click: () => (rows[0].camera ? { camera: rows[0].camera } : null),
        lineStyle: {
          color: seriesColour(index),
          width: at.camera === rows[0].camera ? 3 : 1.5,
          opacity: dim ? 0.25 : 1,
        },
        tip: () => tipOf(name, [["best along the line", nats(best)]]),
      },
    );
  });
  sheet.marks(
    part,
    markSpots.map((one) => ({ ...one, word: "" })),
  );
  const best = finite.reduce(
    (found, row) => (row.log_weight > (found?.log_weight ?? -Infinity) ? row : found),
    null,
  );
  const bestTried = tried?.slice.reduce(
    (found, row) => (row.log_weight > (found?.log_weight ?? -Infinity) ? row : found),
    null,
  );
  return `${bestTried ? `Best along the tried one's line: ${nats(bestTried.log_weight)}. ` : ""}${best ? `Best along the line: ${nats(best.log_weight)} at ${isParameter ? withUnit(best.at, unit) : figure(best.at)}. ` : ""}${marks.map((row) => `${row.name}: ${nats(row.log_weight)} at ${isParameter ? withUnit(row.at, unit) : figure(row.at)}`).join("; ")}.`;
}

/** The landscape over two parameters. */
function landscapePlane(
  sheet,
  { plane, rug, marks, scale: [{ level, most }] },
  at,
  { height, put, unit },
) {
  const [one] = sheet.columns(1, { height, gutters: 70, right: 110 });
  const [across, down] = [
    distinct(plane.map((row) => row.at)),
    distinct(plane.map((row) => row.second)),
  ];
  const high = Math.max(...plane.map((row) => row.log_weight).filter(Number.isFinite));
  const below = (value) => (value === null ? "-" : -signedDecades(high - value, level));
  const plot = sheet.plot(one, {
    title: "Log weight over two parameters",
    unit: `${at.label(at.parameter ?? "")}, ${screenUnit(unit)}, and another`,
    x: categories(
      across.map((value) => figure(put(value))),
      at.label(at.parameter ?? ""),
    ),
    y: categories(
      down.map((value) => figure(value)),
      "",
    ),
  });
  sheet.heat(plot, {
    cells: plane.map((row) => [
      across.indexOf(row.at),
      down.indexOf(row.second),
      below(row.log_weight),
      row.log_weight,
    ]),
    low: -signedDecades(most, level),
    high: 0,
    framed: false,
    ends: ["best", `${nats(most)} less`],
    key: KEY,
    tip: ({ value }) =>
      tipOf(`${figure(put(across[value[0]]))}, ${figure(down[value[1]])}`, [
        ["log weight", nats(value[3])],
      ]),
  });
  const nearest = (values, value) =>
    values.reduce(
      (best, one, index) => (Math.abs(one - value) < Math.abs(values[best] - value) ? index : best),
      0,
    );
  const points = (name, rows, colour, size) =>
    sheet.series(plot, {
      name,
      type: "scatter",
      symbolSize: size,
      itemStyle: { color: token(colour), opacity: 0.8 },
      data: rows
        .filter((row) => Number.isFinite(row.at) && Number.isFinite(row.second))
        .map((row) => ({ value: [nearest(across, row.at), nearest(down, row.second)], row })),
      tip: ({ data: { row } }) =>
        tipOf(row.name ?? `particle ${row.particle}`, [["log weight", nats(row.log_weight)]]),
    });
  points("particles", rug, "text", 3);
  points("marks", marks, "accent", 10);
  return marks.map((row) => `${row.name}: ${nats(row.log_weight)}`).join("; ");
}

/** Blame: what each camera and term says of each limb, and what the answer would be without it. */
function blame(sheet, { matrix, left_out: leftOut, areas, scale: [{ level, most }] }, at) {
  const tried = at.tried;
  const limbs = distinct(matrix.map((row) => row.limb));
  const sources = distinct(matrix.map((row) => `${row.camera} · ${row.term}`));
  const bound = signedDecades(most, level);
  const height = Math.max(limbs.length * LIMB_ROW, at.room - 110);
  const count = Math.min(leftOut.length, Math.max(6, Math.floor(height / LIMB_ROW)));
  const [one, two] = sheet.columns(2, {
    height,
    least: [limbs.length, count].map((rows) => rows * LIMB_ROW),
    gutters: [124, 190],
    shares: [1.3, 1],
    right: 70,
  });
  const plot = sheet.plot(one, {
    title: "Pose less reference pose",
    unit: `nats, log scale; orange speaks for the pose, blue against it${tried ? "; ◤ stored, ◢ tried" : ""}`,
    below: 64,
    x: categories(sources, "", {
      axisLabel: {
        interval: 0,
        rotate: sources.length > 5 ? 28 : 0,
        fontSize: 10,
        width: 96,
        overflow: "truncate",
      },
    }),
    y: categories(limbs, "", { inverse: true, axisLabel: { interval: 0 } }),
  });
  const rowOf = new Map(matrix.map((row) => [`${row.camera} · ${row.term}/${row.limb}`, row]));
  const cellsOf = (list) =>
    list.map((row) => [
      sources.indexOf(`${row.camera} · ${row.term}`),
      limbs.indexOf(row.limb),
      row.difference === null ? "-" : signedDecades(row.difference, level),
    ]);
  sheet.splitHeat(plot, {
    cells: cellsOf(matrix),
    tried: tried && cellsOf(tried.matrix),
    low: -bound,
    high: bound,
    colours: ["less", "none", "more"],
    ends: [`≥ ${figure(most)}`, `≤ −${figure(most)}`],
    key: KEY,
    click: ({ value }) => {
      const row = rowOf.get(`${sources[value[0]]}/${limbs[value[1]]}`);
      return { limb: row.limb === WHOLE ? null : limbGroup(row.limb), camera: row.camera || null };
    },
    tip: ({ value }) => {
      const row = rowOf.get(`${sources[value[0]]}/${limbs[value[1]]}`);
      const area = areas.find((one) => one.camera === row.camera && one.limb === row.limb);
      return tipOf(`${row.limb}: ${sources[value[0]]}`, [
        ["at the pose", nats(row.value)],
        ["at the reference", nats(row.reference)],
        ["difference", nats(row.difference)],
        ...(area
          ? /** @type {[string, any][]} */ ([
              ["body outside the silhouette", `${figure(area.outside)} mm²`],
              ["silhouette without body", `${figure(area.bare)} mm²`],
            ])
          : []),
      ]);
    },
  });
  for (const limb of limbs)
    if (at.limb && isChosenLimb(limb, at.limb)) sheet.chosen(plot, { row: limbs.indexOf(limb) });
  const nameOf = (row) =>
    `${[row.camera, row.term].filter(Boolean).join(" · ") || "all"}, ${row.factor === 0 ? "left out" : `counts ${figure(row.factor)}`}`;
  const shown = [...leftOut]
    .sort((a, b) => Math.abs(b.change ?? 0) - Math.abs(a.change ?? 0))
    .slice(0, count);
  const bars = sheet.plot(
    { ...two, height: Math.min(two.height, Math.max(90, shown.length * 22)) },
    {
      title: "When one counts less",
      unit: "change of preference for the pose, nats",
      x: numbers("", { scale: false }),
      y: categories(shown.map(nameOf), "", {
        inverse: true,
        axisLabel: { interval: 0, width: 180, overflow: "truncate" },
      }),
    },
  );
  const inTried = new Map((tried?.left_out ?? []).map((row) => [nameOf(row), row]));
  const lists = /** @type {[string, any[]][]} */ (
    tried
      ? [
          ["stored", shown],
          ["tried", shown.map((row) => inTried.get(nameOf(row)) ?? { ...row, change: null })],
        ]
      : [["", shown]]
  );
  for (const [name, list] of lists)
    sheet.series(bars, {
      name,
      type: "bar",
      barMaxWidth: 12,
      data: list.map((row) => ({
        value: row.change,
        row,
        itemStyle: {
          color: token(name || ((row.change ?? 0) < 0 ? "less" : "more")),
          opacity: at.camera === null || at.camera === row.camera ? 1 : 0.35,
        },
      })),
      click: ({ data }) => (data.row.camera ? { camera: data.row.camera } : null),
      tip: ({ data: { row } }) =>
        tipOf(nameOf(row), [
          ["at the pose", nats(row.log_weight)],
          ["at the reference", nats(row.reference)],
          ["preference", nats(row.preference)],
          ["change", nats(row.change)],
        ]),
    });
  const [strongest] = shown;
  const own = at.limb
    ? matrix.filter(
        (row) =>
          isChosenLimb(row.limb, at.limb) && (at.camera === null || row.camera === at.camera),
      )
    : [];
  return own.length
    ? own
        .map(
          (row) =>
            `${row.limb}, ${row.camera} · ${row.term}: ${nats(row.value)}${row.difference === null ? "" : `, ${figure(row.difference)} beside the reference`}`,
        )
        .slice(0, 4)
        .join("; ")
    : strongest
      ? `${nameOf(strongest)}: the preference for the pose changes by ${nats(strongest.change)}.`
      : "";
}

/** Modes of a frame: the share of the weight that each cluster of the particles holds, by layer. */
function modesOfFrame(sheet, tables, at) {
  const sides = sidesOf(tables, at);
  const [one, two] = sheet.columns(2, {
    height: Math.max(120, at.room - 76),
    gutters: [52, 60],
    shares: [1.5, 1],
    right: 20,
  });
  const layers = layersOfAll(sides, "layers");
  const all = (name) => sides.flatMap((side) => side.tables[name]);
  const modes = distinct([...all("modes"), ...all("layers")].map((row) => row.mode));
  const share = numbers("", { scale: false, min: 0, max: 1 });
  const plot = sheet.plot(one, {
    title: "Share of the weight",
    unit: `of each mode, by layer${at.tried ? "; left stored, right tried" : ""}`,
    names: modes.map((mode) => `mode ${mode}`),
    y: share,
    x: layerAxis(layers, at),
  });
  for (const { name: side, tables: own } of sides) {
    modes.forEach((mode, index) => {
      const rowIn = (layer) => own.layers.find((row) => row.layer === layer && row.mode === mode);
      sheet.series(plot, {
        name: `mode ${mode}`,
        type: "bar",
        stack: `mass ${side}`,
        barMaxWidth: 34,
        itemStyle: {
          color: seriesColour(index),
          opacity: side === "stored" ? 0.55 : 1,
          ...(side ? { borderColor: token(side), borderWidth: 1 } : {}),
        },
        data: layers.map((layer) => ({
          value: rowIn(layer)?.mass ?? 0,
          row: rowIn(layer),
          layer,
          side,
        })),
        click: ({ data }) => ({ layer: data.layer }),
        tip: ({ data }) =>
          tipOf(
            [side, `mode ${mode}, ${layerInSearch(data.layer, at)}`].filter(Boolean).join(", "),
            [
              ["share", `${figure(100 * data.value)} %`],
              ["particles", data.row?.particles ?? 0],
            ],
          ),
      });
    });
  }
  sheet.chosen(plot, { column: at.layer });
  const numbersOf = distinct(all("modes").map((row) => row.mode));
  const bars = sheet.plot(two, {
    title: "Last layer",
    unit: "share of the weight; a click draws that mode's body",
    x: categories(numbersOf.map(String), "mode"),
    y: share,
  });
  for (const { name: side, tables: own } of sides)
    sheet.series(bars, {
      name: side,
      type: "bar",
      barMaxWidth: 40,
      data: numbersOf.map((mode) => {
        const row = own.modes.find((entry) => entry.mode === mode);
        const colour = side ? token(side) : seriesColour(modes.indexOf(mode));
        return { value: row?.mass ?? null, row, itemStyle: { color: colour } };
      }),
      click: ({ data }) => (data.row && side !== "tried" ? { mode: data.row.mode } : null),
      tip: ({ data: { row } }) =>
        row
          ? tipOf(
              [side, `mode ${row.mode}`].filter(Boolean).join(", "),
              Object.entries(row)
                .filter(([name]) => name !== "mode")
                .map(([name, value]) => [name.replaceAll("_", " "), value]),
            )
          : "",
    });
  const words = sides.map(({ name, tables: { modes: rows } }) => {
    const held = rows.map((row) => `mode ${row.mode} holds ${figure(100 * (row.mass ?? 0))} %`);
    const what =
      rows.length > 1
        ? `${rows.length} modes: ${held.join(", ")}`
        : "one mode: the particles agree about one pose";
    return name ? `${name}: ${what}` : what[0].toUpperCase() + what.slice(1);
  });
  return `${words.join("; ")}.`;
}

/** Modes of the run: how many there are in each frame, and how far apart. */
function modesOfRun(sheet, { frames: rows }, at) {
  const places = sheet.columns(3, { height: Math.max(110, at.room - 76), gutters: 52 });
  const names = rows.map((row) => String(row.frame));
  for (const [column, title, unit, key, more] of /** @type {const} */ ([
    [0, "Modes", "clusters of the last set", "modes", { min: 0 }],
    [1, "Heaviest mode", "share of the weight", "first_mass", { min: 0, max: 1 }],
    [2, "Distance", "of the two heaviest, mm", "distance", { min: 0 }],
  ])) {
    const plot = sheet.plot(places[column], {
      title,
      unit,
      x: categories(names, "frame"),
      y: numbers("", { scale: false, ...more }),
      over: (points) =>
        tipOf(`frame ${points[0].axisValue}`, [
          [title, points[0].data],
          ["farthest limb", rows[points[0].dataIndex]?.farthest],
        ]),
    });
    sheet.line(
      plot,
      title,
      rows.map((row) => row[key]),
      token("accent"),
      {
        symbols: rows.length < 60,
        triggerLineEvent: true,
        click: ({ dataIndex }) =>
          dataIndex === undefined ? null : { frame: rows[dataIndex].frame },
        stepped: key === "modes",
      },
    );
    const found = at.tried?.frames.find((one) => one.frame === at.frame);
    if (found)
      sheet.series(plot, {
        name: "tried",
        type: "scatter",
        symbol: "diamond",
        symbolSize: 12,
        z: 5,
        itemStyle: { color: token("tried") },
        data: [{ value: [String(at.frame), found[key]] }],
        tip: () => tipOf(`frame ${at.frame}, tried`, [[title, found[key]]]),
      });
    sheet.chosen(plot, { column: String(at.frame) });
  }
  const row = rows.find((one) => one.frame === at.frame);
  return row
    ? `Frame ${row.frame}: ${row.modes} ${row.modes === 1 ? "mode" : "modes"}, the heaviest holds ${figure(100 * row.first_mass)} %${row.distance ? `, the next is ${figure(row.distance)} mm away, farthest in ${row.farthest}` : ""}.`
    : "";
}

/** Seeds: what differs within a seed and between them, and whose particles lie where among all. */
function seeds(sheet, { limbs, seeds: rows, ranks }, at) {
  const height = Math.max(limbs.length * LIMB_ROW, at.room - 76);
  const [one, two, three] = sheet.columns(3, {
    height,
    least: [limbs.length * LIMB_ROW, 0, 0],
    gutters: [124, 54, 54],
    shares: [1.2, 1, 1.2],
    right: 18,
  });
  const names = limbs.map((row) => row.limb);
  const plot = sheet.plot(one, {
    title: "Spread",
    unit: "mm",
    names: ["within a seed", "between seeds", "Monte-Carlo error"],
    x: numbers("", { scale: false }),
    y: categories(names, "", { inverse: true, axisLabel: { interval: 0 } }),
  });
  const inTried = at.tried?.limbs?.length ? at.tried : null;
  const triedLimbs =
    inTried && names.map((limb) => inTried.limbs.find((row) => row.limb === limb) ?? { limb });
  const kinds = [
    ["within a seed", "within", "text-quiet"],
    ["between seeds", "between", "series-1"],
    ["Monte-Carlo error", "error", "accent"],
  ];
  for (const [
    name,
    key,
    colour,
    list,
    border,
  ] of /** @type {[string, string, string, any[], string][]} */ (
    kinds.flatMap(([name, key, colour]) => [
      [name, key, colour, limbs, ""],
      ...(inTried ? [[`tried, ${name}`, key, colour, triedLimbs, "tried"]] : []),
    ])
  )) {
    sheet.series(plot, {
      name,
      type: "bar",
      barMaxWidth: 7,
      barGap: "10%",
      itemStyle: {
        color: token(colour),
        ...(border ? { borderColor: token(border), borderWidth: 1.5 } : {}),
      },
      data: list.map((row) => ({ value: row[key], row })),
      click: ({ data }) => ({ limb: data.row.limb }),
      tip: ({ data: { row } }) =>
        tipOf(row.limb, [
          ["within a seed", `${figure(row.within)} mm`],
          ["between seeds", `${figure(row.between)} mm`],
          ["Monte-Carlo error of one seed", `${figure(row.error)} mm`],
          ["R̂", row.r_hat],
        ]),
    });
  }
  sheet.chosen(plot, { row: at.limb && names.includes(at.limb) ? names.indexOf(at.limb) : null });
  const bars = sheet.plot(two, {
    title: "Each seed's log weight",
    unit: "nats",
    x: categories(
      rows.map((row) => String(row.seed)),
      "seed",
    ),
    y: numbers(""),
  });
  sheet.series(bars, {
    type: "scatter",
    symbolSize: 9,
    data: rows.map((row, index) => ({
      value: [String(row.seed), row.log_weight],
      row,
      itemStyle: { color: seriesColour(index) },
    })),
    click: ({ data }) => ({ seed: data.row.seed }),
    tip: ({ data: { row } }) =>
      tipOf(`seed ${row.seed}`, [
        ["log weight", nats(row.log_weight)],
        ["error", row.error === null ? "–" : `${figure(row.error)} mm`],
        ["evaluations", row.evaluations],
      ]),
  });
  if (inTried)
    sheet.series(bars, {
      name: "tried",
      type: "scatter",
      symbol: "diamond",
      symbolSize: 10,
      itemStyle: { color: token("tried") },
      data: inTried.seeds.map((row) => ({ value: [String(row.seed), row.log_weight], row })),
      tip: ({ data: { row } }) =>
        tipOf(`seed ${row.seed}, tried`, [
          ["log weight", nats(row.log_weight)],
          ["error", row.error === null ? "–" : `${figure(row.error)} mm`],
        ]),
    });
  const chosen =
    distinct(ranks.map((row) => row.parameter)).find((name) => name === at.parameter) ??
    ranks[0]?.parameter;
  const own = ranks.filter((row) => row.parameter === chosen);
  const rank = sheet.plot(three, {
    title: `Ranks: ${chosen ? at.label(chosen) : ""}`,
    unit: "of each seed's particles among all; level where seeds agree",
    x: categories(
      distinct(own.map((row) => row.bin)).map((bin) => String(bin + 1)),
      "bin of rank",
    ),
    y: numbers("", { scale: false, min: 0 }),
  });
  [...grouped(own, "seed")].forEach(([seed, entries], index) => {
    sheet.line(
      rank,
      `seed ${seed}`,
      entries.map((row) => row.count),
      seriesColour(index),
      { stepped: true, symbols: false, tip: () => tipOf(`seed ${seed}`, []) },
    );
  });
  if (own.length) sheet.marks(rank, [{ y: own[0].expected, word: "expected", dashed: true }]);
  const row =
    limbs.find((entry) => entry.limb === at.limb) ??
    limbs.reduce(
      (worst, entry) => ((entry.error ?? 0) > (worst?.error ?? -1) ? entry : worst),
      null,
    );
  return row
    ? `${row.limb}: ${figure(row.within)} mm within a seed, ${figure(row.between)} mm between seeds, Monte-Carlo error ${figure(row.error)} mm, R̂ ${figure(row.r_hat)}.`
    : "";
}

/** Coverage: spread against error, and the rank of the truth in the last set. */
function coverage(sheet, { frames: rows, correlation, pit }, at) {
  const [one, two] = sheet.columns(2, {
    height: Math.max(120, at.room - 76),
    least: [220, 0],
    gutters: [62, 56],
    shares: [1.25, 1],
    right: 20,
  });
  const limbs = distinct(rows.map((row) => row.limb));
  const known = rows.filter((row) => row.spread > 0 && row.error > 0);
  const plot = sheet.plot(one, {
    title: "Spread and error",
    unit: "mm, log scales; on the line the spread is the error",
    names: [...limbs, ...(at.tried ? ["tried"] : [])],
    x: logarithmic("spread of the last set, mm"),
    y: logarithmic(""),
  });
  limbs.forEach((limb) => {
    const dim = at.limb !== null && at.limb !== limb;
    const { colour, symbol } = limbLook(limb, limbs);
    sheet.series(plot, {
      name: limb,
      type: "scatter",
      symbolSize: (_value, { data }) => (data.row.frame === at.frame ? 11 : 5),
      itemStyle: { color: colour, opacity: dim ? 0.08 : 0.6 },
      symbol,
      data: known
        .filter((row) => row.limb === limb)
        .map((row) => ({ value: [row.spread, row.error], row })),
      click: ({ data }) => ({ frame: data.row.frame, limb: data.row.limb }),
      tip: ({ data: { row } }) =>
        tipOf(`${row.limb}, frame ${row.frame}`, [
          ["spread", `${figure(row.spread)} mm`],
          ["error", `${figure(row.error)} mm`],
        ]),
    });
  });
  // An arrow from what is stored of the shown frame to what was tried in it.
  const of = (rows) =>
    rows.filter((row) => row.frame === at.frame && row.spread > 0 && row.error > 0);
  const moved = at.tried
    ? of(at.tried.frames)
        .map((row) => ({ row, from: of(rows).find((one) => one.limb === row.limb) }))
        .filter(({ from }) => from)
    : [];
  if (moved.length)
    sheet.series(plot, {
      name: "tried",
      type: "lines",
      coordinateSystem: "cartesian2d",
      z: 5,
      symbol: ["none", "arrow"],
      symbolSize: 9,
      lineStyle: { color: token("tried"), width: 2, opacity: 1 },
      data: moved.map(({ row, from }) => ({
        coords: [
          [from.spread, from.error],
          [row.spread, row.error],
        ],
        row,
      })),
      tip: ({ data: { row } }) =>
        tipOf(`${row.limb}, frame ${row.frame}, tried`, [
          ["spread", `${figure(row.spread)} mm`],
          ["error", `${figure(row.error)} mm`],
        ]),
    });
  const bounds = extent(known.flatMap((row) => [row.spread, row.error]));
  if (known.length)
    sheet.line(
      plot,
      "",
      [
        [bounds[0], bounds[0]],
        [bounds[1], bounds[1]],
      ],
      token("text-quiet"),
      { dashed: true, symbols: false, silent: true },
    );
  const limb = at.limb && pit.some((row) => row.limb === at.limb) ? at.limb : pit[0]?.limb;
  const own = pit.filter((row) => row.limb === limb);
  const bars = sheet.plot(two, {
    title: `Rank of the truth: ${limb ?? ""}`,
    unit: "level where the spread is right; band: 95 % of luck",
    x: categories(
      own.map((row) => String(row.bin + 1)),
      "bin of rank",
    ),
    y: numbers("", { scale: false, min: 0 }),
  });
  sheet.series(bars, {
    type: "bar",
    barMaxWidth: 30,
    data: own.map((row) => ({
      value: row.count,
      row,
      itemStyle: {
        color: token(row.count > row.upper ? "bad" : row.count < row.lower ? "warn" : "accent"),
      },
    })),
    tip: ({ data: { row } }) =>
      tipOf(`bin ${row.bin + 1}`, [
        ["share", row.count],
        ["expected", row.expected],
        ["band", `${figure(row.lower)} to ${figure(row.upper)}`],
      ]),
  });
  if (own.length)
    sheet.marks(bars, [
      { y: own[0].expected, word: "expected" },
      { y: own[0].lower, dashed: true },
      { y: own[0].upper, dashed: true },
    ]);
  const row = correlation.find((entry) => entry.limb === at.limb) ?? correlation[0];
  return row
    ? `${row.limb}: over ${row.frames} frames spread and error rank with ρ = ${figure(row.rho)} (p = ${figure(row.p_value)}).`
    : "";
}

const LEVELS = [50, 80, 95];
const percent = (share) => (share === null ? "none" : `${Math.round(100 * share)} %`);

/** Where a joint is over the frames, with bands of its half width. */
function drawPath(sheet, box, path, at) {
  const rows = path.filter((row) => row.point === path[0].point);
  const plot = sheet.plot(box, {
    title: rows.length ? `Where ${rows[0].point} is` : "Where a joint is",
    unit: rows.length ? `mm, band: ± ${figure(rows[0].half_width)} mm` : "",
    names: ["x", "y", "z"],
    x: categories(
      rows.map((row) => String(row.frame)),
      "frame",
    ),
    y: numbers("", { scale: true }),
    click: (x) => (rows[Math.round(x)] ? { frame: rows[Math.round(x)].frame } : null),
  });
  ["x", "y", "z"].forEach((axis, index) => {
    const band = { type: "line", symbol: "none", silent: true, stack: axis, stackStrategy: "all" };
    const [colour, none] = [seriesColour(index), { opacity: 0 }];
    sheet.series(plot, {
      ...band,
      lineStyle: none,
      data: rows.map((row) => row[axis] - row.half_width),
    });
    sheet.series(plot, {
      ...band,
      lineStyle: none,
      areaStyle: { color: colour, opacity: 0.18 },
      data: rows.map((row) => 2 * row.half_width),
    });
    sheet.line(
      plot,
      axis,
      rows.map((row) => row[axis]),
      colour,
      { symbols: false },
    );
  });
  if (rows.length) sheet.chosen(plot, { column: String(at.frame) });
}

/** Uncertainty: half widths by joint, and how often they hold beside how often that is promised. */
function uncertainty(sheet, { joints, coverage: shares, path }, at) {
  const [one, two, three] = sheet.columns(3, {
    height: Math.max(120, at.room - 76),
    least: [220, 0, 0],
    gutters: [62, 56, 62],
    shares: [1.5, 1, 1.5],
    right: 20,
  });
  const names = joints.map((row) => row.point);
  const known = LEVELS.filter((level) => joints.some((row) => row[`within_${level}`] !== null));
  const plot = sheet.plot(one, {
    title: "Half widths",
    unit: "mm; so many frames are no farther off",
    names: [...known.map((level) => `${level} %`), "bias"],
    x: categories(names, ""),
    y: numbers("", { scale: false, min: 0 }),
    over: (points) => {
      const row = joints[points[0].dataIndex];
      /** @param {string} words @param {string} key @returns {[string, any]} */
      const line = (words, key) => [words, `${figure(row[key])} mm`];
      return tipOf(row.point, [
        ...known.map((level) => line(`${level} % within`, `within_${level}`)),
        ...known.map((level) => line(`without bias, ${level} %`, `scatter_${level}`)),
        line(`bias, in axes of ${row.carrier}`, "bias"),
      ]);
    },
  });
  known.forEach((level, index) => {
    sheet.line(
      plot,
      `${level} %`,
      joints.map((row) => row[`within_${level}`]),
      seriesColour(index),
      { stepped: false },
    );
  });
  sheet.line(
    plot,
    "bias",
    joints.map((row) => row.bias),
    token("text-quiet"),
    { dashed: true },
  );
  const hasTruth = shares.some((row) => row.true !== null);
  const plotted = sheet.plot(two, {
    title: "Promised and found",
    unit: "share of frames within; on the line the promise holds",
    names: ["drawn again", ...(hasTruth ? ["truth"] : [])],
    x: numbers("promised", { scale: false, min: 0.4, max: 1 }),
    y: numbers("", { scale: false, min: 0, max: 1 }),
  });
  const found = (name, key, colour, symbol) =>
    sheet.series(plotted, {
      name,
      type: "scatter",
      symbol,
      symbolSize: 7,
      itemStyle: { color: token(colour), opacity: 0.6 },
      data: shares
        .filter((row) => row[key] !== null)
        .map((row) => ({ value: [row.promised, row[key]], row })),
      tip: ({ data: { row } }) =>
        tipOf(row.point, [
          ["promised", percent(row.promised)],
          ["found, drawn again", percent(row.found)],
          ["found, truth", percent(row.true)],
        ]),
    });
  found("drawn again", "found", "accent", "circle");
  if (hasTruth) found("truth", "true", "truth", "diamond");
  sheet.line(
    plotted,
    "",
    [
      [0.4, 0.4],
      [1, 1],
    ],
    token("text-quiet"),
    { dashed: true, symbols: false, silent: true },
  );
  drawPath(sheet, three, path, at);
  const last = known.at(-1);
  if (!last) return "";
  const widest = joints.reduce((most, row) =>
    (row[`within_${last}`] ?? 0) > (most[`within_${last}`] ?? 0) ? row : most,
  );
  return `${widest.point}: in ${last} % of frames no farther off than ${figure(widest[`within_${last}`])} mm.`;
}

/** Weight and, with truth, error over the frames. */
function overFrames(sheet, { frames: rows }, at) {
  const measured = rows.some((row) => row.error_mm !== null);
  const places = sheet.columns(measured ? 3 : 2, {
    height: Math.max(110, at.room - 76),
    gutters: 62,
  });
  const names = rows.map((row) => String(row.frame));
  const click = ({ dataIndex }) =>
    dataIndex === undefined ? null : { frame: rows[dataIndex].frame };
  const draw = (column, title, unit, key, colour, y) => {
    const plot = sheet.plot(places[column], {
      title,
      unit,
      x: categories(names, "frame"),
      y: numbers("", y),
      click: (x) => (rows[Math.round(x)] ? { frame: rows[Math.round(x)].frame } : null),
      over: (points) =>
        tipOf(`frame ${points[0].axisValue}`, [[title, `${figure(points[0].data)} ${unit}`]]),
    });
    sheet.line(
      plot,
      title,
      rows.map((row) => row[key]),
      token(colour),
      { symbols: rows.length < 3, triggerLineEvent: true, click },
    );
    sheet.chosen(plot, { column: String(at.frame) });
  };
  const zero = { scale: false, min: 0 };
  if (measured) draw(0, "Error of the markers", "mm", "error_mm", "layer-7", zero);
  draw(measured ? 1 : 0, at.score[0], at.score[1], "log_weight", "accent", {});
  draw(measured ? 2 : 1, "Time", "ms a frame", "milliseconds", "text-quiet", zero);
  const row = rows.find((one) => one.frame === at.frame);
  return row
    ? `Frame ${row.frame}: ${measured ? `error ${figure(row.error_mm)} mm, ` : ""}${at.score[0]} ${figure(row.log_weight)} ${at.score[1]}, ${row.evaluations} evaluations in ${figure(row.milliseconds)} ms.`
    : "";
}

/**
 * How each view is drawn; see SEARCH_VIEWS.
 * @type {Record<string, { frame?: Drawing, run?: Drawing }>}
 */
export const ANSWER_VIEWS = {
  landscape: { frame: landscape },
  blame: { frame: blame },
  modes: { frame: modesOfFrame, run: modesOfRun },
  seeds: { frame: seeds },
  coverage: { run: coverage },
  uncertainty: { run: uncertainty },
  frames: { run: overFrames },
};
