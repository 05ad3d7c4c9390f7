// The charts of the studio's window: drawn with the others and only while they are seen (see drawing.js).

import * as echarts from "../vendor/echarts.esm.min.js";
import { emptyLook, look } from "./chart_looks.js";
import { drawSoon } from "./pacing.js";
import { byId } from "./elements.js";
import { onTheme, theme } from "./theme.js";

const GRID = { left: 56, right: 16, top: 42, bottom: 34 };

/** A chart in an element, redrawn with theme and size. */
export class Chart {
  /** @type {() => object | null} */
  make = null;
  stale = false;
  /** @type {echarts.Chart} */
  chart = null;
  redrawn = () => this.redraw();

  /** empty: what stands there when there is nothing to draw. wire: called with the ECharts instance once it is made. */
  constructor(id, { empty, wire = (_chart) => {} }) {
    /** @type {HTMLElement} */
    this.element = byId(id);
    this.emptyText = empty;
    this.wire = wire;
    new ResizeObserver(() => this.resized()).observe(this.element);
    onTheme(this.redrawn);
    document.fonts.ready.then(this.redrawn);
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
    this.chart.setOption({ ...look(), grid: GRID, ...(this.make() ?? emptyLook(this.emptyText)) }, { notMerge: true });
    this.sayDrawn();
  }

  /** What the picture was drawn for, for whoever waits for it. */
  sayDrawn() { this.element.dataset.drawn = `${theme()} ${this.element.clientWidth}x${this.element.clientHeight}`; }

  resized() {
    if (!this.element.clientWidth) return;
    this.chart?.resize();
    if (this.stale || !this.chart) this.redraw();
    else this.sayDrawn();
  }
}
