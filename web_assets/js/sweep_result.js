// The result of a sweep: parallel coordinates of all runs, a heat map of two knobs, a curve over
// one knob with its interval over the seeds. A click opens a run at its worst frame.

import { figure as words, token, typeSize } from "./chart_looks.js";
import { card, dotted, element, field, fill, hint, select } from "./elements.js";
import { Figure } from "./figure.js";
import { layerColour, seriesColour } from "./theme.js";
import { categories, distinct, extent, numbers, records, tipOf } from "./view_sheet.js";

/** @import { Schemas } from "./api_types" */
/** @import { Sheet } from "./view_sheet.js" */
/**
 * @typedef {{ vary: Record<string, any[]>, knobs: any[], measures: any[], tables: any[], session:
 *   string, tracker: string, weighting: string, seeds: number[], frames: number[], software:
 *   string, best: any }} Result
 */

const CAP = 5;
const SHADE_STEPS = 10;
const SHADES = ["heat-lowest", "heat-low", "heat-middle", "heat-high"];

const sameValue = (a, b) => String(a) === String(b);

/** Numbers from low to high, words as they were given. */
const inOrder = (values) =>
  values.every((value) => typeof value === "number") ? [...values].sort((a, b) => a - b) : values;

/** The address of a run at its worst frame. */
const runAddress = (session, run) =>
  `/?${new URLSearchParams({ session, run: run.run, frame: String(run.worst_frame) })}`;

/** Everything that a drawing needs. @param {Result} result */
function reading(result) {
  const [runs, points] = result.tables.map(records);
  const names = Object.keys(result.vary);
  const knobOf = (name) => result.knobs.find((one) => one.name === name);
  const labelOf = (name) => {
    const { label, unit } = knobOf(name);
    return unit ? `${label} [${unit}]` : label;
  };
  const isAt = (row, fixed) =>
    Object.entries(fixed).every(([name, value]) => sameValue(row[name], value));
  return { result, runs, points, names, labelOf, isAt };
}

/**
 * Show a finished sweep in `place`.
 * @param {HTMLElement} place
 * @param {Schemas["ComparisonDetail"]} detail
 */
export function showSweep(place, detail) {
  const result = /** @type {Result} */ (/** @type {unknown} */ (detail.result));
  const own = reading(result);
  const measures = result.measures.map(
    (one) =>
      /** @type {[string, string]} */ ([
        one.key,
        one.unit ? `${one.label}, ${one.unit}` : one.label,
      ]),
  );
  const chosen = { measure: result.best.measure, across: own.names[0], other: own.names[1] ?? "" };
  const fixed = Object.fromEntries(own.names.map((name) => [name, result.vary[name][0]]));
  const places = ["parallel", "map", "curve"].map((name) =>
    element("section", { className: "figure sweep-figure", dataset: { key: name } }),
  );
  const figures = places.map((one) => new Figure(one));
  const choices = element("div", { className: "sweep-choices" });
  /** @param {Record<string, any>} changes */
  const open = ({ run }) => {
    location.href = runAddress(detail.comparison.session, run);
  };

  function shown(name, title, question, draw) {
    const measure = result.measures.find((one) => one.key === chosen.measure);
    const left = own.names.filter((one) => one !== chosen.across && one !== chosen.other);
    return {
      name: `${detail.comparison.session}-${detail.comparison.name}-${name}-${measure.key}`,
      title,
      question,
      notes: [],
      caption: `Session ${detail.comparison.session}, sweep ${detail.comparison.name}: ${own.names.map((one) => `${one} ${result.vary[one].join(", ")}`).join("; ")}; ${result.tracker}, ${result.weighting}, frames ${result.frames[0]} to ${result.frames[1] - 1}, seeds ${result.seeds.join(", ")}${name === "parallel" || !left.length ? "" : `; at ${left.map((one) => `${one} ${fixed[one]}`).join(", ")}`}; intervals: 95 %, bootstrap over seeds. Studio ${result.software}.`,
      tables: [
        result.tables[0],
        {
          ...result.tables[1],
          title: `${result.tables[1].title}: ${measure.label}`,
          rows: result.tables[1].rows.filter((row) => row[own.names.length] === measure.key),
        },
      ],
      choose: open,
      link: () => `${location.pathname}${location.search}`,
      draw: (sheet, room) =>
        draw(
          sheet,
          {
            ...own,
            measure,
            chosen,
            fixed: Object.fromEntries(left.map((one) => [one, fixed[one]])),
          },
          room,
        ),
    };
  }

  function show() {
    const left = own.names.filter((one) => one !== chosen.across && one !== chosen.other);
    const choose = (label, options, value, change) =>
      field(
        label,
        select(options, value, {
          onchange: (event) => {
            change(event.target.value);
            show();
          },
        }),
      );
    const knobs = own.names.map(
      (name) => /** @type {[string, string]} */ ([name, own.labelOf(name)]),
    );
    const swap = (role, other) => (name) => {
      if (chosen[other] === name) chosen[other] = chosen[role];
      chosen[role] = name;
    };
    fill(
      choices,
      choose("Measure", measures, chosen.measure, (key) => {
        chosen.measure = key;
      }),
      own.names.length > 1 && choose("Across", knobs, chosen.across, swap("across", "other")),
      own.names.length > 1 &&
        choose("Lines and rows", knobs, chosen.other, swap("other", "across")),
      left.map((name) =>
        choose(own.labelOf(name), result.vary[name].map(String), String(fixed[name]), (value) => {
          fixed[name] = value;
        }),
      ),
    );
    figures[0].show(shown("parallel", "All runs", "Which values lead to good runs?", drawParallel));
    places[1].hidden = own.names.length < 2;
    if (own.names.length > 1)
      figures[1].show(shown("map", "Two knobs", "Do the two depend on one another?", drawMap));
    figures[2].show(
      shown("curve", "One knob", "What does it change, and is that more than chance?", drawCurve),
    );
  }

  const { best } = result;
  const measure = result.measures.find((one) => one.key === best.measure);
  fill(
    place,
    card(
      "",
      element(
        "p",
        { className: "lead" },
        `Best: ${best.point}, ${words(best.mean)}${measure.unit ? ` ${measure.unit}` : ""} (${measure.label.toLowerCase()}, mean over ${result.seeds.length} seeds).`,
      ),
      choices,
      hint("A click on a line, a cell or a point opens that run at its worst frame."),
    ),
    ...places,
  );
  show();
}

