// A chart's plain values as ECharts' option, in the colours of tokens.css.

import {
  figure,
  axis as plainAxis,
  look,
  seriesToken,
  token,
  tooltip,
  typeSize,
} from "./chart_looks.js";

const MOST_DECIMALS = 6;
const MOST_WHISKERS = 40;
const MOST_LABELLED_CELLS = 160;
const MARKS = ["circle", "diamond", "rect", "triangle", "roundRect"];

const root = document.documentElement;

/**
 * Ours, the interval's ends and the paper's value of a number in words, as `figures` of
 * findings_files.py has them.
 */
export function figures(number) {
  const own = [number.ours, number.low, number.high];
  const known = own.filter((value) => value !== null);
  const largest = Math.max(0, ...known.map(Math.abs));
  let decimals = largest > 0 ? 2 - Math.floor(Math.log10(largest)) : 0;
  decimals = known.every(Number.isInteger) ? 0 : Math.min(Math.max(decimals, 0), MOST_DECIMALS);
  const alike = (value) =>
    number.paper !== null &&
    value !== number.paper &&
    Math.abs(value - number.paper) < 0.5 * 10 ** -decimals;
  while (decimals < MOST_DECIMALS && known.slice(1).some(alike)) decimals += 1;
  const [ours, low, high] = own.map((value) => (value === null ? "–" : value.toFixed(decimals)));
  return {
    ours,
    low,
    high,
    paper: number.paper === null ? "–" : String(Number(number.paper.toPrecision(6))),
  };
}

/** The groups of a chart in the order in which they appear, each with its colour (a CSS expression). What only the
    paper printed is drawn in the text's own colour. */
function groups(chart) {
  const found = new Map();
  for (const series of chart.series) {
    const name = series.group || series.name;
    if (!found.has(name)) found.set(name, { dashed: true, place: -1 });
    if (!series.dashed) found.get(name).dashed = false;
  }
  let place = 0;
  for (const group of found.values()) {
    group.colour = group.dashed ? "text-quiet" : seriesToken(place);
    group.place = group.dashed ? -1 : place++;
  }
  return found;
}

const groupOf = (series) => series.group || series.name;

/** One entry for each thick series, and for each group that has none. */
export function legendEntries(chart) {
  const known = groups(chart);
  const entries = [];
  const thick = new Set(chart.series.filter((series) => !series.thin).map(groupOf));
  for (const series of chart.series) {
    const name = series.thin ? groupOf(series) : series.name;
    if ((series.thin && thick.has(groupOf(series))) || entries.some((entry) => entry.name === name))
      continue;
    entries.push({
      name,
      colour: `var(--${known.get(groupOf(series)).colour})`,
      dashed: series.dashed,
    });
  }
  return entries;
}

/**
 * The legend entry that shows and hides a series: a thin one goes with the thick one of its group.
 */
export function legendName(chart, series) {
  if (!series.thin) return series.name;
  return (
    chart.series.find((other) => !other.thin && !other.dashed && groupOf(other) === groupOf(series))
      ?.name ?? groupOf(series)
  );
}

const usable = (value, log) => (value === null || (log && value <= 0) ? null : value);

/** @param {string} name @param {Record<string, any>} own */
const axis = (name, { axisLabel = {}, ...more }) =>
  plainAxis({
    name,
    axisLine: { show: true, onZero: false, lineStyle: { color: token("line-strong") } },
    minorSplitLine: { show: false },
    ...more,
    axisLabel: { hideOverlap: true, ...axisLabel },
  });

const below = { nameLocation: "middle", nameGap: 30 };
const above = {
  nameLocation: "end",
  nameGap: 12,
  nameTextStyle: { align: "left", padding: [0, 0, 0, -28] },
};

