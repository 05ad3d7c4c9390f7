// Charts given as plain values (studio/results/comparison/findings.py), drawn alike in the report
// and in the studio's pages.

import { element } from "./elements.js";
import { heatOption, legendEntries, legendName, seriesOption } from "./findings_options.js";

const PRINT_WIDTH = 660;

const root = document.documentElement;
/** @type {Set<Drawing>} */
const shown = new Set();

const NEAR = 10;

/** Put a chart with title and legend into a place. It is drawn once it comes into view, and again with theme and
    size. choose: called with the name of a bar or of the nearest curve that is clicked, and the place of the value along
    x. Returns a function that takes it away. @param {(name: string, at: number) => void} [choose] */
export function drawChart(place, chart, echarts, choose = undefined) {
  const drawing = new Drawing(place, whole(chart), echarts, choose);
  shown.add(drawing);
  return () => {
    shown.delete(drawing);
    drawing.dispose();
  };
}

new MutationObserver(() => {
  for (const drawing of shown) drawing.redraw();
}).observe(root, { attributeFilter: ["data-theme"] });
addEventListener("beforeprint", () => {
  for (const drawing of shown) drawing.print();
});
addEventListener("afterprint", () => {
  for (const drawing of shown) drawing.resize();
});

class Drawing {
  constructor(place, chart, echarts, choose) {
    this.chart = chart;
    this.echarts = echarts;
    this.choose = choose;
    this.drawn = null;
    this.entries = legendEntries(chart);
    this.canvas = element("div", {
      className: "findings-canvas",
      role: "img",
      ariaLabel: `${chart.title}. ${chart.y} over ${chart.x}.`,
    });
    if (chart.heat)
      this.canvas.style.height = `${Math.min(520, 110 + 34 * chart.heat.rows.length)}px`;
    this.legend = element(
      "div",
      { className: "findings-legend" },
      ...this.entries.map((entry) => this.legendButton(entry)),
    );
    this.legend.hidden = this.entries.length < 2;
    place.classList.add("findings-chart");
    place.replaceChildren(element("figcaption", {}, chart.title), this.legend, this.canvas);
    this.seen = new IntersectionObserver(
      (entries) => {
        if (entries.some((entry) => entry.isIntersecting)) this.redraw(true);
      },
      { rootMargin: "600px" },
    );
    this.seen.observe(this.canvas);
    this.sized = new ResizeObserver(() => this.resize());
    this.sized.observe(this.canvas);
  }

  legendButton(entry) {
    const mark = element("i", {
      className: entry.dashed ? "dashed" : this.chart.kind === "lines" ? "line" : "block",
    });
    mark.style.setProperty("--swatch", entry.colour);
    const button = element(
      "button",
      { type: "button", ariaPressed: "true", title: "Show or hide" },
      mark,
      entry.name,
    );
    button.onclick = () => {
      const on = button.ariaPressed !== "true";
      button.ariaPressed = String(on);
      this.redraw(true);
      this.drawn.dispatchAction({ type: on ? "legendSelect" : "legendUnSelect", name: entry.name });
    };
    return button;
  }

  redraw(first = false) {
    if (!this.drawn && !first) return;
    if (!this.canvas.clientWidth) return;
    const selected = this.drawn?.getOption().legend?.[0]?.selected ?? {};
    this.drawn ??= this.begun();
    const option = this.chart.heat
      ? heatOption(this.chart)
      : seriesOption(this.chart, this.canvas.clientWidth, selected);
    this.drawn.setOption(option, { notMerge: true });
    this.canvas.dataset.drawn = root.dataset.theme ?? "";
  }

  begun() {
    const drawn = this.echarts.init(this.canvas, null, { renderer: "svg" });
    if (this.choose && this.chart.kind === "bars")
      drawn.on("click", ({ seriesName, dataIndex }) => this.choose(seriesName, dataIndex));
    else if (this.choose) {
      const sheet = drawn.getZr();
      sheet.on("click", ({ offsetX, offsetY }) => {
        const found = this.nearest(offsetX, offsetY);
        if (found) this.choose(found.name, found.at);
      });
      sheet.on("mousemove", ({ offsetX, offsetY }) =>
        sheet.setCursorStyle(this.nearest(offsetX, offsetY) ? "pointer" : "default"),
      );
    }
    return drawn;
  }

  /**
   * The curve within reach of a place of the sheet, px, and its value that is nearest along x; a
   * group's thin curves before its thick one.
   */
  nearest(x, y) {
    if (!this.drawn.containPixel("grid", [x, y])) return null;
    const selected = this.drawn.getOption().legend[0].selected;
    const grouped = new Set(
      this.chart.series.filter((series) => series.thin).map((series) => series.group),
    );
    const [value] = this.drawn.convertFromPixel("grid", [x, y]);
    let best = { name: "", at: 0, away: NEAR };
    for (const series of this.chart.series) {
      if (
        selected[legendName(this.chart, series)] === false ||
        (!series.thin && grouped.has(series.group))
      )
        continue;
      const at = series.x.reduce(
        (found, one, index) =>
          Math.abs(one - value) < Math.abs(series.x[found] - value) ? index : found,
        0,
      );
      const [before, here, after] = [at - 1, at, at + 1].map((index) =>
        Number.isFinite(series.y[index])
          ? this.drawn.convertToPixel("grid", [series.x[index], series.y[index]])
          : null,
      );
      if (!here) continue;
      const away = Math.min(
        segmentDistance([x, y], before ?? here, here),
        segmentDistance([x, y], here, after ?? here),
      );
      if (away < best.away) best = { name: series.name, at, away };
    }
    return best.name ? best : null;
  }

  resize() {
    if (!this.drawn || !this.canvas.clientWidth) return;
    this.drawn.resize({ width: "auto" });
    this.redraw();
  }

  print() {
    this.redraw(true);
    this.drawn?.resize({ width: Math.min(PRINT_WIDTH, this.drawn.getWidth()) });
  }

  dispose() {
    this.seen.disconnect();
    this.sized.disconnect();
    this.drawn?.dispose();
  }
}

/** How far a place is from a stretch between two others, px. */
function segmentDistance([x, y], [x1, y1], [x2, y2]) {
  const [dx, dy] = [x2 - x1, y2 - y1];
  const share =
    dx || dy ? Math.min(1, Math.max(0, ((x - x1) * dx + (y - y1) * dy) / (dx * dx + dy * dy))) : 0;
  return Math.hypot(x - x1 - share * dx, y - y1 - share * dy);
}

/** A chart with everything said that may be left out. */
const whole = (chart) => ({
  heat: null,
  categories: [],
  paper: null,
  bands: [],
  ...chart,
  series: (chart.series ?? []).map((series) => ({
    low: [],
    high: [],
    group: "",
    thin: false,
    dashed: false,
    ...series,
  })),
});
