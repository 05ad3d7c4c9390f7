// Charts given as plain values (studio/comparison/findings.py), drawn alike in the report and in the studio's pages.

import { element } from "./elements.js";
import { heatOption, legendEntries, seriesOption } from "./findings_options.js";

const PRINT_WIDTH = 660;

const root = document.documentElement;
/** @type {Set<Drawing>} */
const shown = new Set();

/** Put a chart with title and legend into a place. It is drawn once it comes into view, and again with theme and
    size. Returns a function that takes it away. */
export function drawChart(place, chart, echarts) {
  const drawing = new Drawing(place, whole(chart), echarts);
  shown.add(drawing);
  return () => { shown.delete(drawing); drawing.dispose(); };
}

new MutationObserver(() => { for (const drawing of shown) drawing.redraw(); }).observe(root, { attributeFilter: ["data-theme"] });
addEventListener("beforeprint", () => { for (const drawing of shown) drawing.print(); });
addEventListener("afterprint", () => { for (const drawing of shown) drawing.resize(); });

class Drawing {
  constructor(place, chart, echarts) {
    this.chart = chart;
    this.echarts = echarts;
    this.drawn = null;
    this.entries = legendEntries(chart);
    this.canvas = element("div", { className: "findings-canvas", role: "img", ariaLabel: `${chart.title}. ${chart.y} over ${chart.x}.` });
    if (chart.heat) this.canvas.style.height = `${Math.min(520, 110 + 34 * chart.heat.rows.length)}px`;
    this.legend = element("div", { className: "findings-legend" }, ...this.entries.map((entry) => this.legendButton(entry)));
    this.legend.hidden = this.entries.length < 2;
    place.classList.add("findings-chart");
    place.replaceChildren(element("figcaption", {}, chart.title), this.legend, this.canvas);
    this.seen = new IntersectionObserver((entries) => { if (entries.some((entry) => entry.isIntersecting)) this.redraw(true); }, { rootMargin: "600px" });
    this.seen.observe(this.canvas);
    this.sized = new ResizeObserver(() => this.resize());
    this.sized.observe(this.canvas);
  }

  legendButton(entry) {
    const mark = element("i", { className: entry.dashed ? "dashed" : this.chart.kind === "lines" ? "line" : "block" });
    mark.style.setProperty("--swatch", entry.colour);
    const button = element("button", { type: "button", ariaPressed: "true", title: "Show or hide" }, mark, entry.name);
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
    this.drawn ??= this.echarts.init(this.canvas, null, { renderer: "svg" });
    const option = this.chart.heat ? heatOption(this.chart) : seriesOption(this.chart, this.canvas.clientWidth, selected);
    this.drawn.setOption(option, { notMerge: true });
    this.canvas.dataset.drawn = root.dataset.theme ?? "";
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

/** A chart with everything said that may be left out. */
const whole = (chart) => ({
  heat: null, categories: [], paper: null, bands: [], ...chart,
  series: (chart.series ?? []).map((series) => ({ low: [], high: [], group: "", thin: false, dashed: false, ...series })),
});