export function seriesOption(chart, width, selected) {
  const bars = chart.kind === "bars";
  const known = groups(chart);
  const labels = bars ? categoryLabels(chart, width) : {};
  const xAxis = bars
    ? axis(chart.x, {
        type: "category",
        data: chart.categories,
        ...below,
        nameGap: labels.gap,
        splitLine: { show: false },
        axisLabel: labels.label,
      })
    : axis(chart.x, {
        ...below,
        splitLine: { show: false },
        ...(chart.log_x
          ? logarithmic(valuesAlong(chart, "x"))
          : { type: "value", scale: true, ...flush(chart) }),
      });
  const far = farFromZero(chart);
  const yAxis = axis(chart.y, {
    ...above,
    ...(chart.log_y
      ? logarithmic(valuesAlong(chart, "y"))
      : {
          type: "value",
          scale: far,
          boundaryGap: far ? ["6%", "6%"] : [0, 0],
          axisLabel: { formatter: figure },
        }),
  });
  yAxis.nameTextStyle = {
    ...above.nameTextStyle,
    color: token("text-quiet"),
    fontSize: typeSize(11),
  };
  return {
    ...look(),
    legend: { show: false, selected },
    grid: { left: 52, right: 18, top: 34, bottom: bars ? labels.bottom : 46 },
    xAxis,
    yAxis,
    tooltip: tooltip(chart.kind === "lines" ? axisTooltip(chart) : itemTooltip(chart)),
    series: [
      ...ground(chart),
      ...chart.series.flatMap((series) =>
        (chart.stacked ? stackedParts : bars ? barParts : lineParts)(
          chart,
          series,
          known.get(groupOf(series)),
        ),
      ),
    ],
  };
}

/** All finite values along an axis, with the ends of intervals and the paper's value. */
function valuesAlong(chart, way) {
  if (way === "x") return chart.series.flatMap((series) => series.x).filter(Number.isFinite);
  return chart.series
    .flatMap((series) => [...series.y, ...series.low, ...series.high])
    .concat(chart.paper ?? [])
    .filter(Number.isFinite);
}

const bounds = (values) =>
  values.reduce(
    ([least, most], value) => [Math.min(least, value), Math.max(most, value)],
    [Infinity, -Infinity],
  );

/**
 * A logarithmic axis that ends just beyond its values, with labels at powers of ten, or 1-2-5 where
 * these are few.
 */
function logarithmic(values) {
  const above0 = values.filter((value) => value > 0);
  if (!above0.length) return { type: "log" };
  const [least, most] = bounds(above0);
  const decades = Math.log10(most / least);
  const own = [...new Set(above0)].sort((a, b) => a - b);
  const room = decades > 2 ? 1.6 : 1.25;
  const powers = [];
  for (
    let power = Math.floor(Math.log10(least)) - 1;
    power <= Math.ceil(Math.log10(most));
    power += Math.max(1, Math.ceil(decades / 7))
  ) {
    for (const digit of decades > 2 ? [1] : [1, 2, 5]) powers.push(digit * 10 ** power);
  }
  const ticks =
    own.length <= 8 && decades <= 3
      ? own
      : powers.filter((tick) => tick >= least / room && tick <= most * room);
  return {
    type: "log",
    min: least / room,
    max: most * room,
    axisTick: { show: false, customValues: ticks },
    axisLabel: { customValues: ticks, formatter: (value) => logLabel(value, ticks) },
    splitLine: { customValues: ticks },
  };
}

/** A tick's own value (the axis gives it back with rounding errors), small powers as 10⁻⁴. */
function logLabel(value, ticks) {
  const tick = ticks.reduce(
    (best, other) => (Math.abs(other - value) < Math.abs(best - value) ? other : best),
    ticks[0] ?? value,
  );
  const power = Math.log10(tick);
  if (Math.abs(power) < 3.5 || Math.abs(power - Math.round(power)) > 1e-6) return figure(tick);
  return `10${String(Math.round(power)).replace(/[-\d]/g, (sign) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(sign)])}`;
}

/** Long curves fill their chart from the first to the last value. */
function flush(chart) {
  const label = { formatter: figure };
  if (chart.kind !== "lines" || !chart.series.some((series) => series.x.length > MOST_WHISKERS))
    return { axisLabel: label };
  const [least] = bounds(valuesAlong(chart, "x"));
  return {
    min: "dataMin",
    max: "dataMax",
    axisLabel: { ...label, showMinLabel: least % 10 === 0, showMaxLabel: false },
  };
}

function categoryLabels(chart, width) {
  const slot = (width - 70) / Math.max(1, chart.categories.length);
  const longest = Math.max(0, ...chart.categories.map((name) => name.length));
  if (slot < 46 && longest * 6 > slot)
    return {
      label: { interval: 0, rotate: 35, width: 110, overflow: "truncate" },
      gap: 74,
      bottom: 92,
    };
  const lines = Math.min(3, Math.ceil((longest * 6.2) / slot));
  return {
    label: { interval: 0, width: slot - 6, overflow: "break", lineHeight: 14, hideOverlap: false },
    gap: 16 + 14 * lines,
    bottom: 32 + 14 * lines,
  };
}

