// A sheet of drawings: several plots beside and below one another in one chart, so that they are
// seen, exported and printed together. A drawing function fills one; what of it can be clicked says
// what it chooses.

import { axis, figure, token, typeSize } from "./chart_looks.js";
import { penOf } from "./elements.js";

const HEADING = 30,
  LEGEND = 17,
  WORD = 12;
/**
 * Pixels below which what stands side by side stands one below the other, and how high it is there
 * at least.
 */
export const NARROW = 640;
const STACKED = 150;
const KEY_GAP = 10;
/** How high the key of a map's colours is. */
export const KEY = 80;
const HEAT = ["heat-lowest", "heat-low", "heat-middle", "heat-high"];
const SPLIT = "stored and tried";
const GROUPS = "groups";
const FAMILY = "Inter, system-ui, sans-serif";

/**
 * @typedef {{ left: number, top?: number, width: number, height: number, isBelow?: boolean }} Box
 *   pixels of the plot itself, without its labels; `isBelow`: it stands below all that is on the
 *   sheet so far
 * @typedef {Record<string, any>} Changes of the selection
 */

const pen = penOf(document.createElement("canvas"));

/**
 * A text that takes at most `width` pixels: whole words of it, none where less than half of it
 * fits.
 */
function shortened(text, width) {
  if (pen.measureText(text).width <= width) return text;
  let kept = text;
  while (kept && pen.measureText(`${kept}…`).width > width)
    kept = kept.slice(0, Math.max(0, kept.lastIndexOf(" ")));
  return 2 * kept.length > text.length ? `${kept.replace(/[,;]$/, "")}…` : "";
}

/** A text as it is where it takes at most `width` pixels, else its beginning with an ellipsis. */
function fitted(text, width) {
  let kept = text;
  while (kept.length > 1 && pen.measureText(kept === text ? text : `${kept}…`).width > width)
    kept = kept.slice(0, -1).trimEnd();
  return kept === text ? text : `${kept}…`;
}

/** A sheet of `width` pixels that grows with what is put on it. */
export class Sheet {
  /** @type {Record<string, any>} */
  option = {
    animation: false,
    title: [],
    grid: [],
    xAxis: [],
    yAxis: [],
    series: [],
    visualMap: [],
    legend: [],
    tooltip: { trigger: "item" },
  };
  /** @type {Map<string, (event: any) => Changes | null>} */
  clicks = new Map();
  /**
   * What is called with a place in a plot that is clicked where nothing is.
   * @type {{ box: Box, index: number, act: (x: number, y: number) => Changes | null }[]}
   */
  grounds = [];
  /** Where headings stand, pixels. @type {{ left: number, right: number, top: number }[]} */
  headings = [];
  height = 0;

  constructor(width) {
    this.width = width;
  }

  /**
   * Places of plots side by side, of equal (or given) shares of the width, each with room for
   * labels at its left; on a narrow sheet one below the other, unless `stacks` is false. `height`:
   * of all, or of each; `least`: that each needs where it stands alone.
   * @param {number} count
   * @param {{ height?: number | number[], least?: number | number[], gutters?: number | number[],
   *   right?: number, shares?: number[], stacks?: boolean }} [how]
   * @returns {Box[]}
   */
  columns(
    count,
    {
      height = STACKED,
      least = 0,
      gutters = 58,
      right = 16,
      shares = Array(count).fill(1),
      stacks = true,
    } = {},
  ) {
    const each = (value) => (Array.isArray(value) ? value : Array(count).fill(value));
    const [rooms, heights, needed] = [each(gutters), each(height), each(least)];
    if (stacks && count > 1 && this.width < NARROW) {
      return rooms.map((room, at) => ({
        left: room,
        width: Math.max(40, this.width - room - right),
        height: Math.max(STACKED, needed[at]),
        isBelow: true,
      }));
    }
    const free = this.width - rooms.reduce((sum, one) => sum + one, 0) - right * count;
    const whole = shares.reduce((sum, one) => sum + one, 0);
    let left = 0;
    return shares.map((share, at) => {
      left += rooms[at];
      const width = Math.max(40, (free * share) / whole);
      const made = { left, width, height: heights[at] };
      left += width + right;
      return made;
    });
  }