const tip = (own, row) =>
  tipOf(row.run, [
    ...own.names.map((name) => [own.labelOf(name), row[name]]),
    ["seed", row.seed],
    ...own.result.measures.map((one) => [
      one.unit ? `${one.label}, ${one.unit}` : one.label,
      row[one.key],
    ]),
    ["worst frame", row.worst_frame],
  ]);

/** From good to bad: the place of a value among all, 0 to 1. */
function badness(values, measure) {
  const [low, high] = extent(values);
  return (value) =>
    high === low
      ? 0
      : measure.more_is_better
        ? (high - value) / (high - low)
        : (value - low) / (high - low);
}

/** Numbers of an axis with as many digits as tell its ends apart. */
function digitsFor(values) {
  const [low, high] = extent(values);
  const digits = high > low ? Math.max(0, Math.ceil(-Math.log10(high - low)) + 1) : 2;
  return (value) => String(Number(value.toFixed(Math.min(8, digits))));
}

/** Cool where it is good, warm where it is bad. */
const shade = (share) => layerColour(Math.round(share * (SHADE_STEPS - 1)), SHADE_STEPS);

/**
 * Every run as a line across its knobs and measures; the chosen measure colours it.
 * @param {Sheet} sheet
 */
function drawParallel(sheet, own, room) {
  const { runs, measure, names, result, labelOf } = own;
  const good = badness(
    runs.map((row) => row[measure.key]),
    measure,
  );
  const measured = result.measures.filter(
    (one) => runs.some((row) => row[one.key] !== runs[0][one.key]) || one === measure,
  );
  const quiet = { color: token("text-quiet"), fontSize: typeSize(11) };
  const valued = (name) => ({ type: "category", data: inOrder(result.vary[name]).map(String) });
  sheet.option.parallel = {
    left: 60,
    right: 90,
    top: 46,
    height: Math.max(120, room - 84),
    parallelAxisDefault: {
      nameTextStyle: quiet,
      nameLocation: "end",
      nameGap: 16,
      axisLine: { lineStyle: { color: token("line-strong") } },
      axisTick: { show: false },
      splitLine: { show: false },
      axisLabel: {
        ...quiet,
        formatter: (value) => (typeof value === "number" ? words(value) : value),
      },
    },
  };
  sheet.option.parallelAxis = [
    ...names.map((name, dim) => ({ dim, name: labelOf(name), ...valued(name) })),
    ...measured.map((one, at) => ({
      dim: names.length + at,
      type: "value",
      scale: true,
      splitNumber: 4,
      axisLabel: { ...quiet, formatter: digitsFor(runs.map((row) => row[one.key])) },
      name: one.label.replace(/ \(truth\)|, among others at once| that the search/g, ""),
      nameTextStyle: {
        ...quiet,
        color: one === measure ? token("text") : quiet.color,
        fontWeight: one === measure ? 600 : 400,
        width: 130,
        overflow: "truncate",
      },
    })),
  ];
  const best = runs.reduce((found, row) =>
    good(row[measure.key]) < good(found[measure.key]) ? row : found,
  );
  const id = "runs";
  sheet.option.series.push({
    id,
    type: "parallel",
    smooth: false,
    tooltip: { formatter: ({ data: { row } }) => tip(own, row) },
    lineStyle: { width: 1.6, opacity: 0.75 },
    emphasis: { lineStyle: { width: 3.5, opacity: 1 } },
    data: runs.map((row) => ({
      row,
      value: [...names.map((name) => String(row[name])), ...measured.map((one) => row[one.key])],
      lineStyle: { color: shade(good(row[measure.key])), width: row === best ? 3 : 1.6 },
    })),
  });
  sheet.clicks.set(id, ({ data }) => ({ run: data.row }));
  sheet.height = Math.max(sheet.height, room - 8);
  return `${runs.length} runs; the best: ${best.run}, ${measure.label.toLowerCase()} ${words(best[measure.key])}${measure.unit ? ` ${measure.unit}` : ""}. Warmer lines are worse.`;
}