/**
 * Whether the values lie so far from zero that an axis from zero would flatten them (bars always
 * stand on it).
 */
function farFromZero(chart) {
  if (chart.kind === "bars") return false;
  const [least, most] = bounds(valuesAlong(chart, "y"));
  return least > 0.55 * most || most < 0.55 * least;
}

/** Shaded spans and the paper's line, behind everything. */
function ground(chart) {
  const quiet = token("text-quiet");
  const first =
    chart.kind === "bars" ? 0 : (chart.series.find((series) => series.x.length)?.x[0] ?? 0);
  const data = chart.paper === null ? [] : [[first, usable(chart.paper, chart.log_y)]];
  return [
    {
      id: "ground",
      type: "line",
      data,
      silent: true,
      symbol: "none",
      lineStyle: { opacity: 0 },
      z: 1,
      tooltip: { show: false },
      markLine:
        chart.paper === null
          ? undefined
          : {
              silent: true,
              symbol: "none",
              data: [{ yAxis: chart.paper }],
              lineStyle: { type: [6, 4], color: token("text"), width: 1.2 },
              label: {
                formatter: `paper ${figure(chart.paper)}`,
                position: "insideEndTop",
                color: token("text"),
                fontSize: typeSize(11),
              },
            },
      markArea: chart.bands.length
        ? {
            silent: true,
            itemStyle: { color: token("accent-soft"), opacity: 0.55 },
            label: { color: quiet, fontSize: typeSize(11), position: "insideTop" },
            data: chart.bands.map(([from, to, word]) => [
              { xAxis: from, name: word },
              { xAxis: to },
            ]),
          }
        : undefined,
    },
  ];
}

function lineParts(chart, series, group) {
  const colour = token(group.colour);
  const name = legendName(chart, series);
  const points = series.x.map((x, index) => [
    usable(x, chart.log_x),
    usable(series.y[index], chart.log_y),
  ]);
  const few = series.x.length <= MOST_WHISKERS;
  const parts = [];
  if (series.low.length)
    parts.push(few ? whiskers(chart, series, name, colour) : band(chart, series, name, colour));
  if (chart.kind === "points") {
    const many = points.length > 400;
    parts.push({
      type: "scatter",
      name,
      data: points,
      symbol: series.dashed ? "emptyCircle" : MARKS[Math.max(0, group.place) % MARKS.length],
      symbolSize: series.thin || many ? 4 : 8,
      itemStyle: { color: colour, opacity: series.thin ? 0.35 : many ? 0.5 : 0.9 },
      z: series.thin ? 2 : 4,
      large: false,
    });
  } else {
    parts.push({
      type: "line",
      name,
      data: points,
      silent: series.thin,
      z: series.thin ? 2 : series.dashed ? 5 : 4,
      connectNulls: false,
      showSymbol: few && !series.thin,
      symbol: series.dashed ? "emptyCircle" : MARKS[Math.max(0, group.place) % MARKS.length],
      symbolSize: 6,
      lineStyle: {
        color: colour,
        width: series.thin ? 1 : 2.2,
        opacity: series.thin ? 0.3 : 1,
        type: series.dashed ? [6, 4] : "solid",
      },
      itemStyle: { color: colour },
      emphasis: { disabled: true },
      tooltip: { show: !series.thin },
      id: `${series.thin ? "thin" : "thick"} ${chart.series.indexOf(series)}`,
    });
  }
  return parts;
}

const triples = (chart, series) =>
  series.x.map((x, index) => [
    usable(x, chart.log_x),
    usable(series.low[index], chart.log_y),
    usable(series.high[index], chart.log_y),
  ]);