  /**
   * A plot with its axes. `x`, `y`: ECharts' axes; returns its number, by which series name it.
   * @param {Box} box
   * @param {{ title?: string, unit?: string, x: any, y: any, below?: number, names?: string[] | null,
   *   over?: ((points: any[]) => string) | null,
   *   click?: ((x: number, y: number) => Changes | null) | null }} more
   */
  plot(box, { title = "", unit = "", x, y, below = 34, names = null, over = null, click = null }) {
    const index = this.option.grid.length;
    const { left, width } = box;
    const start = box.top ?? (box.isBelow ? this.height : 0);
    // A legend, an axis above the plot and the names of its groups there take a line each.
    const above = x.position === "top" ? LEGEND * (x.groups ? 2 : 1) : 0;
    const lines = (names ? LEGEND : 0) + above;
    const top = start + (title ? HEADING : 8) + lines;
    const height = Math.max(40, box.height - lines);
    if (title) this.heading(title, unit, left, start, box.isBelow ? this.width - left : width + 12);
    if (names) this.legend(names, left, start + HEADING - 7, width);
    this.option.grid.push({
      left,
      top,
      width,
      height,
      ...(over
        ? {
            tooltip: {
              trigger: "axis",
              formatter: (points) => over(Array.isArray(points) ? points : [points]),
            },
          }
        : {}),
    });
    this.option.xAxis.push(axis({ gridIndex: index, ...x }));
    this.option.yAxis.push(axis({ gridIndex: index, ...y }));
    this.height = Math.max(this.height, top + height + below);
    if (click) this.grounds.push({ box: { left, top, width, height }, index, act: click });
    if (x.groups) this.groups(index, x.groups, x.position === "top");
    return index;
  }

  /**
   * Names of groups of an axis's categories, outside of its numbers, and lines between the groups.
   * @param {{ name: string, short: string, first: number, last: number }[]} groups
   */
  groups(plot, groups, isAbove) {
    const size = typeSize(10);
    this.series(plot, {
      type: "custom",
      silent: true,
      z: 5,
      tooltip: { show: false },
      encode: { x: [], y: [] },
      clip: false,
      name: GROUPS,
      data: groups.map((_, at) => [at]),
      renderItem: ({ coordSys }, api) => {
        const { name, short, first, last } = groups[api.value(0)];
        const half = api.size([1, 0])[0] / 2;
        const [from, to] = [api.coord([first, 0])[0] - half, api.coord([last, 0])[0] + half];
        pen.font = `${size}px ${FAMILY}`;
        const text = pen.measureText(name).width + 6 > to - from ? short : name;
        const [top, bottom] = [coordSys.y, coordSys.y + coordSys.height];
        const y = isAbove ? top - LEGEND - 9 : bottom + 25;
        const words = {
          type: "text",
          style: {
            text,
            x: (from + to) / 2,
            y,
            align: "center",
            verticalAlign: "middle",
            fill: token("text-quiet"),
            fontSize: size,
            fontFamily: FAMILY,
          },
        };
        const [start, end] = isAbove ? [top - 2 * LEGEND, bottom] : [top, bottom + 32];
        const line = {
          type: "line",
          shape: { x1: from, x2: from, y1: start, y2: end },
          style: { stroke: token("line-strong"), lineWidth: 1.2 },
        };
        return { type: "group", children: first > 0 ? [words, line] : [words] };
      },
    });
    this.option.series.at(-1).isFrame = true;
  }