/** The runs of a point, the worst first, as far as the measure has a better end. */
const runsAt = (own, point) =>
  own.runs
    .filter((row) => own.isAt(row, point))
    .sort((a, b) =>
      own.measure.more_is_better
        ? a[own.measure.key] - b[own.measure.key]
        : b[own.measure.key] - a[own.measure.key],
    );

/** Two knobs against each other: the mean over the seeds of every point. @param {Sheet} sheet */
function drawMap(sheet, own, room) {
  const { points, measure, chosen, fixed, result, labelOf } = own;
  const [columns, rows] = [inOrder(result.vary[chosen.across]), inOrder(result.vary[chosen.other])];
  const found = points.filter(
    (row) => row.measure === measure.key && own.isAt(row, fixed) && row.mean !== null,
  );
  const [low, high] = extent(found.map((row) => row.mean));
  // The far end of the colours is the one that stands out from the page, whatever the theme.
  const stands = (mean) =>
    (high > low ? (measure.more_is_better ? high - mean : mean - low) / (high - low) : 0) > 0.6;
  const cells = found.map((row) => ({
    label: { color: token(stands(row.mean) ? "surface" : "text") },
    value: [
      columns.findIndex((one) => sameValue(one, row[chosen.across])),
      rows.findIndex((one) => sameValue(one, row[chosen.other])),
      row.mean,
    ],
    row,
  }));
  const [box] = sheet.columns(1, { height: Math.max(120, room - 76), gutters: 110, right: 90 });
  const width = Math.min(box.width, columns.length * 180);
  const plot = sheet.plot(
    { ...box, width },
    {
      title: measure.label,
      unit: dotted(
        measure.unit,
        "mean over seeds",
        ...Object.entries(fixed).map(([name, value]) => `${labelOf(name)} ${value}`),
      ),
      x: categories(columns.map(String), labelOf(chosen.across)),
      y: categories(rows.map(String), labelOf(chosen.other), { nameGap: 56 }),
    },
  );
  const pointOf = (row) => ({
    ...fixed,
    [chosen.across]: row[chosen.across],
    [chosen.other]: row[chosen.other],
  });
  const shades = measure.more_is_better ? [...SHADES].reverse() : SHADES;
  sheet.heat(plot, {
    cells,
    low,
    high,
    colours: shades,
    ends: [words(high), words(low)],
    key: 110,
    click: ({ data }) => ({ run: runsAt(own, pointOf(data.row))[0] }),
    tip: ({ data: { row } }) =>
      tipOf(
        `${labelOf(chosen.across)} ${row[chosen.across]}, ${labelOf(chosen.other)} ${row[chosen.other]}`,
        [
          ["mean", row.mean],
          ["95 % interval", `${words(row.low)} to ${words(row.high)}`],
          ["opens", runsAt(own, pointOf(row))[0].run],
        ],
      ),
  });
  sheet.option.series.at(-1).label = {
    show: cells.length <= 80,
    formatter: ({ data: { row } }) => words(row.mean),
    fontSize: typeSize(11),
  };
  const end = [...found].sort((a, b) =>
    measure.more_is_better ? b.mean - a.mean : a.mean - b.mean,
  )[0];
  return end
    ? `${measure.more_is_better ? "Most" : "Least"} at ${labelOf(chosen.across)} ${end[chosen.across]}, ${labelOf(chosen.other)} ${end[chosen.other]}: ${words(end.mean)}${measure.unit ? ` ${measure.unit}` : ""} [${words(end.low)}, ${words(end.high)}].`
    : "";
}

