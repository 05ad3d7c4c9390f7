// Charts given as plain values (studio/comparison/findings.py), drawn alike in the report and in the studio's pages.

import { figure, figures, heatOption, legendEntries, seriesOption } from "./findings_options.js";

export { figure, figures };

const PRINT_WIDTH = 660;

const root = document.documentElement;
const shown = new Set();

/** An element with attributes and content (text or elements). */
export function make(tag, attributes = {}, ...content) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
  element.append(...content.filter((part) => part !== null && part !== undefined));
  return element;
}

/** Put a chart with title and legend into an element. It is drawn once it comes into view, and again with theme and
    size. Returns a function that takes it away. */
export function drawChart(element, chart, echarts) {
  const drawing = new Drawing(element, chart, echarts);
  shown.add(drawing);
  return () => { shown.delete(drawing); drawing.dispose(); };
}

new MutationObserver(() => shown.forEach((drawing) => drawing.redraw())).observe(root, { attributeFilter: ["data-theme"] });
addEventListener("beforeprint", () => shown.forEach((drawing) => drawing.print()));
addEventListener("afterprint", () => shown.forEach((drawing) => drawing.resize()));

class Drawing {
  constructor(element, chart, echarts) {
    chart = whole(chart);
    this.chart = chart;
    this.echarts = echarts;
    this.drawn = null;
    this.entries = legendEntries(chart);
    this.canvas = make("div", { class: "findings-canvas", role: "img", "aria-label": `${chart.title}. ${chart.y} over ${chart.x}.` });
    if (chart.heat) this.canvas.style.height = `${Math.min(520, 110 + 34 * chart.heat.rows.length)}px`;
    this.legend = make("div", { class: "findings-legend" }, ...this.entries.map((entry) => this.legendButton(entry)));
    this.legend.hidden = this.entries.length < 2;
    element.classList.add("findings-chart");
    element.replaceChildren(make("figcaption", {}, chart.title), this.legend, this.canvas);
    this.seen = new IntersectionObserver((entries) => { if (entries.some((entry) => entry.isIntersecting)) this.redraw(true); }, { rootMargin: "600px" });
    this.seen.observe(this.canvas);
    this.sized = new ResizeObserver(() => this.resize());
    this.sized.observe(this.canvas);
  }

  legendButton(entry) {
    const mark = make("i", { class: entry.dashed ? "dashed" : this.chart.kind === "lines" ? "line" : "block" });
    mark.style.setProperty("--swatch", entry.colour);
    const button = make("button", { type: "button", "aria-pressed": "true", title: "Show or hide" }, mark, entry.name);
    button.onclick = () => {
      const on = button.getAttribute("aria-pressed") !== "true";
      button.setAttribute("aria-pressed", String(on));
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