  /**
   * A heading of a plot. One that is wider than the sheet has room for begins farther left, as far as
   * the heading beside it allows, and is shortened where that is not enough.
   */
  heading(words, whole, left, top, width = Infinity) {
    pen.font = `600 ${typeSize(12)}px ${FAMILY}`;
    const besides = this.headings.filter((one) => one.top === top && one.left < left);
    const first = Math.max(0, ...besides.map((one) => one.right + KEY_GAP));
    const most = this.width - KEY_GAP;
    const beyond = left + pen.measureText(words).width - most;
    const start = Math.max(Math.min(first, left), left - Math.max(0, beyond));
    const text = fitted(words, most - start);
    const end = start + pen.measureText(text).width;
    pen.font = `11px ${FAMILY}`;
    const unit = shortened(whole, width - (end - left) - 12);
    const right = end + (unit ? pen.measureText(unit).width + 12 : 0);
    this.headings.push({ left: start, right, top });
    this.option.title.push({
      left: start - 2,
      top: top + 6,
      text: unit ? `{a|${text}}  {b|${unit}}` : `{a|${text}}`,
      padding: 0,
      textStyle: {
        fontWeight: "normal",
        rich: {
          a: { color: token("text"), fontWeight: 600, fontSize: typeSize(12), fontFamily: FAMILY },
          b: { color: token("text-quiet"), fontSize: typeSize(11), fontFamily: FAMILY },
        },
      },
    });
  }

  /**
   * A series in a plot; `click` says what a click on one of its items chooses, `tip` its words.
   * @param {number} plot
   * @param {{ click?: ((event: any) => Changes | null) | null,
   *   tip?: ((event: any) => string) | null, [more: string]: any }} what
   */
  series(plot, { click = null, tip = null, ...more }) {
    const id = `s${this.option.series.length}`;
    this.option.series.push({
      id,
      xAxisIndex: plot,
      yAxisIndex: plot,
      ...(tip ? { tooltip: { formatter: tip } } : {}),
      ...(click ? {} : { cursor: "default" }),
      ...more,
    });
    if (click) this.clicks.set(id, click);
    return id;
  }

  /** A line; `dashed` and `stepped` as they say. */
  line(
    plot,
    name,
    data,
    colour,
    { dashed = false, stepped = false, symbols = true, width = 2, ...more } = {},
  ) {
    return this.series(plot, {
      name,
      type: "line",
      data,
      step: stepped ? "middle" : false,
      symbol: "circle",
      symbolSize: dashed ? 4 : 6,
      showSymbol: symbols,
      connectNulls: false,
      lineStyle: {
        color: colour,
        type: dashed ? "dashed" : "solid",
        width: dashed ? Math.min(width, 1.5) : width,
      },
      itemStyle: { color: colour },
      ...more,
    });
  }

  /**
   * A map of cells [column, row, value] on two axes of categories; the colours run from `low` to
   * `high`. `key`: how high their key beside it is; 0 for none.
   * @param {number} plot
   * @param {{ cells: any[], low: number, high: number, colours?: string[], ends?: [string, string],
   *   key?: number, click?: ((event: any) => Changes | null) | null, tip: (event: any) => string,
   *   framed?: boolean }} more
   */
  heat(
    plot,
    {
      cells,
      low,
      high,
      colours = HEAT,
      ends = ["", ""],
      key = 0,
      click = null,
      tip,
      framed = true,
    },
  ) {
    this.series(plot, {
      type: "heatmap",
      data: cells,
      click,
      tip,
      progressive: 0,
      emphasis: { itemStyle: { borderColor: token("text"), borderWidth: 1.5 } },
      itemStyle: framed ? { borderColor: token("surface"), borderWidth: 1 } : { borderWidth: 0 },
    });
    this.scale({ low, high, colours, ends, key });
  }

