// ECharts with the studio's tokens: one place that knows how a chart looks here.

import * as echarts from "../vendor/echarts.esm.min.js";
import { drawSoon } from "./drawing.js";
import { onTheme, theme, token } from "./theme.js";

const FAMILY = "Inter, system-ui, sans-serif";

/** Three significant figures unless more are needed. */
export function figure(value) {
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-3) return value.toExponential(2);
  return String(Number(value.toPrecision(3)));
}

/** A chart in an element: drawn with the others and only while it is seen (see drawing.js), redrawn with theme and size. */
export class Chart {
  /** empty: what is said when there is nothing to draw. wire: called with the ECharts instance once it is made. */
  constructor(id, { empty, wire = () => {} }) {
    this.element = document.getElementById(id);
    this.emptyText = empty;
    this.wire = wire;
    this.redrawn = () => this.redraw();
    this.make = null;
    this.stale = false;
    this.chart = null;
    new ResizeObserver(() => this.resized()).observe(this.element);
    onTheme(() => this.redraw());
    document.fonts.ready.then(() => this.redraw());
  }

  /** Draw what `make()` returns; null draws the empty state. */
  draw(make) {
    this.make = make;
    drawSoon(this.redrawn);
  }

  redraw() {
    this.stale = !this.element.clientWidth;
    if (!this.make || this.stale) return;
    if (!this.chart) {
      this.chart = echarts.init(this.element, null, { renderer: "canvas" });
      this.wire(this.chart);
    }
    this.chart.setOption({ ...look(), ...(this.make() ?? nothing(this.emptyText)) }, { notMerge: true });
    this.say();
  }

  /** What the picture was drawn for, for whoever waits for it. */
  say() { this.element.dataset.drawn = `${theme()} ${this.element.clientWidth}x${this.element.clientHeight}`; }

  resized() {
    if (!this.element.clientWidth) return;
    this.chart?.resize();
    if (this.stale || !this.chart) this.redraw();
    else this.say();
  }
}

function nothing(text) {
  return { xAxis: undefined, yAxis: undefined, series: [], graphic: { type: "text", left: "center", top: "middle", style: { text, fill: token("text-quiet"), font: `450 13px ${FAMILY}` } } };
}

function look() {
  return {
    animation: false,
    backgroundColor: "transparent",
    textStyle: { fontFamily: FAMILY, fontSize: 11, color: token("text") },
    grid: { left: 56, right: 16, top: 42, bottom: 34 },
    tooltip: tooltip(),
  };
}

/** The tooltip's look, to be merged with a chart's own formatter. */
export const tooltip = (more = {}) => ({
  backgroundColor: token("surface-raised"), borderColor: token("line-strong"), confine: true,
  textStyle: { color: token("text"), fontFamily: FAMILY, fontSize: 12 }, ...more,
});

/** A title at the chart's top left, with its unit in a quieter tone. */
export const title = (text, unit = "") => ({
  left: 12, top: 8, text: unit ? `{a|${text}} {b|${unit}}` : `{a|${text}}`,
  textStyle: {
    fontWeight: "normal",
    rich: {
      a: { color: token("text"), fontWeight: 600, fontSize: 12, fontFamily: FAMILY },
      b: { color: token("text-quiet"), fontWeight: 450, fontSize: 11, fontFamily: FAMILY, padding: [0, 0, 0, 4] },
    },
  },
});

/** An axis in the page's tones. */
export const axis = (more = {}) => ({
  axisLine: { lineStyle: { color: token("line-strong") } },
  axisTick: { show: false },
  axisLabel: { color: token("text-quiet"), fontSize: 11, ...(more.axisLabel ?? {}) },
  splitLine: { lineStyle: { color: token("line") } },
  nameTextStyle: { color: token("text-quiet"), fontSize: 11 },
  ...Object.fromEntries(Object.entries(more).filter(([key]) => key !== "axisLabel")),
});

/** The legend in the top right corner. */
export const legend = (data) => ({ right: 12, top: 6, itemWidth: 12, itemHeight: 8, data, textStyle: { color: token("text-quiet"), fontSize: 11 } });