/** An interval with caps at each point. shift : of the point's place along x, px. */
function whiskers(chart, series, name, colour, shift = (_api) => 0) {
  return {
    type: "custom",
    name,
    data: triples(chart, series),
    encode: { x: 0, y: [1, 2] },
    silent: true,
    z: 5,
    tooltip: { show: false },
    renderItem: (_, api) => {
      if (!Number.isFinite(api.value(1)) || !Number.isFinite(api.value(2))) return null;
      const [x, low] = api.coord([api.value(0), api.value(1)]);
      const high = api.coord([api.value(0), api.value(2)])[1];
      const at = x + shift(api);
      const stroke = (x1, y1, x2, y2) => ({
        type: "line",
        shape: { x1, y1, x2, y2 },
        style: { stroke: colour, lineWidth: 1.4 },
      });
      return {
        type: "group",
        children: [
          stroke(at, low, at, high),
          stroke(at - 4, low, at + 4, low),
          stroke(at - 4, high, at + 4, high),
        ],
      };
    },
  };
}

/** An interval around a line of many points, as one shaded surface. */
function band(chart, series, name, colour) {
  const data = triples(chart, series);
  const whole = data.filter((row) => row.every(Number.isFinite));
  return {
    type: "custom",
    name,
    data,
    encode: { x: 0, y: [1, 2] },
    silent: true,
    z: 2,
    tooltip: { show: false },
    clip: true,
    renderItem: (parameters, api) => {
      if (parameters.dataIndexInside !== 0) return null;
      const points = [
        ...whole.map(([x, low]) => api.coord([x, low])),
        ...whole.toReversed().map(([x, , high]) => api.coord([x, high])),
      ];
      return { type: "polygon", shape: { points }, style: { fill: colour, opacity: 0.16 } };
    },
  };
}

/** A bar's part, on those of the series before it; parts below zero hang from it. */
function stackedParts(chart, series, group) {
  return [
    {
      type: "bar",
      stack: "parts",
      name: legendName(chart, series),
      data: series.x.map((x, index) => [x, usable(series.y[index], false)]),
      barMaxWidth: 64,
      barCategoryGap: "32%",
      itemStyle: { color: token(group.colour) },
    },
  ];
}

/**
 * Bars stand side by side; a thin series is dots on its group's bar; what the paper printed a
 * dashed stroke over it.
 */
function barParts(chart, series, group) {
  const colour = token(group.colour);
  const name = legendName(chart, series);
  const standing = chart.series.filter((other) => !other.thin && !other.dashed);
  const place =
    series.thin || series.dashed
      ? standing.findIndex((other) => groupOf(other) === groupOf(series))
      : standing.indexOf(series);
  const slot = (api) => {
    const layout = api.barLayout({
      count: Math.max(1, standing.length),
      barGap: "12%",
      barCategoryGap: "32%",
      barMaxWidth: 64,
    });
    const whole = layout.reduce(
      (sum, bar) => [Math.min(sum[0], bar.offset), Math.max(sum[1], bar.offset + bar.width)],
      [Infinity, -Infinity],
    );
    return place < 0
      ? { offset: whole[0], offsetCenter: (whole[0] + whole[1]) / 2, width: whole[1] - whole[0] }
      : layout[place];
  };
  const points = series.x.map((x, index) => [x, usable(series.y[index], chart.log_y)]);
  const own = (renderItem, z) => ({
    type: "custom",
    name,
    data: points,
    encode: { x: 0, y: 1 },
    silent: !series.dashed,
    z,
    renderItem,
    itemStyle: { color: colour },
  });
  if (series.thin) {
    return [
      own((_, api) => {
        const [x, y] = api.coord([api.value(0), api.value(1)]);
        return {
          type: "circle",
          shape: { cx: x + slot(api).offsetCenter, cy: y, r: 2.5 },
          style: { fill: token("text"), opacity: 0.45 },
        };
      }, 5),
    ];
  }
  if (series.dashed) {
    return [
      own((_, api) => {
        if (!Number.isFinite(api.value(1))) return null;
        const [x, y] = api.coord([api.value(0), api.value(1)]);
        const { offset, width } = slot(api);
        return {
          type: "line",
          shape: { x1: x + offset - 3, y1: y, x2: x + offset + width + 3, y2: y },
          style: { stroke: token("text"), lineWidth: 1.6, lineDash: [5, 3] },
        };
      }, 6),
    ];
  }
  const bar = {
    type: "bar",
    name,
    data: points,
    itemStyle: { color: colour, borderRadius: [2, 2, 0, 0] },
    barGap: "12%",
    barCategoryGap: "32%",
    barMaxWidth: 64,
    z: 3,
  };
  return series.low.length
    ? [bar, whiskers(chart, series, name, token("text"), (api) => slot(api).offsetCenter)]
    : [bar];
}