/**
 * Over one knob: a line for each value of the other, the mean with its interval, every seed a dot.
 * @param {Sheet} sheet
 */
function drawCurve(sheet, own, room) {
  const { points, runs, measure, chosen, fixed, result, labelOf } = own;
  const across = inOrder(result.vary[chosen.across]);
  const isNumber = across.every((value) => typeof value === "number");
  const place = (value) => (isNumber ? value : String(value));
  const lines = chosen.other ? inOrder(result.vary[chosen.other]) : [null];
  const name = (value) => (value === null ? measure.label : `${labelOf(chosen.other)} ${value}`);
  const [box] = sheet.columns(1, { height: Math.max(120, room - 76), gutters: 66, right: 24 });
  const plot = sheet.plot(box, {
    title: measure.label,
    unit: dotted(
      measure.unit,
      "mean and 95 % interval over seeds; a dot is a run",
      ...Object.entries(fixed).map(([knob, value]) => `${labelOf(knob)} ${value}`),
    ),
    names: chosen.other ? lines.map(name) : null,
    x: isNumber
      ? numbers(labelOf(chosen.across))
      : categories(across.map(String), labelOf(chosen.across)),
    y: numbers(""),
  });
  const said = [];
  lines.forEach((line, at) => {
    const fits = (row) =>
      own.isAt(row, { ...fixed, ...(line === null ? {} : { [chosen.other]: line }) });
    const ordered = points
      .filter((row) => row.measure === measure.key && row.mean !== null && fits(row))
      .sort(
        (a, b) =>
          across.findIndex((one) => sameValue(one, a[chosen.across])) -
          across.findIndex((one) => sameValue(one, b[chosen.across])),
      );
    const colour = seriesColour(at);
    sheet.line(
      plot,
      name(line),
      ordered.map((row) => [place(row[chosen.across]), row.mean]),
      colour,
      /** @type {any} */ ({
        click: ({ dataIndex }) => ({
          run: runsAt(own, {
            ...fixed,
            ...(line === null ? {} : { [chosen.other]: line }),
            [chosen.across]: ordered[dataIndex][chosen.across],
          })[0],
        }),
        tip: ({ dataIndex }) =>
          tipOf(`${labelOf(chosen.across)} ${ordered[dataIndex][chosen.across]}`, [
            [name(line), ordered[dataIndex].mean],
            [
              "95 % interval",
              `${words(ordered[dataIndex].low)} to ${words(ordered[dataIndex].high)}`,
            ],
          ]),
      }),
    );
    sheet.series(plot, {
      type: "custom",
      silent: true,
      z: 1,
      tooltip: { show: false },
      encode: { x: 0, y: [1, 2] },
      data: ordered.map((row) => [place(row[chosen.across]), row.low, row.high]),
      renderItem: (_, api) => {
        const [low, high] = [1, 2].map((end) => api.coord([api.value(0), api.value(end)]));
        const stroke = (x1, y1, x2, y2) => ({
          type: "line",
          shape: { x1, y1, x2, y2 },
          style: { stroke: colour, lineWidth: 1.4, opacity: 0.8 },
        });
        return {
          type: "group",
          children: [
            stroke(low[0], low[1], high[0], high[1]),
            ...[low, high].map(([x, y]) => stroke(x - CAP, y, x + CAP, y)),
          ],
        };
      },
    });
    const dots = runs.filter(fits);
    sheet.series(plot, {
      type: "scatter",
      z: 0,
      symbolSize: 8,
      data: dots.map((row) => ({ value: [place(row[chosen.across]), row[measure.key]], row })),
      itemStyle: { color: colour, opacity: 0.35 },
      click: ({ data }) => ({ run: data.row }),
      tip: ({ data: { row } }) => tip(own, row),
    });
    const end = [...ordered].sort((a, b) =>
      measure.more_is_better ? b.mean - a.mean : a.mean - b.mean,
    )[0];
    if (end)
      said.push(
        `${line === null ? "" : `${name(line)}: `}${measure.more_is_better ? "most" : "least"} at ${end[chosen.across]} (${words(end.mean)})`,
      );
  });
  return `${distinct(said).join("; ")}.`;
}