  /**
   * A map whose cells are split along their diagonal: stored above it, `tried` below it, on one
   * scale; with `tried` null a map like any other. A column or row that only one of both has is
   * half empty.
   * @param {number} plot
   * @param {{ cells: any[], tried: any[] | null, low: number, high: number, colours?: string[],
   *   ends?: [string, string], key?: number, framed?: boolean,
   *   click?: (event: any) => Changes | null, tip: (event: any) => string }} more
   */
  splitHeat(plot, { cells, tried, ...more }) {
    if (!tried) return this.heat(plot, { cells, ...more });
    const { low, high, colours = HEAT, ends = ["", ""], key = 0, framed = true } = more;
    const found = (list, side) =>
      list.filter((cell) => Number.isFinite(cell[2])).map((cell) => [...cell.slice(0, 3), side]);
    this.series(plot, {
      name: SPLIT,
      type: "custom",
      click: more.click,
      tip: more.tip,
      progressive: 0,
      clip: true,
      encode: { x: 0, y: 1 },
      data: [...found(cells, 0), ...found(tried, 1)],
      renderItem: (_params, api) => {
        const [x, y] = api.coord([api.value(0), api.value(1)]);
        const [width, height] = api.size([1, 1]).map((size) => size - (framed ? 1 : 0));
        const [left, right] = [x - width / 2, x + width / 2];
        const [top, bottom] = [y - height / 2, y + height / 2];
        const corner = api.value(3) ? [right, bottom] : [left, top];
        const points = [[right, top], corner, [left, bottom]];
        return { type: "polygon", shape: { points }, style: { fill: api.visual("color") } };
      },
    });
    this.scale({ low, high, colours, ends, key });
  }

  /** The scale of the series that was drawn last, by the third number of its data. */
  scale({ low, high, colours, ends, key }) {
    const { left, top, width } = this.option.grid[this.option.series.at(-1).xAxisIndex];
    this.option.visualMap.push({
      type: "continuous",
      min: low,
      max: high === low ? low + 1 : high,
      seriesIndex: this.option.series.length - 1,
      dimension: 2,
      calculable: false,
      show: Boolean(key),
      orient: "vertical",
      itemWidth: 9,
      itemHeight: key,
      left: left + width + KEY_GAP,
      top: top + KEY_GAP,
      text: ends,
      textGap: 4,
      precision: 2,
      hoverLink: false,
      inRange: { color: colours.map(token) },
      textStyle: { color: token("text-quiet"), fontSize: typeSize(10) },
    });
  }

  /**
   * Where the words of vertical lines stand so that none covers another: which side of its line,
   * and how many lines of text below the plot's top.
   * @param {{ x?: any, word?: string }[]} marks
   * @param {[number, number]} range of the axis
   * @param {number} width of the plot, pixels
   * @returns {Map<any, { side: -1 | 1, level: number }>}
   */
  static wordPlaces(marks, [low, high], width) {
    pen.font = `10px ${FAMILY}`;
    const taken = [];
    const places = new Map();
    for (const mark of [...marks].sort((a, b) => a.x - b.x)) {
      const at = (width * (mark.x - low)) / (high - low || 1);
      const size = pen.measureText(mark.word ?? "").width + 6;
      const side = at + size > width ? -1 : 1;
      const [left, right] = side < 0 ? [at - size, at] : [at, at + size];
      const meets = (level) =>
        taken.some((one) => one.level === level && left < one.right && right > one.left);
      let level = 0;
      while (meets(level)) level += 1;
      taken.push({ left, right, level });
      places.set(mark, { side, level });
    }
    return places;
  }

