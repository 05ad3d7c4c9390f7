// The variance reduction (Figs. 12-14, 17, 19): a parameters x layers map, and the bars of the layer under the cursor.

import { axis, figure, legend, title, tooltip } from "./chart_looks.js";
import { Chart } from "./charts.js";
import { byId } from "./elements.js";
import { get, set, watch } from "./state.js";
import { token } from "./theme.js";

// The map's lowest colour: a parameter is as good as settled long before.
const LOWEST_SHARE = 1e-2;
const MOST_LEVEL_LABELS = 8;

const labelsOf = (names) => (names.length > MOST_LEVEL_LABELS
  ? { rotate: 50, interval: 0, fontSize: 9.5, width: 76, overflow: "truncate" }
  : { interval: 0 });

// Below this share of its largest, a variance is the rounding of a parameter that a stage keeps where it is.
const ROUNDING = 1e-12;
const MOST_FRAMED_LAYERS = 24;

/** Of every parameter the first layer that moves it (in a swarm's stages that may be a later one), and its variance then. */
function firstMoves(layers) {
  return layers[0].variance_weighed.map((_, at) => {
    const most = Math.max(...layers.map((layer) => layer.variance_weighed[at]));
    const number = layers.findIndex((layer) => layer.variance_weighed[at] > ROUNDING * most);
    return { number, variance: number < 0 ? 0 : layers[number].variance_weighed[at] };
  });
}

/** Share of the first variance that is left, before or after diffusion: rows = layers; NaN before it moves. */
export function shares(layers, key) {
  const first = firstMoves(layers);
  return layers.map((layer, number) => layer[key].map((value, at) => (first[at].variance > 0 && number >= first[at].number ? value / first[at].variance : NaN)));
}

function unitOf(detail, at) {
  return detail.parameters[at].unit === "mm" ? "mm²" : "rad²";
}

function cell(detail, layers, layer, at) {
  const record = layers[layer];
  const share = shares(layers, "variance_resampled")[layer][at];
  const unit = unitOf(detail, at);
  return `<b>${detail.parameters[at].label}</b>, layer ${layer + 1} of ${layers.length}<br>` +
    `as evaluated ${figure(record.variance_weighed[at])} ${unit}<br>before diffusion ${figure(record.variance_resampled[at])} ${unit}<br>` +
    `after diffusion ${figure(record.variance_diffused[at])} ${unit}<br>${Number.isFinite(share) ? `${figure(share * 100)} % of the first layer's` : "held still in this layer"}`;
}

function heat(detail, layers) {
  const left = shares(layers, "variance_resampled");
  const rows = Array.from({ length: Math.max(layers.length, get("layerCount") ?? 0) }, (_, at) => String(at + 1));
  const names = detail.parameters.map((parameter) => parameter.label);
  const cells = left.flatMap((row, layer) => row.map((share, at) => [at, layer, Number.isFinite(share) ? Math.log10(Math.max(share, LOWEST_SHARE)) : "-"]));
  return {
    title: title("Variance left before diffusion", `share of the first layer's, frame ${layers[0].frame}${get("whatIf") ? " re-annealed" : ""}`),
    tooltip: tooltip({ formatter: ({ value }) => cell(detail, layers, value[1], value[0]) }),
    grid: { left: 48, right: 84, top: 32, bottom: names.length > MOST_LEVEL_LABELS ? 62 : 26 },
    xAxis: axis({ type: "category", data: names, axisLabel: labelsOf(names), splitLine: { show: false } }),
    yAxis: axis({ type: "category", inverse: true, name: "layer", nameLocation: "middle", nameGap: 26, data: rows, splitLine: { show: false } }),
    visualMap: {
      min: Math.log10(LOWEST_SHARE), max: 0, calculable: false, orient: "vertical", right: 8, top: 28, itemHeight: 84, itemWidth: 10, precision: 0,
      inRange: { color: ["heat-lowest", "heat-low", "heat-middle", "heat-high"].map(token) },
      text: ["100 %", "1 %"], textStyle: { color: token("text-quiet"), fontSize: 10 },
    },
    series: [{ type: "heatmap", data: cells, itemStyle: { borderColor: token("surface"), borderWidth: rows.length > MOST_FRAMED_LAYERS ? 0 : 1 }, emphasis: { itemStyle: { borderColor: token("text") } } }],
  };
}

function bars(detail, layers, layer) {
  const at = layer ?? layers.length - 1;
  const share = (key) => shares(layers, key)[at].map((value) => (Number.isFinite(value) ? 100 * value : null));
  const names = detail.parameters.map((parameter) => parameter.label);
  return {
    title: title(`Layer ${at + 1} of ${layers.length}`, "of the first layer's variance"),
    legend: { ...legend(["before diffusion", "after diffusion"]), top: 26 },
    tooltip: tooltip({ trigger: "axis", axisPointer: { type: "shadow" }, formatter: (points) => cell(detail, layers, at, points[0].dataIndex) }),
    grid: { left: 44, right: 12, top: 50, bottom: names.length > MOST_LEVEL_LABELS ? 62 : 26 },
    xAxis: axis({ type: "category", data: names, axisLabel: labelsOf(names), splitLine: { show: false } }),
    yAxis: axis({ type: "value", min: 0, axisLabel: { formatter: "{value} %" } }),
    series: [
      { name: "before diffusion", type: "bar", data: share("variance_resampled"), itemStyle: { color: token("layer-1") }, barGap: "0%" },
      { name: "after diffusion", type: "bar", data: share("variance_diffused"), itemStyle: { color: token("layer-8") } },
    ],
  };
}

/** The variance of a frame as CSV: one row a layer and moment, one column a parameter. */
export function varianceCsv(detail, layers) {
  const head = ["frame", "layer", "moment", ...detail.parameters.map((parameter) => parameter.name)];
  const moments = [["weighed", "variance_weighed"], ["before_diffusion", "variance_resampled"], ["after_diffusion", "variance_diffused"]];
  const rows = layers.flatMap((layer, at) => moments.map(([word, key]) => [detail.frame, at, word, ...layer[key]]));
  return `${[head, ...rows].map((row) => row.join(",")).join("\n")}\n`;
}

/** Wire the two charts to the state. */
export function startVariance() {
  const panel = byId("panel-variance");
  let under = null;
  const wire = (chart) => {
    chart.on("mouseover", ({ value }) => { if (value && under !== value[1]) { under = value[1]; draw(); } });
    chart.on("globalout", () => { under = null; draw(); });
    chart.on("click", ({ value }) => value && set({ layer: value[1] }));
  };
  const map = new Chart("chart-heat", { empty: "No layers yet. Track a frame to see where its variance goes.", wire });
  const bar = new Chart("chart-bars", { empty: "" });
  const draw = () => {
    const detail = get("detail");
    const layers = get("whatIf") ?? detail?.layers;
    const shown = detail && layers?.length ? layers : null;
    panel.classList.toggle("blank", !shown);
    map.draw(() => shown && heat(detail, shown));
    bar.draw(() => shown && bars(detail, shown, Math.min(under ?? get("layer") ?? shown.length - 1, shown.length - 1)));
  };
  watch(["detail", "whatIf", "layer", "layerCount"], draw);
}
