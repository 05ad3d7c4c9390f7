// What each layer did: survival wanted and reached, the exponent that brought it about, and its time.

import { Chart, axis, figure, legend, title, tooltip } from "./charts.js";
import { get, watch } from "./state.js";
import { layerColour, token } from "./theme.js";

const names = (layers) => layers.map((_, at) => String(at + 1));

function alpha(layers) {
  const line = (name, key, colour, dash) => ({
    name, type: "line", step: dash ? "middle" : false, data: layers.map((layer) => layer[key]),
    lineStyle: { color: colour, type: dash ? "dashed" : "solid", width: 2 }, itemStyle: { color: colour }, symbolSize: 6,
  });
  return {
    title: title("Survival rate α", "share of particles, Eq. 12"),
    legend: legend(["wanted", "reached"]),
    tooltip: tooltip({ trigger: "axis", valueFormatter: figure }),
    xAxis: axis({ type: "category", data: names(layers), name: "layer", nameLocation: "middle", nameGap: 20 }),
    yAxis: axis({ type: "value", min: 0, max: 1 }),
    series: [line("wanted", "alpha_wanted", token("text-quiet"), true), line("reached", "alpha_reached", token("accent"), false)],
  };
}

function beta(layers) {
  return {
    title: title("Exponent β", "w to the power of β, Eq. 3"),
    tooltip: tooltip({ trigger: "axis", valueFormatter: figure }),
    xAxis: axis({ type: "category", data: names(layers), name: "layer", nameLocation: "middle", nameGap: 20 }),
    yAxis: axis({ type: "log" }),
    series: [{ name: "β", type: "line", data: layers.map((layer) => layer.beta), symbolSize: 6, lineStyle: { color: token("layer-7"), width: 2 }, itemStyle: { color: token("layer-7") } }],
  };
}

function time(layers) {
  const sum = layers.reduce((total, layer) => total + layer.milliseconds, 0);
  return {
    title: title("Time per layer", `ms, ${figure(sum)} in all`),
    tooltip: tooltip({ trigger: "axis", valueFormatter: (value) => `${figure(value)} ms` }),
    xAxis: axis({ type: "category", data: names(layers), name: "layer", nameLocation: "middle", nameGap: 20 }),
    yAxis: axis({ type: "value", name: "ms", min: 0 }),
    series: [{ type: "bar", data: layers.map((layer, at) => ({ value: layer.milliseconds, itemStyle: { color: layerColour(at, layers.length) } })) }],
  };
}

/** Wire the three charts to the state. */
export function startSurvival() {
  const charts = [["chart-alpha", alpha], ["chart-beta", beta], ["chart-time", time]].map(([id, make]) => [new Chart(id, { empty: "No layers yet." }), make]);
  watch(["detail", "whatIf"], () => {
    const layers = get("whatIf") ?? get("detail")?.layers;
    for (const [chart, make] of charts) chart.draw(() => (layers?.length ? make(layers) : null));
  });
}