/** The thick series' values at the cursor, highest first. */
function axisTooltip(chart) {
  const order = (a, b) => (b.value[1] ?? 0) - (a.value[1] ?? 0);
  return {
    trigger: "axis",
    axisPointer: { lineStyle: { color: token("line-strong") } },
    formatter: (items) => {
      const rows = items
        .filter((item) => String(item.seriesId).startsWith("thick") && item.value[1] !== null)
        .sort(order);
      if (!rows.length) return "";
      return (
        escaped`${chart.x} ${figure(rows[0].value[0])}` +
        rows
          .map(
            (row) =>
              `<br>${row.marker}` + escaped`${row.seriesName}  ` + `<b>${figure(row.value[1])}</b>`,
          )
          .join("")
      );
    },
  };
}

function itemTooltip(chart) {
  return {
    trigger: "item",
    formatter: (item) => {
      const [x, y] = item.value;
      const where = chart.kind === "bars" ? (chart.categories[x] ?? x) : `${chart.x} ${figure(x)}`;
      return (
        escaped`${item.seriesName}` +
        "<br>" +
        escaped`${where}, ${chart.y} ` +
        `<b>${figure(y)}</b>`
      );
    },
  };
}

/** Text with its inserted values made harmless for HTML. */
function escaped(parts, ...values) {
  const safe = (value) => String(value).replace(/[&<>"]/g, (sign) => `&#${sign.charCodeAt(0)};`);
  return parts
    .map((part, index) => part + (index < values.length ? safe(values[index]) : ""))
    .join("");
}

export function heatOption(chart) {
  const { columns, rows, values } = chart.heat;
  const cells = values
    .flatMap((row, y) => row.map((value, x) => [x, y, value]))
    .filter((cell) => cell[2] !== null);
  const all = cells.map((cell) => cell[2]);
  const least = Math.min(...all),
    most = Math.max(...all);
  const widest = Math.max(...rows.map((row) => row.length)) * 6.4 + 16;
  const share = (value) => (most > least ? (value - least) / (most - least) : 0);
  const light = root.dataset.theme === "light";
  const ink = (value) =>
    share(value) > 0.55 === light
      ? "#ffffff"
      : light || share(value) > 0.55
        ? "#101318"
        : "#e8ecf2";
  return {
    ...look(),
    grid: { left: Math.min(220, Math.max(60, widest)), right: 74, top: 30, bottom: 48 },
    xAxis: axis(chart.x, {
      type: "category",
      data: columns,
      ...below,
      splitLine: { show: false },
      axisLine: { show: false },
      axisLabel: { interval: 0, hideOverlap: false },
    }),
    yAxis: {
      ...axis(chart.y, {
        type: "category",
        data: rows,
        inverse: true,
        nameLocation: "start",
        splitLine: { show: false },
        axisLine: { show: false },
        axisLabel: { interval: 0, width: 200, overflow: "truncate" },
      }),
      nameTextStyle: { color: token("text-quiet"), align: "right", fontSize: typeSize(11) },
    },
    visualMap: {
      min: least,
      max: most > least ? most : least + 1,
      dimension: 2,
      right: 8,
      top: 30,
      itemWidth: 10,
      itemHeight: Math.max(60, Math.min(160, 26 * rows.length)),
      calculable: false,
      text: [figure(most), figure(least)],
      textStyle: { color: token("text-quiet"), fontSize: typeSize(11) },
      textGap: 6,
      inRange: { color: ["heat-lowest", "heat-low", "heat-middle", "heat-high"].map(token) },
    },
    tooltip: tooltip({
      formatter: (item) =>
        escaped`${rows[item.value[1]]}, ${columns[item.value[0]]}: ` +
        `<b>${figure(item.value[2])}</b>`,
    }),
    series: [
      {
        type: "heatmap",
        emphasis: { disabled: true },
        itemStyle: { borderColor: token("surface"), borderWidth: 2, borderRadius: 3 },
        data: cells.map((cell) => ({ value: cell, label: { color: ink(cell[2]) } })),
        label: {
          show: cells.length <= MOST_LABELLED_CELLS,
          formatter: (item) => figure(item.value[2]),
          fontSize: typeSize(11),
        },
      },
    ],
  };
}