  /**
   * Lines across a plot at values of its axes, each with a word. `range`: of the x axis.
   * @param {number} plot
   * @param {{ x?: any, y?: any, word?: string, colour?: string, dashed?: boolean }[]} marks
   * @param {[number, number] | null} range
   */
  marks(plot, marks, range = null) {
    const shown = marks.filter(
      (one) => (one.x ?? one.y) !== null && (one.x ?? one.y) !== undefined,
    );
    if (!shown.length) return;
    const upright = shown.filter((one) => one.x !== undefined && one.word);
    const width = this.option.grid[plot].width;
    const places = Sheet.wordPlaces(upright, range ?? extent(upright.map((one) => one.x)), width);
    this.series(plot, {
      type: "line",
      data: [],
      silent: true,
      tooltip: { show: false },
      markLine: {
        symbol: "none",
        silent: true,
        animation: false,
        data: shown
          .map((mark) => ({
            ...mark,
            .../** @type {{ side: number, level: number }} */ (
              places.get(mark) ?? { side: 1, level: 0 }
            ),
          }))
          .map(({ x, y, word = "", colour = "text-quiet", dashed = false, side, level }) => ({
            ...(x === undefined ? { yAxis: y } : { xAxis: x }),
            lineStyle: {
              color: token(colour),
              width: 1.4,
              type: dashed ? "dashed" : "solid",
              opacity: 0.9,
            },
            label: {
              show: Boolean(word),
              formatter: word,
              position: x === undefined ? "insideEndTop" : "end",
              rotate: 0,
              offset: [0, WORD * level],
              align: x === undefined || side < 0 ? "right" : "left",
              color: token(colour),
              fontSize: typeSize(10),
              distance: 2,
            },
          })),
      },
    });
  }

  /** A frame around a column and a row of categories (by number or name): what is chosen. */
  chosen(plot, { column = null, row = null }) {
    const bands = [
      ...(column === null ? [] : [[column, null]]),
      ...(row === null ? [] : [[null, row]]),
    ];
    if (!bands.length) return;
    const [x, y] = [this.option.xAxis[plot], this.option.yAxis[plot]];
    const isMap = this.option.series.some(
      (one) => one.xAxisIndex === plot && (one.type === "heatmap" || one.name === SPLIT),
    );
    const place = (axis, value) =>
      typeof value === "number" || axis.type !== "category" ? value : axis.data.indexOf(value);
    this.series(plot, {
      type: "custom",
      silent: true,
      z: 6,
      tooltip: { show: false },
      encode: { x: [], y: [] },
      data: bands.map((_, at) => [at]),
      renderItem: ({ coordSys }, api) => {
        const [across, down] = bands[api.value(0)];
        const isColumn = down === null;
        const at = place(isColumn ? x : y, isColumn ? across : down);
        const most = (isColumn ? x : y).data?.length ?? Infinity;
        if (at === undefined || at < 0 || at >= most) return null;
        const [size, middle] = isColumn
          ? [api.size([1, 0])[0], api.coord([at, 0])[0]]
          : [api.size([0, 1])[1], api.coord([0, at])[1]];
        const room = Math.max(3, size);
        const shape = isColumn
          ? { x: middle - room / 2, y: coordSys.y, width: room, height: coordSys.height }
          : { x: coordSys.x, y: middle - room / 2, width: coordSys.width, height: room };
        return {
          type: "rect",
          shape,
          style: isMap
            ? { fill: "none", stroke: token("accent"), lineWidth: 1.5 }
            : { fill: token("accent"), opacity: 0.2 },
          silent: true,
        };
      },
    });
    this.option.series.at(-1).isFrame = true;
  }

  /** A legend of names of series at a place. */
  legend(names, left, top, width) {
    this.option.legend.push({
      type: "scroll",
      width,
      left,
      top,
      data: names,
      itemWidth: 14,
      itemHeight: 8,
      itemGap: 10,
      padding: 0,
      textStyle: { color: token("text-quiet"), fontSize: typeSize(11) },
      pageIconColor: token("text"),
      pageTextStyle: { color: token("text-quiet") },
      pageIconSize: 9,
    });
  }

  /** Words in place of a plot that has nothing to draw. @param {string} text @param {Box} place */
  words(text, { left, width, isBelow }) {
    const top = isBelow ? this.height + KEY_GAP : HEADING + KEY_GAP;
    this.option.title.push({
      left,
      top,
      padding: 0,
      text,
      textStyle: {
        color: token("text-quiet"),
        fontSize: typeSize(12),
        fontWeight: 450,
        fontFamily: FAMILY,
        width,
        overflow: "break",
        lineHeight: 17,
      },
    });
    this.height = Math.max(this.height, top + 40);
  }
}

/** An axis of categories. */
export const categories = (data, name, /** @type {Record<string, any>} */ more = {}) => ({
  type: "category",
  data,
  name,
  nameLocation: "middle",
  nameGap: 20,
  splitLine: { show: false },
  ...more,
});
/** An axis of numbers. */
export const numbers = (name = "", more = {}) => ({
  type: "value",
  name,
  nameLocation: "middle",
  nameGap: 22,
  scale: true,
  axisLabel: { formatter: (value) => figure(value) },
  ...more,
});
/** A logarithmic axis: only where all numbers are above 0. */
export const logarithmic = (name = "", more = {}) => ({
  type: "log",
  name,
  nameLocation: "middle",
  nameGap: 22,
  axisLabel: { formatter: (value) => figure(value) },
  ...more,
});

/**
 * What is drawn side by side: what is stored, and beside it what was tried, each with its tables
 * and colour.
 * @returns {{ name: string, tables: any, colour: string }[]}
 */
export const sidesOf = (
  tables,
  /** @type {{ tried?: any }} */ { tried = null },
  alone = "accent",
) =>
  tried
    ? [
        { name: "stored", tables, colour: "stored" },
        { name: "tried", tables: tried, colour: "tried" },
      ]
    : [{ name: "", tables, colour: alone }];

/** The numbers of layers of all sides: as many as the longer one has. */
export function layersOfAll(sides, name) {
  const most = Math.max(-1, ...sides.flatMap(({ tables }) => tables[name].map((row) => row.layer)));
  return Array.from({ length: most + 1 }, (_, layer) => layer);
}

/** A column of a side's table, layer by layer; null where the side has no such layer. */
export function byLayer(rows, layers, key) {
  const known = new Map(rows.map((row) => [row.layer, row[key]]));
  return layers.map((layer) => known.get(layer) ?? null);
}

/** The rows of a table by key. */
export const records = (table) =>
  (table?.rows ?? []).map((row) =>
    Object.fromEntries(table.columns.map((column, at) => [column.key, row[at]])),
  );

/** Values in the order of their first appearance. */
export const distinct = (values) => [...new Set(values)];

/** Rows by the value of a key, in order. @returns {Map<any, any[]>} */
export function grouped(rows, key) {
  const groups = new Map();
  for (const row of rows) {
    if (!groups.has(row[key])) groups.set(row[key], []);
    groups.get(row[key]).push(row);
  }
  return groups;
}

/** Least and most of the finite numbers; [0, 1] without any. @returns {[number, number]} */
export function extent(values) {
  const finite = values.filter(Number.isFinite);
  return finite.length ? [Math.min(...finite), Math.max(...finite)] : [0, 1];
}

/** A value of a pose in the unit of the screen: degrees for radians. */
export const onScreen = (value, unit) =>
  unit === "rad" && Number.isFinite(value) ? (value * 180) / Math.PI : value;
/** The unit of the screen. */
export const screenUnit = (unit) => (unit === "rad" ? "°" : unit);
/** A value with its unit, as it is on the screen. */
export const withUnit = (value, unit) =>
  Number.isFinite(value)
    ? `${figure(onScreen(value, unit))}${unit === "rad" ? "°" : unit ? ` ${unit}` : ""}`
    : "–";
const plain = (value) =>
  String(value ?? "–")
    .replaceAll("&", "&amp;")
    .replaceAll("<", "&lt;");
/** Lines of a tooltip: a heading and pairs. @param {[string, any][]} pairs */
export const tipOf = (heading, pairs) =>
  `<b>${plain(heading)}</b>${pairs.map(([name, value]) => `<br>${plain(name)} <b>${typeof value === "number" ? figure(value) : plain(value)}</b>`).join("")}`;
